//! The pairs of bodies in contact: their forces, areas and states at the end and at their extremes, and over the run.

use serde_json::Value;

use super::curves::AXES;
use super::page::{Cell, Page, Table, escape};
use super::run::Run;
use super::sections::{in_words, with_unit};
use super::tools::{Quantified, figures, table};
use super::units::{Naming, Quantity};

/// Adds a table of the contacts as the deck gives them, if it has any.
pub(super) fn given(page: &mut Page, deck: &Value) {
    let mut table = Table::new(["Contact between", "Values"]);
    for contact in deck["contacts"].as_array().into_iter().flatten() {
        let mut rest = contact.clone();
        if let Some(map) = rest.as_object_mut() {
            map.remove("between");
        }
        table.row([Cell::Html(in_words(&contact["between"])), Cell::Html(in_words(&rest))]);
    }
    page.table("Contact between bodies.", &table);
}

/// Adds the section, if bodies are in contact.
pub(super) fn section(page: &mut Page, run: &Run, naming: &Naming) {
    let pairs = run.names_before("_contacts");
    if pairs.is_empty() || run.steps() == 0 {
        return;
    }
    page.section("Contact between bodies");
    page.paragraph("Forces are those of the first body of each pair on the second.");
    for pair in pairs {
        let columns = columns(run, pair);
        let (first, second) = pair.split_once("_on_").unwrap_or((pair, ""));
        let name = format!("<code>{}</code> on <code>{}</code>", escape(first), escape(second));
        page.table(&format!("{name}."), &table(run, &columns, naming));
        figures(page, run, &columns, &name, naming);
    }
    let has_tools = run.deck.as_ref().is_some_and(|deck| !deck.tools.is_empty());
    if let Some(work) = run.number("/friction_work").filter(|_| !has_tools) {
        let work = with_unit(work, Quantity::Energy, naming);
        page.paragraph(&format!("Friction between the bodies has dissipated {work}."));
    }
}

/// The columns of a pair that the run has.
fn columns(run: &Run, pair: &str) -> Vec<Quantified> {
    let forces = AXES.map(|axis| (format!("f{axis}"), format!("force {axis}"), Quantity::Force));
    let states = [
        ("contacts", "places in contact", Quantity::Number),
        ("area", "area in contact", Quantity::Area),
        ("overlap", "largest overlap", Quantity::Length),
        ("slip", "largest slip where surfaces stick", Quantity::Length),
    ];
    let states = states.map(|(ending, name, quantity)| (ending.to_owned(), name.to_owned(), quantity));
    let all = forces.into_iter().chain(states);
    let named =
        all.map(|(ending, name, quantity)| Quantified { column: format!("{pair}_{ending}"), name, quantity });
    named.filter(|found| !run.column(&found.column).is_empty()).collect()
}
