//! Measures beyond which there is a warning.

/// Work of the fresh grids relative to that of loads and reactions beyond which there is a warning, [-].
pub const MOST_REGRIDDING: f64 = 0.1;

/// Error of the balance of energy beyond which there is a warning, [-].
pub const MOST_ENERGY_ERROR: f64 = 0.1;

/// Crossings of cell borders by a standard point, in the mean over a body, beyond which there is a warning, [-] …
pub const MOST_CROSSINGS: f64 = 0.1;

/// … where the work of the fresh grids is beyond this part of the external work, [-]: they do harm.
pub const HARMFUL_REGRIDDING: f64 = 0.015;

/// Mean rotation of a body whose domains are boxes beyond which there is a warning, [degrees].
pub const MOST_BOX_ROTATION: f64 = 30.0;

/// Oscillation of the pressures beyond which there is a warning, [-].
pub const MOST_OSCILLATION: f64 = 1.2;
