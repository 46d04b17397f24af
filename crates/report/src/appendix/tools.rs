//! The tools of a run: forces, moments and motions at the end and at their extremes, and force against displacement.

use serde_json::Value;

use mpm_deck::ToolDeck;

use super::chart::{Axis, Chart, Curve, Look};
use super::curves::{AXES, Progress, largest};
use super::page::{Cell, Page, Table, escape};
use super::run::Run;
use super::sections::{in_words, with_unit};
use super::stages::bands_over_time;
use super::units::{Naming, Quantity};

/// Largest number of curves in one chart.
const MAX_CURVES: usize = 12;
/// Values below this share of the largest count as round-off.
const ROUND_OFF: f64 = 1e-9;

/// A column of a tool, of one of its parts, or of two bodies in contact.
pub(super) struct Quantified {
    /// The column of `history.csv`.
    pub(super) column: String,
    /// Name of the column in a table, such as `tip: force y`.
    pub(super) name: String,
    pub(super) quantity: Quantity,
}

/// Adds a table of the tools as the deck gives them, if it has any.
pub(super) fn given(page: &mut Page, deck: &Value) {
    let mut table = Table::new(["Tool", "Shape", "Values"]);
    for tool in deck["tools"].as_array().into_iter().flatten() {
        let mut rest = tool.clone();
        if let Some(map) = rest.as_object_mut() {
            map.retain(|key, _| key != "name" && key != "shape");
        }
        let name = tool["name"].as_str().unwrap_or_default();
        table.row([Cell::name(name), Cell::Html(in_words(&tool["shape"])), Cell::Html(in_words(&rest))]);
    }
    page.table("Tools.", &table);
}

/// Adds the section, if the deck has tools.
pub(super) fn section(page: &mut Page, run: &Run, naming: &Naming) {
    let Some(deck) = run.deck.as_ref().filter(|deck| !deck.tools.is_empty() && run.steps() > 0) else {
        return;
    };
    page.section("Tools");
    page.paragraph(
        "Forces and moments are those that the tools exert on the bodies; moments are about the reference points of \
         the tools.",
    );
    for tool in &deck.tools {
        let columns = columns(run, tool);
        let name = format!("the tool <code>{}</code>", escape(&tool.name));
        let parts = if tool.parts.is_empty() { "" } else { " and its parts" };
        page.table(&format!("Tool <code>{}</code>.", escape(&tool.name)), &table(run, &columns, naming));
        figures(page, run, &columns, &format!("{name}{parts}"), naming);
    }
    if let Some(work) = run.number("/friction_work") {
        let work = with_unit(work, Quantity::Energy, naming);
        page.paragraph(&format!("Friction between the tools and the bodies has dissipated {work}."));
    }
}

/// The columns of a tool and of its parts, then those of its contact. Columns of forces, moments and motions that do
/// not exist are left out.
fn columns(run: &Run, tool: &ToolDeck) -> Vec<Quantified> {
    let kinds = [("f", "force", Quantity::Force), ("m", "moment", Quantity::Moment)];
    let motions = [("u", "displacement", Quantity::Length), ("turn_", "rotation", Quantity::Angle)];
    let mut found = Vec::new();
    let mut add = |owner: &str, before: &str, (letter, what, quantity): (&str, &str, Quantity)| {
        for axis in AXES {
            let column = format!("{owner}_{letter}{axis}");
            if !run.column(&column).is_empty() {
                found.push(Quantified { column, name: format!("{before}{what} {axis}"), quantity });
            }
        }
    };
    kinds.into_iter().chain(motions).for_each(|kind| add(&tool.name, "", kind));
    for part in tool.parts.keys() {
        kinds.into_iter().for_each(|kind| add(&format!("{}_{part}", tool.name), &format!("{part}: "), kind));
    }
    for (ending, name, quantity) in [
        ("contacts", "places in contact", Quantity::Number),
        ("overlap", "largest overlap", Quantity::Length),
        ("allowed_overlap", "largest overlap left by boxes", Quantity::Length),
    ] {
        let column = format!("{}_{ending}", tool.name);
        found.push(Quantified { column, name: name.to_owned(), quantity });
    }
    found
}

/// The values of columns at the end, and their extremes with the steps in which they occur.
pub(super) fn table(run: &Run, columns: &[Quantified], naming: &Naming) -> Table {
    let mut table = Table::new(["", "#At the end", "#Lowest", "#In step", "#Highest", "#In step"]);
    let steps = run.column("step");
    for Quantified { column, name, quantity } in columns {
        let values = run.column(column);
        let alike = columns.iter().filter(|other| other.quantity == *quantity);
        let most = alike.map(|other| largest(run, &other.column)).fold(0.0, f64::max);
        // A component that does not act is 0 except for round-off.
        let shown = |value: f64| Cell::rounded(if value.abs() > ROUND_OFF * most { value } else { 0.0 }, 5);
        let at = |row: usize| Cell::maybe(steps.get(row).copied(), 9);
        let rows = 0..values.len();
        let lowest = rows.clone().min_by(|a, b| values[*a].total_cmp(&values[*b]));
        let highest = rows.rev().max_by(|a, b| values[*a].total_cmp(&values[*b]));
        let (Some(last), Some(lowest), Some(highest)) = (values.last(), lowest, highest) else { continue };
        table.row([
            Cell::text(&naming.label(name, *quantity, 0)),
            shown(*last),
            shown(values[lowest]),
            at(lowest),
            shown(values[highest]),
            at(highest),
        ]);
    }
    table
}

/// Forces and moments among the columns of what `owner` names, against its motion if it has one.
pub(super) fn figures(page: &mut Page, run: &Run, columns: &[Quantified], owner: &str, naming: &Naming) {
    for (quantity, name, motion) in
        [(Quantity::Force, "force", Quantity::Length), (Quantity::Moment, "moment", Quantity::Angle)]
    {
        let alike = || columns.iter().filter(|column| column.quantity == quantity);
        let most = alike().map(|column| largest(run, &column.column)).fold(0.0, f64::max);
        let acting: Vec<&Quantified> =
            alike().filter(|column| largest(run, &column.column) > ROUND_OFF * most).collect();
        let moved =
            largest_motion(run, columns, motion).or_else(|| largest_motion(run, columns, Quantity::Length));
        for group in acting.chunks(MAX_CURVES) {
            let (chart, against) = chart(run, group, quantity, name, moved);
            let name = if name == "force" { "Forces" } else { "Moments" };
            page.figure(&format!("{name} of {owner} against {against}."), &chart.svg(naming));
        }
    }
}

/// The largest component of the motion of a tool, measured in this quantity; `None` if it has no such motion.
fn largest_motion<'a>(run: &Run, columns: &'a [Quantified], quantity: Quantity) -> Option<&'a Quantified> {
    let is_motion = |column: &&Quantified| {
        column.quantity == quantity
            && !column.column.ends_with("_overlap")
            && !column.column.ends_with("_slip")
            && largest(run, &column.column) > 0.0
    };
    let size = |column: &Quantified| largest(run, &column.column);
    columns.iter().filter(is_motion).max_by(|a, b| size(a).total_cmp(&size(b)))
}

/// Columns against a motion, or against load factor or time if the tool does not move, and the words for the abscissa.
fn chart(
    run: &Run,
    group: &[&Quantified],
    quantity: Quantity,
    name: &str,
    moved: Option<&Quantified>,
) -> (Chart, String) {
    let progress = Progress::common(std::slice::from_ref(run));
    let along = moved.map(|motion| progress.points(run, &motion.column));
    let curve = |(number, column): (usize, &&Quantified)| {
        let mut points = progress.points(run, &column.column);
        for (point, motion) in points.iter_mut().zip(along.iter().flatten()) {
            point[0] = motion[1];
        }
        let short = column.name.replace(&format!("{name} "), "");
        Curve { name: short, points, look: Look::Number(number) }
    };
    let (x, bands) = match moved {
        Some(motion) => (Axis::new(&motion.name, motion.quantity), Vec::new()),
        None => (progress.axis(), bands_over_time(run)),
    };
    let against = x.name.clone();
    let chart = Chart {
        description: format!("{name} against {against}"),
        x,
        y: Axis { contains: vec![0.0], ..Axis::new(name, quantity) },
        curves: group.iter().enumerate().map(curve).collect(),
        levels: Vec::new(),
        bands,
        height: 320.0,
    };
    (chart, against)
}
