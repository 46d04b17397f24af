//! Smooth surfaces in space on which pieces of the boundary of a region lie, as zeros of heights above them.

use super::vector::{along, cross, dot, minus, norm};
use super::{BoxTree, Motion, area_vector, around};

/// The corners of a flat facet, [length].
pub(super) type Triangle = [[f64; 3]; 3];

/// The height of positions above a smooth surface. Which of its sides is positive does not matter.
#[derive(Debug, Clone)]
pub enum Level {
    /// A plane.
    Plane {
        /// A position on it, [length].
        point: [f64; 3],
        /// Unit normal.
        normal: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Centre, [length].
        center: [f64; 3],
        /// Radius, [length].
        radius: f64,
    },
    /// A surface of revolution with straight generators.
    Cone {
        /// A position on the axis, [length].
        start: [f64; 3],
        /// Unit vector along the axis.
        axis: [f64; 3],
        /// Radius at the start, [length].
        radius: f64,
        /// Change of the radius along the axis, [-].
        slope: f64,
    },
    /// Facets that meet at small angles; their planes continue them beyond their border.
    Facets(FacetLevel),
}

/// Facets that meet at small angles.
#[derive(Debug, Clone)]
pub struct FacetLevel {
    /// The facets, in the order of the tree, and for each of their edges, from each corner to the next, whether it lies
    /// on the border.
    triangles: Vec<(Triangle, [bool; 3])>,
    tree: BoxTree<3>,
}

impl Level {
    /// The plane of a facet that is not flat.
    pub(super) fn plane(facet: &Triangle) -> Self {
        let area = area_vector(facet);
        let length = norm(&area);
        Level::Plane { point: facet[0], normal: area.map(|a| a / length) }
    }

    /// The height of a position, [length], and its gradient, [-].
    pub fn height(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        match self {
            Level::Plane { point, normal } => (dot(&minus(x, point), normal), *normal),
            Level::Sphere { center, radius } => {
                let arm = minus(x, center);
                let distance = norm(&arm);
                (distance - radius, arm.map(|a| a / distance.max(f64::MIN_POSITIVE)))
            }
            Level::Cone { start, axis, radius, slope } => {
                let arm = minus(x, start);
                let height = dot(&arm, axis);
                let across = along(&arm, -height, axis);
                let distance = norm(&across);
                let scale = 1.0 / slope.hypot(1.0);
                let gradient = along(&across.map(|a| a / distance.max(f64::MIN_POSITIVE)), -slope, axis);
                (scale * (distance - radius - slope * height), gradient.map(|g| scale * g))
            }
            Level::Facets(facets) => facets.height(x),
        }
    }

    /// True for a plane.
    pub fn is_plane(&self) -> bool {
        matches!(self, Level::Plane { .. })
    }

    /// The same surface after a motion.
    pub(super) fn moved(self, motion: &Motion<3>) -> Self {
        let turned = |n: &[f64; 3]| {
            let n = minus(&motion.apply(n), &motion.apply(&[0.0; 3]));
            let length = norm(&n);
            n.map(|n| n / length)
        };
        match self {
            Level::Plane { point, normal } => {
                Level::Plane { point: motion.apply(&point), normal: turned(&normal) }
            }
            Level::Sphere { center, radius } => {
                Level::Sphere { center: motion.apply(&center), radius: motion.scale() * radius }
            }
            Level::Cone { start, axis, radius, slope } => Level::Cone {
                start: motion.apply(&start),
                axis: turned(&axis),
                radius: motion.scale() * radius,
                slope,
            },
            Level::Facets(facets) => {
                let moved = |(facet, border): &(Triangle, [bool; 3])| {
                    (facet.each_ref().map(|x| motion.apply(x)), *border)
                };
                Level::Facets(FacetLevel::new(facets.triangles.iter().map(moved).collect()))
            }
        }
    }
}

impl FacetLevel {
    /// Facets with a mark for each edge, from each corner to the next, that lies on their border.
    pub(super) fn new(triangles: Vec<(Triangle, [bool; 3])>) -> Self {
        let boxes: Vec<_> = triangles.iter().map(|(facet, _)| around(facet)).collect();
        let tree = BoxTree::new(&boxes);
        FacetLevel { triangles: tree.ordered(&triangles), tree }
    }

    fn height(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        let mut best: Option<(f64, Nearest, usize)> = None;
        self.tree.approach(x, f64::INFINITY, |item| {
            let near = nearest(&self.triangles[item].0, x);
            let arm = minus(x, &near.place);
            let squared = dot(&arm, &arm);
            if best.as_ref().is_none_or(|(least, ..)| squared < *least) {
                best = Some((squared, near, item));
            }
            best.as_ref().map_or(f64::INFINITY, |(least, ..)| *least)
        });
        let Some((squared, near, item)) = best else { return (f64::INFINITY, [0.0; 3]) };
        let (facet, border) = &self.triangles[item];
        let area = area_vector(facet);
        let normal = area.map(|a| a / norm(&area));
        let arm = minus(x, &near.place);
        let above = dot(&arm, &normal);
        let is_beyond = near.edge.is_some_and(|edge| border[edge]);
        let distance = squared.sqrt();
        if is_beyond || near.edge.is_none() || distance <= 1e-12 * norm(&minus(&facet[1], &facet[0])) {
            return (above, normal);
        }
        let sign = if above < 0.0 { -1.0 } else { 1.0 };
        (sign * distance, arm.map(|a| sign * a / distance))
    }
}

/// The position of a facet nearest to another position.
struct Nearest {
    place: [f64; 3],
    /// The edge on which it lies, if it does, by the corner where this starts.
    edge: Option<usize>,
}

/// The position of a triangle nearest to `x`.
fn nearest(facet: &Triangle, x: &[f64; 3]) -> Nearest {
    let normal = area_vector(facet);
    let squared = dot(&normal, &normal);
    let outside = |k: usize| {
        let edge = minus(&facet[(k + 1) % 3], &facet[k]);
        dot(&cross(&edge, &minus(x, &facet[k])), &normal) < 0.0
    };
    if !(0..3).any(outside) {
        let above = dot(&minus(x, &facet[0]), &normal) / squared;
        return Nearest { place: along(x, -above, &normal), edge: None };
    }
    let on_edge = |k: usize| {
        let edge = minus(&facet[(k + 1) % 3], &facet[k]);
        let t = dot(&minus(x, &facet[k]), &edge) / dot(&edge, &edge);
        along(&facet[k], t.clamp(0.0, 1.0), &edge)
    };
    let away = |place: &[f64; 3]| norm(&minus(x, place));
    let places = [0, 1, 2].map(on_edge);
    let edge = (0..3).min_by(|&a, &b| away(&places[a]).total_cmp(&away(&places[b]))).unwrap_or(0);
    Nearest { place: places[edge], edge: Some(edge) }
}

/// Distance of a position from a triangle, [length].
pub(crate) fn distance(facet: &[[f64; 3]; 3], x: &[f64; 3]) -> f64 {
    norm(&minus(x, &nearest(facet, x).place))
}
