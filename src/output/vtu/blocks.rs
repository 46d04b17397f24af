//! Arrays as VTK stores them when they are compressed: the lengths of blocks, then the blocks, each a zlib stream.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;
use flate2::{Compress, Compression, FlushCompress, Status};
use rayon::prelude::*;

/// Uncompressed size of a block, [byte]; a multiple of every size of number.
pub(super) const BLOCK: usize = 128 * 1024;

/// Size of the part of a block that is compressed to see whether the whole is worth it, [byte].
const SAMPLE: usize = 1024;

/// A number as VTK stores it.
pub(super) trait Number: Copy + Sync {
    /// VTK's name of the type.
    const NAME: &'static str;
    /// Fills as many bytes as the number has, little-endian.
    fn put(self, bytes: &mut [u8]);
}

macro_rules! number {
    ($($type:ty => $name:literal),*) => {$(
        impl Number for $type {
            const NAME: &'static str = $name;
            #[inline(always)]
            fn put(self, bytes: &mut [u8]) {
                bytes.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
number!(f64 => "Float64", i64 => "Int64", i32 => "Int32", u8 => "UInt8");

/// What one thread needs to make blocks.
struct Encoder {
    bytes: Vec<u8>,
    sample: Vec<u8>,
    compressed: Compress,
    stored: Compress,
}

impl Encoder {
    fn new() -> Encoder {
        Encoder {
            bytes: Vec::new(),
            sample: Vec::new(),
            compressed: Compress::new(Compression::new(1), true),
            stored: Compress::new(Compression::none(), true),
        }
    }

    /// A block of numbers as a zlib stream: compressed where a part out of its middle gives up an eighth of its length,
    /// otherwise stored. The digits of most fields are as good as random; to look for a pattern in them takes longer than to
    /// compute them.
    fn block<T: Number>(&mut self, numbers: &[T]) -> io::Result<Vec<u8>> {
        self.bytes.resize(size_of_val(numbers), 0);
        for (bytes, number) in self.bytes.chunks_exact_mut(size_of::<T>()).zip(numbers) {
            number.put(bytes);
        }
        let begin = self.bytes.len().saturating_sub(SAMPLE) / 2;
        let sample = &self.bytes[begin..(begin + SAMPLE).min(self.bytes.len())];
        deflate(&mut self.compressed, sample, &mut self.sample)?;
        let worth = self.sample.len() <= sample.len() - sample.len() / 8;
        let how = if worth { &mut self.compressed } else { &mut self.stored };
        let mut block = Vec::new();
        deflate(how, &self.bytes, &mut block)?;
        block.shrink_to_fit();
        Ok(block)
    }
}

/// Replaces `stream` by the bytes as a zlib stream.
fn deflate(how: &mut Compress, bytes: &[u8], stream: &mut Vec<u8>) -> io::Result<()> {
    how.reset();
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

/// The numbers as a table of blocks and the blocks, to be appended at a place; the same for any number of threads.
///
/// Where an array ends, the next begins, and meshio 5.3 confuses places that are multiples of four: it gives every array
/// that it has read another place, always a multiple of four, and looks for the next one among all. So there are up to three
/// zeros after the last stream of an array, which readers leave alone.
pub(super) fn encode<T: Number>(numbers: &[T], place: u64) -> io::Result<Vec<Vec<u8>>> {
    let mut blocks: Vec<Vec<u8>> = numbers
        .par_chunks(BLOCK / size_of::<T>())
        .map_init(Encoder::new, |encoder, chunk| encoder.block(chunk))
        .collect::<io::Result<_>>()?;
    let end = place as usize + 8 * (3 + blocks.len()) + blocks.iter().map(Vec::len).sum::<usize>();
    if let Some(last) = blocks.last_mut() {
        last.resize(last.len() + (4 + 1 - end % 4) % 4, 0);
    }
    // A last block that is full is written as "no partial block", size 0.
    let partial = size_of_val(numbers) % BLOCK;
    let mut table = Vec::with_capacity(8 * (3 + blocks.len()));
    for word in [blocks.len(), BLOCK, partial].into_iter().chain(blocks.iter().map(Vec::len)) {
        table.extend_from_slice(&(word as u64).to_le_bytes());
    }
    let mut parts = vec![table];
    parts.extend(blocks);
    Ok(parts)
}

/// The bytes of an array that is stored in exactly these; `None` if they are damaged.
pub(super) fn decode(stored: &[u8]) -> Option<Vec<u8>> {
    let word = |index: usize| -> Option<usize> {
        let begin = index.checked_mul(8)?;
        let bytes = stored.get(begin..begin.checked_add(8)?)?;
        usize::try_from(u64::from_le_bytes(bytes.try_into().ok()?)).ok()
    };
    let (blocks, size, partial) = (word(0)?, word(1)?, word(2)?);
    if size > BLOCK || partial > size {
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

/// A block, if it has the length that it should have.
fn inflate(block: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(length);
    ZlibDecoder::new(block).take(length as u64 + 1).read_to_end(&mut bytes).ok()?;
    (bytes.len() == length).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_pattern_is_stored_and_what_has_one_is_compressed() {
        let mut state = 1u64;
        let noise: Vec<f64> = (0..3 * BLOCK / 8 + 5)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64
            })
            .collect();
        for (numbers, least, most) in
            [(noise.clone(), 1.0, 1.01), (vec![0.0; noise.len()], 0.0, 0.01), (vec![], 0.0, 0.0)]
        {
            let stored = encode(&numbers, 0).unwrap().concat();
            assert!(stored.len() % 4 == 1 || numbers.is_empty());
            let length = 8.0 * numbers.len() as f64;
            assert!((least * length..=most * length + 24.0).contains(&(stored.len() as f64)));
            let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            assert_eq!(decode(&stored), Some(bytes));
            assert_eq!(decode(&stored[..stored.len() - 4]), None);
            assert_eq!(decode(&[&stored[..], &[0]].concat()), None);
        }
        // Each block by itself.
        let mixed = [&noise[..BLOCK / 8], &[1.5; BLOCK / 8]].concat();
        let lengths: Vec<usize> = encode(&mixed, 0).unwrap().iter().map(Vec::len).collect();
        assert!(lengths[1] > BLOCK && lengths[2] < BLOCK / 50, "{lengths:?}");
    }
}
