//! Volumes of regions: closed forms if known, otherwise quadrature over lines.
//!
//! If the parts of a union, intersection or difference do not overlap, or if one contains another, the volume is a sum
//! or difference of known volumes. Otherwise the length of the region along lines parallel to the first axis, which is
//! exact, is integrated over the other coordinates by nested adaptive quadrature. The ranges are first divided at the
//! ends and corners of the primitives, so that no primitive is missed.

use std::cell::Cell;

use super::quadrature::{Estimate, VALUES_PER_PANEL, integrate};
use super::{Bounds, Line, Node, Region, extent_of, is_empty, overlap};

/// A volume and its error estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// The volume (area), [volume].
    pub value: f64,
    /// Estimated error bound, [volume]; zero for closed forms, which are exact up to round-off.
    pub error: f64,
}

/// Requested accuracy of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Relative error at which quadrature stops, [-].
    pub relative: f64,
    /// Approximate limit on the number of lines. At the limit, quadrature stops and the remaining error is reported.
    pub lines: usize,
}

impl Default for Accuracy {
    /// 10⁻⁶ and four million lines. Regions of a few primitives need fewer lines; the limit is reached in one or two
    /// seconds.
    fn default() -> Self {
        Accuracy { relative: 1e-6, lines: 4_000_000 }
    }
}

/// Smallest initial number of panels per coordinate.
const FEWEST_PANELS: usize = 4;

impl<const D: usize> Region<D> {
    /// Volume (area) of the region; `None` if groups of cells overlap other parts.
    pub fn volume(&self, accuracy: Accuracy) -> Option<Volume> {
        if is_empty(&self.bounds) {
            return Some(Volume { value: 0.0, error: 0.0 });
        }
        match &self.node {
            Node::Primitive(primitive, motion) => {
                Some(Volume { value: primitive.volume() * motion.volume_ratio(), error: 0.0 })
            }
            Node::Group(group, motion) => {
                Some(Volume { value: group.volume * motion.volume_ratio(), error: 0.0 })
            }
            Node::Union(parts) => sum(clusters(parts).into_iter().map(|cluster| {
                let needed = without_covered(cluster, Region::covers_bounds_of);
                match needed.as_slice() {
                    [one] => one.volume(accuracy),
                    _ => Region::union(cloned(&needed)).ok()?.measured(accuracy),
                }
            })),
            Node::Intersection(parts) if parts.iter().all(|part| part.covers(&self.bounds)) => {
                Some(Volume { value: content(&self.bounds), error: 0.0 })
            }
            Node::Intersection(parts) => {
                let needed = without_covered(parts.iter().collect(), |a, b| b.covers_bounds_of(a));
                match needed.as_slice() {
                    [one] => one.volume(accuracy),
                    _ => Region::intersection(cloned(&needed)).ok()?.measured(accuracy),
                }
            }
            Node::Difference(from, minus) => {
                let near: Vec<_> = minus.iter().filter(|part| meet(&part.bounds, &from.bounds)).collect();
                if near.iter().any(|part| part.covers_bounds_of(from)) {
                    return Some(Volume { value: 0.0, error: 0.0 });
                }
                if near.iter().all(|part| from.covers_bounds_of(part)) {
                    let whole = from.volume(accuracy)?;
                    let holes = match Region::union(cloned(&near)) {
                        Ok(holes) => holes.volume(accuracy)?,
                        Err(_) => Volume { value: 0.0, error: 0.0 },
                    };
                    return Some(Volume {
                        value: whole.value - holes.value,
                        error: whole.error + holes.error,
                    });
                }
                Region::difference((**from).clone(), cloned(&near)).measured(accuracy)
            }
        }
    }

    fn covers_bounds_of(&self, other: &Region<D>) -> bool {
        self.covers(&other.bounds)
    }

    /// Volume by quadrature.
    fn measured(&self, accuracy: Accuracy) -> Option<Volume> {
        // Groups of cells have no intervals on any line.
        self.intervals(&Line::along_axis(self.bounds[0], 0))?;
        let lines = Lines::new(self, accuracy.lines);
        let first = lines.integral(f64::INFINITY).value;
        let size = if first > 0.0 { first } else { content(&self.bounds) };
        let Estimate { value, error } = lines.integral(accuracy.relative * size);
        // Sums of many values have a round-off error that the quadrature rule does not detect.
        Some(Volume { value, error: error + 1e-14 * value })
    }
}

/// The integration over lines.
struct Lines<'a, const D: usize> {
    region: &'a Region<D>,
    /// Break points of each coordinate.
    breaks: Vec<Vec<f64>>,
    most: usize,
    left: Cell<usize>,
}

impl<'a, const D: usize> Lines<'a, D> {
    fn new(region: &'a Region<D>, most: usize) -> Self {
        // A quarter of the lines is reserved for the initial division. The largest number of panels is the same for
        // every coordinate except the first, which has none.
        let per_coordinate = (most as f64 / 4.0).powf(1.0 / (D.max(2) - 1) as f64);
        let most_panels = (per_coordinate as usize / VALUES_PER_PANEL).max(FEWEST_PANELS);
        let breaks = (0..D).map(|axis| breaks(region, axis, most_panels)).collect();
        Lines { region, breaks, most, left: Cell::new(most) }
    }

    /// Integral over the whole region.
    fn integral(&self, tolerance: f64) -> Estimate {
        self.left.set(self.most);
        self.slice(D - 1, &mut { self.region.bounds[0] }, tolerance)
    }

    /// Integral over the coordinates 0 to `axis`; the remaining coordinates are those of `x`.
    fn slice(&self, axis: usize, x: &mut [f64; D], tolerance: f64) -> Estimate {
        if axis == 0 {
            self.left.set(self.left.get().saturating_sub(1));
            let inside = self.region.intervals(&Line::along_axis(*x, 0)).unwrap_or_default();
            return Estimate { value: inside.length(), error: 0.0 };
        }
        let [low, high] = [0, 1].map(|side| self.region.bounds[side][axis]);
        // Half of the tolerance is for the rule, half for the values; lengths of lines are exact.
        let (rule_share, value_share) =
            if axis == 1 { (tolerance, 0.0) } else { (0.5 * tolerance, 0.5 * tolerance / (high - low)) };
        // No slice may use up the lines of the others.
        let share = if axis == D - 1 { self.most } else { 2 * self.most.isqrt() };
        let most_panels = self.breaks[axis].len() + share / VALUES_PER_PANEL;
        let more = |panels: usize| panels < most_panels && self.left.get() > 0;
        integrate(&self.breaks[axis], rule_share, &more, &mut |value| {
            x[axis] = value;
            self.slice(axis - 1, x, value_share)
        })
    }
}

/// Break points of a coordinate: ends and corners of primitives, and an even division between them.
fn breaks<const D: usize>(region: &Region<D>, axis: usize, most_panels: usize) -> Vec<f64> {
    let [low, high] = [0, 1].map(|side| region.bounds[side][axis]);
    let mut cuts = vec![low, high];
    region.each_primitive(&mut |primitive, motion| {
        cuts.extend(extent_of(primitive, motion, axis));
        cuts.extend(primitive.corners().iter().map(|x| motion.apply(x)[axis]));
    });
    cuts.retain(|x| low <= *x && *x <= high);
    cuts.sort_by(f64::total_cmp);
    let close = 1e-12 * (high - low);
    cuts.dedup_by(|next, before| *next - *before <= close);
    // Removing duplicates may have dropped the end itself.
    if let Some(last) = cuts.last_mut() {
        *last = high;
    }
    if cuts.len() > most_panels + 1 {
        let n = cuts.len() - 1;
        cuts = (0..=most_panels).map(|k| cuts[k * n / most_panels]).collect();
    }
    while cuts.len() <= FEWEST_PANELS {
        let halves: Vec<f64> = cuts.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
        cuts.extend(halves);
        cuts.sort_by(f64::total_cmp);
    }
    cuts
}

/// Clusters of parts: the bounds of parts in different clusters do not overlap.
fn clusters<const D: usize>(parts: &[Region<D>]) -> Vec<Vec<&Region<D>>> {
    let mut clusters: Vec<Vec<&Region<D>>> = Vec::new();
    for part in parts.iter().filter(|part| !is_empty(&part.bounds)) {
        let (near, far): (Vec<_>, Vec<_>) = clusters
            .into_iter()
            .partition(|cluster| cluster.iter().any(|other| meet(&other.bounds, &part.bounds)));
        clusters = far;
        clusters.push(near.into_iter().flatten().chain([part]).collect());
    }
    clusters
}

/// Removes each part for which `replaces(other, part)` is true for some other part; of two parts that replace each
/// other, the first is kept.
fn without_covered<const D: usize>(
    parts: Vec<&Region<D>>,
    replaces: impl Fn(&Region<D>, &Region<D>) -> bool,
) -> Vec<&Region<D>> {
    let mut needed: Vec<&Region<D>> = Vec::new();
    for part in parts {
        if !needed.iter().any(|other| replaces(other, part)) {
            needed.retain(|other| !replaces(part, other));
            needed.push(part);
        }
    }
    needed
}

fn content<const D: usize>(bounds: &Bounds<D>) -> f64 {
    (0..D).map(|d| bounds[1][d] - bounds[0][d]).product()
}

/// True if two boxes overlap by more than a common boundary.
fn meet<const D: usize>(a: &Bounds<D>, b: &Bounds<D>) -> bool {
    !is_empty(&overlap(*a, *b))
}

fn cloned<const D: usize>(parts: &[&Region<D>]) -> Vec<Region<D>> {
    parts.iter().map(|part| (*part).clone()).collect()
}

fn sum(volumes: impl Iterator<Item = Option<Volume>>) -> Option<Volume> {
    volumes.into_iter().try_fold(Volume { value: 0.0, error: 0.0 }, |sum, next| {
        let next = next?;
        Some(Volume { value: sum.value + next.value, error: sum.error + next.error })
    })
}
