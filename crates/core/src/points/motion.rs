//! Velocities and accelerations of the points of an analysis with inertia.

use super::{FieldHandle, FieldKind, PointFieldSpec, Points};

/// Name of the field of velocities, and of that of accelerations.
const VELOCITY: &str = "velocity";
const ACCELERATION: &str = "acceleration";

/// Components of velocities and accelerations, [`Points::velocity`]: three in space and in the plane, where the last is
/// zero, so that files hold vectors.
pub const MOTION: usize = 3;

/// Momentum of points, and where they are.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Momentum {
    /// Σ m, [mass].
    pub mass: f64,
    /// Σ m x/Σ m, [length].
    pub centre: [f64; 3],
    /// Σ m v, [mass·length/time].
    pub linear: [f64; 3],
    /// Σ m x × v, about the origin, [mass·length²/time].
    pub angular: [f64; 3],
    /// ½ Σ m v², [energy].
    pub kinetic: f64,
    /// Largest speed of a point, [length/time].
    pub speed: f64,
}

impl<const D: usize> Points<D> {
    /// Gives the points velocities and accelerations, unless they have them; they start at rest.
    pub fn prepare_motion(&mut self) {
        for (name, unit) in [(VELOCITY, "length/time"), (ACCELERATION, "length/time^2")] {
            if self.motion_handle(name).is_some() {
                continue;
            }
            let start = vec![0.0; MOTION * self.len()];
            let (name, unit) = (name.to_owned(), unit.to_owned());
            let spec = PointFieldSpec { name, unit, components: MOTION, kind: FieldKind::Motion, start };
            // A field of another shape with this name belongs to a term of another crate.
            let _ = self.further.declare(spec, &self.id, |_| false);
        }
    }

    fn motion_handle(&self, name: &str) -> Option<FieldHandle> {
        self.further.handle(name).filter(|handle| self.further.field(*handle).components == MOTION)
    }

    /// Velocities at the end of the last converged step, [`MOTION`] components per point, [length/time]; `None` in an
    /// analysis without inertia.
    pub fn velocity(&self) -> Option<&[f64]> {
        self.motion_handle(VELOCITY).map(|handle| self.further.converged(handle))
    }

    /// Accelerations, as [`Points::velocity`], [length/time²]: at the end of the last step if the scheme keeps them,
    /// otherwise the mean over that step.
    pub fn acceleration(&self) -> Option<&[f64]> {
        self.motion_handle(ACCELERATION).map(|handle| self.further.converged(handle))
    }

    /// Sets the velocity of each point to that at its position, [length/time], between two steps.
    pub fn set_velocity(&mut self, velocity: impl Fn(usize) -> [f64; D]) {
        self.prepare_motion();
        let Some(handle) = self.motion_handle(VELOCITY) else { return };
        let n = self.len();
        let values = self.further.converged_mut(handle);
        for p in 0..n {
            values[MOTION * p..MOTION * p + D].copy_from_slice(&velocity(p));
        }
    }

    /// Writes velocities and accelerations into the trial state.
    pub(crate) fn set_motion(&mut self, velocity: &[f64], acceleration: &[f64]) {
        for (name, values) in [(VELOCITY, velocity), (ACCELERATION, acceleration)] {
            if let Some(handle) = self.motion_handle(name) {
                self.further.trial_mut(handle).copy_from_slice(values);
            }
        }
    }

    /// Momentum of the points of all ranks for which `counts` is true, in the converged state; all ranks must call this
    /// together.
    pub fn momentum(&self, counts: impl Fn(usize) -> bool) -> Momentum {
        let none = vec![0.0; MOTION * self.len()];
        let velocity = self.velocity().unwrap_or(&none);
        let mut sums = [0.0; 11];
        let mut speed: f64 = 0.0;
        for p in (0..self.len()).filter(|p| counts(*p)) {
            let (m, v) = (self.mass[p], &velocity[MOTION * p..MOTION * (p + 1)]);
            let x = crate::tensor::padded(&self.converged.position[p]);
            let square = v.iter().map(|v| v * v).sum::<f64>();
            sums[0] += m;
            for d in 0..3 {
                let (e, f) = ((d + 1) % 3, (d + 2) % 3);
                sums[1 + d] += m * x[d];
                sums[4 + d] += m * v[d];
                sums[7 + d] += m * (x[e] * v[f] - x[f] * v[e]);
            }
            sums[10] += 0.5 * m * square;
            speed = speed.max(square.sqrt());
        }
        let reduction = self.reduction();
        reduction.sum(&mut sums);
        let three = |first: usize| -> [f64; 3] { std::array::from_fn(|d| sums[first + d]) };
        let mass = sums[0];
        Momentum {
            mass,
            centre: three(1).map(|sum| if mass > 0.0 { sum / mass } else { 0.0 }),
            linear: three(4),
            angular: three(7),
            kinetic: sums[10],
            speed: reduction.largest(speed),
        }
    }
}
