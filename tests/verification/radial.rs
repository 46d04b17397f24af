//! Thick cylinders and spheres: the ordinary differential equation of radial motion, solved with quadratic elements.
//!
//! A shell of radii A ≤ R ≤ B moves to r(R). With m directions around (1 for a cylinder that keeps its length, 2 for a
//! sphere) F = diag(r', r/R, 1 or r/R) is principal and equilibrium is d/dR(R^m P_r) = m R^(m−1) P_θ − R^m J_n b, with
//! P_i = τ_i/F_i and b a force per volume at the start of the step. Newton's method solves its weak form.

use mpm::material::{Material, StrainMeasure};
use mpm::tensor::Sym3;
use nalgebra::{DMatrix, DVector};

/// The shape that moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shell {
    Cylinder,
    Sphere,
}

/// The motion of the inner radius: prescribed, or free to follow from equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Inner {
    Moved(f64),
    Free,
}

/// A shell in equilibrium.
pub struct Radial<'a> {
    shell: Shell,
    law: &'a dyn Material,
    /// Original and current radii of the nodes; an element has three nodes and shares the outer two.
    nodes: Vec<f64>,
    radii: Vec<f64>,
    gauss: Vec<Gauss>,
}

/// An integration point: its position, the basis there, and its converged state.
struct Gauss {
    element: usize,
    place: f64,
    value: [f64; 3],
    slope: [f64; 3],
    weight: f64,
    stretches: [f64; 3],
    elastic: Sym3,
    history: Vec<f64>,
}

/// The response of a point to stretches.
struct Answer {
    stress: [f64; 3],
    elastic: Sym3,
    history: Vec<f64>,
}

impl<'a> Radial<'a> {
    /// A shell at rest, in `n` elements.
    pub fn new(shell: Shell, [a, b]: [f64; 2], law: &'a dyn Material, n: usize) -> Self {
        let h = (b - a) / n as f64;
        let nodes: Vec<f64> = (0..=2 * n).map(|k| a + 0.5 * h * k as f64).collect();
        let mut gauss = Vec::new();
        for element in 0..n {
            for (xi, share) in [(-0.6f64.sqrt(), 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.6f64.sqrt(), 5.0 / 18.0)]
            {
                let place = a + h * (element as f64 + 0.5 * (1.0 + xi));
                let around = if shell == Shell::Sphere { place * place } else { place };
                gauss.push(Gauss {
                    element,
                    place,
                    value: [0.5 * xi * (xi - 1.0), 1.0 - xi * xi, 0.5 * xi * (xi + 1.0)],
                    slope: [xi - 0.5, -2.0 * xi, xi + 0.5].map(|s| 2.0 * s / h),
                    weight: share * h * around,
                    stretches: [1.0; 3],
                    elastic: Sym3::ZERO,
                    history: law.state_fields().iter().map(|f| f.initial).collect(),
                });
            }
        }
        Radial { shell, law, radii: nodes.clone(), nodes, gauss }
    }

    /// Stretches from r' and r/R.
    fn stretches(&self, along: f64, around: f64) -> [f64; 3] {
        [along, around, if self.shell == Shell::Sphere { around } else { 1.0 }]
    }

    /// The response to stretches, starting from the converged state of a point; the stress is the first Piola-Kirchhoff
    /// stress.
    fn answer(&self, point: &Gauss, stretches: [f64; 3]) -> Answer {
        let measure = self.law.strain_measure();
        let b_n = measure.left_cauchy_green(&point.elastic).0;
        let b: [f64; 3] = std::array::from_fn(|i| (stretches[i] / point.stretches[i]).powi(2) * b_n[i]);
        let strain = match measure {
            StrainMeasure::Logarithmic => b.map(|b| 0.5 * b.ln()),
            StrainMeasure::LeftCauchyGreen => b.map(|b| 0.5 * (b - 1.0)),
        };
        let trial = Sym3([strain[0], strain[1], strain[2], 0.0, 0.0, 0.0]);
        let mut history = point.history.clone();
        let law = self.law.update(&trial, &point.history, &mut history).unwrap();
        let stress = std::array::from_fn(|i| law.tau.0[i] / stretches[i]);
        Answer { stress, elastic: law.elastic_strain, history }
    }

    /// r' and r/R of a point.
    fn motion(&self, point: &Gauss, radii: &[f64]) -> (f64, f64) {
        let r = &radii[2 * point.element..][..3];
        let along: f64 = (0..3).map(|k| point.slope[k] * r[k]).sum();
        let place: f64 = (0..3).map(|k| point.value[k] * r[k]).sum();
        (along, place / point.place)
    }

    /// Moves to the next equilibrium under a force per volume at the start of the step, a function of the original
    /// radius.
    pub fn step(&mut self, inner: Inner, force: impl Fn(f64) -> f64) {
        let around = if self.shell == Shell::Sphere { 2.0 } else { 1.0 };
        let n = self.nodes.len();
        let mut radii = self.radii.clone();
        if let Inner::Moved(to) = inner {
            // A first guess in which no layer of the shell passes through another.
            let by = to - radii[0];
            let (a, b) = (self.nodes[0], self.nodes[n - 1]);
            for (r, place) in radii.iter_mut().zip(&self.nodes) {
                *r += by * (b + 0.5 * (b - a) - place) / (1.5 * (b - a));
            }
            radii[0] = to;
        }
        for iteration in 0.. {
            let mut residual = DVector::zeros(n);
            let mut stiffness = DMatrix::zeros(n, n);
            for point in &self.gauss {
                let (along, hoop) = self.motion(point, &radii);
                let at = |along: f64, hoop: f64| self.answer(point, self.stretches(along, hoop)).stress;
                let stress = at(along, hoop);
                let d = 1e-6;
                let by = |plus: [f64; 3], minus: [f64; 3]| [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * d));
                let slopes = by(at(along + d, hoop), at(along - d, hoop));
                let hoops = by(at(along, hoop + d), at(along, hoop - d));
                let volume: f64 = point.stretches.iter().product();
                for a in 0..3 {
                    let (slope, ring) = (point.slope[a], around * point.value[a] / point.place);
                    let row = 2 * point.element + a;
                    let internal = point.weight * (stress[0] * slope + stress[1] * ring);
                    residual[row] += internal - point.weight * volume * force(point.place) * point.value[a];
                    for b in 0..3 {
                        let (db, rb) = (point.slope[b], point.value[b] / point.place);
                        stiffness[(row, 2 * point.element + b)] += point.weight
                            * ((slopes[0] * db + hoops[0] * rb) * slope
                                + (slopes[1] * db + hoops[1] * rb) * ring);
                    }
                }
            }
            if inner != Inner::Free {
                residual[0] = 0.0;
                stiffness.row_mut(0).fill(0.0);
                stiffness[(0, 0)] = 1.0;
            }
            assert!(iteration < 40, "the reference has no equilibrium: {:e}", residual.amax());
            let change = stiffness.lu().solve(&residual).unwrap();
            let mut share = 1.0f64;
            for point in &self.gauss {
                let (along, hoop) = self.motion(point, &radii);
                let (d_along, d_hoop) = self.motion(point, change.as_slice());
                for (value, by) in [(along, d_along), (hoop, d_hoop)] {
                    if by > 0.5 * value {
                        share = share.min(0.5 * value / by);
                    }
                }
            }
            for (r, change) in radii.iter_mut().zip(&change) {
                *r -= share * change;
            }
            if change.amax() < 1e-12 * self.nodes[n - 1] {
                break;
            }
        }
        let answers: Vec<([f64; 3], Answer)> = (self.gauss.iter())
            .map(|point| {
                let (along, hoop) = self.motion(point, &radii);
                let stretches = self.stretches(along, hoop);
                (stretches, self.answer(point, stretches))
            })
            .collect();
        for (point, (stretches, answer)) in self.gauss.iter_mut().zip(answers) {
            point.stretches = stretches;
            point.elastic = answer.elastic;
            point.history = answer.history;
        }
        self.radii = radii;
    }

    /// Pressure on the inner surface in equilibrium.
    pub fn inner_pressure(&self) -> f64 {
        let m = if self.shell == Shell::Sphere { 2 } else { 1 };
        let first = self.gauss.iter().filter(|point| point.element == 0);
        let force = |point: &Gauss| {
            let stress = self.answer(point, point.stretches).stress;
            let ring = f64::from(m) * point.value[0] / point.place;
            point.weight * (stress[0] * point.slope[0] + stress[1] * ring)
        };
        first.map(force).sum::<f64>() / self.radii[0].powi(m)
    }

    /// Current radius of the material at the original radius R.
    pub fn radius(&self, place: f64) -> f64 {
        let n = (self.nodes.len() - 1) / 2;
        let (a, b) = (self.nodes[0], self.nodes[2 * n]);
        let h = (b - a) / n as f64;
        let element = (((place - a) / h).max(0.0) as usize).min(n - 1);
        let xi = 2.0 * ((place - a) / h - element as f64) - 1.0;
        let value = [0.5 * xi * (xi - 1.0), 1.0 - xi * xi, 0.5 * xi * (xi + 1.0)];
        (0..3).map(|k| value[k] * self.radii[2 * element + k]).sum()
    }

    /// Original radius up to which the material has yielded: extrapolated from the elastic side, the norm of the
    /// deviatoric stress is `yield_radius` there.
    pub fn front(&self, yield_radius: f64) -> f64 {
        let deviatoric = |point: &Gauss| {
            let answer = self.answer(point, point.stretches);
            let tau = Sym3(
                [0, 1, 2, 3, 3, 3].map(|i| if i < 3 { answer.stress[i] * point.stretches[i] } else { 0.0 }),
            );
            tau.deviator().norm()
        };
        let first = self.gauss.iter().position(|p| p.history[0] == 0.0).expect("an elastic rest");
        assert!(first > 0, "nothing has yielded");
        let [p, q] = [&self.gauss[first], &self.gauss[first + 3]];
        let (x, y) = (deviatoric(p), deviatoric(q));
        p.place + (q.place - p.place) * (yield_radius - x) / (y - x)
    }

    /// Largest ratio between the radial and the circumferential stretch, the larger divided by the smaller.
    pub fn largest_distortion(&self) -> f64 {
        self.gauss.iter().map(|p| (p.stretches[1] / p.stretches[0]).ln().abs().exp()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mpm::material::{Hencky, NeoHookean, VonMises};

    /// Small displacements follow Lamé's solution u = c₁ R + c₂/R^m.
    #[test]
    fn small_motions_are_those_of_lame() {
        let (young, poisson) = (3.0, 0.3);
        for law in [&Hencky::new(young, poisson) as &dyn Material, &NeoHookean::new(young, poisson)] {
            let (lame, shear) = (young * poisson / (1.3 * 0.4), young / 2.6);
            for (shell, m) in [(Shell::Cylinder, 1), (Shell::Sphere, 2)] {
                let (a, b, u) = (1.0f64, 2.0f64, 1e-6);
                let mut radial = Radial::new(shell, [a, b], law, 40);
                radial.step(Inner::Moved(a + u), |_| 0.0);
                // σ_r(B) = 0: (λ + 2μ) u' + m λ u/R = 0 with u' = c₁ − m c₂/R^(m+1).
                let p = f64::from(m);
                let ratio =
                    ((lame + 2.0 * shear) * p - p * lame) / b.powi(m + 1) / (lame + 2.0 * shear + p * lame);
                let c2 = u / (ratio * a + a.powi(-m));
                for place in [1.0, 1.3, 1.71, 2.0] {
                    let exact = c2 * (ratio * place + f64::powi(place, -m));
                    assert!(((radial.radius(place) - place) / exact - 1.0).abs() < 1e-5, "{shell:?} {place}");
                }
            }
        }
    }

    /// The solution does not depend on the number of elements; with plastic flow this holds to the order that a front
    /// inside an element allows.
    #[test]
    fn the_reference_has_converged() {
        let elastic = Hencky::new(1.0, 0.3);
        let plastic = VonMises::new(1.0, 0.3, 0.2).hardening(0.1);
        for (law, tolerance) in [(&elastic as &dyn Material, 1e-9), (&plastic, 2e-6)] {
            for shell in [Shell::Cylinder, Shell::Sphere] {
                let [coarse, fine] = [100, 200].map(|n| {
                    let mut radial = Radial::new(shell, [1.0, 2.0], law, n);
                    radial.step(Inner::Moved(1.5), |_| 0.0);
                    radial
                });
                for place in [1.1, 1.5, 2.0] {
                    let difference = coarse.radius(place) - fine.radius(place);
                    assert!(difference.abs() < tolerance, "{shell:?} {law:?} {place}: {difference:e}");
                }
            }
        }
    }
}
