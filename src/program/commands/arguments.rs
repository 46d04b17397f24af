//! Arguments that several commands share.

use std::path::PathBuf;

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
