"""Limit loads of bodies that flow at constant volume, beside exact values: the cases of `benches/locking.py`, coarse."""

import itertools
import json
import math
import re
import sys

import meshio
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))
import locking  # noqa: E402

SIXTEENTH = 0.125  # of the width of the footing, which is 2


@pytest.fixture(scope="module")
def found(program, tmp_path_factory):
    """Runs a case with some of its settings once."""
    runs = {}

    def run(name, h, method="mpm", volumetric="mean-dilatation", n=2, **settings):
        key = (name, h, method, volumetric, n, *settings.items())
        if key not in runs:
            settings = {"method": method, "volumetric": volumetric, "n": n} | settings
            runs[key] = locking.run(program, name, tmp_path_factory.mktemp(name), h, **settings)
            assert runs[key].summary["outcome"] == "completed"
        return runs[key]

    return run


def error(name, load):
    return load / locking.CASES[name].exact - 1


@pytest.mark.parametrize("name, method, volumetric, n", [
    ("strip-rough", "mpm", "mean-dilatation", 2),
    ("strip-rough", "mpm", "mean-dilatation", 3),
    ("strip-rough", "gimp", "mean-dilatation", 2),
    ("strip-rough", "mpm", "f-bar", 2),
    ("strip-smooth", "mpm", "mean-dilatation", 2),
])
def test_a_pressure_on_a_strip_has_its_limit_load(found, name, method, volumetric, n):
    run = found(name, SIXTEENTH, method, volumetric, n)
    assert 0 < error(name, run.load) < 0.02
    assert abs(run.rise) < 1e-3


@pytest.mark.parametrize("method, n", [("mpm", 2), ("mpm", 3), ("gimp", 2)])
def test_a_footing_of_nodes_has_its_limit_load_over_its_effective_width(found, method, n):
    run = found("nodes-rough", SIXTEENTH, method, n=n, to=0.0002, steps=4)
    assert abs(error("nodes-rough", run.effective)) < 0.02
    assert error("nodes-rough", run.load) > 0


@pytest.mark.parametrize("name", ["strip-rough", "nodes-rough"])
def test_the_load_does_not_grow_with_the_number_of_points(found, name):
    settings = {"to": 0.0002, "steps": 4} if name == "nodes-rough" else {}
    few, more = (found(name, SIXTEENTH, n=n, **settings).load for n in (2, 3))
    assert abs(more / few - 1) < 0.005


@pytest.mark.parametrize("name", ["strip-rough", "strip-smooth", "nodes-rough"])
@pytest.mark.parametrize("method", ["mpm", "gimp"])
def test_the_standard_treatment_locks(found, name, method):
    run = found(name, SIXTEENTH, method, "standard")
    assert error(name, run.effective) > 0.2
    assert run.rise > 0.02, "the load has no limit"


def test_the_error_of_the_limit_load_falls_with_order_one(found):
    spacings = [0.5, 0.25, SIXTEENTH]
    errors = [error("strip-smooth", found("strip-smooth", h).load) for h in spacings]
    for coarse, fine in itertools.pairwise(errors):
        assert 1.8 < coarse / fine < 2.2


def test_a_notched_plate_has_its_limit_load(found):
    loads = [found("notch", h) for h in (0.125, 0.0625)]
    errors = [error("notch", run.load) for run in loads]
    assert 0 < errors[0] < 0.075 and 1.8 < errors[0] / errors[1] < 2.2
    # The ligament acts wider than it is, but not by a whole half cell.
    assert all(error("notch", run.effective) < 0 for run in loads)
    locked = found("notch", 0.125, volumetric="standard")
    assert error("notch", locked.load) > 0.3 and locked.rise > 0.02


def test_the_weight_of_a_cut_has_a_limit_and_converges_to_the_exact_one(found):
    few, more = (found("cut", SIXTEENTH, n=n).load for n in (2, 3))
    coarse = found("cut", 2 * SIXTEENTH).load
    assert 3.778 < few < coarse and abs(more / few - 1) < 0.005
    # With order one the error of the extrapolated weight is of the second order.
    assert abs(error("cut", 2 * few - coarse)) < 0.015


def test_a_circular_footing_lies_between_the_exact_bounds(found):
    """The von Mises surface lies between two hexagons of Tresca, for which the exact load is 6.048 times their strength."""
    loads = [found("circle", h).effective for h in (0.25, SIXTEENTH)]
    extrapolated = 2 * loads[1] - loads[0]
    assert 6.048 * 3**0.5 / 2 < extrapolated < 6.048
    assert abs(error("circle", extrapolated)) < 0.01


def test_the_script_prints_a_table(program, capsys, monkeypatch, tmp_path):
    file = tmp_path / "rows.csv"
    arguments = ["locking.py", "cut", "--mpm", str(program), "--quick", "--finest", "0.25", "--csv", str(file)]
    monkeypatch.setattr(sys, "argv", arguments)
    locking.main()
    table = capsys.readouterr().out
    assert len(re.findall(r"^\| mpm \| (?:standard|mean-dilatation) \| 2 \| 0.25 \|", table, re.M)) == 2
    assert len(file.read_text().splitlines()) == 3


BEAM = """
version: 1
analysis: {idealisation: IDEALISATION}
grid: {type: structured, origin: [0, 0SIDE], size: [6, 4DEPTH], spacing: 0.5}
materials: {rubber: LAW}
bodies:
  - {name: beam, material: rubber, shape: {type: box, min: [0, 2SIDE], max: [4, 3DEPTH]}, method: METHOD,
     volumetric: VOLUMETRIC, points_per_cell: 2}
boundary_conditions: [{name: wall, nodes: WALL, fix: [FIX]}]
loads: [{name: weight, type: gravity, acceleration: [0, -3SIDE]}]
solver: {tolerance: 1.0e-11}
steps: {count: 2}
output: {every: 0}
"""


@pytest.mark.parametrize("method, volumetric", [
    *itertools.product(["mpm", "gimp", "cpdi1", "cpdi2"], ["mean-dilatation"]), ("mpm", "f-bar"), ("gimp", "f-bar")])
@pytest.mark.parametrize("idealisation", ["plane-strain", "axisymmetric", "solid"])
@pytest.mark.parametrize("law", ["neo-hookean, young: 1000, poisson: 0.49, density: 1",
                                 "von-mises, young: 1000, poisson: 0.3, deviatoric_yield_stress: 90, density: 1"])
def test_iterations_converge_quadratically(mpm, tmp_path, law, idealisation, method, volumetric):
    solid = idealisation == "solid"
    # A ring is held at its inner bottom, a beam at its end.
    wall, fix = ("{y: 2}", "x, y") if idealisation == "axisymmetric" else ("{x: 0}", "x, y, z" if solid else "x, y")
    text = BEAM.replace("IDEALISATION", idealisation).replace("LAW", f"{{model: {law}}}").replace("METHOD", method)
    text = text.replace("VOLUMETRIC", volumetric).replace("WALL", wall).replace("FIX", fix)
    text = text.replace("SIDE", ", 0" if solid else "").replace("DEPTH", ", 1" if solid else "")
    if idealisation == "axisymmetric":
        text = text.replace("boundary_conditions: [", "boundary_conditions: [{name: axis, nodes: {x: 0}, fix: [x]}, ")
    (tmp_path / "deck.yaml").write_text(text)
    done = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "out/convergence.csv") as file:
        rows = [line.strip().split(",") for line in itertools.islice(file, 1, None)]
    ends = 0
    for _, step in itertools.groupby(rows, key=lambda row: row[0]):
        residuals = [float(residual) for _, _, residual, *_ in step]
        if residuals[-1] < 1e-10:
            # Round-off hides what follows from a small residual.
            last = max(k for k, residual in enumerate(residuals) if residual > 1e-8)
            before, after = -math.log10(residuals[last]), -math.log10(residuals[last + 1])
            # The constant is the ratio of axial to bending stiffness, as in `tests/verification/beam.rs`.
            assert after > min(2 * before - 4.3, 10.5), residuals
            ends += 1
    assert ends >= 2


SEAM = """
version: 1
grid: {type: structured, origin: [0, 0], size: [5, 5], spacing: 1}
materials: {m: {model: hencky, young: 1000, poisson: 0.4999}}
bodies:
  - {name: a, material: m, shape: {type: box, min: [0, 0], max: [X, 3]}, method: mpm, volumetric: mean-dilatation, point_spacing: 0.25}
  - {name: b, material: m, shape: {type: box, min: [X, 0], max: [3, 3]}, method: mpm, volumetric: mean-dilatation, point_spacing: 0.25}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: push, nodes: {box: {min: [0, 3], max: [1, 3]}}, ux: 0, uy: -0.05}
steps: {count: 4}
output: {every: 0}
"""


def test_bodies_of_one_material_share_the_volume_of_a_cell(mpm, tmp_path):
    forces = []
    for x in ("1.5", "2"):
        (tmp_path / "deck.yaml").write_text(SEAM.replace("X", x))
        done = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / x)
        assert done.returncode == 0, done.stderr
        lines = (tmp_path / x / "history.csv").read_text().splitlines()
        forces.append(float(lines[-1].split(",")[lines[0].split(",").index("push_ry")]))
    # A seam in the middle of cells locked them by 63 % where each body kept a volume of its own.
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)


SLIVERS = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [5, 5, 5], spacing: 1}
materials: {m: {model: hencky, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: box, min: [LOW, LOW, LOW], max: [HIGH, HIGH, HIGH]}, method: gimp,
          volumetric: VOLUMETRIC, point_spacing: 0.5}]
boundary_conditions:
  - {name: all, nodes: {box: {min: [0, 0, 0], max: [5, 5, 5]}}, ux: "0.3", uy: "0.3", uz: "0.3"}
steps: {count: 1}
output: {fields: [cauchy_stress]}
"""


@pytest.mark.parametrize("volumetric", ["mean-dilatation", "f-bar"])
def test_domains_that_touch_cells_by_slivers_move_without_stress(mpm, tmp_path, volumetric):
    text = SLIVERS.replace("LOW", "0.999").replace("HIGH", "2.999").replace("VOLUMETRIC", volumetric)
    (tmp_path / "deck.yaml").write_text(text)
    done = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    stress = meshio.read(tmp_path / "out/points_0001.vtu").point_data["cauchy_stress"]
    assert abs(stress).max() < 1e-12 * 1000


@pytest.mark.parametrize("idealisation, method", [("plane-strain", "mpm"), ("plane-strain", "gimp"), ("solid", "mpm")])
def test_f_bar_is_solved_by_iterations(mpm, tmp_path, idealisation, method):
    solid = idealisation == "solid"
    text = BEAM.replace("IDEALISATION", idealisation).replace("METHOD", method).replace("VOLUMETRIC", "f-bar")
    text = text.replace("LAW", "{model: neo-hookean, young: 1000, poisson: 0.45, density: 1}").replace("WALL", "{x: 0}")
    text = text.replace("FIX", "x, y, z" if solid else "x, y").replace("spacing: 0.5", "spacing: 0.25")
    text = text.replace("SIDE", ", 0" if solid else "").replace("DEPTH", ", 1" if solid else "")
    text = text.replace("tolerance: 1.0e-11", "tolerance: 1.0e-9, linear: LINEAR").replace("[0, -3", "[0, -0.3")
    forces = []
    for linear in ("direct", "iterative"):
        (tmp_path / "deck.yaml").write_text(text.replace("LINEAR", linear))
        done = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / linear)
        assert done.returncode == 0 and "W004" not in done.stderr, done.stderr
        summary = json.loads((tmp_path / linear / "summary.json").read_text())
        assert (summary["iterative_solves"] > 0) == (linear == "iterative")
        assert summary["linear_solves"] == summary["iterative_solves"] or linear == "direct"
        lines = (tmp_path / linear / "history.csv").read_text().splitlines()
        forces.append(float(lines[-1].split(",")[lines[0].split(",").index("wall_mz")]))
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)
