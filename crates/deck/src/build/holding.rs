//! Bodies that no boundary condition holds, at the start or from a later stage on.

use std::collections::BTreeSet;

use mpm_core::basis::Connectivity;
use mpm_core::dofs::DofMap;
use mpm_core::dofs::rigid::{FreePart, free_parts};
use mpm_core::model::{Action, Course, Model, Pressure};
use mpm_core::points::{Points, coordinates};
use mpm_core::solver::added_points;

use crate::AXES;
use crate::diagnostic::Severity;
use crate::first_step::Check;
use crate::quoting::{either, list, quote};

/// Largest number of parts of the bodies that are reported.
const MAX_PARTS: usize = 20;

/// Free parts: the bodies in each, the axes along which it is free, and the number of other directions in which it is
/// free.
type Free = BTreeSet<(Vec<u16>, Vec<usize>, usize)>;

/// A stage after the first.
#[derive(Clone, Copy)]
pub(crate) struct LaterStage<'a> {
    number: usize,
    /// The parts that were free before it, which are not reported again.
    known: &'a Free,
}

impl Check<'_> {
    /// Reports the parts of the bodies that nothing holds, at the start or in a later stage; returns all of them.
    pub(crate) fn free_parts<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        dofs: &DofMap<D>,
        later: Option<LaterStage>,
    ) -> Free {
        // Only the stiffness shows whether surrounding water, or a tool or body that touches a body, holds the body.
        let touches = |body: &u16| {
            let body = usize::from(*body);
            model.tools.iter().any(|tool| tool.interface_with(body).is_some())
                || model
                    .contacts
                    .iter()
                    .any(|contact| contact.bodies.contains(&body) && contact.interface.is_some())
        };
        let floats = |body: &u16| {
            touches(body)
                || model.loads.iter().any(|load| match &load.action {
                    Action::Pressure { surface, pressure: Pressure::Hydrostatic { .. } } => {
                        model.surfaces[*surface].body == *body as usize
                    }
                    _ => false,
                })
        };
        // What has inertia needs no support.
        let stepping = match later.and_then(|stage| model.stages.get(stage.number)) {
            Some(stage) => &stage.stepping,
            None => &model.stepping,
        };
        if stepping.dynamics.is_some() {
            return Free::new();
        }
        let mut parts = free_parts(model, points, links, dofs);
        parts.retain(|part| !part.bodies.iter().any(floats));
        let key = |part: &FreePart<D>| (part.bodies.clone(), part.axes.clone(), part.directions.len());
        let is_new = |part: &&FreePart<D>| later.is_none_or(|stage| !stage.known.contains(&key(part)));
        for part in parts.iter().filter(is_new).take(MAX_PARTS) {
            self.free_part(model, part, later.map(|stage| stage.number));
        }
        parts.iter().map(key).collect()
    }

    /// Reports bodies that are free from a later stage on, judged with the points at their original positions: only the
    /// run can tell what happens once a prescribed motion has carried the points elsewhere.
    pub(crate) fn held_in_stages<const D: usize>(
        &mut self,
        model: &mut Model<D>,
        points: &Points<D>,
        mut known: Free,
    ) {
        let moves = |stage: usize| {
            model.boundary_conditions.iter().zip(&model.stages[stage].boundary_conditions).any(
                |(condition, course)| {
                    condition.moves() && !matches!(course, Course::Stays | Course::Reaches(0.0))
                },
            )
        };
        let n = (1..model.stages.len()).take_while(|number| !moves(number - 1)).count();
        let methods = model.methods();
        let before = model.present.clone();
        let mut points = points.clone();
        for number in 1..=n {
            let stage = &model.stages[number];
            points.retain_bodies(|body| !stage.removed.contains(&body));
            let added = added_points(model, &points, number);
            points.append(&added);
            model.present.change_conditions(model.boundary_conditions.len(), &model.stages[number]);
            let links = Connectivity::default().with_body_groups(&model.body_groups.of_body);
            let Ok(links) = links.renew(model.grid.as_ref(), &mut points, &methods) else { break };
            let start = model.stages[number].stepping.start_time;
            let dofs = DofMap::new(model, &points, &links, start, start);
            if points.ranks.any(dofs.is_err()) {
                break;
            }
            let Ok(dofs) = dofs else { break };
            let stage = LaterStage { number, known: &known };
            known = self.free_parts(model, &points, &links, &dofs, Some(stage));
        }
        model.present = before;
    }

    /// Reports a part that is free, from a stage on if one is given.
    fn free_part<const D: usize>(&mut self, model: &Model<D>, part: &FreePart<D>, stage: Option<usize>) {
        let names = part.bodies.iter().map(|&body| model.bodies[body as usize].name.as_str());
        let bodies = match (part.bodies.len(), part.whole) {
            (1, true) => format!("the body {}", list(names)),
            (1, false) => format!("a part of the body {}", list(names)),
            (_, true) => format!("the bodies {}, which share cells of the grid,", list(names)),
            (_, false) => format!("a part of the bodies {}, which share cells of the grid,", list(names)),
        };
        let first = part.bodies.first().copied().unwrap_or(0);
        let (pointer, when) = match stage {
            None => (format!("/bodies/{first}"), String::new()),
            Some(stage) => {
                (format!("/stages/{stage}"), format!("in the stage {}, ", quote(&model.stages[stage].name)))
            }
        };
        let place = if part.whole {
            String::new()
        } else {
            format!(" (the part with the node {})", coordinates(&part.node))
        };
        let found = if part.axes.is_empty() && part.directions.is_empty() {
            let about = match &part.centre {
                Some(centre) => format!(" about {}", coordinates(centre)),
                None if D > 2 => String::new(),
                None => " about a point".to_owned(),
            };
            let message =
                format!("{when}no boundary condition prevents {bodies}{place} from rotating{about}");
            let help = if D > 2 {
                "fix it at three nodes that are not on one line, along more than one axis"
            } else {
                "fix it along one axis at two nodes that are apart along the other"
            };
            self.at("D035", &pointer, message).severity(Severity::Warning).help(help)
        } else {
            let axes = part.axes.iter().map(|&axis| AXES[axis % 3].to_owned());
            let directions =
                part.directions.iter().map(|along| format!("the direction {}", coordinates(along)));
            let along: Vec<String> = axes.chain(directions).collect();
            let turning = if part.rotations > 0 { ", or against rotation" } else { "" };
            let message = format!(
                "{when}no boundary condition holds {bodies}{place} along {}{turning}",
                either(&along)
            );
            let which = match (along.len(), part.directions.is_empty()) {
                (1, true) => "that axis",
                (1, false) => "that direction",
                (_, true) => "these axes",
                (_, false) => "these directions",
            };
            let further = if part.rotations > 0 { ", and at further nodes to prevent rotation" } else { "" };
            let help = format!(
                "fix or prescribe the displacement along {which} at one or more nodes of each separate part{further}"
            );
            self.at("D035", &pointer, message).help(help)
        };
        self.found.push(found);
    }
}
