//! The patches of a surface on which a condition holds in the mean, and the functions with which it is weighted there.

use std::collections::BTreeMap;

use crate::model::Model;
use crate::surface::{Carried, Surface};

/// Width of a patch in cells, [-].
const WIDTH: f64 = 3.0;
/// Distance from the boundary between two patches within which a sample counts as lying on it, relative to the width of
/// a patch, [-].
const ON_BOUNDARY: f64 = 1e-9;
/// A function is omitted if its part orthogonal to the earlier functions is smaller than this fraction of the largest
/// possible part, [-].
const INDEPENDENT: f64 = 1e-3;

/// A patch of a surface: its samples, and the functions q_k A at each of them, `[k][sample]`.
pub(super) struct Patch<const D: usize> {
    pub samples: Vec<u32>,
    pub functions: Vec<Vec<f64>>,
    /// Original area, [length²].
    pub area: f64,
    /// The functions q_k.
    linear: Vec<Linear<D>>,
}

impl<const D: usize> Patch<D> {
    /// True if this rank evaluates the patch.
    pub(super) fn is_own(&self, carried: &Carried<D>) -> bool {
        self.samples.first().is_none_or(|sample| carried.is_own(*sample as usize))
    }
}

/// A linear function of the original position.
struct Linear<const D: usize> {
    /// The position at which the function equals `constant`, [length].
    origin: [f64; D],
    constant: f64,
    slope: [f64; D],
}

impl<const D: usize> Linear<D> {
    /// This function plus `factor` times another with the same origin.
    fn add(&mut self, factor: f64, other: &Self) {
        self.constant += factor * other.constant;
        (0..D).for_each(|d| self.slope[d] += factor * other.slope[d]);
    }

    /// This function divided by a number.
    fn over(self, divisor: f64) -> Self {
        let Linear { origin, constant, slope } = self;
        Linear { origin, constant: constant / divisor, slope: slope.map(|slope| slope / divisor) }
    }

    /// The value at an original position.
    fn at(&self, x: &[f64; D]) -> f64 {
        self.constant + (0..D).map(|d| self.slope[d] * (x[d] - self.origin[d])).sum::<f64>()
    }
}

/// The patches of a surface: its samples, grouped by sides of the shape and by boxes that divide each side, measured in
/// cells, into equal parts of about [`WIDTH`] cells.
pub(super) fn patches<const D: usize>(model: &Model<D>, surface: &Surface<D>) -> Vec<Patch<D>> {
    let mut by_place: BTreeMap<(usize, [i64; D]), Vec<u32>> = BTreeMap::new();
    let mut ends: BTreeMap<usize, [[f64; D]; 2]> = BTreeMap::new();
    let corners = |sample: usize| surface.facets[sample].map(|corner| surface.in_cells[corner as usize]);
    for (sample, &side) in surface.sides.iter().enumerate() {
        let [low, high] = ends.entry(side).or_insert([[f64::INFINITY; D], [f64::NEG_INFINITY; D]]);
        for corner in corners(sample) {
            for d in 0..D {
                (low[d], high[d]) = (low[d].min(corner[d]), high[d].max(corner[d]));
            }
        }
    }
    for (sample, side) in surface.sides.iter().enumerate() {
        let [low, high] = ends[side];
        let key = std::array::from_fn(|d| {
            let length = high[d] - low[d];
            let n = (length / WIDTH).round().max(1.0);
            let middle = corners(sample).iter().map(|corner| corner[d]).sum::<f64>() / D as f64;
            // A sample at the boundary between two patches belongs to the upper one, whatever its round-off.
            let place = (middle - low[d]) / length * n + ON_BOUNDARY;
            if length > 0.0 { place.floor().min(n - 1.0) as i64 } else { 0 }
        });
        by_place.entry((*side, key)).or_default().push(sample as u32);
    }
    let patch = |samples: Vec<u32>| {
        let areas: Vec<f64> =
            samples.iter().map(|&sample| model.original_area(surface, sample as usize)).collect();
        let (functions, linear) = orthonormal(surface, &samples, &areas);
        let area = areas.iter().sum();
        Patch { samples, functions, area, linear }
    };
    by_place.into_values().map(patch).collect()
}

/// Gives patches of the surface at the start the samples that the surface has now: those that divisions have formed from
/// a sample belong to its patch.
pub(super) fn divide_patches<const D: usize>(
    patches: &mut [Patch<D>],
    model: &Model<D>,
    carried: &Carried<D>,
) {
    let surface = carried.surface();
    let mut patch_of = vec![0; carried.len()];
    let mut n = 0;
    for (number, patch) in patches.iter().enumerate() {
        patch.samples.iter().for_each(|sample| patch_of[*sample as usize] = number);
        n += patch.samples.len();
    }
    for sample in n..carried.len() {
        patches[patch_of[carried.origin(sample).0]].samples.push(sample as u32);
    }
    for patch in patches {
        for (values, function) in patch.functions.iter_mut().zip(&patch.linear) {
            values.resize(patch.samples.len(), 0.0);
            for (value, &sample) in values.iter_mut().zip(&patch.samples) {
                let sample = sample as usize;
                if carried.origin(sample).1 < 1.0 {
                    *value = function.at(&surface.samples[sample]) * model.original_area(surface, sample);
                }
            }
        }
    }
}

/// The functions 1, x, y(, z) on a patch, orthonormalised in this order with respect to area and then multiplied by the
/// areas of the samples; functions that depend on earlier ones are omitted. Also returns the functions themselves.
fn orthonormal<const D: usize>(
    surface: &Surface<D>,
    samples: &[u32],
    areas: &[f64],
) -> (Vec<Vec<f64>>, Vec<Linear<D>>) {
    let from_first =
        |sample: u32, d: usize| surface.samples[sample as usize][d] - surface.samples[samples[0] as usize][d];
    let extents = samples.iter().flat_map(|&sample| (0..D).map(move |d| from_first(sample, d).abs()));
    let size = extents.fold(f64::MIN_POSITIVE, f64::max);
    let total: f64 = areas.iter().sum();
    let product = |a: &[f64], b: &[f64]| -> f64 { (0..areas.len()).map(|s| areas[s] * a[s] * b[s]).sum() };
    let origin = surface.samples[samples[0] as usize];
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut found_linear: Vec<Linear<D>> = Vec::new();
    for number in 0..=D {
        let at = |&sample: &u32| match number {
            0 => 1.0,
            d => from_first(sample, d - 1) / size,
        };
        let mut function: Vec<f64> = samples.iter().map(at).collect();
        let slope = std::array::from_fn(|d| if d + 1 == number { 1.0 / size } else { 0.0 });
        let mut linear = Linear { origin, constant: if number == 0 { 1.0 } else { 0.0 }, slope };
        // Orthogonalises twice, to suppress round-off.
        let others = || found.iter().zip(&found_linear);
        for (other, other_linear) in others().chain(others()) {
            let share = product(&function, other);
            function.iter_mut().zip(other).for_each(|(f, o)| *f -= share * o);
            linear.add(-share, other_linear);
        }
        let norm = product(&function, &function).sqrt();
        if norm > INDEPENDENT * total.sqrt() {
            function.iter_mut().for_each(|f| *f /= norm);
            found.push(function);
            found_linear.push(linear.over(norm));
        }
    }
    for function in &mut found {
        function.iter_mut().zip(areas).for_each(|(f, area)| *f *= area);
    }
    (found, found_linear)
}
