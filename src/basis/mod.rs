//! Basis functions of the material point methods: which grid nodes a point touches, and how strongly (section 6.1).

mod connectivity;
mod gimp;
mod mpm;

use serde::{Deserialize, Serialize};

use crate::grid::Grid;

pub use connectivity::{Connectivity, Links};
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
}

impl Method {
    /// The basis of the method in `D` dimensions.
    pub fn basis<const D: usize>(self) -> &'static dyn Basis<D> {
        match self {
            Method::Mpm => &Mpm,
            Method::Gimp => &Gimp,
        }
    }

    /// Whether points of the method have a domain.
    pub fn has_domain(self) -> bool {
        self == Method::Gimp
    }
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
}

impl<const D: usize> Support<D> {
    /// Forgets the previous point.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.value.clear();
        self.gradient.clear();
    }
}

/// The point is not in the grid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the point is outside the grid")]
pub struct OffGrid;

/// A material point method: from the position and domain of a point to its basis functions.
pub trait Basis<const D: usize>: Sync {
    /// Writes the nodes, values and gradients seen by a point at `position` whose domain reaches `half_lengths`
    /// ([length], zero for methods without domain) to both sides of it.
    ///
    /// # Errors
    /// [`OffGrid`] when the position is outside the grid.
    fn support(
        &self,
        grid: &Grid<D>,
        position: &[f64; D],
        half_lengths: &[f64; D],
        out: &mut Support<D>,
    ) -> Result<(), OffGrid>;
}

/// The tensor product of one-dimensional supports: `(first node, [(S, dS/dx)])` per axis.
fn tensor_product<const D: usize>(grid: &Grid<D>, axes: &[(usize, &[(f64, f64)]); D], out: &mut Support<D>) {
    out.clear();
    let total: usize = axes.iter().map(|(_, s)| s.len()).product();
    for link in 0..total {
        let mut rest = link;
        let offset: [usize; D] = std::array::from_fn(|d| {
            let n = axes[d].1.len();
            let k = rest % n;
            rest /= n;
            k
        });
        let mut value = 1.0;
        let mut gradient = [1.0; D];
        for d in 0..D {
            let (s, ds) = axes[d].1[offset[d]];
            value *= s;
            for (e, g) in gradient.iter_mut().enumerate() {
                *g *= if e == d { ds } else { s };
            }
        }
        let node = grid.node(std::array::from_fn(|d| axes[d].0 + offset[d]));
        out.nodes.push(node as u32);
        out.value.push(value);
        out.gradient.push(gradient);
    }
}

/// One checker run over every method: a new method adds one line to the list.
#[cfg(test)]
mod conformance {
    use super::*;
    use proptest::prelude::*;

    const METHODS: [Method; 2] = [Method::Mpm, Method::Gimp];

    fn support(method: Method, grid: &Grid<2>, x: [f64; 2], l: [f64; 2]) -> Support<2> {
        let mut out = Support::default();
        method.basis::<2>().support(grid, &x, &l, &mut out).unwrap();
        out
    }

    proptest! {
        #[test]
        fn every_basis_conforms(x in prop::array::uniform2(0.3..0.7f64), l in prop::array::uniform2(1e-3..0.25f64)) {
            let grid = Grid::<2>::new([0.0, -0.5], [0.1, 0.2], [10, 10]);
            for method in METHODS {
                let l = if method.has_domain() { l } else { [0.0; 2] };
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
        let grid = Grid::<2>::new([0.0; 2], [0.1, 0.2], [10, 10]);
        let (x, l) = ([0.47, 0.93], [0.055, 0.13]);
        let s = support(Method::Gimp, &grid, x, l);
        let n = 2000;
        let mut mean = vec![0.0; grid.n_nodes()];
        for i in 0..n {
            for j in 0..n {
                let at = |d: usize, k: usize| x[d] - l[d] + 2.0 * l[d] * (k as f64 + 0.5) / n as f64;
                let q = [at(0, i), at(1, j)];
                let cell = grid.cell(grid.locate(&q).unwrap());
                let low = grid.node_position(grid.node(grid.cell_index(cell)));
                for (corner, node) in grid.cell_nodes(cell).enumerate() {
                    let hat = |d: usize| {
                        let xi = (q[d] - low[d]) / grid.spacing()[d];
                        if corner >> d & 1 == 1 { xi } else { 1.0 - xi }
                    };
                    mean[node] += hat(0) * hat(1) / (n * n) as f64;
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
