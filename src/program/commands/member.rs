//! One run of a study: a deck, from its text to the results of the run.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::deck::load::load_text;
use crate::deck::quoting::counted;
use crate::deck::refinement::DeckText;
use crate::output::summary::Start;
use crate::program::commands::analysis::{
    Begin, Ended, Run, describe_failure, messages, prepare, print_messages, run_into,
};
use crate::program::commands::arguments::LibraryArgs;
use crate::program::machines::Machines;
use crate::program::screen::failure::{as_error, in_words};
use crate::program::screen::progress::View;
use crate::ranks::Ranks;
use crate::solver::{Reached, SolveError};
use crate::study::{Outcome, Record};
use crate::timing::{Phase, Timings};

/// How the members of a study are run.
pub struct Members {
    /// True if members with warnings are not run.
    pub deny_warnings: bool,
    /// Consent to code of libraries.
    pub libraries: LibraryArgs,
    /// Flag that ends the run when set.
    pub stop: Arc<AtomicBool>,
    /// State in which members start.
    pub begin: Begin,
    /// Messages about the deck that were already printed.
    pub printed: BTreeSet<String>,
    /// True if warnings about the deck are printed.
    pub speaks: bool,
}

impl Members {
    /// The results of an earlier run in a directory, if it has completed the same deck with the same version of the
    /// program.
    pub fn completed(deck: &DeckText, directory: &Path) -> Option<Record> {
        let loaded = load_text(&deck.name, &deck.text, &deck.overrides).ok()?;
        let record = Record::read(directory).ok()?;
        record.completes(&loaded).then_some(record)
    }

    /// Runs a deck into a directory. Messages begin with `label`.
    pub fn run(&mut self, deck: &DeckText, directory: &Path, label: String) -> (Outcome, Option<Record>) {
        let (start, mut set_up) = (Start::now(), Timings::default());
        let prepared = set_up.measure(Phase::SetUp, || {
            let mut loaded = load_text(&deck.name, &deck.text, &deck.overrides);
            if let Ok(loaded) = &mut loaded {
                self.libraries.allow(loaded);
            }
            prepare(loaded, self.deny_warnings, &Ranks::default())
        });
        let messages = messages(&prepared, false);
        // Warnings are the same for many members and are printed once; errors are printed for each member.
        let is_new = !messages.is_empty() && self.printed.insert(messages);
        if prepared.is_err() || self.speaks && is_new {
            print_messages(&prepared);
        }
        let ready = match prepared {
            Ok(ready) => ready,
            Err(failure) => {
                message!("  invalid");
                return (Outcome::Invalid(failure.in_one_line()), None);
            }
        };
        let run = Run {
            directory,
            start,
            view: View::Member(label),
            stop: &self.stop,
            begin: self.begin,
            machines: &Machines::alone(),
        };
        let ended = run_into(run, ready, set_up);
        let record = ended.as_ref().ok().and_then(|_| Record::read(directory).ok());
        let outcome = match ended {
            Err(error) => {
                message!("{}", as_error(&error));
                Outcome::Failed(in_words(&error))
            }
            Ok(None) => Outcome::Completed,
            Ok(Some(Ended { outcome, .. })) => conclude(outcome, start),
        };
        if matches!(outcome, Outcome::Failed(_)) {
            message!("  failed");
        }
        (outcome, record)
    }
}

/// Prints how a run ended.
fn conclude(outcome: Result<Reached, SolveError>, start: Start) -> Outcome {
    match outcome {
        Ok(Reached { progress, summary }) => {
            message!(
                "  completed: {} in equilibrium, {}, {:.1} s",
                counted(summary.steps, "step", "steps"),
                counted(summary.evaluations, "evaluation", "evaluations"),
                start.elapsed().wall.as_secs_f64()
            );
            if let Some(bracket) = progress.last_strength() {
                message!("  factor of safety {bracket}");
            }
            Outcome::Completed
        }
        Err(SolveError::Interrupted { step }) => {
            match step {
                0 | 1 => message!("  interrupted before the first step was in equilibrium"),
                _ => message!("  interrupted: all steps before step {step} are in equilibrium"),
            }
            Outcome::Interrupted
        }
        Err(error) => {
            message!("{}", describe_failure(&error));
            Outcome::Failed(error.to_string())
        }
    }
}
