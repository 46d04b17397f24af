"""A deck in four sets of units has the same results, with labels of its own."""

import json

import pytest

LENGTH = {"m": 1, "mm": 1e-3, "ft": 0.3048}
FORCE = {"N": 1, "kN": 1e3, "lbf": 4.4482216152605}
DECK = """\
version: 1
title: A block of clay slumps
units: {{length: {length}, force: {force}}}
grid: {{type: structured, origin: [0, 0], size: [{eight!r}, {five!r}], spacing: {half!r}}}
materials:
  clay: {{model: von-mises, young: {young!r}, poisson: 0.3, deviatoric_yield_stress: {strength!r}, density: {density!r}}}
bodies:
  - {{name: block, material: clay, shape: {{type: box, min: [0, 0], max: [{four!r}, {four!r}]}}, points_per_cell: 2, strain: mean-dilatation}}
boundary_conditions:
  - {{name: symmetry, nodes: {{x: 0}}, fix: [x]}}
  - {{name: floor, nodes: {{y: 0}}, fix: [x, y]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, {gravity!r}]}}
steps: {{count: 10}}
output: {{every: 10}}
"""


def deck(length, force):
    """The deck, with all numbers in these units."""
    x = 1 / LENGTH[length]
    stress, density = LENGTH[length] ** 2 / FORCE[force], LENGTH[length] ** 4 / FORCE[force]
    return DECK.format(
        length=length, force=force, eight=8 * x, five=5 * x, half=0.5 * x, four=4 * x, gravity=-9.81 * x,
        young=1e6 * stress, strength=24e3 * stress, density=2000 * density,
    )


@pytest.mark.parametrize(
    "length, force, stress, density, line",
    [("m", "N", "Pa", "kg/m³", "[N/m]"), ("m", "kN", "kPa", "t/m³", "[kN/m]"),
     ("mm", "N", "MPa", "t/mm³", "[N/mm]"), ("ft", "lbf", "psf", "slug/ft³", "[lbf/ft]")],
)
def test_numbers_are_the_same_and_labels_right(mpm, tmp_path, length, force, stress, density, line):
    path = tmp_path / "deck.yaml"
    path.write_text(deck(length, force))
    process = mpm("run", path, "--out", tmp_path / "out")
    assert process.returncode == 0 and "D040" not in process.stderr, process.stderr
    assert f"forces {line}" in process.stdout and f" {stress} at (" in process.stdout
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["units"]["stress"], summary["units"]["density"]) == (stress, density)
    weight = summary["forces"]["reactions"]["floor"][1] * FORCE[force] / LENGTH[length]
    assert weight == pytest.approx(2000 * 9.81 * 16, rel=1e-9)
    report = mpm("report", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert report.returncode == 0 and f"\u00a0{stress}" in page and f"[{force}/{length}]" in page


def test_without_units_nothing_is_labelled(mpm, tmp_path):
    path = tmp_path / "deck.yaml"
    path.write_text(deck("m", "N").replace("units: {length: m, force: N}\n", ""))
    process = mpm("run", path, "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "units" not in summary and "forces [" not in process.stdout and " Pa " not in process.stdout
