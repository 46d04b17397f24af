"""Loads, curves, selections and files of a deck with two bodies, against balances and closed forms."""

import numpy as np
import pytest

from conftest import ROOT
from results import Results, deformation_gradients, tensors

DECK = ROOT / "tests" / "python" / "features.yaml"
SPACING = np.array([0.5, 0.25])
STEPS, END_TIME = 10, 4.0
BLOCK, TOWER = 0, 1


@pytest.fixture(scope="module")
def features(analyse):
    return analyse(DECK)


@pytest.fixture(scope="module")
def every_third(analyse):
    return analyse(DECK, every=3)


@pytest.fixture(scope="module")
def run_text(mpm, tmp_path_factory):
    """Runs the text of a deck into a new directory and returns its results."""

    def run(text):
        directory = tmp_path_factory.mktemp("text")
        (directory / "deck.yaml").write_text(text)
        process = mpm("run", directory / "deck.yaml", "--out", directory / "out")
        assert process.returncode == 0, process.stderr
        return Results(directory / "out")

    return run


def body_field(mesh, body, name):
    return np.asarray(mesh.point_data[name])[mesh.point_data["body_id"] == body]


def positions(mesh, body):
    return np.asarray(mesh.points)[mesh.point_data["body_id"] == body, :2]


def reaction(results, condition):
    history = results.history
    return np.stack([history[f"{condition}_rx"], history[f"{condition}_ry"]], axis=1)


def lattice(low, high, counts):
    """Centres of an even subdivision of a box, x fastest."""
    low, side = np.array(low), (np.array(high) - low) / counts
    j, i = np.divmod(np.arange(np.prod(counts)), counts[0])
    return low + (np.stack([i, j], axis=1) + 0.5) * side


def test_points_of_the_bodies(features):
    mesh = features.mesh("points", 0)
    cases = [
        # 2 x 4 cells with 3 x 2 points each.
        (BLOCK, "block", lattice([-0.5, -0.5], [0.5, 0.5], [6, 8])),
        # A side of 1 at distances of 0.1 and 0.125.
        (TOWER, "tower", lattice([2.03, 0.0], [3.03, 1.0], [10, 8])),
    ]
    for body, name, expected in cases:
        np.testing.assert_allclose(positions(mesh, body), expected, rtol=0, atol=1e-14)
        np.testing.assert_allclose(body_field(mesh, body, "volume"), 1 / len(expected), rtol=1e-13)
        assert features.summary["bodies"][name]["points"] == len(expected)
    corners = np.asarray(features.mesh("domains", 0).points).reshape(-1, 4, 3)
    np.testing.assert_allclose(np.ptp(corners, axis=1), [[0.1, 0.125, 0.0]] * 80, rtol=0, atol=1e-14)


def test_materials_are_numbered_by_name(features):
    # In the order of the alphabet, jelly before sand; the deck has them the other way round.
    for mesh in features.meshes("points"):
        np.testing.assert_array_equal(body_field(mesh, BLOCK, "material_id"), 1)
        np.testing.assert_array_equal(body_field(mesh, TOWER, "material_id"), 0)
    for mesh in features.meshes("domains"):
        np.testing.assert_array_equal(mesh.cell_data["material_id"], 0)
        np.testing.assert_array_equal(mesh.cell_data["body_id"], TOWER)


def test_gravity_acts_on_its_body_and_follows_its_curve(features):
    time = features.history["time"]
    np.testing.assert_allclose(time, END_TIME * np.arange(1, STEPS + 1) / STEPS, rtol=1e-15)
    factor = np.interp(time, [0, 0.8, 2, 4], [0, 1, -0.5, 1])
    mass = 2000.0
    expected = -np.outer(factor, [0.5 * mass, -9.81 * mass])
    held = np.stack([reaction(features, "pin")[:, 0], reaction(features, "floor")[:, 1]], axis=1)
    np.testing.assert_allclose(held, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_array_equal(reaction(features, "pin")[:, 1], 0)
    np.testing.assert_array_equal(reaction(features, "floor")[:, 0], 0)


def body_force(x):
    x, y = x.T
    return np.stack([10 * x * y + np.where(y > 0.8, 5, 0), -100 * (x - y) ** 2], axis=1)


def test_body_force_acts_on_the_state_at_the_start_of_the_step(features):
    # Eq. (24): the formula at the position, times the volume, that each point has when the step begins.
    meshes = features.meshes("points")
    factor = np.interp(features.history["time"], [0, 1.6, 3.2, 4], [0, 1, -0.4, 0.8])
    x = np.array([positions(mesh, TOWER) for mesh in meshes])
    volume = np.array([body_field(mesh, TOWER, "volume") for mesh in meshes])

    def balance(x, volume):
        total = np.array([(body_force(x) * volume[:, None]).sum(axis=0) for x, volume in zip(x, volume)])
        return -factor[:, None] * total

    start, first = slice(0, STEPS), [0] * STEPS
    expected = balance(x[start], volume[start])
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(reaction(features, "table") / scale, expected / scale, rtol=0, atol=1e-7)
    for other in [balance(x[first], volume[start]), balance(x[start], volume[first]), balance(x[1:], volume[1:])]:
        assert (np.abs(other - expected).max(axis=0) > 1e-3 * scale).all(), "the case cannot tell them apart"


def test_conditions_hold_the_nodes_that_they_select(features):
    floor_x, table_x = [-0.5, 0.0, 0.5], [2.0, 2.5, 3.0, 3.5]
    for step, mesh in enumerate(features.meshes("grid")[1:]):
        x, y = np.asarray(mesh.points).T[:2]
        forces, moved = mesh.point_data["reaction"], mesh.point_data["displacement_increment"]
        floor, pin = y == -0.5, (x == 0) & (y == -0.5)
        table = (x >= 2) & (x <= 3.5) & (y >= -0.25) & (y <= 0)
        for axis, held in enumerate([pin | table, floor | table]):
            np.testing.assert_array_equal(forces[~held, axis], 0)
            np.testing.assert_array_equal(moved[held, axis], 0)
            assert (moved[~held, axis] != 0).all()
        assert sorted(x[floor]) == floor_x and sorted(x[table & (y == 0)]) == table_x
        assert (forces[floor, 1] != 0).all() and (forces[table & (y == 0), :2] != 0).all()
        for name, nodes in [("floor", floor & ~pin), ("table", table)]:
            expected = reaction(features, name)[step]
            if name == "floor":
                expected = expected - [0.0, forces[pin, 1].sum()]
            np.testing.assert_allclose(forces[nodes, :2].sum(axis=0), expected, rtol=1e-9, atol=1e-9)


def test_files_of_every_third_step_and_the_last(features, every_third):
    steps = [0, 3, 6, 9, 10]
    for name in ("points", "domains", "grid"):
        series = every_third.series(name)
        assert [path.name for _, path in series] == [f"{name}_{step:04}.vtu" for step in steps]
        written = sorted(path.name for path in every_third.directory.glob(f"{name}_*.vtu"))
        assert written == [path.name for _, path in series]
        for (time, path), step in zip(series, steps):
            expected_time, expected = features.series(name)[step]
            assert time == expected_time == pytest.approx(END_TIME * step / STEPS)
            assert path.read_bytes() == expected.read_bytes(), path.name
    for name in ("history.csv", "convergence.csv"):
        assert (every_third.directory / name).read_bytes() == (features.directory / name).read_bytes()


def test_extents_of_the_bodies(features):
    last, domains = features.mesh("points", -1), features.mesh("domains", -1)
    x = positions(last, BLOCK)
    half = 0.5 * np.sqrt(body_field(last, BLOCK, "volume"))[:, None]  # footnote 7 of the paper
    corners = np.asarray(domains.points)[:, :2]
    tower = positions(last, TOWER)
    expected = {"block": (x, x - half, x + half), "tower": (tower, corners, corners)}
    for body, (points, low, high) in expected.items():
        extent = features.summary["bodies"][body]["extent"]
        for which, low, high in [("points", points, points), ("domain", low, high)]:
            np.testing.assert_allclose(extent[which]["min"], low.min(axis=0), rtol=0, atol=1e-13)
            np.testing.assert_allclose(extent[which]["max"], high.max(axis=0), rtol=0, atol=1e-13)


def test_domains_follow_their_corners_unless_stated(features, run_text):
    def with_update(update):
        text = DECK.read_text()
        assert text.count("method: gimp,") == 1
        return run_text(text.replace("method: gimp,", f"method: gimp, domain_update: {update},"))

    files = sorted(path.name for path in features.directory.iterdir() if path.suffix in (".vtu", ".csv"))
    assert "domains_0010.vtu" in files
    corners, other = with_update("corners"), with_update("diagonal-corrected")
    for name in files:
        assert (features.directory / name).read_bytes() == (corners.directory / name).read_bytes(), name
    first, second = (np.asarray(results.mesh("domains", -1).points) for results in (features, other))
    assert np.abs(first - second).max() > 1e-4, "the case cannot tell the updates apart"


PRESS = {"young": 1e6, "poisson": 0.2, "yield": 8e3, "way": -0.3, "curve": ([0, 0.5, 2], [0, 0.4, 1])}
PRESS_DECK = """
version: 1
grid: {type: structured, origin: [0, 0], size: [0.5, 2], spacing: [0.5, 1]}
materials: {clay: {model: von-mises, young: 1e6, poisson: 0.2, deviatoric_yield_stress: 8e3}}
bodies:
  - {name: column, material: clay, shape: {type: box, min: [0, 0], max: [0.5, 2]}, method: mpm, points_per_cell: 3}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 0.5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: press, nodes: {y: 2}, uy: -0.3, curve: [[0, 0], [0.5, 0.4], [2, 1]]}
steps: {count: 8, end_time: 2}
"""


@pytest.fixture(scope="module")
def press(run_text):
    """A column of two cells pressed together between smooth walls: F = diag(1, F_yy, 1)."""
    return run_text(PRESS_DECK)


def test_prescribed_displacement_follows_its_curve(press):
    time = np.linspace(0, 2, 9)
    increments = np.diff(PRESS["way"] * np.interp(time, *PRESS["curve"]))
    for mesh, expected in zip(press.meshes("grid")[1:], increments, strict=True):
        top = np.asarray(mesh.points)[:, 1] == 2
        np.testing.assert_allclose(mesh.point_data["displacement_increment"][top, 1], expected, rtol=1e-13)


def test_plastic_strain_of_uniaxial_compression(press):
    # All strains are coaxial and grow in one direction. Of the deviator of the logarithmic strain the law keeps
    # rho_y / 2G as elastic, eq. (43); the rest is plastic.
    limit = PRESS["yield"] / (PRESS["young"] / (1 + PRESS["poisson"]))
    for step, mesh in enumerate(press.meshes("points")[1:], start=1):
        gradients = deformation_gradients(mesh)
        np.testing.assert_allclose(gradients[:, [0, 0, 1, 2], [0, 1, 0, 2]], [[1, 0, 0, 1]] * 18, rtol=0, atol=1e-12)
        total = np.log(gradients[:, 1, 1])
        assert (total < 0).all()
        amount = np.maximum(np.sqrt(2 / 3) * -total - limit, 0)
        assert step < 3 or (amount > 0.01).all(), "the case is meant to yield"
        expected = amount[:, None, None] * np.diag([1, -2, 1]) / np.sqrt(6)
        plastic = tensors(mesh.point_data["plastic_strain"])
        np.testing.assert_allclose(plastic, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(np.trace(plastic, axis1=1, axis2=2), 0, rtol=0, atol=1e-10)
        elastic = tensors(mesh.point_data["elastic_strain"])
        np.testing.assert_allclose(elastic + plastic, total[:, None, None] * np.diag([0, 1, 0]), rtol=0, atol=1e-10)
        equivalent = mesh.point_data["equivalent_plastic_strain"]
        np.testing.assert_allclose(equivalent, np.sqrt(2 / 3) * amount, rtol=0, atol=1e-10)
