//! Graded grids from decks: lines, points in their cells, the selection of nodes.
#![allow(clippy::unwrap_used)]

use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::model::{Model, NodeSet};
use mpm::points::Points;

const DECK: &str = "
version: 1
grid: {type: structured, origin: [1, 0], size: [9, 4],
  spacing: [[{to: 3, cells: 4}, {to: 10, cells: 5, ratio: 1.2}], NORMAL]}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 2}}
bodies: [{name: b, material: m, method: METHOD, SHAPE}]
boundary_conditions: [{name: low, nodes: {LINE}, fix: [x, y]}]
loads: [{name: weight, type: gravity, acceleration: [0, -1]}]
steps: {count: 1}
";

fn text(changes: &[(&str, &str)]) -> String {
    let defaults = [
        ("NORMAL", "0.5"),
        ("METHOD", "gimp"),
        ("SHAPE", "shape: {type: box, min: [1, 0], max: [10, 2]}, points_per_cell: [2, 3]"),
        ("LINE", "y: 0"),
    ];
    let replace = |text: String, (name, value): &(&str, &str)| text.replace(name, value);
    defaults.iter().fold(changes.iter().fold(DECK.to_owned(), replace), replace)
}

fn deck(changes: &[(&str, &str)]) -> (Model<2>, Points<2>) {
    let loaded =
        load_text("deck", text(changes).as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
    build(&loaded).unwrap_or_else(|found| panic!("{found:?}"))
}

fn messages(changes: &[(&str, &str)]) -> Vec<String> {
    let loaded =
        load_text("deck", text(changes).as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
    let found = build::<2>(&loaded).unwrap_err();
    found
        .iter()
        .map(|found| format!("{} {}", found.message, found.help.clone().unwrap_or_default()))
        .collect()
}

#[test]
fn lines_are_those_of_the_intervals() {
    let (model, _) = deck(&[]);
    let grid = model.grid.lines().unwrap();
    let first = 7.0 * 0.2 / (1.2_f64.powi(5) - 1.0);
    let exact = [1.0, 1.5, 2.0, 2.5, 3.0, 3.0 + first, 3.0 + 2.2 * first, 3.0 + 3.64 * first];
    for (line, exact) in exact.iter().enumerate() {
        assert!((grid.axes()[0].line(line) - exact).abs() < 1e-14, "{line}");
    }
    assert_eq!((grid.cells(), grid.upper()), ([9, 8], [10.0, 4.0]));
    assert!(grid.axes()[1].is_even());
}

/// The points of a cell lie at the centres of its parts, and their domains fill it, whether a box ends on grid lines or
/// the cells are filled one by one.
#[test]
fn points_are_a_uniform_lattice_within_each_cell() {
    let cells =
        "shape: {type: polygon, vertices: [[1, 0], [10, 0], [10, 2], [1, 2]]}, points_per_cell: [2, 3]";
    for shape in [None, Some(("SHAPE", cells))] {
        for method in ["gimp", "cpdi2"] {
            let (model, points) = deck(&[&[("METHOD", method)], shape.as_slice()].concat());
            let grid = model.grid.lines().unwrap();
            assert_eq!(points.len(), 9 * 4 * 6);
            for p in 0..points.len() {
                let x = points.converged.position[p];
                let cell = grid.locate_index(&x).unwrap();
                let sides = grid.sides(cell);
                for (d, n) in [2.0, 3.0].into_iter().enumerate() {
                    let place = n * grid.local(cell, &x)[d];
                    assert!((place - place.floor() - 0.5).abs() < 1e-10, "{x:?}");
                    let half = if method == "gimp" {
                        points.half_lengths(p)[d]
                    } else {
                        0.5 * (points.corners(p)[3][d] - points.corners(p)[0][d])
                    };
                    assert!((half - 0.5 * sides[d] / n).abs() < 1e-14);
                }
                assert!((points.original_volume[p] - sides[0] * sides[1] / 6.0).abs() < 1e-14);
            }
            assert!((points.mass.iter().sum::<f64>() - 2.0 * 18.0).abs() < 1e-12);
        }
    }
}

#[test]
fn nodes_are_selected_on_lines_and_messages_name_the_nearest() {
    let (model, _) = deck(&[("LINE", "x: 3")]);
    let NodeSet::Fixed(nodes) = &model.boundary_conditions[0].nodes else { panic!("given nodes") };
    assert_eq!(nodes.len(), 9);
    assert!(nodes.iter().all(|node| model.grid.node_position(*node as usize)[0] == 3.0));
    let found = messages(&[("LINE", "x: 2.9")]);
    assert!(found[0].contains("no grid line lies at x = 2.9") && found[0].contains("x = 3"), "{found:?}");
    let found = messages(&[("LINE", "box: {min: [3.1, 0.1], max: [3.3, 0.2]}")]);
    assert!(
        found[0].contains("grid nodes lie at 3 or 3.94") && found[0].contains("0 + j 0.5 in y"),
        "{found:?}"
    );
}

/// If a body ends inside a cell, the message names the nearest line; the local cell size decides what counts as near.
#[test]
fn bodies_must_end_on_graded_lines() {
    let shape = "shape: {type: box, min: [1, 0], max: [3.1, 2]}, points_per_cell: 2";
    let failure = load_text("deck", text(&[("SHAPE", shape)]).as_bytes(), &[]).unwrap_err();
    assert!(failure.to_string().contains("is 0.1 away from the nearest grid line, x = 3"), "{failure}");
    let (_, points) =
        deck(&[("SHAPE", "shape: {type: box, min: [1, 0], max: [3.1, 2]}, point_spacing: [0.3, 0.25]")]);
    assert_eq!(points.len(), 7 * 8);
    // One point per cell in the smallest cells of the body, although other cells are larger.
    let coarse = "shape: {type: box, min: [1, 0], max: [10, 2]}, point_spacing: 0.5";
    let loaded = load_text("deck", text(&[("SHAPE", coarse)]).as_bytes(), &[]).unwrap();
    assert!(loaded.notes.iter().any(|note| note.code == "D038"), "{:?}", loaded.notes);
}
