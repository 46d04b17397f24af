//! `mpm completions` and `mpm man`: completion scripts and manual pages.

use anyhow::Context;
use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;

use crate::program::cli::Cli;
use crate::program::screen::print::print;

/// Prints a completion script.
pub fn completions(shell: Shell) -> anyhow::Result<u8> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "mpm", &mut script);
    print(&String::from_utf8(script)?)
}

/// Prints the manual page of the program or of one of its commands.
pub fn man(name: Option<&str>) -> anyhow::Result<u8> {
    let mut program = Cli::command();
    // Completes the definition, for example with the names of commands in the synopsis.
    program.build();
    let command: Command = match name {
        None => program,
        Some(name) => program
            .find_subcommand(name)
            .with_context(|| format!("there is no command `{name}`; `mpm --help` lists all commands"))?
            .clone(),
    };
    let mut page = Vec::new();
    Man::new(command).render(&mut page)?;
    print(&String::from_utf8(page)?)
}
