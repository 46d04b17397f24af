//! Cook's membrane: a clamped tapered panel under a shear force on its free end.

use mpm::stress::PlaneStrain;

use crate::meshes::{Cells, plane, written};
use crate::verification::surfaces::built;
use crate::verification::total_lagrangian::equilibrium;

/// Vertical displacement of the upper corner of the free end.
fn tip(n: usize, cells: Cells, method: &str, volumetric: &str, [young, poisson, traction]: [f64; 3]) -> f64 {
    let mesh = written(&plane([n, n], cells, |s, t| [48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s)]));
    let points = if cells == Cells::Simplices { "points_per_triangle: 4" } else { "points_per_cell: 2" };
    let (model, points) = built(&format!(
        "
version: 1
grid: {{type: gmsh, file: \"{}\"}}
materials: {{rubber: {{model: neo-hookean, young: {young}, poisson: {poisson}}}}}
bodies:
  - {{name: membrane, material: rubber, method: {method}, strain: {volumetric}, {points},
     shape: {{type: cells, group: body}}}}
surfaces: [{{name: end, body: membrane, part: {{group: right}}}}]
boundary_conditions: [{{name: wall, nodes: {{group: left}}, fix: [x, y]}}]
loads: [{{name: shear, type: traction, surface: end, traction: [0, {traction}]}}]
steps: {{count: 1}}
",
        mesh.path().display()
    ));
    let bent = equilibrium::<2, PlaneStrain>(model, points);
    bent.displacement[bent.node_at([48.0, 60.0])][1]
}

/// Young's modulus, Poisson's ratio and traction of the two membranes of the literature.
const NEARLY_INCOMPRESSIBLE: [f64; 3] = [240.565, 0.4999, 100.0 / 16.0];
const COMPRESSIBLE: [f64; 3] = [200.0, 0.35, 4.0];

/// The tips with 8, 16 and 32 cells along each side, and the limit of a sequence whose changes fall by a constant
/// factor. The corner at the wall is singular, so this factor is less than 4.
fn study(cells: Cells, volumetric: &str, membrane: [f64; 3]) -> ([f64; 3], f64) {
    let tips = [8, 16, 32].map(|n| tip(n, cells, "mpm", volumetric, membrane));
    let changes = [tips[1] - tips[0], tips[2] - tips[1]];
    let limit = tips[2] + changes[1].powi(2) / (changes[0] - changes[1]);
    println!("Cook, {cells:?}, {volumetric}: {tips:.4?}, limit {limit:.4}");
    assert!(changes[1] > 0.0 && (2.4..3.2).contains(&(changes[0] / changes[1])), "{tips:?}");
    (tips, limit)
}

/// The value in the literature, 6.908, was computed with a fine mesh (Elguedj et al. 2008). Three sequences of this
/// program have limits between 6.923 and 6.926.
#[test]
fn a_nearly_incompressible_membrane() {
    let quadrilaterals = study(Cells::Boxes, "mean-dilatation", NEARLY_INCOMPRESSIBLE);
    let centred = study(Cells::Boxes, "f-bar", NEARLY_INCOMPRESSIBLE);
    let triangles = study(Cells::Simplices, "mean-dilatation", NEARLY_INCOMPRESSIBLE);
    for ((tips, limit), most) in [(quadrilaterals, 3e-3), (centred, 3e-3), (triangles, 1.2e-2)] {
        assert!((tips[2] / 6.908 - 1.0).abs() < most, "{tips:?}");
        assert!((limit / 6.9245 - 1.0).abs() < 5e-4, "{limit}");
    }
    for (cells, most) in [(Cells::Boxes, 0.36), (Cells::Simplices, 0.33)] {
        let locked = tip(16, cells, "mpm", "standard", NEARLY_INCOMPRESSIBLE);
        println!("Cook, {cells:?}, standard: {locked:.4}");
        assert!(locked < most * 6.908, "{cells:?}: {locked}");
    }
}

/// The value in the literature is 6.1468 (6.1469 in the thesis of Müller 2015).
#[test]
fn a_compressible_membrane() {
    for volumetric in ["standard", "mean-dilatation", "mean"] {
        let (_, limit) = study(Cells::Boxes, volumetric, COMPRESSIBLE);
        assert!((limit / 6.1468 - 1.0).abs() < 6e-4, "{volumetric}: {limit}");
    }
}
