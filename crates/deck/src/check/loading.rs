//! Boundary conditions, loads, their formulas and curves.

use std::collections::BTreeMap;

use super::Check;
use crate::diagnostic::{Diagnostic, Excerpt, Severity};
use crate::formulas::{Displacement, Fault, at_nodes, at_places, at_points};
use crate::gates::Checks;
use crate::quoting::quote;
use crate::references::Noun;
use crate::shape::written_number;
use crate::{AXES, Expression, LoadCurve, LoadDeck, NodeSelector};

impl Checks for Check<'_> {
    fn dimensions(&self) -> usize {
        self.dimensions()
    }

    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: &str) {
        self.error(code, pointer, message, help);
    }

    fn error_at_key(&mut self, code: &'static str, pointer: &str, message: String, help: &str) {
        self.found.push(Diagnostic::at_key(self.source, code, pointer, message).help(help));
    }

    fn wrong_dimension(&mut self, pointer: &str, what: &str, dimensions: usize) {
        self.wrong_dimension(pointer, what, dimensions);
    }

    fn vector(&mut self, pointer: &str, components: &[f64]) -> Option<Vec<f64>> {
        self.vector(pointer, components)
    }

    fn wrong_count(&mut self, pointer: &str, found: usize) {
        self.wrong_count(pointer, found);
    }

    fn body(&mut self, pointer: &str, name: &str) {
        self.body(pointer, name);
    }

    fn targets(&mut self, pointer: &str, bodies: Option<&[String]>) {
        self.targets(pointer, bodies);
    }

    fn weight(&mut self, pointer: &str, load: &str, bodies: Option<&[String]>) {
        self.weight(pointer, load, bodies);
    }

    fn surface(&mut self, pointer: &str, name: &str) {
        let surfaces = &self.deck.surfaces;
        if !surfaces.iter().any(|surface| surface.name == name) {
            let names = surfaces.iter().map(|surface| surface.name.as_str()).collect();
            self.unknown_reference(pointer, Noun::new("surface", "surfaces"), name, names);
        }
    }

    fn formulas_at_places(
        &mut self,
        pointer: &str,
        key: &str,
        components: &[Expression],
        is_scalar: bool,
        intermediate: &BTreeMap<String, Expression>,
    ) {
        let parameters = &self.deck.parameters;
        let faults = match (self.dimensions(), is_scalar) {
            (3, true) => at_places::<3, 1>(key, components, intermediate, parameters).err(),
            (_, true) => at_places::<2, 1>(key, components, intermediate, parameters).err(),
            (3, false) => at_places::<3, 3>(key, components, intermediate, parameters).err(),
            (_, false) => at_places::<2, 2>(key, components, intermediate, parameters).err(),
        };
        self.formulas(pointer, faults.unwrap_or_default());
    }

    fn formulas_at_points(
        &mut self,
        pointer: &str,
        force: &[Expression],
        intermediate: &BTreeMap<String, Expression>,
    ) {
        let parameters = &self.deck.parameters;
        let faults = match self.dimensions() {
            3 => at_points::<3>(force, intermediate, parameters).err(),
            _ => at_points::<2>(force, intermediate, parameters).err(),
        };
        self.formulas(pointer, faults.unwrap_or_default());
    }

    fn formulas_at_nodes(
        &mut self,
        pointer: &str,
        displacements: Vec<Displacement>,
        intermediate: &BTreeMap<String, Expression>,
    ) {
        let faults = at_nodes(displacements, intermediate, &self.deck.parameters, self.dimensions()).err();
        self.formulas(pointer, faults.unwrap_or_default());
    }
}

impl Check<'_> {
    pub(super) fn boundary_conditions(&mut self) {
        let conditions = &self.deck.boundary_conditions;
        self.unique_names("/boundary_conditions", conditions.iter().map(|condition| condition.name.as_str()));
        for (index, condition) in conditions.iter().enumerate() {
            let pointer = format!("/boundary_conditions/{index}");
            self.column_name(&format!("{pointer}/name"), &condition.name);
            if let Some(nodes) = &condition.nodes {
                self.nodes(&format!("{pointer}/nodes"), nodes);
            }
            condition.check(self, &pointer);
            let repeated = conditions[..index].iter().find(|earlier| condition.repeats(earlier));
            if let (Some(earlier), true) = (repeated, self.deck.stages.is_empty()) {
                let message = format!(
                    "the boundary conditions {} and {} both prescribe the displacement of the surface {} in the same direction",
                    quote(&earlier.name),
                    quote(&condition.name),
                    quote(condition.surface.as_deref().unwrap_or_default())
                );
                self.error("D042", &pointer, message, "remove it from one of the two");
            }
            self.curve(&format!("{pointer}/curve"), condition.curve.as_ref());
        }
    }

    fn nodes(&mut self, pointer: &str, nodes: &NodeSelector) {
        let by_place = nodes.coordinates().iter().any(Option::is_some);
        let kinds = [by_place, nodes.within.is_some(), nodes.group.is_some(), nodes.outer_layer.is_some()];
        let given = kinds.iter().filter(|given| **given).count();
        if given != 1 {
            let message = if given == 0 {
                "no nodes are selected here"
            } else {
                "nodes are selected in more than one way here"
            };
            let help = "give exactly one of: coordinates (`x`, `y` and, in space, `z`), `box`, `group`, `outer_layer`";
            self.error("D019", pointer, message, help);
        }
        if nodes.z.is_some() && self.dimensions() < 3 {
            self.wrong_dimension(&format!("{pointer}/z"), "the coordinate z", 3);
        }
        if let Some(within) = &nodes.within {
            // A flat box may select nodes; an inverted one cannot.
            self.ordered(&format!("{pointer}/box"), &within.min, &within.max);
        }
        if let Some(name) = &nodes.outer_layer {
            self.body(&format!("{pointer}/outer_layer"), name);
        }
    }

    pub(super) fn ordered(&mut self, pointer: &str, min: &[f64], max: &[f64]) {
        let low = self.vector(&format!("{pointer}/min"), min);
        let high = self.vector(&format!("{pointer}/max"), max);
        let (Some(min), Some(max)) = (low, high) else { return };
        for axis in 0..min.len() {
            if min[axis] > max[axis] {
                let message = format!("the min {} of the box is above its max {}", min[axis], max[axis]);
                let help = format!(
                    "swap the two, or make both {} for a box without extent along {}",
                    min[axis], AXES[axis]
                );
                self.error("D016", &format!("{pointer}/max/{axis}"), message, help);
            }
        }
    }

    pub(super) fn formulas(&mut self, pointer: &str, faults: Vec<Fault>) {
        for fault in faults {
            let at = format!("{pointer}/{}", fault.key);
            let part = Excerpt { text: &fault.text, offset: fault.error.offset, length: fault.error.length };
            let mut diagnostic = Diagnostic::inside(self.source, "D021", &at, part, fault.error.message);
            // A fault of the name of an intermediate value is in no part of its formula.
            let as_number = if fault.error.length > 0 { written_number(&fault.text, true) } else { None };
            diagnostic.help = as_number.or(fault.error.help);
            self.found.push(diagnostic);
        }
    }

    pub(super) fn curve(&mut self, pointer: &str, curve: Option<&LoadCurve>) {
        let Some(LoadCurve(pairs)) = curve else { return };
        // Sorted, the pairs may be a curve without further faults.
        let mut sorted: Vec<(usize, [f64; 2])> = pairs.iter().copied().enumerate().collect();
        sorted.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
        let unsorted = pairs.windows(2).position(|pair| pair[1][0] < pair[0][0]);
        if let Some(index) = unsorted {
            let [before, after] = [pairs[index][0], pairs[index + 1][0]];
            let message = format!("the times of a load curve must increase; {after} follows {before}");
            let help = format!("sort the pairs by time, or give a time above {before}");
            self.error("D022", &format!("{pointer}/{}/0", index + 1), message, help);
        }
        for pair in sorted.windows(2) {
            let [(_, [time, _]), (index, [next, _])] = [pair[0], pair[1]];
            if next == time {
                let message = format!("the times of a load curve must increase; {next} follows {time}");
                let help = format!("give a time above {time}, or remove the pair");
                self.error("D022", &format!("{pointer}/{index}/0"), message, help);
            }
        }
        let end_time = self.deck.end_time();
        if let Some((index, [first, _])) = sorted.first()
            && *first > 0.0
        {
            let message = format!("the load curve starts at time {first}; it must cover time 0");
            self.error("D022", &format!("{pointer}/{index}/0"), message, "add the pair `[0, 0]` before it");
        }
        if let Some((index, [last, factor])) = sorted.last()
            && *last < end_time
        {
            let message =
                format!("the load curve ends at time {last}, but the analysis ends at time {end_time}");
            let help = format!("add a pair at time {end_time}, such as `[{end_time}, {factor}]`");
            self.error("D022", &format!("{pointer}/{index}/0"), message, help);
        }
    }

    pub(super) fn loads(&mut self) {
        let loads = &self.deck.loads;
        self.unique_names("/loads", loads.iter().map(LoadDeck::name));
        for (index, load) in loads.iter().enumerate() {
            let pointer = format!("/loads/{index}");
            self.column_name(&format!("{pointer}/name"), load.name());
            load.check(self, &pointer);
            self.curve(&format!("{pointer}/curve"), load.curve());
        }
    }

    fn targets(&mut self, pointer: &str, bodies: Option<&[String]>) {
        let Some(bodies) = bodies else { return };
        if bodies.is_empty() {
            let help = "remove `bodies` to let the load act on all of them";
            self.error("D015", pointer, "this load acts on no body", help);
        }
        for (index, name) in bodies.iter().enumerate() {
            let at = format!("{pointer}/{index}");
            self.body(&at, name);
            if bodies[..index.min(1000)].contains(name) {
                self.error(
                    "D017",
                    &at,
                    format!("the body {} is listed twice", quote(name)),
                    "remove one of the two",
                );
            }
        }
    }

    /// Checks the density of every body on which gravity or a force per mass acts.
    fn weight(&mut self, pointer: &str, load: &str, bodies: Option<&[String]>) {
        for (index, body) in self.deck.bodies.iter().enumerate() {
            let is_target = bodies.is_none_or(|names| names.contains(&body.name));
            let Some(material) = self.deck.materials.get(&body.material).filter(|_| is_target) else {
                continue;
            };
            let at = format!("/bodies/{index}/material");
            let (load, body, material_name) = (quote(load), quote(&body.name), quote(&body.material));
            match material.density() {
                None => {
                    let message = format!(
                        "the load {load} needs the density of the body {body}, but its material {material_name} has none"
                    );
                    let help = format!("add `density` to the material {material_name}");
                    self.error("D024", &at, message, help);
                }
                Some(Expression::Number(0.0)) => {
                    let message =
                        format!("the load {load} has no effect on the body {body}, whose density is 0");
                    let diagnostic = Diagnostic::at(self.source, "D024", pointer, message);
                    let help = format!("give the material {material_name} a `density` above 0");
                    self.found.push(diagnostic.severity(Severity::Warning).help(help));
                }
                Some(_) => {}
            }
        }
    }
}
