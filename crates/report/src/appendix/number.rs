//! Numbers formatted for tables and axes.

/// A number as text, split at its decimal point so that a column can be aligned there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Decimal {
    /// Sign and digits before the decimal point.
    pub whole: String,
    /// Decimal point and the digits after it, or empty.
    pub fraction: String,
    /// Exponent of the power of ten that multiplies the number, or 0.
    pub exponent: i32,
}

impl Decimal {
    /// A number with `digits` significant digits, or with all digits before the point if these are more, without
    /// trailing zeros; with a power of ten if it is very large or very small.
    pub fn significant(value: f64, digits: usize) -> Decimal {
        if value == 0.0 {
            return Decimal { whole: "0".to_owned(), fraction: String::new(), exponent: 0 };
        }
        if !value.is_finite() {
            return Decimal { whole: value.to_string(), fraction: String::new(), exponent: 0 };
        }
        // Rounding may carry into the next power of ten, which the formatter handles.
        let scientific = format!("{value:.*e}", digits.max(1) - 1);
        let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
        let exponent: i32 = exponent.parse().unwrap_or(0);
        if (-3..7.max(digits as i32)).contains(&exponent) {
            let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
            Decimal::from_text(&format!("{value:.decimals$}"), 0)
        } else {
            Decimal::from_text(mantissa, exponent)
        }
    }

    /// A number with `decimals` decimals, including trailing zeros.
    pub fn fixed(value: f64, decimals: usize) -> Decimal {
        let text = format!("{value:.decimals$}");
        // A number rounded to zero has no sign.
        let has_digits = text.bytes().any(|b| (b'1'..=b'9').contains(&b));
        let text = text.replace('-', if has_digits { "\u{2212}" } else { "" });
        let (whole, digits) = text.split_once('.').unwrap_or((&text, ""));
        let fraction = if digits.is_empty() { String::new() } else { format!(".{digits}") };
        Decimal { whole: grouped(whole), fraction, exponent: 0 }
    }

    fn from_text(text: &str, exponent: i32) -> Decimal {
        let text = text.replace('-', "\u{2212}");
        let (whole, digits) = text.split_once('.').unwrap_or((&text, ""));
        let digits = digits.trim_end_matches('0');
        let fraction = if digits.is_empty() { String::new() } else { format!(".{digits}") };
        Decimal { whole: grouped(whole), fraction, exponent }
    }

    /// The part after the whole digits, in HTML.
    pub fn tail(&self) -> String {
        match self.exponent {
            0 => self.fraction.clone(),
            e => format!("{}\u{202f}\u{d7}\u{202f}10<sup>{}</sup>", self.fraction, with_minus(e)),
        }
    }

    /// Width of [`Decimal::tail`] in characters; its two narrow spaces count as one.
    pub fn tail_length(&self) -> usize {
        let power = if self.exponent == 0 { 0 } else { 4 + self.exponent.to_string().len() };
        self.fraction.len() + power
    }

    /// The complete number, in HTML.
    pub fn html(&self) -> String {
        format!("{}{}", self.whole, self.tail())
    }
}

/// Groups the digits of a whole number in threes, from ten thousand on.
pub(super) fn grouped(digits: &str) -> String {
    let (sign, digits) = match digits.strip_prefix('\u{2212}') {
        Some(rest) => ("\u{2212}", rest),
        None => ("", digits),
    };
    if digits.len() < 5 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return format!("{sign}{digits}");
    }
    let mut text = sign.to_owned();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A whole number with a true minus sign.
pub(super) fn with_minus(value: i32) -> String {
    value.to_string().replace('-', "\u{2212}")
}

/// A number with `digits` significant digits, in HTML.
pub(super) fn html(value: f64, digits: usize) -> String {
    Decimal::significant(value, digits).html()
}

/// A number in plain text, where markup is not possible.
pub(super) fn plain(value: f64, digits: usize) -> String {
    let decimal = Decimal::significant(value, digits);
    match decimal.exponent {
        0 => format!("{}{}", decimal.whole, decimal.fraction),
        e => format!("{}{}e{}", decimal.whole, decimal.fraction, with_minus(e)),
    }
}

/// A duration in a suitable unit.
pub(super) fn duration(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    match seconds {
        s if s < 100.0 => format!("{}\u{a0}s", plain(s, 3)),
        s if s < 5400.0 => format!("{}\u{a0}min {:02}\u{a0}s", whole / 60, whole % 60),
        _ => format!("{hours}\u{a0}h {minutes:02}\u{a0}min"),
    }
}

/// An amount of memory in a suitable unit.
pub(super) fn memory(bytes: f64) -> String {
    for (unit, size) in [("GiB", 30), ("MiB", 20)] {
        let size = f64::from(1u32 << size);
        if bytes >= size {
            return format!("{}\u{a0}{unit}", plain(bytes / size, 3));
        }
    }
    format!("{}\u{a0}KiB", plain(bytes / 1024.0, 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_requested_digits() {
        for (value, digits, text) in [
            (0.0, 5, "0"),
            (-0.0, 5, "0"),
            (1.0, 5, "1"),
            (-8.170_94, 5, "\u{2212}8.1709"),
            (0.99999, 3, "1"),
            (99_999.6, 5, "100\u{202f}000"),
            (12_345.678, 7, "12\u{202f}345.68"),
            (1234.0, 3, "1234"),
            (0.001_234_56, 3, "0.00123"),
            (9.999e6, 3, "1e7"),
            (12e6, 9, "12\u{202f}000\u{202f}000"),
            (1.5e-9, 3, "1.5e\u{2212}9"),
            (-2.25e20, 5, "\u{2212}2.25e20"),
            (f64::NAN, 3, "NaN"),
        ] {
            assert_eq!(plain(value, digits), text, "{value}");
        }
        assert_eq!(html(1.5e-9, 3), "1.5\u{202f}\u{d7}\u{202f}10<sup>\u{2212}9</sup>");
        assert_eq!(Decimal::significant(1.5e-9, 3).tail_length(), 8);
        assert_eq!(Decimal::significant(-12.5, 3).whole, "\u{2212}12");
        assert_eq!(Decimal::fixed(-0.1996, 3).html(), "\u{2212}0.200");
    }

    #[test]
    fn durations_and_memory_have_suitable_units() {
        assert_eq!(duration(0.0312), "0.0312\u{a0}s");
        assert_eq!(duration(125.0), "2\u{a0}min 05\u{a0}s");
        assert_eq!(duration(7260.0), "2\u{a0}h 01\u{a0}min");
        assert_eq!(memory(1536.0 * 1024.0 * 1024.0), "1.5\u{a0}GiB");
        assert_eq!(memory(512.0), "0.5\u{a0}KiB");
    }
}
