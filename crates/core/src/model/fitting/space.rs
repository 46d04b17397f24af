//! Domains fitted to the boundary of a body in space.
//!
//! Corners of a lattice near the boundary move onto it: onto corners where three faces meet, then onto edges, then onto
//! faces, as long as no cell of the lattice becomes too flat ([`warp`]). Cells that no face divides any more are
//! domains, hexahedra, if they lie inside. Each of the others is divided into pyramids and tetrahedra around a position
//! on the faces in it, or its centre ([`pieces`]), which are then cut along the faces ([`cut`]). All these share their
//! corners with their neighbours, triangles lie next to triangles and quadrilaterals next to quadrilaterals, so that a
//! uniform stress is in equilibrium with the tractions on the outer sides.

mod collapse;
mod curved;
mod cut;
mod domain;
mod faces;
mod halves;
mod inside;
mod lattice;
mod near;
mod pieces;
mod warp;

use crate::grid::Lines;
use crate::region::Region;
use inside::Inside;
use lattice::Fitting;

pub(in crate::model) use domain::{NotFitted, SolidDomain, SolidDomains};

/// The domains inside a region, in the order of the cells of a lattice.
pub(in crate::model) fn fitted_in_space(
    region: &Region<3>,
    lines: &Lines<3>,
) -> Result<SolidDomains, NotFitted> {
    let mut fitting = Fitting::new(region, lines)?;
    let near = fitting.near.clone();
    let first = fitting.fitted()?;
    if !fitting.shift_curved_faces(&first) {
        return fitting.domains(&first);
    }
    fitting.near = near;
    fitting.put_back();
    let second = fitting.fitted()?;
    fitting.domains(&second)
}

impl Fitting<'_> {
    /// The pieces inside the region.
    fn fitted(&mut self) -> Result<Inside, NotFitted> {
        let near = self.near.clone();
        loop {
            self.warp();
            self.find_faces_in_cells();
            match self.divided() {
                Ok(divided) => return Ok(self.inside(divided)),
                Err(cells) => self.keep_corners(&cells)?,
            }
            self.near.clone_from(&near);
        }
    }
}

#[cfg(test)]
mod tests;
