//! An unknown load factor, and the condition that determines it: a prescribed displacement, or the length of the path
//! (Riks 1979, doi 10.1016/0020-7683(79)90081-7; Crisfield 1981, doi 10.1016/0045-7949(81)90108-5).
//!
//! All loads grow together, f_ext = λ f̂. An iteration solves K δd_r = r and K δd_f = f̂ with one factorisation, and
//! δd = δd_r + δλ δd_f with δλ such that the condition is met by the sum.

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;
use crate::constraints::DofMap;
use crate::model::Model;
use crate::points::Points;
use crate::stepping::Control;

use super::Step;
use super::newton::for_each_dof;

/// Where a run with an unknown load factor is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Load factor at the end of the last step in equilibrium, [-].
    pub factor: f64,
    /// Length of the path per time, [length·volume^½/time]; known from the first step on.
    pub rate: Option<f64>,
    /// Grid nodes of that step, ascending.
    nodes: Vec<u32>,
    /// Its displacement increment, one number per axis and node, [length].
    direction: Vec<f64>,
}

impl Path {
    /// Whether a run in so many dimensions can have come to this.
    pub(super) fn can_be_of<const D: usize>(&self) -> bool {
        self.direction.len() == D * self.nodes.len() && self.nodes.is_sorted()
    }
}

/// The condition of one step.
pub(super) enum Condition<const D: usize> {
    /// Σ c·Δd over the nodes is the increment `by`.
    Displacement { weight: Vec<[f64; D]>, by: f64 },
    /// (Δd, Δd) is the square of `length`, in the product weighted by the volume that each node carries.
    ArcLength { volume: Vec<f64>, length: Option<f64>, ahead: Vec<[f64; D]>, share: f64 },
}

/// The condition cannot be met: the load has no influence, or the path turns back within the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NoIntersection;

impl<const D: usize> Condition<D> {
    /// The condition of a step; none where the loads are prescribed.
    pub(super) fn new(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        step: Step,
        path: &Path,
    ) -> Option<Self> {
        let share = (step.end - step.start) / model.stepping.end_time;
        match model.stepping.control {
            Control::Load => None,
            Control::Displacement { probe, axis, to } => {
                let axis = axis.min(D - 1); // decks with another one are refused
                let mut weight = vec![[0.0; D]; links.n_active()];
                let chosen = model.probes.get(probe).map_or(&[][..], |probe| &probe.points);
                let mut is_chosen = vec![false; points.len()];
                chosen.iter().for_each(|id| is_chosen[*id as usize] = true);
                for group in 0..links.n_groups() {
                    let nodes = links.nodes_of(group);
                    for p in links.points_of(group).filter(|&p| is_chosen[points.id[p] as usize]) {
                        links.for_each_value(p, |local, value| {
                            weight[nodes[local] as usize][axis] += value / chosen.len() as f64;
                        });
                    }
                }
                Some(Condition::Displacement { weight, by: to * share })
            }
            Control::ArcLength => {
                let mut volume = vec![0.0; links.n_active()];
                for group in 0..links.n_groups() {
                    let nodes = links.nodes_of(group);
                    for p in links.points_of(group) {
                        let volume_n = model.volume(points, p);
                        links.for_each_value(p, |local, value| {
                            volume[nodes[local] as usize] += value * volume_n;
                        });
                    }
                }
                let length = path.rate.map(|rate| rate * (step.end - step.start));
                Some(Condition::ArcLength { volume, length, ahead: path.direction(links), share })
            }
        }
    }

    /// The change δλ of the load factor for which Δd + δd_r + δλ δd_f meets the condition.
    ///
    /// # Errors
    /// [`NoIntersection`].
    pub(super) fn change(
        &mut self,
        delta_d: &[[f64; D]],
        of_residual: &[[f64; D]],
        of_load: &[[f64; D]],
    ) -> Result<f64, NoIntersection> {
        let finite = |x: f64| if x.is_finite() { Ok(x) } else { Err(NoIntersection) };
        match self {
            Condition::Displacement { weight, by } => {
                let along = |field: &[[f64; D]]| -> f64 {
                    weight.iter().zip(field).flat_map(|(w, u)| (0..D).map(|d| w[d] * u[d])).sum()
                };
                finite((*by - along(delta_d) - along(of_residual)) / along(of_load))
            }
            Condition::ArcLength { volume, length, ahead, share } => {
                let product = |a: &[[f64; D]], b: &[[f64; D]]| -> f64 {
                    (0..a.len()).map(|n| volume[n] * (0..D).map(|d| a[n][d] * b[n][d]).sum::<f64>()).sum()
                };
                let base: Vec<[f64; D]> = delta_d
                    .iter()
                    .zip(of_residual)
                    .map(|(u, r)| std::array::from_fn(|d| u[d] + r[d]))
                    .collect();
                let (a, b, c) = (product(of_load, of_load), product(&base, of_load), product(&base, &base));
                let Some(length) = *length else {
                    // The first step of all takes its share of the load, by the linear response.
                    let change = *share;
                    *length = Some((c + 2.0 * change * b + change * change * a).sqrt());
                    return finite(change);
                };
                // a δλ² + 2 b δλ + c = length²; of the two roots the one that leads on.
                let root = (b * b - a * (c - length * length)).sqrt();
                let far = -(b + root.copysign(b));
                let roots = [far / a, (c - length * length) / far];
                let so_far = if delta_d.iter().flatten().any(|u| *u != 0.0) { delta_d } else { &ahead[..] };
                let onwards = |change: f64| product(so_far, &base) + change * product(so_far, of_load);
                let [first, second] = roots.map(onwards);
                finite(if first >= second { roots[0] } else { roots[1] })
            }
        }
    }

    /// The path after a step that has reached a load factor.
    pub(super) fn advance(
        &self,
        links: &Connectivity<D>,
        step: Step,
        delta_d: &[[f64; D]],
        factor: f64,
    ) -> Path {
        match self {
            Condition::Displacement { .. } => Path { factor, ..Path::default() },
            Condition::ArcLength { length, .. } => Path {
                factor,
                rate: length.map(|length| length / (step.end - step.start)),
                nodes: links.active_nodes().to_vec(),
                direction: delta_d.as_flattened().to_vec(),
            },
        }
    }
}

impl Path {
    /// The displacement increment of the last step on the nodes of this one; zero where they were not active.
    fn direction<const D: usize>(&self, links: &Connectivity<D>) -> Vec<[f64; D]> {
        let (directions, _) = self.direction.as_chunks::<D>();
        let at = |node: &u32| {
            let place = self.nodes.binary_search(node).ok();
            place.and_then(|place| directions.get(place)).copied().unwrap_or([0.0; D])
        };
        links.active_nodes().iter().map(at).collect()
    }
}

/// A force on the free degrees of freedom only.
pub(super) fn on_free<const D: usize>(dofs: &DofMap<D>, force: &[[f64; D]], out: &mut [[f64; D]]) {
    for_each_dof(dofs, |node, axis, free| {
        out[node][axis] = if free.is_some() { force[node][axis] } else { 0.0 };
    });
}
