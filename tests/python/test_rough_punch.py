"""A rough punch sinks into clay by half of its width: its sides and its base do not pull against each other."""

import numpy as np
import pytest

from results import Results

# Half of a punch, about 2 wide.
DECK = """
version: 1
grid: {type: structured, origin: [0, 0], size: [5, 5], spacing: H}
materials: {clay: LAW}
bodies:
  - {name: clay, material: clay, method: METHOD, strain: mean-dilatation, points_per_cell: POINTS,
     shape: {type: box, min: [0, 0], max: [5, 3]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
tools:
  - {name: punch, shape: {type: box, min: [-1, 3], max: [WIDTH, 5]}, uy: -1, friction: rough, penalty: 10,
     parts: {base: {edges: [0]}, side: {edges: [1]}}}
steps: {count: 40}
solver: {predictor: last-step}
output: {every: 2}
"""
LAWS = {
    "tresca": "{model: tresca, young: 3e6, poisson: 0.49, cohesion: 10e3}",
    "von mises": "{model: von-mises, young: 3e6, poisson: 0.49, undrained_strength: 10e3}",
}


@pytest.mark.parametrize(
    ("method", "law", "h", "points", "width"),
    [
        ("cpdi2", "tresca", 0.5, 2, 0.97),
        ("cpdi2", "von mises", 0.5, 2, 1.04),
        ("cpdi2", "von mises", 0.25, 2, 1),
        ("cpdi2", "von mises", 0.25, 3, 1),
        ("cpdi1", "tresca", 0.5, 3, 1),
        ("gimp", "tresca", 0.5, 3, 1),
        ("gimp", "tresca", 0.25, 3, 1),
    ],
)
def test_a_rough_punch(mpm, tmp_path, method, law, h, points, width):
    text = DECK.replace("METHOD", method).replace("LAW", LAWS[law]).replace("H}", f"{h}}}")
    text = text.replace("POINTS", str(points)).replace("WIDTH", str(width))
    path, out = tmp_path / "deck.yaml", tmp_path / "out"
    path.write_text(text)
    process = mpm("run", path, "--out", out)
    assert process.returncode == 0, process.stderr
    results = Results(out)
    assert results.summary["outcome"] == "completed"
    history = results.history
    total, base, side = (history[f"punch_{part}fy"] for part in ("", "base_", "side_"))
    assert np.abs(base + side - total).max() < 1e-9 * np.abs(total).max()
    # The base pushes. The corners of boxes at the side lie in the same cells as those at the base, and may pull.
    assert base.max() <= 0 and (method == "gimp" or side.max() <= 1e-3 * np.abs(total).max())
    assert 5.14 < -total[-1] / 10e3 < 10
    meshes = [mesh for mesh in results.meshes("contacts") if mesh.n_points > 0]
    assert len(meshes) > 10 and all(np.asarray(mesh["pressure"]).min() >= 0 for mesh in meshes)
