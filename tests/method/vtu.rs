//! Files written by the VTU writer, read back with the independent reader `vtkio`.
//!
//! `vtkio` 0.7.0-rc2 cannot read two further forms that VTK itself writes: arrays without a block, and arrays whose
//! last block is full. These are decoded by hand here; `tests/python/test_vtu.py` reads them with VTK and meshio.

#![allow(clippy::unwrap_used)]

use std::io::Read;
use std::path::Path;
use std::{fs, io};

use crate::inline_vtu::{parts, read};
use mpm::output::vtu::{self, CellKind, Field, Kinds, Mesh, Values};
use vtkio::model::{Attribute, CellType, IOBuffer, VertexNumbers};

/// Number of 8-byte values in one compressed block of the writer.
const BLOCK: usize = 65_520 / 8;

/// Uncompressed bytes of every array with a given name, decoded as documented by VTK.
fn decoded(path: &Path, name: &str) -> Vec<Vec<u8>> {
    let (text, data) = parts(path);
    let start = format!("Name=\"{name}\"");
    let element = |part: &&str| part.split('>').next().unwrap().contains(&start);
    let arrays = text.split("<DataArray").skip(1).filter(element);
    let offset = |part: &str| -> usize {
        part.split("offset=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    arrays.map(|part| decode(&data[offset(part)..])).collect()
}

fn decode(data: &[u8]) -> Vec<u8> {
    let word = |index: usize| u64::from_le_bytes(data[8 * index..8 * index + 8].try_into().unwrap()) as usize;
    let (blocks, size, partial) = (word(0), word(1), word(2));
    assert!(partial < size, "a full block is not partial");
    let (mut bytes, mut begin) = (Vec::new(), 8 * (3 + blocks));
    for block in 0..blocks {
        let (before, compressed) = (bytes.len(), word(3 + block));
        flate2::read::ZlibDecoder::new(&data[begin..begin + compressed]).read_to_end(&mut bytes).unwrap();
        let expected = if partial > 0 && block + 1 == blocks { partial } else { size };
        assert_eq!(bytes.len() - before, expected);
        begin += compressed;
    }
    bytes
}

fn bytes_of(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn array<'a>(attributes: &'a [Attribute], name: &str) -> (u32, &'a IOBuffer) {
    let found = attributes.iter().find(|a| a.name() == name).unwrap_or_else(|| panic!("no array {name}"));
    match found {
        Attribute::DataArray(array) => (array.elem.num_comp(), &array.data),
        Attribute::Field { .. } => panic!("{name} is a field"),
    }
}

/// Values without a pattern that could hide misplaced block boundaries.
fn irregular(count: usize) -> Vec<f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    (0..count)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 40) as f64 - 4096.0
        })
        .collect()
}

fn scalar<'a>(name: &'a str, values: Values<'a>) -> Field<'a> {
    Field { name, components: 1, component_names: &[], values }
}

#[test]
fn quads_with_all_kinds_of_fields() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("quads.vtu");
    let points =
        [[0.0, 0.0, 0.0], [1.0 / 3.0, 0.0, 0.0], [1.0, 1e-300, 0.0], [0.0, 1.0, -0.0], [2.0, 0.0, 7.5]];
    let connectivity = [0, 1, 2, 3, 1, 4, 2, 3];
    let mesh = Mesh { points: &points, kinds: Kinds::All(CellKind::Quad), connectivity: &connectivity };
    let tensor = irregular(45);
    let stress = irregular(12);
    let odd = "name with <odd> & \"quoted\" signs";
    let point_data = [
        Field { name: "F", components: 9, component_names: &vtu::TENSOR, values: Values::Float64(&tensor) },
        scalar("id", Values::Int64(&[i64::MIN, -1, 0, 1, i64::MAX])),
        scalar(odd, Values::Int32(&[1, 2, 3, 4, i32::MIN])),
    ];
    let names = &vtu::SYMMETRIC_TENSOR;
    let cell_data =
        [Field { name: "stress", components: 6, component_names: names, values: Values::Float64(&stress) }];
    vtu::write(&path, 1.0 / 3.0, 7, &mesh, &point_data, &cell_data).unwrap();

    let piece = read(&path);
    assert_eq!(piece.points, IOBuffer::F64(points.as_flattened().to_vec()));
    assert_eq!(piece.cells.types, [CellType::Quad; 2]);
    let (connectivity, offsets) = piece.cells.cell_verts.into_xml();
    assert_eq!(connectivity, [0, 1, 2, 3, 1, 4, 2, 3]);
    assert_eq!(offsets, [4, 8]);
    assert_eq!(array(&piece.data.point, "F"), (9, &IOBuffer::F64(tensor)));
    assert_eq!(array(&piece.data.point, "id"), (1, &IOBuffer::I64(vec![i64::MIN, -1, 0, 1, i64::MAX])));
    assert_eq!(array(&piece.data.point, odd), (1, &IOBuffer::I32(vec![1, 2, 3, 4, i32::MIN])));
    assert_eq!(array(&piece.data.cell, "stress"), (6, &IOBuffer::F64(stress)));
    let (text, _) = parts(&path);
    assert!(
        text.contains(r#"ComponentName0="XX" ComponentName1="YY" ComponentName2="ZZ" ComponentName3="XY""#)
    );
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1, "a temporary file is left");
}

/// Writes `count` vertices with three fields, as point and as cell data. The files are kept for the Python tests.
fn write_blocks(count: usize) -> (std::path::PathBuf, Vec<[f64; 3]>, Vec<i64>) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vtu");
    fs::create_dir_all(&directory).unwrap();
    let path = directory.join(format!("blocks_{count}.vtu"));
    let points: Vec<[f64; 3]> = irregular(count).iter().map(|&v| [v, -v, 0.5 * v]).collect();
    let connectivity: Vec<i64> = (0..count as i64).collect();
    let mesh = Mesh { points: &points, kinds: Kinds::All(CellKind::Vertex), connectivity: &connectivity };
    let fields = [
        scalar("id", Values::Int64(&connectivity)),
        Field {
            name: "x",
            components: 3,
            component_names: &vtu::VECTOR,
            values: Values::Float64(points.as_flattened()),
        },
    ];
    vtu::write(&path, count as f64 / 3.0, count as i64, &mesh, &fields, &fields).unwrap();
    (path, points, connectivity)
}

#[test]
fn block_borders_are_exact() {
    for count in [1, BLOCK - 1, BLOCK + 1, 7 * BLOCK / 2] {
        let (path, points, connectivity) = write_blocks(count);
        let piece = read(&path);
        assert_eq!(piece.points, IOBuffer::F64(points.as_flattened().to_vec()), "{count}");
        assert_eq!(piece.cells.types, vec![CellType::Vertex; count]);
        let VertexNumbers::XML { connectivity: read, offsets } = piece.cells.cell_verts else { panic!() };
        assert!(read.iter().enumerate().all(|(i, &c)| i as u64 == c), "{count}");
        assert!(offsets.iter().enumerate().all(|(i, &o)| i as u64 + 1 == o), "{count}");
        for data in [&piece.data.point, &piece.data.cell] {
            assert_eq!(array(data, "id"), (1, &IOBuffer::I64(connectivity.clone())), "{count}");
            assert_eq!(array(data, "x"), (3, &IOBuffer::F64(points.as_flattened().to_vec())), "{count}");
        }
    }
}

#[test]
fn full_last_blocks_are_exact() {
    for count in [BLOCK, 2 * BLOCK] {
        let (path, points, connectivity) = write_blocks(count);
        assert_eq!(decoded(&path, "x"), vec![bytes_of(points.as_flattened()); 2]);
        assert_eq!(decoded(&path, "Points"), [bytes_of(points.as_flattened())]);
        let ids: Vec<u8> = connectivity.iter().flat_map(|id| id.to_le_bytes()).collect();
        assert_eq!(decoded(&path, "id"), vec![ids.clone(); 2]);
        assert_eq!(decoded(&path, "connectivity"), [ids]);
        assert_eq!(decoded(&path, "TimeValue"), [bytes_of(&[count as f64 / 3.0])]);
        assert_eq!(decoded(&path, "Step"), [(count as i64).to_le_bytes()]);
    }
}

#[test]
fn empty_meshes() {
    let (path, ..) = write_blocks(0);
    let (text, _) = parts(&path);
    assert!(text.contains(r#"NumberOfPoints="0" NumberOfCells="0""#));
    for name in ["Points", "connectivity", "offsets", "types", "id", "x"] {
        assert!(decoded(&path, name).iter().all(Vec::is_empty), "{name}");
    }

    let path = path.with_file_name("no_cells.vtu");
    let mesh = Mesh { points: &[[1.0, 2.0, 3.0]], kinds: Kinds::All(CellKind::Quad), connectivity: &[] };
    let cell_data = [scalar("b", Values::Int32(&[]))];
    vtu::write(&path, 0.0, 0, &mesh, &[scalar("a", Values::Float64(&[4.0]))], &cell_data).unwrap();
    assert_eq!(decoded(&path, "Points"), [bytes_of(&[1.0, 2.0, 3.0])]);
    assert_eq!(decoded(&path, "a"), [bytes_of(&[4.0])]);
    assert_eq!(decoded(&path, "b"), [Vec::<u8>::new()]);
}

#[test]
fn every_kind_of_cell() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("cell.vtu");
    let points: Vec<[f64; 3]> =
        (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
    let kinds = [
        (CellKind::Vertex, CellType::Vertex),
        (CellKind::Triangle, CellType::Triangle),
        (CellKind::Quad, CellType::Quad),
        (CellKind::Tetrahedron, CellType::Tetra),
        (CellKind::Hexahedron, CellType::Hexahedron),
    ];
    for (kind, expected) in kinds {
        let connectivity: Vec<i64> = (0..kind.points() as i64).rev().collect();
        vtu::write(
            &path,
            0.0,
            0,
            &Mesh { points: &points, kinds: Kinds::All(kind), connectivity: &connectivity },
            &[],
            &[],
        )
        .unwrap();
        let cells = read(&path).cells;
        assert_eq!(cells.types, [expected]);
        let (read, _) = cells.cell_verts.into_xml();
        assert_eq!(read, (0..kind.points() as u64).rev().collect::<Vec<_>>());
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let directory = tempfile::tempdir().unwrap();
    let values = irregular(5 * BLOCK + 17);
    let points: Vec<[f64; 3]> = values.iter().map(|&v| [v, v, 0.0]).collect();
    let mesh = Mesh { points: &points, kinds: Kinds::All(CellKind::Vertex), connectivity: &[] };
    let files: Vec<Vec<u8>> = [1, 2, 5]
        .into_iter()
        .map(|threads| {
            let path = directory.path().join(format!("{threads}.vtu"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let fields = [scalar("v", Values::Float64(&values))];
            pool.install(|| vtu::write(&path, 0.0, 0, &mesh, &fields, &[])).unwrap();
            fs::read(path).unwrap()
        })
        .collect();
    assert!(files.iter().all(|file| *file == files[0]));
}

#[test]
fn refuses_inconsistent_data() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("refused.vtu");
    let points = [[0.0; 3], [1.0; 3]];
    let good = Mesh { points: &points, kinds: Kinds::All(CellKind::Vertex), connectivity: &[0, 1] };
    let ones = [1.0, 1.0];
    let refused = |time: f64, mesh: Mesh, point: &[Field], cell: &[Field], words: &str| {
        let error = vtu::write(&path, time, 0, &mesh, point, cell).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        assert!(error.to_string().contains(words), "{error}");
    };
    refused(f64::NAN, good, &[], &[], "time NaN");
    refused(0.0, Mesh { points: &[[f64::INFINITY, 0.0, 0.0], [0.0; 3]], ..good }, &[], &[], "point 0");
    refused(0.0, Mesh { connectivity: &[0, 2], ..good }, &[], &[], "refers to point 2 of 2");
    refused(0.0, Mesh { connectivity: &[-1], ..good }, &[], &[], "refers to point -1 of 2");
    refused(0.0, Mesh { kinds: Kinds::All(CellKind::Triangle), ..good }, &[], &[], "2 indices");
    let field = scalar("a", Values::Float64(&ones));
    refused(0.0, good, &[field, field], &[], "two point fields are named `a`");
    refused(0.0, good, &[Field { components: 2, ..field }], &[], "needs 2 for each of 2 points");
    refused(0.0, good, &[Field { components: 0, ..field }], &[], "for each of 2");
    refused(0.0, good, &[Field { component_names: &["X", "Y"], ..field }], &[], "1 component, but 2");
    refused(0.0, good, &[], &[scalar("b", Values::Int64(&[1]))], "cell field `b` has 1 value, but");
    refused(0.0, good, &[scalar("a", Values::Float64(&[0.0, f64::NAN]))], &[], "not finite at point 1");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0, "a refused file leaves nothing");
    vtu::write(&path, 0.0, 0, &good, &[field], &[field]).unwrap();
}
