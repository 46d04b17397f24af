"""Adhesion acts on the area of the sides that face a tool: on inclined sides and on round ones."""

import numpy as np
import pytest

from results import Results


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, name="run"):
        path, out = tmp_path / f"{name}.yaml", tmp_path / name
        path.write_text(text)
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        results = Results(out)
        assert results.summary["outcome"] == "completed"
        return results

    return run


def last(results, column):
    return float(np.asarray(results.history[column])[-1])


def areas(results):
    return np.asarray(results.mesh("contacts", -1)["area"])


def vector(numbers):
    return str([float(x) for x in numbers])


# A turned block that is held at its upper side. The base presses on its lower side, which is 4 long, until time 1, and is
# then drawn along it.
INCLINED = """
version: 1
grid: {type: structured, origin: [-3, -3], size: [10, 10], spacing: 0.25}
materials: {m: {model: hencky, young: 1e6, poisson: 0}}
bodies: [{name: b, material: m, shape: {type: polygon, vertices: VERTICES}, method: cpdi2, points_per_cell: N}]
surfaces: [{name: top, body: b, part: {edge: 2}}]
boundary_conditions: [{name: held, surface: top, ux: 0, uy: 0}]
tools:
  - {name: base, shape: SHAPE, ux: "UX*max(factor-1,0)+VX*min(factor,1)",
     uy: "UY*max(factor-1,0)+VY*min(factor,1)", curve: [[0, 0], [2, 2]], adhesion: 2.5}
steps: {count: 8, end_time: 2}
"""


def inclined(angle, shape, n=2):
    turn = np.radians(angle)
    along, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    start = np.array([1.03, 0.41])
    corners = [start, start + 4 * along, start + 4 * along + up, start + up]
    text = INCLINED.replace("VERTICES", f"[{', '.join(map(vector, corners))}]")
    if shape == "half-space":
        shape = f"{{type: half-space, point: {vector(start)}, normal: {vector(up)}}}"
    else:
        corners = [start - 1.3 * along - up, start + 5.2 * along - up, start + 5.2 * along, start - 1.3 * along]
        shape = f"{{type: polygon, vertices: [{', '.join(map(vector, corners))}]}}"
    text = text.replace("SHAPE", shape).replace("N}", f"{n}}}")
    for key, way in [("VX", 2e-4 * up[0]), ("VY", 2e-4 * up[1]), ("UX", 0.1 * along[0]), ("UY", 0.1 * along[1])]:
        text = text.replace(key, repr(float(way)))
    return text, along


@pytest.mark.parametrize("shape", ["half-space", "polygon"])
@pytest.mark.parametrize("angle", [0, 10, 20, 30, 37, 45, 60, 80, 90])
def test_on_inclined_sides(run, angle, shape):
    text, along = inclined(angle, shape)
    results = run(text)
    force = last(results, "base_fx") * along[0] + last(results, "base_fy") * along[1]
    area = areas(results).sum()
    assert abs(area - 4) < 1e-6
    assert abs(force - 2.5 * area) < 1e-10 * force


@pytest.mark.parametrize("n", [1, 3])
def test_for_any_number_of_points(run, n):
    text, along = inclined(37, "half-space", n)
    results = run(text)
    force = last(results, "base_fx") * along[0] + last(results, "base_fy") * along[1]
    assert abs(force - 10) < 1e-6


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("angle", [0, 20, 45])
def test_a_base_that_is_withdrawn(run, angle, method):
    """The tension cut-off acts on the same area, until the surfaces have parted."""
    text, along = inclined(angle, "half-space")
    up = np.array([-along[1], along[0]])
    start = text.index("ux: \"")
    way = ", ".join(f'u{axis}: "W{axis}*(min(factor,1)-5*max(factor-1,0))"' for axis in "xy")
    text = text[:start] + way + "," + text[text.index(" curve", start) :]
    text = text.replace("Wx", repr(float(2e-4 * up[0]))).replace("Wy", repr(float(2e-4 * up[1])))
    text = text.replace("adhesion", "tension_cut_off").replace("young: 1e6", "young: 1e5").replace("cpdi2", method)
    history = run(text).history
    force = history["base_fx"] * up[0] + history["base_fy"] * up[1]
    assert force[3] > 10 and force[-1] == 0
    assert force.min() == pytest.approx(-10, rel=1e-7)


# A ring that is pressed from outside onto a shaft that fills its hole, and then turns.
RING = """
version: 1
grid: {type: structured, origin: [-2.5, -2.5], size: [5, 5], spacing: H}
materials: {m: {model: hencky, young: 1e4, poisson: 0}}
bodies: [{name: b, material: m, shape: {type: annulus, center: [CX, CY], inner: 1, outer: 2}, method: cpdi2, points_per_cell: 2}]
surfaces: [{name: rim, body: b, part: {edge: 0}}]
boundary_conditions:
  - {name: held, surface: rim, ux: "-0.01*(X-CX)/2", uy: "-0.01*(Y-CY)/2", curve: [[0, 0], [1, 1], [2, 1]]}
tools:
  - {name: shaft, shape: {type: circle, center: [CX, CY], radius: 1}, rotation: "6*max(factor-1,0)", curve: [[0, 0], [2, 2]],
     adhesion: 1}
steps: {count: 10, end_time: 2}
"""


def ring(h, centre):
    text = RING.replace("H}", f"{h}}}")
    for key, x in zip(["CX", "CY"], centre):
        text = text.replace(key, str(x))
    return text


@pytest.mark.parametrize("centre", [(0, 0), (0.03, 0.01), (0.11, 0.07)])
def test_on_a_shaft(run, centre):
    """With eight domains along its radius: the chords between them are shorter than the circle."""
    results = run(ring(0.25, centre))
    torque, area = abs(last(results, "shaft_mz")), areas(results).sum()
    assert abs(torque / (2 * np.pi) - 1) < 2e-3
    assert abs(area / (2 * np.pi) - 1) < 2e-3


def test_the_torque_of_a_shaft_is_of_second_order(run):
    coarse, fine = [abs(last(run(ring(h, (0.03, 0.01)), f"run{h}"), "shaft_mz")) / (2 * np.pi) - 1 for h in (0.5, 0.25)]
    assert abs(fine) < 0.3 * abs(coarse)


# The same in space, a slice of one cell, where the hole is a staircase, and starts beyond the shaft.
BUSH = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [-2.5, -2.5, 0], size: [5, 5, 0.25], spacing: 0.25}
materials: {m: {model: hencky, young: 1e4, poisson: 0}}
bodies:
  - {name: b, material: m, method: METHOD, points_per_cell: 2,
     shape: {type: difference, from: {type: box, min: [-1.75, -1.75, 0], max: [1.75, 1.75, 0.25]},
             minus: [{type: cylinder, start: [CX, CY, -1], end: [CX, CY, 3], radius: 1.09375}]}}
boundary_conditions:
  - {name: left, nodes: {x: -1.75}, ux: 0.22, curve: [[0, 0], [1, 1], [2, 1]]}
  - {name: right, nodes: {x: 1.75}, ux: -0.22, curve: [[0, 0], [1, 1], [2, 1]]}
  - {name: front, nodes: {y: -1.75}, uy: 0.22, curve: [[0, 0], [1, 1], [2, 1]]}
  - {name: back, nodes: {y: 1.75}, uy: -0.22, curve: [[0, 0], [1, 1], [2, 1]]}
  - {name: base, nodes: {z: 0}, fix: [z]}
  - {name: top, nodes: {z: 0.25}, fix: [z]}
tools:
  - {name: shaft, shape: {type: cylinder, start: [CX, CY, -1], end: [CX, CY, 2], radius: 1},
     rotation: [0, 0, "6*max(factor-1,0)"], curve: [[0, 0], [2, 2]], adhesion: 1}
steps: {count: 10, end_time: 2}
"""


@pytest.mark.parametrize("centre", [(0.03, 0.01), (0.11, 0.07)])
@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_on_a_shaft_in_space(run, method, centre):
    text = BUSH.replace("METHOD", method)
    for key, x in zip(["CX", "CY"], centre):
        text = text.replace(key, str(x))
    torque = abs(last(run(text), "shaft_mz"))
    # Staircases in space: -1.2 %.
    assert abs(torque / (0.25 * 2 * np.pi) - 1) < (0.015 if method == "gimp" else 0.01)
