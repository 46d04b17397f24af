//! `mpm`: arguments, messages and exit codes. Everything else is in the library.

#[macro_use]
mod screen;
mod cli;
mod commands;
mod exit;
mod interrupt;
mod system_limits;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use mpm::deck::schema::deck_schema;

use cli::{Cli, Command};
use commands::{explain, manual, new, report, run, status, sweep};
use exit::USAGE;
use screen::failure::as_error;
use screen::message;
use screen::print::{print, print_json};

fn main() -> ExitCode {
    let began = Instant::now();
    let result = system_limits::limits_are_errors().and_then(|()| run_command(began));
    result.unwrap_or_else(|error| {
        message!("{}", as_error(&error));
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

/// Reports an error in the command line, or prints the help that was requested.
fn refuse(error: &clap::Error) -> anyhow::Result<ExitCode> {
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
    Ok(ExitCode::from(USAGE))
}
