//! A bar twisted by a manufactured body force.

use mpm::points::Points;

use super::decks::run_of_inputs;
use crate::long::{first, is_long};

/// Mean distance (weighted with the original volume) and largest distance of the points from the exact positions, [m].
fn errors(points: &Points<3>) -> [f64; 2] {
    let (mut sum, mut volume, mut largest) = (0.0, 0.0, 0.0f64);
    for p in 0..points.len() {
        let [x, y, z] = points.original_position[p];
        let (s, t) = ((x * x + y * y).min(1.0), z / 2.0);
        let (sin, cos) = ((1.0 - s).powi(3) * 16.0 * t * t * (1.0 - t) * (1.0 - t)).sin_cos();
        let there = [x * cos - y * sin, x * sin + y * cos, z];
        let apart = (0..3).map(|d| (points.converged.position[p][d] - there[d]).powi(2)).sum::<f64>().sqrt();
        sum += apart * points.original_volume[p];
        volume += points.original_volume[p];
        largest = largest.max(apart);
    }
    [sum / volume, largest]
}

/// The displacement converges with second order at a twist of one radian; the largest displacement is 0.24 m.
#[test]
fn a_twisted_bar_converges_with_order_two() {
    let errors_with = |&h: &&str| errors(&run_of_inputs("twist.yaml", &[("h", h)]));
    let all: Vec<[f64; 2]> = first(2, &["0.5", "0.25", "0.125"]).iter().map(errors_with).collect();
    let orders: Vec<[f64; 2]> =
        all.windows(2).map(|pair| [0, 1].map(|k| (pair[0][k] / pair[1][k]).log2())).collect();
    println!("twisted bar, mean and largest error (m): {all:.5?}, orders {orders:.2?}");
    assert!(orders.iter().all(|[mean, largest]| *mean > 1.85 && *largest > 1.85));
    assert!(!is_long() || all[2][0] < 1e-3 && all[2][1] < 5e-3);
}
