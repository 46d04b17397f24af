//! Solutions on one rank and on several.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use super::*;
use crate::linear::bodies::{Body, Rule, pieces, ragged2, ragged3, scattered, slabs, whole};
use crate::ranks::threads;

/// The results on one rank.
struct Found<const D: usize> {
    x: BTreeMap<u32, [f64; D]>,
    solved: Result<Solved, LinearError>,
    is_divided: bool,
    /// Number of values in the factors of the rank.
    numbers: usize,
    /// Peak memory of the factorisation of the rank, [byte].
    bytes: u64,
}

fn find<const D: usize>(body: &Body<D>, ranks: &Ranks, rank_of: impl Fn([u32; D]) -> usize) -> Found<D> {
    let part = body.part(ranks, rank_of);
    let mut divided = Divided::default().from(0.0);
    let mut x = vec![[0.0; D]; part.nodes.len()];
    let solved = part.solve(&mut divided, &mut x);
    let parts = divided.parts.as_ref();
    let numbers = parts.map_or(0, |parts| parts.own.factor_len() + parts.stages.factor_len());
    let bytes = parts.map_or(0, |parts| bytes(&parts.own, &parts.stages));
    Found {
        x: part.nodes.iter().copied().zip(x).collect(),
        solved,
        is_divided: parts.is_some(),
        numbers,
        bytes,
    }
}

fn solve<const D: usize>(body: &Body<D>, n: usize, rule: Rule<D>) -> Vec<Found<D>> {
    threads::run(n, |ranks| find(body, &ranks, |cell| rule(cell, body.cells, n)))
}

fn rules<const D: usize>() -> Vec<(usize, Rule<D>)> {
    let slabs = (2..=9).map(|n| (n, slabs as Rule<D>));
    slabs
        .chain([
            (2, pieces as Rule<D>),
            (3, pieces),
            (4, pieces),
            (7, pieces),
            (3, scattered),
            (5, scattered),
        ])
        .collect()
}

/// Checks that several ranks find the same solution as one rank.
fn check<const D: usize>(body: &Body<D>, factorisation: Factorisation, is_divided: bool) {
    let alone = find(body, &Ranks::default(), |_| 0);
    let expected = Solved { factorisation, iterations: 0 };
    assert_eq!(alone.solved, Ok(expected));
    let size = alone.x.values().flatten().fold(0.0f64, |size, x| size.max(x.abs()));
    for (n, rule) in rules() {
        let found = solve(body, n, rule);
        for found in &found {
            assert_eq!(found.solved, Ok(expected), "{n} ranks");
            assert_eq!(found.is_divided, is_divided, "{n} ranks");
        }
        let x = whole(found.iter().map(|found| &found.x));
        assert_eq!(x.len(), alone.x.len());
        let distance = x.iter().flat_map(|(node, x)| x.iter().zip(alone.x[node]));
        let distance = distance.fold(0.0f64, |most, (a, b)| most.max((a - b).abs() / size));
        assert!(distance <= 1e-11, "{n} ranks: {distance:e}");
    }
}

/// Some cells are missing, and none is nearly empty.
fn holes2(cell: [u32; 2]) -> Option<f64> {
    ragged2(cell).map(|_| 1.0)
}

fn holes3(cell: [u32; 3]) -> Option<f64> {
    ragged3(cell).map(|_| 1.0)
}

#[test]
fn ranks_find_what_one_finds() {
    let body = Body { fill: holes2, ..Body::bar([60, 25]) };
    check(&body, Factorisation::Cholesky, true);
    check(&Body { is_wide: true, ..body }, Factorisation::Cholesky, true);
    check(&Body { skew: 0.02, ..body }, Factorisation::Lu, true);
    let body = Body { fill: holes3, ..Body::bar([24, 7, 6]) };
    check(&body, Factorisation::Cholesky, true);
    check(&Body { is_wide: true, ..body }, Factorisation::Cholesky, true);
    check(&Body { skew: 0.005, ..body }, Factorisation::Lu, true);
}

#[test]
fn rank_0_factorises_what_has_no_factor_without_pivoting() {
    check(&Body { fill: holes2, shift: 0.01, ..Body::bar([60, 25]) }, Factorisation::Ldlt, false);
    check(&Body { fill: holes3, shift: 0.05, ..Body::bar([24, 7, 6]) }, Factorisation::Ldlt, false);
}

#[test]
fn negative_pivots_of_lu_are_found_on_all_ranks() {
    let body = Body { fill: holes2, shift: 0.01, skew: 0.001, ..Body::bar([60, 25]) };
    check(&body, Factorisation::LuIndefinite, true);
}

#[test]
fn a_singular_matrix_is_an_error_on_all_ranks() {
    let fill = |[x, y]: [u32; 2]| Some(if x > 55 && y > 20 { 0.0 } else { 1.0 });
    let body = Body { fill, ..Body::bar([60, 25]) };
    for n in 2..=4 {
        for found in solve(&body, n, slabs) {
            assert!(matches!(found.solved, Err(LinearError::Singular { .. })), "{:?}", found.solved);
        }
    }
}

#[test]
fn a_rank_without_nodes_takes_part() {
    let body = Body { fill: holes2, ..Body::bar([60, 25]) };
    let alone = find(&body, &Ranks::default(), |_| 0);
    for found in solve(&body, 5, |cell, cells, _| 2 * slabs(cell, cells, 2)) {
        assert!(found.is_divided);
        for (node, x) in found.x {
            assert!(
                x.iter().zip(alone.x[&node]).all(|(a, b)| (a - b).abs() < 1e-9),
                "{x:?} {:?}",
                alone.x[&node]
            );
        }
    }
}

/// An analysis is kept as long as the pattern changes on no rank, and each matrix yields the same result as with a new
/// backend, bit for bit.
#[test]
fn ranks_repeat_an_analysis_together() {
    let fill = |cell: [u32; 3]| holes3(cell).filter(|_| cell[0] < 22);
    for skew in [0.0, 0.005] {
        let body = Body { fill: holes3, skew, ..Body::bar([24, 7, 6]) };
        let bodies = [body, Body { shift: 1e-4, ..body }, Body { fill, ..body }, body];
        threads::run(3, |ranks| {
            let mut divided = Divided::default().from(0.0);
            for body in bodies {
                let part = body.part(&ranks, |cell| pieces(cell, body.cells, 3));
                let mut x = vec![[0.0; 3]; part.nodes.len()];
                part.solve(&mut divided, &mut x).unwrap();
                assert!(divided.parts.is_some());
                let anew = find(&body, &ranks, |cell| pieces(cell, body.cells, 3));
                assert!(
                    x.iter().zip(anew.x.values()).all(|(a, b)| a.map(f64::to_bits) == b.map(f64::to_bits))
                );
            }
        });
    }
}

#[test]
fn a_rank_keeps_its_share_of_the_factor() {
    let body = Body::bar([60, 6, 6]);
    let alone = solve(&body, 2, |_, _, _| 0);
    for n in [2, 4] {
        for found in solve(&body, n, slabs) {
            let share = found.numbers as f64 / alone[0].numbers as f64;
            assert!(share < 1.3 / n as f64, "{share}");
        }
    }
}

/// Working space, the matrices left for other ranks, and the fronts of shared unknowns are not needed at the same time.
#[test]
fn a_rank_takes_its_share_of_the_memory() {
    let body = Body::bar([16, 16, 16]);
    let alone = solve(&body, 2, |_, _, _| 0);
    for n in [2, 4] {
        for found in solve(&body, n, |[x, y, _], _, n| ((x / 8 * 2 + y / 8) as usize * n) / 4) {
            let share = found.bytes as f64 / alone[0].bytes as f64;
            assert!(share < 1.35 / n as f64, "{n} {share}");
        }
    }
}
