//! Named parts of the surfaces of tools, on which forces are summed separately.

use crate::region::Bounds;

/// Largest distance outside a box at which a position still counts as inside, relative to the coordinates, [-].
const ON_BORDER: f64 = 1e-9;

/// A named part of the surface of a tool, such as the tip of a pile. Parts can overlap; the sum for each part contains
/// all forces on it.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolPart<const D: usize> {
    /// Name, unique within the tool.
    pub name: String,
    /// Indices of the sides of the shape that belong to the part, numbered as in [`crate::tool::Closest::part`]; `None`
    /// for all sides.
    pub sides: Option<Vec<usize>>,
    /// Box in which the part lies, in coordinates at the start of the analysis, [length]; it moves with the tool.
    /// `None` if the part is not bounded.
    pub bounds: Option<Bounds<D>>,
}

impl<const D: usize> ToolPart<D> {
    /// True if a position on a side of the surface belongs to the part; `at_start` is this position at the start of the
    /// analysis, [length]. The boundary of the box belongs to the part.
    pub fn holds(&self, side: usize, at_start: &[f64; D]) -> bool {
        self.has_side(side) && self.reaches(&[*at_start; 2])
    }

    /// True if the side belongs to the part.
    pub(super) fn has_side(&self, side: usize) -> bool {
        self.sides.as_ref().is_none_or(|sides| sides.contains(&side))
    }

    /// True if the box of the part and another box meet.
    pub(super) fn reaches(&self, [low, high]: &Bounds<D>) -> bool {
        let Some([lower, upper]) = &self.bounds else { return true };
        (0..D).all(|d| {
            let scale = [low[d], high[d], lower[d], upper[d]].iter().fold(0.0f64, |m, x| m.max(x.abs()));
            low[d] <= upper[d] + ON_BORDER * scale && high[d] >= lower[d] - ON_BORDER * scale
        })
    }
}
