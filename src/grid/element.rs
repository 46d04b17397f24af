//! Elements of unstructured meshes: linear shape functions and the map between physical and local coordinates.
//!
//! Corners are numbered counterclockwise. Arrays have room for the largest element; the entries beyond its number
//! of nodes are zero.

/// The most nodes an element can have.
pub const MAX_NODES: usize = 4;

/// Shape of an element in two dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ElementShape {
    /// Three corners, at the local coordinates (0, 0), (1, 0) and (0, 1).
    Triangle,
    /// Four corners, at the local coordinates (−1, −1), (1, −1), (1, 1) and (−1, 1).
    Quadrilateral,
}

/// Local coordinates of the corners of a quadrilateral.
const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// The component of a × b out of the plane: twice the area of the triangle of the two vectors.
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

impl ElementShape {
    /// The shape with this number of nodes, if there is one.
    pub fn from_nodes(n_nodes: usize) -> Option<Self> {
        match n_nodes {
            3 => Some(ElementShape::Triangle),
            4 => Some(ElementShape::Quadrilateral),
            _ => None,
        }
    }

    /// Number of nodes, all of them corners.
    pub fn n_nodes(self) -> usize {
        match self {
            ElementShape::Triangle => 3,
            ElementShape::Quadrilateral => 4,
        }
    }

    /// Local coordinates of the centre.
    pub fn centre(self) -> [f64; 2] {
        match self {
            ElementShape::Triangle => [1.0 / 3.0; 2],
            ElementShape::Quadrilateral => [0.0; 2],
        }
    }

    /// Local coordinates of the nodes.
    pub fn node_coordinates(self) -> &'static [[f64; 2]] {
        match self {
            ElementShape::Triangle => &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            ElementShape::Quadrilateral => &SIGNS,
        }
    }

    /// Shape functions N(ξ), [-].
    pub fn values(self, [xi, eta]: [f64; 2]) -> [f64; MAX_NODES] {
        match self {
            ElementShape::Triangle => [1.0 - xi - eta, xi, eta, 0.0],
            ElementShape::Quadrilateral => SIGNS.map(|[s, t]| 0.25 * (1.0 + s * xi) * (1.0 + t * eta)),
        }
    }

    /// Derivatives dN/dξ of the shape functions with respect to the local coordinates, [-].
    pub fn local_gradients(self, [xi, eta]: [f64; 2]) -> [[f64; 2]; MAX_NODES] {
        match self {
            ElementShape::Triangle => [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0], [0.0; 2]],
            ElementShape::Quadrilateral => {
                SIGNS.map(|[s, t]| [0.25 * s * (1.0 + t * eta), 0.25 * t * (1.0 + s * xi)])
            }
        }
    }

    /// Position x(ξ) of local coordinates, [length].
    pub fn map(self, corners: &[[f64; 2]], xi: [f64; 2]) -> [f64; 2] {
        let mut x = [0.0; 2];
        for (corner, value) in corners.iter().zip(self.values(xi)) {
            x[0] += value * corner[0];
            x[1] += value * corner[1];
        }
        x
    }

    /// Derivatives dx/dξ of the position, `[i][a]` = ∂xᵢ/∂ξₐ, [length].
    pub fn jacobian(self, corners: &[[f64; 2]], xi: [f64; 2]) -> [[f64; 2]; 2] {
        let mut jacobian = [[0.0; 2]; 2];
        for (corner, gradient) in corners.iter().zip(self.local_gradients(xi)) {
            for i in 0..2 {
                for a in 0..2 {
                    jacobian[i][a] += corner[i] * gradient[a];
                }
            }
        }
        jacobian
    }

    /// Derivatives ∂N/∂x of the shape functions with respect to the position, [1/length].
    pub fn gradients(self, corners: &[[f64; 2]], xi: [f64; 2]) -> [[f64; 2]; MAX_NODES] {
        let [[a, b], [c, d]] = self.jacobian(corners, xi);
        let determinant = a * d - b * c;
        self.local_gradients(xi).map(|[u, v]| [(u * d - v * c) / determinant, (v * a - u * b) / determinant])
    }

    /// Local coordinates ξ of a position; the inverse of [`map`](Self::map) in and around the element.
    ///
    /// The map of a triangle is linear and has its inverse everywhere. That of a quadrilateral folds over at some
    /// distance from the element if opposite sides are not parallel: `None` beyond the fold.
    pub fn inverse(self, corners: &[[f64; 2]], x: &[f64; 2]) -> Option<[f64; 2]> {
        let [p, q, r, ..] = *corners else { return None };
        match (self, corners) {
            (ElementShape::Triangle, _) => {
                let (u, v, h) = (minus(q, p), minus(r, p), minus(*x, p));
                let determinant = cross(u, v);
                Some([cross(h, v) / determinant, cross(u, h) / determinant])
            }
            (ElementShape::Quadrilateral, &[_, _, _, s]) => inverse_bilinear([p, q, r, s], *x),
            (ElementShape::Quadrilateral, _) => None,
        }
    }

    /// Area, positive for counterclockwise corners, [length²].
    pub fn area(self, corners: &[[f64; 2]]) -> f64 {
        match (self, corners) {
            (ElementShape::Triangle, [p, q, r, ..]) => 0.5 * cross(minus(*q, *p), minus(*r, *p)),
            (ElementShape::Quadrilateral, [p, q, r, s, ..]) => 0.5 * cross(minus(*r, *p), minus(*s, *q)),
            _ => 0.0,
        }
    }

    /// Centre of mass, [length].
    pub fn centroid(self, corners: &[[f64; 2]]) -> [f64; 2] {
        match (self, corners) {
            (ElementShape::Quadrilateral, [p, q, r, s, ..]) => {
                // Two triangles, each with its area.
                let a = cross(minus(*q, *p), minus(*r, *p));
                let b = cross(minus(*r, *p), minus(*s, *p));
                let (wa, wb) = (a / (3.0 * (a + b)), b / (3.0 * (a + b)));
                std::array::from_fn(|d| {
                    p[d] + wa * (q[d] + r[d] - 2.0 * p[d]) + wb * (r[d] + s[d] - 2.0 * p[d])
                })
            }
            _ => self.map(corners, self.centre()),
        }
    }

    /// Twice the area of the triangle of every corner and its two neighbours: the determinant of the map there, up
    /// to a constant, [length²]. The element is convex and counterclockwise if and only if all are positive.
    pub fn corner_areas(self, corners: &[[f64; 2]]) -> [f64; MAX_NODES] {
        let n = self.n_nodes().min(corners.len());
        std::array::from_fn(|k| {
            if k >= n {
                return 0.0;
            }
            let (here, next, last) = (corners[k], corners[(k + 1) % n], corners[(k + n - 1) % n]);
            cross(minus(next, here), minus(last, here))
        })
    }
}

/// The local coordinates of a position in a quadrilateral.
///
/// With x = p + (1+ξ)/2 b + (1+η)/2 c + (1+ξ)(1+η)/4 d, elimination of ξ leaves a quadratic equation for η. Its
/// derivative at a root is the determinant of the map, so that the root of the element is the one with positive
/// square root: no iteration can go astray. A Newton step removes the round-off of the formula.
fn inverse_bilinear(corners: [[f64; 2]; 4], x: [f64; 2]) -> Option<[f64; 2]> {
    let [p, q, r, s] = corners;
    let (b, c, h) = (minus(q, p), minus(s, p), minus(x, p));
    let d = minus(minus(r, s), b);
    let quadratic = -cross(c, d);
    let linear = cross(h, d) + cross(b, c);
    let constant = cross(h, b);
    let square = linear * linear - 4.0 * quadratic * constant;
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let root = square.sqrt();
    let v =
        if linear >= 0.0 { -2.0 * constant / (linear + root) } else { (root - linear) / (2.0 * quadratic) };
    let along = [b[0] + v * d[0], b[1] + v * d[1]];
    let rest = [h[0] - v * c[0], h[1] - v * c[1]];
    let u = (rest[0] * along[0] + rest[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]);

    let shape = ElementShape::Quadrilateral;
    let mut xi = [2.0 * u - 1.0, 2.0 * v - 1.0];
    let [[j00, j01], [j10, j11]] = shape.jacobian(&corners, xi);
    let error = minus(x, shape.map(&corners, xi));
    let determinant = j00 * j11 - j01 * j10;
    xi[0] += (j11 * error[0] - j01 * error[1]) / determinant;
    xi[1] += (j00 * error[1] - j10 * error[0]) / determinant;
    xi.iter().all(|v| v.is_finite()).then_some(xi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SHAPES: [ElementShape; 2] = [ElementShape::Triangle, ElementShape::Quadrilateral];

    /// The reference quadrilateral with its corners moved, rotated: always convex.
    fn quadrilateral() -> impl Strategy<Value = Vec<[f64; 2]>> {
        let moves = prop::array::uniform4(prop::array::uniform2(-0.45..0.45f64));
        (moves, 0.0..6.3f64, 0.01..100.0f64).prop_map(|(moves, angle, size)| {
            let corner = |k: usize| [SIGNS[k][0] + moves[k][0], SIGNS[k][1] + moves[k][1]];
            let (s, c) = angle.sin_cos();
            (0..4)
                .map(|k| {
                    [
                        size * (c * corner(k)[0] - s * corner(k)[1]),
                        size * (s * corner(k)[0] + c * corner(k)[1]),
                    ]
                })
                .collect()
        })
    }

    #[test]
    fn every_shape_function_is_one_at_its_node_and_zero_at_the_others() {
        for shape in SHAPES {
            for (k, xi) in shape.node_coordinates().iter().enumerate() {
                let value = shape.values(*xi);
                assert!((0..MAX_NODES).all(|j| value[j] == f64::from(u8::from(j == k))));
            }
        }
    }

    #[test]
    fn areas_and_corners_tell_bad_elements() {
        let (square, triangle) = (SIGNS, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]]);
        assert_eq!(ElementShape::Quadrilateral.area(&square), 4.0);
        assert_eq!(ElementShape::Triangle.area(&triangle), 1.0);
        assert_eq!(ElementShape::Quadrilateral.corner_areas(&square), [4.0; 4]);
        let dart = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
        assert!(ElementShape::Quadrilateral.area(&dart) > 0.0);
        assert!(ElementShape::Quadrilateral.corner_areas(&dart)[2] < 0.0);
    }

    #[test]
    fn beyond_its_fold_a_quadrilateral_has_no_local_coordinates() {
        let corners = [[0.0, 0.0], [4.0, 0.0], [3.0, 1.0], [1.0, 2.0]];
        assert_eq!(ElementShape::Quadrilateral.inverse(&corners, &[12.0, 2.0]), None);
        assert_eq!(ElementShape::Quadrilateral.inverse(&corners, &[f64::NAN, 0.0]), None);
    }

    proptest! {
        #[test]
        fn shape_functions_reproduce_linear_fields(corners in quadrilateral(), xi in prop::array::uniform2(-1.2..1.2f64)) {
            for shape in SHAPES {
                let corners = &corners[..shape.n_nodes()];
                let size = shape.area(corners).sqrt();
                let (value, gradient) = (shape.values(xi), shape.gradients(corners, xi));
                prop_assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                for d in 0..2 {
                    prop_assert!(gradient.iter().map(|g| g[d]).sum::<f64>().abs() * size < 1e-12);
                    for e in 0..2 {
                        let slope: f64 = corners.iter().zip(gradient).map(|(x, g)| x[e] * g[d]).sum();
                        prop_assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-12);
                    }
                }
            }
        }

        #[test]
        fn the_inverse_map_goes_back(corners in quadrilateral(), xi in prop::array::uniform2(-1.1..1.1f64)) {
            for shape in SHAPES {
                let corners = &corners[..shape.n_nodes()];
                let [[a, b], [c, d]] = shape.jacobian(corners, xi);
                // Outside the element, the map may already have folded over.
                prop_assume!(a * d - b * c > 1e-3 * shape.area(corners));
                let back = shape.inverse(corners, &shape.map(corners, xi)).unwrap();
                prop_assert!((back[0] - xi[0]).abs() < 1e-11 && (back[1] - xi[1]).abs() < 1e-11, "{back:?} {xi:?}");
            }
        }

        #[test]
        fn gradients_are_derivatives(corners in quadrilateral(), xi in prop::array::uniform2(0.05..0.45f64)) {
            for shape in SHAPES {
                let corners = &corners[..shape.n_nodes()];
                let size = shape.area(corners).sqrt();
                let x = shape.map(corners, xi);
                let gradient = shape.gradients(corners, xi);
                for d in 0..2 {
                    let at = |h: f64| {
                        let mut x = x;
                        x[d] += h * size;
                        shape.values(shape.inverse(corners, &x).unwrap())
                    };
                    let (plus, minus) = (at(1e-5), at(-1e-5));
                    for k in 0..shape.n_nodes() {
                        let numeric = (plus[k] - minus[k]) / 2e-5;
                        prop_assert!((numeric - gradient[k][d] * size).abs() < 1e-7);
                    }
                }
            }
        }

        #[test]
        fn the_centroid_balances(corners in quadrilateral()) {
            let shape = ElementShape::Quadrilateral;
            let (n, mut sum, mut area) = (60, [0.0; 2], 0.0);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let xi = [i, j].map(|k| 2.0 * (f64::from(k) + 0.5) / f64::from(n) - 1.0);
                let ([[a, b], [c, d]], x) = (shape.jacobian(&corners, xi), shape.map(&corners, xi));
                let weight = (a * d - b * c) * 4.0 / f64::from(n * n);
                area += weight;
                sum = [sum[0] + weight * x[0], sum[1] + weight * x[1]];
            }
            let (size, centroid) = (area.sqrt(), shape.centroid(&corners));
            prop_assert!((area / shape.area(&corners) - 1.0).abs() < 1e-12);
            prop_assert!((0..2).all(|d| (sum[d] / area - centroid[d]).abs() < 1e-3 * size));
        }
    }
}
