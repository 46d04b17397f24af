//! The decision on an evaluated iterate: either it is accepted, or evaluated again. δd is halved if a point cannot
//! follow it, and shortened by a line search if it overshoots; a prediction that is of no use is withdrawn.

use super::damping::MAX_TRIALS;

/// Largest number of halvings of δd when a point cannot follow it.
const MAX_HALVINGS: usize = 5;
/// Largest number of evaluations of a line search.
const MAX_SEARCHES: usize = 6;
/// A line search may follow an increment that does not reduce the residual to this fraction: if the equations have kinks,
/// or if a step has failed.
const FAST: f64 = 0.1;
const FAST_WITH_CARE: f64 = 0.5;
/// If the equations have kinks, from this iteration after the last multiplier update onwards, an increment is halved
/// until the residual no longer increases: friction has no potential whose slope would end a cycle between two states.
const FIRST_BACKTRACK: usize = 8;
/// Largest number of halvings of an increment that increases the residual.
const MAX_BACKTRACKS: usize = 5;
/// First iteration with a line search once an attempt has failed: where many points begin to flow at once, an increment may
/// overshoot a hundredfold, and the iterations do not recover.
const FIRST_SEARCH: usize = 2;
/// Without a failed attempt, damping or kinks, the line search begins after this fraction of the iterations allowed:
/// late enough not to disturb iterations that converge by themselves.
const LATE: f64 = 0.75;
/// First iteration in which an increment is halved because it increases the residual, with viscosity.
const FIRST_VISCOUS_BACKTRACK: usize = 3;

/// The decision on an iterate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Decision {
    /// The iterate is accepted, whether it could be evaluated or not.
    Accept,
    /// Only this fraction of what was applied of δd is kept.
    Shorten(f64),
    /// The iterations start again from Δd = 0.
    Withdraw,
}

/// What has been tried at the current iterate.
#[derive(Debug, Default)]
pub(super) struct Search {
    /// True if the forces alone did not suffice, so that the stiffness is needed.
    pub(super) needs_stiffness: bool,
    /// True if δd is a prediction.
    pub(super) is_predicted: bool,
    halvings: usize,
    searches: usize,
    backtracks: usize,
    bracket: Bracket,
}

/// The iterate and its iteration, as the line search sees them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Situation<'a> {
    /// Number of the iteration.
    pub(super) iteration: usize,
    /// Number of iterations since the last multiplier update.
    pub(super) since_update: usize,
    /// Largest number of iterations that the settings allow.
    pub(super) max_iterations: usize,
    /// The residuals of the step before this iterate, [-].
    pub(super) residuals: &'a [f64],
    /// Largest residual that counts as equilibrium, [-].
    pub(super) tolerance: f64,
    /// True if the iterations are damped.
    pub(super) is_damped: bool,
    /// True if a line search begins early, because an attempt has failed.
    pub(super) begins_early: bool,
    /// True if a line search follows increments that reduce the residual only little.
    pub(super) searches_often: bool,
    /// True if the equations have kinks.
    pub(super) has_kinks: bool,
    /// True if viscosity regularises the laws.
    pub(super) is_viscous: bool,
    /// True if the load factor is an unknown.
    pub(super) has_unknown_factor: bool,
    /// True if δd contains a prescribed motion, so that a fraction of it would not lead towards equilibrium.
    pub(super) prescribes: bool,
    /// True if no increment has followed the last multiplier update.
    pub(super) is_augmented: bool,
}

impl Search {
    /// The search at Δd = 0, to which a prediction has been withdrawn.
    pub(super) fn withdrawn() -> Self {
        Search { needs_stiffness: true, ..Search::default() }
    }

    /// True if the last iterative increment has been shortened.
    pub(super) fn has_shortened(&self) -> bool {
        self.halvings + self.searches + self.backtracks > 0
    }

    /// Decides about an iterate; `residual` is `None` if a point could not follow δd. `secant` returns the factor by
    /// which to scale what was applied of δd so that the slope of the potential is zero at its end, if it is known.
    pub(super) fn decide(
        &mut self,
        situation: &Situation,
        residual: Option<f64>,
        secant: impl FnOnce(&mut Bracket) -> Option<f64>,
    ) -> Decision {
        // There is no earlier residual in iteration 0.
        let first = situation.residuals.first().copied().unwrap_or(f64::INFINITY);
        let is_better = residual.is_some_and(|residual| residual < first);
        let decision = match self.shorter(situation, residual, secant) {
            Some(part) => Decision::Shorten(part),
            None if self.is_predicted && !is_better => Decision::Withdraw,
            None => Decision::Accept,
        };
        // The residual was forecast for the whole increment only.
        self.needs_stiffness |= decision != Decision::Accept;
        decision
    }

    /// The fraction to which δd is shortened if a point could not follow it, if the potential rises again at the end of
    /// δd, or if the residual has grown in a cycle.
    fn shorter(
        &mut self,
        situation: &Situation,
        residual: Option<f64>,
        secant: impl FnOnce(&mut Bracket) -> Option<f64>,
    ) -> Option<f64> {
        let [most_halvings, most_searches] =
            if situation.is_damped { [MAX_TRIALS; 2] } else { [MAX_HALVINGS, MAX_SEARCHES] };
        let may_shorten = situation.iteration > 0 && !situation.prescribes && !situation.is_augmented;
        let Some(residual) = residual else {
            let halves = may_shorten && self.halvings < most_halvings;
            self.halvings += usize::from(halves);
            return halves.then_some(0.5);
        };
        // A residual that may be mere round-off says nothing about the length of an increment.
        if residual <= situation.tolerance {
            return None;
        }
        let searches = !situation.is_viscous || situation.is_damped;
        if searches
            && self.searches < most_searches
            && !situation.is_augmented
            && situation.may_search(residual)
        {
            if !situation.has_kinks {
                self.bracket = Bracket::default(); // Smooth potentials need no more than a secant.
            }
            if let Some(shorter) = secant(&mut self.bracket) {
                self.searches += 1;
                return Some(shorter);
            }
        }
        let backtracks = self.backtracks < MAX_BACKTRACKS && may_shorten && situation.cycles(residual);
        self.backtracks += usize::from(backtracks);
        backtracks.then_some(0.5)
    }
}

impl Situation<'_> {
    /// The residual before δd, infinite in iteration 0, [-].
    fn before(&self) -> f64 {
        self.residuals.last().copied().unwrap_or(f64::INFINITY)
    }

    /// True if the equations have kinks or viscosity and, in a late iteration, an increment has led to a larger
    /// residual. The flow for which viscosity is used has no potential.
    fn cycles(&self, residual: f64) -> bool {
        let first = if self.is_viscous { FIRST_VISCOUS_BACKTRACK } else { FIRST_BACKTRACK };
        (self.has_kinks || self.is_viscous)
            && self.since_update >= first
            && residual > self.before().max(self.tolerance)
    }

    /// True if a line search may shorten the last increment, given the residual to which it has led. Across kinks, any
    /// increment may overshoot.
    fn may_search(&self, residual: f64) -> bool {
        let Situation { is_damped, has_kinks, begins_early, .. } = *self;
        let late = ((LATE * self.max_iterations as f64) as usize).max(FIRST_SEARCH);
        let first = if is_damped || has_kinks {
            1
        } else if begins_early {
            FIRST_SEARCH
        } else {
            late
        };
        let enough = match (has_kinks, self.searches_often) {
            (true, _) => FAST,
            (false, true) => FAST_WITH_CARE,
            (false, false) => 1.0,
        };
        self.since_update >= first
            && !self.prescribes
            // Only the first increment changes the quantity that determines the load factor.
            && (!self.has_unknown_factor || has_kinks && self.iteration > 1)
            && (is_damped || residual > enough * self.before())
            && residual > self.tolerance
    }
}

/// The bracket of a line search: fractions of an increment, with the negated slopes of the potential there. The search
/// is the regula falsi with the slope halved at an end that is retained (Illinois algorithm), because contact has kinks
/// that a secant alone underestimates.
#[derive(Debug, Default)]
pub(super) struct Bracket {
    low: Option<[f64; 2]>,
    high: Option<[f64; 2]>,
    was_high: Option<bool>,
}

impl Bracket {
    /// The factor that leads from a fraction with this slope to the next fraction; `None` while the potential still
    /// falls at the end of the whole increment.
    pub(super) fn factor(&mut self, start: f64, fraction: f64, slope: f64) -> Option<f64> {
        let is_high = slope < 0.0;
        let low = self.low.get_or_insert([0.0, start]);
        if is_high {
            self.high = Some([fraction, slope]);
            if self.was_high == Some(true) {
                low[1] *= 0.5;
            }
        } else {
            *low = [fraction, slope];
            if let (Some(false), Some(high)) = (self.was_high, &mut self.high) {
                high[1] *= 0.5;
            }
        }
        let (low, high) = (*low, self.high?);
        self.was_high = Some(is_high);
        let share = (low[1] / (low[1] - high[1])).clamp(0.1, 0.9);
        Some(if low[0] == 0.0 { share } else { (low[0] + share * (high[0] - low[0])) / fraction })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A late iteration that has increased the residual from 0.1.
    const LATE_ITERATION: Situation = Situation {
        iteration: 9,
        since_update: 9,
        max_iterations: 10,
        residuals: &[1.0, 0.1],
        tolerance: 1e-9,
        is_damped: false,
        begins_early: false,
        searches_often: false,
        has_kinks: false,
        is_viscous: false,
        has_unknown_factor: false,
        prescribes: false,
        is_augmented: false,
    };

    #[test]
    fn an_increment_that_a_point_cannot_follow_is_halved_a_few_times() {
        let mut search = Search::default();
        let decisions: Vec<_> =
            (0..=MAX_HALVINGS).map(|_| search.decide(&LATE_ITERATION, None, |_| None)).collect();
        assert!(decisions[..MAX_HALVINGS].iter().all(|decision| *decision == Decision::Shorten(0.5)));
        assert_eq!(decisions[MAX_HALVINGS], Decision::Accept);
        assert!(search.needs_stiffness && search.has_shortened());
        let first = Situation { iteration: 0, ..LATE_ITERATION };
        assert_eq!(
            Search::default().decide(&first, None, |_| None),
            Decision::Accept,
            "there is no increment"
        );
    }

    #[test]
    fn the_first_iterate_is_accepted() {
        let first = Situation { iteration: 0, since_update: 0, residuals: &[], ..LATE_ITERATION };
        assert_eq!(Search::default().decide(&first, Some(1.0), |_| None), Decision::Accept);
    }

    #[test]
    fn a_line_search_begins_late_unless_there_is_reason_for_care() {
        let decide = |situation: &Situation, residual: f64| {
            Search::default().decide(situation, Some(residual), |_| Some(0.3))
        };
        assert_eq!(decide(&LATE_ITERATION, 0.2), Decision::Shorten(0.3));
        assert_eq!(decide(&LATE_ITERATION, 0.05), Decision::Accept, "the residual has fallen");
        let early = Situation { iteration: 2, since_update: 2, ..LATE_ITERATION };
        assert_eq!(decide(&early, 0.2), Decision::Accept);
        let begins = Situation { begins_early: true, ..early };
        assert_eq!(decide(&begins, 0.2), Decision::Shorten(0.3));
        assert_eq!(decide(&begins, 0.06), Decision::Accept, "the residual has fallen");
        assert_eq!(decide(&Situation { searches_often: true, ..begins }, 0.06), Decision::Shorten(0.3));
        assert_eq!(decide(&Situation { searches_often: true, ..begins }, 0.04), Decision::Accept);
        assert_eq!(
            decide(&Situation { prescribes: true, begins_early: true, ..early }, 0.2),
            Decision::Accept
        );
    }

    #[test]
    fn a_prediction_that_is_no_better_is_withdrawn() {
        let first = Situation { iteration: 1, since_update: 1, residuals: &[0.1], ..LATE_ITERATION };
        let decide = |residual: Option<f64>| {
            let mut search = Search { is_predicted: true, halvings: MAX_HALVINGS, ..Search::default() };
            search.decide(&first, residual, |_| None)
        };
        assert_eq!(decide(Some(0.05)), Decision::Accept);
        assert_eq!([decide(Some(0.2)), decide(Some(f64::NAN)), decide(None)], [Decision::Withdraw; 3]);
    }
}
