//! `mpm report`: an HTML page about results.

use std::path::PathBuf;

use crate::appendix::{self, FieldChoice, Options, StepChoice, Units};
use crate::program::commands::analysis::start_threads;
use crate::program::commands::newest::named_or_newest;
use crate::program::commands::overwriting::{REPORT, may_be_replaced};
use crate::program::exit::DONE;
use anyhow::bail;
use clap::Args;

/// Arguments of `mpm report`.
#[derive(Args)]
pub struct ReportArgs {
    /// Results directories; if several are given, they are compared [default: the newest results].
    #[arg(value_name = "DIR")]
    directories: Vec<PathBuf>,
    /// Page to write [default: DIR/report.html; comparison.html for several directories].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Field that colours the points, or a component such as cauchy_stress:XX; may be given several times [default:
    /// von_mises_stress, or another field if the run did not write it].
    #[arg(long, value_name = "NAME[:COMPONENT]")]
    field: Vec<FieldChoice>,
    /// Load steps at which the points are shown: each a step number, or first, middle or last.
    #[arg(long, value_name = "STEP,...", value_delimiter = ',', default_value = "first,middle,last")]
    steps: Vec<StepChoice>,
    /// Units of length, force and time in the decks, for example m,kN,s.
    #[arg(long, value_name = "LENGTH,FORCE,TIME")]
    units: Option<Units>,
}

/// Writes the page.
pub fn report(args: ReportArgs) -> anyhow::Result<u8> {
    start_threads(None)?;
    let mut args = args;
    if args.directories.is_empty() {
        args.directories.push(named_or_newest(None)?);
    }
    let options = Options { fields: args.field, steps: args.steps, units: args.units };
    let page = appendix::report(&args.directories, &options)?;
    let path = args.out.unwrap_or_else(|| match &args.directories[..] {
        [directory] => directory.join("report.html"),
        _ => PathBuf::from("comparison.html"),
    });
    if !may_be_replaced(&path, REPORT) {
        bail!("`{}` exists, but is not an mpm report; choose another name with `--out`", path.display());
    }
    appendix::write(&path, &page)?;
    message!("the report is {}", path.display());
    Ok(DONE)
}
