//! Reader of gmsh mesh files, formats 2 (2.0, 2.1, 2.2), 4.0 and 4.1, text and binary.
//!
//! Elements of a higher order are read by their corners. Physical groups come from the tags of the elements (2) or of
//! their entities (4). Partitions are ignored: the elements of all parts are those of one mesh. Sections other than
//! nodes, elements, entities and groups are skipped.

mod elements;
mod entities;
mod entity;
mod error;
mod kinds;
mod names;
mod nodes;
mod reader;
mod version;

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use crate::input_file;
use elements::Elements;
use entity::{EntityGroups, GroupKey};
use error::{MAX_BYTES, MAX_GROUPS};
use names::GroupNames;
use nodes::Nodes;
use reader::{Encoding, Reader};
use version::Version;

pub use elements::Straightened;
pub use entity::{Element, PhysicalGroup};
pub use error::{FileLocation, GmshError};
pub use kinds::ElementKind;

/// Some editors write this before a text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The contents of a gmsh mesh file.
#[derive(Debug, Clone, PartialEq)]
pub struct GmshFile {
    /// Positions of the nodes, [length]; all are finite.
    pub nodes: Vec<[f64; 3]>,
    /// Node numbers in the file; each is unique.
    pub node_tags: Vec<u64>,
    /// Elements of all dimensions, in file order.
    pub elements: Vec<Element>,
    /// Physical groups, sorted by dimension and tag.
    pub groups: Vec<PhysicalGroup>,
    /// What was lost by reading elements of a higher order by their corners; `None` if all are of the first order.
    pub straightened: Option<Straightened>,
    /// Distinct sets of groups of the elements; see [`GmshFile::groups_of`].
    group_sets: Vec<Vec<u32>>,
}

/// Reads a mesh file.
///
/// # Errors
/// [`GmshError::File`] if the file cannot be read; otherwise the same as for [`read`].
pub fn read_file(path: &Path) -> Result<GmshFile, GmshError> {
    read(&input_file::read(path, MAX_BYTES)?)
}

/// Reads a mesh from the bytes of a file. Time and memory are proportional to the number of bytes, whatever the
/// contents.
///
/// # Errors
/// Any [`GmshError`] about the contents.
pub fn read(bytes: &[u8]) -> Result<GmshFile, GmshError> {
    let mut reader = Reader::new(bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes));
    let mut sections = Sections::default();
    while let Some(section) = reader.section().map_err(|e| sections.explain(e))? {
        sections.read(&mut reader, section).map_err(|e| sections.explain(e))?;
    }
    if sections.version.is_none() {
        return Err(GmshError::NotGmsh);
    }
    match (sections.nodes, sections.elements) {
        (None, _) => {
            Err(GmshError::Truncated { location: reader.location(), expected: "a section `$Nodes`" })
        }
        (_, None) => {
            Err(GmshError::Truncated { location: reader.location(), expected: "a section `$Elements`" })
        }
        (Some(nodes), Some(elements)) => assemble(nodes, elements, sections.names),
    }
}

/// Sections read so far.
#[derive(Default)]
struct Sections {
    version: Option<Version>,
    names: GroupNames,
    entities: EntityGroups,
    nodes: Option<Nodes>,
    elements: Option<Elements>,
}

impl Sections {
    /// Before the format is known, any error means that the file is not a gmsh file.
    fn explain(&self, error: GmshError) -> GmshError {
        match error {
            GmshError::Version { .. } => error,
            _ if self.version.is_none() => GmshError::NotGmsh,
            _ => error,
        }
    }

    /// Reads or skips one section; its header has just been read.
    fn read(&mut self, reader: &mut Reader<'_>, section: &str) -> Result<(), GmshError> {
        let Some(version) = self.version else {
            match section {
                "MeshFormat" => self.version = Some(format(reader)?),
                "NOD" => return Err(GmshError::Version { version: "1".into() }),
                _ => reader.skip(section)?,
            }
            return Ok(());
        };
        match (section, version) {
            ("PhysicalNames", _) => self.names = names::read(reader)?,
            ("Entities", Version::V40 | Version::V41) => {
                entities::read(reader, version, false, &mut self.entities)?;
            }
            ("PartitionedEntities", Version::V40 | Version::V41) => {
                entities::read(reader, version, true, &mut self.entities)?;
            }
            ("Nodes" | "ParametricNodes", _) => {
                reader.require(self.nodes.is_none(), "only one section of nodes", "a second one")?;
                self.nodes = Some(match version {
                    Version::V2 => nodes::read_2(reader, section == "ParametricNodes")?,
                    Version::V40 => nodes::read_40(reader)?,
                    Version::V41 => nodes::read_41(reader)?,
                });
            }
            ("Elements", _) => {
                reader.require(self.elements.is_none(), "only one section of elements", "a second one")?;
                let Some(nodes) = &self.nodes else {
                    return reader.require(false, "the nodes before the elements", "the elements first");
                };
                self.elements = Some(match version {
                    Version::V2 => elements::read_2(reader, nodes)?,
                    Version::V40 | Version::V41 => elements::read_4(reader, version, nodes, &self.entities)?,
                });
            }
            _ => return reader.skip(section),
        }
        reader.end(section)
    }
}

/// Reads `$MeshFormat`, which states the version and encoding of the other sections.
fn format(reader: &mut Reader<'_>) -> Result<Version, GmshError> {
    let stated = reader.token("a version")?;
    let version = match stated {
        "2" | "2.0" | "2.1" | "2.2" => Version::V2,
        "4" | "4.0" => Version::V40,
        "4.1" => Version::V41,
        _ if stated.parse::<f64>().is_ok() => {
            return Err(GmshError::Version { version: stated.chars().take(20).collect() });
        }
        _ => return Err(GmshError::NotGmsh),
    };
    let binary = reader.text::<u8>("0 or 1")?;
    let word = reader.text::<u8>("the size of a number")?;
    if binary > 1 || word != 8 {
        return Err(GmshError::Version { version: format!("{stated} (type {binary}, size {word})") });
    }
    if binary == 1 {
        reader.end_of_line()?;
        reader.encoding = match reader.take::<4>("the byte order")? {
            [1, 0, 0, 0] => Encoding::Little,
            [0, 0, 0, 1] => Encoding::Big,
            _ => return Err(GmshError::NotGmsh),
        };
    }
    reader.end("MeshFormat")?;
    Ok(version)
}

/// Numbers the groups and replaces the groups of the elements by their numbers.
fn assemble(nodes: Nodes, elements: Elements, names: GroupNames) -> Result<GmshFile, GmshError> {
    if !elements.unsupported.is_empty() {
        return Err(GmshError::Unsupported { kinds: elements.unsupported.into_iter().collect() });
    }
    if let Some(set) = elements.group_sets.iter().find(|set| set.len() > MAX_GROUPS) {
        return Err(GmshError::TooManyGroups { count: set.len() });
    }
    let mut keys: BTreeSet<GroupKey> = elements.group_sets.iter().flatten().copied().collect();
    let mut names = names.by_group(&keys);
    keys.extend(names.keys());
    let number: HashMap<GroupKey, u32> = keys.iter().copied().zip(0..).collect();
    let group_sets =
        elements.group_sets.iter().map(|set| set.iter().map(|key| number[key]).collect()).collect();
    let groups = keys
        .into_iter()
        .map(|(dimension, tag)| {
            let name = names.remove(&(dimension, tag)).unwrap_or_else(|| tag.to_string());
            PhysicalGroup { dimension, tag, name }
        })
        .collect();
    Ok(GmshFile {
        nodes: nodes.positions,
        node_tags: nodes.tags,
        elements: elements.elements,
        groups,
        straightened: elements.straightened,
        group_sets,
    })
}

impl GmshFile {
    /// The groups of an element: indices into [`GmshFile::groups`], ascending.
    pub fn groups_of(&self, element: &Element) -> &[u32] {
        &self.group_sets[element.group_set as usize]
    }
}
