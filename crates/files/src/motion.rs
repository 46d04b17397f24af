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

/// How far bodies reach, on all ranks.
#[derive(Debug, Clone, Copy)]
struct Reach<const D: usize> {
    low: [f64; D],
    high: [f64; D],
}

impl<const D: usize> Reach<D> {
    /// The box of the domains of all points: as they are, or as they were drawn.
    fn new(points: &Points<D>, is_original: bool) -> Reach<D> {
        let mut reach = Reach { low: [f64::INFINITY; D], high: [f64::NEG_INFINITY; D] };
        let mut add = |x: &[f64; D], half: &[f64; D]| {
            for d in 0..D {
                reach.low[d] = reach.low[d].min(x[d] - half[d]);
                reach.high[d] = reach.high[d].max(x[d] + half[d]);
            }
        };
        for p in 0..points.len() {
            let corners = match is_original {
                true => &points.original_corners[points.corner_range(p)],
                false => points.corners(p),
            };
            if !corners.is_empty() {
                corners.iter().for_each(|corner| add(corner, &[0.0; D]));
            } else if is_original {
                let half = points.original_half_lengths.get(p).copied().unwrap_or([0.0; D]);
                add(&points.original_position[p], &half);
            } else {
                add(&points.converged.position[p], &points.half_lengths(p));
            }
        }
        let reduction = points.reduction();
        for d in 0..D {
            reach.low[d] = reduction.smallest(reach.low[d]);
            reach.high[d] = reduction.largest(reach.high[d]);
        }
        reach
    }
}

/// The run-out: the largest distance, along a horizontal axis, by which the bodies reach beyond where they were drawn, and
/// their height along the last axis, [length].
fn runout<const D: usize>(points: &Points<D>) -> [f64; 2] {
    let [drawn, now] = [true, false].map(|is_original| Reach::new(points, is_original));
    let beyond = (0..D - 1).map(|d| (now.high[d] - drawn.high[d]).max(drawn.low[d] - now.low[d]));
    [beyond.fold(0.0, f64::max), (now.high[D - 1] - now.low[D - 1]).max(0.0)]
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
