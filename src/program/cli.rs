//! The command line.

use clap::{Parser, Subcommand};
use clap_complete::Shell;

use std::sync::OnceLock;

use crate::program::commands::arguments::DeckArgs;
use crate::program::commands::{converge, element, new, picture, report, run, status, sweep};
use crate::program::machines::features;

/// Implicit, finite-deformation material point method, in equilibrium and in motion with inertia.
#[derive(Parser)]
#[command(version, long_version = long_version(), about, max_term_width = 100, after_help = FIRST_RUN)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

/// The version, with the features of this build.
fn long_version() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    TEXT.get_or_init(|| format!("{}\nfeatures: {}", env!("CARGO_PKG_VERSION"), features()))
}

pub const FIRST_RUN: &str = "\
First run:
  mpm new beam         writes beam.yaml, a commented deck
  mpm run beam.yaml    writes the results to results/beam
  mpm report           writes results/beam/report.html, with pictures and curves
  mpm picture          draws results/beam/picture.png (with the Python package)
`mpm new` lists more example decks; ParaView opens results/beam/domains.pvd.

Exit codes: 0 done, 1 the analysis failed, 2 the deck or command line is wrong, 130 interrupted.";

#[derive(Subcommand)]
pub enum Command {
    /// Write an example deck to start from, or list the examples.
    New(new::NewArgs),
    /// Check a deck: do everything up to the first load step.
    Check {
        #[command(flatten)]
        deck: DeckArgs,
        /// Instead, predict memory and time of a run on this number of ranks, without filling the bodies with points.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
        ranks: Option<u32>,
    },
    /// Run the analysis of a deck.
    Run(run::RunArgs),
    /// Show the progress of a run, from another shell.
    ///
    /// The exit code tells the state of the run: 0 completed, 1 failed or died, 130 interrupted, 3 still running; it is
    /// 2 if there is no run.
    Status(status::StatusArgs),
    /// Run a parameter study: a deck for every combination of the listed values.
    Sweep(sweep::SweepArgs),
    /// Run a deck on coarse and fine grids, and state a quantity with an error bar.
    ///
    /// For example: mpm converge bearing.yaml --quantity footing_ry --to 2%
    Converge(converge::ConvergeArgs),
    /// Write a report on the results of a run, or a comparison of several runs, as a single HTML page.
    Report(report::ReportArgs),
    /// Draw the results of a run: the bodies coloured by a field, with tools and surfaces. Needs the Python package.
    ///
    /// For example: mpm picture results/pipe --field displacement --step last --out pipe.png
    #[command(disable_help_flag = true)]
    Picture(picture::PictureArgs),
    /// Drive one material point along a strain or stress path, as in a laboratory test.
    ///
    /// For example: mpm element clay.yaml --material clay --path triaxial-drained --confining 100e3 --to 0.2
    Element(element::ElementArgs),
    /// Explain a message by its code, such as D014, or an example, such as pipe, or list all codes.
    Explain {
        /// The code, or the name that an example refers to; if it is omitted, all codes are listed.
        code: Option<String>,
    },
    /// Print the JSON schema of decks.
    Schema,
    /// Print a script for a shell that completes the commands and options of mpm.
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
        /// The command to describe; if it is omitted, the whole program is described.
        command: Option<String>,
    },
}
