//! The interior of a closed surface.

use super::closed::Shells;
use super::error::SurfaceError;
use super::facets::Facets;
use super::triangle::{Triangle, depth, volume};
use crate::region::box_tree::BoxTree;
use crate::region::polygon::{passes_right_of, turn};
use crate::region::vector::{dot, frame, minus};
use crate::region::{Intervals, Line};

/// Visits the facets above a position. `visit` receives the index in tree order, and +1 if the upward ray leaves
/// through the facet, −1 if the ray enters. A ray through an edge counts as passing just beside the edge. A facet
/// through the position counts as above.
fn each_above(triangles: &[Triangle], tree: &BoxTree<3>, x: &[f64; 3], mut visit: impl FnMut(usize, i32)) {
    let flat = |x: &[f64; 3]| [x[0], x[1]];
    tree.visit(
        |[low, high]| {
            low[0] <= x[0] && x[0] <= high[0] && low[1] <= x[1] && x[1] <= high[1] && x[2] <= high[2]
        },
        |index| {
            let t = &triangles[index];
            let [a, b, c] = t.each_ref().map(flat);
            let passes = |a: &[f64; 2], b: &[f64; 2]| passes_right_of(a, b, &flat(x));
            if passes(&a, &b) ^ passes(&b, &c) ^ passes(&c, &a) {
                let upward = if turn(&a, &b, &c) > 0.0 { 1 } else { -1 };
                if depth(t, x) * f64::from(upward) >= 0.0 {
                    visit(index, upward);
                }
            }
        },
    );
}

/// Winding number of the surface around a position.
pub(super) fn winding(triangles: &[Triangle], tree: &BoxTree<3>, x: &[f64; 3]) -> i32 {
    let mut sum = 0;
    each_above(triangles, tree, x, |_, upward| sum += upward);
    sum
}

/// Refuses inside-out shells: a shell inside an even number of others must enclose a positive volume, and one inside an
/// odd number a cavity. `shell_of` is in tree order.
pub(super) fn check_orientation(
    facets: &Facets,
    shells: &Shells,
    triangles: &[Triangle],
    tree: &BoxTree<3>,
    shell_of: &[u32],
) -> Result<(), SurfaceError> {
    let mut members: Vec<Vec<Triangle>> = vec![Vec::new(); shells.number];
    let mut first = vec![usize::MAX; shells.number];
    for (facet, &shell) in shells.by_facet.iter().enumerate() {
        members[shell as usize].push(facets.triangle(facet));
        first[shell as usize] = first[shell as usize].min(facet);
    }
    for (shell, own) in members.iter().enumerate() {
        // Shells may touch at a corner, but the centre of a facet lies on no other shell.
        let around = middle(&own[0]);
        let mut windings = vec![];
        each_above(triangles, tree, &around, |facet, upward| windings.push((shell_of[facet], upward)));
        windings.retain(|(other, _)| *other as usize != shell);
        windings.sort_unstable();
        let around_it = windings
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|shell| shell.iter().map(|(_, up)| up).sum::<i32>() != 0);
        let cavity = around_it.count() % 2 == 1;
        if (volume(own) > 0.0) == cavity {
            return Err(SurfaceError::InsideOut { cavity, at: facets.report(first[shell]) });
        }
    }
    Ok(())
}

fn middle(t: &Triangle) -> [f64; 3] {
    std::array::from_fn(|d| (t[0][d] + t[1][d] + t[2][d]) / 3.0)
}

/// Relative widening of boxes for the round-off of lines that are not parallel to an axis.
const WIDER: f64 = 1e-12;

/// The intervals of a line inside the surface.
///
/// Corners are projected onto a plane across the line. The projections have round-off, but each corner has one
/// projection for all its facets, and the test whether the line passes through a projected facet is exact: crossings
/// always come in pairs.
pub(super) fn intervals(triangles: &[Triangle], tree: &BoxTree<3>, line: &Line<3>) -> Intervals {
    let [e, f] = frame(&line.direction);
    let squared = dot(&line.direction, &line.direction);
    let [low, high] = tree.bounds();
    let size = (0..3).fold(0.0f64, |m, d| m.max(low[d].abs()).max(high[d].abs()).max(line.origin[d].abs()));
    let mut crossings = Vec::new();
    tree.visit(
        |bounds| passes(line, bounds, WIDER * size),
        |index| {
            let corners = triangles[index].map(|x| {
                let r = minus(&x, &line.origin);
                ([dot(&e, &r), dot(&f, &r)], dot(&line.direction, &r) / squared)
            });
            let across = corners.map(|(across, _)| across);
            let [a, b, c] = &across;
            let right = |a: &[f64; 2], b: &[f64; 2]| passes_right_of(a, b, &[0.0; 2]);
            if right(a, b) ^ right(b, c) ^ right(c, a) {
                crossings.push(parameter_along(&across, corners.map(|(_, parameter)| parameter)));
            }
        },
    );
    Intervals::from_crossings(crossings)
}

/// Parameter at which the line crosses a facet, given the projections of its corners across the line, in which the line
/// is the origin, and the parameters of the corners along the line.
fn parameter_along(across: &[[f64; 2]; 3], [s, t, u]: [f64; 3]) -> f64 {
    let area = |k: usize| {
        let [a, b] = [across[(k + 1) % 3], across[(k + 2) % 3]];
        a[0] * b[1] - a[1] * b[0]
    };
    let weights = [area(0), area(1), area(2)];
    let mean = (weights[0] * s + weights[1] * t + weights[2] * u) / weights.iter().sum::<f64>();
    let (low, high) = (s.min(t).min(u), s.max(t).max(u));
    // A facet seen edge-on contributes round-off only.
    if mean.is_finite() { mean.clamp(low, high) } else { 0.5 * (low + high) }
}

/// True if a line passes through a box widened on all sides.
fn passes(line: &Line<3>, [low, high]: &[[f64; 3]; 2], wider: f64) -> bool {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for d in 0..3 {
        let (from, to) = (low[d] - wider - line.origin[d], high[d] + wider - line.origin[d]);
        let step = line.direction[d];
        if step == 0.0 {
            if from > 0.0 || to < 0.0 {
                return false;
            }
        } else {
            let (s, t) = (from / step, to / step);
            enter = enter.max(s.min(t));
            leave = leave.min(s.max(t));
        }
    }
    enter <= leave
}
