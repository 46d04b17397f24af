//! A block of incompressible neo-Hookean material bent to a sector of a ring (Rivlin 1949).
//!
//! A point moves from (X, Y), |X| ≤ ½, to the radius r with r² = 2αX + β and the angle Y/α: F is a stretch by λ = r/α
//! around and 1/λ along the radius. With Ŵ(λ) = μ/2 (λ² + λ⁻² − 2), equilibrium is d(r σ_r)/dr = σ_θ and σ_r = Ŵ(λ) −
//! Ŵ(λ₁), which vanishes on both curved sides for λ₁ λ₂ = 1, β = α √(1 + α²). The moment is ∫ r σ_θ dr.

use mpm::stress::{PlaneStrain, Solid};

use super::{in_powers, integral, orders};
use crate::meshes::{Cells, brick, plane, written};
use crate::verification::surfaces::{built, loaded};
use crate::verification::total_lagrangian::{Equilibrium, equilibrium};

const SHEAR: f64 = 1.0;
const POISSON: f64 = 0.4999;
/// Length of the half that is analysed.
const LENGTH: f64 = 2.0;

/// Angles by which the end turns, [rad].
const LARGE: f64 = std::f64::consts::FRAC_PI_2;
const SMALL: f64 = LARGE / 90.0;

struct Sector {
    alpha: f64,
    radii: [f64; 2],
}

/// The sector when the end has turned by an angle.
fn sector(turn: f64) -> Sector {
    let alpha = LENGTH / turn;
    let beta = alpha * 1f64.hypot(alpha);
    Sector { alpha, radii: [(beta - alpha).sqrt(), (beta + alpha).sqrt()] }
}

fn energy(stretch: f64) -> f64 {
    0.5 * SHEAR * (stretch.powi(2) + stretch.powi(-2) - 2.0)
}

/// Moment per depth, −∫ r σ_r dr.
fn moment(turn: f64) -> f64 {
    let Sector { alpha, radii: [a, b] } = sector(turn);
    let inner = a / alpha;
    -0.5 * SHEAR
        * ((b.powi(4) - a.powi(4)) / (4.0 * alpha.powi(2)) + alpha.powi(2) * (b / a).ln()
            - 0.5 * (inner.powi(2) + inner.powi(-2)) * (b * b - a * a))
}

#[test]
fn the_formula_is_the_integral_of_the_stress() {
    let Sector { alpha, radii } = sector(LARGE);
    let along = |r: f64| energy(r / alpha) - energy(radii[0] / alpha);
    let around = |r: f64| {
        let stretch = r / alpha;
        along(r) + SHEAR * (stretch.powi(2) - stretch.powi(-2))
    };
    assert!(along(radii[1]).abs() < 1e-14);
    assert!(integral(radii, around).abs() < 1e-12, "a force along the block");
    assert!((integral(radii, |r| r * around(r)) / moment(LARGE) - 1.0).abs() < 1e-10);
}

/// The deck of a block with n cells through its thickness, in the plane or in space.
fn deck<const D: usize>(n: usize, grid: &str, body: &str, volumetric: &str, turn: f64) -> String {
    let young = 2.0 * SHEAR * (1.0 + POISSON);
    let (idealisation, out) = if D == 3 {
        ("solid", "\n  - {name: flat, nodes: {box: {min: [-1, -1, 0], max: [1, 3, 9]}}, fix: [z]}")
    } else {
        ("plane-strain", "")
    };
    let h = 1.0 / n as f64;
    let grid = match (grid, D) {
        ("", 2) => format!("{{type: structured, origin: [-0.5, 0], size: [1, {LENGTH}], spacing: {h}}}"),
        ("", _) => {
            format!("{{type: structured, origin: [-0.5, 0, 0], size: [1, {LENGTH}, {h}], spacing: {h}}}")
        }
        (file, _) => format!("{{type: gmsh, file: \"{file}\"}}"),
    };
    format!(
        "
version: 1
analysis: {{idealisation: {idealisation}}}
grid: {grid}
materials: {{rubber: {{model: neo-hookean, young: {young}, poisson: {POISSON}}}}}
bodies: [{{name: block, material: rubber, strain: {volumetric}, {body}}}]
boundary_conditions:
  - {{name: middle, nodes: {{y: 0}}, fix: [y]}}
  - name: end
    nodes: {{y: {LENGTH}}}
    where: {{turn: factor*{turn}, a: {LENGTH}/turn, b: a*sqrt(1 + a^2), r: sqrt(2*a*X + b)}}
    ux: r*cos(turn) - sqrt(b) - X
    uy: r*sin(turn) - Y{out}
steps: {{count: 1}}
"
    )
}

/// Relative error of the moment of the end's reactions about the middle of the end. A force along the block, which
/// vanishes with refinement, does not contribute.
fn error<const D: usize>(bent: &Equilibrium<D>, depth: f64, turn: f64) -> f64 {
    let Sector { alpha, .. } = sector(turn);
    let middle = (alpha * 1f64.hypot(alpha)).sqrt();
    let centre = [middle * (turn.cos() - 1.0), middle * turn.sin()];
    let mut found = 0.0;
    for (a, reaction) in bent.reaction.iter().enumerate() {
        let place = bent.place(a);
        if (place[1] - LENGTH).abs() < 1e-9 {
            let [x, y] = [0, 1].map(|d| place[d] + bent.displacement[a][d] - centre[d]);
            found += x * reaction[1] - y * reaction[0];
        }
    }
    found / depth / moment(turn) - 1.0
}

fn in_plane(n: usize, method: &str, cells: Option<Cells>, volumetric: &str, turn: f64) -> f64 {
    let mesh = cells.map(|cells| written(&plane([n, 2 * n], cells, |s, t| [s - 0.5, LENGTH * t])));
    let file = mesh.as_ref().map(|m| m.path().display().to_string()).unwrap_or_default();
    let body = match cells {
        None => format!(
            "method: {method}, points_per_cell: 2, shape: {{type: box, min: [-0.5, 0], max: [0.5, {LENGTH}]}}"
        ),
        Some(Cells::Boxes) => {
            format!("method: {method}, points_per_cell: 2, shape: {{type: cells, group: body}}")
        }
        Some(Cells::Simplices) => {
            format!("method: {method}, points_per_triangle: 4, shape: {{type: cells, group: body}}")
        }
    };
    let (model, points) = built(&deck::<2>(n, &file, &body, volumetric, turn));
    error(&equilibrium::<2, PlaneStrain>(model, points), 1.0, turn)
}

fn in_space(n: usize, method: &str, cells: Option<Cells>, volumetric: &str, turn: f64) -> f64 {
    let depth = 1.0 / n as f64;
    let mesh = cells
        .map(|cells| written(&brick([n, 2 * n, 1], cells, |[x, y, z]| [x - 0.5, LENGTH * y, depth * z])));
    let file = mesh.as_ref().map(|m| m.path().display().to_string()).unwrap_or_default();
    let body = match cells {
        None => format!(
            "method: {method}, points_per_cell: 2, \
             shape: {{type: box, min: [-0.5, 0, 0], max: [0.5, {LENGTH}, {depth}]}}"
        ),
        Some(Cells::Boxes) => {
            format!("method: {method}, points_per_cell: 2, shape: {{type: cells, group: body}}")
        }
        Some(Cells::Simplices) => {
            format!("method: {method}, points_per_tetrahedron: 1, shape: {{type: cells, group: body}}")
        }
    };
    let text = deck::<3>(n, &file, &body, volumetric, turn);
    let (model, points) = mpm::deck::build::build::<3>(&loaded(&text)).unwrap_or_else(|e| panic!("{e:?}"));
    error(&equilibrium::<3, Solid>(model, points), depth, turn)
}

/// The error falls with order 2; the error of the standard method is hundreds of times larger.
#[test]
fn blocks_in_the_plane() {
    for (cells, volumetric, last) in [
        (None, "mean-dilatation", 2.5e-3),
        (None, "f-bar", 3e-3),
        (Some(Cells::Simplices), "mean-dilatation", 9e-3),
    ] {
        let errors = [4, 8, 16].map(|n| in_plane(n, "mpm", cells, volumetric, LARGE));
        println!("flexure, {cells:?}, {volumetric}: {}, {:.2?}", in_powers(&errors), orders(&errors));
        let order = 0.5 * (errors[0] / errors[2]).abs().log2();
        assert!(errors[2].abs() < last && (order - 1.9).abs() < 0.1, "{cells:?}, {volumetric}: {order}");
    }
    for (cells, least, most) in [(None, 14.0, 0.011), (Some(Cells::Simplices), 10.0, 0.016)] {
        let [locked, cured] =
            ["standard", "mean-dilatation"].map(|volumetric| in_plane(8, "mpm", cells, volumetric, SMALL));
        println!("flexure by 1°, {cells:?}: {locked:.2e}, {cured:.2e}");
        assert!(locked > least && cured.abs() < most, "{cells:?}: {locked} {cured}");
    }
}

/// In space, where ΔF̄ scales all three directions.
#[test]
fn blocks_in_space() {
    for (method, cells, volumetric, last) in [
        ("gimp", None, "mean-dilatation", 9e-3),
        ("mpm", None, "f-bar", 1e-2),
        ("mpm", Some(Cells::Boxes), "f-bar", 1e-2),
        ("mpm", Some(Cells::Simplices), "mean-dilatation", 3e-2),
    ] {
        let errors = [4, 8].map(|n| in_space(n, method, cells, volumetric, LARGE));
        println!("space, {method}, {cells:?}, {volumetric}: {}, {:.2?}", in_powers(&errors), orders(&errors));
        assert!(errors[1].abs() < last && orders(&errors)[0] > 1.8, "{method}, {cells:?}, {volumetric}");
    }
    for (cells, least) in [(None, 55.0), (Some(Cells::Simplices), 12.0)] {
        let locked = in_space(4, "mpm", cells, "standard", SMALL);
        println!("space by 1°, {cells:?}, standard: {locked:.2e}");
        assert!(locked > least, "{cells:?}: {locked}");
    }
}
