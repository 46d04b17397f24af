//! A bounding box tree over facets.

use super::triangle::Triangle;
use crate::region::{Bounds, hull, nothing};

/// Largest number of facets in a leaf.
const LEAF: usize = 4;

/// Upper bound of the depth: a balanced tree of 2³² facets is less deep.
const DEEPEST: usize = 34;

/// A binary tree of bounding boxes. Facets are sorted by leaf, so that every node stands for a range of facets.
#[derive(Debug, Clone)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    /// Original index of each facet.
    pub(super) order: Vec<u32>,
}

#[derive(Debug, Clone)]
struct Node {
    bounds: Bounds<3>,
    first: u32,
    end: u32,
    /// Index of the second child (the first follows its parent); 0 for a leaf.
    second: u32,
}

impl BoxTree {
    pub(super) fn new(triangles: &[Triangle]) -> Self {
        let boxes: Vec<Bounds<3>> = triangles.iter().map(bounds).collect();
        let mut tree = BoxTree { nodes: Vec::new(), order: (0..triangles.len() as u32).collect() };
        tree.split(&boxes, 0, triangles.len());
        tree
    }

    /// Adds the node of a range of facets, and its descendants.
    fn split(&mut self, boxes: &[Bounds<3>], first: usize, end: usize) {
        let range = &mut self.order[first..end];
        let around = range.iter().map(|&facet| boxes[facet as usize]).fold(nothing(), hull);
        let at = self.nodes.len();
        self.nodes.push(Node { bounds: around, first: first as u32, end: end as u32, second: 0 });
        if range.len() <= LEAF {
            return;
        }
        let twice_middle = |facet: u32, d: usize| boxes[facet as usize][0][d] + boxes[facet as usize][1][d];
        let spread = |d: usize| {
            let middles = range.iter().map(|&facet| twice_middle(facet, d));
            let ends = middles.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
            ends[1] - ends[0]
        };
        let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
        let half = range.len() / 2;
        range.select_nth_unstable_by(half, |&a, &b| {
            twice_middle(a, axis).total_cmp(&twice_middle(b, axis)).then(a.cmp(&b))
        });
        self.split(boxes, first, first + half);
        self.nodes[at].second = self.nodes.len() as u32;
        self.split(boxes, first + half, end);
    }

    /// Data of facets, reordered to the order of the tree.
    pub(super) fn ordered<T: Copy>(&self, of_facets: &[T]) -> Vec<T> {
        self.order.iter().map(|&facet| of_facets[facet as usize]).collect()
    }

    pub(super) fn bounds(&self) -> Bounds<3> {
        self.nodes[0].bounds
    }

    /// Visits the facets, by index in the order of the tree, of all leaves whose boxes satisfy `meets`.
    pub(super) fn visit(&self, meets: impl Fn(&Bounds<3>) -> bool, mut visit: impl FnMut(usize)) {
        let mut open = [0u32; DEEPEST];
        let mut n = 1;
        while n > 0 {
            n -= 1;
            let at = open[n];
            let node = &self.nodes[at as usize];
            if !meets(&node.bounds) {
                continue;
            }
            if node.second == 0 {
                (node.first as usize..node.end as usize).for_each(&mut visit);
            } else {
                open[n] = node.second;
                open[n + 1] = at + 1;
                n += 2;
            }
        }
    }
}

/// Bounding box of a facet.
pub(super) fn bounds(t: &Triangle) -> Bounds<3> {
    t.iter().map(|x| [*x, *x]).fold(nothing(), hull)
}
