//! The water of a deck: its level, and what it does in the pores of materials.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Deck, MaterialDeck};
use mpm_core::material::Undrained;
use mpm_core::model::WaterLevel;

/// Water at rest in the ground and above it. One level states the pore pressure, the weight of the pore water and the
/// pressure of open water on the bodies, so that these cannot disagree; laws then give effective stresses. Bodies below
/// the level need a material with `porosity`, or with `drainage: dry` if no water enters them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaterDeck {
    /// Weight of the water per volume γ_w, [force/volume], at the load factor 1 of gravity, whose factor it follows.
    /// Needed with a `level`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [9.81e3]))]
    pub unit_weight: Option<f64>,
    /// Bulk modulus of the water K_w, [stress]; undrained materials without `undrained_poisson` need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [2.2e9]))]
    pub bulk_modulus: Option<f64>,
    /// Level of the water: its height, the coordinate along the last axis, [length], or the points of a polyline, each a
    /// first coordinate and a height; the level is constant before the first point and after the last. Without this key,
    /// only undrained materials have water.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [4, [[0, 6], [12, 4]]]))]
    pub level: Option<LevelDeck>,
}

/// Change of the water in a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageWaterDeck {
    /// Level that the water reaches at the end of the stage, as for the `level` of the deck; it changes linearly over the
    /// stage.
    #[schemars(extend("examples" = [2, [[0, 6], [12, 4]]]))]
    pub level: LevelDeck,
}

/// A level of water.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum LevelDeck {
    /// The same height everywhere, [length].
    Height(f64),
    /// The points of a polyline, each a first coordinate and a height, [length], with first coordinates that increase.
    Line(#[schemars(length(min = 2, max = 1000))] Vec<LevelPoint>),
}

/// A point of a level: its first coordinate and its height.
pub type LevelPoint = [f64; 2];

/// What the water in the pores of a material does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Drainage {
    /// Water enters and leaves freely: the pore pressure is that of the level.
    #[default]
    Drained,
    /// Water cannot leave: a change of volume changes the pore pressure beyond that of the level, by the bulk modulus of
    /// the water divided by the porosity, or by what `undrained_poisson` needs. The law stays that of the effective
    /// stress.
    Undrained,
    /// Water does not enter: the material has no pores, water lifts its whole volume, and its stress is that beyond the
    /// pressure of the water around it.
    Dry,
    /// Reserved for flow through the pores with time, which is not available yet: a deck that asks for it is refused.
    Coupled,
}

impl LevelDeck {
    /// The level.
    pub(crate) fn level(&self) -> WaterLevel {
        match self {
            LevelDeck::Height(height) => WaterLevel::even(*height),
            LevelDeck::Line(points) => WaterLevel::line(points.clone()),
        }
    }

    /// Largest height, [length], where the first coordinate is in a range.
    pub(crate) fn highest(&self, [from, to]: [f64; 2]) -> f64 {
        let level = self.level();
        let points: &[LevelPoint] = match self {
            LevelDeck::Height(_) => &[],
            LevelDeck::Line(points) => points,
        };
        let within = points.iter().map(|point| point[0]).filter(|x| (from..=to).contains(x));
        let at = [from, to].into_iter().chain(within);
        at.map(|x| level.height(x).0).fold(f64::NEG_INFINITY, f64::max)
    }
}

impl MaterialDeck {
    fn key<T: for<'de> Deserialize<'de>>(&self, key: &str) -> Option<T> {
        let value = serde_json::to_value(self).ok()?;
        serde_json::from_value(value.get(key)?.clone()).ok()
    }

    /// Share of the pores in the initial volume n₀, [-], if it is stated.
    pub fn porosity(&self) -> Option<f64> {
        self.key("porosity")
    }

    /// What the water in the pores does, if it is stated.
    pub fn drainage(&self) -> Option<Drainage> {
        self.key("drainage")
    }

    /// Poisson's ratio of the whole without drainage ν_u, [-], if it is stated.
    pub fn undrained_poisson(&self) -> Option<f64> {
        self.key("undrained_poisson")
    }

    /// Stiffness K_w/n of the pore water of an undrained material, [stress]; `None` for other materials, and if it does
    /// not follow from the deck.
    pub fn pore_stiffness(&self, water: Option<&WaterDeck>) -> Option<f64> {
        if self.drainage() != Some(Drainage::Undrained) {
            return None;
        }
        match self.undrained_poisson() {
            Some(undrained) => {
                let (young, poisson) = (self.young()?, self.poisson()?);
                let stiffness = Undrained::stiffness_of_poisson(young, poisson, undrained);
                (stiffness > 0.0).then_some(stiffness)
            }
            None => Some(water?.bulk_modulus? / self.porosity()?),
        }
    }
}

impl Deck {
    /// The levels of the deck and of its stages, with their pointers; none without water.
    pub(crate) fn levels(&self) -> Vec<(String, &LevelDeck)> {
        let first = self.water.as_ref().and_then(|water| water.level.as_ref());
        let first = first.map(|level| ("/water/level".to_owned(), level));
        let stages = self.stages.iter().enumerate().filter_map(|(number, stage)| {
            Some((format!("/stages/{number}/water/level"), &stage.water.as_ref()?.level))
        });
        first.into_iter().chain(stages).collect()
    }

    /// True if the points of the deck have a pore pressure.
    pub(crate) fn has_pore_pressure(&self) -> bool {
        let is_undrained = |material: &MaterialDeck| material.drainage() == Some(Drainage::Undrained);
        self.has_level() || self.materials.values().any(is_undrained)
    }

    /// True if the deck has a water level.
    pub(crate) fn has_level(&self) -> bool {
        self.water.as_ref().is_some_and(|water| water.level.is_some())
    }
}
