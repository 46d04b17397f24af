//! Bodies that a stage adds above others, whose surfaces have moved since they were drawn: they are placed onto the
//! current surface, or their distance from it is measured.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::basis::Method;
use crate::model::{Lift, Model};
use crate::points::{Displaced, Points, coordinates};
use crate::quality::{Code, Location, Warning};
use crate::region::vector::{along, dot, minus, norm};

/// Largest gap or overlap between an added body and the ground below it that causes no warning, in cells, [-].
const MAX_GAP: f64 = 0.05;
/// Largest original distance at which a body counts as drawn on the ground, in cells, [-].
const ON_GROUND: f64 = 2.0;
/// Distance from the surface of the ground within which its points matter, in cells, [-].
const NEAR: f64 = 3.0;
/// Columns whose horizontal positions agree to within this many cells are one column, [-].
const SAME: f64 = 1e-6;
/// Distance, in cells, below which a gap is round-off, [-].
const ROUND_OFF: f64 = 1e-9;
/// Number of iterations for the part of the original surface that has moved into a column.
const ROUNDS: usize = 5;

/// A body that a stage has placed onto the current surface of another one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Placed {
    /// Name of the stage.
    pub stage: String,
    /// Name of the body.
    pub body: String,
    /// Name of the body on which it stands.
    pub onto: String,
    /// Smallest, mean and largest upward motion of its columns from where it was drawn, [length].
    pub moved: [f64; 3],
    /// Volume of the body, [volume]; the motion of columns does not change it.
    pub volume: f64,
}

/// Moves the points to be added whose bodies a stage places onto others. Returns what was moved, and a warning for each
/// body that stands above or below the current surface of the ground; `step` is the first step of the stage. All ranks
/// must call this together.
pub(super) fn place_lifts<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    added: &mut Points<D>,
    stage: usize,
    step: usize,
) -> (Vec<Placed>, Vec<Warning>) {
    let Some(stage) = model.stages.get(stage) else { return Default::default() };
    let lifts = &stage.lifts;
    let (mut placed, mut warnings) = (Vec::new(), Vec::new());
    for lift in lifts.iter().filter(|lift| lift.is_placed) {
        let columns = Columns::new(model, lift, &[points, &*added]);
        let known = columns.known(added);
        let moved = place(&columns, &known, added);
        let [body, onto] = [lift.body, lift.ground].map(|body| model.bodies[body].name.clone());
        let volume = volume_of(added, lift.body);
        placed.push(Placed { stage: stage.name.clone(), body, onto, moved, volume });
    }
    for lift in lifts.iter().filter(|lift| !lift.is_placed) {
        let rivals: Vec<&Lift<D>> =
            lifts.iter().filter(|other| other.body == lift.body && other.ground != lift.ground).collect();
        let gap = Columns::new(model, lift, &[points, &*added]).largest_gap(added, &rivals);
        let gap = gap.filter(|(gap, _)| gap.abs() > MAX_GAP * lift.cell);
        warnings.extend(gap.map(|(gap, place)| warn(model, lift, gap, &place, step)));
    }
    (placed, warnings)
}

/// The points that a stage adds, where it places them above the current positions of other points. All ranks must call
/// this together.
pub fn added_points<const D: usize>(model: &Model<D>, points: &Points<D>, stage: usize) -> Points<D> {
    let mut added = model.stages[stage].added.clone();
    place_lifts(model, points, &mut added, stage, 0);
    added
}

/// Moves each point of a lift by the shift of its column; returns the smallest, mean and largest shift, [length]. All
/// ranks must call this together.
fn place<const D: usize>(columns: &Columns<D>, known: &Known<D>, added: &mut Points<D>) -> [f64; 3] {
    let lift = columns.lift;
    let [mut low, mut high, mut moment] = [f64::INFINITY, f64::NEG_INFINITY, 0.0];
    for p in 0..added.len() {
        if usize::from(added.body[p]) != lift.body {
            continue;
        }
        let shifts: Vec<f64> =
            columns.places(added, p).iter().map(|x| 0.0 - columns.gap_of_nearest(known, x)).collect();
        let shift = shifts.iter().sum::<f64>() / shifts.len() as f64;
        let upward = |by: f64| lift.up.map(|up| by * up);
        let corners = added.corner_range(p).len();
        let of_corner = |k: usize| if shifts.len() == corners { shifts[k] } else { shift };
        let of_corners: Vec<[f64; D]> = (0..corners).map(|k| upward(of_corner(k))).collect();
        added.shift(p, &upward(shift), &of_corners);
        (low, high) = (low.min(shift), high.max(shift));
        moment += shift * added.original_volume[p];
    }
    let ranks = &added.ranks;
    [ranks.smallest(low), ranks.total(moment) / volume_of(added, lift.body), ranks.largest(high)]
}

/// Volume of a body to be added, [volume].
fn volume_of<const D: usize>(added: &Points<D>, body: usize) -> f64 {
    let own = (0..added.len()).filter(|&p| usize::from(added.body[p]) == body);
    added.ranks.total(own.map(|p| added.original_volume[p]).sum())
}

/// The gaps of columns, by key, in ascending order of the keys.
type Known<const D: usize> = Vec<([i64; D], f64)>;

/// The columns of a lift along `up`, each with the current height of the ground.
struct Columns<'a, const D: usize> {
    lift: &'a Lift<D>,
    ground: Displaced<D>,
    /// True if the corners of the domains of the lift move with the grid, so that each has a column of its own.
    has_corners: bool,
}

impl<'a, const D: usize> Columns<'a, D> {
    fn new(model: &Model<D>, lift: &'a Lift<D>, sets: &[&Points<D>]) -> Self {
        let is_near = |x: &[f64; D]| {
            let height = lift.upper.nearest(x).map(|on| norm(&minus(&on, x)));
            height.is_some_and(|height| height <= NEAR * lift.cell)
        };
        let has_corners = model.bodies[lift.body].method == Method::Cpdi2;
        Columns { lift, ground: Displaced::gathered(sets, lift.ground, lift.cell, is_near), has_corners }
    }

    /// The original positions of a point of the lift that have columns of their own: its corners, or its position.
    fn places<'b>(&self, added: &'b Points<D>, p: usize) -> &'b [[f64; D]] {
        if self.has_corners {
            &added.original_corners[added.corner_range(p)]
        } else {
            std::slice::from_ref(&added.original_position[p])
        }
    }

    /// The horizontal part of a vector.
    fn across(&self, x: &[f64; D]) -> [f64; D] {
        along(x, -dot(x, &self.lift.up), &self.lift.up)
    }

    /// Columns with the same key have the same horizontal position.
    fn key(&self, x: &[f64; D]) -> [i64; D] {
        self.across(x).map(|x| (x / (SAME * self.lift.cell)).round() as i64)
    }

    /// The distance from the current surface of the ground up to the original lower side of the body in a column,
    /// [length]; `None` where one of them is missing.
    fn gap(&self, x: &[f64; D]) -> Option<f64> {
        let foot = self.lift.lower.below(x)?;
        let mut moved = [0.0; D];
        let mut now = None;
        for _ in 0..ROUNDS {
            // The part of the original surface that is now in this column.
            let from = minus(&foot, &self.across(&moved));
            let Some(on) = self.lift.upper.nearest(&from) else { break };
            let Some(position) = self.ground.position(&on) else { break };
            moved = minus(&position, &on);
            now = Some(position);
        }
        let gap = dot(&minus(&foot, &now?), &self.lift.up);
        // Ground that has not moved leaves the body exactly where it was drawn.
        Some(if gap.abs() <= ROUND_OFF * self.lift.cell { 0.0 } else { gap })
    }

    /// The gaps of the columns of the lift that have ground below them. All ranks must call this together; all get all
    /// columns.
    fn known(&self, added: &Points<D>) -> Known<D> {
        let mut gaps = BTreeMap::new();
        for p in (0..added.len()).filter(|&p| usize::from(added.body[p]) == self.lift.body) {
            for x in self.places(added, p) {
                gaps.entry(self.key(x)).or_insert_with(|| self.gap(x));
            }
        }
        let own = gaps.into_iter().filter_map(|(key, gap)| Some((key.to_vec(), gap?))).collect();
        let all = added.ranks.join::<(Vec<i64>, f64)>(own).into_iter();
        let mut known: Known<D> =
            all.map(|(key, gap)| (std::array::from_fn(|d| key.get(d).copied().unwrap_or(0)), gap)).collect();
        known.sort_by_key(|a| a.0);
        known.dedup_by_key(|(key, _)| *key);
        known
    }

    /// The gap of the column of a position or, if it has no ground below it, of the nearest column that has some; 0
    /// without any.
    fn gap_of_nearest(&self, known: &Known<D>, x: &[f64; D]) -> f64 {
        let key = self.key(x);
        if let Ok(place) = known.binary_search_by_key(&key, |(key, _)| *key) {
            return known[place].1;
        }
        let away = |other: &[i64; D]| (0..D).map(|d| (other[d] - key[d]) as f64).map(|x| x * x).sum::<f64>();
        let nearest = known.iter().min_by(|a, b| away(&a.0).total_cmp(&away(&b.0)));
        nearest.map_or(0.0, |(_, gap)| *gap)
    }

    /// The gap of largest magnitude, negative for an overlap, and its position on the ground, of the columns in which
    /// the body was drawn on this ground and not on one of its `rivals`; `None` without such columns. All ranks must
    /// call this together.
    fn largest_gap(&self, added: &Points<D>, rivals: &[&Lift<D>]) -> Option<(f64, [f64; D])> {
        let mut largest: Option<(f64, Vec<f64>)> = None;
        let mut done = BTreeSet::new();
        for p in (0..added.len()).filter(|&p| usize::from(added.body[p]) == self.lift.body) {
            let x = &added.original_position[p];
            if !done.insert(self.key(x)) {
                continue;
            }
            let Some(drawn) = self.lift.original_gap(x).map(f64::abs) else { continue };
            let is_nearer = |rival: &&Lift<D>| rival.original_gap(x).is_some_and(|gap| gap.abs() < drawn);
            if drawn > ON_GROUND * self.lift.cell || rivals.iter().any(is_nearer) {
                continue;
            }
            let (Some(gap), Some(foot)) = (self.gap(x), self.lift.lower.below(x)) else { continue };
            let shift = dot(&minus(&added.converged.position[p], x), &self.lift.up);
            if largest.as_ref().is_none_or(|(most, _)| (gap + shift).abs() > most.abs()) {
                largest = Some((gap + shift, along(&foot, -gap, &self.lift.up).to_vec()));
            }
        }
        let all = added.ranks.gather_all(largest).into_iter().flatten();
        let (gap, place) = all.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))?;
        Some((gap, std::array::from_fn(|d| place.get(d).copied().unwrap_or(0.0))))
    }
}

fn warn<const D: usize>(
    model: &Model<D>,
    lift: &Lift<D>,
    gap: f64,
    place: &[f64; D],
    step: usize,
) -> Warning {
    let names = [lift.body, lift.ground].map(|body| model.bodies[body].name.clone());
    let [body, ground] = &names;
    let share = gap.abs() / lift.cell;
    let how = if gap > 0.0 { "above" } else { "below" };
    Warning {
        code: Code::OffGround,
        step,
        message: format!(
            "body `{body}` is added where it was drawn, up to {:.4} {how} the current surface of `{ground}` at {}: {:.0} % \
             of a cell",
            gap.abs(),
            coordinates(place),
            100.0 * share
        ),
        location: Location { bodies: names.to_vec(), position: Some(place.to_vec()), ..Location::default() },
        value: Some(share),
        threshold: Some(MAX_GAP),
        detail: None,
    }
}
