//! Limit loads: a stage that ends once its load no longer grows with the displacement.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::equilibrium::StepReport;
use crate::material::axial_modulus_at_rest;
use crate::model::Model;
use crate::points::Points;

/// Rise of the load with the displacement, relative to its steepest rise, below which the load no longer grows,
/// [-].
const PLATEAU: f64 = 0.01;
/// Number of consecutive steps in which the load must not grow: a single one may be a contact that opens.
const STEPS: usize = 2;

/// Part of the load that viscosity may carry in a step that counts as one without viscosity, [-].
const VISCOUS: f64 = 0.01;
/// Change of the load from one step with viscosity to the next, relative to the load, up to which the load counts as
/// steady, [-].
const STEADY: f64 = 0.005;

/// Load and displacement of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Loading {
    /// The force along the largest prescribed displacement, [force], or the load factor, [-].
    pub load: f64,
    /// The displacement in the step, [length], or a share of the path.
    pub displacement: f64,
    /// The part of the load that viscosity carries.
    pub viscous: f64,
}

/// Rise of a load with the displacement below which it is round-off, relative to the modulus of the softest material and
/// the size of the points, [-].
const ROUND_OFF: f64 = 1e-9;

impl Loading {
    /// Rise of the load with the displacement below which it is round-off: a small part of what a point of the softest
    /// material would resist, [force/length]; 0 for a load factor.
    pub(crate) fn round_off<const D: usize>(model: &Model<D>, points: &Points<D>) -> f64 {
        if model.stepping.control.has_unknown_factor() {
            return 0.0;
        }
        let moduli = model.materials.iter().map(|material| axial_modulus_at_rest(material.law.as_ref()));
        let softest = moduli.fold(f64::INFINITY, f64::min);
        let volumes = points.original_volume.iter().copied();
        let size = points.reduction().smallest(volumes.fold(f64::INFINITY, f64::min)).powf(1.0 / D as f64);
        let scale = softest * size.powi(D as i32 - 2);
        if scale.is_finite() { ROUND_OFF * scale } else { 0.0 }
    }

    /// The load at the end of a step: with a load factor that follows from equilibrium, this factor against the
    /// displacement or the arc length that grows with time; otherwise the force that prescribed motions need. `None` if
    /// nothing is moved.
    pub(crate) fn measured<const D: usize>(
        model: &Model<D>,
        report: &StepReport<D>,
        factor: f64,
    ) -> Option<Loading> {
        if model.stepping.control.has_unknown_factor() {
            return Some(Loading { load: factor, displacement: report.step.duration(), viscous: 0.0 });
        }
        let load = report.driven.force()?;
        let viscous = report.viscous_share().min(1.0) * load;
        Some(Loading { load, displacement: report.driven.displacement, viscous })
    }
}

/// The load of a stage, and whether it still grows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LimitLoad {
    /// The load of largest magnitude in the stage: the force along the largest prescribed displacement, [force], or the
    /// load factor, [-], if it follows from equilibrium. Steps in which viscosity carries a part of it do not count, except
    /// the last one.
    pub largest: f64,
    /// The load of the last step.
    pub load: f64,
    /// Displacement in the stage so far.
    displacement: f64,
    /// Rise of the load with the displacement, in the last step.
    slope: f64,
    /// Largest rise of the load with the displacement in a step.
    steepest: f64,
    /// Number of consecutive steps so far in which the load has not grown.
    flat: usize,
    /// The load of largest magnitude in a step without viscosity.
    #[serde(default)]
    settled: f64,
    /// The part of the force of the last step that viscosity carried, which the loads do not contain.
    #[serde(default)]
    viscous: f64,
}

/// The load of a stage that runs until its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageLimit {
    /// Number of the stage, from 0.
    pub stage: usize,
    /// The load.
    pub limit: LimitLoad,
}

impl LimitLoad {
    /// Takes a step into account. Rises of the load with the displacement of up to `round_off` count as none.
    pub(crate) fn follow(&mut self, loading: Option<Loading>, round_off: f64) {
        let Some(Loading { load, displacement, viscous }) =
            loading.filter(|loading| loading.displacement > 0.0)
        else {
            return;
        };
        // What viscosity carries is no part of the limit, as far as it can be told apart.
        let load = load - viscous;
        let was_viscous = std::mem::replace(&mut self.viscous, viscous).abs() > VISCOUS * self.load.abs();
        let is_viscous = viscous.abs() > VISCOUS * load.abs();
        // What was carried before anything was moved is no rise, and a motion that turns back begins anew.
        if self.displacement == 0.0 || load * self.load < 0.0 {
            let settled = if is_viscous { 0.0 } else { load };
            *self = LimitLoad { load, largest: load, settled, displacement, viscous, ..LimitLoad::default() };
            return;
        }
        // Of both signs, as the load of a footing that is pushed down or pulled up.
        self.slope = (load.abs() - self.load.abs()) / displacement;
        self.displacement += displacement;
        if self.slope > round_off {
            self.steepest = self.steepest.max(self.slope);
        }
        // What viscosity carries is known roughly where it changes, and falls once the relaxation time shrinks.
        let is_steady = (load - self.load).abs() <= STEADY * load.abs();
        let is_known = is_steady || !(is_viscous || was_viscous);
        let is_flat = self.steepest > 0.0 && self.slope < PLATEAU * self.steepest && is_known;
        self.flat = if is_flat { self.flat + 1 } else { 0 };
        self.load = load;
        if !is_viscous {
            self.settled = larger(self.settled, load);
        }
        self.largest = if is_viscous { larger(self.settled, load) } else { self.settled };
    }

    /// True once the load no longer grows.
    pub fn is_reached(&self) -> bool {
        self.flat >= STEPS
    }

    /// The largest rise of the load with the displacement in a step, and that in the last step.
    pub fn slopes(&self) -> [f64; 2] {
        [self.steepest, self.slope]
    }

    /// Displacement in the stage so far.
    pub fn displacement(&self) -> f64 {
        self.displacement
    }

    /// The load of the last step, which is less than the largest if the load has passed a peak, and the largest load or,
    /// if the load still rises, the one that would be reached if it went on so over as long a displacement again. What
    /// viscosity carries counts as uncertain.
    pub fn bracket(&self) -> [f64; 2] {
        let rise = self.slope.max(0.0) * self.displacement + self.viscous.abs();
        [self.load, self.largest + rise.copysign(self.largest)]
    }
}

/// The load of larger magnitude.
fn larger(first: f64, second: f64) -> f64 {
    if second.abs() > first.abs() { second } else { first }
}

impl fmt::Display for LimitLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([low, high], largest) = (self.bracket(), self.largest);
        if self.displacement == 0.0 {
            f.write_str("unknown: nothing was moved")
        } else if self.is_reached() {
            write!(
                f,
                "{largest:.5e}, between {low:.5e} (the last load) and {high:.5e} (the largest expected)"
            )
        } else {
            write!(f, "not reached: the load still grew at the end, at {largest:.5e}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loads of equal steps.
    fn followed(loads: &[f64]) -> LimitLoad {
        let mut limit = LimitLoad::default();
        loads.iter().for_each(|load| {
            limit.follow(Some(Loading { load: *load, displacement: 0.1, viscous: 0.0 }), 0.0)
        });
        limit
    }

    #[test]
    fn a_plateau_of_either_sign_ends_the_stage() {
        let rising: Vec<f64> = (0..20).map(|k| 1.0 - 0.5f64.powi(k + 1)).collect();
        let first = (1..=20).find(|n| followed(&rising[..*n]).is_reached()).unwrap();
        // The rise halves in each step, and that of the first is not known: the ninth is below 1 % of the second, and so is
        // the tenth.
        assert_eq!(first, 10);
        let limit = followed(&rising[..first]);
        let [low, high] = limit.bracket();
        assert!(low < 1.0 && 1.0 < high && high < 1.02, "{low} {high}");
        let negative: Vec<f64> = rising.iter().map(|load| -load).collect();
        let mirrored = followed(&negative[..first]);
        assert!(mirrored.is_reached());
        assert_eq!(mirrored.bracket(), [-low, -high]);
    }

    #[test]
    fn a_peak_is_the_limit_and_a_single_dip_is_not() {
        let peak = followed(&[1.0, 1.8, 1.9, 1.7, 1.5]);
        assert!(peak.is_reached());
        assert_eq!((peak.largest, peak.bracket()), (1.9, [1.5, 1.9]));
        assert!(!followed(&[1.0, 1.8, 1.7, 2.0, 1.99]).is_reached());
    }

    #[test]
    fn what_is_carried_before_the_motion_is_no_rise() {
        assert!(!followed(&[50.0, 50.5, 51.0, 51.5, 52.0]).is_reached());
        assert!(followed(&[50.0, 50.5, 51.0, 51.0, 51.0]).is_reached());
    }

    #[test]
    fn a_motion_that_turns_back_begins_anew() {
        // The force that pushes back does negative work until the body has come to rest, then positive work.
        let mut loads = vec![1.0, 2.0, 3.0, -2.5, -1.5, -0.5, 0.5, 1.5];
        assert!((1..=loads.len()).all(|n| !followed(&loads[..n]).is_reached()));
        loads.extend([2.0, 2.0, 2.0]);
        let limit = followed(&loads);
        assert!(limit.is_reached() && limit.bracket() == [2.0, 2.0]);
    }

    #[test]
    fn what_viscosity_carries_is_no_part_of_the_limit() {
        let mut limit = followed(&[1.0, 2.0, 3.0]);
        for (load, viscous) in [(9.0, 3.0), (9.0, 4.0), (4.3, 0.3), (4.21, 0.2), (4.2, 0.2)] {
            limit.follow(Some(Loading { load, displacement: 0.1, viscous }), 0.0);
        }
        assert!(limit.is_reached() && (limit.largest - 4.0).abs() < 1e-12, "{limit:?}");
        let [low, high] = limit.bracket();
        assert!((low - 4.0).abs() < 1e-12 && (high - 4.2).abs() < 1e-12, "{low} {high}");
    }

    #[test]
    fn round_off_is_no_load() {
        let mut limit = LimitLoad::default();
        for load in [1e-9, 3e-9, 2e-9, 2.5e-9, 1e-9, 1e-9] {
            limit.follow(Some(Loading { load, displacement: 0.1, viscous: 0.0 }), 1e-6);
        }
        assert!(!limit.is_reached());
    }

    #[test]
    fn steps_without_motion_do_not_count() {
        let mut limit = followed(&[1.0, 1.5]);
        let before = limit;
        limit.follow(None, 0.0);
        limit.follow(Some(Loading { load: 3.0, displacement: 0.0, viscous: 0.0 }), 0.0);
        assert_eq!(limit, before);
    }
}
