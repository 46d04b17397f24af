//! Stages in which bodies move with inertia.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis, Deck, StepsDeck};
use mpm_core::model::{Dynamics, Scheme};

/// Motion with inertia; `{}` for the default settings. Times are then real times in the units of the deck, as is `time`
/// in formulas and curves. Bodies need a density, but no supports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DynamicDeck {
    /// Integration in time.
    #[serde(default)]
    pub scheme: SchemeDeck,
    /// Spectral radius of `generalised-alpha` for infinitely large steps, [-]: 1 damps nothing, 0 annihilates high
    /// frequencies in one step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.8]))]
    pub spectral_radius: Option<f64>,
    /// Damping of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<DampingDeck>,
    /// Share of the velocity of the points that each step replaces by that of the grid, [-]: 0 keeps all motion, 1 damps
    /// what the grid cannot show. The energy lost is reported.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.05]))]
    pub pic: f64,
    /// Mass that resists jumps of the velocity gradient across the faces of cells with hardly any material, relative to
    /// the mass of a full cell, [-]. The energy lost is reported.
    #[serde(default = "ghost_mass")]
    #[schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.0025]))]
    pub ghost_mass: f64,
    /// Period that the steps must resolve, [time]: they are at most a twentieth of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-100, max = 1e100), extend("examples" = [0.5]))]
    pub resolve: Option<f64>,
    /// Largest error of a step, relative to the cell size, [-]: the difference between the motion of the step and that
    /// at constant acceleration. Steps are cut to meet it, and grow again, at most to `largest` of the steps.
    #[serde(default = "largest_error")]
    #[schemars(range(min = 1e-9, max = 1e9), extend("examples" = [0.05]))]
    pub error: f64,
}

/// Integration in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SchemeDeck {
    /// The midpoint rule with stresses that conserve energy, momentum and angular momentum.
    #[default]
    Midpoint,
    /// The generalised-α method, which damps high frequencies as far as `spectral_radius` says.
    GeneralisedAlpha,
    /// Backward Euler, of first order, which damps every motion: a way to static equilibrium.
    BackwardEuler,
}

/// A boundary that absorbs waves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AbsorbDeck {
    /// Name of a boundary condition on nodes that held the bodies in the stage before. It no longer acts, but what it
    /// carried goes on to act as a constant force.
    pub condition: String,
    /// Motion of the ground below, at a free surface on it; half of it comes up as a wave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionDeck>,
}

/// A motion over time, from a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionDeck {
    /// Axis of the motion.
    pub axis: Axis,
    /// File of two columns, separated by commas, blanks or tabs, relative to the deck: time since the first stage with
    /// inertia began, [time], and the quantity. Lines that do not begin with a number are skipped.
    #[schemars(extend("examples" = ["quake.csv"]))]
    pub file: String,
    /// Quantity in the second column.
    #[serde(default)]
    pub quantity: MotionQuantity,
    /// Factor of the second column, [-].
    #[serde(default = "unit")]
    #[schemars(extend("examples" = [9.81]))]
    pub scale: f64,
}

/// Quantity that describes a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MotionQuantity {
    /// Acceleration, [length/time²].
    #[default]
    Acceleration,
    /// Velocity, [length/time].
    Velocity,
}

fn unit() -> f64 {
    1.0
}

impl MotionDeck {
    /// The pairs of time and quantity in the text of the file.
    ///
    /// # Errors
    /// The number of the line that is not understood, from 1, and what is wrong with it.
    pub fn pairs(&self, text: &str) -> Result<Vec<[f64; 2]>, (usize, String)> {
        let mut pairs: Vec<[f64; 2]> = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            let is_separator = |c: char| c == ',' || c == ';' || c.is_whitespace();
            let mut words = line.split(is_separator).filter(|word| !word.is_empty());
            let Some(Ok(time)) = words.next().map(str::parse::<f64>) else { continue };
            let Some(Ok(value)) = words.next().map(str::parse::<f64>) else {
                return Err((number, "there is no second number".to_owned()));
            };
            if !time.is_finite() || !value.is_finite() {
                return Err((number, "a number is not finite".to_owned()));
            }
            if pairs.last().is_some_and(|last| last[0] >= time) {
                return Err((number, "times do not ascend".to_owned()));
            }
            pairs.push([time, self.scale * value]);
        }
        if pairs.len() < 2 {
            return Err((1, "there are fewer than two times".to_owned()));
        }
        Ok(pairs)
    }

    /// Acceleration over time from the pairs, [length/time²]; it begins and ends with 0.
    pub(crate) fn acceleration(&self, pairs: &[[f64; 2]], start: f64) -> Vec<[f64; 2]> {
        let mut table: Vec<[f64; 2]> = match self.quantity {
            MotionQuantity::Acceleration => pairs.to_vec(),
            MotionQuantity::Velocity => pairs
                .windows(2)
                .map(|two| {
                    let [[t0, v0], [t1, v1]] = [two[0], two[1]];
                    [0.5 * (t0 + t1), (v1 - v0) / (t1 - t0)]
                })
                .collect(),
        };
        enclosed(&mut table, start);
        table
    }

    /// Velocity over time from the pairs, [length/time]; it begins with 0, and ends with 0.
    pub(crate) fn velocity(&self, pairs: &[[f64; 2]], start: f64) -> Vec<[f64; 2]> {
        let mut table: Vec<[f64; 2]> = match self.quantity {
            MotionQuantity::Velocity => pairs.to_vec(),
            MotionQuantity::Acceleration => {
                let mut velocity = 0.0;
                let mut table = vec![[pairs[0][0], 0.0]];
                for two in pairs.windows(2) {
                    velocity += 0.5 * (two[0][1] + two[1][1]) * (two[1][0] - two[0][0]);
                    table.push([two[1][0], velocity]);
                }
                table
            }
        };
        enclosed(&mut table, start);
        table
    }
}

/// Moves the table to the time at which the motion begins; before and after it, the motion is 0.
fn enclosed(table: &mut Vec<[f64; 2]>, start: f64) {
    table.iter_mut().for_each(|pair| pair[0] += start);
    let Some([first, last]) = table.first().zip(table.last()).map(|(a, b)| [a[0], b[0]]) else { return };
    let gap = 1e-9 * (last - first).max(f64::MIN_POSITIVE);
    table.insert(0, [first - gap, 0.0]);
    table.push([last + gap, 0.0]);
}

/// Damping of the material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DampingDeck {
    /// Rayleigh damping: factors of the mass, [1/time], and of the stiffness at the start of each step, [time]. At the
    /// angular frequency ω, the damping ratio is α/(2ω) + βω/2.
    #[schemars(extend("examples" = [[0.1, 0.001]]))]
    pub rayleigh: [f64; 2],
}

/// Largest error of a step relative to the cell size by default, [-].
const LARGEST_ERROR: f64 = 0.1;
/// Spectral radius of the generalised-α method by default, [-].
const SPECTRAL_RADIUS: f64 = 0.8;
/// Number of steps in a period that is to be resolved.
const STEPS_PER_PERIOD: f64 = 20.0;

fn ghost_mass() -> f64 {
    Dynamics::GHOST_MASS
}

fn largest_error() -> f64 {
    LARGEST_ERROR
}

impl DynamicDeck {
    /// The settings of a stage.
    pub(crate) fn dynamics(&self) -> Dynamics {
        Dynamics {
            scheme: match self.scheme {
                SchemeDeck::Midpoint => Scheme::Midpoint,
                SchemeDeck::GeneralisedAlpha => Scheme::GeneralisedAlpha {
                    spectral_radius: self.spectral_radius.unwrap_or(SPECTRAL_RADIUS),
                },
                SchemeDeck::BackwardEuler => Scheme::BackwardEuler,
            },
            ghost_mass: self.ghost_mass,
            rayleigh: self.damping.map_or([0.0; 2], |damping| damping.rayleigh),
            pic: self.pic,
            largest_error: self.error,
            longest: self.resolve.map_or(f64::INFINITY, |period| period / STEPS_PER_PERIOD),
        }
    }
}

impl Deck {
    /// The settings of the motion in the analysis, or in a stage; `None` in statics.
    pub fn dynamic(&self, stage: usize) -> Option<&DynamicDeck> {
        match self.stages.get(stage) {
            Some(stage) => stage.dynamic.as_ref(),
            None => self.dynamic.as_ref(),
        }
    }

    /// Time at which the first stage with inertia begins, [time].
    pub(crate) fn motion_begins(&self) -> f64 {
        let before = self.stages.iter().take_while(|stage| stage.dynamic.is_none());
        before.map(|stage| stage.steps.end_time).sum()
    }

    /// True if bodies move with inertia at any time.
    pub fn has_inertia(&self) -> bool {
        self.dynamic.is_some() || self.stages.iter().any(|stage| stage.dynamic.is_some())
    }
}

impl StepsDeck {
    /// Number of requested steps: `count`, or as many of at most `size` as the duration needs.
    pub fn count(&self) -> u32 {
        /// What a schema allows as well.
        const MOST: f64 = 1e7;
        match (self.count, self.size) {
            (Some(count), _) => count,
            (None, Some(size)) if size > 0.0 => {
                (self.end_time / size * (1.0 - 1e-9)).ceil().clamp(1.0, MOST) as u32
            }
            (None, _) => 1,
        }
    }
}
