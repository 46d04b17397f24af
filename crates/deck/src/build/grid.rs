//! The grid of a deck, and the mesh of a gmsh file.

use super::Builder;
use crate::GridDeck;
use crate::per_axis::array;
use crate::region::{DeckRegion, files};
use mpm_core::grid::{Axis, CoincidentLines, Grid, Mesh, Structured};
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    pub(super) fn grid(&mut self) -> Option<Box<dyn Grid<D>>> {
        match &self.deck.grid {
            GridDeck::Structured { origin, size, spacing, .. } => {
                let (origin, size): ([f64; D], [f64; D]) = (array(origin), array(size));
                let axes: Result<Vec<Axis>, CoincidentLines> =
                    (spacing.entries(D).iter().enumerate().take(D))
                        .map(|(d, entry)| entry.axis(origin[d], size[d]))
                        .collect();
                match axes.map(<[Axis; D]>::try_from) {
                    Ok(Ok(axes)) => Some(Region::boxed_lines(Structured::with_axes(axes))),
                    Ok(Err(axes)) => {
                        let message = format!("the spacing has {} entries for {D} axes", axes.len());
                        self.error("D015", "/grid/spacing", message, "give one entry per axis".to_owned());
                        None
                    }
                    Err(error) => {
                        let help = "use fewer cells, or a ratio closer to 1".to_owned();
                        self.error("D027", "/grid/spacing", error.to_string(), help);
                        None
                    }
                }
            }
            GridDeck::Gmsh { file } => {
                let averages = |body: &crate::BodyDeck| body.strain().is_mean();
                let needs_patches = self.deck.bodies.iter().any(averages);
                let mesh = self.mesh(file)?;
                Some(Region::boxed_mesh(if needs_patches { mesh.with_patches() } else { mesh }))
            }
        }
    }

    /// The mesh of a gmsh file; reports an error if it cannot be used.
    fn mesh(&mut self, file: &str) -> Option<Mesh<D>> {
        match files::mesh(&self.loaded.directory, file) {
            Ok(mesh) => {
                self.found.extend(files::warnings(&mesh, file, "/grid/file", &self.loaded.source));
                Some(mesh)
            }
            Err([message, help]) => {
                self.error("D032", "/grid/file", message, help);
                None
            }
        }
    }
}
