//! The points of a body nearest to a location, for point forces and probes.

use std::collections::BTreeMap;

use super::{Builder, Placing};
use crate::Parameter;
use crate::diagnostic::{Diagnostic, Severity};
use crate::formulas::Fault;
use crate::gates::{Builds, NearestPoints, Ties};
use crate::per_axis::array;
use crate::quoting::{counted, quote};
use crate::region::DeckRegion;
use mpm_core::grid::Grid;
use mpm_core::points::{Points, coordinates};
use mpm_core::region::Region;

/// Distances that differ by less than this fraction of the cell size count as equal.
const SAME: f64 = 1e-9;

impl<const D: usize> Builds for Placing<'_, '_, D>
where
    Region<D>: DeckRegion<D>,
{
    fn parameters(&self) -> &BTreeMap<String, Parameter> {
        &self.builder.loaded.parameters
    }

    fn faulty_formulas(&mut self, pointer: &str, faults: Vec<Fault>) {
        self.builder.faulty_formulas(pointer, faults);
    }

    fn surface_number(&self, name: &str) -> usize {
        self.builder.surface_number(name)
    }

    fn nearest(&mut self, body: &str, wanted: NearestPoints, pointer: &str) -> Vec<u32> {
        self.builder.nearest(self.grid, self.points, body, wanted, pointer)
    }
}

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Permanent numbers of the points of a body nearest to a location.
    pub(super) fn nearest(
        &mut self,
        grid: &dyn Grid<D>,
        points: &Points<D>,
        body: &str,
        wanted: NearestPoints,
        pointer: &str,
    ) -> Vec<u32> {
        let NearestPoints { place, count, ties } = wanted;
        let number = self.body_number(body) as u16;
        let at = array(place);
        let (mut found, clear) = points.nearest(number, &at, count as usize);
        if ties == Ties::All && !found.is_empty() {
            let cell = grid.size(grid.nearest_cell(&array(&found[0].position)) as usize);
            found = points.nearest_with_ties(number, &at, count as usize, SAME * cell);
        }
        if found.len() < count as usize {
            let points = counted(found.len(), "point", "points");
            let message = format!("the body {} has only {points}", quote(body));
            self.error("D030", &format!("{pointer}/count"), message, "lower `count`".to_owned());
        } else if !clear && ties == Ties::Refused {
            let at = coordinates(place);
            let message = match count {
                1 => format!("several points are equally near {at}"),
                _ => format!(
                    "the {count} points nearest to {at} are not unique, because others are equally near"
                ),
            };
            let help =
                "change `count`, or move the location so that the nearest points are unique".to_owned();
            self.error("D030", &format!("{pointer}/nearest"), message, help);
        } else if let Some(first) = found.first() {
            self.distance(grid, body, &array(place), &array(&first.position), pointer);
        }
        found.into_iter().map(|near| near.id).collect()
    }

    /// Warns of a point that is far from the requested location.
    fn distance(
        &mut self,
        grid: &dyn Grid<D>,
        body: &str,
        place: &[f64; D],
        found: &[f64; D],
        pointer: &str,
    ) {
        let distance = length::<D>(std::array::from_fn(|d| found[d] - place[d]));
        let cell = grid.diagonal(grid.nearest_cell(found) as usize);
        if distance > cell {
            // As many digits as matter: a mistyped location may be at any distance.
            let away = if distance < 1e9 { format!("{distance:.3}") } else { format!("{distance:.3e}") };
            let message = format!(
                "the point of the body {} nearest to this location is at {}: it is {away} away, more than the size \
                 of a cell",
                quote(body),
                coordinates(found)
            );
            let found = Diagnostic::at(&self.loaded.source, "D041", &format!("{pointer}/nearest"), message);
            self.found
                .push(found.severity(Severity::Warning).help("give a location inside the undeformed body"));
        }
    }
}

fn length<const D: usize>(vector: [f64; D]) -> f64 {
    vector.iter().fold(0.0, |length: f64, x| length.hypot(*x))
}
