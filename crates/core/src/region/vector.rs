//! Sums and products of vectors.

pub(super) fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|d| a[d] * b[d]).sum()
}

pub(super) fn minus<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|d| a[d] - b[d])
}

/// a + t b.
pub(super) fn along<const D: usize>(a: &[f64; D], t: f64, b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|d| a[d] + t * b[d])
}

pub(super) fn norm<const D: usize>(a: &[f64; D]) -> f64 {
    dot(a, a).sqrt()
}

pub(super) fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The unit vector of an axis.
pub(super) fn unit<const D: usize>(axis: usize) -> [f64; D] {
    std::array::from_fn(|d| if d == axis { 1.0 } else { 0.0 })
}
