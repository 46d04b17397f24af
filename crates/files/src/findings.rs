//! Key results of a run: the balance of forces, the largest displacement and stresses, and statistics of the
//! iterations.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::solver::{ReactionMoment, StepReport, Summary};
use mpm_core::surface::SurfaceFields;
use mpm_core::terms::ToolState;

use super::fields::{pressure, von_mises_stress};

/// All external forces on the bodies at the end of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForceBalance {
    /// Sum of the loads along each axis, [force].
    pub applied: Vec<f64>,
    /// Name and resultant of each load, [force].
    pub loads: Vec<(String, Vec<f64>)>,
    /// Name and sum of each further force, such as the force of a tool or the force that a stage releases, [force].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further: Vec<(String, Vec<f64>)>,
    /// Name and reaction of each boundary condition, [force].
    pub reactions: Vec<(String, Vec<f64>)>,
    /// Moment of each of these reactions; empty for bodies of revolution.
    pub moments: Vec<Moment>,
    /// For each axis, true if forces balance along it; false for the radius of a body of revolution, where hoop
    /// stresses pull inwards.
    balanced: Vec<bool>,
    /// Sum of the absolute values of the components of all nodal reactions, surface forces and contact forces, or of
    /// the resultant load if that sum is larger, [force].
    scale: f64,
}

/// The moment of a reaction, [`mpm_core::solver::ReactionMoment`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// The position about which the moment is taken, [length]; `None` if the condition acts on no active node.
    pub about: Option<Vec<f64>>,
    /// Moment about each axis of rotation, [force·length].
    pub moment: Vec<f64>,
}

impl Moment {
    fn fits<const D: usize>(&self) -> bool {
        self.about.as_ref().is_none_or(|about| about.len() == D)
            && self.moment.len() == ReactionMoment::<D>::AXES.len()
    }
}

impl ForceBalance {
    /// The balance of a converged step. All ranks must call this together.
    pub fn new<const D: usize>(model: &Model<D>, report: &StepReport<D>) -> ForceBalance {
        let names = model.boundary_conditions.iter().map(|condition| condition.name.clone());
        let reactions = names.zip(report.reactions.iter().map(|r| r.to_vec())).collect();
        let halo = report.grid.links.halo();
        let own = report.grid.reaction.iter().enumerate().filter(|(node, _)| halo.is_own(*node));
        let nodal_force = halo.ranks().total(own.flat_map(|(_, reaction)| reaction).map(|r| r.abs()).sum());
        // A pressure on a closed surface has no resultant, so the magnitudes at its samples are summed.
        let (surfaces, tools) = (report.list::<SurfaceFields<D>>(), report.list::<ToolState<D>>());
        let surface_forces =
            surfaces.iter().flat_map(|surface| surface.reaction.iter().chain(&surface.load)).flatten();
        let tool_forces = tools.iter().flat_map(|tool| tool.contacts.iter().flat_map(|at| &at.force));
        let held = nodal_force + surface_forces.chain(tool_forces).map(|r| r.abs()).sum::<f64>();
        let applied = report.applied();
        let magnitude: f64 = applied.iter().map(|f| f.abs()).sum();
        let loads = model.loads.iter().zip(&report.loads);
        let moments = report.moments.iter().flatten().map(|moment| Moment {
            about: moment.about.map(|about| about.to_vec()),
            moment: moment.components().to_vec(),
        });
        let named = report.forces.iter().map(|named| (named.name.clone(), named.force.to_vec()));
        let tools = model.tools.iter().zip(tools);
        let further = named.chain(tools.map(|(tool, state)| (tool.name.clone(), state.force.to_vec())));
        ForceBalance {
            applied: applied.to_vec(),
            loads: loads.map(|(load, force)| (load.name.clone(), force.to_vec())).collect(),
            further: further.collect(),
            reactions,
            moments: moments.collect(),
            balanced: (0..D).map(|axis| !(model.revolved && axis == 0)).collect(),
            scale: held.max(magnitude),
        }
    }

    /// Sum of loads, reactions and further forces along each axis, [force]; `None` for an axis along which forces do
    /// not balance. The sum consists of the residual of the iterations, and of forces lost where basis functions do not
    /// add up to 1.
    pub fn difference(&self) -> Vec<Option<f64>> {
        let reactions = |axis: usize| self.reactions.iter().map(|(_, r)| r[axis]).sum::<f64>();
        let further = |axis: usize| self.further.iter().map(|(_, f)| f[axis]).sum::<f64>();
        let sum =
            |axis: usize| self.balanced[axis].then(|| self.applied[axis] + reactions(axis) + further(axis));
        (0..self.applied.len()).map(sum).collect()
    }

    /// Magnitude of the difference relative to all forces, [-]; `None` if there are no forces.
    pub fn relative_difference(&self) -> Option<f64> {
        let length = self.difference().iter().flatten().map(|f| f * f).sum::<f64>().sqrt();
        (self.scale > 0.0).then(|| length / self.scale)
    }
}

/// An extreme value of a field, and its location.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Extreme {
    /// The extreme value.
    pub value: f64,
    /// Name of the body.
    pub body: String,
    /// Permanent point number.
    pub point: u32,
    /// Position of the point, [length].
    pub position: Vec<f64>,
}

impl Extreme {
    fn or_larger(self, other: Extreme) -> Extreme {
        let order = other.value.total_cmp(&self.value).then(self.point.cmp(&other.point));
        if order.is_gt() { other } else { self }
    }

    fn or_smaller(self, other: Extreme) -> Extreme {
        let order = self.value.total_cmp(&other.value).then(self.point.cmp(&other.point));
        if order.is_gt() { other } else { self }
    }
}

/// Extreme values of the fields of the points in their converged state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Largest magnitude of the displacement, [length].
    pub displacement: Extreme,
    /// Largest von Mises stress √(3/2) |dev σ|, [stress].
    pub von_mises_stress: Extreme,
    /// Smallest pressure −tr σ/3, that is, the largest mean tension, [stress].
    pub lowest_pressure: Extreme,
    /// Largest pressure, [stress].
    pub highest_pressure: Extreme,
}

impl Extremes {
    /// Extremes of the converged state of the points of all ranks; `None` if there are no points. All ranks must call
    /// this together.
    pub fn new<const D: usize>(model: &Model<D>, points: &Points<D>) -> Option<Extremes> {
        let by_rank = points.ranks.gather_all(Extremes::local(model, points)).into_iter().flatten();
        by_rank.reduce(|a, b| Extremes {
            displacement: a.displacement.or_larger(b.displacement),
            von_mises_stress: a.von_mises_stress.or_larger(b.von_mises_stress),
            lowest_pressure: a.lowest_pressure.or_smaller(b.lowest_pressure),
            highest_pressure: a.highest_pressure.or_larger(b.highest_pressure),
        })
    }

    fn local<const D: usize>(model: &Model<D>, points: &Points<D>) -> Option<Extremes> {
        // Among points with the same value, the one with the smallest number is reported.
        let largest = |quantity: &(dyn Fn(usize) -> f64 + Sync)| {
            let best = (0..points.len())
                .into_par_iter()
                .map(|p| (quantity(p), p))
                .max_by(|a, b| a.0.total_cmp(&b.0).then(points.id[b.1].cmp(&points.id[a.1])));
            best.map(|(value, p)| Extreme {
                value,
                body: model.bodies[points.body[p] as usize].name.clone(),
                point: points.id[p],
                position: points.converged.position[p].to_vec(),
            })
        };
        let length = |p: usize| points.displacement(p).iter().map(|u| u * u).sum::<f64>().sqrt();
        let lowest = largest(&|p| -pressure(&points.cauchy_stress(p)))?;
        Some(Extremes {
            displacement: largest(&length)?,
            von_mises_stress: largest(&|p| von_mises_stress(&points.cauchy_stress(p)))?,
            lowest_pressure: Extreme { value: -lowest.value, ..lowest },
            highest_pressure: largest(&|p| pressure(&points.cauchy_stress(p)))?,
        })
    }
}

/// Largest error of each balance and the step in which it occurs; `None` if no step has such an error.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Error in the energy balance, [`Summary::energy_error`], in magnitude, [-].
    pub energy: Option<(f64, usize)>,
    /// Error in the force balance, [`ForceBalance::relative_difference`], [-].
    pub force: Option<(f64, usize)>,
    /// Error in the moment balance, [`StepReport::moment_error`], [-].
    pub moment: Option<(f64, usize)>,
}

/// Key results of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Smallest and largest number of linear solves in a step.
    pub iterations: Option<[usize; 2]>,
    /// Largest residual of a converged step, eq. (40), and the step, [-].
    pub worst_residual: Option<(f64, usize)>,
    /// Forces at the end of the last converged step.
    pub balance: Option<ForceBalance>,
    /// Largest errors of the balances over all steps.
    pub errors: Errors,
    /// Extreme values at the end of the last converged step.
    pub extremes: Option<Extremes>,
}

impl Findings {
    /// True if a run of this model can have these findings.
    pub(super) fn fits<const D: usize>(&self, model: &Model<D>) -> bool {
        self.balance.as_ref().is_none_or(|balance| {
            balance.applied.len() == D
                && balance.balanced.len() == D
                && balance.loads.len() == model.loads.len()
                && balance.loads.iter().all(|(_, force)| force.len() == D)
                && balance.further.iter().all(|(_, force)| force.len() == D)
                && balance.moments.len() == if model.revolved { 0 } else { model.boundary_conditions.len() }
                && balance.moments.iter().all(Moment::fits::<D>)
                && balance.reactions.len() == model.boundary_conditions.len()
                && balance.reactions.iter().all(|(_, reaction)| reaction.len() == D)
        })
    }

    /// Adds a converged step. All ranks must call this together.
    pub(super) fn accept<const D: usize>(
        &mut self,
        model: &Model<D>,
        report: &StepReport<D>,
        summary: &Summary,
    ) {
        let solves = report.solves();
        let [low, high] = self.iterations.unwrap_or([solves; 2]);
        self.iterations = Some([low.min(solves), high.max(solves)]);
        let keep_worst = |kept: &mut Option<(f64, usize)>, found: f64| {
            if kept.is_none_or(|(worst, _)| found > worst) {
                *kept = Some((found, report.step.index));
            }
        };
        keep_worst(&mut self.worst_residual, report.residuals.last().copied().unwrap_or(0.0));
        self.balance = Some(ForceBalance::new(model, report));
        keep_worst(&mut self.errors.energy, summary.energy_error().abs());
        let force_error = self.force_error();
        keep_worst(&mut self.errors.force, force_error);
        if let Some(error) = report.moment_error {
            keep_worst(&mut self.errors.moment, error);
        }
    }

    /// Error of the balance of forces at the end of the last converged step; 0 if there are no forces, [-].
    pub(super) fn force_error(&self) -> f64 {
        self.balance.as_ref().and_then(ForceBalance::relative_difference).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mpm_core::solver::{self, Observer, Reached};
    use mpm_deck::{build::build, load::load_text};

    #[derive(Default)]
    struct Keeper(Findings);

    impl<const D: usize> Observer<D> for Keeper {
        fn converged(
            &mut self,
            model: &Model<D>,
            _points: &Points<D>,
            report: &StepReport<D>,
            reached: &Reached,
        ) -> std::io::Result<()> {
            self.0.accept(model, report, &reached.summary);
            Ok(())
        }
    }

    /// Findings for a square under its weight and a body force, in a grid of this height.
    fn findings(method: &str, top: f64, force: [f64; 2]) -> Findings {
        let deck = format!(
            "version: 1
grid: {{type: structured, origin: [0, 0], size: [2, {top}], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e3, poisson: 0.2, density: 3}}}}
bodies: [{{name: b, material: m, shape: {{type: box, min: [0, 0], max: [2, 2]}}, {method}, points_per_cell: 2}}]
boundary_conditions:
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 2}}, ux: 0}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, -2]}}
  - {{name: push, type: body-force, force: {force:?}}}
steps: {{count: 4}}"
        );
        let (model, mut points) = build::<2>(&load_text("deck", deck.as_bytes(), &[]).unwrap()).unwrap();
        let mut keeper = Keeper::default();
        solver::run(&model, &mut points, &mut keeper).unwrap();
        let mut findings = keeper.0;
        findings.extremes = Extremes::new(&model, &points);
        findings
    }

    #[test]
    fn reactions_balance_weight_and_body_force() {
        let found = findings("method: mpm", 4.0, [5.0, 7.0]);
        let balance = found.balance.unwrap();
        // A weight of 3 · 2 · 4, and a body force on the volume at the start of the last step.
        assert!(balance.applied[1] > -24.0 && balance.applied[1] < 7.0 * 4.1 - 24.0, "{:?}", balance.applied);
        assert!((balance.applied[0] / (balance.applied[1] + 24.0) - 5.0 / 7.0).abs() < 1e-12);
        assert_eq!(balance.reactions.len(), 3);
        assert!(balance.relative_difference().unwrap() < 1e-9, "{balance:?}");
        assert!(balance.difference().iter().all(|f| f.unwrap().abs() < 1e-7));
        let [low, high] = found.iterations.unwrap();
        assert!(1 <= low && low <= high && high < 10);
        assert!(found.worst_residual.unwrap().0 <= 1e-9);
    }

    /// The body stretches beyond the top of the grid, where there are no basis functions: the load lost there appears
    /// as a difference.
    #[test]
    fn a_load_that_basis_functions_lose_is_a_difference() {
        let gimp = "method: gimp, domain_update: none";
        let whole = findings(gimp, 4.0, [0.0, 7.0]).balance.unwrap();
        let cut = findings(gimp, 2.0, [0.0, 7.0]).balance.unwrap();
        assert!(whole.relative_difference().unwrap() < 1e-9);
        assert!(cut.relative_difference().unwrap() > 1e-4, "{cut:?}");
    }

    #[test]
    fn extremes_are_those_of_a_column() {
        let Extremes { displacement, von_mises_stress, lowest_pressure, highest_pressure } =
            findings("method: mpm", 4.0, [0.0, 7.0]).extremes.unwrap();
        // The net body force points up: the displacement is largest at the top, the tension at the base.
        assert!(displacement.value > 0.0 && displacement.position[1] > 1.7);
        assert!(von_mises_stress.value > 0.0 && von_mises_stress.position[1] < 0.3);
        assert!(lowest_pressure.value < highest_pressure.value && lowest_pressure.position[1] < 0.3);
        assert_eq!(displacement.body, "b");
    }
}
