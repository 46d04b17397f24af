//! Requirements of a body of revolution: points that represent rings, a grid on one side of the axis, and gravity along
//! the axis. The check that nodes on the axis stay there is part of setting up the first step.

use crate::diagnostic::Diagnostic;
use crate::load::LoadedDeck;
use mpm_core::dofs::ON_AXIS;
use mpm_core::grid::Grid;
use mpm_core::points::Seed;

/// Turns points that represent areas into points that represent full rings about the axis.
pub(crate) fn revolve<const D: usize>(seeds: &mut [Seed<D>]) {
    for seed in seeds {
        let circumference = std::f64::consts::TAU * seed.position[0];
        seed.volume *= circumference;
        seed.mass *= circumference;
    }
}

/// Faults in the grid and the loads of a body of revolution.
pub(crate) fn faults<const D: usize>(loaded: &LoadedDeck, grid: &dyn Grid<D>) -> Vec<Diagnostic> {
    let error = |pointer: &str, message: String| Diagnostic::at(&loaded.source, "D046", pointer, message);
    let mut found = Vec::new();
    let leftmost = grid.bounds()[0][0];
    let is_beyond = |node: usize| grid.node_position(node)[0] < -ON_AXIS * grid.size_around(node);
    if leftmost < 0.0 && (0..grid.n_nodes()).any(is_beyond) {
        let message = format!("the grid begins at x = {leftmost}, beyond the axis of revolution x = 0");
        found.push(error("/grid", message).help("x is the distance from the axis: begin the grid at x = 0"));
        return found;
    }
    for (number, load) in loaded.deck.loads.iter().enumerate() {
        if load.acceleration().and_then(<[f64]>::first).is_some_and(|radial| *radial != 0.0) {
            let pointer = format!("/loads/{number}/acceleration/0");
            let message = "gravity cannot act along the radius of a body of revolution".to_owned();
            let help = "set the first component to 0, or use a load of type `body-force`";
            found.push(error(&pointer, message).help(help));
        }
    }
    found
}
