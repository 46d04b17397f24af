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


def octant(shape, h, **more):
    """A part of a body with three planes of symmetry, under a pressure of 150 on what is curved."""
    part = f"{{type: intersection, of: [{shape}, {{type: box, min: [0, 0, 0], max: [4, 4, 4]}}]}}"
    text = deck(part, h, **more)
    return text + """
surfaces: [{name: s, body: b, part: {box: {min: [1.0e-4, 1.0e-4, 1.0e-4], max: [4, 4, 4]}}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: base, nodes: {z: 0}, fix: [z]}
loads: [{name: p, type: pressure, surface: s, pressure: 150}]
steps: {count: 1}
"""


def sphere(h, radius=1.5, **more):
    return octant(f"{{type: sphere, center: [0, 0, 0], radius: {radius}}}", h, **more)


def compression(results):
    """The ratio of lengths at the end and at the start, in a body whose deformation is the same in all directions."""
    start, end = (np.asarray(results.mesh("domains", frame)["volume"]).sum() for frame in (0, -1))
    return (end / start) ** (1 / 3)


def test_a_sphere_under_pressure(run):
    """The volume is nearly exact, the force on a plane of symmetry of order 2, and the stress uniform."""
    volume = np.pi / 6 * 1.5**3
    errors = []
    for h in (1, 0.5, 0.25):
        results = run(sphere(h))
        assert scatter(results) < 1e-8
        outer = Outer(results)
        force = 150 * np.pi / 4 * 1.5**2 * compression(results) ** 2
        errors.append([abs(outer.volumes.sum() / volume - 1), abs(-results.history["p_fx"][-1] / force - 1)])
    errors = np.array(errors)
    assert (errors[:, 0] < [0.02, 0.005, 5e-4]).all()
    assert (np.log2(errors[:-1, 1] / errors[1:, 1]) > 1.5).all(), errors


def test_a_cylinder_under_pressure(run):
    """A cylinder along z, loaded at its lateral surface and at its end."""
    cylinder = "{type: cylinder, start: [0, 0, 0], end: [0, 0, 1.37], radius: 1.43}"
    results = run(octant(cylinder, 0.5))
    assert scatter(results) < 1e-8
    assert Outer(results).volumes.sum() == pytest.approx(np.pi / 4 * 1.43**2 * 1.37, rel=2e-3)
    force = 150 * np.pi / 4 * 1.43**2 * compression(results) ** 2
    assert -results.history["p_fz"][-1] == pytest.approx(force, rel=5e-3)


def test_an_stl_solid_is_met_exactly(run, tmp_path):
    """An L-shaped solid, turned, in facets: volume and area of the domains are those of the solid."""
    corners = np.array([[0, 0], [2.1, 0], [2.1, 0.9], [0.8, 0.9], [0.8, 2.0], [0, 2.0]])
    turn = rotation((1, 2, 3), 0.4)
    triangles = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    ends = [np.column_stack([corners, np.full(6, z)]) @ turn.T + [0.9, 0.7, 1.2] for z in (0, 1.1)]
    facets = [ends[1][list(t)] for t in triangles] + [ends[0][list(t[::-1])] for t in triangles]
    for k in range(6):
        a, b = k, (k + 1) % 6
        facets += [np.array([ends[0][a], ends[0][b], ends[1][b]]), np.array([ends[0][a], ends[1][b], ends[1][a]])]
    vertex = lambda x: f"vertex {float(x[0])!r} {float(x[1])!r} {float(x[2])!r}\n"
    facet = lambda x: "facet normal 0 0 0\nouter loop\n" + "".join(map(vertex, x)) + "endloop\nendfacet\n"
    (tmp_path / "part.stl").write_text("solid part\n" + "".join(map(facet, facets)) + "endsolid part\n")
    text = deck("{type: stl, file: part.stl}", 0.5) + """
surfaces: [{name: s, body: b}]
boundary_conditions: [{name: r, surface: s, fix: [x, y, z]}]
loads: [{name: p, type: pressure, surface: s, pressure: 1}]
steps: {count: 1}
"""
    outer = Outer(run(text))
    area = 2.1 * 2.0 - 1.3 * 1.1
    assert outer.volumes.sum() == pytest.approx(1.1 * area, rel=1e-10)
    assert outer.area == pytest.approx(2 * area + 1.1 * 8.2, rel=1e-10)


@pytest.mark.parametrize("shape, volume, tolerance", [
    ("{type: difference, from: BOX, minus: [{type: rotate, axis: [0, 0, 1], angle: 20, center: [2, 2, 2], shape: {type: box, min: [1.5, 1.5, 0], max: [2.6, 2.4, 4]}}]}",
     2.5 * 2.3 * 2.6 - 1.1 * 0.9 * 2.6, 1e-10),
    ("{type: difference, from: BOX, minus: [{type: sphere, center: [2, 1.9, 1.9], radius: 0.9}]}",
     2.5 * 2.3 * 2.6 - 4 / 3 * np.pi * 0.9**3, 5e-3),
    ("{type: extrusion, axis: z, from: 0.8, to: 2.9, polygon: [[0.6, 0.6], [3.1, 0.7], [3.3, 1.6], [1.7, 1.5], [1.4, 3.1], [0.5, 2.9]]}", 2.1 * 3.84, 1e-10),
    ("{type: cone, start: [1, 1.2, 1.1], end: [2.5, 2.4, 3], radii: [0.9, 0.4]}", np.pi / 3 * np.sqrt(7.3) * (0.81 + 0.36 + 0.16), 5e-3),
])
def test_solids_may_be_combined(run, shape, volume, tolerance):
    box = "{type: box, min: [0.6, 0.6, 0.6], max: [3.1, 2.9, 3.2]}"
    text = deck(shape.replace("BOX", box), 0.5) + """
surfaces: [{name: s, body: b}]
boundary_conditions: [{name: r, surface: s, fix: [x, y, z]}]
loads: [{name: p, type: pressure, surface: s, pressure: 1}]
steps: {count: 1}
"""
    outer = Outer(run(text))
    assert outer.volumes.sum() == pytest.approx(volume, rel=tolerance)


def test_shapes_on_lattice_lines_stay_as_they_are(run):
    box = "{type: box, min: [1, 1.25, 0.5], max: [2, 2.5, 1.75]}"
    text = deck(f"{{type: union, of: [{box}, {{type: translate, by: [1, 0, 0], shape: {box}}}]}}", 0.5) + """
surfaces: [{name: s, body: b}]
boundary_conditions: [{name: r, surface: s, fix: [x, y, z]}]
loads: [{name: p, type: pressure, surface: s, pressure: 1}]
steps: {count: 1}
"""
    results = run(text)
    volumes = np.asarray(results.mesh("domains", 0)["volume"])
    assert len(volumes) == 8 * 5 * 5 and np.ptp(volumes) < 1e-15


def test_what_cannot_be_followed_is_named(mpm, tmp_path):
    cone = "{type: cone, start: [1, 1.2, 1.1], end: [2.5, 2.4, 3], radii: [0.8, 0]}"
    path = tmp_path / "deck.yaml"
    path.write_text(deck(cone, 0.5) + """
surfaces: [{name: s, body: b}]
boundary_conditions: [{name: r, surface: s, fix: [x, y, z]}]
loads: [{name: p, type: pressure, surface: s, pressure: 1}]
steps: {count: 1}
""")
    message = mpm("check", path).stderr
    assert "D033" in message and "are finer than the domains, near (2.4" in message
