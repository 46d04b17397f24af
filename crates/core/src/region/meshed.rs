//! Cells of a mesh as a shape.

use crate::grid::element::ElementShape;
use crate::grid::{Grid, Mesh};

use super::line::between;
use super::polygon::extent_of;
use super::{Facet, Intervals, Line, Motion, Primitive, boundary_of_cells};

/// The region that some cells of a mesh fill, wherever it is placed.
#[derive(Debug, Clone)]
pub struct Meshed<const D: usize> {
    mesh: Mesh<D>,
    cells: Vec<u32>,
    is_part: Vec<bool>,
}

impl<const D: usize> Meshed<D> {
    /// The region that these cells of a mesh fill.
    pub fn new(mesh: Mesh<D>, cells: Vec<u32>) -> Self {
        let mut is_part = vec![false; mesh.n_cells()];
        cells.iter().for_each(|&cell| is_part[cell as usize] = true);
        Meshed { mesh, cells, is_part }
    }

    fn corners(&self) -> Vec<[f64; D]> {
        self.cells.iter().flat_map(|&cell| self.mesh.cell_corners(cell).to_vec()).collect()
    }
}

impl<const D: usize> Primitive<D> for Meshed<D> {
    fn contains(&self, x: &[f64; D]) -> bool {
        self.mesh.locate(x, None).is_some_and(|cell| self.is_part[cell as usize])
    }

    fn extent(&self, direction: &[f64; D]) -> [f64; 2] {
        extent_of(&self.corners(), direction)
    }

    fn volume(&self) -> f64 {
        self.cells.iter().map(|&cell| self.mesh.volume(cell)).sum()
    }

    fn intervals(&self, line: &Line<D>) -> Intervals {
        let mut all = Intervals::default();
        for &cell in &self.cells {
            for simplex in simplices(&self.mesh.cell_corners(cell)) {
                all = all.union(&within(&simplex, line));
            }
        }
        all
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<D>> {
        // `Region::boundary` refuses too many facets before it asks for them.
        boundary_of_cells(&self.mesh, &self.cells, &Motion::identity(), None, spacing).unwrap_or_default()
    }

    fn cells(&self) -> Option<(&dyn Grid<D>, &[u32])> {
        Some((&self.mesh, &self.cells))
    }
}

/// The triangles (tetrahedra) of which a cell consists.
fn simplices<const D: usize>(corners: &[[f64; D]]) -> Vec<Vec<[f64; D]>> {
    let parts: &[&[usize]] = match ElementShape::from_nodes::<D>(corners.len()) {
        Some(ElementShape::Simplex) if D == 2 => &[&[0, 1, 2]],
        Some(ElementShape::Simplex) => &[&[0, 1, 2, 3]],
        Some(ElementShape::Box) if D == 2 => &[&[0, 1, 2], &[0, 2, 3]],
        // Around a diagonal of the hexahedron.
        Some(ElementShape::Box) => {
            &[&[0, 1, 2, 6], &[0, 2, 3, 6], &[0, 3, 7, 6], &[0, 7, 4, 6], &[0, 4, 5, 6], &[0, 5, 1, 6]]
        }
        None => &[],
    };
    parts.iter().map(|part| part.iter().map(|&k| corners[k]).collect()).collect()
}

/// The interval of a line inside a simplex: that in which no barycentric coordinate is negative.
fn within<const D: usize>(simplex: &[[f64; D]], line: &Line<D>) -> Intervals {
    let whole = ElementShape::Simplex.volume(simplex);
    (0..=D).fold(Intervals::whole(), |inside, k| {
        let at = |x: [f64; D]| {
            let mut corners = simplex.to_vec();
            corners[k] = x;
            ElementShape::Simplex.volume(&corners) / whole
        };
        let start = at(line.origin);
        inside.intersection(&between(start, at(line.at(1.0)) - start, 0.0, f64::INFINITY))
    })
}
