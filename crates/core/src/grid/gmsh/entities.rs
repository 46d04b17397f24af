//! The entities of a geometry, which carry the physical groups in formats 4.0 and 4.1.

use super::entity::EntityGroups;
use super::error::{GmshError, MAX_GROUPS};
use super::reader::Reader;
use super::version::Version;

/// Reads the physical groups of the entities, or of the parts into which a partition divides them. A part belongs to
/// the groups of its entity, too, if it has its dimension.
pub(super) fn read(
    reader: &mut Reader<'_>,
    version: Version,
    parts: bool,
    all: &mut EntityGroups,
) -> Result<(), GmshError> {
    if parts {
        reader.size("the number of partitions")?;
        let n = reader.size("the number of ghost entities")?;
        for _ in 0..reader.count_of(n, "ghost entities", 2)? {
            reader.int("the number of a ghost entity")?;
            reader.int("a partition")?;
        }
    }
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = reader.size("the number of entities")?;
    }
    for (dimension, count) in (0u8..).zip(counts) {
        for _ in 0..reader.count_of(count, "entities", 4)? {
            let tag = reader.int("an entity number")?;
            let whole = if parts { Some(whole(reader)?) } else { None };
            // Format 4.1 states the position of a point, format 4.0 its bounds.
            for _ in 0..if dimension == 0 && version == Version::V41 { 3 } else { 6 } {
                reader.real("a coordinate")?;
            }
            let n = reader.size("the number of physical tags")?;
            let mut groups = Vec::new();
            for _ in 0..reader.count_of(n, "physical tags", 1)? {
                // A negative tag means reversed orientation.
                groups.push((dimension, reader.int("a physical tag")?.unsigned_abs()));
            }
            if dimension > 0 {
                let n = reader.size("the number of bounding entities")?;
                for _ in 0..reader.count_of(n, "bounding entities", 1)? {
                    reader.int("an entity number")?;
                }
            }
            if let Some(whole) = whole.filter(|whole| whole.0 == i32::from(dimension)) {
                groups.extend(all.get(&(dimension, whole.1)).into_iter().flatten());
            }
            groups.sort_unstable();
            groups.dedup();
            if groups.len() > MAX_GROUPS {
                return Err(GmshError::TooManyGroups { count: groups.len() });
            }
            all.insert((dimension, tag), groups);
        }
    }
    Ok(())
}

/// Reads the dimension and number of the entity that a part divides, and skips the partitions of the part.
fn whole(reader: &mut Reader<'_>) -> Result<(i32, i32), GmshError> {
    let whole = (reader.int("an entity dimension")?, reader.int("an entity number")?);
    let n = reader.size("the number of partitions")?;
    for _ in 0..reader.count_of(n, "partitions", 1)? {
        reader.int("a partition")?;
    }
    Ok(whole)
}
