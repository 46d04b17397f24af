//! Check that facets meet only at shared corners and edges; exact.

use rayon::prelude::*;

use super::error::SurfaceError;
use super::facets::Facets;
use super::triangle::{Triangle, across, depth, plane_axis};
use crate::region::box_tree::{BoxTree, around, overlap};
use crate::region::polygon::{opposite, segments_meet, turn};

/// Refuses a surface with two facets that cross or touch.
pub(super) fn check(facets: &Facets, tree: &BoxTree<3>) -> Result<(), SurfaceError> {
    let crossed_by = |facet: usize| {
        let triangle = facets.triangle(facet);
        let here = around(&triangle);
        let mut first: Option<usize> = None;
        tree.visit(
            |other| overlap(other, &here),
            |index| {
                let other = tree.order[index] as usize;
                if other > facet && first.is_none_or(|first| other < first) {
                    let pair = [facets.corners[facet], facets.corners[other]];
                    let there = facets.triangle(other);
                    if overlap(&around(&there), &here) && meet(pair, [&triangle, &there]) {
                        first = Some(other);
                    }
                }
            },
        );
        first.map(|other| [facet, other])
    };
    match (0..facets.corners.len()).into_par_iter().find_map_first(crossed_by) {
        None => Ok(()),
        Some(pair) => {
            let [a, b] = pair.map(|facet| around(&facets.triangle(facet)));
            let near = std::array::from_fn(|d| 0.5 * (a[0][d].max(b[0][d]) + a[1][d].min(b[1][d])));
            Err(SurfaceError::Crossing { near, facets: Box::new(pair.map(|facet| facets.report(facet))) })
        }
    }
}

/// True if two facets meet anywhere other than at their shared corners and edge.
fn meet([a, b]: [[u32; 3]; 2], [s, t]: [&Triangle; 2]) -> bool {
    let own = |corners: [u32; 3], other: [u32; 3]| (0..3).filter(move |&k| !other.contains(&corners[k]));
    let (mut own_a, mut own_b) = (own(a, b), own(b, a));
    match (own_a.clone().count(), own_b.clone().count()) {
        (3, 3) => {
            // The facets meet if an edge of one crosses the other.
            let edge = |t: &Triangle, k: usize| [t[k], t[(k + 1) % 3]];
            (0..3).any(|k| segment_meets(&edge(s, k), t) || segment_meets(&edge(t, k), s))
        }
        (2, 2) => {
            // A facet lies between the rays from the shared corner through the ends of its opposite edge.
            let edge = |t: &Triangle, k: [Option<usize>; 2]| k.map(|k| t[k.unwrap_or(0)]);
            let far_a = edge(s, [own_a.next(), own_a.next()]);
            let far_b = edge(t, [own_b.next(), own_b.next()]);
            segment_meets(&far_a, t) || segment_meets(&far_b, s)
        }
        (1, 1) => match (own_a.next(), own_b.next()) {
            (Some(i), Some(j)) => folded(s, i, &t[j]),
            _ => false,
        },
        // Both facets have the same corners.
        _ => true,
    }
}

/// True if a facet that shares the edge opposite to corner `k` and has its third corner at x is folded onto this facet.
fn folded(s: &Triangle, k: usize, x: &[f64; 3]) -> bool {
    if depth(s, x) != 0.0 {
        return false;
    }
    let Some(axis) = plane_axis(s) else { return true };
    let flat = |x: &[f64; 3]| across(x, axis);
    let (a, b) = (flat(&s[(k + 1) % 3]), flat(&s[(k + 2) % 3]));
    !opposite(turn(&a, &b, &flat(&s[k])), turn(&a, &b, &flat(x)))
}

/// True if a segment and a triangle have a common position.
pub(super) fn segment_meets(segment: &[[f64; 3]; 2], t: &Triangle) -> bool {
    let [p, q] = segment;
    let (above, below) = (depth(t, p), depth(t, q));
    if !opposite(above, below) {
        return false;
    }
    if above == 0.0 && below == 0.0 {
        return segment_meets_in_plane(segment, t);
    }
    // The line crosses the triangle if it passes all edges on the same side.
    let side = |k: usize| depth(&[*p, *q, t[k]], &t[(k + 1) % 3]);
    let sides = [side(0), side(1), side(2)];
    !(sides.iter().any(|x| *x > 0.0) && sides.iter().any(|x| *x < 0.0))
}

fn segment_meets_in_plane([p, q]: &[[f64; 3]; 2], t: &Triangle) -> bool {
    let Some(axis) = plane_axis(t) else { return true };
    let corner = t.map(|x| across(&x, axis));
    let (p, q) = (across(p, axis), across(q, axis));
    let edge = |k: usize| [&corner[k], &corner[(k + 1) % 3]];
    let inside = |x: &[f64; 2]| {
        let turns = [0, 1, 2].map(|k| turn(edge(k)[0], edge(k)[1], x));
        !(turns.iter().any(|x| *x > 0.0) && turns.iter().any(|x| *x < 0.0))
    };
    inside(&p) || (0..3).any(|k| segments_meet([&p, &q], edge(k)))
}
