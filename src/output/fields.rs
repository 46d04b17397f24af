//! The fields of material points and grid nodes as they stand in the files.

use rayon::prelude::*;

use crate::basis::{Connectivity, DomainKind};
use crate::grid::vtk_corner;
use crate::model::Model;
use crate::points::Points;
use crate::tensor::{Mat3, Sym3, padded};

use super::vtu::{CellKind, Field, SYMMETRIC_TENSOR, TENSOR, VECTOR, Values};

/// Row and column of each component of a symmetric tensor in ParaView's order.
const PARAVIEW: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// The history variable that every file carries, zero for laws that do not have it.
const EQUIVALENT_PLASTIC_STRAIN: &str = "equivalent_plastic_strain";

/// Number of points whose fields are computed by one piece of work.
const PIECE: usize = 1 << 12;

/// One field, owned.
pub struct OwnedField {
    name: String,
    names: &'static [&'static str],
    components: usize,
    values: OwnedValues,
}

enum OwnedValues {
    Float(Vec<f64>),
    Integer(Vec<i32>),
}

impl OwnedField {
    pub(super) fn float(name: &str, names: &'static [&'static str], values: Vec<f64>) -> OwnedField {
        OwnedField {
            name: name.to_owned(),
            names,
            components: names.len().max(1),
            values: OwnedValues::Float(values),
        }
    }

    pub(super) fn integer(name: &str, values: Vec<i32>) -> OwnedField {
        OwnedField { name: name.to_owned(), names: &[], components: 1, values: OwnedValues::Integer(values) }
    }

    /// The field as the writer takes it.
    pub fn as_field(&self) -> Field<'_> {
        Field {
            name: &self.name,
            components: self.components,
            component_names: self.names,
            values: match &self.values {
                OwnedValues::Float(values) => Values::Float64(values),
                OwnedValues::Integer(values) => Values::Int32(values),
            },
        }
    }
}

/// What the files say of one point, beyond its history variables.
struct PointValues {
    displacement: [f64; 3],
    deformation_gradient: [f64; 9],
    volume_ratio: f64,
    cauchy_stress: [f64; 6],
    elastic_strain: [f64; 6],
    plastic_strain: [f64; 6],
    von_mises: f64,
    pressure: f64,
    volume: f64,
}

impl PointValues {
    /// Names of the fields, and of their components.
    const FIELDS: [(&str, &[&str]); 9] = [
        ("displacement", &VECTOR),
        ("deformation_gradient", &TENSOR),
        ("J", &[]),
        ("cauchy_stress", &SYMMETRIC_TENSOR),
        ("elastic_strain", &SYMMETRIC_TENSOR),
        ("plastic_strain", &SYMMETRIC_TENSOR),
        ("von_mises_stress", &[]),
        ("pressure", &[]),
        ("volume", &[]),
    ];

    /// The components of the fields.
    fn components(&self) -> [&[f64]; 9] {
        use std::slice::from_ref;
        [
            &self.displacement,
            &self.deformation_gradient,
            from_ref(&self.volume_ratio),
            &self.cauchy_stress,
            &self.elastic_strain,
            &self.plastic_strain,
            from_ref(&self.von_mises),
            from_ref(&self.pressure),
            from_ref(&self.volume),
        ]
    }
}

fn paraview(t: &Sym3) -> [f64; 6] {
    PARAVIEW.map(|(i, j)| t.component(i, j))
}

/// Logarithmic plastic strain −½ ln(F⁻¹ b^e F⁻ᵀ) in the original configuration.
fn plastic_strain(f: &Mat3, b: &Sym3) -> Sym3 {
    let inverse = f.try_inverse().unwrap_or_else(Mat3::identity);
    let b = b.to_matrix();
    Sym3::symmetric_part(&(inverse * b * inverse.transpose())).map_eigenvalues(f64::ln) * -0.5
}

/// Displacement of a point in its converged state, [length].
pub fn displacement<const D: usize>(points: &Points<D>, p: usize) -> [f64; D] {
    std::array::from_fn(|d| points.converged.position[p][d] - points.original_position[p][d])
}

/// Cauchy stress σ = τ/J of a point in its converged state, [stress].
pub fn cauchy_stress<const D: usize>(points: &Points<D>, p: usize) -> Sym3 {
    points.converged.kirchhoff_stress[p] * (1.0 / points.converged.deformation_gradient[p].determinant())
}

/// √(3/2) |dev σ|, [stress].
pub fn von_mises_stress(sigma: &Sym3) -> f64 {
    (1.5f64).sqrt() * sigma.deviator().norm()
}

/// −tr σ/3, [stress].
pub fn pressure(sigma: &Sym3) -> f64 {
    -sigma.trace() / 3.0
}

fn point_values<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    p: usize,
    yielded: bool,
) -> PointValues {
    let state = &points.converged;
    let f = &state.deformation_gradient[p];
    let volume_ratio = f.determinant();
    let sigma = cauchy_stress(points, p);
    let (measure, elastic) = (model.law(points, p).strain_measure(), &state.elastic_strain[p]);
    let plastic = if yielded { plastic_strain(f, &measure.left_cauchy_green(elastic)) } else { Sym3::ZERO };
    PointValues {
        displacement: padded(&displacement(points, p)),
        deformation_gradient: std::array::from_fn(|c| f[(c / 3, c % 3)]),
        volume_ratio,
        cauchy_stress: paraview(&sigma),
        elastic_strain: paraview(&measure.logarithmic(elastic)),
        plastic_strain: paraview(&plastic),
        von_mises: von_mises_stress(&sigma),
        pressure: pressure(&sigma),
        volume: model.volume(points, p),
    }
}

/// The fields of the points listed in `order`, converged state.
pub fn point_fields<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    order: &[usize],
) -> Vec<OwnedField> {
    let plastic = history(model, points, order, EQUIVALENT_PLASTIC_STRAIN);
    let width = |field: &(&str, &[&str])| field.1.len().max(1);
    let mut values = PointValues::FIELDS.map(|field| vec![0.0; width(&field) * order.len()]);
    let mut pieces: Vec<Vec<&mut [f64]>> = Vec::new();
    pieces.resize_with(order.len().div_ceil(PIECE), Vec::new);
    for (values, field) in values.iter_mut().zip(&PointValues::FIELDS) {
        let parts = values.chunks_mut(width(field) * PIECE);
        pieces.iter_mut().zip(parts).for_each(|(piece, part)| piece.push(part));
    }
    let work = pieces.par_iter_mut().zip(order.par_chunks(PIECE)).zip(plastic.par_chunks(PIECE));
    work.for_each(|((piece, order), plastic)| {
        for (k, (&p, plastic)) in order.iter().zip(plastic).enumerate() {
            let values = point_values(model, points, p, *plastic != 0.0);
            for (part, components) in piece.iter_mut().zip(values.components()) {
                part[k * components.len()..][..components.len()].copy_from_slice(components);
            }
        }
    });
    let mut fields: Vec<OwnedField> = values
        .into_iter()
        .zip(PointValues::FIELDS)
        .map(|(values, (name, components))| OwnedField::float(name, components, values))
        .collect();
    let body = |p: &usize| points.body[*p];
    fields.extend([
        OwnedField::float(EQUIVALENT_PLASTIC_STRAIN, &[], plastic),
        OwnedField::integer("body_id", order.iter().map(|p| i32::from(body(p))).collect()),
        OwnedField::integer(
            "material_id",
            order.iter().map(|p| model.bodies[body(p) as usize].material as i32).collect(),
        ),
        OwnedField::integer("point_id", order.iter().map(|&p| points.id[p] as i32).collect()),
    ]);
    for name in other_history(model) {
        fields.push(OwnedField::float(name, &[], history(model, points, order, name)));
    }
    fields
}

/// A history variable by name, zero for laws that do not have it.
fn history<const D: usize>(model: &Model<D>, points: &Points<D>, order: &[usize], name: &str) -> Vec<f64> {
    let place: Vec<Option<usize>> = model
        .bodies
        .iter()
        .map(|b| model.materials[b.material].law.state_fields().iter().position(|f| f.name == name))
        .collect();
    let value = |p: usize| match place[points.body[p] as usize] {
        Some(k) => points.converged.history[p * points.history_len + k],
        None => 0.0,
    };
    order.iter().map(|&p| value(p)).collect()
}

/// Names of the history variables of all laws, without the one that every file carries.
fn other_history<const D: usize>(model: &Model<D>) -> Vec<&'static str> {
    let mut names: Vec<&str> =
        model.materials.iter().flat_map(|m| m.law.state_fields()).map(|f| f.name).collect();
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
        _ => CellKind::Hexahedron,
    }
}

/// The cells that points or their domains meet, without those that they only touch from outside, of which not all nodes
/// are active: as corners among the active nodes in the order of the VTK cell of their kind; the nodes; and their fields.
pub struct GridMesh {
    /// Positions of the active nodes.
    pub nodes: Vec<[f64; 3]>,
    /// Corners of the active cells.
    pub corners: Vec<i64>,
    /// Kinds of the active cells.
    pub kinds: Vec<CellKind>,
    /// Fields of the nodes.
    pub fields: Vec<OwnedField>,
}

/// The active part of the grid in a load step, with vectors on its nodes.
pub fn grid_mesh<const D: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    fields: &[(&str, &[[f64; D]])],
) -> GridMesh {
    let (mut corners, mut kinds) = (Vec::new(), Vec::new());
    for &cell in links.active_cells() {
        let nodes = model.grid.corners(cell as usize);
        let number = |&node: &u32| links.active_number(node as usize).map(|active| active as i64);
        if let Some(numbers) = nodes.nodes().iter().map(number).collect::<Option<Vec<i64>>>() {
            kinds.push(cell_kind::<D>(numbers.len()));
            corners.extend(numbers);
        }
    }
    let position = |&node: &u32| padded(&model.grid.node_position(node as usize));
    GridMesh {
        nodes: links.active_nodes().iter().map(position).collect(),
        corners,
        kinds,
        fields: fields
            .iter()
            .map(|(name, field)| OwnedField::float(name, &VECTOR, field.iter().flat_map(padded).collect()))
            .collect(),
    }
}

/// Corners of the domain of a point; of 2^D corners, bit d of a corner's number is its side along axis d.
pub fn corners_of<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize) -> Vec<[f64; D]> {
    match model.bodies[points.body[p] as usize].method.domain() {
        DomainKind::None => Vec::new(),
        DomainKind::Corners => points.corners(p).to_vec(),
        DomainKind::Box => {
            let (x, l) = (&points.converged.position[p], &points.converged.half_lengths[p]);
            let corner =
                |k: usize| std::array::from_fn(|d| if k >> d & 1 == 1 { x[d] + l[d] } else { x[d] - l[d] });
            (0..1usize << D).map(corner).collect()
        }
    }
}

/// The domains of points as cells, each with corners of its own.
pub struct DomainMesh {
    /// Corners of the domains, in the order of the VTK cell of their kind.
    pub corners: Vec<[f64; 3]>,
    /// Kinds of the domains.
    pub kinds: Vec<CellKind>,
}

/// The domains of the points in `order`, which must have one.
pub fn domain_mesh<const D: usize>(model: &Model<D>, points: &Points<D>, order: &[usize]) -> DomainMesh {
    let mut mesh = DomainMesh { corners: Vec::new(), kinds: Vec::new() };
    for &p in order {
        let corners = corners_of(model, points, p);
        let is_box = corners.len() == 1 << D;
        let place = |k: usize| padded(&corners[if is_box { vtk_corner(k) } else { k }]);
        mesh.corners.extend((0..corners.len()).map(place));
        mesh.kinds.push(cell_kind::<D>(corners.len()));
    }
    mesh
}
