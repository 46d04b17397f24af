//! The laws of a deck, each in a file of its own: its keys, how they are read, and what the deck asks of it.
//!
//! Another law needs its file, its `mod` line, a variant of [`MaterialDeck`] and an arm of [`MaterialDeck::law_deck`];
//! nothing else lists the laws.

mod drucker_prager;
mod hencky;
mod library;
mod modified_cam_clay;
mod mohr_coulomb;
mod neo_hookean;
mod tresca;
mod von_mises;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Expression;
use super::material::{Faults, Reading, StatedLaw};
use mpm_core::material::StrengthMeasure;

pub use drucker_prager::DruckerPragerDeck;
pub use hencky::HenckyDeck;
pub use library::{ALLOW_LIBRARIES, LibraryDeck, is_field_of_points, may_run_libraries};
pub(crate) use library::{NamedLibrary, remarks};
pub use modified_cam_clay::ModifiedCamClayDeck;
pub use mohr_coulomb::{FrictionSofteningDeck, MohrCoulombDeck};
pub use neo_hookean::NeoHookeanDeck;
pub use tresca::{CohesionSofteningDeck, TrescaDeck};
pub use von_mises::VonMisesDeck;

/// A constitutive law and its properties. Each number of a built-in law may also be a formula in X, Y (the original
/// position), in space also Z, and the parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case")]
#[allow(missing_docs, reason = "the mapping of each law describes it, here and in the schema")]
pub enum MaterialDeck {
    Hencky(HenckyDeck),
    NeoHookean(NeoHookeanDeck),
    VonMises(VonMisesDeck),
    Tresca(TrescaDeck),
    MohrCoulomb(MohrCoulombDeck),
    DruckerPrager(DruckerPragerDeck),
    ModifiedCamClay(ModifiedCamClayDeck),
    Library(LibraryDeck),
}

/// What a deck asks of each law.
pub(crate) trait LawDeck {
    /// Initial mass density, [mass/volume], if it is stated.
    fn density(&self) -> Option<&Expression>;

    /// Reads the properties of the law.
    ///
    /// # Errors
    /// The faults of their formulas.
    fn read(&self, read: Reading) -> Result<StatedLaw, Faults>;

    /// True if the material flows plastically at constant volume.
    fn flows_at_constant_volume(&self) -> bool {
        false
    }

    /// Dilation angle at the peak, [degrees], if it is a number; 0 for laws without one.
    fn dilation_angle(&self) -> f64 {
        0.0
    }

    /// True if the dilation angle equals the friction angle, both at the peak and after softening.
    fn is_associated(&self) -> bool {
        true
    }

    /// True if bodies of this material need an initial stress.
    fn needs_initial_stress(&self) -> bool {
        false
    }

    /// True if the material may yield, but has no strength that could be reduced.
    fn keeps_strength(&self) -> bool {
        false
    }

    /// Width of the shear band, [length]: `Some(None)` if it is not stated, `None` if the material does not soften.
    fn softening(&self) -> Option<Option<f64>> {
        None
    }

    /// The library of the law; `None` for built-in laws.
    fn library(&self) -> Option<&LibraryDeck> {
        None
    }
}

impl MaterialDeck {
    /// The law: the only match over the laws.
    pub(crate) fn law_deck(&self) -> &dyn LawDeck {
        match self {
            MaterialDeck::Hencky(law) => law,
            MaterialDeck::NeoHookean(law) => law,
            MaterialDeck::VonMises(law) => law,
            MaterialDeck::Tresca(law) => law,
            MaterialDeck::MohrCoulomb(law) => law,
            MaterialDeck::DruckerPrager(law) => law,
            MaterialDeck::ModifiedCamClay(law) => law,
            MaterialDeck::Library(law) => law,
        }
    }

    /// Young's modulus E, [stress], if the material has one that does not vary.
    pub fn young(&self) -> Option<f64> {
        self.number("young")
    }

    /// Poisson's ratio ν, [-], if the material has one that does not vary.
    pub fn poisson(&self) -> Option<f64> {
        self.number("poisson")
    }

    fn number(&self, key: &str) -> Option<f64> {
        let is_own = |(name, _): &(String, Expression)| name == key && self.library().is_none();
        self.properties().into_iter().find(is_own)?.1.as_number()
    }

    /// The density, if it is stated.
    pub fn density(&self) -> Option<&Expression> {
        self.law_deck().density()
    }

    /// True if the material flows plastically at constant volume.
    pub fn flows_at_constant_volume(&self) -> bool {
        self.law_deck().flows_at_constant_volume()
    }

    /// Dilation angle at the peak, [degrees], if it is a number; 0 for laws without one.
    pub fn dilation_angle(&self) -> f64 {
        self.law_deck().dilation_angle()
    }

    /// True if the dilation angle equals the friction angle, both at the peak and after softening. Otherwise, factors
    /// of safety depend on the cell size.
    pub fn is_associated(&self) -> bool {
        self.law_deck().is_associated()
    }

    /// Path of the library of the law, relative to the deck; `None` for built-in laws.
    pub fn library(&self) -> Option<&str> {
        self.law_deck().library().map(|library| library.file.as_str())
    }

    /// True if bodies of this material need an initial stress.
    pub fn needs_initial_stress(&self) -> bool {
        self.law_deck().needs_initial_stress()
    }

    /// Width of the shear band, [length]: `Some(None)` if it is not stated, `None` if the material does not soften.
    pub fn softening(&self) -> Option<Option<f64>> {
        self.law_deck().softening()
    }
}

fn zero() -> Expression {
    Expression::Number(0.0)
}

fn unity() -> Expression {
    Expression::Number(1.0)
}

fn cauchy() -> StrengthMeasure {
    StrengthMeasure::Cauchy
}
