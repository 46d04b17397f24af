//! Tools that overlap a body at the start, leave the grid, or do not come near any body.

use mpm_core::model::Model;
use mpm_core::points::{Points, coordinates};
use mpm_core::region::Bounds;
use mpm_core::terms::{StartOverlap, boxes_on_the_way, overlaps_at_start};

use crate::diagnostic::Severity;
use crate::first_step::Check;
use crate::quoting::quote;
use crate::{AXES, Shape};

/// Number of equal intervals between the instants at which prescribed motions are evaluated.
const TIMES: usize = 100;

impl Check<'_> {
    /// Reports tools that overlap a body at the start, and tools whose prescribed motion leaves the grid or comes near
    /// no body.
    pub(crate) fn tools_at_start<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) {
        for overlap in overlaps_at_start(model, points) {
            self.overlap_at_start(model, &overlap);
        }
        let end = self.loaded.deck.end_time();
        let times: Vec<f64> = (0..=TIMES).map(|k| end * k as f64 / TIMES as f64).collect();
        for number in 0..model.tools.len() {
            if let Some(boxes) = boxes_on_the_way(model, number, &times) {
                self.leaves_grid(model, number, &times, &boxes);
                self.comes_near_no_body(model, points, number, &boxes);
            }
        }
    }

    fn overlap_at_start<const D: usize>(&mut self, model: &Model<D>, found: &StartOverlap<D>) {
        let StartOverlap { tool, body, place, overlap, points, reach, way } = found;
        let message = format!(
            "the tool {} overlaps the body {} at the start, by up to {} at {}; it reaches into the domains of {}",
            quote(&model.tools[*tool].name),
            quote(&model.bodies[*body].name),
            rounded_up(*overlap),
            coordinates(&place.position),
            if *points == 1 { "1 point".to_owned() } else { format!("{points} points") },
        );
        let is_cut = (self.loaded.deck.bodies.get(*body)).is_some_and(|body| subtracts(&body.shape));
        let instead = match reach {
            // Subtracting the shape of the tool removes only points that lie in it.
            Some(reach) if is_cut => format!(
                "enlarge the region that the `difference` subtracts around the tool by {} on every side, because the \
                 domains of points reach beyond the boundary of the body",
                rounded_up(*reach)
            ),
            Some(reach) => format!(
                "subtract its shape, enlarged by {} on every side, from that of the body with a `difference`, because the \
                 domains of points reach beyond the boundary of the body",
                rounded_up(*reach)
            ),
            None => "subtract its shape from that of the body with a `difference`".to_owned(),
        };
        let axis = way.and_then(|way| (0..D).find(|d| way[*d] != 0.0).map(|d| (d, way[d])));
        let help = match axis {
            Some((d, length)) => {
                let sign = if length < 0.0 { "−" } else { "+" };
                let length = rounded_up(length.abs());
                format!("move the tool by {length} towards {sign}{}, or {instead}", AXES[d])
            }
            None => format!("move the tool out of the body, or {instead}"),
        };
        let found = self.at("D070", &format!("/tools/{tool}/shape"), message);
        self.found.push(found.help(help));
    }

    /// Warns of a tool that is wholly outside the grid after it has been inside, judged by its bounding boxes at
    /// several instants.
    fn leaves_grid<const D: usize>(
        &mut self,
        model: &Model<D>,
        number: usize,
        times: &[f64],
        boxes: &[Bounds<D>],
    ) {
        let grid = model.grid.bounds();
        let is_outside = |bounds: &Bounds<D>| distance(bounds, &grid) > 0.0;
        let entered = boxes.iter().position(|bounds| !is_outside(bounds));
        let left = entered.and_then(|first| (first..boxes.len()).find(|k| is_outside(&boxes[*k])));
        let Some(k) = left else { return };
        let message = format!(
            "the prescribed motion of the tool {} takes it out of the grid: at time {} it is wholly outside, where no body \
             can be",
            quote(&model.tools[number].name),
            mpm_files::shortest(times[k])
        );
        let found = self.at("D071", &format!("/tools/{number}"), message).severity(Severity::Warning);
        self.found.push(found.help("check the sign and the size of its motion, or make the grid larger"));
    }

    /// Adds a note, not a warning, about a tool that comes near no body, judged by its bounding boxes: a body may reach
    /// it later.
    fn comes_near_no_body<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        number: usize,
        boxes: &[Bounds<D>],
    ) {
        let tool = &model.tools[number];
        let touched = (0..model.bodies.len()).filter(|body| tool.interface_with(*body).is_some());
        let bodies: Vec<Bounds<D>> = touched.filter_map(|body| box_around(points, body)).collect();
        let to_bodies = boxes.iter().flat_map(|bounds| bodies.iter().map(|body| distance(bounds, body)));
        let nearest = to_bodies.fold(f64::INFINITY, f64::min);
        let size = model.grid.size(model.grid.nearest_cell(&tool.pose.position()) as usize);
        if nearest > size && nearest.is_finite() {
            let message = format!(
                "the motion of the tool {} never brings it closer than about {} to the initial positions of the bodies",
                quote(&tool.name),
                rounded_up(nearest)
            );
            let found = self.at("D037", &format!("/tools/{number}"), message).severity(Severity::Note);
            let help =
                "check its position and its motion; a tool that a body will reach later needs no change";
            self.found.push(found.help(help));
        }
    }
}

/// True if a shape is, or contains, a difference.
fn subtracts(shape: &Shape) -> bool {
    matches!(shape, Shape::Difference { .. }) || shape.parts().iter().any(|(_, part)| subtracts(part))
}

/// The box around the points of a body; `None` if the body has no points at the start. Collective: every rank must call
/// this.
fn box_around<const D: usize>(points: &Points<D>, body: usize) -> Option<Bounds<D>> {
    let in_body = (0..points.len()).filter(|p| points.body[*p] as usize == body);
    let [low, high] = in_body.map(|p| points.converged.position[p]).fold(
        [[f64::INFINITY; D], [f64::NEG_INFINITY; D]],
        |[low, high], x| {
            [std::array::from_fn(|d| low[d].min(x[d])), std::array::from_fn(|d| high[d].max(x[d]))]
        },
    );
    let bounds = [low.map(|x| points.ranks.smallest(x)), high.map(|x| points.ranks.largest(x))];
    bounds.iter().flatten().all(|x| x.is_finite()).then_some(bounds)
}

/// Distance between two boxes, [length]; 0 if they meet.
fn distance<const D: usize>([low, high]: &Bounds<D>, [other_low, other_high]: &Bounds<D>) -> f64 {
    let apart = |d: usize| (other_low[d] - high[d]).max(low[d] - other_high[d]).max(0.0);
    (0..D).map(|d| apart(d).powi(2)).sum::<f64>().sqrt()
}

/// A positive length in its shortest notation, rounded up to three significant digits, or to a whole number above 1000.
fn rounded_up(length: f64) -> String {
    let decimals = (2.0 - length.log10().floor()).clamp(0.0, 15.0);
    let scale = 10f64.powf(decimals);
    // Round-off must not raise the last digit.
    let rounded = (length * scale * (1.0 - 1e-9)).ceil() / scale;
    mpm_files::shortest(format!("{rounded:.*}", decimals as usize).parse().unwrap_or(rounded))
}

#[cfg(test)]
mod tests {
    use super::{distance, rounded_up};

    #[test]
    fn lengths_are_rounded_up() {
        let rounded = [0.1, 0.12341, 12.0 + 1e-12, 1234.5, 5e-7].map(rounded_up);
        assert_eq!(rounded, ["0.1", "0.124", "12", "1235", "5e-7"]);
    }

    #[test]
    fn boxes_that_meet_have_no_distance() {
        let unit = [[0.0; 2], [1.0; 2]];
        assert_eq!(distance(&unit, &[[1.0, 0.5], [2.0, 2.0]]), 0.0);
        assert_eq!(distance(&unit, &[[4.0, 5.0], [6.0, 6.0]]), 5.0);
    }
}
