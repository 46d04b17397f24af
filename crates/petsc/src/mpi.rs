//! Messages between the processes of `mpirun`.

use std::ffi::{c_int, c_void};

use mpm_core::ranks::Communicator;

use crate::ffi;

/// Largest number of bytes in one MPI message, whose counts have 31 bits.
const CHUNK: usize = 1 << 30;

/// Tags of the messages, so that messages of different methods are not mixed up.
const EXCHANGE: c_int = 1;
const SWAP: c_int = 2;
const GATHER: c_int = 3;

/// All ranks of MPI, on a communicator that no other library uses.
///
/// An MPI error ends all ranks with a message, as is the default in MPI.
#[derive(Debug)]
pub struct Mpi {
    communicator: ffi::MPI_Comm,
    count: usize,
    own: usize,
    /// Largest number of bytes in one MPI message.
    chunk: usize,
}

// SAFETY: MPI was started for calls from several threads, one at a time, and MPI handles belong to no thread. A rank
// makes its calls in the order that the other ranks expect, so a program cannot make two at a time.
unsafe impl Send for Mpi {}
// SAFETY: As above.
unsafe impl Sync for Mpi {}

impl Mpi {
    /// The communicator of all ranks. MPI must be running, and all ranks must call this.
    pub(crate) fn world() -> Self {
        let mut communicator = ffi::MPI_COMM_WORLD();
        let (mut own, mut count) = (0, 0);
        // SAFETY: MPI is running, and all arguments outlive the calls.
        unsafe {
            ffi::MPI_Comm_dup(ffi::MPI_COMM_WORLD(), &mut communicator);
            ffi::MPI_Comm_rank(communicator, &mut own);
            ffi::MPI_Comm_size(communicator, &mut count);
        }
        Mpi { communicator, count: count as usize, own: own as usize, chunk: CHUNK }
    }

    /// The same ranks with at most this number of bytes in one MPI message, for tests. All ranks must call this.
    #[must_use]
    pub fn in_chunks(&self, bytes: usize) -> Self {
        Mpi { chunk: bytes.clamp(1, CHUNK), ..Mpi::world() }
    }

    /// One number from each rank.
    fn gather_numbers(&self, own: u64) -> Vec<u64> {
        let mut all = vec![0u64; self.count];
        let bytes = size_of::<u64>() as c_int;
        // SAFETY: Each rank sends and receives one number per rank.
        unsafe {
            ffi::MPI_Allgather(
                (&raw const own).cast(),
                bytes,
                ffi::MPI_BYTE(),
                all.as_mut_ptr().cast(),
                bytes,
                ffi::MPI_BYTE(),
                self.communicator,
            );
        }
        all
    }

    /// Sends one number to each rank; returns the numbers sent to this one.
    fn transpose(&self, send: &[u64]) -> Vec<u64> {
        let mut receive = vec![0u64; self.count];
        assert_eq!(send.len(), self.count, "one number for each rank");
        let bytes = size_of::<u64>() as c_int;
        // SAFETY: Both buffers hold one number per rank.
        unsafe {
            ffi::MPI_Alltoall(
                send.as_ptr().cast(),
                bytes,
                ffi::MPI_BYTE(),
                receive.as_mut_ptr().cast(),
                bytes,
                ffi::MPI_BYTE(),
                self.communicator,
            );
        }
        receive
    }

    /// Gathers the bytes of all ranks in rank order, in one message; `lengths` are their numbers of bytes.
    fn gather_few(&self, own: &[u8], lengths: &[usize], all: &mut [u8]) {
        let counts: Vec<c_int> = lengths.iter().map(|length| *length as c_int).collect();
        let starts: Vec<c_int> = (0..counts.len()).map(|rank| counts[..rank].iter().sum()).collect();
        // SAFETY: `all` has room for the bytes of all ranks, fewer than 2^31.
        unsafe {
            ffi::MPI_Allgatherv(
                own.as_ptr().cast(),
                own.len() as c_int,
                ffi::MPI_BYTE(),
                all.as_mut_ptr().cast(),
                counts.as_ptr(),
                starts.as_ptr(),
                ffi::MPI_BYTE(),
                self.communicator,
            );
        }
    }

    /// Copies bytes from one rank to all others.
    fn broadcast(&self, root: usize, bytes: &mut [u8]) {
        for chunk in bytes.chunks_mut(self.chunk) {
            // SAFETY: The chunk has this length, on all ranks.
            unsafe {
                ffi::MPI_Bcast(
                    chunk.as_mut_ptr().cast(),
                    chunk.len() as c_int,
                    ffi::MPI_BYTE(),
                    root as c_int,
                    self.communicator,
                );
            }
        }
    }
}

/// Messages under way. The borrow keeps their buffers in place until they have arrived.
struct Requests<'a> {
    mpi: &'a Mpi,
    mark: c_int,
    pending: Vec<ffi::MPI_Request>,
}

impl<'a> Requests<'a> {
    fn new(mpi: &'a Mpi, mark: c_int) -> Self {
        Requests { mpi, mark, pending: Vec::new() }
    }

    fn receive(&mut self, rank: usize, bytes: &'a mut [u8]) {
        for chunk in bytes.chunks_mut(self.mpi.chunk) {
            self.pending.push(ffi::NO_REQUEST);
            let (n, from) = (chunk.len() as c_int, rank as c_int);
            let request = self.pending.last_mut().map_or(std::ptr::null_mut(), |request| request);
            let to: *mut c_void = chunk.as_mut_ptr().cast();
            // SAFETY: The buffer is borrowed until all requests are complete.
            unsafe {
                ffi::MPI_Irecv(to, n, ffi::MPI_BYTE(), from, self.mark, self.mpi.communicator, request);
            }
        }
    }

    fn send(&mut self, rank: usize, bytes: &'a [u8]) {
        for chunk in bytes.chunks(self.mpi.chunk) {
            self.pending.push(ffi::NO_REQUEST);
            let (n, to) = (chunk.len() as c_int, rank as c_int);
            let request = self.pending.last_mut().map_or(std::ptr::null_mut(), |request| request);
            let from: *const c_void = chunk.as_ptr().cast();
            // SAFETY: The buffer is borrowed until all requests are complete.
            unsafe {
                ffi::MPI_Isend(from, n, ffi::MPI_BYTE(), to, self.mark, self.mpi.communicator, request);
            }
        }
    }
}

impl Drop for Requests<'_> {
    /// Waits until all messages have been sent and received.
    fn drop(&mut self) {
        for some in self.pending.chunks_mut(1 << 20) {
            // SAFETY: Each request has been started, and nobody asks for its status.
            unsafe { ffi::MPI_Waitall(some.len() as c_int, some.as_mut_ptr(), ffi::MPI_STATUSES_IGNORE) };
        }
    }
}

impl Communicator for Mpi {
    fn count(&self) -> usize {
        self.count
    }

    fn own(&self) -> usize {
        self.own
    }

    fn gather_all(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let lengths: Vec<usize> =
            self.gather_numbers(own.len() as u64).into_iter().map(|n| n as usize).collect();
        let total: usize = lengths.iter().sum();
        if total <= self.chunk {
            let mut all = vec![0; total];
            self.gather_few(own, &lengths, &mut all);
            let mut rest = all.as_slice();
            return lengths.iter().filter_map(|n| rest.split_off(..*n)).map(<[u8]>::to_vec).collect();
        }
        let broadcast = |(rank, length): (usize, &usize)| {
            let mut bytes = if rank == self.own { own.to_vec() } else { vec![0; *length] };
            self.broadcast(rank, &mut bytes);
            bytes
        };
        lengths.iter().enumerate().map(broadcast).collect()
    }

    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let lengths = self.gather_numbers(own.len() as u64);
        if self.own > 0 {
            Requests::new(self, GATHER).send(0, own);
            return Vec::new();
        }
        let mut all: Vec<Vec<u8>> = lengths.iter().map(|n| vec![0; *n as usize]).collect();
        all[0].copy_from_slice(own);
        let mut requests = Requests::new(self, GATHER);
        all.iter_mut().enumerate().skip(1).for_each(|(rank, bytes)| requests.receive(rank, bytes));
        drop(requests);
        all
    }

    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Vec<(usize, Vec<u8>)> {
        let mut by_rank: Vec<Option<Vec<u8>>> = vec![None; self.count];
        messages.into_iter().for_each(|(rank, message)| by_rank[rank] = Some(message));
        // One is added to each length, so that an empty message differs from no message.
        let lengths: Vec<u64> =
            by_rank.iter().map(|message| message.as_ref().map_or(0, |m| m.len() as u64 + 1)).collect();
        let own = by_rank[self.own].take();
        let lengths = self.transpose(&lengths);
        let others = lengths.iter().enumerate().filter(|(rank, n)| **n > 0 && *rank != self.own);
        let mut received: Vec<(usize, Vec<u8>)> =
            others.map(|(rank, n)| (rank, vec![0; *n as usize - 1])).collect();
        let mut requests = Requests::new(self, EXCHANGE);
        received.iter_mut().for_each(|(rank, bytes)| requests.receive(*rank, bytes));
        for (rank, message) in by_rank.iter().enumerate() {
            message.iter().for_each(|message| requests.send(rank, message));
        }
        drop(requests);
        if let Some(message) = own {
            let place = received.partition_point(|(rank, _)| *rank < self.own);
            received.insert(place, (self.own, message));
        }
        received
    }

    fn swap(&self, with: &[usize], send: &[Vec<f64>], receive: &mut [Vec<f64>]) {
        let mut requests = Requests::new(self, SWAP);
        with.iter().zip(receive).for_each(|(rank, numbers)| requests.receive(*rank, bytes_of_mut(numbers)));
        with.iter().zip(send).for_each(|(rank, numbers)| requests.send(*rank, bytes_of(numbers)));
    }
}

fn bytes_of(numbers: &[f64]) -> &[u8] {
    // SAFETY: Numbers are bytes without padding.
    unsafe { std::slice::from_raw_parts(numbers.as_ptr().cast(), size_of_val(numbers)) }
}

fn bytes_of_mut(numbers: &mut [f64]) -> &mut [u8] {
    // SAFETY: Numbers are bytes without padding, and any bytes are valid numbers.
    unsafe { std::slice::from_raw_parts_mut(numbers.as_mut_ptr().cast(), size_of_val(numbers)) }
}
