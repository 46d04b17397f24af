"""Files of a grid whose lines follow a footing."""

import numpy as np

DECK = """
version: 1
grid: {type: structured, origin: [0, 0], size: [2, 6], spacing: 1, follow: [{axis: y, from: 4, condition: push}]}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies: [{name: b, material: m, method: gimp, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [2, 4]}}]
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [2, 6]}}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
  - {name: push, nodes: {y: 4}, uy: -1.5}
steps: {count: 6}
output: {every: 1}
"""


def test_files_show_the_lines_of_each_step_and_their_increments(analyse, tmp_path):
    deck = tmp_path / "deck.yaml"
    deck.write_text(DECK)
    results = analyse(deck)
    modulus = 1e6 * 0.7 / (1.3 * 0.4)
    for step in range(1, 7):
        grid = results.mesh("grid", step)
        top = 4 - 0.25 * (step - 1)
        lines = np.unique(np.round(grid.points[:, 1], 12))
        assert np.allclose(lines[:5], np.linspace(0, top, 5), rtol=0, atol=1e-12)
        moved = grid.points[:, 1] + grid.point_data["displacement_increment"][:, 1]
        assert np.allclose(moved[grid.points[:, 1] > top - 1e-9].min(), top - 0.25, rtol=0, atol=1e-12)
        exact = modulus * np.log((top - 0.25) / 4)
        points = results.mesh("points", step)
        stress = points.point_data["cauchy_stress"][:, 1] * points.point_data["J"]
        assert np.allclose(stress, exact, rtol=1e-10)
