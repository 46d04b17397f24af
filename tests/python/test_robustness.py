"""What the program does with names, files and limits that nobody would choose."""

import json
import os
import resource
import shutil
import subprocess

import pytest

from results import assert_sound
from test_limits import LONG, start, wait_for
from test_resume import SMALL, deck_of

BLOCK = """version: 1
title: TITLE
analysis: {idealisation: solid}
parameters: {n: 8, linear: direct}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 2], spacing: "${2/n}"}
materials: {clay: {model: neo-hookean, young: 1e6, poisson: 0.3, density: 2000}}
bodies: [{name: block, material: clay, method: gimp, shape: {type: box, min: [0, 0, 0], max: [2, 2, 2]}, points_per_cell: 2}]
boundary_conditions: [{name: floor, nodes: {z: 0}, fix: [x, y, z]}]
loads: [{name: weight, type: gravity, acceleration: [0, 0, -1]}]
steps: {count: 1}
solver: {linear: "${linear}"}
output: {every: 1}
"""


def test_names_that_are_not_utf8(program, tmp_path):
    deck = os.fsencode(tmp_path) + b"/deck\xff.yaml"
    shutil.copy(deck_of(tmp_path), deck)
    out, log = os.fsencode(tmp_path) + b"/out\xfe", os.fsencode(tmp_path) + b"/log\xfd"
    command = [os.fsencode(program), b"run", deck, b"--out", out, b"--log", log, *map(str.encode, SMALL)]
    process = subprocess.run(command, capture_output=True)
    assert process.returncode == 0, process.stderr
    assert os.path.exists(out + b"/summary.json") and b"deck" in open(log, "rb").read()
    for words in ([b"\xff"], [b"explain", b"\xff"], [b"run", deck, b"--set", b"h=\xff"], [b"run", b"none\xff.yaml"]):
        process = subprocess.run([os.fsencode(program), *words], capture_output=True)
        assert process.returncode == 2 and b"error" in process.stderr and b"panicked" not in process.stderr, words


@pytest.mark.parametrize("name", ["history.csv", "quality.csv", "convergence.csv"])
@pytest.mark.parametrize("how", ["removed", "replaced", "changed"])
def test_a_table_that_is_lost_during_the_run_is_noticed(program, tmp_path, name, how):
    deck, out = deck_of(tmp_path), tmp_path / "out"
    process = start(program, "run", deck, "--out", out, *LONG, "--set", "steps=40")
    wait_for(out / "points_0002.vtu", process)
    table = out / name
    if how == "removed":
        table.unlink()
    elif how == "replaced":
        shutil.copy(table, tmp_path / "copy")
        os.replace(tmp_path / "copy", table)
    else:
        with open(table, "a") as file:
            file.write("1,2,3\n")
    messages = process.communicate(timeout=120)[1]
    assert process.returncode == 1 and "error[S011]" in messages, messages
    assert f"{name}` was {how} during the run" in messages, messages
    assert json.loads((out / "summary.json").read_text())["outcome"] == "failed"


@pytest.mark.parametrize("name", [
    "points_0001.vtu", "domains.pvd", "history.csv", "quality.csv", "convergence.csv", "summary.json", "run.json",
    "status.json", "checkpoint_0001.mpm", "failed_grid.vtu", "points_0001.vtu.tmp",
])
def test_files_of_others_are_never_replaced(mpm, tmp_path, name):
    """In a directory without results, and in one with results of a run."""
    deck = deck_of(tmp_path)
    assert mpm("run", deck, "--out", tmp_path / "used", *SMALL).returncode == 0
    (tmp_path / "new").mkdir()
    for out in (tmp_path / "new", tmp_path / "used"):
        (out / name).write_text('{"mine": 1}')
        before = {path.name: path.read_bytes() for path in out.iterdir() if path.name != ".lock"}
        process = mpm("run", deck, "--out", out, *SMALL)
        assert process.returncode == 2 and "error[R001]" in process.stderr and f"`{name}`" in process.stderr
        assert "choose another directory with `--out`, or move the file away" in process.stderr
        assert {path.name: path.read_bytes() for path in out.iterdir() if path.name != ".lock"} == before
    (tmp_path / "used" / name).unlink()
    assert mpm("run", deck, "--out", tmp_path / "used", *SMALL).returncode == 0


@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_a_file_in_the_place_of_the_directory(mpm, tmp_path, below):
    deck, file = deck_of(tmp_path), tmp_path / "file"
    file.write_text("mine")
    for command in (["run", deck, *SMALL], ["sweep", deck, "--over", "n=2,3"]):
        process = mpm(*command, "--out", file / below)
        assert process.returncode == 2 and "error[R001]" in process.stderr, process.stderr
        assert f"`{file}` is a file; choose another directory with `--out`, or move the file away" in process.stderr
        assert "os error" not in process.stderr and file.read_text() == "mine"


@pytest.mark.parametrize("name", ["quality.csv", "convergence.csv.tmp", "points.pvd", "run.json", "status.json"])
def test_a_directory_in_the_place_of_a_file_is_refused_first(mpm, tmp_path, name):
    deck, out = deck_of(tmp_path), tmp_path / "out"
    assert mpm("run", deck, "--out", out, *SMALL).returncode == 0
    (out / name).unlink(missing_ok=True)
    (out / name).mkdir()
    before = sorted(path.name for path in out.iterdir())
    process = mpm("run", deck, "--out", out, *SMALL)
    assert process.returncode == 2 and "error[R001]" in process.stderr and f"`{name}`" in process.stderr
    assert sorted(path.name for path in out.iterdir()) == before


def test_reports_and_tables_of_studies_replace_only_their_like(mpm, tmp_path):
    deck, out = deck_of(tmp_path), tmp_path / "out"
    assert mpm("run", deck, "--out", out, *SMALL).returncode == 0
    page = out / "report.html"
    page.write_text("<!DOCTYPE html>\n<html>mine</html>")
    process = mpm("report", out)
    assert process.returncode == 2 and "is not an mpm report" in process.stderr and "mine" in page.read_text()
    page.unlink()
    assert mpm("report", out).returncode == 0 and mpm("report", out).returncode == 0
    assert mpm("report", out, "--out", "/dev/null").returncode == 2
    assert not os.path.isfile("/dev/null")
    study = tmp_path / "study"
    study.mkdir()
    (study / "sweep.csv").write_text("a,b\n1,2\n")
    process = mpm("sweep", deck, "--over", "n=2,3", "--out", study)
    assert process.returncode == 2 and "sweep.csv" in process.stderr
    assert (study / "sweep.csv").read_text() == "a,b\n1,2\n"


@pytest.mark.parametrize("device", ["/dev/full", "/dev/null", "/dev/zero"])
def test_no_deck_is_written_to_a_device(mpm, device):
    for words in ([], ["--force"]):
        process = mpm("new", "beam", "--out", device, *words)
        assert process.returncode == 2 and f"`{device}` is not a regular file" in process.stderr, process.stderr


@pytest.mark.parametrize("log", ["out/history.csv", "out/points_0001.vtu", "out/status.json", "out/.lock", "out/report.html",
                                 "out", "link/history.csv", "./out/../out/run.json"])
@pytest.mark.parametrize("there", [True, False])
def test_a_log_is_no_file_of_the_results(mpm, tmp_path, log, there):
    deck, out = deck_of(tmp_path), tmp_path / "out"
    if there:
        assert mpm("run", deck, "--out", out, *SMALL).returncode == 0
    (tmp_path / "link").symlink_to(out)
    before = {path: path.read_bytes() for path in out.glob("*")}
    process = mpm("run", deck, "--out", out, *SMALL, "--log", f"{tmp_path}/{log}")
    assert process.returncode == 2 and "error: the log `" in process.stderr, process.stderr
    is_place = there or ".." not in log and "link" not in log
    assert ("choose another name with `--log`" if is_place else "No such file") in process.stderr, process.stderr
    assert {path: path.read_bytes() for path in out.glob("*")} == before
    assert there or not out.exists() or not list(out.iterdir())


def test_escapes_do_not_reach_the_terminal(program, tmp_path):
    evil = "a\x1b]0;owned\x07\x1b[2Jb\x9b31m\x7f"
    deck, out = tmp_path / "d\x1b[31m.yaml", tmp_path / "o\x1b[2J"
    deck.write_text(BLOCK.replace("TITLE", json.dumps(evil)).replace("name: block", f"name: {json.dumps(evil)}"))
    log = tmp_path / "run.log"
    outputs = []
    for words in (["run", deck, "--out", out, "--log", log, "--set", "n=2"], ["status", out], ["report", out],
                  ["check", deck, "--set", "n=2"], ["run", deck, "--set", "x\x1b[2J=1"], ["explain", "D\x1b[2J"],
                  ["run", f"none{evil}"], [f"x{evil}"], ["new", evil]):
        process = subprocess.run([program, *map(str, words)], capture_output=True)
        assert b"panicked" not in process.stderr
        outputs += [process.stdout, process.stderr]
    for text in [*outputs, log.read_bytes()]:
        shown = text.decode()
        assert not [c for c in shown if ord(c) < 32 and c not in "\n\t" or 0x7F <= ord(c) < 0xA0], shown


def run_with(program, limit, *arguments):
    command = [str(program), *map(str, arguments)]
    return subprocess.run(command, preexec_fn=limit, capture_output=True, text=True, timeout=600)


@pytest.mark.parametrize("linear", ["direct", "iterative"])
@pytest.mark.parametrize("kibibytes", [100_000, 150_000, 200_000, 260_000, 330_000, 400_000, 1_000_000])
def test_too_little_memory_is_an_error_and_no_abort(program, tmp_path, linear, kibibytes):
    (tmp_path / "deck.yaml").write_text(BLOCK)
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (kibibytes << 10, kibibytes << 10))
    out = tmp_path / "out"
    process = run_with(program, limit, "run", tmp_path / "deck.yaml", "--out", out, "--set", f"linear={linear}")
    assert process.returncode in (0, 1, 2), (process.returncode, process.stderr)
    if process.returncode == 1:
        assert "error[S008]: not enough memory" in process.stderr or "error[S011]" in process.stderr, process.stderr
    if process.returncode == 2:
        assert "error[D036]" in process.stderr or "threads cannot be started" in process.stderr, process.stderr
    if out.exists():
        assert_sound(out, ended=False)


def test_threads_that_cannot_be_started_are_named(program, tmp_path):
    (tmp_path / "deck.yaml").write_text(BLOCK)
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (300 << 20, 300 << 20))
    for words in (["run", tmp_path / "deck.yaml", "--threads", 1000], ["sweep", tmp_path / "deck.yaml", "--over", "n=2,3",
                  "--threads", 1000]):
        process = run_with(program, limit, *words, "--out", tmp_path / "out")
        # The threads that have been started need memory, too: theirs may be the request that is refused.
        named = {2: "the threads cannot be started", 1: "error[S008]: not enough memory"}
        assert named.get(process.returncode, "no such code") in process.stderr, process.stderr
        # A started thread without memory for its alternative stack ends within the standard library, before our code runs.
        assert "panicked" not in process.stderr or "allocate an alternative stack" in process.stderr, process.stderr
