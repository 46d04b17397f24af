//! Checks of the tools of a deck.

use std::collections::BTreeMap;

use super::Check;
use crate::diagnostic::Diagnostic;
use crate::formulas::at_time;
use crate::quoting::{list, quote};
use crate::tools::{FreeDeck, RotationDeck, ToolDeck, ToolShape, Turn};
use crate::{Idealisation, ToolLoadDeck};

impl Check<'_> {
    /// Checks the tools.
    pub(super) fn tools(&mut self) {
        let tools = &self.deck.tools;
        self.unique_names("/tools", tools.iter().map(|tool| tool.name.as_str()));
        for (index, tool) in tools.iter().enumerate() {
            let pointer = format!("/tools/{index}");
            self.column_name(&format!("{pointer}/name"), &tool.name);
            self.shape_of_tool(&format!("{pointer}/shape"), &tool.shape);
            if let Some(reference) = &tool.reference {
                self.vector(&format!("{pointer}/reference"), reference);
            }
            if let Some(turned) = &tool.turned {
                self.turn(&format!("{pointer}/turned"), turned);
            }
            self.motion_of_tool(&pointer, tool);
            self.loads_of_tool(&pointer, tool);
            self.interfaces_of_tool(&pointer, tool);
            self.parts_of_tool(&pointer, tool);
            self.curve(&format!("{pointer}/curve"), tool.curve.as_ref());
            if tool.curve.is_some() && tool.motion().is_empty() {
                let message =
                    format!("`curve` needs a prescribed motion, but the tool {} has none", quote(&tool.name));
                let help = "remove it; weight and loads have curves of their own";
                self.error("D068", &format!("{pointer}/curve"), message, help);
            }
        }
        self.columns_of_tools();
    }

    fn shape_of_tool(&mut self, pointer: &str, shape: &ToolShape) {
        if let Some(needed) = shape.dimensions().filter(|needed| *needed != self.dimensions()) {
            let what = format!("a tool of type `{}`", shape.word());
            self.wrong_dimension(&format!("{pointer}/type"), &what, needed);
            return;
        }
        for (key, vector) in shape.vectors() {
            let at = format!("{pointer}/{key}");
            if key == "normal" || key == "direction" {
                self.direction(&at, vector);
            } else {
                self.vector(&at, vector);
            }
        }
        let corners = match shape {
            ToolShape::Polygon { vertices } | ToolShape::Polyline { vertices, .. } => {
                Some(("vertices", vertices))
            }
            ToolShape::Revolution { section, .. } => Some(("section", section)),
            ToolShape::Extrusion { polygon, .. } => Some(("polygon", polygon)),
            _ => None,
        };
        if let Some((key, corners)) = corners {
            for (number, corner) in corners.iter().enumerate().filter(|(_, corner)| corner.len() != 2) {
                let message = format!("a corner has 2 coordinates, not {}", corner.len());
                self.error("D015", &format!("{pointer}/{key}/{number}"), message, "give two");
            }
        }
    }

    /// Checks that a rotation or a moment suits the number of dimensions.
    fn turn(&mut self, pointer: &str, turn: &Turn) {
        self.rotation(pointer, matches!(turn, Turn::Angle(_)));
    }

    fn rotation(&mut self, pointer: &str, is_angle: bool) {
        let (found, expected) = match (self.dimensions(), is_angle) {
            (3, true) => ("a single value", "a list of three, about x, y and z"),
            (2, false) => ("a list", "one number, counter-clockwise"),
            _ => return,
        };
        let message = format!("expected {expected}, found {found}");
        let help = if is_angle { "give a vector: its direction is the axis" } else { "give a number" };
        let found = Diagnostic::at(self.source, "D015", pointer, message).expected(expected.to_owned());
        self.found.push(found.help(help));
    }

    fn motion_of_tool(&mut self, pointer: &str, tool: &ToolDeck) {
        let dimensions = self.dimensions();
        if let Some(rotation) = &tool.rotation {
            self.rotation(&format!("{pointer}/rotation"), !matches!(rotation, RotationDeck::Vector(_)));
        }
        let motion = tool.motion();
        if tool.uz.is_some() && dimensions < 3 {
            self.wrong_dimension(&format!("{pointer}/uz"), "the displacement `uz`", 3);
        }
        for (key, _, value) in &motion {
            if let Err(fault) = at_time(value, &self.deck.parameters) {
                let faults = vec![crate::formulas::Fault { key: key.clone(), ..fault }];
                self.formulas(pointer, faults);
            }
        }
        for (index, component) in tool.free.iter().enumerate() {
            let at = format!("{pointer}/free/{index}");
            let word = component.word();
            let prescribed = motion.iter().find(|(_, other, _)| other == component);
            if !component.exists(dimensions) {
                self.component_of_other_dimension(&at, *component);
            } else if tool.free[..index].contains(component) {
                self.error(
                    "D068",
                    &at,
                    format!("`{word}` is listed twice in `free`"),
                    "remove one of the two",
                );
            } else if let Some((key, _, _)) = prescribed {
                let message = format!(
                    "the component `{word}` of the tool {} is both free and prescribed",
                    quote(&tool.name)
                );
                self.error("D068", &at, message, format!("remove it from `free`, or remove `{key}`"));
            }
        }
        if self.deck.analysis.idealisation == Idealisation::Axisymmetric {
            self.along_the_axis(pointer, tool);
        }
    }

    fn component_of_other_dimension(&mut self, pointer: &str, component: FreeDeck) {
        if component == FreeDeck::Rotation {
            let message =
                "the component `rotation` exists in the plane only, but the idealisation is `solid`";
            let help = "use `rx`, `ry` or `rz` in space; `rotation` needs `idealisation: plane-strain`";
            self.error("D048", pointer, message, help);
        } else {
            self.wrong_dimension(pointer, &format!("the component `{}`", component.word()), 3);
        }
    }

    /// In axisymmetry, a tool moves along the axis only.
    fn along_the_axis(&mut self, pointer: &str, tool: &ToolDeck) {
        let help = "in axisymmetry, a tool moves along y only; use `idealisation: solid` for other motions";
        let moved = tool
            .motion()
            .into_iter()
            .filter(|(_, component, value)| *component != FreeDeck::Y && !value.is_zero());
        let moved = moved.map(|(key, component, _)| (format!("{pointer}/{key}"), component));
        let free = tool.free.iter().enumerate().filter(|(_, component)| **component != FreeDeck::Y);
        let free = free.map(|(index, component)| (format!("{pointer}/free/{index}"), *component));
        for (at, component) in moved.chain(free).collect::<Vec<_>>() {
            let motion = if component.is_rotation() {
                "rotate".to_owned()
            } else {
                format!("move along `{}`", component.word())
            };
            let message = format!("the tool {} cannot {motion}", quote(&tool.name));
            self.error("D068", &at, message, help);
        }
        if tool.shape.is_lopsided() {
            let message = format!(
                "the section of the tool {} is not symmetric about the axis x = 0",
                quote(&tool.name)
            );
            let help = "give the part at x ≥ 0, or a section that is symmetric about the axis";
            self.error("D068", &format!("{pointer}/shape"), message, help);
        }
        if tool.turned.is_some() {
            let message = "a body of revolution cannot be turned".to_owned();
            self.error("D068", &format!("{pointer}/turned"), message, help);
        }
    }

    fn loads_of_tool(&mut self, pointer: &str, tool: &ToolDeck) {
        let up = if self.dimensions() == 3 { FreeDeck::Z } else { FreeDeck::Y };
        let is_free = |component: FreeDeck| tool.free.contains(&component);
        if tool.weight.is_some() && !is_free(up) {
            let message = format!(
                "the weight of the tool {} has no effect: the tool is not free along `{}`",
                quote(&tool.name),
                up.word()
            );
            self.error(
                "D068",
                &format!("{pointer}/weight"),
                message,
                format!("add `free: [{}]`, or remove `weight`", up.word()),
            );
        }
        if tool.weight_curve.is_some() && tool.weight.is_none() {
            let message = "`weight_curve` needs a `weight`".to_owned();
            self.error(
                "D068",
                &format!("{pointer}/weight_curve"),
                message,
                "give `weight`, or remove `weight_curve`",
            );
        }
        self.curve(&format!("{pointer}/weight_curve"), tool.weight_curve.as_ref());
        for (index, load) in tool.loads.iter().enumerate() {
            self.load_of_tool(&format!("{pointer}/loads/{index}"), tool, load);
        }
    }

    fn load_of_tool(&mut self, pointer: &str, tool: &ToolDeck, load: &ToolLoadDeck) {
        use FreeDeck::{Rotation, Rx, Ry, Rz, X, Y, Z};
        let mut acting: Vec<FreeDeck> = Vec::new();
        if let Some(force) = &load.force {
            self.vector(&format!("{pointer}/force"), force);
            acting.extend(
                [X, Y, Z].into_iter().zip(force).filter(|(_, f)| **f != 0.0).map(|(component, _)| component),
            );
        }
        if let Some(moment) = &load.moment {
            self.turn(&format!("{pointer}/moment"), moment);
            match moment {
                Turn::Angle(moment) => acting.extend((*moment != 0.0).then_some(Rotation)),
                Turn::Vector(moment) => {
                    acting.extend(
                        [Rx, Ry, Rz]
                            .into_iter()
                            .zip(moment)
                            .filter(|(_, m)| **m != 0.0)
                            .map(|(component, _)| component),
                    );
                }
            }
        }
        self.curve(&format!("{pointer}/curve"), load.curve.as_ref());
        if load.force.is_none() && load.moment.is_none() {
            let message = "a load on a tool is a force, a moment, or both".to_owned();
            self.error("D019", pointer, message, "give `force`, `moment`, or both");
        } else if !acting.iter().any(|component| tool.free.contains(component)) {
            self.load_without_effect(pointer, tool, &acting);
        }
    }

    /// Reports a load that is zero or has only components along which the tool is not free.
    fn load_without_effect(&mut self, pointer: &str, tool: &ToolDeck, acting: &[FreeDeck]) {
        let words = list(acting.iter().map(|component| component.word()));
        let held = |are: &str| format!("{words} of the tool {} {are} not free", quote(&tool.name));
        let (reason, help) = match acting {
            [] => ("it is zero".to_owned(), "give a force or moment other than 0, or remove the load"),
            [_] => (held("is"), "add the component to `free`, or remove the load"),
            _ => (held("are"), "add at least one of these components to `free`, or remove the load"),
        };
        self.error("D068", pointer, format!("the load has no effect: {reason}"), help);
    }

    fn interfaces_of_tool(&mut self, pointer: &str, tool: &ToolDeck) {
        let mut first: BTreeMap<&str, usize> = BTreeMap::new();
        for (index, name) in tool.bodies.iter().flatten().enumerate() {
            let at = format!("{pointer}/bodies/{index}");
            self.body(&at, name);
            if tool.bodies.iter().any(|bodies| bodies[..index.min(1000)].contains(name)) {
                let message = format!("the body {} is listed twice", quote(name));
                self.error("D017", &at, message, "remove one of the two");
            }
        }
        if tool.bodies.as_ref().is_some_and(Vec::is_empty) {
            let help = "remove `bodies` to let the tool touch all of them";
            self.error("D015", &format!("{pointer}/bodies"), "this tool touches no body", help);
        }
        for (index, contact) in tool.contacts.iter().enumerate() {
            let at = format!("{pointer}/contacts/{index}/body");
            self.body(&at, &contact.body);
            let is_touched = tool.bodies.as_ref().is_none_or(|bodies| bodies.contains(&contact.body));
            if first.insert(&contact.body, index).is_some() {
                let message = format!("the interface with the body {} is given twice", quote(&contact.body));
                self.error("D017", &at, message, "remove one of the two");
            } else if !is_touched {
                let message = format!("the tool does not touch the body {}", quote(&contact.body));
                self.error("D068", &at, message, "add it to `bodies`, or remove this entry");
            }
        }
    }
}
