//! Models of a single body in space.

use std::path::Path;

use mpm::basis::{DomainKind, Method};
use mpm::domain::DomainUpdate;
use mpm::formula::Formula;
use mpm::grid::subdivide::{ElementPart, subdivide_box, subdivide_tetrahedron};
use mpm::grid::{Grid, Mesh, Structured, gmsh};
use mpm::material::Material;
use mpm::model::{
    Body, BoundaryCondition, LoadCurve, Model, NamedMaterial, Newton, NodeSet, Stabilisation,
    StabilisationMode, Stepping,
};
use mpm::points::{PointVolume, Points, Seed};
use mpm::solver::{self, Observer, Reached, SolveError, StepReport};
use mpm::stress::Formulation;
use mpm::tensor::{Mat3, Sym3};

/// A mesh of `tests/data/mesh`.
pub fn mesh(name: &str) -> Mesh<3> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mesh").join(format!("{name}.msh"));
    Mesh::from_gmsh(&gmsh::read_file(&path).unwrap()).unwrap()
}

/// The cells of a structured grid that have their centres in a box.
pub fn cells_in(grid: &Structured<3>, low: [f64; 3], high: [f64; 3]) -> Vec<u32> {
    let inside = |cell: &u32| {
        let index = grid.cell_index(*cell as usize);
        (0..3).all(|d| {
            let x = grid.axes()[d].position(index[d] as f64 + 0.5);
            low[d] < x && x < high[d]
        })
    };
    (0..grid.n_cells() as u32).filter(inside).collect()
}

/// Method of a body and its number of points.
#[derive(Debug, Clone, Copy)]
pub struct Filling {
    pub method: Method,
    /// Number of parts along each axis of a hexahedron; a tetrahedron is divided into as many parts as their product.
    pub n: [usize; 3],
    pub density: f64,
}

/// The points of a body of whole cells. The points of the cells at its boundary form the outer layer.
pub fn fill(grid: &dyn Grid<3>, cells: &[u32], filling: Filling, law: &dyn Material) -> Vec<Seed<3>> {
    let mut owners = vec![0; grid.n_nodes()];
    let mut others = vec![0; grid.n_nodes()];
    let mut in_body = vec![false; grid.n_cells()];
    cells.iter().for_each(|cell| in_body[*cell as usize] = true);
    for (cell, is_in) in in_body.iter().enumerate() {
        let count = if *is_in { &mut owners } else { &mut others };
        grid.corners(cell).nodes().iter().for_each(|node| count[*node as usize] += 1);
    }
    // Nodes on the boundary of the body belong to other cells, too, or lie on the boundary of the grid.
    let [low, high] = grid.bounds();
    let on_border = |node: u32| {
        let x = grid.node_position(node as usize);
        others[node as usize] > 0 || (0..3).any(|d| x[d] == low[d] || x[d] == high[d])
    };
    let mut seeds = Vec::new();
    for &cell in cells {
        let corners = grid.corners(cell as usize);
        let outer_layer = corners.nodes().iter().any(|node| on_border(*node));
        let x: Vec<[f64; 3]> = corners.nodes().iter().map(|n| grid.node_position(*n as usize)).collect();
        let parts = match *x {
            [a, b, c, d] => subdivide_tetrahedron(&[a, b, c, d], filling.n.iter().product()).unwrap(),
            _ => subdivide_box(&x, filling.n).unwrap(),
        };
        seeds.extend(parts.into_iter().map(|part| seed(part, filling, outer_layer, law)));
    }
    seeds
}

fn seed(part: ElementPart<3>, filling: Filling, outer_layer: bool, law: &dyn Material) -> Seed<3> {
    let domain = filling.method.domain();
    let extent = |d: usize| {
        let along = part.corners.iter().map(|x| x[d]);
        0.5 * (along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min))
    };
    Seed {
        body: 0,
        position: part.position,
        half_lengths: if domain == DomainKind::Box { std::array::from_fn(extent) } else { [0.0; 3] },
        volume: part.volume,
        mass: filling.density * part.volume,
        outer_layer,
        history: law.state_fields().iter().map(|f| f.initial).collect(),
        corners: if domain == DomainKind::Corners { part.corners } else { Vec::new() },
    }
}

/// A model of one body, without boundary conditions and loads.
pub fn model(
    grid: impl Grid<3> + 'static,
    law: impl Material + 'static,
    method: Method,
    domain_update: DomainUpdate,
    n_steps: usize,
) -> Model<3> {
    Model {
        title: String::new(),
        grid: Box::new(grid),
        formulation: Formulation::PreviouslyConverged,
        point_volume: PointVolume::Deformation,
        stabilisation: Stabilisation { mode: StabilisationMode::Off, ..Stabilisation::default() },
        revolved: false,
        materials: vec![NamedMaterial { name: "law".into(), law: Box::new(law) }],
        bodies: vec![Body {
            name: "body".into(),
            material: 0,
            method,
            domain_update,
            strain: Default::default(),
            split_above: None,
        }],
        surfaces: Vec::new(),
        boundary_conditions: Vec::new(),
        loads: Vec::new(),
        stepping: Stepping::fixed(n_steps, 1.0),
        newton: Newton::default(),
        probes: Vec::new(),
        tools: Vec::new(),
        contacts: Vec::new(),
        body_groups: Default::default(),
        water: None,
        initial_imbalance: None,
        stages: Vec::new(),
        moving_grid: None,
        present: Default::default(),
        engines: Default::default(),
    }
}

/// A boundary condition that moves nodes by (ΔF − I)(x − centre) in each of `n_steps` steps.
pub fn homogeneous(
    nodes: NodeSet,
    increment: &Mat3,
    centre: [f64; 3],
    n_steps: usize,
) -> BoundaryCondition<3> {
    let change = increment - Mat3::identity();
    let displacement = [0, 1, 2].map(|i| {
        let term = |d: usize| {
            format!("{n_steps} * ({:e}) * ({} - ({:e}))", change[(i, d)], ["x", "y", "z"][d], centre[d])
        };
        let text = [0, 1, 2].map(term).join(" + ");
        Some(Formula::parse(&text, &["x", "y", "z", "factor"]).unwrap())
    });
    BoundaryCondition { name: "moved".into(), nodes, displacement, axes: None, curve: LoadCurve::ramp(1.0) }
}

/// The nodes of a grid whose positions satisfy a predicate.
pub fn nodes_where(grid: &dyn Grid<3>, holds: impl Fn([f64; 3]) -> bool) -> NodeSet {
    NodeSet::Fixed((0..grid.n_nodes() as u32).filter(|n| holds(grid.node_position(*n as usize))).collect())
}

/// A boundary condition that fixes nodes along some axes.
pub fn fixed(name: &str, nodes: NodeSet, axes: [bool; 3]) -> BoundaryCondition<3> {
    let displacement = axes.map(|fixed| fixed.then(|| Formula::constant(0.0)));
    BoundaryCondition { name: name.into(), nodes, displacement, axes: None, curve: LoadCurve::ramp(1.0) }
}

/// Rotation by an angle, [rad], about an axis.
pub fn rotation(axis: [f64; 3], angle: f64) -> Mat3 {
    let axis = nalgebra::Unit::new_normalize(nalgebra::Vector3::from(axis));
    nalgebra::Rotation3::from_axis_angle(&axis, angle).into_inner()
}

/// ½ ln(F Fᵀ).
pub fn logarithmic_strain(f: &Mat3) -> Sym3 {
    Sym3::symmetric_part(&(f * f.transpose())).map_eigenvalues(f64::ln) * 0.5
}

/// An observer that passes every converged step to a closure.
struct Watcher<F>(F);

impl<F: FnMut(&Points<3>, &StepReport<3>)> Observer<3> for Watcher<F> {
    fn converged(
        &mut self,
        _: &Model<3>,
        points: &Points<3>,
        report: &StepReport<3>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.0(points, report);
        Ok(())
    }
}

/// Runs a model and passes every converged step to `look`.
pub fn watch(
    model: &Model<3>,
    points: &mut Points<3>,
    look: impl FnMut(&Points<3>, &StepReport<3>),
) -> Result<Reached, SolveError> {
    solver::run(model, points, &mut Watcher(look))
}
