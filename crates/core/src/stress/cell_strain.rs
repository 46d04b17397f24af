//! The deformation that the law sees at the points of a cell.

use serde::{Deserialize, Serialize};

/// How the deformation increment that the law sees follows from the displacement of the grid.
///
/// At every point of a nearly incompressible or isochorically flowing body, the standard method requires the correct
/// volume, which a linear basis cannot provide: the body locks. Mean dilatation and F-bar require it only once per cell,
/// and leave the other parts of the deformation gradient as they are: ΔF̄ = (θ/ΔJ)^(1/n) ΔF with the volume ratio θ of
/// the cell, where n = 2 in plane strain, in which only the in-plane part is scaled, and n = 3 otherwise. Where flow
/// dilates, it ties the volume to the shear at every point, and only the mean of the whole increment leaves one
/// constraint per cell. Volumes of points and the gradients of the basis follow from ΔF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CellStrain {
    /// The increment of the point itself. Locks if the material is nearly incompressible or flows plastically;
    /// reproduces the results of Coombs et al. (2020).
    #[default]
    Standard,
    /// The increment of the point with the mean volume ratio of the points of the material in the cell, or in a patch of
    /// triangles or tetrahedra, weighted by volume; its variation is averaged likewise, so that the stiffness stays
    /// symmetric. Available for every method.
    MeanDilatation,
    /// The increment of the point with the volume ratio at the centre of the cell (Coombs, Charlton, Cortis and Augarde,
    /// 2018), with an unsymmetric stiffness. Available for MPM and GIMP on cells with four or eight corners.
    FBar,
    /// The mean increment of the points of the material in the cell, or in a patch of triangles or tetrahedra, weighted
    /// by volume. A weak stress that flows with the soil resists the deviations of the points from it. For soils whose
    /// flow dilates; available for every method.
    Mean,
}

impl CellStrain {
    /// True if all points of a cell share a mean, so that the cell couples all its nodes.
    pub fn is_mean(self) -> bool {
        matches!(self, CellStrain::MeanDilatation | CellStrain::Mean)
    }
}
