//! `mpm status`: the progress of a run, from another shell.

use std::io;
use std::path::{Path, PathBuf};

use crate::deck::quoting::counted;
use crate::output::status::{self, State, Status};
use crate::program::commands::arguments::Format;
use crate::program::commands::newest::named_or_newest;
use crate::program::exit::{DONE, FAILED, INTERRUPTED};
use crate::program::screen::print::{print, print_json};
use crate::program::screen::quantities::{bytes, duration, rate, significant};
use anyhow::bail;
use clap::Args;
use jiff::Timestamp;

/// Exit code of `mpm status` for a run that has not ended.
const RUNNING: u8 = 3;

/// Arguments of `mpm status`.
#[derive(Args)]
pub struct StatusArgs {
    /// Results directory of the run [default: the newest results].
    #[arg(value_name = "DIR")]
    directory: Option<PathBuf>,
    /// Output format.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    format: Format,
}

/// Prints the progress of a run; the exit code is the run's own, or 3 if the run has not ended.
pub fn status(args: &StatusArgs) -> anyhow::Result<u8> {
    let directory = &named_or_newest(args.directory.clone())?;
    let status = match status::read(directory) {
        Ok(status) => status,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            bail!("there is no run in `{}`", directory.display())
        }
        Err(error) => bail!("the status of the run in `{}` cannot be read: {error}", directory.display()),
    };
    match args.format {
        Format::Text => print(&in_words(directory, &status))?,
        Format::Json => print_json(&status)?,
    };
    Ok(match status.state {
        State::Completed => DONE,
        State::Running => RUNNING,
        State::Failed | State::Died => FAILED,
        State::Interrupted => INTERRUPTED,
    })
}

fn in_words(directory: &Path, status: &Status) -> String {
    let running = status.state == State::Running;
    let mut rows: Vec<(&str, String)> = Vec::new();
    if !status.title.is_empty() {
        rows.push(("title", status.title.clone()));
    }
    let stage = status.stage.as_ref().map(|name| format!(", stage `{name}`")).unwrap_or_default();
    let steps = match status.steps <= status.steps_requested {
        true => {
            let all = counted(status.steps_requested, "step", "steps");
            format!("{} of {all}{stage}", status.steps)
        }
        false => {
            let steps = counted(status.steps, "step", "steps");
            format!("{steps}{stage}, up to time {}", significant(status.time, 4))
        }
    };
    rows.push(("equilibrium", steps));
    if status.state != State::Completed && status.evaluations > 0 {
        let residual =
            status.residual.map_or_else(|| "not finite".to_owned(), |residual| format!("{residual:.1e}"));
        rows.push((
            "current step",
            format!(
                "{}, iteration {}, residual {residual}, tolerance {:e}",
                status.step, status.iteration, status.tolerance
            ),
        ));
    }
    rows.push(("time", format!("{} of {}", significant(status.time, 6), significant(status.end_time, 6))));
    rows.extend(status.load_factor.map(|factor| ("load factor", significant(factor, 6))));
    rows.extend(
        status.strength_factor.map(|factor| ("strength", format!("divided by {}", significant(factor, 6)))),
    );
    let mut elapsed = duration(status.elapsed_seconds);
    if let Some(left) = status.seconds_left {
        elapsed.push_str(&format!(", about {} left", duration(left)));
    }
    rows.push(("elapsed", elapsed));
    rows.extend(status.points_per_second.map(|per_second| {
        ("rate", format!("{} ({})", rate(per_second), counted(status.points, "point", "points")))
    }));
    if let Some(memory) = status.memory_bytes {
        let peak = status.peak_memory_bytes.map(|peak| format!(", at most {}", bytes(peak)));
        rows.push(("memory", format!("{}{}", bytes(memory), peak.unwrap_or_default())));
    }
    if let Some(size) = status.crawling {
        rows.push(("crawling", format!("steps are 1/{:.0} of the requested size, see W023", 1.0 / size)));
    }
    if status.warnings > 0 {
        rows.push(("warnings", status.warnings.to_string()));
    }
    rows.push(("process", status.process.to_string()));
    // The clock may have been set back; `duration` shows negative times as 0.
    let ago = Timestamp::now().duration_since(status.updated).as_secs_f64();
    let last = if running { "last update" } else { "ended" };
    rows.push((last, format!("{} ago, {}", duration(ago), status.updated)));
    rows.extend(status.reason.as_ref().map(|reason| ("reason", reason.clone())));
    rows.extend(match (status.state, status.checkpoint) {
        (State::Completed, _) | (State::Running, None) => None,
        (State::Running, Some(step)) => Some(("checkpoint", format!("of step {step}"))),
        (_, Some(step)) => {
            let text = format!("of step {step}; `mpm run --resume` continues from there");
            Some(("checkpoint", text))
        }
        (_, None) => Some(("checkpoint", "none: the run has to start over".to_owned())),
    });
    let mut text = format!("{}: {}\n", directory.display(), status.state.word());
    for (label, value) in rows {
        text.push_str(&format!("  {label:<13} {value}\n"));
    }
    text
}
