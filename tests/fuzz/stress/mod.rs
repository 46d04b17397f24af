//! Random valid analyses with large steps: each ends in equilibrium at full load with its balances satisfied, or stops
//! with exit code 1 and a diagnosis, with all written steps in equilibrium. None ends in any other way.
//!
//! `STRESS=200 cargo test --release --test fuzz stress -- --ignored --nocapture` runs that many decks four times each:
//! with and without cutting of steps, with and without stabilisation. `STRESS_DECKS=DIRECTORY` keeps them.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

mod decks;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use decks::deck;

/// No analysis may take longer; all are small.
const MAX_TIME: Duration = Duration::from_secs(300);

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq)]
enum Outcome {
    Completed { failed_attempts: u64 },
    Stopped { kind: String },
}

/// Runs a deck with the program; an error if it ends in an invalid way.
fn run(text: &str, folder: &Path) -> Result<Outcome, String> {
    let (deck, out) = (folder.join("deck.yaml"), folder.join("out"));
    std::fs::write(&deck, text).unwrap();
    let _ = std::fs::remove_dir_all(&out);
    let mut child = Command::new(env!("CARGO_BIN_EXE_mpm"))
        .args(["run", deck.to_str().unwrap(), "--out", out.to_str().unwrap(), "--threads", "1"])
        .stdout(std::process::Stdio::null())
        .stderr(std::fs::File::create(folder.join("stderr")).unwrap())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > MAX_TIME {
            child.kill().unwrap();
            child.wait().unwrap();
            return Err("takes too long".to_owned());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let errors = std::fs::read_to_string(folder.join("stderr")).unwrap();
    if errors.contains("panicked") {
        return Err(format!("panics: {errors}"));
    }
    let summary =
        std::fs::read_to_string(out.join("summary.json")).map_err(|_| format!("{status}: {errors}"))?;
    let summary: Value = serde_json::from_str(&summary).unwrap();
    written_steps_are_in_equilibrium(&out)?;
    match (status.code(), summary["outcome"].as_str()) {
        (Some(0), Some("completed")) => {
            in_order(&out, &summary)?;
            Ok(Outcome::Completed { failed_attempts: summary["failed_attempts"].as_u64().unwrap() })
        }
        (Some(1), Some("failed")) => {
            let kind = summary["diagnosis"]["kind"].as_str();
            let advice = summary["diagnosis"]["advice"].as_str().is_some_and(|advice| !advice.is_empty());
            match kind {
                Some(kind) if advice && errors.contains("diagnosis: ") => {
                    Ok(Outcome::Stopped { kind: kind.to_owned() })
                }
                _ => Err(format!("stops without a diagnosis: {errors}")),
            }
        }
        (code, outcome) => Err(format!("exit code {code:?} with the outcome {outcome:?}: {errors}")),
    }
}

/// Every row of a converged step meets the tolerance of the deck, 1e-8.
fn written_steps_are_in_equilibrium(out: &Path) -> Result<(), String> {
    let table = std::fs::read_to_string(out.join("history.csv")).unwrap();
    let mut lines = table.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let (residual, converged) = (place("residual"), place("converged"));
    for line in lines {
        let entries: Vec<&str> = line.split(',').collect();
        let value: f64 = entries[residual].parse().unwrap_or(f64::INFINITY);
        if entries[converged] == "1" && value > 1e-8 {
            return Err(format!("a step is written with the residual {value:e}"));
        }
    }
    Ok(())
}

/// A completed run has reached its end time. Loads and reactions balance to the extent that the basis functions add up
/// to one; masses do not change.
fn in_order(out: &Path, summary: &Value) -> Result<(), String> {
    let status = std::fs::read_to_string(out.join("status.json")).unwrap();
    let status: Value = serde_json::from_str(&status).unwrap();
    let [time, end] = ["time", "end_time"].map(|key| status[key].as_f64().unwrap_or(f64::NAN));
    let reached = (time - end).abs() <= 1e-12 * end;
    if !reached {
        return Err(format!("the run ends at {time} instead of {end}"));
    }
    let number = |pointer: &str| summary.pointer(pointer).and_then(Value::as_f64);
    let loss = number("/quality/partition_of_unity_loss/value").unwrap_or(0.0);
    let outside = number("/quality/domain_outside_grid/value").unwrap_or(0.0);
    let difference = number("/forces/relative_difference").unwrap_or(0.0);
    // Forces on domains beyond the grid are lost.
    if difference > 1e-6 + 10.0 * loss + outside {
        return Err(format!(
            "loads and reactions differ by {difference:e}, the loss of unity is {loss:e}, {outside:e} of a domain is outside"
        ));
    }
    let change = number("/quality/mass/relative_change").unwrap_or(0.0);
    if change.abs() > 1e-12 {
        return Err(format!("the mass changes by {change:e}"));
    }
    Ok(())
}

/// Runs decks, beginning with a seed, in several ways, `(stabilised, cut)`; prints the shares that complete.
fn stress(count: usize, first: u64, ways: &[(bool, bool)]) {
    let folder = tempfile::tempdir().unwrap();
    let (mut faults, mut counts, mut kinds) = (Vec::new(), BTreeMap::new(), BTreeMap::new());
    let (mut seed, mut tried) = (first, 0);
    let began = Instant::now();
    while tried < count {
        seed += 1;
        let is_valid = {
            let path = folder.path().join("deck.yaml");
            std::fs::write(&path, deck(seed, true, true)).unwrap();
            let check =
                Command::new(env!("CARGO_BIN_EXE_mpm")).args(["check", path.to_str().unwrap()]).output();
            check.unwrap().status.success()
        };
        if !is_valid {
            continue;
        }
        tried += 1;
        for &(stabilised, cut) in ways {
            let text = deck(seed, stabilised, cut);
            if let Some(keep) = std::env::var_os("STRESS_DECKS") {
                let name = format!("{seed:04}_{}_{}.yaml", u8::from(stabilised), u8::from(cut));
                std::fs::create_dir_all(&keep).unwrap();
                std::fs::write(Path::new(&keep).join(name), &text).unwrap();
            }
            match run(&text, folder.path()) {
                Ok(Outcome::Completed { failed_attempts }) => {
                    let entry: &mut [usize; 2] = counts.entry((stabilised, cut)).or_default();
                    entry[0] += 1;
                    entry[1] += usize::from(failed_attempts > 0);
                }
                Ok(Outcome::Stopped { kind }) => *kinds.entry((stabilised, cut, kind)).or_insert(0) += 1,
                Err(fault) => {
                    faults.push(format!("seed {seed}, stabilised {stabilised}, cut {cut}: {fault}"))
                }
            }
        }
    }
    println!(
        "{tried} valid decks from seed {first} to {seed}, {:.0} s of the clock",
        began.elapsed().as_secs_f64()
    );
    for ((stabilised, cut), [completed, smaller]) in &counts {
        println!(
            "stabilised {stabilised}, cut {cut}: {completed} complete, {smaller} of them with smaller steps"
        );
    }
    for ((stabilised, cut, kind), number) in &kinds {
        println!("stabilised {stabilised}, cut {cut}: {number} stop, {kind}");
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn random_analyses_end_as_they_may() {
    stress(6, 1000, &[(true, true)]);
}

#[test]
#[ignore = "minutes"]
fn many_random_analyses_end_as_they_may() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let ways = [(true, true), (true, false), (false, true), (false, false)];
    stress(number("STRESS").unwrap_or(200) as usize, number("STRESS_SEED").unwrap_or(0), &ways);
}
