//! Similarity transformations: translations, rotations and uniform scalings.

use super::vector::{along, cross, dot, minus, norm, unit};
use super::{Line, ShapeError, finite, positive};

/// A similarity transformation x ↦ s R x + c with a scale s > 0, a rotation R and a shift c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<const D: usize> {
    rotation: [[f64; D]; D],
    scale: f64,
    shift: [f64; D],
}

impl<const D: usize> Motion<D> {
    /// The identity.
    pub fn identity() -> Self {
        Motion { rotation: std::array::from_fn(unit), scale: 1.0, shift: [0.0; D] }
    }

    /// A translation by `shift`, [length].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`].
    pub fn translation(shift: [f64; D]) -> Result<Self, ShapeError> {
        Ok(Motion { shift: finite("the translation", shift)?, ..Self::identity() })
    }

    /// A uniform scaling about a fixed position, [length].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::NotPositive`].
    pub fn scaling(factor: f64, about: [f64; D]) -> Result<Self, ShapeError> {
        let scale = positive("the scale", factor)?;
        let shift = finite("the centre of the scaling", about)?.map(|x| (1.0 - scale) * x);
        Ok(Motion { scale, shift, ..Self::identity() })
    }

    /// A rotation about a fixed position.
    fn about(rotation: [[f64; D]; D], center: [f64; D]) -> Result<Self, ShapeError> {
        let center = finite("the centre of the rotation", center)?;
        let turned: [f64; D] = std::array::from_fn(|d| dot(&rotation[d], &center));
        Ok(Motion { rotation, scale: 1.0, shift: minus(&center, &turned) })
    }

    /// Composition: this motion, then `next`.
    pub fn then(&self, next: &Motion<D>) -> Motion<D> {
        let row =
            |i: usize| (0..D).fold([0.0; D], |sum, k| along(&sum, next.rotation[i][k], &self.rotation[k]));
        Motion {
            rotation: std::array::from_fn(row),
            scale: self.scale * next.scale,
            shift: next.apply(&self.shift),
        }
    }

    /// The inverse motion.
    pub fn inverse(&self) -> Motion<D> {
        let rotation = self.transposed();
        let scale = 1.0 / self.scale;
        let shift = std::array::from_fn(|d| -scale * dot(&rotation[d], &self.shift));
        Motion { rotation, scale, shift }
    }

    fn transposed(&self) -> [[f64; D]; D] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.rotation[j][i]))
    }

    /// The image of a position, [length].
    pub fn apply(&self, x: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|d| self.scale * dot(&self.rotation[d], x) + self.shift[d])
    }

    /// The preimage of a position, [length].
    pub fn undo(&self, x: &[f64; D]) -> [f64; D] {
        self.undo_direction(&minus(x, &self.shift))
    }

    fn undo_direction(&self, y: &[f64; D]) -> [f64; D] {
        // Column by column, so that the identity reproduces its argument exactly.
        let turned = (0..D).fold([0.0; D], |sum, k| along(&sum, y[k], &self.rotation[k]));
        turned.map(|x| x / self.scale)
    }

    /// The preimage of a line, with the same parameter.
    pub(super) fn undo_line(&self, line: &Line<D>) -> Line<D> {
        Line { origin: self.undo(&line.origin), direction: self.undo_direction(&line.direction) }
    }

    /// A coordinate after the motion as a linear function of the position before the motion: gradient and constant.
    pub(super) fn undo_coordinate(&self, axis: usize) -> ([f64; D], f64) {
        (self.rotation[axis].map(|r| self.scale * r), self.shift[axis])
    }

    /// Ratio of lengths after and before the motion, [-].
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Ratio of the volumes after and before the motion, [-].
    pub(crate) fn volume_ratio(&self) -> f64 {
        self.scale.powi(D as i32)
    }
}

impl Motion<2> {
    /// A counterclockwise rotation about a position, [length], by an angle, [rad].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`].
    pub fn rotation(angle: f64, center: [f64; 2]) -> Result<Self, ShapeError> {
        let [s, c] = sine_and_cosine(angle)?;
        Self::about([[c, -s], [s, c]], center)
    }
}

impl Motion<3> {
    /// A right-handed rotation by an angle, [rad], about the line through `center`, [length], along `axis`.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] if the axis has zero length.
    pub fn rotation(axis: [f64; 3], angle: f64, center: [f64; 3]) -> Result<Self, ShapeError> {
        // Scale first: the squares of very large or small numbers overflow or underflow.
        let largest = finite("the axis of the rotation", axis)?.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let largest = positive("the length of the axis", largest)?;
        let axis = axis.map(|x| x / largest);
        let length = norm(&axis);
        let n = axis.map(|x| x / length);
        let [s, c] = sine_and_cosine(angle)?;
        // Columns are the images of the unit vectors: c e + (1 − c)(n·e) n + s n × e.
        let image = |e: [f64; 3]| {
            let turned = cross(&n, &e);
            along(&along(&e.map(|x| c * x), (1.0 - c) * dot(&n, &e), &n), s, &turned)
        };
        let columns: [[f64; 3]; 3] = std::array::from_fn(|d| image(unit(d)));
        Self::about(std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i])), center)
    }
}

/// Sine and cosine of an angle, [rad]. They are exact for quarter turns, although the angle is rounded, so that
/// axis-aligned boxes remain axis-aligned.
fn sine_and_cosine(angle: f64) -> Result<[f64; 2], ShapeError> {
    let [angle] = finite("the angle", [angle])?;
    let whole = |x: f64| if (x - x.round()).abs() < 4.0 * f64::EPSILON { x.round() } else { x };
    let (s, c) = angle.sin_cos();
    Ok(if whole(s) == 0.0 || whole(c) == 0.0 { [s.round(), c.round()] } else { [s, c] })
}
