//! The overlap of the domains of the points.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::basis::DomainKind;
use crate::model::Model;
use crate::points::Points;

/// Side of the bins that domains are sorted into, relative to the mean extent of a domain, [-].
const BIN: f64 = 2.0;
/// Largest number of bins after the first that one domain may reach into along an axis; the rest of a larger domain is
/// ignored.
const MAX_BINS: i64 = 1000;

/// A domain: its bounding box and, for a quadrilateral in the plane that is not a box, its two triangles.
pub(super) struct Domain<const D: usize> {
    pub(super) low: [f64; D],
    pub(super) high: [f64; D],
    /// Two triangles, counterclockwise.
    pub(super) halves: Option<[[[f64; 2]; 3]; 2]>,
}

/// Volume shared by the domains of the converged state, summed over all pairs of points, relative to the total volume
/// of the domains, [-]; for bodies of revolution, in the meridional section. `None` without domains, with triangular
/// domains, and in space with domains given by corners. All ranks must call this together.
pub fn domain_overlap<const D: usize>(model: &Model<D>, points: &Points<D>) -> Option<f64> {
    let reduction = &points.reduction();
    let own = domains_of(model, points);
    if reduction.any(own.is_none()) {
        return None;
    }
    let mut domains = own?;
    let total = reduction.total(domains.iter().map(Domain::volume).sum());
    if !total.is_finite() || total <= 0.0 {
        return None;
    }
    let n_own = domains.len();
    let lower = Domain::from_lower_ranks(&points.ranks, &domains);
    domains.extend(lower);
    Some(reduction.total(shared_by_pairs(&domains, n_own)) / total)
}

/// The domains of the points of this rank; `None` if some cannot be intersected with others.
fn domains_of<const D: usize>(model: &Model<D>, points: &Points<D>) -> Option<Vec<Domain<D>>> {
    let mut domains = Vec::new();
    for p in 0..points.len() {
        match model.bodies[points.body[p] as usize].method.domain() {
            DomainKind::None => {}
            DomainKind::Box => {
                let (x, l) = (&points.converged.position[p], &points.converged.half_lengths[p]);
                let (low, high) =
                    (std::array::from_fn(|d| x[d] - l[d]), std::array::from_fn(|d| x[d] + l[d]));
                domains.push(Domain { low, high, halves: None });
            }
            DomainKind::Corners => domains.push(quadrilateral(points.corners(p))?),
        }
    }
    Some(domains)
}

/// Volume shared by two domains, summed over all pairs that contain at least one of the first `n_own` domains.
#[inline(never)]
fn shared_by_pairs<const D: usize>(domains: &[Domain<D>], n_own: usize) -> f64 {
    let mean: f64 = domains.iter().map(Domain::extent).sum::<f64>() / domains.len() as f64;
    let bin = |x: f64| (x / (BIN * mean)).floor() as i64;
    let mut bins: HashMap<[i64; D], Vec<u32>> = HashMap::new();
    for (number, domain) in domains.iter().enumerate() {
        let first = domain.low.map(bin);
        let last: [i64; D] =
            std::array::from_fn(|d| bin(domain.high[d]).min(first[d].saturating_add(MAX_BINS)));
        for_each_index(first, last, |index| bins.entry(index).or_default().push(number as u32));
    }
    // Sorting the bins makes the sum reproducible.
    let mut bins: Vec<([i64; D], Vec<u32>)> = bins.into_iter().collect();
    bins.sort_unstable();
    let shared: Vec<f64> = bins
        .par_iter()
        .map(|(index, members)| {
            let mut sum = 0.0;
            // The numbers ascend, so that the domains of this rank come first.
            for (place, &a) in members.iter().enumerate().filter(|(_, a)| (**a as usize) < n_own) {
                for &b in &members[place + 1..] {
                    let (a, b) = (&domains[a as usize], &domains[b as usize]);
                    let low: [f64; D] = std::array::from_fn(|d| a.low[d].max(b.low[d]));
                    let meet = (0..D).all(|d| low[d] < a.high[d].min(b.high[d]));
                    // A pair is counted in the bin where the overlap of its boxes begins.
                    if meet && low.map(bin) == *index {
                        sum += shared_volume(a, b);
                    }
                }
            }
            sum
        })
        .collect();
    shared.iter().sum::<f64>()
}

/// A domain given by corners, in the plane.
fn quadrilateral<const D: usize>(corners: &[[f64; D]]) -> Option<Domain<D>> {
    if D != 2 || corners.len() != 4 {
        return None;
    }
    let x = |k: usize| [corners[k][0], corners[k][1]];
    // Corners are numbered by bits; their cyclic order is 0, 1, 3, 2. The domain is cut along the diagonal that lies
    // inside it.
    let [a, b, c, d] = [x(0), x(1), x(3), x(2)];
    let inner = |halves: [[[f64; 2]; 3]; 2]| halves.iter().all(|half| area(half) >= 0.0);
    let along = [[a, b, c], [a, c, d]];
    let halves = if inner(along) { along } else { [[a, b, d], [b, c, d]] };
    let fold = |least: fn(f64, f64) -> f64| {
        std::array::from_fn(|d| corners.iter().map(|x| x[d]).reduce(least).unwrap_or(0.0))
    };
    Some(Domain { low: fold(f64::min), high: fold(f64::max), halves: Some(halves) })
}

impl<const D: usize> Domain<D> {
    fn volume(&self) -> f64 {
        match &self.halves {
            None => (0..D).map(|d| self.high[d] - self.low[d]).product(),
            Some(halves) => halves.iter().map(|half| area(half)).sum(),
        }
    }

    /// Longest side of the bounding box, [length].
    fn extent(&self) -> f64 {
        (0..D).map(|d| self.high[d] - self.low[d]).fold(0.0, f64::max)
    }

    /// The domain as convex polygons in the plane, with 3 or 4 corners.
    fn polygons(&self) -> Vec<Vec<[f64; 2]>> {
        match &self.halves {
            Some(halves) => halves.iter().map(|half| half.to_vec()).collect(),
            None => {
                let ([l, b], [r, t]) = ([self.low[0], self.low[1]], [self.high[0], self.high[1]]);
                vec![vec![[l, b], [r, b], [r, t], [l, t]]]
            }
        }
    }
}

/// Volume (area) shared by two domains.
fn shared_volume<const D: usize>(a: &Domain<D>, b: &Domain<D>) -> f64 {
    if a.halves.is_none() && b.halves.is_none() {
        return (0..D).map(|d| a.high[d].min(b.high[d]) - a.low[d].max(b.low[d])).product();
    }
    let (in_a, in_b) = (a.polygons(), b.polygons());
    in_a.iter().flat_map(|p| in_b.iter().map(move |q| shared_area(p, q))).sum()
}

/// Area of the intersection of two convex counterclockwise polygons, by clipping the first against the sides of the
/// second.
fn shared_area(polygon: &[[f64; 2]], window: &[[f64; 2]]) -> f64 {
    let mut rest = polygon.to_vec();
    for (k, &a) in window.iter().enumerate() {
        let b = window[(k + 1) % window.len()];
        let left = |x: &[f64; 2]| (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0]);
        let mut kept = Vec::with_capacity(rest.len() + 1);
        for (k, &from) in rest.iter().enumerate() {
            let to = rest[(k + 1) % rest.len()];
            let (s, t) = (left(&from), left(&to));
            if s >= 0.0 {
                kept.push(from);
            }
            if s * t < 0.0 {
                let part = s / (s - t);
                kept.push([from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])]);
            }
        }
        rest = kept;
    }
    area(&rest).max(0.0)
}

/// Area of a polygon, positive if its corners are counterclockwise.
fn area(corners: &[[f64; 2]]) -> f64 {
    let Some(&about) = corners.first() else { return 0.0 };
    let from = |x: [f64; 2]| [x[0] - about[0], x[1] - about[1]];
    let twice = corners.windows(2).map(|side| {
        let (a, b) = (from(side[0]), from(side[1]));
        a[0] * b[1] - a[1] * b[0]
    });
    0.5 * twice.sum::<f64>()
}

/// Calls `visit` with every index from `first` to `last`, both included, along each axis.
fn for_each_index<const D: usize>(first: [i64; D], last: [i64; D], mut visit: impl FnMut([i64; D])) {
    let mut index = first;
    loop {
        visit(index);
        let Some(axis) = (0..D).find(|&d| index[d] < last[d]) else { return };
        index[axis] += 1;
        index[..axis].copy_from_slice(&first[..axis]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_of_intersections() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let moved = square.map(|[x, y]| [x + 0.5, y + 0.25]);
        assert!((shared_area(&square, &moved) - 0.375).abs() < 1e-15);
        assert_eq!(shared_area(&square, &square.map(|[x, y]| [x + 1.0, y])), 0.0);
        let inner = [[0.25, 0.25], [0.75, 0.25], [0.5, 0.75]];
        assert!((shared_area(&square, &inner) - 0.125).abs() < 1e-15);
        assert!((shared_area(&inner, &square) - 0.125).abs() < 1e-15);
    }

    #[test]
    fn a_dart_is_cut_along_the_diagonal_inside_it() {
        // Corners are numbered by bits; the corner at (0.2, 0.2) is re-entrant.
        for (corners, exact) in [
            ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.2, 0.2]], 0.2),
            ([[0.0, 0.0], [1.0, -1.0], [-1.0, 1.0], [0.2, 0.2]], 0.4),
        ] {
            let domain = quadrilateral(&corners).unwrap();
            assert!((domain.volume() - exact).abs() < 1e-15, "{}", domain.volume());
            let halves = domain.halves.unwrap();
            assert!(halves.iter().all(|half| area(half) > 0.0));
        }
    }
}
