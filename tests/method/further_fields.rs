//! Point fields that a single analysis declares, in steps, files, checkpoints and resumed runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use mpm::assembly::{System, Wanted};
use mpm::deck::advice::Means;
use mpm::deck::build::build;
use mpm::deck::load::load;
use mpm::model::Model;
use mpm::output::checkpoint;
use mpm::output::lock::Lock;
use mpm::output::results::{Request, Results};
use mpm::output::summary::{Account, Start};
use mpm::points::{FieldKind, PointFieldSpec, Points};
use mpm::solver::Stepper;
use mpm::step::{At, StepContext};
use mpm::terms::{BeginError, Character, EvaluateError, Ledger, NamedEnergy, Term, TermReport};
use mpm::timing::Timings;
use vtkio::IOBuffer;
use vtkio::model::Attribute;

use crate::inline_vtu::read;

const STEPS: usize = 20;

/// A term without force that sums the distance that each point travels along each axis, and counts its steps.
struct Way;

impl Term<2> for Way {
    fn name(&self) -> &'static str {
        "way"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, _: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<2>,
        _: Wanted,
        _: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        let (way, age) = (points.further.handle("way").unwrap(), points.further.handle("age").unwrap());
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let mut u = [0.0; 2];
                step.links.for_each_value(p, |local, value| {
                    (0..2).for_each(|d| u[d] += value * at.delta_d[nodes[local] as usize][d]);
                });
                for d in 0..2 {
                    let before = points.further.converged(way)[2 * p + d];
                    points.further.trial_mut(way)[2 * p + d] = before + u[d].abs();
                }
                let before = points.further.converged(age)[p];
                points.further.trial_mut(age)[p] = before + 1.0;
            }
        }
        Ok(())
    }

    fn ledger(&self, step: &StepContext<2>, _: &Points<2>, _: At<2>) -> Ledger {
        let steps = step.step.index as f64;
        [NamedEnergy::dissipated("wear", 0.25), NamedEnergy::stored("coil", [steps + 1.0, steps + 2.0])]
            .into()
    }

    fn report(&self, _: &Model<2>, report: &mut TermReport<2>) {
        report.add_force("drag", [1.0, -2.5]);
        report.add_force("drag", [0.5, 0.0]);
    }
}

/// The first steps of the collapse, whose points change cells.
fn analysis() -> (Model<2>, Points<2>) {
    let set = [("h", "0.5"), ("n", "2"), ("method", "gimp")].map(|(k, v)| (k.to_owned(), v.to_owned()));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs/collapse.yaml");
    let (mut model, mut points) = build::<2>(&load(&path, &set).unwrap()).unwrap();
    model.stepping.end_time *= STEPS as f64 / model.stepping.count as f64;
    model.stepping.count = STEPS;
    let n = points.len();
    let mut declare = |name: &str, kind, components, start: &dyn Fn(usize) -> f64| {
        let (name, unit, start) = (name.to_owned(), "-".to_owned(), (0..n * components).map(start).collect());
        points.declare(PointFieldSpec { name, unit, components, kind, start }).unwrap();
    };
    declare("initial_stress", FieldKind::Fixed, 6, &|k| k as f64 + 0.5);
    declare("way", FieldKind::Answer, 2, &|_| 0.0);
    declare("age", FieldKind::Motion, 1, &|k| 100.0 * k as f64);
    (model, points)
}

fn account() -> Account {
    Account {
        deck: Some(serde_json::json!({"version": 1})),
        files_hash: String::new(),
        law_libraries: Vec::new(),
        start: Start::now(),
        deck_hash: String::new(),
        deck_file: String::new(),
        deck_text: String::new(),
        parameters: BTreeMap::new(),
        units: None,
        messages: Vec::new(),
        set_up: Timings::default(),
        threads: 1,
        wording: std::sync::Arc::new(Means::default()),
    }
}

/// The values of a point array in a file, and the number per point.
fn array(path: &Path, name: &str) -> (u32, Vec<f64>) {
    let piece = read(path);
    let found = piece.data.point.iter().find(|array| array.name() == name).unwrap();
    match found {
        Attribute::DataArray(array) => match &array.data {
            IOBuffer::F64(values) => (array.elem.num_comp(), values.clone()),
            _ => panic!("{name} has no numbers of 64 bits"),
        },
        Attribute::Field { .. } => panic!("{name} is a field"),
    }
}

#[test]
fn further_fields_survive_grouping_commit_checkpoint_and_resumption_and_are_in_files() {
    let directory: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("further_fields");
    let _ = fs::remove_dir_all(&directory);
    let (model, mut points) = analysis();
    let forces = vec!["drag".to_owned(), "lift".to_owned()];
    let energies = ["wear", "coil", "heat"].map(String::from).to_vec();
    let asked = Request { checkpoints: Some(1), forces, energies, ..Request::default() };
    let mut files = Results::create(&directory, &asked, &model, account()).unwrap();
    let started = points.id.clone();
    let stepper = Stepper::new(&model, &mut points).with_terms(vec![Box::new(Way)]).unwrap();
    stepper.run(&mut files).unwrap();
    drop(files);
    assert_ne!(points.id, started, "the points have changed their order");

    // The fields follow the points and the committed steps.
    let n = points.len();
    let field = |points: &Points<2>, name: &str| points.field(name).unwrap().values;
    assert_eq!(field(&points, "initial_stress"), (0..6 * n).map(|k| k as f64 + 0.5).collect::<Vec<_>>());
    let steps = field(&points, "age")[0];
    assert!(steps >= STEPS as f64);
    assert_eq!(field(&points, "age"), (0..n).map(|k| 100.0 * k as f64 + steps).collect::<Vec<_>>());
    let displacement = points.array(mpm::points::PointArray::Displacement).values;
    let way = field(&points, "way");
    let is_shorter = |(u, way): (&f64, &f64)| u.abs() <= way * (1.0 + 1e-12) + 1e-15;
    assert!(displacement.iter().zip(&way).all(is_shorter));
    assert!(displacement.iter().zip(&way).any(|(u, way)| u.abs() > 0.999 * way && *way > 1e-3));
    assert_eq!(model.array(&points, "way").unwrap().values, way);

    // The history has the force that the term reports; no term reports the other one.
    let history = fs::read_to_string(directory.join("history.csv")).unwrap();
    let mut lines = history.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let columns = lines.next().unwrap();
    let of = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let [drag, lift] = [["drag_fx", "drag_fy"], ["lift_fx", "lift_fy"]].map(|names| names.map(of));
    let rows: Vec<_> = lines.collect();
    assert!(rows.len() >= STEPS);
    let [wear, coil, heat] = ["wear_energy", "coil_energy", "heat_energy"].map(of);
    for (row, steps) in rows.iter().zip(1..) {
        // The energy of all steps so far, and that of the state; no term reports the third energy.
        let steps = f64::from(steps);
        let energies = [wear, coil].map(|column| row[column].parse::<f64>().unwrap());
        assert_eq!((energies, row[heat]), ([0.25 * steps, steps + 2.0], ""));
        assert_eq!(drag.map(|column| row[column].parse::<f64>().unwrap()), [1.5, -2.5]);
        assert_eq!(lift.map(|column| row[column]), [""; 2]);
    }

    let summary = fs::read_to_string(directory.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(
        summary["energies"],
        serde_json::json!([
            {"name": "wear", "role": "dissipated", "energy": 0.25 * steps},
            {"name": "coil", "role": "stored", "energy": steps + 2.0, "at_start": 2.0},
        ])
    );

    // The files contain the fields under their names, at the start and at the end.
    for (file, steps) in [("points_0000.vtu", 0.0), (&format!("points_{:04}.vtu", steps as usize), steps)] {
        let file = directory.join(file);
        assert_eq!(array(&file, "initial_stress"), (6, field(&points, "initial_stress")));
        assert_eq!(array(&file, "age"), (1, (0..n).map(|k| 100.0 * k as f64 + steps).collect()));
        let way = if steps > 0.0 { way.clone() } else { vec![0.0; 2 * n] };
        assert_eq!(array(&file, "way"), (2, way));
    }
    // Arrays requested by name have the order and the meaning of those in the files.
    let last = directory.join(format!("points_{:04}.vtu", steps as usize));
    for name in
        ["deformation_gradient", "cauchy_stress", "elastic_strain", "volume", "equivalent_plastic_strain"]
    {
        let found = model.array(&points, name).unwrap();
        assert_eq!(array(&last, name), (found.components as u32, found.values), "{name}");
    }
    assert!(
        model.array(&points, "equivalent_plastic_strain").unwrap().values.iter().any(|kappa| *kappa > 0.0)
    );
    assert_eq!(model.array(&points, "von_mises_stress"), None);
    let text = crate::inline_vtu::parts(&directory.join("points_0000.vtu")).0;
    let tag = text.lines().find(|line| line.contains(r#"Name="initial_stress""#)).unwrap();
    assert!(tag.contains(r#"ComponentName3="XY""#), "{tag}");

    // Resumed from the step before the last, the analysis ends with the same bits.
    let before = directory.join(format!("checkpoint_{:04}.mpm", steps as usize - 1));
    let checkpoint = checkpoint::read(&before).unwrap();
    let (model, mut resumed) = analysis();
    checkpoint.restore(&model, &mut resumed).unwrap();
    assert_eq!(field(&resumed, "age")[0], steps - 1.0);
    let reached = checkpoint.head.reached.clone();
    // The history goes on with the same columns, and is refused with others.
    let resume = |asked: &Request| {
        let lock = Lock::take(&directory).unwrap();
        Results::resume(&directory, lock, asked, &model, account(), &checkpoint, reached.progress.step)
    };
    let refused = resume(&Request { forces: Vec::new(), ..asked.clone() }).err().unwrap().to_string();
    assert!(refused.contains("columns"), "{refused}");
    let mut files = resume(&asked).unwrap();
    let stepper = Stepper::new(&model, &mut resumed).with_terms(vec![Box::new(Way)]).unwrap();
    stepper.resume(reached).unwrap().run(&mut files).unwrap();
    drop(files);
    assert_eq!(fs::read_to_string(directory.join("history.csv")).unwrap(), history);
    assert_eq!((&resumed.id, &resumed.converged), (&points.id, &points.converged));
    for name in ["initial_stress", "way", "age"] {
        let bits = |points: &Points<2>| field(points, name).iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&resumed), bits(&points), "{name}");
    }
}
