//! Ghost stabilisation: fields that it must not affect, its effect on the condition number, and analyses that need it.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the measured numbers are part of the verification")]

use std::path::Path;

use mpm::assembly::Wanted;
use mpm::basis::Connectivity;
use mpm::deck::build::build;
use mpm::deck::load::{load, load_text};
use mpm::dofs::DofMap;
use mpm::model::{Model, StabilisationMode};
use mpm::points::{Points, State};
use mpm::solver::{self, Observer, Reached, SolveError, StepReport};
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid};
use mpm::terms::Sum;
use mpm::terms::ghost::Ghost;
use nalgebra::DMatrix;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn plane(text: &str) -> (Model<2>, Points<2>) {
    build(&load_text(&format!("{ROOT}/deck.yaml"), text.as_bytes(), &[]).unwrap()).unwrap()
}

fn solid(text: &str) -> (Model<3>, Points<3>) {
    build(&load_text(&format!("{ROOT}/deck.yaml"), text.as_bytes(), &[]).unwrap()).unwrap()
}

fn link<const D: usize>(model: &Model<D>, points: &mut Points<D>) -> Connectivity<D> {
    let methods = model.methods();
    Connectivity::new(model.grid.as_ref(), points, &methods).unwrap()
}

/// Bodies cut by the grid everywhere, on all kinds of grids.
fn in_the_plane() -> Vec<(&'static str, String)> {
    let deck = |grid: &str, body: &str, analysis: &str| {
        format!(
            "version: 1
analysis: {{stabilisation: {{mode: on, parameter: 0.1}}{analysis}}}
grid: {grid}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, {body}}}]
boundary_conditions: [{{name: low, nodes: {{x: 0}}, fix: [x, y]}}]
steps: {{count: 1}}"
        )
    };
    let structured = "{type: structured, origin: [0, 0], size: [6, 6], spacing: [1, 0.75]}";
    let graded = "{type: structured, origin: [0, 0], size: [6, 6],
        spacing: [[{to: 2, cells: 4, ratio: 0.7}, {to: 6, cells: 5, ratio: 1.4}], [{to: 6, cells: 9, ratio: 1.2}]]}";
    let circle = "shape: {type: circle, center: [2.1, 2.9], radius: 1.7}, points_per_cell: 3";
    let mesh = |file: &str| format!("{{type: gmsh, file: tests/data/mesh/{file}}}");
    vec![
        ("rectangles, GIMP", deck(structured, &format!("{circle}, method: gimp"), "")),
        ("rectangles, MPM", deck(structured, &format!("{circle}, method: mpm"), "")),
        ("rectangles, CPDI2", deck(structured, &format!("{circle}, method: cpdi2"), "")),
        ("graded rectangles, MPM", deck(graded, &format!("{circle}, method: mpm"), "")),
        ("graded rectangles, GIMP", deck(graded, &format!("{circle}, method: gimp"), "")),
        (
            "triangles and quadrilaterals",
            deck(
                &mesh("mixed_4.1_text.msh"),
                "method: mpm, points_per_cell: 2, points_per_triangle: 4, shape: {type: cells, group: soil body}",
                "",
            )
            .replace("{x: 0}", "{group: left edge}"),
        ),
    ]
}

/// Largest component of the nodal forces due to a displacement increment, of their resultant, and their moment about z.
fn forces<const D: usize>(ghost: &Ghost, places: &[[f64; D]], field: impl Fn(usize) -> [f64; D]) -> [f64; 3] {
    let delta_d: Vec<[f64; D]> = (0..places.len()).map(field).collect();
    let mut force = vec![[0.0; D]; places.len()];
    ghost.add_force(D, &delta_d, &mut force);
    let largest = force.iter().flatten().fold(0.0f64, |m, f| m.max(f.abs()));
    let sum = (0..D).map(|d| force.iter().map(|f| f[d]).sum::<f64>().abs()).fold(0.0, f64::max);
    let moment: f64 = force.iter().zip(places).map(|(f, x)| x[0] * f[1] - x[1] * f[0]).sum();
    [largest, sum, moment.abs()]
}

fn leaves_uniform_strain_alone<const D: usize>(name: &str, model: &Model<D>, mut points: Points<D>) {
    let links = link(model, &mut points);
    let ghost = Ghost::new(model, &points, &links);
    assert!(ghost.n_faces() >= 4, "{name}: {} faces", ghost.n_faces());
    let places: Vec<[f64; D]> =
        links.active_nodes().iter().map(|n| model.grid.node_position(*n as usize)).collect();
    let rough = |n: usize| std::array::from_fn(|d| ((7 * n + 3 * d) as f64).sin());
    let [scale, sum, moment] = forces(&ghost, &places, rough);
    assert!(scale > 0.0 && sum < 1e-12 * scale && moment < 1e-11 * scale, "{name}: {scale} {sum} {moment}");
    let linear = |n: usize| {
        std::array::from_fn(|i| {
            0.3 + (0..D).map(|j| (1.0 + (i + 2 * j) as f64).cos() * places[n][j]).sum::<f64>()
        })
    };
    let [largest, ..] = forces(&ghost, &places, linear);
    assert!(largest < 1e-11 * scale, "{name}: {largest:e} of {scale:e}");
}

#[test]
fn uniform_strain_is_left_alone_and_forces_have_no_resultant() {
    for (name, text) in in_the_plane() {
        let (model, points) = plane(&text);
        leaves_uniform_strain_alone(name, &model, points);
    }
    for (name, file) in [("hexahedra", "block_hexahedra.msh"), ("tetrahedra", "block_tetrahedra.msh")] {
        let count = if name == "hexahedra" { "points_per_cell: 2" } else { "points_per_tetrahedron: 4" };
        let text = format!(
            "version: 1
analysis: {{idealisation: solid, stabilisation: {{mode: on}}}}
grid: {{type: gmsh, file: tests/data/mesh/{file}}}
materials: {{m: {{model: neo-hookean, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, method: mpm, shape: {{type: cells}}, {count}}}]
boundary_conditions: [{{name: low, nodes: {{z: 0}}, fix: [x, y, z]}}]
steps: {{count: 1}}"
        );
        let (model, points) = solid(&text);
        leaves_uniform_strain_alone(name, &model, points);
    }
    for method in ["mpm", "gimp", "cpdi2"] {
        let text = format!(
            "version: 1
analysis: {{idealisation: solid, stabilisation: {{mode: auto, filling: 0.5}}}}
grid: {{type: structured, origin: [0, 0, 0], size: [5, 5, 5], spacing: [1, 1, 0.5]}}
materials: {{m: {{model: neo-hookean, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, method: {method}, shape: {{type: sphere, center: [2, 2.2, 2.3], radius: 1.6}},
          points_per_cell: 2}}]
boundary_conditions: [{{name: low, nodes: {{x: 1}}, fix: [x, y, z]}}]
steps: {{count: 1}}"
        );
        let (model, points) = solid(&text);
        leaves_uniform_strain_alone(method, &model, points);
    }
}

/// f_int and K with and without stabilisation differ by its force and by the derivative of that force.
fn enters_force_and_stiffness_alike<const D: usize, M: Mechanics<D>>(
    mut model: Model<D>,
    mut points: Points<D>,
) {
    let links = link(&model, &mut points);
    let ghost = Ghost::new(&model, &points, &links);
    let n = links.n_active();
    let delta_d: Vec<[f64; D]> =
        (0..n).map(|n| std::array::from_fn(|d| 1e-3 * ((5 * n + d) as f64).cos())).collect();
    let rough: Vec<[f64; D]> =
        (0..n).map(|n| std::array::from_fn(|d| ((7 * n + 3 * d) as f64).sin())).collect();
    let mut evaluate = |model: &Model<D>| {
        let mut sum = Sum::from_model::<M>(&StepContext::first(model, &links), &points).unwrap();
        sum.evaluate(&StepContext::first(model, &links), &mut points, At::new(&delta_d), Wanted::Stiffness)
            .unwrap();
        let mut product = vec![[0.0; D]; n];
        sum.system_mut().multiply(&rough, &mut product);
        (sum.system().internal_force().to_vec(), product)
    };
    let (force, product) = evaluate(&model);
    model.stabilisation.mode = StabilisationMode::Off;
    let (force_without, product_without) = evaluate(&model);
    let (mut ghost_force, mut product_of_ghost) = (vec![[0.0; D]; n], vec![[0.0; D]; n]);
    ghost.add_force(D, &delta_d, &mut ghost_force);
    ghost.add_force(D, &rough, &mut product_of_ghost);
    for (with, without, ghost) in
        [(force, force_without, ghost_force), (product, product_without, product_of_ghost)]
    {
        let scale = with.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        for ((a, b), c) in with.iter().flatten().zip(without.iter().flatten()).zip(ghost.iter().flatten()) {
            assert!((a - b - c).abs() < 1e-13 * scale, "{a} {b} {c}");
        }
        assert!(ghost.iter().flatten().any(|g| g.abs() > 1e-6 * scale), "nothing is stabilised");
    }
}

#[test]
fn force_and_stiffness_belong_together() {
    for (_, text) in in_the_plane() {
        let (model, points) = plane(&text);
        enters_force_and_stiffness_alike::<2, PlaneStrain>(model, points);
    }
    let revolved =
        in_the_plane()[0].1.replace("mode: on, parameter: 0.1}", "mode: on}, idealisation: axisymmetric");
    let revolved = revolved.replace("fix: [x, y]", "fix: [x]").replace("center: [2.1", "center: [2.6");
    let (model, points) = plane(&revolved);
    enters_force_and_stiffness_alike::<2, Axisymmetric>(model, points);
    let (model, points) = solid(
        "version: 1
analysis: {idealisation: solid, stabilisation: {mode: on}}
grid: {type: structured, origin: [0, 0, 0], size: [4, 4, 4], spacing: 1}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e5}}
bodies: [{name: b, material: m, method: gimp, shape: {type: box, min: [0, 0, 0], max: [2.3, 2, 1.7]}, point_spacing: 0.1}]
boundary_conditions: [{name: low, nodes: {x: 0}, fix: [x, y, z]}]
steps: {count: 1}",
    );
    enters_force_and_stiffness_alike::<3, Solid>(model, points);
}

/// Condition number of the stiffness matrix of the unknowns.
fn condition<const D: usize, M: Mechanics<D>>(model: &Model<D>, points: &mut Points<D>) -> f64 {
    let links = link(model, points);
    let dofs = DofMap::<D>::new(model, points, &links, 0.0, 1.0).unwrap();
    let mut sum = Sum::from_model::<M>(&StepContext::first(model, &links), points).unwrap();
    let zero = vec![[0.0; D]; links.n_active()];
    sum.evaluate(&StepContext::first(model, &links), points, At::new(&zero), Wanted::Stiffness).unwrap();
    let mut k = DMatrix::zeros(dofs.n_free(), dofs.n_free());
    let (mut unit, mut column) = (zero.clone(), zero);
    for (b, m) in (0..links.n_active()).flat_map(|b| (0..D).map(move |m| (b, m))) {
        let Some(j) = dofs.free(b, m) else { continue };
        unit[b][m] = 1.0;
        sum.system_mut().multiply(&unit, &mut column);
        unit[b][m] = 0.0;
        for (a, entries) in column.iter().enumerate() {
            for (i, entry) in entries.iter().enumerate() {
                if let Some(i) = dofs.free(a, i) {
                    k[(i, j)] = *entry;
                }
            }
        }
    }
    let eigenvalues = k.symmetric_eigenvalues();
    eigenvalues.max() / eigenvalues.min().max(1e-300)
}

/// A bar that extends into the next cell by the fraction `filling` of the cell.
fn bar(method: &str, filling: f64) -> (Model<2>, Points<2>) {
    let (model, mut points) = plane(&format!(
        "version: 1
grid: {{type: structured, origin: [0, 0], size: [8, 4], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, method: {method}, shape: {{type: box, min: [0, 1], max: [4, 3]}}, points_per_cell: 2}}]
boundary_conditions: [{{name: low, nodes: {{x: 0}}, fix: [x, y]}}]
steps: {{count: 1}}"
    ));
    // Standard points contribute to a cell only once they have crossed the grid line. The reference is a full cell.
    let shift = match (filling < 1.0, method) {
        (false, _) => 0.0,
        (true, "mpm") => 0.25 + filling,
        (true, _) => filling,
    };
    for position in &mut points.converged.position {
        position[0] += shift;
    }
    for corner in &mut points.converged.corners {
        corner[0] += shift;
    }
    (model, points)
}

/// Condition number for filling ratios from 1 to 1e-12. Without stabilisation it is unbounded; with it, it is at
/// most the value for full cells times the reciprocal of the parameter.
#[test]
fn condition_does_not_depend_on_how_cells_are_cut() {
    println!("filling: condition without and with stabilisation, `auto` and `on`");
    for method in ["mpm", "gimp", "cpdi2"] {
        let mut largest = [0.0f64; 3];
        for exponent in 0..=12 {
            let filling = 10f64.powi(-exponent);
            let conditions =
                [StabilisationMode::Off, StabilisationMode::Auto, StabilisationMode::On].map(|mode| {
                    let (mut model, mut points) = bar(method, filling);
                    model.stabilisation.mode = mode;
                    condition::<2, PlaneStrain>(&model, &mut points)
                });
            println!(
                "{method} {filling:.0e}: {:.1e} {:.1e} {:.1e}",
                conditions[0], conditions[1], conditions[2]
            );
            for (largest, condition) in largest.iter_mut().zip(conditions) {
                *largest = largest.max(condition);
            }
        }
        // The standard method has no slivers: a point that has crossed the grid line strains the far nodes at once.
        assert!(method == "mpm" || largest[0] > 1e9, "{method}: {:.1e} without", largest[0]);
        assert!(largest[1] < 1e6 && largest[2] < 1e6, "{method}: {:.1e} {:.1e}", largest[1], largest[2]);
    }
}

#[derive(Default)]
struct Recorder {
    tip: Vec<[f64; 2]>,
    residuals: Vec<Vec<f64>>,
}

impl Observer<2> for Recorder {
    fn converged(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.residuals.push(report.residuals.clone());
        if let Some(probe) = model.probes.first() {
            let place = points.by_id();
            let moved = |id: &u32, d: usize| {
                let p = place[*id as usize];
                points.converged.position[p][d] - points.original_position[p][d]
            };
            let n = probe.points.len() as f64;
            self.tip.push([0, 1].map(|d| probe.points.iter().map(|id| moved(id, d)).sum::<f64>() / n));
        }
        Ok(())
    }
}

/// The stabilisation of a ring or a column of one material or of several.
fn body_stabilisation(materials: &str, bodies: &str) -> Ghost {
    let deck = format!(
        "version: 1
analysis: {{stabilisation: {{mode: on}}}}
grid: {{type: structured, origin: [0, 0], size: [4, 8], spacing: 0.5}}
materials: {{{materials}}}
bodies: [{bodies}]
boundary_conditions: [{{name: low, nodes: {{y: 0}}, fix: [x, y]}}]
steps: {{count: 1}}"
    );
    let (model, mut points) = plane(&deck);
    let links = link(&model, &mut points);
    Ghost::new(&model, &points, &links)
}

/// The stiffness of all faces in the order of faces.
fn stiffness(ghost: &Ghost) -> Vec<f64> {
    (0..ghost.n_faces()).flat_map(|face| ghost.stiffness_of(face).to_vec()).collect()
}

/// Two layers are stabilised alike whether they are two bodies or one whose stiffness is a formula.
#[test]
fn a_stiffness_that_varies_is_that_of_the_points() {
    let one = body_stabilisation(
        "m: {model: hencky, young: 'if(Y > 5, 1e3, 1e7)', poisson: 0.3}",
        "{name: a, material: m, shape: {type: box, min: [0, 0], max: [2, 6]}, points_per_cell: 2}",
    );
    let two = body_stabilisation(
        "m: {model: hencky, young: 1e7, poisson: 0.3}, s: {model: hencky, young: 1e3, poisson: 0.3}",
        "{name: b, material: m, shape: {type: box, min: [0, 0], max: [2, 5]}, points_per_cell: 2},
         {name: a, material: s, shape: {type: box, min: [0, 5], max: [2, 6]}, points_per_cell: 2}",
    );
    let (one, two) = (stiffness(&one), stiffness(&two));
    assert!(one.len() == two.len() && one.len() > 100, "{} {}", one.len(), two.len());
    let (least, most) =
        one.iter().filter(|k| **k > 0.0).fold((f64::MAX, 0.0f64), |(a, b), k| (a.min(*k), b.max(*k)));
    assert!(most > 1e3 * least, "{least} {most}");
    for (one, two) in one.iter().zip(&two) {
        assert!((one - two).abs() <= 1e-12 * one.abs().max(two.abs()) + 1e-16 * most, "{one} {two}");
    }
}

/// A formula need not make sense in the hole of a ring, where the ring has no points.
#[test]
fn the_stiffness_where_a_body_has_a_hole_does_not_matter() {
    let ring = |model: &str, young: &str, strength: &str| {
        let ring = "{name: a, material: m, shape: {type: annulus, center: [2, 2], inner: 0.75, outer: 1.7}, \
                    points_per_cell: 2}";
        body_stabilisation(&format!("m: {{model: {model}, young: '{young}', poisson: 0.3{strength}}}"), ring)
    };
    for (young, twin) in [
        ("1e6*ln(hypot(X - 2, Y - 2)/0.5)", "1e6*ln(max(hypot(X - 2, Y - 2), 0.6)/0.5)"),
        ("1e5/hypot(X - 2, Y - 2)", "1e5/max(0.1, hypot(X - 2, Y - 2))"),
        ("1e6*(hypot(X - 2, Y - 2) - 0.6)", "1e6*(max(hypot(X - 2, Y - 2), 0.7) - 0.6)"),
    ] {
        for (model, strength) in [("hencky", ""), ("tresca", ", cohesion: '1e4*(hypot(X - 2, Y - 2) - 0.6)'")]
        {
            let ghost = ring(model, young, strength);
            assert!(ghost.n_faces() > 20 && stiffness(&ghost).iter().all(|k| k.is_finite()), "{young}");
            assert_eq!(ghost, ring(model, twin, strength), "{young}");
        }
    }
}

/// At a seam, the true displacement gradient jumps: the penalty must not couple a soft layer to the stiff one below
/// it. With the arithmetic mean of the moduli, the top would sink by 39 % of what it should.
#[test]
fn a_soft_layer_on_a_stiff_one_sinks_as_without_stabilisation() {
    let sinks = |mode: &str| {
        let deck = format!(
            "version: 1
analysis: {{stabilisation: {{mode: {mode}}}}}
grid: {{type: structured, origin: [0, 0], size: [1, 3], spacing: 0.5}}
materials: {{stiff: {{model: hencky, young: 1e11, poisson: 0}}, soft: {{model: hencky, young: 1e5, poisson: 0}}}}
bodies:
  - {{name: below, material: stiff, shape: {{type: box, min: [0, 0], max: [1, 1]}}, method: gimp, points_per_cell: 1}}
  - {{name: above, material: soft, shape: {{type: box, min: [0, 1], max: [1, 2]}}, method: gimp, points_per_cell: 1}}
boundary_conditions:
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 1}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
loads: [{{name: press, type: body-force, force: [0, -1000], bodies: [above]}}]
steps: {{count: 1}}"
        );
        let (model, mut points) = plane(&deck);
        solver::run(&model, &mut points, &mut Recorder::default()).unwrap();
        let State { position, .. } = &points.converged;
        (0..points.len()).map(|p| points.original_position[p][1] - position[p][1]).fold(0.0, f64::max)
    };
    let (with, without) = (sinks("auto"), sinks("off"));
    // Three quarters of the weight of the layer compress its lower cell by 750 · 0.5/1e5; its upper cell adds to that.
    assert!(without > 3.7e-3, "{without}");
    assert!((with - without).abs() < 1e-3 * without, "{with} {without}");
}

/// Runs a deck of `inputs/` without cutting steps.
fn run(deck: &str, set: &[(&str, &str)], mode: StabilisationMode) -> (Result<Reached, SolveError>, Recorder) {
    let set: Vec<_> = set.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let path = Path::new(ROOT).join("inputs").join(deck);
    let (mut model, mut points): (Model<2>, Points<2>) = build(&load(&path, &set).unwrap()).unwrap();
    model.stabilisation.mode = mode;
    model.stepping.smallest = 1.0;
    let mut recorder = Recorder::default();
    let outcome = solver::run(&model, &mut points, &mut recorder);
    (outcome, recorder)
}

/// With stabilisation, the beam cases (section 7.3) that fail at nearly empty cells succeed, and the Newton iterations
/// stay quadratic: no step needs more than six solves.
#[test]
fn the_beam_does_not_stumble_over_nearly_empty_cells() {
    for (method, n) in [("gimp", "2"), ("gimp", "3"), ("gimp", "6"), ("mpm", "2"), ("mpm", "3"), ("mpm", "6")]
    {
        let set = [("method", method), ("n", n)];
        let (plain, without) = run("beam.yaml", &set, StabilisationMode::Off);
        let (outcome, with) = run("beam.yaml", &set, StabilisationMode::Auto);
        outcome.unwrap();
        let most = |r: &Recorder| r.residuals.iter().map(|r| r.len() - 1).max().unwrap_or(0);
        let tip = |r: &Recorder| r.tip.last().copied().unwrap_or_default();
        println!(
            "{method} {n}²: without {} steps, at most {} solves, tip {:.4?}; with {} steps, {}, {:.4?}",
            without.residuals.len(),
            most(&without),
            tip(&without),
            with.residuals.len(),
            most(&with),
            tip(&with)
        );
        assert!(most(&with) <= 6, "{method} {n}²: {}", most(&with));
        match (method, n) {
            ("gimp", "2") => assert!(plain.is_err()),
            // This case struggles too, but round-off decides whether it fails: with Young's modulus changed by 1e-15,
            // one run in four succeeds.
            ("gimp", "3") => continue,
            _ => assert!(plain.is_ok(), "{method} {n}²"),
        }
        if plain.is_ok() {
            // The beam is 10 m long: the deflection changes by less than 0.2 % of its length.
            let [a, b] = [tip(&with), tip(&without)];
            assert!((a[1] - b[1]).abs() < 0.02, "{method} {n}²: {a:?} {b:?}");
        }
    }
}
