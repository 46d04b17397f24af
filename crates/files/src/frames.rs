//! The encoded VTU files of a step: the points, their domains, the active part of the grid, the surfaces, the tools and
//! their contact points, each a file of a series. With several ranks, each rank creates its pieces of the first three.

use std::borrow::Cow;
use std::io;
use std::mem::take;
use std::sync::Arc;

use mpm_core::basis::{Connectivity, DomainKind};
use mpm_core::model::{Body, Model};
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;
use mpm_core::solver::Step;
use mpm_core::surface::SurfaceFields;
use mpm_core::tensor::padded;
use mpm_core::terms::{PairState, ToolState};

use super::directory::{SERIES, file_name, list_name, piece_name};
use super::fields::{GridMesh, PointField, PointSource, grid_mesh, number, vector, volumes};
use super::invalid;
use super::smoothed_pressure::smoothed_pressures;
use super::tool_frames::{Outlined, contact_points, surfaces_of_tools};
use super::vtu::{CellKind, Cells, Encoded, Field, File, Kinds, Pieces, Precision, Room, Values};

/// A file of a series, independent of the run.
pub(super) struct Frame {
    /// Index of the series.
    pub series: usize,
    /// Name of the file.
    pub name: String,
    /// The step that it shows.
    pub step: Step,
    /// The file.
    pub file: File,
    /// True if the file is a piece of the mesh that the series shows.
    pub is_piece: bool,
}

impl Frame {
    fn new(series: usize, step: Step, file: Result<File, String>) -> io::Result<Frame> {
        let name = file_name(SERIES[series], step.index);
        match file {
            Ok(file) => Ok(Frame { series, name, step, file, is_piece: false }),
            Err(problem) => Err(invalid(format!("{name}: {problem}"))),
        }
    }

    /// The frame of a mesh that is divided into pieces, one for each rank.
    fn divided(series: usize, step: Step, file: Result<File, String>, ranks: &Ranks) -> io::Result<Frame> {
        let frame = Frame::new(series, step, file)?;
        if ranks.is_alone() {
            return Ok(frame);
        }
        let name = piece_name(SERIES[series], step.index, ranks.own());
        Ok(Frame { name, is_piece: true, ..frame })
    }

    /// The list of the pieces of all ranks; `None` for a whole mesh.
    pub fn list(&self, ranks: &Ranks) -> Option<List> {
        let (series, index) = (SERIES[self.series], self.step.index);
        let names: Vec<String> = (0..ranks.count()).map(|rank| piece_name(series, index, rank)).collect();
        self.is_piece.then(|| List {
            series: self.series,
            name: list_name(series, index),
            step: self.step,
            pieces: Pieces::new(&self.file, &names),
        })
    }
}

/// The list of the pieces of a mesh, itself a file of a series.
pub(super) struct List {
    /// Index of the series.
    pub series: usize,
    /// Name of the file.
    pub name: String,
    /// The step that it shows.
    pub step: Step,
    /// The file.
    pub pieces: Pieces,
}

/// Creates the frames of a run.
pub(super) struct Frames {
    fields: Vec<PointField>,
    precision: Precision,
    room: Room,
    /// Reused memory for the order and the volumes of the points.
    order: Vec<usize>,
    volumes: Vec<[f64; 2]>,
    /// Parts that successive frames of the points share, and parts that successive frames of the domains share; created
    /// anew when the points change.
    steady: [Option<Steady>; 2],
    /// Stage and number of points of the last frame: a stage may add and remove bodies, and points may be split.
    shown: (usize, usize),
    /// The grid of the last frame.
    grid: Option<Active>,
    /// The surfaces of the tools; empty before the first frame.
    outlines: Vec<Outlined>,
}

/// Parts that successive frames of a series share.
#[derive(Clone)]
struct Steady {
    cells: Arc<Cells>,
    identity: Vec<Arc<Encoded>>,
}

impl Steady {
    /// Returns the stored parts, or creates them for cells of these kinds that share no points.
    fn once<const D: usize>(
        kept: &mut Option<Steady>,
        source: PointSource<D>,
        kinds: impl FnOnce() -> Vec<CellKind>,
    ) -> Result<Steady, String> {
        if let Some(steady) = kept {
            return Ok(steady.clone());
        }
        let kinds = kinds();
        let n: usize = kinds.iter().map(|kind| kind.points()).sum();
        let corners: Vec<i64> = (0..n as i64).collect();
        let cells = Arc::new(Cells::new(n, &Kinds::Each(&kinds), &corners, source.room)?);
        Ok(kept.insert(Steady { cells, identity: source.identity()? }).clone())
    }
}

/// A field on the active nodes of the grid.
pub(super) struct OnNodes<'a, const D: usize> {
    pub name: Cow<'a, str>,
    pub values: NodeValues<'a, D>,
}

/// The values of a field on the active nodes of the grid.
pub(super) enum NodeValues<'a, const D: usize> {
    /// Vectors along the axes.
    Vectors(&'a [[f64; D]]),
    /// A number of components at each node: those of the first node, then those of the second, and so on.
    Numbers { components: usize, values: &'a [f64] },
}

impl Frames {
    /// A creator of frames with these fields of the points, in this precision.
    pub fn new(fields: &[PointField], precision: Precision) -> Frames {
        let (room, order, volumes) = (Room::default(), Vec::new(), Vec::new());
        let steady = [None, None];
        Frames {
            fields: fields.to_vec(),
            precision,
            room,
            order,
            volumes,
            steady,
            shown: (0, 0),
            grid: None,
            outlines: Vec::new(),
        }
    }

    /// Sets the fields of the points, and their precision, for all later frames.
    pub fn change(&mut self, fields: &[PointField], precision: Precision) {
        let outlines = take(&mut self.outlines);
        *self = Frames { outlines, ..Frames::new(fields, precision) };
    }

    /// Frames of the points in their converged state, and of their domains if they have any. All ranks must call this
    /// together.
    ///
    /// # Errors
    /// `InvalidInput` if a number is not finite.
    pub fn point_frames<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        step: Step,
    ) -> io::Result<Vec<Frame>> {
        let shown = (model.present.stage, points.len());
        // With several ranks, points may have changed rank since the last frame.
        if shown != self.shown || !points.ranks.is_alone() {
            (self.shown, self.steady) = (shown, [None, None]);
        }
        let (mut order, mut all) = (take(&mut self.order), take(&mut self.volumes));
        points.order_by_id(&mut order);
        volumes(model, points, &order, &mut all);
        let frames = self.ordered_point_frames(model, points, &order, &all, step);
        (self.order, self.volumes) = (order, all);
        frames
    }

    /// Like [`Frames::point_frames`], for points in this order, with these J and volumes.
    fn ordered_point_frames<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        order: &[usize],
        all: &[[f64; 2]],
        step: Step,
    ) -> io::Result<Vec<Frame>> {
        let room = self.room.clone();
        let smoothed = self.smoothed(model, points, order, all);
        let source = PointSource {
            model,
            points,
            order,
            volumes: all,
            smoothed: &smoothed,
            precision: self.precision,
            room: &room,
        };
        let fields = source.fields(&self.fields);
        let file = fields.clone().and_then(|fields| self.points_file(source, fields, step));
        let ranks = &points.ranks;
        // All ranks smooth together, so a rank whose own frames have failed must still take part.
        let points_frame = Frame::divided(0, step, file, ranks);
        let with_domain = |body: &Body| body.method.domain() != DomainKind::None;
        let file = if model.bodies.iter().all(with_domain) {
            fields.and_then(|fields| self.domains_file(source, fields, step))
        } else if model.bodies.iter().any(with_domain) {
            let has_domain = |p: &usize| with_domain(&model.bodies[points.body[*p] as usize]);
            let order: Vec<usize> = order.iter().copied().filter(has_domain).collect();
            let mut some = Vec::new();
            volumes(model, points, &order, &mut some);
            let smoothed = self.smoothed(model, points, &order, &some);
            let source = PointSource { order: &order, volumes: &some, smoothed: &smoothed, ..source };
            source.fields(&self.fields).and_then(|fields| self.domains_file(source, fields, step))
        } else {
            return points_frame.map(|frame| vec![frame]);
        };
        Ok(vec![points_frame?, Frame::divided(1, step, file, ranks)?])
    }

    /// The smoothed pressures of some points with these J and volumes, if they are requested.
    fn smoothed<const D: usize>(
        &self,
        model: &Model<D>,
        points: &Points<D>,
        order: &[usize],
        volumes: &[[f64; 2]],
    ) -> Vec<f64> {
        if self.fields.contains(&PointField::PressureSmoothed) {
            smoothed_pressures(model, points, order, volumes)
        } else {
            Vec::new()
        }
    }

    /// The points, each a cell.
    fn points_file<const D: usize>(
        &mut self,
        source: PointSource<D>,
        mut fields: Vec<Arc<Encoded>>,
        step: Step,
    ) -> Result<File, String> {
        let vertices = || vec![CellKind::Vertex; source.order.len()];
        let steady = Steady::once(&mut self.steady[0], source, vertices)?;
        fields.extend(steady.identity);
        File::new(step.end, step.index as i64, source.positions()?, steady.cells, fields, Vec::new())
    }

    /// The domains of the points.
    fn domains_file<const D: usize>(
        &mut self,
        source: PointSource<D>,
        mut fields: Vec<Arc<Encoded>>,
        step: Step,
    ) -> Result<File, String> {
        let domains = source.domains();
        let steady = Steady::once(&mut self.steady[1], source, || domains.clone())?;
        fields.extend(steady.identity);
        File::new(step.end, step.index as i64, source.corners(&domains)?, steady.cells, Vec::new(), fields)
    }

    /// Frame of the active part of the grid, with these fields on its nodes. All ranks must call this together.
    ///
    /// # Errors
    /// As for [`Frames::point_frames`].
    pub fn grid_frame<const D: usize>(
        &mut self,
        model: &Model<D>,
        links: &Connectivity<D>,
        fields: &[OnNodes<D>],
        step: Step,
    ) -> io::Result<Frame> {
        let mesh = grid_mesh(model, links);
        let ranks = links.halo().ranks();
        Frame::divided(2, step, self.grid_file(mesh, fields, step), ranks)
    }

    /// Frame of all surfaces, with one point per sample; none without surfaces.
    ///
    /// # Errors
    /// As for [`Frames::point_frames`].
    pub fn surface_frame<const D: usize>(
        &mut self,
        surfaces: &[SurfaceFields<D>],
        step: Step,
    ) -> io::Result<Option<Frame>> {
        if surfaces.is_empty() {
            return Ok(None);
        }
        Frame::new(3, step, self.file_of_surfaces(surfaces, step)).map(Some)
    }

    /// Frames of the surfaces of all tools and of the contact points on tools and between bodies; none without tools and
    /// without contact between bodies.
    ///
    /// # Errors
    /// As for [`Frames::point_frames`].
    pub fn tool_frames<const D: usize>(
        &mut self,
        model: &Model<D>,
        tools: &[ToolState<D>],
        pairs: &[PairState<D>],
        step: Step,
    ) -> io::Result<Vec<Frame>> {
        if tools.is_empty() && pairs.is_empty() {
            return Ok(Vec::new());
        }
        if self.outlines.is_empty() {
            self.outlines = model.tools.iter().map(|tool| Outlined::new(tool, model)).collect();
        }
        let (precision, room) = (self.precision, &self.room);
        let contacts = Frame::new(5, step, contact_points(tools, pairs, step, precision, room))?;
        if tools.is_empty() {
            return Ok(vec![contacts]);
        }
        let surfaces = surfaces_of_tools(&self.outlines, model, tools, step, precision, room);
        Ok(vec![Frame::new(4, step, surfaces)?, contacts])
    }

    fn file_of_surfaces<const D: usize>(
        &mut self,
        surfaces: &[SurfaceFields<D>],
        step: Step,
    ) -> Result<File, String> {
        let (room, precision) = (&self.room, self.precision);
        type Vectors = Vec<[f64; 3]>;
        let vectors = |of: &dyn Fn(&SurfaceFields<D>) -> Vec<[f64; D]>| -> Vectors {
            surfaces.iter().flat_map(|surface| of(surface).iter().map(padded).collect::<Vec<_>>()).collect()
        };
        let scalars = |of: fn(&SurfaceFields<D>) -> &Vec<f64>| -> Vec<f64> {
            surfaces.iter().flat_map(|surface| of(surface).iter().copied()).collect()
        };
        let per_area = |surface: &SurfaceFields<D>, forces: &[[f64; D]]| {
            let areas = surface.area.iter().map(|area| if *area > 0.0 { 1.0 / area } else { 0.0 });
            forces.iter().zip(areas).map(|(force, by)| force.map(|f| f * by)).collect()
        };
        let positions = vectors(&|surface| surface.position.clone());
        let normals = vectors(&|surface| surface.normal.clone());
        let tractions = vectors(&|surface| per_area(surface, &surface.load));
        let reactions = vectors(&|surface| surface.reaction.clone());
        let (areas, pressures) = (scalars(|surface| &surface.area), scalars(|surface| &surface.pressure));
        let numbered = surfaces.iter().enumerate();
        let numbers: Vec<i32> = numbered.flat_map(|(k, of)| vec![k as i32; of.area.len()]).collect();
        let scalar = |name, values| Field {
            name,
            components: 1,
            component_names: &[],
            values: Values::Float64(values),
        };
        let fields = [
            number("surface", &numbers),
            vector("normal", &normals),
            scalar("area", &areas),
            scalar("pressure", &pressures),
            vector("traction", &tractions),
            vector("reaction", &reactions),
        ];
        let n = positions.len();
        let encoded = |field: &Field| Encoded::new(field, "point", n, precision, room).map(Arc::new);
        let fields = fields.iter().map(encoded).collect::<Result<_, String>>()?;
        let positions = Encoded::positions(n, Values::Float64(positions.as_flattened()), precision, room)?;
        let corners: Vec<i64> = (0..n as i64).collect();
        let cells = Cells::new(n, &Kinds::Each(&vec![CellKind::Vertex; n]), &corners, room)?;
        File::new(step.end, step.index as i64, Arc::new(positions), Arc::new(cells), fields, Vec::new())
    }

    fn grid_file<const D: usize>(
        &mut self,
        mesh: GridMesh,
        fields: &[OnNodes<D>],
        step: Step,
    ) -> Result<File, String> {
        let (room, precision) = (&self.room, self.precision);
        let shown = mesh.shown.clone();
        let same = self.grid.take().filter(|last| last.mesh == mesh);
        let grid = match same {
            Some(last) => last,
            None => Active::new(mesh, precision, room)?,
        };
        let encode = |field: &Field, n: usize| Encoded::new(field, "point", n, precision, room).map(Arc::new);
        let encoded = |OnNodes { name, values }: &OnNodes<D>| match *values {
            NodeValues::Vectors(values) => {
                let values: Vec<[f64; 3]> = match &shown {
                    None => values.iter().map(padded).collect(),
                    Some(shown) => shown.iter().map(|node| padded(&values[*node as usize])).collect(),
                };
                encode(&vector(name, &values), values.len())
            }
            NodeValues::Numbers { components, values } => {
                let at_node = |node: usize| &values[node * components..][..components];
                let values: Cow<[f64]> = match &shown {
                    None => values.into(),
                    Some(shown) => shown.iter().flat_map(|node| at_node(*node as usize)).copied().collect(),
                };
                let n = values.len() / components.max(1);
                let values = Values::Float64(&values);
                encode(&Field { name, components, component_names: &[], values }, n)
            }
        };
        let fields = fields.iter().map(encoded).collect::<Result<_, String>>()?;
        let Active { positions, cells, .. } = self.grid.insert(grid);
        let (positions, cells) = (Arc::clone(positions), Arc::clone(cells));
        File::new(step.end, step.index as i64, positions, cells, fields, Vec::new())
    }
}

/// The active part of the grid, which often stays the same for several steps, and its encoded arrays.
struct Active {
    mesh: GridMesh,
    positions: Arc<Encoded>,
    cells: Arc<Cells>,
}

impl Active {
    fn new(mesh: GridMesh, precision: Precision, room: &Room) -> Result<Active, String> {
        let n = mesh.nodes.len();
        let positions = Encoded::positions(n, Values::Float64(mesh.nodes.as_flattened()), precision, room)?;
        let cells = Cells::new(n, &Kinds::Each(&mesh.kinds), &mesh.corners, room)?;
        Ok(Active { mesh, positions: Arc::new(positions), cells: Arc::new(cells) })
    }
}
