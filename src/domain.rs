//! How the domain of a point follows the deformation, eqs. (32)-(39).
#![allow(non_snake_case)]

use serde::{Deserialize, Serialize};

use crate::tensor::{Mat3, Sym3};

/// How the half lengths of a GIMP domain follow the deformation; equation numbers of Coombs et al. (2020).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
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
    /// Eq. (37): corners move with the grid, mid-sides give the lengths, the volume is corrected.
    #[default]
    Corners,
    /// Eq. (38): F_ii with the volume corrected.
    DiagonalCorrected,
    /// Eq. (39): the incremental form of (38).
    DiagonalIncremental,
}

/// The motion of one point over a load step, as far as its domain needs it.
pub struct Motion<'a, const D: usize> {
    /// Deformation gradient F at the end of the step.
    pub F: &'a Mat3,
    /// Its increment ΔF over the step.
    pub dF: &'a Mat3,
    /// Original half lengths l_p0, [length].
    pub original: &'a [f64; D],
    /// Half lengths at the start of the step, [length].
    pub previous: &'a [f64; D],
    /// Position at the start of the step, [length].
    pub position: &'a [f64; D],
    /// Displacement over the step of a place given at the start of the step, from the grid, eq. (35).
    pub displacement: &'a dyn Fn(&[f64; D]) -> [f64; D],
}

/// The update would give a domain of no or negative length.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the domain collapses along axis {axis}: half length {half_length:e}")]
pub struct Collapsed {
    /// Axis along which it does.
    pub axis: usize,
    /// The half length that the update gives, [length].
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
    /// [`Collapsed`] when a length would not be positive: under (33), (38) and (39) at large rotations.
    pub fn half_lengths<const D: usize>(self, motion: &Motion<D>) -> Result<[f64; D], Collapsed> {
        let Motion { F, dF, original, previous, .. } = motion;
        let scaled = |lengths: &[f64; D], factor: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|i| lengths[i] * factor(i))
        };
        let lengths: [f64; D] = match self {
            DomainUpdate::None => **original,
            DomainUpdate::Determinant => {
                let factor = F.determinant().powf(1.0 / D as f64);
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
            DomainUpdate::DiagonalCorrected => {
                let factor = volume_factor::<D>(F);
                scaled(original, &|i| F[(i, i)] * factor)
            }
            DomainUpdate::DiagonalIncremental => {
                let factor = volume_factor::<D>(dF);
                scaled(previous, &|i| dF[(i, i)] * factor)
            }
        };
        match lengths.iter().position(|l| l.is_nan() || *l <= 0.0) {
            Some(axis) => Err(Collapsed { axis, half_length: lengths[axis] }),
            None => Ok(lengths),
        }
    }
}

/// U = √(Fᵀ F).
fn right_stretch(F: &Mat3) -> Sym3 {
    Sym3::symmetric_part(&(F.transpose() * F)).map_eigenvalues(f64::sqrt)
}

/// (det F / ∏ F_jj)^(1/n_D) of eqs. (38) and (39).
fn volume_factor<const D: usize>(F: &Mat3) -> f64 {
    let product: f64 = (0..D).map(|j| F[(j, j)]).product();
    (F.determinant() / product).powf(1.0 / D as f64)
}

/// Scales lengths uniformly to a volume (both per 2^n_D), as eq. (37).
fn with_volume<const D: usize>(lengths: [f64; D], volume: f64) -> [f64; D] {
    let factor = (volume / lengths.iter().product::<f64>()).powf(1.0 / D as f64);
    lengths.map(|l| l * factor)
}

/// Eqs. (35)-(36): half the largest distance between the mid-points of the sides, after the corners have moved.
fn lengths_from_corners<const D: usize>(motion: &Motion<D>) -> [f64; D] {
    let mut low = [f64::INFINITY; D];
    let mut high = [f64::NEG_INFINITY; D];
    let corners = 1usize << D;
    let mut middle = [[[0.0; D]; 2]; D]; // [axis][side]
    for corner in 0..corners {
        let place: [f64; D] = std::array::from_fn(|d| {
            motion.position[d] + if corner >> d & 1 == 1 { motion.previous[d] } else { -motion.previous[d] }
        });
        let u = (motion.displacement)(&place);
        for (axis, sides) in middle.iter_mut().enumerate() {
            for d in 0..D {
                sides[corner >> axis & 1][d] += (place[d] + u[d]) / (corners / 2) as f64;
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

/// Table 2 as a conformance test, with (38) and (39) added: each update under each motion, and for those that the
/// table rejects the very failure that its footnotes describe.
#[cfg(test)]
mod table_2 {
    use super::DomainUpdate::*;
    use super::*;

    const ALL: [DomainUpdate; 7] =
        [None, Determinant, Diagonal, Stretch, Corners, DiagonalCorrected, DiagonalIncremental];
    const L0: [f64; 2] = [0.3, 0.2];
    const STEPS: usize = 40;

    /// Half lengths after a homogeneous motion given by its deformation gradient at time t in [0, 1].
    fn after(update: DomainUpdate, F_at: impl Fn(f64) -> Mat3) -> Result<[f64; 2], Collapsed> {
        let mut lengths = L0;
        let mut position = [1.0, 2.0];
        let mut F_n = Mat3::identity();
        for step in 1..=STEPS {
            let F = F_at(step as f64 / STEPS as f64);
            let dF = F * F_n.try_inverse().unwrap();
            let displacement = |x: &[f64; 2]| {
                let y = dF * nalgebra::Vector3::new(x[0], x[1], 0.0);
                [y[0] - x[0], y[1] - x[1]]
            };
            let motion = Motion {
                F: &F,
                dF: &dF,
                original: &L0,
                previous: &lengths,
                position: &position,
                displacement: &displacement,
            };
            lengths = update.half_lengths(&motion)?;
            let u = displacement(&position);
            position = [position[0] + u[0], position[1] + u[1]];
            F_n = F;
        }
        Ok(lengths)
    }

    fn is(lengths: Result<[f64; 2], Collapsed>, expected: [f64; 2]) -> bool {
        lengths.is_ok_and(|l| (l[0] - expected[0]).abs() < 1e-12 && (l[1] - expected[1]).abs() < 1e-12)
    }

    fn rotation(angle: f64) -> Mat3 {
        let (s, c) = angle.sin_cos();
        Mat3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn simple_stretch() {
        let stretch = |t: f64| Mat3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0 - 0.4 * t, 1.0));
        for update in ALL {
            let suitable = !matches!(update, None | Determinant);
            assert_eq!(is(after(update, stretch), [0.3, 0.12]), suitable, "{update:?}");
        }
        assert!(is(after(None, stretch), L0), "footnote a: the volume change is not seen");
        let shrink = 0.6f64.sqrt();
        assert!(
            is(after(Determinant, stretch), [0.3 * shrink, 0.2 * shrink]),
            "footnote b: artificial contraction"
        );
    }

    #[test]
    fn hydrostatic_compression_and_extension() {
        for end in [0.7, 1.5] {
            let squeeze = |t: f64| {
                let s = 1.0 + (end - 1.0) * t;
                Mat3::from_diagonal(&nalgebra::Vector3::new(s, s, 1.0))
            };
            for update in ALL {
                assert_eq!(is(after(update, squeeze), [0.3 * end, 0.2 * end]), update != None, "{update:?}");
            }
        }
    }

    #[test]
    fn simple_shear() {
        let shear = |t: f64| Mat3::new(1.0, 2.0 * t, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        for update in ALL {
            assert_eq!(is(after(update, shear), L0), update != Stretch, "{update:?}");
        }
        let [lx, ly] = after(Stretch, shear).unwrap();
        assert!((lx * ly / (0.3 * 0.2) - 1.0).abs() > 0.05, "footnote c: the volume changes");
        assert!(lx < 0.3 && ly > 0.2);
    }

    #[test]
    fn pure_rotation() {
        let turn = |t: f64| rotation(1.2 * t);
        let volume = |l: [f64; 2]| l[0] * l[1] / (L0[0] * L0[1]);
        for update in ALL {
            let lengths = after(update, turn).unwrap();
            assert_eq!((volume(lengths) - 1.0).abs() < 1e-12, update != Diagonal, "{update:?}");
        }
        for update in [None, Determinant, Stretch, DiagonalCorrected, DiagonalIncremental] {
            assert!(is(after(update, turn), L0), "{update:?}");
        }
        assert!(volume(after(Diagonal, turn).unwrap()) < 0.2, "footnote d: the domain vanishes");
        // Beyond 90° the diagonal of F turns negative: an error, not a negative domain.
        assert!(after(Diagonal, |t| rotation(2.0 * t)).is_err());
        assert!(after(DiagonalCorrected, |t| rotation(1.5 * t)).is_ok());
        assert!(after(DiagonalCorrected, |t| rotation(2.0 * t)).is_err());
        assert!(is(after(DiagonalIncremental, |t| rotation(2.0 * t)), L0));
    }
}
