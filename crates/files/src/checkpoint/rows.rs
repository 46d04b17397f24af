//! The points in a checkpoint, on their way to the ranks that hold their fixed data.

use serde::{Deserialize, Serialize};

use mpm_core::model::Model;
use mpm_core::points::{ByNumber, FieldHandle, Points};
use mpm_core::ranks::Ranks;

/// Points from a checkpoint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Rows {
    id: Vec<u32>,
    cell: Vec<u32>,
    /// The declared fields of the state, and the further fields that change.
    fields: Vec<Vec<f64>>,
    /// Number of components of each field.
    components: Vec<usize>,
    #[serde(skip)]
    further: Vec<FieldHandle>,
}

impl Rows {
    /// An empty set of points with the same fields as these points.
    pub fn new<const D: usize>(points: &Points<D>, further: &[FieldHandle]) -> Rows {
        let mut components = Vec::new();
        let visited: Result<(), std::convert::Infallible> = points.for_each_field(|field, _| {
            components.push(field.components);
            Ok(())
        });
        let Ok(()) = visited;
        components.extend(further.iter().map(|handle| points.further.field(*handle).components));
        Rows {
            fields: vec![Vec::new(); components.len()],
            components,
            further: further.to_vec(),
            ..Rows::default()
        }
    }

    /// Adds the points whose arrays these bytes hold.
    pub fn read(&mut self, n: usize, bytes: &[u8]) -> Result<(), String> {
        let mut rest = Arrays { bytes };
        self.id.extend(rest.words(n)?);
        self.cell.extend(rest.words(n)?);
        for (field, components) in self.fields.iter_mut().zip(&self.components) {
            field.extend(rest.numbers(n.saturating_mul(*components))?);
        }
        if rest.bytes.is_empty() {
            Ok(())
        } else {
            Err("it is longer than its number of points requires".to_owned())
        }
    }

    /// Exchanges points so that each rank has the points whose numbers are assigned to it.
    pub fn by_number(self, ranks: &Ranks, division: ByNumber) -> Rows {
        let mut places = vec![Vec::new(); ranks.count()];
        for (place, id) in self.id.iter().enumerate() {
            places[division.rank_of(*id)].push(place);
        }
        let chosen = |places: &Vec<usize>| Rows {
            id: places.iter().map(|place| self.id[*place]).collect(),
            cell: places.iter().map(|place| self.cell[*place]).collect(),
            fields: (self.fields.iter().zip(&self.components))
                .map(|(field, n)| {
                    places.iter().flat_map(|place| &field[place * n..][..*n]).copied().collect()
                })
                .collect(),
            ..Rows::default()
        };
        let messages = places.iter().map(chosen).enumerate().filter(|(_, rows)| !rows.id.is_empty());
        let received = ranks.exchange(messages.collect());
        let n = self.components.len();
        let mut own = Rows {
            fields: vec![Vec::new(); n],
            components: self.components,
            further: self.further,
            ..Rows::default()
        };
        for (_, rows) in received {
            own.id.extend(rows.id);
            own.cell.extend(rows.cell);
            own.fields.iter_mut().zip(rows.fields).for_each(|(field, more)| field.extend(more));
        }
        own
    }

    /// Gives the points of a model the state and the order of these rows.
    ///
    /// # Errors
    /// If the rows belong to other points, or if no run can have left the points in this state.
    pub fn restore<const D: usize>(self, model: &Model<D>, points: &mut Points<D>) -> Result<(), String> {
        if self.id.len() != points.len() {
            return Err("it belongs to other points".to_owned());
        }
        let mut fields = self.fields.into_iter();
        let state = points.read_state(|_, _| Ok::<_, String>(fields.next().unwrap_or_default()))?;
        if self.cell.iter().any(|&cell| cell as usize >= model.grid.n_cells()) {
            return Err("a point is in a cell that does not exist".to_owned());
        }
        if state.half_lengths.iter().flatten().any(|length| *length < 0.0) {
            return Err("a domain has a negative length".to_owned());
        }
        if state.deformation_gradient.iter().any(|f| f.determinant() <= 0.0) {
            return Err("a point is turned inside out".to_owned());
        }
        points.restore(&self.id, self.cell, state)?;
        for (handle, values) in self.further.iter().zip(fields) {
            points.further.restore(*handle, &values);
        }
        Ok(())
    }
}

/// Reader of consecutive arrays.
struct Arrays<'a> {
    bytes: &'a [u8],
}

impl Arrays<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let (taken, rest) = self.bytes.split_at_checked(n).ok_or_else(|| {
            "it is shorter than its number of points \
             requires"
                .to_owned()
        })?;
        self.bytes = rest;
        Ok(taken)
    }

    fn words(&mut self, n: usize) -> Result<Vec<u32>, String> {
        Ok(self
            .take(n.saturating_mul(4))?
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| u32::from_le_bytes(*b))
            .collect())
    }

    fn numbers(&mut self, n: usize) -> Result<Vec<f64>, String> {
        let numbers: Vec<f64> = self
            .take(n.saturating_mul(8))?
            .as_chunks::<8>()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b))
            .collect();
        if numbers.iter().all(|x| x.is_finite()) {
            Ok(numbers)
        } else {
            Err("a number is not finite".to_owned())
        }
    }
}
