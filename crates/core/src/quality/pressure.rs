//! The oscillation of pressures within cells, a sign of volumetric locking.

use std::ops::Range;

use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::Points;
use crate::ranks::Reduction;
use crate::stress::CellStrain;
use crate::tensor::Sym3;

/// Smallest number of flowing cells whose oscillation is judged.
const MIN_CELLS: usize = 8;

/// Differences between the mean stresses of the points in a cell, relative to the deviatoric stresses; root mean square
/// over all cells, [-].
pub fn oscillation<const D: usize>(stress: &[Sym3], links: &Connectivity<D>) -> f64 {
    oscillation_of(links.reduction(), stress, (0..links.n_groups()).map(|group| links.points_of(group)))
}

/// The oscillation of the pressures where bodies flow.
pub(super) struct InFlow {
    /// [`oscillation`] over the flowing cells, [-].
    pub value: f64,
    /// True if a point in these cells uses its own volume ratio.
    pub is_standard: bool,
}

/// The oscillation of the trial stresses, in a step not yet committed, over the cells that hold several points, all of
/// them flowing; `None` if there are too few of these cells.
pub(super) fn oscillation_in_flow<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Option<InFlow> {
    let [new, old] = [&points.trial.history, &points.converged.history];
    // Beyond the variables of its law, the trial history of a point has no meaning.
    let flows = |p: usize| {
        let own = p * points.history_len..p * points.history_len + model.law(points, p).state_fields().len();
        new[own.clone()] != old[own]
    };
    let groups = (0..links.n_groups()).map(|group| links.points_of(group));
    let flowing: Vec<_> = groups.filter(|group| group.len() > 1 && group.clone().all(flows)).collect();
    let reduction = links.reduction();
    if reduction.count_all(flowing.len()) < MIN_CELLS {
        return None;
    }
    let is_standard = |p: usize| model.bodies[points.body[p] as usize].strain == CellStrain::Standard;
    Some(InFlow {
        is_standard: reduction.any(flowing.iter().cloned().flatten().any(is_standard)),
        value: oscillation_of(reduction, &points.trial.kirchhoff_stress, flowing.into_iter()),
    })
}

fn oscillation_of(reduction: &Reduction, stress: &[Sym3], cells: impl Iterator<Item = Range<usize>>) -> f64 {
    let (mut spread, mut deviator) = (0.0, 0.0);
    for cell in cells {
        let n = cell.len() as f64;
        let mean = |p: usize| stress[p].trace() / 3.0;
        let middle: f64 = cell.clone().map(mean).sum::<f64>() / n;
        for p in cell {
            spread += (mean(p) - middle).powi(2);
            deviator += stress[p].dot(&stress[p]) - 3.0 * mean(p).powi(2);
        }
    }
    let [spread, deviator] = [spread, deviator].map(|sum| reduction.total(sum));
    if deviator > 0.0 { (spread / deviator).sqrt() } else { 0.0 }
}
