//! Water at rest in the ground and above it: what its level does to the bodies.
//!
//! The total stress is σ = σ′ − u I with the pore pressure u of the level, and the water on the surfaces of a body has
//! the same pressure, so that by the divergence theorem
//!
//! ∫ u ∇N_v dv − ∮ N_v u n da = −∫ N_v ∇u dv.
//!
//! The term adds the right-hand side as a force per volume, and neither stress nor surface load: the two then cancel to
//! the last digit whatever the integration rule, and no surface has to be known. With the weight of the pore water, whose
//! volume is (J − 1 + n₀) V⁰, and u = γ_w ⟨h − z⟩ below a level of the height h(x), the force on a point is
//!
//! f = γ_w [(1 − n₀) V⁰ e_z − V ∇h]:
//!
//! water lifts the grains by what they displace, and drags the ground down the slope of its level. The first part does
//! not depend on the deformation where the point is wholly below the level, and derives from a potential.
//!
//! The level cuts domains. The part of a domain of half height l below the level is the part with ζ < ζ* of its vertical
//! extent −l < ζ < l, and N_v there is S_v + ζ ∂S_v/∂z; the force of the grains is
//!
//! f_v = γ_w (1 − n₀) V⁰/(2l) [(ζ* + l) S_v + ½ (ζ*² − l²) ∂S_v/∂z],
//!
//! with the level at ζ* = (h − z − w)/(1 + w_z), where w and w_z are the vertical displacement of the point in the step and
//! its vertical gradient. The stiffness is symmetric, γ_w (1 − n₀) V⁰/(2l) a_v a_w/(1 + w_z) with
//! a_v = S_v + ζ* ∂S_v/∂z. The height and the slope of the level are those at the horizontal position of the point at the
//! start of the step.

use crate::assembly::{System, Wanted, add};
use crate::model::{Model, PORE_PRESSURE, Water as WaterOfModel, WetPart};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext, displacement};

use super::failure::{BeginError, EvaluateError};
use super::report::TermReport;
use super::term::{Character, Term};

/// Name under which the resultant of the water is reported.
pub const WATER: &str = "water";

/// Multiple of the largest vertical displacement of a node by which a point, with its domain, may approach the level: the
/// displacement of the point, and its stretch.
const REACH: f64 = 4.0;

/// The force of water at rest on the bodies.
#[derive(Debug)]
pub struct Water<const D: usize> {
    /// Force in the state from which the step starts, on the nodes of this step, [force].
    start: Nodal<D>,
    /// The points that the water of the step may touch.
    touched: Vec<Touched>,
    /// Largest vertical displacement of a node for which `near` holds all points that the level may cut, [length].
    reach: f64,
    /// Force on the other points, [force], and their resultant; empty before it is formed.
    far: Nodal<D>,
    far_resultant: [f64; D],
    /// Numbers, in `touched`, of the points that the level may cut.
    near: Vec<usize>,
    /// Resultant in the last evaluation, [force].
    resultant: [f64; D],
    /// Vertical displacement of the nodes in the last evaluation, for the pore pressure, [length].
    last: Nodal<D>,
}

impl<const D: usize> Default for Water<D> {
    fn default() -> Self {
        Water {
            start: Nodal::new(),
            touched: Vec::new(),
            reach: 0.0,
            far: Nodal::new(),
            far_resultant: [0.0; D],
            near: Vec::new(),
            resultant: [0.0; D],
            last: Nodal::new(),
        }
    }
}

/// A point near water or in it.
#[derive(Debug, Clone, Copy)]
struct Touched {
    point: usize,
    /// Half height of the domain, [length].
    half: f64,
    /// Height of the level above the point at the start of the step, [length].
    depth: f64,
    /// γ_w (1 − n₀) V⁰/(2l), [force/length].
    lift: f64,
    /// −γ_w V/(2l) times the slope of the level, [force/length].
    drag: f64,
}

impl Touched {
    /// The point at the start of a step, with the level at a time.
    fn new<const D: usize>(
        model: &Model<D>,
        water: &WaterOfModel,
        points: &Points<D>,
        point: usize,
        time: f64,
    ) -> Touched {
        let (body, x) = (usize::from(points.body[point]), &points.converged.position[point]);
        let half = model.half_height(points, point);
        let weight = model.water_factor(body, time) * water.unit_weight / (2.0 * half);
        let (height, slope) = water.height(x[0], time);
        let grains = water.grains(model.bodies[body].material) * points.original_volume[point];
        // A slope acts on the whole volume, and the extent of the body out of the plane is in both volumes.
        let drag = if slope == 0.0 { 0.0 } else { -weight * model.volume(points, point) * slope };
        Touched { point, half, depth: height - x[D - 1], lift: weight * grains, drag }
    }

    /// True if the level may cut the domain, or pass it, when no node moves by more than `reach`.
    fn is_near(&self, reach: f64) -> bool {
        self.depth.abs() <= self.half + REACH * reach
    }

    /// The force per unit of the values and of the vertical gradients of the basis functions, and the position of the
    /// level in the domain, for the vertical displacement `by` and its vertical gradient `stretch` in the step.
    fn force<const D: usize>(&self, by: f64, stretch: f64) -> ([f64; D], [f64; D], WetPart) {
        let wet = WetPart::new((self.depth - by) / (1.0 + stretch).max(f64::MIN_POSITIVE), self.half);
        // The drag does not change within the step.
        let dragged = WetPart::new(self.depth, self.half);
        let mut value = [0.0; D];
        let mut slope = [0.0; D];
        (value[0], slope[0]) = (self.drag * dragged.length, self.drag * dragged.moment);
        (value[D - 1], slope[D - 1]) = (self.lift * wet.length, self.lift * wet.moment);
        (value, slope, wet)
    }
}

/// The points that water may touch, with the level at a time.
fn touched<const D: usize>(model: &Model<D>, points: &Points<D>, time: f64) -> Vec<Touched> {
    let Some(water) = &model.water else { return Vec::new() };
    (0..points.len()).map(|p| Touched::new(model, water, points, p, time)).collect()
}

/// The force of the water on each point at the start of a step, with the level at a time, [force].
pub(crate) fn forces_on_points<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    time: f64,
) -> Vec<[f64; D]> {
    let at_start = |point: &Touched| point.force(0.0, 0.0).0;
    touched(model, points, time).iter().map(at_start).collect()
}

impl<const D: usize> Water<D> {
    /// Adds the force of a point at the start of the step to the nodes.
    fn add_at_start(step: &StepContext<D>, touched: &Touched, sum: &mut Nodal<D>, resultant: &mut [f64; D]) {
        let (value, slope, wet) = touched.force::<D>(0.0, 0.0);
        if wet.length == 0.0 && value == [0.0; D] {
            return;
        }
        (0..D).for_each(|d| resultant[d] += value[d]);
        let links = step.links;
        let nodes = links.nodes_of(links.group_of(touched.point));
        links.for_each_link(touched.point, |local, s, gradient| {
            let node = &mut sum[nodes[local] as usize];
            (0..D).for_each(|d| node[d] += value[d] * s + slope[d] * gradient[D - 1]);
        });
    }

    /// Forms the force on the points that the level cannot cut while no node moves by more than `reach`.
    fn divide(&mut self, step: &StepContext<D>, reach: f64) {
        (self.reach, self.far_resultant) = (reach, [0.0; D]);
        self.far = vec![[0.0; D]; step.links.n_active()];
        self.near.clear();
        for (number, touched) in self.touched.iter().enumerate() {
            if touched.is_near(reach) {
                self.near.push(number);
            } else {
                Water::add_at_start(step, touched, &mut self.far, &mut self.far_resultant);
            }
        }
    }
}

impl<const D: usize, const N: usize> Term<D, N> for Water<D> {
    fn name(&self) -> &'static str {
        "water"
    }

    fn character(&self, _: &Model<D>) -> Character {
        Character { may_slump: true, ..Character::SMOOTH }
    }

    fn begin(&mut self, context: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        let StepContext { model, links, step, .. } = *context;
        self.start = vec![[0.0; D]; links.n_active()];
        // Without initial stress, no load acts yet at time 0.
        if step.start > 0.0 || model.initial_imbalance.is_some() {
            let mut resultant = [0.0; D];
            for touched in &touched(model, points, step.start) {
                Water::add_at_start(context, touched, &mut self.start, &mut resultant);
            }
        }
        self.touched = touched(model, points, context.load_time());
        self.last = vec![[0.0; D]; links.n_active()];
        self.divide(context, 0.0);
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        let delta_d = displacement::<D, N>(at.delta_d);
        let largest = delta_d.iter().fold(0.0, |largest, u| f64::max(largest, u[D - 1].abs()));
        if largest > self.reach {
            self.divide(step, 2.0 * largest);
        }
        let mut forces = self.far.clone();
        self.resultant = self.far_resultant;
        let links = step.links;
        let symmetric = sum.is_symmetric();
        // The nodes of a point, with S_v and ∂S_v/∂z.
        let mut basis: Vec<(usize, f64, f64)> = Vec::new();
        for touched in self.near.iter().map(|number| &self.touched[*number]) {
            let nodes = links.nodes_of(links.group_of(touched.point));
            basis.clear();
            links.for_each_link(touched.point, |local, s, gradient| {
                basis.push((nodes[local] as usize, s, gradient[D - 1]));
            });
            let [mut by, mut stretch] = [0.0; 2];
            for (node, s, slope) in &basis {
                by += s * delta_d[*node][D - 1];
                stretch += slope * delta_d[*node][D - 1];
            }
            let (value, slope, wet) = touched.force::<D>(by, stretch);
            for d in 0..D {
                self.resultant[d] += value[d];
                basis.iter().for_each(|(node, s, g)| forces[*node][d] += value[d] * s + slope[d] * g);
            }
            let is_cut = wet.top.abs() < touched.half;
            if wanted == Wanted::Force || !is_cut {
                continue;
            }
            let stiffness = touched.lift / (1.0 + stretch);
            let arm = |(_, s, g): &(usize, f64, f64)| s + wet.top * g;
            for row in &basis {
                for column in basis.iter().filter(|column| !symmetric || row.0 >= column.0) {
                    let Some(place) = sum.place(row.0, column.0) else { continue };
                    let mut block = [[0.0; D]; D];
                    block[D - 1][D - 1] = stiffness * arm(row) * arm(column);
                    sum.add_displacement_block(place, &block);
                }
            }
        }
        add(&mut sum.external, &forces);
        self.last.copy_from_slice(&delta_d);
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<N>) {
        add(force, &self.start);
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        report.add_force(WATER, self.resultant);
    }

    /// The pore pressure at the positions at the end of the step, with the excess pressure of water that cannot leave.
    fn commit(&mut self, step: &StepContext<D>, points: &mut Points<D>) {
        let Some(handle) = points.further.handle(PORE_PRESSURE) else { return };
        let (model, links, n) = (step.model, step.links, points.history_len);
        let mut pressures = Vec::with_capacity(points.len());
        for p in 0..points.len() {
            let nodes = links.nodes_of(links.group_of(p));
            let mut x = points.converged.position[p];
            links.for_each_value(p, |local, s| {
                let u = &self.last[nodes[local] as usize];
                (0..D).for_each(|d| x[d] += s * u[d]);
            });
            let law = model.law(points, p);
            let history = &points.trial.history[p * n..][..law.state_fields().len()];
            let excess = law.excess_pore_pressure(history);
            let body = usize::from(points.body[p]);
            pressures.push(model.water_pressure(body, &x, step.step.end) + excess);
        }
        points.further.trial_mut(handle).copy_from_slice(&pressures);
    }
}
