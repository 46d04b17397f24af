//! Motions prescribed weakly on surfaces that the grid does not line up with.

use mpm::basis::Method;
use mpm::domain::DomainUpdate;
use mpm::formula::Formula;
use mpm::grid::Structured;
use mpm::material::Hencky;
use mpm::model::{Body, BoundaryCondition, LoadCurve, Model, NamedMaterial, NodeSet, OnSurface, Stepping};
use mpm::points::{Points, Seed};
use mpm::region::{Brick, Motion, Region};
use mpm::surface::{Part, Surface};

use crate::verification::analysis::watch;
use crate::verification::surfaces::{built, loaded, run};

/// Inclination of the block, [rad].
const ANGLE: f64 = std::f64::consts::FRAC_PI_6;
const LENGTH: f64 = 2.0;
const HEIGHT: f64 = 1.0;
const POINTS: [usize; 2] = [24, 12];

fn turn(x: [f64; 2]) -> [f64; 2] {
    let (s, c) = ANGLE.sin_cos();
    [c * x[0] - s * x[1], s * x[0] + c * x[1]]
}

/// A block turned by 30° in the grid: smooth walls on three sides, and the fourth moved by `by` along the block.
fn compressed(penalty: f64, poisson: f64, by: f64) -> (Model<2>, Points<2>) {
    let grid = Structured::new([-1.5, -1.0], [0.25; 2], [16, 16]);
    let mut model = Model::new(Box::new(grid));
    model.materials = vec![NamedMaterial { name: "clay".into(), law: Box::new(Hencky::new(1.0, poisson)) }];
    let body = Body {
        name: "block".into(),
        material: 0,
        method: Method::Cpdi2,
        domain_update: DomainUpdate::default(),
        strain: Default::default(),
        split_above: None,
    };
    model.bodies = vec![body];
    model.stepping = Stepping::fixed(4, 1.0);
    let region: Region<2> = Brick::new([0.0; 2], [LENGTH, HEIGHT]).unwrap().into();
    let region = region.moved(&Motion::<2>::rotation(ANGLE, [0.0; 2]).unwrap());
    let side = LENGTH / POINTS[0] as f64;
    for number in 0..4 {
        let surface = Surface::new(format!("side {number}"), 0, &region, &Part::Side(number), [side, 0.25]);
        model.surfaces.push(surface.unwrap());
        let on = NodeSet::Surface(OnSurface { surface: number, along_normal: number != 1, penalty });
        let displacement = match number {
            1 => turn([by, 0.0]).map(|u| Some(Formula::constant(u))),
            _ => [Some(Formula::constant(0.0)), None],
        };
        let name = format!("wall {number}");
        model.boundary_conditions.push(BoundaryCondition::new(name, on, displacement, LoadCurve::ramp(1.0)));
    }
    let mut seeds = Vec::new();
    for (i, j) in (0..POINTS[0]).flat_map(|i| (0..POINTS[1]).map(move |j| (i, j))) {
        let at = |a: f64, b: f64| turn([(i as f64 + a) * side, (j as f64 + b) * side]);
        seeds.push(Seed {
            body: 0,
            position: at(0.5, 0.5),
            half_lengths: [0.0; 2],
            corners: vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)],
            volume: side * side,
            mass: 0.0,
            outer_layer: false,
            history: Vec::new(),
        });
    }
    (model, Points::new(&seeds))
}

/// The stress is uniform and equals that of a bar without lateral strain. This is exact, because a linear displacement
/// satisfies all conditions and the sides of the domains are the facets of the surfaces.
#[test]
fn a_block_between_inclined_walls_is_uniformly_stressed() {
    for (poisson, by) in [(0.0, -0.4), (0.3, -0.2), (0.3, 0.1)] {
        let (model, mut points) = compressed(10.0, poisson, by);
        let stretch = 1.0 + by / LENGTH;
        let (lame, shear) = (poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 / (1.0 + poisson));
        let axial = (lame + 2.0 * shear) * stretch.ln();
        let lateral = lame * stretch.ln();
        let (s, c) = ANGLE.sin_cos();
        let mut last = Vec::new();
        watch(&model, &mut points, |_, report| {
            last = report.reactions.clone();
            let sum: [f64; 2] = std::array::from_fn(|d| report.reactions.iter().map(|r| r[d]).sum());
            assert!(sum.iter().all(|f| f.abs() < 1e-9), "{sum:?}");
            assert!(report.moment_error.unwrap() < 1e-9);
        })
        .unwrap();
        let expected =
            [axial * c * c + lateral * s * s, axial * s * s + lateral * c * c, (axial - lateral) * s * c];
        let mut worst = 0.0f64;
        for stress in &points.converged.kirchhoff_stress {
            let found = [stress.component(0, 0), stress.component(1, 1), stress.component(0, 1)];
            (0..3).for_each(|k| worst = worst.max((found[k] - expected[k]).abs() / axial.abs()));
        }
        println!("poisson {poisson}, by {by}: largest error of the stress {worst:.1e}");
        assert!(worst < 1e-8, "{worst:e}");
        // The moved wall presses with the Cauchy stress on the unchanged height.
        let force = turn([axial / stretch * HEIGHT, 0.0]);
        (0..2)
            .for_each(|d| assert!((last[1][d] - force[d]).abs() < 1e-8 * axial.abs(), "{last:?} {force:?}"));
    }
}

const INCLINED: &str = "version: 1
grid: {type: structured, origin: [-2, -1], size: [5, 5], spacing: 0.25}
materials: {clay: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - name: block
    material: clay
    method: METHOD
    shape: {type: rotate, angle: 30, center: [0, 0], shape: {type: box, min: [0, 0], max: [2, 1]}}
    points_per_cell: 3
surfaces:
  - {name: base, body: block, part: {half_space: {point: [0, 0], normal: [0.5, -0.8660254037844386]}}}
boundary_conditions:
  - {name: normal, surface: base, fix: normal, penalty: PENALTY}
  - {name: tangential, surface: base, fix: {normal: [0.8660254037844386, 0.5]}, penalty: PENALTY}
loads: [{name: weight, type: gravity, acceleration: [0, -9.81]}]
steps: {count: 2}
";

fn on_slope(method: &str, penalty: f64) -> ([[f64; 2]; 2], Vec<[f64; 2]>, f64) {
    let text = INCLINED.replace("METHOD", method).replace("PENALTY", &penalty.to_string());
    let (mut reactions, mut weight) = ([[0.0; 2]; 2], 0.0);
    let (_, points) = run(&text, |_, report| {
        reactions = [report.reactions[0], report.reactions[1]];
        weight = -report.loads[0][1];
    });
    let by_id = points.by_id();
    let places = by_id.iter().map(|p| points.converged.position[*p]).collect();
    (reactions, places, weight)
}

/// A block on an inclined plane: the reactions are W cos θ and W sin θ, for any method and penalty.
#[test]
fn a_block_on_a_slope_is_held_by_its_weight_and_by_no_penalty() {
    let (s, c) = ANGLE.sin_cos();
    for method in ["mpm", "gimp", "cpdi2"] {
        let mut all = Vec::new();
        for penalty in [0.1, 10.0, 1000.0] {
            let ([normal, tangential], places, weight) = on_slope(method, penalty);
            let expected = [[-s * c * weight, c * c * weight], [s * c * weight, s * s * weight]];
            for (found, expected) in [normal, tangential].iter().zip(&expected) {
                (0..2).for_each(|d| {
                    assert!((found[d] - expected[d]).abs() < 1e-9 * weight, "{method} {found:?}")
                });
            }
            all.push(places);
        }
        let difference = |other: &[[f64; 2]]| {
            let pairs = all[1].iter().flatten().zip(other.iter().flatten());
            pairs.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()))
        };
        let [soft, stiff] = [difference(&all[0]), difference(&all[2])];
        println!("{method}: differences of positions between penalties {soft:.1e}, {stiff:.1e}");
        assert!(soft.max(stiff) < 1e-6, "{method}: {soft:e}, {stiff:e}");
    }
}

/// The stiffness of a pressure, of hydrostatic pressure and of weak conditions is the derivative of their forces, in
/// the plane and for bodies of revolution.
#[test]
fn the_stiffness_of_surfaces_is_the_derivative_of_their_forces() {
    for idealisation in ["plane-strain", "axisymmetric"] {
        let text = format!(
            "version: 1
analysis: {{idealisation: {idealisation}}}
grid: {{type: structured, origin: [0, 0], size: [2, 2], spacing: 0.5}}
materials: {{clay: {{model: hencky, young: 1, poisson: 0.3}}}}
bodies: [{{name: block, material: clay, method: gimp, shape: {{type: box, min: [0.3, 0.2], max: [1.4, 1.3]}}, \
             point_spacing: 0.1}}]
surfaces: [{{name: all, body: block}}, {{name: right, body: block, part: {{edge: 1}}}}]
boundary_conditions: [{{name: wall, surface: right, fix: normal}}]
loads:
  - {{name: p, type: pressure, surface: all, pressure: 3}}
  - {{name: water, type: pressure, surface: all, hydrostatic: {{level: 1.1, unit_weight: 5}}}}
steps: {{count: 1}}
"
        );
        let worst = match idealisation {
            "axisymmetric" => largest_fault::<2, mpm::stress::Axisymmetric>(built(&text)),
            _ => largest_fault::<2, mpm::stress::PlaneStrain>(built(&text)),
        };
        println!("{idealisation}: {worst:.1e}");
        assert!(worst < 1e-6, "{idealisation}: {worst:e}");
    }
}

/// The stiffness of surfaces in space is the derivative of their forces.
#[test]
fn the_stiffness_of_surfaces_in_space_is_the_derivative_of_their_forces() {
    let text = "version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 2], spacing: 1}
materials: {clay: {model: hencky, young: 1, poisson: 0.3}}
bodies: [{name: block, material: clay, method: gimp, shape: {type: box, min: [0.3, 0.2, 0.4], max: [1.4, 1.3, 1.6]}, \
             point_spacing: [0.275, 0.275, 0.3]}]
surfaces: [{name: all, body: block}, {name: right, body: block, part: {edge: 1}}]
boundary_conditions: [{name: wall, surface: right, fix: {normal: [1, 0.5, 0.2]}}]
loads:
  - {name: p, type: pressure, surface: all, pressure: 3}
  - {name: water, type: pressure, surface: all, hydrostatic: {level: 1.1, unit_weight: 5}}
steps: {count: 1}
";
    let worst = largest_fault::<3, mpm::stress::Solid>(mpm::deck::build::build(&loaded(text)).unwrap());
    println!("{worst:.1e}");
    assert!(worst < 1e-6, "{worst:e}");
}

/// The largest difference between an entry of the stiffness and its central difference, relative to the largest entry.
fn largest_fault<const D: usize, M: mpm::stress::Mechanics<D>>(
    (model, mut points): (Model<D>, Points<D>),
) -> f64 {
    use mpm::assembly::Wanted;
    use mpm::step::{At, StepContext};
    const STEP: f64 = 1e-6;
    let links = mpm::basis::Connectivity::new(model.grid.as_ref(), &mut points, &[Method::Gimp]).unwrap();
    let context = StepContext::first(&model, &links);
    let mut sum = mpm::terms::Sum::<D>::from_model::<M>(&context, &points).unwrap();
    let n = links.n_active();
    let at = |k: usize, d: usize| 0.03 * ([1.3, 0.7, 0.9][d] * k as f64 + d as f64).sin();
    let base: Vec<[f64; D]> = (0..n).map(|k| std::array::from_fn(|d| at(k, d))).collect();
    let mut force = |sum: &mut mpm::terms::Sum<D>, delta_d: &[[f64; D]]| -> Vec<f64> {
        sum.evaluate(&context, &mut points, At::new(delta_d), Wanted::Stiffness).unwrap();
        let system = sum.system();
        let pairs = system.internal_force().iter().zip(system.external_force());
        pairs.flat_map(|(a, b)| (0..D).map(|d| a[d] - b[d]).collect::<Vec<_>>()).collect()
    };
    force(&mut sum, &base);
    let mut columns = Vec::new();
    for b in 0..D * n {
        let mut unit = vec![[0.0; D]; n];
        unit[b / D][b % D] = 1.0;
        let mut column = unit.clone();
        sum.system_mut().multiply(&unit, &mut column);
        columns.push(column);
    }
    let scale = columns.iter().flatten().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
    let mut worst = 0.0f64;
    for (b, column) in columns.iter().enumerate() {
        let [plus, minus] = [STEP, -STEP].map(|by| {
            let mut delta_d = base.clone();
            delta_d[b / D][b % D] += by;
            force(&mut sum, &delta_d)
        });
        for (k, entry) in column.iter().flatten().enumerate() {
            worst = worst.max(((plus[k] - minus[k]) / (2.0 * STEP) - entry).abs() / scale);
        }
    }
    worst
}
