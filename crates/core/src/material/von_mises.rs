//! Von Mises plasticity.

use super::strength::{EQUIVALENT, ON_SURFACE};
use super::{CompactResponse, Elasticity, Material, MaterialError, Response, StateField, VectorisedLaw};
use crate::tensor::{Lane, Lanes, Sym3, Tangent, dyad};

/// Von Mises plasticity with linear isotropic hardening: f = ρ − (ρ_y + H κ) with ρ = √(2 J₂) of the Kirchhoff stress,
/// eq. (43), and the equivalent plastic strain κ.
#[derive(Debug, Clone)]
pub struct VonMises {
    elasticity: Elasticity,
    /// Initial deviatoric yield stress ρ_y, [stress].
    yield_radius: f64,
    /// Hardening modulus H, [stress].
    hardening: f64,
    elastic_tangent: Tangent,
}

impl VonMises {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the deviatoric yield stress ρ_y,
    /// [stress].
    pub fn new(young: f64, poisson: f64, deviatoric_yield_stress: f64) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        VonMises {
            elasticity,
            yield_radius: deviatoric_yield_stress,
            hardening: 0.0,
            elastic_tangent: elasticity.tangent(),
        }
    }

    /// Adds linear hardening: the deviatoric yield stress grows by `modulus`, [stress], per unit of equivalent plastic
    /// strain.
    pub fn hardening(self, modulus: f64) -> Self {
        VonMises { hardening: modulus, ..self }
    }
}

/// Result of the return mapping.
struct Returned<T, const N: usize> {
    response: CompactResponse<T, N>,
    /// |s|, norm of the trial deviator, [stress].
    s_norm: T,
    /// Norm of the plastic strain increment |Δε^p|, [-].
    flow: T,
}

impl VonMises {
    /// Radial return. The trial deviator s = 2 G dev(ε) is scaled back along n = s/|s| by the flow |Δε^p|, which
    /// satisfies |s| − 2 G |Δε^p| = ρ_y + H κ =: ρ. With h = √(2/3) H, the increase of ρ per unit of |Δε^p|, D^alg =
    /// K I⊗I + 2 G (ρ/|s|) (𝟙_dev − n⊗n) + (2 G h/(2 G + h)) n⊗n. `kappa` is replaced by its new value.
    #[inline(always)]
    fn radial_return<T: Lane, const N: usize>(&self, trial: &[T; N], kappa: &mut T) -> Returned<T, N> {
        let Elasticity { bulk, shear } = self.elasticity;
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let trace = trial[0] + trial[1] + trial[2];
        let mut s = *trial;
        for normal in &mut s[..3] {
            *normal = *normal - trace * (1.0 / 3.0);
        }
        let mut square = zero;
        for x in &mut s {
            *x = *x * (2.0 * shear);
            square += *x * *x;
        }
        let s_norm = square.sqrt();
        let reached = *kappa * self.hardening + T::splat(self.yield_radius);
        let limit = reached * (1.0 + ON_SURFACE);
        let where_elastic = |yes: T, no: T| s_norm.where_below(limit, yes, no);

        let growth = EQUIVALENT * self.hardening;
        let flow = where_elastic(zero, (s_norm - reached) / T::splat(2.0 * shear + growth)); // |Δε^p|
        let per_norm = where_elastic(zero, one / s_norm);
        let ratio = where_elastic(one, (reached + flow * growth) * per_norm); // ρ/|s|
        let n = s.map(|x| x * per_norm);
        let mut tau = s.map(|x| x * ratio);
        for normal in &mut tau[..3] {
            *normal += trace * bulk;
        }
        let mut elastic_strain = *trial;
        for (e, n) in elastic_strain.iter_mut().zip(&n) {
            *e = *e - *n * flow;
        }
        *kappa += flow * EQUIVALENT;
        let mu = ratio * shear;
        let kept = T::splat(2.0 * shear * growth / (2.0 * shear + growth));
        let response = CompactResponse {
            tau,
            elastic_strain,
            lambda: T::splat(bulk) - mu * (2.0 / 3.0),
            mu,
            along: where_elastic(zero, mu * 2.0 - kept),
            n,
        };
        Returned { response, s_norm, flow }
    }
}

impl Material for VonMises {
    fn state_fields(&self) -> &[StateField] {
        const { &[StateField::new("equivalent_plastic_strain", "-", 0.0)] }
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        new.copy_from_slice(old);
        let Returned { response, s_norm, flow } = self.radial_return(&trial.0, &mut new[0]);
        if !(s_norm + trial.trace()).is_finite() {
            return Err(MaterialError::NotFinite);
        }
        let n = Sym3(response.n);
        let tangent = if flow > 0.0 {
            let Elasticity { bulk, .. } = self.elasticity;
            Elasticity { bulk, shear: response.mu }.tangent() - dyad(&n, &n) * response.along
        } else {
            self.elastic_tangent
        };
        Ok(Response { tau: Sym3(response.tau), elastic_strain: Sym3(response.elastic_strain), tangent })
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        self.elasticity.strain(tau)
    }

    fn vectorised(&self) -> Option<&dyn VectorisedLaw> {
        Some(self)
    }

    fn linear_elasticity(&self, _: &[f64]) -> Option<Elasticity> {
        Some(self.elasticity)
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        self.elasticity.energy(elastic_strain)
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        let reduced = VonMises {
            yield_radius: self.yield_radius / factor,
            hardening: self.hardening / factor,
            ..self.clone()
        };
        Some(Box::new(reduced))
    }

    /// ∫ ρ |dε^p| with ρ = ρ_y + H κ and |dε^p| = dκ/√(2/3).
    fn plastic_work(&self, history: &[f64]) -> f64 {
        let kappa = history[0];
        (self.yield_radius + 0.5 * self.hardening * kappa) * kappa / EQUIVALENT
    }
}

impl VectorisedLaw for VonMises {
    fn respond(&self, trial: &[Lanes; 4], history: &mut [Lanes]) -> CompactResponse<Lanes, 4> {
        self.radial_return(trial, &mut history[0]).response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Path with yielding, unloading and reversed yielding, in steps small enough for the trapezoidal rule.
    #[test]
    fn plastic_work_is_that_of_the_stress_on_the_plastic_strain() {
        let law = VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6);
        let way = |t: f64| {
            let shear = if t < 0.6 { t } else { 1.2 - t };
            Sym3([0.02 * t, -0.03 * t * t, 0.01 * t, 0.1 * shear, 0.0, 0.02 * t])
        };
        let (mut elastic, mut stress, mut history) = (Sym3::ZERO, Sym3::ZERO, [0.0]);
        let (mut work, n) = (0.0, 20_000);
        for k in 0..n {
            let [from, to] = [k, k + 1].map(|k| way(2.0 * f64::from(k) / f64::from(n)));
            let trial = elastic + (to - from);
            let mut new = [0.0];
            let response = law.update(&trial, &history, &mut new).unwrap();
            work += 0.5 * (stress + response.tau).dot(&(trial - response.elastic_strain));
            (elastic, stress, history) = (response.elastic_strain, response.tau, new);
        }
        assert!(history[0] > 0.05 && work > 1e3, "{history:?} {work}");
        assert!((law.plastic_work(&history) / work - 1.0).abs() < 1e-4, "{work}");
        assert_eq!(law.plastic_work(&[0.0]), 0.0);
    }
}
