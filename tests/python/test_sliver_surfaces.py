"""Uniform stress in bodies whose corners lie just beyond grid lines, and on closed curved boundaries.

Basis functions that domains touch by slivers only are carried by other nodes; loads and conditions on surfaces must be
carried alike, and closed boundaries have no holes.
"""

import json
import random

import numpy as np
import pytest

from results import Results


@pytest.fixture
def stress_of(mpm, tmp_path):
    def stress_of(deck):
        path, out = tmp_path / "deck.yaml", tmp_path / "out"
        path.write_text(json.dumps({"version": 1} | deck))
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        return np.asarray(Results(out).mesh("points", -1)["cauchy_stress"])

    return stress_of


def is_uniform(stress, expected, relative):
    expected = np.asarray(expected, float)
    return np.abs(stress - expected).max() < relative * np.abs(expected).max()


def block(method, steps, pull):
    """A block on grid lines on weak rollers, pulled at its right and upper sides."""
    return {
        "grid": {"type": "structured", "origin": [-0.5, -0.5], "size": [3, 3], "spacing": 0.25},
        "materials": {"m": {"model": "neo-hookean", "young": 1000, "poisson": 0.3}},
        "bodies": [{"name": "b", "material": "m", "method": method, "points_per_cell": 2,
                    "shape": {"type": "box", "min": [0, 0], "max": [1, 1]}}],
        "surfaces": [{"name": f"s{k}", "body": "b", "part": {"edge": k}} for k in range(4)],
        "boundary_conditions": [{"name": "a", "surface": "s0", "fix": "normal"}, {"name": "c", "surface": "s3", "fix": "normal"}],
        "loads": [{"name": "p1", "type": "pressure", "surface": "s1", "pressure": -pull},
                  {"name": "p2", "type": "pressure", "surface": "s2", "pressure": -0.5 * pull}],
        "steps": {"count": steps},
        "output": {"every": steps},
    }


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
@pytest.mark.parametrize("steps, pull", [(1, 3), (3, 3), (8, 3), (32, 3), (32, 0.3), (8, 1e-3)])
def test_blocks_that_grow_by_less_than_a_percent(stress_of, method, steps, pull):
    stress = stress_of(block(method, steps, pull))
    assert is_uniform(stress[:, [0, 1, 3]], [pull, 0.5 * pull, 0], 1e-9)


def inflated(shape, points, dimension, steps=1, spacing=0.5):
    """A body under a uniform tension on all of its boundary, held at nodes so that it cannot move as a rigid body."""
    nodes = [dict(zip("xyz", x)) for x in ([0, 0, 0], [spacing, 0, 0], [0, spacing, 0])]
    held = [("xyz"[:dimension], 0), ("yz"[: dimension - 1], 1), ("z", 2)][:dimension]
    return {
        "analysis": {"idealisation": "solid" if dimension == 3 else "plane-strain"},
        "grid": {"type": "structured", "origin": [-2] * dimension, "size": [4] * dimension, "spacing": spacing},
        "materials": {"m": {"model": "neo-hookean", "young": 100, "poisson": 0.3}},
        "bodies": [{"name": "b", "material": "m", "method": "cpdi2", "points_per_cell": points, "shape": shape}],
        "surfaces": [{"name": "s", "body": "b"}],
        "boundary_conditions": [
            {"name": f"c{k}", "nodes": {axis: nodes[k][axis] for axis in "xyz"[:dimension]}, "fix": list(axes)} for axes, k in held
        ],
        "loads": [{"name": "p", "type": "pressure", "surface": "s", "pressure": -10}],
        "steps": {"count": steps},
        "output": {"every": steps},
    }


def in_space(number):
    """A sphere, a cylinder, a capped sphere or a turned box in an arbitrary position."""
    draw = random.Random(number)
    place = [round(draw.uniform(-0.2, 0.2), 4) for _ in range(3)]
    sphere = {"type": "sphere", "center": place, "radius": round(draw.uniform(1, 1.5), 4)}
    axis = [round(draw.uniform(-1, 1), 3) for _ in range(3)]
    box = {"type": "box", "min": [-1, -0.9, -0.8], "max": [1, 0.9, 0.8]}
    return [
        sphere,
        {"type": "rotate", "angle": round(draw.uniform(0.5, 40), 2), "axis": axis, "center": [0.05, 0, -0.03], "shape": box},
        {"type": "cylinder", "start": [-0.9, 0.1, place[0]], "end": [1.1, -0.1, 0.2], "radius": round(draw.uniform(0.7, 0.9), 3)},
        {"type": "intersection", "of": [sphere, {"type": "box", "min": [-1.6] * 3, "max": [1.6, 1.6, 0.41]}]},
    ][number % 4]


@pytest.mark.parametrize("number", [*range(12), *(pytest.param(n, marks=pytest.mark.long) for n in range(12, 60))])
def test_bodies_in_space_under_a_uniform_pressure(stress_of, number):
    stress = stress_of(inflated(in_space(number), 2, 3))
    assert is_uniform(stress, [10, 10, 10, 0, 0, 0], 1e-9)


def in_plane(number):
    """A lens, a circle on a plate, a plate with a hole, or a star."""
    draw = random.Random(number)
    u = draw.uniform
    angles = [k * np.pi / 5 for k in range(10)]
    radii = [1.4 if k % 2 == 0 else round(u(0.6, 0.9), 3) for k in range(10)]
    return [
        {"type": "intersection", "of": [{"type": "circle", "center": [-0.5, 0.2], "radius": round(u(1.2, 1.4), 3)},
                                        {"type": "circle", "center": [0.7, 0.1], "radius": round(u(1.2, 1.4), 3)}]},
        {"type": "union", "of": [{"type": "polygon", "vertices": [[-1, -1], [1.03, -1], [1.03, 0.21], [-1, 0.21]]},
                                 {"type": "circle", "center": [round(u(-0.2, 0.2), 3), round(u(0.2, 0.5), 3)], "radius": round(u(0.5, 0.8), 3)}]},
        {"type": "difference", "from": {"type": "box", "min": [-1, -1], "max": [1, 1]},
         "minus": [{"type": "circle", "center": [round(u(0.3, 0.7), 3), round(u(0.3, 0.7), 3)], "radius": round(u(0.1, 0.2), 3)}]},
        {"type": "polygon", "vertices": [[float(r * np.cos(t + 0.1)), float(r * np.sin(t + 0.1))] for r, t in zip(radii, angles)]},
    ][number % 4]


@pytest.mark.parametrize("number", [*range(16), *(pytest.param(n, marks=pytest.mark.long) for n in range(16, 100))])
def test_bodies_in_the_plane_under_a_uniform_pressure(stress_of, number):
    stress = stress_of(inflated(in_plane(number), 2, 2, spacing=0.25))
    assert is_uniform(stress[:, [0, 1, 3]], [10, 10, 0], 1e-9)
