//! Regions from files: groups of cells of a mesh, closed surfaces.

use std::path::Path;

use super::Given;
use super::groups::Groups;
use crate::diagnostic::{Diagnostic, Severity};
use crate::placing;
use crate::quoting::quote;
use crate::source::Source;
use mpm_core::grid::Grid;
use mpm_core::region::stl::{self, StlError};
use mpm_core::region::{Group, Surface};

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

    fn surface(&mut self, place: &str, file: &str) -> Option<Surface> {
        let path = self.directory.join(file);
        let place = format!("{place}/file");
        let fault =
            |message: String, help: String| Diagnostic::at(self.source, "D047", &place, message).help(help);
        let triangles = match stl::read_file(&path) {
            Ok(triangles) => triangles,
            Err(error) => {
                let help = match &error {
                    StlError::Io(_) | StlError::NotAFile | StlError::TooLarge { .. } => {
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
