//! Closed surfaces of triangles.
//!
//! All decisions about sides are exact ([`robust`]): whether facets cross, and whether a position is inside. Only
//! lengths and volumes have round-off errors.

mod closed;
mod crossing;
mod error;
mod facets;
mod inside;
mod neighbours;
mod thickened;
mod triangle;
mod weld;

use std::fmt;

use super::boundary::triangle as divided;
use super::box_tree::{BoxTree, around, overlap};
use super::{Facet, Intervals, Levels, Line, Primitive};
use facets::Facets;
use triangle::volume;

pub use error::{EdgeReport, FacetReport, SurfaceError};
pub(crate) use neighbours::Neighbours;
pub use thickened::{NotOneSided, thickened};
pub use triangle::Triangle;

/// Largest magnitude of a coordinate; larger ones could overflow in the exact predicates.
const LARGEST: f64 = 1e60;

/// A closed surface of triangles without self-intersections, and its interior. It may consist of several shells, side
/// by side or nested in cavities.
#[derive(Clone)]
pub struct Surface {
    /// Facets in tree order.
    triangles: Vec<Triangle>,
    tree: BoxTree<3>,
    volume: f64,
    shells: usize,
    welded: usize,
    dropped: usize,
}

impl Surface {
    /// Builds the surface from triangles in any order, each with its corners counterclockwise as seen from outside,
    /// [length].
    ///
    /// Corners with equal coordinates count as one corner. Facets without area are removed, and the facets beyond their
    /// longest sides divided; see [`Surface::dropped`]. If edges remain open, corners at these edges are merged within
    /// 10⁻⁶ of the size of the surface; see [`Surface::welded`]. An inside-out surface is refused rather than
    /// reversed, because it might be a cavity whose outer body is missing.
    ///
    /// # Errors
    /// Any [`SurfaceError`].
    pub fn new(triangles: &[Triangle]) -> Result<Self, SurfaceError> {
        check_numbers(triangles)?;
        let mut facets = weld::by_equality(triangles);
        let dropped = facets.drop_flat();
        check_areas(&facets)?;
        let mut welded = 0;
        if closed::has_open_edges(&facets.corners) {
            welded = weld::by_distance(&mut facets);
            // A facet that merging has collapsed had an area: to remove it would change the shape.
            check_areas(&facets)?;
        }
        if facets.corners.len() < 4 {
            return Err(SurfaceError::TooFewFacets { facets: facets.corners.len() });
        }
        let shells = closed::shells(&facets)?;
        let in_order_of_file = facets.triangles();
        let boxes: Vec<_> = in_order_of_file.iter().map(|t| around(t)).collect();
        let tree = BoxTree::new(&boxes);
        crossing::check(&facets, &tree)?;
        let ordered = tree.ordered(&in_order_of_file);
        let shell_of = tree.ordered(&shells.by_facet);
        inside::check_orientation(&facets, &shells, &ordered, &tree, &shell_of)?;
        let volume = volume(&ordered);
        Ok(Surface { triangles: ordered, tree, volume, shells: shells.number, welded, dropped })
    }

    /// Number of facets.
    pub fn facets(&self) -> usize {
        self.triangles.len()
    }

    /// Number of shells: parts of the surface that share no edge.
    pub fn shells(&self) -> usize {
        self.shells
    }

    /// Number of corners at open edges that were merged with others nearby.
    pub fn welded(&self) -> usize {
        self.welded
    }

    /// Number of facets without area that were removed.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// The facets, in tree order.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// The bounding box tree of the facets.
    pub(crate) fn tree(&self) -> &BoxTree<3> {
        &self.tree
    }

    /// The first position at which the straight path from one position to another meets a facet, as a fraction of the
    /// path. Whether they meet is decided exactly.
    pub(crate) fn first_crossing(&self, path: [[f64; 3]; 2]) -> Option<f64> {
        let (box_of_path, mut first) = (around(&path), None::<f64>);
        self.tree.visit(
            |bounds| overlap(bounds, &box_of_path),
            |index| {
                let facet = &self.triangles[index];
                if overlap(&around(facet), &box_of_path) && crossing::segment_meets(&path, facet) {
                    let [from, to] = path.map(|x| triangle::depth(facet, &x));
                    let fraction = if from == to { 0.0 } else { (from / (from - to)).clamp(0.0, 1.0) };
                    first = Some(first.map_or(fraction, |first| first.min(fraction)));
                }
            },
        );
        first
    }
}

impl fmt::Debug for Surface {
    /// Omits the facets, of which there may be many.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut surface = f.debug_struct("Surface");
        surface
            .field("facets", &self.facets())
            .field("bounds", &self.tree.bounds())
            .field("volume", &self.volume);
        surface.finish_non_exhaustive()
    }
}

impl Primitive<3> for Surface {
    /// The test is exact; a position on the surface may count as inside or outside.
    fn contains(&self, x: &[f64; 3]) -> bool {
        inside::winding(&self.triangles, &self.tree, x) != 0
    }

    fn extent(&self, direction: &[f64; 3]) -> [f64; 2] {
        super::polygon::extent_of(self.triangles.as_flattened(), direction)
    }

    fn volume(&self) -> f64 {
        self.volume
    }

    fn intervals(&self, line: &Line<3>) -> Intervals {
        inside::intervals(&self.triangles, &self.tree, line)
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<3>> {
        let triangles = self.triangles.iter();
        triangles.flat_map(|[a, b, c]| divided([a, b, c], spacing, 0)).collect()
    }

    fn levels(&self) -> Levels {
        Levels::Plane
    }

    fn corners(&self) -> Vec<[f64; 3]> {
        // Corners repeat, once per facet: 64 facets have about 34 distinct corners.
        if self.triangles.len() <= 64 { self.triangles.as_flattened().to_vec() } else { Vec::new() }
    }
}

/// Largest distance over which corners at open edges are merged, relative to the diagonal of the bounds, [-].
pub const MERGED: f64 = weld::SAME;

fn check_numbers(triangles: &[Triangle]) -> Result<(), SurfaceError> {
    let strange = |t: &Triangle| t.as_flattened().iter().any(|x| !x.is_finite() || x.abs() > LARGEST);
    if triangles.len() < 4 {
        return Err(SurfaceError::TooFewFacets { facets: triangles.len() });
    }
    if u32::try_from(triangles.len() * 3).is_err() {
        return Err(SurfaceError::TooManyFacets { facets: triangles.len() });
    }
    match triangles.iter().position(strange) {
        Some(facet) => {
            Err(SurfaceError::NotANumber { at: FacetReport { facet: facet + 1, corners: triangles[facet] } })
        }
        None => Ok(()),
    }
}

/// Refuses facets with collinear corners.
fn check_areas(facets: &Facets) -> Result<(), SurfaceError> {
    let flat = facets.flat();
    match flat.len() {
        0 => Ok(()),
        n => {
            let first = flat.iter().take(error::SHOWN).map(|facet| facets.report(*facet)).collect();
            Err(SurfaceError::Degenerate { n, first })
        }
    }
}

#[cfg(test)]
mod damage;
#[cfg(test)]
pub(crate) mod tests;
