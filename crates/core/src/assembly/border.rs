//! Equations of a few global unknowns, such as the motions of a rigid body, in addition to the nodal equations.

use crate::ranks::Reduction;
use crate::step::Nodal;

/// The global equations r(d, w) = 0 and the effect of the global unknowns w on the nodes:
///
/// K δd + B δw = f_ext − f_int, A δd + C δw = −r.
///
/// K alone must be regular: the border cannot hold a body that nothing else holds.
#[derive(Debug, Clone, Default)]
pub struct Border<const N: usize> {
    /// B by columns: derivative of the nodal internal minus external force with respect to each global unknown.
    pub(crate) columns: Vec<Nodal<N>>,
    /// A by rows: derivative of each global equation with respect to the nodal displacements.
    pub(crate) rows: Vec<Nodal<N>>,
    /// C, `[i][j]`.
    pub(crate) corner: Vec<Vec<f64>>,
    /// Residuals r of the global equations.
    pub(crate) residual: Vec<f64>,
    /// Derivative of r with respect to the load factor, if this factor follows from equilibrium.
    pub(crate) per_factor: Vec<f64>,
    /// True for each residual that is a force or moment; its work on the corresponding unknown counts in a line search.
    pub(crate) works: Vec<bool>,
    /// The magnitude with which each residual is compared.
    pub(crate) scale: Vec<f64>,
    /// Round-off of each residual in addition to the round-off of its sum.
    pub(crate) round_off: Vec<f64>,
    /// Stiffness that the solver adds to C if the equations alone may leave global unknowns undetermined. It affects
    /// the iterations but not the solution.
    pub(crate) support: Vec<Vec<f64>>,
    /// The first global unknown of the term that is being evaluated.
    pub(crate) first: usize,
}

impl<const N: usize> Border<N> {
    /// A border without entries, for `n` global unknowns.
    pub(crate) fn new(n: usize, n_nodes: usize) -> Self {
        let zeros = || (0..n).map(|_| vec![[0.0; N]; n_nodes]).collect();
        Border {
            columns: zeros(),
            rows: zeros(),
            corner: vec![vec![0.0; n]; n],
            residual: vec![0.0; n],
            per_factor: vec![0.0; n],
            works: vec![false; n],
            scale: vec![0.0; n],
            round_off: vec![0.0; n],
            support: vec![vec![0.0; n]; n],
            first: 0,
        }
    }

    /// Number of global unknowns.
    pub fn len(&self) -> usize {
        self.residual.len()
    }

    /// True if there are no global unknowns.
    pub fn is_empty(&self) -> bool {
        self.residual.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        *self = Border::new(self.len(), self.columns.first().map_or(0, Vec::len));
    }

    /// Adds to the residual of global equation `i` of the term, and to the magnitude with which it is compared.
    pub fn add_residual(&mut self, i: usize, residual: f64, scale: f64) {
        self.residual[self.first + i] += residual;
        self.scale[self.first + i] += scale;
    }

    /// Adds to the round-off of the residual of global equation `i` of the term.
    pub fn add_round_off(&mut self, i: usize, round_off: f64) {
        self.round_off[self.first + i] += round_off;
    }

    /// Adds to the derivative of the residual of the term's global equation `i` with respect to the load factor.
    pub fn add_per_factor(&mut self, i: usize, value: f64) {
        self.per_factor[self.first + i] += value;
    }

    /// Adds to the derivative of the internal minus external force on a node with respect to the term's global unknown
    /// `j`.
    pub fn add_to_column(&mut self, j: usize, node: usize, component: usize, value: f64) {
        self.columns[self.first + j][node][component] += value;
    }

    /// Adds to the derivative of the term's global equation `i` with respect to a nodal displacement.
    pub fn add_to_row(&mut self, i: usize, node: usize, component: usize, value: f64) {
        self.rows[self.first + i][node][component] += value;
    }

    /// Adds to the derivative of global equation `i` with respect to global unknown `j`, both of the term.
    pub fn add_to_corner(&mut self, i: usize, j: usize, value: f64) {
        self.corner[self.first + i][self.first + j] += value;
    }

    /// Adds to the stiffness between the term's global unknowns `i` and `j` with which the solver supports these
    /// unknowns in an iteration, because the equations may leave them undetermined.
    pub fn add_support(&mut self, i: usize, j: usize, stiffness: f64) {
        self.support[self.first + i][self.first + j] += stiffness;
    }

    /// Marks the residual of the term's global equation `i` as the negative out-of-balance force or moment on unknown
    /// `i`.
    pub fn count_as_work(&mut self, i: usize) {
        self.works[self.first + i] = true;
    }

    /// The work of the out-of-balance forces of the global equations on increments of the global unknowns, [energy].
    pub(crate) fn work(&self, increments: &[f64]) -> f64 {
        let each = self.residual.iter().zip(increments).zip(&self.works);
        each.filter(|(_, works)| **works).map(|((r, w), _)| -r * w).sum()
    }

    /// Sums the contributions of all ranks.
    pub(crate) fn complete(&mut self, reduction: &Reduction) {
        let Border { columns, rows, corner, residual, per_factor, scale, round_off, support, .. } = self;
        columns.iter_mut().chain(rows).for_each(|field| reduction.complete(field));
        for numbers in corner.iter_mut().chain(support).chain([residual, per_factor, scale, round_off]) {
            if !numbers.is_empty() {
                reduction.sum(numbers);
            }
        }
    }

    /// Adds B δw, with δw = `change`, to `force`, the change in the difference between internal and external forces.
    pub(crate) fn add_columns(&self, change: &[f64], force: &mut [[f64; N]]) {
        for (column, change) in self.columns.iter().zip(change) {
            for (force, column) in force.as_flattened_mut().iter_mut().zip(column.as_flattened()) {
                *force += change * column;
            }
        }
    }

    /// Each residual relative to the magnitude with which it is compared, [-], and whether the residual is round-off.
    pub(crate) fn relative_residuals(&self) -> impl Iterator<Item = (f64, bool)> {
        let terms = self.residual.iter().zip(&self.scale).zip(&self.round_off);
        terms.map(|((r, scale), round_off)| {
            (if *r == 0.0 { 0.0 } else { r.abs() / scale }, r.abs() <= *round_off)
        })
    }

    /// The largest residual relative to the magnitude with which it is compared, [-].
    pub(crate) fn relative_residual(&self) -> f64 {
        self.relative_residuals().fold(0.0, |a, (b, _)| if a >= b || f64::is_nan(a) { a } else { b })
    }
}
