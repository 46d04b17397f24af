//! The load steps of an analysis or of its stages, and the points of bodies that stages add.

use super::Builder;
use crate::initial_stress::initial_factor;
use crate::region::{DeckRegion, Regions};
use crate::{AtLimit, ControlDeck, DynamicDeck, LoadDeck, Reset, StageDeck, StepsDeck, Until};
use mpm_core::model::{Control, Controlled, Course, Factors, LoadCurve, Model, Stage, Stepping};
use mpm_core::points::Points;
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Load steps that begin at a given time, with result files after every `every` steps.
    pub(super) fn stepping(
        &self,
        (steps, dynamic): (&StepsDeck, Option<&DynamicDeck>),
        start_time: f64,
        every: u32,
        curves: &[&LoadCurve],
    ) -> Stepping {
        let StepsDeck {
            count: _,
            size: _,
            end_time: duration,
            smallest,
            damping,
            viscosity,
            largest,
            ref control,
            until,
        } = *steps;
        let end_time = start_time + duration;
        let mut stepping = Stepping {
            start_time,
            smallest,
            damping,
            viscosity,
            largest,
            stops: every.max(1) as usize,
            until_limit: until == Until::Limit,
            control: match control {
                ControlDeck::StrengthReduction { from, to, after_slide, .. } => {
                    Control::StrengthReduction { from: *from, to: *to, after_slide: *after_slide }
                }
                ControlDeck::Load {} => Control::Load,
                ControlDeck::ArcLength { length } => Control::ArcLength { length: *length },
                ControlDeck::Displacement { probe, tool, axis, to } => Control::Displacement {
                    controlled: match tool {
                        Some(name) => {
                            let tool = self.deck.tools.iter().position(|tool| tool.name == *name);
                            Controlled::Tool(tool.unwrap_or(0))
                        }
                        None => {
                            let mut probes = self.deck.output.probes.iter();
                            Controlled::Probe(
                                probes.position(|p| Some(&p.name) == probe.as_ref()).unwrap_or(0),
                            )
                        }
                    },
                    axis: *axis as usize,
                    to: *to,
                },
            },
            dynamics: dynamic.map(DynamicDeck::dynamics),
            until_rest: until == Until::Rest,
            ..Stepping::fixed(steps.count() as usize, end_time)
        };
        if let ControlDeck::StrengthReduction { from, to, tolerance, .. } = control {
            // A step that fails is halved unless it is below twice the smallest size.
            stepping.smallest = (0.5 * tolerance * stepping.count as f64 / (to - from)).min(1.0);
        }
        // Without intermediate output, steps may grow freely.
        if every == 0 {
            stepping.stops = stepping.count;
        }
        let between = |t: &f64| *t > start_time && *t < end_time;
        // A time at the end of a requested step must equal the time of this step to the last bit.
        let step_time = |t: f64| stepping.requested(t).map_or(t, |step| stepping.time(step));
        let mut knots: Vec<f64> =
            curves.iter().flat_map(|c| c.knots()).filter(between).map(step_time).collect();
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        Stepping { knots, ..stepping }
    }

    /// Adds the stages of the deck to a model, and removes from `points` the points of bodies that are absent at the
    /// start.
    pub(super) fn divide(&mut self, model: &mut Model<D>, points: &mut Points<D>, regions: &Regions<D>) {
        let deck = self.deck;
        let resets = |stage: &StageDeck| {
            stage.then.as_ref().is_some_and(|then| then.reset.contains(&Reset::Displacement))
        };
        // The way of a body onto another one is no displacement of the body.
        let places = |stage: &StageDeck| stage.add.iter().any(|added| added.onto().is_some());
        if deck.stages.iter().any(|stage| resets(stage) || places(stage))
            && let Err(error) = points.prepare_resets()
        {
            self.error("D053", "/stages", error.to_string(), "remove `reset` and `onto`".to_owned());
        }
        let mut start_time = 0.0;
        for (number, stage) in deck.stages.iter().enumerate() {
            let (loads, boundary_conditions) = self.courses_of(stage);
            let own = |courses: &[Course], k: usize| courses[k] == Course::Own;
            let curves: Vec<&LoadCurve> = (model.loads.iter().enumerate())
                .filter(|(k, _)| own(&loads, *k))
                .map(|(_, load)| &load.curve)
                .chain(
                    (model.boundary_conditions.iter().enumerate())
                        .filter(|(k, _)| own(&boundary_conditions, *k))
                        .map(|(_, condition)| &condition.curve),
                )
                .chain(model.tools.iter().flat_map(|tool| tool.curves()))
                .collect();
            let every = if deck.output.every == 0 { 0 } else { stage.every.unwrap_or(deck.output.every) };
            let mut stepping =
                self.stepping((&stage.steps, stage.dynamic.as_ref()), start_time, every, &curves);
            if stage.at_limit == AtLimit::Next {
                stepping.goes_on_at_limit = true;
                (stepping.damping, stepping.viscosity) = (false, 0.0);
            }
            start_time = stepping.end_time;
            let mut added = points.clone();
            let to_add: Vec<usize> = stage.added().iter().map(|name| self.body_number(name)).collect();
            added.retain_bodies(|body| to_add.contains(&body));
            let condition = |name: &String| {
                deck.boundary_conditions.iter().position(|condition| condition.name == *name).unwrap_or(0)
            };
            let material = |name: &String| deck.materials.keys().position(|other| other == name).unwrap_or(0);
            model.stages.push(Stage {
                name: stage.name.clone(),
                stepping,
                newton: stage.solver.as_ref().unwrap_or(&deck.solver).newton(deck.has_contact()),
                every: stage.every.map(|every| every as usize),
                loads,
                boundary_conditions,
                released: (stage.release.iter())
                    .chain(stage.absorb.iter().map(|absorbed| &absorbed.condition))
                    .map(condition)
                    .collect(),
                absorbed: self.absorbed(number),
                set: stage.set.iter().map(condition).collect(),
                added,
                lifts: self.lifts(model.grid.as_ref(), regions, points, number),
                removed: stage.remove.iter().map(|name| self.body_number(name)).collect(),
                materials: (stage.material.iter())
                    .map(|(body, name)| (self.body_number(body), material(name)))
                    .collect(),
                contacts: None,
                resets_displacement: resets(stage),
            });
        }
        if model.stages.is_empty() {
            return;
        }
        points.retain_bodies(|body| deck.begins_present(&deck.bodies[body].name));
        let acts = |name: &str| {
            deck.is_there_at_start(name, StageDeck::conditions_set, StageDeck::conditions_released)
        };
        model.present.is_released = deck.boundary_conditions.iter().map(|c| !acts(&c.name)).collect();
        let stands = Factors {
            loads: deck.loads.iter().map(|load| initial_factor(deck, load)).collect(),
            boundary_conditions: vec![0.0; model.boundary_conditions.len()],
        };
        model.begin_stage(0, &stands);
    }

    /// How the factors of all loads, and of all boundary conditions, vary over a stage.
    fn courses_of(&self, stage: &StageDeck) -> (Vec<Course>, Vec<Course>) {
        let course = |name: &str, has_curve: bool| match stage.factors.get(name) {
            Some(factor) => Course::Reaches(*factor),
            None if has_curve => Course::Own,
            None => Course::Stays,
        };
        let load_course = |load: &LoadDeck| course(load.name(), load.follows_time());
        let loads = self.deck.loads.iter().map(load_course).collect();
        let conditions = self.deck.boundary_conditions.iter().map(|c| course(&c.name, c.curve.is_some()));
        (loads, conditions.collect())
    }
}
