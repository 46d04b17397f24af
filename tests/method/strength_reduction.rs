//! Strength reduction compared with closed forms, and its effect on the stages before and after it.

use mpm::points::PointArray;
use mpm::quality::Code;
use mpm::solver::StrengthBracket;

use super::stages::{Run, resumes, run, run_with};

/// A block of one metre in plane strain on a smooth base beside a smooth wall, under a pressure that follows its top.
fn block(material: &str, pressure: f64, stages: &str) -> Run {
    run(&format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [1.5, 1], spacing: 0.5}}
materials: {{soil: {material}}}
bodies:
  - name: block
    material: soil
    shape: {{type: box, min: [0, 0], max: [1, 1]}}
    strain: mean-dilatation
    points_per_cell: 2
boundary_conditions:
  - {{name: wall, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
surfaces:
  - {{name: top, body: block, part: {{edge: 2}}}}
loads:
  - {{name: push, type: pressure, surface: top, pressure: {pressure}}}
stages:
  - {{name: load, steps: {{count: 1}}, factors: {{push: 1}}, then: {{reset: [displacement]}}}}
{stages}"
    ))
}

/// A stage that reduces the strength.
fn reduction(from: f64, to: f64, tolerance: f64) -> String {
    let control = format!("{{type: strength-reduction, from: {from}, to: {to}, tolerance: {tolerance}}}");
    format!("  - {{name: safety, steps: {{count: 3, control: {control}}}}}\n")
}

const CLAY: &str = "{model: tresca, young: 1e11, poisson: 0.3, cohesion: 70e3}";
/// The factor of safety of a block of this clay under 101 kPa.
const OF_CLAY: f64 = 2.0 * 70e3 / 101e3;

/// The factor F at which 2 c/F tan(45° + φ_F/2), with tan φ_F = tan φ/F, equals the pressure; found by bisection.
fn factor_with_friction(cohesion: f64, angle: f64, pressure: f64) -> f64 {
    let strength = |factor: f64| {
        let reduced = (angle.to_radians().tan() / factor).atan();
        2.0 * cohesion / factor * (std::f64::consts::FRAC_PI_4 + 0.5 * reduced).tan()
    };
    let (mut low, mut high) = (0.1, 10.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if strength(middle) > pressure { &mut low } else { &mut high }) = middle;
    }
    low
}

/// A homogeneous block yields everywhere at once, at the factor for which its strength equals the pressure. Its strains
/// and hence the error of the closed form are below 10⁻⁵.
#[test]
fn the_bracket_of_a_homogeneous_block_contains_its_exact_factor() {
    let frictional = |model: &str, dilation: f64| {
        format!(
            "{{model: {model}, young: 1e11, poisson: 0.3, cohesion: 20e3, friction_angle: 30, dilation_angle: {dilation}}}"
        )
    };
    let sand_factor = factor_with_friction(20e3, 30.0, 50e3);
    for (material, pressure, exact) in [
        (CLAY.to_owned(), 101e3, OF_CLAY),
        (frictional("mohr-coulomb", 30.0), 50e3, sand_factor),
        (frictional("mohr-coulomb", 0.0), 50e3, sand_factor),
    ] {
        for tolerance in [0.05, 0.005, 1e-4] {
            let Run { progress, every, .. } = block(&material, pressure, &reduction(1.0, 1.6, tolerance));
            let StrengthBracket { stands: Some(stands), fails: Some(fails), .. } =
                progress.last_strength().unwrap()
            else {
                panic!("{material}: {:?}", progress.strength);
            };
            println!("{material}: exact {exact:.6}, between {stands:.6} and {fails:.6}");
            assert!(stands <= exact * (1.0 + 1e-5) && exact * (1.0 - 1e-5) <= fails, "{exact}");
            assert!(fails > stands && fails - stands <= tolerance, "{}", fails - stands);
            assert_eq!(every.reports.last().unwrap().strength_factor, Some(stands));
        }
    }
}

/// A jump to a factor beyond the factor of safety is cut down towards full strength, at which the bodies stand.
#[test]
fn a_search_that_begins_beyond_the_factor_goes_back() {
    for (from, tolerance) in [(1.5, 0.005), (1.5, 0.05), (1.3, 0.005), (5.0, 0.01)] {
        let stages = reduction(from, from + 0.5, tolerance);
        let Run { progress, .. } = block(CLAY, 101e3, &stages);
        let StrengthBracket { stands: Some(stands), fails: Some(fails), .. } =
            progress.last_strength().unwrap()
        else {
            panic!("from {from}: {:?}", progress.strength)
        };
        println!("from {from}: between {stands:.6} and {fails:.6}");
        assert!(stands <= OF_CLAY && OF_CLAY <= fails && fails - stands <= tolerance * 1.000001, "{from}");
    }
    resumes(&SLOPE.replace("to: 2, tolerance: 0.05", "from: 1.6, to: 2, tolerance: 0.05"));
}

/// If nothing fails, the steps and their factors are those that the deck asks for.
#[test]
fn a_search_that_begins_above_1_jumps_to_its_first_factor() {
    let Run { every, progress, .. } = block(CLAY, 101e3, &reduction(1.1, 1.25, 0.005));
    let factors: Vec<f64> = every.reports.iter().filter_map(|report| report.strength_factor).collect();
    let asked = [1, 2, 3].map(|step| 1.1 + (1.25 - 1.1) * f64::from(step) / 3.0);
    assert!(
        factors.len() == 3 && factors.iter().zip(asked).all(|(a, b)| (a - b).abs() < 1e-12),
        "{factors:?}"
    );
    assert_eq!(progress.last_strength().unwrap().stands, Some(1.25));
}

#[test]
fn a_factor_beyond_the_end_of_the_search_is_left_open() {
    let below = block(CLAY, 101e3, &reduction(1.0, 1.3, 0.005));
    let StrengthBracket { stands, fails, .. } = below.progress.last_strength().unwrap();
    assert_eq!((stands, fails), (Some(1.3), None));
    assert_eq!((below.summary.steps, below.summary.failed_attempts), (4, 0));
}

/// The body carried the load at full strength, so the factor of safety is not below 1.
#[test]
fn a_reduction_that_fails_at_once_begins_with_the_factor_of_the_stage_before() {
    let clay_factor = 1.001;
    let barely = block(CLAY, 140e3 / clay_factor, &reduction(1.0, 1.6, 0.005));
    let StrengthBracket { stands, fails, .. } = barely.progress.last_strength().unwrap();
    assert_eq!((stands, barely.summary.steps), (Some(1.0), 1));
    assert!(fails.is_some_and(|fails| fails > clay_factor && fails <= 1.005), "{fails:?}");
}

#[test]
fn every_stage_that_reduces_the_strength_keeps_its_own_factors() {
    let again = reduction(1.0, 1.6, 0.005).replace("safety", "again");
    let Run { progress, .. } = block(CLAY, 101e3, &(reduction(1.0, 1.2, 0.005) + &again));
    let [first, second] = &progress.strength[..] else { panic!("{:?}", progress.strength) };
    assert_eq!((first.stage, first.bracket.stands, first.bracket.fails), (1, Some(1.2), None));
    let StrengthBracket { stands: Some(stands), fails: Some(fails), slides, .. } = second.bracket else {
        panic!("{second:?}")
    };
    assert_eq!((second.stage, slides), (2, None));
    assert!(stands <= OF_CLAY && OF_CLAY <= fails, "{stands} {fails}");
}

/// The slope of `inputs/` with cells of this size.
fn slope(h: &str, further: &str) -> Run {
    let text = include_str!("../../inputs/slope.yaml").to_owned() + further;
    run_with(&text, &[("h", h), ("n", "2")])
}

#[test]
fn settings_of_the_iterations_do_not_decide_the_factor_of_safety() {
    for h in ["2", "1"] {
        // The shape in which a slope stands again after it has slid depends on the path.
        let slides = |further: &str| slope(h, further).progress.last_strength().unwrap().slides.unwrap();
        let usual = slides("");
        for solver in ["max_iterations: 6", "tangent: kept"] {
            let found = slides(&format!("solver: {{{solver}}}\n"));
            println!("h={h}, {solver}: {found:?}, by default {usual:?}");
            assert_eq!(found, usual, "{solver}: both have the width of the tolerance");
        }
    }
}

/// With coarse cells, the slope slides and stands again. Published factors are 1.38 to 1.40.
#[test]
fn a_slope_that_slides_is_told_from_one_that_stands() {
    let Run { progress, summary, points, .. } = slope("1", "");
    let StrengthBracket { stands, slides, moved, .. } = progress.last_strength().unwrap();
    let [before, after] = slides.unwrap();
    assert!(after - before <= 0.005, "the tolerance of the deck");
    println!("slides between {before} and {after}, stands up to {stands:?}, moved by {moved}");
    assert!(before >= 1.38 && after <= 1.43 && stands.is_some_and(|stands| stands >= after));
    let warnings: Vec<_> = summary.warnings.iter().filter(|warning| warning.code == Code::Slides).collect();
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.value.is_some_and(|share| share > 0.01));
    let displacement = points.array(PointArray::Displacement).values;
    let farthest = displacement.chunks(2).map(|u| u[0].hypot(u[1])).fold(0.0, f64::max);
    assert!(farthest <= moved && moved < 1.2 * farthest, "{farthest} {moved}");

    let stiff = block(CLAY, 101e3, &reduction(1.0, 1.6, 0.005));
    assert_eq!(stiff.progress.last_strength().unwrap().slides, None);
    assert!(stiff.summary.warnings.iter().all(|warning| warning.code != Code::Slides));
}

/// Beyond the slide, equilibrium is that of another shape, and finding it has a price.
#[test]
fn a_search_stops_after_a_slide_unless_it_is_told_to_go_on() {
    let with = |after_slide: &str| {
        SLOPE.replace("tolerance: 0.05", &format!("tolerance: 0.01, after_slide: {after_slide}"))
    };
    let (stops, goes_on) = (run(&with("stop")), run(&with("continue")));
    let [stopped, went_on] = [&stops, &goes_on].map(|run| run.progress.last_strength().unwrap());
    println!("{stopped:?}\n{went_on:?}");
    assert_eq!(stopped.slides, went_on.slides, "both find the slide");
    let [before, after] = stopped.slides.unwrap();
    assert!(stopped.ran_away && stopped.fails.is_none() && stopped.stands.is_some_and(|f| f >= after));
    assert!(stopped.evaluations < went_on.evaluations && went_on.stands > stopped.stands);
    assert!(stopped.to_string().ends_with("the search ended there"), "{stopped}, {before}");
    // The next stage begins where the search has ended, at its own time.
    let last = stops.every.reports.last().unwrap();
    assert!((last.step.start, last.step.end, last.strength_factor) == (2.0, 3.0, None), "{:?}", last.step);
    let by_default = run(&SLOPE.replace("tolerance: 0.05", "tolerance: 0.01"));
    assert_eq!(by_default.progress.strength, stops.progress.strength);
    resumes(&with("stop"));
}

#[test]
fn the_cost_of_a_search_is_that_of_its_attempts() {
    let Run { progress, summary, every, .. } = block(CLAY, 101e3, &reduction(1.0, 1.6, 0.005));
    let found = progress.last_strength().unwrap();
    let steps = every.reports.iter().filter(|report| report.strength_factor.is_some()).count();
    assert_eq!(found.attempts, steps + summary.failed_attempts);
    assert!(found.evaluations > found.attempts && found.evaluations < summary.evaluations);
    assert!(summary.searches[&1].as_nanos() > 0 && summary.searches.len() == 1);
}

/// Only the full strength carries the pressure of the last stage.
#[test]
fn the_stage_after_a_reduction_has_the_full_strength() {
    let after = "  - {name: more, steps: {count: 2}, factors: {push: 1.35}}\n";
    let Run { progress, every, .. } = block(CLAY, 101e3, &(reduction(1.0, 1.6, 0.005) + after));
    assert!(progress.last_strength().unwrap().fails.is_some());
    let reduced: Vec<_> = every.reports.iter().filter(|report| report.step.end > 2.0).collect();
    let intervals: Vec<_> = reduced.iter().map(|report| [report.step.start, report.step.end]).collect();
    assert_eq!(intervals, [[2.0, 2.5], [2.5, 3.0]], "the stage begins at its own time");
    assert!(reduced.iter().all(|report| report.strength_factor.is_none()));
    let base = every.reports.last().unwrap().reactions[1][1];
    assert!((base / (1.35 * 101e3) - 1.0).abs() < 1e-5, "{base}");
}

#[test]
fn a_strength_given_as_a_formula_is_reduced_like_a_number() {
    let formula = "{model: tresca, young: 1e11, poisson: 0.3, cohesion: \"70e3 + 0*Y\"}";
    let stages = reduction(1.0, 1.6, 0.001);
    let (constant, varying) = (block(CLAY, 101e3, &stages), block(formula, 101e3, &stages));
    let history = |run: &Run| run.model.materials[0].law.state_fields().len();
    assert_eq!(history(&varying), history(&constant) + 1, "every point has its own cohesion");
    assert_eq!(varying.progress.strength, constant.progress.strength);
}

/// The block stays elastic up to its factor of safety, so nothing moves after the displacement due to the load has been
/// reset.
#[test]
fn displacements_count_from_the_end_of_the_stage_before() {
    let clay = CLAY.replace("1e11", "1e7");
    let Run { points, every, .. } = block(&clay, 101e3, &reduction(1.0, 1.3, 0.005));
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    let moved = largest(&points.array(PointArray::Displacement).values);
    let before = every.reports[0].grid.delta_d.iter().map(|u| largest(u)).fold(0.0, f64::max);
    println!("{before:e} before, {moved:e} after");
    // A block whose top has left its grid line finds a slightly different equilibrium on a fresh grid.
    assert!(before > 0.005 && moved < 0.01 * before, "{before:e} {moved:e}");
}

/// A slope that yields before it fails, so that the sequence of steps matters.
const SLOPE: &str = "
version: 1
grid: {type: structured, origin: [0, 0], size: [18, 6], spacing: 1}
materials:
  soil: {model: mohr-coulomb, young: 1e8, poisson: 0.3, cohesion: 5e3, friction_angle: 20, dilation_angle: 0, density: 2000}
bodies:
  - name: slope
    material: soil
    shape: {type: polygon, vertices: [[0, 0], [16, 0], [6, 5], [0, 5]]}
    strain: mean-dilatation
    method: gimp
    points_per_cell: 2
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
stages:
  - {name: gravity, steps: {count: 2}, factors: {weight: 1}, then: {reset: [displacement]}}
  - {name: safety, steps: {count: 3, control: {type: strength-reduction, to: 2, tolerance: 0.05}}}
  - {name: after, steps: {count: 1}, factors: {weight: 0.9}}
";

/// A law that derives the plastic work from the equivalent plastic strain cannot know at which strength that strain
/// grew.
#[test]
fn plastic_work_is_that_of_the_strength_at_which_it_was_done() {
    let shared = "young: 1e8, poisson: 0.3, density: 2000";
    let given = "{model: mohr-coulomb, young: 1e8, poisson: 0.3, cohesion: 5e3, friction_angle: 20, dilation_angle: 0, density: 2000}";
    for strength in [
        "undrained_strength: 30e3",
        "undrained_strength: 30e3, hardening_modulus: 1e5",
        "undrained_strength: \"30e3 + 0*Y\"",
    ] {
        let clay = SLOPE.replace(given, &format!("{{model: von-mises, {strength}, {shared}}}"));
        assert_ne!(clay, SLOPE);
        let Run { summary, every, .. } = run(&clay);
        println!("{strength}: {:e} of {:e}", summary.energy_error(), summary.plastic_work);
        assert!(summary.plastic_work > 0.2 * summary.gross_work && summary.undone_work > 0.0);
        let missing = summary.energy_error() * summary.gross_work;
        println!("missing {missing:e}, undone {:e}", summary.undone_work);
        assert!(missing.abs() < 0.2 * summary.undone_work, "{strength}: {missing:e}");
        let work = every.reports.iter().map(|report| report.energy.plastic_work);
        assert!(work.is_sorted(), "it never decreases");
        resumes(&clay);
    }
}

#[test]
fn a_resumed_reduction_finds_the_same_bracket_with_the_same_bits() {
    resumes(SLOPE);
}

#[test]
fn a_reduction_has_the_same_bits_on_one_thread_and_on_two() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let deck = SLOPE.replace("tolerance: 0.05", "tolerance: 0.05, after_slide: continue");
        pool.install(|| run(&deck))
    };
    let (one, two) = (on(1), on(2));
    assert!(one.progress.last_strength().unwrap().fails.is_some(), "{:?}", one.progress.strength);
    assert_eq!(one.progress.strength, two.progress.strength);
    for array in [PointArray::Position, PointArray::CauchyStress, PointArray::Displacement] {
        let bits = |run: &Run| run.points.array(array).values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&one), bits(&two));
    }
}
