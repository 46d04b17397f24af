//! The update of the points once the iterations of a step have ended: section 6.4.
#![allow(non_snake_case)]

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::collective::agree;
use super::error::SolveError;
use crate::basis::{Connectivity, DomainKind, LinkBuffer as Products, Method, SupportError, check_domain};
use crate::domain::DomainMotion;
use crate::grid::{Grid, interpolate};
use crate::kinematics::Increment;
use crate::model::Model;
use crate::points::{Points, State};
use crate::region::vector::along;
use crate::step::{Step, StepContext};
use crate::tensor::Mat3;

/// The new position, deformation and domain of one point. Each task reuses one instance for point after point, because
/// copies would take a considerable part of the time of the update; only as many corners as the point has are valid.
struct Moved<const D: usize> {
    position: [f64; D],
    deformation_gradient: Mat3,
    half_lengths: [f64; D],
    corners: [[f64; D]; 8],
    /// True if the domain was torn and has been replaced.
    is_replaced: bool,
}

impl<const D: usize> Moved<D> {
    fn new() -> Self {
        Moved {
            position: [0.0; D],
            deformation_gradient: Mat3::identity(),
            half_lengths: [0.0; D],
            corners: [[0.0; D]; 8],
            is_replaced: false,
        }
    }
}

/// Largest number of times that the size of a replacement domain, or its deviation from a parallelogram
/// (parallelepiped), is halved to make the domain valid.
const MAX_HALVINGS: usize = 10;

/// A task of at most this many groups is not divided between threads.
const GRAIN: usize = 16;

/// Moves the points with the grid by Δd, eqs. (9) and (31); updates F by eq. (16) and the domains by eqs. (32)-(39). All
/// results go into the trial state, whose stress and strain the last evaluation has written.
///
/// If `replaces` is true, as a last resort, and in bodies whose long domains are split, domains that are torn or have
/// corners outside the grid are replaced; returns the permanent numbers of their points on all ranks, ascending.
///
/// # Errors
/// [`SolveError`] if a point or a corner of its domain leaves the grid, or a domain is torn or collapses.
pub(super) fn move_points<const D: usize>(
    context: &StepContext<D>,
    points: &mut Points<D>,
    delta_d: &[[f64; D]],
    replaces: bool,
) -> Result<Vec<u32>, SolveError> {
    let mut trial = std::mem::take(&mut points.trial);
    trial.make_room_for_motion(&points.converged);
    let moved = motion_of_points(context, points, &mut trial, delta_d, replaces);
    if moved.is_err() {
        trial.forget_motion();
    }
    points.trial = trial;
    let reduction = context.links.reduction();
    let mut replaced = reduction.gather_all(agree(reduction, moved)?).concat();
    replaced.sort_unstable();
    Ok(replaced)
}

/// Writes the motion of the points of this rank into the trial state; returns the permanent numbers of the points whose
/// domains were replaced, in any order.
fn motion_of_points<const D: usize>(
    context: &StepContext<D>,
    points: &Points<D>,
    trial: &mut State<D>,
    delta_d: &[[f64; D]],
    replaces: bool,
) -> Result<Vec<u32>, SolveError> {
    let StepContext { model, links, step, .. } = *context;
    let replaced = Mutex::new(Vec::new());
    // The next step must find the points in its grid.
    let error = |error| SolveError::GridMotion { step: step.index, error };
    let moved_grid = model.grid_at(step.end).map_err(error)?;
    let next_grid = moved_grid.as_ref().map_or(model.grid.as_ref(), |grid| grid as &dyn Grid<D>);
    let update = PointUpdate { model, links, points, step, next_grid, delta_d, replaces };
    let move_point = |nodes: &[u32], products: &mut Products<D>, p: usize, moved: &mut Moved<D>| {
        update.move_point(nodes, products, p, moved)?;
        if moved.is_replaced {
            replaced.lock().unwrap_or_else(PoisonError::into_inner).push(points.id[p]);
        }
        Ok(())
    };
    let room = Room {
        first: 0,
        position: &mut trial.position,
        deformation_gradient: &mut trial.deformation_gradient,
        half_lengths: &mut trial.half_lengths,
        corners: &mut trial.corners,
    };
    room.fill(points, links, 0..links.n_groups(), &move_point)?;
    Ok(replaced.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// The part of the trial state that is written when a range of consecutive points is updated.
struct Room<'a, const D: usize> {
    first: usize,
    position: &'a mut [[f64; D]],
    deformation_gradient: &'a mut [Mat3],
    half_lengths: &'a mut [[f64; D]],
    corners: &'a mut [[f64; D]],
}

impl<const D: usize> Room<'_, D> {
    /// Moves the points of some groups, divided between threads.
    fn fill(
        mut self,
        points: &Points<D>,
        links: &Connectivity<D>,
        groups: Range<usize>,
        move_point: &(impl Fn(&[u32], &mut Products<D>, usize, &mut Moved<D>) -> Result<(), SolveError> + Sync),
    ) -> Result<(), SolveError> {
        if groups.len() <= GRAIN {
            let most = groups.clone().map(|g| links.nodes_of(g).len()).max().unwrap_or(0);
            let (mut value, mut gradient) = (vec![0.0; most], vec![[0.0; D]; most]);
            let mut products = Products { value: &mut value, gradient: &mut gradient };
            let mut moved = Moved::new();
            for group in groups {
                for p in links.points_of(group) {
                    move_point(links.nodes_of(group), &mut products, p, &mut moved)?;
                    self.keep(points, p, &moved);
                }
            }
            return Ok(());
        }
        let middle = groups.start + groups.len() / 2;
        let (left, right) = self.split(links.points_of(middle).start, points.corners_per_point);
        let (a, b) = rayon::join(
            || left.fill(points, links, groups.start..middle, move_point),
            || right.fill(points, links, middle..groups.end, move_point),
        );
        a.and(b)
    }

    /// Splits the room into the part before a point and the part from this point onwards.
    fn split(&mut self, point: usize, corners_per_point: usize) -> (Room<'_, D>, Room<'_, D>) {
        let n = point - self.first;
        let (position_l, position_r) = self.position.split_at_mut(n);
        let (gradient_l, gradient_r) = self.deformation_gradient.split_at_mut(n);
        let (lengths_l, lengths_r) = self.half_lengths.split_at_mut(n.min(self.half_lengths.len()));
        let (corners_l, corners_r) = self.corners.split_at_mut(n * corners_per_point);
        let left = Room {
            first: self.first,
            position: position_l,
            deformation_gradient: gradient_l,
            half_lengths: lengths_l,
            corners: corners_l,
        };
        let right = Room {
            first: point,
            position: position_r,
            deformation_gradient: gradient_r,
            half_lengths: lengths_r,
            corners: corners_r,
        };
        (left, right)
    }

    fn keep(&mut self, points: &Points<D>, p: usize, moved: &Moved<D>) {
        let here = p - self.first;
        self.position[here] = moved.position;
        self.deformation_gradient[here] = moved.deformation_gradient;
        if let Some(half_lengths) = self.half_lengths.get_mut(here) {
            *half_lengths = moved.half_lengths;
        }
        let corners = points.corner_range(p);
        let n = corners.len();
        self.corners[here * points.corners_per_point..][..n].copy_from_slice(&moved.corners[..n]);
    }
}

/// What moves the points at the end of a step.
struct PointUpdate<'a, const D: usize> {
    model: &'a Model<D>,
    links: &'a Connectivity<D>,
    points: &'a Points<D>,
    step: Step,
    /// The grid in which the next step must find the points.
    next_grid: &'a dyn Grid<D>,
    delta_d: &'a [[f64; D]],
    /// True if domains that have become invalid are replaced as a last resort.
    replaces: bool,
}

impl<const D: usize> PointUpdate<'_, D> {
    /// Δd of a grid node, as a body sees it.
    fn nodal(&self, body: u16, node: usize) -> [f64; D] {
        if let Some(active) = self.links.seen_by(body, node) {
            return self.delta_d[active];
        }
        let carriers = self.links.carriers(body, node).unwrap_or_default();
        carriers.iter().fold([0.0; D], |sum, (active, weight)| along(&sum, *weight, &self.delta_d[*active]))
    }

    /// Δd of a body at a position.
    fn displacement(&self, body: u16, place: &[f64; D]) -> [f64; D] {
        interpolate(self.model.grid.as_ref(), place, &|node| self.nodal(body, node))
    }

    /// Moves one point, which the group with these nodes holds; `products` receives its basis functions.
    ///
    /// # Errors
    /// [`SolveError`] if the point leaves the grid, or its domain is torn or collapses.
    fn move_point(
        &self,
        nodes: &[u32],
        products: &mut Products<D>,
        p: usize,
        moved: &mut Moved<D>,
    ) -> Result<(), SolveError> {
        let PointUpdate { model, points, step, delta_d, .. } = *self;
        let touched = self.links.links(p, products);
        let mut position = points.converged.position[p];
        for (&local, value) in touched.local.iter().zip(touched.value) {
            let du = &delta_d[nodes[local as usize] as usize];
            for d in 0..D {
                position[d] += value * du[d]; // (31)
            }
        }
        if !self.is_held(p, &position) {
            return Err(SolveError::off_grid(model, points, p, position, step));
        }
        let start = &points.converged.position[p];
        let dF = Increment::new(model.revolved, nodes, &touched, delta_d, start).in_space();
        let F = dF * points.converged.deformation_gradient[p]; // (16)
        let body = &model.bodies[points.body[p] as usize];
        let displacement = |place: &[f64; D]| self.displacement(points.body[p], place);
        moved.position = position;
        moved.deformation_gradient = F;
        moved.half_lengths = points.half_lengths(p);
        moved.is_replaced = false;
        match body.method.domain() {
            DomainKind::None => moved.half_lengths = self.box_of_standard_point(p, &F, &dF),
            DomainKind::Box => {
                let motion = DomainMotion {
                    F: &along_axes::<D>(F),
                    dF: &along_axes::<D>(dF),
                    original: &points.original_half_lengths[p],
                    previous: &points.converged.half_lengths[p],
                    position: &points.converged.position[p],
                    displacement: &displacement,
                };
                moved.half_lengths = body
                    .domain_update
                    .half_lengths(&motion) // (32)-(39)
                    .map_err(|error| SolveError::collapsed(model, points, p, position, step, error))?;
            }
            DomainKind::Corners => {
                match body.method {
                    Method::Cpdi2 => carry_corners(points, p, &displacement, moved),
                    Method::Mpm | Method::Gimp | Method::Cpdi1 => deform_corners(points, p, 1.0, moved),
                }
                self.make_valid(p, moved)
                    .map_err(|error| SolveError::domain(model, points, p, position, step, error))?;
            }
        }
        Ok(())
    }

    /// True if the next grid holds the point at this position.
    fn is_held(&self, p: usize, position: &[f64; D]) -> bool {
        self.next_grid.locate(position, Some(self.points.cell[p])).is_some()
    }

    /// Checks a domain given by its corners, because otherwise only the next step, if there is one, would notice that
    /// it is invalid. Where this is allowed, an invalid domain is replaced.
    ///
    /// # Errors
    /// [`SupportError`] if the domain is invalid and not replaced.
    fn make_valid(&self, p: usize, moved: &mut Moved<D>) -> Result<(), SupportError> {
        let PointUpdate { points, next_grid, .. } = *self;
        let is_split = self.model.bodies[points.body[p] as usize].split_above.is_some();
        let n = points.corner_range(p).len();
        let check = |moved: &Moved<D>| check_domain(next_grid, &moved.corners[..n], points.cell[p]);
        let mut checked = check(moved);
        if checked.is_err() && is_split && n == 1 << D {
            moved.is_replaced = true;
            let carried = moved.corners;
            let mut sizes = (1..=MAX_HALVINGS).map(|k| 0.5f64.powi(k as i32)).chain([0.0]);
            while checked.is_err()
                && let Some(size) = sizes.next()
            {
                moved.corners = straightened(&carried, n, size);
                checked = check(moved);
            }
        }
        if (self.replaces || is_split) && checked.is_err() {
            moved.is_replaced = true;
            let mut sizes = (0..=MAX_HALVINGS).map(|k| 0.5f64.powi(k as i32));
            while checked.is_err()
                && let Some(size) = sizes.next()
            {
                deform_corners(points, p, size, moved);
                checked = check(moved);
            }
        }
        checked
    }

    /// The updated half lengths of the box of a standard point, which only contact with tools uses; zero for points
    /// without a box. Corners beyond the cell of the point move with the basis of that cell, continued outwards: the
    /// next cell may hold no material. A box that would collapse keeps its size.
    fn box_of_standard_point(&self, p: usize, F: &Mat3, dF: &Mat3) -> [f64; D] {
        let PointUpdate { model, points, .. } = *self;
        let previous = points.half_lengths(p);
        if previous == [0.0; D] {
            return previous;
        }
        let displacement = |place: &[f64; D]| {
            let basis = model.grid.basis_at(points.cell[p], place);
            let mut sum = [0.0; D];
            for (&node, &value) in basis.nodes().iter().zip(basis.value()) {
                let at_node = self.nodal(points.body[p], node as usize);
                (0..D).for_each(|d| sum[d] += value * at_node[d]);
            }
            sum
        };
        let motion = DomainMotion {
            F: &along_axes::<D>(*F),
            dF: &along_axes::<D>(*dF),
            original: &points.original_half_lengths[p],
            previous: &previous,
            position: &points.converged.position[p],
            displacement: &displacement,
        };
        let update = model.bodies[points.body[p] as usize].domain_update;
        update.half_lengths(&motion).unwrap_or(previous)
    }
}

/// A deformation gradient restricted to the `D` axes: the domain does not depend on the rest, such as the hoop stretch
/// of a body of revolution.
fn along_axes<const D: usize>(mut F: Mat3) -> Mat3 {
    for d in D..3 {
        F[(d, d)] = 1.0;
    }
    F
}

/// CPDI2: the corners move with the grid.
fn carry_corners<const D: usize>(
    points: &Points<D>,
    p: usize,
    displacement: &impl Fn(&[f64; D]) -> [f64; D],
    moved: &mut Moved<D>,
) {
    for (place, corner) in moved.corners.iter_mut().zip(points.corners(p)) {
        let u = displacement(corner);
        *place = std::array::from_fn(|d| corner[d] + u[d]);
    }
}

/// The quadrilateral (hexahedron) whose deviation from a parallelogram (parallelepiped) is `size` times that of
/// `corners`. Sides (faces) keep their mid-points, and quadrilaterals their area.
fn straightened<const D: usize>(corners: &[[f64; D]; 8], n: usize, size: f64) -> [[f64; D]; 8] {
    let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
    let mean = |weight: &dyn Fn(usize) -> f64| -> [f64; D] {
        std::array::from_fn(|i| (0..n).map(|k| weight(k) * corners[k][i]).sum::<f64>() / n as f64)
    };
    let centre = mean(&|_| 1.0);
    let axes: [[f64; D]; D] = std::array::from_fn(|axis| mean(&|k| sign(k, axis)));
    let mut straight = [[0.0; D]; 8];
    for (k, place) in straight.iter_mut().enumerate().take(n) {
        *place = std::array::from_fn(|i| {
            let even = centre[i] + (0..D).map(|axis| sign(k, axis) * axes[axis][i]).sum::<f64>();
            even + size * (corners[k][i] - even)
        });
    }
    straight
}

/// CPDI1: a parallelogram (parallelepiped) that follows F of the point, here with its lengths scaled by `size`.
fn deform_corners<const D: usize>(points: &Points<D>, p: usize, size: f64, moved: &mut Moved<D>) {
    let (F, x) = (&moved.deformation_gradient, &moved.position);
    let original = &points.original_corners[points.corner_range(p)];
    for (place, corner) in moved.corners.iter_mut().zip(original) {
        let arm = |d: usize| size * (corner[d] - points.original_position[p][d]);
        *place = std::array::from_fn(|i| x[i] + (0..D).map(|j| F[(i, j)] * arm(j)).sum::<f64>());
    }
}
