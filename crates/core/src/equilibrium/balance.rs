//! What must balance in every step: work against energy that is stored or goes into plastic flow, and the moments of the
//! forces on the bodies.

use crate::basis::Connectivity;
use crate::dofs::{DofMap, nodes_of};
use crate::model::{BoundaryCondition, Model};
use crate::points::Points;

use crate::step::Nodal;
use crate::terms::Ledger;

/// Work of a step, and energy at its end.
///
/// The work is that of the trapezoidal rule, whose error over a given motion falls with the square of the step. Each step
/// starts on an undeformed grid, whose basis functions are not those that the equilibrium of the step before was found
/// with: the forces that are out of balance for that reason do work, too. It vanishes with the size of the steps where
/// basis functions are smooth; with standard points, whose stress jumps at the borders of cells, it does not.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energy {
    /// Work of loads and reactions over the step, [energy].
    pub external_work: f64,
    /// Work over the step of the forces that are out of balance at its start, [energy].
    pub regridding_work: f64,
    /// Work that the stabilisation of faces has taken over the step, [energy].
    pub stabilisation_work: f64,
    /// Work that damped iterations have taken between grids, [energy].
    pub damping_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// Work that has gone into plastic flow since the start of the analysis, [energy].
    pub plastic_work: f64,
}

impl Energy {
    /// The energy of a part of a slump: what is out of balance at its start is so since the part before, not by the fresh grid.
    pub fn of_slump(self) -> Energy {
        Energy { damping_work: self.damping_work - self.regridding_work, regridding_work: 0.0, ..self }
    }

    /// The energy of a step that goes on from where another part of it has ended.
    pub fn after(self, before: Energy) -> Energy {
        Energy {
            external_work: before.external_work + self.external_work,
            regridding_work: before.regridding_work + self.regridding_work,
            stabilisation_work: before.stabilisation_work + self.stabilisation_work,
            damping_work: before.damping_work + self.damping_work,
            ..self
        }
    }

    /// The energy of a step that is in equilibrium but not committed, from its displacement increment, the external forces
    /// (loads, reactions) at its start and end, the internal force at the start, and what the terms know.
    pub fn new<const D: usize, const N: usize>(
        delta_d: &[[f64; D]],
        [start, end]: [(&Nodal<N>, &Nodal<N>); 2],
        f_int_start: &[[f64; N]],
        ledger: Ledger,
    ) -> Energy {
        let Ledger { stored, plastic, lost } = ledger;
        let mut energy = Energy {
            stabilisation_work: lost,
            strain_energy: stored,
            plastic_work: plastic,
            ..Energy::default()
        };
        for (node, du) in delta_d.iter().enumerate() {
            for d in 0..D {
                let [before, after] = [start, end].map(|(load, reaction)| load[node][d] + reaction[node][d]);
                energy.external_work += 0.5 * (before + after) * du[d];
                energy.regridding_work += 0.5 * (f_int_start[node][d] - before) * du[d];
            }
        }
        energy
    }
}

/// The moment of the reaction of a boundary condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReactionMoment<const D: usize> {
    /// The point it is taken about: the mean position, at the end of the step, of the active nodes that the condition acts
    /// on, [length]; none where it acts on no active node.
    pub about: Option<[f64; D]>,
    /// Moment on the body about the axes x, y and z, positive by the right-hand rule, [force·length]; in the plane only the
    /// last is not 0, positive where it turns x towards y.
    pub moment: [f64; 3],
}

impl<const D: usize> ReactionMoment<D> {
    /// Names of the axes that a moment can have in `D` dimensions.
    pub const AXES: &'static [&'static str] = if D == 3 { &["x", "y", "z"] } else { &["z"] };

    /// The components about those axes, [force·length].
    pub fn components(&self) -> &[f64] {
        &self.moment[3 - Self::AXES.len()..]
    }
}

/// The moments of the reactions on the nodes of each boundary condition, in the configuration that the step has reached as
/// [`moment_error`]. Conditions that prescribe the same motion of a degree of freedom share its reaction equally. None for
/// bodies of revolution, whose forces are sums over the circle.
pub fn reaction_moments<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
    (reaction, dofs): (&Nodal<N>, &DofMap<N>),
) -> Option<Vec<ReactionMoment<D>>> {
    if model.revolved {
        return None;
    }
    let places = deformed_nodes(model, links, delta_d);
    let of_condition = |(number, condition): (usize, &BoundaryCondition<D>)| {
        let nodes = nodes_of(condition, points, links);
        if nodes.is_empty() {
            return ReactionMoment { about: None, moment: [0.0; 3] };
        }
        let about: [f64; D] =
            std::array::from_fn(|d| nodes.iter().map(|n| places[*n][d]).sum::<f64>() / nodes.len() as f64);
        let mut moment = [0.0; 3];
        for node in nodes {
            let (mut arm, mut force) = ([0.0; 3], [0.0; 3]);
            for d in 0..D {
                arm[d] = places[node][d] - about[d];
            }
            dofs.for_each_share(model, node, &reaction[node], |condition, axis, share| {
                if condition == number {
                    force[axis] = share;
                }
            });
            for (axis, m) in moment.iter_mut().enumerate() {
                let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
                *m += arm[i] * force[j] - arm[j] * force[i];
            }
        }
        ReactionMoment { about: Some(about), moment }
    };
    Some(model.boundary_conditions.iter().enumerate().map(of_condition).collect())
}

/// Where the active nodes are at the end of a step, which they begin undeformed, [length].
fn deformed_nodes<const D: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
) -> Nodal<D> {
    (links.active_nodes().iter().zip(delta_d))
        .map(|(&node, du)| {
            let place = model.grid.node_position(node as usize);
            std::array::from_fn(|d| place[d] + du[d])
        })
        .collect()
}

/// Magnitude of the moment of loads and reactions together about the middle of the nodes they act on, in the configuration
/// that the step has reached, relative to the sum of the magnitudes of all moments, [-]. None for bodies of revolution, in
/// which hoop stresses keep the balance; 0 where there are no forces.
pub fn moment_error<const D: usize, const N: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
    (load, reaction): (&Nodal<N>, &Nodal<N>),
) -> Option<f64> {
    if model.revolved {
        return None;
    }
    let places = deformed_nodes(model, links, delta_d);
    let middle: [f64; D] =
        std::array::from_fn(|d| places.iter().map(|x| x[d]).sum::<f64>() / places.len() as f64);
    let (mut moments, mut scale) = ([[0.0; D]; D], 0.0);
    for (node, place) in places.iter().enumerate() {
        let arm: [f64; D] = std::array::from_fn(|d| place[d] - middle[d]);
        let length = |v: &[f64]| v[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
        for force in [&load[node], &reaction[node]] {
            for i in 0..D {
                for j in i + 1..D {
                    moments[i][j] += arm[i] * force[j] - arm[j] * force[i];
                }
            }
            scale += length(&arm) * length(force);
        }
    }
    let moment = moments.as_flattened().iter().map(|m| m * m).sum::<f64>().sqrt();
    Some(if scale > 0.0 { moment / scale } else { 0.0 })
}
