//! Bodies that probably lock: nearly incompressible, or in plastic flow at constant volume, with the standard treatment
//! of volumetric deformation.

use super::Check;
use crate::diagnostic::{Diagnostic, Severity};
use crate::per_axis::per_axis;
use crate::quoting::{list, quote};
use crate::span::escape;
use crate::{BodyDeck, CellStrain, Deck, Drainage, GridDeck, PerAxis};

/// Smallest dilation angle at which a mean dilatation leaves a considerable part of the locking, [degrees].
const CONSIDERABLE: f64 = 10.0;

/// Smallest Poisson's ratio at which low-order cells lock.
const NEARLY_INCOMPRESSIBLE: f64 = 0.49;

impl Check<'_> {
    /// Reports materials whose elasticity or flow locks the cells of their bodies.
    pub(super) fn locking(&mut self) {
        let deck = self.deck;
        for (name, material) in &deck.materials {
            // Nothing is known about the law of a library before the library is loaded.
            let poisson = material.poisson().unwrap_or(0.0);
            let bodies = standard_bodies(deck, name);
            if material.drainage() == Some(Drainage::Undrained)
                && bodies.iter().any(|(_, body)| self.key_of_single_points(body).is_none())
            {
                let message = format!(
                    "without drainage the material {} is nearly incompressible, and low-order cells lock: they are too \
                     stiff, with pore pressures that oscillate from point to point",
                    quote(name)
                );
                let help = "use `strain: mean-dilatation` for the bodies of this material";
                self.warn("D039", &format!("/materials/{}/drainage", escape(name)), message, help);
                continue;
            }
            if poisson >= NEARLY_INCOMPRESSIBLE
                && bodies.iter().any(|(_, body)| self.key_of_single_points(body).is_none())
            {
                let message = format!(
                    "with Poisson's ratio {poisson} the material {} is nearly incompressible, and low-order \
                     cells lock: they are too stiff, with stresses that oscillate from point to point",
                    quote(name)
                );
                let help = "use `strain: mean-dilatation` for the bodies of this material";
                self.warn("D039", &format!("/materials/{}/poisson", escape(name)), message, help);
            } else if material.flows_at_constant_volume() {
                self.isochoric_flow(name);
            } else if material.dilation_angle() >= CONSIDERABLE {
                self.dilating_flow(name);
            }
        }
    }

    /// Notes that bodies of a material that flows at constant volume probably lock, unless the deck asks for the
    /// standard treatment, or a single point per cell leaves the cells free to deform.
    fn isochoric_flow(&mut self, material: &str) {
        let mut bodies = standard_bodies(self.deck, material);
        bodies.retain(|(number, body)| {
            !self.is_chosen(*number, body) && self.key_of_single_points(body).is_none()
        });
        let flow = "flows plastically at constant volume, which locks the cells of";
        let help =
            "use `strain: mean-dilatation`; `strain: standard` keeps the formulation and omits this note";
        self.locking_flow(material, &bodies, flow, help);
    }

    /// Notes that bodies of a material whose flow dilates probably lock, with the mean dilatation as well, unless the
    /// deck asks for the standard treatment, a parameter chooses one, or cells hold a single point.
    fn dilating_flow(&mut self, material: &str) {
        let mut bodies = bodies_of(self.deck, material);
        bodies.retain(|(number, body)| {
            let at = format!("/bodies/{number}/{}", body.strain_key());
            let locks = match body.strain() {
                CellStrain::Standard => !self.is_chosen(*number, body),
                CellStrain::MeanDilatation | CellStrain::FBar => !self.source.is_from_parameter(&at),
                CellStrain::Mean => false,
            };
            locks && self.key_of_single_points(body).is_none()
        });
        let flow = "dilates as it flows plastically, which locks the cells of";
        let help = "use `strain: mean`; a mean dilatation alone leaves capacities 20 to 30 % too large with 8 cells \
                    across a footing";
        self.locking_flow(material, &bodies, flow, help);
    }

    /// True if the deck states the deformation that the law sees in a body.
    fn is_chosen(&self, number: usize, body: &BodyDeck) -> bool {
        self.source.span_of(&format!("/bodies/{number}/{}", body.strain_key())).is_some()
    }

    /// Notes that the flow of a material locks the cells of some bodies.
    fn locking_flow(&mut self, material: &str, bodies: &[(usize, &BodyDeck)], flow: &str, help: &str) {
        if bodies.is_empty() {
            return;
        }
        let message = format!(
            "the material {} {flow} {}: limit loads are probably too large",
            quote(material),
            list(bodies.iter().map(|(_, body)| body.name.as_str()))
        );
        let at = format!("/materials/{}/model", escape(material));
        let found = Diagnostic::at(self.source, "D056", &at, message).severity(Severity::Note);
        self.found.push(found.help(help));
    }

    /// The key that gives a body one point per cell, at its centre; `None` if cells hold several, or are triangles or
    /// tetrahedra.
    pub(super) fn key_of_single_points(&mut self, body: &BodyDeck) -> Option<&'static str> {
        let dimensions = self.deck.dimensions();
        let single_of =
            |counts: &PerAxis<u32>| per_axis::<u32, 3>(counts).iter().take(dimensions).all(|n| *n == 1);
        let per_simplex = body.points_per_triangle.or(body.points_per_tetrahedron);
        match (&self.deck.grid, &body.points_per_cell, &body.point_spacing) {
            (GridDeck::Gmsh { .. }, Some(counts), _) if per_simplex.is_none() => {
                single_of(counts).then_some("points_per_cell")
            }
            (GridDeck::Structured { .. }, Some(counts), _) => single_of(counts).then_some("points_per_cell"),
            (GridDeck::Structured { .. }, None, Some(spacing)) => {
                let (grid, points) = (self.grid()?, per_axis::<f64, 3>(spacing));
                let extent = self.bounds("", &body.shape).unwrap_or_else(|_| grid.extent.clone());
                let cell = |d: usize| grid.axes[d].smallest_within(extent.min[d], extent.max[d]);
                let is_coarse = |d: usize| points[d] > 0.99 * cell(d);
                (0..dimensions).all(is_coarse).then_some("point_spacing")
            }
            _ => None,
        }
    }
}

/// The bodies that have a material from the start or from a stage on, each with its number.
fn bodies_of<'a>(deck: &'a Deck, material: &str) -> Vec<(usize, &'a BodyDeck)> {
    let is_of = |(_, body): &(usize, &BodyDeck)| {
        let in_a_stage = || deck.stages.iter().filter_map(|stage| stage.material.get(&body.name));
        body.material == material || in_a_stage().any(|name| name == material)
    };
    deck.bodies.iter().enumerate().filter(is_of).collect()
}

/// Those of these bodies with the standard treatment.
fn standard_bodies<'a>(deck: &'a Deck, material: &str) -> Vec<(usize, &'a BodyDeck)> {
    let mut bodies = bodies_of(deck, material);
    bodies.retain(|(_, body)| body.strain() == CellStrain::Standard);
    bodies
}
