//! Files of other people: what becomes of every mesh and surface in a folder, and of damaged copies of them.
//!
//! `STRANGERS=FOLDER cargo test --release --test fuzz strangers -- --ignored --nocapture` prints, for each file, the
//! outcome and the total area or volume; with `DAMAGED=N`, also for N damaged copies, and those that are accepted are
//! written to `FOLDER/damaged` for a comparison with an independent reader (`tests/python/strangers.py`).

use std::path::{Path, PathBuf};

use mpm::grid::gmsh;
use mpm::grid::mesh::Mesh;
use mpm::region::surface::Surface;
use mpm::region::{Primitive, stl};

use super::damaged;

/// What a file is: its total area or volume if it is accepted, or why it is refused; and the notes about it.
fn outcome(content: &[u8], is_mesh: bool) -> Result<(String, f64, Vec<String>), String> {
    if !is_mesh {
        let file = stl::read(content).map_err(|error| error.to_string())?;
        let surface = Surface::new(&file.triangles).map_err(|error| error.to_string())?;
        let mut notes: Vec<String> = file.notes.iter().map(ToString::to_string).collect();
        if surface.welded() + surface.dropped() > 0 {
            notes.push(format!("{} merged, {} dropped", surface.welded(), surface.dropped()));
        }
        return Ok(("surface".to_owned(), surface.volume(), notes));
    }
    let file = gmsh::read(content).map_err(|error| error.to_string())?;
    let has_volume = file.elements.iter().any(|element| element.kind.dimension() == 3);
    let words = |mesh: &[mpm::grid::mesh::MeshWarning]| mesh.iter().map(ToString::to_string).collect();
    if has_volume {
        let mesh = Mesh::<3>::from_gmsh(&file).map_err(|error| error.to_string())?;
        let volume = (0..mesh.n_cells() as u32).map(|cell| mesh.volume(cell)).sum();
        return Ok(("solid".to_owned(), volume, words(mesh.warnings())));
    }
    let mesh = Mesh::<2>::from_gmsh(&file).map_err(|error| error.to_string())?;
    let area = (0..mesh.n_cells() as u32).map(|cell| mesh.volume(cell)).sum();
    Ok(("plane".to_owned(), area, words(mesh.warnings())))
}

fn is_mesh(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending != "stl" && ending != "STL")
}

#[test]
#[ignore = "needs the folder STRANGERS"]
fn strangers() {
    let folder = PathBuf::from(std::env::var_os("STRANGERS").unwrap());
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.is_file());
    paths.sort();
    for path in &paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        match outcome(&std::fs::read(path).unwrap(), is_mesh(path)) {
            Ok((kind, size, notes)) => println!("{name}\taccepted\t{kind}\t{size:e}\t{}", notes.join(" | ")),
            Err(why) => println!("{name}\trefused\t{why}"),
        }
    }
    let Some(n) = std::env::var("DAMAGED").ok().and_then(|n| n.parse::<u64>().ok()) else { return };
    let target = folder.join("damaged");
    std::fs::create_dir_all(&target).unwrap();
    // Large files would only make the damage rarer.
    let small = |path: &&PathBuf| path.metadata().is_ok_and(|about| about.len() < 300_000);
    for meshes in [true, false] {
        let chosen: Vec<&PathBuf> =
            paths.iter().filter(small).filter(|path| is_mesh(path) == meshes).collect();
        let contents: Vec<Vec<u8>> = chosen.iter().map(|path| std::fs::read(path).unwrap()).collect();
        let mut accepted = 0;
        for seed in 0..n {
            let content = damaged(&contents, seed);
            if let Ok((kind, size, notes)) = outcome(&content, meshes) {
                accepted += 1;
                let name = format!("{seed:05}_{kind}.{}", if meshes { "msh" } else { "stl" });
                std::fs::write(target.join(&name), &content).unwrap();
                println!("damaged/{name}\taccepted\t{kind}\t{size:e}\t{}", notes.join(" | "));
            }
        }
        println!("damaged copies: {n}, accepted: {accepted}");
    }
}
