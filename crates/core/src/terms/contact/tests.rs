//! Contact between bodies and tools in whole models.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod blocks;
mod footings;
mod safeguards;
mod tangent;

use super::ToolState;
use crate::equilibrium::StepReport;
use crate::model::{Builder, Model};
use crate::points::Points;
use crate::solver::{Observer, Reached, Solvable, SolveError, Stepper, Summary};

/// A completed analysis.
struct Run<const D: usize> {
    points: Points<D>,
    reports: Vec<StepReport<D>>,
    summary: Summary,
}

/// Keeps all reports.
struct Reports<const D: usize>(Vec<StepReport<D>>);

impl<const D: usize> Observer<D> for Reports<D> {
    fn converged(
        &mut self,
        _: &Model<D>,
        _: &Points<D>,
        report: &StepReport<D>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.0.push(report.clone());
        Ok(())
    }
}

/// The tools in a report.
fn tools<const D: usize>(report: &StepReport<D>) -> &[ToolState<D>] {
    report.list()
}

fn run<const D: usize>(builder: Builder<D>) -> Result<Run<D>, SolveError>
where
    Model<D>: Solvable<D>,
{
    let (model, points) = builder.build().unwrap();
    run_model(&model, points)
}

fn run_model<const D: usize>(model: &Model<D>, mut points: Points<D>) -> Result<Run<D>, SolveError>
where
    Model<D>: Solvable<D>,
{
    let mut reports = Reports(Vec::new());
    let Reached { summary, .. } = Stepper::new(model, &mut points).run(&mut reports)?;
    Ok(Run { points, reports: reports.0, summary })
}
