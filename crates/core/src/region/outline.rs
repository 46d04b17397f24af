//! The outline of a region of the plane: closed polygons around it, in which circles become polygons of equal area.

use std::collections::HashMap;

use super::polygon::{passes_right_of, sides, signed_area, turn};
use super::vector::{along, dot, minus, norm};
use super::{Bounds, Curve, Node, Region};

/// Distance from a piece of a curve at which its two sides are examined, in multiples of the distance within which
/// positions coincide, [-].
const ASIDE: f64 = 8.0;

/// Closed polygons around a region of the plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline {
    /// The corners of each polygon in order, [length]; the region lies to the left of its sides.
    pub loops: Vec<Vec<[f64; 2]>>,
}

impl Outline {
    /// The area of the region, [length²].
    pub fn area(&self) -> f64 {
        self.loops.iter().map(|corners| signed_area(corners)).sum()
    }

    /// The sides of all polygons, each from its start to its end.
    pub fn sides(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        self.loops.iter().flat_map(|corners| sides(corners))
    }
}

/// A region whose primitives are polygons.
enum Polygonal {
    /// The positions around which a ray crosses the polygons an odd number of times.
    Inside(Vec<Vec<[f64; 2]>>),
    Any(Vec<Polygonal>),
    All(Vec<Polygonal>),
    Less(Box<Polygonal>, Vec<Polygonal>),
}

impl Polygonal {
    fn contains(&self, x: &[f64; 2]) -> bool {
        match self {
            Polygonal::Inside(curves) => {
                let crossed =
                    |curve: &Vec<[f64; 2]>| sides(curve).filter(|(a, b)| passes_right_of(a, b, x)).count();
                curves.iter().map(crossed).sum::<usize>() % 2 == 1
            }
            Polygonal::Any(parts) => parts.iter().any(|part| part.contains(x)),
            Polygonal::All(parts) => parts.iter().all(|part| part.contains(x)),
            Polygonal::Less(from, minus) => from.contains(x) && !minus.iter().any(|part| part.contains(x)),
        }
    }

    /// All polygons.
    fn curves<'a>(&'a self, all: &mut Vec<&'a Vec<[f64; 2]>>) {
        match self {
            Polygonal::Inside(curves) => all.extend(curves),
            Polygonal::Any(parts) | Polygonal::All(parts) => parts.iter().for_each(|part| part.curves(all)),
            Polygonal::Less(from, minus) => {
                from.curves(all);
                minus.iter().for_each(|part| part.curves(all));
            }
        }
    }
}

impl<const D: usize> Region<D> {
    /// The outline of the part of a region of the plane that lies in a box, if one is given; `None` in space and for
    /// regions with groups of cells. The chords of circles are about as long as `chord` says at their positions;
    /// positions within `same` coincide, both [length].
    pub fn outline(
        &self,
        within: Option<Bounds<2>>,
        chord: &dyn Fn(&[f64; 2]) -> f64,
        same: f64,
    ) -> Option<Outline> {
        let mut region = self.polygonal(chord)?;
        if let Some([low, high]) = within {
            let corners = vec![low, [high[0], low[1]], high, [low[0], high[1]]];
            region = Polygonal::All(vec![region, Polygonal::Inside(vec![corners])]);
        }
        if let Polygonal::Inside(curves) = &mut region
            && let [curve] = curves.as_mut_slice()
        {
            if signed_area(curve) < 0.0 {
                curve.reverse();
            }
            return Some(Outline { loops: std::mem::take(curves) });
        }
        let mut curves = Vec::new();
        region.curves(&mut curves);
        Arrangement::new(&curves, same).outline(&region)
    }

    fn polygonal(&self, chord: &dyn Fn(&[f64; 2]) -> f64) -> Option<Polygonal> {
        let all =
            |parts: &[Region<D>]| parts.iter().map(|part| part.polygonal(chord)).collect::<Option<Vec<_>>>();
        match &self.node {
            Node::Primitive(primitive, motion) => {
                let moved = |x: &[f64; 2]| {
                    let y = motion.apply(&std::array::from_fn(|d| x[d % 2]));
                    [y[0], y[1 % D]]
                };
                let moved = |curve| match curve {
                    Curve::Polygon(corners) => Curve::Polygon(corners.iter().map(moved).collect()),
                    Curve::Circle { center, radius } => {
                        Curve::Circle { center: moved(&center), radius: radius * motion.scale() }
                    }
                };
                let curves = primitive.curves();
                let polygons =
                    curves.into_iter().map(|curve| moved(curve).polygon(chord)).collect::<Vec<_>>();
                (!polygons.is_empty()).then_some(Polygonal::Inside(polygons))
            }
            Node::Group(..) => None,
            Node::Union(parts) => Some(Polygonal::Any(all(parts)?)),
            Node::Intersection(parts) => Some(Polygonal::All(all(parts)?)),
            Node::Difference(from, minus) => {
                Some(Polygonal::Less(Box::new(from.polygonal(chord)?), all(minus)?))
            }
        }
    }
}

/// Polygons cut where they meet.
struct Arrangement {
    places: Vec<[f64; 2]>,
    /// The ends of the pieces, as indices into `places`; the lower one first.
    pieces: Vec<[u32; 2]>,
    same: f64,
}

impl Arrangement {
    fn new(curves: &[&Vec<[f64; 2]>], same: f64) -> Self {
        let segments: Vec<(usize, [[f64; 2]; 2])> = (curves.iter().enumerate())
            .flat_map(|(number, curve)| sides(curve).map(move |(a, b)| (number, [a, b])))
            .collect();
        let mut cuts: Vec<Vec<[f64; 2]>> = segments.iter().map(|(_, ends)| ends.to_vec()).collect();
        let end =
            |k: usize, d: usize, most: fn(f64, f64) -> f64| most(segments[k].1[0][d], segments[k].1[1][d]);
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by(|&a, &b| end(a, 0, f64::min).total_cmp(&end(b, 0, f64::min)));
        for (index, &a) in order.iter().enumerate() {
            let right = end(a, 0, f64::max) + same;
            for &b in order[index + 1..].iter().take_while(|&&b| end(b, 0, f64::min) <= right) {
                let apart = end(b, 1, f64::min) > end(a, 1, f64::max) + same
                    || end(a, 1, f64::min) > end(b, 1, f64::max) + same;
                if segments[a].0 != segments[b].0 && !apart {
                    let [on_a, on_b] = meetings(&segments[a].1, &segments[b].1, same);
                    cuts[a].extend(on_a);
                    cuts[b].extend(on_b);
                }
            }
        }
        let mut all = Arrangement { places: Vec::new(), pieces: Vec::new(), same };
        let mut known = HashMap::new();
        for ((_, [from, to]), mut cuts) in segments.iter().zip(cuts) {
            let edge = minus(to, from);
            cuts.sort_by(|a, b| dot(&minus(a, from), &edge).total_cmp(&dot(&minus(b, from), &edge)));
            let numbers: Vec<u32> = cuts.iter().map(|x| all.number(x, &mut known)).collect();
            let pieces = numbers.windows(2).filter(|pair| pair[0] != pair[1]);
            all.pieces.extend(pieces.map(|pair| [pair[0].min(pair[1]), pair[0].max(pair[1])]));
        }
        all.pieces.sort_unstable();
        all.pieces.dedup();
        all
    }

    /// The number of a place; places that coincide share a number.
    fn number(&mut self, x: &[f64; 2], known: &mut HashMap<[i64; 2], u32>) -> u32 {
        let key = x.map(|x| (x / self.same).round() as i64);
        let around = (0..9).map(|k| [key[0].saturating_add(k % 3 - 1), key[1].saturating_add(k / 3 - 1)]);
        std::iter::once(key).chain(around).find_map(|key| known.get(&key).copied()).unwrap_or_else(|| {
            self.places.push(*x);
            known.insert(key, self.places.len() as u32 - 1);
            self.places.len() as u32 - 1
        })
    }

    /// The polygons around a region that consists of faces of the arrangement; `None` if they do not close.
    fn outline(&self, region: &Polygonal) -> Option<Outline> {
        let mut after: Vec<Vec<u32>> = vec![Vec::new(); self.places.len()];
        for &[a, b] in &self.pieces {
            let (from, to) = (&self.places[a as usize], &self.places[b as usize]);
            let edge = minus(to, from);
            let (middle, left) = (along(from, 0.5, &edge), [-edge[1], edge[0]].map(|x| x / norm(&edge)));
            let holds = |side: f64| region.contains(&along(&middle, side * ASIDE * self.same, &left));
            match (holds(1.0), holds(-1.0)) {
                (true, false) => after[a as usize].push(b),
                (false, true) => after[b as usize].push(a),
                _ => {}
            }
        }
        let mut loops = Vec::new();
        for start in 0..after.len() {
            while let Some(next) = after[start].pop() {
                let mut path = vec![start as u32, next];
                while path[path.len() - 1] != start as u32 {
                    let [before, here] = [path[path.len() - 2], path[path.len() - 1]];
                    // Where loops touch, the sharpest turn to the left stays on the same part of the region.
                    let ways = &mut after[here as usize];
                    let turn = |to: u32| self.turning(before, here, to);
                    let sharpest =
                        (0..ways.len()).max_by(|&a, &b| turn(ways[a]).total_cmp(&turn(ways[b])))?;
                    path.push(ways.swap_remove(sharpest));
                }
                path.pop();
                loops.push(self.without_straight_corners(&path));
            }
        }
        loops.retain(|corners| corners.len() > 2);
        Some(Outline { loops })
    }

    /// The angle by which a path turns to the left, [rad].
    fn turning(&self, before: u32, here: u32, after: u32) -> f64 {
        let [a, b, c] = [before, here, after].map(|k| self.places[k as usize]);
        let (u, v) = (minus(&b, &a), minus(&c, &b));
        (u[0] * v[1] - u[1] * v[0]).atan2(dot(&u, &v))
    }

    /// The corners of a polygon at which its sides change their direction.
    fn without_straight_corners(&self, path: &[u32]) -> Vec<[f64; 2]> {
        let place = |k: u32| self.places[k as usize];
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for (k, &here) in path.iter().enumerate() {
            let before = kept.last().copied().unwrap_or_else(|| place(path[path.len() - 1]));
            let after = place(path[(k + 1) % path.len()]);
            let edge = minus(&after, &before);
            let aside = turn(&before, &place(here), &after).abs() / norm(&edge).max(f64::MIN_POSITIVE);
            if aside > self.same || dot(&minus(&place(here), &before), &minus(&after, &place(here))) < 0.0 {
                kept.push(place(here));
            }
        }
        kept
    }
}

/// Where two segments meet, to be added to the cuts of each: their crossing, or the ends of either that lie on the other.
fn meetings(a: &[[f64; 2]; 2], b: &[[f64; 2]; 2], same: f64) -> [Vec<[f64; 2]>; 2] {
    let is_on = |x: &[f64; 2], [from, to]: &[[f64; 2]; 2]| {
        let (edge, arm) = (minus(to, from), minus(x, from));
        let t = (dot(&arm, &edge) / dot(&edge, &edge)).clamp(0.0, 1.0);
        norm(&minus(&arm, &edge.map(|e| t * e))) <= same
    };
    let on_a: Vec<[f64; 2]> = b.iter().filter(|x| is_on(x, a)).copied().collect();
    let on_b: Vec<[f64; 2]> = a.iter().filter(|x| is_on(x, b)).copied().collect();
    if !on_a.is_empty() || !on_b.is_empty() {
        return [on_a, on_b];
    }
    let [u, v] = b.map(|x| turn(&a[0], &a[1], &x));
    let [p, q] = a.map(|x| turn(&b[0], &b[1], &x));
    if (u > 0.0) == (v > 0.0) || (p > 0.0) == (q > 0.0) {
        return [Vec::new(), Vec::new()];
    }
    let crossing = along(&b[0], u / (u - v), &minus(&b[1], &b[0]));
    [vec![crossing], vec![crossing]]
}
