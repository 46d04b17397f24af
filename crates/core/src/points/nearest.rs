//! Points near a position in the original configuration.

use serde::{Deserialize, Serialize};

use super::Points;

/// A point near a position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Near {
    /// Permanent number of the point.
    pub id: u32,
    /// Distance of the point from the position, [length].
    pub distance: f64,
    /// Original position of the point, [length].
    pub position: Vec<f64>,
}

impl<const D: usize> Points<D> {
    /// The `count` points of a body nearest to a position in the original configuration, nearest first, and true if the
    /// choice is unique, i.e. the next point is farther away. All ranks must call this together.
    pub fn nearest(&self, body: u16, place: &[f64; D], count: usize) -> (Vec<Near>, bool) {
        let mut found = self.within(body, place, count.saturating_add(1), 0.0);
        found.truncate(count.saturating_add(1));
        let clear = match (found.get(count.wrapping_sub(1)), found.get(count)) {
            // Far from the origin, the round-off of the coordinates dominates the round-off of the distance.
            (Some(last), Some(next)) => {
                next.distance - last.distance > 1e-9 * next.distance + round_off(place)
            }
            _ => true,
        };
        found.truncate(count);
        (found, clear)
    }

    /// The points of a body nearest to a position in the original configuration, nearest first: `count` points, and all
    /// points that are farther away than the last of these by at most `slack`, [length], plus round-off. All ranks must
    /// call this together.
    pub fn nearest_with_ties(&self, body: u16, place: &[f64; D], count: usize, slack: f64) -> Vec<Near> {
        self.within(body, place, count, slack + round_off(place))
    }

    /// The nearest `count` points, at least one, and all points at most `slack` farther away than the last of these; in
    /// the order of distance and permanent number.
    fn within(&self, body: u16, place: &[f64; D], count: usize, slack: f64) -> Vec<Near> {
        let distance = |p: usize| -> f64 {
            (0..D).map(|d| (self.original_position[p][d] - place[d]).powi(2)).sum::<f64>().sqrt()
        };
        let in_body = || (0..self.len()).filter(|&p| self.body[p] == body);
        let most = count.max(1) - 1;
        // A rank that holds fewer than `count` points sets no limit.
        let mut least: Vec<f64> = in_body().map(distance).collect();
        let limit = match least.len() {
            n if n > most => *least.select_nth_unstable_by(most, f64::total_cmp).1,
            _ => f64::INFINITY,
        };
        let limit = self.reduction().smallest(limit);
        let near = in_body().filter(|&p| distance(p) <= limit + slack);
        let near = near.map(|p| Near {
            id: self.id[p],
            distance: distance(p),
            position: self.original_position[p].to_vec(),
        });
        let mut found: Vec<Near> = self.reduction().join(near.collect());
        found.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.id.cmp(&b.id)));
        if let Some(last) = found.get(most).map(|last| last.distance) {
            found.retain(|near| near.distance <= last + slack);
        }
        found
    }
}

/// Round-off of a distance from this position, [length].
fn round_off<const D: usize>(place: &[f64; D]) -> f64 {
    1e-12 * place.iter().fold(0.0, |far: f64, x| far.max(x.abs()))
}
