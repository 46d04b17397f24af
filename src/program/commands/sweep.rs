//! `mpm sweep`: runs the members of a parameter study one after another.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use crate::deck::load::{self, load_text};
use crate::deck::refinement::DeckText;
use crate::program::commands::analysis::{self, Begin, not_writable};
use crate::program::commands::arguments::{LibraryArgs, assignment};
use crate::program::commands::member::Members;
use crate::program::exit::{FAILED, INTERRUPTED, USAGE};
use crate::program::interrupt::stop_on_interrupt;
use crate::program::screen::failure::Coded;
use crate::study::{Axis, Member, Outcome, Row, Study, dependence_on_cells, may_be_replaced, write_table};
use anyhow::Context;
use clap::Args;

/// Arguments of `mpm sweep`.
#[derive(Args)]
pub struct SweepArgs {
    /// The deck, a YAML file.
    deck: PathBuf,
    /// Set a parameter of the deck; may be given several times.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// Treat warnings about the deck as errors: members with warnings are not run.
    #[arg(long, visible_alias = "warnings-as-errors")]
    deny_warnings: bool,
    #[command(flatten)]
    libraries: LibraryArgs,
    /// Vary a parameter of the deck; may be given several times, and the parameter given last varies fastest.
    #[arg(long, value_name = "NAME=VALUE,VALUE,...", required = true)]
    over: Vec<Axis>,
    /// Directory for the table and for the results of the members [default: results/<deck name>-sweep].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of threads [default: all cores]. The results are the same for any number.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Resume unfinished members from their last checkpoint; those without one start afresh.
    #[arg(long)]
    resume: bool,
}

/// Runs all members of the study that were not completed earlier.
pub fn sweep(args: SweepArgs) -> anyhow::Result<u8> {
    let study = Study::new(args.over, args.set)?;
    let path = args.deck;
    let name = path.display().to_string();
    let read = load::read(&path).and_then(|text| Ok((load::parameter_names(&name, &text)?, text)));
    let (known, text) = match read {
        Ok(read) => read,
        Err(failure) => {
            message!("{}", failure.render(std::io::stderr().is_terminal()).trim_end());
            return Ok(USAGE);
        }
    };
    study.check_names(&known).map_err(|error| Coded::new("D013", error.to_string()))?;
    analysis::start_threads(args.threads)?;
    let stop = stop_on_interrupt(true)?;
    let directory = args.out.unwrap_or_else(|| {
        let mut name = path.file_stem().unwrap_or_default().to_owned();
        name.push("-sweep");
        Path::new("results").join(name)
    });
    std::fs::create_dir_all(&directory).map_err(|error| not_writable(&directory, error))?;
    let table = directory.join(TABLE);
    if !may_be_replaced(&table) {
        let what = format!(
            "`{}` exists, but is not the table of a study; choose another directory",
            table.display()
        );
        return Err(Coded::new("R001", what).into());
    }
    let begin = if args.resume { Begin::AtCheckpointIfAny } else { Begin::Anew };
    let (deny_warnings, libraries) = (args.deny_warnings, args.libraries);
    let members = Members { deny_warnings, libraries, stop, begin, printed: BTreeSet::new(), speaks: true };
    let mut sweep = Sweep { study, name, text, members, directory, rows: Vec::new() };
    sweep.take_completed();
    sweep.write_table()?;
    Ok(sweep.run_members())
}

/// Name of the table of a study.
const TABLE: &str = "sweep.csv";

/// A study in progress.
struct Sweep {
    study: Study,
    /// Name and text of the deck, which is read once so that all members use the same text.
    name: String,
    text: Vec<u8>,
    /// How the members are run.
    members: Members,
    directory: PathBuf,
    /// Results of the members so far.
    rows: Vec<Option<Row>>,
}

impl Sweep {
    /// Takes over the results of members completed earlier with the same deck and the same version of the program. This
    /// happens before the first run, so that the table never loses rows.
    fn take_completed(&mut self) {
        let taken = |member: Member| {
            let directory = self.directory.join(member.directory_name());
            let record = Members::completed(&self.deck(&member), &directory)?;
            Some(Row { member, outcome: Outcome::Completed, record: Some(record) })
        };
        self.rows = self.study.members().map(taken).collect();
    }

    /// Runs the missing members; returns the exit code.
    fn run_members(&mut self) -> u8 {
        let members: Vec<Member> = self.study.members().collect();
        for (index, member) in members.into_iter().enumerate() {
            let label = format!("member {}/{}", index + 1, self.study.size());
            if self.rows[index].is_some() {
                message!("{label}: {member}: completed earlier");
                continue;
            }
            if self.members.stop.load(Ordering::SeqCst) {
                break;
            }
            message!("{label}: {member}");
            self.rows[index] = Some(self.run_member(member, label));
            if let Err(error) = self.write_table() {
                message!("error: {error:#}");
                return FAILED;
            }
        }
        self.conclude()
    }

    fn run_member(&mut self, member: Member, label: String) -> Row {
        let directory = self.directory.join(member.directory_name());
        let (outcome, record) = self.members.run(&self.deck(&member), &directory, label);
        Row { member, outcome, record }
    }

    /// The deck of a member.
    fn deck(&self, member: &Member) -> DeckText {
        let overrides = self.study.overrides(member);
        DeckText { name: self.name.clone(), text: self.text.clone(), overrides }
    }

    fn write_table(&self) -> anyhow::Result<()> {
        let path = self.directory.join(TABLE);
        write_table(&path, &self.study, self.rows.iter().flatten())
            .with_context(|| format!("the table `{}` cannot be written", path.display()))
    }

    /// Prints the number of members with each outcome; returns the exit code.
    fn conclude(&self) -> u8 {
        let count = |word: &str| self.rows.iter().flatten().filter(|row| row.outcome.word() == word).count();
        let words = ["completed", "failed", "interrupted", "invalid"];
        let mut counts: Vec<String> =
            words.iter().filter(|w| count(w) > 0).map(|w| format!("{} {w}", count(w))).collect();
        let open = self.rows.iter().filter(|row| row.is_none()).count();
        if open > 0 {
            counts.push(format!("{open} not started"));
        }
        let sides = |member: &Member| {
            load_text(&self.name, &self.text, &self.study.overrides(member)).ok()?.cell_sides()
        };
        for sentence in dependence_on_cells(&self.study, self.rows.iter().flatten(), sides) {
            message!("{sentence}");
        }
        message!("{}; the table is {}", counts.join(", "), self.directory.join(TABLE).display());
        if open > 0 || count("interrupted") > 0 {
            INTERRUPTED
        } else if count("failed") > 0 {
            FAILED
        } else if count("invalid") == self.rows.len() {
            USAGE
        } else {
            0
        }
    }
}
