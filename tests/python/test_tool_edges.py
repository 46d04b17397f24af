"""Tools that are sharp, or smaller than the sides of domains, act on the sides that they meet between corners."""

import numpy as np
import pytest

from results import Results

METHODS = ("gimp", "cpdi1", "cpdi2")
PLANE = """
version: 1
analysis: {idealisation: plane-strain}
grid: {type: structured, origin: [0, 0], size: [4, 3], spacing: 0.5}
materials: {rubber: {model: hencky, young: 1e5, poisson: 0.3}}
bodies: [{name: block, material: rubber, method: METHOD, points_per_cell: 1, shape: {type: box, min: [0, 0], max: [4, 2]}}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
tools: [{name: tip, shape: SHAPE, uy: -0.1, friction: 0.5}]
steps: {count: 4}
"""
# The domain below is 0.5 wide, from 2 to 2.5; its centre is at 2.25.
TIPS = {
    "small box": ("{type: box, min: [2.3, 2], max: [2.34, 2.5]}", [2.3, 2.34]),
    "needle": ("{type: polygon, vertices: [[2.2, 2], [2.3, 2.6], [2.1, 2.6]]}", [2.2]),
    "blade": ("{type: polygon, vertices: [[2.35, 2], [2.45, 2.6], [2.35, 2.6]]}", [2.35]),
}
SPACE = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 2.5], spacing: 0.5}
materials: {rubber: {model: hencky, young: 1e5, poisson: 0.3}}
bodies: [{name: block, material: rubber, method: METHOD, points_per_cell: 2, shape: {type: box, min: [0, 0, 0], max: [2, 2, 1.5]}}]
boundary_conditions:
  - {name: base, nodes: {z: 0}, fix: [x, y, z]}
tools: [{name: tip, shape: SHAPE, uz: -0.05, friction: 0}]
steps: {count: 2}
"""
SOLIDS = {
    "small box": "{type: box, min: [1.2, 1.2, 1.5], max: [1.26, 1.25, 2]}",
    "edge": "{type: extrusion, axis: y, from: -1, to: 3, polygon: [[1.2, 1.5], [1.3, 2.2], [1.1, 2.2]]}",
    "tip of a cone": "{type: cone, start: [1.3, 1.2, 1.5], end: [1.3, 1.2, 2.2], radii: [0, 0.1]}",
}


@pytest.fixture
def run(mpm, tmp_path):
    def run(text):
        path = tmp_path / "deck.yaml"
        path.write_text(text)
        process = mpm("run", path, "--out", tmp_path / "out")
        assert process.returncode == 0, process.stderr
        return Results(tmp_path / "out")

    return run


@pytest.mark.parametrize("tip", TIPS)
@pytest.mark.parametrize("method", METHODS)
def test_a_tip_does_not_enter_the_side_below(run, method, tip):
    shape, edges = TIPS[tip]
    results = run(PLANE.replace("METHOD", method).replace("SHAPE", shape))
    force = results.history["tip_fy"]
    # Four equal steps of an elastic block: the force grows in proportion to the depth, from the first step on.
    assert np.all(force > 0) or np.all(force < 0)
    assert abs(force[0]) == pytest.approx(abs(force[-1]) / 4, rel=0.1)
    if method == "cpdi2":
        domains = results.mesh("domains", -1)
        corners = np.asarray(domains.points)
        left = corners[np.abs(corners[:, 0] - 2) < 0.2]
        right = corners[np.abs(corners[:, 0] - 2.5) < 0.2]
        left, right = (side[np.argmax(side[:, 1])] for side in (left, right))
        heights = [np.interp(x, [left[0], right[0]], [left[1], right[1]]) for x in edges]
        assert max(heights) == pytest.approx(1.9, abs=1e-6)


@pytest.mark.parametrize("tip", SOLIDS)
@pytest.mark.parametrize("method", METHODS)
def test_edges_in_space_act_on_sides(run, method, tip):
    results = run(SPACE.replace("METHOD", method).replace("SHAPE", SOLIDS[tip]))
    force = np.abs(results.history["tip_fz"])
    assert force[0] > 1
    assert force[0] == pytest.approx(force[-1] / 2, rel=0.1)


def test_a_flat_punch_acts_by_its_faces_alone(run):
    """Corners of a punch on flat ground have no contact points of their own: its faces touch the corners of domains."""
    shape = "{type: box, min: [1.1, 2.03], max: [2.9, 2.6]}"
    results = run(PLANE.replace("METHOD", "cpdi2").replace("SHAPE", shape))
    contacts = results.mesh("contacts", -1)
    x = np.asarray(contacts.points)[:, 0]
    assert len(x) == 3 and np.all(np.abs(x * 2 - np.round(x * 2)) < 0.05)
