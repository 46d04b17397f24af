//! What the tables and the summary state of a motion with inertia: its energies, its momentum, and how far bodies run out.

use serde_json::{Value, json};

use mpm_core::model::Model;
use mpm_core::points::{Momentum, Points};
use mpm_core::solver::Summary;
use mpm_core::terms::Ledger;

use super::table::Entry;

/// The energies of a motion, [energy], in the order of their columns.
const ENERGIES: [&str; 11] = [
    "kinetic",
    "elastic",
    "plastic",
    "friction",
    "viscous",
    "absorbed",
    "pic",
    "ghost",
    "algorithmic",
    "supplied",
    "defect",
];

/// The energies so far: the work supplied is stored or dissipated, or is the defect.
pub(crate) fn energies(summary: &Summary) -> [f64; ENERGIES.len()] {
    let named = |name: &str| -> f64 {
        let of_name = summary.further_energies.iter().filter(|energy| energy.name == name);
        of_name.map(|energy| energy.amount.value()).next().unwrap_or(0.0)
    };
    [
        named(Ledger::KINETIC),
        summary.strain_energy,
        summary.plastic_work,
        summary.friction_work,
        named(Ledger::VISCOUS) + named(Ledger::RAYLEIGH) + summary.damping_work,
        named(Ledger::ABSORBED),
        named(Ledger::PIC),
        named(Ledger::GHOST) + summary.stabilisation_work,
        named(Ledger::ALGORITHMIC) + named(Ledger::STOPPED),
        summary.external_work + summary.regridding_work + summary.exchanged_energy,
        summary.defect() + summary.unexplained_energy(),
    ]
}

/// Share of the mass that may lie beyond the front, [-]: single grains run far ahead.
const AHEAD: f64 = 0.01;
/// Number of halvings by which the front is found.
const HALVINGS: usize = 30;

/// The least and the largest coordinate along an axis, over the domains of all points, [length]: as they are, or as they
/// were drawn.
fn reach<const D: usize>(points: &Points<D>, axis: usize, is_original: bool) -> [f64; 2] {
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    let mut add = |x: f64| ends = [ends[0].min(x), ends[1].max(x)];
    for p in 0..points.len() {
        let corners = match is_original {
            true => &points.original_corners[points.corner_range(p)],
            false => points.corners(p),
        };
        let (x, half) = match is_original {
            true => {
                let half = points.original_half_lengths.get(p).map_or(0.0, |half| half[axis]);
                (points.original_position[p][axis], half)
            }
            false => (points.converged.position[p][axis], points.half_lengths(p)[axis]),
        };
        if corners.is_empty() {
            [x - half, x + half].into_iter().for_each(&mut add);
        } else {
            corners.iter().map(|corner| corner[axis]).for_each(&mut add);
        }
    }
    let reduction = points.reduction();
    [reduction.smallest(ends[0]), reduction.largest(ends[1])]
}

/// The coordinate along an axis beyond which [`AHEAD`] of the mass lies, in the direction of `sign`, [length].
fn front<const D: usize>(points: &Points<D>, axis: usize, sign: f64) -> f64 {
    let reduction = points.reduction();
    let mass = reduction.total(points.mass.iter().sum());
    let along = |p: usize| sign * points.converged.position[p][axis];
    let all = (0..points.len()).map(along);
    let [mut low, mut high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
    (low, high) = (reduction.smallest(low), reduction.largest(high));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let beyond = (0..points.len()).filter(|p| along(*p) > middle).map(|p| points.mass[p]).sum();
        if reduction.total(beyond) > AHEAD * mass { low = middle } else { high = middle }
    }
    sign * high
}

/// The run-out: the largest distance, along a horizontal axis, from where the bodies were drawn to the front, beyond which
/// one per cent of their mass lies; and their height along the last axis, [length].
fn runout<const D: usize>(points: &Points<D>) -> [f64; 2] {
    let mut runout: f64 = 0.0;
    for axis in 0..D - 1 {
        let [low, high] = reach(points, axis, true);
        runout = runout.max(front(points, axis, 1.0) - high).max(low - front(points, axis, -1.0));
    }
    let [low, high] = reach(points, D - 1, false);
    [runout, (high - low).max(0.0)]
}

/// The columns of `history.csv`; none without inertia.
pub(crate) fn columns<const D: usize>(model: &Model<D>) -> Vec<String> {
    if !model.has_inertia() {
        return Vec::new();
    }
    let mut columns: Vec<String> = ENERGIES.iter().map(|name| format!("{name}_energy")).collect();
    let axes = &["x", "y", "z"][..D];
    let turns = if D == 3 { axes } else { &["z"] };
    columns.extend(axes.iter().map(|axis| format!("momentum_{axis}")));
    columns.extend(turns.iter().map(|axis| format!("angular_momentum_{axis}")));
    columns.extend(axes.iter().map(|axis| format!("centre_{axis}")));
    columns.extend(["largest_speed", "runout", "height"].map(String::from));
    columns
}

/// The entries of these columns after a converged step. All ranks must call this together.
pub(crate) fn row<const D: usize>(model: &Model<D>, points: &Points<D>, summary: &Summary) -> Vec<Entry> {
    if !model.has_inertia() {
        return Vec::new();
    }
    let Momentum { centre, linear, angular, speed, .. } = points.momentum(|_| true);
    let about = if D == 3 { 0 } else { 2 };
    let numbers = energies(summary).into_iter().chain(linear[..D].iter().copied());
    let numbers = numbers.chain(angular[about..].iter().copied()).chain(centre[..D].iter().copied());
    numbers.chain([speed]).chain(runout(points)).map(Entry::from).collect()
}

/// The section `motion` of `summary.json`. All ranks must call this together.
pub(crate) fn section<const D: usize>(points: &Points<D>, summary: &Summary) -> Value {
    let Momentum { mass, centre, linear, angular, speed, .. } = points.momentum(|_| true);
    let energies: serde_json::Map<String, Value> = ENERGIES
        .iter()
        .zip(energies(summary))
        .map(|(name, energy)| ((*name).to_owned(), json!(energy)))
        .collect();
    let about = if D == 3 { 0 } else { 2 };
    let [runout, height] = runout(points);
    json!({
        "energies": energies,
        "mass": mass,
        "centre": centre[..D],
        "momentum": linear[..D],
        "angular_momentum": angular[about..],
        "largest_speed": speed,
        "runout": runout,
        "height": height,
    })
}
