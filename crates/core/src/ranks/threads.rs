//! Ranks that are threads of this process, for tests and for programs without MPI.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Communicator, Ranks};

type Bytes = Vec<u8>;

/// The call in which a message is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    GatherAll,
    Gather,
    Exchange,
    Swap,
}

/// One rank's ends of the channels.
#[derive(Debug)]
struct Thread {
    own: usize,
    to: Vec<Sender<(Call, Bytes)>>,
    from: Vec<Mutex<Receiver<(Call, Bytes)>>>,
}

impl Thread {
    fn send(&self, call: Call, rank: usize, message: Bytes) {
        // A rank that has ended receives nothing.
        let _ = self.to[rank].send((call, message));
    }

    /// The next message from a rank.
    ///
    /// # Panics
    /// If that rank has ended, since this one would then wait for ever, or if the two ranks are in different calls.
    fn receive(&self, call: Call, rank: usize) -> Bytes {
        let from = self.from[rank].lock().unwrap_or_else(PoisonError::into_inner);
        match from.recv() {
            Ok((other, message)) if other == call => message,
            Ok((other, _)) => panic!("rank {rank} is in {other:?}, and rank {} in {call:?}", self.own),
            Err(_) => panic!("rank {rank} has ended before rank {}", self.own),
        }
    }
}

impl Communicator for Thread {
    fn count(&self) -> usize {
        self.to.len()
    }

    fn own(&self) -> usize {
        self.own
    }

    fn gather_all(&self, own: &[u8]) -> Vec<Bytes> {
        (0..self.count()).for_each(|rank| self.send(Call::GatherAll, rank, own.to_vec()));
        (0..self.count()).map(|rank| self.receive(Call::GatherAll, rank)).collect()
    }

    fn gather(&self, own: &[u8]) -> Vec<Bytes> {
        self.send(Call::Gather, 0, own.to_vec());
        if self.own > 0 {
            return Vec::new();
        }
        (0..self.count()).map(|rank| self.receive(Call::Gather, rank)).collect()
    }

    fn exchange(&self, messages: Vec<(usize, Bytes)>) -> Vec<(usize, Bytes)> {
        let mut by_rank = vec![None; self.count()];
        messages.into_iter().for_each(|(rank, message)| by_rank[rank] = Some(message));
        for (rank, message) in by_rank.into_iter().enumerate() {
            // The first byte tells whether there is a message.
            let message = message.map_or_else(|| vec![0], |message| [vec![1], message].concat());
            self.send(Call::Exchange, rank, message);
        }
        (0..self.count())
            .filter_map(|rank| {
                let mut message = self.receive(Call::Exchange, rank);
                (message.remove(0) == 1).then_some((rank, message))
            })
            .collect()
    }

    fn swap(&self, with: &[usize], send: &[Vec<f64>], receive: &mut [Vec<f64>]) {
        for (&rank, numbers) in with.iter().zip(send) {
            self.send(Call::Swap, rank, numbers.iter().flat_map(|x| x.to_ne_bytes()).collect());
        }
        for (&rank, numbers) in with.iter().zip(receive) {
            let bytes = self.receive(Call::Swap, rank);
            for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(size_of::<f64>())) {
                *number = f64::from_ne_bytes(bytes.try_into().unwrap_or_default());
            }
        }
    }
}

/// Runs `work` on `n` threads, each acting as one rank; returns their results in rank order.
pub fn run<T: Send>(n: usize, work: impl Fn(Ranks) -> T + Sync) -> Vec<T> {
    let (mut senders, mut receivers): (Vec<Vec<_>>, Vec<Vec<_>>) =
        ((0..n).map(|_| Vec::new()).collect(), (0..n).map(|_| Vec::new()).collect());
    for from in &mut senders {
        for to in &mut receivers {
            let (sender, receiver) = channel();
            from.push(sender);
            to.push(Mutex::new(receiver));
        }
    }
    let threads: Vec<Thread> = (senders.into_iter().zip(receivers).enumerate())
        .map(|(own, (to, from))| Thread { own, to, from })
        .collect();
    std::thread::scope(|scope| {
        let work = &work;
        let running: Vec<_> = threads
            .into_iter()
            .map(|thread| scope.spawn(move || work(Ranks::new(Arc::new(thread)))))
            .collect();
        running
            .into_iter()
            .map(|rank| rank.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reductions_give_all_ranks_the_same_bits() {
        let found = run(4, |ranks| {
            let own = ranks.own() as f64;
            let mut values = [0.1 * own, -own, 1e16];
            ranks.sum(&mut values);
            let mut most = [own, -own, if own == 2.0 { f64::NAN } else { 0.0 }];
            ranks.maximum(&mut most);
            assert!(most[2].is_nan() && most[..2] == [3.0, 0.0]);
            assert!(ranks.any(own == 3.0) && !ranks.all(own == 3.0) && ranks.all(own < 4.0));
            assert_eq!((ranks.count_all(ranks.own()), ranks.smallest(own)), (6, 0.0));
            assert_eq!(ranks.gather_all(format!("of {own}")), ["of 0", "of 1", "of 2", "of 3"]);
            assert_eq!(ranks.gather(ranks.own()).len(), if ranks.is_root() { 4 } else { 0 });
            assert_eq!(ranks.first((own > 1.0).then_some(own)), Some(2.0));
            values.map(f64::to_bits)
        });
        let expected = [0.0 + 0.1 + 0.2 + 0.1 * 3.0, -6.0, 4e16].map(f64::to_bits);
        assert!(found.iter().all(|numbers| *numbers == expected), "{found:?}");
    }

    #[test]
    fn messages_reach_the_ranks_they_are_for() {
        run(3, |ranks| {
            let own = ranks.own();
            let communicator = ranks.communicator().unwrap();
            // Rank 0 writes to itself and to rank 2, rank 1 to nobody; rank 2 sends an empty message to rank 0.
            let messages = match own {
                0 => vec![(0, vec![7]), (2, vec![8, 9])],
                1 => vec![],
                _ => vec![(0, vec![])],
            };
            let expected = match own {
                0 => vec![(0, vec![7]), (2, vec![])],
                1 => vec![],
                _ => vec![(0, vec![8, 9])],
            };
            assert_eq!(communicator.exchange(messages), expected);
            let with: Vec<usize> = (0..3).filter(|rank| *rank != own).collect();
            let send: Vec<Vec<f64>> = with.iter().map(|rank| vec![(10 * own + rank) as f64]).collect();
            let mut receive = vec![vec![0.0]; 2];
            communicator.swap(&with, &send, &mut receive);
            assert_eq!(receive, with.iter().map(|rank| vec![(10 * rank + own) as f64]).collect::<Vec<_>>());
        });
    }

    #[test]
    fn one_rank_is_alone() {
        run(1, |ranks| {
            assert!(ranks.is_alone() && ranks.is_root() && ranks.total(2.0) == 2.0);
            assert_eq!((ranks.count(), ranks.gather(5), ranks.first(Some(1))), (1, vec![5], Some(1)));
        });
    }
}
