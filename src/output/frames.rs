//! What shows a step: the points, their domains and the active part of the grid, each a file of a series, encoded.

use std::io;
use std::sync::Arc;

use crate::basis::{Connectivity, DomainKind};
use crate::model::Model;
use crate::points::Points;
use crate::solver::Step;
use crate::tensor::padded;

use super::directory::{SERIES, file_name};
use super::fields::{GridMesh, Of, PointField, grid_mesh, vector, volumes};
use super::invalid;
use super::vtu::{CellKind, Cells, Encoded, Field, File, Kinds, Precision, Room, Values};

/// A file of a series, independent of the run.
pub(super) struct Frame {
    /// Number of the series.
    pub series: usize,
    /// Name of the file.
    pub name: String,
    /// The step that it shows.
    pub step: Step,
    /// The file.
    pub file: File,
}

impl Frame {
    fn new(series: usize, step: Step, file: Result<File, String>) -> io::Result<Frame> {
        let name = file_name(SERIES[series], step.index);
        match file {
            Ok(file) => Ok(Frame { series, name, step, file }),
            Err(problem) => Err(invalid(format!("{name}: {problem}"))),
        }
    }
}

/// Makes the frames of a run.
pub(super) struct Frames {
    fields: Vec<PointField>,
    precision: Precision,
    room: Room,
    /// What is the same in all frames of the points, once there is one, and in those of the domains.
    steady: [Option<Steady>; 2],
}

/// What is the same in all frames of a series.
#[derive(Clone)]
struct Steady {
    cells: Arc<Cells>,
    identity: Vec<Arc<Encoded>>,
}

/// A field on the active nodes of the grid.
pub(super) type OnNodes<'a, const D: usize> = (&'a str, &'a [[f64; D]]);

impl Frames {
    /// With these fields of the points, in numbers of this size.
    pub fn new(fields: &[PointField], precision: Precision) -> Frames {
        Frames { fields: fields.to_vec(), precision, room: Room::default(), steady: [None, None] }
    }

    /// The points of the converged state, and their domains if they have any.
    ///
    /// # Errors
    /// `InvalidInput` if a number is not finite.
    pub fn of_points<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        step: Step,
    ) -> io::Result<Vec<Frame>> {
        let (order, room) = (points.by_id(), self.room.clone());
        let all = volumes(model, points, &order);
        let of = Of { model, points, order: &order, volumes: &all, precision: self.precision, room: &room };
        let fields = of.fields(&self.fields);
        let file = fields.clone().and_then(|fields| self.file(0, of, fields, step));
        let mut frames = vec![Frame::new(0, step, file)?];
        let domain = |p: usize| model.bodies[points.body[p] as usize].method.domain();
        let with_domain: Vec<usize> =
            order.iter().copied().filter(|&p| domain(p) != DomainKind::None).collect();
        let file = if with_domain.len() == order.len() {
            fields.and_then(|fields| self.file(1, of, fields, step))
        } else if !with_domain.is_empty() {
            let some = volumes(model, points, &with_domain);
            let of = Of { order: &with_domain, volumes: &some, ..of };
            of.fields(&self.fields).and_then(|fields| self.file(1, of, fields, step))
        } else {
            return Ok(frames);
        };
        frames.push(Frame::new(1, step, file)?);
        Ok(frames)
    }

    /// The file of a series, of points as cells or of their domains.
    fn file<const D: usize>(
        &mut self,
        series: usize,
        of: Of<D>,
        mut fields: Vec<Arc<Encoded>>,
        step: Step,
    ) -> Result<File, String> {
        let domains = if series == 0 { vec![CellKind::Vertex; of.order.len()] } else { of.domains() };
        let steady = match &mut self.steady[series] {
            Some(steady) => steady,
            none => {
                let n: usize = domains.iter().map(|kind| kind.points()).sum();
                let corners: Vec<i64> = (0..n as i64).collect();
                let cells = Cells::new(n, &Kinds::Each(&domains), &corners, of.room)?;
                none.insert(Steady { cells: Arc::new(cells), identity: of.identity()? })
            }
        };
        fields.extend(steady.identity.iter().cloned());
        let (cells, index) = (Arc::clone(&steady.cells), step.index as i64);
        if series == 0 {
            File::new(step.end, index, of.positions()?, cells, fields, Vec::new())
        } else {
            File::new(step.end, index, of.corners(&domains)?, cells, Vec::new(), fields)
        }
    }

    /// The active part of the grid, with these fields on its nodes.
    ///
    /// # Errors
    /// As [`Frames::of_points`].
    pub fn of_grid<const D: usize>(
        &self,
        model: &Model<D>,
        links: &Connectivity<D>,
        fields: &[OnNodes<D>],
        step: Step,
    ) -> io::Result<Frame> {
        let GridMesh { nodes, corners, kinds } = grid_mesh(model, links);
        let file = || {
            let (n, room) = (nodes.len(), &self.room);
            let positions =
                Encoded::positions(n, Values::Float64(nodes.as_flattened()), self.precision, room)?;
            let cells = Cells::new(n, &Kinds::Each(&kinds), &corners, room)?;
            let encoded = |(name, values): &OnNodes<D>| {
                let values: Vec<[f64; 3]> = values.iter().map(padded).collect();
                let field: Field = vector(name, &values);
                Encoded::new(&field, ("point", n), self.precision, room).map(Arc::new)
            };
            let fields = fields.iter().map(encoded).collect::<Result<_, String>>()?;
            let (positions, cells) = (Arc::new(positions), Arc::new(cells));
            File::new(step.end, step.index as i64, positions, cells, fields, Vec::new())
        };
        Frame::new(2, step, file())
    }
}
