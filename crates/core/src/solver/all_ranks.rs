//! The observer of a run on several ranks: rank 0 gathers what the ranks have, and reports it.

use crate::basis::{Connectivity, Method};
use crate::equilibrium::{GridFields, InitialState, StepReport};
use crate::model::Model;
use crate::points::Points;
use crate::ranks::Ranks;
use crate::step::Step;

use super::attempt::{FailedAttempt, Iterate};
use super::diagnosis::Diagnosis;
use super::error::SolveError;
use super::observer::Observer;
use super::summary::Summary;

/// Reports the points and grid fields of all ranks to an observer on rank 0. The other ranks only take part in gathering them;
/// alone, all goes to the observer as it is.
pub struct OfAllRanks<'a, const D: usize> {
    observer: &'a mut dyn Observer<D>,
    ranks: Ranks,
}

impl<'a, const D: usize> OfAllRanks<'a, D> {
    /// Reports to this observer, on rank 0.
    pub fn new(observer: &'a mut dyn Observer<D>, ranks: &Ranks) -> Self {
        OfAllRanks { observer, ranks: ranks.clone() }
    }

    /// Calls `report` with the observer and the points of all ranks, on rank 0.
    fn with<T>(
        &mut self,
        points: &Points<D>,
        report: impl FnOnce(&mut dyn Observer<D>, &Points<D>) -> std::io::Result<T>,
    ) -> std::io::Result<Option<T>> {
        if self.ranks.is_alone() {
            return report(self.observer, points).map(Some);
        }
        match points.gather() {
            Some(all) => report(self.observer, &all).map(Some),
            None => Ok(None),
        }
    }
}

impl<const D: usize> Observer<D> for OfAllRanks<'_, D> {
    fn started(&mut self, model: &Model<D>, points: &Points<D>) -> std::io::Result<()> {
        self.with(points, |observer, points| observer.started(model, points)).map(|_| ())
    }

    fn initial_state(&mut self, state: &InitialState) {
        if self.ranks.is_root() {
            self.observer.initial_state(state);
        }
    }

    fn iteration(&mut self, step: Step, iteration: usize, residual: f64) {
        if self.ranks.is_root() {
            self.observer.iteration(step, iteration, residual);
        }
    }

    fn converged(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        summary: &Summary,
    ) -> std::io::Result<()> {
        if self.ranks.is_alone() {
            return self.observer.converged(model, points, report, summary);
        }
        let GridFields { links, delta_d, reaction, parts } = &report.grid;
        let all = links.gather(model.grid.as_ref());
        let fields = [delta_d, reaction].map(|field| links.gather_field(all.as_ref(), field));
        let grid = match (all, fields) {
            (Some(links), [Some(delta_d), Some(reaction)]) => {
                Some(GridFields { links, parts: *parts, delta_d, reaction })
            }
            _ => None,
        };
        let needs = self.ranks.is_root().then(|| self.observer.needs_points(model, report.step));
        let gathered = if self.ranks.first(needs).unwrap_or(true) {
            points.gather()
        } else {
            let mut probed: Vec<u32> = model.probes.iter().flat_map(|probe| &probe.points).copied().collect();
            probed.sort_unstable();
            points.gather_some(&probed)
        };
        match (gathered, grid) {
            (Some(points), Some(grid)) => {
                self.observer.converged(model, &points, &report.with_grid(grid), summary)
            }
            _ => Ok(()),
        }
    }

    fn failed(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        attempt: &FailedAttempt<D>,
        ended: Option<(&FailedAttempt<D>, &Diagnosis)>,
    ) -> std::io::Result<()> {
        if self.ranks.is_alone() {
            return self.observer.failed(model, points, attempt, ended);
        }
        let mut all = points.gather();
        let whole = gathered(model, points, attempt, &mut all);
        let shown = ended.map(|(attempt, diagnosis)| (gathered(model, points, attempt, &mut all), diagnosis));
        let (Some(all), Some(whole)) = (all, whole) else { return Ok(()) };
        let shown = shown.as_ref().and_then(|(attempt, diagnosis)| Some((attempt.as_ref()?, *diagnosis)));
        self.observer.failed(model, &all, &whole, shown)
    }

    fn bisected(&mut self, model: &Model<D>, points: &Points<D>, step: Step) -> std::io::Result<()> {
        self.with(points, |observer, points| observer.bisected(model, points, step)).map(|_| ())
    }

    fn interrupted(&self) -> bool {
        self.observer.interrupted()
    }

    fn finished(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        summary: &Summary,
        error: Option<&SolveError>,
    ) -> std::io::Result<()> {
        self.with(points, |observer, points| observer.finished(model, points, summary, error)).map(|_| ())
    }
}

/// A failed attempt with the grid fields of all ranks, on rank 0, whose points `all` are.
fn gathered<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    attempt: &FailedAttempt<D>,
    all: &mut Option<Points<D>>,
) -> Option<FailedAttempt<D>> {
    let has_iterate = points.ranks.all(attempt.iterate.is_some());
    let iterate = attempt.iterate.as_ref().filter(|_| has_iterate).and_then(|iterate| {
        let active = iterate.links.gather(model.grid.as_ref());
        // The same links, with those of the points.
        let methods: Vec<Method> = model.bodies.iter().map(|body| body.method).collect();
        let linked = |all: &mut Points<D>| Connectivity::new(model.grid.as_ref(), all, &methods).ok();
        let links = all.as_mut().and_then(linked).or(active);
        let fields = [&iterate.delta_d, &iterate.out_of_balance];
        let [delta_d, out_of_balance] = fields.map(|field| iterate.links.gather_field(links.as_ref(), field));
        Some(Iterate { links: links?, delta_d: delta_d?, out_of_balance: out_of_balance? })
    });
    points.ranks.is_root().then(|| attempt.told_with(iterate))
}
