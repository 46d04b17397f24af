//! From a file to a valid deck: its text, its values with their locations, its parameters, and its shape. The gate
//! `meaning` is the module [`check`](crate::check).

pub mod changes;
pub(crate) mod hash;
pub mod load;
pub(crate) mod parameters;
pub mod references;
pub mod schema;
pub(crate) mod shape;
pub mod source;
pub(crate) mod span;
mod text;
pub(crate) mod yaml;
