use super::*;
use mpm_core::points::{PointFieldSpec, State};
use mpm_core::ranks::threads;
use mpm_core::solver::{Progress, Summary};
use mpm_deck::load::load;
use mpm_deck::ready::{Analysis, ready_on};

/// The collapse, whose points have a domain and a history.
fn analysis() -> (Value, Model<2>, Points<2>) {
    analysis_on(&Ranks::default())
}

/// The same analysis, divided between ranks.
fn analysis_on(ranks: &Ranks) -> (Value, Model<2>, Points<2>) {
    let set = [("h", "1"), ("n", "2"), ("method", "cpdi2")].map(|(k, v)| (k.to_owned(), v.to_owned()));
    let loaded = load(Path::new("../../inputs/collapse.yaml"), &set).unwrap();
    let Analysis::Plane(parts) = ready_on(ranks, &loaded, None).unwrap().analysis else { panic!() };
    let (model, points) = *parts;
    (serde_json::to_value(&loaded.deck).unwrap(), model, points)
}

fn reached(step: usize) -> Reached {
    let summary = Summary { steps: step, external_work: 0.1 + 0.2, ..Summary::default() };
    let step = Step { index: step, start: 0.1, end: 1.0 / 3.0 };
    Reached { progress: Progress { step, ..Progress::default() }, summary }
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_last_two_are_kept_and_read_back_exactly() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, model, mut points) = analysis();
    for (step, stress) in [(9, 0.1), (10, 1.0 / 3.0), (10000, -5e-324)] {
        points.converged.kirchhoff_stress[7].0[2] = stress;
        points.converged.position[3] = [stress, 0.25];
        write(directory.path(), &deck, "f", &reached(step), &Findings::default(), &points).unwrap();
    }
    assert_eq!(names(directory.path()), ["checkpoint_0010.mpm", "checkpoint_10000.mpm"]);
    let (found, refused) = latest(directory.path(), &Ranks::default()).unwrap();
    let found = found.unwrap();
    assert!(refused.is_empty());
    assert_eq!((found.head.reached.clone(), &found.head.deck), (reached(10000), &deck));
    // Restored into points in another order.
    let mut others = analysis().2;
    let mut order: Vec<u32> = (0..others.len() as u32).rev().collect();
    order.swap(1, 5);
    let (cell, state) = (others.cell.clone(), others.converged.clone());
    others.restore(&order, cell, state).unwrap();
    found.restore(&model, &mut others).unwrap();
    assert_eq!((&others.id, &others.cell), (&points.id, &points.cell));
    assert_eq!(others.converged, points.converged);
    assert_eq!((&others.mass, &others.original_position), (&points.mass, &points.original_position));
    assert_eq!(others.original_corners, points.original_corners);
}

/// Number, mass and a stress of each point that `n` ranks restore from the last checkpoint, the step of this
/// checkpoint, and the refused files.
fn restored(directory: &Path, n: usize) -> (Vec<(u32, f64, f64)>, usize, Vec<String>) {
    let by_rank = threads::run(n, |ranks| {
        let (_, model, mut points) = analysis_on(&ranks);
        let (found, refused) = latest(directory, &ranks).unwrap();
        let found = found.unwrap();
        found.restore(&model, &mut points).unwrap();
        let here = |cell: &u32| {
            ranks.is_alone() || points.partition.rank_of(model.grid.as_ref(), *cell) == ranks.own()
        };
        assert!(points.cell.iter().all(here));
        let state = |p: usize| (points.id[p], points.mass[p], points.converged.kirchhoff_stress[p].0[2]);
        let states: Vec<_> = (0..points.len()).map(state).collect();
        (states, found.step().index, refused.iter().map(ToString::to_string).collect::<Vec<_>>())
    });
    let (step, refused) = (by_rank[0].1, by_rank[0].2.clone());
    assert!(by_rank.iter().all(|found| (found.1, &found.2) == (step, &refused)));
    let mut all: Vec<(u32, f64, f64)> = by_rank.into_iter().flat_map(|found| found.0).collect();
    all.sort_by_key(|(id, ..)| *id);
    (all, step, refused)
}

#[test]
fn any_number_of_ranks_reads_the_pieces_of_others() {
    let directory = tempfile::tempdir().unwrap();
    threads::run(3, |ranks| {
        let (deck, _, mut points) = analysis_on(&ranks);
        for step in [9, 10, 11] {
            for p in 0..points.len() {
                points.converged.kirchhoff_stress[p].0[2] = 0.1 * (step as f64 + f64::from(points.id[p]));
            }
            write(directory.path(), &deck, "f", &reached(step), &Findings::default(), &points).unwrap();
            // Without this, a rank may begin the next checkpoint while the first rank still writes this one.
            ranks.any(false);
        }
    });
    let files =
        ["10.mpm", "10_r0.mpm", "10_r1.mpm", "10_r2.mpm", "11.mpm", "11_r0.mpm", "11_r1.mpm", "11_r2.mpm"];
    assert_eq!(names(directory.path()), files.map(|end| format!("checkpoint_00{end}")));
    let whole = analysis().2;
    let expected = |step: f64| -> Vec<(u32, f64, f64)> {
        whole
            .by_id()
            .into_iter()
            .map(|p| (whole.id[p], whole.mass[p], 0.1 * (step + f64::from(whole.id[p]))))
            .collect()
    };
    for n in [1, 2, 3, 4] {
        assert_eq!(restored(directory.path(), n), (expected(11.0), 11, Vec::new()), "{n} ranks");
    }
    // A piece that is damaged, missing or from another checkpoint is noticed, whatever the number of ranks.
    let piece = directory.path().join("checkpoint_0011_r2.mpm");
    let good = fs::read(&piece).unwrap();
    let other = fs::read(directory.path().join("checkpoint_0010_r2.mpm")).unwrap();
    for (content, reason) in [
        (Some(&good[..good.len() - 9]), "its piece `checkpoint_0011_r2.mpm`: "),
        (Some(&other[..]), "its piece `checkpoint_0011_r2.mpm` does not belong to `checkpoint_0011.mpm`"),
        (None, "its piece `checkpoint_0011_r2.mpm`: "),
    ] {
        match content {
            Some(content) => fs::write(&piece, content).unwrap(),
            None => fs::remove_file(&piece).unwrap(),
        }
        for n in [1, 2, 4] {
            let (points, step, refused) = restored(directory.path(), n);
            assert_eq!((points, step), (expected(10.0), 10), "{n} ranks");
            assert!(refused.len() == 1 && refused[0].contains(reason), "{refused:?}");
        }
    }
}

#[test]
fn damaged_files_are_refused_by_name_and_the_one_before_is_used() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, _, points) = analysis();
    for step in [1, 2] {
        write(directory.path(), &deck, "f", &reached(step), &Findings::default(), &points).unwrap();
    }
    let path = directory.path().join("checkpoint_0002.mpm");
    let good = fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let (found, refused) = latest(directory.path(), &Ranks::default()).unwrap();
        assert_eq!(found.unwrap().step().index, 1);
        assert_eq!(refused.len(), 1);
        let text = refused[0].to_string();
        assert!(text.contains("checkpoint_0002.mpm"), "{text}");
        refused[0].reason.clone()
    };
    for end in (0..good.len()).step_by(97) {
        refused(&good[..end]);
    }
    for (place, bit) in (0..good.len()).step_by(61).zip((0..8).cycle()) {
        let mut bytes = good.clone();
        bytes[place] ^= 1 << bit;
        refused(&bytes);
    }
    assert!(refused(b"").contains("checksum"));
    assert!(refused(b"PNG").contains("not a checkpoint") || refused(b"PNG").contains("checksum"));
    let mut other = good.clone();
    other[NAME_LENGTH] = b'7';
    assert_eq!(refused(&other), "it has version 7 of the format, but this program reads 6");
    fs::write(&path, &good).unwrap();
    assert_eq!(latest(directory.path(), &Ranks::default()).unwrap().0.unwrap().step().index, 2);
}

/// Length of the name of the format, and thus the offset of the version.
const NAME_LENGTH: usize = "mpm checkpoint ".len();

#[test]
fn points_of_another_kind_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, model, points) = analysis();
    write(directory.path(), &deck, "f", &reached(1), &Findings::default(), &points).unwrap();
    let found = latest(directory.path(), &Ranks::default()).unwrap().0.unwrap();
    let mut other = Points::<2>::new(&[]);
    assert!(found.restore(&model, &mut other).unwrap_err().contains("other points"));
    assert_eq!(
        latest(tempfile::tempdir().unwrap().path(), &Ranks::default()).unwrap_err().kind(),
        io::ErrorKind::NotFound
    );
}

/// A consistent file that no run of the deck has written.
#[test]
fn a_state_that_no_run_has_reached_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, model, good) = analysis();
    let refused = |points: &Points<2>, reached: &Reached, findings: &Findings| {
        write(directory.path(), &deck, "f", reached, findings, points).unwrap();
        let found = latest(directory.path(), &Ranks::default()).unwrap().0.unwrap();
        found.restore(&model, &mut analysis().2).unwrap_err()
    };
    let nothing = Findings::default();
    let mut points = good.clone();
    points.cell[5] = model.grid.n_cells() as u32;
    assert!(refused(&points, &reached(1), &nothing).contains("cell that does not exist"));
    let mut points = good.clone();
    points.converged.deformation_gradient[2][(0, 0)] = -1.0;
    assert!(refused(&points, &reached(2), &nothing).contains("inside out"));
    let mut points = good.clone();
    points.id[1] = points.id[0];
    assert!(refused(&points, &reached(3), &nothing).contains("its point numbers"));
    let mut account = reached(4);
    account.progress.step.end = 2.0;
    assert!(refused(&good, &account, &nothing).contains("summary"));
    let mut account = reached(5);
    account.summary.quality.shear =
        Some(mpm_core::quality::Worst { value: 1.0, step: 1, body: 1, point: None });
    assert!(refused(&good, &account, &nothing).contains("summary"));
}

#[test]
fn a_number_that_is_not_finite_reaches_no_file() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, _, good) = analysis();
    let says = |change: &dyn Fn(&mut State<2>)| {
        let mut points = good.clone();
        change(&mut points.converged);
        let error = write(directory.path(), &deck, "f", &reached(1), &Findings::default(), &points);
        let error = error.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        error.to_string()
    };
    let of = |place: usize| format!(" of point {} is ", good.id[place]);
    assert!(says(&|state| state.position[3][1] = f64::NAN).contains(&format!("position{}NaN", of(3))));
    assert!(says(&|state| state.corners[4 * 5 + 3][0] = f64::NAN).contains(&format!("domain{}NaN", of(5))));
    let gradient = says(&|state| state.deformation_gradient[2][8] = f64::INFINITY);
    assert!(gradient.contains(&format!("deformation gradient{}inf", of(2))));
    let strain = says(&|state| state.elastic_strain[7].0[5] = f64::NAN);
    assert!(strain.contains(&format!("elastic strain{}NaN", of(7))));
    let stress = says(&|state| state.kirchhoff_stress[0].0[0] = -f64::INFINITY);
    assert!(stress.contains(&format!("Kirchhoff stress{}-inf", of(0))));
    assert!(says(&|state| state.history[9] = f64::NAN).contains(&format!("history{}NaN", of(9))));
    assert!(names(directory.path()).is_empty());
}

fn spec(name: &str, kind: FieldKind, components: usize, n: usize) -> PointFieldSpec {
    let (name, unit, start) = (name.to_owned(), "-".to_owned(), vec![1.5; n * components]);
    PointFieldSpec { name, unit, components, kind, start }
}

#[test]
fn further_fields_are_kept_and_others_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, model, mut points) = analysis();
    let n = points.len();
    let stress = points.declare(spec("initial_stress", FieldKind::Fixed, 6, n)).unwrap();
    let pore = points.declare(spec("pore_pressure", FieldKind::Answer, 1, n)).unwrap();
    let age = points.declare(spec("age", FieldKind::Motion, 2, n)).unwrap();
    let numbers: Vec<f64> = (0..2 * n).map(|k| k as f64).collect();
    points.further.restore(age, &numbers);
    points.further.restore(pore, &numbers[n..]);
    write(directory.path(), &deck, "f", &reached(1), &Findings::default(), &points).unwrap();
    let found = latest(directory.path(), &Ranks::default()).unwrap().0.unwrap();

    let restored = |declared: &[PointFieldSpec]| {
        let mut fresh = analysis().2;
        for spec in declared {
            fresh.declare(spec.clone()).unwrap();
        }
        found.restore(&model, &mut fresh).map(|()| fresh)
    };
    let [a, b, c] = [
        spec("initial_stress", FieldKind::Fixed, 6, n),
        spec("pore_pressure", FieldKind::Answer, 1, n),
        spec("age", FieldKind::Motion, 2, n),
    ];
    // The order in which they are declared does not matter.
    for declared in [[a.clone(), b.clone(), c.clone()], [c.clone(), b.clone(), a.clone()]] {
        let restored = restored(&declared).unwrap();
        let values = |name: &str| restored.further.converged(restored.further.handle(name).unwrap()).to_vec();
        assert_eq!(values("initial_stress"), points.further.converged(stress));
        assert_eq!((values("pore_pressure"), values("age")), (numbers[n..].to_vec(), numbers.clone()));
        assert_eq!((&restored.id, &restored.converged), (&points.id, &points.converged));
    }
    let refused = |declared: &[PointFieldSpec]| restored(declared).unwrap_err();
    assert_eq!(
        refused(&[]),
        "it contains the point field `initial_stress`, which this analysis does not declare"
    );
    let more = spec("temperature", FieldKind::Answer, 1, n);
    assert_eq!(
        refused(&[a.clone(), b.clone(), c.clone(), more]),
        "it lacks the point field `temperature`, which this analysis declares"
    );
    assert_eq!(
        refused(&[a.clone(), spec("pore_pressure", FieldKind::Motion, 2, n), c.clone()]),
        "its point field `pore_pressure` is a response (1 per point, in [-]), but that of this analysis is a motion (2 per \
         point, in [-])"
    );

    // A number that is not finite is named, and reaches no file.
    let mut values = numbers[n..].to_vec();
    values[4] = f64::NAN;
    points.further.restore(pore, &values);
    let error = write(directory.path(), &deck, "f", &reached(2), &Findings::default(), &points).unwrap_err();
    assert!(error.to_string().contains(&format!("field `pore_pressure` of point {} is NaN", points.id[4])));
}

/// Heads that name further fields no run has written, with arrays of any length.
#[test]
fn damaged_lists_of_further_fields_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, model, mut points) = analysis();
    let n = points.len();
    points.declare(spec("age", FieldKind::Motion, 2, n)).unwrap();
    write(directory.path(), &deck, "f", &reached(1), &Findings::default(), &points).unwrap();
    let good = latest(directory.path(), &Ranks::default()).unwrap().0.unwrap();
    let refused = |change: &dyn Fn(&mut Checkpoint)| {
        let mut damaged = Checkpoint {
            path: good.path.clone(),
            head: good.head.clone(),
            arrays: good.arrays.clone(),
            paths: Vec::new(),
        };
        change(&mut damaged);
        damaged.restore(&model, &mut points.clone()).unwrap_err()
    };
    let age = good.head.further[0].clone();
    assert!(refused(&|c| c.head.further.push(age.clone())).contains("twice"));
    assert!(refused(&|c| c.head.further.clear()).contains("lacks the point field `age`"));
    assert!(refused(&|c| c.head.further[0].components = usize::MAX).contains("that of this analysis"));
    assert!(refused(&|c| c.head.further[0].components = 0).contains("that of this analysis"));
    assert!(refused(&|c| c.head.further[0].kind = FieldKind::Fixed).contains("that of this analysis"));
    assert!(refused(&|c| c.head.further[0].name.clear()).contains("does not declare"));
    let whole = good.arrays[0].1.len();
    for length in [0, 7, whole - 16 * n, whole - 1] {
        assert!(refused(&|c| c.arrays[0].1.truncate(length)).contains("shorter"));
    }
    assert!(refused(&|c| c.arrays[0].1.extend([0; 8])).contains("longer"));
}

/// A head without further fields has the same bytes as in earlier versions.
#[test]
fn an_account_without_further_fields_does_not_name_them() {
    let directory = tempfile::tempdir().unwrap();
    let (deck, _, points) = analysis();
    write(directory.path(), &deck, "f", &reached(1), &Findings::default(), &points).unwrap();
    let head = latest(directory.path(), &Ranks::default()).unwrap().0.unwrap().head;
    let text = serde_json::to_string(&head).unwrap();
    assert!(text.ends_with(&format!(r#""shape":[2,{},1,4]}}"#, points.len())), "{text}");
}
