use super::*;
use crate::basis::{Connectivity, Method};
use crate::domain::DomainUpdate;
use crate::grid::Structured;
use crate::model::{Body, Newton};
use crate::points::Seed;
use crate::tensor::Mat3;

/// Four cells of 1 × 0.5, and bodies with these methods and updates.
fn model(bodies: &[(Method, DomainUpdate)]) -> Model<2> {
    let body = |(k, (method, domain_update)): (usize, &(Method, DomainUpdate))| Body {
        name: format!("body {k}"),
        material: 0,
        method: *method,
        domain_update: *domain_update,
        split_above: None,
        strain: Default::default(),
    };
    Model {
        bodies: bodies.iter().enumerate().map(body).collect(),
        newton: Newton { max_iterations: 10, ..Newton::default() },
        ..Model::new(Box::new(Structured::<2>::new([0.0; 2], [1.0, 0.5], [2, 2])))
    }
}

/// A point whose volume is that of its rectangular domain.
fn seed(body: u16, position: [f64; 2], half_lengths: [f64; 2], with_corners: bool) -> Seed<2> {
    let volume = 4.0 * half_lengths[0] * half_lengths[1];
    let corner = |c: usize| {
        std::array::from_fn(|d| {
            position[d] + if c >> d & 1 == 1 { half_lengths[d] } else { -half_lengths[d] }
        })
    };
    let corners = if with_corners { (0..4).map(corner).collect() } else { Vec::new() };
    let mass = 3.0 * volume;
    Seed { body, position, half_lengths, corners, volume, mass, outer_layer: false, history: Vec::new() }
}

const GIMP: (Method, DomainUpdate) = (Method::Gimp, DomainUpdate::None);

fn measures(model: &Model<2>, points: &mut Points<2>) -> Measures {
    let methods = model.methods();
    let links = Connectivity::new(model.grid.as_ref(), points, &methods).unwrap();
    if points.trial.position.is_empty() {
        points.trial = points.converged.clone(); // nothing has moved
    }
    Measures::new(model, points, &links, model.grid.as_ref())
}

fn near(found: Option<PointValue>, value: f64, point: u32) {
    let found = found.unwrap();
    assert!((found.value - value).abs() < 1e-14 && found.point == point, "{found:?}");
}

#[test]
fn domains_outside_the_grid_lose_the_partition_of_unity() {
    let model = model(&[GIMP]);
    // The last domain reaches beyond the left boundary by a quarter and beyond the upper one by a third; the second one
    // touches the boundary up to round-off. The points are in the order of their cells, so the converged and trial
    // states agree.
    let seeds = [
        seed(0, [0.6, 0.3], [0.1, 0.1], false),
        seed(0, [1.9, 0.1], [0.1 + 1e-12, 0.1 + 1e-12], false),
        seed(0, [0.1, 0.95], [0.2, 0.15], false),
    ];
    let mut points = Points::new(&seeds);
    let body = &measures(&model, &mut points).bodies[0];
    near(body.outside, 1.0 - 0.75 * (2.0 / 3.0), 2);
    // Outside the grid, the hat function of the boundary falls from 1 to 0 over a cell.
    let (x, y) = (1.0 - 0.25 * 0.05, 1.0 - (1.0 / 3.0) * 0.1);
    near(body.partition_of_unity_loss, 1.0 - x * y, 2);
    let volume: f64 = points.original_volume.iter().sum();
    assert!((body.mass - 3.0 * volume).abs() < 1e-14 && (body.volume - volume).abs() < 1e-14);
    assert!((body.domain_volume - volume).abs() < 1e-14);
}

#[test]
fn corners_outside_the_grid_are_counted() {
    let model = model(&[(Method::Cpdi2, DomainUpdate::Corners)]);
    let mut points = Points::new(&[seed(0, [0.5, 0.5], [0.2, 0.2], true)]);
    points.trial = points.converged.clone();
    points.trial.corners[1] = [2.5, 0.3];
    let body = &measures(&model, &mut points).bodies[0];
    near(body.outside, 0.25, 0);
    assert!((body.domain_volume / 0.16 - 1.0) > 1.0, "the domain is that of the trial state");
}

#[test]
fn cells_are_filled_by_the_points_in_them() {
    let model = model(&[(Method::Mpm, DomainUpdate::None)]);
    let seeds = [[0.25, 0.25], [0.75, 0.25], [1.5, 0.75]].map(|x| seed(0, x, [0.25, 0.25], false));
    let mut points = Points::new(&seeds);
    points.converged.deformation_gradient[2] = Mat3::from_diagonal(&nalgebra::Vector3::new(0.5, 1.0, 1.0));
    let measures = measures(&model, &mut points);
    let cell = model.grid.locate(&[1.5, 0.75], None).unwrap();
    assert_eq!(measures.smallest_filling, Some(CellValue { value: 0.25, cell }));
    assert_eq!((model.grid.volume(0), measures.bodies[0].outside), (0.5, None));
}

#[test]
fn bodies_are_measured_on_their_own() {
    let model = model(&[GIMP, (Method::Mpm, DomainUpdate::None)]);
    let seeds = [seed(1, [1.5, 0.2], [0.1, 0.1], false), seed(0, [0.5, 0.2], [0.1, 0.1], false)];
    let mut points = Points::new(&seeds);
    let mut quality = Quality::new(&points);
    let measures = {
        let methods = [Method::Gimp, Method::Mpm];
        let links = Connectivity::new(model.grid.as_ref(), &mut points, &methods).unwrap();
        let place = points.by_id();
        points.trial = points.converged.clone();
        points.trial.deformation_gradient[place[0]] = Mat3::new(0.0, -1.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        points.trial.half_lengths[place[1]] = [0.1, 0.12];
        points.trial.deformation_gradient[place[1]] = Mat3::new(1.0, 0.4, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0);
        Measures::new(&model, &points, &links, model.grid.as_ref())
    };
    near(measures.bodies[0].shear, 0.4 / 0.9, 1);
    near(measures.bodies[0].objection, 0.1, 1);
    near(measures.bodies[1].rotation, 90.0, 0);
    assert_eq!(measures.bodies[1].objection, None, "a point without domain has no update");
    let warnings = quality.accept(&model, 7, &measures, &[]);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let warning = &warnings[0];
    assert_eq!((warning.code, warning.step, warning.threshold), (Code::DomainUpdate, 7, Some(0.05)));
    assert_eq!((&warning.location.bodies[..], warning.location.point), (&["body 0".to_owned()][..], Some(1)));
    assert!((warning.value.unwrap() - 0.1).abs() < 1e-14);
    assert_eq!(
        warning.to_string(),
        "step 7: body `body 0`: its domain update `none` does not suit its motion: point 1 has changed its area by 10.0 %"
    );
    assert!(quality.accept(&model, 8, &measures, &[]).is_empty(), "once is enough");
    let det_f = quality.det_f.unwrap();
    assert!((det_f[0] - 0.9).abs() < 1e-14 && (det_f[1] - 1.5).abs() < 1e-14);
    assert_eq!(quality.mass.relative_change(), 0.0);
    assert!((quality.volume.relative_change() - 0.2).abs() < 1e-14);
    let overlap = quality.domain_volume_excess.unwrap();
    assert!((overlap.value - (1.2 / 0.9 - 1.0)).abs() < 1e-14 && (overlap.step, overlap.body) == (7, 0));
    let rotation = quality.rotation.unwrap();
    assert_eq!((rotation.step, rotation.body, rotation.point), (7, 1, Some(0)));
}

#[test]
fn the_worst_of_all_steps_is_kept() {
    let model = model(&[GIMP]);
    let mut points = Points::new(&[seed(0, [0.5, 0.5], [0.1, 0.1], false)]);
    let mut quality = Quality::new(&points);
    for (step, half_length) in [(1, 0.09), (2, 0.07), (3, 0.12)] {
        points.trial = points.converged.clone();
        points.trial.half_lengths[0] = [0.1, half_length];
        points.trial.position[0] = [0.095, 0.5];
        quality.accept(&model, step, &measures(&model, &mut points), &[]);
    }
    let overlap = quality.domain_volume_excess.unwrap();
    assert!((overlap.value + 0.3).abs() < 1e-14 && overlap.step == 2);
    let text = quality.to_string();
    assert!(text.contains("2.50 % of a domain outside the grid"), "{text}");
    assert_eq!(Quality::default().to_string(), "");
}

#[test]
fn warnings_about_the_grid() {
    let model = model(&[GIMP, (Method::Gimp, DomainUpdate::Corners)]);
    let seeds = [0, 1].map(|body| seed(body, [0.1, 0.5], [0.2, 0.1], false));
    let mut points = Points::new(&seeds);
    let mut quality = Quality::new(&points);
    let warnings = quality.accept(&model, 1, &measures(&model, &mut points), &[]);
    let about = |text: &str| warnings.iter().filter(|warning| warning.message.contains(text)).count();
    assert_eq!(about("25.0 % of the domain of point"), 2);
    assert_eq!(about("add up to 0.9875 instead of 1"), 2);
    let reaching: Vec<&str> = (warnings.iter())
        .filter(|warning| warning.detail == Some(Detail::ReachingBox))
        .map(|warning| warning.location.bodies[0].as_str())
        .collect();
    assert_eq!(reaching, ["body 0"; 2], "corners keep the domains of the other body inside it");
}

#[test]
fn observed_order_of_the_iterations() {
    let order = |residuals: &[f64]| newton_order(residuals);
    assert!((order(&[1.0, 1e-1, 1e-2, 1e-4]).unwrap() - 2.0).abs() < 1e-14);
    assert!((order(&[1.0, 5.0, 1e-2, 1e-4, 1e-8, 1e-15]).unwrap() - 2.0).abs() < 1e-14, "round-off");
    assert!((order(&[1.0, 1e-3, 1e-4, 1e-5]).unwrap() - 1.0).abs() < 1e-14);
    for too_few in [&[][..], &[1.0, 1e-4, 1e-8], &[1.0, 1e-1, 2e-1, 1e-3], &[1.0, 1e-4, 1e-8, 1e-14]] {
        assert_eq!(order(too_few), None);
    }
    let mut quality = Quality { newton_orders: vec![(1, 2.0), (2, 1.0), (4, 1.8)], ..Quality::default() };
    assert_eq!(quality.median_newton_order(), Some(1.8));
    assert_eq!(quality.smallest_newton_order(), Some((2, 1.0)));
    quality.newton_orders.push((5, 2.0));
    assert!((quality.median_newton_order().unwrap() - 1.9).abs() < 1e-14);
    quality.newton_orders.clear();
    assert_eq!((quality.median_newton_order(), quality.smallest_newton_order()), (None, None));
}
