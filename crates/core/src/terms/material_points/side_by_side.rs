//! The responses of several points of one law, which are evaluated at once.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::basis::LinkBuffer;
use crate::stress::{MOST_HISTORY, Mechanics, PointResponse};
use crate::tensor::Lanes;

use super::evaluation::{Task, Trial};

/// The responses of points in the lanes.
pub(super) type InLanes<W> = Option<[PointResponse<W>; Lanes::WIDTH]>;

/// Consecutive points of one body, at most one for each lane.
pub(super) struct SideBySide<'t, 'a, 's, 'r, const D: usize, M: Mechanics<D>> {
    pub(super) task: &'t Task<'a, D, M>,
    pub(super) group: usize,
    pub(super) points: Range<usize>,
    pub(super) trial: &'t mut Trial<'s, D>,
    pub(super) room: &'t mut LinkBuffer<'r, D>,
    /// Receives the responses; `None` if a point fails or if the law cannot evaluate several points at once. Written in
    /// place, because responses are large and every move copies them.
    pub(super) responses: &'t mut InLanes<M::Previous>,
}

impl<const D: usize, M: Mechanics<D>> SideBySide<'_, '_, '_, '_, D, M> {
    /// Evaluates the points and stores their history variables.
    // Inlined, this function would be compiled once for each form of the stiffness.
    #[inline(never)]
    pub(super) fn respond(self) {
        Arch::new().dispatch(self);
    }
}

impl<const D: usize, M: Mechanics<D>> WithSimd for SideBySide<'_, '_, '_, '_, D, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let SideBySide { task, group, points, trial, room, responses } = self;
        let law = task.law(points.start);
        let kept = law.state_fields().len();
        // Unused lanes repeat the last point.
        let (p, last) = (points.start, points.end - 1);
        let of_lane = [p, last.min(p + 1), last.min(p + 2), last.min(p + 3)];
        let [a, b, c, d] = of_lane;
        let starts = [&task.start[a], &task.start[b], &task.start[c], &task.start[d]];
        // A closure might not be inlined, and would then be compiled without vector instructions.
        let increments = [
            task.increment(group, a, room),
            task.increment(group, b, room),
            task.increment(group, c, room),
            task.increment(group, d, room),
        ];
        let n = task.history_len;
        let mut history = [Lanes::ZERO; MOST_HISTORY];
        for (h, lanes) in history[..kept].iter_mut().enumerate() {
            *lanes = Lanes::gather(|l| task.old_history[of_lane[l] * n + h]);
        }
        *responses = M::respond_vectorised(starts, &increments, law, &mut history[..kept]);
        if responses.is_none() {
            return;
        }
        for p in points.clone() {
            for (h, lanes) in history[..kept].iter().enumerate() {
                trial.history[(p - trial.first) * n + h] = lanes.0[p - points.start];
            }
        }
    }
}
