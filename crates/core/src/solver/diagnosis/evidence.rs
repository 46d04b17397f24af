//! Evidence for the cause of a failed run: the filling of cells, the share of points that flow, displacements without
//! strain at the points, and the rate at which the residuals fall.

use nalgebra::SMatrix;

use crate::basis::{BodyGroup, Connectivity};
use crate::dofs::{DofMap, rigid::free_parts};
use crate::model::{Model, SAME_TIME, Stepping};
use crate::points::Points;
use crate::solver::attempt::{FailedAttempt, Iterate};
use crate::step::Step;
use crate::tensor::padded;
use crate::terms::held_material::HeldMaterial;

/// Filling ratio below which cells are not examined for hourglass modes, since their nodes move far for another reason,
/// [-].
const FULL: f64 = 0.5;
/// Largest ratio of volume changes to shape changes, both as root mean squares, in isochoric deformation, [-].
const ISOCHORIC: f64 = 0.1;
/// Number of final iterations that must all reduce the residual for the residuals to count as falling steadily.
const LAST: usize = 5;
/// Largest ratio of successive residuals that counts as a steady fall, [-].
const FALLS: f64 = 0.98;
/// Largest ratio of successive residuals that, met twice in a row, counts as quadratic convergence, [-].
const QUICKLY: f64 = 0.1;
/// Largest number of further iterations that are worth allowing, relative to the number that was allowed, [-].
const MAX_EXTENSION: f64 = 10.0;
/// Largest size of a small step relative to the duration of the stage, [-].
const SMALL_STEP: f64 = 0.02;
/// Largest size of a small step relative to the time from the start of the stage to the end of the step, [-].
const SMALL_GAIN: f64 = 0.1;

/// The active cell with the least material among those around a position, and its filling ratio, [-].
pub(super) fn emptiest_cell<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    place: &[f64],
) -> Option<(u32, f64)> {
    let held = HeldMaterial::new(model, points, links);
    let fillings = cells_at(model, links, place).into_iter().map(|cell| {
        // Of the bodies that touch the cell, those that fill it least.
        let of_bodies = (0..links.n_body_groups() as BodyGroup)
            .filter(|bodies| links.cells_of_bodies(*bodies).binary_search(&cell).is_ok())
            .map(|bodies| held.filling(model, links, bodies, cell));
        (cell, of_bodies.fold(f64::INFINITY, f64::min))
    });
    fillings.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The active cells that contain a position, or have a node there.
fn cells_at<const D: usize>(model: &Model<D>, links: &Connectivity<D>, place: &[f64]) -> Vec<u32> {
    let grid = model.grid.as_ref();
    let position: [f64; D] = std::array::from_fn(|d| place.get(d).copied().unwrap_or(0.0));
    let home = grid.nearest_cell(&position);
    let reach = 1e-6 * grid.size(home as usize);
    let touches = |cell: u32| {
        cell == home
            || grid.corners(cell as usize).nodes().iter().any(|n| {
                let node = grid.node_position(*n as usize);
                (0..D).all(|d| (node[d] - position[d]).abs() <= reach)
            })
    };
    links.active_cells().iter().copied().filter(|cell| touches(*cell)).collect()
}

/// Number of points that have yielded since the start of the analysis, including the failed step.
pub(crate) fn points_that_flow<const D: usize>(model: &Model<D>, points: &Points<D>) -> usize {
    let flows = |p: &usize| {
        let law = model.law(points, *p);
        let initial = law.initial_history_at(&padded(&points.original_position[*p]));
        let own = |all: &[f64]| law.has_yielded(&initial, &all[p * points.history_len..][..initial.len()]);
        own(&points.trial.history) || own(&points.converged.history)
    };
    (0..points.len()).filter(flows).count()
}

/// True if the points have changed their shape far more than their volume since the start of the analysis.
pub(super) fn is_isochoric<const D: usize>(points: &Points<D>) -> bool {
    let (mut volume, mut shape) = (0.0, 0.0);
    for gradient in &points.converged.deformation_gradient {
        let det = gradient.determinant();
        volume += det.ln().powi(2);
        // tr exp(2 e) − 3 is twice the square of a small deviatoric strain e.
        shape += 0.5 * (gradient.norm_squared() / det.powf(2.0 / 3.0) - 3.0).max(0.0);
    }
    shape > 0.0 && volume <= ISOCHORIC.powi(2) * shape
}

/// Size of a step relative to a requested one, if the step is smaller, [-].
pub(super) fn cut_to(stepping: &Stepping, step: Step) -> Option<f64> {
    let size = (step.end - step.start) / stepping.size();
    (size < 1.0 - SAME_TIME).then_some(size)
}

/// True if the failed step is short relative to the stage and to the time from the start of the stage to the end of the
/// step, so that smaller steps would hardly help.
pub(super) fn is_small_step<const D: usize>(model: &Model<D>, failed: &FailedAttempt<D>) -> bool {
    let Step { start, end, .. } = failed.step;
    end - start <= SMALL_STEP * model.stepping.duration()
        && end - start <= SMALL_GAIN * (end - model.stepping.start_time)
}

/// Number of further iterations needed to meet the tolerance at the rate of the last residuals; `None` if these do not
/// fall steadily, or if the number is very large.
pub(super) fn iterations_missing(residuals: &[f64], tolerance: f64, allowed: usize) -> Option<usize> {
    let residual = *residuals.last()?;
    let slowest_of = |last: usize| {
        let last = &residuals[residuals.len().saturating_sub(last + 1)..];
        let ratios = last.windows(2).map(|pair| pair[1] / pair[0]);
        let falls = last.len() > 2 && ratios.clone().all(|ratio| ratio > 0.0 && ratio < FALLS);
        falls.then(|| ratios.fold(0.0, f64::max))
    };
    let quickly = slowest_of(2).filter(|slowest| *slowest < QUICKLY);
    let slowest = quickly.or_else(|| slowest_of(LAST))?;
    let is_best = residuals.iter().all(|before| residual <= *before);
    if !is_best || residual <= tolerance {
        return None;
    }
    let missing = ((tolerance / residual).ln() / slowest.ln()).ceil();
    (missing <= MAX_EXTENSION * allowed.max(1) as f64).then_some(missing as usize)
}

/// Largest displacement of the nodes of the cells at a position, relative to the largest displacement of any point,
/// [-]; large if the nodes carry little material.
pub(super) fn runaway<const D: usize>(model: &Model<D>, iterate: &Iterate<D>, place: &[f64]) -> f64 {
    let Iterate { links, delta_d, .. } = iterate;
    let length = |u: &[f64; D]| u.iter().map(|u| u * u).sum::<f64>().sqrt();
    let mut farthest_point: f64 = 0.0;
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let mut moved = [0.0; D];
            links.for_each_value(p, |local, value| {
                let node = &delta_d[nodes[local] as usize];
                (0..D).for_each(|d| moved[d] += value * node[d]);
            });
            farthest_point = farthest_point.max(length(&moved));
        }
    }
    let cells = cells_at(model, links, place);
    let corners = cells.iter().map(|cell| model.grid.corners(*cell as usize));
    let corner_nodes = corners.flat_map(|corners| {
        let active: Vec<usize> = corners.nodes().iter().flat_map(|n| links.copies(*n as usize)).collect();
        active
    });
    let farthest = corner_nodes.map(|node| length(&delta_d[node])).fold(0.0, f64::max);
    if farthest_point > 0.0 { farthest / farthest_point } else { 0.0 }
}

/// Deviation of the displacement gradient at the corners of full cells from its mean over the points, relative to the
/// strain increment of the points, both as root mean squares, [-]: about 1 in bending, large in hourglass modes.
pub(super) fn hourglass<const D: usize>(model: &Model<D>, points: &Points<D>, iterate: &Iterate<D>) -> f64 {
    let Iterate { links, delta_d, .. } = iterate;
    let grid = model.grid.as_ref();
    let held = HeldMaterial::new(model, points, links);
    let (mut unseen, mut seen) = (0.0, 0.0);
    let in_group = |group| links.points_of(group).map(move |p| (group, points.cell[p], p));
    let all: Vec<_> = (0..links.n_groups()).flat_map(in_group).collect();
    // Bodies of different groups have groups of points of their own in a cell.
    for in_cell in all.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (group, cell, first) = in_cell[0];
        let (nodes, n) = (links.nodes_of(group), in_cell.len() as f64);
        if held.filling(model, links, links.bodies_with(points.body[first]), cell) < FULL {
            continue;
        }
        let (mut mean, mut strain) = (SMatrix::<f64, D, D>::zeros(), 0.0);
        for &(_, _, p) in in_cell {
            let mut gradient = SMatrix::<f64, D, D>::zeros();
            links.for_each_link(p, |local, _, slope| {
                add(&mut gradient, &delta_d[nodes[local] as usize], slope)
            });
            let green = (gradient + gradient.transpose() + gradient.transpose() * gradient) * 0.5;
            strain += green.norm_squared() / n;
            mean += gradient / n;
        }
        let corners = grid.corners(cell as usize);
        let mut beyond = 0.0;
        for corner in corners.nodes() {
            let basis = grid.basis_at(cell, &grid.node_position(*corner as usize));
            let mut gradient = -mean;
            for (node, slope) in basis.nodes().iter().zip(basis.gradient()) {
                if let Some(active) = links.seen_by(points.body[first], *node as usize) {
                    add(&mut gradient, &delta_d[active], slope);
                }
            }
            beyond += gradient.norm_squared() / corners.nodes().len() as f64;
        }
        seen += strain;
        unseen += beyond;
    }
    if seen > 0.0 { (unseen / seen).sqrt() } else { 0.0 }
}

/// Adds u ⊗ ∇S to a gradient.
fn add<const D: usize>(to: &mut SMatrix<f64, D, D>, u: &[f64; D], slope: &[f64; D]) {
    for i in 0..D {
        for j in 0..D {
            to[(i, j)] += u[i] * slope[j];
        }
    }
}

/// Number of points in the fullest cell at a position.
pub(super) fn most_points<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    place: &[f64],
) -> usize {
    let cells = cells_at(model, links, place);
    let count = |cell: &u32| points.cell.iter().filter(|other| *other == cell).count();
    cells.iter().map(count).max().unwrap_or(0)
}

/// Mean number of points in the cells that hold points.
pub(super) fn mean_points_per_cell<const D: usize>(points: &Points<D>) -> f64 {
    let mut cells = points.cell.clone();
    cells.sort_unstable();
    cells.dedup();
    points.len() as f64 / cells.len().max(1) as f64
}

/// True if the boundary conditions of a step leave a rigid-body motion of some part free.
pub(super) fn can_move_freely<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    step: Step,
) -> bool {
    let dofs = DofMap::new(model, points, links, step.start, step.end);
    dofs.is_ok_and(|dofs| !free_parts(model, points, links, &dofs).is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Method;
    use crate::domain::DomainUpdate;
    use crate::grid::Structured;
    use crate::material::{Hencky, Material, Tresca, Varying, VaryingProperty};
    use crate::model::{Body, Builder, Fill, NamedMaterial};
    use crate::points::Seed;
    use crate::tensor::Sym3;

    /// Hourglass and runaway measures of a block of 3 by 2 full cells of side 1 under a motion of its nodes.
    fn measure(points_per_cell: u32, motion: impl Fn([f64; 2]) -> [f64; 2]) -> (f64, f64) {
        let law: Box<dyn Material> = Box::new(Hencky::new(1e3, 0.0));
        let body = Body {
            name: "b".to_owned(),
            material: 0,
            method: Method::Mpm,
            domain_update: DomainUpdate::None,
            split_above: None,
            strain: Default::default(),
        };
        let model = Model {
            materials: vec![NamedMaterial { name: "m".to_owned(), law }],
            bodies: vec![body],
            ..Model::new(Box::new(Structured::<2>::new([0.0; 2], [1.0; 2], [5; 2])))
        };
        let n = f64::from(points_per_cell);
        let place = |k: u32| 1.0 + (f64::from(k) + 0.5) / n;
        let seed = |position: [f64; 2]| Seed {
            body: 0,
            position,
            half_lengths: [0.0; 2],
            corners: Vec::new(),
            volume: 1.0 / (n * n),
            mass: 1.0,
            outer_layer: false,
            history: Vec::new(),
        };
        let places = (0..3 * points_per_cell)
            .flat_map(|i| (0..2 * points_per_cell).map(move |j| [place(i), place(j)]));
        let mut points = Points::new(&places.map(seed).collect::<Vec<_>>());
        let methods = model.methods();
        let links = Connectivity::new(model.grid.as_ref(), &mut points, &methods).unwrap();
        let places = links.active_nodes().iter().map(|node| model.grid.node_position(*node as usize));
        let delta_d: Vec<[f64; 2]> = places.map(motion).collect();
        let iterate = Iterate { links, out_of_balance: delta_d.clone(), delta_d };
        (hourglass(&model, &points, &iterate), runaway(&model, &iterate, &[4.0, 3.0]))
    }

    #[test]
    fn nodes_that_move_to_and_fro_are_an_hourglass_mode() {
        let to_and_fro = |[x, y]: [f64; 2]| [0.1 * (1.0 - 2.0 * ((x + y) % 2.0)) + 1e-6 * x, 0.0];
        let (alone, _) = measure(1, to_and_fro);
        assert!(alone > 1e4, "one point sees only the stretch: {alone}");
        let (seen, _) = measure(4, to_and_fro);
        assert!(
            (seen - 2.0).abs() < 0.5,
            "points at a quarter of a cell see half of the gradient at its corners: {seen}"
        );
        // A stretch, a rotation by 60 degrees, and bending.
        for points_per_cell in [1, 4] {
            let (stretch, _) = measure(points_per_cell, |[x, y]| [0.1 * x, -0.05 * y]);
            assert!(stretch < 1e-12, "{stretch}");
            let (sin, cos) = (0.75f64.sqrt(), 0.5);
            let (turn, _) =
                measure(points_per_cell, |[x, y]| [cos * x - sin * y - x + 1e-3 * x, sin * x + cos * y - y]);
            assert!(turn < 1e-9, "{turn}");
            let (bending, _) = measure(points_per_cell, |[x, y]| [-0.01 * x * (y - 2.0), 0.005 * x * x]);
            assert!(bending < 3.0, "{bending}");
        }
    }

    #[test]
    fn an_initial_stress_is_no_flow() {
        let grid = Structured::new([0.0; 2], [1.0; 2], [2, 2]);
        let clay = Tresca::new(1e6, 0.3, 1e4);
        let (model, mut points) = Builder::new(grid)
            .material("clay", clay)
            .body("ground", "clay", Fill::default(), |_| true)
            .build()
            .unwrap();
        for p in 0..points.len() {
            model.set_initial_stress(&mut points, p, &Sym3([-2e4, -3e4, -2e4, 0.0, 0.0, 0.0])).unwrap();
        }
        let n = points.history_len;
        assert!(points.converged.history[1] != 0.0, "other variables change with the stress");
        assert_eq!(points_that_flow(&model, &points), 0);
        points.trial.history[0] = 1e-6;
        points.converged.history[3 * n] = 1e-6;
        assert_eq!(points_that_flow(&model, &points), 2);
    }

    #[test]
    fn properties_that_vary_are_no_flow() {
        let property = VaryingProperty { name: "young".into(), unit: "stress".into(), typical: 1e6 };
        let stiffer = |x: &[f64; 3]| vec![1e6 * (1.0 + x[1])];
        let law = Varying::new(&[property], std::sync::Arc::new(stiffer), |p| Hencky::new(p[0], 0.3));
        let grid = Structured::new([0.0; 2], [1.0; 2], [2, 2]);
        let (model, points) = Builder::new(grid)
            .material("ground", law)
            .body("ground", "ground", Fill::default(), |_| true)
            .build()
            .unwrap();
        assert_eq!(points_that_flow(&model, &points), 0);
    }

    #[test]
    fn nodes_that_move_farther_than_points_run_away() {
        let at_corner = |[x, y]: [f64; 2]| if [x, y] == [4.0, 3.0] { [9.0, 12.0] } else { [0.0, 0.0] };
        // The nearest of the 16 points of the cell is an eighth of a side away from the two sides that meet at the
        // corner: it takes 49/64 of the motion of the corner node.
        let (_, far) = measure(4, at_corner);
        assert!((far - 64.0 / 49.0).abs() < 1e-12, "{far}");
        let (_, together) = measure(4, |_| [0.3, 0.4]);
        assert!((together - 1.0).abs() < 1e-12, "{together}");
        assert_eq!(measure(4, |_| [0.0, 0.0]), (0.0, 0.0));
    }

    #[test]
    fn iterations_are_missing_where_residuals_fall_steadily() {
        let missing = |residuals: &[f64]| iterations_missing(residuals, 1e-9, 20);
        let falling = |ratio: f64, n: i32| (0..n).map(|k| ratio.powi(k)).collect::<Vec<f64>>();
        // 0.5^29.9 = 1e-9.
        assert_eq!(missing(&falling(0.5, 21)), Some(10));
        assert_eq!(missing(&[1.0, 1e-3, 5e-7]), Some(1));
        assert_eq!(missing(&falling(0.97, 21)), None, "that would take hundreds");
        assert_eq!(missing(&falling(0.99, 21)), None, "they stall");
        assert_eq!(missing(&[1.0, 0.1, 0.2, 0.05, 0.01, 0.005]), None, "one of them has grown");
        let at_last = [2.0, 1.8e-2, 3.7e-2, 1.8e-3, 5.3e-3, 3.3e-4, 2.3e-5, 1.1e-8];
        assert_eq!(missing(&at_last), Some(1), "they have grown before, and end quadratically");
        // These residuals are from the analysis of a slope: they grow by 2 % in each iteration.
        assert_eq!(missing(&[7.2e-6, 1.898e-8, 1.935e-8, 1.974e-8, 2.013e-8, 2.053e-8, 2.094e-8]), None);
        let chaotic = [1.0, 0.6, 7.2, 1.4, 8.3, 1.2, 5.6, 4.4, 3.5, 2.7, 2.2, 1.9];
        assert_eq!(missing(&chaotic), None, "they were smaller before");
        assert_eq!(missing(&[1.0, 0.1]), None, "too few to tell");
        assert_eq!(missing(&[]), None);
        assert_eq!(missing(&[1.0, f64::NAN, f64::NAN]), None);
    }
}
