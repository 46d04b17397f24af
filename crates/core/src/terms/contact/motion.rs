//! The motion of a tool in a step.

use crate::model::{Freedom, Model, Stepping, Tool};
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::step::{Step, displacement};
use crate::terms::Driven;
use crate::terms::failure::ContactError;
use crate::tool::{Closest, Increment, Pose, Shape};

/// Step in the load factor λ for the finite difference of a prescribed motion, relative to 1 + |λ|, [-].
const NEARBY: f64 = 1e-6;

/// A quarter turn, [rad].
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// A tool in a step: its pose at the start, and the pose to which the unknowns have moved it.
#[derive(Debug, Clone)]
pub(super) struct Moving<const D: usize> {
    /// Pose at the start of the analysis.
    pub(super) original: Pose<D>,
    /// Pose at the end of the last converged step.
    pub(super) start: Pose<D>,
    /// Pose at the last evaluation.
    pub(super) end: Pose<D>,
    /// Motion at the last evaluation.
    pub(super) increment: Increment<D>,
    /// The prescribed part of the motion; its free components are zero.
    prescribed: Increment<D>,
    /// Numbers of the components that are global unknowns: translations, then rotations. These are the free components
    /// and, if the load factor follows from equilibrium, the driven ones.
    pub(super) free: Vec<usize>,
    /// For each of these components, true if it is driven: its equation is then the prescribed motion, not the
    /// equilibrium of the tool.
    pub(super) follows: Vec<bool>,
    /// The prescribed motion at the start of the step, [length] and [rad].
    before: [f64; 6],
    /// Change of the prescribed rotation in the step, full turns included, [rad].
    turn: [f64; 3],
}

impl<const D: usize> Moving<D> {
    /// What the prescribed motion does in the step against this force and moment of the tool on the bodies.
    pub(super) fn against(&self, force: &[f64; D], moment: &[f64; 3]) -> Driven {
        let Increment { translation, rotation } = &self.prescribed;
        let [length, angle] = [norm(translation), norm(rotation)];
        let work = dot(force, translation) + dot(moment, rotation);
        Driven { work, displacement: if length > 0.0 { length } else { angle } }
    }

    pub(super) fn new(tool: &Tool<D>) -> Self {
        let none = Increment { translation: [0.0; D], rotation: [0.0; 3] };
        Moving {
            original: tool.pose,
            start: tool.pose,
            end: tool.pose,
            increment: none,
            prescribed: none,
            free: Tool::<D>::components().filter(|&k| tool.freedom(k).is_free()).collect(),
            follows: Vec::new(),
            before: [0.0; 6],
            turn: [0.0; 3],
        }
    }

    /// What does not move by itself: the sides of bodies, which move with the nodes.
    pub(super) fn at_rest() -> Self {
        let none = Increment { translation: [0.0; D], rotation: [0.0; 3] };
        let pose = Pose::at_origin();
        Moving {
            original: pose,
            start: pose,
            end: pose,
            increment: none,
            prescribed: none,
            free: Vec::new(),
            follows: Vec::new(),
            before: [0.0; 6],
            turn: [0.0; 3],
        }
    }

    /// Begins a step from the converged pose; `factor` is the load factor at this pose if it follows from equilibrium.
    pub(super) fn begin(
        &mut self,
        tool: &Tool<D>,
        model: &Model<D>,
        step: Step,
        factor: f64,
    ) -> Result<(), ContactError> {
        let name = || tool.name.clone();
        let is_unknown = model.stepping.control.has_unknown_factor();
        if is_unknown && !may_follow(tool, model) {
            return Err(ContactError::UnknownFactor { tool: name() });
        }
        let may_move = |k: usize| !model.revolved || k == 1;
        if let Some(k) = Tool::<D>::components().find(|&k| !may_move(k) && !tool.freedom(k).is_fixed()) {
            return Err(ContactError::OffAxis { tool: name(), component: Tool::<D>::component_name(k) });
        }
        let at = |time: f64| values(tool, tool.curve.factor_of_tool(&model.stepping, time, factor), time);
        // If the load factor follows from equilibrium, driven components begin the step at rest, too.
        let after = at(step.end)?;
        // A motion that is not zero at time 0 takes place in the first step, like that of a boundary condition.
        let before = if step.start == 0.0 { [0.0; 6] } else { at(step.start)? };
        let is_driven = |&k: &usize| is_unknown && tool.is_driven(k);
        self.free = Tool::<D>::components().filter(|k| tool.freedom(*k).is_free() || is_driven(k)).collect();
        self.follows = self.free.iter().map(is_driven).collect();
        self.before = before;
        let mut rotation = std::array::from_fn(|k| after[D + k] - before[D + k]);
        self.turn = rotation;
        if D == 3 && !tool.rotation.iter().any(Freedom::is_free) {
            // The relative rotation between two rotation vectors.
            let turned = |v: &[f64]| Pose::<D>::new([0.0; D], [v[D], v[D + 1], v[D + 2]]);
            if let (Ok(a), Ok(b)) = (turned(&before), turned(&after)) {
                rotation = b.rotation_since(&a);
            }
        }
        self.prescribed = Increment { translation: std::array::from_fn(|d| after[d] - before[d]), rotation };
        self.place(&[]);
        Ok(())
    }

    /// Moves the tool according to these increments of its free components; missing ones are 0.
    pub(super) fn place(&mut self, free: &[f64]) {
        self.increment = self.prescribed;
        for (&k, value) in self.free.iter().zip(free) {
            let component =
                if k < D { &mut self.increment.translation[k] } else { &mut self.increment.rotation[k - D] };
            *component = *value;
        }
        self.end = self.start.moved(&self.increment);
    }

    /// The closest point, in space, for a contact point that started at `start` and has moved by `slip` relative to the
    /// tool, both [length]. The coordinates are computed in the frame of the tool, where they are small.
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

    /// An upper bound on the prescribed motion, in the step, of the part of the tool within a distance of a position,
    /// [length].
    pub(super) fn prescribed_reach(&self, x: &[f64; D], distance: f64) -> f64 {
        if self.prescribed.rotation == [0.0; 3] {
            return norm(&self.prescribed.translation);
        }
        let moved = norm(&self.prescribed.displacement(&self.start, x));
        moved + norm(&self.prescribed.rotation) * distance
    }

    /// Length of the arc that the point of the tool at a position describes in the step, [length], if the tool turns by
    /// more than a quarter turn: the displacement, a chord, then says little about the path; 0 otherwise.
    pub(super) fn arc(&self, x: &[f64; D]) -> f64 {
        let angle = norm(&self.turn);
        if angle <= QUARTER {
            return 0.0;
        }
        norm(&cross(&self.turn, &in_space(&minus(x, &self.start.position()))))
    }

    /// The distance over which the tool has moved since the start of the step, [length]; `None` if it has turned.
    pub(super) fn translation(&self) -> Option<f64> {
        (self.increment.rotation == [0.0; 3]).then(|| norm(&self.increment.translation))
    }

    /// Magnitude of the coordinates of a position in the frame of the tool, [length].
    pub(super) fn extent(&self, x: &[f64; D]) -> f64 {
        norm(&minus(x, &self.start.position()))
    }

    /// The velocity of the tool at a position with respect to component `k` of its motion: the derivative of the
    /// position of a point of the tool, [-] for translations and [length] for rotations, and the rate of rotation, [-].
    pub(super) fn velocity(&self, k: usize, x: &[f64; D]) -> ([f64; D], [f64; 3]) {
        if k < D {
            return (std::array::from_fn(|d| if d == k { 1.0 } else { 0.0 }), [0.0; 3]);
        }
        let arm = minus(x, &self.end.position());
        let rate = self.increment.rotation_rate(k - D);
        (self.increment.rotation_derivative(&arm)[k - D], rate)
    }

    /// Component `k` of a force at a position, or of its moment about the reference point.
    pub(super) fn component(&self, k: usize, x: &[f64; D], force: &[f64; D]) -> f64 {
        if k < D { force[k] } else { self.moment(x, force)[k - D] }
    }

    /// Moment of a force at a position about the reference point, [force·length].
    pub(super) fn moment(&self, x: &[f64; D], force: &[f64; D]) -> [f64; 3] {
        cross(&in_space(&minus(x, &self.end.position())), &in_space(force))
    }

    /// The prescribed increment of component `k` at a load factor that follows from equilibrium, [length] or [rad], its
    /// derivative with respect to the factor, and the magnitude of the numbers from which it is formed.
    pub(super) fn driven(
        &self,
        tool: &Tool<D>,
        k: usize,
        stepping: &Stepping,
        [time, factor]: [f64; 2],
    ) -> [f64; 3] {
        let at = |factor: f64| tool.freedom(k).value(tool.curve.factor_of_tool(stepping, time, factor), time);
        let (now, nearby) = (at(factor), NEARBY * (1.0 + factor.abs()));
        let change = (at(factor + nearby) - at(factor - nearby)) / (2.0 * nearby);
        [now - self.before[k], change, now.abs() + self.before[k].abs()]
    }

    /// The first component that is free and does not follow the load factor.
    pub(super) fn first_free(&self) -> Option<usize> {
        self.free.iter().zip(&self.follows).find(|(_, follows)| !**follows).map(|(k, _)| *k)
    }

    pub(super) fn commit(&mut self) {
        self.start = self.end;
    }
}

/// True if a load factor that follows from equilibrium can drive and load a tool: its motion is not a formula of time,
/// it turns about one axis at most, and no later stage follows, because the curves of that stage would begin elsewhere.
/// True also if nothing drives or loads the tool.
fn may_follow<const D: usize>(tool: &Tool<D>, model: &Model<D>) -> bool {
    let depends_on_time = |k: &usize| {
        let freedom = tool.freedom(*k);
        matches!(freedom, Freedom::Prescribed(formula) if formula.depends_on(1))
    };
    let driven: Vec<usize> = Tool::<D>::components().filter(|&k| tool.is_driven(k)).collect();
    let is_last = model.present.stage + 1 >= model.stages.len();
    let is_idle = driven.is_empty() && tool.loads.is_empty();
    is_idle
        || is_last && !driven.iter().any(depends_on_time) && driven.iter().filter(|k| **k >= D).count() <= 1
}

/// The prescribed components of the motion of a tool since time 0, at a load factor and a time; 0 for free ones.
fn values<const D: usize>(tool: &Tool<D>, factor: f64, time: f64) -> Result<[f64; 6], ContactError> {
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

/// The largest displacement of a node, [length].
pub(super) fn farthest<const D: usize, const N: usize>(delta_d: &[[f64; N]]) -> f64 {
    displacement::<D, N>(delta_d).iter().map(norm).fold(0.0, f64::max)
}

/// The vector with three components; missing ones are zero.
pub(super) fn in_space<const D: usize>(v: &[f64; D]) -> [f64; 3] {
    std::array::from_fn(|d| if d < D { v[d % D] } else { 0.0 })
}

/// The vector product of a rate of rotation and a vector.
pub(super) fn turn<const D: usize>(rate: &[f64; 3], v: &[f64; D]) -> [f64; D] {
    let turned = cross(rate, &in_space(v));
    std::array::from_fn(|d| turned[d])
}
