//! Splitting of points whose domains have become too long, between two steps.

use std::collections::BTreeSet;

use crate::basis::check_domain;
use crate::model::Model;
use crate::points::{Points, Split, Splitting};
use crate::terms::Terms;

/// Largest excess over the limit, relative to the limit, at which a domain does not yet count as too long, [-]: the
/// length of a domain that is exactly as long as its body allows depends on round-off.
const ROUND_OFF: f64 = 1e-9;

/// The splitting rules of a model, without the state of a run.
struct ModelRules<'a, const D: usize> {
    model: &'a Model<D>,
}

/// The splitting rules of a model in the state of a run.
struct Present<'a, const D: usize, const N: usize> {
    rules: ModelRules<'a, D>,
    terms: &'a mut Terms<D, N>,
    /// End of the last converged step, [time].
    time: f64,
    /// Points of probes, which stay whole: a half does not move like the whole point.
    probed: BTreeSet<u32>,
}

/// Splits the points whose domains have become longer than their bodies allow in the step that has ended at this time,
/// and adds the splits of all ranks to the earlier ones.
pub(crate) fn split_long<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    terms: &mut Terms<D, N>,
    time: f64,
    splits: &mut Vec<Split>,
) {
    if model.bodies.iter().all(|body| body.split_above.is_none()) {
        return;
    }
    let later = model.stages.iter().flat_map(|stage| &stage.added.id);
    let numbers = points.id.iter().chain(later).copied().chain(splits.iter().map(|split| split.half));
    let last = points.reduction().largest(numbers.max().map_or(-1.0, f64::from));
    let next = (last + 1.0) as u32;
    let probed = model.probes.iter().flat_map(|probe| &probe.points).copied().collect();
    let mut rules = Present { rules: ModelRules { model }, terms, time, probed };
    splits.extend(points.split_long(&mut rules, next));
}

/// Moves the corners of the domains of the points with these permanent numbers out of the obstacles of the terms,
/// because these domains have been replaced without regard to obstacles. A domain that would become invalid stays as it
/// is.
pub(crate) fn push_out_of_tools<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    terms: &mut Terms<D, N>,
    time: f64,
    replaced: &[u32],
) {
    if replaced.is_empty() {
        return;
    }
    let rules = Present { rules: ModelRules { model }, terms, time, probed: BTreeSet::new() };
    points.move_corners(replaced, &rules);
}

/// Splits the points that an earlier run of this model has split.
///
/// # Errors
/// The reason, if no run of this model can have split them.
pub(crate) fn split_again<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    splits: &[Split],
) -> Result<(), String> {
    points.split_again(splits, &ModelRules { model })
}

impl<const D: usize> Splitting<D> for ModelRules<'_, D> {
    fn longest(&self, points: &Points<D>, p: usize) -> f64 {
        let Some(above) = self.model.bodies[points.body[p] as usize].split_above else {
            return f64::INFINITY;
        };
        // The cell of a point that a stage has added is not known yet.
        let cell = self.model.grid.locate(&points.converged.position[p], Some(points.cell[p]));
        cell.map_or(f64::INFINITY, |cell| (1.0 + ROUND_OFF) * above * self.model.grid.size(cell as usize))
    }

    fn depth(&self, position: &[f64; D]) -> f64 {
        self.model.depth(position)
    }

    fn nearest_allowed(&self, _: usize, place: [f64; D]) -> [f64; D] {
        place
    }

    fn is_valid(&self, points: &Points<D>, p: usize, corners: &[[f64; D]]) -> bool {
        check_domain(self.model.grid.as_ref(), corners, points.cell[p]).is_ok()
    }
}

impl<const D: usize, const N: usize> Splitting<D> for Present<'_, D, N> {
    fn longest(&self, points: &Points<D>, p: usize) -> f64 {
        if self.probed.contains(&points.id[p]) {
            return f64::INFINITY;
        }
        self.rules.longest(points, p)
    }

    fn depth(&self, position: &[f64; D]) -> f64 {
        self.rules.depth(position)
    }

    fn nearest_allowed(&self, body: usize, place: [f64; D]) -> [f64; D] {
        let model = self.rules.model;
        let obstacles = self.terms.iter().filter_map(|term| term.obstacle());
        obstacles.fold(place, |place, obstacle| obstacle.nearest_allowed(model, body, place))
    }

    fn is_valid(&self, points: &Points<D>, p: usize, corners: &[[f64; D]]) -> bool {
        self.rules.is_valid(points, p, corners)
    }

    fn have_cut(&mut self, points: &Points<D>, cuts: &[Split]) {
        let Present { rules, terms, time, .. } = self;
        for attached in terms.iter_mut().filter_map(|term| term.attached()) {
            attached.follow_cuts(rules.model, points, cuts, *time);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Method;
    use crate::grid::Structured;
    use crate::model::{Builder, Fill};

    #[test]
    fn a_domain_exactly_as_long_as_allowed_stays_whole() {
        for (origin, size) in [(0.0, 0.5), (0.0, 0.1), (1.1, 0.1), (0.3, 0.7), (100.1, 0.3048)] {
            let grid = Structured::new([origin; 2], [size; 2], [4, 4]);
            let (mut model, mut points) = Builder::new(grid)
                .material("steel", crate::material::Hencky::new(1e3, 0.3))
                .body("a", "steel", Fill { method: Method::Cpdi2, ..Fill::default() }, |_| true)
                .build()
                .unwrap();
            let whole = points.len();
            let mut split = |above: f64| {
                model.bodies[0].split_above = Some(above);
                points.split_long(&mut ModelRules { model: &model }, whole as u32);
                points.len()
            };
            // There are two points along a side of a cell.
            assert_eq!(split(0.5), whole, "{origin} {size}");
            assert!(split(0.5 - 1e-6) > whole, "{origin} {size}");
        }
    }
}
