//! Construction of a mesh from a mesh file.

use std::collections::BTreeMap;

use super::super::gmsh::{Element, ElementKind, GmshFile};
use super::cell::Cell;
use super::error::NEARLY_FLAT;
use super::{CellReport, Mesh, MeshError, MeshWarning, ON_EDGE, Side};
use crate::grid::ON_LINE;
use crate::grid::bins::{Bins, Bounds, bounds};
use crate::grid::element::{ElementShape, MAX_NODES, dot, folds, minus};
use crate::tensor::padded;

/// Number of cells listed in error messages.
const LISTED: usize = 5;

/// Relative volume below which a cell, or a corner of it, counts as having no volume; the reference is a square (cube)
/// on the longest edge of the cell.
const NO_VOLUME: f64 = 1e-10;

/// Range of z of a mesh in the plane that counts as round-off, relative to its extent, [-].
const FLAT: f64 = 1e-9;

/// Marks a node of the file that no cell uses.
const UNUSED: u32 = u32::MAX;

impl<const D: usize> Mesh<D> {
    /// Builds the mesh from all triangles and quadrilaterals (tetrahedra and hexahedra) of a file; unused nodes are
    /// dropped.
    ///
    /// Physical groups become sets. Every group yields a set of its nodes. In the plane, curve groups also yield a set
    /// of edges and surface groups a set of cells; in space, surface groups yield a set of faces and volume groups a
    /// set of cells. Elements with a node that no cell uses are ignored, and groups without any other element are
    /// dropped; groups of equal dimension and name are merged. A name that groups of several dimensions share denotes a
    /// set of nodes only together with a dimension. Cells with a negative volume are turned.
    ///
    /// # Errors
    /// [`MeshError`] if the file contains no valid mesh of dimension `D`.
    pub fn from_gmsh(file: &GmshFile) -> Result<Self, MeshError> {
        let (elements, notes) = elements::<D>(file)?;
        let cells: Vec<Cell<D>> = elements.iter().map(|element| cell(file, element)).collect();
        check_shapes(&elements, &cells)?;

        let node_of = number_nodes(file, &elements);
        let kept: Vec<u32> = (0u32..).zip(&node_of).filter(|(_, n)| **n != UNUSED).map(|(k, _)| k).collect();
        let positions: Vec<[f64; D]> =
            kept.iter().map(|k| std::array::from_fn(|d| file.nodes[*k as usize][d])).collect();
        let volume: Vec<f64> = cells.iter().map(|c| c.shape.volume(c)).collect();
        let mut sizes: Vec<f64> = volume.iter().map(|volume| Cell::<D>::size_of(*volume)).collect();
        let mut node_size = vec![f64::INFINITY; positions.len()];
        for (element, size) in elements.iter().zip(&sizes) {
            for node in element.nodes() {
                let around = &mut node_size[node_of[*node as usize] as usize];
                *around = around.min(*size);
            }
        }
        let half = sizes.len() / 2;
        let usual_size = *sizes.select_nth_unstable_by(half, f64::total_cmp).1;
        let mut mesh = Mesh {
            node_size,
            usual_size,
            n_simplices: cells.iter().filter(|c| c.shape == ElementShape::Simplex).count(),
            cell_nodes: elements.iter().flat_map(|e| e.nodes()).map(|n| node_of[*n as usize]).collect(),
            largest_size: Cell::<D>::size_of(volume.iter().copied().fold(0.0, f64::max)),
            bounds: bounds(positions.iter().copied()),
            bins: Bins::new(&cells.iter().map(inflated).collect::<Vec<_>>()),
            positions,
            volume,
            boundary: Vec::new(),
            node_sets: BTreeMap::new(),
            nodes_of_groups: BTreeMap::new(),
            side_sets: BTreeMap::new(),
            cell_sets: BTreeMap::new(),
            warnings: Vec::new(),
            patches: None,
        };
        let report = |k: u32| report(&elements[k as usize], &cells[k as usize]);
        mesh.find_boundary(report)?;
        mesh.warnings = mesh.check_fit(report, |node| file.node_tags[kept[node as usize] as usize])?;
        mesh.warnings.extend(notes);
        mesh.find_sets(file, &node_of);
        Ok(mesh)
    }
}

/// The element kinds that are cells, simplices first.
fn kinds<const D: usize>() -> [ElementKind; 2] {
    if D == 3 {
        [ElementKind::Tetrahedron, ElementKind::Hexahedron]
    } else {
        [ElementKind::Triangle, ElementKind::Quadrilateral]
    }
}

/// The cells of a file, simplices first, all counterclockwise (right-handed), and what was done to them.
///
/// # Errors
/// [`MeshError`] if there are none of dimension `D`, or if they do not lie in a plane of constant z.
fn elements<const D: usize>(file: &GmshFile) -> Result<(Vec<Element>, Vec<MeshWarning>), MeshError> {
    let alike = |kind| file.elements.iter().filter(move |e| e.kind == kind).copied();
    let [simplex, cuboid] = kinds::<D>();
    let mut elements: Vec<_> = alike(simplex).chain(alike(cuboid)).collect();
    let count = |dimension| file.elements.iter().filter(|e| e.kind.dimension() == dimension).count();
    if D == 2 && count(3) > 0 {
        return Err(MeshError::Solid { n: count(3) });
    }
    if elements.is_empty() {
        return Err(MeshError::NoCells { dimension: D, n_surface: if D == 3 { count(2) } else { 0 } });
    }
    let mut notes: Vec<_> = file.straightened.clone().map(MeshWarning::Straightened).into_iter().collect();
    notes.extend(turn::<D>(file, &mut elements));
    if D == 2 {
        let used = elements.iter().flat_map(|cell| cell.nodes()).map(|node| file.nodes[*node as usize]);
        let [low, high] = bounds(used);
        let range: [f64; 3] = std::array::from_fn(|d| high[d] - low[d]);
        let extent = range[0].max(range[1]);
        let (low, high) = (low[2], high[2]);
        if range[2] > NEARLY_FLAT * extent {
            let constant = (0..2).find(|&axis| range[axis] <= NEARLY_FLAT * extent.max(range[2]));
            return Err(MeshError::NotFlat { low, high, constant });
        }
        if range[2] > FLAT * extent {
            notes.push(MeshWarning::Flattened { low, high });
        }
    }
    Ok((elements, notes))
}

/// Turns the cells with a negative volume, and reports them. Neighbours that a turned cell overlaps are found later.
fn turn<const D: usize>(file: &GmshFile, elements: &mut [Element]) -> Option<MeshWarning> {
    let (all, mut n, mut first) = (elements.len(), 0, Vec::new());
    for element in elements {
        let cell = cell::<D>(file, element);
        if cell.shape.volume(&cell) < 0.0 {
            n += 1;
            if first.len() < LISTED {
                first.push(report(element, &cell));
            }
            element.turn();
        }
    }
    (n > 0).then_some(MeshWarning::Turned { dimension: D, n, all, first })
}

fn cell<const D: usize>(file: &GmshFile, element: &Element) -> Cell<D> {
    let mut x = [[0.0; D]; MAX_NODES];
    for (x, node) in x.iter_mut().zip(element.nodes()) {
        *x = std::array::from_fn(|d| file.nodes[*node as usize][d]);
    }
    let [simplex, _] = kinds::<D>();
    Cell { x, shape: if element.kind == simplex { ElementShape::Simplex } else { ElementShape::Box } }
}

fn report<const D: usize>(element: &Element, cell: &Cell<D>) -> CellReport {
    let position = cell.shape.map(cell, cell.shape.centre());
    CellReport { element: element.tag, position: position.to_vec() }
}

/// Checks that all cells have positive volume, quadrilaterals are convex and hexahedra do not fold. The comparisons are
/// written so that a NaN volume (from huge coordinates) fails the check.
fn check_shapes<const D: usize>(elements: &[Element], cells: &[Cell<D>]) -> Result<(), MeshError> {
    let dimension = D;
    let select = |wrong: &dyn Fn(&Cell<D>) -> bool| {
        let all = || elements.iter().zip(cells).filter(|(_, c)| wrong(c));
        (all().count(), all().take(LISTED).map(|(element, c)| report(element, c)).collect::<Vec<_>>())
    };
    let least = |c: &Cell<D>| {
        let longest = c.edges().map(|(a, b)| dot(minus(b, a), minus(b, a))).fold(0.0, f64::max);
        NO_VOLUME * if D == 2 { longest } else { longest * longest.sqrt() }
    };
    let has_volume = |c: &Cell<D>| {
        let volume = c.shape.volume(c);
        volume.is_finite() && volume.abs() > least(c)
    };
    let (n, first) = select(&|c| !has_volume(c));
    if n > 0 {
        return Err(MeshError::NoVolume { dimension, n, first });
    }
    let is_sound = |c: &Cell<D>| match (c.shape, D) {
        (ElementShape::Simplex, _) => true,
        (ElementShape::Box, 3) => !folds(&c.x.map(|x| padded(&x)), least(c)),
        (ElementShape::Box, _) => {
            c.shape.corner_determinants(c)[..c.len()].iter().all(|determinant| *determinant > least(c))
        }
    };
    let (n, first) = select(&|c| !is_sound(c));
    if n > 0 {
        return Err(MeshError::Folded { dimension, n, first });
    }
    let is_far = |c: &Cell<D>| {
        let farthest = c.x[..c.len()].iter().flatten().fold(0.0, |most, x| f64::max(most, x.abs()));
        let shortest = c.edges().map(|(a, b)| dot(minus(b, a), minus(b, a))).fold(f64::INFINITY, f64::min);
        f64::EPSILON * farthest > ON_LINE * shortest.sqrt()
    };
    let (n, mut first) = select(&is_far);
    if n > 0 {
        return Err(MeshError::FarAway { n, first: first.swap_remove(0) });
    }
    Ok(())
}

/// New numbers of the used nodes, in file order.
fn number_nodes(file: &GmshFile, elements: &[Element]) -> Vec<u32> {
    let mut number = vec![UNUSED; file.nodes.len()];
    for node in elements.iter().flat_map(|element| element.nodes()) {
        number[*node as usize] = 0;
    }
    let used = number.iter_mut().filter(|n| **n != UNUSED);
    used.zip(0..).for_each(|(entry, n)| *entry = n);
    number
}

/// Slightly enlarged bounding box of all positions that count as lying in a cell.
fn inflated<const D: usize>(cell: &Cell<D>) -> Bounds<D> {
    let [lower, upper] = cell.bounds();
    let margin = 2.0 * ON_EDGE * Cell::<D>::size_of(cell.shape.volume(cell));
    [lower.map(|x| x - margin), upper.map(|x| x + margin)]
}

impl<const D: usize> Mesh<D> {
    /// Builds the sets of nodes, sides and cells from the physical groups.
    fn find_sets(&mut self, file: &GmshFile, node_of: &[u32]) {
        let mut members = vec![Members::default(); file.groups.len()];
        let mut next = [0, self.n_simplices as u32]; // numbers of the next simplex and the next box
        let [simplex, _] = kinds::<D>();
        for element in &file.elements {
            let dimension = usize::from(element.kind.dimension());
            let mut cell = 0;
            if dimension == D {
                let kind = usize::from(element.kind != simplex);
                cell = next[kind];
                next[kind] += 1;
            }
            let nodes: Vec<u32> = element.nodes().iter().map(|node| node_of[*node as usize]).collect();
            if nodes.contains(&UNUSED) {
                continue;
            }
            for group in file.groups_of(element) {
                let members = &mut members[*group as usize];
                members.nodes.extend(&nodes);
                if dimension == D {
                    members.cells.push(cell);
                } else if dimension + 1 == D {
                    members.sides.push(Side::new(&nodes));
                }
            }
        }
        for (group, members) in file.groups.iter().zip(members).filter(|(_, m)| !m.nodes.is_empty()) {
            let (name, dimension) = (&group.name, group.dimension);
            add(self.nodes_of_groups.entry(name.clone()).or_default(), &dimension, members.nodes);
            add(&mut self.side_sets, name, members.sides);
            add(&mut self.cell_sets, name, members.cells);
        }
        self.node_sets = (self.nodes_of_groups.iter())
            .filter(|(_, by_dimension)| by_dimension.len() == 1)
            .filter_map(|(name, by_dimension)| Some((name.clone(), by_dimension.values().next()?.clone())))
            .collect();
    }
}

/// Members of one physical group.
#[derive(Debug, Clone, Default)]
struct Members {
    nodes: Vec<u32>,
    sides: Vec<Side>,
    cells: Vec<u32>,
}

/// Adds members, if any, to the set with this key. Sets are sorted, without duplicates.
fn add<K: Ord + Clone, T: Ord>(sets: &mut BTreeMap<K, Vec<T>>, key: &K, members: Vec<T>) {
    if !members.is_empty() {
        let set = sets.entry(key.clone()).or_default();
        set.extend(members);
        set.sort_unstable();
        set.dedup();
    }
}
