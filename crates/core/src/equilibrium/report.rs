//! What is known of a load step that is in equilibrium.

use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::linear::Factorisation;
use crate::model::Model;

use super::balance::{Energy, ReactionMoment};
use crate::step::{Nodal, Step};

/// The fields of the grid in a load step.
#[derive(Debug, Clone)]
pub struct GridFields<const D: usize> {
    /// The links of the step; tells which nodes are active.
    pub links: Connectivity<D>,
    /// Number of connected parts of the active nodes.
    pub parts: usize,
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Reaction on the active nodes, zero where free, [force].
    pub reaction: Nodal<D>,
}

/// What is known of an equilibrated step.
#[derive(Debug, Clone)]
pub struct StepReport<const D: usize> {
    /// The step.
    pub step: Step,
    /// Residual of every evaluation, eq. (40); the first is the one before any solve.
    pub residuals: Vec<f64>,
    /// Whether the step has been accepted as far as round-off allows, with a residual of 10⁻⁶ at most, rather than to the
    /// tolerance.
    pub rounding_limited: bool,
    /// What is out of balance at the nodes of each body alone, relative to the forces on it; none for one body, [-].
    pub body_residuals: Vec<f64>,
    /// The largest norm of the external forces and reactions on a part of each body, in this step or before, [force].
    pub carried: Vec<f64>,
    /// Whether only damped iterations found the equilibrium.
    pub damped: bool,
    /// Permanent numbers of the points whose torn domains were replaced, ascending.
    pub replaced_domains: Vec<u32>,
    /// Factorisation used in each iteration.
    pub factorisations: Vec<Factorisation>,
    /// Iterations of the linear solver in all of them, none where it is direct.
    pub linear_iterations: usize,
    /// Reaction of each boundary condition, [force].
    pub reactions: Vec<[f64; D]>,
    /// Moment of the reaction of each boundary condition; none for bodies of revolution.
    pub moments: Option<Vec<ReactionMoment<D>>>,
    /// Resultant of each load on the points, [force].
    pub loads: Vec<[f64; D]>,
    /// Work and energy.
    pub energy: Energy,
    /// Moment of loads and reactions together, relative to all of them, [-]; none for bodies of revolution.
    pub moment_error: Option<f64>,
    /// Load factor at the end of the step, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Number of free degrees of freedom.
    pub unknowns: usize,
    /// Number of faces that are stabilised.
    pub stabilised_faces: usize,
    /// Fields of the grid.
    pub grid: GridFields<D>,
}

impl<const D: usize> StepReport<D> {
    /// Sum of all loads on the points, [force].
    pub fn applied(&self) -> [f64; D] {
        // The sum of no numbers would be −0.
        std::array::from_fn(|d| self.loads.iter().fold(0.0, |sum, force| sum + force[d]))
    }
}

/// The part of f_int − f_ext that the constraints take, zero on free components.
pub fn reactions_of<const N: usize>(f_ext: &[[f64; N]], f_int: &[[f64; N]], dofs: &DofMap<N>) -> Nodal<N> {
    let balancing = |n: usize| std::array::from_fn(|c| f_int[n][c] - f_ext[n][c]);
    (0..f_ext.len()).map(|n| dofs.held_part(n, &balancing(n))).collect()
}

/// Sum of the reactions of each boundary condition, by [`DofMap::for_each_share`].
pub fn named_reactions<const D: usize, const N: usize>(
    model: &Model<D>,
    reaction: &[[f64; N]],
    dofs: &DofMap<N>,
) -> Vec<[f64; D]> {
    let mut sums = vec![[0.0; D]; model.boundary_conditions.len()];
    for (node, force) in reaction.iter().enumerate() {
        dofs.for_each_share(model, node, force, |condition, axis, share| sums[condition][axis] += share);
    }
    sums
}
