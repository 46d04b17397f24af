"""Pictures of results, and meshes of other programs."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mpm

pyvista = pytest.importorskip("pyvista")


@pytest.fixture(scope="module")
def footing(tmp_path_factory):
    """A run in the plane, with units."""
    deck = mpm.Deck.load("inputs/footing.yaml", h=0.5, steps=4, every=2)
    deck["units"] = {"length": "m", "force": "N"}
    folder = tmp_path_factory.mktemp("footing")
    return deck.run(folder, progress=False)


def steps(result):
    """The numbers of the steps whose points were written."""
    from mpm._picture import _frames

    return [frame.step for frame in _frames(result.directory)]


def ink(path):
    """The share of pixels that are not white, and the number of distinct colours."""
    image = pyvista.read(str(path))
    pixels = np.asarray(image.point_data.active_scalars)[:, :3]
    return (pixels < 250).any(axis=1).mean(), len(np.unique(pixels, axis=0))


def test_a_picture_shows_the_bodies(footing, tmp_path):
    written = footing.plot(out=tmp_path / "a.png")
    share, colours = ink(written)
    assert 0.2 < share < 0.95 and colours > 20


def test_fields_steps_and_exaggeration_change_the_picture(footing, tmp_path):
    first = steps(footing)[1]
    choices = [{}, {"field": "displacement:Y"}, {"step": first}, {"field": "displacement", "warp": 3}]
    drawn = [footing.plot(out=tmp_path / f"{k}.png", **choice).read_bytes() for k, choice in enumerate(choices)]
    assert len(set(drawn)) == len(choices)


def test_the_scale_takes_its_unit_from_the_deck(footing):
    from mpm._picture import Drawn, Scene, _frames

    scene = Scene(Drawn(footing.directory, "von_mises_stress", None, False), _frames(footing.directory)[-1])
    assert [scene.unit(kind) for kind in ("stress", "length", "time", None)] == ["Pa", "m", "s", ""]
    summary = json.loads((footing.directory / "summary.json").read_text())
    assert summary["units"]["density"] == "kg/m³" and summary["units"]["moment"] == "N·m"


def test_what_does_not_exist_is_named(footing, tmp_path):
    for wrong, words in [
        ({"field": "temperature"}, "no field `temperature`"),
        ({"field": "cauchy_stress:XQ"}, "no component `XQ`; it has XX, YY"),
        ({"step": 99}, "no files of step 99; it has those of the steps 0, "),
        ({"step": "soon"}, "give a number, last or all"),
    ]:
        with pytest.raises(mpm.UsageError, match="(?s)" + words.replace("(", r"\(")):
            footing.plot(out=tmp_path / "x.png", **wrong)
    with pytest.raises(mpm.UsageError, match="ends in .png"):
        footing.plot(out=tmp_path / "x.gif")
    with pytest.raises(mpm.ResultsError, match="there are no results"):
        from mpm._picture import draw

        draw(tmp_path, out=tmp_path / "x.png")


def test_a_film_has_a_frame_for_every_file(footing, tmp_path):
    imageio = pytest.importorskip("imageio")
    film = footing.animate("displacement", out=tmp_path / "film.gif")
    assert len(imageio.mimread(film)) == len(footing.frames) == 3


def test_solids_and_tools_are_drawn(tmp_path):
    deck = mpm.Deck.load("inputs/plough.yaml", h=0.5, steps=1)
    result = deck.run(tmp_path, progress=False)
    share, colours = ink(result.plot(out=tmp_path / "plough.png"))
    assert 0.1 < share < 0.9 and colours > 50


def test_the_command_draws_the_newest_results(footing, tmp_path):
    copied = tmp_path / "results" / "later"
    copied.parent.mkdir()
    copied.symlink_to(footing.directory)
    process = subprocess.run(
        [sys.executable, "-m", "mpm", "picture", "--out", "later.png"], cwd=tmp_path, capture_output=True, text=True
    )
    assert process.returncode == 0, process.stderr
    assert process.stdout == "the picture is later.png\n" and "the newest results: results/later" in process.stderr
    assert ink(tmp_path / "later.png")[0] > 0.2
    wrong = subprocess.run(
        [sys.executable, "-m", "mpm", "picture", "results/later", "--field", "x"], cwd=tmp_path, capture_output=True, text=True
    )
    assert wrong.returncode == 2 and wrong.stderr.startswith("error: the results have no field `x`")


def test_a_run_draws_at_its_end(tmp_path):
    process = subprocess.run(
        [sys.executable, "-m", "mpm", "run", "inputs/footing.yaml", "--set", "h=0.5", "--set", "steps=2", "--picture",
         "--out", tmp_path], capture_output=True, text=True,
    )
    assert process.returncode == 0, process.stderr
    assert "the picture is" in process.stderr and ink(tmp_path / "picture.png")[0] > 0.2


def test_the_program_says_how_to_get_the_package(mpm, tmp_path):
    process = mpm("picture", "results/beam")
    assert process.returncode == 2
    assert 'pip install ".[picture]"' in process.stderr and "python -m mpm picture results/beam" in process.stderr


# Meshes of other programs.

meshio = pytest.importorskip("meshio")


def size_of(path):
    """Total area or volume, by meshio."""
    mesh = meshio.read(path)
    total = 0.0
    for block in mesh.cells:
        x = mesh.points[block.data]
        if block.type == "tetra":
            total += np.abs(np.linalg.det(x[:, 1:] - x[:, :1])).sum() / 6
        elif block.type == "triangle":
            total += 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum()
    return total


def test_sets_of_abaqus_become_groups(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh = meshio.Mesh(
        points, [("triangle", [[0, 1, 2], [0, 2, 3]])], cell_sets={"soil": [np.array([0, 1])], "crest": [np.array([1])]}
    )
    meshio.write(tmp_path / "part.inp", mesh)
    import mpm as package

    written = package.convert(tmp_path / "part.inp", scale=2.0)
    assert written == tmp_path / "part.msh"
    text = written.read_text()
    assert '2 1 "soil"' in text and '2 2 "crest"' in text
    deck = package.Deck({
        "version": 1, "grid": {"type": "gmsh", "file": str(written)},
        "materials": {"m": {"model": "hencky", "young": 1e5, "poisson": 0.3, "density": 1}},
        "bodies": [{"name": "b", "material": "m", "shape": {"type": "cells", "group": "soil"}, "method": "mpm", "points_per_triangle": 4}],
        "boundary_conditions": [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}],
        "loads": [{"name": "w", "type": "gravity", "acceleration": [0, -1]}], "steps": {"count": 1},
    })
    assert deck.run(progress=False).points.volume.sum() == pytest.approx(4.0, rel=1e-4)


def test_prisms_and_pyramids_become_tetrahedra_of_the_same_volume(tmp_path):
    import mpm as package

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [0.5, 0.5, 2]], float)
    mesh = meshio.Mesh(points, [("wedge", [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]), ("pyramid", [[4, 5, 6, 7, 8]])])
    meshio.write(tmp_path / "mixed.vtu", mesh)
    written = package.convert(tmp_path / "mixed.vtu")
    assert size_of(written) == pytest.approx(1 + 1 / 3, rel=1e-14)
    # The program reads it, so the tetrahedra fit together.
    deck = package.Deck({
        "version": 1, "analysis": {"idealisation": "solid"}, "grid": {"type": "gmsh", "file": str(written)},
        "materials": {"m": {"model": "hencky", "young": 1e5, "poisson": 0.3, "density": 1}},
        "bodies": [{"name": "b", "material": "m", "shape": {"type": "cells"}, "method": "mpm", "points_per_tetrahedron": 4}],
        "boundary_conditions": [{"name": "base", "nodes": {"z": 0}, "fix": ["x", "y", "z"]}],
        "loads": [{"name": "w", "type": "gravity", "acceleration": [0, 0, -1]}], "steps": {"count": 1},
    })
    assert [d.code for d in deck.check() if d.severity == "error"] == []


def test_axes_are_exchanged(tmp_path):
    import mpm as package

    mesh = meshio.Mesh([[0, 7, 0], [2, 7, 0], [0, 7, 1]], [("triangle", [[0, 1, 2]])])
    meshio.write(tmp_path / "upright.vtu", mesh)
    written = package.convert(tmp_path / "upright.vtu", tmp_path / "flat.msh", axes="xz")
    assert meshio.read(written).points.tolist() == [[0, 0, 0], [2, 0, 0], [0, 1, 0]]
    with pytest.raises(package.UsageError, match="axes"):
        package.convert(tmp_path / "upright.vtu", axes="xw")
