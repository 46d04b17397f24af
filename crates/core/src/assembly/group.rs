//! The stiffness between the nodes of one group of points, to which each point adds its contribution, eqs. (21) and
//! (23), which [`WeakForm`] evaluates.

use crate::basis::Links;
use crate::linear::Block;
use crate::stress::WeakForm;
use crate::tensor::Lanes;
use crate::tensor::lane::transposed;

/// The dense stiffness of a group, to which its points contribute.
pub(crate) trait Dense<const D: usize> {
    /// Adds the contribution of one point, given its gradients in the configuration that its weak form needs; `force`
    /// is the force on the nodes of the group. If stiffness is added, `adjust` is called with the index of each node of
    /// the point and the column of this node.
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        adjust: &impl Fn(usize, &mut W::Column),
    );

    /// Adds the contribution of one point that touches all nodes of the group, given the data of their basis functions.
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]);

    /// Adds the stiffness that couples all nodes of the group with each other.
    fn couple(&mut self, coupling: &Coupling<D>);
}

/// Stiffness between all nodes of a group, h_a ⊗ c_b + r_a ⊗ h_b, from vectors at its nodes.
pub(crate) struct Coupling<'a, const D: usize> {
    /// h, the gradient of the mean dilatation, [1/length].
    pub mean: &'a [[f64; D]],
    /// r, [force].
    pub row: &'a [[f64; D]],
    /// c, [force].
    pub column: &'a [[f64; D]],
}

impl<const D: usize> Coupling<'_, D> {
    /// Adds the block of row a and column b.
    #[inline(always)]
    fn add_block(&self, a: usize, b: usize, block: &mut Block<D>) {
        let Coupling { mean, row, column } = self;
        for i in 0..D {
            for k in 0..D {
                block[i][k] += mean[a][i] * column[b][k] + row[a][i] * mean[b][k];
            }
        }
    }
}

/// Adds only forces, no stiffness.
pub(crate) struct Forces;

impl<const D: usize> Dense<D> for Forces {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        _: &impl Fn(usize, &mut W::Column),
    ) {
        for ((&node, gradient), value) in links.local.iter().zip(gradients).zip(links.value) {
            weak.column(&weak.gradient(gradient, *value), &mut force[node as usize]);
        }
    }

    #[inline(always)]
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]) {
        for (node, force) in nodes.iter().zip(force) {
            weak.column(node, force);
        }
    }

    #[inline(always)]
    fn couple(&mut self, _: &Coupling<D>) {}
}

/// The lower triangle of the stiffness, by rows.
pub(crate) struct Triangle<'a, const D: usize>(pub &'a mut [Block<D>]);

impl<const D: usize> Dense<D> for Triangle<'_, D> {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        adjust: &impl Fn(usize, &mut W::Column),
    ) {
        let n = links.local.len();
        let (local, value, gradients) = (&links.local[..n], &links.value[..n], &gradients[..n]);
        for b in 0..n {
            let column_node = local[b] as usize;
            let mut column = weak.column(&weak.gradient(&gradients[b], value[b]), &mut force[column_node]);
            adjust(b, &mut column);
            for a in b..n {
                let row = local[a] as usize;
                let gradient = weak.gradient(&gradients[a], value[a]);
                W::add_block(&column, &gradient, &mut self.0[row * (row + 1) / 2 + column_node]);
            }
        }
    }

    #[inline(always)]
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]) {
        for (b, (node, force)) in nodes.iter().zip(force).enumerate() {
            let column = weak.column(node, force);
            for (a, row) in nodes.iter().enumerate().skip(b) {
                W::add_block(&column, row, &mut self.0[a * (a + 1) / 2 + b]);
            }
        }
    }

    #[inline(always)]
    fn couple(&mut self, coupling: &Coupling<D>) {
        for a in 0..coupling.mean.len() {
            for b in 0..=a {
                coupling.add_block(a, b, &mut self.0[a * (a + 1) / 2 + b]);
            }
        }
    }
}

/// The same as [`Triangle`], for a two-dimensional group whose points each touch all its `N` nodes, as standard points
/// do. Each block is one vector of numbers at a fixed position, so no index has to be looked up.
pub(crate) struct Whole<const D: usize, const N: usize> {
    /// The block of row a and column b is at `[b][a]`.
    blocks: [[Block<D>; N]; N],
}

impl<const D: usize, const N: usize> Whole<D, N> {
    pub fn zero() -> Self {
        Whole { blocks: [[[[0.0; D]; D]; N]; N] }
    }

    /// Writes the blocks in the order of [`Triangle`].
    #[inline(always)]
    pub fn store(&self, blocks: &mut [Block<D>]) {
        for a in 0..N {
            for b in 0..=a {
                blocks[a * (a + 1) / 2 + b] = self.blocks[b][a];
            }
        }
    }
}

impl<const D: usize, const N: usize> Dense<D> for Whole<D, N> {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        adjust: &impl Fn(usize, &mut W::Column),
    ) {
        let (value, gradients, force) = (&links.value[..N], &gradients[..N], &mut force[..N]);
        for b in 0..N {
            let mut column = weak.column(&weak.gradient(&gradients[b], value[b]), &mut force[b]);
            adjust(b, &mut column);
            for a in b..N {
                let gradient = weak.gradient(&gradients[a], value[a]);
                W::add_block(&column, &gradient, &mut self.blocks[b][a]);
            }
        }
    }

    #[inline(always)]
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]) {
        let (nodes, force) = (&nodes[..N], &mut force[..N]);
        for b in 0..N {
            let column = weak.column(&nodes[b], &mut force[b]);
            for a in b..N {
                W::add_block(&column, &nodes[a], &mut self.blocks[b][a]);
            }
        }
    }

    #[inline(always)]
    fn couple(&mut self, coupling: &Coupling<D>) {
        for b in 0..N {
            for a in b..N {
                coupling.add_block(a, b, &mut self.blocks[b][a]);
            }
        }
    }
}

/// All blocks between `nodes` nodes, by rows, for an unsymmetric tangent.
pub(crate) struct Square<'a, const D: usize> {
    pub(crate) blocks: &'a mut [Block<D>],
    pub(crate) nodes: usize,
}

impl<const D: usize> Dense<D> for Square<'_, D> {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        adjust: &impl Fn(usize, &mut W::Column),
    ) {
        let nodes = || links.local.iter().zip(gradients).zip(links.value);
        for (n, ((&b, gradient), value)) in nodes().enumerate() {
            let mut column = weak.column(&weak.gradient(gradient, *value), &mut force[b as usize]);
            adjust(n, &mut column);
            for ((&a, gradient), value) in nodes() {
                let gradient = weak.gradient(gradient, *value);
                W::add_block(&column, &gradient, &mut self.blocks[a as usize * self.nodes + b as usize]);
            }
        }
    }

    #[inline(always)]
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]) {
        for (b, (node, force)) in nodes.iter().zip(force).enumerate() {
            let column = weak.column(node, force);
            for (a, row) in nodes.iter().enumerate() {
                W::add_block(&column, row, &mut self.blocks[a * self.nodes + b]);
            }
        }
    }

    #[inline(always)]
    fn couple(&mut self, coupling: &Coupling<D>) {
        for a in 0..self.nodes {
            for b in 0..self.nodes {
                coupling.add_block(a, b, &mut self.blocks[a * self.nodes + b]);
            }
        }
    }
}

/// The stiffness of a group whose points each touch all its `N` nodes, as standard points do. It is stored by columns,
/// with the rows side by side in `C` vectors of [`Lanes::WIDTH`] numbers, so that one instruction operates on several
/// rows. It is small enough for the fastest cache; the blocks are extracted once, after all points have been added.
pub(crate) struct Cell<const D: usize, const N: usize, const C: usize> {
    symmetric: bool,
    columns: [[[[Lanes; D]; D]; C]; N],
}

impl<const D: usize, const N: usize, const C: usize> Cell<D, N, C> {
    pub fn zero(symmetric: bool) -> Self {
        Cell { symmetric, columns: [[[[Lanes::ZERO; D]; D]; C]; N] }
    }

    /// Index of the first vector of lanes that contains a row stored in this column.
    #[inline(always)]
    fn first(&self, column: usize) -> usize {
        if self.symmetric { column / Lanes::WIDTH } else { 0 }
    }

    /// Writes the blocks in the order of [`Triangle`] or [`Square`].
    #[inline(always)]
    pub fn store(&self, blocks: &mut [Block<D>]) {
        for b in 0..N {
            for a in if self.symmetric { b } else { 0 }..N {
                let place = if self.symmetric { a * (a + 1) / 2 + b } else { a * N + b };
                let lanes = &self.columns[b][a / Lanes::WIDTH];
                for i in 0..D {
                    for k in 0..D {
                        blocks[place][i][k] = lanes[i][k].0[a % Lanes::WIDTH];
                    }
                }
            }
        }
    }
}

impl<const D: usize, const N: usize, const C: usize> Dense<D> for Cell<D, N, C> {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
        adjust: &impl Fn(usize, &mut W::Column),
    ) {
        let (value, gradients, force) = (&links.value[..N], &gradients[..N], &mut force[..N]);
        let nodes: [W::Gradient<f64>; N] = std::array::from_fn(|a| weak.gradient(&gradients[a], value[a]));
        let rows: [W::Gradient<Lanes>; C] =
            std::array::from_fn(|c| W::pack(&nodes[c * Lanes::WIDTH..N.min((c + 1) * Lanes::WIDTH)]));
        for b in 0..N {
            let mut column = weak.column(&nodes[b], &mut force[b]);
            adjust(b, &mut column);
            for c in self.first(b)..C {
                W::add_block(&column, &rows[c], &mut self.columns[b][c]);
            }
        }
    }

    #[inline(always)]
    fn add_on_all<W: WeakForm<D>>(&mut self, weak: &W, nodes: &[W::Gradient<f64>], force: &mut [[f64; D]]) {
        let (nodes, force) = (&nodes[..N], &mut force[..N]);
        let rows: [W::Gradient<Lanes>; C] =
            std::array::from_fn(|c| W::pack(&nodes[c * Lanes::WIDTH..N.min((c + 1) * Lanes::WIDTH)]));
        for b in 0..N {
            let column = weak.column(&nodes[b], &mut force[b]);
            for c in self.first(b)..C {
                W::add_block(&column, &rows[c], &mut self.columns[b][c]);
            }
        }
    }

    #[inline(always)]
    fn couple(&mut self, coupling: &Coupling<D>) {
        let (mean, row, column) = (&coupling.mean[..N], &coupling.row[..N], &coupling.column[..N]);
        let lanes =
            |rows: &[[f64; D]], c: usize| transposed(&rows[c * Lanes::WIDTH..N.min((c + 1) * Lanes::WIDTH)]);
        for c in 0..C {
            let (mean_lanes, row_lanes) = (lanes(mean, c), lanes(row, c));
            for b in 0..N {
                if self.first(b) > c {
                    break;
                }
                let block = &mut self.columns[b][c];
                for i in 0..D {
                    for k in 0..D {
                        block[i][k] += mean_lanes[i] * column[b][k] + row_lanes[i] * mean[b][k];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
