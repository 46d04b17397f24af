//! Exceptions of the package `mpm`, made from errors of the library.

use mpm::deck::diagnostic::as_json;
use mpm::deck::load::LoadFailure;
use pyo3::prelude::*;

/// An exception of the package, to be raised while the interpreter lock is held.
#[derive(Debug)]
pub enum Raised {
    /// A deck that cannot be used.
    Deck(Box<LoadFailure>),
    /// Result files that cannot be read or written, with a code if there is one.
    Results { code: Option<&'static str>, message: String },
    /// A call that is not possible.
    Misuse(String),
}

impl Raised {
    /// A call that is not possible now or with these arguments.
    pub fn misuse(message: impl Into<String>) -> Raised {
        Raised::Misuse(message.into())
    }

    /// Files that cannot be read.
    pub fn unreadable(error: &std::io::Error) -> Raised {
        Raised::Results { code: None, message: error.to_string() }
    }
}

impl From<Raised> for PyErr {
    fn from(raised: Raised) -> PyErr {
        Python::attach(|py| match raised {
            Raised::Deck(failure) => {
                let document = as_json(&failure.source, &failure.diagnostics).to_string();
                exception(py, "DeckError", (document, failure.render(false).trim_end().to_owned()))
            }
            Raised::Results { code, message } => exception(py, "ResultsError", (message, code)),
            Raised::Misuse(message) => exception(py, "UsageError", (message,)),
        })
    }
}

/// An exception of a class of the package, or the error that prevented its creation.
pub fn exception<'py>(py: Python<'py>, class: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py.import("mpm._errors").and_then(|module| module.getattr(class)?.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}
