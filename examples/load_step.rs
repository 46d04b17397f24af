//! One load step of the implicit material point method as sections 5 and 6 of Coombs et al. (2020) state it: a slow,
//! readable twin of the solver in plane strain, for laws in logarithmic strain. It shares the points, basis functions,
//! tensors and laws of the library, but no assembly, kernel or linear solver. This example solves each step of a run of
//! the program again and compares the results.
//!
//! ```sh
//! cargo run --example load_step
//! ```
//!
//! Symbols are those of the paper; the table in `crates/core/src/lib.rs` lists them. All tensors are 3×3 and nodes have
//! three degrees of freedom, 3v + i for axis i of active node v: plane strain prescribes zero along z.
#![allow(clippy::print_stdout, reason = "a program")]
#![allow(non_snake_case)]

use mpm::basis::Connectivity;
use mpm::deck::{build::build, load::load_text};
use mpm::material::Response;
use mpm::model::{Action, Model, NodeSet};
use mpm::points::Points;
use mpm::solver::{self, Observer, Reached, Step, StepReport, Summary};
use mpm::tensor::{Mat3, Sym3, log_derivative, padded};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::AddAssign;

type Vector = DVector<f64>;
type Matrix = DMatrix<f64>;
/// The nodes that a point p touches: v, S_vp and ∂S_vp/∂X̃.
type Nodes = Vec<(usize, f64, Vector3<f64>)>;

/// Section 6.3: finds equilibrium from the converged state of the points and writes their trial state. Returns Δd,
/// f^react and the residuals; `None` if there is no equilibrium, or if loads or conditions other than gravity and
/// constant displacements act.
fn load_step(model: &Model<2>, points: &mut Points<2>, step: Step) -> Option<(Vector, Vector, Vec<f64>)> {
    let methods = model.methods();
    let links = Connectivity::new(model.grid.as_ref(), points, &methods).ok()?;
    let mut basis = vec![Nodes::new(); points.len()]; // section 6.1; constant over the step
    for group in 0..links.n_groups() {
        let node = |place: usize| links.nodes_of(group)[place] as usize;
        for p in links.points_of(group) {
            links.for_each_link(p, |place, S, grad| basis[p].push((node(place), S, padded(grad).into())));
        }
    }
    let n = 3 * links.n_active();
    let mut prescribed: Vec<Option<f64>> = (0..n).map(|d| (d % 3 == 2).then_some(0.0)).collect(); // section 6.2
    for condition in &model.boundary_conditions {
        let NodeSet::Fixed(nodes) = &condition.nodes else { return None };
        let factor = condition.curve.factor(step.end) - condition.curve.factor(step.start);
        let active = nodes.iter().flat_map(|node| links.copies(*node as usize));
        for (v, i) in active.flat_map(|v| [(v, 0), (v, 1)]) {
            let Some(displacement) = &condition.displacement[i] else { continue };
            prescribed[3 * v + i] = Some(factor * displacement.as_constant()?);
        }
    }
    let (held, free): (Vec<usize>, Vec<usize>) = (0..n).partition(|d| prescribed[*d].is_some());
    let mut f_ext = Vector::zeros(n);
    for load in &model.loads {
        let Action::Gravity(g) = load.action else { return None };
        let g = Vector3::from(padded(&g)) * load.curve.factor(step.end);
        for p in (0..points.len()).filter(|p| load.acts_on[points.body[*p] as usize]) {
            for (v, S, _) in &basis[p] {
                f_ext.fixed_rows_mut::<3>(3 * v).add_assign(*S * points.mass[p] * g); // (24), (29) with b V_p^n = m_p g
            }
        }
    }

    let (mut delta_d, mut f_react, mut residuals) = (Vector::zeros(n), Vector::zeros(n), Vec::new());
    for _ in 0..=model.newton.max_iterations {
        let (f_int, K) = assemble(model, points, &basis, &delta_d)?;
        let f_R = &f_ext - f_int + &f_react; // (28) with the sign that (26) needs, plus f^react, which is zero at first
        residuals.push(f_R.norm() / (&f_ext + &f_react).norm()); // (40)
        if *residuals.last()? <= model.newton.tolerance {
            move_points(points, &basis, &delta_d);
            return Some((delta_d, f_react, residuals));
        }
        // (26) on the free degrees of freedom, which the remaining prescribed increments load through K.
        let mut delta = Vector::from_fn(n, |d, _| prescribed[d].map_or(0.0, |whole| whole - delta_d[d]));
        let right = (&f_R - &K * &delta).select_rows(&free);
        let solution = K.select_rows(&free).select_columns(&free).lu().solve(&right)?;
        free.iter().zip(&solution).for_each(|(d, x)| delta[*d] = *x);
        // f^react follows f^int − f^ext, linearised: f^int changes by K δd.
        let change = &K * &delta - f_R;
        held.iter().for_each(|d| f_react[*d] += change[*d]);
        delta_d += delta; // (30)
    }
    None
}

/// Section 5.1: f^int and K at Δd.
fn assemble(
    model: &Model<2>,
    points: &mut Points<2>,
    basis: &[Nodes],
    d: &Vector,
) -> Option<(Vector, Matrix)> {
    let (mut f_int, mut K) = (Vector::zeros(d.len()), Matrix::zeros(d.len(), d.len()));
    for p in 0..points.len() {
        let V_n = points.converged.deformation_gradient[p].determinant() * points.original_volume[p]; // (22)
        let (P, A) = respond(model, points, p, &increment(&basis[p], d))?;
        for (v, _, grad_v) in &basis[p] {
            f_int.fixed_rows_mut::<3>(3 * v).add_assign(P * grad_v * V_n); // (23), (28)
            for (w, _, grad_w) in &basis[p] {
                for k in 0..3 {
                    let A_w: Mat3 = (0..3).map(|l| A[k][l] * grad_w[l]).sum(); // Ã_ijkl ∂S_wp/∂X̃_l
                    K.fixed_view_mut::<3, 1>(3 * v, 3 * w + k).add_assign(A_w * grad_v * V_n); // (21), (27)
                }
            }
        }
    }
    Some((f_int, K))
}

/// ΔF of a point, eq. (7).
fn increment(nodes: &Nodes, delta_d: &Vector) -> Mat3 {
    let gradients = nodes.iter().map(|(v, _, grad)| delta_d.fixed_rows::<3>(3 * v) * grad.transpose());
    Mat3::identity() + gradients.sum::<Mat3>()
}

/// Section 5 and appendix A.2: P̃ of a point and `A[k][l]` = ∂P̃/∂ΔF_kl. Writes its trial stress, strain and history.
fn respond(model: &Model<2>, points: &mut Points<2>, p: usize, dF: &Mat3) -> Option<(Mat3, [[Mat3; 3]; 3])> {
    let (start, law) = (&points.converged, model.law(points, p));
    let J_n = start.deformation_gradient[p].determinant();
    let b_n = start.elastic_strain[p].map_eigenvalues(|e| f64::exp(2.0 * e)).to_matrix(); // ε^e = ½ ln b^e
    let b = Sym3::symmetric_part(&(dF * b_n * dF.transpose())); // of the trial state
    let strain = b.map_eigenvalues(f64::ln) * 0.5;
    let history = p * points.history_len..(p + 1) * points.history_len;
    let (old, new) = (&start.history[history.clone()], &mut points.trial.history[history]);
    let Response { tau, elastic_strain, tangent: D } = law.update(&strain, old, new).ok()?;
    (points.trial.kirchhoff_stress[p], points.trial.elastic_strain[p]) = (tau, elastic_strain);

    let (tau, inverse) = (tau.to_matrix(), dF.try_inverse()?);
    let P = tau * inverse.transpose() / J_n; // (18)
    let half_DL = D * log_derivative(&b) * 0.5; // ∂τ/∂b^e, with L of (A.2)
    let mut A = [[Mat3::zeros(); 3]; 3];
    for (k, l) in (0..9).map(|kl| (kl / 3, kl % 3)) {
        let mut E = Mat3::zeros(); // ∂ΔF/∂ΔF_kl
        E[(k, l)] = 1.0;
        let B = E * b_n * dF.transpose() + dF * b_n * E.transpose(); // (A.5)
        let dtau = Sym3::symmetric_part(&B).contract(&half_DL).to_matrix(); // (A.4)
        let dinverse = -inverse * E * inverse; // (A.6)
        A[k][l] = (dtau * inverse.transpose() + tau * dinverse.transpose()) / J_n; // (A.3)
    }
    Some((P, A))
}

/// Section 6.4: position and F at the end of the step; the volume follows from F, eq. (5). Domains are left out.
fn move_points(points: &mut Points<2>, basis: &[Nodes], delta_d: &Vector) {
    let (start, end) = (&points.converged, &mut points.trial);
    (end.position, end.deformation_gradient) = (start.position.clone(), start.deformation_gradient.clone());
    for (p, nodes) in basis.iter().enumerate() {
        for (v, S, _) in nodes {
            (0..2).for_each(|i| end.position[p][i] += S * delta_d[3 * v + i]); // (31)
        }
        end.deformation_gradient[p] = increment(nodes, delta_d) * start.deformation_gradient[p]; // (16)
    }
}

/// A heavy cantilever, whose clamp moves up, in three steps.
const DECK: &str = "version: 1
parameters: {method: gimp, material: rubber}
analysis: {stabilisation: {mode: off}}
grid: {type: structured, origin: [0, -2], size: [4, 5], spacing: 0.5}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3, density: 1000}
  clay: {model: von-mises, young: 1e6, poisson: 0.3, density: 1000, deviatoric_yield_stress: 5e4, hardening_modulus: 2e5}
bodies:
  - {name: bar, material: '${material}', shape: {type: box, min: [0, 0], max: [3, 1]}, method: '${method}', points_per_cell: 3}
boundary_conditions: [{name: clamp, nodes: {x: 0}, ux: 0, uy: 1}]
loads: [{name: weight, type: gravity, acceleration: [0, -6]}]
steps: {count: 3}";

/// Repeats each step from the state in which the program began it, and panics if the results differ.
struct Twin(Points<2>);

impl Observer<2> for Twin {
    fn converged(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        let (delta_d, f_react, residuals) = load_step(model, &mut self.0, report.step).expect("equilibrium");
        let nodal =
            |field: &[[f64; 2]]| Vector::from_iterator(3 * field.len(), field.iter().flat_map(padded));
        let entries = |of: &[Sym3]| Vector::from_iterator(6 * of.len(), of.iter().flat_map(|t| t.0));
        let matrices = |of: &[Mat3]| Vector::from_iterator(9 * of.len(), of.iter().flatten().copied());
        let agree = |a: Vector, b: Vector| assert!((&a - &b).amax() <= 1e-9 * a.amax(), "{a}{b}");
        let (program, twin) = (&points.converged, &self.0.trial);
        agree(nodal(&report.grid.delta_d), delta_d);
        agree(nodal(&report.grid.reaction), f_react);
        agree(nodal(&program.position), nodal(&twin.position));
        agree(matrices(&program.deformation_gradient), matrices(&twin.deformation_gradient));
        agree(entries(&program.elastic_strain), entries(&twin.elastic_strain));
        agree(entries(&program.kirchhoff_stress), entries(&twin.kirchhoff_stress));
        assert_eq!(residuals.len(), report.residuals.len());
        println!("step {}: residual here, and in the program", report.step.index);
        for (a, b) in residuals.iter().zip(&report.residuals) {
            println!("    {a:.3e}  {b:.3e}");
            assert!((a - b).abs() <= 1e-8 * b + 1e-13);
        }
        self.0 = points.clone();
        Ok(())
    }
}

fn run(method: &str, material: &str) -> Summary {
    let set = [("method", method), ("material", material)].map(|(k, v)| (k.to_owned(), v.to_owned()));
    let deck = load_text("cantilever", DECK.as_bytes(), &set).expect("a sound deck");
    let (model, mut points) = build(&deck).expect("a sound model");
    let mut twin = Twin(points.clone());
    solver::run(&model, &mut points, &mut twin).expect("equilibrium").summary
}

fn main() {
    run("gimp", "clay");
}

#[test]
fn the_program_takes_the_same_steps() {
    for method in ["mpm", "gimp", "cpdi2"] {
        for (material, flows) in [("rubber", false), ("clay", true)] {
            assert_eq!(run(method, material).plastic_work > 0.0, flows);
        }
    }
}
