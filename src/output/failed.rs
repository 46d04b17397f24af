//! Where the iterations of a step without equilibrium have ended, for ParaView. No series names these files.

use std::io;
use std::path::Path;

use crate::model::Model;
use crate::points::Points;
use crate::solver::{FailedAttempt, Iterate};
use crate::tensor::padded;

use super::fields::{GridMesh, OwnedField, grid_mesh};
use super::vtu::{self, CellKind, Field, Kinds, Mesh, VECTOR};

/// The files: the points, and the grid.
pub(super) const FILES: [&str; 2] = ["failed_points.vtu", "failed_grid.vtu"];

/// Writes both files into a directory; nothing where the iterations have not begun or have left the finite numbers.
///
/// # Errors
/// Those of the file system.
pub(super) fn write<const D: usize>(
    directory: &Path,
    model: &Model<D>,
    points: &Points<D>,
    attempt: &FailedAttempt<D>,
) -> io::Result<()> {
    let Some(iterate) = &attempt.iterate else { return Ok(()) };
    let Iterate { links, delta_d, out_of_balance } = iterate;
    let numbers = || delta_d.iter().chain(out_of_balance).flatten();
    if out_of_balance.len() != delta_d.len() || !numbers().all(|x| x.is_finite()) {
        return Ok(());
    }
    let write = |name: &str, mesh: &Mesh, fields: &[OwnedField]| {
        let fields: Vec<Field> = fields.iter().map(OwnedField::as_field).collect();
        let step = attempt.step;
        vtu::write(&directory.join(name), step.end, step.index as i64, mesh, &fields, &[])
    };

    let (positions, fields) = moved_points(points, iterate);
    let vertices: Vec<i64> = (0..positions.len() as i64).collect();
    let mesh = Mesh { points: &positions, kinds: Kinds::All(CellKind::Vertex), connectivity: &vertices };
    write(FILES[0], &mesh, &fields)?;

    let named = [("displacement_increment", &delta_d[..]), ("out_of_balance_force", &out_of_balance[..])];
    let GridMesh { nodes, corners, kinds, mut fields } = grid_mesh(model, links, &named);
    fields.push(not_in_equilibrium(nodes.len()));
    let mesh = Mesh { points: &nodes, kinds: Kinds::Each(&kinds), connectivity: &corners };
    write(FILES[1], &mesh, &fields)
}

/// The points where the last displacement increment takes them, in the order of their permanent numbers.
fn moved_points<const D: usize>(
    points: &Points<D>,
    Iterate { links, delta_d, .. }: &Iterate<D>,
) -> (Vec<[f64; 3]>, Vec<OwnedField>) {
    let mut increments = vec![[0.0; D]; points.len()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            links.for_each_value(p, |local, value| {
                for d in 0..D {
                    increments[p][d] += value * delta_d[nodes[local] as usize][d];
                }
            });
        }
    }
    let order = points.by_id();
    let moved = |p: usize| std::array::from_fn(|d| points.converged.position[p][d] + increments[p][d]);
    let positions: Vec<[f64; D]> = order.iter().map(|&p| moved(p)).collect();
    let since_start = |(place, &p): (&[f64; D], &usize)| {
        padded(&std::array::from_fn::<f64, D, _>(|d| place[d] - points.original_position[p][d]))
    };
    let fields = vec![
        OwnedField::float(
            "displacement",
            &VECTOR,
            positions.iter().zip(&order).flat_map(since_start).collect(),
        ),
        OwnedField::float(
            "displacement_increment",
            &VECTOR,
            order.iter().flat_map(|&p| padded(&increments[p])).collect(),
        ),
        OwnedField::integer("body_id", order.iter().map(|&p| i32::from(points.body[p])).collect()),
        OwnedField::integer("point_id", order.iter().map(|&p| points.id[p] as i32).collect()),
        not_in_equilibrium(points.len()),
    ];
    (positions.iter().map(padded).collect(), fields)
}

fn not_in_equilibrium(n: usize) -> OwnedField {
    OwnedField::integer("in_equilibrium", vec![0; n])
}
