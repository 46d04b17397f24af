//! Properties that must hold for every shape.

use crate::region::tests::Random;
use crate::region::vector::{along, dot, minus, norm, unit};
use crate::region::{Bounds, area_vector};
use crate::tool::{Closest, Pose, Shape, first_contact};

/// Parameters of the checks.
pub(super) struct Check<const D: usize> {
    /// Box in which the positions lie.
    pub(super) within: Bounds<D>,
    /// True if the depth equals the distance from the surface even inside the shape.
    pub(super) depth_is_distance: bool,
    pub(super) positions: usize,
}

impl<const D: usize> Default for Check<D> {
    fn default() -> Self {
        Check { within: [[-1.0; D], [1.0; D]], depth_is_distance: true, positions: 1000 }
    }
}

impl<const D: usize> Check<D> {
    /// Positions in the bounds of a shape, extended on all sides.
    pub(super) fn around(shape: &dyn Shape<D>) -> Self {
        let [low, high] = shape.bounds();
        let wider = |x: f64, d: usize| x + 0.4 * (high[d] - low[d]);
        let within = [
            std::array::from_fn(|d| low[d] - (wider(high[d], d) - high[d])),
            std::array::from_fn(|d| wider(high[d], d)),
        ];
        Check { within, ..Check::default() }
    }

    fn size(&self) -> f64 {
        norm(&minus(&self.within[1], &self.within[0]))
    }
}

/// Checks a shape against an independent test of containment.
pub(super) fn check<const D: usize>(
    shape: &dyn Shape<D>,
    inside: &dyn Fn(&[f64; D]) -> bool,
    what: Check<D>,
) {
    let mut random = Random(7);
    let (mut smooth_normals, mut smooth_derivatives) = (0, 0);
    for _ in 0..what.positions {
        let x = random.inside(&what.within);
        let found = shape.closest(x).unwrap();
        assert_eq!(found.gap < 0.0, inside(&x), "{x:?} {found:?}");
        check_point(shape, inside, &x, &found, &what, &mut random, what.size());
        if found.gap > 0.0 || what.depth_is_distance {
            check_that_nothing_is_closer(inside, &x, &found, &mut random);
        }
        check_limits(shape, x, &found);
        let [normal, derivative] = check_derivatives(shape, &x, &found, what.size());
        smooth_normals += usize::from(normal);
        smooth_derivatives += usize::from(derivative);
        check_pose(shape, &x, &found, &mut random);
        check_path(shape, inside, [x, random.inside(&what.within)]);
    }
    assert!(smooth_normals * 10 > what.positions * 9, "{smooth_normals}");
    assert!(smooth_derivatives * 10 > what.positions * 9, "{smooth_derivatives}");
    if let Ok(outline) = shape.outline(0.05 * what.size()) {
        for (facet, part) in outline.facets.iter().zip(&outline.parts) {
            let corners = facet.map(|corner| outline.vertices[corner as usize]);
            let centre = std::array::from_fn(|d| corners.iter().map(|x| x[d]).sum::<f64>() / D as f64);
            let found = shape.closest(centre).unwrap();
            assert!(found.gap.abs() < 0.01 * what.size(), "{centre:?} {found:?}");
            let gaps = corners.map(|x| shape.closest(x).unwrap().gap / what.size());
            assert!(
                gaps.iter().all(|gap| gap.abs() < 1e-12) || !what.depth_is_distance,
                "{corners:?} {gaps:?}"
            );
            assert!(dot(&area_vector(&corners), &found.normal) > 0.0, "{corners:?} {found:?}");
            // The chords around a bend of a wall belong to both of its segments.
            let apart = found.part.abs_diff(*part);
            assert!(apart == 0 || apart == 1 && !what.depth_is_distance, "{centre:?} {found:?}");
        }
    }
}

/// Checks that the closest point lies on the surface, at the distance |gap| along the normal.
fn check_point<const D: usize>(
    shape: &dyn Shape<D>,
    inside: &dyn Fn(&[f64; D]) -> bool,
    x: &[f64; D],
    found: &Closest<D>,
    Check { depth_is_distance, .. }: &Check<D>,
    random: &mut Random,
    size: f64,
) {
    assert!((norm(&found.normal) - 1.0).abs() < 1e-12);
    let reached = along(&found.point, found.gap, &found.normal);
    assert!(norm(&minus(&reached, x)) < 1e-12 * size, "{x:?} {found:?}");
    let [out, within] = [1e-7, -1e-7].map(|t| along(&found.point, t * size, &found.normal));
    if found.gap > 0.0 {
        assert!(!inside(&out), "{x:?} {found:?}");
    }
    if found.gap < 0.0 {
        assert!(inside(&within), "{x:?} {found:?}");
    }
    if found.gap > 0.0 || *depth_is_distance {
        // The surface passes within round-off of the point: positions on the other side occur near it, though at sharp
        // tips only in a few directions.
        let mut near =
            (0..5000).map(|_| along(&found.point, 1e-9 * size, &random.inside(&[[-1.0; D], [1.0; D]])));
        assert!(near.any(|near| inside(&near) != inside(x)), "{x:?} {found:?}");
        assert!(shape.closest(found.point).unwrap().gap.abs() < 1e-12 * size);
    }
}

/// Checks that no position closer than |gap| lies on the other side of the surface.
fn check_that_nothing_is_closer<const D: usize>(
    inside: &dyn Fn(&[f64; D]) -> bool,
    x: &[f64; D],
    found: &Closest<D>,
    random: &mut Random,
) {
    for _ in 0..50 {
        let direction: [f64; D] = random.inside(&[[-1.0; D], [1.0; D]]);
        let step = found.gap.abs() * (1.0 - 1e-9) / norm(&direction);
        let near = along(x, step, &direction);
        assert_eq!(inside(&near), inside(x), "{x:?} {near:?} {found:?}");
    }
}

fn check_limits<const D: usize>(shape: &dyn Shape<D>, x: [f64; D], found: &Closest<D>) {
    let gap = found.gap.abs();
    assert_eq!(shape.closest_within(x, 1.0001 * gap), Some(*found));
    assert_eq!(shape.closest_within(x, 0.9999 * gap), None);
}

/// Compares the normal and its derivative with finite differences; false if a kink is near.
fn check_derivatives<const D: usize>(
    shape: &dyn Shape<D>,
    x: &[f64; D],
    found: &Closest<D>,
    size: f64,
) -> [bool; 2] {
    let h = 1e-6 * size;
    let difference = |a: &[[f64; D]; D], b: &[[f64; D]; D]| {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let derivative = &found.normal_derivative;
    let zero = [[0.0; D]; D];
    let scale = 1.0 / size + difference(derivative, &zero);
    let mut smooth = [true; 2];
    let mut by_differences = zero;
    let mut gradient = [0.0; D];
    for d in 0..D {
        let [above, below] = [h, -h].map(|t| shape.closest(along(x, t, &unit(d))).unwrap());
        for side in [&above, &below] {
            smooth[0] &= norm(&minus(&side.normal, &found.normal)) < 1e-3;
            smooth[1] &= difference(&side.normal_derivative, derivative) < 1e-2 * scale;
        }
        gradient[d] = (above.gap - below.gap) / (2.0 * h);
        let rate = minus(&above.normal, &below.normal).map(|n| n / (2.0 * h));
        (0..D).for_each(|i| by_differences[i][d] = rate[i]);
    }
    if smooth[0] {
        assert!(norm(&minus(&gradient, &found.normal)) < 1e-6, "{x:?} {gradient:?} {found:?}");
        assert!((norm(&gradient) - 1.0).abs() < 1e-6);
    }
    smooth[1] &= smooth[0];
    if smooth[1] {
        let error = difference(derivative, &by_differences);
        assert!(error < 1e-4 * scale, "{x:?} {by_differences:?} {found:?}");
    }
    let transposed = std::array::from_fn(|i| std::array::from_fn(|j| derivative[j][i]));
    assert!(difference(derivative, &transposed) < 1e-12 * scale);
    smooth
}

fn check_pose<const D: usize>(shape: &dyn Shape<D>, x: &[f64; D], found: &Closest<D>, random: &mut Random) {
    let pose =
        Pose::new(random.inside(&[[-5.0; D], [5.0; D]]), random.inside(&[[-2.0; 3], [2.0; 3]])).unwrap();
    let in_space = pose.closest(shape, pose.to_space(x), f64::INFINITY).unwrap();
    assert!((in_space.gap - found.gap).abs() < 1e-12 * 20.0);
    // On the medial axis, round-off may change the closest part.
    if in_space.part == found.part {
        let normal = minus(&in_space.normal, &pose.vector_to_space(&found.normal));
        assert!(norm(&normal) < 1e-9 * (1.0 + 1.0 / found.gap.abs()), "{found:?} {in_space:?}");
        assert!(norm(&minus(&in_space.point, &pose.to_space(&found.point))) < 1e-9);
        for a in 0..D {
            let direction = pose.vector_to_space(&unit(a));
            let row: [f64; D] = std::array::from_fn(|i| dot(&in_space.normal_derivative[i], &direction));
            let expected = pose.vector_to_space(&found.normal_derivative.map(|row| row[a]));
            let scale = 1.0 + norm(&expected);
            assert!(norm(&minus(&row, &expected)) < 1e-6 * scale * scale, "{row:?} {expected:?}");
        }
    }
}

/// Compares the first contact with samples of containment along a path, for a fixed and for a moving tool.
fn check_path<const D: usize>(
    shape: &dyn Shape<D>,
    inside: &dyn Fn(&[f64; D]) -> bool,
    path @ [from, to]: [[f64; D]; 2],
) {
    let at = |t: f64| along(&from, t, &minus(&to, &from));
    let samples = 200;
    let changed = (1..=samples).find(|&k| inside(&at(k as f64 / samples as f64)) != inside(&from));
    let first = shape.first_contact(from, to);
    if let Some(k) = changed {
        assert!(first.is_some_and(|t| t <= k as f64 / samples as f64 + 1e-12), "{path:?} {first:?}");
    }
    if let Some(t) = first {
        let gap = shape.closest(at(t)).unwrap().gap;
        assert!(gap.abs() < 1e-9, "{path:?} {t} {gap}");
    }
    let poses = [[0.3; 3], [-0.8; 3]].map(|turn| Pose::new([0.7; D], turn).unwrap());
    let in_space = [poses[0].to_space(&from), poses[1].to_space(&to)];
    let moving = first_contact(shape, [&poses[0], &poses[1]], in_space);
    match (first, moving) {
        (Some(a), Some(b)) => assert!((a - b).abs() < 1e-6, "{a} {b}"),
        (a, b) => assert_eq!(a, b, "{path:?}"),
    }
}
