//! Samples the surfaces of a deck.

use mpm_core::grid::Grid;
use mpm_core::region::{NoBoundary, Region};
use mpm_core::surface::{Part, Surface};

use super::Builder;
use crate::per_axis::array;
use crate::quoting::quote;
use crate::region::OfDeck;
use crate::{BoxDeck, HalfSpaceDeck, PartDeck};

/// Length of the samples of a surface relative to the smallest cell at the body, [-].
const LENGTH: f64 = 0.25;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: OfDeck<D>,
{
    /// Samples all surfaces, given the regions of the bodies.
    pub(super) fn surfaces(&mut self, grid: &dyn Grid<D>, regions: &[Region<D>]) -> Vec<Surface<D>> {
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
                Some(PartDeck { edge, .. }) => Part::Side(edge.unwrap_or_default() as usize),
            };
            let cell = cell_at(grid, region);
            let spacing = deck.spacing.unwrap_or(LENGTH * cell);
            let at = format!("/surfaces/{index}");
            match Surface::new(deck.name.clone(), body, region, &part, [spacing, cell]) {
                Ok(surface) if surface.is_empty() => {
                    let message =
                        format!("the surface {} selects nothing of the boundary", quote(&deck.name));
                    let help = format!(
                        "change `part` so that it contains a piece of the boundary of the body {}, whose samples are {} long",
                        quote(&deck.body),
                        mpm_files::shortest(spacing)
                    );
                    let at = if deck.part.is_some() { format!("{at}/part") } else { at };
                    self.error("D050", &at, message, help);
                }
                Ok(surface) => surfaces.push(surface),
                Err(error) => {
                    let message = format!("the surface {} cannot be sampled: {error}", quote(&deck.name));
                    let (at, help) = match error {
                        NoBoundary::NoSide(_) => (
                            format!("{at}/part/edge"),
                            "give the number of a side of a single shape, from 0, or select the part by `box` or `half_space`",
                        ),
                        NoBoundary::Cells => {
                            (format!("{at}/body"), "give the body a shape other than `cells`")
                        }
                        NoBoundary::TooMany => (at, "give a larger `spacing`"),
                    };
                    self.error("D050", &at, message, help.to_owned());
                }
            }
        }
        surfaces
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
