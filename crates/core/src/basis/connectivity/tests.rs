use super::*;
use crate::grid::{Axis, Structured};
use crate::points::Seed;

/// Checks many points of two methods. Some domains end at cell boundaries, so that their nodes are a subset of the
/// nodes of neighbouring points.
fn check<const D: usize>(grid: &Structured<D>, n: usize) {
    let methods = [Method::Mpm, Method::Gimp];
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let seeds: Vec<Seed<D>> = (0..n)
        .map(|k| Seed {
            body: (k % 2) as u16,
            position: std::array::from_fn(|_| 0.5 + 2.0 * (8.0 * next()).floor() / 8.0 + 0.125),
            half_lengths: if k % 2 == 0 { [0.0; D] } else { [0.125; D] },
            corners: Vec::new(),
            volume: 1.0,
            mass: 1.0,
            outer_layer: false,
            history: Vec::new(),
        })
        .collect();
    let mut points = Points::new(&seeds);
    let links = Connectivity::new(grid, &mut points, &methods).unwrap();
    let mut support = Support::default();
    let mut total = 0;
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        let (mut value, mut gradient) = (vec![0.0; nodes.len()], vec![[0.0; D]; nodes.len()]);
        let mut buffer = LinkBuffer { value: &mut value, gradient: &mut gradient };
        let mut whole = true;
        for p in links.points_of(group) {
            let point = PointGeometry {
                cell: points.cell[p],
                position: &points.converged.position[p],
                half_lengths: &points.half_lengths(p),
                corners: &[],
            };
            methods[points.body[p] as usize].basis().support(grid, &point, &mut support).unwrap();
            let found = links.links(p, &mut buffer);
            let touched: Vec<u32> =
                found.local.iter().map(|l| links.active_nodes()[nodes[*l as usize] as usize]).collect();
            assert_eq!(touched, support.nodes, "point {p}");
            assert_eq!((found.value, found.gradient), (&support.value[..], &support.gradient[..]));
            whole &= touched.len() == nodes.len();
            total += touched.len();
        }
        assert_eq!(links.is_whole(group), whole);
    }
    assert_eq!(links.n_links(), total);
}

/// The links of one point whose domain covers a cell and reaches into the cells above and to the right by the fraction
/// `reach` of their size.
fn with_sliver(reach: f64) -> Connectivity<2> {
    let grid = Structured::<2>::new([0.0; 2], [1.0; 2], [4, 4]);
    let seed = Seed {
        body: 0,
        position: [1.5 + 0.5 * reach; 2],
        half_lengths: [0.5 + 0.5 * reach; 2],
        corners: Vec::new(),
        volume: 1.0,
        mass: 1.0,
        outer_layer: false,
        history: Vec::new(),
    };
    Connectivity::new(&grid, &mut Points::new(&[seed]), &[Method::Gimp]).unwrap()
}

#[test]
fn nodes_that_only_slivers_touch_are_not_active() {
    // The domain touches the nodes above and to the right with a whole side, and the node between them, at the upper
    // right, with its corner only. If it hardly reaches beyond the cell, all five nodes are inactive.
    for (reach, active) in [(1e-9, 4), (1e-4, 4), (0.1, 9)] {
        let links = with_sliver(reach);
        assert_eq!(links.n_active(), active, "{reach}");
        let corner = 3 + 3 * 5;
        assert_eq!(links.is_active(corner), reach > 0.01);
        assert_eq!(links.moves_with(0, corner).is_some(), reach > 1e-8);
        let (mut value, mut gradient) = ([0.0; 9], [[0.0; 2]; 9]);
        let mut buffer = LinkBuffer { value: &mut value, gradient: &mut gradient };
        let found = links.links(0, &mut buffer);
        assert!((found.value.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert!((0..2).all(|d| found.gradient.iter().map(|g| g[d]).sum::<f64>().abs() < 1e-15));
    }
}

#[test]
fn links_are_those_of_the_basis() {
    check(&Structured::<2>::new([0.0; 2], [0.5; 2], [6, 6]), 20_000);
    check(&Structured::<3>::new([0.0; 3], [0.5; 3], [6, 6, 6]), 20_000);
    let graded = Axis::graded(vec![0.0, 0.25, 0.5, 1.0, 1.75, 3.0]).unwrap();
    check(&Structured::with_axes([graded.clone(), Axis::even(0.0, 0.5, 6)]), 20_000);
    check(&Structured::with_axes([graded.clone(), Axis::even(0.0, 0.5, 6), graded]), 20_000);
}

/// A bar of four domains in CPDI2 whose upper side lies above a grid line by `above` on the right: the nodes above are
/// touched firmly there and by slivers on the left. The basis at the corners of the side and the forces of a uniform
/// stress in the domains agree at all nodes.
#[test]
fn sliver_nodes_move_with_carriers_that_do_not_depend_on_the_point() {
    let grid = Structured::<2>::new([0.0; 2], [1.0; 2], [6, 4]);
    for above in [1e-9, 1e-7, 1e-5, 1e-3] {
        let top = |k: usize| 2.0 + above * [0.0, 1e-3, 1e-2, 0.1, 1.0][k];
        let seeds: Vec<Seed<2>> = (0..4)
            .map(|k| {
                let (left, right) = (1.0 + 0.75 * k as f64, 1.75 + 0.75 * k as f64);
                let corners = vec![[left, 1.0], [right, 1.0], [left, top(k)], [right, top(k + 1)]];
                Seed {
                    body: 0,
                    position: [0.5 * (left + right), 1.5],
                    half_lengths: [0.375, 0.5],
                    corners,
                    volume: 0.75,
                    mass: 1.0,
                    outer_layer: false,
                    history: Vec::new(),
                }
            })
            .collect();
        let points = &mut Points::new(&seeds);
        let links = Connectivity::new(&grid, points, &[Method::Cpdi2]).unwrap();
        let mut inner = vec![[0.0; 2]; links.n_active()];
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            for p in links.points_of(group) {
                let corners = points.corners(p);
                let around = [0, 1, 3, 2, 0].map(|k| corners[k]);
                let area: f64 =
                    around.windows(2).map(|x| 0.5 * (x[0][0] * x[1][1] - x[1][0] * x[0][1])).sum();
                links.for_each_link(p, |local, _, slope| {
                    (0..2).for_each(|d| inner[nodes[local] as usize][d] += area * slope[d]);
                });
            }
        }
        // The outer sides of the bar, from each corner to the next around it.
        let outline: Vec<[f64; 2]> = (0..5)
            .map(|k| [1.0 + 0.75 * k as f64, 1.0])
            .chain((0..5).rev().map(|k| [1.0 + 0.75 * k as f64, top(k)]))
            .collect();
        for (k, a) in outline.iter().enumerate() {
            let b = &outline[(k + 1) % outline.len()];
            let area = [b[1] - a[1], a[0] - b[0]];
            for x in [a, b] {
                let cell = grid.basis_near(x, None).0;
                let support = crate::surface::active(grid.basis_at(cell, x), &links, 0).unwrap();
                for (node, value) in support.nodes().iter().zip(support.value()) {
                    (0..2).for_each(|d| inner[*node as usize][d] -= 0.5 * value * area[d]);
                }
            }
        }
        let largest = inner.iter().flatten().fold(0.0, |most: f64, f| most.max(f.abs()));
        assert!(largest < 1e-14, "{above}: {largest:e}");
    }
}
