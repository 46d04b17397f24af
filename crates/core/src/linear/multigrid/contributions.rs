//! Rows of a level to which several ranks contribute: each rank sends its part of the rows of another rank to that
//! rank.

use rayon::prelude::*;

use crate::linear::Block;
use crate::ranks::Ranks;

use super::ghosts::{Messages, Register};

/// The columns of a part of a row: their position numbers and ranks.
type Columns = Vec<(u64, u32)>;

/// The part of a row that comes from another rank.
#[derive(Debug, Clone)]
struct Part {
    row: u32,
    /// Index of the sending rank in [`Messages::with`], and index of the first block of the part in the message.
    from: usize,
    first: usize,
    /// For each column of the part, its index in the complete row.
    places: Vec<u32>,
}

/// The parts of rows that pass between ranks.
#[derive(Debug, Clone)]
pub(super) struct Contributions {
    /// The rows that are sent and received, as messages with one value per row.
    pub rows: Messages,
    /// Columns of the rows that are sent to each rank.
    columns: Vec<Vec<Vec<u32>>>,
    /// Parts that are received, by row and then by rank.
    parts: Vec<Part>,
    /// For each own row, the index of its first part in `parts`.
    part_start: Vec<u32>,
    /// Number of blocks that are received from each rank.
    blocks: Vec<usize>,
}

/// The pattern of a matrix by rows: the start of each row, and the columns of all rows.
pub(super) struct RowColumns {
    pub start: Vec<usize>,
    pub column: Vec<u32>,
}

impl Contributions {
    /// Tells the other ranks which entries this rank contributes to rows of known nodes. Returns the columns of the own
    /// rows, ascending, including the diagonal; columns received from other ranks become ghosts.
    pub(super) fn new(ranks: &Ranks, register: &mut Register, rows: &RowColumns) -> (Self, RowColumns) {
        let RowColumns { start, column } = rows;
        let known = &register.known;
        let columns_of = |row: usize| &column[start[row]..start[row + 1]];
        let send = known.by_owner(|row| start[row + 1] > start[row]);
        let columns: Vec<(usize, Vec<Vec<u32>>)> = (send.iter())
            .map(|(rank, rows)| (*rank, rows.iter().map(|row| columns_of(*row as usize).to_vec()).collect()))
            .collect();
        let named = |node: &u32| (known.key[*node as usize], known.owner[*node as usize]);
        let message = |rows: &[u32]| -> Vec<(u64, Columns)> {
            let row = |row: &u32| (named(row).0, columns_of(*row as usize).iter().map(named).collect());
            rows.iter().map(row).collect()
        };
        let messages = ranks.exchange(send.iter().map(|(rank, rows)| (*rank, message(rows))).collect());
        let mut receive = Vec::new();
        let mut parts = Vec::new();
        for (rank, rows) in messages {
            let mut first = 0;
            let mut nodes = Vec::with_capacity(rows.len());
            for (key, columns) in rows {
                let Some(row) = register.own(key) else { continue };
                nodes.push(row);
                let places: Vec<u32> =
                    columns.iter().map(|(key, owner)| register.find_or_add(*key, *owner)).collect();
                let from = rank;
                parts.push(Part { row, from, first, places });
                first += columns.len();
            }
            receive.push((rank, nodes));
        }
        let rows = Messages::new(send, receive);
        let rank_at = |rank: usize| rows.with.partition_point(|other| *other < rank);
        let mut by_rank = vec![Vec::new(); rows.with.len()];
        columns.into_iter().for_each(|(rank, columns)| by_rank[rank_at(rank)] = columns);
        let mut blocks = vec![0; rows.with.len()];
        for part in &mut parts {
            part.from = rank_at(part.from);
            blocks[part.from] += part.places.len();
        }
        parts.sort_by_key(|part| part.row);
        let own = register.known.own;
        let mut part_start = vec![0; own + 1];
        parts.iter().for_each(|part| part_start[part.row as usize + 1] += 1);
        (0..own).for_each(|row| part_start[row + 1] += part_start[row]);
        let mut whole = RowColumns { start: vec![0], column: Vec::new() };
        let mut row_columns = Vec::new();
        for row in 0..own {
            row_columns.clear();
            row_columns.extend(columns_of(row));
            let parts = &mut parts[part_start[row] as usize..part_start[row + 1] as usize];
            parts.iter().for_each(|part| row_columns.extend(&part.places));
            row_columns.push(row as u32);
            row_columns.sort_unstable();
            row_columns.dedup();
            for place in parts.iter_mut().flat_map(|part| &mut part.places) {
                *place = row_columns.partition_point(|column| column < place) as u32;
            }
            whole.column.extend(&row_columns);
            whole.start.push(whole.column.len());
        }
        (Contributions { rows, columns: by_rank, parts, part_start, blocks }, whole)
    }

    /// Sends this rank's contributions to rows of other ranks; `part(row, columns, blocks)` writes them into blocks
    /// initialised to zero. Returns the contributions received.
    pub(super) fn pass<const N: usize>(
        &self,
        ranks: &Ranks,
        part: &(impl Fn(usize, &[u32], &mut [Block<N>]) + Sync),
    ) -> Vec<Vec<f64>> {
        let Some(communicator) = ranks.communicator() else { return Vec::new() };
        let product = |(row, columns): (&u32, &Vec<u32>)| {
            let mut blocks = vec![[[0.0; N]; N]; columns.len()];
            part(*row as usize, columns, &mut blocks);
            blocks
        };
        let send: Vec<Vec<f64>> = (self.rows.send.iter().zip(&self.columns))
            .map(|(rows, columns)| {
                let products: Vec<Vec<Block<N>>> = rows.par_iter().zip(columns).map(product).collect();
                products.into_iter().flatten().flatten().flatten().collect()
            })
            .collect();
        let mut receive: Vec<Vec<f64>> = self.blocks.iter().map(|n| vec![0.0; n * N * N]).collect();
        communicator.swap(&self.rows.with, &send, &mut receive);
        receive
    }

    /// Adds the contributions received for a row to its blocks, in rank order.
    #[inline(always)]
    pub(super) fn add<const N: usize>(&self, received: &[Vec<f64>], row: usize, blocks: &mut [Block<N>]) {
        for part in &self.parts[self.part_start[row] as usize..self.part_start[row + 1] as usize] {
            let numbers = received[part.from][part.first * N * N..].chunks_exact(N * N);
            for (place, numbers) in part.places.iter().zip(numbers) {
                let block = blocks[*place as usize].as_flattened_mut();
                block.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
            }
        }
    }
}
