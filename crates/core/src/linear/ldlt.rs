//! LDLᵀ without pivoting, from the faer library, for symmetric matrices that are not positive definite.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltError;
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};

use super::{LinearError, Pattern};

/// The layout of the factor, and working space. The caller stores the values of the factor.
pub(super) struct Ldlt {
    symbolic: SymbolicCholesky<usize>,
    memory: MemBuffer,
}

/// A pivot is zero or not finite.
pub(super) struct ZeroPivot {
    /// The unknown to which this pivot belongs, if it can be identified.
    pub unknown: Option<usize>,
}

impl Ldlt {
    /// Lays out the factor for this order of elimination. `ask_for` receives the number of additional bytes needed for
    /// the factor and for working space; room for `present` values of the factor exists already. `ask_for` can refuse.
    pub fn new(
        pattern: &Pattern,
        order: &[usize],
        present: usize,
        ask_for: impl Fn(u64) -> Result<(), LinearError>,
    ) -> Result<Ldlt, LinearError> {
        let mut inverse = vec![0; order.len()];
        for (place, &unknown) in order.iter().enumerate() {
            inverse[unknown] = place;
        }
        let symbolic = factorize_symbolic_cholesky(
            pattern.view(),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, pattern.n)),
            CholeskySymbolicParams::default(),
        )
        .map_err(out_of_memory)?;
        let scratch = symbolic
            .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let more = symbolic.len_val().saturating_sub(present);
        ask_for(8 * more as u64 + scratch.unaligned_bytes_required() as u64)?;
        let memory = MemBuffer::try_new(scratch).map_err(out_of_memory)?;
        Ok(Ldlt { symbolic, memory })
    }

    /// Number of values in the factor.
    pub fn factor_len(&self) -> usize {
        self.symbolic.len_val()
    }

    /// Writes the factor of the matrix with these values.
    pub fn factorise(
        &mut self,
        pattern: &Pattern,
        values: &[f64],
        factor: &mut [f64],
    ) -> Result<(), ZeroPivot> {
        let ldlt = self.symbolic.factorize_numeric_ldlt(
            &mut factor[..self.symbolic.len_val()],
            SparseColMatRef::new(pattern.view(), values),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Default::default(),
        );
        ldlt.map(|_| ()).map_err(|LdltError::ZeroPivot { index }| {
            // faer counts pivots from 1 in its simplicial factorisation and from 0 in its supernodal factorisation.
            let place = match self.symbolic.raw() {
                SymbolicCholeskyRaw::Simplicial(_) => index.saturating_sub(1),
                SymbolicCholeskyRaw::Supernodal(_) => index,
            };
            let unknown = self.symbolic.perm().and_then(|perm| perm.arrays().0.get(place).copied());
            ZeroPivot { unknown }
        })
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, factor: &[f64], rhs: &mut [f64]) {
        let x = MatMut::from_column_major_slice_mut(rhs, rhs.len(), 1);
        let factor = LdltRef::new(&self.symbolic, &factor[..self.symbolic.len_val()]);
        factor.solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(&mut self.memory));
    }
}

fn out_of_memory<E>(_: E) -> LinearError {
    LinearError::OutOfMemory { needed: None }
}
