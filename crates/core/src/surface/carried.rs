//! The converged and trial state of a surface, and its motion with the grid.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::integral::{mean_over_side, pieces_of_side};
use super::support::{Support, active, carrying_cell};
use super::{Division, PlacedDivision, SideRule, Surface, unit};
use crate::basis::Connectivity;
use crate::grid::Grid;
use crate::points::{Halves, Points};
use crate::ranks::Reduction;
use crate::region::area_vector;

/// A surface carried by the grid.
#[derive(Debug, Clone)]
pub struct Carried<const D: usize> {
    /// The surface with the samples that it has now.
    surface: Surface<D>,
    /// The surface at the start, if sides have been divided since.
    start: Option<Box<Surface<D>>>,
    /// The divisions of sides so far.
    divisions: Vec<Division>,
    /// For each sample, the one at the start from which divisions have formed it, and its share in that sample, [-].
    origins: Vec<(u32, f64)>,
    /// Positions of the corners at the end of the last converged step, [length].
    pub converged: Vec<[f64; D]>,
    /// Positions of the corners at the displacement increment of the last evaluation, [length].
    pub trial: Vec<[f64; D]>,
    is_revolved: bool,
    /// Basis at each corner in the current step; empty for a corner if this rank lacks one of its nodes.
    at_corners: Vec<Support<D>>,
    /// With the rule of integrals, the nodes of each sample with their N_v.
    at_samples: Vec<Vec<(u32, f64)>>,
    /// With several ranks, the cell that carries each corner, and the rank that has found this cell.
    found: Vec<(u32, u32)>,
    /// With several ranks, the index of this rank.
    own: Option<u32>,
}

impl<const D: usize> Carried<D> {
    /// This surface at the start of the analysis, of a body of revolution if `revolved`.
    pub fn new(surface: &Surface<D>, revolved: bool) -> Self {
        Carried {
            surface: surface.clone(),
            start: None,
            divisions: Vec::new(),
            origins: (0..surface.len()).map(|sample| (sample as u32, 1.0)).collect(),
            converged: surface.corners.clone(),
            trial: surface.corners.clone(),
            is_revolved: revolved,
            at_corners: Vec::new(),
            at_samples: Vec::new(),
            found: Vec::new(),
            own: None,
        }
    }

    /// The surface with the samples that it has now; its corners are at their original positions.
    pub fn surface(&self) -> &Surface<D> {
        &self.surface
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.surface.len()
    }

    /// True if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.surface.is_empty()
    }

    /// Number of divisions of sides so far.
    pub fn n_divisions(&self) -> usize {
        self.divisions.len()
    }

    /// The sample at the start from which divisions have formed a sample, and the share of the latter in it, [-]: 1 for
    /// a sample that has not changed.
    pub fn origin(&self, sample: usize) -> (usize, f64) {
        let (origin, share) = self.origins[sample];
        (origin as usize, share)
    }

    fn body(&self) -> u16 {
        self.surface.body as u16
    }

    /// Finds the cells that carry the corners in the step from the converged state; `links` must belong to this state.
    ///
    /// # Errors
    /// The position of the first corner without a nearby cell whose nodes are all active, [length].
    pub fn locate(&mut self, grid: &dyn Grid<D>, links: &Connectivity<D>) -> Result<(), [f64; D]> {
        self.trial.clone_from(&self.converged);
        let cells: Vec<u32> = if self.own.is_some() {
            self.found.iter().map(|(cell, _)| *cell).collect()
        } else {
            let normals = self.normals();
            let place = |(x, normal)| carrying_cell(grid, links, self.body(), x, &unit(normal)).ok_or(*x);
            let found = self.converged.iter().zip(&normals).map(place);
            found.map(|found| found.map(|(_, cell)| cell)).collect::<Result<_, _>>()?
        };
        let at = |(x, cell): (&[f64; D], &u32)| {
            active(grid.basis_at(*cell, x), links, self.body()).unwrap_or_default()
        };
        self.at_corners = self.converged.iter().zip(&cells).map(at).collect();
        self.at_samples = match self.surface.rule {
            SideRule::Corners => Vec::new(),
            SideRule::Integral => self.means(grid, links, &cells),
        };
        Ok(())
    }

    /// The nodes of each sample with the mean of N_v over the side of a domain to which it belongs, in groups of
    /// samples that share a side.
    fn means(&self, grid: &dyn Grid<D>, links: &Connectivity<D>, cells: &[u32]) -> Vec<Vec<(u32, f64)>> {
        let mut means = Vec::with_capacity(self.len());
        while means.len() < self.len() {
            let mean = self.mean(grid, links, &self.corners_of_side(means.len()), cells);
            means.resize(means.len() + self.samples_of_side(), mean);
        }
        means
    }

    /// Number of samples on the side of a domain.
    fn samples_of_side(&self) -> usize {
        // In space, the triangles of a side with the corners 0 to 3 are 012, 023, 013 and 123.
        if self.surface.rule == SideRule::Integral && D == 3 { 4 } else { 1 }
    }

    /// The corners on which the N_v of a sample depends, in cyclic order: those of its facet or, for means over a side,
    /// those of the side.
    fn corners_of_side(&self, sample: usize) -> Vec<u32> {
        let samples = self.samples_of_side();
        let first = sample - sample % samples;
        let mut corners = self.surface.facets[first].to_vec();
        if samples > 1 {
            corners.push(self.surface.facets[first + 1][D - 1]);
        }
        corners
    }

    /// The nodes of a side with the mean of N_v over it; empty if this rank lacks a node.
    fn mean(
        &self,
        grid: &dyn Grid<D>,
        links: &Connectivity<D>,
        side: &[u32],
        cells: &[u32],
    ) -> Vec<(u32, f64)> {
        if side.iter().any(|&corner| self.at_corners[corner as usize].nodes().is_empty()) {
            return Vec::new();
        }
        let corners: Vec<[f64; D]> = side.iter().map(|&corner| self.converged[corner as usize]).collect();
        let cells: Vec<u32> = side.iter().map(|&corner| cells[corner as usize]).collect();
        let values = mean_over_side(grid, &corners, &cells, |basis| active(basis, links, self.body()));
        values.unwrap_or_default()
    }

    /// The sum of the area vectors of the facets around each corner.
    fn normals(&self) -> Vec<[f64; D]> {
        let mut normals = vec![[0.0; D]; self.converged.len()];
        for facet in &self.surface.facets {
            let area = area_vector(&facet.map(|corner| self.converged[corner as usize]));
            for &corner in facet {
                (0..D).for_each(|d| normals[corner as usize][d] += area[d]);
            }
        }
        normals
    }

    /// Finds the cells that carry the corners, together with all ranks; each rank then holds some of the samples.
    ///
    /// # Errors
    /// As [`Carried::locate`], the same on all ranks.
    pub fn find(&mut self, grid: &dyn Grid<D>, links: &Connectivity<D>) -> Result<(), [f64; D]> {
        let reduction = links.reduction();
        let place = |(x, normal)| carrying_cell(grid, links, self.body(), x, &unit(normal));
        let own: Vec<Option<(u32, u32)>> = self.converged.iter().zip(&self.normals()).map(place).collect();
        // The earliest cell that any rank has found, in the order of the search, is the one that a rank with all nodes
        // would find.
        let mut best: Vec<Option<(u32, u32, u32)>> = vec![None; own.len()];
        for (rank, found) in (0u32..).zip(reduction.gather_all(own)) {
            for (best, found) in best.iter_mut().zip(found) {
                let found = found.map(|(tried, cell)| (tried, cell, rank));
                *best = match (*best, found) {
                    (Some(best), Some(found)) if found.0 < best.0 => Some(found),
                    (None, found) => found,
                    (best, _) => best,
                };
            }
        }
        let known = |(best, x): (Option<(u32, u32, u32)>, &[f64; D])| {
            best.map(|(_, cell, rank)| (cell, rank)).ok_or(*x)
        };
        self.found = best.into_iter().zip(&self.converged).map(known).collect::<Result<_, _>>()?;
        self.own = Some(reduction.own() as u32);
        Ok(())
    }

    /// The grid nodes that carry a sample; none if there is only one rank.
    pub fn nodes_of(&self, grid: &dyn Grid<D>, sample: usize) -> Vec<u32> {
        let numbers = self.corners_of_side(sample);
        let found = numbers.iter().filter_map(|corner| self.found.get(*corner as usize));
        let mut cells: Vec<u32> = found.map(|(cell, _)| *cell).collect();
        if self.surface.rule == SideRule::Integral && cells.len() == numbers.len() {
            let corners: Vec<[f64; D]> =
                numbers.iter().map(|&corner| self.converged[corner as usize]).collect();
            let pieces = pieces_of_side(grid, &corners, &cells);
            cells.extend(pieces.into_iter().flatten().map(|piece| piece.cell));
        }
        cells.into_iter().flat_map(|cell| grid.corners(cell as usize).nodes().to_vec()).collect()
    }

    /// True if this rank is responsible for a sample.
    pub fn is_own(&self, sample: usize) -> bool {
        let first = self.surface.facets[sample][0] as usize;
        self.own.is_none_or(|own| self.found.get(first).is_some_and(|(_, rank)| *rank == own))
    }

    /// The samples that this rank treats.
    pub fn own_samples(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.len()).filter(|sample| self.is_own(*sample))
    }

    /// Sends the trial positions of the corners to all ranks.
    pub fn complete(&mut self, reduction: &Reduction) {
        let Some(own) = self.own else { return };
        let mut numbers = vec![0.0; D * self.trial.len()];
        for (k, (x, (_, rank))) in self.trial.iter().zip(&self.found).enumerate() {
            if *rank == own {
                numbers[k * D..][..D].copy_from_slice(x);
            }
        }
        reduction.sum(&mut numbers);
        for (x, numbers) in self.trial.iter_mut().zip(numbers.chunks_exact(D)) {
            x.copy_from_slice(numbers);
        }
    }

    /// Moves the corners to where a body is added; `moved` gives the position of a place, if it is known.
    pub fn place(&mut self, moved: &dyn Fn(&[f64; D]) -> Option<[f64; D]>) {
        for x in &mut self.converged {
            *x = moved(x).unwrap_or(*x);
        }
        self.trial.clone_from(&self.converged);
    }

    /// Marks the surface as not carried in this step.
    pub fn clear(&mut self) {
        self.trial.clone_from(&self.converged);
        self.at_corners.clear();
        self.at_samples.clear();
        (self.found, self.own) = (Vec::new(), None);
    }

    /// The trial positions of the corners of a facet, [length].
    pub fn facet(&self, sample: usize) -> [[f64; D]; D] {
        self.surface.facets[sample].map(|corner| self.trial[corner as usize])
    }

    /// The share of its facet for which a sample stands, [-].
    pub fn share(&self, sample: usize) -> f64 {
        self.surface.shares[sample]
    }

    /// The normal of a sample times its area at the trial positions, [length^(D−1)]; per unit thickness in the plane.
    pub fn area(&self, sample: usize) -> [f64; D] {
        area_vector(&self.facet(sample)).map(|a| self.surface.shares[sample] * a)
    }

    /// The bases at the corners of a facet.
    pub fn supports(&self, sample: usize) -> [&Support<D>; D] {
        self.surface.facets[sample].map(|corner| &self.at_corners[corner as usize])
    }

    /// The weights of the corners in the N_v of the side of a triangle in a body of revolution, [-]: the means of r λ_k
    /// over the side at the start of the step, with the linear functions λ_k of the corners, relative to the mean of r.
    fn weights_by_radius(&self, sample: usize) -> [f64; D] {
        let radii = self.surface.facets[sample].map(|corner| self.converged[corner as usize][0]);
        let sum: f64 = radii.iter().sum();
        if sum > 0.0 { radii.map(|r| (r + sum) / (3.0 * sum)) } else { [1.0 / D as f64; D] }
    }

    /// Calls `visit` with the nodes of a sample and their N_v. If this is the mean over the corners of the facet, a
    /// node of several corners is visited once for each corner, with the share of that corner in the mean.
    pub fn for_each_value(&self, sample: usize, mut visit: impl FnMut(usize, f64)) {
        if let Some(mean) = self.at_samples.get(sample).filter(|mean| !mean.is_empty()) {
            mean.iter().for_each(|(node, value)| visit(*node as usize, *value));
            return;
        }
        if self.is_revolved && self.surface.of_triangles[sample] {
            for (support, weight) in self.supports(sample).into_iter().zip(self.weights_by_radius(sample)) {
                for (&node, value) in support.nodes().iter().zip(support.value()) {
                    visit(node as usize, value * weight);
                }
            }
            return;
        }
        for support in self.supports(sample) {
            for (&node, value) in support.nodes().iter().zip(support.value()) {
                visit(node as usize, value / D as f64);
            }
        }
    }

    /// Distributes a force f on a facet, given by its sample, to the nodes: adds N_v f to `nodal`, [force].
    pub fn spread<const N: usize>(&self, sample: usize, force: &[f64; D], nodal: &mut [[f64; N]]) {
        self.for_each_value(sample, |node, value| {
            (0..D).for_each(|d| nodal[node][d] += value * force[d]);
        });
    }

    /// Calls `visit` with the nodes, ascending, of each sample that this rank treats.
    pub fn each_neighbourhood(&self, visit: &mut dyn FnMut(&[u32])) {
        let mut nodes = Vec::new();
        for sample in self.own_samples() {
            nodes.clear();
            let corners = self.corners_of_side(sample);
            corners
                .iter()
                .for_each(|corner| nodes.extend_from_slice(self.at_corners[*corner as usize].nodes()));
            nodes.extend(self.at_samples.get(sample).into_iter().flatten().map(|(node, _)| *node));
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

    /// The divisions of sides by cuts of points of this rank, each with the index of the cut.
    pub(crate) fn divisions_by(&self, points: &Points<D>, halves: &[Halves]) -> Vec<(u32, PlacedDivision)> {
        match self.surface.rule {
            SideRule::Corners => self.surface.divisions(points, halves),
            SideRule::Integral => Vec::new(),
        }
    }

    /// Divides a side in the converged state; until it is located again, the surface is not carried.
    pub fn divide(&mut self, placed: &PlacedDivision) {
        let (middles, _) = placed.middles.as_chunks::<D>();
        let before = self.converged.len();
        let added = self.divide_surface(placed.division);
        self.converged.resize(before + added, [0.0; D]);
        self.converged[before..].iter_mut().zip(middles).for_each(|(x, middle)| *x = *middle);
        self.clear();
    }

    /// Divides a side, whose new corners then lack positions; returns their number, 0 if this is not possible.
    fn divide_surface(&mut self, division: Division) -> usize {
        let start = self.start.take().unwrap_or_else(|| Box::new(self.surface.clone()));
        let (before, added) = (self.len(), self.surface.divide(&division));
        self.start = Some(start);
        if added == 0 {
            return 0;
        }
        self.divisions.push(division);
        let first = division.sample as usize;
        for sample in first..first + self.len() - before {
            self.origins[sample].1 *= 0.5;
            self.origins.push(self.origins[sample]);
        }
        added
    }

    /// The converged state, for a checkpoint.
    pub fn save(&self) -> Value {
        let corners = self.converged.as_flattened().to_vec();
        if self.divisions.is_empty() {
            return json!(corners);
        }
        json!(Saved { corners, divisions: self.divisions.clone() })
    }

    /// Restores the state that [`Carried::save`] returned.
    ///
    /// # Errors
    /// The reason why the value is not a state of this surface.
    pub fn restore(&mut self, saved: &Value) -> Result<(), String> {
        let text = |error: serde_json::Error| error.to_string();
        let saved = match saved {
            Value::Object(_) => serde_json::from_value(saved.clone()).map_err(text)?,
            _ => {
                Saved { corners: serde_json::from_value(saved.clone()).map_err(text)?, divisions: Vec::new() }
            }
        };
        let mut restored = Carried::new(self.start.as_deref().unwrap_or(&self.surface), self.is_revolved);
        for division in saved.divisions {
            if restored.divide_surface(division) == 0 {
                return Err("its sides cannot have been divided in this way".to_owned());
            }
        }
        let (corners, rest) = saved.corners.as_chunks::<D>();
        let is_finite = saved.corners.iter().all(|x| x.is_finite());
        if corners.len() != restored.surface.corners.len() || !rest.is_empty() || !is_finite {
            return Err("its corners are not those of the surface".to_owned());
        }
        restored.converged = corners.to_vec();
        restored.clear();
        *self = restored;
        Ok(())
    }
}

/// A converged state as checkpoints store it; without divisions, they store the corners alone.
#[derive(Serialize, Deserialize)]
struct Saved {
    /// `D` numbers for each corner, [length].
    corners: Vec<f64>,
    divisions: Vec<Division>,
}
