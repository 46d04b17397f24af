//! The initial data of a point.

/// The initial data of one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Seed<const D: usize> {
    /// Body number.
    pub body: u16,
    /// Position, [length].
    pub position: [f64; D],
    /// Half lengths of the domain, [length]; zero for points without a domain. A standard point may have half lengths,
    /// too: they define the box with which it touches rigid tools.
    pub half_lengths: [f64; D],
    /// Corners of a domain given by corners, [length]; none for other points. 2^D corners define a quadrilateral or
    /// hexahedron, where bit d of a corner's number gives its side along parametric axis d; D + 1 corners define a
    /// triangle or tetrahedron of positive volume.
    pub corners: Vec<[f64; D]>,
    /// Volume, [volume].
    pub volume: f64,
    /// Mass, [mass].
    pub mass: f64,
    /// True if the point belongs to the outer layer of its body.
    pub outer_layer: bool,
    /// Initial history variables.
    pub history: Vec<f64>,
}
