//! Shear strength: the stress measure that it limits, and constants of the laws that yield.

/// The stress measure to which a shear strength applies. The two measures differ by the volume ratio J: σ = τ/J.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StrengthMeasure {
    /// The Cauchy stress σ, the force per unit current area, as measured in the field. The strength in terms of the
    /// Kirchhoff stress is J times the property, which makes the tangent unsymmetric.
    Cauchy,
    /// The Kirchhoff stress τ. The strength in terms of the Cauchy stress is the property divided by J.
    #[default]
    Kirchhoff,
}

/// Stresses count as elastic if they exceed the yield surface by less than this, relative to the larger of strength and
/// stress, [-].
///
/// A point that has yielded starts the next step on the surface up to round-off. Without a tolerance, round-off would
/// select its elastic or plastic tangent and so change the course of the Newton iterations.
pub(super) const ON_SURFACE: f64 = 1e-10;

/// √(2/3): ratio of the increment of the equivalent plastic strain to the norm of the deviatoric plastic strain
/// increment, [-].
pub(super) const EQUIVALENT: f64 = 0.816_496_580_927_726;
