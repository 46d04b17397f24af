//! The error of another rank.

use serde::{Deserialize, Serialize};

/// The error of another rank, as this rank knows it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RemoteError {
    /// Number of the rank; `None` while nothing is known about the error.
    pub rank: Option<usize>,
    /// Code of the error.
    pub code: String,
    /// The error in words.
    pub text: String,
    /// Residuals of the failed step, [-].
    pub residuals: Vec<f64>,
    /// True if a smaller step may succeed.
    pub is_retryable: bool,
    /// True if points or domains could not follow the grid.
    pub has_lost_points: bool,
    /// True if a domain is torn.
    pub is_torn: bool,
}

impl std::fmt::Display for RemoteError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.rank {
            Some(rank) => write!(f, "rank {rank}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}
