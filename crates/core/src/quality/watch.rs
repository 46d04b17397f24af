//! The checks of a step other than the measures of its points: parts that come apart, nodes that the material leaves,
//! gaps across which bodies act on each other, instability, and balances of work and energy.

use super::cohesion::Cohesion;
use super::collective;
use super::overstress::overstress;
use super::pressure::{InFlow, oscillation_in_flow};
use super::thresholds::{
    HARMFUL_REGRIDDING, MAX_BOX_ROTATION, MAX_CROSSINGS, MAX_DEFECT, MAX_DILATING_OSCILLATION,
    MAX_ENERGY_ERROR, MAX_OSCILLATION, MAX_REGRIDDING,
};
use super::warning::{Code, Detail, Location, Warning};
use super::{Quality, Worst, contrast, gaps, holding, passing};
use crate::equilibrium::StepReport;
use crate::material::Material;
use crate::model::{Body, Model};
use crate::points::{Points, coordinates};
use crate::tensor::Sym3;

/// First step at which the balances are judged: after fewer steps, their error is large anyway.
const FIRST_BALANCE: usize = 5;
/// Work counts as round-off if it is less than the work that a strain of this size does, [-].
const STRAIN_OF_ROUND_OFF: f64 = 1e-6;
/// Root mean square error of the stresses of points without a domain, relative to the square root of the regridding
/// share, [-]; an empirical value.
const STRESS_BY_REGRIDDING: f64 = 0.6;

/// Bodies count as elastic while the plastic work is less than this fraction of the stored energy, [-].
const ELASTIC: f64 = 1e-3;

/// Largest fraction of the forces on a body that may be out of balance without a warning, [-].
const MAX_BODY_IMBALANCE: f64 = 1e-4;
/// Fraction of the forces on a body that should remain out of balance at the tolerance that the warning recommends,
/// [-].
const FINE_RESIDUAL: f64 = 1e-6;
/// Smallest tolerance that residuals can meet in spite of round-off, [-].
const MIN_TOLERANCE: f64 = 1e-13;

impl Quality {
    /// Checks a step that is in equilibrium but not committed, like [`super::Measures::new`]; returns the warnings that
    /// are raised for the first time.
    pub fn watch<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
    ) -> Vec<Warning> {
        let (links, step) = (&report.grid.links, report.step.index);
        let mut found = Cohesion::watch(&mut self.cohesion, model, points, &report.grid, step);
        found.extend(holding::watch(&mut self.held, model, points, links, &report.grid.delta_d, step));
        found.extend(passing::watch(model, points, links, &report.grid.delta_d, step));
        found.extend(gaps::watch(model, points, links, step));
        found.extend(contrast::watch(model, points, links, step));
        found.extend(self.turned_boxes(model, step));
        found.extend(hidden_residuals(model, report));
        found.extend(report.damped.then(|| (0, damped(step, report.energy.damping_work != 0.0))));
        self.was_stable |= report.factorisations.first().is_some_and(|first| first.is_definite());
        let flows = report.energy.plastic_work > ELASTIC * report.energy.strain_energy;
        // Indefinite stiffnesses are expected beyond a limit point when a path is followed, and in bodies that flow. If
        // the stiffness has never been definite, round-off decides its sign. A step whose predicted state was in
        // equilibrium has no factorisation.
        if self.was_stable && !model.stepping.control.has_unknown_factor() && !flows {
            found.extend(report.is_unstable.then(|| (0, unstable(step))));
        }
        if report.viscosity > 0.0 {
            let value = overstress(model, points);
            if self.overstress.is_none_or(|(worst, _)| value > worst) {
                self.overstress = Some((value, step));
            }
            found.push((0, viscous(step, value, report.viscous_share())));
        }
        found.extend(replaced_domains(model, points, report).map(|warning| (0, warning)));
        if let Some(found_in_flow) = oscillation_in_flow(model, points, links) {
            let InFlow { value, dilates, .. } = found_in_flow;
            if self.pressure_oscillation.is_none_or(|(worst, _)| value > worst) {
                self.pressure_oscillation = Some((value, step));
            }
            let limit = if dilates { MAX_DILATING_OSCILLATION } else { MAX_OSCILLATION };
            found.extend((value > limit).then(|| (0, locking(&found_in_flow, limit, step))));
        }
        let found = collective::all_warnings(&points.ranks, found);
        self.for_the_first_time(found)
    }

    /// Judges the balances of the steps so far; returns the warnings that are raised for the first time.
    pub fn judge_balances<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        balance: &BalanceSoFar,
        step: usize,
    ) -> Vec<Warning> {
        if balance.steps < FIRST_BALANCE {
            return Vec::new();
        }
        let mut found = Vec::new();
        found.extend(balance.regridding_warning(step).map(|warning| (0, warning)));
        found.extend(balance.energy_warning(step).map(|warning| (0, warning)));
        if balance.moving >= FIRST_BALANCE {
            found.extend(balance.defect_warning(step).map(|warning| (0, warning)));
        }
        found.extend(self.crossings(model, balance, step));
        if found.is_empty() || balance.gross_work <= work_of_round_off(model, points) {
            return Vec::new();
        }
        self.for_the_first_time(found)
    }

    /// True if a warning about the whole run is raised for the first time; it then counts as raised.
    pub fn is_first(&mut self, code: Code) -> bool {
        self.raised.insert((code, 0))
    }

    /// The warning that steps have been shorter than `least` for a long time: they have this size, both relative to a
    /// requested step, [-], for this cause; `None` if it has been raised before.
    pub fn crawls(&mut self, step: usize, [size, least]: [f64; 2], cause: Option<&str>) -> Option<Warning> {
        let cause = cause.map(|cause| format!("; longer ones fail, probably for this cause: {cause}"));
        self.is_first(Code::Crawls).then(|| Warning {
            code: Code::Crawls,
            step,
            location: Location::default(),
            value: Some(size),
            threshold: Some(least),
            message: format!(
                "the run crawls: its steps are 1/{:.0} of the requested size{}",
                1.0 / size,
                cause.unwrap_or_default()
            ),
            detail: None,
        })
    }

    fn for_the_first_time(&mut self, found: Vec<(usize, Warning)>) -> Vec<Warning> {
        let is_new = |(number, warning): &(usize, Warning)| self.raised.insert((warning.code, *number));
        found.into_iter().filter(is_new).map(|(_, warning)| warning).collect()
    }

    /// Mean number of cell boundaries that a point of a body has crossed, [-]; `None` if the points have domains.
    pub fn mean_crossings(&self, body: usize) -> Option<f64> {
        let [crossings, points] = *self.crossed.get(body)?;
        (points > 0).then(|| crossings as f64 / points as f64)
    }

    /// Material at the nodes of a boundary condition, relative to the most that they have ever held, [-]; `None` if the
    /// condition moves no given nodes, or if they have never held any material.
    pub fn held_by_nodes(&self, condition: usize) -> Option<f64> {
        self.held.get(condition)?.share()
    }

    fn crossings<const D: usize>(
        &self,
        model: &Model<D>,
        balance: &BalanceSoFar,
        step: usize,
    ) -> Vec<(usize, Warning)> {
        let share = balance.regridding().abs();
        let warning = |(number, body): (usize, &Body)| {
            let value = self.mean_crossings(number).filter(|value| *value > MAX_CROSSINGS)?;
            let name = &body.name;
            let error = 100.0 * STRESS_BY_REGRIDDING * share.sqrt();
            Some((
                number,
                Warning {
                    code: Code::Crossings,
                    step,
                    location: Location::body(name),
                    value: Some(value),
                    threshold: Some(MAX_CROSSINGS),
                    message: format!(
                        "body `{name}`: its points, which have no domains, have crossed cell boundaries {value:.2} \
                         times on average; stresses are probably wrong by about {error:.0} % (root mean square)"
                    ),
                    detail: None,
                },
            ))
        };
        if share > HARMFUL_REGRIDDING {
            model.bodies.iter().enumerate().filter_map(warning).collect()
        } else {
            Vec::new()
        }
    }

    fn turned_boxes<const D: usize>(&self, model: &Model<D>, step: usize) -> Option<(usize, Warning)> {
        let Worst { value, body, .. } = self.box_rotation.filter(|worst| worst.value > MAX_BOX_ROTATION)?;
        let name = &model.bodies[body].name;
        let warning = Warning {
            code: Code::TurnedBoxes,
            step,
            location: Location::body(name),
            value: Some(value),
            threshold: Some(MAX_BOX_ROTATION),
            message: format!(
                "body `{name}` has turned by {value:.0}° on average, but the domains of its points remain boxes along the \
                 axes and overlap; stresses from before the rotation are wrong by 3 % (root mean square) after 45°, by 9 % \
                 after 90°"
            ),
            detail: None,
        };
        Some((body, warning))
    }
}

/// Energy of all points under the largest strain that counts as round-off, [energy].
fn work_of_round_off<const D: usize>(model: &Model<D>, points: &Points<D>) -> f64 {
    let strain = Sym3([STRAIN_OF_ROUND_OFF, STRAIN_OF_ROUND_OFF, STRAIN_OF_ROUND_OFF, 0.0, 0.0, 0.0]);
    let energy = |law: &dyn Material| law.energy(&strain, &law.initial_history());
    let energies: Vec<f64> = model.materials.iter().map(|material| energy(material.law.as_ref())).collect();
    let energy = |p: usize| energies[model.bodies[points.body[p] as usize].material];
    points.reduction().total((0..points.len()).map(|p| energy(p) * points.original_volume[p]).sum())
}

fn hidden_residuals<const D: usize>(model: &Model<D>, report: &StepReport<D>) -> Vec<(usize, Warning)> {
    let warning = |(number, value): (usize, &f64)| {
        let name = &model.bodies[number].name;
        let tolerance = model.newton.tolerance * (FINE_RESIDUAL / value);
        let is_possible = tolerance >= MIN_TOLERANCE;
        let warning = Warning {
            code: Code::HiddenResidual,
            step: report.step.index,
            location: Location::body(name),
            value: Some(*value),
            threshold: Some(MAX_BODY_IMBALANCE),
            message: format!(
                "body `{name}`: {:.2} % of the forces on it are out of balance, hidden by the larger forces on the bodies \
                 connected to it",
                100.0 * value
            ),
            detail: Some(if is_possible { Detail::Tolerance(tolerance) } else { Detail::RoundOff }),
        };
        (number, warning)
    };
    let bodies = report.body_residuals.iter().enumerate();
    bodies.filter(|(_, value)| **value > MAX_BODY_IMBALANCE).map(warning).collect()
}

fn unstable(step: usize) -> Warning {
    Warning {
        code: Code::Unstable,
        step,
        location: Location::default(),
        value: None,
        threshold: None,
        message: "the stiffness is not positive definite: this equilibrium is not stable, and the slightest disturbance \
                  moves the bodies away from it"
            .to_owned(),
        detail: None,
    }
}

fn damped(step: usize, slumped: bool) -> Warning {
    let way = if slumped {
        "the bodies have slumped, through states out of equilibrium, until they came to rest: the load before this step is \
         about the largest that they carried without slumping"
    } else {
        "this equilibrium may lie beyond an instability; the states before it are then unknown, and a dynamic analysis could \
         reach a different state"
    };
    Warning {
        code: Code::Damped,
        step,
        location: Location::default(),
        value: None,
        threshold: None,
        message: format!(
            "only damped iterations found an equilibrium: smaller steps and undamped iterations failed; {way}"
        ),
        detail: None,
    }
}

fn viscous(step: usize, overstress: f64, share: f64) -> Warning {
    Warning {
        code: Code::Viscous,
        step,
        location: Location::default(),
        value: Some(overstress),
        threshold: None,
        message: format!(
            "only with viscosity do the iterations follow the flow of the bodies: their stresses exceed the strength by \
             {:.1} % in the mean where they flow, and the forces that move them are {:.1} % too large",
            100.0 * overstress,
            100.0 * share
        ),
        detail: None,
    }
}

fn replaced_domains<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    report: &StepReport<D>,
) -> Option<Warning> {
    let (count, &first) = (report.replaced_domains.len(), report.replaced_domains.first()?);
    let p = points.id.iter().position(|id| *id == first)?;
    let position = points.trial.position[p];
    let location = Location {
        position: Some(position.to_vec()),
        ..Location::point(&model.bodies[points.body[p] as usize].name, first)
    };
    let (at, shape) = (coordinates(&position), if D == 3 { "parallelepiped" } else { "parallelogram" });
    let message = if count == 1 {
        format!(
            "the motion has torn the domain of point {first} at {at} or carried it off the grid; a {shape} that follows \
             the deformation gradient now replaces it"
        )
    } else {
        format!(
            "the motion has torn the domains of {count} points or carried them off the grid, first that of point \
             {first} at {at}; {shape}s that follow the deformation gradient now replace them"
        )
    };
    Some(Warning {
        code: Code::ReplacedDomains,
        step: report.step.index,
        location,
        value: Some(count as f64),
        threshold: Some(0.0),
        message,
        detail: None,
    })
}

fn locking(found: &InFlow, limit: f64, step: usize) -> Warning {
    let InFlow { value, is_standard, dilates } = *found;
    let consequence = if dilates {
        "the grid locks in flow that dilates; limit loads are too large by a tenth to a half"
    } else if is_standard {
        "the grid locks in volume-preserving plastic flow; limit loads are too large by a third or more"
    } else {
        "pressures alternate from cell to cell, and points carry them from one cell into the next"
    };
    Warning {
        code: Code::Locking,
        step,
        location: Location::default(),
        value: Some(value),
        threshold: Some(limit),
        message: format!(
            "where bodies yield, the pressures of the points of a cell differ by {value:.2} times the deviatoric \
             stress (root mean square): {consequence}"
        ),
        detail: match dilates {
            true => Some(Detail::DilatingFlow),
            false => is_standard.then_some(Detail::StandardDilatation),
        },
    }
}

/// Work and energy of the steps so far.
#[derive(Debug, Clone, Copy)]
pub struct BalanceSoFar {
    /// Number of converged steps.
    pub steps: usize,
    /// Number of these steps in which bodies move with inertia.
    pub moving: usize,
    /// Work of loads and reactions, [energy].
    pub external_work: f64,
    /// Work of the forces that are out of balance on fresh grids, [energy].
    pub regridding_work: f64,
    /// Sum of the magnitudes of the work of all steps, [energy].
    pub gross_work: f64,
    /// Error of the energy balance, `solver::Summary::energy_error`, [-].
    pub energy_error: f64,
    /// Error of the integration in time relative to the sum of the magnitudes of all work, [-].
    pub defect: f64,
}

impl BalanceSoFar {
    /// Regridding work relative to the external work, or to the sum of the magnitudes of all work if that is larger, as
    /// on a path that turns back, [-]; 0 without work.
    pub fn regridding(&self) -> f64 {
        let all = self.external_work.abs().max(self.gross_work);
        if all > 0.0 { self.regridding_work / all } else { 0.0 }
    }

    fn regridding_warning(&self, step: usize) -> Option<Warning> {
        let value = self.regridding();
        (value.abs() > MAX_REGRIDDING).then(|| Warning {
            code: Code::Regridding,
            step,
            location: Location::default(),
            value: Some(value),
            threshold: Some(MAX_REGRIDDING),
            message: format!(
                "the forces left out of balance each time the grid is reset have done work equal to {:.0} % of the \
                 external work: displacements and stresses depend on the grid and on the number of steps",
                100.0 * value.abs()
            ),
            detail: None,
        })
    }

    fn defect_warning(&self, step: usize) -> Option<Warning> {
        let value = self.defect;
        (value.abs() > MAX_DEFECT).then(|| Warning {
            code: Code::TimeIntegration,
            step,
            location: Location::default(),
            value: Some(value),
            threshold: Some(MAX_DEFECT),
            message: format!(
                "the integration in time has {} energy equal to {:.0} % of all work: the steps are too long for what the \
                 material does in them",
                if value > 0.0 { "lost" } else { "created" },
                100.0 * value.abs()
            ),
            detail: None,
        })
    }

    fn energy_warning(&self, step: usize) -> Option<Warning> {
        let value = self.energy_error;
        (value.abs() > MAX_ENERGY_ERROR).then(|| Warning {
            code: Code::Energy,
            step,
            location: Location::default(),
            value: Some(value),
            threshold: Some(MAX_ENERGY_ERROR),
            message: format!(
                "the work and the sum of stored and dissipated energy differ by {:.0} % of the total work",
                100.0 * value.abs()
            ),
            detail: None,
        })
    }
}
