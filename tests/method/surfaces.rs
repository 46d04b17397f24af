//! Surfaces in stages and in space: walls that are set and released, loads that continue from their last values, and
//! resumption.

use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::model::Model;
use mpm::points::PointArray;
use mpm::points::Points;
use mpm::solver::{Observer, Reached, StepReport, run as solve};
use mpm::surface::SurfaceFields;
use mpm::terms::ToolState;

use crate::stages::{Run, resumes, run};

/// A bar along x whose left end slides along the grid boundary and whose right end, inside cells, is pulled. No point
/// lies on a grid line, where it would change its cell in the first step.
fn bar(method: &str, surfaces: &str, conditions: &str, loads: &str, steps: &str) -> String {
    format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [3, 2], spacing: 0.5}}
materials:
  steel: {{model: hencky, young: 1e6, poisson: 0, density: 1000}}
bodies:
  - {{name: bar, material: steel, method: {method}, point_spacing: [0.22, 0.25], shape: {{type: box, min: [0, 0], max: [2.2, 1]}}}}
  - {{name: cap, material: steel, method: {method}, point_spacing: 0.2, shape: {{type: box, min: [0, 1], max: [2.2, 1.4]}}}}
surfaces:
  - {{name: end, body: bar, part: {{edge: 1}}}}
{surfaces}
boundary_conditions:
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
{conditions}
loads:
  - {{name: pull, type: traction, surface: end, traction: [100, 0]}}
{loads}
solver: {{tolerance: 1e-12}}
{steps}
"
    )
}

const PULLED: &str = "stages:
  - {name: pull, steps: {count: 2}, factors: {pull: 1}}
  - {name: hold, steps: {count: 3}, set: [wall], factors: {pull: 0}}
  - {name: let_go, steps: {count: 3}, release: [wall]}";

/// A wall that is set holds the surface at its current position: it takes over the load as the load decreases; when the
/// wall is released, the bar takes the force back and shortens.
#[test]
fn a_wall_set_on_a_surface_takes_over_what_loads_leave() {
    for method in ["mpm", "gimp", "cpdi2"] {
        let wall = "  - {name: wall, surface: end, fix: [x]}";
        let deck = bar(method, "", wall, "", PULLED).replace("  - {name: cap", "# - {name: cap");
        let Run { every, points, .. } = run(&deck);
        let wall: Vec<f64> = every.reports.iter().map(|report| report.reactions[2][0]).collect();
        let pulled: Vec<f64> = every.reports.iter().map(|report| report.loads[0][0]).collect();
        println!("{method}: wall {wall:?}, pull {pulled:?}");
        // The wall also carries the force that the points lose when they are linked to a fresh grid.
        for step in 0..5 {
            let missing = 100.0 * [0.0, 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0][step];
            assert!((wall[step] - missing).abs() < 1e-3, "{method}: {wall:?}");
        }
        assert_eq!(wall[5..], [0.0; 3]);
        // Mean position of the samples of the surface.
        let position = |step: usize| {
            let places = &every.reports[step].list::<SurfaceFields<2>>()[0].position;
            places.iter().map(|x| x[0]).sum::<f64>() / places.len() as f64
        };
        assert!((position(4) - position(1)).abs() < 1e-12, "{:e}", position(4) - position(1));
        let moved = points.array(PointArray::Displacement).values;
        let most = moved.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        println!("{method}: left {most:e} of {:e}", position(1) - 2.2);
        assert!(most < 1e-5 * (position(1) - 2.2), "{most:e}");
    }
}

/// A wall on the loaded surface takes the load at once, and a wall that is set also holds a body without any stress:
/// forces that cancel on the surface are not out of balance.
#[test]
fn a_wall_on_a_loaded_surface_takes_the_load() {
    let stages = "stages:
  - {name: pull, steps: {count: 2}, factors: {pull: 1}}
  - {name: rest, steps: {count: 2}, factors: {pull: 0}}
  - {name: hold, steps: {count: 2}, set: [wall]}
  - {name: pull_again, steps: {count: 2}, factors: {pull: 2}}
  - {name: let_go, steps: {count: 2}, release: [wall], factors: {pull: 0}}
  - {name: hold_again, steps: {count: 2}, set: [wall]}";
    for method in ["mpm", "gimp", "cpdi2"] {
        let wall = "  - {name: wall, surface: end, fix: [x]}";
        let deck = bar(method, "", wall, "", stages).replace("  - {name: cap", "# - {name: cap");
        let Run { every, .. } = run(&deck);
        let of = |step: usize| [every.reports[step].reactions[2][0], every.reports[step].reactions[0][0]];
        let [wall, left] = of(7);
        println!("{method}: {wall} {left}");
        assert!((wall + 200.0).abs() < 1e-6 && left.abs() < 1e-6, "{method}: {wall} {left}");
        let [wall, left] = of(11);
        assert!(wall.abs() < 1e-6 && left.abs() < 1e-6, "{method}: {wall} {left}");
    }
}

/// A body that is removed and added again has its surface where it was at the start, and a condition on this surface
/// holds it there.
#[test]
fn the_surface_of_a_body_that_is_added_again_begins_anew() {
    let stages = "stages:
  - {name: press, steps: {count: 2}, factors: {roof: 1}}
  - {name: again, remove: [cap], add: [cap], steps: {count: 2}}";
    let (top, roof) =
        ("  - {name: top, body: cap, part: {edge: 2}}", "  - {name: roof, surface: top, uy: -1e-3}");
    for method in ["mpm", "gimp", "cpdi2"] {
        let Run { every, .. } = run(&bar(method, top, roof, "", stages));
        let moved: Vec<f64> =
            (every.reports.iter().map(|report| &report.list::<SurfaceFields<2>>()[1].position))
                .map(|places| places.iter().map(|x| x[1] - 1.4).sum::<f64>() / places.len() as f64)
                .collect();
        for (moved, expected) in moved.iter().zip([-0.5e-3, -1e-3, 0.0, 0.0]) {
            assert!((moved - expected).abs() < 5e-5, "{method}: {moved:e} instead of {expected:e}");
        }
    }
}

/// Bodies with surfaces come and go, and so do loads and conditions on these surfaces: a run resumed after any step has
/// the same bits.
#[test]
fn surfaces_resume_between_and_within_stages() {
    let stages = "stages:
  - {name: pull, steps: {count: 2}, factors: {pull: 1}}
  - {name: fill, steps: {count: 2}, add: [cap], set: [wall], factors: {weight: 1}}
  - {name: press, steps: {count: 2, control: {type: displacement, probe: tip, axis: x, to: -1e-3}}, release: [wall], factors: {gas: 1}}
  - {name: dig, steps: {count: 2}, remove: [cap]}
output: {probes: [{name: tip, body: bar, nearest: [2.1, 0.9]}]}";
    let deck = bar(
        "gimp",
        "  - {name: all, body: bar}\n  - {name: top, body: cap, part: {edge: 2}}",
        "  - {name: wall, surface: end, fix: normal}\n  - {name: roof, surface: top, uy: -1e-3}",
        "  - {name: weight, type: gravity, acceleration: [0, -10]}
  - {name: gas, type: pressure, surface: all, pressure: 1e4}
  - {name: water, type: pressure, surface: top, hydrostatic: {level: 2, unit_weight: 1e3}}",
        stages,
    );
    resumes(&deck);
    let Run { every, .. } = run(&deck);
    let counts: Vec<usize> =
        every.reports.iter().map(|report| report.list::<SurfaceFields<2>>()[2].position.len()).collect();
    assert_eq!(counts.iter().filter(|n| **n == 0).count(), 4, "the cap is there in two stages: {counts:?}");
    assert!(every.reports.iter().all(|report| report.energy.external_work.is_finite()));
}

/// A hanging body whose domains, and with them the sides on its surfaces, are cut under its weight is removed and added
/// again, and cut again; a wall is set once sides have been cut. A run resumed after any step has the same bits.
#[test]
fn divided_surfaces_resume_between_and_within_stages() {
    let deck = "
version: 1
grid: {type: structured, origin: [0, 0], size: [3, 6], spacing: 1}
materials: {soft: {model: hencky, young: 1e5, poisson: 0.3, density: 1000}}
bodies: [{name: b, material: soft, method: cpdi2, split_above: 0.55, points_per_cell: 2, shape: {type: box, min: [1, 4], max: [2, 6]}}]
surfaces:
  - {name: left, body: b, part: {edge: 3}}
  - {name: right, body: b, part: {edge: 1}}
  - {name: all, body: b}
boundary_conditions:
  - {name: top, nodes: {y: 6}, fix: [x, y]}
  - {name: roller, surface: left, fix: normal}
  - {name: wall, surface: right, fix: [x]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
  - {name: gas, type: pressure, surface: all, pressure: 1e3}
  - {name: drag, type: traction, surface: right, traction: [\"100*Y\", -1e3]}
stages:
  - {name: hang, steps: {count: 3}, factors: {weight: 1, gas: 1, drag: 1}}
  - {name: hold, set: [wall], steps: {count: 2}, factors: {weight: 1.3}}
  - {name: again, remove: [b], add: [b], steps: {count: 3}}
  - {name: rest, steps: {count: 2}, release: [wall]}
";
    let Run { every, .. } = run(deck);
    let counts: Vec<usize> =
        every.reports.iter().map(|report| report.list::<SurfaceFields<2>>()[1].position.len()).collect();
    let begins_anew = counts.windows(2).any(|pair| pair[1] < pair[0]);
    assert!(begins_anew && counts[3] > 4 && counts[9] > 4, "{counts:?}");
    resumes(deck);
}

/// Reactions of the first condition and residuals of the iterations of all steps.
#[derive(Default)]
struct Last {
    reaction: Vec<f64>,
    residuals: Vec<Vec<f64>>,
}

impl Observer<3> for Last {
    fn converged(
        &mut self,
        _: &Model<3>,
        _: &Points<3>,
        report: &StepReport<3>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.reaction.extend(report.reactions[0]);
        self.residuals.push(report.residuals.clone());
        Ok(())
    }
}

/// A block in space with all sides inside cells, on a rough wall and under the same pressure on every side: the
/// resultant force on the wall is zero.
#[test]
fn a_block_in_space_under_pressure_needs_no_wall() {
    for method in ["mpm", "gimp", "cpdi2"] {
        let text = format!(
            "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [3, 3, 3], spacing: 0.5}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, shape: {{type: box, min: [0.6, 0.7, 0.8], max: [2.1, 2.2, 2.3]}}, point_spacing: 0.25, method: {method}}}]
surfaces: [{{name: all, body: b}}, {{name: base, body: b, part: {{edge: 4}}}}]
boundary_conditions: [{{name: base, surface: base, fix: [x, y, z]}}]
loads: [{{name: p, type: pressure, surface: all, pressure: 1e5}}]
steps: {{count: 3}}
solver: {{tolerance: 1e-12}}
"
        );
        let (model, mut points) =
            build::<3>(&load_text("block.yaml", text.as_bytes(), &[]).unwrap()).unwrap();
        let mut last = Last::default();
        solve(&model, &mut points, &mut last).unwrap();
        let largest = last.reaction.iter().fold(0.0f64, |most, r| most.max(r.abs()));
        println!("{method}: reaction {largest:e}, residuals {:?}", last.residuals);
        assert!(largest < 1e-9 * 1e5 * 2.25, "{largest:e}");
        // Each residual is of the order of the square of the one before, down to round-off.
        for residuals in &last.residuals {
            for pair in residuals[1..].windows(2) {
                assert!(pair[1] < 4.0 * pair[0] * pair[0] + 1e-13, "{method}: {residuals:?}");
            }
        }
    }
}

/// A dead pressure on a flat side equals a traction to the last bit; a following pressure no longer does when the side
/// turns.
#[test]
fn a_dead_pressure_is_a_traction_against_the_original_normal() {
    let shear = "stages:
  - {name: shear, steps: {count: 2}, factors: {side: 1, up: 1}}";
    let side = |load: &str| {
        let load = format!(
            "  - {{name: side, surface: end, {load}}}\n  - {{name: up, type: body-force, bodies: [bar], force: [0, 3e3]}}"
        );
        let deck = bar("gimp", "", "", &load, shear).replace("  - {name: cap", "# - {name: cap");
        run(&deck).points.array(PointArray::Displacement).values
    };
    let traction = side("type: traction, traction: [-20e3*(1 + y), 0]");
    assert_eq!(side("type: pressure, pressure: 20e3*(1 + y), follows: false"), traction);
    let following = side("type: pressure, pressure: 20e3*(1 + y)");
    let most = following.iter().zip(&traction).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(most > 1e-5, "{most:e}");
}

/// The displacement of a tool determines its load whether nodes or a weak condition hold the side of the block: the
/// multipliers of the condition are global unknowns, too.
#[test]
fn a_tool_controls_its_load_beside_a_weak_condition() {
    let found = ["surface: side", "nodes: {x: 2}"].map(|on| {
        let deck = format!(
            "version: 1
grid: {{type: structured, origin: [0, 0], size: [3, 3], spacing: 0.5}}
materials: {{steel: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies:
  - {{name: block, material: steel, method: mpm, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [2, 2]}}}}
surfaces: [{{name: side, body: block, part: {{edge: 1}}}}]
boundary_conditions:
  - {{name: wall, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
  - {{name: side, {on}, fix: [x]}}
tools:
  - {{name: plate, shape: {{type: box, min: [-0.5, 2], max: [2.5, 2.5]}}, free: [y], loads: [{{force: [0, -1e4]}}]}}
solver: {{tolerance: 1e-12}}
steps: {{count: 2, control: {{type: displacement, tool: plate, axis: y, to: -0.02}}}}
"
        );
        let Run { every, .. } = run(&deck);
        let last = every.reports.last().unwrap();
        println!("{on}: factor {:?}, displacement {:?}", last.load_factor, last.list::<ToolState<2>>()[0].displacement);
        assert!((last.list::<ToolState<2>>()[0].displacement[1] + 0.02).abs() < 1e-12);
        last.load_factor.unwrap()
    });
    assert!(found[0] > 1.0 && (found[0] / found[1] - 1.0).abs() < 1e-5, "{found:?}");
}
