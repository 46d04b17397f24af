"""Steps that are cut, runs that cannot go on, and what they leave behind."""

import json
import math
import re
import signal
import subprocess
import time

import meshio
import numpy as np
import pytest
import pyvista

from conftest import ROOT
from results import Results

COLLAPSE = {"h": 0.5, "n": 3, "steps": 3}

STRIP = """version: 1
analysis: {stabilisation: {mode: auto}}
grid: {type: structured, origin: [0, -2], size: [2, 6], spacing: 0.25}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e3}}
bodies: [{name: strip, material: m, method: gimp, shape: {type: box, min: [0, 0], max: [1, 4]}, points_per_cell: 1}]
boundary_conditions:
  - {name: top, nodes: {y: 4}, fix: [y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads: [{name: pull, type: body-force, force: [0, -707.1]}]
steps: {count: 10}
"""


RESET = STRIP.replace("steps: {count: 10}", """stages:
  - {name: some, steps: {count: 2}, factors: {pull: 0.5}, then: {reset: [displacement]}}
  - {name: more, steps: {count: 5}, factors: {pull: 1}}""")

PRESSED_BY_FORCE = """version: 1
grid: {type: structured, origin: [-1, 0], size: [4, 4], spacing: 0.5}
materials: {clay: {model: hencky, young: 1e6, poisson: 0.3}}
bodies: [{name: block, material: clay, shape: {type: box, min: [0, 0], max: [2, 2]}, points_per_cell: 2}]
boundary_conditions: [{name: floor, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: push, type: body-force, force: [0, -1e3]}]
"""


def settings(**parameters):
    return [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]


def summary_of(results):
    return json.loads((results.directory / "summary.json").read_text())


def test_history_records_every_attempt(analyse):
    results = analyse("inputs/collapse.yaml", **COLLAPSE)
    table, summary = results.table("history"), summary_of(results)
    failed = table["converged"] == 0
    assert failed.sum() == summary["failed_attempts"] > 0
    assert (~failed).sum() == summary["steps"] > 3
    assert list(table["step"][~failed]) == list(range(1, summary["steps"] + 1))
    # An attempt that failed would have led further than the step that follows it.
    for index in np.flatnonzero(failed):
        assert table["time"][index] > table["time"][index + 1]
        assert table["step"][index] == table["step"][index + 1]
    for name in ("base_ry", "strain_energy", "load_factor"):
        assert np.isnan(table[name][failed]).all()
    assert all(np.isfinite(values[~failed]).all() for values in table.values())
    # Files are written for the steps of the deck, and the last one is at the end.
    assert [when for when, _ in results.series("points")] == [0, 1 / 3, 2 / 3, 1]
    assert (results.table("convergence")["iteration"] == 0).sum() == len(failed)


HASTY = """version: 1
analysis: {stabilisation: {mode: off}}
grid: {type: structured, origin: [0, 0], size: [8, 5], spacing: 0.5}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 20e3, density: 2000}}
bodies: [{name: block, material: m, shape: {type: box, min: [0, 0], max: [4, 4]}, points_per_cell: 4}]
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads: [{name: weight, type: gravity, acceleration: [0, -9.81]}]
"""

CANTILEVER = """version: 1
analysis: {stabilisation: {mode: off}}
grid: {type: structured, origin: [0, -4], size: [10, 8], spacing: 0.125}
materials: {m: {model: hencky, young: 1e6, poisson: 0.45}}
bodies:
  - {name: b, material: m, shape: {type: box, min: [0, 0], max: [8, 1]}, points_per_cell: 1}
boundary_conditions:
  - {name: r, nodes: {x: 0}, fix: [x]}
  - {name: p, nodes: {x: 0, y: 0.5}, fix: [y]}
loads: [{name: f, type: body-force, force: [0, "if(X > 7.5, 0.01, 0)"]}]
steps: {count: 1}
"""


# A leaning block sinks; a domain reaches into a new cell by a hair's breadth.
SWELLING = """version: 1
analysis: {stabilisation: {mode: off}}
grid: {type: structured, origin: [0, 0], size: [14, 7], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1e6, poisson: 0.3, density: 1000}}
bodies:
  - {name: body, material: m, method: gimp, domain_update: stretch, points_per_cell: 2,
     shape: {type: polygon, vertices: [[0, 0], [2, 0], [2.4, 4], [0, 4.3]]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads: [{name: weight, type: gravity, acceleration: [0, -40]}]
steps: {count: 5, smallest: 1}
solver: {tolerance: 1e-8}
"""

# An eighth of a ball of clay without hardening, four cells in radius, all of which flows.
BALL = """version: 1
analysis: {idealisation: solid, stabilisation: {mode: auto}}
grid: {type: structured, origin: [0, 0, 0], size: [14, 7, 6], spacing: 1}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.45, deviatoric_yield_stress: 10e3, density: 1000}}
bodies:
  - {name: body, material: m, method: gimp, domain_update: diagonal-corrected, points_per_cell: 2,
     shape: {type: intersection, of: [{type: sphere, center: [0, 0, 0], radius: 4},
             {type: box, min: [0, 0, 0], max: [5, 5, 4]}]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y, z]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {z: 0}, fix: [z]}
loads: [{name: weight, type: gravity, acceleration: [10, -10, 0]}]
steps: {count: 5, smallest: 0.004}
solver: {tolerance: 1e-8}
output: {every: 0}
"""


@pytest.fixture
def diagnosis_of(mpm, tmp_path):
    """Runs a deck that cannot go on and returns its diagnosis."""

    def run(text):
        (tmp_path / "deck.yaml").write_text(text)
        process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
        assert process.returncode == 1, process.stderr
        diagnosis = summary_of(Results(tmp_path / "out"))["diagnosis"]
        assert f"  help: {diagnosis['advice']}" in process.stderr
        return diagnosis

    return run


def test_a_load_that_smaller_steps_carry_is_no_collapse(mpm, diagnosis_of, tmp_path):
    diagnosis = diagnosis_of(HASTY + "steps: {count: 2, smallest: 1}")
    assert diagnosis["kind"] == "large-steps" and "smallest" in diagnosis["advice"]
    assert diagnosis["flowing"] > 0.5
    (tmp_path / "deck.yaml").write_text(HASTY + "steps: {count: 2}")
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0


def test_residuals_that_fall_steadily_need_more_iterations(mpm, diagnosis_of, tmp_path):
    """The advice names a number of iterations that is enough."""
    deck = HASTY.replace("von-mises", "hencky").replace(", deviatoric_yield_stress: 20e3", "")
    deck += "steps: {count: 1, smallest: 1}\nsolver: {tolerance: 1e-12, max_iterations: 3}\n"
    diagnosis = diagnosis_of(deck)
    assert diagnosis["kind"] == "creeping"
    enough = re.search(r"max_iterations: (\d+)", diagnosis["advice"])[1]
    (tmp_path / "deck.yaml").write_text(deck.replace("max_iterations: 3", f"max_iterations: {enough}"))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0


def test_an_hourglass_mode_is_named(mpm, diagnosis_of, tmp_path):
    """One point in the middle of each cell does not see nodes that move to and fro; four do."""
    diagnosis = diagnosis_of(CANTILEVER)
    assert diagnosis["kind"] == "hourglass" and "more points per cell" in diagnosis["advice"]
    (tmp_path / "deck.yaml").write_text(CANTILEVER.replace("points_per_cell: 1", "points_per_cell: 4"))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0


def test_a_cut_cell_whose_nodes_run_away_is_named_whatever_the_size_of_the_step(mpm, diagnosis_of, tmp_path):
    diagnosis = diagnosis_of(SWELLING)
    assert diagnosis["kind"] == "small-cut-cell" and diagnosis["filling"] < 1e-3
    assert "mode: auto" in diagnosis["advice"]
    (tmp_path / "deck.yaml").write_text(SWELLING.replace("mode: off", "mode: auto"))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0


def test_locking_is_named_where_pressures_alternate_in_isochoric_flow(diagnosis_of):
    diagnosis = diagnosis_of(BALL)
    assert diagnosis["kind"] == "locking" and diagnosis["flowing"] == 1
    assert "`strain: mean-dilatation`" in diagnosis["advice"]


PRESSED = """version: 1
title: A tool pressed deep into clay
grid: {type: structured, origin: [0, 0], size: [4, 3.5], spacing: 0.5}
materials: {clay: {model: tresca, young: 3e6, poisson: 0.49, cohesion: 1e4, density: 1800}}
bodies:
  - {name: g, material: clay, method: cpdi2, strain: mean-dilatation, shape: {type: box, min: [0, 0], max: [4, 2]}, points_per_cell: 2}
boundary_conditions:
  - {name: l, nodes: {x: 0}, fix: [x]}
  - {name: r, nodes: {x: 4}, fix: [x]}
  - {name: b, nodes: {y: 0}, fix: [x, y]}
tools:
  - {name: f, shape: {type: box, min: [-1, 2], max: [0.5, 3]}, uy: -2.4, friction: rough}
steps: {count: 10, smallest: 0.05, viscosity: 0}
solver: {predictor: last-step}
output: {every: 0}
"""


#: The weight of the ground, with the stress that carries it.
WEIGHT = [
    ("points_per_cell: 2}", "points_per_cell: 2, initial_stress: {type: geostatic, surface: 2, k0: 0.5}}"),
    ("tools:\n", "loads: [{name: weight, type: gravity, acceleration: [0, -0.01]}]\ntools:\n"),
]


@pytest.mark.parametrize("changes", [[], WEIGHT], ids=["weightless", "weight"])
def test_a_tool_drives_the_bodies(mpm, tmp_path, changes):
    """No load changes, so neither the cause nor the advice speaks of a load."""
    deck, text = tmp_path / "pressed.yaml", PRESSED
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    deck.write_text(text)
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    assert "diagnosis: plastic collapse: the bodies flow under the prescribed motion" in process.stderr, process.stderr
    assert "changes with the prescribed motion" in process.stderr and "prescribe displacements" not in process.stderr


TILTED = """version: 1
title: A block on a rough plane that is tilted until it slides
grid: {type: structured, origin: [0, 0], size: [6, 3], spacing: 0.25}
materials: {soft: {model: hencky, young: 1e6, poisson: 0.2, density: 2000}}
bodies:
  - {name: block, material: soft, method: cpdi2, points_per_cell: 3, shape: {type: box, min: [1, 1], max: [3, 2]}}
loads:
  - name: weight
    type: body-force
    per: mass
    force: ["9.81*min(1, 10*factor)*sin(pi/6*max(0, factor - 0.1)/0.9)", "-9.81*min(1, 10*factor)*cos(pi/6*max(0, factor - 0.1)/0.9)"]
tools:
  - {name: plane, shape: {type: half-space, point: [0, 1], normal: [0, 1]}, friction: 0.5}
steps: {count: 40}
output: {every: 0}
"""


def test_a_block_that_slides_is_said_to_slide(mpm, tmp_path):
    deck, out = tmp_path / "tilted.yaml", tmp_path / "out"
    deck.write_text(TILTED)
    process = mpm("run", deck, "--out", out)
    assert process.returncode == 1 and "diagnosis: sliding: only contact holds the bodies" in process.stderr, process.stderr
    diagnosis = json.loads((out / "summary.json").read_text())["diagnosis"]
    assert diagnosis["kind"] == "sliding" and "friction" in diagnosis["advice"]
    angle = 30 * (diagnosis["largest_load_factor"] - 0.1) / 0.9
    assert abs(angle - math.degrees(math.atan(0.5))) < 0.05, "the plane is as steep as the block can bear"


def test_a_run_that_cannot_go_on_says_why(mpm, tmp_path):
    deck, out = tmp_path / "strip.yaml", tmp_path / "out"
    deck.write_text(STRIP)
    process = mpm("run", deck, "--out", out)
    assert process.returncode == 1
    results = Results(out)
    history, diagnosis = results.history, summary_of(results)["diagnosis"]
    assert summary_of(results)["outcome"] == "failed" and diagnosis["kind"] == "plastic-collapse"
    assert diagnosis["largest_load_factor"] == history["load_factor"].max()
    assert diagnosis["time"] == history["time"][-1]
    assert 1 < 2 * diagnosis["largest_load_factor"] < 4 / 3.5
    assert "diagnosis: plastic collapse" in process.stderr and "largest load factor" in process.stderr

    # The last state in equilibrium is in the series; where the iterations ended is in none.
    named = {path.name for name in ("points", "domains", "grid") for _, path in results.series(name)}
    assert not any(name.startswith("failed") for name in named)
    last = int(history["step"][-1])
    assert f"points_{last:04}.vtu" in named
    points, grid = pyvista.read(out / "failed_points.vtu"), pyvista.read(out / "failed_grid.vtu")
    assert (points["in_equilibrium"] == 0).all() and (grid["in_equilibrium"] == 0).all()
    before = pyvista.read(out / f"points_{last:04}.vtu")
    np.testing.assert_allclose(points.points, before.points + points["displacement_increment"], atol=1e-12)
    force = np.linalg.norm(grid["out_of_balance_force"], axis=1)
    assert np.allclose(grid.points[force.argmax()][:2], diagnosis["node"])
    assert len(meshio.read(out / "failed_points.vtu").points) == points.n_points

    # Displacements count from the last reset.
    deck.write_text(RESET)
    assert mpm("run", deck, "--out", tmp_path / "reset").returncode == 1
    points = pyvista.read(tmp_path / "reset" / "failed_points.vtu")
    steps = int(Results(tmp_path / "reset").history["step"][-1])
    before = pyvista.read(tmp_path / "reset" / f"points_{steps:04}.vtu")
    moved = before["displacement"] + points["displacement_increment"]
    np.testing.assert_allclose(points["displacement"], moved, atol=1e-12)
    assert abs(points["displacement"] - points.points + pyvista.read(out / "points_0000.vtu").points).max() > 1e-6

    # A later run into the same directory leaves nothing of it.
    deck.write_text(STRIP.replace("-707.1", "-100"))
    assert mpm("run", deck, "--out", out).returncode == 0
    assert not (out / "failed_points.vtu").exists() and not (out / "failed_grid.vtu").exists()


def test_the_interval_of_a_stage_acts_only_if_files_are_written(mpm, tmp_path):
    """Without files, steps grow across the times at which they would be written, as without the interval."""
    deck = tmp_path / "pressed.yaml"
    steps = {}
    for every in (0, 16):
        for interval in ("", "every: 1, "):
            stage = f"stages: [{{name: press, {interval}factors: {{push: 1}}, steps: {{count: 16, largest: 8}}}}]"
            deck.write_text(PRESSED_BY_FORCE + f"{stage}\noutput: {{every: {every}}}\n")
            out = tmp_path / f"{every}{bool(interval)}"
            process = mpm("run", deck, "--out", out)
            assert process.returncode == 0, process.stderr
            steps[every, bool(interval)] = len(Results(out).history["step"])
            assert bool(list(out.glob("*.vtu"))) == (every > 0)
    assert steps[0, True] == steps[0, False] < 16 == steps[16, True]


def test_a_path_goes_on_after_an_interruption(program, mpm, tmp_path):
    """Ctrl-C in the middle of an analysis with an unknown load factor, then `--resume`: the same tables."""
    text = (ROOT / "inputs/arch.yaml").read_text().partition("\n")[2]
    deck = tmp_path / "arch.yaml"
    deck.write_text(text.replace("output: {", "checkpoint: {every: 5}\noutput: {"))
    options = settings(steps=40, every=20)
    assert mpm("run", deck, "--out", tmp_path / "whole", *options).returncode == 0
    parts = tmp_path / "parts"
    process = subprocess.Popen(
        [program, "run", deck, "--out", parts, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while not (parts / "checkpoint_0010.mpm").exists() and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert mpm("run", deck, "--out", parts, *options, "--resume").returncode == 0
    for name in ("history.csv", "convergence.csv", "quality.csv", "points.pvd", "points_0040.vtu"):
        assert (tmp_path / "whole" / name).read_bytes() == (parts / name).read_bytes(), name


@pytest.mark.parametrize("smallest, code", [(1, 1), (0.25, 0)])
def test_the_smallest_step_is_respected(mpm, tmp_path, smallest, code):
    options = settings(**COLLAPSE, smallest=smallest)
    assert mpm("run", "inputs/collapse.yaml", "--out", tmp_path, *options).returncode == code
    times = np.concatenate([[0], Results(tmp_path).history["time"]])
    assert np.diff(times).min() >= smallest / 3 - 1e-12
