//! The velocity of the grid that has the momentum of the points: M v = Σ m_p S_p v_p, with the constraints of the step.

use crate::assembly::System;
use crate::dofs::DofMap;
use crate::step::Nodal;

use super::mass::Mass;

/// Residual of the projection relative to the momentum at which it ends, and largest number of iterations. The mass of a
/// grid without ghost mass may be singular, but the equations always have a solution.
const TOLERANCE: f64 = 1e-15;
const ITERATIONS: usize = 1000;
/// Number of iterations without progress after which round-off has been reached.
const PATIENCE: usize = 20;

/// The mean velocity of a step of this duration, [length/time], where the constraints prescribe it; zero elsewhere.
pub(super) fn rate<const N: usize>(dofs: &DofMap<N>, duration: f64) -> Nodal<N> {
    let zero = vec![[0.0; N]; dofs.n_nodes()];
    let mut motion = zero.clone();
    dofs.remaining(&zero, &mut motion);
    motion.iter_mut().flatten().for_each(|x| *x /= duration);
    motion
}

/// The field with this momentum, given on this rank, and these prescribed values: conjugate gradients with the diagonal
/// of the mass.
pub(super) fn project<const N: usize>(
    mass: &Mass,
    sum: &System<N>,
    dofs: &DofMap<N>,
    momentum: Nodal<N>,
    prescribed: Nodal<N>,
) -> Nodal<N> {
    let reduction = sum.reduction();
    let n = momentum.len();
    let on_unknowns = |force: &mut Nodal<N>| {
        reduction.complete(force);
        dofs.condense(force);
        dofs.on_unknowns(force);
    };
    let mut residual = vec![[0.0; N]; n];
    mass.multiply(sum, &prescribed, &mut residual);
    for (residual, momentum) in residual.iter_mut().flatten().zip(momentum.iter().flatten()) {
        *residual = momentum - *residual;
    }
    on_unknowns(&mut residual);
    let mut diagonal = mass.diagonal(sum, n);
    reduction.complete_numbers(&mut diagonal);
    let precondition = |residual: &Nodal<N>| -> Nodal<N> {
        let scaled = residual.iter().zip(&diagonal);
        scaled.map(|(r, m)| r.map(|r| if *m > 0.0 { r / m } else { 0.0 })).collect()
    };
    let mut unknowns = vec![[0.0; N]; n];
    let mut best = (f64::INFINITY, unknowns.clone(), 0);
    let size = reduction.dot(&residual, &residual).sqrt();
    let mut scaled = precondition(&residual);
    let mut direction = scaled.clone();
    let mut product = reduction.dot(&residual, &scaled);
    for iteration in 0..ITERATIONS {
        let norm = reduction.dot(&residual, &residual).sqrt();
        if norm < 0.9 * best.0 {
            best = (norm, unknowns.clone(), iteration);
        }
        if norm <= TOLERANCE * size || iteration > best.2 + PATIENCE || product <= 0.0 {
            break;
        }
        let mut motion = vec![[0.0; N]; n];
        dofs.add_unknowns(&direction, &mut motion);
        let mut pulled = vec![[0.0; N]; n];
        mass.multiply(sum, &motion, &mut pulled);
        on_unknowns(&mut pulled);
        let curvature = reduction.dot(&direction, &pulled);
        if curvature <= 0.0 {
            break;
        }
        let length = product / curvature;
        for (((x, d), r), p) in (unknowns.iter_mut().flatten())
            .zip(direction.iter().flatten())
            .zip(residual.iter_mut().flatten())
            .zip(pulled.iter().flatten())
        {
            *x += length * d;
            *r -= length * p;
        }
        scaled = precondition(&residual);
        let next = reduction.dot(&residual, &scaled);
        let share = next / product;
        product = next;
        for (d, z) in direction.iter_mut().flatten().zip(scaled.iter().flatten()) {
            *d = z + share * *d;
        }
    }
    let mut field = prescribed;
    dofs.add_unknowns(&best.1, &mut field);
    field
}
