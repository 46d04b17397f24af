//! Internal force and stiffness, compared with an independent implementation, with finite differences, and between the
//! two formulations.
#![allow(clippy::unwrap_used)]
#![allow(clippy::needless_range_loop, reason = "index notation, as in the paper")]

pub mod batched;
mod eigenvalues;
mod kernel;
mod oracle;
mod states;
mod tangent;
mod water;
