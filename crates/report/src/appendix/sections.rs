//! Parts common to pages about one run and about several.

use serde_json::Value;

use mpm_deck::quoting::joined;
use mpm_files::summary::VERSION;

use super::number::{duration, html};
use super::options::Options;
use super::page::{Page, escape};
use super::run::{Run, State};
use super::units::{Naming, Quantity};

/// The unit names for these runs.
pub(super) fn naming(runs: &[Run], options: &Options) -> Naming {
    let per_thickness = runs.iter().all(|run| run.is_plane() && !run.is_revolved());
    // Runs that are compared may have different units; then numbers keep the names of their quantities.
    let mut stated = runs.iter().map(|run| run.deck.as_ref().and_then(mpm_deck::Deck::units));
    let first = stated.next().flatten();
    let shared = first.filter(|first| stated.all(|units| units.as_ref() == Some(first)));
    Naming { units: options.units.clone().or(shared), per_thickness }
}

/// The state of a run in words.
pub(super) fn state_in_words(state: &State) -> &'static str {
    match state {
        State::Completed => "completed",
        State::Failed(..) => "failed",
        State::Interrupted => "interrupted",
        State::Running => "running",
        State::Died => "died",
        State::Unknown => "unknown",
    }
}

/// The number of converged load steps, and the number requested.
pub(super) fn steps_in_words(run: &Run) -> String {
    let wanted = run.number("/steps_requested").or_else(|| Some(run.deck.as_ref()?.step_count() as f64));
    match wanted {
        Some(wanted) if run.steps() as f64 > wanted => {
            format!("{} ({} requested)", run.steps(), html(wanted, 9))
        }
        Some(wanted) => format!("{} of {}", run.steps(), html(wanted, 9)),
        None => run.steps().to_string(),
    }
}

/// A box with the state of a run.
pub(super) fn banner(page: &mut Page, run: &Run, name: Option<&str>) {
    let prefix = name.map_or_else(String::new, |name| format!("<code>{}</code>: ", escape(name)));
    let class = state_in_words(&run.state);
    let so_far = format!("Load steps in equilibrium: {}.", steps_in_words(run));
    let only = "This page shows only steps in equilibrium.";
    let text = match &run.state {
        State::Completed => {
            let all = match run.steps() {
                1 => "The only load step is in equilibrium.".to_owned(),
                steps => format!("All {steps} load steps are in equilibrium."),
            };
            format!("<strong>{prefix}Completed.</strong> {all}")
        }
        State::Failed(code, reason) => {
            let code = code.as_ref().map_or_else(String::new, |code| format!(" with {}", escape(code)));
            let reason = escape(reason);
            format!("<strong>{prefix}The analysis failed{code}:</strong> {reason}. {so_far} {only}")
        }
        State::Interrupted => {
            format!("<strong>{prefix}The analysis was interrupted.</strong> {so_far} {only}")
        }
        State::Running => format!("<strong>{prefix}The analysis is still running.</strong> {so_far} {only}"),
        State::Died => format!(
            "<strong>{prefix}The analysis was killed:</strong> its process ended unexpectedly. {so_far} {only}"
        ),
        State::Unknown => format!(
            "<strong>{prefix}The outcome of the analysis is unknown:</strong> there is no summary. {so_far} {only}"
        ),
    };
    page.push(&format!("<p class=\"outcome {class}\" role=\"status\">{text}</p>\n"));
}

/// The warnings of a run as a list, with the event and the remedy of each on one line.
pub(super) fn warnings(page: &mut Page, run: &Run) {
    let warnings: Vec<&Value> = run.summary["warnings"].as_array().into_iter().flatten().collect();
    if !warnings.is_empty() {
        page.push("<ul class=\"warnings\">\n");
        for warning in warnings {
            page.push(&format!("<li>{}</li>\n", in_a_line(warning)));
        }
        page.push("</ul>\n");
    }
}

/// The warnings and notes about the deck of a run as a list.
pub(super) fn messages(page: &mut Page, run: &Run) {
    let messages: Vec<&Value> = run.start["messages"].as_array().into_iter().flatten().collect();
    if !messages.is_empty() {
        page.push("<ul class=\"notes\">\n");
        for message in messages {
            page.push(&format!("<li>{}</li>\n", deck_message_line(message)));
        }
        page.push("</ul>\n");
    }
}

/// A message about a deck, as HTML.
fn deck_message_line(message: &Value) -> String {
    let text = |key: &str| escape(message[key].as_str().unwrap_or_default());
    let kind = if message["severity"] == "warning" { "Warning" } else { "Note" };
    let help = text("help");
    let help = if help.is_empty() { help } else { format!(" <i>{help}</i>") };
    format!("<b>{kind} {}.</b> Deck: {}.{help}", text("code"), text("message"))
}

/// A warning, as HTML.
fn in_a_line(warning: &Value) -> String {
    let text = |key: &str| escape(warning[key].as_str().unwrap_or_default());
    let (code, message, help) = (text("code"), text("message"), text("help"));
    let step = warning["step"].as_u64().unwrap_or_default();
    format!("<b>Warning {code}.</b> Step {step}: {message}. <i>{help}</i>")
}

/// A description list of the title block; entries without a value are left out.
pub(super) fn title_block(entries: &[(&str, Option<String>)]) -> String {
    let mut block = "<dl class=\"block\">\n".to_owned();
    for (name, value) in entries {
        if let Some(value) = value {
            block.push_str(&format!("<div><dt>{name}</dt><dd>{value}</dd></div>\n"));
        }
    }
    block.push_str("</dl>\n");
    block
}

/// The start of a run, in HTML.
pub(super) fn started(run: &Run) -> Option<String> {
    run.text("/started").map(date)
}

/// The current date and time, in HTML.
pub(super) fn now() -> String {
    date(&jiff::Timestamp::now().to_string())
}

/// A sentence about the units of a page, after a space; empty if the user gave the units.
pub(super) fn units_in_words(naming: &Naming) -> &'static str {
    match &naming.units {
        Some(_) => "",
        None => " Units are those of the deck; words in brackets name the kind of quantity.",
    }
}

/// Date and time of a timestamp, to the minute.
fn date(timestamp: &str) -> String {
    match (timestamp.get(..10), timestamp.get(11..16)) {
        (Some(day), Some(time)) => {
            format!("<span class=\"date\">{} {} UTC</span>", escape(day), escape(time))
        }
        _ => escape(timestamp),
    }
}

/// The program that made the run, in HTML.
pub(super) fn program(run: &Run) -> Option<String> {
    let version = run.text("/version")?;
    let build = run.text("/build").filter(|build| *build != "release");
    let build = build.map_or_else(String::new, |build| format!(" ({} build)", escape(build)));
    Some(format!("mpm\u{a0}{}{build}", escape(version)))
}

/// The machine of the run, in HTML.
pub(super) fn machine(run: &Run) -> Option<String> {
    let text = |key: &str| run.text(&format!("/machine/{key}")).map(escape);
    let mut parts: Vec<String> = text("processor").into_iter().collect();
    parts.extend(
        run.number("/machine/cores")
            .map(|cores| format!("{cores}\u{a0}{}", if cores == 1.0 { "core" } else { "cores" })),
    );
    parts.extend(run.number("/machine/memory_bytes").map(super::number::memory));
    parts.extend(text("system"));
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// The wall time of the run, in HTML.
pub(super) fn wall_time(run: &Run) -> Option<String> {
    run.summary.pointer("/wall_seconds/total")?.as_f64().map(duration)
}

/// The foot of a page.
pub(super) fn foot(runs: &[Run], naming: &Naming) -> String {
    let sources: Vec<String> = runs
        .iter()
        .map(|run| format!("<code>{}</code>", escape(&run.directory.display().to_string())))
        .collect();
    let sources = sources.join(", ");
    let (now, units) = (now(), units_in_words(naming));
    let thickness = match (naming.per_thickness, runs.iter().any(Run::is_revolved)) {
        (true, _) => " Plane strain: forces, moments, energies, volumes and masses are per unit thickness.",
        (_, true) => {
            " Bodies of revolution: x is the distance from the axis; forces, energies, volumes and masses are those of \
             the full circle."
        }
        _ => "",
    };
    format!(
        "<p>Written by mpm\u{a0}{VERSION} on {now} from the results in {sources}.{units}{thickness}</p>\n"
    )
}

/// The largest residual of a converged step.
pub(super) fn largest_residual(run: &Run) -> Option<f64> {
    run.column("residual").iter().copied().reduce(f64::max)
}

/// A value with its unit, in HTML.
pub(super) fn with_unit(value: f64, quantity: Quantity, naming: &Naming) -> String {
    let unit = naming.unit(quantity);
    let unit = if unit.is_empty() { unit } else { format!("\u{a0}{}", escape(&unit)) };
    format!("{}{unit}", html(value, 5))
}

/// The kind of quantity of a number of a material or load in a deck, as [`Units::named`] knows it; `None` for numbers
/// without a unit.
fn kind_of(key: &str) -> Option<&'static str> {
    Some(match key {
        "young"
        | "shear_modulus"
        | "cohesion"
        | "residual_cohesion"
        | "tensile_strength"
        | "yield_stress"
        | "deviatoric_yield_stress"
        | "undrained_strength"
        | "hardening_modulus"
        | "reference_pressure"
        | "pressure"
        | "traction" => "stress",
        "density" => "density",
        "acceleration" => "acceleration",
        _ => return None,
    })
}

/// The entries of a material or load in words, with the units that the deck states.
pub(super) fn in_units(value: &Value, naming: &Naming) -> String {
    let (Some(units), Value::Object(map)) = (&naming.units, value) else { return in_words(value) };
    let entry = |(key, value): (&String, &Value)| {
        let one = Value::Object([(key.clone(), value.clone())].into_iter().collect());
        let unit = kind_of(key).filter(|_| !value.is_object()).and_then(|kind| units.named(kind));
        format!(
            "{}{}",
            in_words(&one),
            unit.map(|unit| format!("\u{a0}{}", escape(&unit))).unwrap_or_default()
        )
    };
    map.iter().filter(|(_, value)| !value.is_null()).map(entry).collect::<Vec<_>>().join(", ")
}

/// The entries of a deck in words: `key value, key value`, in HTML.
pub(super) fn in_words(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let entry = |(key, value): (&String, &Value)| match value {
                Value::String(text) if key == "type" => escape(text),
                Value::Object(_) => format!("{}\u{a0}({})", escape(&key.replace('_', " ")), in_words(value)),
                _ => format!("{}\u{a0}{}", escape(&key.replace('_', " ")), in_words(value)),
            };
            map.iter().filter(|(_, value)| !value.is_null()).map(entry).collect::<Vec<_>>().join(", ")
        }
        Value::Array(items) => {
            let words: Vec<String> = items.iter().map(in_words).collect();
            let is_list = items.iter().all(Value::is_string);
            if is_list { joined(&words, "and") } else { format!("({})", words.join(", ")) }
        }
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), |value| html(value, 9)),
        Value::String(text) => escape(text),
        other => other.to_string(),
    }
}
