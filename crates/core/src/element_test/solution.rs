//! One increment: the strains that give the prescribed stresses.

use super::error::Cause;
use super::path::{Control, Target};
use super::response::{Response, respond};
use super::state::ElementState;
use crate::material::{Material, MaterialError};
use crate::tensor::{Mat3, Sym3};

/// Largest number of Newton iterations.
const MAX_ITERATIONS: usize = 60;
/// Largest change of a strain in an iteration, [-].
const LARGEST_CHANGE: f64 = 0.3;
/// Smallest fraction of a change that the line search tries, [-].
const SMALLEST_PART: f64 = 1.0 / 4096.0;
/// The line search accepts a fraction of a change if the residual decreases, relative to its value before the change,
/// by more than this number times the fraction, [-].
const DECREASE: f64 = 1e-4;
/// Difference from a prescribed stress below which that stress counts as reached, relative to the stresses, [-].
const REACHED: f64 = 1e-9;
/// Round-off of stresses, relative to the stiffness of the law, [-].
const ROUND_OFF: f64 = 1e-14;
/// First distance at which a bracket is sought, [-].
const FIRST_DISTANCE: f64 = 1e-6;
/// Largest distance at which a bracket is sought, [-].
const LARGEST_DISTANCE: f64 = 2.0;
/// Largest number of bisections.
const MAX_BISECTIONS: usize = 200;

/// A strain that follows from a prescribed stress.
struct Unknown {
    /// The axis of the strain and of the stress.
    axis: usize,
    /// The other axis with the same strain, if any.
    follower: Option<usize>,
    /// The prescribed stress, [stress].
    stress: f64,
}

/// The increment from a state to a target.
struct Increment<'a> {
    law: &'a dyn Material,
    start: &'a ElementState,
    target: &'a Target,
    unknowns: Vec<Unknown>,
}

/// An iterate.
struct Iterate {
    /// The strain e; its unknown components are being sought.
    strain: Sym3,
    response: Response,
    /// Difference from the prescribed stress for each unknown, [stress]; the remaining entries are 0.
    residual: [f64; 3],
}

impl Iterate {
    fn norm(&self) -> f64 {
        self.residual.iter().map(|r| r * r).sum::<f64>().sqrt()
    }
}

/// The state at a target, one increment from `start`.
pub(super) fn solve(
    law: &dyn Material,
    start: &ElementState,
    target: &Target,
) -> Result<ElementState, Cause> {
    let increment = Increment { law, start, target, unknowns: unknowns(target) };
    let first = increment.at(&increment.prescribed())?;
    if increment.unknowns.is_empty() {
        return Ok(first.response.state);
    }
    let mut last = increment.newton(first);
    if !increment.is_reached(&last)
        && increment.unknowns.len() == 1
        && let Some(start) = increment.bracketed()
    {
        last = increment.newton(start);
    }
    if increment.is_reached(&last) { Ok(last.response.state) } else { Err(increment.failure(&last)) }
}

/// The unknown strains of a target.
fn unknowns(target: &Target) -> Vec<Unknown> {
    let follower = target.is_axisymmetric.then_some(2);
    let unknown = |axis: usize| match target.axes[axis] {
        Control::Stress(stress) if Some(axis) != follower => {
            Some(Unknown { axis, follower: follower.filter(|_| axis == 0), stress })
        }
        _ => None,
    };
    (0..3).filter_map(unknown).collect()
}

impl Increment<'_> {
    /// The prescribed strains; unknown strains have their values at the start of the increment.
    fn prescribed(&self) -> Sym3 {
        let [yz, xz, xy] = self.target.shears.map(|shear| shear * std::f64::consts::SQRT_2);
        let mut strain = Sym3([0.0, 0.0, 0.0, yz, xz, xy]);
        for axis in 0..3 {
            strain.0[axis] = match self.target.axes[axis] {
                Control::Strain(value) => value,
                Control::Stress(_) => self.start.strain.0[axis],
            };
        }
        if self.target.is_axisymmetric {
            strain.0[2] = strain.0[0];
        }
        strain
    }

    fn at(&self, strain: &Sym3) -> Result<Iterate, MaterialError> {
        let response = respond(self.law, self.start, strain, self.target.shear)?;
        let mut residual = [0.0; 3];
        for (entry, unknown) in residual.iter_mut().zip(&self.unknowns) {
            *entry = response.stress.0[unknown.axis] - unknown.stress;
        }
        Ok(Iterate { strain: *strain, response, residual })
    }

    /// The strain of an iterate after a change of the unknown components.
    fn changed(&self, strain: &Sym3, change: [f64; 3]) -> Sym3 {
        let mut strain = *strain;
        for (unknown, change) in self.unknowns.iter().zip(change) {
            strain.0[unknown.axis] += change;
            if let Some(follower) = unknown.follower {
                strain.0[follower] = strain.0[unknown.axis];
            }
        }
        strain
    }

    /// Derivatives of the residual with respect to the unknowns; the remaining rows and columns are those of the
    /// identity.
    fn jacobian(&self, response: &Response) -> Mat3 {
        let mut jacobian = Mat3::identity();
        for (column, unknown) in self.unknowns.iter().enumerate() {
            let mut rate = response.rates[unknown.axis];
            if let Some(follower) = unknown.follower {
                rate = rate + response.rates[follower];
            }
            for (row, other) in self.unknowns.iter().enumerate() {
                jacobian[(row, column)] = rate.0[other.axis];
            }
        }
        jacobian
    }

    /// True if the prescribed stresses are reached.
    fn is_reached(&self, iterate: &Iterate) -> bool {
        let stresses = [iterate.response.stress.norm(), self.start.cauchy_stress().norm()];
        let prescribed = self.unknowns.iter().map(|unknown| unknown.stress.abs());
        let stress = prescribed.chain(stresses).fold(0.0, f64::max);
        let tolerance = REACHED * stress + ROUND_OFF * iterate.response.stiffness;
        iterate.residual.iter().all(|r| r.abs() <= tolerance)
    }

    /// Newton's method with a line search. If no step along the direction of the consistent tangent reduces the
    /// residual, as at the kink between loading and unloading, the tangent at the start of the increment is tried. Once
    /// the stresses are reached, the iterations continue as long as each at least halves the residual. Returns the last
    /// iterate, whether or not the stresses are reached.
    fn newton(&self, first: Iterate) -> Iterate {
        let at_start = respond(self.law, self.start, &self.start.strain, self.start.shear);
        let at_start = at_start.ok().map(|response| self.jacobian(&response));
        let mut now = first;
        for _ in 0..MAX_ITERATIONS {
            let is_reached = self.is_reached(&now);
            let smallest = if is_reached { 1.0 } else { SMALLEST_PART };
            let jacobian = self.jacobian(&now.response);
            let next = self.line_search(&now, &jacobian, smallest).or_else(|| {
                let other = at_start.as_ref().filter(|_| !is_reached)?;
                self.line_search(&now, other, smallest)
            });
            match next {
                Some(next) if is_reached && next.norm() > 0.5 * now.norm() => return next,
                Some(next) => now = next,
                None => break,
            }
        }
        now
    }

    /// An iterate with a smaller residual, along the change that Newton's method proposes.
    fn line_search(&self, now: &Iterate, jacobian: &Mat3, smallest: f64) -> Option<Iterate> {
        let change: [f64; 3] = jacobian.lu().solve(&(-nalgebra::Vector3::from(now.residual)))?.into();
        let largest = change.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if !largest.is_finite() || largest == 0.0 {
            return None;
        }
        let scale = (LARGEST_CHANGE / largest).min(1.0);
        let mut part = 1.0;
        while part >= smallest {
            let by = change.map(|x| x * scale * part);
            if let Ok(next) = self.at(&self.changed(&now.strain, by))
                && next.norm() < (1.0 - DECREASE * part * scale) * now.norm()
            {
                return Some(next);
            }
            part *= 0.5;
        }
        None
    }

    /// For a single unknown, an iterate near a sign change of the residual. The sign change nearest to the start of the
    /// increment is sought at growing distances on both sides and then located by bisection.
    fn bracketed(&self) -> Option<Iterate> {
        let from = self.prescribed();
        let at = |by: f64| self.at(&self.changed(&from, [by, 0.0, 0.0])).ok();
        let value = |by: f64| at(by).map(|iterate| iterate.residual[0]);
        let first = value(0.0)?;
        let is_other = |residual: f64| (residual > 0.0) != (first > 0.0);
        // Unless the law softens, the stress grows with the strain. Compression is therefore tried first if the stress
        // is too large.
        let downwards = if first > 0.0 { -1.0 } else { 1.0 };
        let mut inner = [0.0, 0.0];
        let mut distance = FIRST_DISTANCE;
        let mut bracket = None;
        while bracket.is_none() && distance <= LARGEST_DISTANCE {
            for (inner, side) in inner.iter_mut().zip([downwards, -downwards]) {
                let outer = side * distance;
                match value(outer) {
                    Some(residual) if is_other(residual) && bracket.is_none() => {
                        bracket = Some((*inner, outer))
                    }
                    Some(_) => *inner = outer,
                    None => {}
                }
            }
            distance *= 2.0;
        }
        let (mut same, mut other) = bracket?;
        for _ in 0..MAX_BISECTIONS {
            let middle = 0.5 * (same + other);
            if middle == same || middle == other {
                break;
            }
            *if is_other(value(middle)?) { &mut other } else { &mut same } = middle;
        }
        at(other)
    }

    /// The reason why no solution was found, deduced from the last iterate.
    fn failure(&self, near: &Iterate) -> Cause {
        let mut largest = (0.0, 'x');
        for (residual, unknown) in near.residual.iter().zip(&self.unknowns) {
            if residual.abs() > largest.0 {
                largest = (residual.abs(), ['x', 'y', 'z'][unknown.axis]);
            }
        }
        Cause::NoStrain { difference: largest.0, axis: largest.1 }
    }
}
