"""Domains of CPDI follow the boundary of a body: straight sides at any angle, circles, parts that meet."""

import numpy as np
import pytest

from results import Results

TURNED = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 0.25}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, POINTS,
     shape: {type: rotate, angle: ANGLE, center: [2, 1.5], shape: {type: box, min: [1.43, 1.02], max: [2.46, 2.15]}}}
surfaces:
  - {name: base, body: b, part: {edge: 0}}
  - {name: side, body: b, part: {edge: 1}}
  - {name: top, body: b, part: {edge: 2}}
  - {name: back, body: b, part: {edge: 3}}
boundary_conditions:
  - {name: base, surface: base, fix: normal}
  - {name: back, surface: back, fix: normal}
loads: [RULE]
steps: {count: STEPS}
"""

RULES = {
    "push": "{name: p, type: pressure, surface: side, pressure: 150}",
    "pull": "{name: p, type: pressure, surface: top, pressure: -200}",
    "both": "{name: p, type: pressure, surface: side, pressure: 150}, {name: q, type: pressure, surface: top, pressure: 80}",
    "traction": "{name: p, type: traction, surface: side, traction: [TX, TY]}",
}


def turned(rule, angle=30, method="cpdi2", points="points_per_cell: 2", steps=3):
    text = TURNED.replace("RULE", RULES[rule]).replace("ANGLE", str(angle)).replace("METHOD", method)
    normal = {"TX": np.cos(np.radians(angle)), "TY": np.sin(np.radians(angle))}
    for key, value in normal.items():
        text = text.replace(key, repr(float(150 * value)))
    return text.replace("POINTS", points).replace("STEPS", str(steps))


@pytest.fixture
def run(mpm, tmp_path):
    def run(text):
        number = len(list(tmp_path.glob("*.yaml")))
        path, out = tmp_path / f"deck{number}.yaml", tmp_path / f"out{number}"
        path.write_text(text)
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        results = Results(out)
        assert results.summary["outcome"] == "completed"
        return results

    return run


def scatter(results):
    """The largest deviation of the stress of a point from the mean, relative to the largest stress."""
    stress = np.asarray(results.mesh("points", -1)["cauchy_stress"])
    assert np.abs(stress).max() > 10
    return np.abs(stress - stress.mean(axis=0)).max() / np.abs(stress).max()


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("angle", [30, 45])
@pytest.mark.parametrize("rule", RULES)
def test_a_turned_block_has_a_uniform_stress(run, rule, angle, method):
    assert scatter(run(turned(rule, angle, method))) < 1e-8


@pytest.mark.parametrize("points", ["points_per_cell: 1", "points_per_cell: 3", "points_per_cell: 4", "point_spacing: 0.11"])
def test_for_any_number_of_points(run, points):
    assert scatter(run(turned("both", 30, points=points))) < 1e-8


@pytest.mark.parametrize("steps", [1, 12])
def test_for_any_number_of_steps(run, steps):
    assert scatter(run(turned("both", 45, steps=steps))) < 1e-8


DISC = """
version: 1
grid: {type: structured, origin: [0, 0], size: [1.5, 1.5], spacing: H}
materials: {m: {model: hencky, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: SHAPE, method: METHOD, points_per_cell: 2}]
surfaces: [{name: s, body: b, part: {half_space: {point: [RIM, 0], normal: [1, 1]}}}, {name: hole, body: b, part: HOLE}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: p, type: pressure, surface: SURFACE, pressure: P}]
steps: {count: 2}
"""


def quarter(h, method="cpdi2", inner=0.0):
    disc = "{type: circle, center: [0, 0], radius: 1}"
    shape = f"{{type: annulus, center: [0, 0], inner: {inner}, outer: 1}}" if inner else disc
    shape = f"{{type: intersection, of: [{shape}, {{type: box, min: [0, 0], max: [1.5, 1.5]}}]}}"
    text = DISC.replace("SHAPE", shape).replace("METHOD", method).replace("H}", f"{h}}}")
    hole = f"{{box: {{min: [0.001, 0.001], max: [{0.8 * inner}, {0.8 * inner}]}}}}" if inner else "{half_space: {point: [RIM, 0], normal: [1, 1]}}"
    hole = hole if not inner else f"{{box: {{min: [{1e-4}, {1e-4}], max: [{inner}, {inner}]}}}}"
    text = text.replace("HOLE", hole).replace("SURFACE", "hole" if inner else "s").replace("P}]", f"{1 if inner else 150}}}]")
    return text.replace("RIM", "1")


def test_a_disc_under_pressure_has_a_uniform_stress(run):
    results = run(quarter(0.125))
    assert scatter(results) < 1e-8
    assert results.history["p_fx"][-1] < 0


def part_mesh(path):
    """A unit square of distorted quadrilaterals, of which every third is two triangles; its right side is the group `end`."""
    n = 5
    place = np.random.default_rng(1).uniform(-0.05, 0.05, (n + 1, n + 1, 2))
    place[[0, -1], :, 0] = place[:, [0, -1], 1] = 0
    nodes = [(i / n + place[i, j, 0], j / n + place[i, j, 1]) for j in range(n + 1) for i in range(n + 1)]
    elements = []
    for k in range(n * n):
        a = k % n + k // n * (n + 1) + 1
        corners = [a, a + 1, a + n + 2, a + n + 1]
        parts = [corners] if k % 3 else [corners[:3], [corners[0], corners[2], corners[3]]]
        elements += [(3 if len(part) == 4 else 2, 1, part) for part in parts]
    elements += [(1, 2, [(j + 1) * (n + 1), (j + 2) * (n + 1)]) for j in range(n)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 1 "clay"', '1 2 "end"', "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(nodes)), *(f"{k + 1} {float(x)!r} {float(y)!r} 0" for k, (x, y) in enumerate(nodes)), "$EndNodes"]
    lines += ["$Elements", str(len(elements))]
    lines += [f"{k + 1} {kind} 2 {group} 1 {' '.join(map(str, part))}" for k, (kind, group, part) in enumerate(elements)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


MESH = """
version: 1
grid: {type: structured, origin: [0, 0], size: [3, 3], spacing: 0.3}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, POINTS
     shape: {type: rotate, angle: 20, center: [1, 1], shape: {type: translate, by: [1, 1], shape: {type: mesh, file: part.msh, group: clay}}}}
surfaces:
  - {name: base, body: b, part: {half_space: {point: [1, 1], normal: [SIN, -COS]}}}
  - {name: back, body: b, part: {half_space: {point: [1, 1], normal: [-COS, -SIN]}}}
  - {name: end, body: b, part: {group: end}}
boundary_conditions:
  - {name: base, surface: base, fix: normal}
  - {name: back, surface: back, fix: normal}
loads: [{name: p, type: pressure, surface: end, pressure: 150}]
steps: {count: 3}
"""


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("points", ["", "points_per_cell: 2, points_per_triangle: 4,"])
def test_cells_of_a_mesh_are_domains_on_any_grid(run, tmp_path, points, method):
    part_mesh(tmp_path / "part.msh")
    text = MESH.replace("SIN", repr(float(np.sin(np.radians(20))))).replace("COS", repr(float(np.cos(np.radians(20)))))
    results = run(text.replace("METHOD", method).replace("POINTS", points))
    assert scatter(results) < 1e-8
    assert np.asarray(results.mesh("points", 0)["volume"]).sum() == pytest.approx(1, rel=1e-12)


# A quarter of a ring under a pressure in its hole that hardly strains it.
RING = """
version: 1
grid: {type: structured, origin: [0, 0], size: [1.5, 1.5], spacing: H}
materials: {m: {model: hencky, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, points_per_cell: 2,
     shape: {type: intersection, of: [{type: annulus, center: [0, 0], inner: 0.5, outer: 1}, {type: box, min: [0, 0], max: [1.5, 1.5]}]}}
surfaces: [{name: hole, body: b, part: {box: {min: [-0.1, -0.1], max: [0.5000001, 0.5000001]}}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: p, type: pressure, surface: hole, pressure: 1e-3}]
steps: {count: 1}
solver: {tolerance: 1e-11}
"""


def ring_errors(results):
    """Errors of the volume, of the force of the pressure, of the displacement in the mean square, of the mean stresses in
    the inner quarter of the ring, and of the stress of the points in the mean square, relative to the exact values or the
    largest of them."""
    pressure, inner, outer, poisson, young = 1e-3, 0.5, 1.0, 0.3, 1000
    a = pressure * inner**2 / (outer**2 - inner**2)
    b = a * outer**2
    points, volume = results.mesh("points", -1), np.asarray(results.mesh("points", 0)["volume"])
    moved, stress = np.asarray(points["displacement"])[:, :2], np.asarray(points["cauchy_stress"])
    place = np.asarray(points.points)[:, :2] - moved
    radius = np.hypot(*place.T)
    c, s = (place / radius[:, None]).T
    radial = stress[:, 0] * c**2 + stress[:, 1] * s**2 + 2 * stress[:, 3] * c * s
    hoop = stress[:, 0] + stress[:, 1] - radial
    wrong = np.array([radial - (a - b / radius**2), hoop - (a + b / radius**2)]) / (a + b / inner**2)
    exact = (1 + poisson) / young * (a * (1 - 2 * poisson) * radius + b / radius)
    near = radius < inner + 0.125
    return {
        "volume": abs(volume.sum() / (np.pi / 4 * (outer**2 - inner**2)) - 1),
        "force": abs(results.history["p_fx"][-1] / (pressure * inner) - 1),
        "displacement": np.sqrt(volume @ (moved[:, 0] * c + moved[:, 1] * s - exact) ** 2 / volume.sum()) / exact.max(),
        "mean stress": np.hypot(*(wrong[:, near] @ volume[near])) / volume[near].sum(),
        "stress": np.sqrt((wrong**2 @ volume).sum() / volume.sum()),
    }


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
def test_orders_of_a_ring(run, method):
    coarse, fine = [ring_errors(run(RING.replace("METHOD", method).replace("H}", f"{1 / n}}}"))) for n in (16, 64)]
    assert coarse.pop("volume") < 1e-14 and fine.pop("volume") < 1e-14
    order = {name: np.log(coarse[name] / fine[name]) / np.log(4) for name in fine}
    assert order["force"] > 1.9 and order["displacement"] > 1.9 and order["mean stress"] > 1.9 and order["stress"] > 0.9
    assert fine["force"] < 3e-5 and fine["displacement"] < 2e-4 and fine["mean stress"] < 3e-4 and fine["stress"] < 0.01
