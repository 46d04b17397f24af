"""Exit codes, failed runs, and the same answers from any number of threads."""

import json
import os
import re
import signal
import subprocess
import time

import jsonschema
import numpy as np
import pytest

from conftest import BEAM, ROOT
from results import Results

DECKS = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "inputs").glob("*.yaml"))


def with_max_iterations(deck, iterations):
    """The text of a deck with another limit of the Newton iterations."""
    if re.search(r"\bmax_iterations\s*:", deck):
        return re.sub(r"(\bmax_iterations\s*:\s*)\S+?(?=[\s,}])", rf"\g<1>{iterations}", deck)
    if re.search(r"^solver\s*:", deck, re.MULTILINE):
        return re.sub(r"^solver\s*:", f"solver:\n  max_iterations: {iterations}", deck, count=1, flags=re.MULTILINE)
    return f"{deck.rstrip()}\nsolver:\n  max_iterations: {iterations}\n"


@pytest.mark.parametrize("deck", DECKS)
def test_decks_of_the_gallery_are_valid(mpm, deck):
    process = mpm("check", deck)
    assert process.returncode == 0, process.stderr


def test_there_are_decks():
    assert {"inputs/beam.yaml", "inputs/collapse.yaml"} <= set(DECKS)


@pytest.mark.parametrize(
    "change, complaint",
    [
        (lambda text: text + "\nunheard_of: 1\n", "unheard_of"),
        (lambda text: re.sub(r"^version\s*:.*$", "", text, flags=re.MULTILINE), "version"),
        (lambda text: text + "\n]\n", "deck.yaml"),
    ],
    ids=["unknown key", "no version", "no YAML"],
)
def test_invalid_decks(mpm, tmp_path, change, complaint):
    deck = tmp_path / "deck.yaml"
    deck.write_text(change((ROOT / "inputs" / "beam.yaml").read_text()))
    for command in (["check", deck], ["run", deck, "--out", tmp_path / "out"]):
        process = mpm(*command)
        assert process.returncode == 2, process.stderr
        assert complaint in process.stderr
        assert "panicked" not in process.stderr
    assert not list(tmp_path.glob("out/*.vtu"))


def test_usage_errors(mpm, tmp_path):
    assert mpm("check", tmp_path / "missing.yaml").returncode == 2
    assert mpm("run").returncode == 2
    assert mpm("check", "inputs/beam.yaml", "--set", "h=nonsense+").returncode == 2


def test_a_prediction_for_ranks_heeds_the_options_of_check(mpm):
    words = ("check", "inputs/beam.yaml", "--ranks", "4", "--set", "tolerance=0.1")
    assert mpm(*words).returncode == 0
    process = mpm(*words, "--deny-warnings")
    assert process.returncode == 2 and "error[D045]" in process.stderr and process.stdout == "", process.stderr
    process = mpm("check", "tests/decks/unknown_key.yaml", "--ranks", "4", "--format", "json")
    report = json.loads(process.stdout)
    assert process.returncode == 2 and process.stderr == "" and report["size"] is None
    assert [found["code"] for found in report["diagnostics"]] == ["D006"]


def test_schema_is_a_schema(mpm):
    process = mpm("schema")
    assert process.returncode == 0, process.stderr
    schema = json.loads(process.stdout)
    jsonschema.Draft7Validator.check_schema(schema)
    validator = jsonschema.Draft7Validator(schema)
    assert not validator.is_valid({"version": 1, "unheard_of": 1})


def test_failed_run_leaves_equilibrated_steps_only(mpm, tmp_path, beam):
    iterations = beam.history["iterations"].astype(int)
    # A limit that the first step meets and a later one does not, if there is such a limit.
    later = np.flatnonzero(iterations > iterations[0])
    limit, converged = (iterations[0], later[0]) if later.size else (1, 0)
    deck = tmp_path / "deck.yaml"
    deck.write_text(with_max_iterations((ROOT / "inputs" / "beam.yaml").read_text(), limit))
    settings = [word for name, value in (BEAM | {"smallest": 1}).items() for word in ("--set", f"{name}={value}")]
    process = mpm("run", deck, "--out", tmp_path / "out", *settings)
    assert process.returncode == 1, process.stderr
    assert "panicked" not in process.stderr and process.stderr.strip()

    failed = Results(tmp_path / "out")
    assert len(failed.series("points")) == converged + 1
    for (time, path), (expected_time, expected) in zip(failed.series("points"), beam.series("points")):
        assert time == expected_time
        assert path.read_bytes() == expected.read_bytes()
    history = failed.history
    np.testing.assert_array_equal(history["step"], np.arange(1, converged + 1))
    assert (history["residual"] <= 1e-9).all()
    assert failed.table("convergence")["step"].max() == converged + 1, "the failed iterations are on record"
    written = {path.name for path in failed.directory.iterdir()}
    assert not {name for name in written if name.endswith(".tmp")}
    listed = {path.name for name in ("points", "domains", "grid") for _, path in failed.series(name)}
    failures = {"failed_points.vtu", "failed_grid.vtu"}
    assert {name for name in written if name.endswith(".vtu")} == listed | failures and not listed & failures
    if "summary.json" in written:
        assert failed.summary["outcome"] != "completed"


def test_files_do_not_depend_on_the_number_of_threads(analyse):
    one, two = (analyse("inputs/beam.yaml", threads=threads, **BEAM) for threads in (1, 2))
    names = sorted(path.name for path in one.directory.iterdir() if path.suffix in (".vtu", ".pvd", ".csv"))
    assert any(name.endswith(".vtu") for name in names)
    for name in names:
        assert (one.directory / name).read_bytes() == (two.directory / name).read_bytes(), name


def test_a_point_that_leaves_the_grid_is_named(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    text = (ROOT / "inputs" / "shear.yaml").read_text()
    assert "size: [8, 1]" in text
    deck.write_text(text.replace("size: [8, 1]", "size: [4, 1]"))
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    found = re.search(r"step (\d+): point (\d+) of body `square` at \((.*), (.*)\) is outside the grid", process.stderr)
    assert found, process.stderr
    assert float(found[3]) > 4
    results = Results(tmp_path / "out")
    assert results.summary["outcome"] == "failed"
    assert results.history["step"].max() == int(found[1]) - 1
    # Files of the steps of the deck, and of the last one, which is a smaller one.
    times, step = results.history["time"], 1 / 30
    whole = np.abs(times / step - np.round(times / step)) < 1e-9
    expected = {0.0, *times[whole], times[-1]}
    assert {time for time, _ in results.series("points")} == expected and not whole[-1]


def test_ctrl_c_ends_a_run_with_complete_files(tmp_path, program):
    out = tmp_path / "out"
    command = [program, "run", ROOT / "inputs" / "collapse.yaml", "--out", out, "--set", "n=9", "--set", "steps=400"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not (out / "points_0003.vtu").exists():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=120)
    assert process.returncode == 130, messages
    assert "interrupted" in messages
    results = Results(out)
    assert results.summary["outcome"] == "interrupted"
    steps = results.history["step"]
    assert len(results.series("points")) == len(steps) + 1
    assert all(mesh.n_points == results.summary["points"] for mesh in results.meshes("points"))
    assert not list(out.glob("*.tmp"))


def test_body_off_the_grid_lines_names_the_edge(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    text = (ROOT / "inputs" / "beam.yaml").read_text()
    deck.write_text(text.replace("min: [0, 9]", "min: [0, 9.1]"))
    process = mpm("check", deck)
    assert process.returncode == 2
    assert "9.1" in process.stderr and "0.1" in process.stderr and "min" in process.stderr, process.stderr


SQUARE = """
version: 1
grid: {{type: structured, origin: [0, 0], size: [4, 4], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e3, poisson: 0.2, density: 1}}}}
bodies: [{{name: square, material: m, shape: {{type: box, min: [0, 0], max: [2, 2]}}, method: mpm, points_per_cell: 3}}]
boundary_conditions: [{conditions}]
loads: [{loads}]
steps: {{count: 2}}
output: {{probes: [{{name: corner, body: square, nearest: [2, 2]}}]}}
"""


def square(mpm, tmp_path, conditions, loads=""):
    deck = tmp_path / "deck.yaml"
    deck.write_text(SQUARE.format(conditions=conditions, loads=loads))
    return mpm("run", deck, "--out", tmp_path / "out")


@pytest.mark.parametrize(
    "conditions, axis",
    [("", "x"), ("{name: base, nodes: {y: 0}, fix: [y]}", "x"), ("{name: side, nodes: {x: 0}, fix: [x]}", "y")],
)
def test_a_body_that_nothing_holds_is_an_error(mpm, tmp_path, conditions, axis):
    process = square(mpm, tmp_path, conditions, "{name: g, type: gravity, acceleration: [0, -1]}")
    assert process.returncode == 2, process.stderr
    assert "error[D035]: no boundary condition holds the body `square`" in process.stderr
    assert f"along {axis}" in process.stderr and "deck.yaml:5:" in process.stderr
    assert not (tmp_path / "out").exists()


def test_a_mechanism_is_an_error_and_no_panic(mpm, tmp_path):
    deck = tmp_path / "deck.yaml"
    text = SQUARE.replace("max: [2, 2]}}, method: mpm, points_per_cell: 3", "max: [1, 1]}}, method: mpm, points_per_cell: 1")
    assert text != SQUARE
    conditions = "{name: base, nodes: {y: 0}, fix: [x, y]}"
    deck.write_text(text.format(conditions=conditions, loads="{name: g, type: gravity, acceleration: [0, -1]}"))
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    assert "singular" in process.stderr and "panicked" not in process.stderr
    assert Results(tmp_path / "out").summary["outcome"] == "failed"


def test_a_curve_that_starts_above_zero_moves_at_once(mpm, tmp_path):
    conditions = "{name: base, nodes: {y: 0}, fix: [x, y]}, {name: top, nodes: {y: 2}, uy: 0.1, ux: 0, curve: [[0, 1], [1, 1]]}"
    process = square(mpm, tmp_path, conditions)
    assert process.returncode == 0, process.stderr
    history = Results(tmp_path / "out").history
    np.testing.assert_allclose(history["corner_uy"], 0.1 * 11 / 12, rtol=1e-3)


def test_conditions_that_agree_up_to_rounding_do_not_conflict(mpm, tmp_path):
    conditions = '{name: base, nodes: {y: 0}, ux: "0.1*x", uy: 0}, {name: side, nodes: {x: 2}, ux: "0.1 + 0.1", uy: 0}'
    assert square(mpm, tmp_path, conditions + ', {name: top, nodes: {y: 2}, uy: 0}').returncode == 0
    process = square(mpm, tmp_path, '{name: a, nodes: {y: 0}, ux: 0.1, uy: 0}, {name: b, nodes: {x: 0}, ux: 0.2}')
    assert process.returncode == 2
    assert "error[D042]" in process.stderr and "`a` and `b`" in process.stderr, process.stderr
    assert "(0.000000, 0.000000)" in process.stderr


def test_nobody_needs_to_read_the_messages(tmp_path, program):
    out = tmp_path / "out"
    read, write = os.pipe()
    os.close(read)
    command = [program, "run", ROOT / "inputs" / "beam.yaml", "--out", out, "--set", "steps=20"]
    assert subprocess.run(command, stderr=write, timeout=120).returncode == 0
    os.close(write)
    assert Results(out).summary["outcome"] == "completed"


def test_too_many_threads_are_refused(mpm, tmp_path):
    for threads in ("0", "100000"):
        assert mpm("run", "inputs/beam.yaml", "--out", tmp_path, "--threads", threads).returncode == 2
