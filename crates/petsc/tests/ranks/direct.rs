//! The direct backend.

use mpm_core::linear::{Factorisation, LinearError};
use mpm_core::ranks::Ranks;
use mpm_petsc::Direct;

use crate::body::{Kind, Part, deviation, expected};
use crate::print;

pub fn check(ranks: &Ranks) {
    for kind in [Kind::Definite, Kind::Shifted(1.0), Kind::Unsymmetric] {
        agrees(ranks, [7, 4], kind);
        // On four ranks, one rank has no elements.
        agrees(ranks, [3, 1], kind);
        agrees(ranks, [5, 3, 3], kind);
    }
    fails(ranks, [6, 3]);
    fails(ranks, [3, 2, 2]);
    a_weak_mechanism_without_load_is_no_obstacle(ranks);
}

fn agrees<const D: usize>(ranks: &Ranks, elements: [u32; D], kind: Kind) {
    let (factorisation, solution) = expected(elements, kind);
    let mut part = Part::new(ranks, elements, kind);
    let mut backend = Direct::new().expect("MUMPS");
    let (solved, x) = part.solve(&mut backend, 0.0).expect("a regular matrix");
    let error = ranks.largest(deviation(&part, &x, &solution));
    assert!(error < 1e-10, "{elements:?} {kind:?}: {error:e}");
    match kind {
        Kind::Unsymmetric => assert!(solved.factorisation.is_definite(), "{solved:?}"),
        _ => assert_eq!(solved.factorisation, factorisation, "{elements:?} {kind:?}"),
    }
    // The layout is kept; other values give another solution.
    part.blocks.iter_mut().flatten().flatten().for_each(|value| *value *= 2.0);
    let (_, half) = part.solve(&mut backend, 0.0).expect("a regular matrix");
    let doubled: Vec<[f64; D]> = half.iter().map(|x| x.map(|x| 2.0 * x)).collect();
    let again = ranks.largest(deviation(&part, &doubled, &solution));
    assert!(again < 1e-10, "{elements:?} {kind:?}: {again:e}");
    // The factor belongs to an earlier matrix, and so does the solution.
    part.blocks.iter_mut().flatten().flatten().for_each(|value| *value *= 2.0);
    let (_, earlier) = part.solve_again(&mut backend, 0.0).expect("a factor");
    let earlier: Vec<[f64; D]> = earlier.iter().map(|x| x.map(|x| 2.0 * x)).collect();
    let later = ranks.largest(deviation(&part, &earlier, &solution));
    assert!(later < 1e-10, "{elements:?} {kind:?}: {later:e}");
    print(
        ranks,
        &format!("direct {elements:?} {kind:?}: {:?}, {}", solved.factorisation, size_of_error(error)),
    );
}

/// MUMPS does not give the same bits in each run.
fn size_of_error(error: f64) -> &'static str {
    if error < 1e-12 { "error below 1e-12" } else { "error below 1e-10" }
}

fn fails<const D: usize>(ranks: &Ranks, elements: [u32; D]) {
    for kind in [Kind::Loose, Kind::NotFinite] {
        let mut backend = Direct::new().expect("MUMPS");
        let outcome = Part::new(ranks, elements, kind).solve(&mut backend, 0.0);
        assert_eq!(outcome.err(), Some(LinearError::Singular { unknown: None }), "{kind:?}");
        // The backend recovers.
        let (solved, _) =
            Part::new(ranks, elements, Kind::Definite).solve(&mut backend, 0.0).expect("regular");
        assert_eq!(solved.factorisation, Factorisation::Cholesky);
    }
}

/// The first load is the product of the matrix with a field and does not act on the mechanism; the second load does.
fn a_weak_mechanism_without_load_is_no_obstacle(ranks: &Ranks) {
    let mut part = Part::new(ranks, [4, 1], Kind::Weak);
    let some = part.load();
    let mut b = part.product(&some);
    let mut backend = Direct::new().expect("MUMPS");
    let (solved, x) = part.solve_for(&mut backend, &b, 0.0).expect("no load on the mechanism");
    assert_eq!(solved.factorisation, Factorisation::Cholesky);
    let product = part.product(&x);
    let rest = b.as_flattened().iter().zip(product.as_flattened()).map(|(b, a)| (b - a).abs());
    let error = ranks.largest(rest.fold(0.0, f64::max));
    assert!(error < 1e-11, "{error:e}");
    let far = ranks.largest(x.as_flattened().iter().fold(0.0, |far: f64, x| far.max(x.abs())));
    assert!(far < 1e5, "{far:e}");
    print(ranks, &format!("direct [4, 1] Weak: {:?}, largest motion {far:.0}", solved.factorisation));
    for (node, place) in part.places.iter().enumerate() {
        if place[0] == 4 {
            b[node][1] += if place[1] == 0 { 1e-3 } else { -2e-3 };
            b[node][0] += if place[1] == 0 { 1e-3 } else { -1e-3 };
        }
    }
    let outcome = part.solve_for(&mut backend, &b, 0.0);
    assert_eq!(outcome.err(), Some(LinearError::Singular { unknown: None }));
}
