//! Compressed arrays of VTK: the lengths of blocks, then the blocks, each a zlib stream.

use std::io::{self, Read};
use std::mem::take;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use flate2::read::ZlibDecoder;
use flate2::{Compress, CompressError, Compression, FlushCompress, Status};
use rayon::prelude::*;

/// Bytes of a full block before compression: at most what a zlib stream stores in one piece, and a multiple of every
/// number size times 1, 3, 6 and 9 components.
pub(super) const BLOCK: usize = 65_520;

/// Number of values in a block that are examined for a pattern; a power of two.
const SAMPLE: usize = 1024;

/// 2⁶⁴ divided by the golden ratio, a hash multiplier.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

/// Largest block that is read, [byte].
const LARGEST: usize = 1 << 20;

/// Bytes before and after the content of an uncompressed block. Before: the header of a zlib stream with one stored
/// block, and the length of that block and its complement (RFC 1950 and 1951). After: the checksum.
const BEFORE: usize = 2 + 1 + 2 + 2;
const AFTER: usize = 4;

/// A number as VTK stores it.
pub(super) trait Number: Copy + Sync {
    /// VTK's name for the type.
    const NAME: &'static str;
    /// True if the last digits of such numbers are practically random.
    const IS_ROUGH: bool;
    /// Writes the bytes of the number, little-endian.
    fn put(self, bytes: &mut [u8]);
    /// The bytes of the number as a whole number.
    #[inline(always)]
    fn bits(self) -> u64 {
        let mut bytes = [0; 8];
        self.put(&mut bytes[..size_of::<Self>()]);
        u64::from_le_bytes(bytes)
    }
}

macro_rules! number {
    ($($type:ty => $name:literal, $rough:literal);*) => {$(
        impl Number for $type {
            const NAME: &'static str = $name;
            const IS_ROUGH: bool = $rough;
            #[inline(always)]
            fn put(self, bytes: &mut [u8]) {
                bytes.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
number!(
    f64 => "Float64", true;
    f32 => "Float32", true;
    i64 => "Int64", false;
    i32 => "Int32", false;
    u8 => "UInt8", false
);

/// Memory of blocks that have been written, reused for the next file.
#[derive(Debug, Clone, Default)]
pub struct Room(Arc<Mutex<Vec<Vec<u8>>>>);

impl Room {
    /// A block with arbitrary content.
    fn take(&self) -> Vec<u8> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn give(&self, blocks: impl Iterator<Item = Vec<u8>>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(blocks);
    }
}

/// The blocks of an array.
pub(super) struct Blocks {
    /// Number of bytes of all numbers, and of a full block before compression.
    bytes: usize,
    block_bytes: usize,
    streams: Vec<Vec<u8>>,
    room: Room,
}

impl Drop for Blocks {
    fn drop(&mut self) {
        // A compressed block owns only as much memory as it needs.
        let large = take(&mut self.streams).into_iter().filter(|stream| stream.capacity() >= BLOCK);
        self.room.give(large);
    }
}

impl Blocks {
    /// Encodes an array of tuples with `components` numbers each; `numbers` fills a vector with those of a range of
    /// tuples. The result is the same for any number of threads.
    ///
    /// # Errors
    /// The first error of `numbers` or of the compression.
    pub(super) fn new<T: Number>(
        tuples: usize,
        components: usize,
        room: &Room,
        numbers: impl Fn(Range<usize>, &mut Vec<T>) -> Result<(), String> + Sync,
    ) -> Result<Blocks, String> {
        let size = components * size_of::<T>();
        let in_block = (BLOCK / size).max(1);
        let streams = (0..tuples.div_ceil(in_block)).into_par_iter().map_init(
            || (Vec::new(), Compressor::default()),
            |(values, compressor), block| {
                numbers(block * in_block..tuples.min((block + 1) * in_block), values)?;
                compressor.stream(values, room)
            },
        );
        // The first failure in the order of the array, for any number of threads.
        let streams = streams.collect::<Vec<Result<_, String>>>().into_iter().collect::<Result<_, _>>()?;
        Ok(Blocks { bytes: tuples * size, block_bytes: in_block * size, streams, room: room.clone() })
    }

    /// Length of the array if it begins at an offset among the arrays of a file, [byte].
    pub(super) fn length_at(&self, place: usize) -> usize {
        let length = 8 * (3 + self.streams.len()) + self.streams.iter().map(Vec::len).sum::<usize>();
        length + self.zeros(place + length)
    }

    /// Number of zeros that follow the last stream, as part of its block, if the stream ends at this offset.
    ///
    /// The next array begins where this one ends, and meshio 5.3 confuses offsets that are multiples of four: it
    /// assigns to every array that it has read a new offset, always a multiple of four, and searches all offsets for
    /// the next array. Readers ignore bytes after a stream.
    fn zeros(&self, end: usize) -> usize {
        if self.streams.is_empty() { 0 } else { (4 + 1 - end % 4) % 4 }
    }

    /// Writes the table of lengths and the blocks, beginning at an offset among the arrays of a file.
    pub(super) fn write(&self, place: usize, out: &mut dyn io::Write) -> io::Result<()> {
        let lengths = self.streams.iter().map(Vec::len);
        let zeros = self.zeros(place + 8 * (3 + self.streams.len()) + lengths.clone().sum::<usize>());
        // A last block that is full is written as "no partial block", size 0.
        let head = [self.streams.len(), self.block_bytes, self.bytes % self.block_bytes];
        let mut words: Vec<usize> = head.into_iter().chain(lengths).collect();
        if let Some(last) = words.last_mut().filter(|_| zeros > 0) {
            *last += zeros;
        }
        let table: Vec<u8> = words.into_iter().flat_map(|word| (word as u64).to_le_bytes()).collect();
        out.write_all(&table)?;
        self.streams.iter().try_for_each(|stream| out.write_all(stream))?;
        out.write_all(&[0; 3][..zeros])
    }
}

/// Working memory of one thread for compression.
#[derive(Default)]
struct Compressor {
    /// Created for the first block that is compressed.
    compress: Option<Compress>,
    /// The block that was compressed last, and its compressed form.
    bytes: Vec<u8>,
    stream: Vec<u8>,
    /// The current block.
    next: Vec<u8>,
}

impl Compressor {
    /// Encodes numbers as a zlib stream. Blocks of a type whose last digits are practically random are only stored,
    /// unless one in four numbers repeats another: searching such digits for patterns takes longer than computing them.
    fn stream<T: Number>(&mut self, values: &[T], room: &Room) -> Result<Vec<u8>, String> {
        let length = size_of_val(values);
        if T::IS_ROUGH && length <= BLOCK && !is_regular(values) {
            let mut stream = room.take();
            stream.reserve_exact((BEFORE + BLOCK + AFTER).saturating_sub(stream.len()));
            store(values, &mut stream);
            return Ok(stream);
        }
        self.next.resize(length, 0);
        put(values, &mut self.next);
        // A constant field has equal blocks.
        if self.stream.is_empty() || self.next != self.bytes {
            std::mem::swap(&mut self.bytes, &mut self.next);
            let compress = match &mut self.compress {
                Some(used) => {
                    used.reset();
                    used
                }
                none => none.insert(Compress::new(Compression::new(1), true)),
            };
            deflate(compress, &self.bytes, &mut self.stream).map_err(|error| error.to_string())?;
        }
        Ok(self.stream.clone())
    }
}

/// True if one in four numbers of a sample from the middle repeats an earlier one.
fn is_regular<T: Number>(values: &[T]) -> bool {
    let middle = values.len().saturating_sub(SAMPLE) / 2..values.len().min((values.len() + SAMPLE) / 2);
    // Only the last number with a given hash is remembered, which is enough to find patterns.
    let mut seen = [0; 2 * SAMPLE];
    let mut repeats = 0;
    for number in &values[middle.clone()] {
        let bits = number.bits();
        let place = bits.wrapping_mul(SPREAD) >> (u64::BITS - seen.len().ilog2());
        repeats += usize::from(std::mem::replace(&mut seen[place as usize], bits) == bits);
    }
    4 * repeats >= middle.len()
}

fn put<T: Number>(values: &[T], bytes: &mut [u8]) {
    for (bytes, value) in bytes.chunks_exact_mut(size_of::<T>()).zip(values) {
        value.put(bytes);
    }
}

/// Numbers of at most [`BLOCK`] bytes as a zlib stream that stores them.
fn store<T: Number>(values: &[T], stream: &mut Vec<u8>) {
    let length = size_of_val(values);
    // Most blocks are as long as the block that used this memory before.
    stream.resize(BEFORE + length + AFTER, 0);
    let (before, rest) = stream.split_at_mut(BEFORE);
    let (bytes, after) = rest.split_at_mut(length);
    let [low, high, ..] = length.to_le_bytes();
    before.copy_from_slice(&[0x78, 0x01, 0x01, low, high, !low, !high]);
    put(values, bytes);
    after.copy_from_slice(&simd_adler32::adler32(&&*bytes).to_be_bytes());
}

/// Replaces `stream` by the bytes as a zlib stream; `how` must be new or reset.
fn deflate(how: &mut Compress, bytes: &[u8], stream: &mut Vec<u8>) -> Result<(), CompressError> {
    stream.clear();
    stream.reserve(bytes.len() + bytes.len() / 64 + 64);
    loop {
        let taken = how.total_in() as usize;
        match how.compress_vec(&bytes[taken..], stream, FlushCompress::Finish)? {
            Status::StreamEnd => return Ok(()),
            Status::Ok | Status::BufError => stream.reserve(1024),
        }
    }
}

/// Decodes an array stored in exactly these bytes; `None` if they are damaged.
pub(super) fn decode(stored: &[u8]) -> Option<Vec<u8>> {
    let word = |index: usize| -> Option<usize> {
        let begin = index.checked_mul(8)?;
        let bytes = stored.get(begin..begin.checked_add(8)?)?;
        usize::try_from(u64::from_le_bytes(bytes.try_into().ok()?)).ok()
    };
    let (blocks, size, partial) = (word(0)?, word(1)?, word(2)?);
    if size > LARGEST || partial > size {
        return None;
    }
    let mut begin = blocks.checked_add(3)?.checked_mul(8)?;
    let mut compressed = Vec::new();
    for index in 0..blocks {
        let end = begin.checked_add(word(3 + index)?)?;
        let is_partial = partial > 0 && index + 1 == blocks;
        compressed.push((stored.get(begin..end)?, if is_partial { partial } else { size }));
        begin = end;
    }
    let whole = begin == stored.len();
    let parts: Option<Vec<Vec<u8>>> =
        compressed.into_par_iter().map(|(block, length)| inflate(block, length)).collect();
    parts.filter(|_| whole).map(|parts| parts.concat())
}

/// Decompresses a block; `None` if it does not have the expected length.
fn inflate(block: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(length);
    ZlibDecoder::new(block).take(length as u64 + 1).read_to_end(&mut bytes).ok()?;
    (bytes.len() == length).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(numbers: &[f64], room: &Room) -> Vec<u8> {
        let part = |range: Range<usize>, out: &mut Vec<f64>| {
            out.clear();
            out.extend_from_slice(&numbers[range]);
            Ok(())
        };
        let blocks = Blocks::new(numbers.len(), 1, room, part).unwrap();
        let mut bytes = Vec::new();
        blocks.write(0, &mut bytes).unwrap();
        assert_eq!(bytes.len(), blocks.length_at(0));
        assert!(bytes.len() % 4 == 1 || numbers.is_empty());
        bytes
    }

    #[test]
    fn numbers_without_pattern_are_stored_and_others_compressed() {
        let mut state = 1u64;
        let noise: Vec<f64> = (0..3 * BLOCK / 8 + 5)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64
            })
            .collect();
        let room = Room::default();
        for (numbers, least, most) in
            [(noise.clone(), 1.0, 1.01), (vec![0.0; noise.len()], 0.0, 0.02), (vec![], 0.0, 0.0)]
        {
            let stored = encoded(&numbers, &room);
            let length = 8.0 * numbers.len() as f64;
            let bounds = least * length..=most * length + 24.0;
            assert!(bounds.contains(&(stored.len() as f64)), "{} of {length}, {bounds:?}", stored.len());
            let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            assert_eq!(decode(&stored), Some(bytes));
            assert_eq!(decode(&stored[..stored.len() - 4]), None);
            assert_eq!(decode(&[&stored[..], &[0]].concat()), None);
        }
        // Corners that neighbours share, in any order.
        let shared: Vec<f64> = (0..noise.len()).map(|k| noise[k * 37 % 500]).collect();
        assert!(encoded(&shared, &room).len() < shared.len());
        // Each block is judged separately.
        let mixed = [&noise[..BLOCK / 8], &[1.5; BLOCK / 8]].concat();
        assert!((BLOCK..BLOCK + BLOCK / 50).contains(&encoded(&mixed, &room).len()));
    }

    #[test]
    fn memory_of_stored_blocks_is_reused() {
        let room = Room::default();
        let numbers: Vec<f64> = (0..BLOCK / 2).map(|k| (k as f64).sin()).collect();
        for _ in 0..3 {
            encoded(&numbers, &room);
            assert_eq!(room.0.lock().unwrap().len(), 4);
        }
    }
}
