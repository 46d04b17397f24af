//! How far pressures alternate within cells: the mark of volumetric locking.

use crate::basis::Connectivity;
use crate::tensor::Sym3;

/// How far the mean stresses of the points of one cell differ, relative to the deviatoric stresses, in the root mean square
/// over all cells, [-].
pub fn oscillation<const D: usize>(stress: &[Sym3], links: &Connectivity<D>) -> f64 {
    let (mut spread, mut deviator) = (0.0, 0.0);
    for group in 0..links.n_groups() {
        let of_group = links.points_of(group);
        let n = of_group.len() as f64;
        let mean = |p: usize| stress[p].trace() / 3.0;
        let middle: f64 = of_group.clone().map(mean).sum::<f64>() / n;
        for p in of_group {
            spread += (mean(p) - middle).powi(2);
            deviator += stress[p].dot(&stress[p]) - 3.0 * mean(p).powi(2);
        }
    }
    if deviator > 0.0 { (spread / deviator).sqrt() } else { 0.0 }
}
