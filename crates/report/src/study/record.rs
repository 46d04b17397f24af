//! The results of a member of a study.

use std::io;
use std::path::Path;

use serde_json::Value;

use mpm_core::input_file;
use mpm_core::solver::StrengthBracket;
use mpm_deck::load::LoadedDeck;
use mpm_files::shortest;
use mpm_files::summary::VERSION;
use mpm_files::table::Columns;

/// Columns of the table that come from `summary.json`, and their JSON pointers.
pub(super) const MEASURES: [(&str, &str); 7] = [
    ("steps", "/steps"),
    ("evaluations", "/evaluations"),
    ("linear_solves", "/linear_solves"),
    ("points", "/points"),
    ("unknowns", "/unknowns"),
    ("cpu_seconds", "/cpu_seconds/total"),
    ("peak_memory_bytes", "/peak_memory_bytes"),
];

/// Columns of the factors of a strength reduction.
pub(super) const FACTORS: [&str; 3] =
    ["strength_factor_stands", "strength_factor_fails", "strength_factor_slides"];

/// Columns of `history.csv` that describe the step rather than the state it reached.
const STEP_COLUMNS: [&str; 6] = ["step", "time", "iterations", "residual", "linear_iterations", "converged"];

/// The results of a run, read from its directory. The table of a study is made from these results alone, so it does not
/// matter when a member was run.
#[derive(Debug, Clone)]
pub struct Record {
    summary: Value,
    /// The columns of `history.csv` with their last values, except those that describe the step; the values are empty
    /// before the first step.
    history: Vec<(String, String)>,
    /// The same columns with their values of largest magnitude; none before the first step.
    largest: Vec<(String, f64)>,
}

impl Record {
    /// Reads `summary.json` and `history.csv` of a directory.
    ///
    /// # Errors
    /// If one of them is missing or cannot be read.
    pub fn read(directory: &Path) -> io::Result<Record> {
        let summary = serde_json::from_slice(
            &input_file::read(&directory.join("summary.json"), u64::MAX).map_err(io::Error::from)?,
        )?;
        let history =
            Columns::read(&directory.join("history.csv"))?.where_column("converged", |value| value == 1.0);
        Ok(Record { summary, history: last_row(&history), largest: largest_values(&history) })
    }

    /// True if this is a completed run of a deck by this version of the program.
    pub fn completes(&self, loaded: &LoadedDeck) -> bool {
        self.summary["outcome"] == "completed"
            && self.summary["version"] == VERSION
            && self.summary["deck_hash"] == loaded.hash()
    }

    /// Number of converged steps.
    pub fn steps(&self) -> usize {
        self.summary["steps"].as_u64().and_then(|steps| usize::try_from(steps).ok()).unwrap_or(0)
    }

    /// The measures of the run, in the order of [`MEASURES`].
    pub(super) fn measures(&self) -> impl Iterator<Item = String> {
        MEASURES.iter().map(|(_, place)| self.summary.pointer(place).map_or_else(String::new, text_of))
    }

    /// Column names and values of the extents of all bodies, both of their points and of the points' domains.
    pub(super) fn extents(&self) -> Vec<(String, String)> {
        let mut found = Vec::new();
        let Some(bodies) = self.summary["bodies"].as_object() else { return found };
        for (name, body) in bodies {
            for (place, infix) in [("points", ""), ("domain", "domain_")] {
                for bound in ["min", "max"] {
                    let Some(values) = body["extent"][place][bound].as_array() else { continue };
                    for (axis, value) in ["x", "y", "z"].iter().zip(values) {
                        found.push((format!("{name}_extent_{infix}{axis}_{bound}"), text_of(value)));
                    }
                }
            }
        }
        found
    }

    /// The factors of every stage that has reduced the strength, each with the name of the stage.
    pub(super) fn strengths(&self) -> Vec<(Option<String>, StrengthBracket)> {
        let stage_bracket = |value: &Value| {
            let bracket = serde_json::from_value(value.clone()).ok()?;
            Some((value["stage"].as_str().map(str::to_owned), bracket))
        };
        match self.summary["strength_reductions"].as_array() {
            Some(all) => all.iter().filter_map(stage_bracket).collect(),
            None => stage_bracket(&self.summary["strength_reduction"]).into_iter().collect(),
        }
    }

    /// The factors of the last strength reduction with and without equilibrium; `None` if the run reduced no strength.
    pub(super) fn strength(&self) -> Option<StrengthBracket> {
        serde_json::from_value(self.summary.get("strength_reduction")?.clone()).ok()
    }

    /// The values of the columns [`FACTORS`]; an entry is empty if there is no such factor.
    pub(super) fn factors(&self) -> [String; FACTORS.len()] {
        let StrengthBracket { stands, fails, slides, .. } = self.strength().unwrap_or_default();
        [stands, fails, slides.map(|[before, _]| before)]
            .map(|factor| factor.map_or_else(String::new, shortest))
    }

    /// The value of largest magnitude of a column of `history.csv`; `None` if there is no such column or no step.
    pub(super) fn largest(&self, column: &str) -> Option<f64> {
        self.largest.iter().find(|(name, _)| name == column).map(|(_, value)| *value)
    }

    /// The bracket of the limit load of the last stage, if the stage has ended at one.
    pub(super) fn limit_load(&self) -> Option<[f64; 2]> {
        let last = self.summary["limit_loads"].as_array()?.last().filter(|last| last["reached"] == true)?;
        serde_json::from_value(last["bracket"].clone()).ok()
    }

    /// Number of points at the end.
    pub fn points(&self) -> Option<f64> {
        self.summary["points"].as_f64()
    }

    /// CPU time of the run, [second].
    pub fn cpu_seconds(&self) -> f64 {
        self.summary.pointer("/cpu_seconds/total").and_then(Value::as_f64).unwrap_or(0.0)
    }

    /// True if a point has yielded.
    pub fn has_yielded(&self) -> bool {
        self.summary["plastic_work"].as_f64().is_some_and(|work| work != 0.0)
    }

    /// Columns and last values of `history.csv`.
    pub(super) fn history(&self) -> &[(String, String)] {
        &self.history
    }
}

fn text_of(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Number(number) if number.is_f64() => number.as_f64().map_or_else(String::new, shortest),
        other => other.to_string(),
    }
}

/// The columns of a table with the entries of its last row; the entries are empty before the first step.
fn last_row(table: &Columns) -> Vec<(String, String)> {
    let state_columns = table.iter().filter(|(name, _)| !STEP_COLUMNS.contains(name));
    let last = |values: &[f64]| values.last().map_or_else(String::new, |value| shortest(*value));
    state_columns.map(|(name, values)| (name.to_owned(), last(values))).collect()
}

/// The value of largest magnitude of each column that describes the state.
fn largest_values(table: &Columns) -> Vec<(String, f64)> {
    let state_columns = table.iter().filter(|(name, _)| !STEP_COLUMNS.contains(name));
    let largest = |values: &[f64]| values.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    state_columns.filter_map(|(name, values)| Some((name.to_owned(), largest(values)?))).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn last_rows() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("history.csv");
        let row_of = |text: &str| {
            fs::write(&path, text).unwrap();
            last_row(&Columns::read(&path).unwrap())
        };
        let expected = |entry: &str| vec![("a_rx".to_owned(), entry.to_owned())];
        assert_eq!(row_of("step,time,a_rx\n1,0.5,2\n2,1,1e-9\n"), expected("1e-9"));
        assert_eq!(row_of("step,a_rx\n"), expected(""));
    }

    #[test]
    fn numbers_are_those_of_the_file() {
        for text in ["0.1", "0.30000000000000004", "12", "-1e-9", "1.7976931348623157e308"] {
            let value: Value = serde_json::from_str(text).unwrap();
            assert_eq!(text_of(&value), text);
        }
        assert_eq!(text_of(&Value::Null), "");
    }
}
