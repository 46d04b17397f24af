"""Decks of the studies in `tools.py`, which replaces the words in capitals; `--set` sets the parameters."""

import math

import locking

# A cube on rollers, compressed to three quarters of its height by a smooth plate.
PLATEN = """
version: 1
parameters: {h: 0.1, n: 2, method: gimp, steps: 20, to: 0.2}
grid: {type: structured, origin: [0, 0], size: [1.2, 1.2], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0}
bodies:
  - {name: cube, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [0.8, 0.8]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
tools:
  - {name: platen, shape: {SHAPE}, uy: "${-to}"}
steps: {count: "${steps}"}
output: {every: "${steps}", fields: [cauchy_stress]}
"""
PLATEN_IN_SPACE = """
version: 1
parameters: {h: 0.2, n: 2, method: gimp, steps: 20, to: 0.2}
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [1.2, 1.2, 1.2], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0}
bodies:
  - {name: cube, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0, 0], max: [0.8, 0.8, 0.8]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: floor, nodes: {z: 0}, fix: [z]}
tools:
  - {name: platen, shape: {SHAPE}, uz: "${-to}"}
steps: {count: "${steps}"}
output: {every: "${steps}", fields: [cauchy_stress]}
"""
HALF_SPACE = {2: "type: half-space, point: [0, 0.8], normal: [0, -1]",
              3: "type: half-space, point: [0, 0, 0.8], normal: [0, 0, -1]"}
BOX = {2: "type: box, min: [-1, 0.8], max: [2, 1.1]", 3: "type: box, min: [-1, -1, 0.8], max: [2, 2, 1.1]"}

# A circle of radius 1, or a body of revolution that it generates, under a load on a block of side 1/2; a symmetry plane
# or the axis halves it. The grid widens from the place of contact.
HERTZ = """
version: 1
parameters: {n: 2, method: gimp, idealisation: plane-strain, load: 1, steps: 2}
analysis: {idealisation: "${idealisation}"}
grid: {type: structured, origin: [0, 0], size: [SIDE, TOP], spacing: [[COLUMNS], [ROWS]]}
materials:
  steel: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: block, material: steel, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [SIDE, SIDE]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: SIDE}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
tools:
  - {name: ball, shape: {type: circle, center: [0, CENTRE], radius: 1}, free: [y], loads: [{force: [0, "${-load}"]}]}
solver: {max_iterations: 40}
steps: {count: "${steps}"}
output: {every: "${steps}", fields: [cauchy_stress]}
"""
# A quarter of a sphere on a block.
HERTZ_IN_SPACE = """
version: 1
parameters: {n: 2, method: gimp, load: 1, steps: 2}
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [SIDE, SIDE, TOP], spacing: [[COLUMNS], [COLUMNS], [ROWS]]}
materials:
  steel: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: block, material: steel, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0, 0], max: [SIDE, SIDE, SIDE]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: right, nodes: {x: SIDE}, fix: [x]}
  - {name: rear, nodes: {y: SIDE}, fix: [y]}
  - {name: floor, nodes: {z: 0}, fix: [z]}
tools:
  - {name: ball, shape: {type: sphere, center: [0, 0, CENTRE], radius: 1}, free: [z], loads: [{force: [0, 0, "${-load}"]}]}
solver: {max_iterations: 40}
steps: {count: "${steps}"}
output: {every: "${steps}", fields: [cauchy_stress]}
"""

# A block on a plane with friction. Gravity is tilted in place of the plane, by the ratio of its components; or its
# component along the plane follows from the displacement of the block.
SLOPE = """
version: 1
parameters: {h: 0.125, n: 2, method: gimp, mu: 0.3, steps: 10, tangent: 1}
grid: {type: structured, origin: [-0.5, -0.25], size: [2, 1], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3, density: 1000}
bodies:
  - {name: block, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [1, 0.25]}}
tools:
  - {name: plane, shape: {type: half-space, point: [0, 0], normal: [0, 1]}, friction: "${mu}"}
loads:
  - {name: across, type: gravity, acceleration: [0, -10]}
  - {name: along, type: gravity, acceleration: ["${10*tangent}", 0]}
STEPS
output: {every: 0, probes: [{name: middle, body: block, nearest: [0.5, 0.125], count: 4}]}
"""
TILTED = 'steps: {count: "${steps}"}'
SLIDING = """stages:
  - {name: rest, steps: {count: 1}, factors: {across: 1}}
  - name: slide
    steps: {count: "${steps}", control: {type: displacement, probe: middle, axis: x, to: 0.02}}
    factors: {along: 1}"""

# A block between a floor with friction and a rough plate, which presses it and then drags it along.
DRAGGED = """
version: 1
parameters: {h: 0.125, n: 2, method: gimp, mu: 0.2, steps: 10}
grid: {type: structured, origin: [-0.5, -0.25], size: [2, 1], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: block, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [1, 0.25]}}
tools:
  - {name: floor, shape: {type: half-space, point: [0, 0], normal: [0, 1]}, friction: "${mu}"}
  - {name: top, shape: {type: half-space, point: [0, 0.25], normal: [0, -1]}, friction: rough,
     uy: "-0.005 * min(time, 1)", ux: "0.02 * max(time - 1, 0)"}
solver: {max_iterations: 40}
steps: {count: "${steps}", end_time: 2}
output: {every: 0}
"""

# A circle of radius 1/2, pressed into a slab until time 1, and then moved along it or turned.
CYLINDER = """
version: 1
parameters: {h: 0.0625, n: 2, method: gimp, mu: 0.3, steps: 20}
grid: {type: structured, origin: [0, 0], size: [3, 1.25], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: slab, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [3, 1]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 3}, fix: [x]}
tools:
  - {name: roller, shape: {type: circle, center: [1, 1.5], radius: 0.5}, friction: "${mu}",
     uy: "-0.02 * min(time, 1)", MOTION}
solver: {max_iterations: 40}
steps: {count: "${steps}", end_time: 2}
output: {every: "${steps}", fields: [cauchy_stress]}
"""
MOTIONS = {
    "slid by 0.2": 'ux: "0.2 * max(time - 1, 0)"',
    "turned by 10°": 'rotation: "10 * max(time - 1, 0)"',
    "rolled by 0.2, turned by 0.2/R": f'ux: "0.2 * max(time - 1, 0)", rotation: "{-math.degrees(0.4)!r} * max(time - 1, 0)"',
    "rolled by 0.2, free to turn": 'ux: "0.2 * max(time - 1, 0)", free: [rotation]',
}

# A circle of radius 1 that carries a load, pressed onto a slab without change of volume until time 1, and then rolled along it
# by `way`; the grid is fine along the way.
ROLLING = """
version: 1
parameters: {n: 2, method: gimp, mu: 0.3, load: 1, way: 1, turn: 0, steps: 40}
grid: {type: structured, origin: [LEFT, -SIDE], size: [WIDTH, HEIGHT], spacing: [[COLUMNS], [ROWS]]}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.4999}
bodies:
  - {name: slab, material: rubber, method: "${method}", points_per_cell: "${n}", strain: mean-dilatation,
     shape: {type: box, min: [LEFT, -SIDE], max: [RIGHT, 0]}}
boundary_conditions:
  - {name: left, nodes: {x: LEFT}, fix: [x]}
  - {name: right, nodes: {x: RIGHT}, fix: [x]}
  - {name: base, nodes: {y: -SIDE}, fix: [x, y]}
tools:
  - {name: roller, shape: {type: circle, center: [0, 1], radius: 1}, friction: "${mu}", ux: "${way} * max(time - 1, 0)",
     ROTATION, loads: [{force: [0, "${-load}"], curve: [[0, 0], [1, 1], [2, 1]]}]}
solver: {max_iterations: 40}
stages:
  - {name: press, steps: {count: 4, end_time: 1}}
  - {name: roll, steps: {count: "${steps}", end_time: 1}}
output: {every: 0}
"""
FREE_TO_TURN = "free: [y, rotation]"
TURNED = 'free: [y], rotation: "${-turn} * max(time - 1, 0)"'

# The ground under a strip footing of half width 1 of `locking.py`, with a tool or with the displacements of nodes.
GROUND = locking.GROUND.rstrip("\n").replace("every: 0}", "half: 1}")
TOOL = """
tools:
  - {name: footing, shape: {type: box, min: [-1, 3], max: ["${half}", 3.5]}, uy: "${-to}", friction: FRICTION}
steps: {count: "${steps}"}
output: {every: 0}
"""


def strip(by_tool, rough):
    """A strip footing, as a tool or held by nodes."""
    if by_tool:
        return GROUND + TOOL.replace("FRICTION", "rough" if rough else "0")
    return locking.GROUND.rstrip("\n") + locking.NODES.replace("FIX ", locking.ROUGH if rough else "")


CLAY = "clay: {model: von-mises, young: 1e8, poisson: 0.49, deviatoric_yield_stress: \"${sqrt(2)*1000}\"}"
ELASTIC = "clay: {model: hencky, young: 1e8, poisson: 0.3}"


def elastic(deck):
    """The deck with elastic ground."""
    assert deck.count(CLAY) == 1
    return deck.replace(CLAY, ELASTIC)


# A layer under a plate, a tool or held by nodes. Five cells high, a tenth of the points touch the plate; ten cells high, a
# tenth of them have candidates.
LAYER = """
version: 1
parameters: {method: gimp, n: 2, steps: 20, cells: 400, high: 5}
grid: {type: structured, origin: [0, 0], size: ["${cells}", "${high+2}"], spacing: 1}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: layer, material: rubber, method: "${method}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: ["${cells}", "${high}"]}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: "${cells}"}, fix: [x]}
PLATE
steps: {count: "${steps}"}
output: {every: 0}
"""
PLATE_AS_TOOL = 'tools: [{name: plate, shape: {type: half-space, point: [0, "${high}"], normal: [0, -1]}, uy: -0.02, friction: FRICTION}]'
PLATE_BY_NODES = '  - {name: plate, nodes: {box: {min: [0, "${high}"], max: ["${cells}", "${high}"]}}, FIXuy: -0.02}'

# Half of a ring of clay around a pipe of radius 1, on a mesh whose inner nodes lie on the pipe. The pipe sinks so little
# that shapes stay as they are.
PIPE = """
version: 1
parameters: {method: cpdi2, volumetric: mean-dilatation, steps: 12, to: 6e-5, friction: 0, adhesion: 0, penalty: 100}
grid: {type: gmsh, file: MESH}
materials:
  clay: {model: tresca, young: 1e9, poisson: 0.49, cohesion: 1e3}
bodies:
  - {name: clay, material: clay, method: "${method}", strain: "${volumetric}", POINTS: 1,
     shape: {type: cells, group: clay}}
boundary_conditions:
  - {name: axis, nodes: {group: axis}, fix: [x]}
  - {name: outside, nodes: {group: outside}, fix: [x, y]}
tools:
  - {name: pipe, shape: {type: circle, center: [0, 0], radius: 1}, uy: "${-to}", friction: "${friction}",
     adhesion: "${adhesion}", tension_cut_off: 1e9, penalty: "${penalty}"}
steps: {count: "${steps}"}
output: {every: 0}
"""


def ring(across, outer, triangles=True):
    """A mesh of half a ring of radii 1 and `outer`, in gmsh's format 2.2: `across` cells along a half circle, and layers of
    cells as high as they are wide."""
    layers = round(math.log(outer) / math.log(1 + math.pi / across))
    radii = [outer ** (i / layers) for i in range(layers + 1)]
    angles = [math.pi * (j / across - 0.5) for j in range(across + 1)]
    nodes = [(r * math.cos(t) if 0 < j < across else 0.0, r * math.sin(t)) for r in radii for j, t in enumerate(angles)]
    node = lambda i, j: i * (across + 1) + j + 1
    elements = [f"1 2 1 1 {node(i, j)} {node(i + 1, j)}" for j in (0, across) for i in range(layers)]
    elements += [f"1 2 2 2 {node(layers, j)} {node(layers, j + 1)}" for j in range(across)]
    for i in range(layers):
        for j in range(across):
            a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
            if not triangles:
                elements.append(f"3 2 3 3 {a} {b} {c} {d}")
            elif (i + j) % 2:
                elements += [f"2 2 3 3 {a} {b} {c}", f"2 2 3 3 {a} {c} {d}"]
            else:
                elements += [f"2 2 3 3 {a} {b} {d}", f"2 2 3 3 {b} {c} {d}"]
    numbered = lambda lines: [f"{len(lines)}", *(f"{k} {line}" for k, line in enumerate(lines, 1))]
    return "\n".join(["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "3", '1 1 "axis"', '1 2 "outside"',
                      '2 3 "clay"', "$EndPhysicalNames", "$Nodes", *numbered([f"{x!r} {y!r} 0" for x, y in nodes]),
                      "$EndNodes", "$Elements", *numbered(elements), "$EndElements", ""])
