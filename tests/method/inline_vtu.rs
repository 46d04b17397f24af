//! Converts VTU files for the independent reader `vtkio`, which in version 0.7.0-rc2 cannot read appended binary
//! arrays: arrays are rewritten as inline text.

#![allow(clippy::unwrap_used, dead_code)]

use std::path::Path;
use std::{fs, io};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use vtkio::Vtk;
use vtkio::model::{DataSet, Piece, UnstructuredGridPiece};

/// Reads the only piece of a file.
pub fn read(path: &Path) -> UnstructuredGridPiece {
    let vtk = Vtk::parse_xml(io::Cursor::new(inline(path))).unwrap();
    let DataSet::UnstructuredGrid { mut pieces, .. } = vtk.data else { panic!("not an unstructured grid") };
    assert_eq!(pieces.len(), 1);
    match pieces.remove(0) {
        Piece::Inline(piece) => *piece,
        _ => panic!("the piece is not in the file"),
    }
}

/// The XML of a file, and the appended bytes.
pub fn parts(path: &Path) -> (String, Vec<u8>) {
    let bytes = fs::read(path).unwrap();
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let begin = bytes.windows(mark.len()).position(|window| window == mark).unwrap();
    let end = bytes.strip_suffix(b"\n</AppendedData>\n</VTKFile>\n").unwrap().len();
    (String::from_utf8(bytes[..begin].to_vec()).unwrap(), bytes[begin + mark.len()..end].to_vec())
}

/// A file with its arrays inline, as text.
fn inline(path: &Path) -> String {
    let (text, data) = parts(path);
    let mut pieces = text.split(r#"format="appended" offset=""#);
    let mut inline = pieces.next().unwrap().to_owned();
    for piece in pieces {
        let (offset, rest) = piece.split_once("\"/>").unwrap();
        let array = &data[offset.parse::<usize>().unwrap()..];
        let word = |i: usize| u64::from_le_bytes(array[8 * i..8 * i + 8].try_into().unwrap()) as usize;
        let table = 8 * (3 + word(0));
        let blocks: usize = (0..word(0)).map(|block| word(3 + block)).sum();
        let [table, blocks] =
            [&array[..table], &array[table..table + blocks]].map(|bytes| STANDARD.encode(bytes));
        inline += &format!("format=\"binary\">{table}{blocks}</DataArray>{rest}");
    }
    inline + "</VTKFile>"
}
