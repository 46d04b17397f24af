//! Grid lines that follow boundary conditions: what can be checked without the grid.

use super::Check;
use crate::references::Noun;
use crate::{AXES, ControlDeck, GridDeck};

impl Check<'_> {
    /// Checks the names in `follow`, and that load factors are known before each step.
    pub(super) fn follow(&mut self) {
        let deck = self.deck;
        let GridDeck::Structured { follow, .. } = &deck.grid else { return };
        for (number, lines) in follow.iter().enumerate() {
            let pointer = format!("/grid/follow/{number}");
            if lines.axis as usize >= self.dimensions() {
                let axis = format!("the axis `{}`", AXES[lines.axis as usize]);
                self.wrong_dimension(&format!("{pointer}/axis"), &axis, 3);
            }
            if !deck.boundary_conditions.iter().any(|condition| condition.name == lines.condition) {
                let names = deck.boundary_conditions.iter().map(|condition| condition.name.as_str());
                let kind = Noun::new("boundary condition", "boundary conditions");
                let at = format!("{pointer}/condition");
                self.unknown_reference(&at, kind, &lines.condition, names.collect());
            }
            if let Some(to) = lines.to.filter(|to| *to < lines.from) {
                let message =
                    format!("the last grid line, at {to}, is below the first one, at {}", lines.from);
                self.error("D054", &format!("{pointer}/to"), message, "swap the two");
            }
        }
        let courses = if follow.is_empty() { Vec::new() } else { deck.courses() };
        for (pointer, steps) in courses {
            if matches!(steps.control, ControlDeck::Displacement { .. } | ControlDeck::ArcLength { .. }) {
                let message = "the grid follows prescribed displacements, so the load factor must be known";
                let help = "remove `control`, or remove `follow` from the grid";
                self.error("D054", &format!("{pointer}/control"), message, help);
            }
        }
    }
}
