//! The motion of a tool in a step.

use super::error::ContactError;
use crate::model::{Freedom, Model, Tool};
use crate::region::vector::{along, cross, minus, norm};
use crate::step::Step;
use crate::tool::{Closest, Increment, Pose, Shape};

/// A tool in a step: where it starts, and where the unknowns have moved it.
#[derive(Debug, Clone)]
pub(super) struct Moving<const D: usize> {
    /// Pose at the start of the analysis.
    pub(super) original: Pose<D>,
    /// Pose at the end of the last step in equilibrium.
    pub(super) start: Pose<D>,
    /// Pose at the last evaluation.
    pub(super) end: Pose<D>,
    /// Motion at the last evaluation.
    pub(super) increment: Increment<D>,
    /// The prescribed part of the motion; free components are zero.
    prescribed: Increment<D>,
    /// Numbers of the free components: translations, then rotations.
    pub(super) free: Vec<usize>,
}

impl<const D: usize> Moving<D> {
    pub(super) fn new(tool: &Tool<D>) -> Self {
        let none = Increment { translation: [0.0; D], rotation: [0.0; 3] };
        Moving {
            original: tool.pose,
            start: tool.pose,
            end: tool.pose,
            increment: none,
            prescribed: none,
            free: Tool::<D>::components().filter(|&k| tool.freedom(k).is_free()).collect(),
        }
    }

    /// Begins a step from the converged pose.
    pub(super) fn begin(&mut self, tool: &Tool<D>, model: &Model<D>, step: Step) -> Result<(), ContactError> {
        let name = || tool.name.clone();
        if model.stepping.control.has_unknown_factor() && tool.is_driven() {
            return Err(ContactError::UnknownFactor { tool: name() });
        }
        let may_move = |k: usize| !model.revolved || k == 1;
        if let Some(k) = Tool::<D>::components().find(|&k| !may_move(k) && !tool.freedom(k).is_fixed()) {
            return Err(ContactError::OffAxis { tool: name(), component: Tool::<D>::component_name(k) });
        }
        let [before, after] = [values(tool, step.start)?, values(tool, step.end)?];
        let mut rotation = std::array::from_fn(|k| after[D + k] - before[D + k]);
        if D == 3 && !tool.rotation.iter().any(Freedom::is_free) {
            // The relative rotation of two rotation vectors.
            let turned = |v: &[f64]| Pose::<D>::new([0.0; D], [v[D], v[D + 1], v[D + 2]]);
            if let (Ok(a), Ok(b)) = (turned(&before), turned(&after)) {
                rotation = b.rotation_since(&a);
            }
        }
        self.prescribed = Increment { translation: std::array::from_fn(|d| after[d] - before[d]), rotation };
        self.place(&[]);
        Ok(())
    }

    /// Moves the tool to where these increments of its free components put it; those that are missing are 0.
    pub(super) fn place(&mut self, free: &[f64]) {
        self.increment = self.prescribed;
        for (&k, value) in self.free.iter().zip(free) {
            let component =
                if k < D { &mut self.increment.translation[k] } else { &mut self.increment.rotation[k - D] };
            *component = *value;
        }
        self.end = self.start.moved(&self.increment);
    }

    /// The closest point, in space, of a place that started at `start` and has moved by `slip` relative to the tool, both
    /// [length]. The coordinates are formed in the frame of the tool, where they are small.
    pub(super) fn closest(
        &self,
        shape: &dyn Shape<D>,
        start: &[f64; D],
        slip: &[f64; D],
    ) -> Option<Closest<D>> {
        let x = along(&self.start.to_tool(start), 1.0, &self.end.vector_to_tool(slip));
        let found = shape.closest(x)?;
        Some(self.end.in_space(&found))
    }

    /// Magnitude of the coordinates of a position in the frame of the tool, [length].
    pub(super) fn extent(&self, x: &[f64; D]) -> f64 {
        norm(&minus(x, &self.start.position()))
    }

    /// The velocity at a position, [length], of the tool when free component number `k` of its motion grows: the
    /// derivative of the position of a point of the tool, and the rate of rotation.
    pub(super) fn velocity(&self, k: usize, x: &[f64; D]) -> ([f64; D], [f64; 3]) {
        if k < D {
            return (std::array::from_fn(|d| if d == k { 1.0 } else { 0.0 }), [0.0; 3]);
        }
        let arm = minus(x, &self.end.position());
        let rate = self.increment.rotation_rate(k - D);
        (self.increment.rotation_derivative(&arm)[k - D], rate)
    }

    /// Moment of a force at a position about the reference point, [force·length].
    pub(super) fn moment(&self, x: &[f64; D], force: &[f64; D]) -> [f64; 3] {
        cross(&in_space(&minus(x, &self.end.position())), &in_space(force))
    }

    pub(super) fn commit(&mut self) {
        self.start = self.end;
    }
}

/// The prescribed components of the motion of a tool since time 0, at a time; 0 for free ones.
fn values<const D: usize>(tool: &Tool<D>, time: f64) -> Result<[f64; 6], ContactError> {
    let factor = tool.curve.factor(time);
    let mut values = [0.0; 6];
    for k in Tool::<D>::components() {
        let value = tool.freedom(k).value(factor, time);
        if let Freedom::Prescribed(formula) = tool.freedom(k)
            && !value.is_finite()
        {
            return Err(ContactError::NotFinite {
                tool: tool.name.clone(),
                component: Tool::<D>::component_name(k),
                formula: formula.text().to_owned(),
                value,
                factor,
                time,
            });
        }
        values[k] = value;
    }
    Ok(values)
}

/// A vector with three components.
pub(super) fn in_space<const D: usize>(v: &[f64; D]) -> [f64; 3] {
    std::array::from_fn(|d| if d < D { v[d % D] } else { 0.0 })
}

/// A rate of rotation times a vector.
pub(super) fn turn<const D: usize>(rate: &[f64; 3], v: &[f64; D]) -> [f64; D] {
    let turned = cross(rate, &in_space(v));
    std::array::from_fn(|d| turned[d])
}
