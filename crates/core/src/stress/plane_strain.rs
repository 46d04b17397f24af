//! The closed-form kernel for plane strain.
//!
//! z stays a principal direction and ΔF_33 = 1, so the in-plane 2×2 blocks decouple and only the in-plane block of
//! D^alg enters the tangent. Symmetric in-plane tensors have three components `xx, yy, √2 xy`. The equations are
//! generic over [`Lane`], so that several points can be evaluated at once.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::principal::{self, InPlaneAnswer};
use super::{
    Current, Deviation, InPlane, Lane, Lanes, MeanDilatation, Mechanics, PointError, PointResponse,
    StartOfStep,
};
use crate::kinematics::Increment;
use crate::material::{CompactResponse, Material, StrainMeasure, VectorisedLaw};
use crate::tensor::{Sym3, plane};

/// Plane strain in the x-y plane.
#[derive(Debug, Clone, Copy)]
pub struct PlaneStrain;

/// A full (unsymmetric) tensor in the plane, `[i][j]`.
type Rows<T> = [[T; 2]; 2];

/// Trial state of a point.
struct Trial<T> {
    dJ: T,
    /// ΔF b_n.
    A: Rows<T>,
    /// `xx, yy, zz, √2 xy`.
    b: [T; 4],
}

impl<T: Lane> Trial<T> {
    #[inline(always)]
    fn new(b_n: &[T; 4], dF: &Rows<T>) -> Self {
        let xy = b_n[3] * FRAC_1_SQRT_2;
        let mut A = [[b_n[0]; 2]; 2];
        for i in 0..2 {
            A[i] = [dF[i][0] * b_n[0] + dF[i][1] * xy, dF[i][0] * xy + dF[i][1] * b_n[1]];
        }
        Trial {
            dJ: dF[0][0] * dF[1][1] - dF[0][1] * dF[1][0],
            b: [
                A[0][0] * dF[0][0] + A[0][1] * dF[0][1],
                A[1][0] * dF[1][0] + A[1][1] * dF[1][1],
                b_n[2],
                (A[0][0] * dF[1][0] + A[0][1] * dF[1][1]) * SQRT_2,
            ],
            A,
        }
    }
}

/// Response of the law to the trial state.
struct Answer {
    trial: Trial<f64>,
    /// τ and the elastic strain.
    law: (Sym3, Sym3),
    /// Derivative of the in-plane components of τ with respect to those of b.
    C: [[f64; 3]; 3],
    tau: Rows<f64>,
}

#[inline(always)]
fn answer(
    start: &StartOfStep,
    dF: &Rows<f64>,
    material: &dyn Material,
    old: &[f64],
    new: &mut [f64],
) -> Result<Answer, PointError> {
    let trial = Trial::new(&plane::components(&start.b_n), dF);
    if trial.dJ.is_nan() || trial.dJ <= 0.0 {
        return Err(PointError::Inverted { determinant: trial.dJ });
    }
    if let Some(law) = material.principal() {
        let InPlaneAnswer { tau, elastic_strain, C } = principal::in_plane(law, &trial.b, old, new)?;
        let law = (plane::tensor(tau), plane::tensor(elastic_strain));
        return Ok(Answer { trial, law, C, tau: in_plane(&tau) });
    }
    let measure = material.strain_measure();
    let (strain, L) = match measure {
        StrainMeasure::Logarithmic => {
            let (log_b, L) = plane::log_with_derivative(&trial.b);
            (plane::tensor(log_b) * 0.5, L)
        }
        StrainMeasure::LeftCauchyGreen => ((plane::tensor(trial.b) - Sym3::IDENTITY) * 0.5, [[0.0; 3]; 3]),
    };
    // Passed by reference, because moving the 6×6 tangent is expensive.
    let answer = material.update(&strain, old, new);
    let law = match &answer {
        Ok(law) => law,
        Err(error) => return Err((*error).into()),
    };
    let D = IN_PLANE.map(|r| IN_PLANE.map(|c| law.tangent[(r, c)]));
    let C = match measure {
        StrainMeasure::Logarithmic => half_product(&D, &L),
        StrainMeasure::LeftCauchyGreen => D.map(|row| row.map(|x| 0.5 * x)),
    };
    let tau = in_plane(&plane::components(&law.tau));
    Ok(Answer { trial, law: (law.tau, law.elastic_strain), C, tau })
}

/// Response of a law to the trial states of several points.
struct AnswerInLanes {
    law: InPlaneAnswer<Lanes>,
    trial: Trial<Lanes>,
    dF: Rows<Lanes>,
    /// V_n/J_n.
    weight: Lanes,
}

#[inline(always)]
fn answer_in_lanes(
    starts: [&StartOfStep; Lanes::WIDTH],
    increments: &[Increment<2>; Lanes::WIDTH],
    material: &dyn Material,
    history: &mut [Lanes],
) -> Option<AnswerInLanes> {
    let (mut b_n, mut dF) = ([Lanes::ZERO; 4], [[Lanes::ZERO; 2]; 2]);
    let (mut volume_n, mut J_n) = (Lanes::ZERO, Lanes::ZERO);
    for p in 0..Lanes::WIDTH {
        let [xx, yy, zz, _, _, xy] = starts[p].b_n.0;
        (b_n[0].0[p], b_n[1].0[p], b_n[2].0[p], b_n[3].0[p]) = (xx, yy, zz, xy);
        (volume_n.0[p], J_n.0[p]) = (starts[p].volume_n, starts[p].J_n);
        for i in 0..2 {
            for j in 0..2 {
                dF[i][j].0[p] = increments[p].dF[i][j];
            }
        }
    }
    let trial = Trial::new(&b_n, &dF);
    if !trial.dJ.is_positive() {
        return None;
    }
    let law = match (material.vectorised(), material.principal()) {
        (Some(law), _) => vectorised(law, &trial.b, history),
        (None, Some(law)) => principal::in_lanes(law, &trial.b, history)?,
        (None, None) => return None,
    };
    let size = law.tau[0] + law.tau[1] + law.tau[2] + law.tau[3];
    let is_finite = (size * size).is_below(f64::INFINITY);
    is_finite.then_some(AnswerInLanes { law, trial, dF, weight: volume_n / J_n })
}

#[inline(always)]
fn vectorised(law: &dyn VectorisedLaw, b: &[Lanes; 4], history: &mut [Lanes]) -> InPlaneAnswer<Lanes> {
    let (log_b, L) = plane::log_with_derivative(b);
    let answer = law.respond(&[log_b[0] * 0.5, log_b[1] * 0.5, log_b[2] * 0.5, log_b[3] * 0.5], history);
    let C = half_product(&tangent(&answer), &L);
    InPlaneAnswer { tau: answer.tau, elastic_strain: answer.elastic_strain, C }
}

impl Mechanics<2> for PlaneStrain {
    const VECTORISED: bool = true;

    type Previous = InPlane;
    type Isotropic = InPlane;
    type Current = Current<2, 2>;
    type Averaging = MeanDilatation<2, 2>;
    type AveragingIsotropic = MeanDilatation<2, 2>;
    type Deviation = Deviation<2, 2>;
    const DILATED: usize = 2;

    #[inline(always)]
    fn respond(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<InPlane>, PointError> {
        let dF = &increment.dF;
        let Answer { trial, law, C, tau } = answer(start, dF, material, old, new)?;
        let weak = previous(&C, &tau, dF, &trial, start.volume_n / start.J_n);
        Ok(PointResponse { weak, tau: law.0, elastic_strain: law.1 })
    }

    #[inline(always)]
    fn respond_vectorised(
        starts: [&StartOfStep; Lanes::WIDTH],
        increments: &[Increment<2>; Lanes::WIDTH],
        material: &dyn Material,
        history: &mut [Lanes],
    ) -> Option<[PointResponse<InPlane>; Lanes::WIDTH]> {
        let AnswerInLanes { law, trial, dF, weight } =
            answer_in_lanes(starts, increments, material, history)?;
        let weak = previous(&law.C, &in_plane(&law.tau), &dF, &trial, weight);
        Some([
            point(weak.point(0), &law, 0),
            point(weak.point(1), &law, 1),
            point(weak.point(2), &law, 2),
            point(weak.point(3), &law, 3),
        ])
    }

    #[inline(always)]
    fn respond_current(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Current<2, 2>>, PointError> {
        let dF = &increment.dF;
        let Answer { trial, law, C, tau } = answer(start, dF, material, old, new)?;
        let weak = current(&C, &tau, dF, &trial, start.volume_n / start.J_n);
        Ok(PointResponse { weak, tau: law.0, elastic_strain: law.1 })
    }

    #[inline(always)]
    fn respond_averaging(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<MeanDilatation<2, 2>>, PointError> {
        Ok(Self::respond_current(start, increment, material, old, new)?.map(MeanDilatation::new))
    }

    #[inline(always)]
    fn respond_averaging_vectorised(
        starts: [&StartOfStep; Lanes::WIDTH],
        increments: &[Increment<2>; Lanes::WIDTH],
        material: &dyn Material,
        history: &mut [Lanes],
    ) -> Option<[PointResponse<MeanDilatation<2, 2>>; Lanes::WIDTH]> {
        let AnswerInLanes { law, trial, dF, weight } =
            answer_in_lanes(starts, increments, material, history)?;
        let weak = MeanDilatation::new(current(&law.C, &in_plane(&law.tau), &dF, &trial, weight));
        Some([
            point(weak.point(0), &law, 0),
            point(weak.point(1), &law, 1),
            point(weak.point(2), &law, 2),
            point(weak.point(3), &law, 3),
        ])
    }

    fn elastic_left_cauchy_green(measure: StrainMeasure, elastic_strain: &Sym3) -> Sym3 {
        match measure {
            StrainMeasure::Logarithmic => plane::exp(&(*elastic_strain * 2.0)),
            StrainMeasure::LeftCauchyGreen => measure.left_cauchy_green(elastic_strain),
        }
    }
}

// The functions on lanes below use loops instead of `from_fn`: the compiler does not always inline its closures, and
// then does not vectorise them.

/// The response of one point with its weak form.
#[inline(always)]
fn point<W>(weak: W, law: &InPlaneAnswer<Lanes>, lane: usize) -> PointResponse<W> {
    let InPlaneAnswer { tau, elastic_strain: e, .. } = law;
    PointResponse {
        weak,
        tau: plane::tensor([tau[0].0[lane], tau[1].0[lane], tau[2].0[lane], tau[3].0[lane]]),
        elastic_strain: plane::tensor([e[0].0[lane], e[1].0[lane], e[2].0[lane], e[3].0[lane]]),
    }
}

/// Rows of the in-plane components in the Mandel layout.
const IN_PLANE: [usize; 3] = [0, 1, 5];

/// Index of component (i, j) into the components `xx, yy, xy`.
const IN_PLANE_INDEX: [[usize; 2]; 2] = [[0, 2], [2, 1]];

/// The in-plane block of `xx, yy, zz, √2 xy`.
#[inline(always)]
fn in_plane<T: Lane>(t: &[T; 4]) -> Rows<T> {
    let xy = t[3] * FRAC_1_SQRT_2;
    [[t[0], xy], [xy, t[1]]]
}

#[inline(always)]
fn invert<T: Lane>(dF: &Rows<T>, dJ: T) -> Rows<T> {
    let per_dJ = T::splat(1.0) / dJ;
    [[dF[1][1] * per_dJ, dF[0][1] * per_dJ * -1.0], [dF[1][0] * per_dJ * -1.0, dF[0][0] * per_dJ]]
}

/// The in-plane components of D^alg, in the order `xx, yy, √2 xy`.
#[inline(always)]
fn tangent<T: Lane>(answer: &CompactResponse<T, 4>) -> [[T; 3]; 3] {
    let CompactResponse { lambda, mu, along, n, .. } = answer;
    let (lambda, twice_mu) = (*lambda, *mu * 2.0);
    let [x, y, s] = [n[0], n[1], n[3]];
    let [along_x, along_y, along_s] = [*along * x, *along * y, *along * s];
    let (xx, yy) = (lambda + twice_mu - along_x * x, lambda + twice_mu - along_y * y);
    let (xy, xs, ys) = (lambda - along_x * y, along_x * s * -1.0, along_y * s * -1.0);
    [[xx, xy, xs], [xy, yy, ys], [xs, ys, twice_mu - along_s * s]]
}

/// The in-plane components of C = ½ D^alg L, the derivative of τ with respect to b, in the order `xx, yy, √2 xy`.
#[inline(always)]
fn half_product<T: Lane>(D: &[[T; 3]; 3], L: &[[T; 3]; 3]) -> [[T; 3]; 3] {
    let mut C = *D;
    for r in 0..3 {
        for c in 0..3 {
            C[r][c] = (D[r][0] * L[0][c] + D[r][1] * L[1][c] + D[r][2] * L[2][c]) * 0.5;
        }
    }
    C
}

/// C : B as `[component][k][l]` for the components xx, yy, xy. B_ijkl = δ_ik A_jl + A_il δ_jk is the derivative of b,
/// eqs. (A.2) and (A.5).
#[inline(always)]
fn contract<T: Lane>(C: &[[T; 3]; 3], A: &Rows<T>) -> [Rows<T>; 3] {
    let mut product = [[[C[0][0]; 2]; 2]; 3];
    for (r, scale) in [1.0, 1.0, FRAC_1_SQRT_2].into_iter().enumerate() {
        let (xx, yy, xy) = (C[r][0] * (2.0 * scale), C[r][1] * (2.0 * scale), C[r][2] * (SQRT_2 * scale));
        for l in 0..2 {
            product[r][0][l] = xx * A[0][l] + xy * A[1][l];
            product[r][1][l] = yy * A[1][l] + xy * A[0][l];
        }
    }
    product
}

/// V_n P̃ of eq. (18) and its derivative V_n Ã of eqs. (A.3)-(A.6); `weight` is V_n/J_n.
#[inline(always)]
fn previous<T: Lane>(
    C: &[[T; 3]; 3],
    tau: &Rows<T>,
    dF: &Rows<T>,
    trial: &Trial<T>,
    weight: T,
) -> InPlane<T> {
    let inverse = invert(dF, trial.dJ);
    let (mut weighted, mut stress) = (inverse, inverse);
    for j in 0..2 {
        weighted[j] = [inverse[j][0] * weight, inverse[j][1] * weight];
        for i in 0..2 {
            stress[j][i] = tau[i][0] * weighted[j][0] + tau[i][1] * weighted[j][1];
        }
    }
    let dtau = contract(C, &trial.A); // (A.4)
    let mut tangent = [[inverse; 2]; 2];
    for l in 0..2 {
        for j in 0..2 {
            for i in 0..2 {
                let [first, second] = [&dtau[IN_PLANE_INDEX[i][0]], &dtau[IN_PLANE_INDEX[i][1]]];
                for k in 0..2 {
                    // (A.3) with (A.6): τ_im ∂ΔF⁻¹_jm/∂ΔF_kl = −τ_im ΔF⁻¹_lm ΔF⁻¹_jk.
                    tangent[l][j][i][k] = weighted[j][0] * first[k][l] + weighted[j][1] * second[k][l]
                        - stress[l][i] * inverse[j][k];
                }
            }
        }
    }
    InPlane { stress, tangent }
}

/// V σ and V a of eqs. (A.1)-(A.2), with S_ijkl = σ_il δ_jk; `weight` is V⁰ = V_n/J_n, and V σ = V⁰ τ.
#[inline(always)]
fn current<T: Lane>(
    C: &[[T; 3]; 3],
    tau: &Rows<T>,
    dF: &Rows<T>,
    trial: &Trial<T>,
    weight: T,
) -> Current<2, 2, T> {
    let inverse = invert(dF, trial.dJ);
    let CB = contract(C, &in_plane(&trial.b));
    let mut stress = *tau;
    stress.as_flattened_mut().iter_mut().for_each(|x| *x = *x * weight);
    let mut tangent = [[stress; 2]; 2];
    for l in 0..2 {
        for j in 0..2 {
            for i in 0..2 {
                for k in 0..2 {
                    let change = CB[IN_PLANE_INDEX[i][j]][k][l] * weight;
                    tangent[l][j][i][k] = if j == k { change - stress[i][l] } else { change };
                }
            }
        }
    }
    Current { stress, tangent, inverse, per_radius: T::splat(0.0) }
}
