//! The converged and trial state of a surface, and its motion with the grid.

use serde_json::{Value, json};

use super::Surface;
use super::support::{Support, support};
use super::unit;
use crate::basis::Connectivity;
use crate::grid::Grid;
use crate::region::area_vector;

/// A surface that the grid carries.
#[derive(Debug, Clone, Default)]
pub struct Carried<const D: usize> {
    /// Positions of the corners at the end of the last step in equilibrium, [length].
    pub converged: Vec<[f64; D]>,
    /// Positions of the corners at the displacement increment of the last evaluation, [length].
    pub trial: Vec<[f64; D]>,
    /// Corners of the facet of each sample.
    facets: Vec<[u32; D]>,
    /// Basis at each corner in the present step.
    at_corners: Vec<Support<D>>,
}

impl<const D: usize> Carried<D> {
    /// A surface at the start.
    pub fn new(surface: &Surface<D>) -> Self {
        Carried {
            converged: surface.corners.clone(),
            trial: surface.corners.clone(),
            facets: surface.facets.clone(),
            at_corners: Vec::new(),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.facets.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }

    /// Finds the cells of a step that starts from the converged state, to which `links` belong.
    ///
    /// # Errors
    /// The first corner near which no cell has active nodes only, [length].
    pub fn locate(&mut self, grid: &dyn Grid<D>, links: &Connectivity<D>) -> Result<(), [f64; D]> {
        self.trial.clone_from(&self.converged);
        // The mean normal of the facets around each corner.
        let mut normals = vec![[0.0; D]; self.converged.len()];
        for facet in &self.facets {
            let area = area_vector(&facet.map(|corner| self.converged[corner as usize]));
            for &corner in facet {
                (0..D).for_each(|d| normals[corner as usize][d] += area[d]);
            }
        }
        let place = |(x, normal)| support(grid, links, x, &unit(normal)).ok_or(*x);
        self.at_corners = self.converged.iter().zip(&normals).map(place).collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Carries nothing in this step.
    pub fn clear(&mut self) {
        self.trial.clone_from(&self.converged);
        self.at_corners.clear();
    }

    /// The trial positions of the corners of a facet, [length].
    pub fn facet(&self, sample: usize) -> [[f64; D]; D] {
        self.facets[sample].map(|corner| self.trial[corner as usize])
    }

    /// The bases at the corners of a facet.
    pub fn supports(&self, sample: usize) -> [&Support<D>; D] {
        self.facets[sample].map(|corner| &self.at_corners[corner as usize])
    }

    /// Calls `visit` with each node of a sample and its N_v there, the mean over the corners of its facet; a node may
    /// occur at several corners.
    pub fn for_each_value(&self, sample: usize, mut visit: impl FnMut(usize, f64)) {
        for support in self.supports(sample) {
            for (&node, value) in support.nodes().iter().zip(support.value()) {
                visit(node as usize, value / D as f64);
            }
        }
    }

    /// Adds N_v f of a force on a sample to the forces on the nodes, [force].
    pub fn spread<const N: usize>(&self, sample: usize, force: &[f64; D], nodal: &mut [[f64; N]]) {
        self.for_each_value(sample, |node, value| {
            (0..D).for_each(|d| nodal[node][d] += value * force[d]);
        });
    }

    /// Calls `visit` with the nodes, ascending, of each sample.
    pub fn each_neighbourhood(&self, visit: &mut dyn FnMut(&[u32])) {
        let mut nodes = Vec::new();
        for sample in 0..self.len() {
            nodes.clear();
            self.supports(sample).iter().for_each(|support| nodes.extend_from_slice(support.nodes()));
            nodes.sort_unstable();
            nodes.dedup();
            visit(&nodes);
        }
    }

    /// Moves the trial positions with the grid: x = x_n + Σ N_v Δd_v, where only the first `D` components of the
    /// increments are displacements, [length].
    pub fn follow<const N: usize>(&mut self, delta_d: &[[f64; N]]) {
        self.trial.clone_from(&self.converged);
        for (x, support) in self.trial.iter_mut().zip(&self.at_corners) {
            for (&node, value) in support.nodes().iter().zip(support.value()) {
                (0..D).for_each(|d| x[d] += value * delta_d[node as usize][d]);
            }
        }
    }

    /// The trial state becomes the converged state.
    pub fn commit(&mut self) {
        self.converged.clone_from(&self.trial);
    }

    /// The converged state, for a checkpoint.
    pub fn save(&self) -> Value {
        json!(self.converged.as_flattened())
    }

    /// Restores the state that [`Carried::save`] returned.
    ///
    /// # Errors
    /// The reason why it is not a state of this surface.
    pub fn restore(&mut self, saved: &Value) -> Result<(), String> {
        let numbers: Vec<f64> = serde_json::from_value(saved.clone()).map_err(|error| error.to_string())?;
        let (corners, rest) = numbers.as_chunks::<D>();
        if corners.len() != self.converged.len() || !rest.is_empty() || numbers.iter().any(|x| !x.is_finite())
        {
            return Err("its corners are not those of the surface".to_owned());
        }
        self.converged = corners.to_vec();
        self.trial.clone_from(&self.converged);
        Ok(())
    }
}
