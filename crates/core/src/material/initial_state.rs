//! The state of a point with an initial stress.

use super::{Material, MaterialError, effective};
use crate::tensor::Sym3;

/// Largest number of returns to the initial yield surface; with hardening, the size of each return is a fixed fraction
/// of the size of the previous one.
const MAX_RETURNS: usize = 200;
/// Largest change of the strain in a return that counts as round-off, relative to the strain, [-].
const RETURNED: f64 = 1e-13;

/// The state of a point with an initial stress.
#[derive(Debug, Clone, PartialEq)]
pub struct InitialState {
    /// Effective Kirchhoff stress τ, on the yield surface or inside it, [stress].
    pub tau: Sym3,
    /// Elastic strain, in the measure of the law, [-].
    pub elastic_strain: Sym3,
    /// History variables.
    pub history: Vec<f64>,
}

/// The state of a point whose effective Kirchhoff stress is `tau`, [stress], without excess pore pressure: b^e from the
/// inverse of the elastic law, and `history` adapted to it. A stress outside the yield surface is replaced by the stress
/// to which the law returns it, without plastic strain.
///
/// # Errors
/// The same as for [`Material::elastic_strain`] and [`Material::update`]; [`MaterialError::NoStrain`] if the returns do
/// not converge.
pub fn initial_state(
    law: &dyn Material,
    tau: &Sym3,
    volume_ratio: f64,
    history: &[f64],
) -> Result<InitialState, MaterialError> {
    let mut history = history.to_vec();
    let mut flowed = history.clone();
    let mut strain = law.elastic_strain(tau, &history)?;
    law.start_from(&strain, volume_ratio, &mut history);
    for _ in 0..MAX_RETURNS {
        let response = law.update(&strain, &history, &mut flowed)?;
        let change = (response.elastic_strain - strain).norm();
        strain = response.elastic_strain;
        if change <= RETURNED * strain.norm() {
            law.start_from(&strain, volume_ratio, &mut history);
            let tau = effective(law, response.tau, &flowed);
            return Ok(InitialState { tau, elastic_strain: strain, history });
        }
    }
    Err(MaterialError::NoStrain)
}
