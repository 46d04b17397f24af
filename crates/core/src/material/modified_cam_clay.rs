//! Modified Cam-clay plasticity at finite strain.

use super::strength::{EQUIVALENT, ON_SURFACE};
use super::{
    Material, MaterialError, PrincipalLaw, PrincipalResponse, Response, StateField, update_in_principal_axes,
};
use crate::tensor::Sym3;

/// Modified Cam-clay at finite strain (Borja and Tamagnini 1998, doi 10.1016/S0045-7825(97)00141-2): the ellipse f = q²/M²
/// + P (P − P_c) of the mean pressure P = −tr τ/3 and q = √(3 J₂), associated flow, and bilogarithmic compression.
///
/// On the virgin line ln J = −λ̂ ln(P/P₀); unloaded, the volume follows κ̂. Elasticity has the stored energy W = P₀ κ̂ e^ω +
/// 3/2 μ ε_s² with ω = −ε_v/κ̂ and μ = μ₀ + α P₀ e^ω (Borja, Tamagnini and Amorosi 1997,
/// doi 10.1061/(ASCE)1090-0241(1997)123:10(948)), so that the bulk modulus grows in proportion to the pressure.
#[derive(Debug, Clone)]
pub struct ModifiedCamClay {
    parameters: CamClay,
    fields: [StateField; 4],
}

/// The parameters of [`ModifiedCamClay`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CamClay {
    /// λ̂, slope of the virgin line in ln J over ln P, [-].
    pub compression_index: f64,
    /// κ̂, slope of unloading lines, below λ̂, [-].
    pub swelling_index: f64,
    /// M, q/P at the critical state, [-].
    pub critical_state_ratio: f64,
    /// μ₀, [stress].
    pub shear_modulus: f64,
    /// α, growth of μ per pressure, [-]; with 0, μ is constant.
    pub shear_modulus_ratio: f64,
    /// P_c over the size of the ellipse through the initial stress, at least 1, [-].
    pub overconsolidation_ratio: f64,
    /// P₀, the pressure at zero elastic strain, [stress]. It moves the origin of strain; stresses depend on their initial
    /// values only.
    pub reference_pressure: f64,
}

/// Places of the history variables.
const PRECONSOLIDATION: usize = 0;
const EQUIVALENT_STRAIN: usize = 1;
const VOLUMETRIC_STRAIN: usize = 2;
const WORK: usize = 3;

/// Largest number of Newton iterations of the return mapping.
const MOST_ITERATIONS: usize = 50;
/// The equations of the return mapping hold to this, [-].
const TOLERANCE: f64 = 1e-13;
/// Largest number of halvings of a Newton increment.
const MOST_HALVINGS: usize = 30;

impl ModifiedCamClay {
    /// The law with these parameters.
    pub fn new(parameters: CamClay) -> Self {
        let initial = parameters.overconsolidation_ratio * parameters.reference_pressure;
        ModifiedCamClay {
            parameters,
            fields: [
                StateField::new("preconsolidation_pressure", "stress", initial),
                StateField::new("equivalent_plastic_strain", "-", 0.0),
                StateField::new("plastic_volumetric_strain", "-", 0.0),
                StateField::new("plastic_work", "energy/volume", 0.0),
            ],
        }
    }
}

/// The elastic stress at invariants of the strain.
#[derive(Debug, Clone, Copy)]
struct Elastic {
    /// P, [stress].
    pressure: f64,
    /// q, [stress].
    shear: f64,
    /// μ, [stress].
    modulus: f64,
    /// −∂P/∂ε_v, [stress].
    bulk: f64,
    /// ∂q/∂ε_v = −∂P/∂ε_s, [stress].
    coupling: f64,
}

/// The equations of the return mapping at a trial solution.
struct Equations {
    /// Those of the volumetric strain, of the shear strain, and of the yield surface, all relative.
    residual: [f64; 3],
    /// Their derivatives with respect to ε_v^e, ε_s^e and the scaled multiplier.
    jacobian: [[f64; 3]; 3],
    elastic: Elastic,
    /// P_c, [stress].
    size: f64,
}

/// Invariants of the trial strain, and the history.
#[derive(Debug, Clone, Copy)]
struct Start {
    volumetric: f64,
    shear: f64,
    /// P_c of the converged state, [stress].
    size: f64,
}

impl CamClay {
    fn elastic(&self, volumetric: f64, shear: f64) -> Elastic {
        let CamClay { swelling_index, shear_modulus, shear_modulus_ratio, reference_pressure, .. } = *self;
        let confined = reference_pressure * (-volumetric / swelling_index).exp();
        let growth = shear_modulus_ratio * confined;
        let modulus = shear_modulus + growth;
        let pressure = confined + 1.5 * growth * shear * shear / swelling_index;
        Elastic {
            pressure,
            shear: 3.0 * modulus * shear,
            modulus,
            bulk: pressure / swelling_index,
            coupling: -3.0 * growth * shear / swelling_index,
        }
    }

    fn yields(&self, elastic: &Elastic, size: f64) -> f64 {
        let ratio = elastic.shear / self.critical_state_ratio;
        ratio * ratio + elastic.pressure * (elastic.pressure - size)
    }

    /// P_c at an elastic volumetric strain: it grows with the plastic one.
    fn size(&self, start: &Start, volumetric: f64) -> f64 {
        let plasticity = self.compression_index - self.swelling_index;
        start.size * ((volumetric - start.volumetric) / plasticity).exp()
    }

    /// The equations at ε_v^e, ε_s^e and Γ = Δγ P_cn:
    /// ε_v^e − ε_v^tr = Γ (2P − P_c)/P_cn, ε_s^e − ε_s^tr = −2Γ q/(M² P_cn), f/P_cn² = 0.
    fn equations(&self, start: &Start, x: [f64; 3]) -> Equations {
        let [volumetric, shear, gamma] = x;
        let square = self.critical_state_ratio * self.critical_state_ratio;
        let elastic = self.elastic(volumetric, shear);
        let size = self.size(start, volumetric);
        let Elastic { pressure, shear: q, modulus, bulk, coupling } = elastic;
        let per = 1.0 / start.size;
        let normal = (2.0 * pressure - size) * per;
        let size_rate = size / (self.compression_index - self.swelling_index);
        let [p_v, p_s] = [-bulk, -coupling];
        let [q_v, q_s] = [coupling, 3.0 * modulus];
        let slope = 2.0 * per / square;
        let residual = [
            volumetric - start.volumetric - gamma * normal,
            shear - start.shear + gamma * slope * q,
            self.yields(&elastic, size) * per * per,
        ];
        let yield_by = |p: f64, q_rate: f64, size_rate: f64| {
            2.0 * q * q_rate / square + (2.0 * pressure - size) * p - pressure * size_rate
        };
        let jacobian = [
            [1.0 - gamma * per * (2.0 * p_v - size_rate), -gamma * per * 2.0 * p_s, -normal],
            [gamma * slope * q_v, 1.0 + gamma * slope * q_s, slope * q],
            [yield_by(p_v, q_v, size_rate) * per * per, yield_by(p_s, q_s, 0.0) * per * per, 0.0],
        ];
        Equations { residual, jacobian, elastic, size }
    }

    /// Solves the equations by Newton's method with a line search.
    fn solve(&self, start: &Start) -> Result<([f64; 3], Equations), MaterialError> {
        let size = |e: &Equations| {
            let norm = e.residual.iter().map(|r| r * r).sum::<f64>().sqrt();
            if norm.is_finite() { norm } else { f64::INFINITY }
        };
        let mut x = [self.reached(start), start.shear, 0.0];
        let mut now = self.equations(start, x);
        for _ in 0..MOST_ITERATIONS {
            let before = size(&now);
            let Some(step) = solved(&now.jacobian, &now.residual) else { break };
            let mut share = 1.0;
            let mut found = None;
            for _ in 0..MOST_HALVINGS {
                let next = std::array::from_fn(|k| x[k] - share * step[k]);
                let equations = self.equations(start, next);
                if size(&equations) < before {
                    found = Some((next, equations));
                    break;
                }
                share *= 0.5;
            }
            match found {
                Some((next, equations)) => (x, now) = (next, equations),
                // No further progress: round-off, or no solution.
                None => break,
            }
        }
        let is_solution =
            size(&now) <= TOLERANCE * (1.0 + start.volumetric.abs() + start.shear) && x[2] >= 0.0;
        if is_solution { Ok((x, now)) } else { Err(MaterialError::NoResponse) }
    }

    /// A first elastic volumetric strain: that of the trial state or, if its pressure lies far beyond the ellipse, that of
    /// isotropic compression along the virgin line.
    fn reached(&self, start: &Start) -> f64 {
        let CamClay { compression_index, swelling_index, reference_pressure, .. } = *self;
        let at_size = -swelling_index * (start.size / reference_pressure).ln();
        let beyond = start.volumetric - at_size;
        if beyond < 0.0 { at_size + beyond * swelling_index / compression_index } else { start.volumetric }
    }
}

/// The solution of three linear equations by Cramer's rule; none if they are singular.
fn solved(a: &[[f64; 3]; 3], b: &[f64; 3]) -> Option<[f64; 3]> {
    let inverse = nalgebra::Matrix3::from_fn(|i, j| a[i][j]).try_inverse()?;
    let x = inverse * nalgebra::Vector3::from(*b);
    Some([x[0], x[1], x[2]])
}

/// Stress and modulus from invariants of the stress and their derivatives.
struct Invariants {
    elastic: Elastic,
    /// Derivatives of P with respect to ε_v^tr and ε_s^tr, [stress].
    pressure_rates: [f64; 2],
    /// The same of q, [stress].
    shear_rates: [f64; 2],
    /// Deviatoric stress over the trial deviator, [stress].
    ratio: f64,
}

impl Invariants {
    /// The response at a trial deviator; τ = −P + √(2/3) q n with n along the deviator.
    fn respond(&self, deviator: &[f64; 3], elastic_strain: [f64; 3]) -> PrincipalResponse {
        let length = deviator.iter().map(|e| e * e).sum::<f64>().sqrt();
        let n = if length > 0.0 { deviator.map(|e| e / length) } else { [0.0; 3] };
        let [p_v, p_s] = self.pressure_rates;
        let [q_v, q_s] = self.shear_rates;
        let modulus = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let shear = EQUIVALENT * n[j]; // ∂ε_s^tr/∂ε_j
                let turning = if i == j { 2.0 / 3.0 } else { -1.0 / 3.0 } - n[i] * n[j];
                self.ratio * turning + EQUIVALENT * n[i] * (q_v + q_s * shear) - p_v - p_s * shear
            })
        });
        PrincipalResponse {
            tau: deviator.map(|e| self.ratio * e - self.elastic.pressure),
            elastic_strain,
            modulus,
        }
    }
}

impl PrincipalLaw for ModifiedCamClay {
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        new.copy_from_slice(old);
        let law = &self.parameters;
        let volumetric = trial[0] + trial[1] + trial[2];
        let deviator = trial.map(|e| e - volumetric / 3.0);
        let shear = EQUIVALENT * deviator.iter().map(|e| e * e).sum::<f64>().sqrt();
        let start = Start { volumetric, shear, size: old[PRECONSOLIDATION] };
        let elastic = law.elastic(volumetric, shear);
        if !(elastic.pressure * elastic.pressure + elastic.shear * elastic.shear).is_finite() {
            return Err(MaterialError::NoResponse);
        }
        let scale = elastic.pressure.max(start.size);
        if law.yields(&elastic, start.size) <= ON_SURFACE * scale * scale {
            let Elastic { bulk, coupling, modulus, .. } = elastic;
            let (pressure_rates, shear_rates) = ([-bulk, -coupling], [coupling, 3.0 * modulus]);
            let invariants = Invariants { elastic, pressure_rates, shear_rates, ratio: 2.0 * modulus };
            return Ok(invariants.respond(&deviator, trial));
        }
        let ([volumetric, reached_shear, gamma], equations) = law.solve(&start)?;
        if reached_shear > law.largest_shear() {
            return Err(MaterialError::NoResponse);
        }
        let (invariants, kept) = law.invariants(&equations, &start, gamma)?;
        let response = invariants.respond(&deviator, deviator.map(|e| kept * e + volumetric / 3.0));
        new[PRECONSOLIDATION] = equations.size;
        new[EQUIVALENT_STRAIN] += start.shear - reached_shear;
        new[VOLUMETRIC_STRAIN] += start.volumetric - volumetric;
        let plastic: [f64; 3] = std::array::from_fn(|i| trial[i] - response.elastic_strain[i]);
        new[WORK] += (0..3).map(|i| response.tau[i] * plastic[i]).sum::<f64>();
        Ok(response)
    }
}

impl CamClay {
    /// Largest elastic ε_s of a stable state: beyond √(2κ̂/(3α)) q/P falls again if μ depends on the pressure alone, and the
    /// clay would lose its strength; infinite otherwise.
    fn largest_shear(&self) -> f64 {
        if self.shear_modulus > 0.0 || self.shear_modulus_ratio <= 0.0 {
            return f64::INFINITY;
        }
        (2.0 * self.swelling_index / (3.0 * self.shear_modulus_ratio)).sqrt()
    }

    /// Largest q/P that the elasticity can carry, √(3ακ̂/2), [-]; infinite if μ₀ is not zero.
    pub fn largest_stress_ratio(&self) -> f64 {
        1.5 * self.shear_modulus_ratio * self.largest_shear()
    }

    /// The stress at the end of the flow with its derivatives with respect to the trial strain, and ε_s^e/ε_s^tr.
    fn invariants(
        &self,
        equations: &Equations,
        start: &Start,
        gamma: f64,
    ) -> Result<(Invariants, f64), MaterialError> {
        let Equations { jacobian, elastic, size, .. } = equations;
        let Elastic { pressure, modulus, bulk, coupling, .. } = *elastic;
        // The trial strains enter the first two equations, and P_c, which depends on ε_v^e − ε_v^tr.
        let per = 1.0 / start.size;
        let size_rate = size / (self.compression_index - self.swelling_index);
        let by_volumetric = [1.0 + gamma * per * size_rate, 0.0, -pressure * size_rate * per * per];
        let solve = |right: [f64; 3]| solved(jacobian, &right).ok_or(MaterialError::NoResponse);
        let rates = [solve(by_volumetric)?, solve([0.0, 1.0, 0.0])?];
        let square = self.critical_state_ratio * self.critical_state_ratio;
        let kept = 1.0 / (1.0 + 6.0 * gamma * per * modulus / square);
        let invariants = Invariants {
            elastic: *elastic,
            pressure_rates: rates.map(|[v, s, _]| -bulk * v - coupling * s),
            shear_rates: rates.map(|[v, s, _]| coupling * v + 3.0 * modulus * s),
            ratio: 2.0 * modulus * kept,
        };
        Ok((invariants, kept))
    }

    /// The elastic strain invariants of a stress, by Newton's method in ε_s where μ depends on the pressure.
    fn strain_of(&self, pressure: f64, shear: f64) -> Option<[f64; 2]> {
        let CamClay { swelling_index, shear_modulus, shear_modulus_ratio, reference_pressure, .. } = *self;
        // P = C (1 + 3α ε_s²/(2κ̂)) and q = 3 (μ₀ + α C) ε_s with C = P₀ e^ω.
        let confined =
            |strain: f64| pressure / (1.0 + 1.5 * shear_modulus_ratio * strain * strain / swelling_index);
        let stress = |strain: f64| 3.0 * (shear_modulus + shear_modulus_ratio * confined(strain)) * strain;
        // q grows with ε_s up to a largest value if α C dominates; the root sought lies before it.
        let (mut low, mut high) = (0.0, shear / (3.0 * shear_modulus.max(f64::MIN_POSITIVE)));
        if shear_modulus_ratio > 0.0 {
            high = f64::min(high, (2.0 * swelling_index / (3.0 * shear_modulus_ratio)).sqrt());
        }
        if shear > 0.0 && shear_modulus_ratio > 0.0 {
            if stress(high) < shear * (1.0 - 1e-12) {
                return None;
            }
            while high - low > 1e-16 * high {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                *if stress(middle) < shear { &mut low } else { &mut high } = middle;
            }
        }
        let strain = high;
        Some([-swelling_index * (confined(strain) / reference_pressure).ln(), strain])
    }
}

impl Material for ModifiedCamClay {
    fn state_fields(&self) -> &[StateField] {
        &self.fields
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        update_in_principal_axes(self, trial, old, new)
    }

    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        Some(self)
    }

    /// The ellipse through the stress, times the overconsolidation ratio.
    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        let volumetric = elastic_strain.trace();
        let law = &self.parameters;
        let elastic = law.elastic(volumetric, EQUIVALENT * elastic_strain.deviator().norm());
        let ratio = elastic.shear / law.critical_state_ratio;
        let size = elastic.pressure + ratio * ratio / elastic.pressure;
        history[PRECONSOLIDATION] = law.overconsolidation_ratio * size;
        history[VOLUMETRIC_STRAIN] = volume_ratio.ln() - volumetric;
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        let (pressure, deviator) = (-tau.trace() / 3.0, tau.deviator());
        if pressure.is_nan() || pressure <= 0.0 {
            return Err(MaterialError::NoStrain);
        }
        let norm = deviator.norm();
        let [volumetric, shear] =
            self.parameters.strain_of(pressure, norm / EQUIVALENT).ok_or(MaterialError::NoStrain)?;
        let per_stress = if norm > 0.0 { shear / (EQUIVALENT * norm) } else { 0.0 };
        let strain = Sym3::IDENTITY * (volumetric / 3.0) + deviator * per_stress;
        if strain.norm().is_finite() { Ok(strain) } else { Err(MaterialError::NoStrain) }
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        let CamClay { swelling_index, reference_pressure, .. } = self.parameters;
        let volumetric = elastic_strain.trace();
        let shear = EQUIVALENT * elastic_strain.deviator().norm();
        let confined = reference_pressure * (-volumetric / swelling_index).exp();
        let modulus = self.parameters.elastic(volumetric, shear).modulus;
        confined * swelling_index + 1.5 * modulus * shear * shear
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        history[WORK]
    }

    /// Implicit hardening couples the direction of flow to P_c, also where the flow is associated.
    fn tangent_is_symmetric(&self) -> bool {
        false
    }
}
