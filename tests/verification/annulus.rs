//! Section 7.4: annulus under torsion on grids of triangles, a manufactured solution.

use crate::analysis::{Analysis, run};

/// Displacement of a point of the original position X at the end.
fn exact(place: [f64; 2]) -> [f64; 2] {
    let (inner, outer, alpha) = (0.75, 1.25, 0.1);
    let r: f64 = place[0].hypot(place[1]);
    let theta = alpha * 16.0 * ((r - inner) * (r - outer)).powi(2) / (inner - outer as f64).powi(4);
    let (s, c) = theta.sin_cos();
    [c * place[0] - s * place[1] - place[0], s * place[0] + c * place[1] - place[1]]
}

/// Mean distance of the points from where they should be, weighted with their volume, m.
fn error(analysis: &Analysis) -> f64 {
    let points = &analysis.points;
    let mut sum = 0.0;
    let mut volume = 0.0;
    for p in 0..points.len() {
        let u = exact(points.original_position[p]);
        let x = points.converged.position[p];
        let d: [f64; 2] = std::array::from_fn(|d| x[d] - points.original_position[p][d] - u[d]);
        sum += d[0].hypot(d[1]) * points.original_volume[p];
        volume += points.original_volume[p];
    }
    sum / volume
}

#[test]
fn order() {
    for n in ["36", "144", "400"] {
        let mut last = None;
        for (segments, h) in [("18", 0.4363f64), ("36", 0.2182), ("72", 0.1091), ("144", 0.0545), ("288", 0.0273)] {
            let analysis = run("annulus.yaml", &[("segments", segments), ("n", n)]);
            if let Err(e) = &analysis.summary { println!("{n} {segments}: {e}"); continue; }
            let e = error(&analysis);
            println!("{n} {segments}: {e:.4e} slope {:?}", last.map(|(h0, e0): (f64, f64)| (e0 / e).ln() / (h0 / h).ln()));
            last = Some((h, e));
        }
    }
}
