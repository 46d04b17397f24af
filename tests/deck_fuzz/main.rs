//! Random decks, made from the schema and from the decks of the gallery, through everything that a deck goes through:
//! reading, the three gates, and for small ones the first load step. None may cause a panic, take more than ten seconds
//! of processor time or far more memory than was predicted, and every refusal must have an error with a place.
//!
//! The usual tests run a few hundred cases. `FUZZ_SECONDS=600 cargo test --test deck_fuzz -- --ignored --nocapture`
//! goes on for that much processor time; `FUZZ_SEED` chooses where it begins (a number; the default depends on the
//! time). The case in hand stands in `target/tmp/fuzz/`, for one that ends the program.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

mod generate;
mod mutate;
mod random;
mod write;

use std::alloc::System;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, SystemTime};

use cap::Cap;
use cpu_time::ProcessTime;
use jsonschema::{Draft, Validator};
use mpm::deck::diagnostic::{CODES, Diagnostic, Gate, as_json};
use mpm::deck::load::load_text;
use mpm::deck::ready::{Analysis, ready};
use mpm::deck::schema::{deck_schema, strict_schema};
use mpm::deck::source::Source;
use mpm::memory::{Bound, Memory};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Observer, SolveError, StepReport, Summary};
use serde_json::Value;

use generate::Generator;
use random::Random;

#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// The memory that decks may ask for.
const MEMORY: Memory = Memory { limit: 128 << 20, available: 128 << 20, bound: Bound::Machine };
/// The memory that a case may take, whatever it says: the prediction is an estimate, and reading takes some.
const MOST_MEMORY: usize = 768 << 20;
/// Time that a case may take.
const MOST_TIME: Duration = Duration::from_secs(10);
/// Largest analysis whose first step is solved.
const MOST_POINTS: usize = 3000;
const MOST_UNKNOWNS: usize = 3000;

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
        _: &Summary,
    ) -> std::io::Result<()> {
        self.done = true;
        Ok(())
    }

    fn interrupted(&self) -> bool {
        self.done
    }
}

/// Everything that a case may be made from.
struct Bench {
    seeds: Vec<Value>,
    generator: Generator,
    published: Validator,
}

impl Bench {
    fn new() -> Bench {
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
        let published = jsonschema::options().with_draft(Draft::Draft7).build(&deck_schema()).unwrap();
        Bench { seeds, generator: Generator::new(strict_schema().clone()), published }
    }

    /// The text of the case with this number.
    fn text(&self, seed: u64) -> Vec<u8> {
        let mut random = Random::new(seed);
        let mut deck = if random.chance(0.15) {
            self.generator.deck(&mut random)
        } else {
            // Decks that run are worth more than others.
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

    /// Runs a case; returns how far it came.
    fn run(&self, text: &[u8]) -> String {
        // Meshes are found from there.
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
            let accepted = self.published.is_valid(&value);
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
        if ready.extent.points > MOST_POINTS || ready.extent.first.unknowns > MOST_UNKNOWNS {
            return "2 accepted, too large to solve here".into();
        }
        let newton = match &mut ready.analysis {
            Analysis::Plane(parts) => &mut parts.0.newton,
            Analysis::Solid(parts) => &mut parts.0.newton,
        };
        newton.max_iterations = newton.max_iterations.min(8);
        let nothing = ready.analysis.beginning();
        match ready.analysis.go_on(nothing, &mut OneStep { done: false }) {
            Ok(_) | Err(SolveError::Interrupted { .. }) => "3 accepted, first step solved".into(),
            Err(error) => {
                assert!(!error.to_string().is_empty());
                let kind = format!("{error:?}");
                let kind: String = kind.chars().take_while(|c| c.is_alphanumeric()).collect();
                format!("4 accepted, first step not solved: {kind}")
            }
        }
    }

    /// What must hold for messages.
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

/// Runs cases until the time or the number is used up; returns the counts.
fn fuzz(first: u64, most: u64, time: Duration) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz/{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let current = folder.join("current.yaml");
    let (send, receive) = channel::<Result<(u64, String, Duration, usize), (u64, String)>>();
    let start = ProcessTime::now();
    let (begun, file) = (channel::<u64>(), current.clone());
    let (tell, told) = begun;
    let worker = std::thread::spawn(move || {
        let bench = Bench::new();
        for seed in first..first + most {
            let text = bench.text(seed);
            std::fs::write(&file, &text).unwrap();
            if tell.send(seed).is_err() {
                return;
            }
            let before = ALLOCATOR.allocated();
            ALLOCATOR.set_limit(before + MOST_MEMORY).unwrap();
            let began = ProcessTime::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| bench.run(&text)));
            let took = began.elapsed();
            ALLOCATOR.set_limit(usize::MAX).unwrap();
            let report = match outcome {
                Ok(outcome) => Ok((seed, outcome, took, text.len())),
                Err(panic) => {
                    let words = panic.downcast_ref::<String>().cloned();
                    Err((
                        seed,
                        words.or(panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default(),
                    ))
                }
            };
            if send.send(report).is_err() || start.elapsed() > time {
                return;
            }
        }
    });
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let (mut total, mut longest, mut faults) = (0, (Duration::ZERO, 0), Vec::new());
    while let Ok(seed) = told.recv() {
        // Processor time: the machine may have other things to do.
        let began = ProcessTime::now();
        let report = loop {
            match receive.recv_timeout(Duration::from_millis(500)) {
                Err(RecvTimeoutError::Timeout) if began.elapsed() < MOST_TIME => {}
                report => break report,
            }
        };
        match report {
            Ok(Ok((seed, outcome, took, _))) => {
                total += 1;
                *counts.entry(outcome).or_default() += 1;
                longest = longest.max((took, seed));
            }
            Ok(Err((seed, message))) => {
                let kept = folder.join(format!("panic_{seed}.yaml"));
                std::fs::copy(&current, &kept).unwrap();
                faults.push(format!("seed {seed} panics: {message}\n  the deck is {}", kept.display()));
                if faults.len() >= 20 {
                    break;
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                faults.push(format!("seed {seed} takes more than {MOST_TIME:?}: {}", current.display()));
                break;
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    println!("{total} decks from seed {first}, {:.0} s of processor time", start.elapsed().as_secs_f64());
    for (outcome, count) in &counts {
        println!("  {count:>8}  {}", &outcome[2..]);
    }
    println!("  longest: {:.2} s, seed {}", longest.0.as_secs_f64(), longest.1);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    drop(told);
    worker.join().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn random_decks_are_survived() {
    fuzz(1, 400, Duration::from_secs(60));
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn random_decks_are_survived_for_long() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    let seed = number("FUZZ_SEED").unwrap_or(now.as_secs() * 1_000_000);
    fuzz(seed, u64::MAX / 2, Duration::from_secs(number("FUZZ_SECONDS").unwrap_or(600)));
}
