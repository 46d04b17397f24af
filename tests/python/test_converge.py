"""Convergence studies: values, orders and error bars against closed forms, and grids that cannot be compared."""

import csv
import json
import math

import pytest

from conftest import ROOT
from package import mpm as package

# A bar that is pulled by its own weight along x: the displacement of its end is γL²/2M, with an error of second order
# in the size of the cells; one load step of a nearly rigid material.
BAR = """
version: 1
parameters: {{h: 0.125, n: 2}}
grid: {{type: structured, origin: [0, 0], size: [2, 1], spacing: {spacing}}}
materials: {{rod: {{model: hencky, young: 1e9, poisson: 0, density: 1000}}}}
bodies: [{{name: rod, material: rod, shape: {{type: box, min: [0, 0], max: [{length}, 1]}}, {points}}}]
boundary_conditions:
  - {{name: end, nodes: {{x: 0}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
  - {{name: top, nodes: {{y: 1}}, fix: [y]}}
loads: [{{name: weight, type: gravity, acceleration: [10, 0]}}]
steps: {{count: 1}}
output: {{every: 0, probes: [{{name: tip, body: rod, nearest: [{length}, 0.5], count: 1}}]}}
"""


def bar(path, spacing='"${h}"', points="method: mpm, points_per_cell: 2", length=1):
    path.write_text(BAR.format(spacing=spacing, points=points, length=length))
    return path


def study(directory):
    """The study in a directory."""
    return json.loads((directory / "convergence_study.json").read_text())


def test_bearing_capacity_lies_within_the_bar(mpm, tmp_path):
    """Prandtl's load on the half footing, 148.3 kN; a side of 1 does not fit, so the grids are finer."""
    mpm("converge", ROOT / "inputs/bearing.yaml", "--quantity", "footing_ry", "--out", tmp_path)
    found = study(tmp_path)
    assert [run["label"] for run in found["grids"]] == ["h=0.5", "h=0.25", "h=0.125"]
    estimate = found["estimate"]
    assert estimate["trend"]["kind"] == "order" and 0.5 < estimate["order"] < 1.5
    angle = math.radians(20)
    n_q = math.tan(math.pi / 4 + angle / 2) ** 2 * math.exp(math.pi * math.tan(angle))
    exact = -(n_q - 1) / math.tan(angle) * 10e3
    assert abs(estimate["value"] - exact) < estimate["bar"]
    values = [run["value"] for run in found["grids"]]
    o = math.log2((values[1] - values[0]) / (values[2] - values[1]))
    assert estimate["order"] == pytest.approx(o, rel=1e-9)
    step = (values[2] - values[1]) / (2**o - 1)
    assert estimate["value"] == pytest.approx(values[2] + step, rel=1e-9)
    spread = abs(found["moved"]["value"] - values[1]) / 2
    assert estimate["bar"] == pytest.approx(1.25 * abs(step) + spread, rel=1e-9)
    assert "along x by 0.31" in found["moved"]["label"] and "D028" in found["not_moved"]


def test_a_wanted_error_is_reached_or_said_to_be_missed(mpm, tmp_path):
    deck = ROOT / "inputs/collapse.yaml"
    options = ["--quantity", "block_extent_x_max", "--set", "every=0", "--out", tmp_path]
    process = mpm("converge", deck, *options, "--to", "2%")
    found = study(tmp_path)
    assert process.returncode == 0, process.stderr
    assert found["estimate"]["bar"] <= 0.02 * abs(found["estimate"]["value"])
    assert [run["label"] for run in found["grids"]] == ["h=4", "h=2", "h=1", "h=0.5"]
    assert found["moved"]["label"] == "h=2, moved along y by 0.44"
    rows = list(csv.DictReader((tmp_path / "convergence_study.csv").open()))
    assert [float(row["value"]) for row in rows][:4] == [run["value"] for run in found["grids"]]
    page = (tmp_path / "convergence.html").read_text()
    assert page.count('<svg class="chart"') == 2 and "block_extent_x_max" in page
    again = mpm("converge", deck, *options, "--to", "2%")
    assert again.stderr.count("completed earlier") == len(found["grids"]) + 1
    assert process.stderr.count("completed earlier") == 0
    listed = mpm("converge", deck, *options, "--over", "h=4,2,1", "--to", "0.1%")
    assert listed.returncode == 1 and "the wanted error is not reached" in listed.stderr


def test_spacing_is_replaced_where_no_parameter_sets_it(mpm, tmp_path):
    """With GIMP, a moved grid cuts the cells at the end of the rod."""
    deck = bar(tmp_path / "bar.yaml", "0.125", "method: cpdi2, point_spacing: 0.0625", length=1)
    process = mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "out")
    assert process.returncode == 2 and "the body `rod`: its `point_spacing` does not change" in process.stderr
    deck = bar(tmp_path / "bar.yaml", "0.125", "method: cpdi2, points_per_cell: 2", length=1)
    mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "out")
    found = study(tmp_path / "out")
    assert [run["label"] for run in found["grids"]] == ["spacing x 4", "spacing x 2", "spacing x 1"]
    assert [run["size"] for run in found["grids"]] == [0.5, 0.25, 0.125]
    # The probe is the mean of the points nearest to the end, h/4 from it.
    assert found["estimate"]["value"] == pytest.approx(1000 * 10 / 2 / 1e9, rel=1e-3)


def test_a_mesh_needs_a_list(mpm, tmp_path):
    deck = ROOT / "inputs/annulus.yaml"
    quantity = ["--quantity", "ring_extent_x_max", "--set", "steps=2", "--set", "every=0", "--out", tmp_path]
    refused = mpm("converge", deck, *quantity)
    assert refused.returncode == 2 and "the grid is a mesh" in refused.stderr and "--over" in refused.stderr
    mpm("converge", deck, *quantity, "--over", "segments=18,36,72")
    found = study(tmp_path)
    sizes = [run["size"] for run in found["grids"]]
    assert sizes[0] / sizes[1] == pytest.approx(2, rel=0.1)
    assert found["moved"] is None and "mesh" in found["not_moved"]


def test_no_bar_where_values_need_not_converge(mpm, tmp_path):
    options = ["--quantity", "footing_ry", "--out", tmp_path, "--set", "h=0.125"]
    process = mpm("converge", ROOT / "inputs/bearing.yaml", *options, "--set", "psi=0", "--set", "steps=4",
                  "--set", "settlement=0.004")
    found = study(tmp_path)
    assert found["estimate"]["trend"]["kind"] == "refused" and found["estimate"]["bar"] is None
    assert "no error bar: the dilation angle of the material `soil` differs" in process.stderr


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--quantity", "tip_uz"], "did you mean `tip_u"),
        (["--quantity", "factor_of_safety"], "no stage has bracketed a factor of safety"),
        (["--quantity", "tip_uy", "--over", "h=0.25,0.5,1"], "does not have smaller cells"),
        (["--quantity", "tip_uy", "--over", "h=1,0.5"], "at least three grids"),
        (["--quantity", "tip_uy", "--over", "hh=1,0.5,0.25"], "no parameter `hh`"),
        (["--quantity", "tip_uy", "--to", "200%"], "expected an error"),
        (["--quantity", ""], "expected a column"),
    ],
)
def test_faults_have_a_remedy(mpm, tmp_path, arguments, message):
    options = ["--set", "steps=2", "--set", "every=0", "--out", tmp_path]
    process = mpm("converge", ROOT / "inputs/beam.yaml", *arguments, *options)
    assert process.returncode == 2 and message in process.stderr, process.stderr


def test_the_package_gives_the_study_of_the_program(mpm, tmp_path):
    deck = package.Deck.load(str(ROOT / "inputs/bearing.yaml"), steps=4)
    found = package.converge(deck, "footing_ry", to=0.4, threads=2, out=tmp_path / "package")
    process = mpm("converge", ROOT / "inputs/bearing.yaml", "--quantity", "footing_ry", "--set", "steps=4", "--to",
                  "40%", "--out", tmp_path / "program")
    mine, its = study(tmp_path / "package"), study(tmp_path / "program")
    for name in ("quantity", "not_moved", "dimensions"):
        assert mine[name] == its[name]
    assert mine["estimate"] == its["estimate"] and found.conclusion in process.stderr
    assert [run["value"] for run in mine["grids"]] == [run["value"] for run in its["grids"]]
    assert found.value == its["estimate"]["value"] and found.order == its["estimate"]["order"]
    assert found.relative_bar <= 0.4 and found.moved.label == its["moved"]["label"]
    assert (tmp_path / "package/convergence.html").is_file()
    with pytest.raises(package.UsageError, match="did you mean `footing_r"):
        package.converge(deck, "footing_rr")


ELASTIC = """
version: 1
parameters: {h: 0.5, n: 32, height: 1}
grid: {type: structured, origin: [0, 0], size: [16, 16], spacing: SPACING}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 1000}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0], max: [16, 16]}, method: mpm, points_per_cell: 2}]
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: g, type: gravity, acceleration: [1, -1]}]
steps: {count: 2, until: end}
output: {every: 0, probes: [{name: tip, body: b, nearest: [16, 16]}]}
"""


@pytest.mark.parametrize(
    "spacing, message",
    [
        ('"${h}", refine: [{at: [8, 8], to: 0.1}]', "the cells of `refine` do not change with the others"),
        (
            '[[{to: 8, cells: "${n/2}", ratio: 1.2}, {to: 16, cells: "${n/2}"}], 1]',
            "are not all divided alike",
        ),
    ],
)
def test_grids_that_are_not_refined_alike_are_refused(mpm, tmp_path, spacing, message):
    deck = tmp_path / "deck.yaml"
    deck.write_text(ELASTIC.replace("SPACING", spacing))
    options = ["--over", "n=8,16,32"] if "cells" in spacing else []
    process = mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "out", *options)
    assert process.returncode == 2 and message in process.stderr, process.stderr


def test_places_that_follow_the_cells_are_refined_alike(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    places = '"${h}", refine: [{at: [8, 8], to: "${h/4}"}, {at: [16, 16], to: "${h/2}"}]'
    roomy = ELASTIC.replace("size: [16, 16]", "size: [20, 20]").replace("gravity, acceleration: [1, -1]", "gravity, acceleration: [0.1, -0.1]")
    deck.write_text(roomy.replace("SPACING", places))
    mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "out")
    found = study(tmp_path / "out")
    assert [run["label"] for run in found["grids"]] == ["h=2", "h=1", "h=0.5"]
    deck.write_text(roomy.replace("SPACING", '"${h}"'))
    mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "plain")
    even = study(tmp_path / "plain")["estimate"]
    estimate = found["estimate"]
    assert abs(estimate["value"] - even["value"]) < estimate["bar"] + even["bar"]


def test_a_length_of_the_body_is_not_a_cell_size(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    body = ELASTIC.replace("SPACING", '"${height/4}"').replace("max: [16, 16]", 'max: [16, "${height}"]')
    deck.write_text(body)
    mpm("converge", deck, "--quantity", "tip_ux", "--out", tmp_path / "out")
    found = study(tmp_path / "out")
    assert all(run["label"].startswith("spacing x") for run in found["grids"])


def test_only_a_limit_that_is_reached_counts(mpm, tmp_path):
    text = (ROOT / "inputs/bearing.yaml").read_text().replace('{count: "${steps}"}', '{count: "${steps}", until: limit}')
    (tmp_path / "deck.yaml").write_text(text)
    options = ["converge", tmp_path / "deck.yaml", "--quantity", "limit_load", "--out", tmp_path / "out", "--set"]
    refused = mpm(*options, "settlement=0.003")
    assert refused.returncode == 2 and "the load still grew at the end" in refused.stderr
    found = mpm(*options, "settlement=0.02", "--set", "steps=40")
    assert found.returncode == 0, found.stderr
    estimate = study(tmp_path / "out")["estimate"]
    assert abs(estimate["value"] - 148.35e3) < estimate["bar"]


# A footing that reaches its limit on the grids of the deck, but not where their lines are moved.
MOVED = """
version: 1
parameters: {h: 0.25}
grid: {type: structured, origin: [0, 0], size: [4, 2.5], spacing: "${h}"}
materials: {clay: {model: von-mises, young: 1e8, poisson: 0.49, deviatoric_yield_stress: 14142}}
bodies:
  - {name: soil, material: clay, method: cpdi2, strain: mean-dilatation, points_per_cell: 2,
     shape: {type: box, min: [0, 0], max: [4, 2]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 4}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: footing, nodes: {box: {min: [0, 2], max: [1, 2]}}, uy: -0.0011}
steps: {count: 12, until: limit}
output: {every: 0}
"""


def test_a_moved_grid_without_the_quantity_does_not_end_the_study(mpm, tmp_path):
    """The three grids have a conclusion without the run on the moved one."""
    (tmp_path / "deck.yaml").write_text(MOVED)
    process = mpm("converge", tmp_path / "deck.yaml", "--quantity", "limit_load", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    found = study(tmp_path / "out")
    assert found["moved"] is None and "on the moved grid, no stage has ended at a limit load" in found["not_moved"]
    of_package = package.converge(package.Deck.load(tmp_path / "deck.yaml"), "limit_load", threads=1)
    assert of_package.value == found["estimate"]["value"] and "on the moved grid" in of_package.not_moved


def test_other_results_are_not_overwritten(mpm, tmp_path):
    deck = ROOT / "inputs/beam.yaml"
    quick = ["--set", "steps=2", "--set", "every=0", "--out", tmp_path]
    mpm("run", deck, *quick)
    table = (tmp_path / "convergence.csv").read_bytes()
    process = mpm("converge", deck, "--quantity", "tip_uy", *quick)
    assert process.returncode == 2 and "choose another directory" in process.stderr
    assert (tmp_path / "convergence.csv").read_bytes() == table


def test_meshes_are_listed_from_coarse_to_fine(mpm, tmp_path):
    quantity = ["--quantity", "ring_extent_x_max", "--set", "steps=2", "--set", "every=0", "--out", tmp_path]
    process = mpm("converge", ROOT / "inputs/annulus.yaml", *quantity, "--over", "segments=36,18,72")
    assert process.returncode == 2 and "list grids from coarse to fine" in process.stderr
