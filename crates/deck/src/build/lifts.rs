//! Bodies that stages add above others: the sides that face each other, as they were drawn.

use super::Builder;
use crate::LoadDeck;
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};
use mpm_core::basis::DomainKind;
use mpm_core::grid::{Grid, MAX_CORNERS};
use mpm_core::model::Lift;
use mpm_core::points::Points;
use mpm_core::region::{Bounds, Facet, NoBoundary, Region, boundary_of_cells};
use mpm_core::surface::{OuterSides, Sheet, corners_of, sides_of_domain};

/// Length of the facets of a boundary, in cells, [-].
const LENGTH: f64 = 0.5;
/// Largest original distance between a body and the ground below it, in cells, [-].
const ON_GROUND: f64 = 2.0;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The bodies that a stage adds above others: first those that it places onto one, then, for each body that it adds,
    /// the other bodies below it that were there before.
    pub(super) fn lifts(
        &mut self,
        grid: &dyn Grid<D>,
        regions: &Regions<D>,
        points: &Points<D>,
        number: usize,
    ) -> Vec<Lift<D>> {
        let drawn = Drawn { grid, regions, points };
        let deck = self.deck;
        let stage = &deck.stages[number];
        let (mut placed, mut others) = (Vec::new(), Vec::new());
        for (index, added) in stage.add.iter().enumerate() {
            let body = self.body_number(added.name());
            if let Some(ground) = added.onto() {
                let at = format!("/stages/{number}/add/{index}/onto");
                placed.extend(self.placed_lift(&drawn, [body, self.body_number(ground)], &at));
            }
            for (ground, other) in deck.bodies.iter().enumerate() {
                let name = other.name.as_str();
                let is_below = added.onto() != Some(name) && self.is_there_before(number, name);
                if is_below && may_stand_on(&regions.bodies[body], &regions.bodies[ground], grid) {
                    let lift = self.lift(&drawn, [body, ground]);
                    others.extend(lift.ok().filter(|lift| is_drawn_on_ground(lift, ON_GROUND)));
                }
            }
        }
        placed.extend(others);
        placed
    }

    /// A body that a stage places onto another one; `None` after an error.
    fn placed_lift(
        &mut self,
        drawn: &Drawn<D>,
        [body, ground]: [usize; 2],
        pointer: &str,
    ) -> Option<Lift<D>> {
        let names = [body, ground].map(|body| quote(&self.deck.bodies[body].name));
        let message = match self.lift(drawn, [body, ground]) {
            Ok(lift) if is_drawn_on_ground(&lift, f64::INFINITY) => {
                return Some(Lift { is_placed: true, ..lift });
            }
            Ok(_) => format!("the body {} was not drawn above or below any part of {}", names[0], names[1]),
            Err(error) => format!("the body {} cannot be placed onto {}: {error}", names[0], names[1]),
        };
        let help = "give the body on which it stands, or write only its name, and it begins where its shape places it";
        self.error("D053", pointer, message, help.to_owned());
        None
    }

    /// The lower side of a body and the upper side of another one.
    fn lift(&self, drawn: &Drawn<D>, [body, ground]: [usize; 2]) -> Result<Lift<D>, NoBoundary> {
        let Drawn { grid, regions, points } = *drawn;
        let up = self.up();
        let bounds = regions.bodies[body].bounds();
        let foot: [f64; D] = std::array::from_fn(|d| match up[d] {
            up if up > 0.5 => bounds[0][d],
            up if up < -0.5 => bounds[1][d],
            _ => 0.5 * (bounds[0][d] + bounds[1][d]),
        });
        let sides = grid.spacing(grid.nearest_cell(&foot) as usize);
        let cell = (0..D).map(|d| up[d].abs() * sides[d]).sum();
        let spacing = LENGTH * sides.into_iter().fold(f64::INFINITY, f64::min);
        let boundary = |body: usize| -> Result<Vec<Facet<D>>, NoBoundary> {
            let region = &regions.bodies[body];
            // Boxes may begin beside the side that was drawn; other domains follow it.
            if self.deck.bodies[body].method.domain() == DomainKind::Box {
                return Ok(sides_of_domains(points, body));
            }
            let Some((group, motion)) = region.as_group() else { return region.boundary(spacing) };
            boundary_of_cells(grid, &regions.groups.cells(group.key, grid.n_cells()), motion, None, spacing)
        };
        let lower = Sheet::new(&boundary(body)?, up, true);
        let upper = Sheet::new(&boundary(ground)?, up, false);
        Ok(Lift { body, ground, is_placed: false, up, lower, upper, cell })
    }

    /// The direction opposite to gravity or, without gravity, the last axis.
    fn up(&self) -> [f64; D] {
        let gravity = self.deck.loads.iter().find_map(|load| match load {
            LoadDeck::Gravity(gravity) => Some(&gravity.acceleration),
            _ => None,
        });
        let size = gravity.map_or(0.0, |a| a.iter().map(|x| x * x).sum::<f64>().sqrt());
        match gravity {
            Some(a) if size > 0.0 => std::array::from_fn(|d| -a.get(d).copied().unwrap_or(0.0) / size),
            _ => std::array::from_fn(|d| if d + 1 == D { 1.0 } else { 0.0 }),
        }
    }

    /// True if a body is present when a stage begins, before this stage adds bodies.
    fn is_there_before(&self, number: usize, name: &str) -> bool {
        let stages = &self.deck.stages;
        let mut is_there = self.deck.begins_present(name);
        for stage in &stages[..number] {
            is_there = (is_there && !stage.removed().contains(&name)) || stage.added().contains(&name);
        }
        is_there && !stages[number].removed().contains(&name)
    }
}

/// The outer sides of the domains of a body.
fn sides_of_domains<const D: usize>(points: &Points<D>, body: usize) -> Vec<Facet<D>> {
    let (mut outer, mut buffer, mut own) =
        (OuterSides::default(), [[0.0; D]; MAX_CORNERS], Vec::<f64>::new());
    outer.find(points, &points.reduction());
    for p in (0..points.len()).filter(|&p| usize::from(points.body[p]) == body) {
        let (mask, corners) = (outer.of_point(points.id[p]), corners_of(points, p, &mut buffer));
        for (_, side) in sides_of_domain::<D>(corners.len()).enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
            let around = side.corners();
            for second in 1..=around.len() - D + 1 {
                let corner = |place: usize| corners[around[if place == 0 { 0 } else { second + place - 1 }]];
                (0..D).for_each(|place| own.extend(corner(place)));
            }
        }
    }
    let all: Vec<f64> = points.ranks.gather_all(own).into_iter().flatten().collect();
    let (corners, _) = all.as_chunks::<D>();
    let (facets, _) = corners.as_chunks::<D>();
    facets.iter().map(|corners| Facet { corners: *corners, side: 0 }).collect()
}

/// The bodies as they were drawn, and their points at the start.
struct Drawn<'a, const D: usize> {
    grid: &'a dyn Grid<D>,
    regions: &'a Regions<D>,
    points: &'a Points<D>,
}

/// False if no part of a body lies above or below another one within the distance at which it stands on it.
fn may_stand_on<const D: usize>(body: &Region<D>, ground: &Region<D>, grid: &dyn Grid<D>) -> bool {
    let ([low, high], [ground_low, ground_high]): (Bounds<D>, Bounds<D>) = (body.bounds(), ground.bounds());
    let size = grid.spacing(grid.nearest_cell(&low) as usize);
    (0..D).all(|d| {
        let slack = ON_GROUND * size[d];
        low[d] <= ground_high[d] + slack && ground_low[d] <= high[d] + slack
    })
}

/// True if the body was drawn at most this many cells above or below the ground in some column.
fn is_drawn_on_ground<const D: usize>(lift: &Lift<D>, cells: f64) -> bool {
    lift.lower.centres().any(|x| lift.original_gap(&x).is_some_and(|gap| gap.abs() <= cells * lift.cell))
}
