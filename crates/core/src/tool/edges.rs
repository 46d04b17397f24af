//! Positions on the sharp corners and edges of a tool.

use std::collections::BTreeMap;

use super::shape::Shape;
use crate::region::vector::{dot, norm};
use crate::region::{Facet, area_vector};

/// Cosine of the angle between the normals of two facets at a corner below which the corner is sharp, [-].
const SHARP: f64 = 0.87;

/// Positions on the sharp corners of a plane shape, or on the sharp edges of a shape in space at a distance of at most
/// `spacing`, in the frame of the tool, [length]; none of a shape that extends to infinity or is too large for
/// `spacing`.
pub fn sharp_positions<const D: usize>(shape: &dyn Shape<D>, spacing: f64) -> Vec<[f64; D]> {
    let Ok(outline) = shape.outline(spacing) else { return Vec::new() };
    let normal = |facet: &[u32; D]| {
        let corners = facet.map(|corner| outline.vertices[corner as usize]);
        let area = area_vector(&Facet { corners, side: 0 }.corners);
        let size = norm(&area);
        if size > 0.0 { area.map(|a| a / size) } else { area }
    };
    let mut around: BTreeMap<u32, Vec<[f64; D]>> = BTreeMap::new();
    for facet in &outline.facets {
        facet.iter().for_each(|corner| around.entry(*corner).or_default().push(normal(facet)));
    }
    let is_sharp = |normals: &[[f64; D]]| {
        let mut pairs = (1..normals.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
        normals.len() == 1 || pairs.any(|[a, b]| dot(&normals[a], &normals[b]) < SHARP)
    };
    let sharp = around.into_iter().filter(|(_, normals)| is_sharp(normals));
    sharp.map(|(corner, _)| outline.vertices[corner as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::{Ball, Brick};
    use crate::tool::HalfSpace;

    #[test]
    fn only_sharp_corners_and_edges_have_positions() {
        let square = Brick::new([0.0; 2], [1.0, 2.0]).unwrap();
        let mut found = sharp_positions(&square, 0.3);
        found.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(found, [[0.0, 0.0], [0.0, 2.0], [1.0, 0.0], [1.0, 2.0]]);
        assert!(sharp_positions(&Ball::<2>::new([0.0; 2], 1.0).unwrap(), 0.1).is_empty());
        assert!(sharp_positions(&HalfSpace::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap(), 0.1).is_empty());
        let cube = sharp_positions(&Brick::new([0.0; 3], [1.0; 3]).unwrap(), 0.5);
        let is_on_edge = |x: &[f64; 3]| x.iter().filter(|x| **x == 0.0 || **x == 1.0).count() >= 2;
        assert!(cube.len() >= 8 + 12 && cube.iter().all(is_on_edge), "{cube:?}");
    }
}
