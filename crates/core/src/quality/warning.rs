//! Warnings: what a run has to say of an answer that may be bad, by codes that never change their meaning.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::points::coordinates;

/// What a warning is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Code {
    /// A domain update does not suit the motion.
    #[serde(rename = "W001")]
    DomainUpdate,
    /// A part of a domain is outside the grid.
    #[serde(rename = "W002")]
    DomainOutside,
    /// Basis functions do not add up to 1.
    #[serde(rename = "W003")]
    PartitionOfUnity,
    /// Equations that iterations do not solve are factorised.
    #[serde(rename = "W004")]
    Factorised,
    /// What hung together has come apart.
    #[serde(rename = "W005")]
    Apart,
    /// The material leaves the nodes that are to move it.
    #[serde(rename = "W006")]
    LeftNodes,
    /// Bodies act on each other across a gap.
    #[serde(rename = "W007")]
    AcrossGap,
    /// Each fresh grid does much work.
    #[serde(rename = "W008")]
    Regridding,
    /// Work and energy do not balance.
    #[serde(rename = "W009")]
    Energy,
    /// Standard points cross the borders of cells.
    #[serde(rename = "W010")]
    Crossings,
    /// Domains that are boxes turn.
    #[serde(rename = "W011")]
    TurnedBoxes,
    /// Pressures alternate between the points of a cell.
    #[serde(rename = "W012")]
    Locking,
    /// Only damped iterations found an equilibrium.
    #[serde(rename = "W013")]
    Damped,
    /// Domains were torn and replaced.
    #[serde(rename = "W014")]
    ReplacedDomains,
    /// A body is out of balance beside others.
    #[serde(rename = "W015")]
    HiddenResidual,
    /// A much stiffer body takes nodes of a soft one along.
    #[serde(rename = "W016")]
    Stiffened,
    /// An equilibrium that is not stable.
    #[serde(rename = "W017")]
    Unstable,
}

/// Codes of all warnings with a title each.
pub const CODES: &[(&str, &str)] = &[
    ("W001", "a domain update that does not suit the motion"),
    ("W002", "a domain partly outside the grid"),
    ("W003", "basis functions that do not add up to 1"),
    ("W004", "equations that iterations do not solve"),
    ("W005", "a body that comes apart"),
    ("W006", "prescribed nodes that the material leaves"),
    ("W007", "bodies that act on each other across a gap"),
    ("W008", "much work of the fresh grids"),
    ("W009", "work and energy that do not balance"),
    ("W010", "standard points that cross cells"),
    ("W011", "domains that turn but stay boxes"),
    ("W012", "pressures that alternate within cells"),
    ("W013", "a step that only damped iterations solve"),
    ("W014", "torn domains that were replaced"),
    ("W015", "a body that is out of balance beside others"),
    ("W016", "a soft body that a stiff one stiffens"),
    ("W017", "an equilibrium that is not stable"),
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

/// What a warning concerns, as far as it is known.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Names of the bodies.
    pub bodies: Vec<String>,
    /// Permanent number of the point.
    pub point: Option<u32>,
    /// Name of the boundary condition.
    pub boundary_condition: Option<String>,
    /// Position of the point, the node or the gap, [length].
    pub position: Option<Vec<f64>>,
}

impl Place {
    /// A point of a body.
    pub fn point(body: &str, point: u32) -> Place {
        Place { point: Some(point), ..Place::body(body) }
    }

    /// A body.
    pub fn body(body: &str) -> Place {
        Place { bodies: vec![body.to_owned()], ..Place::default() }
    }
}

/// A measure that is out of bounds for the first time, or an event that may spoil the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// What it is about.
    pub code: Code,
    /// Number of the load step.
    pub step: usize,
    /// What it concerns.
    pub place: Place,
    /// The measure; none for an event.
    pub value: Option<f64>,
    /// The bound that it is beyond; none for an event.
    pub threshold: Option<f64>,
    /// What has happened, and where.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl Warning {
    /// The warning as the screen and the log show it: a line for what has happened and one for what to do, without a line
    /// break at the end.
    pub fn lines(&self) -> String {
        format!("warning[{}]: {self}\n  help: {}", self.code, self.help)
    }
}

/// The step and the message.
impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: {}", self.step, self.message)
    }
}

/// A position as messages show it.
pub(super) fn at(position: &[f64]) -> String {
    coordinates(position)
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
        ];
        assert_eq!(all.len(), CODES.len());
        for (code, (text, _)) in all.iter().zip(CODES) {
            assert_eq!(code.text(), *text);
            assert_eq!(serde_json::to_value(code).unwrap(), *text);
        }
    }

    #[test]
    fn a_warning_is_shown_with_its_code_and_its_remedy() {
        let warning = Warning {
            code: Code::DomainOutside,
            step: 12,
            place: Place::point("block", 3),
            value: Some(0.02),
            threshold: Some(0.01),
            message: "body `block` leaves".to_owned(),
            help: "use a larger grid".to_owned(),
        };
        assert_eq!(warning.lines(), "warning[W002]: step 12: body `block` leaves\n  help: use a larger grid");
        let json = serde_json::to_value(&warning).unwrap();
        assert_eq!(json["code"], "W002");
        assert_eq!(json["place"]["point"], 3);
        assert_eq!(serde_json::from_value::<Warning>(json).unwrap(), warning);
    }
}
