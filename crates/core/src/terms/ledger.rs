//! The energies of the terms of equilibrium.

/// The contributions of a term to the energy balance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Ledger {
    /// Stored energy, [energy].
    pub stored: f64,
    /// Plastic work since the start of the analysis, [energy].
    pub plastic: f64,
    /// Part of the growth of `plastic` in this step that is not actual work, [energy]: the plastic work of a law
    /// follows from its history variables at full strength, but the strength was reduced.
    pub undone: f64,
    /// Work during the step that is lost in the next one, [energy].
    pub lost: f64,
    /// Energy dissipated by friction during the step, [energy]: work of the tools that does not reach the bodies.
    pub friction: f64,
}
