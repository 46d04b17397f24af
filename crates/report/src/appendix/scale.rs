//! Scales of axes: from values to positions on a drawing, and the round values of ticks.

use super::units::superscript;

/// Kind of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Equal distances represent equal differences.
    Linear,
    /// Equal distances represent equal ratios.
    Logarithmic,
}

/// A tick of an axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    /// Value at the tick.
    pub value: f64,
    /// Text at the tick; empty for a minor tick.
    pub label: String,
}

/// An axis between two positions in a drawing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scale {
    kind: Kind,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
    /// Ticks in ascending order.
    pub ticks: Vec<Tick>,
    /// Exponent of the power of ten that multiplies the labels of the ticks.
    pub power: i32,
}

impl Scale {
    /// A linear axis over some values, between two positions, with about `marks` ticks. It begins and ends at a tick if
    /// `whole`, otherwise at the values.
    pub fn linear(values: [f64; 2], places: [f64; 2], marks: usize, whole: bool) -> Scale {
        let [low, high] = with_extent(values);
        let step = Step::near((high - low) / marks.max(1) as f64);
        let (first, last) = if whole {
            (step.at_or_below(low), -step.at_or_below(-high))
        } else {
            (-step.at_or_below(-low), step.at_or_below(high))
        };
        let (low, high) = if whole { (step.value(first), step.value(last)) } else { (low, high) };
        // The exponents are multiples of three, as usual in engineering.
        let largest = low.abs().max(high.abs());
        let power =
            if (1e-3..1e4).contains(&largest) { 0 } else { 3 * (largest.log10() / 3.0).floor() as i32 };
        let ticks = (0..=(last - first).max(0.0) as usize)
            .map(|index| first + index as f64)
            .map(|count| Tick { value: step.value(count), label: step.label(count, power) })
            .collect();
        Scale { kind: Kind::Linear, low, high, from: places[0], to: places[1], ticks, power }
    }

    /// A logarithmic axis over some positive values, between two positions, with about `marks` labels.
    pub fn logarithmic(values: [f64; 2], places: [f64; 2], marks: usize) -> Scale {
        let exponent = |value: f64| value.max(f64::MIN_POSITIVE).log10();
        let (first, mut last) = (exponent(values[0]).floor() as i32, exponent(values[1]).ceil() as i32);
        if last <= first {
            last = first + 1;
        }
        let stride = ((last - first) as usize).div_ceil(marks.max(1)) as i32;
        let ticks = (first..=last).map(|e| {
            let label = if e % stride == 0 { format!("10{}", superscript(e)) } else { String::new() };
            Tick { value: 10f64.powi(e), label }
        });
        let (low, high) = (f64::from(first), f64::from(last));
        let ticks = ticks.collect();
        Scale { kind: Kind::Logarithmic, low, high, from: places[0], to: places[1], ticks, power: 0 }
    }

    /// Position of a value.
    pub fn place(&self, value: f64) -> f64 {
        let value = match self.kind {
            Kind::Linear => value,
            Kind::Logarithmic => value.max(f64::MIN_POSITIVE).log10(),
        };
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }
}

/// Distinct and finite bounds around the given ones.
fn with_extent([low, high]: [f64; 2]) -> [f64; 2] {
    if !(low.is_finite() && high.is_finite() && low <= high) {
        return [0.0, 1.0];
    }
    let size = low.abs().max(high.abs());
    // Smaller differences are round-off, and the labels of such an axis would have a dozen digits.
    if high - low > 1e-9 * size {
        [low, high]
    } else if size == 0.0 {
        [0.0, 1.0]
    } else {
        [low - 0.1 * size, high + 0.1 * size]
    }
}

/// A round distance between ticks: 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy)]
struct Step {
    digit: f64,
    exponent: i32,
}

impl Step {
    /// The smallest round distance that is at least `distance`.
    fn near(distance: f64) -> Step {
        let exponent = distance.log10().floor() as i32;
        let mantissa = distance / 10f64.powi(exponent);
        let found = [1.0, 2.0, 5.0].into_iter().find(|digit| mantissa <= digit * (1.0 + 1e-9));
        match found {
            Some(digit) => Step { digit, exponent },
            None => Step { digit: 1.0, exponent: exponent + 1 },
        }
    }

    /// The whole number of steps at or below a value.
    fn at_or_below(self, value: f64) -> f64 {
        (value / self.value(1.0) + 1e-9).floor()
    }

    /// The value after `count` steps, without the round-off of a repeated sum.
    fn value(self, count: f64) -> f64 {
        let digits = count * self.digit;
        if self.exponent < 0 {
            digits / 10f64.powi(-self.exponent)
        } else {
            digits * 10f64.powi(self.exponent)
        }
    }

    /// The value after `count` steps as text, in units of a power of ten.
    fn label(self, count: f64, power: i32) -> String {
        let exponent = self.exponent - power;
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        let value = Step { digit: self.digit, exponent }.value(count);
        let text = format!("{:.decimals$}", if value == 0.0 { 0.0 } else { value });
        text.replace('-', "\u{2212}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &Scale) -> Vec<&str> {
        scale.ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn linear_axes_have_round_marks_around_the_values() {
        let marks = |low, high| {
            let scale = Scale::linear([low, high], [0.0, 100.0], 5, true);
            (labels(&scale).join(" "), scale.power)
        };
        assert_eq!(marks(0.0, 1.0), ("0.0 0.2 0.4 0.6 0.8 1.0".to_owned(), 0));
        assert_eq!(marks(-8.17, 0.0), ("−10 −8 −6 −4 −2 0".to_owned(), 0));
        assert_eq!(marks(0.0, 313_920.0), ("0 100 200 300 400".to_owned(), 3));
        assert_eq!(marks(-1.2e-5, 1e-6), ("−15 −10 −5 0 5".to_owned(), -6));
        assert_eq!(marks(2.0, 2.0), ("1.8 1.9 2.0 2.1 2.2".to_owned(), 0));
        assert_eq!(marks(0.0, 0.0).0, "0.0 0.2 0.4 0.6 0.8 1.0");
        assert_eq!(marks(f64::NAN, 1.0).0, "0.0 0.2 0.4 0.6 0.8 1.0");
        assert_eq!(marks(1.0, 1.0 + 1e-13).1, 0);
    }

    #[test]
    fn an_axis_that_is_not_whole_ends_at_the_values() {
        let scale = Scale::linear([0.3, 10.7], [0.0, 104.0], 5, false);
        assert_eq!(labels(&scale), ["5", "10"]);
        assert!((scale.place(0.3) - 0.0).abs() < 1e-12 && (scale.place(10.7) - 104.0).abs() < 1e-12);
        assert_eq!(
            labels(&Scale::linear([0.0, 10.0], [0.0, 1.0], 5, false)),
            ["0", "2", "4", "6", "8", "10"]
        );
    }

    #[test]
    fn places_are_between_the_ends() {
        // Positions in a drawing are counted from the top.
        let scale = Scale::linear([0.0, 4.0], [300.0, 100.0], 4, true);
        assert_eq!([0.0, 1.0, 4.0].map(|v| scale.place(v)), [300.0, 250.0, 100.0]);
        let scale = Scale::logarithmic([2e-13, 3.0], [280.0, 0.0], 7);
        assert_eq!(labels(&scale), ["10⁻¹²", "10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"]);
        assert_eq!(scale.ticks.len(), 15);
        assert!((scale.place(1e-6) - 140.0).abs() < 1e-9);
        assert!(scale.place(0.0).is_finite());
        let flat = Scale::logarithmic([1.0, 1.0], [0.0, 1.0], 5);
        assert_eq!(labels(&flat), ["10⁰", "10¹"]);
    }
}
