//! Boundary conditions, loads and probes.

use super::{Builder, Placing};
use crate::formulas::{Fault, at_nodes};
use crate::gates::{NearestPoints, Ties};
use crate::initial_stress::curve_of;
use crate::loads::load_curve;
use crate::region::DeckRegion;
use mpm_core::formula::Formula;
use mpm_core::grid::Grid;
use mpm_core::model::{BoundaryCondition, Load, NodeSet, OnSurface, Probe};
use mpm_core::points::Points;
use mpm_core::region::Region;

/// Penalty stiffness of conditions on surfaces, relative to the axial modulus divided by the cell size, [-].
const PENALTY: f64 = 10.0;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    pub(super) fn boundary_conditions(
        &mut self,
        grid: &dyn Grid<D>,
        points: &Points<D>,
    ) -> Vec<BoundaryCondition<D>> {
        let deck = self.deck;
        let mut conditions = Vec::new();
        for (number, condition) in deck.boundary_conditions.iter().enumerate() {
            let pointer = format!("/boundary_conditions/{number}");
            let nodes = match (&condition.nodes, &condition.surface) {
                (_, Some(surface)) => NodeSet::Surface(OnSurface {
                    surface: self.surface_number(surface),
                    along_normal: condition.holds_along_surface_normal(),
                    penalty: condition.penalty.unwrap_or(PENALTY),
                }),
                (Some(nodes), None) => self.nodes(grid, points, nodes, condition, &pointer),
                (None, None) => NodeSet::Fixed(Vec::new()),
            };
            let mut prescribed = match at_nodes(
                condition.displacements(),
                &condition.intermediate,
                &self.loaded.parameters,
                D,
            ) {
                Ok(formulas) => formulas,
                Err(faults) => {
                    self.faulty_formulas(&pointer, faults);
                    continue;
                }
            };
            let mut displacement: [Option<Formula>; D] = std::array::from_fn(|axis| prescribed[axis].take());
            for direction in condition.held().into_iter().filter(|direction| *direction < D) {
                displacement[direction] = Some(Formula::constant(0.0));
            }
            conditions.push(BoundaryCondition {
                name: condition.name.clone(),
                nodes,
                displacement,
                axes: condition.frame(),
                curve: load_curve(condition.curve.as_ref(), self.deck.end_time()),
            });
        }
        conditions
    }

    pub(super) fn loads(&mut self, grid: &dyn Grid<D>, points: &Points<D>) -> Vec<Load<D>> {
        let deck = self.deck;
        let mut loads = Vec::new();
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            let Some(action) = load.action(&mut Placing { builder: self, grid, points }, &pointer) else {
                continue;
            };
            let base_motion = self.base_motion(load, &pointer);
            loads.push(Load {
                name: load.name().to_owned(),
                action,
                acts_on: self.acts_on(load.bodies()),
                curve: base_motion.unwrap_or_else(|| curve_of(deck, load)),
            });
        }
        loads
    }

    /// For each body, true if a load on the chosen bodies acts on it; without a choice, the load acts on all bodies.
    fn acts_on(&self, chosen: Option<&[String]>) -> Vec<bool> {
        let Some(chosen) = chosen else { return vec![true; self.deck.bodies.len()] };
        let mut acts_on = vec![false; self.deck.bodies.len()];
        for name in chosen {
            acts_on[self.body_number(name)] = true;
        }
        acts_on
    }

    pub(super) fn probes(&mut self, grid: &dyn Grid<D>, points: &Points<D>) -> Vec<Probe> {
        let deck = self.deck;
        let mut probes = Vec::new();
        for (number, probe) in deck.output.probes.iter().enumerate() {
            let pointer = format!("/output/probes/{number}");
            let wanted = NearestPoints { place: &probe.nearest, count: probe.count, ties: Ties::All };
            let points = self.nearest(grid, points, &probe.body, wanted, &pointer);
            probes.push(Probe { name: probe.name.clone(), points });
        }
        probes
    }

    pub(super) fn faulty_formulas(&mut self, pointer: &str, faults: Vec<Fault>) {
        for fault in faults {
            let help = "see the deck reference for what formulas may contain".to_owned();
            self.error("D021", &format!("{pointer}/{}", fault.key), fault.error.message, help);
        }
    }
}
