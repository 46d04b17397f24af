"""The field `pressure_smoothed` against a second implementation, and what it must reproduce."""

import numpy as np
import pytest

from results import Results

SPACING = 0.5
DECK = """
version: 1
analysis: {initial_imbalance: equilibrate}
grid: {type: structured, origin: [0, 0], size: [8, 5], spacing: 0.5}
materials: {m: {model: hencky, young: 1e7, poisson: 0.3, density: 1000}}
bodies:
  - {name: left, material: m, shape: {type: box, min: [0, 0], max: [4, 4]}, method: METHOD, points_per_cell: 2,
     initial_stress: {type: components, stress: {xx: -1e3, yy: -1e3, zz: -1e3}}}
  - {name: right, material: m, shape: {type: box, min: [4, 0], max: [8, 4]}, method: mpm, points_per_cell: 3,
     initial_stress: {type: components, stress: {xx: "-LINEAR", yy: "-LINEAR", zz: "-LINEAR"}}}
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
  - {name: side, nodes: {x: 0}, fix: [x]}
  - {name: other, nodes: {x: 8}, fix: [x]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
steps: {count: 2}
output: {every: 1, FIELDS}
"""


@pytest.fixture(scope="module")
def run(mpm, tmp_path_factory):
    def run(method="cpdi2", fields="fields: [pressure, pressure_smoothed]", threads=1):
        directory = tmp_path_factory.mktemp("smoothed")
        deck = directory / "deck.yaml"
        text = DECK.replace("METHOD", method).replace("FIELDS", fields).replace("LINEAR", "(3e3 + 500*X + 200*Y)")
        deck.write_text(text)
        process = mpm("run", deck, "--out", directory / "out", threads=threads)
        assert process.returncode == 0, process.stderr
        return Results(directory / "out")

    return run


def smoothed(points):
    """Means at the nodes of a grid of squares, body by body, interpolated back."""
    cells = points.points[:, :2] / SPACING
    result = np.empty(len(cells))
    for body in np.unique(points["body_id"]):
        means = {}
        of_body = np.flatnonzero(points["body_id"] == body)
        links = {}
        for p in of_body:
            low = np.floor(cells[p])
            x, y = cells[p] - low
            values = {(0, 0): (1 - x) * (1 - y), (1, 0): x * (1 - y), (0, 1): (1 - x) * y, (1, 1): x * y}
            links[p] = [((low[0] + i, low[1] + j), value) for (i, j), value in values.items()]
            for node, value in links[p]:
                mean = means.setdefault(node, np.zeros(2))
                mean += value * points["volume"][p] * np.array([points["pressure"][p], 1])
        for p in of_body:
            result[p] = sum(value * means[node][0] / means[node][1] for node, value in links[p])
    return result


@pytest.mark.parametrize("method", ["cpdi2", "gimp", "mpm"])
def test_pressures_are_means_over_the_points_of_a_body(run, method):
    results = run(method)
    for step, points in enumerate(results.meshes("points")):
        expected = smoothed(points)
        assert points["pressure_smoothed"] == pytest.approx(expected, rel=1e-12), step
        assert np.abs(points["pressure_smoothed"] - points["pressure"]).max() > 1, "they are smoothed"
    if method != "mpm":
        domains = results.mesh("domains", -1)
        has_domain = points["body_id"] == 0
        np.testing.assert_array_equal(domains["pressure_smoothed"], points["pressure_smoothed"][has_domain])


def test_constant_and_linear_pressures_are_reproduced(run):
    """Bodies of different pressure that touch do not mix."""
    points = run().mesh("points", 0)
    left = points["body_id"] == 0
    pressure = points["pressure_smoothed"]
    assert pressure[left] == pytest.approx(1e3, rel=1e-14)
    x, y = points.points[~left, 0], points.points[~left, 1]
    linear = 3e3 + 500 * x + 200 * y
    inside = (x > 4.5) & (x < 7.5) & (y > 0.5) & (y < 3.5)
    assert inside.sum() > 200
    assert pressure[~left][inside] == pytest.approx(linear[inside], rel=1e-12)
    assert np.abs(pressure[~left] - linear).max() < 700 * SPACING


def test_the_state_does_not_depend_on_it(run):
    with_it, without = run(), run(fields="fields: [pressure]")
    for name in ("history.csv", "quality.csv", "convergence.csv"):
        assert (with_it.directory / name).read_bytes() == (without.directory / name).read_bytes()
    points, others = with_it.mesh("points", -1), without.mesh("points", -1)
    np.testing.assert_array_equal(points["pressure"], others["pressure"])
    assert "pressure_smoothed" not in others.point_data
    assert "pressure_smoothed" not in run(fields="precision: double").mesh("points", -1).point_data
    np.testing.assert_array_equal(
        run(threads=2).mesh("points", -1)["pressure_smoothed"], points["pressure_smoothed"]
    )
