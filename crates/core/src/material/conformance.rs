//! Test of the properties of a law on which the solver relies.

use super::{BatchLaw, IsotropicModuli, Material, Response, StrainMeasure, VectorisedLaw, respond_to_batch};
use crate::tensor::{Lane, Lanes, Mat3, Sym3, exp_derivative};

/// A property of a law.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Property {
    /// The law responds to strains, including zero strain.
    Response,
    /// Equal arguments give equal results.
    Purity,
    /// D^alg agrees with finite differences of τ with respect to the trial strain.
    Tangent,
    /// The tangent is symmetric, if the law states that it is.
    Symmetry,
    /// A rotated strain gives the rotated stress.
    Isotropy,
    /// A second update from the returned elastic strain gives the same stress.
    Admissibility,
    /// [`Material::elastic_strain`] returns a strain that gives the stress.
    Inverse,
    /// The energy is the potential of the stress in the elastic range.
    Potential,
    /// [`IsotropicModuli`] agree with the response.
    IsotropicModuli,
    /// [`VectorisedLaw`] agrees with the response.
    Vectorised,
    /// [`BatchLaw`] gives a point the same response in every batch.
    Batch,
    /// A strain that is not finite is an error.
    NotFinite,
}

/// A property that a law lacks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{property:?} at the logarithmic strain {:?}: relative error {error:.1e}, tolerated {tolerance:.1e}", strain.0)]
pub struct Nonconformity {
    /// The property that the law lacks.
    pub property: Property,
    /// Logarithmic trial strain where the error is largest, [-].
    pub strain: Sym3,
    /// Relative error, [-]; infinite if nothing can be compared.
    pub error: f64,
    /// The largest permissible error, [-].
    pub tolerance: f64,
}

/// Smaller errors are permissible: laws that iterate need not reach round-off.
const TOLERATED: f64 = 1e-10;

/// The properties that a law lacks, each at the strain where its error is largest, for a fixed set of pseudo-random
/// strains, in space and in the plane, with initial history. The magnitude of the components is at most `largest`, [-],
/// in one third of the strains, and at most `largest`/10 and `largest`/100 in the other two thirds.
pub fn check(law: &dyn Material, largest: f64) -> Vec<Nonconformity> {
    let mut worst: Vec<Nonconformity> = Vec::new();
    for strain in strains(largest) {
        for found in check_at(law, &strain) {
            match worst.iter_mut().find(|other| other.property == found.property) {
                None => worst.push(found),
                Some(other) if found.error > other.error => *other = found,
                Some(_) => {}
            }
        }
    }
    worst
}

/// The properties that a law lacks at a logarithmic trial strain, with initial history.
pub fn check_at(law: &dyn Material, logarithmic: &Sym3) -> Vec<Nonconformity> {
    let deviations = deviations(law, logarithmic).into_iter();
    deviations
        .filter_map(|Deviation { property, error, round_off }| {
            lacking(property, logarithmic, error, round_off.max(TOLERATED))
        })
        .collect()
}

/// The nonconformity, unless the error is permissible; a NaN error is not permissible.
fn lacking(property: Property, strain: &Sym3, error: f64, tolerance: f64) -> Option<Nonconformity> {
    let error = if error.is_nan() { f64::INFINITY } else { error };
    (error > tolerance).then_some(Nonconformity { property, strain: *strain, error, tolerance })
}

/// The error of a law in one property.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deviation {
    pub(super) property: Property,
    /// Relative error, [-].
    pub(super) error: f64,
    /// The largest error that round-off, or finite differences in place of a derivative, can cause, [-].
    pub(super) round_off: f64,
}

impl Deviation {
    fn new(property: Property, error: f64, round_off: f64) -> Self {
        Deviation { property, error, round_off }
    }

    /// The deviation of results that must be equal.
    fn unless(holds: bool, property: Property) -> Self {
        Deviation::new(property, if holds { 0.0 } else { f64::INFINITY }, 0.0)
    }
}

/// The errors of a law at a logarithmic trial strain, with initial history.
pub(super) fn deviations(law: &dyn Material, logarithmic: &Sym3) -> Vec<Deviation> {
    let not_finite = Sym3([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let refuses =
        Deviation::unless(update(law, &not_finite, &law.initial_history()).is_none(), Property::NotFinite);
    let Some(at) = At::new(law, logarithmic) else {
        return vec![Deviation::unless(false, Property::Response), refuses];
    };
    let mut found =
        vec![refuses, at.purity(), at.tangent(), at.isotropy(), at.admissibility(), at.potential()];
    found.extend(at.symmetry());
    found.extend(at.inverse());
    if let Some(moduli) = law.isotropic_moduli() {
        found.extend(at.isotropic_moduli(moduli));
    }
    if let Some(vectorised) = law.vectorised().filter(|_| at.trial.is_plane()) {
        found.extend(at.vectorised(vectorised));
    }
    found.extend(law.batch().map(|batch| at.batch(batch)));
    found
}

/// A fixed set of strains in space and in the plane, whose components have a magnitude of at most `largest`, [-].
fn strains(largest: f64) -> impl Iterator<Item = Sym3> {
    let mut state = 0u64;
    // Splitmix64.
    let mut random = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..72).map(move |number| {
        let size = largest * [1.0, 0.1, 0.01][number % 3];
        let [xx, yy, zz, yz, xz, xy] = std::array::from_fn(|_| size * random());
        if number % 2 == 0 { Sym3([xx, yy, zz, yz, xz, xy]) } else { Sym3([xx, yy, zz, 0.0, 0.0, xy]) }
    })
}

/// Converts a logarithmic strain to the measure of a law.
fn in_measure(law: &dyn Material, logarithmic: &Sym3) -> Sym3 {
    match law.strain_measure() {
        StrainMeasure::Logarithmic => *logarithmic,
        StrainMeasure::LeftCauchyGreen => {
            (logarithmic.map_eigenvalues(|e| (2.0 * e).exp()) - Sym3::IDENTITY) * 0.5
        }
    }
}

/// Response and trial history.
fn update(law: &dyn Material, trial: &Sym3, old: &[f64]) -> Option<(Response, Vec<f64>)> {
    let mut new = old.to_vec();
    law.update(trial, old, &mut new).ok().map(|response| (response, new))
}

/// Stress; infinite if the law refuses the strain.
fn stress(law: &dyn Material, trial: &Sym3, old: &[f64]) -> Sym3 {
    update(law, trial, old).map_or(Sym3([f64::INFINITY; 6]), |(response, _)| response.tau)
}

/// A law at a strain.
struct At<'a> {
    law: &'a dyn Material,
    logarithmic: Sym3,
    /// The strain in the measure of the law.
    trial: Sym3,
    old: Vec<f64>,
    new: Vec<f64>,
    response: Response,
    /// Norm of the tangent, [stress].
    scale: f64,
    /// Norm of the tangent at zero strain, [stress].
    at_rest: f64,
}

impl<'a> At<'a> {
    fn new(law: &'a dyn Material, logarithmic: &Sym3) -> Option<Self> {
        let old = law.initial_history();
        let trial = in_measure(law, logarithmic);
        let (response, new) = update(law, &trial, &old)?;
        let at_rest = update(law, &Sym3::ZERO, &old)?.0.tangent.norm();
        // A law may have no stiffness in some states, such as at the apex of a cone.
        let scale = Some(response.tangent.norm()).filter(|norm| *norm > 0.0).unwrap_or(at_rest);
        Some(At { law, logarithmic: *logarithmic, trial, old, new, response, scale, at_rest })
    }

    /// Approximate stress of an elastic point at this strain, [stress]; the stress itself if that is larger, since some
    /// laws have a stress at zero strain.
    fn elastic_stress(&self) -> f64 {
        let elastic = self.scale * self.logarithmic.norm();
        elastic.max(self.response.tau.norm()).max(f64::MIN_POSITIVE)
    }

    fn purity(&self) -> Deviation {
        let again = update(self.law, &self.trial, &self.old);
        let is_same = again.is_some_and(|(response, new)| response == self.response && new == self.new);
        Deviation::unless(is_same, Property::Purity)
    }

    fn tangent(&self) -> Deviation {
        // The step is a small part of the strain: if a law yields at small strains, its tangent changes over strains
        // of that size.
        let h = (1e-4 * self.logarithmic.norm()).clamp(1e-9, 1e-7);
        let error_of_column = |c: usize| {
            let (mut p, mut m) = (self.trial, self.trial);
            p.0[c] += h;
            m.0[c] -= h;
            let [p, m] = [p, m].map(|trial| stress(self.law, &trial, &self.old));
            let column = Sym3(std::array::from_fn(|r| self.response.tangent[(r, c)]));
            // If the tangent jumps within the interval of the finite difference, it equals the slope on one side.
            let tau = self.response.tau;
            let slopes = [(p - m) * (0.5 / h), (p - tau) * (1.0 / h), (tau - m) * (1.0 / h)];
            slopes.map(|slope| (slope - column).norm()).into_iter().fold(f64::INFINITY, f64::min)
        };
        let error = (0..6).map(error_of_column).map(|error| error * error).sum::<f64>().sqrt();
        Deviation::new(Property::Tangent, error / self.scale, 1e-6)
    }

    fn symmetry(&self) -> Option<Deviation> {
        if !self.law.tangent_is_symmetric() {
            return None;
        }
        let tangent = self.response.tangent;
        let (tangent, round_off) = match self.law.strain_measure() {
            StrainMeasure::Logarithmic => (tangent, 1e-15),
            StrainMeasure::LeftCauchyGreen => (tangent * exp_derivative(&(self.logarithmic * 2.0)), 1e-14),
        };
        let norm = tangent.norm().max(f64::MIN_POSITIVE);
        Some(Deviation::new(Property::Symmetry, (tangent - tangent.transpose()).norm() / norm, round_off))
    }

    fn isotropy(&self) -> Deviation {
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, -0.9, 1.3);
        let turned =
            |t: &Sym3| Sym3::symmetric_part(&(turn.matrix() * t.to_matrix() * turn.matrix().transpose()));
        let difference = stress(self.law, &turned(&self.trial), &self.old) - turned(&self.response.tau);
        Deviation::new(Property::Isotropy, difference.norm() / self.elastic_stress(), 1e-12)
    }

    /// An update from the returned elastic strain must cause no further flow.
    fn admissibility(&self) -> Deviation {
        let settled = stress(self.law, &self.response.elastic_strain, &self.new);
        let norm = self.response.tau.norm().max(f64::MIN_POSITIVE);
        Deviation::new(Property::Admissibility, (settled - self.response.tau).norm() / norm, 1e-12)
    }

    /// Checks the inverse of the elastic law, if there is one; far from zero strain, another strain may have the same
    /// stress.
    fn inverse(&self) -> Option<Deviation> {
        let strain = self.law.elastic_strain(&self.response.tau, &self.new).ok()?;
        if self.logarithmic.norm() < 0.02 {
            let expected = self.response.elastic_strain;
            let error = (strain - expected).norm() / (expected.norm() + 1e-3);
            return Some(Deviation::new(Property::Inverse, error, 1e-14));
        }
        let again = stress(self.law, &strain, &self.new);
        let error = (again - self.response.tau).norm() / self.at_rest;
        Some(Deviation::new(Property::Inverse, error, 1e-13))
    }

    /// In the elastic range, the energy is the potential of the stress.
    fn potential(&self) -> Deviation {
        let At { law, logarithmic, response, new, .. } = self;
        let elastic = law.strain_measure().logarithmic(&response.elastic_strain) * 0.5;
        let direction = *logarithmic * (1.0 / logarithmic.norm().max(f64::MIN_POSITIVE));
        let energy = |by: f64| law.energy(&in_measure(*law, &(elastic + direction * by)), new);
        let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
        let work = stress(*law, &in_measure(*law, &elastic), new).dot(&direction);
        Deviation::new(Property::Potential, (slope - work).abs() / self.elastic_stress(), 1e-7)
    }

    fn isotropic_moduli(&self, moduli: &dyn IsotropicModuli) -> Vec<Deviation> {
        let property = Property::IsotropicModuli;
        let b = self.law.strain_measure().left_cauchy_green(&self.trial);
        let Ok(spatial) = moduli.respond(&b) else { return vec![Deviation::unless(false, property)] };
        let At { response, scale, .. } = self;
        // Rates at a velocity gradient l: ḃ = l b + b lᵀ, and the Oldroyd rate τ̇ − l τ − τ lᵀ of τ.
        let l = Mat3::from_fn(|i, j| ((3 * i + 2 * j) as f64).sin());
        let sheared = |t: &Sym3| Sym3::symmetric_part(&(l * t.to_matrix())) * 2.0;
        let rate = (sheared(&b) * 0.5).contract(&response.tangent) - sheared(&response.tau);
        let d = Sym3::symmetric_part(&l);
        let by_moduli = Sym3::IDENTITY * (spatial.lambda * d.trace()) + d * (2.0 * spatial.mu);
        vec![
            Deviation::new(property, (spatial.tau - response.tau).norm() / scale, 1e-14),
            Deviation::new(property, (spatial.elastic_strain - response.elastic_strain).norm(), 1e-15),
            Deviation::new(property, (by_moduli - rate).norm() / scale, 1e-13),
        ]
    }

    /// The vectorised form, evaluated with other strains in the other lanes, agrees with the response in the plane.
    fn vectorised(&self, law: &dyn VectorisedLaw) -> Vec<Deviation> {
        const PLANE: [usize; 4] = [0, 1, 2, 5];
        let At { response: alone, trial, old, new, .. } = self;
        let trial = PLANE.map(|c| Lanes([0.0, 1e-3, trial.0[c], f64::NAN]));
        let mut history: Vec<Lanes> = old.iter().map(|h| Lanes::splat(*h)).collect();
        let short = law.respond(&trial, &mut history);
        let has_bits = |lanes: &[Lanes; 4], expected: &Sym3| {
            lanes.iter().zip(PLANE).all(|(x, c)| x.0[2].to_bits() == expected.0[c].to_bits())
        };
        let is_same = has_bits(&short.tau, &alone.tau)
            && has_bits(&short.elastic_strain, &alone.elastic_strain)
            && history.iter().map(|h| h.0[2]).eq(new.iter().copied());
        let passes_nan_on = short.tau.iter().any(|x| x.0[3].is_nan());
        let [lambda, mu, along] = [short.lambda, short.mu, short.along].map(|x| x.0[2]);
        let mut largest = 0.0f64;
        for (a, c) in PLANE.into_iter().enumerate() {
            for (b, d) in PLANE.into_iter().enumerate() {
                let normal = if a < 3 && b < 3 { lambda } else { 0.0 };
                let diagonal = if a == b { 2.0 * mu } else { 0.0 };
                let entry = normal + diagonal - along * short.n[a].0[2] * short.n[b].0[2];
                largest = largest.max((entry - alone.tangent[(c, d)]).abs());
            }
        }
        vec![
            Deviation::unless(is_same && passes_nan_on, Property::Vectorised),
            Deviation::new(Property::Vectorised, largest / self.scale, 1e-15),
        ]
    }

    /// The second of three points in a batch responds like a single point.
    fn batch(&self, law: &dyn BatchLaw) -> Deviation {
        let trial = [Sym3::ZERO, self.trial, self.trial * 0.5];
        let (mut new, mut responses) = (Vec::new(), Vec::new());
        if respond_to_batch(law, &trial, &self.old.repeat(3), &mut new, &mut responses).is_err() {
            return Deviation::unless(false, Property::Batch);
        }
        let (alone, beside, kept) = (&self.response, &responses[1], self.new.len());
        let history = new[kept..].iter().zip(&self.new).map(|(a, b)| (a - b).abs() / (1.0 + b.abs()));
        let stress_error = (beside.tau - alone.tau).norm() / self.elastic_stress();
        let strain_error = (beside.elastic_strain - alone.elastic_strain).norm();
        let tangent_error = (beside.tangent - alone.tangent).norm() / self.scale;
        let error = history.chain([strain_error, tangent_error]).fold(stress_error, f64::max);
        Deviation::new(Property::Batch, error, 1e-14)
    }
}
