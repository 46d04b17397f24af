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

/// Length of the samples of a surface relative to the smallest cell at the body, [-].
const LENGTH: f64 = 0.25;

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
            let spacing = deck.spacing.unwrap_or(LENGTH * cell);
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
            let sampled = match region.as_group() {
                None => Surface::new(deck.name.clone(), body, region, &part, [spacing, cell]),
                Some((group, motion)) => {
                    let Ok(nodes) = self.nodes_of_part(grid, deck, &at) else { continue };
                    if let Part::Side(side) = part {
                        Err(NoBoundary::NoSide(side))
                    } else {
                        let cells = groups.cells(group.key, grid.n_cells());
                        boundary_of_cells(grid, &cells, motion, nodes.as_deref(), spacing)
                            .map(|facets| Surface::of_facets(deck.name.clone(), body, facets, &part, cell))
                    }
                }
            };
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
                    let message = format!("the surface {} cannot be sampled: {error}", quote(&deck.name));
                    let (at, help) = match error {
                        NoBoundary::NoSide(_) => (
                            format!("{at}/part/edge"),
                            "give the number of a side of a single shape, counted from 0, or select the part with `box` or `half_space`",
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
        is_revolved && surface.corners.iter().all(|x| x[0].abs() <= 1e-9 * surface.cell)
    }

    /// Index of a surface.
    pub(super) fn surface_number(&self, name: &str) -> usize {
        self.loaded.deck.surfaces.iter().position(|surface| surface.name == name).unwrap_or(0)
    }
}

/// Size of the smallest cell in the box around a region, or on a mesh, at the corners and the middle of this box,
/// [length].
fn cell_at<const D: usize>(grid: &dyn Grid<D>, region: &Region<D>) -> f64 {
    let bounds = region.bounds();
    if let Some(grid) = grid.structured() {
        let smallest = |d: usize| grid.axes()[d].smallest_within(bounds[0][d], bounds[1][d]);
        return (0..D).map(smallest).fold(f64::INFINITY, f64::min);
    }
    let corner = |k: usize| std::array::from_fn(|d| bounds[k >> d & 1][d]);
    let middle = std::array::from_fn(|d| 0.5 * (bounds[0][d] + bounds[1][d]));
    let places = (0..1usize << D).map(corner).chain([middle]);
    let sizes = places.map(|x: [f64; D]| grid.size(grid.nearest_cell(&x) as usize));
    sizes.fold(f64::INFINITY, f64::min)
}
