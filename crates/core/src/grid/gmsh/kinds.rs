//! The element types of gmsh.

/// A supported element type; all supported types are linear.
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

    /// The element type with this number in gmsh; `None` if it is not supported.
    pub(super) fn from_code(code: i32) -> Option<ElementKind> {
        Some(match code {
            1 => ElementKind::Line,
            2 => ElementKind::Triangle,
            3 => ElementKind::Quadrilateral,
            4 => ElementKind::Tetrahedron,
            5 => ElementKind::Hexahedron,
            15 => ElementKind::Point,
            _ => return None,
        })
    }
}

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
        let kinds =
            (0..200).filter_map(|code| Some((ElementKind::from_code(code)?, name_and_nodes(code)?.1)));
        let kinds: Vec<_> = kinds.collect();
        assert_eq!(kinds.len(), 6);
        assert!(kinds.iter().all(|(kind, n_nodes)| kind.n_nodes() == *n_nodes));
    }
}
