//! `mpm`: an implicit, quasi-static, finite-deformation material point method.

pub mod deck;
pub mod material;
pub mod stress;
pub mod tensor;
