//! Solutions on one rank and on several.

use crate::linear::bodies::{Body, Found, Rule, pieces, ragged2, ragged3, scattered, slabs, whole};
use crate::linear::multigrid::Multigrid;
use crate::linear::preconditioner::held_by;
use crate::linear::{Factorisation, LinearError};
use crate::ranks::{Ranks, threads};

fn solve<const D: usize>(body: &Body<D>, n: usize, rule: Rule<D>) -> Vec<Found<D>> {
    threads::run(n, |ranks| body.solve(&ranks, |cell| rule(cell, body.cells, n)))
}

/// Checks that several ranks find the same solution as one rank.
fn check<const D: usize>(body: &Body<D>, factorisation: Factorisation) {
    let alone = body.solve(&Ranks::default(), |_| 0);
    let expected = alone.solved.unwrap();
    assert_eq!(expected.factorisation, factorisation);
    // Nodes of nearly empty cells move much farther than other nodes.
    let mut sizes: Vec<f64> = alone.x.values().flatten().map(|x| x.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let size = sizes[sizes.len() / 2];
    let rules: [(usize, Rule<D>); 8] = [
        (1, slabs),
        (2, slabs),
        (3, slabs),
        (4, slabs),
        (2, pieces),
        (3, pieces),
        (4, pieces),
        (3, scattered),
    ];
    for (n, rule) in rules {
        let found = solve(body, n, rule);
        for found in &found {
            assert_eq!(found.levels, alone.levels);
            let solved = found.solved.as_ref().unwrap();
            assert_eq!(solved.factorisation, factorisation);
            assert!(solved.iterations.abs_diff(expected.iterations) <= 1, "{solved:?} {expected:?}");
        }
        let x = whole(found.iter().map(|found| &found.x));
        assert_eq!(x.len(), alone.x.len());
        let distance = x.iter().flat_map(|(node, x)| x.iter().zip(alone.x[node]));
        let distance = distance.fold(0.0f64, |most, (a, b)| most.max((a - b).abs() / size.max(b.abs())));
        assert!(distance <= 1e-9, "{n} ranks: {distance:e}");
    }
}

#[test]
fn ranks_find_what_one_finds_in_the_plane() {
    let body = Body { fill: ragged2, ..Body::bar([60, 25]) };
    check(&body, Factorisation::Multigrid);
    check(&Body { ratio: 1.03, ..body }, Factorisation::Multigrid);
    check(&Body { is_wide: true, ..body }, Factorisation::Multigrid);
    check(&Body { skew: 0.02, ..body }, Factorisation::MultigridUnsymmetric);
    // The preconditioner has only one level.
    check(&Body { fill: ragged2, ..Body::bar([20, 10]) }, Factorisation::Multigrid);
}

#[test]
fn ranks_find_what_one_finds_in_space() {
    let body = Body { fill: ragged3, ..Body::bar([40, 9, 8]) };
    check(&body, Factorisation::Multigrid);
    check(&Body { ratio: 1.03, ..body }, Factorisation::Multigrid);
    check(&Body { is_wide: true, ..body }, Factorisation::Multigrid);
    check(&Body { skew: 0.005, ..body }, Factorisation::MultigridUnsymmetric);
}

#[test]
fn all_ranks_notice_that_a_matrix_is_indefinite() {
    check(&Body { fill: ragged2, shift: 0.01, ..Body::bar([60, 25]) }, Factorisation::MultigridIndefinite);
    check(&Body { fill: ragged3, shift: 0.02, ..Body::bar([40, 9, 8]) }, Factorisation::MultigridIndefinite);
}

#[test]
fn all_ranks_notice_that_a_matrix_is_singular() {
    let fill = |[x, y]: [u32; 2]| Some(if x > 55 && y > 20 { 0.0 } else { 1.0 });
    let body = Body { fill, ..Body::bar([60, 25]) };
    for n in 1..=4 {
        for found in solve(&body, n, slabs) {
            assert_eq!(found.solved, Err(LinearError::Singular { unknown: None }));
        }
    }
}

#[test]
fn a_rank_without_nodes_takes_part() {
    let body = Body { fill: ragged2, ..Body::bar([60, 25]) };
    let alone = body.solve(&Ranks::default(), |_| 0).solved.unwrap();
    for found in solve(&body, 3, |cell, cells, _| 2 * slabs(cell, cells, 2)) {
        assert!(found.solved.unwrap().iterations.abs_diff(alone.iterations) <= 1);
    }
}

#[test]
fn the_same_ranks_find_the_same_bits() {
    for skew in [0.0, 0.005] {
        let body = Body { fill: ragged3, skew, ..Body::bar([40, 9, 8]) };
        let bits = || {
            whole(solve(&body, 3, pieces).iter().map(|found| &found.x))
                .into_values()
                .map(|x| x.map(f64::to_bits))
        };
        assert!(bits().eq(bits()));
    }
}

#[test]
fn a_cycle_is_that_of_one_rank() {
    let body = Body { fill: ragged3, is_wide: true, ..Body::bar([20, 9, 8]) };
    let alone = body.part(&Ranks::default(), |_| 0).precondition();
    let shared =
        threads::run(3, |ranks| body.part(&ranks, |cell| pieces(cell, body.cells, 3)).precondition());
    for (node, z) in shared.iter().flatten() {
        let size = alone[node].iter().fold(0.0f64, |size, z| size.max(z.abs()));
        for (a, b) in z.iter().zip(alone[node]) {
            assert!((a - b).abs() <= 1e-6 * size, "{a:e} {b:e}");
        }
    }
}

/// An analysis is kept as long as no rank has a different pattern.
#[test]
fn ranks_repeat_an_analysis_together() {
    let body = Body { fill: ragged2, ..Body::bar([60, 25]) };
    let fill = |cell: [u32; 2]| ragged2(cell).filter(|_| cell[0] < 55);
    let shorter = Body { fill, ..body };
    let outcomes = threads::run(2, |ranks| {
        let mut multigrid = Multigrid::<2, 2>::default();
        [body, body, shorter, shorter, body].map(|body| {
            let part = body.part(&ranks, |cell| slabs(cell, body.cells, 2));
            let (places, lines) = (part.places.clone(), part.lines.clone());
            multigrid.analyse(&part.matrix(), places, lines, held_by(&part.numbering), &part.halo)
        })
    });
    assert!(outcomes.iter().all(|outcome| *outcome == [true, false, true, false, true].map(Ok)));
}

#[test]
fn a_rank_keeps_its_share_of_each_level() {
    let body = Body::bar([200, 4, 4]);
    for n in [2, 4] {
        for found in solve(&body, n, slabs) {
            for ([own, ghosts], all) in found.here.iter().zip(&found.levels) {
                let share = (own + ghosts) as f64 / *all as f64;
                assert!(share < 1.5 / n as f64, "{own} + {ghosts} of {all}");
            }
        }
    }
}
