"""Decks of the studies in `soils.py`, which replaces the words in capitals; `--set` sets the parameters."""

from pathlib import Path

# Half of the ground under a strip of half width 1, which a uniform pressure presses down; the grid widens beyond the strip.
STRIP = """
version: 1
parameters: {n: 2, method: mpm, volumetric: mean-dilatation, steps: 12, to: 0.001, young: 1e9,
             cohesion: 1e3, phi: 20, psi: 20}
analysis: {initial_imbalance: equilibrate}    # samples of the surcharge cross lines of the graded grid
grid: {type: structured, origin: [0, 0], size: [WIDTH, HEIGHT], spacing: [[COLUMNS], [ROWS]]}
materials:
  soil: {model: mohr-coulomb, young: "${young}", poisson: 0.3, cohesion: "${cohesion}", friction_angle: "${phi}",
         dilation_angle: "${psi}"}
bodies:
  - {name: soil, material: soil, shape: {type: box, min: [0, 0], max: [WIDTH, DEPTH]}, method: "${method}",
     points_per_cell: "${n}", strain: "${volumetric}" INITIAL}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: WIDTH}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
FRICTION
surfaces:
  - {name: strip, body: soil, part: {box: {min: [0, BELOW], max: [1, ABOVE]}}}
  - {name: crest, body: soil, part: {box: {min: [0, BELOW], max: [WIDTH, ABOVE]}}}
loads:
  - {name: strip, type: traction, surface: strip, traction: [0, -1000]}
SURCHARGE
stages:
  - {name: rest, steps: {count: 1}}
  - name: push
    steps: {count: "${steps}", control: {type: displacement, probe: middle, axis: y, to: "${-to}"}}
    factors: {strip: 1}
output: {every: 0, probes: [{name: middle, body: soil, nearest: [0, DEPTH]}]}
"""
ROUGH = "  - {name: friction, nodes: {box: {min: [0, DEPTH], max: [1, DEPTH]}}, fix: [x]}"
SURCHARGE = "  - {name: surcharge, type: traction, surface: crest, traction: [0, -1000], curve: [[0, 1], [2, 1]]}"
INITIAL = ", initial_stress: {type: components, stress: {xx: -1000, yy: -1000, zz: -1000}}"


def changed_input(name, **changes):
    """A deck of the inputs, in which each of these words is replaced by another."""
    text = (Path(__file__).resolve().parents[1] / "inputs" / name).read_text()
    for word, other in changes.values():
        assert text.count(word) == 1, f"{name} must have one {word!r}"
        text = text.replace(word, other)
    return text


# Example 1 of Griffiths and Lane (1999).
SLOPE = changed_input(
    "slope.yaml",
    method=("method: gimp", 'method: "${method}"'),
    volumetric=("strain: mean-dilatation", 'strain: "${volumetric}"'),
    steps=("count: 6", 'count: "${steps}"'),
    tolerance=("tolerance: 0.005", "tolerance: 0.002"),
    output=("every: 2 ", "every: 0 "),
    parameters=("parameters:", "parameters:\n  method: gimp\n  volumetric: mean-dilatation\n  steps: 60"),
)
# Examples 3 and 4 of the same paper: an undrained slope on a foundation as deep as the slope is high, of another strength
# where REGION holds.
CLAY_SLOPE = """
version: 1
parameters: {h: 1, n: 2, method: mpm, volumetric: mean-dilatation, ratio: 1, to: 2.4, steps: 70}
grid: {type: structured, origin: [0, 0], size: [60, 22], spacing: "${h}"}
materials:
  clay: {model: tresca, young: 5e9, poisson: 0.3, cohesion: "if(REGION, ratio, 1) * 50e3", density: 2000}
bodies:
  - {name: slope, material: clay, method: "${method}", points_per_cell: "${n}", strain: "${volumetric}",
     shape: {type: polygon, vertices: [[0, 0], [60, 0], [60, 10], [40, 10], [20, 20], [0, 20]]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 60}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
stages:
  - {name: gravity, steps: {count: 5}, factors: {weight: 1}, then: {reset: [displacement]}}
  - name: safety
    steps: {count: "${steps}", control: {type: strength-reduction, to: "${to}", tolerance: 0.002, after_slide: continue}}
output: {every: 0, probes: [{name: crest, body: slope, nearest: [20, 20]}]}
"""
FOUNDATION = "Y < 10"
# The layer between the lines (6, 20), (38, 4), (48, 4), (54, 10) and (8, 20), (36, 6), (48, 6), (52, 10): parallel to the
# slope, horizontal at mid-depth of the foundation, and at 45 degrees beyond the toe, 0.2 H wide along the ground.
WEAK_LAYER = "(Y >= max(23 - X/2, max(4, X - 44))) * (Y < max(24 - X/2, max(6, X - 42)))"

# A vertical cut of height 1 in deep clay with c = 1 and the unit weight 2.5, so that the factor of safety is 3.776/2.5.
CUT = """
version: 1
parameters: {h: 0.25, n: 2, method: mpm, volumetric: mean-dilatation, to: 2, steps: 50, young: 1e6}
grid: {type: structured, origin: [0, 0], size: [3.5, 2.5], spacing: "${h}"}
materials:
  clay: {model: tresca, young: "${young}", poisson: 0.49, cohesion: 1, density: 1 SOFTENING}
bodies:
  - {name: soil, material: clay, method: "${method}", points_per_cell: "${n}", strain: "${volumetric}",
     shape: {type: polygon, vertices: [[0, 0], [3.5, 0], [3.5, 1], [2, 1], [2, 2], [0, 2]]}}
boundary_conditions:
  - {name: back, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {x: 3.5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, WEIGHT]}
STEPS
output: {every: 0, probes: [{name: crest, body: soil, nearest: [2, 2]}]}
"""
REDUCTION = """stages:
  - {name: gravity, steps: {count: 2}, factors: {weight: 1}, then: {reset: [displacement]}}
  - name: safety
    steps: {count: "${steps}", control: {type: strength-reduction, to: "${to}", tolerance: 0.001, after_slide: continue}}"""
SETTLEMENT = 'steps: {count: "${steps}", control: {type: displacement, probe: crest, axis: y, to: "${-to}"}}'
SOFTENING = ", softening: {strain: 0.4, residual_cohesion: 0.5 BAND}"

# A thick-walled cylinder, inner radius 1 and outer radius 3, widened by a pressure that follows its inner surface.
CYLINDER = """
version: 1
parameters: {h: 0.125, n: 2, method: cpdi2, volumetric: mean-dilatation, steps: 20, to: 0.5, phi: 30, psi: 0}
analysis: {idealisation: axisymmetric}
grid: {type: structured, origin: [0, 0], size: [4, "${h}"], spacing: "${h}"}
materials:
  soil: {MODEL, young: 1e7, poisson: 0.3, cohesion: 1e3}
bodies:
  - {name: wall, material: soil, shape: {type: box, min: [1, 0], max: [3, "${h}"]}, method: "${method}",
     points_per_cell: "${n}", strain: "${volumetric}"}
boundary_conditions:
  - {name: ends, nodes: {box: {min: [0, 0], max: [4, "${h}"]}}, fix: [y]}
surfaces:
  - {name: inside, body: wall, part: {edge: 3}}
loads:
  - {name: inside, type: pressure, surface: inside, pressure: 1000}
steps: {count: "${steps}", control: {type: displacement, probe: inside, axis: x, to: "${to}"}}
output: {every: 0, probes: [{name: inside, body: wall, nearest: [1, 0]}]}
"""

CAM_CLAY = """materials:
  clay: {model: modified-cam-clay, compression_index: 0.09, swelling_index: 0.018, critical_state_ratio: 1.05,
         shear_modulus: 2e6, shear_modulus_ratio: 10, overconsolidation_ratio: "${ocr}", reference_pressure: 100e3}"""

# A block of Cam-clay between smooth walls; the grid follows the plates that compress it.
BLOCK = """
version: 1
parameters: {n: 2, method: mpm, volumetric: mean-dilatation, steps: 20, to: 0.2, lateral: 0, ocr: 1.5, k0: 0.6,
             idealisation: plane-strain}
analysis: {idealisation: "${idealisation}"}
grid:
  type: structured
  origin: [0, 0]
  size: [1.5, 1.5]
  spacing: 0.25
  follow:
    - {axis: x, from: 1, condition: right}
    - {axis: y, from: 1, condition: top}
MATERIAL
bodies:
  - {name: block, material: clay, shape: {type: box, min: [0, 0], max: [1, 1]}, method: "${method}",
     points_per_cell: "${n}", strain: "${volumetric}",
     initial_stress: {type: components, stress: {xx: -60e3, yy: "${-60e3/k0}", zz: -60e3}}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 1}, ux: "${-lateral}"}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: top, nodes: {y: 1}, uy: "${-to}"}
steps: {count: "${steps}"}
output: {every: "${steps}", fields: [cauchy_stress]}
"""

# The block under a constant pressure on its right side, which moves, while a smooth plate compresses it by even steps of
# logarithmic strain. Columns of the grid as wide as the whole of it hold all points in one cell across.
CELL = """
version: 1
parameters: {method: cpdi2, volumetric: mean-dilatation, columns: 0.25, steps: 20, to: 0.2, k0: 1, ocr: 1.5,
             idealisation: axisymmetric}
analysis: {idealisation: "${idealisation}"}
grid:
  type: structured
  origin: [0, 0]
  size: [2, 1.5]
  spacing: ["${columns}", 0.25]
  follow: [{axis: y, from: 1, condition: top}]
MATERIAL
bodies:
  - {name: block, material: clay, shape: {type: box, min: [0, 0], max: [1, 1]}, method: "${method}",
     point_spacing: 0.125, strain: "${volumetric}",
     initial_stress: {type: components, stress: {xx: -60e3, yy: "${-60e3/k0}", zz: -60e3}}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: top, nodes: {y: 1}, uy: "exp(-to * factor) - 1"}
surfaces:
  - {name: side, body: block, part: {edge: 1}}
loads:
  - {name: cell, type: pressure, surface: side, pressure: 60e3, curve: [[0, 1], [1, 1]]}
steps: {count: "${steps}"}
solver: {tolerance: 1e-12}
output: {every: "${steps}", fields: [cauchy_stress]}
"""
