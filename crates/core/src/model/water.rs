//! Water at rest in the ground and above it.

use super::{Action, Model};
use crate::material::{EXCESS_PORE_PRESSURE, StateField};
use crate::points::{FieldError, FieldKind, PointFieldSpec, Points};

/// Name of the further field of the points that holds the pore pressure, [stress].
pub const PORE_PRESSURE: &str = "pore_pressure";

/// The level of the water: its height along the last axis, as a function of the first coordinate.
#[derive(Debug, Clone, PartialEq)]
pub struct WaterLevel(Vec<[f64; 2]>);

impl WaterLevel {
    /// A level with the same height everywhere, [length].
    pub fn even(height: f64) -> WaterLevel {
        WaterLevel(vec![[0.0, height]])
    }

    /// A polyline through points, each a first coordinate and a height, [length], with first coordinates that increase;
    /// constant before the first point and after the last.
    pub fn line(points: Vec<[f64; 2]>) -> WaterLevel {
        WaterLevel(points)
    }

    /// Height, [length], and slope, [-], at a first coordinate. At a point of the line, the slope is that behind it.
    pub fn height(&self, x: f64) -> (f64, f64) {
        let after = self.0.partition_point(|point| point[0] <= x);
        match (after.checked_sub(1).and_then(|k| self.0.get(k)), self.0.get(after)) {
            (Some([x0, h0]), Some([x1, h1])) => {
                let slope = (h1 - h0) / (x1 - x0);
                (h0 + slope * (x - x0), slope)
            }
            (Some(last), None) => (last[1], 0.0),
            (None, Some(first)) => (first[1], 0.0),
            (None, None) => (f64::NEG_INFINITY, 0.0),
        }
    }
}

/// Water at rest, or nearly so: its pressure grows with the depth below a level.
///
/// The level states the pore pressure, the weight of the pore water and the pressure of open water on the surfaces of
/// the bodies at once. With the pressure u = γ_w ⟨h − z⟩ of a level h, the internal force of the pore pressure and the
/// pressure on the surfaces together are −∫ N ∇u dv, and the weight of the pore water is a further force per volume.
/// Both follow from the level at the points alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Water {
    /// Weight of the water per volume, γ_w, at the load factor 1 of gravity, [force/volume].
    pub unit_weight: f64,
    /// The level at some times, ascending; it changes linearly between them.
    pub levels: Vec<(f64, WaterLevel)>,
    /// For each material, the share 1 − n₀ of the grains in its original volume, [-]; 1 where water surrounds a body but
    /// does not enter it.
    pub grains: Vec<f64>,
}

impl Water {
    /// Height, [length], and slope, [-], of the level at a first coordinate and a time.
    pub fn height(&self, x: f64, time: f64) -> (f64, f64) {
        let after = self.levels.partition_point(|(at, _)| *at <= time);
        match (after.checked_sub(1).and_then(|k| self.levels.get(k)), self.levels.get(after)) {
            (Some((t0, before)), Some((t1, next))) => {
                let share = (time - t0) / (t1 - t0);
                let ((h0, s0), (h1, s1)) = (before.height(x), next.height(x));
                if (h0, s0) == (h1, s1) {
                    return (h0, s0);
                }
                (h0 + share * (h1 - h0), s0 + share * (s1 - s0))
            }
            (Some((_, level)), None) | (None, Some((_, level))) => level.height(x),
            (None, None) => (f64::NEG_INFINITY, 0.0),
        }
    }

    /// Share of the volume of the grains, [-].
    pub fn grains(&self, material: usize) -> f64 {
        self.grains.get(material).copied().unwrap_or(1.0)
    }
}

/// A part of a domain below the level: its size, and its moment about the centre of the domain, per length of the
/// vertical extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WetPart {
    /// Coordinate of the level above the centre of the domain, within the half height l, [length].
    pub top: f64,
    /// Length of the wet part, [length].
    pub length: f64,
    /// First moment of the wet part about the centre, [length²].
    pub moment: f64,
}

impl WetPart {
    /// The part of a domain of half height `half` below a level `depth` above its centre, [length].
    pub fn new(depth: f64, half: f64) -> WetPart {
        let top = depth.clamp(-half, half);
        WetPart { top, length: top + half, moment: 0.5 * (top - half) * (top + half) }
    }
}

impl<const D: usize> Model<D> {
    /// Half the vertical extent of the domain of a point in its converged state, [length]; for a point without a domain
    /// or a box, that of a square or cube of its volume.
    pub fn half_height(&self, points: &Points<D>, p: usize) -> f64 {
        let corners = points.corners(p);
        if !corners.is_empty() {
            let ends = corners.iter().map(|corner| corner[D - 1]);
            let [low, high] =
                ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
            return 0.5 * (high - low);
        }
        match points.half_lengths(p)[D - 1] {
            0.0 => {
                let area = self.volume(points, p) / self.depth(&points.converged.position[p]);
                0.5 * area.powf(1.0 / D as f64)
            }
            half => half,
        }
    }

    /// Factor of the weight of the water at the points of a body, [-]: that of the first gravity that acts on the body, 1
    /// without gravity. Where the load factor of a stage follows from equilibrium, gravity and water keep theirs.
    pub fn water_factor(&self, body: usize, time: f64) -> f64 {
        let is_gravity = |action: &Action<D>| matches!(action, Action::Gravity(_));
        let gravity = self.loads.iter().find(|load| is_gravity(&load.action) && load.acts_on[body]);
        gravity.map_or(1.0, |load| {
            if self.stepping.control.has_unknown_factor() {
                load.factors_of_stage(&self.stepping).0
            } else {
                load.curve.factor(time)
            }
        })
    }

    /// Pressure of the water at a position in a body at a time, without the excess pressure of water that cannot leave,
    /// [stress]; 0 where no water enters the material.
    pub fn water_pressure(&self, body: usize, position: &[f64; D], time: f64) -> f64 {
        let Some(water) = &self.water else { return 0.0 };
        if water.grains(self.bodies[body].material) >= 1.0 {
            return 0.0;
        }
        let (height, _) = water.height(position[0], time);
        self.water_factor(body, time) * water.unit_weight * (height - position[D - 1]).max(0.0)
    }

    /// True if a law has pore water that cannot leave.
    pub fn has_pore_water(&self) -> bool {
        let is_of_water = |field: &StateField| field.name == EXCESS_PORE_PRESSURE;
        self.materials.iter().any(|material| material.law.state_fields().iter().any(is_of_water))
    }

    /// Declares the pore pressure as a field of the points, with its values at time 0.
    ///
    /// # Errors
    /// [`FieldError`] if the points already have a field of this name.
    pub fn declare_pore_pressure(&self, points: &mut Points<D>) -> Result<(), FieldError> {
        let start = points
            .by_id()
            .into_iter()
            .map(|p| self.water_pressure(usize::from(points.body[p]), &points.converged.position[p], 0.0))
            .collect();
        let spec = PointFieldSpec {
            name: PORE_PRESSURE.to_owned(),
            unit: "stress".to_owned(),
            components: 1,
            kind: FieldKind::Motion,
            start,
        };
        points.declare(spec).map(|_| ())
    }

    /// Pore pressure of a point in its converged state, with its excess, [stress]; 0 without water.
    pub fn pore_pressure(&self, points: &Points<D>, p: usize) -> f64 {
        match points.further.handle(PORE_PRESSURE) {
            Some(handle) => points.further.converged(handle)[p],
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_interpolated_in_space_and_time() {
        let line = WaterLevel::line(vec![[0.0, 4.0], [10.0, 2.0], [12.0, 2.0]]);
        for (x, expected) in [(-1.0, (4.0, 0.0)), (5.0, (3.0, -0.2)), (11.0, (2.0, 0.0)), (20.0, (2.0, 0.0))]
        {
            assert_eq!(line.height(x), expected);
        }
        let levels = vec![(0.0, WaterLevel::even(6.0)), (2.0, line)];
        let water = Water { unit_weight: 1.0, levels, grains: vec![0.6] };
        assert_eq!(water.height(5.0, -1.0), (6.0, 0.0));
        assert_eq!(water.height(5.0, 1.0), (4.5, -0.1));
        assert_eq!(water.height(5.0, 3.0), (3.0, -0.2));
        assert_eq!((water.grains(0), water.grains(1)), (0.6, 1.0));
    }

    #[test]
    fn the_wet_part_of_a_domain_has_a_moment() {
        assert_eq!(WetPart::new(-3.0, 0.5), WetPart { top: -0.5, length: 0.0, moment: 0.0 });
        assert_eq!(WetPart::new(3.0, 0.5), WetPart { top: 0.5, length: 1.0, moment: 0.0 });
        assert_eq!(WetPart::new(0.0, 0.5), WetPart { top: 0.0, length: 0.5, moment: -0.125 });
    }
}
