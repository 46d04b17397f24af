//! Runs divided between ranks (threads, in these tests) give the results of one rank within the equilibrium tolerance.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mpm::deck::load::load;
use mpm::deck::ready::{Analysis, Prepared, prepare_on};
use mpm::linear::{Backends, Divided, Engine};
use mpm::memory::Memory;
use mpm::model::Model;
use mpm::points::Points;
use mpm::ranks::{Ranks, threads};
use mpm::solver::{Observer, Reached, SolveError, StepReport};
use mpm::surface::SurfaceFields;
use mpm::terms::ToolState;

use crate::long::{first, is_long};

/// What a run reports on rank 0.
#[derive(Debug, Default, Clone, PartialEq)]
struct Record {
    /// Reactions, loads, tool forces, surfaces, energies and counts of each step.
    numbers: Vec<Vec<f64>>,
    /// Moments of reactions and tools in each step.
    moments: Vec<Vec<f64>>,
    iterations: Vec<usize>,
    warnings: Vec<String>,
    /// Position and Kirchhoff stress of each point, in the order of their permanent numbers.
    points: Vec<f64>,
    /// Largest stress, [stress].
    scale: f64,
}

/// Stops after some steps.
struct Recorder {
    record: Record,
    steps: usize,
}

impl<const D: usize> Observer<D> for Recorder {
    fn converged(
        &mut self,
        _: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        Reached { summary, .. }: &Reached,
    ) -> std::io::Result<()> {
        let (energy, links) = (&report.energy, &report.grid.links);
        let mut numbers: Vec<f64> = report.reactions.iter().flatten().copied().collect();
        numbers.extend(report.loads.iter().flatten());
        numbers.extend(report.list::<ToolState<D>>().iter().flat_map(|tool| tool.force));
        for surface in report.list::<SurfaceFields<D>>() {
            numbers.extend(
                [&surface.position, &surface.load, &surface.reaction].into_iter().flatten().flatten(),
            );
        }
        numbers.extend([energy.external_work, energy.strain_energy, energy.plastic_work]);
        numbers.extend([
            report.unknowns as f64,
            points
                .ranks
                .total((0..links.n_active()).filter(|node| links.halo().is_own(*node)).count() as f64),
            report.stabilised_faces as f64,
        ]);
        self.record.numbers.push(numbers);
        let mut moments: Vec<f64> =
            report.list::<ToolState<D>>().iter().flat_map(|tool| tool.moment).collect();
        moments.extend(report.moments.iter().flatten().flat_map(|of| of.moment));
        self.record.moments.push(moments);
        let gathered = points.gather();
        let points = gathered.as_ref().unwrap_or(points);
        self.record.iterations.push(report.residuals.len());
        self.record.warnings = summary.warnings.iter().map(|warning| format!("{:?}", warning.code)).collect();
        let order = points.by_id();
        self.record.points.clear();
        self.record.scale = 0.0;
        for p in order {
            self.record.points.extend(points.converged.position[p]);
            let stress = points.converged.kirchhoff_stress[p];
            self.record.points.extend(stress.0);
            self.record.scale = self.record.scale.max(stress.norm());
        }
        self.steps -= usize::from(self.steps > 0);
        Ok(())
    }

    fn interrupted(&self) -> bool {
        self.steps == 0
    }
}

/// Divides every factorisation between the ranks, however few unknowns there are.
#[derive(Debug)]
struct Dividing;

impl<const D: usize> Engine<D> for Dividing {
    fn backends(&self) -> Backends<D> {
        Backends { direct: Some(Box::new(Divided::<D>::default().from(0.0))), ..Backends::default() }
    }
}

/// Runs the first steps of a deck on this rank. If the number of ranks is even, they divide factorisations; if it is
/// odd, rank 0 factorises small systems for all ranks.
fn run(deck: &str, set: &[(&str, &str)], steps: usize, ranks: &Ranks) -> (Record, Option<String>) {
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(deck);
    let loaded = load(&path, &set).unwrap_or_else(|e| panic!("{e}"));
    let Prepared { mut analysis, .. } =
        prepare_on(ranks, loaded, Memory::this_machine(), false).unwrap_or_else(|e| panic!("{e}"));
    if ranks.count().is_multiple_of(2) {
        analysis.solve_with(&Arc::new(Dividing));
    }
    let mut recorder = Recorder { record: Record::default(), steps };
    let reached = analysis.beginning();
    let outcome = analysis.run(reached, &mut recorder);
    let error = outcome.err().filter(|error| !matches!(error, SolveError::Interrupted { .. }));
    (recorder.record, error.map(|error| error.to_string()))
}

/// Largest difference between numbers, relative to `scale`.
fn difference(a: &[f64], b: &[f64], scale: f64) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale.max(f64::MIN_POSITIVE)
}

/// Compares runs on several numbers of ranks with the run on one rank.
fn agree(deck: &str, set: &[(&str, &str)], steps: usize, numbers: &[usize]) {
    let (one, error) = run(deck, set, steps, &Ranks::default());
    assert!(!one.numbers.is_empty(), "{deck}: {error:?}");
    for &n in numbers {
        let all = threads::run(n, |ranks| run(deck, set, steps, &ranks));
        let (found, failed) = &all[0];
        assert_eq!(failed.is_some(), error.is_some(), "{deck} on {n}: {failed:?}, {error:?}");
        assert_eq!(found.numbers.len(), one.numbers.len(), "{deck} on {n}: steps");
        let mut worst: f64 = 0.0;
        for (a, b) in found.numbers.iter().zip(&one.numbers) {
            // Reactions that cancel leave only round-off of the stresses.
            let scale = b.iter().take(b.len() - 6).fold(one.scale, |s, x| s.max(x.abs()));
            let k = b.len() - 6;
            worst = worst.max(difference(&a[..k], &b[..k], scale));
            let energy = b[k].abs().max(b[k + 1].abs());
            worst = worst.max(difference(&a[k..k + 3], &b[k..k + 3], energy));
            assert_eq!(a[k + 3..], b[k + 3..], "{deck} on {n}: unknowns, nodes, faces");
        }
        // One point per cell leaves motions of nodes undetermined, and reactions act at nodes that have moved.
        let are_determined = !set.contains(&("n", "1"));
        for (a, b) in found.moments.iter().zip(&one.moments).filter(|_| are_determined) {
            worst = worst.max(difference(a, b, b.iter().fold(one.scale, |scale, x| scale.max(x.abs()))));
        }
        let scale = one.scale.max(f64::MIN_POSITIVE);
        let deviation = found.points.iter().zip(&one.points).map(|(a, b)| (a - b).abs() / scale.max(b.abs()));
        let deviation = deviation.fold(0.0, f64::max);
        println!(
            "{deck} on {n} ranks: forces and work {worst:.1e}, points {deviation:.1e}, evaluations {:?} of {:?}",
            found.iterations.iter().sum::<usize>(),
            one.iterations.iter().sum::<usize>()
        );
        assert_eq!(found.warnings, one.warnings, "{deck} on {n}");
        // The least squares that share out the forces which a stage releases amplify round-off.
        let releases = ["footing_stages.yaml", "excavation.yaml"].contains(&deck);
        let most = if releases { 1e-5 } else { 1e-9 };
        assert!(worst < most && deviation < 1e-9, "{deck} on {n}: {worst:e} {deviation:e}");
    }
}

/// The fixed data and the state of points in the order of their numbers, as bits, with the outer layer and the bodies.
fn bits<const D: usize>(points: &Points<D>) -> Vec<u64> {
    let mut all = Vec::new();
    for p in points.by_id() {
        let numbers = (points.original_position[p].iter().chain(&points.converged.position[p]))
            .chain([&points.mass[p], &points.original_volume[p]])
            .chain(points.converged.half_lengths.get(p).into_iter().flatten())
            .chain(points.corners(p).iter().flatten())
            .chain(&points.converged.kirchhoff_stress[p].0);
        all.extend(numbers.map(|x| x.to_bits()));
        all.extend([u64::from(points.id[p]), u64::from(points.body[p]), u64::from(points.outer_layer[p])]);
    }
    all
}

/// The points that all ranks generate together.
fn formed(deck: &Path, ranks: &Ranks) -> Option<Vec<u64>> {
    let loaded = load(deck, &[]).unwrap_or_else(|e| panic!("{e}"));
    let Prepared { analysis, .. } =
        prepare_on(ranks, loaded, Memory::this_machine(), false).unwrap_or_else(|e| panic!("{e}"));
    match (ranks.is_alone(), analysis) {
        (true, Analysis::Plane(parts)) => Some(bits(&parts.1)),
        (true, Analysis::Solid(parts)) => Some(bits(&parts.1)),
        (false, Analysis::Plane(parts)) => parts.1.gather().map(|points| bits(&points)),
        (false, Analysis::Solid(parts)) => parts.1.gather().map(|points| bits(&points)),
    }
}

/// Ranks that each fill a part of the bodies generate the same points, to the last bit, as one rank that fills all.
#[test]
fn points_are_formed_as_on_one_rank() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut decks: Vec<PathBuf> = ["inputs", "inputs/new", "inputs/cone", "tests/decks/build"]
        .into_iter()
        .flat_map(|folder| root.join(folder).read_dir().unwrap_or_else(|e| panic!("{e}")))
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "yaml"))
        .filter(|path| {
            path.starts_with(root.join("inputs")) || path.to_string_lossy().ends_with(".good.yaml")
        })
        // Contact between bodies is refused on several ranks.
        .filter(|path| !std::fs::read_to_string(path).is_ok_and(|text| text.contains("\ncontacts:")))
        .collect();
    decks.sort();
    assert!(decks.len() > 30, "{}", decks.len());
    // Every third deck represents the others.
    for deck in decks.into_iter().step_by(if is_long() { 1 } else { 3 }) {
        let alone = formed(&deck, &Ranks::default());
        let together = threads::run(3, |ranks| formed(&deck, &ranks));
        assert!(together[0] == alone, "{}", deck.display());
    }
}

#[test]
fn plane_decks_agree() {
    let decks = ["beam.yaml", "footing.yaml", "shear.yaml", "collapse.yaml", "annulus.yaml", "arch.yaml"];
    for deck in first(2, &decks) {
        agree(deck, &[], 3, first(2, &[2, 3, 4]));
    }
    let decks = ["cone/revolved.yaml", "compaction.yaml", "twist.yaml", "slope.yaml", "bearing.yaml"];
    for deck in first(2, &decks) {
        agree(deck, &[], 2, &[3]);
    }
}

#[test]
fn solid_decks_agree() {
    agree("block/block.yaml", &[("h", "0.5")], 2, first(2, &[2, 3, 4]));
    agree("block/block.yaml", &[("n", "1")], 1, &[2]);
    agree("cone/solid.yaml", &[], 1, &[2]);
}

#[test]
fn decks_with_surfaces_and_stages_agree() {
    let decks =
        ["footing_stages.yaml", "triaxial.yaml", "excavation.yaml", "new/footing.yaml", "new/shear.yaml"];
    for deck in first(2, &decks) {
        agree(deck, &[], 3, &[2, 3]);
    }
}

/// A block between a weak roller and a pressure, stretched until the domains at both are cut.
const STRETCHED: &str = "
version: 1
grid: {type: structured, origin: [0, -0.5], size: [2.5, 2.5], spacing: 0.25}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, shape: {type: box, min: [0, 0], max: [1, 1]}, method: cpdi2, points_per_cell: 2, split_above: 0.7}
surfaces:
  - {name: base, body: b, part: {edge: 0}}
  - {name: side, body: b, part: {edge: 1}}
  - {name: top, body: b, part: {edge: 2}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: roller, surface: base, fix: normal}
  - {name: pull, surface: side, ux: \"0.7+0.1*Y\"}
loads: [{name: p, type: pressure, surface: top, pressure: 150}]
steps: {count: 8}
";

#[test]
fn divided_surfaces_agree() {
    let directory = tempfile::tempdir().unwrap();
    let deck = directory.path().join("stretched.yaml");
    std::fs::write(&deck, STRETCHED).unwrap();
    agree(deck.to_str().unwrap(), &[], 8, &[2, 3]);
}

#[test]
fn decks_with_tools_agree() {
    // Steps as large as those of the deck fail, and round-off decides after how many iterations.
    agree("pipe.yaml", &[("steps", "80")], 3, &[2, 3]);
    agree("cone.yaml", &[], 3, &[2, 3]);
    agree("plough.yaml", &[], 2, &[2, 4]);
}
