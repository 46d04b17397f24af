//! Warnings: signs that a result may be poor, identified by codes whose meaning never changes.
//!
//! A warning states facts. Advice refers to the keys of the input and is therefore written in the crate that knows
//! them.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The subject of a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Code {
    /// A domain update cannot follow the motion.
    #[serde(rename = "W001")]
    DomainUpdate,
    /// A part of a domain is outside the grid.
    #[serde(rename = "W002")]
    DomainOutside,
    /// Basis functions do not add up to 1.
    #[serde(rename = "W003")]
    PartitionOfUnity,
    /// Iterations do not solve the equations, which are factorised instead.
    #[serde(rename = "W004")]
    Factorised,
    /// A body has come apart, or connected bodies have separated.
    #[serde(rename = "W005")]
    Apart,
    /// The material leaves the nodes whose motion is prescribed.
    #[serde(rename = "W006")]
    LeftNodes,
    /// Bodies act on each other across a gap.
    #[serde(rename = "W007")]
    AcrossGap,
    /// Changing to fresh grids does a large amount of work.
    #[serde(rename = "W008")]
    Regridding,
    /// Work and energy do not balance.
    #[serde(rename = "W009")]
    Energy,
    /// Points without a domain cross cell boundaries.
    #[serde(rename = "W010")]
    Crossings,
    /// A body turns, but its domains remain boxes along the axes.
    #[serde(rename = "W011")]
    TurnedBoxes,
    /// Pressures alternate between the points of a cell.
    #[serde(rename = "W012")]
    Locking,
    /// Only damped iterations found an equilibrium.
    #[serde(rename = "W013")]
    Damped,
    /// Torn domains were replaced.
    #[serde(rename = "W014")]
    ReplacedDomains,
    /// The imbalance of a body is hidden by larger forces on other bodies.
    #[serde(rename = "W015")]
    HiddenResidual,
    /// A much stiffer body moves the nodes of a soft one.
    #[serde(rename = "W016")]
    Stiffened,
    /// An equilibrium is not stable.
    #[serde(rename = "W017")]
    Unstable,
    /// Bodies slide while their strength is reduced.
    #[serde(rename = "W018")]
    Slides,
    /// A strength reduction ends before bodies begin to run away.
    #[serde(rename = "W019")]
    StoppedShort,
    /// Bodies slumped before their strength was reduced.
    #[serde(rename = "W020")]
    Slumped,
    /// Nodes with prescribed motion pull material past themselves.
    #[serde(rename = "W021")]
    PassedNodes,
    /// A stage adds a body above or below the current surface of the ground.
    #[serde(rename = "W022")]
    OffGround,
    /// Steps stay far shorter than requested.
    #[serde(rename = "W023")]
    Crawls,
    /// Only with viscosity did iterations follow the flow of bodies.
    #[serde(rename = "W024")]
    Viscous,
    /// The integration of a motion in time creates or loses energy.
    #[serde(rename = "W025")]
    TimeIntegration,
}

/// The codes of all warnings, each with its title.
pub const CODES: &[(&str, &str)] = &[
    ("W001", "a domain update that does not suit the motion"),
    ("W002", "a domain partly outside the grid"),
    ("W003", "basis functions that do not add up to 1"),
    ("W004", "equations that the iterative solver does not solve"),
    ("W005", "a body that comes apart"),
    ("W006", "prescribed nodes that lose their material"),
    ("W007", "bodies that act on each other across a gap"),
    ("W008", "a large amount of work done in changing to fresh grids"),
    ("W009", "work and energy that do not balance"),
    ("W010", "standard points that cross cell boundaries"),
    ("W011", "domains that turn but stay boxes"),
    ("W012", "pressures that alternate within cells"),
    ("W013", "a step that only damped iterations solve"),
    ("W014", "torn domains replaced"),
    ("W015", "a body whose imbalance is hidden by others"),
    ("W016", "a soft body that a stiff one stiffens"),
    ("W017", "an equilibrium that is not stable"),
    ("W018", "bodies that slide while their strength is reduced"),
    ("W019", "a strength reduction that ends before displacements run away"),
    ("W020", "a strength reduction of bodies that have slumped"),
    ("W021", "material pulled beyond prescribed nodes"),
    ("W022", "a body added above or below the ground"),
    ("W023", "a run that crawls"),
    ("W024", "a step that only viscosity solves"),
    ("W025", "energy that the integration in time creates or loses"),
];

impl Code {
    /// The code as users see it, listed in [`CODES`].
    pub fn text(self) -> &'static str {
        CODES[self as usize].0
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// The bodies, the point or the boundary condition that a warning concerns.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Location {
    /// Names of the bodies.
    pub bodies: Vec<String>,
    /// Permanent number of the point.
    pub point: Option<u32>,
    /// Name of the boundary condition.
    pub boundary_condition: Option<String>,
    /// Position of the point, the node or the gap, [length].
    pub position: Option<Vec<f64>>,
}

impl Location {
    /// A point of a body.
    pub fn point(body: &str, point: u32) -> Location {
        Location { point: Some(point), ..Location::body(body) }
    }

    /// The location of a warning about a body.
    pub fn body(body: &str) -> Location {
        Location { bodies: vec![body.to_owned()], ..Location::default() }
    }
}

/// A fact that, together with the code of a warning, determines the advice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// The domain is a box that may reach beyond the body; a box that is updated by its corners does not.
    ReachingBox,
    /// A tolerance at which the forces on the body would be in balance, [-].
    Tolerance(f64),
    /// The forces on this body are so small beside those on other bodies that no tolerance above round-off brings them
    /// into balance.
    RoundOff,
    /// Bodies that flow use the volume ratio of each point, [`crate::stress::CellStrain::Standard`].
    StandardDilatation,
    /// The flow dilates, so that a mean dilatation does not keep cells from locking.
    DilatingFlow,
}

/// A measure that is out of bounds for the first time, or an event that may spoil the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// The subject of the warning.
    pub code: Code,
    /// Load step number.
    pub step: usize,
    /// The bodies, the point or the boundary condition that the warning concerns.
    #[serde(rename = "place")]
    pub location: Location,
    /// The measure; `None` for an event.
    pub value: Option<f64>,
    /// The bound beyond which the measure lies, above or below; `None` for an event.
    pub threshold: Option<f64>,
    /// The fact and its location, as a sentence.
    pub message: String,
    /// A further fact that decides what may help.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<Detail>,
}

/// The step and the message.
impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: {}", self.step, self.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_numbered_in_order() {
        use Code::*;
        let all = [
            DomainUpdate,
            DomainOutside,
            PartitionOfUnity,
            Factorised,
            Apart,
            LeftNodes,
            AcrossGap,
            Regridding,
            Energy,
            Crossings,
            TurnedBoxes,
            Locking,
            Damped,
            ReplacedDomains,
            HiddenResidual,
            Stiffened,
            Unstable,
            Slides,
            StoppedShort,
            Slumped,
            PassedNodes,
            OffGround,
            Crawls,
            Viscous,
            TimeIntegration,
        ];
        assert_eq!(all.len(), CODES.len());
        for (code, (text, _)) in all.iter().zip(CODES) {
            assert_eq!(code.text(), *text);
            assert_eq!(serde_json::to_value(code).unwrap(), *text);
        }
    }

    #[test]
    fn a_warning_survives_a_checkpoint() {
        let warning = Warning {
            code: Code::DomainOutside,
            step: 12,
            location: Location::point("block", 3),
            value: Some(0.02),
            threshold: Some(0.01),
            message: "body `block` leaves".to_owned(),
            detail: Some(Detail::ReachingBox),
        };
        assert_eq!(warning.to_string(), "step 12: body `block` leaves");
        let json = serde_json::to_value(&warning).unwrap();
        assert_eq!(json["code"], "W002");
        assert_eq!(json["place"]["point"], 3);
        assert_eq!(serde_json::from_value::<Warning>(json).unwrap(), warning);
    }
}
