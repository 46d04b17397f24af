//! Reasons why contact cannot be evaluated.

use crate::counted::counted;
use crate::points::coordinates;

/// A contact point on a body, as named in errors.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPlace {
    /// What the body touches: "tool `name`", or "body `name`".
    pub other: String,
    /// Name of the body.
    pub body: String,
    /// Permanent number of the material point to whose domain the contact point belongs.
    pub point: u32,
    /// Position, [length].
    pub position: Vec<f64>,
}

impl ContactPlace {
    /// True if a body touches another body.
    pub fn is_between_bodies(&self) -> bool {
        self.other.starts_with("body")
    }

    /// What the body touches, in a word.
    fn kind(&self) -> &'static str {
        if self.is_between_bodies() { "body" } else { "tool" }
    }
}

impl std::fmt::Display for ContactPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ContactPlace { other, body, point, position } = self;
        write!(f, "point {point} of body `{body}` at {} and {other}", coordinates(position))
    }
}

/// The reason why the contact between tools and bodies cannot be evaluated.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A tool or a body overlaps a body before the first step of the body.
    #[error("{place} overlap by {overlap:.3e} at the start")]
    Overlap {
        /// The contact point.
        place: ContactPlace,
        /// The overlap, [length].
        overlap: f64,
    },
    /// A contact point slides too far along a tool in one step.
    #[error("{place} move by {motion:.3e} relative to each other in one step; at most {most:.3e} is allowed")]
    Slide {
        /// The contact point.
        place: ContactPlace,
        /// The relative motion, [length].
        motion: f64,
        /// The largest relative motion allowed, [length].
        most: f64,
    },
    /// A contact point passes through a part of a tool, or a side of a body, in one step.
    #[error("{place}: the contact point passes through the surface of the {} in one step", place.kind())]
    Through {
        /// The contact point.
        place: ContactPlace,
    },
    /// A part of a tool lies between the centre and a corner of the domain of a material point, where no contact point
    /// touches it.
    #[error(
        "{place}: this position is a corner of the domain of the point; a part of the tool lies between it and the \
         centre of the domain, where no contact point touches the tool"
    )]
    Between {
        /// The corner.
        place: ContactPlace,
    },
    /// The updates of the multipliers have not reduced the error to the tolerance.
    #[error(
        "{place}: after {}, {} and the slip is {slip:.3e}; the tolerance is {most:.3e}",
        counted(*augmentations, "multiplier update", "multiplier updates"), overlap_in_words(*overlap)
    )]
    NotSettled {
        /// The contact point with the largest error.
        place: ContactPlace,
        /// Number of updates of the multipliers.
        augmentations: usize,
        /// Overlap at this point, [length]; negative for a gap that still transfers a force.
        overlap: f64,
        /// Slip at this point, [length].
        slip: f64,
        /// Tolerance for overlap and slip, [length].
        most: f64,
    },
    /// Nothing resists the motion of a tool in its free components.
    #[error("nothing holds tool `{tool}` {component}: it touches no body")]
    Loose {
        /// Name of the tool.
        tool: String,
        /// The component in which the tool is free, such as "along x".
        component: &'static str,
    },
    /// A prescribed motion is not finite.
    #[error(
        "the motion of tool `{tool}` {component} is not finite: the formula `{formula}` gives {value} at load \
         factor {factor:?} and time {time:?}"
    )]
    NotFinite {
        /// Name of the tool.
        tool: String,
        /// The component of the motion, such as "along x".
        component: &'static str,
        /// Text of the formula.
        formula: String,
        /// Value of this formula.
        value: f64,
        /// The load factor.
        factor: f64,
        /// The time.
        time: f64,
    },
    /// A tool cannot follow an unknown load factor.
    #[error(
        "tool `{tool}` cannot follow an unknown load factor: it moves with time, turns about several axes, or acts \
         before the last stage"
    )]
    UnknownFactor {
        /// Name of the tool.
        tool: String,
    },
    /// A tool in contact with bodies of revolution moves off the axis.
    #[error("tool `{tool}` can only move along the axis of revolution, not {component}")]
    OffAxis {
        /// Name of the tool.
        tool: String,
        /// The component of the motion off the axis, such as "along x".
        component: &'static str,
    },
}

fn overlap_in_words(overlap: f64) -> String {
    if overlap < 0.0 {
        format!("a gap of {:.3e} still transfers a force", -overlap)
    } else {
        format!("the overlap is {overlap:.3e}")
    }
}

impl ContactError {
    /// True if a smaller step may avoid the error.
    pub fn may_succeed_if_smaller(&self) -> bool {
        matches!(
            self,
            ContactError::Slide { .. }
                | ContactError::Through { .. }
                | ContactError::Between { .. }
                | ContactError::NotSettled { .. }
        )
    }
}
