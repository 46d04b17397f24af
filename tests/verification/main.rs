//! The problems of Coombs et al. (2020), run from the decks in `inputs/` and compared with closed forms, the paper's
//! tables and independent programs (`tests/data/README.md`).
#![allow(clippy::print_stdout, reason = "the measured numbers are part of the verification")]
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod analysis;
mod annulus;
mod balances;
mod beam;
mod beam_methods;
mod collapse;
mod compaction;
mod domains;
mod formulations;
mod imported;
mod locking;
#[path = "../long.rs"]
mod long;
mod meshes;
mod radial;
mod revolution;
mod shear;
mod surfaces;
mod total_lagrangian;
mod weak_conditions;
