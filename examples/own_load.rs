//! A user-defined load: the weight of a trolley that travels along a beam from step to step.
//!
//! ```sh
//! cargo run --example own_load
//! ```
//!
//! The beam rests on a support at each end. As long as it bends little, the law of the lever gives the reactions.
#![allow(clippy::print_stdout, reason = "a program")]

use mpm::assembly::{System, Wanted};
use mpm::deck::{build::build, load::load_text};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Silent, SolveError, Stepper};
use mpm::step::{At, Nodal, StepContext};
use mpm::terms::{BeginError, Character, EvaluateError, Term};

/// A point force that moves with the time of the analysis.
struct Trolley {
    /// Force, [N].
    force: [f64; 2],
    /// Initial position, [m], and distance travelled per unit of time, [m].
    start: [f64; 2],
    velocity: [f64; 2],
    /// The force on the active nodes at the end of the step, and at its start, [N].
    at_end: Nodal<2>,
    at_start: Nodal<2>,
}

impl Trolley {
    fn new(force: [f64; 2], start: [f64; 2], velocity: [f64; 2]) -> Trolley {
        Trolley { force, start, velocity, at_end: Vec::new(), at_start: Vec::new() }
    }

    /// Position of the trolley, [m].
    fn place(&self, time: f64) -> [f64; 2] {
        std::array::from_fn(|d| self.start[d] + time * self.velocity[d])
    }

    /// The force on the active nodes at a time, distributed by the basis functions of the grid at the trolley.
    fn on_nodes(&self, step: &StepContext<2>, time: f64) -> Nodal<2> {
        let mut nodal = vec![[0.0; 2]; step.links.n_active()];
        let (_, basis) = step.model.grid.basis_near(&self.place(time), None);
        for (node, value) in basis.nodes().iter().zip(basis.value()) {
            for active in step.links.copies(*node as usize) {
                nodal[active] = self.force.map(|f| value * f);
            }
        }
        nodal
    }
}

impl Term<2> for Trolley {
    fn name(&self) -> &'static str {
        "trolley"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, step: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        self.at_end = self.on_nodes(step, step.step.end);
        // At time 0 there is no load yet.
        self.at_start = if step.step.start > 0.0 {
            self.on_nodes(step, step.step.start)
        } else {
            vec![[0.0; 2]; self.at_end.len()]
        };
        Ok(())
    }

    fn evaluate(
        &mut self,
        _: &StepContext<2>,
        _: &mut Points<2>,
        _: At<2>,
        _: Wanted,
        sum: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        add(sum.external_force_mut(), &self.at_end);
        Ok(())
    }

    // The energy balance needs this force.
    fn force_at_start(&self, force: &mut Nodal<2>) {
        add(force, &self.at_start);
    }
}

fn add(sum: &mut [[f64; 2]], force: &[[f64; 2]]) {
    for (sum, force) in sum.iter_mut().flatten().zip(force.iter().flatten()) {
        *sum += force;
    }
}

const SPAN: f64 = 8.0;
const DECK: &str = "
version: 1
title: beam
grid: {type: structured, origin: [0, 0], size: [8, 2], spacing: 0.5}
materials: {steel: {model: hencky, young: 200e9, poisson: 0.3, density: 1}}
bodies:
  - {name: beam, material: steel, method: mpm, points_per_cell: 2, shape: {type: box, min: [0, 0.5], max: [8, 1.5]}}
boundary_conditions:
  - {name: left, nodes: {x: 0, y: 0.5}, fix: [x, y]}
  - {name: right, nodes: {x: 8, y: 0.5}, fix: [y]}
steps: {count: 7}
";

fn beam() -> Option<(Model<2>, Points<2>)> {
    build(&load_text("beam.yaml", DECK.as_bytes(), &[]).ok()?).ok()
}

/// Position of the trolley at the end of each step, [m], and the vertical reactions of both supports, [N].
fn run(force: f64) -> Result<Vec<(f64, [f64; 2])>, SolveError> {
    let Some((model, mut points)) = beam() else { return Ok(Vec::new()) };
    let trolley = || Trolley::new([0.0, -force], [0.0, 1.5], [SPAN, 0.0]);
    let mut stepper = Stepper::new(&model, &mut points).with_terms(vec![Box::new(trolley())])?;
    let mut found = Vec::new();
    while let Some(report) = stepper.step(&mut Silent)? {
        let [x, _] = trolley().place(report.step.end);
        found.push((x, [report.reactions[0][1], report.reactions[1][1]]));
    }
    Ok(found)
}

fn main() {
    match run(1e4) {
        Ok(found) => found.iter().for_each(|(x, [left, right])| {
            println!("trolley at {x:.2} m: reactions {left:.1} N and {right:.1} N");
        }),
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;

    #[test]
    fn the_reactions_follow_the_law_of_the_lever() {
        let force = 1e4;
        let found = run(force).unwrap();
        assert_eq!(found.len(), 7);
        for (x, [left, right]) in found {
            let lever = x / SPAN;
            assert!((right / force - lever).abs() < 1e-4, "{x}: {right}");
            assert!((left / force - (1.0 - lever)).abs() < 1e-4, "{x}: {left}");
        }
    }
}
