//! Return mapping to the Mohr-Coulomb planes and the planes of a tension cut-off, in principal stress space.
//!
//! In a sector of ordered stresses τ₁ ≥ τ₂ ≥ τ₃ (tension positive), the surface consists of the shear plane
//! N τ₁ − τ₃ = s and the tension plane τ₁ = T. Their mirror images in the neighbouring sectors, N τ₂ − τ₃ = s,
//! N τ₁ − τ₂ = s and τ₂ = T, meet them in edges and vertices. Stresses and moduli on all faces and edges follow from
//! one formula with one or two planes (Koiter 1953; de Souza Neto, Perić and Owen 2008, chapter 8; Clausen, Damkilde
//! and Andersen 2007, doi 10.1016/j.compstruc.2006.10.010), without iteration.

use crate::material::Elasticity;

/// Mohr-Coulomb strength with a tension cut-off; also a derivative of such a strength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    /// N = (1 + sin φ)/(1 − sin φ), [-].
    pub ratio: f64,
    /// The same ratio for the dilation angle, [-].
    pub flow_ratio: f64,
    /// Uniaxial compressive strength s = 2c√N, [stress].
    pub compressive: f64,
    /// Tensile strength T, [stress]; infinite without a cut-off.
    pub tensile: f64,
}

/// The stress on the surface and its derivatives, for `R` parameters of the strength.
pub struct Returned<const R: usize> {
    /// Principal stresses, [stress].
    pub tau: [f64; 3],
    /// Their derivatives with respect to the trial strains at constant strength, `[i][j]`, [stress].
    pub modulus: [[f64; 3]; 3],
    /// Their derivatives with respect to the parameters.
    pub by_parameter: [[f64; 3]; R],
}

/// A plane of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Plane {
    /// N τ_i − τ_j = s.
    Shear(usize, usize),
    /// τ_i = T.
    Tension(usize),
}

/// Largest relative error of stresses and flow at which a face or edge is accepted at once, [-].
const ACCEPTED: f64 = 1e-13;

type Vector = [f64; 3];

#[inline(always)]
fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Plane {
    /// Normal to the plane: the gradient of the left-hand side of its equation.
    #[inline(always)]
    fn normal(self, ratio: f64) -> Vector {
        let mut normal = [0.0; 3];
        match self {
            Plane::Shear(i, j) => (normal[i], normal[j]) = (ratio, -1.0),
            Plane::Tension(i) => normal[i] = 1.0,
        }
        normal
    }

    #[inline(always)]
    fn limit(self, strength: &Strength) -> f64 {
        match self {
            Plane::Shear(..) => strength.compressive,
            Plane::Tension(_) => strength.tensile,
        }
    }

    /// Derivative of the normal with respect to a parameter, given the derivative of the ratio.
    #[inline(always)]
    fn normal_rate(self, ratio_rate: f64) -> Vector {
        let mut rate = [0.0; 3];
        if let Plane::Shear(i, _) = self {
            rate[i] = ratio_rate;
        }
        rate
    }
}

impl Strength {
    /// Tensile strength under isotropic stress; infinite without friction.
    #[inline(always)]
    fn apex(&self) -> f64 {
        if self.ratio > 1.0 { self.compressive / (self.ratio - 1.0) } else { f64::INFINITY }
    }

    /// True if the tension cut-off cuts the pyramid.
    #[inline(always)]
    pub fn is_cut(&self) -> bool {
        self.tensile < self.apex()
    }

    /// Amount by which ordered stresses violate the strength, [stress]; negative inside the surface.
    #[inline(always)]
    pub fn excess(&self, tau: &Vector) -> f64 {
        let shear = self.ratio * tau[0] - tau[2] - self.compressive;
        if self.is_cut() { shear.max(tau[0] - self.tensile) } else { shear }
    }

    /// As [`Self::excess`], for stresses in any order.
    #[inline(always)]
    fn excess_unordered(&self, tau: &Vector) -> f64 {
        let largest = tau[0].max(tau[1]).max(tau[2]);
        let smallest = tau[0].min(tau[1]).min(tau[2]);
        self.excess(&[largest, 0.0, smallest])
    }

    /// Maps ordered trial stresses outside the surface back to the surface. `rates` are the derivatives of the
    /// strength with respect to the parameters, if the derivatives of the stresses are required.
    pub fn returned<const R: usize>(
        &self,
        elasticity: &Elasticity,
        trial: &Vector,
        rates: Option<&[Strength; R]>,
    ) -> Returned<R> {
        use Plane::{Shear, Tension};
        let scale = trial[0].abs().max(trial[2].abs()).max(self.compressive);
        let (mut least, mut best) = (f64::INFINITY, 0);
        // Each face and edge is compiled separately. The last round returns the result with the smallest error.
        macro_rules! attempt {
            ($number:literal, $planes:expr, $is_last:expr) => {
                let face = Face::new(self, elasticity, trial, $planes);
                let error = face.violation(self, elasticity) / scale;
                if error <= ACCEPTED || $is_last && best == $number {
                    return face.finish(elasticity, rates);
                }
                if error < least {
                    (least, best) = (error, $number);
                }
            };
        }
        let is_cut = self.is_cut();
        let mut is_last = false;
        loop {
            attempt!(1, [Shear(0, 2)], is_last);
            attempt!(2, [Shear(0, 2), Shear(1, 2)], is_last);
            attempt!(3, [Shear(0, 2), Shear(0, 1)], is_last);
            if is_cut {
                attempt!(4, [Tension(0)], is_last);
                attempt!(5, [Shear(0, 2), Tension(0)], is_last);
                attempt!(6, [Tension(0), Tension(1)], is_last);
            }
            // Because of round-off, a face or edge may be rejected by a small margin, and every vertex by a larger one.
            let vertex = Vertex::nearest(self, elasticity, trial);
            if is_last || vertex.violation / scale <= least {
                return vertex.finish(self, rates);
            }
            is_last = true;
        }
    }
}

/// The stress returned to `M` planes, one or two.
struct Face<const M: usize> {
    planes: [Plane; M],
    tau: Vector,
    /// Multipliers of the flow on each plane, [-].
    flow: [f64; M],
    /// D A and D G, [stress], with the elastic stiffness D, the normals A and the flow directions G.
    normal_stress: [Vector; M],
    flow_stress: [Vector; M],
    /// Inverse of Aᵀ D G.
    inverse: [[f64; M]; M],
}

impl<const M: usize> Face<M> {
    #[inline(always)]
    fn new(strength: &Strength, elasticity: &Elasticity, trial: &Vector, planes: [Plane; M]) -> Face<M> {
        let normals = planes.map(|plane| plane.normal(strength.ratio));
        let normal_stress = normals.map(|normal| elasticity.principal_stress(normal));
        let flow_stress = planes.map(|plane| elasticity.principal_stress(plane.normal(strength.flow_ratio)));
        let excess: [f64; M] = std::array::from_fn(|k| dot(&normals[k], trial) - planes[k].limit(strength));
        let inverse =
            inverted(std::array::from_fn(|i| std::array::from_fn(|j| dot(&normals[i], &flow_stress[j]))));
        let flow: [f64; M] =
            std::array::from_fn(|a| (0..M).fold(0.0, |sum, b| sum + inverse[a][b] * excess[b]));
        let mut tau: Vector =
            std::array::from_fn(|i| (0..M).fold(trial[i], |tau, k| tau - flow_stress[k][i] * flow[k]));
        if let [Plane::Shear(_, j), Plane::Shear(_, l)] = planes.as_slice() {
            // The two stresses that are equal on this edge become equal to the last bit.
            let (a, b) = if j == l { (0, 1) } else { (1, 2) };
            let mean = 0.5 * (tau[a] + tau[b]);
            (tau[a], tau[b]) = (mean, mean);
        }
        for plane in &planes {
            if let Plane::Tension(i) = plane {
                tau[*i] = strength.tensile;
            }
        }
        Face { planes, tau, flow, normal_stress, flow_stress, inverse }
    }

    /// The larger of two violations, [stress]: the amount by which the stress exceeds the strength, and −G λ with the
    /// smallest multiplier λ of the flow, which must not be negative. Infinite if the result is NaN.
    #[inline(always)]
    fn violation(&self, strength: &Strength, elasticity: &Elasticity) -> f64 {
        let back = self.flow.iter().fold(f64::NEG_INFINITY, |most, flow| most.max(-elasticity.shear * flow));
        let violation = back.max(strength.excess_unordered(&self.tau));
        if violation.is_nan() || self.tau[0].is_nan() { f64::INFINITY } else { violation }
    }

    /// The stress and its derivatives. With the limits b and the multipliers Λ = (AᵀDG)⁻¹ (Aᵀτ^tr − b), the stress is
    /// τ = τ^tr − D G Λ. A change of the parameters changes τ by −D G (AᵀDG)⁻¹ (A'ᵀτ − b' − AᵀDG'Λ) − D G'Λ.
    #[inline(always)]
    fn finish<const R: usize>(&self, elasticity: &Elasticity, rates: Option<&[Strength; R]>) -> Returned<R> {
        let Face { planes, flow, normal_stress, flow_stress, inverse, tau } = self;
        let mut modulus = elasticity.principal_modulus();
        for a in 0..M {
            for b in 0..M {
                for i in 0..3 {
                    for j in 0..3 {
                        modulus[i][j] -= flow_stress[a][i] * inverse[a][b] * normal_stress[b][j];
                    }
                }
            }
        }
        let mut by_parameter = [[0.0; 3]; R];
        for (change, rate) in by_parameter.iter_mut().zip(rates.into_iter().flatten()) {
            let mut turned = [0.0; 3]; // G'Λ
            for (plane, flow) in planes.iter().zip(flow) {
                let normal_rate = plane.normal_rate(rate.flow_ratio);
                (0..3).for_each(|i| turned[i] += normal_rate[i] * flow);
            }
            let right: [f64; M] = std::array::from_fn(|k| {
                let plane = planes[k];
                dot(&plane.normal_rate(rate.ratio), tau) - plane.limit(rate) - dot(&normal_stress[k], &turned)
            });
            let flow_change: [f64; M] =
                std::array::from_fn(|a| (0..M).fold(0.0, |sum, b| sum + inverse[a][b] * right[b]));
            let turned_stress = elasticity.principal_stress(turned);
            *change = std::array::from_fn(|i| {
                (0..M).fold(-turned_stress[i], |sum, k| sum - flow_stress[k][i] * flow_change[k])
            });
        }
        Returned { tau: *tau, modulus, by_parameter }
    }
}

/// The inverse of a 1×1 or 2×2 matrix.
#[inline(always)]
fn inverted<const M: usize>(matrix: [[f64; M]; M]) -> [[f64; M]; M] {
    let mut inverse = matrix;
    if M == 1 {
        inverse[0][0] = 1.0 / matrix[0][0];
    } else {
        let [a, b, c, d] = [matrix[0][0], matrix[0][1], matrix[1][0], matrix[1][1]];
        let per_determinant = 1.0 / (a * d - b * c);
        (inverse[0][0], inverse[0][1]) = (d * per_determinant, -b * per_determinant);
        (inverse[1][0], inverse[1][1]) = (-c * per_determinant, a * per_determinant);
    }
    inverse
}

/// A vertex of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum VertexKind {
    /// The apex of the pyramid, if there is no cut-off.
    Apex,
    /// T, T, T.
    Tension,
    /// T, T, N T − s.
    TwoTensions,
    /// T, N T − s, N T − s.
    OneTension,
}

/// The stress returned to a vertex.
struct Vertex {
    kind: VertexKind,
    tau: Vector,
    /// −G times the smallest multiplier of the flow, [stress]; positive if a multiplier is negative.
    violation: f64,
}

impl Vertex {
    fn new(kind: VertexKind, strength: &Strength, elasticity: &Elasticity, trial: &Vector) -> Vertex {
        let tau = kind.stress(strength);
        let flow = elasticity.principal_strain(std::array::from_fn(|i| trial[i] - tau[i]));
        let ratio = strength.flow_ratio;
        // The flow must be a sum of the flow directions of the planes that meet here, with positive multipliers.
        let multipliers = match kind {
            VertexKind::Apex => {
                [flow[0] + flow[1] + ratio * flow[2], flow[0] + ratio * (flow[1] + flow[2]), 0.0]
            }
            VertexKind::Tension => flow,
            VertexKind::TwoTensions => {
                [flow[0].min(flow[1]), -flow[2], (flow[0] + flow[1] + ratio * flow[2]) / ratio]
            }
            VertexKind::OneTension => [flow[0] + ratio * (flow[1] + flow[2]), -flow[1], -flow[2]],
        };
        let least = multipliers[0].min(multipliers[1]).min(multipliers[2]);
        let violation = if tau[0].is_finite() { -least * elasticity.shear } else { f64::INFINITY };
        Vertex { kind, tau, violation }
    }

    /// The vertex whose flow has the smallest error.
    fn nearest(strength: &Strength, elasticity: &Elasticity, trial: &Vector) -> Vertex {
        let at = |kind| Vertex::new(kind, strength, elasticity, trial);
        if !strength.is_cut() {
            return at(VertexKind::Apex);
        }
        let [a, b, c] = [at(VertexKind::Tension), at(VertexKind::TwoTensions), at(VertexKind::OneTension)];
        let better = |a: Vertex, b: Vertex| if b.violation < a.violation { b } else { a };
        better(better(a, b), c)
    }

    fn finish<const R: usize>(&self, strength: &Strength, rates: Option<&[Strength; R]>) -> Returned<R> {
        let rate =
            |k| rates.map_or([0.0; 3], |rates: &[Strength; R]| self.kind.stress_rate(strength, &rates[k]));
        let by_parameter = std::array::from_fn(rate);
        Returned { tau: self.tau, modulus: [[0.0; 3]; 3], by_parameter }
    }
}

impl VertexKind {
    fn stress(self, strength: &Strength) -> Vector {
        let Strength { ratio, compressive, tensile, .. } = *strength;
        let low = ratio * tensile - compressive;
        match self {
            VertexKind::Apex => [strength.apex(); 3],
            VertexKind::Tension => [tensile; 3],
            VertexKind::TwoTensions => [tensile, tensile, low],
            VertexKind::OneTension => [tensile, low, low],
        }
    }

    fn stress_rate(self, strength: &Strength, rate: &Strength) -> Vector {
        let low = rate.ratio * strength.tensile + strength.ratio * rate.tensile - rate.compressive;
        match self {
            VertexKind::Apex => {
                [(rate.compressive - strength.apex() * rate.ratio) / (strength.ratio - 1.0); 3]
            }
            VertexKind::Tension => [rate.tensile; 3],
            VertexKind::TwoTensions => [rate.tensile, rate.tensile, low],
            VertexKind::OneTension => [rate.tensile, low, low],
        }
    }
}
