//! Bodies that share grid nodes and therefore stick together.

use std::collections::BTreeSet;

use mpm_core::basis::Connectivity;
use mpm_core::model::Model;
use mpm_core::points::{Points, coordinates};
use mpm_core::quality::{Gap, gaps};
use mpm_core::solver::added_points;

use crate::Deck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::first_step::Check;
use crate::quoting::{list, quote};

impl Check<'_> {
    /// Adds one note that names the groups of bodies that share grid nodes while both are present, judged with all
    /// points at their original positions; `links` are those of the bodies that are present at the start.
    pub(crate) fn glued<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) {
        let deck = &self.loaded.deck;
        let mut pairs = links.joined_bodies(points);
        if deck.stages.iter().any(|stage| !stage.add.is_empty()) {
            pairs.extend(joined_in_stages(deck, model, points));
        }
        let groups = groups(deck.bodies.len(), &pairs);
        if groups.is_empty() {
            return;
        }
        let names =
            |group: &Vec<u16>| list(group.iter().map(|&body| deck.bodies[usize::from(body)].name.as_str()));
        let message = format!(
            "bodies that share grid nodes stick together, so that they neither slide on each other nor part: {}",
            groups.iter().map(names).collect::<Vec<_>>().join("; ")
        );
        let found = Diagnostic::at_key(&self.loaded.source, "D072", "/bodies", message);
        let help = "this is right for layers of the same ground; where bodies are to slide or part, name them under \
                    `contacts`; bodies that must not touch need a gap of two cells between them";
        self.found.push(found.severity(Severity::Note).help(help));
    }
}

impl Check<'_> {
    /// Adds a note about each gap across which two bodies share grid nodes at the start.
    pub(crate) fn narrow_gaps<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) {
        for Gap { bodies, width, position, .. } in gaps(model, points, links) {
            let size = model.grid.size(model.grid.nearest_cell(&position) as usize);
            let [a, b] = bodies.map(|body| quote(&model.bodies[usize::from(body)].name));
            let message = format!(
                "only a gap of about {:.1} cells separates the bodies {a} and {b} near {}, and they share grid nodes: they \
                 act on each other as if the gap were filled",
                width / size,
                coordinates(&position)
            );
            let found = self.at("D073", &format!("/bodies/{}/shape", bodies[1]), message);
            let help = "use cells at most half as wide as the gap, or join the bodies";
            self.found.push(found.severity(Severity::Note).help(help));
        }
    }
}

/// The pairs of bodies that share nodes in a stage, with the points of all bodies at their original positions. All
/// ranks must call this together.
fn joined_in_stages<const D: usize>(deck: &Deck, model: &Model<D>, points: &Points<D>) -> BTreeSet<[u16; 2]> {
    let mut known: Vec<bool> = deck.bodies.iter().map(|body| deck.begins_present(&body.name)).collect();
    let mut all = points.clone();
    for (number, given) in deck.stages.iter().enumerate() {
        let mut added = added_points(model, &all, number);
        added.retain_bodies(|body| !known[body]);
        all.append(&added);
        for (known, body) in known.iter_mut().zip(&deck.bodies) {
            *known |= given.added().contains(&body.name.as_str());
        }
    }
    // A point that finds no place is reported in its stage.
    let links = Connectivity::default().with_body_groups(&model.body_groups.of_body);
    let Ok(links) = links.renew(model.grid.as_ref(), &mut all, &model.methods()) else {
        return BTreeSet::new();
    };
    let mut pairs = links.joined_bodies(&all);
    pairs.retain(|pair| deck.meet(pair.map(|body| deck.bodies[usize::from(body)].name.as_str())));
    pairs
}

/// Groups of bodies that are joined, directly or through others, in ascending order; bodies that stand alone are in no
/// group.
fn groups(bodies: usize, pairs: &BTreeSet<[u16; 2]>) -> Vec<Vec<u16>> {
    let mut first: Vec<u16> = (0..bodies as u16).collect();
    for [a, b] in pairs {
        let ends = [first[usize::from(*a)], first[usize::from(*b)]];
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        first.iter_mut().filter(|first| **first == high).for_each(|first| *first = low);
    }
    let members = |group: u16| (0..bodies as u16).filter(|&body| first[usize::from(body)] == group).collect();
    (0..bodies as u16).map(members).filter(|group: &Vec<u16>| group.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::groups;

    #[test]
    fn bodies_are_joined_through_others() {
        let pairs = [[0, 2], [3, 4], [2, 5]].into_iter().collect();
        assert_eq!(groups(7, &pairs), [vec![0, 2, 5], vec![3, 4]]);
        assert!(groups(3, &[].into_iter().collect()).is_empty());
    }
}
