//! The faces of a region.

use crate::grid::Lines;
use crate::region::{BoxTree, Face, Level, around, facet_distance};

/// Distance from a lattice line within which a plane is on the line, in cells, [-].
const ON_LINE: f64 = 1e-6;

/// A face with a tree of its facets.
pub(super) struct FaceAt {
    pub level: Level,
    /// Height at which the corners of domains lie on it, so that the volume on both sides of it is right, [length].
    pub shift: f64,
    pub facets: Vec<[[f64; 3]; 3]>,
    pub tree: BoxTree<3>,
}

impl FaceAt {
    pub(super) fn new(face: Face) -> Self {
        let boxes: Vec<_> = face.facets.iter().map(|facet| around(facet)).collect();
        let tree = BoxTree::new(&boxes);
        FaceAt { level: face.level, shift: 0.0, facets: tree.ordered(&face.facets), tree }
    }

    /// The height of a position above the face, [length], and its gradient, [-].
    pub(super) fn height(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        let (height, gradient) = self.level.height(x);
        (height - self.shift, gradient)
    }

    /// True if a position is within a distance of the face.
    pub(super) fn is_near(&self, x: &[f64; 3], distance: f64) -> bool {
        let mut least = distance * distance;
        let mut found = false;
        self.tree.approach(x, least, |item| {
            if facet_distance(&self.facets[item], x) <= distance {
                (found, least) = (true, -1.0);
            }
            least
        });
        found
    }
}

/// True if a face is plane and lies on a lattice line.
pub(super) fn is_on_line(level: &Level, lines: &Lines<3>) -> bool {
    let Level::Plane { point, normal } = level else { return false };
    (0..3).any(|d| {
        let axis = &lines.axes()[d];
        let xi = axis.coordinate(point[d]);
        normal[d].abs() > 1.0 - 1e-12 && (xi - xi.round()).abs() <= ON_LINE
    })
}
