//! The surfaces of the bodies: tractions, pressures that follow the surface, and motions prescribed weakly.
//!
//! The term carries all surfaces of the model with the grid. The forces of loads and conditions are external forces, so
//! work, balances and residuals include them in the same way as weight and nodal reactions.

mod condition;
mod equation;
mod load;
mod patches;

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::assembly::{System, Wanted};
use crate::basis::Connectivity;
use crate::model::{Model, NodeSet};
use crate::points::{Points, Split};
use crate::ranks::Reduction;
use crate::step::{At, Nodal, StepContext};
use crate::surface::{Carried, PlacedDivision, Surface, SurfaceFields, centre, unit};

use super::attached::Attached;
use super::failure::{BeginError, EvaluateError, SurfaceLost};
use super::global_unknowns::GlobalUnknowns;
use super::multipliers::{Augmentation, Multipliers};
use super::report::TermReport;
use super::saved::Saved;
use super::term::{Character, Coupled, Term};
use condition::Condition;
use load::SurfaceLoad;

/// Name of the term.
const NAME: &str = "surfaces";

/// The surfaces of a model, with their loads and conditions.
pub struct Surfaces<const D: usize> {
    /// The surfaces, in the order of the model.
    carried: Vec<Carried<D>>,
    /// For each surface, true if its body is present in the step.
    is_there: Vec<bool>,
    loads: Vec<SurfaceLoad<D>>,
    conditions: Vec<Condition<D>>,
    /// Sums over all samples of the surfaces.
    reduction: Reduction,
    /// Forces on the nodes in the state from which the step starts, [force].
    start: Nodal<D>,
    fields: Vec<SurfaceFields<D>>,
}

impl<const D: usize> Surfaces<D> {
    /// The surfaces of a model at the start.
    #[inline(never)]
    pub fn new(model: &Model<D>) -> Self {
        let loads = model.loads.iter().enumerate();
        let on_surface = |(number, load): (usize, &crate::model::Load<D>)| {
            load.action.surface().map(|surface| SurfaceLoad::new(model, number, surface))
        };
        let conditions = model.boundary_conditions.iter().enumerate();
        let weak = |(number, condition): (usize, &crate::model::BoundaryCondition<D>)| {
            matches!(condition.nodes, NodeSet::Surface(_)).then(|| Condition::new(model, number)).flatten()
        };
        Surfaces {
            is_there: vec![true; model.surfaces.len()],
            carried: model.surfaces.iter().map(|surface| Carried::new(surface, model.revolved)).collect(),
            loads: loads.filter_map(on_surface).collect(),
            conditions: conditions.filter_map(weak).collect(),
            reduction: Reduction::default(),
            start: Vec::new(),
            fields: Vec::new(),
        }
    }

    /// The state of all surfaces of a model at the start, without forces.
    #[inline(never)]
    pub fn at_start(model: &Model<D>, points: &Points<D>) -> Vec<SurfaceFields<D>> {
        let mut surfaces = Surfaces::new(model);
        surfaces.find_bodies(model, points);
        surfaces.renew_fields(model);
        surfaces.fields
    }

    /// Adapts the saved states of the terms of the model `before`, as of this time, to the model `now`: conditions that
    /// have changed start from where their surfaces are at this time.
    ///
    /// # Errors
    /// The reason why a run cannot go on with the model `now`; the states are then unchanged.
    pub fn continue_from(
        [before, now]: [&Model<D>; 2],
        states: &mut BTreeMap<String, Saved>,
        time: f64,
    ) -> Result<(), String> {
        let mut surfaces = Surfaces::new(now);
        let Some(state) = states.get(NAME).filter(|_| !surfaces.conditions.is_empty()) else { return Ok(()) };
        let earlier = Surfaces::new(before).conditions;
        let mut pairs = surfaces.conditions.iter().zip(&earlier);
        if let Some((changed, _)) = pairs.find(|(now, before)| !now.has_directions_of(before)) {
            let name = &now.boundary_conditions[changed.number()].name;
            return Err(format!(
                "the directions in which `{name}` prescribes the displacement cannot change"
            ));
        }
        Term::<D, D>::restore(&mut surfaces, &state.value())?;
        let Surfaces { conditions, carried, .. } = &mut surfaces;
        for condition in conditions {
            let carried = &carried[condition.surface()];
            condition.follow(now, carried);
            condition.continue_from([before, now], carried, time).map_err(|error| error.to_string())?;
        }
        states.extend(Term::<D, D>::save(&surfaces).map(|state| (NAME.to_owned(), state)));
        Ok(())
    }

    /// Determines which surfaces belong to bodies that have points.
    fn find_bodies(&mut self, model: &Model<D>, points: &Points<D>) {
        let mut has_points = vec![false; model.bodies.len()];
        points.body.iter().for_each(|&body| has_points[body as usize] = true);
        let reduction = points.reduction();
        has_points.iter_mut().for_each(|has| *has = reduction.any(*has));
        self.is_there = model.surfaces.iter().map(|surface| has_points[surface.body]).collect();
    }

    /// The geometry of all surfaces at the trial positions, without forces; empty for surfaces whose body is absent.
    fn renew_fields(&mut self, model: &Model<D>) {
        self.fields.clear();
        for (carried, is_there) in self.carried.iter().zip(&self.is_there) {
            if !is_there {
                self.fields.push(SurfaceFields::default());
                continue;
            }
            let mut fields = SurfaceFields {
                pressure: vec![0.0; carried.len()],
                load: vec![[0.0; D]; carried.len()],
                reaction: vec![[0.0; D]; carried.len()],
                ..SurfaceFields::default()
            };
            for sample in 0..carried.len() {
                let corners = carried.facet(sample);
                fields.position.push(centre(&corners));
                let area = carried.area(sample);
                let size = area.iter().map(|a| a * a).sum::<f64>().sqrt();
                fields.normal.push(unit(&area));
                fields.area.push(size * model.mean_depth(&corners));
            }
            self.fields.push(fields);
        }
    }
}

impl<const D: usize> Surfaces<D> {
    /// The divisions of sides by cuts of points of all ranks, each with the index of the surface, in the order of the
    /// cuts; the same on all ranks, which must call this together.
    fn divisions_by(&self, points: &Points<D>, cuts: &[Split]) -> Vec<(usize, PlacedDivision)> {
        let halves = points.halves_of(cuts);
        let mut own = Vec::new();
        for (surface, carried) in (0u32..).zip(&self.carried) {
            let divisions = carried.divisions_by(points, &halves).into_iter();
            own.extend(divisions.map(|(cut, division)| (cut, surface, division)));
        }
        let mut all = points.reduction().join(own);
        all.sort_by_key(|(cut, surface, division)| (*cut, *surface, division.division.sample));
        all.into_iter().map(|(_, surface, division)| (surface as usize, division)).collect()
    }
}

/// The error for a surface that no cell with material carries at a position.
fn lost<const D: usize>(model: &Model<D>, surface: &Surface<D>, position: &[f64; D]) -> BeginError {
    BeginError::Surface(Box::new(SurfaceLost {
        surface: surface.name.clone(),
        body: model.bodies[surface.body].name.clone(),
        position: position.to_vec(),
    }))
}

impl<const D: usize, const N: usize> Term<D, N> for Surfaces<D> {
    fn name(&self) -> &'static str {
        NAME
    }

    fn character(&self, model: &Model<D>) -> Character {
        Character {
            is_symmetric: !self.loads.iter().any(|load| load.follows(model)),
            may_hold: !self.conditions.is_empty() || self.loads.iter().any(|load| load.is_hydrostatic),
            ..Character::SMOOTH
        }
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        let StepContext { model, links, .. } = *step;
        self.reduction = points.reduction();
        self.find_bodies(model, points);
        for ((surface, carried), is_there) in model.surfaces.iter().zip(&mut self.carried).zip(&self.is_there)
        {
            if !is_there {
                carried.clear();
                continue;
            }
            carried.locate(model.grid.as_ref(), links).map_err(|position| lost(model, surface, &position))?;
        }
        self.start = vec![[0.0; D]; links.n_active()];
        for load in &mut self.loads {
            let is_there = self.is_there[load.surface()];
            load.begin(step, &self.carried, is_there, &mut self.start)?;
        }
        for condition in &mut self.conditions {
            let acts = self.is_there[condition.surface()] && model.is_set(condition.number());
            condition.follow(model, &self.carried[condition.surface()]);
            condition.begin(step, points, &self.carried, acts, &mut self.start)?;
        }
        Ok(())
    }

    fn couples(&self, couple: &mut dyn FnMut(Coupled)) {
        let mut couple = |nodes: &[u32]| couple(Coupled::Nodes(nodes));
        self.loads.iter().for_each(|load| load.couples(&self.carried, &mut couple));
        self.conditions.iter().for_each(|condition| condition.couples(&mut couple));
    }

    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        self.carried.iter_mut().for_each(|carried| carried.follow(at.delta_d));
        self.renew_fields(step.model);
        for load in &mut self.loads {
            let surface = load.surface();
            if self.is_there[surface] {
                load.evaluate(step.model, &self.carried[surface], at, wanted, sum, &mut self.fields[surface]);
            }
        }
        let mut first = 0;
        for condition in &mut self.conditions {
            let fields = &mut self.fields[condition.surface()];
            condition.evaluate(first, at, wanted, sum, fields);
            first += condition.len();
        }
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<N>) {
        crate::assembly::add(force, &self.start);
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        self.loads.iter().for_each(|load| load.add_resultant(&mut report.loads));
        let acting = self.conditions.iter().filter(|condition| condition.len() > 0);
        for condition in acting {
            report.reactions.push(condition.reaction(&self.reduction, &self.carried));
            report.add_driven(condition.driven(&self.reduction));
        }
        let completed = |(fields, carried): (&SurfaceFields<D>, &Carried<D>)| {
            fields.completed(&self.reduction, |sample| carried.is_own(sample))
        };
        report.add_list(self.fields.iter().zip(&self.carried).map(completed).collect());
    }

    fn commit(&mut self, _: &StepContext<D>, _: &mut Points<D>) {
        self.carried.iter_mut().for_each(|carried| carried.complete(&self.reduction));
        self.carried.iter_mut().for_each(Carried::commit);
        self.conditions.iter_mut().for_each(Condition::commit);
    }

    fn save(&self) -> Option<Saved> {
        let surfaces: Vec<Value> = self.carried.iter().map(Carried::save).collect();
        let conditions: Vec<Value> = self.conditions.iter().map(Condition::save).collect();
        Some(json!({"surfaces": surfaces, "conditions": conditions}).into())
    }

    fn restore(&mut self, saved: &Value) -> Result<(), String> {
        let entries = |key: &str, wanted: usize| -> Result<Vec<Value>, String> {
            let entries = saved[key].as_array().cloned().unwrap_or_default();
            if entries.len() == wanted {
                Ok(entries)
            } else {
                Err(format!("the number of its {key} differs"))
            }
        };
        let surfaces = entries("surfaces", self.carried.len())?;
        let conditions = entries("conditions", self.conditions.len())?;
        self.carried.iter_mut().zip(&surfaces).try_for_each(|(part, saved)| part.restore(saved))?;
        self.conditions.iter_mut().zip(&conditions).try_for_each(|(part, saved)| part.restore(saved))
    }

    fn multipliers(&mut self) -> Option<&mut dyn Multipliers<D, N>> {
        Some(self)
    }

    fn global_unknowns(&self) -> Option<&dyn GlobalUnknowns<D>> {
        Some(self)
    }

    fn attached(&mut self) -> Option<&mut dyn Attached<D>> {
        Some(self)
    }
}

impl<const D: usize, const N: usize> Multipliers<D, N> for Surfaces<D> {
    /// Checks that all conditions are met; they have no multipliers that are constant during iterations.
    fn augment(
        &mut self,
        step: &StepContext<D>,
        _: &Points<D>,
        _: At<N>,
    ) -> Result<Augmentation, EvaluateError> {
        self.conditions.iter().try_for_each(|condition| condition.check(step.model))?;
        Ok(Augmentation::Satisfied)
    }
}

impl<const D: usize> GlobalUnknowns<D> for Surfaces<D> {
    fn count(&self) -> usize {
        self.conditions.iter().map(Condition::len).sum()
    }
}

impl<const D: usize> Attached<D> for Surfaces<D> {
    /// The nodes that carry the samples and patches of this rank.
    fn reach(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) -> Result<Vec<u32>, BeginError> {
        self.find_bodies(model, points);
        let (grid, mut nodes) = (model.grid.as_ref(), Vec::new());
        for ((surface, carried), is_there) in model.surfaces.iter().zip(&mut self.carried).zip(&self.is_there)
        {
            if *is_there {
                carried.find(grid, links).map_err(|position| lost(model, surface, &position))?;
                carried.own_samples().for_each(|sample| nodes.extend(carried.nodes_of(grid, sample)));
            }
        }
        for condition in &mut self.conditions {
            condition.follow(model, &self.carried[condition.surface()]);
            if self.is_there[condition.surface()] && model.is_set(condition.number()) {
                nodes.extend(condition.nodes(grid, &self.carried));
            }
        }
        Ok(links.with_carriers_of(nodes))
    }

    fn place_body(&mut self, model: &Model<D>, body: usize, moved: &dyn Fn(&[f64; D]) -> Option<[f64; D]>) {
        let surfaces = model.surfaces.iter().zip(&mut self.carried);
        for (_, carried) in surfaces.filter(|(surface, _)| surface.body == body) {
            carried.place(moved);
        }
    }

    fn forget_bodies(&mut self, model: &Model<D>, removed: &[usize]) {
        for (surface, carried) in model.surfaces.iter().zip(&mut self.carried) {
            if removed.contains(&surface.body) {
                *carried = Carried::new(surface, model.revolved);
            }
        }
        for condition in &mut self.conditions {
            if removed.contains(&model.surfaces[condition.surface()].body) {
                condition.forget();
                condition.follow(model, &self.carried[condition.surface()]);
            }
        }
    }

    /// The sides of the halves take the place of the sides of the whole domains.
    fn follow_cuts(&mut self, model: &Model<D>, points: &Points<D>, cuts: &[Split], time: f64) {
        let divisions = self.divisions_by(points, cuts);
        let mut is_divided = vec![false; self.carried.len()];
        divisions.iter().for_each(|(surface, _)| is_divided[*surface] = true);
        let held = |condition: &Condition<D>| condition.sums_now(model, &self.carried, time);
        let of_divided = |condition: &Condition<D>| is_divided[condition.surface()];
        let before: Vec<Option<Vec<f64>>> = (self.conditions.iter())
            .map(|condition| Some(condition).filter(|c| of_divided(c)).and_then(held))
            .collect();
        divisions.iter().for_each(|(surface, division)| self.carried[*surface].divide(division));
        for (condition, before) in self.conditions.iter_mut().zip(before) {
            condition.follow(model, &self.carried[condition.surface()]);
            if let Some(before) = before {
                condition.stay_at(&before, model, &self.carried, time);
            }
        }
    }
}
