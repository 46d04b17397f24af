//! An independent, slow and simple implementation: plain loops over points and degrees of freedom into dense arrays,
//! the basis as integrals of hat functions, and the transcribed updated Lagrangian equations in three dimensions with the
//! motion of each degree of freedom as a 3×3 displacement gradient. No groups, batches, sparsity patterns or closed
//! forms.
#![allow(non_snake_case)]

use mpm::assembly::Wanted;
use mpm::basis::{DomainKind, Method};
use mpm::material::{Material, StrainMeasure};
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid, StartOfStep};
use mpm::tensor::{Mat3, Sym3, Tangent, Tensor4, log_with_derivative, mandel_entry};
use mpm::terms::Sum;
use nalgebra::{DMatrix, DVector};

use super::states::{FORMULATIONS, Law, State, cases, graded_random_state, large_random_state, random_state};

/// Hat function of a node at 0 between cells of lengths h below and above it, and its slope.
fn hat([below, above]: [f64; 2], x: f64) -> (f64, f64) {
    let h = if x < 0.0 { below } else { above };
    if x.abs() < h { (1.0 - x.abs() / h, -x.signum() / h) } else { (0.0, 0.0) }
}

/// ∫ hat from −∞ to x.
fn hat_integral([below, above]: [f64; 2], x: f64) -> f64 {
    match x {
        x if x <= -below => 0.0,
        x if x <= 0.0 => 0.5 * below * (1.0 + x / below).powi(2),
        x if x <= above => 0.5 * below + 0.5 * above - 0.5 * above * (1.0 - x / above).powi(2),
        _ => 0.5 * (below + above),
    }
}

/// S and dS/dx along one axis at distance x from the node: the hat function or its mean over [x − l, x + l].
fn basis(method: Method, h: [f64; 2], x: f64, l: f64) -> (f64, f64) {
    match method {
        Method::Mpm => hat(h, x),
        _ => (
            (hat_integral(h, x + l) - hat_integral(h, x - l)) / (2.0 * l),
            (hat(h, x + l).0 - hat(h, x - l).0) / (2.0 * l),
        ),
    }
}

/// Points and weights of the five-point Gauss rule on [0, 1].
fn gauss() -> [(f64, f64); 5] {
    let root = (10.0_f64 / 7.0).sqrt();
    let (near, far) = ((5.0 - 2.0 * root).sqrt() / 3.0, (5.0 + 2.0 * root).sqrt() / 3.0);
    let of = |sign: f64| (322.0 + sign * 13.0 * 70.0_f64.sqrt()) / 900.0;
    [(-far, of(-1.0)), (-near, of(1.0)), (0.0, 128.0 / 225.0), (near, of(1.0)), (far, of(-1.0))]
        .map(|(x, w)| (0.5 * (1.0 + x), 0.5 * w))
}

/// Means over a domain of the shape functions of its corners and of their gradients, by quadrature. N_c is a product of
/// linear functions of the parameters in a quadrilateral or hexahedron, and a linear function in a simplex.
fn means_of_corners<const D: usize>(corners: &[[f64; D]]) -> Vec<(f64, [f64; D])> {
    let simplex = corners.len() == D + 1;
    let functions = |at: [f64; D]| -> Vec<(f64, DVector<f64>)> {
        let of = |c: usize| {
            if simplex {
                let slope = |d: usize| if c == 0 { -1.0 } else { f64::from(u8::from(c == d + 1)) };
                let value = f64::from(u8::from(c == 0)) + (0..D).map(|d| slope(d) * at[d]).sum::<f64>();
                return (value, DVector::from_fn(D, |d, _| slope(d)));
            }
            let along = |d: usize| if c >> d & 1 == 1 { (at[d], 1.0) } else { (1.0 - at[d], -1.0) };
            let product =
                |of: usize| (0..D).map(|d| if d == of { along(d).1 } else { along(d).0 }).product::<f64>();
            (product(D), DVector::from_fn(D, |d, _| product(d)))
        };
        (0..corners.len()).map(of).collect()
    };
    let mut sums: Vec<(f64, DVector<f64>)> = vec![(0.0, DVector::zeros(D)); corners.len()];
    let mut volume = 0.0;
    for number in 0..5_usize.pow(D as u32) {
        let rule: [(f64, f64); D] = std::array::from_fn(|d| gauss()[number / 5_usize.pow(d as u32) % 5]);
        let (mut at, mut collapsed) = (rule.map(|(x, _)| x), 1.0);
        if simplex {
            // Collapse the parameter cube to a simplex, one axis after the other.
            for d in 1..D {
                let left: f64 = 1.0 - at[..d].iter().sum::<f64>();
                at[d] *= left;
                collapsed *= left;
            }
        }
        let found = functions(at);
        let jacobian = DMatrix::from_fn(D, D, |i, j| {
            (0..corners.len()).map(|c| corners[c][i] * found[c].1[j]).sum::<f64>()
        });
        let weight = jacobian.determinant() * collapsed * rule.iter().map(|(_, w)| w).product::<f64>();
        let to_space = jacobian.try_inverse().unwrap().transpose();
        volume += weight;
        for ((value, gradient), (sum, slope)) in found.into_iter().zip(&mut sums) {
            *sum += weight * value;
            *slope += &to_space * gradient * weight;
        }
    }
    sums.into_iter().map(|(s, g)| (s / volume, std::array::from_fn(|d| g[d] / volume))).collect()
}

/// S and ∇S of every node of the grid at a point.
fn basis_of_point<const D: usize>(state: &State<D>, p: usize) -> Vec<(f64, [f64; D])> {
    let State { model, points, .. } = state;
    let grid = model.grid.lines().unwrap();
    let method = model.bodies[points.body[p] as usize].method;
    let corners = points.corners(p);
    let means = if method.domain() == DomainKind::Corners { means_of_corners(corners) } else { Vec::new() };
    let at_node = |node: usize| {
        let place = model.grid.node_position(node);
        let cells = |d: usize| {
            let (axis, line) = (&grid.axes()[d], grid.node_index(node)[d]);
            [line.saturating_sub(1), line.min(axis.n_cells() - 1)].map(|cell| axis.size(cell))
        };
        if !means.is_empty() {
            let (mut value, mut gradient) = (0.0, [0.0; D]);
            for (corner, (mean, slope)) in corners.iter().zip(&means) {
                let here: f64 = (0..D).map(|d| hat(cells(d), corner[d] - place[d]).0).product();
                value += here * mean;
                for d in 0..D {
                    gradient[d] += here * slope[d];
                }
            }
            return (value, gradient);
        }
        let along: [(f64, f64); D] = std::array::from_fn(|d| {
            let x = points.converged.position[p][d] - place[d];
            basis(method, cells(d), x, points.half_lengths(p)[d])
        });
        let product = |of: usize| (0..D).map(|d| if d == of { along[d].1 } else { along[d].0 }).product();
        (product(D), std::array::from_fn(product))
    };
    (0..model.grid.n_nodes()).map(at_node).collect()
}

/// Displacement gradient at a point for a unit motion of each degree of freedom, with index D × node + axis.
pub fn motions_of_point<const D: usize, M: Mechanics<D>>(state: &State<D>, p: usize) -> Vec<(usize, Mat3)> {
    let mut motions = Vec::new();
    for (node, (value, gradient)) in basis_of_point(state, p).into_iter().enumerate() {
        if gradient == [0.0; D] && value == 0.0 {
            continue;
        }
        for i in 0..D {
            let mut motion = Mat3::zeros();
            for j in 0..D {
                motion[(i, j)] = gradient[j];
            }
            if M::REVOLVED && i == 0 {
                motion[(2, 2)] = value / state.points.converged.position[p][0];
            }
            motions.push((D * node + i, motion));
        }
    }
    motions
}

fn delta(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

fn tensor4(entry: impl Fn(usize, usize, usize, usize) -> f64) -> Tensor4<3> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| [0, 1, 2].map(|k| [0, 1, 2].map(|l| entry(i, j, k, l)))))
}

/// Volume, σ and the spatial modulus a of a point, eqs. (A.1)-(A.2) with S_ijkl = σ_il δ_jk, equation by equation.
fn updated(start: &StartOfStep, dF: &Mat3, law: &dyn Material, old: &[f64]) -> (f64, Mat3, Tensor4<3>) {
    let b = Sym3::symmetric_part(&(dF * start.b_n.to_matrix() * dF.transpose()));
    let (strain, L) = match law.strain_measure() {
        StrainMeasure::Logarithmic => {
            let (log_b, L) = log_with_derivative(&b);
            (log_b * 0.5, L)
        }
        StrainMeasure::LeftCauchyGreen => ((b - Sym3::IDENTITY) * 0.5, Tangent::identity()),
    };
    let answer = law.update(&strain, old, &mut old.to_vec()).unwrap();
    let (C, b, dJ) = (answer.tangent * L * 0.5, b.to_matrix(), dF.determinant());
    let J = dJ * start.J_n;
    let sigma = answer.tau.to_matrix() / J;
    let B = tensor4(|p, q, k, l| delta(p, k) * b[(q, l)] + delta(q, k) * b[(p, l)]); // (A.2)
    let sum = |term: &dyn Fn(usize) -> f64| term(0) + term(1) + term(2);
    let CB = tensor4(|i, j, k, l| sum(&|p| sum(&|q| mandel_entry(&C, i, j, p, q) * B[p][q][k][l])));
    let a = tensor4(|i, j, k, l| CB[i][j][k][l] / J - sigma[(i, l)] * delta(j, k)); // (A.1)
    (dJ * start.volume_n, sigma, a)
}

/// f_int and K on all nodes of the grid, eqs. (2)-(6).
fn dense<const D: usize, M: Mechanics<D>>(state: &State<D>) -> (DVector<f64>, DMatrix<f64>) {
    let State { model, points, links, delta_d } = state;
    let n = model.grid.n_nodes();
    let (mut f, mut k) = (DVector::zeros(D * n), DMatrix::zeros(D * n, D * n));
    for p in 0..points.len() {
        let mut motions = motions_of_point::<D, M>(state, p);
        let mut increment = Mat3::identity(); // (7)
        for (degree, motion) in &motions {
            increment +=
                motion * links.seen_by(points.body[p], degree / D).map_or(0.0, |a| delta_d[a][degree % D]);
        }
        let f_n = points.converged.deformation_gradient[p];
        let law = model.law(points, p);
        let start = StartOfStep {
            b_n: law.strain_measure().left_cauchy_green(&points.converged.elastic_strain[p]),
            J_n: f_n.determinant(),
            volume_n: f_n.determinant() * points.original_volume[p],
        };
        let old = &points.converged.history[p * points.history_len..][..law.state_fields().len()];
        let (volume, sigma, a) = updated(&start, &increment, law, old);
        let inverse = increment.try_inverse().unwrap();
        for (_, motion) in &mut motions {
            *motion *= inverse; // (8)
        }
        for (b, motion_b) in &motions {
            let change = Mat3::from_fn(|i, j| {
                (0..9).map(|e| a[i][j][e / 3][e % 3] * motion_b[(e / 3, e % 3)]).sum::<f64>()
            });
            f[*b] += volume * sigma.dot(motion_b);
            for (a, motion_a) in &motions {
                k[(*a, *b)] += volume * motion_a.dot(&change);
            }
        }
    }
    (f, k)
}

/// f_int and K of the program, expanded to all nodes of the grid.
fn assembled<const D: usize, M: Mechanics<D>>(state: &mut State<D>) -> (DVector<f64>, DMatrix<f64>) {
    let State { model, points, links, delta_d } = state;
    let mut sum = Sum::from_model::<M>(&StepContext::first(model, links), points).unwrap();
    sum.evaluate(&StepContext::first(model, links), points, At::new(delta_d), Wanted::Stiffness).unwrap();
    let n = model.grid.n_nodes();
    let place = |active: usize, axis: usize| D * links.active_nodes()[active] as usize + axis;
    let (mut f, mut k) = (DVector::zeros(D * n), DMatrix::zeros(D * n, D * n));
    let mut unit = vec![[0.0; D]; links.n_active()];
    let mut column = unit.clone();
    for b in 0..links.n_active() {
        for m in 0..D {
            f[place(b, m)] = sum.system().internal_force()[b][m];
            unit[b][m] = 1.0;
            sum.system_mut().multiply(&unit, &mut column);
            unit[b][m] = 0.0;
            for (a, entries) in column.iter().enumerate() {
                for (i, entry) in entries.iter().enumerate() {
                    k[(place(a, i), place(b, m))] = *entry;
                }
            }
        }
    }
    (f, k)
}

fn check<const D: usize, M: Mechanics<D>>(state: &mut State<D>, case: &str) {
    let (f, k) = assembled::<D, M>(state);
    let (f_plain, k_plain) = dense::<D, M>(state);
    let error_f = (f - &f_plain).amax() / f_plain.amax();
    let error_k = (k - &k_plain).amax() / k_plain.amax();
    assert!(error_f < 1e-12 && error_k < 1e-12, "{case}: {error_f:e} {error_k:e}");
}

fn check_all<const D: usize, M: Mechanics<D>>(cases: Vec<(Method, Law)>) {
    for (method, law) in cases {
        for formulation in FORMULATIONS {
            for (seed, n_points) in [(1, 7), (2, 60), (3, 300)] {
                let mut state = random_state::<D, M>(method, law, n_points, seed);
                state.model.formulation = formulation;
                check::<D, M>(&mut state, &format!("{method:?} {law:?} {formulation:?} {n_points}"));
                let mut state = graded_random_state::<D, M>(method, law, n_points, seed);
                state.model.formulation = formulation;
                check::<D, M>(&mut state, &format!("graded {method:?} {law:?} {formulation:?} {n_points}"));
            }
        }
    }
}

#[test]
fn internal_force_and_stiffness_equal_those_of_plain_loops() {
    check_all::<2, PlaneStrain>(cases());
}

#[test]
fn internal_force_and_stiffness_of_a_body_of_revolution_equal_those_of_plain_loops() {
    check_all::<2, Axisymmetric>(cases());
}

#[test]
fn internal_force_and_stiffness_in_three_dimensions_equal_those_of_plain_loops() {
    check_all::<3, Solid>(cases());
}

/// The grid has enough groups for several batches.
#[test]
fn batches_are_merged_without_loss() {
    for law in [Law::Both, Law::Skewed] {
        let mut state = large_random_state::<PlaneStrain>(Method::Gimp, law, 3000, 4);
        check::<2, PlaneStrain>(&mut state, &format!("{law:?}"));
    }
}
