//! Sets the stress of the points at time 0.

use serde::{Deserialize, Serialize};

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::initial_stress::{InitialStressDeck, unit_weight};
use crate::quoting::quote;
use crate::region::{DeckRegion, Groups, Regions};
use mpm_core::formula::Formula;
use mpm_core::grid::Grid;
use mpm_core::model::Model;
use mpm_core::points::{Points, coordinates};
use mpm_core::region::{Intervals, Line, Region, contains_in_cell};
use mpm_core::tensor::{Mat3, Sym3};

/// Largest distance between a body and the surface of its ground that counts as zero, relative to the height of the
/// body, [-].
const AT_SURFACE: f64 = 1e-9;
/// Distance between the positions at which a vertical line through groups of cells is probed, relative to the local
/// cell size, [-].
const PROBED: f64 = 0.25;
/// Largest distance to the level of a node that counts as zero, relative to the cell size, [-].
const ON_NODE: f64 = 1e-8;
/// Number of bisections that locate, to round-off, where a vertical line enters or leaves a group of cells.
const BISECTIONS: usize = 60;
/// Largest change of a stress, on its return to the yield surface, that counts as round-off, relative to the stress,
/// [-].
const ON_SURFACE: f64 = 1e-9;

/// Norm of the logarithmic elastic strain of an initial stress above which the stiffness cannot hold the stress, [-]:
/// compressed equally in three directions, a body would have a thirtieth of its volume.
const MAX_STRAIN: f64 = 2.0;

/// The initial stress of a body.
enum Stress {
    Geostatic {
        surface: f64,
        k0: f64,
        surcharge: f64,
    },
    /// Formulas of the original position, each with the row and column of its component.
    Components(Vec<((usize, usize), Formula)>),
}

/// The ground that a body is part of when it begins to exist.
struct Ground<'a, const D: usize> {
    grid: &'a dyn Grid<D>,
    groups: &'a Groups,
    /// The bodies with geostatic stress.
    layers: Vec<Layer<'a, D>>,
}

/// A body with geostatic stress, as a part of the ground.
struct Layer<'a, const D: usize> {
    region: &'a Region<D>,
    /// Weight per volume, [force/volume].
    weight: f64,
    /// What the water takes from this weight below its level, [force/volume].
    buoyancy: f64,
}

/// A position in the ground.
struct Place<'a, const D: usize> {
    position: &'a [f64; D],
    /// Height of the water level above it, [length]; −∞ without water.
    depth: f64,
    /// Half the vertical extent of the domain of the point, [length].
    half: f64,
    /// What the water takes from the weight of the body, [force/volume].
    buoyancy: f64,
}

/// Stresses that the law of a body has returned to the yield surface.
#[derive(Default, Serialize, Deserialize)]
struct Returned {
    points: usize,
    among: usize,
    /// Norms of the largest change of a stress, and of the stress before this change, [stress].
    largest: (f64, f64),
}

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Sets the stress of the points of all bodies that have an initial stress.
    pub(super) fn initial_stresses(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        regions: &Regions<D>,
    ) {
        let stresses: Vec<Option<Stress>> =
            (0..self.deck.bodies.len()).map(|body| self.stress_of(body)).collect();
        if stresses.iter().all(Option::is_none) {
            return;
        }
        let deck = self.deck;
        let is_layer = |body: &usize| matches!(stresses[*body], Some(Stress::Geostatic { .. }));
        let buoyancy = |body: usize| {
            let Some(water) = &model.water else { return 0.0 };
            let factor = model.water_factor(body, 0.0);
            factor * water.unit_weight * water.grains(model.bodies[body].material)
        };
        let layer = |body: usize| Layer {
            region: &regions.bodies[body],
            weight: unit_weight(deck, &deck.bodies[body]),
            buoyancy: buoyancy(body),
        };
        let ground_of = |body: usize| {
            let begins =
                |other: &usize| deck.begins_beside(&deck.bodies[body].name, &deck.bodies[*other].name);
            let layers = (0..stresses.len()).filter(is_layer).filter(begins).map(layer).collect();
            Ground { grid: model.grid.as_ref(), groups: &regions.groups, layers }
        };
        let grounds: Vec<_> = (0..stresses.len()).map(ground_of).collect();
        for (body, stress) in stresses.iter().enumerate() {
            if let Some(Stress::Geostatic { surface, .. }) = stress {
                self.level_of_surface(body, *surface, &regions.bodies[body], &grounds[body].layers);
            }
        }
        let mut returned: Vec<Returned> = stresses.iter().map(|_| Returned::default()).collect();
        let mut is_faulty = vec![false; stresses.len()];
        for p in 0..points.len() {
            let body = points.body[p] as usize;
            let Some(stress) = stresses[body].as_ref().filter(|_| !is_faulty[body]) else { continue };
            let x = points.original_position[p];
            let place = Place {
                position: &x,
                depth: model
                    .water
                    .as_ref()
                    .map_or(f64::NEG_INFINITY, |water| water.height(x[0], 0.0).0 - x[D - 1]),
                half: if model.water.is_some() { model.half_height(points, p) } else { 0.0 },
                buoyancy: buoyancy(body),
            };
            match stress.at(&place, &grounds[body]).and_then(|stress| {
                let taken = model.set_initial_stress(points, p, &stress);
                let taken = taken.map_err(|error| ("D051", error.to_string()))?;
                is_held(model, points, p).map_err(|reason| ("D051", reason))?;
                Ok((stress, taken))
            }) {
                Ok((asked, taken)) => returned[body].count(&asked, &taken),
                Err((code, reason)) => {
                    is_faulty[body] = true;
                    self.impossible(body, code, &format!("at the point {}: {reason}", coordinates(&x)));
                }
            }
        }
        for (body, returned) in returned.into_iter().enumerate() {
            let gathered = self.ranks.gather_all(returned);
            let returned = gathered.into_iter().fold(Returned::default(), Returned::and);
            if returned.points > 0 {
                self.brought_back(body, &returned);
            }
        }
    }

    /// The initial stress of a body; `None` without one, or if its formulas have faults.
    fn stress_of(&mut self, body: usize) -> Option<Stress> {
        let deck = self.deck;
        match deck.bodies[body].initial_stress.as_ref()? {
            InitialStressDeck::Geostatic { surface, k0, surcharge } => {
                Some(Stress::Geostatic { surface: *surface, k0: *k0, surcharge: *surcharge })
            }
            InitialStressDeck::Components { stress } => match stress.formulas(&self.loaded.parameters, D) {
                Ok(components) => Some(Stress::Components(components)),
                Err(faults) => {
                    self.faulty_formulas(&format!("/bodies/{body}/initial_stress"), faults);
                    None
                }
            },
        }
    }

    /// Checks that a body lies below the surface of its ground, and that the ground reaches up to this surface.
    fn level_of_surface(&mut self, body: usize, surface: f64, region: &Region<D>, layers: &[Layer<D>]) {
        let [low, high] = region.bounds().map(|corner| corner[D - 1]);
        let slack = AT_SURFACE * (high - low).abs();
        let pointer = format!("/bodies/{body}/initial_stress/surface");
        let top =
            layers.iter().map(|layer| layer.region.bounds()[1][D - 1]).fold(f64::NEG_INFINITY, f64::max);
        let name = quote(&self.deck.bodies[body].name);
        if high > surface + slack {
            let message =
                format!("the body {name} reaches up to {high}, above the surface {surface} of its ground");
            self.error("D051", &pointer, message, format!("set `surface` to {top}, the top of the ground"));
        } else if top < surface - slack {
            let message = format!(
                "the ground of the body {name} ends at {top}, below its surface {surface}: no body with geostatic stress reaches it"
            );
            let help = format!("set `surface` to {top}, or give the bodies above a geostatic stress, too");
            self.error("D051", &pointer, message, help);
        }
    }

    fn impossible(&mut self, body: usize, code: &'static str, reason: &str) {
        let name = quote(&self.deck.bodies[body].name);
        let message = format!("the body {name} cannot have this initial stress {reason}");
        let help = "check the stress and its units, or choose another law".to_owned();
        self.error(code, &format!("/bodies/{body}/initial_stress"), message, help);
    }

    /// Warns of stresses that the law has returned to the yield surface.
    fn brought_back(&mut self, body: usize, returned: &Returned) {
        let Returned { points, among, largest: (change, before) } = returned;
        let place =
            if *among == 1 { "the only point".to_owned() } else { format!("{points} of the {among} points") };
        let message = format!(
            "at {place} of the body {}, the initial stress lies outside the yield surface; it is returned to the yield \
             surface, and changes by at most {change:.3e}, {:.1} % of the stress",
            quote(&self.deck.bodies[body].name),
            100.0 * change / before
        );
        let at = format!("/bodies/{body}/initial_stress");
        let found = Diagnostic::at(&self.loaded.source, "D052", &at, message).severity(Severity::Warning);
        self.found
            .push(found.help(
                "give a stress that the material can carry; the returned stress may be out of balance",
            ));
    }
}

/// Checks that the stiffness of a point can hold its initial stress.
///
/// # Errors
/// The reason, if the elastic strain would be too large or is not finite.
fn is_held<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize) -> Result<(), String> {
    let measure = model.law(points, p).strain_measure();
    let strain = measure.logarithmic(&points.converged.elastic_strain[p]).norm();
    if strain <= MAX_STRAIN {
        return Ok(());
    }
    Err(format!(
        "the stiffness of its material cannot hold it: the elastic strain would be {strain:.1e}, and more than \
         {MAX_STRAIN} cannot be; the stress and `young` seem to be in different units"
    ))
}

impl Stress {
    /// The Cauchy stress at a position of the original configuration, [stress].
    ///
    /// # Errors
    /// A code and a message if it is not finite.
    fn at<const D: usize>(
        &self,
        place: &Place<D>,
        ground: &Ground<D>,
    ) -> Result<Sym3, (&'static str, String)> {
        let mut stress = Mat3::zeros();
        match self {
            Stress::Geostatic { surface, k0, surcharge } => {
                let vertical = -(surcharge + ground.weight_above(place, *surface));
                for axis in 0..3 {
                    stress[(axis, axis)] = if axis == D - 1 { vertical } else { k0 * vertical };
                }
            }
            Stress::Components(components) => {
                for ((row, column), formula) in components {
                    let value = formula.evaluate(place.position);
                    if !value.is_finite() {
                        return Err(("D043", format!("the formula `{}` is {value}", formula.text())));
                    }
                    stress[(*row, *column)] = value;
                    stress[(*column, *row)] = value;
                }
            }
        }
        Ok(Sym3::symmetric_part(&stress))
    }
}

impl<const D: usize> Place<'_, D> {
    /// The mean over the domain of what the water takes from the weight above, less its value at the centre, [stress].
    fn mean_beyond_centre(&self) -> f64 {
        let Place { depth, half, buoyancy, .. } = *self;
        if depth.abs() >= half {
            return 0.0;
        }
        buoyancy * ((depth + half).powi(2) / (4.0 * half) - depth.max(0.0))
    }
}

impl<const D: usize> Ground<'_, D> {
    /// Weight per unit area of the ground between a position and the surface above it, less what water takes from it,
    /// [stress]. Where the level cuts the domain of a point, this is the mean over the vertical extent of the domain.
    fn weight_above(&self, place: &Place<D>, surface: f64) -> f64 {
        let x = place.position;
        let height = surface - x[D - 1];
        let line = Line::along_axis(*x, D - 1);
        let above = Intervals::one(0.0, height);
        let length = |region: &Region<D>, height: f64, above: &Intervals| match region.intervals(&line) {
            Some(inside) => inside.intersection(above).length(),
            None => self.length_in_cells(region, &line, height),
        };
        let weight: f64 =
            self.layers.iter().map(|layer| layer.weight * length(layer.region, height, &above)).sum();
        let wet_height = height.min(place.depth);
        let lifted = if wet_height > 0.0 {
            let wet = Intervals::one(0.0, wet_height);
            self.layers.iter().map(|layer| layer.buoyancy * length(layer.region, wet_height, &wet)).sum()
        } else {
            0.0
        };
        weight - lifted - place.mean_beyond_centre()
    }

    /// Length of the part of a line, from its origin up to a height, that lies in a region containing groups of cells.
    /// Horizontal boundaries are located exactly, others within the tolerance of the grid at cell boundaries; gaps and
    /// parts thinner than a quarter of a cell may be missed.
    fn length_in_cells(&self, region: &Region<D>, line: &Line<D>, height: f64) -> f64 {
        let mut hint = None;
        let mut is_inside = |t: f64| {
            let x = line.at(t);
            hint = self.grid.locate(&x, hint);
            hint.is_some_and(|cell| {
                let holds = |key: usize, cell: usize| self.groups.holds(key, cell);
                contains_in_cell(region, self.grid, &x, cell as usize, holds)
            })
        };
        let (mut t, mut was_inside, mut length) = (0.0, is_inside(0.0), 0.0);
        while t < height {
            let size = self.grid.size(self.grid.nearest_cell(&line.at(t)) as usize);
            let next = if size > 0.0 { (t + PROBED * size).min(height) } else { height };
            let now_inside = is_inside(next);
            length += match (was_inside, now_inside) {
                (true, true) => next - t,
                (false, false) => 0.0,
                _ => {
                    let (mut low, mut high) = (t, next);
                    for _ in 0..BISECTIONS {
                        let middle = 0.5 * (low + high);
                        *if is_inside(middle) == was_inside { &mut low } else { &mut high } = middle;
                    }
                    let border = self.at_node(line, 0.5 * (low + high));
                    if was_inside { border - t } else { next - border }
                }
            };
            (t, was_inside) = (next, now_inside);
        }
        length
    }
}

impl<const D: usize> Ground<'_, D> {
    /// The position t on a vertical line, moved to the level of a node of the cell there if it almost coincides with
    /// this level: near a cell boundary, t is known only within the tolerance of the search for cells, which exceeds
    /// round-off.
    fn at_node(&self, line: &Line<D>, t: f64) -> f64 {
        let cell = self.grid.nearest_cell(&line.at(t)) as usize;
        let corners = self.grid.corners(cell);
        let levels = corners.nodes().iter().map(|&n| self.grid.node_position(n as usize)[D - 1]);
        let mut heights = levels.map(|level| level - line.origin[D - 1]);
        heights.find(|height| (height - t).abs() <= ON_NODE * self.grid.size(cell)).unwrap_or(t)
    }
}

impl Returned {
    /// Combines the results of two ranks.
    fn and(self, other: Returned) -> Returned {
        let largest = if other.largest.0 > self.largest.0 { other.largest } else { self.largest };
        Returned { points: self.points + other.points, among: self.among + other.among, largest }
    }

    /// Counts a point, given the requested stress and the stress that its law admits.
    fn count(&mut self, asked: &Sym3, taken: &Sym3) {
        self.among += 1;
        let change = (*taken - *asked).norm();
        if change > ON_SURFACE * asked.norm() {
            self.points += 1;
            if change > self.largest.0 {
                self.largest = (change, asked.norm());
            }
        }
    }
}
