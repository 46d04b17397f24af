//! Damaged checkpoints pass through everything that `mpm run --resume` does, including a load step and the files.
//!
//! The checksum detects the damage in a minority of the cases only. In most cases the checksum is recomputed, or the
//! damage is done inside the compressed blocks, so that the damage reaches later checks.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use mpm::deck::Deck;
use mpm::deck::advice::Means;
use mpm::deck::changes::{changes, step_at};
use mpm::deck::load::{LoadedDeck, load_text};
use mpm::deck::ready::{Analysis, ready};
use mpm::output::checkpoint;
use mpm::output::lock::Lock;
use mpm::output::results::{Request, Results};
use mpm::output::summary::{Account, Start};
use mpm::points::{FieldKind, PointFieldSpec, Points};
use mpm::solver::Reached;
use mpm::timing::Timings;

use super::damage::damage;
use crate::harness::Bench;
use crate::random::Random;

fn no_output() -> Request {
    Request { every: 0, checkpoints: Some(1), ..Request::default() }
}

/// Small analyses of two load steps, all with a law that has a history.
const DECKS: [&str; 3] = [
    "grid: {type: structured, origin: [0, 0], size: [4, 3], spacing: 1}
bodies:
  - {name: a, material: m, shape: {type: box, min: [0, 0], max: [2, 2]}, method: gimp, points_per_cell: 2}
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}, {name: left, nodes: {x: 0}, fix: [x]}]
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
output: {every: 0}
",
    "grid: {type: structured, origin: [0, 0], size: [4, 3], spacing: 1}
bodies:
  - {name: a, material: m, shape: {type: box, min: [1, 0], max: [2, 2]}, method: cpdi2, points_per_cell: 2}
  - {name: b, material: e, shape: {type: box, min: [2, 0], max: [3, 1]}, method: mpm, points_per_cell: 2}
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: weight, type: gravity, acceleration: [1, -10], curve: [[0, 0], [0.5, 0.5], [1, 0.8]]}]
output: {every: 0, probes: [{name: top, body: a, nearest: [1.9, 2]}]}
",
    "analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 2], spacing: 1}
bodies:
  - {name: a, material: m, shape: {type: box, min: [0, 0, 0], max: [1, 1, 1]}, method: cpdi2, points_per_cell: 2}
boundary_conditions: [{name: base, nodes: {z: 0}, fix: [x, y, z]}]
loads: [{name: weight, type: gravity, acceleration: [1, 0, -10]}]
output: {every: 0}
",
];
const SHARED: &str = "version: 1
materials:
  m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 3e3, density: 100}
  e: {model: hencky, young: 1e6, poisson: 0.3, density: 100}
steps: {count: 2}
checkpoint: {every: 1}
";

/// Bytes before the first block: the line with the version of the format.
const LINE: usize = "mpm checkpoint 6\n".len();

/// The points of a model as they are built.
enum Fresh {
    Plane(Points<2>),
    Solid(Points<3>),
}

/// An analysis that has written a checkpoint after its first step.
struct Origin {
    loaded: LoadedDeck,
    analysis: Analysis,
    fresh: Fresh,
    directory: PathBuf,
    /// The tables of its results: resuming cuts them at the step of the checkpoint.
    tables: Vec<(PathBuf, Vec<u8>)>,
    bytes: Vec<u8>,
}

fn account(loaded: &LoadedDeck) -> Account {
    Account {
        start: Start::now(),
        deck_file: loaded.source.name().to_owned(),
        deck_text: loaded.source.text().to_owned(),
        deck_hash: loaded.hash(),
        deck: Some(serde_json::to_value(&loaded.deck).unwrap()),
        files_hash: loaded.hash_of_files(),
        law_libraries: Vec::new(),
        parameters: BTreeMap::new(),
        units: None,
        messages: Vec::new(),
        set_up: Timings::default(),
        threads: 1,
        wording: std::sync::Arc::new(Means::default()),
    }
}

/// Declares fields of every kind that only these points have.
fn declare_fields(points: &mut Points<2>) {
    for (name, kind, components) in
        [("a", FieldKind::Fixed, 6), ("b", FieldKind::Motion, 1), ("c", FieldKind::Answer, 2)]
    {
        let (name, unit, start) = (name.to_owned(), "-".to_owned(), vec![0.5; components * points.len()]);
        points.declare(PointFieldSpec { name, unit, components, kind, start }).unwrap();
    }
}

impl Origin {
    fn new(text: &str, directory: PathBuf) -> Origin {
        let deck = format!("{SHARED}{text}");
        let loaded = load_text("deck", deck.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
        let mut analysis = ready(&loaded, None).unwrap().analysis;
        if let Analysis::Plane(parts) = &mut analysis {
            declare_fields(&mut parts.1);
        }
        let fresh = match &analysis {
            Analysis::Plane(parts) => Fresh::Plane(parts.1.clone()),
            Analysis::Solid(parts) => Fresh::Solid(parts.1.clone()),
        };
        let mut results = match &analysis {
            Analysis::Plane(parts) => Results::create(&directory, &no_output(), &parts.0, account(&loaded)),
            Analysis::Solid(parts) => Results::create(&directory, &no_output(), &parts.0, account(&loaded)),
        }
        .unwrap();
        let nothing = analysis.beginning();
        analysis.run(nothing, &mut results).unwrap_or_else(|error| panic!("{error}"));
        let bytes = std::fs::read(directory.join("checkpoint_0001.mpm")).unwrap();
        let tables = ["history.csv", "quality.csv", "convergence.csv"].map(|name| directory.join(name));
        let tables = tables.map(|path| (path.clone(), std::fs::read(path).unwrap())).to_vec();
        Origin { loaded, analysis, fresh, directory, tables, bytes }
    }

    /// Does what the program does with a checkpoint; returns how far it came.
    fn resume(&mut self, path: &Path) -> String {
        let checkpoint = match checkpoint::read(path) {
            Ok(checkpoint) => checkpoint,
            Err(reason) => {
                assert!(!reason.is_empty());
                return "1 refused by the reader".into();
            }
        };
        let step = checkpoint.step();
        let Ok(deck) = Deck::from_value(&checkpoint.head.deck) else {
            return "1 refused by the reader".into();
        };
        if !changes(&deck, &self.loaded.deck, step.end).is_empty() {
            return "2 refused as of another deck".into();
        }
        let Some(index) = step_at([&deck, &self.loaded.deck], step.end, step.index) else {
            return "3 refused as of another step".into();
        };
        let restored = match (&mut self.analysis, &self.fresh) {
            (Analysis::Plane(parts), Fresh::Plane(fresh)) => {
                parts.1 = fresh.clone();
                checkpoint.restore(&parts.0, &mut parts.1)
            }
            (Analysis::Solid(parts), Fresh::Solid(fresh)) => {
                parts.1 = fresh.clone();
                checkpoint.restore(&parts.0, &mut parts.1)
            }
            _ => unreachable!(),
        };
        if let Err(reason) = restored {
            assert!(!reason.is_empty());
            return "4 refused as not of this analysis".into();
        }
        for (path, content) in &self.tables {
            std::fs::write(path, content).unwrap();
        }
        let mut reached = checkpoint.head.reached.clone();
        reached.progress.step.index = index;
        let (place, account) = (&self.directory, account(&self.loaded));
        let lock = Lock::take(place).unwrap();
        let asked = no_output();
        let results = match &self.analysis {
            Analysis::Plane(parts) => {
                Results::resume(place, lock, &asked, &parts.0, account, &checkpoint, reached.progress.step)
            }
            Analysis::Solid(parts) => {
                Results::resume(place, lock, &asked, &parts.0, account, &checkpoint, reached.progress.step)
            }
        };
        let Ok(mut results) = results else {
            return "5 refused as other than the tables".into();
        };
        match self.analysis.run(reached, &mut results) {
            Ok(Reached { summary, .. }) => {
                assert!(summary.external_work.is_finite());
                "7 went on to the end".into()
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                "6 went on and failed".into()
            }
        }
    }
}

/// The content of the blocks of a checkpoint.
fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let (mut at, mut content) = (LINE, Vec::new());
    loop {
        let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let [raw, packed] = [length(at), length(at + 4)];
        if raw == 0 {
            return content;
        }
        ZlibDecoder::new(&bytes[at + 8..at + 8 + packed]).read_to_end(&mut content).unwrap();
        at += 8 + packed;
    }
}

/// A checkpoint with this content.
fn packed(line: &[u8], content: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(content).unwrap();
    let block = encoder.finish().unwrap();
    let mut bytes = line.to_vec();
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend((block.len() as u32).to_le_bytes());
    bytes.extend(block);
    bytes.extend([0; 8]);
    with_sum(bytes)
}

fn with_sum(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = crc32fast::hash(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// Numbers that an array may be given.
const NUMBERS: [f64; 12] =
    [0.0, -0.0, 1.0, -1.0, 0.5, 3.0, 1e-300, 5e-324, 1e150, -1e300, f64::MAX, f64::INFINITY];

/// Replacements for a number of the summary.
const WORDS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "0.5",
    "1.0",
    "1e308",
    "-1e308",
    "1e-320",
    "255",
    "65536",
    "4294967296",
    "9007199254740993",
    "18446744073709551615",
    "null",
];

/// Changes a number in a JSON text.
fn change_number(text: &mut Vec<u8>, random: &mut Random) {
    let is_number = |b: &u8| b.is_ascii_digit() || b".-+e".contains(b);
    let from = random.below(text.len().max(1)).min(text.len());
    let Some(start) = text[from..].iter().position(u8::is_ascii_digit).map(|p| from + p) else { return };
    let start = text[..start].iter().rposition(|b| !is_number(b)).map_or(0, |p| p + 1);
    let end = text[start..].iter().position(|b| !is_number(b)).map_or(text.len(), |p| start + p);
    text.splice(start..end, random.pick(&WORDS).bytes());
}

/// Damages the content of a checkpoint: its summary, which is text, or its arrays.
fn damage_content(content: &mut Vec<u8>, random: &mut Random) {
    let length = u64::from_le_bytes(content[..8].try_into().unwrap());
    let head = usize::try_from(length).unwrap_or(usize::MAX).saturating_add(8);
    if head > content.len() {
        damage(content, random); // the length was damaged before
    } else if random.chance(0.4) {
        // In the summary; its length is corrected, so that the arrays keep their offsets.
        let mut account = content[8..head].to_vec();
        if random.chance(0.8) {
            change_number(&mut account, random);
        } else {
            damage(&mut account, random);
        }
        let arrays = content.split_off(head);
        content.clear();
        content.extend((account.len() as u64).to_le_bytes());
        content.extend(account);
        content.extend(arrays);
    } else if random.chance(0.7) && content.len() >= head + 16 {
        let place = head + 8 * random.below((content.len() - head) / 8);
        let old = f64::from_le_bytes(content[place..place + 8].try_into().unwrap());
        let new = if random.chance(0.5) {
            *random.pick(&NUMBERS)
        } else {
            old * (1.0 + *random.pick(&[1e-15, 1e-9, 1e-3, 0.1, -0.5, -2.0, 100.0]))
        };
        content[place..place + 8].copy_from_slice(&new.to_le_bytes());
    } else {
        damage(content, random);
    }
}

/// Checkpoints of several analyses; the first byte of a case says which.
pub struct Checkpoints {
    origins: Vec<RefCell<Origin>>,
    file: PathBuf,
}

impl Checkpoints {
    pub fn new() -> Checkpoints {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
            .join(format!("fuzz/checkpoints_{}_{number}", std::process::id()));
        let origin = |k: usize| RefCell::new(Origin::new(DECKS[k], folder.join(format!("origin_{k}"))));
        let origins = (0..DECKS.len()).map(origin).collect();
        Checkpoints { origins, file: folder.join("case.mpm") }
    }
}

impl Drop for Checkpoints {
    fn drop(&mut self) {
        if let Some(folder) = self.file.parent() {
            // Remains of a failing test must not cause a second failure.
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}

impl Bench for Checkpoints {
    const ENDING: &'static str = "mpm";

    fn case(&self, seed: u64) -> Vec<u8> {
        let mut random = Random::new(seed);
        let which = random.below(self.origins.len());
        let mut bytes = self.origins[which].borrow().bytes.clone();
        if random.chance(0.15) {
            damage(&mut bytes, &mut random);
        } else if random.chance(0.2) {
            bytes.truncate(bytes.len() - 4);
            damage(&mut bytes, &mut random);
            bytes = with_sum(bytes);
        } else {
            let mut content = unpacked(&bytes);
            damage_content(&mut content, &mut random);
            while random.chance(0.3) && content.len() > 8 {
                damage_content(&mut content, &mut random);
            }
            bytes = packed(&bytes[..LINE], &content);
        }
        bytes.insert(0, which as u8);
        bytes
    }

    fn run(&self, content: &[u8]) -> String {
        std::fs::write(&self.file, &content[1..]).unwrap();
        self.origins[usize::from(content[0])].borrow_mut().resume(&self.file)
    }
}

/// Undamaged checkpoints resume to the end, even if they are packed again: the cases above differ from them only in
/// their damage.
#[test]
fn undamaged_checkpoints_resume() {
    let bench = Checkpoints::new();
    for (which, origin) in bench.origins.iter().enumerate() {
        let bytes = origin.borrow().bytes.clone();
        let again = packed(&bytes[..LINE], &unpacked(&bytes));
        for bytes in [bytes, again] {
            let case = [&[which as u8][..], &bytes].concat();
            assert_eq!(bench.run(&case), "7 went on to the end");
        }
    }
}
