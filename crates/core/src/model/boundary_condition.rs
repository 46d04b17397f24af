//! Prescribed displacements.

use crate::formula::Formula;

use super::load::LoadCurve;

/// The nodes on which a boundary condition acts.
#[derive(Debug, Clone, PartialEq)]
pub enum NodeSet {
    /// A fixed set of grid nodes, ascending.
    Fixed(Vec<u32>),
    /// All nodes that points of the outer layer of this body touch. The set is updated at every step.
    OuterLayer(u16),
    /// No nodes: the condition holds weakly on a surface of a body.
    Surface(OnSurface),
}

/// A condition that holds weakly on a surface, enforced with multipliers and a penalty. It prescribes the displacement
/// of the surface since the start of the analysis, or since the stage that sets it or adds the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnSurface {
    /// Index of the surface.
    pub surface: usize,
    /// True if the condition prescribes only the component along the original normal of the surface at each sample; the
    /// first entry of its displacement is this component.
    pub along_normal: bool,
    /// Penalty stiffness per unit area, relative to the axial modulus of the body divided by the cell size, [-]. It
    /// regularises the stiffness; results do not depend on it.
    pub penalty: f64,
}

/// A named set of prescribed nodal displacements.
#[derive(Debug, Clone)]
pub struct BoundaryCondition<const D: usize> {
    /// Name under which the reaction is reported.
    pub name: String,
    /// Nodes with prescribed displacement.
    pub nodes: NodeSet,
    /// Prescribed displacement along each axis, or along each direction of `axes`, [length]; `None` if the axis is
    /// free. It is a formula in the coordinates of the node (`D` values), the original position of the material at the
    /// node (`D` values) and the load factor. A formula that does not contain the load factor is multiplied by it.
    pub displacement: [Option<Formula>; D],
    /// Directions to which `displacement` refers if they are not the axes: orthonormal vectors, `[direction][axis]`.
    pub axes: Option<[[f64; D]; D]>,
    /// Load factor over time.
    pub curve: LoadCurve,
}

impl<const D: usize> BoundaryCondition<D> {
    /// The direction of one of the prescribed displacements on a surface with this original unit normal.
    pub fn direction(&self, displacement: usize, normal: [f64; D]) -> [f64; D] {
        match (&self.nodes, &self.axes) {
            (NodeSet::Surface(on), _) if on.along_normal => normal,
            (_, Some(axes)) => axes[displacement],
            _ => std::array::from_fn(|d| f64::from(u8::from(d == displacement))),
        }
    }

    /// A condition that prescribes displacements along the axes.
    pub fn new(
        name: impl Into<String>,
        nodes: NodeSet,
        displacement: [Option<Formula>; D],
        curve: LoadCurve,
    ) -> Self {
        BoundaryCondition { name: name.into(), nodes, displacement, axes: None, curve }
    }

    /// True if a displacement depends on the original position of the material.
    pub fn follows_material(&self) -> bool {
        self.displacement.iter().flatten().any(|formula| (D..2 * D).any(|k| formula.depends_on(k)))
    }

    /// True if the condition moves its nodes instead of fixing them.
    pub fn moves(&self) -> bool {
        self.displacement.iter().flatten().any(|formula| formula.as_constant() != Some(0.0))
    }

    /// The directions along which the condition prescribes the displacement, as unit vectors.
    pub fn directions(&self) -> Vec<[f64; D]> {
        (0..D).filter(|&k| self.displacement[k].is_some()).map(|k| self.direction_of(k)).collect()
    }

    /// True if the condition fixes its nodes along an axis or, if it has directions of its own, along the direction
    /// with this index.
    pub fn holds(&self, axis: usize) -> bool {
        self.displacement[axis].as_ref().is_some_and(|formula| formula.as_constant() == Some(0.0))
    }

    /// True if the condition fixes its nodes along a direction; further components of the direction are ignored.
    pub fn holds_along(&self, direction: &[f64]) -> bool {
        (0..D).any(|k| self.holds(k) && self.direction_of(k)[..] == direction[..D])
    }

    /// The direction of a component of the displacement, as a unit vector.
    fn direction_of(&self, k: usize) -> [f64; D] {
        self.axes.map_or_else(|| std::array::from_fn(|d| f64::from(u8::from(d == k))), |axes| axes[k])
    }
}

/// Value of a prescribed displacement for a current position, an original position and a load factor, [length].
pub fn displacement_at<const D: usize>(
    formula: &Formula,
    place: &[f64; D],
    original: &[f64; D],
    factor: f64,
) -> f64 {
    let mut variables = [0.0; 7];
    variables[..D].copy_from_slice(place);
    variables[D..2 * D].copy_from_slice(original);
    if formula.depends_on(2 * D) {
        variables[2 * D] = factor;
        formula.evaluate(&variables[..=2 * D])
    } else {
        formula.evaluate(&variables[..=2 * D]) * factor
    }
}
