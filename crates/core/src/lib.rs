//! The core of `mpm`: an implicit, quasi-static, finite-deformation material point method.
//!
//! The formulation is that of Coombs et al., *Comput. Methods Appl. Mech. Engrg.* 358 (2020) 112622; "eq. (18)" and
//! "section 5" in these pages always mean that paper. `docs/theory.md` derives what the paper leaves out.
//!
//! # How to read the code
//!
//! 1. [`solver`]: load steps and Newton iterations, the procedure of the paper from top to bottom. Every other module
//!    is one step away from it.
//! 2. [`points`] and [`model`]: what changes during a run and what does not. Iterations write [`points::Points::trial`];
//!    [`points::Points::commit`] is the only way from there to [`points::Points::converged`].
//! 3. [`grid`] and [`basis`]: which nodes a point touches and how strongly; one file per method. [`grid::Grid`] is a
//!    trait, location and linear basis of a cell; [`grid::Structured`] is the regular grid, [`grid::Mesh`] holds
//!    triangles and quadrilaterals, which [`grid::gmsh`] reads.
//! 4. [`kinematics`] and [`stress`]: from the displacement gradient of one point to its part in force and stiffness,
//!    P̃ and Ã. [`stress::Solid`] is the general kernel, [`stress::PlaneStrain`] is in closed form,
//!    [`stress::Axisymmetric`] for bodies of revolution. [`material`] holds the laws, [`tensor`] the spectral functions
//!    and the index conventions.
//! 5. [`terms`]: the parts of equilibrium, which are the material points, external forces and ghost stabilisation; each
//!    adds its force and stiffness to the [`assembly::System`] of the grid. [`dofs`]: which nodes are prescribed, and the
//!    motions that are left free. [`linear`]: the sparse solvers. [`step`] and [`equilibrium`]: what a load step begins
//!    with, and what is known of one that is in equilibrium.
//! 6. [`domain`]: how the domain of a GIMP point follows the deformation. Domains of CPDI are given by their corners,
//!    [`points::State::corners`], which the last step of [`solver`] moves.
//! 7. [`quality`]: how well a run goes, and warnings when its answer may be bad. [`memory`]: how much there is.
//! 8. [`region`]: the geometry of solids, which are primitives, closed surfaces from STL files, booleans and motions;
//!    their volumes. [`formula`]: numbers that depend on place and time.
//!
//! The crates above this one know it, and it knows none of them: `mpm-files` writes results, `mpm-deck` makes a
//! [`model::Model`] and [`points::Points`] of a deck, `mpm-report` shows files as a page. This one never prints and never
//! exits.
//!
//! # Symbols
//!
//! The contract between the paper and the code. Words name things and processes; the paper's symbols stay inside
//! kernels, with capitals where the paper has them.
//!
//! | Paper | Code | Meaning |
//! |---|---|---|
//! | X̃, x_p | [`position`](points::State::position) | position of a point at the start of the step (converged), at its end (trial) |
//! | X | [`original_position`](points::Points::original_position) | original position |
//! | F, F_n | [`deformation_gradient`](points::State::deformation_gradient) | trial and converged deformation gradient; `F` in [`domain`] |
//! | ΔF, ΔJ | [`dF`](kinematics::Increment::dF), `dJ` | increment of F over the step, eq. (7), and its determinant |
//! | J_n | [`J_n`](stress::StartOfStep::J_n) | det F_n |
//! | b^e_n | [`b_n`](stress::StartOfStep::b_n) | elastic left Cauchy-Green strain at the start of the step |
//! | ε^e | [`elastic_strain`](points::State::elastic_strain) | elastic logarithmic strain, ½ ln b^e (or ½ (b^e − I), see [`StrainMeasure`](material::StrainMeasure)) |
//! | τ | [`kirchhoff_stress`](points::State::kirchhoff_stress), `tau` | Kirchhoff stress |
//! | P̃, Ã | [`stress`](stress::Contribution::stress), [`tangent`](stress::Contribution::tangent) | stress of eq. (18) and its derivative (A.3); `P` inside the kernel; factors of both in [`Spatial`](stress::Spatial) |
//! | D^alg | [`tangent`](material::Response::tangent) | algorithmic tangent of the law |
//! | L | [`log_derivative`](tensor::log_derivative), `L` | derivative of the logarithm, eq. (A.2) |
//! | V_p^0, V_p^n | [`original_volume`](points::Points::original_volume), [`volume_n`](stress::StartOfStep::volume_n) | volume of a point, eq. (22) |
//! | m_p | [`mass`](points::Points::mass) | constant mass |
//! | – | [`corners`](points::State::corners), [`original_corners`](points::Points::original_corners) | corners of a CPDI domain |
//! | w_c, g_c | `CornerWeights` in `basis/cpdi.rs` | means of the interpolation of the corners and of its gradient |
//! | l_p, l_p0 | [`half_lengths`](points::State::half_lengths), [`original_half_lengths`](points::Points::original_half_lengths) | half lengths of a domain |
//! | S_vp | [`value`](basis::Links::value) | basis functions |
//! | ∇S_vp | [`gradient`](basis::Links::gradient) | their derivatives with respect to X̃ |
//! | Δd | `delta_d` | displacement increment of the active nodes, eq. (30) |
//! | δd | `iterative`, `delta` | its change in one iteration, eq. (26) |
//! | f^int, f^ext | [`internal_force`](assembly::System::internal_force), `f_ext` | eqs. (23) and (29) |
//! | f^react | `reaction` | forces on prescribed degrees of freedom |
//! | f^R | `out_of_balance` | f^ext − f^int + f^react, eq. (28) with the sign that eq. (26) needs |
//! | K | [`System`](assembly::System) | stiffness of the active grid, eq. (27) |
//! | ρ_y | `yield_radius` | deviatoric yield stress, eq. (43) |
//!
//! Symmetric tensors are stored in the Mandel layout of [`tensor::Sym3`], so that no factor of two leaks into a
//! material.
#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets: [length], [force]")]
#![allow(rustdoc::private_intra_doc_links, reason = "the pages are for readers of the code")]

pub mod assembly;
pub mod basis;
pub mod dofs;
pub mod domain;
pub mod equilibrium;
pub mod formula;
pub mod grid;
pub mod kinematics;
pub mod linear;
pub mod material;
pub mod memory;
pub mod model;
pub mod points;
pub mod quality;
pub mod region;
pub mod solver;
pub mod step;
pub mod stress;
pub mod tensor;
pub mod terms;
pub mod timing;
