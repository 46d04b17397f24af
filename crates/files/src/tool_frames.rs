//! The VTU files of the tools of a step: their surfaces with pressure and shear; and the contact points on tools and
//! between bodies.

use std::sync::Arc;

use mpm_core::model::{Model, Tool};
use mpm_core::solver::Step;
use mpm_core::tensor::padded;
use mpm_core::terms::{ContactPoint, FacetPoint, Mode, PairState, ToolState};
use mpm_core::tool::Outline;

use super::fields::{number, vector};
use super::vtu::{CellKind, Cells, Encoded, Field, File, Kinds, Precision, Room, Values};

/// Half-width of the part of an unbounded tool that is shown, relative to the grid diagonal, [-].
const SHOWN: f64 = 0.5;

/// The surface of a tool, divided into facets, in the frame of the tool.
#[derive(Debug, Clone)]
pub(super) struct Outlined {
    /// Corners of each facet, and positions of all corners, [length].
    facets: Vec<Vec<u32>>,
    vertices: Vec<Vec<f64>>,
    /// Area of each facet, [length^(D−1)], the side of the surface to which it belongs, and its centre, [length].
    areas: Vec<f64>,
    parts: Vec<usize>,
    centres: Vec<Vec<f64>>,
    /// The first named part to which the centre of each facet belongs; -1 if there is none.
    named: Vec<i32>,
}

impl Outlined {
    /// The outline of a tool, with facets as large as the grid cells at its initial position; empty if the tool has no
    /// outline.
    pub fn new<const D: usize>(tool: &Tool<D>, model: &Model<D>) -> Self {
        let Outline { vertices, facets, areas, parts } = tool.outline(model.grid.as_ref(), SHOWN);
        let centre = |facet: &[u32; D]| {
            let sum = |d: usize| facet.iter().map(|&k| vertices[k as usize][d]).sum::<f64>();
            std::array::from_fn(|d| sum(d) / D as f64)
        };
        let centres: Vec<[f64; D]> = facets.iter().map(centre).collect();
        let named = |(x, side): (&[f64; D], &usize)| tool.parts_at(*side, x).next().map_or(-1, |k| k as i32);
        Outlined {
            named: centres.iter().zip(&parts).map(named).collect(),
            centres: centres.iter().map(|x| x.to_vec()).collect(),
            facets: facets.iter().map(|facet| facet.to_vec()).collect(),
            vertices: vertices.iter().map(|x| x.to_vec()).collect(),
            areas,
            parts,
        }
    }

    /// Among the facets on one side of the tool, `part`, the one whose centre is closest to a position in the frame of
    /// the tool.
    fn facet_at<const D: usize>(&self, part: usize, x: &[f64; D]) -> Option<usize> {
        let distance = |k: &usize| (0..D).map(|d| (self.centres[*k][d] - x[d]).powi(2)).sum::<f64>();
        let facets = (0..self.facets.len()).filter(|k| self.parts[*k] == part);
        facets.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// The file of the surfaces of all tools. Each facet has the number of its tool, the number of the tool side on which
/// it lies and, if any tool has named parts, the number of its part, and also the mean pressure and shear of the
/// contact points on it.
///
/// # Errors
/// If values cannot be written.
pub(super) fn surfaces_of_tools<const D: usize>(
    outlines: &[Outlined],
    model: &Model<D>,
    tools: &[ToolState<D>],
    step: Step,
    precision: Precision,
    room: &Room,
) -> Result<File, String> {
    let (mut positions, mut corners) = (Vec::new(), Vec::new());
    let (mut numbers, mut parts): (Vec<i32>, Vec<i32>) = Default::default();
    let named: Vec<i32> = outlines.iter().flat_map(|outlined| outlined.named.iter().copied()).collect();
    let (mut pressure, mut shear) = (Vec::new(), Vec::new());
    for (number, (outlined, state)) in outlines.iter().zip(tools).enumerate() {
        let first = positions.len() as i64;
        let to_space = |x: &Vec<f64>| state.pose.to_space(&std::array::from_fn(|d| x[d]));
        positions.extend(outlined.vertices.iter().map(|x| padded(&to_space(x))));
        corners.extend(outlined.facets.iter().flatten().map(|k| first + i64::from(*k)));
        numbers.extend(vec![number as i32; outlined.facets.len()]);
        parts.extend(outlined.parts.iter().map(|part| *part as i32));
        let (mut normal_force, mut tangential) =
            (vec![0.0; outlined.facets.len()], vec![[0.0; D]; outlined.facets.len()]);
        for contact in &state.contacts {
            let Some(facet) = outlined.facet_at(contact.part, &state.pose.to_tool(&contact.position)) else {
                continue;
            };
            normal_force[facet] += contact.pressure * contact.area;
            (0..D).for_each(|d| tangential[facet][d] += contact.shear[d] * contact.area);
        }
        for (facet, area) in outlined.areas.iter().enumerate() {
            // In a body of revolution, a facet represents a ring about the axis.
            let x = to_space(&outlined.centres[facet]);
            let around = if model.revolved { std::f64::consts::TAU * x[0].abs() } else { 1.0 };
            let per = if area * around > 0.0 { 1.0 / (area * around) } else { 0.0 };
            pressure.push(normal_force[facet] * per);
            // The file shows the shear on the tool, which is opposite to the shear on the body.
            shear.push(padded(&tangential[facet].map(|t| -t * per)));
        }
    }
    let kind = if D == 3 { CellKind::Triangle } else { CellKind::Line };
    let n = numbers.len();
    let mut fields = vec![
        number("tool", &numbers),
        number("part", &parts),
        scalar("pressure", &pressure),
        vector("shear", &shear),
    ];
    if model.tools.iter().any(|tool| !tool.parts.is_empty()) {
        fields.push(number("named_part", &named));
    }
    let fields = encoded(&fields, "cell", n, precision, room)?;
    let vertices =
        Encoded::positions(positions.len(), Values::Float64(positions.as_flattened()), precision, room)?;
    let cells = Cells::new(positions.len(), &Kinds::Each(&vec![kind; n]), &corners, room)?;
    File::new(step.end, step.index as i64, Arc::new(vertices), Arc::new(cells), Vec::new(), fields)
}

/// The file of the contact points on tools, then those between bodies, if the model has any: these have the number -1 in
/// place of that of a tool, and the number of their pair, a gap and a slip.
///
/// # Errors
/// If values cannot be written.
pub(super) fn contact_points<const D: usize>(
    tools: &[ToolState<D>],
    pairs: &[PairState<D>],
    step: Step,
    precision: Precision,
    room: &Room,
) -> Result<File, String> {
    let between = || pairs.iter().flat_map(|pair| &pair.contacts);
    let on_tools =
        || tools.iter().enumerate().flat_map(|(k, tool)| tool.contacts.iter().map(move |c| (k as i32, c)));
    let all = || on_tools().chain(between().map(|found| (-1, &found.contact)));
    let numbers: Vec<i32> = all().map(|(number, _)| number).collect();
    let bodies: Vec<i32> = all().map(|(_, contact)| contact.body as i32).collect();
    let points: Vec<i32> = all().map(|(_, contact)| contact.point as i32).collect();
    let states: Vec<i32> = all().map(|(_, contact)| state(contact.mode)).collect();
    let vectors = |quantity: &dyn Fn(&ContactPoint<D>) -> [f64; D]| -> Vec<[f64; 3]> {
        all().map(|(_, contact)| padded(&quantity(contact))).collect()
    };
    let positions = vectors(&|contact| contact.position);
    let [normals, forces, shear] = [
        vectors(&|contact| contact.normal),
        vectors(&|contact| contact.force),
        vectors(&|contact| contact.shear),
    ];
    let pressure: Vec<f64> = all().map(|(_, contact)| contact.pressure).collect();
    let areas: Vec<f64> = all().map(|(_, contact)| contact.area).collect();
    let n_on_tools = on_tools().count();
    let of_pairs = |of: fn(&FacetPoint<D>) -> f64| -> Vec<f64> {
        std::iter::repeat_n(0.0, n_on_tools).chain(between().map(of)).collect()
    };
    let pair_numbers: Vec<i32> =
        std::iter::repeat_n(-1, n_on_tools).chain(between().map(|found| found.pair as i32)).collect();
    let (gaps, slips) = (of_pairs(|found| found.gap), of_pairs(|found| found.slip));
    let mut fields = vec![
        number("tool", &numbers),
        number("body", &bodies),
        number("point", &points),
        number("state", &states),
        vector("normal", &normals),
        vector("force", &forces),
        scalar("pressure", &pressure),
        vector("shear", &shear),
        scalar("area", &areas),
    ];
    if !pairs.is_empty() {
        fields.extend([number("pair", &pair_numbers), scalar("gap", &gaps), scalar("slip", &slips)]);
    }
    let n = positions.len();
    let fields = encoded(&fields, "point", n, precision, room)?;
    let positions = Encoded::positions(n, Values::Float64(positions.as_flattened()), precision, room)?;
    let corners: Vec<i64> = (0..n as i64).collect();
    let cells = Cells::new(n, &Kinds::Each(&vec![CellKind::Vertex; n]), &corners, room)?;
    File::new(step.end, step.index as i64, Arc::new(positions), Arc::new(cells), fields, Vec::new())
}

fn scalar<'a>(name: &'a str, values: &'a [f64]) -> Field<'a> {
    Field { name, components: 1, component_names: &[], values: Values::Float64(values) }
}

fn encoded(
    fields: &[Field],
    owner: &str,
    count: usize,
    precision: Precision,
    room: &Room,
) -> Result<Vec<Arc<Encoded>>, String> {
    fields.iter().map(|field| Encoded::new(field, owner, count, precision, room).map(Arc::new)).collect()
}

/// The number of a contact state in files: 1 sticking, 2 sliding, 3 parting.
fn state(mode: Mode) -> i32 {
    match mode {
        Mode::Stick => 1,
        Mode::Slip => 2,
        Mode::Parting => 3,
    }
}
