//! Values of the fields of material points, and the numbers of which they consist.

use crate::tensor::{Mat3, Sym3};

/// A value that a field holds for a point.
pub trait Value: Copy + PartialEq + Send + Sync {
    /// Number of components of a value.
    const COMPONENTS: usize;
    /// The value whose numbers are all zero.
    const ZERO: Self;

    /// A component of the value as it is stored.
    fn number(&self, c: usize) -> f64;

    /// A component of the value as reported to users: matrices row by row, symmetric tensors in the order xx, yy, zz,
    /// xy, yz, xz without the factors √2 of the Mandel layout.
    fn component(&self, c: usize) -> f64 {
        self.number(c)
    }
}

/// A value that can be rebuilt from its stored numbers.
pub trait Restored: Value {
    /// Builds a value from [`Value::COMPONENTS`] stored numbers.
    fn from_numbers(numbers: &[f64]) -> Self;
}

impl Value for f64 {
    const COMPONENTS: usize = 1;
    const ZERO: f64 = 0.0;

    #[inline]
    fn number(&self, _: usize) -> f64 {
        *self
    }
}

impl Restored for f64 {
    fn from_numbers(numbers: &[f64]) -> f64 {
        numbers[0]
    }
}

impl<const N: usize> Value for [f64; N] {
    const COMPONENTS: usize = N;
    const ZERO: [f64; N] = [0.0; N];

    #[inline]
    fn number(&self, c: usize) -> f64 {
        self[c]
    }
}

impl<const N: usize> Restored for [f64; N] {
    fn from_numbers(numbers: &[f64]) -> [f64; N] {
        std::array::from_fn(|c| numbers[c])
    }
}

impl Value for Mat3 {
    const COMPONENTS: usize = 9;
    const ZERO: Mat3 = Mat3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

    #[inline]
    fn number(&self, c: usize) -> f64 {
        self[c] // column by column
    }

    fn component(&self, c: usize) -> f64 {
        self[(c / 3, c % 3)]
    }
}

impl Restored for Mat3 {
    fn from_numbers(numbers: &[f64]) -> Mat3 {
        Mat3::from_column_slice(numbers)
    }
}

impl Value for Sym3 {
    const COMPONENTS: usize = 6;
    const ZERO: Sym3 = Sym3::ZERO;

    #[inline]
    fn number(&self, c: usize) -> f64 {
        self.0[c]
    }

    fn component(&self, c: usize) -> f64 {
        self.components()[c]
    }
}

impl Restored for Sym3 {
    fn from_numbers(numbers: &[f64]) -> Sym3 {
        Sym3(Restored::from_numbers(numbers))
    }
}

/// Implements [`Value`] and [`Restored`] for integer types.
macro_rules! whole {
    ($($number:ty),*) => {$(
        impl Value for $number {
            const COMPONENTS: usize = 1;
            const ZERO: $number = 0;

            fn number(&self, _: usize) -> f64 {
                f64::from(*self)
            }
        }

        impl Restored for $number {
            fn from_numbers(numbers: &[f64]) -> $number {
                numbers[0] as $number
            }
        }
    )*};
}

whole!(u8, u16, u32);

impl Value for bool {
    const COMPONENTS: usize = 1;
    const ZERO: bool = false;

    fn number(&self, _: usize) -> f64 {
        f64::from(u8::from(*self))
    }
}

impl Restored for bool {
    fn from_numbers(numbers: &[f64]) -> bool {
        numbers[0] != 0.0
    }
}

/// One array for users of the library: the values of a field in the order of the permanent numbers of the points.
#[derive(Debug, Clone, PartialEq)]
pub struct PointValues {
    /// Number of components per point.
    pub components: usize,
    /// All components of point 0, then those of point 1, and so on.
    pub values: Vec<f64>,
}

impl PointValues {
    /// One value for each point, in this order.
    pub(crate) fn new<T: Value>(order: &[usize], value: impl Fn(usize) -> T) -> PointValues {
        let components = |p: &usize| {
            let value = value(*p);
            (0..T::COMPONENTS).map(move |c| value.component(c))
        };
        PointValues { components: T::COMPONENTS, values: order.iter().flat_map(components).collect() }
    }

    /// `per_point` values of a stored field for each point, in this order; zero for values that have no entry.
    pub(super) fn stored<T: Value>(values: &[T], per_point: usize, order: &[usize]) -> PointValues {
        let range = |p: &usize| p * per_point..(p + 1) * per_point;
        let value = |k| values.get(k).copied().unwrap_or(T::ZERO);
        let components = |k| (0..T::COMPONENTS).map(move |c| value(k).component(c));
        PointValues {
            components: per_point * T::COMPONENTS,
            values: order.iter().flat_map(range).flat_map(components).collect(),
        }
    }
}
