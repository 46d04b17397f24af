"""What is tried where Newton's method fails at the smallest step, and where forces are all but round-off."""

import json
import pathlib
import re

import numpy as np
import pytest

from results import Results

ERRORS = pathlib.Path(__file__).resolve().parents[2] / "docs" / "errors"

STEEL = """
version: 1
grid: {type: structured, origin: [0, 0], size: [8, 6], spacing: 0.5}
materials: {m: {model: hencky, young: 2.1e11, poisson: 0.3, density: 7850}}
bodies:
  - {name: bar, material: m, shape: {type: box, min: [0, 3], max: [4, 4]}, method: METHOD, points_per_cell: 3}
boundary_conditions:
  - {name: root, nodes: {x: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81], curve: [[0, 0], [1, 1], [2, 0]]}
steps: {count: 20, end_time: 2}
output: {every: 0}
"""

STIFF = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 0.5}
materials:
  soft: {model: hencky, young: 1e6, poisson: 0.3}
  stiff: {model: hencky, young: 1e12, poisson: 0.3, density: 2000}
bodies:
  - {name: soil, material: soft, shape: {type: box, min: [0, 0], max: [4, 2]}, points_per_cell: 2, method: METHOD}
  - {name: block, material: stiff, shape: {type: box, min: [0, 2], max: [1.5, 3]}, points_per_cell: 2, method: METHOD}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81], bodies: [block]}
steps: {count: 5}
output: {every: 0}
"""

LEDGE = """
version: 1
grid: {type: structured, origin: [0, 0], size: [10, 6], spacing: 0.5}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 10e3, hardening_modulus: 2e3, density: 1000}}
bodies: [{name: block, material: m, method: cpdi2, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [3, 3]}}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads: [{name: weight, type: gravity, acceleration: [0, -80]}]
steps: {count: 10, damping: false}
output: {every: 0}
"""

LAYERS = """
version: 1
grid: {type: structured, origin: [0, 0], size: [3, 4], spacing: 0.25}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 1000}}
bodies:
  - {name: low, material: m, shape: {type: box, min: [0, 0], max: [2, 1]}, method: gimp, point_spacing: 0.125}
  - {name: between, material: m, shape: {type: box, min: [0, 1], max: [2, TOP]}, method: gimp, point_spacing: 0.125}
  - {name: high, material: m, shape: {type: box, min: [0, 1.25], max: [2, 2.25]}, method: gimp, point_spacing: 0.125}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 2}
output: {every: 0}
"""


def example(code):
    """The deck of a page that gives rise to its warning."""
    deck = re.search(r"```yaml\n(.*?)```", (ERRORS / f"{code}.md").read_text(), re.DOTALL)[1]
    return "version: 1\n" + deck + "output: {every: 0}\n"


def summary_of(directory):
    return json.loads((directory / "summary.json").read_text())


def residuals_are_met(directory):
    history = Results(directory).history
    limits = np.where(history["rounding_limited"] == 1, 1e-6, 1e-9)
    return bool(np.all(history["residual"] <= limits))


@pytest.mark.parametrize("code, stops, count", [("W013", "S00", "damped_steps"), ("W014", "S004", "replaced_domains")])
def test_last_resorts_carry_a_run_to_its_end_and_say_so(mpm, tmp_path, code, stops, count):
    deck = tmp_path / "deck.yaml"
    deck.write_text(example(code))
    assert mpm("run", deck, "--out", tmp_path / "with").returncode == 0
    summary = summary_of(tmp_path / "with")
    assert summary[count] >= 1 and code in [warning["code"] for warning in summary["warnings"]]
    deck.write_text(example(code).replace("steps: {count: 1}", "steps: {count: 1, damping: false}"))
    stopped = mpm("run", deck, "--out", tmp_path / "without")
    assert stopped.returncode == 1 and f"error[{stops}" in stopped.stderr
    summary = summary_of(tmp_path / "without")
    assert summary["damped_steps"] == summary["replaced_domains"] == 0


SLUMP = """
version: 1
grid: {type: structured, origin: [0, 0], size: [WIDTH, 3], spacing: 0.5}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.2, deviatoric_yield_stress: 4e3, density: 1000}}
bodies:
  - {name: bank, material: m, shape: {type: box, min: [0, 0], max: [3, 2]}, method: cpdi2, points_per_cell: 2}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -20]}
steps: {count: 5, damping: DAMPING}
output: {every: 1}
"""


def slump(mpm, directory, width, damping):
    deck = directory.with_suffix(".yaml")
    deck.write_text(SLUMP.replace("WIDTH", str(width)).replace("DAMPING", damping))
    process = mpm("run", deck, "--out", directory)
    return process.returncode, summary_of(directory)


def test_a_bank_that_collapses_slumps_to_where_it_can_stand(mpm, tmp_path):
    code, stopped = slump(mpm, tmp_path / "stopped", 14, "false")
    assert code == 1 and stopped["diagnosis"]["kind"] == "plastic-collapse"
    assert stopped["diagnosis"]["largest_load_factor"] == pytest.approx(0.55)
    code, summary = slump(mpm, tmp_path / "slumped", 14, "true")
    assert code == 0 and residuals_are_met(tmp_path / "slumped")
    (warning,) = [warning for warning in summary["warnings"] if warning["code"] == "W013"]
    assert "slump" in warning["message"] and summary["damped_steps"] >= 1
    # Down and out, by cells, for good; what is lost on the way comes from the weight.
    assert summary["largest"]["displacement"]["value"] > 2
    assert 0 < summary["damping_work"] < summary["external_work"]


def test_an_equilibrium_of_which_a_domain_is_torn_is_no_collapse(mpm, tmp_path):
    """The last attempt fails in an iteration; one before it meets the tolerance and tears a domain."""
    deck = tmp_path / "deck.yaml"
    deck.write_text(LEDGE.replace("damping: false", "damping: false, smallest: 0.02"))
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 1 and "error[S002]" in process.stderr
    diagnosis = summary_of(tmp_path / "out")["diagnosis"]
    assert diagnosis["kind"] == "lost-domain" and "damping" in diagnosis["advice"]
    assert diagnosis["body"] == "block" and diagnosis["node"] is None
    # What the advice promises.
    deck.write_text(LEDGE.replace(", damping: false", ""))
    assert mpm("run", deck, "--out", tmp_path / "replaced").returncode == 0


def test_a_slump_that_fails_leaves_no_trace(mpm, tmp_path):
    """The bank flows off the grid: all that is written is what the run without damping has written."""
    for damping in ("false", "true"):
        code, summary = slump(mpm, tmp_path / damping, 3.5, damping)
        assert code == 1 and summary["diagnosis"]["kind"] == "plastic-collapse"
        assert summary["damping_work"] == summary["damped_steps"] == 0
    names = sorted(path.name for path in (tmp_path / "false").glob("*_0*.vtu"))
    assert len(names) > 3 and names == sorted(path.name for path in (tmp_path / "true").glob("*_0*.vtu"))
    for name in names:
        assert (tmp_path / "false" / name).read_bytes() == (tmp_path / "true" / name).read_bytes(), name


@pytest.mark.parametrize("method", ["mpm", "gimp", "cpdi2"])
def test_a_beam_that_is_unloaded_carries_nothing(mpm, tmp_path, method):
    (tmp_path / "deck.yaml").write_text(STEEL.replace("METHOD", method))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0
    assert residuals_are_met(tmp_path / "out")


@pytest.mark.parametrize("method", ["mpm", "gimp", "cpdi1", "cpdi2"])
def test_a_stiff_body_on_a_soft_one_is_as_good_as_round_off_allows(mpm, tmp_path, method):
    (tmp_path / "deck.yaml").write_text(STIFF.replace("METHOD", method))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 0
    assert residuals_are_met(tmp_path / "out")


def test_a_layer_between_two_others_fills_the_gap(mpm, tmp_path):
    for top, warns in (("1.25", False), ("1.125", True)):
        (tmp_path / "deck.yaml").write_text(LAYERS.replace("TOP", top))
        assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / top).returncode == 0
        codes = [warning["code"] for warning in summary_of(tmp_path / top)["warnings"]]
        assert ("W007" in codes) == warns, top
