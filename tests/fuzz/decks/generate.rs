//! Random values, most of which the schema allows.

use serde_json::{Map, Value, json};

use crate::random::Random;

/// Names, so few that references often match.
const NAMES: [&str; 8] = ["a", "b", "beam", "block", "root", "tip", "soil body", "left edge"];
const FORMULAS: [&str; 13] = [
    "x",
    "z*factor + Z",
    "2*y*factor",
    "if(x < 1, y, -y)",
    "sin(X)/cos(Y)",
    "1/x",
    "sqrt(-1)",
    "a*b",
    "p + q",
    "((((x))))",
    "2^3^2",
    "factor",
    "min(x, y) -",
];
const FILES: [&str; 6] = [
    "../../data/mesh/mixed_4.1_text.msh",
    "../../data/mesh/disk_2.2_text.msh",
    "../../data/mesh/solid_4.1_text.msh",
    "../../data/pyramid.stl",
    "nowhere.msh",
    "",
];
const NUMBERS: [f64; 24] = [
    0.0, 1.0, 2.0, 3.0, 0.5, 0.25, 0.1, 0.3, 4.0, 10.0, -1.0, -0.5, 1e3, 1e6, 1e-3, 1e-9, 0.49, 0.4999, 7.0,
    100.0, 1e300, -1e300, 5e-324, 1e17,
];

/// Makes values from a schema.
pub struct Generator {
    schema: Value,
}

impl Generator {
    pub fn new(schema: Value) -> Generator {
        Generator { schema }
    }

    pub fn deck(&self, random: &mut Random) -> Value {
        self.value("", "", 0, random)
    }

    /// A pointer in the schema, with references followed.
    fn resolve(&self, home: &str) -> String {
        let node = self.schema.pointer(home).unwrap_or(&Value::Null);
        let reference = node.get("$ref").or_else(|| node.pointer("/allOf/0/$ref")).and_then(Value::as_str);
        reference.map_or_else(|| home.to_owned(), |path| self.resolve(path.trim_start_matches('#')))
    }

    /// A value for a pointer in the schema; `key` is the last key above it.
    pub fn value(&self, home: &str, key: &str, depth: usize, random: &mut Random) -> Value {
        let home = self.resolve(home);
        let node = self.schema.pointer(&home).unwrap_or(&Value::Null);
        if random.chance(0.002) {
            return odd(random);
        }
        if let Some(choices) = node.get("anyOf").and_then(Value::as_array) {
            return self.value(&format!("{home}/anyOf/{}", random.below(choices.len())), key, depth, random);
        }
        if let Some(words) = node.get("enum").and_then(Value::as_array) {
            return random.pick(words).clone();
        }
        match node.get("type").and_then(Value::as_str) {
            Some("number") => json!(self.number(node, random)),
            Some("integer") => json!(self.number(node, random).clamp(-1e9, 1e9).round() as i64),
            Some("string") => json!(text(key, random)),
            Some("array") => self.list(&home, node, key, depth, random),
            Some("object") => self.mapping(&home, node, depth, random),
            _ => json!(random.pick(&NUMBERS)),
        }
    }

    fn number(&self, node: &Value, random: &mut Random) -> f64 {
        let limit = |key: &str| node.get(key).and_then(Value::as_f64);
        let low = limit("minimum").or(limit("exclusiveMinimum"));
        let high = limit("maximum").or(limit("exclusiveMaximum"));
        let mut found = *random.pick(&NUMBERS);
        // Mostly inside the range, sometimes at its ends.
        for _ in 0..10 {
            let inside = low.is_none_or(|low| found >= low) && high.is_none_or(|high| found <= high);
            if inside || random.chance(0.02) {
                break;
            }
            found = *random.pick(&NUMBERS);
        }
        match random.below(40) {
            0 => low.unwrap_or(found),
            1 => high.unwrap_or(found),
            _ => found,
        }
    }

    fn list(&self, home: &str, node: &Value, key: &str, depth: usize, random: &mut Random) -> Value {
        let limit = |key: &str| node.get(key).and_then(Value::as_u64).map(|n| n as usize);
        let least = limit("minItems").unwrap_or(0).min(8);
        let most = limit("maxItems").unwrap_or(least + 3).min(least + 4);
        let mut length = least + random.below(most - least + 1);
        if random.chance(0.02) {
            length = random.below(5);
        }
        if depth > 12 {
            length = length.min(1);
        }
        let home = format!("{home}/items");
        (0..length).map(|_| self.value(&home, key, depth + 1, random)).collect()
    }

    fn mapping(&self, home: &str, node: &Value, depth: usize, random: &mut Random) -> Value {
        let mut entries = Map::new();
        self.properties(home, node, depth, &mut entries, random);
        if let Some(branches) = node.get("allOf").and_then(Value::as_array) {
            for (index, branch) in branches.iter().enumerate() {
                let condition = branch.pointer("/if/properties").and_then(Value::as_object);
                let holds = condition
                    .is_some_and(|tags| tags.iter().all(|(tag, word)| entries.get(tag) == word.get("const")));
                // Nesting of regions must end.
                let nested = ["of", "from/$ref", "from/allOf", "shape"]
                    .iter()
                    .any(|key| branch.pointer(&format!("/then/properties/{key}")).is_some());
                if holds && (depth < 14 || !nested) {
                    let then = format!("{home}/allOf/{index}/then");
                    let node = self.schema.pointer(&then).unwrap();
                    self.properties(&then, node, depth, &mut entries, random);
                }
            }
        }
        if node.get("additionalProperties").is_some_and(Value::is_object) {
            for _ in 0..1 + random.below(3) {
                let home = format!("{home}/additionalProperties");
                let name = *random.pick(&["a", "b", "p", "q", "h", "n"]);
                entries.insert(name.to_owned(), self.value(&home, name, depth + 1, random));
            }
        }
        Value::Object(entries)
    }

    fn properties(
        &self,
        home: &str,
        node: &Value,
        depth: usize,
        entries: &mut Map<String, Value>,
        random: &mut Random,
    ) {
        let required = node.get("required").and_then(Value::as_array);
        for (key, property) in node.get("properties").and_then(Value::as_object).into_iter().flatten() {
            let is_required = required.is_some_and(|keys| keys.iter().any(|k| k == key));
            let wanted = random.chance(if is_required { 0.99 } else { 0.35 });
            if wanted && property.as_object().is_some_and(|property| !property.is_empty()) {
                let value = self.value(&format!("{home}/properties/{key}"), key, depth + 1, random);
                entries.insert(key.clone(), value);
            }
        }
    }

    /// The pointer in the schema for a pointer in a deck, if the deck has a matching shape.
    pub fn home_of(&self, deck: &Value, pointer: &str) -> Option<String> {
        let mut home = String::new();
        let mut value = deck;
        for part in pointer.split('/').skip(1) {
            home = self.resolve(&home);
            let mut node = self.schema.pointer(&home)?;
            if let Some(choices) = node.get("anyOf").and_then(Value::as_array) {
                let wanted = if value.is_array() { "array" } else { "object" };
                let chosen = choices.iter().position(|c| c.get("type").is_some_and(|kind| kind == wanted))?;
                home = format!("{home}/anyOf/{chosen}");
                node = self.schema.pointer(&home)?;
            }
            let key = part.replace("~1", "/").replace("~0", "~");
            if let Some(items) = value.as_array() {
                value = items.get(key.parse::<usize>().ok()?)?;
                home = format!("{home}/items");
                continue;
            }
            let entries = value.as_object()?;
            let branches = node.get("allOf").and_then(Value::as_array);
            let then = branches.into_iter().flatten().enumerate().find_map(|(index, branch)| {
                let tags = branch.pointer("/if/properties")?.as_object()?;
                let holds = tags.iter().all(|(tag, word)| entries.get(tag) == word.get("const"));
                holds.then(|| format!("{home}/allOf/{index}/then"))
            });
            let declared = |home: &str| {
                let at = format!("{home}/properties/{part}");
                self.schema.pointer(&at).filter(|s| s.as_object().is_some_and(|s| !s.is_empty())).map(|_| at)
            };
            let found = declared(&home).or_else(|| then.as_deref().and_then(declared));
            home = found.or_else(|| {
                let at = format!("{home}/additionalProperties");
                self.schema.pointer(&at).filter(|s| s.is_object()).map(|_| at)
            })?;
            value = entries.get(&key)?;
        }
        Some(home)
    }
}

fn text(key: &str, random: &mut Random) -> String {
    match key {
        "file" => (*random.pick(&FILES)).to_owned(),
        "ux" | "uy" | "uz" | "force" | "where" | "p" | "q" => (*random.pick(&FORMULAS)).to_owned(),
        _ if random.chance(0.05) => (*random.pick(&FORMULAS)).to_owned(),
        _ if random.chance(0.03) => "\u{1F980} \t'\"\\ \u{202e}\n:".to_owned(),
        _ => (*random.pick(&NAMES)).to_owned(),
    }
}

/// A value other than the expected one.
pub fn odd(random: &mut Random) -> Value {
    match random.below(10) {
        0 => Value::Null,
        1 => json!(true),
        2 => json!([]),
        3 => json!({}),
        4 => json!("${h}"),
        5 => json!("${"),
        6 => json!([[1.0, "x"], {"a": null}]),
        7 => json!(-1e308),
        8 => json!("word"),
        _ => json!(*random.pick(&NUMBERS)),
    }
}
