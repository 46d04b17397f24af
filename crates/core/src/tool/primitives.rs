//! Circles, spheres, boxes, cylinders and cones as tools.

use std::f64::consts::FRAC_PI_2;

use super::closest::{Closest, EQUAL, Face, TOUCHING, between_faces};
use super::features::{Feature, FeatureKind, Nearest, on_segment};
use super::revolution::Axis;
use super::shape::{Shape, first_end, largest};
use crate::region::vector::{dot, minus, norm, unit};
use crate::region::{Ball, Bounds, Brick, Facet, Frustum, Line, Primitive, hull};

impl<const D: usize> Shape<D> for Ball<D> {
    fn bounds(&self) -> Bounds<D> {
        [-1.0, 1.0].map(|side| self.center().map(|x| x + side * self.radius()))
    }

    /// At the centre, the normal points along the first axis.
    fn search(&self, x: &[f64; D], _: f64) -> Option<Closest<D>> {
        let from_centre = minus(x, &self.center());
        let centre = if norm(&from_centre) > TOUCHING * largest(&Shape::bounds(self)) {
            Closest::on_corner(x, &from_centre, true, None, 0)
        } else {
            Closest::at_corner(x, unit(0), 0)
        };
        Some(centre.offset(self.radius()))
    }

    fn crossing(&self, path: &[[f64; D]; 2]) -> Option<f64> {
        crossing_of(self, path)
    }

    fn has_edges(&self) -> bool {
        false
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<D>>> {
        // The facets of a sphere are those of an octahedron, moved onto the sphere: in the middle of its faces, edges
        // are up to √6 / (π/2) times as long as the spacing.
        let stretched = if D == 3 { 6f64.sqrt() / FRAC_PI_2 } else { 1.0 };
        Some(Primitive::facets(self, size / stretched))
    }
}

impl<const D: usize> Shape<D> for Brick<D> {
    fn bounds(&self) -> Bounds<D> {
        Brick::bounds(self)
    }

    fn search(&self, x: &[f64; D], _: f64) -> Option<Closest<D>> {
        let [low, high] = Brick::bounds(self);
        // Distance beyond the nearer of the two faces normal to each axis, and the side of that face.
        let beyond: [f64; D] = std::array::from_fn(|d| (low[d] - x[d]).max(x[d] - high[d]));
        let upper = |d: usize| x[d] - high[d] >= low[d] - x[d];
        let most = (0..D).rev().max_by(|&a, &b| beyond[a].total_cmp(&beyond[b])).unwrap_or(0);
        let part = if D == 2 {
            // The sides are numbered counterclockwise from the lower one.
            [[3, 1], [0, 2]][most % 2][usize::from(upper(most))]
        } else {
            2 * most + usize::from(upper(most))
        };
        let outwards = |d: usize| if upper(d) { 1.0 } else { -1.0 };
        let normal = |d: usize| unit::<D>(d).map(|e| e * outwards(d));
        let on_face = Closest::on_plane(x, beyond[most], normal(most), part);
        let touching = TOUCHING * largest(&Brick::bounds(self));
        if beyond[most] <= touching {
            let level = beyond[most] - EQUAL * beyond[most].abs() - touching;
            let others: Vec<[f64; D]> =
                (0..D).filter(|&d| d != most && beyond[d] >= level).map(normal).collect();
            return Some(if others.is_empty() { on_face } else { between_faces(x, &on_face, &others) });
        }
        if (0..D).filter(|&d| beyond[d] > 0.0).count() <= 1 {
            return Some(on_face);
        }
        let offset: [f64; D] = std::array::from_fn(|d| beyond[d].max(0.0) * outwards(d));
        let level = (0..D).find(|&d| beyond[d] <= 0.0).map(unit);
        Some(Closest::on_corner(x, &offset, true, level.as_ref(), part))
    }

    fn faces_near(&self, x: &[f64; D], limit: f64) -> Vec<Face<D>> {
        let [low, high] = Brick::bounds(self);
        let outside = |d: usize| (low[d] - x[d]).max(x[d] - high[d]).max(0.0);
        let face = |number: usize| {
            let (axis, upper) = (number / 2, number % 2 == 1);
            let gap = if upper { x[axis] - high[axis] } else { low[axis] - x[axis] };
            let normal = unit::<D>(axis).map(|e| if upper { e } else { -e });
            let others = (0..D).filter(|d| *d != axis).map(|d| outside(d) * outside(d));
            let mut middle: [f64; D] = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
            middle[axis] = if upper { high[axis] } else { low[axis] };
            let part = if D == 2 { [[3, 1], [0, 2]][axis % 2][usize::from(upper)] } else { number };
            Face {
                closest: Closest::on_plane(x, gap, normal, part),
                beside: others.sum::<f64>().sqrt(),
                middle,
            }
        };
        let is_near = |face: &Face<D>| face.closest.gap.abs() <= limit && face.beside <= limit;
        (0..2 * D).map(face).filter(is_near).collect()
    }

    fn crossing(&self, path: &[[f64; D]; 2]) -> Option<f64> {
        crossing_of(self, path)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<D>>> {
        Some(Primitive::facets(self, size))
    }
}

impl Shape<3> for Frustum {
    fn bounds(&self) -> Bounds<3> {
        let (axis, [lower, upper]) = (axis_of(self), self.radii());
        hull(axis.disc(&[lower, 0.0]), axis.disc(&[upper, self.height()]))
    }

    /// Parts: 0 is the lateral surface, 1 and 2 are the ends.
    fn search(&self, x: &[f64; 3], _: f64) -> Option<Closest<3>> {
        let touching = TOUCHING * largest(&Shape::bounds(self));
        axis_of(self).closest(x, touching, |section| self.closest_of_section(*section, touching))
    }

    fn crossing(&self, path: &[[f64; 3]; 2]) -> Option<f64> {
        crossing_of(self, path)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<3>>> {
        Some(Primitive::facets(self, size))
    }
}

fn axis_of(frustum: &Frustum) -> Axis {
    Axis { start: frustum.start(), direction: frustum.axis() }
}

impl Frustum {
    /// The closest point in the section (r, h) of the surface.
    fn closest_of_section(&self, x: [f64; 2], touching: f64) -> Option<Closest<2>> {
        let ([lower, upper], height) = (self.radii(), self.height());
        let corners = [[0.0, 0.0], [lower, 0.0], [upper, height], [0.0, height]];
        let slant = height.hypot(upper - lower);
        let sides = [
            (0, [corners[1], corners[2]], [height / slant, (lower - upper) / slant]),
            (1, [corners[0], corners[1]], [0.0, -1.0]),
            (2, [corners[2], corners[3]], [0.0, 1.0]),
        ];
        let mut nearest = Nearest::within(f64::INFINITY);
        for (part, ends, normal) in sides.iter().filter(|(_, ends, _)| ends[0] != ends[1]) {
            nearest.offer(on_segment(&x, ends, normal), *part, *part as u32);
        }
        let (Feature { kind, offset, squared }, part, _) = nearest.found?;
        let normal = sides[part].2;
        let found = match kind {
            FeatureKind::Face => Closest::on_plane(&x, dot(&offset, &normal), normal, part),
            _ if squared.sqrt() <= touching => Closest::at_corner(&x, normal, part),
            // The section is convex: a corner can be the closest point only from outside.
            _ => return Some(Closest::on_corner(&x, &offset, true, None, part)),
        };
        let is_equally_near = |(other, ends, normal): &&(usize, [[f64; 2]; 2], [f64; 2])| {
            let difference = dot(&minus(&x, &ends[0]), normal) - found.gap;
            let is_near = difference.abs() <= EQUAL * found.gap.abs() + touching;
            *other != part && ends[0] != ends[1] && found.gap <= touching && is_near
        };
        let others: Vec<[f64; 2]> = sides.iter().filter(is_equally_near).map(|side| side.2).collect();
        Some(if others.is_empty() { found } else { between_faces(&x, &found, &others) })
    }
}

/// The first crossing of a path with the surface of a primitive.
pub(super) fn crossing_of<const D: usize>(
    primitive: &impl Primitive<D>,
    [from, to]: &[[f64; D]; 2],
) -> Option<f64> {
    first_end(&primitive.intervals(&Line { origin: *from, direction: minus(to, from) }))
}
