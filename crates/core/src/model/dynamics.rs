//! Motion with inertia: the integration in time, its damping, and the mass that steadies cut cells.

use serde::{Deserialize, Serialize};

/// How a stage moves its bodies with inertia.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// Integration in time.
    pub scheme: Scheme,
    /// Mass that resists jumps of the velocity gradient across the faces of cut cells, relative to that of a cell, [-];
    /// see [`crate::terms::Inertia`].
    pub ghost_mass: f64,
    /// Damping by the mass, [1/time], and by the stiffness at the start of each step, [time].
    pub rayleigh: [f64; 2],
    /// Share of the velocity of the points that each step replaces by that of the grid, [-].
    pub pic: f64,
    /// Largest error of a step relative to the cell size, [-]: the difference between the motion of the step and that at
    /// the acceleration of the step before.
    pub largest_error: f64,
    /// Longest step, [time].
    pub longest: f64,
}

impl Dynamics {
    /// Ghost mass relative to that of a cell: the smallest for which the mass of cut cells is well conditioned, [-].
    pub const GHOST_MASS: f64 = 0.0025;
}

impl Default for Dynamics {
    fn default() -> Self {
        Dynamics {
            scheme: Scheme::Midpoint,
            ghost_mass: Dynamics::GHOST_MASS,
            rayleigh: [0.0; 2],
            pic: 0.0,
            largest_error: f64::INFINITY,
            longest: f64::INFINITY,
        }
    }
}

/// Integration of the equations of motion in time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// The midpoint rule with stresses that conserve energy and momentum, after Simo & Tarnow (1992),
    /// doi 10.1007/BF00913408, and Gonzalez (2000), doi 10.1016/S0045-7825(00)00189-4. Of second order, without
    /// damping.
    #[default]
    Midpoint,
    /// The generalised-α method of Chung & Hulbert (1993), doi 10.1115/1.2900803. Of second order; damps high
    /// frequencies.
    GeneralisedAlpha {
        /// Spectral radius for infinitely large steps, [-]: 1 damps nothing, 0 annihilates high frequencies in one step.
        spectral_radius: f64,
    },
    /// Backward Euler. Of first order; damps every motion, the more the larger the step is.
    BackwardEuler,
}

/// The force of inertia in a step, M (`displacement` u − `velocity` v − `acceleration` a), with the velocity v and the
/// acceleration a at its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceOfInertia {
    /// Factor of the displacement increment, [1/time²].
    pub displacement: f64,
    /// Factor of the velocity at the start, [1/time].
    pub velocity: f64,
    /// Factor of the acceleration at the start, [-].
    pub acceleration: f64,
}

/// The parameters of the generalised-α method.
#[derive(Debug, Clone, Copy)]
struct Alpha {
    mass: f64,
    force: f64,
    beta: f64,
    gamma: f64,
}

impl Alpha {
    fn new(radius: f64) -> Alpha {
        let (mass, force) = ((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0));
        let shift = 1.0 - mass + force;
        Alpha { mass, force, beta: 0.25 * shift * shift, gamma: shift - 0.5 }
    }
}

impl Scheme {
    /// Weight of the end of the step in its mean forces, [-]; loads act with their values at this part of the step.
    pub fn weight(self) -> f64 {
        match self {
            Scheme::Midpoint => 0.5,
            Scheme::GeneralisedAlpha { spectral_radius } => 1.0 - Alpha::new(spectral_radius).force,
            Scheme::BackwardEuler => 1.0,
        }
    }

    /// True if the accelerations of the points belong to their state.
    pub fn keeps_acceleration(self) -> bool {
        matches!(self, Scheme::GeneralisedAlpha { .. })
    }

    /// The force of inertia in a step of this duration, [time].
    pub fn force(self, duration: f64) -> ForceOfInertia {
        let per = 1.0 / duration;
        match self {
            Scheme::Midpoint => {
                ForceOfInertia { displacement: 2.0 * per * per, velocity: 2.0 * per, acceleration: 0.0 }
            }
            Scheme::GeneralisedAlpha { spectral_radius } => {
                let Alpha { mass, beta, .. } = Alpha::new(spectral_radius);
                let share = 1.0 - mass;
                ForceOfInertia {
                    displacement: share * per * per / beta,
                    velocity: share * per / beta,
                    acceleration: share * (0.5 / beta - 1.0) - mass,
                }
            }
            Scheme::BackwardEuler => {
                ForceOfInertia { displacement: per * per, velocity: per, acceleration: 0.0 }
            }
        }
    }

    /// The changes of velocity and acceleration in a step of this duration, [time], from the displacement increment and
    /// from the velocity and the acceleration at its start.
    pub fn changes(self, duration: f64, u: f64, v: f64, a: f64) -> [f64; 2] {
        match self {
            Scheme::Midpoint => [2.0 * (u / duration - v), 0.0],
            Scheme::GeneralisedAlpha { spectral_radius } => {
                let Alpha { beta, gamma, .. } = Alpha::new(spectral_radius);
                let end = (u - duration * v) / (beta * duration * duration) - (0.5 / beta - 1.0) * a;
                [duration * ((1.0 - gamma) * a + gamma * end), end - a]
            }
            Scheme::BackwardEuler => [u / duration - v, 0.0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Displacement and velocity of an oscillator of unit mass after some steps, started with unit velocity.
    fn oscillate(scheme: Scheme, frequency: f64, duration: f64, steps: usize) -> [f64; 3] {
        let (mut x, mut v, mut a) = (0.0, 1.0, 0.0);
        let stiffness = frequency * frequency;
        let (force, weight) = (scheme.force(duration), scheme.weight());
        for _ in 0..steps {
            let u = (force.velocity * v + force.acceleration * a - stiffness * x)
                / (force.displacement + weight * stiffness);
            let [dv, da] = scheme.changes(duration, u, v, a);
            (x, v, a) = (x + u, v + dv, a + da);
        }
        [x, v, 0.5 * (v * v + stiffness * x * x)]
    }

    #[test]
    fn the_midpoint_rule_keeps_the_energy_of_an_oscillator() {
        let [_, _, energy] = oscillate(Scheme::Midpoint, 3.0, 0.2, 1000);
        assert!((energy - 0.5).abs() < 1e-12, "{energy}");
    }

    #[test]
    fn errors_fall_with_the_order_of_the_scheme() {
        let alpha = |radius| Scheme::GeneralisedAlpha { spectral_radius: radius };
        for (scheme, order) in
            [(Scheme::Midpoint, 2), (alpha(0.8), 2), (alpha(0.0), 2), (Scheme::BackwardEuler, 1)]
        {
            let error = |steps: usize| {
                let [x, v, _] = oscillate(scheme, 2.0, 1.0 / steps as f64, steps);
                (x - 2f64.sin() / 2.0).hypot(v - 2f64.cos())
            };
            let found = (error(200) / error(400)).log2();
            assert!((found - f64::from(order)).abs() < 0.1, "{scheme:?}: {found}");
        }
    }

    #[test]
    fn periods_of_the_oscillator_with_twenty_steps_each() {
        // The time at which x passes zero upwards for the tenth time, by linear interpolation.
        let period = |scheme: Scheme, steps: usize| {
            let duration = std::f64::consts::TAU / steps as f64;
            let (mut found, mut before) = (0, 0.0);
            let mut n = 1;
            loop {
                let [x, ..] = oscillate(scheme, 1.0, duration, n);
                if before < 0.0 && x >= 0.0 {
                    found += 1;
                    if found == 10 {
                        return (n as f64 - x / (x - before)) / steps as f64 / 10.0;
                    }
                }
                before = x;
                n += 1;
            }
        };
        for (scheme, steps, expected) in [
            (Scheme::Midpoint, 20, 0.008171),
            (Scheme::Midpoint, 40, 0.002053),
            (Scheme::GeneralisedAlpha { spectral_radius: 0.8 }, 20, 0.008623),
            (Scheme::GeneralisedAlpha { spectral_radius: 0.8 }, 40, 0.002167),
        ] {
            let error = period(scheme, steps) - 1.0;
            assert!((error - expected).abs() < 2e-4, "{scheme:?} {steps}: {error} {expected}");
        }
    }
}
