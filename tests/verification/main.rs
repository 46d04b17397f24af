//! The problems of Coombs et al. (2020), run from the decks in `inputs/`, against closed forms, the paper's tables
//! and independent programs (`tests/data/README.md`).

mod analysis;
mod beam;
mod compaction;
mod formulations;
mod shear;
