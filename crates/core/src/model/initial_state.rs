//! The stress of bodies at time 0.

use serde::{Deserialize, Serialize};

use super::Model;
use crate::material::{InitialState, MaterialError, initial_state};
use crate::points::Points;
use crate::tensor::Sym3;

/// Treatment of an initial state that is out of balance by more than the tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum InitialImbalance {
    /// The run ends before the first step.
    #[default]
    Refuse,
    /// The first step brings the bodies into equilibrium, which moves them.
    Equilibrate,
}

impl<const D: usize> Model<D> {
    /// Sets the initial stress of a point, in its converged and its trial state: b^e from the inverse of the elastic
    /// law, and the history variables adapted to b^e; F stays as it is. `stress` is the Kirchhoff stress τ, which
    /// equals the Cauchy stress at F = I, [stress]. A stress outside the yield surface is replaced by the stress to
    /// which the law returns it, without plastic strain. Returns the stress of the point, [stress].
    ///
    /// # Errors
    /// The same as for [`elastic_strain`](crate::material::Material::elastic_strain); the point is then unchanged.
    pub fn set_initial_stress(
        &self,
        points: &mut Points<D>,
        p: usize,
        stress: &Sym3,
    ) -> Result<Sym3, MaterialError> {
        let law = self.law(points, p);
        let own = p * points.history_len..p * points.history_len + law.state_fields().len();
        let volume_ratio = points.converged.deformation_gradient[p].determinant();
        let began = &points.converged.history[own.clone()];
        let InitialState { tau, elastic_strain, history } = initial_state(law, stress, volume_ratio, began)?;
        for state in [&mut points.converged, &mut points.trial] {
            state.history[own.clone()].copy_from_slice(&history);
            state.elastic_strain[p] = elastic_strain;
            state.kirchhoff_stress[p] = tau;
        }
        Ok(tau)
    }
}
