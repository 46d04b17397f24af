//! A background grid whose lines follow prescribed displacements.
//!
//! The grid carries no state between load steps, so its lines can be moved between steps: the grid of a step is a
//! function of the time at which the step starts. A tool or footing then stays on grid lines (the moving mesh of Phuong
//! et al., Comput. Geotech. 73 (2016) 58-71). Lines move as a whole, whatever material their cells contain. If the
//! condition that they follow changes during a run, they keep an offset from its displacement.

use crate::formula::Formula;
use crate::grid::{Axis, CarriedLines, CarryError, Lines, ON_LINE, Structured};

use super::boundary_condition::displacement_at;
use super::{BoundaryCondition, Model, Stepping};

/// Smallest and largest number of equal intervals of a stage at whose ends the motion of the grid is checked before a
/// run, in addition to the times of the curves.
const TIMES: [usize; 2] = [100, 10_000];

/// Consecutive grid lines that follow the displacement that a boundary condition prescribes along their axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FollowingLines {
    /// Axis, from 0.
    pub axis: usize,
    /// Index of the first line.
    pub first: usize,
    /// Index of the last line.
    pub last: usize,
    /// Index of the boundary condition. The lines follow it whether or not it acts in the current stage.
    pub condition: usize,
}

/// The original grid of a model, and its lines that follow boundary conditions.
#[derive(Debug, Clone)]
pub struct MovingGrid<const D: usize> {
    /// The grid at time 0.
    original: Lines<D>,
    following: Vec<FollowingLines>,
    /// For each entry, the displacement of its lines in addition to the one that the condition prescribes, [length]. It
    /// is 0 unless the condition has changed during the run.
    offsets: Vec<f64>,
    /// The time for which the grid of the model has been placed, [time].
    time: f64,
}

/// Reason why lines cannot follow a boundary condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FollowError {
    /// The grid has no lines.
    #[error("only the lines of a structured grid can follow a boundary condition")]
    Unstructured,
    /// The axis, the lines or the boundary condition do not exist.
    #[error("there is no such axis, line or boundary condition")]
    Missing,
    /// Two entries share lines.
    #[error("grid lines would follow two boundary conditions")]
    Overlap {
        /// Index of the other entry, which shares lines with this entry.
        with: usize,
    },
    /// The condition leaves the displacement along the axis free.
    #[error("the boundary condition does not prescribe the displacement along the axis")]
    NotPrescribed,
    /// Nodes of one line would move differently.
    #[error("the prescribed displacement depends on the position, but grid lines move as a whole")]
    DependsOnPosition,
    /// The axis of revolution would move.
    #[error("the grid line on the axis of revolution cannot move")]
    OnAxis,
}

/// Reason why a motion of the grid is impossible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridMotionError {
    /// The load factors of the conditions are unknown before the step.
    #[error("the grid follows prescribed displacements, but the load factor is an unknown")]
    UnknownFactor,
    /// A displacement is not finite.
    #[error("at time {time}, the displacement of the grid lines is {value}")]
    NotFinite {
        /// Index of the entry.
        entry: usize,
        /// Time, [time].
        time: f64,
        /// Displacement of the lines, [length].
        value: f64,
    },
    /// Cells would become too small.
    #[error("at time {time}, between the original grid lines {} = {} and {}, {error}", ["x", "y", "z"][axis % 3], between[0], between[1])]
    Squeezed {
        /// Axis, from 0.
        axis: usize,
        /// Original coordinates between which the cells lie, [length].
        between: [f64; 2],
        /// Time, [time].
        time: f64,
        /// The reason.
        error: CarryError,
    },
    /// The grid would reach beyond the axis of revolution.
    #[error("at time {time}, the grid begins at x = {x:.4}, beyond the axis of revolution x = 0")]
    BeyondAxis {
        /// Time, [time].
        time: f64,
        /// Coordinate of the first line, [length].
        x: f64,
    },
    /// The grid is not in its position for the start of the step. [`Model::place_grid`] moves it there;
    /// `solver::run_stages` does so for every step.
    #[error("the grid moves between steps, but has not been moved into position for this step")]
    NotPlaced,
}

impl<const D: usize> BoundaryCondition<D> {
    /// The displacement that the condition prescribes along an axis: a sign, and the formula to which it applies.
    /// `None` if the condition does not prescribe a displacement along this axis.
    fn along(&self, axis: usize) -> Option<(f64, &Formula)> {
        let number = match &self.axes {
            None => axis,
            Some(axes) => (0..D).find(|&k| (axes[k][axis].abs() - 1.0).abs() < 1e-12)?,
        };
        let sign = self.axes.map_or(1.0, |axes| axes[number][axis].signum());
        self.displacement[number].as_ref().map(|formula| (sign, formula))
    }
}

impl<const D: usize> MovingGrid<D> {
    /// The displacement that the condition of an entry prescribes at a load factor, [length].
    fn prescribed(&self, model: &Model<D>, entry: usize, time: f64, factor: f64) -> f64 {
        let FollowingLines { axis, condition, .. } = self.following[entry];
        // Nothing has moved yet at time 0, whatever the value of the curve.
        match model.boundary_conditions[condition].along(axis).filter(|_| time > 0.0) {
            Some((sign, formula)) => sign * displacement_at(formula, &[0.0; D], &[0.0; D], factor),
            None => 0.0,
        }
    }

    /// The carried lines along each axis, ascending, at a time when the boundary conditions have these load factors.
    fn carried(
        &self,
        model: &Model<D>,
        time: f64,
        factor: &dyn Fn(usize) -> f64,
    ) -> Result<[Vec<CarriedLines>; D], GridMotionError> {
        let mut carried: [Vec<CarriedLines>; D] = std::array::from_fn(|_| Vec::new());
        for (entry, lines) in self.following.iter().enumerate() {
            let by = self.offsets[entry] + self.prescribed(model, entry, time, factor(lines.condition));
            if !by.is_finite() {
                return Err(GridMotionError::NotFinite { entry, time, value: by });
            }
            carried[lines.axis].push(CarriedLines { first: lines.first, last: lines.last, by });
        }
        carried.iter_mut().for_each(|lines| lines.sort_unstable_by_key(|lines| lines.first));
        // The first line along x is among the first carried lines, if it moves at all.
        let first = self.original.origin()[0];
        let by = carried[0].first().filter(|lines| lines.first == 0).map_or(0.0, |lines| lines.by);
        if model.revolved && first + by < -ON_LINE * self.original.axes()[0].size(0) {
            return Err(GridMotionError::BeyondAxis { time, x: first + by });
        }
        for (axis, (before, lines)) in self.original.axes().iter().zip(&carried).enumerate() {
            before.check_carried(lines).map_err(|error| squeezed(before, axis, time, error))?;
        }
        Ok(carried)
    }

    /// The grid at a time when the boundary conditions have these load factors.
    fn at(
        &self,
        model: &Model<D>,
        time: f64,
        factor: &dyn Fn(usize) -> f64,
    ) -> Result<Structured<D>, GridMotionError> {
        let carried = self.carried(model, time, factor)?;
        let mut axes = self.original.axes().clone();
        for (axis, (before, lines)) in self.original.axes().iter().zip(&carried).enumerate() {
            axes[axis] = before.carried(lines).map_err(|error| squeezed(before, axis, time, error))?;
        }
        Ok(Structured::with_axes(axes))
    }
}

fn squeezed(before: &Axis, axis: usize, time: f64, error: CarryError) -> GridMotionError {
    let [first, last] = match &error {
        CarryError::Squeezed { lines, .. } => *lines,
        CarryError::Coincident(lines) => [lines.number, lines.number + 1],
    };
    GridMotionError::Squeezed { axis, between: [before.line(first), before.line(last)], time, error }
}

impl<const D: usize> Model<D> {
    /// Makes lines of the model's grid, which must be in its original position, follow boundary conditions.
    ///
    /// # Errors
    /// The indices of the entries that cannot follow, each with the reason.
    pub fn follow(&mut self, following: Vec<FollowingLines>) -> Result<(), Vec<(usize, FollowError)>> {
        let Some(lines) = self.grid.lines() else { return Err(vec![(0, FollowError::Unstructured)]) };
        let faults = following.iter().enumerate().filter_map(|(entry, follower)| {
            Some((entry, self.may_follow(lines, &following[..entry], follower).err()?))
        });
        let faults: Vec<_> = faults.collect();
        if faults.is_empty() {
            let offsets = vec![0.0; following.len()];
            self.moving_grid = Some(MovingGrid { original: lines.clone(), following, offsets, time: 0.0 });
        }
        if faults.is_empty() { Ok(()) } else { Err(faults) }
    }

    fn may_follow(
        &self,
        lines: &Lines<D>,
        others: &[FollowingLines],
        follower: &FollowingLines,
    ) -> Result<(), FollowError> {
        let FollowingLines { axis, first, last, condition } = *follower;
        let axes = lines.axes().get(axis).filter(|along| first <= last && last <= along.n_cells());
        let (Some(along), Some(condition)) = (axes, self.boundary_conditions.get(condition)) else {
            return Err(FollowError::Missing);
        };
        let shares =
            |other: &FollowingLines| other.axis == axis && other.first <= last && first <= other.last;
        if let Some(with) = others.iter().position(shares) {
            return Err(FollowError::Overlap { with });
        }
        let Some((_, formula)) = condition.along(axis) else { return Err(FollowError::NotPrescribed) };
        if (0..2 * D).any(|variable| formula.depends_on(variable)) {
            return Err(FollowError::DependsOnPosition);
        }
        if self.revolved && axis == 0 && along.line(first).abs() <= ON_LINE * along.size_around(first) {
            return Err(FollowError::OnAxis);
        }
        Ok(())
    }

    /// The grid of a step of the current stage that starts at this time; `None` if the grid does not move.
    ///
    /// # Errors
    /// [`GridMotionError`] if the grid cannot move to its position for this step.
    pub fn grid_at(&self, time: f64) -> Result<Option<Structured<D>>, GridMotionError> {
        let Some(moving) = &self.moving_grid else { return Ok(None) };
        if self.stepping.control.has_unknown_factor() {
            return Err(GridMotionError::UnknownFactor);
        }
        let factor = |condition: usize| self.boundary_conditions[condition].curve.factor(time);
        moving.at(self, time, &factor).map(Some)
    }

    /// The offsets, [length], with which the lines of this model continue at `time` from the positions of the lines of
    /// the model `before`; from then on, they move by the change of the displacement that their condition prescribes.
    /// Empty if the grid does not move. Both models must be in the same stage, and the same lines must follow the same
    /// conditions.
    pub fn offsets_of_lines(&self, before: &Model<D>, time: f64) -> Vec<f64> {
        let (Some(moving), Some(moved)) = (&self.moving_grid, &before.moving_grid) else { return Vec::new() };
        let prescribed = |moving: &MovingGrid<D>, model: &Model<D>, entry: usize| {
            let condition = moving.following[entry].condition;
            moving.prescribed(model, entry, time, model.boundary_conditions[condition].curve.factor(time))
        };
        let offset = |(entry, offset): (usize, &f64)| {
            offset + (prescribed(moved, before, entry) - prescribed(moving, self, entry))
        };
        moved.offsets.iter().enumerate().map(offset).collect()
    }

    /// Sets the offsets of lines from the displacements that their conditions prescribe, one for each entry, [length].
    ///
    /// # Errors
    /// The reason, if they are not offsets of these lines.
    pub fn offset_lines(&mut self, offsets: &[f64]) -> Result<(), String> {
        let kept = self.moving_grid.as_mut().map(|moving| &mut moving.offsets);
        match kept.filter(|kept| kept.len() == offsets.len()) {
            Some(kept) if offsets.iter().all(|by| by.is_finite()) => kept.copy_from_slice(offsets),
            _ => return Err("its grid lines do not follow the same conditions".to_owned()),
        }
        Ok(())
    }

    /// Moves the grid to its position for a step of the current stage that starts at this time.
    ///
    /// # Errors
    /// The same as for [`Model::grid_at`].
    pub fn place_grid(&mut self, time: f64) -> Result<(), GridMotionError> {
        if let Some(grid) = self.grid_at(time)? {
            self.grid = Box::new(grid);
            self.moving_grid.iter_mut().for_each(|moving| moving.time = time);
        }
        Ok(())
    }

    /// True if the grid is in the position for a step that starts at this time.
    pub fn has_grid_of(&self, time: f64) -> bool {
        self.moving_grid.as_ref().is_none_or(|moving| moving.time == time)
    }

    /// Checks the motion of the grid over all stages before a run, at evenly spaced times and at the times of the
    /// curves.
    ///
    /// # Errors
    /// The first [`GridMotionError`] that occurs.
    pub fn check_grid_motion(&self) -> Result<(), GridMotionError> {
        let Some(moving) = &self.moving_grid else { return Ok(()) };
        let mut curves: Vec<_> = self.boundary_conditions.iter().map(|c| c.curve.clone()).collect();
        let steppings: Vec<&Stepping> = match self.stages.as_slice() {
            [] => vec![&self.stepping],
            stages => stages.iter().map(|stage| &stage.stepping).collect(),
        };
        for (number, stepping) in steppings.into_iter().enumerate() {
            if stepping.control.has_unknown_factor() {
                return Err(GridMotionError::UnknownFactor);
            }
            let (from, to) = (stepping.start_time, stepping.end_time);
            // The model is already in the first stage.
            if let Some(stage) = self.stages.get(number).filter(|_| number > 0) {
                for (curve, course) in curves.iter_mut().zip(&stage.boundary_conditions) {
                    course.draw(curve, stepping, curve.factor(from));
                }
            }
            let parts = stepping.count * TIMES[0].div_ceil(stepping.count.max(1));
            let parts = parts.clamp(1, TIMES[1]);
            let mut times: Vec<f64> =
                (0..=parts).map(|part| from + (to - from) * (part as f64 / parts as f64)).collect();
            let followed = moving.following.iter().map(|lines| &curves[lines.condition]);
            times.extend(followed.flat_map(|curve| curve.times()).filter(|time| (from..to).contains(time)));
            times.sort_unstable_by(f64::total_cmp);
            for time in times {
                moving.carried(self, time, &|condition: usize| curves[condition].factor(time))?;
            }
        }
        Ok(())
    }
}
