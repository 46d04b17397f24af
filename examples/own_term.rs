//! A user-defined term of equilibrium, implemented outside the library: a smooth wall that is independent of the grid,
//! enforced by a penalty on the points behind it.
//!
//! ```sh
//! cargo run --example own_term
//! ```
//!
//! A block of clay slides down between a vertical side and an inclined wall. Nothing else supports it, so the force of
//! the wall is known: its y component equals the weight.
#![allow(clippy::print_stdout, reason = "a program")]

use mpm::assembly::{System, Wanted};
use mpm::basis::Method;
use mpm::grid::Structured;
use mpm::material::Hencky;
use mpm::model::{BuildError, Builder, Fill, Model};
use mpm::points::Points;
use mpm::solver::{Silent, Stepper, Summary};
use mpm::step::{At, StepContext};
use mpm::terms::{BeginError, Character, EvaluateError, Ledger, NamedEnergy, Saved, Term, TermReport};

/// A wall. Points x with normal·x < offset are behind it; it pushes them back with a force per volume of `stiffness`
/// times their distance from the wall.
struct Wall {
    normal: [f64; 2],
    offset: f64,
    stiffness: f64,
    /// Force on the bodies in the current iteration, [force].
    force: [f64; 2],
    /// Energy of the penalty, now and at the start of the analysis (`at_start`), [energy].
    stored: f64,
    at_start: f64,
}

impl Wall {
    /// A wall through `origin`, inclined by `angle` above the horizontal.
    fn inclined(angle: f64, origin: [f64; 2], stiffness: f64) -> Wall {
        let normal = [-angle.sin(), angle.cos()];
        let offset = normal[0] * origin[0] + normal[1] * origin[1];
        Wall { normal, offset, stiffness, force: [0.0; 2], stored: 0.0, at_start: 0.0 }
    }
}

impl Term<2> for Wall {
    fn name(&self) -> &'static str {
        "wall"
    }

    // Points touch the wall and leave it, and it holds the block.
    fn character(&self, _: &Model<2>) -> Character {
        Character { has_kinks: true, may_hold: true, ..Character::SMOOTH }
    }

    fn begin(&mut self, _: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        Ok(())
    }

    // The nodes of a point are in the same group, so the term couples no further nodes.
    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<2>,
        wanted: Wanted,
        sum: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        (self.force, self.stored) = ([0.0; 2], 0.0);
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let mut links = Vec::new();
                step.links.for_each_value(p, |local, value| links.push((nodes[local] as usize, value)));
                let mut x = points.converged.position[p];
                for &(node, value) in &links {
                    (0..2).for_each(|d| x[d] += value * at.delta_d[node][d]);
                }
                let distance = self.normal[0] * x[0] + self.normal[1] * x[1] - self.offset;
                if distance >= 0.0 {
                    continue;
                }
                let k = self.stiffness * points.original_volume[p];
                // The internal force resists the motion, so the wall contributes a force directed into the wall.
                let internal = self.normal.map(|n| k * distance * n);
                for &(node, value) in &links {
                    let force = &mut sum.internal_force_mut()[node];
                    (0..2).for_each(|d| force[d] += value * internal[d]);
                }
                (0..2).for_each(|d| self.force[d] -= internal[d]);
                self.stored += 0.5 * k * distance * distance;
                if wanted == Wanted::Force {
                    continue;
                }
                for &(row, row_factor) in &links {
                    for &(column, column_factor) in &links {
                        // A symmetric system stores only the lower triangle.
                        if let Some(place) = sum.place(row, column) {
                            let factor = k * row_factor * column_factor;
                            let block = self.normal.map(|a| self.normal.map(|b| factor * a * b));
                            sum.add_block(place, &block);
                        }
                    }
                }
            }
        }
        if step.step.start == 0.0 && at.delta_d.iter().flatten().all(|u| *u == 0.0) {
            self.at_start = self.stored;
        }
        Ok(())
    }

    fn ledger(&self, _: &StepContext<2>, _: &Points<2>, _: At<2>) -> Ledger {
        [NamedEnergy::stored("wall", [self.at_start, self.stored])].into()
    }

    fn report(&self, _: &Model<2>, report: &mut TermReport<2>) {
        report.add_force("wall", self.force);
    }

    // A checkpoint must store the energy from which the energy balance begins.
    fn save(&self) -> Option<Saved> {
        Some(serde_json::json!(self.at_start).into())
    }

    fn restore(&mut self, saved: &serde_json::Value) -> Result<(), String> {
        self.at_start = serde_json::from_value(saved.clone()).map_err(|error| error.to_string())?;
        Ok(())
    }
}

/// Side of the block, [m].
const SIDE: f64 = 2.0;
const SPACING: f64 = 0.5;
const DENSITY: f64 = 1000.0;
const WEIGHT: f64 = DENSITY * 9.81 * SIDE * SIDE;

/// A block on the wall; its left side is held along x.
fn block() -> Result<(Model<2>, Points<2>), BuildError> {
    let fill = Fill { method: Method::Mpm, points_per_cell: 4, density: DENSITY, ..Fill::default() };
    Builder::new(Structured::new([0.0; 2], [SPACING; 2], [8; 2]))
        .material("clay", Hencky::new(1e6, 0.3))
        .body("block", "clay", fill, |x| x[0] < SIDE && x[1] > 1.0 && x[1] < 1.0 + SIDE)
        .fix("left", [true, false], |x| x[0] == 0.0)
        .gravity("weight", [0.0, -9.81])
        .steps(4)
        .build()
}

/// The summary of the run, and the force of the wall at its end, [force].
fn run(angle: f64) -> Result<(Summary, [f64; 2]), Box<dyn std::error::Error>> {
    let (model, mut points) = block()?;
    // At the start, at least one of the lowest points is behind the wall.
    let wall = Wall::inclined(angle, [SIDE, 1.1], 1e7);
    let mut stepper = Stepper::new(&model, &mut points).with_terms(vec![Box::new(wall)])?;
    let mut force = [0.0; 2];
    while let Some(report) = stepper.step(&mut Silent)? {
        force = report.forces[0].force;
    }
    Ok((stepper.reached().summary.clone(), force))
}

fn main() {
    match run(0.2) {
        Ok((_, force)) => println!("weight {WEIGHT:.1} N, force of the wall {force:.1?} N"),
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;

    #[test]
    fn the_wall_carries_the_weight() {
        for angle in [0.0, 0.1, 0.2] {
            let (summary, [x, y]) = run(angle).unwrap();
            assert!((y / WEIGHT - 1.0).abs() < 1e-8, "{angle}: {y}");
            // The wall is smooth: its force is normal to it.
            assert!((x + y * f64::tan(angle)).abs() < 1e-8 * WEIGHT, "{angle}: {x}");
            // The energy of the wall is part of the energy balance.
            assert!(summary.energy_error().abs() < 0.1, "{angle}: {}", summary.energy_error());
        }
    }
}
