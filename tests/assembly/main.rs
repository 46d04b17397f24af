//! Internal force and stiffness: against a second, obvious implementation, against differences, and against each
//! other in the two formulations.
#![allow(clippy::unwrap_used)]

mod oracle;
mod states;
mod tangent;
