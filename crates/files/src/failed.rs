//! The last iterate of a step without equilibrium, for ParaView. No series lists these files. With several ranks, each
//! rank writes its pieces of the files.

use std::io;
use std::path::Path;

use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::solver::{FailedAttempt, Iterate, Step};
use mpm_core::tensor::padded;

use super::fields::{GridMesh, grid_mesh, number, vector};
use super::invalid;
use super::vtu::{self, CellKind, Field, Kinds, Mesh, Pieces};

/// File names without extension: the points, and the grid.
const FILES: [&str; 2] = ["failed_points", "failed_grid"];

/// True if this is the name of one of the files, of the list of its pieces or of one of its pieces.
pub(super) fn is_name(name: &str) -> bool {
    FILES.iter().filter_map(|file| name.strip_prefix(file)).any(|rest| {
        let rank = rest.strip_prefix("_r").and_then(|rest| rest.strip_suffix(".vtu"));
        let is_rank = |rank: &str| !rank.is_empty() && rank.bytes().all(|b| b.is_ascii_digit());
        rest == ".vtu" || rest == ".pvtu" || rank.is_some_and(is_rank)
    })
}

/// Writes both files into a directory; writes nothing if the iterate of any rank is missing, incomplete or not finite.
/// All ranks must call this together.
///
/// # Errors
/// A file-system error.
pub(super) fn write<const D: usize>(
    directory: &Path,
    model: &Model<D>,
    points: &Points<D>,
    attempt: &FailedAttempt<D>,
) -> io::Result<()> {
    let ranks = &points.ranks;
    let is_known = |iterate: &&Iterate<D>| {
        let Iterate { delta_d, out_of_balance, .. } = iterate;
        out_of_balance.len() == delta_d.len()
            && delta_d.iter().chain(out_of_balance).flatten().all(|x| x.is_finite())
    };
    let iterate = attempt.iterate.as_ref().filter(is_known);
    if !ranks.all(iterate.is_some()) {
        return Ok(());
    }
    let Some(iterate) = iterate else { return Ok(()) };
    let Iterate { links, delta_d, out_of_balance } = iterate;
    let GridMesh { nodes, corners, kinds, shown } = grid_mesh(model, links);
    let Step { index, end, .. } = attempt.step;
    let write = |name: &str, mesh: &Mesh, fields: &[Field]| {
        let path = |name: String| directory.join(name);
        let file = vtu::file(end, index as i64, mesh, fields, &[]);
        let file = file.map_err(|problem| invalid(format!("{name}: {problem}")));
        if ranks.is_alone() {
            return file?.write(&path(format!("{name}.vtu")));
        }
        let piece = |rank: usize| format!("{name}_r{rank}.vtu");
        let written = file.and_then(|file| file.write(&path(piece(ranks.own()))).map(|()| file));
        // A list must not name a missing piece.
        let is_missing = ranks.any(written.is_err());
        match written {
            Ok(file) if !is_missing && ranks.is_root() => {
                let names: Vec<String> = (0..ranks.count()).map(piece).collect();
                Pieces::new(&file, &names).write(&path(format!("{name}.pvtu")))
            }
            written => written.map(|_| ()),
        }
    };
    let order = points.by_id();
    let increments = increments_of(points, iterate);
    let moved = |p: usize| std::array::from_fn(|d| points.converged.position[p][d] + increments[p][d]);
    let positions: Vec<[f64; D]> = order.iter().map(|&p| moved(p)).collect();
    let displacement = |p: usize| {
        let so_far = points.displacement(p);
        padded(&std::array::from_fn::<f64, D, _>(|d| so_far[d] + increments[p][d]))
    };
    let displacement: Vec<[f64; 3]> = order.iter().map(|&p| displacement(p)).collect();
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
    let points_written = write(FILES[0], &mesh, &fields);

    let [increments, forces] = [delta_d, out_of_balance].map(|field| match &shown {
        None => field.iter().map(padded).collect::<Vec<[f64; 3]>>(),
        Some(shown) => shown.iter().map(|node| padded(&field[*node as usize])).collect(),
    });
    let fields = [
        vector("displacement_increment", &increments),
        vector("out_of_balance_force", &forces),
        number("in_equilibrium", &no[..nodes.len()]),
    ];
    let mesh = Mesh { points: &nodes, kinds: Kinds::Each(&kinds), connectivity: &corners };
    // All ranks write the second file together, whether or not the first succeeded.
    let grid_written = write(FILES[1], &mesh, &fields);
    points_written.and(grid_written)
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
