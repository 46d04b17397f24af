//! Motions prescribed weakly on a surface, by an augmented Lagrangian.
//!
//! A condition requires the displacement u of the surface since the start to equal ū along a direction d: an axis, a
//! given direction, or the original normal N of the surface. The surface is divided into patches, about three cells
//! wide, each with constant and linear functions q_k, orthonormal over its original area:
//!
//! m_k = Σ q_k d · (u − ū) A = 0,   f_v = −Σ_k B_kv (λ_k + β m_k),   B_kv = Σ q_k N_v d A.
//!
//! The multipliers λ_k are global unknowns of the step, so Newton's method solves for them directly, without
//! updates λ ← λ + β m between its iterations. The penalty β only makes the stiffness regular: m = 0 at the solution,
//! so the results do not depend on β. With multipliers on patches wider than a cell, the displacement of cut cells
//! keeps enough freedom; one multiplier per sample or per cell would cause locking at the boundary. The multipliers are
//! the reactions.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::assembly::{System, Wanted};
use crate::dofs::ConstraintError;
use crate::formula::Formula;
use crate::grid::Grid;
use crate::material::{axial_modulus_at_rest, axial_modulus_from};
use crate::model::{Model, NodeSet, OnSurface};
use crate::points::Points;
use crate::ranks::Reduction;
use crate::step::{At, Nodal, StepContext};
use crate::surface::{Carried, Surface, SurfaceFields, centre};

use super::super::failure::BeginError;
use super::super::report::{Driven, SurfaceReaction};
use super::equation::Equation;
use super::patches::{Patch, divide_patches, patches};

/// The number s in m = s λ/β, which softens each equation m = 0, [-]. It fixes multipliers that the displacements leave
/// undetermined if conditions repeat each other. The error in displacement that remains is this fraction of the
/// error with the penalty alone.
const SOFTENING: f64 = 1e-10;
/// Distance from the prescribed displacement, relative to the cell size, beyond which a condition is not met, [-]; ten
/// times the tolerance of Newton's method if that is larger.
const UNMET: f64 = 1e-6;

/// A condition on a surface.
pub(super) struct Condition<const D: usize> {
    /// Number of the condition in the model.
    number: usize,
    on: OnSurface,
    /// β, [stress/length]: the axial modulus of the body over the size of a cell, times the factor of the condition.
    penalty: f64,
    /// Axial modulus of the body's law at zero strain, [stress]; zero for a law that has none there.
    modulus_at_rest: f64,
    /// Axes, or directions of the condition, along which the displacement is prescribed.
    components: Vec<usize>,
    patches: Vec<Patch<D>>,
    /// Number of divisions of the surface to which the patches belong.
    n_divisions: usize,
    equations: Vec<Equation<D>>,
    /// m of each equation when the condition began to act, shifted by changes of the condition during the run; the
    /// condition holds the surface at this value. `origins` belongs to the last converged step, `trial_origins` to
    /// the current step. `None` while the condition does not act.
    origins: Option<Vec<f64>>,
    trial_origins: Option<Vec<f64>>,
    /// λ of the last converged step and of the last evaluation; zero while the condition does not act.
    converged: Vec<f64>,
    trial: Vec<f64>,
    /// Reaction on the body at each sample, [force].
    reaction: Vec<[f64; D]>,
    /// For each component, the prescribed displacement in the step at each sample, [length].
    motion: Vec<Vec<f64>>,
    /// For each component, its direction at each sample.
    directions: Vec<Vec<[f64; D]>>,
    /// The largest |m| on this rank at the last evaluation, relative to its scale, [-].
    unmet: f64,
}

impl<const D: usize> Condition<D> {
    /// A condition of the model; `None` if it does not act on a surface.
    pub(super) fn new(model: &Model<D>, number: usize) -> Option<Self> {
        let condition = &model.boundary_conditions[number];
        let NodeSet::Surface(on) = condition.nodes else { return None };
        let surface = &model.surfaces[on.surface];
        let law = model.materials[model.bodies[surface.body].material].law.as_ref();
        let modulus_at_rest = axial_modulus_at_rest(law);
        let penalty = on.penalty * modulus_at_rest / surface.cell;
        let components: Vec<usize> = (0..D).filter(|&d| condition.displacement[d].is_some()).collect();
        let patches = patches(model, surface);
        let n = components.len() * patches.iter().map(|patch| patch.functions.len()).sum::<usize>();
        Some(Condition {
            number,
            on,
            penalty,
            modulus_at_rest,
            directions: directions(model, number, &components, surface),
            components,
            patches,
            n_divisions: 0,
            equations: Vec::new(),
            origins: None,
            trial_origins: None,
            converged: vec![0.0; n],
            trial: vec![0.0; n],
            reaction: vec![[0.0; D]; surface.len()],
            motion: Vec::new(),
            unmet: 0.0,
        })
    }

    /// Takes over the samples of a surface, which may have been divided since; the multipliers and their functions stay.
    pub(super) fn follow(&mut self, model: &Model<D>, carried: &Carried<D>) {
        if self.n_divisions == carried.n_divisions() {
            return;
        }
        self.n_divisions = carried.n_divisions();
        self.patches = patches(model, &model.surfaces[self.on.surface]);
        divide_patches(&mut self.patches, model, carried);
        self.directions = directions(model, self.number, &self.components, carried.surface());
        self.reaction = vec![[0.0; D]; carried.len()];
    }

    /// Σ q_k A d · (u − ū) in the converged state at a time, for each equation; `None` while the condition does not act
    /// or ū is not finite.
    pub(super) fn sums_now(&self, model: &Model<D>, carried: &[Carried<D>], time: f64) -> Option<Vec<f64>> {
        self.origins.as_ref()?;
        Some(self.sums(&self.gaps(model, &carried[self.on.surface], time).ok()?))
    }

    /// Holds the surface where it is at a time, although its samples have changed: `before` are the sums of
    /// [`Condition::sums_now`] before that.
    pub(super) fn stay_at(&mut self, before: &[f64], model: &Model<D>, carried: &[Carried<D>], time: f64) {
        let Some(now) = self.sums_now(model, carried, time) else { return };
        for (origin, (now, before)) in self.origins.iter_mut().flatten().zip(now.iter().zip(before)) {
            *origin += now - before;
        }
    }

    /// Number of equations in the current step; 0 while the condition does not act.
    pub(super) fn len(&self) -> usize {
        self.equations.len()
    }

    /// Number of the condition in the model.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    pub(super) fn surface(&self) -> usize {
        self.on.surface
    }

    /// The grid nodes that carry the patches of this rank, if there are several ranks.
    pub(super) fn nodes(&self, grid: &dyn Grid<D>, carried: &[Carried<D>]) -> Vec<u32> {
        let carried = &carried[self.on.surface];
        let own = self.patches.iter().filter(|patch| patch.is_own(carried));
        own.flat_map(|patch| &patch.samples)
            .flat_map(|sample| carried.nodes_of(grid, *sample as usize))
            .collect()
    }

    /// Gives β a stiffness that exists where the law has none at zero strain: the largest of the body's points in their
    /// converged state, otherwise that of the other bodies at rest.
    fn scale_penalty(&mut self, model: &Model<D>, points: &Points<D>) {
        if self.modulus_at_rest > 0.0 {
            return;
        }
        let surface = &model.surfaces[self.on.surface];
        let law = model.materials[model.bodies[surface.body].material].law.as_ref();
        let state = &points.converged;
        let of_body = (0..points.len()).filter(|&p| points.body[p] as usize == surface.body);
        let own = of_body
            .map(|p| {
                let history = &state.history[p * points.history_len..][..points.history_len];
                axial_modulus_from(law, &state.elastic_strain[p], history)
            })
            .fold(0.0, f64::max);
        let others = || model.materials.iter().map(|material| axial_modulus_at_rest(material.law.as_ref()));
        let modulus = match points.reduction().largest(own) {
            modulus if modulus > 0.0 => modulus,
            _ => others().fold(0.0, f64::max),
        };
        // Results do not depend on β, so any stiffness will do where no law has one yet.
        self.penalty = self.on.penalty * if modulus > 0.0 { modulus } else { 1.0 } / surface.cell;
    }

    /// Begins a step, in which the condition acts if `acts`, and adds the reactions at the start of the step to
    /// `start`.
    pub(super) fn begin(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        carried: &[Carried<D>],
        acts: bool,
        start: &mut Nodal<D>,
    ) -> Result<(), BeginError> {
        self.scale_penalty(step.model, points);
        self.equations.clear();
        self.trial.fill(0.0);
        self.reaction.fill([0.0; D]);
        self.trial_origins = None;
        if !acts {
            return Ok(());
        }
        let carried = &carried[self.on.surface];
        self.motion = self.motion_in(step, carried);
        // The trial positions still equal the converged ones.
        let gaps_at = |time: f64| self.gaps(step.model, carried, time).map_err(BeginError::Constraint);
        let mut gaps = self.sums(&gaps_at(step.step.end)?);
        let origins = match &self.origins {
            Some(origins) => origins.clone(),
            // A condition that acts from the start prescribes the displacement since time 0.
            None if step.step.index == 1 => vec![0.0; gaps.len()],
            None => self.sums(&gaps_at(step.step.start)?),
        };
        gaps.iter_mut().zip(&origins).for_each(|(gap, origin)| *gap -= origin);
        let mut gaps = gaps.into_iter();
        for directions in &self.directions {
            for patch in &self.patches {
                for (function, gap) in patch.functions.iter().zip(&mut gaps) {
                    let mut row: BTreeMap<u32, [f64; D]> = BTreeMap::new();
                    let is_own = patch.is_own(carried);
                    for (&sample, q) in patch.samples.iter().zip(function).filter(|_| is_own) {
                        let d = &directions[sample as usize];
                        carried.for_each_value(sample as usize, |node, value| {
                            let entry = row.entry(node as u32).or_insert([0.0; D]);
                            (0..D).for_each(|i| entry[i] += q * value * d[i]);
                        });
                    }
                    let scale = carried.surface().cell * patch.area.sqrt();
                    self.equations.push(Equation { row: row.into_iter().collect(), gap, scale, is_own });
                }
            }
        }
        self.trial_origins = Some(origins);
        for (equation, multiplier) in self.equations.iter().zip(&self.converged) {
            for (node, b) in &equation.row {
                (0..D).for_each(|d| start[*node as usize][d] -= b[d] * multiplier);
            }
        }
        Ok(())
    }

    /// For each component, the prescribed displacement in a step at each sample, [length]; none if it is not finite.
    fn motion_in(&self, step: &StepContext<D>, carried: &Carried<D>) -> Vec<Vec<f64>> {
        let at = |time: f64| self.prescribed(step.model, carried, time);
        let (Ok(mut motion), Ok(before)) = (at(step.step.end), at(step.step.start)) else {
            return Vec::new();
        };
        let values = motion.iter_mut().flatten().zip(before.iter().flatten());
        values.for_each(|(end, start)| *end -= start);
        motion
    }

    /// Σ q_k A v of values v at the samples of each component, in the order of the equations.
    fn sums(&self, values: &[Vec<f64>]) -> Vec<f64> {
        let mut sums = Vec::new();
        for values in values {
            for patch in &self.patches {
                for function in &patch.functions {
                    let each = patch.samples.iter().zip(function);
                    sums.push(each.map(|(&sample, q)| q * values[sample as usize]).sum());
                }
            }
        }
        sums
    }

    /// d · (u − ū) in the converged state, with ū at the given time, for each component and sample, [length].
    fn gaps(
        &self,
        model: &Model<D>,
        carried: &Carried<D>,
        time: f64,
    ) -> Result<Vec<Vec<f64>>, ConstraintError> {
        let samples = &carried.surface().samples;
        let mut gaps = self.prescribed(model, carried, time)?;
        for (gaps, directions) in gaps.iter_mut().zip(&self.directions) {
            for (sample, (gap, original)) in gaps.iter_mut().zip(samples).enumerate() {
                let x = centre(&carried.facet(sample));
                let moved: f64 = (0..D).map(|d| (x[d] - original[d]) * directions[sample][d]).sum();
                *gap = moved - *gap;
            }
        }
        Ok(gaps)
    }

    /// ū at a time, for each component and sample at its trial position, [length].
    fn prescribed(
        &self,
        model: &Model<D>,
        carried: &Carried<D>,
        time: f64,
    ) -> Result<Vec<Vec<f64>>, ConstraintError> {
        let condition = &model.boundary_conditions[self.number];
        let surface = carried.surface();
        let factor = condition.curve.factor(time);
        let mut all = Vec::new();
        for component in &self.components {
            let Some(formula) = &condition.displacement[*component] else { continue };
            let mut values = Vec::with_capacity(surface.len());
            for (sample, original) in surface.samples.iter().enumerate() {
                let x = centre(&carried.facet(sample));
                let value = at_place(formula, &x, original, factor);
                if !value.is_finite() {
                    return Err(ConstraintError::NotFinite {
                        name: condition.name.clone(),
                        axis: crate::dofs::AXES[component % 3],
                        node: x.to_vec(),
                        factor,
                        formula: formula.text().to_owned(),
                        value,
                    });
                }
                values.push(value);
            }
            all.push(values);
        }
        Ok(all)
    }

    /// True if the condition prescribes the displacement in the same directions as another one on its surface.
    pub(super) fn has_directions_of(&self, other: &Self) -> bool {
        self.directions == other.directions
    }

    /// Continues, at a time, from where the same condition of the model `before` holds the surface: from then on, the
    /// surface moves by the growth of ū in the model `now`, to which this condition belongs. `carried` must be in the
    /// state at this time, and both conditions must have the same directions.
    ///
    /// # Errors
    /// [`ConstraintError::NotFinite`] if ū is not finite.
    pub(super) fn continue_from(
        &mut self,
        models: [&Model<D>; 2],
        carried: &Carried<D>,
        time: f64,
    ) -> Result<(), ConstraintError> {
        let Some(origins) = &self.origins else { return Ok(()) };
        let [before, now] = models.map(|model| Ok(self.sums(&self.prescribed(model, carried, time)?)));
        let growth = before?.into_iter().zip(now?);
        let shifted = origins.iter().zip(growth).map(|(origin, (before, now))| origin + (before - now));
        self.origins = Some(shifted.collect());
        Ok(())
    }

    /// Calls `couple` with the nodes of each equation.
    pub(super) fn couples(&self, couple: &mut dyn FnMut(&[u32])) {
        for equation in &self.equations {
            let nodes: Vec<u32> = equation.row.iter().map(|(node, _)| *node).collect();
            couple(&nodes);
        }
    }

    /// Adds the reactions, their stiffness and the equations of the multipliers, the first of which is the global
    /// unknown `first` of the term.
    pub(super) fn evaluate<const N: usize>(
        &mut self,
        first: usize,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
        fields: &mut SurfaceFields<D>,
    ) {
        let softening = SOFTENING / self.penalty;
        self.unmet = 0.0;
        let mut amounts = Vec::with_capacity(self.equations.len());
        for (k, equation) in self.equations.iter().enumerate() {
            let along = |(node, b): &(u32, [f64; D])| {
                (0..D).map(|d| b[d] * at.delta_d[*node as usize][d]).sum::<f64>()
            };
            let m = equation.gap + equation.row.iter().map(along).sum::<f64>();
            let multiplier = self.converged[k] + at.globals.get(first + k).copied().unwrap_or_default();
            self.trial[k] = multiplier;
            if !equation.is_own {
                amounts.push(0.0);
                continue;
            }
            self.unmet = self.unmet.max(m.abs() / equation.scale);
            let amount = multiplier + self.penalty * m;
            amounts.push(amount);
            let global = first + k;
            sum.border.add_residual(global, m - softening * multiplier, equation.scale);
            sum.border.add_to_corner(global, global, -softening);
            for (node, b) in &equation.row {
                sum.add_holding(*node as usize, &b.map(|b| -b * amount));
                for d in 0..D {
                    sum.border.add_to_column(global, *node as usize, d, b[d]);
                    sum.border.add_to_row(global, *node as usize, d, b[d]);
                }
            }
            if wanted == Wanted::Stiffness {
                equation.add_stiffness(self.penalty, sum);
            }
        }
        self.spread_reactions(&amounts);
        for (sum, reaction) in fields.reaction.iter_mut().zip(&self.reaction) {
            (0..D).for_each(|d| sum[d] += reaction[d]);
        }
    }

    /// Checks that the displacements meet the condition. Multipliers grow beyond all bounds if other conditions forbid
    /// this: the softening then balances the equations, and the multipliers hide all other forces.
    pub(super) fn check(&self, model: &Model<D>) -> Result<(), ConstraintError> {
        if self.unmet <= f64::max(UNMET, 10.0 * model.newton.tolerance) {
            return Ok(());
        }
        let surface = &model.surfaces[self.on.surface];
        Err(ConstraintError::Unmet {
            name: model.boundary_conditions[self.number].name.clone(),
            surface: surface.name.clone(),
            distance: self.unmet * surface.cell,
        })
    }

    /// Sets the reactions at the samples from λ_k + β m_k.
    fn spread_reactions(&mut self, amounts: &[f64]) {
        self.reaction.fill([0.0; D]);
        let mut amounts = amounts.iter();
        for directions in &self.directions {
            for patch in &self.patches {
                for (function, amount) in patch.functions.iter().zip(&mut amounts) {
                    for (&sample, q) in patch.samples.iter().zip(function) {
                        let (reaction, d) =
                            (&mut self.reaction[sample as usize], &directions[sample as usize]);
                        (0..D).for_each(|i| reaction[i] -= q * amount * d[i]);
                    }
                }
            }
        }
    }

    /// The reaction on the body, with its moment about the mean position of the surface.
    pub(super) fn reaction(&self, reduction: &Reduction, carried: &[Carried<D>]) -> SurfaceReaction<D> {
        let carried = &carried[self.on.surface];
        let places: Vec<[f64; D]> = (0..carried.len()).map(|sample| centre(&carried.facet(sample))).collect();
        // The mean over the samples at the start: divided sides do not weigh more than others.
        let share = |sample: usize| carried.origin(sample).1;
        let n = (0..carried.len()).map(share).sum::<f64>().max(1.0);
        // Samples of other ranks may not have moved on this rank; those in its own patches have moved, and only the
        // samples of its own patches have reactions here.
        let own: Vec<usize> = carried.own_samples().collect();
        let mut about: [f64; D] =
            std::array::from_fn(|d| own.iter().map(|s| share(*s) * places[*s][d]).sum());
        reduction.sum(&mut about);
        about.iter_mut().for_each(|x| *x /= n);
        let (mut sum, mut moment) = ([0.0; D], [0.0; 3]);
        for (x, reaction) in places.iter().zip(&self.reaction) {
            let (mut arm, mut force) = ([0.0; 3], [0.0; 3]);
            for d in 0..D {
                sum[d] += reaction[d];
                (arm[d], force[d]) = (x[d] - about[d], reaction[d]);
            }
            for (axis, moment) in moment.iter_mut().enumerate() {
                let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
                *moment += arm[i] * force[j] - arm[j] * force[i];
            }
        }
        reduction.sum(&mut sum);
        reduction.sum(&mut moment);
        SurfaceReaction { condition: self.number, force: sum, about, moment }
    }

    /// What the prescribed motion of the surface does in the step, on all ranks.
    pub(super) fn driven(&self, reduction: &Reduction) -> Driven {
        let mut driven = Driven::default();
        for (motion, directions) in self.motion.iter().zip(&self.directions) {
            for ((moved, direction), reaction) in motion.iter().zip(directions).zip(&self.reaction) {
                let along = (0..D).map(|d| reaction[d] * direction[d]).sum::<f64>();
                driven.add(Driven { work: along * moved, displacement: moved.abs() });
            }
        }
        Driven { work: reduction.total(driven.work), displacement: reduction.largest(driven.displacement) }
    }

    pub(super) fn commit(&mut self) {
        self.converged.clone_from(&self.trial);
        self.origins.clone_from(&self.trial_origins);
    }

    /// Returns to the state in which the condition has not acted yet.
    pub(super) fn forget(&mut self) {
        self.converged.fill(0.0);
        self.origins = None;
    }

    /// The state at the end of the last converged step, for a checkpoint.
    pub(super) fn save(&self) -> Value {
        json!({"multipliers": self.converged, "origins": self.origins})
    }

    /// Restores the state that [`Condition::save`] returned.
    ///
    /// # Errors
    /// The reason why the value is not a state of this condition.
    pub(super) fn restore(&mut self, saved: &Value) -> Result<(), String> {
        let numbers = |key: &str| -> Result<Option<Vec<f64>>, String> {
            serde_json::from_value(saved[key].clone()).map_err(|error| error.to_string())
        };
        let (multipliers, origins) = (numbers("multipliers")?.unwrap_or_default(), numbers("origins")?);
        let fits = |numbers: &Vec<f64>| {
            numbers.len() == self.converged.len() && numbers.iter().all(|x| x.is_finite())
        };
        if !fits(&multipliers) || !origins.as_ref().is_none_or(fits) {
            return Err("its state does not belong to the condition".to_owned());
        }
        (self.converged, self.origins) = (multipliers, origins);
        Ok(())
    }
}

/// A prescribed displacement at a position; a formula without the load factor is multiplied by this factor.
fn at_place<const D: usize>(formula: &Formula, x: &[f64; D], original: &[f64; D], factor: f64) -> f64 {
    crate::dofs::displacement_increment(formula, x, original, [None, Some(factor)])
}

/// For each component of a condition, its direction at each sample of a surface.
fn directions<const D: usize>(
    model: &Model<D>,
    number: usize,
    components: &[usize],
    surface: &Surface<D>,
) -> Vec<Vec<[f64; D]>> {
    let condition = &model.boundary_conditions[number];
    let along = |component: &usize| {
        (0..surface.len()).map(|sample| condition.direction(*component, surface.normal(sample))).collect()
    };
    components.iter().map(along).collect()
}
