#![allow(clippy::unwrap_used)]
use std::convert::Infallible;

use super::column::Column;
use super::*;
use crate::grid::Structured;
use crate::tensor::{Mat3, Sym3};

/// Points in a row of cells from right to left, so that grouping reverses their order.
fn row(n: usize) -> Points<2> {
    let seed = |k: usize| Seed {
        body: k as u16,
        position: [(n - k) as f64 - 0.5, 0.5],
        half_lengths: [0.0; 2],
        corners: Vec::new(),
        volume: 2.0 + k as f64,
        mass: 10.0 + k as f64,
        outer_layer: false,
        history: vec![0.25 * k as f64],
    };
    Points::new(&(0..n).map(seed).collect::<Vec<_>>())
}

fn group(points: &mut Points<2>) {
    let n = points.len() as u32;
    points.group_by_cell(&Structured::<2>::new([0.0; 2], [1.0; 2], [n as usize, 1]), &[]).unwrap();
}

fn spec(name: &str, kind: FieldKind, components: usize, n: usize) -> PointFieldSpec {
    let start = (0..n * components).map(|k| k as f64).collect();
    PointFieldSpec { name: name.to_owned(), unit: "-".to_owned(), components, kind, start }
}

#[test]
fn coordinates_of_any_size_are_legible() {
    assert_eq!(coordinates(&[1.25, -1e-8]), "(1.250000, 0.000000)");
    assert_eq!(coordinates(&[-3.5e-6, 1e-17, 2e-5]), "(-3.500000e-6, 0.000000e0, 2.000000e-5)");
    assert_eq!(coordinates(&[1e300, 2.0]), "(1.000000e300, 0.000000e0)");
    assert_eq!(coordinates(&[f64::NAN, 1.0]), "(NaN, 1.000000)");
}

#[test]
fn arrays_stand_by_permanent_number_row_by_row_and_without_factors() {
    let mut points = row(3);
    group(&mut points);
    assert_eq!(points.id, [2, 1, 0]);
    let stress = Mat3::new(1.0, 4.0, 6.0, 4.0, 2.0, 5.0, 6.0, 5.0, 3.0);
    let gradient = Mat3::new(2.0, 0.5, 0.0, 0.0, 1.0, 0.25, 0.0, 0.0, 4.0); // det 8
    points.converged.kirchhoff_stress[2] = Sym3::symmetric_part(&stress); // of point 0
    points.converged.elastic_strain[1] = Sym3::symmetric_part(&(stress * 0.01)); // of point 1
    points.converged.deformation_gradient[2] = gradient;
    points.converged.position[0] = [0.75, 1.0]; // of point 2, which was at 0.5, 0.5
    let array = |array: PointArray| {
        let PointValues { components, values } = points.array(array);
        assert_eq!(values.len(), 3 * components, "{}", array.name());
        values.chunks(components).map(<[f64]>::to_vec).collect::<Vec<_>>()
    };
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
    // xx, yy, zz, xy, yz, xz; the conversion to and from the Mandel layout causes round-off.
    let components = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    assert!(near(&array(PointArray::KirchhoffStress)[0], &components));
    assert!(near(&array(PointArray::CauchyStress)[0], &components.map(|t| t / 8.0)));
    assert!(near(&array(PointArray::ElasticStrain)[1], &components.map(|t| t * 0.01)));
    assert_eq!(array(PointArray::KirchhoffStress)[1], [0.0; 6]);
    assert_eq!(array(PointArray::DeformationGradient)[0], [2.0, 0.5, 0.0, 0.0, 1.0, 0.25, 0.0, 0.0, 4.0]);
    assert_eq!(array(PointArray::Position), [[2.5, 0.5], [1.5, 0.5], [0.75, 1.0]]);
    assert_eq!(array(PointArray::Displacement), [[0.0, 0.0], [0.0, 0.0], [0.25, 0.5]]);
    assert_eq!(array(PointArray::Volume), [[16.0], [3.0], [4.0]]);
    assert_eq!(array(PointArray::Mass), [[10.0], [11.0], [12.0]]);
    assert_eq!(array(PointArray::Body), [[0.0], [1.0], [2.0]]);
    // Declared fields by their names, in the same order.
    for array in [PointArray::Position, PointArray::KirchhoffStress, PointArray::ElasticStrain] {
        assert_eq!(points.field(array.name()), Some(points.array(array)));
    }
    assert_eq!(points.field("history").unwrap().values, [0.0, 0.25, 0.5]);
    assert_eq!(points.field("half_lengths"), Some(PointValues { components: 2, values: vec![0.0; 6] }));
    assert_eq!(points.field("temperature"), None);
}

#[test]
fn further_fields_follow_the_points() {
    let mut points = row(4);
    group(&mut points);
    // Initial values follow the permanent numbers, whatever the current order of the points.
    let fixed = points.declare(spec("initial_stress", FieldKind::Fixed, 2, 4)).unwrap();
    let motion = points.declare(spec("age", FieldKind::Motion, 1, 4)).unwrap();
    let answer = points.declare(spec("pore_pressure", FieldKind::Answer, 1, 4)).unwrap();
    assert_eq!(points.further.converged(fixed), [6.0, 7.0, 4.0, 5.0, 2.0, 3.0, 0.0, 1.0]);
    assert_eq!(points.field("initial_stress").unwrap().values, (0..8).map(f64::from).collect::<Vec<_>>());
    assert!(points.further.trial_mut(fixed).is_empty());
    assert_eq!(points.further.trial(motion), [3.0, 2.0, 1.0, 0.0]);

    points.further.trial_mut(motion)[0] = 30.0;
    points.further.trial_mut(answer)[3] = 5.0;
    points.commit();
    assert_eq!(points.further.converged(motion), [30.0, 2.0, 1.0, 0.0]);
    assert_eq!(points.further.converged(answer), [3.0, 2.0, 1.0, 5.0]);
    points.commit(); // values that nothing has written persist
    assert_eq!(points.further.converged(answer), [3.0, 2.0, 1.0, 5.0]);

    // An abandoned step leaves no trace. The points then change their order.
    points.further.trial_mut(motion).fill(-1.0);
    points.further.trial_mut(answer).fill(-1.0);
    points.converged.position.reverse();
    group(&mut points);
    assert_eq!(points.id, [0, 1, 2, 3]);
    points.commit();
    assert_eq!(points.field("age").unwrap().values, [0.0, 1.0, 2.0, 30.0]);
    assert_eq!(points.field("pore_pressure").unwrap().values, [5.0, 1.0, 2.0, 3.0]);
    assert_eq!(points.field("initial_stress").unwrap().values, (0..8).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn fields_that_do_not_fit_are_refused() {
    let mut points = row(2);
    points.declare(spec("age", FieldKind::Fixed, 1, 2)).unwrap();
    let mut refused = |spec: PointFieldSpec| points.declare(spec).unwrap_err().to_string();
    for name in ["", "2nd", "pore pressure", "a<b", "_a"] {
        assert!(refused(spec(name, FieldKind::Fixed, 1, 2)).contains("letters, digits and underscores"));
    }
    for name in ["age", "mass", "cauchy_stress", "history", "position"] {
        assert!(refused(spec(name, FieldKind::Fixed, 1, 2)).contains("already"));
    }
    assert!(refused(spec("a", FieldKind::Fixed, 0, 2)).contains("0 components"));
    assert!(refused(spec("a", FieldKind::Fixed, 2000, 2)).contains("2000 components"));
    assert_eq!(refused(spec("a", FieldKind::Fixed, 2, 1)), "the field `a` has 2 initial values, but needs 4");
    let start = vec![0.0, 0.0, f64::NAN, 0.0];
    let infinite = PointFieldSpec { start, ..spec("a", FieldKind::Fixed, 2, 2) };
    assert_eq!(refused(infinite), "the initial value of the field `a` at point 1 is NaN");
}

/// Each number of the state is visited once, and read back into its place.
#[test]
fn every_field_of_the_state_is_visited_and_read_back() {
    let points = row(3);
    let mut next = 0.0;
    let state = points
        .read_state(|_, count| {
            next += count as f64;
            Ok::<_, Infallible>((0..count).map(|k| next - (count - k) as f64).collect())
        })
        .unwrap();
    let mut filled = points.clone();
    filled.restore(&[2, 0, 1], vec![0; 3], state.clone()).unwrap();
    assert_eq!(filled.converged, state);
    let (mut numbers, mut names) = (Vec::new(), Vec::new());
    let visit = |field: &StoredField, values: &mut dyn Iterator<Item = f64>| {
        names.push(field.name);
        let before = numbers.len();
        numbers.extend(values);
        assert_eq!(numbers.len() - before, 3 * field.components, "{}", field.name);
        Ok::<_, Infallible>(())
    };
    filled.for_each_field(visit).unwrap();
    assert_eq!(
        names,
        [
            "position",
            "half_lengths",
            "corners",
            "deformation_gradient",
            "elastic_strain",
            "kirchhoff_stress",
            "history"
        ]
    );
    // The half lengths, which these points do not have, are zeros.
    let counted = |k: usize| if (6..12).contains(&k) { 0.0 } else { k as f64 };
    assert_eq!(numbers, (0..numbers.len()).map(counted).collect::<Vec<_>>());
}

/// Points all of whose fields hold numbers, which differ from point to point.
fn filled(n: usize) -> Points<2> {
    let seed = |k: usize| Seed {
        body: 0,
        position: [k as f64; 2],
        half_lengths: [0.5; 2],
        corners: vec![[k as f64; 2]; 4],
        volume: 1.0,
        mass: 1.0,
        outer_layer: false,
        history: vec![0.0; 3],
    };
    let mut points = Points::new(&(0..n).map(seed).collect::<Vec<_>>());
    for (f, column) in points.columns_mut().into_iter().enumerate() {
        assert!(column.len() >= n, "{}", Points::<2>::STORED[f]);
        let numbers = (0..column.len() * column.width()).map(|k| ((5 * k + f) % 200) as f64);
        column.take_numbers(&numbers.collect::<Vec<_>>());
    }
    points.trial = points.converged.trial();
    points
}

#[test]
fn every_field_follows_the_points() {
    let points = filled(3);
    let numbers =
        |points: &Points<2>| points.numbers_of_fields(&(0..points.len() as u32).collect::<Vec<_>>());
    let mut turned = points.clone();
    turned.reorder(&[2, 0, 1]);
    assert_eq!((&*turned.id, numbers(&turned)), (&[2, 0, 1][..], points.numbers_of_fields(&[2, 0, 1])));
    let mut kept = points.clone();
    kept.select(&[1]);
    assert_eq!(numbers(&kept), points.numbers_of_fields(&[1]));
    assert_eq!(kept.trial, kept.converged.trial());
    kept.append_fields(&turned);
    assert_eq!((&*kept.id, numbers(&kept)), (&[1, 2, 0, 1][..], points.numbers_of_fields(&[1, 2, 0, 1])));
    assert_eq!(kept.trial, kept.converged.trial());
    let mut sent = points.with_counts();
    assert!(sent.is_empty());
    sent.take_fields(&numbers(&points));
    assert_eq!((sent.history_len, sent.converged), (3, points.converged.clone()));
    for (name, values) in Points::<2>::STORED.iter().zip(numbers(&points)) {
        assert_eq!(points.stored(name, &[0, 1, 2]).unwrap().values.len(), values.len(), "{name}");
    }
}

#[test]
fn every_field_of_the_state_is_committed() {
    let mut points = filled(3);
    let Points { converged, trial, .. } = &mut points;
    assert_eq!(trial.lengths()[..State::<2>::N_MOTION], [0; State::<2>::N_MOTION]);
    trial.make_room_for_motion(converged);
    assert_eq!(trial.lengths(), converged.lengths());
    for column in trial.columns_mut() {
        let numbers: Vec<f64> = column.numbers(column.len()).map(|number| number + 0.5).collect();
        column.take_numbers(&numbers);
    }
    let moved = trial.clone();
    points.commit();
    assert_eq!(points.converged, moved);
    assert_eq!(points.trial.lengths()[..State::<2>::N_MOTION], [0; State::<2>::N_MOTION]);
    // Without a motion, only the answers are new.
    points.trial.history.fill(7.0);
    let State { elastic_strain, kirchhoff_stress, history, .. } = points.trial.clone();
    assert_ne!(kirchhoff_stress, moved.kirchhoff_stress);
    points.commit();
    assert_eq!(points.converged, State { elastic_strain, kirchhoff_stress, history, ..moved });
}

/// A declaration with one more field of each kind and shape: the entry is all that a field needs.
#[allow(dead_code, reason = "the test looks at the declared fields alone")]
mod one_more {
    use super::super::Seed;
    use super::super::declare::point_fields;
    use crate::ranks::Ranks;

    point_fields! {
        /// Points.
        struct Points {
            counts {
                /// Numbers of the history.
                history_len = |seed| seed.history.len();
            }
            fixed {
                /// Density.
                density: f64 = one(|seed| seed.mass / seed.volume), in "mass/volume";
            }
        }
        /// Their state.
        struct State {
            motion {
                /// Position.
                position: [f64; D] = one(|seed| seed.position), in "length", called "position";
                /// Temperature.
                temperature: f64 = one(|seed| seed.mass), in "temperature", called "temperature";
                /// Spin.
                spin: [f64; D] = one_or_none(|seed| seed.half_lengths), in "1/time", called "spin";
            }
            answer {
                /// Heat.
                heat: f64 = up_to[history_len](|seed| &seed.history), in "energy", called "heat";
            }
        }
    }

    pub fn points(seeds: &[Seed<2>]) -> Points<2> {
        Points::numbered(seeds, (0..seeds.len() as u32).collect(), &Ranks::default())
    }

    pub const NAMES: &[&str] = Points::<2>::STORED;

    pub const N_MOTION: usize = State::<2>::N_MOTION;
}

/// The list of fields and the list of columns, on which all other code works, have the new field.
#[test]
fn a_new_field_is_one_declaration() {
    let seed = |k: usize| Seed {
        body: 0,
        position: [k as f64; 2],
        half_lengths: [0.0; 2],
        corners: Vec::new(),
        volume: 0.5,
        mass: k as f64,
        outer_layer: false,
        history: vec![k as f64, 10.0 + k as f64],
    };
    let mut points = one_more::points(&(0..3).map(seed).collect::<Vec<_>>());
    assert_eq!((points.history_len, one_more::N_MOTION), (2, 3));
    assert_eq!(one_more::NAMES, ["density", "position", "temperature", "spin", "heat"]);
    let fields = points.stored_fields();
    assert_eq!(fields.iter().map(|field| field.name).collect::<Vec<_>>(), one_more::NAMES);
    let (kind, components) = (|f: usize| fields[f].kind, |f: usize| fields[f].components);
    assert_eq!([kind(0), kind(2), kind(4)], [FieldKind::Fixed, FieldKind::Motion, FieldKind::Answer]);
    assert_eq!([0, 1, 2, 3, 4].map(components), [1, 2, 1, 2, 2]);
    assert_eq!((fields[3].label, fields[3].unit), ("spin", "1/time"));
    let lengths: Vec<usize> = points.columns().into_iter().map(Column::len).collect();
    assert_eq!(lengths, [3, 3, 3, 0, 6]);
    let trial: Vec<usize> = points.trial.columns().into_iter().map(Column::len).collect();
    assert_eq!(trial, [0, 0, 0, 6]);
    for (column, n) in points.columns_mut().into_iter().zip([1, 1, 1, 1, 2]) {
        column.reorder(&[2, 1, 0], n);
    }
    assert_eq!(
        (&*points.density, &*points.converged.temperature),
        (&[4.0, 2.0, 0.0][..], &[2.0, 1.0, 0.0][..])
    );
    assert_eq!(points.converged.heat, [2.0, 12.0, 1.0, 11.0, 0.0, 10.0]);
}
