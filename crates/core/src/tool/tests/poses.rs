//! Poses, increments and their derivatives.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::region::tests::Random;
use crate::region::vector::{along, dot, minus, norm, unit};

fn random_pose<const D: usize>(random: &mut Random) -> Pose<D> {
    Pose::new(random.inside(&[[-3.0; D], [3.0; D]]), random.inside(&[[-1.7; 3], [1.7; 3]])).unwrap()
}

fn orthogonality_error<const D: usize>(pose: &Pose<D>) -> f64 {
    let r = pose.rotation();
    let product = |i: usize, j: usize| (dot(&r[i], &r[j]) - unit::<D>(i)[j]).abs();
    (0..D).flat_map(|i| (0..D).map(move |j| (i, j))).map(|(i, j)| product(i, j)).fold(0.0, f64::max)
}

#[test]
fn positions_and_vectors_are_mapped_both_ways() {
    fn check<const D: usize>(random: &mut Random) {
        let pose = random_pose::<D>(random);
        let x = random.inside(&[[-2.0; D], [2.0; D]]);
        assert!(norm(&minus(&pose.to_tool(&pose.to_space(&x)), &x)) < 1e-14);
        assert!(norm(&minus(&pose.vector_to_tool(&pose.vector_to_space(&x)), &x)) < 1e-14);
        let rotation = pose.rotation_vector();
        let again = Pose::new(pose.position(), rotation).unwrap();
        assert!(norm(&minus(&again.to_space(&x), &pose.to_space(&x))) < 1e-13, "{rotation:?}");
        assert!(orthogonality_error(&pose) < 1e-15);
    }
    let mut random = Random(11);
    for _ in 0..200 {
        check::<2>(&mut random);
        check::<3>(&mut random);
    }
    let quarter = Pose::new([1.0, 2.0], [9.0, 9.0, FRAC_PI_2]).unwrap();
    assert!(norm(&minus(&quarter.to_space(&[1.0, 0.0]), &[1.0, 3.0])) < 1e-15);
    assert_eq!(quarter.rotation_vector(), [0.0, 0.0, FRAC_PI_2]);
    let turned = Pose::new([0.0; 3], [0.0, PI, 0.0]).unwrap();
    assert!(norm(&minus(&turned.to_space(&[1.0, 2.0, 3.0]), &[-1.0, 2.0, -3.0])) < 1e-14);
    assert!((norm(&turned.rotation_vector()) - PI).abs() < 1e-14);
}

#[test]
fn many_increments_add_up() {
    // 1000.25 turns in increments of 1/100 turn, about an axis in space and in the plane.
    let axis = [2.0, -1.0, 2.0].map(|x| x / 3.0);
    let step = Increment { translation: [0.01, 0.0, 0.0], rotation: axis.map(|x| 0.02 * PI * x) };
    let flat = Increment { translation: [0.01, 0.0], rotation: [0.0, 0.0, 0.02 * PI] };
    let (mut pose, mut plane) =
        (Pose::new([0.0; 3], [0.0; 3]).unwrap(), Pose::new([0.0; 2], [0.0; 3]).unwrap());
    for _ in 0..100_025 {
        (pose, plane) = (pose.moved(&step), plane.moved(&flat));
    }
    assert!(orthogonality_error(&pose) < 1e-15 && orthogonality_error(&plane) < 1e-15);
    let angle = dot(&pose.rotation_vector(), &axis);
    assert!((angle - FRAC_PI_2).abs() < 1e-9, "{angle}");
    assert!((plane.rotation_vector()[2] / (2000.5 * PI) - 1.0).abs() < 1e-10, "turns are counted");
    assert!((pose.position()[0] - 1000.25).abs() < 1e-6);
}

#[test]
fn a_motion_carries_positions_as_the_pose_does() {
    let mut random = Random(5);
    for _ in 0..100 {
        let start = random_pose::<3>(&mut random);
        let increment = Increment {
            translation: random.inside(&[[-1.0; 3], [1.0; 3]]),
            rotation: random.inside(&[[-1.5; 3], [1.5; 3]]),
        };
        let x = random.inside(&[[-2.0; 3], [2.0; 3]]);
        let carried = increment.carry(&start, &start.to_space(&x));
        assert!(norm(&minus(&carried, &start.moved(&increment).to_space(&x))) < 1e-13);
        let moved = along(&start.to_space(&x), 1.0, &increment.displacement(&start, &start.to_space(&x)));
        assert!(norm(&minus(&moved, &carried)) < 1e-14);
    }
}

/// Compares the derivatives of the motion and of the gap with finite differences.
fn check_derivatives<const D: usize>(shape: &dyn Shape<D>, size_of_turn: f64, random: &mut Random) -> bool {
    let start = random_pose::<D>(random);
    let turn = size_of_turn;
    let increment = Increment {
        translation: random.inside(&[[-1.0; D], [1.0; D]]),
        rotation: random.inside(&[[-turn; 3], [turn; 3]]),
    };
    let x = random.inside(&[[-4.0; D], [4.0; D]]);
    let h = 1e-5;
    let turned =
        |k: usize, t: f64| Increment { rotation: along(&increment.rotation, t, &unit(k)), ..increment };
    let shifted =
        |k: usize, t: f64| Increment { translation: along(&increment.translation, t, &unit(k)), ..increment };
    let derivative = increment.carry_derivative(&start, &x);
    for k in 0..3 {
        let rate =
            minus(&turned(k, h).carry(&start, &x), &turned(k, -h).carry(&start, &x)).map(|x| x / (2.0 * h));
        assert!(norm(&minus(&rate, &derivative[k])) < 1e-8, "{increment:?} {rate:?} {derivative:?}");
    }
    let found = |increment: &Increment<D>| {
        let pose = start.moved(increment);
        (pose.closest(shape, x, f64::INFINITY).unwrap(), pose.position())
    };
    let (closest, reference) = found(&increment);
    let (by_shift, by_turn) = increment.gap_derivative(&closest, &reference);
    let rate = |above: Increment<D>, below: Increment<D>| {
        let (above, below) = (found(&above).0, found(&below).0);
        let is_smooth = norm(&minus(&above.normal, &below.normal)) < 1e-2;
        is_smooth.then_some((above.gap - below.gap) / (2.0 * h))
    };
    let shifts = (0..D).map(|k| (rate(shifted(k, h), shifted(k, -h)), by_shift[k]));
    let turns = (0..3).map(|k| (rate(turned(k, h), turned(k, -h)), by_turn[k]));
    shifts.chain(turns).all(|(rate, exact)| match rate {
        Some(rate) => {
            assert!((rate - exact).abs() < 1e-7, "{increment:?} {rate} {exact}");
            true
        }
        None => false,
    })
}

#[test]
fn derivatives_with_respect_to_the_motion_are_exact_for_finite_rotations() {
    let mut random = Random(2);
    let polygon = ClosedPolygon::new(notched()).unwrap();
    let cone = Frustum::new([0.0; 3], [0.0, 1.0, 1.0], [1.0, 0.3]).unwrap();
    let mut smooth = 0;
    for turn in [0.0, 1e-9, 1e-3, 0.28, 0.3, 1.0, 3.0] {
        for _ in 0..50 {
            smooth += usize::from(check_derivatives(&polygon, turn, &mut random));
            smooth += usize::from(check_derivatives(&cone, turn, &mut random));
        }
    }
    assert!(smooth > 650, "{smooth}");
}
