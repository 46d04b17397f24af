#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
use super::*;
use crate::grid::Axis;
use crate::region::{Ball, Brick, HollowBall, Motion, Polygon, Region};

const H: f64 = 0.25;

fn lattice(origin: f64) -> Lines<2> {
    Lines::new([Axis::even(origin, H, 32), Axis::even(origin, H, 32)])
}

fn outline(region: &Region<2>, origin: f64) -> Outline {
    let same = (1e-9 * H).max(16.0 * f64::EPSILON * origin);
    region.outline(None, &|_| 0.95 * H, same).unwrap()
}

fn turned(low: [f64; 2], high: [f64; 2], angle: f64) -> Region<2> {
    let brick: Region<2> = Brick::new(low, high).unwrap().into();
    brick.moved(&Motion::<2>::rotation(f64::to_radians(angle), low).unwrap())
}

/// Domains that fill an outline share each side with at most one other; the sides that they do not share form it.
fn check(region: &Region<2>, lines: &Lines<2>, origin: f64) -> Vec<FittedDomain> {
    let outline = outline(region, origin);
    let domains = fitted(&outline, lines).unwrap();
    let mut count: HashMap<[[u64; 2]; 2], usize> = HashMap::new();
    for domain in &domains {
        let n = domain.corners.len();
        for k in 0..n {
            let mut side = [domain.corners[k], domain.corners[(k + 1) % n]].map(|x| x.map(f64::to_bits));
            side.sort_unstable();
            *count.entry(side).or_default() += 1;
        }
    }
    assert!(count.values().all(|&count| count <= 2));
    let outer =
        count.iter().filter(|(_, count)| **count == 1).map(|(side, _)| side.map(|x| x.map(f64::from_bits)));
    let length = |[a, b]: [[f64; 2]; 2]| norm(&minus(&b, &a));
    let around: f64 = outline.sides().map(|(a, b)| length([a, b])).sum();
    assert!((outer.map(length).sum::<f64>() / around - 1.0).abs() < 1e-2);
    domains
}

#[test]
fn domains_fill_straight_sides_at_any_angle() {
    for origin in [0.0, 1e6] {
        for angle in [0.0, 10.0, 30.0, 45.0, 77.0] {
            let [low, high] = [[origin + 3.01, origin + 2.03], [origin + 5.0, origin + 3.5]];
            let domains = check(&turned(low, high, angle), &lattice(origin), origin);
            let sum: f64 = domains.iter().map(|domain| signed_area(&domain.corners)).sum();
            assert!((sum / (1.99 * 1.47) - 1.0).abs() < 1e-9);
            let least =
                domains.iter().map(|domain| signed_area(&domain.corners)).fold(f64::INFINITY, f64::min);
            assert!(least > 0.05 * H * H, "{angle}: {least}");
        }
    }
}

#[test]
fn circles_keep_their_area() {
    for radius in [0.05, 0.3, 1.0, 1.7] {
        let domains = check(&Ball::new([4.0; 2], radius).unwrap().into(), &lattice(0.0), 0.0);
        let sum: f64 = domains.iter().map(|domain| signed_area(&domain.corners)).sum();
        assert!((sum / (std::f64::consts::PI * radius * radius) - 1.0).abs() < 1e-9, "{radius}");
    }
    let ring = HollowBall::new([4.0; 2], 1.0, 2.0).unwrap().into();
    let sum: f64 = check(&ring, &lattice(0.0), 0.0).iter().map(|x| signed_area(&x.corners)).sum();
    assert!((sum / (3.0 * std::f64::consts::PI) - 1.0).abs() < 1e-9);
}

#[test]
fn thin_and_pointed_bodies_are_filled() {
    check(&turned([2.0, 2.0], [6.0, 2.01], 17.0), &lattice(0.0), 0.0);
    check(&Polygon::new(vec![[1.0, 1.0], [7.0, 1.0], [7.0, 1.4]]).unwrap().into(), &lattice(0.0), 0.0);
}

#[test]
fn regions_may_be_combined() {
    let disc = |x: f64| -> Region<2> { Ball::new([x, 4.0], 1.0).unwrap().into() };
    let boxed = |low: [f64; 2], high: [f64; 2]| -> Region<2> { Brick::new(low, high).unwrap().into() };
    let all = [
        Region::union(vec![disc(3.0), disc(4.5), turned([2.0, 2.0], [5.0, 3.5], 10.0)]).unwrap(),
        Region::difference(boxed([1.0, 1.0], [7.0, 4.0]), vec![disc(4.1)]),
        Region::intersection(vec![disc(4.0), boxed([4.0, 4.0], [8.0, 8.0])]).unwrap(),
    ];
    for region in all {
        let sum: f64 = check(&region, &lattice(0.0), 0.0).iter().map(|x| signed_area(&x.corners)).sum();
        let exact = region.volume(crate::region::Accuracy::default()).unwrap().value;
        assert!((sum / exact - 1.0).abs() < 2e-3, "{sum} {exact}");
    }
    // Parts that share a side have no side there.
    let two = Region::union(vec![boxed([1.0, 1.0], [3.0, 3.0]), boxed([3.0, 1.0], [5.0, 2.1])]).unwrap();
    assert_eq!(outline(&two, 0.0).loops.iter().map(Vec::len).collect::<Vec<_>>(), [6]);
}

#[test]
fn a_box_between_lines_needs_no_triangles() {
    let domains = check(&Brick::new([1.07, 1.11], [2.93, 2.2]).unwrap().into(), &lattice(0.0), 0.0);
    assert!(domains.iter().all(|domain| domain.corners.len() == 4));
    let on_lines = |low: [f64; 2], high: [f64; 2]| {
        is_on_lattice(&outline(&Brick::new(low, high).unwrap().into(), 0.0), &lattice(0.0))
    };
    assert!(on_lines([1.0, 1.25], [3.0, 2.0]) && !on_lines([1.0, 1.25], [3.0, 2.1]));
}
