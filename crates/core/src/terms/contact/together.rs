//! What the ranks of a run determine together about all contact points.

use super::Contact;
use super::agreement::any_of_each;
use super::motion::farthest;
use crate::step::At;

impl<const D: usize> Contact<D> {
    /// The largest displacement of a node, [length], and whether this is the start of the iterations.
    pub(super) fn motion<const N: usize>(&self, at: At<N>) -> (f64, bool) {
        let moves = at.delta_d.iter().flatten().chain(at.globals).any(|u| *u != 0.0);
        let mut numbers = [farthest::<D, N>(at.delta_d), f64::from(u8::from(moves))];
        self.reduction.maximum(&mut numbers);
        (numbers[0], numbers[1] == 0.0)
    }

    /// For each tool, true if contact points touch it, and true if one of them does not slide with friction.
    pub(super) fn touched(&self) -> [Vec<bool>; 2] {
        let n = self.tools.len();
        let mut flags = vec![false; 2 * n];
        for (_, candidate, _, touch) in self.touching() {
            let tool = candidate.key.tool as usize;
            flags[tool] = true;
            flags[n + tool] |= !touch.slides_with_friction();
        }
        any_of_each(&self.reduction, &mut flags);
        let holds = flags.split_off(n);
        [flags, holds]
    }
}
