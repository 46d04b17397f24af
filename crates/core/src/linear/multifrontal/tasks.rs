//! The division of the work and of its working space between threads: the tree of the fronts is cut into tasks that
//! threads can share, and every front gets a part of the working space of its task.

use std::ops::Range;

use super::fronts::{Front, Fronts};
use super::nodes::NONE;

/// A part of the tree is a separate task if it takes longer than this time, [ns], which is much longer than the time
/// needed to wake a thread.
const LEAST: f64 = 60e3;

/// Tasks may run at the same time if their working spaces together hold at most this number of values.
const LITTLE: usize = 1 << 19;

/// Above [`LITTLE`], tasks may still run at the same time if their working spaces together are at most this fraction of
/// the part of the factor that the enclosing task computes, [-].
const SPARE: f64 = 0.2;

/// Greatest depth to which tasks are nested.
const DEEPEST: usize = 12;

/// Part of the tree: first tasks that are independent of each other, then fronts that are processed one after another.
#[derive(Debug, Default)]
pub(super) struct Task {
    /// All fronts of this task, including those of the tasks within.
    pub fronts: Range<usize>,
    /// The tasks that are completed first.
    pub within: Vec<Task>,
    /// The fronts that belong to none of the tasks within.
    pub own: Vec<Range<usize>>,
    /// True if the tasks within may run at the same time; each then has its own working space.
    pub apart: bool,
    /// Start of its working space within the working space of the enclosing task.
    pub base: usize,
    /// Number of values in its working space, including the working space of the tasks within.
    pub room: usize,
}

impl Task {
    /// Divides all fronts into tasks and gives each front its part of the working space.
    pub fn new(fronts: &mut Fronts) -> Task {
        let n = fronts.front.len();
        let mut roots: Vec<usize> = (0..n).filter(|&f| fronts.front[f].parent == NONE).collect();
        // The front of the kept unknowns comes after all others.
        if let Some(kept) = roots.pop_if(|f| fronts.is_kept(&fronts.front[*f])) {
            roots.extend(children(fronts, kept));
            roots.sort_unstable();
        }
        let mut task = divide(fronts, 0..n, roots, DEEPEST);
        plan(&mut task, fronts);
        task
    }
}

fn children(fronts: &Fronts, f: usize) -> Vec<usize> {
    fronts.children[fronts.front[f].children.clone()].iter().map(|&child| child as usize).collect()
}

/// A task for a range of fronts; the tasks within it are found at and below the fronts `tops`.
fn divide(fronts: &Fronts, range: Range<usize>, mut tops: Vec<usize>, depth: usize) -> Task {
    let mut within: Vec<Task> = Vec::new();
    let heavy = |f: &usize| depth > 0 && fronts.front[*f].cost > LEAST;
    tops.retain(heavy);
    while let [only] = tops[..] {
        tops = children(fronts, only);
        tops.retain(heavy);
    }
    for f in tops {
        within.push(divide(fronts, fronts.front[f].descendants..f + 1, children(fronts, f), depth - 1));
    }
    let mut own = Vec::new();
    let mut next = range.start;
    for task in &within {
        own.push(next..task.fronts.start);
        next = task.fronts.end;
    }
    own.push(next..range.end);
    Task { fronts: range, within, own, ..Task::default() }
}

/// Gives the fronts of a task their parts of its working space. When a task ends, the data that it passes on are at the
/// start of this space.
fn plan(task: &mut Task, fronts: &mut Fronts) {
    for within in &mut task.within {
        plan(within, fronts);
    }
    let apart: usize = task.within.iter().map(|within| within.room).sum();
    let panels: usize = fronts.front[task.fronts.clone()].iter().map(Front::panel_len).sum();
    task.apart = apart <= LITTLE.max((panels as f64 * SPARE) as usize);
    // Ranges in use: start and length, sorted by start.
    let mut used = Vec::new();
    let mut base = 0;
    for within in &mut task.within {
        within.base = base;
        task.room = task.room.max(base + within.room);
        let top = &mut fronts.front[within.fronts.end - 1];
        top.passed = base;
        if top.update_len() > 0 {
            used.push((base, top.update_len()));
        }
        base += if task.apart { within.room } else { top.update_len() };
    }
    for f in task.own.iter().cloned().flatten() {
        let len = fronts.front[f].update_len();
        let mut place = 0;
        // The update of an only child of the front of the kept unknowns remains in place.
        let only_child = if fronts.is_kept(&fronts.front[f]) { fronts.before_kept() } else { None };
        if let Some(child) = only_child {
            place = child.passed;
        } else if len > 0 {
            let mut at = 0;
            while at < used.len() && used[at].0 < place + len {
                place = used[at].0 + used[at].1;
                at += 1;
            }
            used.insert(at, (place, len));
            task.room = task.room.max(place + len);
        }
        let front = &mut fronts.front[f];
        (front.update, front.passed) = (place, place);
        let children = front.children.clone();
        for &child in &fronts.children[children] {
            let child = &fronts.front[child as usize];
            used.retain(|u| *u != (child.passed, child.update_len()));
        }
    }
}
