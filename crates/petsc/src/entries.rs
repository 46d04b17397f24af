//! The numbers of the unknowns over all ranks, and the matrix entries at these unknowns.

use std::ops::Range;

use mpm_core::linear::{BlockMatrix, LinearError};
use mpm_core::ranks::Halo;

use crate::error::Error;
use crate::ffi::PetscInt;
use crate::objects::index;

/// Marks a component that is not an unknown.
const NONE: PetscInt = -1;

/// The numbers of unknowns over all ranks: each rank numbers the unknowns at its own nodes, after those of lower ranks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct GlobalNumbers<const N: usize> {
    /// Number at each component of each active node of this rank, or [`NONE`].
    number: Vec<[PetscInt; N]>,
    /// The numbers of the unknowns at the own nodes of this rank.
    own: Range<usize>,
    /// Number of unknowns of all ranks.
    count: usize,
    /// Index of each own unknown among the components of the active nodes.
    places: Vec<u32>,
}

impl<const N: usize> GlobalNumbers<N> {
    /// Numbers those components of `n` nodes for which `is_unknown` holds. All ranks must call this.
    pub fn new(halo: &Halo, n: usize, is_unknown: impl Fn(usize, usize) -> bool) -> Result<Self, Error> {
        let components =
            (0..n).filter(|node| halo.is_own(*node)).flat_map(|node| (0..N).map(move |k| (node, k)));
        let places: Vec<u32> = components
            .filter(|(node, k)| is_unknown(*node, *k))
            .map(|(node, k)| (node * N + k) as u32)
            .collect();
        let counts = halo.ranks().gather_all(places.len() as u64);
        let count = counts.iter().sum::<u64>() as usize;
        index(count)?;
        let start = counts[..halo.ranks().own()].iter().sum::<u64>() as usize;
        // Numbers below 2^53 are exact.
        let mut exact = vec![[f64::from(NONE as i8); N]; n];
        for (k, place) in places.iter().enumerate() {
            exact.as_flattened_mut()[*place as usize] = (start + k) as f64;
        }
        halo.copy(&mut exact);
        let number = exact.into_iter().map(|node| node.map(|number| number as PetscInt)).collect();
        Ok(GlobalNumbers { number, own: start..start + places.len(), count, places })
    }

    /// Number of unknowns of this rank.
    pub fn own(&self) -> usize {
        self.own.len()
    }

    /// Number of unknowns of all ranks.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Copies the values at the own unknowns of this rank out of a complete field.
    pub fn take(&self, field: &[[f64; N]], own: &mut [f64]) {
        let field = field.as_flattened();
        own.iter_mut().zip(&self.places).for_each(|(value, place)| *value = field[*place as usize]);
    }

    /// Makes a complete field from the values at the own unknowns of each rank; it is zero where there is no unknown.
    /// All ranks must call this.
    pub fn spread(&self, halo: &Halo, own: &[f64], field: &mut [[f64; N]]) {
        field.fill([0.0; N]);
        let flat = field.as_flattened_mut();
        own.iter().zip(&self.places).for_each(|(value, place)| flat[*place as usize] = *value);
        halo.copy(field);
    }

    /// Indices of the own unknowns among the components of the active nodes.
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// Visits the matrix entries at unknowns, in both triangles even if the matrix is symmetric. `visit` receives the
    /// indices of the row and of the column among the components of the active nodes, and the index of the value among
    /// all values of all blocks.
    fn for_each_entry(&self, matrix: &BlockMatrix<N>, mut visit: impl FnMut(usize, usize, usize)) {
        matrix.for_each(|row, column, place| {
            let mirrored = matrix.symmetric && row != column;
            for i in 0..N {
                for k in 0..N {
                    if self.number[row][i] == NONE || self.number[column][k] == NONE {
                        continue;
                    }
                    let (a, b) = (row * N + i, column * N + k);
                    let source = (place * N + i) * N + k;
                    visit(a, b, source);
                    if mirrored {
                        visit(b, a, source);
                    }
                }
            }
        });
    }

    /// Rows and columns of the entries, followed by one further entry on the diagonal for each own unknown.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`].
    pub fn entries(&self, matrix: &BlockMatrix<N>) -> Result<[Vec<PetscInt>; 2], LinearError> {
        let mut n = self.own();
        self.for_each_entry(matrix, |_, _, _| n += 1);
        let [mut rows, mut columns] = [reserve(n)?, reserve(n)?];
        let number = self.number.as_flattened();
        self.for_each_entry(matrix, |row, column, _| {
            rows.push(number[row]);
            columns.push(number[column]);
        });
        let own = || self.own.clone().map(|number| number as PetscInt);
        rows.extend(own());
        columns.extend(own());
        Ok([rows, columns])
    }

    /// Values of the entries that `entries` lists; zero unless `is_coupled` holds for the indices of both the row and
    /// the column. `diagonal` lists the values of the further entries.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`].
    pub fn values(
        &self,
        matrix: &BlockMatrix<N>,
        diagonal: &[f64],
        is_coupled: impl Fn(usize) -> bool,
    ) -> Result<Vec<f64>, LinearError> {
        let flat = matrix.blocks.as_flattened().as_flattened();
        let mut n = self.own();
        self.for_each_entry(matrix, |_, _, _| n += 1);
        let mut values = reserve(n)?;
        self.for_each_entry(matrix, |row, column, source| {
            values.push(if is_coupled(row) && is_coupled(column) { flat[source] } else { 0.0 });
        });
        values.extend_from_slice(diagonal);
        Ok(values)
    }
}

fn reserve<T>(n: usize) -> Result<Vec<T>, LinearError> {
    let mut room = Vec::new();
    let needed = Some((n * size_of::<T>()) as u64);
    room.try_reserve_exact(n).map_err(|_| LinearError::OutOfMemory { needed })?;
    Ok(room)
}

/// The diagonal entries of a matrix as a complete field. All ranks must call this.
pub(crate) fn diagonal<const N: usize>(halo: &Halo, matrix: &BlockMatrix<N>) -> Vec<[f64; N]> {
    let mut diagonal = vec![[0.0; N]; matrix.column_start.len() - 1];
    matrix.for_each(|row, column, place| {
        if row == column {
            diagonal[row] = std::array::from_fn(|k| matrix.blocks[place][k][k]);
        }
    });
    halo.add(&mut diagonal);
    diagonal
}

/// The pattern of a matrix on this rank, kept to recognise a matrix with the same pattern.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Known<const N: usize> {
    numbers: GlobalNumbers<N>,
    symmetric: bool,
    column_start: Vec<usize>,
    row: Vec<u32>,
}

impl<const N: usize> Known<N> {
    pub fn new(numbers: GlobalNumbers<N>, matrix: &BlockMatrix<N>) -> Self {
        let BlockMatrix { symmetric, column_start, row, .. } = *matrix;
        Known { numbers, symmetric, column_start: column_start.to_vec(), row: row.to_vec() }
    }

    pub fn is(&self, numbers: &GlobalNumbers<N>, matrix: &BlockMatrix<N>) -> bool {
        self.symmetric == matrix.symmetric
            && self.column_start == matrix.column_start
            && self.row == matrix.row
            && self.numbers == *numbers
    }

    pub fn numbers(&self) -> &GlobalNumbers<N> {
        &self.numbers
    }

    pub fn symmetric(&self) -> bool {
        self.symmetric
    }
}
