//! Formatting of errors.

/// An error whose code is explained in [`crate::codes`].
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
pub struct Coded {
    pub code: &'static str,
    pub reason: String,
}

impl Coded {
    pub fn new(code: &'static str, reason: String) -> Coded {
        Coded { code, reason }
    }
}

/// Formats an error with its causes.
pub fn in_words(error: &anyhow::Error) -> String {
    format!("{error:#}")
}

/// Formats an error for printing, with its code if it has one.
pub fn as_error(error: &anyhow::Error) -> String {
    let code = error.downcast_ref::<Coded>().map(|coded| format!("[{}]", coded.code)).unwrap_or_default();
    format!("error{code}: {}", in_words(error))
}
