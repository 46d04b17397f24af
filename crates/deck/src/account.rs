//! The account of a run that a deck describes.

use std::sync::Arc;

use serde_json::Value;

use super::advice::Means;
use super::diagnostic::Diagnostic;
use super::load::LoadedDeck;
use mpm_core::timing::Timings;
use mpm_files::summary::{Account, DeckMessage, Start};

impl LoadedDeck {
    /// The information about this deck that the result files of a run contain. The run began at `start`; `set_up` is
    /// the time spent so far on reading and building.
    ///
    /// # Errors
    /// If the deck cannot be written as JSON.
    pub fn account(&self, start: Start, set_up: Timings, threads: usize) -> serde_json::Result<Account> {
        let values = self.parameters.iter().map(|(name, value)| (name.clone(), Value::from(value.clone())));
        Ok(Account {
            start,
            deck_file: self.source.name().to_owned(),
            deck_text: self.source.text().to_owned(),
            deck_hash: self.hash(),
            files_hash: self.hash_of_files(),
            law_libraries: self.law_libraries(),
            deck: Some(serde_json::to_value(&self.deck)?),
            parameters: values.collect(),
            units: self.deck.units(),
            messages: self.notes.iter().map(in_files).collect(),
            set_up,
            threads,
            wording: Arc::new(Means::new(&self.deck)),
        })
    }

    /// Makes this deck the deck of an account, in place of the deck with which the run began.
    pub fn restate(&self, account: &mut Account) {
        if let Ok(current) = self.account(account.start, account.set_up.clone(), account.threads) {
            // A run whose account has no deck writes no checkpoints, and continues without them.
            let deck = account.deck.is_some().then_some(current.deck).flatten();
            *account = Account { deck, ..current };
        }
    }
}

/// A message about the deck, in the form that the result files of a run use.
fn in_files(message: &Diagnostic) -> DeckMessage {
    DeckMessage {
        code: message.code.to_owned(),
        severity: message.severity.name().to_owned(),
        message: message.message.clone(),
        help: message.help.clone(),
    }
}
