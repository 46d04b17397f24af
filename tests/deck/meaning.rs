//! The meaning of keys of the deck, tested by runs: displacements of the material, forces per mass, lengths of paths,
//! probes between points; and decks that grow without bound.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the measured numbers belong to the tests")]

use std::time::Instant;

use crate::remedy;
use mpm::deck::build::build;
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::load::{load, load_text};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{self, Reached, Silent, path_length};

fn deck(text: &str) -> (Model<2>, Points<2>) {
    let loaded = load_text("deck", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
    build(&loaded).unwrap_or_else(|found| panic!("{found:?}"))
}

fn run((model, mut points): (Model<2>, Points<2>)) -> (Points<2>, Reached) {
    let reached = solver::run(&model, &mut points, &mut Silent).unwrap();
    (points, reached)
}

fn faults(text: &str) -> Vec<Diagnostic> {
    let found = match load_text("deck", text.as_bytes(), &[]) {
        Ok(loaded) => loaded.notes,
        Err(failure) => failure.diagnostics,
    };
    found.iter().for_each(remedy::has_remedy);
    found
}

const BLOCK: &str = "
version: 1
grid: {type: structured, origin: [-1, -1], size: [6, 6], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1e3, poisson: 0.2, density: 7}}
bodies: [{name: block, material: m, shape: {type: box, min: [0, 0], max: [1, 1]}, METHOD, points_per_cell: 2}]
boundary_conditions: [{name: all, nodes: {outer_layer: block}, DISPLACEMENT}]
steps: {count: COUNT}
";

/// A displacement given as a function of the original position is the displacement of the material, for any number of
/// steps.
#[test]
fn a_stretch_of_the_original_position_does_not_depend_on_the_steps() {
    for method in ["method: mpm", "method: gimp", "method: cpdi2"] {
        for count in ["1", "3", "10"] {
            let text = |motion: &str| {
                BLOCK.replace("METHOD", method).replace("DISPLACEMENT", motion).replace("COUNT", count)
            };
            let (points, _) = run(deck(&text("ux: 0.2*X*factor^2 + 0.1*Y, uy: 0.5*Y")));
            let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
            for p in 0..points.len() {
                let gradient = &points.converged.deformation_gradient[p];
                let exact = [[1.2, 0.1], [0.0, 1.5]];
                for (i, row) in exact.iter().enumerate() {
                    let place: f64 = row.iter().zip(&points.original_position[p]).map(|(f, x)| f * x).sum();
                    moved = moved.max((points.converged.position[p][i] - place).abs());
                    for (j, f) in row.iter().enumerate() {
                        worst = worst.max((gradient[(i, j)] - f).abs());
                    }
                }
            }
            println!("{method}, {count} steps: F off by {worst:.1e}, places by {moved:.1e}");
            assert!(worst < 1e-9 && moved < 1e-9, "{method}, {count} steps: {worst:e}, {moved:e}");
            // With a function of the current position, the stretches of the steps multiply.
            let (points, _) = run(deck(&text("ux: 0, uy: 0.5*y")));
            let steps: f64 = count.parse().unwrap();
            let stretch = points.converged.deformation_gradient[0][(1, 1)];
            assert!((stretch - (1.0 + 0.5 / steps).powf(steps)).abs() < 1e-9, "{stretch}");
        }
    }
}

const COLUMN: &str = "
version: 1
analysis: {idealisation: IDEALISATION}
grid: {type: structured, origin: [0, 0], size: [2, 5], spacing: 1}
materials: {m: {model: hencky, young: 1e4, poisson: 0.2, density: 7}}
bodies: [{name: block, material: m, shape: {type: box, min: [0, 0], max: [2, 4]}, points_per_cell: 2}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: axis, nodes: {box: {min: [0, 0.5], max: [0, 5]}}, fix: [x]}
loads: [LOAD]
steps: {count: 2}
";

/// A force per mass equals gravity to the last bit, although the deformation of the body changes its volume.
#[test]
fn a_force_per_mass_is_a_weight() {
    for idealisation in ["plane-strain", "axisymmetric"] {
        let of = |load: &str| {
            run(deck(&COLUMN.replace("IDEALISATION", idealisation).replace("LOAD", load))).0.converged
        };
        let weight = of("{name: w, type: gravity, acceleration: [0, -9.81]}");
        let per_mass = of("{name: w, type: body-force, per: mass, force: [0, -9.81]}");
        assert_eq!(weight, per_mass, "{idealisation}");
        let formula = of("{name: w, type: body-force, per: mass, force: [0*X, -9.81*factor]}");
        let per_volume = of("{name: w, type: body-force, force: [0, -68.67]}");
        let apart = |a: &[[f64; 2]]| {
            let off = a.iter().zip(&weight.position).flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
            off.fold(0.0, |most: f64, off| most.max(off.abs()))
        };
        let (same, other) = (apart(&formula.position), apart(&per_volume.position));
        println!("{idealisation}: as a formula {same:.1e}, per volume {other:.1e}");
        assert!(same < 1e-14 && other > 1e-5, "the volume shrinks, the mass does not: {same:e}, {other:e}");
    }
}

#[test]
fn a_force_per_mass_needs_a_density() {
    let text = COLUMN.replace("IDEALISATION", "plane-strain").replace(", density: 7", "");
    let found = faults(&text.replace("LOAD", "{name: w, type: body-force, per: mass, force: [0, -1]}"));
    assert!(found.iter().any(|d| d.code == "D024" && d.is_error()), "{found:?}");
    assert_eq!(faults(&text.replace("LOAD", "{name: w, type: body-force, force: [0, -1]}")), []);
}

const CANTILEVER: &str = "
version: 1
grid: {type: structured, origin: [0, -3], size: [6, 5], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1e3, poisson: 0.2}}
bodies: [{name: bar, material: m, shape: {type: box, min: [0, 0], max: [4, 1]}, method: cpdi2, points_per_cell: 2}]
boundary_conditions: [{name: root, nodes: {x: 0}, fix: [x, y]}]
loads: [{name: push, type: body-force, force: [0, -3]}]
steps: {count: COUNT, control: {type: arc-length LENGTH}}
";

/// The cantilever along a path of this length, and the length that it reached.
fn cantilever(count: usize, length: Option<f64>) -> (Points<2>, Reached, f64) {
    let given = length.map_or(String::new(), |length| format!(", length: {length:?}"));
    let text = CANTILEVER.replace("COUNT", &count.to_string()).replace("LENGTH", &given);
    let (points, reached) = run(deck(&text));
    let found = path_length(&points, &reached.progress.path, 1.0).unwrap();
    (points, reached, found)
}

#[test]
fn the_length_of_the_path_can_be_given() {
    let (free, free_reached, length) = cantilever(8, None);
    let (given, given_reached, same) = cantilever(8, Some(length));
    let apart = |a: &Points<2>, b: &Points<2>| {
        let (in_a, in_b) = (a.by_id(), b.by_id());
        let pairs = in_a.iter().zip(&in_b);
        let places = pairs.map(|(&p, &q)| (a.converged.position[p], b.converged.position[q]));
        places.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
    };
    println!("length {length}, given {same}, places off by {:.1e}", apart(&free, &given));
    assert!((same / length - 1.0).abs() < 1e-12 && apart(&free, &given) < 1e-9);
    assert!((given_reached.progress.path.factor / free_reached.progress.path.factor - 1.0).abs() < 1e-9);
    // Twice as many steps of half the length end at the same state; the same number of these steps ends half-way.
    let (fine, fine_reached, _) = cantilever(16, Some(length));
    let (half, half_reached, halved) = cantilever(8, Some(0.5 * length));
    let (far, to_half) = (apart(&fine, &given), apart(&half, &given));
    println!("steps of half the length: places off by {far:.1e}; half of the path: by {to_half:.1e}");
    let steps = [given_reached, fine_reached, half_reached].map(|reached| reached.summary.steps);
    assert_eq!(steps, [8, 16, 8]);
    assert!((halved / length - 0.5).abs() < 1e-12);
    assert!(far < 0.1 * to_half, "{far:e}, {to_half:e}");
}

/// For a rigid translation by u, the length of the path is |u|.
#[test]
fn the_length_of_the_path_is_that_of_a_rigid_motion() {
    let text = "
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 1], spacing: 1}
materials: {stiff: {model: hencky, young: 1e4, poisson: 0}, soft: {model: hencky, young: 1, poisson: 0}}
bodies:
  - {name: spring, material: soft, shape: {type: box, min: [0, 0], max: [1, 1]}, method: mpm, points_per_cell: 2}
  - {name: block, material: stiff, shape: {type: box, min: [1, 0], max: [4, 1]}, method: mpm, points_per_cell: 2}
boundary_conditions:
  - {name: wall, nodes: {x: 0}, fix: [x, y]}
  - {name: guide, nodes: {box: {min: [1, 0], max: [4, 1]}}, fix: [y]}
loads: [{name: push, type: body-force, force: [-1, 0], bodies: [block]}]
steps: {count: 1, control: {type: arc-length, length: 0.01}}
";
    let (points, _) = run(deck(text));
    let moved = |p: usize| (points.converged.position[p][0] - points.original_position[p][0]).abs();
    let block_motion = (0..points.len()).filter(|&p| points.body[p] == 1).map(moved).fold(0.0, f64::max);
    // The block has three quarters of the volume; the nodes of the spring add their share.
    println!("the block moves by {block_motion}");
    assert!((0.01..0.0116).contains(&block_motion), "{block_motion}");
}

#[test]
fn a_probe_between_points_includes_all_that_are_equally_near() {
    let with = |probe: &str| {
        let text = BLOCK.replace("METHOD", "method: gimp").replace("DISPLACEMENT", "fix: [x, y]");
        let probes = format!("output: {{probes: [{{name: p, body: block, {probe}}}]}}\n");
        let (model, points) = deck(&(text.replace("COUNT", "1") + &probes));
        let chosen: Vec<[f64; 2]> =
            model.probes[0].points.iter().map(|&id| points.original_position[id as usize]).collect();
        let mean = |d: usize| chosen.iter().map(|x| x[d]).sum::<f64>() / chosen.len() as f64;
        (chosen.len(), [mean(0), mean(1)])
    };
    let at = |(count, mean): (usize, [f64; 2]), x: f64, y: f64, expected: usize| {
        assert_eq!(count, expected);
        assert!((mean[0] - x).abs() < 1e-12 && (mean[1] - y).abs() < 1e-12, "{mean:?}");
    };
    at(with("nearest: [0.5, 0.5]"), 0.5, 0.5, 4);
    at(with("nearest: [0.5, 0.5], count: 3"), 0.5, 0.5, 4);
    at(with("nearest: [0.5, 0]"), 0.5, 0.125, 2);
    at(with("nearest: [0.500000000001, 0.5]"), 0.5, 0.5, 4);
    at(with("nearest: [0.50001, 0.5]"), 0.625, 0.5, 2);
    at(with("nearest: [0, 0]"), 0.125, 0.125, 1);
    at(with("nearest: [0.51, 0.52], count: 3"), 0.5416666666666666, 0.5416666666666666, 3);
}

#[test]
fn parameters_that_contain_each_other_do_not_grow_without_bound() {
    let began = Instant::now();
    let chain: String = (1..400).fold("  a0: \"word \"\n".to_owned(), |text, k| {
        text + &format!("  a{k}: \"${{a{}}}${{a{}}}\"\n", k - 1, k - 1)
    });
    let text = format!("version: 1\nparameters:\n{chain}title: \"${{a399}}\"\n");
    let found = faults(&text);
    let grown: Vec<&Diagnostic> = found.iter().filter(|d| d.message.contains("parameters add")).collect();
    assert_eq!(grown.len(), 1, "{found:?}");
    let line = text[..grown[0].span.unwrap().start].matches('\n').count();
    assert!((10..20).contains(&line), "line {line}");
    assert_eq!((grown[0].code, grown[0].is_error()), ("D012", true));
    // A long word in very many places.
    let places = "\"${a}\", ".repeat(200_000);
    let text = format!("version: 1\nparameters: {{a: \"{}\"}}\ntitle: [{places}]\n", "x".repeat(5000));
    let found = faults(&text);
    assert!(found.iter().any(|d| d.message.contains("to the deck")), "{:?}", &found[..found.len().min(3)]);
    assert!(found.len() < 10);
    // Real decks are far below the limit.
    let text =
        "version: 1\nparameters: {a: gimp, b: \"${a} and ${a}\", c: \"${b}, ${b}\"}\ntitle: \"${c}\"\n";
    assert!(!faults(text).iter().any(|d| d.code == "D012"));
    println!("{:.2} s", began.elapsed().as_secs_f64());
    assert!(began.elapsed().as_secs() < 60);
}

#[test]
fn aliases_and_keys_do_not_grow_without_bound() {
    let began = Instant::now();
    let long = "x".repeat(1 << 20);
    let copies = format!("a: &a \"{long}\"\nb: [{}]\n", "*a, ".repeat(90_000));
    let below = format!("? {long}\n: [{}]\n", "1, ".repeat(200_000));
    for text in [copies, below] {
        let found = faults(&text);
        assert_eq!(found.len(), 1);
        assert!(found[0].code == "D004" && found[0].is_error() && found[0].span.is_some(), "{found:?}");
    }
    println!("{:.2} s", began.elapsed().as_secs_f64());
}

/// The points keep their mass when a stage exchanges the material: another density, if it is given, has no effect.
#[test]
fn another_density_of_a_material_in_a_stage_is_reported() {
    let of = |density: &str| {
        let text = BLOCK.replace("METHOD", "method: mpm").replace("DISPLACEMENT", "ux: 0.1");
        let text = text.replace(
            "density: 7}}",
            &format!("density: 7}}, n: {{model: hencky, young: 1e3, poisson: 0.2{density}}}}}"),
        );
        let stages = "stages:
  - {name: one, steps: {count: 1}, factors: {all: 1}}
  - {name: two, steps: {count: 1}, material: {block: n}}";
        let found = faults(&text.replace("steps: {count: COUNT}", stages));
        found.into_iter().filter(|d| d.message.contains("density")).collect::<Vec<_>>()
    };
    for same in ["", ", density: 7"] {
        assert!(of(same).is_empty(), "{:?}", of(same));
    }
    let found = of(", density: 8");
    assert!(found.len() == 1 && found[0].code == "D037" && !found[0].is_error(), "{found:?}");
    assert!(found[0].message.contains("`block` keep their mass"), "{found:?}");
}

/// Decks in `inputs` have no keys without effect.
#[test]
fn no_deck_of_the_inputs_has_a_key_without_effect() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs");
    let mut folders = vec![root];
    let mut seen = 0;
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "yaml") {
                seen += 1;
                let loaded = load(&path, &[]).unwrap();
                let notes = mpm::deck::ready::ready(&loaded, None).unwrap().notes;
                let without: Vec<_> =
                    loaded.notes.iter().chain(&notes).filter(|d| d.code == "D037").collect();
                assert!(without.is_empty(), "{}: {without:?}", path.display());
            }
        }
    }
    assert!(seen > 15, "{seen} decks");
}
