//! The fields of the points, each declared once, and what is done with all of them.

use super::column::{Column, append, gather};
use super::declare::{StoredField, point_fields};
use super::seed::Seed;
use super::value::PointValues;
use crate::ranks::Ranks;
use crate::tensor::{Mat3, Sym3};

point_fields! {
    /// All material points of an analysis, as a structure of arrays.
    ///
    /// Newton iterations write only `trial`, and only [`Points::commit`] makes it the converged state; an abandoned
    /// load step therefore leaves nothing to undo. Points are kept grouped by the grid cell that holds them; `id` is
    /// the permanent number of a point.
    struct Points {
        counts {
            /// Number of history variables kept per point: the largest number that any law needs.
            history_len = |seed| seed.history.len();
            /// Number of domain corners stored per point: the largest number that any point has.
            corners_per_point = |seed| seed.corners.len();
        }
        fixed {
            /// Body number.
            body: u16 = one(|seed| seed.body), in "-";
            /// Original position X.
            original_position: [f64; D] = one(|seed| seed.position), in "length";
            /// Original half lengths l_p0 of the domain; empty if no point has half lengths.
            original_half_lengths: [f64; D] = one_or_none(|seed| seed.half_lengths), in "length";
            /// Original corners of domains given by corners; the corners of a point are at [`Points::corner_range`].
            original_corners: [f64; D] = up_to[corners_per_point](|seed| &seed.corners), in "length";
            /// Original volume V_p0.
            original_volume: f64 = one(|seed| seed.volume), in "volume";
            /// Mass m_p.
            mass: f64 = one(|seed| seed.mass), in "mass";
            /// True if the point belongs to the outer layer of its body at the start.
            outer_layer: bool = one(|seed| seed.outer_layer), in "-";
            /// Number of corners of the domain of the point: 2^D for quadrilaterals and hexahedra, D + 1 for triangles
            /// and tetrahedra, 0 for points whose domain is not given by corners. Empty if no point has corners.
            corner_count: u8 = one_or_none(|seed| seed.corners.len() as u8), in "-";
        }
    }

    /// The fields of the points that change from step to step.
    struct State {
        motion {
            /// Position x_p.
            position: [f64; D] = one(|seed| seed.position), in "length", called "position";
            /// Half lengths l_p of the domain along the axes, or of the box with which a standard point touches tools;
            /// zero for points without half lengths, and empty if no point has any.
            half_lengths: [f64; D] = one_or_none(|seed| seed.half_lengths), in "length", called "half length";
            /// Corners of domains given by corners; the corners of a point are at [`Points::corner_range`].
            corners: [f64; D] = up_to[corners_per_point](|seed| &seed.corners), in "length", called "domain";
            /// Deformation gradient F from the original configuration.
            deformation_gradient: Mat3 = one(|_| Mat3::identity()), in "-", called "deformation gradient";
        }
        answer {
            /// Elastic strain in the strain measure of the law; for most laws, the logarithmic strain ε^e.
            elastic_strain: Sym3 = one(|_| Sym3::ZERO), in "-", called "elastic strain";
            /// Kirchhoff stress τ.
            kirchhoff_stress: Sym3 = one(|_| Sym3::ZERO), in "stress", called "Kirchhoff stress";
            /// History variables of the law, [`Points::history_len`] per point.
            history: f64 = up_to[history_len](|seed| &seed.history), in "-", called "history";
        }
    }
}

impl<const D: usize> State<D> {
    /// The initial trial state of a step that begins from this state.
    pub(super) fn trial(&self) -> Self {
        let mut trial = State::default();
        let answers = trial.answers_mut().into_iter().zip(self.columns().split_off(Self::N_MOTION));
        answers.for_each(|(new, old)| new.copy(old));
        trial
    }

    /// Swaps the responses of laws with those of another state.
    pub(super) fn swap_answers(&mut self, other: &mut Self) {
        self.answers_mut().into_iter().zip(other.answers_mut()).for_each(|(own, other)| own.swap(other));
    }

    /// Takes over a trial state, including the fields of the motion if the trial state has them.
    pub(super) fn take(&mut self, trial: &mut Self) {
        self.swap_answers(trial);
        let motion = || self.columns().into_iter().zip(trial.columns()).take(Self::N_MOTION);
        if motion().all(|(own, moved)| own.len() == moved.len()) {
            self.motion_mut().into_iter().zip(trial.motion_mut()).for_each(|(own, moved)| own.swap(moved));
            trial.forget_motion();
        }
    }

    /// Allocates the fields of the motion with the lengths of this converged state; the caller must write every value.
    pub(crate) fn make_room_for_motion(&mut self, converged: &Self) {
        let motion = self.motion_mut().into_iter().zip(converged.columns());
        motion.for_each(|(room, column)| room.resize(column.len()));
    }

    /// Discards the fields of the motion and frees their memory.
    pub(crate) fn forget_motion(&mut self) {
        self.motion_mut().into_iter().for_each(Column::forget);
    }

    /// Number of entries of each field.
    pub(super) fn lengths(&self) -> Vec<usize> {
        self.columns().into_iter().map(Column::len).collect()
    }

    fn motion_mut(&mut self) -> Vec<&mut dyn Column> {
        let mut columns = self.columns_mut();
        columns.truncate(Self::N_MOTION);
        columns
    }

    fn answers_mut(&mut self) -> Vec<&mut dyn Column> {
        self.columns_mut().split_off(Self::N_MOTION)
    }
}

impl<const D: usize> Points<D> {
    /// Stress-free, undeformed points; their order determines the permanent numbers.
    pub fn new(seeds: &[Seed<D>]) -> Self {
        let numbers = (0..seeds.len() as u32).collect();
        Points::numbered(seeds, numbers, &Ranks::default())
    }

    /// Number of values per point in each column.
    fn per_point(&self) -> Vec<usize> {
        let fields = self.stored_fields().into_iter().zip(self.columns());
        fields.map(|(field, column)| field.components / column.width()).collect()
    }

    /// Puts the points into another order.
    #[inline(never)]
    pub(super) fn reorder(&mut self, order: &[u32]) {
        self.id = gather(&self.id, order, 1);
        self.cell = gather(&self.cell, order, 1);
        let mut per_point = self.per_point();
        let n_answers = self.converged.answers_mut().len();
        let answer_lengths = per_point.split_off(per_point.len() - n_answers);
        self.columns_mut().into_iter().zip(per_point).for_each(|(column, n)| column.reorder(order, n));
        // Reuse the trial state: the current step has not written it yet.
        let answers = self.converged.columns().split_off(State::<D>::N_MOTION);
        for ((old, new), n) in answers.into_iter().zip(self.trial.answers_mut()).zip(answer_lengths) {
            old.reorder_into(order, n, new);
        }
        self.converged.swap_answers(&mut self.trial);
        self.further.reorder(order);
    }

    /// Keeps the points with these indices, in this order.
    #[inline(never)]
    pub(super) fn select(&mut self, order: &[u32]) {
        self.id = gather(&self.id, order, 1);
        self.cell = gather(&self.cell, order, 1);
        let per_point = self.per_point();
        self.columns_mut().into_iter().zip(per_point).for_each(|(column, n)| column.reorder(order, n));
        self.trial = self.converged.trial();
        self.further.reorder(order);
    }

    /// Appends other points, in their converged state. Both sets must store the same number of values per point.
    #[inline(never)]
    pub(super) fn append_fields(&mut self, other: &Self) {
        let counts = [self.len(), other.len()];
        append(&mut self.id, &other.id, counts);
        append(&mut self.cell, &other.cell, counts);
        let per_point = self.per_point();
        for ((column, others), n) in self.columns_mut().into_iter().zip(other.columns()).zip(per_point) {
            column.append(others, counts.map(|count| count * n));
        }
        self.trial = self.converged.trial();
        self.further.append(&other.further, counts);
    }

    /// The converged values of all fields at the points with these indices, as plain numbers; an empty list for a field
    /// without entries.
    pub(super) fn numbers_of_fields(&self, places: &[u32]) -> Vec<Vec<f64>> {
        let columns = self.columns().into_iter().zip(self.per_point());
        columns.map(|(column, n)| column.numbers_at(places, n)).collect()
    }

    /// Replaces all fields by numbers that [`Self::numbers_of_fields`] returned.
    pub(super) fn take_fields(&mut self, fields: &[Vec<f64>]) {
        self.columns_mut().into_iter().zip(fields).for_each(|(column, numbers)| column.take_numbers(numbers));
    }

    /// An empty set of points that stores as many values per point as this one, without further fields.
    pub(super) fn with_counts(&self) -> Self {
        Points {
            history_len: self.history_len,
            corners_per_point: self.corners_per_point,
            ranks: self.ranks.clone(),
            partition: self.partition.clone(),
            ..Points::new(&[])
        }
    }

    /// Visits the fields of the converged state as checkpoints store them: in the order of declaration, with values in
    /// the current order of the points; zeros for a field without entries.
    ///
    /// # Errors
    /// The first error that a visit returns.
    pub fn for_each_field<E>(
        &self,
        mut visit: impl FnMut(&StoredField, &mut dyn Iterator<Item = f64>) -> Result<(), E>,
    ) -> Result<(), E> {
        for (field, column) in self.fields_of_state().iter().zip(self.converged.columns()) {
            visit(field, &mut *column.numbers(self.len() * field.components / column.width()))?;
        }
        Ok(())
    }

    /// Builds a state from the fields that [`Self::for_each_field`] visits; `read` must return the requested number of
    /// values of a field.
    ///
    /// # Errors
    /// The first error of `read`.
    pub fn read_state<E>(
        &self,
        mut read: impl FnMut(&StoredField, usize) -> Result<Vec<f64>, E>,
    ) -> Result<State<D>, E> {
        let mut state = State::default();
        let columns = state.columns_mut().into_iter().zip(self.converged.columns());
        for (field, (column, present)) in self.fields_of_state().iter().zip(columns) {
            let numbers = read(field, self.len() * field.components)?;
            if present.len() > 0 {
                column.take_numbers(&numbers);
            }
        }
        Ok(state)
    }

    /// The declared fields of the state.
    fn fields_of_state(&self) -> Vec<StoredField> {
        let mut fields = self.stored_fields();
        fields.split_off(fields.len() - self.converged.columns().len())
    }

    /// The converged values of the declared field with this name, with the points in this order.
    pub(crate) fn stored(&self, name: &str, order: &[usize]) -> Option<PointValues> {
        let place = Self::STORED.iter().position(|stored| *stored == name)?;
        Some(self.columns()[place].values(self.per_point()[place], order))
    }
}
