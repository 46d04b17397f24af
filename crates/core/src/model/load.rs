//! External forces and load curves.

use super::Stepping;
use crate::formula::{Formula, MAX_INTERMEDIATE};

/// Load factor as a piecewise linear function of time.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadCurve(Vec<[f64; 2]>);

impl LoadCurve {
    /// A ramp from 0 at time 0 to 1 at the end time.
    pub fn ramp(end_time: f64) -> Self {
        LoadCurve(vec![[0.0, 0.0], [end_time, 1.0]])
    }

    /// Interpolates [time, factor] pairs with increasing times.
    pub fn table(pairs: Vec<[f64; 2]>) -> Self {
        LoadCurve(pairs)
    }

    /// A line from one factor to another between two times; constant before and after.
    pub fn line(times: [f64; 2], factors: [f64; 2]) -> Self {
        LoadCurve(vec![[times[0], factors[0]], [times[1], factors[1]]])
    }

    /// Times of the pairs, ascending, [time].
    pub fn times(&self) -> impl Iterator<Item = f64> + '_ {
        self.0.iter().map(|pair| pair[0])
    }

    /// Times between the first and the last pair at which the slope changes, ascending, [time].
    pub fn knots(&self) -> impl Iterator<Item = f64> + '_ {
        let slope = |a: &[f64; 2], b: &[f64; 2]| (b[1] - a[1]) / (b[0] - a[0]);
        self.0.windows(3).filter(move |w| slope(&w[0], &w[1]) != slope(&w[1], &w[2])).map(|w| w[1][0])
    }

    /// Load factor at a time; constant before the first pair and after the last.
    pub fn factor(&self, time: f64) -> f64 {
        let after = self.0.partition_point(|pair| pair[0] <= time);
        match (after.checked_sub(1).and_then(|k| self.0.get(k)), self.0.get(after)) {
            (Some([t0, f0]), Some([t1, f1])) => f0 + (f1 - f0) * (time - t0) / (t1 - t0),
            (Some(last), None) => last[1],
            (None, Some(first)) => first[1],
            (None, None) => 0.0,
        }
    }
}

/// Kind of a load.
#[non_exhaustive]
#[derive(Debug, Clone)]
pub enum Action<const D: usize> {
    /// Gravitational acceleration, [length/time²]; the mass of each point is constant.
    Gravity([f64; D]),
    /// Force per unit volume at the start of the step, [force/volume], eq. (24).
    BodyForce(VectorFormula<D>),
    /// Force per unit mass, [length/time²]; the mass of each point is constant.
    MassForce(VectorFormula<D>),
    /// The same force on each listed point, [force], eq. (25).
    PointForce {
        /// Permanent numbers of the points.
        points: Vec<u32>,
        /// Force on each point at load factor 1, [force].
        force: [f64; D],
    },
    /// Force per unit original area of a surface, [stress]; it does not turn with the surface.
    Traction {
        /// Index of the surface.
        surface: usize,
        /// Formula of the traction.
        traction: VectorFormula<D>,
    },
    /// Pressure on a surface, [stress].
    Pressure {
        /// Index of the surface.
        surface: usize,
        /// The pressure.
        pressure: Pressure<D>,
    },
}

impl<const D: usize> Action<D> {
    /// Index of the surface on which the load acts; `None` if it acts on material points.
    pub fn surface(&self) -> Option<usize> {
        match self {
            Action::Traction { surface, .. } | Action::Pressure { surface, .. } => Some(*surface),
            Action::Gravity(_) | Action::BodyForce(_) | Action::MassForce(_) | Action::PointForce { .. } => {
                None
            }
        }
    }
}

/// A pressure on a surface, [stress]. Unless it is a dead load, it acts on the current area along the current normal.
#[derive(Debug, Clone)]
pub enum Pressure<const D: usize> {
    /// A formula of the position at the start of the step, of the original position, and of the load factor.
    Given(VectorFormula<D, 1>),
    /// A formula as in [`Pressure::Given`], but the pressure acts along the original normal on the original area.
    Dead(VectorFormula<D, 1>),
    /// The load factor times `unit_weight` max(`level` − y, 0) at the current position, with y along the last axis.
    Hydrostatic {
        /// Coordinate of the free surface along the last axis, [length].
        level: f64,
        /// Weight of the liquid per unit volume, [force/volume].
        unit_weight: f64,
    },
}

/// A quantity with `C` components (one per axis, or a single one), each a formula in position, original position and
/// load factor.
///
/// The variables of every component are, in this order: position x (`D` values), original position X (`D` values), the
/// load factor, and the intermediate values. An intermediate value may use all variables before it.
#[derive(Debug, Clone)]
pub struct VectorFormula<const D: usize, const C: usize = D> {
    intermediate: Vec<Formula>,
    components: [Formula; C],
    /// For each component, true if its formula does not depend on the load factor; the component is then multiplied by
    /// the factor.
    scaled: [bool; C],
}

impl<const D: usize, const C: usize> VectorFormula<D, C> {
    /// Builds the vector from formulas of the variables that [`VectorFormula`] lists; only the first
    /// [`MAX_INTERMEDIATE`] intermediate values are kept.
    pub fn new(mut intermediate: Vec<Formula>, components: [Formula; C]) -> Self {
        intermediate.truncate(MAX_INTERMEDIATE);
        let fixed = 2 * D + 1;
        let mut explicit = vec![false; intermediate.len()];
        let depends = |formula: &Formula, explicit: &[bool]| {
            formula.depends_on(2 * D)
                || (0..explicit.len()).any(|k| explicit[k] && formula.depends_on(fixed + k))
        };
        for k in 0..intermediate.len() {
            explicit[k] = depends(&intermediate[k], &explicit);
        }
        let scaled = std::array::from_fn(|d| !depends(&components[d], &explicit));
        VectorFormula { intermediate, components, scaled }
    }

    /// Evaluates the vector at a load factor. Components that do not depend on the factor are multiplied by it.
    pub fn evaluate(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> [f64; C] {
        let values = self.values(x, original, factor);
        std::array::from_fn(|d| {
            let value = self.components[d].evaluate(&values);
            if self.scaled[d] { value * factor } else { value }
        })
    }

    /// Values of all variables, including the intermediate values.
    fn values(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> [f64; 7 + MAX_INTERMEDIATE] {
        let mut values = [0.0; 7 + MAX_INTERMEDIATE];
        values[..D].copy_from_slice(x);
        values[D..2 * D].copy_from_slice(original);
        values[2 * D] = factor;
        for (known, formula) in (2 * D + 1..).zip(&self.intermediate) {
            values[known] = formula.evaluate(&values[..known]);
        }
        values
    }

    /// Text and value of the first formula whose value is not finite; intermediate values are checked before
    /// components.
    pub fn not_finite(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> Option<(&str, f64)> {
        let values = self.values(x, original, factor);
        let intermediate = self.intermediate.iter().zip(&values[2 * D + 1..]).map(|(f, v)| (f, *v));
        let components = self.components.iter().zip(self.evaluate(x, original, factor));
        let mut all = intermediate.chain(components);
        all.find(|(_, value)| !value.is_finite()).map(|(formula, value)| (formula.text(), value))
    }
}

/// A named external force.
#[derive(Debug, Clone)]
pub struct Load<const D: usize> {
    /// Name of the load.
    pub name: String,
    /// Kind and magnitude of the load.
    pub action: Action<D>,
    /// For each body, true if the load acts on it.
    pub acts_on: Vec<bool>,
    /// Load factor over time.
    pub curve: LoadCurve,
}

impl LoadCurve {
    /// Load factor of a tool at a time, [-]. If the common load factor follows from equilibrium, `unknown` is its
    /// value: the fraction, reached so far, of the change of the curve over the stage.
    pub fn factor_of_tool(&self, stepping: &Stepping, time: f64, unknown: f64) -> f64 {
        if stepping.control.has_unknown_factor() {
            self.factor(stepping.start_time) + unknown * self.factor_per_unknown(stepping)
        } else {
            self.factor(time)
        }
    }

    /// Derivative of the load factor of a tool with respect to the common load factor, [-]; 0 if the common load factor
    /// does not follow from equilibrium.
    pub fn factor_per_unknown(&self, stepping: &Stepping) -> f64 {
        if stepping.control.has_unknown_factor() {
            self.factor(stepping.end_time) - self.factor(stepping.start_time)
        } else {
            0.0
        }
    }
}

impl<const D: usize> Load<D> {
    /// The load factor at the start of the stage, and the load factor at its end when the common factor has grown from
    /// 0 to 1. At time 0, nothing is loaded.
    pub fn factors_of_stage(&self, stepping: &Stepping) -> (f64, f64) {
        let from = stepping.start_time;
        let stands = if from > 0.0 { self.curve.factor(from) } else { 0.0 };
        (stands, self.curve.factor(stepping.end_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_curves_interpolate_and_stay_constant_outside() {
        let curve = LoadCurve::table(vec![[0.0, 0.0], [0.5, 2.0], [1.0, -1.0]]);
        for (time, factor) in
            [(-1.0, 0.0), (0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 0.5), (1.0, -1.0), (9.0, -1.0)]
        {
            assert_eq!(curve.factor(time), factor);
        }
        assert_eq!(LoadCurve::ramp(2.0).factor(1.5), 0.75);
    }
}
