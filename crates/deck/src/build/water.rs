//! The water of a deck.

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};
use crate::span::escape;
use crate::water::Drainage;
use mpm_core::model::{Water, WaterLevel};
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The water of the model; `None` without a level.
    pub(super) fn water(&mut self, regions: &Regions<D>) -> Option<Water> {
        let deck = self.deck;
        let water = deck.water.as_ref()?;
        let (level, unit_weight) = (water.level.as_ref()?, water.unit_weight?);
        self.reached_bodies(regions);
        let grains = |material: &crate::MaterialDeck| match material.drainage() {
            Some(Drainage::Dry) => 1.0,
            _ => 1.0 - material.porosity().unwrap_or(0.0),
        };
        let mut levels: Vec<(f64, WaterLevel)> = vec![(0.0, level.level())];
        let mut time = 0.0;
        for stage in &deck.stages {
            let end = time + stage.steps.end_time;
            if let Some(changed) = &stage.water {
                let before = levels[levels.len() - 1].clone();
                if before.0 < time {
                    levels.push((time, before.1));
                }
                levels.push((end, changed.level.level()));
            }
            time = end;
        }
        Some(Water { unit_weight, levels, grains: deck.materials.values().map(grains).collect() })
    }

    /// Checks the materials and the weight of the bodies that reach below a level.
    fn reached_bodies(&mut self, regions: &Regions<D>) {
        let deck = self.deck;
        let mut reported: Vec<&str> = Vec::new();
        for (number, body) in deck.bodies.iter().enumerate() {
            let [low, high] = regions.bodies[number].bounds();
            let levels = deck.levels();
            let highest = levels.iter().map(|(_, level)| level.highest([low[0], high[0]]));
            let level = highest.fold(f64::NEG_INFINITY, f64::max);
            if level <= low[D - 1] {
                continue;
            }
            let later = deck.stages.iter().filter_map(|stage| stage.material.get(&body.name));
            for name in [&body.material].into_iter().chain(later) {
                let Some(material) = deck.materials.get(name) else { continue };
                let is_dry = material.drainage() == Some(Drainage::Dry);
                if is_dry || material.porosity().is_some() || reported.contains(&name.as_str()) {
                    continue;
                }
                reported.push(name);
                let message = format!(
                    "the water reaches the body {} up to the height {level}, but its material {} has no porosity",
                    quote(&body.name),
                    quote(name)
                );
                let help =
                    "add `porosity` to the material, or `drainage: dry` if no water enters it".to_owned();
                self.error("D092", &format!("/materials/{}", escape(name)), message, help);
            }
            let acts = |load: &&crate::LoadDeck| load.bodies().is_none_or(|names| names.contains(&body.name));
            if !deck.loads.iter().filter(acts).any(|load| load.acceleration().is_some()) {
                let message = format!(
                    "water lifts the body {} with its full weight from the start, but no gravity pulls it down",
                    quote(&body.name)
                );
                let found =
                    Diagnostic::at(&self.loaded.source, "D096", &format!("/bodies/{number}"), message);
                let help = "add a load of type `gravity` that acts on the body; water follows its factor";
                self.found.push(found.severity(Severity::Warning).help(help));
            }
        }
    }
}
