//! Damped iterations: their increment, and the stability check of the equilibrium that they find.

use crate::linear::{LinearError, Solved};
use crate::step::displacement;
use crate::timing::Phase;

use super::attempt::NoIncrement;
use super::damping::{AT_REST, Damping, MOST_FACTORISATIONS, farthest};
use super::equations::RightHandSide;
use super::load_step::{LoadStep, smallest_cell};
use super::step_system::StepSystem;
use super::unknowns::Unknowns;

impl<const D: usize, const N: usize> LoadStep<'_, D, N> {
    /// A Newton step with the stiffness damped until it is positive definite.
    pub(super) fn damped_step(&mut self) -> Result<Option<Solved>, NoIncrement> {
        let LoadStep { context, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, damping, stride, .. } = self;
        let (equation_context, tolerance) = (context.equations(dofs), context.model.newton.tolerance);
        let ranks = context.links.halo().ranks();
        let (system, timings) = (sum.system_mut(), &mut summary.timings);
        if let Some(damping) = damping {
            damping.adapt(course.shortened);
        }
        let damping = damping.get_or_insert_with(|| Damping::new(system));
        unknowns.begin_iteration(system, dofs, &course.out_of_balance);
        damping.add_to(system);
        let prescribed = unknowns.iterative.clone();
        let mut tries = 0;
        let (solved, globals) = loop {
            tries += 1;
            let Unknowns { rhs, iterative, .. } = &mut *unknowns;
            iterative.clone_from(&prescribed);
            let rhs = RightHandSide { forces: rhs, globals: None };
            let solved = equations.solve(equation_context, system, rhs, iterative, tolerance, timings);
            match solved {
                Ok((solved, globals)) if solved.factorisation.is_definite() => break (solved, globals),
                outcome if tries == MOST_FACTORISATIONS => break outcome?,
                _ => damping.increase(system),
            }
        };
        unknowns.iterative_globals = globals;
        let far = ranks.largest(farthest(&displacement::<D, N>(&unknowns.iterative)));
        if far > *stride {
            let part = *stride / far;
            unknowns.iterative.iter_mut().flatten().for_each(|u| *u *= part);
            unknowns.iterative_globals.iter_mut().for_each(|w| *w *= part);
        }
        timings.measure(Phase::Solve, || unknowns.advance(system, dofs, &course.out_of_balance))?;
        Ok(Some(solved))
    }

    /// Checks that the undamped stiffness of an equilibrium found by damped iterations resists every motion, so that
    /// the points stay there without damping.
    pub(super) fn check_stability(&mut self) -> Result<(), LinearError> {
        let LoadStep { context, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, .. } = self;
        let system = sum.system_mut();
        unknowns.begin_iteration(system, dofs, &course.out_of_balance);
        let Unknowns { rhs, iterative, .. } = unknowns;
        let rhs = RightHandSide { forces: rhs, globals: None };
        let (equation_context, tolerance) = (context.equations(dofs), context.model.newton.tolerance);
        let (solved, _) =
            equations.solve(equation_context, system, rhs, iterative, tolerance, &mut summary.timings)?;
        let at_rest = AT_REST * smallest_cell(context.model, context.links);
        let far = context.links.halo().ranks().largest(farthest(&displacement::<D, N>(iterative)));
        if solved.factorisation.is_definite() && far <= at_rest {
            return Ok(());
        }
        Err(LinearError::Singular { unknown: None })
    }
}
