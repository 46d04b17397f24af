//! A slow, obvious second implementation: plain loops over points and nodes into dense arrays, the basis as integrals
//! of hat functions, the kernel in three dimensions; no groups, batches, patterns or closed forms.

use mpm::assembly::System;
use mpm::basis::{DomainKind, Method};
use mpm::grid::Grid;
use mpm::stress::{Formulation, Mechanics, PlaneStrain, Solid, StartOfStep};
use mpm::tensor::Mat3;
use nalgebra::{DMatrix, DVector};

use crate::states::{CASES, FORMULATIONS, Law, State, large_random_state, random_state};

/// The hat function of a node at 0 with cells of length h, and its slope.
fn hat(h: f64, x: f64) -> (f64, f64) {
    if x.abs() < h { (1.0 - x.abs() / h, -x.signum() / h) } else { (0.0, 0.0) }
}

/// ∫ hat from −∞ to x.
fn hat_integral(h: f64, x: f64) -> f64 {
    match x / h {
        xi if xi <= -1.0 => 0.0,
        xi if xi <= 0.0 => 0.5 * h * (1.0 + xi).powi(2),
        xi if xi <= 1.0 => h - 0.5 * h * (1.0 - xi).powi(2),
        _ => h,
    }
}

/// S and dS/dx along one axis at distance x from the node: the hat function, or its mean over [x − l, x + l].
fn basis(method: Method, h: f64, x: f64, l: f64) -> (f64, f64) {
    match method {
        Method::Mpm => hat(h, x),
        _ => (
            (hat_integral(h, x + l) - hat_integral(h, x - l)) / (2.0 * l),
            (hat(h, x + l).0 - hat(h, x - l).0) / (2.0 * l),
        ),
    }
}

/// ∇S of a node for a quadrilateral domain: by the divergence theorem (1/V) ∫ ∇N_c dV is half the normal of the
/// diagonal between the neighbours of corner c.
fn corner_gradient(corners: &[[f64; 2]], node: [f64; 2], h: [f64; 2]) -> [f64; 2] {
    let ring = [corners[0], corners[1], corners[3], corners[2]];
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let area: f64 = (0..4).map(|k| 0.5 * cross(ring[k], ring[(k + 1) % 4])).sum();
    let mut gradient = [0.0; 2];
    for k in 0..4 {
        let (before, after) = (ring[(k + 3) % 4], ring[(k + 1) % 4]);
        let value = hat(h[0], ring[k][0] - node[0]).0 * hat(h[1], ring[k][1] - node[1]).0;
        gradient[0] += value * (after[1] - before[1]) / (2.0 * area);
        gradient[1] -= value * (after[0] - before[0]) / (2.0 * area);
    }
    gradient
}

/// f_int and K on all nodes of the grid, eqs. (19)-(23) or (2)-(6).
fn dense(state: &State) -> (DVector<f64>, DMatrix<f64>) {
    let State { model, points, links, delta_d } = state;
    let grid = model.grid.structured().unwrap();
    let n = grid.n_nodes();
    let (mut f, mut k) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
    for p in 0..points.len() {
        let body = &model.bodies[points.body[p] as usize];
        let gradients: Vec<[f64; 2]> = (0..n)
            .map(|node| {
                let place = grid.node_position(node);
                if body.method.domain() == DomainKind::Corners {
                    return corner_gradient(points.corners(p), place, grid.spacing());
                }
                let along = |d: usize| {
                    let x = points.converged.position[p][d] - place[d];
                    basis(body.method, grid.spacing()[d], x, points.converged.half_lengths[p][d])
                };
                let ((sx, dx), (sy, dy)) = (along(0), along(1));
                [dx * sy, sx * dy]
            })
            .collect();
        let mut increment = Mat3::identity();
        for (node, g) in gradients.iter().enumerate() {
            let du = links.active_number(node).map_or([0.0; 2], |a| delta_d[a]);
            for i in 0..2 {
                for j in 0..2 {
                    increment[(i, j)] += du[i] * g[j]; // (7)
                }
            }
        }
        let f_n = points.converged.deformation_gradient[p];
        let start = StartOfStep {
            b_n: points.converged.elastic_strain[p].map_eigenvalues(|e| (2.0 * e).exp()),
            J_n: f_n.determinant(),
            volume_n: f_n.determinant() * points.original_volume[p],
        };
        let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| increment[(i, j)]));
        let law = model.materials[body.material].law.as_ref();
        let old = &points.converged.history[p * points.history_len..][..law.state_fields().len()];
        let c = Solid::respond(model.formulation, &start, &rows, law, old, &mut old.to_vec()).unwrap();
        let gradients: Vec<[f64; 2]> = match model.formulation {
            Formulation::PreviouslyConverged => gradients,
            Formulation::UpdatedLagrangian => {
                let inverse = increment.try_inverse().unwrap(); // (8)
                let map = |g: &[f64; 2]| [0, 1].map(|j| g[0] * inverse[(0, j)] + g[1] * inverse[(1, j)]);
                gradients.iter().map(map).collect()
            }
        };
        for (a, ga) in gradients.iter().enumerate().filter(|(_, g)| **g != [0.0; 2]) {
            for i in 0..2 {
                for j in 0..2 {
                    f[2 * a + i] += c.volume * c.stress[i][j] * ga[j];
                }
            }
            for (b, gb) in gradients.iter().enumerate().filter(|(_, g)| **g != [0.0; 2]) {
                for i in 0..2 {
                    for m in 0..2 {
                        for j in 0..2 {
                            for l in 0..2 {
                                k[(2 * a + i, 2 * b + m)] += c.volume * ga[j] * c.tangent[i][j][m][l] * gb[l];
                            }
                        }
                    }
                }
            }
        }
    }
    (f, k)
}

/// f_int and K of the program, spread over all nodes of the grid.
fn assembled(state: &mut State) -> (DVector<f64>, DMatrix<f64>) {
    let State { model, points, links, delta_d } = state;
    let mut system = System::new::<PlaneStrain>(model, points, links);
    system.assemble::<PlaneStrain>(model, points, links, delta_d).unwrap();
    let n = model.grid.n_nodes();
    let place = |active: usize, axis: usize| 2 * links.active_nodes()[active] as usize + axis;
    let (mut f, mut k) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
    let mut unit = vec![[0.0; 2]; links.n_active()];
    let mut column = unit.clone();
    for b in 0..links.n_active() {
        for m in 0..2 {
            f[place(b, m)] = system.internal_force()[b][m];
            unit[b][m] = 1.0;
            system.multiply(&unit, &mut column);
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

fn check(state: &mut State, case: &str) {
    let (f, k) = assembled(state);
    let (f_plain, k_plain) = dense(state);
    let error_f = (f - &f_plain).amax() / f_plain.amax();
    let error_k = (k - &k_plain).amax() / k_plain.amax();
    assert!(error_f < 1e-12 && error_k < 1e-12, "{case}: {error_f:e} {error_k:e}");
}

#[test]
fn internal_force_and_stiffness_equal_those_of_plain_loops() {
    for (method, law) in CASES {
        for formulation in FORMULATIONS {
            for (seed, n_points) in [(1, 7), (2, 60), (3, 300)] {
                let mut state = random_state(method, law, n_points, seed);
                state.model.formulation = formulation;
                check(&mut state, &format!("{method:?} {law:?} {formulation:?} {n_points}"));
            }
        }
    }
}

/// A grid with enough groups for several batches.
#[test]
fn batches_are_merged_without_loss() {
    for law in [Law::Both, Law::Skewed] {
        check(&mut large_random_state(Method::Gimp, law, 3000, 4), &format!("{law:?}"));
    }
}
