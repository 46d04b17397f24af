//! From the properties of a material, which may vary in space, to its law.

mod cell_size;
mod consistency;
mod material_deck;
mod material_of_points;
mod property;
mod reading;
mod softening;
mod stated_law;

pub use cell_size::CellSize;
pub(crate) use consistency::{Inconsistency, consistent};
pub(crate) use material_of_points::MaterialOfPoints;
pub(crate) use property::Setting;
pub(crate) use reading::{Faults, FrictionSettings, Reading};
pub(crate) use softening::{Decay, too_steep};
pub use stated_law::{StatedLaw, Surroundings};
