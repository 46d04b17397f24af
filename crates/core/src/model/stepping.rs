//! How the loading is divided into load steps, and what is prescribed along them.

/// Times that differ by less than this, relative to a requested step, are the same.
pub const SAME: f64 = 1e-9;

/// How the loading is divided into steps. A *requested* step is one of those that the deck asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Stepping {
    /// Number of requested steps, all of the same size.
    pub count: usize,
    /// Time at the end of the analysis, [time].
    pub end_time: f64,
    /// Smallest step that a failed one is cut to, relative to a requested one, [-].
    pub smallest: f64,
    /// Whether a step that fails and cannot be made smaller is tried once more with damped iterations.
    pub damping: bool,
    /// Largest step, relative to a requested one, [-].
    pub largest: f64,
    /// Every so many requested steps one ends exactly, however large steps are.
    pub stops: usize,
    /// Times at which a step ends exactly, ascending, [time]: where load curves have a kink.
    pub knots: Vec<f64>,
    /// What is prescribed along the steps.
    pub control: Control,
}

/// What is prescribed along the steps, and what follows from equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Control {
    /// Loads and motions of the boundary by their curves; displacements follow.
    Load,
    /// The mean displacement of the points of a probe along an axis grows in proportion to time; one factor of all loads
    /// follows.
    Displacement {
        /// Number of the probe.
        probe: usize,
        /// The axis.
        axis: usize,
        /// Displacement at the end of the analysis, [length].
        to: f64,
    },
    /// The length of the path of the displacements grows in proportion to time; one factor of all loads follows.
    ArcLength {
        /// Length of the path at the end of the analysis, [length]: that of [`crate::solver::path_length`]. Where it is
        /// not given, the first step takes its share of the load and sets the pace.
        length: Option<f64>,
    },
}

impl Stepping {
    /// Steps by time alone, that are not cut.
    pub fn fixed(count: usize, end_time: f64) -> Self {
        Stepping {
            count,
            end_time,
            smallest: 1.0,
            damping: false,
            largest: 1.0,
            stops: 1,
            knots: Vec::new(),
            control: Control::Load,
        }
    }

    /// Time at the end of a requested step, [time].
    pub fn time(&self, requested: usize) -> f64 {
        self.end_time * (requested as f64 / self.count as f64)
    }

    /// The requested step that ends at a time, if one does.
    pub fn requested(&self, time: f64) -> Option<usize> {
        let number = (time / self.size()).round();
        ((time / self.size() - number).abs() <= SAME && number >= 0.0).then_some(number as usize)
    }

    /// Whether damped iterations are the last resort: where steps may be cut, and all loads are known.
    pub fn may_damp(&self) -> bool {
        self.damping && self.smallest < 1.0 && self.control == Control::Load
    }

    /// Duration of a requested step, [time].
    pub fn size(&self) -> f64 {
        self.end_time / self.count as f64
    }

    /// The first time after another at which a step has to end, [time].
    pub fn next_stop(&self, time: f64) -> f64 {
        let slack = SAME * self.size();
        let every = if self.largest > 1.0 { self.stops.max(1) } else { 1 };
        let passed = (time / self.size() + SAME) as usize;
        let stop = self.time(((passed / every + 1) * every).min(self.count));
        let after = self.knots.partition_point(|knot| *knot <= time + slack);
        self.knots.get(after).copied().filter(|knot| *knot < stop - slack).unwrap_or(stop)
    }
}
