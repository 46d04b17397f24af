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
    # The static stage has an error of its own, that of the trapezoidal rule.
    assert np.ptp(columns["defect_energy"]) < 1e-9 * kinetic.max()


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


SLOW = {
    "midpoint": "{error: 1e3, damping: {rayleigh: [15, 0]}}\nsteps: {size: 0.1, end_time: 20}",
    "backward-euler": "{error: 1e3, scheme: backward-euler}\nsteps: {size: 0.5, end_time: 20}",
}


@pytest.mark.parametrize("scheme", SLOW)
def test_a_slow_load_ends_at_the_static_answer(mpm, tmp_path, scheme):
    # Under larger loads, both answers depend on the number of grids that they have seen.
    hanging = HANGING.replace("-0.5]", "-5e-5]")
    _, columns = run(mpm, tmp_path / "static", hanging.replace("MORE", "").replace("STEPS", "steps: {count: 60}"))
    motion = hanging.replace("MORE", ", curve: [[0, 0], [10, 1], [60, 1]]")
    _, slow = run(mpm, tmp_path / "slow", motion.replace("STEPS", f"dynamic: {SLOW[scheme]}"))
    moved = abs(columns["low_uy"][-1])
    assert 4e-7 < moved < 5e-7
    for axis in "xy":
        assert slow[f"low_u{axis}"][-1] == pytest.approx(columns[f"low_u{axis}"][-1], abs=1e-6 * moved), axis


@pytest.mark.parametrize("scheme", ["midpoint", "generalised-alpha", "backward-euler"])
@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_what_is_in_equilibrium_stays_at_rest(mpm, tmp_path, scheme, method):
    stages = f"""stages:
  - {{name: weight, steps: {{count: 5}}, factors: {{weight: 1}}}}
  - {{name: quiet, dynamic: {{scheme: {scheme}}}, steps: {{size: 0.05, end_time: 2}}}}"""
    hanging = HANGING.replace("cpdi1", method).replace("MORE", "").replace("STEPS", stages)
    for load, most in ((0.5, 1e-4), (0.005, 1e-9)):
        # What is left is the force out of balance on the fresh grid of each step, which falls with the load.
        _, columns = run(mpm, tmp_path, hanging.replace("-0.5]", f"-{load}]"))
        moves = columns["time"] > 1
        assert columns["kinetic_energy"][moves].max() < most * columns["elastic_energy"][-1], load


BARS = """
version: 1
grid: {{type: structured, origin: [-1, 0], size: [5, {h}], spacing: {h}}}
materials: {{rubber: {{model: hencky, young: 1e6, poisson: 0, density: 1000}}}}
bodies:
  - {{name: a, material: rubber, method: {method}, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [1, {h}]}}, velocity: [0.1, 0]}}
  - {{name: b, material: rubber, method: {method}, points_per_cell: 2, shape: {{type: box, min: [1, 0], max: [3, {h}]}}}}
contacts: [{{between: [a, b]}}]
boundary_conditions: [{{name: guides, nodes: {{box: {{min: [-1, 0], max: [5, {h}]}}}}, fix: [y]}}]
dynamic: {{error: 1e3, scheme: {scheme}}}
steps: {{size: {dt}, end_time: 0.18}}
solver: {{tolerance: 1e-11}}
output: {{every: 0}}
"""


@pytest.mark.parametrize("scheme", ["midpoint", "generalised-alpha"])
@pytest.mark.parametrize("method", ["gimp", "cpdi1"])
def test_a_bar_hits_another(mpm, tmp_path, scheme, method):
    """A bar of 1 m hits one of 2 m at rest: all momentum passes, under the stress ½ ρ c v until 2 L/c."""
    errors = []
    for refined in (1, 2):
        deck = BARS.format(h=0.125 / refined, dt=0.002 / refined, method=method, scheme=scheme)
        _, columns = run(mpm, tmp_path, deck)
        forces = abs(columns["a_on_b_fx"]) * refined / 0.125
        scatter = forces[columns["time"] < 0.0625] / 1581.14 - 1
        assert scatter.mean() == pytest.approx(0, abs=0.02)
        errors.append([math.sqrt((scatter**2).mean()), abs(forces.sum() * 0.002 / refined / 100 - 1)])
        size = columns["kinetic_energy"][0]
        assert abs(columns["defect_energy"]).max() < 1e-9 * size
        assert np.ptp(columns["momentum_x"]) < 1e-12 * columns["momentum_x"][0]
    assert errors[1][1] < 0.02
    assert errors[1][0] < 0.85 * errors[0][0] and errors[1][1] < 0.75 * errors[0][1], errors


ROLLING = """
version: 1
grid: {type: structured, origin: [0, -0.1], size: [3.2, 1.1], spacing: 0.1}
materials: {steel: {model: hencky, young: 1e8, poisson: 0.3, density: 1000}}
bodies:
  - {name: cylinder, material: steel, method: cpdi2, points_per_cell: 2, shape: {type: circle, center: [0.5, 0.3], radius: 0.3}}
tools: [{name: plane, shape: {type: half-space, point: [0, -0.002], normal: [0, 1]}, friction: FRICTION}]
loads:
  - {name: weight, type: gravity, acceleration: [4.905, -8.495709], curve: [[0, 1], [100, 1]]}
dynamic: {error: 1e3, pic: 0.01}
steps: {size: 0.02, end_time: 1}
output: {every: 0}
"""


@pytest.mark.parametrize(("friction", "way", "within"), [(0.3, 1.635, 0.04), (0.1, 2.02771, 1e-3)])
def test_a_cylinder_rolls_or_slides_down_a_plane(mpm, tmp_path, friction, way, within):
    # On this grid it is a polygon of twelve sides, which rolls with less speed.
    _, columns = run(mpm, tmp_path, ROLLING.replace("FRICTION", str(friction)))
    assert columns["centre_x"][-1] - 0.5 == pytest.approx(way, rel=within)
    assert abs(columns["defect_energy"]).max() < 1e-8 * columns["kinetic_energy"].max()


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
