//! `mpm`: an implicit, quasi-static, finite-deformation material point method.

pub mod deck;
pub mod formula;
