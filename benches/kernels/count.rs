//! Operations and memory traffic of an evaluation, counted from the equations as programmed.
//!
//! A sum, difference, product, quotient or root counts as one operation, a logarithm as twenty. For a symmetric
//! stiffness, only one triangle counts, even if vector instructions compute more. The bytes counted are those that must
//! be transferred at least once between memory and processor: the data of points and links, and the blocks of the
//! stiffness when they are zeroed, summed and read again. Both counts are estimates.

use mpm::basis::Connectivity;
use mpm::stress::StartOfStep;
use mpm::tensor::Sym3;

/// Cost of one evaluation of all points.
pub struct Work {
    /// Operations.
    pub flops: f64,
    /// Bytes.
    pub bytes: f64,
}

/// The kernels, distinguished by their cost.
#[derive(Clone, Copy)]
pub enum Kernel {
    /// [`mpm::stress::PlaneStrain`].
    Plane,
    /// [`mpm::stress::Axisymmetric`].
    Revolved,
    /// [`mpm::stress::Solid`], for a law with isotropic spatial moduli.
    Isotropic,
    /// [`mpm::stress::Solid`].
    Solid,
}

impl Kernel {
    /// Operations for a point itself, for each node that it touches, and for each pair of these nodes, without eq. (7).
    fn flops(self) -> [f64; 3] {
        match self {
            Kernel::Plane => [370.0, 34.0, 16.0],
            Kernel::Revolved => [1450.0, 75.0, 24.0],
            Kernel::Isotropic => [210.0, 45.0, 44.0],
            Kernel::Solid => [1450.0, 150.0, 54.0],
        }
    }
}

/// The work of one evaluation; `pairs` is the number of pairs of nodes in the stiffness.
pub fn work<const D: usize>(
    kernel: Kernel,
    links: &Connectivity<D>,
    n_points: usize,
    pairs: usize,
    history: usize,
) -> Work {
    let [own, per_node, per_pair] = kernel.flops();
    let number = size_of::<f64>() as f64;
    let (d, history) = (D as f64, history as f64);
    let mut flops = 0.0;
    for p in 0..n_points {
        let n = links.local_nodes(p).len() as f64;
        flops += own + (2.0 * d * d + per_node) * n + per_pair * n * (n + 1.0) / 2.0;
    }
    let per_point = size_of::<StartOfStep>() as f64 + 2.0 * size_of::<Sym3>() as f64 + 2.0 * history * number;
    let bytes = per_point * n_points as f64
        + (d * number + 4.0) * links.n_links() as f64
        + 3.0 * d * d * number * pairs as f64;
    Work { flops, bytes }
}
