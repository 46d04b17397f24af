//! The laws of materials, and the properties of their points.

use super::Builder;
use crate::ControlDeck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::formulas::at_start;
use crate::laws::{MaterialDeck, remarks};
use crate::material::{CellSize, MaterialOfPoints};
use crate::quoting::quote;
use crate::region::DeckRegion;
use crate::span::escape;
use mpm_core::grid::Grid;
use mpm_core::points::{Seed, coordinates};
use mpm_core::region::Region;
use mpm_core::tensor::padded;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The laws of all materials, in the order of their names.
    pub(super) fn laws(&mut self, grid: &dyn Grid<D>, regions: &[Region<D>]) -> Vec<MaterialOfPoints> {
        let deck = self.deck;
        let cells = size_of_cells(grid);
        let mut laws = Vec::new();
        for (name, material) in &deck.materials {
            let body = deck.bodies.iter().position(|body| body.material == *name);
            let typical = body.and_then(|body| regions.get(body)).map_or([0.0; 3], centre);
            let density = material.density().map(|density| vec![("density".to_owned(), density)]);
            let density = density.and_then(|density| at_start(density, &deck.parameters, D).ok()?.pop());
            let density = density.filter(|density| density.as_constant().is_none());
            if !self.loaded.laws.contains_key(name) {
                self.strength_that_stays(name, material);
                if deck.used_materials().contains(name.as_str()) {
                    self.softening(name, material, &cells);
                }
                self.factor_of_safety(name);
            }
            match self.loaded.stated_law(name, &cells) {
                Some(Ok(stated)) => {
                    let (source, law) = (&self.loaded.source, stated.law(&typical));
                    if self.loaded.is_from_library(name) {
                        self.found.extend(remarks(source, name, law.as_ref()));
                    }
                    // Now that the cell size is known, softening may prove too fast.
                    self.found.extend(stated.contradiction(source, name));
                    laws.push(MaterialOfPoints { name: name.clone(), stated, law, density });
                }
                Some(Err(faults)) => self.found.extend(faults),
                None => {}
            }
        }
        laws
    }

    /// Reports that softening depends on the cell size, or how it is adapted to the cell size.
    fn softening(&mut self, name: &str, material: &MaterialDeck, cells: &CellSize) {
        let Some(band) = material.softening() else { return };
        let name_in_quotes = quote(name);
        let (message, help) = match (band, cells) {
            (Some(band), CellSize::Even(size)) => (
                format!(
                    "the material {name_in_quotes} softens; its softening strain is multiplied by {:.3}, the ratio of \
                     the band width {band} to the cell size {size:.3}, so that a band one cell wide softens over the \
                     same displacement as a band of width {band}",
                    band / size
                ),
                "compare two grids: the direction and the number of bands may still depend on them",
            ),
            (Some(band), CellSize::Mean(size)) => (
                format!(
                    "the material {name_in_quotes} softens; its softening strain is multiplied by {:.3}, the ratio of \
                     the band width {band} to the mean cell size {size:.3} of the mesh, even in cells that are larger \
                     or smaller",
                    band / size
                ),
                "use cells of equal size where bands form, and compare two meshes",
            ),
            (Some(band), _) => (
                format!(
                    "the material {name_in_quotes} softens; its softening strain is multiplied by the ratio of the \
                     band width {band} to the size of the cell in which each point starts (field `cell_size`)"
                ),
                "compare two grids: the direction and the number of bands may still depend on them",
            ),
            (None, _) => (
                format!(
                    "the material {name_in_quotes} softens without `band`: bands become as narrow as cells, and results \
                     depend on the cell size"
                ),
                "add to `softening` the key `band`, the width of the shear band to which `strain` refers, and compare \
                 two grids",
            ),
        };
        let at = format!("/materials/{}/softening", escape(name));
        let found = Diagnostic::at(&self.loaded.source, "D060", &at, message).severity(Severity::Note);
        self.found.push(found.help(help));
    }

    /// If the deck reduces the strength, checks that at least one law in use has a strength that can be reduced, and
    /// that every law in use that replaces a law of the deck has one, because it is unknown whether such a law yields.
    pub(super) fn strengths(&mut self, laws: &[MaterialOfPoints]) {
        let deck = self.deck;
        let used = deck.used_materials();
        if !deck.reduces_strength() || laws.len() < deck.materials.len() {
            return;
        }
        // A law that the solver evaluates in batches keeps its full strength.
        let is_reducible = |material: &MaterialOfPoints| {
            material.law.batch().is_none() && material.law.with_strength_divided(1.0).is_some()
        };
        let in_use = laws.iter().filter(|material| used.contains(material.name.as_str()));
        let (reducible, others): (Vec<_>, Vec<_>) = in_use.partition(|material| is_reducible(material));
        let own = others.iter().filter(|material| self.loaded.laws.contains_key(&material.name));
        let own: Vec<&str> = own.map(|material| material.name.as_str()).collect();
        for name in &own {
            let message = format!(
                "the strength of the material {} cannot be reduced: its law is not built in",
                quote(name)
            );
            let help = "use a built-in law, such as `mohr-coulomb` (in Python, `mpm.BuiltInLaw`)";
            self.error("D049", &format!("/materials/{}/model", escape(name)), message, help.to_owned());
        }
        if !reducible.is_empty() || !own.is_empty() {
            return;
        }
        for (pointer, steps) in deck.courses() {
            if matches!(steps.control, ControlDeck::StrengthReduction { .. }) {
                let message = "no material has a strength that could be reduced".to_owned();
                let help = "use `tresca`, `mohr-coulomb`, `drucker-prager` or `von-mises`".to_owned();
                self.error("D049", &format!("{pointer}/control"), message, help);
            }
        }
    }

    /// Notes that a material that may yield is exempt from the strength reduction.
    fn strength_that_stays(&mut self, name: &str, material: &MaterialDeck) {
        let keeps_it = material.law_deck().keeps_strength();
        if !(keeps_it && self.deck.reduces_strength() && self.deck.used_materials().contains(name)) {
            return;
        }
        let message = format!("the strength of the material {} is not reduced", quote(name));
        let help = "the factor of safety then assumes that this material keeps its full strength; use `tresca`, \
                    `mohr-coulomb`, `drucker-prager` or `von-mises` for the bodies that may fail";
        let at = format!("/materials/{}/model", escape(name));
        let found = Diagnostic::at(&self.loaded.source, "D049", &at, message).severity(Severity::Note);
        self.found.push(found.help(help));
    }

    /// Reports that a factor of safety depends on the cell size if flow is non-associated.
    fn factor_of_safety(&mut self, name: &str) {
        if !self.deck.nonassociated_with_reduced_strength().contains(&name) {
            return;
        }
        let message = format!(
            "the flow of the material {} is non-associated; the factor of safety therefore depends on the cell size",
            quote(name)
        );
        let help = "compare two grids, for example with `mpm sweep` over the cell size, and plot displacement against \
                    the factor";
        let at = format!("/materials/{}/dilation_angle", escape(name));
        let found = Diagnostic::at(&self.loaded.source, "D064", &at, message).severity(Severity::Note);
        self.found.push(found.help(help));
    }

    /// Assigns to each point the properties at its position, and checks these properties. `room` is the number of
    /// history variables stored for each point.
    pub(super) fn furnish(
        &mut self,
        body: &str,
        material: &MaterialOfPoints,
        room: usize,
        seeds: &mut [Seed<D>],
    ) {
        self.weigh(body, material, seeds);
        let MaterialOfPoints { name, stated, law, .. } = material;
        let varying = &stated.varying;
        if varying.is_empty() {
            return;
        }
        let own = law.state_fields().len() - varying.len();
        let deck = &self.deck.materials[name];
        let ranges: Vec<_> = varying.iter().map(|varying| deck.range(&varying.key)).collect();
        // The first fault of each property.
        let mut faults: Vec<(String, &str, String, String)> = Vec::new();
        let mut fault = |key: &str, code, message: String, help: String| {
            if !faults.iter().any(|(other, ..)| other == key) {
                faults.push((key.to_owned(), code, message, help));
            }
        };
        for seed in seeds {
            let place =
                || format!("at the point {} of the body {}", coordinates(&seed.position), quote(body));
            let mut history = law.initial_history_at(&padded(&seed.position));
            let properties = &history[own..];
            let mut is_in_range = true;
            for ((varying, value), range) in varying.iter().zip(properties).zip(&ranges) {
                if !range.contains(*value) {
                    is_in_range = false;
                    let key = &varying.key;
                    let message = format!("`{key}` of the material {} is {value} {}", quote(name), place());
                    fault(
                        key,
                        "D058",
                        message,
                        format!(
                            "change the formula so that it is {}{} in the whole body",
                            finite(*value),
                            range.in_words()
                        ),
                    );
                }
            }
            if is_in_range && let Some(found) = (stated.consistency)(properties) {
                let message = format!("material {} {}: {}", quote(name), place(), found.message);
                fault(&found.key, "D057", message, found.help);
            }
            history.resize(room, 0.0);
            seed.history = history;
        }
        for (key, code, message, help) in faults {
            self.error(code, &format!("/materials/{}/{key}", escape(name)), message, help);
        }
    }

    /// Gives each point the mass that follows from a density that varies, and checks this density.
    fn weigh(&mut self, body: &str, material: &MaterialOfPoints, seeds: &mut [Seed<D>]) {
        let MaterialOfPoints { name, density: Some(density), .. } = material else { return };
        let range = self.deck.materials[name].range("density");
        let mut first = None;
        for seed in seeds {
            let value = density.evaluate(&seed.position);
            if range.contains(value) {
                seed.mass = value * seed.volume;
            } else {
                first.get_or_insert((value, seed.position));
            }
        }
        if let Some((value, position)) = first {
            let place = format!("at the point {} of the body {}", coordinates(&position), quote(body));
            let message = format!("the density of {} is {value} {place}", quote(name));
            let help = format!("change it so that it is {}{}", finite(value), range.in_words());
            self.error("D058", &format!("/materials/{}/density", escape(name)), message, help);
        }
    }
}

/// The words that a message puts before the range of a property if the value is not finite; empty otherwise.
fn finite(value: f64) -> &'static str {
    if value.is_finite() { "" } else { "finite and " }
}

/// The centre of the box around a region.
fn centre<const D: usize>(region: &Region<D>) -> [f64; 3] {
    let bounds = region.bounds();
    padded(&std::array::from_fn::<f64, D, _>(|d| 0.5 * (bounds[0][d] + bounds[1][d])))
}

/// Cell size; for a mesh, the mean.
pub(super) fn size_of_cells<const D: usize>(grid: &dyn Grid<D>) -> CellSize {
    match grid.lines() {
        Some(lines) => CellSize::structured(lines.axes()),
        None => {
            let n = grid.n_cells();
            CellSize::Mean((0..n).map(|cell| grid.size(cell)).sum::<f64>() / n.max(1) as f64)
        }
    }
}
