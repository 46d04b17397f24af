//! Mesh files written by gmsh, and damaged versions of them.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use mpm::grid::gmsh::{FileLocation, GmshError, GmshFile, PhysicalGroup, read, read_file};
use mpm::grid::mesh::{Mesh, MeshError, MeshWarning};
use mpm::input_file::InputFileError;
use proptest::prelude::*;

const FORMATS: [&str; 5] = ["2.2_text", "2.2_binary", "4.0_text", "4.1_text", "4.1_binary"];

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mesh").join(format!("{name}.msh"))
}

fn file(name: &str) -> GmshFile {
    read_file(&path(name)).unwrap()
}

fn mesh<const D: usize>(name: &str) -> Mesh<D> {
    Mesh::from_gmsh(&file(name)).unwrap()
}

fn all_files() -> Vec<Vec<u8>> {
    let mut names: Vec<String> =
        ["mixed", "disk", "solid"].iter().flat_map(|n| FORMATS.map(|f| format!("{n}_{f}"))).collect();
    names.extend(["clockwise", "second_order", "partitioned", "solid_partitioned_4.0"].map(String::from));
    names.iter().map(|name| std::fs::read(path(name)).unwrap()).collect()
}

/// Equal up to the last digit of the coordinates: gmsh writes one digit too few in text files.
fn assert_same<const D: usize>(a: &Mesh<D>, b: &Mesh<D>) {
    assert_eq!((a.n_nodes(), a.n_cells()), (b.n_nodes(), b.n_cells()));
    for node in 0..a.n_nodes() {
        let (x, y) = (a.node_position(node), b.node_position(node));
        assert!((0..D).all(|d| (x[d] - y[d]).abs() < 1e-15), "{x:?} {y:?}");
    }
    assert!((0..a.n_cells() as u32).all(|cell| a.cell_nodes(cell) == b.cell_nodes(cell)));
    assert_eq!(a.node_sets(), b.node_sets());
    assert_eq!(a.side_sets(), b.side_sets());
    assert_eq!(a.cell_sets(), b.cell_sets());
    assert_eq!(a.boundary(), b.boundary());
}

#[test]
fn all_formats_give_the_same_mesh() {
    for name in ["mixed", "disk"] {
        let meshes = FORMATS.map(|format| mesh::<2>(&format!("{name}_{format}")));
        for other in &meshes[1..] {
            assert_same(&meshes[0], other);
        }
    }
    let meshes = FORMATS.map(|format| mesh::<3>(&format!("solid_{format}")));
    for other in &meshes[1..] {
        assert_same(&meshes[0], other);
    }
}

#[test]
fn groups_have_names_with_spaces_or_their_tags() {
    for format in FORMATS {
        let groups = file(&format!("mixed_{format}")).groups;
        let group = |dimension, tag, name: &str| PhysicalGroup { dimension, tag, name: name.into() };
        let expected = [
            group(0, 1, "origin"),
            group(1, 7, "left edge"),
            group(1, 8, "8"),
            group(2, 1, "soil body"),
            group(2, 2, "rock"),
            group(2, 3, "all of it"),
        ];
        let sorted = |mut groups: Vec<PhysicalGroup>| {
            groups.sort_by(|a, b| (a.dimension, &a.name).cmp(&(b.dimension, &b.name)));
            groups.into_iter().map(|g| (g.dimension, g.name)).collect::<Vec<_>>()
        };
        assert_eq!(sorted(groups), sorted(expected.to_vec()), "{format}");
    }
}

#[test]
fn groups_become_sets() {
    let mesh = mesh::<2>("mixed_4.1_binary");
    let names = |n: &[&str]| n.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(
        mesh.cell_sets().keys().cloned().collect::<Vec<_>>(),
        names(&["all of it", "rock", "soil body"])
    );
    assert_eq!(mesh.side_sets().keys().cloned().collect::<Vec<_>>(), names(&["8", "left edge"]));
    assert_eq!(mesh.node_sets().len(), 6);
    let area = |set: &str| mesh.cell_sets()[set].iter().map(|c| mesh.volume(*c)).sum::<f64>();
    assert!((area("soil body") - 1.0).abs() < 1e-14 && (area("rock") - 1.0).abs() < 1e-14);
    assert_eq!(mesh.cell_sets()["all of it"].len(), mesh.n_cells());
    let left = &mesh.node_sets()["left edge"];
    assert!(left.len() == 3 && left.iter().all(|n| mesh.node_position(*n as usize)[0] == 0.0));
    assert_eq!(mesh.side_sets()["left edge"].len(), 2);
    assert_eq!(mesh.side_sets()["8"].len(), 4);
    let origin = &mesh.node_sets()["origin"];
    assert!(origin.len() == 1 && mesh.node_position(origin[0] as usize) == [0.0, 0.0]);
    // Triangles first, then the quadrilaterals of the soil.
    assert!(mesh.cell_sets()["soil body"].iter().all(|c| mesh.cell_nodes(*c).len() == 4));
    assert!(mesh.cell_sets()["rock"].iter().all(|c| mesh.cell_nodes(*c).len() == 3));
    assert!(mesh.warnings().is_empty());
}

#[test]
fn groups_of_solids_become_sets() {
    let mesh = mesh::<3>("solid_2.2_binary");
    let names: Vec<&str> = mesh.node_sets().keys().map(String::as_str).collect();
    assert_eq!(names, ["all of it", "floor", "long edge", "origin", "rock", "soil body"]);
    assert_eq!(
        mesh.cell_sets().keys().map(String::as_str).collect::<Vec<_>>(),
        ["all of it", "rock", "soil body"]
    );
    assert_eq!(mesh.side_sets().keys().collect::<Vec<_>>(), ["floor"]);
    let volume = |set: &str| mesh.cell_sets()[set].iter().map(|c| mesh.volume(*c)).sum::<f64>();
    assert!((volume("soil body") - 2.0).abs() < 1e-14);
    assert!((volume("rock") - 0.7).abs() < 1e-9, "{}", volume("rock"));
    assert_eq!(mesh.cell_sets()["all of it"].len(), mesh.n_cells());
    // Tetrahedra first, then the two hexahedra of the soil.
    assert_eq!(mesh.cell_sets()["soil body"], [mesh.n_cells() as u32 - 2, mesh.n_cells() as u32 - 1]);
    assert!(mesh.cell_sets()["rock"].iter().all(|c| mesh.cell_nodes(*c).len() == 4));
    let origin = &mesh.node_sets()["origin"];
    assert!(origin.len() == 1 && mesh.node_position(origin[0] as usize) == [0.0; 3]);
    let edge = mesh.node_sets()["long edge"].iter().map(|n| mesh.node_position(*n as usize));
    assert_eq!(edge.clone().count(), 3);
    assert!(edge.into_iter().all(|x| x[1] == 0.0 && x[2] == 0.0));
    let floor = &mesh.node_sets()["floor"];
    assert!(floor.iter().all(|n| mesh.node_position(*n as usize)[2] == 0.0));
    let quadrilaterals = mesh.side_sets()["floor"].iter().filter(|side| side.nodes().len() == 4).count();
    assert!(quadrilaterals == 2 && mesh.side_sets()["floor"].len() > 4);
    assert!(mesh.warnings().is_empty());
    // Every face of a group is a boundary face.
    let sorted = |nodes: &[u32]| {
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes
    };
    let boundary: Vec<Vec<u32>> = mesh.boundary().iter().map(|b| sorted(b.side.nodes())).collect();
    assert!(mesh.side_sets()["floor"].iter().all(|side| boundary.contains(&sorted(side.nodes()))));
}

#[test]
fn the_blocks_of_the_patch_tests_are_complete() {
    for name in ["block_hexahedra", "block_tetrahedra"] {
        let mesh = mesh::<3>(name);
        let volume = |cells: &[u32]| cells.iter().map(|c| mesh.volume(*c)).sum::<f64>();
        let sets = mesh.cell_sets();
        assert!((volume(&sets["block"]) + volume(&sets["around"]) - 512.0).abs() < 1e-9);
        assert!((volume(&sets["block"]) - 64.0).abs() < if name == "block_hexahedra" { 1.0 } else { 1e-9 });
        assert_eq!(mesh.bounds(), [[0.0; 3], [8.0; 3]]);
        assert!(mesh.node_sets()["bottom"].iter().all(|n| mesh.node_position(*n as usize)[2] == 0.0));
        assert!(mesh.warnings().is_empty());
    }
}

#[test]
fn the_grid_of_the_beam_is_complete() {
    let mesh = mesh::<2>("rectangle_quad_h0.5");
    assert_eq!((mesh.n_cells(), mesh.n_nodes()), (440, 483));
    assert_eq!(mesh.bounds(), [[0.0, 0.0], [11.0, 10.0]]);
    assert_eq!(mesh.node_sets()["left"].len(), 21);
    assert_eq!(mesh.node_sets()["grid"].len(), 483);
    assert_eq!(mesh.boundary().len(), 84);
    assert!((0..440).all(|cell| mesh.volume(cell) == 0.25));
}

#[test]
fn the_annulus_meshes_are_good() {
    for segments in [18, 36, 72, 144, 288] {
        let path = format!("{}/inputs/annulus/annulus_{segments}.msh", env!("CARGO_MANIFEST_DIR"));
        let mesh = Mesh::<2>::from_gmsh(&read_file(Path::new(&path)).unwrap()).unwrap();
        assert_eq!(mesh.side_sets()["outer"].len(), segments);
        for (set, radius) in [("outer", 1.25), ("inner", 0.75)] {
            let x = mesh.node_sets()[set].iter().map(|n| mesh.node_position(*n as usize));
            assert!(
                x.clone().count() >= 9 && x.into_iter().all(|x| (x[0].hypot(x[1]) - radius).abs() < 1e-9)
            );
        }
        let boundary = mesh.side_sets()["outer"].len() + mesh.side_sets()["inner"].len();
        assert_eq!(mesh.boundary().len(), boundary);
        assert!(mesh.warnings().is_empty());
    }
}

#[test]
fn second_order_elements_are_read_by_their_corners() {
    let file = file("second_order");
    let lost = file.straightened.clone().unwrap();
    assert_eq!(lost.kinds.iter().map(|k| k.0).collect::<Vec<_>>(), ["Line 3", "Triangle 6"]);
    assert!(!lost.unknown && lost.farthest > 0.0 && lost.relative < 0.2, "{lost:?}");
    let mesh = Mesh::<2>::from_gmsh(&file).unwrap();
    assert_eq!(mesh.n_cells(), lost.kinds[1].1);
    assert!(mesh.warnings().iter().all(MeshWarning::is_note));
    let note = mesh.warnings()[0].to_string();
    assert!(note.contains("only the corners of") && note.contains("% of the length"), "{note}");
    let solid = mesh_of_solid("solid_second_order");
    let note = solid.warnings()[0].to_string();
    assert!(note.contains("2 × `Hexahedron 27`") && note.contains("nothing is lost"), "{note}");
}

fn mesh_of_solid(name: &str) -> Mesh<3> {
    mesh::<3>(name)
}

/// A node of the second order that is off its edge by a quarter of it.
#[test]
fn what_straight_sides_lose_is_measured() {
    let nodes = "1 0 0 0\n2 2 0 0\n3 0 2 0\n4 1 -.5 0\n5 1 1 0\n6 0 1 0\n";
    let lost = text(nodes, "1 9 2 1 1 1 2 3 4 5 6\n").unwrap().straightened.unwrap();
    assert_eq!((lost.farthest, lost.relative, lost.unknown), (0.5, 0.25, false));
}

#[test]
fn prisms_and_pyramids_are_refused() {
    let nodes = "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 0 1\n6 0 1 1\n";
    let error = text(nodes, "1 6 2 1 1 1 2 3 4 5 6\n2 7 2 1 1 1 2 3 4 5\n").unwrap_err().to_string();
    assert_eq!(
        error,
        "prisms and pyramids are not supported, but the file has 1 × `Prism 6`, 1 × `Pyramid 5`"
    );
}

#[test]
fn clockwise_cells_are_turned() {
    let mesh = mesh::<2>("clockwise");
    assert!((0..mesh.n_cells() as u32).all(|cell| mesh.volume(cell) > 0.0));
    let [MeshWarning::Turned { dimension: 2, n, all, .. }] = mesh.warnings() else {
        panic!("{:?}", mesh.warnings())
    };
    assert_eq!((*n, *all), (mesh.n_cells(), mesh.n_cells()));
    let file = file("clockwise");
    let shoelace = |nodes: &[u32]| {
        let x = |k: usize| file.nodes[nodes[k % nodes.len()] as usize];
        0.5 * (0..nodes.len()).map(|k| x(k)[0] * x(k + 1)[1] - x(k + 1)[0] * x(k)[1]).sum::<f64>()
    };
    let cells = file.elements.iter().filter(|element| element.kind.dimension() == 2);
    let signed: f64 = cells.map(|element| shoelace(element.nodes())).sum();
    let area: f64 = (0..mesh.n_cells() as u32).map(|cell| mesh.volume(cell)).sum();
    assert!(signed < 0.0 && (area + signed).abs() < 1e-12, "{area} {signed}");
}

/// The same geometry in all formats that gmsh writes has the same mesh and groups, whether or not it is partitioned.
#[test]
fn partitions_are_joined() {
    let mesh = mesh::<2>("partitioned");
    let whole = self::mesh::<2>("mixed_4.1_text");
    assert!(mesh.warnings().is_empty());
    let area = |mesh: &Mesh<2>, set: &str| mesh.cell_sets()[set].iter().map(|c| mesh.volume(*c)).sum::<f64>();
    for set in ["soil body", "rock", "all of it"] {
        assert!((area(&mesh, set) - area(&whole, set)).abs() < 1e-12, "{set}");
    }
    assert_eq!(mesh.side_sets()["left edge"].len(), whole.side_sets()["left edge"].len());
    assert_eq!(mesh.node_sets()["origin"].len(), 1);
    let whole = mesh_of_solid("solid_4.1_text");
    for name in ["solid_partitioned_2.2", "solid_partitioned_4.0"] {
        let joined = mesh_of_solid(name);
        assert_eq!((joined.n_nodes(), joined.n_cells()), (whole.n_nodes(), whole.n_cells()), "{name}");
        let volume = |mesh: &Mesh<3>| (0..mesh.n_cells() as u32).map(|c| mesh.volume(c)).sum::<f64>();
        assert!((volume(&joined) - volume(&whole)).abs() < 1e-12);
        let cells = |mesh: &Mesh<3>| mesh.cell_sets().values().map(Vec::len).collect::<Vec<_>>();
        assert_eq!(cells(&joined), cells(&whole), "{name}");
    }
}

/// Binary format 4.0, which gmsh no longer writes: two triangles, a curve and a group of each.
#[test]
fn binary_files_of_format_4_0_are_read() {
    let mut bytes = b"\xef\xbb\xbf$MeshFormat\n4 1 8\n".to_vec();
    let int = |bytes: &mut Vec<u8>, values: &[i32]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    let size =
        |bytes: &mut Vec<u8>, values: &[u64]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    let real =
        |bytes: &mut Vec<u8>, values: &[f64]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    int(&mut bytes, &[1]);
    bytes.extend(b"\n$EndMeshFormat\n$Entities\n");
    size(&mut bytes, &[0, 1, 1, 0]);
    int(&mut bytes, &[5]);
    real(&mut bytes, &[0.0; 6]);
    size(&mut bytes, &[1]);
    int(&mut bytes, &[7]);
    size(&mut bytes, &[0]);
    int(&mut bytes, &[6]);
    real(&mut bytes, &[0.0; 6]);
    size(&mut bytes, &[1]);
    int(&mut bytes, &[8]);
    size(&mut bytes, &[1]);
    int(&mut bytes, &[5]);
    bytes.extend(b"\n$EndEntities\n$Nodes\n");
    size(&mut bytes, &[1, 4]);
    int(&mut bytes, &[6, 2, 0]);
    size(&mut bytes, &[4]);
    for (tag, x) in [(1, [0.0, 0.0, 3.0]), (2, [2.0, 0.0, 3.0]), (3, [2.0, 1.0, 3.0]), (9, [0.0, 1.0, 3.0])] {
        int(&mut bytes, &[tag]);
        real(&mut bytes, &x);
    }
    bytes.extend(b"\n$EndNodes\n$Elements\n");
    size(&mut bytes, &[2, 3]);
    int(&mut bytes, &[5, 1, 1]);
    size(&mut bytes, &[1]);
    int(&mut bytes, &[1, 1, 2]);
    int(&mut bytes, &[6, 2, 2]);
    size(&mut bytes, &[2]);
    int(&mut bytes, &[2, 1, 2, 3, 3, 1, 3, 9]);
    bytes.extend(b"\n$EndElements\n");
    let mesh = Mesh::<2>::from_gmsh(&read(&bytes).unwrap()).unwrap();
    assert_eq!((mesh.n_cells(), mesh.volume(0), mesh.volume(1)), (2, 1.0, 1.0));
    assert_eq!(
        (mesh.node_sets()["7"].as_slice(), mesh.cell_sets()["8"].as_slice()),
        (&[0, 1][..], &[0, 1][..])
    );
}

/// Format 2.0 names groups by their number alone.
#[test]
fn names_without_a_dimension_hold_for_all() {
    let names = "$PhysicalNames\n2\n5 \"soil\"\n6 \"wall\"\n$EndPhysicalNames\n";
    let nodes = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n";
    let elements = "$Elements\n2\n1 2 3 5 1 0 1 2 3\n2 1 3 6 2 0 1 2\n$EndElements\n";
    let file = read(format!("{}{names}{nodes}{elements}", HEAD.replace("2.2", "2.0")).as_bytes()).unwrap();
    let groups: Vec<(u8, &str)> = file.groups.iter().map(|g| (g.dimension, g.name.as_str())).collect();
    assert_eq!(groups, [(1, "wall"), (2, "soil")]);
}

#[test]
fn other_files_are_refused() {
    let error = |bytes: &[u8]| read(bytes).unwrap_err();
    for bytes in [
        &b""[..],
        b"   ",
        b"solid cube",
        b"$",
        b"\x7fELF",
        b"$MeshFormat",
        b"$MeshFormat\nfoo 0 8\n",
        b"$A\n",
    ] {
        assert!(matches!(error(bytes), GmshError::NotGmsh), "{bytes:?}");
    }
    assert!(matches!(error(b"$MeshFormat\n3 0 8\n"), GmshError::Version { version } if version == "3"));
    assert!(matches!(error(b"$NOD\n1\n"), GmshError::Version { version } if version == "1"));
    assert!(matches!(error(b"$MeshFormat\n4.1 0 4\n"), GmshError::Version { .. }));
    assert!(matches!(read_file(Path::new("/nowhere.msh")), Err(GmshError::File(InputFileError::Io(_)))));
}

const HEAD: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";

fn text(nodes: &str, elements: &str) -> Result<GmshFile, GmshError> {
    let section = |name: &str, body: &str| format!("${name}\n{}\n{body}$End{name}\n", body.lines().count());
    // Neither the name of another section nor a longer word ends the comment.
    let comment = "$Comments\nwhatever $Nodes $EndComments2\n$EndComments\n";
    read(format!("{HEAD}{comment}{}{}", section("Nodes", nodes), section("Elements", elements)).as_bytes())
}

const SQUARE: &str = "1 0 0 0\n2 1 0 0\n3 1 1 0\n40000000 0 1 0\n";

fn square(elements: &str) -> Result<Mesh<2>, MeshError> {
    Mesh::<2>::from_gmsh(&text(&format!("{SQUARE}5 0 1e-12 0\n6 .4 .4 0\n"), elements).unwrap())
}

#[test]
fn contradictions_are_found_where_they_are() {
    let triangle = "1 2 2 0 1 1 2 3\n";
    assert!(matches!(
        text(SQUARE, "7 2 2 0 1 1 2 4\n"),
        Err(GmshError::UnknownNode { element: 7, node: 4, location: FileLocation::Line(16) })
    ));
    assert!(matches!(text("1 0 0 0\n1 1 0 0\n", triangle), Err(GmshError::DuplicateNode { node: 1 })));
    let error = text("1 0 nan 0\n", triangle);
    assert!(
        matches!(error, Err(GmshError::NonFinite { node: 1, location: FileLocation::Line(9) })),
        "{error:?}"
    );
    assert!(matches!(text(SQUARE, "1 99999 0\n"), Err(GmshError::UnknownType { code: 99999, .. })));
    let error = text("1 0 x 0\n", triangle).unwrap_err();
    assert_eq!(error.to_string(), "line 9: expected a coordinate, found `x`");
    let many = format!("{HEAD}$Nodes\n4000000000\n1 0 0 0\n");
    assert!(matches!(read(many.as_bytes()), Err(GmshError::Count { count: 4_000_000_000, .. })));
    let error = read(format!("{HEAD}$Nodes\n1\n1 0 0 0\n$EndNodes\n$Other\n").as_bytes());
    assert!(matches!(error, Err(GmshError::Unclosed { .. })));
    let early = read(format!("{HEAD}$Elements\n0\n$EndElements\n").as_bytes()).unwrap_err();
    assert_eq!(early.to_string(), "line 5: expected the nodes before the elements, found the elements first");
    let nodes = "$Nodes\n1\n1 0 0 0\n$EndNodes\n";
    let twice = read(format!("{HEAD}{nodes}{nodes}").as_bytes()).unwrap_err();
    assert_eq!(twice.to_string(), "line 9: expected only one section of nodes, found a second one");
    let names = format!("{HEAD}$PhysicalNames\n1\n4 1 \"soil\"\n$EndPhysicalNames\n");
    let error = read(names.as_bytes()).unwrap_err();
    assert_eq!(error.to_string(), "line 6: expected a dimension from 0 to 3, found `4`");
}

#[test]
fn unusable_cells_are_found() {
    let quad = |a: u32, b: u32, c: u32, d: u32| format!("1 3 2 1 1 {a} {b} {c} {d}\n");
    let top = 40_000_000;
    let good = square(&quad(1, 2, 3, top)).unwrap();
    assert_eq!((good.n_nodes(), good.n_cells()), (4, 1));
    assert_eq!(square("1 1 2 0 1 1 2\n").unwrap_err(), MeshError::NoCells { dimension: 2, n_surface: 0 });
    let turned = square(&quad(1, top, 3, 2)).unwrap();
    assert_eq!((turned.volume(0), turned.cell_nodes(0)), (1.0, good.cell_nodes(0)));
    let two = square("1 2 0 1 2 3\n2 2 0 1 40000000 3\n").unwrap();
    match two.warnings() {
        [MeshWarning::Turned { n: 1, all: 2, first, .. }] => assert_eq!(first[0].element, 2),
        other => panic!("{other:?}"),
    }
    assert_eq!(two.volume(0) + two.volume(1), 1.0);
    assert!(matches!(square(&quad(1, 2, 6, top)), Err(MeshError::Folded { n: 1, .. })));
    assert!(matches!(square("1 2 0 1 2 2\n"), Err(MeshError::NoVolume { n: 1, .. })));
    assert!(matches!(square("1 2 0 1 5 2\n"), Err(MeshError::NoVolume { n: 1, .. })));
    let overlap = square("1 2 0 1 2 3\n2 2 0 1 2 40000000\n").unwrap_err();
    assert!(matches!(overlap, MeshError::Overlap { n: 1, .. }), "{overlap}");
    let tilted = Mesh::<2>::from_gmsh(&text("1 0 0 0\n2 1 0 1\n3 0 1 0\n", "1 2 0 1 2 3\n").unwrap());
    assert_eq!(tilted.unwrap_err(), MeshError::NotFlat { low: 0.0, high: 1.0, constant: None });
    let nearly = Mesh::<2>::from_gmsh(&text("1 0 0 5\n2 1 0 5.0000002\n3 0 1 5\n", "1 2 0 1 2 3\n").unwrap());
    assert!(matches!(nearly.unwrap().warnings(), [MeshWarning::Flattened { low: 5.0, .. }]));
    let upright = Mesh::<2>::from_gmsh(&text("1 0 7 0\n2 1 7 0\n3 0 7 1\n", "1 2 0 1 2 3\n").unwrap());
    assert_eq!(upright.unwrap_err(), MeshError::NotFlat { low: 0.0, high: 1.0, constant: Some(1) });
    let solid = Mesh::<2>::from_gmsh(&text(SQUARE, "1 4 0 1 2 3 40000000\n").unwrap());
    assert_eq!(solid.unwrap_err(), MeshError::Solid { n: 1 });
    // A name that two dimensions share denotes nodes only together with a dimension.
    let shared = square("1 1 1 5 1 2\n2 2 1 5 1 2 3\n").unwrap();
    assert!(shared.node_sets().is_empty() && shared.cell_sets()["5"] == [0]);
    let nodes = mpm::grid::Grid::node_sets_named(&shared, "5");
    assert_eq!(nodes, [(1, &[0, 1][..]), (2, &[0, 1, 2])]);
}

/// Corners of two cubes, one on top of the other, and a node inside the lower one.
const CUBES: &str = "1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n\
                     9 0 0 2\n10 1 0 2\n11 1 1 2\n12 0 1 2\n13 .1 .1 .1\n";

fn cubes(elements: &str) -> Result<Mesh<3>, MeshError> {
    Mesh::from_gmsh(&text(CUBES, elements).unwrap())
}

#[test]
fn unusable_solids_are_found() {
    let low = "1 5 0 1 2 3 4 5 6 7 8\n";
    let high = "2 5 0 5 6 7 8 9 10 11 12\n";
    let both = cubes(&format!("{low}{high}")).unwrap();
    assert_eq!((both.n_nodes(), both.n_cells(), both.boundary().len()), (12, 2, 10));
    let message = |elements: &str| cubes(elements).unwrap_err().to_string();

    // A surface mesh for an analysis in space, and a volume mesh for an analysis in the plane.
    assert_eq!(cubes("1 1 0 1 2\n").unwrap_err(), MeshError::NoCells { dimension: 3, n_surface: 0 });
    let surface = message("1 2 0 1 2 3\n2 3 0 1 2 3 4\n");
    assert!(
        surface.contains("only 2 surface elements; a three-dimensional analysis needs a mesh of the volume"),
        "{surface}"
    );
    let solid = Mesh::<2>::from_gmsh(&text(CUBES, &format!("{low}7 3 0 1 2 3 4\n")).unwrap()).unwrap_err();
    assert_eq!(solid, MeshError::Solid { n: 1 });

    // Invalid volumes.
    assert!(matches!(cubes("1 4 0 1 2 3 4\n"), Err(MeshError::NoVolume { dimension: 3, n: 1, .. })));
    assert_eq!(message("1 4 0 1 2 3 4\n"), "1 cell has no volume: element 1 at (0.5, 0.5, 0)");
    assert!(matches!(cubes("1 5 0 1 2 3 4 1 2 3 4\n"), Err(MeshError::NoVolume { n: 1, .. })));
    let turned = cubes("1 4 0 1 3 2 5\n").unwrap();
    assert!((turned.volume(0) - 1.0 / 6.0).abs() < 1e-15);
    assert_eq!(
        turned.warnings()[0].to_string(),
        "all cells were inside out and have been turned (1): element 1 at (0.5, 0.25, 0.25)"
    );
    let turned = cubes(&format!("{low}2 4 0 5 7 6 10\n")).unwrap_err();
    assert!(matches!(turned, MeshError::Nonconforming { n: 1, .. }), "{turned}");
    let reversed = cubes("1 5 0 5 6 7 8 1 2 3 4\n2 5 0 5 6 7 8 9 10 11 12\n").unwrap();
    assert!([0, 1].iter().all(|cell| (reversed.volume(*cell) - 1.0).abs() < 1e-14));
    match reversed.warnings() {
        [MeshWarning::Turned { dimension: 3, n: 1, all: 2, first }] => assert_eq!(first[0].element, 1),
        other => panic!("{other:?}"),
    }
    // A corner pushed through the cube; with the top rotated by 180° the cube folds only at half height.
    assert!(matches!(cubes("1 5 0 1 2 3 4 5 6 13 8\n"), Err(MeshError::Folded { dimension: 3, n: 1, .. })));
    assert!(matches!(cubes("1 5 0 1 2 3 4 7 8 5 6\n"), Err(MeshError::Folded { n: 1, .. })));
    assert!(
        message("1 5 0 1 2 3 4 5 6 13 8\n").contains("1 hexahedron is so distorted that it turns inside out")
    );

    // Overlapping cells, and cells that do not fit together.
    let twice = cubes(&format!("{low}3 5 0 5 6 7 8 9 10 11 12\n4 4 0 5 6 7 10\n")).unwrap_err();
    assert!(matches!(twice, MeshError::Nonconforming { n: 2, .. }), "{twice}");
    let overlap = cubes("1 4 0 1 2 4 5\n2 4 0 1 2 4 9\n").unwrap_err();
    assert!(matches!(overlap, MeshError::Overlap { n: 1, .. }), "{overlap}");
    match cubes(&format!("{low}2 4 0 5 6 7 9\n3 4 0 5 7 8 9\n")).unwrap_err() {
        MeshError::Nonconforming { n: 2, first } => assert_eq!(first.map(|c| c.element), [2, 1]),
        other => panic!("{other:?}"),
    }
    let shared = cubes(&format!("9 3 1 5 1 2 3 4\n{}", low.replace("5 0", "5 1 5"))).unwrap();
    let dimensions: Vec<u8> =
        mpm::grid::Grid::node_sets_named(&shared, "5").iter().map(|(dimension, _)| *dimension).collect();
    assert_eq!(dimensions, [2, 3]);
}

#[test]
fn coincident_nodes_of_solids_are_reported() {
    let nodes = format!("{CUBES}14 0 0 1\n15 1 0 1.0000000000001\n");
    let elements = "1 5 0 1 2 3 4 5 6 7 8\n2 5 0 14 15 7 8 9 10 11 12\n";
    let mesh = Mesh::<3>::from_gmsh(&text(&nodes, elements).unwrap()).unwrap();
    let [MeshWarning::Unmerged { n: 2, first }] = mesh.warnings() else { panic!("{:?}", mesh.warnings()) };
    assert_eq!(first, &[vec![0.0, 0.0, 1.0], vec![1.0, 0.0, 1.0]]);
    assert!(mesh.warnings()[0].to_string().ends_with("the first at (0, 0, 1)"));
}

#[test]
fn coincident_nodes_are_reported() {
    let nodes = format!("{SQUARE}5 0 0 0\n6 1 1 1e-13\n");
    let mesh = Mesh::<2>::from_gmsh(&text(&nodes, "1 2 0 1 2 3\n2 2 0 5 6 40000000\n").unwrap()).unwrap();
    let [MeshWarning::Unmerged { n: 2, first }] = mesh.warnings() else { panic!("{:?}", mesh.warnings()) };
    assert_eq!(first, &[vec![0.0, 0.0], vec![1.0, 1.0]]);
}

/// Error message of an invalid mesh.
fn refusal<const D: usize>(nodes: &str, elements: &str) -> String {
    Mesh::<D>::from_gmsh(&text(nodes, elements).unwrap()).unwrap_err().to_string()
}

/// A square of side 2, and two squares of side 1 beside it; node 8 is in the middle of its right side.
const STEP: &str = "1 0 0 0\n2 2 0 0\n3 2 2 0\n4 0 2 0\n5 3 0 0\n6 3 1 0\n7 3 2 0\n8 2 1 0\n";

#[test]
fn nodes_on_sides_of_connected_cells_are_refused_with_their_position() {
    let hanging = "2 3 0 2 5 6 8\n3 3 0 8 6 7 3\n";
    assert_eq!(
        refusal::<2>(STEP, &format!("1 3 0 1 2 3 4\n{hanging}")),
        "1 node lies on a side of a cell without being one of its corners: node 8 at (2, 1) on the side \
         between the nodes 2 and 3 of element 1 at (1, 1); the basis functions are discontinuous there: cut that cell at \
         the node, or give the cells on both sides the same nodes"
    );
    let triangles = refusal::<2>(STEP, &format!("1 2 0 1 2 3\n4 2 0 1 3 4\n{hanging}"));
    assert!(
        triangles.contains("node 8 at (2, 1) on the side between the nodes 2 and 3 of element 1"),
        "{triangles}"
    );
    // Valid once the large cell is divided at the node.
    let cut = format!("1 2 0 1 2 8\n4 2 0 1 8 4\n5 2 0 8 3 4\n{hanging}");
    let mesh = Mesh::<2>::from_gmsh(&text(STEP, &cut).unwrap()).unwrap();
    assert!(mesh.warnings().is_empty());
    // Within round-off of the side, and clearly off the side, which leaves a gap.
    let moved =
        |x: &str| text(&STEP.replace("8 2 1 0", &format!("8 {x} 1 0")), &format!("1 3 0 1 2 3 4\n{hanging}"));
    assert!(matches!(
        Mesh::<2>::from_gmsh(&moved("2.0000001").unwrap()),
        Err(MeshError::Hanging { n: 1, .. })
    ));
    assert!(Mesh::<2>::from_gmsh(&moved("2.001").unwrap()).is_ok());
    assert!(matches!(Mesh::<2>::from_gmsh(&moved("1.999").unwrap()), Err(MeshError::Overlap { n: 2, .. })));
}

#[test]
fn nodes_on_faces_and_edges_of_connected_solids_are_refused() {
    // A cube of side 2 and, in a corner of its face x = 2, a cube of side 1 with three hanging nodes.
    let nodes = "1 0 0 0\n2 2 0 0\n3 2 2 0\n4 0 2 0\n5 0 0 2\n6 2 0 2\n7 2 2 2\n8 0 2 2\n\
                 9 3 0 0\n10 3 1 0\n11 2 1 0\n12 2 0 1\n13 3 0 1\n14 3 1 1\n15 2 1 1\n";
    let (large, small) = ("1 5 0 1 2 3 4 5 6 7 8\n", "2 5 0 2 9 10 11 12 13 14 15\n");
    let hexahedra = refusal::<3>(nodes, &format!("{large}{small}"));
    assert!(hexahedra.starts_with("3 nodes lie on a side"), "{hexahedra}");
    assert!(hexahedra.contains("node 11 at (2, 1, 0) on the side between the nodes "), "{hexahedra}");
    // A tetrahedron on a part of a face of another tetrahedron, with which it shares a node.
    let nodes = "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 .25 .25 0\n6 .25 0 0\n7 0 0 -1\n";
    let tetrahedra = refusal::<3>(nodes, "1 4 0 1 2 3 4\n2 4 0 1 5 6 7\n");
    assert!(tetrahedra.starts_with("2 nodes lie on a side"), "{tetrahedra}");
    assert!(
        tetrahedra.contains("node 5 at (0.25, 0.25, 0)") && tetrahedra.contains("of element 1 at"),
        "{tetrahedra}"
    );
    // On a curved face, outside the plane of three of its corners and of the centre.
    let curved = "1 0 0 0\n2 3 0 0\n3 3 3 0\n4 0 3 0\n5 0 0 3\n6 3 0 3\n7 3 3 4\n8 0 3 3\n\
                  9 1 1 3.111111111111111\n10 0 0 5\n11 1 0 4\n";
    let message = refusal::<3>(curved, "1 5 0 1 2 3 4 5 6 7 8\n2 4 0 5 11 9 10\n");
    assert!(message.contains("node 9 at (1, 1, 3.111111111111111)"), "{message}");
}

#[test]
fn parts_that_only_touch_are_allowed_and_reported() {
    // Squares with separate nodes on the common side, some at different positions.
    let nodes = STEP.to_owned() + "9 2 0 0\n10 2 2 0\n";
    let elements = "1 3 0 1 2 3 4\n2 3 0 9 5 6 8\n3 3 0 8 6 7 10\n";
    let mesh = Mesh::<2>::from_gmsh(&text(&nodes, elements).unwrap()).unwrap();
    let [MeshWarning::Unmerged { n: 2, .. }, MeshWarning::Apart { n: 1, first }] = mesh.warnings() else {
        panic!("{:?}", mesh.warnings())
    };
    assert_eq!(first, &[vec![2.0, 1.0]]);
    // A distant part of any size has no effect.
    for (x, side) in [(-1e4, 1e-3), (-1e7, 1e6)] {
        let y = side;
        let far = format!("{nodes}21 {x} 0 0\n22 {} 0 0\n23 {x} {y} 0\n", x + side);
        let mesh =
            Mesh::<2>::from_gmsh(&text(&far, &format!("9 2 0 21 22 23\n{elements}")).unwrap()).unwrap();
        assert_eq!(mesh.warnings().len(), 2);
    }
}

/// A lattice of two cells along each axis over the unit cube (square), its nodes counted from `first`, shifted.
fn block(first: usize, dimension: usize, shift: [f64; 3]) -> (String, String) {
    let n = if dimension == 3 { 27 } else { 9 };
    let place = |k: usize| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0);
    let node = |k: usize| {
        let x: [f64; 3] = std::array::from_fn(|d| place(k)[d] + shift[d]);
        format!("{} {} {} {}\n", first + k, x[0], x[1], x[2])
    };
    let cells = if dimension == 3 { 8 } else { 4 };
    let cell = |c: usize| {
        let low = c % 2 + 3 * (c / 2 % 2) + 9 * (c / 4);
        let corners = [0, 1, 4, 3, 9, 10, 13, 12].map(|k| (first + low + k).to_string());
        let (kind, n) = if dimension == 3 { (5, 8) } else { (3, 4) };
        format!("{} {kind} 0 {}\n", first + c, corners[..n].join(" "))
    };
    ((0..n).map(node).collect(), (0..cells).map(cell).collect())
}

fn two_blocks<const D: usize>(shift: [f64; 3]) -> Result<Mesh<D>, MeshError> {
    let ((a, first), (b, second)) = (block(1, D, [0.0; 3]), block(101, D, shift));
    Mesh::from_gmsh(&text(&(a + &b), &(first + &second)).unwrap())
}

#[test]
fn overlapping_cells_are_refused_even_if_no_node_is_inside_another() {
    let nodes = "1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 .5 0 0\n6 1.5 0 0\n7 1.5 1 0\n8 .5 1 0\n";
    assert_eq!(
        refusal::<2>(nodes, "1 3 0 1 2 3 4\n2 3 0 5 6 7 8\n"),
        "1 pair of cells overlaps: element 1 at (0.5, 0.5) and element 2 at (1, 0.5); remove one of the two, \
         or mesh both bodies as one part"
    );
    // Crossing triangles and tetrahedra, each with all its nodes outside the other.
    let cross = refusal::<2>(
        "1 -2 0 0\n2 2 -1 0\n3 2 1 0\n4 0 -2 0\n5 1 2 0\n6 -1 2 0\n",
        "1 2 0 1 2 3\n2 2 0 4 5 6\n",
    );
    assert!(cross.starts_with("1 pair of cells overlaps"), "{cross}");
    let spikes = "1 -2 0 0\n2 2 -1 -1\n3 2 1 -1\n4 2 0 1\n5 0 -2 0\n6 1 2 -1\n7 -1 2 -1\n8 0 2 1\n";
    let cross = refusal::<3>(spikes, "1 4 0 1 2 3 4\n2 4 0 5 6 7 8\n");
    assert!(cross.starts_with("1 pair of cells overlaps"), "{cross}");
    // The same cells twice, with separate nodes.
    assert!(matches!(two_blocks::<2>([0.0; 3]), Err(MeshError::Overlap { n: 4, .. })));
    assert!(matches!(two_blocks::<3>([0.0; 3]), Err(MeshError::Overlap { n: 8, .. })));
    // A small part in the middle of a large one, where the cells of the large one have no boundary sides.
    let small = "31 .7 .7 0\n32 .8 .7 0\n33 .7 .8 0\n";
    let (nodes, cells) = block(1, 2, [0.0; 3]);
    let inside = refusal::<2>(&(nodes + small), &(cells + "31 2 0 31 32 33\n"));
    assert!(inside.contains("element 4 at (0.75, 0.75)") || inside.contains("element 31"), "{inside}");
}

/// One triangle in binary format, in either byte order.
fn binary(version: &str, reverse: bool) -> Vec<u8> {
    let number = |mut bytes: Vec<u8>| {
        if reverse {
            bytes.reverse();
        }
        bytes
    };
    let ints = |v: &[i32]| v.iter().flat_map(|i| number(i.to_le_bytes().into())).collect::<Vec<_>>();
    let sizes = |v: &[u64]| v.iter().flat_map(|i| number(i.to_le_bytes().into())).collect::<Vec<_>>();
    let reals = |v: &[f64]| v.iter().flat_map(|i| number(i.to_le_bytes().into())).collect::<Vec<_>>();
    let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let head = format!("$MeshFormat\n{version} 1 8\n").into_bytes();
    let mut parts = vec![head, ints(&[1]), b"\n$EndMeshFormat\n$Nodes\n".into()];
    if version == "4.1" {
        parts.extend([sizes(&[1, 3, 1, 3]), ints(&[2, 1, 0]), sizes(&[3, 1, 2, 3]), reals(&x.concat())]);
        parts.push(b"\n$EndNodes\n$Elements\n".into());
        parts.extend([sizes(&[1, 1, 1, 1]), ints(&[2, 1, 2]), sizes(&[1, 1, 1, 2, 3])]);
    } else {
        parts.push(b"3\n".into());
        parts.extend((1..4).flat_map(|k| [ints(&[k]), reals(&x[k as usize - 1])]));
        parts.push(b"\n$EndNodes\n$Elements\n1\n".into());
        parts.push(ints(&[2, 1, 2, 1, 0, 1, 1, 2, 3]));
    }
    parts.push(b"\n$EndElements\n".into());
    parts.concat()
}

#[test]
fn both_byte_orders_are_read() {
    for version in ["2.2", "4.1"] {
        let little = read(&binary(version, false)).unwrap();
        assert_eq!(little, read(&binary(version, true)).unwrap());
        assert_eq!(Mesh::<2>::from_gmsh(&little).unwrap().volume(0), 0.5);
    }
}

#[test]
fn no_part_of_a_file_is_a_file() {
    for bytes in all_files() {
        let whole = bytes.trim_ascii_end().len();
        for n in 0..whole {
            assert!(read(&bytes[..n]).is_err(), "{n} of {whole} bytes");
        }
    }
}

/// Reads a file and builds the mesh; only the absence of panics matters.
fn survive(bytes: &[u8]) {
    if let Ok(file) = read(bytes) {
        use_mesh(Mesh::<2>::from_gmsh(&file));
        use_mesh(Mesh::<3>::from_gmsh(&file));
    }
}

fn use_mesh<const D: usize>(mesh: Result<Mesh<D>, MeshError>) {
    let Ok(mesh) = mesh else { return };
    let x = mesh.node_position(0);
    let mut places = [x, [f64::INFINITY; D], [1e300; D], mesh.centroid(0)];
    places[1][0] = f64::NAN;
    for x in places {
        mesh.locate(&x, None);
        mesh.shape(mesh.nearest_cell(&x), &x);
        mesh.shape(0, &x);
    }
}

proptest! {
    /// Two blocks of side 1 overlap if and only if all coordinates of the shift are below 1 in magnitude.
    #[test]
    fn overlaps_are_those_of_the_geometry(x in prop::collection::vec(prop_oneof![-1.5..1.5f64, Just(1.0), Just(0.5), Just(0.0)], 3)) {
        let shift = [x[0], x[1], x[2]];
        let overlaps = |n: usize| shift[..n].iter().all(|x| x.abs() < 1.0 - 1e-5);
        let plane = two_blocks::<2>([x[0], x[1], 0.0]);
        prop_assert_eq!(matches!(plane, Err(MeshError::Overlap { .. })), overlaps(2));
        prop_assert_eq!(plane.is_ok(), !overlaps(2));
        let solid = two_blocks::<3>(shift);
        prop_assert_eq!(matches!(solid, Err(MeshError::Overlap { .. })), overlaps(3));
        prop_assert_eq!(solid.is_ok(), !overlaps(3));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn damaged_files_cause_no_panic(which in 0..15usize, damage in prop::collection::vec((any::<usize>(), any::<u8>()), 1..6)) {
        let mut bytes = all_files().swap_remove(which);
        let n = bytes.len();
        for (at, value) in damage {
            bytes[at % n] = value;
        }
        survive(&bytes);
    }

    #[test]
    fn odd_coordinates_cause_no_panic(x in prop::collection::vec(prop_oneof![any::<f64>(), -1e3..1e3f64, Just(0.0)], 10)) {
        let x: Vec<f64> = x.into_iter().map(|x| if x.is_finite() { x } else { 0.0 }).collect();
        let nodes: String = (0..5).map(|k| format!("{k} {:e} {:e} 0\n", x[2 * k], x[2 * k + 1])).collect();
        for elements in ["1 2 0 0 1 2\n2 2 0 0 2 3\n", "1 3 0 0 1 2 3\n", "1 2 0 2 1 0\n", "1 3 0 3 2 1 0\n2 2 0 0 1 4\n"] {
            use_mesh(Mesh::<2>::from_gmsh(&text(&nodes, elements).unwrap()));
        }
    }

    #[test]
    fn odd_coordinates_of_solids_cause_no_panic(x in prop::collection::vec(prop_oneof![any::<f64>(), -1e3..1e3f64, Just(0.0)], 27)) {
        let x: Vec<f64> = x.into_iter().map(|x| if x.is_finite() { x } else { 0.0 }).collect();
        let node = |k: usize| format!("{k} {:e} {:e} {:e}\n", x[3 * k], x[3 * k + 1], x[3 * k + 2]);
        let nodes: String = (0..9).map(node).collect();
        for elements in ["1 4 0 0 1 2 3\n2 4 0 1 2 3 4\n", "1 5 0 0 1 2 3 4 5 6 7\n", "1 4 0 0 2 1 3\n"] {
            use_mesh(Mesh::<3>::from_gmsh(&text(&nodes, elements).unwrap()));
        }
    }
}
