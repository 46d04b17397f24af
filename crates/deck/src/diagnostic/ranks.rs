//! Messages of the ranks of a run about their parts of a model.

use serde::{Deserialize, Serialize};

use mpm_core::ranks::Ranks;

use super::{CODES, Diagnostic, Gate, Severity};
use crate::source::Span;

/// A message on its way to other ranks.
#[derive(Serialize, Deserialize)]
struct Sent {
    code: String,
    severity: Severity,
    gate: Gate,
    message: String,
    expected: Option<String>,
    pointer: Option<String>,
    span: Option<Span>,
    label: Option<String>,
    notes: Vec<String>,
    help: Option<String>,
}

impl From<Diagnostic> for Sent {
    fn from(found: Diagnostic) -> Self {
        let Diagnostic { code, severity, gate, message, expected, pointer, span, label, notes, help } = found;
        let code = code.to_owned();
        Sent { code, severity, gate, message, expected, pointer, span, label, notes, help }
    }
}

impl Sent {
    fn received(self) -> Option<Diagnostic> {
        let Sent { code, severity, gate, message, expected, pointer, span, label, notes, help } = self;
        let (code, _) = CODES.iter().find(|(known, _)| *known == code)?;
        Some(Diagnostic { code, severity, gate, message, expected, pointer, span, label, notes, help })
    }
}

/// The messages of all ranks, on every rank. If several ranks report the same code with the same severity at the
/// same location, only the messages of the lowest rank are kept.
pub(crate) fn gathered(ranks: &Ranks, own: Vec<Diagnostic>) -> Vec<Diagnostic> {
    if ranks.is_alone() {
        return own;
    }
    let own: Vec<Sent> = own.into_iter().map(Sent::from).collect();
    let mut all: Vec<Diagnostic> = Vec::new();
    for received in ranks.gather_all(own) {
        let received = received.into_iter().filter_map(Sent::received);
        let key = |found: &Diagnostic| (found.code, found.severity, found.pointer.clone());
        let is_new = |found: &Diagnostic| !all.iter().any(|known| key(known) == key(found));
        let new: Vec<Diagnostic> = received.filter(is_new).collect();
        all.extend(new);
    }
    all
}
