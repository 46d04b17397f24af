//! The problems of Coombs et al. (2020), run from the decks in `inputs/` and compared with closed forms, the paper's
//! tables and independent programs (`tests/data/README.md`).

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
mod radial;
mod revolution;
mod shear;
mod surfaces;
mod total_lagrangian;
mod weak_conditions;
