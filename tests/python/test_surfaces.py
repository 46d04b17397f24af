"""Conditions on surfaces: what may not matter to them."""

import pytest

from results import Results

GRADED = """
version: 1
parameters: {top: 4.3}
grid: {type: structured, origin: [0, 0], size: [20, 6], spacing: SPACING}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: block, material: m, shape: {type: box, min: [0, 0], max: [20, "${top}"]}, method: cpdi2, point_spacing: [0.1, 0.1075]}
surfaces: [{name: top, body: block, part: {edge: 2}}]
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: push, surface: top, ux: 0, uy: "-0.1*(1+0.5*sin(X/3))"}
steps: {count: 2}
output: {every: 0}
"""

PLATE = """
version: 1
parameters: {o: 0, s: 1, L: 23}
analysis: {idealisation: solid}
grid: {type: structured, origin: ["${o*s}", 0, 0], size: ["${L*s}", "${2*s}", "${3*s}"], spacing: "${s}"}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: block, material: m, points_per_cell: 2,
     shape: {type: box, min: ["${o*s}", 0, 0], max: ["${(o+L)*s}", "${2*s}", "${2*s}"]}}
surfaces: [{name: top, body: block, part: {box: {min: ["${o*s}", 0, "${2*s}"], max: ["${(o+L)*s}", "${2*s}", "${2*s}"]}}}]
boundary_conditions:
  - {name: floor, nodes: {z: 0}, fix: [x, y, z]}
  - {name: side, nodes: {y: 0}, fix: [y]}
  - {name: top, surface: top, ux: "0.01*s", uz: "-0.05*s*(1+0.5*sin((X/s-o)/3))"}
steps: {count: 1}
output: {every: 0}
"""


@pytest.fixture
def run(mpm, tmp_path):
    """The results of the text of a deck."""

    def run(text, **parameters):
        deck, out = tmp_path / "deck.yaml", tmp_path / "out"
        deck.write_text(text)
        settings = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        process = mpm("run", deck, "--out", out, *settings)
        assert process.returncode == 0, process.stderr
        return Results(out)

    return run


def test_thin_cells_below_a_surface_do_not_matter_to_its_conditions(run):
    """The patches of a weak condition must not be narrower than the cells that carry the surface."""
    plain = run(GRADED.replace("SPACING", "[1, 1]"))
    rows = run(GRADED.replace("SPACING", "[1, [{to: 1, cells: 1}, {to: 2, cells: 2}, {to: 6, cells: 4}]]"))
    thin = run(GRADED.replace("SPACING", "[1, 0.25]"))
    for graded in (rows, thin):
        assert graded.history["iterations"].max() <= 4
        ratio = graded.history["push_ry"][-1] / plain.history["push_ry"][-1]
        assert ratio == pytest.approx(1, abs=0.02)


DENT = """
version: 1
parameters: {width: 1}
grid: {type: structured, origin: [0, 0], size: [20, 4], spacing: SPACING}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: block, material: m, shape: {type: box, min: [0, 0], max: [20, 3]}, method: cpdi2, point_spacing: [0.25, 0.25]}
surfaces: [{name: top, body: block, part: {edge: 2}}]
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
  - {name: push, surface: top, ux: 0, uy: "-0.1*exp(-((X-10)/width)^2)"}
steps: {count: 1}
output: {every: 0}
"""


def test_patches_are_as_fine_as_the_cells_along_a_surface(run):
    """A dent in fine cells is pressed in as on a grid of such cells alone, however coarse the cells beside it are."""
    fine = run(DENT.replace("SPACING", "[0.5, 0.5]"))
    graded = run(DENT.replace("SPACING", "[[{to: 8, cells: 4}, {to: 12, cells: 8}, {to: 20, cells: 4}], 0.5]"))
    ratio = graded.summary["strain_energy"] / fine.summary["strain_energy"]
    assert ratio == pytest.approx(1, abs=0.1)


def test_a_part_narrower_than_the_cells_elsewhere_is_found(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    spacing = "[[{to: 4, cells: 4}, {to: 5, cells: 10}, {to: 20, cells: 15}], 1]"
    text = DENT.replace("SPACING", spacing).replace("part: {edge: 2}", "part: {box: {min: [4.45, 3], max: [4.55, 3]}}")
    deck.write_text(text)
    process = mpm("check", deck)
    assert process.returncode == 0, process.stdout + process.stderr


@pytest.mark.parametrize("middle", (5, 10))
def test_thin_cells_elsewhere_do_not_matter_to_the_samples_of_a_surface(mpm, tmp_path, middle):
    ends = f"{{to: {middle - 0.1}, cells: 5}}, {{to: {middle + 0.1}, cells: 8}}, {{to: 20, cells: 15}}"
    cells = f"[[{ends}], 1, 1]"
    deck = tmp_path / "deck.yaml"
    deck.write_text(f"""
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [20, 20, 6], spacing: {cells}}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: block, material: m, shape: {{type: box, min: [0, 0, 0], max: [20, 20, 4]}}, points_per_cell: 2}}]
surfaces: [{{name: side, body: block, part: {{box: {{min: [20, 0, 0], max: [20, 20, 4]}}}}}}]
boundary_conditions: [{{name: floor, nodes: {{z: 0}}, fix: [x, y, z]}}]
loads: [{{name: push, type: pressure, surface: side, pressure: 1e3}}]
steps: {{count: 1}}
""")
    process = mpm("check", deck)
    assert process.returncode == 0, process.stdout + process.stderr


def test_origin_and_unit_do_not_matter_to_patches(run):
    """Some samples lie exactly between two patches."""
    forces = []
    for o, s in ((0, 1), (0.7, 1), (5.9, 1), (0, 0.3), (0.7, 0.7)):
        history = run(PLATE, o=o, s=s).history
        forces.append([history[f"top_r{axis}"][-1] / s**2 for axis in "xz"])
    for force in forces:
        assert force == pytest.approx(forces[0], rel=1e-9)
