//! Declaration of the fields of the points: from a list of fields, [`point_fields`] generates the arrays and all code
//! that handles each field.

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
/// for all points). The macro generates both structures, `Points::new`, the code that reorders fields, commits trial
/// values and checks array lengths, the visitor of the state for checkpoints, and the look-up of fields by name.
macro_rules! point_fields {
    (@per $self:ident) => { 1 };
    (@per $self:ident $per:ident) => { $self.$per };
    (@field $self:ident, $kind:ident, $name:ident: $type:ty, $([$per:ident])? $unit:literal, $label:literal) => {
        $crate::points::StoredField {
            name: stringify!($name),
            label: $label,
            unit: $unit,
            kind: $crate::points::FieldKind::$kind,
            components: point_fields!(@per $self $($per)?)
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
            /// The initial trial state of a step that begins from this state.
            pub(super) fn trial(&self) -> Self {
                $State { $($answer: self.$answer.clone(),)* ..$State::default() }
            }

            /// Swaps the responses of laws with those of another state.
            pub(super) fn swap_answers(&mut self, other: &mut Self) {
                $(std::mem::swap(&mut self.$answer, &mut other.$answer);)*
            }

            /// Takes over a trial state, including the fields of the motion if the trial state has them.
            pub(super) fn take(&mut self, trial: &mut Self) {
                self.swap_answers(trial);
                let has_moved = [$(trial.$motion.len() == self.$motion.len()),*];
                if has_moved.into_iter().all(|has_moved| has_moved) {
                    $(self.$motion = std::mem::take(&mut trial.$motion);)*
                }
            }

            /// Allocates the fields of the motion with the lengths of this converged state; the caller must write every
            /// value.
            pub(crate) fn make_room_for_motion(&mut self, converged: &Self) {
                $(self.$motion.resize(converged.$motion.len(), $crate::points::value::Value::ZERO);)*
            }

            /// Discards the fields of the motion and frees their memory.
            pub(crate) fn forget_motion(&mut self) {
                $(self.$motion = Vec::new();)*
            }

            /// Number of entries of each field.
            pub(super) fn lengths(&self) -> Vec<usize> {
                vec![$(self.$motion.len(),)* $(self.$answer.len(),)*]
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
            /// The ranks that share the points of the analysis; this structure holds the points of this rank.
            pub ranks: $crate::ranks::Ranks,
            /// The parts of the grid that belong to the ranks.
            pub partition: $crate::points::partition::Partition,
        }

        impl<const D: usize> $Points<D> {
            /// Names of the declared fields.
            pub const STORED: &'static [&'static str] =
                &[$(stringify!($fixed),)* $(stringify!($motion),)* $(stringify!($answer),)*];

            /// Stress-free, undeformed points; their order determines the permanent numbers.
            pub fn new(seeds: &[$crate::points::Seed<D>]) -> Self {
                let numbers = (0..seeds.len() as u32).collect();
                $Points::numbered(seeds, numbers, &$crate::ranks::Ranks::default())
            }

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
                let state = $State {
                    $($motion: start::$motion_shape(seeds, $($motion_per,)? $motion_start),)*
                    $($answer: start::$answer_shape(seeds, $($answer_per,)? $answer_start),)*
                };
                $Points {
                    id,
                    cell: vec![0; seeds.len()],
                    $($fixed: start::$fixed_shape(seeds, $($fixed_per,)? $fixed_start),)*
                    trial: state.trial(),
                    converged: state,
                    $($count,)*
                    further: $crate::points::Further::default(),
                    ranks: ranks.clone(),
                    partition: $crate::points::partition::Partition::default(),
                }
            }

            /// Puts the points into another order.
            #[inline(never)]
            pub(super) fn reorder(&mut self, order: &[u32]) {
                use $crate::points::declare::{gather, gather_into};
                self.id = gather(&self.id, order, 1);
                self.cell = gather(&self.cell, order, 1);
                $(self.$fixed = gather(&self.$fixed, order, point_fields!(@per self $($fixed_per)?));)*
                $(
                    let per_point = point_fields!(@per self $($motion_per)?);
                    self.converged.$motion = gather(&self.converged.$motion, order, per_point);
                )*
                // Reuse the trial state: the current step has not written it yet.
                let (old, new) = (&self.converged, &mut self.trial);
                $(gather_into(&old.$answer, order, point_fields!(@per self $($answer_per)?), &mut new.$answer);)*
                self.converged.swap_answers(&mut self.trial);
                self.further.reorder(order);
            }

            /// Keeps the points with these indices, in this order.
            #[allow(dead_code, reason = "tests declare points whose number never changes")]
            #[inline(never)]
            pub(super) fn select(&mut self, order: &[u32]) {
                use $crate::points::declare::gather;
                self.id = gather(&self.id, order, 1);
                self.cell = gather(&self.cell, order, 1);
                $(self.$fixed = gather(&self.$fixed, order, point_fields!(@per self $($fixed_per)?));)*
                $(
                    let per_point = point_fields!(@per self $($motion_per)?);
                    self.converged.$motion = gather(&self.converged.$motion, order, per_point);
                )*
                $(
                    let per_point = point_fields!(@per self $($answer_per)?);
                    self.converged.$answer = gather(&self.converged.$answer, order, per_point);
                )*
                self.trial = self.converged.trial();
                self.further.reorder(order);
            }

            /// Appends other points, in their converged state. Both sets must store the same number of values per
            /// point.
            #[allow(dead_code, reason = "tests declare points whose number never changes")]
            #[inline(never)]
            pub(super) fn append_fields(&mut self, other: &Self) {
                let n = self.id.len();
                use $crate::points::declare::append;
                append(&mut self.id, &other.id, [n, other.id.len()]);
                append(&mut self.cell, &other.cell, [n, other.id.len()]);
                $(
                    let per_point = point_fields!(@per self $($fixed_per)?);
                    append(&mut self.$fixed, &other.$fixed, [n, other.id.len()].map(|n| n * per_point));
                )*
                $(
                    let per_point = point_fields!(@per self $($motion_per)?);
                    let counts = [n, other.id.len()].map(|n| n * per_point);
                    append(&mut self.converged.$motion, &other.converged.$motion, counts);
                )*
                $(
                    let per_point = point_fields!(@per self $($answer_per)?);
                    let counts = [n, other.id.len()].map(|n| n * per_point);
                    append(&mut self.converged.$answer, &other.converged.$answer, counts);
                )*
                self.trial = self.converged.trial();
                self.further.append(&other.further, [n, other.id.len()]);
            }

            /// The converged values of all fields at the points with these indices, as plain numbers; an empty list for
            /// a field without entries.
            #[allow(dead_code, reason = "tests declare points that stay on one rank")]
            pub(super) fn numbers_of_fields(&self, places: &[u32]) -> Vec<Vec<f64>> {
                use $crate::points::value::numbers_at;
                vec![
                    $(numbers_at(&self.$fixed, places, point_fields!(@per self $($fixed_per)?)),)*
                    $(numbers_at(&self.converged.$motion, places, point_fields!(@per self $($motion_per)?)),)*
                    $(numbers_at(&self.converged.$answer, places, point_fields!(@per self $($answer_per)?)),)*
                ]
            }

            /// Replaces all fields by numbers that [`Self::numbers_of_fields`] returned.
            #[allow(dead_code, reason = "tests declare points that stay on one rank")]
            pub(super) fn take_fields(&mut self, fields: Vec<Vec<f64>>) {
                let mut fields = fields.into_iter();
                $(self.$fixed = $crate::points::value::from_numbers(&fields.next().unwrap_or_default());)*
                $(self.converged.$motion = $crate::points::value::from_numbers(&fields.next().unwrap_or_default());)*
                $(self.converged.$answer = $crate::points::value::from_numbers(&fields.next().unwrap_or_default());)*
            }

            /// An empty set of points that stores as many values per point as this one, without further fields.
            #[allow(dead_code, reason = "tests declare points that stay on one rank")]
            pub(super) fn with_counts(&self) -> Self {
                let none = $Points::new(&[]);
                $Points {
                    $($count: self.$count,)*
                    ranks: self.ranks.clone(),
                    partition: self.partition.clone(),
                    ..none
                }
            }

            /// Visits the fields of the converged state as checkpoints store them: in the order of declaration, with
            /// values in the current order of the points; zeros for a field without entries.
            ///
            /// # Errors
            /// The first error that a visit returns.
            pub fn for_each_field<E>(
                &self,
                mut visit: impl FnMut(&$crate::points::StoredField, &mut dyn Iterator<Item = f64>) -> Result<(), E>,
            ) -> Result<(), E> {
                use $crate::points::value::numbers;
                let n = self.id.len();
                $(
                    let field = point_fields!(
                        @field self, Motion, $motion: $motion_type, $([$motion_per])? $motion_unit, $motion_label
                    );
                    let count = n * point_fields!(@per self $($motion_per)?);
                    visit(&field, &mut numbers(&self.converged.$motion, count))?;
                )*
                $(
                    let field = point_fields!(
                        @field self, Answer, $answer: $answer_type, $([$answer_per])? $answer_unit, $answer_label
                    );
                    let count = n * point_fields!(@per self $($answer_per)?);
                    visit(&field, &mut numbers(&self.converged.$answer, count))?;
                )*
                Ok(())
            }

            /// Builds a state from the fields that [`Self::for_each_field`] visits; `read` must return the requested
            /// number of values of a field.
            ///
            /// # Errors
            /// The first error of `read`.
            pub fn read_state<E>(
                &self,
                mut read: impl FnMut(&$crate::points::StoredField, usize) -> Result<Vec<f64>, E>,
            ) -> Result<$State<D>, E> {
                use $crate::points::value::restored;
                let n = self.id.len();
                Ok($State {
                    $($motion: {
                        let field = point_fields!(
                            @field self, Motion, $motion: $motion_type, $([$motion_per])? $motion_unit, $motion_label
                        );
                        restored(&read(&field, n * field.components)?, &self.converged.$motion)
                    },)*
                    $($answer: {
                        let field = point_fields!(
                            @field self, Answer, $answer: $answer_type, $([$answer_per])? $answer_unit, $answer_label
                        );
                        restored(&read(&field, n * field.components)?, &self.converged.$answer)
                    },)*
                })
            }

            /// The converged values of the declared field with this name, with the points in this order.
            pub(crate) fn stored(&self, name: &str, order: &[usize]) -> Option<$crate::points::PointValues> {
                use $crate::points::PointValues;
                $(if name == stringify!($fixed) {
                    let per_point = point_fields!(@per self $($fixed_per)?);
                    return Some(PointValues::of_field(&self.$fixed, per_point, order));
                })*
                $(if name == stringify!($motion) {
                    let per_point = point_fields!(@per self $($motion_per)?);
                    return Some(PointValues::of_field(&self.converged.$motion, per_point, order));
                })*
                $(if name == stringify!($answer) {
                    let per_point = point_fields!(@per self $($answer_per)?);
                    return Some(PointValues::of_field(&self.converged.$answer, per_point, order));
                })*
                None
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

/// Reorders the values of points, `n` for each point; empty if there are no values.
pub(super) fn gather<T: Copy + Send + Sync>(values: &[T], order: &[u32], n: usize) -> Vec<T> {
    if values.is_empty() {
        Vec::new()
    } else if n == 1 {
        order.par_iter().with_min_len(PIECE).map(|&p| values[p as usize]).collect()
    } else {
        order.iter().flat_map(|&p| &values[p as usize * n..][..n]).copied().collect()
    }
}

/// Appends `others` to `values`; `counts` are the lengths of both, and an array without entries stands for zeros.
pub(super) fn append<T: Value>(values: &mut Vec<T>, others: &[T], counts: [usize; 2]) {
    if values.is_empty() && others.is_empty() {
        return;
    }
    // Growth by doubling would take twice the memory even when few points arrive.
    values.reserve_exact((counts[0] + counts[1]).saturating_sub(values.len()));
    values.resize(counts[0], T::ZERO);
    values.extend(others);
    values.resize(counts[0] + counts[1], T::ZERO);
}

/// Like [`gather`], but into an existing array.
pub(super) fn gather_into<T: Copy + Send + Sync>(values: &[T], order: &[u32], n: usize, room: &mut [T]) {
    let places = room.par_chunks_exact_mut(n.max(1)).with_min_len(PIECE);
    places.zip(order).for_each(|(place, &p)| place.copy_from_slice(&values[p as usize * n..][..n]));
}
