//! Units that look mixed: stiffness, density and gravity that do not fit one system.

use std::collections::BTreeSet;

use super::Check;
use super::extent::Extent;
use crate::quoting::quote;
use crate::span::escape;
use crate::{BodyDeck, Expression, GridDeck, Parameter};
use mpm_files::units::Units;

/// Acceleration of gravity in m/s², exact or rounded.
const GRAVITY_IN_METRES: std::ops::RangeInclusive<f64> = 9.5..=10.5;
/// Wave speed that no solid reaches, in m/s.
const FASTEST: f64 = 20e3;
/// Largest density of a solid in tonnes per cubic metre; values in kilograms are far larger.
const DENSEST_IN_TONNES: f64 = 12.0;
/// Strain of a body under its own weight below which its stiffness and density seem to be in different units.
const HARDLY_STRAINED: f64 = 1e-3;
/// Strain under its own weight that no body can sustain.
const CRUSHED: f64 = 100.0;
/// Ratio of the densities of two solids that only mixed units can explain.
const DENSITIES_APART: f64 = 200.0;
/// Friction angle below which an angle other than 0 is probably in radians, [degrees].
const MIN_FRICTION: f64 = 1.0;

/// Gravity on the earth, [m/s²], and density of water, [kg/m³].
const GRAVITY: f64 = 9.81;
const WATER: f64 = 1000.0;
/// Accelerations, from a moon to a centrifuge, [m/s²].
const PLAUSIBLE_GRAVITY: std::ops::RangeInclusive<f64> = 0.5..=5000.0;
/// Densities of solids, from foam to gold, [kg/m³].
const PLAUSIBLE_DENSITY: std::ops::RangeInclusive<f64> = 5.0..=23e3;
/// Lowest density that only metals have, [kg/m³], and a stiffness below that of all metals, [Pa].
const LIGHTEST_METAL: f64 = 6500.0;
const SOFTEST_METAL: f64 = 1e9;
/// Names of metals, their Young's moduli in MPa and densities in kg/m³.
const METALS: &[(&str, [f64; 2], [f64; 2])] = &[
    ("steel", [180e3, 220e3], [7.6e3, 8.1e3]),
    ("aluminium", [65e3, 75e3], [2.6e3, 2.9e3]),
    ("copper", [100e3, 130e3], [8.7e3, 9.0e3]),
];

impl Check<'_> {
    /// Checks that the stated units make one set.
    pub(super) fn unit_names(&mut self) {
        if let Some(Err(error)) = self.deck.units.as_ref().map(crate::UnitsDeck::set) {
            let help = "give `length`, `force` (or `mass`) and `time` of one set, for example \
                        `units: {length: m, force: kN, time: s}`";
            self.error("D090", "/units", error.to_string(), help);
        }
    }

    /// Warns of stiffness, density and gravity that do not fit one system of units.
    pub(super) fn units(&mut self) {
        self.friction_angles();
        let deck = self.deck;
        if let Some(stated) = &deck.units {
            if let Ok(units) = stated.set() {
                self.in_units(&units);
            }
            return;
        }
        self.metals();
        let mut checked: BTreeSet<&str> = BTreeSet::new();
        for load in &deck.loads {
            let Some(acceleration) = load.acceleration() else { continue };
            let gravity = acceleration.iter().map(|a| a * a).sum::<f64>().sqrt();
            let loaded =
                deck.bodies.iter().filter(|b| load.bodies().is_none_or(|names| names.contains(&b.name)));
            for body in loaded {
                let Some(material) = deck.materials.get(&body.material) else { continue };
                if !checked.insert(&body.material) {
                    continue;
                }
                let Some(young) = material.young() else { continue };
                let density = material.density().and_then(Expression::as_number).unwrap_or(0.0);
                if density > 0.0 && gravity > 0.0 {
                    self.units_of(&body.material, young, density, gravity, self.height(body));
                }
            }
        }
        if !checked.is_empty() {
            self.densities();
        }
    }

    /// Warns of metals whose stiffness is in MPa beside kg/m³.
    fn metals(&mut self) {
        let deck = self.deck;
        let used = deck.used_materials();
        for (name, material) in deck.materials.iter().filter(|(name, _)| used.contains(name.as_str())) {
            let density = material.density().and_then(Expression::as_number);
            let (Some(young), Some(density)) = (material.young(), density) else { continue };
            let is = |[least, most]: [f64; 2], value: f64| least <= value && value <= most;
            let found =
                METALS.iter().find(|(_, moduli, densities)| is(*moduli, young) && is(*densities, density));
            if let Some((metal, _, _)) = found {
                let message = format!(
                    "the units look mixed: Young's modulus {young:e} of the material {} is that of {metal} in MPa, but \
                     its density {density} that in kg/m³, which requires Pa; sound would travel at {} m/s",
                    quote(name),
                    about((young / density).sqrt())
                );
                let help = format!(
                    "write `young: {:e}` with m, kg, N and Pa, or `density: {:e}` with mm, t, N and MPa (and all \
                     lengths in mm)",
                    young * 1e6,
                    density * 1e-12
                );
                self.warn("D040", &format!("/materials/{}/young", escape(name)), message, &help);
            }
        }
    }

    /// Compares stiffness, density and gravity with the units that the deck states.
    fn in_units(&mut self, units: &Units) {
        let deck = self.deck;
        for (index, load) in deck.loads.iter().enumerate() {
            let Some(acceleration) = load.acceleration() else { continue };
            let size = acceleration.iter().map(|a| a * a).sum::<f64>().sqrt();
            let Some(gravity) = units.in_metres_per_second_squared(size) else { continue };
            if size > 0.0 && !PLAUSIBLE_GRAVITY.contains(&gravity) {
                let unit = units.acceleration();
                let message = format!(
                    "in the units of the deck, gravity is {size} {unit}, which is {} m/s²",
                    about(gravity)
                );
                let help = format!("on the earth it is {} {unit}", about(GRAVITY / gravity * size));
                self.warn("D040", &format!("/loads/{index}/acceleration"), message, &help);
            }
        }
        let used = deck.used_materials();
        for (name, material) in deck.materials.iter().filter(|(name, _)| used.contains(name.as_str())) {
            let stated = material.density().and_then(Expression::as_number).filter(|density| *density > 0.0);
            let density = stated.and_then(|density| units.in_kilograms_per_cubic_metre(density));
            let young = material.young().and_then(|young| Some((young, units.in_pascals(young)?)));
            if let (Some(stated), Some(density)) = (stated, density)
                && !PLAUSIBLE_DENSITY.contains(&density)
            {
                let unit = units.density();
                let message = format!(
                    "in the units of the deck, the density of the material {} is {stated} {unit}, which is {} kg/m³",
                    quote(name),
                    about(density)
                );
                let help = format!("water has {} {unit}", about(WATER / density * stated));
                self.warn("D040", &format!("/materials/{}/density", escape(name)), message, &help);
            } else if let (Some((young, pascals)), Some(density)) = (young, density) {
                let speed = (pascals / density).sqrt();
                let is_soft_metal = density > LIGHTEST_METAL && pascals < SOFTEST_METAL;
                if speed > FASTEST || is_soft_metal {
                    let message = format!(
                        "in the units of the deck, Young's modulus of the material {} is {young:e} {}, which is {} MPa; \
                         with its density, sound would travel at {} m/s",
                        quote(name),
                        units.stress(),
                        about(pascals * 1e-6),
                        about(speed)
                    );
                    let help = "give all values in the units that `units` states";
                    self.warn("D040", &format!("/materials/{}/young", escape(name)), message, help);
                }
            }
        }
    }

    /// Warns of friction angles that are probably in radians.
    fn friction_angles(&mut self) {
        let deck = self.deck;
        let used = deck.used_materials();
        for (name, material) in deck.materials.iter().filter(|(name, _)| used.contains(name.as_str())) {
            let mut properties = material.properties().into_iter();
            let angle = properties.find(|(key, _)| key == "friction_angle");
            let Some(angle) = angle.and_then(|(_, given)| given.as_number()) else { continue };
            if angle > 0.0 && angle < MIN_FRICTION {
                let message = format!(
                    "the friction angle {angle} of the material {} is read as degrees, but looks like radians",
                    quote(name)
                );
                let help = format!(
                    "if {angle} is in radians, write {}, the same angle in degrees",
                    about(angle.to_degrees())
                );
                self.warn("D040", &format!("/materials/{}/friction_angle", escape(name)), message, &help);
            }
        }
    }

    /// Largest extent of a body, or of the grid if that of the body is unknown; 1 if both are unknown, [length].
    fn height(&self, body: &BodyDeck) -> f64 {
        let extent = self.bounds("", &body.shape).ok().or(match &self.deck.grid {
            GridDeck::Structured { origin, size, .. } => {
                let max = origin.iter().zip(size).map(|(low, side)| low + side).collect();
                Some(Extent { min: origin.clone(), max })
            }
            GridDeck::Gmsh { .. } => None,
        });
        let largest = |extent: Extent| {
            (0..extent.min.len()).map(|d| extent.side(d)).filter(|side| side.is_finite()).fold(0.0, f64::max)
        };
        extent.map_or(1.0, largest)
    }

    fn units_of(&mut self, name: &str, young: f64, density: f64, gravity: f64, height: f64) {
        let at = format!("/materials/{}/density", escape(name));
        let in_metres = GRAVITY_IN_METRES.contains(&gravity);
        let speed = (young / density).sqrt();
        let strain = density * gravity * height / young;
        let values = format!("density {density} with gravity {gravity} and Young's modulus {young:e}");
        let material = quote(name);
        let help = "give all values in one system of units, for example m, kg, N, Pa or m, t, kN, kPa";
        if in_metres && speed > FASTEST {
            let message = format!(
                "the units look mixed: {values} imply a wave speed of {} km/s in the material {material}, \
                 faster than in any solid",
                about(speed / 1e3)
            );
            self.warn("D040", &at, message, help);
        } else if in_metres && density <= DENSEST_IN_TONNES && strain < HARDLY_STRAINED {
            let message = format!(
                "the units look mixed: {values}; the density of the material {material} looks like t/m³, which \
                 requires kPa, but a body of this size would then strain under its own weight by only {strain:.0e}"
            );
            self.warn("D040", &at, message, help);
        } else if strain > CRUSHED {
            let message = format!(
                "the units look mixed: {values} imply a strain of {strain:.0e} in a body of this size under its \
                 own weight, more than the material {material} can sustain"
            );
            self.warn("D040", &at, message, help);
        }
    }

    /// Warns of solids whose densities differ as much as kilograms and tonnes.
    fn densities(&mut self) {
        let used: BTreeSet<&str> = self.deck.bodies.iter().map(|body| body.material.as_str()).collect();
        let densities: Vec<(&str, f64)> = (self.deck.materials.iter())
            .filter(|(name, _)| used.contains(name.as_str()))
            .filter_map(|(name, material)| {
                let density = material.density().and_then(Expression::as_number);
                Some((name.as_str(), density.filter(|rho| *rho > 0.0)?))
            })
            .collect();
        let least = densities.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let most = densities.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some((light, least)), Some((heavy, most))) = (least, most)
            && most / least >= DENSITIES_APART
        {
            let message = format!(
                "the units look mixed: the density {most} of the material {} is {} times that of the material {}",
                quote(heavy),
                about(most / least),
                quote(light)
            );
            let help = "give all densities in the same unit";
            self.warn("D040", &format!("/materials/{}/density", escape(heavy)), message, help);
        }
    }
}

/// A number with three significant digits, in scientific notation if it is very large or very small.
fn about(number: f64) -> String {
    Parameter::Number(format!("{number:.2e}").parse().unwrap_or(number)).to_string()
}
