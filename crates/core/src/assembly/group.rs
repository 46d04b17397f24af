//! The stiffness between the nodes of one group of points, and how a point adds its part: eqs. (21) and (23).

use crate::basis::Links;
use crate::linear::Block;
use crate::stress::WeakForm;
use crate::tensor::Lanes;

/// The dense stiffness of a group, to which its points add.
pub(crate) trait Dense<const D: usize> {
    /// Adds one point, given its gradients in the configuration that its weak form needs; `force` is that on the nodes
    /// of the group.
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
    );
}

/// No stiffness, only forces.
pub(crate) struct Forces;

impl<const D: usize> Dense<D> for Forces {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
    ) {
        for ((&node, gradient), value) in links.local.iter().zip(gradients).zip(links.value) {
            weak.column(&weak.gradient(gradient, *value), &mut force[node as usize]);
        }
    }
}

/// The lower triangle, by rows.
pub(crate) struct Triangle<'a, const D: usize>(pub &'a mut [Block<D>]);

impl<const D: usize> Dense<D> for Triangle<'_, D> {
    #[inline(always)]
    fn add<W: WeakForm<D>>(
        &mut self,
        weak: &W,
        links: &Links<D>,
        gradients: &[[f64; D]],
        force: &mut [[f64; D]],
    ) {
        let n = links.local.len();
        let (local, value, gradients) = (&links.local[..n], &links.value[..n], &gradients[..n]);
        for b in 0..n {
            let column_node = local[b] as usize;
            let column = weak.column(&weak.gradient(&gradients[b], value[b]), &mut force[column_node]);
            for a in b..n {
                let row = local[a] as usize;
                let gradient = weak.gradient(&gradients[a], value[a]);
                W::add_block(&column, &gradient, &mut self.0[row * (row + 1) / 2 + column_node]);
            }
        }
    }
}

/// The same of a group in the plane whose points all touch its `N` nodes, as standard points do: with everything in
/// its place, a block is one vector of numbers, and there is nothing to look up.
pub(crate) struct Whole<const D: usize, const N: usize> {
    /// `[b][a]`, b the column.
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
    ) {
        let (value, gradients, force) = (&links.value[..N], &gradients[..N], &mut force[..N]);
        for b in 0..N {
            let column = weak.column(&weak.gradient(&gradients[b], value[b]), &mut force[b]);
            for a in b..N {
                let gradient = weak.gradient(&gradients[a], value[a]);
                W::add_block(&column, &gradient, &mut self.blocks[b][a]);
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
    ) {
        let nodes = || links.local.iter().zip(gradients).zip(links.value);
        for ((&b, gradient), value) in nodes() {
            let column = weak.column(&weak.gradient(gradient, *value), &mut force[b as usize]);
            for ((&a, gradient), value) in nodes() {
                let gradient = weak.gradient(gradient, *value);
                W::add_block(&column, &gradient, &mut self.blocks[a as usize * self.nodes + b as usize]);
            }
        }
    }
}

/// The stiffness of a group whose points all touch its `N` nodes, as standard points do: by columns, the rows side by
/// side in `C` times [`Lanes::WIDTH`], so that one instruction works on several rows. Small enough for the fastest
/// memory; the blocks are taken apart once, after all points.
pub(crate) struct Cell<const D: usize, const N: usize, const C: usize> {
    symmetric: bool,
    columns: [[[[Lanes; D]; D]; C]; N],
}

impl<const D: usize, const N: usize, const C: usize> Cell<D, N, C> {
    pub fn zero(symmetric: bool) -> Self {
        Cell { symmetric, columns: [[[[Lanes::ZERO; D]; D]; C]; N] }
    }

    /// The first lanes that hold a row of this column.
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
    ) {
        let (value, gradients, force) = (&links.value[..N], &gradients[..N], &mut force[..N]);
        let nodes: [W::Gradient<f64>; N] = std::array::from_fn(|a| weak.gradient(&gradients[a], value[a]));
        let rows: [W::Gradient<Lanes>; C] =
            std::array::from_fn(|c| W::pack(&nodes[c * Lanes::WIDTH..N.min((c + 1) * Lanes::WIDTH)]));
        for b in 0..N {
            let column = weak.column(&nodes[b], &mut force[b]);
            for c in self.first(b)..C {
                W::add_block(&column, &rows[c], &mut self.columns[b][c]);
            }
        }
    }
}
