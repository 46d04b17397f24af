//! Parameters of a deck: their values, their overrides, and their insertion for `${...}`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

use serde_json::{Map, Value};

use crate::Parameter;
use crate::diagnostic::{Diagnostic, Excerpt};
use crate::quoting::quote;
use crate::references::{Noun, known_names};
use crate::source::{Source, Substitution};
use crate::span::escape;
use crate::yaml;
use mpm_core::formula::{self, Formula, FormulaError};

/// Largest number of parameters of a deck; this also limits the depth of dependencies between them.
const MAX_PARAMETERS: usize = 500;
/// Largest number of bytes that expressions may add to one string. Without a limit, a chain of parameters, each of
/// which contains the previous one several times, would grow exponentially.
const MAX_IN_TEXT: usize = 10_000;
/// Largest number of bytes that expressions may add to all strings of a deck.
const MAX_IN_ALL: usize = 16 << 20;

// Help on names, and the names that already have a meaning in formulas.
use crate::formulas::{NAMES, VARIABLES};

/// A parameter with everything needed to find its value.
#[derive(Debug)]
struct Definition {
    written: Option<Parameter>,
    /// The override that replaces the value in the deck, as `name=value`.
    overridden: Option<String>,
    state: State,
}

#[derive(Debug, Clone)]
enum State {
    Open,
    Running,
    Failed,
    Known(Known),
}

/// The value of a parameter and the overrides it depends on.
#[derive(Debug, Clone)]
struct Known {
    value: Parameter,
    overrides: BTreeSet<String>,
}

/// Why the expressions in a string cannot be evaluated: `Reported` if the cause is a fault that has already been
/// reported, otherwise `Here`, with a message.
enum Fault {
    Reported,
    Here { message: String, offset: usize, length: usize, help: Option<String> },
}

/// Finds the values of the parameters, then inserts them everywhere else in the deck.
///
/// Messages about everything that fails are added to `diagnostics`; the values concerned are marked in the source, so
/// that no further faults are reported for them.
pub(crate) fn apply(
    deck: &mut Value,
    source: &mut Source,
    overrides: &[(String, String)],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut table = Table { definitions: BTreeMap::new(), is_complete: true, source, diagnostics, added: 0 };
    table.define(deck.get("parameters"));
    table.override_with(overrides);
    let names: Vec<String> = table.definitions.keys().cloned().collect();
    for name in &names {
        table.resolve(name);
    }
    if let Some(Value::Object(parameters)) = deck.get_mut("parameters") {
        table.write_back(parameters);
    }
    table.insert(deck, &mut String::new());
}

struct Table<'a> {
    definitions: BTreeMap<String, Definition>,
    /// True if `definitions` has all parameters of the deck; otherwise unknown names are not reported.
    is_complete: bool,
    source: &'a mut Source,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// Bytes that expressions have added to the strings of the deck.
    added: usize,
}

fn pointer_to(name: &str) -> String {
    format!("/parameters/{}", escape(name))
}

impl Table<'_> {
    fn define(&mut self, parameters: Option<&Value>) {
        let parameters = match parameters {
            None => return,
            Some(Value::Object(parameters)) => parameters,
            Some(_) => {
                self.is_complete = false;
                return;
            }
        };
        if parameters.len() > MAX_PARAMETERS {
            let message = format!("the deck has more than {MAX_PARAMETERS} parameters");
            let help = "compute values where they are used, `${h/2}`, instead of in separate parameters";
            let fault = Diagnostic::at_key(self.source, "D011", "/parameters", message).help(help);
            self.diagnostics.push(fault);
            self.source.poison("/parameters");
            self.is_complete = false;
            return;
        }
        for (name, value) in parameters {
            let written = match value {
                Value::Number(number) => number.as_f64().map(Parameter::Number),
                Value::String(word) => Some(Parameter::Word(word.clone())),
                _ => None,
            };
            self.check_name(name);
            let state = if written.is_some() { State::Open } else { State::Failed };
            self.definitions.insert(name.clone(), Definition { written, overridden: None, state });
        }
    }

    fn check_name(&mut self, name: &str) {
        let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let fault = if !starts_well || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            Some((format!("{} cannot be the name of a parameter", quote(name)), NAMES))
        } else if VARIABLES.contains(&name) {
            Some((
                format!("the name {} stands for a variable in formulas", quote(name)),
                "choose another name",
            ))
        } else if formula::is_reserved(name) {
            Some((
                format!("the name {} already has a meaning in formulas", quote(name)),
                "choose another name",
            ))
        } else {
            None
        };
        if let Some((message, help)) = fault {
            let pointer = pointer_to(name);
            self.diagnostics.push(Diagnostic::at_key(self.source, "D011", &pointer, message).help(help));
        }
    }

    fn override_with(&mut self, overrides: &[(String, String)]) {
        for (name, text) in overrides {
            let value = Parameter::from_text(text);
            if let Some(definition) = self.definitions.get_mut(name) {
                definition.written = Some(value);
                definition.overridden = Some(format!("{name}={text}"));
                definition.state = State::Open;
            } else if self.is_complete {
                let message = format!(
                    "{} overrides a parameter that the deck does not have",
                    quote(&format!("--set {name}={text}"))
                );
                let mut diagnostic = Diagnostic::error("D013", message).help(self.known(name));
                diagnostic.span = self.source.key_span_of("/parameters");
                self.diagnostics.push(diagnostic);
            }
        }
    }

    /// The value of a parameter, computed on first use; `None` if it has none.
    fn resolve(&mut self, name: &str) -> Option<Known> {
        let definition = self.definitions.get_mut(name)?;
        match &definition.state {
            State::Known(known) => return Some(known.clone()),
            State::Failed => return None,
            State::Running => {
                definition.state = State::Failed;
                let message = format!("the parameter {} depends on itself", quote(name));
                let pointer = pointer_to(name);
                let help = format!("give {} a value that does not depend on itself", quote(name));
                let fault = Diagnostic::at(self.source, "D011", &pointer, message).help(help);
                self.diagnostics.push(fault);
                return None;
            }
            State::Open => {}
        }
        definition.state = State::Running;
        let written = definition.written.clone();
        let overridden = definition.overridden.clone();
        let value = match written {
            Some(Parameter::Word(text)) if text.contains("${") => {
                self.computed(name, &text, overridden.as_deref())
            }
            Some(value) => Some((value, BTreeSet::new())),
            None => None,
        };
        let definition = self.definitions.get_mut(name)?;
        // A parameter that depends on itself has failed in the meantime.
        let value = if matches!(definition.state, State::Failed) { None } else { value };
        let known = value.map(|(value, mut overrides)| {
            overrides.extend(overridden);
            Known { value, overrides }
        });
        definition.state = known.clone().map_or(State::Failed, State::Known);
        known
    }

    fn computed(
        &mut self,
        name: &str,
        text: &str,
        overridden: Option<&str>,
    ) -> Option<(Parameter, BTreeSet<String>)> {
        let pointer = pointer_to(name);
        match self.expand(text, false) {
            Ok(result) => Some(result),
            Err(fault) => {
                if let Some(set) = overridden
                    && let Fault::Here { message, help, .. } = fault
                {
                    let message = format!("{}: {message}", quote(&format!("--set {set}")));
                    let mut diagnostic = Diagnostic::at_key(self.source, "D012", &pointer, message);
                    diagnostic.help = help;
                    self.diagnostics.push(diagnostic);
                } else {
                    self.report(&pointer, text, fault);
                }
                None
            }
        }
    }

    fn report(&mut self, pointer: &str, text: &str, fault: Fault) {
        if let Fault::Here { message, offset, length, help } = fault {
            let part = Excerpt { text, offset, length };
            let mut diagnostic = Diagnostic::inside(self.source, "D012", pointer, part, message);
            diagnostic.help = help;
            self.diagnostics.push(diagnostic);
        }
    }

    /// Writes the values of the parameters into the deck, for the later gates.
    fn write_back(&mut self, parameters: &mut Map<String, Value>) {
        for (name, value) in parameters.iter_mut() {
            let pointer = pointer_to(name);
            let Some(definition) = self.definitions.get(name) else { continue };
            match &definition.state {
                State::Known(known) => {
                    let became = as_value(&known.value);
                    if *value != became {
                        let written = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                        let overrides = known.overrides.iter().cloned().collect();
                        let substitution =
                            Substitution { written, became: known.value.to_string(), overrides };
                        self.source.set_substitution(&pointer, substitution);
                        *value = became;
                    }
                }
                // A value of the wrong type is left for the schema to report.
                _ if definition.written.is_some() => self.source.poison(&pointer),
                _ => {}
            }
        }
    }

    /// Inserts the values of the parameters into all strings in a value, except those under `parameters`.
    fn insert(&mut self, value: &mut Value, pointer: &mut String) {
        let parent = pointer.len();
        match value {
            Value::Array(items) => {
                for (index, item) in items.iter_mut().enumerate() {
                    pointer.push_str(&format!("/{index}"));
                    self.insert(item, pointer);
                    pointer.truncate(parent);
                }
            }
            Value::Object(entries) => {
                for (key, entry) in entries.iter_mut() {
                    if parent == 0 && key == "parameters" {
                        continue;
                    }
                    pointer.push('/');
                    pointer.push_str(&escape(key));
                    self.insert(entry, pointer);
                    pointer.truncate(parent);
                }
            }
            Value::String(text) if text.contains("${") => match self.expand(text, is_formula(pointer)) {
                Ok((became, overrides)) => {
                    let overrides = overrides.into_iter().collect();
                    let substitution =
                        Substitution { written: text.clone(), became: became.to_string(), overrides };
                    self.source.set_substitution(pointer, substitution);
                    *value = as_value(&became);
                }
                Err(fault) => {
                    let text = text.clone();
                    self.report(pointer, &text, fault);
                    self.source.poison(pointer);
                }
            },
            _ => {}
        }
    }

    /// Evaluates the expressions in a string. The result is a number or a word if the string is a single expression,
    /// otherwise text.
    fn expand(&mut self, text: &str, in_formula: bool) -> Result<(Parameter, BTreeSet<String>), Fault> {
        let mut overrides = BTreeSet::new();
        let mut expanded = String::new();
        let mut at = 0;
        while let Some(start) = text[at..].find("${").map(|found| at + found) {
            let Some(length) = text[start..].find('}') else {
                return Err(Fault::Here {
                    message: "this expression is never closed".into(),
                    offset: start,
                    length: text.len() - start,
                    help: Some("end it with `}`".into()),
                });
            };
            let inner = start + 2..start + length;
            let value = self.expression(text, inner.start, inner.end, &mut overrides)?;
            self.grows(&value, expanded.len(), start, length + 1)?;
            if start == 0 && length + 1 == text.len() {
                return Ok((value, overrides));
            }
            expanded.push_str(&text[at..start]);
            match value {
                // In a formula, a negative number inserted before `^2` must be squared as a whole.
                Parameter::Number(number) if in_formula && number < 0.0 => {
                    expanded.push_str(&format!("({number:?})"))
                }
                value => expanded.push_str(&value.to_string()),
            }
            at = start + length + 1;
        }
        expanded.push_str(&text[at..]);
        Ok((Parameter::Word(expanded), overrides))
    }

    /// Counts the bytes of an inserted value against the limits; `before` is the length of the string so far, `offset`
    /// and `length` locate the expression.
    fn grows(&mut self, value: &Parameter, before: usize, offset: usize, length: usize) -> Result<(), Fault> {
        let Parameter::Word(word) = value else { return Ok(()) };
        let is_told = self.added > MAX_IN_ALL;
        self.added = self.added.saturating_add(word.len());
        let (bound, what) = if before + word.len() > MAX_IN_TEXT + offset {
            (MAX_IN_TEXT, "this text")
        } else if self.added > MAX_IN_ALL {
            (MAX_IN_ALL, "the deck")
        } else {
            return Ok(());
        };
        if is_told {
            return Err(Fault::Reported);
        }
        Err(Fault::Here {
            message: format!("parameters add more than {bound} characters to {what}"),
            offset,
            length,
            help: Some("use shorter words, or fewer parameters that contain other parameters".into()),
        })
    }

    fn expression(
        &mut self,
        text: &str,
        start: usize,
        end: usize,
        overrides: &mut BTreeSet<String>,
    ) -> Result<Parameter, Fault> {
        let inner = &text[start..end];
        let mut constants = Vec::new();
        for (offset, name) in formula::names(inner) {
            if !self.definitions.contains_key(name) {
                if !self.is_complete && !formula::is_reserved(name) {
                    return Err(Fault::Reported);
                }
                continue;
            }
            self.source.use_parameter(name);
            let Some(known) = self.resolve(name) else { return Err(Fault::Reported) };
            overrides.extend(known.overrides);
            match known.value {
                word @ Parameter::Word(_) if inner.trim() == name => return Ok(word),
                Parameter::Word(word) => {
                    return Err(Fault::Here {
                        message: format!(
                            "the parameter {} is the word {}, not a number",
                            quote(name),
                            quote(&word)
                        ),
                        offset: start + offset,
                        length: name.len(),
                        help: Some(format!("give it a number, or insert the word alone: `${{{name}}}`")),
                    });
                }
                Parameter::Number(number) => constants.push((name, number)),
            }
        }
        let failed = |error: FormulaError| self.name_fault(error, inner, start);
        let value = Formula::parse_with_constants(inner, &[], &constants).map_err(failed)?.evaluate(&[]);
        if value.is_finite() {
            return Ok(Parameter::Number(value));
        }
        let message = format!("{} is not a finite number", quote(inner));
        let known: Vec<String> =
            constants.iter().map(|(name, number)| format!("{name} = {number}")).collect();
        let help = if known.is_empty() {
            "write an expression with a finite value".to_owned()
        } else {
            format!("change the expression or its parameters, which are {} here", known.join(", "))
        };
        Err(Fault::Here { message, offset: start, length: inner.len(), help: Some(help) })
    }

    /// Turns a fault in a formula into a fault in the string around it; unknown names are compared with all parameters.
    fn name_fault(&self, error: FormulaError, inner: &str, start: usize) -> Fault {
        let mut help = error.help;
        let mut message = error.message;
        if inner.trim().is_empty() {
            message = "this expression is empty".into();
            help = Some("write the name of a parameter, `${name}`".into());
        } else if message.starts_with("unknown name") {
            let name = &inner[error.offset..error.offset + error.length];
            message = format!("unknown parameter {}", quote(name));
            help = Some(self.known(name));
        }
        Fault::Here { message, offset: start + error.offset, length: error.length.max(1), help }
    }

    /// Help for the name of a parameter that does not exist.
    fn known(&self, name: &str) -> String {
        let names: Vec<&str> = self.definitions.keys().map(String::as_str).collect();
        known_names(Noun::new("parameter", "parameters"), name, &names)
    }
}

/// True if the value at a pointer may be a formula.
fn is_formula(pointer: &str) -> bool {
    let parts: Vec<&str> = pointer.split('/').collect();
    match parts.as_slice() {
        ["", "materials", _, .., key] => !matches!(*key, "model" | "file"),
        [.., "ux" | "uy" | "uz" | "by" | "rotation" | "pressure"] => true,
        [.., "force" | "traction" | "where" | "stress" | "rotation", _] => true,
        _ => false,
    }
}

fn as_value(parameter: &Parameter) -> Value {
    match parameter {
        Parameter::Number(number) => yaml::number_value(*number),
        Parameter::Word(word) => Value::String(word.clone()),
    }
}

impl Parameter {
    /// The parameter that a command-line argument states.
    pub fn from_text(text: &str) -> Parameter {
        match yaml::number(text) {
            Some(number) if number.is_finite() => Parameter::Number(number),
            _ => Parameter::Word(text.to_owned()),
        }
    }
}

impl Display for Parameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // Numbers of moderate size are written without an exponent, and whole numbers also without a fraction.
            Parameter::Number(number) if number.abs() >= 1e-5 && number.abs() < 1e9 || *number == 0.0 => {
                write!(f, "{number}")
            }
            Parameter::Number(number) => write!(f, "{number:e}"),
            Parameter::Word(word) => f.write_str(word),
        }
    }
}
