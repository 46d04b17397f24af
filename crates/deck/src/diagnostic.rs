//! Messages about a deck: the fault, its location and the remedy.

mod json;
mod ranks;

use serde::{Deserialize, Serialize};

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

pub use json::{FORMAT_VERSION, as_json};
pub(crate) use ranks::gathered;

use super::source::{Source, Span};

/// A part of the text of a scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Excerpt<'a> {
    /// The whole text.
    pub text: &'a str,
    /// Byte at which the part begins.
    pub offset: usize,
    /// Length of the part, in bytes.
    pub length: usize,
}

/// How serious a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Severity {
    /// The deck cannot be used.
    Error,
    /// The deck can be used, but is probably not what was intended.
    Warning,
    /// Information only.
    Note,
}

impl Severity {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        }
    }
}

/// The stages of checking a deck, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Gate {
    /// The file is text, the text is YAML, and its parameters have values.
    Text,
    /// The deck meets the schema: every key is known, every value has its type and lies in its range.
    Shape,
    /// The deck makes sense, as far as this can be checked without the mesh.
    Meaning,
    /// The analysis is possible with this mesh, on this machine.
    Feasibility,
}

impl Gate {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Gate::Text => "text",
            Gate::Shape => "shape",
            Gate::Meaning => "meaning",
            Gate::Feasibility => "feasibility",
        }
    }
}

/// One message about a deck.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Stable code, listed in [`CODES`].
    pub code: &'static str,
    /// How serious it is.
    pub severity: Severity,
    /// The check that found it.
    pub gate: Gate,
    /// The fault, as a fragment in lower case.
    pub message: String,
    /// The values allowed at the location, for programs: a kind of value, a range, words, keys or names. For people,
    /// the message or the help states them.
    pub expected: Option<String>,
    /// JSON pointer to the value concerned, such as `/bodies/0/shape/min`.
    pub pointer: Option<String>,
    /// Location in the text of the deck.
    pub span: Option<Span>,
    /// Short text beside the marked location.
    pub label: Option<String>,
    /// Further information, for example that a value comes from a parameter.
    pub notes: Vec<String>,
    /// The remedy.
    pub help: Option<String>,
}

/// All codes with their titles.
pub const CODES: &[(&str, &str)] = &[
    ("D001", "the file cannot be read as text"),
    ("D002", "the text is not YAML"),
    ("D003", "a key is given twice"),
    ("D004", "a YAML feature that decks do not allow, or allow only up to a limit"),
    ("D005", "a number that is not finite"),
    ("D006", "unknown key"),
    ("D007", "missing key"),
    ("D008", "a value of the wrong type"),
    ("D009", "a number outside its range"),
    ("D010", "an unknown word where one from a list is expected"),
    ("D011", "a parameter that cannot be used"),
    ("D012", "an expression `${...}` that cannot be evaluated"),
    ("D013", "an override of a parameter that does not exist"),
    ("D014", "a domain setting that does not apply to the points"),
    ("D015", "a list with the wrong number of entries"),
    ("D016", "a degenerate shape"),
    ("D017", "a name used twice"),
    ("D018", "a reference to something that does not exist"),
    ("D019", "a node selection that is made in no way, or in more than one"),
    ("D020", "a boundary condition that prescribes nothing, or an axis twice"),
    ("D021", "a formula that cannot be understood"),
    ("D022", "a load curve that does not cover the analysis"),
    ("D023", "a missing, ambiguous or unsuitable placement of points"),
    ("D024", "gravity on a body without density"),
    ("D025", "bodies that overlap"),
    ("D026", "a name that cannot head a column"),
    ("D027", "a grid whose size is not a whole number of cells, or that is too fine"),
    ("D028", "a body that does not fit the grid or the spacing of its points"),
    ("D029", "a boundary condition that selects no node, or fewer than its box covers"),
    ("D030", "a selection of points that cannot be made"),
    ("D031", "a physical group that does not exist"),
    ("D032", "a mesh file that cannot be used, or looks wrong"),
    ("D033", "a body whose points do not fill its region exactly"),
    ("D034", "a method that the grid does not support"),
    ("D035", "a body that no boundary condition holds, or that can turn"),
    ("D036", "an analysis that needs more memory than is available"),
    ("D037", "something in the deck that has no effect"),
    ("D038", "one point per cell"),
    ("D039", "a Poisson's ratio so close to 0.5 that the cells lock"),
    ("D040", "units that look mixed"),
    ("D041", "points far from the requested location"),
    ("D042", "boundary conditions that contradict each other"),
    ("D043", "a formula that has no finite value somewhere"),
    ("D044", "a domain update that does not suit the motion"),
    ("D045", "a tolerance that is loose, or out of reach"),
    (
        "D046",
        "a body of revolution whose axis is free or inside the grid, or whose weight is not along the axis",
    ),
    ("D047", "a surface file that cannot be used, or looks wrong"),
    ("D048", "a feature that is available only in the plane or only in space"),
    ("D049", "a step control that does not fit the deck"),
    ("D050", "a surface that cannot be sampled"),
    ("D051", "an initial stress that a body cannot have"),
    ("D052", "an initial stress outside the yield surface"),
    ("D053", "stages that do not fit the deck, or each other"),
    ("D054", "grid lines that cannot follow a boundary condition"),
    ("D055", "a deformation of cells that contradicts another key, the method or the grid"),
    ("D056", "plastic flow in cells that lock"),
    ("D057", "material properties that do not fit together"),
    ("D058", "a material property out of range at a point"),
    ("D059", "a material that needs an initial stress"),
    ("D060", "softening that depends on the cell size"),
    ("D061", "a library whose law cannot be used"),
    ("D062", "parameters that do not fit a library law"),
    ("D063", "a library law that lacks a property"),
    ("D064", "a factor of safety that depends on the cell size"),
    ("D065", "a strength reduction without loads"),
    ("D066", "a strength reduction after another one"),
    ("D067", "a load on a side of a GIMP body of revolution"),
    ("D068", "a tool that cannot move or be loaded as stated"),
    ("D069", "a part of a tool that has no surface"),
    ("D070", "a tool that overlaps a body at the start"),
    ("D071", "a tool that leaves the grid"),
    ("D072", "bodies that share grid nodes and stick together"),
    ("D073", "a body or a gap thinner than two cells"),
    ("D074", "a surface that no sides of domains form"),
    ("D075", "a footing across few cells"),
    ("D076", "contact between bodies that cannot be formed"),
    ("D077", "bodies without contact that pass through each other"),
    ("D078", "a body in contact whose surface is a staircase"),
    ("D080", "motion with inertia that cannot be as stated"),
    ("D081", "a velocity of a body that does not move"),
    ("D082", "a motion that cannot be read"),
    ("D090", "units that make no set"),
    ("D091", "water that is not stated as a whole"),
    ("D092", "water in a body without porosity"),
    ("D093", "pore water of unknown stiffness"),
    ("D094", "flow through pores, which is not available"),
    ("D095", "pores that contradict each other"),
    ("D096", "a body that water lifts and no gravity pulls down"),
    ("D097", "water at a level in motion with inertia"),
    ("D098", "water that changes where load factors are unknown"),
    ("D099", "water that counts twice, is lost, or acts where points do not resolve it"),
];

impl Diagnostic {
    /// An error without a location.
    pub fn error(code: &'static str, message: impl Into<String>) -> Diagnostic {
        debug_assert!(CODES.iter().any(|(known, _)| *known == code), "unregistered code {code}");
        Diagnostic {
            code,
            severity: Severity::Error,
            gate: Gate::Text,
            message: message.into(),
            expected: None,
            pointer: None,
            span: None,
            label: None,
            notes: Vec::new(),
            help: None,
        }
    }

    /// An error about the value at a JSON pointer, located there or, if the value is not in the text, at the nearest
    /// ancestor that is. A note is added if the value comes from a parameter.
    pub fn at(source: &Source, code: &'static str, pointer: &str, message: impl Into<String>) -> Diagnostic {
        let mut diagnostic = Diagnostic::error(code, message);
        diagnostic.span = source.nearest_span(pointer);
        diagnostic.pointer = Some(pointer.to_owned());
        diagnostic.notes.extend(source.substitution(pointer).map(|substitution| substitution.describe()));
        diagnostic
    }

    /// Like [`Diagnostic::at`], but located at the key rather than at its value, and without the note.
    pub fn at_key(
        source: &Source,
        code: &'static str,
        pointer: &str,
        message: impl Into<String>,
    ) -> Diagnostic {
        let mut diagnostic = Diagnostic::error(code, message);
        diagnostic.span = source.key_span_of(pointer).or_else(|| source.nearest_span(pointer));
        diagnostic.pointer = Some(pointer.to_owned());
        diagnostic
    }

    /// Like [`Diagnostic::at`], but located at a part of a scalar.
    pub fn inside(
        source: &Source,
        code: &'static str,
        pointer: &str,
        part: Excerpt,
        message: impl Into<String>,
    ) -> Diagnostic {
        let Excerpt { text, offset, length } = part;
        let mut diagnostic = Diagnostic::at(source, code, pointer, message);
        diagnostic.span = source.span_inside(pointer, text, offset, length).or(diagnostic.span);
        diagnostic
    }

    /// Adds a label beside the marked location.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Diagnostic {
        self.label = Some(label.into());
        self
    }

    /// Adds the values allowed at the location.
    #[must_use]
    pub fn expected(mut self, expected: impl Into<String>) -> Diagnostic {
        self.expected = Some(expected.into());
        self
    }

    /// Adds the remedy.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help = Some(help.into());
        self
    }

    /// Adds a note.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Diagnostic {
        self.notes.push(note.into());
        self
    }

    /// Sets how serious the message is.
    #[must_use]
    pub fn severity(mut self, severity: Severity) -> Diagnostic {
        self.severity = severity;
        self
    }

    /// True if the deck cannot be used.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }

    /// The message as text, with the line of the deck that it concerns; no newline at the end.
    pub fn render(&self, source: &Source, colour: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
            Severity::Note => Level::NOTE,
        };
        let title = level.primary_title(self.message.as_str()).id(self.code);
        let mut group = match self.span {
            Some(span) => {
                let excerpt = source.excerpt(span);
                let mark = AnnotationKind::Primary.span(excerpt.mark).label(self.label.as_deref());
                title.element(
                    Snippet::source(excerpt.text)
                        .line_start(excerpt.line)
                        .path(source.name())
                        .annotation(mark),
                )
            }
            None => Group::with_title(title).element(Origin::path(source.name())),
        };
        if let (None, Some(pointer)) = (self.span, &self.pointer)
            && !pointer.is_empty()
        {
            group = group.element(Level::NOTE.message(format!("this is about `{pointer}`")));
        }
        for note in &self.notes {
            group = group.element(Level::NOTE.message(note.as_str()));
        }
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
        renderer.render(&[group])
    }
}

/// Assigns messages to a gate.
pub(super) fn assign(gate: Gate, diagnostics: &mut [Diagnostic]) {
    diagnostics.iter_mut().for_each(|diagnostic| diagnostic.gate = gate);
}

/// Makes every warning an error; returns true if there was one.
pub fn deny_warnings(diagnostics: &mut [Diagnostic]) -> bool {
    let mut any = false;
    for diagnostic in diagnostics.iter_mut().filter(|d| d.severity == Severity::Warning) {
        diagnostic.severity = Severity::Error;
        diagnostic.notes.push("this is a warning, treated as an error".to_owned());
        any = true;
    }
    any
}

/// The numbers of errors and warnings as text; empty if there are none.
pub fn count(diagnostics: &[Diagnostic]) -> String {
    let counts = [(Severity::Error, "error", "errors"), (Severity::Warning, "warning", "warnings")];
    let counts = counts.map(|(severity, one, several)| {
        match diagnostics.iter().filter(|d| d.severity == severity).count() {
            0 => None,
            1 => Some(format!("1 {one}")),
            n => Some(format!("{n} {several}")),
        }
    });
    counts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Largest number of messages that are rendered; if a deck has more faults, most have the same cause.
const MAX_RENDERED: usize = 100;

/// Renders messages, at most `MAX_RENDERED`, in the given order, with an empty line between them and a newline at the end.
pub fn render_all(source: &Source, diagnostics: &[Diagnostic], colour: bool) -> String {
    let mut text = String::new();
    for diagnostic in diagnostics.iter().take(MAX_RENDERED) {
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&diagnostic.render(source, colour));
        text.push('\n');
    }
    if diagnostics.len() > MAX_RENDERED {
        text.push_str(&format!("\nand {} more\n", diagnostics.len() - MAX_RENDERED));
    }
    text
}

/// Sorts messages by location and drops repetitions, which arise if several aliases refer to one value.
pub fn sort(diagnostics: &mut Vec<Diagnostic>) {
    diagnostics.sort_by(|a, b| {
        let location = |d: &Diagnostic| d.span.map_or((0, 0), |span| (span.start, span.end));
        (location(a), a.code, &a.message).cmp(&(location(b), b.code, &b.message))
    });
    diagnostics.dedup_by(|a, b| a.span == b.span && a.code == b.code && a.message == b.message);
}
