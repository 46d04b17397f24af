//! The derivatives of contact compared with finite differences.

use crate::assembly::{System, Wanted};
use crate::basis::{Connectivity, Method};
use crate::dofs::DofMap;
use crate::formula::Formula;
use crate::grid::Structured;
use crate::material::Hencky;
use crate::model::{BodyContact, BodyGroups, Builder, ContactControl, Fill, Freedom, Interface, Model, Tool};
use crate::points::Points;
use crate::region::tests::Random;
use crate::region::{Ball, Brick};
use crate::step::{At, StepContext};
use crate::terms::{Contact, PairState, Sum, Terms, ToolState};
use crate::tool::{Pose, Shape};

/// Largest difference from a finite-difference derivative, relative to the largest entry.
const TOLERANCE: f64 = 1e-6;
const SMALL: f64 = 1e-6;

struct Case<const D: usize> {
    model: Model<D>,
    points: Points<D>,
    /// Values of the free components.
    free: Vec<f64>,
}

fn block<const D: usize>(tool: Tool<D>, method: Method, revolved: bool) -> (Model<D>, Points<D>) {
    let mut builder = Builder::new(Structured::new([0.0; D], [0.25; D], [6; D]));
    if revolved {
        builder = builder.revolved();
    }
    let fill = Fill { method, ..Fill::default() };
    builder = builder
        .material("rubber", Hencky::new(1e6, 0.3))
        .body("block", "rubber", fill, |x| x.iter().all(|x| *x < 1.0))
        .tool(tool);
    builder.build().unwrap()
}

/// Forces on the nodes, and the residuals of the tools.
fn forces<const D: usize>(sum: &System<D>) -> (Vec<f64>, Vec<f64>) {
    (sum.external_force().as_flattened().to_vec(), sum.border.residual.clone())
}

fn check<const D: usize>(case: Case<D>) -> usize {
    let Case { model, mut points, free } = case;
    let methods = model.methods();
    let links = Connectivity::default().with_body_groups(&model.body_groups.of_body);
    let links = links.renew(model.grid.as_ref(), &mut points, &methods).unwrap();
    let step = StepContext::first(&model, &links);
    let terms: Terms<D> = vec![Box::new(Contact::new(&model))];
    let mut sum = Sum::begun(terms, &step, &points).unwrap();
    let n = links.n_active();
    let mut random = Random(3);
    let mut field =
        |size: f64| -> Vec<[f64; D]> { (0..n).map(|_| random.inside(&[[-size; D], [size; D]])).collect() };
    let (at, direction) = (field(0.004), field(1.0));
    let mut evaluate = |at: &[[f64; D]], free: &[f64], wanted: Wanted, sum: &mut Sum<D>| {
        let unknowns = At { delta_d: at, factor: 0.0, globals: free };
        sum.evaluate(&step, &mut points, unknowns, wanted).unwrap();
    };
    evaluate(&at, &free, Wanted::Stiffness, &mut sum);
    if sum.outgrows(&step, &DofMap::unconstrained(n)) {
        evaluate(&at, &free, Wanted::Stiffness, &mut sum);
    }
    let mut product = vec![[0.0; D]; n];
    sum.system_mut().multiply(&direction, &mut product);
    let border = sum.system().border.clone();
    let report = sum.report(&model);
    let on_tools = report.records().list::<ToolState<D>>().iter().map(|tool| tool.contacts.len());
    let between_bodies = report.records().list::<PairState<D>>().iter().map(|pair| pair.contacts.len());
    let touching = on_tools.chain(between_bodies).sum();
    let mut difference = |moved: [&[[f64; D]]; 2], free: [&[f64]; 2]| -> (Vec<f64>, Vec<f64>) {
        let [a, b] = [0, 1].map(|k| {
            evaluate(moved[k], free[k], Wanted::Force, &mut sum);
            forces(sum.system())
        });
        let rate = |(a, b): (&f64, &f64)| (a - b) / (2.0 * SMALL);
        (a.0.iter().zip(&b.0).map(rate).collect(), a.1.iter().zip(&b.1).map(rate).collect())
    };
    // Some columns vanish: rotating a tool about the edge that touches changes nothing.
    let least = 0.01 * product.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let agree = |found: &[f64], expected: &[f64], what: &str| {
        let scale = expected.iter().chain(found).fold(least, |m, x| m.max(x.abs()));
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() <= TOLERANCE * scale, "{what}: {a} {b} {scale}");
        }
    };
    let [above, below] = [SMALL, -SMALL].map(|h| -> Vec<[f64; D]> {
        let moved = at.iter().zip(&direction);
        moved.map(|(x, e)| std::array::from_fn(|d| x[d] + h * e[d])).collect()
    });
    let (force, residual) = difference([&above, &below], [&free, &free]);
    let negative: Vec<f64> = force.iter().map(|f| -f).collect();
    agree(product.as_flattened(), &negative, "stiffness");
    let along = |row: &Vec<[f64; D]>| -> f64 {
        row.as_flattened().iter().zip(direction.as_flattened()).map(|(a, b)| a * b).sum()
    };
    agree(&border.rows.iter().map(along).collect::<Vec<_>>(), &residual, "rows");
    for j in 0..free.len() {
        let moved = [SMALL, -SMALL].map(|h| {
            let mut moved = free.clone();
            moved[j] += h;
            moved
        });
        let (force, residual) = difference([&at, &at], [&moved[0], &moved[1]]);
        let negative: Vec<f64> = force.iter().map(|f| -f).collect();
        agree(border.columns[j].as_flattened(), &negative, "column");
        let column: Vec<f64> = border.corner.iter().map(|row| row[j]).collect();
        agree(&column, &residual, "corner");
    }
    touching
}

const INTERFACES: [Interface; 4] = [
    Interface::ROUGH,
    Interface::with_friction(0.05),
    Interface { shear: crate::model::Shear::Coulomb { friction: 0.1, adhesion: 1e3 }, tension_cut_off: 0.0 },
    Interface { shear: crate::model::Shear::Rough, tension_cut_off: 1e9 },
];

fn moving<const D: usize>(
    mut tool: Tool<D>,
    interface: Interface,
    motion: &[(usize, Option<f64>)],
) -> Tool<D> {
    tool.interface = Some(interface);
    for &(k, value) in motion {
        let freedom = value.map_or(Freedom::Free, |value| Freedom::Prescribed(Formula::constant(value)));
        if k < D { tool.translation[k] = freedom } else { tool.rotation[k - D] = freedom }
    }
    tool
}

fn at<const D: usize>(shape: impl Shape<D> + 'static, position: [f64; D], turn: [f64; 3]) -> Tool<D> {
    Tool::new("tool", shape, Pose::new(position, turn).unwrap())
}

#[test]
fn derivatives_agree_with_differences_in_the_plane() {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        for interface in INTERFACES {
            let ball = || at(Ball::new([0.05, 0.3], 0.3).unwrap(), [0.5, 1.0], [0.0; 3]);
            let push: &[(usize, Option<f64>)] = &[(0, Some(0.01)), (1, Some(-0.03)), (4, Some(0.1))];
            let loose: &[(usize, Option<f64>)] = &[(0, None), (1, None), (4, None)];
            for (motion, free) in [(push, vec![]), (loose, vec![0.013, -0.03, -0.15])] {
                let (model, points) = block(moving(ball(), interface, motion), method, false);
                assert!(check(Case { model, points, free }) > 1, "{method:?} {interface:?}");
            }
            // An edge separates from the contact point that it touches.
            if interface.tension_cut_off > 0.0 {
                let edge = at(Brick::new([0.0; 2], [0.5; 2]).unwrap(), [0.5, 1.0], [0.0, 0.0, 0.8]);
                let tool = moving(edge, interface, &[(0, None), (1, None), (4, None)]);
                let (model, points) = block(tool, method, false);
                assert!(check(Case { model, points, free: vec![0.01, 0.02, 0.1] }) > 0, "{method:?}");
            }
        }
    }
}

#[test]
fn derivatives_agree_with_differences_in_axisymmetry() {
    for interface in INTERFACES {
        let ball = at(Ball::new([0.0, 0.3], 0.3).unwrap(), [0.0, 1.0], [0.0; 3]);
        let (model, points) = block(moving(ball, interface, &[(1, None)]), Method::Gimp, true);
        assert!(check(Case { model, points, free: vec![-0.03] }) > 1, "{interface:?}");
    }
}

#[test]
fn derivatives_agree_with_differences_in_space() {
    for method in [Method::Gimp, Method::Cpdi2] {
        for interface in INTERFACES {
            let ball = || at(Ball::new([0.05, 0.1, 0.3], 0.3).unwrap(), [0.5, 0.4, 1.0], [0.0; 3]);
            let motion: Vec<(usize, Option<f64>)> = (0..6).map(|k| (k, None)).collect();
            let (model, points) = block(moving(ball(), interface, &motion), method, false);
            let free = vec![0.01, -0.005, -0.03, 0.1, -0.12, 0.2];
            assert!(check(Case { model, points, free }) > 1, "{method:?} {interface:?}");
        }
    }
    let brick = at(Brick::new([0.0; 3], [0.5; 3]).unwrap(), [0.3, 0.3, 1.15], [0.3, 0.2, 0.1]);
    let motion: Vec<(usize, Option<f64>)> = (0..6).map(|k| (k, None)).collect();
    let (model, points) = block(moving(brick, INTERFACES[1], &motion), Method::Gimp, false);
    let free = vec![0.01, -0.005, -0.12, 0.1, 0.05, 0.02];
    assert!(check(Case { model, points, free }) > 0);
}

/// Two blocks, one above the other, whose domains do not match.
fn two_blocks<const D: usize>(interface: Interface, method: Method, revolved: bool) -> Case<D> {
    let mut builder = Builder::new(Structured::new([0.0; D], [0.25; D], [6; D]));
    if revolved {
        builder = builder.revolved();
    }
    let fill = |points_per_cell: usize| Fill { method, points_per_cell, ..Fill::default() };
    let is_below = |x: &[f64; D]| x.iter().all(|x| *x < 1.0) && x[D - 1] < 0.5;
    let is_above = |x: &[f64; D]| x.iter().all(|x| *x < 1.0) && x[D - 1] > 0.5;
    let (mut model, points) = builder
        .material("rubber", Hencky::new(1e6, 0.3))
        .body("below", "rubber", fill(2), is_below)
        .body("above", "rubber", fill(3), is_above)
        .build()
        .unwrap();
    // The random motion of the nodes opens no contact point.
    let control = ContactControl { penalty: 1.0, ..ContactControl::default() };
    model.contacts = vec![BodyContact { bodies: [0, 1], interface: Some(interface), control }];
    model.body_groups = BodyGroups::new(2, &[[0, 1]], &[[0, 1]]).unwrap();
    Case { model, points, free: Vec::new() }
}

#[test]
fn derivatives_agree_with_differences_between_bodies() {
    for method in [Method::Gimp, Method::Cpdi1, Method::Cpdi2] {
        for interface in INTERFACES.into_iter().chain([Interface::SMOOTH]) {
            let found = check(two_blocks::<2>(interface, method, false));
            assert!(found > 3, "{method:?} {interface:?} {found}");
        }
    }
    assert!(check(two_blocks::<2>(INTERFACES[2], Method::Cpdi2, true)) > 3);
    assert!(check(two_blocks::<3>(INTERFACES[1], Method::Cpdi2, false)) > 3);
    assert!(check(two_blocks::<3>(INTERFACES[2], Method::Gimp, false)) > 3);
}
