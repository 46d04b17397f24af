//! Internal force and stiffness: against a second, obvious implementation, against differences, and against each
//! other in the two formulations.
#![allow(clippy::unwrap_used)]
#![allow(clippy::needless_range_loop, reason = "index notation, as in the paper")]

mod kernel;
mod oracle;
mod states;
mod tangent;
