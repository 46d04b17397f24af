//! Update of the domains of GIMP points with the deformation, eqs. (32)-(39).
#![allow(non_snake_case)]

use serde::{Deserialize, Serialize};

use crate::tensor::{Mat3, Sym3};

/// Update rule for the half lengths of a GIMP domain; equation numbers refer to Coombs et al. (2020).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum DomainUpdate {
    /// No update: the domain keeps its original size.
    None,
    /// Eq. (32): all lengths scale with det(F)^(1/n_D).
    Determinant,
    /// Eq. (33): each length scales with F_ii.
    Diagonal,
    /// Eq. (34): each length scales with U_ii of the right stretch tensor.
    Stretch,
    /// Eq. (37): the corners move with the grid, the mid-points of the sides yield the lengths, and the volume is
    /// corrected.
    #[default]
    Corners,
    /// Eq. (38): each length scales with F_ii, and the volume is corrected.
    DiagonalCorrected,
    /// Eq. (39): the incremental form of (38).
    DiagonalIncremental,
}

/// Motion of one point over a load step: the input of its domain update.
pub struct DomainMotion<'a, const D: usize> {
    /// Deformation gradient F at the end of the step, restricted to the axes of the grid: without hoop stretch.
    pub F: &'a Mat3,
    /// Increment ΔF of the deformation gradient over the step, restricted likewise.
    pub dF: &'a Mat3,
    /// Original half lengths l_p0, [length].
    pub original: &'a [f64; D],
    /// Half lengths at the start of the step, [length].
    pub previous: &'a [f64; D],
    /// Position at the start of the step, [length].
    pub position: &'a [f64; D],
    /// Displacement increment of the grid as a function of the position at the start of the step, eq. (35), [length].
    pub displacement: &'a dyn Fn(&[f64; D]) -> [f64; D],
}

/// The updated half length of a domain is not positive.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the domain collapses along {}: half length {half_length:e}", ["x", "y", "z"][axis % 3])]
pub struct Collapsed {
    /// Axis of the half length.
    pub axis: usize,
    /// The updated half length, [length].
    pub half_length: f64,
}

impl DomainUpdate {
    /// Name in decks.
    pub fn name(self) -> &'static str {
        match self {
            DomainUpdate::None => "none",
            DomainUpdate::Determinant => "determinant",
            DomainUpdate::Diagonal => "diagonal",
            DomainUpdate::Stretch => "stretch",
            DomainUpdate::Corners => "corners",
            DomainUpdate::DiagonalCorrected => "diagonal-corrected",
            DomainUpdate::DiagonalIncremental => "diagonal-incremental",
        }
    }

    /// Half lengths at the end of the step, [length].
    ///
    /// # Errors
    /// [`Collapsed`] if a half length is not positive, which large rotations cause under eqs. (33), (38) and (39).
    pub fn half_lengths<const D: usize>(self, motion: &DomainMotion<D>) -> Result<[f64; D], Collapsed> {
        let DomainMotion { F, dF, original, previous, .. } = motion;
        let scaled = |lengths: &[f64; D], factor: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|i| lengths[i] * factor(i))
        };
        let lengths: [f64; D] = match self {
            DomainUpdate::None => **original,
            DomainUpdate::Determinant => {
                let factor = root::<D>(F.determinant());
                scaled(original, &|_| factor)
            }
            DomainUpdate::Diagonal => scaled(original, &|i| F[(i, i)]),
            DomainUpdate::Stretch => {
                let U = right_stretch(F);
                scaled(original, &|i| U.0[i])
            }
            DomainUpdate::Corners => {
                let midsides = lengths_from_corners(motion);
                let volume = F.determinant() * original.iter().product::<f64>();
                with_volume(midsides, volume)
            }
            DomainUpdate::DiagonalCorrected => corrected(F, original),
            DomainUpdate::DiagonalIncremental => corrected(dF, previous),
        };
        match lengths.iter().position(|l| l.is_nan() || *l <= 0.0) {
            Some(axis) => Err(Collapsed { axis, half_length: lengths[axis] }),
            None => Ok(lengths),
        }
    }
}

/// x^(1/n_D).
fn root<const D: usize>(x: f64) -> f64 {
    match D {
        2 => x.sqrt(),
        3 => x.cbrt(),
        _ => x.powf(1.0 / D as f64),
    }
}

/// U = √(Fᵀ F).
fn right_stretch(F: &Mat3) -> Sym3 {
    Sym3::symmetric_part(&(F.transpose() * F)).map_eigenvalues(f64::sqrt)
}

/// Evaluates l_i F_ii (det F / ∏ F_jj)^(1/n_D), eqs. (38) and (39). Returns l_i F_ii if a diagonal entry of F is not
/// positive, because no factor makes such lengths valid.
fn corrected<const D: usize>(F: &Mat3, lengths: &[f64; D]) -> [f64; D] {
    let factor = if (0..D).all(|j| F[(j, j)] > 0.0) {
        let product: f64 = (0..D).map(|j| F[(j, j)]).product();
        root::<D>(F.determinant() / product)
    } else {
        1.0
    };
    std::array::from_fn(|i| lengths[i] * F[(i, i)] * factor)
}

/// Scales half lengths uniformly so that their product is `volume`, the domain volume divided by 2^n_D, eq. (37).
fn with_volume<const D: usize>(lengths: [f64; D], volume: f64) -> [f64; D] {
    let factor = root::<D>(volume / lengths.iter().product::<f64>());
    lengths.map(|l| l * factor)
}

/// Along each axis, half the distance spanned by the mid-points of all sides (faces) after the corners have moved, eqs.
/// (35)-(36).
fn lengths_from_corners<const D: usize>(motion: &DomainMotion<D>) -> [f64; D] {
    let mut low = [f64::INFINITY; D];
    let mut high = [f64::NEG_INFINITY; D];
    let corners = 1usize << D;
    let mut middle = [[[0.0; D]; 2]; D]; // [axis][side]
    for corner in 0..corners {
        let corner_position: [f64; D] = std::array::from_fn(|d| {
            motion.position[d] + if corner >> d & 1 == 1 { motion.previous[d] } else { -motion.previous[d] }
        });
        let u = (motion.displacement)(&corner_position);
        for (axis, sides) in middle.iter_mut().enumerate() {
            for d in 0..D {
                sides[corner >> axis & 1][d] += (corner_position[d] + u[d]) / (corners / 2) as f64;
            }
        }
    }
    for point in middle.iter().flatten() {
        for d in 0..D {
            low[d] = low[d].min(point[d]);
            high[d] = high[d].max(point[d]);
        }
    }
    std::array::from_fn(|d| 0.5 * (high[d] - low[d]))
}

#[cfg(test)]
mod table_2;
