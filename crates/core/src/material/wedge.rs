//! Plasticity with the Mohr-Coulomb surface, of which the Tresca surface is a special case: softening, and the
//! stress measure that the strength limits.

mod return_mapping;

use super::soil_plasticity::{PLASTIC_WORK, SoilPlasticity};
use super::strength::{EQUIVALENT, ON_SURFACE};
use super::{Elasticity, MaterialError, PrincipalLaw, PrincipalResponse, StrengthMeasure};
use crate::tensor::{Lane, Lanes};
use return_mapping::Returned;
pub(super) use return_mapping::Strength;

/// Largest number of iterations for the softened strength.
const MAX_ITERATIONS: usize = 60;

/// Settings of laws with this surface in addition to their strength.
#[derive(Debug, Clone, Copy)]
pub(super) struct WedgeSettings {
    pub(super) elasticity: Elasticity,
    /// The stress measure that the strength limits.
    pub(super) measure: StrengthMeasure,
    /// True if the strength changes with the equivalent plastic strain.
    pub(super) softens: bool,
}

/// The parts in which a law with this surface differs from other laws of this kind.
pub(super) trait WedgeLaw: std::fmt::Debug + Send + Sync + Sized + 'static {
    fn settings(&self) -> &WedgeSettings;

    /// True if flow is normal to the surface.
    fn is_associated(&self) -> bool;

    /// The strength at an equivalent plastic strain, and the derivative of the strength with respect to that strain.
    fn strength(&self, kappa: f64) -> [Strength; 2];

    /// The law with its strength divided by a factor.
    fn reduced(&self, factor: f64) -> Self;
}

impl<L: WedgeLaw> PrincipalLaw for L {
    #[inline(never)]
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        Wedge { settings: *self.settings(), law: self }.respond(trial, old, new)
    }

    #[inline(never)]
    fn without_flow(&self, trial: &[Lanes; 3], old: &[Lanes]) -> Option<Elasticity> {
        let WedgeSettings { elasticity, measure, softens } = self.settings();
        if *softens {
            return None;
        }
        let [strength, _] = self.strength(0.0);
        let tau = elasticity.stress_components(trial);
        let mut factor = Lanes::splat(1.0);
        if *measure == StrengthMeasure::Cauchy {
            factor += trial[0] + trial[1] + trial[2] + old[1]; // a lower bound of the exponential
        }
        let shear = tau[0] * strength.ratio - tau[2] - factor * strength.compressive;
        let is_inside =
            shear.is_below(0.0) && (!strength.is_cut() || (tau[0] - factor * strength.tensile).is_below(0.0));
        is_inside.then_some(*elasticity)
    }
}

impl<L: WedgeLaw> SoilPlasticity for L {
    fn elasticity(&self) -> &Elasticity {
        &self.settings().elasticity
    }

    fn is_symmetric(&self) -> bool {
        let WedgeSettings { measure, softens, .. } = *self.settings();
        self.is_associated() && measure == StrengthMeasure::Kirchhoff && !softens
    }

    fn divided(&self, factor: f64) -> Self {
        self.reduced(factor)
    }
}

/// The return mapping of a law with this surface.
struct Wedge<'a, L> {
    settings: WedgeSettings,
    law: &'a L,
}

/// The strength at a trial state, in terms of the Kirchhoff stress.
struct AtTrial {
    strength: Strength,
    /// Its derivatives with respect to the equivalent plastic strain and to ln J.
    rates: [Strength; 2],
}

/// The stress at an equivalent plastic strain κ.
struct Flowed {
    returned: Returned<2>,
    elastic_strain: [f64; 3],
    /// The equivalent plastic strain that results from the flow.
    kappa: f64,
    /// Direction of the deviatoric plastic strain increment times √(2/3); zero if there is no such increment.
    direction: [f64; 3],
    /// Derivative of `kappa` with respect to the κ at which the strength is evaluated.
    slope: f64,
}

impl<L: WedgeLaw> Wedge<'_, L> {
    /// Principal stresses, elastic strains and modulus at ordered trial strains.
    ///
    /// # Errors
    /// [`MaterialError::NoResponse`] if the material softens so fast that the flow has no solution.
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        new.copy_from_slice(old);
        let elasticity = &self.settings.elasticity;
        let tau = elasticity.principal_stress(trial);
        let trace = trial[0] + trial[1] + trial[2];
        let factor = match self.settings.measure {
            StrengthMeasure::Kirchhoff => 1.0,
            StrengthMeasure::Cauchy => (trace + old[1]).exp(),
        };
        let at = self.at(old[0], factor);
        let scale = tau[0].abs().max(tau[2].abs()).max(at.strength.compressive);
        if at.strength.excess(&tau) <= ON_SURFACE * scale {
            let modulus = elasticity.principal_modulus();
            return Ok(PrincipalResponse { tau, elastic_strain: trial, modulus });
        }
        let flowed = self.flow(&trial, &tau, old[0], factor, at)?;
        let Flowed { returned: Returned { tau, modulus, by_parameter }, elastic_strain, .. } = &flowed;
        let plastic: [f64; 3] = std::array::from_fn(|i| trial[i] - elastic_strain[i]);
        new[0] = flowed.kappa;
        new[1] += plastic[0] + plastic[1] + plastic[2];
        new[PLASTIC_WORK] += tau[0] * plastic[0] + tau[1] * plastic[1] + tau[2] * plastic[2];
        let mut modulus = *modulus;
        let [by_kappa, by_volume] = by_parameter;
        if self.settings.measure == StrengthMeasure::Cauchy {
            for (row, change) in modulus.iter_mut().zip(by_volume) {
                row.iter_mut().for_each(|entry| *entry += change);
            }
        }
        if self.settings.softens {
            let growth_rate = flowed.growth(elasticity, &modulus);
            for (row, change) in modulus.iter_mut().zip(by_kappa) {
                row.iter_mut().zip(growth_rate).for_each(|(entry, growth)| *entry += change * growth);
            }
        }
        Ok(PrincipalResponse { tau: *tau, elastic_strain: *elastic_strain, modulus })
    }

    /// The strength and its derivatives; `factor` multiplies the stresses among them.
    fn at(&self, kappa: f64, factor: f64) -> AtTrial {
        let [strength, rate] = self.law.strength(kappa);
        let scaled = |strength: Strength| Strength {
            compressive: factor * strength.compressive,
            tensile: factor * strength.tensile,
            ..strength
        };
        let strength = scaled(strength);
        let by_volume = Strength { ratio: 0.0, flow_ratio: 0.0, ..strength };
        AtTrial { strength, rates: [scaled(rate), by_volume] }
    }

    /// The stress during yield. With softening, it follows from the strength at the end of the flow, which is found by
    /// Newton's method between bounds.
    fn flow(
        &self,
        trial: &[f64; 3],
        tau: &[f64; 3],
        kappa_n: f64,
        factor: f64,
        at: AtTrial,
    ) -> Result<Flowed, MaterialError> {
        let mut flowed = self.flowed(trial, tau, kappa_n, at);
        if !self.settings.softens {
            return Ok(flowed);
        }
        let (mut kappa, mut bounds) = (kappa_n, [kappa_n, f64::INFINITY]);
        for _ in 0..MAX_ITERATIONS {
            let error = flowed.kappa - kappa;
            if error.abs() <= 1e-15 + 1e-14 * flowed.kappa {
                let is_stable = flowed.slope < 1.0;
                return if is_stable { Ok(flowed) } else { Err(MaterialError::NoResponse) };
            }
            bounds[usize::from(error < 0.0)] = kappa;
            let [low, high] = bounds;
            let next = kappa + error / (1.0 - flowed.slope);
            let is_between = next > low && next < high;
            kappa = match high.is_finite() {
                _ if is_between && flowed.slope < 1.0 => next,
                true => 0.5 * (low + high),
                false => kappa + 2.0 * error,
            };
            flowed = self.flowed(trial, tau, kappa_n, self.at(kappa, factor));
        }
        Err(MaterialError::NoResponse)
    }

    /// The stress returned to the surface of this strength.
    fn flowed(&self, trial: &[f64; 3], tau: &[f64; 3], kappa_n: f64, at: AtTrial) -> Flowed {
        let elasticity = &self.settings.elasticity;
        let is_constant = self.settings.measure == StrengthMeasure::Kirchhoff && !self.settings.softens;
        let returned = at.strength.returned(elasticity, tau, (!is_constant).then_some(&at.rates));
        let elastic_strain = elasticity.principal_strain(returned.tau);
        let mut flow: [f64; 3] = std::array::from_fn(|i| trial[i] - elastic_strain[i]);
        let mean = (flow[0] + flow[1] + flow[2]) / 3.0;
        flow.iter_mut().for_each(|x| *x -= mean);
        let length = (flow[0] * flow[0] + flow[1] * flow[1] + flow[2] * flow[2]).sqrt();
        let direction = if length > 0.0 { flow.map(|x| x * (EQUIVALENT / length)) } else { [0.0; 3] };
        let slope = if self.settings.softens {
            let strain_rate = elasticity.principal_strain(returned.by_parameter[0]);
            -(0..3).map(|i| direction[i] * strain_rate[i]).sum::<f64>()
        } else {
            0.0
        };
        Flowed { returned, elastic_strain, kappa: kappa_n + EQUIVALENT * length, direction, slope }
    }
}

impl Flowed {
    /// Derivative of the equivalent plastic strain with respect to the trial strains. `modulus` is the modulus at
    /// constant equivalent plastic strain.
    fn growth(&self, elasticity: &Elasticity, modulus: &[[f64; 3]; 3]) -> [f64; 3] {
        std::array::from_fn(|j| {
            let elastic = elasticity.principal_strain([modulus[0][j], modulus[1][j], modulus[2][j]]);
            let along = |x: &[f64; 3]| (0..3).map(|i| self.direction[i] * x[i]).sum::<f64>();
            (self.direction[j] - along(&elastic)) / (1.0 - self.slope)
        })
    }
}
