//! The functions that the PETSc solvers call: the product with the matrix, and the caller's preconditioner.

use std::any::Any;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use mpm_core::linear::{LinearError, Stiffness};
use mpm_core::ranks::Halo;

use crate::entries::GlobalNumbers;
use crate::error::agree;
use crate::ffi;
use crate::objects::{read_numbers, with_numbers};

use super::preconditioner::Preconditioner;

/// The data on which the functions work during a solution.
pub(super) struct Context<'a, 'b, const D: usize, const N: usize> {
    pub halo: &'a Halo,
    numbers: &'a GlobalNumbers<N>,
    /// Diagonal entries at components that are not unknowns, zero at unknowns.
    held: &'a [[f64; N]],
    stiffness: &'a mut Stiffness<'b, N>,
    preconditioner: Option<&'a mut (dyn Preconditioner<D, N> + 'static)>,
    /// Argument and result on the active nodes.
    given: Vec<[f64; N]>,
    found: Vec<[f64; N]>,
    /// Numbers at own nodes.
    own: Vec<f64>,
    error: Option<LinearError>,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'a, 'b, const D: usize, const N: usize> Context<'a, 'b, D, N> {
    pub fn new(
        halo: &'a Halo,
        numbers: &'a GlobalNumbers<N>,
        held: &'a [[f64; N]],
        stiffness: &'a mut Stiffness<'b, N>,
        preconditioner: Option<&'a mut (dyn Preconditioner<D, N> + 'static)>,
    ) -> Self {
        let field = vec![[0.0; N]; held.len()];
        let own = vec![0.0; numbers.own()];
        let (error, panic) = (None, None);
        Context {
            halo,
            numbers,
            held,
            stiffness,
            preconditioner,
            given: field.clone(),
            found: field,
            own,
            error,
            panic,
        }
    }

    /// The values of a complete field at own nodes, zero at components that are not unknowns.
    pub fn unknowns_of(&self, field: &[[f64; N]]) -> Vec<f64> {
        let mut free = field.to_vec();
        clear_held(&mut free, self.held);
        let mut own = vec![0.0; self.numbers.own()];
        self.numbers.take(&free, &mut own);
        own
    }

    /// Makes a complete field from a solution. All ranks must call this.
    pub fn finish(&self, own: &[f64], field: &mut [[f64; N]]) {
        self.numbers.spread(self.halo, own, field);
        clear_held(field, self.held);
    }

    /// Passes on a panic or an error of a callback.
    pub fn raise(&mut self) -> Result<(), LinearError> {
        if let Some(panic) = self.panic.take() {
            resume_unwind(panic);
        }
        self.error.take().map_or(Ok(()), Err)
    }

    /// The product with the matrix: with the stiffness at the unknowns, with a diagonal matrix elsewhere.
    fn multiply(&mut self) -> Result<(), LinearError> {
        let Context { halo, numbers, held, stiffness, given, found, own, .. } = self;
        numbers.spread(halo, own, given);
        clear_held(given, held);
        stiffness.multiply(given, found);
        halo.add(found);
        clear_held(found, held);
        self.finish_held(|x, held| x * held);
        Ok(())
    }

    fn precondition(&mut self) -> Result<(), LinearError> {
        let Context { halo, numbers, held, preconditioner, given, found, own, .. } = self;
        numbers.spread(halo, own, given);
        clear_held(given, held);
        let preconditioner =
            preconditioner.as_mut().ok_or(LinearError::Library("no preconditioner".into()))?;
        agree(halo.ranks(), preconditioner.apply(halo, given, found))?;
        clear_held(found, held);
        self.finish_held(|r, held| r / held);
        Ok(())
    }

    /// Copies the result to the numbers at this rank's own nodes; at components that are not unknowns, applies
    /// `at_held` to the argument instead.
    fn finish_held(&mut self, at_held: impl Fn(f64, f64) -> f64) {
        let (found, held) = (self.found.as_flattened(), self.held.as_flattened());
        for (number, place) in self.own.iter_mut().zip(self.numbers.places()) {
            let (found, held) = (found[*place as usize], held[*place as usize]);
            *number = if held > 0.0 { at_held(*number, held) } else { found };
        }
    }

    /// Runs a function from one vector to another; keeps its error or panic.
    ///
    /// # Safety
    /// Both vectors must exist, with the layout of the unknowns, and must not be the same.
    unsafe fn call(
        &mut self,
        x: ffi::Vec_,
        y: ffi::Vec_,
        function: impl FnOnce(&mut Self) -> Result<(), LinearError>,
    ) -> ffi::PetscErrorCode {
        let n = self.own.len();
        let outcome = catch_unwind(AssertUnwindSafe(|| -> Result<(), LinearError> {
            // SAFETY: The caller guarantees what both functions need.
            unsafe { read_numbers(x, n, |x| self.own.copy_from_slice(x))? };
            function(self)?;
            // SAFETY: As above.
            unsafe { with_numbers(y, n, |y| y.copy_from_slice(&self.own))? };
            Ok(())
        }));
        match outcome {
            Ok(Ok(())) => return 0,
            Ok(Err(error)) => self.error = Some(error),
            Err(panic) => self.panic = Some(panic),
        }
        ffi::PETSC_ERR_USER
    }
}

fn clear_held<const N: usize>(field: &mut [[f64; N]], held: &[[f64; N]]) {
    for (value, held) in field.as_flattened_mut().iter_mut().zip(held.as_flattened()) {
        if *held > 0.0 {
            *value = 0.0;
        }
    }
}

/// The product of the matrix with a vector, for PETSc.
pub(super) unsafe extern "C" fn product<const D: usize, const N: usize>(
    matrix: ffi::Mat,
    x: ffi::Vec_,
    y: ffi::Vec_,
) -> ffi::PetscErrorCode {
    let mut context: *mut c_void = std::ptr::null_mut();
    // SAFETY: PETSc passes its objects; the context is null or that of the current solution, which nothing else uses
    // meanwhile.
    unsafe {
        let code = ffi::MatShellGetContext(matrix, (&raw mut context).cast());
        match context.cast::<Context<D, N>>().as_mut() {
            Some(context) if code == 0 => context.call(x, y, Context::multiply),
            _ => ffi::PETSC_ERR_USER,
        }
    }
}

/// The caller's preconditioner, for PETSc.
pub(super) unsafe extern "C" fn apply<const D: usize, const N: usize>(
    pc: ffi::PC,
    x: ffi::Vec_,
    y: ffi::Vec_,
) -> ffi::PetscErrorCode {
    let mut context: *mut c_void = std::ptr::null_mut();
    // SAFETY: As above.
    unsafe {
        let code = ffi::PCShellGetContext(pc, (&raw mut context).cast());
        match context.cast::<Context<D, N>>().as_mut() {
            Some(context) if code == 0 => context.call(x, y, Context::precondition),
            _ => ffi::PETSC_ERR_USER,
        }
    }
}
