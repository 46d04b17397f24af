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
    /// True if the flow dilates although points of a cell differ in their shear.
    pub dilates: bool,
}

/// Volume strain of the flow relative to the deviatoric strain, [-], above which flow dilates: about that of a dilation
/// angle of 8 degrees in plane strain.
const DILATING: f64 = 0.2;

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
    let strain = |p: usize| model.bodies[points.body[p] as usize].strain;
    let any = |is: &dyn Fn(CellStrain) -> bool| {
        reduction.any(flowing.iter().cloned().flatten().any(|p| is(strain(p))))
    };
    let differ = any(&|strain| strain != CellStrain::Mean);
    Some(InFlow {
        is_standard: any(&|strain| strain == CellStrain::Standard),
        dilates: differ && dilation(reduction, points, flowing.iter().cloned().flatten()) > DILATING,
        value: oscillation_of(reduction, &points.trial.kirchhoff_stress, flowing.into_iter()),
    })
}

/// The growth of volume that is not elastic, relative to the deviatoric strain of the step, both as integrals over points,
/// [-].
fn dilation<const D: usize>(
    reduction: &Reduction,
    points: &Points<D>,
    flowing: impl Iterator<Item = usize>,
) -> f64 {
    let (mut volume, mut deviator) = (0.0, 0.0);
    for p in flowing {
        let [new, old] = [&points.trial, &points.converged];
        let ratio = new.deformation_gradient[p].determinant() / old.deformation_gradient[p].determinant();
        let elastic = new.elastic_strain[p] - old.elastic_strain[p];
        let Some(inverse) = old.deformation_gradient[p].try_inverse() else { continue };
        let strain = Sym3::symmetric_part(&(new.deformation_gradient[p] * inverse)) - Sym3::IDENTITY;
        volume += points.original_volume[p] * (ratio.ln() - elastic.trace());
        deviator += points.original_volume[p] * strain.deviator().norm();
    }
    let [volume, deviator] = [volume, deviator].map(|sum| reduction.total(sum));
    if deviator > 0.0 { volume / deviator } else { 0.0 }
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
