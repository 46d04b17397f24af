//! Checks of the surfaces of a deck.

use super::Check;
use crate::{HalfSpaceDeck, PartDeck};

impl Check<'_> {
    /// Checks the surfaces.
    pub(super) fn surfaces(&mut self) {
        let surfaces = &self.deck.surfaces;
        self.unique_names("/surfaces", surfaces.iter().map(|surface| surface.name.as_str()));
        for (index, surface) in surfaces.iter().enumerate() {
            let pointer = format!("/surfaces/{index}");
            self.body(&format!("{pointer}/body"), &surface.body);
            if let Some(part) = &surface.part {
                self.part_of_surface(&format!("{pointer}/part"), part);
            }
        }
    }

    fn part_of_surface(&mut self, pointer: &str, part: &PartDeck) {
        let given =
            [part.within.is_some(), part.half_space.is_some(), part.edge.is_some(), part.group.is_some()];
        if given.iter().filter(|given| **given).count() != 1 {
            let message = "a part of a surface must be selected in exactly one way";
            self.error("D019", pointer, message, "give exactly one of: `box`, `half_space`, `edge`, `group`");
        }
        if let Some(within) = &part.within {
            self.ordered(&format!("{pointer}/box"), &within.min, &within.max);
        }
        if let Some(HalfSpaceDeck { point, normal }) = &part.half_space {
            self.vector(&format!("{pointer}/half_space/point"), point);
            self.direction(&format!("{pointer}/half_space/normal"), normal);
        }
    }

    /// Checks a direction.
    pub(super) fn direction(&mut self, pointer: &str, direction: &[f64]) {
        if self.vector(pointer, direction).is_some() && direction.iter().all(|n| *n == 0.0) {
            self.error(
                "D016",
                pointer,
                "a direction must not be the zero vector",
                "give a vector other than zero",
            );
        }
    }
}
