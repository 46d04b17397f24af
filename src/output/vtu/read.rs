//! Reads the meshes that this program has written. Meshes of other programs, which may store their arrays in other
//! ways, are refused.

use std::borrow::Cow;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use rayon::prelude::*;

use super::BLOCK;

/// Where in a file an array stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Section {
    /// Time and step.
    FieldData,
    /// Coordinates.
    Points,
    /// Corners, their ends and types.
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

/// Size and meaning of the numbers of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Float64,
    Int64,
    Int32,
    UInt8,
}

impl Kind {
    fn from_name(name: &str) -> Option<Kind> {
        Some(match name {
            "Float64" => Kind::Float64,
            "Int64" => Kind::Int64,
            "Int32" => Kind::Int32,
            "UInt8" => Kind::UInt8,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Kind::Float64 | Kind::Int64 => 8,
            Kind::Int32 => 4,
            Kind::UInt8 => 1,
        }
    }

    /// The number in as many bytes as [`Kind::size`] says; 0 for any other number of bytes.
    fn number(self, bytes: &[u8]) -> f64 {
        match self {
            Kind::Float64 => bytes.try_into().map_or(0.0, f64::from_le_bytes),
            Kind::Int64 => bytes.try_into().map_or(0.0, |b| i64::from_le_bytes(b) as f64),
            Kind::Int32 => bytes.try_into().map_or(0.0, |b| f64::from(i32::from_le_bytes(b))),
            Kind::UInt8 => bytes.first().map_or(0.0, |b| f64::from(*b)),
        }
    }
}

/// An array of a file, not yet decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    /// Where it stands.
    pub section: Section,
    /// Its name.
    pub name: String,
    /// Numbers per point or cell.
    pub components: usize,
    /// Names of the components, or none.
    pub component_names: Vec<String>,
    kind: Kind,
    /// Number of tuples, if the file states it.
    tuples: Option<usize>,
    /// Place of its text in the file.
    data: Range<usize>,
}

/// The text of a file and what stands where in it; arrays are decoded when they are asked for.
#[derive(Debug, Clone)]
pub struct MeshFile {
    path: PathBuf,
    text: String,
    points: usize,
    cells: usize,
    arrays: Vec<Array>,
}

impl MeshFile {
    /// Reads a file.
    ///
    /// # Errors
    /// Those of the file system; `InvalidData` with the name of the file if it is cut off, or not as this program
    /// writes meshes.
    pub fn read(path: &Path) -> io::Result<MeshFile> {
        MeshFile::from_text(path, std::fs::read_to_string(path)?)
    }

    fn from_text(path: &Path, text: String) -> io::Result<MeshFile> {
        let mut file =
            MeshFile { path: path.to_owned(), text: String::new(), points: 0, cells: 0, arrays: Vec::new() };
        let found = file.index(&text);
        file.text = text;
        found.map_err(|what| file.invalid(&what))?;
        Ok(file)
    }

    fn invalid(&self, what: &str) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", self.path.display()))
    }

    /// Finds the arrays.
    fn index(&mut self, text: &str) -> Result<(), String> {
        let mut reader = quick_xml::Reader::from_str(text);
        let (mut section, mut seen_root, mut open) = (None, false, None::<Array>);
        loop {
            let event = reader.read_event().map_err(|error| format!("cut off or no XML: {error}"))?;
            let here = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
            match event {
                Event::Start(tag) => match tag.name().as_ref() {
                    "VTKFile" => {
                        check_root(&tag)?;
                        seen_root = true;
                    }
                    "Piece" => {
                        self.points = count(&tag, "NumberOfPoints")?;
                        self.cells = count(&tag, "NumberOfCells")?;
                    }
                    "DataArray" => open = Some(array(&tag, section, here)?),
                    name => section = Section::from_tag(name).or(section),
                },
                Event::Text(_) => {
                    if let Some(array) = &mut open {
                        array.data.end = here;
                    }
                }
                Event::End(tag) if tag.name().as_ref() == "DataArray" => self.arrays.extend(open.take()),
                Event::Eof => break,
                _ => {}
            }
        }
        if !seen_root {
            return Err("no VTK file".to_owned());
        }
        if !text.trim_end().ends_with("</VTKFile>") {
            return Err("the file is cut off".to_owned());
        }
        Ok(())
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// The arrays in a section.
    pub fn arrays(&self, section: Section) -> impl Iterator<Item = &Array> {
        self.arrays.iter().filter(move |array| array.section == section)
    }

    /// The numbers of an array by name.
    ///
    /// # Errors
    /// `InvalidData` if there is no such array, or its data are damaged.
    pub fn values(&self, section: Section, name: &str) -> io::Result<Vec<f64>> {
        let array = self.arrays(section).find(|array| array.name == name);
        let array = array.ok_or_else(|| self.invalid(&format!("there is no array `{name}`")))?;
        self.decode(array)
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
        let text = self.text.get(array.data.clone()).unwrap_or_default().trim();
        let bytes = decompress(text)
            .filter(|bytes| bytes.len().is_multiple_of(array.kind.size()))
            .filter(|bytes| expected.is_none_or(|numbers| bytes.len() / array.kind.size() == numbers))
            .ok_or_else(|| self.invalid(&format!("array `{}` is damaged", array.name)))?;
        Ok(bytes.par_chunks_exact(array.kind.size()).map(|number| array.kind.number(number)).collect())
    }

    /// Coordinates of the points, [length].
    ///
    /// # Errors
    /// `InvalidData` if they are damaged.
    pub fn positions(&self) -> io::Result<Vec<[f64; 3]>> {
        let values = self.values(Section::Points, "Points")?;
        let (triples, rest) = values.as_chunks::<3>();
        if rest.is_empty() { Ok(triples.to_vec()) } else { Err(self.invalid("coordinates are no triples")) }
    }

    /// Numbers of the points of every cell.
    ///
    /// # Errors
    /// `InvalidData` if they are damaged, or name points that do not exist.
    pub fn corners(&self) -> io::Result<Vec<Vec<usize>>> {
        let connectivity = self.values(Section::Cells, "connectivity")?;
        let ends = self.values(Section::Cells, "offsets")?;
        let mut begin = 0;
        let mut cells = Vec::with_capacity(ends.len());
        for end in ends {
            let end = end as usize;
            let corners =
                connectivity.get(begin..end).ok_or_else(|| self.invalid("cells without corners"))?;
            if corners.iter().any(|corner| *corner < 0.0 || *corner as usize >= self.points) {
                return Err(self.invalid("a cell names a point that does not exist"));
            }
            cells.push(corners.iter().map(|corner| *corner as usize).collect());
            begin = end;
        }
        Ok(cells)
    }
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

/// That arrays are stored as [`decompress`] expects them.
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

/// An array whose text begins at a place.
fn array(tag: &BytesStart, section: Option<Section>, begin: usize) -> Result<Array, String> {
    let name = attribute(tag, "Name")?.ok_or("an array has no name")?.into_owned();
    let complaint = |what: &str| format!("array `{name}` has an unknown {what}");
    if attribute(tag, "format")?.as_deref() != Some("binary") {
        return Err(complaint("format"));
    }
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

/// The bytes of an array, the reverse of what the writer does; `None` if they are damaged.
fn decompress(text: &str) -> Option<Vec<u8>> {
    let words = |text: &str| -> Option<Vec<usize>> {
        let bytes = STANDARD.decode(text).ok()?;
        let (words, _) = bytes.as_chunks::<8>();
        words.iter().map(|word| usize::try_from(u64::from_le_bytes(*word)).ok()).collect()
    };
    let blocks = *words(text.get(..32)?)?.first()?;
    // Header and data are encoded separately, each padded to groups of 4 characters for 3 bytes.
    let length = blocks.checked_add(3)?.checked_mul(8)?.div_ceil(3).checked_mul(4)?;
    let header = words(text.get(..length)?)?;
    let data = STANDARD.decode(text.get(length..)?).ok()?;
    let (size, partial) = (*header.get(1)?, *header.get(2)?);
    if size > BLOCK || partial > size {
        return None;
    }
    let mut begin = 0usize;
    let mut compressed = Vec::with_capacity(blocks);
    for (index, length) in header.get(3..)?.iter().enumerate() {
        let end = begin.checked_add(*length)?;
        let is_partial = partial > 0 && index + 1 == blocks;
        compressed.push((data.get(begin..end)?, if is_partial { partial } else { size }));
        begin = end;
    }
    let whole = begin == data.len();
    let parts: Option<Vec<Vec<u8>>> =
        compressed.into_par_iter().map(|(block, length)| inflate(block, length)).collect();
    parts.filter(|_| whole).map(|parts| parts.concat())
}

/// A block, if it has the length that it should have.
fn inflate(block: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(length);
    ZlibDecoder::new(block).take(length as u64 + 1).read_to_end(&mut bytes).ok()?;
    (bytes.len() == length).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::{CellKind, Field, Kinds, Mesh, Values, write};
    use super::*;

    /// A file of two quadrilaterals with more points than belong to them.
    fn file(directory: &Path, points: usize) -> PathBuf {
        let path = directory.join("mesh.vtu");
        let positions: Vec<[f64; 3]> = (0..points).map(|i| [i as f64 / 3.0, -(i as f64), 0.0]).collect();
        let corners = [0, 1, 2, 3, 4, 1, 0, 3];
        let mesh = Mesh { points: &positions, kinds: Kinds::All(CellKind::Quad), connectivity: &corners };
        let vector = Field {
            name: "u <&\">",
            components: 3,
            component_names: &super::super::VECTOR,
            values: Values::Float64(positions.as_flattened()),
        };
        let id = Field { name: "id", components: 1, component_names: &[], values: Values::Int32(&[7, -8]) };
        write(&path, 0.5, 12, &mesh, &[vector], &[id]).unwrap();
        path
    }

    #[test]
    fn files_are_read_back_exactly() {
        let directory = tempfile::tempdir().unwrap();
        // Numbers of points for which the coordinates fill blocks partly and exactly.
        for points in [5, BLOCK / 8, BLOCK / 4 + 1] {
            let read = MeshFile::read(&file(directory.path(), points)).unwrap();
            assert_eq!((read.points(), read.cells()), (points, 2));
            let positions = read.positions().unwrap();
            assert_eq!(positions.len(), points);
            assert_eq!(positions[points - 1], [(points - 1) as f64 / 3.0, -((points - 1) as f64), 0.0]);
            assert_eq!(read.corners().unwrap(), [[0, 1, 2, 3], [4, 1, 0, 3]]);
            assert_eq!(read.values(Section::CellData, "id").unwrap(), [7.0, -8.0]);
            assert_eq!(read.values(Section::PointData, "u <&\">").unwrap(), positions.as_flattened());
            assert_eq!(read.values(Section::FieldData, "Step").unwrap(), [12.0]);
            assert_eq!(read.values(Section::FieldData, "TimeValue").unwrap(), [0.5]);
            assert_eq!(read.arrays(Section::PointData).next().unwrap().component_names, ["X", "Y", "Z"]);
            let missing = read.values(Section::PointData, "v").unwrap_err().to_string();
            assert!(missing.contains("mesh.vtu: there is no array `v`"), "{missing}");
        }
    }

    /// All that can be read of the text of a file.
    fn all(path: &Path, text: &[u8]) -> io::Result<()> {
        let text = String::from_utf8(text.to_vec()).map_err(io::Error::other)?;
        let read = MeshFile::from_text(path, text)?;
        read.positions()?;
        read.corners()?;
        read.arrays.iter().try_for_each(|array| read.decode(array).map(|_| ()))
    }

    #[test]
    fn a_file_that_is_cut_off_is_refused_wherever_it_ends() {
        let directory = tempfile::tempdir().unwrap();
        let path = file(directory.path(), 5);
        let text = std::fs::read_to_string(&path).unwrap();
        for end in 0..text.trim_end().len() {
            let error = all(&path, &text.as_bytes()[..end]).expect_err("the whole text is needed");
            assert!(error.to_string().contains("mesh.vtu"), "{end}: {error}");
        }
    }

    #[test]
    fn a_damaged_file_is_read_or_refused_but_never_a_panic() {
        let directory = tempfile::tempdir().unwrap();
        let path = file(directory.path(), 5);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut refused = 0;
        for place in 0..text.len() {
            for other in [b'A', b'9', b'"', b'<'] {
                let mut bytes = text.clone().into_bytes();
                bytes[place] = other;
                refused += usize::from(all(&path, &bytes).is_err());
            }
        }
        assert!(refused > 2 * text.len(), "{refused} of {}", 4 * text.len());
    }
}
