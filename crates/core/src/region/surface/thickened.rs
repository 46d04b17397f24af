//! Open surfaces with a back.

use super::facets::facet_edges;
use super::triangle::Triangle;
use super::{closed, weld};
use crate::region::area_vector;
use crate::region::vector::{dot, minus, norm};
use crate::region::{hull, nothing};

/// Largest angle between a facet and the mean plane of an open surface, as a cosine: a facet that stands more steeply
/// would turn its back to the outside.
const STEEPEST: f64 = 1e-3;

/// Reason why a surface cannot be given a back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotOneSided {
    /// Its facets do not all look to one side.
    #[error(
        "the open surface does not look to one side: facet {facet} is turned away from the mean direction of the facets, \
         ({}, {}, {})", .direction[0], .direction[1], .direction[2]
    )]
    Folded {
        /// Number of the facet, from 1.
        facet: usize,
        /// The mean normal, [-].
        direction: [f64; 3],
    },
    /// The thickness is not positive.
    #[error("the thickness must be positive, not {thickness}")]
    Thickness {
        /// The thickness, [length].
        thickness: f64,
    },
}

/// The closed surface of the layer behind an open surface: the surface itself, its copy at a distance `thickness`,
/// [length], against the mean normal of its facets, and the sides between them. The facets of the surface come first.
/// Without a thickness, it is a tenth of the diagonal of the bounds. Returns the facets and the thickness.
///
/// # Errors
/// [`NotOneSided`] unless every facet looks to the side of the mean normal, so that the layer does not fold.
pub fn thickened(
    triangles: &[Triangle],
    thickness: Option<f64>,
) -> Result<(Vec<Triangle>, f64), NotOneSided> {
    let mut facets = weld::by_equality(triangles);
    facets.drop_flat();
    weld::by_distance(&mut facets);
    let [low, high] = facets.positions.iter().map(|x| [*x, *x]).fold(nothing(), hull);
    let thickness = thickness.unwrap_or_else(|| 0.1 * norm(&minus(&high, &low)));
    if !(thickness > 0.0 && thickness.is_finite()) {
        return Err(NotOneSided::Thickness { thickness });
    }
    let mut mean = [0.0; 3];
    let normals: Vec<[f64; 3]> = facets.triangles().iter().map(area_vector).collect();
    normals.iter().for_each(|normal| (0..3).for_each(|d| mean[d] += normal[d]));
    let size = norm(&mean);
    let direction = mean.map(|x| x / size);
    let is_turned = |normal: &[f64; 3]| {
        let along = dot(normal, &direction);
        along.is_nan() || along <= STEEPEST * norm(normal)
    };
    if let Some(facet) = normals.iter().position(is_turned) {
        return Err(NotOneSided::Folded { facet: facets.number(facet), direction });
    }
    let behind = |x: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| x[d] - thickness * direction[d]) };
    let mut all = facets.triangles();
    all.extend(facets.triangles().iter().map(|&[a, b, c]| [a, c, b].map(behind)));
    let edges = facet_edges(&facets.corners);
    for edge in closed::edges(&edges).filter(|edge| edge.len() == 1) {
        let (ends, _, ascends) = edge[0];
        let [low, high] = ends.map(|corner| facets.positions[corner as usize]);
        let (a, b) = if ascends { (low, high) } else { (high, low) };
        all.extend([[b, a, behind(a)], [b, behind(a), behind(b)]]);
    }
    Ok((all, thickness))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::{Primitive, Surface};

    /// A plate of two facets becomes a box, whichever way it looks; a hole stays a hole.
    #[test]
    fn a_plate_becomes_a_box() {
        let plate = [
            [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0]],
            [[0.0, 0.0, 1.0], [2.0, 1.0, 1.0], [0.0, 1.0, 1.0]],
        ];
        for (plate, low) in [(plate, 0.5), (plate.map(|[a, b, c]| [a, c, b]), 1.0)] {
            let (facets, thickness) = thickened(&plate, Some(0.5)).unwrap();
            let layer = Surface::new(&facets).unwrap();
            assert_eq!((thickness, layer.facets(), layer.volume()), (0.5, 12, 1.0));
            assert_eq!(layer.extent(&[0.0, 0.0, 1.0]), [low, low + 0.5]);
        }
        assert!((thickened(&plate, None).unwrap().1 - 0.1 * 5f64.sqrt()).abs() < 1e-15);
        assert!(matches!(thickened(&plate, Some(0.0)), Err(NotOneSided::Thickness { .. })));
    }

    /// The volume of the layer behind terrain is its horizontal area times the thickness.
    #[test]
    fn terrain_becomes_a_layer() {
        let height = |i: usize, j: usize| (i as f64).sin() * 0.4 + (j as f64 * 1.3).cos() * 0.3;
        let mut facets = Vec::new();
        for i in 0..8 {
            for j in 0..6 {
                let x = |a: usize, b: usize| [(i + a) as f64, (j + b) as f64, height(i + a, j + b)];
                if (i, j) != (3, 3) {
                    facets.extend([[x(0, 0), x(1, 0), x(1, 1)], [x(0, 0), x(1, 1), x(0, 1)]]);
                }
            }
        }
        let layer = Surface::new(&thickened(&facets, Some(2.0)).unwrap().0).unwrap();
        let mut mean = [0.0; 3];
        facets.iter().for_each(|t| (0..3).for_each(|d| mean[d] += area_vector(t)[d]));
        assert!((layer.volume() - 2.0 * norm(&mean)).abs() < 1e-12, "{}", layer.volume());
        assert_eq!(layer.shells(), 1);
        let mut folded = facets;
        folded[5].swap(0, 1);
        assert!(matches!(thickened(&folded, None), Err(NotOneSided::Folded { facet: 6, .. })));
    }
}
