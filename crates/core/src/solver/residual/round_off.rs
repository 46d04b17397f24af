//! Round-off of the out-of-balance force at each node: from the displacement increment and from the stresses.

use crate::assembly::System;
use crate::basis::Connectivity;
use crate::material::Modulus;
use crate::model::{Model, ModuliAtRest};
use crate::points::Points;
use crate::region::vector::norm;
use crate::step::Nodal;

/// Round-off of a nodal force relative to the sum Σ |K_vw| |Δd_w| for a displacement increment, in units of the machine
/// precision.
pub(super) const IN_MOTION: f64 = 16.0;
/// Round-off of a nodal force relative to Σ |∇S_vp| V_p M_p, where M is the axial modulus, in units of the machine
/// precision: the sum is the force if all strains are one, and deformation gradients are of order one.
pub(super) const IN_STRAIN: f64 = 8.0;
/// Upper bound on the force under a unit strain, relative to the largest entry of K times the cell size, [-].
const NO_SUCH_FORCE: f64 = 1e3;
/// Bound on the round-off that accumulates in the stresses over the steps, as a multiple of the round-off of one step.
/// Forces within this bound count as zero.
pub(super) const ACCUMULATED: f64 = 100.0;

/// The state in which an evaluation was made.
pub(crate) struct EvaluatedAt<'a, const D: usize, const N: usize> {
    pub(crate) model: &'a Model<D>,
    pub(crate) points: &'a Points<D>,
    pub(crate) links: &'a Connectivity<D>,
    pub(crate) system: &'a System<N>,
    pub(crate) delta_d: &'a Nodal<N>,
}

impl<const D: usize, const N: usize> EvaluatedAt<'_, D, N> {
    /// An inexpensive upper bound on [`EvaluatedAt::round_off`] over all nodes, [force].
    pub(crate) fn round_off_at_most(&self) -> f64 {
        let EvaluatedAt { model, links, system, delta_d, .. } = self;
        let motion = delta_d.iter().flatten().fold(0.0, |largest, x| f64::max(largest, x.abs()));
        let size = links
            .active_cells()
            .iter()
            .fold(0.0, |size, &cell| f64::max(size, model.grid.size(cell as usize)));
        let reduction = links.reduction();
        let [motion, size] = [motion, size].map(|value| reduction.largest(value));
        // Shared nodes count once on each rank, which raises the bound only slightly.
        let entries_of_row = reduction.total((N * delta_d.len()) as f64);
        let strain = IN_STRAIN * NO_SUCH_FORCE * size;
        let term_noise = system.round_off().map_or(0.0, |all| all.iter().copied().fold(0.0, f64::max));
        let term_noise = reduction.largest(term_noise);
        f64::EPSILON * system.largest_entry() * (IN_MOTION * entries_of_row * motion + strain) + term_noise
    }

    /// Round-off of the force at each node, [force]: from the products of its row of K with the displacement increment,
    /// and from the strains of its points. A node that carries little material has little stiffness, K_vv ~ |∇S|², but
    /// its force contains the stresses of points that other nodes hold, and the round-off of these stresses enters in
    /// proportion to |∇S|.
    pub(crate) fn round_off(&self) -> Vec<f64> {
        let largest_of = |x: &[f64]| x.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let motion = self.system.magnitudes(self.delta_d);
        let nodal = |(motion, strain): (&[f64; N], f64)| {
            f64::EPSILON * (IN_MOTION * largest_of(&motion[..D]) + IN_STRAIN * strain)
        };
        let strained = forces_of_unit_strain(self.model, self.points, self.links);
        let mut noise: Vec<f64> = motion.iter().zip(strained).map(nodal).collect();
        if let Some(term_noise) = self.system.round_off() {
            noise.iter_mut().zip(term_noise).for_each(|(noise, term_noise)| *noise += term_noise);
        }
        noise
    }
}

/// Σ |∇S_vp| V_p M_p at each node, [force].
pub(super) fn forces_of_unit_strain<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<f64> {
    let moduli = ModuliAtRest::new(model, Modulus::Axial);
    let mut forces = vec![0.0; links.n_active()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let stiffness = model.volume(points, p) * moduli.at(points, p);
            links.for_each_link(p, |local, _, gradient| {
                forces[nodes[local] as usize] += stiffness * norm(gradient);
            });
        }
    }
    links.reduction().complete_numbers(&mut forces);
    forces
}
