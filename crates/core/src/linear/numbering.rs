//! The numbers of the unknowns among the components at the active nodes.

/// The unknowns among the components at the active nodes, numbered node by node and component by component.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Numbering<const N: usize> {
    /// The number of the unknown, or a number from `count` on if the component is not an unknown.
    number: Vec<[u32; N]>,
    count: usize,
}

impl<const N: usize> Numbering<N> {
    /// Numbers the components of `n_nodes` nodes for which `is_unknown` is true. The other components get the numbers
    /// that follow, in the same order.
    pub fn new(n_nodes: usize, is_unknown: impl Fn(usize, usize) -> bool) -> Self {
        let all = || (0..n_nodes).flat_map(|node| (0..N).map(move |component| (node, component)));
        let mut number = vec![[0; N]; n_nodes];
        let unknowns = all().filter(|&(node, component)| is_unknown(node, component));
        let count = unknowns.zip(0..).map(|((node, component), k)| number[node][component] = k).count();
        let others = all().filter(|&(node, component)| !is_unknown(node, component));
        others.zip(count as u32..).for_each(|((node, component), k)| number[node][component] = k);
        Numbering { number, count }
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.number.len()
    }

    /// The number of an unknown; `None` if the component is not an unknown.
    #[inline]
    pub fn unknown(&self, node: usize, component: usize) -> Option<usize> {
        let number = self.number[node][component] as usize;
        (number < self.count).then_some(number)
    }

    /// The index of a component among the components that are not unknowns; `None` if it is an unknown.
    #[inline]
    pub fn other(&self, node: usize, component: usize) -> Option<usize> {
        (self.number[node][component] as usize).checked_sub(self.count)
    }

    /// Visits all components in order, with the node, the component, and its unknown if it has one.
    pub fn for_each(&self, mut visit: impl FnMut(usize, usize, Option<usize>)) {
        for node in 0..self.n_nodes() {
            for component in 0..N {
                visit(node, component, self.unknown(node, component));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknowns_come_first_and_both_kinds_ascend() {
        let numbering = Numbering::<2>::new(3, |node, component| node != 1 && component == 0 || node == 2);
        assert_eq!((numbering.count(), numbering.n_nodes()), (3, 3));
        let mut seen = Vec::new();
        numbering.for_each(|node, component, unknown| seen.push((unknown, numbering.other(node, component))));
        let expected = [(Some(0), None), (None, Some(0)), (None, Some(1)), (None, Some(2)), (Some(1), None)];
        assert_eq!(seen[..5], expected);
        assert_eq!(seen[5], (Some(2), None));
        assert_eq!(Numbering::<1>::new(2, |_, _| true).count(), 2);
    }
}
