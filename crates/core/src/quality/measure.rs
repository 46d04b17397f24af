//! The measures of one converged step.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::motion::{Objection, diagonal_misses_volume, rotation_of_turn, shear, turn};
use crate::basis::{Connectivity, DomainKind, domain_volume, nearest_with_distance};
use crate::grid::{Grid, MAX_CORNERS};
use crate::model::Model;
use crate::points::Points;

/// A value and the permanent number of the point that has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PointValue {
    /// The value.
    pub value: f64,
    /// Permanent number of the point.
    pub point: u32,
}

/// A value and the number of the cell that has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CellValue {
    /// The value.
    pub value: f64,
    /// Number of the cell.
    pub cell: u32,
}

/// The measures of one body in a step: each is the largest value over the points of the body, or the sum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyMeasures {
    /// 1 − Σ S_vp of the basis functions of the step, [-].
    pub partition_of_unity_loss: Option<PointValue>,
    /// Share of the domain, or of its corners if they define it, outside the grid, [-]; `None` without domains.
    pub outside: Option<PointValue>,
    /// Magnitude of the rotation, [degrees]; until all points have been measured, the [`turn`] instead.
    pub rotation: Option<PointValue>,
    /// Shear, [-].
    pub shear: Option<PointValue>,
    /// Departure of the motion from the motions that the domain update can follow, [`Objection`]; `None` if the domains
    /// are not boxes, or if the update suits every motion.
    pub objection: Option<PointValue>,
    /// Sum of volume times [`turn`] over the points whose domain is a box that cannot follow the rotation, [volume].
    pub box_turning: f64,
    /// Number of points without a domain that change cells in the step.
    pub crossings: usize,
    /// Number of points without a domain.
    pub points: usize,
    /// Smallest and largest det F, [-].
    pub det_f: [f64; 2],
    /// Mass, [mass].
    pub mass: f64,
    /// Volume of the points, Σ J V_p0, [volume].
    pub volume: f64,
    /// Volume of the domains of the points, [volume].
    pub domain_volume: f64,
}

impl Default for BodyMeasures {
    fn default() -> Self {
        BodyMeasures {
            partition_of_unity_loss: None,
            outside: None,
            rotation: None,
            shear: None,
            objection: None,
            box_turning: 0.0,
            crossings: 0,
            points: 0,
            det_f: [f64::INFINITY, f64::NEG_INFINITY],
            mass: 0.0,
            volume: 0.0,
            domain_volume: 0.0,
        }
    }
}

impl BodyMeasures {
    fn merge(&mut self, other: &BodyMeasures) {
        for (ours, theirs) in [
            (&mut self.partition_of_unity_loss, other.partition_of_unity_loss),
            (&mut self.outside, other.outside),
            (&mut self.rotation, other.rotation),
            (&mut self.shear, other.shear),
            (&mut self.objection, other.objection),
        ] {
            keep_largest(ours, theirs);
        }
        self.det_f = [self.det_f[0].min(other.det_f[0]), self.det_f[1].max(other.det_f[1])];
        self.box_turning += other.box_turning;
        self.crossings += other.crossings;
        self.points += other.points;
        self.mass += other.mass;
        self.volume += other.volume;
        self.domain_volume += other.domain_volume;
    }
}

/// Keeps the larger of two values, the first if they are equal.
#[inline]
fn keep_largest(kept: &mut Option<PointValue>, found: Option<PointValue>) {
    if let Some(found) = found
        && kept.is_none_or(|kept| found.value > kept.value)
    {
        *kept = Some(found);
    }
}

/// The measures of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// The measures of each body.
    pub bodies: Vec<BodyMeasures>,
    /// Smallest ratio of the volume of the points in a cell to the volume of the cell, at the start of the step, [-].
    /// Cells without points do not count.
    pub smallest_filling: Option<CellValue>,
}

impl Measures {
    /// Measures a step that is in equilibrium but not committed: the converged state of the points is the start of the
    /// step, to which `links` belong; the trial state is the end of the step, where the points lie in `next_grid`.
    pub fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        next_grid: &dyn Grid<D>,
    ) -> Measures {
        let objections: Vec<Option<Objection>> = (model.bodies.iter())
            .map(|body| match body.method.domain() {
                DomainKind::Box => Objection::to::<D>(body.domain_update),
                DomainKind::None | DomainKind::Corners => None,
            })
            .collect();
        let empty =
            || Measures { bodies: vec![BodyMeasures::default(); model.bodies.len()], smallest_filling: None };
        // Pieces of fixed size, added in order, give the same sums with any number of threads.
        let piece = 64;
        let pieces: Vec<Measures> = (0..links.n_groups().div_ceil(piece))
            .into_par_iter()
            .map(|k| {
                let mut measures = empty();
                for group in k * piece..((k + 1) * piece).min(links.n_groups()) {
                    measures.add_group(model, points, links, next_grid, &objections, group);
                }
                measures
            })
            .collect();
        let mut all = empty();
        pieces.iter().for_each(|piece| all.merge(piece));
        let everywhere = points.reduction().gather_all(std::mem::replace(&mut all, empty()));
        everywhere.iter().for_each(|part| all.merge(part));
        for rotation in all.bodies.iter_mut().filter_map(|body| body.rotation.as_mut()) {
            rotation.value = rotation_of_turn(rotation.value);
        }
        all
    }

    fn merge(&mut self, other: &Measures) {
        for (body, other) in self.bodies.iter_mut().zip(&other.bodies) {
            body.merge(other);
        }
        self.fill(other.smallest_filling);
    }

    fn fill(&mut self, found: Option<CellValue>) {
        if let Some(found) = found
            && self.smallest_filling.is_none_or(|kept| found.value < kept.value)
        {
            self.smallest_filling = Some(found);
        }
    }

    /// Adds the points of one group: those of a cell or of a patch of cells.
    fn add_group<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        next_grid: &dyn Grid<D>,
        objections: &[Option<Objection>],
        group: usize,
    ) {
        let mut filled: Option<CellValue> = None;
        for p in links.points_of(group) {
            let cell = points.cell[p];
            match &mut filled {
                Some(filled) if filled.cell == cell => filled.value += points.volume(p),
                _ => {
                    self.fill_with(model, filled);
                    filled = Some(CellValue { value: points.volume(p), cell });
                }
            }
            let number = points.body[p] as usize;
            let body = &mut self.bodies[number];
            let keep = |kept: &mut Option<PointValue>, value: f64| {
                keep_largest(kept, Some(PointValue { value, point: points.id[p] }));
            };
            let mut sum = 0.0;
            links.for_each_value(p, |_, value| sum += value);
            keep(&mut body.partition_of_unity_loss, (1.0 - sum).max(0.0));
            let gradient = &points.trial.deformation_gradient[p];
            let turn = turn::<D>(gradient);
            keep(&mut body.rotation, turn);
            keep(&mut body.shear, shear::<D>(gradient));
            if let Some(objection) = &objections[number] {
                keep(&mut body.objection, objection.measure(gradient));
            }
            let det_f = gradient.determinant();
            body.det_f = [body.det_f[0].min(det_f), body.det_f[1].max(det_f)];
            body.mass += points.mass[p];
            body.volume += det_f * points.original_volume[p];
            let (volume, outside) = match model.bodies[number].method.domain() {
                DomainKind::None => {
                    let x = &points.trial.position[p];
                    body.points += 1;
                    body.crossings += usize::from(next_grid.locate(x, Some(cell)) != Some(cell));
                    continue;
                }
                DomainKind::Box => {
                    if diagonal_misses_volume::<D>(gradient) {
                        body.box_turning += turn * det_f * points.original_volume[p];
                    }
                    let (x, l) = (&points.trial.position[p], &points.trial.half_lengths[p]);
                    (l.iter().map(|l| 2.0 * l).product(), share_of_box_outside(next_grid, x, l))
                }
                DomainKind::Corners => {
                    let corners = &points.trial.corners[points.corner_range(p)];
                    let share = share_of_corners_outside(next_grid, corners, points.cell[p]);
                    (domain_volume(corners), share)
                }
            };
            body.domain_volume += volume * model.depth(&points.trial.position[p]);
            keep(&mut body.outside, outside);
        }
        self.fill_with(model, filled);
    }

    /// Records the filling ratio of a cell, given the volume of the material in it, [volume].
    fn fill_with<const D: usize>(&mut self, model: &Model<D>, filled: Option<CellValue>) {
        let share = |CellValue { value, cell }| CellValue {
            value: value / volume_of_cell(model, cell as usize),
            cell,
        };
        self.fill(filled.map(share));
    }
}

/// Volume of material that fills a cell, [volume].
fn volume_of_cell<const D: usize>(model: &Model<D>, cell: usize) -> f64 {
    model.grid.volume(cell) * model.depth(&model.grid.centre(cell))
}

/// Share of the volume of a box outside the grid, [-]; on a grid without lines, share of its corners.
fn share_of_box_outside<const D: usize>(grid: &dyn Grid<D>, x: &[f64; D], half_lengths: &[f64; D]) -> f64 {
    let Some(lines) = grid.lines() else {
        let mut corners = [[0.0; D]; MAX_CORNERS];
        for (k, corner) in corners.iter_mut().enumerate() {
            *corner = std::array::from_fn(|d| {
                if k >> d & 1 == 1 { x[d] + half_lengths[d] } else { x[d] - half_lengths[d] }
            });
        }
        return share_of_corners_outside(grid, &corners[..1 << D], grid.nearest_cell(x));
    };
    let inside: f64 = (0..D)
        .map(|d| {
            let axis = &lines.axes()[d];
            let low = axis.coordinate(x[d] - half_lengths[d]);
            let high = axis.coordinate(x[d] + half_lengths[d]);
            let n = axis.n_cells() as f64;
            if low >= 0.0 && high <= n {
                return 1.0;
            }
            axis.distance(low.max(0.0), high.min(n)).max(0.0) / axis.distance(low, high)
        })
        .product();
    1.0 - inside
}

/// Distance from the grid within which a corner counts in part as outside, in cells.
const SLIGHTLY_OUTSIDE: f64 = 0.05;

/// Share of the corners of a domain outside the grid, [-].
fn share_of_corners_outside<const D: usize>(grid: &dyn Grid<D>, corners: &[[f64; D]], hint: u32) -> f64 {
    let part = |corner| (nearest_with_distance(grid, corner, hint).1 / SLIGHTLY_OUTSIDE).min(1.0);
    corners.iter().map(part).sum::<f64>() / corners.len().max(1) as f64
}

/// Residuals below this are round-off, [-].
const ROUND_OFF: f64 = 1e-12;

/// Observed order of the iterations of a step, from its last three residuals above round-off; `None` unless there are
/// three and they decrease. The residual of iteration 0 does not count, since it is not relative to the reactions.
pub fn newton_order(residuals: &[f64]) -> Option<f64> {
    let mut last = residuals.iter().skip(1).copied().filter(|r| *r > ROUND_OFF).rev();
    let (c, b, a) = (last.next()?, last.next()?, last.next()?);
    (a > b && b > c).then(|| (c / b).ln() / (b / a).ln())
}
