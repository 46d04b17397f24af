//! Division of the loading into load steps, and step control.

use serde::{Deserialize, Serialize};

use super::Dynamics;

/// Difference below which two times count as equal, relative to a requested step, [-].
pub const SAME_TIME: f64 = 1e-9;

/// Division of the loading into steps. *Requested* steps are those of the deck; the solver can cut or enlarge them.
#[derive(Debug, Clone, PartialEq)]
pub struct Stepping {
    /// Number of requested steps, all of equal size.
    pub count: usize,
    /// Time at the start, [time]: 0, or the end of the previous stage.
    pub start_time: f64,
    /// Time at the end of the analysis or stage, [time].
    pub end_time: f64,
    /// Smallest size to which a failed step is cut, relative to a requested step, [-].
    pub smallest: f64,
    /// True if a step that fails at the smallest size is repeated with damped iterations.
    pub damping: bool,
    /// Relaxation time of the viscosity that regularises laws as a last resort, relative to a requested step, [-]; 0
    /// rules it out.
    pub viscosity: f64,
    /// Largest step size, relative to a requested step, [-].
    pub largest: f64,
    /// Interval, as a number of requested steps, at which a step must end exactly, however large the steps are.
    pub stops: usize,
    /// Further times at which a step must end exactly, ascending, [time]: the kinks of the load curves.
    pub knots: Vec<f64>,
    /// Step control.
    pub control: Control,
    /// True if the analysis or stage ends once the load no longer grows, see
    /// [`LimitLoad`](crate::solver::LimitLoad).
    pub until_limit: bool,
    /// True if the analysis or stage ends once the bodies that move with inertia are at rest.
    pub until_rest: bool,
    /// True if the next stage goes on from the last equilibrium where this one finds no further equilibrium.
    pub goes_on_at_limit: bool,
    /// Factor by which the strength stays divided in a stage with inertia that follows a strength reduction, [-].
    pub held_strength: Option<f64>,
    /// The motion with inertia; `None` in statics.
    pub dynamics: Option<Dynamics>,
}

/// Step control: the quantity that is prescribed along the steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Control {
    /// Loads and boundary displacements follow their curves; displacements follow from equilibrium.
    Load,
    /// The displacement of a probe or a tool along an axis grows in proportion to time. A common factor of all loads
    /// follows from equilibrium.
    Displacement {
        /// The object whose displacement is prescribed.
        controlled: Controlled,
        /// Axis of the displacement, from 0.
        axis: usize,
        /// Displacement over the analysis or, if it has stages, over the stage, [length].
        to: f64,
    },
    /// The arc length of the displacements grows in proportion to time. A common factor of all loads follows from
    /// equilibrium.
    ArcLength {
        /// Arc length over the analysis or, if it has stages, over the stage, [length], as defined by
        /// [`crate::solver::path_length`]. Without it, the linear response of the first step to its share of the loads
        /// sets the arc length per unit time.
        length: Option<f64>,
    },
    /// The strength of the materials is divided by a factor that grows linearly with time, until equilibrium is no
    /// longer found ([`Material::with_strength_divided`](crate::material::Material::with_strength_divided)). Loads and
    /// boundary displacements follow their curves.
    StrengthReduction {
        /// Factor at the start, [-]. If it is above 1, the first requested step begins at full strength, so that it can be
        /// cut down to factors between 1 and `from`.
        from: f64,
        /// Factor at the end, [-].
        to: f64,
        /// Whether the search goes on once bodies have slid.
        after_slide: AfterSlide,
    },
}

/// What follows in a strength reduction once bodies have slid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum AfterSlide {
    /// The search ends in the first step in which bodies that have slid run away: equilibrium at larger factors would
    /// be that of another shape. Soft bodies that settle evenly do not end it.
    #[default]
    Stop,
    /// The search goes on to the last factor, or until no equilibrium is found, in whatever shape the bodies then have.
    Continue,
}

/// The object whose displacement is prescribed in displacement control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Controlled {
    /// The probe with this index: the mean displacement of its points.
    Probe(usize),
    /// The tool with this index: the displacement of its reference point.
    Tool(usize),
}

impl Control {
    /// True if a common factor of all loads follows from equilibrium.
    pub fn has_unknown_factor(&self) -> bool {
        matches!(self, Control::Displacement { .. } | Control::ArcLength { .. })
    }
}

impl Stepping {
    /// Load control with steps of fixed size that are never cut.
    pub fn fixed(count: usize, end_time: f64) -> Self {
        Stepping {
            count,
            start_time: 0.0,
            end_time,
            smallest: 1.0,
            damping: false,
            viscosity: 0.0,
            largest: 1.0,
            stops: 1,
            knots: Vec::new(),
            control: Control::Load,
            until_limit: false,
            until_rest: false,
            goes_on_at_limit: false,
            held_strength: None,
            dynamics: None,
        }
    }

    /// Time at the end of a requested step, [time].
    pub fn time(&self, requested: usize) -> f64 {
        self.start_time + self.duration() * (requested as f64 / self.count as f64)
    }

    /// The requested step that ends at this time; `None` if none does.
    pub fn requested(&self, time: f64) -> Option<usize> {
        let passed = (time - self.start_time) / self.size();
        let number = passed.round();
        ((passed - number).abs() <= SAME_TIME && number >= 0.0).then_some(number as usize)
    }

    /// True if damped iterations are allowed as a last resort: this requires load control and steps that can be cut.
    pub fn may_damp(&self) -> bool {
        self.damping && self.smallest < 1.0 && self.control == Control::Load
    }

    /// True if viscosity is allowed as a last resort: this requires steps that can be cut. A strength reduction looks for
    /// the strength at which bodies slide, and viscosity would carry them beyond it.
    pub fn may_relax(&self) -> bool {
        let reduces = matches!(self.control, Control::StrengthReduction { .. });
        self.viscosity > 0.0 && self.smallest < 1.0 && !reduces
    }

    /// Weight of the trial stress in the stress of a step of this duration with viscosity, [-]: η/(η + Δt) with the
    /// relaxation time η, which is `growth` times that of the settings.
    pub fn viscous_weight(&self, growth: f64, duration: f64) -> f64 {
        let relaxation = growth * self.viscosity;
        relaxation / (relaxation + duration / self.size())
    }

    /// Factor by which the strength of the materials is divided at a time, [-]; `None` without strength reduction.
    pub fn strength_factor(&self, time: f64) -> Option<f64> {
        let Control::StrengthReduction { from, to, .. } = self.control else { return None };
        if let Some(first) = self.first_jump().filter(|_| self.is_in_first_step(time)) {
            return Some(1.0 + (first - 1.0) * ((time - self.start_time) / self.size()).max(0.0));
        }
        Some(from + (to - from) * ((time - self.start_time) / self.duration()))
    }

    /// Factor by which the strength of the materials is divided at a time, [-], in a strength reduction or after it;
    /// `None` at full strength.
    pub fn strength_at(&self, time: f64) -> Option<f64> {
        self.strength_factor(time).or(self.held_strength)
    }

    /// The factor at the end of the first requested step of a strength reduction that begins above 1, [-].
    fn first_jump(&self) -> Option<f64> {
        let Control::StrengthReduction { from, to, .. } = self.control else { return None };
        (from > 1.0).then(|| from + (to - from) / self.count as f64)
    }

    /// True before the end of the first requested step.
    fn is_in_first_step(&self, time: f64) -> bool {
        time - self.start_time < self.size() * (1.0 - SAME_TIME)
    }

    /// Smallest size to which a failed step that starts at a time is cut, relative to a requested step, [-]. The factor
    /// of a strength reduction may grow more in the first requested step than in the others; the smallest change of the
    /// factor is the same.
    pub fn smallest_at(&self, start: f64) -> f64 {
        let Control::StrengthReduction { from, to, .. } = self.control else { return self.smallest };
        match self.first_jump().filter(|_| self.is_in_first_step(start)) {
            Some(first) => self.smallest * (to - from) / self.count as f64 / (first - 1.0),
            None => self.smallest,
        }
    }

    /// True if a strength reduction ends once bodies have slid.
    pub fn stops_after_slide(&self) -> bool {
        matches!(self.control, Control::StrengthReduction { after_slide: AfterSlide::Stop, .. })
    }

    /// Duration of all steps, [time].
    pub fn duration(&self) -> f64 {
        self.end_time - self.start_time
    }

    /// Duration of a requested step, [time].
    pub fn size(&self) -> f64 {
        self.duration() / self.count as f64
    }

    /// The first time after `time` at which a step must end, [time].
    pub fn next_stop(&self, time: f64) -> f64 {
        let slack = SAME_TIME * self.size();
        let every = if self.largest > 1.0 { self.stops.max(1) } else { 1 };
        let passed = ((time - self.start_time) / self.size() + SAME_TIME) as usize;
        let last = ((passed / every + 1) * every).min(self.count);
        // The end time is met to the last bit, so that the next stage begins exactly there.
        let stop = if last == self.count { self.end_time } else { self.time(last) };
        let after = self.knots.partition_point(|knot| *knot <= time + slack);
        self.knots.get(after).copied().filter(|knot| *knot < stop - slack).unwrap_or(stop)
    }
}
