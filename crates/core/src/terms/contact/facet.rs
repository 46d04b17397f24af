//! A side of a body that contact points of another body touch: a plane that moves and turns with the nodes.
//!
//! A facet has the positions x(η) = x₀ + Σ_m η_m e_m, with one edge e_m in the plane and two in space. Corners move with
//! the nodes, so that e_m = E_m + Σ_v D_mv Δd_v. A contact point at the distance d from the position on the facet that it
//! faced at the start of the step, d = g₀ n₀ + s, has
//!
//! | Quantity | Equation |
//! |---|---|
//! | gap | g = n · d, with the normal n of the edges |
//! | position on the facet | δη = G⁻¹ Eᵀ d, G = EᵀE |
//! | share of a node | c_v = c_v(start) − Σ_m D_mv δη_m |
//! | motion at the current position | Σ_v c_v Δd_v: δg = n · Σ_v c_v δd_v |
//! | turning | δn = −E G⁻¹ δEᵀ n |
//! | sliding | δ(δη) = G⁻¹ (Eᵀ Σ_v c_v δd_v + δEᵀ n g) |
//!
//! The shares c_v are positive for nodes of the body of the contact point and negative for those of the other body; a
//! force f on the contact point is a force c_v f on node v, so that action and reaction are equal, and in balance of
//! moments as far as the gap is closed.

use crate::assembly::System;
use crate::region::vector::{along, cross, dot, norm, unit};
use crate::tool::Closest;

use super::carriers::Carriers;
use super::interface::Touch;
use super::motion::in_space;

/// A facet at the start of a step.
#[derive(Debug, Clone)]
pub(super) struct Facet<const D: usize> {
    /// E_m, [length]; in the plane, the second one is not used.
    pub(super) edges: [[f64; D]; 2],
    /// D_mv for each node of the contact point, in their order, [-].
    pub(super) slopes: Vec<[f64; 2]>,
    /// 1 or −1: the sign with which the edges give the outward normal.
    pub(super) sign: f64,
}

/// A facet at trial unknowns, as a contact point sees it.
#[derive(Debug, Clone)]
pub(super) struct Facing<const D: usize> {
    /// e_m, [length].
    edges: [[f64; D]; 2],
    /// G⁻¹, [1/length²].
    inverse: [[f64; 2]; 2],
    pub(super) normal: [f64; D],
    /// g, [length].
    pub(super) gap: f64,
    /// c_v for each node of the contact point, in their order, [-].
    pub(super) values: Vec<f64>,
}

/// Number of edges of a facet.
const fn edges<const D: usize>() -> usize {
    D - 1
}

/// The unit normal of edges, and the inverse of their products; `None` if they are degenerate.
fn plane<const D: usize>(edges: &[[f64; D]; 2], sign: f64) -> Option<([f64; D], [[f64; 2]; 2])> {
    let [a, b] = edges;
    if D == 2 {
        let square = dot(a, a);
        let length = square.sqrt();
        let mut normal = [0.0; D];
        (normal[0], normal[1]) = (sign * a[1] / length, -sign * a[0] / length);
        return (square > 0.0).then_some((normal, [[1.0 / square, 0.0], [0.0; 2]]));
    }
    let across = cross(&in_space(a), &in_space(b));
    let area = norm(&across);
    let g = [[dot(a, a), dot(a, b)], [dot(a, b), dot(b, b)]];
    let determinant = g[0][0] * g[1][1] - g[0][1] * g[1][0];
    let inverse =
        [[g[1][1] / determinant, -g[0][1] / determinant], [-g[1][0] / determinant, g[0][0] / determinant]];
    let normal = std::array::from_fn(|d| sign * across[d] / area);
    (area > 0.0 && determinant > 0.0).then_some((normal, inverse))
}

impl<const D: usize> Facet<D> {
    /// A facet with these edges, whose outward normal is near `normal`.
    pub(super) fn new(edges: [[f64; D]; 2], slopes: Vec<[f64; 2]>, normal: &[f64; D]) -> Option<Self> {
        let (found, _) = plane(&edges, 1.0)?;
        Some(Facet { edges, slopes, sign: if dot(&found, normal) < 0.0 { -1.0 } else { 1.0 } })
    }

    /// The outward unit normal at the start of the step.
    pub(super) fn normal(&self) -> Option<[f64; D]> {
        plane(&self.edges, self.sign).map(|(normal, _)| normal)
    }

    /// The facet after a motion of the nodes, as a contact point sees it that has moved by `slip` relative to it,
    /// [length]; `None` if it has degenerated.
    pub(super) fn facing<const N: usize>(
        &self,
        basis: &Carriers,
        near: &Closest<D>,
        delta_d: &[[f64; N]],
        slip: &[f64; D],
    ) -> Option<Facing<D>> {
        let mut now = self.edges;
        for ((node, _), slopes) in basis.iter().zip(&self.slopes) {
            for (edge, slope) in now.iter_mut().zip(slopes).filter(|(_, slope)| **slope != 0.0) {
                (0..D).for_each(|d| edge[d] += slope * delta_d[node][d]);
            }
        }
        let (normal, inverse) = plane(&now, self.sign)?;
        let distance = along(slip, near.gap, &near.normal);
        let slid = product(&inverse, &now.each_ref().map(|edge| dot(edge, &distance)));
        let values = basis.iter().zip(&self.slopes);
        let values = values
            .map(|((_, value), slopes)| value - slopes.iter().zip(&slid).map(|(a, b)| a * b).sum::<f64>());
        let values = values.collect();
        Some(Facing { edges: now, inverse, normal, gap: dot(&normal, &distance), values })
    }
}

/// The product of a matrix and a vector.
fn product(matrix: &[[f64; 2]; 2], vector: &[f64; 2]) -> [f64; 2] {
    matrix.map(|row| row[0] * vector[0] + row[1] * vector[1])
}

/// What a unit displacement of a node changes at a contact point.
struct NodeMotion<const D: usize> {
    /// The change of the force on the contact point, [force/length].
    force: [f64; D],
    /// The change of δη, [1/length].
    sliding: [f64; 2],
}

impl<const D: usize> Facing<D> {
    /// The changes for a displacement of node number `k` of a contact point along an axis.
    fn motion(
        &self,
        basis: &Carriers,
        facet: &Facet<D>,
        touch: &Touch<D>,
        k: usize,
        axis: usize,
    ) -> NodeMotion<D> {
        let Facing { edges, inverse, normal, gap, values } = self;
        let at_start = basis.iter().nth(k).map_or(0.0, |(_, value)| value);
        let e: [f64; D] = unit(axis);
        let (relative, slipping) = (e.map(|e| values[k] * e), e.map(|e| at_start * e));
        // δEᵀ n
        let turning = facet.slopes[k].map(|slope| slope * normal[axis]);
        let tilt = product(inverse, &turning);
        let mut d_normal = [0.0; D];
        for m in 0..self::edges::<D>() {
            d_normal = along(&d_normal, -tilt[m], &edges[m]);
        }
        let rate = cross(&in_space(normal), &in_space(&d_normal));
        let moved: [f64; 2] = std::array::from_fn(|m| {
            if m < self::edges::<D>() { dot(&edges[m], &relative) + turning[m] * gap } else { 0.0 }
        });
        NodeMotion { force: touch.change(&relative, &slipping, &rate), sliding: product(inverse, &moved) }
    }

    /// Adds the stiffness of a contact point that touches the facet: −∂(c_v f)/∂Δd_w.
    pub(super) fn add_stiffness<const N: usize>(
        &self,
        basis: &Carriers,
        facet: &Facet<D>,
        touch: &Touch<D>,
        places: &[Option<usize>],
        sum: &mut System<N>,
    ) {
        let (n, force) = (self.values.len(), touch.force());
        let motions: Vec<[NodeMotion<D>; D]> =
            (0..n).map(|k| std::array::from_fn(|axis| self.motion(basis, facet, touch, k, axis))).collect();
        for row in 0..n {
            for (column, by_axis) in motions.iter().enumerate() {
                let Some(place) = places[row * n + column] else { continue };
                let block: [[f64; D]; D] = std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        let NodeMotion { force: changed, sliding } = &by_axis[j];
                        let share: f64 = facet.slopes[row].iter().zip(sliding).map(|(a, b)| a * b).sum();
                        share * force[i] - self.values[row] * changed[i]
                    })
                });
                sum.add_displacement_block(place, &block);
            }
        }
    }
}

/// A vector turned as the shortest rotation turns one unit normal into another.
pub(super) fn turned<const D: usize>(from: &[f64; D], to: &[f64; D], vector: &[f64; D]) -> [f64; D] {
    let cosine = dot(from, to);
    if from == to || cosine <= -1.0 {
        return *vector;
    }
    let both = along(from, 1.0, to);
    let turned = along(vector, -dot(&both, vector) / (1.0 + cosine), &both);
    along(&turned, 2.0 * dot(from, vector), to)
}
