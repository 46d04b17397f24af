//! `mpm`: arguments, messages and exit codes. Everything else is in the library.

#[macro_use]
mod tell;
mod analysis;
mod closing;
mod explain;
mod interrupt;
mod last_words;
mod log;
mod manual;
mod new;
mod progress;
mod quantities;
mod report;
mod resume;
mod run;
mod status;
mod sweep;

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use mpm::deck::schema::deck_schema;

/// The analysis failed.
const FAILED: u8 = 1;
/// The deck or the command line is wrong.
const USAGE: u8 = 2;
/// The user stopped the run.
const INTERRUPTED: u8 = 130;

/// Implicit, quasi-static, finite-deformation material point method.
#[derive(Parser)]
#[command(version, about, max_term_width = 100, after_help = FIRST_RUN)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const FIRST_RUN: &str = "\
First run:
  mpm new beam         writes beam.yaml, a deck with comments
  mpm run beam.yaml    leaves results in results/beam
then open results/beam/domains.pvd in ParaView. `mpm new` lists more decks to start from.

Exit codes: 0 done, 1 the analysis failed, 2 the deck or command line is wrong, 130 interrupted.";

#[derive(Subcommand)]
enum Command {
    /// Write a deck to start from, or list what there is.
    New(new::NewArgs),
    /// Do everything up to the first load step and report.
    Check {
        #[command(flatten)]
        deck: DeckArgs,
    },
    /// Run the analysis of a deck.
    Run(run::RunArgs),
    /// Tell how far a run is, from another shell.
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

#[derive(Args)]
struct DeckArgs {
    /// The deck, a YAML file.
    deck: PathBuf,
    /// Set a parameter of the deck, as often as needed.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// How messages about the deck are written.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    format: Format,
    /// Take warnings about the deck for errors.
    #[arg(long, visible_alias = "warnings-as-errors")]
    deny_warnings: bool,
}

/// For whom something is written.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Text for people.
    Text,
    /// One JSON document for programs, to standard output.
    Json,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE, for example h=0.25".to_owned()),
    }
}

fn main() -> ExitCode {
    let began = Instant::now();
    let result = last_words::limits_are_errors().and_then(|()| run_command(began));
    result.unwrap_or_else(|error| {
        tell!("{}", as_error(&error));
        ExitCode::from(USAGE)
    })
}

fn run_command(began: Instant) -> anyhow::Result<ExitCode> {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(error) => return refuse(&error),
    };
    match command {
        Command::New(args) => new::new(&args),
        Command::Check { deck } => run::check(&deck),
        Command::Run(args) => run::run(args, began),
        Command::Status(args) => status::status(&args),
        Command::Sweep(args) => sweep::sweep(args),
        Command::Report(args) => report::report(args),
        Command::Explain { code } => explain::explain(code.as_deref()),
        Command::Schema => print_json(&deck_schema()),
        Command::Completions { shell } => manual::completions(shell),
        Command::Man { command } => manual::man(command.as_deref()),
    }
}

/// Says what is wrong with the command line, or gives the help that was asked for.
fn refuse(error: &clap::Error) -> anyhow::Result<ExitCode> {
    if !error.use_stderr() {
        return print(&error.render().to_string());
    }
    // The arguments are part of the message.
    let plain = error.render().to_string();
    if tell::clean(&plain) == plain {
        let _ = error.print();
    } else {
        tell!("{}", plain.trim_end());
    }
    Ok(ExitCode::from(USAGE))
}

/// An error that has a page, [`mpm::codes`].
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
struct Coded {
    code: &'static str,
    reason: String,
}

impl Coded {
    fn new(code: &'static str, reason: String) -> Coded {
        Coded { code, reason }
    }
}

/// An error with its causes.
fn in_words(error: &anyhow::Error) -> String {
    format!("{error:#}")
}

/// An error as it is printed, with its code if it has one.
fn as_error(error: &anyhow::Error) -> String {
    let code = error.downcast_ref::<Coded>().map(|coded| format!("[{}]", coded.code)).unwrap_or_default();
    format!("error{code}: {}", in_words(error))
}

/// A JSON document as text.
fn json_text(document: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

/// Writes a JSON document to standard output.
fn print_json(document: &impl serde::Serialize) -> anyhow::Result<ExitCode> {
    // Programs read it, and they need every character.
    write_out(&json_text(document)?)
}

/// Writes a text to standard output without control characters; a reader that has gone away is no error.
fn print(text: &str) -> anyhow::Result<ExitCode> {
    write_out(&tell::clean(text))
}

fn write_out(text: &str) -> anyhow::Result<ExitCode> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}
