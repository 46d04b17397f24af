//! The program `mpm`: arguments, messages and exit codes. Only this module prints, sets up threads and signal handlers
//! for the whole process, or ends the process (after a second Ctrl-C, or when memory runs out).

#[macro_use]
mod screen;
mod cli;
mod commands;
mod exit;
mod heap;
mod interrupt;
mod machines;
mod paths;
mod system_limits;

use std::ffi::OsString;
use std::time::Instant;

use crate::deck::schema::deck_schema;
use clap::Parser;

pub use heap::Heap;

use cli::{Cli, Command};
use commands::{converge, element, explain, manual, new, picture, plan, report, run, status, sweep};
use exit::USAGE;
use screen::failure::as_error;
use screen::message;
use screen::print::{print, print_json};

/// Runs the program once in this process and returns its exit code; `arguments` begins with the program name.
pub fn main(arguments: &[OsString]) -> u8 {
    let began = Instant::now();
    let result = system_limits::limits_are_errors().and_then(|()| run_command(arguments, began));
    result.unwrap_or_else(|error| {
        message!("{}", as_error(&error));
        USAGE
    })
}

fn run_command(arguments: &[OsString], began: Instant) -> anyhow::Result<u8> {
    let command = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli.command,
        Err(error) => return refuse(&error),
    };
    match command {
        Command::New(args) => new::new(&args),
        Command::Check { deck, ranks: None } => run::check(&deck),
        Command::Check { deck, ranks: Some(ranks) } => plan::plan(&deck, ranks as usize),
        Command::Run(args) => run::run(args, arguments, began),
        Command::Status(args) => status::status(&args),
        Command::Sweep(args) => sweep::sweep(args),
        Command::Converge(args) => converge::converge(args),
        Command::Report(args) => report::report(args),
        Command::Picture(args) => picture::picture(&args),
        Command::Element(args) => element::element(args),
        Command::Explain { code } => explain::explain(code.as_deref()),
        Command::Schema => print_json(&deck_schema()),
        Command::Completions { shell } => manual::completions(shell),
        Command::Man { command } => manual::man(command.as_deref()),
    }
}

/// Reports an error in the command line, or prints the help that was requested.
fn refuse(error: &clap::Error) -> anyhow::Result<u8> {
    if !error.use_stderr() {
        return print(&error.render().to_string());
    }
    // The message quotes the arguments, which may contain control characters.
    let plain = error.render().to_string();
    if message::clean(&plain) == plain {
        let _ = error.print();
    } else {
        message!("{}", plain.trim_end());
    }
    Ok(USAGE)
}
