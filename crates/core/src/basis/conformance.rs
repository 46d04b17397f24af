//! Conformance test of all methods on all grids. A new method only needs an entry in `METHODS`.

use std::sync::LazyLock;

use super::*;
use crate::grid::element::{ElementShape, corner_side};
use crate::grid::mesh::tests::{hexahedra, mixed, tetrahedra};
use crate::grid::{Axis, Interval, Mesh, Structured};
use proptest::prelude::*;

const METHODS: [Method; 4] = [Method::Mpm, Method::Gimp, Method::Cpdi1, Method::Cpdi2];

/// Shapes of domains with corners: parallelograms (parallelepipeds) and triangles (tetrahedra).
const SHAPES: [ElementShape; 2] = [ElementShape::Box, ElementShape::Simplex];

/// Corners of a sheared domain with its centroid at the point.
fn corners<const D: usize>(shape: ElementShape, x: &[f64; D], l: &[f64; D]) -> Vec<[f64; D]> {
    let corner = |side: [f64; D]| -> [f64; D] {
        std::array::from_fn(|d| {
            let next = (d + 1) % D;
            x[d] + side[d] * l[d] + if d % 2 == 0 { 0.15 } else { -0.2 } * side[next] * l[next]
        })
    };
    match shape {
        ElementShape::Box => (0..1 << D).map(|c| corner(corner_side(c))).collect(),
        ElementShape::Simplex => (0..=D)
            .map(|c| {
                // Barycentric coordinates minus their mean, so that the point stays the centroid.
                let mean = 1.0 / (D + 1) as f64;
                corner(std::array::from_fn(|d| if d + 1 == c { 1.0 - mean } else { -mean }))
            })
            .collect(),
    }
}

fn support<const D: usize>(
    (method, shape): (Method, ElementShape),
    grid: &dyn Grid<D>,
    x: [f64; D],
    l: [f64; D],
) -> Support<D> {
    let mut out = Support::default();
    let corners = corners(shape, &x, &l);
    let cell = grid.locate(&x, None).unwrap();
    let point = PointGeometry { cell, position: &x, half_lengths: &l, corners: &corners };
    method.basis::<D>().support(grid, &point, &mut out).unwrap();
    out
}

/// Methods and the domain shapes that they support.
fn variants(grid_is_structured: bool) -> Vec<(Method, ElementShape)> {
    let fits = |method: &Method| *method != Method::Gimp || grid_is_structured;
    let shapes = |method: Method| {
        let n = if method.domain() == DomainKind::Corners { 2 } else { 1 };
        SHAPES.into_iter().take(n).map(move |shape| (method, shape))
    };
    METHODS.into_iter().filter(fits).flat_map(shapes).collect()
}

/// Checks partition of unity, linear reproduction and the gradients of both, and that no value is negative.
fn conforms<const D: usize>(grid: &dyn Grid<D>, variant: (Method, ElementShape), x: [f64; D], l: [f64; D]) {
    let s = support(variant, grid, x, l);
    let n = s.nodes.len();
    let position = |k: usize| grid.node_position(s.nodes[k] as usize);
    let sum: f64 = s.value.iter().sum();
    assert!((sum - 1.0).abs() < 1e-13, "{variant:?} {sum}");
    assert!(s.nodes.is_sorted());
    // A position this close to the boundary of a cell may belong to the neighbouring cell.
    let least = if grid.lines().is_some() { 0.0 } else { -1e-8 };
    assert!(s.value.iter().all(|v| *v >= least));
    let size = grid.size(grid.locate(&x, None).unwrap() as usize);
    for d in 0..D {
        let gradient_sum: f64 = s.gradient.iter().map(|g| g[d]).sum();
        assert!(gradient_sum.abs() < 1e-12 / size, "{variant:?} {gradient_sum}");
        let linear: f64 = (0..n).map(|k| s.value[k] * position(k)[d]).sum();
        assert!((linear - x[d]).abs() < 1e-13, "{variant:?}");
        for e in 0..D {
            let slope: f64 = (0..n).map(|k| s.gradient[k][e] * position(k)[d]).sum();
            assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-11, "{variant:?} {slope}");
        }
    }
}

/// Checks that the gradient is the derivative of the value with respect to position. This does not hold for CPDI,
/// because its gradient is the gradient of the interpolation inside the domain.
fn gradient_is_derivative<const D: usize>(
    grid: &Structured<D>,
    variant: (Method, ElementShape),
    x: [f64; D],
    l: [f64; D],
) {
    let s = support(variant, grid, x, l);
    let h = 1e-6;
    let near_line = |d: usize| {
        let xi = |y: f64| grid.axes()[d].coordinate(y);
        [x[d] - l[d], x[d] + l[d]].iter().any(|&y| (xi(y) - xi(y).round()).abs() < 1e-4)
    };
    for d in (0..D).filter(|&d| !near_line(d)) {
        let (mut p, mut m) = (x, x);
        p[d] += h;
        m[d] -= h;
        let (p, m) = (support(variant, grid, p, l), support(variant, grid, m, l));
        for k in 0..s.nodes.len() {
            let numeric = (p.value[k] - m.value[k]) / (2.0 * h);
            assert!((numeric - s.gradient[k][d]).abs() < 1e-7, "{numeric} {}", s.gradient[k][d]);
        }
    }
}

fn check_structured<const D: usize>(grid: &Structured<D>, x: [f64; D], l: [f64; D]) {
    for variant in variants(true) {
        let l = if variant.0.domain() == DomainKind::None { [0.0; D] } else { l };
        conforms(grid, variant, x, l);
        if variant.0.domain() != DomainKind::Corners {
            gradient_is_derivative(grid, variant, x, l);
        }
    }
}

/// Lines from `low` to `high`, graded in two intervals towards the middle.
fn graded(low: f64, high: f64) -> Axis {
    let middle = Interval { to: 0.4 * low + 0.6 * high, cells: 6, ratio: 0.8 };
    Axis::from_intervals(low, &[middle, Interval { to: high, cells: 4, ratio: 1.4 }]).unwrap()
}

/// Graded grids with the extent of the even grids below.
static GRADED: LazyLock<(Structured<2>, Structured<3>)> = LazyLock::new(|| {
    let (x, y) = (graded(0.0, 1.0), graded(-0.5, 1.5));
    let plane = Structured::with_axes([x.clone(), y.clone()]);
    (plane, Structured::with_axes([x, Axis::even(-0.5, 0.2, 10), graded(-0.1, 1.25)]))
});

static MESHES: LazyLock<(Mesh<2>, Mesh<3>, Mesh<3>)> =
    LazyLock::new(|| (mixed(), hexahedra(4), tetrahedra(4)));

fn check_mesh<const D: usize>(grid: &dyn Grid<D>, x: [f64; D], l: [f64; D]) {
    for variant in variants(false) {
        conforms(grid, variant, x, l);
    }
}

proptest! {
    #[test]
    fn every_basis_conforms_in_the_plane(
        x in prop::array::uniform2(0.3..0.7f64), l in prop::array::uniform2(1e-3..0.25f64)
    ) {
        check_structured(&Structured::<2>::new([0.0, -0.5], [0.1, 0.2], [10, 10]), x, l);
        check_structured(&GRADED.0, x, l);
        check_mesh(&MESHES.0, x, l);
    }

    #[test]
    fn every_basis_conforms_in_space(
        x in prop::array::uniform3(0.3..0.7f64), l in prop::array::uniform3(1e-3..0.25f64)
    ) {
        check_structured(&Structured::<3>::new([0.0, -0.5, -0.1], [0.1, 0.2, 0.15], [10, 10, 9]), x, l);
        check_structured(&GRADED.1, x, l);
        check_mesh(&MESHES.1, x, l);
        check_mesh(&MESHES.2, x, l);
    }
}

/// Compares GIMP with a plain average of the linear basis over the domain.
fn averages<const D: usize>(grid: &Structured<D>, x: [f64; D], l: [f64; D], n: usize) {
    let s = support((Method::Gimp, ElementShape::Box), grid, x, l);
    let mut mean = vec![0.0; grid.n_nodes()];
    let count = n.pow(D as u32);
    for k in 0..count {
        let q: [f64; D] = std::array::from_fn(|d| {
            let i = k / n.pow(d as u32) % n;
            x[d] - l[d] + 2.0 * l[d] * (i as f64 + 0.5) / n as f64
        });
        let basis = grid.basis_at(grid.locate(&q, None).unwrap(), &q);
        for (&node, value) in basis.nodes().iter().zip(basis.value()) {
            mean[node as usize] += value / count as f64;
        }
    }
    for (k, &node) in s.nodes.iter().enumerate() {
        assert!((s.value[k] - mean[node as usize]).abs() < 3.0 / (n * n) as f64);
        mean[node as usize] = 0.0;
    }
    assert!(mean.iter().all(|m| *m == 0.0), "a node of the domain is missing");
}

#[test]
fn a_gimp_point_averages_the_linear_basis_over_its_domain() {
    averages(&Structured::<2>::new([0.0; 2], [0.1, 0.2], [10, 10]), [0.47, 0.93], [0.055, 0.13], 2000);
    let grid = Structured::<3>::new([0.0; 3], [0.1, 0.2, 0.3], [10, 10, 4]);
    averages(&grid, [0.47, 0.93, 0.55], [0.055, 0.13, 0.2], 120);
    averages(&GRADED.0, [0.47, 0.83], [0.155, 0.33], 2000);
    averages(&GRADED.1, [0.47, 0.83, 0.55], [0.055, 0.33, 0.4], 120);
}

/// ∫ N_v from the lowest line to `y` for arbitrary grid lines, in closed form.
fn antiderivative(lines: &[f64], v: usize, y: f64) -> f64 {
    let mut integral = 0.0;
    if v > 0 {
        let (low, h) = (lines[v - 1], lines[v] - lines[v - 1]);
        integral += 0.5 * h * ((y - low) / h).clamp(0.0, 1.0).powi(2);
    }
    if v + 1 < lines.len() {
        let (high, h) = (lines[v + 1], lines[v + 1] - lines[v]);
        integral += 0.5 * h * (1.0 - ((high - y) / h).clamp(0.0, 1.0).powi(2));
    }
    integral
}

/// S_v = [I_v(x + l) − I_v(x − l)] / 2l for every node. An axis made of intervals with equal cells gives the same
/// result as an even axis.
#[test]
fn gimp_points_are_differences_of_the_antiderivative() {
    let even = Axis::even(0.0, 0.1, 10);
    let ends = [Interval { to: 0.3, cells: 3, ratio: 1.0 }, Interval { to: 1.0, cells: 7, ratio: 1.0 }];
    let equal = Structured::with_axes([Axis::from_intervals(0.0, &ends).unwrap()]);
    let (even, skewed) = (Structured::with_axes([even]), Structured::with_axes([graded(0.0, 1.0)]));
    for k in 0..200 {
        let x = [0.3 + 0.4 * (f64::from(k) * 0.618).fract()];
        let l = [1e-3 + 0.29 * (f64::from(k) * 0.414).fract()];
        let gimp = |grid: &Structured<1>| support((Method::Gimp, ElementShape::Box), grid, x, l);
        for grid in [&even, &equal, &skewed] {
            let lines: Vec<f64> = (0..grid.n_nodes()).map(|v| grid.node_position(v)[0]).collect();
            let s = gimp(grid);
            for (node, value) in s.nodes.iter().zip(&s.value) {
                let [low, high] =
                    [x[0] - l[0], x[0] + l[0]].map(|y| antiderivative(&lines, *node as usize, y));
                assert!((value - (high - low) / (2.0 * l[0])).abs() < 1e-13);
            }
        }
        let (a, b) = (gimp(&even), gimp(&equal));
        assert_eq!(a.nodes, b.nodes);
        // Round-off of coordinates up to 1, relative to the length of the domain.
        let round_off = 16.0 * f64::EPSILON / l[0];
        assert!(a.value.iter().zip(&b.value).all(|(a, b)| (a - b).abs() < 0.1 * round_off));
        assert!(a.gradient.iter().zip(&b.gradient).all(|(a, b)| (a[0] - b[0]).abs() < round_off));
    }
}

/// A damaged file may contain any half lengths.
#[test]
fn gimp_domains_of_any_length_are_survived() {
    let even = Structured::<2>::new([0.0; 2], [0.1, 0.2], [10, 10]);
    let mut out = Support::default();
    for length in [0.0, 5e-324, 3.0, 1e300, f64::MAX, f64::INFINITY, -0.05, -3.0, -1e300, f64::MIN] {
        for half_lengths in [[length, 0.05], [0.05, length], [length; 2]] {
            for grid in [&even, &GRADED.0] {
                let point = PointGeometry {
                    cell: 44,
                    position: &[0.47, 0.93],
                    half_lengths: &half_lengths,
                    corners: &[],
                };
                // The result does not matter here: the reader refuses such points.
                let _ = Method::Gimp.basis::<2>().support(grid, &point, &mut out);
            }
        }
    }
}
