//! Agreement of all ranks on the outcome of an attempt that each of them has made.

use crate::ranks::Ranks;

use super::error::SolveError;
use super::of_rank::OfRank;

/// An error as its rank reports it to the other ranks.
fn as_reported_by(rank: usize, error: &SolveError) -> OfRank {
    let has_lost_points = matches!(
        error,
        SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. }
    );
    OfRank {
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
