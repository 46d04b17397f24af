//! Sums and products of vectors.

pub(crate) fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|d| a[d] * b[d]).sum()
}

pub(crate) fn minus<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|d| a[d] - b[d])
}

/// a + t b.
pub(crate) fn along<const D: usize>(a: &[f64; D], t: f64, b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|d| a[d] + t * b[d])
}

pub(crate) fn norm<const D: usize>(a: &[f64; D]) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The unit vector of an axis.
pub(crate) fn unit<const D: usize>(axis: usize) -> [f64; D] {
    std::array::from_fn(|d| if d == axis { 1.0 } else { 0.0 })
}

/// Two unit vectors normal to a direction and to each other; aligned with the axes if the direction is.
pub(crate) fn frame(direction: &[f64; 3]) -> [[f64; 3]; 2] {
    let length = norm(direction);
    let n = direction.map(|x| x / length);
    let least = (0..3).min_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap_or(0);
    let e = along(&unit(least), -n[least], &n);
    let length = norm(&e);
    let e = e.map(|x| x / length);
    [e, cross(&n, &e)]
}
