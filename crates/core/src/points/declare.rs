//! Declaration of the fields of the points: from a list of fields, [`point_fields`] generates the arrays and the lists
//! of fields on which all other code works.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::PIECE;
use super::seed::Seed;
use super::value::Value;

/// When a field of the points changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldKind {
    /// Never.
    Fixed,
    /// At the end of a step, with the motion of the points. Trial values exist from then until the step is committed.
    Motion,
    /// In each evaluation of equilibrium, as the response of a law. Trial values always exist.
    Answer,
}

/// A declared field of the state of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredField {
    /// Name in the code and in requests for arrays.
    pub name: &'static str,
    /// Name in messages.
    pub label: &'static str,
    /// Unit, `-` for plain numbers.
    pub unit: &'static str,
    /// When the field changes.
    pub kind: FieldKind,
    /// Number of components per point.
    pub components: usize,
}

/// Declares the fields of the points. Each field has one entry:
///
/// ```text
/// /// What it is.
/// name: Type = shape(|seed| start value), in "unit", called "name in messages";
/// ```
///
/// Fixed fields have no name in messages. The shape is `one` (one value per point), `one_or_none` (the same, but the
/// field takes no memory if all initial values are zero) or `up_to[count]` (several values per point, the same number
/// for all points). The macro generates both structures, the initial values, and the lists of the fields and of their
/// columns, in the order of declaration; functions on these lists do everything else (`points/fields.rs`).
macro_rules! point_fields {
    (@per $counts:ident) => { 1 };
    (@per $counts:ident $per:ident) => { $counts.$per };
    (@field $points:ident, $kind:ident, $name:ident: $type:ty, $([$per:ident])? $unit:literal, $label:expr) => {
        $crate::points::StoredField {
            name: stringify!($name),
            label: $label,
            unit: $unit,
            kind: $crate::points::FieldKind::$kind,
            components: point_fields!(@per $points $($per)?)
                * <$type as $crate::points::value::Value>::COMPONENTS,
        }
    };
    (
        $(#[$points_doc:meta])*
        struct $Points:ident {
            counts { $($(#[$count_doc:meta])* $count:ident = $count_of:expr;)* }
            fixed { $(
                $(#[$fixed_doc:meta])*
                $fixed:ident: $fixed_type:ty = $fixed_shape:ident $([$fixed_per:ident])? ($fixed_start:expr),
                in $fixed_unit:literal;
            )* }
        }
        $(#[$state_doc:meta])*
        struct $State:ident {
            motion { $(
                $(#[$motion_doc:meta])*
                $motion:ident: $motion_type:ty = $motion_shape:ident $([$motion_per:ident])? ($motion_start:expr),
                in $motion_unit:literal, called $motion_label:literal;
            )* }
            answer { $(
                $(#[$answer_doc:meta])*
                $answer:ident: $answer_type:ty = $answer_shape:ident $([$answer_per:ident])? ($answer_start:expr),
                in $answer_unit:literal, called $answer_label:literal;
            )* }
        }
    ) => {
        $(#[$state_doc])*
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $State<const D: usize> {
            $($(#[$motion_doc])* #[doc = concat!("\n\nUnit: [", $motion_unit, "].")] pub $motion: Vec<$motion_type>,)*
            $($(#[$answer_doc])* #[doc = concat!("\n\nUnit: [", $answer_unit, "].")] pub $answer: Vec<$answer_type>,)*
        }

        impl<const D: usize> $State<D> {
            /// Number of fields of the motion, the first ones of the columns; answers follow.
            pub(super) const N_MOTION: usize = [$(stringify!($motion)),*].len();

            /// The columns of all fields.
            pub(super) fn columns(&self) -> Vec<&dyn $crate::points::column::Column> {
                vec![$(&self.$motion,)* $(&self.$answer,)*]
            }

            /// The columns of all fields, to be changed.
            pub(super) fn columns_mut(&mut self) -> Vec<&mut dyn $crate::points::column::Column> {
                vec![$(&mut self.$motion,)* $(&mut self.$answer,)*]
            }
        }

        $(#[$points_doc])*
        #[derive(Debug, Clone)]
        pub struct $Points<const D: usize> {
            /// Permanent number, from 0; points that are removed leave gaps.
            pub id: Vec<u32>,
            /// The cell that held the point when the points were last grouped.
            pub cell: Vec<u32>,
            $($(#[$fixed_doc])* #[doc = concat!("\n\nUnit: [", $fixed_unit, "].")] pub $fixed: Vec<$fixed_type>,)*
            /// State at the end of the last equilibrated step.
            pub converged: $State<D>,
            /// State of the current step. The fields of the motion exist only from the end of the step, when the points
            /// move, until the commit; at other times they take no memory.
            pub trial: $State<D>,
            $($(#[$count_doc])* pub $count: usize,)*
            /// Fields declared for this analysis only.
            pub further: $crate::points::Further,
            /// The cuts of the points of all ranks so far, in their order.
            pub cuts: Vec<$crate::points::Split>,
            /// The ranks that share the points of the analysis; this structure holds the points of this rank.
            pub ranks: $crate::ranks::Ranks,
            /// The parts of the grid that belong to the ranks.
            pub partition: $crate::points::partition::Partition,
        }

        impl<const D: usize> $Points<D> {
            /// Names of the declared fields.
            pub const STORED: &'static [&'static str] =
                &[$(stringify!($fixed),)* $(stringify!($motion),)* $(stringify!($answer),)*];

            /// Stress-free, undeformed points with these permanent numbers; other ranks create the other points. All
            /// ranks store the same number of values per point.
            #[inline(never)]
            pub fn numbered(
                seeds: &[$crate::points::Seed<D>],
                id: Vec<u32>,
                ranks: &$crate::ranks::Ranks,
            ) -> Self {
                use $crate::points::declare::start;
                $(let $count = ranks.largest(start::most(seeds, $count_of) as f64) as usize;)*
                let converged = $State {
                    $($motion: start::$motion_shape(seeds, $($motion_per,)? $motion_start),)*
                    $($answer: start::$answer_shape(seeds, $($answer_per,)? $answer_start),)*
                };
                $Points {
                    id,
                    cell: vec![0; seeds.len()],
                    $($fixed: start::$fixed_shape(seeds, $($fixed_per,)? $fixed_start),)*
                    trial: $State { $($answer: converged.$answer.clone(),)* ..$State::default() },
                    converged,
                    $($count,)*
                    further: $crate::points::Further::default(),
                    cuts: Vec::new(),
                    ranks: ranks.clone(),
                    partition: $crate::points::partition::Partition::default(),
                }
            }

            /// The declared fields.
            pub(super) fn stored_fields(&self) -> Vec<$crate::points::StoredField> {
                vec![
                    $(point_fields!(
                        @field self, Fixed, $fixed: $fixed_type, $([$fixed_per])? $fixed_unit, stringify!($fixed)
                    ),)*
                    $(point_fields!(
                        @field self, Motion, $motion: $motion_type, $([$motion_per])? $motion_unit, $motion_label
                    ),)*
                    $(point_fields!(
                        @field self, Answer, $answer: $answer_type, $([$answer_per])? $answer_unit, $answer_label
                    ),)*
                ]
            }

            /// The columns of the declared fields: the fixed fields, and those of the converged state.
            pub(super) fn columns(&self) -> Vec<&dyn $crate::points::column::Column> {
                let mut columns: Vec<&dyn $crate::points::column::Column> = vec![$(&self.$fixed),*];
                columns.extend(self.converged.columns());
                columns
            }

            /// The columns of the declared fields, to be changed.
            pub(super) fn columns_mut(&mut self) -> Vec<&mut dyn $crate::points::column::Column> {
                let mut columns: Vec<&mut dyn $crate::points::column::Column> = vec![$(&mut self.$fixed),*];
                columns.extend(self.converged.columns_mut());
                columns
            }
        }
    };
}

pub(super) use point_fields;

/// Initial values for each shape of field.
pub(super) mod start {
    use super::{IndexedParallelIterator, IntoParallelRefIterator, PIECE, ParallelIterator, Seed, Value};

    /// The largest `count` over all seeds.
    pub fn most<const D: usize>(seeds: &[Seed<D>], count: impl Fn(&Seed<D>) -> usize) -> usize {
        seeds.iter().map(count).max().unwrap_or(0)
    }

    /// One value for each point.
    pub fn one<const D: usize, T: Send>(
        seeds: &[Seed<D>],
        value: impl Fn(&Seed<D>) -> T + Send + Sync,
    ) -> Vec<T> {
        seeds.par_iter().with_min_len(PIECE).map(value).collect()
    }

    /// One value for each point; empty if all are zero.
    pub fn one_or_none<const D: usize, T: Value>(
        seeds: &[Seed<D>],
        value: impl Fn(&Seed<D>) -> T + Send + Sync,
    ) -> Vec<T> {
        if seeds.iter().any(|seed| value(seed) != T::ZERO) { one(seeds, value) } else { Vec::new() }
    }

    /// `count` values for each point, zero beyond the values that its seed has.
    pub fn up_to<const D: usize, T: Value>(
        seeds: &[Seed<D>],
        count: usize,
        values: impl Fn(&Seed<D>) -> &[T],
    ) -> Vec<T> {
        let mut all = vec![T::ZERO; count * seeds.len()];
        for (p, seed) in seeds.iter().enumerate() {
            let values = values(seed);
            all[p * count..][..values.len()].copy_from_slice(values);
        }
        all
    }
}
