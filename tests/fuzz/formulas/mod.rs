//! Random formulas: valid ones as trees, in several spellings, and texts that are damaged in a few places.
//!
//! The seed is fixed. A longer run, which prints how many texts it tried:
//!
//! ```text
//! FUZZ_SECONDS=600 FUZZ_SEED=2 cargo test --release --test fuzz formulas -- --ignored --nocapture
//! ```
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod meaning;
mod trees;

use std::time::Duration;

use crate::long::share;
use crate::random::Random;
use cpu_time::ThreadTime;
use mpm::formula::{Formula, FormulaError};
use trees::{CONSTANT, Spelling, Tree, VARIABLES};

const PLACES: [[f64; 2]; 4] = [[0.5, -2.0], [3.0, 0.0], [-1.25, 7.5], [1e-3, 1e6]];

/// Nesting that the program must accept.
const LEVELS: usize = 7;

/// Longest processor time allowed for parsing a text.
const AT_ONCE: Duration = Duration::from_secs(2);

fn parse(text: &str) -> Result<Formula, FormulaError> {
    let begun = ThreadTime::now();
    let parsed = Formula::parse_with_constants(text, &VARIABLES, &[CONSTANT]);
    assert!(begun.elapsed() < AT_ONCE, "{:?} for {text:?}", begun.elapsed());
    parsed
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// Checks a valid formula: all spellings give the value of the tree, to the last digit.
fn check_tree(tree: &Tree, random: &mut Random) -> usize {
    let loose = tree.text(&mut Spelling::Loose(random));
    let texts = [tree.text(&mut Spelling::Shortest), tree.text(&mut Spelling::Bracketed), loose];
    for text in &texts {
        let formula = parse(text).unwrap_or_else(|error| panic!("{text:?}: {error} at {}", error.offset));
        let again = parse(formula.text()).unwrap();
        for place in PLACES {
            let (found, expected) = (formula.evaluate(&place), tree.value(&place));
            assert!(same(found, expected), "{text:?} is {found} at {place:?}, not {expected}");
            assert!(same(again.evaluate(&place), expected), "{text:?}, read again");
        }
        let depends = [0, 1].map(|variable| tree.contains(variable));
        assert_eq!([0, 1].map(|variable| formula.depends_on(variable)), depends, "{text:?}");
        let constant = (depends == [false; 2]).then(|| tree.value(&PLACES[0]));
        let found = formula.as_constant();
        assert!(
            found.is_some() == constant.is_some() && found.zip(constant).is_none_or(|(a, b)| same(a, b)),
            "{text:?}: {found:?}, not {constant:?}"
        );
    }
    texts.len()
}

/// Checks any text: the program and the grammar agree on whether it is a formula and on its value, and its fault has a
/// location. Returns true if it is a formula.
fn check_text(text: &str) -> bool {
    match parse(text) {
        Ok(formula) => {
            assert_eq!(formula.text(), text);
            for place in PLACES {
                let found = formula.evaluate(&place);
                let expected = meaning::value(text, &place);
                assert!(
                    expected.is_some_and(|expected| same(found, expected)),
                    "{text:?} is {found} at {place:?}, not {expected:?}"
                );
            }
            true
        }
        Err(error) => {
            assert!(!error.message.is_empty());
            assert!(
                text.get(error.offset..error.offset + error.length).is_some(),
                "{text:?}: {error:?} marks no part of the text"
            );
            let deep = error.message.contains("nested too deeply");
            let marks = text.chars().filter(|c| !c.is_alphanumeric()).count();
            assert!(!deep || marks >= 60, "{text:?} is not deep");
            // A text too deep for the program is not given to the second parser, which recurses without limit.
            assert!(deep || meaning::value(text, &PLACES[0]).is_none(), "{text:?} is a formula: {error:?}");
            false
        }
    }
}

/// Parts of formulas, of other languages and of other scripts.
const PARTS: [&str; 48] = [
    "x", "y", "gamma", "gam", "pi", "0", "1", "2.5", "1e", "1e5", "1e999", ".", ".5", "1.", "e", "_", "(",
    ")", "()", ",", "+", "-", "*", "/", "^", "**", "<", "<=", "=", "==", "!", "!=", ">", "if(", "min(",
    "max(", "sin(", "pow(", "hypot", "é", "π", "²", "٣", "\u{0}", "\u{a0}", "\u{301}", "𝛼", "\u{feff}",
];

/// Damages a text in one to four places.
fn spoil(text: &str, random: &mut Random) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len() + 1);
        let to = at + random.below(bytes.len() + 1 - at).min(8);
        match random.below(7) {
            0 if at < bytes.len() => bytes[at] = random.next() as u8,
            1 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            2 => drop(bytes.drain(at..to)),
            3 => {
                let copy = bytes[at..to].to_vec();
                let place = random.below(bytes.len() + 1);
                bytes.splice(place..place, copy);
            }
            4 => bytes.truncate(at.max(1)),
            _ => drop(bytes.splice(at..at, random.pick(&PARTS).bytes())),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Number of texts tried: valid formulas, and damaged formulas and chains of parts, some of which are still formulas.
#[derive(Default)]
struct Tried {
    right: usize,
    spoiled: usize,
    still_right: usize,
}

fn round(random: &mut Random, tried: &mut Tried) {
    let levels = 1 + random.below(LEVELS);
    let tree = Tree::random(random, levels);
    tried.right += check_tree(&tree, random);
    let text = tree.text(&mut Spelling::Shortest);
    for _ in 0..4 {
        tried.spoiled += 1;
        tried.still_right += usize::from(check_text(&spoil(&text, random)));
    }
    let parts: String = (0..random.below(24)).map(|_| *random.pick(&PARTS)).collect();
    tried.spoiled += 1;
    tried.still_right += usize::from(check_text(&parts));
}

#[test]
fn random_formulas() {
    let mut random = Random::new(1);
    let mut tried = Tried::default();
    for _ in 0..share(20_000) {
        round(&mut random, &mut tried);
    }
    println!("{} right, {} spoiled of which {} still right", tried.right, tried.spoiled, tried.still_right);
    // The test is meaningful only if many damaged texts are formulas, and many are not.
    assert!(tried.still_right > tried.spoiled / 20 && tried.still_right < tried.spoiled / 2);
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn random_formulas_for_long() {
    let setting = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().unwrap());
    let seed = setting("FUZZ_SEED").unwrap_or(2);
    let limit = Duration::from_secs(setting("FUZZ_SECONDS").unwrap_or(600));
    let (mut random, mut tried, begun) = (Random::new(seed), Tried::default(), ThreadTime::now());
    while begun.elapsed() < limit {
        for _ in 0..1000 {
            round(&mut random, &mut tried);
        }
    }
    println!(
        "seed {seed}, {} s of processor time: {} right, {} spoiled of which {} still right",
        begun.elapsed().as_secs(),
        tried.right,
        tried.spoiled,
        tried.still_right
    );
}

/// Deeply nested and very long texts yield a value or a message, quickly and without a stack overflow.
#[test]
fn deep_and_long_texts_are_harmless() {
    const N: usize = 200_000;
    let repeated = |open: &str, inner: &str, close: &str, n: usize| {
        format!("{}{inner}{}", open.repeat(n), close.repeat(n))
    };
    for (open, close) in [
        ("(", ")"),
        ("-", ""),
        ("+", ""),
        ("2^", ""),
        ("2^-", ""),
        ("abs(", ")"),
        ("min(1,", ")"),
        ("1<(", ")"),
    ] {
        for n in [20, 60, 63, 64, 65, 70, 1000, N] {
            let text = repeated(open, "x", close, n);
            match parse(&text) {
                Ok(formula) => assert!(n < 65 && !formula.evaluate(&PLACES[0]).is_nan(), "{open} {n} times"),
                Err(error) => {
                    assert!(
                        n > 20 && error.message.contains("nested too deeply"),
                        "{open} {n} times: {error}"
                    );
                    assert!(text.get(error.offset..error.offset + error.length).is_some());
                }
            }
        }
    }
    for (text, value) in [
        (["x"; N].join("+"), 0.5 * N as f64),
        (["1"; N].join("*"), 1.0),
        (format!("max({})", ["x"; N].join(",")), 0.5),
        (" ".repeat(N) + "x", 0.5),
        ("0".repeat(N) + "2", 2.0),
        (format!("0.{}1", "0".repeat(N)), 0.0),
        (format!("1e{}1", "0".repeat(N)), 10.0),
    ] {
        assert_eq!(parse(&text).unwrap().evaluate(&PLACES[0]), value);
    }
    for (text, offset, length) in [
        ("a".repeat(N), 0, N),
        ("é".repeat(N), 0, 2 * N),
        ("9".repeat(N), 0, N),
        (format!("1e{}", "9".repeat(N)), 0, N + 2),
        (" ".repeat(N), N, 0),
        (["x"; N].join(" "), 2, 1),
        (["x"; N].join(","), 1, 1),
    ] {
        let error = parse(&text).unwrap_err();
        assert_eq!(
            (error.offset, error.length),
            (offset, length),
            "{}",
            error.message.get(..60).unwrap_or("")
        );
    }
}

/// The rules of precedence in which programs differ.
#[test]
fn signs_and_powers_bind_as_in_mathematics() {
    for (text, value) in [
        ("-x^2", -0.25),
        ("(-x)^2", 0.25),
        ("2^3^2", 512.0),
        ("(2^3)^2", 64.0),
        ("-2^-2", -0.25),
        ("2^-x^2", 2f64.powf(-0.25)),
        ("--x", 0.5),
        ("2*-x^2", -0.5),
        ("-x*y", 1.0),
        ("1-2-3", -4.0),
        ("16/4/2", 2.0),
    ] {
        assert_eq!(parse(text).unwrap().evaluate(&PLACES[0]), value, "{text}");
        assert_eq!(meaning::value(text, &PLACES[0]), Some(value), "{text}");
    }
}
