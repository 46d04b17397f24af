//! Positions on the sharp corners and edges of tools, which may meet sides of domains between their corners.

use crate::model::Model;
use crate::region::{Bounds, BoxTree, boxes_overlap};
use crate::tool::sharp_positions;

use super::motion::Moving;

/// Largest spacing of positions on the edges of a tool, relative to the size of the smallest cell, [-].
const SPACING: f64 = 0.25;

/// Positions on the edges of a tool, at the start of a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges<const D: usize> {
    /// In the frame of the tool, [length].
    in_frame: Option<Vec<[f64; D]>>,
    /// In space, [length].
    positions: Vec<[f64; D]>,
    tree: Option<BoxTree<D>>,
}

impl<const D: usize> Edges<D> {
    /// Moves the positions with the tool; `smallest` is the size of the smallest cell that holds a point, [length].
    pub(super) fn follow(&mut self, model: &Model<D>, tool: usize, moving: &Moving<D>, smallest: f64) {
        let shape = model.tools[tool].shape.as_ref();
        let known = self.in_frame.get_or_insert_with(|| {
            if shape.has_edges() { sharp_positions(shape, SPACING * smallest) } else { Vec::new() }
        });
        self.positions = known.iter().map(|x| moving.start.to_space(x)).collect();
        let boxes: Vec<Bounds<D>> = self.positions.iter().map(|x| [*x, *x]).collect();
        self.tree = (!boxes.is_empty()).then(|| BoxTree::new(&boxes));
    }

    /// True if the tool has no edges.
    pub(super) fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The positions in a box, with their numbers.
    pub(super) fn within(&self, bounds: &Bounds<D>) -> Vec<(usize, [f64; D])> {
        let mut found = Vec::new();
        if let Some(tree) = &self.tree {
            tree.visit(
                |other| boxes_overlap(other, bounds),
                |item| {
                    let number = tree.order[item] as usize;
                    found.push((number, self.positions[number]));
                },
            );
        }
        found.retain(|(_, x)| (0..D).all(|d| bounds[0][d] <= x[d] && x[d] <= bounds[1][d]));
        found.sort_unstable_by_key(|(number, _)| *number);
        found
    }
}
