//! The beginning of a step with all terms: the nodes of other ranks that they need, and the state that they start from.

use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::Points;
use crate::step::{Step, StepContext};
use crate::terms::{Term, Terms};

use super::agree::agree;
use super::error::SolveError;

/// Adds to the links the nodes that terms need on this rank.
pub(super) fn reach_out<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: Connectivity<D>,
    terms: &mut Terms<D, N>,
    step: Step,
) -> Result<Connectivity<D>, SolveError> {
    let ranks = &points.ranks;
    if ranks.is_alone() {
        return Ok(links);
    }
    let mut wanted = Vec::new();
    for term in terms {
        let nodes = term.reach(model, points, &links).map_err(|error| SolveError::begin(error, step));
        wanted.extend(agree(ranks, nodes)?);
    }
    Ok(links.with_nodes(model.grid.as_ref(), ranks, wanted))
}

/// Begins a step with all terms. After each term, the ranks share any error, because the next term may need all ranks.
pub(super) fn begin<const D: usize, const N: usize>(
    terms: &mut Terms<D, N>,
    context: &StepContext<D>,
    points: &Points<D>,
) -> Result<(), SolveError> {
    let ranks = context.links.halo().ranks();
    let mut begin = |term: &mut Box<dyn Term<D, N>>| {
        let begun = term.begin(context, points);
        agree(ranks, begun.map_err(|error| SolveError::begin(error, context.step)))
    };
    terms.iter_mut().try_for_each(&mut begin)
}
