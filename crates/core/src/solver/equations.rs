//! The linear equations of an iteration, eq. (26), with their border of global unknowns, and the choice of a backend.

use crate::assembly::{Border, System};
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::grid::Axis;
use crate::linear::{Backend, Backends, Choice, Divided, Extent, Krylov, Layout, LinearError, Solved};
use crate::model::Model;
use crate::step::{Nodal, StepContext};
use crate::timing::{Phase, Timings};

/// Relative tolerance of the solutions for the columns of the border: C − A K⁻¹ B is a small difference between large
/// numbers if springs are stiff.
const OF_BORDER: f64 = 1e-10;

/// The backends of a run.
pub(super) struct Equations<const D: usize, const N: usize = D> {
    direct: Divided<D, N>,
    iterative: Krylov<D, N>,
    /// The backends of the library that solves equations distributed over several ranks.
    engine: Backends<D, N>,
    /// A user's backend, which replaces the built-in ones.
    own: Option<Box<dyn Backend<D, N>>>,
    method: Method,
    /// True if the backend is prepared for the current layout of the equations.
    is_prepared: bool,
    /// True if the current layout has a factor or a preconditioner.
    has_factor: bool,
    /// Increments of the unknowns, stored by node and component.
    solution: Nodal<N>,
    /// The first failure that caused equations to be factorised instead of solved iteratively.
    fallback: Option<LinearError>,
    is_reported: bool,
    /// True if unknowns are multipliers of constraints.
    has_multipliers: bool,
}

/// The solution method for the equations of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    Direct,
    Iterative,
    /// Iterative, without coarser grids.
    Algebraic,
    Own,
}

/// The context of the equations of a step.
#[derive(Clone, Copy)]
pub(super) struct EquationContext<'a, const D: usize, const N: usize = D> {
    pub model: &'a Model<D>,
    pub links: &'a Connectivity<D>,
    pub dofs: &'a DofMap<N>,
}

/// The right-hand side of linear equations.
#[derive(Clone, Copy)]
pub(super) struct RightHandSide<'a, const N: usize> {
    /// Forces on the unknowns, zero elsewhere, [force].
    pub forces: &'a [[f64; N]],
    /// Residuals of the global equations; `None` for those of the last evaluation.
    pub globals: Option<&'a [f64]>,
}

impl<const D: usize> StepContext<'_, D> {
    /// The context of the linear equations of the step.
    pub(super) fn equations<'b, const N: usize>(&'b self, dofs: &'b DofMap<N>) -> EquationContext<'b, D, N> {
        EquationContext { model: self.model, links: self.links, dofs }
    }
}

impl<const D: usize, const N: usize> EquationContext<'_, D, N> {
    fn lattice(&self, active: usize) -> [u32; D] {
        self.model.grid.lattice(self.links.active_nodes()[active] as usize)
    }

    /// Calls `work` with the layout of the equations.
    fn with_layout<T>(&self, work: impl FnOnce(&Layout<D, N>) -> T) -> T {
        work(&Layout {
            numbering: self.dofs.numbering(),
            nodes: self.links.active_nodes(),
            lattice: &|active| self.lattice(active),
            position: &|active| self.model.grid.node_position(self.links.active_nodes()[active] as usize),
            lines: match self.model.grid.lines() {
                Some(lines) => lines.axes().each_ref().map(Axis::graded_lines),
                None => [None; D],
            },
            halo: self.links.halo(),
        })
    }

    fn extent(&self, system: &System<N>) -> Extent {
        let (reduction, n) = (self.links.reduction(), self.links.n_active());
        let nodes = reduction.sum_over_nodes(n, |_| 1.0);
        let blocks = reduction.total(system.matrix().blocks.len() as f64);
        let pairs = if system.matrix().symmetric { blocks } else { 0.5 * (blocks + nodes) };
        if !self.model.grid.coarsens() {
            return Extent::mesh::<D>(nodes, pairs);
        }
        let reach = system.matrix().reach(|active| self.lattice(active));
        let reach = reduction.largest(f64::from(reach.into_iter().max().unwrap_or(0)));
        Extent { nodes, reach, pairs }
    }
}

impl<const D: usize, const N: usize> Equations<D, N> {
    /// Equations solved by the built-in backends, or by the given one instead.
    pub(super) fn new(own: Option<Box<dyn Backend<D, N>>>) -> Self {
        Equations {
            direct: Divided::default(),
            iterative: Krylov::default(),
            engine: Backends::default(),
            own,
            method: Method::Direct,
            is_prepared: false,
            has_factor: false,
            solution: Vec::new(),
            fallback: None,
            is_reported: false,
            has_multipliers: false,
        }
    }

    /// The same equations, solved by the backends that an engine provides.
    pub(super) fn with_engine(self, engine: Backends<D, N>) -> Self {
        Equations { engine, ..self }
    }

    /// The same equations if unknowns are multipliers of constraints, which coarser grids do not represent: unless the
    /// model asks for an iterative solution, the equations are factorised.
    pub(super) fn with_multipliers(self, has_multipliers: bool) -> Self {
        Equations { has_multipliers, ..self }
    }

    fn backend(&mut self) -> &mut dyn Backend<D, N> {
        let Backends { direct, iterative, algebraic } = &mut self.engine;
        let given = match self.method {
            Method::Own => &mut self.own,
            Method::Direct => direct,
            Method::Iterative => iterative,
            Method::Algebraic => algebraic,
        };
        match (given, self.method) {
            (Some(backend), _) => backend.as_mut(),
            (None, Method::Iterative) => &mut self.iterative,
            (None, _) => &mut self.direct,
        }
    }

    /// Chooses the backend for a step and prepares it for the pattern of the equations.
    ///
    /// # Errors
    /// [`LinearError`] if the backend cannot solve equations of this kind, or if its factor does not fit in memory.
    pub(super) fn prepare(
        &mut self,
        context: EquationContext<D, N>,
        system: &System<N>,
    ) -> Result<(), LinearError> {
        (self.is_prepared, self.has_factor) = (true, false);
        self.solution.resize(context.links.n_active(), [0.0; N]);
        if self.own.is_some() {
            return self.prepare_with(Method::Own, context, system);
        }
        let choice = context.model.newton.linear;
        // Coarser grids support neither nodes held along directions other than the axes, nor tied nodes, nor several
        // unknowns at one place.
        let is_single = context.links.n_body_groups() == 1;
        let is_plain = is_single && context.links.reduction().all(context.dofs.is_plain());
        let is_regular = context.model.grid.coarsens() && is_plain;
        let method = match self.engine.algebraic {
            _ if is_regular => Method::Iterative,
            Some(_) => Method::Algebraic,
            None => Method::Direct,
        };
        let can_iterate = method != Method::Direct;
        // In the plane, GMRES needs many iterations if a material with an unsymmetric tangent flows, and LU is
        // affordable.
        let suits_auto = can_iterate && !self.has_multipliers && (system.matrix().symmetric || D == 3);
        let iterative = match choice {
            Choice::Direct => false,
            Choice::Iterative => can_iterate,
            Choice::Auto => suits_auto && context.extent(system).is_large::<D>(is_regular),
        };
        if choice == Choice::Iterative && !can_iterate {
            let coarsens = context.model.grid.coarsens();
            self.fallback.get_or_insert(if coarsens {
                LinearError::Turned
            } else {
                LinearError::Unstructured
            });
        }
        if iterative {
            return self.prepare_with(method, context, system);
        }
        match self.prepare_with(Method::Direct, context, system) {
            Err(LinearError::OutOfMemory { .. }) if can_iterate && choice == Choice::Auto => {
                self.prepare_with(method, context, system)
            }
            outcome => outcome,
        }
    }

    /// Prepares a backend and frees the memory of the others.
    fn prepare_with(
        &mut self,
        method: Method,
        context: EquationContext<D, N>,
        system: &System<N>,
    ) -> Result<(), LinearError> {
        self.method = method;
        match method {
            Method::Direct => self.iterative = Krylov::default(),
            Method::Iterative | Method::Algebraic | Method::Own => self.direct = Divided::default(),
        }
        let Backends { direct, iterative, algebraic } = &mut self.engine;
        for (other, backend) in
            [(Method::Direct, direct), (Method::Iterative, iterative), (Method::Algebraic, algebraic)]
        {
            backend.iter_mut().filter(|_| other != method).for_each(|backend| backend.release());
        }
        context.with_layout(|layout| self.backend().prepare(layout, &system.matrix()))
    }

    /// Records that the system has been laid out anew: the equations must be prepared again before they are solved.
    pub(super) fn outgrow(&mut self) {
        self.is_prepared = false;
    }

    /// True if the equations are prepared for the current layout of the system.
    pub(super) fn is_prepared(&self) -> bool {
        self.is_prepared
    }

    /// True if an earlier solution has left a factor of the current layout.
    pub(super) fn has_factor(&self) -> bool {
        self.has_factor
    }

    /// Gives up the factor of earlier solutions, because the equations have changed.
    pub(super) fn forget_factor(&mut self) {
        self.has_factor = false;
    }

    /// True if the equations of the step are solved iteratively.
    pub(super) fn is_iterative(&mut self) -> bool {
        self.backend().is_iterative()
    }

    /// The failure that caused equations to be factorised instead of solved iteratively; returned once.
    pub(super) fn unreported_fallback(&mut self) -> Option<LinearError> {
        let error = self.fallback.clone().filter(|_| !self.is_reported);
        self.is_reported |= error.is_some();
        error
    }

    /// Solves K δd + B δw = b, A δd + C δw = −r with a fresh factor: adds the increments of the unknowns to the
    /// prescribed ones in `delta`, and returns the increments of the global unknowns. The residual is at most
    /// `tolerance`, relative to the right-hand side. If the iterative backend fails, the direct one takes over for the
    /// rest of the step.
    ///
    /// # Errors
    /// [`LinearError`]; if the factor does not fit in memory, the error of the iterative backend.
    pub(super) fn solve(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        rhs: RightHandSide<N>,
        delta: &mut [[f64; N]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<(Solved, Vec<f64>), LinearError> {
        timings.measure(Phase::Factorise, || system.reduce(context.dofs));
        if matches!(self.method, Method::Iterative | Method::Algebraic) {
            match self.factorise_and_solve(context, system, rhs, delta, tolerance, timings) {
                Err(
                    error @ (LinearError::Singular { .. }
                    | LinearError::Undetermined
                    | LinearError::NotConverged { .. }),
                ) => {
                    let turn = timings
                        .measure(Phase::Analyse, || self.prepare_with(Method::Direct, context, system));
                    turn.map_err(|_| error.clone())?;
                    self.fallback.get_or_insert(error);
                }
                outcome => return outcome,
            }
        }
        self.factorise_and_solve(context, system, rhs, delta, tolerance, timings)
    }

    fn factorise_and_solve(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        rhs: RightHandSide<N>,
        delta: &mut [[f64; N]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<(Solved, Vec<f64>), LinearError> {
        let factorise =
            |layout: &Layout<D, N>| self.backend().factorise(layout, &system.reduced(context.dofs).matrix);
        timings.measure(Phase::Factorise, || context.with_layout(factorise))?;
        self.has_factor = true;
        timings.measure(Phase::Solve, || self.solve_bordered(context, system, rhs, delta, tolerance))
    }

    /// As [`Equations::solve`], but with the existing factor or preconditioner; if that fails, with a fresh one.
    ///
    /// # Errors
    /// As for [`Equations::solve`].
    pub(super) fn solve_with_last_factor(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        rhs: RightHandSide<N>,
        delta: &mut [[f64; N]],
        tolerance: f64,
        timings: &mut Timings,
    ) -> Result<(Solved, Vec<f64>), LinearError> {
        if self.is_iterative() {
            timings.measure(Phase::Factorise, || system.reduce(context.dofs));
        }
        let solve = || self.solve_bordered(context, system, rhs, delta, tolerance);
        timings
            .measure(Phase::Solve, solve)
            .or_else(|_| self.solve(context, system, rhs, delta, tolerance, timings))
    }

    /// Solves for the nodal and the global unknowns; `delta` is unchanged if the solution fails.
    fn solve_bordered(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        rhs: RightHandSide<N>,
        delta: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<(Solved, Vec<f64>), LinearError> {
        if system.border.is_empty() {
            return Ok((self.solve_nodes(context, system, rhs.forces, delta, tolerance)?, Vec::new()));
        }
        let mut motion = delta.to_vec();
        let mut solved = self.solve_nodes(context, system, rhs.forces, &mut motion, tolerance)?;
        let border = std::mem::take(&mut system.border);
        let globals = self.solve_border(context, system, &border, &mut motion, rhs.globals);
        system.border = border;
        let (iterations, globals) = globals?;
        solved.iterations += iterations;
        delta.copy_from_slice(&motion);
        Ok((solved, globals))
    }

    /// Solves K δd = b on the unknowns.
    fn solve_nodes(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        rhs: &[[f64; N]],
        delta: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let mut solution = std::mem::take(&mut self.solution);
        let solved = context.with_layout(|layout| {
            self.backend().solve(layout, &mut system.reduced(context.dofs), rhs, &mut solution, tolerance)
        });
        self.solution = solution;
        let solved = solved?;
        context.dofs.add_unknowns(&self.solution, delta);
        Ok(solved)
    }

    /// Block elimination of the border: (C − A Z) δw = −r − A δd with K Z = B; then δd is replaced by δd − Z δw.
    /// Returns the iterations and δw.
    fn solve_border(
        &mut self,
        context: EquationContext<D, N>,
        system: &mut System<N>,
        border: &Border<N>,
        delta: &mut [[f64; N]],
        residuals: Option<&[f64]>,
    ) -> Result<(usize, Vec<f64>), LinearError> {
        let n = border.len();
        let (mut iterations, mut influence) = (0, Vec::with_capacity(n));
        for column in &border.columns {
            let mut rhs = column.clone();
            context.dofs.condense(&mut rhs);
            context.dofs.on_unknowns(&mut rhs);
            let mut z = vec![[0.0; N]; rhs.len()];
            iterations += self.solve_nodes(context, system, &rhs, &mut z, OF_BORDER)?.iterations;
            influence.push(z);
        }
        let reduction = context.links.reduction();
        let along = |row: &[[f64; N]], field: &[[f64; N]]| reduction.dot(row, field);
        // All ranks take part in each product, so they must form the products in the same order: column by column.
        let influences: Vec<f64> =
            (0..n * n).map(|entry| along(&border.rows[entry % n], &influence[entry / n])).collect();
        let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| {
            border.corner[i][j] + border.support[i][j] - influences[j * n + i]
        });
        let residual = residuals.unwrap_or(&border.residual);
        let rhs = nalgebra::DVector::from_fn(n, |i, _| -residual[i] - along(&border.rows[i], delta));
        let change = matrix.lu().solve(&rhs).filter(|change| change.iter().all(|w| w.is_finite()));
        let change: Vec<f64> = change.ok_or(LinearError::Undetermined)?.iter().copied().collect();
        for (z, w) in influence.iter().zip(&change) {
            for (delta, z) in delta.as_flattened_mut().iter_mut().zip(z.as_flattened()) {
                *delta -= z * w;
            }
        }
        Ok((iterations, change))
    }
}
