//! The means of cells open no hourglass mode: eigenvalues of the stiffness of random clusters of points.

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::model::StabilisationMode;
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, CellStrain, Mechanics, PlaneStrain, Solid};
use mpm::tensor::{Mat3, Sym3};
use mpm::terms::Sum;
use nalgebra::DMatrix;

use super::states::{Law, State, random_state};

/// Eigenvalues below this fraction of the largest count as zero.
const ZERO: f64 = 1e-11;

/// Ascending eigenvalues of the stiffness at rest.
fn eigenvalues<const D: usize, M: Mechanics<D>>(state: &mut State<D>, volumetric: CellStrain) -> Vec<f64> {
    let State { model, points, links, .. } = state;
    model.bodies.iter_mut().for_each(|body| body.strain = volumetric);
    points.converged.elastic_strain.fill(Sym3::ZERO);
    points.converged.deformation_gradient.fill(Mat3::identity());
    let context = StepContext::first(model, links);
    let mut sum = Sum::<D>::from_model::<M>(&context, points).unwrap();
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

/// Eigenvalues below this fraction of the largest are weak: they belong to nodes that only the corners of a few domains
/// touch.
const WEAK: f64 = 1e-5;

/// Over random clusters of points: the smallest ratio of an eigenvalue of the stiffness with a mean of cells to the
/// eigenvalue with the standard method, first over all non-zero eigenvalues, then over those that are not weak. Both
/// stiffnesses have the same number of zero eigenvalues, unless `may_lose`.
fn worst_ratios<const D: usize, M: Mechanics<D>>(
    strain: CellStrain,
    (method, mode): (Method, StabilisationMode),
    n_points: usize,
    may_lose: bool,
) -> [f64; 2] {
    let mut worst = [f64::INFINITY; 2];
    for seed in 0..12 {
        let mut state = random_state::<D, M>(method, Law::Hencky, n_points, 300 + seed);
        state.model.stabilisation.mode = mode;
        let [standard, averaged] =
            [CellStrain::Standard, strain].map(|volumetric| eigenvalues::<D, M>(&mut state, volumetric));
        let largest = standard[standard.len() - 1];
        let zeros = |values: &[f64]| values.iter().filter(|value| **value < ZERO * largest).count();
        assert!(may_lose || zeros(&standard) == zeros(&averaged), "{method:?} {mode:?} {n_points} {seed}");
        for (standard, averaged) in standard.iter().zip(&averaged) {
            // The square of the mean does not exceed the mean of squares.
            assert!(*averaged < standard + 1e-12 * largest, "{method:?} {mode:?} {n_points} {seed}");
            for (worst, least) in worst.iter_mut().zip([ZERO, WEAK]) {
                if *standard >= least * largest {
                    *worst = worst.min(averaged / standard);
                }
            }
        }
    }
    worst
}

/// The smallest ratios over problems in the plane, of revolution and in space.
fn smallest_ratios(
    strain: CellStrain,
    (method, mode): (Method, StabilisationMode),
    may_lose: bool,
) -> [f64; 2] {
    let case = (method, mode);
    let plane = [60, 120, 270].map(|n| worst_ratios::<2, PlaneStrain>(strain, case, n, may_lose));
    let revolved = [60, 120, 270].map(|n| worst_ratios::<2, Axisymmetric>(strain, case, n, may_lose));
    let space = [72, 144].map(|n| worst_ratios::<3, Solid>(strain, case, n, may_lose));
    let least = |k: usize| plane.iter().chain(&revolved).chain(&space).map(|r| r[k]).fold(1.0, f64::min);
    println!(
        "{strain:?} {method:?} {mode:?}: {:.3} of all, {:.3} of those that are not weak",
        least(0),
        least(1)
    );
    [least(0), least(1)]
}

/// The deviator at each point resists all motions that the whole strain resists, even if a cell holds only one or two
/// points. Without stabilisation, random domains with corners leave weak nodes, at which one more mode may meet no
/// resistance.
#[test]
fn the_mean_dilatation_opens_no_hourglass_mode() {
    let dilatation = CellStrain::MeanDilatation;
    for method in [Method::Mpm, Method::Gimp] {
        let [least, _] = smallest_ratios(dilatation, (method, StabilisationMode::Off), false);
        assert!(least > 0.1, "{method:?}: {least}");
    }
    let [_, least] = smallest_ratios(dilatation, (Method::Cpdi2, StabilisationMode::Off), true);
    assert!(least > 0.05, "{least}");
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        let [least, _] = smallest_ratios(dilatation, (method, StabilisationMode::On), false);
        assert!(least > 0.25, "{method:?} stabilised: {least}");
    }
}

/// The stress against deviations resists the same motions as the deviator at each point.
#[test]
fn the_mean_increment_opens_no_hourglass_mode() {
    for method in [Method::Mpm, Method::Gimp] {
        let [least, _] = smallest_ratios(CellStrain::Mean, (method, StabilisationMode::Off), false);
        assert!(least > 0.01, "{method:?}: {least}");
    }
    let [_, least] = smallest_ratios(CellStrain::Mean, (Method::Cpdi2, StabilisationMode::Off), true);
    assert!(least > 0.005, "{least}");
}
