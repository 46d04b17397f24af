//! Bytes in compressed blocks, between a line with the format version and a checksum.
//!
//! A block consists of its length and its compressed length, each as four little-endian bytes, and its compressed form,
//! a zlib stream. An empty block ends the list. The CRC-32 of all preceding bytes follows it.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use mpm_core::input_file;
use rayon::prelude::*;

/// The first line of a file, without its newline: the name of the format, and its version.
pub(super) const NAME: &str = "mpm checkpoint";
const VERSION: u32 = 6;

/// Length of a block, [byte], and number of blocks compressed at a time.
const BLOCK: usize = 1 << 20;
const BATCH: usize = 8;

/// Writes the output of `fill`.
pub(super) fn write(
    file: &mut dyn Write,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = Compressor { file, sum: crc32fast::Hasher::new(), waiting: Vec::new() };
    out.put(format!("{NAME} {VERSION}\n").as_bytes())?;
    fill(&mut out)?;
    out.flush()?;
    out.put(&[0; 8])?;
    let sum = out.sum.finalize();
    file.write_all(&sum.to_le_bytes())
}

struct Compressor<'a> {
    file: &'a mut dyn Write,
    sum: crc32fast::Hasher,
    waiting: Vec<u8>,
}

impl Compressor<'_> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.sum.update(bytes);
        self.file.write_all(bytes)
    }
}

impl Write for Compressor<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.waiting.extend_from_slice(bytes);
        if self.waiting.len() >= BATCH * BLOCK {
            self.flush()?;
        }
        Ok(bytes.len())
    }

    /// Writes all pending bytes, in blocks that do not depend on the number of threads.
    fn flush(&mut self) -> io::Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let blocks: Vec<io::Result<Vec<u8>>> = waiting.par_chunks(BLOCK).map(compressed).collect();
        for (raw, block) in waiting.chunks(BLOCK).zip(blocks) {
            let block = block?;
            self.put(&(raw.len() as u32).to_le_bytes())?;
            self.put(&(block.len() as u32).to_le_bytes())?;
            self.put(&block)?;
        }
        self.waiting = waiting;
        self.waiting.clear();
        Ok(())
    }
}

fn compressed(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len()), Compression::fast());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// Reads a file written by [`write`].
///
/// # Errors
/// The fault of the file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, String> {
    check_sum(path)?;
    let mut file = open(path)?;
    let mut line = [0; NAME.len() + 3];
    file.read_exact(&mut line).map_err(cut_off)?;
    let mut content = Vec::new();
    loop {
        let [raw, packed] = [length(&mut file)?, length(&mut file)?];
        if raw == 0 {
            return Ok(content);
        }
        if raw > BLOCK || packed > 2 * BLOCK {
            return Err("a block is too long".to_owned());
        }
        let mut block = vec![0; packed];
        file.read_exact(&mut block).map_err(cut_off)?;
        let before = content.len();
        let unpacked = ZlibDecoder::new(&block[..]).take(raw as u64 + 1).read_to_end(&mut content);
        if unpacked.is_err() || content.len() - before != raw {
            return Err("a block cannot be decompressed".to_owned());
        }
    }
}

fn open(path: &Path) -> Result<BufReader<File>, String> {
    input_file::open(path).map(|(file, _)| BufReader::new(file)).map_err(|error| error.to_string())
}

fn cut_off(_: io::Error) -> String {
    "it is cut off".to_owned()
}

fn length(file: &mut impl Read) -> Result<usize, String> {
    let mut bytes = [0; 4];
    file.read_exact(&mut bytes).map_err(cut_off)?;
    Ok(u32::from_le_bytes(bytes) as usize)
}

/// Checks the version and the checksum of a file.
fn check_sum(path: &Path) -> Result<(), String> {
    let mut file = open(path)?;
    let (mut sum, mut tail) = (crc32fast::Hasher::new(), Vec::new());
    let mut piece = vec![0; BLOCK];
    let mut first = true;
    loop {
        let n = file.read(&mut piece).map_err(|error| error.to_string())?;
        if n == 0 {
            break;
        }
        if std::mem::take(&mut first) {
            check_version(&piece[..n])?;
        }
        // The last four bytes are the sum itself.
        tail.extend_from_slice(&piece[..n]);
        let known = tail.len().saturating_sub(4);
        sum.update(&tail[..known]);
        tail.drain(..known);
    }
    match <[u8; 4]>::try_from(&tail[..]) {
        Ok(stored) if !first && u32::from_le_bytes(stored) == sum.finalize() => Ok(()),
        _ => Err("it is incomplete or damaged: its checksum is wrong".to_owned()),
    }
}

fn check_version(start: &[u8]) -> Result<(), String> {
    let end = start.iter().take(64).position(|b| *b == b'\n');
    let line = end.and_then(|end| std::str::from_utf8(&start[..end]).ok());
    match line.and_then(|line| line.strip_prefix(NAME)).map(str::trim) {
        Some(version) if version == VERSION.to_string() => Ok(()),
        Some(version) => {
            Err(format!("it has version {version} of the format, but this program reads {VERSION}"))
        }
        None => Err("it is not a checkpoint".to_owned()),
    }
}
