//! The evaluation of points that take the volume ratio of their cell: its mean over the cell, or its value at the
//! centre.
//!
//! The points of a material in a group are those of one cell, or of one patch of triangles or tetrahedra. First the
//! ratio is computed from the increments of all these points, then each point responds, and finally all points add
//! their contributions.
#![allow(non_snake_case)]

use std::ops::Range;

use crate::assembly::{Coupling, Dense, Wanted};
use crate::basis::{Links, PointGeometry};
use crate::grid::CellBasis;
use crate::kinematics::Increment;
use crate::stress::{
    Averaged, Averaging, Centred, Centring, MOST_HISTORY, Mechanics, PointResponse, Volumetric, WeakForm,
    suits_lanes,
};
use crate::tensor::Lanes;
use crate::terms::failure::PointFailure;

use super::cell_room::{CellRoom, CouplingRoom, Motion, Responded};
use super::evaluation::{Task, Vectorised, map_gradients};

/// Factor on ΔF that changes the volume by `ratio`.
#[inline(always)]
fn stretch<const D: usize, M: Mechanics<D>>(ratio: f64) -> f64 {
    if M::DILATED == 2 { ratio.sqrt() } else { ratio.cbrt() }
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    /// Adds the points of a group as the volumetric treatment of their bodies requires. Points of one material are
    /// averaged together, even across bodies.
    #[inline(always)]
    pub(super) fn add_dilated(&mut self, points: Range<usize>) -> Result<(), PointFailure> {
        let task = self.task;
        let kind = |p: usize| {
            let body = &task.model.bodies[task.body[p] as usize];
            (body.material, body.volumetric)
        };
        for first in points.clone() {
            let of_kind = kind(first);
            if (points.start..first).any(|p| kind(p) == of_kind) {
                continue;
            }
            let mut alike = (first..points.end).filter(|p| kind(*p) == of_kind);
            match of_kind.1 {
                Volumetric::Standard => alike.try_for_each(|p| self.add_alone(p))?,
                Volumetric::MeanDilatation => self.add_averaged(alike)?,
                Volumetric::FBar => alike.try_for_each(|p| self.add_centred(p))?,
            }
        }
        Ok(())
    }

    /// Adds a point with its own dilatation.
    #[inline(never)]
    fn add_alone(&mut self, p: usize) -> Result<(), PointFailure> {
        self.add(p..p + 1)
    }

    /// Adds the points of one material with their mean dilatation.
    #[inline(always)]
    fn add_averaged(&mut self, points: impl Iterator<Item = usize>) -> Result<(), PointFailure> {
        let mut room = std::mem::take(self.cell);
        let outcome = self.add_averaged_in(points, &mut room);
        *self.cell = room;
        outcome
    }

    #[inline(always)]
    fn add_averaged_in(
        &mut self,
        points: impl Iterator<Item = usize>,
        room: &mut CellRoom<D, M>,
    ) -> Result<(), PointFailure> {
        let (mut before, mut after) = (0.0, 0.0);
        let task = self.task;
        room.moved.clear();
        room.moved.reserve(task.links.points_of(self.group).len());
        for p in points {
            let motion = Motion::new(p, self.increment(p))?;
            let volume = task.start[p].volume_n;
            before += volume;
            after += volume * motion.dJ;
            room.moved.push((p, motion));
        }
        let CellRoom { moved, isotropic, averaging, updated, coupling } = room;
        if let [(p, _)] = moved[..] {
            return self.add_alone(p); // a single point is its own mean
        }
        // Growing the vector in steps would copy the responses again and again.
        let n = moved.len();
        let theta = after / before;
        let mut sum = 0.0;
        if UPDATED {
            updated.clear();
            updated.reserve(n);
            for (p, motion) in moved.iter() {
                let (barred, factor) = barred::<D, M>(motion, theta);
                let (old, new) = self.histories(*p);
                let response = M::respond_updated(&task.start[*p], &barred, task.law(*p), old, new);
                let response = response.map_err(|error| PointFailure { point: *p, error })?;
                let weak = M::AveragingUpdated::from(&response.weak);
                sum += self.keep(*p, &response);
                updated.push((weak, factor));
            }
            self.add_responses(moved, after, sum, updated, coupling);
        } else if self.respond_isotropic(moved, theta, &mut sum, isotropic)? {
            self.add_responses(moved, after, sum, isotropic, coupling);
        } else {
            averaging.clear();
            averaging.reserve(n);
            for some in moved.chunks(Lanes::WIDTH) {
                if self.respond_side_by_side(some, theta, &mut sum, averaging) {
                    continue;
                }
                for (p, motion) in some {
                    let (barred, factor) = barred::<D, M>(motion, theta);
                    let (old, new) = self.histories(*p);
                    let response = M::respond_averaging(&task.start[*p], &barred, task.law(*p), old, new);
                    let response = response.map_err(|error| PointFailure { point: *p, error })?;
                    sum += self.keep(*p, &response);
                    averaging.push((response.weak, factor));
                }
            }
            self.add_responses(moved, after, sum, averaging, coupling);
        }
        Ok(())
    }

    /// Evaluates the responses of points whose law has isotropic moduli; returns true if it did so.
    #[inline(always)]
    fn respond_isotropic(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
        sum: &mut f64,
        responses: &mut Vec<Responded<M::AveragingIsotropic>>,
    ) -> Result<bool, PointFailure> {
        responses.clear();
        responses.reserve(moved.len());
        for (p, motion) in moved {
            let (barred, factor) = barred::<D, M>(motion, theta);
            let (start, law) = (&self.task.start[*p], self.task.law(*p));
            let Some(response) = M::respond_averaging_isotropic(start, &barred, law) else {
                return Ok(false);
            };
            let response = response.map_err(|error| PointFailure { point: *p, error })?;
            *sum += self.keep(*p, &response);
            responses.push((response.weak, factor));
        }
        Ok(true)
    }

    /// Stores the stress and strain of a point, and returns its contribution to Σ V⁰π n over its cell.
    #[inline(always)]
    fn keep<W>(&mut self, p: usize, response: &PointResponse<W>) -> f64 {
        self.trial.keep(p, response);
        let start = &self.task.start[p];
        let [xx, yy, zz, ..] = response.tau.0;
        let trace = if M::DILATED == 2 { xx + yy } else { xx + yy + zz };
        start.volume_n / start.J_n * trace
    }

    /// Evaluates the responses of several points at once, if their law supports this; returns true if it did so.
    #[inline(always)]
    fn respond_side_by_side(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
        sum: &mut f64,
        responses: &mut Vec<Responded<M::Averaging>>,
    ) -> bool {
        let task = self.task;
        let law = task.law(moved[0].0);
        if !M::VECTORISED || !suits_lanes(law) {
            return false;
        }
        let kept = law.state_fields().len();
        // Unused lanes repeat the last point.
        let last = moved.len() - 1;
        let of_lane: [usize; Lanes::WIDTH] = std::array::from_fn(|l| moved[l.min(last)].0);
        let starts = of_lane.map(|p| &task.start[p]);
        let mut factors = [1.0; Lanes::WIDTH];
        let mut increments = [moved[last].1.increment; Lanes::WIDTH];
        for l in 0..Lanes::WIDTH {
            (increments[l], factors[l]) = barred::<D, M>(&moved[l.min(last)].1, theta);
        }
        let n = task.history_len;
        let mut history = [Lanes::ZERO; MOST_HISTORY];
        for (h, lanes) in history[..kept].iter_mut().enumerate() {
            *lanes = Lanes::gather(|l| task.old_history[of_lane[l] * n + h]);
        }
        let Some(found) = M::respond_averaging_vectorised(starts, &increments, law, &mut history[..kept])
        else {
            return false;
        };
        // By reference: responses are large, and every move copies them.
        for (l, (p, _)) in moved.iter().enumerate() {
            let here = p - self.trial.first;
            for (h, lanes) in history[..kept].iter().enumerate() {
                self.trial.history[here * n + h] = lanes.0[l];
            }
            *sum += self.keep(*p, &found[l]);
            responses.push((found[l].weak, factors[l]));
        }
        true
    }

    /// History variables of a point at the start and at the end of the step.
    #[inline(always)]
    fn histories(&mut self, p: usize) -> (&[f64], &mut [f64]) {
        let task = self.task;
        let (n, here) = (task.history_len, p - self.trial.first);
        let kept = task.law(p).state_fields().len();
        (&task.old_history[p * n..][..kept], &mut self.trial.history[here * n..][..kept])
    }

    /// Adds these points, whose volume is `volume`, under their common pressure; `sum` is Σ V⁰π n.
    #[inline(always)]
    fn add_responses<R: Averaging<D>>(
        &mut self,
        moved: &[(usize, Motion<D>)],
        volume: f64,
        sum: f64,
        responses: &[Responded<R>],
        coupling: &mut CouplingRoom<D>,
    ) {
        let Vectorised { task, group, trial, room, force, dense, .. } = self;
        let mean = sum / M::DILATED as f64;
        let couples = task.wanted == Wanted::Stiffness;
        let symmetric = task.pairs.symmetric();
        let n = if couples { task.links.nodes_of(*group).len() } else { 0 };
        let CouplingRoom { gradient, column, row } = coupling;
        for nodal in [&mut *gradient, column, row] {
            nodal.clear();
            nodal.resize(n, [0.0; D]);
        }
        let mut modulus = -mean;
        for ((p, motion), (weak, factor)) in moved.iter().zip(responses) {
            let part = task.start[*p].volume_n * motion.dJ / volume;
            let weak = weak.averaged(*factor, part * mean);
            let links = task.links.links(*p, room);
            let mapped = match weak.inverse() {
                None => links.gradient,
                Some(inverse) => map_gradients(inverse, links.gradient, trial.mapped),
            };
            dense.add(&weak, &links, mapped, force, &|_, _| ());
            if !couples {
                continue;
            }
            modulus += weak.modulus();
            for ((&local, g), value) in links.local.iter().zip(mapped).zip(links.value) {
                let (node, g) = (local as usize, weak.gradient(g, *value));
                let divergence = R::Averaged::divergence(&g);
                let of_column = weak.column_of_coupling(&g);
                for d in 0..D {
                    gradient[node][d] += part * divergence[d];
                    column[node][d] += of_column[d];
                }
                if !symmetric {
                    let of_row = weak.row_of_coupling(&g);
                    (0..D).for_each(|d| row[node][d] += of_row[d]);
                }
            }
        }
        if couples {
            if symmetric {
                row.copy_from_slice(column);
            }
            for (column, gradient) in column.iter_mut().zip(gradient.iter()) {
                (0..D).for_each(|d| column[d] += modulus * gradient[d]);
            }
            dense.couple(&Coupling { mean: gradient, row, column });
        }
    }

    /// Adds a point that takes the volume ratio at the centre of its cell.
    #[inline(never)]
    fn add_centred(&mut self, p: usize) -> Result<(), PointFailure> {
        let task = self.task;
        let motion = Motion::new(p, self.increment(p))?;
        let (theta, mut excess) = self.at_centres(p)?;
        let (barred, factor) = barred::<D, M>(&motion, theta);
        let (old, new) = self.histories(p);
        let (start, law) = (&task.start[p], task.law(p));
        let response = if UPDATED {
            let updated = M::respond_updated(start, &barred, law, old, new);
            updated.map(|response| response.map(|weak| M::Current::from(&weak)))
        } else {
            M::respond_current(start, &barred, law, old, new)
        };
        let response = response.map_err(|error| PointFailure { point: p, error })?;
        let response = response.map(|weak| weak.centred(factor, motion.dJ / theta));
        let Vectorised { trial, room, force, dense, .. } = self;
        trial.keep(p, &response);
        let weak = &response.weak;
        let links = task.links.links(p, room);
        let mapped = match weak.inverse() {
            None => links.gradient,
            Some(inverse) => map_gradients(inverse, links.gradient, trial.mapped),
        };
        for ((excess, g), value) in excess.iter_mut().zip(mapped).zip(links.value) {
            type Point<const D: usize, M> = <<M as Mechanics<D>>::Current as Centring<D>>::Centred;
            let divergence = Point::<D, M>::divergence(&weak.gradient(g, *value));
            for d in 0..D {
                excess[d] -= divergence[d];
            }
        }
        dense.add(weak, &links, mapped, force, &|n, column| weak.add_excess(&excess[n], column));
        Ok(())
    }

    /// The volume ratio at the centre of the cell of a point, and the derivative of its logarithm with respect to the
    /// displacements of the nodes of the point, [1/length]; if the domain spans several cells, the mean of the ratios,
    /// weighted by the shares of the domain in the cells.
    fn at_centres(&mut self, p: usize) -> Result<(f64, Vec<[f64; D]>), PointFailure> {
        let (task, grid) = (self.task, self.task.model.grid.as_ref());
        let nodes = task.links.nodes_of(self.group);
        let half_lengths = task.half_lengths.get(p).copied().unwrap_or([0.0; D]);
        let (cell, position) = (task.cell[p], &task.position[p]);
        let point = PointGeometry { cell, position, half_lengths: &half_lengths, corners: &[] };
        let shares = task.model.bodies[task.body[p] as usize].method.basis().shares(grid, &point);
        let links = task.links.links(p, self.room);
        let (mut theta, mut with_nodes) = (0.0, vec![[0.0; D]; links.local.len()]);
        for (cell, share) in shares {
            let centre = grid.centre(cell as usize);
            let basis = grid.basis_at(cell, &centre);
            let (value, gradient) = on_nodes_of_point(task, nodes, &links, &basis);
            let at_centre = Links { local: links.local, value: &value, gradient: &gradient };
            let increment = Increment::new(M::REVOLVED, nodes, &at_centre, task.delta_d, &centre);
            let motion = Motion::new(p, increment)?;
            let mut mapped = vec![[0.0; D]; gradient.len()];
            map_gradients(&motion.increment.inverse(), &gradient, &mut mapped);
            theta += share * motion.dJ;
            for ((sum, g), value) in with_nodes.iter_mut().zip(&mapped).zip(&value) {
                (0..D).for_each(|d| sum[d] += share * motion.dJ * g[d]);
                if M::REVOLVED {
                    sum[0] += share * motion.dJ * value / (centre[0] * motion.increment.hoop);
                }
            }
        }
        with_nodes.as_flattened_mut().iter_mut().for_each(|x| *x /= theta);
        Ok((theta, with_nodes))
    }
}

/// Values and gradients of the basis of a cell at the nodes that a point touches; `nodes` are the nodes of its group.
/// Other nodes, which the point would touch only by slivers of its basis functions, move with its displacement field.
fn on_nodes_of_point<const D: usize, M>(
    task: &Task<D, M>,
    nodes: &[u32],
    links: &Links<D>,
    basis: &CellBasis<D>,
) -> (Vec<f64>, Vec<[f64; D]>) {
    let grid = task.model.grid.as_ref();
    let n = links.local.len();
    let active = |k: usize| nodes[links.local[k] as usize] as usize;
    let largest = (1..n).fold(0, |most, k| if links.value[k] > links.value[most] { k } else { most });
    let (mut values, mut gradients) = (vec![0.0; n], vec![[0.0; D]; n]);
    let mut add = |k: usize, factor: f64, value: f64, gradient: &[f64; D]| {
        values[k] += factor * value;
        (0..D).for_each(|d| gradients[k][d] += factor * gradient[d]);
    };
    for ((&node, &value), gradient) in basis.nodes().iter().zip(basis.value()).zip(basis.gradient()) {
        let number = task.links.active_number(node as usize);
        if let Some(k) = (0..n).find(|&k| Some(active(k)) == number) {
            add(k, 1.0, value, gradient);
            continue;
        }
        let from = grid.node_position(task.links.active_nodes()[active(largest)] as usize);
        let to = grid.node_position(node as usize);
        add(largest, 1.0, value, gradient);
        for (k, slope) in links.gradient.iter().enumerate() {
            let along: f64 = (0..D).map(|d| (to[d] - from[d]) * slope[d]).sum();
            add(k, along, value, gradient);
        }
    }
    (values, gradients)
}

/// The increment with the volume ratio `theta`, and the factor applied to it.
#[inline(always)]
fn barred<const D: usize, M: Mechanics<D>>(motion: &Motion<D>, theta: f64) -> (Increment<D>, f64) {
    let factor = stretch::<D, M>(theta / motion.dJ);
    (motion.increment.scaled(factor, M::REVOLVED), factor)
}
