//! Strength reduction: the factors between which equilibrium ceases to be found, and the factors between which bodies
//! begin to slide.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::model::{Action, Model};
use crate::points::Points;
use crate::quality::{Code, Location, Warning};
use crate::step::Step;

/// Displacement since the start of the reduction above which bodies count as sliding, relative to their height, [-].
const SLIDES: f64 = 0.01;
/// Displacement per change of the factor in the last step, relative to the mean over the stage, below which bodies have
/// not begun to run away, [-].
const RUNS_AWAY: f64 = 3.0;

/// A stage that reduces the strength, and its factors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StageStrength {
    /// Number of the stage, from 0.
    pub stage: usize,
    /// The factors.
    pub bracket: StrengthBracket,
}

/// Factors by which the strength of the materials was divided in a stage of
/// [`Control::StrengthReduction`](crate::model::Control::StrengthReduction). The factor of safety lies between
/// `stands` and `fails`, unless bodies slid at smaller factors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StrengthBracket {
    /// The largest factor with equilibrium, [-]; `None` if none was found.
    pub stands: Option<f64>,
    /// The factor without equilibrium that ended the stage, [-]; `None` if the stage has not ended in this way.
    pub fails: Option<f64>,
    /// The factors before and after the step in which `moved` first exceeded 1 % of the height of the bodies, [-], as
    /// close to each other as `stands` and `fails`; `None` if `moved` has not exceeded 1 %. Bodies in equilibrium at
    /// larger factors stand in another shape.
    #[serde(default)]
    pub slides: Option<[f64; 2]>,
    /// Sum, over the steps of the stage, of the largest displacement of a point in each step, [length]: the largest
    /// displacement of a point since the stage began, if the same point moves most in every step and in the same
    /// direction, and an upper bound on it otherwise.
    #[serde(default)]
    pub moved: f64,
    /// Displacement per change of the factor in the last converged step, relative to the mean over the stage, [-]:
    /// close to 1 for bodies that deform evenly, large for bodies that begin to run away. `None` before the first step.
    #[serde(default)]
    pub growth: Option<f64>,
    /// Number of steps before the stage whose equilibrium was found only by damped iterations: the bodies slumped, and
    /// the factors refer to the shape that remained.
    #[serde(default)]
    pub slumped: usize,
    /// True once bodies that have slid run away: [`RUNS_AWAY`] times as far per change of the factor as on average.
    #[serde(default)]
    pub ran_away: bool,
    /// Number of attempts at a step in the stage, whether they found equilibrium or not.
    #[serde(default)]
    pub attempts: usize,
    /// Number of evaluations of the internal force in these attempts.
    #[serde(default)]
    pub evaluations: usize,
}

/// The displacement in a step, and the height of the bodies with which it is compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Movement {
    /// Largest displacement of a point in the step, [length].
    largest: f64,
    /// Height of the bodies, [length].
    height: f64,
}

impl Movement {
    /// The movement in a step that is in equilibrium but not committed. Height is measured along gravity or, without
    /// gravity, along the axis along which it is least.
    pub(crate) fn measured<const D: usize>(model: &Model<D>, points: &Points<D>, step: Step) -> Movement {
        let (before, after) = (&points.converged.position, &points.trial.position);
        let square = |v: [f64; D]| v.iter().map(|x| x * x).sum::<f64>();
        let moves = before.iter().zip(after).map(|(x, y)| square(std::array::from_fn(|d| y[d] - x[d])));
        let reduction = &points.reduction();
        let largest = reduction.largest(moves.fold(0.0, f64::max).sqrt());
        let mut gravity = [0.0; D];
        for load in &model.loads {
            if let Action::Gravity(acceleration) = &load.action {
                let factor = load.curve.factor(step.end);
                (0..D).for_each(|d| gravity[d] += factor * acceleration[d]);
            }
        }
        let extent = |along: [f64; D]| {
            let place = |x: &[f64; D]| (0..D).map(|d| x[d] * along[d]).sum::<f64>();
            let ends = before
                .iter()
                .map(place)
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
            reduction.largest(ends[1]) - reduction.smallest(ends[0])
        };
        let magnitude = square(gravity).sqrt();
        let height = if magnitude > 0.0 {
            extent(gravity.map(|g| g / magnitude))
        } else {
            let axis = |axis: usize| std::array::from_fn(|d| if d == axis { 1.0 } else { 0.0 });
            (0..D).map(|d| extent(axis(d))).fold(f64::INFINITY, f64::min)
        };
        Movement { largest, height }
    }
}

impl StrengthBracket {
    /// True if bodies begin to slide in a step with this movement.
    pub(crate) fn begins_to_slide(&self, movement: Movement) -> bool {
        self.slides.is_none() && (self.moved + movement.largest) / movement.height > SLIDES
    }

    /// Records equilibrium at a factor after a step; `from` is the factor at the start of the stage. Returns a warning
    /// if bodies begin to slide in this step.
    pub(crate) fn stood(
        &mut self,
        factor: f64,
        from: f64,
        movement: Movement,
        step: usize,
    ) -> Option<Warning> {
        let Movement { largest, height } = movement;
        let slides = self.begins_to_slide(movement);
        let (stood, moved) = (self.stands.unwrap_or(from), self.moved);
        self.moved += largest;
        self.stands = Some(factor);
        let growth = largest / (factor - stood) * (factor - from) / self.moved;
        self.growth = Some(growth).filter(|growth| growth.is_finite());
        let share = self.moved / height;
        if slides {
            self.slides = Some([stood, factor]);
        }
        self.ran_away |= self.slides.is_some() && growth >= RUNS_AWAY;
        if !slides {
            return None;
        }
        let (now, [percent, percent_before]) =
            (self.moved, [share, moved / height].map(|share| 100.0 * share));
        let decimals = decimals(stood, factor);
        Some(Warning {
            code: Code::Slides,
            step,
            location: Location::default(),
            value: Some(share),
            threshold: Some(SLIDES),
            message: format!(
                "points have moved by up to {now:.3e} ({percent:.2} % of the height of the bodies) since the strength \
                 reduction began, and by {moved:.3e} ({percent_before:.2} %) up to the step before: between the \
                 factors {stood:.decimals$} and {factor:.decimals$} the bodies begin to slide, and any equilibrium at \
                 larger factors is that of another shape"
            ),
            detail: None,
        })
    }
}

impl StrengthBracket {
    /// True if no larger factor is to be tried; `stops` tells whether the search ends once bodies have slid.
    pub(crate) fn is_final(&self, stops: bool) -> bool {
        self.fails.is_some() || stops && self.ran_away
    }

    /// Counts an attempt at a step with this number of evaluations.
    pub(crate) fn count(&mut self, evaluations: usize) {
        self.attempts += 1;
        self.evaluations += evaluations;
    }

    /// Records at the start of a stage in how many earlier steps bodies slumped; returns a warning if there are any.
    pub(crate) fn begins(&mut self, slumped: usize, step: usize) -> Option<Warning> {
        if self.stands.is_some() || slumped == 0 {
            return None;
        }
        self.slumped = slumped;
        Some(Warning {
            code: Code::Slumped,
            step,
            location: Location::default(),
            value: Some(slumped as f64),
            threshold: None,
            message: format!(
                "the bodies may have slumped before their strength was reduced: only damped iterations found \
                 equilibrium in {slumped} of the steps; the factors refer to the shape after these steps, and in the \
                 original shape the bodies may not stand"
            ),
            detail: None,
        })
    }

    /// A warning if equilibrium ceased before bodies began to run away. `step` is the last one in equilibrium.
    pub(crate) fn stopped_short(&self, step: usize) -> Option<Warning> {
        let (growth, stands, fails) = (self.growth?, self.stands?, self.fails?);
        let is_short = self.slides.is_none() && growth < RUNS_AWAY;
        let decimals = decimals(stands, fails);
        is_short.then(|| Warning {
            code: Code::StoppedShort,
            step,
            location: Location::default(),
            value: Some(growth),
            threshold: Some(RUNS_AWAY),
            message: format!(
                "no equilibrium was found at the factor {fails:.decimals$}, but up to {stands:.decimals$} the bodies did \
                 not begin to run away: in the last step, they moved {growth:.2} times as far per unit change of the \
                 factor as on average"
            ),
            detail: None,
        })
    }
}

/// The fewest decimals, at least three, that keep two factors apart.
fn decimals(low: f64, high: f64) -> usize {
    // The slack prevents round-off in the difference from adding a decimal.
    if high > low { (-(high - low).log10() - 1e-6).ceil().clamp(3.0, 12.0) as usize } else { 3 }
}

impl fmt::Display for StrengthBracket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.slumped > 0 {
            write!(
                f,
                "for the original shape, below the factor at which the bodies slumped, which is 1 if they slumped at full \
                 strength; for the slumped shape, "
            )?;
        }
        if let Some([stood, slid]) = self.slides {
            let (decimals, percent) = (decimals(stood, slid), 100.0 * SLIDES);
            write!(
                f,
                "between {stood:.decimals$} (in equilibrium) and {slid:.decimals$} (displacements exceed {percent} % of \
                 the height); "
            )?;
            if self.ran_away && self.fails.is_none() && self.stands == Some(slid) {
                return write!(f, "the search ended there");
            }
            write!(f, "in the new shape, ")?;
        }
        match (self.stands, self.fails) {
            (Some(stands), Some(fails)) => {
                let decimals = decimals(stands, fails);
                write!(
                    f,
                    "between {stands:.decimals$} (in equilibrium) and {fails:.decimals$} (no equilibrium found)"
                )
            }
            (Some(stands), None) => write!(f, "at least {stands:.3}, the largest that was tried"),
            (None, Some(fails)) => write!(f, "below {fails:.3} (no equilibrium found)"),
            (None, None) => write!(f, "unknown: no step of the reduction has ended"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bracket_in_words_keeps_its_factors_apart() {
        let words =
            |stands, fails| StrengthBracket { stands, fails, ..StrengthBracket::default() }.to_string();
        assert_eq!(
            words(Some(1.378125), Some(1.38125)),
            "between 1.378 (in equilibrium) and 1.381 (no equilibrium found)"
        );
        assert_eq!(
            words(Some(1.378125), Some(1.378126)),
            "between 1.378125 (in equilibrium) and 1.378126 (no equilibrium found)"
        );
        assert_eq!(words(Some(1.6), None), "at least 1.600, the largest that was tried");
        assert_eq!(words(None, Some(1.003)), "below 1.003 (no equilibrium found)");
    }

    #[test]
    fn bodies_that_do_not_run_away_stopped_short() {
        let run = |moves: &[f64]| {
            let mut bracket = StrengthBracket::default();
            for (k, &largest) in moves.iter().enumerate() {
                bracket.stood(1.1 + 0.1 * k as f64, 1.0, Movement { largest, height: 1e3 }, k + 1);
            }
            StrengthBracket { fails: Some(2.0), ..bracket }.stopped_short(moves.len())
        };
        let warning = run(&[0.1, 0.1, 0.1]).unwrap();
        assert_eq!((warning.code, warning.step), (Code::StoppedShort, 3));
        assert!((warning.value.unwrap() - 1.0).abs() < 1e-12);
        assert!(run(&[0.1, 0.1, 1.0, 9.0]).is_none(), "they run away");
        assert!(run(&[]).is_none(), "nothing is known");
    }

    #[test]
    fn the_factor_of_bodies_that_slumped_is_not_that_of_the_shape_drawn() {
        let mut bracket = StrengthBracket::default();
        assert!(bracket.begins(0, 3).is_none());
        let warning = bracket.begins(2, 3).unwrap();
        assert_eq!((warning.code, warning.step, bracket.slumped), (Code::Slumped, 3, 2));
        let bracket = StrengthBracket { stands: Some(1.04), fails: Some(1.05), ..bracket };
        let words = bracket.to_string();
        assert!(
            words.starts_with(
                "for the original shape, below the factor at which the bodies slumped, which is 1"
            ),
            "{words}"
        );
        assert!(words.ends_with(
            "for the slumped shape, between 1.040 (in equilibrium) and 1.050 (no equilibrium found)"
        ));
        assert!({ bracket }.begins(2, 4).is_none(), "one warning for a stage");
    }

    #[test]
    fn bodies_slide_once_their_displacements_add_up_to_a_share_of_their_height() {
        let mut bracket = StrengthBracket::default();
        let mut stood = |factor: f64, largest: f64| {
            let warning = bracket.stood(factor, 1.0, Movement { largest, height: 10.0 }, 7);
            (warning, bracket)
        };
        assert!(stood(1.2, 0.06).0.is_none());
        let (warning, after) = stood(1.3, 0.06);
        assert_eq!(after.slides, Some([1.2, 1.3]));
        let warning = warning.unwrap();
        assert_eq!((warning.code, warning.step), (Code::Slides, 7));
        assert!(warning.value.is_some_and(|share| (share - 0.012).abs() < 1e-15));
        let (again, after) = stood(1.4, 5.0);
        assert!(again.is_none(), "one warning for a stage");
        assert_eq!((after.slides, after.stands), (Some([1.2, 1.3]), Some(1.4)));
        let words = after.to_string();
        assert!(
            words.starts_with("between 1.200 (in equilibrium) and 1.300 (displacements exceed 1 % of"),
            "{words}"
        );
        assert!(words.ends_with("in the new shape, at least 1.400, the largest that was tried"), "{words}");
    }
}
