//! Balance checks for every step: external work compared with stored energy and plastic dissipation, and the balance of
//! moments of the forces on the bodies.

use crate::basis::Connectivity;
use crate::dofs::{DofMap, nodes_of};
use crate::model::{BoundaryCondition, Model};
use crate::points::Points;
use crate::ranks::Reduction;

use crate::step::Nodal;
use crate::terms::{Ledger, NamedEnergy, continued, sum_over_ranks};

/// Work done during a step, and energy at its end.
///
/// The work follows from the trapezoidal rule, whose error for a given motion decreases with the square of the step
/// size. Each step starts on an undeformed grid with new basis functions, on which the equilibrium of the previous step
/// no longer holds exactly. The resulting out-of-balance forces do work, too. This work vanishes with the step size if
/// the basis functions are smooth. It does not vanish for standard points, whose stress jumps as they cross cell
/// boundaries.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Energy {
    /// Work of loads and reactions during the step, [energy].
    pub external_work: f64,
    /// Work done during the step against the out-of-balance forces at its start, ½ (f_int − f_ext)·Δd, [energy].
    pub regridding_work: f64,
    /// Work absorbed by the ghost stabilisation during the step, [energy].
    pub stabilisation_work: f64,
    /// Work absorbed by the damping of damped iterations, [energy].
    pub damping_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// Plastic work since the start of the analysis, [energy].
    pub plastic_work: f64,
    /// Plastic work that the history variables of the laws record for this step at full strength, but that was not done
    /// because the strength was reduced, [energy].
    pub undone_work: f64,
    /// Work dissipated by friction between tools and bodies during the step, [energy]. The external work contains it,
    /// because the work of a tool is the work of its forces on its own motion.
    pub friction_work: f64,
    /// The energies that the terms report under names of their own.
    pub further: Vec<NamedEnergy>,
}

/// The forces on the active nodes from outside the bodies, [force].
#[derive(Debug, Clone, Copy)]
pub struct AppliedForces<'a, const N: usize> {
    /// Loads.
    pub load: &'a Nodal<N>,
    /// Reactions of the boundary conditions.
    pub reaction: &'a Nodal<N>,
}

impl Energy {
    /// Energy of one part of a slumping step. The out-of-balance forces at its start remain from the previous part and
    /// do not stem from the new grid, so their work counts as damping work.
    pub fn in_slump(self) -> Energy {
        Energy { damping_work: self.damping_work - self.regridding_work, regridding_work: 0.0, ..self }
    }

    /// Adds the work of the preceding part of the step, `before`; the energies and the plastic work remain those at the
    /// end of this part.
    pub fn after(self, before: Energy) -> Energy {
        Energy {
            external_work: before.external_work + self.external_work,
            regridding_work: before.regridding_work + self.regridding_work,
            stabilisation_work: before.stabilisation_work + self.stabilisation_work,
            damping_work: before.damping_work + self.damping_work,
            friction_work: before.friction_work + self.friction_work,
            further: continued(before.further, &self.further),
            ..self
        }
    }

    /// The sum over all ranks.
    fn summed(mut self, reduction: &Reduction) -> Energy {
        let Energy {
            external_work,
            regridding_work,
            stabilisation_work,
            damping_work,
            strain_energy,
            plastic_work,
            undone_work,
            friction_work,
            further,
        } = &mut self;
        let all = [
            external_work,
            regridding_work,
            stabilisation_work,
            damping_work,
            strain_energy,
            plastic_work,
            undone_work,
            friction_work,
        ];
        let mut sums = all.each_ref().map(|energy| **energy);
        reduction.sum(&mut sums);
        all.into_iter().zip(sums).for_each(|(energy, sum)| *energy = sum);
        sum_over_ranks(further, reduction);
        self
    }

    /// Energy of a step that is in equilibrium but not yet committed, over all ranks.
    ///
    /// `start` and `end` are the external forces at the start and end of the step, `f_int_start` is the internal force
    /// at the start, all [force]; `delta_d` is the displacement increment, [length]; `ledger` is the energy of the
    /// terms.
    pub fn new<const D: usize, const N: usize>(
        reduction: &Reduction,
        delta_d: &[[f64; D]],
        start: AppliedForces<N>,
        end: AppliedForces<N>,
        f_int_start: &[[f64; N]],
        ledger: &Ledger,
    ) -> Energy {
        let mut energy = Energy::of_terms(ledger);
        for (node, du) in delta_d.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
            for d in 0..D {
                let [before, after] = [start, end].map(|force| force.load[node][d] + force.reaction[node][d]);
                energy.external_work += 0.5 * (before + after) * du[d];
                energy.regridding_work += 0.5 * (f_int_start[node][d] - before) * du[d];
            }
        }
        energy.summed(reduction)
    }

    /// As [`Energy::new`], for a step with inertia: these forces act over the whole step.
    pub fn in_mean<const D: usize, const N: usize>(
        reduction: &Reduction,
        delta_d: &[[f64; D]],
        mean: AppliedForces<N>,
        ledger: &Ledger,
    ) -> Energy {
        let mut energy = Energy::of_terms(ledger);
        for (node, du) in delta_d.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
            let work = |d: usize| (mean.load[node][d] + mean.reaction[node][d]) * du[d];
            energy.external_work += (0..D).map(work).sum::<f64>();
        }
        energy.summed(reduction)
    }

    /// The energies of the terms, on this rank, without the work of loads and reactions.
    fn of_terms(ledger: &Ledger) -> Energy {
        let friction = ledger.energy(Ledger::FRICTION);
        Energy {
            stabilisation_work: ledger.energy(Ledger::STABILISATION),
            strain_energy: ledger.energy(Ledger::ELASTIC),
            plastic_work: ledger.energy(Ledger::PLASTIC),
            undone_work: ledger.energy(Ledger::UNDONE),
            friction_work: friction,
            external_work: friction,
            further: ledger.further(),
            ..Energy::default()
        }
    }
}

/// Moment of the reaction of a boundary condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReactionMoment<const D: usize> {
    /// Reference point: the mean position, at the end of the step, of the active nodes or of the surface of the
    /// condition, [length]; `None` if the condition has neither.
    pub about: Option<[f64; D]>,
    /// Moment on the body about the axes x, y and z, positive by the right-hand rule, [force·length]. In the plane only
    /// the z component is non-zero; it is positive from x towards y.
    pub moment: [f64; 3],
}

impl<const D: usize> ReactionMoment<D> {
    /// Names of the axes about which a moment is reported in `D` dimensions.
    pub const AXES: &'static [&'static str] = if D == 3 { &["x", "y", "z"] } else { &["z"] };

    /// Components of the moment about [`Self::AXES`], [force·length].
    pub fn components(&self) -> &[f64] {
        &self.moment[3 - Self::AXES.len()..]
    }
}

/// Moments of the reactions at the nodes of each boundary condition, in the deformed configuration (see
/// [`moment_error`]). [`DofMap::for_each_share`] divides the reaction at a node between conditions. `None` for bodies
/// of revolution, whose forces are sums over the full circle.
pub fn reaction_moments<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    dofs: &DofMap<N>,
    delta_d: &[[f64; D]],
    reaction: &Nodal<N>,
) -> Option<Vec<ReactionMoment<D>>> {
    if model.revolved {
        return None;
    }
    let (positions, reduction) = (deformed_nodes(model, links, delta_d), links.reduction());
    let moment = |(number, condition): (usize, &BoundaryCondition<D>)| {
        let mut nodes = nodes_of(condition, points, links);
        nodes.retain(|node| links.reduction().counts(*node));
        let count = reduction.count_all(nodes.len());
        if count == 0 {
            return ReactionMoment { about: None, moment: [0.0; 3] };
        }
        let mut about: [f64; D] = std::array::from_fn(|d| nodes.iter().map(|n| positions[*n][d]).sum());
        reduction.sum(&mut about);
        about.iter_mut().for_each(|x| *x /= count as f64);
        let mut moment = [0.0; 3];
        for node in nodes {
            let (mut arm, mut force) = ([0.0; 3], [0.0; 3]);
            for d in 0..D {
                arm[d] = positions[node][d] - about[d];
            }
            dofs.for_each_share(model, node, &reaction[node], |condition, axis, share| {
                if condition == number {
                    force[axis] += share;
                }
            });
            for (axis, m) in moment.iter_mut().enumerate() {
                let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
                *m += arm[i] * force[j] - arm[j] * force[i];
            }
        }
        reduction.sum(&mut moment);
        ReactionMoment { about: Some(about), moment }
    };
    Some(model.boundary_conditions.iter().enumerate().map(moment).collect())
}

/// Positions of the active nodes at the end of a step, [length].
fn deformed_nodes<const D: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
) -> Nodal<D> {
    (links.active_nodes().iter().zip(delta_d))
        .map(|(&node, du)| {
            let position = model.grid.node_position(node as usize);
            std::array::from_fn(|d| position[d] + du[d])
        })
        .collect()
}

/// Imbalance of moments: the resultant moment of loads and reactions about the mean position of the active nodes,
/// relative to the sum of force times distance from this position, [-]. Evaluated in the deformed configuration. `None`
/// for bodies of revolution, whose hoop stresses contribute to the balance; 0 if there are no forces.
pub fn moment_error<const D: usize, const N: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
    forces: AppliedForces<N>,
) -> Option<f64> {
    if model.revolved {
        return None;
    }
    let (positions, reduction) = (deformed_nodes(model, links, delta_d), links.reduction());
    let own = || (0..positions.len()).filter(|node| reduction.counts(*node));
    let mut middle: [f64; D] = std::array::from_fn(|d| own().map(|node| positions[node][d]).sum());
    reduction.sum(&mut middle);
    let count = reduction.count_all(own().count()) as f64;
    middle.iter_mut().for_each(|x| *x /= count);
    let (mut moments, mut scale) = ([[0.0; D]; D], 0.0);
    for node in own() {
        let arm: [f64; D] = std::array::from_fn(|d| positions[node][d] - middle[d]);
        let length = |v: &[f64]| v[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
        for force in [&forces.load[node], &forces.reaction[node]] {
            for i in 0..D {
                for j in i + 1..D {
                    moments[i][j] += arm[i] * force[j] - arm[j] * force[i];
                }
            }
            scale += length(&arm) * length(force);
        }
    }
    reduction.sum(moments.as_flattened_mut());
    let scale = reduction.total(scale);
    let moment = moments.as_flattened().iter().map(|m| m * m).sum::<f64>().sqrt();
    Some(if scale > 0.0 { moment / scale } else { 0.0 })
}
