//! Valid surfaces, and the errors found in invalid ones.

use std::f64::consts::{PI, TAU};
use std::time::Instant;

use super::*;
use crate::region::stl;
use crate::region::tests::Random;
use crate::region::vector::{dot, minus};
use crate::region::{Accuracy, Ball, Brick, Motion, Region};

/// Two triangles per patch of a surface x(u, v), which is closed in u and, unless it ends in poles, in v.
fn parametric(nu: usize, nv: usize, poles: bool, x: impl Fn(f64, f64) -> [f64; 3]) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let j = if poles { j } else { j % nv };
        // All corners at a pole have exactly the same position.
        let i = if poles && (j == 0 || j == nv) { 0 } else { i % nu };
        x(i as f64 / nu as f64, j as f64 / nv as f64)
    };
    let mut triangles = Vec::new();
    for j in 0..nv {
        for i in 0..nu {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend(
                [[a, b, c], [a, c, d]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]),
            );
        }
    }
    triangles
}

/// A torus around the z axis.
pub(crate) fn torus(ring: f64, tube: f64, nu: usize, nv: usize) -> Vec<Triangle> {
    parametric(nu, nv, false, |u, v| {
        let (r, z) = (ring + tube * (TAU * v).cos(), tube * (TAU * v).sin());
        [r * (TAU * u).cos(), r * (TAU * u).sin(), z]
    })
}

pub(crate) fn sphere(center: [f64; 3], radius: f64, nu: usize, nv: usize) -> Vec<Triangle> {
    parametric(nu, nv, true, |u, v| {
        let (r, z) = ((PI * v).sin(), -(PI * v).cos());
        [r * (TAU * u).cos(), r * (TAU * u).sin(), z]
            .iter()
            .zip(center)
            .map(|(n, c)| c + radius * n)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap()
    })
}

/// A cube with this lowest corner and side length.
pub(crate) fn cube([x, y, z]: [f64; 3], side: f64) -> Vec<Triangle> {
    let at =
        |k: usize| [x + side * (k & 1) as f64, y + side * (k >> 1 & 1) as f64, z + side * (k >> 2) as f64];
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).map(|t| t.map(at)).collect()
}

pub(super) fn turned(mut triangles: Vec<Triangle>) -> Vec<Triangle> {
    triangles.iter_mut().for_each(|t| t.swap(1, 2));
    triangles
}

pub(super) fn together(parts: &[Vec<Triangle>]) -> Vec<Triangle> {
    parts.concat()
}

fn refused(triangles: &[Triangle]) -> SurfaceError {
    Surface::new(triangles).unwrap_err()
}

pub(super) fn binary(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = b"solid by name only".to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        bytes.extend([0; 12]);
        bytes.extend(t.as_flattened().iter().flat_map(|x| (*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

pub(super) fn text(triangles: &[Triangle]) -> Vec<u8> {
    let mut text = String::from("solid test\n");
    for t in triangles {
        let [a, b, c] = t.map(|[x, y, z]| format!("vertex {x} {y} {z}\n"));
        text += &format!("facet normal 0 0 0\nouter loop\n{a}{b}{c}endloop\nendfacet\n");
    }
    (text + "endsolid test\n").into_bytes()
}

#[test]
fn volumes_are_those_of_the_polyhedra() {
    assert_eq!(Surface::new(&cube([1.0, 2.0, 3.0], 2.0)).unwrap().volume(), 8.0);
    // The area of a regular polygon of n corners is n/2 sin(2π/n) times the squared radius.
    let (n, m) = (24, 13);
    let polygon = |n: usize| 0.5 * n as f64 * (TAU / n as f64).sin();
    let ring = Surface::new(&torus(2.0, 0.5, n, m)).unwrap();
    // A ring of n mitred prisms has the volume ∫ r dA × n sin(2π/n), where ∫ r dA = 2 × area.
    let exact = 2.0 * 0.25 * polygon(m) * n as f64 * (TAU / n as f64).sin();
    assert!((ring.volume() - exact).abs() < 1e-12, "{} {exact}", ring.volume());
    let errors = [1, 2, 4].map(|k| {
        let ball = Surface::new(&sphere([5.0; 3], 1.0, 16 * k, 8 * k)).unwrap();
        4.0 / 3.0 * PI - ball.volume()
    });
    assert!((errors[0] / errors[1]).log2() > 1.95 && (errors[1] / errors[2]).log2() > 1.98, "{errors:?}");
}

#[test]
fn a_body_far_from_the_origin_has_its_volume() {
    let far = sphere([1e6, -2e6, 3e6], 1.0, 32, 16);
    let near = sphere([0.0; 3], 1.0, 32, 16);
    let [far, near] = [far, near].map(|t| Surface::new(&t).unwrap().volume());
    assert!((far - near).abs() < 1e-8 * near);
}

#[test]
fn positions_are_inside_or_outside_exactly() {
    let body = Surface::new(&cube([0.0; 3], 1.0)).unwrap();
    let tiny = f64::MIN_POSITIVE;
    for x in [[0.5; 3], [1e-300, 0.5, 0.5], [0.25, 0.25, 0.75], [0.5, 1.0 - 1e-16, tiny]] {
        assert!(body.contains(&x), "{x:?}");
    }
    for x in [
        [-tiny, 0.5, 0.5],
        [0.5, 0.5, -tiny],
        [0.5, 0.5, 1.0 + 3e-16],
        [1.0 + 3e-16, 0.5, 0.5],
        [f64::NAN; 3],
    ] {
        assert!(!body.contains(&x), "{x:?}");
    }
    // The axis of the ball passes through its poles, where many facets meet at a corner.
    let ball = Surface::new(&sphere([0.0; 3], 1.0, 12, 7)).unwrap();
    for k in -20..=20 {
        let z = f64::from(k) * 0.07;
        assert_eq!(ball.contains(&[0.0, 0.0, z]), z.abs() < 1.0, "{z}");
    }
    // Adjacent cubes and lattice positions on their edges and corners: each position is in at most one cube.
    let cubes = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|x| Surface::new(&cube(x, 1.0)).unwrap());
    for k in 0..64 {
        let x = [f64::from(k % 8) * 0.25 + 0.25, f64::from(k / 8) * 0.25 + 0.25, 0.5];
        let holders = cubes.iter().filter(|body| body.contains(&x)).count();
        let whole = x[0] <= 0.75 || x[1] <= 0.75;
        assert!(holders <= 1 && (holders == 1 || !whole || x[0] >= 2.0 || x[1] >= 2.0), "{x:?}: {holders}");
    }
}

#[test]
fn text_and_binary_files_give_the_same_body() {
    let ring = torus(2.0, 0.5, 24, 13);
    let [a, b] = [text(&ring), binary(&ring)]
        .map(|bytes| Surface::new(&stl::read(&bytes).unwrap().triangles).unwrap());
    assert_eq!((a.facets(), a.shells(), a.welded()), (624, 1, 0));
    assert_eq!((b.facets(), b.shells(), b.welded()), (624, 1, 0));
    assert!((a.volume() - b.volume()).abs() < 1e-6);
}

#[test]
fn several_shells_and_cavities() {
    let apart = Surface::new(&together(&[cube([0.0; 3], 1.0), cube([2.0, 0.0, 0.0], 1.0)])).unwrap();
    assert_eq!((apart.shells(), apart.volume()), (2, 2.0));
    // Body, cavity, and body in the cavity; the order of the facets is irrelevant.
    let nested = [cube([1.5; 3], 1.0), cube([0.0; 3], 4.0), turned(cube([1.0; 3], 2.0))];
    let nested = Surface::new(&together(&nested)).unwrap();
    assert_eq!((nested.shells(), nested.volume()), (3, 64.0 - 8.0 + 1.0));
    for (x, inside) in [(0.5, true), (1.2, false), (2.0, true), (4.1, false)] {
        assert_eq!(nested.contains(&[x; 3]), inside, "{x}");
    }
    // Shells may touch at a corner.
    let joined = Surface::new(&together(&[cube([0.0; 3], 1.0), cube([1.0; 3], 1.0)])).unwrap();
    assert_eq!((joined.shells(), joined.volume()), (2, 2.0));
}

#[test]
fn a_shell_that_is_inside_out_is_refused() {
    assert!(
        matches!(refused(&turned(cube([0.0; 3], 1.0))), SurfaceError::InsideOut { cavity: false, at } if at.facet == 1)
    );
    let twice = together(&[cube([0.0; 3], 4.0), cube([1.0; 3], 2.0)]);
    let error = refused(&twice);
    assert!(matches!(error, SurfaceError::InsideOut { cavity: true, at } if at.facet == 13));
    assert_eq!(
        error.to_string(),
        "a shell inside another one is not a cavity: its facets have counterclockwise corners, for example \
         facet 13 with the corners (1, 1, 1), (1, 3, 1), (3, 3, 1)"
    );
}

#[test]
fn an_open_surface_is_refused_with_the_place() {
    let mut open = cube([0.0; 3], 1.0);
    open.remove(4);
    let error = refused(&open);
    assert!(matches!(&error, SurfaceError::Open { n: 3, first } if first.len() == 3));
    assert_eq!(
        error.to_string(),
        "the surface is open: 3 edges have one facet only: (0, 0, 0) to (1, 0, 0) of facet 2; \
         (0, 0, 0) to (1, 0, 1) of facet 5; (1, 0, 0) to (1, 0, 1) of facet 11"
    );
    // A corner in the middle of an edge leaves the edge open although no gap is visible.
    let mut split = cube([0.0; 3], 1.0);
    let [a, b, c] = split[0];
    let middle = std::array::from_fn(|d| 0.5 * (a[d] + b[d]));
    split[0] = [a, middle, c];
    split.push([middle, b, c]);
    assert!(matches!(refused(&split), SurfaceError::Open { n: 3, .. }));
}

#[test]
fn a_turned_facet_is_named() {
    for facet in [0, 7, 11] {
        let mut wrong = sphere([0.0; 3], 1.0, 8, 5);
        wrong[facet].swap(0, 1);
        assert!(matches!(refused(&wrong), SurfaceError::Turned { n: 3, at } if at.facet == facet + 1));
    }
}

#[test]
fn an_edge_with_four_facets_is_refused() {
    let edge = together(&[cube([0.0; 3], 1.0), cube([1.0, 1.0, 0.0], 1.0)]);
    assert!(matches!(refused(&edge), SurfaceError::Branched { n: 1, first } if first[0].facets == 4));
    let twice = together(&[cube([0.0; 3], 1.0), cube([0.0; 3], 1.0)]);
    assert!(matches!(refused(&twice), SurfaceError::Branched { n: 18, .. }));
}

/// A facet with two equal corners, or with a corner on the side between the two others, has no area; the facet beyond
/// that side is divided, so that the surface stays closed.
#[test]
fn facets_without_area_are_removed() {
    let whole = cube([0.0; 3], 1.0);
    let mut doubled = whole.clone();
    doubled.insert(2, [whole[0][0], whole[0][0], whole[0][1]]);
    let body = Surface::new(&doubled).unwrap();
    assert_eq!((body.dropped(), body.facets(), body.volume()), (1, 12, 1.0));
    // Facet 1 ends at the middle of its side from a to b; a facet without area fills the seam to its neighbour.
    let [a, b, c] = whole[0];
    let middle: [f64; 3] = std::array::from_fn(|d| 0.5 * (a[d] + b[d]));
    let mut seam = whole.clone();
    seam[0] = [a, middle, c];
    seam.extend([[middle, b, c], [a, b, middle]]);
    let body = Surface::new(&seam).unwrap();
    assert_eq!((body.dropped(), body.facets(), body.volume()), (1, 14, 1.0));
}

#[test]
fn a_facet_that_lost_a_corner_leaves_a_hole() {
    let mut needle = cube([0.0; 3], 1.0);
    needle[3][1] = needle[3][0];
    assert!(matches!(refused(&needle), SurfaceError::Open { n: 3, .. }));
    let mut line = cube([0.0; 3], 1.0);
    line.push([[0.0; 3], [0.5; 3], [1.0; 3]]);
    assert_eq!(
        refused(&line).to_string(),
        "1 facet has no area: facet 13 with the corners (0, 0, 0), (0.5, 0.5, 0.5), (1, 1, 1)"
    );
    assert!(matches!(refused(&line[..3]), SurfaceError::TooFewFacets { facets: 3 }));
    line[12][0][1] = f64::INFINITY;
    assert!(matches!(refused(&line), SurfaceError::NotANumber { at } if at.facet == 13));
    line[12][0][1] = 1e70;
    assert!(matches!(refused(&line), SurfaceError::NotANumber { .. }));
}

#[test]
fn a_surface_that_crosses_or_touches_itself_is_refused_with_the_place() {
    let overlapping = together(&[cube([0.0; 3], 1.0), cube([0.5; 3], 1.0)]);
    match refused(&overlapping) {
        SurfaceError::Crossing { near, facets } => {
            assert!(near.iter().all(|x| (0.4..1.1).contains(x)), "{near:?}");
            assert!(facets[0].facet <= 12 && facets[1].facet > 12);
        }
        other => panic!("{other}"),
    }
    // A pole pushed through the opposite side of the ball: facets that share no corner cross.
    let mut dented = sphere([0.0; 3], 1.0, 12, 7);
    let pole = [0.0, 0.0, -1.0];
    let pushed = |triangles: &mut Vec<Triangle>, to: f64| {
        triangles
            .iter_mut()
            .flatten()
            .filter(|x| minus(x, &pole).iter().all(|d| d.abs() < 1e-12))
            .for_each(|x| x[2] = to);
    };
    pushed(&mut dented, 1.2);
    assert!(matches!(refused(&dented), SurfaceError::Crossing { .. }));
    let mut dimple = sphere([0.0; 3], 1.0, 12, 7);
    pushed(&mut dimple, 0.5);
    assert!(Surface::new(&dimple).is_ok());
    // Coincident faces, a corner on a face, an edge on a face.
    for x in [[1.0, 0.25, 0.25], [1.0, 0.0, 0.5], [0.25, 1.0, -0.5]] {
        let touching = together(&[cube([0.0; 3], 1.0), cube(x, 0.5)]);
        assert!(matches!(refused(&touching), SurfaceError::Crossing { .. }), "{x:?}");
    }
    let tip = [[1.0, 0.5, 0.5], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.5, 1.0]];
    let pyramid =
        |tip: [[f64; 3]; 4]| [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|t| t.map(|k| tip[k])).to_vec();
    let with_tip = |x: f64| {
        let moved = tip.map(|[a, b, c]| [a + x, b, c]);
        together(&[cube([0.0; 3], 1.0), pyramid(moved)])
    };
    let check = |x: f64| match Surface::new(&with_tip(x)) {
        Err(SurfaceError::InsideOut { .. }) => {
            Surface::new(&together(&[cube([0.0; 3], 1.0), turned(with_tip(x)[12..].to_vec())]))
        }
        other => other,
    };
    assert!(matches!(check(0.0), Err(SurfaceError::Crossing { .. })));
    assert!(matches!(check(-1e-15), Err(SurfaceError::Crossing { .. })));
    assert_eq!(check(1e-15).unwrap().shells(), 2);
}

#[test]
fn facets_folded_on_each_other_are_refused() {
    // Two facets back to back enclose nothing; a fin of two facets is closed but flat.
    let [a, b, c, d] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert!(matches!(refused(&[[a, b, c], [a, c, b], [a, b, d], [a, d, b]]), SurfaceError::Branched { .. }));
    assert!(matches!(
        refused(&together(&[cube([3.0; 3], 1.0), vec![[a, b, c], [a, c, b]]])),
        SurfaceError::Crossing { .. }
    ));
    // A tetrahedron with its fourth corner in the plane of the others, beyond the edge from b to c.
    let e = [0.8, 0.7, 0.0];
    let flat = [[a, c, b], [a, b, e], [a, e, c], [b, c, e]];
    assert!(matches!(refused(&flat), SurfaceError::Crossing { .. }));
}

#[test]
fn corners_that_differ_by_round_off_are_merged() {
    let mut random = Random(1);
    let mut ring = torus(2.0, 0.5, 24, 13);
    ring.iter_mut().flatten().flatten().for_each(|x| *x += 1e-7 * random.between(-1.0, 1.0));
    let body = Surface::new(&ring).unwrap();
    assert!(body.welded() > 1000);
    assert!((body.volume() - Surface::new(&torus(2.0, 0.5, 24, 13)).unwrap().volume()).abs() < 1e-5);
    let mut apart = cube([0.0; 3], 1.0);
    apart[0][0][0] += 1e-4;
    assert!(matches!(refused(&apart), SurfaceError::Open { .. }));
}

#[test]
fn lines_through_a_turned_body_agree_with_its_volume() {
    let motion = Motion::<3>::rotation([1.0, -2.0, 0.5], 0.8, [0.3, 0.1, 0.0]).unwrap();
    let body = Region::new(Surface::new(&torus(2.0, 0.5, 12, 7)).unwrap()).moved(&motion);
    let exact = body.volume(Accuracy::default()).unwrap().value;
    let half = |low: f64, high: f64| {
        let part = Region::intersection(vec![
            body.clone(),
            Brick::new([-9.0, -9.0, low], [9.0, 9.0, high]).unwrap().into(),
        ]);
        part.unwrap().volume(Accuracy { relative: 1e-4, lines: 4_000_000 }).unwrap()
    };
    let (lower, upper) = (half(-9.0, 0.2), half(0.2, 9.0));
    let error = lower.error + upper.error;
    assert!(
        (lower.value + upper.value - exact).abs() <= error && error < 1e-3 * exact,
        "{lower:?} {upper:?} {exact}"
    );
}

/// One million positions in a ball of one hundred thousand facets.
#[test]
fn many_positions_are_decided_fast() {
    let triangles = sphere([0.0; 3], 1.0, 224, 225);
    assert!(triangles.len() > 100_000);
    let start = Instant::now();
    let body = Surface::new(&triangles).unwrap();
    let checked = start.elapsed();
    let exact = Ball::new([0.0; 3], 1.0).unwrap();
    let (start, mut random, mut inside) = (Instant::now(), Random(2), 0);
    for _ in 0..1_000_000 {
        let x = random.inside(&[[-1.0; 3], [1.0; 3]]);
        let r = dot(&x, &x).sqrt();
        let found = body.contains(&x);
        inside += usize::from(found);
        assert!(found == exact.contains(&x) || (0.9995..=1.0).contains(&r), "{x:?}");
    }
    let decided = start.elapsed();
    assert!((inside as f64 / 1e6 * 8.0 - body.volume()).abs() < 0.01);
    // One hundred times the usual duration.
    assert!(decided.as_secs() < 100 && checked.as_secs() < 100, "{checked:?} {decided:?}");
}
