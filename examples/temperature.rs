//! A second field of unknowns, implemented outside the library: the temperature beside the displacement, through two
//! stages, with files and a restart.
//!
//! ```sh
//! cargo run --example temperature
//! ```
//!
//! A column of concrete between a cold floor and a lid is heated from above: while the lid is held, heat strains it;
//! then the lid is released, and the column expands. Nothing moves sideways. In the steady state the temperature is
//! linear, and the force on the lid, the expansion and the flow of heat are known.
//!
//! The term [`Heat`] adds a third component to the unknowns of each node, the increment of the temperature T. It solves
//! C Ṫ = k ∇²T by backward Euler: ∫ N_a C ΔT/Δt + k ∇N_a·∇T dV = 0, with T and ∇T kept by the points, and stresses the
//! bodies by −β T, where β is the stress that prevents the expansion under a degree.
#![allow(clippy::print_stdout, reason = "a program")]

use std::error::Error;
use std::path::Path;

use mpm::assembly::{System, Wanted};
use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::dofs::{ConstraintError, Constraints, Field, Fields};
use mpm::model::Model;
use mpm::output::checkpoint;
use mpm::output::lock::Lock;
use mpm::output::results::{Request, Results};
use mpm::output::summary::Start;
use mpm::points::{FieldKind, PointFieldSpec, Points};
use mpm::solver::{Extension, Kernels, Reached, Summary, resume_stage, run_extended};
use mpm::step::{At, StepContext};
use mpm::stress::PlaneStrain;
use mpm::terms::{BeginError, Character, EvaluateError, Ledger, NamedEnergy, Term, Terms};
use mpm::timing::Timings;

/// The component of the temperature among the unknowns of a node.
const T: usize = 2;
/// Heat capacity per volume, [J/(m³·K)]; conductivity, [W/(m·K)]; thermal stress, [Pa/K].
const CAPACITY: f64 = 2e6;
const CONDUCTIVITY: f64 = 2.0;
const BETA: f64 = 1e5;
/// Temperature of the lid after the first step, above that of the floor, [K].
const HOT: f64 = 20.0;
const HEIGHT: f64 = 2.0;

/// The column; it rests for long enough in the second stage to be in a steady state.
const DECK: &str = "
version: 1
grid: {type: structured, origin: [0, 0], size: [0.5, 2.5], spacing: 0.25}
materials:
  concrete: {model: hencky, young: 1e10, poisson: 0.2, density: 2400}
bodies:
  - {name: column, material: concrete, method: mpm, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [0.5, 2]}}
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [0.5, 2.5]}}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
  - {name: lid, nodes: {y: 2}, fix: [y]}
stages:
  - {name: heat, steps: {count: 3, end_time: 1e6}}
  - {name: expand, release: [lid], steps: {count: 4, end_time: 4e9}}
";

/// Conduction of heat, and thermal stress.
struct Heat;

impl Term<2, 3> for Heat {
    fn name(&self) -> &'static str {
        "heat"
    }

    // The temperature stresses the bodies, but their motion does not heat them.
    fn character(&self, _: &Model<2>) -> Character {
        Character { is_symmetric: false, has_potential: false, ..Character::SMOOTH }
    }

    fn begin(&mut self, _: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        Ok(())
    }

    /// The lid is heated at once, in the first step.
    fn constrain(
        &self,
        step: &StepContext<2>,
        _: &Points<2>,
        constraints: &mut Constraints<3>,
    ) -> Result<(), ConstraintError> {
        let rise = if step.step.start == 0.0 { HOT } else { 0.0 };
        for (name, height, increment) in [("cold", 0.0, 0.0), ("hot", HEIGHT, rise)] {
            let condition = constraints.condition(name);
            for (active, &node) in step.links.active_nodes().iter().enumerate() {
                if step.model.grid.node_position(node as usize)[1] == height {
                    constraints.hold(active, T, increment, condition)?;
                }
            }
        }
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<3>,
        wanted: Wanted,
        sum: &mut System<3>,
    ) -> Result<(), EvaluateError> {
        let [Some(temperature), Some(slope)] = FIELDS.map(|(name, _)| points.further.handle(name)) else {
            return Ok(()); // `analysis` declares both
        };
        // A stage is entered in no time: nothing is stored then.
        let duration = step.step.end - step.step.start;
        let capacity = if duration > 0.0 { CAPACITY / duration } else { 0.0 };
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let (mut links, volume) = (Vec::new(), points.original_volume[p]);
                let (mut rise, mut more) = (0.0, [0.0; 2]);
                step.links.for_each_link(p, |local, value, gradient| {
                    let node = nodes[local] as usize;
                    links.push((node, value, *gradient));
                    rise += value * at.delta_d[node][T];
                    (0..2).for_each(|d| more[d] += gradient[d] * at.delta_d[node][T]);
                });
                let now = points.further.converged(temperature)[p] + rise;
                points.further.trial_mut(temperature)[p] = now;
                let before = &points.further.converged(slope)[2 * p..];
                let gradient = [before[0] + more[0], before[1] + more[1]];
                points.further.trial_mut(slope)[2 * p..][..2].copy_from_slice(&gradient);
                for &(row, value, row_slope) in &links {
                    let force = &mut sum.internal_force_mut()[row];
                    (0..2).for_each(|d| force[d] -= volume * BETA * now * row_slope[d]);
                    let flow = row_slope[0] * gradient[0] + row_slope[1] * gradient[1];
                    force[T] += volume * (capacity * value * rise + CONDUCTIVITY * flow);
                    if wanted == Wanted::Force {
                        continue;
                    }
                    for &(column, column_value, column_slope) in &links {
                        if let Some(place) = sum.place(row, column) {
                            let mut block = [[0.0; 3]; 3];
                            (0..2).for_each(|d| block[d][T] = -volume * BETA * row_slope[d] * column_value);
                            let along = row_slope[0] * column_slope[0] + row_slope[1] * column_slope[1];
                            block[T][T] = volume * (capacity * value * column_value + CONDUCTIVITY * along);
                            sum.add_block(place, &block);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    // The thermal stress does work on the bodies, here by the trapezoidal rule.
    fn ledger(&self, step: &StepContext<2>, points: &Points<2>, at: At<3>) -> Ledger {
        let mut ledger = Ledger::default();
        let Some(temperature) = points.further.handle("temperature") else { return ledger };
        let [before, now] = [points.further.converged(temperature), points.further.trial(temperature)];
        let mut work = 0.0;
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let stress = 0.5 * BETA * (before[p] + now[p]);
                step.links.for_each_link(p, |local, _, gradient| {
                    let u = at.delta_d[nodes[local] as usize];
                    work += points.original_volume[p] * stress * (gradient[0] * u[0] + gradient[1] * u[1]);
                });
            }
        }
        ledger.add(NamedEnergy::supplied("thermal", work));
        ledger
    }
}

/// The fields that the points keep, and their numbers of components.
const FIELDS: [(&str, usize); 2] = [("temperature", 1), ("temperature_gradient", 2)];

/// The temperature as a field of the unknowns.
fn temperature() -> Field {
    Field::new("temperature", 1).with_units("K", "W")
}

/// What the analysis has beside its model.
fn extension() -> Extension<'static, 2, 3> {
    Extension {
        kernels: Kernels::new::<PlaneStrain>(),
        fields: Fields::displacement(2).and_field(temperature()),
        terms: &|_| -> Terms<2, 3> { vec![Box::new(Heat)] },
    }
}

/// Runs a deck and writes its files into a directory, with a checkpoint after each step; from the start, or from the
/// checkpoint of a step.
fn run(directory: &Path, deck: &str, from: Option<usize>) -> Result<(Summary, Points<2>), Box<dyn Error>> {
    let loaded = load_text("temperature.yaml", deck.as_bytes(), &[]).map_err(|e| e.render(false))?;
    let (mut model, mut points) = build::<2>(&loaded).map_err(|e| format!("{e:?}"))?;
    for (name, components) in FIELDS {
        let (start, kind) = (vec![0.0; components * points.len()], FieldKind::Answer);
        let (name, unit) = (name.to_owned(), "K".to_owned());
        points.declare(PointFieldSpec { name, unit, components, kind, start })?;
    }
    let account = loaded.account(Start::now(), Timings::default(), 1)?;
    let conditions = ["cold", "hot"].map(String::from).to_vec();
    let nodal = vec![temperature()];
    let asked = Request { nodal, conditions, checkpoints: Some(1), ..Request::default() };
    let (reached, mut files) = match from {
        None => (Reached::nothing(&points), Results::create(directory, &asked, &model, account)?),
        Some(step) => {
            let checkpoint = checkpoint::read(&directory.join(format!("checkpoint_{step:04}.mpm")))?;
            let reached = checkpoint.head.reached.clone();
            resume_stage(&mut model, &mut points, &reached)?;
            checkpoint.restore(&model, &mut points)?;
            let (lock, step) = (Lock::take(directory)?, reached.progress.step);
            let files = Results::resume(directory, lock, &asked, &model, account, &checkpoint, step)?;
            (reached, files)
        }
    };
    let never = &mut |_: &mut _, _: &mut _, _: &mut _| Ok(false);
    let reached = run_extended(&mut model, &mut points, reached, &extension(), &mut files, never)?;
    Ok((reached.summary, points))
}

fn main() {
    match run(&std::env::temp_dir().join("mpm-temperature"), DECK, None) {
        Ok((summary, _)) => println!("{} steps, energy error {:.1e}", summary.steps, summary.energy_error()),
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;
    use mpm::output::vtu::read::{MeshFile, Section};
    use mpm::points::PointArray;

    /// Width of the column, [m], Young's modulus, [Pa], and Poisson's ratio.
    const WIDTH: f64 = 0.5;
    const SPACING: f64 = 0.25;
    const YOUNG: f64 = 1e10;
    const POISSON: f64 = 0.2;

    /// A column of a table.
    fn column(directory: &Path, table: &str, name: &str) -> Vec<f64> {
        let text = std::fs::read_to_string(directory.join(table)).unwrap();
        let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let place = rows.next().unwrap().iter().position(|column| *column == name).unwrap();
        rows.map(|row| row[place].parse().unwrap()).collect()
    }

    #[test]
    fn a_heated_column_presses_expands_and_goes_on_from_a_checkpoint() {
        let directory = tempfile::tempdir().unwrap();
        let directory = directory.path();
        let (summary, points) = run(directory, DECK, None).unwrap();
        assert_eq!((summary.steps, summary.indefinite_solves, summary.warnings.len()), (7, 0, 0));
        let close = |a: f64, b: f64, part: f64| assert!((a - b).abs() <= part * b.abs(), "{a} {b}");
        let array = |which| points.array(which).values;

        // In the steady state, the temperature is linear and heat flows at a constant rate. The expansion changes
        // positions by a part of 1e-4.
        let heights: Vec<f64> = array(PointArray::Position).chunks(2).map(|x| x[1]).collect();
        for (kept, y) in points.field("temperature").unwrap().values.iter().zip(&heights) {
            close(*kept, HOT * y / HEIGHT, 1e-3);
        }
        let [hot, cold] =
            ["hot_temperature", "cold_temperature"].map(|n| column(directory, "history.csv", n));
        let rate = CONDUCTIVITY * HOT / HEIGHT * WIDTH;
        close(hot[6], rate, 1e-3);
        close(cold[6], -rate, 1e-3);
        // What has flowed in is stored.
        let time = column(directory, "history.csv", "time");
        let flowed: f64 =
            (0..3).map(|k| (hot[k] + cold[k]) * (time[k] - if k > 0 { time[k - 1] } else { 0.0 })).sum();

        // While the lid is held, the mean temperature determines its force; the stress has no other part, as the mean
        // strain is zero.
        let lid = column(directory, "history.csv", "lid_ry");
        close(lid[2], -BETA * flowed / CAPACITY / HEIGHT, 1e-3);
        assert!(lid[6].abs() < 1e-6 * lid[2].abs(), "{}", lid[6]);
        // Once it is released, the column expands freely upwards.
        let modulus = YOUNG * (1.0 - POISSON) / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
        let moved = array(PointArray::Displacement);
        // The nodes move by the exact displacement, and linear functions carry the points between them.
        let exact = |y: f64| BETA * HOT / modulus * y * y / (2.0 * HEIGHT);
        for (u, y) in moved.chunks(2).zip(&heights) {
            let below = (y / SPACING).floor() * SPACING;
            let part = (y - below) / SPACING;
            close(u[1], (1.0 - part) * exact(below) + part * exact(below + SPACING), 2e-3);
        }

        // The tables and the grid files name the field.
        let residuals = column(directory, "convergence.csv", "residual_temperature");
        assert!(residuals.last().unwrap() <= &1e-9 && residuals.iter().any(|r| *r > 1e-3));
        let grid = MeshFile::read(&directory.join("grid_0001.vtu")).unwrap();
        let nodes = grid.positions().unwrap();
        let rises = grid.values(Section::PointData, "temperature").unwrap();
        let flows = grid.values(Section::PointData, "temperature_reaction").unwrap();
        for ((x, rise), flow) in nodes.iter().zip(rises).zip(flows) {
            let is_held = x[1] == 0.0 || x[1] == HEIGHT;
            assert!(if x[1] == HEIGHT { rise == HOT } else { (0.0..HOT).contains(&rise) }, "{x:?}: {rise}");
            assert_eq!(flow != 0.0, is_held, "{x:?}: {flow}");
        }

        // Resumed within either stage, the run ends with the same bits. The last two checkpoints of a run are kept.
        let files = ["history.csv", "convergence.csv", "grid_0007.vtu", "points_0007.vtu"];
        let written = || files.map(|name| std::fs::read(directory.join(name)).unwrap());
        let before = written();
        let (first_stage, _) = DECK.split_once("  - {name: expand").unwrap();
        for (deck, step) in [(DECK, 6), (first_stage, 2)] {
            run(directory, deck, None).unwrap();
            let (_, again) = run(directory, DECK, Some(step)).unwrap();
            assert_eq!(again.converged, points.converged);
            for (name, _) in FIELDS {
                assert_eq!(again.field(name).unwrap().values, points.field(name).unwrap().values);
            }
            assert!(before == written(), "files differ after step {step}");
        }
    }
}
