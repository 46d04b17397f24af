//! The stages of a run: a table, their bands in charts, and their names beside steps.

use serde_json::Value;

use mpm_deck::{AddDeck, StageDeck};

use super::chart::Band;
use super::number::{html, plain};
use super::page::{Cell, Page, Table, escape};
use super::run::Run;
use super::sections::in_words;

/// A stage of the deck, and the part of the history that belongs to it.
#[derive(Debug)]
pub(super) struct Stage<'a> {
    pub deck: &'a StageDeck,
    /// Times at its start and end, [time].
    times: [f64; 2],
    /// Rows of `history.csv`; none if the run has not reached the stage.
    pub rows: std::ops::Range<usize>,
}

/// The stages of a run; none in an analysis without stages, or if this version does not understand the deck.
pub(super) fn stages<'a>(run: &'a Run) -> Vec<Stage<'a>> {
    let (mut start, mut first) = (0.0, 0);
    let numbers = run.column("stage");
    let stage = |(index, deck): (usize, &'a StageDeck)| {
        let is_of_stage = |number: &&f64| **number == (index + 1) as f64;
        let rows = first..first + numbers[first..].iter().take_while(is_of_stage).count();
        let times = [start, start + deck.steps.end_time];
        (start, first) = (times[1], rows.end);
        Stage { deck, times, rows }
    };
    run.deck.iter().flat_map(|deck| &deck.stages).enumerate().map(stage).collect()
}

/// Adds a table of the stages, if the analysis has any.
pub(super) fn table(page: &mut Page, run: &Run) {
    let heads = ["Stage", "#Steps", "Time", "Changes", "#Iterations", "#Largest residual"];
    let mut table = Table::new(heads);
    for Stage { deck, times, rows } in stages(run) {
        let values = |column: &str| run.column(column).get(rows.clone()).unwrap_or_default().to_vec();
        let iterations: f64 = values("iterations").iter().sum();
        let residual = values("residual").into_iter().reduce(f64::max);
        let is_reached = !rows.is_empty();
        table.row([
            Cell::name(&deck.name),
            Cell::Html(format!("{} of {}", rows.len(), deck.steps.count())),
            Cell::Html(format!("{}\u{a0}to\u{a0}{}", html(times[0], 6), html(times[1], 6))),
            Cell::Html(changes(deck)),
            Cell::fixed(is_reached.then_some(iterations), 0),
            Cell::maybe(residual, 2),
        ]);
    }
    let cut = "The parts of a cut step count separately; iterations are those of the steps in equilibrium.";
    page.table(&format!("Stages of the analysis. {cut}"), &table);
}

/// What begins, ends or changes with a stage, in HTML.
fn changes(deck: &StageDeck) -> String {
    let code = |name: &str| format!("<code>{}</code>", escape(name));
    let codes = |names: &[String]| names.iter().map(|name| code(name)).collect::<Vec<_>>();
    let add = |added: &AddDeck| match added.onto() {
        Some(ground) => format!("{} onto {}", code(added.name()), code(ground)),
        None => code(added.name()),
    };
    let lists = [
        ("add", deck.add.iter().map(add).collect()),
        ("remove", codes(&deck.remove)),
        ("set", codes(&deck.set)),
        ("release", codes(&deck.release)),
    ];
    let list = |(word, names): &(&str, Vec<String>)| format!("{word} {}", names.join(", "));
    let mut words: Vec<String> = lists.iter().filter(|(_, names)| !names.is_empty()).map(list).collect();
    let material =
        |(body, material): (&String, &String)| format!("{} becomes {}", code(body), code(material));
    words.extend(deck.material.iter().map(material));
    let factor =
        |(name, factor): (&String, &f64)| format!("{} to factor\u{a0}{}", code(name), html(*factor, 6));
    words.extend(deck.factors.iter().map(factor));
    let steps = serde_json::to_value(&deck.steps).unwrap_or_default();
    let control = &steps["control"];
    if control["type"].as_str().is_some_and(|kind| kind != "load") {
        words.push(format!("control by {}", in_words(control)));
    }
    if deck.then.is_some() {
        words.push("displacements count from its end".to_owned());
    }
    words.join("; ")
}

/// The stages that a run has begun, as bands over time.
pub(super) fn bands_over_time(run: &Run) -> Vec<Band> {
    let reached = run.column("time").last().copied().unwrap_or(0.0);
    let band = |stage: Stage<'_>| Band {
        ends: [stage.times[0], stage.times[1].min(reached)],
        name: stage.deck.name.clone(),
    };
    stages(run).into_iter().filter(|stage| !stage.rows.is_empty()).map(band).collect()
}

/// The stages that a run has begun, as bands over the numbers of its load steps.
pub(super) fn bands_over_steps(run: &Run) -> Vec<Band> {
    let steps = run.column("step");
    let band = |Stage { deck, rows, .. }: Stage<'_>| {
        let ends = [*steps.get(rows.start)? - 0.5, *steps.get(rows.end.checked_sub(1)?)? + 0.5];
        (!rows.is_empty()).then(|| Band { ends, name: deck.name.clone() })
    };
    stages(run).into_iter().filter_map(band).collect()
}

/// The name of the stage to which a load step belongs, in plain text after a comma; empty without stages. Step 0
/// belongs to no stage.
pub(super) fn after_comma(run: &Run, step: usize) -> String {
    let row = run.column("step").iter().position(|number| *number == step as f64);
    let current = row.and_then(|row| stages(run).into_iter().find(|stage| stage.rows.contains(&row)));
    current.map_or_else(String::new, |stage| format!(", {}", stage.deck.name))
}

/// The load steps of a deck in words, in HTML.
pub(super) fn steps_of_deck(run: &Run, deck: &Value) -> String {
    let names: Vec<String> =
        stages(run).iter().map(|stage| format!("<code>{}</code>", escape(&stage.deck.name))).collect();
    match names.len() {
        0 => in_words(&deck["steps"]),
        1 => format!("one stage, {}", names[0]),
        number => format!("{} stages, {}", plain(number as f64, 9), names.join(", ")),
    }
}
