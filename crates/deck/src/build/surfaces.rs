//! Samples the surfaces of a deck.

use std::borrow::Cow;

use mpm_core::grid::Grid;
use mpm_core::points::Points;
use mpm_core::region::{NoBoundary, Region, boundary_of_cells};
use mpm_core::surface::{Part, Surface};

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::per_axis::array;
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};
use crate::{BoxDeck, HalfSpaceDeck, Idealisation, PartDeck, SurfaceDeck};

/// Length of the samples of a surface relative to the smallest cell at the surface, [-].
const LENGTH: f64 = 0.25;
/// Largest number of samples of a surface at which the cells of a mesh are looked up.
const PLACES: usize = 200;
/// Largest number of times that a surface is sampled again with the spacing of the cells found at it.
const ROUNDS: usize = 4;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Samples all surfaces, given the regions of the bodies.
    pub(super) fn surfaces(
        &mut self,
        grid: &dyn Grid<D>,
        regions: &Regions<D>,
        points: &Points<D>,
    ) -> Vec<Surface<D>> {
        let mut surfaces = Vec::new();
        for (index, deck) in self.loaded.deck.surfaces.iter().enumerate() {
            let body = self.body_number(&deck.body);
            let Some(region) = regions.bodies.get(body) else { continue };
            let domain = self.deck.bodies[body].method.domain();
            let part = match &deck.part {
                None => Part::Whole,
                Some(PartDeck { within: Some(BoxDeck { min, max }), .. }) => {
                    Part::Box(array::<D>(min), array::<D>(max))
                }
                Some(PartDeck { half_space: Some(HalfSpaceDeck { point, normal }), .. }) => {
                    Part::HalfSpace { point: array(point), normal: array(normal) }
                }
                Some(PartDeck { edge: Some(edge), .. }) => Part::Side(*edge as usize),
                Some(_) => Part::Whole,
            };
            let at = format!("/surfaces/{index}");
            let by_group = deck.part.as_ref().is_some_and(|part| part.group.is_some());
            if by_group && region.as_group().is_none() && region.as_mesh().is_none() {
                let message = format!(
                    "the surface {} is selected by a physical group, but the shape of its body {} is neither `cells` nor `mesh`",
                    quote(&deck.name),
                    quote(&deck.body)
                );
                let help =
                    "give the body the shape `cells` or `mesh`, or select the part by `box` or `half_space`";
                self.error("D050", &format!("{at}/part/group"), message, help.to_owned());
                continue;
            }
            let of_cells = region.as_mesh().map_or(grid, |(mesh, ..)| mesh);
            let Ok(nodes) = self.nodes_of_part(of_cells, deck, &at) else { continue };
            let of = Sampling { grid, regions, region, body, part: &part, nodes: nodes.as_deref(), deck };
            let (mut sampled, mut spacing) = of.sampled(None);
            let all = Sampling { part: &Part::Whole, nodes: None, ..of };
            let (whole, _) = all.sampled(Some(spacing));
            let at_sides = (sampled.as_ref().ok().zip(whole.as_ref().ok()))
                .and_then(|(found, whole)| found.at_sides(whole, points, domain, self.ranks));
            let is_at_sides = at_sides.is_some();
            if let Some(at_sides) = at_sides {
                if deck.spacing.is_some() {
                    self.spacing_without_effect(deck, &at);
                }
                sampled = Ok(at_sides);
            } else if deck.spacing.is_some() {
                (sampled, spacing) = of.sampled(deck.spacing);
            }
            let sampled = sampled.map(|surface| {
                let surface = match grid.lines() {
                    Some(lines) if !is_at_sides => surface.cut_at_graded_lines(lines.axes()),
                    _ => surface,
                };
                let in_cells = in_cells(grid, &surface);
                Surface { in_cells, ..surface }
            });
            match sampled {
                Ok(surface) if surface.is_empty() => {
                    let message =
                        format!("the surface {} selects no part of the boundary", quote(&deck.name));
                    let (body, spacing) = (quote(&deck.body), mpm_files::shortest(spacing));
                    let (at, help) = match deck.part {
                        None => (
                            at,
                            format!(
                                "give a `spacing` below {spacing}, or check the region of the body {body}"
                            ),
                        ),
                        Some(_) => (
                            format!("{at}/part"),
                            format!(
                                "change `part` so that it contains a piece of the boundary of the body {body}, which is \
                                 sampled every {spacing}"
                            ),
                        ),
                    };
                    self.error("D050", &at, message, help);
                }
                Ok(surface) if self.has_no_area(&surface) => {
                    let message =
                        format!("the surface {} lies on the axis and has no area", quote(&deck.name));
                    self.error("D050", &at, message, "remove it: nothing acts on it".to_owned());
                }
                Ok(surface) => surfaces.push(surface),
                Err(error) => {
                    let message = format!("the surface {} cannot be found: {error}", quote(&deck.name));
                    let (at, help) = match error {
                        NoBoundary::NoSide(_) => (
                            format!("{at}/part/edge"),
                            "give the number of an edge of the shape, counted from 0 (not of a union, intersection or difference), or select the part with `box` or `half_space`",
                        ),
                        NoBoundary::Cells => (
                            format!("{at}/body"),
                            "divide the body into a body of shape `cells` and other bodies",
                        ),
                        NoBoundary::TooMany => (at, "give a larger `spacing`"),
                    };
                    self.error("D050", &at, message, help.to_owned());
                }
            }
        }
        surfaces
    }

    /// Notes that the `spacing` of a surface has no effect.
    fn spacing_without_effect(&mut self, surface: &SurfaceDeck, pointer: &str) {
        let message = format!(
            "the `spacing` of the surface {} has no effect: the sides of the domains of the body {} form the surface",
            quote(&surface.name),
            quote(&surface.body)
        );
        let found = Diagnostic::at(&self.loaded.source, "D037", &format!("{pointer}/spacing"), message);
        let help = "remove it: it matters only on curved or oblique sides, for a part that ends within the side of a \
                    domain, and for standard points";
        self.found.push(found.severity(Severity::Note).help(help));
    }

    /// The nodes, in ascending order, of the group that selects a part of a surface; `None` if no group does.
    ///
    /// # Errors
    /// If there is no such group; the error is reported.
    fn nodes_of_part(
        &mut self,
        grid: &dyn Grid<D>,
        surface: &SurfaceDeck,
        pointer: &str,
    ) -> Result<Option<Vec<u32>>, ()> {
        let Some(group) = surface.part.as_ref().and_then(|part| part.group.as_ref()) else { return Ok(None) };
        let mut nodes = self.nodes_of_group(grid, group, &format!("{pointer}/part/group")).ok_or(())?;
        nodes.sort_unstable();
        Ok(Some(nodes))
    }

    /// True if the surface of a body of revolution lies on the axis.
    fn has_no_area(&self, surface: &Surface<D>) -> bool {
        let is_revolved = self.loaded.deck.analysis.idealisation == Idealisation::Axisymmetric;
        is_revolved && surface.corners.iter().all(|x| x[0].abs() <= 1e-9 * surface.cell)
    }

    /// Index of a surface.
    pub(super) fn surface_number(&self, name: &str) -> usize {
        self.loaded.deck.surfaces.iter().position(|surface| surface.name == name).unwrap_or(0)
    }
}

/// What is needed to divide a surface into facets.
pub(super) struct Sampling<'a, const D: usize> {
    pub(super) grid: &'a dyn Grid<D>,
    pub(super) regions: &'a Regions<D>,
    pub(super) region: &'a Region<D>,
    pub(super) body: usize,
    pub(super) part: &'a Part<D>,
    /// The nodes, ascending, of the physical group that selects the surface.
    pub(super) nodes: Option<&'a [u32]>,
    pub(super) deck: &'a SurfaceDeck,
}

impl<const D: usize> Sampling<'_, D> {
    /// The surface in facets of this length or, without one, of a quarter of the smallest cell at the surface; also the
    /// length, [length].
    pub(super) fn sampled(&self, given: Option<f64>) -> (Result<Surface<D>, NoBoundary>, f64) {
        let [_, largest] = cells_between(self.grid, self.region.bounds(), &[]);
        let mut cell = least_of(largest);
        let mut spacing = given.unwrap_or(LENGTH * cell);
        let mut sampled = self.divided([spacing, cell]);
        // The cells at the surface are known once it has been sampled; smaller ones need further samples.
        for _ in 0..ROUNDS {
            let Ok(surface) = &sampled else { break };
            let bounds = bounds_of(surface, self.part, self.region);
            let [smallest, _] = cells_between(self.grid, bounds, &surface.samples);
            cell = least_of(smallest);
            let wanted = given.unwrap_or(LENGTH * cell);
            if (wanted - spacing).abs() <= 1e-9 * spacing {
                break;
            }
            spacing = wanted;
            sampled = self.divided([spacing, cell]);
        }
        (sampled.map(|surface| Surface { cell, ..surface }), spacing)
    }

    /// The surface in facets with edges no longer than `spacing`; `cell` is the size of a cell, both [length].
    fn divided(&self, [spacing, cell]: [f64; 2]) -> Result<Surface<D>, NoBoundary> {
        let Sampling { grid, regions, region, body, part, nodes, deck } = *self;
        let given = region.as_group().map(|(group, motion)| {
            (grid, Cow::Owned(regions.groups.cells(group.key, grid.n_cells())), motion)
        });
        let of_mesh = || region.as_mesh().map(|(mesh, cells, motion)| (mesh, Cow::Borrowed(cells), motion));
        match (given.or_else(of_mesh), part) {
            (None, _) => Surface::new(deck.name.clone(), body, region, part, [spacing, cell]),
            (Some(_), Part::Side(side)) => Err(NoBoundary::NoSide(*side)),
            (Some((mesh, cells, motion)), _) => {
                let facets = boundary_of_cells(mesh, &cells, motion, nodes, spacing)?;
                Ok(Surface::from_facets(deck.name.clone(), body, facets, part, cell))
            }
        }
    }
}

/// Bounds of a surface, extended to the box that selects its part of the body, if any; only the portion of this box
/// within the bounds of the body counts. For an empty surface, this portion alone or, without a box, the bounds of the
/// body.
fn bounds_of<const D: usize>(surface: &Surface<D>, part: &Part<D>, region: &Region<D>) -> [[f64; D]; 2] {
    let whole = region.bounds();
    let [mut low, mut high] =
        if surface.is_empty() { whole } else { [[f64::INFINITY; D], [f64::NEG_INFINITY; D]] };
    for corner in &surface.corners {
        for d in 0..D {
            (low[d], high[d]) = (low[d].min(corner[d]), high[d].max(corner[d]));
        }
    }
    if let Part::Box(min, max) = part {
        // The box around an empty region has no extent to clamp to.
        let within = |d: usize, x: f64| x.max(whole[0][d]).min(whole[1][d]);
        for d in 0..D {
            let [from, to] = [within(d, min[d]), within(d, max[d])];
            [low[d], high[d]] =
                if surface.is_empty() { [from, to] } else { [low[d].min(from), high[d].max(to)] };
        }
    }
    [low, high]
}

/// The shortest and the longest sides, along each axis, of the cells in a box, [length]. On a mesh, the smallest and
/// the largest size of the cells at `places` or, if there are none, at the corners and the middle of the box.
fn cells_between<const D: usize>(
    grid: &dyn Grid<D>,
    bounds: [[f64; D]; 2],
    places: &[[f64; D]],
) -> [[f64; D]; 2] {
    if let Some(lines) = grid.lines() {
        let sizes: [[f64; 2]; D] = std::array::from_fn(|d| {
            // What lies on a grid line lies at the cells on both sides of it.
            let axis = &lines.axes()[d];
            let slack = |x: f64| 1e-6 * axis.size_at(x);
            let is_flat = bounds[1][d] - bounds[0][d] <= slack(bounds[0][d]);
            let [below, above] = if is_flat { bounds.map(|x| slack(x[d])) } else { [0.0; 2] };
            axis.sizes_within(bounds[0][d] - below, bounds[1][d] + above)
        });
        return [0, 1].map(|end| std::array::from_fn(|d| sizes[d][end]));
    }
    let size = |x: &[f64; D]| grid.size(grid.nearest_cell(x) as usize);
    let sizes: Vec<f64> = if places.is_empty() {
        let corner = |k: usize| std::array::from_fn(|d| bounds[k >> d & 1][d]);
        let middle = std::array::from_fn(|d| 0.5 * (bounds[0][d] + bounds[1][d]));
        (0..1usize << D).map(corner).chain([middle]).map(|x| size(&x)).collect()
    } else {
        places.iter().step_by(places.len().div_ceil(PLACES)).map(size).collect()
    };
    let (least, most) =
        (sizes.iter().copied().fold(f64::INFINITY, f64::min), sizes.iter().copied().fold(0.0, f64::max));
    [[least; D], [most; D]]
}

/// The original positions of the corners of a surface in cells, [-]; see [`Surface::in_cells`].
fn in_cells<const D: usize>(grid: &dyn Grid<D>, surface: &Surface<D>) -> Vec<[f64; D]> {
    if let Some(lines) = grid.lines() {
        let coordinates = |x: &[f64; D]| std::array::from_fn(|d| lines.axes()[d].coordinate(x[d]));
        return surface.corners.iter().map(coordinates).collect();
    }
    if surface.is_empty() {
        return Vec::new();
    }
    let [_, largest] = cells_between(grid, [[0.0; D]; 2], &surface.samples);
    surface.corners.iter().map(|x| std::array::from_fn(|d| x[d] / largest[d])).collect()
}

fn least_of<const D: usize>(sides: [f64; D]) -> f64 {
    sides.into_iter().fold(f64::INFINITY, f64::min)
}
