"""Patch tests of what acts on a surface: a uniform stress, and the traction that belongs to it, are in equilibrium.

Each rule of `RULES` loads the right side of a block, which is held on symmetry planes, so that the stress of the points is
uniform if the rule agrees with the basis. A rule that samples the surface elsewhere than the sides of the domains is off
by 5 to 50 % as soon as sides cross the boundaries of cells.
"""

import distorted
import numpy as np
import pytest

from results import Results

# A neo-Hookean block between smooth planes; stretched by a quarter or compressed by a fifth, its domains cross the lines of
# the grid.
PLANE = """
version: 1
grid: GRID
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: SHAPE, method: METHOD, POINTS}]
surfaces: [{name: side, body: b, part: PART}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
RULE
steps: {count: STEPS}
"""

RULES = {
    "pull": "loads: [{name: p, type: pressure, surface: side, pressure: -300}]",
    "push": "loads: [{name: p, type: pressure, surface: side, pressure: 200}]",
    "water": "loads: [{name: p, type: pressure, surface: side, hydrostatic: {level: 1e12, unit_weight: 2e-10}}]",
    "stretch": "  - {name: p, surface: side, ux: 0.5}",
    "dead": "loads: [{name: p, type: pressure, surface: side, pressure: 150, follows: false}]",
    "traction": "loads: [{name: p, type: traction, surface: side, traction: [250, 0]}]",
    "motion": "  - {name: p, surface: side, ux: 0.23}",
    "normal": "  - {name: p, surface: side, fix: {normal: [1, 0]}}\nloads: [{name: lid, type: traction, surface: top, traction: [0, -150]}]",
}

# The pressures of those loads that follow the side.
FOLLOWING = {"pull": -300, "push": 200, "water": 200}

EVEN = "{type: structured, origin: [0, 0], size: [1.75, 1.75], spacing: 0.25}"
SHIFTED = "{type: structured, origin: [0, 0], size: [1.8, 2.1], spacing: [0.2, 0.3]}"
GRADED = (
    "{type: structured, origin: [0, 0], size: [1.75, 1.75], "
    "spacing: [[{to: 1, cells: 5, ratio: 0.8}, {to: 1.75, cells: 4}], 0.25]}"
)


def deck(rule, method="cpdi2", points="points_per_cell: 2", grid=EVEN, steps=4, size=(1, 1)):
    text = PLANE.replace("GRID", grid).replace("METHOD", method).replace("POINTS", points)
    text = text.replace("SHAPE", f"{{type: box, min: [0, 0], max: [{size[0]}, {size[1]}]}}").replace("PART", "{edge: 1}")
    if rule == "normal":
        text = text.replace("}}]\nboundary", "}}, {name: top, body: b, part: {edge: 2}}]\nboundary")
        text = text.replace("part: {edge: 1}}]", "part: {edge: 1}}, {name: top, body: b, part: {edge: 2}}]")
    return text.replace("RULE", RULES[rule]).replace("STEPS", str(steps))


@pytest.fixture
def scatter(mpm, tmp_path):
    """The largest deviation of the stress of a point from the mean, relative to the largest stress."""

    def run(text):
        path, out = tmp_path / "deck.yaml", tmp_path / "out"
        path.write_text(text)
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        results = Results(out)
        assert results.summary["outcome"] == "completed"
        stress = np.asarray(results.mesh("points", -1)["cauchy_stress"])
        assert np.abs(stress).max() > 10
        for rule, pressure in FOLLOWING.items():
            assert RULES[rule] not in text or abs(stress[:, 0].mean() + pressure) < 1e-7 * abs(pressure)
        return np.abs(stress - stress.mean(axis=0)).max() / np.abs(stress).max()

    return run


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
@pytest.mark.parametrize("rule", RULES)
def test_every_rule_balances_a_uniform_stress(scatter, rule, method):
    assert scatter(deck(rule, method)) < 1e-10


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
@pytest.mark.parametrize("n", [1, 3, 4])
@pytest.mark.parametrize("rule", ["push", "motion"])
def test_for_any_number_of_points(scatter, rule, n, method):
    assert scatter(deck(rule, method, points=f"points_per_cell: {n}")) < 1e-10


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
@pytest.mark.parametrize("steps", [1, 32])
@pytest.mark.parametrize("rule", ["pull", "traction"])
def test_for_any_number_of_steps(scatter, rule, steps, method):
    assert scatter(deck(rule, method, steps=steps)) < 1e-10


@pytest.mark.parametrize(
    ("grid", "points", "size"),
    [
        (SHIFTED, "points_per_cell: 2", (1, 1.2)),
        (EVEN, "point_spacing: [0.1, 0.125]", (1, 1)),
        (GRADED, "points_per_cell: 2", (1, 1)),
    ],
    ids=["other cells", "a lattice of its own", "graded"],
)
@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
@pytest.mark.parametrize("rule", ["push", "traction", "motion"])
def test_on_other_grids(scatter, rule, method, grid, points, size):
    assert scatter(deck(rule, method, grid=grid, points=points, size=size)) < 1e-10


SURCHARGE = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 2.5], spacing: 0.25, refine: [{at: [1, 2], to: 0.0625}]}
materials: {m: {model: hencky, young: 1e5, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: mpm, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [4, 2]},
     initial_stress: {type: components, stress: {xx: -10, yy: -10, zz: -10}}}
surfaces: [{name: top, body: b, part: {box: {min: [0, 2], max: [4, 2]}}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: q, type: traction, surface: top, traction: [0, -10], curve: [[0, 1], [1, 1]]}]
steps: {count: 1}
"""
GRADED_FACE = GRADED.replace("[[{", "[0.25, [{").replace("}], 0.25]", "}]]")


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_on_a_face_across_graded_lines(scatter, method):
    assert GRADED_FACE.count("ratio") == 1 and "[0.25, [{to: 1" in GRADED_FACE
    assert scatter(deck("traction", method, grid=GRADED_FACE)) < 1e-10


def test_a_surcharge_balances_the_initial_stress_of_standard_points_in_graded_cells(mpm, tmp_path):
    """Facets of standard points must not cross grid lines: the first step would be out of balance by 2e-4."""
    (tmp_path / "deck.yaml").write_text(SURCHARGE)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    stress = np.asarray(Results(tmp_path / "out").mesh("points", -1)["cauchy_stress"])
    assert np.abs(stress[:, :3] + 10).max() < 1e-8


SOLID = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [1.5, 1.5, 1.5], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0, 0], max: [1, 1, 1]}, method: METHOD, points_per_cell: 2}]
surfaces: [{name: side, body: b, part: {box: {min: [1, 0, 0], max: [1, 1, 1]}}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: base, nodes: {z: 0}, fix: [z]}
RULE
steps: {count: 4}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
@pytest.mark.parametrize("rule", ["pull", "push", "dead", "water", "traction", "motion", "stretch"])
def test_in_space(scatter, rule, method):
    text = SOLID.replace("METHOD", method).replace("RULE", RULES[rule].replace("[250, 0]", "[250, 0, 0]"))
    assert scatter(text) < 1e-10


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("rule", ["pull", "push", "dead", "water", "traction", "motion", "stretch"])
def test_in_bodies_of_revolution(scatter, rule, method, n):
    """Without GIMP, whose boxes are in balance only as long as they cross no lines of the grid."""
    text = deck(rule, method, points=f"points_per_cell: {n}").replace("version: 1", "version: 1\nanalysis: {idealisation: axisymmetric}")
    assert scatter(text) < 1e-10


# A square or cube of distorted cells: either the cells of the grid, with air around them, or domains on a grid whose lines
# they cross.
MESHED = """
version: 1
analysis: {idealisation: IDEALISATION}
grid: GRID
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, method: METHOD, POINTS, shape: SHAPE}]
surfaces: [{name: side, body: b, part: {group: side}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
FRONT
RULE
steps: {count: 4}
"""

# With fewer points, the stress of some motions is not determined beyond the tolerance of equilibrium.
POINTS = {
    "triangles": "points_per_triangle: 4",
    "quadrilaterals": "points_per_cell: 2",
    "tetrahedra": "points_per_tetrahedron: 8",
    "hexahedra": "points_per_cell: 2",
}


@pytest.mark.parametrize("is_grid", [True, False], ids=["mesh as grid", "mesh as shape"])
@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("rule", ["pull", "dead", "water", "traction", "stretch"])
@pytest.mark.parametrize("kind", POINTS)
def test_on_meshes(scatter, tmp_path, kind, rule, method, is_grid):
    solid = distorted.SPACE[kind] == 3
    distorted.write(tmp_path / "mesh.msh", kind, 2 if solid else 3, air=is_grid)
    text = MESHED.replace("METHOD", method).replace("RULE", RULES[rule]).replace("POINTS", POINTS[kind])
    if is_grid:
        text = text.replace("GRID", "{type: gmsh, file: mesh.msh}").replace("SHAPE", "{type: cells, group: bar}")
    else:
        text = text.replace("GRID", "{type: structured, origin: [0, 0], size: [2, 2], spacing: 0.4}")
        text = text.replace("SHAPE", "{type: mesh, file: mesh.msh, group: bar}")
    if solid:
        text = text.replace("[0, 0]", "[0, 0, 0]").replace("[2, 2]", "[2, 2, 2]").replace("[250, 0]", "[250, 0, 0]")
    text = text.replace("IDEALISATION", "solid" if solid else "plane-strain")
    assert scatter(text.replace("FRONT", "  - {name: front, nodes: {z: 0}, fix: [z]}" if solid else "")) < 1e-10


# A block between two tools, away from all nodes that are held across it.
PRESSED = """
version: 1
grid: {type: structured, origin: [0, 0], size: [1.8, 2.1], spacing: [0.2, 0.3]}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0.3], max: [1, 1.5]}, method: METHOD, points_per_cell: POINTS}]
boundary_conditions: [{name: left, nodes: {x: 0}, fix: [x]}]
tools:
  - {name: low, shape: LOW, uy: 0.11}
  - {name: high, shape: {type: half-space, point: [0, 1.5], normal: [0, -1]}, uy: -0.2}
steps: {count: STEPS}
"""
LOW = {"half-space": "{type: half-space, point: [0, 0.3], normal: [0, 1]}", "box": "{type: box, min: [-1, -1], max: [3, 0.3]}"}


@pytest.mark.parametrize("low", LOW.values(), ids=LOW)
@pytest.mark.parametrize("steps", [1, 4, 16])
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_between_tools(scatter, method, n, steps, low):
    text = PRESSED.replace("METHOD", method).replace("POINTS", str(n)).replace("STEPS", str(steps)).replace("LOW", low)
    assert scatter(text) < 1e-10


PRESSED_IN_SPACE = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [1.5, 1.5, 2], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0, 0.5], max: [1, 1, 1.5]}, method: METHOD, points_per_cell: 2}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
tools:
  - {name: low, shape: {type: box, min: [-1, -1, 0], max: [3, 3, 0.5]}, uz: 0.11}
  - {name: high, shape: {type: half-space, point: [0, 0, 1.5], normal: [0, 0, -1]}, uz: -0.2}
steps: {count: 4}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_between_tools_in_space(scatter, method):
    assert scatter(PRESSED_IN_SPACE.replace("METHOD", method)) < 1e-10


REVOLVED = """
version: 1
analysis: {idealisation: axisymmetric, initial_imbalance: refuse}
grid: {type: structured, origin: [0, 0], size: [3, 3], spacing: 0.5}
materials: {soil: {model: hencky, young: 1e7, poisson: 0.3, density: 2000}}
bodies:
  - {name: soil, material: soil, method: METHOD, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [3, 2]},
     initial_stress: {type: geostatic, surface: 2, k0: 0.5, surcharge: 5e4}}
surfaces: [{name: top, body: soil, part: {edge: 2}}]
boundary_conditions:
  - {name: far, nodes: {x: 3}, fix: [x]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
  - {name: surcharge, type: pressure, surface: top, pressure: 5e4, curve: [[0, 1], [1, 1]]}
steps: {count: 1}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_a_surcharge_balances_the_initial_stress_of_a_body_of_revolution(mpm, tmp_path, method):
    path, out = tmp_path / "deck.yaml", tmp_path / "out"
    path.write_text(REVOLVED.replace("METHOD", method))
    process = mpm("run", path, "--out", out)
    assert process.returncode == 0, process.stderr
    assert Results(out).summary["initial_state"]["residual"] < 1e-12


def test_a_part_that_ends_within_a_side_is_sampled_more_finely(scatter, mpm, tmp_path):
    """The force is that of the part, however its ends lie."""
    text = deck("traction").replace("{edge: 1}", "{box: {min: [1, 0], max: [1, 0.6875]}}")
    path, out = tmp_path / "deck.yaml", tmp_path / "out"
    path.write_text(text)
    process = mpm("run", path, "--out", out)
    assert process.returncode == 0, process.stderr
    assert Results(out).history["p_fx"][-1] == pytest.approx(250 * 0.6875, rel=1e-12)


WALL = """
version: 1
grid: {type: structured, origin: [-1, 0], size: [7, 3], spacing: 0.5}
materials: {soil: LAW}
bodies:
  - {name: soil, material: soil, shape: {type: box, min: [0, 0], max: [6, 2]}, points_per_cell: 2,
     initial_stress: {type: geostatic, surface: 2, k0: 0.5}}
surfaces: [{name: wall, body: soil, part: {edge: 3}}]
boundary_conditions:
  - {name: far, nodes: {x: 6}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: push, surface: wall, ux: 0.002}
loads: [{name: weight, type: gravity, acceleration: [0, -9.81]}]
analysis: {initial_imbalance: equilibrate}
steps: {count: 2}
"""

LAWS = {
    "no tension": "{model: mohr-coulomb, young: 2e7, poisson: 0.3, cohesion: 10e3, friction_angle: 30, tensile_strength: 0, "
    "density: 1800}",
    "no cohesion": "{model: mohr-coulomb, young: 2e7, poisson: 0.3, cohesion: 0, friction_angle: 30, density: 1800}",
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_condition_needs_no_stiffness_in_tension(mpm, tmp_path, law):
    path, out = tmp_path / "deck.yaml", tmp_path / "out"
    path.write_text(WALL.replace("LAW", law))
    process = mpm("run", path, "--out", out)
    assert process.returncode == 0, process.stderr
    results = Results(out)
    assert results.summary["outcome"] == "completed"
    # The wall pushes the soil to the right.
    assert results.history["push_rx"][-1] > 0


# GIMP sides may be longer than cells, after a coarse filling or a stretch.
LONG = """
version: 1
analysis: {initial_imbalance: refuse}
grid: {type: structured, origin: [0, 0], size: [2, 2], spacing: 0.2}
materials: {m: {model: hencky, young: 1e7, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, point_spacing: 0.25, shape: {type: box, min: [0, 0], max: [1, 1]},
     initial_stress: {type: components, stress: {xx: -100, yy: -100, zz: -100}}}
surfaces: [{name: whole, body: b}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: p, type: pressure, surface: whole, pressure: 100, curve: [[0, 1], [1, 1]]}]
steps: {count: 1}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_sides_longer_than_cells(scatter, method):
    assert scatter(LONG.replace("METHOD", method)) < 1e-10


# The end of a part on a line of a graded grid, on a side of a domain, and within one.
PARTLY = PLANE.replace("PART", "{box: {min: [1, 0], max: [1, END]}}").replace("SHAPE", "{type: box, min: [0, 0], max: [1, 1]}")


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
@pytest.mark.parametrize(
    ("grid", "n", "end"),
    [
        ("{type: structured, origin: [0, 0], size: [1.5, 1.5], spacing: [0.25, [{to: 1, cells: 4, ratio: 0.8}, {to: 1.5, cells: 2}]]}", 2, 0.6097560975609756),
        (EVEN, 3, 5 / 12),
        (EVEN, 2, 0.3),
    ],
    ids=["line of a graded grid", "end of a side", "within a side"],
)
def test_the_force_is_that_of_the_part(mpm, tmp_path, grid, n, end, method):
    text = PARTLY.replace("END", repr(end)).replace("GRID", grid).replace("METHOD", method)
    text = text.replace("POINTS", f"points_per_cell: {n}").replace("RULE", RULES["traction"]).replace("STEPS", "1")
    (tmp_path / "deck.yaml").write_text(text)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    force = np.asarray(Results(tmp_path / "out").history["p_fx"])[-1]
    assert abs(force - 250 * end) < 1e-9 * force


# Loads that are not linear along a side are integrated, not sampled at its centre.
@pytest.mark.parametrize(
    ("load", "force", "tolerance"),
    [
        ("{name: p, type: pressure, surface: side, hydrostatic: {level: 0.9, unit_weight: 10}}", -4.05, 1e-6),
        ('{name: p, type: traction, surface: side, traction: ["300*Y^2", 0]}', 100, 3e-3),
        ('{name: p, type: traction, surface: side, traction: ["if(Y<0.4,1,0)", 0]}', 0.4, 0.07),
    ],
    ids=["water", "parabola", "jump"],
)
def test_loads_that_vary_along_a_side(mpm, tmp_path, load, force, tolerance):
    text = deck("traction", points="points_per_cell: 1", steps=1).replace("young: 1000", "young: 1e8")
    text = text.replace(RULES["traction"], f"loads: [{load}]")
    (tmp_path / "deck.yaml").write_text(text)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    found = np.asarray(Results(tmp_path / "out").history["p_fx"])[-1]
    assert abs(found - force) < tolerance * abs(force)
