//! The direct backend over many ranks: the multifrontal factorisation of MUMPS, through PETSc.

mod factor;

use mpm_core::linear::{Backend, BlockMatrix, Factorisation, Layout, LinearError, Solved, Stiffness};
use mpm_core::ranks::{Halo, Ranks};

use crate::entries::{GlobalNumbers, Known, diagonal};
use crate::error::{Error, NOT_PREPARED, agree};
use crate::objects::{Matrix, Vector};
use crate::session::is_running;

use factor::{Factor, Pivots};

/// Unknowns whose diagonal entry is below this fraction of the largest one are weak: they belong to nodes that points
/// hardly touch.
const WEAK: f64 = 1e-2;

/// Relative shift of the diagonal entries of weak unknowns that leave the matrix singular.
const SHIFT: f64 = 1e-9;

/// Largest relative residual of a solution that needs no refinement: with the factor of the matrix itself, and with the
/// factor of the shifted matrix.
const ENOUGH: [f64; 2] = [1e-6, 1e-12];

/// Largest number of steps of iterative refinement, without and with a shift of the matrix.
const REFINEMENTS: [usize; 2] = [2, 4];

/// Residual above which the matrix counts as singular: without a shift, relative to the right-hand side; with a shift,
/// relative to the largest right-hand side so far.
const SINGULAR: [f64; 2] = [1e-3, 1e-10];

/// Largest acceptable relative residual of a trial solution; if it is larger, the shift has compensated for more than
/// round-off.
const TRIAL: f64 = 1e-8;

/// A direct backend for matrices whose contributions are distributed over ranks. Symmetric matrices are factorised as
/// LDLᵀ, others as LU, both with pivoting.
///
/// MUMPS adds contributions of other ranks in the order of their arrival, so on three or more ranks the last bits may
/// differ from run to run. No option changes that.
///
/// PETSc options for this backend start with `direct_`, such as `-direct_mat_mumps_icntl_7 5` for another ordering. If
/// they choose a solver other than MUMPS, all matrices count as positive definite.
///
/// If weak unknowns leave the matrix singular to working precision, their diagonal entries are shifted, and solutions
/// are refined until they satisfy the original equations, as in the direct solver of the core.
#[derive(Debug)]
pub struct Direct<const N: usize> {
    system: Option<System<N>>,
}

/// The equations for one pattern.
#[derive(Debug)]
struct System<const N: usize> {
    known: Known<N>,
    matrix: Matrix,
    /// Argument and result as PETSc vectors.
    given: Vector,
    found: Vector,
    factor: Option<Factor>,
    factorised: Option<Factorisation>,
    /// Shift of the diagonal entry of each unknown of this rank, if the factor belongs to a shifted matrix.
    shift: Option<Vec<f64>>,
    /// Norm of the largest right-hand side so far.
    largest: f64,
}

impl<const N: usize> Direct<N> {
    /// A backend; PETSc must be running.
    ///
    /// # Errors
    /// [`Error`] if this PETSc library has no MUMPS, or is not running.
    pub fn new() -> Result<Self, Error> {
        if !is_running() {
            return Err(Error::NotStarted);
        }
        if !factor::has_mumps()? {
            return Err(Error::Without("MUMPS"));
        }
        Ok(Direct { system: None })
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Direct<N> {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let numbering = layout.numbering;
        let is_unknown = |node, component| numbering.unknown(node, component).is_some();
        let ranks = layout.halo.ranks();
        let numbers = agree(
            ranks,
            GlobalNumbers::new(layout.halo, numbering.n_nodes(), is_unknown).map_err(Into::into),
        )?;
        let is_known = self.system.as_ref().is_some_and(|system| system.known.is(&numbers, matrix));
        if ranks.all(is_known) {
            return Ok(());
        }
        self.system = None; // frees the memory before more is allocated
        let entries = agree(ranks, numbers.entries(matrix))?;
        let system = System::new(Known::new(numbers, matrix), entries).map_err(Into::into);
        self.system = Some(agree(ranks, system)?);
        Ok(())
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let ranks = layout.halo.ranks();
        let system = self.system.as_mut().ok_or(NOT_PREPARED)?;
        let outcome = system.factorise(layout.halo, matrix);
        let outcome = agree(ranks, outcome);
        if matches!(outcome, Err(LinearError::Library(_))) {
            self.system = None; // PETSc may have left its objects in an undefined state
        }
        outcome
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        _: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        _: f64,
    ) -> Result<Solved, LinearError> {
        let singular = LinearError::Singular { unknown: None };
        let system = self.system.as_mut().ok_or(NOT_PREPARED)?;
        let factorisation = system.factorised.ok_or(singular)?;
        let mut own = vec![0.0; system.known.numbers().own()];
        system.known.numbers().take(b, &mut own);
        let solution = agree(layout.halo.ranks(), system.solve(layout.halo.ranks(), &own))?;
        system.known.numbers().spread(layout.halo, &solution, x);
        Ok(Solved { factorisation, iterations: 0 })
    }

    fn is_iterative(&self) -> bool {
        false
    }
}

impl<const N: usize> System<N> {
    fn new(known: Known<N>, [rows, columns]: [Vec<crate::ffi::PetscInt>; 2]) -> Result<Self, Error> {
        let own = known.numbers().own();
        let matrix = Matrix::sparse(own, 1, rows, columns)?;
        matrix.set_symmetric(known.symmetric())?;
        let (given, found) = (Vector::new(own, 1)?, Vector::new(own, 1)?);
        let (factor, factorised, shift) = (None, None, None);
        Ok(System { known, matrix, given, found, factor, factorised, shift, largest: 0.0 })
    }

    /// Factorises a matrix or, if it is not positive definite, the shifted matrix, provided that this shows the
    /// original one to be positive definite except for round-off.
    fn factorise(&mut self, halo: &Halo, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let ranks = halo.ranks();
        let singular = Err(LinearError::Singular { unknown: None });
        self.factorised = None;
        self.shift = None;
        if self.known.numbers().count() == 0 {
            self.factorised = Some(self.kind(false));
            return Ok(());
        }
        if ranks.any(!matrix.blocks.as_flattened().as_flattened().iter().all(|value| value.is_finite())) {
            return singular;
        }
        let no_shift = vec![0.0; self.known.numbers().own()];
        let mut values = agree(ranks, self.known.numbers().values(matrix, &no_shift, |_| true))?;
        let pivots = self.factorise_values(ranks, &values)?;
        let is_good = pivots.zero == 0 && !pivots.negative;
        if !is_good && let Some(shift) = self.shift_of_weak(halo, matrix) {
            let end = values.len() - shift.len();
            values[end..].copy_from_slice(&shift);
            let shifted = self.factorise_values(ranks, &values)?;
            self.shift = Some(shift);
            if shifted.zero == 0 && !shifted.negative && self.is_accurate(ranks)? {
                self.factorised = Some(self.kind(false));
                return Ok(());
            }
            self.shift = None;
            if pivots.zero == 0 {
                values[end..].fill(0.0);
                self.factorise_values(ranks, &values)?;
            }
        }
        if pivots.zero > 0 {
            return singular;
        }
        self.factorised = Some(self.kind(pivots.negative));
        Ok(())
    }

    fn kind(&self, negative: bool) -> Factorisation {
        match (self.known.symmetric(), negative) {
            (true, false) => Factorisation::Cholesky,
            (true, true) => Factorisation::Ldlt,
            (false, false) => Factorisation::Lu,
            (false, true) => Factorisation::LuIndefinite,
        }
    }

    /// Factorises a matrix with these values. A singular matrix that MUMPS cannot factorise is reported as one with a
    /// zero pivot.
    fn factorise_values(&mut self, ranks: &Ranks, values: &[f64]) -> Result<Pivots, LinearError> {
        let System { known, matrix, factor, .. } = self;
        let outcome = Factor::renew(factor, matrix, values, known.symmetric(), ranks);
        match outcome {
            Ok(pivots) => Ok(pivots),
            Err(error) => {
                *factor = None;
                let zero = Pivots { zero: 1, negative: false };
                if matches!(error, LinearError::Singular { .. }) { Ok(zero) } else { Err(error) }
            }
        }
    }

    /// Shifts of the diagonal entries of weak unknowns; `None` if no rank has any.
    fn shift_of_weak(&self, halo: &Halo, matrix: &BlockMatrix<N>) -> Option<Vec<f64>> {
        let mut own = vec![0.0; self.known.numbers().own()];
        self.known.numbers().take(&diagonal(halo, matrix), &mut own);
        let limit = WEAK * halo.ranks().largest(own.iter().copied().fold(0.0, f64::max));
        own.iter_mut()
            .for_each(|value| *value = if *value > 0.0 && *value < limit { SHIFT * *value } else { 0.0 });
        halo.ranks().any(own.iter().any(|shift| *shift > 0.0)).then_some(own)
    }

    /// True if the factor of the shifted matrix solves the original equations for a right-hand side that has a
    /// solution.
    fn is_accurate(&mut self, ranks: &Ranks) -> Result<bool, LinearError> {
        let some: Vec<f64> = (0..self.known.numbers().own()).map(|j| 1.0 + (j % 7) as f64).collect();
        let trial = self.multiply(&some)?;
        Ok(self.refine(ranks, &trial)?.1 <= TRIAL)
    }

    /// The product of the original matrix with a vector, given by its values at the unknowns of this rank.
    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, Error> {
        self.given.with(x.len(), |given| given.copy_from_slice(x))?;
        self.matrix.multiply(&self.given, &mut self.found)?;
        let mut product = self.found.with(x.len(), |found| found.to_vec())?;
        if let Some(shift) = &self.shift {
            product.iter_mut().zip(shift).zip(x).for_each(|((product, shift), x)| *product -= shift * x);
        }
        Ok(product)
    }

    /// Forward and backward substitution.
    fn substitute(&mut self, b: &[f64]) -> Result<Vec<f64>, LinearError> {
        let factor = self.factor.as_ref().ok_or(LinearError::Singular { unknown: None })?;
        self.given.with(b.len(), |given| given.copy_from_slice(b))?;
        factor.solve(&self.given, &mut self.found)?;
        Ok(self.found.with(b.len(), |found| found.to_vec())?)
    }

    /// Solves the original equations, with refinement; also returns the relative residual.
    fn refine(&mut self, ranks: &Ranks, b: &[f64]) -> Result<(Vec<f64>, f64), LinearError> {
        let case = usize::from(self.shift.is_some());
        let size = norm(ranks, b);
        let mut x = self.substitute(b)?;
        let mut rest = self.rest(b, &x)?;
        let mut residual = norm(ranks, &rest) / size;
        for _ in 0..REFINEMENTS[case] {
            if residual <= ENOUGH[case] || !residual.is_finite() {
                break;
            }
            let mut better = self.substitute(&rest)?;
            better.iter_mut().zip(&x).for_each(|(change, x)| *change += x);
            let new = self.rest(b, &better)?;
            let now = norm(ranks, &new) / size;
            if now.is_nan() || now >= residual {
                break;
            }
            (x, rest, residual) = (better, new, now);
        }
        Ok((x, residual))
    }

    /// b − A x.
    fn rest(&mut self, b: &[f64], x: &[f64]) -> Result<Vec<f64>, Error> {
        let mut rest = self.multiply(x)?;
        rest.iter_mut().zip(b).for_each(|(product, b)| *product = b - *product);
        Ok(rest)
    }

    fn solve(&mut self, ranks: &Ranks, b: &[f64]) -> Result<Vec<f64>, LinearError> {
        let size = norm(ranks, b);
        if size == 0.0 {
            return Ok(vec![0.0; b.len()]);
        }
        let singular = Err(LinearError::Singular { unknown: None });
        if !size.is_finite() {
            return singular;
        }
        self.largest = self.largest.max(size);
        let (x, residual) = self.refine(ranks, b)?;
        let case = usize::from(self.shift.is_some());
        // Near equilibrium, a right-hand side consists of the round-off of earlier, larger right-hand sides.
        let allowed =
            if self.shift.is_some() { SINGULAR[case] * self.largest / size } else { SINGULAR[case] };
        let is_solved = residual <= allowed && x.iter().all(|x| x.is_finite());
        if ranks.all(is_solved) { Ok(x) } else { singular }
    }
}

/// The Euclidean norm of the numbers on all ranks.
fn norm(ranks: &Ranks, own: &[f64]) -> f64 {
    ranks.total(own.iter().map(|x| x * x).sum()).sqrt()
}
