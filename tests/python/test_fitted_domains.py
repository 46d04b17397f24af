"""Domains of CPDI follow the boundary of a body: straight sides at any angle, circles, parts that meet."""

import numpy as np
import pytest

from results import Results

TURNED = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 0.25}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, method: METHOD, POINTS,
     shape: {type: rotate, angle: ANGLE, center: [2, 1.5], shape: {type: box, min: [1.43, 1.02], max: [2.46, 2.15]}}}
surfaces:
  - {name: base, body: b, part: {edge: 0}}
  - {name: side, body: b, part: {edge: 1}}
  - {name: top, body: b, part: {edge: 2}}
  - {name: back, body: b, part: {edge: 3}}
boundary_conditions:
  - {name: base, surface: base, fix: normal}
  - {name: back, surface: back, fix: normal}
loads: [RULE]
steps: {count: STEPS}
"""

RULES = {
    "push": "{name: p, type: pressure, surface: side, pressure: 150}",
    "pull": "{name: p, type: pressure, surface: top, pressure: -200}",
    "both": "{name: p, type: pressure, surface: side, pressure: 150}, {name: q, type: pressure, surface: top, pressure: 80}",
    "traction": '{name: p, type: traction, surface: side, traction: ["150*cos(pi*ANGLE/180)", "150*sin(pi*ANGLE/180)"]}',
}


def turned(rule, angle=30, method="cpdi2", points="points_per_cell: 2", steps=3):
    text = TURNED.replace("RULE", RULES[rule].replace('"', "")).replace("ANGLE", str(angle)).replace("METHOD", method)
    if rule == "traction":
        direction = 150 * np.cos(np.radians(angle)), 150 * np.sin(np.radians(angle))
        text = text.replace(f"[150*cos(pi*{angle}/180), 150*sin(pi*{angle}/180)]", f"[{direction[0]!r}, {direction[1]!r}]")
    return text.replace("np.float64(", "").replace(")", "").replace("POINTS", points).replace("STEPS", str(steps))


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


def scatter(results):
    """The largest deviation of the stress of a point from the mean, relative to the largest stress."""
    stress = np.asarray(results.mesh("points", -1)["cauchy_stress"])
    assert np.abs(stress).max() > 10
    return np.abs(stress - stress.mean(axis=0)).max() / np.abs(stress).max()


@pytest.mark.parametrize("method", ["cpdi1", "cpdi2"])
@pytest.mark.parametrize("angle", [30, 45])
@pytest.mark.parametrize("rule", RULES)
def test_a_turned_block_has_a_uniform_stress(run, rule, angle, method):
    assert scatter(run(turned(rule, angle, method))) < 1e-8
