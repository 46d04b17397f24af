//! Translates the shapes of tools in a deck into shapes of the core.

use std::sync::Arc;

use mpm_core::region::surface::Triangle;
use mpm_core::region::{Ball, Brick, Frustum, Motion, Region};
use mpm_core::tool::{
    ClosedPolygon, Extrusion, HalfSpace, Revolution, Section, Shape, ShapeError, TriangulatedSurface, Wall,
};

use crate::per_axis::array;
use crate::placed::placed;
use crate::tools::ToolShape;

/// The shape of a tool, or the reason why there is none.
type Shaped<const D: usize> = Result<Arc<dyn Shape<D>>, ShapeError>;

/// The shapes of tools in `D` dimensions.
pub(crate) trait DeckTool<const D: usize> {
    /// Builds a shape whose frame has its origin at `about`; `triangles` are the triangles in its file, and `revolved`
    /// is true for sections of bodies of revolution. `None` for shapes that exist in another number of dimensions.
    fn tool(shape: &ToolShape, about: &[f64; D], triangles: &[Triangle], revolved: bool)
    -> Option<Shaped<D>>;
}

/// A shape that exists in the plane and in space; `None` for others.
fn shared<const D: usize>(shape: &ToolShape, about: &[f64; D]) -> Option<Shaped<D>> {
    let at = |x: &[f64]| place(x, about);
    Some(match shape {
        ToolShape::HalfSpace { point, normal } => shaped(HalfSpace::new(at(point), array(normal))),
        ToolShape::Box { min, max } => shaped(Brick::new(at(min), at(max))),
        _ => return None,
    })
}

impl DeckTool<2> for Region<2> {
    fn tool(shape: &ToolShape, about: &[f64; 2], _: &[Triangle], revolved: bool) -> Option<Shaped<2>> {
        let corners = |vertices: &[Vec<f64>]| vertices.iter().map(|x| place(x, about)).collect();
        let section = |corners: Vec<[f64; 2]>| shaped(ClosedPolygon::section(corners, -about[0]));
        let found = match shape {
            ToolShape::Polygon { vertices } if revolved => section(corners(vertices)),
            ToolShape::Box { min, max } if revolved && min[0] == 0.0 => {
                let [low, high]: [[f64; 2]; 2] = [place(min, about), place(max, about)];
                section(vec![low, [high[0], low[1]], high, [low[0], high[1]]])
            }
            ToolShape::Circle { center, radius } => shaped(Ball::new(place(center, about), *radius)),
            ToolShape::Polygon { vertices } => shaped(ClosedPolygon::new(corners(vertices))),
            ToolShape::Polyline { vertices, thickness } => shaped(Wall::new(corners(vertices), *thickness)),
            _ => shared(shape, about)?,
        };
        let is_section = revolved && !matches!(shape, ToolShape::HalfSpace { .. });
        let revolve = |half| Arc::new(Section::new(half, -about[0])) as Arc<dyn Shape<2>>;
        Some(if is_section { found.map(revolve) } else { found })
    }
}

impl DeckTool<3> for Region<3> {
    fn tool(shape: &ToolShape, about: &[f64; 3], triangles: &[Triangle], _: bool) -> Option<Shaped<3>> {
        let at = |x: &[f64]| place(x, about);
        Some(match shape {
            ToolShape::Sphere { center, radius } => shaped(Ball::new(at(center), *radius)),
            ToolShape::Cylinder { start, end, radius } => {
                shaped(Frustum::cylinder(at(start), at(end), *radius))
            }
            ToolShape::Cone { start, end, radii } => shaped(Frustum::new(at(start), at(end), array(radii))),
            ToolShape::Revolution { start, direction, section } => {
                let section = section.iter().map(|x| array(x)).collect();
                shaped(Revolution::new(at(start), array(direction), section))
            }
            ToolShape::Extrusion { polygon, axis, from, to } => {
                let axis = *axis as usize;
                let across = [[1, 2], [0, 2], [0, 1]][axis];
                let corner = |x: &Vec<f64>| {
                    let x: [f64; 2] = array(x);
                    [x[0] - about[across[0]], x[1] - about[across[1]]]
                };
                let ends = [from - about[axis], to - about[axis]];
                shaped(Extrusion::new(polygon.iter().map(corner).collect(), axis, ends))
            }
            ToolShape::Stl { scale, rotate, at: origin, .. } => {
                let origin: [f64; 3] = origin.as_ref().map_or([0.0; 3], |x| array(x));
                let scale = scale.unwrap_or(1.0);
                let turned = match rotate.as_deref().map(|rotate| placed(None, Some(rotate), None)) {
                    Some(Ok(turned)) => turned,
                    Some(Err(error)) => return Some(Err(error.into())),
                    None => Motion::identity(),
                };
                let moved = |x: [f64; 3]| {
                    let x = if rotate.is_some() { turned.apply(&x) } else { x };
                    std::array::from_fn(|d| scale * x[d] + origin[d] - about[d])
                };
                let moved: Vec<Triangle> = triangles.iter().map(|t| t.map(moved)).collect();
                shaped(TriangulatedSurface::new(&moved))
            }
            _ => return shared(shape, about),
        })
    }
}

/// A position relative to another one.
fn place<const D: usize>(x: &[f64], about: &[f64; D]) -> [f64; D] {
    let x: [f64; D] = array(x);
    std::array::from_fn(|d| x[d] - about[d])
}

fn shaped<const D: usize, E: Into<ShapeError>>(shape: Result<impl Shape<D> + 'static, E>) -> Shaped<D> {
    shape.map(|shape| Arc::new(shape) as Arc<dyn Shape<D>>).map_err(Into::into)
}
