"""Decks of benches/contact.py. Words in capitals are filled in."""

import math

PATCH = """version: 1
parameters: {h: 0.2, offset: 0.1, first: cpdi2, second: cpdi2}
grid: {type: structured, origin: [0, "${-offset}"], size: [1.6, 2.2], spacing: "${h}"}
materials:
  soft: {model: hencky, young: 1e6, poisson: 0}
  stiff: {model: hencky, young: 3e6, poisson: 0}
bodies:
  - {name: lower, material: soft, method: "${first}", point_spacing: "${h/2}", shape: {type: box, min: [0, 0], max: [1, 1]}}
  - {name: upper, material: stiff, method: "${second}", point_spacing: "${h/3}", shape: {type: box, min: [0, 1], max: [1, 1.8]}}
surfaces:
  - {name: base, body: lower, part: {edge: 0}}
  - {name: top, body: upper, part: {edge: 2}}
boundary_conditions:
  - {name: base, surface: base, uy: 0}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: drag, surface: top, uy: -0.3}
contacts:
  - {between: [lower, upper]}
steps: {count: 4}
"""

MIRROR_ON_PLANE = """version: 1
parameters: {h: 0.2, method: cpdi2}
grid: {type: structured, origin: [0, -0.1], size: [3, 3], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: upper, material: rubber, method: "${method}", point_spacing: "${h/2}", shape: {type: box, min: [0.6, 1], max: [2.4, 2]}}
surfaces:
  - {name: top, body: upper, part: {edge: 2}}
boundary_conditions:
  - {name: drag, surface: top, uy: -0.15, ux: 0}
tools:
  - {name: floor, shape: {type: half-space, point: [0, 1], normal: [0, 1]}, overlap: 1e-9}
steps: {count: 4}
"""

MIRROR = """version: 1
parameters: {h: 0.2, method: cpdi2}
grid: {type: structured, origin: [0, -0.1], size: [3, 3], spacing: "${h}"}
materials:
  rubber: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: lower, material: rubber, method: "${method}", point_spacing: "${h/2}", shape: {type: box, min: [0.6, 0], max: [2.4, 1]}}
  - {name: upper, material: rubber, method: "${method}", point_spacing: "${h/2}", shape: {type: box, min: [0.6, 1], max: [2.4, 2]}}
surfaces:
  - {name: base, body: lower, part: {edge: 0}}
  - {name: top, body: upper, part: {edge: 2}}
boundary_conditions:
  - {name: base, surface: base, uy: 0.15, ux: 0}
  - {name: drag, surface: top, uy: -0.15, ux: 0}
contacts:
  - {between: [lower, upper]}
steps: {count: 4}
"""

CYLINDERS = """version: 1
grid: {type: structured, origin: [LEFT, DEPTH], size: [WIDTH, HEIGHT], spacing: [COLUMNS, ROWS]}
materials:
  a: {model: hencky, young: E_L, poisson: NU_L}
  b: {model: hencky, young: E_U, poisson: NU_U}
bodies:
  - {name: lower, material: a, method: cpdi2, points_per_cell: 2, shape: {type: polygon, vertices: [LOWER]}}
  - {name: upper, material: b, method: cpdi2, points_per_cell: 2, shape: {type: polygon, vertices: [UPPER]}}
surfaces:
  - {name: base, body: lower, part: {edge: BASE}}
  - {name: top, body: upper, part: {edge: TOP}}
output: {every: 100}
"""

HERTZ = CYLINDERS + """boundary_conditions:
  - {name: base, nodes: {y: DEPTH}, fix: [y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads:
  - {name: press, type: traction, surface: top, traction: [0, -PRESSURE]}
contacts:
  - {between: [FIRST, SECOND]}
steps: {count: 4}
"""

CATTANEO = CYLINDERS + """boundary_conditions:
  - {name: base, surface: base, ux: 0, uy: 0}
  - {name: hold, surface: top, uy: -0.0022, curve: [[0, 0], [0.4, 1], [1, 1]]}
  - {name: shear, surface: top, ux: 0.0010, curve: [[0, 0], [0.4, 0], [1, 1]]}
contacts:
  - {between: [FIRST, SECOND], friction: 0.3}
steps: {count: 10}
"""

SLOPE = """version: 1
parameters: {h: 0.25, mu: 0.3, method: cpdi2, ratio: 0.99, g: 9.81}
grid: {type: structured, origin: [0, -0.5], size: [6, 3], spacing: "${h}"}
materials:
  rock: {model: hencky, young: 100e6, poisson: 0.3}
  soil: {model: hencky, young: 1e6, poisson: 0.3, density: 1000}
bodies:
  - {name: lower, material: rock, method: "${method}", point_spacing: "${h/2}", shape: {type: box, min: [0, -0.4], max: [6, 0.6]}}
  - {name: upper, material: soil, method: "${method}", point_spacing: "${h/3}", shape: {type: box, min: [2, 0.6], max: [4, 1.6]}}
surfaces:
  - {name: base, body: lower, part: {edge: 0}}
boundary_conditions:
  - {name: base, surface: base, ux: 0, uy: 0}
loads:
  - {name: weight, type: body-force, bodies: [upper], per: mass, force: [0, "${-g}"], curve: [[0, 0], [0.2, 1], [1, 1]]}
  - {name: along, type: body-force, bodies: [upper], per: mass, force: ["${g*mu*ratio}", 0], curve: [[0, 0], [0.2, 0], [1, 1]]}
contacts:
  - {between: [upper, lower], friction: "${mu}"}
steps: {count: 5}
"""

DRAG = """version: 1
parameters: {h: 0.25, mu: 0.3, method: cpdi2}
grid: {type: structured, origin: [0, 0], size: [6, 3], spacing: "${h}"}
materials:
  stiff: {model: hencky, young: 100e6, poisson: 0.3}
  soft: {model: hencky, young: 1e6, poisson: 0.3}
bodies:
  - {name: lower, material: stiff, method: "${method}", points_per_cell: 3, shape: {type: box, min: [0, 0], max: [6, 1]}}
  - {name: upper, material: soft, method: "${method}", points_per_cell: 3, shape: {type: box, min: [2, 1], max: [4, 2]}}
surfaces:
  - {name: top, body: upper, part: {edge: 2}}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: drag, surface: top, ux: 0.3, curve: [[0, 0], [0.2, 0], [1, 1]]}
loads:
  - {name: press, type: traction, surface: top, traction: [0, -20e3], curve: [[0, 0], [0.2, 1], [1, 1]]}
contacts:
  - {between: [upper, lower], friction: "${mu}"}
steps: {count: 20}
"""


def punch(shape):
    """Corners of a punch of half width 0.5 whose lowest point is (2, 2), and the number of its top side."""
    top = [(2.5, 3.0), (1.5, 3.0)]
    if shape == "box":
        return [(1.5, 2.0), (2.5, 2.0), *top], 2
    angles = [math.pi * (1 + k / 16) for k in range(17)]
    return [(2 + 0.5 * math.cos(a), 2.5 + 0.5 * math.sin(a)) for a in angles] + top, 17


GROUND = """version: 1
parameters: {h: 0.125, friction: 0.3}
grid: {type: structured, origin: [0, 0], size: [4, 3.5], spacing: "${h}"}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
"""

SOFT = "  - {name: soft, material: soft, method: cpdi2, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [4, 2]}}\n"

PUNCH = {
    "tool": GROUND + "bodies:\n" + SOFT + """materials:
  soft: {model: hencky, young: 1e6, poisson: 0.3}
tools:
  - {name: punch, shape: {type: polygon, vertices: [PUNCH]}, uy: -0.4, friction: "${friction}"}
steps: {count: 20}
""",
    "body": GROUND + """  - {name: drive, surface: top, ux: 0, uy: -0.4}
bodies:
""" + SOFT + """  - {name: punch, material: stiff, method: cpdi2, point_spacing: "${h/2}", shape: {type: polygon, vertices: [PUNCH]}}
materials:
  soft: {model: hencky, young: 1e6, poisson: 0.3}
  stiff: {model: hencky, young: 1e11, poisson: 0.3}
surfaces:
  - {name: top, body: punch, part: {edge: TOP}}
contacts:
  - {between: [soft, punch], friction: "${friction}"}
steps: {count: 20}
""",
}
