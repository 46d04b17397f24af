//! Fields and their encoding.

use std::ops::Range;

use mpm_core::counted::counted;
use serde::{Deserialize, Serialize};

use super::blocks::{Blocks, Number, Room};
use crate::escape_xml;

/// Number of tuples that are computed at a time in double precision, and then rounded to single precision.
const PIECE: usize = 256;

/// The numbers of a field.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// Floating-point numbers, all finite.
    Float64(&'a [f64]),
    /// Whole numbers of 64 bits.
    Int64(&'a [i64]),
    /// Whole numbers of 32 bits.
    Int32(&'a [i32]),
    /// Whole numbers of 8 bits without a sign.
    UInt8(&'a [u8]),
    /// Floating-point numbers, all finite, computed on demand, each once.
    Computed(&'a dyn Compute),
}

/// Numbers that are computed in chunks, by several threads at once.
pub trait Compute: Sync {
    /// Number of points or cells.
    fn tuples(&self) -> usize;

    /// Computes all components of some points or cells.
    fn fill(&self, tuples: Range<usize>, out: &mut [f64]);
}

/// Precision of floating-point numbers in files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// 64 bits, 16 digits: the precision of the computation.
    #[default]
    Double,
    /// 32 bits, 7 digits: half the size. Numbers beyond ±3.4e38 are clamped to ±3.4e38.
    Single,
}

impl Precision {
    /// Size of a number, [byte].
    pub fn bytes(self) -> usize {
        match self {
            Precision::Double => size_of::<f64>(),
            Precision::Single => size_of::<f32>(),
        }
    }
}

/// A named quantity with a fixed number of components per point or per cell.
#[derive(Clone, Copy)]
pub struct Field<'a> {
    /// Name, unique among the point fields and among the cell fields of a file.
    pub name: &'a str,
    /// Numbers per point or cell.
    pub components: usize,
    /// Names of the components; if empty, readers number them.
    pub component_names: &'a [&'a str],
    /// All components of the first point or cell, then of the second, and so on.
    pub values: Values<'a>,
}

impl Field<'_> {
    fn numbers(&self) -> usize {
        match self.values {
            Values::Float64(values) => values.len(),
            Values::Int64(values) => values.len(),
            Values::Int32(values) => values.len(),
            Values::UInt8(values) => values.len(),
            Values::Computed(values) => values.tuples() * self.components,
        }
    }

    fn attributes(&self) -> String {
        let mut attributes = format!(r#"Name="{}""#, escape_xml(self.name));
        // One component is the default; meshio returns a flat array only if the number is not stated.
        if self.components > 1 {
            attributes.push_str(&format!(r#" NumberOfComponents="{}""#, self.components));
        }
        for (index, name) in self.component_names.iter().enumerate() {
            attributes.push_str(&format!(r#" ComponentName{index}="{}""#, escape_xml(name)));
        }
        attributes
    }
}

/// An encoded array, independent of its position in a file.
pub struct Encoded {
    /// Name of the field.
    pub(super) name: String,
    /// Number of points or cells.
    pub(super) tuples: usize,
    /// VTK's name of the type of the numbers.
    pub(super) kind: &'static str,
    /// Attributes of its tag other than type and offset.
    pub(super) attributes: String,
    pub(super) blocks: Blocks,
}

impl Encoded {
    /// Encodes a field of `count` points or cells in this precision; `owner` is the word for a point or cell in
    /// messages.
    ///
    /// # Errors
    /// A message about lengths that do not match, or numbers that are not finite.
    pub fn new(
        field: &Field,
        owner: &str,
        count: usize,
        precision: Precision,
        room: &Room,
    ) -> Result<Encoded, String> {
        let Field { name, components, component_names, values } = field;
        if *components == 0 || count.checked_mul(*components) != Some(field.numbers()) {
            let found = counted(field.numbers(), "value", "values");
            let all = counted(count, owner, &format!("{owner}s"));
            return Err(format!(
                "{owner} field `{name}` has {found}, but needs {components} for each of {all}"
            ));
        }
        if !component_names.is_empty() && component_names.len() != *components {
            let components = counted(*components, "component", "components");
            let names = counted(component_names.len(), "component name", "component names");
            return Err(format!("{owner} field `{name}` has {components}, but {names}"));
        }
        let not_finite = |tuple: usize| format!("{owner} field `{name}` is not finite at {owner} {tuple}");
        let (kind, blocks) = match values {
            Values::Int64(values) => whole(values, *components, room),
            Values::Int32(values) => whole(values, *components, room),
            Values::UInt8(values) => whole(values, *components, room),
            Values::Float64(values) => {
                let values_of = |tuples: Range<usize>, out: &mut [f64]| {
                    out.copy_from_slice(&values[tuples.start * components..tuples.end * components]);
                };
                floating(count, *components, precision, room, &values_of, &not_finite)
            }
            Values::Computed(values) => {
                let values_of = |tuples: Range<usize>, out: &mut [f64]| values.fill(tuples, out);
                floating(count, *components, precision, room, &values_of, &not_finite)
            }
        };
        let (name, attributes) = ((*name).to_owned(), field.attributes());
        Ok(Encoded { name, tuples: count, kind, attributes, blocks: blocks? })
    }
}

type Outcome = (&'static str, Result<Blocks, String>);

fn whole<T: Number>(values: &[T], components: usize, room: &Room) -> Outcome {
    let part = |tuples: Range<usize>, out: &mut Vec<T>| {
        out.clear();
        out.extend_from_slice(&values[tuples.start * components..tuples.end * components]);
        Ok(())
    };
    (T::NAME, Blocks::new(values.len() / components, components, room, part))
}

fn floating(
    count: usize,
    components: usize,
    precision: Precision,
    room: &Room,
    fill: &(dyn Fn(Range<usize>, &mut [f64]) + Sync),
    not_finite: &(dyn Fn(usize) -> String + Sync),
) -> Outcome {
    let finite = |tuples: Range<usize>, out: &mut Vec<f64>| {
        out.resize(tuples.len() * components, 0.0);
        fill(tuples.clone(), out);
        match first_not_finite(out) {
            None => Ok(()),
            Some(place) => Err(not_finite(tuples.start + place / components)),
        }
    };
    match precision {
        Precision::Double => (f64::NAME, Blocks::new(count, components, room, finite)),
        Precision::Single => {
            let single = |tuples: Range<usize>, out: &mut Vec<f32>| {
                let mut double = Vec::with_capacity(PIECE.min(tuples.len()) * components);
                out.resize(tuples.len() * components, 0.0);
                for (piece, out) in out.chunks_mut(PIECE * components).enumerate() {
                    let first = tuples.start + piece * PIECE;
                    finite(first..tuples.end.min(first + PIECE), &mut double)?;
                    out.iter_mut().zip(&double).for_each(|(out, x)| *out = nearest_single(*x));
                }
                Ok(())
            };
            (f32::NAME, Blocks::new(count, components, room, single))
        }
    }
}

/// The nearest single-precision number; the largest one for values beyond its range.
fn nearest_single(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// Index of the first number that is infinite or NaN.
fn first_not_finite(values: &[f64]) -> Option<usize> {
    const EXPONENT: u64 = 0x7ff << 52;
    // The loop has no early exit, so that it can be vectorised.
    let is_bad = values.iter().fold(false, |bad, x| bad | (x.to_bits() & EXPONENT == EXPONENT));
    if is_bad { values.iter().position(|x| !x.is_finite()) } else { None }
}
