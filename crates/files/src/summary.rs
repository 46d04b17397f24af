//! `summary.json`: the results of a run, their quality, and the cost.

mod findings;
mod quality;

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use serde::Serialize;
use serde_json::{Map, Value, json};

use mpm_core::model::{Model, Stepping};
use mpm_core::points::Points;
use mpm_core::quality::Warning;
use mpm_core::solver::{
    Diagnosis, InitialState, Reached, SolveError, StageLimit, StageStrength, StrengthBracket, Summary,
};
use mpm_core::terms::{Amount, NamedEnergy};
use mpm_core::timing::{Phase, Spent, Timings};

/// Version of the program, as it appears in the results.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

use super::fields::{corner_of, number_of_corners};
use super::findings::Findings;
use super::invalid;
use super::motion;
use super::units::Units;
use findings::{forces, largest};
use quality::{at_step, quality};

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All steps are in equilibrium.
    Completed,
    /// The user stopped the run.
    Interrupted,
    /// The run ended with an error.
    Failed {
        /// Code of the failure, [`mpm_core::solver::CODES`].
        code: Option<&'static str>,
        /// Message of the error.
        reason: String,
    },
}

impl Outcome {
    /// The outcome of a run that has ended with this error, or without an error.
    pub fn new(error: Option<&SolveError>) -> Outcome {
        match error {
            None => Outcome::Completed,
            Some(SolveError::Interrupted { .. }) => Outcome::Interrupted,
            Some(error) => Outcome::Failed { code: error.code(), reason: error.to_string() },
        }
    }
}

/// Origin of the times that a run reports.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    wall: Instant,
    /// Processor time that the program had used before the run.
    cpu: Duration,
}

impl Start {
    /// The start of the only run of a program, at `wall`.
    pub fn at(wall: Instant) -> Start {
        Start { wall, cpu: Duration::ZERO }
    }

    /// The start, now, of one of several runs. The peak memory is reset as well, if the system allows it; it includes
    /// memory that the program still holds from earlier runs.
    pub fn now() -> Start {
        // This works on Linux only; elsewhere, the peak memory covers the whole program.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        Start { wall: Instant::now(), cpu: ProcessTime::now().as_duration() }
    }

    /// Time since the start, and processor time of all threads.
    pub fn elapsed(&self) -> Spent {
        let cpu = ProcessTime::now().as_duration().saturating_sub(self.cpu);
        Spent { wall: self.wall.elapsed(), cpu }
    }
}

/// The advice in the files. The caller provides it, because this crate does not know how users state an analysis.
pub trait Wording: fmt::Debug + Send + Sync {
    /// Advice on the failure of a run.
    fn on_failure(&self, diagnosis: &Diagnosis) -> String;
    /// Advice on a warning.
    fn on_warning(&self, warning: &Warning) -> String;
}

/// A shared library that provides the law of a material.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LawLibrary {
    /// Name of the material.
    pub material: String,
    /// Path of the library.
    pub file: String,
    /// Hash of the file.
    pub hash: String,
}

impl fmt::Display for LawLibrary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LawLibrary { material, file, hash } = self;
        write!(f, "the law of the material `{material}` comes from the library `{file}`, hash {hash}")
    }
}

/// A warning or note about a deck.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeckMessage {
    /// Code of the message.
    pub code: String,
    /// `warning` or `note`.
    pub severity: String,
    /// Text of the message, without the remedy.
    pub message: String,
    /// The remedy.
    pub help: Option<String>,
}

/// Data known before the run.
#[derive(Debug, Clone)]
pub struct Account {
    /// Origin of the times of the run.
    pub start: Start,
    /// Name of the deck.
    pub deck_file: String,
    /// Text of the deck.
    pub deck_text: String,
    /// Hash of the deck: of its text, its parameters and the files that it names.
    pub deck_hash: String,
    /// The deck after parameter substitution; without it, no checkpoints are written.
    pub deck: Option<Value>,
    /// Hash of the files that the deck names.
    pub files_hash: String,
    /// The libraries that provide laws.
    pub law_libraries: Vec<LawLibrary>,
    /// Parameters of the deck with their final values.
    pub parameters: BTreeMap<String, Value>,
    /// The units of the deck, if it states them.
    pub units: Option<Units>,
    /// Warnings and notes about the deck.
    pub messages: Vec<DeckMessage>,
    /// Time spent so far on reading the deck and building the model.
    pub set_up: Timings,
    /// Number of threads.
    pub threads: usize,
    /// The advice.
    pub wording: Arc<dyn Wording>,
}

impl Account {
    pub(super) fn write<const D: usize>(
        &self,
        path: &Path,
        model: &Model<D>,
        whole: &Whole,
        reached: &Reached,
        findings: &Findings,
        outcome: &Outcome,
    ) -> io::Result<()> {
        check(path, &reached.summary, findings)?;
        let document = self.document(model, whole, reached, findings, outcome);
        let mut text = serde_json::to_string_pretty(&document).map_err(io::Error::other)?;
        text.push('\n');
        super::replace::replace_file(path, |out| out.write_all(text.as_bytes()))
    }

    /// The document of `summary.json`.
    pub(super) fn document<const D: usize>(
        &self,
        model: &Model<D>,
        whole: &Whole,
        reached: &Reached,
        findings: &Findings,
        outcome: &Outcome,
    ) -> Value {
        let Reached { progress, summary } = reached;
        let mut timings = self.set_up.clone();
        timings.add(&summary.timings);
        let (word, code, reason) = match outcome {
            Outcome::Completed => ("completed", None, Value::Null),
            Outcome::Interrupted => ("interrupted", None, Value::Null),
            Outcome::Failed { code, reason } => ("failed", *code, json!(reason)),
        };
        let seconds = |total: f64, of: &dyn Fn(Phase) -> f64| {
            let mut map = Map::new();
            map.insert("total".to_owned(), json!(total));
            for phase in Phase::ALL {
                map.insert(phase.name().to_owned(), json!(of(phase)));
            }
            Value::Object(map)
        };
        let load_factor = summary.load_factor.filter(|_| summary.steps > 0);
        let spent = self.start.elapsed();
        let (wall, cpu) = (spent.wall.as_secs_f64(), spent.cpu.as_secs_f64());
        let solved = cpu - timings.spent(Phase::Output).cpu.as_secs_f64();
        let warnings: Vec<Value> =
            summary.warnings.iter().map(|of| warning(of, self.wording.on_warning(of))).collect();
        let visits = (whole.points * summary.evaluations) as f64;
        let mut document = json!({
            "outcome": word,
            "code": code,
            "reason": reason,
            "version": VERSION,
            "deck_hash": self.deck_hash,
            "title": model.title,
            "parameters": self.parameters,
            "threads": self.threads,
            "points": whole.points,
            "cells": model.grid.n_cells(),
            "unknowns": summary.unknowns,
            "steps": summary.steps,
            "steps_requested": model.steps_requested(),
            "rounding_limited": summary.rounding_limited,
            "failed_attempts": summary.failed_attempts,
            "load_factor": load_factor,
            "largest_load_factor": summary.largest_load_factor,
            "diagnosis": summary.diagnosis.as_ref().map(|of| diagnosis(of, self.wording.on_failure(of))),
            "stabilised_faces": summary.stabilised_faces,
            "evaluations": summary.evaluations,
            "linear_solves": summary.linear_solves,
            "iterative_solves": summary.iterative_solves,
            "linear_iterations": summary.linear_iterations,
            "indefinite_solves": summary.indefinite_solves,
            "external_work": summary.external_work,
            "strain_energy": summary.strain_energy,
            "plastic_work": summary.plastic_work,
            "regridding_work": summary.regridding_work,
            "stabilisation_work": summary.stabilisation_work,
            "wall_seconds": seconds(wall, &|phase| timings.spent(phase).wall.as_secs_f64()),
            "cpu_seconds": seconds(cpu, &|phase| timings.spent(phase).cpu.as_secs_f64()),
            "cpu_microseconds_per_point_and_evaluation": {
                "all": if visits > 0.0 { json!(1e6 * cpu / visits) } else { Value::Null },
                "without_output": if visits > 0.0 { json!(1e6 * solved / visits) } else { Value::Null },
            },
            "peak_memory_bytes": whole.peak_memory,
            "iterations": findings.iterations.map(|[min, max]| json!({"min": min, "max": max})),
            "worst_residual": findings.worst_residual.map(at_step),
            "balance_errors": {
                "energy": findings.errors.energy.map(at_step),
                "force": findings.errors.force.map(at_step),
                "moment": findings.errors.moment.map(at_step),
            },
            "forces": findings.balance.as_ref().map(forces),
            "largest": findings.extremes.as_ref().map(largest),
            "quality": quality(model, &summary.quality),
            "warnings": warnings,
            "bodies": whole.bodies,
        });
        if let Some(units) = &self.units {
            document["units"] = units.document();
        }
        if whole.ranks > 1 {
            document["ranks"] = json!(whole.ranks);
        }
        if !self.law_libraries.is_empty() {
            document["law_libraries"] = json!(self.law_libraries);
        }
        if !model.stages.is_empty() {
            document["stages"] = stages(model, reached);
        } else if summary.exchanged_energy != 0.0 {
            document["exchanged_energy"] = json!(summary.exchanged_energy);
        }
        let reductions: Vec<Value> =
            progress.strength.iter().map(|of| strength_reduction(model, of, summary)).collect();
        if let Some(last) = reductions.last() {
            document["strength_reduction"] = last.clone();
        }
        if reductions.len() > 1 {
            document["strength_reductions"] = reductions.into();
        }
        if !progress.limits.is_empty() {
            document["limit_loads"] = progress.limits.iter().map(|of| limit_load(model, of)).collect();
        }
        if let Some(state) = &summary.initial_state {
            document["initial_state"] = initial_state(state);
        }
        document["damped_steps"] = summary.damped.into();
        document["damping_work"] = summary.damping_work.into();
        document["viscous_steps"] = summary.viscous.into();
        document["replaced_domains"] = summary.replaced_domains.into();
        if !summary.further_energies.is_empty() {
            document["energies"] = summary.further_energies.iter().map(further_energy).collect();
        }
        if let Some(motion) = &whole.motion {
            document["motion"] = motion.clone();
        }
        if !model.tools.is_empty() {
            document["friction_work"] = summary.friction_work.into();
        }
        document
    }
}

/// An energy that terms report under a name of their own.
fn further_energy(energy: &NamedEnergy) -> Value {
    let NamedEnergy { name, role, amount } = energy;
    let mut entry = json!({"name": name, "role": role, "energy": amount.value()});
    if let Amount::State { start, .. } = amount {
        entry["at_start"] = json!(start);
    }
    entry
}

/// Checks that the main numbers are finite: JSON would silently replace a non-finite number by null.
///
/// # Errors
/// `InvalidInput` with the name of the first non-finite number.
fn check(path: &Path, summary: &Summary, findings: &Findings) -> io::Result<()> {
    let mut numbers = vec![
        ("external_work", summary.external_work),
        ("regridding_work", summary.regridding_work),
        ("strain_energy", summary.strain_energy),
        ("plastic_work", summary.plastic_work),
        ("friction_work", summary.friction_work),
        ("stabilisation_work", summary.stabilisation_work),
        ("damping_work", summary.damping_work),
        ("mass", summary.quality.mass.now),
        ("volume", summary.quality.volume.now),
    ];
    numbers.extend(summary.further_energies.iter().map(|of| (of.name.as_ref(), of.amount.value())));
    numbers.extend(summary.quality.det_f.iter().flatten().map(|det_f| ("det_f", *det_f)));
    let errors = [findings.errors.energy, findings.errors.force, findings.errors.moment];
    numbers.extend(errors.iter().flatten().map(|(error, _)| ("balance_errors", *error)));
    numbers.extend(findings.worst_residual.map(|(residual, _)| ("worst_residual", residual)));
    if let Some(balance) = &findings.balance {
        let named = balance
            .loads
            .iter()
            .chain(&balance.further)
            .chain(&balance.reactions)
            .flat_map(|(_, force)| force);
        let moments = balance.moments.iter().flat_map(|of| of.about.iter().flatten().chain(&of.moment));
        let all = balance.applied.iter().chain(named).chain(moments);
        numbers.extend(all.map(|value| ("forces", *value)));
    }
    if let Some(extremes) = &findings.extremes {
        for (name, extreme) in [
            ("displacement", &extremes.displacement),
            ("von_mises_stress", &extremes.von_mises_stress),
            ("lowest_pressure", &extremes.lowest_pressure),
            ("highest_pressure", &extremes.highest_pressure),
        ] {
            numbers.push((name, extreme.value));
            numbers.extend(extreme.position.iter().map(|x| ("position", *x)));
        }
    }
    match numbers.iter().find(|(_, value)| !value.is_finite()) {
        Some((name, value)) => {
            Err(invalid(format!("`{}`: a number under `{name}` would be {value}", path.display())))
        }
        None => Ok(()),
    }
}

/// Data of all ranks, for the summary.
pub(super) struct Whole {
    /// Number of points.
    pub points: usize,
    /// Number of ranks.
    ranks: usize,
    /// Largest peak memory of a rank, [byte], if the system reports it.
    peak_memory: Option<u64>,
    /// The number of points and the extent of every body.
    bodies: Value,
    /// The motion with inertia; `None` in statics.
    motion: Option<Value>,
}

impl Whole {
    /// Gathers the data of all ranks. All ranks must call this together.
    pub fn new<const D: usize>(model: &Model<D>, points: &Points<D>, summary: &Summary) -> Whole {
        let ranks = &points.ranks;
        let peaks = ranks.gather_all(mpm_core::memory::peak());
        Whole {
            points: ranks.count_all(points.len()),
            ranks: ranks.count(),
            peak_memory: peaks.into_iter().flatten().max(),
            bodies: bodies(model, points),
            motion: model.has_inertia().then(|| motion::section(points, summary)),
        }
    }
}

/// The number of points of every body, the extent of these points, and that of their domains. A point without a domain
/// counts as a square (cube) of its volume, as in footnote 7 of the paper.
fn bodies<const D: usize>(model: &Model<D>, points: &Points<D>) -> Value {
    let mut map = Map::new();
    for (number, body) in model.bodies.iter().enumerate() {
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        let (mut inner, mut outer) = (low, high);
        let mut count = 0usize;
        for p in (0..points.len()).filter(|&p| points.body[p] as usize == number) {
            count += 1;
            let x = points.converged.position[p];
            let size = model.volume(points, p) / model.depth(&x);
            let side = 0.5 * size.powf(1.0 / D as f64);
            let domain = 0..number_of_corners(model, points, p);
            let mut corners: Vec<_> = domain.map(|k| corner_of(model, points, p, k)).collect();
            if corners.is_empty() {
                corners = vec![x.map(|x| x - side), x.map(|x| x + side)];
            }
            for d in 0..D {
                low[d] = low[d].min(x[d]);
                high[d] = high[d].max(x[d]);
                for corner in &corners {
                    inner[d] = inner[d].min(corner[d]);
                    outer[d] = outer[d].max(corner[d]);
                }
            }
        }
        let extent = |min: [f64; D], max: [f64; D]| {
            let ranks = &points.ranks;
            let (min, max) = (min.map(|x| ranks.smallest(x)), max.map(|x| ranks.largest(x)));
            json!({"min": min.to_vec(), "max": max.to_vec()})
        };
        let value = json!({
            "points": points.ranks.count_all(count),
            "extent": {"points": extent(low, high), "domain": extent(inner, outer)},
        });
        map.insert(body.name.clone(), value);
    }
    Value::Object(map)
}

/// The state before the first step; its residual is null if it is not finite.
fn initial_state(of: &InitialState) -> Value {
    json!({
        "residual": of.residual,
        "balanced": of.is_balanced,
        "worst": of.worst.as_ref().map(|worst| json!({"node": worst.position, "force": worst.force})),
        "strain_energy": of.energy,
    })
}

/// The factors of a stage that reduces the strength, and what finding them has cost; its name is null without stages.
fn strength_reduction<const D: usize>(model: &Model<D>, of: &StageStrength, summary: &Summary) -> Value {
    let StrengthBracket { stands, fails, slides, moved, growth, slumped, ran_away, attempts, evaluations } =
        of.bracket;
    let cpu = summary.searches.get(&of.stage).copied().unwrap_or_default();
    let stage = model.stages.get(of.stage).map(|stage| &stage.name);
    json!({
        "stage": stage,
        "stands": stands,
        "fails": fails,
        "slides": slides,
        "moved": moved,
        "growth": growth,
        "slumped": slumped,
        "ran_away": ran_away,
        "attempts": attempts,
        "evaluations": evaluations,
        "cpu_seconds": cpu.as_secs_f64(),
    })
}

/// The load of a stage that runs until its limit; its name is null without stages.
fn limit_load<const D: usize>(model: &Model<D>, of: &StageLimit) -> Value {
    let stage = model.stages.get(of.stage);
    let stepping = stage.map_or(&model.stepping, |stage| &stage.stepping);
    let [steepest, slope] = of.limit.slopes();
    json!({
        "stage": stage.map(|stage| &stage.name),
        "reached": of.limit.is_reached(),
        "load": of.limit.largest,
        "kind": if stepping.control.has_unknown_factor() { "load-factor" } else { "force" },
        "bracket": of.limit.bracket(),
        "displacement": of.limit.displacement(),
        "steepest_slope": steepest,
        "last_slope": slope,
    })
}

/// The probable cause of a failure, with advice.
fn diagnosis(of: &Diagnosis, advice: String) -> Value {
    json!({
        "kind": of.kind,
        "step": of.step,
        "time": of.time,
        "largest_load_factor": of.largest_load_factor,
        "body": of.body,
        "point": of.point,
        "cell": of.cell,
        "node": of.node,
        "filling": of.filling,
        "flowing": of.flowing,
        "experiments": of.experiments,
        "advice": advice,
    })
}

/// A warning, with advice.
fn warning(of: &Warning, help: String) -> Value {
    json!({
        "code": of.code,
        "step": of.step,
        "place": of.location,
        "value": of.value,
        "threshold": of.threshold,
        "message": of.message,
        "help": help,
    })
}

/// The stages with their times, the stage that the run has reached, and the energy that stages have exchanged.
fn stages<const D: usize>(model: &Model<D>, reached: &Reached) -> Value {
    let of = model.stages.iter().map(|stage| {
        let Stepping { start_time, end_time, count, .. } = stage.stepping;
        json!({"name": stage.name, "start": start_time, "end": end_time, "steps_requested": count})
    });
    let mut stages = json!({
        "all": of.collect::<Vec<_>>(),
        "reached": reached.progress.stage_number() + 1,
        "exchanged_energy": reached.summary.exchanged_energy,
    });
    if !reached.summary.placed.is_empty() {
        stages["placed"] = json!(reached.summary.placed);
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_not_finite_is_named() {
        let path = Path::new("out/summary.json");
        let findings = Findings::default();
        check(path, &Summary::default(), &findings).unwrap();
        let summary = Summary { strain_energy: f64::NAN, ..Summary::default() };
        let error = check(path, &summary, &findings).unwrap_err();
        assert_eq!(error.to_string(), "`out/summary.json`: a number under `strain_energy` would be NaN");
        let findings = Findings { worst_residual: Some((f64::INFINITY, 3)), ..Findings::default() };
        assert!(
            check(path, &Summary::default(), &findings).unwrap_err().to_string().contains("worst_residual")
        );
    }
}
