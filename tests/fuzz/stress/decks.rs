//! Random decks: geometry, grid, method, domain update, material, loads and conditions, in few large steps.

use crate::random::Random;

/// The deck with this number.
pub fn deck(seed: u64, stabilised: bool, cut: bool) -> String {
    let mut random = Random::new(seed);
    let kind = *random.pick(&["plane", "plane", "plane", "axisymmetric", "solid"]);
    let solid = kind == "solid";
    let h = if solid { *random.pick(&[1.0, 0.75]) } else { *random.pick(&[0.5, 0.35, 0.25]) };
    let idealisation = match kind {
        "plane" => "plane-strain",
        other => other,
    };
    let mode = match (stabilised, random.chance(0.3)) {
        (false, _) => "off",
        (true, true) => "on",
        (true, false) => "auto",
    };
    let method = *random.pick(&["gimp", "gimp", "cpdi2", "cpdi1", "mpm"]);
    let update = if method == "gimp" {
        format!(
            ", domain_update: {}",
            random.pick(&["corners", "stretch", "determinant", "diagonal-corrected"])
        )
    } else {
        String::new()
    };
    let points = *random.pick(if solid { &[2, 3][..] } else { &[1, 2, 3, 4][..] });
    let stiff = random.chance(0.5);
    let material = match random.below(4) {
        0 => "model: hencky, young: 1e6, poisson: 0.3".to_owned(),
        1 => format!("model: neo-hookean, young: 1e6, poisson: {}", random.pick(&[0.0, 0.3, 0.45])),
        _ => format!(
            "model: von-mises, young: 1e6, poisson: {}, deviatoric_yield_stress: {}, hardening_modulus: {}",
            random.pick(&[0.2, 0.3, 0.45]),
            random.pick(&["10e3", "20e3", "50e3"]),
            random.pick(&["0", "0", "50e3"])
        ),
    };
    // The weight of a block of height 4 is up to 320 kPa: well beyond the capacity of the softest material.
    let weight = *random.pick(&[-10.0, -20.0, -40.0, -80.0]) * if stiff { 0.5 } else { 1.0 };
    let z = |text: &str| if solid { format!(", {text}") } else { String::new() };
    let cells = |extent: f64| (extent / h).ceil() * h;
    let size = format!("[{}, {}{}]", cells(14.0), cells(7.0), z(&cells(6.0).to_string()));
    let shape = shape(&mut random, solid);
    let sideways = if random.chance(0.4) { *random.pick(&[3.0, -3.0, 10.0]) } else { 0.0 };
    let sideways = if kind == "axisymmetric" { 0.0 } else { sideways };
    let rough = random.chance(0.5) || sideways != 0.0;
    let base = if rough { format!("[x, y{}]", z("z")) } else { "[y]".to_owned() };
    let mut conditions = vec![
        format!("  - {{name: base, nodes: {{y: 0}}, fix: {base}}}"),
        "  - {name: axis, nodes: {x: 0}, fix: [x]}".to_owned(),
    ];
    if solid {
        conditions.push("  - {name: front, nodes: {z: 0}, fix: [z]}".to_owned());
    }
    let steps = *random.pick(&[1, 2, 3, 5]);
    let smallest = if cut { 0.004 } else { 1.0 };
    let formulation = *random.pick(&["previously-converged", "previously-converged", "updated-lagrangian"]);
    format!(
        "version: 1
title: Random analysis {seed}
analysis: {{idealisation: {idealisation}, formulation: {formulation}, stabilisation: {{mode: {mode}}}}}
grid: {{type: structured, origin: [0, 0{}], size: {size}, spacing: {h}}}
materials: {{m: {{{material}, density: 1000}}}}
bodies:
  - {{name: body, material: m, method: {method}{update}, points_per_cell: {points},
     shape: {shape}}}
boundary_conditions:
{}
loads:
  - {{name: weight, type: gravity, acceleration: [{sideways}, {weight}{}]}}
steps: {{count: {steps}, smallest: {smallest}}}
solver: {{tolerance: 1e-8, max_iterations: 20}}
output: {{every: 0}}
",
        z("0"),
        conditions.join("\n"),
        z("0"),
    )
}

/// A region at the origin that stands on y = 0 and touches x = 0.
fn shape(random: &mut Random, solid: bool) -> String {
    let side = |random: &mut Random| *random.pick(&[1.5, 2.0, 2.3, 3.1, 4.0]);
    let (a, b, c) = (side(random), side(random), 1.0 + 0.5 * random.below(3) as f64);
    if solid {
        return match random.below(3) {
            0 => format!("{{type: box, min: [0, 0, 0], max: [{a}, {b}, {c}]}}"),
            1 => format!(
                "{{type: intersection, of: [{{type: cylinder, start: [0, 0, 0], end: [0, {b}, 0], radius: {a}}}, \
                 {{type: box, min: [0, 0, 0], max: [5, 5, 4]}}]}}"
            ),
            _ => format!(
                "{{type: intersection, of: [{{type: sphere, center: [0, 0, 0], radius: {a}}}, \
                 {{type: box, min: [0, 0, 0], max: [5, 5, 4]}}]}}"
            ),
        };
    }
    match random.below(6) {
        0 | 1 => format!("{{type: box, min: [0, 0], max: [{a}, {b}]}}"),
        2 => format!("{{type: polygon, vertices: [[0, 0], [{}, 0], [{a}, {b}], [0, {b}]]}}", a + 0.7),
        3 => format!("{{type: polygon, vertices: [[0, 0], [{a}, 0], [{}, {b}], [0, {}]]}}", a + 0.4, b + 0.3),
        4 => format!(
            "{{type: difference, from: {{type: box, min: [0, 0], max: [{a}, {b}]}}, \
             minus: [{{type: circle, center: [{}, {}], radius: 0.45}}]}}",
            0.5 * a,
            0.6 * b
        ),
        _ => format!(
            "{{type: intersection, of: [{{type: circle, center: [0, 0], radius: {b}}}, \
             {{type: box, min: [0, 0], max: [5, 5]}}]}}"
        ),
    }
}
