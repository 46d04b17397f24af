//! Patches: small connected groups of triangles or tetrahedra, over which the dilatation can be averaged.
//!
//! The gradient in a simplex is constant, so averaging the dilatation over the simplex alone changes nothing. A large
//! mesh has about two triangles, or five and a half tetrahedra, per node. One volume constraint for every three or four
//! triangles, or for every eight tetrahedra, therefore leaves enough freedom at constant volume (de Souza Neto, Andrade
//! Pires and Owen 2005).

use super::Grid;
use super::sides::sides_of;

/// The patches of a mesh. Each quadrilateral or hexahedron is a patch of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Patches {
    /// For each cell, the number of its patch.
    pub patch_of: Vec<u32>,
    /// For each cell, its index in the order of patches.
    pub rank_of: Vec<u32>,
}

/// Largest number of cells to which a patch grows before small patches are joined to others.
const fn most_cells(dimension: usize) -> usize {
    if dimension == 3 { 8 } else { 4 }
}

/// Marks a cell without a patch.
const NONE: u32 = u32::MAX;

impl Patches {
    /// Forms the patches of a mesh from its cells in order: each patch repeatedly adds the neighbour that shares the
    /// most sides with it, or the nearest of several such neighbours. Patches of at most half the full size are then
    /// joined to their smallest neighbouring patch.
    pub fn new<const D: usize>(grid: &dyn Grid<D>) -> Self {
        let neighbours = neighbours(grid);
        let n = grid.n_cells();
        let is_simplex = |cell: u32| grid.corners(cell as usize).nodes().len() == D + 1;
        let mut patch_of = vec![NONE; n];
        let mut patches: Vec<Vec<u32>> = Vec::new();
        for seed in 0..n as u32 {
            if patch_of[seed as usize] != NONE {
                continue;
            }
            let number = patches.len() as u32;
            let mut patch = vec![seed];
            patch_of[seed as usize] = number;
            while is_simplex(seed) && patch.len() < most_cells(D) {
                let beside = patch.iter().flat_map(|cell| &neighbours[*cell as usize]);
                let free = beside.copied().filter(|c| is_simplex(*c) && patch_of[*c as usize] == NONE);
                let Some(next) = best(grid, &patch, free, &neighbours) else { break };
                patch_of[next as usize] = number;
                patch.push(next);
            }
            patches.push(patch);
        }
        join_small(&mut patches, &mut patch_of, &neighbours, |patch| is_simplex(patch[0]), most_cells(D));
        let mut patches_left = patches.into_iter().filter(|patch| !patch.is_empty());
        let (mut rank_of, mut rank) = (vec![0; n], 0);
        for number in 0.. {
            let Some(mut patch) = patches_left.next() else { break };
            patch.sort_unstable();
            for cell in patch {
                (patch_of[cell as usize], rank_of[cell as usize]) = (number, rank);
                rank += 1;
            }
        }
        Patches { patch_of, rank_of }
    }
}

/// The cell that shares the most sides with a patch; if there are several, the one nearest to the centre of the patch.
fn best<const D: usize>(
    grid: &dyn Grid<D>,
    patch: &[u32],
    candidates: impl Iterator<Item = u32>,
    neighbours: &[Vec<u32>],
) -> Option<u32> {
    let mut middle = [0.0; D];
    for &cell in patch {
        let centre = grid.centre(cell as usize);
        (0..D).for_each(|d| middle[d] += centre[d] / patch.len() as f64);
    }
    let rating = |cell: u32| {
        let shared = neighbours[cell as usize].iter().filter(|other| patch.contains(other)).count();
        let centre = grid.centre(cell as usize);
        let distance: f64 = (0..D).map(|d| (centre[d] - middle[d]).powi(2)).sum();
        (shared, distance)
    };
    candidates
        .map(|cell| (rating(cell), cell))
        .fold(None, |best: Option<((usize, f64), u32)>, one| match best {
            Some(best) if (best.0.0, -best.0.1, one.1) >= (one.0.0, -one.0.1, best.1) => Some(best),
            _ => Some(one),
        })
        .map(|(_, cell)| cell)
}

/// Joins small patches to their smallest neighbouring patch.
fn join_small(
    patches: &mut [Vec<u32>],
    patch_of: &mut [u32],
    neighbours: &[Vec<u32>],
    may_join: impl Fn(&[u32]) -> bool,
    most: usize,
) {
    for number in 0..patches.len() {
        if 2 * patches[number].len() > most || patches[number].is_empty() || !may_join(&patches[number]) {
            continue;
        }
        let beside = patches[number].iter().flat_map(|cell| &neighbours[*cell as usize]);
        let beside = beside.map(|cell| patch_of[*cell as usize] as usize);
        let others = beside.filter(|&other| other != number && may_join(&patches[other]));
        let Some(target) = others.min_by_key(|&other| (patches[other].len(), other)) else { continue };
        for cell in std::mem::take(&mut patches[number]) {
            patch_of[cell as usize] = target as u32;
            patches[target].push(cell);
        }
    }
}

/// For each cell, the cells that share a side with it, ascending.
fn neighbours<const D: usize>(grid: &dyn Grid<D>) -> Vec<Vec<u32>> {
    let cells: Vec<u32> = (0..grid.n_cells() as u32).collect();
    let sides = sides_of(grid, &cells);
    let mut neighbours = vec![Vec::new(); cells.len()];
    for equal in sides.chunk_by(|a, b| a.key == b.key) {
        if let [a, b] = equal {
            neighbours[a.cell].push(b.cell as u32);
            neighbours[b.cell].push(a.cell as u32);
        }
    }
    neighbours.iter_mut().for_each(|list| list.sort_unstable());
    neighbours
}
