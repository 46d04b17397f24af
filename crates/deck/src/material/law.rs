//! From the properties of a material to its law.

use std::collections::BTreeMap;

use super::cell_size::CellSize;
use super::consistency::{AtMost, Consistency, Inconsistency};
use super::property::{Setting, Settings, Varying as VaryingProperty};
use super::{CohesionSofteningDeck, FrictionSofteningDeck, MaterialDeck};
use crate::formulas::Fault;
use crate::{Expression, Parameter};
use mpm_core::formula::FormulaError;
use mpm_core::material::{
    CamClay, DruckerPrager, Friction, Hencky, Material, ModifiedCamClay, MohrCoulomb, NeoHookean, Softening,
    Tresca, Varying, VonMises,
};

/// The law of a material.
pub struct BuiltLaw {
    /// The law.
    pub law: Box<dyn Material>,
    /// Its properties that vary in space; they are its last history variables, in this order.
    pub varying: Vec<VaryingProperty>,
    /// Finds contradictions of properties at a point with these varying ones.
    pub consistency: Consistency,
}

impl BuiltLaw {
    /// A law without varying properties.
    pub fn constant(law: Box<dyn Material>) -> BuiltLaw {
        BuiltLaw { law, varying: Vec::new(), consistency: Box::new(|_| None) }
    }
}

/// What the properties of a material may refer to.
#[derive(Debug, Clone, Default)]
pub struct Surroundings<'a> {
    /// Parameters of the deck.
    pub parameters: Option<&'a BTreeMap<String, Parameter>>,
    /// Number of axes.
    pub dimensions: usize,
    /// A position in a body of the material.
    pub typical: [f64; 3],
    /// Size of the cells.
    pub cells: CellSize,
}

/// The parts of a law, once its properties are read.
struct Read<'a> {
    settings: Settings<'a>,
    limits: Vec<AtMost>,
}

impl Read<'_> {
    fn get(&mut self, key: &str, unit: &'static str, given: &Expression) -> Setting {
        self.settings.read(key, unit, given)
    }

    fn elasticity(&mut self, young: &Expression, poisson: &Expression) -> [Setting; 2] {
        [self.get("young", "stress", young), self.get("poisson", "-", poisson)]
    }

    fn at_most(&mut self, key: &'static str, value: Setting, of: &'static str, most: Setting) {
        self.limits.push(AtMost { key, value, of, most, strictly: false });
    }

    /// Cohesion and angles.
    fn friction(&mut self, given: [&Expression; 3]) -> FrictionSettings {
        let [cohesion, friction_angle, dilation_angle] = given;
        let friction = FrictionSettings {
            cohesion: self.get("cohesion", "stress", cohesion),
            friction_angle: self.get("friction_angle", "degrees", friction_angle),
            dilation_angle: self.get("dilation_angle", "degrees", dilation_angle),
        };
        self.at_most("dilation_angle", friction.dilation_angle, "friction_angle", friction.friction_angle);
        friction
    }

    /// Residual strength, with κ₉₅ and the size of the cells if it is adapted to them.
    fn friction_softening(
        &mut self,
        given: &FrictionSofteningDeck,
        peak: &FrictionSettings,
        cells: &CellSize,
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
        (residual, self.decay(strain, given.band, cells))
    }

    fn cohesion_softening(
        &mut self,
        given: &CohesionSofteningDeck,
        cohesion: Setting,
        cells: &CellSize,
    ) -> (Setting, Decay) {
        let residual = self.get("softening/residual_cohesion", "stress", &given.residual_cohesion);
        self.at_most("softening/residual_cohesion", residual, "cohesion", cohesion);
        let strain = self.get("softening/strain", "-", &given.strain);
        (residual, self.decay(strain, given.band, cells))
    }

    fn decay(&mut self, strain: Setting, band: Option<f64>, cells: &CellSize) -> Decay {
        let band = band.and_then(|band| Some((band, self.settings.cell_size(cells)?)));
        Decay { strain, band }
    }

    /// The law of the settings that have been read.
    fn finish<L: Material + Clone + 'static>(
        self,
        law: impl Fn(&[f64]) -> L + Send + Sync + 'static,
        further: impl Fn(&[f64]) -> Option<Inconsistency> + Send + Sync + 'static,
    ) -> BuiltLaw {
        let Read { settings, limits } = self;
        let (varying, properties, at) = settings.finish();
        let law: Box<dyn Material> = if varying.is_empty() {
            Box::new(law(&[]))
        } else {
            Box::new(Varying::new(&properties, at, law))
        };
        let consistency: Consistency = Box::new(move |properties| {
            limits.iter().find_map(|limit| limit.check(properties)).or_else(|| further(properties))
        });
        BuiltLaw { law, varying, consistency }
    }
}

/// Settings of [`Friction`].
#[derive(Debug, Clone, Copy)]
struct FrictionSettings {
    cohesion: Setting,
    friction_angle: Setting,
    dilation_angle: Setting,
}

impl FrictionSettings {
    fn at(&self, properties: &[f64]) -> Friction {
        Friction {
            cohesion: self.cohesion.at(properties),
            friction_angle: self.friction_angle.at(properties),
            dilation_angle: self.dilation_angle.at(properties),
        }
    }

    fn without_strength(&self, properties: &[f64]) -> Option<Inconsistency> {
        let Friction { cohesion, friction_angle, .. } = self.at(properties);
        if cohesion > 0.0 || friction_angle > 0.0 {
            return None;
        }
        let message = "the material has neither cohesion nor friction, and so no strength".to_owned();
        Inconsistency::new("cohesion", message, "use a cohesion or a friction angle above 0")
    }
}

/// κ₉₅, and the width of the band with the size of the cells.
#[derive(Debug, Clone, Copy)]
struct Decay {
    strain: Setting,
    band: Option<(f64, Setting)>,
}

impl Decay {
    /// κ₉₅ in the cells of a point, [-].
    fn strain(&self, properties: &[f64]) -> f64 {
        let scale = self.band.map_or(1.0, |(band, size)| band / size.at(properties));
        self.strain.at(properties) * scale
    }

    fn at(&self, properties: &[f64]) -> Softening {
        Softening::over(self.strain(properties))
    }
}

impl MaterialDeck {
    /// The first property out of its range, or the first contradiction, where the varying properties have these values.
    pub fn fault_at(&self, built: &BuiltLaw, properties: &[f64]) -> Option<String> {
        for (varying, value) in built.varying.iter().zip(properties) {
            let range = self.range(&varying.key);
            if !range.contains(*value) {
                return Some(format!("`{}` is {value}; it must be {}", varying.key, range.in_words()));
            }
        }
        (built.consistency)(properties).map(|found| found.message)
    }

    /// The law of the material on its own: its properties must not vary.
    ///
    /// # Errors
    /// The first fault or contradiction.
    pub fn law_alone(&self) -> Result<Box<dyn Material>, String> {
        let first = |faults: Vec<Fault>| {
            let text = |fault: Fault| format!("`{}`: {}", fault.key, fault.error.message);
            faults.into_iter().next().map(text).unwrap_or_default()
        };
        let built = self.law(&Surroundings::default()).map_err(first)?;
        match (built.consistency)(&[]) {
            None => Ok(built.law),
            Some(found) => Err(found.message),
        }
    }

    /// The law of the material.
    ///
    /// # Errors
    /// The faults of its formulas.
    pub fn law(&self, surroundings: &Surroundings) -> Result<BuiltLaw, Vec<Fault>> {
        let none = BTreeMap::new();
        let Surroundings { parameters, dimensions, typical, cells } = surroundings;
        let settings = Settings::new(parameters.unwrap_or(&none), *dimensions, *typical);
        let mut read = Read { settings, limits: Vec::new() };
        let consistent = |_: &[f64]| None;
        // Each arm reads all its properties first, so that all faults are found.
        macro_rules! built {
            ($law:expr, $further:expr) => {{
                if !read.settings.faults.is_empty() {
                    return Err(read.settings.faults);
                }
                Ok(read.finish($law, $further))
            }};
        }
        match self {
            MaterialDeck::Hencky { young, poisson, .. } => {
                let [young, poisson] = read.elasticity(young, poisson);
                built!(move |p| Hencky::new(young.at(p), poisson.at(p)), consistent)
            }
            MaterialDeck::NeoHookean { young, poisson, .. } => {
                let [young, poisson] = read.elasticity(young, poisson);
                built!(move |p| NeoHookean::new(young.at(p), poisson.at(p)), consistent)
            }
            MaterialDeck::VonMises {
                young,
                poisson,
                deviatoric_yield_stress,
                yield_stress,
                undrained_strength,
                hardening_modulus,
                ..
            } => {
                let [young, poisson] = read.elasticity(young, poisson);
                // The radius of the yield surface over the stress that the key states.
                let given = [
                    ("deviatoric_yield_stress", deviatoric_yield_stress, 1.0),
                    ("yield_stress", yield_stress, (2.0f64 / 3.0).sqrt()),
                    ("undrained_strength", undrained_strength, std::f64::consts::SQRT_2),
                ];
                let mut stated = Vec::new();
                let (mut strength, mut scale) = (Setting::Constant(f64::NAN), 1.0);
                for (key, value, scale_of_key) in given {
                    if let Some(value) = value {
                        stated.push(key);
                        (strength, scale) = (read.get(key, "stress", value), scale_of_key);
                    }
                }
                let hardening = read.get("hardening_modulus", "stress", hardening_modulus);
                built!(
                    move |p| VonMises::new(young.at(p), poisson.at(p), scale * strength.at(p))
                        .hardening(hardening.at(p)),
                    move |_| one_strength(&stated)
                )
            }
            MaterialDeck::Tresca { young, poisson, cohesion, strength, softening, .. } => {
                let [young, poisson] = read.elasticity(young, poisson);
                let cohesion = read.get("cohesion", "stress", cohesion);
                let measure = *strength;
                let softening =
                    softening.as_ref().map(|given| read.cohesion_softening(given, cohesion, cells));
                let steep = move |p: &[f64]| {
                    let (residual, decay) = softening.as_ref()?;
                    let shear = young.at(p) / (2.0 * (1.0 + poisson.at(p)));
                    let least = 3f64.sqrt() * (cohesion.at(p) - residual.at(p)) / shear;
                    too_steep(decay.strain(p), least)
                };
                built!(
                    move |p| {
                        let law = Tresca::new(young.at(p), poisson.at(p), cohesion.at(p)).limiting(measure);
                        match &softening {
                            Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
                            None => law,
                        }
                    },
                    steep
                )
            }
            MaterialDeck::MohrCoulomb {
                young,
                poisson,
                cohesion,
                friction_angle,
                dilation_angle,
                tensile_strength,
                strength,
                softening,
                ..
            } => {
                let [young, poisson] = read.elasticity(young, poisson);
                let friction = read.friction([cohesion, friction_angle, dilation_angle]);
                let tensile = tensile_strength.as_ref().map(|t| read.get("tensile_strength", "stress", t));
                let measure = *strength;
                let softening =
                    softening.as_ref().map(|given| read.friction_softening(given, &friction, cells));
                built!(
                    move |p| {
                        let law =
                            MohrCoulomb::new(young.at(p), poisson.at(p), friction.at(p)).limiting(measure);
                        let law = tensile.map_or(law.clone(), |tensile| law.tensile_strength(tensile.at(p)));
                        match &softening {
                            Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
                            None => law,
                        }
                    },
                    move |p| friction.without_strength(p)
                )
            }
            MaterialDeck::DruckerPrager {
                young,
                poisson,
                cohesion,
                friction_angle,
                dilation_angle,
                matched,
                strength,
                ..
            } => {
                let [young, poisson] = read.elasticity(young, poisson);
                let friction = read.friction([cohesion, friction_angle, dilation_angle]);
                let (matched, measure) = (*matched, *strength);
                built!(
                    move |p| {
                        DruckerPrager::new(young.at(p), poisson.at(p), friction.at(p), matched)
                            .limiting(measure)
                    },
                    move |p| friction.without_strength(p)
                )
            }
            MaterialDeck::ModifiedCamClay {
                compression_index,
                swelling_index,
                critical_state_ratio,
                shear_modulus,
                shear_modulus_ratio,
                overconsolidation_ratio,
                reference_pressure,
                ..
            } => {
                let compression = read.get("compression_index", "-", compression_index);
                let swelling = read.get("swelling_index", "-", swelling_index);
                let ratio = read.get("critical_state_ratio", "-", critical_state_ratio);
                let shear = read.get("shear_modulus", "stress", shear_modulus);
                let growth = read.get("shear_modulus_ratio", "-", shear_modulus_ratio);
                let overconsolidation = read.get("overconsolidation_ratio", "-", overconsolidation_ratio);
                let reference = read.get("reference_pressure", "stress", reference_pressure);
                read.limits.push(AtMost {
                    key: "swelling_index",
                    value: swelling,
                    of: "compression_index",
                    most: compression,
                    strictly: true,
                });
                let law = move |p: &[f64]| {
                    ModifiedCamClay::new(CamClay {
                        compression_index: compression.at(p),
                        swelling_index: swelling.at(p),
                        critical_state_ratio: ratio.at(p),
                        shear_modulus: shear.at(p),
                        shear_modulus_ratio: growth.at(p),
                        overconsolidation_ratio: overconsolidation.at(p),
                        reference_pressure: reference.at(p),
                    })
                };
                let soft = move |p: &[f64]| {
                    if shear.at(p) > 0.0 || growth.at(p) > 0.0 {
                        return None;
                    }
                    let message = "the material has no stiffness in shear".to_owned();
                    Inconsistency::new(
                        "shear_modulus",
                        message,
                        "give `shear_modulus` or `shear_modulus_ratio`",
                    )
                };
                built!(law, soft)
            }
            // The deck that names a library loads it.
            MaterialDeck::Library { file, .. } => Err(vec![Fault {
                key: "file".to_owned(),
                text: file.clone(),
                error: FormulaError {
                    message: "only a deck can load the law of a library".to_owned(),
                    offset: 0,
                    length: 0,
                    help: None,
                },
            }]),
        }
    }
}

/// The strength of von Mises must be stated by one key.
fn one_strength(stated: &[&str]) -> Option<Inconsistency> {
    let help = "give exactly one of `deviatoric_yield_stress`, `yield_stress` and `undrained_strength`";
    match stated {
        [_] => None,
        [] => Inconsistency::new("", "no key states its strength".to_owned(), help),
        [.., last] => {
            let keys: Vec<String> = stated.iter().map(|key| format!("`{key}`")).collect();
            Inconsistency::new(
                last,
                format!("{} state its strength more than once", keys.join(" and ")),
                help,
            )
        }
    }
}

/// A strain of softening below that at which a point loses strength faster than its elastic stress can fall.
fn too_steep(strain: f64, least: f64) -> Option<Inconsistency> {
    if strain > least {
        return None;
    }
    let message = format!(
        "the strength falls faster than the elastic stress can: the softening strain is {strain:.3e} in the cells of the \
         grid, and must exceed √3 (s_p − s_r)/G = {least:.3e}"
    );
    let help = "use a larger `strain` or `band`, smaller cells, or a stiffer material";
    Inconsistency::new("softening/strain", message, help)
}
