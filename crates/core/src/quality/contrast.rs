//! Soft bodies that a much stiffer body stiffens: where domains of the stiff body reach into a row of cells, the whole
//! row moves with the stiff body.

use std::collections::{BTreeMap, HashMap};

use super::gaps::shared_nodes;
use super::warning::{Code, Location, Warning};
use crate::basis::Connectivity;
use crate::material::axial_modulus_at_rest;
use crate::model::Model;
use crate::points::{Points, coordinates};

/// Bodies are examined if their moduli differ by more than this factor, [-].
const CONTRAST: f64 = 20.0;
/// A body holds a node if its stiffness there exceeds the stiffness of a softer body by this factor, [-].
const HOLDS: f64 = 3.0;
/// Largest share of the stress of a soft body, measured as energy, that points unable to strain may carry without a
/// warning, [-].
const MAX_STIFFENED: f64 = 0.1;

/// Stiffness Σ |∇S_vp|² V_p M_p of every body at each shared node.
type Stiffness = Vec<Vec<(u16, f64)>>;

/// The points of a soft body that are held by much stiffer bodies, and the stress of its other points.
#[derive(Default)]
struct Taken {
    /// The points in cells whose nodes are all held by one stiff body, each with this body.
    held: Vec<(usize, u16)>,
    /// Σ |τ|² V and Σ V of the other points at each node.
    stress: HashMap<usize, [f64; 2]>,
    /// Σ |τ|² V over the other points.
    free: f64,
    /// True if `stress` includes all points of the run.
    is_complete: bool,
}

impl Taken {
    /// Adds up the stresses at the nodes over the whole run.
    fn complete<const D: usize>(&mut self, links: &Connectivity<D>) {
        if std::mem::replace(&mut self.is_complete, true) {
            return;
        }
        let mut field = vec![[0.0; 2]; links.n_active()];
        self.stress.iter().for_each(|(node, sums)| field[*node] = *sums);
        links.reduction().complete(&mut field);
        let stressed = |(node, sums): (usize, [f64; 2])| (sums[1] > 0.0).then_some((node, sums));
        self.stress = field.into_iter().enumerate().filter_map(stressed).collect();
    }
}

/// The soft bodies that stiffer ones stiffen in the trial state of a step, each with its warning.
pub fn watch<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    step: usize,
) -> Vec<(usize, Warning)> {
    let modulus = |material: usize| axial_modulus_at_rest(model.materials[material].law.as_ref());
    let moduli: Vec<f64> = model.bodies.iter().map(|body| modulus(body.material)).collect();
    let [least, most] = moduli
        .iter()
        .fold([f64::INFINITY, 0.0], |[least, most], m| [f64::min(least, *m), f64::max(most, *m)]);
    if most < CONTRAST * least {
        return Vec::new();
    }
    let stiffness = stiffness_of_bodies(model, points, links, &moduli);
    let mut taken: BTreeMap<u16, Taken> = BTreeMap::new();
    let corners = |p: usize| {
        let corners = model.grid.corners(points.cell[p] as usize);
        let active: Vec<usize> = (corners.nodes().iter())
            .filter_map(|&node| links.moves_with(points.body[p], node as usize))
            .collect();
        active.into_iter()
    };
    for p in 0..points.len() {
        let body = points.body[p];
        if moduli[body as usize] * CONTRAST <= most {
            let taken = taken.entry(body).or_default();
            if let Some(by) = holder(corners(p).map(|node| &stiffness[node]), body, &moduli) {
                taken.held.push((p, by));
                continue;
            }
            let volume = model.volume(points, p);
            let stress = points.trial.kirchhoff_stress[p].norm().powi(2) * volume;
            taken.free += stress;
            for node in corners(p) {
                if !stiffness[node].is_empty() {
                    let [at_node, around] = taken.stress.entry(node).or_default();
                    *at_node += stress;
                    *around += volume;
                }
            }
        }
    }
    let reduction = links.reduction();
    // The same bodies must be judged everywhere.
    for body in reduction.join(taken.keys().copied().collect::<Vec<u16>>()) {
        taken.entry(body).or_default().complete(links);
    }
    let warning = |(body, taken): (u16, Taken)| {
        // A held point keeps the stress that it had before; the free points around it show what stress it would
        // otherwise carry.
        let would_carry = |p: usize| {
            let around = corners(p).filter_map(|node| taken.stress.get(&node));
            let [stress, volume] = around.fold([0.0; 2], |[s, v], [stress, volume]| [s + stress, v + volume]);
            if volume > 0.0 { stress / volume * model.volume(points, p) } else { 0.0 }
        };
        let held: f64 = reduction.total(taken.held.iter().map(|(p, _)| would_carry(*p)).sum());
        let share = held / (held + reduction.total(taken.free));
        let &(point, by) = taken.held.first()?;
        (share > MAX_STIFFENED).then(|| (body as usize, warn(model, points, [body, by], point, share, step)))
    };
    taken.into_iter().filter_map(warning).collect()
}

/// The first body that is much stiffer than `body` and holds all of the nodes.
fn holder<'a>(nodes: impl Iterator<Item = &'a Vec<(u16, f64)>>, body: u16, moduli: &[f64]) -> Option<u16> {
    let holders = |node: &[(u16, f64)]| -> Vec<u16> {
        let own = node.iter().find(|(other, _)| *other == body).map_or(0.0, |(_, own)| *own);
        let is_stiff = |other: u16| moduli[other as usize] > CONTRAST * moduli[body as usize];
        let holds = |&&(other, stiffness): &&(u16, f64)| is_stiff(other) && stiffness > HOLDS * own;
        node.iter().filter(holds).map(|(other, _)| *other).collect()
    };
    let mut common: Option<Vec<u16>> = None;
    for node in nodes {
        let here = holders(node);
        let both = common
            .take()
            .map_or(here.clone(), |kept| kept.into_iter().filter(|b| here.contains(b)).collect());
        if both.is_empty() {
            return None;
        }
        common = Some(both);
    }
    common?.first().copied()
}

fn stiffness_of_bodies<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    moduli: &[f64],
) -> Stiffness {
    let is_shared = shared_nodes(points, links);
    let mut stiffness: Stiffness = vec![Vec::new(); links.n_active()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        if !nodes.iter().any(|&node| is_shared[node as usize]) {
            continue;
        }
        for p in links.points_of(group) {
            let body = points.body[p];
            let modulus = model.volume(points, p) * moduli[body as usize];
            links.for_each_link(p, |place, _, gradient| {
                let node = nodes[place] as usize;
                if is_shared[node] {
                    let added = modulus * gradient.iter().map(|x| x * x).sum::<f64>();
                    match stiffness[node].iter_mut().find(|(other, _)| *other == body) {
                        Some((_, sum)) => *sum += added,
                        None => stiffness[node].push((body, added)),
                    }
                }
            });
        }
    }
    join(&mut stiffness, links);
    stiffness
}

/// Adds up the stiffnesses over the whole run.
fn join<const D: usize>(stiffness: &mut Stiffness, links: &Connectivity<D>) {
    let own: Vec<(u32, u16, f64)> = (stiffness.iter_mut().zip(links.active_nodes()))
        .flat_map(|(at_node, node)| std::mem::take(at_node).into_iter().map(|(body, k)| (*node, body, k)))
        .collect();
    for (node, body, added) in links.reduction().join(own) {
        let Some(active) = links.seen_by(body, node as usize) else { continue };
        match stiffness[active].iter_mut().find(|(other, _)| *other == body) {
            Some((_, sum)) => *sum += added,
            None => stiffness[active].push((body, added)),
        }
    }
}

fn warn<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    bodies: [u16; 2],
    point: usize,
    share: f64,
    step: usize,
) -> Warning {
    let names = bodies.map(|body| model.bodies[body as usize].name.clone());
    let [soft, stiff] = &names;
    let position = points.trial.position[point];
    Warning {
        code: Code::Stiffened,
        step,
        message: format!(
            "body `{stiff}` reaches into cells of the much softer body `{soft}` and drags all nodes of these cells along: \
             points of `{soft}` such as the one at {} can no longer strain; if they could, they would carry about \
             {:.0} % of the stresses in that body, measured as energy; `{soft}` is too stiff by about this share",
            coordinates(&position),
            100.0 * share
        ),
        location: Location {
            bodies: names.to_vec(),
            position: Some(position.to_vec()),
            ..Location::default()
        },
        value: Some(share),
        threshold: Some(MAX_STIFFENED),
        detail: None,
    }
}
