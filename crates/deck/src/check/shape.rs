//! The regions that bodies fill.

use super::Check;
use super::extent::{Extent, GridBox};
use crate::per_axis::array;
use crate::region::{DeckRegion, Direction, Refusal, WithoutFiles, region};
use crate::{AXES, GridDeck, Parameter, Shape};
use mpm_core::region::{Polygon, Primitive, Region, ShapeError, crossing_sides};

/// Area of a polygon, relative to its bounding box, below which it counts as zero.
const NO_AREA: f64 = 1e-12;

impl Check<'_> {
    /// Checks a region; returns the extent of a simple box, for the checks that only boxes allow. `grid` is given if
    /// the region must not reach beyond it.
    pub(super) fn shape(&mut self, pointer: &str, shape: &Shape, grid: Option<&GridBox>) -> Option<Extent> {
        if let Some(needed) = shape.dimensions().filter(|needed| *needed != self.dimensions()) {
            let what = format!("a region of type `{}`", shape.word());
            self.wrong_dimension(&format!("{pointer}/type"), &what, needed);
            return None;
        }
        if let Shape::Box { min, max } = shape {
            return self.extent(pointer, min, max);
        }
        let before = self.found.len();
        self.numbers(pointer, shape);
        // A part beyond the grid may be subtracted, or moved into the grid.
        let part_grid = grid.filter(|_| matches!(shape, Shape::Union { .. }));
        for (key, part) in shape.parts() {
            self.part(&format!("{pointer}/{key}"), part, part_grid);
        }
        if self.found.len() > before {
            return None;
        }
        match self.bounds(pointer, shape) {
            Err(Refusal::Numbers(place, error)) => self.no_region(&place, &error),
            Err(Refusal::Unknown) => {}
            Ok(bounds) => {
                if let Some(grid) = grid.filter(|_| is_tight(shape)) {
                    self.beyond(pointer, &bounds, grid);
                }
            }
        }
        None
    }

    /// Checks a region that is part of another one.
    fn part(&mut self, pointer: &str, shape: &Shape, grid: Option<&GridBox>) {
        if let (Some(extent), Some(grid)) = (self.shape(pointer, shape, grid), grid) {
            self.beyond(pointer, &extent, grid);
        }
    }

    /// Bounds of a region at a JSON pointer of the deck, as far as they are known without reading any file.
    pub(super) fn bounds(&self, pointer: &str, shape: &Shape) -> Result<Extent, Refusal> {
        match self.dimensions() {
            3 => self.bounds_in::<3>(pointer, shape),
            _ => self.bounds_in::<2>(pointer, shape),
        }
    }

    fn bounds_in<const D: usize>(&self, pointer: &str, shape: &Shape) -> Result<Extent, Refusal>
    where
        Region<D>: DeckRegion<D>,
    {
        let grid = match &self.deck.grid {
            GridDeck::Structured { origin, size, .. } => {
                let (low, size): ([f64; D], [f64; D]) = (array(origin), array(size));
                Some([low, std::array::from_fn(|d| low[d] + size[d])])
            }
            GridDeck::Gmsh { .. } => None,
        };
        let [low, high] = region(shape, pointer, &mut WithoutFiles { grid })?.bounds();
        Ok(Extent { min: low.to_vec(), max: high.to_vec() })
    }

    fn no_region(&mut self, pointer: &str, error: &ShapeError) {
        // The schema checks ranges of single numbers and empty lists.
        if !matches!(error, ShapeError::NotPositive { .. } | ShapeError::NoParts) {
            let help = "change the numbers so that they enclose a region";
            self.error("D016", pointer, format!("this is not a region: {error}"), help);
        }
    }

    /// Checks the numbers of a region, except those of its parts.
    fn numbers(&mut self, pointer: &str, shape: &Shape) {
        let at = |key: &str| format!("{pointer}/{key}");
        match shape {
            Shape::Polygon { vertices } => self.polygon(pointer, "vertices", vertices),
            Shape::Circle { center, .. } | Shape::Sphere { center, .. } => {
                self.vector(&at("center"), center);
            }
            Shape::Annulus { center, inner, outer } => {
                self.vector(&at("center"), center);
                if inner >= outer {
                    let message = format!("the inner radius {inner} is not below the outer radius {outer}");
                    let help = format!("give an outer radius above {}", inner.max(0.0));
                    self.error("D016", &at("inner"), message, help);
                }
            }
            Shape::Cylinder { start, end, .. } => self.ends(pointer, start, end),
            Shape::Cone { start, end, radii } => {
                self.ends(pointer, start, end);
                if radii.len() == 2 && (radii.iter().any(|r| *r < 0.0) || radii.iter().all(|r| *r == 0.0)) {
                    let message = "the radii of a cone must not be negative, and one must be above 0";
                    let help = "give a radius for each end, for example `radii: [1, 0]` for a cone that ends in a tip";
                    self.error("D016", &at("radii"), message, help);
                }
            }
            Shape::Extrusion { polygon, from, to, .. } => {
                self.polygon(pointer, "polygon", polygon);
                if from >= to {
                    let message = format!("the extrusion ends at {to}, which is not above its start {from}");
                    self.error("D016", &at("to"), message, format!("give a number above {from}"));
                }
            }
            Shape::Cells { group } => {
                if group.is_some() && matches!(self.deck.grid, GridDeck::Structured { .. }) {
                    let message = "a structured grid has no physical groups";
                    let help = "remove `group` to take all cells";
                    self.error("D031", &at("group"), message, help);
                }
            }
            Shape::Translate { by, .. } => {
                self.vector(&at("by"), by);
            }
            Shape::Rotate { center, axis, .. } => {
                self.vector(&at("center"), center);
                self.axis(pointer, axis.as_ref());
            }
            Shape::Box { .. } | Shape::Stl { .. } | Shape::Mesh { .. } => {}
            Shape::Union { .. } | Shape::Intersection { .. } | Shape::Difference { .. } => {
                for (key, _) in shape.parts().iter().filter(|(_, part)| part.is_mesh()) {
                    let message = format!("a mesh cannot be part of a region of type `{}`", shape.word());
                    let help = "give the mesh a body of its own: its cells are the domains of the points";
                    self.error("D016", &at(key), message, help);
                }
            }
        }
    }

    /// Checks the ends of a cylinder or cone.
    fn ends(&mut self, pointer: &str, start: &[f64], end: &[f64]) {
        let first = self.vector(&format!("{pointer}/start"), start);
        let last = self.vector(&format!("{pointer}/end"), end);
        if let (Some(first), Some(last)) = (first, last)
            && first == last
        {
            let message = "both ends are at the same position";
            let help = "move one of them: the line between them is the axis of the body";
            self.error("D016", &format!("{pointer}/end"), message, help);
        }
    }

    /// Checks the axis of a rotation.
    fn axis(&mut self, pointer: &str, axis: Option<&Direction>) {
        let at = format!("{pointer}/axis");
        match (axis, self.dimensions()) {
            (None, 3) => {
                let message = "a rotation in space needs the key `axis`";
                self.error("D007", pointer, message, "give the direction of the axis: `axis: z`");
            }
            (Some(_), 2) => self.wrong_dimension(&at, "the axis of a rotation", 3),
            (Some(Direction::Vector(vector)), _) => {
                let known = self.vector(&at, vector);
                if known.is_some_and(|vector| vector.iter().all(|x| *x == 0.0)) {
                    let help = "give a vector with a component that is not 0, such as `[0, 0, 1]`, or the name of an axis, such as `z`";
                    self.error("D016", &at, "the axis has no direction", help);
                }
            }
            _ => {}
        }
    }

    fn beyond(&mut self, pointer: &str, bounds: &Extent, grid: &GridBox) {
        let Extent { min, max } = &grid.extent;
        for (axis, name) in AXES.iter().enumerate().take(min.len()) {
            let slack = |x: f64| 1e-6 * grid.axes[axis].size_at(x);
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            if low < min[axis] - slack(min[axis]) || high > max[axis] + slack(max[axis]) {
                let message = format!(
                    "the region extends from {} to {} along {name}, beyond the grid, which covers {} to {}",
                    Parameter::Number(low),
                    Parameter::Number(high),
                    Parameter::Number(min[axis]),
                    Parameter::Number(max[axis])
                );
                let help = "make the grid larger, or cut off the part outside with a `difference`";
                self.error("D028", pointer, message, help);
            }
        }
    }

    /// Checks a polygon under a key of a region.
    fn polygon(&mut self, pointer: &str, key: &str, vertices: &[Vec<f64>]) {
        let at = |k: usize| format!("{pointer}/{key}/{k}");
        let mut x: Vec<[f64; 2]> = Vec::new();
        for (k, vertex) in vertices.iter().enumerate() {
            match vertex.as_slice().try_into() {
                Ok(vertex) => x.push(vertex),
                Err(_) => {
                    let message = format!("expected 2 entries, one per axis, found {}", vertex.len());
                    self.error("D015", &at(k), message, "write the corner as `[x, y]`");
                }
            }
        }
        if vertices.len() < 3 {
            let message = format!("expected at least 3 entries, found {}", vertices.len());
            let help = "list the corners in order around the region, `[[0, 0], [1, 0], [0, 1]]`";
            self.error("D015", &format!("{pointer}/{key}"), message, help);
        }
        let n = x.len();
        if n < 3 || n < vertices.len() {
            return;
        }
        let bounds = x.iter().fold([x[0], x[0]], |[low, high], v| {
            [[low[0].min(v[0]), low[1].min(v[1])], [high[0].max(v[0]), high[1].max(v[1])]]
        });
        let around = (bounds[1][0] - bounds[0][0]) * (bounds[1][1] - bounds[0][1]);
        let repeated = (0..n).find(|&k| x[k] == x[(k + 1) % n]);
        let flat = "give corners that do not lie on one line";
        if around == 0.0 || on_a_line(&x, around) {
            self.error("D016", pointer, "the polygon has no area", flat);
        } else if let Some(k) = repeated {
            let message =
                format!("the corner ({}, {}) of the polygon is listed twice in a row", x[k][0], x[k][1]);
            let help = "remove one; the polygon closes by itself";
            self.error("D016", &at((k + 1) % n), message, help);
        } else if let Some([a, b]) = crossing_sides(&x) {
            let message = format!(
                "the polygon crosses or touches itself: its side from corner {} meets the one from corner {}",
                a + 1,
                b + 1
            );
            let help =
                "list the corners in order around the region; use `union` and `difference` for other regions";
            self.error("D016", &at(b), message, help);
        } else if !Polygon::new(x).is_ok_and(|polygon| polygon.volume() > NO_AREA * around) {
            self.error("D016", pointer, "the polygon has no area", flat);
        }
    }
}

/// True if all corners of a polygon lie on a line; `around` is the area of its bounding box.
fn on_a_line(x: &[[f64; 2]], around: f64) -> bool {
    let from_first = |v: &[f64; 2]| [v[0] - x[0][0], v[1] - x[0][1]];
    let length = |v: &[f64; 2]| v[0].hypot(v[1]);
    let along = x.iter().map(from_first).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or_default();
    x.iter().map(from_first).all(|v| (v[0] * along[1] - v[1] * along[0]).abs() <= NO_AREA * around)
}

/// True for a single shape, moved or not: its bounds are as small as possible.
fn is_tight(shape: &Shape) -> bool {
    match shape {
        Shape::Union { .. } | Shape::Intersection { .. } | Shape::Difference { .. } => false,
        Shape::Translate { shape, .. } | Shape::Rotate { shape, .. } => is_tight(shape),
        _ => true,
    }
}
