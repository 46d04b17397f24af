"""Domains that leave the grid, turn inside out or cross themselves end a run with an error that names the point."""

from pathlib import Path

import pytest

from results import Results

ROOT = Path(__file__).resolve().parents[2]
STRUCTURED = "{type: structured, origin: [0, 0], size: [6, 6], spacing: 1}"
IMPORTED = f"{{type: gmsh, file: '{ROOT}/tests/data/mesh/rectangle_quad_h0.5.msh'}}"

# Points of a square of this side, one per cell of side 1 (0.5 on the mesh), stretched out of the grid or squeezed. Corners
# may lie half a cell outside.
CASES = {
    "to the right, cpdi1": (
        "cpdi1", STRUCTURED, 4, "0.5*X + 0.6", 3,
        "step 3: point 3 of body `square` at (5.850000, 0.500000): "
        "corner 1 of its domain, at (6.600000, 0.000000), is outside the grid",
    ),
    "to the right, cpdi2": (
        "cpdi2", STRUCTURED, 4, "0.5*X + 0.6", 3,
        "step 3: point 3 of body `square` at (5.850000, 0.500000): "
        "corner 1 of its domain, at (6.600000, 0.000000), is outside the grid",
    ),
    "to the left, on a mesh": (
        "cpdi2", IMPORTED, 1, "0.6*(X - 1) + 0.3", 2,
        "step 2: point 0 of body `square` at (0.100000, 0.250000): "
        "corner 0 of its domain, at (-0.300000, 0.000000), is outside the grid",
    ),
    "bow-tie": (
        "cpdi2", STRUCTURED, 1, "if(y > 0.5, if(x < 0.5, 0.8, -0.5), 0)", 1,
        "step 1: point 0 of body `square` at (0.575000, 0.500000): its domain is inverted or crosses itself",
    ),
    "inside out, cpdi1": (
        "cpdi1", STRUCTURED, 1, "if(x < 0.5, 1.2, 0)", 1,
        "step 1, iteration 1: point 0 of body `square` at (0.500000, 0.500000): det(ΔF) = -1.99999999999999",
    ),
    "inside out, cpdi2": (
        "cpdi2", STRUCTURED, 1, "if(x < 0.5, 1.2, 0)", 1,
        "step 1, iteration 1: point 0 of body `square` at (0.500000, 0.500000): det(ΔF) = -1.99999999999999",
    ),
}


@pytest.mark.parametrize("method, grid, side, moved, steps, expected", CASES.values(), ids=CASES.keys())
def test_the_point_is_named(mpm, tmp_path, method, grid, side, moved, steps, expected):
    deck = tmp_path / "deck.yaml"
    deck.write_text(
        f"""version: 1
grid: {grid}
materials: {{m: {{model: hencky, young: 1e3, poisson: 0}}}}
bodies: [{{name: square, material: m, shape: {{type: box, min: [0, 0], max: [{side}, {side}]}},
          method: {method}, points_per_cell: 1}}]
boundary_conditions: [{{name: all, nodes: {{outer_layer: square}}, ux: '{moved}', uy: 0}}]
steps: {{count: {steps}, smallest: 1}}
"""
    )
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    errors = [line for line in process.stderr.splitlines() if line.startswith("error")]
    code, reason = errors[0].split(": ", 1)
    assert len(errors) == 1 and code.startswith("error[S0"), process.stderr
    assert reason.startswith(expected), process.stderr
    assert "  help: " in process.stderr and "panicked" not in process.stderr

    results = Results(tmp_path / "out")
    assert results.summary["outcome"] == "failed"
    assert results.summary["reason"] == reason
    # Only steps in equilibrium are on record: the one that failed is not among them.
    assert results.summary["steps"] == int(expected.split()[1].strip(":,")) - 1
