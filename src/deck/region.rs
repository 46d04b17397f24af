//! Regions of the plane that bodies fill: what lies inside, their bounds and area.

use super::Shape;
use super::build::pair;

mod area;

/// A box with sides along the axes, as lowest and highest corner.
pub type Bounds = [[f64; 2]; 2];

/// Whether a position lies in a region. Whole cells ([`Shape::Cells`]) are decided by `in_cells`, which gets the name
/// of the group.
pub fn contains(shape: &Shape, x: [f64; 2], in_cells: &dyn Fn(Option<&str>) -> bool) -> bool {
    match shape {
        Shape::Box { min, max } => {
            let (min, max) = (pair(min), pair(max));
            (0..2).all(|d| min[d] <= x[d] && x[d] <= max[d])
        }
        Shape::Polygon { vertices } => in_polygon(vertices, x),
        Shape::Circle { center, radius } => distance(center, x) <= *radius,
        Shape::Annulus { center, inner, outer } => {
            let r = distance(center, x);
            *inner <= r && r <= *outer
        }
        Shape::Cells { group } => in_cells(group.as_deref()),
        Shape::Union { of } => of.iter().any(|part| contains(part, x, in_cells)),
        Shape::Difference { from, minus } => {
            contains(from, x, in_cells) && !minus.iter().any(|part| contains(part, x, in_cells))
        }
    }
}

fn distance(center: &[f64], x: [f64; 2]) -> f64 {
    let c = pair(center);
    (x[0] - c[0]).hypot(x[1] - c[1])
}

/// By the number of edges that a ray from the position crosses.
fn in_polygon(vertices: &[Vec<f64>], x: [f64; 2]) -> bool {
    let mut inside = false;
    for (k, a) in vertices.iter().enumerate() {
        let (a, b) = (pair(a), pair(&vertices[(k + 1) % vertices.len()]));
        if (a[1] > x[1]) != (b[1] > x[1]) && x[0] < a[0] + (x[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            inside = !inside;
        }
    }
    inside
}

/// Area of a region, exact but for round-off; `None` where whole cells are part of it.
pub fn area(shape: &Shape) -> Option<f64> {
    match shape {
        Shape::Box { min, max } => {
            let (min, max) = (pair(min), pair(max));
            Some((max[0] - min[0]) * (max[1] - min[1]))
        }
        Shape::Polygon { vertices } => Some(signed_area(vertices).abs()),
        Shape::Circle { radius, .. } => Some(std::f64::consts::PI * radius * radius),
        Shape::Annulus { inner, outer, .. } => Some(std::f64::consts::PI * (outer - inner) * (outer + inner)),
        Shape::Cells { .. } => None,
        Shape::Union { .. } | Shape::Difference { .. } => area::area(shape),
    }
}

/// Area of a polygon, positive when its corners go round against the clock.
pub fn signed_area(vertices: &[Vec<f64>]) -> f64 {
    let cross = |k: usize| {
        let (a, b) = (pair(&vertices[k]), pair(&vertices[(k + 1) % vertices.len()]));
        a[0] * b[1] - a[1] * b[0]
    };
    0.5 * (0..vertices.len()).map(cross).sum::<f64>()
}

/// Bounds of a region; `None` where whole cells are part of it.
pub fn bounds(shape: &Shape) -> Option<Bounds> {
    let round = |center: &[f64], radius: f64| {
        let c = pair(center);
        [[c[0] - radius, c[1] - radius], [c[0] + radius, c[1] + radius]]
    };
    match shape {
        Shape::Box { min, max } => Some([pair(min), pair(max)]),
        Shape::Polygon { vertices } => vertices.iter().map(|v| [pair(v), pair(v)]).reduce(hull),
        Shape::Circle { center, radius } => Some(round(center, *radius)),
        Shape::Annulus { center, outer, .. } => Some(round(center, *outer)),
        Shape::Cells { .. } => None,
        Shape::Union { of } => {
            let parts: Option<Vec<Bounds>> = of.iter().map(bounds).collect();
            parts?.into_iter().reduce(hull)
        }
        Shape::Difference { from, .. } => bounds(from),
    }
}

/// Whether a cell with these bounds may have a part in a region; `in_cells` as for [`contains`].
pub fn may_meet(shape: &Shape, cell: Bounds, in_cells: &dyn Fn(Option<&str>) -> bool) -> bool {
    match shape {
        Shape::Cells { group } => in_cells(group.as_deref()),
        Shape::Union { of } => of.iter().any(|part| may_meet(part, cell, in_cells)),
        Shape::Difference { from, .. } => may_meet(from, cell, in_cells),
        _ => bounds(shape)
            .is_none_or(|[low, high]| (0..2).all(|d| cell[0][d] <= high[d] && low[d] <= cell[1][d])),
    }
}

fn hull(a: Bounds, b: Bounds) -> Bounds {
    [[a[0][0].min(b[0][0]), a[0][1].min(b[0][1])], [a[1][0].max(b[1][0]), a[1][1].max(b[1][1])]]
}

/// All groups of cells that a region names, each with its place in the deck; `place` is that of the region.
pub fn groups<'a>(shape: &'a Shape, place: &str) -> Vec<(String, &'a str)> {
    let of_all = |parts: &'a [Shape], key: &str| -> Vec<(String, &'a str)> {
        let parts = parts.iter().enumerate();
        parts.flat_map(|(k, part)| groups(part, &format!("{place}/{key}/{k}"))).collect()
    };
    match shape {
        Shape::Cells { group } => {
            group.iter().map(|name| (format!("{place}/group"), name.as_str())).collect()
        }
        Shape::Union { of } => of_all(of, "of"),
        Shape::Difference { from, minus } => {
            let mut all = groups(from, &format!("{place}/from"));
            all.extend(of_all(minus, "minus"));
            all
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(shape: &Shape, x: [f64; 2]) -> bool {
        contains(shape, x, &|_| false)
    }

    #[test]
    fn regions_contain_what_they_should() {
        let square = Shape::Box { min: vec![0.0, 0.0], max: vec![2.0, 2.0] };
        let hole = Shape::Circle { center: vec![1.0, 1.0], radius: 0.5 };
        let plate = Shape::Difference { from: Box::new(square.clone()), minus: vec![hole.clone()] };
        assert!(inside(&plate, [0.1, 0.1]) && !inside(&plate, [1.0, 1.2]) && !inside(&plate, [3.0, 1.0]));
        let both = Shape::Union { of: vec![plate, hole] };
        assert!(inside(&both, [1.0, 1.2]));
        let ring = Shape::Annulus { center: vec![0.0, 0.0], inner: 1.0, outer: 2.0 };
        assert!(inside(&ring, [1.5, 0.0]) && !inside(&ring, [0.5, 0.0]) && !inside(&ring, [2.0, 0.5]));
        let vertices = vec![vec![0.0, 0.0], vec![2.0, 0.0], vec![2.0, 2.0], vec![1.0, 0.5], vec![0.0, 2.0]];
        let notched = Shape::Polygon { vertices: vertices.clone() };
        assert!(inside(&notched, [0.2, 1.0]) && !inside(&notched, [1.0, 1.0]));
        assert_eq!(area(&notched), Some(2.5));
        assert_eq!(signed_area(&vertices), 2.5);
        assert_eq!(bounds(&both), Some([[0.0, 0.0], [2.0, 2.0]]));
    }
}
