//! The units of a deck.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mpm_files::units::{Units, UnitsError};

/// The units of all numbers of the deck and of its results, one consistent set. Nothing is converted: the names label
/// results, and `mpm check` compares stiffness, density and gravity with them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnitsDeck {
    /// Unit of length, such as `m`, `mm`, `ft` or `in`.
    #[schemars(length(min = 1, max = 8), extend("examples" = ["m"]))]
    pub length: String,
    /// Unit of force, such as `N`, `kN`, `MN`, `lbf` or `kip`; the units of stress, energy and mass follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1, max = 8), extend("examples" = ["kN"]))]
    pub force: Option<String>,
    /// Unit of mass, such as `kg` or `t`, in place of `force` or beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1, max = 8), extend("examples" = ["t"]))]
    pub mass: Option<String>,
    /// Unit of time, such as `s`, `h` or `d`; `s` by default.
    #[serde(default = "second")]
    #[schemars(length(min = 1, max = 8), extend("examples" = ["s"]))]
    pub time: String,
}

fn second() -> String {
    "s".to_owned()
}

impl UnitsDeck {
    /// The set of units.
    ///
    /// # Errors
    /// [`UnitsError`] if the names do not make one set.
    pub fn set(&self) -> Result<Units, UnitsError> {
        Units::new(&self.length, self.force.as_deref(), self.mass.as_deref(), &self.time)
    }
}

impl crate::Deck {
    /// The units that the deck states.
    pub fn units(&self) -> Option<Units> {
        self.units.as_ref().and_then(|units| units.set().ok())
    }
}
