//! Return mapping to the planes of Mohr and Coulomb and of a tension cut-off, in the space of principal stresses.
//!
//! In a sector of ordered stresses τ₁ ≥ τ₂ ≥ τ₃ (tension positive) the surface consists of the shear plane N τ₁ − τ₃ = s
//! and the tension plane τ₁ = T. Their mirror images in the neighbouring sectors, N τ₂ − τ₃ = s, N τ₁ − τ₂ = s and τ₂ = T,
//! meet them in edges and vertices. Stresses and moduli of all faces and edges follow from one formula with one or two
//! planes (Koiter 1953; de Souza Neto, Perić and Owen 2008, chapter 8; Clausen, Damkilde and Andersen 2007,
//! doi 10.1016/j.compstruc.2006.10.010): nothing iterates.

use super::Elasticity;

/// Strength of Mohr and Coulomb with a tension cut-off; also a derivative of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    /// N = (1 + sin φ)/(1 − sin φ), [-].
    pub ratio: f64,
    /// The same of the dilation angle, [-].
    pub flow_ratio: f64,
    /// Uniaxial compressive strength s = 2c√N, [stress].
    pub compressive: f64,
    /// Tensile strength T, [stress]; infinite without cut-off.
    pub tensile: f64,
}

/// The stress on the surface and what it depends on, for `R` parameters of the strength.
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

/// The faces and edges in an ordered sector and on its borders.
const CANDIDATES: [&[Plane]; 6] = [
    &[Plane::Shear(0, 2)],
    &[Plane::Shear(0, 2), Plane::Shear(1, 2)],
    &[Plane::Shear(0, 2), Plane::Shear(0, 1)],
    &[Plane::Tension(0)],
    &[Plane::Shear(0, 2), Plane::Tension(0)],
    &[Plane::Tension(0), Plane::Tension(1)],
];

/// Relative error of stresses and flow up to which a face or edge is accepted at once, [-].
const ACCEPTED: f64 = 1e-13;

type Vector = [f64; 3];

fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Plane {
    /// Its gradient.
    fn normal(self, ratio: f64) -> Vector {
        let mut normal = [0.0; 3];
        match self {
            Plane::Shear(i, j) => (normal[i], normal[j]) = (ratio, -1.0),
            Plane::Tension(i) => normal[i] = 1.0,
        }
        normal
    }

    fn limit(self, strength: &Strength) -> f64 {
        match self {
            Plane::Shear(..) => strength.compressive,
            Plane::Tension(_) => strength.tensile,
        }
    }

    /// Derivative of the gradient with respect to a parameter, given that of the ratio.
    fn normal_rate(self, ratio_rate: f64) -> Vector {
        let mut rate = [0.0; 3];
        if let Plane::Shear(i, _) = self {
            rate[i] = ratio_rate;
        }
        rate
    }
}

impl Strength {
    /// Without friction there is no limit to the tension on all sides.
    fn apex(&self) -> f64 {
        if self.ratio > 1.0 { self.compressive / (self.ratio - 1.0) } else { f64::INFINITY }
    }

    /// True if the tension cut-off cuts the cone.
    fn is_cut(&self) -> bool {
        self.tensile < self.apex()
    }

    /// By how much ordered stresses violate the strength, [stress]; negative inside.
    pub fn excess(&self, tau: &Vector) -> f64 {
        let shear = self.ratio * tau[0] - tau[2] - self.compressive;
        if self.is_cut() { shear.max(tau[0] - self.tensile) } else { shear }
    }

    /// The same for stresses in any order.
    fn excess_unordered(&self, tau: &Vector) -> f64 {
        let largest = tau[0].max(tau[1]).max(tau[2]);
        let smallest = tau[0].min(tau[1]).min(tau[2]);
        self.excess(&[largest, 0.0, smallest])
    }

    /// Returns ordered trial stresses beyond the surface to it. `rates` are the derivatives of the strength with respect to
    /// the parameters.
    pub fn returned<const R: usize>(
        &self,
        elasticity: &Elasticity,
        trial: &Vector,
        rates: &[Strength; R],
    ) -> Returned<R> {
        let scale = trial[0].abs().max(trial[2].abs()).max(self.compressive);
        let mut best: Option<(f64, Face)> = None;
        for planes in CANDIDATES {
            if planes.iter().any(|plane| matches!(plane, Plane::Tension(_))) && !self.is_cut() {
                continue;
            }
            let face = Face::new(self, elasticity, trial, planes);
            let error = face.violation(self) / scale;
            if error <= ACCEPTED {
                return face.finish(self, elasticity, rates);
            }
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, face));
            }
        }
        // With round-off, an edge may fail by a little where a vertex fails by more.
        let vertex = Vertex::nearest(self, elasticity, trial);
        match best {
            Some((error, face)) if error < vertex.violation / scale => face.finish(self, elasticity, rates),
            _ => vertex.finish(self, rates),
        }
    }
}

/// The stress returned to one or two planes.
struct Face {
    planes: &'static [Plane],
    tau: Vector,
    /// Multipliers of the flow on each plane, [-]; zero beyond the number of planes.
    flow: [f64; 2],
    /// Multipliers times the shear modulus, [stress].
    weighted_flow: [f64; 2],
    /// Inverse of Aᵀ D G, A the normals and G the directions of flow.
    inverse: [[f64; 2]; 2],
}

impl Face {
    fn new(strength: &Strength, elasticity: &Elasticity, trial: &Vector, planes: &'static [Plane]) -> Face {
        let mut flow_stress = [[0.0; 3]; 2];
        let mut normals = [[0.0; 3]; 2];
        let mut excess = [0.0; 2];
        for (k, plane) in planes.iter().enumerate() {
            normals[k] = plane.normal(strength.ratio);
            flow_stress[k] = elasticity.principal_stress(plane.normal(strength.flow_ratio));
            excess[k] = dot(&normals[k], trial) - plane.limit(strength);
        }
        let entry = |i: usize, j: usize| dot(&normals[i], &flow_stress[j]);
        let inverse = if planes.len() == 1 {
            [[1.0 / entry(0, 0), 0.0], [0.0, 0.0]]
        } else {
            let [a, b, c, d] = [entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)];
            let per_determinant = 1.0 / (a * d - b * c);
            [[d * per_determinant, -b * per_determinant], [-c * per_determinant, a * per_determinant]]
        };
        let flow = inverse.map(|row| row[0] * excess[0] + row[1] * excess[1]);
        let mut tau: Vector =
            std::array::from_fn(|i| trial[i] - flow_stress[0][i] * flow[0] - flow_stress[1][i] * flow[1]);
        if let [Plane::Shear(_, j), Plane::Shear(_, l)] = planes {
            // The two stresses that are equal on this edge are so to the last bit.
            let (a, b) = if j == l { (0, 1) } else { (1, 2) };
            let mean = 0.5 * (tau[a] + tau[b]);
            (tau[a], tau[b]) = (mean, mean);
        }
        for plane in planes {
            if let Plane::Tension(i) = plane {
                tau[*i] = strength.tensile;
            }
        }
        Face { planes, tau, flow, weighted_flow: flow.map(|x| x * elasticity.shear), inverse }
    }

    /// The largest of the stress beyond other planes and of flow against its direction, [stress]; not a number counts as
    /// infinite.
    fn violation(&self, strength: &Strength) -> f64 {
        let back = -self.weighted_flow[0].min(self.weighted_flow[1]);
        let beyond = strength.excess_unordered(&self.tau);
        let violation = back.max(beyond);
        if violation.is_nan() { f64::INFINITY } else { violation }
    }

    /// Stress with the derivatives. With the multipliers Λ = (AᵀDG)⁻¹ (Aᵀτ^tr − b), τ = τ^tr − D G Λ, a change of the
    /// parameters changes τ by −D G (AᵀDG)⁻¹ (A'ᵀτ − b' − AᵀDG'Λ) − D G'Λ.
    fn finish<const R: usize>(
        &self,
        strength: &Strength,
        elasticity: &Elasticity,
        rates: &[Strength; R],
    ) -> Returned<R> {
        let planes = self.planes;
        let normals: [Vector; 2] =
            std::array::from_fn(|k| planes.get(k).map_or([0.0; 3], |plane| plane.normal(strength.ratio)));
        let directions = std::array::from_fn(|k| {
            planes.get(k).map_or([0.0; 3], |plane| plane.normal(strength.flow_ratio))
        });
        let [normal_stress, flow_stress] =
            [normals, directions].map(|vectors| vectors.map(|v| elasticity.principal_stress(v)));
        let mut modulus = elasticity.principal_modulus();
        for (a, row) in self.inverse.iter().enumerate() {
            for (b, inverse) in row.iter().enumerate() {
                for i in 0..3 {
                    for j in 0..3 {
                        modulus[i][j] -= flow_stress[a][i] * inverse * normal_stress[b][j];
                    }
                }
            }
        }
        let by_parameter = rates.map(|rate| {
            let mut turned = [0.0; 3]; // G'Λ
            for (k, plane) in planes.iter().enumerate() {
                let of_plane = plane.normal_rate(rate.flow_ratio);
                (0..3).for_each(|i| turned[i] += of_plane[i] * self.flow[k]);
            }
            let turned_stress = elasticity.principal_stress(turned);
            let right: [f64; 2] = std::array::from_fn(|k| {
                planes.get(k).map_or(0.0, |plane| {
                    dot(&plane.normal_rate(rate.ratio), &self.tau)
                        - plane.limit(&rate)
                        - dot(&normals[k], &turned_stress)
                })
            });
            let change = self.inverse.map(|row| row[0] * right[0] + row[1] * right[1]);
            std::array::from_fn(|i| {
                -flow_stress[0][i] * change[0] - flow_stress[1][i] * change[1] - turned_stress[i]
            })
        });
        Returned { tau: self.tau, modulus, by_parameter }
    }
}

/// A vertex of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// The apex of the cone, without cut-off.
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
    place: Place,
    tau: Vector,
    /// Flow against its direction, times the shear modulus, [stress].
    violation: f64,
}

impl Vertex {
    fn new(place: Place, strength: &Strength, elasticity: &Elasticity, trial: &Vector) -> Vertex {
        let tau = place.stress(strength);
        let flow = elasticity.principal_strain(std::array::from_fn(|i| trial[i] - tau[i]));
        let ratio = strength.flow_ratio;
        // The flow must be a sum of those of the planes that meet here, with positive multipliers.
        let multipliers = match place {
            Place::Apex => [flow[0] + flow[1] + ratio * flow[2], flow[0] + ratio * (flow[1] + flow[2]), 0.0],
            Place::Tension => flow,
            Place::TwoTensions => {
                [flow[0].min(flow[1]), -flow[2], (flow[0] + flow[1] + ratio * flow[2]) / ratio]
            }
            Place::OneTension => [flow[0] + ratio * (flow[1] + flow[2]), -flow[1], -flow[2]],
        };
        let least = multipliers[0].min(multipliers[1]).min(multipliers[2]);
        let violation = if tau[0].is_finite() { -least * elasticity.shear } else { f64::INFINITY };
        Vertex { place, tau, violation }
    }

    /// The vertex whose flow is least in error.
    fn nearest(strength: &Strength, elasticity: &Elasticity, trial: &Vector) -> Vertex {
        let at = |place| Vertex::new(place, strength, elasticity, trial);
        if !strength.is_cut() {
            return at(Place::Apex);
        }
        let [a, b, c] = [at(Place::Tension), at(Place::TwoTensions), at(Place::OneTension)];
        let better = |a: Vertex, b: Vertex| if b.violation < a.violation { b } else { a };
        better(better(a, b), c)
    }

    fn finish<const R: usize>(&self, strength: &Strength, rates: &[Strength; R]) -> Returned<R> {
        let by_parameter = rates.map(|rate| self.place.stress_rate(strength, &rate));
        Returned { tau: self.tau, modulus: [[0.0; 3]; 3], by_parameter }
    }
}

impl Place {
    fn stress(self, strength: &Strength) -> Vector {
        let Strength { ratio, compressive, tensile, .. } = *strength;
        let low = ratio * tensile - compressive;
        match self {
            Place::Apex => [strength.apex(); 3],
            Place::Tension => [tensile; 3],
            Place::TwoTensions => [tensile, tensile, low],
            Place::OneTension => [tensile, low, low],
        }
    }

    fn stress_rate(self, strength: &Strength, rate: &Strength) -> Vector {
        let low = rate.ratio * strength.tensile + strength.ratio * rate.tensile - rate.compressive;
        match self {
            Place::Apex => [(rate.compressive - strength.apex() * rate.ratio) / (strength.ratio - 1.0); 3],
            Place::Tension => [rate.tensile; 3],
            Place::TwoTensions => [rate.tensile, rate.tensile, low],
            Place::OneTension => [rate.tensile, low, low],
        }
    }
}
