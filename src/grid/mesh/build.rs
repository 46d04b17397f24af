//! From a mesh file to a mesh.

use std::collections::BTreeMap;

use super::super::gmsh::{Element, ElementKind, GmshFile};
use super::{BoundaryEdge, CellReport, Corners, Mesh, MeshError, MeshWarning, ON_EDGE};
use crate::grid::bins::{Bins, Bounds, bounds};
use crate::grid::element::{ElementShape, MAX_NODES};

/// Number of cells that reports list.
const LISTED: usize = 5;

/// A cell whose area (or corner) is less than this part of the square of its longest side has none.
const NO_AREA: f64 = 1e-10;

/// Nodes closer than this part of the shortest edge coincide.
const COINCIDE: f64 = 1e-9;

/// Marks a node of the file that no cell uses.
const UNUSED: u32 = u32::MAX;

impl Mesh {
    /// Builds the mesh of all triangles and quadrilaterals of a file; nodes that none of them uses are dropped.
    ///
    /// The physical groups become sets: a group of points is a set of nodes, of curves a set of edges and of their
    /// nodes, of surfaces a set of cells and of their nodes. Groups that have no elements on the cells are left
    /// out; groups of equal dimension and name are one.
    ///
    /// # Errors
    /// [`MeshError`]: what makes the file no mesh in the plane, or its cells unusable.
    pub fn from_gmsh(file: &GmshFile) -> Result<Mesh, MeshError> {
        let cells = cells(file)?;
        let corners: Vec<Corners> = cells.iter().map(|cell| corners(file, cell)).collect();
        check_shapes(&cells, &corners)?;

        let node_of = number_nodes(file, &cells);
        let mut positions = vec![[0.0; 2]; node_of.iter().filter(|n| **n != UNUSED).count()];
        for (node, [x, y, _]) in node_of.iter().zip(&file.nodes).filter(|(n, _)| **n != UNUSED) {
            positions[*node as usize] = [*x, *y];
        }
        let area: Vec<f64> = corners.iter().map(|c| c.shape.area(c)).collect();
        let mut mesh = Mesh {
            n_triangles: cells.iter().filter(|c| c.kind == ElementKind::Triangle).count(),
            cell_nodes: cells.iter().flat_map(|c| c.nodes()).map(|n| node_of[*n as usize]).collect(),
            largest_size: area.iter().copied().fold(0.0, f64::max).sqrt(),
            bounds: bounds(positions.iter().copied()),
            bins: Bins::new(&corners.iter().map(inflated).collect::<Vec<_>>()),
            positions,
            area,
            boundary: Vec::new(),
            node_sets: BTreeMap::new(),
            edge_sets: BTreeMap::new(),
            cell_sets: BTreeMap::new(),
            warnings: Vec::new(),
        };
        mesh.find_boundary(&cells, &corners)?;
        mesh.find_sets(file, &node_of)?;
        mesh.warnings.extend(mesh.unmerged());
        Ok(mesh)
    }
}

/// The cells of the file, triangles first.
fn cells(file: &GmshFile) -> Result<Vec<Element>, MeshError> {
    let of = |kind| file.elements.iter().filter(move |e| e.kind == kind).copied();
    let cells: Vec<_> = of(ElementKind::Triangle).chain(of(ElementKind::Quadrilateral)).collect();
    let n = file.elements.iter().filter(|e| e.kind.dimension() == 3).count();
    if n > 0 {
        return Err(MeshError::Solid { n });
    }
    if cells.is_empty() {
        return Err(MeshError::NoCells);
    }
    let used = || cells.iter().flat_map(|cell| cell.nodes()).map(|node| file.nodes[*node as usize]);
    let [lower, upper] = bounds(used().map(|x| [x[0], x[1]]));
    let [[low, _], [high, _]] = bounds(used().map(|x| [x[2], 0.0]));
    if high - low > 1e-9 * (upper[0] - lower[0]).max(upper[1] - lower[1]) {
        return Err(MeshError::NotFlat { low, high });
    }
    Ok(cells)
}

fn corners(file: &GmshFile, cell: &Element) -> Corners {
    let mut x = [[0.0; 2]; MAX_NODES];
    for (x, node) in x.iter_mut().zip(cell.nodes()) {
        *x = [file.nodes[*node as usize][0], file.nodes[*node as usize][1]];
    }
    let quadrilateral = cell.kind == ElementKind::Quadrilateral;
    Corners { x, shape: if quadrilateral { ElementShape::Quadrilateral } else { ElementShape::Triangle } }
}

fn report(cell: &Element, corners: &Corners) -> CellReport {
    CellReport { element: cell.tag, position: corners.shape.map(corners, corners.shape.centre()) }
}

/// Checks that all cells are counterclockwise and convex. Comparisons are such that areas that are not numbers,
/// from coordinates near the limits of the range, are no areas.
fn check_shapes(cells: &[Element], corners: &[Corners]) -> Result<(), MeshError> {
    let select = |wrong: &dyn Fn(&Corners) -> bool| {
        let all = || cells.iter().zip(corners).filter(|(_, c)| wrong(c));
        (all().count(), all().take(LISTED).map(|(cell, c)| report(cell, c)).collect::<Vec<_>>())
    };
    let least = |c: &Corners| {
        let longest =
            c.edges().map(|(a, b)| (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)).fold(0.0, f64::max);
        NO_AREA * longest
    };
    let has_area = |c: &Corners| {
        let area = c.shape.area(c);
        area.is_finite() && area.abs() > least(c)
    };
    let (n, first) = select(&|c| !has_area(c));
    if n > 0 {
        return Err(MeshError::ZeroArea { n, first });
    }
    let (n, first) = select(&|c| c.shape.area(c) < 0.0);
    if n == cells.len() {
        return Err(MeshError::AllClockwise);
    }
    if n > 0 {
        return Err(MeshError::Clockwise { n, first });
    }
    let convex = |c: &Corners| c.shape.corner_areas(c)[..c.len()].iter().all(|a| *a > least(c));
    let (n, first) = select(&|c| !convex(c));
    if n > 0 {
        return Err(MeshError::NotConvex { n, first });
    }
    Ok(())
}

/// Numbers of the used nodes, in the order of the file.
fn number_nodes(file: &GmshFile, cells: &[Element]) -> Vec<u32> {
    let mut number = vec![UNUSED; file.nodes.len()];
    for node in cells.iter().flat_map(|cell| cell.nodes()) {
        number[*node as usize] = 0;
    }
    let used = number.iter_mut().filter(|n| **n != UNUSED);
    used.zip(0..).for_each(|(entry, n)| *entry = n);
    number
}

/// The box of all positions that count as lying in a cell, and a little more.
fn inflated(corners: &Corners) -> Bounds {
    let [lower, upper] = bounds(corners.iter().copied());
    let margin = 2.0 * ON_EDGE * corners.shape.area(corners).sqrt();
    [lower.map(|x| x - margin), upper.map(|x| x + margin)]
}

impl Mesh {
    /// Finds the edges of one cell only, and cells that overlap because they lie on the same side of an edge.
    fn find_boundary(&mut self, cells: &[Element], corners: &[Corners]) -> Result<(), MeshError> {
        // Lower node, higher node, whether the cell has them in this order, cell.
        let mut edges: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(self.cell_nodes.len());
        for cell in 0..self.n_cells() as u32 {
            let nodes = self.cell_nodes(cell);
            for (&a, &b) in nodes.iter().zip(nodes[1..].iter().chain(&nodes[..1])) {
                edges.push((a.min(b), a.max(b), a < b, cell));
            }
        }
        edges.sort_unstable();
        let same_side = |pair: &&[(u32, u32, bool, u32)]| {
            (pair[0].0, pair[0].1, pair[0].2) == (pair[1].0, pair[1].1, pair[1].2)
        };
        let mut pairs = edges.windows(2).filter(same_side);
        if let Some(pair) = pairs.next() {
            let first = [pair[0].3 as usize, pair[1].3 as usize].map(|k| report(&cells[k], &corners[k]));
            return Err(MeshError::Overlap { n: 1 + pairs.count(), first });
        }
        for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if let [(low, high, forward, cell)] = *edge {
                let nodes = if forward { [low, high] } else { [high, low] };
                self.boundary.push(BoundaryEdge { nodes, cell });
            }
        }
        Ok(())
    }

    /// Makes the sets of nodes, edges and cells from the physical groups.
    fn find_sets(&mut self, file: &GmshFile, node_of: &[u32]) -> Result<(), MeshError> {
        let mut members = vec![Members::default(); file.groups.len()];
        let mut next = [0, self.n_triangles as u32]; // numbers of the next triangle and quadrilateral
        for element in &file.elements {
            let mut cell = 0;
            if element.kind.dimension() == 2 {
                let kind = usize::from(element.kind == ElementKind::Quadrilateral);
                cell = next[kind];
                next[kind] += 1;
            }
            let nodes = || element.nodes().iter().map(|node| node_of[*node as usize]);
            if nodes().any(|node| node == UNUSED) {
                continue;
            }
            for group in file.groups_of(element) {
                let members = &mut members[*group as usize];
                members.nodes.extend(nodes());
                match *element.nodes() {
                    [_] => {}
                    [a, b] => members.edges.push([a, b].map(|node| node_of[node as usize])),
                    _ => members.cells.push(cell),
                }
            }
        }
        let mut dimension_of = BTreeMap::new();
        for (group, members) in file.groups.iter().zip(members).filter(|(_, m)| !m.nodes.is_empty()) {
            let name = &group.name;
            let dimension = *dimension_of.entry(name).or_insert(group.dimension);
            if dimension != group.dimension {
                let dimensions = [dimension, group.dimension];
                return Err(MeshError::SharedName { name: name.clone(), dimensions });
            }
            add(&mut self.node_sets, name, members.nodes);
            add(&mut self.edge_sets, name, members.edges);
            add(&mut self.cell_sets, name, members.cells);
        }
        Ok(())
    }

    /// Nodes that coincide with others. Those of connected cells cannot, so only nodes at the boundary need a look.
    fn unmerged(&self) -> Option<MeshWarning> {
        let shortest_of = |c: Corners| {
            c.edges().map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).fold(f64::INFINITY, f64::min)
        };
        let cells = 0..self.n_cells() as u32;
        let shortest = cells.map(|cell| shortest_of(self.corners(cell))).fold(f64::INFINITY, f64::min);
        let tolerance = COINCIDE * shortest;
        let mut nodes: Vec<u32> = self.boundary.iter().flat_map(|edge| edge.nodes).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut pairs = Vec::new();
        // Two close positions share a square in at least one of four lattices of twice the tolerance.
        for shift in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]] {
            let square = |node: u32| -> [f64; 2] {
                let x = self.positions[node as usize];
                std::array::from_fn(|d| (x[d] / (2.0 * tolerance) + shift[d]).floor())
            };
            let mut squares: Vec<([f64; 2], u32)> = nodes.iter().map(|&node| (square(node), node)).collect();
            squares.sort_unstable_by(|(a, m), (b, n)| {
                a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(m.cmp(n))
            });
            for pair in squares.windows(2) {
                let (a, b) = (self.positions[pair[0].1 as usize], self.positions[pair[1].1 as usize]);
                if (b[0] - a[0]).hypot(b[1] - a[1]) <= tolerance {
                    pairs.push([pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1)]);
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let first = pairs.iter().take(LISTED).map(|pair| self.positions[pair[0] as usize]).collect();
        (!pairs.is_empty()).then_some(MeshWarning::Unmerged { n: pairs.len(), first })
    }
}

/// What belongs to one physical group.
#[derive(Debug, Clone, Default)]
struct Members {
    nodes: Vec<u32>,
    edges: Vec<[u32; 2]>,
    cells: Vec<u32>,
}

/// Adds members to the set of a name, which is made if there are any; sets are ascending and without repetition.
fn add<T: Ord>(sets: &mut BTreeMap<String, Vec<T>>, name: &str, members: Vec<T>) {
    if !members.is_empty() {
        let set = sets.entry(name.to_owned()).or_default();
        set.extend(members);
        set.sort_unstable();
        set.dedup();
    }
}
