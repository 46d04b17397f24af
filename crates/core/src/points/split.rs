//! Splitting of domains that have become too long.
//!
//! A domain given by its corners samples the basis functions only at its corners and touches tools only with its
//! corners and its centre: a domain that is longer than a cell misses nodes and tools in between. Where material flows
//! along a tool or in a shear band, domains grow without bound. A long domain is therefore cut in two, through the
//! mid-points of its long edges. Both halves keep the deformation gradient, the elastic strain and the history of the
//! whole, and share its volume and mass in the ratio of the original volumes of the halves: mass, volume, energy and
//! stress do not change.
//!
//! The mid-points become corners of the two halves, but not of undivided neighbours. From then on they move with the
//! grid; the straight edge of a neighbour separates from them by as much as the motion of the grid along the edge
//! deviates from a linear one.

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::Points;
use crate::grid::element::{Collapsed, ElementShape};
use crate::grid::{MAX_CORNERS, vtk_corner};
use crate::region::vector::{minus, norm};

/// Largest number of cuts of one point in one step.
const MAX_CUTS: usize = 6;

/// A cut of a domain through the mid-point of an edge.
///
/// Domains with 2^D corners, pyramids and wedges are cut across all edges parallel to this edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Split {
    /// Permanent number of the point, which the first half keeps.
    pub point: u32,
    /// Permanent number of the second half.
    pub half: u32,
    /// The corners at the ends of the edge.
    pub edge: [u8; 2],
}

/// What splitting needs to know about the model and its state.
pub(crate) trait Splitting<const D: usize> {
    /// Edge length above which the domain of a point is split, [length].
    fn longest(&self, points: &Points<D>, p: usize) -> f64;

    /// Volume per unit of area at a position in the plane: for bodies of revolution, the circumference of the circle
    /// through the position.
    fn depth(&self, position: &[f64; D]) -> f64;

    /// The position nearest to `place` that a corner of this body may take, [length].
    fn nearest_allowed(&self, body: usize, place: [f64; D]) -> [f64; D];

    /// True if these corners form a valid domain for the method of point `p`.
    fn is_valid(&self, points: &Points<D>, p: usize, corners: &[[f64; D]]) -> bool;

    /// Takes note that points of any rank have been cut, each once, in ascending order of their numbers. Called on all
    /// ranks together.
    fn have_cut(&mut self, _points: &Points<D>, _cuts: &[Split]) {}
}

/// The halves of a domain that has been cut, on the rank that holds them.
#[derive(Debug, Clone)]
pub struct Halves {
    /// The cut, as an index into the list of cuts.
    pub cut: usize,
    /// The points with the first and the second half.
    pub points: [usize; 2],
    /// The edges that the cut has divided, as corners of the domain; their mid-points are the second corner in the
    /// first half and the first corner in the second half.
    pub edges: Vec<[usize; 2]>,
}

impl Halves {
    /// The original corners of the undivided domain, [length].
    pub fn original_corners<const D: usize>(&self, points: &Points<D>) -> Vec<[f64; D]> {
        let [first, second] = self.points.map(|p| &points.original_corners[points.corner_range(p)]);
        let is_second = |corner: usize| self.edges.iter().any(|edge| edge[1] == corner);
        (0..first.len())
            .map(|corner| if is_second(corner) { second[corner] } else { first[corner] })
            .collect()
    }
}

/// The corners of a domain, and their number; the other entries of the array are unused.
type Domain<const D: usize> = ([[f64; D]; MAX_CORNERS], usize);

impl<const D: usize> Points<D> {
    /// Cuts domains until no edge is longer than allowed, at most [`MAX_CUTS`] times in succession; `next` is the
    /// number of the next new point. A domain stays whole if one of its halves would be invalid. All ranks must call
    /// this together; each returns the cuts of all ranks in the order of the new numbers.
    pub(crate) fn split_long(&mut self, rules: &mut impl Splitting<D>, mut next: u32) -> Vec<Split> {
        let mut splits = Vec::new();
        for _ in 0..MAX_CUTS {
            let mut long: Vec<(u32, [u8; 2])> = Vec::new();
            let mut places = Vec::new();
            for p in 0..self.len() {
                let Some((edge, length)) = longest_edge(self.corners(p)) else { continue };
                if length <= rules.longest(self, p) {
                    continue;
                }
                let halves = self.halves_now(p, edge.map(usize::from), &*rules);
                if halves.iter().all(|(corners, n)| rules.is_valid(self, p, &corners[..*n])) {
                    places.push(p);
                    long.push((self.id[p], edge));
                }
            }
            // New numbers follow the order of the permanent numbers of the cut points, regardless of the ranks that
            // hold them.
            let mut everywhere = self.reduction().join(long);
            if everywhere.is_empty() {
                break;
            }
            everywhere.sort_unstable();
            let all: Vec<Split> = everywhere
                .into_iter()
                .zip(next..)
                .map(|((point, edge), half)| Split { point, half, edge })
                .collect();
            next += all.len() as u32;
            let number = |p: &usize| all.binary_search_by_key(&self.id[*p], |cut| cut.point).ok();
            let cuts: Vec<Split> = places.iter().filter_map(number).map(|k| all[k]).collect();
            self.cut(&places, &cuts, &*rules);
            self.cuts.extend_from_slice(&all);
            rules.have_cut(self, &all);
            splits.extend(all);
        }
        splits
    }

    /// Moves the corners of the points with these permanent numbers, ascending, to the nearest positions that they may
    /// take. A domain that would become invalid stays unchanged.
    pub(crate) fn move_corners(&mut self, ids: &[u32], rules: &impl Splitting<D>) {
        for p in (0..self.len()).filter(|&p| ids.binary_search(&self.id[p]).is_ok()) {
            let body = usize::from(self.body[p]);
            let corners: Vec<_> = self.corners(p).iter().map(|x| rules.nearest_allowed(body, *x)).collect();
            if rules.is_valid(self, p, &corners) {
                let range = self.corner_range(p);
                self.converged.corners[range].copy_from_slice(&corners);
            }
        }
        self.trial = self.converged.trial();
    }

    /// The halves of a domain in the converged state.
    fn halves_now(&self, p: usize, edge: [usize; 2], rules: &impl Splitting<D>) -> [Domain<D>; 2] {
        let body = usize::from(self.body[p]);
        halves(self.corners(p), edge, |x| rules.nearest_allowed(body, x))
    }

    /// The halves on this rank of points that have just been cut, each once, in the order of the cuts.
    pub(crate) fn halves_of(&self, cuts: &[Split]) -> Vec<Halves> {
        let by_number = |number: fn(&Split) -> u32| -> FxHashMap<u32, usize> {
            cuts.iter().map(number).zip(0..).collect()
        };
        let numbers = [by_number(|cut| cut.point), by_number(|cut| cut.half)];
        let mut found = vec![[None; 2]; cuts.len()];
        for (p, id) in self.id.iter().enumerate() {
            for (half, numbers) in numbers.iter().enumerate() {
                if let Some(cut) = numbers.get(id) {
                    found[*cut][half] = Some(p);
                }
            }
        }
        let mut halves = Vec::new();
        for (cut, found) in found.into_iter().enumerate() {
            let [Some(first), Some(second)] = found else { continue };
            let edges = cut_edges::<D>(self.corner_range(first).len(), cuts[cut].edge.map(usize::from));
            halves.push(Halves { cut, points: [first, second], edges });
        }
        halves
    }

    /// Repeats cuts of an earlier run; cuts of points that no longer exist are skipped.
    ///
    /// # Errors
    /// The reason why a point cannot have been cut in this way.
    #[inline(never)]
    pub(crate) fn split_again(&mut self, splits: &[Split], rules: &impl Splitting<D>) -> Result<(), String> {
        for split in splits {
            self.cuts.push(*split);
            let place = |id: u32| self.id.iter().position(|other| *other == id);
            let Some(p) = place(split.point) else { continue };
            let corners = self.corner_range(p).len();
            let [a, b] = split.edge.map(usize::from);
            let is_collapsed = corners != 1 << D && corners != D + 1;
            let is_ordered = a < b || is_collapsed && a != b;
            let is_edge = is_ordered && a.max(b) < corners && !cut_edges::<D>(corners, [a, b]).is_empty();
            if !is_edge || place(split.half).is_some() {
                return Err("it contains a split of a point that cannot be split in this way".to_owned());
            }
            self.cut(&[p], std::slice::from_ref(split), rules);
        }
        Ok(())
    }

    /// Cuts the points with these indices, one cut for each.
    fn cut(&mut self, places: &[usize], cuts: &[Split], rules: &impl Splitting<D>) {
        let n = self.len();
        let order: Vec<u32> = (0..n).chain(places.iter().copied()).map(|p| p as u32).collect();
        self.select(&order);
        for (k, (&first, cut)) in places.iter().zip(cuts).enumerate() {
            let second = n + k;
            self.id[second] = cut.half;
            let at = [first, second];
            let edge = cut.edge.map(usize::from);
            let range = self.corner_range(first);
            let now = self.halves_now(first, edge, rules);
            let original = halves(&self.original_corners[range], edge, |x| x);
            let volumes = original.each_ref().map(|(corners, n)| volume(&corners[..*n], rules));
            let whole = volumes[0] + volumes[1];
            let (volume, mass) = (self.original_volume[first], self.mass[first]);
            for (half, p) in at.into_iter().enumerate() {
                let share = if whole > 0.0 { volumes[half] / whole } else { 0.5 };
                self.original_volume[p] = share * volume;
                self.mass[p] = share * mass;
                let range = self.corner_range(p);
                let count = range.len();
                self.original_corners[range.clone()].copy_from_slice(&original[half].0[..count]);
                self.original_position[p] = middle(&original[half].0[..count]);
                self.converged.corners[range].copy_from_slice(&now[half].0[..count]);
                self.converged.position[p] = middle(&now[half].0[..count]);
            }
        }
        self.trial = self.converged.trial();
    }
}

/// The edges of a domain that a cut through one of them divides, each from the first half to the second; empty if it
/// cannot be cut there.
fn cut_edges<const D: usize>(corners: usize, [a, b]: [usize; 2]) -> Vec<[usize; 2]> {
    if corners == 1 << D {
        let axis = a ^ b;
        let low = (0..corners).filter(|c| c & axis == 0);
        return if axis.is_power_of_two() { low.map(|low| [low, low | axis]).collect() } else { Vec::new() };
    }
    match Collapsed::from_corners::<D>(corners) {
        Some(shape) => {
            let group = shape.cuts().iter().find(|group| group[0] == [a, b]);
            group.map_or_else(Vec::new, |group| group.to_vec())
        }
        None => vec![[a, b]],
    }
}

/// The longest edge of a domain and its length; for 2^D corners, pyramids and wedges, lengths are averaged over
/// parallel edges, the first of which is returned. `None` without corners.
fn longest_edge<const D: usize>(corners: &[[f64; D]]) -> Option<([u8; 2], f64)> {
    let length = |a: usize, b: usize| norm(&minus(&corners[b], &corners[a]));
    let mut longest: Option<([u8; 2], f64)> = None;
    let mut take = |a: usize, b: usize, length: f64| {
        if longest.is_none_or(|(_, most)| length > most) {
            longest = Some(([a as u8, b as u8], length));
        }
    };
    if corners.len() == 1 << D {
        for axis in 0..D {
            let low = (0..corners.len()).filter(|c| c >> axis & 1 == 0);
            let sum: f64 = low.map(|c| length(c, c | 1 << axis)).sum();
            take(0, 1 << axis, sum / (corners.len() / 2) as f64);
        }
    } else if let Some(shape) = Collapsed::from_corners::<D>(corners.len()) {
        for group in shape.cuts() {
            let sum: f64 = group.iter().map(|[a, b]| length(*a, *b)).sum();
            take(group[0][0], group[0][1], sum / group.len() as f64);
        }
    } else {
        for b in 1..corners.len() {
            (0..b).for_each(|a| take(a, b, length(a, b)));
        }
    }
    longest
}

/// The halves of a domain that is cut through the mid-point of an edge.
fn halves<const D: usize>(
    corners: &[[f64; D]],
    edge: [usize; 2],
    place: impl Fn([f64; D]) -> [f64; D],
) -> [Domain<D>; 2] {
    let between = |a: usize, b: usize| place(std::array::from_fn(|d| 0.5 * (corners[a][d] + corners[b][d])));
    let mut whole = ([[0.0; D]; MAX_CORNERS], corners.len());
    whole.0[..corners.len()].copy_from_slice(corners);
    let mut parts = [whole; 2];
    for [first, second] in cut_edges::<D>(corners.len(), edge) {
        let mid = between(first, second);
        parts[0].0[second] = mid;
        parts[1].0[first] = mid;
    }
    parts
}

/// The place of the point in a domain: the centroid of a pyramid or wedge, the mean of the corners of any other domain.
fn middle<const D: usize>(corners: &[[f64; D]]) -> [f64; D] {
    if let Some(shape) = Collapsed::from_corners::<D>(corners.len()) {
        return shape.centroid(corners);
    }
    std::array::from_fn(|d| corners.iter().map(|x| x[d]).sum::<f64>() / corners.len() as f64)
}

/// Volume of a domain.
fn volume<const D: usize>(corners: &[[f64; D]], rules: &impl Splitting<D>) -> f64 {
    if let Some(shape) = Collapsed::from_corners::<D>(corners.len()) {
        return shape.volume(corners).abs() * rules.depth(&shape.centroid(corners));
    }
    let Some(shape) = ElementShape::from_nodes::<D>(corners.len()) else { return 0.0 };
    let in_order: Vec<[f64; D]> = match shape {
        ElementShape::Simplex => corners.to_vec(),
        ElementShape::Box => (0..corners.len()).map(|k| corners[vtk_corner(k)]).collect(),
    };
    shape.volume(&in_order).abs() * rules.depth(&shape.centroid(&in_order))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::Seed;
    use crate::ranks::{Ranks, threads};

    /// Domains longer than `longest` are cut; bodies of revolution have the depth 2 π r.
    struct Rules {
        longest: f64,
        is_revolved: bool,
        accepts: bool,
    }

    impl Rules {
        fn new(longest: f64, is_revolved: bool) -> Rules {
            Rules { longest, is_revolved, accepts: true }
        }
    }

    impl<const D: usize> Splitting<D> for Rules {
        fn longest(&self, _: &Points<D>, _: usize) -> f64 {
            self.longest
        }

        fn depth(&self, position: &[f64; D]) -> f64 {
            if self.is_revolved { 2.0 * std::f64::consts::PI * position[0] } else { 1.0 }
        }

        fn nearest_allowed(&self, _: usize, place: [f64; D]) -> [f64; D] {
            place
        }

        fn is_valid(&self, _: &Points<D>, _: usize, _: &[[f64; D]]) -> bool {
            self.accepts
        }
    }

    /// The area or volume of a domain, without the factor of its depth.
    fn size<const D: usize>(corners: &[[f64; D]]) -> f64 {
        volume(corners, &Rules::new(0.0, false))
    }

    /// A motion that stretches and shears.
    fn moved<const D: usize>(x: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| if i == 0 { x[0] + 0.3 * x[1] } else { (5 - i) as f64 * x[i] })
    }

    /// A point with this domain at the start, stretched and sheared.
    fn stretched<const D: usize>(corners: Vec<[f64; D]>, rules: &Rules) -> Points<D> {
        let volume = volume(&corners, rules);
        let seed = Seed {
            body: 0,
            position: middle(&corners),
            half_lengths: [0.5; D],
            corners,
            volume,
            mass: 3.0 * volume,
            outer_layer: false,
            history: Vec::new(),
        };
        let mut points = Points::new(&[seed]);
        points.converged.corners.iter_mut().for_each(|x| *x = moved(x));
        points.converged.position[0] = moved(&points.converged.position[0]);
        points.trial = points.converged.trial();
        points
    }

    fn splits_keep_the_whole<const D: usize>(corners: Vec<[f64; D]>, is_revolved: bool) {
        let mut rules = Rules::new(1.3, is_revolved);
        let whole = stretched(corners, &rules);
        let mut points = whole.clone();
        let splits = points.split_long(&mut rules, 1);
        assert!(splits.len() >= 2 && points.len() == splits.len() + 1, "{splits:?}");
        let kept = |quantity: &dyn Fn(&Points<D>, usize) -> f64| {
            let sum = |points: &Points<D>| -> f64 { (0..points.len()).map(|p| quantity(points, p)).sum() };
            let (found, expected) = (sum(&points), sum(&whole));
            let error = (found - expected).abs();
            assert!(error <= 1e-13 * expected.abs().max(1.0), "{found} instead of {expected}");
        };
        kept(&|points, p| points.original_volume[p]);
        kept(&|points, p| points.mass[p]);
        kept(&|points, p| size(points.corners(p)));
        let original = |points: &Points<D>, p: usize| size(&points.original_corners[points.corner_range(p)]);
        for d in 0..D {
            kept(&|points, p| original(points, p) * points.original_position[p][d]);
            kept(&|points, p| size(points.corners(p)) * points.converged.position[p][d]);
        }
        for p in 0..points.len() {
            assert!(longest_edge(points.corners(p)).unwrap().1 <= 1.3);
            assert_eq!(points.converged.deformation_gradient[p], whole.converged.deformation_gradient[0]);
            // Corners and their original positions still belong together.
            let originals = points.original_corners[points.corner_range(p)].iter();
            for (original, now) in originals.zip(points.corners(p)) {
                assert!(norm(&minus(&moved(original), now)) < 1e-14);
            }
        }
        let mut again = whole.clone();
        again.split_again(&splits, &rules).unwrap();
        assert_eq!(again.converged.corners, points.converged.corners);
        assert_eq!(again.original_volume, points.original_volume);
        assert_eq!((&again.mass, &again.id), (&points.mass, &points.id));
    }

    const SQUARE: [[f64; 2]; 4] = [[1.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 1.0]];
    const TRIANGLE: [[f64; 2]; 3] = [[1.0, 0.0], [2.0, 0.0], [1.2, 1.0]];

    #[test]
    fn splits_keep_volume_mass_and_places() {
        for is_revolved in [false, true] {
            splits_keep_the_whole(SQUARE.to_vec(), is_revolved);
            splits_keep_the_whole(TRIANGLE.to_vec(), is_revolved);
        }
        let brick = |k: usize| std::array::from_fn(|d| (k >> d & 1) as f64);
        splits_keep_the_whole((0..8).map(brick).collect::<Vec<[f64; 3]>>(), false);
        splits_keep_the_whole(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], false);
        let base = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        splits_keep_the_whole(base.into_iter().chain([[0.3, 0.4, 1.0]]).collect(), false);
        let ends = [0.0, 1.0].map(|z| [[0.0, 0.0, z], [0.0, 1.0, z], [1.0, 0.0, z]]);
        splits_keep_the_whole(ends.concat(), false);
    }

    #[test]
    fn ranks_split_as_one() {
        let square = |id: u32| -> Seed<2> {
            let corners: Vec<[f64; 2]> =
                SQUARE.map(|x| [x[0] + f64::from(id), (1.0 + 0.1 * f64::from(id)) * x[1]]).to_vec();
            Seed {
                body: 0,
                position: middle(&corners),
                half_lengths: [0.5; 2],
                volume: size(&corners),
                corners,
                mass: 1.0,
                outer_layer: false,
                history: Vec::new(),
            }
        };
        let split = |ranks: &Ranks| {
            let numbers: Vec<u32> = (0..7).filter(|id| *id as usize % ranks.count() == ranks.own()).collect();
            let seeds: Vec<Seed<2>> = numbers.iter().map(|id| square(*id)).collect();
            let mut points = Points::numbered(&seeds, numbers, ranks);
            let mut rules = Rules::new(0.7, false);
            let splits = points.split_long(&mut rules, 10);
            let found: Vec<(u32, Vec<[f64; 2]>, f64)> = (points.by_id().into_iter())
                .map(|p| (points.id[p], points.corners(p).to_vec(), points.mass[p]))
                .collect();
            let mut all = ranks.gather_all(found).concat();
            all.sort_by_key(|point| point.0);
            (splits, all)
        };
        let one = split(&Ranks::default());
        assert!(one.0.len() > 14 && one.1.len() == 7 + one.0.len());
        for n in [2, 3] {
            assert!(threads::run(n, |ranks| split(&ranks)).iter().all(|found| *found == one));
        }
    }

    #[test]
    fn domains_stay_whole_where_a_half_would_not_be_valid() {
        let mut rules = Rules::new(0.1, false);
        let mut points = stretched(TRIANGLE.to_vec(), &rules);
        rules.accepts = false;
        assert!(points.split_long(&mut rules, 1).is_empty() && points.len() == 1);
        rules.accepts = true;
        assert!(points.split_long(&mut rules, 1).len() > 1);
    }

    #[test]
    fn impossible_splits_are_refused() {
        let rules = Rules::new(1.0, false);
        let is_refused = |point, half, edge| {
            let mut points = stretched(SQUARE.to_vec(), &rules);
            points.split_again(&[Split { point, half, edge }], &rules).is_err()
        };
        assert!(!is_refused(0, 1, [0, 2]));
        for (half, edge) in [(1, [0, 3]), (1, [2, 0]), (1, [0, 4]), (1, [1, 1]), (0, [0, 1])] {
            assert!(is_refused(0, half, edge));
        }
        // Cuts of a point that no longer exists are skipped.
        assert!(!is_refused(7, 8, [0, 1]));
    }
}
