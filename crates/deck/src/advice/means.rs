//! The properties of a deck that decide which advice applies to its runs.

use crate::check::{names_in, validate};
use crate::source::Source;
use crate::{AXES, BoundaryConditionDeck, ControlDeck, Deck, GridDeck, Method};

/// The properties of a deck that decide which advice applies to its runs. By default, the deck is unknown, and advice
/// is general.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Means {
    /// True if the deck is known.
    pub(super) is_known: bool,
    /// Methods of the bodies.
    pub(super) methods: Vec<Method>,
    /// Conditions that move nodes of a structured grid, and that grid lines could follow but do not: name, and axis of
    /// the motion.
    pub(super) could_be_followed: Vec<(String, &'static str)>,
    /// True if the deck remains valid with arc-length control.
    pub(super) can_follow_path: bool,
    /// Names of materials in use that have no cohesion.
    pub(super) cohesionless: Vec<String>,
}

impl Means {
    /// The properties of a deck without errors.
    pub fn new(deck: &Deck) -> Means {
        Means {
            is_known: true,
            methods: deck.bodies.iter().map(|body| body.method).collect(),
            could_be_followed: could_be_followed(deck),
            can_follow_path: can_follow_path(deck),
            cohesionless: cohesionless(deck),
        }
    }
}

fn could_be_followed(deck: &Deck) -> Vec<(String, &'static str)> {
    let GridDeck::Structured { follow, .. } = &deck.grid else { return Vec::new() };
    let is_prescribed = |control: &ControlDeck| {
        !matches!(control, ControlDeck::Displacement { .. } | ControlDeck::ArcLength { .. })
    };
    if !deck.courses().iter().all(|(_, steps)| is_prescribed(&steps.control)) {
        return Vec::new();
    }
    let is_followed = |name: &str| follow.iter().any(|lines| lines.condition == name);
    let conditions = deck.boundary_conditions.iter().filter(|condition| !is_followed(&condition.name));
    conditions.filter_map(|condition| Some((condition.name.clone(), axis_of_motion(condition)?))).collect()
}

/// The axis along which a condition moves nodes selected by position, all by the same displacement; `None` for any
/// other condition.
fn axis_of_motion(condition: &BoundaryConditionDeck) -> Option<&'static str> {
    condition.nodes.as_ref().filter(|nodes| nodes.outer_layer.is_none())?;
    let displacements = condition.displacements();
    let mut moving = displacements.iter().filter(|displacement| !displacement.value.is_zero());
    let (Some(only), None) = (moving.next(), moving.next()) else { return None };
    let given = [only.value].into_iter().chain(condition.intermediate.values());
    let formulas: Vec<String> = given.filter_map(|given| given.as_formula().map(str::to_owned)).collect();
    let is_coordinate = |name: &&str| AXES.contains(&name.to_ascii_lowercase().as_str());
    let is_uniform = !names_in(&formulas).iter().any(is_coordinate);
    AXES.into_iter().find(|axis| only.key == format!("u{axis}")).filter(|_| is_uniform)
}

/// True if the deck, or the last stage of it that prescribes the load factor, may have arc-length control instead.
fn can_follow_path(deck: &Deck) -> bool {
    let mut other = deck.clone();
    let stages = other.stages.iter_mut().map(|stage| &mut stage.steps);
    let mut courses = stages.chain(other.steps.as_mut()).rev();
    let Some(last) = courses.find(|steps| matches!(steps.control, ControlDeck::Load {})) else {
        return false;
    };
    last.control = ControlDeck::ArcLength { length: None };
    !validate(&other, &Source::without_text("")).iter().any(crate::diagnostic::Diagnostic::is_error)
}

fn cohesionless(deck: &Deck) -> Vec<String> {
    let used = deck.used_materials();
    let materials = deck.materials.iter().filter(|(name, _)| used.contains(name.as_str()));
    let has_none = materials.filter(|(_, material)| {
        material.properties().into_iter().any(|(key, given)| key == "cohesion" && given.is_zero())
    });
    has_none.map(|(name, _)| name.clone()).collect()
}
