//! Compares the motion that a deck prescribes for a whole body with the domain update chosen for it.

use nalgebra::SMatrix;

use super::Check;
use super::extent::Extent;
use crate::formulas::at_nodes;
use crate::loads::load_curve;
use crate::quoting::quote;
use crate::{BodyDeck, BoundaryConditionDeck};
use mpm_core::basis::DomainKind;
use mpm_core::dofs::displacement_increment;
use mpm_core::formula::Formula;
use mpm_core::quality::Objection;
use mpm_core::tensor::Mat3;

/// Number of samples of a prescribed displacement along each axis of a side of a box.
const SAMPLES: usize = 8;
/// Largest number of steps into which a motion is divided.
const MAX_STEPS: u32 = 100;

impl Check<'_> {
    /// Warns of bodies whose whole outer layer follows a prescribed motion that their domain update does not support.
    /// Other motions are known only during the run; the quality report of the run then warns of them.
    pub(super) fn prescribed_motion(&mut self) {
        match self.dimensions() {
            2 => self.motion_of_outer_layers::<2>(),
            3 => self.motion_of_outer_layers::<3>(),
            _ => {}
        }
    }

    fn motion_of_outer_layers<const D: usize>(&mut self) {
        for condition in &self.deck.boundary_conditions {
            let Some(name) = condition.nodes.as_ref().and_then(|nodes| nodes.outer_layer.as_ref()) else {
                continue;
            };
            let Some(index) = self.deck.bodies.iter().position(|body| body.name == *name) else { continue };
            let body = &self.deck.bodies[index];
            let update = body.domain_update.unwrap_or_default();
            let is_box = body.method.domain() == DomainKind::Box;
            let Some(objection) = Objection::to::<D>(update).filter(|_| is_box) else { continue };
            let Some(measure) = self.worst_on_the_way::<D>(condition, body, &objection) else { continue };
            if measure > objection.limit {
                let message = format!(
                    "the domain update `{}` does not suit the motion: under the boundary condition {}, the body \
                     {} has on average {}",
                    update.name(),
                    quote(&condition.name),
                    quote(name),
                    (objection.describe)(measure)
                );
                let help = "use `domain_update: corners`, which supports every motion";
                self.warn("D044", &format!("/bodies/{index}/domain_update"), message, help);
            }
        }
    }

    /// The largest measure of `objection` for the mean deformation gradients at the ends of the steps; `None` if this
    /// motion is not known, for example because a component of the displacement is not prescribed.
    fn worst_on_the_way<const D: usize>(
        &self,
        condition: &BoundaryConditionDeck,
        body: &BodyDeck,
        objection: &Objection,
    ) -> Option<f64> {
        let extent = self.bounds("", &body.shape).ok()?;
        let formulas =
            at_nodes(condition.displacements(), &condition.intermediate, &self.deck.parameters, D).ok()?;
        let displacement: Vec<Formula> = formulas.into_iter().take(D).collect::<Option<_>>()?;
        let Some(steps) = &self.deck.steps else { return None };
        let end = steps.end_time;
        let curve = load_curve(condition.curve.as_ref(), end);
        let steps = steps.count().min(MAX_STEPS);
        let mut motion = MeanMotion::<D>::new(&extent);
        let mut largest = f64::NEG_INFINITY;
        let mut reached = None;
        for step in 1..=steps {
            let factors = [reached, Some(curve.factor(end * (f64::from(step) / f64::from(steps))))];
            motion.follow(&displacement, factors);
            let measure = objection.measure(&motion.deformation_gradient());
            if !measure.is_finite() {
                return None;
            }
            largest = largest.max(measure);
            reached = factors[1];
        }
        Some(largest)
    }
}

/// The affine motion of the bounding box of a body, from the mean displacements of its sides: the grid is reset after
/// each step, so the displacements are evaluated at the current positions of the sides.
struct MeanMotion<const D: usize> {
    /// Current position of the centre, [length].
    place: [f64; D],
    /// Position of the centre at the start, [length].
    start: [f64; D],
    half: [f64; D],
    gradient: SMatrix<f64, D, D>,
}

impl<const D: usize> MeanMotion<D> {
    fn new(extent: &Extent) -> Self {
        let middle = std::array::from_fn(|d| 0.5 * (extent.min[d] + extent.max[d]));
        let half = std::array::from_fn(|d| 0.5 * extent.side(d));
        MeanMotion { place: middle, start: middle, half, gradient: SMatrix::identity() }
    }

    /// Follows one load step, from one load factor to another.
    fn follow(&mut self, displacement: &[Formula], factors: [Option<f64>; 2]) {
        let mut gradient = self.gradient;
        let mut moved = [0.0; D];
        for side in 0..D {
            let (low, high) =
                (self.mean(displacement, side, -1.0, factors), self.mean(displacement, side, 1.0, factors));
            for axis in 0..D {
                gradient[(axis, side)] += (high[axis] - low[axis]) / (2.0 * self.half[side]);
                moved[axis] += 0.5 * (high[axis] + low[axis]) / D as f64;
            }
        }
        self.gradient = gradient;
        for axis in 0..D {
            self.place[axis] += moved[axis];
        }
    }

    /// Mean displacement of a side of the box.
    fn mean(&self, displacement: &[Formula], side: usize, sign: f64, factors: [Option<f64>; 2]) -> [f64; D] {
        let places = SAMPLES.pow(D as u32 - 1);
        let mut sum = [0.0; D];
        for number in 0..places {
            // The digits of `number` in base `SAMPLES` spread the sample positions evenly over the side.
            let mut rest = number;
            let offset: [f64; D] = std::array::from_fn(|d| {
                if d == side {
                    return sign * self.half[d];
                }
                let k = rest % SAMPLES;
                rest /= SAMPLES;
                self.half[d] * (2.0 * (k as f64 + 0.5) / SAMPLES as f64 - 1.0)
            });
            let place: [f64; D] = std::array::from_fn(|i| {
                self.place[i] + (0..D).map(|j| self.gradient[(i, j)] * offset[j]).sum::<f64>()
            });
            let original = std::array::from_fn(|d| self.start[d] + offset[d]);
            for (sum, formula) in sum.iter_mut().zip(displacement) {
                *sum += displacement_increment(formula, &place, &original, factors) / places as f64;
            }
        }
        sum
    }

    /// The mean deformation gradient, as a tensor in space.
    fn deformation_gradient(&self) -> Mat3 {
        Mat3::from_fn(|i, j| if i < D && j < D { self.gradient[(i, j)] } else { f64::from(u8::from(i == j)) })
    }
}
