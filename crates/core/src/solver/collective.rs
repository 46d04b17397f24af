//! Collective decisions: what all ranks of a run decide or find out together, so that all take the same path.

use serde::{Serialize, de::DeserializeOwned};

use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::Points;
use crate::ranks::Ranks;
use crate::step::{Step, StepContext};
use crate::terms::{Term, Terms};

use super::error::RemoteError;
use super::error::SolveError;

/// An error as its rank reports it to the other ranks.
fn as_reported_by(rank: usize, error: &SolveError) -> RemoteError {
    let has_lost_points = matches!(
        error,
        SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. }
    );
    RemoteError {
        rank: Some(rank),
        code: error.code().unwrap_or_default().to_owned(),
        text: error.to_string(),
        residuals: error.residuals().to_vec(),
        is_retryable: error.is_retryable(),
        has_lost_points,
        is_torn: matches!(error, SolveError::Domain { .. }),
    }
}

/// Lets an attempt succeed only if it has succeeded on all ranks. All ranks get the error of the first rank that has
/// one, so that all respond to it alike; only that rank keeps the error itself.
pub(super) fn agree<T>(ranks: &Ranks, outcome: Result<T, SolveError>) -> Result<T, SolveError> {
    if ranks.is_alone() {
        return outcome;
    }
    // A rank does not pass on an error that it knows only as the error of another rank.
    let is_known = |error: &&SolveError| !matches!(error, SolveError::OnRank(_));
    let own = outcome.as_ref().err().filter(is_known).map(|error| as_reported_by(ranks.own(), error));
    match ranks.first(own) {
        None => outcome,
        Some(first) if first.rank == Some(ranks.own()) => outcome,
        Some(first) => Err(SolveError::OnRank(Box::new(first))),
    }
}

/// The value of the first rank that knows it, for all ranks; the own value if none does.
pub(super) fn value_of_first_to_know<T: Serialize + DeserializeOwned>(
    ranks: &Ranks,
    knows: bool,
    own: T,
) -> T {
    if ranks.is_alone() {
        return own;
    }
    // Values omit fields that they lack, so that only a format with field names can read them back.
    let text = ranks.first(knows.then(|| serde_json::to_string(&own).unwrap_or_default()));
    text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or(own)
}

/// Forces on the nodes of all ranks, by grid node, from those on the nodes that this rank counts.
pub(super) fn forces_on_all_nodes<const D: usize>(
    ranks: &Ranks,
    own: Vec<(u32, [f64; D])>,
) -> Vec<(u32, [f64; D])> {
    let own: Vec<(u32, Vec<f64>)> = own.into_iter().map(|(node, force)| (node, force.to_vec())).collect();
    let mut all: Vec<(u32, [f64; D])> = (ranks.join(own).into_iter())
        .map(|(node, force)| (node, std::array::from_fn(|d| force.get(d).copied().unwrap_or(0.0))))
        .collect();
    all.sort_unstable_by_key(|(node, _)| *node);
    all
}

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
    for attached in terms.iter_mut().filter_map(|term| term.attached()) {
        let nodes = attached.reach(model, points, &links).map_err(|error| SolveError::begin(error, step));
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
    let ranks = context.links.reduction();
    let mut begin = |term: &mut Box<dyn Term<D, N>>| {
        let begun = term.begin(context, points);
        agree(ranks, begun.map_err(|error| SolveError::begin(error, context.step)))
    };
    terms.iter_mut().try_for_each(&mut begin)
}
