//! The iterative backend over many ranks: PETSc's conjugate gradients or GMRES, preconditioned by PETSc's algebraic
//! multigrid or by a preconditioner that the caller provides.

mod preconditioner;
mod shell;
mod solvers;

use mpm_core::linear::{Backend, BlockMatrix, Factorisation, Layout, LinearError, Solved, Stiffness};
use mpm_core::ranks::Halo;

use crate::entries::{GlobalNumbers, Known, diagonal};
use crate::error::{Error, NOT_PREPARED, agree};
use crate::ffi;
use crate::objects::{Matrix, Vector};
use crate::session::is_running;

pub use preconditioner::Preconditioner;

use shell::Context;
use solvers::{Outcome, Solvers};

/// An iterative backend for matrices whose contributions are distributed over ranks: conjugate gradients, or GMRES if
/// the matrix turns out not to be positive definite, or is not symmetric. It applies the assembled matrix block by
/// block.
///
/// All runs on the same number of ranks give the same bits.
///
/// The algebraic multigrid of PETSc needs another copy of the matrix; a [`Preconditioner`] does not. PETSc options for
/// this backend, such as `-ksp_monitor`, have no prefix.
pub struct Krylov<const D: usize, const N: usize = D> {
    preconditioner: Option<Box<dyn Preconditioner<D, N>>>,
    system: Option<System<D, N>>,
}

impl<const D: usize, const N: usize> std::fmt::Debug for Krylov<D, N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Krylov").field("system", &self.system).finish_non_exhaustive()
    }
}

/// The equations for one pattern, on all components of all active nodes: in the rows and columns of components that are
/// not unknowns, the matrix is diagonal, so that all blocks have the same size.
#[derive(Debug)]
struct System<const D: usize, const N: usize> {
    known: Known<N>,
    /// True at components that are not unknowns.
    held: Vec<[bool; N]>,
    /// Diagonal entries at components that are not unknowns, zero elsewhere.
    held_diagonal: Vec<[f64; N]>,
    /// The product with the current matrix.
    operator: Matrix,
    /// The matrix for PETSc's own preconditioner.
    assembled: Option<Matrix>,
    b: Vector,
    x: Vector,
    solvers: Solvers,
    /// True if the matrix has shown no direction of negative curvature.
    definite: bool,
}

impl<const D: usize, const N: usize> Krylov<D, N> {
    /// A backend with the algebraic multigrid of PETSc, which must be running.
    ///
    /// # Errors
    /// [`Error::NotStarted`].
    pub fn new() -> Result<Self, Error> {
        if is_running() { Ok(Krylov { preconditioner: None, system: None }) } else { Err(Error::NotStarted) }
    }

    /// A backend with another preconditioner; PETSc must be running.
    ///
    /// # Errors
    /// [`Error::NotStarted`].
    pub fn with_preconditioner(preconditioner: Box<dyn Preconditioner<D, N>>) -> Result<Self, Error> {
        Ok(Krylov { preconditioner: Some(preconditioner), ..Krylov::new()? })
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Krylov<D, N> {
    /// Keeps the existing objects if the layout is the same as in the previous call.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`]; errors of the preconditioner.
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let (halo, numbering) = (layout.halo, layout.numbering);
        let ranks = halo.ranks();
        if let Some(preconditioner) = &mut self.preconditioner {
            agree(ranks, preconditioner.prepare(layout, matrix))?;
        }
        let n = numbering.n_nodes();
        let is_held = |node, component| numbering.unknown(node, component).is_none();
        let held: Vec<[bool; N]> = (0..n).map(|node| std::array::from_fn(|k| is_held(node, k))).collect();
        let numbers = agree(ranks, GlobalNumbers::new(halo, n, |_, _| true).map_err(Into::into))?;
        let is_known = self
            .system
            .as_ref()
            .is_some_and(|system| system.known.is(&numbers, matrix) && system.held == held);
        if ranks.all(is_known) {
            return Ok(());
        }
        self.system = None; // frees the memory before more is allocated
        let known = Known::new(numbers, matrix);
        let assembled = match self.preconditioner {
            Some(_) => None,
            None => Some(assembled(layout, &known, matrix)?),
        };
        let system = System::new(known, held, assembled).map_err(Into::into);
        self.system = Some(agree(ranks, system)?);
        Ok(())
    }

    /// Sets up the preconditioner.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if an unknown has no diagonal stiffness, or if a value is not finite; errors of the
    /// preconditioner.
    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let ranks = layout.halo.ranks();
        let system = self.system.as_mut().ok_or(NOT_PREPARED)?;
        let outcome = system.take(layout.halo, matrix);
        let mut positive = agree(ranks, outcome)?;
        if let Some(preconditioner) = &mut self.preconditioner {
            positive &= agree(ranks, preconditioner.factorise(layout, matrix))?;
        }
        system.definite = ranks.all(positive);
        Ok(())
    }

    /// Solves the equations; the residual is measured in the norm of the forces on the unknowns.
    ///
    /// # Errors
    /// [`LinearError::NotConverged`] if the iterations do not converge; errors of the preconditioner.
    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let Krylov { preconditioner, system } = self;
        let present = system.as_mut().ok_or(NOT_PREPARED)?;
        let mut context = Context::new(
            layout.halo,
            present.known.numbers(),
            &present.held_diagonal,
            stiffness,
            preconditioner.as_deref_mut(),
        );
        let run = Run {
            operator: &present.operator,
            solvers: &mut present.solvers,
            vectors: [&mut present.b, &mut present.x],
            definite: &mut present.definite,
            symmetric: present.known.symmetric(),
        };
        let outcome = agree(layout.halo.ranks(), run.solve(&mut context, b, x, tolerance));
        if matches!(outcome, Err(LinearError::Library(_))) {
            *system = None; // PETSc may have left its objects in an undefined state
        }
        outcome
    }

    fn release(&mut self) {
        self.system = None;
    }

    fn is_iterative(&self) -> bool {
        true
    }
}

/// The matrix for PETSc's own preconditioner, without values.
fn assembled<const D: usize, const N: usize>(
    layout: &Layout<D, N>,
    known: &Known<N>,
    matrix: &BlockMatrix<N>,
) -> Result<Matrix, LinearError> {
    let (ranks, numbers) = (layout.halo.ranks(), known.numbers());
    let [rows, columns] = agree(ranks, numbers.entries(matrix))?;
    let make = || -> Result<Matrix, Error> {
        let assembled = Matrix::sparse(numbers.own(), N, rows, columns)?;
        assembled.set_symmetric(known.symmetric())?;
        if N == D {
            let own = (0..layout.numbering.n_nodes()).filter(|node| layout.halo.is_own(*node));
            assembled.set_near_rigid_motions(own.map(layout.position))?;
        }
        Ok(assembled)
    };
    agree(ranks, make().map_err(Into::into))
}

impl<const D: usize, const N: usize> System<D, N> {
    fn new(known: Known<N>, held: Vec<[bool; N]>, assembled: Option<Matrix>) -> Result<Self, Error> {
        let own = known.numbers().own();
        let operator = Matrix::shell(own, N, shell::product::<D, N>)?;
        let apply: Option<ffi::PCApply> = assembled.is_none().then_some(shell::apply::<D, N>);
        let solvers = Solvers::new(&operator, assembled.as_ref(), apply)?;
        let (b, x) = (Vector::new(own, N)?, Vector::new(own, N)?);
        let held_diagonal = vec![[0.0; N]; held.len()];
        Ok(System { known, held, held_diagonal, operator, assembled, b, x, solvers, definite: true })
    }

    /// Takes over the values of a matrix; returns true if all diagonal entries are positive.
    fn take(&mut self, halo: &Halo, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        let ranks = halo.ranks();
        let mut entries = diagonal(halo, matrix);
        let is_finite = matrix.blocks.as_flattened().as_flattened().iter().all(|value| value.is_finite());
        let mut positive = true;
        let mut singular = !is_finite;
        let mut largest = 0.0f64;
        for (entry, held) in entries.as_flattened().iter().zip(self.held.as_flattened()) {
            largest = largest.max(*entry);
            positive &= *held || *entry > 0.0;
            singular |= !*held && *entry == 0.0;
        }
        if ranks.any(singular) {
            return Err(LinearError::Singular { unknown: None });
        }
        let largest = ranks.largest(largest);
        let size = if largest > 0.0 { largest } else { 1.0 };
        for (entry, held) in entries.as_flattened_mut().iter_mut().zip(self.held.as_flattened()) {
            *entry = match (*held, *entry > 0.0) {
                (false, _) => 0.0,
                (true, true) => *entry,
                (true, false) => size,
            };
        }
        if let Some(assembled) = &mut self.assembled {
            let numbers = self.known.numbers();
            let mut own = vec![0.0; numbers.own()];
            numbers.take(&entries, &mut own);
            let held = self.held.as_flattened();
            let values = agree(ranks, numbers.values(matrix, &own, |place| !held[place]))?;
            assembled.set_values(&values)?;
            self.solvers.set_up(&self.operator, assembled)?;
        }
        self.held_diagonal = entries;
        Ok(positive)
    }
}

/// The data that a solution uses.
struct Run<'a> {
    operator: &'a Matrix,
    solvers: &'a mut Solvers,
    vectors: [&'a mut Vector; 2],
    definite: &'a mut bool,
    symmetric: bool,
}

impl Run<'_> {
    fn solve<const D: usize, const N: usize>(
        self,
        context: &mut Context<D, N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let Run { operator, solvers, vectors: [given, found], definite, symmetric } = self;
        let mut before = 0;
        let rhs = context.unknowns_of(b);
        let ranks = context.halo.ranks();
        let size = ranks.total(rhs.iter().map(|b| b * b).sum()).sqrt();
        let own = rhs.len();
        given.with(own, |given| given.copy_from_slice(&rhs))?;
        let solved = |factorisation, iterations| Ok(Solved { factorisation, iterations });
        let kind = |definite: bool| match (symmetric, definite) {
            (true, true) => Factorisation::Multigrid,
            (false, true) => Factorisation::MultigridUnsymmetric,
            (true, false) => Factorisation::MultigridIndefinite,
            (false, false) => Factorisation::MultigridIndefiniteUnsymmetric,
        };
        if size == 0.0 {
            x.fill([0.0; N]);
            return solved(kind(*definite), 0);
        }
        if !size.is_finite() {
            return Err(LinearError::NotConverged { iterations: 0, residual: f64::NAN });
        }
        loop {
            let use_conjugate = *definite && symmetric;
            let outcome = solvers.solve(use_conjugate, operator, context, given, found, tolerance)?;
            match outcome {
                Outcome::Converged { iterations } => {
                    let numbers = found.with(own, |found| found.to_vec())?;
                    context.finish(&numbers, x);
                    return solved(kind(*definite), before + iterations);
                }
                Outcome::Indefinite { iterations } if use_conjugate => {
                    *definite = false;
                    before += iterations;
                }
                Outcome::Indefinite { iterations } => {
                    return Err(LinearError::NotConverged {
                        iterations: before + iterations,
                        residual: f64::NAN,
                    });
                }
                Outcome::Failed { iterations, residual } => {
                    let residual = residual / size;
                    return Err(LinearError::NotConverged { iterations: before + iterations, residual });
                }
            }
        }
    }
}
