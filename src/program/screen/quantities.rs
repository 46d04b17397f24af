//! Numbers formatted for people.

/// Formats a number with `digits` significant digits, or with all digits before the point if these are more, and with
/// an exponent if it is very large or very small.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    // Rounding may add a digit in front of the point: 9.9996 becomes 10.00.
    let exponential = format!("{value:.*e}", digits.saturating_sub(1));
    let exponent: i32 =
        exponential.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if (-3..6).contains(&exponent) {
        let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        exponential
    }
}

/// Formats a time in seconds, such as `0.3 s`, `42 s`, `3 min 5 s` or `2 h 10 min`.
pub fn duration(seconds: f64) -> String {
    if seconds < 9.95 {
        return format!("{:.1} s", seconds.max(0.0));
    }
    let whole = seconds.round() as u64;
    let (hours, minutes, rest) = (whole / 3600, whole / 60 % 60, whole % 60);
    match (hours, minutes) {
        (0, 0) => format!("{rest} s"),
        (0, _) => format!("{minutes} min {rest} s"),
        _ => format!("{hours} h {minutes} min"),
    }
}

/// Formats a rate of points per second.
pub fn rate(points_per_second: f64) -> String {
    let (value, unit) = match points_per_second {
        ..1e4 => (points_per_second, ""),
        ..1e7 => (points_per_second * 1e-3, " thousand"),
        _ => (points_per_second * 1e-6, " million"),
    };
    format!("{value:.0}{unit} points/s")
}

/// Formats an amount of memory.
pub fn bytes(bytes: u64) -> String {
    crate::memory::in_words(bytes as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.000"),
            (-0.012345, "-0.01235"),
            (9.9996, "10.00"),
            (313_920.0, "313920"),
            (1.2e6, "1.200e6"),
            (-3.2e-8, "-3.200e-8"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(significant(value, 4), text);
        }
    }

    #[test]
    fn times_and_sizes_have_units() {
        for (seconds, text) in [
            (0.04, "0.0 s"),
            (9.96, "10 s"),
            (59.6, "1 min 0 s"),
            (185.0, "3 min 5 s"),
            (7800.0, "2 h 10 min"),
        ] {
            assert_eq!(duration(seconds), text);
        }
        assert_eq!(rate(812.3), "812 points/s");
        assert_eq!(rate(1_234_567.0), "1235 thousand points/s");
        assert_eq!(rate(12_345_678.0), "12 million points/s");
    }
}
