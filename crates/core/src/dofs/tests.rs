//! The map u = C q + g, compared with its definition column by column.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use super::*;

const NODES: usize = 5;

/// Node 0 is held along x, node 1 along a direction, node 2 is tied to nodes 1 and 3, node 4 to node 2 along y.
fn map() -> DofMap<2> {
    let mut constraints = Constraints::<2>::on_nodes(NODES);
    constraints.hold(0, 0, 0.25, 0).unwrap();
    constraints.hold_along(1, [0.6, 0.8], 0.5, 1);
    constraints.tie(4, 1, &[(2, 1, 2.0)], 0.125).unwrap();
    for component in 0..2 {
        constraints.tie(2, component, &[(1, component, 0.5), (3, component, 0.5)], 0.0).unwrap();
    }
    constraints.into_map().unwrap()
}

/// The columns of C.
fn columns(map: &DofMap<2>) -> Vec<Vec<[f64; 2]>> {
    let mut columns = Vec::new();
    map.for_each(|node, component, unknown| {
        if unknown.is_some() {
            let mut q = vec![[0.0; 2]; NODES];
            q[node][component] = 1.0;
            let mut u = vec![[0.0; 2]; NODES];
            map.add_unknowns(&q, &mut u);
            columns.push(u);
        }
    });
    columns
}

fn dot(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

#[test]
fn increments_meet_all_constraints() {
    let map = map();
    assert_eq!(map.n_free(), 2 * NODES - 1 - 1 - 2 - 1);
    assert!(!map.is_plain() && map.conditions(0, 0) == [0]);
    // An arbitrary increment, completed by its remainder and by an arbitrary motion of the unknowns.
    let mut u: Vec<[f64; 2]> = (0..NODES).map(|n| [0.3 * n as f64, 0.1 - n as f64]).collect();
    for round in 0..2 {
        let mut motion = vec![[0.0; 2]; NODES];
        assert_eq!(map.remaining(&u, &mut motion), round == 0);
        let q: Vec<[f64; 2]> = (0..NODES).map(|n| [1.0 + n as f64, -0.7 * n as f64]).collect();
        map.add_unknowns(&q, &mut motion);
        for (u, motion) in u.iter_mut().flatten().zip(motion.iter().flatten()) {
            *u += motion;
        }
        assert!(map.is_reached(&u), "{round}");
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} {b}");
        near(u[0][0], 0.25);
        near(0.6 * u[1][0] + 0.8 * u[1][1], 0.5);
        (0..2).for_each(|c| near(u[2][c], 0.5 * (u[1][c] + u[3][c])));
        near(u[4][1], 2.0 * u[2][1] + 0.125);
    }
}

#[test]
fn forces_on_unknowns_are_those_of_the_transpose() {
    let map = map();
    let force: Vec<[f64; 2]> = (0..NODES).map(|n| [1.0 + n as f64, 0.5 - 2.0 * n as f64]).collect();
    let mut on_unknowns = force.clone();
    map.condense(&mut on_unknowns);
    let condensed = on_unknowns.clone();
    map.on_unknowns(&mut on_unknowns);
    let mut found = Vec::new();
    map.for_each(|node, component, unknown| {
        if unknown.is_some() {
            found.push(on_unknowns[node][component]);
        }
    });
    for (column, found) in columns(&map).iter().zip(&found) {
        assert!((dot(column, &force) - found).abs() < 1e-13, "{found}");
        // Constraint forces do no work on the motions that the constraints leave free.
        let held: Vec<[f64; 2]> = (0..NODES).map(|n| map.held_part(n, &condensed[n])).collect();
        assert!(dot(column, &held).abs() < 1e-13);
    }
}

#[test]
fn expressions_are_the_rows_of_the_map() {
    let map = map();
    let columns = columns(&map);
    for (node, component) in (0..NODES).flat_map(|n| [(n, 0), (n, 1)]) {
        let mut row = vec![0.0; map.n_free()];
        for (n, c, weight) in map.expression(node, component) {
            if let Some(unknown) = map.free(n, c) {
                row[unknown] += weight;
            }
        }
        for (column, row) in columns.iter().zip(&row) {
            assert!((column[node][component] - row).abs() < 1e-15, "{node} {component}");
        }
    }
}

#[test]
fn ties_through_several_others_are_resolved_and_merged() {
    let mut constraints = Constraints::<1>::on_nodes(6);
    // Node 0 is tied to nodes 1 and 2, these two to nodes 3 and 4, and those two to node 5, whose total weight is 4.
    constraints.tie(0, 0, &[(1, 0, 1.0), (2, 0, 1.0)], 0.5).unwrap();
    constraints.tie(1, 0, &[(3, 0, 1.0), (4, 0, 1.0)], 0.0).unwrap();
    constraints.tie(2, 0, &[(3, 0, 1.0), (4, 0, 1.0)], 0.0).unwrap();
    constraints.tie(3, 0, &[(5, 0, 1.0)], 0.0).unwrap();
    constraints.tie(4, 0, &[(5, 0, 1.0)], 0.0).unwrap();
    let map = constraints.into_map().unwrap();
    assert_eq!(map.expression(0, 0), [(5, 0, 4.0)]);
    assert_eq!(map.n_free(), 1);
}

#[test]
fn ties_in_a_circle_are_refused() {
    let mut constraints = Constraints::<1>::on_nodes(3);
    constraints.tie(0, 0, &[(1, 0, 1.0)], 0.0).unwrap();
    constraints.tie(1, 0, &[(0, 0, 1.0)], 0.0).unwrap();
    assert!(matches!(constraints.into_map(), Err(ConstraintError::Tie { .. })));
    let mut constraints = Constraints::<1>::on_nodes(2);
    constraints.hold(0, 0, 0.0, 0).unwrap();
    assert!(constraints.tie(0, 0, &[(1, 0, 1.0)], 0.0).is_err());
}

#[test]
fn increments_agree_up_to_the_round_off_of_a_cell() {
    let mut constraints = Constraints::<2>::on_nodes(1);
    constraints.hold(0, 0, 0.0, 0).unwrap();
    constraints.hold(0, 0, -2.2e-18, 1).unwrap();
    assert!(matches!(constraints.hold(0, 0, 1e-9, 2), Err(ConstraintError::Conflict { .. })));
    let map = constraints.into_map().unwrap();
    assert_eq!(map.conditions(0, 0), [0, 1]);
}
