//! Builds the contact between the bodies of a deck.

use mpm_core::basis::Connectivity;
use mpm_core::model::{BodyContact, BodyGroups, ContactControl, Glued, Model};
use mpm_core::points::Points;
use mpm_core::region::Region;
use mpm_core::solver::added_points;

use super::Builder;
use super::tools::interface;
use crate::contacts::BodyContactDeck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::{list, quote};
use crate::region::DeckRegion;

/// Default of `overlap`, relative to the cell size, [-].
const OVERLAP: f64 = 1e-9;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// All pairs of bodies that are in contact in some stage, with the interfaces at the start.
    pub(super) fn contacts(&self) -> Vec<BodyContact> {
        let mut contacts = Vec::new();
        self.change_contacts(&mut contacts, &self.deck.contacts, &[]);
        for stage in &self.deck.stages {
            let mut later = contacts.clone();
            self.change_contacts(&mut later, &stage.contacts, &[]);
            contacts.extend(
                later.split_off(contacts.len()).into_iter().map(|new| BodyContact { interface: None, ..new }),
            );
        }
        contacts
    }

    /// Adds contacts to a list, or changes those that it has: named pairs first, then all others if `between: all` is
    /// given. The pairs `removed` stick together.
    fn change_contacts(
        &self,
        contacts: &mut Vec<BodyContact>,
        given: &[BodyContactDeck],
        removed: &[[String; 2]],
    ) {
        let n = self.deck.bodies.len();
        let numbers = |pair: &[String; 2]| [0, 1].map(|k| self.body_number(&pair[k]));
        let place = |contacts: &[BodyContact], [a, b]: [usize; 2]| {
            contacts.iter().position(|contact| contact.bodies == [a, b] || contact.bodies == [b, a])
        };
        let named: Vec<[usize; 2]> =
            given.iter().filter_map(|given| given.between.pair().map(numbers)).collect();
        for given in given {
            let pairs: Vec<[usize; 2]> = match given.between.pair() {
                Some(pair) => vec![numbers(pair)],
                None => {
                    let all = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
                    all.filter(|[a, b]| !named.contains(&[*a, *b]) && !named.contains(&[*b, *a])).collect()
                }
            };
            for pair in pairs {
                match place(contacts, pair) {
                    Some(known) => contacts[known] = contact(contacts[known].bodies, given),
                    None => contacts.push(contact(pair, given)),
                }
            }
        }
        for pair in removed {
            if let Some(known) = place(contacts, numbers(pair)) {
                contacts[known].interface = None;
            }
        }
    }

    /// Divides the bodies into groups that share the unknowns of their nodes, at the start and in each stage that changes
    /// contacts.
    pub(super) fn group_bodies(&mut self, model: &mut Model<D>, points: &Points<D>) {
        if model.contacts.is_empty() {
            return;
        }
        if !self.ranks.is_alone() {
            let message = "contact between bodies is not available on several ranks".to_owned();
            self.error(
                "D076",
                "/contacts",
                message,
                "run the deck without MPI, with several threads".to_owned(),
            );
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
        model.body_groups = self.groups(model, &model.contacts, &joined, "/contacts");
        let mut contacts = model.contacts.clone();
        for (number, stage) in self.deck.stages.iter().enumerate() {
            if stage.contacts.is_empty() && stage.remove_contacts.is_empty() {
                continue;
            }
            self.change_contacts(&mut contacts, &stage.contacts, &stage.remove_contacts);
            let groups = self.groups(model, &contacts, &joined, &format!("/stages/{number}/contacts"));
            model.stages[number].contacts = Some((contacts.clone(), groups));
        }
        // The first stage has begun.
        if let Some((contacts, groups)) = model.stages.first().and_then(|stage| stage.contacts.clone()) {
            (model.contacts, model.body_groups) = (contacts, groups);
        }
    }

    /// The groups of bodies with these contacts; all bodies in one group, and an error, if that contradicts them.
    fn groups(
        &mut self,
        model: &Model<D>,
        contacts: &[BodyContact],
        joined: &[[usize; 2]],
        pointer: &str,
    ) -> BodyGroups {
        let in_contact = contacts.iter().filter(|contact| contact.interface.is_some());
        let pairs: Vec<[usize; 2]> = in_contact.map(|contact| contact.bodies).collect();
        let Glued { bodies, together } = match BodyGroups::new(model.bodies.len(), &pairs, joined) {
            Ok(groups) => {
                self.numbered(model, &groups, pointer);
                self.passing(model, &groups, &pairs, pointer);
                return groups;
            }
            Err(glued) => glued,
        };
        let name = |body: &usize| model.bodies[*body].name.as_str();
        let message = format!(
            "the bodies {} are to be in contact, but they stick together through others: {} share grid nodes without \
             contact between them",
            list(bodies.iter().map(name)),
            list(together.iter().map(name))
        );
        let help = "name the other pairs, too, or write `between: all`".to_owned();
        self.error("D076", pointer, message, help);
        BodyGroups::default()
    }

    /// Refuses more copies of nodes than numbers of 32 bits can tell apart.
    fn numbered(&mut self, model: &Model<D>, groups: &BodyGroups, pointer: &str) {
        let count = 1 + groups.of_body.iter().copied().max().map_or(0, u64::from);
        let nodes = model.grid.n_nodes() as u64;
        if count * nodes > u64::from(u32::MAX) {
            let message = format!(
                "{count} groups of bodies with unknowns of their own on a grid of {nodes} nodes are more than can be numbered"
            );
            let help = "use a smaller or coarser grid, or leave bodies without contact where they may stick together";
            self.error("D076", pointer, message, help.to_owned());
        }
    }

    /// Warns of bodies that neither stick together nor are in contact: where they meet, they pass through each other.
    fn passing(&mut self, model: &Model<D>, groups: &BodyGroups, in_contact: &[[usize; 2]], pointer: &str) {
        let n = model.bodies.len();
        let all = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let is_free = |&[a, b]: &[usize; 2]| {
            groups.group(a) != groups.group(b)
                && !in_contact.contains(&[a, b])
                && !in_contact.contains(&[b, a])
        };
        let name = |body: usize| quote(&model.bodies[body].name);
        let free: Vec<String> =
            all.filter(is_free).map(|[a, b]| format!("{} and {}", name(a), name(b))).collect();
        let Some(first) = free.first() else { return };
        let more = match free.len() - 1 {
            0 => String::new(),
            others => format!(", and {others} other pairs"),
        };
        let message = format!(
            "bodies without contact have nodes of their own and pass through each other if they meet: {first}{more}"
        );
        let found = Diagnostic::at(&self.loaded.source, "D077", pointer, message).severity(Severity::Warning);
        self.found
            .push(found.help("add `{between: all}`, which gives contact to all pairs that no entry names"));
    }
}

fn contact(bodies: [usize; 2], given: &BodyContactDeck) -> BodyContact {
    let default = ContactControl::default();
    BodyContact {
        bodies,
        interface: Some(interface(given.friction, given.adhesion, given.tension)),
        control: ContactControl {
            penalty: given.penalty.unwrap_or(default.penalty),
            tolerance: given.overlap.unwrap_or(OVERLAP),
            ..default
        },
    }
}
