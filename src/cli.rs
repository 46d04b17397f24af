//! The command line.

use clap::{Parser, Subcommand};
use clap_complete::Shell;

use crate::commands::arguments::DeckArgs;
use crate::commands::{new, report, run, status, sweep};

/// Implicit, quasi-static, finite-deformation material point method.
#[derive(Parser)]
#[command(version, about, max_term_width = 100, after_help = FIRST_RUN)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

pub const FIRST_RUN: &str = "\
First run:
  mpm new beam         writes beam.yaml, a deck with comments
  mpm run beam.yaml    leaves results in results/beam
then open results/beam/domains.pvd in ParaView. `mpm new` lists more decks to start from.

Exit codes: 0 done, 1 the analysis failed, 2 the deck or command line is wrong, 130 interrupted.";

#[derive(Subcommand)]
pub enum Command {
    /// Write a deck to start from, or list what there is.
    New(new::NewArgs),
    /// Check a deck: do everything up to the first load step.
    Check {
        #[command(flatten)]
        deck: DeckArgs,
    },
    /// Run the analysis of a deck.
    Run(run::RunArgs),
    /// Show the progress of a run, from another shell.
    ///
    /// The exit code is that of the run: 0 completed, 1 failed or died, 130 interrupted; and 3 while it goes on, 2
    /// where there is no run.
    Status(status::StatusArgs),
    /// Run a deck for every combination of lists of values of its parameters.
    Sweep(sweep::SweepArgs),
    /// Write a report on results as one page of HTML; several results are compared.
    Report(report::ReportArgs),
    /// Explain a message by its code, such as D014, or list all codes.
    Explain {
        /// The code; all are listed where none is given.
        code: Option<String>,
    },
    /// Print the JSON schema of decks.
    Schema,
    /// Print a script that completes commands and options in a shell.
    ///
    /// For bash: mpm completions bash > ~/.local/share/bash-completion/completions/mpm
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Print a manual page.
    ///
    /// For example: mpm man > ~/.local/share/man/man1/mpm.1
    Man {
        /// A command; the page of the program where none is given.
        command: Option<String>,
    },
}
