//! An elastic body on a grid of squares or cubes, whose elements are divided between ranks.

use mpm_core::linear::Stiffness;
use mpm_core::linear::{
    Backend, Block, BlockMatrix, Division, Factorisation, Layout, LinearError, Numbering, Solved,
};
use mpm_core::ranks::{Halo, Ranks, sharing};

/// The kinds of matrices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Symmetric and positive definite.
    Definite,
    /// Symmetric, with this multiple of a mass matrix subtracted.
    Shifted(f64),
    /// Not symmetric.
    Unsymmetric,
    /// Singular, because no node is held.
    Loose,
    /// Nearly singular, because the elements at the right end are weak and have one quadrature point.
    Weak,
    /// With entries that are not numbers, on the last rank only.
    NotFinite,
}

/// The part of the body that one rank holds.
pub struct Part<const D: usize> {
    pub nodes: Vec<u32>,
    pub places: Vec<[u32; D]>,
    pub halo: Halo,
    pub numbering: Numbering<D>,
    symmetric: bool,
    column_start: Vec<usize>,
    row: Vec<u32>,
    pub blocks: Vec<Block<D>>,
    division: Division<D>,
}

/// Number of a node of a grid with these numbers of elements.
fn node_at<const D: usize>(elements: [u32; D], place: [u32; D]) -> u32 {
    (0..D).fold(0, |number, d| number * (elements[d] + 1) + place[d])
}

/// Coordinate `d` of corner `k` of an element: 0 or 1.
fn corner<const D: usize>(k: usize, d: usize) -> u32 {
    (k >> (D - 1 - d)) as u32 & 1
}

/// The stiffness of an element by its corners: linear elasticity with λ = μ = 1, with one or two Gauss points along
/// each axis.
fn stiffness<const D: usize>(kind: Kind, points: usize) -> Vec<Vec<Block<D>>> {
    let corners = 1 << D;
    let mut blocks = vec![vec![[[0.0; D]; D]; corners]; corners];
    let spread = if points == 1 { 0.0 } else { 1.0 / 3f64.sqrt() };
    for point in 0..corners {
        let at: [f64; D] = std::array::from_fn(|d| 0.5 + (f64::from(corner::<D>(point, d)) - 0.5) * spread);
        let factor = |k: usize, d: usize| if corner::<D>(k, d) == 1 { at[d] } else { 1.0 - at[d] };
        let slope = |k: usize, d: usize| if corner::<D>(k, d) == 1 { 1.0 } else { -1.0 };
        let value = |k: usize| (0..D).map(|d| factor(k, d)).product::<f64>();
        let gradient = |k: usize| -> [f64; D] {
            std::array::from_fn(|d| (0..D).map(|e| if e == d { slope(k, e) } else { factor(k, e) }).product())
        };
        for a in 0..corners {
            for b in 0..corners {
                let (ga, gb) = (gradient(a), gradient(b));
                let dot: f64 = (0..D).map(|d| ga[d] * gb[d]).sum();
                for i in 0..D {
                    for k in 0..D {
                        let mut entry = ga[i] * gb[k] + ga[k] * gb[i];
                        if i == k {
                            entry += dot;
                            if let Kind::Shifted(shift) = kind {
                                entry -= shift * value(a) * value(b);
                            }
                        }
                        if kind == Kind::Unsymmetric {
                            entry += 0.3 * ga[i] * value(b);
                        }
                        blocks[a][b][i][k] += entry / corners as f64;
                    }
                }
            }
        }
    }
    blocks
}

impl<const D: usize> Part<D> {
    /// This rank's part of a body with this number of elements along each axis. Unless it is [`Kind::Loose`], the body
    /// is held at its left end and, along x, at the nodes whose last coordinate is 2.
    pub fn new(ranks: &Ranks, elements: [u32; D], kind: Kind) -> Self {
        let n_elements = elements.iter().product::<u32>();
        let place_of = |element: u32| -> [u32; D] {
            let mut rest = element;
            let mut place = [0; D];
            for d in (0..D).rev() {
                place[d] = rest % elements[d];
                rest /= elements[d];
            }
            place
        };
        let own: Vec<[u32; D]> = (0..n_elements)
            .filter(|element| (*element as usize * ranks.count() / n_elements as usize) == ranks.own())
            .map(place_of)
            .collect();
        let corner_of =
            |place: [u32; D], k: usize| -> [u32; D] { std::array::from_fn(|d| place[d] + corner::<D>(k, d)) };
        let corners = 1 << D;
        let mut all: Vec<(u32, [u32; D])> = own
            .iter()
            .flat_map(|place| (0..corners).map(|k| corner_of(*place, k)))
            .map(|place| (node_at(elements, place), place))
            .collect();
        all.sort_unstable();
        all.dedup();
        let (nodes, places): (Vec<u32>, Vec<[u32; D]>) = all.into_iter().unzip();
        let n_nodes = elements.iter().map(|n| n + 1).product::<u32>() as usize;
        let touched: Vec<(u32, bool)> = nodes.iter().map(|node| (*node, true)).collect();
        let halo = Halo::new(ranks, &nodes, &sharing(ranks, &touched, n_nodes));
        let numbering = Numbering::new(nodes.len(), |node, component| {
            kind == Kind::Loose || places[node][0] > 0 && (component > 0 || places[node][D - 1] != 2)
        });
        let symmetric = kind != Kind::Unsymmetric;
        let [strong, weak] = [stiffness::<D>(kind, 2), stiffness::<D>(kind, 1)];
        let mut columns: Vec<std::collections::BTreeMap<u32, Block<D>>> =
            vec![Default::default(); nodes.len()];
        for place in &own {
            let active: Vec<usize> = (0..corners)
                .map(|k| nodes.binary_search(&node_at(elements, corner_of(*place, k))).expect("an own node"))
                .collect();
            let is_weak = kind == Kind::Weak && place[0] + 1 == elements[0];
            let element = if is_weak { &weak } else { &strong };
            let stiff = 1.0 + f64::from(place[0] % 3) + 0.1 * f64::from(place[D - 1]);
            let stiff = if is_weak { 1e-8 * stiff } else { stiff };
            for a in 0..corners {
                for b in 0..corners {
                    if symmetric && active[a] < active[b] {
                        continue;
                    }
                    let block = columns[active[b]].entry(active[a] as u32).or_insert([[0.0; D]; D]);
                    for i in 0..D {
                        for k in 0..D {
                            block[i][k] += stiff * element[a][b][i][k];
                        }
                    }
                }
            }
        }
        let (mut column_start, mut row, mut blocks) = (vec![0], Vec::new(), Vec::new());
        for column in columns {
            row.extend(column.keys());
            blocks.extend(column.into_values());
            column_start.push(row.len());
        }
        if kind == Kind::NotFinite && ranks.own() + 1 == ranks.count() {
            blocks.iter_mut().for_each(|block| block[0][0] = f64::NAN);
        }
        let division = Division::new(&column_start, &row);
        Part { nodes, places, halo, numbering, symmetric, column_start, row, blocks, division }
    }

    /// A complete nodal field of arbitrary numbers.
    pub fn load(&self) -> Vec<[f64; D]> {
        let value = |node: u32, k: usize| (1.3 * f64::from(node) + 0.7 * k as f64).sin();
        self.nodes.iter().map(|node| std::array::from_fn(|k| value(*node, k))).collect()
    }

    /// The product of the matrix of all ranks with a complete field, zero at components that are not unknowns.
    pub fn product(&mut self, x: &[[f64; D]]) -> Vec<[f64; D]> {
        let free = self.clear_held(x);
        let mut out = vec![[0.0; D]; x.len()];
        let Part { symmetric, ref column_start, ref row, ref blocks, .. } = *self;
        let matrix = BlockMatrix { symmetric, column_start, row, blocks };
        matrix.multiply(&mut self.division, &free, &mut out);
        self.halo.add(&mut out);
        self.clear_held(&out)
    }

    fn clear_held(&self, field: &[[f64; D]]) -> Vec<[f64; D]> {
        let free = |(node, x): (usize, &[f64; D])| {
            std::array::from_fn(|k| if self.numbering.unknown(node, k).is_some() { x[k] } else { 0.0 })
        };
        field.iter().enumerate().map(free).collect()
    }

    /// Prepares a backend, factorises the matrix and solves for [`Part::load`].
    pub fn solve(
        &mut self,
        backend: &mut dyn Backend<D, D>,
        tolerance: f64,
    ) -> Result<(Solved, Vec<[f64; D]>), LinearError> {
        let b = self.load();
        self.solve_for(backend, &b, tolerance)
    }

    /// The same as [`Part::solve`], with the factor or preconditioner of an earlier matrix.
    pub fn solve_again(
        &mut self,
        backend: &mut dyn Backend<D, D>,
        tolerance: f64,
    ) -> Result<(Solved, Vec<[f64; D]>), LinearError> {
        let b = self.load();
        self.run(backend, &b, tolerance, false)
    }

    /// The same as [`Part::solve`], for another load.
    pub fn solve_for(
        &mut self,
        backend: &mut dyn Backend<D, D>,
        b: &[[f64; D]],
        tolerance: f64,
    ) -> Result<(Solved, Vec<[f64; D]>), LinearError> {
        self.run(backend, b, tolerance, true)
    }

    fn run(
        &mut self,
        backend: &mut dyn Backend<D, D>,
        b: &[[f64; D]],
        tolerance: f64,
        is_new: bool,
    ) -> Result<(Solved, Vec<[f64; D]>), LinearError> {
        let lattice = |node: usize| self.places[node];
        let layout = Layout {
            numbering: &self.numbering,
            nodes: &self.nodes,
            lattice: &lattice,
            position: &|node| self.places[node].map(f64::from),
            lines: [None; D],
            halo: &self.halo,
        };
        let Part { symmetric, ref column_start, ref row, ref blocks, .. } = *self;
        let matrix = BlockMatrix { symmetric, column_start, row, blocks };
        if is_new {
            backend.prepare(&layout, &matrix)?;
            backend.factorise(&layout, &matrix)?;
        }
        let mut x = vec![[f64::NAN; D]; self.nodes.len()];
        let mut stiffness = Stiffness { matrix, division: &mut self.division };
        let solved = backend.solve(&layout, &mut stiffness, b, &mut x, tolerance)?;
        Ok((solved, x))
    }
}

/// The solution of a whole body by the direct solver of the core.
pub fn expected<const D: usize>(elements: [u32; D], kind: Kind) -> (Factorisation, Vec<[f64; D]>) {
    let mut whole = Part::new(&Ranks::default(), elements, kind);
    let (solved, x) =
        whole.solve(&mut mpm_core::linear::DirectBackend::default(), 0.0).expect("a regular matrix");
    (solved.factorisation, x)
}

/// The largest deviation of a solution at own and foreign nodes, relative to the largest expected number.
pub fn deviation<const D: usize>(part: &Part<D>, x: &[[f64; D]], expected: &[[f64; D]]) -> f64 {
    let size = expected.as_flattened().iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    let pairs = part.nodes.iter().zip(x).flat_map(|(node, x)| x.iter().zip(&expected[*node as usize]));
    pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / size
}
