//! The outer sides of domains: those that no other domain of their body shares.
//!
//! Sides are compared where the domains were at the start, so that neither the gaps and overlaps that updates of boxes
//! and parallelograms leave, nor any motion of the body, matter: points keep their neighbours until they are split,
//! removed or joined by others.

use rustc_hash::FxHashMap;

use crate::grid::MAX_CORNERS;
use crate::grid::element::{Collapsed, ElementShape, corner_side};
use crate::grid::vtk_corner;
use crate::points::Points;
use crate::ranks::Reduction;
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{BoxTree, area_vector, around};

/// Size of the lattice in which centres of sides count as the same place, relative to the smallest side, [-].
const SAME: f64 = 1e-4;
/// Origin of this lattice in units of its size, [-]: a number that no grid has as a coordinate, so that round-off does
/// not move centres from one cell of the lattice to the next.
const ORIGIN: f64 = 0.347_296_355_333_860_7;
/// Distance beyond a side at which another domain is looked for, relative to the size of the domain, [-].
const BEYOND: f64 = 1e-3;
/// Distance within which sides of two domains lie in one plane, relative to the size of a domain, [-], and cosine of the
/// angle between their normals below which they face each other, [-].
const NEAR: f64 = 0.05;
const OPPOSITE: f64 = -0.9;

/// A side of a domain, as the numbers of its corners in cyclic order.
#[derive(Debug, Clone, Copy)]
pub struct DomainSide {
    corners: [usize; 4],
    count: usize,
}

impl DomainSide {
    /// The numbers of its corners in the domain, in cyclic order, counterclockwise as seen from outside.
    pub fn corners(&self) -> &[usize] {
        &self.corners[..self.count]
    }

    /// The centre of the side of a domain with these corners, [length].
    pub fn centre<const D: usize>(&self, domain: &[[f64; D]]) -> [f64; D] {
        let sum = |d: usize| self.corners().iter().map(|&k| domain[k][d]).sum::<f64>();
        std::array::from_fn(|d| sum(d) / self.count as f64)
    }

    /// The outward normal of the side of a domain with these corners times its area, [length^(D−1)].
    pub fn area<const D: usize>(&self, domain: &[[f64; D]]) -> [f64; D] {
        let facet = |second: usize| -> [f64; D] {
            area_vector(&std::array::from_fn(|k| {
                domain[self.corners[if k == 0 { 0 } else { second + k - 1 }]]
            }))
        };
        let area = facet(1);
        if self.count > 3 { along(&area, 1.0, &facet(2)) } else { area }
    }
}

/// The sides of a domain with this number of corners.
pub fn sides_of_domain<const D: usize>(corners: usize) -> impl Iterator<Item = DomainSide> {
    let shape = ElementShape::from_nodes::<D>(corners);
    let collapsed = || Collapsed::from_corners::<D>(corners).map_or(&[][..], Collapsed::sides);
    let sides = shape.map_or_else(collapsed, ElementShape::sides::<D>);
    sides.iter().map(move |side| {
        let mut corners = [0; 4];
        for (corner, &k) in corners.iter_mut().zip(*side) {
            *corner = if shape == Some(ElementShape::Box) { vtk_corner(k) } else { k };
        }
        DomainSide { corners, count: side.len() }
    })
}

/// The corners of the domain of a point at the start, [length]; none if it has no domain.
fn original_corners<'a, const D: usize>(
    points: &'a Points<D>,
    p: usize,
    buffer: &'a mut [[f64; D]; MAX_CORNERS],
) -> &'a [[f64; D]] {
    let range = points.corner_range(p);
    if !range.is_empty() {
        return &points.original_corners[range];
    }
    let half = points.original_half_lengths.get(p).copied().unwrap_or([0.0; D]);
    if half.iter().all(|l| *l == 0.0) {
        return &[];
    }
    let x = &points.original_position[p];
    box_corners(buffer, |side| std::array::from_fn(|d| x[d] + side[d] * half[d]))
}

/// Number of corners of the domain of a point that has one.
pub fn corner_count<const D: usize>(points: &Points<D>, p: usize) -> usize {
    match points.corner_range(p).len() {
        0 => 1 << D,
        n => n,
    }
}

/// The corners of the domain of a point in the converged state, [length]: those of a box as the deformation gradient
/// has moved them, which leaves neither gaps nor overlaps between neighbours in a uniform deformation, unlike the box
/// itself.
pub fn deformed_corners<'a, const D: usize>(
    points: &'a Points<D>,
    p: usize,
    buffer: &'a mut [[f64; D]; MAX_CORNERS],
) -> &'a [[f64; D]] {
    if !points.corners(p).is_empty() {
        return points.corners(p);
    }
    let half = points.original_half_lengths.get(p).copied().unwrap_or([0.0; D]);
    let (x, f) = (&points.converged.position[p], &points.converged.deformation_gradient[p]);
    box_corners(buffer, |side| {
        std::array::from_fn(|i| x[i] + (0..D).map(|j| f[(i, j)] * side[j] * half[j]).sum::<f64>())
    })
}

/// The corners of the domain of a point in the converged state, [length]; the point itself if it has no domain.
pub fn corners_of<'a, const D: usize>(
    points: &'a Points<D>,
    p: usize,
    buffer: &'a mut [[f64; D]; MAX_CORNERS],
) -> &'a [[f64; D]] {
    let corners = points.corners(p);
    if !corners.is_empty() {
        return corners;
    }
    let (x, l) = (&points.converged.position[p], points.half_lengths(p));
    if l == [0.0; D] {
        buffer[0] = *x;
        return &buffer[..1];
    }
    box_corners(buffer, |side| std::array::from_fn(|d| x[d] + side[d] * l[d]))
}

/// The corners of a box in the order of their numbers; `place` gives the corner on these sides along the axes.
pub(super) fn box_corners<const D: usize>(
    buffer: &mut [[f64; D]; MAX_CORNERS],
    place: impl Fn([f64; D]) -> [f64; D],
) -> &[[f64; D]] {
    for (k, corner) in buffer.iter_mut().enumerate().take(1 << D) {
        *corner = place(corner_side::<D>(k));
    }
    &buffer[..1 << D]
}

/// The outer sides of the domains of all points.
#[derive(Debug, Clone, Default)]
pub struct OuterSides {
    /// A bit for each outer side of the domains that have any, by the permanent number of the point.
    of_point: FxHashMap<u32, u8>,
    /// The points to which this belongs, as [`census`] counts them.
    census: [f64; 3],
}

impl OuterSides {
    /// A bit for each outer side of the domain of a point with this permanent number; bit k is side k of
    /// [`sides_of_domain`].
    pub fn of_point(&self, id: u32) -> u8 {
        self.of_point.get(&id).copied().unwrap_or(0)
    }

    /// Finds the outer sides anew if points have been added, removed or split. All ranks must call this together.
    pub fn find<const D: usize>(&mut self, points: &Points<D>, reduction: &Reduction) {
        let census = census(points, reduction);
        if census == self.census {
            return;
        }
        let single = reduction.gather_all(unmatched(points, reduction));
        let mut all: Vec<u64> = single.into_iter().flatten().collect();
        keep_single(&mut all);
        let suspects = with_side_among(points, &all, reduction);
        let own: Vec<(u32, u8)> = (suspects.into_iter())
            .map(|(p, mask)| (points.id[p], mask))
            .filter(|(_, mask)| *mask != 0)
            .collect();
        self.of_point = reduction.gather_all(own).into_iter().flatten().collect();
        self.census = census;
    }
}

/// Three numbers that differ if the points differ: their number, and two sums over their permanent numbers.
fn census<const D: usize>(points: &Points<D>, reduction: &Reduction) -> [f64; 3] {
    let scattered = |id: u32| f64::from(id.wrapping_mul(0x9E37_79B1) >> 12);
    let sum = |value: &dyn Fn(u32) -> f64| reduction.total(points.id.iter().map(|&id| value(id)).sum());
    [sum(&|_| 1.0), sum(&f64::from), sum(&scattered)]
}

/// Calls `visit` with a point, the number of a side of its domain, and a number that sides with the same centre share.
fn each_side<const D: usize>(
    points: &Points<D>,
    reduction: &Reduction,
    mut visit: impl FnMut(usize, usize, u64),
) {
    let mut buffer = [[0.0; D]; MAX_CORNERS];
    let edge = |corners: &[[f64; D]]| corners.get(1).map_or(f64::INFINITY, |x| norm(&minus(x, &corners[0])));
    let mut smallest = f64::INFINITY;
    for p in 0..points.len() {
        smallest = smallest.min(edge(original_corners(points, p, &mut buffer)));
    }
    let width = SAME * reduction.smallest(smallest);
    for p in 0..points.len() {
        let corners = original_corners(points, p, &mut buffer);
        for (number, side) in sides_of_domain::<D>(corners.len()).enumerate() {
            let centre = side.centre(corners);
            let mut key = u64::from(points.body[p]);
            for x in centre {
                let cell = (x / width + ORIGIN).floor() as i64;
                key = (key.rotate_left(23) ^ cell as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            }
            visit(p, number, key);
        }
    }
}

/// The sides of this rank's domains that no other domain of this rank shares.
fn unmatched<const D: usize>(points: &Points<D>, reduction: &Reduction) -> Vec<u64> {
    let mut keys = Vec::new();
    each_side(points, reduction, |_, _, key| keys.push(key));
    keep_single(&mut keys);
    keys
}

/// Keeps the numbers that occur once, in ascending order.
fn keep_single(keys: &mut Vec<u64>) {
    keys.sort_unstable();
    let mut kept = 0;
    for k in 0..keys.len() {
        if (k == 0 || keys[k - 1] != keys[k]) && keys.get(k + 1) != Some(&keys[k]) {
            keys[kept] = keys[k];
            kept += 1;
        }
    }
    keys.truncate(kept);
}

/// The points of this rank with a side among these, which are in ascending order, with a bit for each such side behind
/// which no other of these domains lies: a long side may have two shorter ones beyond it.
fn with_side_among<const D: usize>(
    points: &Points<D>,
    single: &[u64],
    reduction: &Reduction,
) -> Vec<(usize, u8)> {
    let mut found: Vec<(usize, u8)> = Vec::new();
    each_side(points, reduction, |p, number, key| {
        if single.binary_search(&key).is_ok() {
            match found.last_mut().filter(|(last, _)| *last == p) {
                Some((_, mask)) => *mask |= 1 << number,
                None => found.push((p, 1 << number)),
            }
        }
    });
    let domain = |p: usize| {
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        original_corners(points, p, &mut buffer).to_vec()
    };
    let domains: Vec<Vec<[f64; D]>> = found.iter().map(|(p, _)| domain(*p)).collect();
    let boxes: Vec<_> = domains.iter().map(|corners| around(corners)).collect();
    let tree = BoxTree::new(&boxes);
    // True if a domain has such a side that faces one with this centre and area vector: where sides are warped, a domain
    // beside another one may reach beyond its side, too.
    let faces = |index: usize, centre: &[f64; D], area: &[f64; D]| {
        let (corners, [low, high]) = (&domains[index], boxes[index]);
        let depth = NEAR * norm(&minus(&high, &low)) * norm(area);
        let mut sides = sides_of_domain::<D>(corners.len()).enumerate();
        sides.any(|(k, side)| {
            let (own, place) = (side.area(corners), side.centre(corners));
            found[index].1 >> k & 1 == 1
                && dot(&own, area) < OPPOSITE * norm(&own) * norm(area)
                && dot(&minus(&place, centre), area).abs() < depth
        })
    };
    let is_covered = |index: usize, side: DomainSide| {
        let (corners, p) = (&domains[index], found[index].0);
        let (centre, area) = (side.centre(corners), side.area(corners));
        let [low, high] = boxes[index];
        let x = along(&centre, BEYOND * norm(&minus(&high, &low)) / norm(&area), &area);
        let is_around = |[low, high]: &[[f64; D]; 2]| (0..D).all(|d| low[d] <= x[d] && x[d] <= high[d]);
        let mut covered = false;
        tree.visit(is_around, |item| {
            let other = tree.order[item] as usize;
            let is_neighbour = other != index && points.body[found[other].0] == points.body[p];
            covered |= is_neighbour && contains(&domains[other], &x) && faces(other, &centre, &area);
        });
        covered
    };
    let masks: Vec<u8> = (0..found.len())
        .map(|index| {
            let sides = sides_of_domain::<D>(domains[index].len()).enumerate();
            let open = sides.filter(|(k, side)| found[index].1 >> k & 1 == 1 && !is_covered(index, *side));
            open.fold(0, |mask, (k, _)| mask | 1 << k)
        })
        .collect();
    found.iter().zip(masks).map(|((p, _), mask)| (*p, mask)).collect()
}

/// True if a convex domain with these corners contains a position.
pub fn contains<const D: usize>(domain: &[[f64; D]], x: &[f64; D]) -> bool {
    let is_below = |side: DomainSide| dot(&minus(x, &side.centre(domain)), &side.area(domain)) <= 0.0;
    sides_of_domain::<D>(domain.len()).all(is_below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Method;
    use crate::grid::Structured;
    use crate::material::Hencky;
    use crate::model::{Builder, Fill};

    /// The outer sides of a block of 2 by 1 cells with a hole of one domain, as a count, and the sum of their area
    /// vectors.
    fn outer(method: Method, is_hole: bool) -> (u32, [f64; 2]) {
        let fill = Fill { method, ..Fill::default() };
        let solid = move |x: &[f64; 2]| {
            let is_in_hole = is_hole && (x[0] - 1.25).abs() < 0.2 && (x[1] - 0.75).abs() < 0.2;
            x[0] < 2.0 && x[1] < 1.0 && !is_in_hole
        };
        let (_, points) = Builder::new(Structured::new([0.0; 2], [1.0; 2], [3, 2]))
            .material("clay", Hencky::new(1e6, 0.3))
            .body("clay", "clay", fill, solid)
            .build()
            .unwrap();
        let mut outer = OuterSides::default();
        outer.find(&points, &Reduction::default());
        let (mut count, mut sum) = (0, [0.0; 2]);
        let mut buffer = [[0.0; 2]; MAX_CORNERS];
        for p in 0..points.len() {
            let mask = outer.of_point(points.id[p]);
            count += mask.count_ones();
            let corners = deformed_corners(&points, p, &mut buffer);
            for (k, side) in sides_of_domain::<2>(corners.len()).enumerate() {
                if mask >> k & 1 == 1 {
                    sum = along(&sum, 1.0, &side.area(corners));
                }
            }
        }
        (count, sum)
    }

    #[test]
    fn outer_sides_surround_the_body_and_its_hole() {
        for method in [Method::Gimp, Method::Cpdi1, Method::Cpdi2] {
            // Two points along each axis of a cell: four domains along the block, two across.
            let (count, sum) = outer(method, false);
            assert_eq!(count, 12, "{method:?}");
            assert!(norm(&sum) < 1e-15, "{method:?}: {sum:?}");
            let (count, sum) = outer(method, true);
            // The hole opens at the upper side: three new sides, and one less.
            assert_eq!(count, 14, "{method:?}");
            assert!(norm(&sum) < 1e-15, "{method:?}: {sum:?}");
        }
    }

    #[test]
    fn sides_face_outward() {
        let mut buffer = [[0.0; 3]; MAX_CORNERS];
        let corners = box_corners(&mut buffer, |side| side);
        for side in sides_of_domain::<3>(8) {
            let (centre, area) = (side.centre(corners), side.area(corners));
            assert_eq!(area, centre.map(|x| 4.0 * x));
        }
    }

    #[test]
    fn numbers_that_occur_once_are_kept() {
        let mut numbers = vec![5, 1, 4, 4, 2, 1, 7, 1];
        keep_single(&mut numbers);
        assert_eq!(numbers, [2, 5, 7]);
    }
}
