//! VTK XML unstructured grids (`.vtu`): one mesh with its fields at one time.
//!
//! Arrays are appended to the XML as zlib streams with 64-bit tables of blocks, which ParaView, PyVista and meshio read
//! exactly. The bytes of a file depend on its content only, not on the number of threads.

mod blocks;
pub mod read;

use std::io::{self, SeekFrom};
use std::path::Path;

use rayon::prelude::*;

use self::blocks::Number;
use super::replace::{WriteSeek, replace_file};
use super::{escape_xml, invalid};

/// Component names of a vector.
pub const VECTOR: [&str; 3] = ["X", "Y", "Z"];

/// Component names of a symmetric tensor, in the order that ParaView expects.
pub const SYMMETRIC_TENSOR: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];

/// Component names of a general tensor, row by row.
pub const TENSOR: [&str; 9] = ["XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ"];

/// What every file begins with.
const HEAD: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64""#,
    r#" compressor="vtkZLibDataCompressor">"#,
    "\n"
);

/// What stands before the first appended array, and after the last.
const BEGIN: &str = "<AppendedData encoding=\"raw\">\n_";
const END: &str = "\n</AppendedData>\n</VTKFile>\n";

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
    /// Small whole numbers.
    UInt8(&'a [u8]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Values::Float64(values) => values.len(),
            Values::Int64(values) => values.len(),
            Values::Int32(values) => values.len(),
            Values::UInt8(values) => values.len(),
        }
    }

    /// VTK's name of their type.
    fn kind(&self) -> &'static str {
        fn name<T: Number>(_: &[T]) -> &'static str {
            T::NAME
        }
        match self {
            Values::Float64(values) => name(values),
            Values::Int64(values) => name(values),
            Values::Int32(values) => name(values),
            Values::UInt8(values) => name(values),
        }
    }

    fn encode(&self, place: u64) -> io::Result<Vec<Vec<u8>>> {
        match self {
            Values::Float64(values) => blocks::encode(values, place),
            Values::Int64(values) => blocks::encode(values, place),
            Values::Int32(values) => blocks::encode(values, place),
            Values::UInt8(values) => blocks::encode(values, place),
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
            && let Some(position) = first_not_finite(values)
        {
            return Err(format!("{owner} field `{name}` is not finite at {owner} {}", position / components));
        }
    }
    Ok(())
}

/// A line of the XML: a tag, or an array among the appended ones.
enum Line<'a> {
    Tag(String),
    Array(String, Values<'a>),
}

impl<'a> Line<'a> {
    fn tag(tag: &str) -> Self {
        Line::Tag(tag.to_owned())
    }

    fn array(attributes: &str, values: Values<'a>) -> Self {
        Line::Array(attributes.to_owned(), values)
    }

    fn field(field: &Field<'a>) -> Self {
        let mut attributes = format!(r#"Name="{}""#, escape_xml(field.name));
        // One component is the default; meshio returns a flat array only where it is not stated.
        if field.components > 1 {
            attributes.push_str(&format!(r#" NumberOfComponents="{}""#, field.components));
        }
        for (index, name) in field.component_names.iter().enumerate() {
            attributes.push_str(&format!(r#" ComponentName{index}="{}""#, escape_xml(name)));
        }
        Line::Array(attributes, field.values)
    }
}

/// The place of the first number that is infinite or none.
fn first_not_finite(values: &[f64]) -> Option<usize> {
    const CHUNK: usize = 1 << 12;
    const EXPONENT: u64 = 0x7ff << 52;
    // Without a way out of the loop, so that several are looked at together.
    let is_bad =
        |chunk: &[f64]| chunk.iter().fold(false, |bad, x| bad | (x.to_bits() & EXPONENT == EXPONENT));
    let chunk = values.par_chunks(CHUNK).position_first(is_bad)? * CHUNK;
    values[chunk..].iter().position(|x| !x.is_finite()).map(|place| chunk + place)
}

fn write_file(
    out: &mut dyn WriteSeek,
    time: f64,
    step: i64,
    mesh: &Mesh,
    point_data: &[Field],
    cell_data: &[Field],
) -> io::Result<()> {
    let kinds = mesh.kinds.of(mesh.connectivity.len()).unwrap_or_default();
    let (points, cells) = (mesh.points.len(), kinds.len());
    let mut end = 0;
    let mut offsets: Vec<i64> = Vec::with_capacity(cells);
    for kind in &kinds {
        end += kind.points() as i64;
        offsets.push(end);
    }
    let types: Vec<u8> = kinds.iter().map(|kind| kind.code()).collect();
    let (positions, time, step) = (mesh.points.as_flattened(), [time], [step]);
    let mut lines = vec![
        Line::tag("<UnstructuredGrid>\n<FieldData>"),
        Line::array(r#"Name="TimeValue" NumberOfTuples="1""#, Values::Float64(&time)),
        Line::array(r#"Name="Step" NumberOfTuples="1""#, Values::Int64(&step)),
        Line::tag("</FieldData>"),
        Line::Tag(format!(r#"<Piece NumberOfPoints="{points}" NumberOfCells="{cells}">"#)),
        Line::tag("<Points>"),
        Line::array(r#"Name="Points" NumberOfComponents="3""#, Values::Float64(positions)),
        Line::tag("</Points>\n<Cells>"),
        Line::array(r#"Name="connectivity""#, Values::Int64(mesh.connectivity)),
        Line::array(r#"Name="offsets""#, Values::Int64(&offsets)),
        Line::array(r#"Name="types""#, Values::UInt8(&types)),
        Line::tag("</Cells>\n<PointData>"),
    ];
    lines.extend(point_data.iter().map(Line::field));
    lines.push(Line::tag("</PointData>\n<CellData>"));
    lines.extend(cell_data.iter().map(Line::field));
    lines.push(Line::tag("</CellData>\n</Piece>\n</UnstructuredGrid>"));
    write_lines(out, &lines)
}

/// Writes the arrays, each as soon as it is encoded, then the XML before them, which says where each begins.
fn write_lines(out: &mut dyn WriteSeek, lines: &[Line]) -> io::Result<()> {
    let room = xml(lines, &vec![u64::MAX; lines.len()]).len();
    out.write_all(&vec![b' '; room])?;
    out.write_all(BEGIN.as_bytes())?;
    let (mut begins, mut begin) = (Vec::new(), 0);
    for line in lines {
        if let Line::Array(_, values) = line {
            begins.push(begin);
            for part in values.encode(begin)? {
                out.write_all(&part)?;
                begin += part.len() as u64;
            }
        }
    }
    out.write_all(END.as_bytes())?;
    out.seek(SeekFrom::Start(0))?;
    // What is left of the room stays blank.
    out.write_all(xml(lines, &begins).as_bytes())
}

/// The XML before the appended arrays, which begin at these places among them.
fn xml(lines: &[Line], begins: &[u64]) -> String {
    let mut begins = begins.iter();
    let mut text = String::from(HEAD);
    for line in lines {
        match line {
            Line::Tag(tag) => text += tag,
            Line::Array(attributes, values) => {
                let (kind, begin) = (values.kind(), begins.next().copied().unwrap_or_default());
                text +=
                    &format!(r#"<DataArray type="{kind}" {attributes} format="appended" offset="{begin}"/>"#);
            }
        }
        text.push('\n');
    }
    text
}
