//! The stiffness of the materials in use, which determines the round-off of the forces.

use crate::material::shear_modulus_at_rest;
use crate::model::Model;

/// The shear moduli at rest of the materials in use, [stress], ascending, each with the number of its material.
fn moduli<const D: usize>(model: &Model<D>) -> Vec<(f64, usize)> {
    let used = |number: &usize| model.bodies.iter().any(|body| body.material == *number);
    let modulus = |number: usize| (shear_modulus_at_rest(model.materials[number].law.as_ref()), number);
    let mut moduli: Vec<(f64, usize)> = (0..model.materials.len()).filter(used).map(modulus).collect();
    moduli.sort_by(|a, b| a.0.total_cmp(&b.0));
    moduli
}

/// Ratio of the shear moduli of the stiffest and the softest material in use, [-].
pub(super) fn spread<const D: usize>(model: &Model<D>) -> f64 {
    match moduli(model)[..] {
        [(soft, _), .., (stiff, _)] => stiff / soft,
        _ => 1.0,
    }
}

/// The stiffest and the softest material in use, as text.
pub(crate) fn stiffnesses<const D: usize>(model: &Model<D>) -> String {
    let name = |number: usize| &model.materials[number].name;
    match moduli(model)[..] {
        [(soft, a), .., (stiff, b)] => format!(
            "material `{}` is {:.0e} times as stiff as `{}` (shear moduli {stiff:.1e} and {soft:.1e})",
            name(b),
            stiff / soft,
            name(a)
        ),
        [(modulus, only)] => format!(
            "material `{}` is so stiff (shear modulus {modulus:.1e}) that the loads hardly strain it",
            name(only)
        ),
        [] => "there is no material".to_owned(),
    }
}
