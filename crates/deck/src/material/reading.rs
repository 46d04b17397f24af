//! The properties of a material, read from their numbers and formulas.

use super::cell_size::CellSize;
use super::consistency::{AtMost, Consistency, Inconsistency};
use super::property::{Setting, Settings};
use super::softening::Decay;
use super::stated_law::StatedLaw;
use crate::Expression;
use crate::formulas::Fault;
use mpm_core::material::{Friction, Material, Varying};

/// The properties of a material that have been read, and the inequalities that they must satisfy.
pub(crate) struct Reading<'a> {
    settings: Settings<'a>,
    limits: Vec<AtMost>,
    cells: &'a CellSize,
}

/// The faults of the formulas of a material.
pub(crate) type Faults = Vec<Fault>;

impl<'a> Reading<'a> {
    /// Prepares to read the first property.
    pub(super) fn new(settings: Settings<'a>, cells: &'a CellSize) -> Self {
        Reading { settings, limits: Vec::new(), cells }
    }

    /// Reads a property.
    pub(crate) fn get(&mut self, key: &str, unit: &'static str, given: &Expression) -> Setting {
        self.settings.read(key, unit, given)
    }

    /// Reads Young's modulus and Poisson's ratio.
    pub(crate) fn elasticity(&mut self, young: &Expression, poisson: &Expression) -> [Setting; 2] {
        [self.get("young", "stress", young), self.get("poisson", "-", poisson)]
    }

    /// Requires a property to be below the property `of`, whose value is `most`.
    pub(crate) fn below(&mut self, key: &'static str, value: Setting, of: &'static str, most: Setting) {
        self.limits.push(AtMost { key, value, of, most, strictly: true });
    }

    /// Requires a property not to exceed the property `of`, whose value is `most`.
    pub(crate) fn at_most(&mut self, key: &'static str, value: Setting, of: &'static str, most: Setting) {
        self.limits.push(AtMost { key, value, of, most, strictly: false });
    }

    /// Reads the cohesion and the angles.
    pub(crate) fn friction(
        &mut self,
        cohesion: &Expression,
        friction_angle: &Expression,
        dilation_angle: &Expression,
    ) -> FrictionSettings {
        let friction = FrictionSettings {
            cohesion: self.get("cohesion", "stress", cohesion),
            friction_angle: self.get("friction_angle", "degrees", friction_angle),
            dilation_angle: self.get("dilation_angle", "degrees", dilation_angle),
        };
        self.at_most("dilation_angle", friction.dilation_angle, "friction_angle", friction.friction_angle);
        friction
    }

    /// Adapts κ₉₅ to the cell size if a material softens over a band of this width, [length]; all formulas must already
    /// have been read.
    pub(crate) fn decay(&mut self, strain: Setting, band: Option<f64>) -> Decay {
        let cells = band.and_then(|_| self.settings.cell_size(self.cells));
        Decay { strain, band, cells }
    }

    /// The law with the settings that have been read; all settings must be read first, so that all faults are found.
    ///
    /// # Errors
    /// The faults of the formulas.
    pub(crate) fn finish<L>(
        self,
        law: impl Fn(&[f64]) -> L + Send + Sync + Clone + 'static,
        further: impl Fn(&[f64]) -> Option<Inconsistency> + Send + Sync + 'static,
    ) -> Result<StatedLaw, Faults>
    where
        L: Material + Clone + Into<Box<dyn Material>> + 'static,
    {
        let Reading { settings, limits, .. } = self;
        if !settings.faults.is_empty() {
            return Err(settings.faults);
        }
        let (varying, at) = settings.finish();
        let consistency: Consistency = Box::new(move |properties| {
            limits.iter().find_map(|limit| limit.check(properties)).or_else(|| further(properties))
        });
        if varying.is_empty() {
            return Ok(StatedLaw::new(varying, consistency, move |_| law(&[]).into()));
        }
        let given = varying.clone();
        Ok(StatedLaw::new(varying, consistency, move |typical| {
            let properties: Vec<_> =
                given.iter().zip(at(typical)).map(|(varying, value)| varying.typically(value)).collect();
            Box::new(Varying::new(&properties, at.clone(), law.clone()))
        }))
    }
}

/// Settings of [`Friction`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrictionSettings {
    pub(crate) cohesion: Setting,
    pub(crate) friction_angle: Setting,
    pub(crate) dilation_angle: Setting,
}

impl FrictionSettings {
    pub(crate) fn at(&self, properties: &[f64]) -> Friction {
        Friction {
            cohesion: self.cohesion.at(properties),
            friction_angle: self.friction_angle.at(properties),
            dilation_angle: self.dilation_angle.at(properties),
        }
    }

    pub(crate) fn without_strength(&self, properties: &[f64]) -> Option<Inconsistency> {
        let Friction { cohesion, friction_angle, .. } = self.at(properties);
        if cohesion > 0.0 || friction_angle > 0.0 {
            return None;
        }
        let message = "the material has neither cohesion nor friction, and so no strength".to_owned();
        Inconsistency::new("cohesion", message, "use a cohesion or a friction angle above 0")
    }
}
