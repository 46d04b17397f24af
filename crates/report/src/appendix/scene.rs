//! One state of the points, ready to be drawn: polygons in the plane of the picture, in the order of drawing.

use std::collections::{BTreeSet, HashMap};

use mpm_files::vtu::read::{MeshFile, Section};

use super::error::ReportError;
use super::field::FieldChoice;
use super::run::{Run, Snapshot, read_mesh, values};
use super::view::{Face, View};

/// One state of the points.
#[derive(Debug)]
pub(super) struct Scene {
    /// Title above the picture, in plain text.
    pub title: String,
    /// Value of the field at each point.
    pub values: Vec<f64>,
    /// Position of each point; empty for a scene in space.
    pub positions: Vec<[f64; 2]>,
    /// Radius of each point without a domain, or side of its cube in space; 0 for points with a domain.
    pub radii: Vec<f64>,
    /// Polygons to fill, in this order.
    pub domains: Vec<Polygon>,
    /// Sides of the active cells, each once; empty for a scene in space.
    pub sides: Vec<[[f64; 2]; 2]>,
    /// Smallest and largest coordinates of a scene in space.
    pub space: Option<[[f64; 3]; 2]>,
}

/// The domain of a point; in space, a face of its domain or cube.
#[derive(Debug)]
pub(super) struct Polygon {
    /// Corners of the polygon.
    pub corners: Vec<[f64; 2]>,
    /// Index of the point in the scene.
    pub point: usize,
    /// Brightness.
    pub shade: f64,
}

fn plane(position: [f64; 3]) -> [f64; 2] {
    [position[0], position[1]]
}

/// The cells of a mesh as polygons.
fn polygons(positions: &[[f64; 3]], corners: Vec<Vec<usize>>) -> Vec<Vec<[f64; 2]>> {
    corners
        .into_iter()
        .map(|cell| cell.into_iter().map(|corner| plane(positions[corner])).collect())
        .collect()
}

/// The sides of some cells; a side that neighbours share appears once.
fn sides(cells: &[Vec<usize>]) -> impl Iterator<Item = [usize; 2]> {
    let cell_sides = |corners: &Vec<usize>| {
        let side = |k: usize| [corners[k], corners[(k + 1) % corners.len()]];
        (0..corners.len()).map(side).map(|[a, b]| [a.min(b), a.max(b)]).collect::<Vec<_>>()
    };
    cells.iter().flat_map(cell_sides).collect::<BTreeSet<_>>().into_iter()
}

impl Scene {
    /// Reads a state of a run.
    pub fn read(
        run: &Run,
        snapshot: &Snapshot,
        field: &FieldChoice,
        title: String,
    ) -> Result<Scene, ReportError> {
        if !run.is_plane() {
            return Scene::read_in_space(run, snapshot, field, title);
        }
        let points = read_mesh(&snapshot.path)?;
        let positions = points.positions().map_err(ReportError::from_reader)?;
        let volumes = values(&points, Section::PointData, "volume")?;
        // A point of a body of revolution represents a ring; its square is the cross-section of the ring.
        let round = |x: f64| {
            if run.is_revolved() { std::f64::consts::TAU * x.abs().max(f64::MIN_POSITIVE) } else { 1.0 }
        };
        let areas = volumes.iter().zip(&positions).map(|(volume, x)| volume.abs() / round(x[0]));
        let mut scene = Scene {
            title,
            values: field.values(&points)?,
            positions: positions.iter().copied().map(plane).collect(),
            // Slightly less than half the side of a square with the area of the point.
            radii: areas.map(|area| 0.45 * area.sqrt()).collect(),
            domains: Vec::new(),
            sides: Vec::new(),
            space: None,
        };
        if let Some(mesh) = run.mesh("domains", snapshot.step)? {
            let positions = mesh.positions().map_err(ReportError::from_reader)?;
            let corners = mesh.corners().map_err(ReportError::from_reader)?;
            let ids = values(&mesh, Section::CellData, "point_id")?;
            let row_of = rows(&points)?;
            for (polygon, id) in polygons(&positions, corners).into_iter().zip(ids) {
                if let Some(point) = row_of(id) {
                    scene.radii[point] = 0.0;
                    scene.domains.push(Polygon { corners: polygon, point, shade: 1.0 });
                }
            }
        }
        if let Some(mesh) = run.mesh("grid", snapshot.step)? {
            let positions = mesh.positions().map_err(ReportError::from_reader)?;
            let corners = mesh.corners().map_err(ReportError::from_reader)?;
            scene.sides = sides(&corners).map(|side| side.map(|node| plane(positions[node]))).collect();
        }
        Ok(scene)
    }

    /// Reads a state of bodies in space: the visible faces of domains, or of cubes with slightly less than the volume
    /// of the points that have no domain, from the farthest to the nearest.
    fn read_in_space(
        run: &Run,
        snapshot: &Snapshot,
        field: &FieldChoice,
        title: String,
    ) -> Result<Scene, ReportError> {
        let view = View::new();
        let points = read_mesh(&snapshot.path)?;
        let positions = points.positions().map_err(ReportError::from_reader)?;
        let mut sides: Vec<f64> =
            values(&points, Section::PointData, "volume")?.iter().map(|v| 0.95 * v.abs().cbrt()).collect();
        let mut space = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut take_in = |place: &[f64; 3], reach: f64| {
            for d in 0..3 {
                space[0][d] = space[0][d].min(place[d] - reach);
                space[1][d] = space[1][d].max(place[d] + reach);
            }
        };
        let mut faces = Vec::new();
        if let Some(mesh) = run.mesh("domains", snapshot.step)? {
            let places = mesh.positions().map_err(ReportError::from_reader)?;
            let cells = mesh.corners().map_err(ReportError::from_reader)?;
            let ids = values(&mesh, Section::CellData, "point_id")?;
            let row_of = rows(&points)?;
            for (cell, id) in cells.iter().zip(ids) {
                if let Some(point) = row_of(id) {
                    sides[point] = 0.0;
                    let corners: Vec<[f64; 3]> = cell.iter().map(|&corner| places[corner]).collect();
                    corners.iter().for_each(|corner| take_in(corner, 0.0));
                    faces.extend(view.faces(&corners).into_iter().map(|face| (face, point)));
                }
            }
        }
        for (point, (place, side)) in positions.iter().zip(&sides).enumerate() {
            if *side > 0.0 {
                take_in(place, 0.5 * side);
                faces.extend(view.cube(*place, *side).into_iter().map(|face| (face, point)));
            }
        }
        faces.sort_by(|(a, _), (b, _)| a.depth.total_cmp(&b.depth));
        let polygon =
            |(face, point): (Face, usize)| Polygon { corners: face.corners, point, shade: face.shade };
        Ok(Scene {
            title,
            values: field.values(&points)?,
            positions: Vec::new(),
            radii: sides,
            domains: faces.into_iter().map(polygon).collect(),
            sides: Vec::new(),
            space: Some(space),
        })
    }

    /// True if any point has a domain.
    pub fn has_domains(&self) -> bool {
        self.radii.contains(&0.0)
    }

    /// Smallest and largest coordinates.
    pub fn extent(&self) -> [[f64; 2]; 2] {
        let corners =
            self.domains.iter().flat_map(|polygon| &polygon.corners).chain(self.sides.iter().flatten());
        let mut extent = corners.chain(&self.positions).fold(NOWHERE, |e, p| around(e, [*p, *p]));
        for (position, radius) in self.positions.iter().zip(&self.radii) {
            extent = around(extent, [position.map(|x| x - radius), position.map(|x| x + radius)]);
        }
        extent
    }
}

/// An empty extent.
pub(super) const NOWHERE: [[f64; 2]; 2] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];

/// The smallest extent that contains two others.
pub(super) fn around(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    [[a[0][0].min(b[0][0]), a[0][1].min(b[0][1])], [a[1][0].max(b[1][0]), a[1][1].max(b[1][1])]]
}

/// Finds the row of a point in a file of points by the number of the point. Numbers have gaps once bodies have been
/// removed.
fn rows(points: &MeshFile) -> Result<impl Fn(f64) -> Option<usize>, ReportError> {
    let numbers = values(points, Section::PointData, "point_id")?;
    let rows: HashMap<u64, usize> = numbers.iter().enumerate().map(|(row, id)| (*id as u64, row)).collect();
    Ok(move |id: f64| rows.get(&(id as u64)).copied())
}
