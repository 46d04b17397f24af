//! Arguments that several commands share.

use std::path::PathBuf;

use crate::deck::load::{LoadFailure, LoadedDeck, load};
use crate::deck::may_run_libraries;
use clap::{Args, ValueEnum};

#[derive(Args)]
pub struct DeckArgs {
    /// The deck, a YAML file.
    pub deck: PathBuf,
    /// Set a parameter of the deck; may be given several times.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    /// Format of messages about the deck.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub format: Format,
    /// Treat warnings about the deck as errors.
    #[arg(long, visible_alias = "warnings-as-errors")]
    pub deny_warnings: bool,
    #[command(flatten)]
    pub libraries: LibraryArgs,
}

/// Consent to code that a deck brings along.
#[derive(Args, Clone, Copy)]
pub struct LibraryArgs {
    /// Load the libraries that the deck names (`model: library`): their code runs as part of the program, so allow only
    /// those that you trust. MPM_ALLOW_LIBRARIES=1 in the environment has the same meaning.
    #[arg(long)]
    pub allow_libraries: bool,
}

impl LibraryArgs {
    /// Passes the consent on to a deck.
    pub fn allow(self, loaded: &mut LoadedDeck) {
        loaded.allows_libraries = may_run_libraries(self.allow_libraries);
    }
}

impl DeckArgs {
    /// Reads the deck.
    ///
    /// # Errors
    /// All faults that can be found, each with its location.
    pub fn load(&self) -> Result<LoadedDeck, Box<LoadFailure>> {
        let mut loaded = load(&self.deck, &self.set)?;
        self.libraries.allow(&mut loaded);
        Ok(loaded)
    }
}

/// Format of output.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text for people.
    Text,
    /// One JSON document on standard output, for programs.
    Json,
}

/// Reads NAME=VALUE.
pub fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE, for example h=0.25".to_owned()),
    }
}
