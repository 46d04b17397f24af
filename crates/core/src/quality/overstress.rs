//! The overstress of a step with viscosity.

use crate::material::Viscous;
use crate::model::Model;
use crate::points::Points;

/// The overstress of the trial state, in a step not yet committed, relative to the stress, both as root mean squares over
/// the points that flow, [-]; 0 if none flows.
pub(super) fn overstress<const D: usize>(model: &Model<D>, points: &Points<D>) -> f64 {
    let [mut over, mut all] = [0.0; 2];
    for p in 0..points.len() {
        let law = model.law(points, p);
        let own = p * points.history_len..p * points.history_len + law.state_fields().len();
        let history = &points.trial.history[own.clone()];
        if *history == points.converged.history[own] {
            continue;
        }
        if let Some(excess) = Viscous::excess(law, &points.trial.elastic_strain[p], history) {
            over += points.original_volume[p] * excess.stress.dot(&excess.stress);
        }
        let stress = &points.trial.kirchhoff_stress[p];
        all += points.original_volume[p] * stress.dot(stress);
    }
    let reduction = points.reduction();
    let [over, all] = [over, all].map(|sum| reduction.total(sum));
    if all > 0.0 { (over / all).sqrt() } else { 0.0 }
}
