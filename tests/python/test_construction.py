"""The decks of stages, an excavation with a prop and a footing beside an excavation, against balances and closed forms."""

import re

import numpy as np
import pytest

from conftest import ROOT
from results import Results

G = 9.81


@pytest.fixture(scope="module")
def excavation(analyse):
    return analyse("inputs/excavation.yaml")


@pytest.fixture(scope="module")
def footing(analyse):
    return analyse("inputs/footing_stages.yaml", h=0.5)


@pytest.fixture(scope="module")
def level(mpm, tmp_path_factory):
    """The footing on level rock, without the pit, as the page says."""
    folder = tmp_path_factory.mktemp("level")
    text = (ROOT / "inputs/footing_stages.yaml").read_text()
    assert ", remove: [pit]" in text
    (folder / "whole.yaml").write_text(text.replace(", remove: [pit]", ""))
    process = mpm("run", folder / "whole.yaml", "--out", folder / "out", "--set", "dip=0", "--set", "h=0.5")
    assert process.returncode == 0, process.stderr
    return Results(folder / "out")


def at_end_of(results, stage):
    """The last row of a stage in history.csv, by its number from 1."""
    history = results.history
    row = np.flatnonzero(history["stage"] == stage)[-1]
    return {name: values[row] for name, values in history.items()}


def loads_along_y(row):
    return sum(value for name, value in row.items() if name.endswith("_fy"))


def test_ground_at_rest_carries_the_weight_above_it(excavation):
    points = excavation.mesh("points", 1)
    depth = 12 - (points.points - points["displacement"])[:, 1]
    stress = points["cauchy_stress"]
    assert -stress[:, 1] == pytest.approx(1800 * G * depth, rel=1e-10)
    assert stress[:, 0] / stress[:, 1] == pytest.approx(0.7, rel=1e-10)
    assert stress[:, 2] / stress[:, 1] == pytest.approx(0.7, rel=1e-10)
    assert excavation.summary["initial_state"]["balanced"]


def test_every_stage_of_the_excavation_is_in_balance(excavation):
    ground = 1800 * (16 * 8 + 12 * 4) * G - 1800 * 0.5 * 8 * G
    weights = {1: 1800 * 16 * 12, 2: 1800 * (16 * 12 - 4) + 2400 * 4, 3: 1800 * (16 * 12 - 12) + 2400 * 4}
    weights |= {4: 1800 * (16 * 12 - 20) + 2400 * 4, 5: 1800 * (16 * 12 - 20) + 2400 * 4}
    assert weights[5] * G == pytest.approx(ground + 2400 * 4 * G)
    for stage, mass in weights.items():
        row = at_end_of(excavation, stage)
        assert row["floor_ry"] == pytest.approx(mass * G, rel=1e-8)
        assert row["weight_fy"] == pytest.approx(-mass * G, rel=1e-12)
        sideways = [row[f"{name}_rx"] for name in ("side", "middle", "floor", "prop")]
        assert sum(sideways) == pytest.approx(0, abs=1e-8 * np.abs(sideways).sum())


def test_the_bottom_rises_and_the_prop_holds_the_wall(excavation):
    history = excavation.history
    released = 1800 * G * 4
    modulus = 20e6 * (1 - 0.3) / ((1 + 0.3) * (1 - 2 * 0.3))
    # Displacements count from the end of the stage before `dig`.
    heave = np.diff([0, *(at_end_of(excavation, stage)["bottom_uy"] for stage in (3, 4))])
    # The heave of a very wide excavation is an upper bound: walls and the ground beside hold the bottom.
    assert (heave > 0).all() and heave.sum() < released * 8 / modulus
    prop, head = history["prop_rx"], history["head_ux"]
    acts = history["stage"] == 4
    assert (prop[~acts] == 0).all() and (np.diff(prop[acts]) < 0).all() and prop[acts][0] < 0
    # Without the prop, the head moves inwards.
    assert (np.diff(head[history["stage"] == 5]) > 0).all() and head[-1] > head[acts][-1]
    # It is released in proportion to time.
    sideways = sum(history[f"{name}_rx"] for name in ("side", "middle", "floor"))
    shares = sideways[history["stage"] == 5] / -prop[acts][-1]
    assert shares == pytest.approx([0.75, 0.5, 0.25, 0], abs=1e-5)


def test_numbers_of_the_page_of_stages(excavation):
    text = (ROOT / "docs/how-to/stages.md").read_text()
    rows = re.findall(r"^\| `([^`]+)` \| ([\d.]+) \| (\S+) \| ([\d.−]+) \| ([\d.−]+) \|$", text, re.M)
    assert [row[0] for row in rows] == ["wall", "dig", "prop and dig", "release"]
    # The row of the stage `wall` still has its own displacements; those after it count from its end.
    for stage, (_, floor, prop, rise, head) in enumerate(rows, 2):
        row = at_end_of(excavation, stage)
        assert f"{row['floor_ry'] / 1e3:.1f}" == floor
        assert prop == "–" or f"{row['prop_rx'] / 1e3:.1f}".replace("-", "−").replace("0.0", "0") == prop
        if stage > 2:
            assert f"{row['bottom_uy'] * 1e3:.1f}" == rise
            assert f"{row['head_ux'] * 1e3:.1f}".replace("-", "−") == head


def test_the_rock_reacts_at_right_angles(footing):
    history = footing.history
    assert history["rock_rx"] == pytest.approx(0.1 * history["rock_ry"], rel=1e-9)
    for stage in (1, 2, 3, 4):
        row = at_end_of(footing, stage)
        assert row["rock_ry"] == pytest.approx(-loads_along_y(row), rel=1e-9)
        sideways = [row[f"{name}_rx"] for name in ("left", "right", "rock")]
        assert sum(sideways) == pytest.approx(0, abs=1e-9 * np.abs(sideways).sum())
        assert row["fill_fy"] == pytest.approx(-20e3 * 12, rel=1e-9)
        # The fill on the pit leaves with it.
        assert row["fill_on_pit_fy"] == pytest.approx(-20e3 * 8 if stage == 1 else 0, rel=1e-9)


def test_ground_above_the_rock_is_at_rest(footing):
    points = footing.mesh("points", 1)
    original = points.points - points["displacement"]
    expected = 1800 * G * (10 - original[:, 1]) + 20e3
    error = -points["cauchy_stress"][:, 1] / expected - 1
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_the_footing_fails_towards_the_pit(footing):
    push = footing.history["stage"] == 4
    history = {name: values[push] for name, values in footing.history.items()}
    assert (np.diff(-history["push_fy"]) > 0).all()
    stiffness = np.diff(-history["push_fy"]) / -np.diff(history["footing_uy"])
    assert stiffness[-1] < 0.15 * stiffness[0]
    assert history["footing_ux"][-1] > 0.025 and history["edge_ux"][-1] > 0.05
    assert at_end_of(footing, 2)["bottom_uy"] > 0


def test_settlement_and_bearing_pressure_on_level_ground(level):
    """The mean settlement of an elastic half-space under a strip load, strained over the depth of the clay; Prandtl."""
    pressure, young, poisson, depth = 2400 * G, 15e6, 0.4, 9.0
    z = (np.arange(2000) + 0.5) * depth / 2000

    def settlement(x):
        a, b = np.arctan2(x + 1, z), np.arctan2(x - 1, z)
        even, odd = a - b, 0.5 * (np.sin(2 * a) - np.sin(2 * b))
        vertical, sideways = pressure / np.pi * (even + odd), pressure / np.pi * (even - odd)
        return np.sum((1 - poisson**2) / young * (vertical - poisson / (1 - poisson) * sideways)) * depth / 2000

    mean = np.mean([settlement(x) for x in (np.arange(200) + 0.5) / 200])
    assert -at_end_of(level, 3)["footing_uy"] == pytest.approx(mean, rel=0.05)
    prandtl = (2 + np.pi) * 30e3
    found = -at_end_of(level, 4)["push_fy"] / 2 + pressure
    # Coarse cells move with the footing; the page has finer ones.
    assert prandtl < found < 1.35 * prandtl
    text = (ROOT / "docs/how-to/footing.md").read_text()
    assert f"`mean-dilatation`, `h=0.5` | {found / 1e3:.0f} kPa (+{100 * (found / prandtl - 1):.0f} %)" in text
    assert f"a mean settlement of the loaded area of {mean * 1e3:.2f} mm" in " ".join(text.split())


SLIDES = """version: 1
grid: {type: structured, origin: [0, 0], size: [6, 3], spacing: 0.5}
materials: {m: {model: tresca, young: 1e6, poisson: 0.3, cohesion: 7e3, density: 2000}}
bodies:
  - {name: b, material: m, method: gimp, strain: mean-dilatation, points_per_cell: 2,
     shape: {type: box, min: [0, 0], max: [4, 1.5]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
loads: [{name: g, type: gravity, acceleration: [0, -10]}, {name: push, type: body-force, force: [0, -1e6]}]
stages:
  - {name: rest, steps: {count: 2}, factors: {g: 1}}
  - {name: free, release: [right], steps: {count: 4}}
  - {name: weaker, steps: {count: 5, control: {type: strength-reduction, from: 1, to: 3, tolerance: 0.1}}}
  - {name: hold, steps: {count: 1, smallest: 1}, factors: {push: PUSH}}
output: {every: 50}
"""


@pytest.mark.parametrize("push", [0, 1], ids=["holds", "fails"])
def test_the_end_of_a_stage_that_ends_early_is_in_the_files(mpm, tmp_path, push):
    (tmp_path / "deck.yaml").write_text(SLIDES.replace("PUSH", str(push)))
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == push, process.stderr
    results = Results(tmp_path / "out")
    times, history = [time for time, _ in results.series("points")], results.history
    ends = history["time"][history["time"] < 3 - 1e-9].max()
    assert 2 < ends < 3 and ends in times
