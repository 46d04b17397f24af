//! The quality of a run, judged by measures that cost hardly any time: the partition of unity, how well the domains fit
//! the bodies and the grid, the filling of the cells, and the convergence of the iterations.
//!
//! [`Measures`] are taken once per converged step; [`Quality`] keeps the worst values of all steps and warns when
//! a measure is out of bounds for the first time. The overlap of domains costs more and is computed only once, at the
//! end of the run.

mod cohesion;
mod collective;
mod contrast;
mod gaps;
mod holding;
mod measure;
mod motion;
mod overlap;
mod overstress;
mod passing;
mod pressure;
#[cfg(test)]
mod tests;
mod thresholds;
pub mod warning;
mod watch;

use std::collections::BTreeSet;
use std::fmt;

use cohesion::Cohesion;
pub use gaps::{Gap, gaps};
use holding::Held;
pub use measure::{BodyMeasures, CellValue, Measures, PointValue, newton_order};
pub use motion::Objection;
use motion::rotation_of_turn;
use overlap::domain_overlap;
pub use pressure::oscillation;
use thresholds::{
    HARMFUL_REGRIDDING, MAX_BOX_ROTATION, MAX_CROSSINGS, MAX_DILATING_OSCILLATION, MAX_OSCILLATION,
};
pub use thresholds::{MAX_ENERGY_ERROR, MAX_REGRIDDING};
pub use warning::{Code, Detail, Location, Warning};
pub use watch::BalanceSoFar;

use serde::{Deserialize, Serialize};

use crate::basis::DomainKind;
use crate::domain::DomainUpdate;
use crate::model::Model;
use crate::points::Points;

/// Largest loss of the partition of unity that causes no warning, [-].
const MAX_LOSS: f64 = 1e-3;
/// Largest share of a domain outside the grid that causes no warning, [-].
const MAX_OUTSIDE: f64 = 0.01;

/// The worst value of a measure so far, with its step, body and point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Worst {
    /// The worst value.
    pub value: f64,
    /// Step number.
    pub step: usize,
    /// Body number.
    pub body: usize,
    /// Permanent number of the point, for measures taken at points.
    pub point: Option<u32>,
}

/// The smallest filling ratio of any cell so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Filling {
    /// Volume of the points in the cell relative to the volume of the cell, [-].
    pub value: f64,
    /// Step number.
    pub step: usize,
    /// Cell number.
    pub cell: u32,
}

/// A total at the start of the run and its current value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Balance {
    /// Value at the start of the run.
    pub start: f64,
    /// Current value.
    pub now: f64,
}

impl Balance {
    /// Change since the start relative to the value at the start, [-]; 0 if that value is 0.
    pub fn relative_change(&self) -> f64 {
        if self.start == 0.0 { 0.0 } else { self.now / self.start - 1.0 }
    }
}

/// The measures of a step over all bodies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StepMeasures {
    /// Largest 1 − Σ S_vp, [-].
    pub partition_of_unity_loss: f64,
    /// Largest share of a domain outside the grid, [-]; 0 without domains.
    pub domain_outside_grid: f64,
    /// Volume of the domains relative to the volume of their points, minus 1, [-]; 0 without domains.
    pub domain_volume_excess: f64,
    /// Smallest filling ratio of a cell that holds points, [-].
    pub smallest_cell_filling: f64,
    /// Smallest and largest det F, [-].
    pub det_f: [f64; 2],
    /// Total mass, [mass].
    pub mass: f64,
    /// Total volume, [volume].
    pub volume: f64,
}

impl StepMeasures {
    fn new<const D: usize>(model: &Model<D>, measures: &Measures) -> StepMeasures {
        let bodies = &measures.bodies;
        let largest = |measure: fn(&BodyMeasures) -> Option<PointValue>| {
            bodies.iter().filter_map(measure).map(|found| found.value).fold(0.0, f64::max)
        };
        let (mut domains, mut points) = (0.0, 0.0);
        for (body, measured) in model.bodies.iter().zip(bodies) {
            if body.method.domain() != DomainKind::None {
                domains += measured.domain_volume;
                points += measured.volume;
            }
        }
        StepMeasures {
            partition_of_unity_loss: largest(|body| body.partition_of_unity_loss),
            domain_outside_grid: largest(|body| body.outside),
            domain_volume_excess: if points > 0.0 { domains / points - 1.0 } else { 0.0 },
            smallest_cell_filling: measures.smallest_filling.map_or(0.0, |filling| filling.value),
            det_f: bodies.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], body| {
                [low.min(body.det_f[0]), high.max(body.det_f[1])]
            }),
            mass: bodies.iter().map(|body| body.mass).sum(),
            volume: bodies.iter().map(|body| body.volume).sum(),
        }
    }
}

/// The quality of a run so far. A measure is `None` until a step has provided it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Largest 1 − Σ S_vp, [-].
    pub partition_of_unity_loss: Option<Worst>,
    /// Largest share of a domain outside the grid or, for domains given by corners, of its corners, [-].
    pub domain_outside_grid: Option<Worst>,
    /// Smallest filling ratio of a cell that holds points.
    pub smallest_cell_filling: Option<Filling>,
    /// Smallest and largest det F, [-].
    pub det_f: Option<[f64; 2]>,
    /// Total mass, [mass].
    pub mass: Balance,
    /// Total volume Σ J V_p0, [volume].
    pub volume: Balance,
    /// Volume of the domains of a body relative to the volume of its points, minus 1; the value of largest magnitude,
    /// [-].
    pub domain_volume_excess: Option<Worst>,
    /// Volume that domains share with each other at the end of the run, relative to the volume of all domains, [-].
    pub domain_overlap: Option<f64>,
    /// The measures of the last step over all bodies.
    pub latest: StepMeasures,
    /// Step number and observed order of the Newton iterations, [`newton_order`], of every step in which an order can
    /// be observed.
    pub newton_orders: Vec<(usize, f64)>,
    /// Largest angle of the rotation R in F = R U, about any axis, [degrees].
    pub rotation: Option<Worst>,
    /// Largest shear between two axes, [-].
    pub shear: Option<Worst>,
    /// Largest mean rotation of a body whose domains are boxes that cannot follow the rotation, [degrees].
    pub box_rotation: Option<Worst>,
    /// Largest oscillation of the pressures, [`oscillation`], over the cells that flow in a step, [-], and the step
    /// number.
    pub pressure_oscillation: Option<(f64, usize)>,
    /// Largest overstress of a step with viscosity, relative to the stress where bodies flow, [-], and the step number.
    #[serde(default)]
    pub overstress: Option<(f64, usize)>,
    /// For each body, number of cell boundaries crossed by its points without a domain, and number of these points.
    crossed: Vec<[usize; 2]>,
    /// The connected parts of the bodies in the first step of the run, or after the last change between stages.
    cohesion: Option<Cohesion>,
    /// True if the stiffness has been positive definite at least once.
    #[serde(default)]
    was_stable: bool,
    /// The material at the nodes of each boundary condition.
    held: Vec<Held>,
    /// Warnings raised so far, each with the number of the body, pair of bodies or boundary condition that it concerns;
    /// 0 for the whole run.
    #[serde(default)]
    raised: BTreeSet<(Code, usize)>,
}

impl Quality {
    /// The quality of a run that begins from the converged state of `points`.
    pub fn new<const D: usize>(points: &Points<D>) -> Quality {
        let mass: f64 = points.reduction().total(points.mass.iter().sum());
        let volume = points.reduction().total((0..points.len()).map(|p| points.volume(p)).sum());
        Quality {
            mass: Balance { start: mass, now: mass },
            volume: Balance { start: volume, now: volume },
            ..Quality::default()
        }
    }

    /// True if this can be the quality of a run with this number of bodies.
    pub fn fits(&self, bodies: usize) -> bool {
        let worst = [
            self.partition_of_unity_loss,
            self.domain_outside_grid,
            self.domain_volume_excess,
            self.rotation,
            self.shear,
            self.box_rotation,
        ];
        worst.iter().flatten().all(|worst| worst.body < bodies)
            && self.crossed.len() <= bodies
            && self.cohesion.as_ref().is_none_or(|cohesion| cohesion.fits(bodies))
    }

    /// Records the measures and the residuals of a step; returns the warnings that the step raises for the first time.
    pub fn accept<const D: usize>(
        &mut self,
        model: &Model<D>,
        step: usize,
        measures: &Measures,
        residuals: &[f64],
    ) -> Vec<Warning> {
        let mut warnings = Vec::new();
        self.crossed.resize(model.bodies.len(), [0; 2]);
        for (number, body) in measures.bodies.iter().enumerate() {
            for (worst, found) in [
                (&mut self.partition_of_unity_loss, body.partition_of_unity_loss),
                (&mut self.domain_outside_grid, body.outside),
                (&mut self.rotation, body.rotation),
                (&mut self.shear, body.shear),
            ] {
                if let Some(PointValue { value, point }) = found {
                    keep_worst(worst, Worst { value, step, body: number, point: Some(point) });
                }
            }
            if model.bodies[number].method.domain() != DomainKind::None && body.volume > 0.0 {
                let value = body.domain_volume / body.volume - 1.0;
                keep_worst(&mut self.domain_volume_excess, Worst { value, step, body: number, point: None });
            }
            if model.bodies[number].method.domain() == DomainKind::Box && body.volume > 0.0 {
                let value = rotation_of_turn(body.box_turning / body.volume);
                keep_worst(&mut self.box_rotation, Worst { value, step, body: number, point: None });
            }
            self.crossed[number][0] += body.crossings;
            self.crossed[number][1] = body.points;
            let [low, high] = self.det_f.unwrap_or(body.det_f);
            self.det_f = Some([low.min(body.det_f[0]), high.max(body.det_f[1])]);
            warn(model, step, number, body, &mut self.raised, &mut warnings);
        }
        if let Some(CellValue { value, cell }) = measures.smallest_filling
            && self.smallest_cell_filling.is_none_or(|kept| value < kept.value)
        {
            self.smallest_cell_filling = Some(Filling { value, step, cell });
        }
        self.latest = StepMeasures::new(model, measures);
        self.mass.now = self.latest.mass;
        self.volume.now = self.latest.volume;
        self.newton_orders.extend(newton_order(residuals).map(|order| (step, order)));
        warnings
    }

    /// Records that bodies of this mass and volume were added, or removed if the values are negative, [mass] and
    /// [volume].
    pub fn exchange(&mut self, mass: f64, volume: f64) {
        for (balance, change) in [(&mut self.mass, mass), (&mut self.volume, volume)] {
            balance.start += change;
            balance.now += change;
        }
        self.cohesion = None;
    }

    /// Records the state at the end of the run, if the run has completed a step.
    pub fn conclude<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) {
        // Without domains there is no overlap.
        if self.det_f.is_none() || model.bodies.iter().all(|body| body.method.domain() == DomainKind::None) {
            self.domain_overlap = None;
            return;
        }
        self.domain_overlap = domain_overlap(model, points);
    }

    /// Median of the observed orders of the Newton iterations.
    pub fn median_newton_order(&self) -> Option<f64> {
        let mut orders: Vec<f64> = self.newton_orders.iter().map(|(_, order)| *order).collect();
        orders.sort_by(f64::total_cmp);
        let upper = orders.len() / 2;
        let lower = orders.len().checked_sub(1)? / 2;
        Some(0.5 * (orders[lower] + orders[upper]))
    }

    /// Smallest observed order of the Newton iterations, with the step number.
    pub fn smallest_newton_order(&self) -> Option<(usize, f64)> {
        self.newton_orders.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The quality in one line; empty before the first step.
impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if let Some(loss) = self.partition_of_unity_loss {
            parts.push(format!("loss of partition of unity {:.1e} (limit {MAX_LOSS:e})", loss.value));
        }
        if let Some(outside) = self.domain_outside_grid {
            let [value, most] = [outside.value, MAX_OUTSIDE].map(|share| 100.0 * share);
            parts.push(format!("{value:.2} % of a domain outside the grid (limit {most} %)"));
        }
        if let Some(overlap) = self.domain_overlap {
            parts.push(format!("overlap of domains {:.2} %", 100.0 * overlap));
        }
        if let Some(turned) = self.box_rotation {
            parts
                .push(format!("boxes turned by {:.0}° on average (limit {MAX_BOX_ROTATION}°)", turned.value));
        }
        let crossings = (0..self.crossed.len()).filter_map(|body| self.mean_crossings(body)).reduce(f64::max);
        if let Some(crossings) = crossings {
            parts.push(format!(
                "points crossed {crossings:.2} cell boundaries on average (limit {MAX_CROSSINGS}, if the \
                 regridding work is also above {} %)",
                100.0 * HARMFUL_REGRIDDING
            ));
        }
        if let Some((oscillation, _)) = self.pressure_oscillation {
            parts.push(format!(
                "pressures in a cell differ by {oscillation:.2} × deviatoric stress (limit {MAX_OSCILLATION}, or \
                 {MAX_DILATING_OSCILLATION} where flow dilates)"
            ));
        }
        if let Some(filling) = self.smallest_cell_filling {
            parts.push(format!("cells filled to {:.1} % or more", 100.0 * filling.value));
        }
        if let Some([low, high]) = self.det_f {
            parts.push(format!("det F {low:.4} to {high:.4}"));
            parts.push(format!("volume changed by {:.2} %", 100.0 * self.volume.relative_change()));
        }
        if let Some(order) = self.median_newton_order() {
            parts.push(format!("Newton order {order:.2}"));
        }
        f.write_str(&parts.join(", "))
    }
}

fn keep_worst(kept: &mut Option<Worst>, found: Worst) {
    if kept.is_none_or(|kept| found.value.abs() > kept.value.abs()) {
        *kept = Some(found);
    }
}

/// Raises the warnings that have not been raised for this body before.
fn warn<const D: usize>(
    model: &Model<D>,
    step: usize,
    number: usize,
    measures: &BodyMeasures,
    raised: &mut BTreeSet<(Code, usize)>,
    warnings: &mut Vec<Warning>,
) {
    let body = &model.bodies[number];
    let name = &body.name;
    let mut exceeds =
        |code, found: Option<PointValue>, threshold, message: &dyn Fn(PointValue) -> String, detail| {
            if let Some(found) = found
                && found.value > threshold
                && raised.insert((code, number))
            {
                warnings.push(Warning {
                    code,
                    step,
                    location: Location::point(name, found.point),
                    value: Some(found.value),
                    threshold: Some(threshold),
                    message: format!("body `{name}`: {}", message(found)),
                    detail,
                });
            }
        };
    if let Some(objection) = Objection::to::<D>(body.domain_update) {
        let update = body.domain_update.name();
        let message = |PointValue { value, point }| {
            let motion = (objection.describe)(value);
            format!("its domain update `{update}` does not suit its motion: point {point} has {motion}")
        };
        exceeds(Code::DomainUpdate, measures.objection, objection.limit, &message, None);
    }
    let is_box = body.method.domain() == DomainKind::Box;
    let detail = (is_box && body.domain_update != DomainUpdate::Corners).then_some(Detail::ReachingBox);
    let (part, are) = match body.method.domain() {
        DomainKind::Corners => ("the corners of the domain", "are"),
        DomainKind::Box | DomainKind::None => ("the domain", "is"),
    };
    let message = |PointValue { value, point }| {
        format!("{:.1} % of {part} of point {point} {are} outside the grid", 100.0 * value)
    };
    exceeds(Code::DomainOutside, measures.outside, MAX_OUTSIDE, &message, detail);
    let message = |PointValue { value, point }| {
        let sum = 1.0 - value;
        format!(
            "the basis functions of point {point} add up to {sum:.4} instead of 1: its domain is partly outside the \
             grid"
        )
    };
    exceeds(Code::PartitionOfUnity, measures.partition_of_unity_loss, MAX_LOSS, &message, detail);
}
