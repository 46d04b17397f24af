//! Segments in the plane with a bounding box tree.

use super::features::{Nearest, on_segment};
use crate::region::vector::{minus, norm};
use crate::region::{Bounds, BoxTree, around, boxes_overlap};

/// The edges of a polygon or a wall.
#[derive(Debug, Clone)]
pub(super) struct Segments {
    /// Ends of the segments, in the order of the tree.
    ends: Vec<[[f64; 2]; 2]>,
    /// Unit normals to the right of the direction from the first end to the second, in the order of the tree.
    normals: Vec<[f64; 2]>,
    tree: BoxTree<2>,
}

impl Segments {
    /// Segments of positive length.
    pub(super) fn new(ends: &[[[f64; 2]; 2]]) -> Self {
        let boxes: Vec<Bounds<2>> = ends.iter().map(|ends| around(ends)).collect();
        let tree = BoxTree::new(&boxes);
        let ends = tree.ordered(ends);
        let normals = ends.iter().map(right_normal).collect();
        Segments { ends, normals, tree }
    }

    pub(super) fn bounds(&self) -> Bounds<2> {
        self.tree.bounds()
    }

    /// The closest feature at a distance of at most `limit`, [length].
    pub(super) fn nearest(&self, x: &[f64; 2], limit: f64) -> Nearest<2> {
        let mut nearest = Nearest::within(limit);
        self.tree.approach(x, nearest.squared_limit(), |item| {
            let feature = on_segment(x, &self.ends[item], &self.normals[item]);
            nearest.offer(feature, item, self.tree.order[item]);
            nearest.squared_limit()
        });
        nearest
    }

    /// Ends of a segment, by its index in the order of the tree.
    pub(super) fn ends(&self, item: usize) -> &[[f64; 2]; 2] {
        &self.ends[item]
    }

    /// Unit normal of a segment, by its index in the order of the tree.
    pub(super) fn normal(&self, item: usize) -> [f64; 2] {
        self.normals[item]
    }

    /// Number of a segment, by its index in the order of the tree.
    pub(super) fn number(&self, item: usize) -> usize {
        self.tree.order[item] as usize
    }

    /// Visits the segments, by index in the order of the tree, whose bounding boxes are at most `distance`, [length], from
    /// a box.
    pub(super) fn each_near(&self, [low, high]: &Bounds<2>, distance: f64, mut visit: impl FnMut(usize)) {
        let wider = [low.map(|x| x - distance), high.map(|x| x + distance)];
        self.tree.visit(
            |bounds| boxes_overlap(bounds, &wider),
            |item| {
                if boxes_overlap(&around(&self.ends[item]), &wider) {
                    visit(item);
                }
            },
        );
    }
}

/// Unit normal to the right of the direction from one position to another.
pub(super) fn right_normal([a, b]: &[[f64; 2]; 2]) -> [f64; 2] {
    let edge = minus(b, a);
    let length = norm(&edge);
    [edge[1] / length, -edge[0] / length]
}
