//! The closest feature of a segment or a triangle: its face, an edge or a corner.

use crate::region::surface::Triangle;
use crate::region::vector::{along, cross, dot, minus};

/// A position beyond the end of an edge by less than this fraction of the length of the edge counts as beside the edge:
/// points of a regular lattice lie exactly above edges and corners, where round-off would otherwise decide.
const ROUND: f64 = 1e-12;

/// Squared distances whose relative difference is below this count as equal; the feature of the highest dimension is
/// then chosen, because the normal is constant along such a feature.
const TIE: f64 = 1e-13;

/// A feature of a segment or a triangle, from the highest dimension to the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FeatureKind {
    /// The interior of the segment or triangle.
    Face,
    /// The edge of the triangle from corner k to corner k + 1.
    Edge(usize),
    /// Corner k.
    Corner(usize),
}

impl FeatureKind {
    fn codimension(self) -> usize {
        match self {
            FeatureKind::Face => 0,
            FeatureKind::Edge(_) => 1,
            FeatureKind::Corner(_) => 2,
        }
    }
}

/// The closest feature of a segment or a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Feature<const D: usize> {
    pub(super) kind: FeatureKind,
    /// The position minus its closest point on the feature, [length].
    pub(super) offset: [f64; D],
    /// Square of the length of `offset`, [length²].
    pub(super) squared: f64,
}

impl<const D: usize> Feature<D> {
    fn new(kind: FeatureKind, offset: [f64; D]) -> Self {
        Feature { kind, offset, squared: dot(&offset, &offset) }
    }
}

/// The closest feature found so far among numbered segments or triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest<const D: usize> {
    limit: f64,
    /// The feature, the index of its segment or triangle in the order of the tree, and the original index of this
    /// segment or triangle.
    pub(super) found: Option<(Feature<D>, usize, u32)>,
}

impl<const D: usize> Nearest<D> {
    /// A search limited to a distance, [length].
    pub(super) fn within(limit: f64) -> Self {
        Nearest { limit: limit * limit * (1.0 + TIE), found: None }
    }

    /// Square of the distance beyond which features no longer matter, [length²].
    pub(super) fn squared_limit(&self) -> f64 {
        self.limit
    }

    /// Takes a feature if it is closer or, at an equal distance, if it has a higher dimension or a lower index.
    pub(super) fn offer(&mut self, feature: Feature<D>, item: usize, index: u32) {
        if feature.squared > self.limit {
            return;
        }
        let is_better = self.found.as_ref().is_none_or(|(best, _, best_index)| {
            let by_dimension = feature.kind.codimension().cmp(&best.kind.codimension());
            let order =
                by_dimension.then(feature.squared.total_cmp(&best.squared)).then(index.cmp(best_index));
            feature.squared < best.squared * (1.0 - TIE) || order.is_lt()
        });
        if is_better {
            self.limit = self.limit.min(feature.squared * (1.0 + TIE));
            self.found = Some((feature, item, index));
        }
    }
}

/// The closest feature of a segment in the plane with this unit normal.
pub(super) fn on_segment(x: &[f64; 2], ends: &[[f64; 2]; 2], normal: &[f64; 2]) -> Feature<2> {
    let feature = on_edge(x, ends);
    match feature.kind {
        // The distance along the normal has less round-off than the length of the offset.
        FeatureKind::Face => {
            let distance = dot(&minus(x, &ends[0]), normal);
            Feature::new(FeatureKind::Face, normal.map(|n| distance * n))
        }
        _ => feature,
    }
}

/// The closest feature of a segment, whose interior is [`FeatureKind::Face`].
fn on_edge<const D: usize>(x: &[f64; D], [a, b]: &[[f64; D]; 2]) -> Feature<D> {
    let (edge, from) = (minus(b, a), minus(x, a));
    let t = dot(&from, &edge) / dot(&edge, &edge);
    if t < -ROUND {
        Feature::new(FeatureKind::Corner(0), from)
    } else if t > 1.0 + ROUND {
        Feature::new(FeatureKind::Corner(1), minus(x, b))
    } else {
        Feature::new(FeatureKind::Face, along(&from, -t, &edge))
    }
}

/// The closest feature of a triangle with this unit normal; `None` if it is farther than the square root of `limit`,
/// [length²].
pub(super) fn on_triangle(
    x: &[f64; 3],
    corners: &Triangle,
    normal: &[f64; 3],
    limit: f64,
) -> Option<Feature<3>> {
    let height = dot(&minus(x, &corners[0]), normal);
    if height * height > limit {
        return None;
    }
    let mut closest: Option<Feature<3>> = None;
    for k in 0..3 {
        let ends = [corners[k], corners[(k + 1) % 3]];
        let edge = minus(&ends[1], &ends[0]);
        // Distance from the edge within the plane, multiplied by the length of the edge; positive inside.
        let inwards = dot(&cross(normal, &edge), &minus(x, &ends[0]));
        if inwards < -ROUND * dot(&edge, &edge) {
            let mut on_edge = on_edge(x, &ends);
            on_edge.kind = match on_edge.kind {
                FeatureKind::Corner(end) => FeatureKind::Corner((k + end) % 3),
                _ => FeatureKind::Edge(k),
            };
            if closest.is_none_or(|best| on_edge.squared < best.squared) {
                closest = Some(on_edge);
            }
        }
    }
    Some(closest.unwrap_or_else(|| Feature::new(FeatureKind::Face, normal.map(|n| height * n))))
}
