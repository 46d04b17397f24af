//! The built-in laws, each from its properties.

use super::built_law::BuiltLaw;
use super::consistency::Inconsistency;
use super::property::Setting;
use super::reading::{Decay, Faults, FrictionSettings, Reading};
use super::{CohesionSofteningDeck, FrictionSofteningDeck, MaterialDeck};
use crate::Expression;
use crate::formulas::Fault;
use crate::quoting::list;
use mpm_core::formula::FormulaError;
use mpm_core::material::{
    CamClay, DruckerPrager, Friction, Hencky, Match, ModifiedCamClay, MohrCoulomb, NeoHookean,
    StrengthMeasure, Tresca, VonMises, least_softening_strain,
};

/// The law of a material.
///
/// # Errors
/// The faults of its formulas.
pub(super) fn of(material: &MaterialDeck, read: Reading) -> Result<BuiltLaw, Faults> {
    match material {
        MaterialDeck::Hencky { young, poisson, .. } => hencky(read, [young, poisson]),
        MaterialDeck::NeoHookean { young, poisson, .. } => neo_hookean(read, [young, poisson]),
        MaterialDeck::VonMises {
            young,
            poisson,
            deviatoric_yield_stress,
            yield_stress,
            undrained_strength,
            hardening_modulus,
            ..
        } => {
            let strengths = [deviatoric_yield_stress, yield_stress, undrained_strength];
            von_mises(read, [young, poisson], strengths, hardening_modulus)
        }
        MaterialDeck::Tresca { young, poisson, cohesion, strength, softening, .. } => {
            tresca(read, [young, poisson], cohesion, *strength, softening.as_ref())
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
        } => mohr_coulomb(
            read,
            [young, poisson],
            [cohesion, friction_angle, dilation_angle],
            tensile_strength.as_ref(),
            *strength,
            softening.as_ref(),
        ),
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
            let angles = [cohesion, friction_angle, dilation_angle];
            drucker_prager(read, [young, poisson], angles, *matched, *strength)
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
            let given = [
                compression_index,
                swelling_index,
                critical_state_ratio,
                shear_modulus,
                shear_modulus_ratio,
                overconsolidation_ratio,
                reference_pressure,
            ];
            modified_cam_clay(read, given)
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

/// The check of a law whose properties never contradict each other.
fn consistent(_: &[f64]) -> Option<Inconsistency> {
    None
}

fn hencky(mut read: Reading, elasticity: [&Expression; 2]) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    read.finish(move |p| Hencky::new(young.at(p), poisson.at(p)), consistent)
}

fn neo_hookean(mut read: Reading, elasticity: [&Expression; 2]) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    read.finish(move |p| NeoHookean::new(young.at(p), poisson.at(p)), consistent)
}

/// The von Mises law; `strengths` holds the deviatoric yield stress, the yield stress in tension and the undrained
/// strength, exactly one of which must be stated.
fn von_mises(
    mut read: Reading,
    elasticity: [&Expression; 2],
    strengths: [&Option<Expression>; 3],
    hardening_modulus: &Expression,
) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    // Each key, with the ratio of the radius of the yield surface to the stress that the key states.
    let keys = [
        ("deviatoric_yield_stress", 1.0),
        ("yield_stress", (2.0f64 / 3.0).sqrt()),
        ("undrained_strength", std::f64::consts::SQRT_2),
    ];
    let mut stated = Vec::new();
    let (mut strength, mut scale) = (Setting::Constant(f64::NAN), 1.0);
    for ((key, scale_of_key), value) in keys.into_iter().zip(strengths) {
        if let Some(value) = value {
            stated.push(key);
            (strength, scale) = (read.get(key, "stress", value), scale_of_key);
        }
    }
    let hardening = read.get("hardening_modulus", "stress", hardening_modulus);
    read.finish(
        move |p| VonMises::new(young.at(p), poisson.at(p), scale * strength.at(p)).hardening(hardening.at(p)),
        move |_| one_strength(&stated),
    )
}

fn tresca(
    mut read: Reading,
    elasticity: [&Expression; 2],
    cohesion: &Expression,
    measure: StrengthMeasure,
    softening: Option<&CohesionSofteningDeck>,
) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    let cohesion = read.get("cohesion", "stress", cohesion);
    let softening = softening.map(|given| read.cohesion_softening(given, cohesion));
    let steep = move |p: &[f64]| {
        let (residual, decay) = softening.as_ref()?;
        let [peak, residual] = [cohesion, *residual].map(|cohesion| Friction {
            cohesion: cohesion.at(p),
            friction_angle: 0.0,
            dilation_angle: 0.0,
        });
        too_steep(decay, p, [young.at(p), poisson.at(p)], [peak, residual])
    };
    let law = move |p: &[f64]| {
        let law = Tresca::new(young.at(p), poisson.at(p), cohesion.at(p)).limiting(measure);
        match &softening {
            Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
            None => law,
        }
    };
    read.finish(law, steep)
}

/// The Mohr-Coulomb law; `strength` holds the cohesion, the friction angle and the dilation angle.
fn mohr_coulomb(
    mut read: Reading,
    elasticity: [&Expression; 2],
    strength: [&Expression; 3],
    tensile_strength: Option<&Expression>,
    measure: StrengthMeasure,
    softening: Option<&FrictionSofteningDeck>,
) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    let friction = read.friction(strength);
    let tensile = tensile_strength.map(|tensile| read.get("tensile_strength", "stress", tensile));
    let softening = softening.map(|given| read.friction_softening(given, &friction));
    let law = move |p: &[f64]| {
        let law = MohrCoulomb::new(young.at(p), poisson.at(p), friction.at(p)).limiting(measure);
        let law = tensile.map_or(law.clone(), |tensile| law.tensile_strength(tensile.at(p)));
        match &softening {
            Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
            None => law,
        }
    };
    let steep = move |p: &[f64]| {
        let (residual, decay): &(FrictionSettings, Decay) = softening.as_ref()?;
        too_steep(decay, p, [young.at(p), poisson.at(p)], [friction.at(p), residual.at(p)])
    };
    read.finish(law, move |p| friction.without_strength(p).or_else(|| steep(p)))
}

/// The Drucker-Prager law; `strength` holds the cohesion, the friction angle and the dilation angle.
fn drucker_prager(
    mut read: Reading,
    elasticity: [&Expression; 2],
    strength: [&Expression; 3],
    matched: Match,
    measure: StrengthMeasure,
) -> Result<BuiltLaw, Faults> {
    let [young, poisson] = read.elasticity(elasticity);
    let friction = read.friction(strength);
    read.finish(
        move |p| DruckerPrager::new(young.at(p), poisson.at(p), friction.at(p), matched).limiting(measure),
        move |p| friction.without_strength(p),
    )
}

/// Modified Cam-clay; `given` holds the properties of [`CamClay`], in order.
fn modified_cam_clay(mut read: Reading, given: [&Expression; 7]) -> Result<BuiltLaw, Faults> {
    let [compression, swelling, ratio, shear, growth, overconsolidation, reference] = given;
    let compression = read.get("compression_index", "-", compression);
    let swelling = read.get("swelling_index", "-", swelling);
    let ratio = read.get("critical_state_ratio", "-", ratio);
    let shear = read.get("shear_modulus", "stress", shear);
    let growth = read.get("shear_modulus_ratio", "-", growth);
    let overconsolidation = read.get("overconsolidation_ratio", "-", overconsolidation);
    let reference = read.get("reference_pressure", "stress", reference);
    read.below(("swelling_index", swelling), ("compression_index", compression));
    let clay = move |p: &[f64]| CamClay {
        compression_index: compression.at(p),
        swelling_index: swelling.at(p),
        critical_state_ratio: ratio.at(p),
        shear_modulus: shear.at(p),
        shear_modulus_ratio: growth.at(p),
        overconsolidation_ratio: overconsolidation.at(p),
        reference_pressure: reference.at(p),
    };
    let law = move |p: &[f64]| ModifiedCamClay::new(clay(p));
    let soft = move |p: &[f64]| {
        let (most, needed) = (clay(p).largest_stress_ratio(), ratio.at(p));
        if shear.at(p) > 0.0 && !clay(p).carries_critical_state() {
            let message =
                "the shear modulus depends too strongly on the pressure: the elastic law cannot reach the \
                           critical state"
                    .to_owned();
            let help = "give `shear_modulus` alone, or a larger `shear_modulus` or `shear_modulus_ratio`";
            return Inconsistency::new("shear_modulus_ratio", message, help);
        }
        if shear.at(p) > 0.0 || most > needed {
            return None;
        }
        if growth.at(p) > 0.0 {
            let message = format!(
                "the elastic law reaches at most q/p = sqrt(1.5 shear_modulus_ratio swelling_index) = {most:.4}, but \
                 the critical state needs {needed:.4}"
            );
            let least = needed * needed / (1.5 * swelling.at(p));
            let help = format!("give more than {least:.4}, or `shear_modulus` instead");
            return Inconsistency::new("shear_modulus_ratio", message, &help);
        }
        let message = "the material has no stiffness in shear".to_owned();
        Inconsistency::new("shear_modulus", message, "give `shear_modulus` or `shear_modulus_ratio`")
    };
    read.finish(law, soft)
}

/// Exactly one key must state the von Mises strength.
fn one_strength(stated: &[&str]) -> Option<Inconsistency> {
    let help = "give exactly one of `deviatoric_yield_stress`, `yield_stress` and `undrained_strength`";
    match stated {
        [_] => None,
        [] => Inconsistency::new("", "no key states its strength".to_owned(), help),
        [.., last] => {
            let keys = list(stated.iter().copied());
            Inconsistency::new(last, format!("{keys} state its strength more than once"), help)
        }
    }
}

/// Finds a softening strain so small that an unconfined point loses strength faster than its elastic stress can fall.
/// `elasticity` holds Young's modulus and Poisson's ratio, `strength` the peak and the residual strength.
fn too_steep(
    decay: &Decay,
    properties: &[f64],
    elasticity: [f64; 2],
    strength: [Friction; 2],
) -> Option<Inconsistency> {
    let strain = decay.known_strain(properties)?;
    let least = least_softening_strain(elasticity, strength);
    if strain > least {
        return None;
    }
    let message = format!(
        "the strength falls faster than the elastic stress can: the softening strain is {strain:.3e} in the cells of the \
         grid, and must exceed {least:.3e}"
    );
    let help = "use a larger `strain` or `band`, smaller cells, or a stiffer material";
    Inconsistency::new("softening/strain", message, help)
}
