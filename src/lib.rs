//! `mpm`: an implicit, quasi-static, finite-deformation material point method.

pub mod assembly;
pub mod basis;
pub mod constraints;
pub mod deck;
pub mod domain;
pub mod formula;
pub mod grid;
pub mod linear;
pub mod loads;
pub mod material;
pub mod model;
pub mod output;
pub mod points;
pub mod solver;
pub mod stress;
pub mod study;
pub mod tensor;
pub mod timing;
