//! Decks in space, from text to the last step: rigid rotation, a column compared with the plane, every kind of region.

use std::path::Path;

use mpm::deck::build::build;
use mpm::deck::load::{LoadedDeck, load, load_text};
use mpm::model::Model;
use mpm::points::Points;
use mpm::region::{Accuracy, Frustum, Motion, Region};
use mpm::solver::{self, Silent};
use mpm::tensor::Sym3;

fn loaded(text: &str) -> LoadedDeck {
    let mut loaded = load_text("deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"));
    loaded.directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    loaded
}

/// A deck of `inputs/` with parameters set.
pub fn inputs_deck(deck: &str, set: &[(&str, &str)]) -> LoadedDeck {
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(deck);
    load(&path, &set).unwrap_or_else(|e| panic!("{e}"))
}

/// Final points of an analysis in space, of a deck in `inputs/` with parameters set.
pub fn run_of_inputs(deck: &str, set: &[(&str, &str)]) -> Points<3> {
    let (model, mut points) = build(&inputs_deck(deck, set)).unwrap_or_else(|found| panic!("{found:?}"));
    solver::run(&model, &mut points, &mut Silent).unwrap_or_else(|error| panic!("{error}"));
    points
}

fn solid(text: &str) -> (Model<3>, Points<3>) {
    build(&loaded(text)).unwrap_or_else(|found| panic!("{found:?}"))
}

fn largest(stress: &[Sym3]) -> f64 {
    stress.iter().flat_map(|tau| tau.0).fold(0.0, |most, tau| most.max(tau.abs()))
}

/// Largest stress, relative to Young's modulus, in a ball in the middle of the grid that is rotated by 40° about an
/// oblique axis: the motion of the nodes around it is prescribed.
fn turned(grid: &str, body: &str, centre: f64) -> f64 {
    let angle = 40f64.to_radians();
    let turn = Motion::<3>::rotation([1.0, 2.0, 3.0], angle, [centre; 3]).unwrap();
    let origin = turn.apply(&[0.0; 3]);
    let column = |d: usize| {
        let mut unit = [0.0; 3];
        unit[d] = 1.0;
        let image = turn.apply(&unit);
        [0, 1, 2].map(|i| image[i] - origin[i])
    };
    let columns = [0, 1, 2].map(column);
    let u = |i: usize| {
        let term =
            |d: usize| format!("({:e})*{}", columns[d][i] - f64::from(u8::from(i == d)), ["x", "y", "z"][d]);
        format!("\"{:e} + {} + {} + {}\"", origin[i], term(0), term(1), term(2))
    };
    let text = format!(
        "
version: 1
analysis: {{idealisation: solid}}
grid: {grid}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: ball, material: m, {body}}}]
boundary_conditions: [{{name: skin, nodes: {{outer_layer: ball}}, ux: {}, uy: {}, uz: {}}}]
steps: {{count: 1}}
",
        u(0),
        u(1),
        u(2)
    );
    let (model, mut points) = solid(&text);
    let inner = points.outer_layer.iter().filter(|outer| !**outer).count();
    assert!(inner > 0 && inner < points.len(), "{inner} of {}", points.len());
    let reached = solver::run(&model, &mut points, &mut Silent).unwrap();
    assert!(reached.summary.unknowns > 0);
    for p in 0..points.len() {
        let (x, expected) = (points.converged.position[p], turn.apply(&points.original_position[p]));
        assert!((0..3).all(|d| (x[d] - expected[d]).abs() < 1e-10), "{x:?} {expected:?}");
    }
    largest(&points.converged.kirchhoff_stress) / 1e6
}

#[test]
fn a_rigid_rotation_leaves_no_stress() {
    let structured = "{type: structured, origin: [0, 0, 0], size: [4, 4, 4], spacing: 0.25}";
    let ball = "shape: {type: sphere, center: [2, 2, 2], radius: 1.25}, points_per_cell: 2";
    for method in ["mpm", "gimp", "cpdi1", "cpdi2"] {
        let stress = turned(structured, &format!("{ball}, method: {method}"), 2.0);
        println!("{method}: stress {stress:.1e} of Young's modulus");
        assert!(stress < 1e-10, "{method}: {stress:e}");
    }
    let tetrahedra = "{type: gmsh, file: mesh/block_tetrahedra.msh}";
    let ball = "shape: {type: sphere, center: [4, 4, 4], radius: 3.8}, points_per_tetrahedron: 8";
    let stress = turned(tetrahedra, &format!("{ball}, method: mpm"), 4.0);
    println!("tetrahedra: stress {stress:.1e} of Young's modulus");
    assert!(stress < 1e-10, "{stress:e}");
}

/// The column of `inputs/compaction.yaml` with a square cross-section: nothing depends on the third axis.
#[test]
fn a_column_in_space_is_that_of_the_plane() {
    let inputs = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs/compaction.yaml");
    for (method, update) in [("gimp", "stretch"), ("mpm", "none"), ("cpdi2", "corners")] {
        let set = [("method", method), ("update", update)].map(|(k, v)| (k.to_owned(), v.to_owned()));
        let (model, mut plane) = build::<2>(&load(&inputs, &set).unwrap()).unwrap();
        solver::run(&model, &mut plane, &mut Silent).unwrap();
        let (model, mut space) = solid(&format!(
            "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [3.125, 3.125, 50], spacing: 3.125}}
materials: {{soil: {{model: hencky, young: 1e6, poisson: 0, density: 80}}}}
bodies:
  - {{name: column, material: soil, shape: {{type: box, min: [0, 0, 0], max: [3.125, 3.125, 50]}},
     method: {method}, {} points_per_cell: 2}}
boundary_conditions:
  - {{name: sides, nodes: {{box: {{min: [0, 0, 0], max: [3.125, 3.125, 50]}}}}, fix: [x, y]}}
  - {{name: base, nodes: {{z: 0}}, fix: [z]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, 0, -10]}}
steps: {{count: 20}}
",
            if method == "gimp" { format!("domain_update: {update},") } else { String::new() }
        ));
        solver::run(&model, &mut space, &mut Silent).unwrap();
        let (mut differs, mut error) = (0.0f64, 0.0);
        let by_height = |id: usize| (id / 4) * 2; // space has four points where the plane has two
        let order = plane.by_id();
        for (id, p) in space.by_id().into_iter().enumerate() {
            let q = order[by_height(id)];
            let (tau, expected) = (space.converged.kirchhoff_stress[p], plane.converged.kirchhoff_stress[q]);
            differs = differs.max((tau.0[2] - expected.0[1]).abs());
            let sigma = tau.0[2] / space.converged.deformation_gradient[p].determinant();
            error += (sigma + 800.0 * (50.0 - space.original_position[p][2])).abs();
        }
        let error = error / (space.len() as f64 * 800.0 * 50.0);
        println!("{method}: {differs:.1e} from the plane, error {error:.4} of the closed form");
        assert!(differs < 1e-9 * 4e4, "{method}: {differs:e}");
        assert!(error < 0.05, "{method}: {error}");
    }
}

/// Volume of the points of a body on a grid with this spacing.
fn volume(shape: &str, spacing: f64) -> f64 {
    let (_, points) = solid(&format!(
        "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [4, 4, 4], spacing: {spacing}}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: body, material: m, shape: {shape}, method: mpm, points_per_cell: 2}}]
boundary_conditions: [{{name: base, nodes: {{z: 0}}, fix: [x, y, z]}}]
steps: {{count: 1}}
"
    ));
    points.original_volume.iter().sum()
}

#[test]
fn the_volume_of_the_points_of_every_region_tends_to_its_own() {
    use std::f64::consts::PI;
    let cone = Frustum::new([2.0, 2.0, 0.3], [2.0, 2.0, 3.3], [1.5, 0.0]).unwrap();
    let ball = mpm::region::Ball::new([2.0, 2.0, 1.0], 1.0).unwrap();
    let both = Region::intersection(vec![cone.into(), ball.into()]).unwrap();
    let union = both.volume(Accuracy::default()).unwrap().value;
    let mut squares = [0.0; 4];
    for (shape, exact) in [
        (
            "{type: union, of: [{type: box, min: [0.1, 0.2, 0.3], max: [2.3, 3.1, 1.7]}]}".to_owned(),
            2.2 * 2.9 * 1.4,
        ),
        ("{type: cylinder, start: [1, 1, 1], end: [3, 2.5, 2.5], radius: 0.8}".to_owned(), {
            PI * 0.64 * (4.0f64 + 2.25 + 2.25).sqrt()
        }),
        ("{type: cone, start: [2, 2, 0.3], end: [2, 2, 3.3], radii: [1.5, 0]}".to_owned(), PI * 2.25),
        ("{type: cone, start: [2, 2, 0.3], end: [2, 2, 3.3], radii: [0.5, 1]}".to_owned(), PI * 1.75),
        ("{type: sphere, center: [2, 2, 1.9], radius: 1.6}".to_owned(), 4.0 / 3.0 * PI * 1.6f64.powi(3)),
        (
            "{type: extrusion, polygon: [[0.3, 0.2], [3.6, 0.4], [1.1, 3.3]], axis: y, from: 0.7, to: 2.9}"
                .to_owned(),
            0.5 * (3.3 * 3.1 - 0.8 * 0.2) * 2.2,
        ),
        // Shifted off the lattice of the points: points on the surface would all count as inside.
        (
            "{type: translate, by: [0.037, 0.051, 0.023], shape: {type: stl, file: pyramid.stl}}".to_owned(),
            4.0,
        ),
        (
            "{type: difference, from: {type: sphere, center: [2, 2, 2], radius: 1.7},
              minus: [{type: sphere, center: [2, 2, 2], radius: 0.9}]}"
                .to_owned(),
            4.0 / 3.0 * PI * (1.7f64.powi(3) - 0.9f64.powi(3)),
        ),
        (
            "{type: union, of: [{type: sphere, center: [1, 1, 1], radius: 0.9},
              {type: translate, by: [2, 2, 2], shape: {type: sphere, center: [1, 1, 1], radius: 0.9}}]}"
                .to_owned(),
            8.0 / 3.0 * PI * 0.729,
        ),
        (
            "{type: intersection, of: [{type: cone, start: [2, 2, 0.3], end: [2, 2, 3.3], radii: [1.5, 0]},
              {type: sphere, center: [2, 2, 1], radius: 1}]}"
                .to_owned(),
            union,
        ),
        (
            "{type: rotate, angle: 30, center: [2, 2, 2], axis: [1, 1, 0.3],
              shape: {type: box, min: [1, 1.1, 1.2], max: [2.9, 3, 2.6]}}"
                .to_owned(),
            1.9 * 1.9 * 1.4,
        ),
    ] {
        let errors = [1.0, 0.5, 0.25, 0.125].map(|h| volume(&shape, h) / exact - 1.0);
        let word = shape.split([',', '{', ' ']).nth(2).unwrap();
        println!("{word}: {}", errors.map(|e| format!("{e:+.4}")).join(" "));
        // The error of the cut cells may have either sign and decreases with the cell size.
        assert!(errors[3].abs() < 0.02 && errors[2].abs() < 0.06, "{shape}: {errors:?}");
        (0..4).for_each(|k| squares[k] += errors[k] * errors[k]);
    }
    println!("root of the sum of squares: {:.4?}", squares.map(f64::sqrt));
    assert!(squares.windows(2).all(|pair| pair[1] < 0.5 * pair[0]), "{squares:?}");
}

/// Hexahedra and tetrahedra of mesh groups: the points must have the entire volume of these cells.
#[test]
fn groups_of_a_mesh_are_filled_to_the_last() {
    let deck = |group: &str, points: &str| {
        solid(&format!(
            "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: gmsh, file: mesh/solid_4.1_text.msh}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: body, material: m, shape: {{type: cells, group: {group}}}, {points}}}]
boundary_conditions: [{{name: base, nodes: {{group: floor}}, fix: [x, y, z]}}]
loads: [{{name: pull, type: body-force, force: [0, 0, 1e4]}}]
steps: {{count: 1}}
"
        ))
    };
    for (group, points, exact) in [
        ("soil body", "method: cpdi2, points_per_cell: [1, 2, 3]", 2.0),
        ("rock", "method: mpm, points_per_tetrahedron: 8", 0.7),
        ("rock", "method: cpdi2, points_per_tetrahedron: 4", 0.7),
        ("all of it", "method: mpm, points_per_cell: 2, points_per_tetrahedron: 1", 2.7),
    ] {
        let (model, mut points) = deck(group, points);
        let cells = model.grid.cell_set(group).unwrap();
        let cell_volume: f64 = cells.iter().map(|&cell| model.grid.volume(cell as usize)).sum();
        let point_volume: f64 = points.original_volume.iter().sum();
        println!("{group}: {point_volume:.6} of {exact:.6}");
        assert!((point_volume / cell_volume - 1.0).abs() < 1e-13, "{point_volume} {cell_volume}");
        assert!((point_volume - exact).abs() < 1e-9, "{point_volume} {exact}");
        // Domains that fill the grid would extend beyond it.
        if points.corners_per_point == 0 {
            solver::run(&model, &mut points, &mut Silent).unwrap();
            assert!(largest(&points.converged.kirchhoff_stress) > 1e3);
        }
    }
}

#[test]
fn a_deck_of_another_dimension_is_no_panic() {
    let found = build::<2>(&loaded(
        "
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [4, 4, 4], spacing: 1}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies: [{name: body, material: m, shape: {type: cells}, points_per_cell: 2}]
boundary_conditions: [{name: base, nodes: {z: 0}, fix: [x, y, z]}]
steps: {count: 1}
",
    ))
    .unwrap_err();
    assert_eq!(found[0].code, "D048");
}
