//! What contact points touch: a rigid body that moves as a whole, or sides that move with the nodes.

use crate::model::{BodyContact, ContactControl, Interface, Model, Tool};

/// What a contact point may touch, by its number: tools first, then pairs of bodies.
#[derive(Clone, Copy)]
pub(super) enum Counterpart<'a, const D: usize> {
    Tool(&'a Tool<D>),
    Bodies(&'a BodyContact),
}

impl<'a, const D: usize> Counterpart<'a, D> {
    /// All counterparts of a model, in the order of their numbers.
    pub(super) fn all(model: &'a Model<D>) -> impl Iterator<Item = Self> {
        let pairs = model.contacts.iter().map(Counterpart::Bodies);
        model.tools.iter().map(Counterpart::Tool).chain(pairs)
    }

    /// The counterpart with this number.
    pub(super) fn new(model: &'a Model<D>, number: u32) -> Self {
        match model.tools.get(number as usize) {
            Some(tool) => Counterpart::Tool(tool),
            None => Counterpart::Bodies(&model.contacts[number as usize - model.tools.len()]),
        }
    }

    /// The interface with a body; `None` if there is no contact with it.
    pub(super) fn interface_with(&self, body: usize) -> Option<Interface> {
        match self {
            Counterpart::Tool(tool) => tool.interface_with(body),
            Counterpart::Bodies(pair) => pair.interface.filter(|_| pair.bodies.contains(&body)),
        }
    }

    pub(super) fn control(&self) -> &'a ContactControl {
        match self {
            Counterpart::Tool(tool) => &tool.control,
            Counterpart::Bodies(pair) => &pair.control,
        }
    }

    /// True if a shear stress can act.
    pub(super) fn resists_sliding(&self) -> bool {
        match self {
            Counterpart::Tool(tool) => tool.resists_sliding(),
            Counterpart::Bodies(pair) => pair.interface.is_some_and(|interface| interface.resists_sliding()),
        }
    }

    /// What a body touches, as named in an error.
    pub(super) fn name(&self, model: &Model<D>, body: usize) -> String {
        match self {
            Counterpart::Tool(tool) => format!("tool `{}`", tool.name),
            Counterpart::Bodies(pair) => {
                let other = if pair.bodies[0] == body { pair.bodies[1] } else { pair.bodies[0] };
                format!("body `{}`", model.bodies[other].name)
            }
        }
    }
}
