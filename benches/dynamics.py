"""Closed forms of motion with inertia, with errors at h and h/2, and at the step and half of it.

    python benches/dynamics.py PROGRAM [case ...] [dynamic="pic: 0.05"]

`dynamic` adds settings of the motion to cases with impact, whose grid and step are refined together. The command prints a row per case, grid and step: the value found, the reference, the error, and the defect of the energies relative
to all work. The page docs/verification/dynamics.md shows these numbers.
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = "mpm"
#: Further settings of `dynamic` in cases with impact.
EXTRA = ""


def run(name, deck, files=None):
    """Runs a deck; returns its summary and the columns of its history, converged steps only."""
    folder = Path(tempfile.mkdtemp(prefix=f"dynamics-{name}-"))
    (folder / "deck.yaml").write_text(deck)
    for file, text in (files or {}).items():
        (folder / file).write_text(text)
    done = subprocess.run(
        [PROGRAM, "run", str(folder / "deck.yaml"), "--out", str(folder / "out")], capture_output=True, text=True
    )
    if not (folder / "out" / "summary.json").exists():
        sys.exit(f"{name}: {done.stdout[-2000:]}\n{done.stderr[-3000:]}")
    summary = json.loads((folder / "out" / "summary.json").read_text())
    if summary["outcome"] != "completed":
        print(f"  {name}: {summary['outcome']} {summary['reason']}")
    with open(folder / "out" / "history.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
    columns = {key: [float(row[key]) for row in rows] for key in rows[0] if rows[0][key] not in ("", None)}
    return summary, columns


def defect(columns):
    """Largest defect of the energies over the run, relative to the largest sum of stored energies and supplied work."""
    size = max(
        abs(k) + abs(e) + abs(s)
        for k, e, s in zip(columns["kinetic_energy"], columns["elastic_energy"], columns["supplied_energy"])
    )
    return max(abs(d) for d in columns["defect_energy"]) / size


def peak(times, values):
    """Time and value of the first maximum of |values|, by a parabola through three samples."""
    sizes = [abs(value) for value in values]
    for k in range(1, len(sizes) - 1):
        if sizes[k] >= sizes[k - 1] and sizes[k] > sizes[k + 1]:
            a, b, c = sizes[k - 1], sizes[k], sizes[k + 1]
            curvature = a - 2 * b + c
            shift = 0.5 * (a - c) / curvature if curvature else 0.0
            step = times[k + 1] - times[k]
            return times[k] + shift * step, b - 0.25 * (a - c) * shift
    return times[-1], sizes[-1]


def crossings(times, values):
    """The times at which values change their sign, by linear interpolation."""
    found = []
    for k in range(1, len(values)):
        if values[k - 1] * values[k] < 0:
            share = values[k - 1] / (values[k - 1] - values[k])
            found.append(times[k - 1] + share * (times[k] - times[k - 1]))
    return found


def sudden_gravity(h, dt):
    """A column under a small weight that acts at once: rho 2000, H 10, M 1e7."""
    deck = f"""
version: 1
grid: {{type: structured, origin: [0, 0], size: [{h}, 12], spacing: {h}}}
materials: {{soil: {{model: hencky, young: 1e7, poisson: 0, density: 2000}}}}
bodies:
  - {{name: column, material: soil, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [{h}, 10]}}}}
boundary_conditions:
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: {h}}}, fix: [x]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -0.0981], curve: [[0, 1], [100, 1]]}}]
dynamic: {{error: 1e3}}
steps: {{size: {dt}, end_time: 1.2}}
solver: {{tolerance: 1e-11}}
output: {{every: 0, probes: [{{name: top, body: column, nearest: [0, 10]}}]}}
"""
    _, columns = run("gravity", deck)
    times, values = columns["time"], columns["top_uy"]
    time, largest = peak(times, values)
    # The first minimum of the displacement after the peak ends the period.
    return {"peak": (largest, 0.00196200), "half period": (time, 0.565685 / 2)}, defect(columns)


def cantilever(h, dt):
    """First frequency of a strip, Timoshenko with kappa 5/6: L 10, h 1, E 1.2e7, nu 0.2, rho 1000 (plane strain)."""
    deck = f"""
version: 1
grid: {{type: structured, origin: [0, -2], size: [12, 4], spacing: {h}}}
materials: {{steel: {{model: hencky, young: 1.2e7, poisson: 0.2, density: 1000}}}}
bodies:
  - {{name: strip, material: steel, method: gimp, points_per_cell: 3, shape: {{type: box, min: [0, -0.5], max: [10, 0.5]}},
      velocity: [0, "0.02*(x/10)^2"]}}
boundary_conditions: [{{name: root, nodes: {{x: 0}}, fix: [x, y]}}]
dynamic: {{error: 1e3}}
steps: {{size: {dt}, end_time: 12}}
solver: {{tolerance: 1e-11}}
output: {{every: 0, probes: [{{name: tip, body: strip, nearest: [10, 0]}}]}}
"""
    _, columns = run("cantilever", deck)
    zeros = crossings(columns["time"][1:], columns["tip_uy"][1:])
    period = 2 * (zeros[-1] - zeros[0]) / (len(zeros) - 1)
    # The reference is of plane stress; in plane strain the stiffness is E/(1 - nu^2).
    reference = 1.12612 / math.sqrt(1 - 0.2**2)
    return {"omega": (2 * math.pi / period, reference)}, defect(columns)


def pendulum(h, dt):
    """A block 0.2 x 1 on a pin 0.4 off its centre, released at 60 degrees from rest."""
    angle = math.radians(60)
    # The pin is the node at the origin; the block hangs below it, turned by the angle.
    deck = f"""
version: 1
grid: {{type: structured, origin: [-1.2, -1.2], size: [2.4, 2.4], spacing: {h}}}
materials: {{steel: {{model: hencky, young: 1e7, poisson: 0.2, density: 1000}}}}
bodies:
  - name: block
    material: steel
    method: cpdi1
    point_spacing: {h / 2}
    shape: {{type: rotate, angle: 60, center: [0, 0], shape: {{type: box, min: [-0.1, -0.9], max: [0.1, 0.1]}}}}
boundary_conditions: [{{name: pin, nodes: {{box: {{min: [-1e-6, -1e-6], max: [1e-6, 1e-6]}}}}, fix: [x, y]}}]
loads: [{{name: weight, type: gravity, acceleration: [0, -9.81], curve: [[0, 1], [100, 1]]}}]
dynamic: {{error: 1e3}}
steps: {{size: {dt}, end_time: 1.8}}
output: {{every: 0}}
"""
    _, columns = run("pendulum", deck)
    zeros = crossings(columns["time"], columns["centre_x"])
    period = 2 * (zeros[1] - zeros[0])
    del angle
    return {"period": (period, 1.690612)}, defect(columns)


def spinning_disc(h, dt):
    """A disc that starts to spin unstretched: plane strain, Hencky, omega 10, R 1, E 1e6, nu 0.3, rho 1000."""
    deck = f"""
version: 1
grid: {{type: structured, origin: [-1.4, -1.4], size: [2.8, 2.8], spacing: {h}}}
materials: {{rubber: {{model: hencky, young: 1e6, poisson: 0.3, density: 1000}}}}
bodies:
  - {{name: disc, material: rubber, method: cpdi1, points_per_cell: 2, shape: {{type: circle, center: [0, 0], radius: 1}},
      velocity: ["-10*y", "10*x"]}}
dynamic: {{error: 1e3}}
steps: {{size: {dt}, end_time: 0.3}}
solver: {{tolerance: 1e-11}}
output: {{every: 0, probes: [{{name: rim, body: disc, nearest: [1, 0]}}]}}
"""
    _, columns = run("disc", deck)
    # The probe lies within half a spacing of the rim.
    x0 = 1 - h / 4
    radii = [math.hypot(x0 + u, v) for u, v in zip(columns["rim_ux"], columns["rim_uy"])]
    time, largest = peak(columns["time"], radii)
    turned = math.atan2(columns["rim_uy"][-1], x0 + columns["rim_ux"][-1]) % (2 * math.pi)
    return {
        "largest stretch": (largest / x0, 1.02520),
        "its time": (time, 0.0410),
        "angle": (turned, 2.9036),
    }, defect(columns)


def layer(h, dt):
    """A layer on rock under a sine of its first frequency: surface over outcrop, H 10, c 100, impedance 0.25."""
    motion = "\n".join(
        f"{k / 1000},{0.001 * min(1, k / 1600) * math.sin(5 * math.pi * k / 1000):.12g}" for k in range(0, 6001, 2)
    )
    deck = f"""
version: 1
grid: {{type: structured, origin: [0, 0], size: [{2 * h}, 13], spacing: {h}}}
materials:
  soil: {{model: hencky, young: 4e7, poisson: 0, density: 2000}}
  rock: {{model: hencky, young: 6.4e8, poisson: 0, density: 2000}}
bodies:
  - {{name: rock, material: rock, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [{2 * h}, 2]}}}}
  - {{name: soil, material: soil, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 2], max: [{2 * h}, 12]}}}}
boundary_conditions:
  - {{name: base, nodes: {{y: 0}}, fix: [x, y]}}
  - {{name: level, nodes: {{box: {{min: [0, 0], max: [{2 * h}, 13]}}}}, fix: [y]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -9.81]}}]
stages:
  - {{name: weight, steps: {{count: 1}}, factors: {{weight: 1}}, then: {{reset: [displacement]}}}}
  - name: shaking
    set: [level]
    absorb: [{{condition: base, motion: {{axis: x, file: motion.csv, quantity: velocity}}}}]
    dynamic: {{error: 1e3}}
    steps: {{size: {dt}, end_time: 5.6}}
output: {{every: 0, probes: [{{name: top, body: soil, nearest: [0, 12]}}]}}
"""
    _, columns = run("layer", deck, {"motion.csv": motion})
    last = [u for t, u in zip(columns["time"], columns["top_ux"]) if t > columns["time"][-1] - 0.8]
    amplitude = 0.5 * (max(last) - min(last))
    return {"surface/outcrop": (amplitude / (0.001 / (5 * math.pi)), 4.0)}, defect(columns)


def bar_on_wall(h, dt):
    """A bar of 1 m hits a smooth wall: rho 1000, M 1e6, v 0.1; it leaves after 2 L/c with its velocity reversed."""
    deck = f"""
version: 1
grid: {{type: structured, origin: [-0.5, 0], size: [2.5, {h}], spacing: {h}}}
materials: {{rubber: {{model: hencky, young: 1e6, poisson: 0, density: 1000}}}}
bodies:
  - {{name: bar, material: rubber, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0.25, 0], max: [1.25, {h}]}},
      velocity: [-0.1, 0]}}
boundary_conditions: [{{name: guides, nodes: {{box: {{min: [-1, 0], max: [3, {h}]}}}}, fix: [y]}}]
tools: [{{name: wall, shape: {{type: half-space, point: [0.25, 0], normal: [1, 0]}}}}]
dynamic: {{error: 1e3{EXTRA}}}
steps: {{size: {dt}, end_time: 0.12}}
solver: {{tolerance: 1e-11}}
output: {{every: 0}}
"""
    _, columns = run("bar", deck)
    forces = [abs(f) / h for f in columns["wall_fx"]]
    touching = [t for t, f in zip(columns["time"], forces) if f > 1]
    middle = [f for t, f in zip(columns["time"], forces) if 0.01 < t < 0.055]
    spread = math.sqrt(sum((force / 3162.28 - 1) ** 2 for force in middle) / len(middle))
    speed = columns["momentum_x"][-1] / 100 / h
    return {
        "contact time": (touching[-1] - touching[0] + dt if touching else 0.0, 0.0632456),
        "mean force": (sum(middle) / len(middle), 3162.28),
        "1 + its scatter": (1 + spread, 1.0),
        "rebound": (speed, 1.0),
    }, defect(columns)


def two_bars(h, dt):
    """A bar of 1 m hits one of 2 m at rest: the force ends after 2 L/c, the bars part after 4 L/c, and the momentum passes."""
    deck = f"""
version: 1
grid: {{type: structured, origin: [-1, 0], size: [5, {h}], spacing: {h}}}
materials: {{rubber: {{model: hencky, young: 1e6, poisson: 0, density: 1000}}}}
bodies:
  - {{name: a, material: rubber, method: gimp, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [1, {h}]}}, velocity: [0.1, 0]}}
  - {{name: b, material: rubber, method: gimp, points_per_cell: 2, shape: {{type: box, min: [1, 0], max: [3, {h}]}}}}
contacts: [{{between: [a, b]}}]
boundary_conditions: [{{name: guides, nodes: {{box: {{min: [-1, 0], max: [5, {h}]}}}}, fix: [y]}}]
dynamic: {{error: 1e3{EXTRA}}}
steps: {{size: {dt}, end_time: 0.18}}
solver: {{tolerance: 1e-11}}
output: {{every: 0}}
"""
    _, columns = run("bars", deck)
    forces = [abs(force) / h for force in columns["a_on_b_fx"]]
    first = [force for time, force in zip(columns["time"], forces) if time < 0.0625]
    spread = math.sqrt(sum((force / 1581.14 - 1) ** 2 for force in first) / len(first))
    return {
        "mean force": (sum(first) / len(first), 1581.14),
        "1 + its scatter": (1 + spread, 1.0),
        "impulse": (sum(force * dt for force in forces), 100.0),
        "time of parting": (max(time for time, force in zip(columns["time"], forces) if force > 1), 0.126491),
    }, defect(columns)


def rolling(h, dt, friction=0.3, reference=1.635):
    """A stiff cylinder on a plane of 30 degrees, released from rest; the way of its centre in 1 s."""
    g = 9.81
    deck = f"""
version: 1
grid: {{type: structured, origin: [0, {-2 * h}], size: [3.2, {1 + 2 * h}], spacing: {h}}}
materials: {{steel: {{model: hencky, young: 1e8, poisson: 0.3, density: 1000}}}}
bodies:
  - {{name: cylinder, material: steel, method: cpdi2, points_per_cell: 2, shape: {{type: circle, center: [0.5, 0.3], radius: 0.3}}}}
tools: [{{name: plane, shape: {{type: half-space, point: [0, {-0.02 * h}], normal: [0, 1]}}, friction: {friction}}}]
loads:
  - {{name: weight, type: gravity, acceleration: [{0.5 * g}, {-math.sqrt(0.75) * g}], curve: [[0, 1], [100, 1]]}}
dynamic: {{error: 1e3, pic: 0.01}}
steps: {{size: {dt}, end_time: 1}}
output: {{every: 0}}
"""
    _, columns = run("rolling", deck)
    return {"way": (columns["centre_x"][-1] - 0.5, reference)}, defect(columns)


def sliding(h, dt):
    """As `rolling`, with so little friction that the cylinder slides."""
    return rolling(h, dt, 0.1, 2.02771)


def hertz(h, dt):
    """A sphere hits a smooth rigid wall, which is half of the impact of two: R 0.2, E 1e6, nu 0.3, rho 1000, 0.1 m/s."""
    deck = f"""
version: 1
analysis: {{idealisation: axisymmetric}}
grid: {{type: structured, origin: [0, {-2 * h}], size: [0.5, {0.5 + 2 * h}], spacing: {h}}}
materials: {{rubber: {{model: hencky, young: 1e6, poisson: 0.3, density: 1000}}}}
bodies:
  - {{name: sphere, material: rubber, method: cpdi1, points_per_cell: 2, velocity: [0, -0.1],
      shape: {{type: intersection, of: [{{type: circle, center: [0, 0.2], radius: 0.2}}, {{type: box, min: [0, 0], max: [0.4, 0.4]}}]}}}}
tools: [{{name: wall, shape: {{type: half-space, point: [0, {-0.02 * h}], normal: [0, 1]}}}}]
boundary_conditions: [{{name: axis, nodes: {{x: 0}}, fix: [x]}}]
dynamic: {{error: 1e3{EXTRA}}}
steps: {{size: {dt}, end_time: 0.12}}
output: {{every: 0, probes: [{{name: centre, body: sphere, nearest: [0, 0.2]}}]}}
"""
    _, columns = run("hertz", deck)
    forces = [abs(force) for force in columns["wall_fy"]]
    touching = [time for time, force in zip(columns["time"], forces) if force > 0.01 * max(forces)]
    _, approach = peak(columns["time"], columns["centre_uy"])
    # The force of a step is its mean: smoothed over five steps.
    smooth = [sum(forces[k - 2 : k + 3]) / 5 for k in range(2, len(forces) - 2)]
    return {
        "contact time": (touching[-1] - touching[0] + dt, 0.097972),
        "approach": (approach, 0.5 * 6.6573e-3),
        "largest force": (max(smooth), 125.84),
        "rebound": (columns["momentum_y"][-1] / -columns["momentum_y"][0], 1.0),
    }, defect(columns)


def knowles(h, dt):
    """A hollow cylinder, incompressible, neo-Hookean: A 1, B 2, G 1e5, rho 1000, inner velocity 3 at the start."""
    nu = 0.4999
    young = 2 * (1 + nu) * 1e5
    deck = f"""
version: 1
analysis: {{idealisation: axisymmetric}}
grid: {{type: structured, origin: [0, 0], size: [{2.5}, {h}], spacing: {h}}}
materials: {{rubber: {{model: neo-hookean, young: {young}, poisson: {nu}, density: 1000}}}}
bodies:
  - {{name: ring, material: rubber, method: gimp, strain: mean-dilatation, points_per_cell: 2,
      shape: {{type: box, min: [1, 0], max: [2, {h}]}}, velocity: ["3/x", 0]}}
boundary_conditions: [{{name: plane, nodes: {{box: {{min: [0, 0], max: [3, {h}]}}}}, fix: [y]}}]
dynamic: {{error: 1e3}}
steps: {{size: {dt}, end_time: 0.48}}
output: {{every: 0, probes: [{{name: inner, body: ring, nearest: [1, 0]}}]}}
"""
    _, columns = run("knowles", deck)
    r0 = 1 + h / 4
    # a^2 - A^2 is the same at all radii.
    inner = [math.sqrt((r0 + u) ** 2 - r0**2 + 1) for u in columns["inner_ux"]]
    _, largest = peak(columns["time"], inner)
    # Outwards through the original radius again.
    period = crossings([0.0, *columns["time"]], [1e-12, *columns["inner_ux"]])[-1]
    return {"largest radius": (largest, 1.208956), "period": (period, 0.425521)}, defect(columns)


CASES = {
    "gravity": (sudden_gravity, [1.0, 0.5], 0.02),
    "cantilever": (cantilever, [0.25, 0.125], 0.1),
    "pendulum": (pendulum, [0.1, 0.05], 0.02),
    "disc": (spinning_disc, [0.2, 0.1], 0.004),
    "layer": (layer, [1.0, 0.5], 0.02),
    "bar": (bar_on_wall, [0.125, 0.0625], 0.002),
    "bars": (two_bars, [0.125, 0.0625], 0.002),
    "rolling": (rolling, [0.1, 0.05], 0.02),
    "sliding": (sliding, [0.1, 0.05], 0.02),
    "hertz": (hertz, [0.025, 0.0125], 0.002),
    "knowles": (knowles, [0.125, 0.0625], 0.008),
}

#: Cases in which bodies hit each other at once, so that stresses jump.
IMPACTS = {"bar", "bars"}


def main():
    global PROGRAM, EXTRA
    PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "mpm"
    for word in sys.argv[2:]:
        if word.startswith("dynamic="):
            EXTRA = f", {word[8:]}"
    chosen = [word for word in sys.argv[2:] if not word.startswith("dynamic=")] or list(CASES)
    for name in chosen:
        case, grids, step = CASES[name]
        courses = [(grids[0], step), (grids[1], step), (grids[1], step / 2), (grids[1], step / 4)]
        if name in IMPACTS:
            # Waves of impact are sharp: they need grid and step together.
            courses = [(grids[0] / 2**k, step / 2**k) for k in range(3)]
        for h, dt in courses:
            found, lost = case(h, dt)
            for what, (value, reference) in found.items():
                error = value / reference - 1
                print(f"{name:11} h {h:<7g} dt {dt:<7g} {what:16} {value:.6g} ({reference:.6g}) {100 * error:+.3f} %  defect {lost:.1e}")


if __name__ == "__main__":
    main()
