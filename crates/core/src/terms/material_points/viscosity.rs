//! The energy that viscosity dissipates in a step.

use crate::material::Viscous;
use crate::points::Points;
use crate::step::StepContext;

/// Energy dissipated in a step by the overstress of all points, [energy]: with the excess e of the elastic strain and the
/// weight w, the plastic strain increment is (1 − w)/w e.
pub(super) fn dissipation<const D: usize>(step: &StepContext<D>, points: &Points<D>) -> f64 {
    let flow = (1.0 - step.viscosity) / step.viscosity;
    let of_point = |p: usize| {
        let law = step.model.law(points, p);
        let history = &points.trial.history[p * points.history_len..][..law.state_fields().len()];
        let excess = Viscous::excess(law, &points.trial.elastic_strain[p], history)?;
        Some(excess.stress.dot(&excess.strain) * flow * points.original_volume[p])
    };
    (0..points.len()).filter_map(of_point).sum()
}
