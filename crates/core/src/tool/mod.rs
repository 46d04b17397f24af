//! Shapes of rigid tools for contact: pipes, piles, footings, anchors, ploughs.
//!
//! A [`Shape`] finds the point on its surface closest to a position, in the frame of the tool, and the position where
//! the path of a point meets the surface. A [`Pose`] places the tool in space, and an [`Increment`] moves it. This
//! module is pure geometry: it knows neither bodies nor forces.
//!
//! | Shape | Plane | Space | Closest point |
//! |---|---|---|---|
//! | [`HalfSpace`] | half-plane | half-space | closed form |
//! | [`Ball`](crate::region::Ball) | circle | sphere | closed form |
//! | [`Brick`](crate::region::Brick) | rectangle | box | closed form |
//! | [`ClosedPolygon`] | simple polygon | – | bounding box tree over the edges |
//! | [`Wall`] | polyline with a thickness | – | bounding box tree over the segments |
//! | [`Section`] | section of a body of revolution | – | that of the shape or, beyond the axis, of its mirror image |
//! | [`Frustum`](crate::region::Frustum) | – | cylinder, cone, truncated cone | section (r, h) |
//! | [`Revolution`] | – | body of revolution: penetrometer, spudcan, open pile | polygon as the section (r, h) |
//! | [`Extrusion`] | – | extruded polygon | polygon and height |
//! | [`TriangulatedSurface`] | – | closed surface of triangles | bounding box tree over the facets |
//!
//! # Equations
//!
//! | Quantity | Equation | Source |
//! |---|---|---|
//! | gap, normal | g = ± minimum of &#124;x − p&#124;, n = ∇g, p = x − g n | signed distance function |
//! | derivative of the normal on a flat part | ∂n/∂x = 0 | |
//! | at an edge along e | ∂n/∂x = (I − n⊗n − e⊗e)/g | derivative of n = (x − p)/g |
//! | at a corner, around the centre of a ball | ∂n/∂x = (I − n⊗n)/g | the same without e |
//! | on a parallel surface at a distance h | g − h, the same n and ∂n/∂x | |
//! | body of revolution | section in (r, h), and ∂n/∂x gains (n_r/r) e_θ⊗e_θ | curvature of the parallels |
//! | inside a corner of a polygon, on the bisector of its faces | g to the corner, ∂n/∂x = 0 | symmetry |
//! | inside a tip, on the axis of revolution | g along the axis, ∂n/∂x = 0 | symmetry |
//! | beyond an edge between faces with gaps a, b | g² = a² + b², g n = a∇a + b∇b | derivative of this for ∂n/∂x |
//! | sign at edges and corners of triangles | sign of (x − p) · Σ α_f n_f, with the angles α_f | Bærentzen and Aanæs, *IEEE Trans. Vis. Comput. Graph.* 11 (2005) 243 |
//! | sign at corners of polygons | sign of (x − p) · (n₁ + n₂) | the same in the plane |
//! | sign in doubt | winding number with exact predicates | [`Surface`](crate::region::Surface), [`Polygon`](crate::region::Polygon) |
//! | rotation | exp(θ̂) = I + (sin t/t) θ̂ + ((1 − cos t)/t²) θ̂², t = &#124;θ&#124; | Rodrigues |
//! | its derivative | d exp(θ̂) = (J dθ)^ exp(θ̂), J = I + ((1 − cos t)/t²) θ̂ + ((t − sin t)/t³) θ̂² | Chirikjian, *Stochastic Models, Information Theory, and Lie Groups* 2 (2012) |
//! | closest feature | branch and bound over boxes, near boxes first | |
//!
//! Outside a convex edge or corner the gap is that of the rounded parallel surface, so the normal is continuous there;
//! inside, the normal is that of the closest part and jumps across the medial axis. On the medial axis near a corner of
//! a polygon, the closest point is the corner, and the normal is along the bisector of both faces.

mod border;
mod closest;
mod edges;
mod error;
mod extrusion;
mod features;
mod half_space;
mod outline;
mod polygon;
mod pose;
mod primitives;
mod revolution;
mod rotation;
mod section;
mod segments;
mod shape;
#[cfg(test)]
mod tests;
mod triangulated;
mod wall;

pub use closest::{Closest, Face, facing_each_other};
pub use edges::sharp_positions;
pub use error::{NoOutline, ShapeError};
pub use extrusion::Extrusion;
pub use half_space::HalfSpace;
pub use outline::Outline;
pub use polygon::ClosedPolygon;
pub use pose::{Increment, Pose, first_contact};
pub use revolution::Revolution;
pub use section::Section;
pub use shape::Shape;
pub use triangulated::TriangulatedSurface;
pub use wall::Wall;
