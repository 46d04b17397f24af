//! The stages of an analysis whose bodies, materials, boundary conditions and loads change as it proceeds.

use serde::{Deserialize, Serialize};

use crate::points::Points;

use super::{
    Absorbed, BodyContact, BodyGroups, Control, Lift, Load, LoadCurve, Model, Newton, Released, Stepping,
};

/// A stage of an analysis: the changes at its beginning, and its load steps.
#[derive(Debug, Clone)]
pub struct Stage<const D: usize> {
    /// Name of the stage.
    pub name: String,
    /// Its load steps; they start where the previous stage ends.
    pub stepping: Stepping,
    /// Control of its Newton iterations.
    pub newton: Newton,
    /// Number of requested steps between two sets of VTU files, if it differs from the number for the run.
    pub every: Option<usize>,
    /// The course of the factor of each load of the model.
    pub loads: Vec<Course>,
    /// The course of the factor of each boundary condition.
    pub boundary_conditions: Vec<Course>,
    /// Boundary conditions that no longer act. The forces that they carried are released over the stage.
    pub released: Vec<usize>,
    /// Boundaries that absorb waves in place of conditions, which are among those that no longer act.
    pub absorbed: Vec<Absorbed<D>>,
    /// Boundary conditions that act again, or for the first time.
    pub set: Vec<usize>,
    /// The points of bodies that are added: undeformed, at their original positions, and in the initial state of the
    /// first material of their body. If this stage or an earlier one has given the body another material, the points
    /// begin with the same stress in that material.
    pub added: Points<D>,
    /// Which of the added bodies stand above which others; bodies are placed in this order.
    pub lifts: Vec<Lift<D>>,
    /// Bodies whose points are removed. The forces that they carried are released over the stage.
    pub removed: Vec<usize>,
    /// Bodies that get a different material, each with the index of that material. Their stress changes only where it
    /// lies outside the yield surface of that material.
    pub materials: Vec<(usize, usize)>,
    /// The contacts of the model and the groups of its bodies, if they change.
    pub contacts: Option<(Vec<BodyContact>, BodyGroups)>,
    /// True if the displacements are set to zero at the end of the stage.
    pub resets_displacement: bool,
}

/// The course of a factor over a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Course {
    /// The factor keeps its value.
    Stays,
    /// The factor changes linearly from its value at the start to this value at the end.
    Reaches(f64),
    /// The factor follows a curve over the time of the whole analysis.
    Own,
}

impl Course {
    /// Replaces the curve of a factor by its course over the stage; `stands` is the value at the start of the stage.
    pub(super) fn draw(self, curve: &mut LoadCurve, stepping: &Stepping, stands: f64) {
        let times = [stepping.start_time, stepping.end_time];
        match self {
            Course::Own => (),
            Course::Stays => *curve = LoadCurve::line(times, [stands; 2]),
            Course::Reaches(to) => *curve = LoadCurve::line(times, [stands, to]),
        }
    }
}

/// The factors of the loads and of the boundary conditions at a time, [-].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Factors {
    /// Factors of the loads.
    pub loads: Vec<f64>,
    /// Factors of the boundary conditions.
    pub boundary_conditions: Vec<f64>,
}

impl<const D: usize> Model<D> {
    /// The factors at the end of the current stage. If the load factor of the stage follows from equilibrium, `unknown`
    /// is its value: the share, reached so far, of the change of each load over the stage.
    #[inline(never)]
    pub fn factors_at_end(&self, unknown: f64) -> Factors {
        let Stepping { start_time, end_time, .. } = self.stepping;
        let reached = |load: &Load<D>| match self.stepping.control {
            Control::Load | Control::StrengthReduction { .. } => load.curve.factor(end_time),
            Control::Displacement { .. } | Control::ArcLength { .. } => {
                let stood = load.curve.factor(start_time);
                stood + unknown * (load.curve.factor(end_time) - stood)
            }
        };
        Factors {
            loads: self.loads.iter().map(reached).collect(),
            boundary_conditions: self.boundary_conditions.iter().map(|c| c.curve.factor(end_time)).collect(),
        }
    }

    /// Begins a stage: adopts its load steps, the variation of its load factors, its conditions and its materials.
    /// `stands` are the factors reached so far.
    pub fn begin_stage(&mut self, number: usize, stands: &Factors) {
        let Some(stage) = self.stages.get(number) else { return };
        let Stage { stepping, newton, loads, boundary_conditions, .. } = stage;
        (self.stepping, self.newton) = (stepping.clone(), *newton);
        for ((load, course), stands) in self.loads.iter_mut().zip(loads).zip(&stands.loads) {
            course.draw(&mut load.curve, stepping, *stands);
        }
        let conditions = self.boundary_conditions.iter_mut().zip(boundary_conditions);
        for ((condition, course), stands) in conditions.zip(&stands.boundary_conditions) {
            course.draw(&mut condition.curve, stepping, *stands);
        }
        self.present.absorbed.clone_from(&stage.absorbed);
        self.present.change_conditions(self.boundary_conditions.len(), stage);
        for &(body, material) in &stage.materials {
            self.bodies[body].material = material;
        }
        if let Some((contacts, groups)) = &stage.contacts {
            (self.contacts, self.body_groups) = (contacts.clone(), groups.clone());
        }
        self.present.stage = number;
        self.present.released = Released::default();
    }

    /// Time at the end of the analysis, [time].
    pub fn end_time(&self) -> f64 {
        self.stages.last().map_or(self.stepping.end_time, |stage| stage.stepping.end_time)
    }

    /// True if a stage reduces the strength of the materials.
    pub fn reduces_strength(&self) -> bool {
        let in_stages = self.stages.iter().map(|stage| &stage.stepping);
        in_stages.chain([&self.stepping]).any(|stepping| stepping.strength_factor(0.0).is_some())
    }

    /// True if a stage after the current one reduces the strength of the materials.
    pub fn reduces_strength_later(&self) -> bool {
        let later = self.stages.iter().skip(self.present.stage + 1);
        later.map(|stage| &stage.stepping).any(|stepping| stepping.strength_factor(0.0).is_some())
    }

    /// Number of requested steps of the analysis.
    pub fn steps_requested(&self) -> usize {
        if self.stages.is_empty() {
            return self.stepping.count;
        }
        self.stages.iter().map(|stage| stage.stepping.count).sum()
    }
}

/// The state of a model in its current stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Present<const D: usize> {
    /// Stage number, from 0.
    pub stage: usize,
    /// For each boundary condition, true if it does not act; empty if all conditions act.
    pub is_released: Vec<bool>,
    /// The boundaries that absorb waves.
    pub absorbed: Vec<Absorbed<D>>,
    /// The forces that maintain equilibrium at the start of the stage.
    pub released: Released<D>,
}

impl<const D: usize> Present<D> {
    /// Sets and releases boundary conditions as the stage specifies; `n` is the number of all conditions.
    pub fn change_conditions(&mut self, n: usize, stage: &Stage<D>) {
        self.is_released.resize(n, false);
        stage.released.iter().for_each(|&released| self.is_released[released] = true);
        stage.set.iter().for_each(|&set| self.is_released[set] = false);
    }
}
