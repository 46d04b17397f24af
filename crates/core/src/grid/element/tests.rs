use super::*;
use proptest::prelude::*;

const SHAPES: [ElementShape; 2] = [ElementShape::Simplex, ElementShape::Box];

/// The reference element with its corners moved by up to `by`, then rotated and scaled.
fn distorted<const D: usize>(
    shape: ElementShape,
    moves: &[[f64; 3]],
    by: f64,
    angle: f64,
    size: f64,
) -> Vec<[f64; D]> {
    let (s, c) = angle.sin_cos();
    (0..shape.n_nodes::<D>())
        .map(|k| {
            let mut x: [f64; D] = shape.node_coordinates(k);
            for d in 0..D {
                x[d] += by * moves[k][d];
            }
            for d in 0..D - 1 {
                (x[d], x[d + 1]) = (c * x[d] - s * x[d + 1], s * x[d] + c * x[d + 1]);
            }
            x.map(|x| size * x)
        })
        .collect()
}

fn moves() -> impl Strategy<Value = [[f64; 3]; 8]> {
    prop::array::uniform8(prop::array::uniform3(-1.0..1.0f64))
}

/// Local coordinates in and around an element.
fn local<const D: usize>(shape: ElementShape, t: [f64; 3], beyond: f64) -> [f64; D] {
    std::array::from_fn(|d| match shape {
        ElementShape::Simplex => (1.0 + beyond) * (0.5 + 0.5 * t[d]) / D as f64,
        ElementShape::Box => (1.0 + beyond) * t[d],
    })
}

fn determinant<const D: usize>(shape: ElementShape, corners: &[[f64; D]], xi: [f64; D]) -> f64 {
    adjugate(&shape.jacobian(corners, xi)).1
}

#[test]
fn every_shape_function_is_one_at_its_node_and_zero_at_the_others() {
    fn check<const D: usize>() {
        for shape in SHAPES {
            for k in 0..shape.n_nodes::<D>() {
                let value = shape.values::<D>(shape.node_coordinates(k));
                assert!((0..MAX_NODES).all(|j| value[j] == f64::from(u8::from(j == k))));
            }
            assert_eq!(ElementShape::from_nodes::<D>(shape.n_nodes::<D>()), Some(shape));
        }
        assert_eq!(ElementShape::from_nodes::<D>(6), None);
    }
    check::<2>();
    check::<3>();
}

/// Sides have outward normals: by the divergence theorem, the flux of the position through them is D times the volume.
#[test]
fn sides_close_the_element() {
    for shape in SHAPES {
        let corners: Vec<[f64; 3]> = (0..shape.n_nodes::<3>()).map(|k| shape.node_coordinates(k)).collect();
        let mut volume = 0.0;
        for side in shape.sides::<3>() {
            for k in 1..side.len() - 1 {
                let [a, b, c] = [side[0], side[k], side[k + 1]].map(|n| corners[n]);
                volume += dot(a, vector_product(b, c)) / 6.0;
            }
        }
        assert!((volume - shape.volume(&corners)).abs() < 1e-14);
        let corners: Vec<[f64; 2]> = (0..shape.n_nodes::<2>()).map(|k| shape.node_coordinates(k)).collect();
        let area: f64 = shape.sides::<2>().iter().map(|s| 0.5 * cross(corners[s[0]], corners[s[1]])).sum();
        assert!((area - shape.volume(&corners)).abs() < 1e-14);
    }
}

#[test]
fn volumes_and_corners_tell_bad_elements() {
    let square: Vec<[f64; 2]> = (0..4).map(|k| ElementShape::Box.node_coordinates(k)).collect();
    assert_eq!(ElementShape::Box.volume(&square), 4.0);
    assert_eq!(ElementShape::Simplex.volume(&[[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]]), 1.0);
    assert_eq!(ElementShape::Box.corner_determinants(&square)[..4], [4.0; 4]);
    let dart = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
    assert!(ElementShape::Box.volume(&dart) > 0.0);
    assert!(ElementShape::Box.corner_determinants(&dart)[2] < 0.0);
    let mut cube: Vec<[f64; 3]> = (0..8).map(|k| ElementShape::Box.node_coordinates(k)).collect();
    assert!((ElementShape::Box.volume(&cube) - 8.0).abs() < 1e-14);
    let tetrahedron = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
    assert_eq!(ElementShape::Simplex.volume(&tetrahedron), 1.0);
    cube[6] = [-0.5, -0.5, -0.5];
    assert!(ElementShape::Box.volume(&cube) > 0.0);
    assert!(ElementShape::Box.corner_determinants(&cube)[6] < 0.0);
}

/// A hexahedron with a positive determinant at all corners but not at half height.
#[test]
fn folds_between_the_corners_are_found() {
    let cube: Vec<[f64; 3]> = (0..8).map(|k| ElementShape::Box.node_coordinates(k)).collect();
    assert!(!folds(&cube, 0.0));
    assert!(folds(&cube, 1.0), "the determinant is 1 everywhere");
    // The top is rotated by 180° about the axis: folded only at half height.
    let mut turned = cube.clone();
    for k in 4..8 {
        turned[k] = [-cube[k][0], -cube[k][1], cube[k][2]];
    }
    assert!(ElementShape::Box.corner_determinants(&turned).iter().all(|d| *d > 0.0));
    assert!(folds(&turned, 0.0));
    // With a slightly smaller rotation, it does not fold.
    let (s, c) = 2.9f64.sin_cos();
    for k in 4..8 {
        turned[k] = [c * cube[k][0] - s * cube[k][1], s * cube[k][0] + c * cube[k][1], 1.0];
    }
    assert!(!folds(&turned, 0.0));
    assert!(folds(&[[f64::NAN; 3]; 8], 0.0));
}

#[test]
fn beyond_its_fold_an_element_has_no_local_coordinates() {
    let corners = [[0.0, 0.0], [4.0, 0.0], [3.0, 1.0], [1.0, 2.0]];
    assert_eq!(ElementShape::Box.inverse(&corners, &[12.0, 2.0]), None);
    assert_eq!(ElementShape::Box.inverse(&corners, &[f64::NAN, 0.0]), None);
    let mut wedge: Vec<[f64; 3]> = (0..8).map(|k| ElementShape::Box.node_coordinates(k)).collect();
    for k in 4..8 {
        wedge[k][0] *= 0.2;
    }
    // The fold is at z = 1.5.
    assert_eq!(ElementShape::Box.inverse(&wedge, &[0.3, 0.2, 1.8]), None);
    assert!(ElementShape::Box.inverse(&wedge, &[0.01, 0.2, 1.4]).is_some());
    assert_eq!(ElementShape::Box.inverse(&wedge, &[f64::INFINITY, 0.0, 0.0]), None);
}

fn reproduces_linear_fields<const D: usize>(m: &[[f64; 3]], angle: f64, size: f64, t: [f64; 3]) {
    for shape in SHAPES {
        let corners = distorted::<D>(shape, m, 0.2, angle, size);
        let xi = local(shape, t, 0.2);
        let (value, gradient) = (shape.values(xi), shape.gradients(&corners, xi));
        assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        for d in 0..D {
            assert!(gradient.iter().map(|g| g[d]).sum::<f64>().abs() * size < 1e-11);
            for e in 0..D {
                let slope: f64 = corners.iter().zip(gradient).map(|(x, g)| x[e] * g[d]).sum();
                assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-11);
            }
        }
    }
}

fn inverse_goes_back<const D: usize>(m: &[[f64; 3]], angle: f64, size: f64, t: [f64; 3]) {
    for shape in SHAPES {
        let corners = distorted::<D>(shape, m, 0.4, angle, size);
        let xi = local::<D>(shape, t, 0.1);
        // Hexahedra with such corners may fold; outside the element, the map may have folded over.
        let bad = shape == ElementShape::Box && D == 3 && {
            let corners: Vec<[f64; 3]> = corners.iter().map(|x| [x[0], x[1], x[D - 1]]).collect();
            folds(&corners, 1e-3 * size.powi(3))
        };
        if bad || determinant(shape, &corners, xi) < 1e-3 * shape.volume(&corners) {
            continue;
        }
        let back = shape.inverse(&corners, &shape.map(&corners, xi)).expect("inside");
        assert!((0..D).all(|d| (back[d] - xi[d]).abs() < 1e-10), "{shape:?} {back:?} {xi:?}");
    }
}

fn gradients_are_derivatives<const D: usize>(m: &[[f64; 3]], angle: f64, size: f64, t: [f64; 3]) {
    for shape in SHAPES {
        let corners = distorted::<D>(shape, m, 0.2, angle, size);
        let xi = local::<D>(shape, t, -0.1);
        let (x, gradient) = (shape.map(&corners, xi), shape.gradients(&corners, xi));
        for d in 0..D {
            let at = |h: f64| {
                let mut x = x;
                x[d] += h * size;
                shape.values(shape.inverse(&corners, &x).expect("inside"))
            };
            let (plus, minus) = (at(1e-5), at(-1e-5));
            for k in 0..shape.n_nodes::<D>() {
                let numeric = (plus[k] - minus[k]) / 2e-5;
                assert!((numeric - gradient[k][d] * size).abs() < 1e-6);
            }
        }
    }
}

/// Compares volume and centroid with a sum over many parts.
fn the_centroid_balances<const D: usize>(m: &[[f64; 3]], angle: f64, size: f64) {
    let shape = ElementShape::Box;
    let corners = distorted::<D>(shape, m, 0.2, angle, size);
    let n: usize = if D == 2 { 60 } else { 24 };
    let (mut sum, mut volume) = ([0.0; D], 0.0);
    for k in 0..n.pow(D as u32) {
        let index: [usize; D] = std::array::from_fn(|d| k / n.pow(d as u32) % n);
        let xi = index.map(|i| 2.0 * (i as f64 + 0.5) / n as f64 - 1.0);
        let weight = determinant(shape, &corners, xi) * (2.0 / n as f64).powi(D as i32);
        volume += weight;
        let x = shape.map(&corners, xi);
        for d in 0..D {
            sum[d] += weight * x[d];
        }
    }
    let centroid = shape.centroid(&corners);
    assert!((volume / shape.volume(&corners) - 1.0).abs() < 2e-3);
    assert!((0..D).all(|d| (sum[d] / volume - centroid[d]).abs() < 2e-3 * size));
}

proptest! {
    #[test]
    fn shape_functions_reproduce_linear_fields(
        m in moves(), angle in 0.0..6.3f64, size in 0.01..100.0f64, t in prop::array::uniform3(-1.0..1.0f64)
    ) {
        reproduces_linear_fields::<2>(&m, angle, size, t);
        reproduces_linear_fields::<3>(&m, angle, size, t);
    }

    #[test]
    fn the_inverse_map_goes_back(
        m in moves(), angle in 0.0..6.3f64, size in 0.01..100.0f64, t in prop::array::uniform3(-1.0..1.0f64)
    ) {
        inverse_goes_back::<2>(&m, angle, size, t);
        inverse_goes_back::<3>(&m, angle, size, t);
    }

    #[test]
    fn gradients_of_shape_functions_are_derivatives(
        m in moves(), angle in 0.0..6.3f64, size in 0.01..100.0f64, t in prop::array::uniform3(-1.0..1.0f64)
    ) {
        gradients_are_derivatives::<2>(&m, angle, size, t);
        gradients_are_derivatives::<3>(&m, angle, size, t);
    }

    #[test]
    fn centroids_balance(m in moves(), angle in 0.0..6.3f64, size in 0.01..100.0f64) {
        the_centroid_balances::<2>(&m, angle, size);
        the_centroid_balances::<3>(&m, angle, size);
    }

    /// Every hexahedron with a negative determinant anywhere is refused; every clearly valid hexahedron is accepted.
    #[test]
    fn folds_agree_with_a_dense_look(m in moves(), by in 0.2..0.9f64) {
        let corners = distorted::<3>(ElementShape::Box, &m, by, 0.0, 1.0);
        let n = 16;
        let at = |k: usize| 2.0 * k as f64 / n as f64 - 1.0;
        let mut least = f64::INFINITY;
        for (i, j, k) in (0..=n).flat_map(|i| (0..=n).flat_map(move |j| (0..=n).map(move |k| (i, j, k)))) {
            least = least.min(determinant(ElementShape::Box, &corners, [at(i), at(j), at(k)]));
        }
        if least <= 0.0 {
            prop_assert!(folds(&corners, 0.0));
        } else if least > 0.02 {
            prop_assert!(!folds(&corners, 0.0));
        }
    }
}
