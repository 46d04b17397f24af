//! Damage to files of words and numbers, or of binary numbers.

use crate::random::Random;

/// Numbers at the limits of their types, and words of the formats.
const WORDS: [&str; 30] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "4",
    "15",
    "99999999999",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "-1e308",
    "1e400",
    "1e-320",
    "nan",
    "inf",
    "0.5",
    "$Nodes",
    "$EndNodes",
    "$Elements",
    "$EndElements",
    "$Entities",
    "$PhysicalNames",
    "4.1",
    "2.2",
    "facet normal",
    "vertex",
    "endloop",
    "endsolid",
    "\"",
];

/// Damages a file in one place.
pub fn damage(content: &mut Vec<u8>, random: &mut Random) {
    if content.is_empty() {
        return;
    }
    let at = random.below(content.len());
    match random.below(9) {
        0 => content[at] ^= 1 << random.below(8),
        1 => content.truncate(at),
        2 => {
            let end = (at + random.below(200)).min(content.len());
            content.drain(at..end);
        }
        3 => {
            let end = (at + random.below(200)).min(content.len());
            let piece = content[at..end].to_vec();
            let to = random.below(content.len());
            content.splice(to..to, piece);
        }
        4 => {
            // A binary number at an end of its range.
            let numbers: [[u8; 8]; 6] = [
                [0xff; 8],
                [0; 8],
                f64::NAN.to_le_bytes(),
                f64::MAX.to_le_bytes(),
                (1u64 << 40).to_le_bytes(),
                [0, 0, 0, 0x80, 0, 0, 0, 0x80],
            ];
            let number = random.pick(&numbers);
            let end = (at + *random.pick(&[4, 8])).min(content.len());
            for (to, from) in content[at..end].iter_mut().zip(number) {
                *to = *from;
            }
        }
        5 => content.insert(at, random.next() as u8),
        _ => {
            let (start, end) = word_around(content, at);
            content.splice(start..end, random.pick(&WORDS).bytes());
        }
    }
}

/// The word of a text that contains or follows a position.
fn word_around(content: &[u8], at: usize) -> (usize, usize) {
    let is_word = |b: &u8| !b.is_ascii_whitespace();
    let start = content[..at].iter().rposition(|b| !is_word(b)).map_or(0, |p| p + 1);
    let end = content[at..].iter().position(|b| !is_word(b)).map_or(content.len(), |p| at + p);
    (start, end.max(start))
}
