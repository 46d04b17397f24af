//! The smooth faces of a region in space.

use std::collections::HashMap;

use super::boundary::{indexed, triangle};
use super::level::{FacetLevel, Level, Triangle};
use super::vector::{dot, minus, norm};
use super::{Facet, Primitive, Region, area_vector};

/// Smallest cosine of the angle between facets in one plane, [-].
const PARALLEL: f64 = 1.0 - 1e-12;
/// Smallest cosine of the angle between facets of a smooth face, [-]: 30°.
const SMOOTH: f64 = 0.866;
/// Width of a plane face below which it belongs to a smooth face, relative to the size of a domain, [-].
const NARROW: f64 = 0.75;

/// A smooth piece of the boundary of a region.
#[derive(Debug, Clone)]
pub struct Face {
    /// The surface on which it lies.
    pub level: Level,
    /// Small facets that show where it is, [length].
    pub facets: Vec<[[f64; 3]; 3]>,
}

/// The surfaces on which the sides of a primitive in space lie.
#[derive(Debug, Clone, Default)]
pub enum Levels {
    /// They are not known.
    #[default]
    Unknown,
    /// Plane facets, which meet at all their edges.
    Plane,
    /// The surface of each side of [`Primitive::facets`].
    Curved(Vec<Level>),
}

impl Region<3> {
    /// The smooth faces of the boundary, with facets about as long as `spacing`, for domains of the size `size`, both
    /// [length]. Narrow facets that meet at small angles form one face. `None` if the faces of a part are not known.
    pub fn faces(&self, spacing: f64, size: f64) -> Option<Vec<Face>> {
        let mut all = Some(Vec::new());
        if self.has_groups() {
            return None;
        }
        self.each_primitive(&mut |primitive, motion| {
            let scale = motion.scale();
            let found = faces(primitive, spacing / scale, size / scale);
            let moved = |face: Face| Face {
                level: face.level.moved(motion),
                facets: face.facets.iter().map(|facet| facet.each_ref().map(|x| motion.apply(x))).collect(),
            };
            match (&mut all, found) {
                (Some(all), Some(found)) => all.extend(found.into_iter().map(moved)),
                _ => all = None,
            }
        });
        let mut all = all?;
        if !self.has_numbered_sides() {
            for face in &mut all {
                face.facets.retain(|corners| self.outward(Facet { corners: *corners, side: 0 }).is_some());
            }
            all.retain(|face| !face.facets.is_empty());
        }
        Some(all)
    }
}

fn faces(primitive: &dyn Primitive<3>, spacing: f64, size: f64) -> Option<Vec<Face>> {
    match primitive.levels() {
        Levels::Unknown => None,
        Levels::Plane => {
            let facets = primitive.facets(f64::INFINITY);
            let whole: Vec<Triangle> = facets.iter().map(|facet| facet.corners).collect();
            Some(plane_faces(&whole, spacing, size))
        }
        Levels::Curved(levels) => {
            let mut found: Vec<Face> =
                levels.into_iter().map(|level| Face { level, facets: Vec::new() }).collect();
            for facet in primitive.facets(spacing) {
                found.get_mut(facet.side)?.facets.push(facet.corners);
            }
            Some(found)
        }
    }
}

/// The faces of a polyhedron: facets in one plane, and narrow planes that meet at small angles.
fn plane_faces(facets: &[Triangle], spacing: f64, size: f64) -> Vec<Face> {
    let normals: Vec<[f64; 3]> = (facets.iter())
        .map(|facet| {
            let area = area_vector(facet);
            area.map(|a| a / norm(&area))
        })
        .collect();
    let edges = shared_edges(facets);
    let mut groups = Groups { parent: (0..facets.len()).collect() };
    let cosine = |a: usize, b: usize| dot(&normals[a], &normals[b]);
    for &([a, _], [b, _]) in edges.iter().filter(|([a, _], [b, _])| cosine(*a, *b) >= PARALLEL) {
        groups.join(a, b);
    }
    let planes: Vec<usize> = (0..facets.len()).map(|k| groups.first(k)).collect();
    let is_narrow = narrow(facets, &planes, NARROW * size);
    for &([a, _], [b, _]) in edges.iter().filter(|([a, _], [b, _])| cosine(*a, *b) >= SMOOTH) {
        if is_narrow[planes[a]] && is_narrow[planes[b]] {
            groups.join(a, b);
        }
    }
    let mut border = vec![[true; 3]; facets.len()];
    for &([a, i], [b, j]) in &edges {
        if groups.first(a) == groups.first(b) {
            (border[a][i], border[b][j]) = (false, false);
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); facets.len()];
    (0..facets.len()).for_each(|k| members[groups.first(k)].push(k));
    let face = |members: &Vec<usize>| {
        let is_plane = members.iter().all(|&k| planes[k] == planes[members[0]]);
        let largest = members.iter().copied().max_by(|&a, &b| {
            let area = |k: usize| norm(&area_vector(&facets[k]));
            area(a).total_cmp(&area(b))
        });
        let level = if is_plane {
            Level::plane(&facets[largest.unwrap_or(members[0])])
        } else {
            Level::Facets(FacetLevel::new(members.iter().map(|&k| (facets[k], border[k])).collect()))
        };
        let divided = |&k: &usize| {
            let [a, b, c] = &facets[k];
            triangle([a, b, c], spacing, 0).into_iter().map(|facet| facet.corners)
        };
        Face { level, facets: members.iter().flat_map(divided).collect() }
    };
    members.iter().filter(|members| !members.is_empty()).map(face).collect()
}

/// The edges that two facets share: the number of each facet, and of the corner where its edge starts.
fn shared_edges(facets: &[Triangle]) -> Vec<([usize; 2], [usize; 2])> {
    let (_, corners) = indexed(facets);
    let mut known: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
    let mut shared = Vec::new();
    for (k, corners) in corners.iter().enumerate() {
        for edge in 0..3 {
            let [a, b] = [corners[edge], corners[(edge + 1) % 3]];
            match known.remove(&[a.min(b), a.max(b)]) {
                Some(other) => shared.push((other, [k, edge])),
                None => {
                    known.insert([a.min(b), a.max(b)], [k, edge]);
                }
            }
        }
    }
    shared
}

/// For the first facet of each plane, true if the width of the plane face, its area divided by its extent, is smaller
/// than this.
fn narrow(facets: &[Triangle], planes: &[usize], width: f64) -> Vec<bool> {
    let mut area = vec![0.0; facets.len()];
    let mut extent = vec![0.0f64; facets.len()];
    for (facet, &plane) in facets.iter().zip(planes) {
        area[plane] += norm(&area_vector(facet));
        for x in facet {
            extent[plane] = extent[plane].max(norm(&minus(x, &facets[plane][0])));
        }
    }
    (0..facets.len()).map(|k| area[k] < width * extent[k]).collect()
}

/// Disjoint groups of numbers.
struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    fn first(&mut self, mut k: usize) -> usize {
        while self.parent[k] != k {
            self.parent[k] = self.parent[self.parent[k]];
            k = self.parent[k];
        }
        k
    }

    fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [self.first(a), self.first(b)];
        self.parent[a.max(b)] = a.min(b);
    }
}
