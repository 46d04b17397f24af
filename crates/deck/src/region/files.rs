//! Regions from files: groups of cells of a mesh, closed surfaces.

use std::path::Path;

use super::groups::Groups;
use super::{Given, GroupDeck};
use crate::diagnostic::{Diagnostic, Severity};
use crate::placing;
use crate::quoting::quote;
use crate::source::Source;
use mpm_core::grid::gmsh::{self, GmshError};
use mpm_core::grid::mesh::{MeshError, MeshWarning};
use mpm_core::grid::{Grid, Mesh};
use mpm_core::region::stl::{self, StlError};
use mpm_core::region::surface::{MERGED, SurfaceError, Triangle, thickened};
use mpm_core::region::{Group, Meshed, Motion, Surface};

/// Reads the sources that regions name; collects messages about those that cannot be read.
pub(crate) struct FromFiles<'a, const D: usize> {
    pub(crate) grid: &'a dyn Grid<D>,
    pub(crate) directory: &'a Path,
    pub(crate) source: &'a Source,
    pub(crate) groups: Groups,
    pub(crate) found: Vec<Diagnostic>,
}

impl<const D: usize> FromFiles<'_, D> {
    /// Lowest and highest coordinates of these cells, and the sum of their volumes.
    fn extent(&self, cells: &[u32]) -> ([[f64; D]; 2], f64) {
        let mut bounds = [[f64::INFINITY; D], [f64::NEG_INFINITY; D]];
        for &cell in cells {
            for &node in self.grid.corners(cell as usize).nodes() {
                let x = self.grid.node_position(node as usize);
                for d in 0..D {
                    bounds[0][d] = bounds[0][d].min(x[d]);
                    bounds[1][d] = bounds[1][d].max(x[d]);
                }
            }
        }
        (bounds, cells.iter().map(|&cell| self.grid.volume(cell as usize)).sum())
    }
}

/// Message and help for a physical group that has no cells.
fn no_cells<const D: usize>(grid: &dyn Grid<D>, group: &GroupDeck) -> (String, String) {
    match group.dimension() {
        Some(dimension) if usize::from(dimension) != D && grid.cell_set(group.name()).is_some() => (
            format!("the physical group {} of dimension {dimension} has no cells", quote(group.name())),
            format!("give `dimension: {D}`, or the name alone: only groups of dimension {D} have cells"),
        ),
        _ => placing::unknown_group(grid, group.name(), true),
    }
}

/// Reads the mesh in a file of gmsh; its path is relative to `directory`.
///
/// # Errors
/// The message and the remedy.
pub(crate) fn mesh<const D: usize>(directory: &Path, file: &str) -> Result<Mesh<D>, [String; 2]> {
    let path = directory.join(file);
    let read = gmsh::read_file(&path);
    // Faults in the file can only be repaired in gmsh.
    let help = match &read {
        Err(GmshError::File(_)) => {
            format!("the path is relative to the deck; here it means `{}`", path.display())
        }
        Err(GmshError::NotGmsh) => format!(
            "save the mesh from gmsh as `.msh`; a mesh of another program becomes one with Python: \
             `import mpm; mpm.convert({file:?})`"
        ),
        Err(GmshError::Version { .. }) => {
            format!("convert it with gmsh: `gmsh {file} -save -format msh41 -o {}`", converted(file))
        }
        Err(GmshError::Unsupported { .. }) => format!(
            "divide them into tetrahedra with Python, `import mpm; mpm.convert({file:?})`; or leave `Recombine` out of the \
             extrusions, so that gmsh makes tetrahedra: `gmsh GEOMETRY.geo -3 -format msh41 -o {}`",
            converted(file)
        ),
        _ => "repair the mesh in gmsh and save it again".to_owned(),
    };
    let read = read.map_err(|error| format!("the mesh {} cannot be read: {error}", quote(file)));
    let read = read.map_err(|message| [message, help])?;
    Mesh::from_gmsh(&read).map_err(|error| {
        let help = match &error {
            MeshError::NotFlat { constant: Some(axis), .. } => format!(
                "exchange the axes, for example with Python: `import mpm; mpm.convert({file:?}, axes=\"{}\")`",
                if *axis == 0 { "yz" } else { "xz" }
            ),
            MeshError::NotFlat { constant: None, .. } => {
                "mesh one plane of constant z, or state `analysis: {idealisation: solid}` and mesh a volume".to_owned()
            }
            MeshError::Solid { .. } => {
                "state `analysis: {idealisation: solid}`, or save the mesh of a plane".to_owned()
            }
            _ => "repair the mesh in gmsh and save it again".to_owned(),
        };
        [format!("the mesh {} cannot be used: {error}", quote(file)), help]
    })
}

/// A name for the converted form of a mesh file.
fn converted(file: &str) -> String {
    let path = Path::new(file);
    let stem = path.file_stem().map_or_else(|| "mesh".into(), |stem| stem.to_string_lossy());
    path.with_file_name(format!("{stem}_41.msh")).display().to_string()
}

/// The warnings about a mesh in a file that the key at `place` names.
pub(crate) fn warnings<const D: usize>(
    mesh: &Mesh<D>,
    file: &str,
    place: &str,
    source: &Source,
) -> Vec<Diagnostic> {
    let warning = |warning: &MeshWarning| {
        let message = format!("the mesh {}: {warning}", quote(file));
        let severity = if warning.is_note() { Severity::Note } else { Severity::Warning };
        let found = Diagnostic::at(source, "D032", place, message).severity(severity);
        found.help(match warning {
            MeshWarning::Turned { .. } => "nothing needs to be done; in gmsh, reverse the surfaces (volumes) of these cells",
            MeshWarning::Straightened(_) => {
                "nothing needs to be done if the cells are fine enough for straight sides; with `Mesh.ElementOrder = 1` \
                 gmsh writes linear cells"
            }
            MeshWarning::Flattened { .. } => "nothing needs to be done if the mesh is meant to be flat",
            _ => "if this is not intended, repair the mesh in gmsh and save it again",
        })
    };
    mesh.warnings().iter().map(warning).collect()
}

impl<const D: usize> Given<D> for FromFiles<'_, D> {
    fn cells(&mut self, place: &str, group: Option<&GroupDeck>) -> Option<Group<D>> {
        let name = group.map(GroupDeck::name);
        let known = self.groups.names.iter().position(|known| known.as_deref() == name);
        let key = known.unwrap_or(self.groups.names.len());
        let (bounds, volume, member) = match group {
            None => (self.grid.bounds(), self.grid.total_volume(), Vec::new()),
            Some(group) => {
                let of_cells = group.dimension().is_none_or(|dimension| usize::from(dimension) == D);
                let cells = self.grid.cell_set(group.name()).filter(|_| of_cells);
                let Some(cells) = cells else {
                    let (message, help) = no_cells(self.grid, group);
                    let place = format!("{place}/group");
                    self.found.push(Diagnostic::at(self.source, "D031", &place, message).help(help));
                    return None;
                };
                let (bounds, volume) = self.extent(cells);
                let mut member = vec![false; self.grid.n_cells()];
                cells.iter().for_each(|&cell| member[cell as usize] = true);
                (bounds, volume, member)
            }
        };
        if known.is_none() {
            self.groups.names.push(name.map(str::to_owned));
            self.groups.members.push(member);
        }
        Some(Group { key, bounds, volume })
    }

    fn mesh(&mut self, place: &str, file: &str, group: Option<&GroupDeck>) -> Option<Meshed<D>> {
        let at = format!("{place}/file");
        let mesh = match mesh(self.directory, file) {
            Ok(mesh) => mesh,
            Err([message, help]) => {
                self.found.push(Diagnostic::at(self.source, "D032", &at, message).help(help));
                return None;
            }
        };
        self.found.extend(warnings(&mesh, file, &at, self.source));
        let cells = match group {
            None => Some((0..mesh.n_cells() as u32).collect()),
            Some(group) if group.dimension().is_none_or(|dimension| usize::from(dimension) == D) => {
                mesh.cell_sets().get(group.name()).cloned()
            }
            Some(_) => None,
        };
        if let (None, Some(group)) = (&cells, group) {
            let (message, help) = no_cells(&mesh, group);
            let place = format!("{place}/group");
            self.found.push(Diagnostic::at(self.source, "D031", &place, message).help(help));
        }
        cells.map(|cells| Meshed::new(mesh, cells))
    }

    fn surface(&mut self, place: &str, file: &str, placed: &Motion<3>) -> Option<Surface> {
        let triangles: Vec<Triangle> =
            self.triangles(place, file)?.iter().map(|t| t.map(|x| placed.apply(&x))).collect();
        match Surface::new(&triangles) {
            Ok(surface) => {
                self.note_repairs(place, file, &surface);
                Some(surface)
            }
            Err(error) => {
                let help = match &error {
                    SurfaceError::Open { .. } => {
                        "close the surface where it was made, or with a mesh tool, and save it again; an open surface \
                         can be a tool"
                    }
                    _ => "repair the surface where it was made, or with a mesh tool, and save it again",
                };
                self.fault_of_surface(place, format!("{}: {error}", quote(file)), help);
                None
            }
        }
    }
}

impl<const D: usize> FromFiles<'_, D> {
    /// The facets of a tool in a file: those of a closed surface, or of the layer behind an open one, `thickness` in
    /// units of the file.
    pub(crate) fn sides(&mut self, place: &str, file: &str, thickness: Option<f64>) -> Option<Vec<Triangle>> {
        let triangles = self.triangles(place, file)?;
        let mut refuse = |message: String, help: &str| {
            self.fault_of_surface(place, format!("{}: {message}", quote(file)), help);
            None
        };
        match Surface::new(&triangles) {
            Ok(surface) => {
                self.note_repairs(place, file, &surface);
                if thickness.is_some() {
                    let message = format!("the surface {} is closed: `thickness` has no effect", quote(file));
                    self.note_of_surface(
                        place,
                        message,
                        "remove `thickness`, which is meant for open surfaces",
                    );
                }
                Some(surface.triangles().to_vec())
            }
            Err(SurfaceError::Open { .. } | SurfaceError::TooFewFacets { .. }) => {
                let (layer, thickness) = match thickened(&triangles, thickness) {
                    Ok(layer) => layer,
                    Err(error) => {
                        return refuse(
                            error.to_string(),
                            "an open surface must look to one side, that of the bodies; close it, or turn the facets \
                             that look to the other side",
                        );
                    }
                };
                if let Err(error) = Surface::new(&layer) {
                    return refuse(
                        format!("the layer behind the open surface is invalid: {error}"),
                        "repair the surface where it was made, or with a mesh tool, and save it again",
                    );
                }
                let message = format!(
                    "the surface {} is open: it acts on the side to which its facets look, and the tool behind it is \
                     {thickness:.4} thick (units of the file)",
                    quote(file)
                );
                self.note_of_surface(
                    place,
                    message,
                    "state `thickness` for another one, or close the surface",
                );
                Some(layer)
            }
            Err(error) => refuse(
                error.to_string(),
                "repair the surface where it was made, or with a mesh tool, and save it again",
            ),
        }
    }

    /// The facets in an STL file.
    fn triangles(&mut self, place: &str, file: &str) -> Option<Vec<Triangle>> {
        let path = self.directory.join(file);
        match stl::read_file(&path) {
            Ok(read) => {
                for note in read.notes {
                    let message = format!("the surface {}: {note}", quote(file));
                    self.note_of_surface(place, message, "nothing needs to be done if the file is complete");
                }
                Some(read.triangles)
            }
            Err(error) => {
                let help = match &error {
                    StlError::File(_) => {
                        format!("the path is relative to the deck; here it means `{}`", path.display())
                    }
                    _ => "save the surface as STL again, text or binary".to_owned(),
                };
                let message = format!("the surface {} cannot be read: {error}", quote(file));
                self.fault_of_surface(place, message, &help);
                None
            }
        }
    }

    /// Notes what was repaired to close a surface.
    fn note_repairs(&mut self, place: &str, file: &str, surface: &Surface) {
        let name = quote(file);
        if surface.welded() > 0 {
            let merged = match surface.welded() {
                1 => "1 corner was merged with another".to_owned(),
                n => format!("{n} corners were merged with others"),
            };
            let message =
                format!("the surface {name} was open until {merged} nearby, within {MERGED:e} of its size");
            let help =
                "check that no gap is wider than intended, or close the gaps where the surface was made";
            self.note_of_surface(place, message, help);
        }
        if surface.dropped() > 0 {
            let message = match surface.dropped() {
                1 => format!("the surface {name}: 1 facet has no area and was removed"),
                n => format!("the surface {name}: {n} facets have no area and were removed"),
            };
            self.note_of_surface(place, message, "nothing needs to be done: the shape is the same");
        }
    }

    fn note_of_surface(&mut self, place: &str, message: String, help: &str) {
        let found = Diagnostic::at(self.source, "D047", &format!("{place}/file"), message);
        self.found.push(found.severity(Severity::Note).help(help));
    }

    fn fault_of_surface(&mut self, place: &str, message: String, help: &str) {
        self.found.push(Diagnostic::at(self.source, "D047", &format!("{place}/file"), message).help(help));
    }
}
