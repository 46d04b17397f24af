//! Random converged states with large deformation, and random displacement increments from them.

use mpm::basis::{Connectivity, DomainKind, Method};
use mpm::domain::DomainUpdate;
use mpm::grid::{Axis, Grid, Interval, Structured};
use mpm::material::{
    Elasticity, Hencky, Material, MaterialError, NeoHookean, Response, StateField, StrainMeasure, VonMises,
};
use mpm::model::{Body, Model, NamedMaterial, Newton, Stabilisation, StabilisationMode, Stepping};
use mpm::points::{PointVolume, Points, Seed};
use mpm::stress::{Formulation, Mechanics};
use mpm::tensor::{Mat3, Sym3, Tangent};

/// Pseudo-random numbers (splitmix64), equal in every run.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Laws of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    Hencky,
    NeoHookean,
    /// With a yield stress such that some points of a state stay elastic.
    VonMises,
    /// Two bodies, one of each law, with points in the same cells.
    Both,
    /// The law [`Skewed`].
    Skewed,
}

/// A linear law whose tangent lacks major symmetry, as under non-associated flow.
#[derive(Debug)]
pub struct Skewed(Tangent);

impl Skewed {
    fn new() -> Self {
        let mut tangent = Elasticity::from_young_poisson(2e6, 0.25).tangent();
        for (row, column, by) in [(0, 1, 0.5e6), (1, 5, -0.3e6), (5, 0, 0.4e6), (2, 0, 0.2e6), (0, 2, -0.1e6)]
        {
            tangent[(row, column)] += by;
        }
        Skewed(tangent)
    }
}

impl Material for Skewed {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        Ok(Response { tau: trial.contract(&self.0), elastic_strain: *trial, tangent: self.0 })
    }

    fn energy(&self, _: &Sym3, _: &[f64]) -> f64 {
        0.0 // this law has no energy
    }

    fn tangent_is_symmetric(&self) -> bool {
        false
    }
}

const LAWS: [Law; 5] = [Law::Hencky, Law::NeoHookean, Law::VonMises, Law::Both, Law::Skewed];

/// Each method with each law.
pub fn cases() -> Vec<(Method, Law)> {
    with_laws(&[Method::Mpm, Method::Gimp, Method::Cpdi1, Method::Cpdi2])
}

/// Each of these methods with each law.
pub fn with_laws(methods: &[Method]) -> Vec<(Method, Law)> {
    methods.iter().flat_map(|method| LAWS.map(|law| (*method, law))).collect()
}

pub const FORMULATIONS: [Formulation; 2] = [Formulation::PreviouslyConverged, Formulation::UpdatedLagrangian];

/// A model, a converged state of its points, their links, and a displacement increment.
pub struct State<const D: usize> {
    pub model: Model<D>,
    pub points: Points<D>,
    pub links: Connectivity<D>,
    pub delta_d: Vec<[f64; D]>,
}

/// Points at random positions in a grid of oblong cells, some with domains that extend beyond the grid. The components
/// of the elastic strain are up to ±0.2, those of F − I up to ±0.3; the increment stretches, shears and rotates, with
/// noise at the nodes.
pub fn random_state<const D: usize, M: Mechanics<D>>(
    method: Method,
    law: Law,
    n_points: usize,
    seed: u64,
) -> State<D> {
    state_with::<D, M>(method, Domain::Box, law, n_points, seed)
}

/// Shape of domains with corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Quadrilaterals, hexahedra.
    Box,
    /// Triangles, tetrahedra.
    #[allow(dead_code, reason = "not every test program uses it")]
    Simplex,
}

/// The same as [`random_state`], with domains of this shape.
pub fn state_with<const D: usize, M: Mechanics<D>>(
    method: Method,
    domain: Domain,
    law: Law,
    n_points: usize,
    seed: u64,
) -> State<D> {
    state_on::<D, M>(Box::new(few_cells()), 0.1, (method, domain), law, n_points, seed)
}

/// The same as [`random_state`], on a grid of the same extent whose cells grow and shrink along the first two axes.
#[allow(dead_code, reason = "not every test program uses it")]
pub fn graded_random_state<const D: usize, M: Mechanics<D>>(
    method: Method,
    law: Law,
    n_points: usize,
    seed: u64,
) -> State<D> {
    let even = few_cells::<D>();
    let (low, high, cells) = (even.origin(), even.upper(), even.cells());
    let axis = |d: usize| {
        let (first, last) = [(0.3, 1.3), (0.25, 0.8)][d];
        let middle = Interval { to: low[d] + first * (high[d] - low[d]), cells: 1, ratio: 1.0 };
        Axis::from_intervals(low[d], &[middle, Interval { to: high[d], cells: cells[d] - 1, ratio: last }])
            .unwrap()
    };
    let graded = |d: usize| if d < 2 { axis(d) } else { even.axes()[d].clone() };
    let grid = Structured::with_axes(std::array::from_fn(graded));
    state_on::<D, M>(Box::new(grid), 0.1, (method, Domain::Box), law, n_points, seed)
}

/// A grid of few cells, well to the right of the axis x = 0.
fn few_cells<const D: usize>() -> Structured<D> {
    let cells = if D == 2 { [6, 5, 1] } else { [3, 3, 2] };
    even_grid(std::array::from_fn(|d| cells[d]))
}

fn even_grid<const D: usize>(cells: [usize; D]) -> Structured<D> {
    let low = std::array::from_fn(|d| [1.6, 0.2, -0.4][d]);
    Structured::new(low, std::array::from_fn(|d| SPACING[d]), cells)
}

/// The same as [`random_state`], on a grid large enough for several batches, with domains inside it.
#[allow(dead_code, reason = "not every test program uses it")]
pub fn large_random_state<M: Mechanics<2>>(method: Method, law: Law, n_points: usize, seed: u64) -> State<2> {
    state_on::<2, M>(Box::new(even_grid([24, 20])), 0.4, (method, Domain::Box), law, n_points, seed)
}

const SPACING: [f64; 3] = [0.5, 0.4, 0.6];

/// The same as [`random_state`], on a given grid that the points fill, with positions at least `margin` away from its
/// bounds.
pub fn state_on<const D: usize, M: Mechanics<D>>(
    grid: Box<dyn Grid<D>>,
    margin: f64,
    (method, shape): (Method, Domain),
    law: Law,
    n_points: usize,
    seed: u64,
) -> State<D> {
    let random = &mut Random(seed);
    let [low, high] = grid.bounds();
    let hencky = || Box::new(Hencky::new(2e6, 0.25)) as Box<dyn Material>;
    let von_mises = || Box::new(VonMises::new(1e6, 0.3, 0.25e6).hardening(0.2e6)) as Box<dyn Material>;
    let laws = match law {
        Law::Hencky => vec![hencky()],
        Law::NeoHookean => vec![Box::new(NeoHookean::new(2e6, 0.25)) as Box<dyn Material>],
        Law::VonMises => vec![von_mises()],
        Law::Both => vec![hencky(), von_mises()],
        Law::Skewed => vec![Box::new(Skewed::new()) as Box<dyn Material>],
    };
    let seeds: Vec<Seed<D>> = (0..n_points)
        .map(|p| {
            let body = p % laws.len();
            let domain = method.domain() != DomainKind::None;
            // Corners of distorted domains must stay inside the grid, and hexahedra must not cross themselves.
            let given_by_corners = method.domain() == DomainKind::Corners;
            let (most, noise, room) = if D == 2 { (0.7, 0.4, 0.6) } else { (0.35, 0.2, 0.3) };
            let most = if given_by_corners { most } else { 0.7 };
            let margin = if given_by_corners { room } else { margin };
            let half_lengths: [f64; D] =
                std::array::from_fn(|d| if domain { SPACING[d] * random.within(0.05, most) } else { 0.0 });
            let position: [f64; D] =
                std::array::from_fn(|d| random.within(low[d] + margin, high[d] - margin));
            let numbers: Vec<usize> = match (given_by_corners, shape) {
                (false, _) => Vec::new(),
                (true, Domain::Box) => (0..1 << D).collect(),
                (true, Domain::Simplex) => (0..=D).map(|k| if k == 0 { 0 } else { 1 << (k - 1) }).collect(),
            };
            let corners = numbers.iter().map(|c| {
                std::array::from_fn(|d| {
                    let side = if c >> d & 1 == 1 { 1.0 } else { -1.0 };
                    position[d] + half_lengths[d] * (side + random.within(-noise, noise))
                })
            });
            Seed {
                body: body as u16,
                position,
                half_lengths,
                corners: corners.collect(),
                volume: random.within(0.01, 0.05),
                mass: 0.0,
                outer_layer: false,
                history: laws[body].state_fields().iter().map(|f| f.initial).collect(),
            }
        })
        .collect();
    let bodies = (0..laws.len())
        .map(|material| Body {
            name: format!("body {material}"),
            material,
            method,
            domain_update: DomainUpdate::Corners,
            strain: Default::default(),
            split_above: None,
        })
        .collect();
    let model = Model {
        title: String::new(),
        grid,
        revolved: M::REVOLVED,
        formulation: Formulation::PreviouslyConverged,
        point_volume: PointVolume::Deformation,
        stabilisation: Stabilisation { mode: StabilisationMode::Off, ..Stabilisation::default() },
        materials: laws.into_iter().map(|law| NamedMaterial { name: "law".into(), law }).collect(),
        bodies,
        surfaces: Vec::new(),
        boundary_conditions: Vec::new(),
        loads: Vec::new(),
        stepping: Stepping::fixed(1, 1.0),
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
    };
    let mut points = Points::new(&seeds);
    for p in 0..points.len() {
        let (strain, f) = deformed::<D, M>(random);
        points.converged.elastic_strain[p] = match model.law(&points, p).strain_measure() {
            StrainMeasure::Logarithmic => strain,
            StrainMeasure::LeftCauchyGreen => {
                (strain.map_eigenvalues(|e| (2.0 * e).exp()) - Sym3::IDENTITY) * 0.5
            }
        };
        points.converged.deformation_gradient[p] = f;
    }
    let methods = vec![method; model.bodies.len()];
    let links = Connectivity::new(model.grid.as_ref(), &mut points, &methods).unwrap();
    // Displacement gradient of the increment.
    let slope = if D == 2 {
        [[0.25, 0.45, 0.0], [-0.3, -0.1, 0.0], [0.0; 3]]
    } else {
        [[0.25, 0.35, -0.2], [-0.3, -0.1, 0.15], [0.2, -0.25, 0.1]]
    };
    let delta_d = links
        .active_nodes()
        .iter()
        .map(|&node| {
            let place = model.grid.node_position(node as usize);
            let from_middle = |d: usize| place[d] - 0.5 * (low[d] + high[d]);
            std::array::from_fn(|i| {
                let linear: f64 = (0..D).map(|j| slope[i][j] * from_middle(j)).sum();
                linear + random.within(-0.06, 0.06)
            })
        })
        .collect();
    State { model, points, links, delta_d }
}

/// A logarithmic elastic strain and a deformation gradient, with z a principal direction in two dimensions.
fn deformed<const D: usize, M: Mechanics<D>>(random: &mut Random) -> (Sym3, Mat3) {
    let mut noise = |size: f64| random.within(-size, size);
    if D == 3 {
        let strain = Sym3(std::array::from_fn(|_| noise(0.15)));
        return (strain, Mat3::identity() + Mat3::from_fn(|_, _| noise(0.2)));
    }
    let strain = Sym3([noise(0.2), noise(0.2), noise(0.2), 0.0, 0.0, noise(0.2)]);
    let (a, b, c, d) = (1.0 + noise(0.3), noise(0.3), noise(0.3), 1.0 + noise(0.3));
    let around = if M::REVOLVED { 1.0 + noise(0.3) } else { 1.0 };
    (strain, Mat3::new(a, b, 0.0, c, d, 0.0, 0.0, 0.0, around))
}
