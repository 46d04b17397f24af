//! The tests of the programs in `examples/`.

#![allow(dead_code, reason = "the programs themselves are not run")]

#[path = "../../examples/inertia.rs"]
mod inertia;
#[path = "../../examples/load_step.rs"]
mod load_step;
#[path = "../../examples/own_backend.rs"]
mod own_backend;
#[path = "../../examples/own_law.rs"]
mod own_law;
#[path = "../../examples/own_load.rs"]
mod own_load;
#[path = "../../examples/own_term.rs"]
mod own_term;
#[path = "../../examples/temperature.rs"]
mod temperature;
