//! Decks as files, and the program's messages about them: paths that cannot be read or written, decks that are too
//! large, messages as JSON, warnings as errors.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "what was measured belongs to the test")]

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Instant;

use crate::harness::{ALLOCATOR, alone};
use cpu_time::ProcessTime;
use mpm::deck::load::{LoadFailure, load, load_text};
use mpm::deck::ready::ready;
use mpm::memory::{Bound, Memory};
use serde_json::Value;

fn refusal(path: &Path) -> Box<LoadFailure> {
    let failure = load(path, &[]).unwrap_err();
    assert_eq!(failure.diagnostics.len(), 1, "{failure}");
    assert_eq!(failure.diagnostics[0].code, "D001");
    failure
}

#[test]
fn paths_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        |path: &Path| refusal(path).render(false).replace(&folder.path().display().to_string(), "FOLDER");
    fs::write(folder.path().join("column.yaml"), "version: 1\n").unwrap();
    let misspelt = text(&folder.path().join("colunm.yaml"));
    assert_eq!(
        misspelt,
        "error[D001]: the deck cannot be read: there is no such file\n--> FOLDER/colunm.yaml\n \
         = help: did you mean `FOLDER/column.yaml`?\n"
    );
    let directory = text(folder.path());
    assert_eq!(
        directory,
        "error[D001]: the deck cannot be read: it is a directory, not a file\n--> FOLDER\n = help: give the path of a YAML file\n"
    );
    let below_a_file = text(&folder.path().join("column.yaml/deck.yaml"));
    assert!(below_a_file.starts_with("error[D001]: the deck cannot be read: "), "{below_a_file}");
}

#[test]
#[cfg(unix)]
fn a_file_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("secret.yaml");
    fs::write(&path, "version: 1\n").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    if fs::read(&path).is_ok() {
        println!("skipped: this user may read everything");
        return;
    }
    let text = refusal(&path).render(false);
    assert!(text.contains("permission is denied") && text.contains("help: change the permissions"), "{text}");
}

#[test]
fn a_deck_of_a_hundred_megabytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.yaml");
    let mut file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
    let line = "# nothing but comments, one after the other, until the file has a hundred megabytes\n";
    for _ in 0..100_000_000 / line.len() {
        file.write_all(line.as_bytes()).unwrap();
    }
    drop(file);
    let before = Instant::now();
    let text = refusal(&path).render(false);
    println!("refused in {:.2} s", before.elapsed().as_secs_f64());
    assert!(text.contains("the deck is larger than 64 MiB"), "{text}");
    assert!(text.contains("help: put bulky data into a mesh file"), "{text}");
}

/// 70 × 70 points in each of 100 × 100 cells.
const LARGE: &str = "
version: 1
grid: {type: structured, origin: [0, 0], size: [100, 100], spacing: 1}
materials: {m: {model: hencky, young: 1, poisson: 0}}
bodies: [{name: block, material: m, shape: {type: box, min: [0, 0], max: [100, 100]}, points_per_cell: 70}]
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: push, type: body-force, force: [1, 0]}]
steps: {count: 1}
";

#[test]
fn a_deck_too_large_for_memory_is_refused_before_any_of_it_is_taken() {
    let memory = Memory { limit: 23 << 30, available: 23 << 30, bound: Bound::Machine };
    let loaded = load_text("large.yaml", LARGE.as_bytes(), &[]).unwrap();
    let _alone = alone();
    let before = ALLOCATOR.allocated();
    // Other tests of this program may run at the same time and take some memory.
    ALLOCATOR.set_limit(before + (1 << 30)).unwrap();
    let began = Instant::now();
    let found = ready(&loaded, Some(memory)).unwrap_err();
    println!("refused in {:.6} s", began.elapsed().as_secs_f64());
    ALLOCATOR.set_limit(usize::MAX).unwrap();
    assert_eq!(found.len(), 1);
    let text = found[0].render(&loaded.source, false);
    assert!(
        text.starts_with("error[D036]: the analysis needs about 75 GiB of memory; this machine has 23 GiB"),
        "{text}"
    );
    assert!(text.contains("large.yaml:5:"), "{text}");
}

fn mpm(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mpm")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn messages_are_written_as_json() {
    let deck = "tests/decks/ranges.yaml";
    let output = mpm(&["check", deck, "--format", "json"]);
    assert_eq!(output.status.code(), Some(2));
    let report = json(&output);
    assert_eq!((&report["version"], &report["usable"]), (&Value::from(1), &Value::from(false)));
    assert_eq!((&report["errors"], &report["size"]), (&Value::from(6), &Value::Null));
    let found = &report["diagnostics"][1];
    let expected = serde_json::json!({
        "code": "D009",
        "title": "a number outside its range",
        "severity": "error",
        "gate": "shape",
        "file": deck,
        "line": 6,
        "column": 45,
        "end": {"line": 6, "column": 48},
        "path": "/materials/steel/poisson",
        "message": "0.7 is not below 0.5",
        "label": null,
        "expected": "above -1 and below 0.5",
        "notes": [],
        "help": "must be above -1 and below 0.5 (Poisson's ratio ν, [-])",
    });
    assert_eq!(*found, expected);
    for (deck, expected) in [
        (
            "unknown_key.yaml",
            "one of the keys `model`, `young`, `poisson`, `density`, `porosity`, `drainage` or `undrained_poisson`",
        ),
        ("missing_keys.yaml", "the key `version`"),
        ("wrong_types.yaml", "a number"),
        (
            "unknown_model.yaml",
            "`hencky`, `neo-hookean`, `von-mises`, `tresca`, `mohr-coulomb`, `drucker-prager`, `modified-cam-clay` or \
             `library`",
        ),
        ("load_curve_pair.yaml", "2 entries, [time, factor]"),
        ("grid_in_three_dimensions.yaml", "2 entries, one per axis"),
    ] {
        let output = mpm(&["check", &format!("tests/decks/{deck}"), "--format", "json"]);
        assert_eq!(json(&output)["diagnostics"][0]["expected"], expected, "{deck}");
    }
}

#[test]
fn a_valid_deck_has_its_size_in_the_json() {
    let output = mpm(&["check", "inputs/beam.yaml", "--format", "json"]);
    assert!(output.status.success());
    let report = json(&output);
    assert_eq!(report["diagnostics"], serde_json::json!([]));
    assert_eq!(report["usable"], true);
    let mut found = report["size"].clone();
    let memory = found.as_object_mut().unwrap().shift_remove("memory_bytes").unwrap().as_f64().unwrap();
    assert!((2e7..3e7).contains(&memory), "{memory}");
    let size = serde_json::json!({
        "bodies": 1, "points": 1440, "cells": 440, "active_nodes": 63, "unknowns": 122, "steps": 50
    });
    assert_eq!(found, size);
}

/// A block under its weight, in cells of size `cell` with `points` points along each axis.
fn block(method: &str, cell: f64, points: u32, every: u32) -> String {
    format!(
        "version: 1
grid: {{type: structured, origin: [0, 0], size: [10, 10], spacing: {cell}}}
materials: {{clay: {{model: von-mises, young: 1e8, poisson: 0.3, deviatoric_yield_stress: 1e9, density: 1000}}}}
bodies:
  - {{name: block, material: clay, shape: {{type: box, min: [0, 0], max: [8, 8]}},
     method: {method}, points_per_cell: {points}, strain: standard}}
boundary_conditions:
  - {{name: symmetry, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -1]}}]
steps: {{count: 2}}
solver: {{tolerance: 1e-6}}
output: {{every: {every}}}
"
    )
}

/// The prediction must warn of analyses that do not fit: it may be too high by half, or too low by a fifth.
#[test]
#[cfg(target_os = "linux")]
fn the_predicted_memory_is_what_a_run_takes() {
    let folder = tempfile::tempdir().unwrap();
    let deck = folder.path().join("block.yaml");
    let out = folder.path().join("out");
    for (method, cell, points, every) in [
        ("mpm", 1.0, 40, 0),
        ("gimp", 1.0, 40, 1),
        ("mpm", 0.0625, 2, 0),
        ("gimp", 0.125, 3, 0),
        ("cpdi2", 0.125, 3, 1),
    ] {
        fs::write(&deck, block(method, cell, points, every)).unwrap();
        check_prediction(&deck, &out, &[]);
    }
    // An unsymmetric stiffness.
    fs::write(&deck, block("gimp", 0.125, 3, 0).replace("strain: standard", "strain: f-bar")).unwrap();
    check_prediction(&deck, &out, &[]);
    let in_space = Path::new("inputs/block/block.yaml");
    for set in [
        ["method=mpm", "h=1", "n=16", "every=1", "steps=2"],
        ["method=mpm", "h=0.25", "n=2", "every=0", "steps=2"],
        ["method=gimp", "h=0.25", "n=2", "every=0", "steps=2"],
    ] {
        check_prediction(in_space, &out, &set);
    }
}

/// Compares the memory predicted for a deck with the memory that its run takes.
#[cfg(target_os = "linux")]
fn check_prediction(deck: &Path, out: &Path, set: &[&str]) {
    let deck = deck.to_str().unwrap();
    let set: Vec<&str> = set.iter().flat_map(|value| ["--set", value]).collect();
    let report = json(&mpm(&[&["check", deck, "--format", "json"][..], &set].concat()));
    let predicted = report["size"]["memory_bytes"].as_f64().unwrap();
    let run = mpm(&[&["run", deck, "--threads", "2", "--out", out.to_str().unwrap()][..], &set].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let summary: Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    let taken = summary["peak_memory_bytes"].as_f64().unwrap();
    let size = &report["size"];
    println!(
        "{} points, {} unknowns, {set:?}: {:.0} MB predicted, {:.0} MB taken",
        size["points"],
        size["unknowns"],
        predicted / 1e6,
        taken / 1e6
    );
    assert!((0.8..1.5).contains(&(predicted / taken)), "{deck} {set:?}: {predicted:e} {taken:e}");
}

#[test]
fn warnings_can_be_made_errors() {
    let deck = "tests/decks/tolerance_loose.note.yaml";
    let allowed = mpm(&["check", deck]);
    assert_eq!(allowed.status.code(), Some(0));
    let text = String::from_utf8_lossy(&allowed.stderr).into_owned();
    assert!(text.starts_with("warning[D045]") && text.ends_with(&format!("{deck}: 1 warning\n")), "{text}");
    for flag in ["--deny-warnings", "--warnings-as-errors"] {
        let denied = mpm(&["check", deck, flag]);
        assert_eq!(denied.status.code(), Some(2));
        let text = String::from_utf8_lossy(&denied.stderr).into_owned();
        assert!(text.starts_with("error[D045]") && text.contains("treated as an error"), "{text}");
    }
    let report = json(&mpm(&["check", deck, "--deny-warnings", "--format", "json"]));
    assert_eq!((&report["usable"], &report["errors"]), (&Value::from(false), &Value::from(1)));
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = mpm(&["run", deck, "--deny-warnings", "--out", out.to_str().unwrap()]);
    assert_eq!(run.status.code(), Some(2));
    assert!(!out.exists(), "nothing is written for a deck that is refused");
}

#[test]
fn a_run_writes_its_messages_as_json_too() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let deck = "tests/decks/tolerance_loose.note.yaml";
    let run = mpm(&["run", deck, "--format", "json", "--out", out.to_str().unwrap()]);
    assert!(run.status.success());
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!((&report["usable"], &report["warnings"]), (&Value::from(true), &Value::from(1)));
    assert!(out.join("summary.json").exists());
}

#[test]
fn results_that_cannot_be_written_are_a_usage_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    for out in [file.clone(), file.join("out")] {
        let run = mpm(&["run", "inputs/beam.yaml", "--out", out.to_str().unwrap()]);
        let text = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{text}");
        let (out, file) = (out.display(), file.display());
        let expected = format!("the results directory `{out}` cannot be created: `{file}` is a file");
        assert!(text.contains(&expected) && !text.contains("panicked"), "{text}");
    }
}

/// Decks of about this many lines, by their main content.
fn long_decks(lines: usize) -> Vec<(&'static str, String)> {
    let deck = |grid: usize, bodies: &str, conditions: &str, loads: &str, probes: &str| {
        format!(
            "version: 1
grid: {{type: structured, origin: [0, 0], size: [100, {grid}], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.2, density: 1000}}}}
bodies:
{bodies}boundary_conditions:
  - {{name: base, nodes: {{x: 0}}, fix: [x, y]}}
{conditions}loads:
  - {{name: weight, type: gravity, acceleration: [0, -9.81]}}
{loads}steps: {{count: 10}}
output:
  probes:
{probes}"
        )
    };
    let block =
        "  - {name: b, material: m, shape: {type: box, min: [0, 0], max: [20, 20]}, points_per_cell: 2}\n";
    let probe = "    - {name: p, body: b0, nearest: [0, 0]}\n";
    let with_b = |text: &str| text.replace("body: b0", "body: b");
    let each = |line: &dyn Fn(usize) -> String| (0..lines).map(line).collect::<String>();
    let boxes = each(&|k| {
        format!(
            "  - {{name: b{k}, material: m, shape: {{type: box, min: [0, {k}], max: [1, {}]}}, points_per_cell: 2}}\n",
            k + 1
        )
    });
    let circles = each(&|k| {
        format!(
            "  - {{name: b{k}, material: m, shape: {{type: circle, center: [1, {}.5], radius: 0.5}}, points_per_cell: 4}}\n",
            k
        )
    });
    let conditions = each(&|k| format!("  - {{name: c{k}, nodes: {{x: 1, y: {}}}, fix: [x]}}\n", k % 20));
    let loads = each(&|k| {
        format!(
            "  - {{name: l{k}, type: point-force, body: b, points: {{nearest: [{}.1, {}.1]}}, total: [1, 0]}}\n",
            k % 20,
            k / 20 % 20
        )
    });
    let probes =
        each(&|k| format!("    - {{name: p{k}, body: b, nearest: [{}.1, {}.1]}}\n", k % 20, k / 20 % 20));
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / lines as f64;
    let corners = each(&|k| {
        format!("      - [{:.9}, {:.9}]\n", 10.0 + 9.0 * angle(k).cos(), 10.0 + 9.0 * angle(k).sin())
    });
    let polygon = format!(
        "  - name: b\n    material: m\n    points_per_cell: 2\n    shape:\n      type: polygon\n      vertices:\n{corners}"
    );
    let pairs = each(&|k| format!("      - [{}, {}]\n", k as f64 / (lines - 1) as f64, k % 7));
    let curve = format!("  - name: side\n    nodes: {{x: 20}}\n    ux: 0.1\n    curve:\n{pairs}");
    let comments = each(&|k| format!("# {k}\n"));
    let wrong = each(&|k| format!("  - {{nam: c{k}, nodes: {{x: 1}}, fix: [z]}}\n"));
    vec![
        ("boxes", deck(lines, &boxes, "", "", probe)),
        ("circles", deck(lines + 1, &circles, "", "", probe)),
        ("boundary conditions", deck(20, block, &conditions, "", &with_b(probe))),
        ("point forces", deck(20, block, "", &loads, &with_b(probe))),
        ("probes", deck(20, block, "", "", &probes)),
        ("corners of a polygon", deck(20, &polygon, "", "", &with_b(probe))),
        ("pairs of a load curve", deck(20, block, &curve, "", &with_b(probe))),
        ("comments", comments + &deck(20, block, "", "", &with_b(probe))),
        ("errors", deck(20, block, &wrong, "", &with_b(probe))),
    ]
}

/// The steps of `mpm check` for long decks; the processor time is printed.
#[test]
fn decks_of_ten_thousand_lines_are_checked() {
    for lines in [1000, 10_000] {
        for (name, text) in long_decks(lines) {
            let start = ProcessTime::now();
            let loaded = load_text("long.yaml", text.as_bytes(), &[]);
            let read = start.elapsed();
            let (mut built, mut found) = (read, 0);
            match loaded {
                Ok(loaded) => {
                    let ready = ready(&loaded, Memory::this_machine());
                    built = start.elapsed();
                    found += ready.map_or_else(|found| found.len(), |ready| ready.notes.len());
                }
                Err(failure) => {
                    assert!(!failure.render(false).is_empty());
                    found += failure.diagnostics.len();
                }
            }
            println!(
                "{:>6} lines, most of them {name}: {:.3} s, {:.3} s of it to read the deck and {:.3} s to build the \
                 model; {found} messages",
                text.lines().count(),
                start.elapsed().as_secs_f64(),
                read.as_secs_f64(),
                (built - read).as_secs_f64(),
            );
        }
    }
}
