use super::*;
use proptest::prelude::*;

/// Eight-point Gauss rule on [−1, 1].
const GAUSS: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    (-0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (-0.525_532_409_916_329, 0.313_706_645_877_887_27),
    (-0.183_434_642_495_649_8, 0.362_683_783_378_361_96),
    (0.183_434_642_495_649_8, 0.362_683_783_378_361_96),
    (0.525_532_409_916_329, 0.313_706_645_877_887_27),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// A unit square or cube with displaced corners.
fn distorted<const D: usize>(moves: &[[f64; 3]], by: f64) -> Vec<[f64; D]> {
    (0..1usize << D)
        .map(|c| {
            let side = corner_side::<D>(c);
            std::array::from_fn(|d| 0.5 * side[d] + by * moves[c][d])
        })
        .collect()
}

fn moves() -> impl Strategy<Value = [[f64; 3]; 8]> {
    prop::array::uniform8(prop::array::uniform3(-1.0..1.0f64))
}

/// Weights and volume of a box, computed with eight Gauss points per axis: exact up to degree fifteen.
fn by_quadrature<const D: usize>(corners: &[[f64; D]]) -> (CornerWeights<D>, f64) {
    let mut weights = CornerWeights { value: [0.0; 8], gradient: [[0.0; D]; 8] };
    let mut volume = 0.0;
    for k in 0..8usize.pow(D as u32) {
        let at: [(f64, f64); D] = std::array::from_fn(|d| GAUSS[k >> (3 * d) & 7]);
        let xi = at.map(|(xi, _)| xi);
        let j = jacobian(corners, &xi);
        let inverse = j.try_inverse().unwrap();
        let dv = at.iter().map(|(_, weight)| weight).product::<f64>() * j.determinant();
        volume += dv;
        for c in 0..corners.len() {
            let (n, slope) = box_shape(c, &xi);
            weights.value[c] += n * dv;
            for i in 0..D {
                weights.gradient[c][i] += (0..D).map(|a| slope[a] * inverse[(a, i)]).sum::<f64>() * dv;
            }
        }
    }
    weights.value = weights.value.map(|w| w / volume);
    weights.gradient = weights.gradient.map(|g| g.map(|g| g / volume));
    (weights, volume)
}

fn check_box<const D: usize>(corners: &[[f64; D]]) {
    let weights = CornerWeights::new(corners).unwrap();
    let (exact, volume) = by_quadrature(corners);
    assert!((domain_volume(corners) - volume).abs() < 1e-13);
    for c in 0..corners.len() {
        assert!((weights.value[c] - exact.value[c]).abs() < 1e-13);
        for i in 0..D {
            assert!((weights.gradient[c][i] - exact.gradient[c][i]).abs() < 1e-11);
        }
    }
    conforms(corners, &weights);
}

/// Checks Σ w_c = 1, Σ g_c = 0, Σ g_c ⊗ x_c = I.
fn conforms<const D: usize>(corners: &[[f64; D]], weights: &CornerWeights<D>) {
    let n = corners.len();
    assert!((weights.value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    for i in 0..D {
        assert!(weights.gradient.iter().map(|g| g[i]).sum::<f64>().abs() < 1e-11);
        for j in 0..D {
            let sum: f64 = (0..n).map(|c| weights.gradient[c][i] * corners[c][j]).sum();
            assert!((sum - f64::from(u8::from(i == j))).abs() < 1e-11);
        }
    }
}

/// The force of a uniform unit pressure on the sides of a pyramid or wedge, at its corners, by the rule of surfaces:
/// the mean over the corners of a triangle, and over both divisions of a quadrilateral.
fn forces_on_sides(shape: Collapsed, corners: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut forces = vec![[0.0; 3]; corners.len()];
    for side in shape.sides() {
        let divisions: &[[usize; 3]] = match side.len() {
            4 => &[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]],
            _ => &[[0, 1, 2]],
        };
        for triangle in divisions {
            let [a, b, c] = triangle.map(|k| side[k]);
            let edge = |k: usize| -> [f64; 3] { std::array::from_fn(|d| corners[k][d] - corners[a][d]) };
            let (u, v) = (edge(b), edge(c));
            let share = if side.len() == 4 { 0.5 } else { 1.0 } / 6.0;
            for corner in [a, b, c] {
                for i in 0..3 {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    forces[corner][i] += share * (u[j] * v[k] - u[k] * v[j]);
                }
            }
        }
    }
    forces
}

const PYRAMID: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.1], [1.0, 0.1, 0.0], [1.2, 0.9, 0.2], [-0.1, 1.0, 0.0], [0.4, 0.5, 0.8]];
const WEDGE: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.1], [0.1, 1.0, 0.0], [1.0, 0.1, -0.1], [0.0, 0.1, 0.9], [-0.1, 1.1, 1.0], [0.9, 0.0, 1.2]];

#[test]
fn pyramids_and_wedges_balance_the_pressure_on_their_sides() {
    for corners in [&PYRAMID[..], &WEDGE[..]] {
        let shape = Collapsed::from_corners::<3>(corners.len()).unwrap();
        let (weights, volume) = (CornerWeights::new(corners).unwrap(), domain_volume(corners));
        conforms(corners, &weights);
        for (corner, force) in forces_on_sides(shape, corners).iter().enumerate() {
            for d in 0..3 {
                assert!((volume * weights.gradient[corner][d] - force[d]).abs() < 1e-14, "{corner} {d}");
            }
        }
        // A corner pushed through the domain.
        let mut inverted = corners.to_vec();
        inverted[corners.len() - 1] = corners[0].map(|x| x - 1.0);
        assert!(CornerWeights::new(&inverted).is_err());
    }
}

/// Weights of a simplex, computed as a box with coincident corners: each w_c is the sum over the corners that coincide.
/// None of the eight Gauss points per axis lies on a degenerate side.
fn check_simplex<const D: usize>(simplex: &[[f64; D]]) {
    let weights = CornerWeights::new(simplex).unwrap();
    // The highest set bit of c selects the corner of the simplex.
    let place = |c: usize| (0..D).rev().find(|d| c >> d & 1 == 1).map_or(0, |d| d + 1);
    let corners: Vec<[f64; D]> = (0..1 << D).map(|c| simplex[place(c)]).collect();
    let (collapsed, volume) = by_quadrature(&corners);
    assert!((domain_volume(simplex) - volume).abs() < 1e-13 * volume.abs().max(1.0));
    for k in 0..=D {
        let at = |c: &usize| place(*c) == k;
        let value: f64 = (0..1 << D).filter(at).map(|c| collapsed.value[c]).sum();
        assert!((weights.value[k] - value).abs() < 1e-13, "{value}");
        for i in 0..D {
            let gradient: f64 = (0..1 << D).filter(at).map(|c| collapsed.gradient[c][i]).sum();
            assert!((weights.gradient[k][i] - gradient).abs() < 1e-10 * (1.0 + gradient.abs()));
        }
    }
    conforms(simplex, &weights);
}

proptest! {
    #[test]
    fn weights_are_the_integrals_over_the_quadrilateral(m in moves()) {
        let corners = distorted::<2>(&m, 0.27);
        check_box(&corners);
        // By the divergence theorem, the gradients follow from the boundary polygon.
        let (weights, volume) = (CornerWeights::new(&corners).unwrap(), domain_volume(&corners));
        let ring = [0, 1, 3, 2];
        for k in 0..4 {
            let (before, after) = (corners[ring[(k + 3) % 4]], corners[ring[(k + 1) % 4]]);
            let g = weights.gradient[ring[k]];
            prop_assert!((g[0] - (after[1] - before[1]) / (2.0 * volume)).abs() < 1e-12);
            prop_assert!((g[1] + (after[0] - before[0]) / (2.0 * volume)).abs() < 1e-12);
        }
    }

    #[test]
    fn weights_are_the_integrals_over_the_hexahedron(m in moves()) {
        check_box(&distorted::<3>(&m, 0.2));
    }

    /// Flux of N_c through the bilinear faces (divergence theorem), computed by quadrature.
    #[test]
    fn gradients_of_a_hexahedron_are_fluxes_through_its_faces(m in moves()) {
        let corners = distorted::<3>(&m, 0.2);
        let (weights, volume) = (CornerWeights::new(&corners).unwrap(), domain_volume(&corners));
        let mut flux = [[0.0; 3]; 8];
        for (axis, sign) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            for (s, t) in GAUSS.iter().flat_map(|s| GAUSS.iter().map(move |t| (s, t))) {
                let mut xi = [sign; 3];
                (xi[b], xi[c]) = (s.0, t.0);
                let j = jacobian(&corners, &xi);
                let normal = j.column(b).cross(&j.column(c)) * (sign * s.1 * t.1);
                for (k, flux) in flux.iter_mut().enumerate() {
                    let (value, _) = box_shape(k, &xi);
                    (0..3).for_each(|i| flux[i] += value * normal[i]);
                }
            }
        }
        for k in 0..8 {
            prop_assert!((0..3).all(|i| (weights.gradient[k][i] - flux[k][i] / volume).abs() < 1e-11));
        }
    }

    #[test]
    fn weights_are_the_integrals_over_a_simplex(m in moves()) {
        let triangle = [[0.0, 0.0], [1.0, 0.1], [-0.2, 1.0]];
        let moved: Vec<[f64; 2]> =
            (0..3).map(|k| [triangle[k][0] + 0.2 * m[k][0], triangle[k][1] + 0.2 * m[k][1]]).collect();
        check_simplex(&moved);
        let tetrahedron = [[0.0; 3], [1.0, 0.1, 0.0], [-0.2, 1.0, 0.1], [0.3, 0.3, 1.0]];
        let moved: Vec<[f64; 3]> =
            (0..4).map(|k| std::array::from_fn(|d| tetrahedron[k][d] + 0.2 * m[k][d])).collect();
        check_simplex(&moved);
    }
}

#[test]
fn inverted_and_bow_tie_domains_are_refused() {
    let square: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    assert!(CornerWeights::new(&square).is_ok());
    let inverted = [square[1], square[0], square[3], square[2]];
    assert!(CornerWeights::new(&inverted).is_err());
    let bow_tie = [square[0], square[1], square[3], square[2]];
    assert!(CornerWeights::new(&bow_tie).is_err());
    assert!(CornerWeights::new(&[[f64::NAN; 2]; 4]).is_err());
    assert!(CornerWeights::new(&[[1.0; 2]; 4]).is_err());
    let arrow = [square[0], square[1], square[2], [0.3, 0.3]];
    assert!(CornerWeights::new(&arrow).is_ok());
    assert!(CornerWeights::new(&square[..3]).is_ok(), "a triangle");
    assert!(CornerWeights::new(&[square[0], square[2], square[1]]).is_err(), "an inverted triangle");
    assert!(CornerWeights::new(&square[..2]).is_err());
}

#[test]
fn inverted_and_crossing_hexahedra_are_refused() {
    let cube: Vec<[f64; 3]> = (0..8).map(corner_side).collect();
    let is_refused = |corners: &[[f64; 3]]| CornerWeights::new(corners).is_err();
    let moved = |places: &[(usize, [f64; 3])]| {
        let mut corners = cube.clone();
        places.iter().for_each(|(k, x)| corners[*k] = *x);
        corners
    };
    assert!(!is_refused(&cube));
    assert!(!is_refused(&moved(&[(7, [-0.4, -0.4, -0.4])])), "one reflex corner");
    for axis in 0..3 {
        // Extruded arrowheads, which are valid in the plane as well.
        let (a, b) = (7 & !(1 << axis), 7);
        let mut tip = [-0.4; 3];
        tip[axis] = -1.0;
        let low = tip;
        tip[axis] = 1.0;
        assert!(!is_refused(&moved(&[(a, low), (b, tip)])));
        assert!(is_refused(&moved(&[(a, cube[b]), (b, cube[a])])), "a face that is a bow-tie");
    }
    assert!(is_refused(&moved(&[(7, [-0.4; 3]), (0, [0.4; 3])])), "opposite corners");
    let turned: Vec<_> = (0..8).map(|k| cube[if k < 4 { k } else { k ^ 3 }]).collect();
    assert!(
        CornerWeights::new(&turned).is_ok(),
        "a top turned by a half still has a positive map off the axis"
    );
    let mirrored: Vec<_> = (0..8).map(|k| cube[if k < 4 { k } else { k ^ 1 }]).collect();
    assert!(is_refused(&mirrored), "a top inside out");
    let inverted: Vec<_> = (0..8).map(|k| cube[k ^ 1]).collect();
    assert!(is_refused(&inverted));
    assert!(is_refused(&[[1.0; 3]; 8]) && is_refused(&[[f64::NAN; 3]; 8]));
    let tetrahedron = [cube[0], cube[1], cube[2], cube[4]];
    assert!(!is_refused(&tetrahedron));
    assert!(is_refused(&[cube[1], cube[0], cube[2], cube[4]]));
    assert!(is_refused(&[cube[0], cube[1], cube[2], cube[3]]), "a flat tetrahedron");
}

/// A domain with one side outside the grid, by up to the allowed distance, still reproduces linear fields exactly.
#[test]
fn a_corner_just_outside_the_grid_loses_nothing() {
    use crate::grid::Structured;
    let grid = Structured::<2>::new([0.0; 2], [0.5, 0.5], [4, 4]);
    let support = |outside: f64| {
        let (low, high) = (-0.5 * outside, 0.3);
        let corners = [[low, 0.6], [high, 0.6], [low, 0.9], [high, 0.9]];
        let position = [0.5 * (low + high), 0.75];
        let cell = grid.locate(&position, None).unwrap();
        let point = PointGeometry { position: &position, half_lengths: &[0.0; 2], corners: &corners, cell };
        let mut support = Support::default();
        Cpdi.support(&grid, &point, &mut support).map(|()| (position, support))
    };
    for outside in [0.0, 1e-5, 0.0499, 0.499] {
        let (position, support) = support(outside).unwrap();
        let mut sums = ([0.0; 3], [[0.0; 2]; 3]);
        for (k, &node) in support.nodes.iter().enumerate() {
            let x = grid.node_position(node as usize);
            for (f, field) in [1.0, x[0], x[1]].into_iter().enumerate() {
                sums.0[f] += support.value[k] * field;
                (0..2).for_each(|d| sums.1[f][d] += support.gradient[k][d] * field);
            }
        }
        for (f, (value, gradient)) in
            [(1.0, [0.0, 0.0]), (position[0], [1.0, 0.0]), (position[1], [0.0, 1.0])].into_iter().enumerate()
        {
            assert!((sums.0[f] - value).abs() < 1e-14, "{outside}: {sums:?}");
            assert!((0..2).all(|d| (sums.1[f][d] - gradient[d]).abs() < 1e-13), "{outside}: {sums:?}");
        }
    }
    assert!(matches!(support(0.501), Err(SupportError::CornerOffGrid { corner: 0, .. })));
}
