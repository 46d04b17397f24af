//! Pyramids and wedges: hexahedra some of whose corners coincide.
//!
//! They are domains of material points between hexahedra and tetrahedra; grids have no such cells. Their shape
//! functions are those of the hexahedron, summed over the corners that coincide: bilinear on quadrilateral sides,
//! linear on triangular ones, so that a side has the same mean as a side of a hexahedron or tetrahedron.

use super::ElementShape;
use crate::grid::vtk_corner;

/// A pyramid or wedge in space, by its number of corners.
///
/// Corners are in VTK order. Pyramid: first around the base, counterclockwise as seen from the tip, then the tip.
/// Wedge: first around one triangle, counterclockwise as seen from outside, then their partners on the other one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Collapsed {
    /// Five corners.
    Pyramid,
    /// Six corners.
    Wedge,
}

impl Collapsed {
    /// The shape with this number of corners in `D` dimensions, if any.
    pub fn from_corners<const D: usize>(corners: usize) -> Option<Self> {
        match (D, corners) {
            (3, 5) => Some(Collapsed::Pyramid),
            (3, 6) => Some(Collapsed::Wedge),
            _ => None,
        }
    }

    /// For each corner of the hexahedron, whose bit d is its side along axis d, the corner of this shape.
    pub fn corners_of_hexahedron(self) -> [usize; 8] {
        match self {
            Collapsed::Pyramid => [0, 1, 3, 2, 4, 4, 4, 4],
            Collapsed::Wedge => [0, 2, 1, 1, 3, 5, 4, 4],
        }
    }

    /// The hexahedron that has collapsed, given the corners of this shape.
    pub fn hexahedron<const D: usize>(self, corners: &[[f64; D]]) -> [[f64; D]; 8] {
        self.corners_of_hexahedron().map(|k| corners[k])
    }

    /// Volume, positive for corners in order, [length³].
    pub fn volume<const D: usize>(self, corners: &[[f64; D]]) -> f64 {
        ElementShape::Box.volume(&self.in_order_of_element(corners))
    }

    /// Centroid, [length].
    pub fn centroid<const D: usize>(self, corners: &[[f64; D]]) -> [f64; D] {
        ElementShape::Box.centroid(&self.in_order_of_element(corners))
    }

    /// The corners of the hexahedron in VTK order.
    fn in_order_of_element<const D: usize>(self, corners: &[[f64; D]]) -> [[f64; D]; 8] {
        let whole = self.hexahedron(corners);
        std::array::from_fn(|k| whole[vtk_corner(k)])
    }

    /// Corner indices of each side, counterclockwise as seen from outside.
    pub fn sides(self) -> &'static [&'static [usize]] {
        match self {
            Collapsed::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            Collapsed::Wedge => &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]],
        }
    }

    /// Groups of edges through whose mid-points a cut divides the shape into two of the same kind.
    pub fn cuts(self) -> &'static [&'static [[usize; 2]]] {
        match self {
            Collapsed::Pyramid => &[&[[0, 1], [3, 2]], &[[1, 2], [0, 3]]],
            Collapsed::Wedge => {
                &[&[[0, 3], [1, 4], [2, 5]], &[[0, 1], [3, 4]], &[[1, 2], [4, 5]], &[[2, 0], [5, 3]]]
            }
        }
    }

    /// Three edges that meet at a corner, as the corners at their other ends, right-handed; at the tip of a pyramid,
    /// where four meet, three of them.
    pub fn edges_at(self, corner: usize) -> [usize; 3] {
        match (self, corner) {
            (Collapsed::Pyramid, 4) => [0, 2, 1],
            (Collapsed::Pyramid, k) => [(k + 1) % 4, (k + 3) % 4, 4],
            (Collapsed::Wedge, k) if k < 3 => [(k + 2) % 3, (k + 1) % 3, k + 3],
            (Collapsed::Wedge, k) => [3 + (k + 1) % 3, 3 + (k + 2) % 3, k - 3],
        }
    }
}
