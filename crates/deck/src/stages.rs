//! The stages of a deck.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::steps::is_default;
use super::{
    AbsorbDeck, BodyContactDeck, ControlDeck, Deck, DynamicDeck, SolverDeck, StageWaterDeck, StepsDeck,
};

/// A stage of an analysis. It begins in the state in which the previous stage ends, and states only what changes.
/// Forces that removed bodies, released boundary conditions and replaced materials carried are released over the stage,
/// and the weight of added bodies grows over the stage, both in proportion to time, so that every step is in
/// equilibrium.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageDeck {
    /// Name, unique among the stages.
    pub name: String,
    /// Motion with inertia in this stage; without this key, the bodies are in equilibrium throughout. Bodies start from
    /// rest, unless the stage before also moves them, and end the motion at once where a stage without this key follows.
    /// What the stage removes ceases to act at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{}]))]
    pub dynamic: Option<DynamicDeck>,
    /// What follows where the stage finds no further equilibrium: the run stops, or the next stage, which must have
    /// inertia, goes on from the last equilibrium with the loads that this stage aimed at, or with the strength divided by
    /// the factor `to` that it aimed at. Steps are then neither damped nor made viscous as a last resort.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_limit: AtLimit,
    /// Load steps of the stage; `end_time` is its duration, and a control reaches `to` or `length` within the stage.
    pub steps: StepsDeck,
    /// Factors that loads and boundary conditions reach at the end of the stage, by name. They change linearly from
    /// their values at the start of the stage. Before the first stage, the factors are 0, except that of gravity on a
    /// body with `initial_stress`, which is 1. Factors that a stage does not name stay constant, unless there is a
    /// `curve`. With displacement or arc-length control, the loads named here grow together: one common multiplier
    /// follows from equilibrium, and when it is 1, each load has the factor given here.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("examples" = [{"weight": 1}]))]
    pub factors: BTreeMap<String, f64>,
    /// Bodies that are added, free of strain or with their `initial_stress`: a name for a body that begins where its
    /// shape places it, or `{body: lift5, onto: clay}` for one whose lower side is moved onto the current surface of
    /// another body. A body that a stage adds before any stage removes it is absent at the start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [["wall"], [{"body": "lift5", "onto": "clay"}]]))]
    pub add: Vec<AddDeck>,
    /// Names of bodies that are removed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [["pit"]]))]
    pub remove: Vec<String>,
    /// Names of boundary conditions that no longer act.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [["prop"]]))]
    pub release: Vec<String>,
    /// Boundaries that absorb waves in this stage, which must have inertia, in place of boundary conditions on nodes that
    /// held the bodies before: dashpots of Lysmer and Kuhlemeyer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [[{"condition": "base"}]]))]
    pub absorb: Vec<AbsorbDeck>,
    /// Names of boundary conditions that begin to act. A condition that a stage sets before any stage releases it does
    /// not act at the start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [["prop"]]))]
    pub set: Vec<String>,
    /// Contacts between bodies that are added, or whose interface changes, from this stage on; bodies that stuck together
    /// may part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<BodyContactDeck>,
    /// Pairs of bodies whose contact ends: from this stage on, they stick together where they share nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [[["block", "ground"]]]))]
    pub remove_contacts: Vec<[String; 2]>,
    /// Names of bodies, each with the name of its new material. The points keep their stress, unless the new material
    /// yields under it; their history starts anew. They also keep their mass, which follows from the density of the
    /// `material` of the body: the density of the new material has no effect.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("examples" = [{"ground": "clay_undrained"}]))]
    pub material: BTreeMap<String, String>,
    /// Level that the water reaches at the end of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{"level": 2}]))]
    pub water: Option<StageWaterDeck>,
    /// Control of the Newton iterations of this stage, in place of the `solver` of the deck.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<SolverDeck>,
    /// Number of load steps from one set of VTU files to the next, in place of `every` under `output`,
    /// unless that is 0; the last step of a stage is always written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000_000), extend("examples" = [5]))]
    pub every: Option<u32>,
    /// Changes at the end of this stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub then: Option<ThenDeck>,
}

/// What follows where a stage finds no further equilibrium.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AtLimit {
    /// The run stops.
    #[default]
    Stop,
    /// The next stage goes on with inertia.
    Next,
}

/// A body that a stage adds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum AddDeck {
    /// The name of a body that begins where its shape places it.
    Name(String),
    /// A body that is placed onto another one.
    Placed(PlacedDeck),
}

/// A body that a stage places onto another one. Each column of its points is moved vertically, opposite to gravity or
/// along the last axis if there is none, so that it begins on the current surface of that body; its drawn thickness
/// stays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacedDeck {
    /// Name of the body that is added.
    pub body: String,
    /// Name of the body on whose current surface it is placed.
    pub onto: String,
}

impl AddDeck {
    /// Name of the body that is added.
    pub fn name(&self) -> &str {
        match self {
            AddDeck::Name(name) | AddDeck::Placed(PlacedDeck { body: name, .. }) => name,
        }
    }

    /// Name of the body on which it is placed; `None` if it begins where it was drawn.
    pub fn onto(&self) -> Option<&str> {
        match self {
            AddDeck::Name(_) => None,
            AddDeck::Placed(placed) => Some(&placed.onto),
        }
    }
}

impl StageDeck {
    /// Names of the bodies that are added.
    pub fn added(&self) -> Vec<&str> {
        self.add.iter().map(AddDeck::name).collect()
    }

    /// Names of the bodies that are removed.
    pub fn removed(&self) -> Vec<&str> {
        self.remove.iter().map(String::as_str).collect()
    }

    /// Names of the boundary conditions that begin to act.
    pub fn conditions_set(&self) -> Vec<&str> {
        self.set.iter().map(String::as_str).collect()
    }

    /// Names of the boundary conditions that no longer act.
    pub fn conditions_released(&self) -> Vec<&str> {
        let absorbed = self.absorb.iter().map(|absorbed| &absorbed.condition);
        self.release.iter().chain(absorbed).map(String::as_str).collect()
    }
}

/// Changes at the end of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThenDeck {
    /// Quantities of the points that are set to zero.
    #[schemars(extend("examples" = [["displacement"]]))]
    pub reset: Vec<Reset>,
}

/// A quantity that can be set to zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reset {
    /// The displacement in files, probes and reports. Formulas still refer to the original position.
    Displacement,
}

impl Deck {
    /// The load steps of an analysis without stages, or of each stage, with their JSON pointers in the deck.
    pub fn courses(&self) -> Vec<(String, &StepsDeck)> {
        let only = self.steps.iter().map(|steps| ("/steps".to_owned(), steps));
        let stages = self.stages.iter().enumerate();
        only.chain(stages.map(|(number, stage)| (format!("/stages/{number}/steps"), &stage.steps))).collect()
    }

    /// The distinct tolerances of the analysis, or of its stages, in their order, [-].
    pub fn tolerances(&self) -> Vec<f64> {
        let stage_solvers = self.stages.iter().map(|stage| stage.solver.as_ref().unwrap_or(&self.solver));
        let only = self.stages.is_empty().then_some(&self.solver);
        let mut found = Vec::new();
        for solver in only.into_iter().chain(stage_solvers) {
            if !found.contains(&solver.tolerance) {
                found.push(solver.tolerance);
            }
        }
        found
    }

    /// True if tools or other bodies may touch a body.
    pub(crate) fn has_contact(&self) -> bool {
        !self.tools.is_empty()
            || !self.contacts.is_empty()
            || self.stages.iter().any(|stage| !stage.contacts.is_empty())
    }

    /// Time at the end of the analysis, [time].
    pub fn end_time(&self) -> f64 {
        self.courses().iter().map(|(_, steps)| steps.end_time).sum()
    }

    /// True if a stage, or the analysis, reduces the strength of the materials.
    pub fn reduces_strength(&self) -> bool {
        let reduces = |steps: &StepsDeck| matches!(steps.control, ControlDeck::StrengthReduction { .. });
        self.courses().iter().any(|(_, steps)| reduces(steps))
    }

    /// Names of the materials that bodies have at the start or are given by a stage.
    pub fn used_materials(&self) -> BTreeSet<&str> {
        let in_stages = self.stages.iter().flat_map(|stage| stage.material.values());
        self.bodies.iter().map(|body| &body.material).chain(in_stages).map(String::as_str).collect()
    }

    /// Names of the materials in use whose flow is non-associated, if the deck reduces the strength.
    pub fn nonassociated_with_reduced_strength(&self) -> Vec<&str> {
        let used = self.used_materials();
        let found = self.materials.iter().filter(|(name, material)| {
            self.reduces_strength() && !material.is_associated() && used.contains(name.as_str())
        });
        found.map(|(name, _)| name.as_str()).collect()
    }

    /// Number of requested load steps.
    pub fn step_count(&self) -> usize {
        self.courses().iter().map(|(_, steps)| steps.count() as usize).sum()
    }

    /// True if a body exists, or a boundary condition acts, before the first stage. False only if the first stage that
    /// names it under `begins` or `ends` names it under `begins` alone.
    pub(crate) fn is_there_at_start(
        &self,
        name: &str,
        begins: impl Fn(&StageDeck) -> Vec<&str>,
        ends: impl Fn(&StageDeck) -> Vec<&str>,
    ) -> bool {
        let first =
            self.stages.iter().find(|stage| begins(stage).contains(&name) || ends(stage).contains(&name));
        first.is_none_or(|stage| !begins(stage).contains(&name) || ends(stage).contains(&name))
    }

    /// True if a body exists before the first stage.
    pub(crate) fn begins_present(&self, body: &str) -> bool {
        self.is_there_at_start(body, StageDeck::added, StageDeck::removed)
    }

    /// True, for each of two bodies, if it exists before the first stage, and in each stage.
    fn presence(&self, bodies: [&str; 2]) -> Vec<[bool; 2]> {
        let mut are_there = bodies.map(|body| self.begins_present(body));
        let mut presence = vec![are_there];
        for stage in &self.stages {
            for (body, is_there) in bodies.iter().zip(&mut are_there) {
                *is_there = (*is_there && !stage.removed().contains(body)) || stage.added().contains(body);
            }
            presence.push(are_there);
        }
        presence
    }

    /// True if two bodies exist at the same time.
    pub(crate) fn meet(&self, bodies: [&str; 2]) -> bool {
        self.presence(bodies).contains(&[true; 2])
    }

    /// True if `other` exists when `body` begins to exist: at the start or, if `body` is absent then, in the first
    /// stage that adds it.
    pub(crate) fn begins_beside(&self, body: &str, other: &str) -> bool {
        self.presence([body, other]).iter().find(|[begun, _]| *begun).is_some_and(|[_, other]| *other)
    }
}
