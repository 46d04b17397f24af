//! Moduli of a law without strain.

use crate::tensor::Sym3;

use super::Material;

/// The shear modulus of a law without strain, [stress].
pub fn shear_modulus_at_rest(law: &dyn Material) -> f64 {
    0.5 * stiffness_at_rest(law, Sym3([0.0, 0.0, 0.0, SMALL_STRAIN, 0.0, 0.0]))
}

/// The modulus of a law for stretch along one axis, without strain before, [stress].
pub fn axial_modulus_at_rest(law: &dyn Material) -> f64 {
    stiffness_at_rest(law, Sym3([SMALL_STRAIN, 0.0, 0.0, 0.0, 0.0, 0.0]))
}

/// Magnitude of the strain that moduli at rest are measured by, [-].
const SMALL_STRAIN: f64 = 1e-9;

/// Magnitude of the stress relative to that of a small strain, [stress].
fn stiffness_at_rest(law: &dyn Material, strain: Sym3) -> f64 {
    let old: Vec<f64> = law.state_fields().iter().map(|field| field.initial).collect();
    let response = law.update(&strain, &old, &mut old.clone());
    response.map_or(0.0, |response| response.tau.norm() / strain.norm())
}
