//! Domains fitted to the outline of a body in the plane.
//!
//! Cells of a lattice that lie inside the outline become domains as they are. Near the outline, corners of the lattice
//! give way to corners on it: the corners of the outline itself, and, on each of its sides, the crossings with the
//! lattice lines across the axis along which the side runs. The band between these and the whole cells is divided into
//! triangles, of which pairs become quadrilaterals where these are well shaped ([`band`]). Neighbouring domains share
//! all their corners, so that a uniform stress is in equilibrium with the tractions on their outer sides.

mod band;
mod space;

use std::collections::{HashMap, HashSet};

use crate::grid::Lines;
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{Outline, signed_area};

pub(super) use space::{NotFitted, SolidDomain, SolidDomains, fitted_in_space};

/// Distance from a lattice line within which a position is on the line, in cells, [-].
const ON_LINE: f64 = 1e-6;
/// Smallest distance between two corners along an outline, in cells, [-]: of corners that are closer, only the sharper
/// one is met, unless this moves the outline by more than [`AWAY`].
const CLOSE: f64 = 0.4;
/// Largest distance of a corner that is not met from the outline, in cells, [-].
const AWAY: f64 = 0.1;
/// Largest change of the area by corners that are not met, relative to the area, [-].
const LESS_AREA: f64 = 5e-3;
/// Distance from a side within which corners of the lattice give way to those on the side, along the axis across which
/// the side runs, in cells, [-].
const NEAR: f64 = 0.5;
/// Largest difference between the area of the domains and that of the outline, relative to the latter, [-].
const SAME_AREA: f64 = 1e-9;

/// A domain: three or four corners, counterclockwise, [length].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FittedDomain {
    pub corners: Vec<[f64; 2]>,
    /// True if a corner lies on the outline.
    pub is_outer: bool,
}

/// The centroid of a polygon, [length].
pub(super) fn centroid(corners: &[[f64; 2]]) -> [f64; 2] {
    let about = corners[0];
    let (mut area, mut moment) = (0.0, [0.0; 2]);
    for pair in corners[1..].windows(2) {
        let (a, b) = (minus(&pair[0], &about), minus(&pair[1], &about));
        let twice = a[0] * b[1] - a[1] * b[0];
        area += 3.0 * twice;
        (0..2).for_each(|d| moment[d] += twice * (a[d] + b[d]));
    }
    [0, 1].map(|d| about[d] + moment[d] / area)
}

/// The domains inside an outline, in the order of the cells of a lattice in which their centres lie; `None` if the
/// domains would not fill the outline.
pub(super) fn fitted(outline: &Outline, lines: &Lines<2>) -> Option<Vec<FittedDomain>> {
    let simpler = Outline { loops: outline.loops.iter().map(|x| without_close_corners(x, lines)).collect() };
    let fit = |outline: &Outline| Fitting::new(outline, lines)?.domains(outline.area());
    let is_alike = (simpler.area() - outline.area()).abs() <= LESS_AREA * outline.area();
    is_alike.then(|| fit(&simpler)).flatten().or_else(|| fit(outline))
}

/// True if all sides of an outline lie on lattice lines, and its corners where these cross.
pub(super) fn is_on_lattice(outline: &Outline, lines: &Lines<2>) -> bool {
    outline.sides().all(|(a, b)| {
        let [a, b] = [a, b].map(|x| coordinates(lines, &x));
        (0..2).any(|d| (a[d] - b[d]).abs() <= ON_LINE)
            && a.iter().all(|xi| (xi - xi.round()).abs() <= ON_LINE)
    })
}

/// Cell coordinates of a position in a lattice.
fn coordinates(lines: &Lines<2>, x: &[f64; 2]) -> [f64; 2] {
    [0, 1].map(|d| lines.axes()[d].coordinate(x[d]))
}

/// A polygon without those corners that a lattice cannot resolve.
fn without_close_corners(corners: &[[f64; 2]], lines: &Lines<2>) -> Vec<[f64; 2]> {
    let n = corners.len();
    let xi: Vec<[f64; 2]> = corners.iter().map(|x| coordinates(lines, x)).collect();
    let length = |k: usize| norm(&minus(&xi[(k + 1) % n], &xi[k % n]));
    if (0..n).all(|k| length(k) >= CLOSE) {
        return corners.to_vec();
    }
    let bluntness = |k: usize| {
        let (before, after) = (minus(&xi[k], &xi[(k + n - 1) % n]), minus(&xi[(k + 1) % n], &xi[k]));
        dot(&before, &after) / (norm(&before) * norm(&after)).max(f64::MIN_POSITIVE)
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| bluntness(a).total_cmp(&bluntness(b)).then(a.cmp(&b)));
    let mut kept = vec![false; n];
    for k in order {
        let is_free = |step: usize| {
            let (mut at, mut way) = (k, 0.0);
            for _ in 1..n {
                way += length(if step == 1 { at } else { (at + n - 1) % n });
                at = (at + step) % n;
                if way >= CLOSE {
                    return true;
                }
                if kept[at] {
                    return false;
                }
            }
            true
        };
        kept[k] = is_free(1) && is_free(n - 1);
    }
    while let Some(k) = farthest(&xi, &kept) {
        kept[k] = true;
    }
    let few: Vec<[f64; 2]> = (0..n).filter(|&k| kept[k]).map(|k| corners[k]).collect();
    if few.len() < 3 { corners.to_vec() } else { few }
}

/// The corner of a polygon that lies farthest from the side between its kept neighbours, if it is farther than [`AWAY`]
/// from it.
fn farthest(corners: &[[f64; 2]], kept: &[bool]) -> Option<usize> {
    let n = corners.len();
    let start = kept.iter().position(|kept| *kept)?;
    let (mut most, mut found, mut from) = (AWAY, None, start);
    while from < start + n {
        let to = (from + 1..=start + n).find(|k| kept[k % n])?;
        let (a, edge) = (corners[from % n], minus(&corners[to % n], &corners[from % n]));
        for k in from + 1..to {
            let arm = minus(&corners[k % n], &a);
            let t = (dot(&arm, &edge) / dot(&edge, &edge).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let away = norm(&minus(&arm, &edge.map(|e| t * e)));
            if away > most {
                (most, found) = (away, Some(k % n));
            }
        }
        from = to;
    }
    found
}

/// The corners of domains and the cells of the lattice that are domains as they are.
struct Fitting<'a> {
    lines: &'a Lines<2>,
    /// The lowest line of the part of the lattice around the outline, along each axis.
    first: [usize; 2],
    /// Number of cells in this part along each axis.
    n: [usize; 2],
    /// Positions of all corners of domains, [length]; those on the outline come first.
    places: Vec<[f64; 2]>,
    /// Number of corners on the outline.
    on_outline: usize,
    /// The pieces of the outline between its corners, with the body to their left.
    pieces: Vec<[u32; 2]>,
    /// For each corner of the lattice the number of the corner of domains there, if any.
    at_corner: Vec<Option<u32>>,
    /// True for each cell that is a domain as it is.
    whole: Vec<bool>,
}

impl<'a> Fitting<'a> {
    fn new(outline: &Outline, lines: &'a Lines<2>) -> Option<Self> {
        let mut fitting = Fitting {
            lines,
            first: [0; 2],
            n: [0; 2],
            places: Vec::new(),
            on_outline: 0,
            pieces: Vec::new(),
            at_corner: Vec::new(),
            whole: Vec::new(),
        };
        fitting.place_corners(outline);
        fitting.frame()?;
        fitting.at_corner = vec![None; (fitting.n[0] + 1) * (fitting.n[1] + 1)];
        for k in 0..fitting.on_outline {
            if let Some(corner) = fitting.corner_at(&fitting.places[k]) {
                fitting.at_corner[corner] = Some(k as u32);
            }
        }
        let mut cut = fitting.cut_cells();
        fitting.keep_corners();
        let inside = fitting.inside(0.5, fitting.n);
        cut.iter_mut().zip(&inside).for_each(|(cut, inside)| *cut |= !inside);
        let is_whole = |cell: usize| {
            !cut[cell] && fitting.corners_of(cell).iter().all(|&corner| fitting.at_corner[corner].is_some())
        };
        fitting.whole = (0..cut.len()).map(is_whole).collect();
        Some(fitting)
    }

    /// Places corners on the outline: at its own corners, and at crossings with lattice lines that are not too close to
    /// these.
    fn place_corners(&mut self, outline: &Outline) {
        let mut known: HashMap<[u64; 2], u32> = HashMap::new();
        for (from, to) in outline.sides() {
            let mut path = vec![from];
            let ends = [from, to].map(|x| coordinates(self.lines, &x));
            let along_axis = |d: usize| (ends[1][d] - ends[0][d]).abs();
            let d = usize::from(along_axis(1) > along_axis(0));
            let [low, high] = [ends[0][d].min(ends[1][d]), ends[0][d].max(ends[1][d])];
            let (first, last) = ((low + NEAR - ON_LINE).ceil(), (high - NEAR + ON_LINE).floor());
            let axis = &self.lines.axes()[d];
            let mut between: Vec<[f64; 2]> = Vec::new();
            let mut line = first;
            while line <= last {
                let x = axis.position(line);
                let t = (x - from[d]) / (to[d] - from[d]);
                let mut place = along(&from, t, &minus(&to, &from));
                place[d] = x;
                between.push(place);
                line += 1.0;
            }
            if ends[1][d] < ends[0][d] {
                between.reverse();
            }
            path.append(&mut between);
            path.push(to);
            let numbers: Vec<u32> = (path.into_iter())
                .map(|x| {
                    *known.entry(x.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                        self.places.push(x);
                        self.places.len() as u32 - 1
                    })
                })
                .collect();
            self.pieces.extend(numbers.windows(2).map(|pair| [pair[0], pair[1]]));
        }
        self.on_outline = self.places.len();
    }

    /// Finds the part of the lattice around the outline; `None` if there is none.
    fn frame(&mut self) -> Option<()> {
        for d in 0..2 {
            let axis = &self.lines.axes()[d];
            let along = self.places.iter().map(|x| axis.coordinate(x[d]));
            let [low, high] =
                along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], xi| [low.min(xi), high.max(xi)]);
            let last = (high.ceil().max(0.0) as usize).min(axis.n_cells());
            self.first[d] = (low.floor().max(0.0) as usize).min(last);
            self.n[d] = last - self.first[d];
        }
        (!self.pieces.is_empty() && self.n.iter().all(|n| *n > 0)).then_some(())
    }

    /// Cell coordinates in the part of the lattice around the outline.
    fn local(&self, x: &[f64; 2]) -> [f64; 2] {
        let xi = coordinates(self.lines, x);
        [0, 1].map(|d| xi[d] - self.first[d] as f64)
    }

    /// Position at local cell coordinates, [length].
    fn position(&self, xi: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|d| self.lines.axes()[d].position(xi[d] + self.first[d] as f64))
    }

    /// The corner of the lattice at a position.
    fn corner_at(&self, x: &[f64; 2]) -> Option<usize> {
        let xi = self.local(x);
        let is_there = (0..2).all(|d| xi[d] == xi[d].round() && (0.0..=self.n[d] as f64).contains(&xi[d]));
        is_there.then(|| xi[0] as usize + xi[1] as usize * (self.n[0] + 1))
    }

    /// The corners of a cell, counterclockwise.
    fn corners_of(&self, cell: usize) -> [usize; 4] {
        let row = self.n[0] + 1;
        let lowest = cell % self.n[0] + cell / self.n[0] * row;
        [lowest, lowest + 1, lowest + 1 + row, lowest + row]
    }

    /// The cells, or the corners of cells (`more` = 1), in a box of local cell coordinates, as ranges along the axes.
    fn range(&self, low: [f64; 2], high: [f64; 2], more: usize) -> [std::ops::Range<usize>; 2] {
        [0, 1].map(|d| {
            let most = (self.n[d] + more) as f64;
            (low[d].clamp(0.0, most) as usize)..(high[d].clamp(0.0, most) as usize)
        })
    }

    /// True for each cell that a piece of the outline enters, or touches elsewhere than at corners of domains or along
    /// a whole edge.
    fn cut_cells(&self) -> Vec<bool> {
        let mut cut = vec![false; self.n[0] * self.n[1]];
        for piece in &self.pieces {
            let ends = piece.map(|k| self.places[k as usize]);
            let [a, b] = ends.map(|x| self.local(&x));
            let low = [0, 1].map(|d| (a[d].min(b[d]) - ON_LINE).floor());
            let high = [0, 1].map(|d| (a[d].max(b[d]) + ON_LINE).floor() + 1.0);
            let [columns, rows] = self.range(low, high, 0);
            for row in rows {
                for column in columns.clone() {
                    cut[column + row * self.n[0]] |= self.is_cut([column, row], &ends);
                }
            }
        }
        cut
    }

    /// True if a piece of the outline cuts a cell.
    fn is_cut(&self, cell: [usize; 2], ends: &[[f64; 2]; 2]) -> bool {
        let [low, high] = [0, 1].map(|k| self.position([0, 1].map(|d| (cell[d] + k) as f64)));
        let inner = |x: &[f64; 2]| [0, 1].map(|d| (x[d] - low[d]) / (high[d] - low[d]));
        let [a, b] = ends.each_ref().map(inner);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for d in 0..2 {
            let slope = b[d] - a[d];
            let [s, t] = [-ON_LINE, 1.0 + ON_LINE].map(|side| (side - a[d]) / slope);
            if slope.abs() > f64::MIN_POSITIVE {
                (from, to) = (from.max(s.min(t)), to.min(s.max(t)));
            } else if !(-ON_LINE..=1.0 + ON_LINE).contains(&a[d]) {
                return false;
            }
        }
        if from > to {
            return false;
        }
        let [p, q] = [from, to].map(|t| along(&a, t, &minus(&b, &a)));
        let near = |x: f64, whole: f64| (x - whole).abs() <= 4.0 * ON_LINE;
        let is_corner = |x: &[f64; 2]| {
            x.iter().all(|x| near(*x, 0.0) || near(*x, 1.0)) && {
                let place = [0, 1].map(|d| cell[d] + x[d].round() as usize);
                self.at_corner[place[0] + place[1] * (self.n[0] + 1)].is_some()
            }
        };
        let is_along_edge =
            (0..2).any(|d| [0.0, 1.0].iter().any(|side| near(p[d], *side) && near(q[d], *side)));
        !(is_corner(&p) && is_corner(&q) && (is_along_edge || norm(&minus(&p, &q)) <= 8.0 * ON_LINE))
    }

    /// Numbers the corners of the lattice that lie inside the outline and not too close to it.
    fn keep_corners(&mut self) {
        let mut kept = self.inside(0.0, self.n.map(|n| n + 1));
        for piece in &self.pieces {
            let [a, b] = piece.map(|k| self.local(&self.places[k as usize]));
            let edge = minus(&b, &a);
            let length = norm(&edge);
            let reach = (NEAR - ON_LINE) * edge[0].abs().max(edge[1].abs()) / length;
            let low = [0, 1].map(|d| (a[d].min(b[d]) - reach).ceil());
            let high = [0, 1].map(|d| (a[d].max(b[d]) + reach).floor() + 1.0);
            let [columns, rows] = self.range(low, high, 1);
            for row in rows {
                for column in columns.clone() {
                    let arm = minus(&[column as f64, row as f64], &a);
                    let t = (dot(&arm, &edge) / (length * length)).clamp(0.0, 1.0);
                    if norm(&minus(&arm, &edge.map(|e| t * e))) < reach {
                        kept[column + row * (self.n[0] + 1)] = false;
                    }
                }
            }
        }
        for corner in 0..kept.len() {
            if kept[corner] && self.at_corner[corner].is_none() {
                let row = self.n[0] + 1;
                self.at_corner[corner] = Some(self.places.len() as u32);
                self.places.push(self.position([(corner % row) as f64, (corner / row) as f64]));
            }
        }
    }

    /// True for those places inside the outline that lie `shift` beyond the lowest line along each axis, and from there
    /// at each of `n` steps of one cell.
    fn inside(&self, shift: f64, n: [usize; 2]) -> Vec<bool> {
        let height = |row: usize| self.position([0.0, row as f64 + shift])[1];
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); n[1]];
        for piece in &self.pieces {
            let [a, b] = piece.map(|k| self.places[k as usize]);
            let along_y = [a, b].map(|x| self.local(&x)[1]);
            let low = (along_y[0].min(along_y[1]) - shift - 1.0).clamp(0.0, n[1] as f64) as usize;
            let high = (along_y[0].max(along_y[1]) - shift + 2.0).clamp(0.0, n[1] as f64) as usize;
            for row in low..high {
                let y = height(row);
                if (a[1] > y) != (b[1] > y) {
                    let x = a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1]));
                    crossings[row].push(self.local(&[x, y])[0] - shift);
                }
            }
        }
        let mut inside = vec![false; n[0] * n[1]];
        for (row, mut crossings) in crossings.into_iter().enumerate() {
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let [from, to] = [pair[0], pair[1]].map(|xi| xi.ceil().clamp(0.0, n[0] as f64) as usize);
                inside[row * n[0] + from..row * n[0] + to.max(from)].fill(true);
            }
        }
        inside
    }

    /// All domains; `None` if they do not fill the area of the outline.
    fn domains(&self, area: f64) -> Option<Vec<FittedDomain>> {
        let mut found: Vec<Vec<u32>> = Vec::new();
        let row = self.n[0];
        let mut edges: HashSet<[u32; 2]> = HashSet::new();
        for cell in (0..self.whole.len()).filter(|&cell| self.whole[cell]) {
            let corners: Vec<u32> =
                self.corners_of(cell).iter().filter_map(|&corner| self.at_corner[corner]).collect();
            let (column, is_whole) = (cell % row, |cell: usize| self.whole.get(cell) == Some(&true));
            let neighbours = [
                cell >= row && is_whole(cell.wrapping_sub(row)),
                column + 1 < row && is_whole(cell + 1),
                is_whole(cell + row),
                column > 0 && is_whole(cell - 1),
            ];
            // Seen from the band, the edges of a cell run clockwise.
            let open = (0..4).filter(|&k| !neighbours[k]);
            edges.extend(open.map(|k| [corners[(k + 1) % 4], corners[k]]));
            found.push(corners);
        }
        let mut sides: Vec<[u32; 2]> = Vec::new();
        for &[a, b] in &self.pieces {
            // A piece that is the edge of a whole cell needs no band.
            if !edges.remove(&[b, a]) {
                sides.push([a, b]);
            }
        }
        let mut edges: Vec<[u32; 2]> = edges.into_iter().collect();
        edges.sort_unstable();
        sides.extend(edges);
        let local: Vec<[f64; 2]> = self.places.iter().map(|x| self.local(x)).collect();
        found.extend(band::filled(&local, &sides, &self.free_corners())?);
        self.checked(found, area)
    }

    /// The corners of the lattice that lie in the band, away from its sides.
    fn free_corners(&self) -> Vec<u32> {
        let row = self.n[0] + 1;
        let is_whole = |column: usize, line: usize| {
            column < self.n[0] && line < self.n[1] && self.whole[column + line * self.n[0]]
        };
        let is_free = |corner: &usize| {
            let (column, line) = (corner % row, corner / row);
            ![(0, 0), (1, 0), (0, 1), (1, 1)]
                .iter()
                .any(|(i, j)| column >= *i && line >= *j && is_whole(column - i, line - j))
        };
        let inner = |corner: usize| self.at_corner[corner].filter(|&k| k as usize >= self.on_outline);
        (0..self.at_corner.len())
            .filter(|&corner| inner(corner).is_some())
            .filter(is_free)
            .filter_map(inner)
            .collect()
    }

    /// The domains in the order of the cells; `None` unless all have positive areas that add up to `area`.
    fn checked(&self, found: Vec<Vec<u32>>, area: f64) -> Option<Vec<FittedDomain>> {
        let mut sum = 0.0;
        let mut domains = Vec::with_capacity(found.len());
        for numbers in found {
            let corners: Vec<[f64; 2]> = numbers.iter().map(|&k| self.places[k as usize]).collect();
            let own = signed_area(&corners);
            if own.is_nan() || own <= 0.0 {
                return None;
            }
            sum += own;
            let is_outer = numbers.iter().any(|&k| (k as usize) < self.on_outline);
            let n = corners.len() as f64;
            let centre = [0, 1].map(|d| corners.iter().map(|x| x[d]).sum::<f64>() / n);
            let index =
                [0, 1].map(|d| self.lines.axes()[d].cell_of(self.lines.axes()[d].coordinate(centre[d])));
            domains.push((self.lines.cell(index), FittedDomain { corners, is_outer }));
        }
        domains.sort_by_key(|(cell, _)| *cell);
        let is_filled = (sum - area).abs() <= SAME_AREA * area;
        is_filled.then(|| domains.into_iter().map(|(_, domain)| domain).collect())
    }
}

#[cfg(test)]
mod tests;
