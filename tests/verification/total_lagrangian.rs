//! Equilibrium at growing loads on one grid, from one converged state: finite elements whose integration points are the
//! material points.
//!
//! This is the same problem as a load step of the method. If one step is as large as a whole finite element analysis,
//! Newton's method needs intermediate loads; these continue the iterations on the same grid and commit nothing.

use mpm::assembly::Wanted;
use mpm::basis::Connectivity;
use mpm::dofs::DofMap;
use mpm::linear::{Backend, DirectBackend, Layout};
use mpm::model::Model;
use mpm::points::Points;
use mpm::ranks::Halo;
use mpm::step::{At, Step, StepContext};
use mpm::stress::Mechanics;
use mpm::terms::{Sum, model_terms};

/// A body in equilibrium under its whole load.
pub struct Equilibrium<const D: usize> {
    pub model: Model<D>,
    /// The points; their trial state is the state under the load.
    pub points: Points<D>,
    pub links: Connectivity<D>,
    /// Displacements of the active nodes.
    pub displacement: Vec<[f64; D]>,
    /// Forces that hold the active nodes.
    pub reaction: Vec<[f64; D]>,
}

impl<const D: usize> Equilibrium<D> {
    /// Position of an active node on the grid.
    pub fn place(&self, active: usize) -> [f64; D] {
        self.model.grid.node_position(self.links.active_nodes()[active] as usize)
    }

    /// The active node at a position.
    pub fn node_at(&self, position: [f64; D]) -> usize {
        let is_there = |a: &usize| (0..D).all(|d| (self.place(*a)[d] - position[d]).abs() < 1e-9);
        (0..self.links.n_active()).find(is_there).unwrap_or_else(|| panic!("no node at {position:?}"))
    }
}

/// Equilibrium of a model under its loads and prescribed displacements at time 1, in parts that are halved if Newton's
/// method fails.
pub fn equilibrium<const D: usize, M: Mechanics<D>>(
    model: Model<D>,
    mut points: Points<D>,
) -> Equilibrium<D> {
    let methods = model.methods();
    let links =
        Connectivity::new(model.grid.as_ref(), &mut points, &methods).unwrap_or_else(|e| panic!("{e:?}"));
    let mut displacement = vec![[0.0; D]; links.n_active()];
    let mut rate = displacement.clone();
    let mut reaction = displacement.clone();
    let (mut time, mut part) = (0.0, 0.125);
    while time < 1.0 {
        let step = Step { index: 1, start: 0.0, end: time + part };
        let context =
            StepContext { model: &model, links: &links, step, factor: 0.0, viscosity: 0.0, experiment: None };
        let mut next = displacement.clone();
        for (u, rate) in next.iter_mut().zip(&rate) {
            (0..D).for_each(|d| u[d] += part * rate[d]);
        }
        match balance::<D, M>(&context, &mut points, &mut next) {
            Ok(held) => {
                for ((rate, from), to) in rate.iter_mut().zip(&displacement).zip(&next) {
                    *rate = std::array::from_fn(|d| (to[d] - from[d]) / part);
                }
                (displacement, reaction, time) = (next, held, time + part);
            }
            Err(residuals) => {
                part *= 0.5;
                assert!(part > 1e-3, "no equilibrium beyond {time}: {residuals:?}");
            }
        }
    }
    Equilibrium { points, displacement, reaction, links, model }
}

/// Newton's method for the displacements at the end of a step; returns the forces that hold the nodes, or the residuals
/// if it fails.
fn balance<const D: usize, M: Mechanics<D>>(
    context: &StepContext<D>,
    points: &mut Points<D>,
    displacement: &mut [[f64; D]],
) -> Result<Vec<[f64; D]>, Vec<f64>> {
    let StepContext { model, links, step, .. } = *context;
    let dofs = DofMap::new(model, points, links, step.start, step.end).unwrap_or_else(|e| panic!("{e:?}"));
    let layout = Layout {
        numbering: dofs.numbering(),
        nodes: links.active_nodes(),
        lattice: &|active| model.grid.lattice(links.active_nodes()[active] as usize),
        position: &|active| model.grid.node_position(links.active_nodes()[active] as usize),
        lines: [None; D],
        halo: &Halo::default(),
    };
    let mut sum =
        Sum::begun(model_terms::<D, D, M>(model), context, points).unwrap_or_else(|e| panic!("{e:?}"));
    let mut backend = DirectBackend::default();
    backend.prepare(&layout, &sum.system().matrix()).unwrap_or_else(|e| panic!("{e:?}"));
    let zero = vec![[0.0; D]; links.n_active()];
    let mut residuals = Vec::new();
    loop {
        if sum.evaluate(context, points, At::new(displacement), Wanted::Stiffness).is_err() {
            return Err(residuals);
        }
        let system = sum.system_mut();
        let mut lacking = system.external_force().clone();
        for (f, internal) in lacking.iter_mut().zip(system.internal_force()) {
            (0..D).for_each(|d| f[d] -= internal[d]);
        }
        let held: Vec<[f64; D]> = lacking.iter().map(|f| f.map(|f| -f)).collect();
        let mut motion = zero.clone();
        let has_moved = dofs.remaining(displacement, &mut motion);
        let mut product = zero.clone();
        system.multiply(&motion, &mut product);
        for (f, product) in lacking.iter_mut().zip(&product) {
            (0..D).for_each(|d| f[d] -= product[d]);
        }
        dofs.on_unknowns(&mut lacking);
        let size = |force: &[[f64; D]]| force.as_flattened().iter().fold(0.0f64, |m, f| m.max(f.abs()));
        residuals.push(size(&lacking) / size(&held).max(size(system.external_force())));
        // If stresses are ten thousand times smaller than the bulk modulus, round-off ends the iterations earlier.
        let is_small = match *residuals {
            [.., before, last] => last < 1e-9 || (last < 1e-6 && last > 0.1 * before),
            _ => false,
        };
        if !has_moved && is_small {
            return Ok(held);
        }
        if residuals.len() > 12 {
            return Err(residuals);
        }
        let mut change = zero.clone();
        backend.factorise(&layout, &system.matrix()).unwrap_or_else(|e| panic!("{e:?}"));
        let mut stiffness = system.reduced(&dofs);
        backend
            .solve(&layout, &mut stiffness, &lacking, &mut change, 1e-12)
            .unwrap_or_else(|e| panic!("{e:?}"));
        dofs.add_unknowns(&change, &mut motion);
        for (u, by) in displacement.iter_mut().zip(&motion) {
            (0..D).for_each(|d| u[d] += by[d]);
        }
    }
}
