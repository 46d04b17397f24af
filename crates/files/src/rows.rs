//! Checks that the tables of a run to be resumed have all their rows.

use std::io;

use mpm_core::counted::counted;

use super::table::Kept;

/// Checks that `history.csv`, `quality.csv` and `convergence.csv` have the rows of all `steps` converged steps.
///
/// # Errors
/// `InvalidData`, with the file and the first step whose rows are missing or, if the step numbers have no gap, the
/// number of steps found.
pub(super) fn check([history, quality, convergence]: [&Kept; 3], steps: usize) -> io::Result<()> {
    let rows = history.numbers(["step", "iterations", "converged"]);
    let accepted: Vec<(usize, usize)> = (rows.iter())
        .filter(|[_, _, converged]| *converged == Some(1))
        .filter_map(|[step, iterations, _]| Some(((*step)?, (*iterations)?)))
        .collect();
    if accepted.len() != steps {
        // Step numbers may have gaps if a run was resumed with a different number of steps.
        let mut before = 0;
        let gap = accepted.iter().find_map(|(step, _)| {
            let expected = before + 1;
            before = *step;
            (*step != expected).then_some(expected)
        });
        return Err(match gap {
            Some(step) => missing(history, step),
            None => {
                let found = counted(accepted.len(), "step", "steps");
                wrong(history, &format!("has {found} in equilibrium instead of {steps}"))
            }
        });
    }
    let quality_steps: Vec<_> = quality.numbers(["step"]).into_iter().map(|[step]| step).collect();
    if let Some(place) = (0..steps).find(|&k| quality_steps.get(k) != Some(&Some(accepted[k].0))) {
        return Err(missing(quality, accepted[place].0));
    }
    let evaluations = convergence.numbers(["step", "iteration"]);
    let mut rest = evaluations.as_slice();
    for (step, iterations) in accepted {
        let n = rest.iter().take_while(|row| row[0] == Some(step)).count();
        let (own, later) = rest.split_at(n);
        // The rows of failed attempts precede those of the converged attempt.
        let last = own.iter().rposition(|row| row[1] == Some(0)).map_or(&[][..], |first| &own[first..]);
        // A multiplier update evaluates the residual of an iteration once more.
        let follows = |pair: &[[Option<usize>; 2]]| {
            pair[1][1] == pair[0][1] || pair[1][1] == pair[0][1].map(|number| number + 1)
        };
        let is_whole = last.last().is_some_and(|row| row[1] == Some(iterations));
        if !is_whole || !last.windows(2).all(follows) {
            return Err(missing(convergence, step));
        }
        rest = later;
    }
    Ok(())
}

fn missing(table: &Kept, step: usize) -> io::Error {
    wrong(table, &format!("lacks rows of step {step}"))
}

fn wrong(table: &Kept, what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("`{}` {what}", table.path().display()))
}
