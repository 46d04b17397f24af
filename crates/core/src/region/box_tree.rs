//! A bounding box tree.

use super::{Bounds, hull, nothing};

/// Largest number of items in a leaf.
const LEAF: usize = 4;

/// Upper bound on the depth: a balanced tree of 2³² items is shallower.
const DEEPEST: usize = 34;

/// A binary tree of bounding boxes. Items are sorted by leaf, so that every node stands for a range of items.
#[derive(Debug, Clone)]
pub(crate) struct BoxTree<const D: usize> {
    nodes: Vec<Node<D>>,
    /// Original index of each item.
    pub(crate) order: Vec<u32>,
}

#[derive(Debug, Clone)]
struct Node<const D: usize> {
    bounds: Bounds<D>,
    first: u32,
    end: u32,
    /// Index of the second child (the first follows its parent); 0 for a leaf.
    second: u32,
}

impl<const D: usize> BoxTree<D> {
    /// The tree of items with these boxes; there must be fewer than 2³² items.
    pub(crate) fn new(boxes: &[Bounds<D>]) -> Self {
        let mut tree = BoxTree { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        tree.split(boxes, 0, boxes.len());
        tree
    }

    /// Adds the node of a range of items, and its descendants.
    fn split(&mut self, boxes: &[Bounds<D>], first: usize, end: usize) {
        let range = &mut self.order[first..end];
        let around = range.iter().map(|&item| boxes[item as usize]).fold(nothing(), hull);
        let at = self.nodes.len();
        self.nodes.push(Node { bounds: around, first: first as u32, end: end as u32, second: 0 });
        if range.len() <= LEAF {
            return;
        }
        let twice_middle = |item: u32, d: usize| boxes[item as usize][0][d] + boxes[item as usize][1][d];
        let spread = |d: usize| {
            let middles = range.iter().map(|&item| twice_middle(item, d));
            let ends = middles.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
            ends[1] - ends[0]
        };
        let axis = (0..D).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
        let half = range.len() / 2;
        range.select_nth_unstable_by(half, |&a, &b| {
            twice_middle(a, axis).total_cmp(&twice_middle(b, axis)).then(a.cmp(&b))
        });
        self.split(boxes, first, first + half);
        self.nodes[at].second = self.nodes.len() as u32;
        self.split(boxes, first + half, end);
    }

    /// Item data, reordered to tree order.
    pub(crate) fn ordered<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.order.iter().map(|&item| values[item as usize]).collect()
    }

    /// The box around all items.
    pub(crate) fn bounds(&self) -> Bounds<D> {
        self.nodes[0].bounds
    }

    /// Visits the items, by index in tree order, of all leaves whose boxes satisfy `meets`.
    pub(crate) fn visit(&self, meets: impl Fn(&Bounds<D>) -> bool, mut visit: impl FnMut(usize)) {
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

    /// Visits the items, by index in tree order, of the leaves whose boxes lie within a distance of a position, near
    /// leaves first. The search starts with the squared distance `limit`, [length²]; `visit` returns the squared
    /// distance beyond which items no longer matter.
    pub(crate) fn approach(&self, x: &[f64; D], mut limit: f64, mut visit: impl FnMut(usize) -> f64) {
        let away = |at: u32| (at, squared_distance(&self.nodes[at as usize].bounds, x));
        let mut open = [(0u32, 0.0); DEEPEST];
        open[0] = away(0);
        let mut n = 1;
        while n > 0 {
            n -= 1;
            let (at, squared) = open[n];
            if squared > limit {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.second == 0 {
                (node.first as usize..node.end as usize).for_each(|item| limit = visit(item));
            } else {
                let [a, b] = [away(at + 1), away(node.second)];
                (open[n], open[n + 1]) = if b.1 < a.1 { (a, b) } else { (b, a) };
                n += 2;
            }
        }
    }
}

/// Squared distance of a position from a box, [length²]; zero inside.
pub(crate) fn squared_distance<const D: usize>([low, high]: &Bounds<D>, x: &[f64; D]) -> f64 {
    (0..D).map(|d| (low[d] - x[d]).max(x[d] - high[d]).max(0.0).powi(2)).sum()
}

/// Box around some positions.
pub(crate) fn around<const D: usize>(positions: &[[f64; D]]) -> Bounds<D> {
    positions.iter().map(|x| [*x, *x]).fold(nothing(), hull)
}

/// True if two boxes have a common position.
pub(crate) fn overlap<const D: usize>(a: &Bounds<D>, b: &Bounds<D>) -> bool {
    (0..D).all(|d| a[0][d] <= b[1][d] && b[0][d] <= a[1][d])
}
