//! Messages for the user, on standard error.

/// Writes a line to standard error; that nobody reads it, or can, is no reason to stop an analysis.
macro_rules! tell {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}
