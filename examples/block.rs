//! A block of 4 × 4 × 4 m under its own weight in three load steps: time and memory of a three-dimensional analysis.
//!
//! ```sh
//! cargo run --example block -- [grid spacing, m] [law] [method] [threads]
//! ```
//!
//! Laws: `neo-hookean`, `hencky`, `von-mises`; methods: `mpm`, `gimp`. Defaults: 0.25 m, `neo-hookean`, `mpm`, 1
//! thread.
#![allow(clippy::print_stdout, reason = "a program")]

use std::time::Instant;

use mpm::basis::{DomainKind, Method};
use mpm::domain::DomainUpdate;
use mpm::formula::Formula;
use mpm::grid::{Grid, Structured};
use mpm::material::{Hencky, Material, NeoHookean, VonMises};
use mpm::model::{
    Action, Body, BoundaryCondition, Load, LoadCurve, Model, NamedMaterial, Newton, NodeSet, Stepping,
};
use mpm::points::{PointVolume, Points, Seed};
use mpm::solver::{self, Silent};
use mpm::stress::Formulation;
use mpm::timing::Phase;

/// Side of the block, [m].
const SIDE: f64 = 4.0;
/// Number of points per cell along each axis.
const PER_AXIS: usize = 3;
const DENSITY: f64 = 1000.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |n: usize, default: &str| arguments.get(n).map_or(default.to_owned(), String::clone);
    let spacing: f64 = argument(0, "0.25").parse().unwrap_or(0.25);
    let law: Box<dyn Material> = match argument(1, "neo-hookean").as_str() {
        "hencky" => Box::new(Hencky::new(1e6, 0.3)),
        "von-mises" => Box::new(VonMises::new(1e6, 0.3, 8e3)),
        _ => Box::new(NeoHookean::new(1e6, 0.3)),
    };
    let method = if argument(2, "mpm") == "gimp" { Method::Gimp } else { Method::Mpm };
    let threads: usize = argument(3, "1").parse().unwrap_or(1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let Ok(pool) = pool else { return println!("no threads") };
    pool.install(|| run(spacing, law, method));
}

fn run(spacing: f64, law: Box<dyn Material>, method: Method) {
    let (model, mut points) = block(spacing, law, method);
    let set_up = memory();
    let start = Instant::now();
    let summary = match solver::run(&model, &mut points, &mut Silent) {
        Ok(reached) => reached.summary,
        Err(error) => return println!("{error}"),
    };
    let lowest = |p: usize| points.converged.position[p][2] - points.original_position[p][2];
    let settlement = (0..points.len()).map(lowest).fold(0.0, f64::min);
    let n = points.len() as f64;
    let evaluations = summary.evaluations as f64;
    let solves = summary.linear_solves as f64;
    println!("{} points, {} unknowns, {} evaluations, {} solves", n, summary.unknowns, evaluations, solves);
    println!("largest settlement of a point {:.6} m; {:.2} s", -settlement, start.elapsed().as_secs_f64());
    let mut total = 0.0;
    for phase in Phase::ALL {
        let seconds = summary.timings.spent(phase).cpu.as_secs_f64();
        total += seconds;
        let per_point = 1e6 * seconds / n / evaluations;
        println!("{:10} {seconds:8.3} s CPU, {per_point:7.3} µs per point and evaluation", phase.name());
    }
    println!(
        "total      {total:8.3} s CPU, {:7.3} µs per point and evaluation, {:.4} s per evaluation",
        1e6 * total / n / evaluations,
        total / evaluations
    );
    let [now, peak] = memory();
    println!("memory: points {:.0} MiB, at the end {now:.0} MiB, peak {peak:.0} MiB", set_up[0]);
    println!("        {:.0} bytes per point at the peak", peak * 1_048_576.0 / n);
}

/// Current and peak resident memory, [MiB]; 0 if the operating system does not report them.
fn memory() -> [f64; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ["VmRSS:", "VmHWM:"].map(|key| {
        let line = status.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_default();
        line.trim().trim_end_matches(" kB").parse::<f64>().unwrap_or_default() / 1024.0
    })
}

fn block(spacing: f64, law: Box<dyn Material>, method: Method) -> (Model<3>, Points<3>) {
    let cells = |length: f64| (length / spacing).round() as usize;
    let grid = Structured::<3>::new([0.0; 3], [spacing; 3], [cells(5.0), cells(5.0), cells(4.25)]);
    let nodes_at = |axis: usize| {
        let on_side = |node: &u32| grid.node_index(*node as usize)[axis] == 0;
        NodeSet::Fixed((0..grid.n_nodes() as u32).filter(on_side).collect())
    };
    let hold = |name: &str, axis: usize, held: [bool; 3]| BoundaryCondition {
        name: name.to_owned(),
        nodes: nodes_at(axis),
        displacement: held.map(|held| held.then(|| Formula::constant(0.0))),
        axes: None,
        curve: LoadCurve::ramp(1.0),
    };
    let boundary_conditions = vec![
        hold("left", 0, [true, false, false]),
        hold("front", 1, [false, true, false]),
        hold("base", 2, [true, true, true]),
    ];
    let points = Points::new(&seeds(cells(SIDE) * PER_AXIS, law.as_ref(), method));
    let model = Model {
        title: "block under its own weight".to_owned(),
        grid: Box::new(grid),
        revolved: false,
        formulation: Formulation::PreviouslyConverged,
        point_volume: PointVolume::Deformation,
        materials: vec![NamedMaterial { name: "soil".to_owned(), law }],
        bodies: vec![Body {
            name: "block".to_owned(),
            material: 0,
            method,
            domain_update: DomainUpdate::Corners,
            strain: Default::default(),
            split_above: None,
        }],
        surfaces: Vec::new(),
        boundary_conditions,
        loads: vec![Load {
            name: "weight".to_owned(),
            action: Action::Gravity([0.0, 0.0, -10.0]),
            acts_on: vec![true],
            curve: LoadCurve::ramp(1.0),
        }],
        stabilisation: Default::default(),
        stepping: Stepping::fixed(3, 1.0),
        newton: Newton::default(),
        probes: Vec::new(),
        tools: Vec::new(),
        contacts: Vec::new(),
        body_groups: Default::default(),
        water: None,
        initial_imbalance: None,
        stages: Vec::new(),
        moving_grid: None,
        present: Default::default(),
        engines: Default::default(),
    };
    (model, points)
}

/// A regular lattice of `count` points along each axis.
fn seeds(count: usize, law: &dyn Material, method: Method) -> Vec<Seed<3>> {
    let distance = SIDE / count as f64;
    let volume = distance.powi(3);
    let half = if method.domain() == DomainKind::None { 0.0 } else { 0.5 * distance };
    (0..count.pow(3))
        .map(|n| Seed {
            body: 0,
            position: [n % count, n / count % count, n / count.pow(2)]
                .map(|index| (index as f64 + 0.5) * distance),
            half_lengths: [half; 3],
            corners: Vec::new(),
            volume,
            mass: DENSITY * volume,
            outer_layer: false,
            history: law.state_fields().iter().map(|field| field.initial).collect(),
        })
        .collect()
}
