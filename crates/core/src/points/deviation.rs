//! The stresses that resist the deviations of points from the mean increment of their cell, between steps.

use super::{FieldHandle, FieldKind, Further, PointFieldSpec, Points};
use crate::tensor::Sym3;

/// Name of the field of the stress.
const STRESS: &str = "deviation_stress";

/// Name of the field of the share of this stress that the next step takes away.
const LOST: &str = "deviation_lost";

/// Components of a stress in the field.
const COMPONENTS: usize = 6;

/// The stresses of all points at the end of the last equilibrated step.
pub(crate) struct StoredDeviation<'a> {
    stress: &'a [f64],
    lost: &'a [f64],
}

impl StoredDeviation<'_> {
    /// Cauchy stress of a point, [stress], and the share of it that the next step takes away, [-].
    pub(crate) fn at(&self, p: usize) -> (Sym3, f64) {
        let components = std::array::from_fn(|c| self.stress[p * COMPONENTS + c]);
        (Sym3::from_components(components), self.lost[p])
    }
}

/// The fields of the stress and of the share, if the points have them.
fn handles(further: &Further) -> Option<[FieldHandle; 2]> {
    Some([further.handle(STRESS)?, further.handle(LOST)?])
}

impl<const D: usize> Points<D> {
    /// Gives the points the fields of points that take the mean increment of their cell, unless they have them.
    pub fn prepare_deviations(&mut self) {
        if handles(&self.further).is_some() {
            return;
        }
        for (name, unit, components) in [(STRESS, "stress", COMPONENTS), (LOST, "-", 1)] {
            let spec = PointFieldSpec {
                name: name.to_owned(),
                unit: unit.to_owned(),
                components,
                kind: FieldKind::Answer,
                start: vec![0.0; components * self.len()],
            };
            let declared = self.further.declare(spec, &self.id, |_| false);
            debug_assert!(declared.is_ok(), "no other field may have these names");
        }
    }

    /// True for the names of these fields.
    pub(super) fn stores_deviations(name: &str) -> bool {
        [STRESS, LOST].contains(&name)
    }

    /// The stresses against deviations at the end of the last equilibrated step; `None` without fields for them.
    pub(crate) fn deviation(&self) -> Option<StoredDeviation<'_>> {
        let [stress, lost] = handles(&self.further)?.map(|handle| self.further.converged(handle));
        Some(StoredDeviation { stress, lost })
    }

    /// Writes the stress of each point, and the share that the next step takes away, into the trial state.
    pub(crate) fn set_deviation(&mut self, end: &[(Sym3, f64)]) {
        let Some([stress, lost]) = handles(&self.further) else { return };
        for (values, (stress, _)) in self.further.trial_mut(stress).chunks_exact_mut(COMPONENTS).zip(end) {
            values.copy_from_slice(&stress.components());
        }
        for (value, (_, lost)) in self.further.trial_mut(lost).iter_mut().zip(end) {
            *value = *lost;
        }
    }
}
