//! The size of the cells to which softening is adapted.

use crate::{Deck, GridDeck};
use mpm_core::grid::Axis;

/// Size of the cells in which a material softens, [length].
#[derive(Debug, Clone, PartialEq, Default)]
pub enum CellSize {
    /// No cells are known: softening is not adapted to them.
    #[default]
    Unknown,
    /// The same size everywhere.
    Even(f64),
    /// The mean cell size of a mesh, used everywhere.
    Mean(f64),
    /// The size varies as in a structured grid with these axes.
    Graded(Vec<Axis>),
}

impl CellSize {
    /// The cell size of the structured grid of a deck; unknown for a mesh, which must be read first.
    pub(crate) fn in_deck(deck: &Deck) -> CellSize {
        let GridDeck::Structured { origin, size, spacing, .. } = &deck.grid else { return CellSize::Unknown };
        let entries = spacing.entries(deck.dimensions());
        let ends = entries.iter().zip(origin).zip(size);
        let axes: Result<Vec<Axis>, _> =
            ends.map(|((entry, origin), size)| entry.axis(*origin, *size)).collect();
        axes.map_or(CellSize::Unknown, |axes| CellSize::structured(&axes))
    }

    /// The cell size of a structured grid.
    pub(crate) fn structured(axes: &[Axis]) -> CellSize {
        let graded = CellSize::Graded(axes.to_vec());
        let origin = axes.iter().map(|axis| axis.line(0)).chain([0.0; 3]);
        let mut corner = [0.0; 3];
        corner.iter_mut().zip(origin).for_each(|(x, line)| *x = line);
        if axes.iter().all(Axis::is_even) { CellSize::Even(graded.at(&corner)) } else { graded }
    }

    /// The size of the cell at a position: the geometric mean of its sides, which is the side of a cube (square) of the
    /// same volume.
    pub(super) fn at(&self, position: &[f64; 3]) -> f64 {
        match self {
            CellSize::Unknown => f64::NAN,
            CellSize::Even(size) | CellSize::Mean(size) => *size,
            CellSize::Graded(axes) => {
                let sides = axes.iter().zip(position).map(|(axis, x)| axis.size_at(*x));
                sides.product::<f64>().powf(1.0 / axes.len() as f64)
            }
        }
    }
}
