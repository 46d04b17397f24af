//! Damaged files and bodies are refused or yield a body: nothing panics, hangs, or takes much memory.

use std::collections::HashMap;
use std::fmt;
use std::time::Instant;

use super::tests::{binary, cube, sphere, text, together, torus, turned};
use super::*;
use crate::region::stl;
use crate::region::tests::Random;

/// The environment variable `FUZZ_FILES` sets the number of files.
#[test]
fn damaged_files_are_refused_or_give_a_body() {
    let files_to_read = std::env::var("FUZZ_FILES").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let bodies = [
        cube([0.0; 3], 1.0),
        torus(2.0, 0.5, 6, 5),
        sphere([1.0; 3], 1.0, 6, 4),
        together(&[cube([0.0; 3], 4.0), turned(cube([1.0; 3], 2.0)), cube([1.5; 3], 1.0)]),
    ];
    let files: Vec<Vec<u8>> = bodies.iter().flat_map(|body| [text(body), binary(body)]).collect();
    let mut random = Random(3);
    let mut outcomes: HashMap<String, usize> = HashMap::new();
    for _ in 0..files_to_read {
        let file = if random.word().is_multiple_of(2) {
            let mut body = bodies[random.word() as usize % bodies.len()].clone();
            for _ in 0..=random.word() % 3 {
                bend(&mut body, &mut random);
            }
            if random.word().is_multiple_of(2) { text(&body) } else { binary(&body) }
        } else {
            let mut file = files[random.word() as usize % files.len()].clone();
            for _ in 0..=random.word() % 4 {
                damage(&mut file, &files, &mut random);
            }
            file
        };
        let before = Instant::now();
        *outcomes.entry(outcome(&file)).or_default() += 1;
        assert!(before.elapsed().as_secs() < 20);
    }
    assert!(outcomes["body"] > 0 && outcomes.len() >= 12, "{outcomes:?}");
}

fn damage(file: &mut Vec<u8>, files: &[Vec<u8>], random: &mut Random) {
    const STRANGE: [&[u8]; 14] = [
        b"nan",
        b"inf",
        b"1e999",
        b"-1e-320",
        b"1e59",
        b"solid",
        b"endsolid",
        b"facet",
        b"vertex",
        b"\0\0\0\0",
        b"\xff\xff\xff\xff",
        b"\0\0\xc0\x7f",
        b"\xef\xbb\xbf",
        b"\n",
    ];
    let mut within = |n: usize| if n == 0 { 0 } else { random.word() as usize % n };
    let (at, to) = (within(file.len()), within(file.len()));
    let (at, to) = (at.min(to), at.max(to));
    match within(9) {
        0 if !file.is_empty() => file[at] = within(256) as u8,
        1 if !file.is_empty() => file[at] ^= 1 << within(8),
        2 => file.truncate(at),
        3 => drop(file.drain(at..to.min(at + 60))),
        4 => drop(file.splice(at..at, STRANGE[within(STRANGE.len())].iter().copied())),
        5 => {
            let strange = STRANGE[within(STRANGE.len())];
            let end = (at + strange.len()).min(file.len());
            file[at..end].copy_from_slice(&strange[..end - at]);
        }
        6 => {
            let other = &files[within(files.len())];
            let (a, b) = (within(other.len()), within(other.len()));
            file.splice(at..to, other[a.min(b)..a.max(b)].iter().copied());
        }
        // Replace a coordinate of a facet by another one (binary file).
        7 if file.len() > 200 => {
            let facets = (file.len() - 84) / 50;
            let (a, b) = (
                84 + 50 * within(facets) + 12 + 4 * within(9),
                84 + 50 * within(facets) + 12 + 4 * within(9),
            );
            file.copy_within(b..b + 4, a);
        }
        // Replace a digit of a text file.
        8 if file.len() > 84 => {
            let digit = file.iter().skip(at).position(u8::is_ascii_digit);
            if let Some(offset) = digit {
                file[at + offset] = b'0' + within(10) as u8;
            }
        }
        _ => {}
    }
}

/// Moves a corner together with all facets at it; or reverses, removes or duplicates a facet; or adds a shifted copy of
/// the body.
fn bend(body: &mut Vec<Triangle>, random: &mut Random) {
    let facet = random.word() as usize % body.len();
    let shift: [f64; 3] = std::array::from_fn(|_| random.between(-2.0, 2.0));
    match random.word() % 8 {
        0 => body[facet].swap(0, 1),
        1 if body.len() > 1 => drop(body.swap_remove(facet)),
        2 => body.push(body[facet]),
        3 => body.extend(body.clone().iter().map(|t| t.map(|x| std::array::from_fn(|d| x[d] + shift[d])))),
        _ => {
            let corner = body[facet][0];
            let size = [1e-7, 0.1, 1.0][random.word() as usize % 3];
            let moved = std::array::from_fn(|d| corner[d] + size * shift[d]);
            body.as_flattened_mut().iter_mut().filter(|x| **x == corner).for_each(|x| *x = moved);
        }
    }
}

/// Kind of the error; `body` if the file yields a body.
fn outcome(file: &[u8]) -> String {
    let kind =
        |error: &dyn fmt::Debug| format!("{error:?}").split([' ', '(']).next().unwrap_or_default().to_owned();
    let triangles = match stl::read(file) {
        Ok(file) => file.triangles,
        Err(error) => {
            assert!(error.to_string().len() < 500);
            return kind(&error);
        }
    };
    assert!(triangles.len() * 50 <= file.len());
    match Surface::new(&triangles) {
        Ok(body) => {
            assert!(body.volume() >= 0.0);
            let bounds = body.tree.bounds();
            let middle = std::array::from_fn(|d| 0.5 * bounds[0][d] + 0.5 * bounds[1][d]);
            let line = Line::along_axis(middle, 0);
            let inside = body.intervals(&line);
            assert!(inside.length() >= 0.0 && !body.contains(&bounds[1].map(|x| x + 1.0 + x.abs())));
            "body".to_owned()
        }
        Err(error) => {
            assert!(error.to_string().len() < 2000);
            kind(&error)
        }
    }
}
