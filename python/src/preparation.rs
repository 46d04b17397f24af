//! What precedes the first load step of a run or a check: reading the deck, and building its model.

use mpm::deck::load::{LoadedDeck, load_text};
use mpm::deck::may_run_libraries;
use mpm::deck::ready::{self, Prepared};
use mpm::memory::Memory;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::Raised;

/// Largest number of threads.
pub const MAX_THREADS: usize = 1024;

/// The text of a deck.
#[derive(Clone, Copy)]
pub struct DeckText<'a> {
    /// Name of the deck in messages.
    pub name: &'a str,
    /// The text.
    pub text: &'a [u8],
    /// Parameters, each with the value that replaces that of the deck.
    pub overrides: &'a [(String, String)],
    /// True if the caller allows code of the libraries that the deck names to run.
    pub allow_libraries: bool,
}

/// Reads a deck from its text.
pub fn loaded(deck: DeckText) -> Result<LoadedDeck, Raised> {
    let mut loaded = load_text(deck.name, deck.text, deck.overrides).map_err(Raised::Deck)?;
    loaded.allows_libraries = may_run_libraries(deck.allow_libraries);
    Ok(loaded)
}

/// A pool of threads for one run only; by default, one thread per core.
pub fn pool(threads: Option<usize>) -> Result<ThreadPool, Raised> {
    if threads.is_some_and(|n| !(1..=MAX_THREADS).contains(&n)) {
        return Err(Raised::misuse(format!("threads must be a number from 1 to {MAX_THREADS}")));
    }
    let built = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    built.map_err(|error| Raised::misuse(format!("the threads cannot be started: {error}")))
}

/// Prepares the model of a deck for its first load step.
pub fn prepared(loaded: LoadedDeck, pool: &ThreadPool) -> Result<Prepared, Raised> {
    let built = pool.install(|| ready::prepare(loaded, Memory::this_machine(), false));
    built.map_err(Raised::Deck)
}
