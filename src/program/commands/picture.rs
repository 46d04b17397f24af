//! `mpm picture`: pictures are drawn by the Python package, which has a library for them.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::Command;

use crate::program::exit::{DONE, USAGE};
use anyhow::{Context, bail};
use clap::Args;

/// The Python interpreter that runs this program as a part of the Python package; the package sets it.
const INTERPRETER: &str = "MPM_PYTHON";

/// How to get the package that draws.
const HOW: &str = "pictures are drawn by the Python package of mpm with PyVista; in the folder of its source:\n  \
    pip install \".[picture]\"\n  python -m mpm picture";

/// Arguments of `mpm picture`.
#[derive(Args)]
pub struct PictureArgs {
    /// [DIR] [--field NAME] [--step N|last|all] [--warp [FACTOR]] [--out FILE.png|.gif|.mp4]: the results [default: the
    /// newest], the field that colours them, the step (all for a film), whether displacements are exaggerated, and the
    /// file to write.
    #[arg(allow_hyphen_values = true, trailing_var_arg = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

/// Draws with the Python package if this program is a part of it; otherwise says how to get it.
pub fn picture(args: &PictureArgs) -> anyhow::Result<u8> {
    let Some(python) = std::env::var_os(INTERPRETER) else { bail!("{}", how(&args.arguments)) };
    let status = command(&python, &args.arguments).status();
    let status = status.with_context(|| format!("`{}` cannot be run", python.display()))?;
    Ok(if status.success() { DONE } else { USAGE })
}

/// Draws the results in a directory, or says how to; the words go to standard error, and the run keeps its exit code.
pub fn picture_of(directory: &Path) {
    let arguments = [directory.as_os_str().to_owned()];
    let Some(python) = std::env::var_os(INTERPRETER) else {
        message!("{}", how(&arguments));
        return;
    };
    match command(&python, &arguments).output() {
        Ok(output) => {
            let words = [output.stderr, output.stdout].concat();
            message!("{}", String::from_utf8_lossy(&words).trim_end());
        }
        Err(error) => message!("error: `{}` cannot be run: {error}", python.display()),
    }
}

fn how(arguments: &[OsString]) -> String {
    let words: Vec<_> = arguments.iter().map(|word| word.to_string_lossy()).collect();
    format!("{HOW} {}", words.join(" ")).trim_end().to_owned()
}

/// `mpm picture` in a Python interpreter.
fn command(python: &OsStr, arguments: &[OsString]) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "mpm", "picture"]).args(arguments);
    command
}
