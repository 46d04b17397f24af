//! The record of a run in memory: the content of its tables and its summary, without files.

use std::io;

use serde_json::Value;

use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::solver::{Cause, FailedAttempt, Observer, Reached, SolveError, Step, StepReport};

use super::findings::{Extremes, Findings};
use super::history::{
    Beside, QUALITY, columns_of_convergence, columns_of_history, row_of_attempt, row_of_convergence,
    row_of_history, row_of_quality,
};
use super::summary::{Account, Outcome, Whole, Wording};
use super::table::Entry;

/// A table in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The rows, with one entry per column.
    pub rows: Vec<Vec<Entry>>,
}

impl Rows {
    fn new(columns: &[impl AsRef<str>]) -> Rows {
        Rows { columns: columns.iter().map(|name| name.as_ref().to_owned()).collect(), rows: Vec::new() }
    }

    /// A column as numbers; NaN for missing entries.
    pub fn column(&self, number: usize) -> Vec<f64> {
        let value = |row: &Vec<Entry>| match row[number] {
            Entry::Integer(value) => value as f64,
            Entry::Number(value) => value,
            Entry::Missing => f64::NAN,
        };
        self.rows.iter().map(value).collect()
    }
}

/// Follows a run and keeps its tables and, in the end, its summary.
#[derive(Debug)]
pub struct Record {
    /// The rows of `history.csv`.
    pub history: Rows,
    /// The rows of `quality.csv`.
    pub quality: Rows,
    /// The rows of `convergence.csv`.
    pub convergence: Rows,
    /// The document of `summary.json`, once the run has ended.
    pub summary: Option<Value>,
    account: Account,
    findings: Findings,
}

impl Record {
    /// A record of a run that begins with this model.
    pub fn new<const D: usize>(model: &Model<D>, account: Account) -> Record {
        Record {
            history: Rows::new(&columns_of_history(model, &Beside::default())),
            quality: Rows::new(&QUALITY),
            convergence: Rows::new(&columns_of_convergence(&[])),
            summary: None,
            account,
            findings: Findings::default(),
        }
    }

    /// The words in which the record advises on warnings and failures.
    pub fn wording(&self) -> &dyn Wording {
        self.account.wording.as_ref()
    }

    /// Changes the account of the run, for example its deck.
    pub fn restate(&mut self, change: impl FnOnce(&mut Account)) {
        change(&mut self.account);
    }
}

impl<const D: usize> Observer<D> for Record {
    fn iteration(&mut self, step: Step, iteration: usize, residual: f64, by_field: &[f64]) {
        if residual.is_finite() {
            self.convergence.rows.push(row_of_convergence(step, iteration, residual, by_field));
        }
    }

    fn converged(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        Reached { summary, .. }: &Reached,
    ) -> io::Result<()> {
        self.findings.accept(model, report, summary);
        self.history.rows.push(row_of_history(model, points, report, summary, &Beside::default()));
        self.quality.rows.push(row_of_quality(report, summary, &self.findings));
        Ok(())
    }

    fn failed(
        &mut self,
        _: &Model<D>,
        _: &Points<D>,
        attempt: &FailedAttempt<D>,
        _: Option<Cause<D>>,
    ) -> io::Result<()> {
        self.history.rows.push(row_of_attempt(self.history.columns.len(), attempt));
        Ok(())
    }

    fn finished(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        reached: &Reached,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        self.findings.extremes = Extremes::new(model, points);
        self.summary = Some(self.account.document(
            model,
            &Whole::new(model, points, &reached.summary),
            reached,
            &self.findings,
            &Outcome::new(error),
        ));
        Ok(())
    }
}
