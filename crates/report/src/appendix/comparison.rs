//! The page that compares several runs.

use std::collections::BTreeMap;

use similar::{ChangeTag, TextDiff};

use mpm_core::timing::Phase;

use super::curves::{self, Progress};
use super::error::ReportError;
use super::field::StepChoice;
use super::number::plain;
use super::options::Options;
use super::page::{Cell, Page, Table, escape};
use super::picture::Gallery;
use super::run::{Run, Snapshot, State};
use super::scene::Scene;
use super::sections::{
    banner, foot, largest_residual, machine, naming, program, started, state_in_words, steps_in_words,
    wall_time, warnings,
};
use super::strength;
use super::units::{Naming, Quantity};

/// Number of lines shown on either side of a difference.
const CONTEXT: usize = 2;

/// Writes the page.
pub(super) fn page(runs: &[Run], options: &Options) -> Result<String, ReportError> {
    let naming = naming(runs, options);
    let mut page = Page::default();
    outcome(&mut page, runs, &naming);
    decks(&mut page, runs);
    load_and_displacement(&mut page, runs, &naming);
    deformed_points(&mut page, runs, options, &naming)?;
    convergence(&mut page, runs, &naming);
    quality(&mut page, runs);
    cost(&mut page, runs);
    origins(&mut page, runs);
    let title = match runs.iter().all(|run| run.title() == runs[0].title()) {
        true => runs[0].title().to_owned(),
        false => format!("{} analyses", runs.len()),
    };
    let head = format!(
        "<header>\n<p class=\"kind\">Comparison of {} analyses</p>\n<h1>{}</h1>\n</header>\n",
        runs.len(),
        escape(&title)
    );
    Ok(page.finish(&format!("Comparison: {title}"), &head, &foot(runs, &naming)))
}

/// A table with one row per run; `cells` are the cells after the run name.
fn table_of_runs(
    runs: &[Run],
    head: impl IntoIterator<Item = String>,
    cells: impl Fn(&Run) -> Vec<Cell>,
) -> Table {
    let mut table = Table::new(std::iter::once("Run".to_owned()).chain(head));
    for run in runs {
        table.row(std::iter::once(Cell::name(&run.name)).chain(cells(run)));
    }
    table
}

/// The last value of a column of the history.
fn last(run: &Run, column: &str) -> Option<f64> {
    run.column(column).last().copied()
}

fn outcome(page: &mut Page, runs: &[Run], naming: &Naming) {
    page.section("Outcome");
    for run in runs {
        if run.state != State::Completed {
            banner(page, run, Some(&run.name));
        }
    }
    let heads =
        ["Outcome", "#Steps", "#Points", "#Unknowns", "#Linear solves", "#Largest residual", "#Wall time"];
    let table = table_of_runs(runs, heads.map(str::to_owned), |run| {
        vec![
            Cell::text(state_in_words(&run.state)),
            Cell::Html(steps_in_words(run)),
            Cell::maybe(run.number("/points"), 12),
            Cell::maybe(run.number("/unknowns"), 12),
            Cell::maybe(run.number("/linear_solves"), 12),
            Cell::maybe(largest_residual(run), 3),
            wall_time(run).map_or(Cell::Empty, Cell::Html),
        ]
    });
    page.table("Outcome of each run.", &table);
    factors_of_safety(page, runs);
    let mut columns: Vec<(String, String, Quantity)> = Vec::new();
    for (letter, quantity) in [('u', Quantity::Length), ('r', Quantity::Force)] {
        for component in curves::components(runs, letter) {
            let name = format!("{letter}<sub>{}</sub> {}", component.axis, escape(&component.name));
            columns.push((component.column, name, quantity));
        }
    }
    columns.push(("strain_energy".to_owned(), "strain energy".to_owned(), Quantity::Energy));
    // As many columns as fit on a page.
    for group in columns.chunks(6) {
        let heads = group.iter().map(|(_, name, quantity)| match naming.unit(*quantity) {
            unit if unit.is_empty() => format!("#{name}"),
            unit => format!("#{name} [{}]", escape(&unit)),
        });
        let cell = |run: &Run, column: &str| {
            let values = runs.iter().filter_map(|run| last(run, column));
            let largest = values.fold(0.0, |largest: f64, value| largest.max(value.abs()));
            Cell::beside(last(run, column), largest, 6)
        };
        let cells = |run: &Run| group.iter().map(|(column, _, _)| cell(run, column)).collect();
        page.table(
            "Values at the end of the last step in equilibrium: displacements of probes (u), reactions of boundary conditions (r).",
            &table_of_runs(runs, heads, cells),
        );
    }
    for run in runs {
        if run.summary["warnings"].as_array().is_some_and(|warnings| !warnings.is_empty()) {
            page.paragraph(&format!("Warnings of <code>{}</code>:", escape(&run.name)));
            warnings(page, run);
        }
    }
}

/// The factors of safety, one column for each stage that reduces the strength.
fn factors_of_safety(page: &mut Page, runs: &[Run]) {
    let mut stages: Vec<String> = Vec::new();
    for (stage, _) in runs.iter().flat_map(strength::factors) {
        if !stages.contains(&stage) {
            stages.push(stage);
        }
    }
    if stages.is_empty() {
        return;
    }
    let heads = stages.iter().map(|stage| match stage.as_str() {
        "" => "Factor of safety".to_owned(),
        stage => format!("Factor of safety, stage <code>{}</code>", escape(stage)),
    });
    let table = table_of_runs(runs, heads, |run| {
        let mut factors: BTreeMap<String, String> = strength::factors(run).into_iter().collect();
        stages.iter().map(|stage| factors.remove(stage).map_or(Cell::Empty, Cell::Html)).collect()
    });
    page.table(
        "Factors of safety: the largest factor with equilibrium in about the original shape, and one beyond it.",
        &table,
    );
}

fn decks(page: &mut Page, runs: &[Run]) {
    page.section("Differences of the decks");
    let mut names: Vec<String> = Vec::new();
    for (name, _) in runs.iter().flat_map(Run::parameters) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let value = |run: &Run, name: &str| {
        run.parameters().into_iter().find(|(known, _)| known == name).map(|(_, value)| value)
    };
    names.retain(|name| runs.iter().any(|run| value(run, name) != value(&runs[0], name)));
    if names.is_empty() {
        page.paragraph("All parameters have the same values.");
    } else {
        let heads = names.iter().map(|name| format!("#<code>{}</code>", escape(name)));
        let table = table_of_runs(runs, heads, |run| {
            let cell = |name: &String| match value(run, name) {
                Some(value) if value.is_number() => Cell::maybe(value.as_f64(), 12),
                Some(value) => value.as_str().map_or(Cell::Empty, Cell::name),
                None => Cell::Empty,
            };
            names.iter().map(cell).collect()
        });
        page.table("Parameters that differ.", &table);
    }
    for run in &runs[1..] {
        let (name, first) = (escape(&run.name), escape(&runs[0].name));
        match (runs[0].deck_text(), run.deck_text()) {
            (Some(a), Some(b)) if a == b => {
                page.paragraph(&format!("The deck of <code>{name}</code> has the same text as that of \
                    <code>{first}</code>."));
            }
            (Some(a), Some(b)) => {
                page.paragraph(&format!("Changes in the text of the deck from <code>{first}</code> to <code>{name}</code>:"));
                page.push(&difference(a, b));
            }
            _ => page.paragraph(&format!(
                "The texts of the decks of <code>{first}</code> and <code>{name}</code> cannot be compared: the results \
                 do not contain both."
            )),
        }
    }
}

/// Removed and inserted lines, with a few lines of context.
fn difference(a: &str, b: &str) -> String {
    let diff = TextDiff::from_lines(a, b);
    let mut html = "<pre class=\"difference\">\n".to_owned();
    for (index, group) in diff.grouped_ops(CONTEXT).iter().enumerate() {
        if index > 0 {
            html.push_str("<span>⋯</span>\n");
        }
        for change in group.iter().flat_map(|op| diff.iter_changes(op)) {
            let line = escape(change.value().trim_end_matches(['\n', '\r']));
            html.push_str(&match change.tag() {
                ChangeTag::Delete => format!("<del>\u{2212} {line}</del>\n"),
                ChangeTag::Insert => format!("<ins>+ {line}</ins>\n"),
                ChangeTag::Equal => format!("<span>\u{a0} {line}</span>\n"),
            });
        }
    }
    html.push_str("</pre>\n");
    html
}

fn load_and_displacement(page: &mut Page, runs: &[Run], naming: &Naming) {
    if runs.iter().all(|run| run.steps() == 0) {
        return;
    }
    page.section("Load and displacement");
    let against = Progress::common(runs).name();
    if let Some((caption, chart)) = curves::load_displacement(runs) {
        page.figure(&caption, &chart.svg(naming));
    }
    for (letter, what, quantity) in
        [('u', "displacement", Quantity::Length), ('r', "reaction", Quantity::Force)]
    {
        for component in curves::components(runs, letter) {
            if runs.iter().filter(|run| !run.column(&component.column).is_empty()).count() < 2 {
                continue;
            }
            let name = format!("{what} of {}", component.label());
            let chart = curves::across_runs(runs, &component.column, &name, quantity);
            let caption = format!(
                "{} of <code>{}</code> along {} against {against}.",
                if letter == 'u' { "Displacement" } else { "Reaction" },
                escape(&component.name),
                component.axis
            );
            page.figure(&caption, &chart.svg(naming));
        }
    }
}

fn deformed_points(
    page: &mut Page,
    runs: &[Run],
    options: &Options,
    naming: &Naming,
) -> Result<(), ReportError> {
    let shown: Vec<&Run> = runs.iter().filter(|run| !run.points.is_empty()).collect();
    if shown.is_empty() {
        return match runs.first().filter(|_| options.asks_for_pictures()) {
            Some(run) => Err(ReportError::NoPictures { path: run.directory.clone() }),
            None => Ok(()),
        };
    }
    page.section("Deformed points");
    let mut snapshots = Vec::new();
    for run in shown.iter().copied() {
        let found = StepChoice::find_all(&options.steps, &run.points);
        let last = found.map_err(|error| error.in_run(&run.name))?.pop();
        snapshots.extend(last.map(|snapshot| (run, snapshot)));
    }
    let all: Vec<Snapshot> = snapshots.iter().map(|(_, snapshot)| snapshot.clone()).collect();
    for (number, field) in options.fields(&all)?.iter().enumerate() {
        let mut scenes = Vec::new();
        for (run, snapshot) in &snapshots {
            let progress = Progress::common(std::slice::from_ref(*run));
            let at = plain(progress.at(run, snapshot.time), 4);
            let title = format!("{}: step {}, {} {at}", run.name, snapshot.step, progress.name());
            let scene = Scene::read(run, snapshot, field, title);
            scenes.push(scene.map_err(|error| error.in_run(&run.name))?);
        }
        let gallery = Gallery::new(&scenes, field);
        page.figure(&gallery.caption(naming), &gallery.html(naming, &format!("colours-{number}"))?);
    }
    if shown.len() < runs.len() {
        let missing: Vec<String> = runs
            .iter()
            .filter(|run| run.points.is_empty())
            .map(|run| format!("<code>{}</code>", escape(&run.name)))
            .collect();
        page.paragraph(&format!("No pictures can be made of {}.", missing.join(", ")));
    }
    Ok(())
}

fn convergence(page: &mut Page, runs: &[Run], naming: &Naming) {
    if runs.iter().all(|run| run.steps() == 0) {
        return;
    }
    page.section("Convergence");
    page.figure("Iterations of each load step.", &curves::iterations(runs).svg(naming));
    if let Some(chart) = curves::orders(runs) {
        page.figure(
            "Observed order of the Newton iterations, where it can be determined.",
            &chart.svg(naming),
        );
    }
}

fn quality(page: &mut Page, runs: &[Run]) {
    if runs.iter().all(|run| !run.summary["quality"].is_object()) {
        return;
    }
    page.section("Quality");
    let heads = [
        "#Loss of partition of unity",
        "#Outside grid [%]",
        "#Smallest filling [%]",
        "#Overlap [%]",
        "#Smallest det F",
        "#Largest det F",
        "#Newton order",
    ];
    let table = table_of_runs(runs, heads.map(str::to_owned), |run| {
        let measure = |pointer: &str, scale: f64| {
            Cell::maybe(
                run.summary["quality"].pointer(pointer).and_then(|v| v.as_f64()).map(|v| scale * v),
                3,
            )
        };
        vec![
            measure("/partition_of_unity_loss/value", 1.0),
            measure("/domain_outside_grid/value", 100.0),
            measure("/smallest_cell_filling/value", 100.0),
            measure("/domain_overlap", 100.0),
            measure("/det_f/min", 1.0),
            measure("/det_f/max", 1.0),
            measure("/newton_order/median", 1.0),
        ]
    });
    page.table(
        "Quality of each run: the worst value over all load steps, and the median of the observed orders.",
        &table,
    );
}

fn cost(page: &mut Page, runs: &[Run]) {
    if runs.iter().all(|run| run.summary["cpu_seconds"].is_null()) {
        return;
    }
    page.section("Cost");
    let phases: Vec<&str> = Phase::ALL.iter().map(|phase| phase.name()).chain(["total"]).collect();
    let heads = phases.iter().map(|phase| format!("#{phase}"));
    let table = table_of_runs(runs, heads, |run| {
        phases.iter().map(|phase| Cell::fixed(run.summary["cpu_seconds"][*phase].as_f64(), 3)).collect()
    });
    page.table("CPU time by phase [s].", &table);
}

fn origins(page: &mut Page, runs: &[Run]) {
    page.section("Runs");
    let heads = ["Started", "Program", "Hash of the deck", "Machine", "#Threads"];
    let table = table_of_runs(runs, heads.map(str::to_owned), |run| {
        let known = |text: Option<String>| text.map_or(Cell::Empty, Cell::Html);
        let hash = run.text("/deck_hash").map(|hash| format!("<code class=\"hash\">{}</code>", escape(hash)));
        let threads = Cell::maybe(run.number("/threads"), 4);
        vec![known(started(run)), known(program(run)), known(hash), known(machine(run)), threads]
    });
    page.table("Origin of the results.", &table);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_show_what_changed_and_a_little_around_it() {
        let a: String = (0..20).map(|i| format!("line {i}\n")).collect();
        let html = difference(&a, &a.replace("line 10\n", "line <ten>\n"));
        assert!(html.contains("<del>\u{2212} line 10</del>\n<ins>+ line &lt;ten&gt;</ins>"), "{html}");
        assert!(html.contains("line 8") && !html.contains("line 7"));
        assert_eq!(difference(&a, &a).matches("line").count(), 0);
    }
}
