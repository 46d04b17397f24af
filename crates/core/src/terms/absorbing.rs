//! Absorbing boundaries, after Lysmer & Kuhlemeyer (1969): dashpots that swallow waves, on the nodes of boundary conditions
//! that no longer hold the bodies.
//!
//! On a side of the bodies with the normal n, the traction t = −ρ c_p (v·n) n − ρ c_s v_t is that of an unbounded
//! continuation; it swallows waves along the normal completely. Where a wave with the velocity v_up comes up from below,
//! it is t + 2 ρ c v_up (Joyner & Chen 1975). The forces that the conditions exerted in the stage before go on.

use crate::assembly::{System, Wanted};
use crate::grid::sides::sides_of;
use crate::material::Modulus;
use crate::model::{Absorbed, Model, ModuliAtRest, NodeSet};
use crate::points::Points;
use crate::region::vector::norm;
use crate::step::{At, StepContext};

use super::failure::{BeginError, EvaluateError};
use super::ledger::{Ledger, NamedEnergy};
use super::report::TermReport;
use super::term::{Character, Term};

/// The dashpots of all absorbing boundaries.
#[derive(Debug)]
pub struct Absorbing<const D: usize> {
    dashpots: Vec<Dashpot<D>>,
    duration: f64,
    /// Force of the dashpots of this rank on the bodies in the last evaluation, [force].
    resultant: [f64; D],
}

/// Name under which the force of the dashpots is reported.
const ABSORBING: &str = "absorbing";

impl<const D: usize> Default for Absorbing<D> {
    fn default() -> Self {
        Absorbing { dashpots: Vec::new(), duration: 0.0, resultant: [0.0; D] }
    }
}

/// The dashpot of a share of a side on a node.
#[derive(Debug, Clone, Copy)]
struct Dashpot<const D: usize> {
    node: usize,
    /// Force per velocity, [force·time/length].
    matrix: [[f64; D]; D],
    /// Velocity of the wave that comes in, [length/time].
    incoming: [f64; D],
}

impl<const D: usize> Dashpot<D> {
    fn times(&self, x: &[f64; D]) -> [f64; D] {
        self.matrix.map(|row| (0..D).map(|d| row[d] * x[d]).sum())
    }
}

impl<const D: usize> Absorbing<D> {
    /// Adds the dashpots of a boundary: the sides of active cells that no other active cell shares, and whose nodes all
    /// belong to the condition.
    fn add(&mut self, step: &StepContext<D>, points: &Points<D>, absorbed: &Absorbed<D>) {
        let StepContext { model, links, .. } = *step;
        let Some(condition) = model.boundary_conditions.get(absorbed.condition) else { return };
        let NodeSet::Fixed(nodes) = &condition.nodes else { return };
        let [axial, shear] =
            [Modulus::Axial, Modulus::Shear].map(|modulus| ModuliAtRest::new(model, modulus));
        let incoming = absorbed.incoming.as_ref().map_or([0.0; D], |(direction, curve)| {
            let speed = curve.factor(step.load_time());
            direction.map(|d| d * speed)
        });
        // Cells with points, each with its density and moduli; sides of ghost layers belong to other ranks.
        let mut cells = Vec::new();
        for group in 0..links.n_groups() {
            let mut sums = [0.0; 4];
            for p in links.points_of(group) {
                let volume = model.volume(points, p);
                sums[0] += volume;
                sums[1] += points.mass[p];
                sums[2] += volume * axial.at(points, p);
                sums[3] += volume * shear.at(points, p);
            }
            if sums[0] > 0.0 {
                let cell = points.cell[links.points_of(group).start];
                cells.push((cell, [sums[1] / sums[0], sums[2] / sums[0], sums[3] / sums[0]]));
            }
        }
        cells.sort_unstable_by_key(|(cell, _)| *cell);
        cells.dedup_by_key(|(cell, _)| *cell);
        let numbers: Vec<u32> = cells.iter().map(|(cell, _)| *cell).collect();
        let sides = sides_of(model.grid.as_ref(), &numbers);
        for equal in sides.chunk_by(|a, b| a.key == b.key) {
            let [side] = equal else { continue };
            if !side.nodes.iter().all(|node| nodes.binary_search(node).is_ok()) {
                continue;
            }
            let corners: Vec<[f64; D]> =
                side.nodes.iter().map(|node| model.grid.node_position(*node as usize)).collect();
            let area = area_of(&corners);
            let size = norm(&area);
            if size == 0.0 {
                continue;
            }
            let normal = area.map(|a| a / size);
            let middle: [f64; D] = std::array::from_fn(|d| {
                corners.iter().map(|corner| corner[d]).sum::<f64>() / corners.len() as f64
            });
            let [density, axial, shear] = cells[side.cell].1;
            let share = size * model.depth(&middle) / corners.len() as f64;
            let [along, across] = [axial, shear].map(|modulus| share * (density * modulus).sqrt());
            let matrix = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let own = if i == j { across } else { 0.0 };
                    own + (along - across) * normal[i] * normal[j]
                })
            });
            for node in &side.nodes {
                if let Some(node) = links.copies(*node as usize).next() {
                    self.dashpots.push(Dashpot { node, matrix, incoming });
                }
            }
        }
    }
}

/// The area vector of a side with these corners, per unit depth in the plane; only its size and its direction up to a
/// sign count.
fn area_of<const D: usize>(corners: &[[f64; D]]) -> [f64; D] {
    let difference = |a: &[f64; D], b: &[f64; D]| -> [f64; D] { std::array::from_fn(|d| b[d] - a[d]) };
    let mut area = [0.0; D];
    if D == 2 {
        let along = difference(&corners[0], &corners[1]);
        (area[0], area[1]) = (along[1], -along[0]);
        return area;
    }
    for k in 1..corners.len().saturating_sub(1) {
        let (a, b) = (difference(&corners[0], &corners[k]), difference(&corners[0], &corners[k + 1]));
        for d in 0..D {
            let (e, f) = ((d + 1) % D, (d + 2) % D);
            area[d] += 0.5 * (a[e] * b[f] - a[f] * b[e]);
        }
    }
    area
}

impl<const D: usize, const N: usize> Term<D, N> for Absorbing<D> {
    fn name(&self) -> &'static str {
        "absorbing boundaries"
    }

    fn character(&self, model: &Model<D>) -> Character {
        Character { may_slump: true, may_hold: !model.present.absorbed.is_empty(), ..Character::SMOOTH }
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        self.dashpots.clear();
        self.duration = step.step.duration();
        if step.dynamics().is_some() && self.duration > 0.0 {
            step.model.present.absorbed.iter().for_each(|absorbed| self.add(step, points, absorbed));
        }
        Ok(())
    }

    fn evaluate(
        &mut self,
        _: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        self.resultant = [0.0; D];
        for dashpot in &self.dashpots {
            let u = &at.delta_d[dashpot.node];
            let mut relative = [0.0; D];
            (0..D).for_each(|d| relative[d] = 2.0 * dashpot.incoming[d] - u[d] / self.duration);
            let force = dashpot.times(&relative);
            sum.add_holding(dashpot.node, &force);
            (0..D).for_each(|d| self.resultant[d] += force[d]);
            if wanted == Wanted::Stiffness
                && let Some(place) = sum.place(dashpot.node, dashpot.node)
            {
                let stiffness = dashpot.matrix.map(|row| row.map(|c| c / self.duration));
                sum.add_displacement_block(place, &stiffness);
            }
        }
        Ok(())
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        if !self.dashpots.is_empty() {
            report.add_force(ABSORBING, self.resultant);
        }
    }

    /// What the dashpots swallow; the external work contains the work of their forces, less that of the incoming waves.
    fn ledger(&self, _: &StepContext<D>, _: &Points<D>, at: At<N>) -> Ledger {
        if self.dashpots.is_empty() {
            return Ledger::default();
        }
        let swallowed = self.dashpots.iter().map(|dashpot| {
            let u: [f64; D] = std::array::from_fn(|d| at.delta_d[dashpot.node][d]);
            let force = dashpot.times(&u);
            (0..D).map(|d| force[d] * u[d]).sum::<f64>() / self.duration
        });
        let swallowed: f64 = swallowed.sum();
        [
            NamedEnergy::dissipated(Ledger::ABSORBED, swallowed),
            NamedEnergy::supplied(Ledger::ABSORBED, swallowed),
        ]
        .into()
    }
}
