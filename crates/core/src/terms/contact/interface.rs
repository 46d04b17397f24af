//! The law of an interface: the force at one contact point from its gap and slip, with the consistent derivative.
//!
//! All functions are pure. Forces act on the body; a contact point with the area A transfers
//!
//! f = p n + t,  p = max(λ − ε g, −T),  t = w_t min(1, L/|w_t|),  w_t = (I − n⊗n)(λ_t − ε s),
//!
//! L = min(max(c + μ p, 0), m (p + T)),
//!
//! with the gap g, the outward normal n of the tool, the motion s relative to the tool in the step, the multipliers λ
//! and λ_t, the penalty ε, the largest tension T = A σ_t, and the adhesion c = A a. Without tension, the contact point
//! is open if λ − ε g ≤ 0. Rough surfaces have L = m (p + T) with m = 10. Other surfaces have m = 1 + μ: adhesion
//! acts fully as soon as the pressure equals it. The bound m (p + T) keeps forces continuous where surfaces open: a
//! shear that vanished abruptly would leave some states without equilibrium, and the iterations would not converge.

use crate::model::{Interface, Shear};
use crate::region::vector::{along, dot, minus, norm};

use super::motion::turn;

/// Round-off of the distance from a curved surface, in units of the round-off of a coordinate, [-].
const OF_CLOSEST: f64 = 4.0;

/// m of rough surfaces, [-].
const OF_ROUGH: f64 = 10.0;
/// Relative difference from the largest shear within which a contact point counts as sliding, [-].
pub(super) const SLIDES: f64 = 1e-6;

/// Round-off of a force that the law allows, relative to its size, [-].
const ROUND_OFF: f64 = 1e-9;

/// The multipliers of a contact point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Multiplier<const D: usize> {
    /// λ, [force].
    pub(super) normal: f64,
    /// λ_t, in the frame of the tool, [force].
    pub(super) shear: [f64; D],
}

impl<const D: usize> Multiplier<D> {
    pub(super) fn times(self, factor: f64) -> Self {
        Multiplier { normal: factor * self.normal, shear: self.shear.map(|t| factor * t) }
    }
}

impl<const D: usize> Default for Multiplier<D> {
    fn default() -> Self {
        Multiplier { normal: 0.0, shear: [0.0; D] }
    }
}

/// State of a contact point that touches a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The surfaces stick.
    Stick,
    /// The surfaces slide.
    Slip,
    /// The surfaces part under the largest tension.
    Parting,
}

/// What an update of the multipliers adds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Added<const D: usize> {
    /// The multipliers after the update; the shear is given in global axes, not in the frame of the tool.
    pub(super) multiplier: Multiplier<D>,
    /// The change of the force on the body, [force].
    pub(super) force: [f64; D],
    /// The change of the normal multiplier and, in `slip`, that of the shear, both divided by the penalty, [length].
    pub(super) overlap: f64,
    pub(super) slip: [f64; D],
}

/// The law of an interface, in terms of forces at one contact point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    /// μ, [-]; infinite for rough surfaces.
    pub(super) friction: f64,
    /// c, [force].
    pub(super) adhesion: f64,
    /// T, [force].
    pub(super) tension: f64,
    /// ε, [force/length].
    pub(super) penalty: f64,
    /// L, [force], if it is held.
    pub(super) held: Option<f64>,
}

impl Law {
    /// The law at a contact point with this area, [length²]. Tension acts only if `has_touched`, that is, if the
    /// surfaces touch when the step begins.
    pub(super) fn new(interface: &Interface, area: f64, penalty: f64, has_touched: bool) -> Law {
        let (friction, adhesion) = match interface.shear {
            Shear::Rough => (f64::INFINITY, 0.0),
            Shear::Coulomb { friction, adhesion } => (friction, adhesion * area),
        };
        let tension = if has_touched { interface.tension_cut_off * area } else { 0.0 };
        Law { friction, adhesion, tension, penalty, held: None }
    }

    pub(super) fn is_smooth(&self) -> bool {
        self.friction == 0.0 && self.adhesion == 0.0
    }

    /// True if these are the multipliers of a contact point that transfers pressure and sticks.
    pub(super) fn has_stuck<const D: usize>(&self, multiplier: &Multiplier<D>) -> bool {
        let most = self.most_shear(multiplier.normal).0;
        multiplier.normal > 0.0 && norm(&multiplier.shear) < (1.0 - SLIDES) * most
    }

    /// L, [force], and its derivative with respect to the pressure, [-].
    pub(super) fn most_shear(&self, pressure: f64) -> (f64, f64) {
        if let Some(held) = self.held {
            return (held, 0.0);
        }
        if self.friction.is_infinite() {
            return (OF_ROUGH * (pressure + self.tension), OF_ROUGH);
        }
        let steepest = (1.0 + self.friction) * (pressure + self.tension);
        let coulomb = self.adhesion + self.friction * pressure;
        if coulomb <= 0.0 {
            (0.0, 0.0)
        } else if coulomb <= steepest {
            (coulomb, self.friction)
        } else {
            (steepest, 1.0 + self.friction)
        }
    }
}

/// The motion of a contact point relative to its tool in the step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Approach<const D: usize> {
    /// g, [length].
    pub(super) gap: f64,
    /// n.
    pub(super) normal: [f64; D],
    /// ∂n/∂x, [1/length].
    pub(super) normal_derivative: [[f64; D]; D],
    /// s, [length].
    pub(super) slip: [f64; D],
    /// λ, [force].
    pub(super) pressure: f64,
    /// λ_t, in global axes, [force].
    pub(super) shear: [f64; D],
    /// True at the start of the iterations if the surfaces touch but transfer no force yet: their stiffness must act
    /// nevertheless.
    pub(super) is_fresh: bool,
    /// True at the start of the iterations: contact points that did not slide in the previous step then stick, whatever
    /// the shear, so that they hold the body.
    pub(super) at_rest: bool,
    /// True at the start of the iterations if the prescribed part of the motion would part a free tool from all bodies:
    /// contact points that carried force then hold the tool, even by tension, until the free part of its motion is
    /// known.
    pub(super) is_kept: bool,
}

impl<const D: usize> Approach<D> {
    fn multiplier(&self) -> Multiplier<D> {
        Multiplier { normal: self.pressure, shear: self.shear }
    }
}

/// The force at a contact point that touches a tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch<const D: usize> {
    approach: Approach<D>,
    law: Law,
    /// p, [force].
    pub(super) pressure: f64,
    /// t, [force].
    pub(super) shear: [f64; D],
    pub(super) mode: Mode,
    /// λ_t − ε s, [force].
    trial: [f64; D],
    /// L/|w_t| and the direction of w_t if the surfaces slide.
    sliding: Option<(f64, [f64; D])>,
}

impl<const D: usize> Touch<D> {
    /// The force at a contact point; `None` if it is open.
    pub(super) fn new(approach: Approach<D>, law: Law) -> Option<Self> {
        let trial = approach.pressure - law.penalty * approach.gap;
        let is_parting = trial <= -law.tension && !approach.is_kept;
        let holds = law.held.is_some_and(|held| held > 0.0);
        if is_parting && law.tension == 0.0 && !approach.is_fresh && !holds {
            return None;
        }
        let pressure = if approach.is_kept { trial } else { trial.max(-law.tension) };
        let w = along(&approach.shear, -law.penalty, &approach.slip);
        let mut touch = Touch {
            approach,
            law,
            pressure,
            shear: [0.0; D],
            mode: if is_parting && !approach.is_fresh { Mode::Parting } else { Mode::Stick },
            trial: w,
            sliding: None,
        };
        if law.is_smooth() {
            if touch.mode == Mode::Stick {
                touch.mode = Mode::Slip;
            }
            return Some(touch);
        }
        let n = &approach.normal;
        let tangential = along(&w, -dot(n, &w), n);
        let (size, most) = (norm(&tangential), law.most_shear(pressure).0);
        let sticks = approach.is_fresh
            || approach.is_kept
            || approach.at_rest && law.has_stuck(&approach.multiplier());
        if size > most && !sticks {
            let direction = tangential.map(|w| w / size);
            touch.shear = direction.map(|e| most * e);
            touch.sliding = Some((most / size, direction));
            if touch.mode == Mode::Stick {
                touch.mode = Mode::Slip;
            }
        } else {
            touch.shear = tangential;
        }
        Some(touch)
    }

    /// True if the shear is as large as the law allows.
    pub(super) fn is_limited(&self) -> bool {
        self.sliding.is_some()
    }

    /// True if no shear can act.
    pub(super) fn is_smooth(&self) -> bool {
        self.law.is_smooth()
    }

    pub(super) fn is_rough(&self) -> bool {
        self.law.friction.is_infinite()
    }

    /// The largest shear that the law allows at the present pressure, [force], if L were not held.
    pub(super) fn most_shear(&self) -> f64 {
        Law { held: None, ..self.law }.most_shear(self.pressure).0
    }

    /// f = p n + t, the force on the body, [force].
    pub(super) fn force(&self) -> [f64; D] {
        along(&self.shear, self.pressure, &self.approach.normal)
    }

    /// The pressure and the shear of a force on the body, [force].
    pub(super) fn parts(&self, force: &[f64; D]) -> (f64, [f64; D]) {
        if *force == self.force() {
            return (self.pressure, self.shear);
        }
        let n = &self.approach.normal;
        let pressure = dot(n, force);
        (pressure, along(force, -pressure, n))
    }

    /// True if the law allows this force on the body, [force], in the present position.
    pub(super) fn allows(&self, force: &[f64; D]) -> bool {
        let (pressure, shear) = self.parts(force);
        let shear = norm(&shear);
        let most = if self.law.is_smooth() { 0.0 } else { self.law.most_shear(pressure).0 };
        pressure > -self.law.tension && shear <= most + ROUND_OFF * (most + pressure.abs())
    }

    /// Round-off of the force due to the round-off of the gap from a curved surface, for coordinates of this magnitude,
    /// [force]; 0 for flat surfaces.
    pub(super) fn round_off(&self, coordinates: f64) -> f64 {
        let is_flat = self.approach.normal_derivative == [[0.0; D]; D];
        if is_flat { 0.0 } else { OF_CLOSEST * f64::EPSILON * self.law.penalty * coordinates }
    }

    /// True if the derivative of the force with respect to position is symmetric: without friction, or if a flat
    /// surface sticks.
    pub(super) fn is_symmetric(&self) -> bool {
        let is_flat = self.approach.normal_derivative == [[0.0; D]; D];
        let sticks = self.sliding.is_none() && self.mode == Mode::Stick;
        self.law.is_smooth() || is_flat && (sticks || self.law.held.is_some())
    }

    /// True if friction acts and the surfaces slide.
    pub(super) fn slides_with_friction(&self) -> bool {
        self.sliding.is_some() && self.mode == Mode::Slip
    }

    pub(super) fn normal(&self) -> [f64; D] {
        self.approach.normal
    }

    pub(super) fn gap(&self) -> f64 {
        self.approach.gap
    }

    /// The motion relative to the tool in the step, tangential to its surface, [length].
    pub(super) fn slip(&self) -> [f64; D] {
        let (n, s) = (&self.approach.normal, &self.approach.slip);
        along(s, -dot(n, s), n)
    }

    /// The change of the force, [force], for given velocities of the contact point and a rate of rotation of the tool:
    /// `relative` is the velocity relative to the tool at the current position of the contact point, `slipping` the
    /// velocity relative to the point of the tool at which the contact point was at the start of the step.
    pub(super) fn change(&self, relative: &[f64; D], slipping: &[f64; D], rate: &[f64; 3]) -> [f64; D] {
        let Touch { approach, law, .. } = self;
        let n = &approach.normal;
        let curved: [f64; D] = std::array::from_fn(|i| dot(&approach.normal_derivative[i], relative));
        let dn = along(&curved, 1.0, &turn(rate, n));
        let dp = if self.mode == Mode::Parting { 0.0 } else { -law.penalty * dot(n, relative) };
        let mut df = along(&n.map(|n| n * dp), self.pressure, &dn);
        if law.is_smooth() {
            return df;
        }
        let w = &self.trial;
        let dw = along(&turn(rate, &approach.shear), -law.penalty, slipping);
        // The derivative of the tangential part of w.
        let normal_part = dot(n, &dw) + dot(&dn, w);
        let d_tangential = along(&along(&dw, -normal_part, n), -dot(n, w), &dn);
        let dt = match &self.sliding {
            None => d_tangential,
            Some((share, e)) => {
                let across = along(&d_tangential, -dot(e, &d_tangential), e);
                let d_most = law.most_shear(self.pressure).1 * dp;
                along(&across.map(|x| x * share), d_most, e)
            }
        };
        df = along(&df, 1.0, &dt);
        df
    }

    /// An update of these multipliers, λ ← p and λ_t ← t, at the linearised end of an increment with these motions of
    /// the contact point relative to the tool, as [`Touch::change`] takes them; `None` if the contact point opens,
    /// parts, begins to slide, stops or turns back.
    pub(super) fn update_along(
        &self,
        now: &Multiplier<D>,
        relative: &[f64; D],
        slipping: &[f64; D],
    ) -> Option<Added<D>> {
        let Touch { approach, law, .. } = self;
        let n = &approach.normal;
        let pressure = now.normal - law.penalty * (approach.gap + dot(n, relative));
        if self.mode == Mode::Parting || pressure <= -law.tension {
            return None;
        }
        let more = pressure - now.normal;
        let w = along(&now.shear, -law.penalty, &along(&approach.slip, 1.0, slipping));
        let tangential = along(&w, -dot(n, &w), n);
        let (most, slope) = law.most_shear(pressure);
        let (shear, change) = match &self.sliding {
            _ if law.is_smooth() => ([0.0; D], [0.0; D]),
            None if norm(&tangential) > most => return None,
            None => (tangential, minus(&tangential, &now.shear)),
            Some((_, e)) if dot(e, &tangential) < most => return None,
            Some((_, e)) => (e.map(|e| most * e), e.map(|e| slope * more * e)),
        };
        Some(Added {
            multiplier: Multiplier { normal: pressure, shear },
            force: along(&change, more, n),
            overlap: more / law.penalty,
            slip: minus(&shear, &now.shear).map(|t| t / law.penalty),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::vector::unit;

    fn approach(gap: f64, slip: [f64; 3]) -> Approach<3> {
        Approach {
            gap,
            normal: [0.0, 0.0, 1.0],
            normal_derivative: [[0.0; 3]; 3],
            slip,
            pressure: 2.0,
            shear: [0.5, 0.0, 0.0],
            is_fresh: false,
            at_rest: false,
            is_kept: false,
        }
    }

    fn law(friction: f64, adhesion: f64, tension: f64) -> Law {
        Law { friction, adhesion, tension, penalty: 10.0, held: None }
    }

    #[test]
    fn forces_follow_the_law() {
        let touch = Touch::new(approach(-0.1, [0.0; 3]), law(0.5, 0.0, 0.0)).unwrap();
        assert_eq!((touch.force(), touch.mode), ([0.5, 0.0, 3.0], Mode::Stick));
        let touch = Touch::new(approach(-0.1, [-1.0, 0.0, 0.3]), law(0.5, 0.25, 0.0)).unwrap();
        assert_eq!((touch.force(), touch.mode), ([1.75, 0.0, 3.0], Mode::Slip));
        let touch = Touch::new(approach(-0.1, [0.0, 2.0, 0.0]), law(f64::INFINITY, 0.0, 0.0)).unwrap();
        assert_eq!((touch.force(), touch.mode), ([0.5, -20.0, 3.0], Mode::Stick));
        let far = Touch::new(approach(-0.1, [0.0, 4.0, 0.0]), law(f64::INFINITY, 0.0, 0.0)).unwrap();
        assert!((norm(&far.shear) - 30.0).abs() < 1e-12 && far.mode == Mode::Slip);
        let touch = Touch::new(approach(-0.1, [0.0, 2.0, 0.0]), law(0.0, 0.0, 0.0)).unwrap();
        assert_eq!(touch.force(), [0.0, 0.0, 3.0]);
    }

    #[test]
    fn places_open_at_the_largest_tension() {
        assert!(Touch::new(approach(0.2, [0.0; 3]), law(0.5, 1.0, 0.0)).is_none());
        let tight = Touch::new(approach(0.3, [0.0; 3]), law(0.0, 0.0, 2.0)).unwrap();
        assert_eq!((tight.pressure, tight.mode), (-1.0, Mode::Slip));
        let parting = Touch::new(approach(0.5, [0.0; 3]), law(0.5, 0.1, 2.0)).unwrap();
        assert_eq!((parting.force(), parting.mode), ([0.0, 0.0, -2.0], Mode::Parting));
        assert_eq!(parting.change(&unit(2), &unit(2), &[0.0; 3]), [0.0; 3]);
    }

    #[test]
    fn fresh_places_have_stiffness_without_force() {
        let fresh = Approach { pressure: 0.0, shear: [0.0; 3], is_fresh: true, ..approach(0.0, [0.0; 3]) };
        let touch = Touch::new(fresh, law(0.5, 0.0, 0.0)).unwrap();
        assert_eq!(touch.force(), [0.0; 3]);
        for axis in 0..3 {
            let e: [f64; 3] = unit(axis);
            assert_eq!(touch.change(&e, &e, &[0.0; 3]), e.map(|x| -10.0 * x));
        }
    }
}
