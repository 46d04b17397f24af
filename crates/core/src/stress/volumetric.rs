//! The treatment of the volumetric deformation of a body.

use serde::{Deserialize, Serialize};

/// How the volume ratio that the law sees follows from the displacement of the grid.
///
/// At every point of a nearly incompressible or isochorically flowing body, the standard method requires the correct
/// volume, which a linear basis cannot provide: the body locks. Both remedies require it only once per cell, and leave
/// the other parts of the deformation gradient as they are: ΔF̄ = (θ/ΔJ)^(1/n) ΔF with the volume ratio θ of the cell,
/// where n = 2 in plane strain, in which only the in-plane part is scaled, and n = 3 otherwise. Volumes of points and
/// the gradients of the basis follow from ΔF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Volumetric {
    /// The volume ratio of the point itself. Locks if the material is nearly incompressible or flows plastically at
    /// constant volume; reproduces the results of Coombs et al. (2020).
    #[default]
    Standard,
    /// The mean over the points of the material in the cell, or in a patch of triangles or tetrahedra, weighted by
    /// volume; its variation is averaged likewise, so that the stiffness stays symmetric. Available for every method.
    MeanDilatation,
    /// The volume ratio at the centre of the cell (Coombs, Charlton, Cortis and Augarde, 2018), with an unsymmetric
    /// stiffness. Available for MPM and GIMP on cells with four or eight corners.
    FBar,
}
