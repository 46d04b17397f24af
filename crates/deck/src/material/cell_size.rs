//! The size of the cells to which softening is adapted.

use mpm_core::grid::Axis;

/// Size of the cells in which a material softens, [length].
#[derive(Debug, Clone, PartialEq, Default)]
pub enum CellSize {
    /// No cells are known: softening is not adapted to them.
    #[default]
    Unknown,
    /// The same everywhere.
    Even(f64),
    /// The mean of a mesh, used everywhere.
    Mean(f64),
    /// That of a structured grid with these axes.
    Graded(Vec<Axis>),
}

impl CellSize {
    /// The size of the cell at a position: the mean of its sides, such that the volume is that of an even cell.
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
