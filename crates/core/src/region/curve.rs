//! Closed curves in the plane, and the polygons that stand for them.

use std::f64::consts::TAU;

use super::boundary::sine_and_cosine_of_part;

/// Fewest chords of a circle.
const FEWEST_CHORDS: usize = 12;
/// Number of places on a circle at which the wanted length of its chords is looked up.
const LOOKED_UP: usize = 256;

/// A closed curve in the plane.
#[derive(Debug, Clone, PartialEq)]
pub enum Curve {
    /// A polygon with these corners in order, [length].
    Polygon(Vec<[f64; 2]>),
    /// A circle.
    Circle {
        /// Centre, [length].
        center: [f64; 2],
        /// Radius, [length].
        radius: f64,
    },
}

impl Curve {
    /// The corners of the polygon that stands for the curve. A circle becomes a polygon of its area, with chords about
    /// as long as `chord` says at their positions.
    pub(super) fn polygon(self, chord: &dyn Fn(&[f64; 2]) -> f64) -> Vec<[f64; 2]> {
        let (center, radius) = match self {
            Curve::Polygon(corners) => return corners,
            Curve::Circle { center, radius } => (center, radius),
        };
        let at = |[s, c]: [f64; 2], radius: f64| [center[0] + radius * c, center[1] + radius * s];
        let step = TAU * radius / LOOKED_UP as f64;
        let place = |k: usize| at(sine_and_cosine_of_part(2 * k + 1, 2 * LOOKED_UP), radius);
        // The number of chords up to each of these places.
        let mut sums = vec![0.0];
        for k in 0..LOOKED_UP {
            sums.push(sums[k] + step / chord(&place(k)));
        }
        // A multiple of 4, so that halves and quarters consist of whole chords.
        let n = (4 * (0.25 * sums[LOOKED_UP]).round() as usize).max(FEWEST_CHORDS);
        let even = sums[LOOKED_UP] / LOOKED_UP as f64;
        if sums.windows(2).all(|pair| (pair[1] - pair[0] - even).abs() <= 1e-9 * even) {
            let part = TAU / n as f64;
            let scaled = radius * (part / part.sin()).sqrt();
            return (0..n).map(|k| at(sine_and_cosine_of_part(k, n), scaled)).collect();
        }
        let angles: Vec<f64> = (0..n).map(|k| fraction(&sums, k as f64 / n as f64) * TAU).collect();
        let next = |k: usize| if k + 1 < n { angles[k + 1] } else { TAU };
        let twice: f64 = (0..n).map(|k| (next(k) - angles[k]).sin()).sum();
        let scaled = radius * (TAU / twice).sqrt();
        angles.iter().map(|angle| at(angle.sin_cos().into(), scaled)).collect()
    }
}

/// The place, from 0 to 1, up to which ascending sums reach a part of their last value.
fn fraction(sums: &[f64], part: f64) -> f64 {
    let wanted = part * sums[LOOKED_UP];
    let k = (sums.partition_point(|sum| *sum <= wanted).max(1) - 1).min(LOOKED_UP - 1);
    (k as f64 + (wanted - sums[k]) / (sums[k + 1] - sums[k])) / LOOKED_UP as f64
}
