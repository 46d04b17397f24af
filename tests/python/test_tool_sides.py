"""Tools touch the outer sides of domains: areas, adhesion, uniform stresses, and what the shape of a tool is given by."""

import random

import numpy as np
import pytest

from results import Results


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, files=(), name="run"):
        for file, content in files:
            (tmp_path / file).write_text(content)
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


# A stiff block that its weight presses onto an adhesive base, which is then drawn along under it.
FLAT = """
version: 1
grid: {type: structured, origin: [0, 0], size: [6, 3], spacing: 0.5}
materials: {m: {model: hencky, young: 1e9, poisson: 0.2, density: 2.5}}
bodies: [{name: b, material: m, shape: {type: box, min: [1, 1], max: [5, 2]}, method: METHOD, points_per_cell: N}]
loads: [{name: g, type: gravity, acceleration: [0, -10], curve: [[0, 0], [1, 1], [3, 1]]}]
boundary_conditions: [{name: held, nodes: {x: 1}, fix: [x]}]
tools:
  - {name: base, shape: {type: half-space, point: [0, 1], normal: [0, 1]}, ux: 0.02, curve: [[0, 0], [1, 0], [3, 1]],
     adhesion: 2.5}
steps: {count: 15, end_time: 3}
"""


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("method", ["mpm", "gimp", "cpdi1", "cpdi2"])
def test_adhesion_acts_on_the_whole_base(run, method, n):
    results = run(FLAT.replace("METHOD", method).replace("N}", f"{n}}}"))
    force, area = last(results, "base_fx"), areas(results).sum()
    assert abs(area - 4) < 1e-6
    assert abs(force - 2.5 * area) < 1e-10 * force


# A block held at its upper side, against which an adhesive base is pressed and then drawn along. The staircase of its boxes
# touches the base with some of its corners only.
INCLINED = """
version: 1
grid: {type: structured, origin: [0, 0], size: [7, 7], spacing: 0.25}
materials: {m: {model: hencky, young: 1e6, poisson: 0.2}}
bodies: [{name: b, material: m, shape: {type: polygon, vertices: VERTICES}, method: gimp, points_per_cell: 2}]
surfaces: [{name: top, body: b, part: {edge: 2}}]
boundary_conditions: [{name: held, surface: top, ux: 0, uy: 0}]
tools:
  - {name: base, shape: {type: half-space, point: BASE, normal: NORMAL}, ux: "UX*max(factor-1,0)+VX*min(factor,1)",
     uy: "UY*max(factor-1,0)+VY*min(factor,1)", curve: [[0, 0], [3, 3]], adhesion: 2.5}
steps: {count: 30, end_time: 3}
"""


@pytest.mark.parametrize("angle", [20, 45, 60])
def test_adhesion_acts_on_a_staircase(run, angle):
    turn = np.radians(angle)
    along, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    start = np.array([2.2, 0.6])
    vertices = [start, start + 4 * along, start + 4 * along + up, start + up]
    # The corners of the boxes reach beyond the line by up to half of their diagonal.
    spacing = 0.125
    base = start - 0.5 * spacing * (abs(along[0]) + abs(along[1])) * up
    text = INCLINED.replace("VERTICES", str([list(map(float, v)) for v in vertices]))
    for name, value in [("BASE", base), ("NORMAL", up)]:
        text = text.replace(name, str(list(map(float, value))))
    text = text.replace("VX", repr(float(0.2 * up[0]))).replace("VY", repr(float(0.2 * up[1])))
    text = text.replace("UX", repr(float(0.05 * along[0]))).replace("UY", repr(float(0.05 * along[1])))
    area = areas(run(text)).sum()
    # The staircase ends within a box of the end of the side.
    assert abs(area - 4) < 0.25, area


# A block of neo-Hookean material between two smooth plates: the stress is uniform.
BETWEEN = """
version: 1
grid: GRID
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0], max: [1, 1.2]}, method: METHOD, POINTS}]
boundary_conditions: [{name: left, nodes: {x: 0}, fix: [x]}, {name: base, nodes: {y: 0}, fix: [y]}]
tools:
  - {name: plate, shape: {type: half-space, point: [0, 1.2], normal: [0, -1]}, uy: -0.21}
steps: {count: STEPS}
"""
EVEN = "{type: structured, origin: [0, 0], size: [1.75, 1.75], spacing: 0.25}"
OTHER = "{type: structured, origin: [0, 0], size: [1.8, 2.1], spacing: [0.2, 0.3]}"


@pytest.mark.parametrize("steps", [1, 4, 16])
@pytest.mark.parametrize(
    ("grid", "points"), [(OTHER, "points_per_cell: 2"), (OTHER, "points_per_cell: 3"), (EVEN, "point_spacing: [0.1, 0.15]")]
)
@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_a_plate_leaves_a_uniform_stress(run, method, grid, points, steps):
    text = BETWEEN.replace("METHOD", method).replace("GRID", grid).replace("POINTS", points)
    stress = np.asarray(run(text.replace("STEPS", str(steps))).mesh("points", -1)["cauchy_stress"])
    scatter = np.abs(stress - stress.mean(axis=0)).max() / np.abs(stress).max()
    # A single step ends when the gaps, not the forces, meet the tolerance of contact.
    assert scatter < (1e-5 if steps == 1 else 1e-9)


# A square punch without friction in the middle of a symmetric block.
PUNCH = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [4, 4, 2.5], spacing: 0.5}
materials: {m: {model: hencky, young: 1e6, poisson: 0.2}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0, 0], max: [4, 4, 1]}, method: gimp, points_per_cell: 2}]
boundary_conditions: [{name: base, nodes: {z: 0}, fix: [x, y, z]}]
tools: [{name: t, shape: SHAPE, uz: -0.05}]
steps: {count: 1}
"""
CORNERS = [(x, y, z) for z in (1, 2) for y in (1.5, 2.5) for x in (1.5, 2.5)]
FACETS = [
    (0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
    (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5),
]  # fmt: skip


def stl(facets):
    def facet(corners):
        lines = "".join("  vertex {} {} {}\n".format(*CORNERS[k]) for k in corners)
        return f"facet normal 0 0 0\nouter loop\n{lines}endloop\nendfacet\n"

    return "solid punch\n" + "".join(map(facet, facets)) + "endsolid punch\n"


def test_the_same_punch_however_it_is_given(run):
    square = "[[1.5, 1.5], [2.5, 1.5], [2.5, 2.5], [1.5, 2.5]]"
    shapes = {
        "box": "{type: box, min: [1.5, 1.5, 1], max: [2.5, 2.5, 2]}",
        "extrusion": f"{{type: extrusion, polygon: {square}, axis: z, from: 1, to: 2}}",
    }
    generator = random.Random(57)
    files = []
    for number in range(10):
        facets = [tuple(f[k:] + f[:k]) for f in FACETS for k in [generator.randrange(3)]]
        generator.shuffle(facets)
        files.append((f"punch_{number}.stl", stl(facets)))
        shapes[f"stl {number}"] = f"{{type: stl, file: punch_{number}.stl}}"
    forces = {}
    for name, shape in shapes.items():
        results = run(PUNCH.replace("SHAPE", shape), files, name.replace(" ", "_"))
        forces[name] = np.array([last(results, f"t_f{axis}") for axis in "xyz"])
    box = forces["box"]
    assert box[2] < -1e5
    for name, force in forces.items():
        assert np.abs(force - box).max() < 1e-9 * abs(box[2]), (name, force, box)
        assert np.abs(force[:2]).max() < 1e-9 * abs(box[2]), (name, force)


# A block in a re-entrant corner, carried along.
CORNER = """
version: 1
grid: {type: structured, origin: [0, -0.5], size: [5, 2.5], spacing: 0.25}
materials: {m: {model: hencky, young: 1e5, poisson: 0.3, density: 100}}
bodies:
  - {name: fill, material: m, shape: {type: box, min: [1, 0], max: [2, 1]}, method: METHOD, points_per_cell: 2,
     strain: mean-dilatation}
tools: TOOLS
loads: [{name: w, type: gravity, acceleration: [0, -10], curve: [[0, 0], [0.2, 1], [1, 1]]}]
steps: {count: 40}
"""
MOTION = 'friction: 0, ux: "1*max(0, time - 0.2)/0.8"'
POLYGON = "[[0.75, -0.25], [4.25, -0.25], [4.25, 0], [1, 0], [1, 1.5], [0.75, 1.5]]"


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_a_re_entrant_corner_is_two_tools(run, method):
    text = CORNER.replace("METHOD", method)
    one = run(text.replace("TOOLS", f"[{{name: box, shape: {{type: polygon, vertices: {POLYGON}}}, {MOTION}}}]"))
    boxes = "".join(
        f"\n  - {{name: {name}, shape: {{type: box, min: [0.75, -0.25], max: {far}}}, {MOTION}}}"
        for name, far in [("floor", "[4.25, 0]"), ("wall", "[1, 1.5]")]
    )
    two = run(text.replace("TOOLS", boxes), name="two")
    for axis in "xy":
        force = last(one, f"box_f{axis}")
        assert abs(force - last(two, f"floor_f{axis}") - last(two, f"wall_f{axis}")) < 1e-6 * 1000
    assert abs(last(one, "strain_energy") / last(two, "strain_energy") - 1) < 1e-5
    a, b = [np.asarray(results.mesh("points", -1)["cauchy_stress"]) for results in (one, two)]
    # The largest gap that is left counts over all faces of a tool.
    assert np.abs(a - b).max() < 3e-4 * np.abs(a).max()


# A heavy block with sharp edges slides over flat, stiff ground.
SLIDING = """
version: 1
grid: {type: structured, origin: [0, 0], size: [8, 4], spacing: H}
materials: {rock: {model: hencky, young: 100e6, poisson: 0.2}}
bodies: [{name: ground, material: rock, method: METHOD, points_per_cell: 3, shape: {type: box, min: [0, 0], max: [8, 2]}}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 8}, fix: [x]}
tools:
  - {name: block, shape: {type: box, min: [1.5, 2], max: [3.5, 3]}, free: FREE, ux: WAY, curve: [[0, 0], [0.1, 0], [1, 1]],
     loads: [{force: [0, -20e3], curve: [[0, 0], [0.1, 1], [1, 1]]}], friction: 0.5}
steps: {count: 40}
output: {every: 0}
"""


@pytest.mark.parametrize(
    ("method", "h", "free", "way"),
    [("cpdi2", 0.25, "[y]", 0.3), ("gimp", 0.5, "[y, rotation]", 0.6)],
    ids=["upright", "free to turn"],
)
def test_a_sharp_block_slides_over_flat_ground(run, method, h, free, way):
    """It does not plough: the horizontal force is that of friction."""
    text = SLIDING.replace("H}", f"{h}}}").replace("METHOD", method).replace("FREE", free).replace("WAY", str(way))
    history = run(text).history
    slides = history["block_ux"] > 0.01
    ratio = -history["block_fx"][slides] / history["block_fy"][slides]
    assert history["block_fy"] == pytest.approx(-20e3 * np.minimum(history["time"] / 0.1, 1), rel=1e-8)
    assert ratio.max() <= 0.5 + 1e-9 and ratio.min() > (0.4995 if "rotation" in free else 0.5 - 1e-9)
