//! The same problem on a structured grid, on the same grid imported from gmsh, and on triangles.

use mpm::points::Points;

use crate::verification::analysis::{Analysis, run, run_text};

fn beam(grid: &str, method: &str) -> Analysis {
    let deck = std::fs::read_to_string(format!("{}/inputs/beam.yaml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let structured = "{type: structured, origin: [0, 0], size: [11, 10], spacing: \"${h}\"}";
    assert!(deck.contains(structured));
    let text = deck.replace(structured, grid);
    run_text(&text, &[("method", method), ("n", "6"), ("steps", "50")]).completed()
}

/// Largest distance between the loaded points of two runs in each step, m.
fn distances(a: &Analysis, b: &Analysis) -> Vec<f64> {
    let apart = |k: usize| {
        let (u, v) = (a.steps[k].probes[0], b.steps[k].probes[0]);
        (u[0] - v[0]).hypot(u[1] - v[1])
    };
    (0..a.steps.len()).map(apart).collect()
}

/// Nodes and cells are numbered differently, so sums are rounded differently. With the standard method, the matrix is
/// indefinite from step 8 on (a cell held by one point near its edge), which amplifies the difference.
#[test]
fn imported_quadrilaterals_give_the_structured_answer() {
    for (method, alike) in [("mpm", 7), ("cpdi2", 50)] {
        let imported = beam("{type: gmsh, file: tests/data/mesh/rectangle_quad_h0.5.msh}", method);
        let structured = beam("{type: structured, origin: [0, 0], size: [11, 10], spacing: 0.5}", method);
        let apart = distances(&imported, &structured);
        println!("{method}: {:.1e} m", apart.iter().copied().fold(0.0, f64::max));
        assert!(apart[..alike].iter().all(|d| *d < 1e-12), "{method}: {apart:?}");
        assert!(apart.iter().all(|d| *d < 1e-7), "{method}: {apart:?}");
        assert_eq!(imported.evaluations(), structured.evaluations());
    }
}

/// The cantilever under its own weight, 4 m x 1 m: E = 1 MPa, ν = 0, ρ = 100 kg/m³, g = 8 m/s².
mod cantilever {
    use super::*;

    pub const SIZES: [&str; 4] = ["0.5", "0.25", "0.125", "0.0625"];
    pub const WEIGHT: f64 = 3200.0;

    pub fn imported(cells: &str, h: &str) -> Analysis {
        run("cantilever.yaml", &[("cells", cells), ("h", h)]).completed()
    }

    pub fn structured(h: &str) -> Analysis {
        run("cantilever/structured.yaml", &[("h", h)]).completed()
    }

    /// Descent of the centre of mass, m: it converges, unlike the displacement under a point load.
    pub fn drop(points: &Points<2>) -> f64 {
        let mass: f64 = points.mass.iter().sum();
        let moved = |p: usize| points.original_position[p][1] - points.converged.position[p][1];
        (0..points.mass.len()).map(|p| points.mass[p] * moved(p)).sum::<f64>() / mass
    }
}

/// Largest distance between the points of two analyses that start at the same positions, m.
fn farthest(a: &Points<2>, b: &Points<2>) -> f64 {
    let sorted = |points: &Points<2>| {
        let mut all: Vec<([f64; 2], [f64; 2])> = (0..points.id.len())
            .map(|p| (points.original_position[p], points.converged.position[p]))
            .collect();
        // Round-off may differ between the two; the points of one row are much farther apart than 1e-6.
        let key = |x: &[f64; 2]| ((x[1] * 1e6).round() as i64, (x[0] * 1e6).round() as i64);
        all.sort_by_key(|(original, _)| key(original));
        all
    };
    let (a, b) = (sorted(a), sorted(b));
    assert_eq!(a.len(), b.len());
    let apart = |x: [f64; 2], y: [f64; 2]| (x[0] - y[0]).hypot(x[1] - y[1]);
    a.iter().zip(&b).map(|(a, b)| apart(a.0, b.0).max(apart(a.1, b.1))).fold(0.0, f64::max)
}

#[test]
fn every_point_of_a_bar_moves_alike_on_the_imported_squares() {
    for h in ["0.5", "0.25", "0.125"] {
        let (structured, imported) = (cantilever::structured(h), cantilever::imported("quadrilaterals", h));
        let apart = farthest(&structured.points, &imported.points);
        println!("h = {h} m, {} points: at most {apart:.1e} m apart", structured.points.id.len());
        assert!(apart < 1e-12, "h = {h} m: {apart:e} m");
        assert_eq!(structured.evaluations(), imported.evaluations());
    }
}

/// Both sequences converge with order 2, the order of linear and of bilinear elements, to one limit: their difference
/// falls with the same order, and the limit agrees with beam theory.
#[test]
fn triangles_converge_to_the_answer_of_squares() {
    let drops =
        |cells: &str| cantilever::SIZES.map(|h| cantilever::drop(&cantilever::imported(cells, h).points));
    let (squares, triangles) = (drops("quadrilaterals"), drops("triangles"));
    let apart: [f64; 4] = std::array::from_fn(|k| squares[k] - triangles[k]);
    for (k, h) in cantilever::SIZES.iter().enumerate() {
        println!("h = {h} m: {:.6} m, {:.6} m, difference {:.2e} m", squares[k], triangles[k], apart[k]);
    }
    for (name, drops) in [("squares", squares), ("triangles", triangles)] {
        let changes: [f64; 3] = std::array::from_fn(|k| drops[k + 1] - drops[k]);
        let orders = [0, 1].map(|k| (changes[k] / changes[k + 1]).log2());
        println!("{name}: orders of the changes {orders:.2?}");
        assert!(changes.iter().all(|change| *change > 0.0), "{name}: {changes:?}");
        assert!(orders.iter().all(|order| (1.6..2.4).contains(order)), "{name}: {orders:?}");
    }
    let orders = [0, 1, 2].map(|k| (apart[k] / apart[k + 1]).log2());
    let fitted = fitted_order(&apart);
    println!("difference: orders {orders:.2?}, fitted {fitted:.2}");
    assert!(orders.iter().all(|order| *order > 1.6), "{orders:?}");
    assert!((fitted - 2.0).abs() < 0.2, "{fitted}");
    // Timoshenko: q L⁴/(20 E I) + q L²/(3 κ G A), κ = 5/6; the deflection itself shortens the lever arm a little.
    let load = cantilever::WEIGHT / 4.0 / 1e6;
    let beam_theory = load * (256.0 * 12.0 / 20.0 + 16.0 / 3.0 * 2.0 * 1.2);
    let limits = [squares, triangles].map(|d| d[3] + (d[3] - d[2]) / 3.0);
    println!("limits {limits:.5?} m, beam theory {beam_theory:.5} m");
    assert!(limits.iter().all(|limit| (limit / beam_theory - 1.0).abs() < 0.01), "{limits:?}");
    assert!((limits[0] / limits[1] - 1.0).abs() < 2e-3, "{limits:?}");
}

/// Slope of the logarithm of values over the logarithm of a size that is halved each time.
fn fitted_order(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let logs = values.iter().map(|v| v.abs().log2());
    let slope: f64 = logs.enumerate().map(|(k, y)| (k as f64 - middle) * y).sum();
    -slope / (n * (n * n - 1.0) / 12.0)
}

/// A square of 3 × 3 distorted quadrilaterals inside a square of 7 × 7, in gmsh's format 2.2.
fn distorted_mesh() -> std::path::PathBuf {
    use std::fmt::Write;
    const N: usize = 8;
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 \"body\"\n2 2 \"rest\"\n\
                    $EndPhysicalNames\n$Nodes\n64\n"
        .to_owned();
    for k in 0..N * N {
        let (i, j) = ((k % N) as f64, (k / N) as f64);
        let inside = (1.0..6.5).contains(&i) && (1.0..6.5).contains(&j);
        let shift = |a: f64, b: f64| if inside { 0.25 * (a * 1.7 + b * 2.9).sin() } else { 0.0 };
        writeln!(text, "{} {} {} 0", k + 1, i + shift(i, j), j + shift(j + 1.0, i)).unwrap();
    }
    text += "$EndNodes\n$Elements\n49\n";
    for k in 0..(N - 1) * (N - 1) {
        let (i, j) = (k % (N - 1), k / (N - 1));
        let group = if (2..5).contains(&i) && (2..5).contains(&j) { 1 } else { 2 };
        let a = j * N + i + 1;
        writeln!(text, "{} 3 2 {group} {group} {a} {} {} {}", k + 1, a + 1, a + N + 1, a + N).unwrap();
    }
    text += "$EndElements\n";
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("distorted.msh");
    std::fs::write(&path, text).unwrap();
    path
}

/// Homogeneous motions of a body of distorted cells: all points and their deformation gradients follow the motion to
/// round-off, and a rotation leaves no stress.
#[test]
fn homogeneous_motions_of_distorted_cells() {
    let mesh = distorted_mesh();
    for method in ["mpm", "cpdi1", "cpdi2"] {
        for n in [1, 2] {
            // Five steps of a rotation by 18° about (3.5, 3.5) each, or of a stretch by 2 % and a shear.
            let (sin, cos) = 18f64.to_radians().sin_cos();
            for increment in [[cos, -sin, sin, cos], [1.02, 0.03, -0.01, 0.98]] {
                let [a, b, c, d] = increment;
                let text = format!(
                    "
version: 1
grid: {{type: gmsh, file: '{}'}}
materials: {{m: {{model: hencky, young: 1, poisson: 0.3}}}}
bodies: [{{name: body, material: m, shape: {{type: cells, group: body}}, method: {method}, points_per_cell: {n}}}]
boundary_conditions:
  - name: all
    nodes: {{box: {{min: [0, 0], max: [7, 7]}}}}
    where: {{X0: x - 3.5, Y0: y - 3.5}}
    ux: '5*(({a} - 1)*X0 + {b}*Y0)'
    uy: '5*({c}*X0 + ({d} - 1)*Y0)'
steps: {{count: 5}}
",
                    mesh.display()
                );
                let analysis = run_text(&text, &[]).completed();
                let points = &analysis.points;
                let whole = nalgebra::Matrix2::new(a, b, c, d).pow(5);
                let centre = nalgebra::Vector2::new(3.5, 3.5);
                for p in 0..points.len() {
                    let original = nalgebra::Vector2::from(points.original_position[p]);
                    let there = whole * (original - centre) + centre;
                    let apart = (there - nalgebra::Vector2::from(points.converged.position[p])).norm();
                    assert!(apart < 1e-13, "{method} {n} {increment:?}: {apart:e}");
                    let gradient = points.converged.deformation_gradient[p].fixed_view::<2, 2>(0, 0) - whole;
                    assert!(gradient.norm() < 1e-12, "{method} {n} {increment:?}: {gradient}");
                    if increment[0] == cos {
                        let stress = points.converged.kirchhoff_stress[p].0;
                        assert!(stress.iter().all(|s| s.abs() < 1e-13), "{method} {n}: {stress:?}");
                    }
                }
            }
        }
    }
}
