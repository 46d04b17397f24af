//! The curves of one run or of several.

use mpm_core::quality::newton_order;
use mpm_deck::Deck;

use super::chart::{Axis, Band, Chart, Curve, Look};
use super::number::html;
use super::page::escape;
use super::run::{Run, State};
use super::stages::{bands_over_steps, bands_over_time};
use super::units::Quantity;

/// Largest number of curves in one chart.
const MAX_CURVES: usize = 12;
/// Largest number of steps whose residuals are drawn.
const MAX_STEPS: usize = 40;
/// Forces and displacements below this share of the largest count as round-off.
const ROUND_OFF: f64 = 1e-9;
/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// The abscissa of curves over the run: the load factor if all loads grow in proportion to time, otherwise time.
pub(super) struct Progress {
    by_factor: bool,
}

impl Progress {
    /// The abscissa that suits all runs.
    pub fn common(runs: &[Run]) -> Progress {
        Progress { by_factor: runs.iter().all(|run| run.is_ramp() && run.end_time().is_some()) }
    }

    /// True if the abscissa is the load factor.
    pub fn is_factor(&self) -> bool {
        self.by_factor
    }

    /// Name of the abscissa.
    pub fn name(&self) -> &'static str {
        if self.by_factor { "load factor" } else { "time" }
    }

    /// The axis of the abscissa.
    pub fn axis(&self) -> Axis {
        let quantity = if self.by_factor { Quantity::Number } else { Quantity::Time };
        Axis { contains: vec![0.0], ..Axis::new(self.name(), quantity) }
    }

    /// Value of the abscissa at a time.
    pub fn at(&self, run: &Run, time: f64) -> f64 {
        match run.end_time() {
            Some(end) if self.by_factor => time / end,
            _ => time,
        }
    }

    /// Values of the abscissa at the ends of the steps, each with the value of a column. The first point is the
    /// undeformed state, since nothing acts at time 0 regardless of the load curves; if the bodies are stressed at time
    /// 0, the first point is the end of the first step.
    pub fn points(&self, run: &Run, column: &str) -> Vec<[f64; 2]> {
        let times = run.column("time").iter().map(|time| self.at(run, *time));
        let values = times.zip(run.column(column)).map(|(x, y)| [x, *y]);
        let undeformed = (!run.begins_stressed()).then_some([0.0, 0.0]);
        undeformed.into_iter().chain(values).collect()
    }
}

/// A column of `history.csv` of a named boundary condition, load or probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Component {
    /// The column.
    pub column: String,
    /// Name of the boundary condition, load or probe.
    pub name: String,
    /// Axis of the component.
    pub axis: &'static str,
}

impl Component {
    /// Name and axis.
    pub fn label(&self) -> String {
        format!("{} {}", self.name, self.axis)
    }
}

/// The largest magnitude of a column of `history.csv`.
pub(super) fn largest(run: &Run, column: &str) -> f64 {
    run.column(column).iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Components of a kind (`r` reactions, `f` loads, `u` displacements) that exceed round-off in some run.
pub(super) fn components(runs: &[Run], letter: char) -> Vec<Component> {
    let mut found: Vec<Component> = Vec::new();
    for run in runs {
        for axis in AXES {
            for name in run.names_before(&format!("_{letter}{axis}")) {
                let component =
                    Component { column: format!("{name}_{letter}{axis}"), name: name.to_owned(), axis };
                if !found.contains(&component) {
                    found.push(component);
                }
            }
        }
    }
    let size =
        |component: &Component| runs.iter().map(|run| largest(run, &component.column)).fold(0.0, f64::max);
    let most = found.iter().map(size).fold(0.0, f64::max);
    found.retain(|component| size(component) > ROUND_OFF * most);
    // In the order of the deck, with the axes of one entry together.
    let order: Vec<String> = found.iter().map(|component| component.name.clone()).collect();
    found.sort_by_key(|component| (order.iter().position(|name| *name == component.name), component.axis));
    found
}

fn chart(description: String, x: Axis, y: Axis, curves: Vec<Curve>) -> Chart {
    Chart { description, x, y, curves, levels: Vec::new(), bands: Vec::new(), height: 320.0 }
}

/// The components of one run against load factor or time, in charts of at most [`MAX_CURVES`] curves.
pub(super) fn against_load(
    run: &Run,
    components: &[Component],
    name: &str,
    quantity: Quantity,
) -> Vec<Chart> {
    let progress = Progress::common(std::slice::from_ref(run));
    let chart_of = |group: &[Component]| {
        let curve = |(number, component): (usize, &Component)| Curve {
            name: component.label(),
            points: progress.points(run, &component.column),
            look: Look::Number(number),
        };
        let description = format!("{name} against {}", progress.name());
        let curves = group.iter().enumerate().map(curve).collect();
        let chart = chart(description, progress.axis(), Axis::new(name, quantity), curves);
        Chart { bands: bands_over_time(run), ..chart }
    };
    components.chunks(MAX_CURVES).map(chart_of).collect()
}

/// A component in all runs, against load factor or time.
pub(super) fn across_runs(runs: &[Run], column: &str, name: &str, quantity: Quantity) -> Chart {
    let progress = Progress::common(runs);
    let curve = |(number, run): (usize, &Run)| Curve {
        name: run.name.clone(),
        points: progress.points(run, column),
        look: Look::Number(number),
    };
    let curves =
        runs.iter().enumerate().filter(|(_, run)| !run.column(column).is_empty()).map(curve).collect();
    let description = format!("{name} against {}, for each run", progress.name());
    chart(description, progress.axis(), Axis::new(name, quantity), curves)
}

/// The load-displacement chart and its caption. The ordinate is the largest reaction of the conditions that move, if
/// any; otherwise the resultant of each load if several act, or else the largest reaction. The abscissa is the largest
/// displacement.
pub(super) fn load_displacement(runs: &[Run]) -> Option<(String, Chart)> {
    let size =
        |component: &Component| runs.iter().map(|run| largest(run, &component.column)).fold(0.0, f64::max);
    let displacement = components(runs, 'u').into_iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let moves = |name: &str| runs.iter().any(|run| run.moves(name));
    let mut reactions = components(runs, 'r');
    let is_driven = reactions.iter().any(|reaction| moves(&reaction.name));
    reactions.retain(|reaction| !is_driven || moves(&reaction.name));
    let loads = if is_driven { Vec::new() } else { components(runs, 'f') };
    let has_several_loads = loads.iter().any(|load| load.name != loads[0].name);
    let forces = if has_several_loads {
        loads
    } else {
        reactions.into_iter().max_by(|a, b| size(a).total_cmp(&size(b))).into_iter().collect()
    };
    let has_all = |run: &Run| {
        forces.iter().chain([&displacement]).all(|component| !run.column(&component.column).is_empty())
    };
    let number_of_curves = runs.len() * forces.len();
    if number_of_curves == 0 || number_of_curves > MAX_CURVES || !runs.iter().all(has_all) {
        return None;
    }
    let progress = Progress::common(runs);
    let mut curves = Vec::new();
    for run in runs {
        for force in &forces {
            let displacements = progress.points(run, &displacement.column);
            let values = progress.points(run, &force.column);
            let points = displacements.iter().zip(values).map(|(u, r)| [u[1], r[1]]).collect();
            let parts =
                [(runs.len() > 1).then(|| run.name.clone()), has_several_loads.then(|| force.label())];
            let name = parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
            curves.push(Curve { name, points, look: Look::Number(curves.len()) });
        }
    }
    let x = Axis::new(&format!("displacement of {}", displacement.label()), Quantity::Length);
    let what =
        if has_several_loads { "load".to_owned() } else { format!("reaction of {}", forces[0].label()) };
    let chart = chart(format!("{what} against {}", x.name), x, Axis::new(&what, Quantity::Force), curves);
    let force = if has_several_loads {
        "resultant of each load".to_owned()
    } else {
        format!("reaction of <code>{}</code> along {}", escape(&forces[0].name), forces[0].axis)
    };
    let caption = format!(
        "Load and displacement: {force} against displacement of <code>{}</code> along {}.",
        escape(&displacement.name),
        displacement.axis
    );
    Some((caption, chart))
}

/// Work and energy of a run against load factor or time.
pub(super) fn energies(run: &Run) -> Chart {
    let progress = Progress::common(std::slice::from_ref(run));
    let mut named = vec![("external work", "external_work"), ("strain energy", "strain_energy")];
    let in_motion = [
        ("kinetic energy", "kinetic_energy"),
        ("plastic work", "plastic_energy"),
        ("friction", "friction_energy"),
        ("absorbed by boundaries", "absorbed_energy"),
        ("defect", "defect_energy"),
    ];
    let changes = |(_, column): &(&str, &str)| run.column(column).iter().any(|x| x.is_finite() && *x != 0.0);
    named.extend(in_motion.into_iter().filter(|of| run.column("kinetic_energy").len() > 1 && changes(of)));
    let curve = |(number, (name, column)): (usize, (&str, &str))| Curve {
        name: name.to_owned(),
        points: progress.points(run, column),
        look: Look::Number(number),
    };
    let curves = named.iter().copied().enumerate().map(curve).collect();
    let names: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
    let description = match names.len() {
        2 => format!("external work and strain energy against {}", progress.name()),
        _ => format!("{} against {}", names.join(", "), progress.name()),
    };
    let chart = chart(description, progress.axis(), Axis::new("energy", Quantity::Energy), curves);
    Chart { bands: bands_over_time(run), height: 240.0, ..chart }
}

/// The residuals of the steps of a run, one curve per step, with the number of steps drawn and the total number.
pub(super) fn residuals(run: &Run) -> Option<(Chart, usize, usize)> {
    let steps = run.residuals();
    let failed = match run.state {
        State::Failed(..) => steps.last().map(|(step, _)| *step).filter(|step| *step > run.steps()),
        _ => None,
    };
    let (first, last) = (steps.first()?.0, steps.last()?.0);
    let stride = steps.len().div_ceil(MAX_STEPS);
    let longest = (0..steps.len()).rev().max_by_key(|index| steps[*index].1.len())?;
    let is_drawn =
        |index: usize| index.is_multiple_of(stride) || index == longest || index + 1 == steps.len();
    let mut curves = Vec::new();
    for (index, (step, residuals)) in steps.iter().enumerate().filter(|(index, _)| is_drawn(*index)) {
        let share = index as f64 / (steps.len() - 1).max(1) as f64;
        let name = match *step {
            step if Some(step) == failed => format!("step {step}, failed"),
            step if [first, last, steps[longest].0].contains(&step) => format!("step {step}"),
            _ => String::new(),
        };
        let positive = residuals.iter().enumerate().filter(|(_, r)| **r > 0.0);
        let points = positive.map(|(iteration, r)| [iteration as f64, *r]).collect();
        let look = if Some(*step) == failed { Look::Alarm } else { Look::Family(share) };
        curves.push(Curve { name, points, look });
    }
    let drawn = curves.len();
    let y = Axis { logarithmic: true, ..Axis::new("relative out-of-balance force", Quantity::Number) };
    let description = "residual against iteration, one curve per load step".to_owned();
    let mut chart = chart(description, Axis::counting("iteration"), y, curves);
    if let Some(deck) = &run.deck {
        let levels = deck.tolerances().into_iter().map(|tolerance| (tolerance, "tolerance".to_owned()));
        chart.levels.extend(levels);
    }
    chart.height = 360.0;
    Some((chart, drawn, steps.len()))
}

/// The tolerance of the residual of a step.
pub(super) fn tolerance_in_words(deck: &Deck) -> String {
    let tolerances = deck.tolerances();
    let least = tolerances.iter().copied().fold(f64::INFINITY, f64::min);
    let most = tolerances.iter().copied().fold(0.0, f64::max);
    if least == most {
        format!("tolerance {}", html(most, 3))
    } else {
        format!("tolerances of the stages between {} and {}", html(least, 3), html(most, 3))
    }
}

/// The axis of load steps, starting at 0.
fn load_steps() -> Axis {
    Axis { contains: vec![0.0, 1.0], ..Axis::counting("load step") }
}

/// The bands of the stages over the load steps of a single run; none for several runs, whose stages may differ.
fn bands_of_the_only(runs: &[Run]) -> Vec<Band> {
    if let [run] = runs { bands_over_steps(run) } else { Vec::new() }
}

/// Number of linear solves in each step, for all runs.
pub(super) fn iterations(runs: &[Run]) -> Chart {
    let curve = |(number, run): (usize, &Run)| Curve {
        name: if runs.len() > 1 { run.name.clone() } else { String::new() },
        points: run.column("step").iter().zip(run.column("iterations")).map(|(x, y)| [*x, *y]).collect(),
        look: Look::Number(number),
    };
    let y = Axis { contains: vec![0.0], ..Axis::counting("iterations") };
    let curves = runs.iter().enumerate().map(curve).collect();
    let chart = chart("iterations of each load step".to_owned(), load_steps(), y, curves);
    Chart { bands: bands_of_the_only(runs), height: 220.0, ..chart }
}

/// Observed order of the iterations, for all runs and all steps in which it can be determined.
pub(super) fn orders(runs: &[Run]) -> Option<Chart> {
    let curve = |(number, run): (usize, &Run)| {
        // The order of a failed step is meaningless.
        let order = |(step, residuals): (usize, Vec<f64>)| {
            if step <= run.steps() { Some([step as f64, newton_order(&residuals)?]) } else { None }
        };
        Curve {
            name: if runs.len() > 1 { run.name.clone() } else { String::new() },
            points: run.residuals().into_iter().filter_map(order).collect(),
            look: Look::Number(number),
        }
    };
    let curves: Vec<Curve> =
        runs.iter().enumerate().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    if curves.is_empty() {
        return None;
    }
    let y = Axis { contains: vec![1.0, 2.5], ..Axis::new("observed order", Quantity::Number) };
    let chart = chart("observed order of convergence of each load step".to_owned(), load_steps(), y, curves);
    let levels = vec![(2.0, "quadratic".to_owned())];
    Some(Chart { levels, bands: bands_of_the_only(runs), height: 240.0, ..chart })
}
