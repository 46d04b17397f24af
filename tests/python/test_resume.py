"""Runs that are killed, interrupted or have failed go on from their checkpoints as if nothing had happened.

`KILLS=1000 tests/run -k killed` is the long form of the first test: so many kills of each kind.
"""

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import time

import pytest

from conftest import ROOT
from results import assert_sound

KILLS = int(os.environ.get("KILLS", "12"))


def deck_of(folder, *changes, name="collapse", **parameters):
    """A deck with checkpoints."""
    text = (ROOT / "inputs" / f"{name}.yaml").read_text().partition("\n")[2]
    text = text.replace("steps: {count", "checkpoint: {every: 3}\nsteps: {count")
    for before, after in changes:
        assert before in text, before
        text = text.replace(before, after)
    path = folder / "deck.yaml"
    path.write_text(text)
    return path


def settings(**parameters):
    return [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]


def results(directory):
    """What must not depend on how often a run was killed."""
    names = [path for path in sorted(directory.iterdir()) if path.suffix in (".vtu", ".pvd", ".csv")]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in names}


def last_checkpoint(directory):
    steps = [int(path.stem.partition("_")[2]) for path in directory.glob("checkpoint_*.mpm")]
    return max(steps, default=0)


SMALL = settings(h=1, n=3, steps=30, every=5)


@pytest.fixture
def whole(mpm, tmp_path):
    """A deck, and its results where nothing disturbs the run."""
    return undisturbed(mpm, tmp_path, deck_of(tmp_path), SMALL)


def undisturbed(mpm, tmp_path, deck, words):
    """A deck, its results and how long they take."""
    began = time.monotonic()
    process = mpm("run", deck, "--out", tmp_path / "whole", *words)
    assert process.returncode == 0, process.stderr
    return deck, results(tmp_path / "whole"), time.monotonic() - began


MEAN_OF_CELLS = ('method: "${method}",', 'method: "${method}", strain: mean,')
KILLED = {
    "gimp": ("collapse", SMALL, []),
    "cpdi2": ("collapse", [*SMALL, *settings(method="cpdi2")], []),
    "mean of cells": ("collapse", [*SMALL, *settings(n=2, method="mpm")], [MEAN_OF_CELLS]),
    "solid": ("twist", settings(h=0.5, steps=30, every=5), []),
}


@pytest.mark.parametrize("kind", KILLED)
def test_killed_runs_end_like_others(mpm, program, tmp_path, kind):
    """At random moments, again and again, with one thread or two."""
    name, words, changes = KILLED[kind]
    deck, expected, duration = undisturbed(mpm, tmp_path, deck_of(tmp_path, *changes, name=name), words)
    directory = tmp_path / "killed"
    moments = random.Random(1)
    kills, finished, at = 0, 0, 0
    while kills < KILLS or finished == 0:
        command = [program, "run", deck, "--out", directory, *words, "--threads", str(1 + kills % 2)]
        if last_checkpoint(directory) if directory.exists() else 0:
            command.append("--resume")
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        try:
            output = process.communicate(timeout=moments.uniform(0, 1.1 * duration))[0]
            assert process.returncode == 0, output.decode()
            assert results(directory) == expected
            leftovers = [path.name for path in directory.iterdir() if path.suffix == ".tmp"]
            assert not leftovers
            assert_sound(directory)
            finished, at = finished + 1, 0
            for path in directory.iterdir():
                path.unlink()
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            kills += 1
            if directory.exists():
                assert_sound(directory, ended=False)
                now = last_checkpoint(directory)
                assert now >= at, "a checkpoint was lost"
                at = now
    print(f"{kills} kills, {finished} runs that ended")


@pytest.fixture
def stopped(mpm, program, tmp_path):
    """Runs a deck and interrupts it after a step."""

    def run(deck, directory, *arguments, after):
        command = [program, "run", deck, "--out", directory, *arguments]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        while not (directory / f"points_{after:04}.vtu").exists():
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.002)
        process.send_signal(signal.SIGTERM)
        text = process.stderr.read()
        assert process.wait() == 130 and "--resume" in text, text
        return directory

    return run


def test_an_interrupted_run_goes_on(mpm, stopped, whole, tmp_path):
    deck, expected, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    assert last_checkpoint(directory) >= 5
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 0 and "resuming after step" in process.stderr, process.stderr
    assert results(directory) == expected


@pytest.mark.skipif(shutil.which("timeout") is None, reason="there is no `timeout`")
def test_a_run_under_timeout_leaves_a_checkpoint_and_a_summary(mpm, program, whole, tmp_path):
    """GNU `timeout` sends its signal twice within milliseconds, to the program and to its group."""
    deck, expected, duration = whole
    deck.write_text(deck.read_text().replace("checkpoint: {every: 3}\n", ""))
    rng, stopped = random.Random(7), 0
    for number in range(40):
        directory = tmp_path / f"run{number}"
        command = ["timeout", "-s", "TERM", f"{duration * rng.uniform(0.2, 0.9):.3f}", program, "run", deck, "--out", directory]
        process = subprocess.run([*command, *SMALL], capture_output=True, text=True)
        # The machine may have become faster or slower.
        if process.returncode == 0:
            duration *= 0.8
            continue
        table = directory / "history.csv"
        if not table.exists() or len(table.read_text().splitlines()) < 2:
            duration *= 1.2
            continue
        assert process.returncode == 124, process.stderr
        outcome = json.loads((directory / "summary.json").read_text())["outcome"]
        if outcome == "completed":  # The signal came after the last step.
            duration *= 0.8
            continue
        assert outcome == "interrupted" and last_checkpoint(directory) > 0, process.stderr
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 0, process.stderr
        assert results(directory) == expected
        stopped += 1
        if stopped == 4:
            return
    raise AssertionError("no run was stopped in time")


def test_a_run_without_the_key_is_secured_when_it_is_interrupted(mpm, stopped, whole, tmp_path):
    deck, expected, _ = whole
    deck.write_text(deck.read_text().replace("checkpoint: {every: 3}\n", ""))
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 0, process.stderr
    assert results(directory) == expected


@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGINT], ids=lambda kind: kind.name)
def test_interrupts_amid_failed_attempts_leave_no_trace(mpm, program, tmp_path, kind):
    """Attempts after the last equilibrium are made again, with the size and the counts that they had."""
    deck = deck_of(tmp_path, ("checkpoint: {every: 3}\n", ""))
    words = settings(h=0.5, n=3, method="gimp", steps=3, every=1)
    deck, expected, duration = undisturbed(mpm, tmp_path, deck, words)
    failed = (tmp_path / "whole" / "history.csv").read_text()
    assert ",0," in failed, "some attempts fail"
    rng = random.Random(5)
    for number in range(8):
        directory = tmp_path / f"run{number}"
        process = subprocess.Popen(
            [program, "run", deck, "--out", directory, *words], stderr=subprocess.PIPE, text=True
        )
        time.sleep(duration * rng.uniform(0.1, 0.9))
        process.send_signal(kind)
        process.communicate()
        process = mpm("run", deck, "--out", directory, *words, "--resume")
        assert process.returncode == 0 or "there is no checkpoint" in process.stderr, process.stderr
        if process.returncode == 0:
            assert results(directory) == expected


def test_steps_may_become_finer_after_a_failure(mpm, tmp_path):
    """The third of three steps is too large; each halved, they find equilibrium."""
    deck = deck_of(tmp_path, ("checkpoint: {every: 3}\n", ""))
    directory, coarse = tmp_path / "out", settings(h=1, n=3, method="mpm", steps=4, smallest=1)
    process = mpm("run", deck, "--out", directory, *coarse)
    assert process.returncode == 1, process.stderr
    step = last_checkpoint(directory)
    assert step >= 1
    process = mpm("run", deck, "--out", directory, *settings(h=1, n=3, method="mpm", steps=80), "--resume")
    assert process.returncode == 0, process.stderr
    assert f"resuming after step {20 * step} " in process.stderr


STAGES = """version: 1
grid: {type: structured, origin: [0, 0], size: [1, 4], spacing: 0.5}
materials:
  m: {model: hencky, young: 1e6, poisson: 0.3, density: 1800}
  z: {model: neo-hookean, young: 2e6, poisson: 0.2, density: 1800}
bodies:
  - {name: f, material: m, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [1, 2]}}
  - {name: k, material: m, points_per_cell: 2, shape: {type: box, min: [0, 2], max: [1, 3]}}
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [1, 4]}}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
solver: {tolerance: 1e-12}
stages:
  - {name: a, steps: {count: 3}, factors: {weight: 1}}
  - {name: b, steps: {count: 3, smallest: 1}, factors: {weight: 1.2}, CHANGE}
"""


@pytest.mark.parametrize("checkpoint", ["", "checkpoint: {every: 1}"])
@pytest.mark.parametrize("change", ["add: [k]", "add: [{body: k, onto: f}]", "remove: [k]", "material: {k: z}"])
def test_a_run_that_fails_at_the_start_of_a_stage_goes_on(mpm, tmp_path, change, checkpoint):
    """The stage has already changed the points when its first step fails."""
    deck, text = tmp_path / "deck.yaml", STAGES + checkpoint
    deck.write_text(text.replace("CHANGE", change))
    _, expected, _ = undisturbed(mpm, tmp_path, deck, ())
    directory = tmp_path / "failed"
    deck.write_text(text.replace("CHANGE", f"{change}, solver: {{tolerance: 1e-12, max_iterations: 1}}"))
    process = mpm("run", deck, "--out", directory)
    assert process.returncode == 1 and last_checkpoint(directory) == 3, process.stderr
    deck.write_text(text.replace("CHANGE", change))
    process = mpm("run", deck, "--out", directory, "--resume")
    assert process.returncode == 0 and "resuming after step 3" in process.stderr, process.stderr
    assert results(directory) == expected


def test_a_changed_deck_is_refused_with_what_changed(mpm, tmp_path, whole):
    deck, _, _ = whole
    directory = tmp_path / "whole"
    before = results(directory)
    for words, says in [
        (settings(h=1, n=3, steps=30, every=5, method="mpm"), '`bodies[0].method` was "gimp" and is "mpm"'),
        (settings(h=2, n=3, steps=30, every=5), "`grid.spacing` was 1.0 and is 2.0"),
    ]:
        process = mpm("run", deck, "--out", directory, *words, "--resume")
        assert process.returncode == 2 and says in process.stderr, process.stderr
        assert "help:" in process.stderr
    assert results(directory) == before


def test_a_damaged_checkpoint_is_named_and_the_one_before_it_used(mpm, tmp_path, whole):
    deck, expected, _ = whole
    directory = tmp_path / "whole"
    newest = directory / "checkpoint_0030.mpm"
    good = newest.read_bytes()
    for damaged in [good[:-100], good[:100], b"", good[:-50] + bytes([good[-50] ^ 1]) + good[-49:],
                    good.replace(b"mpm checkpoint 6", b"mpm checkpoint 9", 1)]:
        newest.write_bytes(damaged)
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 0, process.stderr
        assert "checkpoint_0030.mpm` cannot be used" in process.stderr
        assert "resuming after step 27" in process.stderr
        assert results(directory) == expected
        assert newest.read_bytes()[:16] == b"mpm checkpoint 6"


def test_nothing_to_go_on_from(mpm, tmp_path):
    deck = deck_of(tmp_path)
    (tmp_path / "empty").mkdir()
    for place in ["empty", "nowhere"]:
        process = mpm("run", deck, "--out", tmp_path / place, *SMALL, "--resume")
        assert process.returncode == 2 and "error[R002]: there is no checkpoint" in process.stderr, process.stderr


def contents(directory):
    """Every file of a directory, the empty one that is locked aside."""
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.is_file() and path.name != ".lock"}


@pytest.mark.parametrize("words", [{}, {"steps": 60}, {"steps": 7}, {"every": 0}, {"every": 7}], ids=str)
def test_nothing_is_left_to_do_after_the_end(mpm, tmp_path, whole, words):
    """Whatever number of steps or files the deck asks for now: no file is touched."""
    deck, _, _ = whole
    directory = tmp_path / "whole"
    before = contents(directory)
    words = settings(**({"h": 1, "n": 3, "steps": 30, "every": 5} | words))
    process = mpm("run", deck, "--out", directory, *words, "--resume")
    assert process.returncode == 0, process.stderr
    assert "is complete: 30 steps in equilibrium; nothing is left to do" in process.stderr
    assert contents(directory) == before


@pytest.mark.parametrize("every", [0, 5, 7])
@pytest.mark.parametrize("steps", [30, 60])
def test_a_run_that_was_killed_after_its_last_step_is_finished(mpm, tmp_path, whole, steps, every):
    """Its checkpoint is that of the end, but it has not written its summary."""
    deck, expected, _ = whole
    directory = tmp_path / "whole"
    (directory / "summary.json").unlink()
    words = settings(h=1, n=3, steps=steps, every=every)
    process = mpm("run", deck, "--out", directory, *words, "--resume")
    assert process.returncode == 0, process.stderr
    assert json.loads((directory / "summary.json").read_text())["outcome"] == "completed"
    assert results(directory) == expected


def test_an_interrupted_run_that_is_to_write_no_more_files_keeps_those_it_has(mpm, stopped, whole, tmp_path):
    deck, _, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    before = {path.name for path in directory.glob("*.vtu")}
    process = mpm("run", deck, "--out", directory, *settings(h=1, n=3, steps=30, every=0), "--resume")
    assert process.returncode == 0, process.stderr
    assert {path.name for path in directory.glob("*.vtu")} == before


@pytest.mark.parametrize("name", ["history.csv", "quality.csv", "convergence.csv"])
def test_a_table_that_is_missing_or_too_short_is_named(mpm, stopped, whole, tmp_path, name):
    deck, expected, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    table = directory / name
    text = table.read_text()
    for wrong, says in [(None, f"{name}` is missing"), (text.splitlines()[0] + "\n", "does not reach step"),
                        ("a,b\n", "has other columns"), ("", "is empty")]:
        table.unlink() if wrong is None else table.write_text(wrong)
        before = contents(directory)
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 2 and "error[R002]" in process.stderr, process.stderr
        assert says in process.stderr and "help:" in process.stderr, process.stderr
        assert contents(directory) == before
    # Rows in the middle are missing: the first step without them is named.
    for lost in (1, 3):
        table.write_text("".join(line for line in text.splitlines(True) if not line.startswith(f"{lost},")))
        before = contents(directory)
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 2 and "error[R002]" in process.stderr, process.stderr
        assert f"{name}` lacks rows of step {lost}" in process.stderr, process.stderr
        assert contents(directory) == before
    if name == "convergence.csv":
        table.write_text("".join(line for line in text.splitlines(True) if not line.startswith("2,1,")))
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert "convergence.csv` lacks rows of step 2" in process.stderr, process.stderr
    table.write_text(text)
    assert mpm("run", deck, "--out", directory, *SMALL, "--resume").returncode == 0
    assert results(directory) == expected


def test_a_table_whose_numbers_are_damaged_is_not_continued(mpm, stopped, whole, tmp_path):
    deck, _, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    table = directory / "history.csv"
    lines = table.read_text().splitlines(True)
    step, time, rest = lines[2].split(",", 2)
    table.write_text("".join([*lines[:2], f"{step},nan{time},{rest}", *lines[3:]]))
    before = contents(directory)
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 2 and "error[R002]" in process.stderr, process.stderr
    assert "history.csv` is damaged: line 3: " in process.stderr and contents(directory) == before


def test_a_file_that_no_run_wrote_stands_in_the_way_of_resuming(mpm, stopped, whole, tmp_path):
    deck, expected, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    (directory / "run.json").write_text((directory / "run.json").read_text()[:40])
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 2 and "error[R002]" in process.stderr, process.stderr
    assert "help: restore the file, or move it away" in process.stderr and "--out" not in process.stderr
    (directory / "run.json").unlink()
    assert mpm("run", deck, "--out", directory, *SMALL, "--resume").returncode == 0
    assert results(directory) == expected


def test_a_complete_run_needs_no_checkpoint_to_be_known_as_such(mpm, tmp_path):
    words, out = settings(h=1, n=3, steps=4), tmp_path / "out"
    assert mpm("run", "inputs/collapse.yaml", "--out", out, *words).returncode == 0
    before = contents(out)
    assert not [name for name in before if name.startswith("checkpoint")]
    process = mpm("run", "inputs/collapse.yaml", "--out", out, *words, "--resume")
    assert process.returncode == 0 and "is complete: 4 steps in equilibrium" in process.stderr, process.stderr
    other = mpm("run", "inputs/collapse.yaml", "--out", out, *words, "--set", "every=0", "--resume")
    assert other.returncode == 2 and "there is no checkpoint" in other.stderr, other.stderr
    assert contents(out) == before
    (out / "quality.csv").unlink()
    process = mpm("run", "inputs/collapse.yaml", "--out", out, *words, "--resume")
    assert process.returncode == 2 and "quality.csv` is missing" in process.stderr, process.stderr


@pytest.mark.parametrize("name", ["history.csv", "quality.csv", "convergence.csv"])
def test_a_run_that_lacks_a_table_is_not_complete(mpm, whole, tmp_path, name):
    deck, _, _ = whole
    directory = tmp_path / "whole"
    (directory / name).unlink()
    before = contents(directory)
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 2 and "error[R002]" in process.stderr, process.stderr
    assert f"{name}` is missing" in process.stderr and contents(directory) == before


def test_a_directory_with_the_name_of_a_checkpoint_is_left_alone(mpm, stopped, whole, tmp_path):
    deck, expected, _ = whole
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    for step in (2, 2000):
        (directory / f"checkpoint_{step:04}.mpm").mkdir()
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 0 and "cannot be used" not in process.stderr, process.stderr
    assert results(directory) == expected
    process = mpm("run", deck, "--out", directory, *SMALL)
    assert process.returncode == 0, process.stderr
    assert (directory / "checkpoint_0002.mpm").is_dir()


def test_the_status_of_a_killed_run_says_from_where_it_goes_on(mpm, program, whole, tmp_path):
    deck, _, _ = whole
    directory = tmp_path / "killed"
    process = subprocess.Popen([program, "run", deck, "--out", directory, *settings(h=1, n=3, steps=3000, every=0)])
    deadline = time.monotonic() + 60
    while not directory.exists() or last_checkpoint(directory) == 0:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    process.wait()
    last = last_checkpoint(directory)
    told = mpm("status", directory)
    assert told.returncode == 1
    assert f"checkpoint    of step {last}; `mpm run --resume` continues from there" in told.stdout
    assert json.loads(mpm("status", directory, "--format", "json").stdout)["checkpoint"] == last
    for path in directory.glob("checkpoint_*"):
        path.unlink()
    assert "checkpoint    none" in mpm("status", directory).stdout


def test_members_of_a_study_go_on_from_their_checkpoints(mpm, program, tmp_path):
    deck = deck_of(tmp_path)
    over = ["--over", "n=2,3", *settings(h=1, steps=30, every=5)]
    assert mpm("sweep", deck, "--out", tmp_path / "whole", *over).returncode == 0
    directory = tmp_path / "stopped"
    process = subprocess.Popen([program, "sweep", deck, "--out", directory, *over], stderr=subprocess.PIPE, text=True)
    while not (directory / "n=3" / "points_0010.vtu").exists():
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    process.kill()
    process.communicate()
    second = mpm("sweep", deck, "--out", directory, *over, "--resume")
    assert second.returncode == 0, second.stderr
    assert "n=2: completed earlier" in second.stderr and "resuming after step" in second.stderr
    for member in ("n=2", "n=3"):
        assert results(directory / member) == results(tmp_path / "whole" / member)
    # A checkpoint of another deck cannot be resumed: the member starts over, with a message.
    (directory / "n=3" / "summary.json").unlink()
    over = ["--over", "n=2,3", *settings(h=1, steps=30, every=5, method="mpm")]
    third = mpm("sweep", deck, "--out", directory, *over, "--resume")
    assert third.stderr.count("starting over: the deck differs from that") == 2, third.stderr
