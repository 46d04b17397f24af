//! Result files of analyses in space. Cell types are checked here, contents in `tests/python/test_solid.py` with VTK.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use mpm::basis::Method;
use mpm::deck::advice::Means;
use mpm::domain::DomainUpdate;
use mpm::grid::{Grid, Structured};
use mpm::material::VonMises;
use mpm::model::NodeSet;
use mpm::output::results::{Request, Results};
use mpm::output::summary::{Account, Start};
use mpm::points::Points;
use mpm::solver;
use mpm::tensor::Mat3;
use mpm::timing::Timings;
use vtkio::model::CellType;

use super::bodies::{Filling, cells_in, fill, homogeneous, mesh, model};
use crate::inline_vtu::read;

/// Stretches and rotates a block in two steps and writes all files, which are kept for the Python tests.
fn results(
    name: &str,
    grid: impl Grid<3> + 'static,
    cells: &[u32],
    method: Method,
    n: [usize; 3],
) -> PathBuf {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vtu").join(format!("solid_{name}"));
    let law = VonMises::new(1e6, 0.3, 1e5);
    let seeds = fill(&grid, cells, Filling { method, n, density: 1.0 }, &law);
    let mut points = Points::new(&seeds);
    let mut model = model(grid, law, method, DomainUpdate::Corners, 2);
    let increment = Mat3::new(1.05, -0.2, 0.02, 0.2, 0.95, 0.0, 0.0, 0.05, 1.1);
    model.boundary_conditions = vec![homogeneous(NodeSet::OuterLayer(0), &increment, [4.0; 3], 2)];
    let account = Account {
        deck: None,
        files_hash: String::new(),
        law_libraries: Vec::new(),
        start: Start::now(),
        deck_hash: String::new(),
        deck_file: String::new(),
        deck_text: String::new(),
        parameters: BTreeMap::new(),
        units: None,
        messages: Vec::new(),
        set_up: Timings::default(),
        threads: 1,
        wording: std::sync::Arc::new(Means::default()),
    };
    let mut files = Results::create(&directory, &Request::default(), &model, account).unwrap();
    solver::run(&model, &mut points, &mut files).unwrap_or_else(|error| panic!("{error}"));
    directory
}

fn types(directory: &Path, series: &str, step: usize) -> Vec<CellType> {
    read(&directory.join(format!("{series}_{step:04}.vtu"))).cells.types
}

fn check(directory: &Path, domain: Option<CellType>, cell: CellType, n_points: usize) {
    for step in 0..=2 {
        assert_eq!(types(directory, "points", step), vec![CellType::Vertex; n_points]);
        if let Some(domain) = domain {
            assert_eq!(types(directory, "domains", step), vec![domain; n_points]);
        }
        let cells = types(directory, "grid", step);
        assert!(cells.len() > 8 && cells.iter().all(|c| *c == cell));
    }
    let history = fs::read_to_string(directory.join("history.csv")).unwrap();
    assert!(history.lines().next().unwrap().contains("moved_rz"));
    assert_eq!(history.lines().count(), 3);
}

#[test]
fn domains_and_cells_are_hexahedra_or_tetrahedra() {
    let grid = || Structured::<3>::new([0.0; 3], [1.0; 3], [8; 3]);
    let block = cells_in(&grid(), [2.0; 3], [6.0; 3]);
    for (name, method) in [("mpm", Method::Mpm), ("gimp", Method::Gimp), ("cpdi2", Method::Cpdi2)] {
        let domain = (method != Method::Mpm).then_some(CellType::Hexahedron);
        check(&results(name, grid(), &block, method, [2, 1, 1]), domain, CellType::Hexahedron, 128);
    }
    for (name, n, domain) in
        [("hexahedra", [1; 3], CellType::Hexahedron), ("tetrahedra", [1; 3], CellType::Tetra)]
    {
        let grid = mesh(&format!("block_{name}"));
        let block = grid.cell_set("block").unwrap().to_vec();
        check(&results(name, grid, &block, Method::Cpdi2, n), Some(domain), domain, block.len());
    }
}
