//! The measure of equilibrium: eq. (40) for each connected part of the bodies, and the limit that round-off sets.
//!
//! Each part is judged by its own forces: a stiff or heavily loaded body elsewhere says nothing about it. If round-off
//! prevents a part from meeting the tolerance, the step may still be accepted, and is then marked, provided that the
//! out-of-balance force is round-off of each node's own equations and small relative to the forces on the part. The
//! reported residual excludes only parts that carry nothing, up to round-off and residual stresses; other parts without
//! external forces and reactions are measured relative to their internal force.
//!
//! Each field beside the displacement is measured by its own forces, so units do not mix; a step is in equilibrium when
//! every field meets the tolerance.

pub(super) mod body_residual;
pub(super) mod round_off;

use std::collections::BTreeSet;
use std::ops::Range;

use crate::assembly::System;
use crate::basis::{Connectivity, JoinedParts};
use crate::points::Points;
use crate::ranks::Reduction;
use crate::region::vector::norm;
use crate::step::Nodal;

use round_off::{ACCUMULATED, EvaluatedAt};

/// Largest accepted residual of a part, and largest accepted resultant of its out-of-balance force relative to the sum
/// of the magnitudes of its forces, if round-off prevents smaller ones, [-].
pub(super) const MAX_ROUND_OFF: f64 = 1e-6;

/// A part without loads counts as unloaded if its reactions are less than this fraction of the largest force that its
/// bodies have carried: fresh grids leave residual stresses of this order, [-].
const UNLOADED: f64 = 1e-4;

/// The connected parts of the active nodes, and the fields, whose equations are measured by separate norms.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    /// Part number of each node.
    at_node: Vec<u32>,
    /// Number of parts.
    n: usize,
    /// Components of each field; the displacement comes first.
    fields: Vec<Range<usize>>,
    /// The nodes shared with other ranks, and the ranks.
    reduction: Reduction,
    /// Numbers of the bodies that each part belongs to, ascending.
    bodies: Vec<Vec<usize>>,
    /// For each part, the largest force that its bodies have carried in earlier steps, [force].
    carried: Vec<f64>,
}

impl Parts {
    /// Parts of the nodes, and the components of each field.
    pub(super) fn new(joined: &JoinedParts, reduction: &Reduction, fields: Vec<Range<usize>>) -> Parts {
        let n = joined.lowest.len();
        let (at_node, reduction) = (joined.at_node.clone(), reduction.clone());
        Parts { at_node, n, fields, reduction, bodies: vec![vec![0]; n], carried: vec![0.0; n] }
    }

    /// Adds the bodies of each part, and the largest force that each body has carried in earlier steps.
    pub(super) fn with_bodies<const D: usize>(
        mut self,
        points: &Points<D>,
        links: &Connectivity<D>,
        bodies: usize,
        carried: &[f64],
    ) -> Parts {
        if bodies > 1 {
            let mut by_part = vec![BTreeSet::new(); self.n];
            for group in 0..links.n_groups() {
                let nodes = links.nodes_of(group);
                for p in links.points_of(group) {
                    if let Some(place) = links.local_nodes(p).first() {
                        let part = self.at_node[nodes[*place as usize] as usize];
                        by_part[part as usize].insert(points.body[p] as usize);
                    }
                }
            }
            for other in self.reduction.gather_all(by_part.clone()) {
                by_part.iter_mut().zip(other).for_each(|(all, more)| all.extend(more));
            }
            self.bodies = by_part.into_iter().map(|bodies| bodies.into_iter().collect()).collect();
        }
        for (by_part, bodies) in self.carried.iter_mut().zip(&self.bodies) {
            let carried_by = |body: &usize| carried.get(*body).copied().unwrap_or(0.0);
            *by_part = bodies.iter().map(carried_by).fold(0.0, f64::max);
        }
        self
    }

    /// Keeps a statement about each part true only if it is true on all ranks.
    fn agree(&self, holds: &mut [bool]) {
        let mut fails: Vec<f64> = holds.iter().map(|holds| f64::from(u8::from(!holds))).collect();
        self.reduction.maximum(&mut fails);
        holds.iter_mut().zip(fails).for_each(|(holds, fails)| *holds = fails == 0.0);
    }

    /// Number of parts.
    pub(super) fn count(&self) -> usize {
        self.n
    }

    /// The components of the displacement.
    fn displacement(&self) -> Range<usize> {
        self.fields.first().cloned().unwrap_or_default()
    }

    /// Norm of some components of a nodal field over each part.
    fn norms<const N: usize>(
        &self,
        components: Range<usize>,
        field: impl Iterator<Item = [f64; N]>,
    ) -> Vec<f64> {
        let mut sums = vec![0.0; self.n];
        for ((node, value), part) in field.enumerate().zip(&self.at_node) {
            if self.reduction.counts(node) {
                for x in &value[components.clone()] {
                    sums[*part as usize] += x * x;
                }
            }
        }
        self.reduction.sum(&mut sums);
        sums.into_iter().map(f64::sqrt).collect()
    }
}

/// The measure of equilibrium of an evaluation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measured {
    /// Eq. (40) for the part that is farthest from equilibrium, [-]; parts that carry nothing do not count.
    pub(super) residual: f64,
    /// The role of round-off in the residual.
    pub(super) round_off: RoundOff,
    /// The residual of each field, the displacement first, [-]; empty if there are no further fields.
    pub(super) by_field: Vec<f64>,
}

impl Measured {
    /// A residual that owes nothing to round-off.
    pub(super) fn beyond_round_off(residual: f64) -> Measured {
        Measured { residual, round_off: RoundOff::NoMatter, by_field: Vec::new() }
    }

    /// This measure of the displacement together with the residuals of further fields, if there are any.
    fn and_fields(self, further: Vec<f64>, tolerance: f64) -> Measured {
        if further.is_empty() {
            return self;
        }
        let further_residual = further.iter().copied().fold(0.0, largest);
        let by_field = std::iter::once(self.residual).chain(further).collect();
        Measured { by_field, ..self.and(Measured::beyond_round_off(further_residual), tolerance) }
    }

    /// The measure of one global equation, whose residual may be round-off.
    pub(super) fn global(residual: f64, is_round_off: bool, tolerance: f64) -> Measured {
        let round_off = match residual {
            _ if !is_round_off || residual <= tolerance => RoundOff::NoMatter,
            _ if residual > MAX_ROUND_OFF => RoundOff::Forbids,
            _ => RoundOff::Limits,
        };
        Measured { round_off, ..Measured::beyond_round_off(residual) }
    }

    /// The measure of these equations and further ones, of no field, together.
    pub(super) fn and(self, other: Measured, tolerance: f64) -> Measured {
        let is_open = |measured: &Measured| measured.residual > tolerance || measured.residual.is_nan();
        let round_off = match (is_open(&self), is_open(&other)) {
            (_, false) => self.round_off,
            (false, true) => other.round_off,
            (true, true) => match [self.round_off, other.round_off] {
                [RoundOff::NoMatter, _] | [_, RoundOff::NoMatter] => RoundOff::NoMatter,
                [RoundOff::Forbids, _] | [_, RoundOff::Forbids] => RoundOff::Forbids,
                [RoundOff::Nothing, last] | [last, _] => last,
            },
        };
        Measured { residual: largest(self.residual, other.residual), round_off, by_field: self.by_field }
    }
}

/// The role of round-off in a residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RoundOff {
    /// Round-off is not the reason why the residual exceeds the tolerance, if it does.
    NoMatter,
    /// Only parts that carry nothing exceed the tolerance: their forces are round-off, or small compared with
    /// the forces that their bodies have carried.
    Nothing,
    /// Round-off prevents parts from meeting the tolerance, but not [`MAX_ROUND_OFF`].
    Limits,
    /// Round-off prevents parts from meeting even [`MAX_ROUND_OFF`].
    Forbids,
}

/// The forces of an iterate.
pub(super) struct Forces<'a, const N: usize> {
    /// f_ext − f_int + f_react, [force].
    pub(super) out_of_balance: &'a Nodal<N>,
    /// f_ext, [force].
    pub(super) f_ext: &'a Nodal<N>,
    /// f_react, [force].
    pub(super) reaction: &'a Nodal<N>,
    /// The part of `f_ext` that holds bodies as reactions do, [force].
    pub(super) holding: Option<&'a Nodal<N>>,
    /// Forces that terms declare as the scale of their fields, [force].
    pub(super) scale: Option<&'a Nodal<N>>,
}

impl<const N: usize> Forces<'_, N> {
    pub(super) fn total(&self, node: usize) -> [f64; N] {
        std::array::from_fn(|d| self.f_ext[node][d] + self.reaction[node][d])
    }

    /// True if the load on the free components of a node is at most `nothing`, and the sum of load and reaction on its
    /// held components is at most `noise`: a load may act directly on a support.
    fn carries_nothing(&self, node: usize, mut axes: Range<usize>, nothing: f64, noise: f64) -> bool {
        let (force, reaction) = (&self.f_ext[node], &self.reaction[node]);
        let holding = self.holding.map_or([0.0; N], |holding| holding[node]);
        axes.all(|d| match reaction[d] + holding[d] {
            0.0 => force[d].abs() <= nothing,
            _ => (force[d] + reaction[d]).abs() <= noise,
        })
    }

    /// The norms in eq. (40) for some components of each part: of the out-of-balance force, and of the sum of external
    /// forces and reactions. Forces that hold bodies may cancel the loads at the same nodes and leave nothing but
    /// round-off; they count alone if they are larger than the sum. So do forces that terms declare as a scale.
    fn part_norms(&self, parts: &Parts, components: Range<usize>) -> Vec<[f64; 2]> {
        let out = parts.norms(components.clone(), self.out_of_balance.iter().copied());
        let mut force = parts.norms(components.clone(), (0..self.f_ext.len()).map(|node| self.total(node)));
        for larger in [self.holding, self.scale].into_iter().flatten() {
            let larger = parts.norms(components.clone(), larger.iter().copied());
            force.iter_mut().zip(larger).for_each(|(force, larger)| *force = force.max(larger));
        }
        out.into_iter().zip(force).map(|(out, force)| [out, force]).collect()
    }

    /// The largest residual of each field other than the displacement, [-]: relative to its external forces and
    /// reactions, to its internal forces, or to the products of its rows of K with the increments, whichever is
    /// largest. In a storage equation or a constraint, only these products are larger than what is out of balance.
    fn further_residuals(&self, parts: &Parts, system: &System<N>, delta_d: &[[f64; N]]) -> Vec<f64> {
        if parts.fields.len() == 1 {
            return Vec::new();
        }
        let products = system.magnitudes(delta_d);
        let field_residual = |components: &Range<usize>| {
            let part_norms = self.part_norms(parts, components.clone());
            let norms = |field: &[[f64; N]]| parts.norms(components.clone(), field.iter().copied());
            let scales = norms(system.internal_force()).into_iter().zip(norms(&products));
            let ratios = part_norms
                .iter()
                .zip(scales)
                .map(|(&[out, force], (own, product))| ratio(out, force.max(own).max(product)));
            ratios.fold(0.0, largest)
        };
        parts.fields.iter().skip(1).map(field_residual).collect()
    }

    /// The largest force that each body carries or has carried, [force].
    pub(super) fn carried(&self, parts: &Parts, before: &[f64], bodies: usize) -> Vec<f64> {
        let mut carried = before.to_vec();
        carried.resize(bodies, 0.0);
        for ([_, force], bodies) in
            self.part_norms(parts, parts.displacement()).into_iter().zip(&parts.bodies)
        {
            for &body in bodies {
                carried[body] = carried[body].max(force);
            }
        }
        carried
    }

    /// The residual of eq. (40) if every part meets the tolerance in every field.
    pub(super) fn balanced(
        &self,
        parts: &Parts,
        tolerance: f64,
        system: &System<N>,
        delta_d: &[[f64; N]],
    ) -> Option<Measured> {
        let residual = self.displacement_residual(parts);
        let measured = Measured::beyond_round_off(residual)
            .and_fields(self.further_residuals(parts, system, delta_d), tolerance);
        (measured.residual <= tolerance).then_some(measured)
    }

    /// The largest residual of the displacement over the parts, eq. (40), [-].
    fn displacement_residual(&self, parts: &Parts) -> f64 {
        let part_norms = self.part_norms(parts, parts.displacement());
        part_norms.iter().map(|&[out, force]| ratio(out, force)).fold(0.0, largest)
    }

    /// The residual of eq. (40), and the role of round-off if it exceeds the tolerance.
    ///
    /// Round-off is not considered for fields other than the displacement.
    pub(super) fn measure<const D: usize>(
        &self,
        parts: &Parts,
        tolerance: f64,
        at: &EvaluatedAt<'_, D, N>,
    ) -> Measured {
        let further = self.further_residuals(parts, at.system, at.delta_d);
        let part_norms = self.part_norms(parts, parts.displacement());
        let residuals = part_norms.iter().map(|&[out, force]| ratio(out, force)).collect(); // (40)
        self.with_round_off(residuals, &part_norms, parts, tolerance, at).and_fields(further, tolerance)
    }

    /// The role of round-off in the residuals of parts that exceed the tolerance, given the norms of eq. (40).
    fn with_round_off<const D: usize>(
        &self,
        mut residuals: Vec<f64>,
        part_norms: &[[f64; 2]],
        parts: &Parts,
        tolerance: f64,
        at: &EvaluatedAt<'_, D, N>,
    ) -> Measured {
        let open: Vec<bool> = residuals.iter().map(|r| *r > tolerance || r.is_nan()).collect();
        let measured = |residuals: &[f64], round_off| Measured {
            round_off,
            ..Measured::beyond_round_off(residuals.iter().copied().fold(0.0, largest))
        };
        if !open.contains(&true) {
            return measured(&residuals, RoundOff::NoMatter);
        }
        let (mut carries_nothing, mut is_round_off) = (open.clone(), open.clone());
        // An equilibrium within the tolerance may have left an out-of-balance force of this size.
        let left: Vec<f64> = parts.carried.iter().map(|f| tolerance.min(MAX_ROUND_OFF) * f).collect();
        self.exclude_beyond(at.round_off_at_most(), &left, parts, &mut is_round_off);
        if is_round_off.contains(&true) {
            for (node, noise) in at.round_off().iter().enumerate() {
                let part = parts.at_node[node] as usize;
                let out = &self.out_of_balance[node][parts.displacement()];
                let is_within = |bound: f64| out.iter().all(|f| f.abs() <= bound);
                is_round_off[part] &= is_within(*noise);
                let nothing = f64::EPSILON * parts.carried[part];
                let still = UNLOADED * parts.carried[part];
                carries_nothing[part] &= is_within(noise.max(left[part]))
                    && self.carries_nothing(
                        node,
                        parts.displacement(),
                        nothing,
                        still.max(ACCUMULATED * noise),
                    );
            }
            parts.agree(&mut is_round_off);
            parts.agree(&mut carries_nothing);
        } else {
            carries_nothing.fill(false);
        }
        let resultants = match is_round_off.contains(&true) {
            true => self.resultants(parts, at.model.revolved),
            false => Vec::new(),
        };
        let mut round_off = RoundOff::Nothing;
        for part in (0..parts.n).filter(|&part| open[part]) {
            if carries_nothing[part] {
                residuals[part] = 0.0;
            } else if !is_round_off[part] || round_off == RoundOff::NoMatter {
                round_off = RoundOff::NoMatter; // one part that exceeds the tolerance for another reason decides
            } else if residuals[part].max(resultants[part]) > MAX_ROUND_OFF {
                round_off = RoundOff::Forbids;
            } else if round_off != RoundOff::Forbids {
                round_off = RoundOff::Limits;
            }
        }
        if round_off == RoundOff::NoMatter {
            // A part without external forces and reactions is measured relative to its internal force.
            let internal = parts.norms(parts.displacement(), at.system.internal_force().iter().copied());
            for (part, &[out, force]) in part_norms.iter().enumerate() {
                if force == 0.0 && out > 0.0 && !carries_nothing[part] {
                    residuals[part] = out / internal[part];
                }
            }
        }
        measured(&residuals, round_off)
    }

    /// Excludes parts with a node whose out-of-balance force exceeds both `bound` and the bound of the part.
    fn exclude_beyond(&self, bound: f64, by_part: &[f64], parts: &Parts, is_round_off: &mut [bool]) {
        for (force, part) in self.out_of_balance.iter().zip(&parts.at_node) {
            let part = *part as usize;
            is_round_off[part] &=
                force[parts.displacement()].iter().all(|f| f.abs() <= bound.max(by_part[part]));
        }
        parts.agree(is_round_off);
    }

    /// Magnitude of the sum of the out-of-balance force over each part, along the axes along which the forces on the
    /// part must balance, relative to the sum of the magnitudes of all forces on the part, [-].
    fn resultants(&self, parts: &Parts, revolved: bool) -> Vec<f64> {
        let mut sums = vec![([0.0; N], 0.0); parts.n];
        for (node, part) in parts.at_node.iter().enumerate().filter(|(node, _)| parts.reduction.counts(*node))
        {
            let (sum, scale) = &mut sums[*part as usize];
            let total = self.total(node);
            for d in usize::from(revolved)..parts.displacement().end {
                sum[d] += self.out_of_balance[node][d];
            }
            *scale += total[parts.displacement()].iter().map(|f| f.abs()).sum::<f64>();
            for larger in [self.holding, self.scale].into_iter().flatten() {
                *scale += larger[node][parts.displacement()].iter().map(|f| f.abs()).sum::<f64>();
            }
        }
        for (sum, scale) in &mut sums {
            parts.reduction.sum(sum);
            *scale = parts.reduction.total(*scale);
        }
        sums.into_iter().map(|(sum, scale)| ratio(norm(&sum), scale)).collect()
    }
}

/// The larger of two residuals; NaN if either is NaN.
fn largest(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// `out` relative to `force`; 0 if `out` is 0, even if `force` is 0, too.
pub(super) fn ratio(out: f64, force: f64) -> f64 {
    if out == 0.0 { 0.0 } else { out / force }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dofs::Fields;

    /// Four nodes in two parts, the second of which carries a millionth of the forces of the first.
    fn forces(out: [f64; 4]) -> [Nodal<1>; 3] {
        let field = |values: [f64; 4]| values.map(|x| [x]).to_vec();
        [field(out), field([1e6, 0.0, 1.0, 0.0]), field([0.0, -1e6, 0.0, -1.0])]
    }

    fn parts(lowest: &[usize]) -> Parts {
        let joined = JoinedParts::on_one_rank(lowest);
        Parts::new(&joined, &Reduction::default(), Fields::displacement(1).components())
    }

    fn residual(out: [f64; 4], tolerance: f64) -> Option<f64> {
        let [out_of_balance, f_ext, reaction] = forces(out);
        let forces = Forces {
            out_of_balance: &out_of_balance,
            f_ext: &f_ext,
            reaction: &reaction,
            holding: None,
            scale: None,
        };
        let residual = forces.displacement_residual(&parts(&[0, 0, 2, 2]));
        (residual <= tolerance).then_some(residual)
    }

    #[test]
    fn a_heavily_loaded_part_does_not_hide_another_one() {
        let length = f64::sqrt(2.0);
        assert_eq!(residual([0.0; 4], 1e-9), Some(0.0));
        assert_eq!(residual([1e-4, 0.0, 0.0, 0.0], 1e-9), Some(1e-4 / 2e12f64.sqrt()));
        assert_eq!(residual([0.0, 0.0, 1e-4, 0.0], 1e-9), None);
        assert_eq!(residual([0.0, 0.0, 0.0, 1e-4], 1e-3), Some(1e-4 / length));
        assert_eq!(residual([f64::NAN, 0.0, 0.0, 0.0], 1e-3), None);
    }

    #[test]
    fn parts_are_numbered_by_their_lowest_nodes() {
        let parts = parts(&[0, 1, 0, 1, 4, 0]);
        assert_eq!((parts.at_node, parts.n), (vec![0, 1, 0, 1, 2, 0], 3));
    }

    #[test]
    fn what_is_not_a_number_is_the_largest() {
        assert!([1.0, f64::NAN, 2.0].into_iter().fold(0.0, largest).is_nan());
        assert_eq!([1.0, 3.0, 2.0].into_iter().fold(0.0, largest), 3.0);
    }
}
