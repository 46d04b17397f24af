"""Motion with inertia, against closed forms: waves that leave, ground that is shaken, motions that end in equilibrium."""

import csv
import json
import math
import signal
import subprocess
import time

import numpy as np
import pytest

BAR = """
version: 1
grid: {{type: structured, origin: [0, 0], size: [11, 0.25], spacing: 0.25}}
materials: {{bar: {{model: hencky, young: 1e6, poisson: 0, density: 1000}}}}
bodies:
  - {{name: bar, material: bar, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [10, 0.25]}}}}
boundary_conditions:
  - {{name: far, nodes: {{x: 0}}, fix: [x]}}
  - {{name: level, nodes: {{box: {{min: [0, 0], max: [11, 0.25]}}}}, fix: [y]}}
surfaces: [{{name: end, body: bar, part: {{box: {{min: [9.9999, 0], max: [10.1, 0.25]}}}}}}]
loads:
  - {{name: hold, type: traction, surface: end, traction: [{hold}, 0]}}
  - {{name: pulse, type: traction, surface: end, traction: [100, 0], curve: {curve}}}
stages:
  - {{name: hold, steps: {{count: 1}}, factors: {{hold: 1}}}}
  - name: wave
    absorb: [{{condition: far}}]
    dynamic: {{error: 1e3}}
    steps: {{size: 0.005, end_time: 0.6}}
solver: {{tolerance: 1e-11}}
output: {{every: 0, probes: [{{name: end, body: bar, nearest: [10, 0]}}, {{name: far, body: bar, nearest: [0, 0]}}]}}
"""

LAYER = """
version: 1
grid: {{type: structured, origin: [0, 0], size: [2, 13], spacing: 1}}
materials:
  soil: {{model: hencky, young: 4e7, poisson: 0, density: 2000}}
  rock: {{model: hencky, young: 6.4e8, poisson: 0, density: 2000}}
bodies:
  - {{name: rock, material: rock, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [2, 2]}}}}
  - {{name: soil, material: soil, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 2], max: [2, 12]}}}}
boundary_conditions:
  - {{name: base, nodes: {{y: 0}}, fix: [x, y]}}
  - {{name: level, nodes: {{box: {{min: [0, 0], max: [2, 13]}}}}, fix: [y]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -9.81]}}]
stages:
  - {{name: weight, steps: {{count: 1}}, factors: {{weight: 1}}, then: {{reset: [displacement]}}}}
  - name: shaking
    set: [level]
    absorb: [{{condition: base, motion: {{axis: x, file: motion.csv, quantity: velocity}}}}]
    dynamic: {{error: 1e3}}
    steps: {{size: 0.01, end_time: 6}}
output: {{every: 0, probes: [{{name: top, body: soil, nearest: [0, 12]}}]}}
"""

RIGID = """
version: 1
grid: {type: structured, origin: [0, 0], size: [1, 12], spacing: 0.5}
materials: {soil: {model: hencky, young: 4e7, poisson: 0, density: 2000}}
bodies:
  - {name: soil, material: soil, method: gimp, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [1, 10]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: level, nodes: {box: {min: [0, 0], max: [1, 12]}}, fix: [y]}
loads: [{name: shake, type: base-motion, motion: {axis: x, file: motion.csv}}]
dynamic: {error: 1e3}
steps: {size: 0.005, end_time: 0.8}
solver: {tolerance: 1e-11}
output: {every: 0, probes: [{name: top, body: soil, nearest: [0, 10]}]}
"""

# A block that hangs from its top: statics, and a load that grows over 40 periods of a damped motion.
HANGING = """
version: 1
grid: {type: structured, origin: [0, 0], size: [2, 3], spacing: 0.25}
materials: {rubber: {model: neo-hookean, young: 1e5, poisson: 0.3, density: 1000}}
bodies:
  - {name: block, material: rubber, method: cpdi1, points_per_cell: 2, shape: {type: box, min: [0.5, 1], max: [1.5, 2.5]}}
boundary_conditions: [{name: top, nodes: {y: 2.5}, fix: [x, y]}]
loads: [{name: weight, type: gravity, acceleration: [0, -0.5]MORE}]
STEPS
solver: {tolerance: 1e-11}
output: {every: 0, probes: [{name: low, body: block, nearest: [0.5, 1]}]}
"""


def run(mpm, folder, deck, files=(), options=()):
    """Runs a deck to its end; its summary, and the columns of its history at converged steps."""
    folder.mkdir(exist_ok=True)
    (folder / "deck.yaml").write_text(deck)
    for name, text in files:
        (folder / name).write_text(text)
    done = mpm("run", folder / "deck.yaml", "--out", folder / "out", *options)
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((folder / "out" / "summary.json").read_text())
    with open(folder / "out" / "history.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
    return summary, {key: np.array([float(row[key] or "nan") for row in rows]) for key in rows[0]}


def pulse():
    """A smooth pulse of unit height in the first 0.1 s of the motion, whose mean is one half."""
    times = np.linspace(0, 0.1, 41)
    return [[0, 0], *([1 + float(t), round(0.5 * (1 - math.cos(20 * math.pi * t)), 12)] for t in times), [9, 0]]


def test_a_wave_leaves_through_an_absorbing_boundary(mpm, tmp_path):
    _, columns = run(mpm, tmp_path, BAR.format(hold=100, curve=pulse()))
    kinetic = columns["kinetic_energy"]
    # What is reflected by the boundary or the end, as an amplitude.
    assert math.sqrt(kinetic[-1] / kinetic.max()) < 0.01
    # The bar has moved on by the impulse over the impedance, and is otherwise as it was.
    moved = columns["end_ux"][-1] - columns["end_ux"][0]
    assert moved == pytest.approx(100 * 0.05 / (1000 * math.sqrt(1000)), rel=0.01)
    assert columns["elastic_energy"][-1] == pytest.approx(columns["elastic_energy"][0], rel=1e-3)
    assert abs(columns["defect_energy"]).max() < 1e-9 * kinetic.max()


def test_absorbing_boundaries_take_over_what_they_carried(mpm, tmp_path):
    _, columns = run(mpm, tmp_path, BAR.format(hold=100, curve=[[0, 0], [9, 0]]))
    assert columns["kinetic_energy"].max() < 1e-12 * columns["elastic_energy"][0]
    np.testing.assert_allclose(columns["end_ux"], columns["end_ux"][0], rtol=1e-9)


def test_a_layer_on_a_rigid_base(mpm, tmp_path):
    """A base that begins to accelerate at once: the surface swings to ρaH²/G in the time 2H/c."""
    motion = "time,acceleration\n0,0.01\n10,0.01\n"
    _, columns = run(mpm, tmp_path, RIGID, [("motion.csv", motion)])
    k = columns["top_ux"].argmin()
    assert columns["top_ux"][k] == pytest.approx(-0.01 * 100 / 1e4, rel=0.01)
    assert columns["time"][k] == pytest.approx(0.2, abs=0.006)


@pytest.mark.parametrize(("frequency", "ratio"), [(2.5, 4.0), (2.0, 2.56475)])
def test_a_layer_on_a_base_that_absorbs(mpm, tmp_path, frequency, ratio):
    """Surface over outcrop in the steady state, for an impedance of 0.25."""
    times = np.arange(0, 6.4, 0.002)
    speeds = 1e-3 * np.minimum(1, times / 1.6) * np.sin(2 * math.pi * frequency * times)
    motion = "time,velocity\n" + "".join(f"{t:.6g},{v:.9g}\n" for t, v in zip(times, speeds, strict=True))
    _, columns = run(mpm, tmp_path, LAYER.format(), [("motion.csv", motion)])
    last = columns["top_ux"][columns["time"] > columns["time"][-1] - 1]
    amplitude = 0.5 * (last.max() - last.min()) * 2 * math.pi * frequency / 1e-3
    assert amplitude == pytest.approx(ratio, rel=0.02)


def test_a_slow_load_ends_at_the_static_answer(mpm, tmp_path):
    static = HANGING.replace("MORE", "").replace("STEPS", "steps: {count: 10}")
    _, columns = run(mpm, tmp_path / "static", static)
    motion = HANGING.replace("MORE", ", curve: [[0, 0], [20, 1], [60, 1]]")
    motion = motion.replace("STEPS", "dynamic: {error: 1e3, damping: {rayleigh: [5, 0]}}\nsteps: {size: 0.5, end_time: 30}")
    _, slow = run(mpm, tmp_path / "slow", motion)
    for axis in "xy":
        assert slow[f"low_u{axis}"][-1] == pytest.approx(columns[f"low_u{axis}"][-1], rel=1e-6), axis


@pytest.mark.parametrize("scheme", ["midpoint", "generalised-alpha", "backward-euler"])
def test_what_is_in_equilibrium_stays_at_rest(mpm, tmp_path, scheme):
    stages = f"""stages:
  - {{name: weight, steps: {{count: 5}}, factors: {{weight: 1}}}}
  - {{name: quiet, dynamic: {{scheme: {scheme}}}, steps: {{size: 0.05, end_time: 1}}}}"""
    _, columns = run(mpm, tmp_path, HANGING.replace("MORE", "").replace("STEPS", stages))
    moves = columns["time"] > 1
    # The grid of each step is new, on which the equilibrium of the step before holds to its order.
    assert columns["kinetic_energy"][moves].max() < 1e-9 * columns["elastic_energy"][-1]
    assert columns["low_uy"][-1] == pytest.approx(columns["low_uy"][4], rel=1e-4)


def test_a_resumed_motion_has_the_same_bits(mpm, program, tmp_path):
    steps = "dynamic: {}\nsteps: {size: 0.02, end_time: 1}\n"
    deck = HANGING.replace("MORE", ", curve: [[0, 1], [1, 1]]").replace("STEPS", steps)
    deck = deck.replace("spacing: 0.25", "spacing: 0.125").replace("every: 0", "every: 1")
    _, whole = run(mpm, tmp_path / "whole", deck)
    folder = tmp_path / "parts"
    folder.mkdir()
    (folder / "deck.yaml").write_text(deck)
    process = subprocess.Popen([program, "run", folder / "deck.yaml", "--out", folder / "out"], stderr=subprocess.PIPE)
    while not (folder / "out" / "points_0005.vtu").exists():
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 130
    _, parts = run(mpm, folder, deck, options=["--resume"])
    for name in ("time", "low_uy", "kinetic_energy", "elastic_energy", "defect_energy", "centre_y", "momentum_y"):
        np.testing.assert_array_equal(whole[name], parts[name], err_msg=name)
