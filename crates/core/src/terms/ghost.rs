//! Ghost stabilisation: a penalty on jumps of the displacement gradient across the faces of cells that hold hardly any
//! material, after Coombs (2023), doi 10.1002/nme.7332, and Burman (2010), doi 10.1016/j.crma.2010.10.006.
//!
//! The stiffness of a cut cell tends to zero with the material in it, and so does the stiffness of its nodes if no
//! other cell supports them: the equations become ill-conditioned, round-off moves such nodes, and the iterations fail
//! to converge. The penalty extends the displacement field of the neighbouring cells smoothly into such a cell,
//!
//! f_G = Σ_faces ∫ γ G h ⟦∂N/∂n⟧ᵀ ⟦∂Δd/∂n⟧ dA,
//!
//! with the shear modulus G at rest of the surrounding material (the harmonic mean, because the gradient does jump
//! between soft and stiff material), the thickness h of the cells normal to the face and a number γ. Like the equations
//! of equilibrium, the penalty is written in the displacement increment of the step and in the configuration at the
//! start of the step. A linear increment (uniform strain, any translation, any linearised rotation) has no jump: patch
//! tests hold, and the forces have no resultant and no moment. f_G is linear in Δd, so Newton's method still converges
//! quadratically.
#![allow(non_snake_case)]

use std::collections::HashSet;

use crate::assembly::{System, Wanted};
use crate::basis::{BodyGroup, Connectivity};
use crate::grid::sides::sides_of;
use crate::grid::{CellBasis, Grid};
use crate::model::{Model, Stabilisation, StabilisationMode};
use crate::points::Points;
use crate::step::{At, StepContext};

use super::failure::{BeginError, EvaluateError};
use super::held_material::HeldMaterial;
use super::layout::Layout;
use super::ledger::{Ledger, NamedEnergy};
use super::report::TermReport;
use super::term::{Character, Coupled, Term};

/// Fraction of the penalty, [-], that acts on the faces of cells with few points: enough to resist hourglass modes,
/// which would otherwise have no stiffness, and too little to carry load where the material flows.
const OF_FEW_POINTS: f64 = 0.01;

/// What a penalty on jumps resists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Resists {
    /// Displacement increments, in proportion to the shear modulus.
    Displacement,
    /// Accelerations, in proportion to the density.
    Acceleration,
}

/// The stiffness of the penalty, face by face. It couples each axis only with itself, and is the same for all axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ghost {
    /// Index, in `nodes`, of the first node of each face.
    node_start: Vec<usize>,
    /// Active nodes of the two cells of each face, ascending.
    nodes: Vec<u32>,
    /// Lower triangle of the stiffness of each face by rows, [force/length].
    stiffness: Vec<f64>,
    /// Start of the stiffness of each face in `stiffness`.
    stiffness_start: Vec<usize>,
    /// For each entry of the stiffness of each face, the indices of its block and, if both triangles are stored, of the
    /// transposed block.
    places: Vec<[Option<usize>; 2]>,
}

/// A group of bodies whose cells are stabilised.
#[derive(Clone, Copy)]
struct Bodies<'a, const D: usize> {
    model: &'a Model<D>,
    links: &'a Connectivity<D>,
    held: &'a HeldMaterial,
    /// Cells with few points.
    few: &'a HashSet<(BodyGroup, u32)>,
    /// Number of the group.
    bodies: BodyGroup,
    resists: Resists,
}

impl Ghost {
    /// The faces to stabilise in a step that starts from the converged state, to which `links` belong.
    pub fn new<const D: usize>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Ghost {
        Ghost::with(model.stabilisation, Resists::Displacement, model, points, links)
    }

    /// The ghost mass with this factor, [-], on the faces of all cells at the boundary of the material and of cells of few
    /// points, unless the model rules stabilisation out: as the stiffness, with ρ h² in place of G.
    pub fn of_mass<const D: usize>(
        factor: f64,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) -> Ghost {
        // Bodies in motion disperse: nodes with hardly any mass lie at all cells of their boundary.
        let mode = match model.stabilisation.mode {
            StabilisationMode::Off => StabilisationMode::Off,
            StabilisationMode::Auto | StabilisationMode::On => StabilisationMode::On,
        };
        let stabilisation = Stabilisation { parameter: factor, mode, ..model.stabilisation };
        Ghost::with(stabilisation, Resists::Acceleration, model, points, links)
    }

    /// As [`Ghost::new`], with a stabilisation that need not be that of the model.
    fn with<const D: usize>(
        stabilisation: Stabilisation,
        resists: Resists,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) -> Ghost {
        let mut ghost = Ghost { node_start: vec![0], stiffness_start: vec![0], ..Ghost::default() };
        if stabilisation.mode == StabilisationMode::Off {
            return ghost;
        }
        let held = HeldMaterial::new(model, points, links);
        let few = cells_of_few_points(model, points, links);
        let few: HashSet<(BodyGroup, u32)> =
            links.reduction().gather_all(few).into_iter().flatten().collect();
        for bodies in 0..links.n_body_groups() as BodyGroup {
            ghost.add_faces(stabilisation, Bodies { model, links, held: &held, few: &few, bodies, resists });
        }
        ghost
    }

    /// Adds the faces between cells that a group of bodies touches, with the nodes that this group sees.
    fn add_faces<const D: usize>(&mut self, stabilisation: Stabilisation, of: Bodies<D>) {
        let Bodies { model, links, held, few, bodies, resists } = of;
        let Stabilisation { mode, parameter, filling } = stabilisation;
        let grid = model.grid.as_ref();
        let (own, beside) = (links.cells_of_bodies(bodies), links.layer_cells());
        let mut cells: Vec<u32> = own.iter().chain(beside).copied().collect();
        cells.sort_unstable();
        let is_active = |node: &u32| links.of_bodies(bodies, *node as usize).is_some();
        cells.retain(|&cell| grid.corners(cell as usize).nodes().iter().all(is_active));
        let (faces, mut weak) = faces_of(grid, &cells);
        if mode == StabilisationMode::Auto {
            weak.fill(false);
        }
        for (weak, &cell) in weak.iter_mut().zip(&cells) {
            *weak |= held.filling(model, links, bodies, cell) < filling;
        }
        let reduction = links.reduction();
        // Only where a cell has points is it known to be weak.
        let is_own = |cell: &u32| beside.binary_search(cell).is_err();
        let known = cells.iter().zip(&weak).filter(|(cell, weak)| **weak && is_own(cell));
        let all_weak = reduction.join(known.map(|(cell, _)| *cell).collect::<Vec<u32>>());
        let all_weak: HashSet<u32> = all_weak.into_iter().collect();
        weak.iter_mut().zip(&cells).for_each(|(weak, cell)| *weak = all_weak.contains(cell));
        // Among the ranks that have a face, the owner of its lowest node adds it.
        let is_ours = |nodes: &[u32]| {
            let lowest = nodes.iter().min().and_then(|node| links.of_bodies(bodies, *node as usize));
            lowest.is_some_and(|lowest| reduction.counts(lowest))
        };
        for Face { cells: [a, b], nodes } in faces.iter().filter(|face| is_ours(&face.nodes)) {
            let both = [cells[*a], cells[*b]];
            let strength = if weak[*a] || weak[*b] {
                parameter
            } else if both.iter().any(|cell| few.contains(&(bodies, *cell))) {
                match resists {
                    Resists::Displacement => OF_FEW_POINTS * parameter,
                    Resists::Acceleration => parameter,
                }
            } else {
                continue;
            };
            self.push(of, both, nodes, strength);
        }
    }

    /// Adds a face between two cells.
    fn push<const D: usize>(
        &mut self,
        Bodies { model, links, held, bodies, resists, .. }: Bodies<D>,
        cells: [u32; 2],
        face: &[u32],
        parameter: f64,
    ) {
        let grid = model.grid.as_ref();
        let mut nodes: Vec<u32> = Vec::with_capacity(12);
        for cell in cells {
            let corners = grid.corners(cell as usize);
            nodes.extend(
                corners.nodes().iter().filter_map(|n| links.of_bodies(bodies, *n as usize)).map(|n| n as u32),
            );
        }
        nodes.sort_unstable();
        nodes.dedup();
        let corners: Vec<[f64; D]> = face.iter().map(|n| grid.node_position(*n as usize)).collect();
        let places = quadrature::<D>(&corners);
        let area: f64 = places.iter().map(|p| p.weight).sum();
        let thickness = grid.thickness(cells.map(|cell| cell as usize), area);
        let modulus = match resists {
            Resists::Displacement => held.shear_modulus(&nodes),
            Resists::Acceleration => held.density(&nodes) * thickness * thickness,
        };
        let first = self.stiffness.len();
        self.stiffness.resize(first + nodes.len() * (nodes.len() + 1) / 2, 0.0);
        let mut jump = vec![0.0; nodes.len()];
        for QuadraturePoint { position, normal, weight } in &places {
            jump.fill(0.0);
            for (cell, sign) in cells.into_iter().zip([1.0, -1.0]) {
                let basis: CellBasis<D> = grid.basis_at(cell, position);
                for (node, gradient) in basis.nodes().iter().zip(basis.gradient()) {
                    let active = links.of_bodies(bodies, *node as usize);
                    let Some(place) = active.and_then(|n| nodes.binary_search(&(n as u32)).ok()) else {
                        continue;
                    };
                    jump[place] += sign * (0..D).map(|d| gradient[d] * normal[d]).sum::<f64>();
                }
            }
            let factor = parameter * modulus * thickness * weight * model.depth(position);
            let mut at = first;
            for a in 0..nodes.len() {
                for b in 0..=a {
                    self.stiffness[at] += factor * jump[a] * jump[b];
                    at += 1;
                }
            }
        }
        self.nodes.extend(nodes);
        self.node_start.push(self.nodes.len());
        self.stiffness_start.push(self.stiffness.len());
    }

    /// Number of faces.
    pub fn n_faces(&self) -> usize {
        self.node_start.len().saturating_sub(1)
    }

    /// Active nodes that a face couples, ascending.
    pub fn nodes_of(&self, face: usize) -> &[u32] {
        &self.nodes[self.node_start[face]..self.node_start[face + 1]]
    }

    /// Stiffness between the nodes of a face along each axis: the lower triangle by rows, [force/length].
    pub fn stiffness_of(&self, face: usize) -> &[f64] {
        &self.stiffness[self.stiffness_start[face]..self.stiffness_start[face + 1]]
    }

    /// The stiffness of all faces, one after the other, [force/length].
    pub(super) fn entries(&self) -> &[f64] {
        &self.stiffness
    }

    /// The indices of the blocks to which the stiffness of all faces is added.
    pub(super) fn places_in<const N: usize>(&self, sum: &System<N>) -> Vec<[Option<usize>; 2]> {
        let mut places = Vec::with_capacity(self.stiffness.len());
        for face in 0..self.n_faces() {
            let nodes = self.nodes_of(face);
            for (a, &row) in nodes.iter().enumerate() {
                for &column in &nodes[..=a] {
                    let [row, column] = [row, column].map(|node| node as usize);
                    let is_mirrored = !sum.is_symmetric() && row != column;
                    let mirror = if is_mirrored { sum.place(column, row) } else { None };
                    places.push([sum.place(row, column), mirror]);
                }
            }
        }
        places
    }

    /// Adds f_G, for the displacement increment of the active nodes along the first `axes` axes, [length], to the nodal
    /// forces, [force].
    pub fn add_force<const N: usize>(&self, axes: usize, delta_d: &[[f64; N]], force: &mut [[f64; N]]) {
        for face in 0..self.n_faces() {
            let (nodes, stiffness) = (self.nodes_of(face), self.stiffness_of(face));
            let mut at = 0;
            for (a, &row) in nodes.iter().enumerate() {
                for (b, &column) in nodes[..=a].iter().enumerate() {
                    for d in 0..axes {
                        force[row as usize][d] += stiffness[at] * delta_d[column as usize][d];
                        if a != b {
                            force[column as usize][d] += stiffness[at] * delta_d[row as usize][d];
                        }
                    }
                    at += 1;
                }
            }
        }
    }
}

impl<const D: usize, const N: usize> Term<D, N> for Ghost {
    fn name(&self) -> &'static str {
        "ghost stabilisation"
    }

    fn character(&self, _: &Model<D>) -> Character {
        Character { may_slump: true, ..Character::SMOOTH }
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        *self = Ghost::with(step.stabilisation(), Resists::Displacement, step.model, points, step.links);
        // With inertia, the force grows from zero over the step.
        self.stiffness.iter_mut().for_each(|stiffness| *stiffness *= step.weight());
        Ok(())
    }

    fn couples(&self, couple: &mut dyn FnMut(Coupled)) {
        (0..self.n_faces()).for_each(|face| couple(Coupled::Nodes(self.nodes_of(face))));
    }

    fn evaluate(
        &mut self,
        _: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        if wanted == Wanted::Stiffness {
            if self.places.is_empty() {
                self.places = self.places_in(sum);
            }
            for (places, stiffness) in self.places.iter().zip(&self.stiffness) {
                for &place in places.iter().flatten() {
                    for d in 0..D {
                        sum.blocks[place][d][d] += stiffness;
                    }
                }
            }
        }
        self.add_force(D, at.delta_d, sum.internal_force_mut());
        Ok(())
    }

    /// Work of the stabilisation from zero increment, ½ f_G·Δd, which is lost in the next step; with inertia, the mean
    /// force of the step works, f_G·Δd.
    fn ledger(&self, step: &StepContext<D>, _: &Points<D>, at: At<N>) -> Ledger {
        if self.n_faces() == 0 {
            return Ledger::default();
        }
        let mut force = vec![[0.0; N]; at.delta_d.len()];
        self.add_force(D, at.delta_d, &mut force);
        // The force includes only the faces of this rank.
        let work = force.iter().flatten().zip(at.delta_d.iter().flatten()).map(|(f, u)| f * u).sum::<f64>();
        let share = if step.dynamics().is_some() { 1.0 } else { 0.5 };
        [NamedEnergy::dissipated(Ledger::STABILISATION, share * work)].into()
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        report.stabilised_faces += self.n_faces();
    }

    fn layout(&mut self) -> Option<&mut dyn Layout> {
        Some(self)
    }
}

impl Layout for Ghost {
    fn forget_layout(&mut self) {
        self.places.clear();
    }
}

/// The cells that hold points, but too few to resist all motions of their nodes: the strain at one point of a
/// quadrilateral does not resist its hourglass modes, nor do the strains at three points of a hexahedron. Simplices
/// have no hourglass modes.
fn cells_of_few_points<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> HashSet<(BodyGroup, u32)> {
    let groups = (0..links.n_groups()).map(|group| links.points_of(group));
    let few = groups.filter(|range| range.len() < 1 << (D - 1)).map(|range| range.start);
    let few = few.map(|p| (links.bodies_with(points.body[p]), points.cell[p]));
    few.filter(|(_, cell)| model.grid.corners(*cell as usize).nodes().len() == 1 << D).collect()
}

/// A face between two cells.
struct Face {
    /// Indices of the cells in the list of cells.
    cells: [usize; 2],
    /// Its nodes, in order around the face.
    nodes: Vec<u32>,
}

/// The faces between cells of a list; and for each cell, whether it lies at the boundary of the list, that is, whether
/// it has a side that no other cell of the list shares and that is not at an edge of the grid where no cell is
/// cut.
fn faces_of<const D: usize>(grid: &dyn Grid<D>, cells: &[u32]) -> (Vec<Face>, Vec<bool>) {
    let sides = sides_of(grid, cells);
    let mut faces = Vec::new();
    let mut at_boundary = vec![false; cells.len()];
    for equal in sides.chunk_by(|a, b| a.key == b.key) {
        match equal {
            [a, b] => faces.push(Face { cells: [a.cell, b.cell], nodes: a.nodes.clone() }),
            [a] => at_boundary[a.cell] |= !grid.is_at_edge(&a.nodes),
            _ => {}
        }
    }
    // Sorting by cells makes the order independent of the node numbers.
    faces.sort_unstable_by_key(|face| face.cells);
    (faces, at_boundary)
}

/// A quadrature point of a face.
struct QuadraturePoint<const D: usize> {
    position: [f64; D],
    /// Unit normal.
    normal: [f64; D],
    /// Part of the length (area) of the face that belongs to the point, [length^(D−1)].
    weight: f64,
}

/// Gauss points of an edge or a quadrilateral, exact for products of two linear jumps; the centre of a triangle, over
/// which the jumps of tetrahedra are constant.
fn quadrature<const D: usize>(corners: &[[f64; D]]) -> Vec<QuadraturePoint<D>> {
    let g = 0.5 / 3f64.sqrt();
    let pair = [0.5 - g, 0.5 + g];
    let difference = |a: &[f64; D], b: &[f64; D]| -> [f64; D] { std::array::from_fn(|d| b[d] - a[d]) };
    match corners {
        [a, b] => {
            let along = difference(a, b);
            let length = along.iter().map(|x| x * x).sum::<f64>().sqrt();
            let mut normal = [0.0; D];
            (normal[0], normal[1]) = (along[1] / length, -along[0] / length);
            let point = |s: f64| QuadraturePoint {
                position: std::array::from_fn(|d| a[d] + s * along[d]),
                normal,
                weight: 0.5 * length,
            };
            pair.map(point).into()
        }
        [a, b, c] => {
            let (normal, twice) = cross(&difference(a, b), &difference(a, c));
            let position = std::array::from_fn(|d| (a[d] + b[d] + c[d]) / 3.0);
            vec![QuadraturePoint { position, normal, weight: 0.5 * twice }]
        }
        [a, b, c, e] => {
            let mut places = Vec::with_capacity(4);
            for (s, t) in pair.into_iter().flat_map(|s| pair.map(|t| (s, t))) {
                let mix = |f: &dyn Fn(usize) -> [f64; 4]| -> [f64; D] {
                    std::array::from_fn(|d| {
                        let w = f(d);
                        w[0] * a[d] + w[1] * b[d] + w[2] * c[d] + w[3] * e[d]
                    })
                };
                let position = mix(&|_| [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]);
                let along_s = mix(&|_| [t - 1.0, 1.0 - t, t, -t]);
                let along_t = mix(&|_| [s - 1.0, -s, s, 1.0 - s]);
                let (normal, area) = cross(&along_s, &along_t);
                places.push(QuadraturePoint { position, normal, weight: 0.25 * area });
            }
            places
        }
        _ => Vec::new(),
    }
}

/// Unit vector along a × b in space, and the length of a × b.
fn cross<const D: usize>(a: &[f64; D], b: &[f64; D]) -> ([f64; D], f64) {
    let entry = |d: usize| {
        let (i, j) = ((d + 1) % D, (d + 2) % D);
        a[i] * b[j] - a[j] * b[i]
    };
    let product: [f64; D] = std::array::from_fn(entry);
    let length = product.iter().map(|x| x * x).sum::<f64>().sqrt();
    (product.map(|x| x / length), length)
}
