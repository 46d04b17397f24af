//! The regions of which a union or a difference consists.

use std::cell::Cell;
use std::ops::Deref;
use std::sync::Arc;

use super::box_tree::BoxTree;
use super::{Bounds, Region};

/// Number of regions from which a tree finds those near a position faster than a loop.
const MANY: usize = 16;
/// Margin of the search, relative to the largest coordinate, [-]: far more than the round-off of bounding boxes.
const MARGIN: f64 = 1e-6;

/// Regions, which are found by their bounding boxes if there are many.
#[derive(Debug, Clone)]
pub(crate) struct Parts<const D: usize> {
    regions: Vec<Region<D>>,
    /// The tree of the bounding boxes, and the margin of the search in it, [length]; `None` if there are few regions.
    tree: Option<(Arc<BoxTree<D>>, f64)>,
}

impl<const D: usize> Parts<D> {
    pub(crate) fn new(regions: Vec<Region<D>>) -> Self {
        let tree = (regions.len() >= MANY).then(|| {
            let tree = BoxTree::new(&regions.iter().map(Region::bounds).collect::<Vec<_>>());
            let farthest = tree.bounds().as_flattened().iter().fold(0.0, |far: f64, x| far.max(x.abs()));
            (Arc::new(tree), MARGIN * farthest)
        });
        Parts { regions, tree }
    }

    /// The regions.
    pub(crate) fn into_regions(self) -> Vec<Region<D>> {
        self.regions
    }

    /// True if a region that overlaps a box, or a position given as a box, has a property. Regions elsewhere must not
    /// have it.
    pub(crate) fn any_near(&self, place: &Bounds<D>, has: impl Fn(&Region<D>) -> bool) -> bool {
        let Some((tree, margin)) = &self.tree else { return self.regions.iter().any(has) };
        let found = Cell::new(false);
        let meets = |bounds: &Bounds<D>| {
            !found.get()
                && (0..D)
                    .all(|d| bounds[0][d] - margin <= place[1][d] && place[0][d] <= bounds[1][d] + margin)
        };
        tree.visit(meets, |item| {
            found.set(found.get() || has(&self.regions[tree.order[item] as usize]));
        });
        found.get()
    }
}

impl<const D: usize> Deref for Parts<D> {
    type Target = [Region<D>];

    fn deref(&self) -> &[Region<D>] {
        &self.regions
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::Brick;

    /// A checkerboard of squares answers as its squares do one by one, however many there are.
    #[test]
    fn many_parts_answer_as_few() {
        for side in [3, 12] {
            let squares = (0..side * side).filter(|k| (k / side + k % side) % 2 == 0).map(|k| {
                let low = [f64::from(k % side), f64::from(k / side)];
                Region::from(Brick::new(low, low.map(|x| x + 1.0)).unwrap())
            });
            let squares: Vec<Region<2>> = squares.collect();
            let union = Region::union(squares.clone()).unwrap();
            let whole = Region::from(Brick::new([0.0; 2], [f64::from(side); 2]).unwrap());
            let rest = Region::difference(whole, squares.clone());
            for k in 0..4 * side * side {
                // Also on the sides and corners of the squares.
                let x = [0.5 * f64::from(k % (2 * side)), 0.5 * f64::from(k / (2 * side))];
                let expected = squares.iter().any(|square| square.contains(&x));
                assert_eq!((union.contains(&x), rest.contains(&x)), (expected, !expected), "{side}: {x:?}");
                let cell = [x, x.map(|x| x + 0.25)];
                let expected = squares.iter().any(|square| square.covers(&cell));
                assert_eq!(union.covers(&cell), expected, "{side}: {x:?}");
                let expected = squares.iter().any(|square| square.may_meet(&cell));
                assert_eq!(union.may_meet(&cell), expected, "{side}: {x:?}");
            }
        }
    }
}
