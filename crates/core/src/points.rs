//! The material points: their fixed fields, their converged state, and the trial state of the current load step.
//!
//! Each field is declared once, in `points/fields.rs`; commits, reordering, checkpoints and arrays work on the list of
//! all fields. Fields that only some analyses need are declared at run time by [`Points::declare`].

mod arrays;
mod column;
mod declare;
mod deviation;
mod displaced;
mod fields;
mod further;
mod motion;
mod nearest;
mod order;
mod partition;
mod seed;
mod split;
mod value;

pub use arrays::PointArray;
pub use declare::{FieldKind, StoredField};
pub(crate) use displaced::Displaced;
pub use fields::{Points, State};
pub use further::{FieldError, FieldHandle, Further, FurtherField, PointFieldSpec};
pub use motion::{MOTION, Momentum};
pub use nearest::Near;
pub use partition::{ByNumber, MAX_IMBALANCE, Partition};
pub use seed::Seed;
pub use split::Split;
pub(crate) use split::{Halves, Splitting};
pub use value::PointValues;

#[cfg(test)]
mod tests;

/// Smallest number of points assigned to one thread.
pub const PIECE: usize = 1 << 10;

/// A position as text for messages: with six decimals, or in exponential notation if the largest coordinate is too
/// small or too large for decimals.
pub fn coordinates(position: &[f64]) -> String {
    let largest = position.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let suits_decimals = largest == 0.0 || (1e-3..1e9).contains(&largest);
    let least = if suits_decimals { 5e-7 } else { 1e-9 * largest };
    // Round-off is shown as 0, without a sign.
    let shown = |x: f64| if x.abs() < least { 0.0 } else { x };
    let text = |x: f64| if suits_decimals { format!("{x:.6}") } else { format!("{x:.6e}") };
    let numbers: Vec<String> = position.iter().map(|x| text(shown(*x))).collect();
    format!("({})", numbers.join(", "))
}

/// The source of the current volume of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PointVolume {
    /// det(F) times the original volume, eq. (22).
    #[default]
    Deformation,
    /// The volume of the domain, which differs from the volume of eq. (22) if the domain does not follow det(F). Needed
    /// only to reproduce some results of the paper. Points without a domain use eq. (22).
    Domain,
}

/// Number of a group of bodies that share the unknowns of their nodes.
pub type BodyGroup = u16;

impl<const D: usize> Points<D> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// True if there are no points.
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// Makes the trial state the converged state.
    pub fn commit(&mut self) {
        self.converged.take(&mut self.trial);
        self.further.commit();
    }

    /// Adds a field that only this analysis has. Reordering, commits, checkpoints and result files include it;
    /// checkpoints omit the values of fixed fields.
    ///
    /// # Errors
    /// [`FieldError`] if the name, shape or initial values are invalid.
    pub fn declare(&mut self, spec: PointFieldSpec) -> Result<FieldHandle, FieldError> {
        self.further.declare(spec, &self.id, Self::stores)
    }

    /// True if the points store a field, or have an array, of this name.
    fn stores(name: &str) -> bool {
        Self::STORED.contains(&name) || PointArray::named(name).is_some() || Self::stores_deviations(name)
    }

    /// Half lengths of the domain of a point in the converged state, [length]; zero for points without half lengths.
    #[inline]
    pub fn half_lengths(&self, p: usize) -> [f64; D] {
        self.converged.half_lengths.get(p).copied().unwrap_or([0.0; D])
    }

    /// The history variables of a point in the converged state.
    pub(crate) fn history_of(&mut self, p: usize) -> &mut [f64] {
        &mut self.converged.history[p * self.history_len..][..self.history_len]
    }

    /// Volume J V_p0 of a point in the converged state, eq. (22), [volume].
    pub fn volume(&self, p: usize) -> f64 {
        self.converged.deformation_gradient[p].determinant() * self.original_volume[p]
    }

    /// The range of the corners of a point's domain in the arrays of corners; empty if its domain is not given by
    /// corners.
    pub fn corner_range(&self, p: usize) -> std::ops::Range<usize> {
        let start = p * self.corners_per_point;
        start..start + self.corner_count.get(p).map_or(0, |n| usize::from(*n))
    }

    /// Corners of the domain of a point in the converged state; empty if the domain is not given by corners.
    pub fn corners(&self, p: usize) -> &[[f64; D]] {
        &self.converged.corners[self.corner_range(p)]
    }
}
