//! Bodies in contact whose sides do not follow their boundary.

use mpm_core::grid::MAX_CORNERS;
use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::region::Region;
use mpm_core::surface::{OuterSides, corners_of, sides_of_domain};

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};

/// Distance within which a side lies on the boundary, relative to the size of a cell, [-].
const ON_BOUNDARY: f64 = 0.05;
/// Largest share of the surface that may lie elsewhere without a warning, [-].
const MAX_SHARE: f64 = 0.05;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Warns of bodies in contact whose outer sides are a staircase: other bodies catch on its steps.
    pub(super) fn contact_outlines(&mut self, model: &Model<D>, points: &Points<D>, regions: &Regions<D>) {
        let is_in_contact = |body: usize| model.contacts.iter().any(|pair| pair.bodies.contains(&body));
        let judged: Vec<usize> = (0..model.bodies.len()).filter(|&body| is_in_contact(body)).collect();
        if judged.is_empty() {
            return;
        }
        let mut outer = OuterSides::default();
        outer.find(points, &points.reduction());
        for body in judged {
            let share = share_beside(model, points, &outer, body, &regions.bodies[body]);
            if share > MAX_SHARE {
                self.is_staircase(body, share);
            }
        }
    }

    fn is_staircase(&mut self, body: usize, share: f64) {
        let deck = &self.deck.bodies[body];
        let message = format!(
            "{:.0} % of the surface of the body {}, which is in contact, is a staircase beside its boundary: other bodies \
             bear and catch on its steps",
            100.0 * share,
            quote(&deck.name)
        );
        let at = format!("/bodies/{body}/shape");
        let found = Diagnostic::at(&self.loaded.source, "D078", &at, message).severity(Severity::Warning);
        self.found.push(found.help(
            "use `method: cpdi2`, whose domains follow the boundary; or a boundary along lines of the grid, or of a mesh",
        ));
    }
}

/// The share of the area of the outer sides of a body that do not lie on the boundary of its region, [-]; 0 if the region
/// is made of cells of the grid.
fn share_beside<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    outer: &OuterSides,
    body: usize,
    region: &Region<D>,
) -> f64 {
    let mut buffer = [[0.0; D]; MAX_CORNERS];
    let [mut beside, mut all] = [0.0; 2];
    for p in (0..points.len()).filter(|&p| usize::from(points.body[p]) == body) {
        let mask = outer.of_point(points.id[p]);
        if mask == 0 || !region.contains(&points.converged.position[p]) {
            continue;
        }
        let corners = corners_of(points, p, &mut buffer);
        let reach = ON_BOUNDARY * model.grid.size(points.cell[p] as usize);
        for (_, side) in sides_of_domain::<D>(corners.len()).enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
            let (centre, area) = (side.centre(corners), side.area(corners));
            let size = area.iter().map(|a| a * a).sum::<f64>().sqrt();
            let at = |distance: f64| -> [f64; D] {
                std::array::from_fn(|d| centre[d] + distance * area[d] / size)
            };
            all += size;
            if size > 0.0 && (region.contains(&at(reach)) || !region.contains(&at(-reach))) {
                beside += size;
            }
        }
    }
    if all > 0.0 { beside / all } else { 0.0 }
}
