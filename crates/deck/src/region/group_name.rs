//! Names of physical groups.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A physical group of a mesh.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum GroupDeck {
    /// Its name, or its number if the file has no name for it.
    Name(String),
    /// Its dimension and name, for a name that groups of several dimensions share.
    OfDimension(GroupOfDimension),
}

/// The dimension and the name of a physical group.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupOfDimension {
    /// Dimension: 0 for points, 1 for curves, 2 for surfaces, 3 for volumes.
    #[schemars(range(min = 0, max = 3), extend("examples" = [1]))]
    pub dimension: u8,
    /// Name of the group, or its number if the file has no name for it.
    #[schemars(extend("examples" = ["wall"]))]
    pub name: String,
}

impl GroupDeck {
    /// The name of the group.
    pub fn name(&self) -> &str {
        match self {
            GroupDeck::Name(name) => name,
            GroupDeck::OfDimension(group) => &group.name,
        }
    }

    /// The dimension of the group, if it is stated.
    pub fn dimension(&self) -> Option<u8> {
        match self {
            GroupDeck::Name(_) => None,
            GroupDeck::OfDimension(group) => Some(group.dimension),
        }
    }
}
