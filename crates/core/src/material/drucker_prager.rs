//! Drucker-Prager plasticity.

use super::soil_plasticity::{PLASTIC_WORK, SoilPlasticity};
use super::strength::{EQUIVALENT, ON_SURFACE};
use super::{Elasticity, Friction, MaterialError, PrincipalLaw, PrincipalResponse, StrengthMeasure};
use crate::tensor::{Lane, Lanes};

/// The stress states in which the cone matches the Mohr-Coulomb strength.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Match {
    /// Triaxial compression: the cone through the outer corners of the hexagon, which gives the largest strength.
    Compression,
    /// Triaxial extension: the cone through the inner corners.
    Extension,
    /// Collapse in plane strain, with flow at the dilation angle.
    PlaneStrain,
    /// The cone inscribed in the hexagon, which gives the smallest strength; it equals `PlaneStrain` with associated
    /// flow.
    Inscribed,
}

impl Match {
    /// η and ξ for the friction angle with this sine and the flow parameter η̄.
    fn cone(self, sine: f64, flow: f64) -> [f64; 2] {
        let cosine = (1.0 - sine * sine).sqrt();
        let through = |sign: f64| {
            let per = 6.0 / (3f64.sqrt() * (3.0 - sign * sine));
            [per * sine, per * cosine]
        };
        match self {
            Match::Compression => through(1.0),
            Match::Extension => through(-1.0),
            Match::Inscribed => {
                let per = (3.0 / (3.0 + sine * sine)).sqrt();
                [per * sine, per * cosine]
            }
            Match::PlaneStrain => {
                // Without out-of-plane flow, s_zz = −(2/3) η̄ √J₂ sets the radius and the centre of Mohr's circle.
                let per = 1.0 / ((1.0 - flow * flow / 3.0).sqrt() + sine * flow / 3.0);
                [per * sine, per * cosine]
            }
        }
    }

    /// η̄ for the dilation angle with this sine.
    fn flow(self, sine: f64) -> f64 {
        match self {
            Match::PlaneStrain => Match::Inscribed.cone(sine, 0.0)[0],
            Match::Compression | Match::Extension | Match::Inscribed => self.cone(sine, 0.0)[0],
        }
    }
}

/// Drucker-Prager plasticity: f = √J₂ + η p − ξ c with p = tr τ/3, tension positive; flow with η̄ in place of η. The
/// stress returns to the apex p = ξ c/η if the flow would take it beyond the apex.
#[derive(Debug, Clone)]
pub struct DruckerPrager {
    elasticity: Elasticity,
    given: Friction,
    matched: Match,
    /// η, [-].
    slope: f64,
    /// ξ c, [stress].
    strength: f64,
    /// η̄, [-].
    flow: f64,
    measure: StrengthMeasure,
}

impl DruckerPrager {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the strength in terms of the Cauchy
    /// stress.
    pub fn new(young: f64, poisson: f64, friction: Friction, matched: Match) -> Self {
        let sine = |degrees: f64| degrees.to_radians().sin();
        let flow = matched.flow(sine(friction.dilation_angle));
        // With associated flow, the plane-strain cone is the inscribed cone. η then equals η̄ to the last bit, as
        // `is_symmetric` requires.
        let is_associated = friction.dilation_angle == friction.friction_angle;
        let cone = if is_associated && matched == Match::PlaneStrain { Match::Inscribed } else { matched };
        let [slope, per_cohesion] = cone.cone(sine(friction.friction_angle), flow);
        DruckerPrager {
            elasticity: Elasticity::from_young_poisson(young, poisson),
            given: friction,
            matched,
            slope,
            strength: per_cohesion * friction.cohesion,
            flow,
            measure: StrengthMeasure::Cauchy,
        }
    }

    /// Sets the stress measure that the strength limits.
    pub fn limiting(self, measure: StrengthMeasure) -> Self {
        DruckerPrager { measure, ..self }
    }
}

impl PrincipalLaw for DruckerPrager {
    fn without_flow(&self, trial: &[Lanes; 3], old: &[Lanes]) -> Option<Elasticity> {
        let Elasticity { bulk, shear } = self.elasticity;
        let trace = trial[0] + trial[1] + trial[2];
        let mut factor = Lanes::splat(1.0);
        if self.measure == StrengthMeasure::Cauchy {
            factor += trace + old[1]; // 1 + x ≤ exp(x)
        }
        let mean = trace * (1.0 / 3.0);
        let [x, y, z] = [trial[0] - mean, trial[1] - mean, trial[2] - mean];
        let radius = (x * x + y * y + z * z).sqrt() * (std::f64::consts::SQRT_2 * shear);
        let excess = radius + trace * (self.slope * bulk) - factor * self.strength;
        excess.is_below(0.0).then_some(self.elasticity)
    }

    /// Flow γ = f/(G + K η η̄) scales back the trial deviator s; beyond the apex, the deviator vanishes, and the
    /// stress is that of the apex.
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        let DruckerPrager { elasticity, slope, flow, .. } = *self;
        let Elasticity { bulk, shear } = elasticity;
        new.copy_from_slice(old);
        let trace = trial[0] + trial[1] + trial[2];
        let is_cauchy = self.measure == StrengthMeasure::Cauchy;
        let strength = if is_cauchy { (trace + old[1]).exp() * self.strength } else { self.strength };
        // The derivative of the strength with respect to the trace.
        let strength_rate = if is_cauchy { strength } else { 0.0 };
        let s = trial.map(|e| 2.0 * shear * (e - trace / 3.0));
        let rho = (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]).sqrt();
        let radius = rho * std::f64::consts::FRAC_1_SQRT_2;
        let mean = bulk * trace;
        let excess = radius + slope * mean - strength;
        if excess <= ON_SURFACE * radius.max(slope * mean.abs()).max(strength) {
            let modulus = elasticity.principal_modulus();
            return Ok(PrincipalResponse {
                tau: elasticity.principal_stress(trial),
                elastic_strain: trial,
                modulus,
            });
        }
        let stiffness = shear + bulk * slope * flow;
        let gamma = excess / stiffness;
        let returned = radius - shear * gamma;
        let (tau, modulus) = if returned >= 0.0 && radius > 0.0 {
            let ratio = returned / radius;
            let n = s.map(|x| x / rho);
            let pressure = mean - bulk * flow * gamma;
            // The rate of γ is √2 G n·dε + (K η − strength_rate) tr dε, divided by the stiffness.
            let rate: [f64; 3] = std::array::from_fn(|j| {
                (std::f64::consts::SQRT_2 * shear * n[j] + bulk * slope - strength_rate) / stiffness
            });
            let modulus = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let deviatoric = if i == j { 2.0 / 3.0 } else { -1.0 / 3.0 };
                    let turned = 2.0 * shear * ratio * (deviatoric - n[i] * n[j]);
                    let along = std::f64::consts::SQRT_2
                        * n[i]
                        * (std::f64::consts::SQRT_2 * shear * n[j] - shear * rate[j]);
                    turned + along + bulk - bulk * flow * rate[j]
                })
            });
            (std::array::from_fn(|i| s[i] * ratio + pressure), modulus)
        } else {
            ([strength / slope; 3], [[strength_rate / slope; 3]; 3])
        };
        let elastic_strain = elasticity.principal_strain(tau);
        if !elastic_strain[0].is_finite() {
            return Err(MaterialError::NoResponse);
        }
        let plastic: [f64; 3] = std::array::from_fn(|i| trial[i] - elastic_strain[i]);
        let volumetric = plastic[0] + plastic[1] + plastic[2];
        let deviatoric = plastic.map(|x| x - volumetric / 3.0);
        let length = (deviatoric.iter().map(|x| x * x).sum::<f64>()).sqrt();
        new[0] += EQUIVALENT * length;
        new[1] += volumetric;
        new[PLASTIC_WORK] += (0..3).map(|i| tau[i] * plastic[i]).sum::<f64>();
        Ok(PrincipalResponse { tau, elastic_strain, modulus })
    }
}

impl SoilPlasticity for DruckerPrager {
    fn elasticity(&self) -> &Elasticity {
        &self.elasticity
    }

    fn is_symmetric(&self) -> bool {
        self.slope == self.flow && self.measure == StrengthMeasure::Kirchhoff
    }

    fn divided(&self, factor: f64) -> Self {
        let Friction { cohesion, friction_angle, dilation_angle } = self.given;
        let friction_angle = (friction_angle.to_radians().tan() / factor).atan().to_degrees();
        let friction = Friction {
            cohesion: cohesion / factor,
            friction_angle,
            dilation_angle: dilation_angle.min(friction_angle),
        };
        let reduced = DruckerPrager::new(1.0, 0.0, friction, self.matched).limiting(self.measure);
        DruckerPrager { elasticity: self.elasticity, ..reduced }
    }
}
