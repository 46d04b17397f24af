#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
use std::collections::HashMap;
use std::f64::consts::PI;

use super::*;
use crate::basis::domain_volume;
use crate::grid::Axis;
use crate::region::vector::{along, dot, norm};
use crate::region::{Accuracy, Ball, Brick, Frustum, Motion, Polygon, Prism, Surface, area_vector};
use crate::surface::sides_of_domain;

const H: f64 = 0.25;

fn lattice() -> Lines<3> {
    Lines::new(std::array::from_fn(|_| Axis::even(0.0, H, 16)))
}

fn turned(low: [f64; 3], high: [f64; 3], axis: [f64; 3], angle: f64) -> Region<3> {
    let brick: Region<3> = Brick::new(low, high).unwrap().into();
    brick.moved(&Motion::<3>::rotation(axis, f64::to_radians(angle), [2.0; 3]).unwrap())
}

/// What domains enclose: their volume, the area of the sides that they do not share, and the volume inside these.
struct Enclosed {
    volume: f64,
    area: f64,
    inside: f64,
    least: f64,
}

/// The domains of a region: each shares a side with at most one other, and the sides that none shares are closed.
fn check(region: &Region<3>) -> Enclosed {
    let domains = fitted_in_space(region, &lattice()).unwrap().domains;
    let mut sides: HashMap<Vec<[u64; 3]>, Vec<Vec<[f64; 3]>>> = HashMap::new();
    let (mut volume, mut least) = (0.0, f64::INFINITY);
    for domain in &domains {
        let own = domain_volume(&domain.corners);
        (volume, least) = (volume + own, least.min(own));
        for side in sides_of_domain::<3>(domain.corners.len()) {
            let corners: Vec<[f64; 3]> = side.corners().iter().map(|&k| domain.corners[k]).collect();
            let mut key: Vec<[u64; 3]> = corners.iter().map(|x| x.map(f64::to_bits)).collect();
            key.sort_unstable();
            sides.entry(key).or_default().push(corners);
        }
    }
    assert!(sides.values().all(|found| found.len() <= 2));
    let (mut sum, mut area, mut inside) = ([0.0; 3], 0.0, 0.0);
    for found in sides.values().filter(|found| found.len() == 1) {
        let corners = &found[0];
        let n = corners.len();
        let mut own = area_vector(&[corners[0], corners[1], corners[2]]);
        if n == 4 {
            own = along(&own, 1.0, &area_vector(&[corners[0], corners[2], corners[3]]));
        }
        sum = along(&sum, 1.0, &own);
        area += norm(&own);
        inside += corners.iter().map(|x| dot(x, &own)).sum::<f64>() / (3 * n) as f64;
    }
    assert!(norm(&sum) < 1e-12 * area, "{sum:?}");
    assert!((inside / volume - 1.0).abs() < 1e-3, "{inside} {volume}");
    Enclosed { volume, area, inside, least }
}

#[test]
fn boxes_at_any_angle_are_filled_exactly() {
    for (axis, angle) in [
        ([0.0, 0.0, 1.0], 30.0),
        ([0.0, 0.0, 1.0], 45.0),
        ([1.0, 2.0, 3.0], 30.0),
        ([1.0, 1.0, 1.0], 45.0),
        ([3.0, -1.0, 1.0], 77.0),
        ([0.0, 0.0, 1.0], 0.0),
    ] {
        let region = turned([1.43, 1.02, 1.21], [2.46, 2.15, 2.4], axis, angle);
        let found = check(&region);
        let sides = [1.03, 1.13, 1.19];
        let volume: f64 = sides.iter().product();
        let area = 2.0 * (0..3).map(|d| sides[d] * sides[(d + 1) % 3]).sum::<f64>();
        assert!((found.volume / volume - 1.0).abs() < 1e-12, "{axis:?} {angle}: {}", found.volume / volume);
        assert!((found.area / area - 1.0).abs() < 1e-9, "{axis:?} {angle}");
        assert!((found.inside / volume - 1.0).abs() < 1e-9 && found.least > 0.0);
    }
}

#[test]
fn spheres_and_cones_are_nearly_filled() {
    let round = |region: Region<3>, volume: f64, area: f64| {
        let found = check(&region);
        assert!((found.volume / volume - 1.0).abs() < 0.02, "{}", found.volume / volume);
        // The smallest sphere has five domains over its diameter.
        assert!((found.area / area - 1.0).abs() < 0.03, "{}", found.area / area);
    };
    for radius in [0.6_f64, 1.0, 1.5] {
        let center = [2.03, 1.98, 2.0];
        let (volume, area) = (4.0 / 3.0 * PI * radius.powi(3), 4.0 * PI * radius * radius);
        round(Ball::new(center, radius).unwrap().into(), volume, area);
    }
    let cylinder = Frustum::cylinder([1.0, 1.2, 1.1], [2.5, 2.4, 3.0], 0.8).unwrap();
    let height = cylinder.height();
    round(cylinder.into(), PI * 0.64 * height, 2.0 * PI * 0.8 * (0.8 + height));
}

#[test]
fn solids_may_be_combined_and_given_by_facets() {
    let brick = |low: [f64; 3], high: [f64; 3]| -> Region<3> { Brick::new(low, high).unwrap().into() };
    let ball = |x: f64| -> Region<3> { Ball::new([x, 2.0, 2.0], 0.9).unwrap().into() };
    let corners = vec![[0.6, 0.6], [3.1, 0.7], [3.3, 1.6], [1.7, 1.5], [1.4, 3.1], [0.5, 2.9]];
    let prism = Prism::new(Polygon::new(corners).unwrap(), 2, [0.9, 2.3]).unwrap();
    let facets: Vec<_> = prism_facets(&prism);
    let plane: [Region<3>; 3] = [
        Region::difference(
            brick([0.6; 3], [3.1, 2.9, 3.2]),
            vec![turned([1.5, 1.4, 0.0], [2.6, 2.3, 4.0], [0.0, 0.0, 1.0], 20.0)],
        ),
        prism.into(),
        Surface::new(&facets).unwrap().into(),
    ];
    for region in plane {
        let exact = region.volume(Accuracy::default()).unwrap().value;
        let found = check(&region);
        assert!((found.volume / exact - 1.0).abs() < 1e-9, "{} {exact}", found.volume);
    }
    let round: [Region<3>; 3] = [
        Region::union(vec![ball(1.5), ball(2.6)]).unwrap(),
        Region::difference(brick([0.6; 3], [3.1, 2.9, 3.2]), vec![ball(2.1)]),
        Region::intersection(vec![ball(2.0), turned([1.2; 3], [2.9; 3], [1.0, 1.0, 0.0], 20.0)]).unwrap(),
    ];
    for region in round {
        let exact = region.volume(Accuracy::default()).unwrap().value;
        let found = check(&region);
        assert!((found.volume / exact - 1.0).abs() < 0.03, "{} {exact}", found.volume);
    }
}

fn prism_facets(prism: &Prism) -> Vec<[[f64; 3]; 3]> {
    use crate::region::Primitive;
    let facets = prism.facets(f64::INFINITY).into_iter().map(|facet| facet.corners);
    let region: Region<3> = prism.clone().into();
    let outward = |corners: [[f64; 3]; 3]| {
        let area = area_vector(&corners);
        let centre: [f64; 3] = std::array::from_fn(|d| corners.iter().map(|x| x[d]).sum::<f64>() / 3.0);
        let is_out = !region.contains(&along(&centre, 1e-6 / norm(&area), &area));
        if is_out { corners } else { [corners[1], corners[0], corners[2]] }
    };
    facets.map(outward).collect()
}

#[test]
fn a_box_on_lattice_lines_keeps_its_cells() {
    let region: Region<3> = Brick::new([1.0, 1.25, 1.5], [2.0, 2.0, 3.0]).unwrap().into();
    assert_eq!(fitted_in_space(&region, &lattice()), Err(NotFitted::OnLattice));
}
