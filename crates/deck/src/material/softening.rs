//! The strain over which a material softens, and how it is adapted to the cell size.

use super::consistency::Inconsistency;
use super::property::Setting;
use mpm_core::material::{Friction, Softening, least_softening_strain};

/// κ₉₅, and how it is adapted to the cell size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Decay {
    pub(super) strain: Setting,
    /// Width of the band, if it is stated, [length].
    pub(super) band: Option<f64>,
    /// Size of the cells, if it is known, [length].
    pub(super) cells: Option<Setting>,
}

impl Decay {
    /// κ₉₅ at a point, adapted to its cell, [-]; κ₉₅ as stated where the cell size is not known.
    fn strain(&self, properties: &[f64]) -> f64 {
        let scale = match (self.band, self.cells) {
            (Some(band), Some(size)) => band / size.at(properties),
            _ => 1.0,
        };
        self.strain.at(properties) * scale
    }

    /// κ₉₅ at a point, adapted to its cell, [-]; `None` if it depends on a cell size that is not known.
    fn known_strain(&self, properties: &[f64]) -> Option<f64> {
        (self.band.is_none() || self.cells.is_some()).then(|| self.strain(properties))
    }

    pub(crate) fn at(&self, properties: &[f64]) -> Softening {
        Softening::over(self.strain(properties))
    }
}

/// Finds a softening strain so small that an unconfined point loses strength faster than its elastic stress can fall.
/// `elasticity` holds Young's modulus and Poisson's ratio, `strength` the peak and the residual strength.
pub(crate) fn too_steep(
    decay: &Decay,
    properties: &[f64],
    elasticity: [f64; 2],
    strength: [Friction; 2],
) -> Option<Inconsistency> {
    let strain = decay.known_strain(properties)?;
    let least = least_softening_strain(elasticity, strength);
    if strain > least {
        return None;
    }
    let message = format!(
        "the strength falls faster than the elastic stress can: the softening strain is {strain:.3e} in the cells of the \
         grid, and must exceed {least:.3e}"
    );
    let help = "use a larger `strain` or `band`, smaller cells, or a stiffer material";
    Inconsistency::new("softening/strain", message, help)
}
