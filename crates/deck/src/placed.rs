//! The position of a shape that a file gives in its own axes.

use mpm_core::region::{Motion, ShapeError};

use crate::per_axis::array;

/// How the coordinates in a file are scaled, turned about the origin of the file, and moved.
///
/// # Errors
/// If a number is not finite or the scale is not positive.
pub(crate) fn placed(
    scale: Option<f64>,
    rotate: Option<&[f64]>,
    at: Option<&[f64]>,
) -> Result<Motion<3>, ShapeError> {
    let mut placed = Motion::scaling(scale.unwrap_or(1.0), [0.0; 3])?;
    if let Some(rotate) = rotate {
        let axis: [f64; 3] = array(rotate);
        let angle = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        if angle > 0.0 {
            placed = placed.then(&Motion::<3>::rotation(axis, angle.to_radians(), [0.0; 3])?);
        }
    }
    Ok(placed.then(&Motion::translation(array(at.unwrap_or_default()))?))
}
