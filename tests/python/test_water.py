"""Water at rest and undrained materials beside closed forms: exact ground, buoyancy, stiffness of pore water, and restarts."""

import csv

import numpy as np
import pytest

from conftest import ROOT
from results import Results

G, DENSITY, POROSITY, WEIGHT, HEIGHT, K0 = 9.81, 1600.0, 0.4, 9810.0, 4.0, 0.6
METHODS = ["mpm", "gimp", "cpdi1", "cpdi2"]
LIFT = WEIGHT * (1 - POROSITY)

GROUND = """version: 1
analysis: {{idealisation: {idealisation}}}
grid: {{type: structured, origin: {origin}, size: {size}, spacing: 0.5}}
materials:
  soil: {{model: {model}, young: 2e7, poisson: 0.3, density: 1600, porosity: 0.4}}
bodies:
  - {{name: soil, material: soil, method: {method}, points_per_cell: 2, shape: {{type: box, min: {origin}, max: {top}}},
     initial_stress: {{type: geostatic, surface: 4, k0: 0.6}}}}
water: {{unit_weight: 9810, level: {level}}}
boundary_conditions: [{conditions}]
loads: [{{name: weight, type: gravity, acceleration: {gravity}}}]
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
{steps}
"""


def ground(idealisation, method, level, model="hencky", steps="steps: {count: 1}"):
    """Ground of four metres between rollers."""
    space = idealisation == "solid"
    axes, last = ("xy", "z") if space else ("x", "y")
    sides = [f"{{name: {axis}{at}, nodes: {{{axis}: {at}}}, fix: [{axis}]}}" for axis in axes for at in (0, 1)]
    base = f"{{name: base, nodes: {{{last}: 0}}, fix: [{last}]}}"
    zeros = [0] * len(axes)
    return GROUND.format(
        idealisation=idealisation, method=method, level=level, model=model, steps=steps, origin=[*zeros, 0],
        size=[*(1 for _ in axes), 6], top=[*(1 for _ in axes), 4], gravity=[*zeros, -G], conditions=", ".join([*sides, base]),
    )


def vertical(z, level, half=0.125):
    """Effective vertical stress at a height, the mean over the vertical extent of the domain of a point."""
    depth = level - z
    cut = (np.clip(depth, -half, half) + half) ** 2 / (4 * half)
    below = np.where(depth >= half, depth, np.where(depth <= -half, 0.0, cut)) - max(level - HEIGHT, 0.0)
    return -(DENSITY * G * (HEIGHT - z) - LIFT * below)


def run(mpm, folder, deck, *words):
    """Runs a deck; returns its results."""
    folder.mkdir(exist_ok=True)
    (folder / "deck.yaml").write_text(deck)
    process = mpm("run", folder / "deck.yaml", "--out", folder / "out", *words)
    assert process.returncode == 0, process.stderr
    return Results(folder / "out")


@pytest.mark.parametrize("level", [0.13, 2.3, 2.3755, 5.2])
@pytest.mark.parametrize("idealisation, method, model",
                         [("plane-strain", method, "hencky") for method in METHODS]
                         + [("axisymmetric", "gimp", "hencky"), ("solid", "cpdi2", "neo-hookean")])
def test_ground_at_rest_is_exact_with_a_level_anywhere(mpm, tmp_path, idealisation, method, model, level):
    points = run(mpm, tmp_path, ground(idealisation, method, level, model)).mesh("points", -1)
    axis = 2 if idealisation == "solid" else 1
    z = points.points[:, axis]
    stress, total = points["cauchy_stress"], points["total_stress"]
    exact = vertical(z, level)
    largest = np.abs(exact).max()
    assert np.abs(stress[:, axis] - exact).max() < 1e-10 * largest
    assert np.abs(stress[:, 0] - K0 * exact).max() < 1e-10 * largest
    pressure = WEIGHT * np.maximum(level - z, 0)
    assert np.abs(points["pore_pressure"] - pressure).max() < 1e-10 * largest
    assert np.abs(stress[:, axis] - pressure - total[:, axis]).max() < 1e-10 * largest
    assert np.abs(points["displacement"]).max() < 1e-12


BLOCK = """version: 1
grid: {{type: structured, origin: [0, -0.5], size: [3, 2.5], spacing: 0.25}}
materials:
  stone: {{model: neo-hookean, young: 1e6, poisson: 0.2, density: 1600, {pores}}}
bodies:
  - {{name: stone, material: stone, method: {method}, shape: {{type: box, min: [1, 0], max: [2, 1]}}, points_per_cell: 2}}
water: {{unit_weight: 9810, level: {level}}}
boundary_conditions: [{{name: base, nodes: {{y: 0}}, fix: [x, y]}}]
loads: [{{name: weight, type: gravity, acceleration: [0, -9.81]}}]
solver: {{tolerance: 1e-12}}
steps: {{count: 2}}
"""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("pores, grains", [("porosity: 0.4", 0.6), ("drainage: dry", 1.0)])
def test_the_support_of_a_body_in_water_bears_its_weight_less_its_buoyancy(mpm, tmp_path, method, pores, grains):
    weight = 1600 * 9.81
    under = run(mpm, tmp_path / "under", BLOCK.format(method=method, pores=pores, level=5)).history
    assert under["base_ry"][-1] == pytest.approx(weight - grains * 9810, rel=1e-10)
    assert under["water_fy"][-1] == pytest.approx(grains * 9810, rel=1e-10)
    partly = run(mpm, tmp_path / "partly", BLOCK.format(method=method, pores=pores, level=0.3137)).history
    lifted = partly["water_fy"][-1]
    assert partly["base_ry"][-1] == pytest.approx(weight - lifted, rel=1e-10)
    # The block sinks by about 1 %.
    assert 0.3137 * grains * 9810 < lifted < 1.02 * 0.3137 * grains * 9810


YOUNG, POISSON, WHOLE, Q = 1e7, 0.3, 0.495, 1e4
BULK, SHEAR = YOUNG / (3 * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
WATER = 3 * BULK * (WHOLE - POISSON) / ((1 - 2 * WHOLE) * (1 + POISSON))
COLUMN = """version: 1
grid: {{type: structured, origin: [0, 0], size: [1, 3], spacing: 0.5}}
materials:
  clay: {{model: hencky, young: 1e7, poisson: 0.3, drainage: undrained, undrained_poisson: 0.495}}
  drained: {{model: hencky, young: 1e7, poisson: 0.3}}
bodies:
  - {{name: clay, material: clay, method: {method}, strain: mean-dilatation, points_per_cell: 2,
     shape: {{type: box, min: [0, 0], max: [1, 2]}}}}
surfaces: [{{name: top, body: clay, part: {{edge: 2}}}}]
boundary_conditions:
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 1}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
loads: [{{name: load, type: pressure, surface: top, pressure: 1e4}}]
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
stages:
  - {{name: load, steps: {{count: 1}}, factors: {{load: 1}}}}
  - {{name: wait, steps: {{count: 4}}, material: {{clay: drained}}}}
"""


def compressed(stress_and_slope):
    """The logarithmic strain at which a column bears the load."""
    strain = 0.0
    for _ in range(50):
        stress, slope = stress_and_slope(strain)
        strain -= (stress + Q) / slope
    return strain


@pytest.mark.parametrize("method", METHODS)
def test_undrained_columns_have_the_stiffness_of_the_water_until_they_drain(mpm, tmp_path, method):
    results = run(mpm, tmp_path, COLUMN.format(method=method))
    modulus = BULK + 4 * SHEAR / 3
    drained = compressed(lambda e: (modulus * e * np.exp(-e), modulus * (1 - e) * np.exp(-e)))
    undrained = compressed(lambda e: (modulus * e * np.exp(-e) + WATER * e, modulus * (1 - e) * np.exp(-e) + WATER))
    loaded, after = [results.mesh("points", index) for index in (1, -1)]
    assert np.log(loaded["volume"].sum() / 2) == pytest.approx(undrained, rel=1e-9)
    assert loaded["excess_pore_pressure"] == pytest.approx(-WATER * undrained, rel=1e-9)
    assert loaded["total_stress"][:, 1] == pytest.approx(-Q, rel=1e-8)
    assert np.log(after["volume"].sum() / 2) == pytest.approx(drained, rel=1e-9)
    assert np.abs(after["pore_pressure"]).max() == 0


def test_an_undrained_triaxial_test_is_that_of_one_point(mpm, tmp_path):
    deck = (ROOT / "inputs" / "triaxial.yaml").read_text()
    pores = "    porosity: 0.5\n    drainage: undrained\nwater: {bulk_modulus: 2.2e9}\n"
    deck = deck.replace("    reference_pressure: 100e3\n", "    reference_pressure: 100e3\n" + pores)
    deck = deck.replace("    method: cpdi2", "    strain: mean-dilatation\n    method: cpdi2")
    deck = deck.replace("  every: 10", "  precision: double\n  every: 40") + "solver: {tolerance: 1e-12}\n"
    points = run(mpm, tmp_path, deck).mesh("points", -1)
    table = tmp_path / "table.csv"
    process = mpm("element", tmp_path / "deck.yaml", "--material", "clay", "--path", "triaxial-drained", "--confining",
                  "100e3", "--to", "0.2", "--steps", "40", "--output", table)
    assert process.returncode == 0, process.stderr
    with open(table, newline="") as file:
        row = {key: float(value) for key, value in list(csv.DictReader(file))[-1].items()}
    stress, excess = points["cauchy_stress"], points["excess_pore_pressure"]
    assert stress[:, 0] - stress[:, 1] == pytest.approx(row["deviatoric_stress"], rel=1e-9)
    assert excess == pytest.approx(row["excess_pore_pressure"], rel=1e-9)
    # Cam-clay whose volume is all but constant ends near the critical state.
    mean = -stress[:, :3].sum(1) / 3
    assert (stress[:, 0] - stress[:, 1]) / mean == pytest.approx(1.05, rel=5e-3)


FALL = "stages:\n  - {name: rest, steps: {count: 2}}\n  - {name: fall, steps: {count: 6}, water: {level: 1.1}}\ncheckpoint: {every: 1}"


def test_restarts_and_threads_keep_every_bit(mpm, tmp_path):
    deck = ground("plane-strain", "gimp", 3.3, steps=FALL)
    whole = run(mpm, tmp_path / "whole", deck)
    (tmp_path / "deck.yaml").write_text(deck)
    one = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "one", threads=1)
    assert one.returncode == 0, one.stderr
    last = whole.series("points")[-1][1].name
    wanted = (whole.directory / last).read_bytes()
    assert (tmp_path / "one" / last).read_bytes() == wanted
    # Without its last checkpoint, the run goes on from the one before, in which the level is falling.
    checkpoints = sorted(whole.directory.glob("checkpoint_*.mpm"))
    checkpoints[-1].unlink()
    resumed = mpm("run", tmp_path / "whole" / "deck.yaml", "--out", whole.directory, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert (whole.directory / last).read_bytes() == wanted


def test_a_complete_run_with_water_has_nothing_left_to_do(mpm, tmp_path):
    """Its tables have the column of the force of the water."""
    whole = run(mpm, tmp_path / "whole", ground("plane-strain", "gimp", 2.3))
    again = mpm("run", tmp_path / "whole" / "deck.yaml", "--out", whole.directory, "--resume")
    assert again.returncode == 0 and "nothing is left to do" in again.stdout + again.stderr, again.stderr
