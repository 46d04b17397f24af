//! A cone of clay under its own weight: the axisymmetric model compared with a quarter model in space.

use std::collections::BTreeMap;

use mpm::deck::build::build;
use mpm::points::Points;
use mpm::solver::{self, Silent};

use super::decks::{inputs_deck, run_of_inputs};
use crate::long::{first, is_long};

/// Size of the rings over which displacements are averaged, [m].
const RING: f64 = 0.5;

/// For each ring of the original body: mean radial and vertical displacement of its points, and their volume.
type Rings = BTreeMap<(i32, i32), ([f64; 2], f64)>;

fn rings(points: impl Iterator<Item = ([f64; 2], [f64; 2], f64)>) -> Rings {
    let mut rings = Rings::new();
    for (original, position, volume) in points {
        let ring = rings.entry(((original[0] / RING) as i32, (original[1] / RING) as i32)).or_default();
        for d in 0..2 {
            ring.0[d] += volume * (position[d] - original[d]);
        }
        ring.1 += volume;
    }
    rings.into_iter().map(|(ring, (sum, volume))| (ring, (sum.map(|u| u / volume), volume))).collect()
}

fn rings_of_revolution(points: &Points<2>) -> Rings {
    rings(
        (0..points.len())
            .map(|p| (points.original_position[p], points.converged.position[p], points.original_volume[p])),
    )
}

fn rings_of_quarter(points: &Points<3>) -> Rings {
    let meridian = |[x, y, z]: [f64; 3]| [x.hypot(y), z];
    rings((0..points.len()).map(|p| {
        let (original, position) = (points.original_position[p], points.converged.position[p]);
        (meridian(original), meridian(position), points.original_volume[p])
    }))
}

/// Difference between the two bodies, [m]: root mean square over all rings, and over the outermost rings (the profile).
fn distances(a: &Rings, b: &Rings) -> [f64; 2] {
    let (mut sum, mut volume) = (0.0, 0.0);
    let mut outermost: BTreeMap<i32, (i32, f64)> = BTreeMap::new();
    for (&(radial, level), &(u, ring)) in a {
        let Some(&(v, _)) = b.get(&(radial, level)) else { continue };
        let square = (u[0] - v[0]).powi(2) + (u[1] - v[1]).powi(2);
        sum += square * ring;
        volume += ring;
        outermost.insert(level, (radial, square)); // in ascending order of the radius
    }
    let profile: f64 = outermost.values().map(|(_, square)| square).sum::<f64>() / outermost.len() as f64;
    [(sum / volume).sqrt(), profile.sqrt()]
}

/// The top settles by 0.27 m; the profiles of the two models converge to each other under refinement.
#[test]
fn a_quarter_in_space_is_the_body_of_revolution() {
    let distances_with = |&h: &&str| {
        let (model, mut points) = build::<2>(&inputs_deck("cone/revolved.yaml", &[("h", h)])).unwrap();
        solver::run(&model, &mut points, &mut Silent).unwrap();
        distances(
            &rings_of_revolution(&points),
            &rings_of_quarter(&run_of_inputs("cone/solid.yaml", &[("h", h)])),
        )
    };
    let found: Vec<[f64; 2]> = first(2, &["0.5", "0.25", "0.125"]).iter().map(distances_with).collect();
    println!("cone, distance over the body and of the profiles (m): {found:.5?}");
    assert!(found.windows(2).all(|pair| pair[1][0] < pair[0][0] && pair[1][1] < pair[0][1]));
    assert!(!is_long() || found[2][0] < 1e-3 && found[2][1] < 1e-3);
}
