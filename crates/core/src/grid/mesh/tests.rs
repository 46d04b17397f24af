use std::sync::LazyLock;
use std::time::Instant;

use proptest::prelude::*;

use super::*;
use crate::grid::element::cross;
use crate::grid::gmsh;
use crate::tensor::padded;

/// The mesh of these nodes and elements, built via the gmsh format.
fn mesh<const D: usize>(nodes: &[[f64; D]], elements: &[(u8, Vec<usize>)]) -> Mesh<D> {
    read(nodes, elements).unwrap()
}

/// As [`mesh`], or the fault.
fn read<const D: usize>(nodes: &[[f64; D]], elements: &[(u8, Vec<usize>)]) -> Result<Mesh<D>, MeshError> {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.len());
    for (k, x) in nodes.iter().enumerate() {
        let [x, y, z] = padded(x);
        text += &format!("{k} {x} {y} {z}\n");
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", elements.len());
    for (k, (kind, nodes)) in elements.iter().enumerate() {
        let nodes: Vec<String> = nodes.iter().map(usize::to_string).collect();
        text += &format!("{k} {kind} 0 {}\n", nodes.join(" "));
    }
    text += "$EndElements\n";
    Mesh::from_gmsh(&gmsh::read(text.as_bytes()).unwrap())
}

/// The nodes of a lattice of n cells along each axis over the unit square or cube; interior nodes are moved.
fn lattice<const D: usize>(n: usize) -> Vec<[f64; D]> {
    (0..(n + 1).pow(D as u32))
        .map(|k| {
            let x: [f64; D] =
                std::array::from_fn(|d| (k / (n + 1).pow(d as u32) % (n + 1)) as f64 / n as f64);
            let bubble: f64 = x.iter().map(|x| 4.0 * x * (1.0 - x)).product();
            let phase: f64 = (0..D).map(|d| [41.0, 17.0, 23.0][d] * x[d]).sum();
            let bump = [0.3, 0.2][D - 2] / n as f64 * phase.sin() * bubble;
            std::array::from_fn(|d| x[d] + [bump, -bump, 0.7 * bump][d])
        })
        .collect()
}

/// A distorted lattice of n × n quadrilaterals over the unit square; some are cut into triangles.
fn distorted(n: usize, cut: impl Fn(usize, usize) -> bool) -> Mesh<2> {
    let mut elements = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let a = j * (n + 1) + i;
        let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
        if cut(i, j) {
            elements.extend([(2, vec![a, b, c]), (2, vec![a, c, d])]);
        } else {
            elements.push((3, vec![a, b, c, d]));
        }
    }
    mesh(&lattice(n), &elements)
}

/// Quadrilaterals and triangles over the unit square.
pub(crate) fn mixed() -> Mesh<2> {
    distorted(12, |i, j| (i + 2 * j) % 3 == 0)
}

/// A distorted lattice of n × n × n hexahedra over the unit cube.
pub(crate) fn hexahedra(n: usize) -> Mesh<3> {
    let elements = corners_of_lattice(n).map(|c| (5, [0, 1, 3, 2, 4, 5, 7, 6].map(|k| c[k]).to_vec()));
    mesh(&lattice(n), &elements.collect::<Vec<_>>())
}

/// The same as [`hexahedra`], with each hexahedron cut into six tetrahedra that share a space diagonal.
pub(crate) fn tetrahedra(n: usize) -> Mesh<3> {
    const PATHS: [[usize; 2]; 6] = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    let cut = |c: [usize; 8]| PATHS.map(|[a, b]| (4, vec![c[0], c[a], c[b], c[7]]));
    mesh(&lattice(n), &corners_of_lattice(n).flat_map(cut).collect::<Vec<_>>())
}

/// The corners of the cells of a lattice of n × n × n cells, numbered by bits.
fn corners_of_lattice(n: usize) -> impl Iterator<Item = [usize; 8]> {
    let node = move |x: [usize; 3]| x[0] + (n + 1) * (x[1] + (n + 1) * x[2]);
    (0..n * n * n).map(move |cell| {
        let low = [cell % n, cell / n % n, cell / (n * n)];
        std::array::from_fn(|c| node(std::array::from_fn(|d| low[d] + (c >> d & 1))))
    })
}

/// Positions on the sides of every cell, with noise, belong to the same cell as without noise: the lowest cell that
/// touches the position.
fn check_borders<const D: usize>(mesh: &Mesh<D>) {
    let hints = |cell| [None, Some(cell), Some(0), Some(7), Some(u32::MAX)];
    for cell in 0..mesh.n_cells() as u32 {
        let corners = mesh.cell(cell);
        for side in corners.shape.sides::<D>() {
            for weights in [[1.0, 0.0, 0.0, 0.0], [0.7, 0.3, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.25; 4]] {
                let n = side.len();
                let total: f64 = weights[..n].iter().sum();
                // These weights give positions on the face even if the face is bilinear.
                let x: [f64; D] =
                    std::array::from_fn(|d| (0..n).map(|k| weights[k] / total * corners.x[side[k]][d]).sum());
                let touching = |c: &u32| mesh.cell(*c).touches(&x, 1e-9 * mesh.size(*c));
                let lowest = (0..mesh.n_cells() as u32).find(touching);
                assert!(lowest.is_some_and(|lowest| lowest <= cell));
                for noise in 0..=1usize << D {
                    let sign =
                        |d: usize| if noise == 1 << D { 0.0 } else { (noise >> d & 1) as f64 * 2.0 - 1.0 };
                    let x = std::array::from_fn(|d| x[d] + 1e-14 * sign(d));
                    for hint in hints(cell) {
                        assert_eq!(mesh.locate(&x, hint), lowest);
                    }
                }
            }
        }
    }
}

#[test]
fn a_position_on_a_border_has_one_cell_whatever_its_round_off_and_the_hint() {
    check_borders(&mixed());
    check_borders(&hexahedra(4));
    check_borders(&tetrahedra(3));
}

fn check_outside<const D: usize>(mesh: &Mesh<D>) {
    let places = [[-1e-6, 0.5, 0.5], [0.5, 1.0 + 1e-6, 0.4], [3.0, 3.0, 3.0], [-200.0, 0.4, 0.1]];
    let wild = [[f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]];
    for place in places.iter().chain(&wild) {
        let x: [f64; D] = std::array::from_fn(|d| place[d]);
        assert_eq!(mesh.locate(&x, None), None);
        let nearest = mesh.nearest_cell(&x);
        if x.iter().all(|x| x.is_finite()) {
            let distance = |cell: u32| mesh.cell(cell).distance_squared(&x).sqrt();
            let least = (0..mesh.n_cells() as u32).map(distance).fold(f64::INFINITY, f64::min);
            assert!(distance(nearest) <= least + 1e-9, "{x:?}");
        }
    }
    let at = |x: f64| mesh.locate(&std::array::from_fn(|d| if d == 0 { x } else { 0.5 }), None);
    assert_eq!(at(-1e-13), at(0.0));
    assert!(at(0.0).is_some());
}

/// A position on the boundary of a cell, up to round-off, activates only the nodes of that part of the boundary.
fn check_border_values<const D: usize>(mesh: &Mesh<D>) {
    for cell in 0..mesh.n_cells() as u32 {
        let corners = mesh.cell(cell);
        for (k, side) in corners.shape.sides::<D>().iter().enumerate() {
            let n = side.len();
            let noise = 1e-14 * (k as f64 - 1.5);
            let x: [f64; D] = std::array::from_fn(|d| {
                noise + side.iter().map(|k| corners.x[*k][d]).sum::<f64>() / n as f64
            });
            let basis = mesh.shape(mesh.locate(&x, None).unwrap_or(cell), &x);
            let touched = || basis.nodes().iter().zip(basis.value()).filter(|(_, v)| **v != 0.0);
            assert!(touched().count() <= n && touched().all(|(_, v)| *v > 0.0));
            assert!(touched().all(|(node, _)| side.iter().any(|k| mesh.cell_nodes(cell)[*k] == *node)));
            // The same holds for positions at nodes.
            let node = mesh.cell_nodes(cell)[side[0]];
            let x = corners.x[side[0]].map(|x| x + noise);
            let basis = mesh.shape(mesh.locate(&x, None).unwrap_or(cell), &x);
            let touched: Vec<_> =
                basis.nodes().iter().zip(basis.value()).filter(|(_, v)| **v != 0.0).collect();
            assert!(touched.len() == 1 && *touched[0].0 == node, "{touched:?}");
        }
    }
}

#[test]
fn a_position_on_a_border_touches_no_other_nodes() {
    check_border_values(&mixed());
    check_border_values(&hexahedra(4));
    check_border_values(&tetrahedra(3));
}

#[test]
fn positions_outside_have_no_cell_but_a_nearest_one() {
    check_outside(&mixed());
    check_outside(&hexahedra(4));
    check_outside(&tetrahedra(3));
}

/// Distances from a cube, compared with the closed form.
#[test]
fn distances_from_a_cell_are_those_of_a_box() {
    let corners: Vec<[f64; 3]> = (0..8).map(|k| ElementShape::Box.node_coordinates(k)).collect();
    let nodes: Vec<usize> = (0..8).collect();
    let mesh = mesh(&corners, &[(5, nodes)]);
    for x in [[0.3f64, 0.2, 0.9], [2.0, 0.3, -0.4], [-3.0, 2.0, 0.0], [1.5, -1.5, 4.0], [0.0, 0.0, -1.1]] {
        let exact: f64 = x.iter().map(|x| (x.abs() - 1.0f64).max(0.0).powi(2)).sum();
        assert!((mesh.cell(0).distance_squared(&x) - exact).abs() < 1e-14);
    }
}

#[test]
fn cells_fill_the_square_and_boundaries_go_round_it() {
    let mesh = mixed();
    let area: f64 = (0..mesh.n_cells() as u32).map(|cell| mesh.volume(cell)).sum();
    assert!((area - 1.0).abs() < 1e-13);
    assert_eq!(mesh.boundary().len(), 48);
    // Cells lie to the left: boundary edges run counterclockwise.
    let place = |node: u32| mesh.node_position(node as usize);
    let twice = mesh.boundary().iter().map(|b| cross(place(b.side.nodes()[0]), place(b.side.nodes()[1])));
    assert!((twice.sum::<f64>() - 2.0).abs() < 1e-13);
}

#[test]
fn cells_fill_the_cube_and_boundaries_enclose_it() {
    for (mesh, faces) in [(hexahedra(4), 6 * 16), (tetrahedra(3), 2 * 6 * 9)] {
        let volume: f64 = (0..mesh.n_cells() as u32).map(|cell| mesh.volume(cell)).sum();
        assert!((volume - 1.0).abs() < 1e-13);
        assert_eq!(mesh.boundary().len(), faces);
        // Counterclockwise as seen from outside: the divergence theorem gives the volume.
        let mut enclosed = 0.0;
        for boundary in mesh.boundary() {
            let x: Vec<[f64; 3]> =
                boundary.side.nodes().iter().map(|n| mesh.node_position(*n as usize)).collect();
            for k in 1..x.len() - 1 {
                let product = crate::grid::element::vector_product(x[k], x[k + 1]);
                enclosed += crate::grid::element::dot(x[0], product) / 6.0;
            }
        }
        assert!((enclosed - 1.0).abs() < 1e-13, "{enclosed}");
        assert!(mesh.warnings().is_empty());
    }
}

/// Slender triangles around a node, once around or more often: the boxes of many overlap, but they do only if they go
/// around more than once.
#[test]
fn slender_cells_around_a_node_fit_unless_they_go_around_again() {
    let fan = |n: usize, turn: f64| {
        let place = |k: usize| turn * std::f64::consts::TAU * k as f64 / n as f64;
        let closed = usize::from(turn != 1.0);
        let rim = (0..n + closed).map(|k| [place(k).cos(), place(k).sin()]);
        let nodes: Vec<[f64; 2]> = [[0.0; 2]].into_iter().chain(rim).collect();
        let next = |k: usize| if closed == 1 { k + 2 } else { (k + 1) % n + 1 };
        read(&nodes, &(0..n).map(|k| (2, vec![0, k + 1, next(k)])).collect::<Vec<_>>())
    };
    for n in [7, 300] {
        assert_eq!(fan(n, 1.0).unwrap().n_cells(), n);
        assert_eq!(fan(n, 0.9).unwrap().n_cells(), n);
        for turn in [1.1, 2.3] {
            assert!(matches!(fan(n, turn), Err(MeshError::Overlap { n, .. }) if n > 0), "{n}, {turn}");
        }
    }
}

#[test]
fn huge_overlapping_cells_do_not_fill_the_memory() {
    let n = 20_000;
    let spread = |k: usize| 1.0 + k as f64 / n as f64;
    let boxes: Vec<Bounds<2>> = (0..n).map(|k| [[-spread(k); 2], [spread(k); 2]]).collect();
    assert_eq!(Bins::new(&boxes).at(&[0.0, 0.0]).len(), n);
    let boxes: Vec<Bounds<3>> = (0..n).map(|k| [[-spread(k); 3], [spread(k); 3]]).collect();
    assert_eq!(Bins::new(&boxes).at(&[0.0; 3]).len(), n);
}

fn check_basis<const D: usize>(mesh: &Mesh<D>, x: [f64; D]) {
    let located = mesh.locate(&x, None);
    let inside = x.iter().all(|x| (0.0..=1.0).contains(x));
    assert_eq!(located.is_some(), inside, "{x:?}");
    let cell = located.unwrap_or_else(|| mesh.nearest_cell(&x));
    assert_eq!(mesh.locate(&x, Some(cell)), located);
    let basis = mesh.shape(cell, &x);
    let n = basis.nodes().len();
    assert_eq!(basis.nodes(), mesh.cell_nodes(cell));
    assert!(!inside || basis.value().iter().all(|v| *v > -1e-7));
    assert!((basis.value().iter().sum::<f64>() - 1.0).abs() < 1e-13);
    for (d, x) in x.iter().enumerate() {
        let position = |k: usize| mesh.node_position(basis.nodes()[k] as usize)[d];
        let sum: f64 = (0..n).map(|k| basis.value()[k] * position(k)).sum();
        assert!((sum - x).abs() < 1e-13, "{sum} {x}");
        for e in 0..D {
            let slope: f64 = (0..n).map(|k| basis.gradient()[k][e] * position(k)).sum();
            assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-11);
        }
    }
}

/// Far outside, the basis of every cell still reproduces linear fields.
fn check_far_outside<const D: usize>(mesh: &Mesh<D>, x: [f64; D]) {
    for cell in 0..mesh.n_cells() as u32 {
        let basis = mesh.shape(cell, &x);
        for (d, x) in x.iter().enumerate() {
            let position = |k: usize| mesh.node_position(basis.nodes()[k] as usize)[d];
            let sum: f64 = (0..basis.nodes().len()).map(|k| basis.value()[k] * position(k)).sum();
            assert!((sum - x).abs() < 1e-6, "{sum} {x:?}");
        }
    }
}

static MESHES: LazyLock<(Mesh<2>, Mesh<3>, Mesh<3>)> =
    LazyLock::new(|| (mixed(), hexahedra(5), tetrahedra(4)));

proptest! {
    #[test]
    fn the_basis_is_linear_and_the_cell_is_right(x in prop::array::uniform3(-0.05..1.05f64)) {
        let (plane, hexahedra, tetrahedra) = &*MESHES;
        check_basis(plane, [x[0], x[1]]);
        check_basis(hexahedra, x);
        check_basis(tetrahedra, x);
    }

    #[test]
    fn far_outside_the_basis_still_reproduces_linear_fields(x in prop::array::uniform3(-50.0..50.0f64)) {
        let (plane, hexahedra, tetrahedra) = &*MESHES;
        check_far_outside(plane, [x[0], x[1]]);
        check_far_outside(hexahedra, x);
        check_far_outside(tetrahedra, x);
    }
}

#[test]
#[ignore = "a measurement"]
fn point_location_takes_the_same_time_in_small_and_large_meshes() {
    for n in [22, 71, 224, 707] {
        measure("triangles", &|| distorted(n, |_, _| true));
    }
    for n in [8, 18, 39, 84] {
        measure("hexahedra", &|| hexahedra(n));
        measure("tetrahedra", &|| tetrahedra(n));
    }
}

#[expect(clippy::print_stdout, reason = "a measurement for the reader")]
fn measure<const D: usize>(kind: &str, build: &dyn Fn() -> Mesh<D>) {
    let start = Instant::now();
    let mesh = build();
    let build = start.elapsed();
    let queries = 1_000_000;
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut points: Vec<[f64; D]> = (0..queries).map(|_| std::array::from_fn(|_| random())).collect();
    let time = |points: &[[f64; D]], hint: &dyn Fn(usize) -> Option<u32>| {
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
        "{:8} {kind}, read and built in {build:.2?}: {without:.0} ns without hint, {with:.0} with, {ordered:.0} in \
         order; shape {shape:.0} ({sum:.0})",
        mesh.n_cells()
    );
}
