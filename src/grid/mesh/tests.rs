use std::time::Instant;

use proptest::prelude::*;

use super::*;
use crate::grid::gmsh;

/// A distorted lattice of n × n quadrilaterals over the unit square, some of them cut into triangles.
fn distorted(n: usize, cut: impl Fn(usize, usize) -> bool) -> Mesh {
    let mut nodes = String::new();
    for k in 0..(n + 1) * (n + 1) {
        let [x, y] = [k % (n + 1), k / (n + 1)].map(|i| i as f64 / n as f64);
        let bump = 0.3 / n as f64 * (41.0 * x + 17.0 * y).sin() * x * (1.0 - x) * y * (1.0 - y) * 16.0;
        nodes += &format!("{k} {} {} 0\n", x + bump, y - bump);
    }
    let (mut elements, mut count) = (String::new(), 0);
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let a = j * (n + 1) + i;
        let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
        if cut(i, j) {
            elements += &format!("{count} 2 0 {a} {b} {c}\n{} 2 0 {a} {c} {d}\n", count + 1);
            count += 2;
        } else {
            elements += &format!("{count} 3 0 {a} {b} {c} {d}\n");
            count += 1;
        }
    }
    let text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        (n + 1) * (n + 1)
    );
    Mesh::from_gmsh(&gmsh::read(text.as_bytes()).unwrap()).unwrap()
}

fn mixed() -> Mesh {
    distorted(12, |i, j| (i + 2 * j) % 3 == 0)
}

#[test]
fn a_position_on_an_edge_has_one_cell_whatever_its_round_off_and_the_hint() {
    let mesh = mixed();
    for cell in 0..mesh.n_cells() as u32 {
        let corners = mesh.corners(cell);
        for (a, b) in corners.edges() {
            for t in [0.0, 0.3, 0.5, 1.0] {
                let x = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
                let lowest =
                    (0..mesh.n_cells() as u32).find(|c| mesh.corners(*c).touches(&x, 1e-9 * mesh.size(*c)));
                for noise in [[0.0, 0.0], [1e-14, -1e-14], [-1e-14, 1e-14], [1e-14, 1e-14], [-1e-14, -1e-14]]
                {
                    let x = [x[0] + noise[0], x[1] + noise[1]];
                    for hint in [None, Some(cell), Some(0), Some(7), Some(u32::MAX)] {
                        assert_eq!(mesh.locate(&x, hint), lowest);
                    }
                }
            }
        }
    }
}

#[test]
fn positions_outside_have_no_cell_but_a_nearest_one() {
    let mesh = mixed();
    for x in
        [[-1e-6, 0.5], [0.5, 1.0 + 1e-6], [3.0, 3.0], [-200.0, 0.4], [f64::NAN, 0.0], [f64::INFINITY, 0.0]]
    {
        assert_eq!(mesh.locate(&x, None), None);
        let nearest = mesh.nearest_cell(&x);
        if x.iter().all(|x| x.is_finite()) {
            let distance = |cell: u32| mesh.corners(cell).distance_squared(&x).sqrt();
            let least = (0..mesh.n_cells() as u32).map(distance).fold(f64::INFINITY, f64::min);
            assert!(distance(nearest) <= least + 1e-9, "{x:?}");
        }
    }
    assert_eq!(mesh.locate(&[-1e-13, 0.5], None), mesh.locate(&[0.0, 0.5], None));
    assert!(mesh.locate(&[0.0, 0.5], None).is_some());
}

#[test]
fn cells_fill_the_square_and_boundaries_go_round_it() {
    let mesh = mixed();
    let area: f64 = (0..mesh.n_cells() as u32).map(|cell| mesh.area(cell)).sum();
    assert!((area - 1.0).abs() < 1e-13);
    assert_eq!(mesh.boundary_edges().len(), 48);
    // The cell to the left: the edges go round counterclockwise.
    let twice: f64 = mesh
        .boundary_edges()
        .iter()
        .map(|e| cross(mesh.node_position(e.nodes[0] as usize), mesh.node_position(e.nodes[1] as usize)))
        .sum();
    assert!((twice - 2.0).abs() < 1e-13);
}

#[test]
fn huge_overlapping_cells_do_not_fill_the_memory() {
    let n = 20_000;
    let spread = |k: usize| 1.0 + k as f64 / n as f64;
    let boxes: Vec<Bounds> = (0..n).map(|k| [[-spread(k); 2], [spread(k); 2]]).collect();
    let bins = Bins::new(&boxes);
    assert_eq!(bins.at(&[0.0, 0.0]).len(), n);
}

proptest! {
    #[test]
    fn the_basis_is_linear_and_the_cell_is_right(x in prop::array::uniform2(-0.05..1.05f64)) {
        let mesh = mixed();
        let located = mesh.locate(&x, None);
        let inside = x.iter().all(|x| (0.0..=1.0).contains(x));
        prop_assert_eq!(located.is_some(), inside);
        let cell = located.unwrap_or_else(|| mesh.nearest_cell(&x));
        let basis = mesh.shape(cell, &x);
        prop_assert_eq!(basis.nodes(), mesh.cell_nodes(cell));
        prop_assert!(!inside || basis.value().iter().all(|v| *v > -1e-7));
        prop_assert!((basis.value().iter().sum::<f64>() - 1.0).abs() < 1e-13);
        for (d, x) in x.iter().enumerate() {
            let position = |k: usize| mesh.node_position(basis.nodes()[k] as usize)[d];
            let sum: f64 = (0..basis.nodes().len()).map(|k| basis.value()[k] * position(k)).sum();
            prop_assert!((sum - x).abs() < 1e-13);
            for e in 0..2 {
                let slope: f64 = (0..basis.nodes().len()).map(|k| basis.gradient()[k][e] * position(k)).sum();
                prop_assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn far_outside_the_basis_still_reproduces_linear_fields(x in prop::array::uniform2(-50.0..50.0f64)) {
        let mesh = mixed();
        for cell in 0..mesh.n_cells() as u32 {
            let basis = mesh.shape(cell, &x);
            for (d, x) in x.iter().enumerate() {
                let position = |k: usize| mesh.node_position(basis.nodes()[k] as usize)[d];
                let sum: f64 = (0..basis.nodes().len()).map(|k| basis.value()[k] * position(k)).sum();
                prop_assert!((sum - x).abs() < 1e-6, "{sum} {x:?}");
            }
        }
    }
}

#[test]
#[ignore = "a measurement"]
#[expect(clippy::print_stdout, reason = "a measurement for the reader")]
fn point_location_takes_the_same_time_in_small_and_large_meshes() {
    for n in [22, 71, 224, 707] {
        let start = Instant::now();
        let mesh = distorted(n, |_, _| true);
        let build = start.elapsed();
        let queries = 1_000_000;
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut points: Vec<[f64; 2]> = (0..queries).map(|_| [random(), random()]).collect();
        let time = |points: &[[f64; 2]], hint: &dyn Fn(usize) -> Option<u32>| {
            let start = Instant::now();
            let found = points.iter().enumerate().filter(|(k, x)| mesh.locate(x, hint(*k)).is_some()).count();
            assert_eq!(found, queries);
            start.elapsed().as_nanos() as f64 / queries as f64
        };
        let without = time(&points, &|_| None);
        let cells: Vec<_> = points.iter().map(|x| mesh.locate(x, None)).collect();
        let with = time(&points, &|k| cells[k]);
        let start = Instant::now();
        let sum: f64 = points.iter().zip(&cells).map(|(x, c)| mesh.shape(c.unwrap(), x).value()[0]).sum();
        let shape = start.elapsed().as_nanos() as f64 / queries as f64;
        points.sort_by_cached_key(|x| mesh.locate(x, None)); // as the points of a model are
        let ordered = time(&points, &|_| None);
        println!(
            "{:8} cells, read and built in {build:.2?}: {without:.0} ns without hint, {with:.0} with, {ordered:.0} in \
             order; shape {shape:.0} ({sum:.0})",
            mesh.n_cells()
        );
    }
}
