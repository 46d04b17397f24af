//! Builds the tools of a deck.

use std::sync::Arc;

use mpm_core::formula::Formula;
use mpm_core::grid::Grid;
use mpm_core::model::{ContactControl, Freedom, Interface, Shear, Tool, ToolLoad, ToolPart};
use mpm_core::region::Region;
use mpm_core::tool::{Pose, Shape};

use super::Builder;
use crate::formulas::at_time;
use crate::loads::load_curve;
use crate::per_axis::array;
use crate::quoting::quote;
use crate::region::{DeckRegion, FromFiles, Groups};
use crate::span::escape;
use crate::tool_shapes::DeckTool;
use crate::tools::{ContactDeck, FreeDeck, FrictionDeck, ToolDeck, ToolPartDeck, ToolShape, Turn};
use crate::{Expression, Idealisation, Parameter};

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Builds all tools; those with a fault are left out.
    pub(super) fn tools(&mut self, grid: &dyn Grid<D>) -> Vec<Tool<D>> {
        let mut tools = Vec::new();
        for (index, deck) in self.loaded.deck.tools.iter().enumerate() {
            let at = format!("/tools/{index}");
            if let Some((shape, pose)) = self.placed(grid, deck, &at) {
                let tool = self.tool(deck, shape, pose);
                self.parts_of_tool(grid, &tool, &at);
                tools.push(tool);
            }
        }
        tools
    }

    /// The shape of a tool, and its pose at the start.
    fn placed(
        &mut self,
        grid: &dyn Grid<D>,
        deck: &ToolDeck,
        at: &str,
    ) -> Option<(Arc<dyn Shape<D>>, Pose<D>)> {
        let at = format!("{at}/shape");
        let triangles = match deck.shape.file() {
            None => Vec::new(),
            Some(file) => {
                let (directory, source) = (self.loaded.directory.as_path(), &self.loaded.source);
                let mut given =
                    FromFiles { grid, directory, source, groups: Groups::default(), found: Vec::new() };
                let layer = match &deck.shape {
                    ToolShape::Stl { thickness, scale, .. } => thickness.map(|t| t / scale.unwrap_or(1.0)),
                    _ => None,
                };
                let triangles = given.sides(&at, file, layer);
                self.found.extend(given.found);
                triangles?
            }
        };
        let revolved = self.loaded.deck.analysis.idealisation == Idealisation::Axisymmetric;
        let mut shape = |about: &[f64; D]| match Region::tool(&deck.shape, about, &triangles, revolved)? {
            Ok(shape) => Some(shape),
            Err(error) => {
                let message = format!("the shape of the tool {} is invalid: {error}", quote(&deck.name));
                self.error(
                    "D016",
                    &at,
                    message,
                    "change the numbers so that they enclose a region".to_owned(),
                );
                None
            }
        };
        let reference: [f64; D] = match (&deck.reference, &deck.shape) {
            (Some(reference), _) => array(reference),
            (None, ToolShape::HalfSpace { point, .. }) => array(point),
            (None, _) => {
                let [low, high] = shape(&[0.0; D])?.bounds();
                std::array::from_fn(|d| 0.5 * (low[d] + high[d]))
            }
        };
        let shape = shape(&reference)?;
        let turned = deck.turned.as_ref().map_or([0.0; 3], |turned| vector(turned).map(f64::to_radians));
        Some((shape, Pose::new(reference, turned).ok()?))
    }

    fn tool(&self, deck: &ToolDeck, shape: Arc<dyn Shape<D>>, pose: Pose<D>) -> Tool<D> {
        let end_time = self.deck.end_time();
        let freedom = |component: FreeDeck| {
            let given = deck.motion().into_iter().find(|(_, other, _)| *other == component);
            match given {
                _ if deck.free.contains(&component) => Freedom::Free,
                Some((_, _, value)) => {
                    Freedom::Prescribed(formula(component, &value, &self.loaded.parameters))
                }
                None => Freedom::fixed(),
            }
        };
        let about = if D == 3 { [FreeDeck::Rx, FreeDeck::Ry, FreeDeck::Rz] } else { [FreeDeck::Rotation; 3] };
        let interface = interface(deck.friction, deck.adhesion, deck.tension_cut_off);
        let is_touched = |name: &String| deck.bodies.as_ref().is_none_or(|bodies| bodies.contains(name));
        let mut pairs = Vec::new();
        for (number, body) in self.deck.bodies.iter().enumerate() {
            if !is_touched(&body.name) {
                pairs.push((number, None));
            } else if let Some(own) = deck.contacts.iter().find(|contact| contact.body == body.name) {
                pairs.push((number, Some(interface_of_pair(deck, own))));
            }
        }
        let default = ContactControl::default();
        Tool {
            name: deck.name.clone(),
            shape,
            pose,
            translation: std::array::from_fn(|d| freedom([FreeDeck::X, FreeDeck::Y, FreeDeck::Z][d])),
            // In the plane, only the last rotation counts.
            rotation: std::array::from_fn(|k| {
                if D == 3 || k == 2 { freedom(about[k]) } else { Freedom::fixed() }
            }),
            curve: load_curve(deck.curve.as_ref(), end_time),
            loads: self.loads_of_tool(deck),
            interface: Some(interface),
            pairs,
            control: ContactControl {
                penalty: deck.penalty.unwrap_or(default.penalty),
                tolerance: deck.overlap.unwrap_or(default.tolerance),
                ..default
            },
            parts: deck.parts.iter().map(|(name, part)| part_of_tool(name, part)).collect(),
        }
    }

    /// Reports named parts that contain none of the surface of a tool.
    fn parts_of_tool(&mut self, grid: &dyn Grid<D>, tool: &Tool<D>, at: &str) {
        let empty = tool.parts.iter().filter(|part| !tool.reaches_into(part, grid));
        for part in empty {
            let message = format!(
                "no surface of the tool {} lies in its part {}",
                quote(&tool.name),
                quote(&part.name)
            );
            let help = match (&part.sides, &part.bounds) {
                (Some(_), Some(_)) => "the `edges` do not reach into the `box`: change one of the two",
                (_, Some(_)) => {
                    "change the `box` so that it contains part of the surface in its position at the start of the analysis"
                }
                _ => "give edges that do not lie on the axis of revolution",
            };
            self.error("D069", &format!("{at}/parts/{}", escape(&part.name)), message, help.to_owned());
        }
    }

    fn loads_of_tool(&self, deck: &ToolDeck) -> Vec<ToolLoad<D>> {
        let end_time = self.deck.end_time();
        let weight = deck.weight.map(|weight| {
            let force = std::array::from_fn(|d| if d + 1 == D { -weight } else { 0.0 });
            ToolLoad { force, moment: [0.0; 3], curve: load_curve(deck.weight_curve.as_ref(), end_time) }
        });
        let others = deck.loads.iter().map(|load| ToolLoad {
            force: load.force.as_ref().map_or([0.0; D], |force| array(force)),
            moment: load.moment.as_ref().map_or([0.0; 3], vector),
            curve: load_curve(load.curve.as_ref(), end_time),
        });
        weight.into_iter().chain(others).collect()
    }
}

fn part_of_tool<const D: usize>(name: &str, deck: &ToolPartDeck) -> ToolPart<D> {
    ToolPart {
        name: name.to_owned(),
        sides: deck.edges.as_ref().map(|edges| edges.iter().map(|edge| *edge as usize).collect()),
        bounds: deck.within.as_ref().map(|within| [array(&within.min), array(&within.max)]),
    }
}

/// The formula of a prescribed component, [length] or [rad].
fn formula(
    component: FreeDeck,
    value: &Expression,
    parameters: &std::collections::BTreeMap<String, Parameter>,
) -> Formula {
    let is_rotation = component.is_rotation();
    let in_radians = match value {
        Expression::Number(degrees) if is_rotation => Expression::Number(degrees.to_radians()),
        Expression::Formula(text) if is_rotation => Expression::Formula(format!("({text}) * (pi / 180)")),
        other => other.clone(),
    };
    // Faults of the formula have already been reported.
    at_time(&in_radians, parameters).unwrap_or_else(|_| Formula::constant(0.0))
}

/// A rotation vector or a moment; in the plane, about z.
fn vector(turn: &Turn) -> [f64; 3] {
    match turn {
        Turn::Angle(angle) => [0.0, 0.0, *angle],
        Turn::Vector(vector) => array(vector),
    }
}

/// The interface between a tool and a body that has a contact entry of its own.
fn interface_of_pair(deck: &ToolDeck, own: &ContactDeck) -> Interface {
    interface(
        own.friction.or(deck.friction),
        own.adhesion.or(deck.adhesion),
        own.tension_cut_off.or(deck.tension_cut_off),
    )
}

pub(super) fn interface(
    friction: Option<FrictionDeck>,
    adhesion: Option<f64>,
    tension_cut_off: Option<f64>,
) -> Interface {
    let shear = match friction {
        Some(FrictionDeck::Sticking(_)) => Shear::Rough,
        Some(FrictionDeck::Coefficient(friction)) => {
            Shear::Coulomb { friction, adhesion: adhesion.unwrap_or(0.0) }
        }
        None => Shear::Coulomb { friction: 0.0, adhesion: adhesion.unwrap_or(0.0) },
    };
    Interface { shear, tension_cut_off: tension_cut_off.unwrap_or(0.0) }
}
