//! Checks of the contact between the bodies of a deck.

use std::collections::HashSet;

use mpm_core::basis::Method;

use super::Check;
use crate::contacts::Between;
use crate::quoting::{list, quote};

impl Check<'_> {
    /// Checks the contacts between bodies.
    pub(super) fn contacts(&mut self) {
        let deck = self.deck;
        let mut known = HashSet::new();
        for (index, contact) in deck.contacts.iter().enumerate() {
            let pointer = format!("/contacts/{index}/between");
            let pair: Vec<&str> = match &contact.between {
                Between::Bodies(pair) => pair.iter().map(String::as_str).collect(),
                Between::All(_) => Vec::new(),
            };
            for (number, name) in pair.iter().enumerate() {
                self.body(&format!("{pointer}/{number}"), name);
            }
            if let [a, b] = pair[..]
                && a == b
            {
                let message = format!("contact of the body {} with itself is not available", quote(a));
                self.error("D076", &pointer, message, "name two bodies");
            }
            let mut sorted = pair.clone();
            sorted.sort_unstable();
            if !known.insert(sorted) {
                let which =
                    if pair.is_empty() { "all bodies".to_owned() } else { list(pair.iter().copied()) };
                self.error(
                    "D076",
                    &pointer,
                    format!("contact between {which} is given twice"),
                    "remove one entry",
                );
            }
        }
        self.bodies_without_sides();
    }

    /// Reports bodies of standard points that are in contact: such points have no sides.
    fn bodies_without_sides(&mut self) {
        let deck = self.deck;
        for (number, body) in deck.bodies.iter().enumerate().filter(|(_, body)| body.method == Method::Mpm) {
            let touches = |between: &Between| match between {
                Between::Bodies(pair) => pair.contains(&body.name),
                Between::All(_) => deck.bodies.len() > 1,
            };
            if deck.contacts.iter().any(|contact| touches(&contact.between)) {
                let message = format!(
                    "the body {} consists of standard material points, which have no sides on which another body could \
                     bear",
                    quote(&body.name)
                );
                let help = "choose `method: cpdi2`, `cpdi1` or `gimp` for bodies in contact";
                self.error("D076", &format!("/bodies/{number}/method"), message, help);
            }
        }
    }
}
