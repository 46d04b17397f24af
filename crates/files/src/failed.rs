//! The last iterate of a step without equilibrium, for ParaView. No series lists these files.

use std::io;
use std::path::Path;

use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::solver::{FailedAttempt, Iterate, Step};
use mpm_core::tensor::padded;

use super::fields::{GridMesh, grid_mesh, number, vector};
use super::vtu::{self, CellKind, Field, Kinds, Mesh};

/// The files: the points, and the grid.
pub(super) const FILES: [&str; 2] = ["failed_points.vtu", "failed_grid.vtu"];

/// Writes both files into a directory; writes nothing if the iterations have not begun or are not finite.
///
/// # Errors
/// An error of the file system.
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
    let Step { index, end, .. } = attempt.step;
    let write = |name: &str, mesh: &Mesh, fields: &[Field]| {
        vtu::write(&directory.join(name), end, index as i64, mesh, fields, &[])
    };
    let order = points.by_id();
    let increments = increments_of(points, iterate);
    let moved = |p: usize| std::array::from_fn(|d| points.converged.position[p][d] + increments[p][d]);
    let positions: Vec<[f64; D]> = order.iter().map(|&p| moved(p)).collect();
    let since_start = |(place, &p): (&[f64; D], &usize)| {
        padded(&std::array::from_fn::<f64, D, _>(|d| place[d] - points.original_position[p][d]))
    };
    let displacement: Vec<[f64; 3]> = positions.iter().zip(&order).map(since_start).collect();
    let increments: Vec<[f64; 3]> = order.iter().map(|&p| padded(&increments[p])).collect();
    let bodies: Vec<i32> = order.iter().map(|&p| i32::from(points.body[p])).collect();
    let numbers: Vec<i32> = order.iter().map(|&p| points.id[p] as i32).collect();
    let no = vec![0; points.len().max(delta_d.len())];
    let positions: Vec<[f64; 3]> = positions.iter().map(padded).collect();
    let vertices: Vec<i64> = (0..positions.len() as i64).collect();
    let mesh = Mesh { points: &positions, kinds: Kinds::All(CellKind::Vertex), connectivity: &vertices };
    let fields = [
        vector("displacement", &displacement),
        vector("displacement_increment", &increments),
        number("body_id", &bodies),
        number("point_id", &numbers),
        number("in_equilibrium", &no[..points.len()]),
    ];
    write(FILES[0], &mesh, &fields)?;

    let [increments, forces] =
        [delta_d, out_of_balance].map(|field| field.iter().map(padded).collect::<Vec<[f64; 3]>>());
    let GridMesh { nodes, corners, kinds } = grid_mesh(model, links);
    let fields = [
        vector("displacement_increment", &increments),
        vector("out_of_balance_force", &forces),
        number("in_equilibrium", &no[..nodes.len()]),
    ];
    let mesh = Mesh { points: &nodes, kinds: Kinds::Each(&kinds), connectivity: &corners };
    write(FILES[1], &mesh, &fields)
}

/// The last displacement increment of each point.
fn increments_of<const D: usize>(
    points: &Points<D>,
    Iterate { links, delta_d, .. }: &Iterate<D>,
) -> Vec<[f64; D]> {
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
    increments
}
