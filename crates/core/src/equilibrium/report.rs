//! Report of a converged load step.

use std::ops::Range;

use crate::basis::Connectivity;
use crate::dofs::{DofMap, FURTHER, Field};
use crate::linear::Factorisation;
use crate::model::Model;
use crate::ranks::Reduction;
use crate::terms::{Driven, Ledger, NamedEnergy, NamedForce, Record, Records};

use super::balance::{Energy, ReactionMoment};
use crate::step::{Nodal, Step};

/// Grid fields of a load step.
#[non_exhaustive]
#[derive(Debug, Clone)]
pub struct GridFields<const D: usize> {
    /// Links of the step, which list the active nodes.
    pub links: Connectivity<D>,
    /// Number of connected parts of the active nodes.
    pub parts: usize,
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Reaction at the active nodes, zero on free degrees of freedom, [force].
    pub reaction: Nodal<D>,
    /// The fields of the unknowns beside the displacement.
    pub further: Vec<NodalField>,
}

/// A field of the unknowns beside the displacement, at the active nodes; both vectors state all components of the first
/// node, then those of the second, and so on.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalField {
    /// The field.
    pub field: Field,
    /// The unknowns at the end of the step, which are zero at its start, in the first unit of the field.
    pub values: Vec<f64>,
    /// The reactions, zero on free components, in the second unit of the field.
    pub reaction: Vec<f64>,
}

impl NodalField {
    /// A field with these components of the unknowns, and of the reactions.
    pub fn new<const N: usize>(
        field: &Field,
        components: Range<usize>,
        unknowns: &[[f64; N]],
        reaction: &[[f64; N]],
    ) -> NodalField {
        let part = |nodal: &[[f64; N]]| {
            nodal.iter().flat_map(|node| node[components.clone()].iter().copied()).collect()
        };
        NodalField { field: field.clone(), values: part(unknowns), reaction: part(reaction) }
    }

    /// A field that is zero at all of `n` nodes.
    pub fn zero(field: &Field, n: usize) -> NodalField {
        let zero = vec![0.0; n * field.components];
        NodalField { field: field.clone(), values: zero.clone(), reaction: zero }
    }
}

/// The reaction of a condition that a term imposes.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherReaction {
    /// Name of the condition.
    pub condition: String,
    /// Its resultant along each component of the unknowns: first along those of the displacement, [force], then along
    /// those of each further field.
    pub resultant: Vec<f64>,
}

/// Report of a converged load step.
#[non_exhaustive]
#[derive(Debug, Clone)]
pub struct StepReport<const D: usize> {
    /// The step.
    pub step: Step,
    /// Relative residuals, eq. (40): the first before any solve, then one after each iteration or multiplier update.
    pub residuals: Vec<f64>,
    /// The last residual of each field, the displacement first, [-]; empty if there are no further fields.
    pub field_residuals: Vec<f64>,
    /// True if the iterations ended because of round-off instead of the tolerance: the residual is at most 10⁻⁶, or
    /// only parts that carry nothing exceed the tolerance.
    pub rounding_limited: bool,
    /// For each body, the out-of-balance force at the nodes that no other body touches, relative to the forces on that
    /// body, [-]; empty if there is only one body.
    pub body_residuals: Vec<f64>,
    /// For each body, the largest norm of external forces and reactions on a connected part with points of this body,
    /// in this step or an earlier one, [force].
    pub carried: Vec<f64>,
    /// True if equilibrium was reached only by damped iterations.
    pub damped: bool,
    /// Weight of the trial stress in the stress of points that flow, if viscosity regularises the laws, [-]; 0 without
    /// viscosity.
    pub viscosity: f64,
    /// Permanent numbers, ascending, of the points whose torn domains were replaced.
    pub replaced_domains: Vec<u32>,
    /// Factorisation used in each iteration.
    pub factorisations: Vec<Factorisation>,
    /// True if the last factorisation shows that the equilibrium is unstable, see
    /// [`Factorisation::shows_instability`].
    pub is_unstable: bool,
    /// Total number of iterations of the linear solver; 0 for a direct solver.
    pub linear_iterations: usize,
    /// Number of multiplier updates. After each update, one evaluation yields the new residual before the next linear
    /// solve.
    pub augmentations: usize,
    /// Largest number of linear solves without a multiplier update between them.
    pub most_solves: usize,
    /// Reaction of each boundary condition, [force].
    pub reactions: Vec<[f64; D]>,
    /// Reactions of the conditions that terms impose, in the order in which the terms name them.
    pub further_reactions: Vec<FurtherReaction>,
    /// Moment of the reaction of each boundary condition; `None` for bodies of revolution.
    pub moments: Option<Vec<ReactionMoment<D>>>,
    /// Resultant of each load on the points or on its surface, [force].
    pub loads: Vec<[f64; D]>,
    /// Forces of terms other than the loads of the model, such as the forces that a stage releases.
    pub forces: Vec<NamedForce<D>>,
    /// What prescribed motions do.
    pub driven: Driven,
    /// What terms report by types of their own, such as the surfaces and the rigid tools of the model.
    pub records: Records,
    /// Work and energy.
    pub energy: Energy,
    /// Relative imbalance of moments, see [`moment_error`](super::moment_error), [-]; `None` for bodies of revolution.
    pub moment_error: Option<f64>,
    /// Load factor at the end of the step, if all loads and prescribed motions share one, [-].
    pub load_factor: Option<f64>,
    /// By how much the step was too long for a term, such as inertia: its error relative to the error allowed, [-].
    pub excess: f64,
    /// Factor by which the strength of the materials is divided, [-]; `None` at full strength.
    pub strength_factor: Option<f64>,
    /// Number of free degrees of freedom.
    pub unknowns: usize,
    /// Number of faces with ghost stabilisation.
    pub stabilised_faces: usize,
    /// Fields of the grid.
    pub grid: GridFields<D>,
}

impl<const D: usize> StepReport<D> {
    /// Number of iterations: linear solves and, with a predictor, the predicted increment.
    pub fn solves(&self) -> usize {
        self.residuals.len().saturating_sub(1 + self.augmentations)
    }

    /// The share of the work of the prescribed motions that viscosity dissipates, [-]: the forces that these motions need
    /// are too large by about as much. 0 in a step without viscosity.
    pub fn viscous_share(&self) -> f64 {
        let is_viscous = |energy: &&NamedEnergy| energy.name == Ledger::VISCOUS;
        let lost: f64 =
            self.energy.further.iter().filter(is_viscous).map(|energy| energy.amount.growth()).sum();
        if lost > 0.0 { lost / self.driven.work.abs() } else { 0.0 }
    }

    /// The values of this type that a term has reported, on all ranks; none if no term reports any.
    pub fn list<T: Record>(&self) -> &[T] {
        self.records.list()
    }

    /// Sum of the resultants of all loads, [force].
    pub fn applied(&self) -> [f64; D] {
        // An empty sum of floats is −0.
        std::array::from_fn(|d| self.loads.iter().fold(0.0, |sum, force| sum + force[d]))
    }
}

/// Reactions: the part of f_int − f_ext that the constraints carry, zero on free components, [force].
pub fn reactions_of<const N: usize>(f_ext: &[[f64; N]], f_int: &[[f64; N]], dofs: &DofMap<N>) -> Nodal<N> {
    let balancing = |n: usize| std::array::from_fn(|c| f_int[n][c] - f_ext[n][c]);
    (0..f_ext.len()).map(|n| dofs.held_part(n, &balancing(n))).collect()
}

/// Sum of the reactions of each boundary condition, [force], and of each condition that a term imposes, shared out by
/// [`DofMap::for_each_share`].
pub fn named_reactions<const D: usize, const N: usize>(
    model: &Model<D>,
    reduction: &Reduction,
    reaction: &[[f64; N]],
    dofs: &DofMap<N>,
) -> (Vec<[f64; D]>, Vec<FurtherReaction>) {
    let mut sums = vec![[0.0; D]; model.boundary_conditions.len()];
    let mut further = vec![[0.0; N]; dofs.further_conditions().len()];
    for (node, force) in reaction.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
        dofs.for_each_share(model, node, force, |condition, component, share| {
            match condition.checked_sub(FURTHER) {
                None => sums[condition][component] += share,
                Some(place) => further[place][component] += share,
            }
        });
    }
    reduction.sum(sums.as_flattened_mut());
    reduction.sum(further.as_flattened_mut());
    let named = dofs.further_conditions().iter().cloned().zip(further);
    let named = named.map(|(condition, sum)| FurtherReaction { condition, resultant: sum.to_vec() });
    (sums, named.collect())
}
