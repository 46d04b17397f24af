//! `mpm check --ranks`: memory and time of a run on several ranks.

use crate::deck::diagnostic::{deny_warnings, sort};
use crate::deck::load::LoadFailure;
use crate::deck::plan::{EVALUATIONS, ITERATIONS, Plan};
use crate::deck::quoting::counted;
use crate::memory::in_words;
use crate::program::commands::analysis;
use crate::program::commands::arguments::{DeckArgs, Format};
use crate::program::exit::DONE;
use crate::program::screen::print::{print, print_json};
use crate::program::screen::quantities::significant;
use serde_json::json;

/// Predicts memory and time of a deck on this number of ranks.
pub fn plan(args: &DeckArgs, ranks: usize) -> anyhow::Result<u8> {
    let mut loaded = match args.load() {
        Ok(loaded) => loaded,
        Err(failure) => return analysis::refuse(failure, args.format),
    };
    let denied = args.deny_warnings && deny_warnings(&mut loaded.notes);
    let plan = match Plan::new(&loaded, ranks) {
        Ok(plan) if !denied => plan,
        planned => {
            let mut diagnostics = loaded.notes;
            diagnostics.extend(planned.err().unwrap_or_default());
            sort(&mut diagnostics);
            let failure = LoadFailure { source: loaded.source, diagnostics };
            return analysis::refuse(Box::new(failure), args.format);
        }
    };
    let step = plan.solution.map(|solution| EVALUATIONS * (plan.evaluation + solution));
    if args.format == Format::Json {
        print_json(&json!({
            "ranks": plan.ranks,
            "points": plan.points.round(),
            "unknowns": plan.unknowns.round(),
            "memory_bytes_of_rank": plan.memory.round(),
            "seconds_of_evaluation": plan.evaluation,
            "seconds_of_solution": plan.solution,
            "seconds_of_step": step,
        }))?;
        return Ok(DONE);
    }
    let time = match (plan.solution, step) {
        (Some(solution), Some(step)) => format!(
            "  {} s for a solution of the equations in {ITERATIONS} iterations\n  {} s for a step of {EVALUATIONS} \
             evaluations and solutions\n",
            significant(solution, 2),
            significant(step, 2)
        ),
        _ => "  the equations are factorised; the time for this is not predicted\n".to_owned(),
    };
    print(&format!(
        "{} on {}, predicted from its size:\n  {:.3e} points and {:.3e} unknowns, {:.3e} and {:.3e} on each rank, \
         plus {:.0} % more nodes that the rank shares with others\n  {} of memory for each rank\n  \
         {} s for an evaluation of all points\n{time}",
        loaded.source.name(),
        counted(plan.ranks, "rank", "ranks"),
        plan.points,
        plan.unknowns,
        plan.points / plan.ranks as f64,
        plan.unknowns / plan.ranks as f64,
        100.0 * plan.shared,
        in_words(plan.memory),
        significant(plan.evaluation, 2),
    ))
}
