//! Random decks, made from the schema and from decks in `inputs` and `tests/decks`, pass through all stages: reading,
//! the three gates, and for small ones the first load step. None may cause a panic, take more than ten seconds of
//! processor time or far more memory than was predicted, and every refusal must have an error with a location.
//!
//! The usual tests run a few hundred cases.
//! `FUZZ_SECONDS=600 cargo test --release --test fuzz decks -- --ignored --nocapture`
//! runs for that much processor time; `FUZZ_SEED` sets the first case (a number; the default depends on the time). The
//! current case is kept in `target/tmp/fuzz/`, in case it ends the program.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

mod generate;
mod mutate;
mod write;

use std::path::PathBuf;
use std::time::Duration;

use mpm::deck::diagnostic::{CODES, Diagnostic, Gate, as_json};
use mpm::deck::load::load_text;
use mpm::deck::ready::{Analysis, ready};
use mpm::deck::schema::{Validator, deck_schema, strict_schema};
use mpm::deck::source::Source;
use mpm::memory::{Bound, Memory};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Observer, Reached, SolveError, StepReport};
use serde_json::Value;

use crate::harness::{Bench, fuzz, fuzz_for_long};
use crate::long::share;
use crate::random::Random;
use generate::Generator;

/// The memory that decks may need.
const MEMORY: Memory = Memory { limit: 128 << 20, available: 128 << 20, bound: Bound::Machine };
/// Largest analysis whose first step is solved.
const MAX_POINTS: usize = 3000;
const MAX_UNKNOWNS: usize = 3000;

/// Ends a run after its first step.
struct OneStep {
    done: bool,
}

impl<const D: usize> Observer<D> for OneStep {
    fn converged(
        &mut self,
        _: &Model<D>,
        _: &Points<D>,
        _: &StepReport<D>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.done = true;
        Ok(())
    }

    fn interrupted(&self) -> bool {
        self.done
    }
}

/// The sources of cases.
struct Decks {
    seeds: Vec<Value>,
    generator: Generator,
    published: Validator,
}

impl Decks {
    fn new() -> Decks {
        let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
        let mut paths: Vec<PathBuf> = ["inputs", "inputs/block", "tests/decks", "tests/decks/build"]
            .iter()
            .flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap())
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "yaml"))
            .collect();
        paths.sort();
        let seeds: Vec<Value> = paths
            .iter()
            .filter_map(|path| Source::read("seed", &std::fs::read(path).unwrap()).1)
            .filter(Value::is_object)
            .collect();
        assert!(seeds.len() > 100);
        let published = Validator::new(&deck_schema()).unwrap();
        Decks { seeds, generator: Generator::new(strict_schema().clone()), published }
    }

    /// Checks the messages.
    fn examine(&self, source: &Source, found: &[Diagnostic], refused: bool) {
        assert_eq!(found.iter().any(Diagnostic::is_error), refused, "{found:?}");
        for (number, diagnostic) in found.iter().enumerate() {
            assert!(CODES.iter().any(|(code, _)| *code == diagnostic.code));
            assert!(
                !diagnostic.message.starts_with("the deck cannot be read: "),
                "the schema accepts what the types refuse: {diagnostic:?}"
            );
            // The program shows a hundred at most.
            assert!(number >= 100 || !diagnostic.render(source, true).is_empty());
            if let Some(span) = diagnostic.span {
                assert!(span.start <= span.end && span.start <= source.text().len(), "{diagnostic:?}");
            } else {
                let placeless = ["D001", "D013"];
                assert!(placeless.contains(&diagnostic.code), "no place: {diagnostic:?}");
            }
        }
        assert!(as_json(source, found).to_string().len() > 10);
    }
}

impl Bench for Decks {
    const ENDING: &'static str = "yaml";

    fn case(&self, seed: u64) -> Vec<u8> {
        let mut random = Random::new(seed);
        let mut deck = if random.chance(0.15) {
            self.generator.deck(&mut random)
        } else {
            // Decks that run are more useful than others.
            let range = if random.chance(0.5) { 5.min(self.seeds.len()) } else { self.seeds.len() };
            self.seeds[random.below(range)].clone()
        };
        for _ in 0..random.below(2) + random.below(3) {
            mutate::change(&mut deck, &self.generator, &mut random);
        }
        let mut text = write::yaml(&deck, &mut random).into_bytes();
        if random.chance(0.12) {
            mutate::damage(&mut text, &mut random);
        }
        text
    }

    fn run(&self, text: &[u8]) -> String {
        // Paths of meshes are relative to this path.
        let name = "tests/decks/build/fuzz.yaml";
        let (source, value, _) = Source::read(name, text);
        let loaded = load_text(name, text, &[]);
        let (failure, found) = match &loaded {
            Ok(loaded) => (None, &loaded.notes),
            Err(failure) => (Some(failure), &failure.diagnostics),
        };
        self.examine(&source, found, failure.is_some());
        if let Some(value) = value.filter(|_| !String::from_utf8_lossy(text).contains("${")) {
            let is_shapely = |d: &Diagnostic| d.gate != Gate::Shape && d.code != "D005";
            let accepted = self.published.accepts(&value);
            let shape = found.iter().all(is_shapely);
            assert_eq!(accepted, shape, "the schema and the program disagree about the shape: {found:?}");
        }
        let loaded = match loaded {
            Ok(loaded) => loaded,
            Err(failure) => {
                let gate = failure.diagnostics.iter().filter(|d| d.is_error()).map(|d| d.gate).min();
                return format!("1 refused: {}", gate.unwrap().name());
            }
        };
        let mut ready = match ready(&loaded, Some(MEMORY)) {
            Ok(ready) => ready,
            Err(found) => {
                self.examine(&loaded.source, &found, true);
                return "1 refused: feasibility".into();
            }
        };
        self.examine(&loaded.source, &ready.notes, false);
        if ready.extent.points > MAX_POINTS || ready.extent.first.unknowns > MAX_UNKNOWNS {
            return "2 accepted, too large to solve here".into();
        }
        let (newton, stepping) = match &mut ready.analysis {
            Analysis::Plane(parts) => (&mut parts.0.newton, &mut parts.0.stepping),
            Analysis::Solid(parts) => (&mut parts.0.newton, &mut parts.0.stepping),
        };
        newton.max_iterations = newton.max_iterations.min(8);
        stepping.smallest = 1.0;
        let nothing = ready.analysis.beginning();
        match ready.analysis.run(nothing, &mut OneStep { done: false }) {
            Ok(_) | Err(SolveError::Interrupted { .. }) => "3 accepted, first step solved".into(),
            Err(error) => {
                assert!(!error.to_string().is_empty());
                let kind = format!("{error:?}");
                let kind: String = kind.chars().take_while(|c| c.is_alphanumeric()).collect();
                format!("4 accepted, first step not solved: {kind}")
            }
        }
    }
}

#[test]
fn random_decks_are_survived() {
    fuzz(Decks::new, 1, share(400), Duration::from_secs(60));
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn random_decks_are_survived_for_long() {
    fuzz_for_long(Decks::new);
}
