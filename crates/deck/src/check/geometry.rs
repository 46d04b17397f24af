//! Vectors, boxes, and the points of bodies.

use super::Check;
use super::extent::{Extent, GridBox};
use crate::diagnostic::Diagnostic;
use crate::quoting::{quote, rounded};
use crate::seeding::placed_in_cells;
use crate::{AXES, BodyDeck, GridDeck, Method, Parameter, PerAxis};

/// Largest number of cells of a grid, and of points of a body: far more than can be computed.
pub(super) const MAX_COUNT: f64 = 1e8;
/// Largest number of points along an axis of a cell.
const MAX_PER_CELL: u32 = 1000;
/// Error up to which the ratio of two lengths counts as a whole number; decimal fractions such as 0.1 are not exact.
const WHOLE: f64 = 1e-6;

impl Check<'_> {
    /// Number of axes.
    pub(super) fn dimensions(&self) -> usize {
        self.deck.dimensions()
    }

    /// Checks a list with one number per axis.
    pub(super) fn vector(&mut self, pointer: &str, values: &[f64]) -> Option<Vec<f64>> {
        if values.len() != self.dimensions() {
            self.wrong_count(pointer, values.len());
            return None;
        }
        Some(values.to_vec())
    }

    pub(super) fn wrong_count(&mut self, pointer: &str, count: usize) {
        let axes = self.dimensions();
        let expected = format!("{axes} entries, one per axis");
        let message = format!("expected {expected}, found {count}");
        let found = Diagnostic::at(self.source, "D015", pointer, message).expected(expected);
        let help = match (axes, count) {
            (2, 3) => "three axes need `analysis: {idealisation: solid}`",
            (2, _) => "give two, along x and y",
            (_, 2) => "add the third, along z; two are for `idealisation: plane-strain` or `axisymmetric`",
            _ => "give three, along x, y and z",
        };
        self.found.push(found.help(help));
    }

    /// Reports an entry that needs a number of dimensions other than that of the deck.
    pub(super) fn wrong_dimension(&mut self, pointer: &str, what: &str, needed: usize) {
        let idealisation = self.deck.analysis.idealisation.name();
        let (count, help) = match needed {
            3 => ("three", "`idealisation: solid`"),
            _ => ("two", "`idealisation: plane-strain` or `axisymmetric`"),
        };
        let message =
            format!("{what} exists in {count} dimensions only, but the idealisation is `{idealisation}`");
        self.error("D048", pointer, message, format!("{what} needs {help}"));
    }

    fn per_axis<T: Copy>(&mut self, pointer: &str, values: &PerAxis<T>) -> Option<Vec<(String, T)>> {
        match values {
            PerAxis::Same(value) => Some(vec![(pointer.to_owned(), *value); self.dimensions()]),
            PerAxis::Each(values) if values.len() == self.dimensions() => {
                let at = |(axis, value): (usize, &T)| (format!("{pointer}/{axis}"), *value);
                Some(values.iter().enumerate().map(at).collect())
            }
            PerAxis::Each(values) => {
                self.wrong_count(pointer, values.len());
                None
            }
        }
    }

    /// Checks a positive length per axis.
    pub(super) fn lengths(&mut self, pointer: &str, values: &PerAxis<f64>) -> Option<Vec<f64>> {
        let values = self.per_axis(pointer, values)?;
        for (at, value) in &values {
            if *value <= 0.0 {
                self.error("D009", at, format!("{value} is not above 0"), "give a length above 0");
                if at == pointer {
                    break;
                }
            }
        }
        let lengths: Vec<f64> = values.into_iter().map(|(_, value)| value).collect();
        lengths.iter().all(|value| *value > 0.0).then_some(lengths)
    }

    /// Checks that the smallest corner of a box is below its largest.
    pub(super) fn extent(&mut self, pointer: &str, min: &[f64], max: &[f64]) -> Option<Extent> {
        let low = self.vector(&format!("{pointer}/min"), min);
        let high = self.vector(&format!("{pointer}/max"), max);
        let (min, max) = (low?, high?);
        if min.iter().zip(&max).all(|(low, high)| low > high) {
            let message = "the corners of the box are swapped: its min lies above its max along every axis";
            let numbers = |corner: &[f64]| corner.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
            let help = format!("write `min: [{}], max: [{}]`", numbers(&max), numbers(&min));
            self.error("D016", &format!("{pointer}/min"), message, help);
            return None;
        }
        let mut fits = true;
        for axis in 0..min.len() {
            if min[axis] >= max[axis] {
                fits = false;
                let message = format!(
                    "the box has no extent along {}: its min {} is not below its max {}",
                    AXES[axis], min[axis], max[axis]
                );
                let help = if min[axis] > max[axis] {
                    format!("swap the two, or give a max above {}", min[axis])
                } else {
                    format!("give a max above {}", min[axis])
                };
                self.error("D016", &format!("{pointer}/max/{axis}"), message, help);
            }
        }
        fits.then_some(Extent { min, max })
    }

    /// Checks that points are placed either in cells or at a spacing.
    pub(super) fn points_given_once(&mut self, pointer: &str, body: &BodyDeck) -> bool {
        let in_cells = body.points_per_cell.is_some()
            || body.points_per_triangle.is_some()
            || body.points_per_tetrahedron.is_some();
        let is_mesh = body.shape.is_mesh();
        if is_mesh && body.point_spacing.is_some() {
            let at = format!("{pointer}/point_spacing");
            let message = "the points of a region of type `mesh` lie in its cells, not at a spacing";
            let found = Diagnostic::at_key(self.source, "D023", &at, message);
            self.found.push(found.help(format!("remove it, or give {}", placed_in_cells(self.dimensions()))));
            return false;
        }
        if in_cells == body.point_spacing.is_none() || is_mesh {
            return true;
        }
        if in_cells {
            let at = format!("{pointer}/point_spacing");
            let message = "`point_spacing` and a number of points per cell cannot both be given";
            let found = Diagnostic::at_key(self.source, "D023", &at, message);
            self.found.push(found.help("remove one of them"));
        } else {
            let message = format!("the body {} does not state how its points are placed", quote(&body.name));
            let help = format!(
                "give {}",
                placed_in_cells(self.dimensions()).replace(" or ", ", ") + " or `point_spacing`"
            );
            self.found.push(Diagnostic::at_key(self.source, "D023", pointer, message).help(help));
        }
        false
    }

    /// Checks how the points of a body are placed, whatever its region; returns false if their placement has a fault.
    fn placing(&mut self, pointer: &str, body: &BodyDeck) -> bool {
        let per_simplex = [
            ("points_per_triangle", body.points_per_triangle, 2, "triangles"),
            ("points_per_tetrahedron", body.points_per_tetrahedron, 3, "tetrahedra"),
        ];
        let mut fits = self.points_given_once(pointer, body);
        for (key, given, dimensions, plural) in per_simplex {
            let at = format!("{pointer}/{key}");
            if given.is_some() && dimensions != self.dimensions() {
                self.wrong_dimension(&at, &format!("`{key}`"), dimensions);
                fits = false;
            } else if given.is_some()
                && fits
                && matches!(self.deck.grid, GridDeck::Structured { .. })
                && !body.shape.is_mesh()
            {
                let message = format!("a structured grid has no {plural}");
                self.error("D023", &at, message, "give `points_per_cell` instead");
                fits = false;
            }
        }
        if !fits {
            return false;
        }
        if body.method == Method::Gimp {
            let help = "use method `mpm`, `cpdi1` or `cpdi2`";
            if matches!(self.deck.grid, GridDeck::Gmsh { .. }) {
                let message = "method `gimp` needs a structured grid";
                self.error("D034", &format!("{pointer}/method"), message, help);
            } else if body.shape.is_mesh() {
                let message = "method `gimp` needs boxes, not the cells of a mesh";
                self.error("D034", &format!("{pointer}/method"), message, help);
            }
        }
        true
    }

    pub(super) fn points(&mut self, pointer: &str, body: &BodyDeck, extent: &Extent, grid: Option<&GridBox>) {
        if let Some(grid) = grid {
            self.inside_grid(pointer, body, extent, grid);
        }
        if !self.placing(pointer, body) {
            return;
        }
        let counts = match (&body.points_per_cell, &body.point_spacing) {
            (Some(per_cell), _) => {
                if let Some(grid) = grid {
                    self.aligned(pointer, body, extent, grid);
                }
                self.points_per_cell(&format!("{pointer}/points_per_cell"), per_cell, extent, grid)
            }
            (_, Some(spacing)) => self.point_spacing(&format!("{pointer}/point_spacing"), spacing, extent),
            _ => None,
        };
        if let Some(counts) = counts
            && counts.iter().product::<f64>() > MAX_COUNT
        {
            let message = format!(
                "the body {} would have {:.1e} points; at most {MAX_COUNT:.0e} are possible",
                quote(&body.name),
                counts.iter().product::<f64>()
            );
            self.error("D028", pointer, message, "give fewer points per cell, or a larger `point_spacing`");
        }
    }

    /// Checks a number of points along each axis of a cell.
    fn counts(&mut self, pointer: &str, per_cell: &PerAxis<u32>) -> Option<Vec<u32>> {
        let values = self.per_axis(pointer, per_cell)?;
        for (at, value) in &values {
            if !(1..=MAX_PER_CELL).contains(value) {
                let message =
                    format!("{value} points along an axis of a cell; 1 to {MAX_PER_CELL} are allowed");
                self.error("D009", at, message, "give 2 to 4, as is usual");
                return None;
            }
        }
        Some(values.into_iter().map(|(_, value)| value).collect())
    }

    /// Checks the points of a body that is not a simple box.
    pub(super) fn points_in_region(&mut self, pointer: &str, body: &BodyDeck) {
        if !self.placing(pointer, body) {
            return;
        }
        if let Some(per_cell) = &body.points_per_cell {
            self.counts(&format!("{pointer}/points_per_cell"), per_cell);
        }
        if let Some(spacing) = &body.point_spacing {
            self.lengths(&format!("{pointer}/point_spacing"), spacing);
        }
    }

    fn points_per_cell(
        &mut self,
        pointer: &str,
        per_cell: &PerAxis<u32>,
        extent: &Extent,
        grid: Option<&GridBox>,
    ) -> Option<Vec<f64>> {
        let values = self.counts(pointer, per_cell)?;
        let grid = grid?;
        let along = |axis: usize| {
            let [min, max] = [&extent.min, &extent.max].map(|end| grid.axes[axis].coordinate(end[axis]));
            (max - min) * f64::from(values[axis])
        };
        Some((0..values.len()).map(along).collect())
    }

    /// Checks that the sides of a body with points per cell lie on grid lines.
    fn aligned(&mut self, pointer: &str, body: &BodyDeck, extent: &Extent, grid: &GridBox) {
        for (axis, name) in AXES.iter().enumerate().take(self.dimensions()) {
            let nearest = |edge: f64| grid.axes[axis].coordinate(edge).round();
            let is_thin = nearest(extent.min[axis]) == nearest(extent.max[axis]);
            for (corner, edge) in [("min", extent.min[axis]), ("max", extent.max[axis])] {
                let lines = &grid.axes[axis];
                let spacing = lines.size_at(edge);
                let line = lines.position(nearest(edge));
                if (edge - line).abs() > WHOLE * spacing {
                    // Six digits relative to the size of a cell are enough.
                    let digits = 10f64.powf(6.0 - spacing.log10().floor());
                    let line = (line * digits).round() / digits;
                    let message = format!(
                        "the edge {name} = {edge} (`{corner}`) of the body {} is {} away from the nearest grid line, {name} = {line}",
                        quote(&body.name),
                        rounded((edge - line).abs())
                    );
                    let remedy = if is_thin {
                        format!(
                            "make the cells no larger than the body, which measures {} along {name}",
                            Parameter::Number(extent.side(axis))
                        )
                    } else {
                        format!("move the edge to {line}")
                    };
                    let help = format!("{remedy}, or give `point_spacing` instead of `points_per_cell`");
                    self.error("D028", &format!("{pointer}/shape/{corner}/{axis}"), message, help);
                }
            }
        }
    }

    fn point_spacing(&mut self, pointer: &str, spacing: &PerAxis<f64>, extent: &Extent) -> Option<Vec<f64>> {
        let spacing = self.lengths(pointer, spacing)?;
        let counts: Vec<f64> = (0..spacing.len()).map(|axis| extent.side(axis) / spacing[axis]).collect();
        for axis in 0..counts.len() {
            if !is_whole(counts[axis]) {
                let message = format!(
                    "the length of the body, {} along {}, is not a whole multiple of the point spacing {}",
                    extent.side(axis),
                    AXES[axis],
                    spacing[axis]
                );
                let fits = extent.side(axis) / counts[axis].round().max(1.0);
                self.error("D028", pointer, message, format!("{fits} would fit along {}", AXES[axis]));
            }
        }
        Some(counts)
    }

    fn inside_grid(&mut self, pointer: &str, body: &BodyDeck, extent: &Extent, grid: &GridBox) {
        let (low, high) = (&grid.extent.min, &grid.extent.max);
        for axis in 0..low.len() {
            let slack = |x: f64| WHOLE * grid.axes[axis].size_at(x);
            let corner = if extent.min[axis] < low[axis] - slack(low[axis]) {
                "min"
            } else if extent.max[axis] > high[axis] + slack(high[axis]) {
                "max"
            } else {
                continue;
            };
            let message = format!(
                "the body {} reaches beyond the grid, which covers {} to {} along {}",
                quote(&body.name),
                low[axis],
                high[axis],
                AXES[axis]
            );
            let help = format!(
                "let the body end at {} or {}, or make the grid larger",
                if corner == "min" { low[axis] } else { high[axis] },
                if corner == "min" { "above" } else { "below" },
            );
            self.error("D028", &format!("{pointer}/shape/{corner}/{axis}"), message, help);
        }
    }

    /// Checks that bodies that are boxes do not overlap; they may touch.
    pub(super) fn overlaps(&mut self, mut boxes: Vec<(usize, Extent)>) {
        // If the boxes are sorted by their lower sides, each need be compared only with the later boxes that start
        // before its upper side; these are few along the axis on which the boxes are spread out most.
        let spread = |axis: usize| {
            let low = boxes.iter().map(|(_, b)| b.min[axis]).fold(f64::INFINITY, f64::min);
            let high = boxes.iter().map(|(_, b)| b.max[axis]).fold(f64::NEG_INFINITY, f64::max);
            let sides: f64 = boxes.iter().map(|(_, b)| b.side(axis)).sum();
            (high - low) / sides
        };
        let axes = 0..self.dimensions();
        let axis = axes.clone().fold(0, |most, axis| if spread(axis) > spread(most) { axis } else { most });
        boxes.sort_by(|(_, a), (_, b)| a.min[axis].total_cmp(&b.min[axis]));
        for (position, (first, a)) in boxes.iter().enumerate() {
            for (second, b) in boxes[position + 1..].iter().take_while(|(_, b)| b.min[axis] < a.max[axis]) {
                let overlap = |axis: usize| {
                    a.max[axis].min(b.max[axis]) - a.min[axis].max(b.min[axis]) > slack(a, b, axis)
                };
                let body = |index: usize| self.deck.bodies[index].name.as_str();
                if !axes.clone().all(overlap) || !self.deck.meet([body(*first), body(*second)]) {
                    continue;
                }
                let (earlier, later) = (first.min(second), first.max(second));
                let name = |index: usize| quote(body(index));
                let message = format!("the body {} overlaps the body {}", name(*later), name(*earlier));
                let help = "move one of them, or subtract it from the other with a `difference`";
                self.error("D025", &format!("/bodies/{later}/shape"), message, help);
                // One message per body is enough; if all bodies overlapped, the number of messages would be quadratic.
                break;
            }
        }
    }
}

/// Overlap below which two boxes only touch.
fn slack(a: &Extent, b: &Extent, axis: usize) -> f64 {
    1e-9 * a.side(axis).min(b.side(axis))
}

pub(super) fn is_whole(count: f64) -> bool {
    count.round() >= 1.0 && (count - count.round()).abs() <= WHOLE
}
