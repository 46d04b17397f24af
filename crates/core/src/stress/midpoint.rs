//! The weak form of a point in a step with inertia: stresses that act over the whole step, such that their work is the
//! growth of the stored energy.
//!
//! With the second Piola-Kirchhoff stresses S = ΔF⁻¹ τ ΔF⁻ᵀ in the configuration at the start of the step, the mean
//! force of the step is
//!
//! f_v = Σ V⁰ ½ (1 + ΔF) Š ∇̃S_v, Š = S̄ + 2 d ΔC/(ΔC:ΔC), S̄ = ½ (τ_n + S_{n+1}), d = ΔW − ½ S̄:ΔC,
//!
//! with ΔC = ΔFᵀΔF − 1 and the growth ΔW of the stored energy (Gonzalez 2000). Its work over the step is V⁰ (½ S̄:ΔC + d)
//! = V⁰ ΔW, and ½ (1 + ΔF) Š ½ (1 + ΔFᵀ) is symmetric, so that it exerts no moment about the mean positions.
#![allow(non_snake_case)]

use super::{Current, Lane, Lanes, WeakForm};
use crate::kinematics::Increment;
use crate::tensor::Sym3;

/// Deformation increments ‖ΔC‖ up to which the growth of the stored energy is round-off beside ½ S̄:ΔC, [-].
const SMALL: f64 = 1e-6;

/// A point in a step with inertia, with gradients in the configuration at the start of the step. The gradient of a basis
/// function has `E` components, as for [`Current`].
#[derive(Debug, Clone, Copy)]
pub struct Midpoint<const D: usize, const E: usize>(Current<D, E>);

/// What the mean stress of a step needs to know of its start.
#[derive(Debug, Clone, Copy)]
pub struct StressAtStart {
    /// Kirchhoff stress τ_n, [stress].
    pub tau: Sym3,
    /// V⁰ = V_n/J_n, [volume].
    pub volume: f64,
}

/// A response at the end of a step from which the mean response of the step follows.
pub trait Averageable<const D: usize> {
    /// The mean response.
    type Mean: WeakForm<D>;

    /// The mean response of the step, see [`Midpoint::new`].
    fn averaged(
        &self,
        start: &StressAtStart,
        increment: &Increment<D>,
        growth: Option<f64>,
        with_tangent: bool,
    ) -> Self::Mean;
}

impl<const D: usize, const E: usize> Averageable<D> for Current<D, E> {
    type Mean = Midpoint<D, E>;

    #[inline(always)]
    fn averaged(
        &self,
        start: &StressAtStart,
        increment: &Increment<D>,
        growth: Option<f64>,
        with_tangent: bool,
    ) -> Midpoint<D, E> {
        Midpoint::new(self, start, increment, growth, with_tangent)
    }
}

/// A full matrix over the components of gradients.
type Full<const E: usize> = [[f64; E]; E];

fn product<const E: usize>(a: &Full<E>, b: &Full<E>) -> Full<E> {
    let mut sum = [[0.0; E]; E];
    for i in 0..E {
        for k in 0..E {
            for j in 0..E {
                sum[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    sum
}

/// a b aᵀ for a symmetric or unsymmetric b.
fn carried<const E: usize>(a: &Full<E>, b: &Full<E>) -> Full<E> {
    let ab = product(a, b);
    let mut sum = [[0.0; E]; E];
    for i in 0..E {
        for j in 0..E {
            for k in 0..E {
                sum[i][j] += ab[i][k] * a[j][k];
            }
        }
    }
    sum
}

fn double<const E: usize>(a: &Full<E>, b: &Full<E>) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

/// The component of the displacement that a component `(i, j)` of a stress works on; `None` if the component is zero
/// because the circumferential direction stays principal.
fn works<const D: usize>(i: usize, j: usize) -> Option<usize> {
    match (i < D, j < D) {
        (true, true) => Some(i),
        (false, false) => Some(0),
        _ => None,
    }
}

impl<const D: usize, const E: usize> Midpoint<D, E> {
    /// The mean stress of a step and its derivative, from the stress and the moduli at the end of the step; `growth` is
    /// the growth V⁰ ΔW of the stored energy, [energy], or `None` if the point dissipates energy. The derivative is zero
    /// unless it is wanted.
    pub fn new(
        end: &Current<D, E>,
        start: &StressAtStart,
        increment: &Increment<D>,
        growth: Option<f64>,
        with_tangent: bool,
    ) -> Self {
        let F = extended::<D, E>(&increment.dF, increment.hoop);
        let inverse = extended::<D, E>(&end.inverse, 1.0 / increment.hoop);
        let mut tau = [[0.0; E]; E];
        let mut before = [[0.0; E]; E];
        for i in 0..E {
            for j in 0..E {
                if let Some(component) = works::<D>(i, j) {
                    tau[i][j] = end.stress[j][component];
                    before[i][j] = start.volume * start.tau.component(i, j);
                }
            }
        }
        let at_end = carried(&inverse, &tau);
        let mut mean = at_end;
        for (mean, before) in mean.as_flattened_mut().iter_mut().zip(before.as_flattened()) {
            *mean = 0.5 * (*mean + before);
        }
        // ΔFᵀΔF − 1 = Hᵀ + H + HᵀH with H = ΔF − 1, without cancellation.
        let mut H = F;
        (0..E).for_each(|i| H[i][i] -= 1.0);
        let mut C = [[0.0; E]; E];
        for i in 0..E {
            for j in 0..E {
                C[i][j] = H[i][j] + H[j][i] + (0..E).map(|k| H[k][i] * H[k][j]).sum::<f64>();
            }
        }
        let squared = double(&C, &C);
        let corrects = squared > SMALL * SMALL;
        let d = growth.filter(|_| corrects).map(|growth| growth - 0.5 * double(&mean, &C));
        let mut stress = mean;
        if let Some(d) = d {
            for (stress, C) in stress.as_flattened_mut().iter_mut().zip(C.as_flattened()) {
                *stress += 2.0 * d / squared * C;
            }
        }
        let mut half = F;
        for (i, row) in half.iter_mut().enumerate() {
            row.iter_mut().enumerate().for_each(|(j, x)| *x = 0.5 * (*x + f64::from(u8::from(i == j))));
        }
        let force = product(&half, &stress);
        let mut weak = Current {
            stress: [[0.0; D]; E],
            tangent: [[[[0.0; D]; D]; E]; E],
            inverse: end.inverse,
            per_radius: if increment.radius > 0.0 { 1.0 / increment.radius } else { 0.0 },
        };
        for j in 0..E {
            for i in 0..E {
                if let Some(component) = works::<D>(i, j) {
                    weak.stress[j][component] = force[i][j];
                }
            }
        }
        if !with_tangent {
            return Midpoint(weak);
        }
        let with_d = d.map(|d| Correction { d, C, squared, at_end, mean });
        for k in 0..E {
            for l in 0..E {
                let Some(moved) = works::<D>(k, l) else { continue };
                // H = δΔF ΔF⁻¹ has the row k alone.
                let along = inverse[l];
                let mut change = [[0.0; E]; E];
                for i in 0..E {
                    for j in 0..E {
                        let Some(component) = works::<D>(i, j) else { continue };
                        for n in 0..E {
                            if let Some(of) = works::<D>(k, n) {
                                change[i][j] += end.tangent[n][j][component][of] * along[n];
                            }
                        }
                    }
                }
                // The moduli contain −τ Hᵀ; what is missing of the change of τ in the moving frame is −H τ.
                for j in 0..E {
                    change[k][j] -= (0..E).map(|n| along[n] * tau[n][j]).sum::<f64>();
                }
                let mut change = carried(&inverse, &change);
                change.as_flattened_mut().iter_mut().for_each(|x| *x *= 0.5);
                if let Some(correction) = &with_d {
                    correction.add(&F, [k, l], &mut change);
                }
                let mut change = product(&half, &change);
                for j in 0..E {
                    change[k][j] += 0.5 * stress[l][j];
                }
                for j in 0..E {
                    for i in 0..E {
                        if let Some(component) = works::<D>(i, j) {
                            weak.tangent[l][j][component][moved] = change[i][j];
                        }
                    }
                }
            }
        }
        Midpoint(weak)
    }
}

/// What the derivative of the term 2 d ΔC/(ΔC:ΔC) needs.
struct Correction<const E: usize> {
    d: f64,
    C: Full<E>,
    squared: f64,
    at_end: Full<E>,
    mean: Full<E>,
}

impl<const E: usize> Correction<E> {
    /// Adds the derivative with respect to component `(k, l)` of ΔF to that of S̄.
    fn add(&self, F: &Full<E>, [k, l]: [usize; 2], change: &mut Full<E>) {
        let Correction { d, C, squared, at_end, mean } = self;
        let mut dC = [[0.0; E]; E];
        for n in 0..E {
            dC[l][n] += F[k][n];
            dC[n][l] += F[k][n];
        }
        let growth = 0.5 * (double(at_end, &dC) - double(mean, &dC)) - 0.5 * double(change, C);
        let shrinks = 2.0 * d / squared * double(C, &dC);
        for ((change, C), dC) in
            change.as_flattened_mut().iter_mut().zip(C.as_flattened()).zip(dC.as_flattened())
        {
            *change += 2.0 / squared * ((growth - shrinks) * C + d * dC);
        }
    }
}

/// A matrix along the axes, extended by the circumferential direction of a body of revolution.
fn extended<const D: usize, const E: usize>(along: &[[f64; D]; D], hoop: f64) -> Full<E> {
    let mut full = [[0.0; E]; E];
    for (i, row) in full.iter_mut().enumerate() {
        for (j, x) in row.iter_mut().enumerate() {
            *x = match (i < D && j < D, i == j) {
                (true, _) => along[i][j],
                (false, true) => hoop,
                (false, false) => 0.0,
            };
        }
    }
    full
}

impl<const D: usize, const E: usize> WeakForm<D> for Midpoint<D, E> {
    type Gradient<T: Lane> = [T; E];
    type Column = [[[f64; D]; D]; E];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        None
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [f64; E] {
        self.0.gradient(gradient, value)
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; E]]) -> [Lanes; E] {
        Current::<D, E>::pack(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; E], force: &mut [f64; D]) -> [[[f64; D]; D]; E] {
        self.0.column(gradient, force)
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; D]; D]; E], gradient: &[T; E], block: &mut [[T; D]; D]) {
        Current::<D, E>::add_block(column, gradient, block);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Hencky, Material, NeoHookean};
    use crate::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid, StartOfStep};

    const VOLUME: f64 = 0.7;

    fn laws() -> Vec<Box<dyn Material>> {
        vec![Box::new(Hencky::new(3.0, 0.3)), Box::new(NeoHookean::new(3.0, 0.3))]
    }

    /// The elastic strain at the start; no shear between the plane and the third direction.
    fn strain_at_start(in_space: bool) -> Sym3 {
        let out = if in_space { [0.03, -0.02] } else { [0.0; 2] };
        Sym3::from_components([0.05, -0.08, 0.02, 0.04, out[0], out[1]])
    }

    /// The mean response of a step, and the growth of the stored energy.
    fn respond<const D: usize, const E: usize, M: Mechanics<D, Current = Current<D, E>>>(
        law: &dyn Material,
        increment: &Increment<D>,
    ) -> (Midpoint<D, E>, f64) {
        let before = strain_at_start(D == 3);
        let tau = law.update(&before, &[], &mut []).unwrap().tau;
        let b_n = M::elastic_left_cauchy_green(law.strain_measure(), &before);
        let start = StartOfStep { b_n, J_n: 1.0, volume_n: VOLUME };
        let end = M::respond_current(&start, increment, law, &[], &mut []).unwrap();
        let growth = VOLUME * (law.energy(&end.elastic_strain, &[]) - law.energy(&before, &[]));
        let start = StressAtStart { tau, volume: VOLUME };
        (Midpoint::new(&end.weak, &start, increment, Some(growth), true), growth)
    }

    /// The increment with a change of a component of the gradient of the displacement.
    fn changed<const D: usize>(at: &Increment<D>, i: usize, j: usize, by: f64) -> Increment<D> {
        let mut increment = *at;
        if j < D {
            increment.dF[i][j] += by
        } else {
            increment.hoop += by
        }
        increment
    }

    fn check<const D: usize, const E: usize, M: Mechanics<D, Current = Current<D, E>>>(
        increment: Increment<D>,
    ) {
        for law in laws() {
            let (point, growth) = respond::<D, E, M>(law.as_ref(), &increment);
            let Midpoint(weak) = point;
            let mut work = 0.0;
            for j in 0..E {
                for i in 0..D {
                    let gradient = if j < D {
                        increment.dF[i][j] - f64::from(u8::from(i == j))
                    } else if i == 0 {
                        increment.hoop - 1.0
                    } else {
                        0.0
                    };
                    work += weak.stress[j][i] * gradient;
                }
            }
            assert!((work - growth).abs() < 1e-14, "{law:?}: {work} {growth}");
            for l in 0..E {
                for k in 0..D {
                    if l >= D && k > 0 {
                        continue;
                    }
                    let step = 1e-5;
                    let [above, below] = [step, -step]
                        .map(|by| respond::<D, E, M>(law.as_ref(), &changed(&increment, k, l, by)).0.0);
                    for j in 0..E {
                        for i in 0..D {
                            let difference = (above.stress[j][i] - below.stress[j][i]) / (2.0 * step);
                            let found = weak.tangent[l][j][i][k];
                            assert!(
                                (found - difference).abs() < 1e-8,
                                "{law:?} [{l}][{j}][{i}][{k}]: {found} {difference}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn work_is_the_growth_of_energy_and_moduli_are_its_derivative() {
        let plane = [[1.1, 0.3], [-0.25, 0.9]];
        check::<2, 2, PlaneStrain>(Increment::flat(plane));
        check::<2, 3, Axisymmetric>(Increment { dF: plane, hoop: 1.07, radius: 0.4 });
        let space = [[1.1, 0.3, -0.1], [-0.25, 0.9, 0.05], [0.2, -0.1, 1.05]];
        check::<3, 3, Solid>(Increment::flat(space));
    }

    #[test]
    fn mean_forces_exert_no_moment() {
        let increment = Increment::flat([[1.1, 0.3], [-0.25, 0.9]]);
        let (Midpoint(weak), _) = respond::<2, 2, PlaneStrain>(laws()[0].as_ref(), &increment);
        // P̄ ½ (1 + ΔF)ᵀ is symmetric.
        let half = |i: usize, j: usize| 0.5 * (increment.dF[i][j] + f64::from(u8::from(i == j)));
        let moment = |i: usize, k: usize| (0..2).map(|j| weak.stress[j][i] * half(k, j)).sum::<f64>();
        assert!((moment(0, 1) - moment(1, 0)).abs() < 1e-15);
    }
}
