//! Unknowns of a term that belong to no node.

use crate::model::Model;

/// The global unknowns of a term, such as the motions of a rigid body; their increments start each step at 0.
pub trait GlobalUnknowns<const D: usize> {
    /// Number of global unknowns in the current step.
    fn count(&self) -> usize;

    /// The unknowns that are motions, by name. If the displacement of a tool determines the load, its unknown is found
    /// here, and if nothing resists the free ones, an error names them.
    fn motions(&self, _model: &Model<D>) -> Vec<GlobalMotion> {
        Vec::new()
    }
}

/// A component of a motion that is a global unknown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GlobalMotion {
    /// Number of the unknown among the global unknowns of its term.
    pub number: usize,
    /// Name of what moves: of a rigid tool of the model, or another name that no tool has.
    pub name: String,
    /// Number of the component of the motion: the translations along the axes, then the rotations about x, y and z.
    pub component: usize,
    /// True if equilibrium alone determines the motion; false if the motion follows from the load factor.
    pub is_free: bool,
}
