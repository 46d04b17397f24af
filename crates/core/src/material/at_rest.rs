//! Moduli of a law, at zero strain and at other elastic strains.

use crate::tensor::Sym3;

use super::{Elasticity, Material};

/// An initial modulus of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Modulus {
    /// Shear modulus, [stress].
    Shear,
    /// Norm of the stress change under a uniaxial strain, lateral stresses included, relative to that strain, [stress]:
    /// in extension or, if a law resists none, in compression.
    Axial,
}

impl Modulus {
    /// The modulus at a point with these initial history variables; that of the elasticity of the law if it yields at
    /// zero strain already.
    pub fn at_rest(self, law: &dyn Material, history: &[f64]) -> f64 {
        let found = self.at_zero_strain(law, history);
        let elastic =
            law.linear_elasticity(history).map_or(0.0, |elasticity| self.of_elasticity(&elasticity));
        if found < YIELDS * elastic { elastic } else { found }
    }

    fn of_elasticity(self, elasticity: &Elasticity) -> f64 {
        match self {
            Modulus::Shear => elasticity.shear,
            Modulus::Axial => elasticity.stress(&Sym3([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])).norm(),
        }
    }

    fn at_zero_strain(self, law: &dyn Material, history: &[f64]) -> f64 {
        let stiffness = |strain| stiffness(law, history, &Sym3::ZERO, Sym3(strain));
        match self {
            Modulus::Shear => 0.5 * stiffness([0.0, 0.0, 0.0, SMALL_STRAIN, 0.0, 0.0]),
            Modulus::Axial => {
                let extended = stiffness([SMALL_STRAIN, 0.0, 0.0, 0.0, 0.0, 0.0]);
                let compressed = || stiffness([-SMALL_STRAIN, 0.0, 0.0, 0.0, 0.0, 0.0]);
                if extended > 0.0 { extended } else { compressed() }
            }
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

/// A law yields at zero strain if its modulus there is less than this fraction of that of its elasticity, [-].
const YIELDS: f64 = 0.5;

/// Strain at which the initial moduli are evaluated, [-].
const SMALL_STRAIN: f64 = 1e-9;

/// The larger of the axial moduli of a law in extension and in compression from an elastic strain, [stress]; see
/// [`Modulus::Axial`]. One of them is elastic even where the law yields.
pub fn axial_modulus_from(law: &dyn Material, strain: &Sym3, history: &[f64]) -> f64 {
    let along =
        |strain_change| stiffness(law, history, strain, Sym3([strain_change, 0.0, 0.0, 0.0, 0.0, 0.0]));
    along(SMALL_STRAIN).max(along(-SMALL_STRAIN))
}

/// Magnitude of the stress change due to a small strain beside an elastic strain, relative to the small one, [stress];
/// zero if the law has no finite answer.
fn stiffness(law: &dyn Material, old: &[f64], from: &Sym3, change: Sym3) -> f64 {
    let stress = |strain: &Sym3| law.update(strain, old, &mut old.to_vec()).map(|response| response.tau);
    let modulus = match (stress(&(*from + change)), stress(from)) {
        (Ok(changed), Ok(before)) => (changed - before).norm() / change.norm(),
        _ => 0.0,
    };
    if modulus.is_finite() { modulus } else { 0.0 }
}
