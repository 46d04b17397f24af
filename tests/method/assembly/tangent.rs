//! The stiffness is the derivative of the internal force, symmetric, and equal in both formulations.

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::grid::gmsh::read;
use mpm::grid::mesh::Mesh;
use mpm::kinematics::Increment;
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, CellStrain, Formulation, Mechanics, PlaneStrain, Solid, StartOfStep};
use mpm::terms::{Ledger, Sum};

use super::states::{Domain, FORMULATIONS, Law, Random, State, cases, random_state, state_on, with_laws};
use crate::meshes::{Cells, brick, plane};

/// Internal force at an increment, and the points that flow plastically.
fn evaluate<const D: usize>(
    sum: &mut Sum<D>,
    state: &mut State<D>,
    delta_d: &[[f64; D]],
) -> (Vec<[f64; D]>, Vec<bool>) {
    let State { model, points, links, .. } = state;
    sum.evaluate(&StepContext::first(model, links), points, At::new(delta_d), Wanted::Stiffness).unwrap();
    let flow = points.trial.history.iter().zip(&points.converged.history).map(|(new, old)| new > old);
    (sum.system().internal_force().to_vec(), flow.collect())
}

/// Some von Mises points must flow, and some must not.
fn check_mixture(law: Law, flowing: &[bool]) {
    let n = flowing.iter().filter(|f| **f).count();
    let both = 10 * n > flowing.len() && 10 * n < 9 * flowing.len();
    let flows = matches!(law, Law::VonMises | Law::Both);
    assert!(!flows || both, "{n} of {} points flow", flowing.len());
}

fn largest<const D: usize>(values: &[[f64; D]]) -> f64 {
    values.iter().flatten().fold(0.0, |m, x| m.max(x.abs()))
}

/// All combinations of formulations and deformations that the law sees.
fn with_strains(method: Method) -> Vec<(Formulation, CellStrain)> {
    let mut all = vec![CellStrain::Standard, CellStrain::MeanDilatation, CellStrain::Mean];
    all.extend(method.has_centres().then_some(CellStrain::FBar));
    all.into_iter().flat_map(|v| FORMULATIONS.map(|f| (f, v))).collect()
}

/// Gives the bodies this deformation. Where it is the mean of cells, random stresses resist deviations from it, and flow
/// has taken away up to half of them.
fn set<const D: usize>(state: &mut State<D>, strain: CellStrain) {
    state.model.bodies.iter_mut().for_each(|body| body.strain = strain);
    if strain == CellStrain::Mean {
        state.points.prepare_deviations();
        let mut random = Random(5);
        let further = &mut state.points.further;
        for (name, [low, high]) in [("deviation_stress", [-2e5, 2e5]), ("deviation_lost", [0.0, 0.5])] {
            let handle = further.handle(name).unwrap();
            let mut values = further.converged(handle).to_vec();
            values.iter_mut().for_each(|value| *value = random.within(low, high));
            if D == 2 && name == "deviation_stress" {
                values.chunks_mut(6).for_each(|stress| stress[4..].fill(0.0));
            }
            further.restore(handle, &values);
        }
    }
}

fn check_derivative<const D: usize, M: Mechanics<D>>(
    cases: Vec<(Method, Law)>,
    state: impl Fn(Method, Law) -> State<D>,
) {
    const STEP: f64 = 1e-6; // of nodal displacements; cells are 0.5 by 0.4
    let (mut worst, mut strain) = (0.0f64, 0.0f64);
    for (method, law) in cases {
        for (formulation, volumetric) in with_strains(method) {
            let mut state = state(method, law);
            state.model.formulation = formulation;
            set(&mut state, volumetric);
            let mut sum =
                Sum::from_model::<M>(&StepContext::first(&state.model, &state.links), &state.points).unwrap();
            let base = state.delta_d.clone();
            let (_, flowing) = evaluate(&mut sum, &mut state, &base);
            check_mixture(law, &flowing);
            let n = base.len();
            // Copy all columns of K before the system is assembled at another state.
            let mut columns = Vec::new();
            for b in 0..D * n {
                let mut unit = vec![[0.0; D]; n];
                unit[b / D][b % D] = 1.0;
                let mut column = unit.clone();
                sum.system_mut().multiply(&unit, &mut column);
                columns.push(column);
            }
            let scale = columns.iter().map(|c| largest(c)).fold(0.0, f64::max);
            // Only some columns, to keep the test short, but columns of every axis.
            for (b, column) in columns.iter().enumerate().step_by(if D == 3 { 11 } else { 3 }) {
                let mut shifted = |by: f64| {
                    let mut delta_d = base.clone();
                    delta_d[b / D][b % D] += by;
                    let (force, flow) = evaluate(&mut sum, &mut state, &delta_d);
                    assert!(
                        flow == flowing,
                        "a point switches between elastic and plastic within the difference"
                    );
                    force
                };
                let (plus, minus) = (shifted(STEP), shifted(-STEP));
                for a in 0..n {
                    for i in 0..D {
                        let numeric = (plus[a][i] - minus[a][i]) / (2.0 * STEP);
                        worst = worst.max((numeric - column[a][i]).abs() / scale);
                    }
                }
                assert!(
                    worst < 1e-6,
                    "{method:?} {law:?} {formulation:?} {volumetric:?}, column {b}: {worst:e}"
                );
            }
            for (old, new) in
                state.points.converged.elastic_strain.iter().zip(&state.points.trial.elastic_strain)
            {
                strain = strain.max((*new - *old).norm());
            }
        }
    }
    assert!(strain > 0.3, "the increments are not large: {strain}");
}

#[test]
fn stiffness_is_the_derivative_of_the_internal_force() {
    check_derivative::<2, PlaneStrain>(cases(), |method, law| {
        random_state::<2, PlaneStrain>(method, law, 80, 11)
    });
}

#[test]
fn stiffness_of_a_body_of_revolution_is_the_derivative_of_the_internal_force() {
    check_derivative::<2, Axisymmetric>(cases(), |method, law| {
        random_state::<2, Axisymmetric>(method, law, 80, 11)
    });
}

#[test]
fn stiffness_in_three_dimensions_is_the_derivative_of_the_internal_force() {
    check_derivative::<3, Solid>(cases(), |method, law| random_state::<3, Solid>(method, law, 60, 11));
}

/// A mesh of the rectangle or brick of [`random_state`] with displaced nodes, and patches of triangles or tetrahedra.
fn mesh<const D: usize>(cells: Cells) -> Mesh<D> {
    use std::f64::consts::TAU;
    // Nodes on the faces stay on them.
    let wave = |s: f64, t: f64| s + 0.05 * (TAU * s).sin() * (5.0 * t + 1.0).sin();
    let text = if D == 2 {
        plane([6, 5], cells, |s, t| [1.6 + 3.0 * wave(s, t), 0.2 + 2.0 * wave(t, s)])
    } else {
        let place = |[r, s, t]: [f64; 3]| {
            [1.6 + 1.5 * wave(r, s + t), 0.2 + 1.2 * wave(s, r), -0.4 + 1.2 * wave(t, r)]
        };
        brick([3, 3, 2], cells, place)
    };
    Mesh::from_gmsh(&read(text.as_bytes()).unwrap()).unwrap().with_patches()
}

/// On quadrilaterals, triangles, hexahedra and tetrahedra, with dilatations averaged over patches.
fn check_derivative_on_meshes<const D: usize, M: Mechanics<D>>(n_points: usize) {
    for cells in [Cells::Boxes, Cells::Simplices] {
        let state = |method: Method, law: Law| {
            let grid = Box::new(mesh::<D>(cells));
            state_on::<D, M>(grid, 0.1, (method, Domain::Box), law, n_points, 11)
        };
        check_derivative::<D, M>(with_laws(&[Method::Mpm, Method::Cpdi1, Method::Cpdi2]), state);
    }
}

#[test]
fn stiffness_on_meshes_is_the_derivative_of_the_internal_force() {
    check_derivative_on_meshes::<2, PlaneStrain>(80);
    check_derivative_on_meshes::<2, Axisymmetric>(80);
}

#[test]
fn stiffness_on_meshes_in_three_dimensions_is_the_derivative_of_the_internal_force() {
    check_derivative_on_meshes::<3, Solid>(60);
}

fn check_formulations<const D: usize, M: Mechanics<D>>(cases: Vec<(Method, Law)>) {
    let (mut worst_f, mut worst_k) = (0.0f64, 0.0f64);
    let with_cures = |(method, law): (Method, Law)| {
        with_strains(method).into_iter().step_by(2).map(move |(_, v)| (method, law, v))
    };
    for (method, law, volumetric) in cases.into_iter().flat_map(with_cures) {
        for seed in 0..5 {
            let [(f, kx), (g, ky)] = FORMULATIONS.map(|formulation| {
                let mut state = random_state::<D, M>(method, law, 150, 100 + seed);
                state.model.formulation = formulation;
                state.model.bodies.iter_mut().for_each(|body| body.strain = volumetric);
                let mut sum =
                    Sum::from_model::<M>(&StepContext::first(&state.model, &state.links), &state.points)
                        .unwrap();
                let base = state.delta_d.clone();
                let (f, _) = evaluate(&mut sum, &mut state, &base);
                let mut random = Random(seed);
                let x: Vec<[f64; D]> = f.iter().map(|_| [0; D].map(|_| random.within(-1.0, 1.0))).collect();
                let mut kx = x.clone();
                sum.system_mut().multiply(&x, &mut kx);
                (f, kx)
            });
            let difference = |a: &[[f64; D]], b: &[[f64; D]]| {
                let d: Vec<[f64; D]> =
                    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|i| a[i] - b[i])).collect();
                largest(&d) / largest(a)
            };
            worst_f = worst_f.max(difference(&f, &g));
            worst_k = worst_k.max(difference(&kx, &ky));
            assert!(
                worst_f < 1e-12 && worst_k < 1e-12,
                "{method:?} {law:?} {volumetric:?} {seed}: {worst_f:e} {worst_k:e}"
            );
        }
    }
}

#[test]
fn both_formulations_give_the_same_force_and_stiffness() {
    check_formulations::<2, PlaneStrain>(cases());
    check_formulations::<2, Axisymmetric>(cases());
    check_formulations::<3, Solid>(cases());
}

fn check_force<const D: usize, M: Mechanics<D>>(cases: Vec<(Method, Law)>) {
    for (method, law) in cases {
        for (formulation, volumetric) in with_strains(method) {
            let mut state = random_state::<D, M>(method, law, 150, 7);
            state.model.formulation = formulation;
            set(&mut state, volumetric);
            let (first, half): (Vec<[f64; D]>, Vec<[f64; D]>) =
                (state.delta_d.clone(), state.delta_d.iter().map(|u| u.map(|u| 0.5 * u)).collect());
            let mut sum =
                Sum::from_model::<M>(&StepContext::first(&state.model, &state.links), &state.points).unwrap();
            let (force, _) = evaluate(&mut sum, &mut state, &first);
            let trial = state.points.trial.clone();
            // This stiffness belongs to another state and must not change.
            evaluate(&mut sum, &mut state, &half);
            let mut before = half.clone();
            sum.system_mut().multiply(&first, &mut before);
            let State { model, points, links, .. } = &mut state;
            sum.evaluate(&StepContext::first(model, links), points, At::new(&first), Wanted::Force).unwrap();
            let mut after = half.clone();
            sum.system_mut().multiply(&first, &mut after);
            assert!(sum.system().internal_force() == force, "{method:?} {law:?} {formulation:?}");
            assert!(before == after, "{method:?} {law:?} {formulation:?}");
            let now = &points.trial;
            assert!(now.kirchhoff_stress == trial.kirchhoff_stress && now.history == trial.history);
            assert!(now.elastic_strain == trial.elastic_strain, "{method:?} {law:?} {formulation:?}");
        }
    }
}

#[test]
fn without_stiffness_force_and_points_have_the_same_bits() {
    check_force::<2, PlaneStrain>(cases());
    check_force::<2, Axisymmetric>(cases());
    check_force::<3, Solid>(cases());
}

/// Stored energy at an increment, Σ V⁰ W, and the work on the stresses that resist deviations.
fn stored<const D: usize>(sum: &mut Sum<D>, state: &mut State<D>, delta_d: &[[f64; D]]) -> f64 {
    let State { model, points, links, .. } = state;
    let context = StepContext::first(model, links);
    sum.evaluate(&context, points, At::new(delta_d), Wanted::Force).unwrap();
    let ledger = sum.ledger(&context, points, At::new(delta_d));
    ledger.energy(Ledger::ELASTIC) + ledger.energy(Ledger::DEVIATION)
}

/// The largest difference between the internal force and the derivative of the stored energy, relative to the force.
fn difference_from_energy<const D: usize, M: Mechanics<D>>(
    (method, law): (Method, Law),
    volumetric: CellStrain,
    n_points: usize,
) -> f64 {
    // A fourth-order central difference keeps both truncation and round-off below 1e-8 of the force.
    const STEP: f64 = 1e-3; // of nodal displacements; cells are 0.5 by 0.4
    let mut state = random_state::<D, M>(method, law, n_points, 23);
    set(&mut state, volumetric);
    let mut sum =
        Sum::from_model::<M>(&StepContext::first(&state.model, &state.links), &state.points).unwrap();
    let base = state.delta_d.clone();
    let (force, _) = evaluate(&mut sum, &mut state, &base);
    let scale = largest(&force);
    let mut worst = 0.0f64;
    for b in 0..D * base.len() {
        let mut at = |steps: f64| {
            let mut delta_d = base.clone();
            delta_d[b / D][b % D] += steps * STEP;
            stored(&mut sum, &mut state, &delta_d)
        };
        let near = (at(1.0) - at(-1.0)) / (2.0 * STEP);
        let far = (at(2.0) - at(-2.0)) / (4.0 * STEP);
        worst = worst.max(((4.0 * near - far) / 3.0 - force[b / D][b % D]).abs() / scale);
    }
    worst
}

fn check_energy<const D: usize, M: Mechanics<D>>(n_points: usize) {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        for law in [Law::Hencky, Law::NeoHookean] {
            for strain in [CellStrain::MeanDilatation, CellStrain::Mean] {
                let worst = difference_from_energy::<D, M>((method, law), strain, n_points);
                println!("{D} axes, {method:?} {law:?} {strain:?}: {worst:.1e}");
                // Measured: at most 2.6e-9, which is the truncation error of the difference.
                assert!(worst < 1e-8, "{method:?} {law:?} {strain:?}: {worst:e}");
            }
        }
    }
    let without_energy =
        difference_from_energy::<D, M>((Method::Gimp, Law::Hencky), CellStrain::FBar, n_points);
    assert!(without_energy > 0.1, "{without_energy:e}");
}

/// The internal force of elastic points with means of cells is the derivative of their stored energy and of the work on
/// the stresses that resist deviations. The test would
/// fail if the weights in the variation differed from those in θ, or the exponent in the stress from that in ΔF̄. F-bar
/// has no energy, which shows that the test can tell the difference.
#[test]
fn internal_force_is_the_derivative_of_the_stored_energy() {
    check_energy::<2, PlaneStrain>(80);
    check_energy::<2, Axisymmetric>(80);
    check_energy::<3, Solid>(60);
}

/// The system stores only one triangle, which would hide an unsymmetric tangent. The test therefore checks that the
/// tangent of every point has major symmetry: Ã of eqs. (A.3)-(A.6), and a of eqs. (A.1)-(A.2).
#[test]
fn point_tangents_and_stiffness_are_symmetric() {
    let mut worst = 0.0f64;
    for (method, law) in cases().into_iter().filter(|(_, law)| *law != Law::Skewed) {
        for formulation in FORMULATIONS {
            let State { model, points, links, delta_d } =
                random_state::<2, PlaneStrain>(method, law, 200, 42);
            for group in 0..links.n_groups() {
                for p in links.points_of(group) {
                    let t = point_tangent(&model, &points, &links, &delta_d, formulation, group, p);
                    let scale = t.as_flattened().as_flattened().as_flattened();
                    let scale = scale.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                    let index = |n: usize| [n >> 3 & 1, n >> 2 & 1, n >> 1 & 1, n & 1];
                    for [i, j, k, l] in (0..16).map(index) {
                        worst = worst.max((t[i][j][k][l] - t[k][l][i][j]).abs() / scale);
                    }
                }
            }
            assert!(worst < 1e-13, "{method:?} {law:?} {formulation:?}: {worst:e}");
        }
    }
}

/// The tangent of a point in plane strain times its volume, `[i][j][k][l]`.
fn point_tangent(
    model: &mpm::model::Model<2>,
    points: &mpm::points::Points<2>,
    links: &mpm::basis::Connectivity<2>,
    delta_d: &[[f64; 2]],
    formulation: Formulation,
    group: usize,
    p: usize,
) -> [[[[f64; 2]; 2]; 2]; 2] {
    let place = &points.converged.position[p];
    let mut room = mpm::basis::LinkBuffer { value: &mut [], gradient: &mut [] }; // in the plane none is needed
    let increment = Increment::new(false, links.nodes_of(group), &links.links(p, &mut room), delta_d, place);
    let f_n = points.converged.deformation_gradient[p];
    let law = model.law(points, p);
    let strain = &points.converged.elastic_strain[p];
    let start = StartOfStep {
        b_n: PlaneStrain::elastic_left_cauchy_green(law.strain_measure(), strain),
        J_n: f_n.determinant(),
        volume_n: f_n.determinant() * points.original_volume[p],
    };
    let old = &points.converged.history[p * points.history_len..][..law.state_fields().len()];
    let new = &mut old.to_vec();
    let tangent = match formulation {
        Formulation::PreviouslyConverged => {
            PlaneStrain::respond(&start, &increment, law, old, new).unwrap().weak.tangent
        }
        Formulation::UpdatedLagrangian => {
            PlaneStrain::respond_current(&start, &increment, law, old, new).unwrap().weak.tangent
        }
    };
    let index = [0, 1];
    index.map(|i| index.map(|j| index.map(|k| index.map(|l| tangent[l][j][i][k]))))
}
