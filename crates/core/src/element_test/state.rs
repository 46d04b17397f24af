//! The state of a material point in an element test.

use crate::tensor::{Mat3, Sym3};

/// The state of a material point in an element test; stresses are positive in tension, pressures in compression.
#[derive(Debug, Clone, PartialEq)]
pub struct ElementState {
    /// e in F = exp(e) (I + γ e_x ⊗ e_y), [-].
    pub strain: Sym3,
    /// γ, [-].
    pub shear: f64,
    /// Elastic strain, in the measure of the law, [-].
    pub elastic_strain: Sym3,
    /// Kirchhoff stress τ, [stress].
    pub kirchhoff_stress: Sym3,
    /// History variables of the law.
    pub history: Vec<f64>,
    /// True if no continuous path leads here from the previous state: the stress of a softening material may fall
    /// suddenly, however small the steps are.
    pub has_jumped: bool,
}

impl ElementState {
    /// ln J = tr e, [-].
    pub fn log_volume_ratio(&self) -> f64 {
        self.strain.trace()
    }

    /// J = det F, [-].
    pub fn volume_ratio(&self) -> f64 {
        self.log_volume_ratio().exp()
    }

    /// Deformation gradient F, [-].
    pub fn deformation_gradient(&self) -> Mat3 {
        deformation_gradient(&self.strain, self.shear)
    }

    /// Logarithmic strain ½ ln(F Fᵀ) of the whole deformation, [-].
    pub fn logarithmic_strain(&self) -> Sym3 {
        if self.shear == 0.0 {
            return self.strain;
        }
        let F = self.deformation_gradient();
        Sym3::symmetric_part(&(F * F.transpose())).map_eigenvalues(f64::ln) * 0.5
    }

    /// Cauchy stress σ = τ/J, [stress].
    pub fn cauchy_stress(&self) -> Sym3 {
        self.kirchhoff_stress * (1.0 / self.volume_ratio())
    }

    /// Mean stress p = −tr σ/3, positive in compression, [stress].
    pub fn pressure(&self) -> f64 {
        -self.cauchy_stress().trace() / 3.0
    }

    /// Deviatoric stress q = √(3 J₂) of the Cauchy stress, [stress].
    pub fn deviatoric_stress(&self) -> f64 {
        1.5f64.sqrt() * self.cauchy_stress().deviator().norm()
    }

    /// Deviatoric strain √(2/3) |dev ½ ln(F Fᵀ)|, which is work-conjugate to q in triaxial tests, [-].
    pub fn deviatoric_strain(&self) -> f64 {
        (2.0f64 / 3.0).sqrt() * self.logarithmic_strain().deviator().norm()
    }
}

/// F = exp(e) (I + γ e_x ⊗ e_y).
pub(super) fn deformation_gradient(strain: &Sym3, shear: f64) -> Mat3 {
    strain.map_eigenvalues(f64::exp).to_matrix() * simple_shear(shear)
}

/// I + γ e_x ⊗ e_y, whose inverse has −γ in place of γ.
pub(super) fn simple_shear(shear: f64) -> Mat3 {
    let mut sheared = Mat3::identity();
    sheared[(0, 1)] = shear;
    sheared
}
