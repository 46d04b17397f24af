//! The material that grid nodes carry, and the filling of cells.

use crate::basis::{BodyGroup, Connectivity};
use crate::grid::Grid;
use crate::material::Modulus;
use crate::model::{Model, ModuliAtRest};
use crate::points::Points;

/// The material that each active node carries at the start of a step.
pub struct HeldMaterial {
    /// Σ S_vp V_p, [volume].
    volume: Vec<f64>,
    /// Σ S_vp m_p, [mass].
    mass: Vec<f64>,
    /// Σ S_vp V_p of the points with shear stiffness, [volume].
    stiff: Vec<f64>,
    /// Σ S_vp V_p / G_p of these points, [volume/stress].
    flexibility: Vec<f64>,
}

impl HeldMaterial {
    /// The material at the start of the step to which the links belong.
    pub fn new<const D: usize>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Self {
        let moduli = ModuliAtRest::new(model, Modulus::Shear);
        let zeros = || vec![0.0; links.n_active()];
        let mut held = HeldMaterial { volume: zeros(), mass: zeros(), stiff: zeros(), flexibility: zeros() };
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            for p in links.points_of(group) {
                let volume = model.volume(points, p);
                let modulus = moduli.at(points, p);
                links.for_each_value(p, |local, value| {
                    let node = nodes[local] as usize;
                    held.volume[node] += value * volume;
                    held.mass[node] += value * points.mass[p];
                    if modulus > 0.0 {
                        held.stiff[node] += value * volume;
                        held.flexibility[node] += value * volume / modulus;
                    }
                });
            }
        }
        for sum in [&mut held.volume, &mut held.mass, &mut held.stiff, &mut held.flexibility] {
            links.reduction().complete_numbers(sum);
        }
        held
    }

    /// The material of a group of bodies that the weakest node of a cell holds, relative to the node's share of the full
    /// cell, [-].
    pub fn filling<const D: usize>(
        &self,
        model: &Model<D>,
        links: &Connectivity<D>,
        bodies: BodyGroup,
        cell: u32,
    ) -> f64 {
        let grid = model.grid.as_ref();
        let corners = grid.corners(cell as usize);
        let n = corners.nodes().len() as f64;
        let held = |node: &u32| {
            let full = grid.volume(cell as usize) * model.depth(&middle(grid, corners.nodes())) / n;
            links.of_bodies(bodies, *node as usize).map_or(0.0, |active| self.volume[active] / full)
        };
        corners.nodes().iter().map(held).fold(f64::INFINITY, f64::min)
    }

    /// Mean density of the material that these nodes carry, [mass/volume]; zero if they carry none.
    pub fn density(&self, nodes: &[u32]) -> f64 {
        let sum = |values: &[f64]| nodes.iter().map(|n| values[*n as usize]).sum::<f64>();
        let volume = sum(&self.volume);
        if volume > 0.0 { sum(&self.mass) / volume } else { 0.0 }
    }

    /// Harmonic mean of the shear modulus of the material that these nodes carry, [stress]: where soft material lies
    /// beside stiff material, the soft one decides. Material without shear stiffness, such as a fluid, is left out. Zero
    /// if no material there has shear stiffness.
    pub fn shear_modulus(&self, nodes: &[u32]) -> f64 {
        let sum = |values: &[f64]| nodes.iter().map(|n| values[*n as usize]).sum::<f64>();
        let flexibility = sum(&self.flexibility);
        if flexibility > 0.0 { sum(&self.stiff) / flexibility } else { 0.0 }
    }
}

fn middle<const D: usize>(grid: &dyn Grid<D>, nodes: &[u32]) -> [f64; D] {
    let mut middle = [0.0; D];
    for &node in nodes {
        let place = grid.node_position(node as usize);
        for d in 0..D {
            middle[d] += place[d] / nodes.len() as f64;
        }
    }
    middle
}
