//! Stages: bodies that come and go, conditions that are set and released, factors that continue from their last values.

use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::model::Model;
use mpm::points::{PointArray, Points};
use mpm::solver::{Observer, Progress, Reached, Silent, StepReport, Summary, resume_stage, run_stages};

/// Keeps the positions of the points, in permanent order, and the report of every step.
#[derive(Default)]
pub struct Every {
    positions: Vec<Vec<f64>>,
    pub reports: Vec<StepReport<2>>,
}

impl Observer<2> for Every {
    fn converged(
        &mut self,
        _: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.positions.push(points.array(PointArray::Position).values);
        self.reports.push(report.clone());
        Ok(())
    }
}

/// A run in its final state.
pub struct Run {
    pub model: Model<2>,
    pub points: Points<2>,
    pub every: Every,
    pub progress: Progress,
    pub summary: Summary,
}

/// Runs a deck given as text.
pub fn run(text: &str) -> Run {
    run_with(text, &[])
}

/// Runs a deck given as text with these values of its parameters.
pub fn run_with(text: &str, values: &[(&str, &str)]) -> Run {
    let values: Vec<_> =
        values.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    let (mut model, mut points) =
        build(&load_text("stages.yaml", text.as_bytes(), &values).unwrap()).unwrap();
    let mut every = Every::default();
    let reached = Reached::nothing(&points);
    let Reached { progress, summary } = run_stages(&mut model, &mut points, reached, &mut every).unwrap();
    Run { model, points, every, progress, summary }
}

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A column of `ground`, 6 m high, with 4 m of `pit` on top, under its own weight.
fn column(ground: &str, pit: &str, method: &str, h: f64, steps: &str) -> String {
    format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [1, 12], spacing: [1, {h}]}}
materials:
  ground: {ground}
  pit: {pit}
bodies:
  - {{name: ground, material: ground, method: {method}, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [1, 6]}}}}
  - {{name: pit, material: pit, method: {method}, points_per_cell: 2, shape: {{type: box, min: [0, 6], max: [1, 10]}}}}
boundary_conditions:
  - {{name: sides, nodes: {{box: {{min: [0, 0], max: [1, 12]}}}}, fix: [x]}}
  - {{name: floor, nodes: {{y: 0}}, fix: [y]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, -10]}}
solver: {{tolerance: 1e-12}}
{steps}
"
    )
}

const CLAY: &str = "{model: hencky, young: 1e6, poisson: 0.3, density: 1800}";

#[test]
fn two_stages_that_add_up_to_one_give_the_same_answer() {
    for method in ["mpm", "gimp", "cpdi2"] {
        let one = run(&column(CLAY, CLAY, method, 1.0, "steps: {count: 8}"));
        let halves = "stages:
  - {name: a, steps: {count: 4}, factors: {weight: 0.5}}
  - {name: b, steps: {count: 4, end_time: 2}, factors: {weight: 1}}";
        let two = run(&column(CLAY, CLAY, method, 1.0, halves));
        let difference = farthest(one.every.positions.last().unwrap(), two.every.positions.last().unwrap());
        assert!(difference < 1e-12 * 10.0, "{method}: {difference:e}");
        assert_eq!(two.summary.steps, 8);
        assert_eq!(two.every.reports.last().unwrap().step.end, 3.0);
    }
}

/// An elastic column without weight of its own, compressed by a body on top, recovers when that body is removed.
#[test]
fn an_elastic_column_comes_back_when_its_load_is_dug_away() {
    let light = "{model: hencky, young: 1e6, poisson: 0.3, density: 0}";
    for method in ["mpm", "gimp", "cpdi2"] {
        let stages = "stages:
  - {name: weight, steps: {count: 4}, factors: {weight: 1}}
  - {name: dig, remove: [pit], steps: {count: 4}}";
        let Run { model, points, every, summary, .. } = run(&column(light, CLAY, method, 1.0, stages));
        let floor = |step: usize| every.reports[step].reactions[1][1];
        let weight = 1800.0 * 10.0 * 4.0;
        assert!((floor(3) / weight - 1.0).abs() < 1e-9, "{}", floor(3));
        for step in 4..8 {
            let share = (7 - step) as f64 / 4.0;
            let error = (floor(step) / weight - share).abs();
            println!("{method}: share {share} of the weight, error {error:e}");
            // Points that have left the positions at which they integrate the stress exactly carry a different force on
            // a fresh grid.
            let most = if method == "mpm" { 0.02 } else { 1e-3 };
            assert!(error < most, "{method}, {step}: {}", floor(step));
        }
        assert_eq!(points.len(), model.stages[0].stepping.count * 6, "4 points in each of 6 cells");
        let moved = points.array(PointArray::Displacement).values;
        let stress = points.array(PointArray::CauchyStress).values;
        let largest = |values: &[f64]| values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
        println!("{method}: displacement {:e}, stress {:e}", largest(&moved), largest(&stress));
        // Domains allow stresses that alternate from point to point without any nodal force, here up to a hundredth
        // of the former stress.
        let most = if method == "mpm" { 1e-8 } else { 0.02 };
        assert!(largest(&stress) < most * weight, "{method}: {:e}", largest(&stress));
        // In a stress-free state, the points may be out of line by up to half a percent of the compression.
        assert!(largest(&moved) < 2e-3, "{method}: {:e}", largest(&moved));
        assert!(summary.energy_error().abs() < 0.1, "{}", summary.energy_error());
    }
}

/// Excavation of 4 m of a stiff column of 10 m: the new surface heaves by γ·4 m·6 m/E_oed, with an error of the order
/// of the strain, and the stress at the base is that of a column of 6 m.
#[test]
fn the_heave_of_a_stiff_column_is_that_of_small_strains() {
    for young in [1e8, 1e9] {
        let clay = format!("{{model: hencky, young: {young}, poisson: 0.3, density: 1800}}");
        let stages = "stages:
  - {name: weight, steps: {count: 1}, factors: {weight: 1}, then: {reset: [displacement]}}
  - {name: dig, remove: [pit], steps: {count: 2}}";
        let Run { points, every, .. } = run(&column(&clay, &clay, "gimp", 0.5, stages));
        let oedometric = young * 0.7 / (1.3 * 0.4);
        let heave = 18e3 * 4.0 * 6.0 / oedometric;
        // The uppermost points are a quarter of a cell below the surface: 0.125 m.
        let moved = points.array(PointArray::Displacement).values;
        let top = moved.iter().skip(1).step_by(2).fold(0.0f64, |most, u| most.max(*u));
        let below = 18e3 * 4.0 * 5.875 / oedometric;
        let (error, strain) = ((top / below - 1.0).abs(), 18e3 * 10.0 / oedometric);
        println!("E = {young:e}: error {error:e}, strain {strain:e}");
        assert!(error < 2.0 * strain, "{error:e}");
        let base = every.reports[2].reactions[1][1];
        assert!((base / (18e3 * 6.0) - 1.0).abs() < 1e-9, "{base}");
        assert!(top < heave);
    }
}

/// The upper 4 m of a column under geostatic stress are excavated in one step: at every point, the rest has the stress
/// of the exact solution, σ = τ(J)/J = −γ (6 − Y) with τ = M ln J + σ₀, and heaves by ∫ (J − 1) dY with an error of
/// order h².
#[test]
fn an_excavated_column_has_the_exact_stress_at_finite_strain() {
    let (young, gamma) = (2e6, 18e3);
    let modulus = young * 0.7 / (1.3 * 0.4);
    // J from M ln J + σ₀ = σ J by Newton's method.
    let stretch = |y: f64| {
        let (before, after) = (-gamma * (10.0 - y), -gamma * (6.0 - y));
        let mut j = 1.0;
        for _ in 0..50 {
            j -= (modulus * f64::ln(j) + before - after * j) / (modulus / j - after);
        }
        j
    };
    // Gauss quadrature with three points on 600 intervals.
    let heave: f64 = (0..600)
        .flat_map(|k| [(-0.6f64.sqrt(), 5.0), (0.0, 8.0), (0.6f64.sqrt(), 5.0)].map(|(x, w)| (k, x, w)))
        .map(|(k, x, w)| 0.01 * w / 18.0 * (stretch(0.01 * (f64::from(k) + 0.5 + 0.5 * x)) - 1.0))
        .sum();
    let mut errors = Vec::new();
    for cells_per_metre in [2, 4, 8, 32] {
        let h = 1.0 / f64::from(cells_per_metre);
        let clay = format!("{{model: hencky, young: {young}, poisson: 0.3, density: 1800}}");
        let stages = "stages:
  - {name: rest, steps: {count: 1}, then: {reset: [displacement]}}
  - {name: dig, remove: [pit], steps: {count: 1}}";
        let geostatic = "initial_stress: {type: geostatic, surface: 10, k0: 0.5}";
        // The stabilisation of cells with single points would change the stress by a fraction of 4·10⁻⁹.
        let deck = column(&clay, &clay, "mpm", h, stages)
            .replace("version: 1", "version: 1\nanalysis: {stabilisation: {mode: off}}")
            .replace("points_per_cell: 2", &format!("points_per_cell: 1, {geostatic}"));
        let Run { points, every, .. } = run(&deck);
        let stress = points.array(PointArray::CauchyStress).values;
        let moved = points.array(PointArray::Displacement).values;
        let original: Vec<f64> =
            points.array(PointArray::Position).values.iter().zip(&moved).map(|(x, u)| x - u).collect();
        let mut worst = 0.0f64;
        for (x, stress) in original.chunks(2).zip(stress.chunks(stress.len() / points.len())) {
            worst = worst.max((stress[1] + gamma * (6.0 - x[1])).abs());
        }
        // The surface moves with the top node, half a cell above the uppermost point.
        let top = every.reports.last().unwrap().grid.delta_d.iter().fold(0.0f64, |most, u| most.max(u[1]));
        errors.push((top - heave).abs() / heave);
        println!(
            "h = {h}: heave {top:.10} of {heave:.10}, error {:.1e}, stress {worst:.1e} Pa",
            errors.last().unwrap()
        );
        assert!(worst < 1e-13 * gamma * 10.0, "{worst:e}");
    }
    assert!((errors[0] / errors[1]).log2() > 1.9 && (errors[1] / errors[2]).log2() > 1.9, "{errors:?}");
    assert!(errors[3] < 1e-8, "{errors:?}");
}

/// A prop that is released gives way in proportion to time, and a body that is added gains its weight in proportion to
/// time.
#[test]
fn what_a_stage_releases_and_adds_changes_in_proportion_to_time() {
    let stiff = "{model: hencky, young: 1e9, poisson: 0, density: 1800}";
    let stages = "stages:
  - {name: prop, steps: {count: 1}, factors: {weight: 1}}
  - {name: release, steps: {count: 4}, release: [prop]}
  - {name: fill, steps: {count: 4}, add: [pit]}
  - {name: prop, steps: {count: 1}, set: [prop]}";
    let stages = &stages.replacen("name: prop", "name: begin", 1);
    let deck = column(stiff, stiff, "mpm", 1.0, stages)
        .replace("loads:", "  - {name: prop, nodes: {y: 6}, fix: [y]}\nloads:");
    let Run { every, .. } = run(&deck);
    let floor: Vec<f64> = every.reports.iter().map(|report| report.reactions[1][1]).collect();
    let (half, whole) = (floor[0], 18e3 * 6.0);
    assert!(half < 0.6 * whole);
    for k in 1..=4 {
        let expected = half + (whole - half) * k as f64 / 4.0;
        // The strains are 10⁻⁴.
        assert!((floor[k] / expected - 1.0).abs() < 1e-4, "{floor:?}");
        let filled = whole + 18e3 * 4.0 * k as f64 / 4.0;
        assert!((floor[4 + k] / filled - 1.0).abs() < 1e-4, "{floor:?}");
    }
}

/// Exchanging a material leaves stresses and positions unchanged; later loads meet the new stiffness.
#[test]
fn an_exchanged_material_keeps_the_stress() {
    let clay = "{model: neo-hookean, young: 1e6, poisson: 0.3, density: 1800}";
    let stages = "stages:
  - {name: weight, steps: {count: 4}, factors: {weight: 1}}
  - {name: exchange, steps: {count: 2}, material: {ground: pit}}
  - {name: more, steps: {count: 2}, factors: {weight: 1.1}}";
    let strong = "{model: von-mises, young: 5e6, poisson: 0.3, density: 1800, deviatoric_yield_stress: 1e9}";
    let deck = column(clay, strong, "cpdi2", 1.0, stages);
    let Run { every, points, .. } = run(&deck);
    let moved = |a: usize, b: usize| farthest(&every.positions[a], &every.positions[b]);
    let (weighed, exchanged, more) = (moved(0, 3), moved(3, 5), moved(5, 7));
    println!("weight {weighed:e}, exchange {exchanged:e}, a tenth more {more:e}");
    assert!(exchanged < 1e-3 * weighed, "{exchanged:e}");
    assert!(more < 0.05 * weighed && more > 0.005 * weighed, "{more:e}");
    assert_eq!(points.history_len, 1);
}

/// Elastic bodies do not flow, even if an earlier material of theirs had a history and the new one has none.
#[test]
fn a_body_without_history_does_not_flow_after_an_exchange() {
    let varying = "{model: hencky, young: \"1e6*(1+0.1*Y)\", poisson: 0.3, density: 1800}";
    let stages = "stages:
  - {name: rest, steps: {count: 1}, factors: {weight: 0.01}}
  - {name: exchange, steps: {count: 1}, material: {ground: pit}}
  - {name: weight, steps: {count: 2}, factors: {weight: 0.1}}";
    let elastic = "{model: hencky, young: 1e7, poisson: 0.495, density: 1800}";
    let Run { points, summary, .. } = run(&column(varying, elastic, "mpm", 0.5, stages));
    assert_eq!(points.history_len, 1, "the history of the earlier material");
    assert_eq!(summary.quality.pressure_oscillation, None, "{:?}", summary.warnings);
}

/// A body that is added begins in the material that it has by then, whether it gets this material in the same stage or
/// while it is absent, and whether or not the properties of this material vary.
#[test]
fn an_added_body_begins_in_its_present_material() {
    let stress = |top: f64| {
        format!(
            "points_per_cell: 2, initial_stress: {{type: components, stress: {{yy: \"-18e3*({top}-Y)\"}}}}"
        )
    };
    let soft = "{model: hencky, young: 1e9, poisson: 0, density: 1800}";
    let moduli = ["3e9", "\"1e9*(1+0.1*Y)\""];
    for young in moduli {
        let other = format!("{{model: hencky, young: {young}, poisson: 0, density: 1800}}");
        let at_end = |stages: &str| {
            let deck = column(soft, soft, "mpm", 1.0, stages)
                .replace("\nbodies:", &format!("\n  other: {other}\nbodies:"))
                .replacen("points_per_cell: 2", &stress(6.0), 1)
                .replacen("points_per_cell: 2, shape", &format!("{}, shape", stress(10.0)), 1);
            let Run { points, .. } = run(&deck);
            [PointArray::CauchyStress, PointArray::ElasticStrain].map(|array| points.array(array).values)
        };
        let stage = |name: &str, more: &str| format!("\n  - {{name: {name}, steps: {{count: 1}}{more}}}");
        let (change, add) = (", material: {pit: other}", ", add: [pit]");
        let together = format!("stages:{}{}", stage("a", ""), stage("b", &format!("{change}{add}")));
        let expected = at_end(&together);
        let again = ", remove: [pit], add: [pit]";
        for others in [
            format!("stages:{}{}{}", stage("a", ""), stage("b", change), stage("c", add)),
            format!("{together}{}", stage("c", again)),
        ] {
            for (found, expected) in at_end(&others).iter().zip(&expected) {
                let largest = expected.iter().fold(0.0f64, |most, value| most.max(value.abs()));
                let difference = farthest(found, expected);
                assert!(difference < 1e-3 * largest, "{others}: {difference:e} of {largest:e}");
            }
        }
    }
}

/// The geostatic stress of a body carries the weight only of bodies that are present when the body begins.
#[test]
fn bodies_that_never_meet_do_not_carry_each_other() {
    let stages = "stages:
  - {name: slot, steps: {count: 1}}
  - {name: wall, steps: {count: 1}, remove: [ground], add: [pit]}";
    let heavy = "{model: hencky, young: 1e8, poisson: 0.3, density: 2400}";
    let deck = column(CLAY, heavy, "mpm", 1.0, stages)
        .replace("min: [0, 6], max: [1, 10]", "min: [0, 0], max: [1, 6]")
        .replace(
            "points_per_cell: 2",
            "points_per_cell: 2, initial_stress: {type: geostatic, surface: 6, k0: 0.5}",
        );
    let (model, points) = build::<2>(&load_text("stages.yaml", deck.as_bytes(), &[]).unwrap()).unwrap();
    for (points, weight) in [(&points, 18e3), (&model.stages[1].added, 24e3)] {
        let (places, stresses) = (points.array(PointArray::Position), points.array(PointArray::CauchyStress));
        assert!(!points.is_empty());
        for (x, stress) in places.values.chunks(2).zip(stresses.values.chunks(6)) {
            let carried = weight * (6.0 - x[1]);
            assert!((stress[1] + carried).abs() < 1e-9 * carried, "{} instead of {carried}", -stress[1]);
        }
    }
    assert_eq!(run(&deck).summary.steps, 2);
}

/// Keeps the state after a number of steps.
struct Keep {
    after: usize,
    kept: Option<(Points<2>, Reached)>,
}

impl Observer<2> for Keep {
    fn converged(
        &mut self,
        _: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        reached: &Reached,
    ) -> std::io::Result<()> {
        if report.step.index == self.after {
            self.kept = Some((points.clone(), reached.clone()));
        }
        Ok(())
    }
}

/// A run resumed within a stage, or between two, ends with the same bits.
#[test]
fn a_run_resumed_between_and_within_stages_has_the_same_bits() {
    let stages = "stages:
  - {name: weight, steps: {count: 3}, factors: {weight: 1}, then: {reset: [displacement]}}
  - {name: dig, remove: [pit], steps: {count: 3}, release: [sides], set: [smooth]}
  - {name: fill, add: [pit], steps: {count: 3}, material: {ground: pit}}";
    let deck = column(CLAY, "{model: hencky, young: 3e6, poisson: 0.2, density: 1500}", "gimp", 1.0, stages)
        .replace("loads:", "  - {name: smooth, nodes: {box: {min: [0, 0], max: [1, 12]}}, fix: [x]}\nloads:");
    resumes(&deck);
}

/// A hanging body whose points split under its weight is removed and added again, and its points split again: a run
/// resumed after any step has the same points.
#[test]
fn points_that_split_in_two_lives_of_their_body_resume() {
    let deck = "
version: 1
grid: {type: structured, origin: [0, 0], size: [1, 6], spacing: 1}
materials: {soft: {model: hencky, young: 1e5, poisson: 0.3, density: 1000}}
bodies: [{name: b, material: soft, method: cpdi2, split_above: 0.55, points_per_cell: 2, shape: {type: box, min: [0, 4], max: [1, 6]}}]
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [1, 6]}}, fix: [x]}
  - {name: top, nodes: {y: 6}, fix: [y]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
stages:
  - {name: hang, steps: {count: 2}, factors: {weight: 1}}
  - {name: again, remove: [b], add: [b], steps: {count: 3}}
  - {name: rest, steps: {count: 2}}
";
    let Run { progress: Progress { splits, .. }, points, .. } = run(deck);
    let twice = splits.iter().filter(|split| splits.iter().any(|o| o != *split && o.point == split.point));
    assert!(points.len() > 8 && twice.count() > 0, "{:?}", splits);
    resumes(deck);
}

/// Asserts that a run resumed after any of its steps ends with the same bits.
pub fn resumes(deck: &str) {
    let whole = run(deck);
    let built = || build::<2>(&load_text("stages.yaml", deck.as_bytes(), &[]).unwrap()).unwrap();
    for after in 1..whole.every.reports.len() {
        let (mut model, mut points) = built();
        let mut keep = Keep { after, kept: None };
        let reached = Reached::nothing(&points);
        run_stages(&mut model, &mut points, reached, &mut keep).unwrap();
        let (kept, reached) = keep.kept.unwrap();
        let (mut model, mut points) = built();
        let text = serde_json::to_string(&reached).unwrap();
        let reached: Reached = serde_json::from_str(&text).unwrap();
        resume_stage(&mut model, &mut points, &reached).unwrap();
        assert_eq!(points.len(), kept.len(), "the points of the stage");
        let mut points = kept;
        let resumed = run_stages(&mut model, &mut points, reached, &mut Silent).unwrap();
        assert_eq!(resumed.progress.strength, whole.progress.strength, "after step {after}");
        for array in [PointArray::Position, PointArray::CauchyStress, PointArray::Displacement] {
            assert_eq!(points.array(array).values, whole.points.array(array).values, "after step {after}");
        }
    }
}
