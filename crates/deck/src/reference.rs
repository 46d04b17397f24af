//! The reference of all deck keys, `docs/deck.md`, generated from the schema.

use std::fmt::Write;

use serde_json::{Map, Value};

use super::diagnostic::CODES;
use super::schema::{range_in_words, resolve, shortest, strict_schema};

const INTRODUCTION: &str = "\
# The deck

Generated from the deck types; do not edit. A deck is one YAML file. Unknown keys are errors. Units are those of any
consistent system (the examples use m, N, Pa, kg) and are given in brackets: [length], [stress], [-] for none.

Any number or word may be written as an expression of the parameters of the deck, in quotes: `\"${h/2}\"`. A formula is
text such as `gamma*y`. Expressions and formulas may contain `+ - * / ^`, the comparisons `< <= > >= == !=` (1 or 0),
`if(c, a, b)`, `min`, `max`, `abs`, `sqrt`, `exp`, `ln`, `log10`, `sin`, `cos`, `tan`, `asin`, `acos`, `atan`, `atan2`,
`sinh`, `cosh`, `tanh`, `asinh`, `acosh`, `atanh`, `floor`, `ceil`, `sign`, `pow`, `hypot` and `pi`. `-x^2` is
`-(x^2)`, and `2^3^2` is `2^(3^2)`.
";

/// Title of each section and its definition in the schema, in the order of the document; the deck itself comes first.
const SECTIONS: &[(&str, &str)] = &[
    ("`units`", "UnitsDeck"),
    ("`analysis`", "Analysis"),
    ("`stabilisation` of an analysis", "Stabilisation"),
    ("`grid`", "GridDeck"),
    ("`spacing` of a graded grid, each interval", "IntervalDeck"),
    ("`follow`, each group of lines", "FollowDeck"),
    ("`materials`, each under its name", "MaterialDeck"),
    ("`softening` of Tresca's material", "CohesionSofteningDeck"),
    ("`softening` of the Mohr-Coulomb material", "FrictionSofteningDeck"),
    ("`bodies`, each", "BodyDeck"),
    ("`shape` of a body", "Shape"),
    ("`initial_stress` of a body", "InitialStressDeck"),
    ("`stress` of an initial stress", "StressDeck"),
    ("`water`", "WaterDeck"),
    ("`surfaces`, each", "SurfaceDeck"),
    ("`part` of a surface", "PartDeck"),
    ("`half_space` of a part", "HalfSpaceDeck"),
    ("`boundary_conditions`, each", "BoundaryConditionDeck"),
    ("`nodes` of a boundary condition", "NodeSelector"),
    ("`group` whose name several dimensions share", "GroupOfDimension"),
    ("`fix` of a boundary condition", "NormalDeck"),
    ("`move` of a boundary condition", "MoveDeck"),
    ("`box` of a selection of nodes", "BoxDeck"),
    ("`loads`, each", "LoadDeck"),
    ("`points` of a load", "PointSelector"),
    ("`hydrostatic` of a pressure", "HydrostaticDeck"),
    ("`tools`, each", "ToolDeck"),
    ("`shape` of a tool", "ToolShape"),
    ("`loads` of a tool, each", "ToolLoadDeck"),
    ("`parts` of a tool, each", "ToolPartDeck"),
    ("`contacts` of a tool, each", "ContactDeck"),
    ("`contacts` between bodies, each", "BodyContactDeck"),
    ("`steps`", "StepsDeck"),
    ("`control` of the steps", "ControlDeck"),
    ("`dynamic`", "DynamicDeck"),
    ("`damping` of the motion", "DampingDeck"),
    ("`absorb` of a stage, each", "AbsorbDeck"),
    ("`motion` of a base", "MotionDeck"),
    ("`stages`, each", "StageDeck"),
    ("`add` of a stage, each body that is placed onto another one", "PlacedDeck"),
    ("`water` of a stage", "StageWaterDeck"),
    ("`then` of a stage", "ThenDeck"),
    ("`solver`", "SolverDeck"),
    ("`checkpoint`", "CheckpointDeck"),
    ("`output`", "OutputDeck"),
    ("`output.probes`, each", "ProbeDeck"),
];

/// The reference of all deck keys, and of all message codes, in Markdown.
pub fn reference_markdown() -> String {
    let schema = strict_schema();
    let mut text = INTRODUCTION.to_owned();
    text.push_str("\n## Top level\n\n");
    table(&mut text, schema, None);
    for (title, definition) in SECTIONS {
        let Some(section) = schema.pointer(&format!("/definitions/{definition}")) else { continue };
        let _ = write!(text, "\n## {title}\n\n{}\n\n", description(section));
        match branches(section) {
            Some(branches) => variants(&mut text, section, branches),
            None => table(&mut text, section, None),
        }
    }
    text.push_str("\n## Codes of messages\n\n| Code | Meaning |\n|---|---|\n");
    for (code, title) in CODES {
        let _ = writeln!(text, "| {code} | {title} |");
    }
    text
}

fn branches(section: &Value) -> Option<&Vec<Value>> {
    section
        .get("allOf")?
        .as_array()
        .filter(|branches| branches.iter().all(|branch| branch.get("then").is_some()))
}

/// One table for each variant of a tagged choice.
fn variants(text: &mut String, section: &Value, branches: &[Value]) {
    let tag = section.pointer("/required/0").and_then(Value::as_str).unwrap_or_default();
    let meanings = section.pointer(&format!("/properties/{tag}/enumDescriptions"));
    for (index, branch) in branches.iter().enumerate() {
        let word = branch
            .pointer(&format!("/if/properties/{tag}/const"))
            .and_then(Value::as_str)
            .unwrap_or_default();
        let meaning =
            meanings.and_then(|meanings| meanings.get(index)).and_then(Value::as_str).unwrap_or_default();
        if index > 0 {
            text.push('\n');
        }
        let _ = write!(text, "### `{tag}: {word}`\n\n{}\n\n", flow(meaning));
        if let Some(then) = branch.get("then") {
            table(text, then, Some(tag));
        }
    }
}

fn table(text: &mut String, section: &Value, tag: Option<&str>) {
    let Some(properties) = section.get("properties").and_then(Value::as_object) else { return };
    let required: Vec<&str> = section
        .get("required")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    text.push_str("| Key | Value | Default | Meaning |\n|---|---|---|---|\n");
    let mut words = String::new();
    for (key, property) in properties {
        if Some(key.as_str()) == tag {
            continue;
        }
        let target = resolve(property);
        let default = match property.get("default") {
            Some(default) => cell(&in_yaml(default)),
            None if required.contains(&key.as_str()) => "required".into(),
            None => "–".into(),
        };
        let range = range_in_words(property)
            .or_else(|| range_in_words(target))
            .map(|range| format!(", {range}"))
            .unwrap_or_default();
        let _ = writeln!(
            text,
            "| `{key}` | {}{range} | {default} | {} |",
            kind(property),
            cell(&(description(property) + &example(property)))
        );
        let items = target.get("items").map(resolve);
        list_words(&mut words, key, items.unwrap_or(target));
    }
    text.push_str(&words);
}

/// The words allowed for a key, each with its meaning.
fn list_words(text: &mut String, key: &str, target: &Value) {
    let Some(Value::Array(words)) = target.get("enum") else { return };
    if words.len() < 2 {
        return;
    }
    let _ = write!(text, "\nWords for `{key}`:\n\n");
    for (index, word) in words.iter().enumerate() {
        let meaning =
            target.pointer(&format!("/enumDescriptions/{index}")).and_then(Value::as_str).unwrap_or_default();
        let _ = writeln!(text, "- `{}`: {}", word.as_str().unwrap_or_default(), flow(meaning));
    }
}

/// The first example of a key, as a sentence; keys with a default have none.
fn example(property: &Value) -> String {
    let examples = property.get("examples").or_else(|| resolve(property).get("examples"));
    let first = examples.and_then(|examples| examples.get(0)).filter(|_| property.get("default").is_none());
    first.map_or_else(String::new, |example| format!(" Example: {}.", in_yaml(example)))
}

fn description(schema: &Value) -> String {
    flow(schema.get("description").and_then(Value::as_str).unwrap_or_default())
}

/// Text with its line breaks removed.
fn flow(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// The kind of a value in words.
fn kind(property: &Value) -> String {
    let target = resolve(property);
    if target.get("properties").is_some() {
        return "mapping".into();
    }
    if let Some(Value::Array(words)) = target.get("enum") {
        let words: Vec<String> =
            words.iter().filter_map(Value::as_str).map(|word| format!("`{word}`")).collect();
        return words.join(", ");
    }
    if let Some(Value::Array(choices)) = target.get("anyOf") {
        let text = match property
            .pointer("/allOf/0/$ref")
            .or_else(|| property.get("$ref"))
            .and_then(Value::as_str)
        {
            Some("#/definitions/Expression") => "formula",
            Some("#/definitions/Parameter") => "word",
            _ => "text",
        };
        let kinds: Vec<String> = choices.iter().map(kind).collect();
        return kinds.join(" or ").replace("text", text);
    }
    match target.get("type").and_then(Value::as_str) {
        Some("number") => "number".into(),
        Some("integer") => "whole number".into(),
        Some("string") => "text".into(),
        Some("object") => "mapping of names".into(),
        Some("array") => match target.get("items") {
            Some(Value::Object(items)) => format!("list of {}", plural(items)),
            _ => "list".into(),
        },
        Some("boolean") => "`true` or `false`".into(),
        _ => "any".into(),
    }
}

fn plural(items: &Map<String, Value>) -> String {
    match kind(&Value::Object(items.clone())).as_str() {
        "number" => "numbers".into(),
        "whole number" => "whole numbers".into(),
        "text" => "texts".into(),
        "mapping" => "mappings".into(),
        "list of numbers" => "pairs of numbers".into(),
        "number or list of mappings" => "numbers or lists of intervals".into(),
        "number or formula" => "numbers or formulas".into(),
        "text or mapping" => "texts or mappings".into(),
        other => other.to_owned(),
    }
}

/// A default or an example as it is written in a deck.
fn in_yaml(value: &Value) -> String {
    match value {
        Value::Object(entries) if !entries.is_empty() => {
            let entries: Vec<String> =
                entries.iter().map(|(key, value)| format!("{key}: {}", bare(value))).collect();
            format!("`{{{}}}`", entries.join(", "))
        }
        other => format!("`{}`", bare(other)),
    }
}

fn bare(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Number(_) => shortest(value),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(bare).collect();
            format!("[{}]", items.join(", "))
        }
        other => other.to_string(),
    }
}
