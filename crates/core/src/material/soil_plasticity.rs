//! Common parts of the soil laws with linear elasticity that are formulated in principal axes: history, energy and
//! plastic work.

use super::{
    Elasticity, Material, MaterialError, PrincipalLaw, Response, StateField, update_in_principal_axes,
};
use crate::tensor::Sym3;

/// History variables of these laws.
const FIELDS: [StateField; 3] = [
    StateField::new("equivalent_plastic_strain", "-", 0.0),
    StateField::new("plastic_volumetric_strain", "-", 0.0),
    StateField::new("plastic_work", "energy/volume", 0.0),
];

/// Index of the equivalent plastic strain among these variables.
const EQUIVALENT_STRAIN: usize = 0;
/// Index of the plastic volumetric strain among these variables.
const VOLUMETRIC_STRAIN: usize = 1;
/// Index of the plastic work among these variables.
pub(super) const PLASTIC_WORK: usize = 2;

/// A soil law with linear elasticity that is formulated in principal axes.
pub(super) trait SoilPlasticity: PrincipalLaw + std::fmt::Debug + Sized + 'static {
    fn elasticity(&self) -> &Elasticity;

    /// The same as [`Material::tangent_is_symmetric`].
    fn is_symmetric(&self) -> bool;

    /// The law with its strength divided by a factor.
    fn divided(&self, factor: f64) -> Self;
}

impl<L: SoilPlasticity> Material for L {
    fn state_fields(&self) -> &[StateField] {
        const { &FIELDS }
    }

    #[inline(never)]
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        update_in_principal_axes(self, trial, old, new)
    }

    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        Some(self)
    }

    /// The plastic volumetric strain is defined such that tr ε^e + ε_v^p = ln J holds in every state, so that the law
    /// knows J.
    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        history[VOLUMETRIC_STRAIN] = volume_ratio.ln() - elastic_strain.trace();
    }

    fn keep_deformation(&self, [before, now]: [&Sym3; 2], history: &mut [f64]) {
        history[VOLUMETRIC_STRAIN] -= (*now - *before).trace();
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        self.elasticity().strain(tau)
    }

    fn linear_elasticity(&self, _: &[f64]) -> Option<Elasticity> {
        Some(*self.elasticity())
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        self.elasticity().energy(elastic_strain)
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        history[PLASTIC_WORK]
    }

    /// The plastic volumetric strain also starts from an initial stress.
    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        initial[EQUIVALENT_STRAIN] != history[EQUIVALENT_STRAIN]
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.is_symmetric()
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        Some(Box::new(self.divided(factor)))
    }
}
