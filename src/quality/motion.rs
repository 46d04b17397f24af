//! The motion of a point in the plane of the first two axes, and what Table 2 holds against a domain update in it.
#![allow(non_snake_case)]

use crate::domain::DomainUpdate;
use crate::tensor::Mat3;

/// Rotation of the polar decomposition F = R U, counterclockwise, [degrees].
pub fn rotation(F: &Mat3) -> f64 {
    (F[(1, 0)] - F[(0, 1)]).atan2(F[(0, 0)] + F[(1, 1)]).to_degrees()
}

/// A number from 0 to 2 that grows with the magnitude of the rotation and costs less.
#[inline]
pub fn turn(F: &Mat3) -> f64 {
    let (c, s) = (F[(0, 0)] + F[(1, 1)], (F[(1, 0)] - F[(0, 1)]).abs());
    let part = s / (c.abs() + s);
    if c >= 0.0 { part } else { 2.0 - part }
}

/// The rotation of a [`turn`], [degrees].
pub fn rotation_of_turn(turn: f64) -> f64 {
    let (s, c) = if turn <= 1.0 { (turn, 1.0 - turn) } else { (2.0 - turn, 1.0 - turn) };
    s.atan2(c).to_degrees()
}

/// Tangent of the angle by which the axes of the original configuration have left the right angle: γ in simple shear,
/// zero in stretch along the axes, and the same whatever rotation comes on top, [-].
#[inline]
pub fn shear(F: &Mat3) -> f64 {
    let [_, C_xy, _] = right_cauchy_green(F);
    C_xy.abs() / area_ratio(F).abs()
}

/// Ratio of the larger to the smaller principal stretch, [-].
pub fn stretch_ratio(F: &Mat3) -> f64 {
    let [C_xx, C_xy, C_yy] = right_cauchy_green(F);
    let (mean, radius) = (0.5 * (C_xx + C_yy), (0.5 * (C_xx - C_yy)).hypot(C_xy));
    let largest = mean + radius;
    // The product of both is (det F)².
    largest / area_ratio(F).abs()
}

/// C = Fᵀ F: xx, xy, yy.
fn right_cauchy_green(F: &Mat3) -> [f64; 3] {
    let product = |i: usize, j: usize| F[(0, i)] * F[(0, j)] + F[(1, i)] * F[(1, j)];
    [product(0, 0), product(0, 1), product(1, 1)]
}

/// Determinant of F in the plane.
fn area_ratio(F: &Mat3) -> f64 {
    F[(0, 0)] * F[(1, 1)] - F[(0, 1)] * F[(1, 0)]
}

/// Rotation beyond which the update with F_ii is objected to, [degrees].
const MOST_ROTATION: f64 = 15.0;
/// The same for the update with U_ii and shear, [-].
const MOST_SHEAR: f64 = 0.3;
/// The same for no update and the change of det F, [-].
const MOST_VOLUME_CHANGE: f64 = 0.05;
/// The same for the update with det F and the ratio of principal stretches, [-].
const MOST_STRETCH_RATIO: f64 = 1.2;

/// What Table 2 holds against a domain update: the measure of the motion that it does not stand, and how much of it.
#[derive(Debug, Clone, Copy)]
pub struct Objection {
    measure: fn(&Mat3) -> f64,
    /// Largest measure that passes.
    pub limit: f64,
    /// The measure as text.
    pub describe: fn(f64) -> String,
}

impl Objection {
    /// The objection to an update, if there is any.
    pub fn to(update: DomainUpdate) -> Option<Objection> {
        match update {
            DomainUpdate::None => Some(Objection {
                measure: |F| (F.determinant() - 1.0).abs(),
                limit: MOST_VOLUME_CHANGE,
                describe: |value| format!("changed its volume by {:.1} %", 100.0 * value),
            }),
            DomainUpdate::Determinant => Some(Objection {
                measure: |F| if axes_differ(F) { stretch_ratio(F) } else { 1.0 },
                limit: MOST_STRETCH_RATIO,
                describe: |value| format!("principal stretches in the ratio {value:.2}"),
            }),
            DomainUpdate::Diagonal => Some(Objection {
                measure: |F| if diagonal_misses_volume(F) { rotation(F).abs() } else { 0.0 },
                limit: MOST_ROTATION,
                describe: |value| format!("turned by {value:.1}°"),
            }),
            DomainUpdate::Stretch => Some(Objection {
                measure: shear,
                limit: MOST_SHEAR,
                describe: |value| format!("been sheared by {value:.2}"),
            }),
            DomainUpdate::Corners | DomainUpdate::DiagonalCorrected | DomainUpdate::DiagonalIncremental => {
                None
            }
        }
    }

    /// How much of the unsuitable motion a deformation gradient holds.
    pub fn measure(&self, F: &Mat3) -> f64 {
        (self.measure)(F)
    }
}

/// Whether the lengths along the axes change differently. They do not in simple shear, which the update with det F
/// stands, though its principal stretches differ.
fn axes_differ(F: &Mat3) -> bool {
    let (x, y) = (F[(0, 0)].abs(), F[(1, 1)].abs());
    x.max(y) > MOST_STRETCH_RATIO * x.min(y)
}

/// Whether the product of the F_ii is off det F. It is not in simple shear, which the update with F_ii stands, though
/// its polar decomposition holds a rotation.
fn diagonal_misses_volume(F: &Mat3) -> bool {
    (F[(0, 0)] * F[(1, 1)] / area_ratio(F) - 1.0).abs() > MOST_VOLUME_CHANGE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(xx: f64, xy: f64, yx: f64, yy: f64) -> Mat3 {
        Mat3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 1.0)
    }

    fn rotated(degrees: f64) -> Mat3 {
        let (s, c) = degrees.to_radians().sin_cos();
        plane(c, -s, s, c)
    }

    fn objects(update: DomainUpdate, F: Mat3) -> bool {
        Objection::to(update).is_some_and(|objection| objection.measure(&F) > objection.limit)
    }

    #[test]
    fn measures_of_the_motion() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        let stretch = plane(1.5, 0.0, 0.0, 0.5);
        for angle in [-170.0, -20.0, 0.0, 35.0, 120.0] {
            near(rotation(&(rotated(angle) * stretch)), angle);
            near(rotation_of_turn(turn(&(rotated(angle) * stretch))), angle.abs());
            near(shear(&(rotated(angle) * stretch)), 0.0);
            near(stretch_ratio(&(rotated(angle) * stretch)), 3.0);
            near(shear(&(rotated(angle) * plane(1.0, 0.7, 0.0, 1.0))), 0.7);
        }
        near(rotation(&plane(1.0, 0.8, 0.0, 1.0)), -f64::atan(0.4).to_degrees());
        near(stretch_ratio(&plane(1.0, 1.5, 0.0, 1.0)), 4.0);
    }

    #[test]
    fn objections_are_those_of_table_2() {
        use DomainUpdate::*;
        let all = [None, Determinant, Diagonal, Stretch, Corners, DiagonalCorrected, DiagonalIncremental];
        // Simple stretch, hydrostatic compression, simple shear, pure rotation.
        let motions: [(Mat3, &[DomainUpdate]); 4] = [
            (plane(0.7, 0.0, 0.0, 1.0), &[None, Determinant]),
            (plane(0.7, 0.0, 0.0, 0.7), &[None]),
            (plane(1.0, 2.0, 0.0, 1.0), &[Stretch]),
            (rotated(40.0), &[Diagonal]),
        ];
        for (F, unsuitable) in motions {
            for update in all {
                assert_eq!(objects(update, F), unsuitable.contains(&update), "{update:?} {F}");
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
            assert!(!objects(update, below) && objects(update, above), "{update:?}");
        }
    }
}
