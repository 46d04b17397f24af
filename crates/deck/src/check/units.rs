//! Units that look mixed: stiffness, density and gravity that do not fit one system.

use std::collections::BTreeSet;

use super::Check;
use super::extent::Extent;
use crate::quoting::quote;
use crate::span::escape;
use crate::{BodyDeck, Expression, GridDeck, Parameter};

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

impl Check<'_> {
    /// Warns of stiffness, density and gravity that do not fit one system of units.
    pub(super) fn units(&mut self) {
        self.friction_angles();
        let deck = self.deck;
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
