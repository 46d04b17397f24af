//! Points near a place of the original configuration.

use super::Points;

impl<const D: usize> Points<D> {
    /// The `count` points of a body nearest to a place in the original configuration, as permanent numbers, nearest
    /// first; and whether the choice was clear, i.e. the next one is farther away.
    pub fn nearest(&self, body: u16, place: &[f64; D], count: usize) -> (Vec<u32>, bool) {
        let distance = |p: usize| -> f64 {
            (0..D).map(|d| (self.original_position[p][d] - place[d]).powi(2)).sum::<f64>().sqrt()
        };
        let mut found: Vec<(f64, u32)> =
            (0..self.len()).filter(|&p| self.body[p] == body).map(|p| (distance(p), self.id[p])).collect();
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count + 1 < found.len() {
            found.select_nth_unstable_by(count, order);
            found.truncate(count + 1);
        }
        found.sort_unstable_by(order);
        let clear = match (found.get(count.wrapping_sub(1)), found.get(count)) {
            // The round-off of distances from distant places is that of their coordinates.
            (Some(last), Some(next)) => {
                let far = place.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
                next.0 - last.0 > 1e-9 * next.0 + 1e-12 * far
            }
            _ => true,
        };
        (found.iter().take(count).map(|f| f.1).collect(), clear)
    }

    /// Permanent numbers of the points of a body nearest to a place in the original configuration, by distance: the
    /// first `count`, and all that are farther than the last of these by at most `slack` [length] or the round-off of
    /// coordinates.
    pub fn nearest_with_ties(&self, body: u16, place: &[f64; D], count: usize, slack: f64) -> Vec<u32> {
        let distance = |p: usize| -> f64 {
            (0..D).map(|d| (self.original_position[p][d] - place[d]).powi(2)).sum::<f64>().sqrt()
        };
        let of_body = || (0..self.len()).filter(|&p| self.body[p] == body);
        let mut least: Vec<f64> = of_body().map(distance).collect();
        let Some(last) = least.len().checked_sub(1).map(|most| most.min(count.max(1) - 1)) else {
            return Vec::new();
        };
        let (_, last, _) = least.select_nth_unstable_by(last, f64::total_cmp);
        let far = place.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
        let most = *last + slack + 1e-12 * far;
        let near = of_body().filter(|&p| distance(p) <= most);
        let mut found: Vec<(f64, u32)> = near.map(|p| (distance(p), self.id[p])).collect();
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().map(|(_, id)| id).collect()
    }
}
