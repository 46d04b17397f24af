//! Working space for the points of a material in a cell that take their mean increment.

use crate::basis::Links;
use crate::stress::{Mechanics, Slopes, WeakForm};

/// Gradients of the basis functions of the nodes of a group, and S/r̃ of bodies of revolution, at the start of the step.
pub(super) struct NodeGradients<const D: usize> {
    pub(super) gradient: Vec<[f64; D]>,
    pub(super) per_radius: Vec<f64>,
}

impl<const D: usize> Default for NodeGradients<D> {
    fn default() -> Self {
        NodeGradients { gradient: Vec::new(), per_radius: Vec::new() }
    }
}

impl<const D: usize> NodeGradients<D> {
    /// Sets the gradients of `n` nodes to zero.
    pub(super) fn clear(&mut self, n: usize) {
        self.gradient.clear();
        self.gradient.resize(n, [0.0; D]);
        self.per_radius.clear();
        self.per_radius.resize(n, 0.0);
    }

    /// The derivatives of the basis function of each node.
    #[inline(always)]
    pub(super) fn slopes(&self) -> impl Iterator<Item = Slopes<'_, D>> {
        let of_nodes = self.gradient.iter().zip(&self.per_radius);
        of_nodes.map(|(gradient, &per_radius)| Slopes { gradient, per_radius })
    }

    /// Adds a share of the gradients of a point at a distance `radius` from the axis of revolution.
    #[inline(always)]
    pub(super) fn add(&mut self, links: &Links<D>, share: f64, radius: f64) {
        for ((&node, gradient), value) in links.local.iter().zip(links.gradient).zip(links.value) {
            let sum = &mut self.gradient[node as usize];
            (0..D).for_each(|d| sum[d] += share * gradient[d]);
            self.per_radius[node as usize] += share * value / radius;
        }
    }
}

/// Working space for the points of a material in a cell that take their mean increment.
pub(super) struct MeanRoom<const D: usize, M: Mechanics<D>> {
    pub(super) mean: NodeGradients<D>,
    pub(super) own: NodeGradients<D>,
    pub(super) mapped: Vec<[f64; D]>,
    pub(super) together: Vec<<M::Current as WeakForm<D>>::Gradient<f64>>,
    pub(super) deviating: Vec<<M::Deviation as WeakForm<D>>::Gradient<f64>>,
    pub(super) deviations: Vec<M::Deviation>,
}

impl<const D: usize, M: Mechanics<D>> Default for MeanRoom<D, M> {
    fn default() -> Self {
        MeanRoom {
            mean: NodeGradients::default(),
            own: NodeGradients::default(),
            mapped: Vec::new(),
            together: Vec::new(),
            deviating: Vec::new(),
            deviations: Vec::new(),
        }
    }
}
