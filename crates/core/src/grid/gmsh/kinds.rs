//! The element types of gmsh.

/// A supported element shape; elements of a higher order are read by their corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ElementKind {
    /// One node.
    Point,
    /// Two nodes.
    Line,
    /// Three nodes.
    Triangle,
    /// Four nodes, in order around the element.
    Quadrilateral,
    /// Four nodes.
    Tetrahedron,
    /// Eight nodes: four around one face, then the four opposite ones.
    Hexahedron,
}

impl ElementKind {
    /// Number of nodes.
    pub fn n_nodes(self) -> usize {
        match self {
            ElementKind::Point => 1,
            ElementKind::Line => 2,
            ElementKind::Triangle => 3,
            ElementKind::Quadrilateral | ElementKind::Tetrahedron => 4,
            ElementKind::Hexahedron => 8,
        }
    }

    /// Dimension, from 0 (points) to 3 (volumes).
    pub fn dimension(self) -> u8 {
        match self {
            ElementKind::Point => 0,
            ElementKind::Line => 1,
            ElementKind::Triangle | ElementKind::Quadrilateral => 2,
            ElementKind::Tetrahedron | ElementKind::Hexahedron => 3,
        }
    }

    /// The shape of the element type with this number in gmsh; `None` if it is not supported. Elements of all orders
    /// list their corners first.
    pub(super) fn from_code(code: i32) -> Option<ElementKind> {
        let (name, _) = name_and_nodes(code)?;
        Some(match name.split(' ').next()? {
            "Point" => ElementKind::Point,
            "Line" => ElementKind::Line,
            "Triangle" => ElementKind::Triangle,
            "Quadrilateral" => ElementKind::Quadrilateral,
            "Tetrahedron" => ElementKind::Tetrahedron,
            "Hexahedron" => ElementKind::Hexahedron,
            _ => return None,
        })
    }

    /// The corners at the ends of each edge, in the order in which gmsh lists the nodes of the edges of an element of
    /// the second order.
    pub(super) fn edges(self) -> &'static [[usize; 2]] {
        match self {
            ElementKind::Point => &[],
            ElementKind::Line => &[[0, 1]],
            ElementKind::Triangle => &[[0, 1], [1, 2], [2, 0]],
            ElementKind::Quadrilateral => &[[0, 1], [1, 2], [2, 3], [3, 0]],
            ElementKind::Tetrahedron => &[[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]],
            ElementKind::Hexahedron => &[
                [0, 1],
                [0, 3],
                [0, 4],
                [1, 2],
                [1, 5],
                [2, 3],
                [2, 6],
                [3, 7],
                [4, 5],
                [4, 7],
                [5, 6],
                [6, 7],
            ],
        }
    }

    /// True if an element of this shape with so many nodes is of the second order: a node in the middle of each edge.
    pub(super) fn has_middles(self, n_nodes: usize) -> bool {
        match self {
            ElementKind::Point => false,
            ElementKind::Line => n_nodes == 3,
            ElementKind::Triangle => n_nodes == 6,
            ElementKind::Quadrilateral => matches!(n_nodes, 8 | 9),
            ElementKind::Tetrahedron => n_nodes == 10,
            ElementKind::Hexahedron => matches!(n_nodes, 20 | 27),
        }
    }
}

/// Largest number of nodes of an element.
pub(super) const MOST_NODES: usize = 125;

/// Name and number of nodes of an element type, by its number in gmsh.
pub(super) fn name_and_nodes(code: i32) -> Option<(&'static str, usize)> {
    Some(match code {
        1 => ("Line 2", 2),
        2 => ("Triangle 3", 3),
        3 => ("Quadrilateral 4", 4),
        4 => ("Tetrahedron 4", 4),
        5 => ("Hexahedron 8", 8),
        6 => ("Prism 6", 6),
        7 => ("Pyramid 5", 5),
        8 => ("Line 3", 3),
        9 => ("Triangle 6", 6),
        10 => ("Quadrilateral 9", 9),
        11 => ("Tetrahedron 10", 10),
        12 => ("Hexahedron 27", 27),
        13 => ("Prism 18", 18),
        14 => ("Pyramid 14", 14),
        15 => ("Point", 1),
        16 => ("Quadrilateral 8", 8),
        17 => ("Hexahedron 20", 20),
        18 => ("Prism 15", 15),
        19 => ("Pyramid 13", 13),
        20 => ("Triangle 9", 9),
        21 => ("Triangle 10", 10),
        22 => ("Triangle 12", 12),
        23 => ("Triangle 15", 15),
        24 => ("Triangle 15I", 15),
        25 => ("Triangle 21", 21),
        26 => ("Line 4", 4),
        27 => ("Line 5", 5),
        28 => ("Line 6", 6),
        29 => ("Tetrahedron 20", 20),
        30 => ("Tetrahedron 35", 35),
        31 => ("Tetrahedron 56", 56),
        32 => ("Tetrahedron 22", 22),
        33 => ("Tetrahedron 28", 28),
        36 => ("Quadrilateral 16", 16),
        37 => ("Quadrilateral 25", 25),
        38 => ("Quadrilateral 36", 36),
        39 => ("Quadrilateral 12", 12),
        40 => ("Quadrilateral 16I", 16),
        41 => ("Quadrilateral 20", 20),
        92 => ("Hexahedron 64", 64),
        93 => ("Hexahedron 125", 125),
        99 => ("Hexahedron 32", 32),
        100 => ("Hexahedron 44", 44),
        101 => ("Hexahedron 56", 56),
        118 => ("Pyramid 30", 30),
        119 => ("Pyramid 55", 55),
        120 => ("Pyramid 91", 91),
        125 => ("Pyramid 21", 21),
        126 => ("Pyramid 29", 29),
        127 => ("Pyramid 37", 37),
        137 => ("Tetrahedron 16", 16),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_types_agrees_with_the_kinds() {
        let types: Vec<_> = (0..200).filter_map(name_and_nodes).collect();
        assert!(types.iter().all(|(_, n_nodes)| *n_nodes <= MOST_NODES));
        let linear = [(15, 1), (1, 2), (2, 3), (3, 4), (4, 4), (5, 8)];
        for (code, n_nodes) in linear {
            assert_eq!(ElementKind::from_code(code).map(ElementKind::n_nodes), Some(n_nodes), "{code}");
            assert_eq!(name_and_nodes(code).map(|(_, n)| n), Some(n_nodes), "{code}");
        }
        // The edges of the elements of the second order follow their corners.
        for (code, n_nodes) in [(8, 3), (9, 6), (11, 10), (16, 8), (17, 20)] {
            let kind = ElementKind::from_code(code);
            assert_eq!(kind.map(|kind| kind.n_nodes() + kind.edges().len()), Some(n_nodes), "{code}");
            assert!(kind.is_some_and(|kind| kind.has_middles(n_nodes)));
        }
        assert!((0..200).filter_map(|code| Some((code, name_and_nodes(code)?))).all(|(code, (name, _))| {
            ElementKind::from_code(code).is_none()
                == (name.starts_with("Prism") || name.starts_with("Pyramid"))
        }));
    }
}
