//! The names of physical groups.

use std::collections::{BTreeMap, BTreeSet};

use super::entity::GroupKey;
use super::error::GmshError;
use super::reader::Reader;

/// Names of physical groups. Files of format 2.0 state no dimension: such a name holds for the groups of all dimensions
/// that have this number.
#[derive(Default)]
pub(super) struct GroupNames {
    by_key: BTreeMap<GroupKey, String>,
    by_tag: BTreeMap<u32, String>,
}

impl GroupNames {
    /// The names of all groups; `used` are the groups that elements have.
    pub(super) fn by_group(self, used: &BTreeSet<GroupKey>) -> BTreeMap<GroupKey, String> {
        let mut names = self.by_key;
        for key in used {
            if let Some(name) = self.by_tag.get(&key.1) {
                names.entry(*key).or_insert_with(|| name.clone());
            }
        }
        names
    }
}

/// Reads the names of the physical groups, which are text in all formats.
pub(super) fn read(reader: &mut Reader<'_>) -> Result<GroupNames, GmshError> {
    let n = reader.text::<u64>("the number of names")?;
    let n = reader.bounded(n, "names", 5)?;
    let mut names = GroupNames::default();
    for _ in 0..n {
        let first = reader.text::<i32>("a group dimension")?;
        if reader.is_quoted() {
            let name = reader.quoted("a group name in quotes")?;
            names.by_tag.insert(first.unsigned_abs(), name);
            continue;
        }
        let dimension = u8::try_from(first).ok().filter(|dimension| *dimension <= 3);
        let Some(dimension) = dimension else {
            reader.require(false, "a dimension from 0 to 3", format_args!("`{first}`"))?;
            continue;
        };
        let tag = reader.text::<i32>("a group tag")?.unsigned_abs();
        let name = reader.quoted("a group name in quotes")?;
        if !name.is_empty() {
            names.by_key.insert((dimension, tag), name);
        }
    }
    Ok(names)
}
