//! The interface of a solver for the equations of a load step, and its input.

use std::any::Any;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::blocks::{BlockMatrix, Division};
use super::{Factorisation, LinearError, Numbering};
use crate::ranks::Halo;

/// A solver for the linear equations of a load step, K x = b on the unknowns of the active nodes.
///
/// A load step calls [`prepare`](Backend::prepare) at its start and again if the layout of the matrix changes,
/// [`factorise`](Backend::factorise) whenever it needs a new factor, and [`solve`](Backend::solve) for each right-hand
/// side. The grid has `D` axes, and each node has `N` components.
///
/// The result must not depend on the number of threads, so a backend must compute every sum in a fixed order.
pub trait Backend<const D: usize, const N: usize = D>: Send {
    /// Prepares for matrices of this sparsity pattern.
    ///
    /// # Errors
    /// [`LinearError`] if the backend cannot solve equations of this kind.
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError>;

    /// Factorises a matrix, or sets up a preconditioner for it.
    ///
    /// # Errors
    /// [`LinearError`] if this fails.
    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError>;

    /// Solves for `x`; an iterative backend leaves a residual of at most `tolerance` relative to `b`, [-]. Only the
    /// components of `b` that are unknowns are used; `x` is zero elsewhere. The factor or preconditioner may belong to
    /// an earlier matrix: a direct backend then solves the earlier equations, an iterative backend the equations of
    /// `stiffness`.
    ///
    /// # Errors
    /// [`LinearError`] if the backend does not find the solution.
    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError>;

    /// Frees the memory of the backend until it is prepared again. All ranks must call this together.
    fn release(&mut self) {}

    /// True if [`solve`](Backend::solve) iterates with the current matrix, so that a factor of an earlier matrix is
    /// sufficient.
    fn is_iterative(&self) -> bool;
}

/// The backends that a library provides for `N` components at each node.
#[derive(Default)]
pub struct Backends<const D: usize, const N: usize = D> {
    /// A direct backend; `None` to use the built-in one.
    pub direct: Option<Box<dyn Backend<D, N>>>,
    /// An iterative backend for structured grids; `None` to use the built-in one.
    pub iterative: Option<Box<dyn Backend<D, N>>>,
    /// An iterative backend for any grid, and for nodes held along any direction or tied to others; `None` if there is
    /// none.
    pub algebraic: Option<Box<dyn Backend<D, N>>>,
}

/// A library that solves equations distributed over several ranks.
pub trait Engine<const D: usize>: Send + Sync + std::fmt::Debug {
    /// The backends for the displacement alone.
    fn backends(&self) -> Backends<D>;

    /// The backends for `components` components at each node, of the displacement and of further fields: a boxed
    /// [`Backends<D, N>`](Backends) with `N = components`. `None` if the library has none for this number.
    fn backends_with_fields(&self, _components: usize) -> Option<Box<dyn Any>> {
        None
    }
}

/// The library that solves equations distributed over several ranks, if there is one.
#[derive(Debug, Clone, Default)]
pub struct Engines<const D: usize>(pub Option<Arc<dyn Engine<D>>>);

impl<const D: usize> Engines<D> {
    /// The backends for `N` components at each node, without a library those built in; `None` if the library has none
    /// for this number.
    pub fn backends<const N: usize>(&self) -> Option<Backends<D, N>> {
        let backends: Box<dyn Any> = match &self.0 {
            None => return Some(Backends::default()),
            Some(engine) if N == D => Box::new(engine.backends()),
            Some(engine) => engine.backends_with_fields(N)?,
        };
        backends.downcast().ok().map(|backends| *backends)
    }
}

/// The method by which a system was solved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Solved {
    /// The kind of factorisation.
    pub factorisation: Factorisation,
    /// Number of iterations; 0 for a direct solution.
    pub iterations: usize,
}

/// The nodes and unknowns of the equations of a load step.
#[derive(Clone, Copy)]
pub struct Layout<'a, const D: usize, const N: usize = D> {
    /// The unknowns.
    pub numbering: &'a Numbering<N>,
    /// Grid node of each active node, ascending. Unlike active nodes and unknowns, grid nodes keep their numbers from
    /// step to step.
    pub nodes: &'a [u32],
    /// Integer coordinates of an active node: its indices in a structured grid, or its binned position in a mesh.
    pub lattice: &'a (dyn Fn(usize) -> [u32; D] + 'a),
    /// Coordinates of an active node, [length].
    pub position: &'a (dyn Fn(usize) -> [f64; D] + 'a),
    /// Coordinates of the lattice lines along each axis, [length]; `None` along axes on which they are evenly spaced or
    /// unknown.
    pub lines: [Option<&'a [f64]>; D],
    /// The active nodes shared with other ranks. If there are any, the matrix contains only the contributions of this
    /// rank; vectors are complete.
    pub halo: &'a Halo,
}

/// The stiffness matrix, with working space for its products.
pub struct Stiffness<'a, const N: usize> {
    /// The matrix over all components of the active nodes, whether unknown or not.
    pub matrix: BlockMatrix<'a, N>,
    /// The division of the columns of the matrix into tasks.
    pub division: &'a mut Division<N>,
}

impl<const N: usize> Stiffness<'_, N> {
    /// `out = K x` over all components.
    pub fn multiply(&mut self, x: &[[f64; N]], out: &mut [[f64; N]]) {
        self.matrix.multiply(self.division, x, out);
    }
}
