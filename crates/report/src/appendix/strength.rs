//! The reduction of strength: the factor of safety, displacement against the factor, and the mechanism.

use mpm_core::solver::StrengthBracket;
use mpm_deck::ControlDeck;
use mpm_deck::quoting::{counted, joined};

use super::chart::{Axis, Band, Chart, Curve, Look};
use super::curves::{Component, components};
use super::error::ReportError;
use super::field::{FieldChoice, StepChoice};
use super::number::{html, plain};
use super::page::{Page, escape};
use super::picture::Gallery;
use super::run::Run;
use super::scene::Scene;
use super::stages::stages;
use super::units::{Naming, Quantity};

/// Largest number of curves in one chart.
const MAX_CURVES: usize = 12;

/// The factors between which equilibrium ceases; `None` if the run has not reduced the strength.
fn bracket(run: &Run) -> Option<StrengthBracket> {
    serde_json::from_value(run.summary.get("strength_reduction")?.clone()).ok()
}

/// One sentence with the factor for each stage that reduced the strength, except the last such stage.
fn earlier(run: &Run) -> Vec<String> {
    let all = run.summary.get("strength_reductions").and_then(|all| all.as_array());
    let before_last = all.map(|all| &all[..all.len().saturating_sub(1)]).unwrap_or_default();
    let sentence = |stage: &serde_json::Value| {
        let found: StrengthBracket = serde_json::from_value(stage.clone()).ok()?;
        Some(format!("In stage {}: {found}.", stage["stage"].as_str().unwrap_or_default()))
    };
    before_last.iter().filter_map(sentence).collect()
}

/// Every stage of a run that reduced the strength, by name, with its factor of safety in HTML; the name is empty
/// without stages.
pub(super) fn factors(run: &Run) -> Vec<(String, String)> {
    let all = run.summary.get("strength_reductions").and_then(|all| all.as_array());
    let stages = match all {
        Some(all) => all.iter().collect(),
        None => Vec::from_iter(run.summary.get("strength_reduction")),
    };
    let stage_factor = |stage: &serde_json::Value| {
        let (value, _) = in_html(&serde_json::from_value(stage.clone()).ok()?)?;
        Some((stage["stage"].as_str().unwrap_or_default().to_owned(), value))
    };
    stages.into_iter().filter_map(stage_factor).collect()
}

/// The factor of safety as a key number, and a remark, both in HTML.
pub(super) fn key_number(run: &Run) -> Option<(String, String)> {
    let (value, remark) = in_html(&bracket(run)?)?;
    Some((value, format!("{remark}{}", dependence(run).map_or_else(String::new, |text| format!("; {text}")))))
}

/// The factor of safety of a stage in HTML, and what its numbers mean; `None` if no step of the stage has ended.
fn in_html(found: &StrengthBracket) -> Option<(String, &'static str)> {
    Some(match (found.stands, found.fails) {
        _ if found.slides.is_some() => {
            let [stood, slid] = found.slides?;
            let remark = "the largest factor with equilibrium in about the original shape, and one beyond it";
            (format!("{} to\u{a0}{}", html(stood, 5), html(slid, 5)), remark)
        }
        (Some(stands), Some(fails)) => (
            format!("{} to\u{a0}{}", html(stands, 5), html(fails, 5)),
            "the largest factor for which equilibrium was found, and one for which it was not",
        ),
        (Some(stands), None) => {
            (format!("at least {}", html(stands, 5)), "the largest factor that was tried")
        }
        (None, Some(fails)) => (format!("below {}", html(fails, 5)), "no equilibrium at any factor"),
        (None, None) => return None,
    })
}

/// Why the factor of safety depends on the grid, in HTML; `None` if all materials in use have associated flow.
fn dependence(run: &Run) -> Option<String> {
    let materials = run.deck.iter().flat_map(|deck| deck.nonassociated_with_reduced_strength());
    let names: Vec<String> = materials.map(|name| format!("<code>{}</code>", escape(name))).collect();
    let names = (!names.is_empty()).then(|| joined(&names, "and"))?;
    Some(format!(
        "the factor of safety depends on the cell size, because the flow of {names} is non-associated"
    ))
}

/// The part of a run that reduced the strength.
struct Reduction {
    /// Rows of `history.csv` that belong to this part.
    rows: std::ops::Range<usize>,
    /// True if this part began at full strength.
    begins_whole: bool,
    /// True if displacements are measured from the start of this part.
    begins_at_rest: bool,
}

/// The last stage that reduced the strength, whose factors are in the summary; `None` if there is no such stage.
fn reduction(run: &Run) -> Option<Reduction> {
    let deck = run.deck.as_ref()?;
    let from = |control: &ControlDeck| match control {
        ControlDeck::StrengthReduction { from, .. } => Some(*from),
        _ => None,
    };
    if let Some(steps) = &deck.steps {
        let begins_whole = from(&steps.control)? == 1.0;
        return Some(Reduction { rows: 0..run.steps(), begins_whole, begins_at_rest: true });
    }
    let stages = stages(run);
    let number = stages
        .iter()
        .rposition(|stage| from(&stage.deck.steps.control).is_some() && !stage.rows.is_empty())?;
    Some(Reduction {
        rows: stages[number].rows.clone(),
        begins_whole: from(&stages[number].deck.steps.control) == Some(1.0),
        begins_at_rest: number == 0 || stages[number - 1].deck.then.is_some(),
    })
}

/// Displacements of the probes against the factor, in charts of at most [`MAX_CURVES`] curves.
fn charts(run: &Run, reduction: &Reduction) -> Vec<Chart> {
    let Reduction { rows, begins_whole, begins_at_rest } = reduction;
    let factors = run.column("strength_factor").get(rows.clone()).unwrap_or_default();
    let Some(first) = factors.first() else { return Vec::new() };
    let curve = |(number, component): (usize, &Component)| {
        let values = run.column(&component.column);
        let before = rows.start.checked_sub(1).filter(|_| !begins_at_rest).and_then(|row| values.get(row));
        let start = begins_whole.then(|| [1.0, before.copied().unwrap_or(0.0)]);
        let displacements = values.get(rows.clone()).unwrap_or_default();
        Curve {
            name: component.label(),
            points: start
                .into_iter()
                .chain(factors.iter().zip(displacements).map(|(f, u)| [*f, *u]))
                .collect(),
            look: Look::Number(number),
        }
    };
    let found = bracket(run).unwrap_or_default();
    let bands = bands(&found, if *begins_whole { 1.0 } else { *first });
    let chart = |group: &[Component]| Chart {
        description: "displacement of the probes against the factor that divides the strength".to_owned(),
        x: Axis {
            contains: found.fails.into_iter().collect(),
            ..Axis::new("factor by which the strength is divided", Quantity::Number)
        },
        y: Axis { contains: vec![0.0], ..Axis::new("displacement", Quantity::Length) },
        curves: group.iter().enumerate().map(curve).collect(),
        levels: Vec::new(),
        bands: bands.clone(),
        height: 320.0,
    };
    components(std::slice::from_ref(run), 'u').chunks(MAX_CURVES).map(chart).collect()
}

/// Bands that name the state of the bodies between the factors of a reduction that begins at `from`; none if the bodies
/// stand throughout or never stand.
fn bands(found: &StrengthBracket, from: f64) -> Vec<Band> {
    let Some(stands) = found.stands.filter(|_| found.fails.is_some() || found.slides.is_some()) else {
        return Vec::new();
    };
    let band = |ends: [f64; 2], name: &str| Band { ends, name: name.to_owned() };
    let last = found.fails.map(|fails| band([stands, fails], "no equilibrium"));
    let Some([before, after]) = found.slides else {
        return [band([from, stands], "in equilibrium")].into_iter().chain(last).collect();
    };
    let in_other_shape = (after < stands).then(|| band([after, stands], "another shape"));
    let first = [band([from, before], "in equilibrium"), band([before, after], "slides")];
    first.into_iter().chain(in_other_shape).chain(last).collect()
}

/// Adds displacement against the factor and the mechanism, if the run has reduced the strength.
pub(super) fn section(page: &mut Page, run: &Run, naming: &Naming) -> Result<(), ReportError> {
    let (Some(reduction), Some(bracket)) = (reduction(run), bracket(run)) else { return Ok(()) };
    page.section("Factor of safety");
    let dependence = dependence(run);
    let dependence = dependence.map(|text| format!(" Here {text}: compare another grid."));
    page.paragraph(&format!(
        "Factor of safety: {}.{}",
        escape(&bracket.to_string()),
        dependence.unwrap_or_default()
    ));
    if bracket.attempts > 0 {
        let cpu = run.summary["strength_reduction"]["cpu_seconds"].as_f64().unwrap_or_default();
        page.paragraph(&format!(
            "The search took {}, {} and {} s of processor time.",
            counted(bracket.attempts, "attempt", "attempts"),
            counted(bracket.evaluations, "evaluation", "evaluations"),
            html(cpu, 2)
        ));
    }
    for earlier in earlier(run) {
        page.paragraph(&escape(&earlier));
    }
    page.paragraph(
        "Failure shows as a displacement that grows without bound as the factor approaches the last value with \
         equilibrium. If the growth begins well before that, the body has found equilibrium in another shape, and \
         the factor of safety of the original shape lies where the growth begins.",
    );
    let charts = charts(run, &reduction);
    if charts.is_empty() {
        page.paragraph(
            "The deck has no probe that moves; one under <code>output: {probes: ...}</code> would show displacement \
             against the factor.",
        );
    }
    for chart in charts {
        page.figure(
            "Displacements of the probes against the factor by which the strength is divided.",
            &chart.svg(naming),
        );
    }
    mechanism(page, run, naming, &reduction.rows)
}

/// Adds pictures of the last state of the reduction: displacement and equivalent plastic strain.
fn mechanism(
    page: &mut Page,
    run: &Run,
    naming: &Naming,
    rows: &std::ops::Range<usize>,
) -> Result<(), ReportError> {
    let steps = run.column("step").get(rows.clone()).unwrap_or_default();
    let is_of_stage = |step: usize| steps.contains(&(step as f64));
    let written: Vec<_> = run.points.iter().filter(|snapshot| is_of_stage(snapshot.step)).cloned().collect();
    let Some(snapshot) = StepChoice::find_all(&[StepChoice::Last], &written)?.into_iter().next() else {
        return Ok(());
    };
    let row = run.column("step").iter().position(|step| *step == snapshot.step as f64);
    let factor = row.and_then(|row| run.column("strength_factor").get(row)).copied().unwrap_or(1.0);
    for (number, field) in FieldChoice::mechanism(&snapshot)?.iter().enumerate() {
        let title = format!("Step {}, factor {}", snapshot.step, plain(factor, 5));
        let scenes = vec![Scene::read(run, &snapshot, field, title)?];
        let gallery = Gallery::new(&scenes, field);
        let caption = format!("The mechanism. {}", gallery.caption(naming));
        page.figure(&caption, &gallery.html(naming, &format!("mechanism-{number}"))?);
    }
    Ok(())
}
