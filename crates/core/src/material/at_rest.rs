//! Initial moduli of a law, at zero strain.

use crate::tensor::Sym3;

use super::Material;

/// An initial modulus of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Modulus {
    /// Shear modulus, [stress].
    Shear,
    /// Norm of the stress change under a uniaxial strain, lateral stresses included, relative to that strain, [stress].
    Axial,
}

impl Modulus {
    /// The modulus at a point with these initial history variables.
    pub fn at_rest(self, law: &dyn Material, history: &[f64]) -> f64 {
        let stiffness = |strain| stiffness_at_rest(law, history, Sym3(strain));
        match self {
            Modulus::Shear => 0.5 * stiffness([0.0, 0.0, 0.0, SMALL_STRAIN, 0.0, 0.0]),
            Modulus::Axial => stiffness([SMALL_STRAIN, 0.0, 0.0, 0.0, 0.0, 0.0]),
        }
    }
}

/// Initial shear modulus of a law with its typical properties, [stress].
pub fn shear_modulus_at_rest(law: &dyn Material) -> f64 {
    Modulus::Shear.at_rest(law, &law.initial_history())
}

/// Initial axial modulus of a law with its typical properties, [stress]; see [`Modulus::Axial`].
pub fn axial_modulus_at_rest(law: &dyn Material) -> f64 {
    Modulus::Axial.at_rest(law, &law.initial_history())
}

/// Strain at which the initial moduli are evaluated, [-].
const SMALL_STRAIN: f64 = 1e-9;

/// Magnitude of the stress change due to a small strain, relative to that strain, [stress]. The change is used because
/// some laws have a non-zero stress at zero strain.
fn stiffness_at_rest(law: &dyn Material, old: &[f64], strain: Sym3) -> f64 {
    let stress = |strain: &Sym3| law.update(strain, old, &mut old.to_vec()).map(|response| response.tau);
    match (stress(&strain), stress(&Sym3::ZERO)) {
        (Ok(strained), Ok(at_rest)) => (strained - at_rest).norm() / strain.norm(),
        _ => 0.0,
    }
}
