//! Area of a region made of boxes, polygons, circles and annuli by union and difference, exact but for round-off.
//!
//! Horizontal lines through all ends and crossings of the outlines cut the plane into strips. Within a strip the same
//! pieces of outline, in the same order, bound the chords of the region, and the integral of x over y along a piece of a
//! line or a circle has a closed form.

use super::super::Shape;
use super::super::build::pair;

/// A piece of an outline that meets a horizontal line once at most, as a function x(y).
#[derive(Debug, Clone, Copy)]
enum Piece {
    /// Between its lower and its higher end.
    Line([f64; 2], [f64; 2]),
    /// The left (−1) or right (+1) half of a circle.
    Half { center: [f64; 2], radius: f64, side: f64 },
}

impl Piece {
    /// Lowest and highest y.
    fn span(&self) -> [f64; 2] {
        match *self {
            Piece::Line(low, high) => [low[1], high[1]],
            Piece::Half { center, radius, .. } => [center[1] - radius, center[1] + radius],
        }
    }

    fn x(&self, y: f64) -> f64 {
        match *self {
            Piece::Line(low, high) => low[0] + (y - low[1]) / (high[1] - low[1]) * (high[0] - low[0]),
            Piece::Half { center, radius, side } => center[0] + side * half_chord(radius, y - center[1]),
        }
    }

    /// ∫ x dy.
    fn integral(&self, [from, to]: [f64; 2]) -> f64 {
        match *self {
            Piece::Line(..) => 0.5 * (self.x(from) + self.x(to)) * (to - from),
            Piece::Half { center, radius, side } => {
                // The arc tangent, for the arc sine loses half the digits at the ends of the circle.
                let primitive = |t: f64| {
                    let half = half_chord(radius, t);
                    0.5 * (t * half + radius * radius * t.atan2(half))
                };
                center[0] * (to - from) + side * (primitive(to - center[1]) - primitive(from - center[1]))
            }
        }
    }
}

/// Half the chord of a circle at a distance from its centre; 0 outside.
fn half_chord(radius: f64, distance: f64) -> f64 {
    ((radius - distance) * (radius + distance)).max(0.0).sqrt()
}

/// Area of a region; `None` where whole cells are part of it.
pub(super) fn area(shape: &Shape) -> Option<f64> {
    let mut outlines = Vec::new();
    collect(shape, &mut outlines)?;
    let mut heights: Vec<f64> = outlines.iter().flatten().flat_map(Piece::span).collect();
    for (k, outline) in outlines.iter().enumerate() {
        for other in &outlines[k + 1..] {
            for a in outline {
                for b in other {
                    crossings(a, b, &mut heights);
                }
            }
        }
    }
    heights.sort_by(f64::total_cmp);
    let mut area = 0.0;
    for strip in heights.windows(2).filter(|strip| strip[0] < strip[1]) {
        let middle = 0.5 * (strip[0] + strip[1]);
        for (k, end) in chords(shape, middle).iter().enumerate() {
            let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
            area += sign * end.piece.integral([strip[0], strip[1]]);
        }
    }
    Some(area)
}

/// The outlines of all simple regions; `None` where there are whole cells.
fn collect(shape: &Shape, outlines: &mut Vec<Vec<Piece>>) -> Option<()> {
    match shape {
        Shape::Union { of } => of.iter().try_for_each(|part| collect(part, outlines)),
        Shape::Difference { from, minus } => {
            collect(from, outlines)?;
            minus.iter().try_for_each(|part| collect(part, outlines))
        }
        Shape::Annulus { center, inner, outer } => {
            outlines.push(circle(center, *outer));
            outlines.push(circle(center, *inner));
            Some(())
        }
        _ => {
            outlines.push(outline(shape)?);
            Some(())
        }
    }
}

/// The outline of a box, polygon or circle. Level sides bound no chord.
fn outline(shape: &Shape) -> Option<Vec<Piece>> {
    match shape {
        Shape::Box { min, max } => {
            let (min, max) = (pair(min), pair(max));
            Some([min[0], max[0]].map(|x| Piece::Line([x, min[1]], [x, max[1]])).to_vec())
        }
        Shape::Polygon { vertices } => {
            let side = |k: usize| {
                let (a, b) = (pair(&vertices[k]), pair(&vertices[(k + 1) % vertices.len()]));
                if a[1] < b[1] { (a, b) } else { (b, a) }
            };
            let sides = (0..vertices.len()).map(side).filter(|(low, high)| low[1] < high[1]);
            Some(sides.map(|(low, high)| Piece::Line(low, high)).collect())
        }
        Shape::Circle { center, radius } => Some(circle(center, *radius)),
        _ => None,
    }
}

fn circle(center: &[f64], radius: f64) -> Vec<Piece> {
    [-1.0, 1.0].map(|side| Piece::Half { center: pair(center), radius, side }).to_vec()
}

/// The heights at which two pieces may cross. More than there are do no harm.
fn crossings(a: &Piece, b: &Piece, heights: &mut Vec<f64>) {
    let ([low_a, high_a], [low_b, high_b]) = (a.span(), b.span());
    if low_a.max(low_b) > high_a.min(high_b) {
        return;
    }
    match (*a, *b) {
        (Piece::Line(p, q), Piece::Line(r, s)) => {
            let ([u, v], [w, z]) = ([q[0] - p[0], q[1] - p[1]], [s[0] - r[0], s[1] - r[1]]);
            let determinant = u * z - v * w;
            if determinant != 0.0 {
                heights.push(p[1] + v * ((r[0] - p[0]) * z - (r[1] - p[1]) * w) / determinant);
            }
        }
        (Piece::Line(p, q), Piece::Half { center, radius, .. })
        | (Piece::Half { center, radius, .. }, Piece::Line(p, q)) => {
            let (u, v) = (q[0] - p[0], q[1] - p[1]);
            let square = u * u + v * v;
            let along = ((center[0] - p[0]) * u + (center[1] - p[1]) * v) / square;
            let foot = [p[0] + along * u, p[1] + along * v];
            let half = half_chord(radius, (foot[0] - center[0]).hypot(foot[1] - center[1])) / square.sqrt();
            heights.extend([foot[1] - half * v, foot[1] + half * v]);
        }
        (Piece::Half { center: p, radius, .. }, Piece::Half { center: q, radius: other, .. }) => {
            let (u, v) = (q[0] - p[0], q[1] - p[1]);
            let distance = u.hypot(v);
            if distance > 0.0 {
                let along = 0.5 * (distance + (radius - other) * (radius + other) / distance);
                let half = half_chord(radius, along);
                heights.extend([-1.0, 1.0].map(|s| p[1] + (along * v + s * half * u) / distance));
            }
        }
    }
}

/// Where a horizontal line enters or leaves a region.
#[derive(Debug, Clone, Copy)]
struct End {
    x: f64,
    piece: Piece,
}

/// The ends of all chords of a region at a height, from left to right: the line enters at each end of even number.
fn chords(shape: &Shape, y: f64) -> Vec<End> {
    match shape {
        Shape::Union { of } => {
            of.iter().fold(Vec::new(), |all, part| merge(&all, &chords(part, y), |a, b| a || b))
        }
        Shape::Difference { from, minus } => {
            minus.iter().fold(chords(from, y), |left, part| merge(&left, &chords(part, y), |a, b| a && !b))
        }
        Shape::Annulus { center, inner, outer } => {
            let (inner, outer) = (circle(center, *inner), circle(center, *outer));
            merge(&ends(&outer, y), &ends(&inner, y), |a, b| a && !b)
        }
        _ => ends(&outline(shape).unwrap_or_default(), y),
    }
}

/// The ends of the chords of an outline.
fn ends(outline: &[Piece], y: f64) -> Vec<End> {
    let met = outline.iter().filter(|piece| piece.span()[0] < y && y < piece.span()[1]);
    let mut ends: Vec<End> = met.map(|&piece| End { x: piece.x(y), piece }).collect();
    ends.sort_by(|a, b| a.x.total_cmp(&b.x));
    ends
}

/// The chords of the places that are in the one and the other region as `keep` wants.
fn merge(a: &[End], b: &[End], keep: fn(bool, bool) -> bool) -> Vec<End> {
    let (mut i, mut j) = (0, 0);
    let mut merged: Vec<End> = Vec::new();
    while i < a.len() || j < b.len() {
        let from_a = j == b.len() || (i < a.len() && a[i].x <= b[j].x);
        let end = if from_a { a[i] } else { b[j] };
        if from_a {
            i += 1
        } else {
            j += 1
        }
        // After an odd number of ends the line is inside; so it is in the result.
        if keep(i % 2 == 1, j % 2 == 1) != (merged.len() % 2 == 1) {
            merged.push(end);
        }
    }
    merged
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::super::{bounds, contains};
    use super::*;

    fn square(min: [f64; 2], max: [f64; 2]) -> Shape {
        Shape::Box { min: min.to_vec(), max: max.to_vec() }
    }

    fn disk(center: [f64; 2], radius: f64) -> Shape {
        Shape::Circle { center: center.to_vec(), radius }
    }

    fn ring(center: [f64; 2], inner: f64, outer: f64) -> Shape {
        Shape::Annulus { center: center.to_vec(), inner, outer }
    }

    fn polygon(vertices: &[[f64; 2]]) -> Shape {
        Shape::Polygon { vertices: vertices.iter().map(|v| v.to_vec()).collect() }
    }

    fn union(of: &[Shape]) -> Shape {
        Shape::Union { of: of.to_vec() }
    }

    fn difference(from: &Shape, minus: &[Shape]) -> Shape {
        Shape::Difference { from: Box::new(from.clone()), minus: minus.to_vec() }
    }

    /// A ∩ B = A − (A − B).
    fn intersection(a: &Shape, b: &Shape) -> Shape {
        difference(a, &[difference(a, std::slice::from_ref(b))])
    }

    #[test]
    fn areas_have_closed_forms() {
        let unit = disk([0.0, 0.0], 1.0);
        let triangle = polygon(&[[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]);
        // The lens of two circles of radii 1 and r whose centres are d apart.
        let lens = |r: f64, d: f64| {
            let (a, b) = ((d * d + 1.0 - r * r) / (2.0 * d), (d * d + r * r - 1.0) / (2.0 * d));
            a.acos() + r * r * (b / r).acos() - d * (1.0 - a * a).sqrt()
        };
        // A circular segment beyond a distance d from the centre of a unit circle.
        let segment = |d: f64| d.acos() - d * (1.0 - d * d).sqrt();
        let whole = square([0.0, 0.0], [2.0, 2.0]);
        for (name, shape, exact) in [
            ("lens", intersection(&unit, &disk([0.6, 0.8], 1.0)), 2.0 * PI / 3.0 - 0.75f64.sqrt()),
            ("unequal lens", intersection(&unit, &disk([-0.9, 0.3], 0.7)), lens(0.7, 0.9f64.hypot(0.3))),
            ("two disks", union(&[unit.clone(), disk([0.0, 1.2], 0.8)]), PI * 1.64 - lens(0.8, 1.2)),
            (
                "a disk that touches the larger from inside",
                union(&[unit.clone(), disk([0.6, 0.8], 2.0)]),
                PI * 4.0,
            ),
            ("disks side by side", union(&[unit.clone(), disk([2.0, 0.0], 1.0)]), 2.0 * PI),
            ("plate with a hole", difference(&whole, &[disk([1.0, 1.0], 0.5)]), 4.0 - PI / 4.0),
            ("bitten corner", difference(&whole, &[disk([2.0, 2.0], 1.0)]), 4.0 - PI / 4.0),
            ("bitten side", difference(&whole, &[disk([1.0, -0.5], 1.0)]), 4.0 - segment(0.5)),
            ("crossing boxes", union(&[whole.clone(), square([1.0, -1.0], [3.0, 1.5])]), 4.0 + 5.0 - 1.5),
            ("a box twice", union(&[whole.clone(), whole.clone()]), 4.0),
            ("boxes side by side", union(&[whole.clone(), square([2.0, 0.0], [3.0, 2.0])]), 6.0),
            ("nothing", difference(&whole, &[square([-1.0, -1.0], [3.0, 3.0])]), 0.0),
            ("nothing added", union(&[whole.clone(), disk([1.0, 1.0], 1.0)]), 4.0),
            (
                "half a ring",
                difference(&ring([0.0; 2], 1.0, 2.0), &[square([-3.0, -3.0], [0.0, 3.0])]),
                1.5 * PI,
            ),
            (
                "ring in a hole",
                union(&[difference(&whole, &[disk([1.0; 2], 0.8)]), ring([1.0; 2], 0.2, 0.5)]),
                4.0 - 0.64 * PI + 0.21 * PI,
            ),
            ("triangle and its circle", difference(&triangle, &[disk([1.0, 1.0], 1.0)]), 6.0 - PI),
            ("cut triangle", intersection(&triangle, &square([1.0, -1.0], [2.0, 5.0])), (2.25 + 1.5) / 2.0),
            (
                "star",
                union(&[
                    polygon(&[[0.0, 0.0], [2.0, 0.0], [1.0, 3f64.sqrt()]]),
                    polygon(&[[0.0, 2.0 / 3f64.sqrt()], [1.0, -1.0 / 3f64.sqrt()], [2.0, 2.0 / 3f64.sqrt()]]),
                ]),
                3f64.sqrt() * 4.0 / 3.0,
            ),
        ] {
            let found = area(&shape).unwrap();
            assert!((found - exact).abs() < 1e-13, "{name}: {found}, exact {exact}");
        }
        assert_eq!(area(&union(&[unit, Shape::Cells { group: None }])), None);
    }

    #[test]
    fn far_from_the_origin_the_area_is_as_good() {
        let at = |x: f64| difference(&square([x, x], [x + 2.0, x + 2.0]), &[disk([x + 1.0, x + 1.0], 0.5)]);
        assert!((area(&at(1e5)).unwrap() - (4.0 - PI / 4.0)).abs() < 1e-9);
    }

    /// Boxes, triangles, disks and rings about the origin.
    fn simple() -> impl Strategy<Value = Shape> {
        let place = || prop::array::uniform2(-1.0..1.0f64);
        prop_oneof![
            (place(), prop::array::uniform2(0.1..1.5f64))
                .prop_map(|(min, size)| square(min, [min[0] + size[0], min[1] + size[1]])),
            (place(), place(), place()).prop_map(|(a, b, c)| polygon(&[a, b, c])),
            (place(), 0.1..1.0f64).prop_map(|(center, radius)| disk(center, radius)),
            (place(), 0.1..0.6f64, 0.1..0.6f64).prop_map(|(center, inner, more)| ring(
                center,
                inner,
                inner + more
            )),
        ]
    }

    fn region() -> impl Strategy<Value = Shape> {
        simple().prop_recursive(3, 8, 3, |part| {
            prop_oneof![
                prop::collection::vec(part.clone(), 1..3).prop_map(|of| union(&of)),
                (part.clone(), prop::collection::vec(part, 1..3))
                    .prop_map(|(from, minus)| difference(&from, &minus)),
            ]
        })
    }

    proptest! {
        /// |A ∪ B| + |A ∩ B| = |A| + |B| and |A − B| + |A ∩ B| = |A|.
        #[test]
        fn union_and_intersection_share_the_area(a in region(), b in region()) {
            let both = area(&intersection(&a, &b)).unwrap();
            let (of_a, of_b) = (area(&a).unwrap(), area(&b).unwrap());
            let together = area(&union(&[a.clone(), b.clone()])).unwrap();
            let left = area(&difference(&a, &[b])).unwrap();
            prop_assert!((together + both - of_a - of_b).abs() < 1e-12);
            prop_assert!((left + both - of_a).abs() < 1e-12);
        }

        /// Against the share of a lattice of places that lie in the region.
        #[test]
        fn the_area_is_that_of_the_places_inside(shape in region()) {
            const N: usize = 300;
            let [low, high] = bounds(&shape).unwrap();
            let step = [0, 1].map(|d| (high[d] - low[d]) / N as f64);
            let inside = |k: usize| {
                let at = [low[0] + (0.5 + (k % N) as f64) * step[0], low[1] + (0.5 + (k / N) as f64) * step[1]];
                contains(&shape, at, &|_| false)
            };
            let counted = (0..N * N).filter(|&k| inside(k)).count() as f64 * step[0] * step[1];
            let found = area(&shape).unwrap();
            prop_assert!((found - counted).abs() < 0.02, "{found}, counted {counted}");
        }
    }
}
