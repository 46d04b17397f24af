//! `refine` of a structured grid: cells that shrink towards given places, as intervals of a graded grid.

use crate::refined_place::{RefineDeck, RefinedAt};
use crate::{AxisSpacing, GridDeck, IntervalDeck, SpacingDeck, Unrefined};

/// Ratio of the sizes of neighbouring cells where they grow, [-]; it is adapted so that whole cells fill the length.
const RATIO: f64 = 1.2;
/// Distance to an end of the grid, or to another place, below which places coincide, relative to the finest cell, [-].
const SAME: f64 = 1e-6;
/// Smallest cells at a place, relative to the spacing, [-].
const SMALLEST: f64 = 1e-3;

/// A coordinate along an axis, with the size of the cells beside it, [length].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    at: f64,
    size: f64,
}

/// A fault of `refine`: its pointer below the grid, what is wrong, and the remedy.
pub(crate) struct RefineFault {
    pub(crate) pointer: String,
    pub(crate) message: String,
    pub(crate) help: String,
}

impl GridDeck {
    /// Replaces `spacing` and `refine` by the intervals that they mean, unless `refine` has faults.
    pub(crate) fn apply_refinement(&mut self, dimensions: usize) {
        if !self.refinement_faults(dimensions).is_empty() {
            return;
        }
        let GridDeck::Structured { origin, size, spacing, refine, unrefined, .. } = self else { return };
        if refine.is_empty() || refine.iter().any(|place| place.to.is_nan() || place.to <= 0.0) {
            return;
        }
        // Other checks report these.
        if [origin.len(), size.len(), spacing.entries(dimensions).len()] != [dimensions; 3] {
            return;
        }
        let stated = Unrefined { spacing: spacing.clone(), places: std::mem::take(refine) };
        let refined = |(axis, entry): (usize, AxisSpacing)| match entry {
            AxisSpacing::Even(side) => {
                let places = places(&stated.places, axis, side);
                match places.is_empty() {
                    true => AxisSpacing::Even(side),
                    false => AxisSpacing::Intervals(intervals([origin[axis], size[axis]], side, places)),
                }
            }
            graded => graded,
        };
        let entries = stated.spacing.entries(dimensions).into_iter().enumerate();
        *spacing = SpacingDeck::Each(entries.map(refined).collect());
        *unrefined = Some(stated);
    }

    /// The faults of `refine`.
    pub(crate) fn refinement_faults(&self, dimensions: usize) -> Vec<RefineFault> {
        let GridDeck::Structured { origin, size, spacing, refine, .. } = self else { return Vec::new() };
        if [origin.len(), size.len(), spacing.entries(dimensions).len()] != [dimensions; 3] {
            return Vec::new(); // These are faults themselves.
        }
        let entries = spacing.entries(dimensions);
        let mut faults = Vec::new();
        for (number, RefineDeck { at, to }) in refine.iter().enumerate() {
            let mut fault = |place: &str, message: String, help: &str| {
                let pointer = format!("/grid/refine/{number}/{place}");
                faults.push(RefineFault { pointer, message, help: help.to_owned() });
            };
            if let RefinedAt::Point(x) = at
                && x.len() != dimensions
            {
                let message =
                    format!("a place needs {dimensions} coordinates, one per axis, not {}", x.len());
                fault("at", message, "give one coordinate per axis, or some as `{x: 1}`");
                continue;
            }
            // The schema demands a size above 0.
            if at.coordinates().iter().flatten().next().is_some() && *to > 0.0 {
                let even = entries.iter().filter_map(|entry| match entry {
                    AxisSpacing::Even(side) => Some(*side),
                    AxisSpacing::Intervals(_) => None,
                });
                let coarsest = even.fold(0.0, f64::max);
                if *to < SMALLEST * coarsest {
                    let message =
                        format!("cells of {to} are less than a thousandth of the spacing {coarsest}");
                    fault("to", message, "give a larger size, or a smaller spacing");
                    continue;
                }
            }
            for (axis, coordinate) in at.coordinates().into_iter().enumerate() {
                let Some(coordinate) = coordinate else { continue };
                if axis >= dimensions {
                    let message = "the axis `z` exists only in space".to_owned();
                    fault(&at.pointer(axis), message, "leave `z` out");
                    continue;
                }
                let name = crate::AXES[axis];
                let end = origin[axis] + size[axis];
                if !(origin[axis]..=end).contains(&coordinate) {
                    let from = origin[axis];
                    let message = format!(
                        "{name} = {coordinate} lies outside the grid, which extends from {from} to {end}"
                    );
                    fault(&at.pointer(axis), message, "give a coordinate inside the grid");
                }
                match entries[axis] {
                    AxisSpacing::Even(side) if *to > side * (1.0 + SAME) => {
                        let message =
                            format!("cells of {to} are larger than the spacing {side} along {name}");
                        fault("to", message, "give a smaller size, or leave the place out");
                    }
                    AxisSpacing::Intervals(_) => {
                        let message = format!("the spacing along {name} is already a list of intervals");
                        fault(
                            &at.pointer(axis),
                            message,
                            "give `spacing` as a number, or leave this axis out: `at: {x: 1}`",
                        );
                    }
                    AxisSpacing::Even(_) => {}
                }
            }
        }
        faults
    }
}

/// The places along an axis, ascending; of places that coincide, the finest counts.
fn places(refine: &[RefineDeck], axis: usize, side: f64) -> Vec<Place> {
    // Cells of about the usual size need no place.
    let is_finer = |refine: &&RefineDeck| refine.to < side * (1.0 - SAME);
    let along = |refine: &RefineDeck| refine.at.coordinates()[axis].map(|at| Place { at, size: refine.to });
    let mut found: Vec<Place> = refine.iter().filter(is_finer).filter_map(along).collect();
    found.sort_by(|a, b| a.at.total_cmp(&b.at));
    found.dedup_by(|later, kept| {
        let coincide = later.at - kept.at <= SAME * kept.size.min(side);
        if coincide {
            kept.size = kept.size.min(later.size);
        }
        coincide
    });
    found
}

/// Intervals of an axis that begins at `origin`, is `length` long and has cells of `side` far from the places.
fn intervals([origin, length]: [f64; 2], side: f64, mut places: Vec<Place>) -> Vec<IntervalDeck> {
    let end = origin + length;
    let coarse = |at: f64| Place { at, size: side };
    let is_at = |place: Option<&Place>, at: f64| {
        place.is_some_and(|place| (place.at - at).abs() <= SAME * place.size)
    };
    if !is_at(places.first(), origin) {
        places.insert(0, coarse(origin));
    }
    if !is_at(places.last(), end) {
        places.push(coarse(end));
    }
    let mut all = Vec::new();
    for pair in places.windows(2) {
        let [left, right] = [pair[0], pair[1]];
        match (left.size < side, right.size < side) {
            (false, false) => all.push(even(left.at, right.at, side)),
            (true, false) => all.extend(growing(left, right.at, side)),
            (false, true) => all.extend(mirrored(growing(mirror(right), -left.at, side), -right.at)),
            (true, true) => {
                // Sizes grow by about 0.2 of the distance, so that they are alike where they meet.
                let (length, more) = (right.at - left.at, (right.size - left.size) / (RATIO - 1.0));
                let middle = left.at + (0.5 * (length + more)).clamp(0.1 * length, 0.9 * length);
                all.extend(growing(left, middle, side));
                all.extend(mirrored(growing(mirror(right), -middle, side), -right.at));
            }
        }
    }
    all
}

/// Cells of equal size, about `side` long.
fn even(from: f64, to: f64, side: f64) -> IntervalDeck {
    IntervalDeck { to, cells: ((to - from) / side).round().max(1.0) as u32, ratio: 1.0 }
}

/// Cells that grow from a place up to a coordinate above it, and stay alike once they are about `side` long.
fn growing(from: Place, to: f64, side: f64) -> Vec<IntervalDeck> {
    let length = to - from.at;
    // Length of cells that grow by a ratio, of which some more are as long as the one that would follow.
    let reach = |ratio: f64, grown: i32, alike: f64| {
        let sizes = (0..grown).map(|k| from.size * ratio.powi(k)).sum::<f64>();
        sizes + alike * from.size * ratio.powi(grown)
    };
    let most = ((side / from.size).ln() / RATIO.ln()).ceil().max(1.0) as i32;
    let usual = (side / from.size).powf(1.0 / f64::from(most));
    let rest = (length - reach(usual, most, 0.0)) / side;
    let (grown, alike) = if rest >= 0.5 {
        (most, rest.round())
    } else {
        // The cells do not reach the full size: as many as come closest to filling the length.
        let misfit = |grown: &i32| (reach(RATIO, *grown, 0.0) / length).ln().abs();
        let best = (1..=most + 1).min_by(|a, b| misfit(a).total_cmp(&misfit(b)));
        (best.unwrap_or(1), 0.0)
    };
    // The ratio for which the cells fill the length.
    let [mut low, mut high] = [0.1, 4.0];
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if reach(middle, grown, alike) < length { low = middle } else { high = middle }
    }
    let ratio = 0.5 * (low + high);
    if alike == 0.0 {
        return vec![IntervalDeck { to, cells: grown as u32, ratio }];
    }
    let end = from.at + reach(ratio, grown, 0.0);
    vec![
        IntervalDeck { to: end, cells: grown as u32, ratio },
        IntervalDeck { to, cells: alike as u32, ratio: 1.0 },
    ]
}

fn mirror(place: Place) -> Place {
    Place { at: -place.at, ..place }
}

/// Intervals of the mirrored axis, which begin at `begin`, from its other end.
fn mirrored(intervals: Vec<IntervalDeck>, begin: f64) -> Vec<IntervalDeck> {
    let mut ends: Vec<f64> = intervals.iter().map(|interval| -interval.to).collect();
    // The interval that ends last on the mirrored axis begins first here; each ends where the one before it began there.
    ends.insert(0, -begin);
    let ends = ends.into_iter().take(intervals.len());
    let turned = intervals.iter().zip(ends);
    let mut all: Vec<_> =
        turned.map(|(of, to)| IntervalDeck { to, cells: of.cells, ratio: 1.0 / of.ratio }).collect();
    all.reverse();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refined_place::AlongAxes;

    fn along_x(x: f64) -> RefinedAt {
        RefinedAt::Along(AlongAxes { x: Some(x), ..AlongAxes::default() })
    }

    /// The lines of an axis from 0 to `length` with cells of 0.5.
    fn lines(length: f64, places: &[[f64; 2]]) -> Vec<f64> {
        let refine: Vec<_> = places.iter().map(|[at, to]| RefineDeck { at: along_x(*at), to: *to }).collect();
        let mut grid = GridDeck::Structured {
            origin: vec![0.0, 0.0],
            size: vec![length, 2.0],
            spacing: SpacingDeck::Same(0.5),
            follow: Vec::new(),
            unrefined: None,
            refine,
        };
        assert!(grid.refinement_faults(2).is_empty());
        grid.apply_refinement(2);
        let GridDeck::Structured { spacing, .. } = &grid else { panic!("structured") };
        let entries = spacing.entries(2);
        assert_eq!(entries[1], AxisSpacing::Even(0.5));
        let axis = entries[0].axis(0.0, length).unwrap();
        (0..=axis.n_cells()).map(|line| axis.line(line)).collect()
    }

    #[test]
    fn cells_shrink_towards_places_and_stay_regular() {
        let cases: [(f64, &[[f64; 2]]); 6] = [
            (10.0, &[[1.0, 0.05]]),
            (10.0, &[[0.0, 0.05]]),
            (10.0, &[[10.0, 0.1]]),
            (10.0, &[[4.0, 0.05], [5.0, 0.1]]),
            (10.0, &[[2.0, 0.01], [8.0, 0.2], [8.0, 0.3]]),
            (1.0, &[[0.5, 0.02]]),
        ];
        for (length, places) in cases {
            let lines = lines(length, places);
            let sizes: Vec<f64> = lines.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert_eq!((lines[0], *lines.last().unwrap()), (0.0, length));
            assert!(sizes.iter().all(|size| *size > 0.0 && *size < 0.5 * 1.3), "{places:?} {sizes:?}");
            for pair in sizes.windows(2) {
                let ratio = (pair[0] / pair[1]).max(pair[1] / pair[0]);
                assert!(ratio < 1.45, "{places:?} {ratio} {sizes:?}");
            }
            for [at, to] in places {
                let near = |line: &&f64| (*line - at).abs() < 1e-9;
                assert!(lines.iter().any(|line| near(&line)), "{places:?} {lines:?}");
                let index = lines.iter().position(|line| near(&line)).unwrap();
                let beside = sizes.get(index).or(sizes.last()).unwrap();
                assert!((beside / to - 1.0).abs() < 0.3 || *to == 0.3, "{at} {to} {beside}");
            }
        }
    }

    #[test]
    fn faults_are_located() {
        let grid = |at: RefinedAt, to: f64, spacing: SpacingDeck| GridDeck::Structured {
            origin: vec![0.0, 0.0],
            size: vec![4.0, 4.0],
            spacing,
            follow: Vec::new(),
            unrefined: None,
            refine: vec![RefineDeck { at, to }],
        };
        let fault = |grid: GridDeck| grid.refinement_faults(2).pop().map(|fault| fault.pointer);
        let even = || SpacingDeck::Same(0.5);
        assert_eq!(
            fault(grid(RefinedAt::Point(vec![1.0]), 0.1, even())),
            Some("/grid/refine/0/at".to_owned())
        );
        assert_eq!(
            fault(grid(RefinedAt::Point(vec![1.0, 5.0]), 0.1, even())),
            Some("/grid/refine/0/at/1".to_owned())
        );
        assert_eq!(fault(grid(along_x(1.0), 0.6, even())), Some("/grid/refine/0/to".to_owned()));
        assert_eq!(fault(grid(along_x(1.0), 0.5, even())), None);
        let list = vec![IntervalDeck { to: 4.0, cells: 8, ratio: 1.0 }];
        let graded = SpacingDeck::Each(vec![AxisSpacing::Intervals(list), AxisSpacing::Even(0.5)]);
        assert_eq!(fault(grid(along_x(1.0), 0.1, graded)), Some("/grid/refine/0/at/x".to_owned()));
        assert_eq!(fault(grid(along_x(1.0), 0.1, even())), None);
    }
}
