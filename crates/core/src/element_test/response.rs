//! The stress of a point at a deformation, and its derivative with respect to the normal components of e.

use super::state::{ElementState, deformation_gradient, simple_shear};
use crate::material::{Material, MaterialError, StrainMeasure};
use crate::tensor::{Mat3, Sym3, exp_derivative, log_with_derivative};

/// The response of a point to a deformation.
pub(super) struct Response {
    /// The state at this deformation.
    pub state: ElementState,
    /// Cauchy stress σ, [stress].
    pub stress: Sym3,
    /// ∂σ/∂e_xx, ∂σ/∂e_yy and ∂σ/∂e_zz, [stress].
    pub rates: [Sym3; 3],
    /// Norm of the tangent of the law, [stress].
    pub stiffness: f64,
}

/// The trial elastic strain, in the measure of the law, and its derivatives with respect to e_xx, e_yy and e_zz.
struct Trial {
    strain: Sym3,
    rates: [Sym3; 3],
}

/// The response to one increment from the state `start` to F = exp(`strain`) (I + `shear` e_x ⊗ e_y).
pub(super) fn respond(
    law: &dyn Material,
    start: &ElementState,
    strain: &Sym3,
    shear: f64,
) -> Result<Response, MaterialError> {
    let measure = law.strain_measure();
    let is_diagonal = |t: &Sym3| t.0[3..] == [0.0; 3];
    let is_coaxial =
        shear == start.shear && [strain, &start.strain, &start.elastic_strain].into_iter().all(is_diagonal);
    let trial = match is_coaxial {
        true => along_fixed_axes(measure, start, strain),
        false => in_general(measure, start, strain, shear),
    };
    let mut history = start.history.clone();
    let response = law.update(&trial.strain, &start.history, &mut history)?;
    let state = ElementState {
        strain: *strain,
        shear,
        elastic_strain: response.elastic_strain,
        kirchhoff_stress: response.tau,
        history,
        has_jumped: false,
    };
    let stress = state.cauchy_stress();
    let per_volume = 1.0 / state.volume_ratio();
    // ∂J/∂e_ii = J for each normal component of e.
    let rates = trial.rates.map(|rate| rate.contract(&response.tangent) * per_volume - stress);
    let is_finite = stress.norm().is_finite() && rates.iter().all(|rate| rate.norm().is_finite());
    let stiffness = response.tangent.norm();
    if is_finite { Ok(Response { state, stress, rates, stiffness }) } else { Err(MaterialError::NotFinite) }
}

/// b = exp(Δe) b_n exp(Δe) with all tensors diagonal, without the round-off of logarithms.
fn along_fixed_axes(measure: StrainMeasure, start: &ElementState, strain: &Sym3) -> Trial {
    let increment = *strain - start.strain;
    let unit = |axis: usize| Sym3(std::array::from_fn(|c| if c == axis { 1.0 } else { 0.0 }));
    match measure {
        StrainMeasure::Logarithmic => {
            Trial { strain: start.elastic_strain + increment, rates: [0, 1, 2].map(unit) }
        }
        StrainMeasure::LeftCauchyGreen => {
            let mut trial = Sym3::ZERO;
            for axis in 0..3 {
                let twice = 2.0 * increment.0[axis];
                trial.0[axis] = start.elastic_strain.0[axis] * twice.exp() + 0.5 * twice.exp_m1();
            }
            let rates = [0, 1, 2].map(|axis| unit(axis) * (1.0 + 2.0 * trial.0[axis]));
            Trial { strain: trial, rates }
        }
    }
}

/// b = F C Fᵀ, where C = F_n⁻¹ b_n F_n⁻ᵀ does not change during the increment.
fn in_general(measure: StrainMeasure, start: &ElementState, strain: &Sym3, shear: f64) -> Trial {
    let inverse_n = simple_shear(-start.shear) * (start.strain * -1.0).map_eigenvalues(f64::exp).to_matrix();
    let b_n = measure.left_cauchy_green(&start.elastic_strain).to_matrix();
    let F = deformation_gradient(strain, shear);
    let to_b = inverse_n * b_n * inverse_n.transpose() * F.transpose();
    let b = Sym3::symmetric_part(&(F * to_b));
    let dexp = exp_derivative(strain);
    // ∂b/∂e_ii is twice the symmetric part of ∂F/∂e_ii C Fᵀ.
    let half_rate = |axis: usize| {
        let grown: [f64; 6] = std::array::from_fn(|row| dexp[(row, axis)]);
        let dF: Mat3 = Sym3(grown).to_matrix() * simple_shear(shear);
        Sym3::symmetric_part(&(dF * to_b))
    };
    match measure {
        StrainMeasure::Logarithmic => {
            let (logarithm, L) = log_with_derivative(&b);
            Trial { strain: logarithm * 0.5, rates: [0, 1, 2].map(|axis| half_rate(axis).contract(&L)) }
        }
        StrainMeasure::LeftCauchyGreen => {
            Trial { strain: (b - Sym3::IDENTITY) * 0.5, rates: [0, 1, 2].map(half_rate) }
        }
    }
}
