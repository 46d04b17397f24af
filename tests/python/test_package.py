"""Decks, runs and results of the Python package: the same answers as the program, bit for bit."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml

from conftest import ROOT
from package import COUNTS, assert_same_points, column, load, mpm

DECKS = [
    ("beam", {}),
    ("collapse", {"h": 1, "n": 3}),
    ("footing", {}),
    ("excavation", {"h": 0.5}),  # in stages: bodies come and go, displacements are reset
]

INPUTS = sorted(ROOT.glob("inputs/**/*.yaml"))


def tables(directory):
    """The bytes of the tables of a run."""
    return {name: (Path(directory) / f"{name}.csv").read_bytes() for name in ("history", "quality", "convergence")}


def frame_bytes(directory):
    return {path.name: path.read_bytes() for path in Path(directory).glob("*.vtu")}


@pytest.mark.parametrize(("name", "parameters"), DECKS, ids=[name for name, _ in DECKS])
def test_all_ways_to_run_give_the_same_bits(program, tmp_path, name, parameters):
    deck = load(name, **parameters)
    settings = [word for key, value in parameters.items() for word in ("--set", f"{key}={value}")]
    command = [program, "run", ROOT / "inputs" / f"{name}.yaml", "--out", tmp_path / "program", *settings]
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=600)
    expected = mpm.read(tmp_path / "program")
    for threads in (1, 2):
        folder = tmp_path / str(threads)
        written = deck.run(out=folder, threads=threads, progress=False)
        kept = deck.run(threads=threads)
        assert tables(folder) == tables(tmp_path / "program")
        assert frame_bytes(folder) == frame_bytes(tmp_path / "program")
        run, steps = deck.start(threads=threads), []
        for step in run:
            steps.append(step)
        stepped = run.result()
        for result in (written, kept, stepped, mpm.read(folder)):
            assert result.history == expected.history
            assert result.quality == expected.quality
            assert result.convergence == expected.convergence
            assert all(result.summary[key] == expected.summary[key] for key in COUNTS)
        assert_same_points(kept.points, written.points)
        assert_same_points(stepped.points, written.points)
        # Steps tell what the tables tell.
        converged = expected.history["converged"] == 1
        assert [step.index for step in steps] == list(expected.history["step"][converged])
        assert [step.iterations for step in steps] == list(expected.history["iterations"][converged])
        for axis, letter in enumerate("xy"):
            for condition in steps[-1].reactions:
                column_of = expected.history[f"{condition}_r{letter}"][converged]
                np.testing.assert_array_equal([step.reactions[condition][axis] for step in steps], column_of)


@pytest.mark.parametrize("name", ["collapse", "excavation", "twist"])
def test_frames_have_the_points_of_the_run(tmp_path, name):
    """Files are in double precision by default."""
    parameters = {"collapse": {"h": 1, "n": 3, "steps": 4, "every": 1}, "excavation": {"h": 0.5, "every": 1}}
    run = load(name, **parameters.get(name, {"h": 0.5, "steps": 2})).start(out=tmp_path / "out", threads=2)
    seen = [(0.0, dict(run.points))] + [(step.time, dict(run.points)) for step in run]
    frames = run.result().frames
    assert [frame.time for frame in frames] == [time for time, _ in seen]
    for frame, (_, points) in zip(frames, seen):
        of_file = frame.points
        axes = points["position"].shape[1]
        for array in ("position", "displacement"):
            np.testing.assert_array_equal(of_file[array][:, :axes], points[array])
            assert not of_file[array][:, axes:].any()
        for array in ("deformation_gradient", "cauchy_stress", "elastic_strain", "volume", "body"):
            np.testing.assert_array_equal(of_file[array], points[array], err_msg=array)
        if "equivalent_plastic_strain" in points:
            np.testing.assert_array_equal(of_file["equivalent_plastic_strain"], points["equivalent_plastic_strain"])
    last = mpm.read(tmp_path / "out").points
    np.testing.assert_array_equal(last["cauchy_stress"], run.points["cauchy_stress"])


def test_points_are_mappings_of_arrays_in_any_place(tmp_path):
    result = load("collapse", h=2, n=2, steps=2).run(out=tmp_path / "out")
    for points in (result.points, result.frames[-1].points, mpm.read(tmp_path / "out").points):
        assert len(dict(points)) == len(points)
        assert all(len(array) == len(points.mass if "mass" in points else points.volume) for array in points.values())
        assert "equivalent_plastic_strain" in points and "nothing" not in points
        assert points == points and points != result.history
        assert str(len(points.volume)) in repr(points)
        with pytest.raises(KeyError, match="position"):
            points["nothing"]
    # Arrays are copies.
    result.points.position[:] = 0
    assert result.points.position.any()


def test_points_list_the_history_variables_of_all_laws():
    with load("triaxial", steps=1).start() as run:
        assert list(run.points)[len(mpm.Points.NAMES):] == [
            "preconsolidation_pressure", "equivalent_plastic_strain", "plastic_volumetric_strain", "plastic_work"
        ]
        assert len(dict(run.points)) == len(run.points)
    with load("beam", steps=1).start() as run:
        assert tuple(run.points) == mpm.Points.NAMES


def test_points_go_to_other_packages(tmp_path):
    pytest.importorskip("pandas")
    result = load("collapse", h=2, n=2, steps=2).run(out=tmp_path / "out")
    frame = result.points.to_dataframe()
    np.testing.assert_array_equal(frame["cauchy_stress_xy"], result.points.cauchy_stress[:, 3])
    np.testing.assert_array_equal(frame["position_y"], result.points.position[:, 1])
    assert "equivalent_plastic_strain" in frame and "deformation_gradient_zz" in frame
    assert list(result.history.to_dataframe()) == list(result.history)
    cloud = result.points.to_pyvista()
    np.testing.assert_array_equal(cloud.points[:, :2], result.points.position)
    np.testing.assert_array_equal(cloud.point_data["cauchy_stress"], result.points.cauchy_stress)
    of_file = result.frames[-1].points
    assert len(of_file.to_dataframe()) == of_file.to_pyvista().n_points == len(frame)
    assert result.frames[-1].to_pyvista().n_points == len(frame)


def test_tables_compare_by_content():
    result = load("beam", steps=2).run()
    assert result.history == load("beam", steps=2).run(threads=1).history
    assert result.history != result.quality and result.history != 3
    with pytest.raises(KeyError, match="tip_uy"):
        result.history["nothing"]


@pytest.mark.parametrize("path", INPUTS, ids=[str(path.relative_to(ROOT / "inputs")) for path in INPUTS])
def test_decks_survive_saving(tmp_path, path):
    deck = mpm.Deck.load(path)
    deck.save(tmp_path / "same.yaml")
    assert (tmp_path / "same.yaml").read_bytes() == path.read_bytes()
    deck["title"] = "Edited: 'quotes', ünïcode, # no comment\nand a second line"
    deck["steps" if "steps" in deck else "solver"] = deck.get("steps", {"max_iterations": 19})
    deck.save(tmp_path / "edited.yaml")
    again = mpm.Deck.load(tmp_path / "edited.yaml")
    assert again.data == deck.data
    again.save(tmp_path / "again.yaml")
    assert (tmp_path / "again.yaml").read_bytes() == (tmp_path / "edited.yaml").read_bytes()


SHORT = [path for path in INPUTS if path.parent.name == "new" or path.stem in ("cylinder", "twist")]


@pytest.mark.parametrize("path", SHORT, ids=[str(path.relative_to(ROOT / "inputs")) for path in SHORT])
def test_saved_decks_have_the_same_results(path):
    deck = mpm.Deck.load(path)
    edited = mpm.Deck(deck.data, directory=path.parent)
    edited["title"] = "edited"
    assert edited.text != deck.text
    some, others = deck.run(), edited.run()
    assert some.history == others.history
    assert_same_points(some.points, others.points)


def test_numbers_of_parameters_survive_saving(tmp_path):
    """The shortest decimal that reads back as the same number is written, also in an override of the program."""
    value = 0.1 + 0.2
    deck = load("beam", steps=3).with_parameters(h=0.25, smallest=value / 1000)
    deck.save(tmp_path / "saved.yaml")
    assert mpm.Deck.load(tmp_path / "saved.yaml")["parameters"]["smallest"] == value / 1000
    assert deck.run().history == mpm.Deck.load(tmp_path / "saved.yaml").run().history


def test_numpy_numbers_are_numbers():
    plain, other = column(), column()
    other["materials"]["clay"]["young"] = np.float64(1e6)
    other["loads"][0]["acceleration"] = np.array([0, -10])
    other["steps"]["count"] = np.int64(4)
    other["grid"]["size"] = (np.float32(1), np.int8(4))
    assert other.check() == plain.check()
    assert other.run().history == plain.run().history
    assert load("beam", steps=np.int64(2), h=np.float64(0.5)).run().history == load("beam", steps=2).run().history
    deck = load("beam").with_parameters(h=np.float32(0.5), steps=np.int32(7))
    assert yaml.safe_load(deck.text)["parameters"]["steps"] == 7
    assert deck["parameters"]["h"] == 0.5 and type(deck["parameters"]["steps"]) is int


def test_edits_reach_deep_and_copies_stay():
    deck = column()
    same, shallow = deck.copy(), deck.__copy__()
    deck["loads"][0]["acceleration"][1] = -20
    deck["title"] = "changed"
    assert same["loads"][0]["acceleration"] == shallow["loads"][0]["acceleration"] == [0, -10]
    assert "title" not in same and "title" not in shallow
    floor = [of.run().history["floor_ry"][-1] for of in (same, deck)]
    assert floor == pytest.approx([2 * 10 * 1000, 2 * 20 * 1000], rel=1e-9)
    del deck["title"]
    assert "title" not in deck and set(deck) == set(same)


def test_messages_name_lines_of_the_file(tmp_path):
    text = (ROOT / "inputs/beam.yaml").read_text().replace("young: 12e6", "young: -12e6")
    (tmp_path / "bad.yaml").write_text(text)
    deck = mpm.Deck.load(tmp_path / "bad.yaml")
    line = next(number for number, of in enumerate(text.splitlines(), 1) if "young" in of)
    (found,) = [of for of in deck.check() if of.severity == "error"]
    assert found.line == line and found.column == text.splitlines()[line - 1].index("-12e6") + 1
    assert found.pointer == "/materials/steel/young" and found.help
    assert found.code in str(found) and f"line {line}" in str(found)
    for way in (deck.run, deck.start, deck.with_parameters(steps=3).run):
        with pytest.raises(mpm.DeckError) as raised:
            way()
        assert raised.value.code == found.code and f"bad.yaml:{line}" in str(raised.value)
        assert raised.value.diagnostics == deck.check()
    deck["materials"]["steel"]["young"] = 12e6
    assert not [of for of in deck.check() if of.severity == "error"]


@pytest.mark.parametrize("path", sorted(ROOT.glob("tests/decks/*.yaml")), ids=lambda path: path.stem)
def test_check_finds_what_the_program_finds(program, path):
    """Every deck of tests/decks, good or bad: `check` raises nothing; YAML that cannot be read is found by `load`."""
    command = [program, "check", "--format", "json", path]
    process = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60)
    expected = [
        tuple(of[key] for key in ("code", "severity", "message", "line", "column", "path", "help"))
        for of in json.loads(process.stdout)["diagnostics"]
    ]
    try:
        deck = mpm.Deck.load(path)
    except mpm.DeckError as error:
        found = error.diagnostics
        assert error.code and str(error)
    else:
        found = deck.check()
        assert all(of.message for of in found)
        errors = [of.code for of in found if of.severity == "error"]
        if errors:
            with pytest.raises(mpm.DeckError) as raised:
                deck.start(threads=1)
            assert raised.value.code in errors
    shown = [(of.code, of.severity, of.message, of.line, of.column, of.pointer, of.help) for of in found]
    assert shown == expected


def test_meshes_are_found_beside_the_deck(tmp_path, monkeypatch):
    expected = load("annulus", steps=2).run().history
    monkeypatch.chdir(tmp_path)
    deck = load("annulus", steps=2)
    deck["title"] = "edited"
    assert deck.run().history == expected
    monkeypatch.chdir(ROOT / "inputs")
    assert mpm.Deck.load("annulus.yaml", steps=2).run().history == expected
    assert mpm.Deck(deck.data).run().history == expected
    assert mpm.Deck(deck.data, directory=ROOT / "inputs").run().history == expected


def test_parameters_are_those_of_the_deck():
    for make in (lambda **p: load("beam", **p), lambda **p: load("beam").with_parameters(**p)):
        with pytest.raises(mpm.UsageError, match="'depth'.*h, n, method"):
            make(depth=3)
        with pytest.raises(mpm.UsageError, match="number or a word"):
            make(h=[1])
    with pytest.raises(mpm.UsageError, match="none"):
        column().with_parameters(h=1)
    expected = load("beam", n=3, steps=2).run().history
    assert load("beam", n=3).with_parameters(steps=2).run().history == expected
    assert load("beam", n=4).with_parameters(n=3, steps=2).run().history == expected
    assert load("beam", n=4).run().history != expected
