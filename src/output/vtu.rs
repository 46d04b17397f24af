//! VTK XML unstructured grids (`.vtu`): one mesh with its fields at one time.
//!
//! Arrays are stored inline as base64 of zlib-compressed blocks with 64-bit headers, which ParaView, PyVista and
//! meshio read exactly. The bytes of a file depend on its content only, not on the number of threads.

pub mod read;

use std::io::{self, Write};
use std::path::Path;

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use super::replace::replace_file;
use super::{escape_xml, invalid};

/// Component names of a vector.
pub const VECTOR: [&str; 3] = ["X", "Y", "Z"];

/// Component names of a symmetric tensor, in the order that ParaView expects.
pub const SYMMETRIC_TENSOR: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];

/// Component names of a general tensor, row by row.
pub const TENSOR: [&str; 9] = ["XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ"];

/// Uncompressed size of a block, [byte]; a multiple of every size of number.
const BLOCK: usize = 128 * 1024;

/// Shape of the cells of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// A single point.
    Vertex,
    /// A triangle with 3 points.
    Triangle,
    /// A quadrilateral with 4 points in order around it.
    Quad,
    /// A tetrahedron with 4 points.
    Tetrahedron,
    /// A hexahedron with 8 points: around the bottom, then around the top.
    Hexahedron,
}

impl CellKind {
    /// Number of points of a cell.
    pub fn points(self) -> usize {
        match self {
            CellKind::Vertex => 1,
            CellKind::Triangle => 3,
            CellKind::Quad | CellKind::Tetrahedron => 4,
            CellKind::Hexahedron => 8,
        }
    }

    /// VTK's number of this cell type.
    fn code(self) -> u8 {
        match self {
            CellKind::Vertex => 1,
            CellKind::Triangle => 5,
            CellKind::Quad => 9,
            CellKind::Tetrahedron => 10,
            CellKind::Hexahedron => 12,
        }
    }
}

/// Shapes of the cells of a mesh.
#[derive(Debug, Clone, Copy)]
pub enum Kinds<'a> {
    /// All cells are alike.
    All(CellKind),
    /// The kind of every cell.
    Each(&'a [CellKind]),
}

impl Kinds<'_> {
    /// Kinds of the cells of a mesh with so many corners in all; `None` when they do not fit.
    fn of(&self, corners: usize) -> Option<Vec<CellKind>> {
        match self {
            Kinds::All(kind) => {
                corners.is_multiple_of(kind.points()).then(|| vec![*kind; corners / kind.points()])
            }
            Kinds::Each(kinds) => {
                (kinds.iter().map(|kind| kind.points()).sum::<usize>() == corners).then(|| kinds.to_vec())
            }
        }
    }
}

/// Points and the cells between them.
#[derive(Debug, Clone, Copy)]
pub struct Mesh<'a> {
    /// Coordinates, [length]; z is 0 in plane problems.
    pub points: &'a [[f64; 3]],
    /// Shapes of the cells.
    pub kinds: Kinds<'a>,
    /// Indices of the points of the first cell, of the second, and so on.
    pub connectivity: &'a [i64],
}

/// The numbers of a field.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Floating-point numbers, all finite.
    Float64(&'a [f64]),
    /// Whole numbers.
    Int64(&'a [i64]),
    /// Whole numbers of half the size.
    Int32(&'a [i32]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Values::Float64(values) => values.len(),
            Values::Int64(values) => values.len(),
            Values::Int32(values) => values.len(),
        }
    }
}

/// A named quantity with a fixed number of components per point or per cell.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Name, unique among the point fields and among the cell fields of a file.
    pub name: &'a str,
    /// Numbers per point or cell.
    pub components: usize,
    /// Names of the components, or none, which leaves them to be numbered.
    pub component_names: &'a [&'a str],
    /// All components of the first point or cell, then of the second, and so on.
    pub values: Values<'a>,
}

/// Writes a mesh with its fields at a time, [time], and the number of the load step they belong to.
///
/// The file appears under its name only when it is complete.
/// Errors: those of the file system; `InvalidInput` if lengths do not fit together, a cell names a point that does
/// not exist, two fields share a name, or a number is not finite.
pub fn write(
    path: &Path,
    time: f64,
    step: i64,
    mesh: &Mesh,
    point_data: &[Field],
    cell_data: &[Field],
) -> io::Result<()> {
    check(time, mesh, point_data, cell_data)
        .map_err(|problem| invalid(format!("{}: {problem}", path.display())))?;
    replace_file(path, |out| write_file(out, time, step, mesh, point_data, cell_data))
}

/// What a reader could not make sense of, in words.
fn check(time: f64, mesh: &Mesh, point_data: &[Field], cell_data: &[Field]) -> Result<(), String> {
    if !time.is_finite() {
        return Err(format!("time {time} is not finite"));
    }
    let points = mesh.points.len();
    if let Some(point) = mesh.points.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
        return Err(format!("position of point {point} is not finite"));
    }
    let Some(kinds) = mesh.kinds.of(mesh.connectivity.len()) else {
        return Err(format!("{} indices do not make cells of this kind", mesh.connectivity.len()));
    };
    if let Some(index) = mesh.connectivity.iter().find(|&&i| usize::try_from(i).map_or(true, |i| i >= points))
    {
        return Err(format!("a cell names point {index} of {points}"));
    }
    check_fields("point", points, point_data)?;
    check_fields("cell", kinds.len(), cell_data)
}

/// The part of [`check`] that concerns the fields of `count` points or cells.
fn check_fields(owner: &str, count: usize, fields: &[Field]) -> Result<(), String> {
    for (index, field) in fields.iter().enumerate() {
        let Field { name, components, component_names, values } = field;
        if fields[..index].iter().any(|other| other.name == *name) {
            return Err(format!("two {owner} fields are named `{name}`"));
        }
        if *components == 0 || count.checked_mul(*components) != Some(values.len()) {
            let found = values.len();
            return Err(format!(
                "{owner} field `{name}` has {found} values, not {components} for each of {count}"
            ));
        }
        if !component_names.is_empty() && component_names.len() != *components {
            let found = component_names.len();
            return Err(format!(
                "{owner} field `{name}` has {components} components but {found} names for them"
            ));
        }
        if let Values::Float64(values) = values
            && let Some(position) = values.par_iter().position_first(|value| !value.is_finite())
        {
            return Err(format!("{owner} field `{name}` is not finite at {owner} {}", position / components));
        }
    }
    Ok(())
}

fn write_file(
    out: &mut dyn Write,
    time: f64,
    step: i64,
    mesh: &Mesh,
    point_data: &[Field],
    cell_data: &[Field],
) -> io::Result<()> {
    let kinds = mesh.kinds.of(mesh.connectivity.len()).unwrap_or_default();
    let cells = kinds.len();
    let mut end = 0;
    let mut offsets: Vec<i64> = Vec::with_capacity(cells);
    for kind in &kinds {
        end += kind.points() as i64;
        offsets.push(end);
    }
    let types: Vec<u8> = kinds.iter().map(|kind| kind.code()).collect();
    writeln!(out, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
    write!(out, r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian""#)?;
    writeln!(out, r#" header_type="UInt64" compressor="vtkZLibDataCompressor">"#)?;
    writeln!(out, "<UnstructuredGrid>")?;
    writeln!(out, "<FieldData>")?;
    array(out, r#"Name="TimeValue" NumberOfTuples="1""#, &[time])?;
    array(out, r#"Name="Step" NumberOfTuples="1""#, &[step])?;
    writeln!(out, "</FieldData>")?;
    writeln!(out, r#"<Piece NumberOfPoints="{}" NumberOfCells="{cells}">"#, mesh.points.len())?;
    writeln!(out, "<Points>")?;
    array(out, r#"Name="Points" NumberOfComponents="3""#, mesh.points.as_flattened())?;
    writeln!(out, "</Points>\n<Cells>")?;
    array(out, r#"Name="connectivity""#, mesh.connectivity)?;
    array(out, r#"Name="offsets""#, &offsets)?;
    array(out, r#"Name="types""#, &types)?;
    writeln!(out, "</Cells>\n<PointData>")?;
    point_data.iter().try_for_each(|field| field_array(out, field))?;
    writeln!(out, "</PointData>\n<CellData>")?;
    cell_data.iter().try_for_each(|field| field_array(out, field))?;
    writeln!(out, "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
}

fn field_array(out: &mut dyn Write, field: &Field) -> io::Result<()> {
    let mut attributes = format!(r#"Name="{}""#, escape_xml(field.name));
    // One component is the default; meshio returns a flat array only where it is not stated.
    if field.components > 1 {
        attributes.push_str(&format!(r#" NumberOfComponents="{}""#, field.components));
    }
    for (index, name) in field.component_names.iter().enumerate() {
        attributes.push_str(&format!(r#" ComponentName{index}="{}""#, escape_xml(name)));
    }
    match field.values {
        Values::Float64(values) => array(out, &attributes, values),
        Values::Int64(values) => array(out, &attributes, values),
        Values::Int32(values) => array(out, &attributes, values),
    }
}

/// A number as VTK stores it.
trait Number: Copy + Sync {
    /// VTK's name of the type.
    const NAME: &'static str;
    /// Appends the little-endian bytes.
    fn append(self, bytes: &mut Vec<u8>);
}

macro_rules! number {
    ($($type:ty => $name:literal),*) => {$(
        impl Number for $type {
            const NAME: &'static str = $name;
            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
number!(f64 => "Float64", i64 => "Int64", i32 => "Int32", u8 => "UInt8");

/// Writes one `DataArray`: header and data are base64-encoded separately, as VTK reads them.
fn array<T: Number>(out: &mut dyn Write, attributes: &str, values: &[T]) -> io::Result<()> {
    let blocks: Vec<Vec<u8>> = values
        .par_chunks(BLOCK / size_of::<T>())
        .map(|chunk| {
            let mut bytes = Vec::with_capacity(size_of_val(chunk));
            chunk.iter().for_each(|value| value.append(&mut bytes));
            let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len() / 2), Compression::new(1));
            encoder.write_all(&bytes)?;
            encoder.finish()
        })
        .collect::<io::Result<_>>()?;
    // A last block that is full is written as "no partial block", size 0.
    let partial = size_of_val(values) % BLOCK;
    let mut header = Vec::with_capacity(8 * (3 + blocks.len()));
    for word in [blocks.len(), BLOCK, partial].into_iter().chain(blocks.iter().map(Vec::len)) {
        header.extend_from_slice(&(word as u64).to_le_bytes());
    }
    writeln!(out, r#"<DataArray type="{}" {attributes} format="binary">"#, T::NAME)?;
    base64(out, &[header])?;
    base64(out, &blocks)?;
    writeln!(out, "\n</DataArray>")
}

/// Writes the concatenation of the parts as one base64 text.
fn base64(out: &mut dyn Write, parts: &[Vec<u8>]) -> io::Result<()> {
    let mut encoder = EncoderWriter::new(out, &STANDARD);
    parts.iter().try_for_each(|part| encoder.write_all(part))?;
    encoder.finish().map(|_| ())
}
