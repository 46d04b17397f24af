//! Reasons why a library cannot be used.

use std::fmt;

/// A kind of quantity that a library describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A parameter of the law.
    Parameter,
    /// A history variable of the law.
    History,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Parameter => "parameter",
            Kind::History => "history variable",
        })
    }
}

/// Failure to load a library, or a fault in what it states about its law. In the messages, `it` is the library.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LibraryError {
    /// The operating system cannot load the library.
    #[error("it cannot be loaded: {0}")]
    NotLoaded(String),
    /// A required function is missing.
    #[error("it has no function `{0}`")]
    NoFunction(&'static str),
    /// The library implements another version of the interface.
    #[error("it implements version {found} of the interface; this program needs version {needed}")]
    Version {
        /// Version that the library implements.
        found: i32,
        /// Version that this program needs.
        needed: i32,
    },
    /// The structure `mpm_sizes` of the library differs in size.
    #[error("its structure `mpm_sizes` has {found} bytes; this program needs {expected}")]
    Size {
        /// Size that the library states, [byte].
        found: i64,
        /// Size in this program, [byte].
        expected: i64,
    },
    /// A count is out of range.
    #[error("it states {count} {kind}s; the number must be from 0 to {most}")]
    Count {
        /// What is counted.
        kind: Kind,
        /// The count that the library states.
        count: i64,
        /// The largest count allowed.
        most: i64,
    },
    /// A name is missing.
    #[error("{kind} {number} has no name")]
    NoName {
        /// What has no name.
        kind: Kind,
        /// Number of the parameter or history variable, from 0.
        number: usize,
    },
    /// A name or unit is not UTF-8.
    #[error("the name or the unit of {kind} {number} is not UTF-8")]
    NotText {
        /// What the string is about.
        kind: Kind,
        /// Number of the parameter or history variable, from 0.
        number: usize,
    },
    /// A name is not a single word.
    #[error(
        "{kind} {number} cannot be named {name:?}: a name consists of letters, digits and `_`, the first a letter"
    )]
    NotWord {
        /// What has the name.
        kind: Kind,
        /// Number of the parameter or history variable, from 0.
        number: usize,
        /// The name.
        name: String,
    },
    /// A name occurs twice.
    #[error("two {kind}s are named {name:?}")]
    Twice {
        /// What has the name.
        kind: Kind,
        /// The name.
        name: String,
    },
    /// An initial value is not finite.
    #[error("the initial value of the history variable {name:?} is {value}")]
    NotFinite {
        /// Name of the history variable.
        name: String,
        /// The value.
        value: f64,
    },
    /// The strain measure is unknown.
    #[error("`mpm_law_measure` returns {0}; the strain measure must be 0 or 1")]
    Measure(i32),
    /// Loading the library has changed the arithmetic of the program.
    #[error("it makes the whole program treat very small numbers as zero, which changes results")]
    Arithmetic,
    /// The file has changed since it was loaded.
    #[error("it has changed since this program loaded it")]
    Changed,
}
