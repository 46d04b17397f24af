//! Descriptions of values from the schema, in words.

use boon::ErrorKind;
use serde_json::Value;

use crate::quoting::quote;
use crate::references::Noun;
use crate::schema::{Fault, shortest, strict_schema};

/// The keys of a mapping, as messages name them.
pub(super) const KEYS: Noun = Noun::new("key here", "keys here");

/// The part of the schema with the keyword that a value does not satisfy.
pub(super) fn subschema(fault: &Fault) -> Option<&'static Value> {
    strict_schema().pointer(fault.path)
}

/// The number of entries that a schema allows, in words.
pub(super) fn count_in_words(fault: &Fault) -> String {
    let limit = |key: &str| subschema(fault).and_then(|schema| schema.get(key)).and_then(Value::as_u64);
    let entries = |n: u64| if n == 1 { "1 entry".to_owned() } else { format!("{n} entries") };
    // Lists of a fixed length are vectors, except the pairs of load curves and the radii of cones.
    let each = match fault.path {
        path if path.contains("LoadCurve") => "[time, factor]",
        path if path.contains("/radii") => "one per end",
        _ => "one per axis",
    };
    match (limit("minItems"), limit("maxItems"), &fault.kind) {
        (Some(2), Some(3), _) => format!("2 or 3 entries, {each}"),
        (Some(least), Some(most), _) if least == most => format!("{}, {each}", entries(least)),
        (_, Some(most), ErrorKind::MaxItems { .. }) => format!("at most {}", entries(most)),
        (least, ..) => format!("at least {}", entries(least.unwrap_or(1))),
    }
}

/// The whole range, if a value lies outside it.
pub(super) fn range_help(fault: &Fault) -> Option<String> {
    if !matches!(
        fault.kind,
        ErrorKind::ExclusiveMaximum { .. }
            | ErrorKind::ExclusiveMinimum { .. }
            | ErrorKind::Maximum { .. }
            | ErrorKind::Minimum { .. }
    ) || fault.pointer == "/version"
    {
        return None;
    }
    let schema = subschema(fault)?;
    let mut range = crate::schema::range_in_words(schema)?;
    // The words leave out the largest number of the type.
    if let ErrorKind::Maximum { want, .. } = fault.kind
        && want.as_u64() == Some(u32::MAX.into())
    {
        range.push_str(&format!(" and at most {}", shortest(&want.clone().into())));
    }
    // Only the description of a key gives the meaning of the number.
    let is_key = fault.path.rsplit('/').nth(1) == Some("properties");
    let Some(description) = schema.get("description").and_then(Value::as_str).filter(|_| is_key) else {
        return Some(format!("must be {range}"));
    };
    let meaning = description.split([';', ':']).next().unwrap_or(description).trim_end_matches('.');
    Some(format!("must be {range} ({})", meaning.replace('\n', " ")))
}

/// Help for a string that was probably meant as a number.
pub(super) fn number_help(value: &Value, code: &str) -> Option<String> {
    written_number(value.as_str().filter(|_| code == "D008")?, false)
}

/// Help for a string that is a number with separators or with a unit; `is_formula` is true if a formula is allowed
/// there.
pub(crate) fn written_number(text: &str, is_formula: bool) -> Option<String> {
    let bare = text.replace(['_', ' ', '\''], "").replace(',', ".");
    // Fortran writes the exponent of a number in double precision with a d.
    let bare = if bare.starts_with(|c: char| c.is_ascii_digit() || ".+-".contains(c)) {
        bare.replace(['d', 'D'], "e")
    } else {
        bare
    };
    if bare.parse::<f64>().is_ok_and(f64::is_finite) {
        return Some(format!("write the number as {bare}"));
    }
    let unit = unit_behind_number(text)?;
    let mut help = format!(
        "values carry no units: leave out {}, and convert the number to the units of the deck",
        quote(unit)
    );
    if unit.chars().all(char::is_alphabetic) {
        let number = text.trim().strip_suffix(unit).unwrap_or_default().trim();
        let product =
            if is_formula { format!("{number}*{unit}") } else { format!("\"${{{number}*{unit}}}\"") };
        help.push_str(&format!("; or, if `{unit}` is a parameter, write the product as `{product}`"));
    }
    Some(help)
}

/// Units that are often written behind numbers.
const UNITS: &[&str] = &[
    "m", "mm", "cm", "km", "N", "kN", "MN", "Pa", "kPa", "MPa", "GPa", "bar", "kg", "g", "t", "s", "ms",
    "min", "h", "deg", "degrees", "rad", "°", "%",
];

/// The unit behind a number, such as `kN/m^2`.
fn unit_behind_number(text: &str) -> Option<&str> {
    let text = text.trim();
    let mut ends = text.char_indices().rev().map(|(end, _)| end);
    let end = ends.find(|end| text[..*end].trim().parse::<f64>().is_ok())?;
    let unit = text[end..].trim();
    let without_power = |part: &str| {
        let power = ['^', '-', '0', '1', '2', '3', '4', '²', '³'];
        UNITS.contains(&part.trim().trim_end_matches(power))
    };
    unit.split(['/', '*', '·']).all(without_power).then_some(unit)
}

#[cfg(test)]
mod tests {
    use super::written_number;

    #[test]
    fn units_behind_numbers_are_found() {
        for (text, unit) in
            [("10 MPa", "MPa"), ("1.8e3kg/m^3", "kg/m^3"), ("20 kN/m²", "kN/m²"), ("30°", "°")]
        {
            let help = written_number(text, false).unwrap_or_default();
            assert!(help.contains(&format!("leave out `{unit}`")), "{text}: {help}");
        }
        let product = |is_formula| written_number("-0.1 h", is_formula).unwrap_or_default();
        assert!(product(true).ends_with("write the product as `-0.1*h`"), "{}", product(true));
        assert!(product(false).ends_with("write the product as `\"${-0.1*h}\"`"), "{}", product(false));
        assert_eq!(written_number("1 000,5", false).as_deref(), Some("write the number as 1000.5"));
        for (text, number) in [("1,5e5", "1.5e5"), ("1.0d5", "1.0e5"), ("-2D-3", "-2e-3")] {
            assert_eq!(written_number(text, true), Some(format!("write the number as {number}")), "{text}");
        }
        for text in ["10 x", "MPa", "10", "2 gamma", ""] {
            let help = written_number(text, false).unwrap_or_default();
            assert!(!help.contains("units"), "{text}: {help}");
        }
    }
}
