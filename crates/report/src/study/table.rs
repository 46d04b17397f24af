//! The table of a study, one row per member.

use std::collections::BTreeMap;
use std::io::{self, BufRead};
use std::path::Path;

use mpm_core::input_file;
use mpm_files::replace::replace_file;
use mpm_files::table::quoted;

use super::record::{FACTORS, MEASURES};
use super::{Member, Record, Study};

/// Outcome of a member of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All steps are in equilibrium.
    Completed,
    /// The run failed, with the reason.
    Failed(String),
    /// The user stopped the run.
    Interrupted,
    /// The deck cannot be used with these values, with the reason.
    Invalid(String),
}

impl Outcome {
    /// Name of the outcome in the table.
    pub fn word(&self) -> &'static str {
        match self {
            Outcome::Completed => "completed",
            Outcome::Failed(_) => "failed",
            Outcome::Interrupted => "interrupted",
            Outcome::Invalid(_) => "invalid",
        }
    }

    fn reason(&self) -> &str {
        match self {
            Outcome::Completed | Outcome::Interrupted => "",
            Outcome::Failed(reason) | Outcome::Invalid(reason) => reason,
        }
    }
}

/// A row of the table: the results of a member.
#[derive(Debug, Clone)]
pub struct Row {
    /// The member.
    pub member: Member,
    /// Outcome of the member.
    pub outcome: Outcome,
    /// Results of the member, if it was started.
    pub record: Option<Record>,
}

/// Writes the table of a study, in the order of `rows`. Its columns are the varied parameters, the outcome, the
/// measures, the strength reduction factors if any member has them, the extents of the bodies, the final values of
/// the columns of `history.csv` that all members with results have, and the reason for a failure. An entry is empty if
/// a member has no such value.
///
/// # Errors
/// A file-system error; the file is then left as it was.
pub fn write_table<'a>(
    path: &Path,
    study: &Study,
    rows: impl IntoIterator<Item = &'a Row>,
) -> io::Result<()> {
    let rows: Vec<&Row> = rows.into_iter().collect();
    let records: Vec<&Record> = rows.iter().filter_map(|row| row.record.as_ref()).collect();
    let extents = extent_columns(&records);
    let history = common_history(&records);

    let mut results = vec!["outcome"];
    results.extend(MEASURES.map(|(name, _)| name));
    let reduces = records.iter().any(|record| record.strength().is_some());
    results.extend(FACTORS.into_iter().filter(|_| reduces));
    results.extend(extents.iter().chain(&history).map(String::as_str));
    results.push("reason");
    let mut columns = headings(&study.names().collect::<Vec<_>>(), &results);
    columns.extend(results.into_iter().map(str::to_owned));

    let mut text = line(&columns);
    for row in rows {
        text.push_str(&line(&entries(row, reduces, &extents, &history)));
    }
    replace_file(path, |out| out.write_all(text.as_bytes()))
}

/// True if a path does not exist, or is an empty file or the table of a study.
pub fn may_be_replaced(path: &Path) -> bool {
    let Ok(about) = std::fs::metadata(path) else { return true };
    let header = if about.is_file() { first_record(path).ok() } else { None };
    let Some(header) = header else { return false };
    let has = |name: &str| header.trim_end().split(',').any(|column| column == name);
    header.is_empty() || has("outcome") && header.trim_end().ends_with(",reason")
}

/// The first record of a table: its first line, or several lines if a quoted entry contains line breaks.
fn first_record(path: &Path) -> io::Result<String> {
    let mut file = io::BufReader::new(input_file::open(path)?.0);
    let (mut record, mut is_quoted) = (String::new(), false);
    loop {
        let line = record.len();
        let is_end = file.read_line(&mut record)? == 0;
        is_quoted ^= record[line..].matches('"').count() % 2 == 1;
        if is_end || !is_quoted {
            return Ok(record);
        }
    }
}

fn entries(row: &Row, reduces: bool, extents: &[String], history: &[String]) -> Vec<String> {
    let mut entries: Vec<String> = row.member.settings.iter().map(|(_, value)| value.clone()).collect();
    entries.push(row.outcome.word().to_owned());
    match &row.record {
        Some(record) => {
            entries.extend(record.measures());
            entries.extend(record.factors().into_iter().filter(|_| reduces));
            let pairs = record.extents().into_iter().chain(record.history().iter().cloned());
            let mut values: BTreeMap<String, String> = pairs.collect();
            entries.extend(extents.iter().chain(history).map(|name| values.remove(name).unwrap_or_default()));
        }
        None => {
            let factors = if reduces { FACTORS.len() } else { 0 };
            let results = MEASURES.len() + factors + extents.len() + history.len();
            entries.resize(entries.len() + results, String::new());
        }
    }
    entries.push(row.outcome.reason().to_owned());
    entries
}

fn line(fields: &[String]) -> String {
    let fields: Vec<String> = fields.iter().map(|field| quoted(field)).collect();
    fields.join(",") + "\n"
}

/// The headings of the parameters; they must differ from the columns of results, such as `steps`, and from each other.
pub fn headings(parameters: &[&str], results: &[&str]) -> Vec<String> {
    let is_taken = |heading: &str, name: &str| {
        results.contains(&heading) || parameters.iter().any(|other| *other != name && *other == heading)
    };
    let heading = |name: &&str| {
        let mut heading = (*name).to_owned();
        while is_taken(&heading, name) {
            heading = format!("parameter_{heading}");
        }
        heading
    };
    parameters.iter().map(heading).collect()
}

/// The columns of all bodies that appear; their names may depend on the parameters.
fn extent_columns(records: &[&Record]) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for (name, _) in records.iter().flat_map(|record| record.extents()) {
        if !columns.contains(&name) {
            columns.push(name);
        }
    }
    columns
}

fn common_history(records: &[&Record]) -> Vec<String> {
    let Some((first, others)) = records.split_first() else { return Vec::new() };
    let is_common =
        |name: &String| others.iter().all(|record| record.history().iter().any(|(other, _)| other == name));
    first.history().iter().map(|(name, _)| name.clone()).filter(is_common).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_of_parameters_are_unique() {
        let found = headings(&["steps", "h", "parameter_steps"], &["outcome", "steps"]);
        assert_eq!(found, ["parameter_parameter_steps", "h", "parameter_steps"]);
    }
}
