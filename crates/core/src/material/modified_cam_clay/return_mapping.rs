//! The response of modified Cam-clay to principal trial strains, at one point or at several points at once.
//!
//! If the trial stress lies outside the ellipse, Newton's method finds the elastic strain invariants ε_v^e, ε_s^e and
//! the multiplier Γ = Δγ P_cn that satisfy
//! ε_v^e − ε_v^tr = Γ (2P − P_c)/P_cn, ε_s^e − ε_s^tr = −2Γ q/(M² P_cn) and f = 0,
//! Borja and Tamagnini (1998). The direction of the deviator is that of the trial strain.

use super::super::strength::{EQUIVALENT, ON_SURFACE};
use super::super::{MaterialError, PrincipalResponse};
use super::{CamClay, EQUIVALENT_STRAIN, PRECONSOLIDATION, VOLUMETRIC_STRAIN, WORK};
use crate::tensor::{Lane, exp, ln};

/// Largest number of Newton iterations.
const MAX_ITERATIONS: usize = 50;
/// Tolerance of the equations, [-].
const TOLERANCE: f64 = 1e-13;
/// Norm of the residual below which one more iteration reaches round-off, [-].
const NEARLY: f64 = 1e-9;
/// Largest number of halvings of a step in the line search.
const MAX_TRIALS: usize = 30;

/// The elastic stress at given invariants of the strain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Elastic<T = f64> {
    /// P, [stress].
    pub pressure: T,
    /// q, [stress].
    pub shear: T,
    /// μ, [stress].
    pub modulus: T,
    /// −∂P/∂ε_v, [stress].
    bulk: T,
    /// ∂q/∂ε_v = −∂P/∂ε_s, [stress].
    coupling: T,
}

/// The equations of the return mapping at a trial solution.
struct Equations<T> {
    /// Residuals of the volumetric strain, of the shear strain, and of the scaled yield function, [-].
    residual: [T; 3],
    /// Their derivatives with respect to ε_v^e, ε_s^e and Γ.
    jacobian: [[T; 3]; 3],
    elastic: Elastic<T>,
    /// P_c, [stress].
    size: T,
}

/// Invariants of the trial strain, and the history.
struct Start<T> {
    volumetric: T,
    shear: T,
    /// P_c of the converged state, [stress].
    size: T,
    /// Initial guess of ε_v^e.
    first: T,
    /// 1/P_c at this guess, [1/stress]; its square scales the yield function.
    per_size: T,
    /// Largest norm of the residual at which a solution is accepted, [-]; infinite for a point that does not flow.
    tolerance: T,
}

/// The state after the return mapping; for a point that does not flow, the state at the trial strain.
struct Returned<T> {
    elastic: Elastic<T>,
    /// P_c, [stress].
    size: T,
    /// ε_v^e and ε_s^e.
    strain: [T; 2],
    /// ε_s^e/ε_s^tr.
    kept: T,
    /// Derivatives of P with respect to ε_v^tr and ε_s^tr, [stress].
    pressure_rates: [T; 2],
    /// Derivatives of q with respect to ε_v^tr and ε_s^tr, [stress].
    shear_rates: [T; 2],
}

impl<T: Lane> Elastic<T> {
    /// The derivative of (P, q) in the direction of a change of ε_v and ε_s, [stress].
    #[inline(always)]
    fn rates(&self, volumetric: T, shear: T) -> [T; 2] {
        let Elastic { modulus, bulk, coupling, .. } = *self;
        let pressure = (bulk * volumetric + coupling * shear) * -1.0;
        [pressure, coupling * volumetric + modulus * shear * 3.0]
    }

    /// True if the elastic stiffness is positive definite at all points. If μ grows with the pressure, this can fail
    /// beyond some ε_s, where the stress falls without flow.
    #[inline(always)]
    fn is_stable(&self) -> bool {
        (self.coupling * self.coupling - self.bulk * self.modulus * 3.0).is_below(0.0)
    }
}

impl<T: Lane> Equations<T> {
    #[inline(always)]
    fn norm(&self) -> T {
        let [volumetric, shear, surface] = self.residual;
        (volumetric * volumetric + shear * shear + surface * surface).sqrt()
    }
}

impl CamClay {
    #[inline(always)]
    pub(super) fn elastic<T: Lane>(&self, volumetric: T, shear: T) -> Elastic<T> {
        let CamClay { swelling_index, shear_modulus, shear_modulus_ratio, reference_pressure, .. } = *self;
        let per = 1.0 / swelling_index;
        let confined = exp(volumetric * -per) * reference_pressure;
        let growth = confined * shear_modulus_ratio;
        let modulus = growth + T::splat(shear_modulus);
        let pressure = confined + growth * shear * shear * (1.5 * per);
        Elastic {
            pressure,
            shear: modulus * shear * 3.0,
            modulus,
            bulk: pressure * per,
            coupling: growth * shear * (-3.0 * per),
        }
    }

    /// f, [stress²].
    #[inline(always)]
    fn yields<T: Lane>(&self, elastic: &Elastic<T>, size: T) -> T {
        let ratio = elastic.shear * (1.0 / self.critical_state_ratio);
        ratio * ratio + elastic.pressure * (elastic.pressure - size)
    }

    /// P_c after a change of the elastic ε_v at constant total ε_v.
    #[inline(always)]
    fn size<T: Lane>(&self, size: T, change: T) -> T {
        size * exp(change * self.hardening())
    }

    /// 1/(λ̂ − κ̂): the increase of ln P_c per unit of plastic compression −ε_v^p.
    fn hardening(&self) -> f64 {
        1.0 / (self.compression_index - self.swelling_index)
    }

    #[inline(always)]
    fn equations<T: Lane>(&self, start: &Start<T>, x: &[T; 3]) -> Equations<T> {
        let [volumetric, shear, gamma] = *x;
        let (one, zero) = (T::splat(1.0), T::splat(0.0));
        let per_square = 1.0 / (self.critical_state_ratio * self.critical_state_ratio);
        let elastic = self.elastic(volumetric, shear);
        let size = self.size(start.size, volumetric - start.volumetric);
        let Elastic { pressure, shear: q, .. } = elastic;
        let per = one / start.size;
        let normal = (pressure * 2.0 - size) * per;
        let size_rate = size * self.hardening();
        let ([p_v, q_v], [p_s, q_s]) = (elastic.rates(one, zero), elastic.rates(zero, one));
        let (slope, flow) = (per * (2.0 * per_square), gamma * per);
        let area = start.per_size * start.per_size;
        let residual = [
            volumetric - start.volumetric - gamma * normal,
            shear - start.shear + gamma * slope * q,
            self.yields(&elastic, size) * area,
        ];
        let (by_pressure, by_shear_stress) = (pressure * 2.0 - size, q * (2.0 * per_square));
        let jacobian = [
            [one - flow * (p_v * 2.0 - size_rate), flow * p_s * -2.0, normal * -1.0],
            [gamma * slope * q_v, one + gamma * slope * q_s, slope * q],
            [
                (by_shear_stress * q_v + by_pressure * p_v - pressure * size_rate) * area,
                (by_shear_stress * q_s + by_pressure * p_s) * area,
                zero,
            ],
        ];
        Equations { residual, jacobian, elastic, size }
    }

    /// Solves the equations at every point to round-off by Newton's method with a line search; `None` if this fails at
    /// any point.
    #[inline(always)]
    fn solve<T: Lane>(&self, start: &Start<T>) -> Option<([T; 3], Equations<T>)> {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let mut x = [start.first, start.shear, zero];
        let mut now = self.equations(start, &x);
        let mut norm = now.norm();
        // 1 for each point that needs a further iteration.
        let mut open = start.tolerance.where_below(T::splat(f64::INFINITY), one, zero);
        for _ in 0..MAX_ITERATIONS {
            if open.is_below(0.5) {
                break;
            }
            let step = times(&inverse(&now.jacobian), &now.residual);
            let is_last = norm.where_below(T::splat(NEARLY), one, zero);
            let mut share = one;
            let mut trials = 0;
            (x, now, norm) = loop {
                let mut next = x;
                for (next, step) in next.iter_mut().zip(&step) {
                    *next = zero.where_below(open, *next - *step * share, *next);
                }
                let equations = self.equations(start, &next);
                let reached = equations.norm();
                let worse = zero.where_below(open, reached.where_below(norm, zero, one), zero);
                if worse.is_below(0.5) {
                    break (next, equations, reached);
                }
                if trials == MAX_TRIALS {
                    return None;
                }
                trials += 1;
                // Only round-off can prevent a decrease in the last iteration.
                open = zero.where_below(worse, one - is_last, open);
                share = zero.where_below(worse, share * 0.5, share);
            };
            open = zero.where_below(is_last, zero, open);
        }
        let is_solution = (norm - start.tolerance).is_below(0.0) && (x[2] * -1.0).is_below(f64::MIN_POSITIVE);
        is_solution.then_some((x, now))
    }

    /// Initial guess of the elastic volumetric strain: the value in the trial state or, if P₀ e^ω exceeds P_c in that
    /// state, the value for isotropic compression along the virgin line.
    #[inline(always)]
    fn first<T: Lane>(&self, volumetric: T, size: T) -> T {
        let CamClay { compression_index, swelling_index, reference_pressure, .. } = *self;
        let at_size = ln(size * (1.0 / reference_pressure)) * -swelling_index;
        let beyond = volumetric - at_size;
        let along = at_size + beyond * (swelling_index / compression_index);
        beyond.where_below(T::splat(0.0), along, volumetric)
    }

    /// The state after the plastic flow; `None` if a point has no such state.
    #[inline(always)]
    fn flow<T: Lane>(&self, start: &Start<T>) -> Option<Returned<T>> {
        let ([volumetric, shear, gamma], equations) = self.solve(start)?;
        let Equations { jacobian, elastic, size, .. } = equations;
        let (one, zero) = (T::splat(1.0), T::splat(0.0));
        // The trial strains enter the first two equations, and also P_c, which depends on ε_v^e − ε_v^tr.
        let per = one / start.size;
        let solved = inverse(&jacobian);
        let size_rate = size * self.hardening();
        let by_surface = elastic.pressure * size_rate * start.per_size * start.per_size * -1.0;
        let by_volumetric = times(&solved, &[one + gamma * per * size_rate, zero, by_surface]);
        let volumetric_rates = elastic.rates(by_volumetric[0], by_volumetric[1]);
        let deviatoric_rates = elastic.rates(solved[0][1], solved[1][1]);
        let per_square = 1.0 / (self.critical_state_ratio * self.critical_state_ratio);
        Some(Returned {
            elastic,
            size,
            strain: [volumetric, shear],
            kept: one / (one + gamma * per * elastic.modulus * (6.0 * per_square)),
            pressure_rates: [volumetric_rates[0], deviatoric_rates[0]],
            shear_rates: [volumetric_rates[1], deviatoric_rates[1]],
        })
    }

    /// The same as [`PrincipalLaw::respond`](crate::material::PrincipalLaw::respond).
    ///
    /// # Errors
    /// If a point has no response, or if its elasticity is unstable.
    #[inline(always)]
    pub(super) fn respond<T: Lane>(
        &self,
        trial: &[T; 3],
        old: &[T],
        new: &mut [T],
    ) -> Result<PrincipalResponse<T>, MaterialError> {
        new.copy_from_slice(old);
        let (one, zero, infinite) = (T::splat(1.0), T::splat(0.0), T::splat(f64::INFINITY));
        let volumetric = trial[0] + trial[1] + trial[2];
        let mean = volumetric * (1.0 / 3.0);
        let deviator = [trial[0] - mean, trial[1] - mean, trial[2] - mean];
        let [x, y, z] = deviator;
        let length = (x * x + y * y + z * z).sqrt();
        let (shear, size) = (length * EQUIVALENT, old[PRECONSOLIDATION]);
        let elastic = self.elastic(volumetric, shear);
        if !(elastic.pressure * elastic.pressure + elastic.shear * elastic.shear).is_below(f64::INFINITY) {
            return Err(MaterialError::NoResponse);
        }
        let scale = elastic.pressure.where_below(size, size, elastic.pressure);
        let bound = scale * scale * ON_SURFACE;
        let excess = self.yields(&elastic, size);
        let accepted = (one + volumetric.abs() + shear) * TOLERANCE;
        let tolerance = bound.where_below(excess, accepted, infinite);
        let ([p_v, q_v], [p_s, q_s]) = (elastic.rates(one, zero), elastic.rates(zero, one));
        let mut reached = Returned {
            elastic,
            size,
            strain: [volumetric, shear],
            kept: one,
            pressure_rates: [p_v, p_s],
            shear_rates: [q_v, q_s],
        };
        let flows = tolerance.where_below(infinite, one, zero);
        if !flows.is_below(0.5) {
            let first = zero.where_below(flows, self.first(volumetric, size), volumetric);
            let per_size = one / self.size(size, first - volumetric);
            let start = Start { volumetric, shear, size, first, per_size, tolerance };
            reached.replace(&self.flow(&start).ok_or(MaterialError::NoResponse)?, flows);
            new[PRECONSOLIDATION] = reached.size;
            new[EQUIVALENT_STRAIN] += shear - reached.strain[1];
            new[VOLUMETRIC_STRAIN] += volumetric - reached.strain[0];
        }
        if !reached.elastic.is_stable() {
            return Err(MaterialError::Unstable);
        }
        let mut response = reached.respond(&deviator, length);
        for (strain, trial) in response.elastic_strain.iter_mut().zip(trial) {
            *strain = zero.where_below(flows, *strain, *trial);
        }
        let [x, y, z] = response.tau;
        let [e_x, e_y, e_z] = response.elastic_strain;
        new[WORK] += x * (trial[0] - e_x) + y * (trial[1] - e_y) + z * (trial[2] - e_z);
        Ok(response)
    }
}

impl<T: Lane> Returned<T> {
    /// Replaces the state of the points that flow.
    #[inline(always)]
    fn replace(&mut self, flowed: &Returned<T>, flows: T) {
        let zero = T::splat(0.0);
        let pick = |own: &mut T, other: T| *own = zero.where_below(flows, other, *own);
        let (own, other) = (&mut self.elastic, &flowed.elastic);
        pick(&mut own.pressure, other.pressure);
        pick(&mut own.shear, other.shear);
        pick(&mut own.modulus, other.modulus);
        pick(&mut own.bulk, other.bulk);
        pick(&mut own.coupling, other.coupling);
        pick(&mut self.size, flowed.size);
        pick(&mut self.kept, flowed.kept);
        for k in 0..2 {
            pick(&mut self.strain[k], flowed.strain[k]);
            pick(&mut self.pressure_rates[k], flowed.pressure_rates[k]);
            pick(&mut self.shear_rates[k], flowed.shear_rates[k]);
        }
    }

    /// The response at a trial deviator and its norm; τ = −P + √(2/3) q n with n along the deviator.
    #[inline(always)]
    fn respond(&self, deviator: &[T; 3], length: T) -> PrincipalResponse<T> {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let ratio = self.elastic.modulus * self.kept * 2.0;
        let per_length = zero.where_below(length, one / length, zero);
        let mean = self.strain[0] * (1.0 / 3.0);
        let ([p_v, p_s], [q_v, q_s]) = (self.pressure_rates, self.shear_rates);
        let (mut tau, mut elastic_strain, mut modulus) = ([zero; 3], [zero; 3], [[zero; 3]; 3]);
        for i in 0..3 {
            tau[i] = ratio * deviator[i] - self.elastic.pressure;
            elastic_strain[i] = self.kept * deviator[i] + mean;
            let n_i = deviator[i] * per_length;
            for j in 0..3 {
                let n_j = deviator[j] * per_length;
                let shear = n_j * EQUIVALENT; // ∂ε_s^tr/∂ε_j
                let turning = T::splat(if i == j { 2.0 / 3.0 } else { -1.0 / 3.0 }) - n_i * n_j;
                modulus[i][j] = ratio * turning + n_i * (q_v + q_s * shear) * EQUIVALENT - p_v - p_s * shear;
            }
        }
        PrincipalResponse { tau, elastic_strain, modulus }
    }
}

/// The inverse of a matrix, `[i][j]`; not finite if the matrix is singular.
#[inline(always)]
fn inverse<T: Lane>(a: &[[T; 3]; 3]) -> [[T; 3]; 3] {
    let mut adjugate = *a;
    for (i, row) in adjugate.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let ([p, q], [r, s]) = ([(j + 1) % 3, (j + 2) % 3], [(i + 1) % 3, (i + 2) % 3]);
            *entry = a[p][r] * a[q][s] - a[p][s] * a[q][r];
        }
    }
    let determinant = a[0][0] * adjugate[0][0] + a[0][1] * adjugate[1][0] + a[0][2] * adjugate[2][0];
    let per = T::splat(1.0) / determinant;
    for row in &mut adjugate {
        for entry in row {
            *entry = *entry * per;
        }
    }
    adjugate
}

#[inline(always)]
fn times<T: Lane>(a: &[[T; 3]; 3], x: &[T; 3]) -> [T; 3] {
    let mut product = *x;
    for (entry, row) in product.iter_mut().zip(a) {
        *entry = row[0] * x[0] + row[1] * x[1] + row[2] * x[2];
    }
    product
}
