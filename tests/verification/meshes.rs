//! Small meshes, mapped from a rectangle or a brick of equal cells.

use std::fmt::Write;

/// Cells of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cells {
    /// Quadrilaterals, hexahedra.
    Boxes,
    /// Triangles, tetrahedra.
    Simplices,
}

/// A mesh of the unit square, mapped by `place`, as MSH 2.2: the group `body` has all cells, `left` the sides at s = 0,
/// and `right` the sides at s = 1. The diagonals of triangles are parallel, which locks more than any other pattern.
pub fn plane([n, m]: [usize; 2], cells: Cells, place: impl Fn(f64, f64) -> [f64; 2]) -> String {
    let node = |i: usize, j: usize| i * (m + 1) + j + 1;
    let mut nodes = Vec::new();
    for (i, j) in (0..=n).flat_map(|i| (0..=m).map(move |j| (i, j))) {
        let [x, y] = place(i as f64 / n as f64, j as f64 / m as f64);
        nodes.push([x, y, 0.0]);
    }
    let mut elements = Vec::new();
    for j in 0..m {
        elements.push(format!("1 2 1 1 {} {}", node(0, j), node(0, j + 1)));
        elements.push(format!("1 2 2 2 {} {}", node(n, j), node(n, j + 1)));
    }
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        match cells {
            Cells::Boxes => elements.push(format!("3 2 3 3 {a} {b} {c} {d}")),
            Cells::Simplices => {
                elements.extend([[a, b, c], [a, c, d]].map(|[a, b, c]| format!("2 2 3 3 {a} {b} {c}")));
            }
        }
    }
    msh(&nodes, &elements, 2)
}

/// A mesh of the unit cube, mapped by `place`, as MSH 2.2: the group `body` has all cells. In a mesh of tetrahedra,
/// each brick is divided into six around a diagonal.
pub fn brick(counts: [usize; 3], cells: Cells, place: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let node = |at: [usize; 3]| (at[2] * (counts[1] + 1) + at[1]) * (counts[0] + 1) + at[0] + 1;
    let each = |most: [usize; 3]| {
        (0..most[2]).flat_map(move |k| (0..most[1]).flat_map(move |j| (0..most[0]).map(move |i| [i, j, k])))
    };
    let nodes: Vec<[f64; 3]> = each(counts.map(|n| n + 1))
        .map(|at| place(std::array::from_fn(|d| at[d] as f64 / counts[d] as f64)))
        .collect();
    let mut elements = Vec::new();
    for at in each(counts) {
        let corner = |c: usize| node(std::array::from_fn(|d| at[d] + (c >> d & 1)));
        match cells {
            Cells::Boxes => {
                let [a, b, c, d, e, f, g, h] = [0, 1, 3, 2, 4, 5, 7, 6].map(corner);
                elements.push(format!("5 2 3 3 {a} {b} {c} {d} {e} {f} {g} {h}"));
            }
            Cells::Simplices => {
                for [first, second] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    let [a, b, c, d] = [0, first, second, 7].map(corner);
                    elements.push(format!("4 2 3 3 {a} {b} {c} {d}"));
                }
            }
        }
    }
    msh(&nodes, &elements, 3)
}

fn msh(nodes: &[[f64; 3]], elements: &[String], dimension: usize) -> String {
    let mut text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"left\"\n1 2 \"right\"\n{dimension} 3 \"body\"\n\
         $EndPhysicalNames\n$Nodes\n{}\n",
        nodes.len()
    );
    for (k, [x, y, z]) in (1..).zip(nodes) {
        let _ = writeln!(text, "{k} {x:.17e} {y:.17e} {z:.17e}");
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", elements.len());
    for (k, element) in (1..).zip(elements) {
        let _ = writeln!(text, "{k} {element}");
    }
    text + "$EndElements\n"
}

/// Writes a mesh to a file, which lives as long as the value that is returned.
#[allow(dead_code, reason = "not every test program uses it")]
pub fn written(mesh: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::with_suffix(".msh").unwrap();
    std::io::Write::write_all(&mut file, mesh.as_bytes()).unwrap();
    file
}
