//! What leads from one step to the next: its size, an unknown load factor, factors of a strength reduction, a
//! limit load, and the split of long domains.

pub(super) mod control;
pub(super) mod limit;
pub(super) mod pace;
pub(super) mod rest;
pub(super) mod splitting;
pub(super) mod strength;
mod viscosity;
