//! Results do not depend on the units: in units that differ by powers of four, the results agree to the last bit, from
//! the smallest to the largest accepted values. (With a factor of two, the square roots in the factorisation would not
//! scale exactly.)

#![allow(clippy::unwrap_used)]

use mpm::deck::load::load_text;
use mpm::deck::ready::{Analysis, ready};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Observer, Reached, StepReport};

/// Quantities compared between runs, without their units.
#[derive(Debug, Default, PartialEq)]
struct Record {
    residuals: Vec<f64>,
    positions: Vec<f64>,
    stresses: Vec<f64>,
    reactions: Vec<f64>,
    works: Vec<f64>,
}

/// Records every step in units of length and stress.
struct Recorder {
    length: f64,
    stress: f64,
    record: Record,
}

impl<const D: usize> Observer<D> for Recorder {
    fn converged(
        &mut self,
        _: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        Reached { summary, .. }: &Reached,
    ) -> std::io::Result<()> {
        let force = self.stress * self.length.powi(D as i32 - 1);
        let energy = force * self.length;
        let record = &mut self.record;
        record.residuals.extend(&report.residuals);
        record.positions.extend(points.converged.position.as_flattened().iter().map(|x| x / self.length));
        record
            .stresses
            .extend(points.converged.kirchhoff_stress.iter().flat_map(|t| t.0).map(|t| t / self.stress));
        record.reactions.extend(report.reactions.as_flattened().iter().map(|r| r / force));
        let works =
            [summary.external_work, summary.regridding_work, summary.strain_energy, summary.plastic_work];
        record.works.extend(works.map(|work| work / energy));
        Ok(())
    }
}

/// A cantilever under its own weight, in units of 2^`length` and 2^`stress`.
fn run(dimensions: usize, material: &str, method: &str, [length, stress]: [i32; 2]) -> Record {
    let (l, s) = (2.0_f64.powi(length), 2.0_f64.powi(stress));
    let extended = |values: &[f64]| -> String {
        let numbers: Vec<String> = values[..dimensions].iter().map(|x| format!("{:e}", x * l)).collect();
        format!("[{}]", numbers.join(", "))
    };
    let strength = format!("deviatoric_yield_stress: {:e}, hardening_modulus: {:e}", 4e4 * s, 1e5 * s);
    let strength = if material == "von-mises" { strength } else { String::new() };
    let (idealisation, force, axes) = match dimensions {
        2 => ("plane-strain", format!("[0, {:e}]", -2e3 * s / l), "x, y"),
        _ => ("solid", format!("[0, {:e}, {:e}]", -1e3 * s / l, -2e3 * s / l), "x, y, z"),
    };
    let deck = format!(
        "version: 1
analysis: {{idealisation: {idealisation}, stabilisation: {{mode: auto}}}}
grid: {{type: structured, origin: {}, size: {}, spacing: {:e}}}
materials: {{m: {{model: {material}, young: {:e}, poisson: 0.25, {strength}}}}}
bodies:
  - {{name: b, material: m, shape: {{type: box, min: {}, max: {}}}, method: {method}, points_per_cell: 2}}
boundary_conditions: [{{name: wall, nodes: {{x: 0}}, fix: [{axes}]}}]
loads: [{{name: weight, type: body-force, force: {force}}}]
output: {{probes: [{{name: tip, body: b, nearest: {}}}]}}
steps: {{count: 3}}
",
        extended(&[0.0, -2.0, -2.0]),
        extended(&[4.0, 4.0, 4.0]),
        0.5 * l,
        1e6 * s,
        extended(&[0.0, 0.0, 0.0]),
        extended(&[2.0, 1.0, 1.0]),
        extended(&[2.0, 1.0, 1.0]),
    );
    let loaded = load_text("deck", deck.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
    let mut analysis: Analysis = ready(&loaded, None).unwrap().analysis;
    let mut recorder = Recorder { length: l, stress: s, record: Record::default() };
    let nothing = analysis.beginning();
    analysis.run(nothing, &mut recorder).unwrap_or_else(|error| panic!("{length} {stress}: {error}"));
    recorder.record
}

#[test]
fn results_are_the_same_in_all_units() {
    let plane = [("hencky", "gimp"), ("neo-hookean", "mpm"), ("von-mises", "cpdi2"), ("hencky", "cpdi1")];
    let cases =
        plane.map(|case| (2, case)).into_iter().chain([(3, ("von-mises", "mpm")), (3, ("hencky", "cpdi2"))]);
    for (dimensions, (material, method)) in cases {
        let own = run(dimensions, material, method, [0, 0]);
        assert!(own.residuals.len() > 6 && own.works[0] > 0.0);
        // Lengths from 1e-12 to 1e12; stresses over the whole accepted range.
        for scale in [[40, 0], [-40, 0], [0, 400], [0, -400], [6, -4], [40, -100], [-40, 100]] {
            let other = run(dimensions, material, method, scale);
            assert!(own == other, "{material} {method} in units of 2^{scale:?}");
        }
    }
}

/// Loads too large for any equilibrium end in an error; a load near the smallest number does not.
#[test]
fn loads_without_measure_are_errors() {
    for force in ["1e200", "1e308", "-1e308", "1e-320"] {
        let deck = format!(
            "version: 1
grid: {{type: structured, origin: [0, 0], size: [3, 3], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.25}}}}
bodies: [{{name: b, material: m, shape: {{type: box, min: [0, 0], max: [1, 1]}}, method: mpm, points_per_cell: 2}}]
boundary_conditions: [{{name: base, nodes: {{y: 0}}, fix: [x, y]}}]
loads: [{{name: push, type: body-force, force: [{force}, 0]}}]
steps: {{count: 1}}"
        );
        let loaded = load_text("deck", deck.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
        let mut analysis = ready(&loaded, None).unwrap().analysis;
        let nothing = analysis.beginning();
        let outcome = analysis.run(nothing, &mut mpm::solver::Silent);
        match outcome {
            Ok(reached) => assert!(force == "1e-320" && reached.summary.external_work.is_finite()),
            Err(error) => assert!(error.code().is_some() && force != "1e-320", "{force}: {error}"),
        }
    }
}
