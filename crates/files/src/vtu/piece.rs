//! One file of a mesh: its bytes and an index of its arrays, which are decoded on demand. Files from other programs,
//! which may store arrays differently, are refused.

use std::borrow::Cow;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use rayon::prelude::*;

use super::{BEGIN, END, blocks};

/// Section of a file that contains an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Section {
    /// Time and step.
    FieldData,
    /// Coordinates.
    Points,
    /// Connectivity of the cells, the offsets in it, and their types.
    Cells,
    /// Fields of points.
    PointData,
    /// Fields of cells.
    CellData,
}

impl Section {
    fn from_tag(tag: &str) -> Option<Section> {
        Some(match tag {
            "FieldData" => Section::FieldData,
            "Points" => Section::Points,
            "Cells" => Section::Cells,
            "PointData" => Section::PointData,
            "CellData" => Section::CellData,
            _ => return None,
        })
    }
}

/// Number type of an array: integer or floating point, and its width in bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Float64,
    Float32,
    Int64,
    Int32,
    UInt8,
}

impl Kind {
    fn from_name(name: &str) -> Option<Kind> {
        Some(match name {
            "Float64" => Kind::Float64,
            "Float32" => Kind::Float32,
            "Int64" => Kind::Int64,
            "Int32" => Kind::Int32,
            "UInt8" => Kind::UInt8,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Kind::Float64 | Kind::Int64 => 8,
            Kind::Float32 | Kind::Int32 => 4,
            Kind::UInt8 => 1,
        }
    }

    /// Decodes a number from [`Kind::size`] bytes.
    fn number(self, bytes: &[u8]) -> f64 {
        match self {
            Kind::Float64 => bytes.try_into().map_or(0.0, f64::from_le_bytes),
            Kind::Float32 => bytes.try_into().map_or(0.0, |b| f64::from(f32::from_le_bytes(b))),
            Kind::Int64 => bytes.try_into().map_or(0.0, |b| i64::from_le_bytes(b) as f64),
            Kind::Int32 => bytes.try_into().map_or(0.0, |b| f64::from(i32::from_le_bytes(b))),
            Kind::UInt8 => bytes.first().map_or(0.0, |b| f64::from(*b)),
        }
    }
}

/// An array of a file, not yet decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    /// Section that contains it.
    pub section: Section,
    /// Name of the array.
    pub name: String,
    /// Numbers per point or cell.
    pub components: usize,
    /// Names of the components, or none.
    pub component_names: Vec<String>,
    kind: Kind,
    /// Number of tuples, if the file states it.
    tuples: Option<usize>,
    /// Range of the array in the appended bytes.
    data: Range<usize>,
}

/// The bytes of a file and an index of its arrays.
#[derive(Debug, Clone)]
pub struct Piece {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Range of the appended arrays.
    appended: Range<usize>,
    /// Number of points.
    pub points: usize,
    /// Number of cells.
    pub cells: usize,
    /// The arrays, in the order of the file.
    pub arrays: Vec<Array>,
}

impl Piece {
    /// Indexes the bytes of a file.
    ///
    /// # Errors
    /// `InvalidData` with the name of the file if it is cut off, or was not written by this program.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> io::Result<Piece> {
        let mut file = Piece {
            path: path.to_owned(),
            bytes: Vec::new(),
            appended: 0..0,
            points: 0,
            cells: 0,
            arrays: Vec::new(),
        };
        let found = file.index(&bytes);
        file.bytes = bytes;
        found.map_err(|what| file.invalid(&what))?;
        Ok(file)
    }

    fn invalid(&self, what: &str) -> io::Error {
        invalid(&self.path, what)
    }

    /// Finds the arrays.
    fn index(&mut self, bytes: &[u8]) -> Result<(), String> {
        let begin = bytes.windows(BEGIN.len()).position(|window| window == BEGIN.as_bytes());
        let text = std::str::from_utf8(&bytes[..begin.unwrap_or(bytes.len())])
            .map_err(|error| format!("cut off or not XML: {error}"))?;
        let mut reader = quick_xml::Reader::from_str(text);
        let (mut section, mut seen_root, mut is_inline) = (None, false, false);
        // The reader gets only the beginning, in which the root element is not closed.
        loop {
            match reader.read_event().map_err(|error| format!("cut off or not XML: {error}"))? {
                Event::Start(tag) => match tag.name().as_ref() {
                    "VTKFile" => {
                        check_root(&tag)?;
                        seen_root = true;
                    }
                    "Piece" => {
                        self.points = count(&tag, "NumberOfPoints")?;
                        self.cells = count(&tag, "NumberOfCells")?;
                    }
                    "DataArray" => is_inline = true,
                    name => section = Section::from_tag(name).or(section),
                },
                Event::Empty(tag) if tag.name().as_ref() == "DataArray" => {
                    let array = array(&tag, section)?;
                    // Arrays follow one another without a gap.
                    if let Some(last) = self.arrays.last_mut() {
                        last.data.end = array.data.start;
                    }
                    self.arrays.push(array);
                }
                Event::Eof => break,
                _ => {}
            }
        }
        if !seen_root {
            return Err("not a VTK file".to_owned());
        }
        if is_inline {
            return Err(
                "it was written by an earlier version of this program; run the analysis again".to_owned()
            );
        }
        let begin = begin.ok_or("the file is cut off, or not written by this program")? + BEGIN.len();
        let end = bytes
            .len()
            .checked_sub(END.len())
            .filter(|end| *end >= begin && &bytes[*end..] == END.as_bytes());
        self.appended = begin..end.ok_or("the file is cut off")?;
        if let Some(last) = self.arrays.last_mut() {
            last.data.end = self.appended.len();
        }
        Ok(())
    }

    /// The array of this name in a section.
    pub fn array(&self, section: Section, name: &str) -> Option<&Array> {
        self.arrays.iter().find(|array| array.section == section && array.name == name)
    }

    /// The numbers of an array: all components of the first point or cell, then of the second, and so on.
    ///
    /// # Errors
    /// `InvalidData` if its data are damaged.
    pub fn decode(&self, array: &Array) -> io::Result<Vec<f64>> {
        let owners = match array.section {
            Section::FieldData => array.tuples,
            Section::Points | Section::PointData => Some(self.points),
            Section::CellData => Some(self.cells),
            Section::Cells if array.name == "connectivity" => None,
            Section::Cells => Some(self.cells),
        };
        let expected = match owners.map(|n| n.checked_mul(array.components)) {
            None => None,
            Some(Some(numbers)) => Some(numbers),
            Some(None) => return Err(self.invalid(&format!("array `{}` is too large", array.name))),
        };
        let appended = &self.bytes[self.appended.clone()];
        let bytes = appended
            .get(array.data.clone())
            .and_then(blocks::decode)
            .filter(|bytes| bytes.len().is_multiple_of(array.kind.size()))
            .filter(|bytes| expected.is_none_or(|numbers| bytes.len() / array.kind.size() == numbers))
            .ok_or_else(|| self.invalid(&format!("array `{}` is damaged", array.name)))?;
        Ok(bytes.par_chunks_exact(array.kind.size()).map(|number| array.kind.number(number)).collect())
    }
}

/// The error of a file that cannot be read as a mesh.
pub fn invalid(path: &Path, what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display()))
}

/// The value of an attribute.
fn attribute<'a>(tag: &'a BytesStart, name: &str) -> Result<Option<Cow<'a, str>>, String> {
    match tag.try_get_attribute(name) {
        Ok(None) => Ok(None),
        Ok(Some(found)) => match found.normalized_value(XmlVersion::Implicit1_0) {
            Ok(value) => Ok(Some(value)),
            Err(error) => Err(format!("attribute `{name}`: {error}")),
        },
        Err(error) => Err(format!("attributes: {error}")),
    }
}

fn count(tag: &BytesStart, name: &str) -> Result<usize, String> {
    let value = attribute(tag, name)?;
    value.and_then(|value| value.parse().ok()).ok_or_else(|| format!("there is no number under `{name}`"))
}

/// Checks that arrays are stored as [`blocks::decode`] expects them.
fn check_root(tag: &BytesStart) -> Result<(), String> {
    for (name, expected) in [
        ("type", "UnstructuredGrid"),
        ("byte_order", "LittleEndian"),
        ("header_type", "UInt64"),
        ("compressor", "vtkZLibDataCompressor"),
    ] {
        let found = attribute(tag, name)?.unwrap_or_default();
        if found != expected {
            return Err(format!("not written by this program: `{name}` is \"{found}\", not \"{expected}\""));
        }
    }
    Ok(())
}

/// Reads the tag of an array; its end is not yet known.
fn array(tag: &BytesStart, section: Option<Section>) -> Result<Array, String> {
    let name = attribute(tag, "Name")?.ok_or("an array has no name")?.into_owned();
    let complaint = |what: &str| format!("array `{name}` has an unknown {what}");
    if attribute(tag, "format")?.as_deref() != Some("appended") {
        return Err(complaint("format"));
    }
    let begin = count(tag, "offset")?;
    let kind = attribute(tag, "type")?.and_then(|kind| Kind::from_name(&kind));
    let components = match attribute(tag, "NumberOfComponents")? {
        None => 1,
        Some(number) => {
            number.parse().ok().filter(|n| (1..=1000).contains(n)).ok_or_else(|| complaint("size"))?
        }
    };
    let mut component_names = Vec::new();
    while let Some(name) = attribute(tag, &format!("ComponentName{}", component_names.len()))? {
        component_names.push(name.into_owned());
    }
    Ok(Array {
        section: section.ok_or_else(|| complaint("place"))?,
        components,
        component_names,
        kind: kind.ok_or_else(|| complaint("type"))?,
        tuples: attribute(tag, "NumberOfTuples")?.and_then(|number| number.parse().ok()),
        data: begin..begin,
        name,
    })
}
