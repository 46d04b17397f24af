//! The law of a material as the deck states it.

use std::collections::BTreeMap;

use super::cell_size::CellSize;
use super::consistency::{Consistency, consistent};
use super::property::Varying;
use crate::Parameter;
use crate::diagnostic::Diagnostic;
use crate::quoting::quote;
use crate::source::Source;
use crate::span::escape;
use mpm_core::material::{Material, Undrained};

/// A law whose properties have been read once: it forms the law of a material for whatever typical position becomes
/// known.
pub struct StatedLaw {
    /// The properties of the law that vary in space; they are its last history variables, in this order.
    pub varying: Vec<Varying>,
    /// Finds contradictions between the properties at a point, given the values of the varying ones.
    pub consistency: Consistency,
    form: Box<Forming>,
}

/// Forms a law whose varying properties have typical values at a position, [length].
type Forming = dyn Fn(&[f64; 3]) -> Box<dyn Material> + Send + Sync;

impl StatedLaw {
    /// A law whose properties vary as stated, formed by `form`.
    pub(super) fn new(
        varying: Vec<Varying>,
        consistency: Consistency,
        form: impl Fn(&[f64; 3]) -> Box<dyn Material> + Send + Sync + 'static,
    ) -> StatedLaw {
        StatedLaw { varying, consistency, form: Box::new(form) }
    }

    /// A law without properties that the deck could vary or compare.
    pub(crate) fn constant(form: impl Fn() -> Box<dyn Material> + Send + Sync + 'static) -> StatedLaw {
        StatedLaw::new(Vec::new(), Box::new(consistent), move |_| form())
    }

    /// The law. Its varying properties have typical values at the position `typical`, [length]: that of a point of a
    /// body of the material; before bodies are filled, the centre of the box around such a body; the origin if there is
    /// no such body.
    pub fn law(&self, typical: &[f64; 3]) -> Box<dyn Material> {
        (self.form)(typical)
    }

    /// The same law with water of the stiffness K_w/n, [stress], that cannot leave its pores.
    pub(crate) fn undrained(self, stiffness: f64) -> StatedLaw {
        let StatedLaw { varying, consistency, form } = self;
        let form =
            move |typical: &[f64; 3]| Box::new(Undrained::new(form(typical), stiffness)) as Box<dyn Material>;
        StatedLaw::new(varying, consistency, form)
    }

    /// A contradiction between the properties of this material, if none of them varies.
    pub(crate) fn contradiction(&self, source: &Source, material: &str) -> Option<Diagnostic> {
        let found = if self.varying.is_empty() { (self.consistency)(&[]) } else { None }?;
        let message = format!("material {}: {}", quote(material), found.message);
        let at = format!("/materials/{}/{}", escape(material), found.key);
        Some(Diagnostic::at(source, "D057", &at, message).help(found.help))
    }
}

/// What the properties of a material may refer to.
#[derive(Debug, Clone, Default)]
pub struct Surroundings<'a> {
    /// Parameters of the deck.
    pub parameters: Option<&'a BTreeMap<String, Parameter>>,
    /// Number of axes.
    pub dimensions: usize,
    /// Size of the cells.
    pub cells: CellSize,
}
