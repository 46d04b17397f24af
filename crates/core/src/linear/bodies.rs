//! Elastic bodies on lattices, for tests: their matrices, complete or divided between ranks cell by cell.

use std::collections::BTreeMap;

use super::{
    Backend, Block, BlockMatrix, Division, Krylov, Layout, LinearError, Numbering, Preconditioner, Solved,
    Stiffness,
};
use crate::ranks::{Halo, Ranks, sharing};

/// Tolerance of the solutions, as a relative residual.
const TOLERANCE: f64 = 1e-10;

pub fn ragged2(cell: [u32; 2]) -> Option<f64> {
    let [x, y] = cell;
    if (x * 7 + y * 13) % 17 == 5 || (x > 30 && y < 9) {
        return None;
    }
    Some(if (x + 3 * y) % 11 == 2 { 1e-6 } else { 1.0 })
}

pub fn ragged3(cell: [u32; 3]) -> Option<f64> {
    let [x, y, z] = cell;
    if (x * 7 + y * 13 + z * 5) % 17 == 5 || (x > 20 && y + z < 5) {
        return None;
    }
    Some(if (x + 3 * y + 2 * z) % 11 == 2 { 1e-6 } else { 1.0 })
}

/// A rule that assigns a cell to a rank, given the numbers of cells along the axes and the number of ranks.
pub type Rule<const D: usize> = fn([u32; D], [u32; D], usize) -> usize;

pub fn slabs<const D: usize>(cell: [u32; D], cells: [u32; D], n: usize) -> usize {
    cell[0] as usize * n / cells[0] as usize
}

pub fn pieces<const D: usize>(cell: [u32; D], _: [u32; D], n: usize) -> usize {
    (cell[0] / 5 * 3 + cell[1] / 3 * 2 + cell[D - 1] / 4 + cell[0] * cell[1] / 40) as usize % n
}

/// A [`Rule`] by which neighbouring cells hardly ever have the same rank.
pub fn scattered<const D: usize>(cell: [u32; D], cells: [u32; D], n: usize) -> usize {
    let number = cell.iter().zip(cells).fold(0, |number, (c, n)| number * u64::from(n) + u64::from(*c));
    (number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33) as usize % n
}

/// The solution at the nodes of all ranks, which must agree with one another.
pub fn whole<'a, const D: usize>(
    found: impl IntoIterator<Item = &'a BTreeMap<u32, [f64; D]>>,
) -> BTreeMap<u32, [f64; D]> {
    let mut whole = BTreeMap::new();
    for found in found {
        for (node, x) in found {
            let there = whole.entry(*node).or_insert(*x);
            assert_eq!(there, x, "node {node}");
        }
    }
    whole
}

/// A body of cells. Its nodes on the lowest plane of the first axis are held; some other nodes are held along one
/// direction.
#[derive(Clone, Copy)]
pub struct Body<const D: usize> {
    /// Number of cells along each axis.
    pub cells: [u32; D],
    /// Fraction of each cell that the body fills; `None` if no point touches the cell.
    pub fill: fn([u32; D]) -> Option<f64>,
    /// The ratio of successive line spacings.
    pub ratio: f64,
    /// Factor of an antisymmetric part that is added to the matrix.
    pub skew: f64,
    /// Factor of a lumped mass matrix that is subtracted from the stiffness.
    pub shift: f64,
    /// True if nodes are also coupled across two cells.
    pub is_wide: bool,
}

/// The results on one rank.
pub struct Found<const D: usize> {
    /// Solution by grid node.
    pub x: BTreeMap<u32, [f64; D]>,
    /// Outcome of the solution.
    pub solved: Result<Solved, LinearError>,
    /// Number of nodes of each level, over all ranks.
    pub levels: Vec<usize>,
    /// Numbers of own nodes and of ghost nodes of this rank on each level.
    pub here: Vec<[usize; 2]>,
}

/// The part of the equations that one rank holds.
pub struct Part<const D: usize> {
    /// Grid nodes that the cells of the rank touch, ascending.
    pub nodes: Vec<u32>,
    /// Lattice positions of these nodes.
    pub places: Vec<[u32; D]>,
    /// The lines of the lattice.
    pub lines: [Option<Vec<f64>>; D],
    pub numbering: Numbering<D>,
    pub halo: Halo,
    symmetric: bool,
    column_start: Vec<usize>,
    row: Vec<u32>,
    blocks: Vec<Block<D>>,
}

impl<const D: usize> Part<D> {
    /// The contributions of the cells of the rank to the matrix.
    pub fn matrix(&self) -> BlockMatrix<'_, D> {
        let Part { symmetric, column_start, row, blocks, .. } = self;
        BlockMatrix { symmetric: *symmetric, column_start, row, blocks }
    }

    fn with_layout<T>(&self, work: impl FnOnce(&Layout<D>) -> T) -> T {
        work(&Layout {
            numbering: &self.numbering,
            nodes: &self.nodes,
            lattice: &|node| self.places[node],
            position: &|node| self.places[node].map(f64::from),
            lines: std::array::from_fn(|d| self.lines[d].as_deref()),
            halo: &self.halo,
        })
    }

    /// Loads at the nodes of the rank; they are complete even at nodes that other ranks touch.
    fn loads(&self) -> Vec<[f64; D]> {
        let load = |node: &u32| std::array::from_fn(|d| (f64::from(*node) * 0.37 + d as f64).sin());
        self.nodes.iter().map(load).collect()
    }

    /// Prepares, factorises and solves.
    pub fn solve(&self, backend: &mut dyn Backend<D>, x: &mut [[f64; D]]) -> Result<Solved, LinearError> {
        self.with_layout(|layout| {
            let matrix = self.matrix();
            backend.prepare(layout, &matrix)?;
            backend.factorise(layout, &matrix)?;
            let mut division = Division::new(&self.column_start, &self.row);
            let mut stiffness = Stiffness { matrix, division: &mut division };
            backend.solve(layout, &mut stiffness, &self.loads(), x, TOLERANCE)
        })
    }

    /// The result of one preconditioner cycle for the loads, by grid node.
    pub fn precondition(&self) -> BTreeMap<u32, [f64; D]> {
        let mut preconditioner = Preconditioner::default();
        let mut z = self.loads();
        self.with_layout(|layout| preconditioner.prepare(layout, &self.matrix())).unwrap();
        assert_eq!(preconditioner.factorise(&self.matrix()), Ok(true));
        preconditioner.apply(&self.loads(), &mut z).unwrap();
        self.nodes.iter().copied().zip(z).collect()
    }
}

type Blocks<const D: usize> = BTreeMap<(u32, u32), Block<D>>;

impl<const D: usize> Body<D> {
    pub fn bar(cells: [u32; D]) -> Self {
        Body { cells, fill: |_| Some(1.0), ratio: 1.0, skew: 0.0, shift: 0.0, is_wide: false }
    }

    fn number(&self, place: [u32; D]) -> u32 {
        (0..D).rev().fold(0, |n, d| n * (self.cells[d] + 1) + place[d])
    }

    fn place(&self, mut number: u32) -> [u32; D] {
        std::array::from_fn(|d| {
            let place = number % (self.cells[d] + 1);
            number /= self.cells[d] + 1;
            place
        })
    }

    /// Lattice lines; the first of them lie below the body.
    fn lines(&self) -> [Option<Vec<f64>>; D] {
        std::array::from_fn(|d| {
            let line = |k: u32| (0..k).map(|k| self.ratio.powi(k as i32)).sum::<f64>();
            let below = (1..=Self::low(d)).rev().map(|k| -f64::from(k));
            (self.ratio != 1.0).then(|| below.chain((0..=self.cells[d]).map(line)).collect())
        })
    }

    /// Index of the lowest line of the body along an axis.
    fn low(d: usize) -> u32 {
        3 + 2 * d as u32
    }

    /// Cells that the body touches.
    fn touched(&self) -> Vec<[u32; D]> {
        let count: u32 = self.cells.iter().product();
        let cells = (0..count).map(|mut number| {
            std::array::from_fn(|d| {
                let place = number % self.cells[d];
                number /= self.cells[d];
                place
            })
        });
        cells.filter(|cell| (self.fill)(*cell).is_some()).collect()
    }

    /// Adds the stiffness of the cuboid that starts at `cell` and is `width` cells wide.
    fn add(&self, cell: [u32; D], width: u32, factor: f64, to: &mut Blocks<D>) {
        let size: [f64; D] =
            std::array::from_fn(|d| (0..width).map(|k| self.ratio.powi((cell[d] + k) as i32)).sum());
        if (0..D).any(|d| cell[d] + width > self.cells[d]) {
            return;
        }
        let corner = |a: usize| self.number(std::array::from_fn(|d| cell[d] + width * (a >> d & 1) as u32));
        let volume: f64 = size.iter().product();
        for a in 0..1usize << D {
            for b in 0..1usize << D {
                let mut block = [[0.0; D]; D];
                for gauss in 0..1usize << D {
                    let xi: [f64; D] = std::array::from_fn(|d| {
                        0.5 + (if gauss >> d & 1 == 1 { 0.5 } else { -0.5 }) / 3f64.sqrt()
                    });
                    let gradient = |a: usize| -> [f64; D] {
                        std::array::from_fn(|d| {
                            (0..D)
                                .map(|e| match (e == d, a >> e & 1 == 1) {
                                    (true, up) => (if up { 1.0 } else { -1.0 }) / size[d],
                                    (false, true) => xi[e],
                                    (false, false) => 1.0 - xi[e],
                                })
                                .product()
                        })
                    };
                    let (ga, gb) = (gradient(a), gradient(b));
                    let along: f64 = (0..D).map(|d| ga[d] * gb[d]).sum();
                    let weight = factor * volume / f64::from(1 << D);
                    for i in 0..D {
                        for k in 0..D {
                            block[i][k] += weight * (1.2 * ga[i] * gb[k] + 0.9 * ga[k] * gb[i]);
                        }
                        block[i][i] += weight * 0.9 * along;
                    }
                }
                for i in 0..D {
                    block[i][i] += factor * self.skew * (a as f64 - b as f64);
                    if a == b {
                        block[i][i] -= factor * self.shift * volume / f64::from(1 << D);
                    }
                }
                let sum = to.entry((corner(b), corner(a))).or_insert([[0.0; D]; D]);
                for i in 0..D {
                    for k in 0..D {
                        sum[i][k] += block[i][k];
                    }
                }
            }
        }
    }

    /// The part of the equations on a rank, for the cells that `rank_of` assigns to it.
    pub fn part(&self, ranks: &Ranks, rank_of: impl Fn([u32; D]) -> usize) -> Part<D> {
        let mut sums = Blocks::new();
        for cell in self.touched().into_iter().filter(|cell| rank_of(*cell) == ranks.own()) {
            let fill = (self.fill)(cell).unwrap();
            self.add(cell, 1, fill, &mut sums);
            if self.is_wide {
                self.add(cell, 2, 0.3 * fill, &mut sums);
            }
        }
        let mut nodes: Vec<u32> = sums.keys().map(|(column, _)| *column).collect();
        nodes.dedup();
        let total: u32 = self.cells.iter().map(|n| n + 1).product();
        let touched: Vec<(u32, bool)> = nodes.iter().map(|node| (*node, true)).collect();
        let halo = Halo::new(ranks, &nodes, &sharing(ranks, &touched, total as usize));
        let local = |node: u32| nodes.binary_search(&node).unwrap();
        let symmetric = self.skew == 0.0;
        let (mut column_start, mut row, mut blocks) = (vec![0; nodes.len() + 1], Vec::new(), Vec::new());
        for ((c, r), block) in sums.iter().filter(|((c, r), _)| !symmetric || r >= c) {
            row.push(local(*r) as u32);
            blocks.push(*block);
            column_start[local(*c) + 1] = row.len();
        }
        let along = |node: usize| self.place(nodes[node])[0];
        let numbering = Numbering::new(nodes.len(), |node, d| {
            along(node) > 0 && !(d == 1 && along(node) == self.cells[0])
        });
        let place = |node: &u32| {
            let place = self.place(*node);
            std::array::from_fn(|d| place[d] + Self::low(d))
        };
        let places = nodes.iter().map(place).collect();
        Part { places, lines: self.lines(), numbering, halo, symmetric, column_start, row, blocks, nodes }
    }

    /// Solves for loads at all nodes; a rank has the cells that `rank_of` assigns to it.
    pub fn solve(&self, ranks: &Ranks, rank_of: impl Fn([u32; D]) -> usize) -> Found<D> {
        let part = self.part(ranks, rank_of);
        let mut krylov = Krylov::default();
        let mut x = vec![[0.0; D]; part.nodes.len()];
        let solved = part.solve(&mut krylov, &mut x);
        let here = krylov.preconditioner().levels_here();
        let x = part.nodes.iter().copied().zip(x).collect();
        Found { x, solved, levels: krylov.levels(), here }
    }
}
