"""Warnings of runs: where they are shown, what they say, and which decks give none."""

import json

import numpy as np
import pytest

from results import Results

CLAY = "materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}"

GAP = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 0.25}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: lower, material: m, shape: {type: box, min: [1, 0], max: [3, 1.5]}, points_per_cell: 4}
  - {name: upper, material: m, shape: {type: box, min: [1.5, LOW], max: [2.5, HIGH]}, point_spacing: 0.05}
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
  - {name: push, nodes: {outer_layer: upper}, ux: 0, uy: -0.1}
steps: {count: 2}
output: {every: 0}
"""

TEAR = f"""
version: 1
grid: {{type: structured, origin: [0, 0], size: [12, 6], spacing: 1}}
{CLAY}
bodies:
  - {{name: block, material: m, shape: {{type: box, min: [0, 0], max: [4, 4]}}, method: mpm, points_per_cell: 2}}
boundary_conditions:
  - {{name: tear, nodes: {{box: {{min: [0, 0], max: [12, 6]}}}}, ux: "if(x > 2.5, 6, 0)", uy: 0}}
steps: {{count: 8}}
checkpoint: {{every: 5}}
output: {{every: 1}}
"""

FOOTING = """
version: 1
parameters: {h: 0.5, push: 0.04, young: 20e6, poisson: 0.45, method: mpm, n: 2, steps: 20, stabilisation: "off", volumetric: standard}
analysis: {stabilisation: {mode: "${stabilisation}"}}
grid: {type: structured, origin: [0, 0], size: [8, 5], spacing: "${h}"}
materials: {m: {model: von-mises, young: "${young}", poisson: "${poisson}", deviatoric_yield_stress: 14142}}
bodies:
  - {name: ground, material: m, shape: {type: box, min: [0, 0], max: [8, 4]}, method: "${method}", points_per_cell: "${n}",
     strain: "${volumetric}"}
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 8}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: push, nodes: {box: {min: [0, 4], max: [1, 4]}}, ux: 0, uy: "${-push}"}
steps: {count: "${steps}"}
output: {every: 0}
"""


@pytest.fixture
def run(mpm, tmp_path):
    """Runs the text of a deck; returns the process and the summary."""

    def run(text, *words, **parameters):
        deck, out = tmp_path / "deck.yaml", tmp_path / "out"
        deck.write_text(text)
        settings = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        process = mpm("run", deck, "--out", out, *settings, *words)
        assert process.returncode == 0, process.stderr
        return process, json.loads((out / "summary.json").read_text())

    return run


def only_warning(summary, code):
    """The one warning of a code."""
    (warning,) = [warning for warning in summary["warnings"] if warning["code"] == code]
    return warning


def test_a_gap_that_forces_cross_is_told_everywhere(mpm, run, tmp_path):
    log = tmp_path / "log"
    process, summary = run(GAP.replace("LOW", "1.7").replace("HIGH", "2.7"), "--log", log)
    warning = only_warning(summary, "W007")
    assert set(warning) == {"code", "step", "place", "value", "threshold", "message", "help"}
    assert warning["step"] == 1 and warning["value"] == pytest.approx(0.2)
    assert warning["threshold"] == pytest.approx(0.5 * 0.25 / 4)
    assert warning["place"]["bodies"] == ["lower", "upper"] and warning["place"]["position"][1] == 1.5
    lines = [f"warning[W007]: step 1: {warning['message']}", f"  help: {warning['help']}"]
    assert "\n".join(lines) in process.stderr
    assert all(line in log.read_text() for line in lines)
    report = mpm("report", tmp_path / "out")
    assert report.returncode == 0, report.stderr
    assert "<b>Warning W007.</b> Step 1: bodies" in (tmp_path / "out" / "report.html").read_text()
    page = mpm("explain", "w007").stdout
    assert page.startswith("# W007: bodies that act on each other across a gap")


@pytest.mark.parametrize("low, high", [("1.5", "2.5"), ("2.2", "3.2")])
def test_bodies_that_touch_or_are_far_apart_are_left_alone(run, low, high):
    _, summary = run(GAP.replace("LOW", low).replace("HIGH", high))
    assert summary["warnings"] == []


def test_a_body_that_comes_apart_is_told_with_its_gap(run, tmp_path):
    _, summary = run(TEAR)
    warning = only_warning(summary, "W005")
    assert (warning["value"], warning["threshold"]) == (2, 1) and warning["place"]["bodies"] == ["block"]
    # Whether the sides of the gap share nodes is decided where the step starts; the gap is that of its end.
    step = warning["step"]
    x = [mesh.points[:, 0] for _, mesh in zip(range(step + 1), Results(tmp_path / "out").meshes("points"))]
    columns = lambda k: set(np.floor(x[k] + 1e-9).astype(int))
    empty = lambda k: sorted(set(range(min(columns(k)), max(columns(k)))) - columns(k))
    assert not empty(step - 2)
    (cell,) = empty(step - 1)
    left, right = x[step][x[step - 1] < cell].max(), x[step][x[step - 1] > cell].min()
    assert warning["place"]["position"][0] == pytest.approx((left + right) / 2, abs=1e-5)
    assert f"{right - left:.4f} wide" in warning["message"]


def test_bodies_that_hung_together_come_apart(run):
    (body,) = [line for line in TEAR.splitlines() if "name: block" in line]
    left = body.replace("block", "left").replace("max: [4, 4]", "max: [3, 4]")
    right = "  - {name: right, material: m, shape: {type: box, min: [3.5, 0], max: [5.5, 4]}, method: mpm, point_spacing: 0.5}"
    two = TEAR.replace(body, f"{left}\n{right}").replace("x > 2.5", "x > 3.5")
    _, summary = run(two)
    assert only_warning(summary, "W005")["place"]["bodies"] == ["right", "left"]


def test_a_run_that_goes_on_has_the_same_warnings(mpm, run, tmp_path):
    _, whole = run(TEAR)
    (tmp_path / "out" / "summary.json").unlink()
    (tmp_path / "out" / "checkpoint_0008.mpm").unlink()
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out", "--resume")
    assert process.returncode == 0 and "resuming after step 5" in process.stderr, process.stderr
    again = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert whole["warnings"] and again["warnings"] == whole["warnings"]
    assert "warning[W005]" not in process.stderr, "told before"


def test_nodes_that_the_material_leaves(run):
    _, summary = run(FOOTING, h=0.25, push=0.25, young=2e6, steps=25, method="gimp")
    warning = only_warning(summary, "W006")
    assert warning["place"]["boundary_condition"] == "push" and warning["place"]["position"][1] == 4
    assert 0.6 < warning["value"] < warning["threshold"] == 0.7
    assert summary["quality"]["held_by_nodes"]["push"] < 0.2
    _, summary = run(FOOTING, h=0.25, push=0.01, method="gimp")
    assert "W006" not in [warning["code"] for warning in summary["warnings"]]
    assert summary["quality"]["held_by_nodes"]["push"] > 0.9


def test_locking_is_told_where_pressures_alternate(run):
    _, summary = run(FOOTING)
    warning = only_warning(summary, "W012")
    assert warning["threshold"] == 1.2 < warning["value"] < summary["quality"]["pressure_oscillation"]["value"]
    _, summary = run(FOOTING, n=1, method="gimp", stabilisation="auto")
    assert summary["quality"]["pressure_oscillation"] is None and summary["warnings"] == []


@pytest.mark.parametrize("volumetric", ["mean-dilatation", "f-bar"])
def test_the_remedy_of_locking_is_named_and_works(run, tmp_path, volumetric):
    _, summary = run(FOOTING)
    assert "`strain: mean-dilatation`" in only_warning(summary, "W012")["help"]
    _, summary = run(FOOTING, volumetric=volumetric)
    assert summary["warnings"] == [] and summary["quality"]["pressure_oscillation"]["value"] < 1e-9
    prandtl = (2 + np.pi) * 14142 / 2**0.5
    assert prandtl < -Results(tmp_path / "out").history["push_ry"][-1] < 1.15 * prandtl
    # Points that have moved between cells, and domains that reach into others, differ a little.
    _, summary = run(FOOTING, volumetric="mean-dilatation", method="gimp", push=0.16)
    assert 0.01 < summary["quality"]["pressure_oscillation"]["value"] < 0.5


def test_locking_is_told_beside_much_stored_energy(run):
    """Ground that is nearly incompressible stores most of the energy, and locks no less."""
    _, summary = run(FOOTING, poisson=0.48, push=0.16)
    assert summary["plastic_work"] < 0.5 * (summary["plastic_work"] + summary["strain_energy"])
    assert only_warning(summary, "W012")["value"] > 1.2


SLAB = """
version: 1
parameters: {h: 0.5, young: 1e10, method: gimp, steps: 10}
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: "${h}"}
materials:
  soft: {model: hencky, young: 1e6, poisson: 0.3}
  stiff: {model: hencky, young: "${young}", poisson: 0.3, density: 2000}
bodies:
  - {name: soil, material: soft, shape: {type: box, min: [0, 0], max: [4, 2]}, points_per_cell: 2, method: "${method}"}
  - {name: slab, material: stiff, shape: {type: box, min: [0, 2], max: [4, 3]}, points_per_cell: 2, method: "${method}"}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -50], bodies: [slab]}
steps: {count: "${steps}"}
output: {every: 0, probes: [{name: top, body: slab, nearest: [4, 3]}]}
"""


def test_a_stiff_body_that_takes_cells_of_a_soft_one_along_is_told(run, tmp_path):
    """The soft layer has four rows of cells, of which one cannot strain once the slab has sunk into it."""

    def settlement(**parameters):
        _, summary = run(SLAB, **parameters)
        return -Results(tmp_path / "out").history["top_uy"][-1], summary

    # A grid that fits the layer: no sliver of the slab is in the cells of the soil.
    right, summary = settlement(steps=1)
    assert summary["warnings"] == []
    for method in ("gimp", "cpdi2"):
        stiffened, summary = settlement(method=method)
        warning = only_warning(summary, "W016")
        assert warning["place"]["bodies"] == ["soil", "slab"] and warning["threshold"] == 0.1
        assert 0.2 < warning["value"] < 0.3 and 0.1 < 1 - stiffened / right < 0.2
        finer, summary = settlement(method=method, h=0.25)
        assert 0.1 < only_warning(summary, "W016")["value"] < 0.15 and 0.03 < 1 - finer / right < 0.1
    _, summary = settlement(young=1e7)
    assert summary["warnings"] == []
    _, summary = settlement(method="mpm", steps=5)
    assert summary["warnings"] == []


COLUMN = """
version: 1
parameters: {weight: 9.81}
grid: {type: structured, origin: [0, 0], size: [8, 12], spacing: 0.25}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - {name: column, material: m, shape: {type: box, min: [3, 0], max: [3.5, 10]}, points_per_cell: 2}
boundary_conditions: [{name: floor, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: weight, type: gravity, acceleration: [0, "${-weight}"]}]
steps: {count: 4}
output: {every: 0}
"""


REST = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 1}
materials: {s: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: g, material: s, method: gimp, shape: {type: box, min: [0, 0], max: [4, 2]}, points_per_cell: 2}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads: [{name: t, type: body-force, force: [0, -1e3], curve: [[0, 0], [0.25, 1], [0.75, 1], [1, 2]]}]
steps: {count: 8}
solver: {predictor: last-step}
output: {every: 0}
"""

SHEARED = """
version: 1
grid: {type: structured, origin: [-1.8, 0], size: [1.8, 1.8], spacing: 0.3}
materials: {m: {model: neo-hookean, young: 5e6, poisson: 0.3, density: 1800}}
bodies:
  - {name: b, material: m, method: mpm, points_per_cell: 3, shape: {type: box, min: [-0.9, 0], max: [0, 1.8]}}
boundary_conditions:
  - {name: base, nodes: {x: 0}, fix: [x, y]}
  - {name: below, nodes: {y: 0}, fix: [y]}
  - {name: above, nodes: {y: 1.8}, fix: [y]}
loads: [{name: weight, type: gravity, acceleration: [9.81, 0]}]
tools:
  - {name: t, shape: {type: half-space, point: [-0.9103, 0.81], normal: [1, 0]}, friction: rough, ux: 0.033, uy: 0.073}
steps: {count: 2}
output: {every: 0}
"""


def test_only_forces_with_a_potential_tell_that_an_equilibrium_is_not_stable(run):
    # The predicted states of two steps are in equilibrium, so nothing is factorised.
    _, summary = run(REST)
    assert summary["warnings"] == []
    # The pivots of an unsymmetric stiffness depend on the order of the unknowns.
    _, summary = run(SHEARED)
    assert summary["indefinite_solves"] > 0
    assert "W017" not in [warning["code"] for warning in summary["warnings"]]


def test_an_equilibrium_that_is_not_stable_is_told(run):
    """A column buckles under its own weight at w L³ = 7.84 E I (Greenhill 1881), with E / (1 − ν²) in plane strain."""
    buckles = 7.84 * 1e6 / (1 - 0.3**2) * 0.5**3 / 12 / (2000 * 0.5 * 10**3)
    _, summary = run(COLUMN, weight=1.1 * buckles)
    assert only_warning(summary, "W017")["step"] == 4, "the last"
    _, summary = run(COLUMN, weight=buckles)
    assert summary["warnings"] == [], "the grid is a little stiffer"


def test_a_tool_with_friction_that_touches_nothing_tells_nothing_about_stability(run):
    """The stiffness is symmetric as long as nothing slides, so the column of the test above is told all the same."""
    buckles = 7.84 * 1e6 / (1 - 0.3**2) * 0.5**3 / 12 / (2000 * 0.5 * 10**3)
    tool = "tools: [{name: far, shape: {type: circle, center: [7.5, 11.5], radius: 0.2}, friction: 0.3}]\n"
    for linear in ("direct", "iterative"):
        _, summary = run(COLUMN + tool + f"solver: {{linear: {linear}}}\n", weight=1.1 * buckles)
        assert only_warning(summary, "W017")["step"] == 4, linear


PULLED = """
version: 1
parameters: {s: 1, side: 0.5, origin: 0, height: 4, uy: 0.01, above: 2, ideal: plane-strain}
analysis: {idealisation: "${ideal}"}
grid: {type: structured, origin: [0, "${origin*s}"], size: ["${4*s}", "${(height+above)*s}"], spacing: ["${side*s}", "${0.5*s}"]}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3}}
bodies:
  - {name: block, material: m, method: gimp, points_per_cell: 2,
     shape: {type: box, min: [0, "${origin*s}"], max: ["${2*s}", "${(origin+height)*s}"]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: "${origin*s}"}, FLOOR}
  - {name: top, nodes: {y: "${(origin+height)*s}"}, TOP}
steps: {count: 4}
output: {every: 0}
"""


def codes(summary):
    return [warning["code"] for warning in summary["warnings"]]


def test_nodes_that_pull_material_beyond_them_are_told_in_any_unit(run):
    """The reaction is too small: cells without points lie beyond the nodes, and nothing holds the material there."""
    pulled = PULLED.replace("FLOOR", "fix: [y]").replace("TOP", 'uy: "${uy*s}"')
    for ideal in ("plane-strain", "axisymmetric"):
        least = [[uy for uy in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2) if "W021" in codes(run(pulled, s=s, uy=uy, ideal=ideal)[1])]
                 for s in (1e3, 1, 1e-3)]
        assert least[0] == least[1] == least[2] and 1e-2 in least[0] and 1e-6 not in least[0], (ideal, least)
    for side in (1, 0.4, 0.25, 0.1):
        assert codes(run(pulled, side=side)[1]) == ["W021"], side


def test_nodes_that_push_or_that_others_hold_are_not_told(run):
    pushed = PULLED.replace("FLOOR", 'uy: "${uy*s}"').replace("TOP", "uy: 0")
    # A body one cell thick: the nodes beyond its free side are two cells from the nodes that push.
    pushed = pushed.replace(", TOP", ", fix: [x]").replace('  - {name: top, nodes: {y: "${(origin+height)*s}"}, uy: 0}\n', "")
    for origin in (0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7):
        assert codes(run(pushed, origin=origin, height=0.5, s=0.2)[1]) == [], origin
    held = PULLED.replace("FLOOR", "fix: [y]").replace("TOP", 'uy: "${uy*s}"')
    ceiling = '  - {name: ceiling, nodes: {y: "${(height+0.5)*s}"}, fix: [x, y]}\nsteps:'
    assert codes(run(held.replace("steps:", ceiling), above=0.5)[1]) == []
    assert codes(run(held, above=0.5)[1]) == ["W021"]


def test_a_motion_without_strain_gives_no_warning_about_work(analyse):
    summary = analyse("inputs/domains.yaml", angle=0.9, every=0).summary
    assert [warning["code"] for warning in summary["warnings"]] == ["W011"]
    warning = only_warning(summary, "W011")
    step = int(np.ceil(np.radians(30) / 0.9 * 20))
    assert warning["step"] == step and warning["value"] == pytest.approx(np.degrees(0.9 * step / 20))


def test_the_table_at_the_end_tells_the_bounds(mpm, tmp_path):
    process = mpm("run", "inputs/compaction.yaml", "--out", tmp_path, "--set", "every=0")
    table = " ".join(process.stdout.split())
    for text in ("of the external work (limit 10 %)", "of a domain outside the grid (limit 1 %)",
                 "(limit 30°)", "(limit 1e-3)", "(limit of the energy 10 % from step 5 on)"):
        assert text in table, text


# What the decks of `inputs` give, each with its cause in the page of the code.
EXPECTED = [
    ("compaction.yaml", {"method": "mpm"}, []),
    ("compaction.yaml", {"method": "mpm", "young": 1e4, "steps": 40}, ["W008", "W010"]),
    ("shear.yaml", {"h": 0.25}, []),
    ("annulus.yaml", {}, []),
    ("collapse.yaml", {"n": 3}, []),
    ("collapse.yaml", {"n": 3, "method": "mpm"}, ["W010"]),
    ("footing.yaml", {"h": 0.5}, []),
    ("excavation.yaml", {}, []),
    ("footing_stages.yaml", {}, []),
    ("cylinder.yaml", {}, []),
    ("cantilever.yaml", {"h": 0.5}, []),
    ("beam.yaml", {"n": 4}, ["W011"]),
    ("beam.yaml", {"n": 4, "method": "cpdi2"}, []),
    ("arch.yaml", {"h": 0.5, "steps": 20}, []),
    ("twist.yaml", {"h": 0.5}, []),
]


@pytest.mark.parametrize("deck, parameters, codes", EXPECTED)
def test_decks_of_the_paper_and_others(analyse, deck, parameters, codes):
    summary = analyse(f"inputs/{deck}", every=0, **parameters).summary
    assert sorted(warning["code"] for warning in summary["warnings"]) == codes
