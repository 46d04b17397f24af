//! The units of a run: names for the numbers of its results, and their sizes in SI.
//!
//! Nothing is converted: a deck has one consistent set of units, and states it so that results can be labelled.

use std::str::FromStr;

use serde_json::{Value, json};

/// Names of units and their sizes in SI.
type Named = &'static [(&'static str, f64)];

const LENGTHS: Named = &[
    ("m", 1.0),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("dm", 0.1),
    ("km", 1e3),
    ("um", 1e-6),
    ("µm", 1e-6),
    ("ft", 0.3048),
    ("in", 0.0254),
    ("yd", 0.9144),
];
const FORCES: Named = &[
    ("N", 1.0),
    ("kN", 1e3),
    ("MN", 1e6),
    ("GN", 1e9),
    ("mN", 1e-3),
    ("lbf", 4.448_221_615_260_5),
    ("kip", 4_448.221_615_260_5),
    ("kgf", 9.806_65),
    ("tf", 9_806.65),
];
const TIMES: Named = &[
    ("s", 1.0),
    ("ms", 1e-3),
    ("min", 60.0),
    ("h", 3600.0),
    ("d", 86_400.0),
    ("day", 86_400.0),
    ("a", 31_557_600.0),
    ("year", 31_557_600.0),
];
const MASSES: Named = &[
    ("kg", 1.0),
    ("g", 1e-3),
    ("t", 1e3),
    ("kt", 1e6),
    ("Mt", 1e9),
    ("lb", 0.453_592_37),
    ("slug", 14.593_902_937_206_4),
    ("blob", 175.126_835_246_477),
];
const STRESSES: Named = &[
    ("Pa", 1.0),
    ("kPa", 1e3),
    ("MPa", 1e6),
    ("GPa", 1e9),
    ("psi", 6_894.757_293_168_4),
    ("ksi", 6_894_757.293_168_4),
    ("psf", 47.880_258_980_336),
    ("ksf", 47_880.258_980_336),
];
const ENERGIES: Named = &[("J", 1.0), ("kJ", 1e3), ("MJ", 1e6), ("GJ", 1e9), ("mJ", 1e-3)];

/// Relative difference below which two sizes are the same unit.
const SAME: f64 = 1e-9;

/// The unit system of a deck.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Units {
    length: String,
    force: String,
    time: String,
}

/// Reason why names make no set of units.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnitsError {
    /// A name is empty or too long.
    #[error("`{0}` is not the name of a unit: give 1 to 8 characters")]
    Name(String),
    /// Neither a force nor a mass, or a mass whose force has no name.
    #[error("{0}")]
    Force(String),
    /// Force, mass, length and time contradict each other.
    #[error("the units contradict each other: 1 {force} is {factor} {mass}·{length}/{time}²")]
    Inconsistent {
        /// The force.
        force: String,
        /// The mass.
        mass: String,
        /// The length.
        length: String,
        /// The time.
        time: String,
        /// Size of the force in the unit that follows from the others.
        factor: f64,
    },
}

fn size(named: Named, name: &str) -> Option<f64> {
    named.iter().find(|(known, _)| *known == name).map(|(_, size)| *size)
}

/// The name of the unit of this size in SI.
fn name_of(named: Named, size: f64) -> Option<&'static str> {
    named.iter().find(|(_, other)| (size / other - 1.0).abs() < SAME).map(|(name, _)| *name)
}

impl FromStr for Units {
    type Err = String;

    /// Reads `LENGTH,FORCE,TIME`, for example `m,kN,s`.
    fn from_str(text: &str) -> Result<Units, String> {
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let [length, force, time] = parts[..] else {
            return Err("expected the units of length, force and time, for example m,kN,s".to_owned());
        };
        Units::new(length, Some(force), None, time)
            .map_err(|_| "expected the units of length, force and time, for example m,kN,s".to_owned())
    }
}

impl Units {
    /// A set of units from the names of length, force or mass, and time.
    ///
    /// # Errors
    /// [`UnitsError`] if the names do not make one set.
    pub fn new(
        length: &str,
        force: Option<&str>,
        mass: Option<&str>,
        time: &str,
    ) -> Result<Units, UnitsError> {
        let is_unit = |name: &&str| !name.is_empty() && name.chars().count() <= 8;
        for name in [Some(length), force, mass, Some(time)].into_iter().flatten() {
            if !is_unit(&name) {
                return Err(UnitsError::Name(name.to_owned()));
            }
        }
        let sizes = (size(LENGTHS, length), mass.and_then(|mass| size(MASSES, mass)), size(TIMES, time));
        let from_mass = match sizes {
            (Some(length), Some(mass), Some(time)) => Some(mass * length / (time * time)),
            _ => None,
        };
        let force = match (force, mass) {
            (Some(force), Some(mass)) => {
                if let (Some(stated), Some(derived)) = (size(FORCES, force), from_mass)
                    && (stated / derived - 1.0).abs() > SAME
                {
                    return Err(UnitsError::Inconsistent {
                        force: force.to_owned(),
                        mass: mass.to_owned(),
                        length: length.to_owned(),
                        time: time.to_owned(),
                        factor: format!("{:.6e}", stated / derived).parse().unwrap_or(stated / derived),
                    });
                }
                force.to_owned()
            }
            (Some(force), None) => force.to_owned(),
            (None, Some(mass)) => from_mass
                .and_then(|derived| name_of(FORCES, derived))
                .map_or_else(|| format!("{mass}·{length}/{time}²"), str::to_owned),
            (None, None) => {
                return Err(UnitsError::Force("the unit of force (or of mass) is missing".into()));
            }
        };
        Ok(Units { length: length.to_owned(), force, time: time.to_owned() })
    }

    /// Unit of length.
    pub fn length(&self) -> &str {
        &self.length
    }

    /// Unit of force.
    pub fn force(&self) -> &str {
        &self.force
    }

    /// Unit of time.
    pub fn time(&self) -> &str {
        &self.time
    }

    /// Sizes of length, force and time in SI; `None` if one of the names is unknown.
    fn sizes(&self) -> Option<[f64; 3]> {
        Some([size(LENGTHS, &self.length)?, size(FORCES, &self.force)?, size(TIMES, &self.time)?])
    }

    /// Unit of stress: force per area.
    pub fn stress(&self) -> String {
        let metric = size(LENGTHS, &self.length).is_some_and(|length| !is_imperial(length));
        let known = self.sizes().and_then(|[length, force, _]| name_of(STRESSES, force / (length * length)));
        match known {
            Some(name) if metric || !name.ends_with("Pa") => name.to_owned(),
            _ => format!("{}/{}²", self.force, self.length),
        }
    }

    /// Unit of energy: force times length.
    pub fn energy(&self) -> String {
        let known = self.sizes().and_then(|[length, force, _]| name_of(ENERGIES, force * length));
        known.map_or_else(|| format!("{} {}", self.force, self.length), str::to_owned)
    }

    /// Unit of mass: force per acceleration.
    pub fn mass(&self) -> String {
        let known =
            self.sizes().and_then(|[length, force, time]| name_of(MASSES, force * time * time / length));
        known.map_or_else(|| format!("{} {}²/{}", self.force, self.time, self.length), str::to_owned)
    }

    /// Unit of density.
    pub fn density(&self) -> String {
        let mass = self.mass();
        if mass.contains('/') {
            format!("{} {}²/{}⁴", self.force, self.time, self.length)
        } else {
            format!("{mass}/{}³", self.length)
        }
    }

    /// Unit of acceleration.
    pub fn acceleration(&self) -> String {
        format!("{}/{}²", self.length, self.time)
    }

    /// Unit of velocity, and of the permeability as a hydraulic conductivity.
    pub fn velocity(&self) -> String {
        format!("{}/{}", self.length, self.time)
    }

    /// Unit of volume.
    pub fn volume(&self) -> String {
        format!("{}³", self.length)
    }

    /// Unit of force times length.
    pub fn moment(&self) -> String {
        format!("{}·{}", self.force, self.length)
    }

    /// Unit of viscosity: stress times time.
    pub fn viscosity(&self) -> String {
        format!("{}·{}", self.stress(), self.time)
    }

    /// Unit of a quantity whose unit in a doc comment is `kind`, such as `stress` or `force·length`; `None` for others.
    pub fn named(&self, kind: &str) -> Option<String> {
        Some(match kind {
            "length" => self.length.clone(),
            "force" => self.force.clone(),
            "time" => self.time.clone(),
            "stress" => self.stress(),
            "energy" => self.energy(),
            "mass" => self.mass(),
            "density" | "mass/length³" => self.density(),
            "acceleration" => self.acceleration(),
            "velocity" | "permeability" => self.velocity(),
            "volume" => self.volume(),
            "moment" | "force·length" => self.moment(),
            "viscosity" | "stress·time" => self.viscosity(),
            _ => return None,
        })
    }

    /// A stress in Pa.
    pub fn in_pascals(&self, stress: f64) -> Option<f64> {
        self.sizes().map(|[length, force, _]| stress * force / (length * length))
    }

    /// A length in m.
    pub fn in_metres(&self, value: f64) -> Option<f64> {
        size(LENGTHS, &self.length).map(|length| value * length)
    }

    /// An acceleration in m/s².
    pub fn in_metres_per_second_squared(&self, acceleration: f64) -> Option<f64> {
        self.sizes().map(|[length, _, time]| acceleration * length / (time * time))
    }

    /// A density in kg/m³.
    pub fn in_kilograms_per_cubic_metre(&self, density: f64) -> Option<f64> {
        self.sizes().map(|[length, force, time]| density * force * time * time / length.powi(4))
    }

    /// The units by kind of quantity, for `summary.json` and `run.json`.
    pub fn document(&self) -> Value {
        json!({
            "length": self.length,
            "force": self.force,
            "time": self.time,
            "stress": self.stress(),
            "energy": self.energy(),
            "mass": self.mass(),
            "density": self.density(),
            "acceleration": self.acceleration(),
            "velocity": self.velocity(),
            "volume": self.volume(),
            "moment": self.moment(),
        })
    }
}

fn is_imperial(length: f64) -> bool {
    ["ft", "in", "yd"].iter().any(|name| size(LENGTHS, name) == Some(length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(length: &str, force: &str) -> Units {
        Units::new(length, Some(force), None, "s").unwrap()
    }

    #[test]
    fn derived_units_have_their_names() {
        let table = [
            ("m", "N", "Pa", "J", "kg/m³"),
            ("m", "kN", "kPa", "kJ", "t/m³"),
            ("m", "MN", "MPa", "MJ", "kt/m³"),
            ("mm", "N", "MPa", "mJ", "t/mm³"),
            ("mm", "kN", "GPa", "J", "kt/mm³"),
            ("ft", "lbf", "psf", "lbf ft", "slug/ft³"),
            ("in", "lbf", "psi", "lbf in", "blob/in³"),
            ("ft", "kip", "ksf", "kip ft", "kip s²/ft⁴"),
            ("cm", "N", "N/cm²", "N cm", "N s²/cm⁴"),
            ("ell", "N", "N/ell²", "N ell", "N s²/ell⁴"),
        ];
        for (length, force, stress, energy, density) in table {
            let units = units(length, force);
            assert_eq!(units.stress(), stress);
            assert_eq!((units.energy(), units.density()), (energy.to_owned(), density.to_owned()));
        }
        let days = Units::new("m", Some("kN"), None, "d").unwrap();
        assert_eq!(
            (days.stress(), days.velocity(), days.mass()),
            ("kPa".into(), "m/d".into(), "kN d²/m".into())
        );
    }

    #[test]
    fn a_mass_gives_the_force_or_contradicts_it() {
        assert_eq!(Units::new("m", None, Some("t"), "s").unwrap().force(), "kN");
        assert_eq!(Units::new("mm", None, Some("t"), "s").unwrap().force(), "N");
        assert_eq!(Units::new("cm", None, Some("g"), "s").unwrap().force(), "g·cm/s²");
        assert!(Units::new("ft", Some("lbf"), Some("slug"), "s").is_ok());
        let wrong = Units::new("m", Some("kN"), Some("kg"), "s").unwrap_err();
        assert_eq!(wrong.to_string(), "the units contradict each other: 1 kN is 1000 kg·m/s²");
        assert!(Units::new("m", None, None, "s").is_err() && Units::new("", Some("N"), None, "s").is_err());
    }

    #[test]
    fn sizes_are_those_of_si() {
        let near = |a: Option<f64>, b: f64| assert!((a.unwrap() / b - 1.0).abs() < 1e-9, "{a:?} {b}");
        near(units("mm", "N").in_pascals(210e3), 210e9);
        near(units("mm", "N").in_metres_per_second_squared(9810.0), 9.81);
        near(units("mm", "N").in_kilograms_per_cubic_metre(7.85e-9), 7850.0);
        near(units("m", "kN").in_kilograms_per_cubic_metre(2.0), 2000.0);
        near(units("ft", "lbf").in_metres_per_second_squared(32.174_048_556_430_4), 9.806_65);
        near(units("in", "lbf").in_pascals(30e6), 206_842_718_795.052);
        assert_eq!(units("ell", "N").in_pascals(1.0), None);
    }
}
