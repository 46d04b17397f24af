//! Builds the contact between the bodies of a deck.

use mpm_core::basis::Connectivity;
use mpm_core::model::{BodyContact, BodyGroups, ContactControl, Glued, Model};
use mpm_core::points::Points;
use mpm_core::region::Region;
use mpm_core::solver::added_points;

use super::Builder;
use super::tools::interface;
use crate::contacts::{Between, BodyContactDeck};
use crate::quoting::list;
use crate::region::DeckRegion;

/// Default of `overlap`, relative to the cell size, [-].
const OVERLAP: f64 = 1e-9;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The pairs of bodies in contact: those that are named, then all others if `between: all` is given.
    pub(super) fn contacts(&self) -> Vec<BodyContact> {
        let deck = self.deck;
        let mut contacts = Vec::new();
        for given in &deck.contacts {
            if let Between::Bodies(pair) = &given.between {
                contacts.push(contact([0, 1].map(|k| self.body_number(&pair[k])), given));
            }
        }
        let all = deck.contacts.iter().find(|given| matches!(given.between, Between::All(_)));
        let n = deck.bodies.len();
        for pair in all.iter().flat_map(|_| (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]))) {
            let is_named =
                |contact: &BodyContact| contact.bodies == pair || contact.bodies == [pair[1], pair[0]];
            if !contacts.iter().any(is_named) {
                contacts.extend(all.map(|given| contact(pair, given)));
            }
        }
        contacts
    }

    /// Divides the bodies into groups that share the unknowns of their nodes.
    pub(super) fn group_bodies(&mut self, model: &mut Model<D>, points: &Points<D>) {
        if model.contacts.is_empty() {
            return;
        }
        let mut all = points.clone();
        for stage in 0..model.stages.len() {
            let mut added = added_points(model, &all, stage);
            let known: Vec<u16> = all.body.clone();
            added.retain_bodies(|body| !known.contains(&(body as u16)));
            all.append(&added);
        }
        // A point that finds no place is reported when the first step is set up.
        let Ok(links) = Connectivity::new(model.grid.as_ref(), &mut all, &model.methods()) else { return };
        let joined: Vec<[usize; 2]> =
            links.joined_bodies(&all).into_iter().map(|pair| pair.map(usize::from)).collect();
        let pairs: Vec<[usize; 2]> = model.contacts.iter().map(|contact| contact.bodies).collect();
        match BodyGroups::new(model.bodies.len(), &pairs, &joined) {
            Ok(groups) => model.body_groups = groups,
            Err(Glued { bodies, together }) => {
                let name = |body: &usize| model.bodies[*body].name.as_str();
                let message = format!(
                    "the bodies {} are to be in contact, but they stick together through others: {} share grid nodes \
                     without contact between them",
                    list(bodies.iter().map(name)),
                    list(together.iter().map(name))
                );
                let help = "name the other pairs, too, or write `between: all`".to_owned();
                self.error("D076", "/contacts", message, help);
            }
        }
    }
}

fn contact(bodies: [usize; 2], given: &BodyContactDeck) -> BodyContact {
    let default = ContactControl::default();
    BodyContact {
        bodies,
        interface: interface(given.friction, given.adhesion, given.tension),
        control: ContactControl {
            penalty: given.penalty.unwrap_or(default.penalty),
            tolerance: given.overlap.unwrap_or(OVERLAP),
            ..default
        },
    }
}
