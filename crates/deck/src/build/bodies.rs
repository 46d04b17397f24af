//! The bodies of a deck, filled with points.

use super::Builder;
use crate::Expression;
use crate::diagnostic::{Diagnostic, Severity};
use crate::material::MaterialOfPoints;
use crate::placing;
use crate::quoting::quote;
use crate::region::{DeckRegion, FromFiles, Groups, Refusal, Regions, region};
use crate::seeding::{Filled, fill};
use mpm_core::grid::Grid;
use mpm_core::model::{Body, Filling, Fit};
use mpm_core::points::{Points, Seed};
use mpm_core::region::Region;
use mpm_core::stress::CellStrain;

/// Difference between the area of the points and that of their region, relative to the latter, above which the
/// difference is probably unintended, [-].
const MUCH: f64 = 0.05;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The regions of all bodies, and the groups of cells of which they consist; `None` if any region cannot be
    /// determined.
    pub(super) fn regions(&mut self, grid: &dyn Grid<D>) -> Option<Regions<D>> {
        let (directory, source) = (self.loaded.directory.as_path(), &self.loaded.source);
        let mut given = FromFiles { grid, directory, source, groups: Groups::default(), found: Vec::new() };
        let mut regions = Vec::new();
        for (number, body) in self.deck.bodies.iter().enumerate() {
            let place = format!("/bodies/{number}/shape");
            match region(&body.shape, &place, &mut given) {
                Ok(region) => regions.push(region),
                Err(Refusal::Numbers(place, error)) => {
                    let fault = Diagnostic::at(source, "D016", &place, error.to_string());
                    given.found.push(fault.help("change the numbers so that they enclose a region"));
                }
                Err(Refusal::Unknown) => {}
            }
        }
        let FromFiles { groups, found, .. } = given;
        self.found.extend(found);
        (regions.len() == self.deck.bodies.len()).then_some(Regions { bodies: regions, groups })
    }

    pub(super) fn bodies(&self) -> Vec<Body> {
        let body = |b: &crate::BodyDeck| Body {
            name: b.name.clone(),
            material: self.deck.materials.keys().position(|name| *name == b.material).unwrap_or(0),
            method: b.method,
            domain_update: b.domain_update.unwrap_or_default(),
            strain: b.strain(),
            split_above: b.split_above,
        };
        self.deck.bodies.iter().map(body).collect()
    }

    /// Reports F-bar in triangles and tetrahedra, where it changes nothing because gradients are constant.
    pub(super) fn centres(&mut self, grid: &dyn Grid<D>, points: &Points<D>) {
        for (number, body) in self.deck.bodies.iter().enumerate() {
            if body.strain() != CellStrain::FBar || !grid.has_simplices() {
                continue;
            }
            let corners = |cell: u32| grid.corners(cell as usize).nodes().len();
            let in_simplex = |p: usize| {
                let cell = grid.locate(&points.converged.position[p], Some(points.cell[p]));
                points.body[p] as usize == number && cell.is_some_and(|cell| corners(cell) == D + 1)
            };
            if self.ranks.any((0..points.len()).any(in_simplex)) {
                let cells = if D == 3 { "tetrahedra" } else { "triangles" };
                let message = format!("`f-bar` changes nothing in {cells}, whose gradients are constant");
                let help = format!("use `mean-dilatation`, which averages over patches of {cells}");
                self.error("D055", &format!("/bodies/{number}/{}", body.strain_key()), message, help);
            }
        }
    }

    /// Largest number of history variables of the materials that stages assign to a body.
    fn later_history(&self, body: &str, materials: &[MaterialOfPoints]) -> usize {
        let later = self.deck.stages.iter().filter_map(|stage| stage.material.get(body));
        let later = materials.iter().filter(|material| later.clone().any(|name| *name == material.name));
        later.map(|material| material.law.state_fields().len()).max().unwrap_or(0)
    }

    /// Fills every body with points; returns the points that this rank creates, with their permanent numbers.
    pub(super) fn seeds(
        &mut self,
        grid: &dyn Grid<D>,
        materials: &[MaterialOfPoints],
        bodies: &[Body],
        regions: &Regions<D>,
    ) -> (Vec<Seed<D>>, Vec<u32>) {
        let (mut seeds, mut numbers, mut count) = (Vec::new(), Vec::new(), 0);
        for (number, deck) in self.deck.bodies.iter().enumerate() {
            let body = &bodies[number];
            let density = self.deck.materials[&deck.material].density().and_then(Expression::as_number);
            let mut history = materials[body.material].law.initial_history();
            let room = history.len().max(self.later_history(&deck.name, materials));
            history.resize(room, 0.0);
            let filling = Filling {
                grid,
                in_group: &|key, cell| regions.groups.holds(key, cell),
                body: number as u16,
                domain: body.method.domain(),
                density: density.unwrap_or(0.0),
                history,
                needs_boxes: !self.deck.tools.is_empty() || self.deck.has_level(),
                ranks: self.ranks,
            };
            let filled = fill(&regions.bodies[number], &filling, deck).and_then(|filled| {
                placing::inside_grid(grid, &deck.name, &filled, self.ranks).map_err(Some)?;
                Ok(filled)
            });
            match filled {
                Ok(mut filled) => {
                    self.furnish(&deck.name, &materials[body.material], room, &mut filled.seeds);
                    // Materials that stages assign to the body must suit its points as well.
                    for stage in &self.deck.stages {
                        let given = stage.material.get(&deck.name);
                        let given = given.and_then(|name| materials.iter().find(|m| m.name == *name));
                        if let Some(given) = given.filter(|given| !given.stated.varying.is_empty()) {
                            self.furnish(&deck.name, given, room, &mut filled.seeds.clone());
                        }
                    }
                    self.report_volume(number, deck, &filled);
                    let first = count + filled.before;
                    numbers.extend((first..first + filled.seeds.len()).map(|number| number as u32));
                    count += filled.all;
                    if seeds.is_empty() {
                        seeds = filled.seeds;
                    } else {
                        seeds.extend(filled.seeds);
                    }
                }
                Err(Some(fault)) => {
                    let pointer = format!("/bodies/{number}{}", fault.key);
                    self.error(fault.code, &pointer, fault.message, fault.help);
                }
                // Another rank reports the fault.
                Err(None) => {}
            }
        }
        (seeds, numbers)
    }

    /// Warns of bodies that overlap.
    pub(super) fn overlaps(&mut self, grid: &dyn Grid<D>, regions: &Regions<D>, points: &Points<D>) {
        for (number, message) in placing::overlaps(grid, self.deck, regions, points) {
            let found =
                Diagnostic::at(&self.loaded.source, "D025", &format!("/bodies/{number}/shape"), message);
            let help = "if this is not intended, subtract one from the other with a `difference`";
            self.found.push(found.severity(Severity::Warning).help(help));
        }
    }

    /// Reports how much the area (volume) of the points of a body differs from the area (volume) of its region.
    fn report_volume(&mut self, number: usize, deck: &crate::BodyDeck, filled: &Filled<D>) {
        let Some(exact) = filled.exact.filter(|exact| exact.value > 0.0) else { return };
        let volume = self.ranks.total(filled.seeds.iter().map(|s| s.volume).sum());
        let part = (volume - exact.value) / exact.value;
        if part.abs() > 1e-9 + exact.error / exact.value {
            let what = if D > 2 { "a volume" } else { "an area" };
            let word = if part > 0.0 { "more" } else { "less" };
            let edge = match filled.fit {
                Fit::Parts => "",
                Fit::Fitted if filled.apart.is_some() => "; parts of its boundary are finer than the domains",
                Fit::Fitted => "",
                Fit::OnMesh => {
                    "; its edge is a staircase, because domains follow an edge only between lines, not on meshes"
                }
                Fit::Unfitted => "; its edge is a staircase, because no domains of this size fill it exactly",
            };
            let place = filled.apart.map(|x| format!(", near ({})", x.map(|x| format!("{x:.6}")).join(", ")));
            let place = place.unwrap_or_default();
            let message = format!(
                "the points of the body {} represent {what} of {volume:.6}, {:.3} % {word} than that of its \
                 region{edge}{place}",
                quote(&deck.name),
                100.0 * part.abs()
            );
            let found =
                Diagnostic::at(&self.loaded.source, "D033", &format!("/bodies/{number}/shape"), message);
            self.found.push(if part.abs() > MUCH {
                let help = "use more points or smaller cells, and check that the region lies in the grid";
                found.severity(Severity::Warning).help(help)
            } else {
                let help = "use more points, or smaller cells, where this matters";
                found.severity(Severity::Note).help(help)
            });
        }
    }
}
