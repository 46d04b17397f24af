"""Domains of CPDI in space follow the boundary of a body: boxes at any angle, spheres, cylinders, STL solids, parts that meet."""

import numpy as np
import pytest
import pyvista

from results import Results

DECK = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [4, 4, 4], spacing: H}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, POINTS, shape: SHAPE}
"""
LOW, HIGH, CENTER = np.array([1.23, 1.32, 1.41]), np.array([2.46, 2.55, 2.6]), np.array([2.0, 2.0, 2.0])


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, outcome="completed"):
        path, out = tmp_path / "deck.yaml", tmp_path / "out"
        path.write_text(text)
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        results = Results(out)
        assert results.summary["outcome"] == outcome
        return results

    return run


def deck(shape, h=0.5, method="cpdi2", points="points_per_cell: 2"):
    return DECK.replace("SHAPE", shape).replace("METHOD", method).replace("POINTS", points).replace("H}", f"{h}}}")


def numbers(x):
    return f"[{', '.join(repr(float(c)) for c in x)}]"


def rotation(axis, angle):
    n = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def turned(axis, angle, pressures=(150, 150, 150), steps=2, **more):
    """A box turned about its centre on weak rollers at three of its sides, with pressures on the others."""
    box = f"{{type: box, min: {numbers(LOW)}, max: {numbers(HIGH)}}}"
    text = deck(f"{{type: rotate, axis: {numbers(axis)}, angle: {angle}, center: {numbers(CENTER)}, shape: {box}}}", **more)
    turn = rotation(axis, np.radians(angle))
    surfaces, rollers, loads = [], [], []
    for d in range(3):
        for side, end in enumerate((LOW, HIGH)):
            normal = turn[:, d] * (1 if side else -1)
            point = CENTER + turn @ (end - CENTER)
            part = f"{{half_space: {{point: {numbers(point - 1e-7 * normal)}, normal: {numbers(normal)}}}}}"
            surfaces.append(f"  - {{name: s{d}{side}, body: b, part: {part}}}\n")
        rollers.append(f"  - {{name: r{d}, surface: s{d}0, fix: normal}}\n")
        loads.append(f"{{name: p{d}, type: pressure, surface: s{d}1, pressure: {pressures[d]}}}")
    text += "surfaces:\n" + "".join(surfaces) + "boundary_conditions:\n" + "".join(rollers)
    return text + f"loads: [{', '.join(loads)}]\nsteps: {{count: {steps}}}\n"


def scatter(results):
    """The largest deviation of the stress of a point from the mean, relative to the largest stress."""
    stress = np.asarray(results.mesh("points", -1)["cauchy_stress"])
    assert np.abs(stress).max() > 10
    return np.abs(stress - stress.mean(axis=0)).max() / np.abs(stress).max()


SIDES = {
    4: [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    5: [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    6: [[0, 1, 2], [3, 5, 4], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]],
    8: [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
}


class Outer:
    """The sides that only one domain has: their area vectors, and the volume inside, as an independent reader sees them."""

    def __init__(self, results, frame=0):
        mesh = results.mesh("domains", frame)
        cells, places = mesh.cells, np.asarray(mesh.points)
        found, at = {}, 0
        while at < len(cells):
            n = cells[at]
            corners = cells[at + 1 : at + 1 + n]
            for side in SIDES[n]:
                x = places[corners[side]]
                found.setdefault(tuple(sorted(map(tuple, x))), []).append(x)
            at += n + 1
        assert max(map(len, found.values())) == 2
        self.sides = [x[0] for x in found.values() if len(x) == 1]
        cross = lambda x: np.cross(x[1] - x[0], x[2] - x[0]) if len(x) == 3 else np.cross(x[2] - x[0], x[3] - x[1])
        self.areas = np.array([0.5 * cross(x) for x in self.sides])
        self.centres = np.array([x.mean(axis=0) for x in self.sides])
        self.area = np.linalg.norm(self.areas, axis=1).sum()
        self.volumes = np.asarray(mesh["volume"])
        assert self.volumes.min() > 0
        assert np.abs(self.areas.sum(axis=0)).max() < 1e-12 * self.area


TURNS = [((0, 0, 1), 30), ((0, 0, 1), 45), ((1, 2, 3), 30), ((1, 2, 3), 45)]


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("axis, angle", TURNS)
def test_a_turned_block_has_a_uniform_stress(run, axis, angle, method):
    results = run(turned(axis, angle, method=method))
    assert scatter(results) < 1e-8
    outer = Outer(results)
    sides = HIGH - LOW
    assert outer.volumes.sum() == pytest.approx(np.prod(sides), rel=1e-12)
    assert outer.area == pytest.approx(2 * (np.prod(sides) / sides).sum(), rel=1e-12)


@pytest.mark.parametrize("points", ["points_per_cell: 1", "points_per_cell: 3", "point_spacing: 0.3"])
def test_for_any_number_of_points(run, points):
    assert scatter(run(turned((1, 2, 3), 30, (150, 80, -60), points=points))) < 1e-8


def test_for_any_number_of_steps(run):
    assert scatter(run(turned((1, 2, 3), 30, (150, 80, -60), steps=8))) < 1e-8
