//! The distribution of contact forces among contact points that the nodes cannot tell apart.
//!
//! More contact points may touch a tool than the nodes that carry them have degrees of freedom for. The equilibrium
//! then determines the forces at the nodes, f_v = Σ N_v(x_c) λ_c, but not those of the contact points: neighbours may
//! push and pull each other, more in each step. Among all forces with the same f_v, those of a traction that is
//! interpolated from the nodes,
//!
//! λ_c = A_c Σ N_v(x_c) μ_v  with  Σ_c N_v A_c Σ_w N_w μ_w = f_v,
//!
//! have the smallest Σ |λ_c|²/A_c. At the end of a step, the forces change towards them as far as the law of the
//! interface allows; where a contact point is at its limit, it stays there, and the others go on. Forces and moments on
//! bodies and tools stay the same. The equations are solved by conjugate gradients; they are singular where contact
//! points are few, but always consistent.

use crate::ranks::Reduction;
use crate::region::vector::{along, dot, minus, norm};

use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::{Mode, Touch};
use super::multipliers::NodeNumbers;
use super::ranks::{NodalSum, add_at_nodes};

/// Smallest area relative to that which the penalty assumes, [-], for a contact point whose sides others bear.
const LEAST_AREA: f64 = 0.05;
/// Largest number of times that contact points keep their forces from then on because the law allows no more.
const ROUNDS: usize = 20;
/// Number of bisections that find how far a force may change.
const HALVINGS: usize = 30;
/// Residual relative to the forces at the nodes, [-], at which the iterations end, and up to which the result is
/// accepted; and the largest number of iterations.
const RESIDUAL: f64 = 1e-14;
const ACCEPTED: f64 = 1e-12;
const ITERATIONS: usize = 500;
/// Number of directions between 0 and 1 in each component of a normal; and an offset that keeps common directions off
/// the limits between them.
const DIRECTIONS: f64 = 3.0;
const NO_HALF: f64 = 0.1;
/// Change of the forces relative to their size, [-], up to which they stay as they are.
const SAME: f64 = 1e-9;

/// A contact point that touches a tool, with its force on the body, [force].
#[derive(Clone, Copy)]
pub(super) struct Bearing<'a, const D: usize> {
    pub(super) candidate: &'a Candidate<D>,
    pub(super) trial: &'a Trial<D>,
    pub(super) touch: &'a Touch<D>,
}

impl<const D: usize> Bearing<'_, D> {
    /// The number of the tool and of the direction of the surface: forces are distributed only among contact points
    /// that touch surfaces of about the same direction.
    fn group(&self) -> u32 {
        let direction = |n: &f64| (DIRECTIONS * n + NO_HALF).round() as i32 + 4;
        let number = self.touch.normal().iter().fold(0, |number, n| 9 * number + direction(n) as u32);
        self.candidate.key.tool.wrapping_mul(9u32.pow(D as u32)).wrapping_add(number)
    }
}

/// The forces on the body, [force], in the order of the contact points. All ranks must call this together.
pub(super) fn distributed<const D: usize>(places: &[Bearing<D>], reduction: &Reduction) -> Vec<[f64; D]> {
    let original: Vec<[f64; D]> = places.iter().map(|place| place.touch.force()).collect();
    let mut free = Free::new(places, original.clone(), reduction);
    free.move_towards_even();
    let found = free.forces;
    let change = |(a, b): (&[f64; D], &[f64; D])| norm(&minus(a, b));
    let most = reduction.largest(original.iter().zip(&found).map(change).fold(0.0, f64::max));
    let size = reduction.largest(original.iter().map(norm).fold(0.0, f64::max));
    if most > SAME * size { found } else { original }
}

/// The contact points whose forces may change.
struct Free<'a, const D: usize> {
    places: &'a [Bearing<'a, D>],
    /// The present forces, [force].
    forces: Vec<[f64; D]>,
    reduction: &'a Reduction,
    nodes: NodeNumbers,
    /// For each number in `nodes`, the inverse of the number of ranks that have it.
    shares: Vec<f64>,
    /// A group and a node for each number in `nodes`.
    pairs: Vec<(u32, usize)>,
    /// A_c, [length²].
    areas: Vec<f64>,
    is_free: Vec<bool>,
}

/// A vector for each pair of a group and a node.
type AtNodes<const D: usize> = Vec<[f64; D]>;

impl<'a, const D: usize> Free<'a, D> {
    fn new(places: &'a [Bearing<D>], forces: Vec<[f64; D]>, reduction: &'a Reduction) -> Self {
        let nodes = NodeNumbers::new(places.iter().map(|place| (place.group(), place.candidate)));
        let area = |place: &Bearing<D>| {
            let Candidate { area, bearing, .. } = place.candidate;
            area.max(LEAST_AREA * bearing)
        };
        let mut free = Free {
            shares: Vec::new(),
            pairs: nodes.pairs(),
            nodes,
            areas: places.iter().map(area).collect(),
            // Surfaces that part keep their tension.
            is_free: places.iter().map(|place| place.touch.mode != Mode::Parting).collect(),
            places,
            forces,
            reduction,
        };
        free.shares = free.shares_of_pairs();
        free
    }

    /// Moves the forces towards the even ones; a contact point that has come to its limit stays there, and the others go
    /// on.
    fn move_towards_even(&mut self) {
        for _ in 0..ROUNDS {
            let Some(even) = self.evenly() else { break };
            let own: Vec<f64> = (0..self.places.len()).map(|k| self.share_allowed(k, &even[k])).collect();
            let share = self.reduction.smallest(own.iter().copied().fold(1.0, f64::min));
            for (k, even) in even.iter().enumerate() {
                let way = minus(even, &self.forces[k]);
                self.forces[k] = along(&self.forces[k], share, &way);
                self.is_free[k] &= own[k] > share;
            }
            if share == 1.0 || !self.reduction.any(self.is_free.contains(&true)) {
                break;
            }
        }
    }

    /// The share of the way from the present force of a contact point to another one, at most 1, which the law allows.
    fn share_allowed(&self, k: usize, force: &[f64; D]) -> f64 {
        let way = minus(force, &self.forces[k]);
        let is_allowed = |share: f64| self.places[k].touch.allows(&along(&self.forces[k], share, &way));
        if !self.is_free[k] || is_allowed(1.0) {
            return 1.0;
        }
        // The forces that the law allows form a convex set.
        let [mut low, mut high] = [0.0, 1.0];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if is_allowed(middle) { &mut low } else { &mut high }) = middle;
        }
        low
    }

    /// The numbers of the nodes of a contact point, with its N_v.
    fn carriers(&self, k: usize) -> impl Iterator<Item = (usize, f64)> {
        let Bearing { candidate, trial, .. } = self.places[k];
        let values = trial.carriers(candidate).map(|(_, value)| value);
        self.nodes.numbers_at(k).iter().copied().zip(values)
    }

    /// Σ N_v f_c and Σ N_v² A_c over the free contact points of all ranks.
    fn gathered(&self, force: impl Fn(usize) -> [f64; D]) -> Vec<NodalSum<D>> {
        let mut sums = vec![NodalSum::NONE; self.pairs.len()];
        for k in (0..self.places.len()).filter(|k| self.is_free[*k]) {
            let force = force(k);
            for (node, value) in self.carriers(k) {
                let sum = &mut sums[node];
                sum.vector = along(&sum.vector, value, &force);
                sum.weight += self.areas[k] * value * value;
            }
        }
        self.add_others(&mut sums);
        sums
    }

    /// Adds the contributions of the contact points of other ranks.
    fn add_others(&self, sums: &mut [NodalSum<D>]) {
        let number = |group, node| self.nodes.number_of(group, node);
        add_at_nodes(self.reduction, sums, &self.pairs, number);
    }

    /// Σ N_v f_c over the free contact points of all ranks.
    fn forces_at_nodes(&self, force: impl Fn(usize) -> [f64; D]) -> AtNodes<D> {
        self.gathered(force).into_iter().map(|sum| sum.vector).collect()
    }

    /// A_c Σ N_v μ_v.
    fn interpolated(&self, mu: &AtNodes<D>, k: usize) -> [f64; D] {
        let traction = self.carriers(k).fold([0.0; D], |sum, (node, value)| along(&sum, value, &mu[node]));
        traction.map(|t| self.areas[k] * t)
    }

    /// a · b over all ranks.
    fn product(&self, a: &AtNodes<D>, b: &AtNodes<D>) -> f64 {
        let each = a.iter().zip(b).zip(&self.shares).map(|((a, b), share)| share * dot(a, b));
        self.reduction.total(each.sum())
    }

    /// The share of each pair that counts on this rank: the owner of a node need not have contact points there.
    fn shares_of_pairs(&self) -> Vec<f64> {
        let mut sums = vec![NodalSum { weight: 1.0, ..NodalSum::NONE }; self.pairs.len()];
        self.add_others(&mut sums);
        sums.into_iter().map(|sum| 1.0 / sum.weight).collect()
    }

    /// The forces of all contact points if the free ones bear an interpolated traction; `None` if the iterations do not
    /// converge.
    fn evenly(&self) -> Option<Vec<[f64; D]>> {
        let gathered = self.gathered(|k| self.forces[k]).into_iter();
        let (total, weights): (AtNodes<D>, Vec<f64>) = gathered.map(|sum| (sum.vector, sum.weight)).unzip();
        let scaled = |residual: &AtNodes<D>| -> AtNodes<D> {
            let each = residual.iter().zip(&weights);
            each.map(|(r, weight)| if *weight > 0.0 { r.map(|r| r / weight) } else { [0.0; D] }).collect()
        };
        let added = |to: &mut AtNodes<D>, share: f64, more: &AtNodes<D>| {
            to.iter_mut().zip(more).for_each(|(to, more)| *to = along(to, share, more));
        };
        let (mut residual, mut mu) = (total.clone(), vec![[0.0; D]; self.pairs.len()]);
        let mut direction = scaled(&residual);
        let mut size = self.product(&residual, &direction);
        let accepted = RESIDUAL * RESIDUAL * size;
        for _ in 0..ITERATIONS {
            if size <= accepted {
                break;
            }
            let image = self.forces_at_nodes(|k| self.interpolated(&direction, k));
            let step = size / self.product(&direction, &image);
            if !step.is_finite() {
                break;
            }
            added(&mut mu, step, &direction);
            added(&mut residual, -step, &image);
            let mut next = scaled(&residual);
            let before = std::mem::replace(&mut size, self.product(&residual, &next));
            added(&mut next, size / before, &direction);
            direction = next;
        }
        let mut missing = self.forces_at_nodes(|k| self.interpolated(&mu, k));
        added(&mut missing, -1.0, &total);
        let is_exact = self.product(&missing, &missing) <= ACCEPTED * ACCEPTED * self.product(&total, &total);
        let force = |k: usize| if self.is_free[k] { self.interpolated(&mu, k) } else { self.forces[k] };
        is_exact.then(|| (0..self.places.len()).map(force).collect())
    }
}
