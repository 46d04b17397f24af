//! The material points: what they are, their converged state, and the trial state of the load step in hand.

use rayon::prelude::*;

use crate::grid::Grid;
use crate::tensor::{Mat3, Sym3};

/// Points that one thread works on at least.
pub const PIECE: usize = 1 << 10;

/// A position as messages show it.
pub fn coordinates(position: &[f64]) -> String {
    let without_sign = |text: String| match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    };
    let numbers: Vec<String> = position.iter().map(|x| without_sign(format!("{x:.6}"))).collect();
    format!("({})", numbers.join(", "))
}

/// Where the current volume of a point comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PointVolume {
    /// det(F) times the original volume, eq. (22).
    #[default]
    Deformation,
    /// The volume of the domain; the same as above unless a domain update does not keep it. Needed only to reproduce
    /// some results of the paper. Points without domain keep eq. (22).
    Domain,
}

/// The fields of the points that change from step to step; one entry per point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State<const D: usize> {
    /// Position x_p, [length].
    pub position: Vec<[f64; D]>,
    /// Half lengths l_p of the domain along the axes, [length]; zero for points without domain, and none at all where no
    /// point has such a domain.
    pub half_lengths: Vec<[f64; D]>,
    /// Corners of the domains given by corners, [length]; those of a point are at [`Points::corner_range`].
    pub corners: Vec<[f64; D]>,
    /// Deformation gradient F from the original configuration, [-].
    pub deformation_gradient: Vec<Mat3>,
    /// Elastic strain in the measure of the law, for most laws the logarithmic one ε^e, [-].
    pub elastic_strain: Vec<Sym3>,
    /// Kirchhoff stress τ, [stress].
    pub kirchhoff_stress: Vec<Sym3>,
    /// History variables of the law, `Points::history_len` per point.
    pub history: Vec<f64>,
}

impl<const D: usize> State<D> {
    /// The trial state of a step that begins in this state.
    fn in_hand(&self) -> Self {
        State {
            elastic_strain: self.elastic_strain.clone(),
            kirchhoff_stress: self.kirchhoff_stress.clone(),
            history: self.history.clone(),
            ..State::default()
        }
    }

    /// Exchanges what laws answer: strain, stress and history.
    fn swap_answers(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.elastic_strain, &mut other.elastic_strain);
        std::mem::swap(&mut self.kirchhoff_stress, &mut other.kirchhoff_stress);
        std::mem::swap(&mut self.history, &mut other.history);
    }

    /// Forgets where points are and how they are deformed.
    pub(crate) fn forget_motion(&mut self) {
        self.position = Vec::new();
        self.half_lengths = Vec::new();
        self.corners = Vec::new();
        self.deformation_gradient = Vec::new();
    }
}

/// All material points of an analysis, as structure of arrays.
///
/// Newton iterations write `trial` only; [`Points::commit`] is the sole path from trial to converged, so that
/// abandoning a load step needs no undo. Points are kept grouped by the grid cell that holds them; `id` is the
/// permanent number of a point.
#[derive(Debug, Clone)]
pub struct Points<const D: usize> {
    /// Permanent number, 0 to n − 1.
    pub id: Vec<u32>,
    /// Number of the body.
    pub body: Vec<u16>,
    /// Original position, [length].
    pub original_position: Vec<[f64; D]>,
    /// Original half lengths l_p0 of the domain, [length]; none where no point has such a domain.
    pub original_half_lengths: Vec<[f64; D]>,
    /// Original corners of the domains given by corners, [length]; those of a point are at [`Points::corner_range`].
    pub original_corners: Vec<[f64; D]>,
    /// Original volume V_p0, [volume].
    pub original_volume: Vec<f64>,
    /// Mass m_p, [mass]; constant.
    pub mass: Vec<f64>,
    /// Whether the point belongs to the outer layer of its body at the start.
    pub outer_layer: Vec<bool>,
    /// State at the end of the last equilibrated step.
    pub converged: State<D>,
    /// State of the step in hand. Positions, deformation and domains are there from the motion of the points at the end of
    /// the step until it is committed, and take no memory before.
    pub trial: State<D>,
    /// Number of history variables kept per point: the most that any law needs.
    pub history_len: usize,
    /// Number of places for domain corners kept per point: the most that any of them has.
    pub corners_per_point: usize,
    /// Number of corners of the domain of the point: 2^D for quadrilaterals and hexahedra, D + 1 for triangles and
    /// tetrahedra, none for points whose domain is not given by corners; no entries where there are no corners.
    pub corner_count: Vec<u8>,
    /// The cell that held the point when the points were last grouped.
    pub cell: Vec<u32>,
}

/// What seeding knows of one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Seed<const D: usize> {
    /// Number of the body.
    pub body: u16,
    /// Position, [length].
    pub position: [f64; D],
    /// Half lengths of the domain, [length]; zero for points without domain.
    pub half_lengths: [f64; D],
    /// Corners of a domain given by corners, [length]; none for other points. 2^D corners are those of a
    /// quadrilateral or hexahedron, bit d of a corner's number being its side along parametric axis d; D + 1 are
    /// those of a triangle or tetrahedron of positive volume.
    pub corners: Vec<[f64; D]>,
    /// Volume, [volume].
    pub volume: f64,
    /// Mass, [mass].
    pub mass: f64,
    /// Whether the point belongs to the outer layer of its body.
    pub outer_layer: bool,
    /// Initial history variables.
    pub history: Vec<f64>,
}

impl<const D: usize> Points<D> {
    /// Stress-free, undeformed points; their order gives the permanent numbers.
    pub fn new(seeds: &[Seed<D>]) -> Self {
        let history_len = seeds.iter().map(|s| s.history.len()).max().unwrap_or(0);
        let mut history = vec![0.0; history_len * seeds.len()];
        for (p, seed) in seeds.iter().enumerate() {
            history[p * history_len..][..seed.history.len()].copy_from_slice(&seed.history);
        }
        let corners_per_point = seeds.iter().map(|s| s.corners.len()).max().unwrap_or(0);
        let mut corners = vec![[0.0; D]; corners_per_point * seeds.len()];
        for (p, seed) in seeds.iter().enumerate() {
            corners[p * corners_per_point..][..seed.corners.len()].copy_from_slice(&seed.corners);
        }
        let half_lengths: Vec<[f64; D]> = if seeds.iter().any(|s| s.half_lengths != [0.0; D]) {
            each(seeds, |s| s.half_lengths)
        } else {
            Vec::new()
        };
        let state = State {
            corners: corners.clone(),
            position: each(seeds, |s| s.position),
            half_lengths: half_lengths.clone(),
            deformation_gradient: vec![Mat3::identity(); seeds.len()],
            elastic_strain: vec![Sym3::ZERO; seeds.len()],
            kirchhoff_stress: vec![Sym3::ZERO; seeds.len()],
            history,
        };
        Points {
            id: (0..seeds.len() as u32).collect(),
            body: each(seeds, |s| s.body),
            original_position: each(seeds, |s| s.position),
            original_half_lengths: half_lengths,
            original_volume: each(seeds, |s| s.volume),
            mass: each(seeds, |s| s.mass),
            outer_layer: each(seeds, |s| s.outer_layer),
            trial: state.in_hand(),
            converged: state,
            history_len,
            original_corners: corners,
            corners_per_point,
            corner_count: if corners_per_point > 0 {
                each(seeds, |s| s.corners.len() as u8)
            } else {
                Vec::new()
            },
            cell: vec![0; seeds.len()],
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// The trial state becomes the converged state.
    pub fn commit(&mut self) {
        self.converged.swap_answers(&mut self.trial);
        let (old, new) = (&mut self.converged, &mut self.trial);
        if new.position.len() == old.position.len() {
            old.position = std::mem::take(&mut new.position);
            old.half_lengths = std::mem::take(&mut new.half_lengths);
            old.corners = std::mem::take(&mut new.corners);
            old.deformation_gradient = std::mem::take(&mut new.deformation_gradient);
        }
    }

    /// Half lengths of the domain of a point in the converged state, [length]; zero for points without.
    #[inline]
    pub fn half_lengths(&self, p: usize) -> [f64; D] {
        self.converged.half_lengths.get(p).copied().unwrap_or([0.0; D])
    }

    /// Volume J V_p0 of a point in the converged state, eq. (22), [volume].
    pub fn volume(&self, p: usize) -> f64 {
        self.converged.deformation_gradient[p].determinant() * self.original_volume[p]
    }

    /// Sorts the points by the grid cell that holds them, then by body, keeping the order of equals, and returns the
    /// first point of every occupied cell and, last, the number of points.
    ///
    /// # Errors
    /// The index of the first point that lies outside the grid.
    pub fn group_by_cell(&mut self, grid: &dyn Grid<D>) -> Result<Vec<usize>, usize> {
        let outside = match grid.structured() {
            Some(grid) => self.locate(grid),
            None => self.locate(grid),
        };
        if let Some(p) = outside {
            return Err(p);
        }
        let key = |points: &Self, p: usize| (points.cell[p], points.body[p]);
        if !(1..self.len()).all(|p| key(self, p - 1) <= key(self, p)) {
            let mut order: Vec<u32> = (0..self.len() as u32).collect();
            if self.body.iter().any(|body| *body != self.body[0]) {
                order = sorted(&order, |p| self.body[p as usize] as usize);
            }
            self.reorder(&sorted(&order, |p| self.cell[p as usize] as usize));
        }
        let mut starts: Vec<usize> =
            (0..self.len()).filter(|&p| p == 0 || self.cell[p] != self.cell[p - 1]).collect();
        starts.push(self.len());
        Ok(starts)
    }

    /// Finds the cells of all points; the first point that lies outside the grid.
    fn locate<G: Grid<D> + ?Sized>(&mut self, grid: &G) -> Option<usize> {
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

    fn reorder(&mut self, order: &[u32]) {
        self.id = gather(&self.id, order);
        self.body = gather(&self.body, order);
        self.cell = gather(&self.cell, order);
        self.original_position = gather(&self.original_position, order);
        if !self.original_half_lengths.is_empty() {
            self.original_half_lengths = gather(&self.original_half_lengths, order);
        }
        self.original_corners = gather_blocks(&self.original_corners, order, self.corners_per_point);
        self.original_volume = gather(&self.original_volume, order);
        self.mass = gather(&self.mass, order);
        self.outer_layer = gather(&self.outer_layer, order);
        if !self.corner_count.is_empty() {
            self.corner_count = gather(&self.corner_count, order);
        }
        let state = &mut self.converged;
        state.position = gather(&state.position, order);
        if !state.half_lengths.is_empty() {
            state.half_lengths = gather(&state.half_lengths, order);
        }
        state.corners = gather_blocks(&state.corners, order, self.corners_per_point);
        state.deformation_gradient = gather(&state.deformation_gradient, order);
        // Into the trial state, which the step in hand has yet to write.
        let (old, new) = (&self.converged, &mut self.trial);
        gather_into(&old.elastic_strain, order, 1, &mut new.elastic_strain);
        gather_into(&old.kirchhoff_stress, order, 1, &mut new.kirchhoff_stress);
        gather_into(&old.history, order, self.history_len, &mut new.history);
        self.converged.swap_answers(&mut self.trial);
    }

    /// Puts the points into another order, `id` being their permanent numbers in it, and into a converged state with the
    /// cells that held them.
    ///
    /// # Errors
    /// When the numbers are not those of all points, or the arrays have not one entry for each.
    pub fn restore(&mut self, id: &[u32], cell: Vec<u32>, state: State<D>) -> Result<(), String> {
        let mut seen = vec![false; self.len()];
        for &number in id {
            match seen.get_mut(number as usize) {
                Some(seen) if !*seen => *seen = true,
                _ => return Err("the numbers of its points are not those of all points".to_owned()),
            }
        }
        let lengths = |state: &State<D>| {
            [
                state.position.len(),
                state.half_lengths.len(),
                state.corners.len(),
                state.deformation_gradient.len(),
                state.elastic_strain.len(),
                state.kirchhoff_stress.len(),
                state.history.len(),
            ]
        };
        if [id.len(), cell.len()] != [self.len(); 2] || lengths(&state) != lengths(&self.converged) {
            return Err("its arrays have not one entry for each point".to_owned());
        }
        let place = self.by_id();
        let order: Vec<u32> = id.iter().map(|&number| place[number as usize] as u32).collect();
        self.reorder(&order);
        self.cell = cell;
        self.trial = state.in_hand();
        self.converged = state;
        Ok(())
    }

    /// Where the corners of the domain of a point stand in the arrays of corners; empty when its domain is not given
    /// by corners.
    pub fn corner_range(&self, p: usize) -> std::ops::Range<usize> {
        let start = p * self.corners_per_point;
        start..start + self.corner_count.get(p).map_or(0, |n| usize::from(*n))
    }

    /// Corners of the domain of a point in the converged state; none when it is not given by corners.
    pub fn corners(&self, p: usize) -> &[[f64; D]] {
        &self.converged.corners[self.corner_range(p)]
    }

    /// The order of the points by permanent number: `order[id]` is the place of point `id`.
    pub fn by_id(&self) -> Vec<usize> {
        let mut order = Vec::new();
        self.order_by_id(&mut order);
        order
    }

    /// The same in place of what is in `order`.
    pub fn order_by_id(&self, order: &mut Vec<usize>) {
        order.resize(self.len(), 0);
        for (p, &id) in self.id.iter().enumerate() {
            order[id as usize] = p;
        }
    }

    /// The `count` points of a body nearest to a place in the original configuration, as permanent numbers, nearest
    /// first; and whether the choice was clear, i.e. the next one is farther away.
    pub fn nearest(&self, body: u16, place: &[f64; D], count: usize) -> (Vec<u32>, bool) {
        let distance = |p: usize| -> f64 {
            (0..D).map(|d| (self.original_position[p][d] - place[d]).powi(2)).sum::<f64>().sqrt()
        };
        let mut found: Vec<(f64, u32)> =
            (0..self.len()).filter(|&p| self.body[p] == body).map(|p| (distance(p), self.id[p])).collect();
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count + 1 < found.len() {
            found.select_nth_unstable_by(count, order);
            found.truncate(count + 1);
        }
        found.sort_unstable_by(order);
        let clear = match (found.get(count.wrapping_sub(1)), found.get(count)) {
            // Distances from far places are round-off of their coordinates.
            (Some(last), Some(next)) => {
                let far = place.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
                next.0 - last.0 > 1e-9 * next.0 + 1e-12 * far
            }
            _ => true,
        };
        (found.iter().take(count).map(|f| f.1).collect(), clear)
    }

    /// Permanent numbers of the points of a body nearest to a place in the original configuration, by distance, and all
    /// that are farther than the last of `count` by `slack` [length] or by the round-off of coordinates at most.
    pub fn nearest_with_ties(&self, body: u16, place: &[f64; D], count: usize, slack: f64) -> Vec<u32> {
        let distance = |p: usize| -> f64 {
            (0..D).map(|d| (self.original_position[p][d] - place[d]).powi(2)).sum::<f64>().sqrt()
        };
        let of_body = || (0..self.len()).filter(|&p| self.body[p] == body);
        let mut least: Vec<f64> = of_body().map(distance).collect();
        let Some(last) = least.len().checked_sub(1).map(|most| most.min(count.max(1) - 1)) else {
            return Vec::new();
        };
        let (_, last, _) = least.select_nth_unstable_by(last, f64::total_cmp);
        let far = place.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
        let most = *last + slack + 1e-12 * far;
        let near = of_body().filter(|&p| distance(p) <= most);
        let mut found: Vec<(f64, u32)> = near.map(|p| (distance(p), self.id[p])).collect();
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().map(|(_, id)| id).collect()
    }
}

/// The points in the order of a key, those of the same key in the order that they had: by counting.
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

fn gather<T: Copy + Send + Sync>(values: &[T], order: &[u32]) -> Vec<T> {
    order.par_iter().with_min_len(PIECE).map(|&p| values[p as usize]).collect()
}

/// One value per point, from its seed.
fn each<const D: usize, T: Send>(seeds: &[Seed<D>], value: impl Fn(&Seed<D>) -> T + Send + Sync) -> Vec<T> {
    seeds.par_iter().with_min_len(PIECE).map(value).collect()
}

/// As [`gather`], for `n` values per point.
fn gather_blocks<T: Copy>(values: &[T], order: &[u32], n: usize) -> Vec<T> {
    order.iter().flat_map(|&p| &values[p as usize * n..][..n]).copied().collect()
}

/// As [`gather_blocks`], into given room.
fn gather_into<T: Copy + Send + Sync>(values: &[T], order: &[u32], n: usize, room: &mut [T]) {
    let places = room.par_chunks_exact_mut(n.max(1)).with_min_len(PIECE);
    places.zip(order).for_each(|(place, &p)| place.copy_from_slice(&values[p as usize * n..][..n]));
}
