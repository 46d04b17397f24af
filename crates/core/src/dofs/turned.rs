//! Nodes with a prescribed direction that is not an axis.

use nalgebra::{DMatrix, DVector};

use super::unless_round_off;

/// A direction counts as dependent on earlier ones if its component orthogonal to them is smaller than this, [-].
const INDEPENDENT: f64 = 1e-8;

/// A prescribed motion of a node along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Along<const N: usize> {
    /// Unit vector.
    pub direction: [f64; N],
    pub increment: f64,
    pub condition: u16,
}

/// A node whose components are taken along its own directions: first the prescribed directions, then the free ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Turned<const N: usize> {
    /// The active node.
    pub node: u32,
    /// Orthonormal directions, `[k][component]`.
    pub directions: [[f64; N]; N],
    /// The prescribed motions along independent directions. Directions 0 to k of the node span the same space as the
    /// directions of the first k + 1 motions.
    prescribed: Vec<Along<N>>,
    /// The other prescribed motions, which follow from those in `prescribed`.
    implied: Vec<Along<N>>,
    /// The prescribed increment along each of the first directions, [length].
    increment: Vec<f64>,
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|c| a[c] * b[c]).sum()
}

/// The part of a vector orthogonal to these orthonormal directions.
fn beside<const N: usize>(vector: &[f64; N], directions: &[[f64; N]]) -> [f64; N] {
    let mut rest = *vector;
    // Orthogonalising twice is enough (Giraud et al. 2005, doi 10.1007/s00211-005-0615-4).
    for direction in directions.iter().chain(directions) {
        let along = dot(&rest, direction);
        (0..N).for_each(|c| rest[c] -= along * direction[c]);
    }
    rest
}

fn unit<const N: usize>(vector: &[f64; N]) -> Option<([f64; N], f64)> {
    let length = dot(vector, vector).sqrt();
    (length > INDEPENDENT).then(|| (vector.map(|x| x / length), length))
}

impl<const N: usize> Turned<N> {
    /// A node with these prescribed motions, in cells of this size, [length].
    ///
    /// # Errors
    /// The two conditions that contradict each other, and their increments.
    pub(super) fn new(node: u32, motions: &[Along<N>], cell: f64) -> Result<Self, ([u16; 2], [f64; 2])> {
        let (mut directions, mut prescribed, mut increment) =
            (Vec::new(), Vec::<Along<N>>::new(), Vec::new());
        let mut implied = Vec::new();
        for motion in motions {
            // The part of the increment that follows from the earlier directions.
            let known: f64 =
                directions.iter().zip(&increment).map(|(e, g)| dot(&motion.direction, e) * g).sum();
            match unit(&beside(&motion.direction, &directions)) {
                Some((direction, length)) => {
                    increment.push((motion.increment - known) / length);
                    directions.push(direction);
                    prescribed.push(*motion);
                }
                None => {
                    let size = motion.increment.abs().max(known.abs());
                    if unless_round_off(motion.increment - known, cell.max(size / INDEPENDENT)) != 0.0 {
                        let shares = shares(&motion.direction, &prescribed, &directions);
                        let involved = |share: &f64| share.abs() > INDEPENDENT;
                        let first = shares.iter().rposition(involved).map_or(motion, |k| &prescribed[k]);
                        return Err(([first.condition, motion.condition], [known, motion.increment]));
                    }
                    implied.push(*motion);
                }
            }
        }
        // The free directions: the orthogonal parts of the axes, in order, except for short ones.
        for axis in 0..N {
            let mut along = [0.0; N];
            along[axis] = 1.0;
            if directions.len() < N
                && let Some((direction, length)) = unit(&beside(&along, &directions))
                && length > 0.5 / (N as f64).sqrt()
            {
                directions.push(direction);
            }
        }
        let directions = std::array::from_fn(|k| directions.get(k).copied().unwrap_or([0.0; N]));
        Ok(Turned { node, directions, prescribed, implied, increment })
    }

    /// Number of prescribed directions.
    pub(super) fn n_held(&self) -> usize {
        self.increment.len()
    }

    /// The prescribed increment along a direction, [length], and its condition.
    pub(super) fn held(&self, k: usize) -> Option<(f64, u16)> {
        Some((*self.increment.get(k)?, self.prescribed[k].condition))
    }

    /// True if the prescribed motions prevent any motion of the node along an axis, up to the round-off of cells of
    /// this size, [length].
    pub(super) fn fixes_axis(&self, axis: usize, cell: f64) -> bool {
        let held = || self.directions.iter().zip(&self.increment);
        let part: f64 = held().map(|(direction, _)| direction[axis] * direction[axis]).sum();
        let moved: f64 = held().map(|(direction, increment)| direction[axis] * increment).sum();
        let size = self.increment.iter().fold(cell, |size: f64, x| size.max(x.abs()));
        1.0 - part < INDEPENDENT && unless_round_off(moved, size) == 0.0
    }

    /// True if a prescribed direction prevents the node from moving freely along an axis.
    pub(super) fn holds_along(&self, axis: usize) -> bool {
        self.directions[..self.n_held()].iter().any(|direction| direction[axis].abs() > INDEPENDENT)
    }

    /// The components of a vector along the directions.
    pub(super) fn components(&self, vector: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|k| dot(&self.directions[k], vector))
    }

    /// The component, along an axis, of a motion given by the unknowns.
    pub(super) fn along(&self, delta_q: &[f64; N], axis: usize) -> f64 {
        (self.n_held()..N).map(|k| delta_q[k] * self.directions[k][axis]).sum()
    }

    /// Adds a motion given by the unknowns.
    pub(super) fn add(&self, delta_q: &[f64; N], motion: &mut [f64; N]) {
        (0..N).for_each(|axis| motion[axis] += self.along(delta_q, axis));
    }

    /// The part of the prescribed motion that an increment does not contain yet.
    pub(super) fn remaining(&self, increment: &[f64; N]) -> [f64; N] {
        let size = dot(increment, increment).sqrt();
        let mut motion = [0.0; N];
        for (direction, prescribed) in self.directions.iter().zip(&self.increment) {
            let rest = prescribed - dot(direction, increment);
            let rest = unless_round_off(rest, size.max(prescribed.abs()));
            (0..N).for_each(|c| motion[c] += rest * direction[c]);
        }
        motion
    }

    /// The part of a force along the prescribed directions.
    pub(super) fn held_part(&self, force: &[f64; N]) -> [f64; N] {
        let mut part = [0.0; N];
        for direction in &self.directions[..self.n_held()] {
            let along = dot(direction, force);
            (0..N).for_each(|c| part[c] += along * direction[c]);
        }
        part
    }

    /// Distributes a reaction among the conditions: each carries a force along its own direction. If the directions
    /// depend on each other, the sum of the squares of these forces is the least possible, so that conditions along the
    /// same direction carry equal forces. Along directions in which conditions fix the node, conditions that move it
    /// carry nothing.
    pub(super) fn for_each_share(
        &self,
        reaction: &[f64; N],
        fixes: impl Fn(usize, &[f64; N]) -> bool,
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let mut carry = |along: &Along<N>, share: f64| {
            for c in 0..N {
                visit(along.condition as usize, c, share * along.direction[c]);
            }
        };
        if !self.implied.is_empty() {
            let bearers = self.bearers(fixes);
            if let Some(multiplier) = self.least_forces(reaction, &bearers) {
                bearers.iter().for_each(|along| carry(along, dot(&along.direction, &multiplier)));
                return;
            }
        }
        let shares = shares(reaction, &self.prescribed, &self.directions);
        self.prescribed.iter().zip(shares).rev().for_each(|(along, share)| carry(along, share));
    }

    /// The conditions that fix the node, and all others whose directions are independent of those in which it is fixed.
    fn bearers(&self, fixes: impl Fn(usize, &[f64; N]) -> bool) -> Vec<Along<N>> {
        let all = || self.prescribed.iter().chain(&self.implied).copied();
        let is_fixed = |along: &Along<N>| fixes(along.condition as usize, &along.direction);
        let mut fixed = Vec::new();
        for along in all().filter(is_fixed) {
            fixed.extend(unit(&beside(&along.direction, &fixed)).map(|(direction, _)| direction));
        }
        all().filter(|along| is_fixed(along) || unit(&beside(&along.direction, &fixed)).is_some()).collect()
    }

    /// The vector whose components along the directions of these conditions are the forces with the least sum of
    /// squares that add up to a reaction.
    fn least_forces(&self, reaction: &[f64; N], bearers: &[Along<N>]) -> Option<[f64; N]> {
        let n = self.n_held();
        let held = &self.directions[..n];
        let mut gram = DMatrix::<f64>::zeros(n, n);
        for along in bearers {
            let parts = DVector::from_iterator(n, held.iter().map(|e| dot(e, &along.direction)));
            gram.ger(1.0, &parts, &parts, 1.0);
        }
        let along_held = DVector::from_iterator(n, held.iter().map(|e| dot(e, reaction)));
        let solution = gram.cholesky()?.solve(&along_held);
        let mut multiplier = [0.0; N];
        for (e, part) in held.iter().zip(&solution) {
            (0..N).for_each(|c| multiplier[c] += part * e[c]);
        }
        Some(multiplier)
    }
}

/// The coefficients of a vector in the directions of independent motions, which span the same space as these
/// orthonormal directions; a part outside this space is ignored. Coefficients beyond the motions are 0.
fn shares<const N: usize>(vector: &[f64; N], motions: &[Along<N>], directions: &[[f64; N]]) -> [f64; N] {
    let mut rest = *vector;
    let mut shares = [0.0; N];
    for (k, Along { direction, .. }) in motions.iter().enumerate().rev() {
        shares[k] = dot(&rest, &directions[k]) / dot(direction, &directions[k]);
        (0..N).for_each(|c| rest[c] -= shares[k] * direction[c]);
    }
    shares
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;

    fn along(direction: [f64; 3], increment: f64, condition: u16) -> Along<3> {
        Along { direction: unit(&direction).unwrap().0, increment, condition }
    }

    #[test]
    fn directions_are_orthonormal_and_give_the_prescribed_increments() {
        let motions = [along([1.0, 2.0, 0.5], 0.3, 0), along([0.0, 1.0, 1.0], -0.2, 1)];
        for n in [1, 2] {
            let turned = Turned::new(7, &motions[..n], 1.0).unwrap();
            for (a, k) in (0..3).flat_map(|a| (0..3).map(move |k| (a, k))) {
                let product = dot(&turned.directions[a], &turned.directions[k]);
                assert!((product - f64::from(u8::from(a == k))).abs() < 1e-15, "{a} {k}: {product}");
            }
            let motion = turned.remaining(&[0.0; 3]);
            for Along { direction, increment, .. } in &motions[..n] {
                assert!((dot(direction, &motion) - increment).abs() < 1e-15);
            }
            assert_eq!(turned.remaining(&motion), [0.0; 3]);
        }
    }

    #[test]
    fn walls_that_are_not_normal_to_each_other_bear_forces_along_their_normals() {
        let motions = [along([1.0, 0.0, 0.0], 0.0, 4), along([1.0, 1.0, 0.0], 0.0, 6)];
        let turned = Turned::new(0, &motions, 1.0).unwrap();
        // The reaction is twice the first normal plus three times the second.
        let h = 0.5f64.sqrt();
        let reaction = [2.0 + 3.0 * h, 3.0 * h, 0.0];
        let mut shares = [[0.0; 3]; 7];
        turned.for_each_share(&reaction, |_, _| false, |condition, c, force| shares[condition][c] += force);
        let expected = [[2.0, 0.0, 0.0], [3.0 * h, 3.0 * h, 0.0]];
        for (found, expected) in [shares[4], shares[6]].iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-14, "{shares:?}");
        }
        assert!(turned.holds_along(0) && turned.holds_along(1) && !turned.holds_along(2));
    }

    #[test]
    fn shares_do_not_depend_on_the_order_of_conditions() {
        let rollers = [[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
        let reaction = [3.0, 1.0, 0.0];
        let mut expected = None;
        for order in [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1]] {
            let motions = order.map(|k| along(rollers[k], 0.0, k as u16));
            let mut shares = [[0.0; 3]; 3];
            let turned = Turned::new(0, &motions, 1.0).unwrap();
            turned.for_each_share(&reaction, |_, _| false, |k, c, force| shares[k][c] += force);
            for c in 0..3 {
                let sum: f64 = shares.iter().map(|share| share[c]).sum();
                assert!((sum - reaction[c]).abs() < 1e-14 && (shares[0][c] - shares[1][c]).abs() < 1e-14);
            }
            let expected = expected.get_or_insert(shares);
            for (found, expected) in shares.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((found - expected).abs() < 1e-14, "{order:?}: {shares:?}");
            }
        }
    }

    #[test]
    fn a_condition_that_fixes_takes_precedence() {
        // The second and the fourth condition fix the node; the first and the third move it.
        let all = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]];
        let reaction = [3.0, 1.0, 0.0];
        for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]] {
            let motions = order.map(|k| along(all[k], 0.0, k as u16));
            let mut shares = [[0.0; 3]; 4];
            let turned = Turned::new(0, &motions, 1.0).unwrap();
            turned.for_each_share(&reaction, |k, _| k % 2 == 1, |k, c, force| shares[k][c] += force);
            let expected = [[0.0; 3], [0.5, 0.5, 0.0], [2.0, 0.0, 0.0], [0.5, 0.5, 0.0]];
            for (found, expected) in shares.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((found - expected).abs() < 1e-14, "{order:?}: {shares:?}");
            }
        }
    }

    #[test]
    fn contradictions_are_found_and_repetitions_are_none() {
        let twice = [along([1.0, 1.0, 0.0], 0.1, 0), along([-1.0, -1.0, 0.0], -0.1, 1)];
        assert_eq!(Turned::new(0, &twice, 1.0).unwrap().n_held(), 1);
        let against = [along([1.0, 1.0, 0.0], 0.1, 0), along([-1.0, -1.0, 0.0], 0.1, 1)];
        assert!(Turned::new(0, &against, 1.0).is_err());
        // Two formulas for the same motion may differ by round-off.
        let round_off = [along([1.0, 1.0, 0.0], 0.0, 0), along([1.0, 1.0, 0.0], -2e-18, 1)];
        assert!(Turned::new(0, &round_off, 1.0).is_ok() && Turned::new(0, &round_off, 1e-9).is_err());
        // Only the first of two conditions contradicts the third.
        let third = [against[0], along([0.0, 0.0, 1.0], 0.0, 1), Along { condition: 2, ..against[1] }];
        assert_eq!(Turned::new(0, &third, 1.0).unwrap_err().0, [0, 2]);
    }
}
