//! Elements of unstructured meshes: linear shape functions and the map between local coordinates and positions.
//!
//! Corners are in VTK order. Triangle, quadrilateral: counterclockwise. Tetrahedron: the first three counterclockwise
//! as seen from the fourth. Hexahedron: first around the bottom, counterclockwise as seen from the top, then around the
//! top. Arrays have room for the largest element; entries beyond the number of nodes are zero.

mod collapsed;
mod inverse;
mod validity;

use super::structured::vtk_corner;

pub use collapsed::Collapsed;
pub use validity::folds;

/// Largest number of nodes of an element.
pub const MAX_NODES: usize = 8;

/// Shape of an element in `D` dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ElementShape {
    /// A triangle or tetrahedron with `D` + 1 corners: one at the origin of the local coordinates and one at 1 on each
    /// axis.
    Simplex,
    /// A quadrilateral or hexahedron: 2^`D` corners, at −1 and 1 on each local axis.
    Box,
}

pub(super) fn minus<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    std::array::from_fn(|d| a[d] - b[d])
}

pub(super) fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (1..D).fold(a[0] * b[0], |sum, d| sum + a[d] * b[d])
}

/// Out-of-plane component of a × b.
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// a × b.
pub(super) fn vector_product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Local coordinates (±1) of a corner of a box; bit d of the corner's number gives its side along axis d.
pub fn corner_side<const D: usize>(corner: usize) -> [f64; D] {
    std::array::from_fn(|d| if corner >> d & 1 == 1 { 1.0 } else { -1.0 })
}

/// Multilinear shape function N and its gradient ∂N/∂ξ for a corner of a box; bit d of the corner's number gives its
/// side along axis d.
pub fn box_shape<const D: usize>(corner: usize, xi: &[f64; D]) -> (f64, [f64; D]) {
    let side = corner_side::<D>(corner);
    let factor = |d: usize| 0.5 * (1.0 + side[d] * xi[d]);
    let value = (0..D).map(factor).product();
    let slope =
        std::array::from_fn(|d| (0..D).map(|e| if e == d { 0.5 * side[d] } else { factor(e) }).product());
    (value, slope)
}

/// Adjugate (inverse times determinant), `[a][i]`, and determinant of the Jacobian `[i][a]` = ∂xᵢ/∂ξₐ.
pub(super) fn adjugate<const D: usize>(j: &[[f64; D]; D]) -> ([[f64; D]; D], f64) {
    let mut adjugate = [[0.0; D]; D];
    let mut determinant = 0.0;
    match D {
        2 => {
            let (a, b, c, d) = (j[0][0], j[0][1], j[1][0], j[1][1]);
            adjugate[0][0] = d;
            adjugate[0][1] = -b;
            adjugate[1][0] = -c;
            adjugate[1][1] = a;
            determinant = a * d - b * c;
        }
        3 => {
            let column = |a: usize| [j[0][a], j[1][a], j[2][a]];
            for a in 0..3 {
                let row = vector_product(column((a + 1) % 3), column((a + 2) % 3));
                adjugate[a].copy_from_slice(&row);
            }
            determinant = dot([j[0][0], j[1][0], j[2][0]], vector_product(column(1), column(2)));
        }
        _ => {}
    }
    (adjugate, determinant)
}

impl ElementShape {
    /// The shape with this number of nodes in `D` dimensions; `None` if no shape has this number.
    pub fn from_nodes<const D: usize>(n_nodes: usize) -> Option<Self> {
        match n_nodes {
            n if n == D + 1 => Some(ElementShape::Simplex),
            n if n == 1 << D => Some(ElementShape::Box),
            _ => None,
        }
    }

    /// Number of nodes in `D` dimensions; all nodes are corners.
    pub fn n_nodes<const D: usize>(self) -> usize {
        match self {
            ElementShape::Simplex => D + 1,
            ElementShape::Box => 1 << D,
        }
    }

    /// Plural of the name of the shape in `D` dimensions.
    pub fn plural<const D: usize>(self) -> &'static str {
        match (self, D) {
            (ElementShape::Simplex, 3) => "tetrahedra",
            (ElementShape::Simplex, _) => "triangles",
            (ElementShape::Box, 3) => "hexahedra",
            (ElementShape::Box, _) => "quadrilaterals",
        }
    }

    /// Corner indices of each side (edge in the plane, face in space). An edge has the element to its left; a face is
    /// counterclockwise as seen from outside.
    pub fn sides<const D: usize>(self) -> &'static [&'static [usize]] {
        match (self, D) {
            (ElementShape::Simplex, 3) => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
            (ElementShape::Simplex, _) => &[&[0, 1], &[1, 2], &[2, 0]],
            (ElementShape::Box, 3) => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
            (ElementShape::Box, _) => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
        }
    }

    /// Local coordinates of the centre.
    pub fn centre<const D: usize>(self) -> [f64; D] {
        match self {
            ElementShape::Simplex => [1.0 / (D + 1) as f64; D],
            ElementShape::Box => [0.0; D],
        }
    }

    /// Local coordinates of a node.
    pub fn node_coordinates<const D: usize>(self, node: usize) -> [f64; D] {
        match self {
            ElementShape::Simplex => std::array::from_fn(|d| f64::from(u8::from(d + 1 == node))),
            ElementShape::Box => corner_side(vtk_corner(node)),
        }
    }

    /// Shape functions N(ξ), [-].
    pub fn values<const D: usize>(self, xi: [f64; D]) -> [f64; MAX_NODES] {
        let mut values = [0.0; MAX_NODES];
        match self {
            ElementShape::Simplex => {
                values[0] = xi.iter().fold(1.0, |rest, x| rest - x);
                values[1..=D].copy_from_slice(&xi);
            }
            ElementShape::Box => {
                for (k, value) in values.iter_mut().enumerate().take(1 << D) {
                    *value = box_shape(vtk_corner(k), &xi).0;
                }
            }
        }
        values
    }

    /// Derivatives dN/dξ of the shape functions with respect to the local coordinates, [-].
    pub fn local_gradients<const D: usize>(self, xi: [f64; D]) -> [[f64; D]; MAX_NODES] {
        let mut gradients = [[0.0; D]; MAX_NODES];
        match self {
            ElementShape::Simplex => {
                gradients[0] = [-1.0; D];
                for d in 0..D {
                    gradients[d + 1][d] = 1.0;
                }
            }
            ElementShape::Box => {
                for (k, gradient) in gradients.iter_mut().enumerate().take(1 << D) {
                    *gradient = box_shape(vtk_corner(k), &xi).1;
                }
            }
        }
        gradients
    }

    /// Position x(ξ) at local coordinates, [length].
    pub fn map<const D: usize>(self, corners: &[[f64; D]], xi: [f64; D]) -> [f64; D] {
        let mut x = [0.0; D];
        for (corner, value) in corners.iter().zip(self.values(xi)) {
            for d in 0..D {
                x[d] += value * corner[d];
            }
        }
        x
    }

    /// Jacobian of the map, `[i][a]` = ∂xᵢ/∂ξₐ, [length].
    pub fn jacobian<const D: usize>(self, corners: &[[f64; D]], xi: [f64; D]) -> [[f64; D]; D] {
        let mut jacobian = [[0.0; D]; D];
        for (corner, gradient) in corners.iter().zip(self.local_gradients(xi)) {
            for i in 0..D {
                for a in 0..D {
                    jacobian[i][a] += corner[i] * gradient[a];
                }
            }
        }
        jacobian
    }

    /// Derivatives ∂N/∂x of the shape functions with respect to the position, [1/length].
    pub fn gradients<const D: usize>(self, corners: &[[f64; D]], xi: [f64; D]) -> [[f64; D]; MAX_NODES] {
        let (adjugate, determinant) = adjugate(&self.jacobian(corners, xi));
        self.local_gradients(xi).map(|local| {
            std::array::from_fn(|i| {
                (1..D).fold(local[0] * adjugate[0][i], |sum, a| sum + local[a] * adjugate[a][i]) / determinant
            })
        })
    }

    /// Volume (area), positive for corners in VTK order, [length^`D`].
    pub fn volume<const D: usize>(self, corners: &[[f64; D]]) -> f64 {
        if corners.len() < self.n_nodes::<D>() {
            return 0.0;
        }
        match (self, D) {
            (ElementShape::Box, 2) => {
                let diagonal = |a: usize, b: usize| {
                    minus([corners[b][0], corners[b][1]], [corners[a][0], corners[a][1]])
                };
                0.5 * cross(diagonal(0, 2), diagonal(1, 3))
            }
            (ElementShape::Box, _) => {
                gauss_points::<D>().map(|xi| adjugate(&self.jacobian(corners, xi)).1).sum()
            }
            (ElementShape::Simplex, _) => {
                let (_, determinant) = adjugate(&self.jacobian(corners, self.centre()));
                determinant / (1..=D).product::<usize>() as f64
            }
        }
    }

    /// Centroid, [length].
    pub fn centroid<const D: usize>(self, corners: &[[f64; D]]) -> [f64; D] {
        match self {
            ElementShape::Simplex => self.map(corners, self.centre()),
            ElementShape::Box => {
                let (mut sum, mut volume) = ([0.0; D], 0.0);
                for xi in gauss_points::<D>() {
                    let (_, weight) = adjugate(&self.jacobian(corners, xi));
                    volume += weight;
                    let x = self.map(corners, xi);
                    for d in 0..D {
                        sum[d] += weight * x[d];
                    }
                }
                sum.map(|s| s / volume)
            }
        }
    }

    /// Determinant of the Jacobian at every corner, up to a positive factor, [length^`D`]; in the plane, twice the area
    /// of the triangle of the corner and its two neighbours. A quadrilateral is convex and counterclockwise if and only
    /// if all determinants are positive.
    pub fn corner_determinants<const D: usize>(self, corners: &[[f64; D]]) -> [f64; MAX_NODES] {
        let n = self.n_nodes::<D>().min(corners.len());
        let scale = if self == ElementShape::Box { (1u32 << D).into() } else { 1.0 };
        std::array::from_fn(|k| {
            if k >= n {
                return 0.0;
            }
            scale * adjugate(&self.jacobian(corners, self.node_coordinates(k))).1
        })
    }
}

/// Points of the two-point Gauss rule along each axis of a box; all weights are one. Exact for polynomials of degree
/// three along each axis.
pub(crate) fn gauss_points<const D: usize>() -> impl Iterator<Item = [f64; D]> {
    (0..1usize << D).map(|k| corner_side(k).map(|side: f64| side / 3f64.sqrt()))
}

#[cfg(test)]
mod tests;
