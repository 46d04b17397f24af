//! Results do not depend on the number of threads, to the last bit.
#![allow(clippy::unwrap_used)]

use std::convert::Infallible;
use std::path::Path;

use mpm::deck::build::build;
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::load::{LoadedDeck, load};
use mpm::model::Model;
use mpm::points::{Points, StoredField};
use mpm::solver::{self, Observer, Reached, Solvable, StepReport};

/// Complete result of a run, as bits.
#[derive(Default)]
struct Bits {
    residuals: Vec<u64>,
    reactions: Vec<u64>,
    states: Vec<Vec<u64>>,
}

fn bits(values: impl IntoIterator<Item = f64>) -> Vec<u64> {
    values.into_iter().map(f64::to_bits).collect()
}

/// All fields of the converged state.
fn bits_of<const D: usize>(points: &Points<D>) -> Vec<u64> {
    let mut all = Vec::new();
    let visit = |_: &StoredField, values: &mut dyn Iterator<Item = f64>| {
        all.extend(values.map(f64::to_bits));
        Ok::<_, Infallible>(())
    };
    points.for_each_field(visit).unwrap();
    all
}

impl<const D: usize> Observer<D> for Bits {
    fn converged(
        &mut self,
        _: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.residuals.extend(bits(report.residuals.iter().copied()));
        self.reactions.extend(bits(report.reactions.iter().flatten().copied()));
        self.states.push(bits_of(points));
        Ok(())
    }
}

type Build<const D: usize> = fn(&LoadedDeck) -> Result<(Model<D>, Points<D>), Vec<Diagnostic>>;

/// Runs the first `steps` load steps of a deck with this number of threads.
fn run<const D: usize>(
    build: Build<D>,
    deck: &str,
    set: &[(&str, &str)],
    steps: usize,
    threads: usize,
) -> Bits
where
    Model<D>: Solvable<D>,
{
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(deck);
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let (mut model, mut points) = build(&load(&path, &set).unwrap()).unwrap();
    model.stepping.end_time *= steps as f64 / model.stepping.count as f64;
    model.stepping.count = steps;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        assert_eq!(rayon::current_num_threads(), threads);
        let mut observer = Bits::default();
        let outcome = solver::run(&model, &mut points, &mut observer);
        outcome.unwrap_or_else(|error| panic!("{error}"));
        observer
    })
}

fn check<const D: usize>(build: Build<D>, deck: &str, set: &[(&str, &str)], steps: usize)
where
    Model<D>: Solvable<D>,
{
    let one = run(build, deck, set, steps, 1);
    assert_eq!(one.states.len(), steps);
    for threads in [2, 3] {
        let more = run(build, deck, set, steps, threads);
        assert!(one.residuals == more.residuals, "{deck} {set:?}: residuals differ with {threads} threads");
        assert!(one.reactions == more.reactions, "{deck} {set:?}: reactions differ with {threads} threads");
        for (step, (a, b)) in one.states.iter().zip(&more.states).enumerate() {
            assert!(a == b, "{deck} {set:?}: points differ in step {} with {threads} threads", step + 1);
        }
    }
}

#[test]
fn cantilever() {
    for method in ["mpm", "gimp"] {
        check(build::<2>, "beam.yaml", &[("method", method), ("h", "0.25"), ("n", "3")], 12);
    }
}

#[test]
fn collapse() {
    for method in ["mpm", "gimp"] {
        check(build::<2>, "collapse.yaml", &[("method", method), ("h", "0.5"), ("n", "3")], 15);
    }
}

#[test]
fn block_in_space() {
    for method in ["mpm", "gimp", "cpdi2"] {
        check(build::<3>, "block/block.yaml", &[("method", method), ("h", "0.5"), ("n", "2")], 2);
    }
}

#[test]
fn cone_of_revolution() {
    check(build::<2>, "cone/revolved.yaml", &[("h", "0.25")], 3);
}
