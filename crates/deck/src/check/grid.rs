//! The lines of a structured grid.

use super::Check;
use super::extent::{Extent, GridBox};
use super::geometry::{MAX_COUNT, is_whole};
use crate::refined_axes::RefineFault;
use crate::{AXES, AxisSpacing, GridDeck, IntervalDeck, Parameter, PerAxis, SpacingDeck};
use mpm_core::grid::{Axis, ON_LINE};

/// Largest number of cells along a graded axis; the lines of such an axis are stored.
const MAX_GRADED_CELLS: f64 = 1e6;
/// Relative difference of two coordinates up to which they count as equal.
const SAME: f64 = 1e-12;

impl Check<'_> {
    /// Checks the grid; returns it if it is structured and its lines are known.
    pub(super) fn grid(&mut self) -> Option<GridBox> {
        let GridDeck::Structured { origin, size, spacing, .. } = &self.deck.grid else { return None };
        for RefineFault { pointer, message, help } in self.deck.grid.refinement_faults(self.dimensions()) {
            self.error("D027", &pointer, message, &help);
        }
        let origin = self.vector("/grid/origin", origin);
        let sides = self.lengths("/grid/size", &PerAxis::Each(size.clone()));
        let spacing = self.spacing("/grid/spacing", spacing);
        let (origin, sides, spacing) = (origin?, sides?, spacing?);
        let mut axes = Vec::new();
        for axis in 0..self.dimensions() {
            axes.push(match &spacing[axis] {
                AxisSpacing::Even(spacing) => Some(self.even(axis, [origin[axis], sides[axis]], *spacing)),
                AxisSpacing::Intervals(list) => self.intervals(axis, [origin[axis], sides[axis]], list),
            });
        }
        let cells: f64 = (0..axes.len()).map(|axis| spacing[axis].cells(sides[axis])).product();
        if cells.is_nan() || cells > MAX_COUNT {
            let message =
                format!("the grid would have {cells:.1e} cells; at most {MAX_COUNT:.0e} are possible");
            let least = self.dimensions() as f64;
            let fits = (sides.iter().product::<f64>() / MAX_COUNT).powf(1.0 / least);
            let help = format!("use a spacing above {fits:.1e}, or a smaller grid");
            self.error("D027", "/grid/spacing", message, help);
            return None;
        }
        let axes: Vec<Axis> = axes.into_iter().collect::<Option<_>>()?;
        let max = origin.iter().zip(&sides).map(|(low, side)| low + side).collect();
        Some(GridBox { extent: Extent { min: origin, max }, axes })
    }

    /// Checks how many entries there are, and the values of the numeric ones.
    fn spacing(&mut self, pointer: &str, spacing: &SpacingDeck) -> Option<Vec<AxisSpacing>> {
        if let SpacingDeck::Same(spacing) = spacing {
            self.lengths(pointer, &PerAxis::Same(*spacing))?;
        }
        let entries = spacing.entries(self.dimensions());
        if entries.len() != self.dimensions() {
            self.wrong_count(pointer, entries.len());
            return None;
        }
        let mut all = true;
        for (axis, entry) in entries.iter().enumerate() {
            if let (AxisSpacing::Even(spacing), SpacingDeck::Each(_)) = (entry, spacing) {
                all &= self.is_positive(&format!("{pointer}/{axis}"), *spacing, "length");
            }
        }
        all.then_some(entries)
    }

    fn is_positive(&mut self, pointer: &str, value: f64, what: &str) -> bool {
        if value <= 0.0 {
            let help = format!("give a {what} above 0");
            self.error("D009", pointer, format!("{value} is not above 0"), help);
        }
        value > 0.0
    }

    /// An axis of cells of equal size.
    fn even(&mut self, axis: usize, [origin, side]: [f64; 2], spacing: f64) -> Axis {
        let count = side / spacing;
        let farthest = origin.abs().max((origin + side).abs());
        if count < MAX_COUNT && f64::EPSILON * farthest > ON_LINE * spacing {
            let message = format!(
                "the grid reaches to {farthest:e} along {}, where the round-off of coordinates exceeds \
                 {ON_LINE:e} of the cell size {spacing}",
                AXES[axis]
            );
            let help = "move the origin of the coordinates close to the bodies";
            self.error("D027", &format!("/grid/origin/{axis}"), message, help);
        }
        if !is_whole(count) {
            let message = format!(
                "the size {} along {} is not a whole multiple of the spacing {}",
                Parameter::Number(side),
                AXES[axis],
                Parameter::Number(spacing)
            );
            let fits = Parameter::Number(count.round().max(1.0) * spacing);
            let help = if count < 1.0 {
                format!("use a spacing that divides {}, or a size of {fits}", Parameter::Number(side))
            } else {
                format!("use a size of {fits}, or a spacing that divides {}", Parameter::Number(side))
            };
            self.error("D027", &format!("/grid/size/{axis}"), message, help);
        }
        Axis::even(origin, spacing, count.round().max(1.0) as usize)
    }

    /// A graded axis; `None` if its intervals do not fit together.
    fn intervals(&mut self, axis: usize, [origin, side]: [f64; 2], list: &[IntervalDeck]) -> Option<Axis> {
        let (pointer, name) = (format!("/grid/spacing/{axis}"), AXES[axis]);
        let before = self.found.len();
        let mut start = origin;
        for (number, IntervalDeck { to, cells, ratio }) in list.iter().enumerate() {
            let at = |key: &str| format!("{pointer}/{number}/{key}");
            if *to <= start {
                let message =
                    format!("the interval along {name} ends at {to}, which is not above its start {start}");
                self.error("D027", &at("to"), message, format!("give a coordinate above {start}"));
            }
            if *cells == 0 {
                self.error(
                    "D009",
                    &at("cells"),
                    "an interval needs at least 1 cell",
                    "give the number of cells",
                );
            }
            self.is_positive(&at("ratio"), *ratio, "ratio");
            start = *to;
        }
        let (end, Some(last)) = (origin + side, list.len().checked_sub(1)) else { return None };
        if self.found.len() == before && (start - end).abs() > SAME * side.max(end.abs()) {
            let message = format!("the intervals along {name} end at {start}, but the grid ends at {end}");
            let help = format!("let the last interval end at {end}, or change `size`");
            self.error("D027", &format!("{pointer}/{last}/to"), message, help);
        }
        let spacing = AxisSpacing::Intervals(list.to_vec());
        let count = spacing.cells(side);
        if count > MAX_GRADED_CELLS {
            let message = format!(
                "there would be {} cells along {name}; a graded axis has at most {MAX_GRADED_CELLS:.0e}",
                Parameter::Number(count)
            );
            self.error("D027", &pointer, message, "use fewer cells, or an even spacing");
        }
        if self.found.len() > before {
            return None;
        }
        match spacing.axis(origin, side) {
            Ok(lines) => Some(lines),
            Err(error) => {
                let message = format!("along {name}, {error}");
                let help = "use fewer cells or a ratio closer to 1, and an origin close to the bodies";
                self.error("D027", &pointer, message, help);
                None
            }
        }
    }
}
