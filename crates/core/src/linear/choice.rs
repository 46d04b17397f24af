//! The choice between a factorisation and conjugate gradients.

use serde::{Deserialize, Serialize};

/// The solution method for linear equations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// Direct, or iterative if that is faster or the factor does not fit in memory. It is iterative for many unknowns
    /// on a structured grid, chiefly in three dimensions, or, on several ranks, for very many unknowns on a mesh.
    #[default]
    Auto,
    /// Factorisation.
    Direct,
    /// Conjugate gradients, or GMRES if the stiffness is unsymmetric or not positive definite, with a multigrid
    /// preconditioner. A mesh has no coarser grids and needs several ranks with PETSc; otherwise, its equations are
    /// factorised, with a warning.
    Iterative,
}

/// Number of operations of a factorisation, divided by the cube of the number of columns of its last separator.
const WORK_OF_SEPARATOR: f64 = 5.0;

/// Number of operations of a factorisation, per block of the matrix, at which it takes twice as long as conjugate
/// gradients with their set-up; measured, see `docs/performance.md`.
const WORK_OF_BLOCK: f64 = 40e3;

/// Number of unknowns up to which a factorisation is faster in the plane.
const MAX_UNKNOWNS_IN_PLANE: f64 = 1e6;

/// Time of an iterative solution with an algebraic multigrid, divided by the time with a geometric multigrid; measured,
/// see `docs/decisions/0045-ranks.md`.
pub const ALGEBRAIC: f64 = 5.0;

/// The size of a system on the nodes of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Number of nodes.
    pub nodes: f64,
    /// Largest distance along an axis, in cells, between two coupled nodes.
    pub reach: f64,
    /// Number of coupled pairs of nodes, each counted once, including the pair of each node with itself.
    pub pairs: f64,
}

impl Extent {
    /// The size of a system on a mesh. Because its nodes have no coordinates in units of cells, the reach is taken from
    /// a structured grid with the same number of pairs.
    pub fn mesh<const D: usize>(nodes: f64, pairs: f64) -> Self {
        let coupled = 2.0 * pairs / nodes.max(1.0) - 1.0;
        let reach = (0.5 * (coupled.max(1.0).powf(1.0 / D as f64) - 1.0)).max(1.0);
        Extent { nodes, reach, pairs }
    }

    /// True if conjugate gradients probably solve a positive definite system of this size in `D` dimensions faster than
    /// a factorisation: in space, at least twice as fast. The work of a factorisation is estimated from its last
    /// separator, whose thickness is the reach of the couplings. A preconditioner without coarser grids takes longer.
    pub fn is_large<const D: usize>(&self, has_coarser_grids: bool) -> bool {
        let slower = if has_coarser_grids { 1.0 } else { ALGEBRAIC };
        if D < 3 {
            return D as f64 * self.nodes > slower * MAX_UNKNOWNS_IN_PLANE;
        }
        let separator = D as f64 * self.reach.max(1.0) * self.nodes.powf(2.0 / 3.0);
        WORK_OF_SEPARATOR * separator.powi(3) > slower * WORK_OF_BLOCK * self.pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_large_systems_in_space_are_solved_iteratively() {
        let cube = |n: f64, reach: f64| {
            let near = (2.0 * reach + 1.0).powi(3);
            Extent { nodes: n.powi(3), reach, pairs: n.powi(3) * (near + 1.0) / 2.0 }
        };
        assert!(!cube(9.0, 1.0).is_large::<3>(true));
        assert!(cube(17.0, 1.0).is_large::<3>(true) && cube(33.0, 1.0).is_large::<3>(true));
        assert!(!cube(17.0, 1.0).is_large::<3>(false) && cube(65.0, 1.0).is_large::<3>(false));
        let plane = |n: f64| Extent { nodes: n * n, reach: 1.0, pairs: 5.0 * n * n };
        assert!(!plane(700.0).is_large::<2>(true) && plane(1000.0).is_large::<2>(true));
        assert!(!plane(1000.0).is_large::<2>(false));
        let found = Extent::mesh::<3>(1000.0, cube(10.0, 2.0).pairs);
        assert!((found.reach - 2.0).abs() < 1e-12, "{found:?}");
        // Tetrahedra have about 15 neighbours.
        assert_eq!(Extent::mesh::<3>(1000.0, 8000.0).reach, 1.0);
    }
}
