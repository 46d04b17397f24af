//! A program that runs a deck with a constitutive law of its own, and writes the same files as `mpm run`.
//!
//! ```sh
//! cargo run -p own-law -- examples/own_law_crate/press.yaml results/press
//! ```
#![allow(clippy::print_stdout, reason = "a program")]

mod hyperbolic;

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use mpm::deck::Parameter;
use mpm::deck::load::{LoadedDeck, OwnLaw, load};
use mpm::deck::ready::{Analysis, Prepared, prepare};
use mpm::memory::Memory;
use mpm::output::results::Results;
use mpm::output::summary::Start;
use mpm::solver::Summary;
use mpm::timing::Timings;

use hyperbolic::Hyperbolic;

/// Name of the material that has the law.
const MATERIAL: &str = "sand";

/// The law with parameters from the deck.
fn law(loaded: &LoadedDeck) -> Result<Hyperbolic, String> {
    let number = |name: &str| match loaded.parameters.get(name) {
        Some(Parameter::Number(value)) if *value > 0.0 => Ok(*value),
        _ => Err(format!("the deck needs a parameter `{name}` above 0")),
    };
    Ok(Hyperbolic { bulk: number("bulk")?, shear: number("shear")?, softening: number("softening")? })
}

/// Runs a deck and writes its results to a directory.
fn run(deck: &Path, directory: &Path) -> Result<Summary, Box<dyn Error>> {
    let start = Start::at(Instant::now());
    let mut loaded = load(deck, &[])?;
    let law = law(&loaded)?;
    loaded.laws.insert(MATERIAL.to_owned(), OwnLaw(Arc::new(move || Box::new(law))));
    let Prepared { loaded, mut analysis, .. } = prepare(loaded, Memory::this_machine(), false)?;
    let threads = std::thread::available_parallelism()?.get();
    let account = loaded.account(start, Timings::default(), threads)?;
    let request = loaded.deck.request();
    let mut results = match &analysis {
        Analysis::Plane(parts) => Results::create(directory, &request, &parts.0, account)?,
        Analysis::Solid(parts) => Results::create(directory, &request, &parts.0, account)?,
    };
    let beginning = analysis.beginning();
    Ok(analysis.run(beginning, &mut results)?.summary)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(deck), Some(directory)) = (arguments.next(), arguments.next()) else {
        return Err("give a deck and a directory for the results".into());
    };
    let summary = run(Path::new(&deck), Path::new(&directory))?;
    println!("{} steps in equilibrium, results in {directory}", summary.steps);
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;
    use mpm::material::conformance::check;

    const SAND: Hyperbolic = Hyperbolic { bulk: 10e6, shear: 6e6, softening: 100.0 };

    #[test]
    fn the_law_has_the_properties_on_which_the_solver_relies() {
        assert_eq!(check(&SAND, 0.1), []);
    }

    /// The strain is uniform: ε_yy = ln 0.9, the other components are zero. The press carries τ_yy/J on its unit width.
    #[test]
    fn the_press_carries_the_stress_of_the_law() {
        let folder = std::env::temp_dir().join(format!("own-law-{}", std::process::id()));
        let deck = Path::new(env!("CARGO_MANIFEST_DIR")).join("press.yaml");
        let summary = run(&deck, &folder).unwrap();
        assert_eq!(summary.steps, 10);
        let text = std::fs::read_to_string(folder.join("history.csv")).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let column = lines.next().unwrap().iter().position(|name| *name == "press_ry").unwrap();
        let reaction: f64 = lines.next_back().unwrap()[column].parse().unwrap();
        let strain = 0.9f64.ln();
        let norm = (2.0f64 / 3.0).sqrt() * strain.abs();
        let shear = SAND.shear / (1.0 + SAND.softening * norm);
        let expected = (SAND.bulk * strain + 2.0 * shear * 2.0 / 3.0 * strain) / 0.9;
        assert!((reaction / expected - 1.0).abs() < 1e-9, "{reaction} is not {expected}");
    }
}
