//! The fields of material points and grid nodes as they are written to files.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use mpm_core::basis::{BodyGroup, Connectivity, DomainKind};
use mpm_core::grid::vtk_corner;
use mpm_core::model::{HistoryVariable, Model};
use mpm_core::points::{PIECE, PointVolume, Points};
use mpm_core::tensor::{Mat3, Sym3, padded};

use super::vtu::{
    CellKind, Compute, Encoded, Field, Precision, Room, SYMMETRIC_TENSOR, TENSOR, VECTOR, Values,
};

/// The history variable that is a [`PointField`]; zero for laws without it.
const EQUIVALENT_PLASTIC_STRAIN: &str = "equivalent_plastic_strain";

/// Names of the principal values of a tensor.
const PRINCIPAL: [&str; 3] = ["1", "2", "3"];

/// A field of the points in result files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PointField {
    /// Displacement since the start or the last reset, [length].
    Displacement,
    /// Deformation gradient F.
    DeformationGradient,
    /// Ratio of current to original volume, J = det F.
    #[serde(rename = "J")]
    VolumeRatio,
    /// Cauchy stress, the force per current area, [stress]; with water, the effective stress.
    CauchyStress,
    /// Logarithmic elastic strain.
    ElasticStrain,
    /// Logarithmic plastic strain in the original configuration.
    PlasticStrain,
    /// Von Mises stress, √(3/2) times the norm of the deviator of the Cauchy stress, [stress].
    VonMisesStress,
    /// Pressure, minus a third of the trace of the Cauchy stress, [stress].
    Pressure,
    /// Current volume, [area] in the plane; in every file, requested or not.
    Volume,
    /// Equivalent plastic strain κ, zero for laws without plasticity.
    EquivalentPlasticStrain,
    /// Pressure of the body, averaged at the grid nodes and interpolated back to the points, [stress]; intended for
    /// plots and written only if requested.
    PressureSmoothed,
    /// Principal values of the Cauchy stress, the largest (most tensile) first, [stress]; written only if requested.
    PrincipalStress,
    /// Half the difference of the largest and the smallest principal stress, [stress]; written only if requested.
    MaximumShearStress,
    /// Total stress, the Cauchy stress less the pore pressure, [stress]. The Cauchy stress is the effective stress; without
    /// water, both are the same. Written by default if the deck has water.
    TotalStress,
}

impl PointField {
    /// All fields, in the order of the files.
    pub const ALL: [PointField; 14] = [
        PointField::Displacement,
        PointField::DeformationGradient,
        PointField::VolumeRatio,
        PointField::CauchyStress,
        PointField::ElasticStrain,
        PointField::PlasticStrain,
        PointField::VonMisesStress,
        PointField::Pressure,
        PointField::Volume,
        PointField::EquivalentPlasticStrain,
        PointField::PressureSmoothed,
        PointField::PrincipalStress,
        PointField::MaximumShearStress,
        PointField::TotalStress,
    ];

    /// The fields written if none are requested: the state of the points, without what follows from it.
    pub fn by_default() -> Vec<PointField> {
        let derived = [
            PointField::PressureSmoothed,
            PointField::PrincipalStress,
            PointField::MaximumShearStress,
            PointField::TotalStress,
        ];
        Self::ALL.into_iter().filter(|field| !derived.contains(field)).collect()
    }

    /// Name of the field in files and decks.
    pub fn name(self) -> &'static str {
        match self {
            PointField::Displacement => "displacement",
            PointField::DeformationGradient => "deformation_gradient",
            PointField::VolumeRatio => "J",
            PointField::CauchyStress => "cauchy_stress",
            PointField::ElasticStrain => "elastic_strain",
            PointField::PlasticStrain => "plastic_strain",
            PointField::VonMisesStress => "von_mises_stress",
            PointField::Pressure => "pressure",
            PointField::Volume => "volume",
            PointField::EquivalentPlasticStrain => EQUIVALENT_PLASTIC_STRAIN,
            PointField::PressureSmoothed => "pressure_smoothed",
            PointField::PrincipalStress => "principal_stress",
            PointField::MaximumShearStress => "maximum_shear_stress",
            PointField::TotalStress => "total_stress",
        }
    }

    fn component_names(self) -> &'static [&'static str] {
        match self {
            PointField::Displacement => &VECTOR,
            PointField::PrincipalStress => &PRINCIPAL,
            PointField::DeformationGradient => &TENSOR,
            PointField::CauchyStress
            | PointField::TotalStress
            | PointField::ElasticStrain
            | PointField::PlasticStrain => &SYMMETRIC_TENSOR,
            PointField::VolumeRatio
            | PointField::VonMisesStress
            | PointField::Pressure
            | PointField::Volume
            | PointField::EquivalentPlasticStrain
            | PointField::PressureSmoothed
            | PointField::MaximumShearStress => &[],
        }
    }

    /// Number of components.
    pub fn components(self) -> usize {
        self.component_names().len().max(1)
    }

    /// Computes the field for some of the points of a file.
    fn fill<const D: usize>(self, source: PointSource<D>, tuples: Range<usize>, out: &mut [f64]) {
        let PointSource { model, points, .. } = source;
        let (order, volumes) = (&source.order[tuples.clone()], &source.volumes[tuples.clone()]);
        let state = &points.converged;
        let stress = |(&p, [ratio, _]): (&usize, &[f64; 2])| state.kirchhoff_stress[p] * (1.0 / ratio);
        let stresses = order.iter().zip(volumes).map(stress);
        match self {
            PointField::Displacement => {
                fill(out, order.iter().map(|&p| padded(&points.displacement(p))));
            }
            PointField::DeformationGradient => {
                let rows = |f: &Mat3| std::array::from_fn::<f64, 9, _>(|c| f[(c / 3, c % 3)]);
                fill(out, order.iter().map(|&p| rows(&state.deformation_gradient[p])));
            }
            PointField::VolumeRatio => fill(out, volumes.iter().map(|[ratio, _]| [*ratio])),
            PointField::CauchyStress => fill(out, stresses.map(|sigma| sigma.components())),
            PointField::TotalStress => {
                let total = |(sigma, &p): (Sym3, &usize)| {
                    (sigma - Sym3::IDENTITY * model.pore_pressure(points, p)).components()
                };
                fill(out, stresses.zip(order).map(total));
            }
            PointField::ElasticStrain => {
                let logarithmic =
                    |p: usize| model.law(points, p).strain_measure().logarithmic(&state.elastic_strain[p]);
                fill(out, order.iter().map(|&p| logarithmic(p).components()));
            }
            PointField::PlasticStrain => {
                let history = HistoryVariable::new(model, EQUIVALENT_PLASTIC_STRAIN);
                let plastic = |p: usize| {
                    if history.value(points, p) == 0.0 {
                        return Sym3::ZERO;
                    }
                    let measure = model.law(points, p).strain_measure();
                    let b = measure.left_cauchy_green(&state.elastic_strain[p]);
                    plastic_strain(&state.deformation_gradient[p], &b)
                };
                fill(out, order.iter().map(|&p| plastic(p).components()));
            }
            PointField::VonMisesStress => fill(out, stresses.map(|sigma| [von_mises_stress(&sigma)])),
            PointField::Pressure => fill(out, stresses.map(|sigma| [pressure(&sigma)])),
            PointField::Volume => fill(out, volumes.iter().map(|[_, volume]| [*volume])),
            PointField::EquivalentPlasticStrain => {
                let history = HistoryVariable::new(model, EQUIVALENT_PLASTIC_STRAIN);
                fill(out, order.iter().map(|&p| [history.value(points, p)]));
            }
            PointField::PressureSmoothed => fill(out, source.smoothed[tuples].iter().map(|p| [*p])),
            PointField::PrincipalStress => fill(out, stresses.map(|sigma| principal_stresses(&sigma))),
            PointField::MaximumShearStress => fill(
                out,
                stresses.map(|sigma| {
                    let [largest, _, smallest] = principal_stresses(&sigma);
                    [0.5 * (largest - smallest)]
                }),
            ),
        }
    }
}

/// Fills tuples one after the other.
#[inline(always)]
fn fill<const N: usize>(out: &mut [f64], tuples: impl Iterator<Item = [f64; N]>) {
    for (out, tuple) in out.as_chunks_mut::<N>().0.iter_mut().zip(tuples) {
        *out = tuple;
    }
}

/// Smallest ratio of squared stretches at which their logarithms still have twelve digits, [-].
const WELL_CONDITIONED: f64 = 1e-3;

/// Logarithmic plastic strain −½ ln(F⁻¹ b^e F⁻ᵀ) in the original configuration.
///
/// At large strain it is computed from the singular values of F⁻¹ √b^e, because round-off could make the eigenvalues of
/// F⁻¹ b^e F⁻ᵀ, which equal the squares of the singular values, negative.
fn plastic_strain(f: &Mat3, b: &Sym3) -> Sym3 {
    let inverse = f.try_inverse().unwrap_or_else(Mat3::identity);
    let squares = Sym3::symmetric_part(&(inverse * b.to_matrix() * inverse.transpose())).spectrum();
    let [least, largest] =
        [f64::min, f64::max].map(|of| squares.values.into_iter().fold(squares.values[0], of));
    let mut strain = if least > WELL_CONDITIONED * largest {
        squares.compose(squares.values.map(f64::ln)) * -0.5
    } else {
        let svd = (inverse * b.map_eigenvalues(f64::sqrt).to_matrix()).svd(true, false);
        let Some(u) = svd.u else { return Sym3::ZERO };
        let least = f64::EPSILON * svd.singular_values.max();
        let logarithms = svd.singular_values.map(|s| -s.max(least).ln());
        Sym3::symmetric_part(&(u * Mat3::from_diagonal(&logarithms) * u.transpose()))
    };
    if [(0, 2), (1, 2), (2, 0), (2, 1)].iter().all(|&place| f[place] == 0.0) && b.0[3..5] == [0.0; 2] {
        strain.0[3..5].fill(0.0); // in the plane, z is a principal direction; removes round-off
    }
    strain
}

/// Principal stresses, the largest first, [stress].
pub fn principal_stresses(sigma: &Sym3) -> [f64; 3] {
    let mut values = sigma.spectrum().values;
    values.sort_unstable_by(|a, b| b.total_cmp(a));
    values
}

/// √(3/2) |dev σ|, [stress].
pub fn von_mises_stress(sigma: &Sym3) -> f64 {
    (1.5f64).sqrt() * sigma.deviator().norm()
}

/// −tr σ/3, [stress].
pub fn pressure(sigma: &Sym3) -> f64 {
    -sigma.trace() / 3.0
}

/// Replaces the content of `out` by J and the current volume of some points.
pub fn volumes<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    order: &[usize],
    out: &mut Vec<[f64; 2]>,
) {
    let ratio = |p: usize| points.converged.deformation_gradient[p].determinant();
    let order = order.par_iter().with_min_len(PIECE);
    match model.point_volume {
        PointVolume::Deformation => order
            .map(|&p| {
                let ratio = ratio(p);
                [ratio, ratio * points.original_volume[p]]
            })
            .collect_into_vec(out),
        PointVolume::Domain => order.map(|&p| [ratio(p), model.volume(points, p)]).collect_into_vec(out),
    }
}

/// The points of a file in their converged state; their fields are computed in chunks.
#[derive(Clone, Copy)]
pub struct PointSource<'a, const D: usize> {
    /// The model of the points.
    pub model: &'a Model<D>,
    /// All points.
    pub points: &'a Points<D>,
    /// Indices of the points of the file, in the order of the file.
    pub order: &'a [usize],
    /// J and current volume of each point of the file, see [`volumes`].
    pub volumes: &'a [[f64; 2]],
    /// Smoothed pressure of each point of the file, see
    /// [`smoothed_pressures`](super::smoothed_pressure::smoothed_pressures); empty unless requested.
    pub smoothed: &'a [f64],
    /// Precision of floating-point numbers.
    pub precision: Precision,
    /// Memory for the encoded arrays.
    pub room: &'a Room,
}

/// One field of the points of a file.
struct Part<'a, const D: usize, F> {
    source: PointSource<'a, D>,
    tuples: usize,
    fill: F,
}

impl<const D: usize, F: Fn(PointSource<D>, Range<usize>, &mut [f64]) + Sync> Compute for Part<'_, D, F> {
    fn tuples(&self) -> usize {
        self.tuples
    }

    fn fill(&self, tuples: Range<usize>, out: &mut [f64]) {
        (self.fill)(self.source, tuples, out);
    }
}

impl<const D: usize> PointSource<'_, D> {
    fn encode(&self, field: &Field) -> Result<Arc<Encoded>, String> {
        Encoded::new(field, "point", self.order.len(), self.precision, self.room).map(Arc::new)
    }

    fn float(
        &self,
        name: &str,
        components: usize,
        component_names: &[&str],
        fill: impl Fn(PointSource<D>, Range<usize>, &mut [f64]) + Sync,
    ) -> Result<Arc<Encoded>, String> {
        let part = Part { source: *self, tuples: self.order.len(), fill };
        self.encode(&Field { name, components, component_names, values: Values::Computed(&part) })
    }

    /// Positions.
    ///
    /// # Errors
    /// A message about a non-finite number; the same holds for the methods below.
    pub fn positions(&self) -> Result<Arc<Encoded>, String> {
        let place = |source: PointSource<D>, tuples: Range<usize>, out: &mut [f64]| {
            fill(out, source.order[tuples].iter().map(|&p| padded(&source.points.converged.position[p])));
        };
        let values = Part { source: *self, tuples: self.order.len(), fill: place };
        let values = Values::Computed(&values);
        Encoded::positions(self.order.len(), values, self.precision, self.room).map(Arc::new)
    }

    /// The requested fields, the volume, the history variables that are not a [`PointField`], and the further fields of
    /// the points.
    pub fn fields(&self, asked: &[PointField]) -> Result<Vec<Arc<Encoded>>, String> {
        let is_asked = |field: &PointField| *field == PointField::Volume || asked.contains(field);
        let known = PointField::ALL.into_iter().filter(is_asked).map(|field| {
            let fill = move |source: PointSource<D>, tuples: Range<usize>, out: &mut [f64]| {
                field.fill(source, tuples, out)
            };
            self.float(field.name(), field.components(), field.component_names(), fill)
        });
        let other = other_history(self.model).into_iter().map(|name| {
            let history = HistoryVariable::new(self.model, name);
            self.float(name, 1, &[], move |source, tuples, out| {
                fill(out, source.order[tuples].iter().map(|&p| [history.value(source.points, p)]));
            })
        });
        let further = self.points.further.iter().map(|(handle, field)| {
            let n = field.components;
            self.float(&field.name, n, names_of_components(n), move |source, tuples, out| {
                let values = source.points.further.converged(handle);
                for (out, &p) in out.chunks_exact_mut(n).zip(&source.order[tuples]) {
                    out.copy_from_slice(&values[p * n..][..n]);
                }
            })
        });
        known.chain(other).chain(further).collect()
    }

    /// Constant fields: body, material and number of each point.
    pub fn identity(&self) -> Result<Vec<Arc<Encoded>>, String> {
        let body = |p: &usize| self.points.body[*p];
        let material = |p: &usize| self.model.bodies[body(p) as usize].material as i32;
        let all: [(&str, Vec<i32>); 3] = [
            ("body_id", self.order.iter().map(|p| i32::from(body(p))).collect()),
            ("material_id", self.order.iter().map(material).collect()),
            ("point_id", self.order.iter().map(|&p| self.points.id[p] as i32).collect()),
        ];
        all.iter().map(|(name, numbers)| self.encode(&number(name, numbers))).collect()
    }

    /// Shapes of the domains of the points; each point must have a domain.
    pub fn domains(&self) -> Vec<CellKind> {
        self.order.iter().map(|&p| cell_kind::<D>(number_of_corners(self.model, self.points, p))).collect()
    }

    /// Corners of the domains, in the VTK order of these shapes.
    pub fn corners(&self, domains: &[CellKind]) -> Result<Arc<Encoded>, String> {
        let end = |end: &mut usize, kind: &CellKind| {
            *end += kind.points();
            Some(*end)
        };
        let ends: Vec<usize> = domains.iter().scan(0, end).collect();
        let count = ends.last().copied().unwrap_or(0);
        let fill = |source: PointSource<D>, tuples: Range<usize>, out: &mut [f64]| {
            let mut domain = ends.partition_point(|end| *end <= tuples.start);
            for (out, tuple) in out.as_chunks_mut::<3>().0.iter_mut().zip(tuples) {
                domain += usize::from(ends[domain] == tuple);
                let corners = domains[domain].points();
                let k = tuple + corners - ends[domain];
                let k = if corners == 1 << D { vtk_corner(k) } else { k };
                *out = padded(&corner_of(source.model, source.points, source.order[domain], k));
            }
        };
        let values = Part { source: *self, tuples: count, fill };
        let values = Values::Computed(&values);
        Encoded::positions(count, values, self.precision, self.room).map(Arc::new)
    }
}

/// Component names of a further field with this number of components.
fn names_of_components(components: usize) -> &'static [&'static str] {
    match components {
        3 => &VECTOR,
        6 => &SYMMETRIC_TENSOR,
        9 => &TENSOR,
        _ => &[],
    }
}

/// Names of the history variables of all laws, except the one that is a [`PointField`].
fn other_history<const D: usize>(model: &Model<D>) -> Vec<&str> {
    let mut names: Vec<&str> =
        model.materials.iter().flat_map(|m| m.law.state_fields()).map(|f| f.name.as_ref()).collect();
    names.sort_unstable();
    names.dedup();
    names.retain(|name| *name != EQUIVALENT_PLASTIC_STRAIN);
    names
}

/// The shape of a cell or domain with this many corners.
fn cell_kind<const D: usize>(corners: usize) -> CellKind {
    match (D, corners) {
        (_, 3) => CellKind::Triangle,
        (3, 4) => CellKind::Tetrahedron,
        (_, 4) => CellKind::Quad,
        (3, 5) => CellKind::Pyramid,
        (3, 6) => CellKind::Wedge,
        _ => CellKind::Hexahedron,
    }
}

/// The active cells, that is, the cells that contain points or overlap their domains; cells that are only touched from
/// outside have inactive nodes and are left out. Corners are node indices in VTK order.
#[derive(Debug, PartialEq)]
pub struct GridMesh {
    /// Positions of the nodes.
    pub nodes: Vec<[f64; 3]>,
    /// Corners of the active cells.
    pub corners: Vec<i64>,
    /// Kinds of the active cells.
    pub kinds: Vec<CellKind>,
    /// The index of each node among the active nodes; `None` if the nodes are all active nodes, in their order.
    pub shown: Option<Vec<u32>>,
}

/// The active part of the grid in a load step; with several ranks, each shows only some of the cells that it shares
/// with others. All ranks must call this together.
pub fn grid_mesh<const D: usize>(model: &Model<D>, links: &Connectivity<D>) -> GridMesh {
    let is_alone = links.halo().ranks().is_alone();
    let cells: Cow<[u32]> =
        if is_alone { links.active_cells().into() } else { links.shown_cells(model.grid.as_ref()).into() };
    let (mut corners, mut kinds) = (Vec::new(), Vec::new());
    // Each group of bodies has its own nodes in the cells that it touches.
    let groups = 0..links.n_body_groups() as BodyGroup;
    let cells: Vec<(BodyGroup, u32)> = match groups.len() {
        1 => cells.iter().map(|cell| (0, *cell)).collect(),
        _ => groups
            .flat_map(|group| links.cells_of_bodies(group).iter().map(move |cell| (group, *cell)))
            .collect(),
    };
    for (group, cell) in cells {
        let nodes = model.grid.corners(cell as usize);
        let number = |&node: &u32| links.of_bodies(group, node as usize).map(|active| active as i64);
        if let Some(numbers) = nodes.nodes().iter().map(number).collect::<Option<Vec<i64>>>() {
            kinds.push(cell_kind::<D>(numbers.len()));
            corners.extend(numbers);
        }
    }
    let position = |&node: &u32| padded(&model.grid.node_position(node as usize));
    if is_alone {
        let nodes = links.active_nodes().iter().map(position).collect();
        return GridMesh { nodes, corners, kinds, shown: None };
    }
    let mut shown: Vec<u32> = corners.iter().map(|corner| *corner as u32).collect();
    shown.sort_unstable();
    shown.dedup();
    for corner in &mut corners {
        *corner = shown.partition_point(|node| i64::from(*node) < *corner) as i64;
    }
    let nodes = shown.iter().map(|node| position(&links.active_nodes()[*node as usize])).collect();
    GridMesh { nodes, corners, kinds, shown: Some(shown) }
}

/// A vector with three components per node or point.
pub fn vector<'a>(name: &'a str, values: &'a [[f64; 3]]) -> Field<'a> {
    Field { name, components: 3, component_names: &VECTOR, values: Values::Float64(values.as_flattened()) }
}

/// A whole number per node or point.
pub fn number<'a>(name: &'a str, values: &'a [i32]) -> Field<'a> {
    Field { name, components: 1, component_names: &[], values: Values::Int32(values) }
}

/// Number of corners of the domain of a point, 0 without a domain.
pub fn number_of_corners<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize) -> usize {
    match model.bodies[points.body[p] as usize].method.domain() {
        DomainKind::None => 0,
        DomainKind::Corners => points.corner_range(p).len(),
        DomainKind::Box => 1 << D,
    }
}

/// A corner of the domain of a point, or the position of the point if it has no domain. With 2^D corners, bit d of the
/// corner number selects the side along axis d.
pub fn corner_of<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize, k: usize) -> [f64; D] {
    let state = &points.converged;
    match model.bodies[points.body[p] as usize].method.domain() {
        DomainKind::None => state.position[p],
        DomainKind::Corners => points.corners(p)[k],
        DomainKind::Box => {
            let (x, l) = (&state.position[p], &state.half_lengths[p]);
            std::array::from_fn(|d| if k >> d & 1 == 1 { x[d] + l[d] } else { x[d] - l[d] })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A simple shear γ stretches by e^±asinh(γ/2).
    #[test]
    fn plastic_strain_is_known_at_any_strain() {
        for (shear, tolerance) in [(1e-3, 1e-12), (1.0, 1e-14), (1e6, 1e-3)] {
            let mut f = Mat3::identity();
            f[(0, 1)] = shear;
            let found = plastic_strain(&f, &Sym3::IDENTITY);
            let size = f64::sqrt(2.0) * f64::asinh(0.5 * shear);
            assert!((found.norm() / size - 1.0).abs() < tolerance, "{} instead of {size}", found.norm());
            assert_eq!(found.0[3..5], [0.0; 2], "out of the plane");
        }
    }
}
