//! The gate `meaning`: the deck must make sense, as far as this can be checked without the mesh.
//!
//! The gate covers references by name, combinations of keys, geometry, formulas and curves. Ranges of single numbers
//! are part of the schema. All faults are reported at once.

mod contacts;
mod dynamics;
mod extent;
mod follow;
mod geometry;
mod grid;
mod initial_stress;
mod loaded_rings;
mod loading;
mod locking;
mod materials;
mod prescribed_motion;
mod shape;
mod stages;
mod steps;
mod strength_reduction;
mod surfaces;
mod suspicions;
mod tool_parts;
mod tools;
mod units;
mod water;
mod without_effect;

pub(super) use suspicions::{formulas_of_bodies, formulas_of_loading, names_in};

use std::collections::HashMap;

use super::diagnostic::{Diagnostic, Gate, Severity, assign};
use super::quoting::{counted, quote};
use super::references::{Noun, unknown_reference};
use super::source::Source;
use super::{BodyDeck, CellStrain, Deck, Method, OutputDeck};

/// Checks the meaning of a deck. The source provides the locations for messages, and states which values come from
/// parameters; use [`Source::without_text`] for a deck that was not read from a file.
pub fn validate(deck: &Deck, source: &Source) -> Vec<Diagnostic> {
    let mut check = Check { deck, source, found: Vec::new() };
    check.unit_names();
    let grid = check.grid();
    check.bodies(grid.as_ref());
    check.materials();
    check.surfaces();
    check.boundary_conditions();
    check.follow();
    check.loads();
    check.tools();
    check.contacts();
    check.output();
    check.stages();
    check.control();
    check.dynamics();
    check.water();
    assign(Gate::Meaning, &mut check.found);
    check.found
}

/// Warnings about a deck without errors: entries that are legal but probably not intended.
pub(super) fn suspicions(deck: &Deck, source: &Source) -> Vec<Diagnostic> {
    let mut check = Check { deck, source, found: Vec::new() };
    check.suspicions();
    assign(Gate::Meaning, &mut check.found);
    check.found
}

/// A key of a body that needs the domains of one method.
struct DomainKey {
    key: &'static str,
    /// The method.
    method: &'static str,
    /// What its domains are, as a clause of a message.
    domains: &'static str,
    /// What points of other methods lack, as a clause of a message.
    lacks: &'static str,
}

/// A check in progress.
struct Check<'a> {
    deck: &'a Deck,
    source: &'a Source,
    found: Vec<Diagnostic>,
}

/// Longest name that may head columns, [characters].
const LONGEST_NAME: usize = 60;

impl Check<'_> {
    fn error(
        &mut self,
        code: &'static str,
        pointer: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        let diagnostic = Diagnostic::at(self.source, code, pointer, message).help(help);
        self.found.push(diagnostic);
    }

    /// Checks that names differ within their list.
    fn unique_names<'n>(&mut self, section: &str, names: impl IntoIterator<Item = &'n str>) {
        let mut first = HashMap::new();
        for (index, name) in names.into_iter().enumerate() {
            let pointer = format!("{section}/{index}/name");
            if name.trim().is_empty() {
                self.error(
                    "D026",
                    &pointer,
                    "a name must not be empty",
                    "write a name of letters, digits, `_` and `-`",
                );
                continue;
            }
            match first.get(name) {
                None => {
                    first.insert(name, index);
                }
                Some(earlier) => {
                    let place = self.source.span_of(&format!("{section}/{earlier}/name"));
                    let mut diagnostic = Diagnostic::at(
                        self.source,
                        "D017",
                        &pointer,
                        format!("the name {} is used twice", quote(name)),
                    )
                    .help("give one of the two another name");
                    if let Some(span) = place {
                        let (line, _) = self.source.line_column(span.start);
                        diagnostic = diagnostic.note(format!("it is first used on line {line}"));
                    }
                    self.found.push(diagnostic);
                }
            }
        }
    }

    /// Checks a name that heads columns of `history.csv`.
    fn column_name(&mut self, pointer: &str, name: &str) {
        let fits = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !fits {
            let message = format!("the name {} cannot head a column of `history.csv`", quote(name));
            self.error("D026", pointer, message, "use letters, digits, `_` and `-`");
        } else if name.len() > LONGEST_NAME {
            let message = format!("a name has at most {LONGEST_NAME} characters");
            self.error(
                "D026",
                pointer,
                message,
                format!("shorten it by {}", counted(name.len() - LONGEST_NAME, "character", "characters")),
            );
        }
    }

    /// The body of this name; reports an error if there is none.
    fn body(&mut self, pointer: &str, name: &str) -> Option<&BodyDeck> {
        let body = self.deck.bodies.iter().find(|body| body.name == name);
        if body.is_none() {
            let names = self.deck.bodies.iter().map(|body| body.name.as_str()).collect();
            self.unknown_reference(pointer, Noun::new("body", "bodies"), name, names);
        }
        body
    }

    fn unknown_reference(&mut self, pointer: &str, kind: Noun, name: &str, names: Vec<&str>) {
        self.found.push(unknown_reference(self.source, pointer, kind, name, names));
    }

    fn bodies(&mut self, grid: Option<&extent::GridBox>) {
        let deck = self.deck;
        self.unique_names("/bodies", deck.bodies.iter().map(|body| body.name.as_str()));
        let mut boxes = Vec::new();
        for (index, body) in deck.bodies.iter().enumerate() {
            let pointer = format!("/bodies/{index}");
            if !deck.materials.contains_key(&body.material) {
                let names = deck.materials.keys().map(String::as_str).collect();
                self.unknown_reference(
                    &format!("{pointer}/material"),
                    Noun::new("material", "materials"),
                    &body.material,
                    names,
                );
            }
            self.domain_update(&pointer, body);
            self.split_above(&pointer, body);
            self.strain(&pointer, body);
            self.initial_stress(&pointer, body);
            self.velocity(&pointer, body);
            if let Some(extent) = self.shape(&format!("{pointer}/shape"), &body.shape, grid) {
                self.points(&pointer, body, &extent, grid);
                boxes.push((index, extent));
            } else {
                self.points_in_region(&pointer, body);
            }
        }
        self.overlaps(boxes);
    }

    /// Only domains that are boxes have lengths to update.
    fn domain_update(&mut self, pointer: &str, body: &BodyDeck) {
        let Some(update) = body.domain_update else { return };
        if body.method == Method::Gimp {
            return;
        }
        let word =
            serde_json::to_value(update).ok().and_then(|word| word.as_str().map(quote)).unwrap_or_default();
        let what = format!("the domain update {word}");
        let key = DomainKey {
            key: "domain_update",
            method: "gimp",
            domains: "whose points have a box for a domain",
            lacks: "have no box to update",
        };
        self.needs_domains(pointer, body, &what, key);
    }

    /// Only domains whose corners move with the grid can be split.
    fn split_above(&mut self, pointer: &str, body: &BodyDeck) {
        if body.split_above.is_some() && body.method != Method::Cpdi2 {
            let key = DomainKey {
                key: "split_above",
                method: "cpdi2",
                domains: "whose domains stretch with the grid",
                lacks: "are never split",
            };
            self.needs_domains(pointer, body, "`split_above`", key);
        }
    }

    /// Reports a key that needs the domains of another method.
    fn needs_domains(&mut self, pointer: &str, body: &BodyDeck, what: &str, needs: DomainKey) {
        let DomainKey { key, method: wanted, domains, lacks } = needs;
        let method = body.method.name();
        let at = format!("{pointer}/{key}");
        let diagnostic = if self.source.is_from_parameter(&at) {
            let message = format!("{what} is ignored: points with `method: {method}` {lacks}");
            let help = format!("keep it if a parameter selects other methods, or remove `{key}`");
            Diagnostic::at(self.source, "D014", &at, message).severity(Severity::Note).help(help)
        } else {
            let message = format!("{what} needs method `{wanted}`, {domains}");
            Diagnostic::at(self.source, "D014", &at, message)
                .label(format!("the method here is `{method}`"))
                .help(format!("set `method: {wanted}`, or remove `{key}`"))
        };
        self.found.push(diagnostic);
    }

    /// F-bar needs a method with basis functions at the centres of cells. The former name of the key is noted.
    fn strain(&mut self, pointer: &str, body: &BodyDeck) {
        if body.strain() == CellStrain::FBar && !body.method.has_centres() {
            let method = body.method.name();
            let message =
                format!("`f-bar` works only with methods `mpm` and `gimp`; the method here is `{method}`");
            let help = "use `mean-dilatation`, which every method supports";
            self.error("D055", &format!("{pointer}/{}", body.strain_key()), message, help);
        }
        let Some(former) = body.volumetric else { return };
        let at = format!("{pointer}/volumetric");
        if body.strain.is_some_and(|strain| strain != former) {
            let message = "`strain` and `volumetric`, its former name, contradict each other".to_owned();
            self.error("D055", &at, message, "remove `volumetric`");
            return;
        }
        let message = "`volumetric` is the former name of `strain`";
        let help = if body.strain.is_some() { "remove it" } else { "write `strain` with the same word" };
        let found = Diagnostic::at_key(self.source, "D037", &at, message.to_owned());
        self.found.push(found.severity(Severity::Note).help(help));
    }

    fn output(&mut self) {
        let OutputDeck { fields, probes, .. } = &self.deck.output;
        for (index, field) in fields.iter().enumerate() {
            if fields[..index].contains(field) {
                let message = format!("the field `{}` is listed twice", field.name());
                self.error("D017", &format!("/output/fields/{index}"), message, "remove one of them");
            }
        }
        self.unique_names("/output/probes", probes.iter().map(|probe| probe.name.as_str()));
        for (index, probe) in probes.iter().enumerate() {
            let pointer = format!("/output/probes/{index}");
            self.column_name(&format!("{pointer}/name"), &probe.name);
            self.body(&format!("{pointer}/body"), &probe.body);
            self.vector(&format!("{pointer}/nearest"), &probe.nearest);
        }
    }
}
