//! Tests of regions against closed forms, sampling and each other.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::surface::tests::torus;
use super::vector::{dot, minus};
use super::*;
use crate::grid::{Grid, Structured};
use crate::ranks::Ranks;

/// Pseudo-random numbers (splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Uniform between two numbers.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn inside<const D: usize>(&mut self, bounds: &Bounds<D>) -> [f64; D] {
        std::array::from_fn(|d| self.between(bounds[0][d], bounds[1][d]))
    }
}

fn brick<const D: usize>(min: [f64; D], max: [f64; D]) -> Region<D> {
    Brick::new(min, max).unwrap().into()
}

fn ball<const D: usize>(center: [f64; D], radius: f64) -> Region<D> {
    Ball::new(center, radius).unwrap().into()
}

fn cylinder(start: [f64; 3], end: [f64; 3], radius: f64) -> Region<3> {
    Frustum::cylinder(start, end, radius).unwrap().into()
}

fn polygon(corners: &[[f64; 2]]) -> Polygon {
    Polygon::new(corners.to_vec()).unwrap()
}

/// A polygon with a notch; its area is 2.5.
fn notched() -> Polygon {
    polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]])
}

fn union<const D: usize>(parts: &[Region<D>]) -> Region<D> {
    Region::union(parts.to_vec()).unwrap()
}

fn intersection<const D: usize>(parts: &[Region<D>]) -> Region<D> {
    Region::intersection(parts.to_vec()).unwrap()
}

fn volume<const D: usize>(region: &Region<D>) -> Volume {
    region.volume(Accuracy::default()).unwrap()
}

fn closed_form<const D: usize>(region: &Region<D>) -> f64 {
    let Volume { value, error } = volume(region);
    assert_eq!(error, 0.0);
    value
}

fn near(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance
}

fn number() -> impl Strategy<Value = f64> {
    -1.0..1.0f64
}

fn position<const D: usize>() -> impl Strategy<Value = [f64; D]> {
    proptest::array::uniform(number())
}

fn motion() -> impl Strategy<Value = Motion<3>> {
    (position(), -3.0..3.0f64, position::<3>(), position(), 0.5..1.5f64).prop_filter_map(
        "an axis without length",
        |(axis, angle, center, shift, scale)| {
            let turned = Motion::<3>::rotation(axis, angle, center).ok()?;
            Some(turned.then(&Motion::scaling(scale, center).ok()?).then(&Motion::translation(shift).ok()?))
        },
    )
}

fn primitive() -> impl Strategy<Value = Region<3>> {
    let size = || 0.2..1.0f64;
    prop_oneof![
        (position(), proptest::array::uniform3(size()))
            .prop_map(|(min, side)| brick(min, std::array::from_fn(|d| min[d] + side[d]))),
        (position(), size()).prop_map(|(center, radius)| ball(center, radius)),
        (position(), size(), size()).prop_map(|(center, inner, thickness)| HollowBall::new(
            center,
            inner,
            inner + thickness
        )
        .unwrap()
        .into()),
        (position(), position(), proptest::array::uniform2(0.0..1.0f64))
            .prop_filter_map("a cone without volume", |(start, end, radii)| Some(
                Frustum::new(start, end, radii).ok()?.into()
            )),
        (0..3usize, -1.0..0.0f64, size()).prop_map(|(axis, low, height)| Prism::new(
            notched(),
            axis,
            [low, low + height]
        )
        .unwrap()
        .into()),
        Just(Surface::new(&torus(0.8, 0.35, 16, 9)).unwrap().into()),
    ]
}

fn moved_primitive() -> impl Strategy<Value = Region<3>> {
    prop_oneof![primitive(), (primitive(), motion()).prop_map(|(region, motion)| region.moved(&motion))]
}

fn boolean() -> impl Strategy<Value = Region<3>> {
    moved_primitive().prop_recursive(2, 6, 3, |part| {
        let parts = || proptest::collection::vec(part.clone(), 2..4);
        prop_oneof![
            parts().prop_map(|parts| union(&parts)),
            parts().prop_map(|parts| intersection(&parts)),
            (part.clone(), parts()).prop_map(|(from, minus)| Region::difference(from, minus)),
            (part.clone(), motion()).prop_map(|(part, motion)| part.moved(&motion)),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn intervals_of_lines_agree_with_positions(
        region in boolean(), origin in position(), direction in position(), axis in 0..6usize
    ) {
        let line = if axis < 3 { Line::along_axis(origin, axis) } else { Line { origin, direction } };
        let intervals = region.intervals(&line).unwrap();
        let ends = intervals.as_slice().as_flattened();
        prop_assert!(ends.is_sorted());
        for k in 0..400 {
            let t = f64::from(k - 200) * 0.0213;
            if ends.iter().all(|end| (t - end).abs() > 1e-6) {
                prop_assert_eq!(region.contains(&line.at(t)), intervals.contains(t), "{} {:?}", t, &intervals);
            }
        }
    }

    #[test]
    fn boxes_hold_and_cover_what_they_say(region in boolean(), seed in any::<u64>()) {
        let mut random = Random(seed);
        let around = [[-3.0; 3], [3.0; 3]];
        for _ in 0..200 {
            let x = random.inside(&around);
            if region.contains(&x) {
                prop_assert!((0..3).all(|d| region.bounds()[0][d] - 1e-12 <= x[d] && x[d] <= region.bounds()[1][d] + 1e-12));
                prop_assert!(region.may_meet(&[x, x]));
            }
            let size = random.between(0.0, 2.0);
            let cell = [x, x.map(|x| x + size)];
            if region.covers(&cell) {
                for _ in 0..200 {
                    prop_assert!(region.contains(&random.inside(&cell)));
                }
            }
        }
    }

    #[test]
    fn motions_have_inverses_and_keep_angles(a in motion(), b in motion(), x in position::<3>(), y in position::<3>()) {
        let close = |p: [f64; 3], q: [f64; 3]| (0..3).all(|d| near(p[d], q[d], 1e-13));
        prop_assert!(close(a.undo(&a.apply(&x)), x) && close(a.inverse().apply(&a.apply(&x)), x));
        prop_assert!(close(a.then(&b).apply(&x), b.apply(&a.apply(&x))));
        prop_assert!(close(a.then(&a.inverse()).apply(&x), x));
        let squared = |p: [f64; 3]| dot(&p, &p);
        let stretch = squared(minus(&a.apply(&x), &a.apply(&y))) / squared(minus(&x, &y));
        prop_assert!(near(stretch.powf(1.5), a.volume_ratio(), 1e-10));
    }
}

proptest! {
    // The error bound of a volume is an estimate, so the test cases are fixed.
    #![proptest_config(ProptestConfig { cases: 20, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn volumes_of_booleans_agree_with_sampling(region in boolean(), seed in any::<u64>()) {
        let Volume { value, error } = region.volume(Accuracy { relative: 1e-3, lines: 500_000 }).unwrap();
        let bounds = region.bounds();
        let around: f64 = (0..3).map(|d| (bounds[1][d] - bounds[0][d]).max(0.0)).product();
        let mut random = Random(seed);
        let n = 40_000;
        let hits = (0..n).filter(|_| region.contains(&random.inside(&bounds))).count();
        let share = hits as f64 / f64::from(n);
        // One extra hit, so that the standard deviation of an empty sample is not zero.
        let deviation = around * ((share + 1.0 / f64::from(n)) / f64::from(n)).sqrt();
        prop_assert!(around == 0.0 || near(value, around * share, 5.0 * deviation + error),
            "{} ± {} against {} ± {}", value, error, around * share, deviation);
        prop_assert!(error <= 0.02 * value.max(0.05 * around), "{} ± {}", value, error);
    }

    #[test]
    fn union_and_intersection_have_the_volume_of_both(a in moved_primitive(), b in moved_primitive()) {
        let accuracy = Accuracy { relative: 1e-4, lines: 400_000 };
        let [union, both] = [union(&[a.clone(), b.clone()]), intersection(&[a.clone(), b.clone()])]
            .map(|region| region.volume(accuracy).unwrap());
        let less = Region::difference(a.clone(), vec![b.clone()]).volume(accuracy).unwrap();
        let (a, b) = (closed_form(&a), closed_form(&b));
        let round_off = 1e-12 * (a + b);
        prop_assert!(near(union.value + both.value, a + b, union.error + both.error + round_off));
        prop_assert!(near(less.value + both.value, a, less.error + both.error + round_off));
        for measured in [union, both, less] {
            prop_assert!(measured.error <= 1e-2 * (a + b), "{:?}", measured);
        }
    }

    #[test]
    fn quadrature_finds_the_volumes_of_primitives(region in moved_primitive()) {
        // The union of the region with a part of itself forces the general algorithm.
        let measured = union(&[region.clone(), intersection(&[region.clone(), brick([-0.5; 3], [0.5; 3])])]);
        let Volume { value, error } = measured.volume(Accuracy { relative: 1e-4, lines: 400_000 }).unwrap();
        let exact = closed_form(&region);
        prop_assert!(near(value, exact, error + 1e-12), "{} ± {} against {}", value, error, exact);
        prop_assert!(error <= 1e-2 * exact);
    }
}

#[test]
fn primitives_have_the_volumes_of_textbooks() {
    let translation = Motion::translation([3.0, -1.0, 2.0]).unwrap();
    let double = Motion::scaling(2.0, [1.0; 3]).unwrap();
    let cases: [(Region<3>, f64); 6] = [
        (brick([0.0; 3], [1.0, 2.0, 3.0]), 6.0),
        (ball([1.0; 3], 2.0), 32.0 / 3.0 * PI),
        (HollowBall::new([0.0; 3], 1.0, 2.0).unwrap().into(), 28.0 / 3.0 * PI),
        (cylinder([0.0; 3], [0.0, 3.0, 4.0], 2.0), 20.0 * PI),
        (Frustum::new([0.0; 3], [0.0, 0.0, 3.0], [1.0, 0.0]).unwrap().into(), PI),
        (Prism::new(notched(), 1, [1.0, 3.0]).unwrap().into(), 5.0),
    ];
    for (region, exact) in cases {
        assert!(near(closed_form(&region), exact, 1e-14 * exact));
        assert_eq!(closed_form(&region.clone().moved(&translation)), closed_form(&region));
        assert!(near(closed_form(&region.moved(&double)), 8.0 * exact, 1e-13 * exact));
    }
    let cases: [(Region<2>, f64); 4] = [
        (brick([0.0; 2], [1.0, 2.0]), 2.0),
        (ball([1.0; 2], 2.0), 4.0 * PI),
        (HollowBall::new([0.0; 2], 1.0, 2.0).unwrap().into(), 3.0 * PI),
        (notched().into(), 2.5),
    ];
    for (region, exact) in cases {
        let turn = Motion::<2>::rotation(0.7, [1.0, 2.0]).unwrap();
        assert!(near(closed_form(&region.moved(&turn)), exact, 1e-14 * exact));
    }
}

#[test]
fn bounds_of_turned_primitives_are_tight() {
    let turn = |axis, angle| Motion::<3>::rotation(axis, angle, [0.0; 3]).unwrap();
    let quarter = turn([0.0, 0.0, 2.0], FRAC_PI_2);
    assert_eq!(quarter.apply(&[1.0, 2.0, 3.0]), [-2.0, 1.0, 3.0]);
    assert_eq!(
        brick([0.0; 3], [1.0, 2.0, 3.0]).moved(&quarter).bounds(),
        [[-2.0, 0.0, 0.0], [0.0, 1.0, 3.0]]
    );
    // Discs extend by r times the sine of the angle between their axis and the direction.
    let tilted = cylinder([0.0; 3], [0.0, 0.0, 2.0], 1.0).moved(&turn([1.0, 0.0, 0.0], PI / 6.0));
    let (s, c) = (PI / 6.0).sin_cos();
    let expected = [[-1.0, -c - 2.0 * s, -s], [1.0, c, 2.0 * c + s]];
    for side in 0..2 {
        assert!(
            (0..3).all(|d| near(tilted.bounds()[side][d], expected[side][d], 1e-15)),
            "{:?}",
            tilted.bounds()
        );
    }
    let cone: Region<3> = Frustum::new([0.0; 3], [0.0, 0.0, 2.0], [0.5, 0.0]).unwrap().into();
    assert_eq!(cone.bounds(), [[-0.5, -0.5, 0.0], [0.5, 0.5, 2.0]]);
    let square = brick([-1.0; 2], [1.0; 2]).moved(&Motion::<2>::rotation(PI / 4.0, [0.0; 2]).unwrap());
    assert!(near(square.bounds()[1][0], 2.0f64.sqrt(), 1e-15));
    // The bounds of a rotated union enclose the bounds of its rotated parts tightly.
    let both =
        union(&[ball([0.0; 3], 1.0), ball([3.0, 0.0, 0.0], 1.0)]).moved(&turn([0.0, 0.0, 1.0], PI / 4.0));
    assert!(near(both.bounds()[1][0], 3.0 / 2.0f64.sqrt() + 1.0, 1e-15));
}

#[test]
fn booleans_have_the_volumes_of_textbooks() {
    let measured = |region: Region<3>, exact: f64, tolerance: f64| {
        let Volume { value, error } = volume(&region);
        assert!(error > 0.0 && error <= tolerance * exact, "{value} ± {error}");
        assert!(near(value, exact, error), "{value} ± {error} against {exact}");
    };
    let (x, y, z) = ([3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]);
    let through = |a: [f64; 3]| cylinder(a.map(|x| -x), a, 1.0);
    measured(intersection(&[through(x), through(y)]), 16.0 / 3.0, 2e-6);
    measured(intersection(&[through(y), through(z)]), 16.0 / 3.0, 2e-6);
    measured(intersection(&[through(x), through(y), through(z)]), 8.0 * (2.0 - 2.0f64.sqrt()), 2e-6);
    // Two unit balls with centres d apart share the volume π (4 + d)(2 − d)² / 12.
    let lens = |d: f64| PI * (4.0 + d) * (2.0 - d).powi(2) / 12.0;
    for d in [0.1, 1.0, 1.9] {
        let at = [0.6 * d, 0.0, 0.8 * d];
        measured(intersection(&[ball([0.0; 3], 1.0), ball(at, 1.0)]), lens(d), 2e-6);
        measured(union(&[ball([0.0; 3], 1.0), ball(at, 1.0)]), 8.0 / 3.0 * PI - lens(d), 2e-6);
    }
    // A spherical cap of height h has the volume π h² (3 r − h) / 3; a spherical ring of height h, whatever the radius
    // of the ball, π h³ / 6.
    measured(
        intersection(&[ball([0.0; 3], 1.0), brick([-2.0, -2.0, 0.7], [2.0; 3])]),
        PI * 0.09 * 2.7 / 3.0,
        2e-6,
    );
    let radius = (4.0f64 - 0.25).sqrt();
    let ring = Region::difference(ball([0.0; 3], 2.0), vec![cylinder([0.0, 0.0, -3.0], z, radius)]);
    measured(ring, PI / 6.0, 2e-6);
    // A square and its copy rotated by 45° share an octagon.
    let turn = Motion::<3>::rotation(x, PI / 4.0, [0.0; 3]).unwrap();
    let cube = brick([-0.5; 3], [0.5; 3]);
    measured(intersection(&[cube.clone(), cube.moved(&turn)]), 2.0 * (2.0f64.sqrt() - 1.0), 2e-6);
}

#[test]
fn booleans_in_the_plane() {
    let turn = Motion::<2>::rotation(PI / 4.0, [0.0; 2]).unwrap();
    let square = brick([-0.5; 2], [0.5; 2]);
    let octagon = volume(&intersection(&[square.clone(), square.moved(&turn)]));
    assert!(near(octagon.value, 2.0 * (2.0f64.sqrt() - 1.0), octagon.error) && octagon.error < 1e-6);
    let (d, r) = (0.7f64, 1.0f64);
    let lens = 2.0 * r * r * (d / (2.0 * r)).acos() - 0.5 * d * (4.0 * r * r - d * d).sqrt();
    let both = volume(&intersection(&[ball([0.0; 2], r), ball([0.0, d], r)]));
    assert!(near(both.value, lens, both.error) && both.error < 2e-6, "{both:?}");
    let cut = Region::difference(notched().into(), vec![brick([1.0, -1.0], [4.0; 2])]);
    let Volume { value, error } = volume(&cut);
    assert!(near(value, 1.25, error) && error < 1e-12, "{value} ± {error}");
}

#[test]
fn booleans_that_need_no_quadrature_are_exact() {
    let plate = brick([0.0; 3], [4.0, 4.0, 1.0]);
    let hole = |x: f64, y: f64| cylinder([x, y, 0.25], [x, y, 0.75], 0.25);
    let holes = vec![hole(1.0, 1.0), hole(3.0, 3.0), hole(9.0, 9.0)];
    let perforated = Region::difference(plate.clone(), holes);
    assert!(near(closed_form(&perforated), 16.0 - PI / 16.0, 1e-13));
    let apart = union(&[plate.clone(), ball([9.0; 3], 1.0), brick([0.0, 0.0, 1.0], [1.0, 1.0, 2.0])]);
    assert!(near(closed_form(&apart), 17.0 + 4.0 / 3.0 * PI, 1e-13));
    assert_eq!(closed_form(&union(&[hole(1.0, 1.0), plate.clone(), plate.clone()])), 16.0);
    assert_eq!(closed_form(&intersection(&[plate.clone(), brick([-1.0; 3], [0.5; 3])])), 0.125);
    assert_eq!(closed_form(&intersection(&[ball([1.0, 1.0, 0.5], 0.5), plate.clone()])), PI / 6.0);
    assert_eq!(closed_form(&intersection(&[plate.clone(), ball([9.0; 3], 1.0)])), 0.0);
    assert_eq!(closed_form(&Region::difference(hole(1.0, 1.0), vec![plate])), 0.0);
}

#[test]
fn an_accuracy_that_is_out_of_reach_is_reported() {
    let tilted =
        brick([0.0; 3], [1.0; 3]).moved(&Motion::<3>::rotation([1.0, 2.0, 3.0], 1.0, [0.0; 3]).unwrap());
    let cut = intersection(&[tilted, ball([0.5; 3], 0.7)]);
    let reference = volume(&cut);
    let rough = cut.volume(Accuracy { relative: 1e-9, lines: 5_000 }).unwrap();
    assert!(
        rough.error > 1e-9 * rough.value && near(rough.value, reference.value, rough.error + reference.error)
    );
}

#[test]
fn numbers_that_are_no_shapes() {
    use ShapeError::{Corners, NoAxis, NoParts, NotFinite, NotPositive, SelfCrossing};
    assert!(matches!(Brick::new([0.0; 2], [1.0, 0.0]), Err(NotPositive { .. })));
    assert!(matches!(Brick::new([f64::NAN; 2], [1.0; 2]), Err(NotFinite { .. })));
    assert!(matches!(Ball::new([0.0; 3], -1.0), Err(NotPositive { value, .. }) if value == -1.0));
    assert!(matches!(HollowBall::new([0.0; 3], 1.0, 1.0), Err(NotPositive { .. })));
    assert!(matches!(Frustum::new([0.0; 3], [0.0; 3], [1.0; 2]), Err(NotPositive { .. })));
    assert!(matches!(Frustum::new([0.0; 3], [1.0; 3], [0.0; 2]), Err(NotPositive { .. })));
    assert!(matches!(Frustum::new([0.0; 3], [1.0; 3], [2.0, -1.0]), Err(NotPositive { .. })));
    assert!(matches!(Polygon::new(vec![[0.0; 2]; 2]), Err(Corners { corners: 2 })));
    assert!(matches!(Prism::new(notched(), 3, [0.0, 1.0]), Err(NoAxis { axis: 3 })));
    assert!(matches!(Prism::new(notched(), 2, [1.0, 0.0]), Err(NotPositive { .. })));
    assert!(matches!(Region::<3>::union(vec![]), Err(NoParts)));
    assert!(matches!(Motion::<3>::rotation([0.0; 3], 1.0, [0.0; 3]), Err(NotPositive { .. })));
    assert!(matches!(Motion::<2>::rotation(f64::INFINITY, [0.0; 2]), Err(NotFinite { .. })));
    assert!(matches!(Motion::<3>::scaling(0.0, [0.0; 3]), Err(NotPositive { .. })));
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let crossed = |corners: &[[f64; 2]]| match Polygon::new(corners.to_vec()) {
        Err(SelfCrossing { sides }) => Some(sides),
        _ => None,
    };
    assert_eq!(crossed(&square), None);
    assert_eq!(crossed(&[square[0], square[2], square[1], square[3]]), Some([0, 2]));
    assert_eq!(crossed(&[square[0], square[1], square[2], [0.5, 0.0], square[3]]), Some([0, 3]));
    assert_eq!(crossed(&[square[0], square[1], square[2], [0.5, 0.1], square[3]]), None);
    assert_eq!(crossed(&[square[0], square[1], square[1], square[2]]), Some([0, 1]));
    assert_eq!(crossed(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]), Some([0, 2]));
}

#[test]
fn a_position_is_in_one_part_of_a_divided_polygon() {
    let (corner, middle) = ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [0.3, 0.4]);
    let parts = [0, 1, 2, 3].map(|k| polygon(&[corner[k], corner[(k + 1) % 4], middle]));
    for k in 0..100 {
        let x = [f64::from(k % 10) * 0.1, f64::from(k / 10) * 0.1];
        let holders = parts.iter().filter(|part| part.contains(&x)).count();
        assert!(holders == 1 || (holders == 0 && x.contains(&0.0)), "{x:?}");
    }
    assert_eq!(parts.iter().filter(|part| part.contains(&middle)).count(), 1);
}

/// The parts of a grid with their centres in a region.
fn filled<const D: usize>(
    region: &Region<D>,
    grid: &Structured<D>,
    per_cell: [usize; D],
    groups: &[Vec<bool>],
) -> Filled<CellPart<D>> {
    let divide = |cell: usize| Ok::<_, ()>(brick_parts(grid, per_cell, cell));
    fill(
        region,
        grid,
        |key, cell| groups[key][cell],
        divide,
        |part: &CellPart<D>| part.position,
        &Ranks::default(),
    )
    .unwrap()
}

fn sum_of_parts<const D: usize>(filled: &Filled<CellPart<D>>) -> f64 {
    filled.parts.iter().map(|part| part.volume).sum()
}

#[test]
fn a_box_on_grid_lines_is_filled_exactly() {
    let grid = Structured::new([0.0; 3], [0.25; 3], [8, 6, 4]);
    let block = filled(&brick([0.0, 0.0, 0.0], [1.0, 1.5, 0.5]), &grid, [3, 2, 1], &[]);
    assert_eq!(block.parts.len(), 4 * 6 * 2 * 6);
    assert!(near(sum_of_parts(&block), 0.75, 1e-14));
    assert_eq!(block.cells.iter().filter(|filled| filled.full).count(), 4 * 6 * 2);
    for FilledCell { cell, parts, .. } in &block.cells {
        let located = |part: &CellPart<3>| grid.locate(&part.position, None);
        assert!(block.parts[parts.clone()].iter().all(|part| located(part) == Some(*cell)));
    }
    let first = block.parts[0].position;
    assert!(
        near(first[0], 0.25 / 6.0, 1e-16) && near(first[1], 0.0625, 1e-16) && near(first[2], 0.125, 1e-16)
    );
}

#[test]
fn the_volume_of_points_tends_to_that_of_the_region() {
    let tilt = Motion::<3>::rotation([1.0, 2.0, 0.5], 0.6, [1.0; 3]).unwrap();
    let can = Region::difference(
        cylinder([1.0, 1.0, 0.4], [1.0, 1.0, 1.6], 0.6),
        vec![cylinder([1.0, 1.0, 0.6], [1.0, 1.0, 1.4], 0.4)],
    )
    .moved(&tilt);
    for (n, bound) in [(5usize, 8e-2), (10, 2e-2), (20, 5e-3)] {
        let grid = Structured::new([0.0; 3], [2.0 / n as f64; 3], [n; 3]);
        let filled = filled(&can, &grid, [2; 3], &[]);
        let exact = can.volume(Accuracy::default()).unwrap();
        assert!(near(exact.value, PI * (0.36 * 1.2 - 0.16 * 0.8), 1e-5 + exact.error));
        let excess = sum_of_parts(&filled) / exact.value - 1.0;
        assert!(excess.abs() < bound, "{n}: {excess}");
        assert!(filled.parts.iter().all(|part| can.contains(&part.position)));
    }
}

#[test]
fn groups_of_cells_are_parts_of_regions() {
    let grid = Structured::new([0.0; 2], [1.0; 2], [4, 2]);
    let left: Vec<bool> = (0..8).map(|cell| cell % 4 < 2).collect();
    let group = Region::group(Group { key: 0, bounds: [[0.0; 2], [2.0; 2]], volume: 4.0 });
    let whole = filled(&group, &grid, [2, 2], std::slice::from_ref(&left));
    assert_eq!((whole.parts.len(), sum_of_parts(&whole)), (16, 4.0));
    let moved = group.clone().moved(&Motion::translation([2.0, 0.0]).unwrap());
    let right = filled(&moved, &grid, [2, 2], std::slice::from_ref(&left));
    assert!(right.parts.len() == 16 && right.parts.iter().all(|part| part.position[0] > 2.0));
    let holed = Region::difference(group.clone(), vec![brick([0.5; 2], [1.5; 2])]);
    assert_eq!(holed.volume(Accuracy::default()), None);
    assert_eq!(filled(&holed, &grid, [2, 2], std::slice::from_ref(&left)).parts.len(), 12);
    assert!(group.intervals(&Line::along_axis([0.0; 2], 0)).is_none() && !group.contains(&[1.0; 2]));
    let apart = union(&[group, brick([3.0, 0.0], [4.0, 1.0])]);
    assert_eq!(closed_form(&apart), 5.0);
}

#[test]
fn facets_of_rectangles_integrate_bilinear_functions_exactly() {
    let facets = brick([0.0; 3], [2.0, 3.0, 1.0]).boundary(0.7).unwrap();
    let mean = |facet: &Facet<3>| facet.corners.iter().map(|x| x[0] * x[1]).sum::<f64>() / 3.0;
    let top = facets.iter().filter(|facet| facet.corners.iter().all(|x| x[2] == 1.0));
    let integral: f64 = top.map(|facet| area_vector(&facet.corners)[2] * mean(facet)).sum();
    assert!(near(integral, 9.0, 1e-14), "{integral}");
}

#[test]
fn facets_are_cut_where_a_function_changes_its_sign() {
    let segment = Facet { corners: [[0.0, 0.0], [4.0, 0.0]], side: 2 };
    let kept = segment.above(|x| x[0] - 1.0, 1e-9);
    assert_eq!(kept, [Facet { corners: [[1.0, 0.0], [4.0, 0.0]], side: 2 }]);
    let kept = segment.above(|x| 3.0 - x[0], 1e-9);
    assert_eq!(kept, [Facet { corners: [[0.0, 0.0], [3.0, 0.0]], side: 2 }]);
    assert_eq!(segment.above(|x| x[0] + 1e-12, 1e-9), [segment]);
    assert_eq!(segment.above(|x| x[0] - 4.0, 1e-9), []);
    let triangle = Facet { corners: [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]], side: 0 };
    for (height, area) in [
        (Box::new(|x: &[f64; 3]| x[0] - 1.0) as Box<dyn Fn(&[f64; 3]) -> f64>, 0.5),
        (Box::new(|x: &[f64; 3]| 1.0 - x[0]), 1.5),
        (Box::new(|x: &[f64; 3]| x[0] - x[1]), 1.0),
        (Box::new(|x: &[f64; 3]| x[2] + 1.0), 2.0),
    ] {
        let kept = triangle.above(height, 1e-9);
        let areas: Vec<[f64; 3]> = kept.iter().map(|facet| area_vector(&facet.corners)).collect();
        assert!(
            near(areas.iter().map(|a| a[2]).sum(), area, 1e-14) && areas.iter().all(|a| a[2] > 0.0),
            "{kept:?}"
        );
    }
}
