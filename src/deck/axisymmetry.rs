//! What a body of revolution asks of a deck: points that stand for rings, a grid on one side of the axis, nodes that
//! stay on it, and a weight along it.

use super::LoadDeck;
use super::diagnostic::Diagnostic;
use super::load::LoadedDeck;
use crate::constraints::{BoundaryCondition, NodeSet};
use crate::grid::Grid;
use crate::points::Seed;

/// Nodes nearer to the axis than this, relative to the size of a cell, lie on it.
const ON_AXIS: f64 = 1e-6;

/// Turns points that stand for areas into points that stand for the rings they describe, the full circle.
pub(super) fn revolve<const D: usize>(seeds: &mut [Seed<D>]) {
    for seed in seeds {
        let circumference = std::f64::consts::TAU * seed.position[0];
        seed.volume *= circumference;
        seed.mass *= circumference;
    }
}

/// What is wrong with the grid, the boundary conditions and the loads of a body of revolution.
pub(super) fn faults<const D: usize>(
    loaded: &LoadedDeck,
    grid: &dyn Grid<D>,
    conditions: &[BoundaryCondition<D>],
) -> Vec<Diagnostic> {
    let error = |pointer: &str, message: String| Diagnostic::at(&loaded.source, "D046", pointer, message);
    let mut found = Vec::new();
    let slack = ON_AXIS * grid.size(0);
    let leftmost = grid.bounds()[0][0];
    if leftmost < -slack {
        let message = format!("the grid begins at x = {leftmost}, beyond the axis of revolution x = 0");
        found.push(
            error("/grid", message).help("x is the distance from the axis: let the grid begin at x = 0"),
        );
        return found;
    }
    // The ring through a node on the axis has no radius; nothing else may move the node off it.
    let on_axis: Vec<u32> =
        (0..grid.n_nodes() as u32).filter(|&n| grid.node_position(n as usize)[0] <= slack).collect();
    let held = |node: &u32| {
        let values = [&grid.node_position(*node as usize)[..], &[1.0]].concat();
        conditions.iter().any(|condition| match (&condition.nodes, &condition.displacement[0]) {
            (NodeSet::Fixed(nodes), Some(u)) => {
                nodes.binary_search(node).is_ok() && u.evaluate(&values) == 0.0
            }
            _ => false,
        })
    };
    let loose = on_axis.iter().filter(|node| !held(node)).count();
    if loose > 0 {
        let message =
            format!("{loose} of the {} grid nodes on the axis x = 0 can move off it", on_axis.len());
        let help = "add `{name: axis, nodes: {x: 0}, fix: [x]}` to the boundary conditions";
        found.push(error("/boundary_conditions", message).help(help));
    }
    for (number, load) in loaded.deck.loads.iter().enumerate() {
        if let LoadDeck::Gravity { acceleration, .. } = load
            && acceleration.first().is_some_and(|radial| *radial != 0.0)
        {
            let pointer = format!("/loads/{number}/acceleration/0");
            let message = "a weight cannot act along the radius of a body of revolution".to_owned();
            let help = "set the first component to 0, or use a load of type `body-force`";
            found.push(error(&pointer, message).help(help));
        }
    }
    found
}
