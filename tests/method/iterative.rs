//! Iterative solution with the multigrid preconditioner: it agrees with the factorisation, needs few iterations for any
//! grid size and any filling of cut cells, and gives the same bits for any number of threads.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

use std::path::Path;

use mpm::assembly::Wanted;
use mpm::basis::Connectivity;
use mpm::deck::build::build;
use mpm::deck::load::{LoadedDeck, load, load_text};
use mpm::dofs::DofMap;
use mpm::linear::{
    Backend, BlockMatrix, Choice, Direct, Division, Factorisation, FreeEntries, Krylov, Layout, LinearError,
    Solved, Stiffness,
};
use mpm::model::Model;
use mpm::points::Points;
use mpm::quality::Code;
use mpm::ranks::Halo;
use mpm::solver::{self, Observer, Reached, Solvable, StepReport, Summary};
use mpm::step::{At, StepContext};
use mpm::stress::{Mechanics, PlaneStrain, Solid};
use mpm::terms::Sum;
use mpm::terms::external_force::external_force;

/// Pseudo-random numbers in [−1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn deck(path: &str, set: &[(&str, &str)]) -> LoadedDeck {
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(path);
    load(&path, &set).unwrap_or_else(|e| panic!("{e}"))
}

/// The linear equations of the first load step of a model.
struct Equations<const D: usize> {
    sum: Sum<D>,
    dofs: DofMap<D>,
    places: Vec<[u32; D]>,
    /// Grid lines along graded axes.
    lines: [Option<Vec<f64>>; D],
    held: Vec<[bool; D]>,
    /// External force of the step.
    f_ext: Vec<[f64; D]>,
}

/// Stiffness of the first step at a random increment of up to `wobble` at every node, [length].
fn equations<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    wobble: f64,
) -> Equations<D> {
    let methods = model.methods();
    let links = Connectivity::new(model.grid.as_ref(), points, &methods).unwrap();
    let dofs = DofMap::new(model, points, &links, 0.0, model.stepping.end_time / model.stepping.count as f64)
        .unwrap();
    let mut sum = Sum::from_model::<M>(&StepContext::first(model, &links), points).unwrap();
    let mut random = Random(3);
    let delta_d: Vec<[f64; D]> =
        (0..links.n_active()).map(|_| std::array::from_fn(|_| wobble * random.next())).collect();
    sum.evaluate(&StepContext::first(model, &links), points, At::new(&delta_d), Wanted::Stiffness).unwrap();
    let places = links.active_nodes().iter().map(|&node| model.grid.lattice(node as usize)).collect();
    let grid = model.grid.lines().unwrap();
    let lines = std::array::from_fn(|d| grid.axes()[d].graded_lines().map(<[f64]>::to_vec));
    let held = (0..links.n_active())
        .map(|node| std::array::from_fn(|axis| dofs.free(node, axis).is_none()))
        .collect();
    let f_ext = external_force(model, points, &links, model.stepping.end_time / model.stepping.count as f64)
        .unwrap()
        .nodal;
    Equations { sum, dofs, places, lines, held, f_ext }
}

impl<const D: usize> Equations<D> {
    /// The external force, or random forces if `rough`; zero at fixed degrees of freedom.
    fn load(&self, rough: bool) -> Vec<[f64; D]> {
        let mut random = Random(5);
        let mut load = vec![[0.0; D]; self.places.len()];
        for (n, load) in load.iter_mut().enumerate() {
            for d in 0..D {
                let force = if rough { random.next() } else { self.f_ext[n][d] };
                load[d] = if self.held[n][d] { 0.0 } else { force };
            }
        }
        load
    }

    fn with_layout<T>(&self, work: impl FnOnce(&Layout<D>) -> T) -> T {
        let nodes: Vec<u32> = (0..self.places.len() as u32).collect();
        let lattice = |node: usize| self.places[node];
        let numbering = self.dofs.numbering();
        let lines = std::array::from_fn(|d| self.lines[d].as_deref());
        work(&Layout {
            numbering,
            nodes: &nodes,
            lattice: &lattice,
            position: &|node| self.places[node].map(f64::from),
            lines,
            halo: &Halo::default(),
        })
    }

    fn solve(&self, load: &[[f64; D]], tolerance: f64) -> (Vec<[f64; D]>, usize) {
        let mut solver = Krylov::default();
        let mut x = vec![[0.0; D]; load.len()];
        let matrix = self.sum.system().matrix();
        let mut division = Division::new(matrix.column_start, matrix.row);
        let mut stiffness = Stiffness { matrix, division: &mut division };
        let solved = self.with_layout(|layout| {
            solver.prepare(layout, &stiffness.matrix)?;
            solver.factorise(layout, &stiffness.matrix)?;
            solver.solve(layout, &mut stiffness, load, &mut x, tolerance)
        });
        let Solved { factorisation, iterations } = solved.unwrap();
        assert_eq!(factorisation, Factorisation::Multigrid);
        (x, iterations)
    }

    fn solve_directly(&self, load: &[[f64; D]]) -> Vec<[f64; D]> {
        let matrix = self.sum.system().matrix();
        let entries = FreeEntries::new(&matrix, self.dofs.numbering());
        let mut values = Vec::new();
        entries.values(&matrix, &mut values);
        let mut direct = Direct::default();
        let n = self.dofs.n_free();
        direct.analyse(entries.pattern, (0..n).collect()).unwrap();
        assert_eq!(direct.factorise(&values).unwrap(), Factorisation::Cholesky);
        let mut x = vec![0.0; n];
        for (node, load) in load.iter().enumerate() {
            for d in 0..D {
                if let Some(unknown) = self.dofs.free(node, d) {
                    x[unknown] = load[d];
                }
            }
        }
        direct.solve(&mut x).unwrap();
        let at = |node: usize, d: usize| self.dofs.free(node, d).map_or(0.0, |unknown| x[unknown]);
        (0..load.len()).map(|node| std::array::from_fn(|d| at(node, d))).collect()
    }
}

fn norm<const D: usize>(x: &[[f64; D]]) -> f64 {
    x.iter().flatten().map(|x| x * x).sum::<f64>().sqrt()
}

fn distance<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let difference: Vec<[f64; D]> =
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|d| a[d] - b[d])).collect();
    norm(&difference)
}

fn check_against_direct<const D: usize>(name: &str, equations: Equations<D>) {
    for rough in [false, true] {
        let load = equations.load(rough);
        let (x, iterations) = equations.solve(&load, 1e-12);
        let exact = equations.solve_directly(&load);
        let error = distance(&x, &exact) / norm(&exact);
        println!("{name}, rough {rough}: {iterations} iterations, error {error:.1e}");
        assert!(error < 1e-8, "{name}: {error:e}");
    }
}

#[test]
fn solutions_are_those_of_the_factorisation() {
    for (method, h) in [("mpm", "1"), ("mpm", "0.5"), ("gimp", "0.5"), ("cpdi2", "0.5")] {
        let (model, mut points) =
            build::<3>(&deck("block/block.yaml", &[("h", h), ("method", method)])).unwrap();
        let equations = equations::<3, Solid>(&model, &mut points, 0.01);
        check_against_direct(&format!("block {method} {h}"), equations);
    }
    for (method, h) in [("mpm", "0.5"), ("gimp", "0.25")] {
        let (model, mut points) = build::<2>(&deck("beam.yaml", &[("h", h), ("method", method)])).unwrap();
        let equations = equations::<2, PlaneStrain>(&model, &mut points, 0.001);
        check_against_direct(&format!("beam {method} {h}"), equations);
    }
}

/// Refinement by a factor of eight in the number of cells hardly changes the number of iterations.
#[test]
fn iterations_hardly_grow_with_refinement() {
    let counts = ["0.5", "0.25", "0.125"].map(|h| {
        let deck = deck("block/block.yaml", &[("h", h), ("n", "2")]);
        let (model, mut points) = build::<3>(&deck).unwrap();
        let equations = equations::<3, Solid>(&model, &mut points, 0.0);
        let load = equations.load(false);
        equations.solve(&load, 1e-8).1
    });
    println!("{counts:?} iterations");
    assert!(counts[2] <= counts[0] + 6 && counts[2] <= 20, "{counts:?}");
}

/// Cells whose sides differ by a factor of 5 along every axis, so that their proportions differ too, need only a few
/// times as many iterations as cubes, and no more than if the transfer used the weights of equal cells.
#[test]
fn graded_cells_cost_few_iterations() {
    let graded = "[{to: 2, cells: 5, ratio: 0.8}, {to: 6, cells: 7, ratio: 1.3}]";
    let text = |spacing: &str| {
        format!(
            "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [6, 6, 6], spacing: {spacing}}}
materials: {{rubber: {{model: neo-hookean, young: 1e6, poisson: 0.3, density: 1000}}}}
bodies: [{{name: block, material: rubber, shape: {{type: cells}}, method: mpm, points_per_cell: 2}}]
boundary_conditions: [{{name: floor, nodes: {{z: 0}}, fix: [x, y, z]}}]
loads: [{{name: weight, type: gravity, acceleration: [0, 0, -10]}}]
steps: {{count: 10}}
"
        )
    };
    let [even, graded] = ["0.5", &format!("[{graded}, {graded}, {graded}]")].map(|spacing| {
        let loaded = load_text("deck.yaml", text(spacing).as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let (model, mut points) = build::<3>(&loaded).unwrap();
        let mut equations = equations::<3, Solid>(&model, &mut points, 0.0);
        let load = equations.load(false);
        let (x, with_lines) = equations.solve(&load, 1e-10);
        equations.lines = [const { None }; 3];
        let (y, without) = equations.solve(&load, 1e-10);
        assert!(distance(&x, &y) < 1e-7 * norm(&x));
        [with_lines, without]
    });
    println!("even: {even:?} iterations, graded: {graded:?}");
    assert_eq!(even[0], even[1]);
    assert!(graded[0] <= 3 * even[0] && graded[0] <= graded[1], "{even:?} {graded:?}");
}

/// A block that fills only the fraction `part` of each side of its outermost cells.
fn cut(method: &str, part: f64) -> LoadedDeck {
    let side = 4.0 + 0.5 * part;
    let text = format!(
        "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [6, 6, 6], spacing: 0.5}}
materials: {{rubber: {{model: neo-hookean, young: 1e6, poisson: 0.3, density: 1000}}}}
bodies:
  - {{name: block, material: rubber, shape: {{type: box, min: [0, 0, 0], max: [{side}, {side}, {side}]}},
     method: {method}, point_spacing: {}}}
boundary_conditions:
  - {{name: symmetry_x, nodes: {{x: 0}}, fix: [x]}}
  - {{name: symmetry_y, nodes: {{y: 0}}, fix: [y]}}
  - {{name: floor, nodes: {{z: 0}}, fix: [x, y, z]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, 0, -10]}}
steps: {{count: 2}}
solver: {{linear: iterative}}
output: {{every: 0}}
",
        side / 24.0
    );
    load_text("cut.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn nearly_empty_cells_cost_few_iterations() {
    for method in ["mpm", "gimp"] {
        let mut counts = Vec::new();
        for part in [1.0, 0.5, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8] {
            let (model, mut points) = build::<3>(&cut(method, part)).unwrap();
            let equations = equations::<3, Solid>(&model, &mut points, 0.0);
            let load = equations.load(false);
            counts.push(equations.solve(&load, 1e-8).1);
        }
        println!("{method}: {counts:?} iterations");
        assert!(counts.iter().all(|&n| n <= 40), "{method}: {counts:?}");
    }
}

/// Solves with the stiffness of a block whose diagonal blocks are scaled, for random forces; returns the outcome and
/// the true residual.
fn with_diagonal(factor: f64) -> (Result<Solved, LinearError>, f64) {
    let (model, mut points) = build::<3>(&deck("block/block.yaml", &[("h", "0.5")])).unwrap();
    let equations = equations::<3, Solid>(&model, &mut points, 0.0);
    let matrix = equations.sum.system().matrix();
    let load = equations.load(true);
    let mut blocks = matrix.blocks.to_vec();
    for c in 0..equations.places.len() {
        let own = &mut blocks[matrix.column_start[c]];
        own.iter_mut().flatten().for_each(|entry| *entry *= factor);
    }
    let matrix = BlockMatrix { blocks: &blocks, ..matrix };
    let mut division = Division::new(matrix.column_start, matrix.row);
    let mut solver = Krylov::default();
    let mut x = load.clone();
    let outcome = equations.with_layout(|layout| {
        let mut stiffness = Stiffness { matrix, division: &mut division };
        solver.prepare(layout, &matrix)?;
        solver.factorise(layout, &matrix)?;
        solver.solve(layout, &mut stiffness, &load, &mut x, 1e-10)
    });
    let mut product = vec![[0.0; 3]; x.len()];
    matrix.multiply(&mut division, &x, &mut product);
    for (product, held) in product.iter_mut().zip(&equations.held) {
        for d in (0..3).filter(|&d| held[d]) {
            product[d] = 0.0;
        }
    }
    (outcome, distance(&product, &load) / norm(&load))
}

#[test]
fn indefinite_systems_are_solved_as_well() {
    for (factor, kind) in [
        (0.99, Factorisation::Multigrid),
        (0.97, Factorisation::MultigridIndefinite),
        (0.95, Factorisation::MultigridIndefinite),
        (0.9, Factorisation::MultigridIndefinite),
    ] {
        let (outcome, residual) = with_diagonal(factor);
        println!("{factor}: {outcome:?}, residual {residual:.1e}");
        let Solved { factorisation, iterations } = outcome.unwrap();
        assert_eq!(factorisation, kind);
        assert!(iterations <= 30 && residual <= 1.01e-10, "{factor}: {iterations} {residual:e}");
    }
}

/// If hardly any motion has positive stiffness, no multigrid cycle converges; the solver must report this.
#[test]
fn failure_of_the_iterations_is_reported() {
    for factor in [0.5, -1.0] {
        let (outcome, _) = with_diagonal(factor);
        println!("{factor}: {outcome:?}");
        assert!(matches!(outcome, Err(LinearError::NotConverged { .. })), "{factor}: {outcome:?}");
    }
}

/// Record of a run, step by step.
#[derive(Default)]
struct Record {
    residuals: Vec<Vec<f64>>,
    factorisations: Vec<Factorisation>,
    reactions: Vec<f64>,
    positions: Vec<f64>,
}

impl<const D: usize> Observer<D> for Record {
    fn converged(
        &mut self,
        _: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.residuals.push(report.residuals.clone());
        self.factorisations.extend(&report.factorisations);
        self.reactions.extend(report.reactions.iter().flatten());
        self.positions = points.converged.position.iter().flatten().copied().collect();
        Ok(())
    }
}

fn run<const D: usize>(mut built: (Model<D>, Points<D>), linear: Choice, threads: usize) -> (Record, Summary)
where
    Model<D>: Solvable<D>,
{
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    built.0.newton.linear = linear;
    pool.install(|| {
        let mut record = Record::default();
        let Reached { summary, .. } = solver::run(&built.0, &mut built.1, &mut record).unwrap();
        (record, summary)
    })
}

/// Inexact solves need as many Newton iterations as exact ones and reach the same equilibrium; reactions balance the
/// loads equally well.
#[test]
fn equilibrium_is_reached_as_with_exact_solves() {
    for method in ["mpm", "gimp"] {
        let set = [("h", "0.5"), ("method", method), ("steps", "2")];
        let built = || build::<3>(&deck("block/block.yaml", &set)).unwrap();
        let (exact, _) = run(built(), Choice::Direct, 1);
        let (inexact, summary) = run(built(), Choice::Iterative, 1);
        assert_eq!(summary.iterative_solves, summary.linear_solves);
        assert!(summary.linear_iterations > summary.linear_solves);
        for (a, b) in exact.residuals.iter().zip(&inexact.residuals) {
            println!("{method}: {a:?} {b:?}");
            assert_eq!(a.len(), b.len(), "{method}: {a:?} {b:?}");
            assert!(b[b.len() - 1] <= 1e-9);
            // Convergence is nearly quadratic: an error of 1e-2 becomes 1e-6.
            assert!(b[2] < 1e-3 * b[1] && b[3] < 1e-3 * b[2], "{b:?}");
        }
        for (a, b) in exact.positions.iter().zip(&inexact.positions) {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
        let weight = 640e3;
        for (a, b) in exact.reactions.iter().zip(&inexact.reactions) {
            assert!((a - b).abs() < 1e-8 * weight, "{a} {b}");
        }
    }
}

/// A prescribed motion is the only load; its reactions must equal those of exact solves. Standard points reach
/// equilibrium in two steps; domains would need many.
#[test]
fn prescribed_motion_loads_the_body_through_inexact_solves() {
    let text = "
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [5, 5, 5], spacing: 0.5}
materials: {rubber: {model: neo-hookean, young: 1e6, poisson: 0.3}}
bodies:
  - {name: block, material: rubber, shape: {type: box, min: [0, 0, 0], max: [4, 4, 4]}, method: mpm, points_per_cell: 2}
boundary_conditions:
  - {name: floor, nodes: {z: 0}, fix: [x, y, z]}
  - {name: plate, nodes: {z: 4}, fix: [x, y], uz: -0.2}
steps: {count: 2}
";
    let loaded = load_text("plate.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let built = || build::<3>(&loaded).unwrap();
    let (exact, _) = run(built(), Choice::Direct, 1);
    let (inexact, _) = run(built(), Choice::Iterative, 1);
    let force = exact.reactions.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
    assert!(force > 1e5, "{force:e}");
    assert_eq!(exact.reactions.len(), inexact.reactions.len());
    for (a, b) in exact.reactions.iter().zip(&inexact.reactions) {
        assert!((a - b).abs() < 1e-8 * force, "{a} {b}");
    }
    assert_eq!((exact.residuals.len(), inexact.residuals.len()), (2, 2), "no step is halved");
    for (a, b) in exact.residuals.iter().zip(&inexact.residuals) {
        println!("{a:?} {b:?}");
        assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    }
}

/// A beam with steps so large that its stiffness becomes indefinite during the iterations.
#[test]
fn indefinite_steps_reach_the_same_equilibrium() {
    let set = [("method", "mpm"), ("steps", "5"), ("h", "0.125")];
    let built = || build::<2>(&deck("beam.yaml", &set)).unwrap();
    let (exact, account) = run(built(), Choice::Direct, 1);
    let (inexact, summary) = run(built(), Choice::Iterative, 1);
    println!("{} of {} indefinite", summary.indefinite_solves, summary.linear_solves);
    assert_eq!(summary.iterative_solves, summary.linear_solves);
    assert!(account.indefinite_solves > 0 && summary.indefinite_solves > 0);
    assert!(inexact.factorisations.contains(&Factorisation::MultigridIndefinite));
    for (a, b) in exact.positions.iter().zip(&inexact.positions) {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
}

/// A soil collapse in few steps, with strongly indefinite matrices.
#[test]
fn systems_that_iterations_cannot_solve_are_factorised_and_reported() {
    let set = [("method", "mpm"), ("steps", "1"), ("h", "0.25")];
    let built = || build::<2>(&deck("collapse.yaml", &set)).unwrap();
    let (_, summary) = run(built(), Choice::Iterative, 1);
    assert!((1..summary.linear_solves).contains(&summary.iterative_solves), "{summary:?}");
    assert!(summary.warnings.iter().any(|warning| warning.code == Code::Factorised), "{summary:?}");
}

#[test]
fn threads_change_no_bit() {
    for method in ["mpm", "gimp"] {
        let set = [("h", "0.25"), ("n", "2"), ("steps", "1"), ("method", method)];
        let built = || build::<3>(&deck("block/block.yaml", &set)).unwrap();
        let (one, _) = run(built(), Choice::Iterative, 1);
        assert!(one.factorisations.iter().all(|f| *f == Factorisation::Multigrid));
        for threads in [2, 3] {
            let (more, _) = run(built(), Choice::Iterative, threads);
            let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&one.reactions), bits(&more.reactions), "{method}, {threads} threads");
            assert!(bits(&one.positions) == bits(&more.positions), "{method}, {threads} threads");
            for (a, b) in one.residuals.iter().zip(&more.residuals) {
                assert_eq!(bits(a), bits(b), "{method}, {threads} threads");
            }
        }
    }
}
