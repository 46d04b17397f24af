"""`output: {fields, precision}`: what the files of a run hold, against those of the same run with everything."""

import meshio
import numpy as np
import pytest
import pyvista

from results import Results

IDENTITY = {"body_id", "material_id", "point_id"}
ALL = [
    "displacement",
    "deformation_gradient",
    "J",
    "cauchy_stress",
    "elastic_strain",
    "plastic_strain",
    "von_mises_stress",
    "pressure",
    "volume",
    "equivalent_plastic_strain",
]
DECK = """
version: 1
grid: {type: structured, origin: [0, 0], size: [6, 4], spacing: 0.5}
materials:
  soft: {model: von-mises, young: 1000, poisson: 0.3, deviatoric_yield_stress: 4, hardening_modulus: 100, density: 1}
bodies:
  - {name: a, material: soft, shape: {type: box, min: [0, 0], max: [4, 1]}, method: gimp, points_per_cell: 2}
  - {name: b, material: soft, shape: {type: box, min: [1, 2], max: [2, 3]}, method: METHOD, points_per_cell: 3}
boundary_conditions:
  - {name: wall, nodes: {x: 0}, fix: [x, y]}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: plate, nodes: {y: 3}, fix: [x, y]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
steps: {count: 4}
output: OUTPUT
"""


@pytest.fixture(scope="module")
def run(mpm, tmp_path_factory):
    def run(output, method="cpdi2", threads=1):
        directory = tmp_path_factory.mktemp("fields")
        deck = directory / "deck.yaml"
        deck.write_text(DECK.replace("METHOD", method).replace("OUTPUT", output))
        process = mpm("run", deck, "--out", directory / "out", threads=threads)
        assert process.returncode == 0, process.stderr
        return Results(directory / "out")

    return run


@pytest.fixture(scope="module")
def whole(run):
    return run("{every: 2}")


def data_of(series, mesh):
    return mesh.cell_data if series == "domains" else mesh.point_data


def test_every_field_is_there_where_nothing_is_said(whole):
    for series in ("points", "domains"):
        for _, path in whole.series(series):
            assert set(data_of(series, pyvista.read(path)).keys()) == set(ALL) | IDENTITY


@pytest.mark.parametrize("method", ["cpdi2", "mpm"])
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("fields", [["cauchy_stress", "displacement"], ["J"], [], ALL])
def test_fields_that_are_asked_for_have_the_same_numbers(run, fields, threads, method):
    everything = run("{every: 2}", method)
    some = run(f"{{every: 2, fields: [{', '.join(fields)}]}}", method, threads)
    for series in ("points", "domains"):
        pairs = list(zip(everything.series(series), some.series(series), strict=True))
        assert len(pairs) == 3
        for (_, first), (_, second) in pairs:
            first, second = pyvista.read(first), pyvista.read(second)
            np.testing.assert_array_equal(first.points, second.points)
            np.testing.assert_array_equal(first.cells, second.cells)
            before, after = data_of(series, first), data_of(series, second)
            assert set(after.keys()) == set(fields) | {"volume"} | IDENTITY
            for name in after.keys():
                np.testing.assert_array_equal(before[name], after[name], err_msg=name)


@pytest.mark.parametrize("method", ["cpdi2", "mpm"])
def test_single_precision_has_seven_digits(run, method):
    everything, single = run("{every: 2}", method), run("{every: 2, precision: single}", method)
    for series in ("points", "domains", "grid"):
        for (_, first), (_, second) in zip(everything.series(series), single.series(series), strict=True):
            for read in (pyvista.read, meshio.read):
                double, half = read(first), read(second)
                assert half.points.dtype == np.float32
                np.testing.assert_allclose(half.points, double.points, rtol=6e-8, atol=1e-30)
            double, half = pyvista.read(first), pyvista.read(second)
            before, after = data_of(series, double), data_of(series, half)
            assert set(before.keys()) == set(after.keys())
            for name in before.keys():
                if name in IDENTITY:
                    np.testing.assert_array_equal(before[name], after[name])
                else:
                    assert after[name].dtype == np.float32, name
                    np.testing.assert_array_equal(before[name].astype(np.float32), after[name], err_msg=name)
            assert half.field_data["TimeValue"].dtype == np.float64
            assert half.field_data["TimeValue"] == double.field_data["TimeValue"]
        sizes = [sum(path.stat().st_size for _, path in run.series(series)) for run in (everything, single)]
        assert sizes[1] < 0.75 * sizes[0] or series == "grid", sizes


def test_results_do_not_depend_on_what_is_written(run, whole):
    other = run("{every: 1, precision: single, fields: [J]}")
    for name in ("history.csv", "quality.csv", "convergence.csv"):
        assert (other.directory / name).read_bytes() == (whole.directory / name).read_bytes(), name


@pytest.mark.parametrize(
    "fields, shown",
    [
        ("cauchy_stress, pressure, displacement", "pressure"),
        ("displacement", "displacement magnitude"),
        ("", "volume"),
        ("von_mises_stress", "von Mises stress"),
    ],
)
def test_a_report_shows_what_there_is(run, mpm, fields, shown):
    results = run(f"{{precision: single, fields: [{fields}]}}")
    process = mpm("report", results.directory)
    assert process.returncode == 0, process.stderr
    assert f"{shown}" in (results.directory / "report.html").read_text()
    process = mpm("report", results.directory, "--field", "elastic_strain:XX")
    assert process.returncode == 2
    assert "the points have no field `elastic_strain`" in process.stderr, process.stderr
    assert "`volume`" in process.stderr, process.stderr


def test_a_comparison_shows_what_all_have(run, mpm, whole, tmp_path):
    other = run("{fields: [pressure, displacement]}")
    page = tmp_path / "comparison.html"
    process = mpm("report", whole.directory, other.directory, "--out", page)
    assert process.returncode == 0, process.stderr
    assert "pressure" in page.read_text()


@pytest.mark.parametrize(
    "output, complaint",
    [
        ("{fields: [displacment]}", "did you mean `displacement`?"),
        ("{fields: [stress]}", "cauchy_stress"),
        ("{fields: [J, displacement, J]}", "the field `J` is listed twice"),
        ("{fields: J}", "list"),
        ("{precision: half}", "`single`"),
        ("{precision: 32}", "expected text"),
    ],
)
def test_wrong_choices_are_explained(mpm, tmp_path, output, complaint):
    deck = tmp_path / "deck.yaml"
    deck.write_text(DECK.replace("METHOD", "mpm").replace("OUTPUT", output))
    process = mpm("check", deck)
    assert process.returncode == 2
    assert complaint in process.stderr and "--> " in process.stderr, process.stderr


def test_a_run_may_go_on_with_other_fields(mpm, tmp_path):
    deck, out = tmp_path / "deck.yaml", tmp_path / "out"
    text = DECK.replace("METHOD", "gimp").replace("steps: {count: 4}", "steps: {count: 4}\ncheckpoint: {every: 2}")

    def write(output, last):
        weight = f"acceleration: [0, -10], curve: [[0, 0], [0.5, 1], [1, {last}]]"
        deck.write_text(text.replace("OUTPUT", output).replace("acceleration: [0, -10]", weight))

    write("{every: 1}", "1e9")
    assert mpm("run", deck, "--out", out).returncode == 1
    write("{fields: [J], precision: single}", "1.5")
    process = mpm("run", deck, "--out", out, "--resume")
    assert process.returncode == 0, process.stderr
    files = [pyvista.read(path) for _, path in Results(out).series("points")]
    assert [len(file.point_data.keys()) for file in files] == [13, 13, 13, 5, 5]
    # What is shown where nothing is asked for is what all files have.
    process = mpm("report", out)
    assert process.returncode == 0, process.stderr
