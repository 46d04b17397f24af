//! The nodes of a mesh file.

use super::error::GmshError;
use super::reader::{Encoding, Reader};
use super::version::Version;

/// Marks a number that no node has.
const NONE: u32 = u32::MAX;

/// Node positions and the map from node numbers in the file to indices.
pub(super) struct Nodes {
    pub(super) positions: Vec<[f64; 3]>,
    /// Node numbers in the file.
    pub(super) tags: Vec<u64>,
    index: Index,
}

/// Map from node numbers in the file to indices.
enum Index {
    /// The lowest number, and a table indexed by the difference from it.
    Dense(u64, Vec<u32>),
    /// Pairs of number and index, ascending.
    Sparse(Vec<(u64, u32)>),
}

impl Nodes {
    fn new(positions: Vec<[f64; 3]>, tags: Vec<u64>) -> Result<Self, GmshError> {
        let low = tags.iter().copied().min().unwrap_or(0);
        let range = tags.iter().copied().max().unwrap_or(0) - low;
        let index = if range < 4 * tags.len() as u64 {
            let mut dense = vec![NONE; range as usize + 1];
            for (&node, order) in tags.iter().zip(0..) {
                let entry = &mut dense[(node - low) as usize];
                if *entry != NONE {
                    return Err(GmshError::DuplicateNode { node });
                }
                *entry = order;
            }
            Index::Dense(low, dense)
        } else {
            let mut sparse: Vec<(u64, u32)> = tags.iter().copied().zip(0..).collect();
            sparse.sort_unstable();
            if let Some(pair) = sparse.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                return Err(GmshError::DuplicateNode { node: pair[0].0 });
            }
            Index::Sparse(sparse)
        };
        Ok(Nodes { positions, tags, index })
    }

    /// Index of the node with this number in the file.
    pub(super) fn find(&self, tag: u64) -> Option<u32> {
        match &self.index {
            Index::Dense(low, dense) => {
                let offset = usize::try_from(tag.checked_sub(*low)?).ok()?;
                dense.get(offset).copied().filter(|node| *node != NONE)
            }
            Index::Sparse(sparse) => {
                sparse.binary_search_by_key(&tag, |entry| entry.0).ok().map(|k| sparse[k].1)
            }
        }
    }
}

fn position(reader: &mut Reader<'_>, node: u64) -> Result<[f64; 3], GmshError> {
    let mut x = [0.0; 3];
    for x in &mut x {
        *x = reader.real("a coordinate")?;
    }
    if x.iter().all(|x| x.is_finite()) {
        Ok(x)
    } else {
        Err(GmshError::NonFinite { location: reader.location(), node })
    }
}

/// Reads `$Nodes` or `$ParametricNodes` of format 2.
pub(super) fn read_2(reader: &mut Reader<'_>, parametric: bool) -> Result<Nodes, GmshError> {
    let n = total_2(reader, "nodes", 4)?;
    let mut positions = Vec::with_capacity(n);
    let mut tags = Vec::with_capacity(n);
    for _ in 0..n {
        let tag = reader.natural("a node number")?;
        positions.push(position(reader, tag)?);
        tags.push(tag);
        if parametric {
            let dimension = reader.natural("an entity dimension")?;
            reader.int("an entity number")?;
            // Nodes on points have no parameters, nor do nodes in volumes, whose parameters would be the coordinates.
            for _ in 0..if dimension < 3 { dimension } else { 0 } {
                reader.real("a parameter")?;
            }
        }
    }
    Nodes::new(positions, tags)
}

/// Reads the number of nodes or elements at the start of a section of format 2; it is text even in binary files.
pub(super) fn total_2(
    reader: &mut Reader<'_>,
    what: &'static str,
    numbers: usize,
) -> Result<usize, GmshError> {
    let n = reader.text::<u64>("the number of nodes or elements")?;
    let n = reader.count_of(n, what, numbers)?;
    if reader.encoding != Encoding::Text {
        reader.end_of_line()?;
    }
    Ok(n)
}

/// Reads the header of `$Nodes` or `$Elements` of format 4: the number of blocks and the total number of items.
pub(super) fn totals_4(
    reader: &mut Reader<'_>,
    version: Version,
    what: &'static str,
) -> Result<(usize, usize), GmshError> {
    let blocks = reader.size("the number of blocks")?;
    let total = reader.size("the number of nodes or elements")?;
    if version == Version::V41 {
        reader.size("the lowest number")?;
        reader.size("the highest number")?;
    }
    Ok((reader.count_of(blocks, "blocks", 4)?, reader.count_of(total, what, 1)?))
}

/// Reads `$Nodes` of format 4.1.
pub(super) fn read_41(reader: &mut Reader<'_>) -> Result<Nodes, GmshError> {
    let (blocks, total) = totals_4(reader, Version::V41, "nodes")?;
    let mut positions = Vec::new();
    let mut tags = Vec::new();
    for _ in 0..blocks {
        let dimension = reader.natural("an entity dimension")?;
        reader.require(dimension <= 3, "a dimension from 0 to 3", format_args!("`{dimension}`"))?;
        reader.int("an entity number")?;
        let parameters = if reader.int("0 or 1")? == 0 { 0 } else { dimension };
        let n = reader.size("the number of nodes")?;
        let n = reader.count_of(n, "nodes", 4)?;
        let first = tags.len();
        for _ in 0..n {
            tags.push(reader.size("a node number")?);
        }
        for tag in &tags[first..] {
            positions.push(position(reader, *tag)?);
            for _ in 0..parameters {
                reader.real("a parameter")?;
            }
        }
    }
    if tags.len() != total {
        return Err(GmshError::Total { location: reader.location(), what: "nodes", declared: total });
    }
    Nodes::new(positions, tags)
}

/// Reads `$Nodes` of format 4.0, in which each number precedes its position.
pub(super) fn read_40(reader: &mut Reader<'_>) -> Result<Nodes, GmshError> {
    let (blocks, total) = totals_4(reader, Version::V40, "nodes")?;
    let mut positions = Vec::new();
    let mut tags = Vec::new();
    for _ in 0..blocks {
        reader.int("an entity number")?;
        let dimension = reader.natural("an entity dimension")?;
        reader.require(dimension <= 3, "a dimension from 0 to 3", format_args!("`{dimension}`"))?;
        let parameters = if reader.int("0 or 1")? == 0 { 0 } else { dimension };
        let n = reader.size("the number of nodes")?;
        for _ in 0..reader.count_of(n, "nodes", 4)? {
            let tag = reader.natural("a node number")?;
            positions.push(position(reader, tag)?);
            tags.push(tag);
            for _ in 0..parameters {
                reader.real("a parameter")?;
            }
        }
    }
    if tags.len() != total {
        return Err(GmshError::Total { location: reader.location(), what: "nodes", declared: total });
    }
    Nodes::new(positions, tags)
}
