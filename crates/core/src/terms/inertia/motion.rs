//! The motion of the points: their momentum on the grid, and their velocity at the end of a step.

use crate::model::Scheme;
use crate::points::{MOTION, Points};
use crate::step::{Nodal, StepContext};

use super::moving::{EndOfStep, Moving};

/// Kinetic energy ½ Σ m v² for these velocities, [energy].
pub(super) fn kinetic<const D: usize>(points: &Points<D>, velocity: &[f64]) -> f64 {
    let of_point = |(v, m): (&[f64], &f64)| 0.5 * m * v.iter().map(|v| v * v).sum::<f64>();
    velocity.chunks_exact(MOTION).zip(&points.mass).map(of_point).sum()
}

/// Σ m_p S_vp v_p on the nodes of this rank, for values v_p with three components.
pub(super) fn momentum<const D: usize, const N: usize>(
    step: &StepContext<D>,
    points: &Points<D>,
    values: &[f64],
) -> Nodal<N> {
    let links = step.links;
    let mut momentum = vec![[0.0; N]; links.n_active()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let own = &values[MOTION * p..MOTION * (p + 1)];
            links.for_each_value(p, |local, value| {
                let node = &mut momentum[nodes[local] as usize];
                (0..D).for_each(|d| node[d] += points.mass[p] * value * own[d]);
            });
        }
    }
    momentum
}

/// Displacement of a node in a step that is at most allowed, in cells, [-].
const LONGEST: f64 = 0.5;

/// By how much a step is too long: the largest displacement of a node relative to half a cell, or the difference between
/// the motion of the points and that at the acceleration of the step before, Δt |Δv − Δv_n Δt/Δt_n| as root mean square
/// by mass, relative to what is allowed.
pub(super) fn excess<const D: usize, const N: usize>(
    moving: &Moving<D, N>,
    step: &StepContext<D>,
    points: &Points<D>,
    delta_d: &[[f64; N]],
) -> f64 {
    let (model, links) = (step.model, step.links);
    let reduction = links.reduction();
    let sizes = links.active_cells().iter().map(|&cell| model.grid.size(cell as usize));
    let cell = reduction.smallest(sizes.fold(f64::INFINITY, f64::min));
    let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let farthest = delta_d.iter().map(|u| square(&u[..D])).fold(0.0, f64::max).sqrt();
    let farthest = reduction.largest(farthest) / (LONGEST * cell);
    let allowed = moving.dynamics.largest_error * cell;
    if !allowed.is_finite() {
        return farthest;
    }
    let end = moving.end(step, points, delta_d);
    let none = vec![0.0; MOTION * points.len()];
    let before = points.velocity().unwrap_or(&none);
    let acceleration = points.acceleration().unwrap_or(&none);
    let mut sums = [0.0; 2];
    for p in 0..points.len() {
        let error = |k: usize| end.velocity[k] - before[k] - acceleration[k] * moving.duration;
        sums[0] += points.mass[p] * (MOTION * p..MOTION * (p + 1)).map(|k| error(k) * error(k)).sum::<f64>();
        sums[1] += points.mass[p];
    }
    reduction.sum(&mut sums);
    let error = if sums[1] > 0.0 { moving.duration * (sums[0] / sums[1]).sqrt() } else { 0.0 };
    farthest.max(error / allowed)
}

impl EndOfStep {
    pub(super) fn new<const D: usize, const N: usize>(
        moving: &Moving<D, N>,
        step: &StepContext<D>,
        points: &Points<D>,
        delta_d: &[[f64; N]],
    ) -> EndOfStep {
        let Moving { dynamics, duration, start: [velocity, acceleration], ghost, force, .. } = moving;
        let mut changes = [vec![[0.0; N]; delta_d.len()], vec![[0.0; N]; delta_d.len()]];
        for (node, u) in delta_d.iter().enumerate() {
            let [v, a] = [velocity, acceleration].map(|field| field.get(node).copied().unwrap_or([0.0; N]));
            for d in 0..D {
                let [dv, da] = dynamics.scheme.changes(*duration, u[d], v[d], a[d]);
                (changes[0][node][d], changes[1][node][d]) = (dv, da);
            }
        }
        let none = vec![0.0; MOTION * points.len()];
        let before = points.velocity().unwrap_or(&none);
        let mut after = before.to_vec();
        let mut accelerated = points.acceleration().unwrap_or(&none).to_vec();
        let mut on_grid = none.clone();
        let links = step.links;
        // Kinetic energy that the change of the grid gives the points, and that its force of inertia does as work.
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            for p in links.points_of(group) {
                let own = MOTION * p;
                links.for_each_value(p, |local, value| {
                    let node = nodes[local] as usize;
                    for d in 0..D {
                        after[own + d] += value * changes[0][node][d];
                        accelerated[own + d] += value * changes[1][node][d];
                        let start = velocity.get(node).map_or(0.0, |v| v[d]);
                        on_grid[own + d] += value * (start + changes[0][node][d]);
                    }
                });
            }
        }
        let [kinetic_before, followed] = [before, &after].map(|velocity| kinetic(points, velocity));
        if dynamics.pic > 0.0 {
            for (own, grid) in after.iter_mut().zip(&on_grid) {
                *own += dynamics.pic * (grid - *own);
            }
        }
        let kinetic_end = kinetic(points, &after);
        if !dynamics.scheme.keeps_acceleration() {
            // The mean acceleration of the step, by which the next one is judged.
            let changes = accelerated.iter_mut().zip(after.iter().zip(before));
            changes.for_each(|(a, (after, before))| *a = (after - before) / duration);
        }
        let mut resisted = vec![[0.0; N]; delta_d.len()];
        ghost.add_force(D, &changes[0], &mut resisted);
        let dot = |a: &[[f64; N]], b: &[[f64; N]]| -> f64 {
            a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
        };
        let ghost_loss = 0.5 * dot(&resisted, &changes[0]);
        let mut end = EndOfStep {
            velocity: after,
            acceleration: accelerated,
            kinetic_before,
            kinetic: kinetic_end,
            ghost_loss,
            pic_loss: followed - kinetic_end,
            algorithmic_loss: 0.0,
        };
        if dynamics.scheme == Scheme::Midpoint {
            return end;
        }
        // The work of the force of inertia, by the points and the faces of this rank.
        let mut work = 0.0;
        let mut sought = vec![[0.0; N]; delta_d.len()];
        for (node, (sought, u)) in sought.iter_mut().zip(delta_d).enumerate() {
            let [v, a] = [velocity, acceleration].map(|field| field.get(node).copied().unwrap_or([0.0; N]));
            *sought = std::array::from_fn(|d| {
                force.displacement * u[d] - force.velocity * v[d] - force.acceleration * a[d]
            });
        }
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            for p in links.points_of(group) {
                let (mut rate, mut moved) = ([0.0; N], [0.0; N]);
                links.for_each_value(p, |local, value| {
                    let node = nodes[local] as usize;
                    for d in 0..D {
                        rate[d] += value * sought[node][d];
                        moved[d] += value * delta_d[node][d];
                    }
                });
                work += points.mass[p] * (0..D).map(|d| rate[d] * moved[d]).sum::<f64>();
            }
        }
        let mut pulled = vec![[0.0; N]; delta_d.len()];
        ghost.add_force(D, &sought, &mut pulled);
        work += dot(&pulled, delta_d);
        end.algorithmic_loss = work - (followed - kinetic_before) - ghost_loss;
        end
    }
}
