//! Runs a deck of `inputs/` in memory and records the results that the tests check.

use std::path::Path;

use mpm::deck::{build::build, load::load};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{self, Observer, Reached, SolveError, StepReport, Summary};

/// One converged step.
#[derive(Debug, Clone)]
pub struct Record {
    pub residuals: Vec<f64>,
    pub probes: Vec<[f64; 2]>,
    pub reactions: Vec<[f64; 2]>,
}

/// A finished analysis.
pub struct Analysis {
    pub model: Model<2>,
    pub points: Points<2>,
    pub steps: Vec<Record>,
    pub summary: Result<Summary, SolveError>,
}

#[derive(Default)]
struct Recorder {
    steps: Vec<Record>,
}

impl Observer<2> for Recorder {
    fn converged(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        let place = points.by_id();
        let mean = |ids: &[u32]| {
            let mut u = [0.0; 2];
            for &id in ids {
                let p = place[id as usize];
                for (d, u) in u.iter_mut().enumerate() {
                    let moved = points.converged.position[p][d] - points.original_position[p][d];
                    *u += moved / ids.len() as f64;
                }
            }
            u
        };
        self.steps.push(Record {
            residuals: report.residuals.clone(),
            probes: model.probes.iter().map(|probe| mean(&probe.points)).collect(),
            reactions: report.reactions.clone(),
        });
        Ok(())
    }
}

/// Builds the model and points of a deck with parameters set.
pub fn build_deck(deck: &str, set: &[(&str, &str)]) -> (Model<2>, Points<2>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(deck);
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let loaded = load(&path, &set).unwrap_or_else(|e| panic!("{e}"));
    build(&loaded).unwrap_or_else(|e| panic!("{e:?}"))
}

/// Runs a deck given as text, with parameters set; paths in it are relative to the root of the sources.
pub fn run_text(text: &str, set: &[(&str, &str)]) -> Analysis {
    let set: Vec<(String, String)> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let name = concat!(env!("CARGO_MANIFEST_DIR"), "/deck.yaml");
    let loaded = mpm::deck::load::load_text(name, text.as_bytes(), &set).unwrap_or_else(|e| panic!("{e}"));
    let (model, points) = build(&loaded).unwrap_or_else(|e| panic!("{e:?}"));
    finish(model, points)
}

/// Runs a deck of `inputs/` with the volume of a point taken from its domain.
pub fn run_with_domain_volume(deck: &str, set: &[(&str, &str)]) -> Analysis {
    run(deck, &[set, &[("volume", "domain")]].concat())
}

/// Runs a deck with parameters set.
pub fn run(deck: &str, set: &[(&str, &str)]) -> Analysis {
    let (model, points) = build_deck(deck, set);
    finish(model, points)
}

fn finish(mut model: Model<2>, mut points: Points<2>) -> Analysis {
    // The paper does not cut steps, so the load steps stay as prescribed.
    model.stepping.smallest = 1.0;
    let mut recorder = Recorder::default();
    let reached = Reached::nothing(&points);
    let summary = solver::run_stages(&mut model, &mut points, reached, &mut recorder);
    let summary = summary.map(|reached| reached.summary);
    Analysis { model, points, steps: recorder.steps, summary }
}

/// Passes every converged step to a closure.
struct Watcher<F>(F);

impl<F: FnMut(&Points<2>, &StepReport<2>)> Observer<2> for Watcher<F> {
    fn converged(
        &mut self,
        _: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.0(points, report);
        Ok(())
    }
}

/// Runs a model and passes every converged step to `look`.
pub fn watch(
    model: &Model<2>,
    points: &mut Points<2>,
    look: impl FnMut(&Points<2>, &StepReport<2>),
) -> Result<Summary, SolveError> {
    solver::run(model, points, &mut Watcher(look)).map(|reached| reached.summary)
}

impl Analysis {
    /// Fails the test if the analysis did not reach its end.
    pub fn completed(self) -> Self {
        if let Err(error) = &self.summary {
            panic!("{error}");
        }
        self
    }

    /// Number of evaluations in all steps.
    pub fn evaluations(&self) -> usize {
        self.steps.iter().map(|s| s.residuals.len()).sum()
    }
}
