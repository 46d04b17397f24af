//! Initial moduli of a law, at zero strain.

use crate::tensor::Sym3;

use super::Material;

/// Initial shear modulus, [stress].
pub fn shear_modulus_at_rest(law: &dyn Material) -> f64 {
    0.5 * stiffness_at_rest(law, Sym3([0.0, 0.0, 0.0, SMALL_STRAIN, 0.0, 0.0]))
}

/// Norm of the initial stress change under uniaxial strain, lateral stresses included, relative to it, [stress].
pub fn axial_modulus_at_rest(law: &dyn Material) -> f64 {
    stiffness_at_rest(law, Sym3([SMALL_STRAIN, 0.0, 0.0, 0.0, 0.0, 0.0]))
}

/// Strain at which the initial moduli are evaluated, [-].
const SMALL_STRAIN: f64 = 1e-9;

/// Magnitude of the stress change due to a small strain, relative to that strain, [stress]. The change is used because
/// some laws have a non-zero stress at zero strain.
fn stiffness_at_rest(law: &dyn Material, strain: Sym3) -> f64 {
    let old = law.initial_history();
    let stress = |strain: &Sym3| law.update(strain, &old, &mut old.clone()).map(|response| response.tau);
    match (stress(&strain), stress(&Sym3::ZERO)) {
        (Ok(strained), Ok(at_rest)) => (strained - at_rest).norm() / strain.norm(),
        _ => 0.0,
    }
}
