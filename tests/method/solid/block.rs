//! Cost of the analysis of a block that settles under its own weight; a quarter of it is modelled between two symmetry
//! planes.

use mpm::basis::Method;
use mpm::domain::DomainUpdate;
use mpm::grid::Structured;
use mpm::material::NeoHookean;
use mpm::memory;
use mpm::model::{Action, Load, LoadCurve, Model};
use mpm::points::Points;
use mpm::solver::{self, Reached, Silent, Summary};
use mpm::timing::Phase;

use super::bodies::{Filling, cells_in, fill, fixed, model, nodes_where};

const SIDE: f64 = 4.0;

/// The block in cells of side `h`, with `n`³ points in each.
fn block(h: f64, n: usize) -> (Model<3>, Points<3>) {
    let cells = |length: f64| (length / h).round() as usize;
    let grid = Structured::<3>::new([0.0; 3], [h; 3], [cells(5.0), cells(5.0), cells(4.25)]);
    let law = NeoHookean::new(1e6, 0.3);
    let filling = Filling { method: Method::Mpm, n: [n; 3], density: 1000.0 };
    let points = Points::new(&fill(&grid, &cells_in(&grid, [0.0; 3], [SIDE; 3]), filling, &law));
    let on = |d: usize| nodes_where(&grid, move |x| x[d] == 0.0);
    let conditions = vec![
        fixed("base", on(2), [true; 3]),
        fixed("x", on(0), [true, false, false]),
        fixed("y", on(1), [false, true, false]),
    ];
    let mut model = model(grid, law, Method::Mpm, DomainUpdate::None, 3);
    model.boundary_conditions = conditions;
    model.loads = vec![Load {
        name: "weight".into(),
        action: Action::Gravity([0.0, 0.0, -10.0]),
        acts_on: vec![true],
        curve: LoadCurve::ramp(1.0),
    }];
    (model, points)
}

/// Runs with `threads` threads and prints the cost.
fn measure(h: f64, n: usize, threads: usize) -> (Points<3>, Summary) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (model, mut points) = block(h, n);
        let before = memory::resident().unwrap();
        let Reached { summary, .. } = solver::run(&model, &mut points, &mut Silent).unwrap();
        let (mut cpu, mut wall) = (0.0, 0.0);
        println!("{} points, {} unknowns, {} thread(s)", points.len(), summary.unknowns, threads);
        for phase in Phase::ALL {
            let spent = summary.timings.spent(phase);
            cpu += spent.cpu.as_secs_f64();
            wall += spent.wall.as_secs_f64();
            println!("{:10} {:8.3} s CPU", phase.name(), spent.cpu.as_secs_f64());
        }
        let evaluations = summary.evaluations as f64;
        let assembly = summary.timings.spent(Phase::Assembly).cpu.as_secs_f64();
        println!(
            "{cpu:.3} s CPU, {wall:.3} s; {evaluations} evaluations, {} solves: {:.4} s CPU each, assembly {:.3} µs per point",
            summary.linear_solves,
            cpu / evaluations,
            1e6 * assembly / evaluations / points.len() as f64
        );
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        println!("memory {:.1} MiB before, peak {:.1} MiB", mib(before), mib(memory::peak().unwrap()));
        (points, summary)
    })
}

fn settlement(points: &Points<3>) -> f64 {
    (0..points.len())
        .map(|p| points.original_position[p][2] - points.converged.position[p][2])
        .fold(0.0, f64::max)
}

/// 110 592 points in cells of 0.25 m.
#[test]
#[ignore = "seconds, and the numbers mean something only where nothing else runs"]
fn the_block_of_quarter_metres() {
    let (points, _) = measure(0.25, 3, 1);
    println!("largest settlement {:.9} m", settlement(&points));
}

/// 10⁶ points, 8 in each of 50³ cells.
#[test]
#[ignore = "minutes and gigabytes"]
fn the_block_of_a_million_points() {
    let (points, _) = measure(SIDE / 50.0, 2, 2);
    println!("largest settlement {:.9} m", settlement(&points));
}
