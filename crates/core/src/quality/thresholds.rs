//! The largest values at which measures cause no warning.

/// Regridding work relative to all work, as in [`super::BalanceSoFar::regridding`], [-].
pub const MAX_REGRIDDING: f64 = 0.1;

/// Error of the energy balance, [-].
pub const MAX_ENERGY_ERROR: f64 = 0.1;

/// Error of the integration in time: work of the mean stresses that is neither stored nor dissipated by the laws,
/// relative to all work, [-].
pub const MAX_DEFECT: f64 = 0.1;

/// Mean number of cell boundaries that a point without a domain has crossed, [-]; more crossings are harmless as long
/// as the regridding work is below [`HARMFUL_REGRIDDING`].
pub const MAX_CROSSINGS: f64 = 0.1;

/// Regridding work relative to all work, as in [`super::BalanceSoFar::regridding`], at which crossings do harm, [-].
pub const HARMFUL_REGRIDDING: f64 = 0.015;

/// Mean rotation of a body whose domains are boxes, [degrees].
pub const MAX_BOX_ROTATION: f64 = 30.0;

/// Oscillation of the pressures, [-].
pub const MAX_OSCILLATION: f64 = 1.2;

/// Oscillation of the pressures where flow dilates, [-]: friction keeps the deviatoric stress below the pressure.
pub const MAX_DILATING_OSCILLATION: f64 = 0.4;
