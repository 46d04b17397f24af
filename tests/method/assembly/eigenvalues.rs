//! The mean dilatation opens no hourglass mode: eigenvalues of the stiffness of random clusters of points.

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::model::StabilisationMode;
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid, Volumetric};
use mpm::tensor::{Mat3, Sym3};
use mpm::terms::Sum;
use nalgebra::DMatrix;

use super::states::{Law, State, random_state};

/// Eigenvalues below this part of the largest are zero.
const ZERO: f64 = 1e-11;

/// Ascending eigenvalues of the stiffness at rest.
fn eigenvalues<const D: usize, M: Mechanics<D>>(state: &mut State<D>, volumetric: Volumetric) -> Vec<f64> {
    let State { model, points, links, .. } = state;
    model.bodies.iter_mut().for_each(|body| body.volumetric = volumetric);
    points.converged.elastic_strain.fill(Sym3::ZERO);
    points.converged.deformation_gradient.fill(Mat3::identity());
    let context = StepContext::first(model, links);
    let mut sum = Sum::<D>::of_bodies::<M>(&context, points).unwrap();
    let rest = vec![[0.0; D]; links.n_active()];
    sum.evaluate(&context, points, At::new(&rest), Wanted::Stiffness).unwrap();
    let n = D * links.n_active();
    let mut stiffness = DMatrix::zeros(n, n);
    for k in 0..n {
        let mut unit = rest.clone();
        unit[k / D][k % D] = 1.0;
        let mut column = rest.clone();
        sum.system_mut().multiply(&unit, &mut column);
        (0..n).for_each(|a| stiffness[(a, k)] = column[a / D][a % D]);
    }
    let asymmetry = (&stiffness - stiffness.transpose()).amax() / stiffness.amax();
    assert!(asymmetry < 1e-14, "{asymmetry:e}");
    let mut values: Vec<f64> = stiffness.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Over random clusters of points: the stiffness with the mean dilatation has no more zero eigenvalues than that of the
/// standard method. Returns the smallest ratio of their smallest non-zero eigenvalues.
fn worst_ratio<const D: usize, M: Mechanics<D>>(
    method: Method,
    n_points: usize,
    mode: StabilisationMode,
) -> f64 {
    let mut worst = f64::INFINITY;
    for seed in 0..12 {
        let mut state = random_state::<D, M>(method, Law::Hencky, n_points, 300 + seed);
        state.model.stabilisation.mode = mode;
        let [standard, averaged] = [Volumetric::Standard, Volumetric::MeanDilatation]
            .map(|volumetric| eigenvalues::<D, M>(&mut state, volumetric));
        let largest = standard[standard.len() - 1];
        let zeros = |values: &[f64]| values.iter().filter(|value| **value < ZERO * largest).count();
        let [of_standard, of_averaged] = [zeros(&standard), zeros(&averaged)];
        assert_eq!(of_standard, of_averaged, "{method:?} {n_points} {seed}");
        // The mean of squares is not below the square of the mean.
        for (standard, averaged) in standard.iter().zip(&averaged) {
            assert!(*averaged < standard + 1e-12 * largest, "{method:?} {n_points} {seed}");
        }
        worst = worst.min(averaged[of_averaged] / standard[of_standard]);
    }
    worst
}

#[test]
fn the_mean_dilatation_opens_no_hourglass_mode() {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        for mode in [StabilisationMode::Off, StabilisationMode::On] {
            for n in [60, 120, 270] {
                let plane = worst_ratio::<2, PlaneStrain>(method, n, mode);
                let revolved = worst_ratio::<2, Axisymmetric>(method, n, mode);
                println!("{method:?} {mode:?} {n} points: plane {plane:.3}, axisymmetric {revolved:.3}");
            }
            for n in [72, 144] {
                let space = worst_ratio::<3, Solid>(method, n, mode);
                println!("{method:?} {mode:?} {n} points: space {space:.3}");
            }
        }
    }
}
