//! The rows of the tables of a run: history, quality, and convergence of the iterations.

use mpm_core::dofs::Field;
use mpm_core::model::{BodyContact, Model, Probe};
use mpm_core::points::Points;
use mpm_core::solver::{FailedAttempt, ReactionMoment, Step, StepReport, Summary};
use mpm_core::terms::{PairState, ToolState};

use super::findings::Findings;
use super::motion;
use super::table::Entry;

/// Columns of `quality.csv`.
pub const QUALITY: [&str; 15] = [
    "step",
    "partition_of_unity_loss",
    "domain_outside_grid",
    "domain_volume_excess",
    "smallest_cell_filling",
    "smallest_det_f",
    "largest_det_f",
    "mass",
    "volume",
    "plastic_work",
    "regridding_work",
    "stabilisation_work",
    "energy_error",
    "force_error",
    "moment_error",
];

/// Columns of `convergence.csv`, with those of an analysis with these further fields: then each field has its own
/// residual.
pub fn columns_of_convergence(fields: &[Field]) -> Vec<String> {
    let mut columns = ["step", "iteration", "residual"].map(String::from).to_vec();
    if !fields.is_empty() {
        columns.push("residual_displacement".to_owned());
    }
    columns.extend(fields.iter().map(|field| format!("residual_{}", field.name)));
    columns
}

/// What `history.csv` states beside what a model defines.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Beside {
    /// Names of further forces.
    pub forces: Vec<String>,
    /// Fields of the unknowns beside the displacement.
    pub fields: Vec<Field>,
    /// Names of the conditions that terms impose on these fields.
    pub conditions: Vec<String>,
    /// Names of further energies.
    pub energies: Vec<String>,
}

impl Beside {
    /// Columns of the reactions of the conditions, for each component of the fields.
    fn columns_of_reactions(&self) -> impl Iterator<Item = String> {
        self.conditions.iter().flat_map(|condition| {
            self.fields.iter().flat_map(move |Field { name, components, .. }| {
                (1..=*components).map(move |component| match components {
                    1 => format!("{condition}_{name}"),
                    _ => format!("{condition}_{name}_{component}"),
                })
            })
        })
    }

    /// The reactions of the conditions, for each component of the fields; those that no term reports are missing.
    fn reactions<const D: usize>(&self, report: &StepReport<D>) -> impl Iterator<Item = Entry> {
        let components: usize = self.fields.iter().map(|field| field.components).sum();
        self.conditions.iter().flat_map(move |condition| {
            let reaction = report.further_reactions.iter().find(|of| of.condition == *condition);
            (0..components).map(move |component| {
                let value = reaction.and_then(|of| of.resultant.get(D + component));
                value.map_or(Entry::Missing, |value| Entry::from(*value))
            })
        })
    }
}

/// Columns of `history.csv`, with those of what the analysis has beside its model.
pub fn columns_of_history<const D: usize>(model: &Model<D>, beside: &Beside) -> Vec<String> {
    let axes = &["x", "y", "z"][..D];
    let mut columns: Vec<String> =
        ["step", "time", "iterations", "residual", "linear_iterations", "converged", "rounding_limited"]
            .map(String::from)
            .to_vec();
    if !model.stages.is_empty() {
        columns.push("stage".to_owned());
    }
    if model.has_one_load_factor() {
        columns.push("load_factor".to_owned());
    }
    if model.reduces_strength() {
        columns.push("strength_factor".to_owned());
    }
    for condition in &model.boundary_conditions {
        columns.extend(axes.iter().map(|axis| format!("{}_r{axis}", condition.name)));
        let turns = if model.revolved { &[] } else { ReactionMoment::<D>::AXES };
        columns.extend(turns.iter().map(|axis| format!("{}_m{axis}", condition.name)));
    }
    for load in &model.loads {
        columns.extend(axes.iter().map(|axis| format!("{}_f{axis}", load.name)));
    }
    let turns = if D == 3 { ["x", "y", "z"].as_slice() } else { &["z"] };
    let turns = if model.revolved { &[] } else { turns };
    for tool in &model.tools {
        let name = &tool.name;
        columns.extend(axes.iter().map(|axis| format!("{name}_f{axis}")));
        columns.extend(turns.iter().map(|axis| format!("{name}_m{axis}")));
        columns.extend(axes.iter().map(|axis| format!("{name}_u{axis}")));
        columns.extend(turns.iter().map(|axis| format!("{name}_turn_{axis}")));
        columns.extend(["contacts", "overlap", "allowed_overlap"].map(|what| format!("{name}_{what}")));
        for part in &tool.parts {
            columns.extend(axes.iter().map(|axis| format!("{name}_{}_f{axis}", part.name)));
            columns.extend(turns.iter().map(|axis| format!("{name}_{}_m{axis}", part.name)));
        }
    }
    for contact in &model.contacts {
        let name = name_of_pair(model, contact);
        columns.extend(axes.iter().map(|axis| format!("{name}_f{axis}")));
        columns.extend(["contacts", "area", "overlap", "slip"].map(|what| format!("{name}_{what}")));
    }
    for name in &beside.forces {
        columns.extend(axes.iter().map(|axis| format!("{name}_f{axis}")));
    }
    columns.extend(beside.columns_of_reactions());
    for probe in &model.probes {
        columns.extend(axes.iter().map(|axis| format!("{}_u{axis}", probe.name)));
    }
    columns.extend(["external_work", "strain_energy"].map(String::from));
    columns.extend(beside.energies.iter().map(|name| format!("{name}_energy")));
    columns.extend(motion::columns(model));
    columns
}

/// The row of `history.csv` of a converged step; a further force that no term reports is missing. All ranks must call
/// this together.
pub fn row_of_history<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    report: &StepReport<D>,
    summary: &Summary,
    beside: &Beside,
) -> Vec<Entry> {
    let residual = report.residuals.last().copied().unwrap_or(0.0);
    let mut row: Vec<Entry> = vec![
        (report.step.index as i64).into(),
        report.step.end.into(),
        (report.solves() as i64).into(),
        residual.into(),
        (report.linear_iterations as i64).into(),
        1.into(),
        i64::from(report.rounding_limited).into(),
    ];
    if !model.stages.is_empty() {
        row.push((model.present.stage as i64 + 1).into());
    }
    row.extend(report.load_factor.map(Entry::from));
    if model.reduces_strength() {
        row.push(report.strength_factor.unwrap_or(1.0).into());
    }
    for (number, reaction) in report.reactions.iter().enumerate() {
        row.extend(reaction.map(Entry::from));
        let moment = report.moments.as_ref().and_then(|moments| moments.get(number));
        row.extend(moment.iter().flat_map(|moment| moment.components()).map(|m| Entry::from(*m)));
    }
    row.extend(report.loads.iter().flatten().map(|f| Entry::from(*f)));
    for tool in report.list::<ToolState<D>>() {
        let about = if model.revolved {
            3
        } else if D == 3 {
            0
        } else {
            2
        };
        row.extend(tool.force.map(Entry::from));
        row.extend(tool.moment[about..].iter().map(|m| Entry::from(*m)));
        row.extend(tool.displacement.map(Entry::from));
        row.extend(tool.rotation[about..].iter().map(|angle| Entry::from(angle.to_degrees())));
        row.extend([Entry::from(tool.contacts.len() as i64), Entry::from(tool.overlap)]);
        row.push(tool.allowed_overlap.into());
        for part in &tool.parts {
            row.extend(part.force.map(Entry::from));
            row.extend(part.moment[about..].iter().map(|m| Entry::from(*m)));
        }
    }
    for pair in report.list::<PairState<D>>() {
        row.extend(pair.force.map(Entry::from));
        row.push((pair.contacts.len() as i64).into());
        row.extend([pair.area, pair.overlap, pair.slip].map(Entry::from));
    }
    for name in &beside.forces {
        let force = report.forces.iter().find(|named| named.name == *name).map(|named| named.force);
        row.extend((0..D).map(|d| force.map_or(Entry::Missing, |force| force[d].into())));
    }
    row.extend(beside.reactions(report));
    for moved in moved(model, points) {
        for d in 0..D {
            let sum: f64 = moved.iter().map(|moved| moved[d]).sum();
            // A probe in an absent body has no displacement.
            row.push(if moved.is_empty() { Entry::Missing } else { (sum / moved.len() as f64).into() });
        }
    }
    row.extend([Entry::from(summary.external_work), Entry::from(summary.strain_energy)]);
    for name in &beside.energies {
        let named = summary.further_energies.iter().filter(|energy| energy.name == *name);
        let energy = named.map(|energy| energy.amount.value()).reduce(|sum, energy| sum + energy);
        row.push(energy.map_or(Entry::Missing, Entry::from));
    }
    row.extend(motion::row(model, points, summary));
    row
}

/// The name under which the forces between two bodies are reported: those of the first on the second.
pub fn name_of_pair<const D: usize>(model: &Model<D>, contact: &BodyContact) -> String {
    let [first, second] = contact.bodies.map(|body| model.bodies[body].name.as_str());
    format!("{first}_on_{second}")
}

/// For each probe, the displacements of its points that are present, on any rank.
fn moved<const D: usize>(model: &Model<D>, points: &Points<D>) -> Vec<Vec<Vec<f64>>> {
    if model.probes.is_empty() {
        return Vec::new();
    }
    let numbered = |(number, probe): (usize, &Probe)| {
        probe.points.iter().enumerate().map(|(place, id)| (number, place, *id)).collect::<Vec<_>>()
    };
    let probed: Vec<(usize, usize, u32)> = model.probes.iter().enumerate().flat_map(numbered).collect();
    let ids: Vec<u32> = probed.iter().map(|(.., id)| *id).collect();
    let present = probed.iter().zip(points.places_of(&ids));
    let own: Vec<(usize, usize, Vec<f64>)> = present
        .filter_map(|((number, place, _), p)| Some((*number, *place, points.displacement(p?).to_vec())))
        .collect();
    let mut all = points.ranks.gather_all(own).concat();
    all.sort_by_key(|(number, place, _)| (*number, *place));
    let mut moved = vec![Vec::new(); model.probes.len()];
    all.into_iter().for_each(|(number, _, displacement)| moved[number].push(displacement));
    moved
}

/// The row of `quality.csv` of a converged step.
pub fn row_of_quality<const D: usize>(
    report: &StepReport<D>,
    summary: &Summary,
    findings: &Findings,
) -> Vec<Entry> {
    let latest = &summary.quality.latest;
    let measures = [
        latest.partition_of_unity_loss,
        latest.domain_outside_grid,
        latest.domain_volume_excess,
        latest.smallest_cell_filling,
        latest.det_f[0],
        latest.det_f[1],
        latest.mass,
        latest.volume,
        summary.plastic_work,
        summary.regridding_work,
        summary.stabilisation_work,
        summary.energy_error(),
        findings.force_error(),
        report.moment_error.unwrap_or(0.0),
    ];
    let mut row = vec![Entry::from(report.step.index as i64)];
    row.extend(measures.map(Entry::from));
    row
}

/// The row of `history.csv` of a failed attempt; entries without a value stay empty.
pub fn row_of_attempt<const D: usize>(width: usize, attempt: &FailedAttempt<D>) -> Vec<Entry> {
    let residual = attempt.residuals.last().copied().filter(|r| r.is_finite());
    let mut row: Vec<Entry> = vec![
        (attempt.step.index as i64).into(),
        attempt.step.end.into(),
        (attempt.solves() as i64).into(),
        residual.into(),
        (attempt.linear_iterations as i64).into(),
        0.into(),
    ];
    row.resize(width, Entry::Missing);
    row
}

/// The row of `convergence.csv` for one evaluation of the residual, with the residual of each field if there are several.
pub fn row_of_convergence(step: Step, iteration: usize, residual: f64, by_field: &[f64]) -> Vec<Entry> {
    let mut row = vec![Entry::from(step.index as i64), Entry::from(iteration as i64), Entry::from(residual)];
    row.extend(by_field.iter().map(|residual| Entry::from(*residual)));
    row
}
