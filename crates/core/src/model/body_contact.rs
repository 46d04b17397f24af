//! Contact between bodies.

use crate::basis::BodyGroup;

use super::tool::{ContactControl, Interface};

/// Two bodies that may touch, slide on each other and part.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyContact {
    /// Indices of the bodies.
    pub bodies: [usize; 2],
    /// The interface between them; `None` if they stick together in the current stage.
    pub interface: Option<Interface>,
    /// Control of the contact.
    pub control: ContactControl,
}

/// Groups of bodies that share the unknowns of their nodes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BodyGroups {
    /// The group of each body, numbered from 0; empty if all bodies are in one group.
    pub of_body: Vec<BodyGroup>,
}

/// Two bodies between which contact is given stick together through other bodies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Glued {
    /// Indices of the two bodies.
    pub bodies: [usize; 2],
    /// The bodies that stick together with them, themselves included.
    pub together: Vec<usize>,
}

impl BodyGroups {
    /// The groups for a number of bodies, from the pairs between which contact is given and the pairs that share nodes
    /// of the grid at the start. Bodies that share nodes without contact stick together; all that may remain together
    /// are in the lowest group in which no body is in contact with them.
    ///
    /// # Errors
    /// [`Glued`] if two bodies in contact stick together through others.
    pub fn new(bodies: usize, in_contact: &[[usize; 2]], joined: &[[usize; 2]]) -> Result<Self, Glued> {
        if in_contact.is_empty() {
            return Ok(BodyGroups::default());
        }
        let are_in_contact =
            |a: usize, b: usize| in_contact.iter().any(|pair| *pair == [a, b] || *pair == [b, a]);
        let mut cluster: Vec<usize> = (0..bodies).collect();
        for &[a, b] in joined.iter().filter(|[a, b]| !are_in_contact(*a, *b)) {
            let (from, to) = (cluster[a].max(cluster[b]), cluster[a].min(cluster[b]));
            cluster.iter_mut().filter(|number| **number == from).for_each(|number| *number = to);
        }
        let members = |number: usize| (0..bodies).filter(|body| cluster[*body] == number).collect::<Vec<_>>();
        if let Some(pair) = in_contact.iter().find(|[a, b]| cluster[*a] == cluster[*b]) {
            return Err(Glued { bodies: *pair, together: members(cluster[pair[0]]) });
        }
        let mut of_body: Vec<Option<BodyGroup>> = vec![None; bodies];
        for number in 0..bodies {
            let own = members(number);
            let is_free = |group: &BodyGroup| {
                let others = || (0..bodies).filter(|body| of_body[*body] == Some(*group));
                !own.iter().any(|&body| others().any(|other| are_in_contact(body, other)))
            };
            let lowest = (0..BodyGroup::MAX).find(is_free);
            own.iter().for_each(|&body| of_body[body] = lowest);
        }
        Ok(BodyGroups { of_body: of_body.into_iter().map(Option::unwrap_or_default).collect() })
    }

    /// The group of a body.
    pub fn group(&self, body: usize) -> BodyGroup {
        self.of_body.get(body).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_in_contact_are_in_groups_of_their_own() {
        let groups = |bodies, contacts: &[[usize; 2]], joined: &[[usize; 2]]| {
            BodyGroups::new(bodies, contacts, joined).map(|groups| groups.of_body)
        };
        assert_eq!(groups(3, &[], &[[0, 1]]).unwrap(), [0u16; 0]);
        assert_eq!(groups(3, &[[0, 1]], &[[0, 1]]).unwrap(), [0, 1, 0]);
        // The third body sticks to the second.
        assert_eq!(groups(3, &[[0, 1]], &[[0, 1], [1, 2]]).unwrap(), [0, 1, 1]);
        assert_eq!(groups(3, &[[0, 1], [1, 2], [2, 0]], &[]).unwrap(), [0, 1, 2]);
        let glued = groups(3, &[[0, 2]], &[[0, 1], [1, 2]]).unwrap_err();
        assert_eq!(glued, Glued { bodies: [0, 2], together: vec![0, 1, 2] });
    }
}
