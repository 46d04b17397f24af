//! Section 6.4: domain updates under homogeneous motions that prescribe all nodes.
#![allow(non_snake_case, reason = "F is the deformation gradient")]

use mpm::tensor::Mat3;

use crate::verification::analysis::{Analysis, run};

const UPDATES: [&str; 7] =
    ["none", "determinant", "diagonal", "stretch", "corners", "diagonal-corrected", "diagonal-incremental"];

/// Final lengths of the domain of the one point, whose domain starts as a unit square.
fn lengths(analysis: &Analysis) -> [f64; 2] {
    analysis.points.converged.half_lengths[0].map(|l| 2.0 * l)
}

fn deformed(update: &str, motion: &[(&str, &str)], F: &Mat3) -> [f64; 2] {
    let set: Vec<_> = [("update", update)].into_iter().chain(motion.iter().copied()).collect();
    let analysis = run("domains.yaml", &set).completed();
    let ours = analysis.points.converged.deformation_gradient[0];
    assert!((ours - F).norm() < 1e-12, "{motion:?}: {ours}");
    lengths(&analysis)
}

/// True if two pairs of lengths are equal up to round-off.
fn equal(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < 1e-12
}

/// Parameters of a motion, its deformation gradient, the correct lengths of a domain, and the updates that fail.
type Motion = (&'static [(&'static str, &'static str)], Mat3, [f64; 2], &'static [&'static str]);

/// Table 2 through a deck: the updates that give the domain its correct lengths, and the failures in the footnotes and
/// in Fig. 4.
#[test]
fn table_2() {
    let plane = |xx, xy, yx, yy| Mat3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 1.0);
    let (s, c) = 1.0f64.sin_cos();
    let motions: [Motion; 4] = [
        (&[("stretch_y", "0.6")], plane(1.0, 0.0, 0.0, 0.6), [1.0, 0.6], &["none", "determinant"]),
        (&[("stretch_x", "0.7"), ("stretch_y", "0.7")], plane(0.7, 0.0, 0.0, 0.7), [0.7, 0.7], &["none"]),
        (&[("shear", "1")], plane(1.0, 1.0, 0.0, 1.0), [1.0, 1.0], &["stretch"]),
        (&[("angle", "1")], plane(c, -s, s, c), [1.0, 1.0], &["diagonal"]),
    ];
    for (motion, F, expected, unsuitable) in motions {
        for update in UPDATES {
            let ours = deformed(update, motion, &F);
            assert_eq!(
                equal(ours, expected),
                !unsuitable.contains(&update),
                "{update}, {motion:?}: {ours:?}"
            );
            let failure = match (update, motion[0].0) {
                ("none", _) => [1.0, 1.0],                                   // a
                ("determinant", "stretch_y") => [0.6f64.sqrt(); 2],          // b
                ("stretch", "shear") => [2.0, 3.0].map(|k| k / 5f64.sqrt()), // c: U = √(Fᵀ F)
                ("diagonal", "angle") => [c, c],                             // d, Fig. 4 (a)
                _ => expected,
            };
            assert!(equal(ours, failure), "{update}, {motion:?}: {ours:?}, expected {failure:?}");
        }
    }
}

/// Fig. 5 (a): under (37), the lengths are the distances between mid-sides of the quadrilateral whose corners CPDI2
/// convects, scaled to the volume of the point.
#[test]
fn corners_give_lengths_by_their_mid_sides() {
    let motion = [("steps", "1"), ("angle", "0.6"), ("stretch_x", "1.25")];
    let set = |extra: (&'static str, &'static str)| -> Vec<_> { [extra].into_iter().chain(motion).collect() };
    let convected = run("domains.yaml", &set(("method", "cpdi2"))).completed();
    let corners = &convected.points.converged.corners;
    // Corner k lies at the high end of axis d if bit d of k is set.
    let middle = |a: usize, b: usize| [0, 1].map(|d| (corners[a][d] + corners[b][d]) / 2.0);
    let sides = [middle(0, 1), middle(2, 3), middle(0, 2), middle(1, 3)];
    let extent = [0, 1].map(|d| {
        let along = sides.iter().map(|m| m[d]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    });
    let factor = (1.25 / (extent[0] * extent[1])).sqrt();
    assert!(factor > 1.2, "the mid-sides alone lose volume: {factor}");
    let updated = lengths(&run("domains.yaml", &set(("update", "corners"))).completed());
    assert!(equal(updated, extent.map(|l| l * factor)), "{updated:?} {extent:?} {factor}");
}
