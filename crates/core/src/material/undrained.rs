//! Undrained response of a saturated material: the water in its pores cannot leave, and its stiffness adds to that of
//! any effective law.
//!
//! With incompressible grains, a change of volume is a change of the volume of the pores. Water of bulk modulus K_w in
//! pores of the fraction n of the volume then has the excess pressure
//!
//! p = p_0 − (K_w/n) ln(J/J_0),
//!
//! and the Kirchhoff stress is τ = τ′ − J p I with the stress τ′ of the law. The energy that the water stores per
//! initial volume, zero where p is zero, is W = (K_w/n) J (exp(q) − 1 − q) with q = p n/K_w: ∂W/∂(ln J) = −J p. Its
//! derivative gives the tangent, D^alg + J (K_w/n − p) I ⊗ ∂(ln J)/∂ε.
//!
//! The law sees the elastic strain of a point, not J. Because flow does not change F, ln J grows in a step by what the
//! elastic volume strain grows from the converged state to the trial state.

use super::{Material, MaterialError, Response, StateField, StrainMeasure};
use crate::tensor::{Sym3, dyad};

/// A law whose pores are full of water that cannot leave.
#[derive(Debug)]
pub struct Undrained {
    /// The law of the effective stress.
    law: Box<dyn Material>,
    /// K_w/n, [stress].
    stiffness: f64,
    /// The variables of the water, then those of the law.
    fields: Vec<StateField>,
}

/// The history variables of the water, before those of the law.
const WATER: [StateField; OF_WATER] = [
    StateField::new(EXCESS_PORE_PRESSURE, "stress", 0.0),
    StateField::new("volume_strain", "-", 0.0),
    StateField::new("elastic_volume_strain", "-", 0.0),
];
/// Number of history variables of the water.
const OF_WATER: usize = 3;
const PRESSURE: usize = 0;
const VOLUME: usize = 1;
const ELASTIC: usize = 2;

/// Name of the history variable of laws without drainage that holds the excess pore pressure, [stress].
pub const EXCESS_PORE_PRESSURE: &str = "excess_pore_pressure";

/// Magnitude of q below which exp(q) − 1 − q is summed as a series, to have all its digits, [-].
const SMALL: f64 = 1e-2;

impl Undrained {
    /// The law with water of the stiffness K_w/n, [stress], in its pores. The law must not be one that is evaluated in
    /// batches.
    pub fn new(law: Box<dyn Material>, stiffness: f64) -> Undrained {
        let fields = WATER.into_iter().chain(law.state_fields().iter().cloned()).collect();
        Undrained { law, stiffness, fields }
    }

    /// K_w/n for an undrained Poisson's ratio ν_u: the bulk modulus of the whole is then that of an elastic material with
    /// the same shear modulus and ν_u, [stress].
    pub fn stiffness_of_poisson(young: f64, poisson: f64, undrained_poisson: f64) -> f64 {
        let bulk = young / (3.0 * (1.0 - 2.0 * poisson));
        3.0 * bulk * (undrained_poisson - poisson) / ((1.0 - 2.0 * undrained_poisson) * (1.0 + poisson))
    }

    /// The same water with another law.
    fn with(&self, law: Box<dyn Material>) -> Box<dyn Material> {
        Box::new(Undrained { law, stiffness: self.stiffness, fields: self.fields.clone() })
    }
}

/// ln J of an elastic strain in a measure, and its derivative with respect to this strain; `None` if the strain leaves
/// no volume.
fn volume(measure: StrainMeasure, strain: &Sym3) -> Option<(f64, Sym3)> {
    match measure {
        StrainMeasure::Logarithmic => Some((strain.trace(), Sym3::IDENTITY)),
        StrainMeasure::LeftCauchyGreen => {
            let b = measure.left_cauchy_green(strain).to_matrix();
            let (determinant, inverse) = (b.determinant(), b.try_inverse()?);
            (determinant > 0.0).then(|| (0.5 * determinant.ln(), Sym3::symmetric_part(&inverse)))
        }
    }
}

/// exp(q) − 1 − q, [-].
fn exponential_beyond_linear(q: f64) -> f64 {
    if q.abs() > SMALL {
        return q.exp_m1() - q;
    }
    let (mut term, mut sum) = (0.5 * q * q, 0.0);
    for k in 3..10 {
        sum += term;
        term *= q / f64::from(k);
    }
    sum
}

impl Material for Undrained {
    fn state_fields(&self) -> &[StateField] {
        &self.fields
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.law.strain_measure()
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        let (old_water, old_own) = old.split_at(OF_WATER);
        let (new_water, new_own) = new.split_at_mut(OF_WATER);
        let measure = self.law.strain_measure();
        let of_law = self.law.update(trial, old_own, new_own)?;
        let (elastic_trial, slope) = volume(measure, trial).ok_or(MaterialError::NoResponse)?;
        let (elastic, _) = volume(measure, &of_law.elastic_strain).ok_or(MaterialError::NoResponse)?;
        let growth = elastic_trial - old_water[ELASTIC];
        let pressure = old_water[PRESSURE] - self.stiffness * growth;
        let volume_strain = old_water[VOLUME] + growth;
        let ratio = volume_strain.exp();
        (new_water[PRESSURE], new_water[VOLUME], new_water[ELASTIC]) = (pressure, volume_strain, elastic);
        let tau = of_law.tau - Sym3::IDENTITY * (ratio * pressure);
        if !tau.norm().is_finite() {
            return Err(MaterialError::ResponseNotFinite);
        }
        let tangent = of_law.tangent + dyad(&Sym3::IDENTITY, &slope) * (ratio * (self.stiffness - pressure));
        Ok(Response { tau, elastic_strain: of_law.elastic_strain, tangent })
    }

    fn initial_history(&self) -> Vec<f64> {
        [&[0.0; OF_WATER], self.law.initial_history().as_slice()].concat()
    }

    fn initial_history_at(&self, position: &[f64; 3]) -> Vec<f64> {
        [&[0.0; OF_WATER], self.law.initial_history_at(position).as_slice()].concat()
    }

    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        let (water, own) = history.split_at_mut(OF_WATER);
        self.law.start_from(elastic_strain, volume_ratio, own);
        water[VOLUME] = volume_ratio.ln();
        water[ELASTIC] =
            volume(self.law.strain_measure(), elastic_strain).map_or(0.0, |(ln_ratio, _)| ln_ratio);
    }

    fn keep_deformation(&self, [before, now]: [&Sym3; 2], history: &mut [f64]) {
        let (water, own) = history.split_at_mut(OF_WATER);
        self.law.keep_deformation([before, now], own);
        water[ELASTIC] = volume(self.law.strain_measure(), now).map_or(0.0, |(ln_ratio, _)| ln_ratio);
    }

    /// The strain of the effective stress.
    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        self.law.elastic_strain(tau, &history[OF_WATER..])
    }

    fn pore_stress(&self, history: &[f64]) -> f64 {
        history[VOLUME].exp() * history[PRESSURE]
    }

    fn excess_pore_pressure(&self, history: &[f64]) -> f64 {
        history[PRESSURE]
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        let (water, own) = history.split_at(OF_WATER);
        let stored = exponential_beyond_linear(water[PRESSURE] / self.stiffness);
        self.law.energy(elastic_strain, own) + self.stiffness * water[VOLUME].exp() * stored
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        self.law.plastic_work(&history[OF_WATER..])
    }

    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        self.law.has_yielded(&initial[OF_WATER..], &history[OF_WATER..])
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        self.law.with_strength_divided(factor).map(|law| self.with(law))
    }

    fn for_duration(&self, duration: f64) -> Option<Box<dyn Material>> {
        self.law.for_duration(duration).map(|law| self.with(law))
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.law.tangent_is_symmetric()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Friction, Hencky, MohrCoulomb, NeoHookean, Tresca, initial_state};

    const STIFFNESS: f64 = 4e8;

    fn laws() -> Vec<Box<dyn Material>> {
        let sand = Friction { cohesion: 1e3, friction_angle: 35.0, dilation_angle: 5.0 };
        vec![
            Box::new(Hencky::new(1e7, 0.3)),
            Box::new(NeoHookean::new(1e7, 0.3)),
            Box::new(Tresca::new(1e7, 0.3, 2e4)),
            Box::new(MohrCoulomb::new(2e7, 0.3, sand)),
        ]
    }

    const STRAINS: [Sym3; 3] = [
        Sym3([-2e-2, 9e-3, 6e-3, 1.4e-2, -1e-3, 2e-3]),
        Sym3([-7e-3, 5e-3, -1e-3, 8e-3, -1e-3, 2e-3]),
        Sym3([-1e-3, -3e-3, -2e-3, 6e-3, 0.0, 2e-3]),
    ];

    fn updated(law: &dyn Material, trial: &Sym3, old: &[f64]) -> (Response, Vec<f64>) {
        let mut new = old.to_vec();
        (law.update(trial, old, &mut new).unwrap(), new)
    }

    /// The second step begins in a state that may have yielded.
    #[test]
    fn the_tangent_is_the_derivative_of_the_stress() {
        for law in laws() {
            let undrained = Undrained::new(law, STIFFNESS);
            for first in &STRAINS {
                let (begun, old) = updated(&undrained, first, &undrained.initial_history());
                for trial in [*first, begun.elastic_strain + STRAINS[1] * 0.1] {
                    let old = if trial == *first { undrained.initial_history() } else { old.clone() };
                    let tangent = updated(&undrained, &trial, &old).0.tangent;
                    for k in 0..6 {
                        let mut step = [0.0; 6];
                        step[k] = 1e-7;
                        let [after, before] = [1.0, -1.0]
                            .map(|sign| updated(&undrained, &(trial + Sym3(step) * sign), &old).0.tau);
                        let difference = (after - before) * 0.5e7;
                        let predicted = Sym3((tangent * nalgebra::SVector::from(step) * 1e7).into());
                        assert!(
                            (difference - predicted).norm() < 1e-6 * STIFFNESS,
                            "{undrained:?} {k}: {difference:?} {predicted:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_water_adds_its_pressure_and_no_shear() {
        for law in laws() {
            let alone: Vec<_> =
                STRAINS.iter().map(|trial| updated(law.as_ref(), trial, &law.initial_history())).collect();
            let undrained = Undrained::new(law, STIFFNESS);
            for (trial, (of_law, own)) in STRAINS.iter().zip(&alone) {
                let (response, new) = updated(&undrained, trial, &undrained.initial_history());
                let (growth, _) = volume(undrained.strain_measure(), trial).unwrap();
                let pressure = -STIFFNESS * growth;
                let expected = of_law.tau - Sym3::IDENTITY * (growth.exp() * pressure);
                assert!((response.tau - expected).norm() < 1e-12 * expected.norm());
                assert_eq!(response.elastic_strain, of_law.elastic_strain);
                assert_eq!(new[OF_WATER..], own[..]);
                assert!((new[PRESSURE] - pressure).abs() <= 1e-12 * pressure.abs());
                let effective = response.tau + Sym3::IDENTITY * undrained.pore_stress(&new);
                assert!((effective - of_law.tau).norm() < 1e-12 * response.tau.norm());
            }
        }
    }

    /// The volume strain of the water follows F, whatever the flow does: two steps end at the pressure of one.
    #[test]
    fn the_pressure_follows_the_volume() {
        for law in laws() {
            let undrained = Undrained::new(law, STIFFNESS);
            let measure = undrained.strain_measure();
            let (begun, old) = updated(&undrained, &STRAINS[0], &undrained.initial_history());
            let squeezed = measure.left_cauchy_green(&begun.elastic_strain) * (-4e-3f64).exp();
            let trial = match measure {
                StrainMeasure::Logarithmic => squeezed.map_eigenvalues(f64::ln) * 0.5,
                StrainMeasure::LeftCauchyGreen => (squeezed - Sym3::IDENTITY) * 0.5,
            };
            let (_, new) = updated(&undrained, &trial, &old);
            let expected = old[PRESSURE] + STIFFNESS * 6e-3;
            assert!((new[PRESSURE] - expected).abs() < 1e-8 * expected, "{} {expected}", new[PRESSURE]);
        }
    }

    /// ∂W/∂ln J = −J p, and the energy is zero without pressure.
    #[test]
    fn the_energy_of_the_water_is_its_potential() {
        let undrained = Undrained::new(Box::new(Hencky::new(1e7, 0.3)), STIFFNESS);
        let at = |strain: f64| {
            let trial = Sym3::IDENTITY * (strain / 3.0);
            let (response, new) = updated(&undrained, &trial, &undrained.initial_history());
            (undrained.energy(&response.elastic_strain, &new), response.tau.trace() / 3.0)
        };
        assert_eq!(at(0.0).0, 0.0);
        for strain in [-0.2, -5e-3, 1e-4, 0.1] {
            let difference = (at(strain + 1e-6).0 - at(strain - 1e-6).0) / 2e-6;
            let stress = at(strain).1;
            assert!((difference - stress).abs() < 1e-6 * stress.abs(), "{difference} {stress}");
        }
        let (below, above) =
            (exponential_beyond_linear(0.999 * SMALL), exponential_beyond_linear(1.001 * SMALL));
        assert!((above / below - (1.001f64 / 0.999).powi(2)).abs() < 1e-4);
    }

    #[test]
    fn an_initial_stress_is_effective_and_without_excess() {
        let clay = crate::material::tests::cam_clays().remove(0);
        let stress = Sym3([-6e4, -1e5, -6e4, 0.0, 0.0, 0.0]);
        let expected = initial_state(&clay, &stress, 1.0, &clay.initial_history()).unwrap();
        let undrained = Undrained::new(Box::new(clay), STIFFNESS);
        let begun = initial_state(&undrained, &stress, 1.0, &undrained.initial_history()).unwrap();
        assert_eq!(begun.elastic_strain, expected.elastic_strain);
        assert!((begun.tau - expected.tau).norm() < 1e-12 * stress.norm());
        assert_eq!(begun.history[PRESSURE], 0.0);
        assert_eq!(begun.history[OF_WATER..], expected.history[..]);
    }

    #[test]
    fn an_undrained_poissons_ratio_gives_its_bulk_modulus() {
        let (young, poisson, undrained) = (1e7, 0.3, 0.495);
        let water = Undrained::stiffness_of_poisson(young, poisson, undrained);
        let shear = young / (2.0 * (1.0 + poisson));
        let whole = 2.0 * shear * (1.0 + undrained) / (3.0 * (1.0 - 2.0 * undrained));
        assert!((water + young / (3.0 * (1.0 - 2.0 * poisson)) - whole).abs() < 1e-9 * whole);
        assert!((water / (young / (3.0 * (1.0 - 2.0 * poisson))) - 45.0).abs() < 1e-9);
    }
}
