//! The equations by which a condition holds a surface in the mean.

use crate::assembly::System;

/// The equation of a multiplier in a step.
pub(super) struct Equation<const D: usize> {
    /// Active nodes, ascending, with B, [length].
    pub row: Vec<(u32, [f64; D])>,
    /// m for a zero increment.
    pub gap: f64,
    /// The magnitude with which m is compared.
    pub scale: f64,
    /// True if this rank adds the equation.
    pub is_own: bool,
}

impl<const D: usize> Equation<D> {
    /// Adds β B ⊗ B.
    pub(super) fn add_stiffness<const N: usize>(&self, penalty: f64, sum: &mut System<N>) {
        for (v, row_block) in &self.row {
            for (w, column_block) in &self.row {
                // A symmetric system stores the lower triangle only.
                if let Some(place) = sum.place(*v as usize, *w as usize) {
                    let block = row_block.map(|a| column_block.map(|b| penalty * a * b));
                    sum.add_displacement_block(place, &block);
                }
            }
        }
    }
}
