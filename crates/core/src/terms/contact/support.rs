//! Stiffness that supports free tools whose contact points all slide with friction.
//!
//! As long as no contact point sticks, friction does not resist further motion along the surface: the equations of the
//! tool may be singular. The motions v of a tool without rates of approach, n · v = 0 at all contact points, are
//! therefore given the stiffness of the cells below along the surface. With the rates v_j of the free components j, and
//! the stiffness k of the cells,
//!
//! N_ij = Σ k (n · v_i)(n · v_j),  T_ij = Σ k v_i · (I − n⊗n) v_j,
//!
//! these are the motions with N z = λ (N + T) z and λ = 0. Motions with small λ are supported in part, those that the
//! contact points hold by their pressure not at all, so the support does not depend on the place to which the motion of
//! the tool refers.

use nalgebra::{DMatrix, SymmetricEigen};

use super::candidates::Candidate;
use super::evaluation::{Trial, first_unknowns};
use super::motion::Moving;
use crate::assembly::System;
use crate::ranks::Reduction;
use crate::region::vector::{along, dot};

/// λ at which the support vanishes, [-].
const HELD: f64 = 1e-3;
/// Share of the largest entry on the diagonal of N + T that is added to the diagonal, [-]: components that move no
/// contact point have no entries.
const RIDGE: f64 = 1e-12;

/// Adds the support of the tools that have no contact point that sticks; `holds` tells which tools have one. All ranks
/// must call this together.
pub(super) fn support_sliding<const D: usize, const N: usize>(
    tools: &[Moving<D>],
    pairs: &[(&Candidate<D>, &Trial<D>)],
    holds: &[bool],
    reduction: &Reduction,
    sum: &mut System<N>,
) {
    let first = first_unknowns(tools);
    for (tool, moving) in tools.iter().enumerate().filter(|(tool, _)| !holds[*tool]) {
        let unknown: Vec<usize> = (0..moving.free.len()).filter(|j| !moving.follows[*j]).collect();
        if unknown.is_empty() {
            continue;
        }
        let [mut approach, mut slide] = rates(moving, &unknown, tool, pairs);
        reduction.sum(approach.as_mut_slice());
        reduction.sum(slide.as_mut_slice());
        if !reduction.counts_globals() {
            continue;
        }
        let Some(support) = unheld(&approach, &slide) else { continue };
        for (i, &row) in unknown.iter().enumerate() {
            for (j, &column) in unknown.iter().enumerate() {
                sum.border.add_support(first[tool] + row, first[tool] + column, support[(i, j)]);
            }
        }
    }
}

/// N and T over the contact points of this rank that touch a tool.
fn rates<const D: usize>(
    moving: &Moving<D>,
    unknown: &[usize],
    tool: usize,
    pairs: &[(&Candidate<D>, &Trial<D>)],
) -> [DMatrix<f64>; 2] {
    let n = unknown.len();
    let [mut approach, mut slide] = [(); 2].map(|()| DMatrix::zeros(n, n));
    for (candidate, trial) in pairs.iter().filter(|(candidate, _)| candidate.key.tool as usize == tool) {
        let Some(touch) = &trial.touch else { continue };
        let normal = touch.normal();
        let velocities: Vec<[f64; D]> =
            unknown.iter().map(|&j| moving.velocity(moving.free[j], &trial.position).0).collect();
        for (i, v) in velocities.iter().enumerate() {
            for (j, w) in velocities.iter().enumerate() {
                let both = dot(v, &normal) * dot(w, &normal);
                let across = dot(&along(v, -dot(v, &normal), &normal), w);
                approach[(i, j)] += candidate.stiffness * both;
                slide[(i, j)] += candidate.stiffness * across;
            }
        }
    }
    [approach, slide]
}

/// The support for N and T; `None` if no contact point touches.
fn unheld(approach: &DMatrix<f64>, slide: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut whole = approach + slide;
    let ridge = RIDGE * whole.diagonal().max();
    (0..whole.nrows()).for_each(|i| whole[(i, i)] += ridge);
    let lower = whole.cholesky()?.l();
    let half = lower.solve_lower_triangular(approach)?;
    let relative = lower.solve_lower_triangular(&half.transpose())?;
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(relative);
    let motions = &lower * eigenvectors;
    let mut support = DMatrix::zeros(approach.nrows(), approach.nrows());
    for (motion, held) in motions.column_iter().zip(eigenvalues.iter()) {
        let share = (1.0 - held / HELD).max(0.0);
        support += motion * motion.transpose() * share;
    }
    Some(support)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_motions_along_the_surface_are_supported() {
        // Two contact points at x = ±1 below a tool with the free components y and rotation, about a place at height h.
        let matrices = |h: f64| {
            let velocities = |x: f64| [[0.0, 1.0], [h, x]];
            let [mut approach, mut slide] = [(); 2].map(|()| DMatrix::zeros(2, 2));
            for x in [-1.0, 1.0] {
                let v = velocities(x);
                for i in 0..2 {
                    for j in 0..2 {
                        slide[(i, j)] += v[i][0] * v[j][0];
                        approach[(i, j)] += v[i][1] * v[j][1];
                    }
                }
            }
            unheld(&approach, &slide).unwrap()
        };
        // Pressure holds both components.
        assert!(matrices(0.0).amax() < 1e-9 && matrices(20.0).amax() < 1e-9);
        // A tool that is free along the surface alone has the whole stiffness.
        let along = unheld(&DMatrix::zeros(1, 1), &DMatrix::from_element(1, 1, 3.0)).unwrap();
        assert!((along[(0, 0)] - 3.0).abs() < 1e-9);
    }
}
