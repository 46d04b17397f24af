//! The unknowns of a load step: nodal increments, reactions, load factor and global unknowns, eqs. (28) and (30).

use crate::assembly::{Border, System};
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::linear::LinearError;
use crate::model::Model;
use crate::ranks::Reduction;
use crate::region::vector::{minus, norm};
use crate::step::{At, Nodal};

use super::line_search::Bracket;
use super::residual::Forces;

/// The unknowns of a load step and the vectors that an iteration works with.
pub(super) struct Unknowns<const N: usize> {
    /// Increments at the active nodes; the displacement increments are Δd, [length].
    pub(super) delta_d: Nodal<N>,
    /// Load factor, if it is unknown, [-].
    pub(super) factor: f64,
    /// Increments of the global unknowns.
    pub(super) globals: Vec<f64>,
    /// Reactions, from the linearised equations of the iterations so far, [force].
    pub(super) reaction: Nodal<N>,
    /// The last iterative increment δd.
    pub(super) iterative: Nodal<N>,
    /// The changes of the load factor and of the global unknowns that belong to δd.
    pub(super) iterative_factor: f64,
    pub(super) iterative_globals: Vec<f64>,
    /// K δd, [force]; once δd has been added to Δd, the part of the linearised change of f_int − f_ext that the
    /// constraints carry.
    pub(super) k_delta: Nodal<N>,
    /// True if δd contains a prescribed motion, so that a fraction of it would not lead towards equilibrium.
    pub(super) prescribes: bool,
    /// Right-hand side of the equations for the unknowns, [force].
    pub(super) rhs: Nodal<N>,
    /// Prediction of the first iterative displacement, used instead of a linear solve, [length].
    pub(super) predicted: Option<Nodal<N>>,
    /// Work of the out-of-balance forces on δd and on the changes of the global unknowns, at the iterate where these
    /// were computed: the negative slope of the potential there, [energy].
    slope: f64,
    /// The fraction of δd that has been applied, [-].
    taken: f64,
    /// Number of axes, and of displacement components.
    axes: usize,
    /// A displacement that no equilibrium in this grid can have, [length].
    far: f64,
    /// The nodes shared with other ranks.
    pub(super) reduction: Reduction,
}

/// An iterative displacement of this many grid diameters indicates a singular stiffness.
const FAR: f64 = 1e6;

/// A line search ends when the slope of the potential has fallen to this fraction, [-].
const FLAT: f64 = 0.5;

impl<const N: usize> Unknowns<N> {
    pub(super) fn new<const D: usize>(
        model: &Model<D>,
        factor: f64,
        links: &Connectivity<D>,
        n_globals: usize,
    ) -> Self {
        let zero = vec![[0.0; N]; links.n_active()];
        let [low, high] = model.grid.bounds();
        let diameter = norm(&minus(&high, &low));
        Unknowns {
            delta_d: zero.clone(),
            factor,
            globals: vec![0.0; n_globals],
            reaction: zero.clone(),
            iterative: zero.clone(),
            iterative_factor: 0.0,
            iterative_globals: vec![0.0; n_globals],
            k_delta: zero.clone(),
            prescribes: false,
            rhs: zero,
            predicted: None,
            slope: 0.0,
            taken: 1.0,
            axes: D,
            far: FAR * diameter,
            reduction: links.reduction().clone(),
        }
    }

    /// Forms the right-hand side of eq. (26). The iterative increment becomes the remainder of the prescribed motion,
    /// which loads the free degrees of freedom through K.
    pub(super) fn begin_iteration(
        &mut self,
        system: &mut System<N>,
        dofs: &DofMap<N>,
        out_of_balance: &[[f64; N]],
    ) {
        let Unknowns { iterative, k_delta, rhs, delta_d, reduction, .. } = self;
        self.prescribes = reduction.any(dofs.remaining(delta_d, iterative));
        k_delta.fill([0.0; N]);
        if self.prescribes {
            system.multiply(iterative, k_delta);
            dofs.condense(k_delta);
        }
        for ((rhs, force), change) in rhs.iter_mut().zip(out_of_balance).zip(k_delta) {
            *rhs = std::array::from_fn(|c| force[c] - change[c]);
        }
        dofs.on_unknowns(rhs);
    }

    /// Adds the iterative increment to Δd, eq. (30), and updates the reactions by their linearised change.
    pub(super) fn advance(
        &mut self,
        system: &mut System<N>,
        dofs: &DofMap<N>,
        out_of_balance: &[[f64; N]],
    ) -> Result<(), LinearError> {
        // Only a motion without resistance carries a node that far.
        let far = |u: &f64| u.abs() > self.far;
        let delta = &self.iterative;
        let carried = (0..delta.len()).find_map(|node| {
            delta[node][..self.axes].iter().position(far).and_then(|axis| dofs.free(node, axis))
        });
        if self.reduction.any(carried.is_some()) {
            return Err(LinearError::Singular { unknown: carried });
        }
        system.multiply(&self.iterative, &mut self.k_delta);
        system.border.add_columns(&self.iterative_globals, &mut self.k_delta);
        dofs.condense(&mut self.k_delta);
        let (change, per_factor) = (self.iterative_factor, system.per_factor());
        for node in 0..self.delta_d.len() {
            let mut balanced = self.k_delta[node];
            for c in 0..N {
                self.delta_d[node][c] += self.iterative[node][c]; // (30)
                balanced[c] -= per_factor.map_or(0.0, |unit| change * unit[node][c]);
            }
            self.k_delta[node] = dofs.held_part(node, &balanced);
            let unbalanced = dofs.held_part(node, &out_of_balance[node]);
            for c in 0..N {
                self.reaction[node][c] += self.k_delta[node][c] - unbalanced[c]; // f_react of (28), linearised
            }
        }
        self.factor += change;
        for (global, change) in self.globals.iter_mut().zip(&self.iterative_globals) {
            *global += change;
        }
        self.taken = 1.0;
        // Without prescribed motion, which a line search never shortens, this is the work on the unknowns.
        self.slope = self.slope(out_of_balance, &system.border);
        Ok(())
    }

    /// Adds the response to a change of the load factor, given the responses to a unit change.
    pub(super) fn add_response(&mut self, change: f64, response: &[[f64; N]], globals: &[f64]) {
        self.add_to_increment(change, response, globals);
        self.iterative_factor = change;
    }

    /// Adds a multiple of a motion to the iterative increment.
    pub(super) fn add_to_increment(&mut self, factor: f64, nodes: &[[f64; N]], globals: &[f64]) {
        let add = |sum: &mut [f64], more: &[f64]| {
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += factor * more);
        };
        add(self.iterative.as_flattened_mut(), nodes.as_flattened());
        add(&mut self.iterative_globals, globals);
    }

    /// Resets Δd, the global unknowns and the reactions; the load factor stays.
    pub(super) fn start_again(&mut self) {
        self.delta_d.fill([0.0; N]);
        self.globals.fill(0.0);
        self.reaction.fill([0.0; N]);
        self.iterative.fill([0.0; N]);
    }

    /// Shortens the last iterative increment: of what was applied, only the fraction `part` is kept.
    pub(super) fn shorten(&mut self, part: f64) {
        let back = 1.0 - part;
        let retreat = |value: &mut f64, change: &mut f64| {
            *value -= back * *change;
            *change *= part;
        };
        let both = |values: &mut [f64], changes: &mut [f64]| {
            values.iter_mut().zip(changes).for_each(|(value, change)| retreat(value, change));
        };
        both(self.delta_d.as_flattened_mut(), self.iterative.as_flattened_mut());
        // These are zero for components without a constraint.
        both(self.reaction.as_flattened_mut(), self.k_delta.as_flattened_mut());
        both(&mut self.globals, &mut self.iterative_globals);
        retreat(&mut self.factor, &mut self.iterative_factor);
        self.taken *= part;
    }

    /// Work of the out-of-balance forces, at the nodes and in the global equations, over the whole of the last
    /// increment, [energy].
    pub(super) fn slope(&self, force: &[[f64; N]], border: &Border<N>) -> f64 {
        (self.reduction.dot(force, &self.iterative) + border.work(&self.iterative_globals)) / self.taken
    }

    /// The factor by which to scale the applied fraction of the last increment, so that the increment ends where a
    /// secant of the slope of the potential is zero; `None` if the slope is small enough already or no bracket is
    /// known.
    pub(super) fn secant_fraction(
        &self,
        out_of_balance: &[[f64; N]],
        border: &Border<N>,
        bracket: &mut Bracket,
    ) -> Option<f64> {
        let (start, slope) = (self.slope, self.slope(out_of_balance, border));
        if start <= 0.0 || slope.abs() <= FLAT * start {
            return None;
        }
        bracket.factor(start, self.taken, slope)
    }

    /// f_ext − f_int + f_react over all components, including constrained ones; eq. (28) with the sign that eq. (26)
    /// needs.
    pub(super) fn balance(&self, system: &System<N>) -> Nodal<N> {
        let (f_ext, f_int) = (system.external_force(), system.internal_force());
        (0..f_ext.len())
            .map(|n| std::array::from_fn(|c| f_ext[n][c] - f_int[n][c] + self.reaction[n][c]))
            .collect()
    }

    /// The unknowns at which the terms are evaluated.
    pub(super) fn at(&self) -> At<'_, N> {
        At { delta_d: &self.delta_d, factor: self.factor, globals: &self.globals }
    }

    /// The forces that eq. (40) compares.
    pub(super) fn forces<'a>(&'a self, out_of_balance: &'a Nodal<N>, system: &'a System<N>) -> Forces<'a, N> {
        let (f_ext, holding, scale) = (system.external_force(), system.holding_force(), system.scale_force());
        Forces { out_of_balance, f_ext, reaction: &self.reaction, holding, scale }
    }
}
