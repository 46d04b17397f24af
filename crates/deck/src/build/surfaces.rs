//! Samples the surfaces of a deck.

use mpm_core::grid::Grid;
use mpm_core::region::{NoBoundary, Region};
use mpm_core::surface::{Part, Surface, boundary_of_cells};

use super::Builder;
use crate::per_axis::array;
use crate::placing;
use crate::quoting::quote;
use crate::region::{Groups, OfDeck};
use crate::{BoxDeck, HalfSpaceDeck, Idealisation, PartDeck, SurfaceDeck};

/// Length of the samples of a surface relative to the smallest cell at the surface, [-].
const LENGTH: f64 = 0.25;
/// On a mesh, cells are looked up at about this many samples of a surface.
const PLACES: usize = 200;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: OfDeck<D>,
{
    /// Samples all surfaces, given the regions of the bodies.
    pub(super) fn surfaces(
        &mut self,
        grid: &dyn Grid<D>,
        (regions, groups): (&[Region<D>], &Groups),
    ) -> Vec<Surface<D>> {
        let mut surfaces = Vec::new();
        for (index, deck) in self.loaded.deck.surfaces.iter().enumerate() {
            let body = self.body_number(&deck.body);
            let Some(region) = regions.get(body) else { continue };
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
            let cell = cell_at(grid, region);
            let mut spacing = deck.spacing.unwrap_or(LENGTH * cell);
            let at = format!("/surfaces/{index}");
            let by_group = deck.part.as_ref().is_some_and(|part| part.group.is_some());
            if by_group && region.as_group().is_none() {
                let message = format!(
                    "the body {} of the surface {} has no cells",
                    quote(&deck.body),
                    quote(&deck.name)
                );
                let help = "give the body the shape `cells`, or select the part by `box` or `half_space`";
                self.error("D050", &format!("{at}/part/group"), message, help.to_owned());
                continue;
            }
            let Ok(nodes) = self.nodes_of_part(grid, deck, &at) else { continue };
            let sample = |spacing: f64| match (region.as_group(), &part) {
                (None, _) => Surface::new(deck.name.clone(), body, region, &part, [spacing, cell]),
                (Some(_), Part::Side(side)) => Err(NoBoundary::NoSide(*side)),
                (Some((group, motion)), _) => {
                    let cells = groups.cells(group.key, grid.n_cells());
                    let facets = boundary_of_cells(grid, &cells, motion, nodes.as_deref(), spacing)?;
                    Ok(Surface::of_facets(deck.name.clone(), body, facets, &part, cell))
                }
            };
            let mut sampled = sample(spacing);
            // The cells at the surface are known once it has been sampled.
            if let Ok([least, most]) = sampled.as_ref().map(|surface| sides_at(grid, surface))
                && least[0].is_finite()
            {
                let finest = LENGTH * least.into_iter().fold(f64::INFINITY, f64::min);
                if deck.spacing.is_none() && finest < spacing {
                    spacing = finest;
                    sampled = sample(spacing);
                }
                sampled = sampled.map(|surface| Surface { cell: most, ..surface });
            }
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
                            "give the number of an edge of a single shape, counted from 0, or select the part with `box` or `half_space`",
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
        let Some(name) = surface.part.as_ref().and_then(|part| part.group.as_ref()) else { return Ok(None) };
        let Some(nodes) = grid.node_set(name) else {
            let (message, help) = placing::unknown_group(grid, name, false);
            self.error("D031", &format!("{pointer}/part/group"), message, help);
            return Err(());
        };
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        Ok(Some(nodes))
    }

    /// True if the surface of a body of revolution lies on the axis.
    fn has_no_area(&self, surface: &Surface<D>) -> bool {
        let is_revolved = self.loaded.deck.analysis.idealisation == Idealisation::Axisymmetric;
        is_revolved && surface.corners.iter().all(|x| x[0].abs() <= 1e-9 * surface.cell_size())
    }

    /// Index of a surface.
    pub(super) fn surface_number(&self, name: &str) -> usize {
        self.loaded.deck.surfaces.iter().position(|surface| surface.name == name).unwrap_or(0)
    }
}

/// Size of the smallest cell at the corners and the middle of the box around a region, [length].
fn cell_at<const D: usize>(grid: &dyn Grid<D>, region: &Region<D>) -> f64 {
    let bounds = region.bounds();
    let corner = |k: usize| std::array::from_fn(|d| bounds[k >> d & 1][d]);
    let middle = std::array::from_fn(|d| 0.5 * (bounds[0][d] + bounds[1][d]));
    let places = (0..1usize << D).map(corner).chain([middle]);
    let sizes = places.map(|x: [f64; D]| grid.size(grid.nearest_cell(&x) as usize));
    sizes.fold(f64::INFINITY, f64::min)
}

/// The shortest and the longest sides, along each axis, of the cells in the box around a surface or, on a mesh, of the
/// cells at its samples, [length]; infinite and zero if the surface is empty.
fn sides_at<const D: usize>(grid: &dyn Grid<D>, surface: &Surface<D>) -> [[f64; D]; 2] {
    let (mut least, mut most) = ([f64::INFINITY; D], [0.0; D]);
    if surface.is_empty() {
        return [least, most];
    }
    if let Some(grid) = grid.structured() {
        for d in 0..D {
            let along = || surface.corners.iter().map(|x| x[d]);
            let (low, high) =
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
            // A surface on a grid line lies at the cells on both sides of it.
            let slack = if high - low > surface.cell[d] * 1e-6 { 0.0 } else { surface.cell[d] * 1e-6 };
            [least[d], most[d]] = grid.axes()[d].sizes_within(low - slack, high + slack);
        }
        return [least, most];
    }
    for x in surface.samples.iter().step_by(surface.len().div_ceil(PLACES)) {
        let size = grid.size(grid.nearest_cell(x) as usize);
        (least, most) = (least.map(|least| least.min(size)), most.map(|most: f64| most.max(size)));
    }
    [least, most]
}
