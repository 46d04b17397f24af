//! Tresca plasticity.

use super::wedge::{Strength, WedgeLaw, WedgeSettings};
use super::{Elasticity, Softening, StrengthMeasure};

/// Tresca plasticity: f = τ₁ − τ₃ − 2c, where τ₁ and τ₃ are the largest and smallest principal stresses and c is the
/// undrained shear strength. The flow is associated and preserves the volume.
#[derive(Debug, Clone)]
pub struct Tresca {
    settings: WedgeSettings,
    /// Initial c, [stress].
    cohesion: f64,
    /// Residual c, [stress], and the softening towards it.
    softening: Option<(f64, Softening)>,
}

impl Tresca {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the undrained shear strength,
    /// [stress], which limits the Kirchhoff stress.
    pub fn new(young: f64, poisson: f64, cohesion: f64) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        let settings = WedgeSettings { elasticity, measure: StrengthMeasure::Kirchhoff, softens: false };
        Tresca { settings, cohesion, softening: None }
    }

    /// Lets the strength decay to this residual strength, [stress].
    pub fn softening(self, residual: f64, softening: Softening) -> Self {
        let settings = WedgeSettings { softens: true, ..self.settings };
        Tresca { settings, softening: Some((residual, softening)), ..self }
    }

    /// Sets the stress measure that the strength limits.
    pub fn limiting(self, measure: StrengthMeasure) -> Self {
        Tresca { settings: WedgeSettings { measure, ..self.settings }, ..self }
    }
}

impl WedgeLaw for Tresca {
    fn settings(&self) -> &WedgeSettings {
        &self.settings
    }

    fn is_associated(&self) -> bool {
        true
    }

    fn strength(&self, kappa: f64) -> [Strength; 2] {
        let [cohesion, rate] = match self.softening {
            None => [self.cohesion, 0.0],
            Some((residual, softening)) => {
                let [share, rate] = softening.share(kappa).map(|x| x * (self.cohesion - residual));
                [residual + share, rate]
            }
        };
        [
            Strength { ratio: 1.0, flow_ratio: 1.0, compressive: 2.0 * cohesion, tensile: f64::INFINITY },
            Strength { ratio: 0.0, flow_ratio: 0.0, compressive: 2.0 * rate, tensile: 0.0 },
        ]
    }

    fn reduced(&self, factor: f64) -> Self {
        Tresca {
            cohesion: self.cohesion / factor,
            softening: self.softening.map(|(residual, softening)| (residual / factor, softening)),
            ..*self
        }
    }
}
