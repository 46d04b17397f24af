//! The page about one run.

use serde_json::Value;

use mpm_core::timing::Phase;
use mpm_deck::Parameter;

use super::curves::{self, AXES, Progress};
use super::error::ReportError;
use super::field::StepChoice;
use super::limit;
use super::number::{duration, html, memory};
use super::options::Options;
use super::page::{Cell, Page, Table, escape};
use super::picture::Gallery;
use super::run::Run;
use super::scene::Scene;
use super::sections::{
    banner, foot, in_units, in_words, largest_residual, machine, messages, naming, program, started,
    steps_in_words, title_block, wall_time, warnings, with_unit,
};
use super::stages;
use super::strength;
use super::units::{Naming, Quantity};
use super::{contacts, tools};

/// Writes the page.
pub(super) fn page(run: &Run, options: &Options) -> Result<String, ReportError> {
    let naming = naming(std::slice::from_ref(run), options);
    let mut page = Page::default();
    outcome(&mut page, run, &naming);
    model(&mut page, run, &naming);
    load_and_displacement(&mut page, run, &naming);
    tools::section(&mut page, run, &naming);
    contacts::section(&mut page, run, &naming);
    strength::section(&mut page, run, &naming)?;
    deformed_points(&mut page, run, options, &naming)?;
    convergence(&mut page, run, &naming);
    quality(&mut page, run, &naming);
    cost(&mut page, run);
    deck(&mut page, run);
    let title = run.title();
    let head = format!(
        "<header>\n<p class=\"kind\">Report of an analysis</p>\n<h1>{}</h1>\n{}</header>\n",
        escape(title),
        title_block(&[
            ("Results", Some(format!("<code>{}</code>", escape(&run.directory.display().to_string())))),
            ("Deck", run.text("/deck/file").map(|file| format!("<code>{}</code>", escape(file)))),
            ("Run on", started(run)),
            ("Program", program(run)),
            ("Wall time", wall_time(run)),
            ("Hash of the deck", run.text("/deck_hash").map(|hash| format!("<code>{}</code>", escape(hash)))),
            ("Machine", machine(run)),
        ])
    );
    Ok(page.finish(title, &head, &foot(std::slice::from_ref(run), &naming)))
}

fn outcome(page: &mut Page, run: &Run, naming: &Naming) {
    page.section("Outcome");
    banner(page, run, None);
    warnings(page, run);
    messages(page, run);
    let mut table = Table::new(["", "#Value", "Remark"]);
    let mut row = |name: &str, value: Option<String>, remark: String| {
        if let Some(value) = value {
            table.row([Cell::text(name), Cell::Html(value), Cell::Html(remark)]);
        }
    };
    if let Some((words, remark)) = strength::key_number(run) {
        row("Factor of safety", Some(words), remark);
    }
    if let Some((words, remark)) = limit::key_number(run, naming) {
        row("Limit load", Some(words), remark);
    }
    row("Load steps in equilibrium", Some(steps_in_words(run)), String::new());
    let tolerance = run.deck.as_ref().map(curves::tolerance_in_words);
    let residual = largest_residual(run).map(|residual| html(residual, 3));
    row("Largest residual of a step", residual, tolerance.unwrap_or_default());
    let limited = run.column("rounding_limited").iter().filter(|limited| **limited == 1.0).count();
    let remark = "accepted although round-off prevents them from reaching the tolerance".to_owned();
    row("Steps limited by round-off", (limited > 0).then(|| limited.to_string()), remark);
    for (key, name, quantity) in EXTREMES {
        if let Some((value, remark)) = extreme(run, key, quantity, naming) {
            row(name, Some(value), remark);
        }
    }
    for (column, name) in [("external_work", "External work"), ("strain_energy", "Strain energy")] {
        let last = run.column(column).last().map(|value| with_unit(*value, Quantity::Energy, naming));
        row(name, last, String::new());
    }
    let count = |key: &str| run.number(key).map(|count| html(count, 12));
    row("Material points", count("/points"), String::new());
    row("Cells of the grid", count("/cells"), String::new());
    row("Unknowns", count("/unknowns"), "in the step with the most".to_owned());
    let indefinite = run.number("/indefinite_solves").filter(|n| *n > 0.0);
    let remark = indefinite.map(|n| format!("{} with a matrix that was not positive definite", html(n, 9)));
    row("Linear solves", count("/linear_solves"), remark.unwrap_or_default());
    page.table("Key numbers.", &table);
    stages::table(page, run);
    end_of_run(page, run, naming);
}

/// Extreme values at the end of the last step: key in the summary, name, kind of quantity.
const EXTREMES: [(&str, &str, Quantity); 4] = [
    ("displacement", "Largest displacement", Quantity::Length),
    ("von_mises_stress", "Largest von Mises stress", Quantity::Stress),
    ("lowest_pressure", "Lowest pressure", Quantity::Stress),
    ("highest_pressure", "Highest pressure", Quantity::Stress),
];

/// One of the extreme values, and its location.
fn extreme(run: &Run, key: &str, quantity: Quantity, naming: &Naming) -> Option<(String, String)> {
    let found = &run.summary["largest"][key];
    let place: Vec<String> =
        found["position"].as_array()?.iter().filter_map(Value::as_f64).map(|x| html(x, 4)).collect();
    let (body, point) = (escape(found["body"].as_str()?), found["point"].as_u64()?);
    let remark = format!("<code>{body}</code>, point {point} at ({})", place.join(", "));
    Some((with_unit(found["value"].as_f64()?, quantity, naming), remark))
}

/// Names in a table, each with a number, possibly missing, for each axis.
type Rows = Vec<(Cell, Vec<Option<f64>>)>;

/// The last values of those columns of the history whose kind is `letter`: `r` for reactions, `f` for loads, `u` for
/// probes.
fn last_values(run: &Run, letter: char, axes: &[&str]) -> Rows {
    let last = |name: &str, axis: &&str| run.column(&format!("{name}_{letter}{axis}")).last().copied();
    let names = run.names_before(&format!("_{letter}x")).into_iter();
    let rows = names.map(|name| (Cell::name(name), axes.iter().map(|axis| last(name, axis)).collect()));
    rows.filter(|(_, values): &(Cell, Vec<Option<f64>>)| values.iter().any(Option::is_some)).collect()
}

/// A table of numbers for each axis, with a separate last row.
fn table_by_axis(
    head: &str,
    axes: &[&str],
    quantity: Quantity,
    rows: Rows,
    last: Rows,
    naming: &Naming,
) -> Table {
    let heads = axes.iter().map(|axis| format!("#{}", escape(&naming.label(axis, quantity, 0))));
    let mut table = Table::new(std::iter::once(head.to_owned()).chain(heads));
    let known = rows.iter().flat_map(|(_, values)| values).flatten();
    let largest = known.fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let cells = |(name, values): (Cell, Vec<Option<f64>>)| {
        let numbers: Vec<Cell> = values.into_iter().map(|value| Cell::beside(value, largest, 6)).collect();
        std::iter::once(name).chain(numbers)
    };
    rows.into_iter().for_each(|row| table.row(cells(row)));
    // Small differences between large numbers would otherwise not be visible.
    for (name, values) in last {
        let numbers = values.into_iter().map(|value| Cell::maybe(value, 3));
        table.total(std::iter::once(name).chain(numbers));
    }
    table
}

/// Forces and probes at the end of the last step.
fn end_of_run(page: &mut Page, run: &Run, naming: &Naming) {
    let Some(step) = run.column("step").last().map(|step| html(*step, 9)) else { return };
    let has = |axis: &&str| "rfu".chars().any(|letter| run.has_column_of(&format!("_{letter}{axis}")));
    let axes: Vec<&str> = AXES.into_iter().filter(has).collect();
    let forces = &run.summary["forces"];
    let along = |key: &str| -> Option<Vec<Option<f64>>> {
        Some(forces[key].as_array()?.iter().map(Value::as_f64).collect())
    };
    let mut rows = last_values(run, 'r', &axes);
    // The forces of tools, and those that a stage releases.
    let further = forces["further"].as_object().into_iter().flatten();
    rows.extend(further.map(|(name, force)| {
        let along = |axis: usize| force.get(axis).and_then(Value::as_f64);
        (Cell::name(name), (0..axes.len()).map(along).collect())
    }));
    let what = if forces["further"].is_null() { "" } else { ", tools and forces that a stage releases" };
    let applied = along("applied");
    let mut caption = format!(
        "Forces on the bodies at the end of step {step}: reactions of the boundary conditions{what}."
    );
    if applied.is_some() {
        caption = format!(
            "Forces on the bodies at the end of step {step}: loads, and reactions of the boundary conditions{what}"
        );
        let relative = forces["relative_difference"].as_f64();
        let share = relative.map(|share| format!("; their sum is {} of all forces", html(share, 2)));
        caption.push_str(&format!("{}.", share.unwrap_or_default()));
    }
    let sum = along("difference").map(|sum| (Cell::text("Sum"), sum));
    let load_rows = last_values(run, 'f', &axes);
    // Several loads have rows under their names, a single one under `Loads`.
    if load_rows.len() > 1 {
        rows.splice(0..0, load_rows);
    } else {
        rows.splice(0..0, applied.map(|applied| (Cell::text("Loads"), applied)));
    }
    let sum = sum.into_iter().collect();
    page.table(&caption, &table_by_axis("Forces", &axes, Quantity::Force, rows, sum, naming));
    let caption = format!("Displacements of the probes at the end of step {step}.");
    let probes = last_values(run, 'u', &axes);
    page.table(&caption, &table_by_axis("Probe", &axes, Quantity::Length, probes, Vec::new(), naming));
}

fn model(page: &mut Page, run: &Run, naming: &Naming) {
    let Some(deck) = &run.deck else { return };
    page.section("Model");
    let value = serde_json::to_value(deck).unwrap_or_default();
    let count =
        |key: &str| run.number(key).map_or_else(String::new, |count| format!(", {} cells", html(count, 12)));
    page.paragraph(&format!(
        "Analysis: {}. Grid: {}{}. Load steps: {}; Newton iterations: {}.",
        in_words(&value["analysis"]),
        in_words(&value["grid"]),
        count("/cells"),
        stages::steps_of_deck(run, &value),
        in_words(&value["solver"]),
    ));
    let mut bodies = Table::new(["Body", "Material", "Method", "#Points", "Shape"]);
    for (body, value) in deck.bodies.iter().zip(value["bodies"].as_array().into_iter().flatten()) {
        let update = body.domain_update.map(|update| format!(", domain update {}", escape(update.name())));
        bodies.row([
            Cell::name(&body.name),
            Cell::name(&body.material),
            Cell::Html(format!("{}{}", escape(body.method.name()), update.unwrap_or_default())),
            Cell::maybe(run.summary["bodies"][&body.name]["points"].as_f64(), 12),
            Cell::Html(in_words(&value["shape"])),
        ]);
    }
    page.table("Bodies.", &bodies);
    let mut materials = Table::new(["Material", "Law", "Parameters"]);
    for (name, material) in value["materials"].as_object().into_iter().flatten() {
        materials.row([
            Cell::name(name),
            named(material, "model"),
            Cell::Html(in_units(&without(material, &["model"]), naming)),
        ]);
    }
    page.table("Materials.", &materials);
    let mut conditions = Table::new(["Boundary condition", "Nodes", "Prescribes"]);
    for condition in value["boundary_conditions"].as_array().into_iter().flatten() {
        let rest = without(condition, &["name", "nodes", "surface"]);
        let place = match condition["surface"].as_str() {
            Some(surface) => format!("surface <code>{}</code>", escape(surface)),
            None => in_words(&condition["nodes"]),
        };
        conditions.row([named(condition, "name"), Cell::Html(place), Cell::Html(in_words(&rest))]);
    }
    page.table("Boundary conditions.", &conditions);
    let mut loads = Table::new(["Load", "Kind", "Values at load factor 1"]);
    for load in value["loads"].as_array().into_iter().flatten() {
        let rest = without(load, &["name", "type"]);
        loads.row([named(load, "name"), named(load, "type"), Cell::Html(in_units(&rest, naming))]);
    }
    page.table("Loads.", &loads);
    tools::given(page, &value);
    contacts::given(page, &value);
}

fn named(entry: &Value, key: &str) -> Cell {
    entry[key].as_str().map_or(Cell::Empty, Cell::name)
}

/// An entry of the deck without some of its keys.
fn without(entry: &Value, keys: &[&str]) -> Value {
    let mut rest = entry.clone();
    if let Some(map) = rest.as_object_mut() {
        map.retain(|key, _| !keys.contains(&key.as_str()));
    }
    rest
}

fn load_and_displacement(page: &mut Page, run: &Run, naming: &Naming) {
    if run.steps() == 0 {
        return;
    }
    let runs = std::slice::from_ref(run);
    page.section("Load and displacement");
    let against = Progress::common(runs).name();
    for chart in curves::against_load(run, &curves::components(runs, 'u'), "displacement", Quantity::Length) {
        page.figure(&format!("Displacements of the probes against {against}."), &chart.svg(naming));
    }
    for chart in curves::against_load(run, &curves::components(runs, 'r'), "reaction", Quantity::Force) {
        page.figure(&format!("Reactions of the boundary conditions against {against}."), &chart.svg(naming));
    }
    if !Progress::common(runs).is_factor() {
        for chart in curves::against_load(run, &curves::components(runs, 'f'), "load", Quantity::Force) {
            page.figure(&format!("Resultants of the loads against {against}."), &chart.svg(naming));
        }
    }
    if let Some((caption, chart)) = curves::load_displacement(runs) {
        page.figure(&caption, &chart.svg(naming));
    }
    page.figure(
        &format!("Work of loads and reactions, and stored elastic energy, against {against}."),
        &curves::energies(run).svg(naming),
    );
}

fn deformed_points(
    page: &mut Page,
    run: &Run,
    options: &Options,
    naming: &Naming,
) -> Result<(), ReportError> {
    page.section("Deformed points");
    if run.points.is_empty() && options.asks_for_pictures() {
        return Err(ReportError::NoPictures { path: run.directory.clone() });
    }
    if run.points.is_empty() {
        page.paragraph("The run wrote no VTU files of the points, so there are no pictures.");
        return Ok(());
    }
    let snapshots = StepChoice::find_all(&options.steps, &run.points)?;
    let progress = Progress::common(std::slice::from_ref(run));
    for (number, field) in options.fields(&snapshots)?.iter().enumerate() {
        let mut scenes = Vec::new();
        for snapshot in &snapshots {
            let at = super::number::plain(progress.at(run, snapshot.time), 4);
            let stage = stages::after_comma(run, snapshot.step);
            let title = format!("Step {}{stage}, {} {at}", snapshot.step, progress.name());
            scenes.push(Scene::read(run, snapshot, field, title)?);
        }
        let gallery = Gallery::new(&scenes, field);
        page.figure(&gallery.caption(naming), &gallery.html(naming, &format!("colours-{number}"))?);
    }
    Ok(())
}

fn convergence(page: &mut Page, run: &Run, naming: &Naming) {
    let Some((chart, drawn, all)) = curves::residuals(run) else { return };
    let runs = std::slice::from_ref(run);
    page.section("Convergence");
    let which = if drawn < all {
        format!("{drawn} of the {all} load steps, evenly spread")
    } else {
        "all load steps".to_owned()
    };
    let caption = format!(
        "Relative out-of-balance force against iteration, {which}, from pale (first) to dark (last); iteration 0 is before the first solve."
    );
    page.figure(&caption, &chart.svg(naming));
    if run.steps() > 0 {
        page.figure("Iterations of each load step.", &curves::iterations(runs).svg(naming));
    }
    if let Some(chart) = curves::orders(runs) {
        let order = &run.summary["quality"]["newton_order"];
        let median = order["median"].as_f64().map(|median| format!(" Their median is {}.", html(median, 3)));
        let caption = format!(
            "Observed order of the Newton iterations, from the last three residuals above round-off, where it \
             can be determined; it is not meaningful where residuals fall unevenly, as when stiff and soft modes alternate.{}",
            median.unwrap_or_default()
        );
        page.figure(&caption, &chart.svg(naming));
    }
}

fn quality(page: &mut Page, run: &Run, naming: &Naming) {
    let quality = &run.summary["quality"];
    if !quality.is_object() {
        return;
    }
    page.section("Quality");
    let mut table = Table::new(["Measure", "#Value", "Where", "Meaning"]);
    let place = |entry: &Value| {
        let mut parts = Vec::new();
        parts.extend(entry["step"].as_u64().map(|step| format!("step {step}")));
        parts.extend(entry["body"].as_str().map(|body| format!("<code>{}</code>", escape(body))));
        parts.extend(entry["point"].as_u64().map(|point| format!("point {point}")));
        parts.extend(entry["cell"].as_u64().map(|cell| format!("cell {cell}")));
        Cell::Html(parts.join(", "))
    };
    for (key, name, scale, meaning) in MEASURES {
        let entry = &quality[key];
        if let Some(value) = entry["value"].as_f64().or(entry.as_f64()) {
            table.row([Cell::text(name), Cell::rounded(value * scale, 3), place(entry), Cell::text(meaning)]);
        }
    }
    if let (Some(min), Some(max)) = (quality["det_f"]["min"].as_f64(), quality["det_f"]["max"].as_f64()) {
        for (name, value) in [("Smallest det F", min), ("Largest det F", max)] {
            table.row([
                Cell::text(name),
                Cell::rounded(value, 4),
                Cell::Html(String::new()),
                Cell::text("current volume divided by original volume"),
            ]);
        }
    }
    for (key, kind) in [("mass", Quantity::Mass), ("volume", Quantity::Volume)] {
        let total = quality[key]["total"].as_f64().filter(|total| *total > 0.0);
        if let (Some(total), Some(change)) = (total, quality[key]["relative_change"].as_f64()) {
            let meaning = format!("total now {}", with_unit(total, kind, naming));
            let name = format!("Change of the {key} [%]");
            table.row([
                Cell::Html(name),
                Cell::rounded(100.0 * change, 3),
                Cell::Html(String::new()),
                Cell::Html(meaning),
            ]);
        }
    }
    page.table("Quality of the run: the worst value over all load steps.", &table);
}

/// Measures with one value each: key, name, factor, meaning.
const MEASURES: [(&str, &str, f64, &str); 7] = [
    (
        "partition_of_unity_loss",
        "Loss of the partition of unity",
        1.0,
        "one minus the sum of the basis functions at a point",
    ),
    ("domain_outside_grid", "Domain outside the grid [%]", 100.0, "largest share of a domain"),
    (
        "smallest_cell_filling",
        "Smallest filling ratio of a cell [%]",
        100.0,
        "volume of the points in a cell divided by that of the cell",
    ),
    (
        "domain_volume_excess",
        "Excess of domain volume [%]",
        100.0,
        "volume of the domains relative to that of the points; negative: gaps",
    ),
    ("domain_overlap", "Overlap of domains [%]", 100.0, "volume shared by domains at the end of the run"),
    ("rotation", "Largest rotation [°]", 1.0, "of R in F = R U, about any axis"),
    ("shear", "Largest shear", 1.0, "tangent of the change of an initially right angle"),
];

fn cost(page: &mut Page, run: &Run) {
    let seconds = |clock: &str, phase: &str| run.summary[clock][phase].as_f64();
    let Some(total) = seconds("wall_seconds", "total") else { return };
    page.section("Cost");
    let mut table = Table::new(["Phase", "#Wall [s]", "#CPU [s]", "#Share of wall [%]", ""]);
    let cells = |name: &str, wall: f64, cpu: Option<f64>| {
        let share = wall / total.max(f64::MIN_POSITIVE);
        let share_cells = [Cell::fixed(Some(100.0 * share), 1), Cell::Bar(share)];
        [Cell::text(name), Cell::fixed(Some(wall), 3), Cell::fixed(cpu, 3)].into_iter().chain(share_cells)
    };
    let (mut other_wall, mut other_cpu) = (total, seconds("cpu_seconds", "total"));
    for phase in Phase::ALL {
        let name = phase.name();
        if let Some(wall) = seconds("wall_seconds", name) {
            let cpu = seconds("cpu_seconds", name);
            table.row(cells(name, wall, cpu));
            other_wall -= wall;
            other_cpu = other_cpu.zip(cpu).map(|(all, cpu)| all - cpu);
        }
    }
    table.row(cells("other", other_wall.max(0.0), other_cpu.map(|cpu| cpu.max(0.0))));
    table.total(cells("total", total, seconds("cpu_seconds", "total")));
    page.table("Time spent in each phase.", &table);
    let mut facts = vec![format!("Wall time {}", duration(total))];
    facts.extend(run.number("/threads").map(|n| {
        let noun = if n == 1.0 { "thread" } else { "threads" };
        format!("{n} {noun} (the number does not change the results)")
    }));
    facts.extend(run.number("/peak_memory_bytes").map(|bytes| format!("peak memory {}", memory(bytes))));
    let cost = "/cpu_microseconds_per_point_and_evaluation/all";
    facts
        .extend(run.number(cost).map(|cost| format!("{} µs of CPU per point and evaluation", html(cost, 3))));
    page.paragraph(&format!("{}.", facts.join("; ")));
}

fn deck(page: &mut Page, run: &Run) {
    page.section("Deck");
    let mut table = Table::new(["Parameter", "#Value", "#In the deck"]);
    for (name, value) in run.parameters() {
        let default = run.defaults.iter().find(|(known, _)| *known == name).map(|(_, default)| default);
        let cell = |value: Option<&Parameter>| match value {
            Some(Parameter::Number(number)) => Cell::rounded(*number, 12),
            Some(Parameter::Word(word)) => Cell::name(word),
            None => Cell::Empty,
        };
        let used: Option<Parameter> = serde_json::from_value(value).ok();
        let changed = default.is_some() && used.as_ref() != default;
        let name =
            Cell::Html(format!("<code>{}</code>{}", escape(&name), if changed { " (changed)" } else { "" }));
        table.row([name, cell(used.as_ref()), cell(default)]);
    }
    page.table("Parameters of the deck as they were used.", &table);
    match run.deck_text() {
        Some(text) => page.push(&listing(text)),
        None => page.paragraph("The results do not contain the text of the deck."),
    }
}

/// The text of a deck, line by line, with comments marked.
fn listing(text: &str) -> String {
    let mut html = "<pre class=\"deck\">\n".to_owned();
    for line in text.lines() {
        // A `#` at the start of a line or after a space begins a comment, unless a quote is open before it.
        let is_comment = |at: &usize| {
            let before = &line[..*at];
            (before.is_empty() || before.ends_with([' ', '\t']))
                && before.matches(['"', '\'']).count() % 2 == 0
        };
        let begin = line.match_indices('#').map(|(at, _)| at).find(is_comment).unwrap_or(line.len());
        let comment = match &line[begin..] {
            "" => String::new(),
            comment => format!("<i>{}</i>", escape(comment)),
        };
        html.push_str(&format!("<code>{}{comment}</code>\n", escape(&line[..begin])));
    }
    html.push_str("</pre>\n");
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_of_a_deck_are_marked() {
        let html = listing("# all\na: \"#1\" # one <1>\nb: c#d");
        assert!(html.contains("<code><i># all</i></code>"));
        assert!(html.contains("<code>a: &quot;#1&quot; <i># one &lt;1&gt;</i></code>"));
        assert!(html.contains("<code>b: c#d</code>"));
    }
}
