//! Reads meshes written by this program: a file, or the pieces that a list names.

use std::io;
use std::path::{Path, PathBuf};

use mpm_core::input_file;

use super::piece::{Piece, invalid};
use super::pieces;

pub use super::piece::{Array, Section};

/// Name of the array of permanent numbers.
const NUMBER: &str = "point_id";

/// A mesh, whose arrays are decoded on demand. It consists of one piece, or of the pieces that the ranks of a run have
/// written.
#[derive(Debug, Clone)]
pub struct MeshFile {
    path: PathBuf,
    pieces: Vec<Piece>,
    /// The points and the cells of several pieces in ascending order of permanent numbers, if they have such numbers.
    order: Option<[Vec<usize>; 2]>,
}

impl MeshFile {
    /// Reads a file, or all pieces of a mesh in pieces. Points of pieces are put in the order of their permanent
    /// numbers, if they have such numbers.
    ///
    /// # Errors
    /// A file-system error; `InvalidData` with the name of the file if it is cut off, or was not written by this
    /// program.
    pub fn read(path: &Path) -> io::Result<MeshFile> {
        let bytes = input_file::read(path, u64::MAX)?;
        if path.extension().is_some_and(|extension| extension == pieces::EXTENSION) {
            MeshFile::from_list(path, &bytes)
        } else {
            MeshFile::from_bytes(path, bytes)
        }
    }

    fn from_bytes(path: &Path, bytes: Vec<u8>) -> io::Result<MeshFile> {
        Ok(MeshFile { path: path.to_owned(), pieces: vec![Piece::from_bytes(path, bytes)?], order: None })
    }

    /// Reads the pieces that a list in these bytes names.
    fn from_list(path: &Path, bytes: &[u8]) -> io::Result<MeshFile> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let names = std::str::from_utf8(bytes).map_err(|error| error.to_string());
        let names =
            names.and_then(|text| pieces::names(text, directory)).map_err(|what| invalid(path, &what))?;
        let read = |name: PathBuf| Piece::from_bytes(&name, input_file::read(&name, u64::MAX)?);
        let pieces = names.into_iter().map(read).collect::<io::Result<Vec<Piece>>>()?;
        let mut file = MeshFile { path: path.to_owned(), pieces, order: None };
        file.order = file.order_of_pieces()?;
        Ok(file)
    }

    /// The order of the points and of the cells by permanent numbers, if the points or the cells have such numbers.
    fn order_of_pieces(&self) -> io::Result<Option<[Vec<usize>; 2]>> {
        let sorted = |section: Section| {
            let numbers = self.values(section, NUMBER)?;
            let mut order: Vec<usize> = (0..numbers.len()).collect();
            order.sort_by(|a, b| numbers[*a].total_cmp(&numbers[*b]));
            Ok::<_, io::Error>(order)
        };
        let has = |section: Section| self.arrays(section).any(|array| array.name == NUMBER);
        if has(Section::PointData) && self.points() == self.cells() {
            let order = sorted(Section::PointData)?;
            return Ok(Some([order.clone(), order]));
        }
        if !has(Section::CellData) {
            return Ok(None);
        }
        let cells = sorted(Section::CellData)?;
        let corners = self.corners()?;
        let points: Vec<usize> = cells.iter().flat_map(|cell| &corners[*cell]).copied().collect();
        // Domains share no corners.
        if points.len() == self.points() {
            Ok(Some([points, cells]))
        } else {
            Err(self.invalid("its cells share points"))
        }
    }

    fn invalid(&self, what: &str) -> io::Error {
        invalid(&self.path, what)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.pieces.iter().map(|piece| piece.points).sum()
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.pieces.iter().map(|piece| piece.cells).sum()
    }

    /// The arrays in a section; all pieces have the same arrays.
    pub fn arrays(&self, section: Section) -> impl Iterator<Item = &Array> {
        let arrays = self.pieces.first().map_or(&[][..], |piece| &piece.arrays);
        arrays.iter().filter(move |array| array.section == section)
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
    /// `InvalidData` if its data are damaged, or it differs between pieces.
    pub fn decode(&self, array: &Array) -> io::Result<Vec<f64>> {
        if let ([only], None) = (&self.pieces[..], &self.order) {
            return only.decode(array);
        }
        let (mut all, mut points, mut corners) = (Vec::new(), 0, 0.0);
        for piece in &self.pieces {
            let found = piece.array(array.section, &array.name);
            let differs = || self.invalid(&format!("a piece lacks the array `{}`", array.name));
            let mut values = piece.decode(found.ok_or_else(differs)?)?;
            match (array.section, array.name.as_str()) {
                (Section::FieldData, _) => return Ok(values),
                (Section::Cells, "connectivity") => {
                    values.iter_mut().for_each(|point| *point += points as f64)
                }
                (Section::Cells, "offsets") => {
                    values.iter_mut().for_each(|end| *end += corners);
                    corners = values.last().copied().unwrap_or(corners);
                }
                _ => {}
            }
            points += piece.points;
            all.extend(values);
        }
        let Some([point_order, cell_order]) = &self.order else { return Ok(all) };
        let order = match (array.section, array.name.as_str()) {
            // Corners follow one another in the order of the cells.
            (Section::Cells, "connectivity") => {
                return Ok((0..all.len()).map(|corner| corner as f64).collect());
            }
            (Section::Cells, "offsets") => return Ok(ends_in_order(&all, cell_order)),
            (Section::Points | Section::PointData, _) => point_order,
            _ => cell_order,
        };
        let n = array.components;
        if order.len() * n != all.len() {
            return Err(self.invalid(&format!("array `{}` differs between pieces", array.name)));
        }
        Ok(order.iter().flat_map(|place| &all[place * n..][..n]).copied().collect())
    }

    /// Coordinates of the points, [length].
    ///
    /// # Errors
    /// `InvalidData` if they are damaged.
    pub fn positions(&self) -> io::Result<Vec<[f64; 3]>> {
        let values = self.values(Section::Points, "Points")?;
        let (triples, rest) = values.as_chunks::<3>();
        if rest.is_empty() { Ok(triples.to_vec()) } else { Err(self.invalid("coordinates are not triples")) }
    }

    /// Indices of the points of every cell.
    ///
    /// # Errors
    /// `InvalidData` if they are damaged, or refer to points that do not exist.
    pub fn corners(&self) -> io::Result<Vec<Vec<usize>>> {
        let connectivity = self.values(Section::Cells, "connectivity")?;
        let ends = self.values(Section::Cells, "offsets")?;
        let n_points = self.points();
        let mut begin = 0;
        let mut cells = Vec::with_capacity(ends.len());
        for end in ends {
            let end = end as usize;
            let corners =
                connectivity.get(begin..end).ok_or_else(|| self.invalid("cells without corners"))?;
            if corners.iter().any(|corner| *corner < 0.0 || *corner as usize >= n_points) {
                return Err(self.invalid("a cell refers to a point that does not exist"));
            }
            cells.push(corners.iter().map(|corner| *corner as usize).collect());
            begin = end;
        }
        Ok(cells)
    }
}

/// The offsets (ends of the corner lists) of reordered cells, computed from the offsets in the current order.
fn ends_in_order(ends: &[f64], order: &[usize]) -> Vec<f64> {
    let size = |cell: usize| ends[cell] - if cell > 0 { ends[cell - 1] } else { 0.0 };
    let next = |end: &mut f64, cell: &usize| {
        *end += size(*cell);
        Some(*end)
    };
    order.iter().scan(0.0, next).collect()
}

#[cfg(test)]
mod tests {
    use super::super::blocks::BLOCK;
    use super::super::{BEGIN, CellKind, Field, Kinds, Mesh, Values, write};
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
        // Numbers of points whose coordinates fill blocks partly and exactly.
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

    /// A piece with a numbered quadrilateral around each of these positions on the x axis.
    fn piece(ids: &[i32], in_points: bool) -> super::super::File {
        let at = |id: &i32| {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x + 10.0 * f64::from(*id), y, 0.0])
        };
        let points: Vec<[f64; 3]> = if in_points {
            ids.iter().map(|id| at(id)[0]).collect()
        } else {
            ids.iter().flat_map(at).collect()
        };
        let kind = if in_points { CellKind::Vertex } else { CellKind::Quad };
        let connectivity: Vec<i64> = (0..points.len() as i64).collect();
        let mesh = Mesh { points: &points, kinds: Kinds::All(kind), connectivity: &connectivity };
        let id = Field { name: NUMBER, components: 1, component_names: &[], values: Values::Int32(ids) };
        let squares: Vec<f64> = ids.iter().flat_map(|id| [f64::from(*id), f64::from(id * id)]).collect();
        let values = Values::Float64(&squares);
        let square = Field { name: "square", components: 2, component_names: &["A", "B"], values };
        let (point_fields, cell_fields): (&[Field], &[Field]) =
            if in_points { (&[id, square], &[]) } else { (&[], &[id, square]) };
        super::super::file(0.5, 12, &mesh, point_fields, cell_fields).unwrap()
    }

    #[test]
    fn pieces_are_one_mesh_in_the_order_of_the_numbers() {
        for in_points in [true, false] {
            let directory = tempfile::tempdir().unwrap();
            let names: Vec<String> = (0..3).map(|rank| format!("mesh_r{rank}.vtu")).collect();
            // The rank in the middle has no points.
            let pieces = [&[4, 1][..], &[], &[0, 3, 2]].map(|ids| piece(ids, in_points));
            for (piece, name) in pieces.iter().zip(&names) {
                piece.write(&directory.path().join(name)).unwrap();
            }
            let list = directory.path().join("mesh.pvtu");
            super::super::Pieces::new(&pieces[0], &names).write(&list).unwrap();
            let whole = directory.path().join("mesh.vtu");
            piece(&[0, 1, 2, 3, 4], in_points).write(&whole).unwrap();
            let [read, whole] = [&list, &whole].map(|path| MeshFile::read(path).unwrap());
            assert_eq!((read.points(), read.cells()), (whole.points(), whole.cells()));
            assert_eq!(read.positions().unwrap(), whole.positions().unwrap());
            assert_eq!(read.corners().unwrap(), whole.corners().unwrap());
            let arrays = |file: &MeshFile| -> Vec<(String, Vec<f64>)> {
                file.pieces[0]
                    .arrays
                    .iter()
                    .map(|array| (array.name.clone(), file.decode(array).unwrap()))
                    .collect()
            };
            assert_eq!(arrays(&read), arrays(&whole));

            let text = std::fs::read(&list).unwrap();
            for end in 0..text.len() {
                std::fs::write(&list, &text[..end]).unwrap();
                assert!(MeshFile::read(&list).unwrap_err().to_string().contains("mesh.pvtu"), "{end}");
            }
            std::fs::write(&list, &text).unwrap();
            std::fs::remove_file(directory.path().join(&names[2])).unwrap();
            assert!(MeshFile::read(&list).is_err());
        }
    }

    /// All readable arrays of a file.
    fn all(path: &Path, bytes: &[u8]) -> io::Result<Vec<Vec<u64>>> {
        let read = MeshFile::from_bytes(path, bytes.to_vec())?;
        read.positions()?;
        read.corners()?;
        let bits = |numbers: Vec<f64>| numbers.iter().map(|x| x.to_bits()).collect();
        read.pieces[0].arrays.iter().map(|array| read.decode(array).map(bits)).collect()
    }

    #[test]
    fn a_file_that_is_cut_off_is_refused_wherever_it_ends() {
        let directory = tempfile::tempdir().unwrap();
        let path = file(directory.path(), 5);
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(all(&path, &bytes).unwrap().len(), 8);
        for end in 0..bytes.len() {
            let error = all(&path, &bytes[..end]).expect_err("the whole file is needed");
            assert!(error.to_string().contains("mesh.vtu"), "{end}: {error}");
        }
    }

    #[test]
    fn files_of_earlier_versions_are_refused_as_such() {
        let text = r#"<?xml version="1.0"?><VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="UInt64"
            compressor="vtkZLibDataCompressor"><UnstructuredGrid><FieldData><DataArray type="Float64" Name="TimeValue"
            format="binary">AAAA</DataArray></FieldData></UnstructuredGrid></VTKFile>"#;
        let error = all(Path::new("old.vtu"), text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("old.vtu: it was written by an earlier version"), "{error}");
    }

    #[test]
    fn a_damaged_file_is_read_or_refused_but_never_a_panic() {
        let directory = tempfile::tempdir().unwrap();
        let path = file(directory.path(), 5);
        let good = std::fs::read(&path).unwrap();
        let numbers = all(&path, &good).unwrap();
        let data = good.windows(BEGIN.len()).position(|window| window == BEGIN.as_bytes()).unwrap();
        let mut refused = 0;
        for place in 0..good.len() {
            for other in [b'A', b'9', b'"', b'<', 0, 255] {
                let mut bytes = good.clone();
                bytes[place] = other;
                match all(&path, &bytes) {
                    Ok(read) => assert!(place < data || read == numbers, "{place}: other numbers"),
                    Err(_) => refused += 1,
                }
            }
        }
        // Some bytes have no meaning, and some changes restore the same byte.
        assert!(refused > 4 * good.len(), "{refused} of {}", 6 * good.len());
    }
}
