//! Messages and diagnoses of analyses in which a step has no equilibrium.
#![allow(non_snake_case)]
#![allow(clippy::unwrap_used)]

use std::path::Path;

use mpm::assembly::Wanted;
use mpm::basis::Connectivity;
use mpm::deck::build::build;
use mpm::deck::load::{load, load_text};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{self, Silent, SolveError};
use mpm::step::{At, StepContext};
use mpm::stress::PlaneStrain;
use mpm::terms::Sum;
use mpm::terms::external_force::external_force;
use nalgebra::{DMatrix, DVector};

fn cantilever() -> (Model<2>, Points<2>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs/beam.yaml");
    let set = [("method", "mpm"), ("n", "2"), ("steps", "4")].map(|(k, v)| (k.to_owned(), v.to_owned()));
    build(&load(&path, &set).unwrap()).unwrap()
}

/// Position of a node and the force out of balance there.
type Imbalance = ([f64; 2], [f64; 2]);

/// State of the first load step after one linear solve, computed with dense matrices: the out-of-balance force at every
/// active node, and the residual of eq. (40).
fn after_one_solve() -> (Vec<Imbalance>, f64) {
    let (model, mut points) = cantilever();
    let methods = model.methods();
    let links = Connectivity::new(model.grid.as_ref(), &mut points, &methods).unwrap();
    let n = links.n_active();
    let place: Vec<[f64; 2]> =
        links.active_nodes().iter().map(|&node| model.grid.node_position(node as usize)).collect();
    // The root is fixed along x, its middle node also along y.
    let free: Vec<usize> = (0..2 * n)
        .filter(|i| {
            let [x, y] = place[i / 2];
            if i % 2 == 0 { x != 0.0 } else { x != 0.0 || y != 9.5 }
        })
        .collect();

    let mut sum = Sum::from_model::<PlaneStrain>(&StepContext::first(&model, &links), &points).unwrap();
    let at_rest = vec![[0.0; 2]; n];
    sum.evaluate(&StepContext::first(&model, &links), &mut points, At::new(&at_rest), Wanted::Stiffness)
        .unwrap();
    let f_ext =
        external_force(&model, &points, &links, model.stepping.end_time / model.stepping.count as f64)
            .unwrap()
            .nodal;
    let mut times = |x: &[[f64; 2]]| {
        let mut out = at_rest.clone();
        sum.system_mut().multiply(x, &mut out);
        out
    };
    let mut K = DMatrix::zeros(2 * n, 2 * n);
    for j in 0..2 * n {
        let mut unit = at_rest.clone();
        unit[j / 2][j % 2] = 1.0;
        K.column_mut(j).copy_from_slice(times(&unit).as_flattened());
    }
    let load = DVector::from_iterator(free.len(), free.iter().map(|&i| f_ext[i / 2][i % 2]));
    let solution = K.select_rows(&free).select_columns(&free).lu().solve(&load).unwrap();
    let mut delta_d = at_rest.clone();
    for (&i, u) in free.iter().zip(&solution) {
        delta_d[i / 2][i % 2] = *u;
    }
    let resisted = times(&delta_d);
    sum.evaluate(&StepContext::first(&model, &links), &mut points, At::new(&delta_d), Wanted::Stiffness)
        .unwrap();

    let (mut forces, mut out, mut applied) = (Vec::new(), 0.0, 0.0);
    for a in 0..n {
        let total: [f64; 2] = std::array::from_fn(|d| {
            // External force, plus the linearised reaction where the node is fixed.
            if free.contains(&(2 * a + d)) { f_ext[a][d] } else { resisted[a][d] }
        });
        let force: [f64; 2] = std::array::from_fn(|d| total[d] - sum.system().internal_force()[a][d]);
        out += force[0].powi(2) + force[1].powi(2);
        applied += total[0].powi(2) + total[1].powi(2);
        forces.push((place[a], force));
    }
    (forces, (out / applied).sqrt())
}

#[test]
fn the_node_farthest_from_equilibrium_is_named() {
    let (mut model, mut points) = cantilever();
    model.newton.max_iterations = 1;
    model.stepping.smallest = 1.0;
    let error = solver::run(&model, &mut points, &mut Silent).unwrap_err();
    let message = error.to_string();
    let SolveError::NotConverged { step, residuals, worst } = error else { panic!("{message}") };
    assert_eq!((step, residuals.len()), (1, 2));

    let (forces, residual) = after_one_solve();
    assert!((residuals[1] / residual - 1.0).abs() < 1e-6, "{} instead of {residual}", residuals[1]);
    let size = |f: &[f64; 2]| f[0].hypot(f[1]);
    let (place, force) = forces.iter().max_by(|a, b| size(&a.1).total_cmp(&size(&b.1))).unwrap();
    let next = forces.iter().filter(|f| f.0 != *place).map(|f| size(&f.1)).fold(0.0, f64::max);
    assert!(next < 0.999 * size(force), "the case does not tell the nodes apart");
    let worst = worst.unwrap();
    assert_eq!(worst.position, place);
    for d in 0..2 {
        assert!((worst.force[d] - force[d]).abs() < 1e-6 * size(force), "{worst:?} instead of {force:?}");
    }
    assert!(message.contains(&format!("node ({:.6}, {:.6})", place[0], place[1])), "{message}");
}

/// Error of a square with one point per cell, in a grid of 6 × 6 cells of side 1.
fn failure_of_square(side: u32, method: &str, rest: &str) -> SolveError {
    let text = format!(
        "version: 1
grid: {{type: structured, origin: [0, 0], size: [6, 6], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e3, poisson: 0}}}}
bodies: [{{name: square, material: m, shape: {{type: box, min: [0, 0], max: [{side}, {side}]}},
          method: {method}, points_per_cell: 1}}]
{rest}"
    );
    let (mut model, mut points) = build::<2>(&load_text("deck", text.as_bytes(), &[]).unwrap()).unwrap();
    model.stepping.smallest = 1.0;
    solver::run(&model, &mut points, &mut Silent).unwrap_err()
}

/// The last step must check its result, because no later step would.
#[test]
fn a_domain_that_leaves_the_grid_is_an_error() {
    let rest = "boundary_conditions: [{name: all, nodes: {outer_layer: square}, ux: 0.5*X + 0.6, uy: 0}]
steps: {count: 3}";
    for method in ["cpdi1", "cpdi2"] {
        let error = failure_of_square(4, method, rest);
        let text = error.to_string();
        assert!(matches!(error, SolveError::Domain { step: 3, .. }), "{text}");
        assert_eq!(
            text,
            "step 3: point 3 of body `square` at (5.850000, 0.500000): corner 1 of its domain, at (6.600000, 0.000000), \
             is outside the grid"
        );
    }
}

#[test]
fn a_domain_that_crosses_itself_is_an_error() {
    let rest = "boundary_conditions:
  - {name: all, nodes: {outer_layer: square}, uy: 0,
     ux: 'if(y > 0.5, if(x < 0.5, 0.8, -0.5), 0)'}
steps: {count: 1}";
    let error = failure_of_square(1, "cpdi2", rest);
    assert!(matches!(error, SolveError::Domain { step: 1, .. }), "{error}");
    assert_eq!(
        error.to_string(),
        "step 1: point 0 of body `square` at (0.575000, 0.500000): its domain is inverted or crosses itself"
    );
}

/// The deck is checked before the run; later steps can only be checked when they begin.
#[test]
fn what_the_first_step_cannot_begin_with_is_an_error_of_any_step() {
    let error = failure_of_square(
        2,
        "mpm",
        "boundary_conditions: [{name: base, nodes: {y: 0}, fix: [y]}]\nsteps: {count: 1}",
    );
    assert!(matches!(error, SolveError::Unheld { step: 1, axis: 0, .. }), "{error}");
    let rest = "boundary_conditions:
  - {name: base, nodes: {y: 0}, ux: 'factor^2 - factor', uy: 0}
  - {name: side, nodes: {x: 0}, ux: 'factor - factor^2'}
steps: {count: 2, end_time: 2}";
    let error = failure_of_square(2, "mpm", rest);
    let text = error.to_string();
    assert!(matches!(error, SolveError::Constraint { step: 1, .. }), "{text}");
    assert!(text.contains("boundary conditions `base` and `side`"), "{text}");
}

#[test]
fn formulas_without_value_are_quoted() {
    let base = "boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]\n";
    let force = |where_, force: &str| {
        format!(
            "{base}loads: [{{name: push, type: body-force, where: {{{where_}}}, force: [1, '{force}']}}]
steps: {{count: 2}}"
        )
    };
    for (rest, expected) in [
        (
            force("", "sqrt(1 - X)"),
            "step 1: load `push` is not finite at point 1 of body `square` at (1.500000, 0.500000): the formula \
             `sqrt(1 - X)` gives NaN at load factor 0.5",
        ),
        (
            force("r: 2*q, q: 1/(y - 1.5)", "r + X"),
            "step 1: load `push` is not finite at point 2 of body `square` at (0.500000, 1.500000): the formula \
             `1/(y - 1.5)` gives inf at load factor 0.5",
        ),
        (
            "boundary_conditions: [{name: base, nodes: {y: 0}, ux: 1/x, uy: 0}]\nsteps: {count: 2}"
                .to_owned(),
            "step 1: the displacement of boundary condition `base` along x is not finite at (0.000000, 0.000000): \
             the formula `1/x` gives inf at load factor 0.5",
        ),
    ] {
        assert_eq!(failure_of_square(2, "mpm", &rest).to_string(), expected);
    }
}
