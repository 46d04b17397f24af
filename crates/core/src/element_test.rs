//! Element tests: a single material point follows a path of strain or stress, without a grid.
//!
//! The deformation gradient of the point is F = exp(e) (I + γ e_x ⊗ e_y). On every [`Path`] except simple shear, γ = 0
//! and the principal axes are fixed; e is then the logarithmic strain measured from the start, and ln J = tr e holds
//! without round-off. A [`Target`] prescribes e and γ, or the Cauchy stress along an axis in place of the strain. The
//! components of e that are then unknown follow from Newton's method with the consistent tangent of the law, including
//! the change of J.
//!
//! A test begins at an initial stress, because a law need not have a stress-free state.
#![allow(non_snake_case)]

mod error;
mod jump;
mod path;
mod response;
mod solution;
mod state;
#[cfg(test)]
mod tests;

use crate::material::{Material, MaterialError, initial_state};
use crate::tensor::Sym3;

pub use error::{Cause, ElementTestError};
pub use path::{Control, Path, Target};
pub use state::ElementState;

/// Largest relative difference at which two stresses count as equal, [-].
const SAME_STRESS: f64 = 1e-9;
/// Largest stress at zero strain that counts as round-off, relative to the stiffness of the law, [-].
const NO_STRESS: f64 = 1e-13;
/// Smallest part of a step that is attempted, [-].
const SMALLEST_PART: f64 = 1.0 / 1024.0;

/// A material point on its way along a path.
#[derive(Debug, Clone)]
pub struct ElementTest<'a> {
    law: &'a dyn Material,
    state: ElementState,
    /// Cauchy stress of the initial state, [stress].
    initial_stress: Sym3,
    /// True if the law has replaced the initial stress by one on its yield surface.
    was_returned: bool,
    /// Number of steps completed.
    steps: usize,
}

impl<'a> ElementTest<'a> {
    /// A material point at J = 1 with an initial Cauchy stress, [stress], and the initial history variables `history`
    /// of its law. The state is that of [`initial_state`], so a stress outside the yield surface is returned to it.
    ///
    /// # Errors
    /// [`ElementTestError::Initial`] if the law cannot begin with this stress. A law without an inverse can begin only
    /// without stress, at zero strain.
    pub fn new(law: &'a dyn Material, history: &[f64], stress: &Sym3) -> Result<Self, ElementTestError> {
        let state = match initial_state(law, stress, 1.0, history) {
            Err(MaterialError::NoInverse) if *stress == Sym3::ZERO => at_zero_strain(law, history),
            begun => begun.map(|begun| ElementState {
                strain: Sym3::ZERO,
                shear: 0.0,
                elastic_strain: begun.elastic_strain,
                kirchhoff_stress: begun.tau,
                history: begun.history,
                has_jumped: false,
            }),
        };
        let state = state.map_err(ElementTestError::Initial)?;
        let initial_stress = state.cauchy_stress();
        let was_returned = (initial_stress - *stress).norm() > SAME_STRESS * stress.norm();
        Ok(ElementTest { law, state, initial_stress, was_returned, steps: 0 })
    }

    /// The state at the end of the last completed step.
    pub fn state(&self) -> &ElementState {
        &self.state
    }

    /// Cauchy stress of the initial state, [stress].
    pub fn initial_stress(&self) -> &Sym3 {
        &self.initial_stress
    }

    /// True if the requested initial stress was outside the yield surface, so that the test begins with a different
    /// stress.
    pub fn was_returned(&self) -> bool {
        self.was_returned
    }

    /// Takes the point to a target in one step. A step without a solution is divided: its parts are halved until each
    /// has a solution, down to 1/1024 of the step.
    ///
    /// # Errors
    /// [`ElementTestError::Step`] if a part has no solution; the point is then in the state before the step.
    pub fn advance(&mut self, target: &Target) -> Result<&ElementState, ElementTestError> {
        let begin = &self.state;
        let mut state = ElementState { has_jumped: false, ..begin.clone() };
        let (mut reached, mut part) = (0.0, 1.0);
        while reached < 1.0 {
            let next = reached + part;
            let goal = target.between(begin, next);
            match solution::solve(self.law, &state, &goal) {
                Ok(solved) => {
                    let has_jumped = state.has_jumped || jump::is_between(self.law, &state, &goal, &solved);
                    (state, reached) = (ElementState { has_jumped, ..solved }, next);
                    // Parts are the step divided by powers of two, and begin at multiples of their size, so the last
                    // part ends with the step.
                    if part < 1.0 && (reached / (2.0 * part)).fract() == 0.0 {
                        part *= 2.0;
                    }
                }
                Err(_) if part > SMALLEST_PART => part *= 0.5,
                Err(cause) => {
                    let step = self.steps + 1;
                    return Err(ElementTestError::Step { step, reached, cause });
                }
            }
        }
        self.state = state;
        self.steps += 1;
        Ok(&self.state)
    }

    /// The states at the ends of the steps along a sequence of targets. Each target is approached in `steps` equal
    /// steps (at least one). The sequence of states ends after the first error.
    pub fn follow(
        mut self,
        targets: impl IntoIterator<Item = Target>,
        steps: usize,
    ) -> impl Iterator<Item = Result<ElementState, ElementTestError>> {
        let steps = steps.max(1);
        let mut targets = targets.into_iter();
        let mut leg: Option<(ElementState, Target, usize)> = None;
        let mut has_failed = false;
        std::iter::from_fn(move || {
            if has_failed {
                return None;
            }
            let (begin, target, done) = match leg.take().filter(|(.., done)| *done < steps) {
                Some(going_on) => going_on,
                None => (self.state.clone(), targets.next()?, 0),
            };
            let state = self.advance(&target.between(&begin, (done + 1) as f64 / steps as f64)).cloned();
            has_failed = state.is_err();
            leg = Some((begin, target, done + 1));
            Some(state)
        })
    }
}

/// The state at zero elastic strain, where the stress of a law without an inverse must be zero.
fn at_zero_strain(law: &dyn Material, history: &[f64]) -> Result<ElementState, MaterialError> {
    let mut history = history.to_vec();
    law.start_from(&Sym3::ZERO, 1.0, &mut history);
    let response = law.update(&Sym3::ZERO, &history, &mut history.clone())?;
    if response.tau.norm() > NO_STRESS * response.tangent.norm() {
        return Err(MaterialError::NoInverse);
    }
    Ok(ElementState {
        strain: Sym3::ZERO,
        shear: 0.0,
        elastic_strain: Sym3::ZERO,
        kirchhoff_stress: response.tau,
        history,
        has_jumped: false,
    })
}
