//! The responses of points to the mean dilatation of their cell.
//!
//! Their evaluation does not depend on the form of the stiffness to which the points contribute, so it is compiled once
//! for all forms.
#![allow(non_snake_case)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::basis::LinkBuffer;
use crate::stress::{CellStrain, MAX_HISTORY, Mechanics, PointResponse, suits_lanes};
use crate::tensor::Lanes;
use crate::terms::failure::PointFailure;

use super::cell_room::{CellRoom, Motion, barred};
use super::evaluation::{Task, Trial};

/// The points of one material in a group, whose dilatation is replaced by their mean dilatation.
pub(super) struct Averaged<'t, 'a, 's, 'r, const D: usize, M: Mechanics<D>> {
    pub(super) task: &'t Task<'a, D, M>,
    pub(super) group: usize,
    /// The points of the group that may be of this material.
    pub(super) points: Range<usize>,
    pub(super) kind: Kind,
    pub(super) trial: &'t mut Trial<'s, D>,
    pub(super) room: &'t mut LinkBuffer<'r, D>,
    pub(super) cell: &'t mut CellRoom<D, M>,
}

/// The material of a point and the deformation that it sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) material: usize,
    pub(super) strain: CellStrain,
}

/// The responses found.
pub(super) enum Found {
    /// No responses, because there is only this point: the mean dilatation is its own.
    Alone(usize),
    /// The responses in the working space of the cell.
    Together {
        /// Volume of the points.
        volume: f64,
        /// Σ V⁰π n.
        sum: f64,
        /// True if the law has isotropic moduli.
        isotropic: bool,
    },
}

impl<const D: usize, M: Mechanics<D>> Averaged<'_, '_, '_, '_, D, M> {
    /// Evaluates the points, and stores their stress and strain.
    // Inlined, this function would be compiled once for each form of the stiffness.
    #[inline(never)]
    pub(super) fn find(self) -> Result<Found, PointFailure> {
        Arch::new().dispatch(self)
    }
}

impl<const D: usize, M: Mechanics<D>> WithSimd for Averaged<'_, '_, '_, '_, D, M> {
    type Output = Result<Found, PointFailure>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        self.respond()
    }
}

impl<const D: usize, M: Mechanics<D>> Averaged<'_, '_, '_, '_, D, M> {
    #[inline(always)]
    fn respond(&mut self) -> Result<Found, PointFailure> {
        let (mut before, mut after) = (0.0, 0.0);
        let task = self.task;
        let mut moved = std::mem::take(&mut self.cell.moved);
        moved.clear();
        moved.reserve(self.points.len());
        for p in self.points.clone().filter(|p| task.kind(*p) == self.kind) {
            let motion = Motion::new(p, task.increment(self.group, p, self.room))?;
            let volume = task.start[p].volume_n;
            before += volume;
            after += volume * motion.dJ;
            moved.push((p, motion));
        }
        let found = match moved[..] {
            [(p, _)] => Ok(Found::Alone(p)),
            _ => self.respond_together(&moved, after / before).map(|(sum, isotropic)| Found::Together {
                volume: after,
                sum,
                isotropic,
            }),
        };
        self.cell.moved = moved;
        found
    }

    /// Evaluates the responses to the mean dilatation `theta`; returns Σ V⁰π n, and true if the law has isotropic
    /// moduli.
    #[inline(always)]
    fn respond_together(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
    ) -> Result<(f64, bool), PointFailure> {
        let task = self.task;
        // Growing the vectors in steps would copy the responses again and again.
        let n = moved.len();
        let mut sum = 0.0;
        if self.respond_isotropic(moved, theta, &mut sum)? {
            return Ok((sum, true));
        }
        self.cell.averaging.clear();
        self.cell.averaging.reserve(n);
        for some in moved.chunks(Lanes::WIDTH) {
            if self.respond_side_by_side(some, theta, &mut sum) {
                continue;
            }
            for (p, motion) in some {
                let (barred, factor) = barred::<D, M>(motion, theta);
                let (old, new) = task.histories(*p, self.trial);
                let response = M::respond_averaging(&task.start[*p], &barred, task.law(*p), old, new);
                let response = response.map_err(|error| PointFailure { point: *p, error })?;
                sum += self.keep(*p, &response);
                self.cell.averaging.push((response.weak, factor));
            }
        }
        Ok((sum, false))
    }

    /// Evaluates the responses of points whose law has isotropic moduli; returns true if it did so.
    #[inline(always)]
    fn respond_isotropic(
        &mut self,
        moved: &[(usize, Motion<D>)],
        theta: f64,
        sum: &mut f64,
    ) -> Result<bool, PointFailure> {
        self.cell.isotropic.clear();
        self.cell.isotropic.reserve(moved.len());
        for (p, motion) in moved {
            let (barred, factor) = barred::<D, M>(motion, theta);
            let (start, law) = (&self.task.start[*p], self.task.law(*p));
            let Some(response) = M::respond_averaging_isotropic(start, &barred, law) else {
                return Ok(false);
            };
            let response = response.map_err(|error| PointFailure { point: *p, error })?;
            *sum += self.keep(*p, &response);
            self.cell.isotropic.push((response.weak, factor));
        }
        Ok(true)
    }

    /// Evaluates the responses of several points at once, if their law supports this; returns true if it did so.
    #[inline(always)]
    fn respond_side_by_side(&mut self, moved: &[(usize, Motion<D>)], theta: f64, sum: &mut f64) -> bool {
        let task = self.task;
        let law = task.law(moved[0].0);
        if !M::VECTORISED || !suits_lanes(law) {
            return false;
        }
        let kept = law.state_fields().len();
        // Unused lanes repeat the last point.
        let last = moved.len() - 1;
        let lanes_of: [usize; Lanes::WIDTH] = std::array::from_fn(|l| moved[l.min(last)].0);
        let starts = lanes_of.map(|p| &task.start[p]);
        let mut factors = [1.0; Lanes::WIDTH];
        let mut increments = [moved[last].1.increment; Lanes::WIDTH];
        for l in 0..Lanes::WIDTH {
            (increments[l], factors[l]) = barred::<D, M>(&moved[l.min(last)].1, theta);
        }
        let n = task.history_len;
        let mut history = [Lanes::ZERO; MAX_HISTORY];
        for (h, lanes) in history[..kept].iter_mut().enumerate() {
            *lanes = Lanes::gather(|l| task.old_history[lanes_of[l] * n + h]);
        }
        let Some(found) = M::respond_averaging_vectorised(starts, &increments, law, &mut history[..kept])
        else {
            return false;
        };
        // By reference: responses are large, and every move copies them.
        for (l, (p, _)) in moved.iter().enumerate() {
            let here = p - self.trial.first;
            for (h, lanes) in history[..kept].iter().enumerate() {
                self.trial.history[here * n + h] = lanes.0[l];
            }
            *sum += self.keep(*p, &found[l]);
            self.cell.averaging.push((found[l].weak, factors[l]));
        }
        true
    }

    /// Stores the stress and strain of a point, and returns its contribution to Σ V⁰π n over its cell.
    #[inline(always)]
    fn keep<W>(&mut self, p: usize, response: &PointResponse<W>) -> f64 {
        self.trial.keep(p, response);
        let start = &self.task.start[p];
        let [xx, yy, zz, ..] = response.tau.0;
        let trace = if M::DILATED == 2 { xx + yy } else { xx + yy + zz };
        start.volume_n / start.J_n * trace
    }
}
