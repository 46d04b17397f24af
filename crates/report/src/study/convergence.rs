//! Convergence studies: a quantity on several grids, the value it tends to as cells shrink, and an error bar.
//!
//! From the values Q₁, Q₂, Q₃ on cells h₁ < h₂ < h₃ follow the order o, from
//! (Q₂ − Q₃)/(Q₁ − Q₂) = r₁ᵒ (r₂ᵒ − 1)/(r₁ᵒ − 1) with r₁ = h₂/h₁ and r₂ = h₃/h₂, the extrapolated value
//! Q = Q₁ + (Q₁ − Q₂)/(r₁ᵒ − 1) (Richardson 1911), and the bar 1.25 |Q₁ − Q₂|/(r₁ᵒ − 1) (Roache 1994).

use std::path::Path;
use std::str::FromStr;
use std::{fmt, io};

use serde::Serialize;

use mpm_core::formula::closest;
use mpm_deck::quoting::{list, quote};
use mpm_files::replace::replace_file;
use mpm_files::shortest;
use mpm_files::table::quoted;

use super::Record;
use super::family::Grid;
use super::strength::ends_of;

/// Name of the factor of safety as a quantity.
const FACTOR_OF_SAFETY: &str = "factor_of_safety";
/// Name of the limit load as a quantity.
const LIMIT_LOAD: &str = "limit_load";
/// Prefix of a column whose largest value counts.
const LARGEST: &str = "largest:";

/// Factor of safety of the bar of an extrapolated value, [-].
const SAFETY: f64 = 1.25;
/// The largest change between grids times this is the bar of a value without order, [-].
const WITHOUT_ORDER: f64 = 3.0;
/// Orders that count as orders of convergence, [-].
const ORDERS: [f64; 2] = [0.5, 2.5];
/// Changes below this, relative to the value, are those of the solution of the equations, [-].
const SETTLED: f64 = 1e-7;

/// Smallest cells of a prediction, relative to the finest grid, [-].
const FINEST: f64 = 1e-2;

/// A number that a run gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Quantity {
    /// The last value of a column of `history.csv`, or an extent of a body.
    AtEnd(String),
    /// The value of largest magnitude of a column of `history.csv`.
    Largest(String),
    /// The factor of safety of the last strength reduction.
    FactorOfSafety,
    /// The limit load of the last stage that ends at one.
    LimitLoad,
}

impl FromStr for Quantity {
    type Err = String;

    fn from_str(text: &str) -> Result<Quantity, String> {
        let text = text.trim();
        Ok(match text.strip_prefix(LARGEST) {
            Some(name) if !name.is_empty() => Quantity::Largest(name.to_owned()),
            None if text == FACTOR_OF_SAFETY => Quantity::FactorOfSafety,
            None if text == LIMIT_LOAD => Quantity::LimitLoad,
            None if !text.is_empty() => Quantity::AtEnd(text.to_owned()),
            _ => {
                return Err(
                    "expected a column of history.csv, largest:COLUMN, factor_of_safety or limit_load"
                        .to_owned(),
                );
            }
        })
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Quantity::AtEnd(name) => f.write_str(name),
            Quantity::Largest(name) => write!(f, "{LARGEST}{name}"),
            Quantity::FactorOfSafety => f.write_str(FACTOR_OF_SAFETY),
            Quantity::LimitLoad => f.write_str(LIMIT_LOAD),
        }
    }
}

/// A value, and the distance within which a run knows it: half the width of a bracket.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Known {
    /// The value.
    pub value: f64,
    /// The distance.
    pub within: f64,
}

impl Known {
    fn between([a, b]: [f64; 2]) -> Known {
        Known { value: 0.5 * (a + b), within: 0.5 * (b - a).abs() }
    }
}

impl Quantity {
    /// The value in the results of a run.
    ///
    /// # Errors
    /// In words, if the results do not have it.
    pub fn value(&self, record: &Record) -> Result<Known, String> {
        let exactly = |value: f64| Known { value, within: 0.0 };
        match self {
            Quantity::AtEnd(name) => {
                let extents = record.extents();
                let mut all = record.history().iter().chain(&extents);
                let text = all.find(|(known, _)| known == name).map(|(_, text)| text);
                match text.map(|text| text.parse()) {
                    Some(Ok(value)) => Ok(exactly(value)),
                    Some(Err(_)) => Err(format!("{} has no value", quote(name))),
                    None => Err(unknown(name, record, &extents)),
                }
            }
            Quantity::Largest(name) => match record.largest(name) {
                Some(value) => Ok(exactly(value)),
                None => Err(unknown(name, record, &[])),
            },
            Quantity::FactorOfSafety => {
                let bracket = record.strength().and_then(|bracket| ends_of(&bracket));
                bracket.map(Known::between).ok_or_else(|| {
                    "no stage has bracketed a factor of safety (`control: {type: strength-reduction}`)"
                        .to_owned()
                })
            }
            Quantity::LimitLoad => record
                .limit_load()
                .map(Known::between)
                .ok_or_else(|| "no stage has ended at a limit load: `steps: {until: limit}` is missing, or the load still grew at the \
                 end"
                    .to_owned()),
        }
    }
}

/// Error of a column that does not exist.
fn unknown(name: &str, record: &Record, extents: &[(String, String)]) -> String {
    let names = || record.history().iter().chain(extents).map(|(name, _)| name.as_str());
    let help = match closest(name, names()) {
        Some(best) => format!("did you mean {}?", quote(best)),
        None => format!("there are {}, {FACTOR_OF_SAFETY} and {LIMIT_LOAD}", list(names())),
    };
    format!("the results have no quantity {}; {help}", quote(name))
}

/// The value of a quantity on one grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnGrid {
    /// Size of the cells, in any unit.
    pub size: f64,
    /// The value.
    pub known: Known,
    /// CPU time of the run, [second].
    pub cpu_seconds: f64,
}

/// How the values on three grids lie to each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind", content = "why")]
pub enum Trend {
    /// They tend to a value with an order: the value is extrapolated.
    Order,
    /// They change by no more than the solution of the equations does.
    Settled,
    /// They have no order that could be trusted, for this reason: the value is that on the finest grid.
    NoOrder(String),
    /// Nothing can be concluded from them, for this reason: they are only listed.
    Refused(String),
}

/// The value that a quantity tends to, with its error bar.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// How it was found.
    pub trend: Trend,
    /// Order of convergence, [-], where the values change in one direction.
    pub order: Option<f64>,
    /// The value; that on the finest grid unless `trend` is an order.
    pub value: f64,
    /// Half the length of the error bar; `None` if nothing can be concluded.
    pub bar: Option<f64>,
    /// Part of the bar that a moved grid adds.
    pub spread: f64,
}

/// The estimate from three grids, from coarse to fine. `spread` is the change of the value on a grid whose lines are
/// moved; `refused` is a reason not to extrapolate.
pub fn estimate(grids: [OnGrid; 3], spread: f64, refused: Option<String>) -> Estimate {
    let [coarse, middle, fine] = grids;
    let [coarse_value, middle_value, value] = grids.map(|grid| grid.known.value);
    let changes = [middle_value - coarse_value, value - middle_value];
    let ratios = [coarse.size / middle.size, middle.size / fine.size];
    let largest = grids.iter().fold(0.0, |largest: f64, grid| largest.max(grid.known.value.abs()));
    let uncertain = grids.iter().fold(0.0, |largest: f64, grid| largest.max(grid.known.within));
    let order = order(changes, ratios);
    let change = changes[0].abs().max(changes[1].abs());
    if let Some(why) = refused {
        return Estimate { trend: Trend::Refused(why), order, value, bar: None, spread };
    }
    if change <= SETTLED * largest {
        return Estimate {
            trend: Trend::Settled,
            order: None,
            value,
            bar: Some(change.max(SETTLED * largest) + spread + uncertain),
            spread,
        };
    }
    let why = match order {
        None if changes[0] * changes[1] <= 0.0 => "the values do not change in one direction",
        None => "the values do not approach each other",
        Some(order) if order < ORDERS[0] => "the order is below 0.5",
        Some(order) if order > ORDERS[1] => "the order is above 2.5: the coarsest grid says little",
        // Changes within the brackets have no meaning.
        Some(_) if 2.0 * uncertain >= changes[1].abs() => {
            "the brackets of the values are as wide as their changes"
        }
        Some(order) => {
            let share = 1.0 / (ratios[1].powf(order) - 1.0);
            let step = changes[1] * share;
            let bar = SAFETY * step.abs()
                + spread
                + fine.known.within
                + (fine.known.within + middle.known.within) * share;
            return Estimate {
                trend: Trend::Order,
                order: Some(order),
                value: value + step,
                bar: Some(bar),
                spread,
            };
        }
    };
    let bar = WITHOUT_ORDER * change + spread + uncertain;
    Estimate { trend: Trend::NoOrder(why.to_owned()), order, value, bar: Some(bar), spread }
}

/// The order at which two changes, between grids from coarse to fine with these ratios of cell sizes, follow from one
/// power of the cell size; `None` if they have different signs or do not decrease.
fn order(changes: [f64; 2], ratios: [f64; 2]) -> Option<f64> {
    let quotient = changes[0] / changes[1];
    let predicted = |order: f64| {
        let [coarse, fine] = ratios.map(|ratio| ratio.powf(order));
        fine * (coarse - 1.0) / (fine - 1.0)
    };
    // From ln r₂/ln r₁ at order 0, the quotient grows with the order.
    let [mut low, mut high] = [1e-6, 64.0];
    if !quotient.is_finite() || quotient < predicted(low) {
        return None;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if predicted(middle) < quotient { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// A finer grid on which the error is expected to be as small as wanted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Prediction {
    /// Wanted error, relative to the value, [-].
    pub error: f64,
    /// Size of its cells relative to the finest grid so far, [-].
    pub size: f64,
    /// CPU time of the run, [second].
    pub cpu_seconds: f64,
}

impl Estimate {
    /// The bar relative to the value, [-]; `None` without a bar or for a value of zero.
    pub fn relative_bar(&self) -> Option<f64> {
        self.bar.map(|bar| bar / self.value.abs()).filter(|relative| relative.is_finite())
    }

    /// The grid for an error relative to the value. The cost grows with the power of the cell size that the last two
    /// runs show, and at least with the number of cells; `dimensions` is the number of axes. `None` without an order.
    pub fn prediction(&self, error: f64, grids: [OnGrid; 3], dimensions: usize) -> Option<Prediction> {
        let (Trend::Order, Some(order)) = (&self.trend, self.order) else { return None };
        let size = (error / self.relative_bar()?).powf(1.0 / order).min(1.0);
        let [_, middle, fine] = grids;
        let shown = (fine.cpu_seconds / middle.cpu_seconds).ln() / (middle.size / fine.size).ln();
        let power = if shown.is_finite() { shown.max(dimensions as f64) } else { dimensions as f64 };
        // Beyond this, an extrapolation from three grids says nothing.
        (size >= FINEST).then(|| Prediction {
            error,
            size,
            cpu_seconds: fine.cpu_seconds * size.powf(-power),
        })
    }
}

/// One run of a convergence study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GridRun {
    /// What distinguishes its grid, such as `h=0.5`.
    pub label: String,
    /// Name of its results directory.
    pub directory: String,
    /// Size of its cells: the geometric mean of their sides, or for a mesh the size that follows from the number of
    /// points, [length].
    pub size: f64,
    /// Number of points.
    pub points: Option<f64>,
    /// The quantity.
    #[serde(flatten)]
    pub known: Known,
    /// CPU time of the run, [second].
    pub cpu_seconds: f64,
}

impl GridRun {
    /// Reads the quantity from the results of a deck on a grid, in `directory`; `dimensions` is the number of axes.
    ///
    /// # Errors
    /// As for [`Quantity::value`].
    pub fn read(
        record: &Record,
        quantity: &Quantity,
        grid: &Grid,
        dimensions: usize,
        directory: String,
    ) -> Result<GridRun, String> {
        let known = quantity.value(record)?;
        let points = record.points();
        let from_points = || points.map(|points| points.powf(-1.0 / dimensions as f64));
        let size = grid.size.or_else(from_points).unwrap_or(1.0);
        Ok(GridRun {
            label: grid.label.clone(),
            directory,
            size,
            points,
            known,
            cpu_seconds: record.cpu_seconds(),
        })
    }

    /// The value on this grid.
    pub fn on_grid(&self) -> OnGrid {
        OnGrid { size: self.size, known: self.known, cpu_seconds: self.cpu_seconds }
    }
}

/// Why a study has no run with moved lines if that run ends early; the other grids have a conclusion without it.
pub const MOVED_NOT_ENDED: &str = "the run on the moved grid has not reached its end";

/// What the runs of a convergence study have found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Findings {
    /// Name of the deck.
    pub deck: String,
    /// Title of the deck.
    pub title: Option<String>,
    /// The quantity, as it was asked for.
    pub quantity: String,
    /// Number of axes.
    pub dimensions: usize,
    /// At least three runs, from coarse to fine.
    pub grids: Vec<GridRun>,
    /// The run on one of these grids with its inner lines moved.
    pub moved: Option<GridRun>,
    /// Why there is no such run, or why some axes are left out, in words.
    pub not_moved: Option<String>,
    /// Why the values need not tend to one, in words.
    pub refused: Option<String>,
}

/// A convergence study and its conclusions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Convergence {
    /// What was found.
    #[serde(flatten)]
    pub findings: Findings,
    /// The conclusion from the three finest grids.
    pub estimate: Estimate,
    /// Grids for smaller errors.
    pub predictions: Vec<Prediction>,
}

impl Findings {
    /// Adds the run on the next grid.
    ///
    /// # Errors
    /// In words, if its cells are not smaller than those of the grid before.
    pub fn add(&mut self, run: GridRun) -> Result<(), String> {
        if let Some(last) = self.grids.last().filter(|last| last.size <= run.size) {
            return Err(format!(
                "the grid with {} is not finer than that with {}: list grids from coarse to fine",
                run.label, last.label
            ));
        }
        self.grids.push(run);
        Ok(())
    }

    /// The three finest grids, from coarse to fine; `None` if there are fewer.
    pub fn last_three(&self) -> Option<[OnGrid; 3]> {
        let last = self.grids.last_chunk::<3>()?;
        Some(last.each_ref().map(GridRun::on_grid))
    }

    /// The change of the value as grid lines move, on the finest grid: it shrinks at least in proportion to the cells.
    fn spread(&self) -> f64 {
        let like = |moved: &GridRun| self.grids.iter().find(|run| run.size == moved.size).cloned();
        let pair = self.moved.as_ref().and_then(|moved| Some((moved, like(moved)?)));
        let (Some((moved, like)), Some(finest)) = (pair, self.grids.last()) else { return 0.0 };
        (moved.known.value - like.known.value).abs() * (finest.size / like.size).min(1.0)
    }

    /// The conclusions, with the grids that errors of these sizes need, relative to the value; `None` with fewer than
    /// three grids.
    pub fn conclude(self, errors: &[f64]) -> Option<Convergence> {
        let grids = self.last_three()?;
        let estimate = estimate(grids, self.spread(), self.refused.clone());
        let predict = |error: &f64| estimate.prediction(*error, grids, self.dimensions);
        let predictions = errors.iter().filter_map(predict).collect();
        Some(Convergence { findings: self, estimate, predictions })
    }
}

impl Convergence {
    /// Writes the study as `convergence_study.json`, and the values as the table `convergence_study.csv`.
    ///
    /// # Errors
    /// A file-system error.
    pub fn write(&self, directory: &Path) -> io::Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        replace_file(&directory.join("convergence_study.json"), |out| out.write_all(text.as_bytes()))?;
        let mut table = "grid,size,points,value,within,cpu_seconds\n".to_owned();
        for run in self.findings.grids.iter().chain(&self.findings.moved) {
            let numbers = [
                Some(run.size),
                run.points,
                Some(run.known.value),
                Some(run.known.within),
                Some(run.cpu_seconds),
            ];
            let numbers = numbers.map(|number| number.map_or_else(String::new, shortest));
            table.push_str(&format!("{},{}\n", quoted(&run.label), numbers.join(",")));
        }
        replace_file(&directory.join("convergence_study.csv"), |out| out.write_all(table.as_bytes()))
    }

    /// The conclusion in a sentence.
    pub fn conclusion(&self) -> String {
        let Estimate { trend, order, value, bar, .. } = &self.estimate;
        let name = quote(&self.findings.quantity);
        let value = significant(*value, 6);
        let Some(bar) = bar else {
            let Trend::Refused(why) = trend else { return format!("{name} is {value}") };
            return format!("no error bar: {why}; {name} is {value} on the finest grid");
        };
        let relative = self.estimate.relative_bar();
        let relative =
            relative.map_or_else(String::new, |bar| format!(" ({} %)", significant(100.0 * bar, 2)));
        let bar = significant(*bar, 2);
        match trend {
            Trend::Order => {
                let order = significant(order.unwrap_or_default(), 3);
                format!("{name} tends to {value} ± {bar}{relative}, with order {order}")
            }
            Trend::Settled => format!("{name} is {value} ± {bar}{relative}: it does not depend on the grid"),
            Trend::NoOrder(why) => {
                format!("{name} is {value} ± {bar}{relative} on the finest grid, not extrapolated: {why}")
            }
            Trend::Refused(_) => format!("{name} is {value}"),
        }
    }
}

/// A number with this many significant digits.
fn significant(value: f64, digits: usize) -> String {
    shortest(format!("{value:.*e}", digits - 1).parse().unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grids(sizes: [f64; 3], value: impl Fn(f64) -> f64) -> [OnGrid; 3] {
        sizes.map(|size| OnGrid {
            size,
            known: Known { value: value(size), within: 0.0 },
            cpu_seconds: size.powi(-3),
        })
    }

    #[test]
    fn a_power_of_the_cell_size_is_extrapolated_exactly() {
        for sizes in [[4.0, 2.0, 1.0], [3.0, 2.0, 1.0], [0.9, 0.5, 0.4]] {
            for power in [0.6, 1.0, 2.0, 2.4] {
                let found = estimate(grids(sizes, |h| 5.0 - 0.3 * h.powf(power)), 0.0, None);
                assert_eq!(found.trend, Trend::Order);
                assert!((found.order.unwrap() - power).abs() < 1e-9, "{sizes:?} {power} {found:?}");
                assert!((found.value - 5.0).abs() < 1e-9, "{sizes:?} {power} {found:?}");
                let error = 0.3 * sizes[2].powf(power);
                assert!((found.bar.unwrap() - 1.25 * error).abs() < 1e-9, "{sizes:?} {power} {found:?}");
            }
        }
    }

    #[test]
    fn a_moved_grid_and_brackets_widen_the_bar() {
        let exact = grids([4.0, 2.0, 1.0], |h| 5.0 + h);
        let bar = |within: f64, spread: f64| {
            let grids = exact.map(|g| OnGrid { known: Known { within, ..g.known }, ..g });
            estimate(grids, spread, None).bar.unwrap()
        };
        assert!((bar(0.0, 0.1) - bar(0.0, 0.0) - 0.1).abs() < 1e-12);
        assert!((bar(0.01, 0.0) - bar(0.0, 0.0) - 0.03).abs() < 1e-12);
    }

    #[test]
    fn values_without_order_are_not_extrapolated() {
        let with = |values: [f64; 3]| {
            let mut index = 0;
            estimate(
                grids([4.0, 2.0, 1.0], |_| 0.0).map(|mut grid| {
                    grid.known.value = values[index];
                    index += 1;
                    grid
                }),
                0.0,
                None,
            )
        };
        for (values, bar) in [
            ([1.0, 1.1, 1.05], 0.3),
            ([1.0, 1.1, 1.3], 0.6),
            ([1.0, 1.1, 1.19], 0.3),
            ([1.0, 1.1, 1.101], 0.3),
        ] {
            let found = with(values);
            assert!(matches!(found.trend, Trend::NoOrder(_)), "{found:?}");
            assert_eq!(found.value, values[2]);
            assert!((found.bar.unwrap() - bar).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(with([2.0, 2.0, 2.0 + 1e-9]).trend, Trend::Settled);
        let refused = estimate(grids([4.0, 2.0, 1.0], |h| h), 0.0, Some("why".to_owned()));
        assert_eq!((refused.bar, refused.trend), (None, Trend::Refused("why".to_owned())));
    }

    #[test]
    fn the_cost_of_a_wanted_error() {
        let grids = grids([4.0, 2.0, 1.0], |h| 10.0 + h);
        let found = estimate(grids, 0.0, None);
        // The bar is 1.25 of 10, so an error of 1.25 % needs a tenth of the cells' size and 1000 times the time.
        let predicted = found.prediction(0.0125, grids, 2).unwrap();
        assert!((predicted.size - 0.1).abs() < 1e-9 && (predicted.cpu_seconds - 1e3).abs() < 1e-6);
        assert_eq!(found.prediction(0.5, grids, 2).unwrap().size, 1.0);
    }

    #[test]
    fn quantities_read_back() {
        for text in ["push_ry", "largest:push_ry", "factor_of_safety", "limit_load"] {
            assert_eq!(text.parse::<Quantity>().unwrap().to_string(), text);
        }
        assert!("".parse::<Quantity>().is_err() && "largest:".parse::<Quantity>().is_err());
    }
}
