//! The linear equations of an iteration, eq. (26), and the choice of how to solve them.

use std::sync::Arc;

use crate::assembly::{FreeEntries, System};
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::linear::{
    Choice, Direct, Embedding, Extent, Factorisation, Krylov, LinearError, LinearSolver, Named, Pattern,
    ordering,
};
use crate::model::{Model, Patterns};
use crate::timing::{Phase, Timings};

/// Solves K δd = r on the free degrees of freedom, directly or iteratively, with all that is kept from step to step.
#[derive(Default)]
pub(super) struct Equations<const D: usize> {
    method: Method,
    direct: Direct,
    entries: FreeEntries,
    /// Values of the entries, or the right-hand side.
    values: Vec<f64>,
    /// The pattern that has been analysed, where it is to serve for those that it contains, and where the one in hand is in
    /// it, unless it is the same.
    kept: Option<Arc<Named>>,
    embedding: Option<Embedding>,
    iterative: Krylov<D>,
    /// How the last system that was solved directly was factorised.
    factorised: Option<Factorisation>,
    solution: Vec<[f64; D]>,
    /// Why equations that should have been solved iteratively were not, the first time.
    turned: Option<LinearError>,
    told: bool,
}

/// How the equations of a step are solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Method {
    #[default]
    Direct,
    Iterative,
}

/// How a system was solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solved {
    pub factorisation: Factorisation,
    /// Iterations, none where it was solved directly.
    pub iterations: usize,
}

/// What the equations of a step belong to.
#[derive(Clone, Copy)]
pub(super) struct Place<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub links: &'a Connectivity<D>,
    pub dofs: &'a DofMap<D>,
}

impl<const D: usize> Place<'_, D> {
    fn lattice(&self, active: usize) -> [u32; D] {
        self.model.grid.lattice(self.links.active_nodes()[active] as usize)
    }

    fn extent(&self, system: &System<D>) -> Extent {
        let reach = system.reach(|active| self.lattice(active));
        Extent {
            nodes: self.links.n_active() as f64,
            reach: f64::from(reach.into_iter().max().unwrap_or(0)),
            pairs: system.matrix().blocks.len() as f64,
        }
    }

    /// Names of the unknowns that outlast the step, as those of [`Named`].
    fn names(&self) -> Vec<u64> {
        let mut names = Vec::new();
        self.dofs.for_each(|node, axis, free| {
            if free.is_some() {
                names.push((self.links.active_nodes()[node] as usize * D + axis) as u64);
            }
        });
        names
    }

    /// Order of elimination of the unknowns: nested dissection of the active nodes by their place in the grid.
    fn elimination_order(&self, system: &System<D>) -> Vec<usize> {
        let lattice = |active: usize| self.lattice(active);
        let coordinates: Vec<[u32; D]> = (0..self.links.n_active()).map(lattice).collect();
        let nodes = ordering::nested_dissection(&coordinates, system.reach(lattice));
        nodes.iter().flat_map(|&node| (0..D).filter_map(move |axis| self.dofs.free(node, axis))).collect()
    }
}

impl<const D: usize> Equations<D> {
    /// Equations of a run that goes on with a pattern that has been analysed.
    pub(super) fn with(kept: Option<Arc<Named>>) -> Self {
        Equations { kept, ..Equations::default() }
    }

    /// The pattern that the next steps may go on with.
    pub(super) fn kept(&self) -> Option<Arc<Named>> {
        self.kept.clone()
    }

    /// Chooses the method for a step and analyses the pattern of its equations.
    ///
    /// # Errors
    /// [`LinearError`].
    pub(super) fn prepare(&mut self, place: Place<D>, system: &System<D>) -> Result<(), LinearError> {
        let choice = place.model.newton.linear;
        let possible = place.model.grid.structured().is_some() && system.matrix().symmetric;
        let iterative = match choice {
            Choice::Direct => false,
            Choice::Iterative => possible,
            Choice::Auto => possible && place.extent(system).is_large::<D>(),
        };
        if choice == Choice::Iterative && !possible {
            self.turned.get_or_insert(LinearError::Unsymmetric);
        }
        if iterative {
            return self.prepare_iterative(place, system);
        }
        match self.prepare_direct(place, system) {
            Err(LinearError::OutOfMemory { .. }) if possible && choice == Choice::Auto => {
                self.prepare_iterative(place, system)
            }
            outcome => outcome,
        }
    }

    /// Whether the equations of the step are solved iteratively.
    pub(super) fn is_iterative(&self) -> bool {
        self.method == Method::Iterative
    }

    /// Why equations that should have been solved iteratively were factorised; told once.
    pub(super) fn news(&mut self) -> Option<LinearError> {
        let news = self.turned.filter(|_| !self.told);
        self.told |= news.is_some();
        news
    }

    fn prepare_iterative(&mut self, place: Place<D>, system: &System<D>) -> Result<(), LinearError> {
        self.method = Method::Iterative;
        (self.direct, self.entries, self.values) = Default::default();
        (self.kept, self.embedding) = (None, None);
        let n = place.links.n_active();
        let places = (0..n).map(|active| place.lattice(active)).collect();
        let held =
            (0..n).map(|node| std::array::from_fn(|axis| place.dofs.free(node, axis).is_none())).collect();
        self.solution.resize(n, [0.0; D]);
        self.iterative.analyse(&system.matrix(), places, held).map(|_| ())
    }

    fn prepare_direct(&mut self, place: Place<D>, system: &System<D>) -> Result<(), LinearError> {
        self.method = Method::Direct;
        self.iterative = Krylov::default();
        self.entries = system.free_entries(place.dofs);
        let pattern = std::mem::take(&mut self.entries.pattern);
        self.embedding = None;
        if place.model.newton.pattern == Patterns::Contained && pattern.symmetric {
            return self.prepare_contained(place, system, pattern);
        }
        self.kept = None;
        self.direct.analyse(pattern, &|| place.elimination_order(system)).map(|_| ())
    }

    /// Analyses a pattern, unless it is contained in the one analysed last.
    fn prepare_contained(
        &mut self,
        place: Place<D>,
        system: &System<D>,
        pattern: Pattern,
    ) -> Result<(), LinearError> {
        let names = place.names();
        let same = |kept: &Named| kept.names == names && kept.pattern == pattern;
        if !self.kept.as_deref().is_some_and(same) {
            self.embedding = self.kept.as_ref().and_then(|kept| Embedding::new(&names, &pattern, kept));
            if self.embedding.is_none() {
                let order = place.elimination_order(system);
                self.kept = Some(Arc::new(Named { names, pattern, order }));
            }
        }
        match &self.kept {
            Some(kept) => self.direct.analyse(kept.pattern.clone(), &|| kept.order.clone()).map(|_| ()),
            None => Ok(()),
        }
    }

    /// Solves for the free entries of `delta`, with a right-hand side that counts where free, to a residual of
    /// `tolerance` relative to it. Where the iterative solver cannot, the direct one does for the rest of the step.
    ///
    /// # Errors
    /// [`LinearError`]; that of the iterative solver where the factor does not fit into memory.
    pub(super) fn solve(
        &mut self,
        place: Place<D>,
        system: &mut System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<Solved, LinearError> {
        if self.method == Method::Iterative {
            match self.solve_iterative(place, system, rhs, delta, tolerance, timings) {
                Err(error @ (LinearError::Singular { .. } | LinearError::NotConverged { .. })) => {
                    let turn = timings.measure(Phase::Analyse, || self.prepare_direct(place, system));
                    turn.map_err(|_| error)?;
                    self.turned.get_or_insert(error);
                }
                outcome => return outcome,
            }
        }
        self.solve_direct(place, system, rhs, delta, timings)
    }

    /// Solves with another right-hand side and the matrix that the last [`Equations::solve`] has factorised; iteratively
    /// with the preconditioner that it has set up.
    ///
    /// # Errors
    /// [`LinearError`].
    pub(super) fn solve_again(
        &mut self,
        place: Place<D>,
        system: &mut System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<Solved, LinearError> {
        match self.method {
            Method::Iterative => {
                timings.measure(Phase::Solve, || self.iterate(place, system, rhs, delta, tolerance))
            }
            Method::Direct => {
                timings.measure(Phase::Solve, || self.substitute(place, rhs, delta))?;
                let factorisation = self.factorised.ok_or(LinearError::Singular { unknown: None })?;
                Ok(Solved { factorisation, iterations: 0 })
            }
        }
    }

    fn solve_iterative(
        &mut self,
        place: Place<D>,
        system: &mut System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<Solved, LinearError> {
        timings.measure(Phase::Factorise, || self.iterative.factorise(&system.matrix()))?;
        timings.measure(Phase::Solve, || self.iterate(place, system, rhs, delta, tolerance))
    }

    /// Iterations for one right-hand side.
    fn iterate(
        &mut self,
        place: Place<D>,
        system: &mut System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let multiply = |x: &[[f64; D]], out: &mut [[f64; D]]| system.multiply(x, out);
        let (factorisation, iterations) =
            self.iterative.solve(multiply, rhs, &mut self.solution, tolerance)?;
        place.dofs.for_each(|node, axis, free| {
            if free.is_some() {
                delta[node][axis] = self.solution[node][axis];
            }
        });
        Ok(Solved { factorisation, iterations })
    }

    fn solve_direct(
        &mut self,
        place: Place<D>,
        system: &System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        timings: &mut Timings,
    ) -> Result<Solved, LinearError> {
        match self.factorise_and_substitute(place, system, rhs, delta, timings) {
            // A matrix that is nearly singular may be solved in its own order of elimination.
            Err(LinearError::Singular { .. }) if self.embedding.is_some() => {
                self.kept = None;
                timings.measure(Phase::Analyse, || self.prepare_direct(place, system))?;
                self.factorise_and_substitute(place, system, rhs, delta, timings)
            }
            outcome => outcome,
        }
    }

    fn factorise_and_substitute(
        &mut self,
        place: Place<D>,
        system: &System<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
        timings: &mut Timings,
    ) -> Result<Solved, LinearError> {
        let factorisation = timings.measure(Phase::Factorise, || {
            system.free_values(&self.entries, &mut self.values);
            match &self.embedding {
                None => self.direct.factorise(&self.values),
                Some(embedding) => self.direct.factorise(&embedding.values(&self.values)),
            }
        })?;
        self.factorised = Some(factorisation);
        timings.measure(Phase::Solve, || self.substitute(place, rhs, delta))?;
        Ok(Solved { factorisation, iterations: 0 })
    }

    /// Forward and backward substitution for one right-hand side.
    fn substitute(
        &mut self,
        place: Place<D>,
        rhs: &[[f64; D]],
        delta: &mut [[f64; D]],
    ) -> Result<(), LinearError> {
        self.values.clear();
        place.dofs.for_each(|node, axis, free| {
            if free.is_some() {
                self.values.push(rhs[node][axis]);
            }
        });
        let solved = match &self.embedding {
            None => self.direct.solve(&mut self.values),
            Some(embedding) => {
                let mut all = embedding.spread(&self.values);
                let solved = self.direct.solve(&mut all);
                embedding.gather(&all, &mut self.values);
                solved
            }
        };
        solved.map_err(|error| self.in_hand(error))?;
        place.dofs.for_each(|node, axis, free| {
            if let Some(unknown) = free {
                delta[node][axis] = self.values[unknown];
            }
        });
        Ok(())
    }

    /// A failure with the number that the unknown has in the step in hand.
    fn in_hand(&self, error: LinearError) -> LinearError {
        match (error, &self.embedding) {
            (LinearError::Singular { unknown: Some(unknown) }, Some(embedding)) => {
                LinearError::Singular { unknown: embedding.number(unknown) }
            }
            _ => error,
        }
    }
}
