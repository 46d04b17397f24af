//! Basis functions of the material point methods: which grid nodes a point touches, and how strongly (section 6.1).

mod connectivity;
mod cpdi;
mod gimp;
mod mpm;

use serde::{Deserialize, Serialize};

use crate::grid::Grid;

pub use connectivity::{Connectivity, Links, SupportFailure};
pub use cpdi::{Cpdi, check_domain, domain_volume};
pub use gimp::Gimp;
pub use mpm::Mpm;

/// Material point method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The standard material point method: points without extent.
    Mpm,
    /// The generalised interpolation material point method: points with a rectangular domain.
    #[default]
    Gimp,
    /// The convected particle domain interpolation with parallelograms: the domain follows F of the point.
    Cpdi1,
    /// The second-order convected particle domain interpolation: the corners of the domain move with the grid.
    Cpdi2,
}

/// What kind of domain the points of a method have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DomainKind {
    /// None: the point is a point.
    None,
    /// A box aligned with the axes, given by half lengths.
    Box,
    /// A quadrilateral (hexahedron), given by its corners.
    Corners,
}

impl Method {
    /// The basis of the method in `D` dimensions.
    pub fn basis<const D: usize>(self) -> &'static dyn Basis<D> {
        match self {
            Method::Mpm => &Mpm,
            Method::Gimp => &Gimp,
            Method::Cpdi1 | Method::Cpdi2 => &Cpdi,
        }
    }

    /// Name in decks.
    pub fn name(self) -> &'static str {
        match self {
            Method::Mpm => "mpm",
            Method::Gimp => "gimp",
            Method::Cpdi1 => "cpdi1",
            Method::Cpdi2 => "cpdi2",
        }
    }

    /// What kind of domain its points have.
    pub fn domain(self) -> DomainKind {
        match self {
            Method::Mpm => DomainKind::None,
            Method::Gimp => DomainKind::Box,
            Method::Cpdi1 | Method::Cpdi2 => DomainKind::Corners,
        }
    }
}

/// Where a point is at the start of a load step, and its domain.
#[derive(Debug, Clone, Copy)]
pub struct PointGeometry<'a, const D: usize> {
    /// The cell that holds the point.
    pub cell: u32,
    /// Position, [length].
    pub position: &'a [f64; D],
    /// Half lengths of a box domain, [length].
    pub half_lengths: &'a [f64; D],
    /// Corners of a domain of the kind [`DomainKind::Corners`], [length]; bit d of a corner's number is its side
    /// along parametric axis d.
    pub corners: &'a [[f64; D]],
}

/// The part of the grid that one point sees.
#[derive(Debug, Clone, Default)]
pub struct Support<const D: usize> {
    /// Grid nodes, ascending.
    pub nodes: Vec<u32>,
    /// S_vp, [-].
    pub value: Vec<f64>,
    /// ∂S_vp/∂X̃ in the configuration at the start of the step, [1/length].
    pub gradient: Vec<[f64; D]>,
    /// Cells that the point or its domain meets, in no order, perhaps repeated.
    pub cells: Vec<u32>,
}

impl<const D: usize> Support<D> {
    /// Forgets the previous point.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.value.clear();
        self.gradient.clear();
        self.cells.clear();
    }

    /// Adds to the value and gradient of a node.
    pub fn add(&mut self, node: u32, value: f64, gradient: [f64; D]) {
        let place = self.nodes.partition_point(|n| *n < node);
        if self.nodes.get(place) == Some(&node) {
            self.value[place] += value;
            for (sum, g) in self.gradient[place].iter_mut().zip(gradient) {
                *sum += g;
            }
        } else {
            self.nodes.insert(place, node);
            self.value.insert(place, value);
            self.gradient.insert(place, gradient);
        }
    }
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SupportError {
    /// The point is not in the grid.
    #[error("the point is outside the grid")]
    OffGrid,
    /// A corner of its domain is not in the grid.
    #[error("corner {corner} of its domain, at ({:.6}, {:.6}), is outside the grid", position[0], position[1])]
    CornerOffGrid {
        /// Number of the corner.
        corner: usize,
        /// Where it is, [length].
        position: [f64; 3],
    },
    /// The domain is inverted, a bow-tie, or has no volume.
    #[error("its domain is inverted or crosses itself")]
    Distorted,
    /// The method needs a structured grid.
    #[error("the method needs a structured grid")]
    Unstructured,
}

/// A material point method: from the position and domain of a point to its basis functions.
pub trait Basis<const D: usize>: Sync {
    /// Writes the nodes, values and gradients seen by a point, and the cells it meets.
    ///
    /// # Errors
    /// [`SupportError`] when the point or a corner of its domain is outside the grid, or the domain is distorted.
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError>;
}

/// One checker run over every method: a new method adds one line to the list.
#[cfg(test)]
mod conformance {
    use super::*;
    use crate::grid::Structured;
    use proptest::prelude::*;

    const METHODS: [Method; 4] = [Method::Mpm, Method::Gimp, Method::Cpdi1, Method::Cpdi2];

    fn support(method: Method, grid: &dyn Grid<2>, x: [f64; 2], l: [f64; 2]) -> Support<2> {
        let mut out = Support::default();
        // A sheared parallelogram about the point, which is its centroid.
        let corners: [[f64; 2]; 4] = std::array::from_fn(|c| {
            let (s, t) = (f64::from(2 * (c as u8 & 1)) - 1.0, f64::from(c as u8 & 2) - 1.0);
            [x[0] + s * l[0] + 0.15 * t * l[1], x[1] - 0.2 * s * l[0] + t * l[1]]
        });
        let cell = grid.locate(&x, None).unwrap();
        let point = PointGeometry { cell, position: &x, half_lengths: &l, corners: &corners };
        method.basis::<2>().support(grid, &point, &mut out).unwrap();
        out
    }

    proptest! {
        #[test]
        fn every_basis_conforms(x in prop::array::uniform2(0.3..0.7f64), l in prop::array::uniform2(1e-3..0.25f64)) {
            let grid = Structured::<2>::new([0.0, -0.5], [0.1, 0.2], [10, 10]);
            for method in METHODS {
                let l = if method.domain() == DomainKind::None { [0.0; 2] } else { l };
                let s = support(method, &grid, x, l);
                // Partition of unity and its gradient, linear reproduction and its gradient.
                let sum: f64 = s.value.iter().sum();
                prop_assert!((sum - 1.0).abs() < 1e-14);
                prop_assert!(s.nodes.is_sorted() && s.value.iter().all(|v| *v >= 0.0));
                for d in 0..2 {
                    let position = |k: usize| grid.node_position(s.nodes[k] as usize);
                    let n = s.nodes.len();
                    let gradient_sum: f64 = s.gradient.iter().map(|g| g[d]).sum();
                    prop_assert!(gradient_sum.abs() < 1e-12);
                    let linear: f64 = (0..n).map(|k| s.value[k] * position(k)[d]).sum();
                    prop_assert!((linear - x[d]).abs() < 1e-14);
                    for e in 0..2 {
                        let slope: f64 = (0..n).map(|k| s.gradient[k][e] * position(k)[d]).sum();
                        prop_assert!((slope - f64::from(u8::from(d == e))).abs() < 1e-12);
                    }
                }
                // The gradient is the derivative of the value with respect to the position.
                // (For CPDI the gradient is that of the interpolation inside the domain, which is another function.)
                if method.domain() == DomainKind::Corners {
                    continue;
                }
                let h = 1e-6;
                let near_line = |d: usize| {
                    let xi = |y: f64| (y - grid.origin()[d]) / grid.spacing()[d];
                    [x[d] - l[d], x[d] + l[d]].iter().any(|&y| (xi(y) - xi(y).round()).abs() < 1e-4)
                };
                for d in (0..2).filter(|&d| !near_line(d)) {
                    let (mut p, mut m) = (x, x);
                    p[d] += h;
                    m[d] -= h;
                    let (p, m) = (support(method, &grid, p, l), support(method, &grid, m, l));
                    for k in 0..s.nodes.len() {
                        let numeric = (p.value[k] - m.value[k]) / (2.0 * h);
                        prop_assert!((numeric - s.gradient[k][d]).abs() < 1e-7, "{numeric} {}", s.gradient[k][d]);
                    }
                }
            }
        }
    }

    #[test]
    fn a_gimp_point_averages_the_linear_basis_over_its_domain() {
        let grid = Structured::<2>::new([0.0; 2], [0.1, 0.2], [10, 10]);
        let (x, l) = ([0.47, 0.93], [0.055, 0.13]);
        let s = support(Method::Gimp, &grid, x, l);
        let n = 2000;
        let mut mean = vec![0.0; grid.n_nodes()];
        for i in 0..n {
            for j in 0..n {
                let at = |d: usize, k: usize| x[d] - l[d] + 2.0 * l[d] * (k as f64 + 0.5) / n as f64;
                let q = [at(0, i), at(1, j)];
                let basis = grid.basis_at(grid.locate(&q, None).unwrap(), &q);
                for (&node, value) in basis.nodes().iter().zip(basis.value()) {
                    mean[node as usize] += value / (n * n) as f64;
                }
            }
        }
        for (k, &node) in s.nodes.iter().enumerate() {
            assert!((s.value[k] - mean[node as usize]).abs() < 1e-6);
            mean[node as usize] = 0.0;
        }
        assert!(mean.iter().all(|m| *m == 0.0), "a node of the domain is missing");
    }
}
