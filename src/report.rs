//! `mpm report`: a page of HTML about results.

use std::fs::File;
use std::io::Read;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use mpm::appendix::{self, FieldChoice, Options, StepChoice, Units};

/// Bytes at the beginning of a page that all pages share.
const FIRST: u64 = 15;

/// Arguments of `mpm report`.
#[derive(Args)]
pub struct ReportArgs {
    /// Directories of results; several are compared.
    #[arg(required = true, value_name = "DIR")]
    directories: Vec<PathBuf>,
    /// The page [default: DIR/report.html; comparison.html for several directories].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Field that the points are coloured by, as often as needed; cauchy_stress:XX is a component [default:
    /// von_mises_stress, or another field if the run did not write that].
    #[arg(long, value_name = "NAME[:COMPONENT]")]
    field: Vec<FieldChoice>,
    /// Load steps that the points are shown at: numbers, first, middle, last.
    #[arg(long, value_name = "STEP,...", value_delimiter = ',', default_value = "first,middle,last")]
    steps: Vec<StepChoice>,
    /// Units of length, force and time in the decks, for example m,kN,s.
    #[arg(long, value_name = "LENGTH,FORCE,TIME")]
    units: Option<Units>,
}

/// Writes the page.
pub fn report(args: ReportArgs) -> anyhow::Result<ExitCode> {
    let options = Options { fields: args.field, steps: args.steps, units: args.units };
    let page = appendix::report(&args.directories, &options)?;
    let path = args.out.unwrap_or_else(|| match &args.directories[..] {
        [directory] => directory.join("report.html"),
        _ => PathBuf::from("comparison.html"),
    });
    let mut first = Vec::new();
    // What cannot be read is found out by writing.
    let _ = File::open(&path).and_then(|file| file.take(FIRST).read_to_end(&mut first));
    if !first.is_empty() && !page.as_bytes().starts_with(&first) {
        bail!("`{}` exists and is no report of mpm; choose another name with `--out`", path.display());
    }
    appendix::write(&path, &page)?;
    tell!("the report is {}", path.display());
    Ok(ExitCode::SUCCESS)
}
