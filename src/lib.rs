//! `mpm`: an implicit, quasi-static, finite-deformation material point method.

pub mod basis;
pub mod deck;
pub mod domain;
pub mod grid;
pub mod linear;
pub mod material;
pub mod points;
pub mod stress;
pub mod tensor;
