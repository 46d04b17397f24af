"""Bodies that touch tools, walls and grid lines: cases in which a result was once wrong without a message."""

import numpy as np
import pytest
import yaml

from results import Results
from test_meshes import write

CLAY = {"model": "hencky", "young": 1e6, "poisson": 0.3, "density": 2000}


def deck(grid, shape, conditions, **rest):
    body = {"name": "b", "material": "m", "points_per_cell": 2, "shape": {"type": "box", "min": shape[0], "max": shape[1]}}
    body |= rest.pop("body", {})
    return {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, 0], **grid},
        "materials": {"m": CLAY},
        "bodies": [body],
        "boundary_conditions": conditions,
        **rest,
    }


@pytest.fixture
def run(mpm, tmp_path):
    """Runs a deck and returns its results; the outcome must be the expected one."""

    def results(deck, code=0):
        name = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        name.mkdir()
        (name / "deck.yaml").write_text(yaml.safe_dump(deck))
        process = mpm("run", name / "deck.yaml", "--out", name / "out")
        assert process.returncode == code, process.stderr
        return Results(name / "out") if code == 0 else process.stderr

    return results


def resting(steps, wall):
    """A block on a floor along a grid line: on nodes, on a tool with friction, or held on its surface."""
    conditions = [{"name": "side", "nodes": {"x": 1}, "fix": ["x"]}]
    rest = {}
    if wall == "tool":
        floor = {"name": "floor", "shape": {"type": "half-space", "point": [0.3, 1], "normal": [0, 1]}, "friction": 0.3}
        rest["tools"] = [floor]
    elif wall == "surface":
        rest["surfaces"] = [{"name": "bottom", "body": "b", "part": {"edge": 0}}]
        conditions.append({"name": "floor", "surface": "bottom", "fix": ["x", "y"]})
    else:
        conditions.append({"name": "floor", "nodes": {"y": 1}, "fix": ["x", "y"]})
    loads = [{"type": "gravity", "name": "g", "acceleration": [0, -10]}]
    grid = {"size": [4, 3], "spacing": 0.25}
    return deck(grid, [[1, 1], [2, 2]], conditions, loads=loads, steps={"count": steps}, **rest)


@pytest.mark.parametrize("wall", ["tool", "surface"])
@pytest.mark.parametrize("steps", [3, 8])
def test_no_node_below_a_resting_body_runs_away(run, wall, steps):
    """A corner may dip below the line by far less than a cell, and touch a node there that nothing else supports."""
    results, on_nodes = run(resting(steps, wall)), run(resting(1, "nodes"))
    assert results.summary["strain_energy"] == pytest.approx(on_nodes.summary["strain_energy"], rel=1.5e-2)
    for step in range(len(results.series("grid"))):
        assert np.abs(results.mesh("grid", step)["displacement_increment"]).max() < 0.1
    points, others = (of.mesh("points", -1) for of in (results, on_nodes))
    lowest = np.asarray(points.points)[:, 1] < 1.2
    syy = points["cauchy_stress"][:, 1], others["cauchy_stress"][:, 1]
    assert (syy[0][lowest] < 0.6 * syy[1][lowest].max()).all()


def test_standard_points_of_a_mesh_touch_tools_with_boxes(mpm, tmp_path):
    nodes = {i + 5 * j + 1: (i / 4, j / 4) for j in range(9) for i in range(5)}
    cells = [(a, a + 1, a + 6, a + 5) for j in range(8) for i in range(4) for a in [1 + i + 5 * j]]
    tool = {"name": "t", "shape": {"type": "half-space", "point": [0, 1], "normal": [0, -1]}, "uy": -0.1}
    conditions = [{"name": "base", "nodes": {"y": 0}, "fix": ["y"]}]
    conditions += [{"name": name, "nodes": {"x": x}, "fix": ["x"]} for name, x in (("left", 0), ("right", 1))]
    forces = {}
    for method in ("mpm", "cpdi2"):
        of_mesh = deck({}, [[0, 0], [1, 1]], conditions, tools=[tool], steps={"count": 10}, body={"method": method})
        of_mesh["grid"] = {"type": "gmsh", "file": "mesh.msh"}
        of_mesh["materials"] = {"m": {"model": "hencky", "young": 1e6, "poisson": 0}}
        write(tmp_path, nodes, cells, yaml.safe_dump(of_mesh))
        process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / method)
        assert process.returncode == 0, process.stderr
        forces[method] = Results(tmp_path / method).history["t_fy"][-1]
    exact = 1e6 * np.log(0.9) / 0.9
    assert forces["cpdi2"] == pytest.approx(exact, rel=1e-6)
    assert forces["mpm"] == pytest.approx(exact, rel=0.1)


def turned(angle):
    conditions = [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}]
    tool = {
        "name": "t",
        "shape": {"type": "circle", "center": [2, 2], "radius": 0.5},
        "uy": "-0.1*min(1, 2*factor)",
        "rotation": f"{angle}*max(0, 2*factor - 1)",
        "friction": 0.2,
    }
    grid = {"size": [4, 3], "spacing": 0.25}
    return deck(grid, [[0.5, 0], [3.5, 1.5]], conditions, tools=[tool], steps={"count": 2}, body={"method": "gimp"})


def test_nearly_a_full_turn_in_a_step_is_no_small_rotation_the_other_way(run):
    results = run(turned(350))
    assert results.history["t_mz"][-1] > 5000 and results.summary["failed_attempts"] > 0


def test_the_motion_that_a_tool_has_at_time_0_takes_place_in_the_first_step(run):
    conditions = [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}]
    histories = []
    for uy in ("-0.05 - 0.05*factor", -0.1):
        tool = {"name": "t", "shape": {"type": "box", "min": [1.5, 1.5], "max": [2.5, 2]}, "uy": uy}
        grid = {"size": [4, 3], "spacing": 0.25}
        results = run(deck(grid, [[0.5, 0], [3.5, 1.5]], conditions, tools=[tool], steps={"count": 4}))
        histories.append(results.history)
    assert histories[0]["t_uy"][-1] == pytest.approx(-0.1, rel=1e-12)
    assert histories[0]["t_fy"][-1] == pytest.approx(histories[1]["t_fy"][-1], rel=2e-2)


TOP = [{"name": "top", "body": "b", "part": {"edge": 2}}]
GRID = {"size": [8, 6], "spacing": 1}


def test_a_condition_on_a_surface_that_cannot_be_met_ends_the_run(run):
    conditions = [
        {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
        {"name": "floor", "nodes": {"y": 0}, "fix": ["x", "y"]},
        {"name": "p1", "surface": "base", "uy": -0.1},
    ]
    loads = [{"name": "w", "type": "gravity", "acceleration": [0, -10]}]
    base = [{"name": "base", "body": "b", "part": {"edge": 0}}]
    message = run(deck(GRID, [[0, 0], [4, 3]], conditions, surfaces=base, loads=loads, steps={"count": 2}), code=1)
    assert "S009" in message and "`p1` cannot be met" in message and "`base`" in message


def test_conditions_on_surfaces_keep_the_symmetry_of_a_body_wherever_it_lies(run):
    for start in (1, 2):
        conditions = [
            {"name": "floor", "nodes": {"y": 0}, "fix": ["x", "y"]},
            {"name": "press", "surface": "top", "fix": ["x"], "uy": -0.15},
        ]
        shape = [[start, 0], [start + 4, 3]]
        results = run(deck(GRID, shape, conditions, surfaces=TOP, steps={"count": 2}))
        history = results.history
        assert abs(history["press_rx"][-1]) < 1e-9 * abs(history["press_ry"][-1])
        points = results.mesh("points", -1)
        x, u = np.asarray(points.points), points["displacement"]
        mirrored = x * [-1, 1, 1] + [2 * start + 4, 0, 0]
        partner = np.linalg.norm(mirrored[:, None] - x[None], axis=2).argmin(axis=1)
        np.testing.assert_allclose(u[partner] * [-1, 1, 1], u, atol=1e-9)


def test_a_body_that_is_added_again_touches_tools_anew(run):
    """It is in the same state as another body in its place: no force of its first life acts on it."""
    forces = []
    for again in ("b", "b2"):
        of_stages = deck({"size": [4, 4], "spacing": 0.25}, [[0.5, 1], [3.5, 2]], [{"name": "side", "nodes": {"x": 0.5}, "fix": ["x"]}])
        of_stages["bodies"][0]["method"] = "gimp"
        if again != "b":
            of_stages["bodies"].append(of_stages["bodies"][0] | {"name": again})
        of_stages["tools"] = [
            {"name": "t", "shape": {"type": "half-space", "point": [0, 1], "normal": [0, 1]}, "friction": 0.3}
        ]
        of_stages["loads"] = [{"name": "g", "type": "gravity", "acceleration": [0, -10]}]
        of_stages["stages"] = [
            {"name": "rest", "steps": {"count": 2}, "factors": {"g": 1}},
            {"name": "again", "remove": ["b"], "add": [again], "steps": {"count": 2}},
            {"name": "hold", "steps": {"count": 1}},
        ]
        history = run(of_stages).history
        forces.append([history["t_fx"], history["t_fy"]])
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("method", ["gimp", "mpm", "cpdi1"])
def test_a_tool_at_rest_adds_no_energy(run, method):
    base = {"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}
    tool = {"name": "t", "shape": {"type": "circle", "center": [2, 3], "radius": 1.5}, "uy": -0.16}
    tool["curve"] = [[0, 0], [1, 1], [2, 1]]
    stages = [{"name": "push", "steps": {"count": 4}}, {"name": "still", "steps": {"count": 40}}]
    grid = {"origin": [-1, 0], "size": [6, 4], "spacing": 0.5}
    body = {"method": method}
    history = run(deck(grid, [[0, 0], [4, 1.5]], [base], tools=[tool], stages=stages, body=body)).history
    force, work = history["t_fy"], history["external_work"]
    # In the first step at rest, the grid is fresh once more.
    assert force[-1] == pytest.approx(force[5], rel=1e-3)
    assert work[-1] == pytest.approx(work[5], rel=1e-3)
