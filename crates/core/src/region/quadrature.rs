//! Adaptive quadrature in one dimension.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::sync::LazyLock;

/// A value with an error estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Estimated error bound; not negative.
    pub error: f64,
}

/// Non-negative nodes of the 15-point Kronrod rule on [−1, 1], descending. Exact to degree 22. Tabulated in QUADPACK
/// (Piessens et al., 1983).
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
const WEIGHTS: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];

/// Number of nodes.
const N: usize = 15;

/// Number of function values per panel: at the nodes and at both ends.
pub(super) const VALUES_PER_PANEL: usize = N + 2;

/// Distance of the outermost node from the end; features in this gap show only in the value at the end.
const GAP: f64 = 1.0 - NODES[0];

/// Position on [−1, 1] at which the ends are sampled: just inside, because functions may jump at breaks.
const END: f64 = 1.0 - 1e-10;

/// Relative width below which a panel is not halved, because its nodes would coincide.
const NARROWEST: f64 = 1e-13;

/// Decay ratio of successive coefficient pairs above which a function counts as not smooth.
const SMOOTH: f64 = 0.25;

/// Largest ratio of true error to estimate for a jump, plus 10 %; the ratio for a kink or a square root is smaller.
const SAFETY: f64 = 1.13;

fn node(k: usize) -> f64 {
    if k < 8 { -NODES[k] } else { NODES[N - 1 - k] }
}

fn weight(k: usize) -> f64 {
    WEIGHTS[k.min(N - 1 - k)]
}

/// Linear forms of the values at the nodes that measure how well a polynomial fits a function.
struct Forms {
    /// Coefficients of the polynomials of degree 14 down to 7, orthonormal on the nodes with their weights.
    coefficients: [[f64; N]; 8],
    /// Values of the polynomial through all nodes at the lower and the upper end.
    at_ends: [[f64; N]; 2],
}

static FORMS: LazyLock<Forms> = LazyLock::new(|| {
    // Each polynomial, given by its values at nodes and ends, is the previous one times x, orthogonalised against all
    // earlier ones.
    type Values = ([f64; N], [f64; 2]);
    let product = |a: &Values, b: &Values| (0..N).map(|k| weight(k) * a.0[k] * b.0[k]).sum::<f64>();
    let mut basis: Vec<Values> = Vec::with_capacity(N);
    for degree in 0..N {
        let mut next: Values = match basis.last() {
            None => ([1.0; N], [1.0; 2]),
            Some((nodes, ends)) => {
                (std::array::from_fn(|k| node(k) * nodes[k]), [-END * ends[0], END * ends[1]])
            }
        };
        // Twice, to remove round-off.
        for before in basis.iter().chain(&basis) {
            let part = product(&next, before);
            next.0.iter_mut().zip(before.0).for_each(|(x, y)| *x -= part * y);
            next.1.iter_mut().zip(before.1).for_each(|(x, y)| *x -= part * y);
        }
        let length = product(&next, &next).sqrt();
        debug_assert!(length > 0.0, "degree {degree}");
        basis.push((next.0.map(|x| x / length), next.1.map(|x| x / length)));
    }
    let extrapolated = |end: usize| {
        std::array::from_fn(|k| {
            weight(k) * basis.iter().map(|(nodes, ends)| nodes[k] * ends[end]).sum::<f64>()
        })
    };
    Forms {
        coefficients: std::array::from_fn(|k| {
            let (nodes, _) = basis[N - 1 - k];
            std::array::from_fn(|k| weight(k) * nodes[k])
        }),
        at_ends: [extrapolated(0), extrapolated(1)],
    }
});

/// A part of the range and its integral.
struct Panel {
    low: f64,
    high: f64,
    rule: Estimate,
    /// Integral of the errors of the function values; subdivision does not reduce it.
    value_error: f64,
}

impl Panel {
    fn new(low: f64, high: f64, f: &mut dyn FnMut(f64) -> Estimate) -> Self {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let (mut values, mut value, mut value_error) = ([0.0; N], 0.0, 0.0);
        for k in 0..N {
            let at = f(middle + half * node(k));
            values[k] = at.value;
            value += weight(k) * at.value;
            value_error += weight(k) * at.error;
        }
        let ends = [-1.0, 1.0].map(|end: f64| f(middle + half * END * end).value);
        let rule = Estimate { value: half * value, error: half * error_of_rule(&values, ends) };
        Panel { low, high, rule, value_error: half * value_error }
    }
}

/// Error of the rule on [−1, 1].
///
/// If the function is smooth, the last coefficients of its polynomial bound the error. If the coefficients do not decay
/// from pair to pair, all of the last eight count: a jump, kink or square root shows in one of them wherever it is. A
/// feature close to an end shows in the value there.
fn error_of_rule(values: &[f64; N], ends: [f64; 2]) -> f64 {
    let apply = |form: &[f64; N]| (0..N).map(|k| form[k] * values[k]).sum::<f64>();
    let c = FORMS.coefficients.each_ref().map(apply);
    let pairs: [f64; 4] = std::array::from_fn(|k| c[2 * k].hypot(c[2 * k + 1]));
    let round_off = 1e-14 * (0..N).map(|k| weight(k) * values[k] * values[k]).sum::<f64>().sqrt();
    let smooth = (0..3).all(|k| pairs[k] <= SMOOTH * pairs[k + 1].max(round_off));
    let inner = if smooth { pairs[0] } else { pairs.into_iter().fold(0.0, f64::max) };
    let outer: f64 = (0..2).map(|end| (apply(&FORMS.at_ends[end]) - ends[end]).abs()).sum();
    SAFETY * (inner + GAP * outer)
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

/// Integral of a function over a range divided at ascending `breaks`, which include both ends.
///
/// The panel with the largest error is halved until the sum of the errors is at most `tolerance`, or until `more`,
/// called with the number of panels, returns false. The errors of the function values add to the error of the integral.
/// The estimate is valid for smooth functions and for functions with jumps, kinks and square roots. A narrow peak
/// between two neighbouring nodes of a panel is not detected.
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
        error: sum.error + panel.rule.error + panel.value_error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(f: impl Fn(f64) -> f64) -> impl FnMut(f64) -> Estimate {
        move |x| Estimate { value: f(x), error: 0.0 }
    }

    #[test]
    fn the_rule_is_exact_for_polynomials() {
        for degree in 0..=22 {
            let panel = Panel::new(-1.0, 1.0, &mut exact(|x| x.powi(degree)));
            let integral = if degree % 2 == 0 { 2.0 / f64::from(degree + 1) } else { 0.0 };
            assert!((panel.rule.value - integral).abs() < 1e-15, "{degree}");
            assert!(degree > 6 || panel.rule.error < 1e-14, "{degree}: {}", panel.rule.error);
        }
    }

    /// A function of x with a feature at s, and its integral over [−1, 1].
    type Feature = (fn(f64, f64) -> f64, fn(f64) -> f64);

    const FEATURES: [Feature; 5] = [
        (|x, s| if x > s { 1.0 } else { 0.0 }, |s| 1.0 - s),
        (|x, s| (if x > s { 1.0 } else { 0.0 }) + 3.0 * (2.0 * x).sin(), |s| 1.0 - s),
        (|x, s| (x - s).max(0.0), |s| 0.5 * (1.0 - s).powi(2)),
        (|x, s| (x - s).max(0.0).sqrt(), |s| (1.0 - s).powf(1.5) / 1.5),
        (
            |x, s| (1.0 - 4.0 * (x - s).powi(2)).max(0.0).sqrt(),
            |s| {
                let area = |u: f64| 0.25 * (u * (1.0 - u * u).sqrt() + u.asin());
                area((2.0 * (1.0 - s)).min(1.0)) - area((-2.0 * (1.0 + s)).max(-1.0))
            },
        ),
    ];

    #[test]
    fn one_panel_knows_its_error_wherever_a_jump_a_kink_or_a_root_is() {
        for (case, (f, integral)) in FEATURES.into_iter().enumerate() {
            let mut ratios = Vec::new();
            for k in 0..3000 {
                let s = -1.0 + 2.0 * (f64::from(k) + 0.37) / 3000.0;
                let Estimate { value, error } = Panel::new(-1.0, 1.0, &mut exact(|x| f(x, s))).rule;
                let true_error = (value - integral(s)).abs();
                assert!(true_error <= error, "case {case}, {s}: {true_error} but {error}");
                ratios.push(true_error / error);
            }
            ratios.sort_by(f64::total_cmp);
            // The estimate must not be much too large either.
            assert!(ratios[1500] > 0.05, "case {case}: {}", ratios[1500]);
        }
    }

    #[test]
    fn jumps_kinks_and_roots_are_within_the_estimate() {
        for (case, (f, integral)) in FEATURES.into_iter().enumerate() {
            for s in [-0.4, -0.123, 0.0, 0.3, 0.98, 0.999] {
                let sum = integrate(&[-1.0, 0.0, 1.0], 1e-9, &|n| n < 500, &mut exact(|x| f(x, s)));
                let true_error = (sum.value - integral(s)).abs();
                assert!(
                    sum.error <= 1e-9 && true_error <= sum.error + 1e-15,
                    "case {case}, {s}: {sum:?} {true_error}"
                );
            }
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
