//! Adaptive quadrature in one dimension.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A value with an estimate of its error.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Estimated bound of its error, above or equal to zero.
    pub error: f64,
}

/// Positive nodes of the Kronrod rule of 15 points on [−1, 1], descending, and the middle; every second one belongs to
/// the Gauss rule of 7 points. Tables of QUADPACK (Piessens et al., 1983).
const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];
const GAUSS: [f64; 4] =
    [0.129_484_966_168_869_7, 0.279_705_391_489_276_64, 0.381_830_050_505_118_93, 0.417_959_183_673_469_4];

/// Number of values that one panel takes.
pub(super) const VALUES_PER_PANEL: usize = 15;

/// Relative width of the narrowest panel: below it, positions of the rule coincide.
const NARROWEST: f64 = 1e-13;

/// A part of the range with its integral.
struct Panel {
    low: f64,
    high: f64,
    rule: Estimate,
    /// Integral of the errors of the values themselves; division of the panel does not reduce it.
    of_values: f64,
}

impl Panel {
    fn new(low: f64, high: f64, f: &mut dyn FnMut(f64) -> Estimate) -> Self {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let (mut kronrod, mut gauss, mut of_values) = (0.0, 0.0, 0.0);
        for (k, node) in NODES.into_iter().enumerate() {
            let sides: &[f64] = if node == 0.0 { &[1.0] } else { &[-1.0, 1.0] };
            for side in sides {
                let Estimate { value, error } = f(middle + side * half * node);
                kronrod += KRONROD[k] * value;
                of_values += KRONROD[k] * error;
                if k % 2 == 1 {
                    gauss += GAUSS[k / 2] * value;
                }
            }
        }
        let rule = Estimate { value: half * kronrod, error: half * (kronrod - gauss).abs() };
        Panel { low, high, rule, of_values: half * of_values }
    }
}

impl PartialEq for Panel {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Panel {}

impl PartialOrd for Panel {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Panel {
    fn cmp(&self, other: &Self) -> Ordering {
        self.rule.error.total_cmp(&other.rule.error)
    }
}

/// Integral of a function over a range that is cut at ascending `breaks`, the ends among them.
///
/// The panel with the largest error is halved until the sum of the errors is at most `tolerance` or `more` refuses
/// another panel, asked with the number there is. The function gives the error of its values, which adds to that of the integral. The estimate is
/// the difference between the rules of Gauss and Kronrod: safe for smooth functions and good at kinks and jumps, but
/// what lies between all nodes of a panel is not seen.
pub fn integrate(
    breaks: &[f64],
    tolerance: f64,
    more: &dyn Fn(usize) -> bool,
    f: &mut dyn FnMut(f64) -> Estimate,
) -> Estimate {
    let mut panels: BinaryHeap<Panel> =
        breaks.windows(2).map(|ends| Panel::new(ends[0], ends[1], f)).collect();
    let width = breaks.last().zip(breaks.first()).map_or(0.0, |(high, low)| high - low);
    let mut done: Vec<Panel> = Vec::new();
    let mut open_error: f64 = panels.iter().map(|panel| panel.rule.error).sum();
    let mut done_error = 0.0;
    while open_error + done_error > tolerance && more(panels.len() + done.len()) {
        let Some(worst) = panels.pop() else { break };
        open_error -= worst.rule.error;
        if worst.high - worst.low <= NARROWEST * width {
            done_error += worst.rule.error;
            done.push(worst);
            continue;
        }
        let middle = 0.5 * (worst.low + worst.high);
        for (low, high) in [(worst.low, middle), (middle, worst.high)] {
            let half = Panel::new(low, high, f);
            open_error += half.rule.error;
            panels.push(half);
        }
    }
    panels.into_iter().chain(done).fold(Estimate::default(), |sum, panel| Estimate {
        value: sum.value + panel.rule.value,
        error: sum.error + panel.rule.error + panel.of_values,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(f: impl Fn(f64) -> f64) -> impl FnMut(f64) -> Estimate {
        move |x| Estimate { value: f(x), error: 0.0 }
    }

    #[test]
    fn the_rules_are_exact_for_polynomials() {
        for degree in 0..=22 {
            let panel = Panel::new(-1.0, 1.0, &mut exact(|x| x.powi(degree)));
            let integral = if degree % 2 == 0 { 2.0 / f64::from(degree + 1) } else { 0.0 };
            assert!((panel.rule.value - integral).abs() < 1e-15, "{degree}");
            // Gauss with seven points ends at degree 13.
            assert_eq!(panel.rule.error < 1e-15, degree <= 13 || degree % 2 == 1, "{degree}");
        }
    }

    #[test]
    fn kinks_jumps_and_roots_are_within_the_estimate() {
        type Case = (fn(f64) -> f64, f64);
        let cases: [Case; 4] = [
            (|x| (x - 0.3).abs(), 0.29),
            (|x| if x < 0.3 { 1.0 } else { 0.0 }, 0.3),
            (|x| x.sqrt(), 2.0 / 3.0),
            (|x| (1.0 - (2.0 * x - 1.0).powi(2)).sqrt(), std::f64::consts::FRAC_PI_4),
        ];
        for (k, (f, integral)) in cases.into_iter().enumerate() {
            let Estimate { value, error } = integrate(&[0.0, 1.0], 1e-10, &|n| n < 500, &mut exact(f));
            assert!(error <= 1e-10 && (value - integral).abs() <= error, "case {k}: {value} ± {error}");
        }
    }

    #[test]
    fn errors_of_the_values_are_part_of_the_estimate() {
        let sum = integrate(&[0.0, 2.0], 1e-10, &|n| n < 50, &mut |_| Estimate { value: 1.0, error: 0.1 });
        assert!((sum.value - 2.0).abs() < 1e-14 && (sum.error - 0.2).abs() < 1e-14);
    }

    #[test]
    fn an_integral_that_needs_too_many_panels_says_so() {
        let step = |x: f64| if x < 0.3 { 1.0 } else { 0.0 };
        let sum = integrate(&[0.0, 1.0], 1e-12, &|n| n < 10, &mut exact(step));
        assert!(sum.error > 1e-12 && (sum.value - 0.3).abs() <= sum.error);
        assert_eq!(integrate(&[], 1e-12, &|n| n < 10, &mut exact(step)), Estimate::default());
    }
}
