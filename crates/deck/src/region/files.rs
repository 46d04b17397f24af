//! Regions from files: groups of cells of a mesh, closed surfaces.

use std::path::Path;

use super::Given;
use super::groups::Groups;
use crate::diagnostic::{Diagnostic, Severity};
use crate::placing;
use crate::quoting::quote;
use crate::source::Source;
use mpm_core::grid::gmsh::{self, GmshError};
use mpm_core::grid::{Grid, Mesh};
use mpm_core::region::stl::{self, StlError};
use mpm_core::region::{Group, Meshed, Surface};

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
        Err(GmshError::NotGmsh | GmshError::Version { .. }) => {
            "save the mesh from gmsh as `.msh`, format 4.1 or 2.2".to_owned()
        }
        _ => "repair the mesh in gmsh and save it again".to_owned(),
    };
    let read = read.map_err(|error| format!("the mesh {} cannot be read: {error}", quote(file)));
    let used = read.and_then(|read| {
        Mesh::from_gmsh(&read).map_err(|error| format!("the mesh {} cannot be used: {error}", quote(file)))
    });
    used.map_err(|message| [message, help])
}

/// The warnings about a mesh in a file that the key at `place` names.
pub(crate) fn warnings<const D: usize>(
    mesh: &Mesh<D>,
    file: &str,
    place: &str,
    source: &Source,
) -> Vec<Diagnostic> {
    let warning = |warning| {
        let message = format!("the mesh {}: {warning}", quote(file));
        let found = Diagnostic::at(source, "D032", place, message).severity(Severity::Warning);
        found.help("if this is not intended, repair the mesh in gmsh and save it again")
    };
    mesh.warnings().iter().map(warning).collect()
}

impl<const D: usize> Given<D> for FromFiles<'_, D> {
    fn cells(&mut self, place: &str, group: Option<&str>) -> Option<Group<D>> {
        let known = self.groups.names.iter().position(|name| name.as_deref() == group);
        let key = known.unwrap_or(self.groups.names.len());
        let (bounds, volume, member) = match group {
            None => (self.grid.bounds(), self.grid.total_volume(), Vec::new()),
            Some(name) => {
                let Some(cells) = self.grid.cell_set(name) else {
                    let (message, help) = placing::unknown_group(self.grid, name, true);
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
            self.groups.names.push(group.map(str::to_owned));
            self.groups.members.push(member);
        }
        Some(Group { key, bounds, volume })
    }

    fn mesh(&mut self, place: &str, file: &str, group: Option<&str>) -> Option<Meshed<D>> {
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
            Some(name) => mesh.cell_sets().get(name).cloned(),
        };
        if cells.is_none() {
            let (message, help) = placing::unknown_group(&mesh, group.unwrap_or_default(), true);
            let place = format!("{place}/group");
            self.found.push(Diagnostic::at(self.source, "D031", &place, message).help(help));
        }
        cells.map(|cells| Meshed::new(mesh, cells))
    }

    fn surface(&mut self, place: &str, file: &str) -> Option<Surface> {
        let path = self.directory.join(file);
        let place = format!("{place}/file");
        let fault =
            |message: String, help: String| Diagnostic::at(self.source, "D047", &place, message).help(help);
        let triangles = match stl::read_file(&path) {
            Ok(triangles) => triangles,
            Err(error) => {
                let help = match &error {
                    StlError::File(_) => {
                        format!("the path is relative to the deck; here it means `{}`", path.display())
                    }
                    _ => "save the surface as STL again, text or binary".to_owned(),
                };
                self.found.push(fault(format!("the surface {} cannot be read: {error}", quote(file)), help));
                return None;
            }
        };
        match Surface::new(&triangles) {
            Ok(surface) => {
                if surface.welded() > 0 {
                    let merged = match surface.welded() {
                        1 => "1 corner was merged with another".to_owned(),
                        n => format!("{n} corners were merged with others"),
                    };
                    let message = format!("the surface {} was open until {merged} nearby", quote(file));
                    let note = Diagnostic::at(self.source, "D047", &place, message).severity(Severity::Note);
                    let help = "check that no gap is wider than intended, or close the gaps where the surface \
                        was made";
                    self.found.push(note.help(help));
                }
                Some(surface)
            }
            Err(error) => {
                let help = "repair the surface where it was made, or with a mesh tool, and save it again";
                self.found.push(fault(format!("{}: {error}", quote(file)), help.to_owned()));
                None
            }
        }
    }
}
