//! The motion of a point, and the objection that Table 2 of the paper raises to a domain update under this motion.
//!
//! In the plane (`D` = 2) domains have no third axis, whatever F_zz is.
#![allow(non_snake_case)]

use crate::domain::DomainUpdate;
use crate::tensor::spectral::Spectrum;
use crate::tensor::{Mat3, Sym3};

/// A number from 0 to 2 that grows with the angle of the rotation in F = R U, and is cheaper to compute.
#[inline]
pub fn turn<const D: usize>(F: &Mat3) -> f64 {
    let (c, s) = cosine_and_sine::<D>(F);
    let part = s / (c.abs() + s);
    if c >= 0.0 { part } else { 2.0 - part }
}

/// The angle of a [`turn`], from 0 to 180, [degrees].
pub fn rotation_of_turn(turn: f64) -> f64 {
    let (s, c) = if turn <= 1.0 { (turn, 1.0 - turn) } else { (2.0 - turn, 1.0 - turn) };
    s.atan2(c).to_degrees()
}

/// Angle of the rotation R in the polar decomposition F = R U, whatever its axis, from 0 to 180, [degrees].
fn rotation<const D: usize>(F: &Mat3) -> f64 {
    let (c, s) = cosine_and_sine::<D>(F);
    s.atan2(c).to_degrees()
}

/// Cosine and sine of the angle of the rotation in F, both scaled by the same positive number.
#[inline]
fn cosine_and_sine<const D: usize>(F: &Mat3) -> (f64, f64) {
    if D == 2 {
        return (F[(0, 0)] + F[(1, 1)], (F[(1, 0)] - F[(0, 1)]).abs());
    }
    let R = rotation_tensor(F);
    let axis = [R[(2, 1)] - R[(1, 2)], R[(0, 2)] - R[(2, 0)], R[(1, 0)] - R[(0, 1)]];
    (R.trace() - 1.0, (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt())
}

/// R of F = R U for det F > 0, by Newton's method for Rᵀ R = I: R ← (R + R⁻ᵀ)/2, which halves large stretches and then
/// converges quadratically (Higham 1986, doi 10.1137/0907079).
fn rotation_tensor(F: &Mat3) -> Mat3 {
    /// Enough iterations for principal stretches of any finite size.
    const MAX_SAMPLES: usize = 2000;
    let mut R = *F;
    for _ in 0..MAX_SAMPLES {
        let Some(inverse) = R.try_inverse() else { break };
        let change = 0.5 * (inverse.transpose() - R);
        R += change;
        // The next change is of the order of the square of this one.
        if change.norm_squared() < 1e-16 || !change.norm_squared().is_finite() {
            break;
        }
    }
    R
}

/// Tangent of the change of the right angle between two axes of the original configuration, the largest over all pairs
/// of axes, [-]: γ in simple shear, zero in stretch along the axes, independent of rotations.
#[inline]
pub fn shear<const D: usize>(F: &Mat3) -> f64 {
    let C = |i, j| right_cauchy_green::<D>(F, i, j);
    let tangent = |i, j| C(i, j).abs() / (C(i, i) * C(j, j) - C(i, j) * C(i, j)).sqrt();
    if D == 2 { tangent(0, 1) } else { tangent(0, 1).max(tangent(0, 2)).max(tangent(1, 2)) }
}

/// Ratio of the largest to the smallest principal stretch, [-].
fn stretch_ratio<const D: usize>(F: &Mat3) -> f64 {
    if D == 2 {
        let C = |i, j| right_cauchy_green::<2>(F, i, j);
        let (mean, radius) = (0.5 * (C(0, 0) + C(1, 1)), (0.5 * (C(0, 0) - C(1, 1))).hypot(C(0, 1)));
        // The product of the two squared stretches is (det F)².
        return (mean + radius) / ratio_of_volume::<2>(F).abs();
    }
    let squares = Spectrum::new(&Sym3::symmetric_part(&(F.transpose() * F))).values;
    let largest = squares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = squares.iter().copied().fold(f64::INFINITY, f64::min);
    (largest / smallest).sqrt()
}

/// A component of C = Fᵀ F over the axes of a domain.
#[inline]
fn right_cauchy_green<const D: usize>(F: &Mat3, i: usize, j: usize) -> f64 {
    (0..D).map(|k| F[(k, i)] * F[(k, j)]).sum()
}

/// Determinant of F over the axes of a domain.
fn ratio_of_volume<const D: usize>(F: &Mat3) -> f64 {
    if D == 2 { F[(0, 0)] * F[(1, 1)] - F[(0, 1)] * F[(1, 0)] } else { F.determinant() }
}

/// Rotation beyond which the update with F_ii is unsuitable, [degrees].
const MAX_ROTATION: f64 = 15.0;
/// Shear beyond which the update with U_ii is unsuitable, [-].
const MAX_SHEAR: f64 = 0.3;
/// Relative change of the volume of a domain, or of its area in two dimensions, beyond which domains without an update
/// are unsuitable, [-].
const MAX_VOLUME_CHANGE: f64 = 0.05;
/// Ratio of principal stretches beyond which the update with det F is unsuitable, [-].
const MAX_STRETCH_RATIO: f64 = 1.2;

/// A reason of Table 2 to reject a domain update: a measure of how far the motion departs from the motions that the
/// update can follow, and the limit of this measure.
#[derive(Debug, Clone, Copy)]
pub struct Objection {
    measure: fn(&Mat3) -> f64,
    /// Largest acceptable value of the measure.
    pub limit: f64,
    /// The measure as text.
    pub describe: fn(f64) -> String,
}

impl Objection {
    /// The objection to an update of domains with `D` axes, if there is any.
    pub fn to<const D: usize>(update: DomainUpdate) -> Option<Objection> {
        match update {
            DomainUpdate::None => Some(Objection {
                measure: |F| (ratio_of_volume::<D>(F) - 1.0).abs(),
                limit: MAX_VOLUME_CHANGE,
                describe: |value| {
                    let what = if D == 2 { "area" } else { "volume" };
                    format!("changed its {what} by {:.1} %", 100.0 * value)
                },
            }),
            DomainUpdate::Determinant => Some(Objection {
                measure: |F| if axes_differ::<D>(F) { stretch_ratio::<D>(F) } else { 1.0 },
                limit: MAX_STRETCH_RATIO,
                describe: |value| format!("principal stretches in the ratio {value:.2}"),
            }),
            DomainUpdate::Diagonal => Some(Objection::to_rotation::<D>()),
            // In the plane, the volume correction undoes the effect of a rotation on the two lengths. In space, the
            // correction is spread over all three lengths and cannot undo it.
            DomainUpdate::DiagonalCorrected if D == 3 => Some(Objection::to_rotation::<D>()),
            DomainUpdate::Stretch => Some(Objection {
                measure: shear::<D>,
                limit: MAX_SHEAR,
                describe: |value| format!("been sheared by {value:.2}"),
            }),
            DomainUpdate::Corners | DomainUpdate::DiagonalCorrected | DomainUpdate::DiagonalIncremental => {
                None
            }
        }
    }

    fn to_rotation<const D: usize>() -> Objection {
        Objection {
            measure: |F| if diagonal_misses_volume::<D>(F) { rotation::<D>(F) } else { 0.0 },
            limit: MAX_ROTATION,
            describe: |value| format!("turned by {value:.1}°"),
        }
    }

    /// Value of the measure for a deformation gradient.
    pub fn measure(&self, F: &Mat3) -> f64 {
        (self.measure)(F)
    }
}

/// True if the lengths along the axes change differently. False in simple shear, which the update with det F can follow
/// although the principal stretches differ.
fn axes_differ<const D: usize>(F: &Mat3) -> bool {
    let lengths = || (0..D).map(|d| F[(d, d)].abs());
    lengths().fold(0.0, f64::max) > MAX_STRETCH_RATIO * lengths().fold(f64::INFINITY, f64::min)
}

/// True if the product of the F_ii differs from det F. False in simple shear, which the update with F_ii can follow
/// although the polar decomposition contains a rotation.
pub fn diagonal_misses_volume<const D: usize>(F: &Mat3) -> bool {
    let product: f64 = (0..D).map(|d| F[(d, d)]).product();
    (product / ratio_of_volume::<D>(F) - 1.0).abs() > MAX_VOLUME_CHANGE
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Unit, Vector3};

    const ALL: [DomainUpdate; 7] = {
        use DomainUpdate::*;
        [None, Determinant, Diagonal, Stretch, Corners, DiagonalCorrected, DiagonalIncremental]
    };

    fn plane(xx: f64, xy: f64, yx: f64, yy: f64) -> Mat3 {
        Mat3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 1.0)
    }

    fn rotated(degrees: f64) -> Mat3 {
        turned([0.0, 0.0, 1.0], degrees)
    }

    fn turned(axis: [f64; 3], degrees: f64) -> Mat3 {
        *Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::from(axis)), degrees.to_radians()).matrix()
    }

    /// The motion F with the axes permuted.
    fn permuted(F: &Mat3, shift: usize) -> Mat3 {
        Mat3::from_fn(|i, j| F[((i + shift) % 3, (j + shift) % 3)])
    }

    fn objects<const D: usize>(update: DomainUpdate, F: &Mat3) -> bool {
        Objection::to::<D>(update).is_some_and(|objection| objection.measure(F) > objection.limit)
    }

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }

    /// In axisymmetry, the hoop stretch changes the volume of a point but not its domain.
    #[test]
    fn domains_in_the_plane_ignore_the_hoop_stretch() {
        let F = Mat3::from_diagonal(&Vector3::new(1.0, 1.0, 1.2));
        assert!(ALL.iter().all(|update| !objects::<2>(*update, &F)));
        assert!(objects::<3>(DomainUpdate::None, &F));
    }

    #[test]
    fn measures_of_the_motion() {
        let stretch = plane(1.5, 0.0, 0.0, 0.5);
        for angle in [-170.0, -20.0, 0.0, 35.0, 120.0] {
            let F = rotated(angle) * stretch;
            near(rotation::<2>(&F), f64::abs(angle));
            near(rotation_of_turn(turn::<2>(&F)), angle.abs());
            near(shear::<2>(&F), 0.0);
            near(stretch_ratio::<2>(&F), 3.0);
            near(shear::<2>(&(rotated(angle) * plane(1.0, 0.7, 0.0, 1.0))), 0.7);
        }
        near(rotation::<2>(&plane(1.0, 0.8, 0.0, 1.0)), f64::atan(0.4).to_degrees());
        near(stretch_ratio::<2>(&plane(1.0, 1.5, 0.0, 1.0)), 4.0);
    }

    #[test]
    fn measures_in_space_do_not_depend_on_the_axis() {
        for axis in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 2.0, -3.0]] {
            for angle in [0.0, 1e-6, 20.0, 120.0, 179.0] {
                let R = turned(axis, angle);
                for U in [
                    Mat3::identity(),
                    Mat3::from_diagonal(&Vector3::new(1.5, 0.5, 4.0)),
                    Mat3::from_diagonal(&Vector3::new(1e-3, 1.0, 1e3)),
                    Mat3::new(1.2, 0.3, 0.1, 0.3, 0.8, -0.2, 0.1, -0.2, 1.5),
                ] {
                    near(rotation::<3>(&(R * U)), angle);
                    near(rotation_of_turn(turn::<3>(&(R * U))), angle);
                }
                for shift in 0..3 {
                    near(shear::<3>(&(R * permuted(&plane(1.0, -0.7, 0.0, 1.0), shift))), 0.7);
                    let F = R * permuted(&Mat3::from_diagonal(&Vector3::new(1.5, 0.5, 2.0)), shift);
                    near(shear::<3>(&F), 0.0);
                    near(stretch_ratio::<3>(&F), 4.0);
                }
            }
        }
    }

    /// Plane strain in space is measured as in the plane, whichever axis is the third.
    #[test]
    fn plane_motions_in_space_are_measured_as_in_the_plane() {
        for F in [
            plane(1.3, 0.4, -0.2, 0.9),
            plane(0.2, 0.9, -1.1, 0.3),
            rotated(160.0) * plane(1.0, 0.3, 0.0, 1.0),
        ] {
            for shift in 0..3 {
                let in_space = permuted(&F, shift);
                near(shear::<3>(&in_space), shear::<2>(&F));
                near(rotation::<3>(&in_space), rotation::<2>(&F));
                near(turn::<3>(&in_space), turn::<2>(&F));
            }
        }
    }

    #[test]
    fn objections_are_those_of_table_2() {
        use DomainUpdate::*;
        // Simple stretch, hydrostatic compression, simple shear, pure rotation.
        let motions: [(Mat3, &[DomainUpdate]); 4] = [
            (plane(0.7, 0.0, 0.0, 1.0), &[None, Determinant]),
            (plane(0.7, 0.0, 0.0, 0.7), &[None]),
            (plane(1.0, 2.0, 0.0, 1.0), &[Stretch]),
            (rotated(40.0), &[Diagonal]),
        ];
        for (F, unsuitable) in motions {
            for update in ALL {
                assert_eq!(objects::<2>(update, &F), unsuitable.contains(&update), "{update:?} {F}");
            }
        }
    }

    #[test]
    fn objections_in_space_hold_for_every_axis() {
        use DomainUpdate::*;
        let squeeze = Mat3::identity() * 0.7;
        let motions: [(Mat3, &[DomainUpdate]); 4] = [
            (plane(0.7, 0.0, 0.0, 1.0), &[None, Determinant]),
            (squeeze, &[None]),
            (plane(1.0, 2.0, 0.0, 1.0), &[Stretch]),
            (rotated(40.0), &[Diagonal, DiagonalCorrected]),
        ];
        for (F, unsuitable) in motions {
            for update in ALL {
                for shift in 0..3 {
                    let F = permuted(&F, shift);
                    assert_eq!(objects::<3>(update, &F), unsuitable.contains(&update), "{update:?} {F}");
                }
            }
        }
    }

    #[test]
    fn small_motions_pass() {
        for (update, below, above) in [
            (DomainUpdate::None, plane(1.049, 0.0, 0.0, 1.0), plane(1.051, 0.0, 0.0, 1.0)),
            (DomainUpdate::Determinant, plane(1.19, 0.0, 0.0, 1.0), plane(1.21, 0.0, 0.0, 1.0)),
            (DomainUpdate::Diagonal, rotated(14.9), rotated(-15.1)),
            (DomainUpdate::Stretch, plane(1.0, 0.29, 0.0, 1.0), plane(1.0, -0.31, 0.0, 1.0)),
        ] {
            assert!(!objects::<2>(update, &below) && objects::<2>(update, &above), "{update:?}");
            assert!(!objects::<3>(update, &below) && objects::<3>(update, &above), "{update:?}");
        }
    }
}
