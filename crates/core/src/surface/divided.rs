//! Surfaces whose sides are divided when the domains to which they belong are cut.
//!
//! Loads and conditions are in equilibrium with a uniform stress if they act on the present outer sides of domains. When
//! a domain is cut, the mid-points of edges become corners of its halves and move with the grid from then on, so that a
//! side of the whole no longer is the outer boundary of the halves. The sides of the halves therefore replace each side
//! of the surface that the cut divides. Sides are recognised by their original corners, which no motion changes.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::outer::sides_of_domain;
use super::{Places, Surface, centre};
use crate::points::{Halves, Points};

/// The triangles of a quadrilateral side: the mean over both divisions weights its corners equally.
const OF_QUADRILATERAL: [&[usize]; 4] = [&[0, 1, 2], &[0, 2, 3], &[0, 1, 3], &[1, 2, 3]];
/// The only facet of a segment or triangle.
const OF_SIMPLEX: [&[usize]; 1] = [&[0, 1, 2]];

/// The facets of a side with this number of corners, as corners of the side; of a segment, the first two.
pub(super) fn facets_of_side(corners: usize) -> &'static [&'static [usize]] {
    if corners == 4 { &OF_QUADRILATERAL } else { &OF_SIMPLEX }
}

/// The division of a side of a surface through the mid-point of an edge or, of a quadrilateral, of two opposite edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Division {
    /// The first sample on the side.
    pub sample: u32,
    /// The ends of an edge that is divided, as corners of the side in cyclic order: the first half keeps the first end.
    pub edge: [u8; 2],
}

impl Division {
    /// The edges that are divided on a side with this number of corners, each from the first half to the second; none
    /// if this is not possible.
    fn edges(&self, corners: usize) -> Vec<[usize; 2]> {
        let [a, b] = self.edge.map(usize::from);
        let last = corners - 1;
        let (before, after) = (|k: usize| (k + last) % corners, |k: usize| (k + 1) % corners);
        match corners {
            _ if a.max(b) > last || a == b => Vec::new(),
            4 if b == after(a) => vec![[a, b], [before(a), after(b)]],
            4 if b == before(a) => vec![[a, b], [after(a), before(b)]],
            4 => Vec::new(),
            _ => vec![[a, b]],
        }
    }
}

/// A division of a side together with the current positions of the new corners.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlacedDivision {
    /// The division.
    pub division: Division,
    /// `D` numbers for each new corner, [length].
    pub middles: Vec<f64>,
}

impl<const D: usize> Surface<D> {
    /// The corners of the side of a domain whose first sample this is, in cyclic order, as indices into `corners`; of a
    /// surface that does not consist of the sides of domains, those of the facet.
    fn side(&self, sample: usize) -> Option<Vec<u32>> {
        let mut side = self.facets.get(sample)?.to_vec();
        if D == 3 && self.shares[sample] < 1.0 {
            side.push(self.facets.get(sample + 1)?[D - 1]);
            let facets = self.facets.get(sample..sample + OF_QUADRILATERAL.len())?;
            let is_of_side = |(facet, of): (&[u32; D], &&[usize])| (0..D).all(|k| facet[k] == side[of[k]]);
            if !facets.iter().zip(&OF_QUADRILATERAL).all(is_of_side) {
                return None;
            }
        }
        Some(side)
    }

    /// Replaces a side by its halves: the first takes the place of the whole, the samples and corners of the second
    /// follow all others. Returns the number of new corners, none if the surface has no such side or edge.
    pub(super) fn divide(&mut self, division: &Division) -> usize {
        let first = division.sample as usize;
        let Some(side) = self.side(first) else { return 0 };
        let edges = division.edges(side.len());
        let mut halves = [side.clone(), side.clone()];
        for &[a, b] in &edges {
            let [first, second] = [a, b].map(|end| side[end] as usize);
            let middle = |of: &[[f64; D]]| std::array::from_fn(|d| 0.5 * (of[first][d] + of[second][d]));
            (halves[0][b], halves[1][a]) = (self.corners.len() as u32, self.corners.len() as u32);
            self.corners.push(middle(&self.corners));
            self.in_cells.push(middle(&self.in_cells));
        }
        if edges.is_empty() {
            return 0;
        }
        for (half, corners) in halves.iter().enumerate() {
            for (k, of) in facets_of_side(corners.len()).iter().enumerate() {
                let facet = std::array::from_fn(|corner| corners[of[corner]]);
                let place = if half == 0 { first + k } else { self.repeated(first + k) };
                self.facets[place] = facet;
                self.samples[place] = centre(&self.facet(place));
            }
        }
        edges.len()
    }

    /// Appends a copy of a sample; returns its index.
    fn repeated(&mut self, sample: usize) -> usize {
        self.samples.push(self.samples[sample]);
        self.facets.push(self.facets[sample]);
        self.shares.push(self.shares[sample]);
        self.of_triangles.push(self.of_triangles[sample]);
        self.sides.push(self.sides[sample]);
        self.samples.len() - 1
    }

    /// The divisions of this surface by cuts of points of this rank, each with the index of the cut.
    pub(super) fn divisions(&self, points: &Points<D>, halves: &[Halves]) -> Vec<(u32, PlacedDivision)> {
        let is_of_body = |halves: &&Halves| usize::from(points.body[halves.points[0]]) == self.body;
        let mut own = halves.iter().filter(is_of_body).peekable();
        let mut found = Vec::new();
        if own.peek().is_none() {
            return found;
        }
        let sides = Sides::new(self);
        for halves in own {
            let cut = halves.cut as u32;
            found.extend(sides.divided_by(points, halves).into_iter().map(|division| (cut, division)));
        }
        found
    }
}

/// The sides of a surface, for finding those of domains.
struct Sides<const D: usize> {
    /// Original positions of corners; corners at the same place have the same number.
    places: Places<D>,
    /// The first sample of each side, and its corners in cyclic order, by its corners in ascending order.
    by_corners: HashMap<Vec<u32>, (u32, Vec<u32>)>,
}

impl<const D: usize> Sides<D> {
    fn new(surface: &Surface<D>) -> Self {
        let mut places = Places::new(surface.cell);
        let numbers: Vec<u32> = surface.corners.iter().map(|corner| places.number(corner)).collect();
        let mut by_corners = HashMap::new();
        let mut sample = 0;
        while sample < surface.len() {
            let Some(side) = surface.side(sample) else {
                sample += 1;
                continue;
            };
            let side: Vec<u32> = side.iter().map(|corner| numbers[*corner as usize]).collect();
            let next = sample + facets_of_side(side.len()).len();
            by_corners.insert(sorted(&side), (sample as u32, side));
            sample = next;
        }
        Sides { places, by_corners }
    }

    /// The sides that the cut of a domain divides.
    fn divided_by(&self, points: &Points<D>, halves: &Halves) -> Vec<PlacedDivision> {
        let original = halves.original_corners(points);
        let numbers: Vec<Option<u32>> = original.iter().map(|corner| self.places.known(corner)).collect();
        let now = points.corners(halves.points[0]);
        let mut found = Vec::new();
        for side in sides_of_domain::<D>(original.len()) {
            let has = |edge: &&[usize; 2]| edge.iter().all(|corner| side.corners().contains(corner));
            let divided: Vec<[usize; 2]> = halves.edges.iter().filter(has).copied().collect();
            let corners: Option<Vec<u32>> = side.corners().iter().map(|corner| numbers[*corner]).collect();
            let Some((sample, corners)) = corners.and_then(|side| self.by_corners.get(&sorted(&side))) else {
                continue;
            };
            let at = |corner: usize| {
                corners.iter().position(|number| numbers[corner] == Some(*number)).unwrap_or_default()
            };
            let Some([a, b]) = divided.first().map(|edge| edge.map(at)) else { continue };
            let division = Division { sample: *sample, edge: [a as u8, b as u8] };
            let edges = division.edges(corners.len());
            // The new corners lie at the second ends of the edges in the first half.
            let middle = |edge: &[usize; 2]| {
                let same = divided.iter().find(|other| other.map(at) == *edge)?;
                Some(now[same[1]])
            };
            let middles: Option<Vec<[f64; D]>> = edges.iter().map(middle).collect();
            let Some(middles) = middles.filter(|middles| !middles.is_empty()) else { continue };
            found.push(PlacedDivision { division, middles: middles.into_flattened() });
        }
        found
    }
}

/// Numbers in ascending order.
fn sorted(numbers: &[u32]) -> Vec<u32> {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::{Seed, Split, Splitting};
    use crate::region::Facet;
    use crate::surface::{Carried, Part};

    /// Domains longer than `longest` are cut, and the surface follows.
    struct Following<const D: usize> {
        longest: f64,
        carried: Carried<D>,
    }

    impl<const D: usize> Splitting<D> for Following<D> {
        fn longest(&self, _: &Points<D>, _: usize) -> f64 {
            self.longest
        }

        fn depth(&self, _: &[f64; D]) -> f64 {
            1.0
        }

        fn nearest_allowed(&self, _: usize, place: [f64; D]) -> [f64; D] {
            place
        }

        fn is_valid(&self, _: &Points<D>, _: usize, _: &[[f64; D]]) -> bool {
            true
        }

        fn have_cut(&mut self, points: &Points<D>, cuts: &[Split]) {
            let divisions = self.carried.divisions_by(points, &points.halves_of(cuts));
            divisions.iter().for_each(|(_, division)| self.carried.divide(division));
        }
    }

    /// The surface of a single domain, which consists of all of its sides.
    fn surface_of<const D: usize>(corners: &[[f64; D]]) -> Surface<D> {
        let (mut facets, mut shares) = (Vec::new(), Vec::new());
        for (number, side) in sides_of_domain::<D>(corners.len()).enumerate() {
            let side = side.corners();
            for of in facets_of_side(side.len()) {
                facets.push(Facet { corners: std::array::from_fn(|k| corners[side[of[k]]]), side: number });
                shares.push(if side.len() == 4 { 0.5 } else { 1.0 });
            }
        }
        Surface { shares, ..Surface::from_facets("whole", 0, facets, &Part::Whole, 1.0) }
    }

    /// A motion that stretches and shears.
    fn moved<const D: usize>(x: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| if i == 0 { x[0] + 0.3 * x[1] } else { (5 - i) as f64 * x[i] })
    }

    /// Corners of a side in an order of their own, up to round-off.
    fn key<const D: usize>(corners: impl IntoIterator<Item = [f64; D]>) -> Vec<[i64; D]> {
        let mut key: Vec<[i64; D]> =
            corners.into_iter().map(|x| x.map(|x| (x * 1e9).round() as i64)).collect();
        key.sort_unstable();
        key
    }

    /// Cuts a domain several times; the surface then consists of the outer sides of all parts.
    fn follows<const D: usize>(corners: Vec<[f64; D]>) {
        let seed = Seed {
            body: 0,
            position: centre(&std::array::from_fn(|k| corners[k])),
            half_lengths: [0.5; D],
            corners: corners.clone(),
            volume: 1.0,
            mass: 1.0,
            outer_layer: false,
            history: Vec::new(),
        };
        let mut points = Points::new(&[seed]);
        points.converged.corners.iter_mut().for_each(|x| *x = moved(x));
        let surface = surface_of(&corners);
        let mut carried = Carried::new(&surface, false);
        carried.converged.iter_mut().for_each(|x| *x = moved(x));
        let mut rules = Following { longest: 1.3, carried };
        assert!(points.split_long(&mut rules, 1).len() > 2);
        let carried = rules.carried;

        let mut expected: Vec<Vec<[i64; D]>> = Vec::new();
        for p in 0..points.len() {
            let corners = points.corners(p);
            let sides = sides_of_domain::<D>(corners.len());
            expected.extend(sides.map(|side| key(side.corners().iter().map(|&k| corners[k]))));
        }
        let all = expected.clone();
        expected.retain(|side| all.iter().filter(|other| *other == side).count() == 1);
        let mut found: Vec<Vec<[i64; D]>> = Vec::new();
        let mut sample = 0;
        while sample < carried.len() {
            let side = carried.surface().side(sample).unwrap();
            found.push(key(side.iter().map(|&corner| carried.converged[corner as usize])));
            sample += facets_of_side(side.len()).len();
        }
        expected.sort();
        found.sort();
        assert_eq!(found, expected);

        let surface = carried.surface();
        let areas = (0..surface.len()).map(|sample| surface.original_area(sample));
        let sum = areas.fold([0.0; D], |sum, area| std::array::from_fn(|d| sum[d] + area[d]));
        assert!(sum.iter().all(|x| x.abs() < 1e-14), "{sum:?}");
        let n = (0..carried.len()).map(|sample| carried.origin(sample).1).sum::<f64>();
        assert_eq!(n, surface_of(&corners).len() as f64);
        is_restored(&carried, &surface_of(&corners));
    }

    /// A checkpoint restores the surface as it is, and states that no run can have reached are refused.
    fn is_restored<const D: usize>(carried: &Carried<D>, start: &Surface<D>) {
        let saved = carried.save();
        let mut restored = Carried::new(start, false);
        for _ in 0..2 {
            restored.restore(&saved).unwrap();
            assert_eq!((restored.surface(), &restored.converged), (carried.surface(), &carried.converged));
        }
        let is_refused = |change: &dyn Fn(&mut serde_json::Value)| {
            let mut saved = saved.clone();
            change(&mut saved);
            Carried::new(start, false).restore(&saved).is_err()
        };
        assert!(!is_refused(&|_| ()));
        for edge in [[0, 0], [0, 9], [255, 1], [if D == 2 { 2 } else { 4 }, 1]] {
            assert!(is_refused(&|saved| saved["divisions"][1]["edge"] = edge.into()));
        }
        for sample in [u32::MAX, 1000] {
            assert!(is_refused(&|saved| saved["divisions"][0]["sample"] = sample.into()));
        }
        assert!(is_refused(&|saved| saved["divisions"] = serde_json::Value::Null));
        assert!(is_refused(&|saved| saved["divisions"] = 3.into()));
        assert!(is_refused(&|saved| saved["corners"][0] = "a".into()));
        assert!(is_refused(&|saved| drop(saved["divisions"].as_array_mut().unwrap().pop())));
        // Checkpoints without divisions hold the corners alone.
        let whole = Carried::new(start, false);
        assert!(whole.save().is_array());
        restored.restore(&whole.save()).unwrap();
        assert_eq!(restored.surface(), start);
    }

    #[test]
    fn surfaces_of_all_domains_follow_cuts() {
        follows(vec![[1.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 1.0]]);
        follows(vec![[1.0, 0.0], [2.0, 0.0], [1.2, 1.0]]);
        follows(
            (0..8).map(|k: usize| std::array::from_fn(|d| (k >> d & 1) as f64)).collect::<Vec<[f64; 3]>>(),
        );
        follows(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let base = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        follows(base.into_iter().chain([[0.3, 0.4, 1.0]]).collect());
        follows([0.0, 1.0].map(|z| [[0.0, 0.0, z], [0.0, 1.0, z], [1.0, 0.0, z]]).concat());
    }

    #[test]
    fn quadrilaterals_are_divided_through_opposite_edges() {
        let edges = |edge: [u8; 2], corners: usize| Division { sample: 0, edge }.edges(corners);
        assert_eq!(edges([0, 1], 4), [[0, 1], [3, 2]]);
        assert_eq!(edges([0, 3], 4), [[0, 3], [1, 2]]);
        assert_eq!(edges([2, 0], 3), [[2, 0]]);
        assert!([[0, 2], [1, 1], [4, 0]].iter().all(|edge| edges(*edge, 4).is_empty()));
    }
}
