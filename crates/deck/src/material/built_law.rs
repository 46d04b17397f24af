//! A law, its properties that vary in space, and the check that its properties do not contradict each other.

use super::consistency::Consistency;
use super::property::Varying;
use crate::diagnostic::Diagnostic;
use crate::quoting::quote;
use crate::source::Source;
use crate::span::escape;
use mpm_core::material::Material;

/// The law of a material.
pub struct BuiltLaw {
    /// The law.
    pub law: Box<dyn Material>,
    /// The properties of the law that vary in space; they are its last history variables, in this order.
    pub varying: Vec<Varying>,
    /// Finds contradictions between the properties at a point, given the values of the varying ones.
    pub consistency: Consistency,
}

impl BuiltLaw {
    /// A law without varying properties.
    pub fn constant(law: Box<dyn Material>) -> BuiltLaw {
        BuiltLaw { law, varying: Vec::new(), consistency: Box::new(|_| None) }
    }

    /// A contradiction between the properties of this material, if none of them varies.
    pub(crate) fn contradiction(&self, source: &Source, material: &str) -> Option<Diagnostic> {
        let found = if self.varying.is_empty() { (self.consistency)(&[]) } else { None }?;
        let message = format!("material {}: {}", quote(material), found.message);
        let at = format!("/materials/{}/{}", escape(material), found.key);
        Some(Diagnostic::at(source, "D057", &at, message).help(found.help))
    }
}
