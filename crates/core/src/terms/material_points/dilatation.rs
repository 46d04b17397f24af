//! The evaluation of points that take the volume ratio of their cell: its mean there, or its value at the centre.
//!
//! The points of a body in a group are those of one cell, or of one patch of triangles or tetrahedra. First the
//! increments of all of them give the ratio, then each point responds, and then all add their parts.
#![allow(non_snake_case)]

use std::ops::Range;

use crate::assembly::{Coupling, Dense, Wanted};
use crate::basis::{Links, PointGeometry, Support};
use crate::kinematics::Increment;
use crate::material::Material;
use crate::stress::{
    Averaged, Averaging, Centred, Centring, Mechanics, PointError, PointResponse, StartOfStep, Volumetric,
    WeakForm,
};
use crate::tensor::Lanes;
use crate::terms::failure::PointFailure;

use super::evaluation::{MOST_HISTORY, Vectorised, map_gradients};

/// Factor of ΔF that changes the volume by `ratio`.
#[inline(always)]
fn stretch<const D: usize, M: Mechanics<D>>(ratio: f64) -> f64 {
    if M::DILATED == 2 { ratio.sqrt() } else { ratio.cbrt() }
}

/// The response of a point to a multiple of its increment, and the factor.
type Responded<R> = (PointResponse<R>, f64);

/// The increment of a point and det(ΔF).
#[derive(Clone, Copy)]
struct Motion<const D: usize> {
    increment: Increment<D>,
    dJ: f64,
}

impl<const D: usize> Motion<D> {
    fn new(p: usize, increment: Increment<D>) -> Result<Self, PointFailure> {
        let dJ = increment.determinant();
        if dJ > 0.0 && increment.hoop > 0.0 {
            return Ok(Motion { increment, dJ });
        }
        Err(PointFailure { point: p, error: PointError::Inverted { determinant: dJ } })
    }
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    /// Adds the points of a group, each body as it asks.
    pub(super) fn add_dilated(&mut self, points: Range<usize>) -> Result<(), PointFailure> {
        let bodies = &self.task.body[points.clone()];
        let Some(&first) = bodies.first() else { return Ok(()) };
        if bodies.iter().all(|body| *body == first) {
            return self.add_of_body(first, points);
        }
        for (n, &body) in bodies.iter().enumerate() {
            if !bodies[..n].contains(&body) {
                let members: Vec<usize> = points.clone().filter(|p| self.task.body[*p] == body).collect();
                self.add_of_body(body, members.iter().copied())?;
            }
        }
        Ok(())
    }

    /// Adds the points of one body.
    fn add_of_body(
        &mut self,
        body: u16,
        mut points: impl Iterator<Item = usize> + Clone,
    ) -> Result<(), PointFailure> {
        match self.task.model.bodies[body as usize].volumetric {
            Volumetric::Standard => points.try_for_each(|p| self.add(p..p + 1)),
            Volumetric::MeanDilatation => self.add_averaged(points),
            Volumetric::FBar => points.try_for_each(|p| self.add_centred(p)),
        }
    }

    /// Adds the points of one body with their mean dilatation.
    #[inline(always)]
    fn add_averaged(&mut self, points: impl Iterator<Item = usize>) -> Result<(), PointFailure> {
        let (mut before, mut after) = (0.0, 0.0);
        let mut moved = Vec::with_capacity(points.size_hint().0);
        for p in points {
            let motion = Motion::new(p, self.increment(p))?;
            let volume = self.task.start[p].volume_n;
            before += volume;
            after += volume * motion.dJ;
            moved.push((p, motion));
        }
        if let [(p, _)] = moved[..] {
            return self.add(p..p + 1); // its own mean
        }
        let theta = after / before;
        if UPDATED {
            let respond = |of: &mut Self, p: usize, barred: &Increment<D>| {
                of.respond(p, |start, law, old, new| M::respond_updated(start, barred, law, old, new))
            };
            let mut responses = Vec::with_capacity(moved.len());
            for (p, motion) in &moved {
                let (barred, factor) = barred::<D, M>(motion, theta);
                let response = respond(self, *p, &barred)?;
                responses.push((response.map(|weak| M::AveragingUpdated::from(&weak)), factor));
            }
            self.add_responses(&moved, after, &responses);
            return Ok(());
        }
        if let Some(responses) = self.isotropic(&moved, theta)? {
            self.add_responses(&moved, after, &responses);
            return Ok(());
        }
        let mut responses = Vec::with_capacity(moved.len());
        for some in moved.chunks(Lanes::WIDTH) {
            if self.respond_side_by_side(some, theta, &mut responses) {
                continue;
            }
            for (p, motion) in some {
                let (barred, factor) = barred::<D, M>(motion, theta);
                let response = self.respond(*p, |start, law, old, new| {
                    M::respond_averaging(start, &barred, law, old, new)
                })?;
                responses.push((response, factor));
            }
        }
        self.add_responses(&moved, after, &responses);
        Ok(())
    }

    /// The responses of points whose law has isotropic moduli; `None` for other laws.
    #[inline(always)]
    fn isotropic(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
    ) -> Result<Option<Vec<Responded<M::AveragingIsotropic>>>, PointFailure> {
        let mut responses = Vec::with_capacity(moved.len());
        for (p, motion) in moved {
            let (barred, factor) = barred::<D, M>(motion, theta);
            let (start, law) = (&self.task.start[*p], self.task.law(*p));
            let Some(response) = M::respond_averaging_isotropic(start, &barred, law) else {
                return Ok(None);
            };
            responses.push((response.map_err(|error| PointFailure { point: *p, error })?, factor));
        }
        Ok(Some(responses))
    }

    /// Responds at several points at once, if their law supports this; returns whether it did.
    #[inline(always)]
    fn respond_side_by_side(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
        responses: &mut Vec<Responded<M::Averaging>>,
    ) -> bool {
        let task = self.task;
        let law = task.law(moved[0].0);
        let kept = law.state_fields().len();
        if !M::VECTORISED || law.vectorised().is_none() || kept > MOST_HISTORY {
            return false;
        }
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
        for (l, (response, (p, _))) in found.into_iter().zip(moved).enumerate() {
            let here = p - self.trial.first;
            for (h, lanes) in history[..kept].iter().enumerate() {
                self.trial.history[here * n + h] = lanes.0[l];
            }
            responses.push((response, factors[l]));
        }
        true
    }

    /// The response of a point, with its history.
    #[inline(always)]
    fn respond<W>(
        &mut self,
        p: usize,
        response: impl FnOnce(
            &StartOfStep,
            &dyn Material,
            &[f64],
            &mut [f64],
        ) -> Result<PointResponse<W>, PointError>,
    ) -> Result<PointResponse<W>, PointFailure> {
        let task = self.task;
        let law = task.law(p);
        let (n, here) = (task.history_len, p - self.trial.first);
        let kept = law.state_fields().len();
        let old = &task.old_history[p * n..][..kept];
        let new = &mut self.trial.history[here * n..][..kept];
        response(&task.start[p], law, old, new).map_err(|error| PointFailure { point: p, error })
    }

    /// Adds the points of one body, whose volume is `volume`, under their common pressure.
    #[inline(always)]
    fn add_responses<R: Averaging<D>>(
        &mut self,
        moved: &[(usize, Motion<D>)],
        volume: f64,
        responses: &[Responded<R>],
    ) {
        let Vectorised { task, group, trial, room, force, dense } = self;
        // Σ V⁰π.
        let mut mean = 0.0;
        for ((p, _), (response, _)) in moved.iter().zip(responses) {
            let start = &task.start[*p];
            let [xx, yy, zz, ..] = response.tau.0;
            let trace = if M::DILATED == 2 { xx + yy } else { xx + yy + zz };
            mean += start.volume_n / start.J_n * trace;
        }
        mean /= M::DILATED as f64;
        let couples = task.wanted == Wanted::Stiffness;
        let symmetric = task.pairs.symmetric();
        let n = if couples { task.links.nodes_of(*group).len() } else { 0 };
        let mut gradient = vec![[0.0; D]; n];
        let mut column = vec![[0.0; D]; n];
        let mut row = vec![[0.0; D]; if symmetric { 0 } else { n }];
        let mut modulus = -mean;
        for ((p, motion), (response, factor)) in moved.iter().zip(responses) {
            trial.keep(*p, response);
            let part = task.start[*p].volume_n * motion.dJ / volume;
            let weak = response.weak.averaged(*factor, part * mean);
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
                row.clone_from(&column);
            }
            for (column, gradient) in column.iter_mut().zip(&gradient) {
                (0..D).for_each(|d| column[d] += modulus * gradient[d]);
            }
            dense.couple(&Coupling { mean: &gradient, row: &row, column: &column });
        }
    }

    /// Adds a point that takes the volume ratio at the centre of its cell.
    fn add_centred(&mut self, p: usize) -> Result<(), PointFailure> {
        let motion = Motion::new(p, self.increment(p))?;
        let task = self.task;
        let nodes = task.links.nodes_of(self.group);
        let centre = Centre::new(self, p);
        let links = task.links.links(p, self.room);
        let at_centre = Links { local: links.local, value: &centre.value, gradient: &centre.gradient };
        let of_centre = Increment::new(M::REVOLVED, nodes, &at_centre, task.delta_d, &centre.position);
        let of_centre = Motion::new(p, of_centre)?;
        let (barred, factor) = barred::<D, M>(&motion, of_centre.dJ);
        let response = self.respond(p, |start, law, old, new| {
            if UPDATED {
                let updated = M::respond_updated(start, &barred, law, old, new)?;
                return Ok(updated.map(|weak| M::Current::from(&weak)));
            }
            M::respond_current(start, &barred, law, old, new)
        })?;
        let response = response.map(|weak| weak.centred(factor, motion.dJ / of_centre.dJ));
        let Vectorised { trial, room, force, dense, .. } = self;
        trial.keep(p, &response);
        let weak = &response.weak;
        let links = task.links.links(p, room);
        let mut excess = centre.divergence::<M>(&of_centre.increment);
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
}

/// The increment with the volume ratio `theta`, and its factor.
#[inline(always)]
fn barred<const D: usize, M: Mechanics<D>>(motion: &Motion<D>, theta: f64) -> (Increment<D>, f64) {
    let factor = stretch::<D, M>(theta / motion.dJ);
    (motion.increment.scaled(factor, M::REVOLVED), factor)
}

/// The basis functions at the centre of the cell of a point, on the nodes of the point; over several cells their mean over
/// the domain of the point.
struct Centre<const D: usize> {
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    /// The position that the values give.
    position: [f64; D],
}

impl<const D: usize> Centre<D> {
    fn new<M: Mechanics<D>, K, const UPDATED: bool>(
        of: &mut Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>,
        p: usize,
    ) -> Self {
        let (task, grid) = (of.task, of.task.model.grid.as_ref());
        let half_lengths = task.half_lengths.get(p).copied().unwrap_or([0.0; D]);
        let position = &task.position[p];
        let point = PointGeometry { cell: task.cell[p], position, half_lengths: &half_lengths, corners: &[] };
        let mut support = Support::default();
        task.model.bodies[task.body[p] as usize].method.basis().at_centres(grid, &point, &mut support);
        let nodes = task.links.nodes_of(of.group);
        let links = task.links.links(p, of.room);
        let place = |node: usize| grid.node_position(task.links.active_nodes()[node] as usize);
        let mut centre = Centre {
            value: vec![0.0; links.local.len()],
            gradient: vec![[0.0; D]; links.local.len()],
            position: [0.0; D],
        };
        for ((&node, &value), &gradient) in support.nodes.iter().zip(&support.value).zip(&support.gradient) {
            let carrier = task.links.moves_with(node as usize);
            let Some(at) = links.local.iter().position(|l| Some(nodes[*l as usize] as usize) == carrier)
            else {
                continue;
            };
            centre.add(at, 1.0, value, gradient);
            // A sliver moves with the displacement field of the point.
            if carrier != task.links.active_number(node as usize) {
                let (from, to) =
                    (place(nodes[links.local[at] as usize] as usize), grid.node_position(node as usize));
                for (k, slope) in links.gradient.iter().enumerate() {
                    let along: f64 = (0..D).map(|d| (to[d] - from[d]) * slope[d]).sum();
                    centre.add(k, along, value, gradient);
                }
            }
        }
        for (local, value) in links.local.iter().zip(&centre.value) {
            let at = place(nodes[*local as usize] as usize);
            for d in 0..D {
                centre.position[d] += value * at[d];
            }
        }
        centre
    }

    fn add(&mut self, at: usize, factor: f64, value: f64, gradient: [f64; D]) {
        self.value[at] += factor * value;
        for d in 0..D {
            self.gradient[at][d] += factor * gradient[d];
        }
    }

    /// Divergence of the basis functions along each axis in the current configuration, [1/length].
    fn divergence<M: Mechanics<D>>(&self, increment: &Increment<D>) -> Vec<[f64; D]> {
        let inverse = increment.inverse();
        let mut mapped = vec![[0.0; D]; self.gradient.len()];
        map_gradients(&inverse, &self.gradient, &mut mapped);
        if M::REVOLVED {
            let per_radius = 1.0 / (increment.radius * increment.hoop);
            for (sum, value) in mapped.iter_mut().zip(&self.value) {
                sum[0] += value * per_radius;
            }
        }
        mapped
    }
}
