//! Surfaces that no sides of domains form, such as those of standard points and staircases of boxes: how far the forces on
//! a surface are from those of a uniform stress in the points.

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};
use mpm_core::basis::{Connectivity, DomainKind, Method};
use mpm_core::grid::Grid;
use mpm_core::model::Body;
use mpm_core::points::Points;
use mpm_core::region::{Region, area_vector};
use mpm_core::surface::{Carried, Part, SideRule, Surface};

use super::surfaces::Sampling;

/// Largest difference between the forces on a surface and those of a uniform stress that causes no warning, [-].
const MAX_DIFFERENCE: f64 = 0.05;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Warns of surfaces on which loads or conditions act and whose forces on the grid differ from those of a uniform
    /// stress in the points. Only surfaces that were sampled without faults are judged.
    pub(super) fn formed_surfaces(
        &mut self,
        grid: &dyn Grid<D>,
        regions: &Regions<D>,
        points: &Points<D>,
        bodies: &[Body],
        surfaces: &[Surface<D>],
    ) {
        // Domains given by their corners follow the outline. In bodies of revolution, boxes are out of balance inside as
        // well, which another warning says.
        let is_judged = |surface: &&Surface<D>| {
            let is_formed = match bodies[surface.body].method.domain() {
                DomainKind::None => false,
                DomainKind::Box => surface.rule == SideRule::Integral || self.is_revolved(),
                DomainKind::Corners => true,
            };
            self.is_used(&surface.name) && !is_formed
        };
        let judged: Vec<&Surface<D>> = surfaces.iter().filter(is_judged).collect();
        if judged.is_empty() {
            return;
        }
        let methods: Vec<_> = bodies.iter().map(|body| body.method).collect();
        // A point that finds no place is reported when the first step is set up.
        let mut points = points.clone();
        let Ok(links) = Connectivity::new(grid, &mut points, &methods) else { return };
        for surface in judged {
            let Some(whole) = self.whole(grid, regions, surface) else { continue };
            let forces = [surface, &whole].map(|surface| self.forces_of_surface(grid, &links, surface));
            let [Some(acting), Some(all)] = forces else { continue };
            let uniform = self.forces_of_points(&points, &links, surface.body);
            let size = |f: &[f64; D]| f.iter().map(|f| f * f).sum::<f64>().sqrt();
            let mut sums = [0.0; 2];
            for node in (0..links.n_active()).filter(|&node| links.reduction().counts(node)) {
                if acting[node] != [0.0; D] {
                    sums[0] += size(&std::array::from_fn(|d| uniform[node][d] - all[node][d]));
                    sums[1] += size(&acting[node]);
                }
            }
            let [difference, total] = sums.map(|sum| points.ranks.total(sum));
            if total > 0.0 && difference > MAX_DIFFERENCE * total {
                self.not_formed(surface, bodies[surface.body].method, difference / total);
            }
        }
    }

    /// True if a load or a condition acts on a surface.
    fn is_used(&self, name: &str) -> bool {
        let deck = self.deck;
        deck.loads.iter().any(|load| load.surface() == Some(name))
            || deck.boundary_conditions.iter().any(|condition| condition.surface.as_deref() == Some(name))
    }

    /// The whole boundary of the body of a surface, with samples of the same length; `None` if it is not available.
    fn whole(&self, grid: &dyn Grid<D>, regions: &Regions<D>, surface: &Surface<D>) -> Option<Surface<D>> {
        let deck = &self.deck.surfaces[self.surface_number(&surface.name)];
        let region = &regions.bodies[surface.body];
        let (body, part, nodes) = (surface.body, &Part::Whole, None);
        Sampling { grid, regions, region, body, part, nodes, deck }.sampled(deck.spacing).0.ok()
    }

    /// Σ N_v n a over the samples, at each active node, [length^(D−1)]; `None` if the grid does not carry the surface.
    /// All ranks must call this together.
    fn forces_of_surface(
        &self,
        grid: &dyn Grid<D>,
        links: &Connectivity<D>,
        surface: &Surface<D>,
    ) -> Option<Vec<[f64; D]>> {
        let mut carried = Carried::new(surface, self.is_revolved());
        let found = match self.ranks.is_alone() {
            true => Ok(()),
            false => carried.find(grid, links),
        };
        if self.ranks.any(found.and_then(|()| carried.locate(grid, links)).is_err()) {
            return None;
        }
        let mut forces = vec![[0.0; D]; links.n_active()];
        for sample in carried.own_samples() {
            let corners = surface.facet(sample);
            let depth =
                if self.is_revolved() { std::f64::consts::TAU * surface.samples[sample][0] } else { 1.0 };
            carried.spread(sample, &area_vector(&corners).map(|a| depth * a), &mut forces);
        }
        links.reduction().complete(&mut forces);
        Some(forces)
    }

    /// Σ V_p ∇S_vp over the points of a body, at each active node, [length^(D−1)]: the forces of a uniform unit pressure
    /// in the body, seen from outside. All ranks must call this together.
    fn forces_of_points(&self, points: &Points<D>, links: &Connectivity<D>, body: usize) -> Vec<[f64; D]> {
        let mut forces = vec![[0.0; D]; links.n_active()];
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            for p in links.points_of(group).filter(|&p| usize::from(points.body[p]) == body) {
                let volume = points.original_volume[p];
                links.for_each_link(p, |place, value, gradient| {
                    let force = &mut forces[nodes[place] as usize];
                    (0..D).for_each(|d| force[d] += volume * gradient[d]);
                    if self.is_revolved() {
                        force[0] += volume * value / points.converged.position[p][0];
                    }
                });
            }
        }
        links.reduction().complete(&mut forces);
        forces
    }

    fn not_formed(&mut self, surface: &Surface<D>, method: Method, difference: f64) {
        let subject = match method.domain() {
            DomainKind::None => "standard points have no sides",
            DomainKind::Box | DomainKind::Corners => "the sides of the domains do not form the surface",
        };
        let message = format!(
            "{subject}: at the surface {}, the forces of a uniform stress in the body {} differ by {:.0} % from those of its \
             tractions",
            quote(&surface.name),
            quote(&self.deck.bodies[surface.body].name),
            100.0 * difference
        );
        let at = format!("/surfaces/{}", self.surface_number(&surface.name));
        let found = Diagnostic::at(&self.loaded.source, "D074", &at, message);
        let is_mesh = matches!(self.deck.grid, crate::GridDeck::Gmsh { .. });
        let help = match method.domain() {
            DomainKind::None if is_mesh => "use `method: cpdi2` for this body, whose domains have sides",
            DomainKind::None => {
                "use `method: gimp` or `method: cpdi2` for this body, whose domains have sides"
            }
            DomainKind::Box | DomainKind::Corners => {
                "use `method: cpdi2` for this body, whose domains follow its outline"
            }
        };
        self.found.push(found.severity(Severity::Warning).help(help));
    }
}
