//! The size of load steps: failed steps are cut, and later steps grow again.
//!
//! Steps that need few iterations grow as soon as the steps after a failure have succeeded. Others, such as those with
//! contact, grow after more successes, whatever their iterations: a step of twice the size costs less than two steps.
//! Where steps of some size fail again and again, the number of successes before the next attempt at this size doubles
//! each time.
//!
//! Steps of bodies that flow under a prescribed motion may continue with viscosity ([`crate::material::Viscous`]) once a
//! small step has failed. With viscosity they grow again; after some steps of full size, one without it is tried.

use serde::{Deserialize, Serialize};

use super::viscosity::Viscosity;
use crate::model::{SAME_TIME, Stepping};

/// A step may be followed by one of twice its size if it took at most this number of iterations.
const FEW: usize = 8;
/// Number of steps that must succeed after a failure before steps may grow; it doubles each time that steps of about
/// the same size fail, at most this number of times.
const PATIENCE: u32 = 2;
const MOST_DOUBLINGS: u32 = 5;
/// Number of steps of the same size that must succeed before a smaller step than requested grows, whatever its
/// iterations.
const SUCCESSES: u32 = 4;
/// Size relative to a requested step, [-], below which steps crawl, and number of such steps in succession after which
/// the run says so.
pub const SHORT: f64 = 0.05;
const CRAWLED: u32 = 20;
/// Size relative to a requested step, [-], from which on terms may simplify conditions that keep iterations from
/// converging: before that, smaller steps are tried, whose course depends less on round-off.
const SMALL: f64 = 0.25;
/// Size relative to a requested step, [-], of the longest failed step after which viscosity may be used, and factor by
/// which the first step with viscosity is longer.
const STUCK: f64 = 0.125;
const LONGER: f64 = 4.0;
/// Size relative to a requested step, [-], up to which steps lag behind those that were asked for, and number of such
/// steps in succession after which viscosity may be used when the next one fails, whatever its size.
const LAGS: f64 = 0.25;
const LAGGED: u32 = 16;
/// Factor on both sizes in a stage that runs until its limit: viscosity carries a part of the load there.
const NEAR_LIMIT: f64 = 0.125;
/// Sizes count as the same if their ratio is below this, [-].
const ALIKE: f64 = 1.5;
/// Time that must remain between the end of a step and the next stop, relative to the step, for the step to keep its
/// size, [-]; if less remains, the last two steps before the stop are made equal.
const REST: f64 = 0.5;

/// The current step size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Size relative to a requested step, [-].
    size: f64,
    /// Number of steps that must succeed before steps may grow.
    patience: u32,
    /// Number of steps of this size that have succeeded.
    #[serde(default)]
    successes: u32,
    /// Size of the last step that failed, relative to a requested step, [-], and how often steps of about this size
    /// have failed before; 0 once such a step has succeeded.
    #[serde(default)]
    failed_size: f64,
    #[serde(default)]
    failures: u32,
    /// Number of short steps in succession.
    #[serde(default)]
    crawled: u32,
    /// True once a step has failed.
    #[serde(default)]
    has_failed: bool,
    /// Number of steps in succession that lag behind those that were asked for.
    #[serde(default)]
    lagged: u32,
    /// The use of viscosity.
    #[serde(default)]
    viscosity: Viscosity,
    /// The last resort in use.
    #[serde(default)]
    resort: Option<LastResort>,
}

/// What step control needs to know about a failed step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Failure {
    /// True if the reason is a torn domain.
    pub is_torn: bool,
    /// True if viscosity might help.
    pub may_relax: bool,
}

/// A last resort, for failed steps that cannot be made smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum LastResort {
    /// Torn domains are replaced.
    Domains,
    /// Torn domains are replaced, and iterations are damped.
    Damping,
}

impl Default for Pace {
    fn default() -> Self {
        Pace {
            size: 1.0,
            patience: 0,
            successes: 0,
            failed_size: 0.0,
            failures: 0,
            crawled: 0,
            has_failed: false,
            lagged: 0,
            viscosity: Viscosity::default(),
            resort: None,
        }
    }
}

/// Smallest size of a step relative to a requested one, [-]; smaller steps would be lost in the round-off of time.
const MIN_SIZE: f64 = 1e-9;

impl Pace {
    /// True if a run can have steps of this size.
    pub fn is_valid(&self) -> bool {
        (MIN_SIZE..=f64::MAX).contains(&self.size)
    }

    /// End of the step that starts at a time, [time]; `None` at the end of the analysis or stage.
    pub fn end_of_step(&self, stepping: &Stepping, start: f64) -> Option<f64> {
        let unit = stepping.size();
        if start >= stepping.end_time - SAME_TIME * unit {
            return None;
        }
        let stop = stepping.next_stop(start);
        let smallest = stepping.smallest_at(start);
        // Only where a strength reduction passes from a large requested step to smaller ones is the size too small.
        let size = if self.size < smallest * (1.0 - SAME_TIME) { smallest } else { self.size };
        let longest = stepping.dynamics.map_or(f64::INFINITY, |dynamics| dynamics.longest);
        let (step, rest) = ((size * unit).min(longest), stop - start);
        Some(if rest <= step * (1.0 + SAME_TIME) {
            stop
        } else if rest < step * (1.0 + REST) {
            start + 0.5 * rest
        } else {
            start + step
        })
    }

    /// True if a step has failed recently.
    pub fn is_careful(&self) -> bool {
        self.patience > 0
    }

    /// True if a step has failed since the start of the analysis or of the stage.
    pub fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// True if steps have been cut so far that terms may simplify conditions.
    pub fn is_small(&self) -> bool {
        self.size <= SMALL
    }

    /// True if steps are far shorter than requested.
    pub fn is_short(&self) -> bool {
        self.size < SHORT
    }

    /// The size of the steps relative to a requested step, [-], if they have been far shorter for a long time.
    pub fn crawling(&self) -> Option<f64> {
        (self.crawled >= CRAWLED).then_some(self.size)
    }

    /// True if a last resort is in use, because steps cannot be made smaller; torn domains are then replaced.
    pub fn is_last_resort(&self) -> bool {
        self.resort.is_some()
    }

    /// True if iterations are damped.
    pub fn is_damped(&self) -> bool {
        self.resort == Some(LastResort::Damping)
    }

    /// The relaxation time of viscosity relative to that of the settings, [-]; `None` without viscosity.
    pub fn viscosity(&self) -> Option<f64> {
        self.viscosity.growth()
    }

    /// Shortens the relaxation time after a step in which viscosity has dissipated a large share of the work, [-].
    pub fn limit_viscosity(&mut self, share: f64) {
        self.viscosity = self.viscosity.limited(share);
    }

    /// Records a step that has converged in this number of iterations, counted anew after each multiplier update.
    pub fn succeeded(&mut self, stepping: &Stepping, iterations: usize) {
        self.succeeded_with(stepping, iterations, true);
    }

    /// As [`Pace::succeeded`]; the next step is no longer than this one unless it `may_grow`.
    pub fn succeeded_with(&mut self, stepping: &Stepping, iterations: usize, may_grow: bool) {
        self.patience = self.patience.saturating_sub(1);
        self.successes += 1;
        self.crawled = if self.is_short() { self.crawled.saturating_add(1) } else { 0 };
        self.lagged =
            if self.size <= LAGS * near_limit(stepping) { self.lagged.saturating_add(1) } else { 0 };
        self.resort = None;
        self.viscosity = self.viscosity.succeeded(self.size >= 1.0);
        if self.size * ALIKE > self.failed_size {
            (self.failed_size, self.failures) = (0.0, 0);
        }
        let recovers = self.size < 1.0 && self.successes >= SUCCESSES;
        if may_grow && self.patience == 0 && (iterations <= FEW || recovers) {
            let largest = if iterations <= FEW { stepping.largest.max(1.0) } else { 1.0 };
            self.size = (2.0 * self.size).min(largest);
            self.successes = 0;
        }
    }

    /// Halves the step between these times for the next attempt; false if it would be smaller than allowed.
    pub fn halve(&mut self, stepping: &Stepping, start: f64, end: f64) -> bool {
        let size = (end - start) / stepping.size();
        let smaller = 0.5 * size;
        let may = smaller >= stepping.smallest_at(start) * (1.0 - SAME_TIME);
        if may {
            let is_repeated = size < ALIKE * self.failed_size && self.failed_size < ALIKE * size;
            let failures = if is_repeated { (self.failures + 1).min(MOST_DOUBLINGS) } else { 0 };
            let patience = PATIENCE << failures;
            let successes = 0;
            *self = Pace {
                size: smaller,
                patience,
                successes,
                failed_size: size,
                failures,
                resort: None,
                ..*self
            };
        }
        may
    }

    /// Records a failed step. Returns true if another attempt may be made: at a smaller step, with viscosity, or at the
    /// same step with a last resort.
    pub fn failed(&mut self, stepping: &Stepping, start: f64, end: f64, failure: Failure) -> bool {
        self.has_failed = true;
        if let Some(viscosity) = self.viscosity.failed() {
            self.viscosity = viscosity;
            return true;
        }
        let size = (end - start) / stepping.size();
        let may_relax = failure.may_relax && stepping.may_relax();
        let relaxed = if may_relax { self.viscosity.stuck() } else { None };
        let stuck = STUCK * near_limit(stepping);
        let is_stuck = relaxed.is_some() && (size <= stuck * (1.0 + SAME_TIME) || self.lagged >= LAGGED);
        if !is_stuck && self.halve(stepping, start, end) {
            return true;
        }
        if let Some(viscosity) = relaxed {
            *self = Pace {
                size: (LONGER * size).min(1.0),
                crawled: self.crawled,
                has_failed: true,
                viscosity,
                ..Pace::default()
            };
            return true;
        }
        self.resort = match self.resort {
            _ if !stepping.may_damp() => None,
            None if failure.is_torn => Some(LastResort::Domains),
            None | Some(LastResort::Domains) => Some(LastResort::Damping),
            Some(LastResort::Damping) => None,
        };
        self.resort.is_some()
    }
}

/// Factor on the sizes up to which viscosity may be used, [-].
fn near_limit(stepping: &Stepping) -> f64 {
    if stepping.until_limit { NEAR_LIMIT } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Control;

    /// The end times of all steps, if every attempt for which `fails` is true fails.
    fn ends(stepping: &Stepping, iterations: usize, mut fails: impl FnMut(f64, f64) -> bool) -> Vec<f64> {
        let (mut pace, mut time, mut ends) = (Pace::default(), 0.0, Vec::new());
        while let Some(end) = pace.end_of_step(stepping, time) {
            if !pace.is_damped() && fails(time, end) {
                if !pace.failed(stepping, time, end, Failure::default()) {
                    break;
                }
            } else {
                pace.succeeded(stepping, iterations);
                time = end;
                ends.push(end);
            }
            assert!(ends.len() < 10_000);
        }
        ends
    }

    #[test]
    fn without_failure_the_steps_are_those_that_were_asked_for() {
        for count in [1, 3, 7, 50, 1000] {
            let stepping = Stepping { smallest: 1e-3, ..Stepping::fixed(count, 0.7) };
            let expected: Vec<f64> = (1..=count).map(|k| 0.7 * (k as f64 / count as f64)).collect();
            assert_eq!(ends(&stepping, 5, |_, _| false), expected, "to the last bit");
            assert_eq!(ends(&stepping, 19, |_, _| false), expected);
        }
    }

    #[test]
    fn a_failed_step_is_halved_and_grows_again() {
        let stepping = Stepping { smallest: 0.01, ..Stepping::fixed(4, 4.0) };
        // Steps of more than a quarter fail between 1 and 2.
        let found = ends(&stepping, 5, |start, end| start < 1.99 && end > 1.01 && end - start > 0.26);
        // The attempt to double the step at 1.5 fails, so the next one waits for four steps.
        assert_eq!(found, [1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0, 4.0]);
        let slowly = ends(&stepping, 15, |start, end| start < 1.99 && end > 1.01 && end - start > 0.26);
        // After four steps of a quarter, one of a half; again after four of these, if there were any.
        assert_eq!(slowly, [1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0], "{slowly:?}");
    }

    #[test]
    fn steps_that_always_fail_at_some_size_are_tried_less_and_less_often() {
        let stepping = Stepping { smallest: 1e-4, ..Stepping::fixed(1, 1.0) };
        for iterations in [5, 15] {
            let mut fails = 0;
            let found = ends(&stepping, iterations, |start, end| {
                let is_long = end - start > 0.0011;
                fails += usize::from(is_long);
                is_long
            });
            // Steps of 1/1024: doubled in vain after 2, 4, 8, 16, 32 and then every 64 steps.
            assert!(found.len() > 1000 && found.len() < 1100, "{}", found.len());
            assert!(fails < 10 + 5 + 1000 / 64 + 2, "{fails} of {}", found.len());
        }
    }

    #[test]
    fn steps_that_stay_short_crawl() {
        let stepping = Stepping { smallest: 1e-4, ..Stepping::fixed(1, 1.0) };
        let mut pace = Pace::default();
        let (mut time, mut crawling) = (0.0, Vec::new());
        for _ in 0..100 {
            let end = pace.end_of_step(&stepping, time).unwrap();
            if end - time > 0.01 {
                assert!(pace.failed(&stepping, time, end, Failure::default()));
            } else {
                pace.succeeded(&stepping, 30);
                time = end;
                crawling.push(pace.crawling());
            }
        }
        let first = crawling.iter().position(Option::is_some).unwrap();
        assert_eq!((first, crawling[first]), (19, Some(1.0 / 128.0)));
        assert!(crawling[first..].iter().all(Option::is_some), "also after further failures");
    }

    #[test]
    fn steps_are_cut_down_to_the_smallest_and_no_further() {
        for (smallest, least) in [(1.0, None), (0.5, Some(0.5)), (0.01, Some(1.0 / 64.0))] {
            let stepping = Stepping { smallest, ..Stepping::fixed(2, 2.0) };
            let mut shortest = None;
            let found = ends(&stepping, 5, |start, end| {
                shortest = Some(end - start);
                end > 1.3
            });
            let reached = found.last().copied().unwrap();
            assert!(reached <= 1.3 && 1.3 - reached <= least.unwrap_or(1.0), "{found:?}");
            assert_eq!(shortest, Some(least.unwrap_or(1.0)));
        }
    }

    #[test]
    fn the_smallest_step_is_tried_once_more_with_damped_iterations() {
        let damped = Stepping { smallest: 0.25, damping: true, ..Stepping::fixed(2, 2.0) };
        let found = ends(&damped, 5, |start, end| start < 1.5 && end > 1.3);
        assert_eq!(found, [1.0, 1.25, 1.5, 2.0], "damped only where necessary");
        for stepping in [
            Stepping { damping: false, ..damped.clone() },
            Stepping { smallest: 1.0, ..damped.clone() },
            Stepping { control: Control::ArcLength { length: None }, ..damped.clone() },
        ] {
            assert!(ends(&stepping, 5, |start, end| start < 1.5 && end > 1.3).last() < Some(&1.3));
        }
        let tries = |is_torn: bool| {
            let mut pace = Pace::default();
            (0..9)
                .take_while(|_| pace.failed(&damped, 0.0, 0.25, Failure { is_torn, may_relax: false }))
                .count()
        };
        assert_eq!((tries(false), tries(true)), (1, 2), "once with damping, before that with other domains");
    }

    /// Steps of more than a tenth fail in the middle of the analysis, unless they are viscous.
    #[test]
    fn a_small_step_that_fails_continues_with_viscosity_until_steps_succeed_without_it() {
        let stepping = Stepping { smallest: 1e-3, viscosity: 0.01, ..Stepping::fixed(40, 40.0) };
        let (mut pace, mut time, mut steps) = (Pace::default(), 0.0, Vec::new());
        let mut fails = 0;
        while let Some(end) = pace.end_of_step(&stepping, time) {
            if pace.viscosity().is_none() && end > 2.0 && time < 20.0 {
                fails += 1;
                assert!(pace.failed(&stepping, time, end, Failure { may_relax: true, ..Failure::default() }));
            } else {
                steps.push((end - time, pace.viscosity().is_some()));
                pace.succeeded(&stepping, 5);
                time = end;
            }
        }
        let viscous = steps.iter().filter(|(_, is_viscous)| *is_viscous).count();
        // 1, 1/2, 1/4, 1/8 fail; with viscosity 1/2 and the rest of the step, which counts as whole, follow. Without it,
        // steps fail after 4 and after 8 whole steps, and succeed after 16.
        assert_eq!(fails, 4 + 2, "{steps:?}");
        assert_eq!((steps[2], steps[3], steps[4]), ((0.5, true), (0.5, true), (1.0, true)));
        assert_eq!(viscous, 2 + 3 + 8 + 16);
        assert_eq!(steps.len(), 41);
        let never = Stepping { viscosity: 0.0, ..stepping };
        let mut pace = Pace { size: STUCK, ..Pace::default() };
        assert!(pace.failed(&never, 0.0, STUCK, Failure { may_relax: true, ..Failure::default() }));
        assert!(pace.viscosity().is_none() && pace.size == 0.5 * STUCK);
    }

    #[test]
    fn steps_that_lag_behind_for_long_continue_with_viscosity() {
        let stepping = Stepping { smallest: 1e-3, viscosity: 0.01, ..Stepping::fixed(40, 40.0) };
        let (mut pace, mut time, mut steps) = (Pace::default(), 0.0, Vec::new());
        while let Some(end) = pace.end_of_step(&stepping, time).filter(|_| pace.viscosity().is_none()) {
            if end - time > 0.3 {
                assert!(pace.failed(&stepping, time, end, Failure { may_relax: true, ..Failure::default() }));
            } else {
                steps.push(end - time);
                pace.succeeded(&stepping, 12);
                time = end;
            }
        }
        assert!((LAGGED as usize..2 * LAGGED as usize).contains(&steps.len()), "{steps:?}");
        assert_eq!(pace.size, 1.0, "the step with viscosity is as long as requested");
    }

    #[test]
    fn knots_and_output_times_are_met_exactly_by_steps_that_grow() {
        let stepping =
            Stepping { largest: 8.0, stops: 10, knots: vec![0.123, 0.5, 0.77], ..Stepping::fixed(100, 1.0) };
        let found = ends(&stepping, 3, |_, _| false);
        for time in [0.123, 0.5, 0.77, 1.0].into_iter().chain((1..10).map(|k| f64::from(k * 10) / 100.0)) {
            assert!(found.contains(&time), "{time} is not among {found:?}");
        }
        assert!(found.len() < 45, "{} steps", found.len());
        let sizes = std::iter::once(0.0).chain(found.iter().copied()).zip(&found).map(|(a, b)| b - a);
        assert!(sizes.fold(0.0, f64::max) <= 0.08 + 1e-12);
        // Steps that do not grow also end at all requested times.
        let fixed = Stepping { largest: 1.0, ..stepping };
        assert_eq!(ends(&fixed, 3, |_, _| false).len(), 101, "a knot between two of them splits a step");
    }

    #[test]
    fn requested_steps_are_recognised() {
        let stepping = Stepping::fixed(3, 0.3);
        assert_eq!([0.0, 0.1, 0.1 + 0.1, 0.3].map(|t| stepping.requested(t)), [0, 1, 2, 3].map(Some));
        assert_eq!(stepping.requested(0.05), None);
    }
}
