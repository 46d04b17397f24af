//! Time spent in each phase of a run; `docs/verification/beam.md` compares the phases with Table 5 of the paper.

use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};

/// A phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Reading the deck, building the model, setting up the system of each step.
    SetUp,
    /// Linking points to nodes and evaluating basis functions.
    Basis,
    /// Internal force and stiffness.
    Assembly,
    /// Ordering and symbolic factorisation.
    Analyse,
    /// Numeric factorisation.
    Factorise,
    /// Forward and back substitution, and reactions.
    Solve,
    /// Moving points, updating domains, evaluating the quality measures of the step.
    Update,
    /// Writing results.
    Output,
}

impl Phase {
    /// All phases, in the order of a step.
    pub const ALL: [Phase; 8] = [
        Phase::SetUp,
        Phase::Basis,
        Phase::Assembly,
        Phase::Analyse,
        Phase::Factorise,
        Phase::Solve,
        Phase::Update,
        Phase::Output,
    ];

    /// Name in result files.
    pub fn name(self) -> &'static str {
        match self {
            Phase::SetUp => "set-up",
            Phase::Basis => "basis",
            Phase::Assembly => "assembly",
            Phase::Analyse => "analyse",
            Phase::Factorise => "factorise",
            Phase::Solve => "solve",
            Phase::Update => "update",
            Phase::Output => "output",
        }
    }
}

/// Wall-clock time and processor time of all threads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spent {
    /// Wall-clock time.
    pub wall: Duration,
    /// Processor time of all threads.
    pub cpu: Duration,
}

impl Spent {
    /// Adds another time.
    fn add(&mut self, other: &Spent) {
        self.wall = self.wall.saturating_add(other.wall);
        self.cpu = self.cpu.saturating_add(other.cpu);
    }
}

/// Time spent in each phase.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timings([Spent; Phase::ALL.len()]);

impl Timings {
    /// Runs `work` and adds its time to a phase.
    pub fn measure<T>(&mut self, phase: Phase, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let result = work();
        let spent = &mut self.0[phase as usize];
        spent.add(&Spent { wall: wall.elapsed(), cpu: cpu.elapsed() });
        result
    }

    /// Adds the times of `other`, phase by phase.
    pub fn add(&mut self, other: &Timings) {
        for (sum, spent) in self.0.iter_mut().zip(&other.0) {
            sum.add(spent);
        }
    }

    /// Time spent in a phase.
    pub fn spent(&self, phase: Phase) -> Spent {
        self.0[phase as usize]
    }
}
