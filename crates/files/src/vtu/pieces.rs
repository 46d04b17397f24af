//! Meshes in pieces (`.pvtu`): a file that names the files of the pieces. Each piece was written by one rank of a run.

use std::io;
use std::path::{Path, PathBuf};

use quick_xml::XmlVersion;
use quick_xml::events::Event;

use super::{Encoded, File, Line};
use crate::escape_xml;
use crate::replace::replace_file;

/// File-name extension of a mesh that is divided into several files.
pub const EXTENSION: &str = "pvtu";

/// First bytes of every file.
pub const HEAD: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<VTKFile type="PUnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64""#,
    r#" compressor="vtkZLibDataCompressor">"#,
    "\n"
);

/// A mesh in pieces that have the same arrays.
pub struct Pieces(String);

impl Pieces {
    /// Pieces with the arrays of `file`, in files with these names beside the list.
    pub fn new(file: &File, names: &[String]) -> Pieces {
        let mut text = String::from(HEAD);
        text += "<PUnstructuredGrid GhostLevel=\"0\">\n";
        let sections = [("<Points>", "PPoints"), ("<PointData>", "PPointData"), ("<CellData>", "PCellData")];
        for (begin, section) in sections {
            text += &format!("<{section}>\n");
            for Encoded { kind, attributes, .. } in file.arrays_after(begin) {
                text += &format!("<PDataArray type=\"{kind}\" {attributes}/>\n");
            }
            text += &format!("</{section}>\n");
        }
        for name in names {
            text += &format!("<Piece Source=\"{}\"/>\n", escape_xml(name));
        }
        text += "</PUnstructuredGrid>\n</VTKFile>\n";
        Pieces(text)
    }

    /// Writes the list, which appears under its name only when it is complete.
    ///
    /// # Errors
    /// A file-system error.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        replace_file(path, |out| out.write_all(self.0.as_bytes()))
    }
}

impl File {
    /// The arrays of the section that begins with this tag.
    fn arrays_after(&self, begin: &str) -> impl Iterator<Item = &Encoded> {
        let has_begun = move |line: &&Line| !matches!(line, Line::Tag(tag) if tag.ends_with(begin));
        self.lines.iter().skip_while(has_begun).skip(1).map_while(Line::array)
    }
}

/// Paths of the files that a list with this text names; they lie beside it, in `directory`.
///
/// # Errors
/// A message if the text is cut off or is not a list of pieces.
pub(super) fn names(text: &str, directory: &Path) -> Result<Vec<PathBuf>, String> {
    if !text.starts_with(HEAD) {
        return Err("not a list of pieces written by this program".to_owned());
    }
    let mut reader = quick_xml::Reader::from_str(text);
    let mut names = Vec::new();
    loop {
        match reader.read_event().map_err(|error| format!("cut off or not XML: {error}"))? {
            Event::Start(tag) | Event::Empty(tag) if tag.name().as_ref() == "Piece" => {
                let source = tag.try_get_attribute("Source").ok().flatten();
                let source = source.and_then(|source| source.normalized_value(XmlVersion::Implicit1_0).ok());
                names.push(directory.join(&*source.ok_or("a piece has no file")?));
            }
            Event::Eof if text.ends_with("</VTKFile>\n") => return Ok(names),
            Event::Eof => return Err("the file is cut off".to_owned()),
            _ => {}
        }
    }
}
