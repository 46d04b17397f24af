//! The matrix of a level by rows, in single precision because every cycle reads it several times.

/// Number of entries that are processed at once.
const LANES: usize = 4;

/// Largest number of rows in a task that is not divided further.
const GRAIN: usize = 128;

/// A square matrix of N×N blocks by rows. In a row, the entries of its first component are stored contiguously,
/// followed by the entries of the second component, and so on; each component is padded with zeros to a multiple of
/// [`LANES`].
#[derive(Debug, Clone, Default)]
pub(super) struct Rows<const N: usize> {
    start: Vec<usize>,
    column: Vec<u32>,
    value_start: Vec<usize>,
    value: Vec<f32>,
    /// Largest number of entries of a component of a row, padding included.
    width: usize,
}

impl<const N: usize> Rows<N> {
    /// A matrix of zeros with these columns, ascending in each row; `start` has one entry more than there are rows.
    pub(super) fn new(start: Vec<usize>, column: Vec<u32>) -> Self {
        let mut value_start = vec![0];
        let (mut end, mut width) = (0, 0);
        for row in start.windows(2) {
            let own = ((row[1] - row[0]) * N).next_multiple_of(LANES);
            width = width.max(own);
            end += N * own;
            value_start.push(end);
        }
        Rows { start, column, value_start, value: vec![0.0; end], width }
    }

    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }

    pub(super) fn columns(&self, row: usize) -> &[u32] {
        &self.column[self.start[row]..self.start[row + 1]]
    }

    /// Entries of component i of a row: for the first column, for the second, and so on.
    #[inline(always)]
    pub(super) fn component(&self, row: usize, i: usize) -> &[f32] {
        let values = &self.value[self.value_start[row]..self.value_start[row + 1]];
        let width = values.len() / N;
        &values[i * width..(i + 1) * width]
    }

    /// The block on the diagonal.
    pub(super) fn diagonal(&self, row: usize) -> [[f64; N]; N] {
        let place = self.columns(row).binary_search(&(row as u32)).unwrap_or_default();
        std::array::from_fn(|i| std::array::from_fn(|k| f64::from(self.component(row, i)[place * N + k])))
    }

    /// Calls `work` with pieces of consecutive rows, in parallel; [`Piece::for_each`] visits the rows to be written.
    pub(super) fn fill(&mut self, work: &(impl Fn(Piece<N>) + Sync)) {
        let n = self.len();
        let piece = Piece {
            first: 0,
            start: &self.start,
            column: &self.column,
            value_start: &self.value_start[..n + 1],
            value: &mut self.value,
        };
        piece.divide(work);
    }

    /// The product of a row and a vector; `entries` is working space for [`Rows::width`] numbers.
    #[inline(always)]
    pub(super) fn times(&self, row: usize, x: &[[f64; N]], entries: &mut [f64]) -> [f64; N] {
        let columns = self.columns(row);
        for (place, &column) in entries.as_chunks_mut::<N>().0.iter_mut().zip(columns) {
            *place = x[column as usize];
        }
        let width = (columns.len() * N).next_multiple_of(LANES);
        entries[columns.len() * N..width].fill(0.0);
        let entries = entries[..width].as_chunks::<LANES>().0;
        let mut product = [0.0; N];
        // Plain loops are compiled with the same vector instructions as the enclosing function.
        for i in 0..N {
            let mut lanes = [0.0; LANES];
            for (a, x) in self.component(row, i).as_chunks::<LANES>().0.iter().zip(entries) {
                for l in 0..LANES {
                    lanes[l] += f64::from(a[l]) * x[l];
                }
            }
            product[i] = (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]);
        }
        product
    }

    /// Largest number of entries of a component of a row, padding included.
    pub(super) fn width(&self) -> usize {
        self.width
    }
}

/// A range of consecutive rows to be written.
pub(super) struct Piece<'a, const N: usize> {
    first: usize,
    start: &'a [usize],
    column: &'a [u32],
    value_start: &'a [usize],
    value: &'a mut [f32],
}

impl<'a, const N: usize> Piece<'a, N> {
    fn divide(self, work: &(impl Fn(Piece<N>) + Sync)) {
        let n = self.value_start.len() - 1;
        if n <= GRAIN {
            return work(self);
        }
        let middle = n / 2;
        let (left, right) = self.value.split_at_mut(self.value_start[middle] - self.value_start[0]);
        let (first, start, column) = (self.first, self.start, self.column);
        let left = Piece { first, start, column, value_start: &self.value_start[..=middle], value: left };
        let value_start = &self.value_start[middle..];
        let right = Piece { first: first + middle, start, column, value_start, value: right };
        rayon::join(|| left.divide(work), || right.divide(work));
    }

    /// Calls `work(row, its columns, its values)` for every row; the values consist of N blocks of equal length,
    /// the i-th of which belongs to component i.
    #[inline(always)]
    pub(super) fn for_each(self, mut work: impl FnMut(usize, &[u32], &mut [f32])) {
        let mut value = self.value;
        for k in 0..self.value_start.len() - 1 {
            let (own, rest) = value.split_at_mut(self.value_start[k + 1] - self.value_start[k]);
            value = rest;
            let row = self.first + k;
            work(row, &self.column[self.start[row]..self.start[row + 1]], own);
        }
    }
}

/// Calls `work(first, part)` to write all parts of a vector; the division into parts does not affect the result.
pub(super) fn in_parts<T: Send>(first: usize, out: &mut [T], work: &(impl Fn(usize, &mut [T]) + Sync)) {
    if out.len() <= GRAIN {
        return work(first, out);
    }
    let middle = out.len() / 2;
    let (left, right) = out.split_at_mut(middle);
    rayon::join(|| in_parts(first, left, work), || in_parts(first + middle, right, work));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of rows with 0 to 5 blocks, which fill lanes partly and fully, equal plain sums. The working space is
    /// full of NaN, so that every entry that is read must have been written.
    fn products_equal_plain_sums<const N: usize>() {
        let columns = [vec![], vec![2], vec![0, 3], vec![0, 1, 4], vec![1, 2, 3, 5], vec![0, 1, 2, 3, 4]];
        let mut start = vec![0];
        start.extend(columns.iter().scan(0, |end, row: &Vec<u32>| {
            *end += row.len();
            Some(*end)
        }));
        let mut rows = Rows::<N>::new(start, columns.concat());
        let entry = |row: usize, i: usize, column: u32, k: usize| {
            ((row + 1) * 7 + i * 5 + column as usize * 3 + k * 11) as f32 / 8.0
        };
        rows.fill(&|piece: Piece<N>| {
            piece.for_each(|row, columns, values| {
                let width = values.len() / N;
                for i in 0..N {
                    for (place, &column) in columns.iter().enumerate() {
                        for k in 0..N {
                            values[i * width + place * N + k] = entry(row, i, column, k);
                        }
                    }
                }
            });
        });
        let x: Vec<[f64; N]> =
            (0..6).map(|c| std::array::from_fn(|k| f64::from(2 * c + 1) / (k as f64 + 2.0))).collect();
        for (row, columns) in columns.iter().enumerate() {
            let mut working_space = vec![f64::NAN; rows.width()];
            let product = rows.times(row, &x, &mut working_space);
            for i in 0..N {
                let sum: f64 = columns
                    .iter()
                    .flat_map(|&c| (0..N).map(move |k| (c, k)))
                    .map(|(c, k)| f64::from(entry(row, i, c, k)) * x[c as usize][k])
                    .sum();
                assert!(
                    (product[i] - sum).abs() <= 1e-13 * sum.abs(),
                    "N = {N}, row {row}: {} {sum}",
                    product[i]
                );
            }
        }
    }

    #[test]
    fn products_of_rows_equal_plain_sums() {
        products_equal_plain_sums::<1>();
        products_equal_plain_sums::<2>();
        products_equal_plain_sums::<3>();
        products_equal_plain_sums::<4>();
    }
}
