//! An implicit material point method for solids at finite deformation, in equilibrium and in motion with inertia.
//!
//! Bodies are sets of material points, which carry mass, deformation, stress and history. Each load step solves
//! equilibrium on a background grid with Newton's method, moves the points with the grid, and discards the deformed
//! grid: the next step starts on an undeformed grid.
//!
//! The formulation is that of Coombs et al., *Comput. Methods Appl. Mech. Engrg.* 358 (2020) 112622. Equation and
//! section numbers in this documentation refer to that paper; `docs/theory.md` derives everything that goes beyond the
//! paper.
//!
//! # Running an analysis
//!
//! [`solver::run`] takes a [`model::Model`] (grid, materials, boundary conditions, loads, step control) and
//! [`points::Points`] (the state of the bodies), and advances the points load step by load step. `examples/block.rs`
//! builds a complete analysis in code; `examples/own_term.rs` adds a term to the equilibrium equations in code outside
//! the crate, and `examples/temperature.rs` a second field of unknowns, through stages, files and a restart. Most
//! analyses are built from YAML decks by the crate `mpm-deck`.
//!
//! # Modules
//!
//! Read `examples/load_step.rs` first: it solves one load step in plain loops, equation by equation. Then start with
//! `solver/load_step.rs`, one attempt at a load step, and `solver/newton.rs`, its iterations. `docs/theory.md` ends
//! with the steps for adding a law, a term, a method, a grid or a linear solver, and with a list of where each equation
//! is implemented.
//!
//! | Task | Modules |
//! |---|---|
//! | Load steps and Newton iterations | [`solver`]; [`step`], the context of a load step; [`equilibrium`], the report of a converged step with its energy balance |
//! | Data of an analysis | [`model`], constant during a stage; [`points`], the material points. Iterations write to [`points::Points::trial`]; only [`points::Points::commit`] copies it to [`points::Points::converged`] |
//! | Background grid | [`grid`]: the trait [`grid::Grid`] locates cells and provides their linear basis; [`grid::Structured`] is a grid of rectangles or bricks, whose lines along each [`grid::Axis`] are even or graded and can move between steps ([`model::MovingGrid`]); [`grid::Mesh`] is an unstructured mesh, read by [`grid::gmsh`] |
//! | Basis functions | [`basis`]: one file per material point method (MPM, GIMP, CPDI); [`domain`]: update of GIMP domains. The corners of CPDI domains, [`points::State::corners`], are moved by [`solver`] at the end of a step |
//! | Kernel of a point | [`kinematics`]: deformation increment; [`material`]: constitutive laws; [`stress`]: stress P̃ and tangent Ã in three dimensions ([`stress::Solid`]), plane strain ([`stress::PlaneStrain`]) and axisymmetry ([`stress::Axisymmetric`]); [`tensor`]: tensors and their spectral functions |
//! | Element tests | [`element_test`]: a single point of a law follows a path of strain or stress, as in the laboratory |
//! | Equilibrium equations | [`terms`]: the material points (f^int and K, eqs. (19)-(23), gradients mapped by eq. (8)), external forces, ghost stabilisation, surfaces, and contact with rigid tools ([`terms::Contact`]), each of which adds force and stiffness to the [`assembly::System`]; [`dofs`]: displacements prescribed along axes or inclined directions, ties, free degrees of freedom |
//! | Linear solvers | [`linear`]: the trait [`linear::Backend`], the direct backend and the multigrid backend |
//! | Quality of results | [`quality`]: measures of numerical quality, and the warnings derived from them |
//! | Surfaces of bodies | [`surface`]: samples of the boundary of a body, carried by the grid, for tractions, pressures and weakly prescribed motions |
//! | Geometry | [`region`]: primitives, closed surfaces from STL files, booleans and motions, with their volumes; [`formula`]: formulas in position and time; [`tool`]: shapes of rigid tools, their closest points, and poses |
//! | Many machines | [`ranks`]: the processes that share an analysis, each with the points in its part of the grid; [`ranks::Halo`]: the nodes that several processes touch; [`ranks::Reduction`]: sums, products and decisions over a whole run, for code that need not know of ranks |
//! | Resources | [`memory`]: memory limits; [`timing`]: time per phase of a run |
//!
//! This crate does not depend on the other crates of `mpm`: `mpm-files` writes results, `mpm-deck` builds a model and
//! points from a deck, `mpm-report` renders results as a page. This crate never prints and never exits.
//!
//! # Symbols
//!
//! The table maps the symbols of the paper to names in the code. In interfaces, names are words; inside kernels, the
//! symbols of the paper are kept, including capital letters.
//!
//! | Paper | Code | Meaning |
//! |---|---|---|
//! | X̃, x_p | [`position`](points::State::position) | position of a point at the start (converged) and end (trial) of the step |
//! | X | [`original_position`](points::Points::original_position) | original position |
//! | F, F_n | [`deformation_gradient`](points::State::deformation_gradient) | deformation gradient, trial and converged; `F` in [`domain`] |
//! | ΔF, ΔJ | [`dF`](kinematics::Increment::dF), `dJ` | increment of F over the step, eq. (7), and its determinant |
//! | J_n | [`J_n`](stress::StartOfStep::J_n) | det F_n |
//! | b^e_n | [`b_n`](stress::StartOfStep::b_n) | elastic left Cauchy-Green strain at the start of the step |
//! | ε^e | [`elastic_strain`](points::State::elastic_strain) | elastic logarithmic strain, ½ ln b^e (or ½ (b^e − I), see [`StrainMeasure`](material::StrainMeasure)) |
//! | τ | [`kirchhoff_stress`](points::State::kirchhoff_stress), `tau` | Kirchhoff stress |
//! | V P̃, V Ã | [`stress`](stress::InPlane::stress), [`tangent`](stress::InPlane::tangent) | stress of eq. (18) and its derivative (A.3), times the volume, in plane strain, formed by `plane_strain::previous`; in space, [`Spatial`](stress::Spatial) has the equivalent in the current configuration |
//! | V σ, V a | [`stress`](stress::Current::stress), [`tangent`](stress::Current::tangent) | stress and tangent of the updated Lagrangian formulation, eqs. (2)-(6) |
//! | D^alg | [`tangent`](material::Response::tangent) | algorithmic (consistent) tangent of the law |
//! | L | [`log_with_derivative`](tensor::log_with_derivative), `L` | derivative of the logarithm, eq. (A.2) |
//! | V_p^0, V_p^n | [`original_volume`](points::Points::original_volume), [`volume_n`](stress::StartOfStep::volume_n), by [`Model::volume`](model::Model::volume) | volume of a point, original and at the start of the step, eq. (22) |
//! | m_p | [`mass`](points::Points::mass) | constant mass |
//! | – | [`corners`](points::State::corners), [`original_corners`](points::Points::original_corners) | corners of a CPDI domain, current and original |
//! | w_c, g_c | `CornerWeights` in `basis/cpdi.rs` | means over a CPDI domain of the shape functions of its corners and of their gradients |
//! | l_p, l_p0 | [`half_lengths`](points::State::half_lengths), [`original_half_lengths`](points::Points::original_half_lengths) | half lengths of a GIMP domain, current and original |
//! | S_vp | [`value`](basis::Links::value) | basis functions |
//! | ∇S_vp | [`gradient`](basis::Links::gradient) | gradients of the basis functions with respect to X̃ |
//! | Δd | `delta_d` in `solver/unknowns.rs` | displacement increment of the active nodes, eq. (30) |
//! | δd | `iterative` in `solver/unknowns.rs` | change of Δd in one iteration, eq. (26) |
//! | f^int, f^ext | [`internal_force`](assembly::System::internal_force), `f_ext` | internal and external force, eqs. (23) and (29) |
//! | f^react | `reaction` in `solver/unknowns.rs` | reactions: forces at prescribed degrees of freedom |
//! | f^R | `out_of_balance` | out-of-balance force f^ext − f^int + f^react: eq. (28) with the sign of eq. (26), plus reactions (section 6 of `docs/theory.md`) |
//! | K | [`System::matrix`](assembly::System::matrix) | stiffness matrix of the active nodes, eq. (27) |
//! | λ | `factor` | load factor, if it is unknown |
//! | – | `globals` | unknowns that belong to no node |
//! | ρ_y | `yield_radius` | deviatoric yield stress, eq. (43) |
//!
//! Symmetric tensors are stored in the Mandel layout of [`tensor::Sym3`], so that material laws need no factors of two
//! for shear components.
#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets: [length], [force]")]
#![allow(rustdoc::private_intra_doc_links, reason = "the pages are for readers of the code")]

pub mod assembly;
pub mod basis;
pub mod counted;
pub mod dofs;
pub mod domain;
pub mod element_test;
pub mod equilibrium;
pub mod formula;
pub mod grid;
pub mod input_file;
pub mod kinematics;
pub mod linear;
pub mod material;
pub mod memory;
pub mod model;
pub mod points;
pub mod quality;
pub mod ranks;
pub mod region;
pub mod solver;
pub mod step;
pub mod stress;
pub mod surface;
pub mod tensor;
pub mod terms;
pub mod timing;
pub mod tool;
