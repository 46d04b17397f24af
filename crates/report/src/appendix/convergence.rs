//! The page about a convergence study.

use crate::study::convergence::{Convergence, GridRun, Trend};

use super::chart::{Axis, Chart, Curve, Look};
use super::element_test::capitalised;
use super::number::{duration, html};
use super::page::{Cell, Page, Table, escape};
use super::sections::{now, title_block};
use super::units::{Naming, Quantity};

/// Height of a chart, in screen pixels.
const HEIGHT: f64 = 300.0;

/// Makes the page.
pub fn convergence_page(study: &Convergence) -> String {
    let mut page = Page::default();
    conclusion(&mut page, study);
    grids(&mut page, study);
    charts(&mut page, study);
    let code = |text: &str| Some(format!("<code>{}</code>", escape(text)));
    let version = mpm_files::summary::VERSION;
    let head = format!(
        "<header>\n<p class=\"kind\">Convergence study</p>\n<h1>{}</h1>\n{}</header>\n",
        escape(study.findings.title.as_deref().unwrap_or(&study.findings.deck)),
        title_block(&[
            ("Deck", code(&study.findings.deck)),
            ("Quantity", code(&study.findings.quantity)),
            ("Program", Some(format!("mpm\u{a0}{version}"))),
        ])
    );
    let foot = format!(
        "<p>Written by mpm\u{a0}{version} on {}. The error bar covers the size of the cells, not that of the load steps, nor \
         the idealisation. With an order, it is 1.25 times the distance from the value on the finest grid to the \
         extrapolated value (Roache 1994); without one, three times the largest change between the grids. The change on \
         the moved grid, and half the width of a bracket, are added.</p>\n",
        now()
    );
    page.finish(&format!("Convergence: {}", study.findings.quantity), &head, &foot)
}

fn conclusion(page: &mut Page, study: &Convergence) {
    page.section("Conclusion");
    let class = match study.estimate.trend {
        Trend::Order | Trend::Settled => "completed",
        Trend::NoOrder(_) | Trend::Refused(_) => "interrupted",
    };
    let text = with_code(&study.conclusion());
    page.push(&format!("<p class=\"outcome {class}\" role=\"status\">{text}.</p>\n"));
    let mut table = Table::new(["#Error of at most [%]", "#Cells, relative to the finest grid", "#CPU time"]);
    for predicted in study.predictions.iter().filter(|predicted| predicted.size < 1.0) {
        table.row([
            Cell::Html(html(100.0 * predicted.error, 3)),
            Cell::Html(html(predicted.size, 2)),
            Cell::Html(escape(&duration(predicted.cpu_seconds))),
        ]);
    }
    page.table("Finer grids that are expected to give smaller errors.", &table);
}

/// Text as HTML, with what stands between backticks as code.
fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    let html = parts.map(|(number, part)| match number % 2 {
        1 => format!("<code>{}</code>", escape(part)),
        _ => escape(part),
    });
    html.collect()
}

fn grids(page: &mut Page, study: &Convergence) {
    page.section("Grids");
    let name = format!("#<code>{}</code>", escape(&study.findings.quantity));
    let mut table = Table::new(["Grid", "#Cell size", "#Points", name.as_str(), "#Change [%]", "#CPU time"]);
    let mut last: Option<f64> = None;
    let mut row = |run: &GridRun, before: Option<f64>| {
        let change = before.map(|before| 100.0 * (run.known.value / before - 1.0));
        table.row([
            Cell::name(&run.label),
            Cell::maybe(Some(run.size), 4),
            Cell::maybe(run.points, 12),
            Cell::maybe(Some(run.known.value), 7),
            Cell::maybe(change.filter(|change| change.is_finite()), 3),
            Cell::Html(escape(&duration(run.cpu_seconds))),
        ]);
    };
    for run in &study.findings.grids {
        row(run, last);
        last = Some(run.known.value);
    }
    if let Some(moved) = &study.findings.moved {
        let like = study.findings.grids.iter().find(|run| run.size == moved.size);
        row(moved, like.map(|run| run.known.value));
    }
    page.table(
        "The quantity on each grid, and its change from the grid before; on the moved grid, from the grid with cells of the \
         same size.",
        &table,
    );
    if let Some(why) = &study.findings.not_moved {
        page.paragraph(&format!("{}.", with_code(&capitalised(why))));
    }
}

fn charts(page: &mut Page, study: &Convergence) {
    page.section("Trend");
    let naming = Naming::default();
    let points = |value: &dyn Fn(&GridRun) -> f64| {
        study.findings.grids.iter().map(|run| [run.size, value(run)]).collect()
    };
    let estimate = &study.estimate;
    let curve = |name: &str, points: Vec<[f64; 2]>, number: usize| Curve {
        name: name.to_owned(),
        points,
        look: Look::Number(number),
    };
    let chart = |description: &str, x: Axis, y: Axis, curves: Vec<Curve>, levels: Vec<(f64, String)>| Chart {
        description: description.to_owned(),
        x,
        y,
        curves,
        levels,
        bands: Vec::new(),
        height: HEIGHT,
    };
    let levels = match estimate.bar {
        Some(bar) => vec![
            (estimate.value + bar, "upper end of the bar".to_owned()),
            (estimate.value - bar, "lower end of the bar".to_owned()),
        ],
        None => Vec::new(),
    };
    let x = Axis { contains: vec![0.0], ..Axis::new("cell size", Quantity::Length) };
    let y = Axis::new(&study.findings.quantity, Quantity::Number);
    let mut curves = vec![curve("runs", points(&|run| run.known.value), 0)];
    let moved = study.findings.moved.iter();
    curves.extend(moved.map(|run| curve("moved grid", vec![[run.size, run.known.value]], 1)));
    let values = chart("value against cell size", x, y, curves, levels);
    page.figure("The quantity against the size of the cells, with the error bar.", &values.svg(&naming));
    let (Trend::Order, Some(order)) = (&estimate.trend, estimate.order) else { return };
    let errors: Vec<[f64; 2]> = points(&|run| (run.known.value - estimate.value).abs());
    let Some([size, error]) = errors.last().copied() else { return };
    let line = errors.iter().map(|[at, _]| [*at, error * (at / size).powf(order)]).collect();
    let logarithmic =
        |name: &str, quantity: Quantity| Axis { logarithmic: true, ..Axis::new(name, quantity) };
    let curves = vec![curve("runs", errors, 0), curve(&format!("order {order:.2}"), line, 1)];
    let (x, y) = (logarithmic("cell size", Quantity::Length), logarithmic("distance", Quantity::Number));
    let distances = chart("distance from the extrapolated value against cell size", x, y, curves, Vec::new());
    page.figure(
        "Distance from the extrapolated value against the size of the cells, and a line of the order found.",
        &distances.svg(&naming),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::convergence::{Findings, Known};

    #[test]
    fn the_page_states_value_bar_and_order() {
        let run = |size: f64| GridRun {
            label: format!("h<{size}"),
            directory: "h".to_owned(),
            size,
            points: Some(4.0),
            known: Known { value: 10.0 + size, within: 0.0 },
            cpu_seconds: 1.0 / size,
        };
        let findings = Findings {
            deck: "a & b.yaml".to_owned(),
            title: None,
            quantity: "push_ry".to_owned(),
            dimensions: 2,
            grids: [4.0, 2.0, 1.0].map(run).to_vec(),
            moved: None,
            not_moved: Some("why".to_owned()),
            refused: None,
        };
        let study = findings.conclude(&[0.01]).unwrap();
        let page = convergence_page(&study);
        for part in
            ["a &amp; b.yaml", "h&lt;4", "tends to 10 ± 1.2 (12 %), with order 1", "order 1.00", "Why."]
        {
            assert!(page.contains(part), "{part}\n{page}");
        }
        assert_eq!(page.matches("<svg class=\"chart\"").count(), 2);
    }
}
