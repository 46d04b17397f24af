//! Typical properties of the materials whose properties vary in space.

use super::Builder;
use crate::material::MaterialOfPoints;
use crate::region::DeckRegion;
use mpm_core::points::Seed;
use mpm_core::region::Region;
use mpm_core::tensor::padded;

/// Relative difference between the squared distances of two points from the centre of a body below which the points
/// count as equally far from the centre, [-].
const SAME: f64 = 1e-9;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Replaces the typical properties of the materials by those at a point near the centre of a body: unlike the
    /// centre itself, where a body may have a hole, every point has properties in range. `seeds` are the points of this
    /// rank, with their permanent numbers.
    pub(super) fn take_typical_points(
        &self,
        materials: &mut [MaterialOfPoints],
        seeds: &[Seed<D>],
        numbers: &[u32],
    ) {
        for material in materials.iter_mut().filter(|material| !material.stated.varying.is_empty()) {
            let Some(body) = self.body_of(&material.name) else { continue };
            let in_body = || seeds.iter().zip(numbers).filter(move |(seed, _)| seed.body as usize == body);
            let Some(place) = self.middle_of(|| in_body().map(|(seed, number)| (seed.position, *number)))
            else {
                continue;
            };
            material.law = material.stated.law(&place);
        }
    }

    /// The first body that has a material at the start or in a stage.
    fn body_of(&self, material: &str) -> Option<usize> {
        let deck = self.deck;
        let gets = |body: &str| {
            deck.stages.iter().any(|stage| stage.material.get(body).is_some_and(|m| m == material))
        };
        deck.bodies.iter().position(|body| body.material == material || gets(&body.name))
    }

    /// The position of the point closest to the centre of the box around some points of all ranks; of several equally
    /// close points, the one with the lowest number.
    fn middle_of<I: Iterator<Item = ([f64; D], u32)>>(&self, points: impl Fn() -> I) -> Option<[f64; 3]> {
        let mut ends = [f64::NEG_INFINITY; 6];
        for (x, _) in points() {
            for d in 0..D {
                ends[d] = ends[d].max(x[d]);
                ends[3 + d] = ends[3 + d].max(-x[d]);
            }
        }
        self.ranks.maximum(&mut ends);
        let distance =
            |x: &[f64; D]| (0..D).map(|d| (x[d] - 0.5 * (ends[d] - ends[3 + d])).powi(2)).sum::<f64>();
        let least = self.ranks.smallest(points().map(|(x, _)| distance(&x)).fold(f64::INFINITY, f64::min));
        let closest = points().filter(|(x, _)| distance(x) <= (1.0 + SAME) * least);
        let closest = closest.map(|(x, number)| (number, padded(&x))).min_by_key(|(number, _)| *number);
        let candidates = self.ranks.gather_all(closest).into_iter().flatten();
        candidates.min_by_key(|(number, _)| *number).map(|(_, place)| place)
    }
}
