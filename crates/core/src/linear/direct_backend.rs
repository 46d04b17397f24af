//! The direct backend: nested dissection of the nodes, and a factorisation of the entries that belong to unknowns.

use std::sync::Arc;

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::BlockMatrix;
use super::containing::{Embedding, Named};
use super::{Direct, Factorisation, LinearError, LinearSolver, Numbering, Pattern, ordering};

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

/// Solves the equations by factorisation; keeps the analysis of a pattern for steps whose patterns are contained in it.
#[derive(Default)]
pub struct DirectBackend {
    direct: Direct,
    entries: FreeEntries,
    /// Values of the entries, or the right-hand side.
    values: Vec<f64>,
    /// The analysed pattern, if it can be reused for patterns that it contains.
    kept: Option<Arc<Named>>,
    /// The embedding of the current pattern in the kept pattern, unless the two are the same.
    embedding: Option<Embedding>,
    factorised: Option<Factorisation>,
}

impl DirectBackend {
    /// A backend that starts with an analysed pattern.
    pub fn with(kept: Option<Arc<Named>>) -> Self {
        DirectBackend { kept, ..DirectBackend::default() }
    }

    /// The analysed pattern for later steps.
    pub fn kept(&self) -> Option<Arc<Named>> {
        self.kept.clone()
    }

    /// Analyses a pattern, unless the kept pattern contains it.
    fn prepare_contained<const D: usize, const N: usize>(
        &mut self,
        layout: &Layout<D, N>,
        matrix: &BlockMatrix<N>,
        pattern: Pattern,
    ) -> Result<(), LinearError> {
        let names = layout.names();
        let same = |kept: &Named| kept.names == names && kept.pattern == pattern;
        if !self.kept.as_deref().is_some_and(same) {
            self.embedding = self.kept.as_ref().and_then(|kept| Embedding::new(&names, &pattern, kept));
            if self.embedding.is_none() {
                let order = elimination_order(layout.lattice, layout.numbering, matrix, |_| true);
                self.kept = Some(Arc::new(Named { names, pattern, order }));
            }
        }
        match &self.kept {
            Some(kept) => self.direct.analyse(kept.pattern.clone(), kept.order.clone()).map(|_| ()),
            None => Ok(()),
        }
    }

    fn factorise_entries<const N: usize>(&mut self, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.entries.values(matrix, &mut self.values);
        self.factorised = Some(match &self.embedding {
            None => self.direct.factorise(&self.values),
            Some(embedding) => self.direct.factorise(&embedding.values(&self.values)),
        }?);
        Ok(())
    }

    /// Forward and backward substitution for one right-hand side.
    fn substitute<const D: usize, const N: usize>(
        &mut self,
        layout: &Layout<D, N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
    ) -> Result<(), LinearError> {
        self.values.clear();
        layout.numbering.for_each(|node, component, unknown| {
            if unknown.is_some() {
                self.values.push(b[node][component]);
            }
        });
        let solved = match &self.embedding {
            None => self.direct.solve(&mut self.values),
            Some(embedding) => {
                let mut all = embedding.spread(&self.values);
                let solved = self.direct.solve(&mut all);
                embedding.gather(&all, &mut self.values);
                solved
            }
        };
        solved.map_err(|error| self.renumbered(error))?;
        layout.numbering.for_each(|node, component, unknown| {
            x[node][component] = unknown.map_or(0.0, |unknown| self.values[unknown]);
        });
        Ok(())
    }

    /// Replaces the analysed pattern by the pattern of the current step.
    fn prepare_afresh<const D: usize, const N: usize>(
        &mut self,
        layout: &Layout<D, N>,
        matrix: &BlockMatrix<N>,
    ) -> Result<(), LinearError> {
        self.kept = None;
        self.prepare(layout, matrix)
    }

    /// The error, with the index that its unknown has in the current step.
    fn renumbered(&self, error: LinearError) -> LinearError {
        match (error, &self.embedding) {
            (LinearError::Singular { unknown: Some(unknown) }, Some(embedding)) => {
                LinearError::Singular { unknown: embedding.number(unknown) }
            }
            _ => error,
        }
    }
}

/// True if the error may be due to the order of elimination, so that factorisation in the pattern's own order may
/// succeed.
fn may_be_the_order(error: &LinearError) -> bool {
    matches!(error, LinearError::Singular { .. })
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
        self.embedding = None;
        if layout.keeps_pattern && pattern.symmetric {
            return self.prepare_contained(layout, matrix, pattern);
        }
        self.kept = None;
        // The order is always computed afresh: it may change while the pattern stays the same, and a resumed run has no
        // earlier order.
        let order = elimination_order(layout.lattice, layout.numbering, matrix, |_| true);
        self.direct.analyse(pattern, order).map(|_| ())
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        match self.factorise_entries(matrix) {
            Err(error) if may_be_the_order(&error) && self.embedding.is_some() => {
                self.prepare_afresh(layout, matrix)?;
                self.factorise_entries(matrix)
            }
            outcome => outcome,
        }
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        _: f64,
    ) -> Result<Solved, LinearError> {
        match self.substitute(layout, b, x) {
            Err(error) if may_be_the_order(&error) && self.embedding.is_some() => {
                self.prepare_afresh(layout, &stiffness.matrix)?;
                self.factorise_entries(&stiffness.matrix)?;
                self.substitute(layout, b, x)?;
            }
            outcome => outcome?,
        }
        let factorisation = self.factorised.ok_or(LinearError::Singular { unknown: None })?;
        Ok(Solved { factorisation, iterations: 0 })
    }

    fn is_iterative(&self) -> bool {
        false
    }
}
