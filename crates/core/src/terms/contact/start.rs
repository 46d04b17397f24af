//! Tools and bodies at the start of an analysis: where they overlap, and where prescribed motions move the tools.

use rayon::prelude::*;

use super::candidates::{TOUCHING, named};
use super::counterpart::Counterpart;
use super::motion::Moving;
use crate::grid::MAX_CORNERS;
use crate::model::{Model, Tool};
use crate::points::{PIECE, Points};
use crate::region::vector::{along, minus, norm, unit};
use crate::region::{Bounds, corners, hull};
use crate::step::Step;
use crate::surface::corners_of;
use crate::terms::failure::ContactPlace;
use crate::tool::Pose;

/// A tool that overlaps a body at the start.
#[derive(Debug, Clone, PartialEq)]
pub struct StartOverlap<const D: usize> {
    /// Number of the tool.
    pub tool: usize,
    /// Number of the body.
    pub body: usize,
    /// The contact point with the largest overlap.
    pub place: ContactPlace,
    /// The largest overlap, [length].
    pub overlap: f64,
    /// Number of material points whose domains reach into the tool.
    pub points: usize,
    /// The largest distance of a corner of these domains from its material point, [length], if all these points lie
    /// outside the tool, so that only the size of their domains causes the overlap.
    pub reach: Option<f64>,
    /// The shortest translation along an axis by which the tool leaves all bodies, [length]; `None` if no translation
    /// along an axis achieves this.
    pub way: Option<[f64; D]>,
}

/// The deepest corner of a body in a tool: permanent number of its material point, the corner, its overlap, and the
/// number and the reach of the material points whose domains reach into the tool.
type Deepest = (u32, Vec<f64>, f64, usize, Option<f64>);

/// The tools and bodies that overlap at the start, in the order of their numbers: overlap means that corners of domains
/// of material points lie inside a tool by more than round-off. All ranks must call this together.
pub fn overlaps_at_start<const D: usize>(model: &Model<D>, points: &Points<D>) -> Vec<StartOverlap<D>> {
    let mut found = Vec::new();
    for (number, tool) in model.tools.iter().enumerate() {
        let placed = Placed { model, points, tool };
        let inside = placed.inside();
        let way = if points.reduction().any(!inside.is_empty()) { placed.shortest_way() } else { None };
        for body in 0..model.bodies.len() {
            let in_body: Vec<&Inside<D>> =
                inside.iter().filter(|inside| points.body[inside.p] as usize == body).collect();
            let deepest = in_body.iter().copied().reduce(|a, b| if b.overlap > a.overlap { b } else { a });
            let larger = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a.max(b));
            let reach = in_body.iter().map(|inside| inside.reach).fold(Some(0.0), larger);
            let own = deepest.map(|Inside { p, corner, overlap, .. }| -> Deepest {
                (points.id[*p], corner.to_vec(), *overlap, in_body.len(), reach)
            });
            let all = points.reduction().join(own.into_iter().collect()).into_iter();
            let deepest = all.reduce(|a, b| {
                let (n, reach) = (a.3 + b.3, larger(a.4, b.4));
                let deeper = if b.2 > a.2 { b } else { a };
                (deeper.0, deeper.1, deeper.2, n, reach)
            });
            let Some((id, corner, overlap, n, reach)) = deepest else { continue };
            let Ok(corner) = <[f64; D]>::try_from(corner) else { continue };
            let place = named(model, &Counterpart::Tool(tool), body, id, &corner);
            found.push(StartOverlap { tool: number, body, place, overlap, points: n, reach, way });
        }
    }
    found
}

/// A material point whose domain reaches into a tool.
struct Inside<const D: usize> {
    p: usize,
    /// The corner of its domain that lies deepest in the tool, [length].
    corner: [f64; D],
    overlap: f64,
    /// The largest distance of a corner from the material point, [length]; `None` if the point lies in the tool.
    reach: Option<f64>,
}

/// A tool among the bodies at the start.
struct Placed<'a, const D: usize> {
    model: &'a Model<D>,
    points: &'a Points<D>,
    tool: &'a Tool<D>,
}

impl<const D: usize> Placed<'_, D> {
    /// The material points whose domains reach into the tool, in their order.
    fn inside(&self) -> Vec<Inside<D>> {
        let Placed { points, tool, .. } = self;
        let gap_at = |x: &[f64; D]| {
            let found = tool.pose.closest(tool.shape.as_ref(), *x, f64::INFINITY);
            found.map_or(f64::INFINITY, |found| found.gap)
        };
        let found = |p: usize| {
            let x = &points.converged.position[p];
            let corners = domain(points, p);
            let radius = corners.iter().map(|corner| norm(&minus(corner, x))).fold(0.0, f64::max);
            let gap = gap_at(x);
            if gap > radius {
                return None;
            }
            let reach = (gap > 0.0).then_some(radius);
            let least = TOUCHING * self.model.grid.size(points.cell[p] as usize);
            let overlaps =
                corners.into_iter().map(|corner| Inside { p, corner, overlap: -gap_at(&corner), reach });
            overlaps.filter(|inside| inside.overlap > least).max_by(|a, b| a.overlap.total_cmp(&b.overlap))
        };
        self.touchable().filter_map(found).collect()
    }

    /// The material points of the bodies that the tool may touch.
    fn touchable(&self) -> impl ParallelIterator<Item = usize> + use<'_, D> {
        let may_touch = |p: &usize| self.tool.interface_with(self.points.body[*p] as usize).is_some();
        (0..self.points.len()).into_par_iter().with_min_len(PIECE).filter(may_touch)
    }

    /// The shortest translation along an axis after which all corners of domains are outside the tool. In axisymmetry,
    /// tools stay on the axis.
    fn shortest_way(&self) -> Option<[f64; D]> {
        let axes = if self.model.revolved { 1..2 } else { 0..D };
        let ways = axes.flat_map(|axis| [1.0, -1.0].map(|sign| unit::<D>(axis).map(|e| sign * e)));
        let with_length = ways.filter_map(|way| Some((self.length(&way)?, way)));
        let shortest = with_length.min_by(|a, b| a.0.total_cmp(&b.0));
        shortest.map(|(length, way)| way.map(|e| e * length))
    }

    /// The length of the shortest translation in a direction after which all corners of domains are outside the tool;
    /// `None` if the tool would not leave within the space around the grid.
    fn length(&self, direction: &[f64; D]) -> Option<f64> {
        let Placed { model, points, tool } = self;
        let reach = self.reach(model.grid.bounds());
        let shape = tool.shape.as_ref();
        let way = |corner: [f64; D]| {
            let (at, far) = (tool.pose.to_tool(&corner), along(&corner, -reach, direction));
            let far = tool.pose.to_tool(&far);
            let leaves = shape.closest(far).is_none_or(|found| found.gap > 0.0);
            let last = shape.first_contact(far, at).map_or(0.0, |fraction| reach * (1.0 - fraction));
            leaves.then_some(last)
        };
        let found = |p: usize| {
            let lengths = domain(points, p).into_iter().map(way);
            lengths.reduce(|a, b| Some(a?.max(b?))).unwrap_or(Some(0.0))
        };
        let length = self.touchable().map(found).reduce(|| Some(0.0), |a, b| Some(a?.max(b?)));
        Some(points.reduction().largest(length.unwrap_or(f64::INFINITY))).filter(|length| length.is_finite())
    }

    /// Twice the diagonal of the box around the grid and the tool, [length]; of the grid alone if the tool is
    /// unbounded.
    fn reach(&self, grid: Bounds<D>) -> f64 {
        let around = at_pose(self.tool, &self.tool.pose).map_or(grid, |bounds| hull(grid, bounds));
        2.0 * norm(&minus(&around[1], &around[0]))
    }
}

/// The corners of the domain of a material point; its position if it has no domain.
fn domain<const D: usize>(points: &Points<D>, p: usize) -> Vec<[f64; D]> {
    let mut buffer = [[0.0; D]; MAX_CORNERS];
    corners_of(points, p, &mut buffer).to_vec()
}

/// The bounding box of a tool in a pose; `None` if the tool is unbounded.
fn at_pose<const D: usize>(tool: &Tool<D>, pose: &Pose<D>) -> Option<Bounds<D>> {
    let bounds = tool.shape.bounds();
    if !bounds.as_flattened().iter().all(|x| x.is_finite()) {
        return None;
    }
    let placed = corners(&bounds).map(|x| pose.to_space(&x)).map(|x| [x, x]);
    placed.reduce(hull)
}

/// The bounding boxes of a tool at some times of its prescribed motion, [length]; `None` if a component of its motion
/// is free or not known in advance, or if the tool is unbounded.
pub fn boxes_on_the_way<const D: usize>(
    model: &Model<D>,
    tool: usize,
    times: &[f64],
) -> Option<Vec<Bounds<D>>> {
    let tool = model.tools.get(tool)?;
    let at = |time: &f64| {
        let mut moving = Moving::new(tool);
        moving.begin(tool, model, Step { index: 1, start: 0.0, end: *time }, 0.0).ok()?;
        if !moving.free.is_empty() {
            return None;
        }
        at_pose(tool, &moving.end)
    };
    times.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::{StartOverlap, boxes_on_the_way, overlaps_at_start};
    use crate::basis::Method;
    use crate::formula::Formula;
    use crate::grid::Structured;
    use crate::material::Hencky;
    use crate::model::{Builder, Fill, Freedom, Model, Tool};
    use crate::points::Points;
    use crate::region::{Ball, Brick};
    use crate::tool::{HalfSpace, Pose, Shape};

    /// A block of 4 m × 2 m under a tool whose frame has this origin.
    fn block(method: Method, shape: impl Shape<2> + 'static, origin: [f64; 2]) -> (Model<2>, Points<2>) {
        let mut tool = Tool::new("tool", shape, Pose::new(origin, [0.0; 3]).unwrap());
        tool.translation[1] = Freedom::Prescribed(Formula::constant(-0.5));
        let fill = Fill { method, ..Fill::default() };
        Builder::new(Structured::new([0.0; 2], [0.5; 2], [8, 8]))
            .material("clay", Hencky::new(1e6, 0.3))
            .body("clay", "clay", fill, |x| x[1] < 2.0)
            .fix("base", [true, true], |x| x[1] == 0.0)
            .tool(tool)
            .build()
            .unwrap()
    }

    fn only(found: Vec<StartOverlap<2>>) -> StartOverlap<2> {
        let [only] = &found[..] else { panic!("{found:?}") };
        only.clone()
    }

    #[test]
    fn overlaps_are_found_with_the_way_out() {
        for method in [Method::Gimp, Method::Cpdi1, Method::Cpdi2] {
            let brick = || Brick::new([-0.65, 0.0], [0.65, 1.0]).unwrap();
            let (model, points) = block(method, brick(), [2.0, 1.9]);
            let found = only(overlaps_at_start(&model, &points));
            assert!((found.overlap - 0.1).abs() < 1e-12, "{found:?}");
            // Half a diagonal of the domains, which are 0.25 m wide.
            assert!((found.reach.unwrap() - 0.125 * 2f64.sqrt()).abs() < 1e-12, "{found:?}");
            let way = found.way.unwrap();
            assert!(way[0] == 0.0 && (way[1] - 0.1).abs() < 1e-9, "{way:?}");
            let (model, points) = block(method, brick(), [2.0, 1.9 + way[1]]);
            assert_eq!(overlaps_at_start(&model, &points), []);
        }
    }

    #[test]
    fn deep_overlaps_count_in_full() {
        // The lowest point of the ball is 0.75 m above the base and 1.25 m below the surface.
        let (model, points) = block(Method::Gimp, Ball::new([0.0; 2], 0.5).unwrap(), [2.0, 1.25]);
        let found = only(overlaps_at_start(&model, &points));
        let way = found.way.unwrap();
        assert!(way[1] > 1.2 && way[1] <= 1.25 + 1e-9, "{found:?}");
        assert_eq!(found.reach, None);
        let (model, points) = block(Method::Gimp, Ball::new([0.0; 2], 0.5).unwrap(), [2.0, 1.25 + way[1]]);
        assert_eq!(overlaps_at_start(&model, &points), []);
        let floor = HalfSpace::new([0.0; 2], [0.0, 1.0]).unwrap();
        let (model, points) = block(Method::Gimp, floor, [0.0, 1.5]);
        let found = only(overlaps_at_start(&model, &points));
        assert!((found.overlap - 1.5).abs() < 1e-12 && (found.way.unwrap()[1] + 1.5).abs() < 1e-9);
    }

    #[test]
    fn boxes_follow_the_motion() {
        let (model, _) = block(Method::Gimp, Ball::new([0.0; 2], 0.5).unwrap(), [2.0, 2.75]);
        let boxes = boxes_on_the_way(&model, 0, &[0.0, 0.5, 1.0]).unwrap();
        let low: Vec<f64> = boxes.iter().map(|[low, _]| low[1]).collect();
        assert!(low.iter().zip([2.25, 2.0, 1.75]).all(|(a, b)| (a - b).abs() < 1e-12), "{low:?}");
        let roof = HalfSpace::new([0.0; 2], [0.0, -1.0]).unwrap();
        let (model, _) = block(Method::Gimp, roof, [0.0, 2.0]);
        assert_eq!(boxes_on_the_way(&model, 0, &[0.0]), None);
    }
}
