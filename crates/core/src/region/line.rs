//! Straight lines and intervals on them.

use super::vector::{along, unit};

/// The straight line `origin` + t `direction` for all real t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line<const D: usize> {
    /// The position at t = 0, [length].
    pub origin: [f64; D],
    /// Change of position with t; must not be zero.
    pub direction: [f64; D],
}

impl<const D: usize> Line<D> {
    /// The line through a position along an axis; t is the distance from the position.
    pub fn along_axis(origin: [f64; D], axis: usize) -> Self {
        Line { origin, direction: unit(axis) }
    }

    /// The position at t, [length].
    pub fn at(&self, t: f64) -> [f64; D] {
        along(&self.origin, t, &self.direction)
    }

    /// The interval of t in which a coordinate lies between two values.
    pub(super) fn slab(&self, axis: usize, low: f64, high: f64) -> Intervals {
        between(self.origin[axis], self.direction[axis], low, high)
    }
}

/// Ascending, disjoint intervals of the parameter t of a line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Intervals(Vec<[f64; 2]>);

impl Intervals {
    /// The whole line.
    pub fn whole() -> Self {
        Intervals(vec![[f64::NEG_INFINITY, f64::INFINITY]])
    }

    /// A single interval; none if its length is not positive.
    pub fn one(low: f64, high: f64) -> Self {
        Intervals(if low < high { vec![[low, high]] } else { Vec::new() })
    }

    /// Intervals between the parameters, in any order, at which a line crosses the boundary of a region.
    pub(super) fn from_crossings(mut crossings: Vec<f64>) -> Self {
        crossings.sort_by(f64::total_cmp);
        Intervals(crossings.chunks_exact(2).filter(|c| c[0] < c[1]).map(|c| [c[0], c[1]]).collect())
    }

    /// The intervals.
    pub fn as_slice(&self) -> &[[f64; 2]] {
        &self.0
    }

    /// True if a parameter lies in one of the intervals.
    pub fn contains(&self, t: f64) -> bool {
        self.0.iter().any(|[low, high]| *low <= t && t <= *high)
    }

    /// Total length of the intervals.
    pub fn length(&self) -> f64 {
        self.0.iter().map(|[low, high]| high - low).sum()
    }

    /// Union with other intervals.
    pub fn union(&self, other: &Intervals) -> Intervals {
        let (mut a, mut b) = (self.0.iter().peekable(), other.0.iter().peekable());
        let mut all: Vec<[f64; 2]> = Vec::with_capacity(self.0.len() + other.0.len());
        loop {
            let next = match (a.peek(), b.peek()) {
                (Some(x), Some(y)) if x[0] <= y[0] => a.next(),
                (_, Some(_)) => b.next(),
                (_, None) => a.next(),
            };
            let Some(&[low, high]) = next else { return Intervals(all) };
            match all.last_mut() {
                Some(last) if low <= last[1] => last[1] = last[1].max(high),
                _ => all.push([low, high]),
            }
        }
    }

    /// Intersection with other intervals.
    pub fn intersection(&self, other: &Intervals) -> Intervals {
        let (mut i, mut j) = (0, 0);
        let mut both = Vec::new();
        while let (Some(a), Some(b)) = (self.0.get(i), other.0.get(j)) {
            let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
            if low < high {
                both.push([low, high]);
            }
            if a[1] <= b[1] { i += 1 } else { j += 1 }
        }
        Intervals(both)
    }

    /// Difference: these intervals without the others.
    pub fn minus(&self, other: &Intervals) -> Intervals {
        self.intersection(&other.complement())
    }

    /// Complement: the rest of the line.
    pub fn complement(&self) -> Intervals {
        let mut gaps = Vec::with_capacity(self.0.len() + 1);
        let mut low = f64::NEG_INFINITY;
        for interval in &self.0 {
            if low < interval[0] {
                gaps.push([low, interval[0]]);
            }
            low = interval[1];
        }
        if low < f64::INFINITY {
            gaps.push([low, f64::INFINITY]);
        }
        Intervals(gaps)
    }
}

/// The interval in which `start` + t `slope` lies between two values.
pub(crate) fn between(start: f64, slope: f64, low: f64, high: f64) -> Intervals {
    if slope == 0.0 {
        return if low <= start && start <= high { Intervals::whole() } else { Intervals::default() };
    }
    let (a, b) = ((low - start) / slope, (high - start) / slope);
    Intervals::one(a.min(b), a.max(b))
}

/// The intervals in which a t² + 2 b t + c ≤ 0.
pub(super) fn not_positive(a: f64, b: f64, c: f64) -> Intervals {
    if a == 0.0 {
        return between(c, 2.0 * b, f64::NEG_INFINITY, 0.0);
    }
    let discriminant = b * b - a * c;
    if discriminant > 0.0 {
        // First the root that is free of cancellation; the other follows from the product of the roots, c / a.
        let q = -(b + discriminant.sqrt().copysign(b));
        let (s, t) = (q / a, c / q);
        let inner = Intervals::one(s.min(t), s.max(t));
        if a > 0.0 { inner } else { inner.complement() }
    } else if a > 0.0 {
        Intervals::default()
    } else {
        Intervals::whole()
    }
}
