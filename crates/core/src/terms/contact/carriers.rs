//! The nodes that carry a contact point.

/// The active nodes that carry a contact point, with the values of their basis functions there: S_vp if the contact
/// point is a material point, N_v otherwise.
#[derive(Debug, Clone, Default)]
pub(super) struct Carriers(Vec<(u32, f64)>);

impl Carriers {
    /// Each node with the value of its basis function.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone {
        self.0.iter().map(|&(node, value)| (node as usize, value))
    }

    pub(super) fn push(&mut self, node: u32, value: f64) {
        self.0.push((node, value));
    }

    /// Adds to the value of a node.
    pub(super) fn add(&mut self, node: u32, value: f64) {
        match self.0.iter_mut().find(|(known, _)| *known == node) {
            Some((_, sum)) => *sum += value,
            None => self.0.push((node, value)),
        }
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The index of a node among those from `first` on.
    pub(super) fn place_from(&self, first: usize, node: usize) -> Option<usize> {
        self.0[first..].iter().position(|(known, _)| *known as usize == node).map(|place| first + place)
    }

    /// Adds other carriers with a weight.
    pub(super) fn add_all(&mut self, others: &Carriers, weight: f64) {
        others.iter().for_each(|(node, value)| self.add(node as u32, weight * value));
    }

    /// Multiplies all values by a factor.
    pub(super) fn scale(&mut self, factor: f64) {
        self.0.iter_mut().for_each(|(_, value)| *value *= factor);
    }

    /// The sum of carriers with these weights.
    pub(super) fn mean(of: &[Carriers], weights: &[f64]) -> Carriers {
        let mut mean = Carriers::default();
        for (carriers, weight) in of.iter().zip(weights) {
            mean.add_all(carriers, *weight);
        }
        mean
    }

    /// True if both have the same nodes in the same order.
    pub(super) fn has_same_nodes(&self, other: &Self) -> bool {
        self.0.len() == other.0.len() && self.0.iter().zip(&other.0).all(|(a, b)| a.0 == b.0)
    }

    /// The largest motion of the contact point if no node moves farther than 1.
    pub(super) fn reach(&self) -> f64 {
        self.0.iter().map(|(_, value)| value.abs()).sum()
    }
}
