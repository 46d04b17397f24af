//! Units of numbers: those given by the user, otherwise the names of quantities.

use std::str::FromStr;

/// The quantity that a number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// A length.
    Length,
    /// A force; per unit thickness in plane strain.
    Force,
    /// A stress.
    Stress,
    /// An energy; per unit thickness in plane strain.
    Energy,
    /// A volume; per unit thickness in plane strain.
    Volume,
    /// A mass; per unit thickness in plane strain.
    Mass,
    /// A moment; per unit thickness in plane strain.
    Moment,
    /// An angle, [degree].
    Angle,
    /// A time.
    Time,
    /// A plain number.
    Number,
}

impl Quantity {
    /// Quantity of a field of points, by its name in the files.
    pub fn from_field(name: &str) -> Option<Quantity> {
        Some(match name {
            "displacement" => Quantity::Length,
            "cauchy_stress" | "von_mises_stress" | "pressure" => Quantity::Stress,
            "volume" => Quantity::Volume,
            "deformation_gradient" | "J" | "elastic_strain" | "plastic_strain" => Quantity::Number,
            // History variables of laws; work per volume has the unit of stress.
            "preconsolidation_pressure" | "plastic_work" => Quantity::Stress,
            "plastic_volumetric_strain" => Quantity::Number,
            "equivalent_plastic_strain" | "body_id" | "material_id" | "point_id" => Quantity::Number,
            _ => return None,
        })
    }
}

/// The unit system of a deck.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Units {
    length: String,
    force: String,
    time: String,
}

impl FromStr for Units {
    type Err = String;

    /// Reads `LENGTH,FORCE,TIME`, for example `m,kN,s`.
    fn from_str(text: &str) -> Result<Units, String> {
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let is_unit = |part: &&str| !part.is_empty() && part.chars().count() <= 8;
        match parts[..] {
            [length, force, time] if parts.iter().all(is_unit) => {
                Ok(Units { length: length.to_owned(), force: force.to_owned(), time: time.to_owned() })
            }
            _ => Err("expected the units of length, force and time, for example m,kN,s".to_owned()),
        }
    }
}

impl Units {
    /// Unit of stress: force per area.
    fn stress(&self) -> String {
        let named = [
            ("m", "N", "Pa"),
            ("m", "kN", "kPa"),
            ("m", "MN", "MPa"),
            ("mm", "N", "MPa"),
            ("mm", "kN", "GPa"),
        ];
        let found =
            named.iter().find(|(length, force, _)| (*length, *force) == (&*self.length, &*self.force));
        found
            .map_or_else(|| format!("{}/{}²", self.force, self.length), |(_, _, stress)| (*stress).to_owned())
    }

    /// Unit of energy: force times length.
    fn energy(&self) -> String {
        let named =
            [("m", "N", "J"), ("m", "kN", "kJ"), ("m", "MN", "MJ"), ("mm", "N", "mJ"), ("mm", "kN", "J")];
        let found =
            named.iter().find(|(length, force, _)| (*length, *force) == (&*self.length, &*self.force));
        found.map_or_else(|| format!("{} {}", self.force, self.length), |(_, _, energy)| (*energy).to_owned())
    }

    /// Unit of mass: force per acceleration.
    fn mass(&self) -> String {
        let named =
            [("m", "N", "kg"), ("m", "kN", "t"), ("m", "MN", "kt"), ("mm", "N", "t"), ("mm", "kN", "kt")];
        let found = named
            .iter()
            .find(|(length, force, _)| (*length, *force, "s") == (&*self.length, &*self.force, &*self.time));
        let other = || format!("{} {}²/{}", self.force, self.time, self.length);
        found.map_or_else(other, |(_, _, mass)| (*mass).to_owned())
    }
}

/// Units of a report.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Naming {
    /// The unit system, if the user gave one.
    pub units: Option<Units>,
    /// True if forces, moments, energies, volumes and masses are per unit thickness.
    pub per_thickness: bool,
}

impl Naming {
    /// The unit, or the name of the quantity; empty for plain numbers.
    pub fn unit(&self, quantity: Quantity) -> String {
        let per_thickness = |unit: String, length: &str| {
            if self.per_thickness { format!("{unit}/{length}") } else { unit }
        };
        match (&self.units, quantity) {
            (_, Quantity::Number) => String::new(),
            (_, Quantity::Angle) => "°".to_owned(),
            (None, Quantity::Length) => "length".to_owned(),
            (None, Quantity::Force) => per_thickness("force".to_owned(), "length"),
            (None, Quantity::Stress) => "stress".to_owned(),
            (None, Quantity::Energy) => per_thickness("energy".to_owned(), "length"),
            (None, Quantity::Volume) => per_thickness("volume".to_owned(), "length"),
            (None, Quantity::Mass) => per_thickness("mass".to_owned(), "length"),
            (None, Quantity::Moment) => per_thickness("force·length".to_owned(), "length"),
            (None, Quantity::Time) => "time".to_owned(),
            (Some(units), Quantity::Length) => units.length.clone(),
            (Some(units), Quantity::Force) => per_thickness(units.force.clone(), &units.length),
            (Some(units), Quantity::Stress) => units.stress(),
            (Some(units), Quantity::Energy) => per_thickness(units.energy(), &units.length),
            (Some(units), Quantity::Volume) => per_thickness(format!("{}³", units.length), &units.length),
            (Some(units), Quantity::Mass) => per_thickness(units.mass(), &units.length),
            (Some(units), Quantity::Moment) => {
                per_thickness(format!("{}·{}", units.force, units.length), &units.length)
            }
            (Some(units), Quantity::Time) => units.time.clone(),
        }
    }

    /// A name with its unit in brackets, the unit multiplied by a power of ten.
    pub fn label(&self, name: &str, quantity: Quantity, power: i32) -> String {
        let unit = self.unit(quantity);
        let power = match power {
            0 => String::new(),
            p => format!("10{}", superscript(p)),
        };
        match (power.is_empty(), unit.is_empty()) {
            (true, true) => name.to_owned(),
            (true, false) => format!("{name} [{unit}]"),
            (false, true) => format!("{name} [{power}]"),
            (false, false) => format!("{name} [{power} {unit}]"),
        }
    }
}

/// A whole number in superscript digits.
pub(super) fn superscript(value: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
    };
    value.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_follow_from_three() {
        let naming = |text: &str, per_thickness| Naming { units: Some(text.parse().unwrap()), per_thickness };
        let plane = naming("m,kN,s", true);
        assert_eq!(plane.label("reaction", Quantity::Force, 3), "reaction [10³ kN/m]");
        assert_eq!(plane.unit(Quantity::Stress), "kPa");
        assert_eq!(plane.unit(Quantity::Mass), "t/m");
        let other = naming("ft, lbf, s", false);
        assert_eq!(other.unit(Quantity::Stress), "lbf/ft²");
        assert_eq!(other.unit(Quantity::Energy), "lbf ft");
        assert_eq!(other.label("J", Quantity::Number, -12), "J [10⁻¹²]");
        assert_eq!(Naming::default().label("pressure", Quantity::Stress, 0), "pressure [stress]");
        for wrong in ["", "m", "m,N", "m,,s", "m,N,s,kg"] {
            assert!(wrong.parse::<Units>().is_err(), "{wrong}");
        }
    }
}
