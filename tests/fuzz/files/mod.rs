//! Damaged mesh files of gmsh, STL surfaces in text and binary form, and checkpoints. None may cause a panic, take more
//! than ten seconds of processor time or more memory than is reasonable for a file of its size; accepted files must be
//! usable.
//!
//! The usual tests run some thousand cases.
//! `FUZZ_SECONDS=1800 cargo test --release --test fuzz gmsh -- --ignored --nocapture`
//! runs cases of mesh files for that much processor time; `stl` or `checkpoint` in place of `gmsh` selects the other
//! files. `FUZZ_SEED` sets the first case.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

mod checkpoints;
mod damage;
mod strangers;

use std::path::Path;
use std::time::Duration;

use mpm::grid::gmsh;
use mpm::grid::mesh::Mesh;
use mpm::region::Region;
use mpm::region::stl;
use mpm::region::surface::Surface;

use crate::harness::{Bench, fuzz, fuzz_for_long};
use crate::long::share;
use crate::random::Random;
use checkpoints::Checkpoints;
use damage::damage;

/// The files with this extension in a folder of the test data.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == ending));
    paths.sort();
    let files: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
    assert!(files.len() > 2);
    files
}

/// A file of the list, damaged in one place or more.
fn damaged(files: &[Vec<u8>], seed: u64) -> Vec<u8> {
    let mut random = Random::new(seed);
    let mut content = random.pick(files).clone();
    damage(&mut content, &mut random);
    while random.chance(0.5) {
        damage(&mut content, &mut random);
    }
    content
}

struct Meshes(Vec<Vec<u8>>);

impl Meshes {
    fn new() -> Meshes {
        Meshes(files("mesh", "msh"))
    }
}

/// Locates positions in a mesh, inside and around it.
fn use_mesh<const D: usize>(mesh: &Mesh<D>) {
    assert!(mesh.n_cells() > 0);
    for number in 0..20u32 {
        let place: [f64; D] = std::array::from_fn(|d| f64::from(number * (d as u32 + 3) % 17) - 4.0);
        let cell = mesh.nearest_cell(&place);
        let basis = mesh.shape(cell, &place);
        let sum: f64 = basis.value().iter().sum();
        assert!(
            (sum - 1.0).abs() < 1e-6 * basis.value().iter().map(|v| v.abs()).fold(1.0, f64::max),
            "{sum}"
        );
    }
}

impl Bench for Meshes {
    const ENDING: &'static str = "msh";

    fn case(&self, seed: u64) -> Vec<u8> {
        damaged(&self.0, seed)
    }

    fn run(&self, content: &[u8]) -> String {
        let file = match gmsh::read(content) {
            Ok(file) => file,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                return "1 refused by the reader".into();
            }
        };
        let plane = Mesh::<2>::from_gmsh(&file).map(|mesh| use_mesh(&mesh));
        let solid = Mesh::<3>::from_gmsh(&file).map(|mesh| use_mesh(&mesh));
        match (plane, solid) {
            (Ok(()), _) => "3 a mesh in the plane".into(),
            (_, Ok(())) => "4 a mesh in space".into(),
            (Err(a), Err(b)) => {
                assert!(!a.to_string().is_empty() && !b.to_string().is_empty());
                "2 refused as a mesh".into()
            }
        }
    }
}

struct Surfaces(Vec<Vec<u8>>);

impl Surfaces {
    /// Surfaces in text form, and the same surfaces in binary form.
    fn new() -> Surfaces {
        let mut all = files("", "stl");
        for text in all.clone() {
            let Ok(stl::StlFile { triangles, .. }) = stl::read(&text) else { continue };
            let mut binary = vec![0u8; 80];
            binary.extend((triangles.len() as u32).to_le_bytes());
            for corners in &triangles {
                binary.extend([0; 12]);
                binary.extend(corners.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()));
                binary.extend([0; 2]);
            }
            all.push(binary);
        }
        Surfaces(all)
    }
}

impl Bench for Surfaces {
    const ENDING: &'static str = "stl";

    fn case(&self, seed: u64) -> Vec<u8> {
        damaged(&self.0, seed)
    }

    fn run(&self, content: &[u8]) -> String {
        let triangles = match stl::read(content) {
            Ok(file) => file.triangles,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                return "1 refused by the reader".into();
            }
        };
        match Surface::new(&triangles) {
            Err(error) => {
                assert!(!error.to_string().is_empty());
                "2 refused as a surface".into()
            }
            Ok(surface) => {
                let region = Region::<3>::new(surface);
                let bounds = region.bounds();
                assert!(bounds.iter().flatten().all(|x| x.is_finite()));
                for number in 0..20u32 {
                    let share = |d: usize| f64::from(number * (d as u32 + 3) % 17) / 16.0;
                    let place =
                        std::array::from_fn(|d| bounds[0][d] + share(d) * (bounds[1][d] - bounds[0][d]));
                    let _ = region.contains(&place);
                }
                "3 a surface".into()
            }
        }
    }
}

#[test]
fn damaged_gmsh_files_are_survived() {
    fuzz(Meshes::new, 1, share(2000), Duration::from_secs(60));
}

#[test]
fn damaged_stl_files_are_survived() {
    fuzz(Surfaces::new, 1, share(3000), Duration::from_secs(60));
}

#[test]
fn damaged_checkpoints_are_survived() {
    fuzz(Checkpoints::new, 1, share(1500), Duration::from_secs(60));
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn checkpoints_for_long() {
    fuzz_for_long(Checkpoints::new);
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn gmsh_files_for_long() {
    fuzz_for_long(Meshes::new);
}

#[test]
#[ignore = "as long as FUZZ_SECONDS says"]
fn stl_files_for_long() {
    fuzz_for_long(Surfaces::new);
}
