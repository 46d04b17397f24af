//! The unknowns of a load step: displacement increments, reactions and load factor, eqs. (28), (30) and (40).

use crate::assembly::System;
use crate::dofs::DofMap;
use crate::linear::LinearError;
use crate::model::Model;

use super::residual::norm;
use super::residual::{Forces, Parts};
use crate::step::{At, Nodal};

/// The unknowns of a load step and the vectors that an iteration works with.
pub(super) struct Unknowns<const D: usize> {
    /// Displacement increment Δd of the active nodes, [length].
    pub(super) delta_d: Nodal<D>,
    /// Load factor, where that is unknown, [-].
    pub(super) factor: f64,
    /// Reactions, from the linearised equations of the iterations so far, [force].
    pub(super) reaction: Nodal<D>,
    /// The last iterative displacement δd, [length], …
    pub(super) iterative: Nodal<D>,
    /// … the change of the load factor that belongs to it, …
    pub(super) iterative_factor: f64,
    /// … and K δd, [force].
    pub(super) k_delta: Nodal<D>,
    /// Whether δd contains a prescribed motion, of which a part would be no step towards equilibrium.
    pub(super) prescribes: bool,
    pub(super) rhs: Nodal<D>,
    /// What the first iterative displacement is predicted to be, in place of a solution, [length].
    pub(super) predicted: Option<Nodal<D>>,
    /// (δd, rhs) where δd was found: the slope of the potential there, [energy].
    slope: f64,
    /// How much of δd has been taken, [-].
    taken: f64,
    /// A displacement that no equilibrium in this grid can have, [length].
    far: f64,
    /// The connected parts of the bodies.
    pub(super) parts: Parts,
}

/// An iterative displacement of so many diameters of the grid is the work of a singular stiffness.
const FAR: f64 = 1e6;

/// A line search is content with this part of the slope of the potential.
const FLAT: f64 = 0.5;

/// A prescribed displacement that differs by less than this, relative to its size, is reached.
const REACHED: f64 = 1e-12;

impl<const D: usize> Unknowns<D> {
    pub(super) fn new(model: &Model<D>, parts: Parts, factor: f64, n_active: usize) -> Self {
        let zero = vec![[0.0; D]; n_active];
        let [low, high] = model.grid.bounds();
        let diameter = norm((0..D).map(|d| high[d] - low[d]));
        Unknowns {
            delta_d: zero.clone(),
            factor,
            reaction: zero.clone(),
            iterative: zero.clone(),
            iterative_factor: 0.0,
            k_delta: zero.clone(),
            prescribes: false,
            rhs: zero,
            predicted: None,
            slope: 0.0,
            taken: 1.0,
            far: FAR * diameter,
            parts,
        }
    }

    /// The right-hand side of eq. (26), with what is left of the prescribed motion in the iterative displacement.
    pub(super) fn right_hand_side(
        &mut self,
        system: &mut System<D>,
        dofs: &DofMap<D>,
        out_of_balance: &[[f64; D]],
    ) {
        let Unknowns { iterative: delta, k_delta, rhs, delta_d, prescribes, .. } = self;
        delta.fill([0.0; D]);
        k_delta.fill([0.0; D]);
        // The motion of the prescribed degrees of freedom loads the free ones through K.
        let mut moves = false;
        dofs.for_each(|node, axis, _| {
            if let Some((increment, _)) = dofs.prescribed(node, axis) {
                delta[node][axis] = increment - delta_d[node][axis];
                moves |= delta[node][axis] != 0.0;
            }
        });
        *prescribes = moves;
        if moves {
            system.multiply(delta, k_delta);
        }
        dofs.for_each(|node, axis, free| {
            let force = out_of_balance[node][axis] - k_delta[node][axis];
            rhs[node][axis] = if free.is_some() { force } else { 0.0 };
        });
    }

    /// Takes the iterative displacement, eq. (30), with the linearised change of the reactions.
    pub(super) fn advance(
        &mut self,
        system: &mut System<D>,
        dofs: &DofMap<D>,
        out_of_balance: &[[f64; D]],
    ) -> Result<(), LinearError> {
        // Only a motion that nothing resists carries a node that far.
        let far = |u: &f64| u.abs() > self.far;
        let delta = &self.iterative;
        let carried = (0..delta.len())
            .find_map(|node| delta[node].iter().position(far).and_then(|axis| dofs.free(node, axis)));
        if let Some(unknown) = carried {
            return Err(LinearError::Singular { unknown: Some(unknown) });
        }
        system.multiply(&self.iterative, &mut self.k_delta);
        let (change, per_factor) = (self.iterative_factor, system.per_factor());
        dofs.for_each(|node, axis, free| {
            self.delta_d[node][axis] += self.iterative[node][axis]; // (30)
            if free.is_none() {
                let load = per_factor.map_or(0.0, |unit| change * unit[node][axis]);
                let unbalanced = out_of_balance[node][axis];
                self.k_delta[node][axis] -= load;
                self.reaction[node][axis] += self.k_delta[node][axis] - unbalanced;
            } else {
                self.k_delta[node][axis] = 0.0;
            }
        });
        self.factor += change;
        self.taken = 1.0;
        self.slope = self.slope(&self.rhs);
        Ok(())
    }

    /// Forgets all iterations.
    pub(super) fn start_again(&mut self) {
        self.delta_d.fill([0.0; D]);
        self.reaction.fill([0.0; D]);
        self.iterative.fill([0.0; D]);
    }

    /// Takes only a part of what is taken of the last iterative displacement.
    pub(super) fn shorten(&mut self, part: f64) {
        let back = 1.0 - part;
        for (u, delta) in self.delta_d.iter_mut().flatten().zip(self.iterative.iter_mut().flatten()) {
            *u -= back * *delta;
            *delta *= part;
        }
        // Not zero on prescribed degrees of freedom only.
        for (reaction, change) in self.reaction.iter_mut().flatten().zip(self.k_delta.iter_mut().flatten()) {
            *reaction -= back * *change;
            *change *= part;
        }
        self.factor -= back * self.iterative_factor;
        self.iterative_factor *= part;
        self.taken *= part;
    }

    /// The work of a force on the whole last iterative displacement, [energy].
    pub(super) fn slope(&self, force: &[[f64; D]]) -> f64 {
        let work = force.iter().flatten().zip(self.iterative.iter().flatten()).map(|(f, u)| f * u);
        work.sum::<f64>() / self.taken
    }

    /// The part of what is taken at which the potential is flatter, given its slope here; `None` where it is flat enough or
    /// falls on.
    pub(super) fn flatter(&self, slope: f64) -> Option<f64> {
        let climbs = self.slope > 0.0 && slope < -FLAT * self.slope;
        climbs.then(|| (self.slope / (self.slope - slope)).clamp(0.1, 0.9))
    }

    /// Whether all prescribed displacements have been reached.
    pub(super) fn follows(&self, dofs: &DofMap<D>) -> bool {
        let mut follows = true;
        dofs.for_each(|node, axis, _| {
            if let Some((increment, _)) = dofs.prescribed(node, axis) {
                follows &= (increment - self.delta_d[node][axis]).abs() <= REACHED * increment.abs();
            }
        });
        follows
    }

    /// f_ext − f_int + f_react over all degrees of freedom, constrained ones included; eq. (28) with the sign that
    /// eq. (26) needs.
    pub(super) fn balance(&self, f_ext: &Nodal<D>, f_int: &[[f64; D]]) -> Nodal<D> {
        (0..f_ext.len())
            .map(|n| std::array::from_fn(|d| f_ext[n][d] - f_int[n][d] + self.reaction[n][d]))
            .collect()
    }

    /// Where the terms are evaluated.
    pub(super) fn at(&self) -> At<'_, D> {
        At { delta_d: &self.delta_d, factor: self.factor }
    }

    /// The forces that eq. (40) compares.
    pub(super) fn forces<'a>(&'a self, out_of_balance: &'a Nodal<D>, f_ext: &'a Nodal<D>) -> Forces<'a, D> {
        Forces { out_of_balance, f_ext, reaction: &self.reaction }
    }
}
