//! The properties of a material, read from their numbers and formulas.

use super::built_law::BuiltLaw;
use super::cell_size::CellSize;
use super::consistency::{AtMost, Consistency, Inconsistency};
use super::property::{Setting, Settings};
use super::{CohesionSofteningDeck, FrictionSofteningDeck};
use crate::Expression;
use crate::formulas::Fault;
use mpm_core::material::{Friction, Material, Softening, Varying};

/// The properties of a material that have been read, and the inequalities that they must satisfy.
pub(super) struct Reading<'a> {
    settings: Settings<'a>,
    limits: Vec<AtMost>,
    cells: &'a CellSize,
}

/// The faults of the formulas of a material.
pub(super) type Faults = Vec<Fault>;

impl<'a> Reading<'a> {
    /// Prepares to read the first property.
    pub(super) fn new(settings: Settings<'a>, cells: &'a CellSize) -> Self {
        Reading { settings, limits: Vec::new(), cells }
    }

    /// Reads a property.
    pub(super) fn get(&mut self, key: &str, unit: &'static str, given: &Expression) -> Setting {
        self.settings.read(key, unit, given)
    }

    /// Reads Young's modulus and Poisson's ratio.
    pub(super) fn elasticity(&mut self, [young, poisson]: [&Expression; 2]) -> [Setting; 2] {
        [self.get("young", "stress", young), self.get("poisson", "-", poisson)]
    }

    /// Requires the first property to be below the second; each is given after its key.
    pub(super) fn below(
        &mut self,
        (key, value): (&'static str, Setting),
        (of, most): (&'static str, Setting),
    ) {
        self.limits.push(AtMost { key, value, of, most, strictly: true });
    }

    fn at_most(&mut self, key: &'static str, value: Setting, of: &'static str, most: Setting) {
        self.limits.push(AtMost { key, value, of, most, strictly: false });
    }

    /// Reads the cohesion and the angles.
    pub(super) fn friction(&mut self, given: [&Expression; 3]) -> FrictionSettings {
        let [cohesion, friction_angle, dilation_angle] = given;
        let friction = FrictionSettings {
            cohesion: self.get("cohesion", "stress", cohesion),
            friction_angle: self.get("friction_angle", "degrees", friction_angle),
            dilation_angle: self.get("dilation_angle", "degrees", dilation_angle),
        };
        self.at_most("dilation_angle", friction.dilation_angle, "friction_angle", friction.friction_angle);
        friction
    }

    /// Reads the residual strength and κ₉₅, with the cell size if κ₉₅ is adapted to it.
    pub(super) fn friction_softening(
        &mut self,
        given: &FrictionSofteningDeck,
        peak: &FrictionSettings,
    ) -> (FrictionSettings, Decay) {
        let residual = FrictionSettings {
            cohesion: self.get("softening/residual_cohesion", "stress", &given.residual_cohesion),
            friction_angle: self.get(
                "softening/residual_friction_angle",
                "degrees",
                &given.residual_friction_angle,
            ),
            dilation_angle: self.get(
                "softening/residual_dilation_angle",
                "degrees",
                &given.residual_dilation_angle,
            ),
        };
        self.at_most("softening/residual_cohesion", residual.cohesion, "cohesion", peak.cohesion);
        self.at_most(
            "softening/residual_friction_angle",
            residual.friction_angle,
            "friction_angle",
            peak.friction_angle,
        );
        self.at_most(
            "softening/residual_dilation_angle",
            residual.dilation_angle,
            "residual_friction_angle",
            residual.friction_angle,
        );
        let strain = self.get("softening/strain", "-", &given.strain);
        (residual, self.decay(strain, given.band))
    }

    pub(super) fn cohesion_softening(
        &mut self,
        given: &CohesionSofteningDeck,
        cohesion: Setting,
    ) -> (Setting, Decay) {
        let residual = self.get("softening/residual_cohesion", "stress", &given.residual_cohesion);
        self.at_most("softening/residual_cohesion", residual, "cohesion", cohesion);
        let strain = self.get("softening/strain", "-", &given.strain);
        (residual, self.decay(strain, given.band))
    }

    fn decay(&mut self, strain: Setting, band: Option<f64>) -> Decay {
        let cells = band.and_then(|_| self.settings.cell_size(self.cells));
        Decay { strain, band, cells }
    }

    /// The law with the settings that have been read; all settings must be read first, so that all faults are found.
    ///
    /// # Errors
    /// The faults of the formulas.
    pub(super) fn finish<L>(
        self,
        law: impl Fn(&[f64]) -> L + Send + Sync + 'static,
        further: impl Fn(&[f64]) -> Option<Inconsistency> + Send + Sync + 'static,
    ) -> Result<BuiltLaw, Faults>
    where
        L: Material + Clone + Into<Box<dyn Material>> + 'static,
    {
        let Reading { settings, limits, .. } = self;
        if !settings.faults.is_empty() {
            return Err(settings.faults);
        }
        let (varying, properties, at) = settings.finish();
        let law: Box<dyn Material> =
            if varying.is_empty() { law(&[]).into() } else { Box::new(Varying::new(&properties, at, law)) };
        let consistency: Consistency = Box::new(move |properties| {
            limits.iter().find_map(|limit| limit.check(properties)).or_else(|| further(properties))
        });
        Ok(BuiltLaw { law, varying, consistency })
    }
}

/// Settings of [`Friction`].
#[derive(Debug, Clone, Copy)]
pub(super) struct FrictionSettings {
    cohesion: Setting,
    friction_angle: Setting,
    dilation_angle: Setting,
}

impl FrictionSettings {
    pub(super) fn at(&self, properties: &[f64]) -> Friction {
        Friction {
            cohesion: self.cohesion.at(properties),
            friction_angle: self.friction_angle.at(properties),
            dilation_angle: self.dilation_angle.at(properties),
        }
    }

    pub(super) fn without_strength(&self, properties: &[f64]) -> Option<Inconsistency> {
        let Friction { cohesion, friction_angle, .. } = self.at(properties);
        if cohesion > 0.0 || friction_angle > 0.0 {
            return None;
        }
        let message = "the material has neither cohesion nor friction, and so no strength".to_owned();
        Inconsistency::new("cohesion", message, "use a cohesion or a friction angle above 0")
    }
}

/// κ₉₅, and how it is adapted to the cell size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Decay {
    strain: Setting,
    /// Width of the band, if it is stated, [length].
    band: Option<f64>,
    /// Size of the cells, if it is known, [length].
    cells: Option<Setting>,
}

impl Decay {
    /// κ₉₅ at a point, adapted to its cell, [-]; κ₉₅ as stated where the cell size is not known.
    fn strain(&self, properties: &[f64]) -> f64 {
        let scale = match (self.band, self.cells) {
            (Some(band), Some(size)) => band / size.at(properties),
            _ => 1.0,
        };
        self.strain.at(properties) * scale
    }

    /// κ₉₅ at a point, adapted to its cell, [-]; `None` if it depends on a cell size that is not known.
    pub(super) fn known_strain(&self, properties: &[f64]) -> Option<f64> {
        (self.band.is_none() || self.cells.is_some()).then(|| self.strain(properties))
    }

    pub(super) fn at(&self, properties: &[f64]) -> Softening {
        Softening::over(self.strain(properties))
    }
}
