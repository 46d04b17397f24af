"""Bodies that are stressed at time 0: exact stresses in horizontal layers, what is refused, and the balance of energy."""

import hashlib

import numpy as np
import pytest

from results import Results

G, LENGTH = 9.81, 10.0
SAND, CLAY = {"density": 1800, "k0": 0.4}, {"density": 2000, "k0": 0.7}
BORDER = 6.0

# Sand over clay, with laws in both measures of strain; `low` and `high` are corners without the last coordinate.
LAYERS = """version: 1
analysis: {{idealisation: {idealisation}}}
grid: {{type: structured, origin: {origin}, size: {size}, spacing: 1}}
materials:
  sand: {{model: neo-hookean, young: 20e6, poisson: 0.25, density: 1800}}
  clay: {{model: hencky, young: 5e6, poisson: 0.35, density: 2000}}
bodies:
  - {{name: sand, material: sand, method: {method}, points_per_cell: 2, shape: {{type: box, min: {middle}, max: {top}}},
     initial_stress: {{type: geostatic, surface: 10, k0: 0.4}}}}
  - {{name: clay, material: clay, method: {method}, points_per_cell: 2, shape: {{type: box, min: {origin}, max: {border}}},
     initial_stress: {{type: geostatic, surface: 10, k0: 0.7}}}}
boundary_conditions: [{conditions}]
loads: [{{name: weight, type: gravity, acceleration: {gravity}}}]
steps: {{count: 2}}
"""


def layers(idealisation, method):
    n = 3 if idealisation == "solid" else 2
    corner = lambda x, y: [x] * (n - 1) + [y]
    last = "xyz"[n - 1]
    conditions = [f"{{name: floor, nodes: {{{last}: 0}}, fix: [{last}]}}"]
    for axis in "xy"[: n - 1]:
        conditions += [f"{{name: {axis}{k}, nodes: {{{axis}: {k}}}, fix: [{axis}]}}" for k in (0, 3)]
    return LAYERS.format(
        idealisation=idealisation, method=method, origin=corner(0, 0), size=corner(3, 12), middle=corner(0, BORDER),
        top=corner(3, LENGTH), border=corner(3, BORDER), conditions=", ".join(conditions), gravity=corner(0, -G),
    )


@pytest.fixture(scope="module")
def run_text(mpm, tmp_path_factory):
    """Runs the text of a deck in a new directory; the process and its results."""

    def run(text, *options, threads=None):
        directory = tmp_path_factory.mktemp("text")
        (directory / "deck.yaml").write_text(text)
        process = mpm("run", directory / "deck.yaml", "--out", directory / "out", *options, threads=threads)
        return process, Results(directory / "out")

    return run


def layer_stress(mesh, last):
    """Components of the stress of the layers at the original positions of points."""
    level = (np.asarray(mesh.points) - mesh.point_data["displacement"])[:, last]
    gamma_s, gamma_c = SAND["density"] * G, CLAY["density"] * G
    is_sand = level > BORDER
    vertical = -np.where(is_sand, gamma_s * (10 - level), gamma_s * (10 - BORDER) + gamma_c * (BORDER - level))
    exact = np.zeros((len(level), 6))
    exact[:, :3] = (np.where(is_sand, SAND["k0"], CLAY["k0"]) * vertical)[:, None]
    exact[:, last] = vertical
    return exact


@pytest.mark.parametrize("method", ["mpm", "gimp"])
@pytest.mark.parametrize("idealisation", ["plane-strain", "axisymmetric", "solid"])
def test_horizontal_layers_are_in_equilibrium_and_stay(run_text, idealisation, method):
    process, results = run_text(layers(idealisation, method))
    assert process.returncode == 0, process.stderr
    state = results.summary["initial_state"]
    assert state["balanced"] and state["residual"] < 1e-12
    assert "initial state: in equilibrium" in process.stderr
    last = 2 if idealisation == "solid" else 1
    for index in (0, 1, -1):
        mesh = results.mesh("points", index)
        exact = layer_stress(mesh, last)
        error = np.abs(mesh.point_data["cauchy_stress"] - exact).max(axis=1) / np.abs(exact).max(axis=1)
        assert error.max() < 1e-12, (index, error.max())
        assert np.abs(mesh.point_data["displacement"]).max() < 1e-12 * LENGTH
    assert np.abs(results.mesh("points", 0).point_data["displacement"]).max() == 0.0


BLOCK = """version: 1
parameters: {{k0: 0.5}}
analysis: {{initial_imbalance: {imbalance}}}
grid: {{type: structured, origin: [0, 0], size: [6, 6], spacing: 1}}
materials: {{clay: {{model: {model}, young: 1e6, poisson: 0.3, density: 2000{more}}}}}
bodies:
  - {{name: block, material: clay, shape: {shape}, points_per_cell: 2, initial_stress: {stress}}}
boundary_conditions:
  - {{name: floor, nodes: {{y: 0}}, fix: [x, y]}}
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 4}}, fix: [x]}}
loads: [{loads}]
{steps}
"""
WEIGHT = "{name: weight, type: gravity, acceleration: [0, -9.81]}"
SQUARE = "{type: box, min: [0, 0], max: [4, 4]}"
SLOPE = "{type: polygon, vertices: [[0, 0], [4, 0], [4, 2], [2, 4], [0, 4]]}"
GEOSTATIC = '{type: geostatic, surface: 4, k0: "${k0}"}'


def block(imbalance="refuse", model="hencky", more="", shape=SQUARE, stress=GEOSTATIC, loads=WEIGHT, steps="steps: {count: 1}"):
    return BLOCK.format(imbalance=imbalance, model=model, more=more, shape=shape, stress=stress, loads=loads, steps=steps)


def test_components_are_formulas_of_the_original_position(run_text):
    weight = 2000 * G
    stress = f"{{type: components, stress: {{yy: '-{weight}*(4 - Y)', xx: '-k0*{weight}*(4 - Y)', zz: -1e4}}}}"
    process, results = run_text(block(stress=stress))
    assert process.returncode == 0, process.stderr
    assert results.summary["initial_state"]["residual"] < 1e-12
    mesh = results.mesh("points", 0)
    depth, found = 4 - np.asarray(mesh.points)[:, 1], mesh.point_data["cauchy_stress"]
    exact = np.stack([-0.5 * weight * depth, -weight * depth, 0 * depth - 1e4, *[0 * depth] * 3], axis=1)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("hardening", [0, 4e5])
def test_a_stress_outside_the_yield_surface_is_brought_back_and_said(run_text, hardening):
    radius = 15e3
    more = f", deviatoric_yield_stress: {radius}, hardening_modulus: {hardening}"
    process, results = run_text(block("equilibrate", "von-mises", more, steps="steps: {count: 4, smallest: 0.01}"))
    assert process.returncode == 0, process.stderr
    assert "warning[D052]" in process.stderr and "of the 64 points" in process.stderr
    mesh = results.mesh("points", 0)
    depth = 4 - np.asarray(mesh.points)[:, 1]
    vertical = -2000 * G * depth
    deviator = np.sqrt(2 / 3) * 0.5 * np.abs(vertical)
    found = np.sqrt(2 / 3) * mesh.point_data["von_mises_stress"]
    np.testing.assert_allclose(found, np.minimum(deviator, radius), rtol=1e-9)
    np.testing.assert_allclose(mesh.point_data["pressure"], -2 / 3 * vertical, rtol=1e-12)
    assert (deviator > radius).sum() == int(process.stderr.split("warning[D052]")[1].split("at ")[1].split(" of the")[0]) > 0
    assert np.abs(mesh.point_data["equivalent_plastic_strain"]).max() == 0.0


def test_a_slope_is_refused_or_equilibrated(run_text):
    process, results = run_text(block(shape=SLOPE))
    assert process.returncode == 1
    assert "error[S017]" in process.stderr and "initial_imbalance: equilibrate" in process.stderr
    assert "initial state: out of balance" in process.stderr
    assert results.summary["code"] == "S017" and results.summary["steps"] == 0
    state = results.summary["initial_state"]
    assert not state["balanced"] and state["residual"] > 1e-3 and len(state["worst"]["node"]) == 2
    process, results = run_text(block("equilibrate", shape=SLOPE))
    assert process.returncode == 0, process.stderr
    assert results.summary["initial_state"] == state
    assert np.abs(results.mesh("points", -1).point_data["displacement"]).max() > 1e-4


def test_the_balance_of_energy_begins_with_the_energy_of_the_stress(run_text):
    push = ", {name: push, type: body-force, force: [2e3, -8e3]}"

    def run(steps):
        process, results = run_text(block(loads=WEIGHT + push, steps=f"steps: {{count: {steps}}}"))
        assert process.returncode == 0, process.stderr
        return results.summary, results.mesh("points", 0)

    (few, mesh), (many, _) = run(4), run(8)
    s = mesh.point_data["cauchy_stress"][:, :3]
    density = ((s**2).sum(axis=1) * 1.3 - 0.3 * s.sum(axis=1) ** 2) / 2e6
    energy = (density * mesh.point_data["volume"]).sum()
    for summary in (few, many):
        assert summary["initial_state"]["strain_energy"] == pytest.approx(energy, rel=1e-12)
    missing = [
        s["external_work"] + s["regridding_work"] - s["stabilisation_work"] - s["strain_energy"] + energy for s in (few, many)
    ]
    work = abs(many["external_work"])
    assert abs(missing[1]) < 1e-4 * work < 1e-2 * work < energy
    assert abs(missing[1]) < 0.4 * abs(missing[0]), missing  # of second order in the size of steps
    assert abs(many["balance_errors"]["energy"]["value"]) < 2e-3


def files(directory):
    names = [path for path in sorted(directory.iterdir()) if path.suffix in (".vtu", ".pvd", ".csv")]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in names}


def test_results_have_the_same_bits_after_a_restart_and_on_any_number_of_threads(run_text, mpm):
    push = ", {name: push, type: body-force, force: [2e3, -8e3]}"
    text = block(loads=WEIGHT + push, steps="steps: {count: 6}\ncheckpoint: {every: 2}")
    process, results = run_text(text, threads=1)
    assert process.returncode == 0, process.stderr
    again, others = run_text(text, threads=2)
    assert again.returncode == 0 and files(results.directory) == files(others.directory)
    assert others.summary["initial_state"] == results.summary["initial_state"]
    before, expected = others.summary, files(others.directory)
    (others.directory / "checkpoint_0006.mpm").unlink()
    resumed = mpm("run", others.directory.parent / "deck.yaml", "--out", others.directory, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert files(others.directory) == expected
    for key in ("initial_state", "strain_energy", "external_work"):
        assert others.summary[key] == before[key]


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"loads": ""}, "D051", "no gravity acts on it"),
        ({"loads": WEIGHT.replace("[0,", "[1,")}, "D051", "balances weight along y only"),
        ({"loads": WEIGHT.replace("-9.81", "9.81")}, "D051", "no weight pulls it down"),
        ({"loads": WEIGHT.replace("}", ", curve: [[0, 0], [1, 1]]}")}, "D051", "no weight pulls it down"),
        ({"stress": "{type: geostatic, surface: 3, k0: 0.5}"}, "D051", "reaches up to 4"),
        ({"stress": "{type: geostatic, surface: 5, k0: 0.5}"}, "D051", "ends at 4"),
        ({"stress": "{type: components, stress: {yz: 1}}"}, "D048", "the stress `yz`"),
        ({"stress": "{type: components, stress: {yy: x}}"}, "D021", "unknown name `x`"),
        ({"stress": "{type: components, stress: {yy: '1/(Y - 0.25)'}}"}, "D043", "1/(Y - 0.25)"),
        ({"steps": "steps: {count: 1, control: {type: arc-length}}"}, "D049", "initial stress"),
        (
            {"model": "neo-hookean", "stress": "{type: components, stress: {xx: -1e200}}"},
            "D051",
            "no elastic strain gives this stress",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(run_text, change, code, words):
    process, _ = run_text(block(**change))
    assert process.returncode == 2, process.stderr
    assert f"error[{code}]" in process.stderr and words in process.stderr, process.stderr
    assert "deck.yaml:" in process.stderr


def test_a_surcharge_and_a_curve_of_the_weight_count_at_time_0(run_text):
    weight = WEIGHT.replace("}", ", curve: [[0, 0.5], [1, 1]]}")
    stress = "{type: geostatic, surface: 4, k0: 0.5, surcharge: 3e3}"
    process, results = run_text(block("equilibrate", stress=stress, loads=weight))
    assert process.returncode == 0, process.stderr
    mesh = results.mesh("points", 0)
    vertical = -3e3 - 0.5 * 2000 * G * (4 - np.asarray(mesh.points)[:, 1])
    np.testing.assert_allclose(mesh.point_data["cauchy_stress"][:, 1], vertical, rtol=1e-12)
    assert not results.summary["initial_state"]["balanced"]


SURCHARGE_IN_SPACE = """
version: 1
parameters: {method: cpdi2}
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 3], spacing: 0.5}
materials: {clay: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - {name: ground, material: clay, method: "${method}", points_per_cell: 2,
     shape: {type: box, min: [0, 0, 0], max: [2, 2, 2]},
     initial_stress: {type: geostatic, surface: 2, k0: 0.5, surcharge: 3e3}}
surfaces: [{name: top, body: ground, part: {box: {min: [0, 0, 2], max: [2, 2, 2]}}}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 2}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: back, nodes: {y: 2}, fix: [y]}
  - {name: base, nodes: {z: 0}, fix: [x, y, z]}
loads:
  - {name: weight, type: gravity, acceleration: [0, 0, -9.81]}
  - {name: fill, type: traction, surface: top, traction: [0, 0, -3e3], curve: [[0, 1], [1, 1]]}
steps: {count: 1}
output: {every: 0}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi1", "cpdi2"])
def test_a_traction_balances_a_surcharge_in_space(run_text, method):
    process, results = run_text(SURCHARGE_IN_SPACE, "--set", f"method={method}")
    assert process.returncode == 0, process.stderr
    assert results.summary["initial_state"]["balanced"]


def mesh_of_layers(path):
    """Squares of side 1 in gmsh format 2.2, 3 by 10, in the groups `clay` below and `sand` above."""
    node = lambda i, j: 1 + i + 4 * j
    nodes = [f"{node(i, j)} {i} {j} 0" for j in range(11) for i in range(4)]
    cells = [(i, j, 1 if j < BORDER else 2) for j in range(10) for i in range(3)]
    elements = [
        f"{k + 1} 3 2 {group} {group} {node(i, j)} {node(i + 1, j)} {node(i + 1, j + 1)} {node(i, j + 1)}"
        for k, (i, j, group) in enumerate(cells)
    ]
    parts = {
        "MeshFormat": ["2.2 0 8"],
        "PhysicalNames": ["2", '2 1 "clay"', '2 2 "sand"'],
        "Nodes": [str(len(nodes)), *nodes],
        "Elements": [str(len(elements)), *elements],
    }
    path.write_text("".join(f"${name}\n" + "\n".join(lines) + f"\n$End{name}\n" for name, lines in parts.items()))


def test_layers_of_mesh_cells_are_as_exact(run_text, tmp_path):
    mesh_of_layers(tmp_path / "layers.msh")
    text = layers("plane-strain", "mpm")
    for before, after in [
        ("{type: structured, origin: [0, 0], size: [3, 12], spacing: 1}", f"{{type: gmsh, file: {tmp_path / 'layers.msh'}}}"),
        ("{type: box, min: [0, 6.0], max: [3, 10.0]}", "{type: cells, group: sand}"),
        ("{type: box, min: [0, 0], max: [3, 6.0]}", "{type: cells, group: clay}"),
    ]:
        assert before in text
        text = text.replace(before, after)
    process, results = run_text(text)
    assert process.returncode == 0, process.stderr
    assert results.summary["initial_state"]["residual"] < 1e-12
    for index in (0, -1):
        mesh = results.mesh("points", index)
        exact = layer_stress(mesh, 1)
        error = np.abs(mesh.point_data["cauchy_stress"] - exact).max(axis=1) / np.abs(exact).max(axis=1)
        assert error.max() < 1e-12, (index, error.max())
