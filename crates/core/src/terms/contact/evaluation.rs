//! The forces between tools and the contact points that touch them, at trial unknowns, with their derivatives.

use rayon::prelude::*;

use super::candidates::{Candidate, OTHER_SIDE, TOUCHING};
use super::counterpart::Counterpart;
use super::facet::{Facing, turned};
use super::interface::{Approach, Law, Multiplier, Touch};
use super::motion::{Moving, in_space};
use crate::assembly::{System, Wanted};
use crate::model::{BodyContact, Model};
use crate::points::PIECE;
use crate::region::vector::{along, cross, dot, minus, norm, unit};
use crate::step::At;
use crate::terms::failure::ContactError;

/// Differences up to this are round-off: of normals, [-], and of gaps relative to coordinates.
const SAME_NORMAL: f64 = 1e-12;

/// A contact point at trial unknowns.
#[derive(Debug, Clone)]
pub(super) struct Trial<const D: usize> {
    /// Position, [length]; the position at the start of the step if the contact point cannot have reached the tool and
    /// no part of the tool can lie within its domain.
    pub(super) position: [f64; D],
    /// Motion relative to the tool since the start of the step, [length]; 0 if `position` is the one at the start.
    pub(super) slip: [f64; D],
    /// The force, if the contact point touches the tool. Most contact points are open.
    pub(super) touch: Option<Box<Touch<D>>>,
    /// True if the contact point has emerged on another side of the tool.
    passes_through: bool,
    /// The facet of another body, if the contact point touches it.
    pub(super) facing: Option<Box<Facing<D>>>,
}

impl<const D: usize> Trial<D> {
    fn open(position: [f64; D], slip: [f64; D]) -> Self {
        Trial { position, slip, touch: None, passes_through: false, facing: None }
    }
}

impl<const D: usize> Trial<D> {
    /// A vector in the frame of what a contact point touches, which moves with it from the start of the step, in global
    /// axes.
    pub(super) fn in_global_axes(
        &self,
        candidate: &Candidate<D>,
        moving: &Moving<D>,
        vector: &[f64; D],
    ) -> [f64; D] {
        match &self.facing {
            Some(facing) => turned(&candidate.near.normal, &facing.normal, vector),
            None => moving.end.vector_to_space(vector),
        }
    }

    /// A vector in global axes in the frame of what a contact point touches.
    pub(super) fn in_frame(
        &self,
        candidate: &Candidate<D>,
        moving: &Moving<D>,
        vector: &[f64; D],
    ) -> [f64; D] {
        match &self.facing {
            Some(facing) => turned(&facing.normal, &candidate.near.normal, vector),
            None => moving.end.vector_to_tool(vector),
        }
    }

    /// The nodes that carry a contact point, with their shares in its motion relative to what it touches, at the last
    /// evaluation.
    pub(super) fn carriers<'a>(
        &'a self,
        candidate: &'a Candidate<D>,
    ) -> impl Iterator<Item = (usize, f64)> + Clone + 'a {
        let now = self.facing.as_deref().map(|facing| &facing.values[..]);
        let now = now.unwrap_or_default();
        candidate
            .basis
            .iter()
            .enumerate()
            .map(move |(k, (node, value))| (node, now.get(k).copied().unwrap_or(value)))
    }
}

/// The unknowns of a step as contact sees them.
pub(super) struct Trials<'a, const D: usize, const N: usize> {
    pub(super) model: &'a Model<D>,
    pub(super) tools: &'a [Moving<D>],
    pub(super) delta_d: &'a [[f64; N]],
    /// The largest displacement of a node, [length].
    pub(super) farthest: f64,
    /// True at the start of the iterations, when no node has moved yet.
    pub(super) at_rest: bool,
    /// For each tool, true if contact points that carried force hold it at the start of the iterations.
    pub(super) kept: &'a [bool],
    /// True if contact points that carry force stick and transfer tension, and all others stay open.
    pub(super) is_frozen: bool,
}

impl<const D: usize, const N: usize> Trials<'_, D, N> {
    /// Evaluates all candidates at these unknowns.
    ///
    /// # Errors
    /// The first contact point that has emerged on another side of a tool.
    pub(super) fn all(
        &self,
        candidates: &[Candidate<D>],
        multipliers: &[Multiplier<D>],
        has_touched: &[bool],
        trials: &mut Vec<Trial<D>>,
    ) -> Result<(), ContactError> {
        let tool_motions: Vec<f64> =
            self.tools.iter().map(|moving| moving.translation().unwrap_or(f64::INFINITY)).collect();
        let trial = |k: usize| {
            let candidate = &candidates[k];
            let motion = candidate.reach * self.farthest + tool_motions[candidate.key.tool as usize];
            if multipliers[k].normal == 0.0 && candidate.is_beyond(motion) {
                return Trial::open(candidate.start, [0.0; D]);
            }
            self.one(candidate, &multipliers[k], has_touched[k])
        };
        let all = (0..candidates.len()).into_par_iter().with_min_len(PIECE);
        all.map(trial).collect_into_vec(trials);
        match trials.iter().position(|trial| trial.passes_through) {
            Some(k) => Err(ContactError::Through { place: candidates[k].place(self.model) }),
            None => Ok(()),
        }
    }

    fn one(&self, candidate: &Candidate<D>, multiplier: &Multiplier<D>, has_touched: bool) -> Trial<D> {
        let tool = match Counterpart::new(self.model, candidate.key.tool) {
            Counterpart::Tool(tool) => tool,
            Counterpart::Bodies(pair) => {
                return self.between_bodies(pair, candidate, multiplier, has_touched);
            }
        };
        let moving = &self.tools[candidate.key.tool as usize];
        let Candidate { start, near, allowance, size, body, .. } = candidate;
        let u = candidate.displacement(self.delta_d);
        let position = along(start, 1.0, &u);
        let slip = minus(&u, &moving.increment.displacement(&moving.start, start));
        let apart = Trial::open(position, slip);
        let loaded = multiplier.normal != 0.0;
        let gap = near.gap + allowance;
        let Some(interface) = tool.interface_with(*body) else { return apart };
        if self.is_frozen && !loaded {
            return apart;
        }
        // The gap cannot shrink by more than the relative motion.
        if !loaded && !self.at_rest && gap > norm(&slip) {
            return apart;
        }
        let normal = moving.end.vector_to_space(&moving.start.vector_to_tool(&near.normal));
        let mut approach = Approach {
            gap: gap + dot(&normal, &slip),
            normal,
            normal_derivative: [[0.0; D]; D],
            slip,
            pressure: multiplier.normal,
            shear: moving.end.vector_to_space(&multiplier.shear),
            at_rest: self.at_rest,
            is_fresh: self.at_rest && !loaded && gap <= TOUCHING * size,
            is_kept: self.is_frozen || self.at_rest && loaded && self.kept[candidate.key.tool as usize],
        };
        // At the start of the iterations the tool has moved and the bodies have not: the surface is extrapolated as a
        // plane, because the contact point may lie beyond the middle of a thin tool. For a plane, this is exact.
        if !self.at_rest && !candidate.is_at_plane() {
            let Some(found) = moving.closest(tool.shape.as_ref(), start, &slip) else { return apart };
            if found.gap < -TOUCHING * size && dot(&found.normal, &normal) < OTHER_SIDE {
                return Trial { passes_through: true, ..apart };
            }
            let gap = found.gap + allowance;
            // On a flat part, the gap from the increments is kept for its precision: the penalty multiplies its
            // round-off.
            let is_flat = found.normal_derivative == [[0.0; D]; D]
                && norm(&minus(&found.normal, &normal)) < SAME_NORMAL
                && (gap - approach.gap).abs() <= SAME_NORMAL * (size + gap.abs() + norm(start));
            if !is_flat {
                approach.gap = gap;
                approach.normal = found.normal;
                approach.normal_derivative = found.normal_derivative;
            }
        }
        let law = Law::new(&interface, candidate.area, candidate.penalty, has_touched);
        let law = Law { held: candidate.held, ..law };
        Trial { touch: Touch::new(approach, law).map(Box::new), ..apart }
    }
}

impl<const D: usize, const N: usize> Trials<'_, D, N> {
    /// A contact point that may touch a facet of another body.
    fn between_bodies(
        &self,
        pair: &BodyContact,
        candidate: &Candidate<D>,
        multiplier: &Multiplier<D>,
        has_touched: bool,
    ) -> Trial<D> {
        let Candidate { start, near, allowance, size, .. } = candidate;
        let slip = candidate.displacement(self.delta_d);
        // The position follows from the shares of the nodes of its own body alone.
        let own = candidate.basis.iter().filter(|(_, value)| *value > 0.0);
        let position = own
            .fold(*start, |x, (node, value)| std::array::from_fn(|d| x[d] + value * self.delta_d[node][d]));
        let apart = Trial::open(position, slip);
        let loaded = multiplier.normal != 0.0;
        let found = candidate
            .facet
            .as_ref()
            .and_then(|facet| facet.facing(&candidate.basis, near, self.delta_d, &slip));
        let found = found.filter(|_| loaded || !self.is_frozen);
        let (Some(facing), Some(interface)) = (found, pair.interface) else { return apart };
        let approach = Approach {
            gap: facing.gap + allowance,
            normal: facing.normal,
            normal_derivative: [[0.0; D]; D],
            slip,
            pressure: multiplier.normal,
            shear: turned(&near.normal, &facing.normal, &multiplier.shear),
            at_rest: self.at_rest,
            is_fresh: self.at_rest && !loaded && near.gap + allowance <= TOUCHING * size,
            is_kept: self.is_frozen,
        };
        let law = Law::new(&interface, candidate.area, candidate.penalty, has_touched);
        let law = Law { held: candidate.held, ..law };
        Trial { touch: Touch::new(approach, law).map(Box::new), facing: Some(Box::new(facing)), ..apart }
    }
}

/// For each tool, the index of its first unknown component among the unknown components of all tools.
pub(super) fn first_unknowns<const D: usize>(tools: &[Moving<D>]) -> Vec<usize> {
    let first = |next: &mut usize, tool: &Moving<D>| {
        let first = *next;
        *next += tool.free.len();
        Some(first)
    };
    tools.iter().scan(0, first).collect()
}

/// Adds the forces at contact points to the nodes and to the tools, with their derivatives if wanted.
pub(super) fn add<const D: usize, const N: usize>(
    tools: &[Moving<D>],
    pairs: &[(&Candidate<D>, &Trial<D>)],
    wanted: Wanted,
    sum: &mut System<N>,
) {
    let first = first_unknowns(tools);
    // Neighbouring contact points often have the same nodes; their blocks are then sought only once.
    let mut last: Option<(&Candidate<D>, Vec<Option<usize>>)> = None;
    for (candidate, trial) in pairs {
        let Some(touch) = &trial.touch else { continue };
        let tool = candidate.key.tool as usize;
        let force = touch.force();
        let round_off = touch.round_off(tools[tool].extent(&candidate.start));
        for (node, value) in trial.carriers(candidate) {
            sum.add_holding(node, &force.map(|f| value * f));
            sum.add_round_off(node, value.abs() * round_off);
        }
        let moving = &tools[tool];
        if wanted == Wanted::Force && moving.free.is_empty() {
            continue;
        }
        if let (Some(facet), Some(facing)) = (&candidate.facet, &trial.facing) {
            facing.add_stiffness(&candidate.basis, facet, touch, &places_of(candidate, sum), sum);
            continue;
        }
        // `[j][i]`: change of the force f_i with the position x_j.
        let by_position: [[f64; D]; D] = std::array::from_fn(|j| touch.change(&unit(j), &unit(j), &[0.0; 3]));
        if wanted == Wanted::Stiffness {
            let known = last.take().filter(|(last, _)| last.basis.has_same_nodes(&candidate.basis));
            let places = known.map_or_else(|| places_of(candidate, sum), |(_, places)| places);
            add_stiffness(candidate, &by_position, &places, sum);
            last = Some((candidate, places));
        }
        Balance { moving, first: first[tool], candidate, trial, force, by_position }.add(touch, sum);
    }
}

/// Adds the stiffness of the cell below to a contact point, along the surface with this normal.
pub(super) fn support<const D: usize, const N: usize>(
    candidate: &Candidate<D>,
    normal: &[f64; D],
    sum: &mut System<N>,
) {
    let by_position: [[f64; D]; D] = std::array::from_fn(|j| {
        let e: [f64; D] = unit(j);
        along(&e, -normal[j], normal).map(|e| -candidate.stiffness * e)
    });
    add_stiffness(candidate, &by_position, &places_of(candidate, sum), sum);
}

/// The indices, in the system, of the blocks for the node pairs of a candidate, row by row; a symmetric system stores
/// the lower triangle only.
fn places_of<const D: usize, const N: usize>(
    candidate: &Candidate<D>,
    sum: &System<N>,
) -> Vec<Option<usize>> {
    let nodes = || candidate.basis.iter().map(|(node, _)| node);
    nodes().flat_map(|row| nodes().map(move |column| sum.place(row, column))).collect()
}

/// Adds −N_v N_w ∂f/∂x to the blocks of the nodes.
fn add_stiffness<const D: usize, const N: usize>(
    candidate: &Candidate<D>,
    by_position: &[[f64; D]; D],
    places: &[Option<usize>],
    sum: &mut System<N>,
) {
    let values = || candidate.basis.iter().map(|(_, value)| value);
    let pairs = values().flat_map(|row| values().map(move |column| row * column));
    for (product, place) in pairs.zip(places) {
        if let Some(place) = *place {
            let block: [[f64; D]; D] =
                std::array::from_fn(|i| std::array::from_fn(|j| -product * by_position[j][i]));
            sum.add_displacement_block(place, &block);
        }
    }
}

/// The contribution of one contact point to the equilibrium of its tool.
struct Balance<'a, const D: usize> {
    moving: &'a Moving<D>,
    /// The first free component among the global unknowns.
    first: usize,
    candidate: &'a Candidate<D>,
    trial: &'a Trial<D>,
    force: [f64; D],
    by_position: [[f64; D]; D],
}

impl<const D: usize> Balance<'_, D> {
    fn component(&self, k: usize, force: &[f64; D]) -> f64 {
        self.moving.component(k, &self.trial.position, force)
    }

    fn add<const N: usize>(&self, touch: &Touch<D>, sum: &mut System<N>) {
        let Balance { moving, first, candidate, trial, force, by_position } = self;
        let (x, carried) = (&trial.position, minus(&trial.position, &trial.slip));
        let arm = norm(&minus(x, &moving.end.position()));
        let nodes = || candidate.basis.iter();
        for (j, &k) in moving.free.iter().enumerate() {
            if !moving.follows[j] {
                let size = norm(force) * if k < D { 1.0 } else { arm };
                sum.border.add_residual(first + j, self.component(k, force), size);
                let round_off = touch.round_off(moving.extent(&candidate.start));
                sum.border.add_round_off(first + j, round_off * if k < D { 1.0 } else { arm });
            }
            // Column: the tool moves.
            let (at_place, rate) = moving.velocity(k, x);
            let (at_start, _) = moving.velocity(k, &carried);
            let change = touch.change(&at_place.map(|v| -v), &at_start.map(|v| -v), &rate);
            for (node, value) in nodes() {
                (0..D).for_each(|d| sum.border.add_to_column(first + j, node, d, -value * change[d]));
            }
            for (i, &row) in moving.free.iter().enumerate().filter(|(i, _)| !moving.follows[*i]) {
                let mut corner = self.component(row, &change);
                if row >= D && k < D {
                    // The reference point moves.
                    corner -= cross(&in_space(&unit::<D>(k)), &in_space(force))[row - D];
                }
                sum.border.add_to_corner(first + i, first + j, corner);
            }
            if moving.follows[j] {
                continue;
            }
            // Row: the contact point moves.
            for d in 0..D {
                let mut change = self.component(k, &by_position[d]);
                if k >= D {
                    change += cross(&in_space(&unit::<D>(d)), &in_space(force))[k - D];
                }
                for (node, value) in nodes() {
                    sum.border.add_to_row(first + j, node, d, value * change);
                }
            }
        }
    }
}

/// Adds the loads on free tools to their equilibrium, and the equations for tools that follow the load factor.
/// `end` is the end of the step, and `globals` are the increments of the global unknowns of the tools. `counts` is true
/// where the equations of global unknowns count; these loads and equations are added only there.
pub(super) fn add_loads<const D: usize, const N: usize>(
    model: &Model<D>,
    moving: &[Moving<D>],
    end: f64,
    At { factor, globals, .. }: At<N>,
    counts: bool,
    sum: &mut System<N>,
) {
    let stepping = &model.stepping;
    let mut number = 0;
    for (tool, moving) in model.tools.iter().zip(moving) {
        let component =
            |k: usize, (force, moment): ([f64; D], [f64; 3])| if k < D { force[k] } else { moment[k - D] };
        for (&k, &follows) in moving.free.iter().zip(&moving.follows) {
            if !follows {
                sum.border.count_as_work(number);
            }
            if !counts {
                number += 1;
                continue;
            }
            if follows {
                let [by, per_factor, size] = moving.driven(tool, k, stepping, [end, factor]);
                let increment = globals.get(number).copied().unwrap_or(0.0);
                sum.border.add_residual(number, increment - by, size.max(increment.abs()));
                sum.border.add_to_corner(number, number, 1.0);
                sum.border.add_per_factor(number, -per_factor);
            } else {
                let load = component(k, tool.load_at(|curve| curve.factor_of_tool(stepping, end, factor)));
                let per_factor = component(k, tool.load_at(|curve| curve.factor_per_unknown(stepping)));
                sum.border.add_residual(number, -load, load.abs());
                sum.border.add_per_factor(number, -per_factor);
            }
            number += 1;
        }
    }
}
