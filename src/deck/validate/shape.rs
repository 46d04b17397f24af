//! The regions that bodies fill.

use super::Check;
use super::geometry::{Extent, GridBox};
use crate::deck::build::pair;
use crate::deck::{GridDeck, Shape, region};

/// Area of a polygon below which it has none, relative to that of the box around it.
const NO_AREA: f64 = 1e-12;

impl Check<'_> {
    /// Checks a region; the extent of a simple box, for the checks that only boxes allow. A grid is given where the
    /// region must not reach beyond it.
    pub(super) fn shape(&mut self, pointer: &str, shape: &Shape, grid: Option<&GridBox>) -> Option<Extent> {
        let before = self.found.len();
        match shape {
            Shape::Box { min, max } => return self.extent(pointer, min, max),
            Shape::Polygon { vertices } => self.polygon(pointer, vertices),
            Shape::Circle { center, .. } => {
                self.vector(&format!("{pointer}/center"), center);
            }
            Shape::Annulus { center, inner, outer } => {
                self.vector(&format!("{pointer}/center"), center);
                if inner >= outer {
                    let message = format!("the inner radius {inner} is not below the outer radius {outer}");
                    self.error("D016", &format!("{pointer}/inner"), message);
                }
            }
            Shape::Cells { group } => {
                if group.is_some() && matches!(self.deck.grid, GridDeck::Structured { .. }) {
                    let message = "a structured grid has no physical groups";
                    let help = "remove `group` to take all cells";
                    self.error_with_help("D031", &format!("{pointer}/group"), message, help);
                }
            }
            Shape::Union { of } => {
                for (k, part) in of.iter().enumerate() {
                    self.part(&format!("{pointer}/of/{k}"), part, grid);
                }
                return None;
            }
            // What reaches beyond the grid may be what is taken away.
            Shape::Difference { from, minus } => {
                self.part(&format!("{pointer}/from"), from, None);
                for (k, part) in minus.iter().enumerate() {
                    self.part(&format!("{pointer}/minus/{k}"), part, None);
                }
                return None;
            }
        }
        if let (Some(grid), Some(bounds)) = (grid, region::bounds(shape))
            && self.found.len() == before
        {
            self.beyond(pointer, bounds, grid);
        }
        None
    }

    /// A region that is part of another one.
    fn part(&mut self, pointer: &str, shape: &Shape, grid: Option<&GridBox>) {
        if let (Some(extent), Some(grid)) = (self.shape(pointer, shape, grid), grid) {
            self.beyond(pointer, [extent.min, extent.max], grid);
        }
    }

    fn beyond(&mut self, pointer: &str, [low, high]: region::Bounds, grid: &GridBox) {
        let Extent { min, max } = grid.extent;
        for (axis, name) in ["x", "y"].iter().enumerate() {
            let slack = 1e-6 * grid.spacing[axis];
            if low[axis] < min[axis] - slack || high[axis] > max[axis] + slack {
                let message = format!(
                    "the region goes from {} to {} along {name}, beyond the grid, which covers {} to {}",
                    low[axis], high[axis], min[axis], max[axis]
                );
                let help = "make the grid larger, or take away what is outside by a `difference`";
                self.error_with_help("D028", pointer, message, help);
            }
        }
    }

    fn polygon(&mut self, pointer: &str, vertices: &[Vec<f64>]) {
        let at = |k: usize| format!("{pointer}/vertices/{k}");
        let known: Vec<_> = vertices.iter().enumerate().map(|(k, v)| self.vector(&at(k), v)).collect();
        if vertices.len() < 3 {
            let message = format!("expected at least 3 entries, found {}", vertices.len());
            self.error("D015", &format!("{pointer}/vertices"), message);
        }
        if vertices.len() < 3 || known.iter().any(Option::is_none) {
            return;
        }
        let x: Vec<[f64; 2]> = vertices.iter().map(|v| pair(v)).collect();
        let n = x.len();
        let bounds = x.iter().fold([x[0], x[0]], |[low, high], v| {
            [[low[0].min(v[0]), low[1].min(v[1])], [high[0].max(v[0]), high[1].max(v[1])]]
        });
        let around = (bounds[1][0] - bounds[0][0]) * (bounds[1][1] - bounds[0][1]);
        let repeated = (0..n).find(|&k| x[k] == x[(k + 1) % n]);
        if around == 0.0 {
            self.error("D016", pointer, "the polygon has no area");
        } else if let Some(k) = repeated {
            let message =
                format!("the corner ({}, {}) of the polygon is listed twice in a row", x[k][0], x[k][1]);
            self.error_with_help(
                "D016",
                &at((k + 1) % n),
                message,
                "remove one; the polygon closes by itself",
            );
        } else if let Some((a, b)) = crossing(&x) {
            let message = format!(
                "the polygon crosses or touches itself: its side from corner {} meets the one from corner {}",
                a + 1,
                b + 1
            );
            let help = "list the corners in order around the region; use `union` and `difference` for others";
            self.error_with_help("D016", &at(b), message, help);
        } else if region::signed_area(vertices).abs() <= NO_AREA * around {
            self.error("D016", pointer, "the polygon has no area");
        }
    }
}

/// Two sides of a closed polygon, not neighbours, that have a position in common; by the numbers of their first corners.
fn crossing(x: &[[f64; 2]]) -> Option<(usize, usize)> {
    let n = x.len();
    let side = |k: usize| (x[k], x[(k + 1) % n]);
    let left = |k: usize| x[k][0].min(x[(k + 1) % n][0]);
    let right = |k: usize| x[k][0].max(x[(k + 1) % n][0]);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| left(a).total_cmp(&left(b)));
    for (place, &a) in order.iter().enumerate() {
        for &b in order[place + 1..].iter().take_while(|&&b| left(b) <= right(a)) {
            let neighbours = (a + 1) % n == b || (b + 1) % n == a;
            if !neighbours && meet(side(a), side(b)) {
                return Some((a.min(b), a.max(b)));
            }
        }
    }
    None
}

/// Whether two segments have a position in common.
fn meet((a, b): ([f64; 2], [f64; 2]), (c, d): ([f64; 2], [f64; 2])) -> bool {
    let turn =
        |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let apart = |i: usize| a[i].max(b[i]) < c[i].min(d[i]) || c[i].max(d[i]) < a[i].min(b[i]);
    !apart(0) && !apart(1) && turn(a, b, c) * turn(a, b, d) <= 0.0 && turn(c, d, a) * turn(c, d, b) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_that_cross_themselves() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(crossing(&square), None);
        assert_eq!(crossing(&[square[0], square[2], square[1], square[3]]), Some((0, 2)));
        let mut clockwise = square;
        clockwise.reverse();
        assert_eq!(crossing(&clockwise), None);
        let notch_to_the_base = [square[0], square[1], square[2], [0.5, 0.0], square[3]];
        assert!(crossing(&notch_to_the_base).is_some());
        assert_eq!(crossing(&[square[0], square[1], square[2], [0.5, 0.1], square[3]]), None);
        assert_eq!(crossing(&square[..3]), None);
    }
}
