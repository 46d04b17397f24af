//! A material in the form that its points need.

use super::consistency::Consistency;
use super::property::Varying;
use mpm_core::formula::Formula;
use mpm_core::material::Material;

/// The law of a material, and what its points need.
pub(crate) struct MaterialOfPoints {
    /// Name.
    pub name: String,
    /// The law.
    pub law: Box<dyn Material>,
    /// Properties that vary, and the check that properties are consistent; none for a law that the deck does not
    /// describe.
    pub varying: Vec<Varying>,
    pub consistency: Option<Consistency>,
    /// Initial density, if it varies.
    pub density: Option<Formula>,
}
