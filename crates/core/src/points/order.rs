//! The order of the points: grouped by the cells of the grid, by permanent number, or as in a checkpoint.

use rayon::prelude::*;

use super::{BodyGroup, PIECE, Points, State};
use crate::grid::Grid;
use crate::ranks::{Halo, Reduction};

impl<const D: usize> Points<D> {
    /// Sums, extremes and decisions over the points of the whole run.
    pub fn reduction(&self) -> Reduction {
        Reduction::new(Halo::from(&self.ranks))
    }

    /// Moves points to the ranks in whose parts of the grid they lie, and sorts the points of this rank by the grid
    /// cell that holds them, then by body; points of the same cell and body keep their order. Returns the index of the
    /// first point of every occupied cell, followed by the number of points. The cells of a patch follow one another
    /// and count as one; points of each group of bodies in them follow one another and are counted apart. `group_of_body`
    /// gives the group of each body; without any, all bodies are in one group. Trial values of further fields are reset.
    ///
    /// # Errors
    /// The index of the first point that lies outside the grid; `None` if only other ranks have such points.
    #[inline(never)]
    pub fn group_by_cell(
        &mut self,
        grid: &dyn Grid<D>,
        group_of_body: &[BodyGroup],
    ) -> Result<Vec<usize>, Option<usize>> {
        self.further.begin();
        let outside = self.locate(grid);
        if self.reduction().any(outside.is_some()) {
            return Err(outside);
        }
        self.migrate(grid);
        let patches = grid.patches();
        let rank = |cell: u32| patches.map_or(cell, |patches| patches.rank_of[cell as usize]);
        let group = |cell: u32| patches.map_or(cell, |patches| patches.patch_of[cell as usize]);
        let key = |points: &Self, p: usize| (rank(points.cell[p]), points.body[p]);
        if !(1..self.len()).all(|p| key(self, p - 1) <= key(self, p)) {
            let mut order: Vec<u32> = (0..self.len() as u32).collect();
            if self.body.iter().any(|body| *body != self.body[0]) {
                order = sorted(&order, |p| self.body[p as usize] as usize);
            }
            self.reorder(&sorted(&order, |p| rank(self.cell[p as usize]) as usize));
        }
        let of_body = |body: u16| group_of_body.get(body as usize).copied().unwrap_or(0);
        if !group_of_body.is_empty() {
            let mut order: Vec<u32> = (0..self.len() as u32).collect();
            let is_together =
                |a: &u32, b: &u32| group(self.cell[*a as usize]) == group(self.cell[*b as usize]);
            for together in order.chunk_by_mut(is_together) {
                together.sort_by_key(|p| of_body(self.body[*p as usize]));
            }
            if !order.is_sorted() {
                self.reorder(&order);
            }
        }
        let key = |p: usize| (group(self.cell[p]), of_body(self.body[p]));
        let mut starts: Vec<usize> = (0..self.len()).filter(|&p| p == 0 || key(p) != key(p - 1)).collect();
        starts.push(self.len());
        Ok(starts)
    }

    /// Finds the cells of all points; returns the first point that lies outside the grid, if there is one.
    fn locate(&mut self, grid: &dyn Grid<D>) -> Option<usize> {
        let places = self.converged.position.par_iter();
        (self.cell.par_iter_mut().zip(places).enumerate().with_min_len(PIECE))
            .filter_map(|(p, (cell, position))| match grid.locate(position, Some(*cell)) {
                Some(found) => {
                    *cell = found;
                    None
                }
                None => Some(p),
            })
            .min()
    }

    /// Restores the points of this rank: their order, given by their permanent numbers `id`, the cells that held them,
    /// and their converged state.
    ///
    /// # Errors
    /// If `id` is not a permutation of the point numbers, or an array does not have the length that the points need.
    pub fn restore(&mut self, id: &[u32], cell: Vec<u32>, state: State<D>) -> Result<(), String> {
        let by_id = self.by_id();
        let mut seen = vec![false; self.len()];
        let mut order = Vec::with_capacity(id.len());
        for number in id {
            let rank = by_id.binary_search_by_key(number, |p| self.id[*p]);
            let place =
                rank.ok().map(|rank| by_id[rank]).filter(|place| !std::mem::replace(&mut seen[*place], true));
            let Some(place) = place else {
                return Err("its point numbers are not the numbers of all points".to_owned());
            };
            order.push(place as u32);
        }
        if [id.len(), cell.len()] != [self.len(); 2] || state.lengths() != self.converged.lengths() {
            return Err("its arrays do not have one entry per point".to_owned());
        }
        self.reorder(&order);
        self.cell = cell;
        self.trial = state.trial();
        self.converged = state;
        Ok(())
    }

    /// Keeps only the points of bodies for which `keep` holds.
    pub fn retain_bodies(&mut self, keep: impl Fn(usize) -> bool) {
        let order: Vec<u32> =
            (0..self.len() as u32).filter(|&p| keep(self.body[p as usize] as usize)).collect();
        if order.len() < self.len() {
            self.select(&order);
        }
    }

    /// Adds other points, undeformed or in their converged state.
    pub fn append(&mut self, other: &Self) {
        if !other.is_empty() {
            self.append_fields(other);
        }
    }

    /// For each of these permanent numbers, the index of the point; `None` if this rank does not hold it.
    pub fn places_of(&self, ids: &[u32]) -> Vec<Option<usize>> {
        let mut wanted: Vec<(u32, usize)> = ids.iter().copied().zip(0..).collect();
        wanted.sort_unstable();
        let mut places = vec![None; ids.len()];
        for (p, id) in self.id.iter().enumerate() {
            let first = wanted.partition_point(|(wanted, _)| wanted < id);
            for (_, k) in wanted[first..].iter().take_while(|(wanted, _)| wanted == id) {
                places[*k] = Some(p);
            }
        }
        places
    }

    /// The indices of the points in the order of their permanent numbers.
    pub fn by_id(&self) -> Vec<usize> {
        let mut order = Vec::new();
        self.order_by_id(&mut order);
        order
    }

    /// Writes the indices of the points, in the order of their permanent numbers, to `order`.
    pub fn order_by_id(&self, order: &mut Vec<usize>) {
        let most = self.id.iter().max().map_or(0, |&id| id as usize + 1);
        order.clear();
        if most > 2 * self.len() {
            // The points of one rank can have any of the permanent numbers.
            order.extend(0..self.len());
            order.sort_unstable_by_key(|p| self.id[*p]);
            return;
        }
        order.resize(most, usize::MAX);
        for (p, &id) in self.id.iter().enumerate() {
            order[id as usize] = p;
        }
        if most > self.len() {
            order.retain(|&p| p != usize::MAX);
        }
    }
}

/// Sorts points by a key with a stable counting sort.
fn sorted(points: &[u32], key: impl Fn(u32) -> usize) -> Vec<u32> {
    let mut next = Vec::new();
    for &p in points {
        let key = key(p) + 1;
        if next.len() <= key {
            next.resize(key + 1, 0u32);
        }
        next[key] += 1;
    }
    for k in 1..next.len() {
        next[k] += next[k - 1];
    }
    let mut order = vec![0; points.len()];
    for &p in points {
        let place = &mut next[key(p)];
        order[*place as usize] = p;
        *place += 1;
    }
    order
}
