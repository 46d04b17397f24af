//! Units in which forces and energies leave the range of floating-point numbers.

use super::Builder;
use crate::material::MaterialOfPoints;
use crate::quoting::quote;
use crate::region::DeckRegion;
use crate::span::escape;
use mpm_core::grid::Grid;
use mpm_core::material::axial_modulus_at_rest;
use mpm_core::region::Region;
use mpm_files::shortest;

/// Range in which forces and energies, and their products with a tolerance, can be squared.
const POSSIBLE: std::ops::RangeInclusive<f64> = 1e-120..=1e140;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Refuses materials in use whose forces on a cell or on the whole grid leave the range `POSSIBLE`. Within it,
    /// results do not depend on the units: in units that differ by powers of four, they are identical to the last bit.
    pub(super) fn magnitudes(&mut self, grid: &dyn Grid<D>, materials: &[MaterialOfPoints]) {
        let [low, high] = grid.bounds();
        let whole = low.iter().chain(&high).fold(0.0, |most: f64, x| most.max(x.abs()));
        let cell = grid.smallest_size();
        let deck = self.deck;
        let used = deck.used_materials();
        for MaterialOfPoints { name, law, .. } in materials.iter().filter(|m| used.contains(m.name.as_str()))
        {
            let (stiffness, key) = match deck.materials[name].young() {
                Some(young) => (young, "young"),
                None => (axial_modulus_at_rest(law.as_ref()), "model"),
            };
            // Without confinement, a law may have no stiffness, or no response. Properties that are not numbers have
            // already been reported.
            if stiffness == 0.0 || stiffness.is_nan() {
                continue;
            }
            let what_is = if key == "young" { "a Young's modulus" } else { "a stiffness" };
            let cell_size = format!("a cell size of {}", shortest(cell));
            let grid_extent = format!("a largest coordinate of {} in the grid", shortest(whole));
            for (length, what) in [(cell, cell_size), (whole, grid_extent)] {
                let powers = [length.powi(D as i32 - 1), length.powi(D as i32)];
                let out =
                    powers.map(|power| stiffness * power).into_iter().find(|force| !POSSIBLE.contains(force));
                let Some(force) = out else { continue };
                let message = format!(
                    "the material {} with {what_is} of {}, and {what}, give forces or energies of {}, outside the \
                     range in which results are accurate",
                    quote(name),
                    shortest(stiffness),
                    shortest(force)
                );
                let help = format!(
                    "use units in which forces and energies lie between {:e} and {:e}",
                    POSSIBLE.start(),
                    POSSIBLE.end()
                );
                self.error("D009", &format!("/materials/{}/{key}", escape(name)), message, help);
                break;
            }
        }
    }
}
