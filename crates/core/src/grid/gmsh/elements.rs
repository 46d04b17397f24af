//! The elements of a mesh file.

use std::collections::{BTreeMap, HashMap};

use super::entity::{Element, EntityGroups, GroupKey};
use super::error::GmshError;
use super::kinds::{ElementKind, MOST_NODES, name_and_nodes};
use super::nodes::{Nodes, total_2, totals_4};
use super::reader::{Encoding, Reader};
use super::version::Version;

/// Elements and their distinct sets of groups.
#[derive(Default)]
pub(super) struct Elements {
    pub(super) elements: Vec<Element>,
    pub(super) group_sets: Vec<Vec<GroupKey>>,
    /// Name in gmsh and number of elements of each unsupported type.
    pub(super) unsupported: BTreeMap<&'static str, usize>,
    /// What reading by the corners lost.
    pub(super) straightened: Option<Straightened>,
}

/// What was lost by reading elements of a higher order by their corners.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Straightened {
    /// Name in gmsh and number of elements of each such type.
    pub kinds: Vec<(&'static str, usize)>,
    /// Largest distance of a node of an edge of the second order from the middle of its edge, [length].
    pub farthest: f64,
    /// Its ratio to the length of that edge, [-].
    pub relative: f64,
    /// Whether elements of an order above the second are among them, whose distance is unknown.
    pub unknown: bool,
}

impl Straightened {
    fn add(&mut self, nodes: &Nodes, kind: Type, members: &[u32]) {
        match self.kinds.iter_mut().find(|(name, _)| *name == kind.name) {
            Some((_, n)) => *n += 1,
            None => self.kinds.push((kind.name, 1)),
        }
        let Some(edges) = kind.kind.filter(|kind| kind.has_middles(members.len())).map(ElementKind::edges)
        else {
            self.unknown = true;
            return;
        };
        let corners = kind.kind.map_or(0, ElementKind::n_nodes);
        for (ends, middle) in edges.iter().zip(&members[corners..]) {
            let [a, b] = ends.map(|k| nodes.positions[members[k] as usize]);
            let x = nodes.positions[*middle as usize];
            let square = |of: &dyn Fn(usize) -> f64| (0..3).map(|d| of(d) * of(d)).sum::<f64>().sqrt();
            let distance = square(&|d| x[d] - 0.5 * (a[d] + b[d]));
            if distance > self.farthest {
                self.farthest = distance;
                self.relative = distance / square(&|d| b[d] - a[d]);
            }
        }
    }
}

/// An element type; its kind is `None` if the type is not supported.
#[derive(Clone, Copy)]
struct Type {
    kind: Option<ElementKind>,
    name: &'static str,
    n_nodes: usize,
}

impl Type {
    fn read(reader: &mut Reader<'_>) -> Result<Type, GmshError> {
        let code = reader.int("an element type")?;
        match name_and_nodes(code) {
            Some((name, n_nodes)) => Ok(Type { kind: ElementKind::from_code(code), name, n_nodes }),
            None => Err(GmshError::UnknownType { location: reader.location(), code }),
        }
    }
}

impl Elements {
    /// Reads the nodes of an element; `number` reads one node number. The element is `None` if its type is not
    /// supported.
    fn nodes(
        &mut self,
        reader: &mut Reader<'_>,
        nodes: &Nodes,
        kind: Type,
        tag: u64,
        mut number: impl FnMut(&mut Reader<'_>) -> Result<u64, GmshError>,
    ) -> Result<Option<Element>, GmshError> {
        let Some(usable) = kind.kind else {
            for _ in 0..kind.n_nodes {
                number(reader)?;
            }
            *self.unsupported.entry(kind.name).or_default() += 1;
            return Ok(None);
        };
        let mut members = [0; MOST_NODES];
        let members = &mut members[..kind.n_nodes];
        for entry in &mut *members {
            let node = number(reader)?;
            let location = || reader.location();
            *entry = nodes.find(node).ok_or_else(|| GmshError::UnknownNode {
                location: location(),
                element: tag,
                node,
            })?;
        }
        let corners = usable.n_nodes();
        if members.len() > corners {
            self.straightened.get_or_insert_default().add(nodes, kind, members);
        }
        let mut element = Element { tag, kind: usable, nodes: [0; 8], group_set: 0 };
        element.nodes[..corners].copy_from_slice(&members[..corners]);
        Ok(Some(element))
    }
}

/// Reads `$Elements` of format 4.
pub(super) fn read_4(
    reader: &mut Reader<'_>,
    version: Version,
    nodes: &Nodes,
    entities: &EntityGroups,
) -> Result<Elements, GmshError> {
    let (blocks, total) = totals_4(reader, version, "elements")?;
    let mut all = Elements::default();
    let mut sets = SetNumbers::default();
    let mut found = 0;
    for _ in 0..blocks {
        let first = reader.int("an entity dimension or number")?;
        let second = reader.int("an entity number or dimension")?;
        let (dimension, entity) = if version == Version::V40 { (second, first) } else { (first, second) };
        let kind = Type::read(reader)?;
        let n = reader.size("the number of elements")?;
        let n = reader.count_of(n, "elements", 1 + kind.n_nodes)?;
        let key = u8::try_from(dimension).map(|d| (d, entity));
        let groups = key.ok().and_then(|key| entities.get(&key)).map_or(&[][..], |groups| groups);
        let group_set = sets.number(groups);
        // Format 4.0 writes the numbers of elements and nodes as signed integers.
        let number = |reader: &mut Reader<'_>, expected| match version {
            Version::V40 => reader.natural(expected),
            _ => reader.size(expected),
        };
        for _ in 0..n {
            let tag = number(reader, "an element number")?;
            let element = all.nodes(reader, nodes, kind, tag, |r| number(r, "a node number"))?;
            all.elements.extend(element.map(|element| Element { group_set, ..element }));
        }
        found += n;
    }
    if found != total {
        return Err(GmshError::Total { location: reader.location(), what: "elements", declared: total });
    }
    all.group_sets = sets.in_order();
    Ok(all)
}

/// Reads `$Elements` of format 2.
///
/// The format stores one group per element; gmsh repeats elements that belong to several groups. Elements with the same
/// nodes are merged.
pub(super) fn read_2(reader: &mut Reader<'_>, nodes: &Nodes) -> Result<Elements, GmshError> {
    let n = total_2(reader, "elements", 3)?;
    let mut all = Elements::default();
    let mut known: HashMap<(ElementKind, [u32; 8]), u32> = HashMap::new();
    let mut memberships: Vec<(u32, GroupKey)> = Vec::new();
    let mut found = 0;
    while found < n {
        let block = Block::read(reader)?;
        for _ in 0..block.n {
            let (kind, tag, group) = block.head(reader)?;
            let element = all.nodes(reader, nodes, kind, tag, |r| r.natural("a node number"))?;
            let Some(element) = element else { continue };
            let next = all.elements.len() as u32;
            let number = *known.entry((element.kind, element.nodes)).or_insert(next);
            if number == next {
                all.elements.push(element);
            }
            if group != 0 {
                memberships.push((number, (element.kind.dimension(), group)));
            }
        }
        found += block.n;
    }
    if found != n {
        return Err(GmshError::Total { location: reader.location(), what: "elements", declared: n });
    }
    all.set_groups(memberships);
    Ok(all)
}

/// A block of elements in format 2: a single element in a text file, several elements of one type in a binary file.
struct Block {
    /// Type and number of tags, if they precede the elements.
    common: Option<(Type, u64)>,
    n: usize,
}

impl Block {
    fn read(reader: &mut Reader<'_>) -> Result<Block, GmshError> {
        if reader.encoding == Encoding::Text {
            return Ok(Block { common: None, n: 1 });
        }
        let kind = Type::read(reader)?;
        let n = reader.natural("the number of elements")?;
        let n_tags = reader.natural("the number of tags")?;
        Ok(Block { common: Some((kind, n_tags)), n: reader.count_of(n, "elements", 1 + kind.n_nodes)? })
    }

    /// Reads the data before the nodes of an element: type, number and physical group (0 for none).
    fn head(&self, reader: &mut Reader<'_>) -> Result<(Type, u64, u32), GmshError> {
        let number = reader.natural("an element number")?;
        let (kind, n_tags) = match self.common {
            Some(common) => common,
            None => (Type::read(reader)?, reader.natural("the number of tags")?),
        };
        let mut group = 0;
        for k in 0..n_tags {
            let tag = reader.int("a tag")?;
            if k == 0 {
                group = tag.unsigned_abs(); // a negative tag means reversed orientation
            }
        }
        Ok((kind, number, group))
    }
}

impl Elements {
    /// Assigns to every element its set of groups, from pairs of element and group.
    fn set_groups(&mut self, mut memberships: Vec<(u32, GroupKey)>) {
        memberships.sort_unstable();
        memberships.dedup();
        let mut sets = SetNumbers::default();
        let mut rest = &memberships[..];
        let mut groups = Vec::new();
        for (element, number) in self.elements.iter_mut().zip(0..) {
            let n = rest.iter().take_while(|(e, _)| *e == number).count();
            groups.clear();
            groups.extend(rest[..n].iter().map(|(_, group)| *group));
            element.group_set = sets.number(&groups);
            rest = &rest[n..];
        }
        self.group_sets = sets.in_order();
    }
}

/// Numbers of the distinct sets of groups.
#[derive(Default)]
struct SetNumbers(HashMap<Vec<GroupKey>, u32>);

impl SetNumbers {
    fn number(&mut self, groups: &[GroupKey]) -> u32 {
        if let Some(number) = self.0.get(groups) {
            return *number;
        }
        let number = self.0.len() as u32;
        self.0.insert(groups.to_vec(), number);
        number
    }

    fn in_order(self) -> Vec<Vec<GroupKey>> {
        let mut sets: Vec<_> = self.0.into_iter().collect();
        sets.sort_unstable_by_key(|(_, number)| *number);
        sets.into_iter().map(|(groups, _)| groups).collect()
    }
}
