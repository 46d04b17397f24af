//! The laws of materials, and the properties of their points.

use super::Builder;
use crate::ControlDeck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::formulas::at_start;
use crate::law_library::{self, OfLibrary};
use crate::material::{BuiltLaw, CellSize, MaterialDeck, MaterialOfPoints, Surroundings};
use crate::quoting::quote;
use crate::region::OfDeck;
use crate::span::escape;
use mpm_core::grid::Grid;
use mpm_core::points::{Seed, coordinates};
use mpm_core::region::Region;
use mpm_core::tensor::padded;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: OfDeck<D>,
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
            let name = name.clone();
            if let Some(own) = self.loaded.laws.get(&name) {
                laws.push(MaterialOfPoints {
                    name,
                    law: own.0(),
                    varying: Vec::new(),
                    consistency: None,
                    density,
                });
                continue;
            }
            self.strength_that_stays(&name, material);
            if let MaterialDeck::Library { file, parameters, .. } = material {
                let (source, directory) = (&self.loaded.source, self.loaded.directory.as_path());
                match (OfLibrary { source, directory, name: &name, file, parameters }).law() {
                    Ok(law) => {
                        self.found.extend(law_library::remarks(source, &name, law.as_ref()));
                        laws.push(MaterialOfPoints {
                            name,
                            law,
                            varying: Vec::new(),
                            consistency: None,
                            density,
                        });
                    }
                    Err(found) => self.found.extend(found),
                }
                continue;
            }
            if deck.used_materials().contains(name.as_str()) {
                self.softening(&name, material, &cells);
            }
            self.factor_of_safety(&name);
            let built = material.law(&self.surroundings(typical, &cells));
            match built {
                Ok(built) => {
                    // Now that the cell size is known, softening may prove too fast.
                    self.found.extend(built.contradiction(&self.loaded.source, &name));
                    let BuiltLaw { law, varying, consistency } = built;
                    let consistency = Some(consistency);
                    laws.push(MaterialOfPoints { name, law, varying, consistency, density });
                }
                Err(faults) => {
                    for fault in faults {
                        let at = format!("/materials/{}/{}", escape(&name), fault.key);
                        self.error("D021", &at, fault.error.message, fault.error.help.unwrap_or_default());
                    }
                }
            }
        }
        laws
    }

    /// What the properties of a material may refer to, with typical values at this position.
    pub(super) fn surroundings(&self, typical: [f64; 3], cells: &CellSize) -> Surroundings<'_> {
        Surroundings { parameters: Some(&self.deck.parameters), dimensions: D, typical, cells: cells.clone() }
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
        let is_reducible =
            |of: &MaterialOfPoints| of.law.batch().is_none() && of.law.with_strength_divided(1.0).is_some();
        let (reducible, others): (Vec<_>, Vec<_>) =
            laws.iter().filter(|of| used.contains(of.name.as_str())).partition(|of| is_reducible(of));
        let own: Vec<_> = others.iter().filter(|of| self.loaded.laws.contains_key(&of.name)).collect();
        for of in &own {
            let message = format!(
                "the strength of the material {} cannot be reduced: its law is not built in",
                quote(&of.name)
            );
            let help = "use a built-in law, such as `mohr-coulomb` (in Python, `mpm.BuiltInLaw`)";
            self.error("D049", &format!("/materials/{}/model", escape(&of.name)), message, help.to_owned());
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
        let has_one = matches!(material, MaterialDeck::Library { .. } | MaterialDeck::ModifiedCamClay { .. });
        if !(has_one && self.deck.reduces_strength() && self.deck.used_materials().contains(name)) {
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
        let MaterialOfPoints { name, law, varying, consistency, density } = material;
        let own = law.state_fields().len() - varying.len();
        let deck = &self.deck.materials[name];
        let ranges: Vec<_> = varying.iter().map(|varying| deck.range(&varying.key)).collect();
        let density_range = density.as_ref().map(|_| deck.range("density"));
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
            if let (Some(density), Some(range)) = (density, &density_range) {
                let value = density.evaluate(&seed.position);
                if range.contains(value) {
                    seed.mass = value * seed.volume;
                } else {
                    let message = format!("the density of {} is {value} {}", quote(name), place());
                    fault(
                        "density",
                        "D058",
                        message,
                        format!("change it so that it is {}{}", finite(value), range.in_words()),
                    );
                }
            }
            if varying.is_empty() {
                continue;
            }
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
            if let Some(found) =
                consistency.as_ref().filter(|_| is_in_range).and_then(|check| check(properties))
            {
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
        Some(lines) => CellSize::of_axes(lines.axes()),
        None => {
            let n = grid.n_cells();
            CellSize::Mean((0..n).map(|cell| grid.size(cell)).sum::<f64>() / n.max(1) as f64)
        }
    }
}
