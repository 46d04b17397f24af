//! The direct backend: nested dissection of the nodes, and a factorisation of the entries that belong to unknowns.

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::BlockMatrix;
use super::{Direct, Factorisation, LinearError, Numbering, Pattern, ordering};

/// The entries of a block matrix that belong to unknowns.
#[derive(Debug, Default)]
pub struct FreeEntries {
    /// Pattern of these entries.
    pub pattern: Pattern,
    /// The index of each entry among all values of all blocks.
    source: Vec<u32>,
}

impl FreeEntries {
    /// The entries by columns; for a symmetric matrix, the lower triangle only.
    pub fn new<const N: usize>(matrix: &BlockMatrix<N>, numbering: &Numbering<N>) -> Self {
        let symmetric = matrix.symmetric;
        let mut pattern = Pattern { n: numbering.count(), column_start: vec![0], row: Vec::new(), symmetric };
        let mut source = Vec::new();
        for column in 0..numbering.n_nodes() {
            for k in 0..N {
                let Some(free_column) = numbering.unknown(column, k) else { continue };
                for place in matrix.column_start[column]..matrix.column_start[column + 1] {
                    let row = matrix.row[place] as usize;
                    for i in 0..N {
                        let Some(free_row) = numbering.unknown(row, i) else { continue };
                        if !symmetric || free_row >= free_column {
                            pattern.row.push(free_row);
                            source.push((place * N * N + i * N + k) as u32);
                        }
                    }
                }
                pattern.column_start.push(pattern.row.len());
            }
        }
        FreeEntries { pattern, source }
    }

    /// Values of these entries, in the order of the pattern.
    pub fn values<const N: usize>(&self, matrix: &BlockMatrix<N>, values: &mut Vec<f64>) {
        let flat = matrix.blocks.as_flattened().as_flattened();
        values.clear();
        values.extend(self.source.iter().map(|&s| flat[s as usize]));
    }
}

/// Solves the equations by factorisation; keeps the analysis while the pattern and the order stay the same.
#[derive(Default)]
pub struct DirectBackend {
    direct: Direct,
    entries: FreeEntries,
    /// Values of the entries, or the right-hand side.
    values: Vec<f64>,
    factorised: Option<Factorisation>,
}

/// Elimination order of the unknowns of some nodes: nested dissection of the nodes by their lattice coordinates.
pub(super) fn elimination_order<const D: usize, const N: usize>(
    lattice: &dyn Fn(usize) -> [u32; D],
    numbering: &Numbering<N>,
    matrix: &BlockMatrix<N>,
    is_in: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let nodes: Vec<usize> = (0..numbering.n_nodes()).filter(|node| is_in(*node)).collect();
    let coordinates: Vec<[u32; D]> = nodes.iter().map(|node| lattice(*node)).collect();
    let order = ordering::nested_dissection(&coordinates, matrix.reach(lattice));
    let unknowns =
        |place: &usize| (0..N).filter_map(|c| numbering.unknown(nodes[*place], c)).collect::<Vec<_>>();
    order.iter().flat_map(unknowns).collect()
}

impl<const D: usize, const N: usize> Backend<D, N> for DirectBackend {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.entries = FreeEntries::new(matrix, layout.numbering);
        let pattern = std::mem::take(&mut self.entries.pattern);
        // The order is always computed afresh: it may change while the pattern stays the same, and a resumed run has no
        // earlier order.
        let order = elimination_order(layout.lattice, layout.numbering, matrix, |_| true);
        self.direct.analyse(pattern, order).map(|_| ())
    }

    fn factorise(&mut self, _: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.entries.values(matrix, &mut self.values);
        self.factorised = Some(self.direct.factorise(&self.values)?);
        Ok(())
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        _: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        _: f64,
    ) -> Result<Solved, LinearError> {
        self.values.clear();
        layout.numbering.for_each(|node, component, unknown| {
            if unknown.is_some() {
                self.values.push(b[node][component]);
            }
        });
        self.direct.solve(&mut self.values)?;
        layout.numbering.for_each(|node, component, unknown| {
            x[node][component] = unknown.map_or(0.0, |unknown| self.values[unknown]);
        });
        let factorisation = self.factorised.ok_or(LinearError::Singular { unknown: None })?;
        Ok(Solved { factorisation, iterations: 0 })
    }

    fn is_iterative(&self) -> bool {
        false
    }
}
