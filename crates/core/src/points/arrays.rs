//! Arrays of the points for users of the library, in the order of the permanent numbers.

use super::{FieldError, FieldKind, PointFieldSpec, PointValues, Points};
use crate::tensor::Sym3;

/// Name of the further field that stores the displacements at the last reset.
const DATUM: &str = "displacement_datum";

/// A quantity of the points in their converged state.
///
/// Arrays have one row per point in the order of the permanent numbers, independent of the current order of the points.
/// Vectors have `D` components. Matrices are stored by rows: xx, xy, xz, yx, yy, yz, zx, zy, zz. Symmetric tensors are
/// stored as xx, yy, zz, xy, yz, xz, as in VTU files: tensor components without the factors √2 of the Mandel layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointArray {
    /// Position, `D` components, [length].
    Position,
    /// Displacement since the start or the last reset, `D` components, [length].
    Displacement,
    /// Deformation gradient F, 9 components, [-].
    DeformationGradient,
    /// Kirchhoff stress τ, 6 components, tension positive, [stress].
    KirchhoffStress,
    /// Cauchy stress σ = τ/J, 6 components, tension positive, [stress].
    CauchyStress,
    /// Elastic strain in the measure of the law, 6 components with the shear components of the tensor, [-].
    /// [`Model::array`](crate::model::Model::array) returns the logarithmic strain.
    ElasticStrain,
    /// Volume J V_p0 of eq. (22), [volume]. [`Model::array`](crate::model::Model::array) returns the volume of the
    /// domain if the model uses that volume.
    Volume,
    /// Mass, [mass].
    Mass,
    /// Body index, [-].
    Body,
}

impl PointArray {
    /// All quantities.
    pub const ALL: [PointArray; 9] = [
        PointArray::Position,
        PointArray::Displacement,
        PointArray::DeformationGradient,
        PointArray::KirchhoffStress,
        PointArray::CauchyStress,
        PointArray::ElasticStrain,
        PointArray::Volume,
        PointArray::Mass,
        PointArray::Body,
    ];

    /// The name of the array.
    pub fn name(self) -> &'static str {
        match self {
            PointArray::Position => "position",
            PointArray::Displacement => "displacement",
            PointArray::DeformationGradient => "deformation_gradient",
            PointArray::KirchhoffStress => "kirchhoff_stress",
            PointArray::CauchyStress => "cauchy_stress",
            PointArray::ElasticStrain => "elastic_strain",
            PointArray::Volume => "volume",
            PointArray::Mass => "mass",
            PointArray::Body => "body",
        }
    }

    /// The quantity with this array name.
    pub fn named(name: &str) -> Option<PointArray> {
        PointArray::ALL.into_iter().find(|array| array.name() == name)
    }
}

impl<const D: usize> Points<D> {
    /// Displacement of a point in its converged state since the start or the last reset, [length].
    pub fn displacement(&self, p: usize) -> [f64; D] {
        let datum = self.datum();
        std::array::from_fn(|d| {
            let whole = self.converged.position[p][d] - self.original_position[p][d];
            datum.map_or(whole, |datum| whole - datum[p * D + d])
        })
    }

    /// The displacements at the last reset, `D` numbers for each point, [length]; `None` if the points have not been
    /// prepared for resets.
    fn datum(&self) -> Option<&[f64]> {
        if self.further.is_empty() {
            return None;
        }
        self.further.handle(DATUM).map(|datum| self.further.converged(datum))
    }

    /// True if the points of some analyses have a field or an array of this name, so that no history variable of a law
    /// may have it.
    pub fn reserves(name: &str) -> bool {
        Self::stores(name) || name == DATUM
    }

    /// Prepares the points for resets of their displacement.
    ///
    /// # Errors
    /// [`FieldError`] if the points already have a field with the name of the datum.
    pub fn prepare_resets(&mut self) -> Result<(), FieldError> {
        self.declare(PointFieldSpec {
            name: DATUM.to_owned(),
            unit: "length".to_owned(),
            components: D,
            // Checkpoints store fields that change.
            kind: FieldKind::Motion,
            start: vec![0.0; D * self.len()],
        })
        .map(|_| ())
    }

    /// Sets the displacements to zero; the points must have been prepared for this.
    #[inline(never)]
    pub(crate) fn reset_displacement(&mut self) {
        let Some(datum) = self.further.handle(DATUM) else { return };
        let whole =
            |(x, original): (&[f64; D], &[f64; D])| std::array::from_fn::<f64, D, _>(|d| x[d] - original[d]);
        let moved: Vec<f64> =
            self.converged.position.iter().zip(&self.original_position).flat_map(whole).collect();
        self.further.converged_mut(datum).copy_from_slice(&moved);
    }

    /// Moves a point to be added, and the corners of its domain if it has some, by these vectors, [length]. If the points
    /// have been prepared for resets, the motion does not count as displacement.
    pub(crate) fn shift(&mut self, p: usize, by: &[f64; D], corners: &[[f64; D]]) {
        let range = self.corner_range(p);
        let moved =
            self.converged.corners[range].iter_mut().zip(corners).flat_map(|(x, by)| x.iter_mut().zip(by));
        moved.chain(self.converged.position[p].iter_mut().zip(by)).for_each(|(x, by)| *x += by);
        if let Some(datum) = self.further.handle(DATUM) {
            let datum = &mut self.further.converged_mut(datum)[p * D..][..D];
            datum.iter_mut().zip(by).for_each(|(datum, by)| *datum += by);
        }
    }

    /// Cauchy stress σ = τ/J of a point in its converged state, [stress].
    pub fn cauchy_stress(&self, p: usize) -> Sym3 {
        self.converged.kirchhoff_stress[p] * (1.0 / self.converged.deformation_gradient[p].determinant())
    }

    /// A quantity of all points; [`PointArray`] defines shape, order and units.
    pub fn array(&self, array: PointArray) -> PointValues {
        let order = self.by_id();
        match array {
            PointArray::Position => PointValues::new(&order, |p| self.converged.position[p]),
            PointArray::Displacement => PointValues::new(&order, |p| self.displacement(p)),
            PointArray::DeformationGradient => {
                PointValues::new(&order, |p| self.converged.deformation_gradient[p])
            }
            PointArray::KirchhoffStress => PointValues::new(&order, |p| self.converged.kirchhoff_stress[p]),
            PointArray::CauchyStress => PointValues::new(&order, |p| self.cauchy_stress(p)),
            PointArray::ElasticStrain => PointValues::new(&order, |p| self.converged.elastic_strain[p]),
            PointArray::Volume => PointValues::new(&order, |p| self.volume(p)),
            PointArray::Mass => PointValues::new(&order, |p| self.mass[p]),
            PointArray::Body => PointValues::new(&order, |p| self.body[p]),
        }
    }

    /// A declared or further field by its name, in its converged state: `original_position`, `history`, … A field
    /// with several values per point contains all its values, one after another.
    pub fn field(&self, name: &str) -> Option<PointValues> {
        let order = self.by_id();
        self.stored(name, &order).or_else(|| {
            let handle = self.further.handle(name)?;
            let components = self.further.field(handle).components;
            Some(PointValues::stored(self.further.converged(handle), components, &order))
        })
    }
}
