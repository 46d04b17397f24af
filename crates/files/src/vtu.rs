//! VTK XML unstructured grids (`.vtu`): one mesh with its fields at one time.
//!
//! Arrays are appended to the XML as zlib streams with 64-bit tables of blocks, which ParaView, PyVista and meshio read
//! exactly. The bytes of a file depend on its content only, not on the number of threads.

mod blocks;
mod field;
mod piece;
mod pieces;
pub mod read;

use std::io;
use std::path::Path;
use std::sync::Arc;

use super::invalid;
use super::replace::replace_file;

pub use blocks::Room;
pub use field::{Compute, Encoded, Field, Precision, Values};

/// Component names of a vector.
pub const VECTOR: [&str; 3] = ["X", "Y", "Z"];

/// Component names of a symmetric tensor, in the order that ParaView expects.
pub const SYMMETRIC_TENSOR: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];

/// Component names of a general tensor, row by row.
pub const TENSOR: [&str; 9] = ["XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ"];

pub(super) use pieces::HEAD as HEAD_OF_PIECES;
pub use pieces::Pieces;

/// First bytes of every file.
pub(super) const HEAD: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64""#,
    r#" compressor="vtkZLibDataCompressor">"#,
    "\n"
);

/// Text before the first appended array; `END` is the text after the last.
const BEGIN: &str = "<AppendedData encoding=\"raw\">\n_";
const END: &str = "\n</AppendedData>\n</VTKFile>\n";

/// Shape of the cells of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// A single point.
    Vertex,
    /// A line with 2 points.
    Line,
    /// A triangle with 3 points.
    Triangle,
    /// A quadrilateral with 4 points in order around it.
    Quad,
    /// A tetrahedron with 4 points.
    Tetrahedron,
    /// A pyramid with 5 points: around the base, then the tip.
    Pyramid,
    /// A wedge with 6 points: around one triangle, then around the other.
    Wedge,
    /// A hexahedron with 8 points: around the bottom, then around the top.
    Hexahedron,
}

impl CellKind {
    /// Number of points of a cell.
    pub fn points(self) -> usize {
        match self {
            CellKind::Vertex => 1,
            CellKind::Line => 2,
            CellKind::Triangle => 3,
            CellKind::Quad | CellKind::Tetrahedron => 4,
            CellKind::Pyramid => 5,
            CellKind::Wedge => 6,
            CellKind::Hexahedron => 8,
        }
    }

    /// VTK's number of this cell type.
    fn code(self) -> u8 {
        match self {
            CellKind::Vertex => 1,
            CellKind::Line => 3,
            CellKind::Triangle => 5,
            CellKind::Quad => 9,
            CellKind::Tetrahedron => 10,
            CellKind::Pyramid => 14,
            CellKind::Wedge => 13,
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
    /// Kind of each cell of a mesh with `corners` corners in total; `None` if they do not match.
    fn cells(&self, corners: usize) -> Option<Vec<CellKind>> {
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
#[derive(Clone, Copy)]
pub struct Mesh<'a> {
    /// Coordinates, [length]; z is 0 in plane problems.
    pub points: &'a [[f64; 3]],
    /// Shapes of the cells.
    pub kinds: Kinds<'a>,
    /// Indices of the points of the first cell, of the second, and so on.
    pub connectivity: &'a [i64],
}

/// Writes a mesh with its fields at a time, [time]; `step` is the number of the load step to which they belong.
///
/// The file appears under its name only when it is complete. Errors: file-system errors; `InvalidInput` if lengths do
/// not match, a cell refers to a point that does not exist, two fields share a name, or a number is not finite.
pub fn write(
    path: &Path,
    time: f64,
    step: i64,
    mesh: &Mesh,
    point_data: &[Field],
    cell_data: &[Field],
) -> io::Result<()> {
    file(time, step, mesh, point_data, cell_data)
        .map_err(|problem| invalid(format!("{}: {problem}", path.display())))?
        .write(path)
}

/// The file that [`write`] writes.
///
/// # Errors
/// A message about data that no reader could interpret.
pub fn file(
    time: f64,
    step: i64,
    mesh: &Mesh,
    point_data: &[Field],
    cell_data: &[Field],
) -> Result<File, String> {
    let room = Room::default();
    let points = mesh.points.len();
    let cells = Cells::new(points, &mesh.kinds, mesh.connectivity, &room)?;
    let positions = Values::Float64(mesh.points.as_flattened());
    let positions = Encoded::positions(points, positions, Precision::Double, &room)?;
    let encoded = |fields: &[Field], owner: &str, count: usize| {
        let encoded = |field| Encoded::new(field, owner, count, Precision::Double, &room).map(Arc::new);
        fields.iter().map(encoded).collect::<Result<Vec<_>, String>>()
    };
    let (point_data, cell_data) =
        (encoded(point_data, "point", points)?, encoded(cell_data, "cell", cells.count)?);
    let (positions, cells) = (Arc::new(positions), Arc::new(cells));
    File::new(time, step, positions, cells, point_data, cell_data)
}

/// The encoded cells of a mesh.
pub struct Cells {
    /// Number of points of the mesh.
    points: usize,
    /// Number of cells.
    count: usize,
    /// Connectivity, offsets and types.
    arrays: [Encoded; 3],
}

impl Cells {
    /// Encodes the cells of a mesh with `points` points.
    ///
    /// # Errors
    /// A message about data that no reader could interpret.
    pub fn new(points: usize, kinds: &Kinds, connectivity: &[i64], room: &Room) -> Result<Cells, String> {
        let Some(kinds) = kinds.cells(connectivity.len()) else {
            return Err(format!("{} indices do not form cells of this kind", connectivity.len()));
        };
        let is_point = |index: &i64| usize::try_from(*index).is_ok_and(|index| index < points);
        if let Some(index) = connectivity.iter().find(|index| !is_point(index)) {
            return Err(format!("a cell refers to point {index} of {points}"));
        }
        let end = kinds.iter().scan(0, |end, kind| {
            *end += kind.points() as i64;
            Some(*end)
        });
        let (offsets, types): (Vec<i64>, Vec<u8>) = (end.collect(), kinds.iter().map(|k| k.code()).collect());
        let encoded = |name: &str, values: Values, count: usize| {
            let field = Field { name, components: 1, component_names: &[], values };
            Encoded::new(&field, "cell", count, Precision::Double, room)
        };
        let count = kinds.len();
        let arrays = [
            encoded("connectivity", Values::Int64(connectivity), connectivity.len())?,
            encoded("offsets", Values::Int64(&offsets), count)?,
            encoded("types", Values::UInt8(&types), count)?,
        ];
        Ok(Cells { points, count, arrays })
    }
}

impl Encoded {
    /// Encodes the coordinates of `count` points, [length].
    ///
    /// # Errors
    /// A message about a non-finite number.
    pub fn positions(
        count: usize,
        values: Values,
        precision: Precision,
        room: &Room,
    ) -> Result<Encoded, String> {
        let field = Field { name: "Points", components: 3, component_names: &[], values };
        Encoded::new(&field, "point", count, precision, room)
    }
}

/// A file in memory, completely encoded.
pub struct File {
    lines: Vec<Line>,
}

/// A line of the XML: a tag, or a reference to an appended array.
enum Line {
    Tag(String),
    Array(Arc<Encoded>),
    /// One of the arrays of the cells.
    OfCells(Arc<Cells>, usize),
}

impl Line {
    fn tag(tag: &str) -> Self {
        Line::Tag(tag.to_owned())
    }

    fn array(&self) -> Option<&Encoded> {
        match self {
            Line::Tag(_) => None,
            Line::Array(array) => Some(array),
            Line::OfCells(cells, index) => Some(&cells.arrays[*index]),
        }
    }
}

impl File {
    /// A mesh with its fields at a time, [time]; `step` is the number of the load step to which they belong.
    ///
    /// # Errors
    /// A message about data that no reader could interpret.
    pub fn new(
        time: f64,
        step: i64,
        positions: Arc<Encoded>,
        cells: Arc<Cells>,
        point_data: Vec<Arc<Encoded>>,
        cell_data: Vec<Arc<Encoded>>,
    ) -> Result<File, String> {
        if !time.is_finite() {
            return Err(format!("time {time} is not finite"));
        }
        if positions.tuples != cells.points {
            return Err(format!("{} positions of {} points", positions.tuples, cells.points));
        }
        let single = |name: &str, values: Values| {
            let field = Field { name, components: 1, component_names: &[], values };
            let mut array = Encoded::new(&field, "mesh", 1, Precision::Double, &Room::default())?;
            array.attributes += r#" NumberOfTuples="1""#;
            Ok::<_, String>(Line::Array(Arc::new(array)))
        };
        let (points, count) = (cells.points, cells.count);
        let mut lines = vec![
            Line::tag("<UnstructuredGrid>\n<FieldData>"),
            single("TimeValue", Values::Float64(&[time]))?,
            single("Step", Values::Int64(&[step]))?,
            Line::tag("</FieldData>"),
            Line::Tag(format!(r#"<Piece NumberOfPoints="{points}" NumberOfCells="{count}">"#)),
            Line::tag("<Points>"),
            Line::Array(positions),
            Line::tag("</Points>\n<Cells>"),
        ];
        lines.extend((0..3).map(|index| Line::OfCells(Arc::clone(&cells), index)));
        lines.push(Line::tag("</Cells>\n<PointData>"));
        lines.extend(checked("point", points, point_data)?);
        lines.push(Line::tag("</PointData>\n<CellData>"));
        lines.extend(checked("cell", count, cell_data)?);
        lines.push(Line::tag("</CellData>\n</Piece>\n</UnstructuredGrid>"));
        Ok(File { lines })
    }

    /// Writes the file, which appears under its name only when it is complete.
    ///
    /// # Errors
    /// A file-system error.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        replace_file(path, |out| {
            let mut begins = Vec::new();
            let mut end = 0;
            for array in self.arrays() {
                begins.push(end);
                end += array.blocks.length_at(end);
            }
            out.write_all(self.xml(&begins).as_bytes())?;
            out.write_all(BEGIN.as_bytes())?;
            for (array, begin) in self.arrays().zip(begins) {
                array.blocks.write(begin, out)?;
            }
            out.write_all(END.as_bytes())
        })
    }

    fn arrays(&self) -> impl Iterator<Item = &Encoded> {
        self.lines.iter().filter_map(Line::array)
    }

    /// The XML before the appended arrays, which begin at these offsets.
    fn xml(&self, begins: &[usize]) -> String {
        let mut begins = begins.iter();
        let mut text = String::from(HEAD);
        for line in &self.lines {
            if let Line::Tag(tag) = line {
                text += tag;
            } else if let (Some(Encoded { kind, attributes, .. }), Some(begin)) =
                (line.array(), begins.next())
            {
                text +=
                    &format!(r#"<DataArray type="{kind}" {attributes} format="appended" offset="{begin}"/>"#);
            }
            text.push('\n');
        }
        text
    }
}

/// The fields as lines of the XML, if each has its own name and `count` values.
fn checked(
    owner: &str,
    count: usize,
    fields: Vec<Arc<Encoded>>,
) -> Result<impl Iterator<Item = Line>, String> {
    for (index, field) in fields.iter().enumerate() {
        let name = &field.name;
        if fields[..index].iter().any(|other| other.name == *name) {
            return Err(format!("two {owner} fields are named `{name}`"));
        }
        if field.tuples != count {
            return Err(format!("{owner} field `{name}` has {} values for {count}", field.tuples));
        }
    }
    Ok(fields.into_iter().map(Line::Array))
}
