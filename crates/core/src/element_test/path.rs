//! Loading paths of element tests: what is prescribed in the next step.

use super::state::ElementState;
use crate::tensor::Sym3;

/// What is prescribed along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Control {
    /// The normal component of e, the logarithmic strain measured from the start, positive in extension, [-].
    Strain(f64),
    /// The normal component of the Cauchy stress, positive in tension, [stress].
    Stress(f64),
}

/// The quantities prescribed at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// What is prescribed along x, y and z.
    pub axes: [Control; 3],
    /// True if the strain along z equals that along x; the control along x then applies to both.
    pub is_axisymmetric: bool,
    /// Shear components yz, xz and xy of e, [-].
    pub shears: [f64; 3],
    /// Amount γ of simple shear, [-].
    pub shear: f64,
}

impl Target {
    /// A target that prescribes quantities along the axes only; the principal axes are fixed.
    pub fn along_axes(axes: [Control; 3]) -> Target {
        Target { axes, is_axisymmetric: false, shears: [0.0; 3], shear: 0.0 }
    }

    /// The target with the deformation gradient F = exp(e).
    pub fn strain(e: &Sym3) -> Target {
        let shears = [e.component(1, 2), e.component(0, 2), e.component(0, 1)];
        let axes = [0, 1, 2].map(|axis| Control::Strain(e.0[axis]));
        Target { shears, ..Target::along_axes(axes) }
    }

    /// The target with these principal Cauchy stresses along the axes, [stress].
    pub fn stress(normal: [f64; 3]) -> Target {
        Target::along_axes(normal.map(Control::Stress))
    }

    /// The target at a fraction of the way from a state to this target; all prescribed quantities vary linearly.
    pub(super) fn between(&self, begin: &ElementState, fraction: f64) -> Target {
        if fraction >= 1.0 {
            return *self;
        }
        let stress = begin.cauchy_stress();
        let mean = |from: f64, to: f64| from + (to - from) * fraction;
        let shears =
            [begin.strain.component(1, 2), begin.strain.component(0, 2), begin.strain.component(0, 1)];
        Target {
            axes: std::array::from_fn(|axis| match self.axes[axis] {
                Control::Strain(to) => Control::Strain(mean(begin.strain.0[axis], to)),
                Control::Stress(to) => Control::Stress(mean(stress.0[axis], to)),
            }),
            shears: std::array::from_fn(|c| mean(shears[c], self.shears[c])),
            shear: mean(begin.shear, self.shear),
            ..*self
        }
    }
}

/// The path of a laboratory test; y is the axial direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Path {
    /// Axial compression without lateral strain.
    Oedometer,
    /// Compression by equal strains in all directions; its measure is −ln J.
    Isotropic,
    /// Axial compression at constant lateral stress, with equal lateral strains.
    TriaxialDrained,
    /// Axial compression at constant volume, with equal lateral strains.
    TriaxialUndrained,
    /// Axial compression in plane strain, without strain along z and at constant stress along x.
    Biaxial,
    /// Simple shear along x, at constant height or, if `constant_normal_stress`, at constant stress along y.
    SimpleShear {
        /// True if the stress along y is held instead of the height.
        constant_normal_stress: bool,
    },
}

impl Path {
    /// The target at a value of the measure of the path: axial compression −e_yy, the shear γ of simple shear, or −ln J
    /// of isotropic compression, [-]. Stresses that the path holds constant are those of `initial`, the Cauchy stress
    /// at the start, [stress].
    pub fn target(self, measure: f64, initial: &Sym3) -> Target {
        use Control::{Strain, Stress};
        let lateral = Stress(initial.0[0]);
        let axial = Strain(-measure);
        let fixed = Strain(0.0);
        match self {
            Path::Oedometer => Target::along_axes([fixed, axial, fixed]),
            Path::Isotropic => Target::along_axes([Strain(-measure / 3.0); 3]),
            Path::TriaxialDrained => {
                Target { is_axisymmetric: true, ..Target::along_axes([lateral, axial, lateral]) }
            }
            Path::TriaxialUndrained => {
                Target::along_axes([Strain(0.5 * measure), axial, Strain(0.5 * measure)])
            }
            Path::Biaxial => Target::along_axes([lateral, axial, fixed]),
            Path::SimpleShear { constant_normal_stress } => {
                let normal = if constant_normal_stress { Stress(initial.0[1]) } else { fixed };
                Target { shear: measure, ..Target::along_axes([fixed, normal, fixed]) }
            }
        }
    }
}
