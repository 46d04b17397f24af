//! Bodies of revolution: homogeneous deformation compared with its closed form, thick cylinders and spheres with the
//! ordinary differential equation of radial motion, and a cylinder with the same cylinder in plane strain.

use std::fmt::Write;

use mpm::material::{Hencky, Material, NeoHookean, VonMises};
use mpm::tensor::Sym3;

use crate::verification::analysis::{Analysis, run_text};
use crate::verification::radial::{Inner, Radial, Shell};

const HENCKY: &str = "{model: hencky, young: 1, poisson: 0.3}";
const NEO_HOOKEAN: &str = "{model: neo-hookean, young: 1, poisson: 0.3}";
const VON_MISES: &str =
    "{model: von-mises, young: 1, poisson: 0.3, deviatoric_yield_stress: 0.2, hardening_modulus: 0.1}";
/// Deviatoric yield stress of [`VON_MISES`].
const YIELD: f64 = 0.2;

/// A material that yields early and hardens so much that no load is too large for it.
const HARDENING: &str =
    "{model: von-mises, young: 1, poisson: 0.3, deviatoric_yield_stress: 0.1, hardening_modulus: 0.5}";

fn law(material: &str) -> Box<dyn Material> {
    match material {
        HARDENING => Box::new(VonMises::new(1.0, 0.3, 0.1).hardening(0.5)),
        HENCKY => Box::new(Hencky::new(1.0, 0.3)),
        NEO_HOOKEAN => Box::new(NeoHookean::new(1.0, 0.3)),
        _ => Box::new(VonMises::new(1.0, 0.3, YIELD).hardening(0.1)),
    }
}

/// Orders of convergence from one error to the next, when the spacing is halved.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// Distance of a position from the axis (cylinder) or the centre (sphere and quarter ring).
fn radius(shell: Shell, place: [f64; 2], in_plane: bool) -> f64 {
    if shell == Shell::Cylinder && !in_plane { place[0] } else { place[0].hypot(place[1]) }
}

/// Root mean square distance of the points from their reference positions, weighted with their volume, and the largest
/// original radius of a point that flows.
fn compare(analysis: &Analysis, reference: &Radial, shell: Shell, in_plane: bool) -> (f64, f64) {
    let points = &analysis.points;
    let (mut sum, mut volume, mut front) = (0.0, 0.0, 0.0f64);
    for p in 0..points.len() {
        let (from, to) = (points.original_position[p], points.converged.position[p]);
        let r = radius(shell, from, in_plane);
        let stretch = reference.radius(r) / r;
        let expected = if shell == Shell::Cylinder && !in_plane {
            [stretch * from[0], from[1]]
        } else {
            from.map(|x| stretch * x)
        };
        let off = (to[0] - expected[0]).hypot(to[1] - expected[1]);
        sum += off * off * points.original_volume[p];
        volume += points.original_volume[p];
        if points.history_len > 0 && points.converged.history[p] > 0.0 {
            front = front.max(r);
        }
    }
    ((sum / volume).sqrt(), front)
}

/// The thick cylinder of `inputs/cylinder.yaml` with n cells over its thickness and another material.
fn cylinder(material: &str, n: usize, to: f64) -> Analysis {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/inputs/cylinder.yaml");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(VON_MISES));
    let set = [("h", (1.0 / n as f64).to_string()), ("to", to.to_string())];
    run_text(&text.replace(VON_MISES, material), &set.each_ref().map(|(name, value)| (*name, value.as_str())))
        .completed()
}

/// Thick cylinder, inner radius from 1 to 1.5 in one step: the displacement converges with order 2.
#[test]
fn thick_cylinder_against_its_differential_equation() {
    for material in [HENCKY, NEO_HOOKEAN, VON_MISES] {
        let law = law(material);
        let mut reference = Radial::new(Shell::Cylinder, [1.0, 2.0], law.as_ref(), 200);
        reference.step(Inner::Moved(1.5), |_| 0.0);
        assert!(reference.largest_distortion() > 1.7, "{}", reference.largest_distortion());
        let sizes = [8, 16, 32, 64];
        let mut errors = Vec::new();
        for n in sizes {
            let (error, front) = compare(&cylinder(material, n, 1.5), &reference, Shell::Cylinder, false);
            if material == VON_MISES {
                let exact = reference.front(YIELD);
                println!("cylinder, {n} cells: front {front:.4}, exact {exact:.4}");
                assert!((front - exact).abs() < 1.0 / n as f64, "{n}: {front} {exact}");
            }
            errors.push(error);
        }
        let orders = orders(&errors);
        println!("cylinder {material}: {errors:?}, orders {orders:.2?}");
        assert!(orders.iter().all(|order| (1.8..2.3).contains(order)), "{material}: {errors:?} {orders:?}");
    }
}

/// Nodes and cells of a quarter of a ring as MSH 2.2: the group `shell` is 1 ≤ r ≤ 2, with n cells of equal extent
/// along the radius; n/2 more cells beyond it leave room for the shell to move.
fn quarter(n: usize, triangles: bool) -> String {
    let (rings, rays) = (n + n / 2, n);
    let mut nodes = String::new();
    for i in 0..=rings {
        for j in 0..=rays {
            let r = 1.0 + i as f64 / n as f64;
            let angle = std::f64::consts::FRAC_PI_2 * j as f64 / rays as f64;
            // Nodes of the axes lie exactly on the axes.
            let x = if j == rays { 0.0 } else { r * angle.cos() };
            let y = if j == 0 { 0.0 } else { r * angle.sin() };
            let _ = writeln!(nodes, "{} {x:.17e} {y:.17e} 0", i * (rays + 1) + j + 1);
        }
    }
    let node = |i: usize, j: usize| i * (rays + 1) + j + 1;
    let mut elements = Vec::new();
    for j in 0..rays {
        elements.push(format!("1 2 1 1 {} {}", node(0, j), node(0, j + 1)));
    }
    for i in 0..rings {
        let group = if i < n { 2 } else { 3 };
        for j in 0..rays {
            let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
            if triangles {
                elements.push(format!("2 2 {group} {group} {a} {b} {c}"));
                elements.push(format!("2 2 {group} {group} {a} {c} {d}"));
            } else {
                elements.push(format!("3 2 {group} {group} {a} {b} {c} {d}"));
            }
        }
    }
    let count = elements.len();
    let elements: String = (1..).zip(elements).map(|(k, element)| format!("{k} {element}\n")).collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"inside\"\n2 2 \"shell\"\n2 3 \"room\"\n\
         $EndPhysicalNames\n$Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        (rings + 1) * (rays + 1)
    )
}

/// A shell between the radii 1 and 2 on a quarter of a ring of cells, its inner side moved to the radius `to` in one
/// step: a sphere under axisymmetry, a cylinder in plane strain.
fn on_a_quarter(idealisation: &str, material: &str, n: usize, triangles: bool, to: f64) -> Analysis {
    let mut mesh = tempfile::NamedTempFile::with_suffix(".msh").unwrap();
    std::io::Write::write_all(&mut mesh, quarter(n, triangles).as_bytes()).unwrap();
    let points = if triangles { "points_per_triangle: 4" } else { "points_per_cell: 2" };
    let text = format!(
        "
version: 1
parameters: {{u: 0}}
analysis: {{idealisation: {idealisation}}}
grid: {{type: gmsh, file: \"{}\"}}
materials: {{shell: {material}}}
bodies:
  - {{name: shell, material: shell, shape: {{type: cells, group: shell}}, method: mpm, {points}}}
boundary_conditions:
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
  - {{name: plane, nodes: {{y: 0}}, fix: [y]}}
  - {{name: inside, nodes: {{group: inside}}, ux: \"u*x\", uy: \"u*y\"}}
steps: {{count: 1}}
",
        mesh.path().display()
    );
    run_text(&text, &[("u", &(to - 1.0).to_string())]).completed()
}

/// Thick sphere, inner radius from 1 to 1.4 in one step, on quadrilaterals and on triangles: the displacement converges
/// with order 2.
#[test]
fn thick_sphere_against_its_differential_equation() {
    for (material, triangles) in [(HENCKY, false), (HENCKY, true), (VON_MISES, false), (VON_MISES, true)] {
        let law = law(material);
        let mut reference = Radial::new(Shell::Sphere, [1.0, 2.0], law.as_ref(), 200);
        reference.step(Inner::Moved(1.4), |_| 0.0);
        assert!(reference.largest_distortion() > 1.7, "{}", reference.largest_distortion());
        let mut errors = Vec::new();
        for n in [8, 16, 32] {
            let analysis = on_a_quarter("axisymmetric", material, n, triangles, 1.4);
            let (error, front) = compare(&analysis, &reference, Shell::Sphere, true);
            if material == VON_MISES {
                let exact = reference.front(YIELD);
                println!("sphere, {n} cells: front {front:.4}, exact {exact:.4}");
                assert!((front - exact).abs() < 1.0 / n as f64, "{n}: {front} {exact}");
            }
            errors.push(error);
        }
        let orders = orders(&errors);
        println!("sphere {material}, triangles {triangles}: {errors:?}, orders {orders:.2?}");
        assert!(orders.iter().all(|order| (1.8..2.3).contains(order)), "{material}: {errors:?} {orders:?}");
    }
}

/// The cylinder under axisymmetry and a quarter of its ring in plane strain are the same problem: the difference of the
/// inner pressures, computed from the reactions, vanishes with order 2.
#[test]
fn a_cylinder_is_the_ring_in_plane_strain() {
    for material in [HENCKY, VON_MISES] {
        let law = law(material);
        let mut reference = Radial::new(Shell::Cylinder, [1.0, 2.0], law.as_ref(), 200);
        reference.step(Inner::Moved(1.4), |_| 0.0);
        let (mut errors, mut differences) = (Vec::new(), Vec::new());
        for n in [8, 16, 32] {
            let ring = on_a_quarter("plane-strain", material, n, false, 1.4);
            errors.push(compare(&ring, &reference, Shell::Cylinder, true).0);
            let revolved = cylinder(material, n, 1.4);
            // The force along x on a quarter of the inner side is the pressure times its height; on the full circle it
            // is the pressure times the circumference. Both are per length of the cylinder.
            let height = 1.0 / n as f64;
            let circle = revolved.steps[0].reactions[0][0] / height / (2.0 * std::f64::consts::PI * 1.4);
            let quarter = ring.steps[0].reactions[2][0] / 1.4;
            differences.push((circle / quarter - 1.0).abs());
        }
        let (error_orders, difference_orders) = (orders(&errors), orders(&differences));
        println!(
            "ring {material}: {errors:?} {error_orders:.2?}, pressures differ {differences:?} {difference_orders:.2?}"
        );
        assert!(error_orders.iter().all(|order| (1.8..2.3).contains(order)), "{errors:?} {error_orders:?}");
        assert!(difference_orders.iter().all(|order| *order > 1.7), "{differences:?} {difference_orders:?}");
        assert!(differences[2] < 2e-3, "{differences:?}");
    }
}

/// A cylinder that spins, free inside and outside, in many steps: the points wander through the grid, which starts
/// afresh each time. With GIMP, its displacement converges to that of the reference under the same steps, with an order
/// that reaches 2; standard points come near the reference, but do not converge, because their gradients jump when they
/// change cells.
#[test]
fn a_spinning_cylinder_in_many_steps() {
    const STEPS: usize = 10;
    for (material, pull) in [(HENCKY, 0.1), (HARDENING, 0.05)] {
        let law = law(material);
        let mut reference = Radial::new(Shell::Cylinder, [1.0, 2.0], law.as_ref(), 200);
        for step in 1..=STEPS {
            let factor = step as f64 / STEPS as f64;
            reference.step(Inner::Free, |r| pull * factor * r);
        }
        println!("spinning {material}: inner radius {:.4}", reference.radius(1.0));
        for method in ["mpm", "gimp"] {
            let mut errors = Vec::new();
            for n in [8, 16, 32, 64] {
                let text = format!(
                    "
version: 1
parameters: {{h: 1, c: {pull}}}
analysis: {{idealisation: axisymmetric}}
grid: {{type: structured, origin: [0, 0], size: [4, \"${{h}}\"], spacing: \"${{h}}\"}}
materials: {{shell: {material}}}
bodies:
  - {{name: shell, material: shell, shape: {{type: box, min: [1, 0], max: [2, \"${{h}}\"]}},
     method: {method}, points_per_cell: 4}}
boundary_conditions:
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
  - {{name: flat, nodes: {{box: {{min: [0, 0], max: [4, \"${{h}}\"]}}}}, fix: [y]}}
loads:
  - {{name: spin, type: body-force, force: [\"c*X\", 0]}}
steps: {{count: {STEPS}}}
"
                );
                let analysis = run_text(&text, &[("h", &(1.0 / n as f64).to_string())]).completed();
                let (error, front) = compare(&analysis, &reference, Shell::Cylinder, false);
                errors.push(error);
                assert!(material != HARDENING || front > 1.0, "nothing flows");
            }
            let orders = orders(&errors);
            println!("spinning {material}, {method}: {errors:?}, orders {orders:.2?}");
            if method == "gimp" {
                // The front of plastic flow crosses points one by one, so that the order sets in late.
                let (first, last) = if material == HENCKY { (1.5, 1.9) } else { (0.4, 1.5) };
                assert!(orders[0] > first && orders[2] > last, "{errors:?} {orders:?}");
                assert!(errors.is_sorted_by(|coarse, fine| coarse > fine), "{errors:?}");
            }
            assert!(errors[3] < 3e-4, "{errors:?}");
        }
    }
}

/// A solid cylinder is stretched uniformly along and across the axis in many steps, with all nodes prescribed: the
/// stress equals that of the law to round-off, even at the axis, and the force along the axis is the stress times the
/// area of the full circle.
#[test]
fn homogeneous_stretch_down_to_the_axis() {
    const STEPS: i32 = 10;
    let (across, along) = (0.03, -0.05); // logarithmic, per step
    for method in ["mpm", "gimp"] {
        let text = format!(
            "
version: 1
parameters: {{a: 0, b: 0}}
analysis: {{idealisation: axisymmetric}}
grid: {{type: structured, origin: [0, 0], size: [2, 2], spacing: 0.125}}
materials: {{rubber: {HENCKY}}}
bodies:
  - {{name: rod, material: rubber, shape: {{type: box, min: [0, 0], max: [1, 1.5]}}, method: {method}, points_per_cell: 2}}
boundary_conditions:
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
  - {{name: all, nodes: {{box: {{min: [0, 0], max: [2, 2]}}}}, ux: \"a*x\", uy: \"b*y\"}}
steps: {{count: {STEPS}}}
"
        );
        let per_step = |stretch: f64| (f64::from(STEPS) * stretch.exp_m1()).to_string();
        let analysis = run_text(&text, &[("a", &per_step(across)), ("b", &per_step(along))]).completed();
        let points = &analysis.points;
        let steps = f64::from(STEPS);
        let strain = Sym3([steps * across, steps * along, steps * across, 0.0, 0.0, 0.0]);
        let tau = Hencky::new(1.0, 0.3).update(&strain, &[], &mut []).unwrap().tau;
        let volume_ratio = strain.trace().exp();
        let mut volume = 0.0;
        for p in 0..points.len() {
            assert!((points.converged.kirchhoff_stress[p] - tau).norm() < 1e-13, "{method} {p}");
            assert!(
                (points.converged.deformation_gradient[p].determinant() / volume_ratio - 1.0).abs() < 1e-13
            );
            let start = points.original_position[p];
            let exact = [start[0] * (steps * across).exp(), start[1] * (steps * along).exp()];
            let off = (0..2).map(|d| (points.converged.position[p][d] - exact[d]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-13, "{method} {p} {off:e}");
            volume += points.volume(p);
        }
        let area = std::f64::consts::PI * (2.0 * steps * across).exp();
        assert!((volume / (area * 1.5 * (steps * along).exp()) - 1.0).abs() < 1e-13, "{volume}");
        if method == "gimp" {
            // The domains tile the body, wherever they lie in the grid.
            let base = analysis.steps.last().unwrap().reactions[1][1];
            let expected = -tau.0[1] / volume_ratio * area;
            println!("force on the base {base}, expected {expected}");
            assert!((base / expected - 1.0).abs() < 1e-12, "{base} {expected}");
        }
    }
}
