//! Strain softening: the strength decays to a residual value as the equivalent plastic strain grows.

/// Exponential decay of strength with the equivalent plastic strain κ: X = X_r + (X_p − X_r) e^(−3κ/κ₉₅) between the
/// peak X_p and the residual X_r (Einav and Randolph 2005, doi 10.1002/nme.1350); 95 % of the difference is lost at
/// κ₉₅.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Softening {
    /// κ₉₅, [-].
    strain: f64,
}

impl Softening {
    /// The decay in which 95 % of the difference is lost at this equivalent plastic strain, [-], which must be
    /// positive.
    pub fn over(strain: f64) -> Self {
        Softening { strain }
    }

    /// Remaining share of the difference between peak and residual strength, [-], and its derivative with respect to κ.
    pub(super) fn share(&self, kappa: f64) -> [f64; 2] {
        let rate = -3.0 / self.strain;
        let share = (rate * kappa).exp();
        [share, rate * share]
    }
}
