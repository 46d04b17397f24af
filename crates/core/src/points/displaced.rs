//! Where a place of the original configuration is now, judged by the points around it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Points;
use crate::region::vector::{along, minus, norm};
use crate::tensor::Mat3;

/// Number of rings of bins around a place in which points are sought.
const RINGS: i64 = 8;

/// A point of a body, as ranks exchange it.
#[derive(Serialize, Deserialize)]
struct Known {
    id: u32,
    /// Original position, current position and the rows of the deformation gradient.
    numbers: Vec<f64>,
}

/// Points of a body, for finding the current positions of places near them.
#[derive(Debug, Clone)]
pub struct Displaced<const D: usize> {
    /// Original positions, current positions and deformation gradients.
    points: Vec<([f64; D], [f64; D], Mat3)>,
    /// Points by the bin that holds their original position.
    bins: BTreeMap<[i64; D], Vec<u32>>,
    /// Side of a bin, [length].
    size: f64,
}

impl<const D: usize> Displaced<D> {
    /// The points of a body in several sets whose original position satisfies `matters`; `size` is about the distance
    /// within which they are sought, such as the size of a cell, [length]. All ranks must call this together; all get
    /// the same points.
    pub fn gathered(
        sets: &[&Points<D>],
        body: usize,
        size: f64,
        matters: impl Fn(&[f64; D]) -> bool,
    ) -> Displaced<D> {
        let mut own = Vec::new();
        for points in sets {
            for p in (0..points.len()).filter(|&p| usize::from(points.body[p]) == body) {
                let original = &points.original_position[p];
                if matters(original) {
                    let gradient = &points.converged.deformation_gradient[p];
                    let rows = (0..D).flat_map(|i| (0..D).map(move |j| gradient[(i, j)]));
                    let positions = original.iter().chain(&points.converged.position[p]).copied();
                    own.push(Known { id: points.id[p], numbers: positions.chain(rows).collect() });
                }
            }
        }
        let mut all = match sets {
            [first, ..] => first.ranks.join(own),
            [] => own,
        };
        all.sort_unstable_by_key(|known| known.id);
        let mut found = Displaced { points: Vec::with_capacity(all.len()), bins: BTreeMap::new(), size };
        for (number, Known { numbers, .. }) in all.iter().enumerate() {
            let vector =
                |first: usize| std::array::from_fn(|d| numbers.get(first + d).copied().unwrap_or(0.0));
            let mut gradient = Mat3::identity();
            for (k, value) in numbers.iter().skip(2 * D).enumerate() {
                gradient[(k / D, k % D)] = *value;
            }
            let original = vector(0);
            found.bins.entry(found.bin(&original)).or_default().push(number as u32);
            found.points.push((original, vector(D), gradient));
        }
        found
    }

    fn bin(&self, x: &[f64; D]) -> [i64; D] {
        x.map(|x| (x / self.size).floor() as i64)
    }

    /// The current position of a place in the original configuration, [length]: the mean of x_p + F_p (X − X_p) over the
    /// nearest 2^D points, with weights that decrease to zero at the next point. `None` if no point is near.
    pub fn position(&self, place: &[f64; D]) -> Option<[f64; D]> {
        let mut near = self.near(place);
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let most = 1 << D;
        let reach = near.get(most).map_or(f64::INFINITY, |(distance, _)| *distance);
        near.truncate(most);
        let (mut sum, mut weights) = ([0.0; D], 0.0);
        for (distance, number) in near {
            let (original, now, gradient) = &self.points[number as usize];
            let arm = minus(place, original);
            let moved =
                std::array::from_fn(|i| now[i] + (0..D).map(|j| gradient[(i, j)] * arm[j]).sum::<f64>());
            let share = if reach.is_finite() { (distance / reach).powi(2) } else { 0.0 };
            // Points at the same distance as the next one count a little, so that the sum of the weights is positive.
            let weight = (1.0 - share).powi(2) + 1e-12;
            sum = along(&sum, weight, &moved);
            weights += weight;
        }
        (weights > 0.0).then(|| sum.map(|x| x / weights))
    }

    /// More than 2^D points near a place if there are as many, each with its distance; the nearest are among them.
    fn near(&self, place: &[f64; D]) -> Vec<(f64, u32)> {
        let centre = self.bin(place);
        let mut near = Vec::new();
        for ring in 1..=RINGS {
            near.clear();
            let side = 2 * ring + 1;
            for number in 0..side.pow(D as u32) {
                let bin: [i64; D] =
                    std::array::from_fn(|d| centre[d] + number / side.pow(d as u32) % side - ring);
                for &point in self.bins.get(&bin).into_iter().flatten() {
                    near.push((norm(&minus(&self.points[point as usize].0, place)), point));
                }
            }
            let reach = ring as f64 * self.size;
            if near.iter().filter(|(distance, _)| *distance <= reach).count() > 1 << D {
                break;
            }
        }
        near
    }
}
