//! Homogeneous motions: no stress under rotation, uniform stress under stretch, for every method and grid.

use mpm::basis::Method;
use mpm::domain::DomainUpdate;
use mpm::grid::{Axis, Grid, Interval, Structured};
use mpm::material::{Elasticity, Hencky};
use mpm::model::NodeSet;
use mpm::points::Points;
use mpm::stress::CellStrain;
use mpm::tensor::{Mat3, Sym3};

use super::bodies::{
    Filling, cells_in, fill, homogeneous, logarithmic_strain, mesh, model, nodes_where, rotation, watch,
};

const YOUNG: f64 = 1e6;
const POISSON: f64 = 0.3;

/// The grids: a block of 4 × 4 × 4 in the middle of 8 × 8 × 8.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Structured,
    Graded,
    Hexahedra,
    Tetrahedra,
}

/// Centre of the block.
const CENTRE: [f64; 3] = [4.0; 3];

/// All supported combinations of grid and method, with parts per cell and axis.
const CASES: [(Kind, Method, [usize; 3]); 14] = [
    (Kind::Structured, Method::Mpm, [2; 3]),
    (Kind::Structured, Method::Gimp, [2; 3]),
    (Kind::Structured, Method::Cpdi1, [2; 3]),
    (Kind::Structured, Method::Cpdi2, [2; 3]),
    (Kind::Graded, Method::Mpm, [2; 3]),
    (Kind::Graded, Method::Gimp, [2; 3]),
    (Kind::Graded, Method::Cpdi1, [2; 3]),
    (Kind::Graded, Method::Cpdi2, [2; 3]),
    (Kind::Hexahedra, Method::Mpm, [2; 3]),
    (Kind::Hexahedra, Method::Cpdi1, [1; 3]),
    (Kind::Hexahedra, Method::Cpdi2, [2, 1, 2]),
    (Kind::Tetrahedra, Method::Mpm, [2, 2, 1]),
    (Kind::Tetrahedra, Method::Cpdi1, [1; 3]),
    (Kind::Tetrahedra, Method::Cpdi2, [1; 3]),
];

/// The default treatment of domains and volumes.
const CORNERS: (DomainUpdate, CellStrain) = (DomainUpdate::Corners, CellStrain::Standard);

/// True if the points of an undeformed body integrate the gradients of the basis exactly. False for standard points in
/// distorted hexahedra, whose basis is not polynomial in x.
fn is_exact(kind: Kind, method: Method) -> bool {
    (kind, method) != (Kind::Hexahedra, Method::Mpm)
}

/// Result of a step: largest error of the deformation gradient, and of the stress relative to Young's modulus.
#[derive(Debug, Default)]
struct Errors {
    gradient: f64,
    stress: f64,
    free: usize,
    steps: usize,
}

fn largest(m: &Mat3) -> f64 {
    m.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn stress_of(f: &Mat3) -> Sym3 {
    Elasticity::from_young_poisson(YOUNG, POISSON).stress(&logarithmic_strain(f))
}

/// The rectilinear grid of this kind, with lines on the sides of the block. The sides of the cells of a graded grid
/// differ by a factor of up to 4.
fn structured(kind: Kind) -> Structured<3> {
    if kind == Kind::Structured {
        return Structured::new([0.0; 3], [2.0 / 3.0; 3], [12; 3]);
    }
    let axis = |[below, inside, above]: [f64; 3]| {
        let interval = |to, cells, ratio| Interval { to, cells, ratio };
        let intervals = [interval(2.0, 3, below), interval(6.0, 6, inside), interval(8.0, 3, above)];
        Axis::from_intervals(0.0, &intervals).unwrap()
    };
    Structured::with_axes([[0.8, 1.3, 1.0], [1.0, 0.8, 1.2], [1.5, 1.0, 0.6]].map(axis))
}

/// Moves the body in increments about its centre; prescribes all nodes if `everywhere`, otherwise those touched by the
/// outer layer.
fn moved(
    (kind, method, n): (Kind, Method, [usize; 3]),
    (update, volumetric): (DomainUpdate, CellStrain),
    increment: Mat3,
    steps: usize,
    everywhere: bool,
) -> Errors {
    let law = Hencky::new(YOUNG, POISSON);
    let filling = Filling { method, n, density: 0.0 };
    let (mut model, seeds) = match kind {
        Kind::Structured | Kind::Graded => {
            let grid = structured(kind);
            let seeds = fill(&grid, &cells_in(&grid, [2.0; 3], [6.0; 3]), filling, &law);
            (model(grid, law, method, update, steps), seeds)
        }
        _ => {
            let grid = mesh(if kind == Kind::Hexahedra { "block_hexahedra" } else { "block_tetrahedra" });
            let seeds = fill(&grid, grid.cell_set("block").unwrap(), filling, &law);
            (model(grid, law, method, update, steps), seeds)
        }
    };
    model.bodies[0].strain = volumetric;
    let mut points = Points::new(&seeds);
    let nodes = if everywhere { nodes_where(model.grid.as_ref(), |_| true) } else { NodeSet::OuterLayer(0) };
    model.boundary_conditions = vec![homogeneous(nodes, &increment, CENTRE, steps)];
    let mut errors = Errors::default();
    let mut f = Mat3::identity();
    let outcome = watch(&model, &mut points, |points, report| {
        f = increment * f;
        let exact = stress_of(&f);
        for p in 0..points.len() {
            let gradient = largest(&(points.converged.deformation_gradient[p] - f));
            errors.gradient = errors.gradient.max(gradient);
            let stress = (points.converged.kirchhoff_stress[p] - exact).norm() / YOUNG;
            errors.stress = errors.stress.max(stress);
        }
        errors.free = errors.free.max(report.unknowns);
        errors.steps += 1;
    });
    outcome.unwrap_or_else(|error| panic!("{kind:?} {method:?} {update:?} {volumetric:?}: {error}"));
    println!("{kind:?} {method:?} {n:?} {update:?} {volumetric:?}: {errors:?}");
    errors
}

/// Rotation by 90° about an oblique axis in six increments; the interior is free.
#[test]
fn rotation_leaves_no_stress() {
    let increment = rotation([1.0, 2.0, 3.0], 15f64.to_radians());
    for case in CASES {
        let errors = moved(case, CORNERS, increment, 6, false);
        assert!(errors.stress < 1e-12 && errors.gradient < 1e-12, "{case:?}: {errors:?}");
        assert!(errors.free > 0 && errors.steps == 6, "{case:?}: {errors:?}");
    }
}

/// Stretches of 1.4, 0.8 and 1.1 combined with shear and a rotation by 40°; the interior is free.
#[test]
fn a_large_step_gives_uniform_stress() {
    let increment = rotation([-1.0, 0.5, 1.0], 40f64.to_radians())
        * Mat3::new(1.4, 0.2, 0.0, 0.0, 0.8, 0.1, 0.0, 0.0, 1.1);
    for case in CASES.into_iter().filter(|(kind, method, _)| is_exact(*kind, *method)) {
        let errors = moved(case, CORNERS, increment, 1, false);
        assert!(errors.stress < 1e-12 && errors.gradient < 1e-12, "{case:?}: {errors:?}");
        assert!(errors.free > 0, "{case:?}: {errors:?}");
    }
}

/// The same, with the volume ratio of the points taken from their cells or patches.
#[test]
fn a_large_step_gives_uniform_stress_with_the_volume_of_cells() {
    let increment = rotation([-1.0, 0.5, 1.0], 40f64.to_radians())
        * Mat3::new(1.4, 0.2, 0.0, 0.0, 0.8, 0.1, 0.0, 0.0, 1.1);
    for case in CASES.into_iter().filter(|(kind, method, _)| is_exact(*kind, *method)) {
        for volumetric in [CellStrain::MeanDilatation, CellStrain::FBar, CellStrain::Mean] {
            if volumetric == CellStrain::FBar && (!case.1.has_centres() || case.0 == Kind::Tetrahedra) {
                continue;
            }
            let errors = moved(case, (DomainUpdate::Corners, volumetric), increment, 1, false);
            assert!(errors.stress < 1e-12 && errors.gradient < 1e-12, "{case:?} {volumetric:?}: {errors:?}");
            assert!(errors.free > 0, "{case:?}: {errors:?}");
        }
    }
}

/// An increment that stretches and rotates.
fn stretch_and_turn() -> Mat3 {
    rotation([0.3, 1.0, -0.4], 12f64.to_radians())
        * Mat3::new(1.02, 0.02, 0.0, 0.0, 0.96, 0.03, 0.0, 0.0, 1.01)
}

/// The domains of CPDI keep filling the body without gaps, so that every step integrates exactly; the interior is free.
#[test]
fn increments_give_uniform_stress_under_cpdi() {
    let cpdi = |method: Method| matches!(method, Method::Cpdi1 | Method::Cpdi2);
    for case in CASES.into_iter().filter(|(_, method, _)| cpdi(*method)) {
        let errors = moved(case, CORNERS, stretch_and_turn(), 6, false);
        assert!(errors.stress < 1e-11 && errors.gradient < 1e-11, "{case:?}: {errors:?}");
        assert!(errors.free > 0, "{case:?}: {errors:?}");
    }
}

/// With all nodes prescribed, gradients, stresses and domain updates are exact for every method.
#[test]
fn increments_give_uniform_stress_where_all_nodes_move() {
    for case in CASES {
        let errors = moved(case, CORNERS, stretch_and_turn(), 6, true);
        assert!(errors.stress < 1e-12 && errors.gradient < 1e-12, "{case:?}: {errors:?}");
    }
    for update in [
        DomainUpdate::None,
        DomainUpdate::Determinant,
        DomainUpdate::Diagonal,
        DomainUpdate::Stretch,
        DomainUpdate::DiagonalCorrected,
        DomainUpdate::DiagonalIncremental,
    ] {
        // Up to 48°, so that the diagonal of F stays positive.
        let errors = moved(
            (Kind::Structured, Method::Gimp, [2; 3]),
            (update, CellStrain::Standard),
            stretch_and_turn(),
            4,
            true,
        );
        assert!(errors.stress < 1e-12 && errors.gradient < 1e-12, "{update:?}: {errors:?}");
    }
}
