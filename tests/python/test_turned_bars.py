"""Bars whose sides lie across the grid, on rollers along these sides."""

import numpy as np
import pytest

from results import Results


@pytest.fixture
def run(mpm, tmp_path):
    def run(text):
        path, out = tmp_path / "deck.yaml", tmp_path / "out"
        path.write_text(text)
        process = mpm("run", path, "--out", out)
        assert process.returncode == 0, process.stderr
        results = Results(out)
        assert results.summary["outcome"] == "completed"
        return results

    return run


# A bar of 6 x 1 on rollers along its lower side and its left end, pulled at its right end.
ROLLERS = """
version: 1
grid: {type: structured, origin: [0, 0], size: [8, 7], spacing: 0.25}
materials: {steel: {model: hencky, young: 10e6, poisson: 0.3}}
bodies:
  - {name: bar, material: steel, FILLING
     shape: {type: rotate, angle: ANGLE, center: [1, 1], shape: {type: box, min: [1, 1], max: [7, 2]}}}
surfaces:
  - {name: under, body: bar, part: {edge: 0}}
  - {name: end, body: bar, part: {edge: 1}}
  - {name: start, body: bar, part: {edge: 3}}
boundary_conditions:
  - {name: rollers, surface: under, fix: normal}
  - {name: stop, surface: start, fix: normal}
loads:
  - {name: pull, type: traction, surface: end, traction: ["100e3*cos(pi*ANGLE/180)", "100e3*sin(pi*ANGLE/180)"]}
steps: {count: 4}
"""


@pytest.mark.parametrize("filling", ["point_spacing: 0.0625,", "points_per_cell: 2,", "method: cpdi1, points_per_cell: 3,"])
@pytest.mark.parametrize("angle", [5, 25, 40])
def test_a_bar_on_rollers(run, angle, filling):
    stress = np.asarray(run(ROLLERS.replace("ANGLE", str(angle)).replace("FILLING", filling)).mesh("points", -1)["cauchy_stress"])
    xx, yy, zz, xy = stress[:, :4].T
    mises = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)
    assert np.abs(mises / mises.mean() - 1).max() < 1e-8
    assert mises.mean() == pytest.approx(pulled(100e3, 10e6, 0.3), rel=1e-9)


def pulled(traction, young, poisson):
    """The von Mises stress in a Hencky bar in plane strain, pulled by a traction that refers to the original area."""
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / (1 + poisson) / 2
    # ε_y with which τ_y = 0, relative to ε_x; then τ_x = stiffness ε_x, and the traction is τ_x exp(−ε_x).
    across = -lame / (lame + 2 * shear)
    stiffness = lame * (1 + across) + 2 * shear
    strain = 0.0
    for _ in range(50):
        strain = traction / stiffness * np.exp(strain)
    volume = np.exp(strain * (1 + across))
    along, third = stiffness * strain / volume, lame * strain * (1 + across) / volume
    return np.sqrt(along**2 - along * third + third**2)


# A bar of 1 x 2 under a pressure on its head, between rollers along its foot and both sides.
STANDING = """
version: 1
grid: {type: structured, origin: [0, 0], size: [5, 5], spacing: 0.25}
materials: {m: {model: hencky, young: 100, poisson: 0.3}}
bodies: [{name: b, material: m, shape: {type: polygon, vertices: VERTICES}, method: METHOD, points_per_cell: N}]
surfaces:
  - {name: foot, body: b, part: {edge: 0}}
  - {name: right, body: b, part: {edge: 1}}
  - {name: head, body: b, part: {edge: 2}}
  - {name: left, body: b, part: {edge: 3}}
boundary_conditions:
  - {name: foot, surface: foot, fix: normal}
  - {name: left, surface: left, fix: normal}
  - {name: right, surface: right, fix: normal}
loads: [{name: t, type: pressure, surface: head, pressure: 10}]
steps: {count: 5}
"""


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("angle", [0, 30, 45, 70])
def test_a_bar_stands_on_its_foot(run, angle, method, n):
    turn = np.radians(angle)
    along, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    start = np.array([2.1, 1.0])
    corners = [start, start + along, start + along + 2 * up, start + 2 * up]
    text = STANDING.replace("VERTICES", str([[float(x) for x in corner] for corner in corners]))
    history = run(text.replace("METHOD", method).replace("N}", f"{n}}}")).history
    reaction = {name: np.array([history[f"{name}_r{axis}"][-1] for axis in "xy"]) for name in ("foot", "left", "right")}
    assert np.abs(reaction["foot"] - 10 * up).max() < 1e-8
    assert np.abs(reaction["left"] + reaction["right"]).max() < 1e-8
    assert reaction["left"] @ along > 1
