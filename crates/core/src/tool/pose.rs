//! Position and rotation of a rigid tool.

use super::closest::Closest;
use super::error::ShapeError;
use super::rotation::{apply, exponential, left_jacobian, logarithm, product, transposed, turning};
use super::shape::Shape;
use crate::region::finite;
use crate::region::vector::{along, cross, dot, minus, unit};

/// The position and rotation of a rigid tool: a position X in its frame is at c + R X in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<const D: usize> {
    position: [f64; D],
    rotation: [[f64; D]; D],
    /// In the plane, the angle of the rotation including full turns, [rad].
    angle: f64,
}

/// A rigid motion from one pose to the next: x = c + u + exp(θ̂) (X − c), for a point of the tool that is at X at the
/// start, where c is the position of the reference point at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment<const D: usize> {
    /// Translation u of the reference point, [length].
    pub translation: [f64; D],
    /// Rotation vector θ in global axes, [rad]. In the plane only the third component counts, the counterclockwise
    /// angle.
    pub rotation: [f64; 3],
}

impl<const D: usize> Pose<D> {
    /// The pose with this position of the reference point (the origin of the frame of the tool), [length], and this
    /// rotation vector, as in [`Increment::rotation`], [rad].
    ///
    /// # Errors
    /// [`ShapeError::Primitive`] if a number is not finite.
    pub fn new(position: [f64; D], rotation: [f64; 3]) -> Result<Self, ShapeError> {
        let translation = finite("the position of a tool", position)?;
        let rotation = finite("the rotation of a tool", rotation)?;
        Ok(Pose::at_origin().moved(&Increment { translation, rotation }))
    }

    /// The pose in which the frame of the tool is the global one.
    pub fn at_origin() -> Self {
        Pose { position: [0.0; D], rotation: std::array::from_fn(unit), angle: 0.0 }
    }

    /// The position c of the reference point, [length].
    pub fn position(&self) -> [f64; D] {
        self.position
    }

    /// The rotation matrix R, `[i][j]`.
    pub fn rotation(&self) -> [[f64; D]; D] {
        self.rotation
    }

    /// The rotation as in [`Increment::rotation`], [rad]: in the plane with all full turns, in space by at most π.
    pub fn rotation_vector(&self) -> [f64; 3] {
        if D == 3 {
            logarithm(&std::array::from_fn(|i| std::array::from_fn(|j| self.rotation[i % D][j % D])))
        } else {
            [0.0, 0.0, self.angle]
        }
    }

    /// The rotation vector, in global axes, of the rotation from another pose to this one, [rad]: in the plane with all
    /// full turns, in space by at most π.
    pub fn rotation_since(&self, start: &Pose<D>) -> [f64; 3] {
        if D == 3 {
            let turned = product(&self.rotation, &transposed(&start.rotation));
            logarithm(&std::array::from_fn(|i| std::array::from_fn(|j| turned[i % D][j % D])))
        } else {
            [0.0, 0.0, self.angle - start.angle]
        }
    }

    /// All numbers of the pose, from which [`Pose::from_numbers`] restores it bit for bit.
    pub fn to_numbers(&self) -> Vec<f64> {
        let rotation = self.rotation.as_flattened().iter();
        self.position.iter().chain(rotation).copied().chain([self.angle]).collect()
    }

    /// The pose with these numbers; `None` if they do not describe a pose.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (position, rest) = numbers.split_first_chunk::<D>()?;
        let (angle, matrix) = rest.split_last()?;
        let (rows, left) = matrix.as_chunks::<D>();
        let rotation: [[f64; D]; D] = rows.try_into().ok()?;
        let square = product(&transposed(&rotation), &rotation);
        let is_rotation = (0..D).all(|i| (0..D).all(|j| (square[i][j] - unit::<D>(i)[j]).abs() < 1e-6));
        let is_finite = numbers.iter().all(|x| x.is_finite());
        (left.is_empty() && is_rotation && is_finite).then_some(Pose {
            position: *position,
            rotation,
            angle: *angle,
        })
    }

    /// Converts a position from the frame of the tool to space, [length].
    pub fn to_space(&self, x: &[f64; D]) -> [f64; D] {
        along(&self.position, 1.0, &apply(&self.rotation, x))
    }

    /// Converts a position from space to the frame of the tool, [length].
    pub fn to_tool(&self, x: &[f64; D]) -> [f64; D] {
        self.vector_to_tool(&minus(x, &self.position))
    }

    /// Converts the components of a vector from the frame of the tool to space.
    pub fn vector_to_space(&self, v: &[f64; D]) -> [f64; D] {
        apply(&self.rotation, v)
    }

    /// Converts the components of a vector from space to the frame of the tool.
    pub fn vector_to_tool(&self, v: &[f64; D]) -> [f64; D] {
        apply(&transposed(&self.rotation), v)
    }

    /// The pose after a motion.
    pub fn moved(&self, increment: &Increment<D>) -> Self {
        let angle = self.angle + increment.rotation[2];
        let rotation = if D == 3 {
            let turned = product(&increment.matrix(), &self.rotation);
            // A Newton step towards the closest rotation keeps the errors of many increments from adding up.
            let square = product(&transposed(&turned), &turned);
            let correction =
                std::array::from_fn(|i| std::array::from_fn(|j| 1.5 * unit::<D>(i)[j] - 0.5 * square[i][j]));
            product(&turned, &correction)
        } else {
            Increment { rotation: [0.0, 0.0, angle], ..*increment }.matrix()
        };
        Pose { position: along(&self.position, 1.0, &increment.translation), rotation, angle }
    }

    /// The closest point, in space, on the surface of a tool in this pose; `None` if |gap| exceeds `limit`, [length],
    /// or a coordinate is not finite.
    pub fn closest(&self, shape: &dyn Shape<D>, x: [f64; D], limit: f64) -> Option<Closest<D>> {
        Some(self.in_space(&shape.closest_within(self.to_tool(&x), limit)?))
    }

    /// Transforms a closest point from the frame of a tool in this pose to space.
    pub fn in_space(&self, found: &Closest<D>) -> Closest<D> {
        found.turned(&self.rotation, |x| self.to_space(x))
    }
}

/// The first time at which a point meets the surface of a moving tool, as a fraction of the motion. The point and the
/// tool move from their first to their second positions in such a way that the path of the point is straight in the
/// frame of the tool.
pub fn first_contact<const D: usize>(
    shape: &dyn Shape<D>,
    poses: [&Pose<D>; 2],
    point: [[f64; D]; 2],
) -> Option<f64> {
    shape.first_contact(poses[0].to_tool(&point[0]), poses[1].to_tool(&point[1]))
}

impl<const D: usize> Increment<D> {
    /// The rotation vector; in the plane, the components that do not count are zero.
    fn rotation_vector(&self) -> [f64; 3] {
        if D == 3 { self.rotation } else { [0.0, 0.0, self.rotation[2]] }
    }

    /// exp(θ̂).
    fn matrix(&self) -> [[f64; D]; D] {
        let matrix = exponential(&self.rotation_vector());
        std::array::from_fn(|i| std::array::from_fn(|j| matrix[i % 3][j % 3]))
    }

    /// The position after the motion from a pose, [length], of the point of the tool that is at `x` before the motion.
    pub fn carry(&self, start: &Pose<D>, x: &[f64; D]) -> [f64; D] {
        let arm = apply(&self.matrix(), &minus(x, &start.position));
        along(&along(&start.position, 1.0, &self.translation), 1.0, &arm)
    }

    /// Displacement, during the motion, of the point of the tool that is at `x` before it, [length]. Its round-off is
    /// relative to the displacement, not to the position.
    pub fn displacement(&self, start: &Pose<D>, x: &[f64; D]) -> [f64; D] {
        if self.rotation_vector() == [0.0; 3] {
            return self.translation;
        }
        let arm = minus(x, &start.position);
        let arm = std::array::from_fn(|d| if d < D { arm[d % D] } else { 0.0 });
        let turned = turning(&self.rotation_vector(), &arm);
        std::array::from_fn(|d| self.translation[d] + turned[d])
    }

    /// Derivative of [`Increment::carry`] with respect to the rotation, `[k][i]` = ∂x_i/∂θ_k, [length]. The derivative
    /// with respect to the translation is the identity.
    pub fn carry_derivative(&self, start: &Pose<D>, x: &[f64; D]) -> [[f64; D]; 3] {
        self.rotation_derivative(&apply(&self.matrix(), &minus(x, &start.position)))
    }

    /// Derivative with respect to the rotation, `[k][i]` = ∂x_i/∂θ_k, [length], of the position of the point of the
    /// tool that is at `arm` from the reference point after the motion: J e_k × arm with the left Jacobian J of
    /// exp(θ̂). In the plane the first two rows are zero.
    pub fn rotation_derivative(&self, arm: &[f64; D]) -> [[f64; D]; 3] {
        let jacobian = transposed(&left_jacobian(&self.rotation_vector()));
        let arm = std::array::from_fn(|d| if d < D { arm[d % D] } else { 0.0 });
        std::array::from_fn(|k| {
            let moved = if D == 3 || k == 2 { cross(&jacobian[k], &arm) } else { [0.0; 3] };
            std::array::from_fn(|d| moved[d % 3])
        })
    }

    /// The rate of rotation of the tool, in global axes, as component `k` of the rotation grows, [-]: column k of the
    /// left Jacobian J of exp(θ̂). In the plane only the third column is not zero.
    pub fn rotation_rate(&self, k: usize) -> [f64; 3] {
        match (D, k) {
            (3, _) => transposed(&left_jacobian(&self.rotation_vector()))[k % 3],
            (_, 2) => [0.0, 0.0, 1.0],
            _ => [0.0; 3],
        }
    }

    /// Derivative of the gap of a fixed position with respect to the translation and to the rotation, [-] and [length]:
    /// −n · ∂x/∂(u, θ) for the point x of the tool that is closest, because the gap is stationary along the surface.
    /// `found` is the closest point on the tool after the motion, and `reference` is the position of the reference
    /// point at that time.
    pub fn gap_derivative(&self, found: &Closest<D>, reference: &[f64; D]) -> ([f64; D], [f64; 3]) {
        let turned = self.rotation_derivative(&minus(&found.point, reference));
        (found.normal.map(|n| -n), turned.map(|row| -dot(&row, &found.normal)))
    }
}
