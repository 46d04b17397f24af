//! The evaluation of points that take the volume ratio of their cell: its mean over the cell, or its value at the
//! centre.
//!
//! The points of a material in a group are those of one cell, or of one patch of triangles or tetrahedra. First the
//! ratio is computed from the increments of all these points, then each point responds, and finally all points add
//! their contributions.
#![allow(non_snake_case)]

use std::ops::Range;

use crate::assembly::{Coupling, Dense, Wanted};
use crate::basis::{LinkBuffer, Links, PointGeometry};
use crate::grid::CellBasis;
use crate::kinematics::Increment;
use crate::stress::{
    Averaged as _, Averaging, CellStrain, Centred, Centring, Mechanics, PointResponse, WeakForm,
};
use crate::terms::failure::PointFailure;

use super::averaged::{Averaged, Found, Kind};
use super::cell_room::{CellRoom, CouplingRoom, Motion, Responded, barred};
use super::evaluation::{Task, Trial, Vectorised, map_gradients};

impl<const D: usize, M: Mechanics<D>> Task<'_, D, M> {
    /// The material of a point and the deformation that it sees.
    #[inline(always)]
    pub(super) fn kind(&self, p: usize) -> Kind {
        let body = &self.model.bodies[self.body[p] as usize];
        Kind { material: body.material, strain: body.strain }
    }
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    /// Adds the points of a group with the deformation that their bodies require. Points of one material are
    /// averaged together, even across bodies.
    #[inline(always)]
    pub(super) fn add_dilated(&mut self, points: Range<usize>) -> Result<(), PointFailure> {
        let task = self.task;
        for first in points.clone() {
            let kind = task.kind(first);
            if (points.start..first).any(|p| task.kind(p) == kind) {
                continue;
            }
            let mut alike = (first..points.end).filter(|p| task.kind(*p) == kind);
            match kind.strain {
                CellStrain::Standard => alike.try_for_each(|p| self.add_alone(p))?,
                CellStrain::MeanDilatation => self.add_averaged(first..points.end, kind)?,
                CellStrain::FBar => alike.try_for_each(|p| self.add_centred(p))?,
                CellStrain::Mean => self.add_mean(first..points.end, kind)?,
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
    fn add_averaged(&mut self, points: Range<usize>, kind: Kind) -> Result<(), PointFailure> {
        let mut cell = std::mem::take(self.cell);
        let Vectorised { task, group, trial, room, .. } = self;
        let averaged = Averaged { task, group: *group, points, kind, trial, room, cell: &mut cell };
        let found = averaged.find()?;
        let CellRoom { moved, isotropic, averaging, coupling, .. } = &mut cell;
        match found {
            Found::Alone(p) => self.add_alone(p)?,
            Found::Together { volume, sum, isotropic: true } => {
                self.add_responses(moved, volume, sum, isotropic, coupling);
            }
            Found::Together { volume, sum, isotropic: false } => {
                self.add_responses(moved, volume, sum, averaging, coupling);
            }
        }
        *self.cell = cell;
        Ok(())
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
                let column_share = weak.column_of_coupling(&g);
                for d in 0..D {
                    gradient[node][d] += part * divergence[d];
                    column[node][d] += column_share[d];
                }
                if !symmetric {
                    let row_share = weak.row_of_coupling(&g);
                    (0..D).for_each(|d| row[node][d] += row_share[d]);
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
        let Vectorised { task, group, trial, room, force, dense, .. } = self;
        let (response, mut excess) = task.respond_centred(*group, p, trial, room)?;
        trial.keep(p, &response);
        let weak = &response.weak;
        let links = task.links.links(p, room);
        let mapped = match weak.inverse() {
            None => links.gradient,
            Some(inverse) => map_gradients(inverse, links.gradient, trial.mapped),
        };
        for ((excess, g), value) in excess.iter_mut().zip(mapped).zip(links.value) {
            let divergence = PointCentred::<D, M>::divergence(&weak.gradient(g, *value));
            for d in 0..D {
                excess[d] -= divergence[d];
            }
        }
        dense.add(weak, &links, mapped, force, &|n, column| weak.add_excess(&excess[n], column));
        Ok(())
    }
}

/// The weak form of a point that takes the volume ratio at the centre of its cell.
type PointCentred<const D: usize, M> = <<M as Mechanics<D>>::Current as Centring<D>>::Centred;

impl<const D: usize, M: Mechanics<D>> Task<'_, D, M> {
    /// The response of a point to the volume ratio at the centre of its cell, and the derivative of the logarithm of
    /// this ratio, as [`Task::at_centres`] returns it.
    // Inlined, this function would be compiled once for each form of the stiffness.
    #[inline(never)]
    #[expect(clippy::type_complexity)]
    fn respond_centred(
        &self,
        group: usize,
        p: usize,
        trial: &mut Trial<D>,
        room: &mut LinkBuffer<D>,
    ) -> Result<(PointResponse<PointCentred<D, M>>, Vec<[f64; D]>), PointFailure> {
        let motion = Motion::new(p, self.increment(group, p, room))?;
        let (theta, gradient) = self.at_centres(group, p, room)?;
        let (barred, factor) = barred::<D, M>(&motion, theta);
        let (old, new) = self.histories(p, trial);
        let (start, law) = (&self.start[p], self.law(p));
        let response = M::respond_current(start, &barred, law, old, new);
        let response = response.map_err(|error| PointFailure { point: p, error })?;
        Ok((response.map(|weak| weak.centred(factor, motion.dJ / theta)), gradient))
    }

    /// The volume ratio at the centre of the cell of a point, and the derivative of its logarithm with respect to the
    /// displacements of the nodes of the point, [1/length]; if the domain spans several cells, the mean of the ratios,
    /// weighted by the shares of the domain in the cells.
    fn at_centres(
        &self,
        group: usize,
        p: usize,
        room: &mut LinkBuffer<D>,
    ) -> Result<(f64, Vec<[f64; D]>), PointFailure> {
        let (grid, nodes) = (self.model.grid.as_ref(), self.links.nodes_of(group));
        let half_lengths = self.half_lengths.get(p).copied().unwrap_or([0.0; D]);
        let (cell, position) = (self.cell[p], &self.position[p]);
        let point = PointGeometry { cell, position, half_lengths: &half_lengths, corners: &[] };
        let shares = self.model.bodies[self.body[p] as usize].method.basis().shares(grid, &point);
        let links = self.links.links(p, room);
        let (mut theta, mut with_nodes) = (0.0, vec![[0.0; D]; links.local.len()]);
        for (cell, share) in shares {
            let centre = grid.centre(cell as usize);
            let basis = grid.basis_at(cell, &centre);
            let (value, gradient) = on_nodes_of_point(self, self.body[p], nodes, &links, &basis);
            let at_centre = Links { local: links.local, value: &value, gradient: &gradient };
            let increment = Increment::new(M::REVOLVED, nodes, &at_centre, self.delta_d, &centre);
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

/// Values and gradients of the basis of a cell at the nodes that a point of `body` touches; `nodes` are the nodes of its
/// group.
/// Other nodes, which the point would touch only by slivers of its basis functions, move with its displacement field.
fn on_nodes_of_point<const D: usize, M>(
    task: &Task<D, M>,
    body: u16,
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
        let number = task.links.seen_by(body, node as usize);
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
