//! Units of numbers: those given by the user, otherwise the names of quantities.

pub use mpm_files::units::Units;

/// The quantity that a number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// A length.
    Length,
    /// An area; per unit thickness in plane strain.
    Area,
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
            "cauchy_stress"
            | "von_mises_stress"
            | "pressure"
            | "pressure_smoothed"
            | "principal_stress"
            | "maximum_shear_stress" => Quantity::Stress,
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
            (None, Quantity::Area) if self.per_thickness => "length".to_owned(),
            (None, Quantity::Area) => "length²".to_owned(),
            (None, Quantity::Force) => per_thickness("force".to_owned(), "length"),
            (None, Quantity::Stress) => "stress".to_owned(),
            (None, Quantity::Energy) => per_thickness("energy".to_owned(), "length"),
            (None, Quantity::Volume) => per_thickness("volume".to_owned(), "length"),
            (None, Quantity::Mass) => per_thickness("mass".to_owned(), "length"),
            (None, Quantity::Moment) => per_thickness("force·length".to_owned(), "length"),
            (None, Quantity::Time) => "time".to_owned(),
            (Some(units), Quantity::Length) => units.length().to_owned(),
            (Some(units), Quantity::Area) if self.per_thickness => units.length().to_owned(),
            (Some(units), Quantity::Area) => format!("{}²", units.length()),
            (Some(units), Quantity::Force) => per_thickness(units.force().to_owned(), units.length()),
            (Some(units), Quantity::Stress) => units.stress(),
            (Some(units), Quantity::Energy) => per_thickness(units.energy(), units.length()),
            (Some(units), Quantity::Volume) => per_thickness(units.volume(), units.length()),
            (Some(units), Quantity::Mass) => per_thickness(units.mass(), units.length()),
            (Some(units), Quantity::Moment) => per_thickness(units.moment(), units.length()),
            (Some(units), Quantity::Time) => units.time().to_owned(),
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
        assert_eq!(other.unit(Quantity::Stress), "psf");
        assert_eq!(other.unit(Quantity::Energy), "lbf ft");
        assert_eq!(other.label("J", Quantity::Number, -12), "J [10⁻¹²]");
        assert_eq!(Naming::default().label("pressure", Quantity::Stress, 0), "pressure [stress]");
        for wrong in ["", "m", "m,N", "m,,s", "m,N,s,kg"] {
            assert!(wrong.parse::<Units>().is_err(), "{wrong}");
        }
    }
}
