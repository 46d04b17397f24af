//! A material in the form that its points need.

use super::stated_law::StatedLaw;
use mpm_core::formula::Formula;
use mpm_core::material::Material;

/// The law of a material, and what its points need.
pub(crate) struct MaterialOfPoints {
    /// Name.
    pub name: String,
    /// The law as it is stated.
    pub stated: StatedLaw,
    /// The law, with typical values of the properties that vary.
    pub law: Box<dyn Material>,
    /// Initial density, if it varies.
    pub density: Option<Formula>,
}
