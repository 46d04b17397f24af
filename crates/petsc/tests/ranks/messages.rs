//! Messages between ranks.

use std::sync::Arc;

use mpm_core::ranks::{Communicator, Ranks};
use mpm_petsc::Mpi;

pub fn check(communicator: &Arc<Mpi>) {
    let small = Arc::new(communicator.in_chunks(24));
    for communicator in [communicator, &small] {
        reductions(&Ranks::new(Arc::clone(communicator) as Arc<dyn Communicator>));
        lengths(communicator.as_ref());
        exchange(communicator.as_ref());
        swap(communicator.as_ref());
    }
}

fn reductions(ranks: &Ranks) {
    let (own, count) = (ranks.own() as f64, ranks.count());
    let mut values = [0.1 * own, -own, 1e16];
    ranks.sum(&mut values);
    let in_order = |of: &dyn Fn(f64) -> f64| (1..count).fold(of(0.0), |sum, rank| sum + of(rank as f64));
    let expected = [in_order(&|rank| 0.1 * rank), in_order(&|rank| -rank), in_order(&|_| 1e16)];
    assert_eq!(values.map(f64::to_bits), expected.map(f64::to_bits));
    let mut most = [own, -own, if ranks.own() + 1 == count { f64::NAN } else { 0.0 }];
    ranks.maximum(&mut most);
    assert!(most[2].is_nan() && most[0] == count as f64 - 1.0 && most[1] == 0.0);
    assert!(ranks.any(own == 0.0) && ranks.all(own < 4.0) && (count == 1 || !ranks.all(own == 0.0)));
    assert_eq!((ranks.count_all(1), ranks.smallest(own)), (count, 0.0));
    let names: Vec<String> = (0..count).map(|rank| format!("rank {rank}")).collect();
    assert_eq!(ranks.gather_all(format!("rank {own}")), names);
    assert_eq!(ranks.first((ranks.own() + 1 == count).then_some(own)), Some(count as f64 - 1.0));
}

/// The bytes that a rank sends to another.
fn bytes(from: usize, to: usize) -> Vec<u8> {
    (0..37 * from + 5 * to).map(|k| (k + 3 * from + to) as u8).collect()
}

fn lengths(communicator: &dyn Communicator) {
    let (own, count) = (communicator.own(), communicator.count());
    let all: Vec<Vec<u8>> = (0..count).map(|rank| bytes(rank, 0)).collect();
    assert_eq!(communicator.gather_all(&bytes(own, 0)), all);
    let found = communicator.gather(&bytes(own, 0));
    assert_eq!(found, if own == 0 { all } else { Vec::new() });
    assert_eq!(communicator.gather_all(&[]), vec![Vec::<u8>::new(); count]);
}

fn exchange(communicator: &dyn Communicator) {
    let (own, count) = (communicator.own(), communicator.count());
    // A message is sent if the sum of the two ranks is even; rank 0 sends itself an empty message.
    let is_sent = |from: usize, to: usize| (from + to).is_multiple_of(2);
    let messages = (0..count).filter(|to| is_sent(own, *to)).map(|to| (to, bytes(own, to))).collect();
    let expected: Vec<(usize, Vec<u8>)> =
        (0..count).filter(|from| is_sent(*from, own)).map(|from| (from, bytes(from, own))).collect();
    assert_eq!(communicator.exchange(messages), expected);
    // An empty message to the next rank.
    let next = (own + 1) % count;
    let before = (own + count - 1) % count;
    assert_eq!(communicator.exchange(vec![(next, vec![])]), vec![(before, vec![])]);
    assert_eq!(communicator.exchange(vec![]), vec![]);
}

fn swap(communicator: &dyn Communicator) {
    let (own, count) = (communicator.own(), communicator.count());
    let with: Vec<usize> = (0..count).filter(|rank| *rank != own).collect();
    let numbers = |from: usize, to: usize| -> Vec<f64> {
        (0..7 * (from + to) % 11).map(|k| k as f64 + 0.1 * (100 * from + to) as f64).collect()
    };
    let send: Vec<Vec<f64>> = with.iter().map(|rank| numbers(own, *rank)).collect();
    let mut receive: Vec<Vec<f64>> = send.iter().map(|numbers| vec![0.0; numbers.len()]).collect();
    communicator.swap(&with, &send, &mut receive);
    let expected: Vec<Vec<f64>> = with.iter().map(|rank| numbers(*rank, own)).collect();
    assert_eq!(receive, expected);
}
