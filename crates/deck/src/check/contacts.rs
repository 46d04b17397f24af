//! Checks of the contact between the bodies of a deck.

use std::collections::HashSet;

use mpm_core::basis::Method;

use super::Check;
use crate::contacts::BodyContactDeck;
use crate::quoting::{list, quote};

impl Check<'_> {
    /// Checks the contacts between bodies, at the start and in all stages.
    pub(super) fn contacts(&mut self) {
        let deck = self.deck;
        self.list_of_contacts("/contacts", &deck.contacts);
        for (number, stage) in deck.stages.iter().enumerate() {
            self.list_of_contacts(&format!("/stages/{number}/contacts"), &stage.contacts);
            for (index, pair) in stage.remove_contacts.iter().enumerate() {
                let pointer = format!("/stages/{number}/remove_contacts/{index}");
                for (k, name) in pair.iter().enumerate() {
                    self.body(&format!("{pointer}/{k}"), name);
                }
                let before =
                    deck.stages[..number].iter().flat_map(|stage| &stage.contacts).chain(&deck.contacts);
                let is_given = |given: &BodyContactDeck| {
                    given.between.pair().is_none_or(|known| known.iter().all(|name| pair.contains(name)))
                };
                if !before.into_iter().any(is_given) {
                    let names = list(pair.iter().map(String::as_str));
                    let message = format!("there is no contact between {names} to remove");
                    self.error(
                        "D076",
                        &pointer,
                        message,
                        "remove the entry, or give the contact before this stage",
                    );
                }
            }
        }
        self.bodies_without_sides();
    }

    /// Checks a list of contacts.
    fn list_of_contacts(&mut self, at: &str, contacts: &[BodyContactDeck]) {
        let mut known = HashSet::new();
        for (index, contact) in contacts.iter().enumerate() {
            let pointer = format!("{at}/{index}/between");
            let pair: Vec<&str> = contact.between.pair().into_iter().flatten().map(String::as_str).collect();
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
    }

    /// Reports bodies of standard points that are in contact: such points have no sides.
    fn bodies_without_sides(&mut self) {
        let deck = self.deck;
        for (number, body) in deck.bodies.iter().enumerate().filter(|(_, body)| body.method == Method::Mpm) {
            let touches = |given: &BodyContactDeck| match given.between.pair() {
                Some(pair) => pair.contains(&body.name),
                None => deck.bodies.len() > 1,
            };
            let in_stages = deck.stages.iter().flat_map(|stage| &stage.contacts);
            if deck.contacts.iter().chain(in_stages).any(touches) {
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
