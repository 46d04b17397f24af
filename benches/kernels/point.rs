//! Kernels of single points: functions of tensors, and the laws with the finite-strain kernel around them.
#![allow(non_snake_case)]

use std::hint::black_box;

use mpm::kinematics::Increment;
use mpm::material::{
    CamClay, DruckerPrager, Friction, Hencky, Match, Material, ModifiedCamClay, MohrCoulomb, NeoHookean,
    Tresca, VonMises,
};
use mpm::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid, StartOfStep};
use mpm::tensor::{Lanes, Sym3, exp_derivative, log_with_derivative, plane};
use pulp::{Arch, Simd, WithSimd};

use crate::clock::least;

/// Number of points in a measurement: few enough that their data remain in the caches of the core.
const N: usize = 1000;
/// Number of passes over the points in a timed call.
const TIMES: usize = 20;

/// A repeatable sequence of numbers that covers [-1, 1] evenly, because it advances in steps of the golden ratio.
pub fn numbers() -> impl FnMut() -> f64 {
    let mut last = 0.5;
    move || {
        last = (last + 0.618_033_988_749_895_f64).fract();
        2.0 * last - 1.0
    }
}

/// Prints the time of every function and law, in nanoseconds per point.
pub fn print() {
    println!("\n## Single points\n\n| Kernel | CPU (ns) |\n|---|---|");
    functions();
    laws();
}

fn row<T>(name: &str, mut work: impl FnMut(usize) -> T) {
    let seconds = least(|| {
        for _ in 0..TIMES {
            (0..N).for_each(|p| {
                black_box(work(p));
            });
        }
    });
    println!("| {name} | {:.1} |", seconds * 1e9 / (N * TIMES) as f64);
}

/// Strains with components up to 0.2; without out-of-plane shear if `in_plane`.
fn strains(in_plane: bool) -> Vec<Sym3> {
    let mut number = numbers();
    let across = if in_plane { 0.0 } else { 0.2 };
    let mut strain = |_| {
        let mut e = Sym3(std::array::from_fn(|_| 0.2 * number()));
        (e.0[3], e.0[4]) = (e.0[3] / 0.2 * across, e.0[4] / 0.2 * across);
        e
    };
    (0..N).map(&mut strain).collect()
}

fn functions() {
    for in_plane in [true, false] {
        let e = strains(in_plane);
        let b: Vec<Sym3> = e.iter().map(|e| e.map_eigenvalues(|x| (2.0 * x).exp())).collect();
        if in_plane {
            row("plane: exp", |p| plane::exp(&e[p]));
            row("plane: log and its derivative", |p| plane::log_with_derivative(&plane::components(&b[p])));
        } else {
            row("space: spectral decomposition", |p| b[p].spectrum());
            row("space: exp", |p| e[p].map_eigenvalues(f64::exp));
            row("space: derivative of exp", |p| exp_derivative(&e[p]));
            row("space: log", |p| b[p].map_eigenvalues(f64::ln));
            row("space: log and its derivative", |p| log_with_derivative(&b[p]));
        }
    }
}

fn laws() {
    let weak = Friction { cohesion: 1.0, friction_angle: 25.0, dilation_angle: 5.0 };
    let strong = Friction { cohesion: 1e9, ..weak };
    let clay = CamClay {
        compression_index: 0.2,
        swelling_index: 0.1,
        critical_state_ratio: 1.0,
        shear_modulus: 1e6,
        shear_modulus_ratio: 0.0,
        overconsolidation_ratio: 1.0,
        reference_pressure: 1e6,
    };
    let laws: [(&str, Box<dyn Material>); 11] = [
        ("Hencky", Box::new(Hencky::new(1e6, 0.3))),
        ("neo-Hookean", Box::new(NeoHookean::new(1e6, 0.3))),
        ("von Mises, elastic", Box::new(VonMises::new(1e6, 0.3, 1e9))),
        ("von Mises, yielding", Box::new(VonMises::new(1e6, 0.3, 1.0).hardening(1e5))),
        ("Tresca, elastic", Box::new(Tresca::new(1e6, 0.3, 1e9))),
        ("Tresca, yielding", Box::new(Tresca::new(1e6, 0.3, 1.0))),
        ("Mohr-Coulomb, elastic", Box::new(MohrCoulomb::new(1e6, 0.3, strong))),
        ("Mohr-Coulomb, yielding", Box::new(MohrCoulomb::new(1e6, 0.3, weak))),
        ("Drucker-Prager, elastic", Box::new(DruckerPrager::new(1e6, 0.3, strong, Match::PlaneStrain))),
        ("Drucker-Prager, yielding", Box::new(DruckerPrager::new(1e6, 0.3, weak, Match::PlaneStrain))),
        ("Cam-clay", Box::new(ModifiedCamClay::new(clay))),
    ];
    for (name, law) in &laws {
        let law = law.as_ref();
        kernel::<2, PlaneStrain>(&format!("plane strain: stress and tangent, {name}"), law, true);
        if law.vectorised().is_some() {
            side_by_side(&format!("plane strain, four side by side: stress and tangent, {name}"), law);
        }
        kernel::<2, Axisymmetric>(&format!("axisymmetric: stress and tangent, {name}"), law, true);
        kernel::<3, Solid>(&format!("solid: stress and tangent, {name}"), law, false);
    }
}

/// States and increments of points. The increments also stretch the third direction, for bodies of revolution.
fn states<const D: usize>(in_plane: bool) -> (Vec<StartOfStep>, Vec<Increment<D>>) {
    let mut number = numbers();
    let starts = strains(in_plane)
        .iter()
        .map(|e| StartOfStep { b_n: e.map_eigenvalues(|x| (2.0 * x).exp()), J_n: 1.0, volume_n: 1.0 })
        .collect();
    let increments = (0..N)
        .map(|_| {
            let dF = std::array::from_fn(|i| {
                std::array::from_fn(|j| f64::from(u8::from(i == j)) + 0.05 * number())
            });
            Increment { hoop: 1.02, radius: 1.0, ..Increment::flat(dF) }
        })
        .collect();
    (starts, increments)
}

fn kernel<const D: usize, M: Mechanics<D>>(name: &str, law: &dyn Material, in_plane: bool) {
    let (starts, increments) = states::<D>(in_plane);
    let old = law.initial_history();
    let mut new = old.clone();
    if M::respond_isotropic(&starts[0], &increments[0], law).is_some() {
        row(name, |p| M::respond_isotropic(&starts[p], &increments[p], law));
    } else {
        row(name, |p| M::respond(&starts[p], &increments[p], law, &old, &mut new));
    }
}

/// Points in the plane, four at a time, with the vector instructions of the machine.
struct All<'a> {
    starts: &'a [StartOfStep],
    increments: &'a [Increment<2>],
    law: &'a dyn Material,
}

impl WithSimd for All<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let mut history = vec![Lanes::ZERO; self.law.state_fields().len()];
        for (starts, increments) in self.starts.as_chunks().0.iter().zip(self.increments.as_chunks().0) {
            let [a, b, c, d] = starts;
            history.fill(Lanes::ZERO);
            black_box(PlaneStrain::respond_vectorised([a, b, c, d], increments, self.law, &mut history));
        }
    }
}

fn side_by_side(name: &str, law: &dyn Material) {
    let (starts, increments) = states::<2>(true);
    let seconds = least(|| {
        for _ in 0..TIMES {
            Arch::new().dispatch(All { starts: &starts, increments: &increments, law });
        }
    });
    println!("| {name} | {:.1} |", seconds * 1e9 / (N * TIMES) as f64);
}
