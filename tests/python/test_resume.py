"""Runs that are killed, interrupted or have failed go on from their checkpoints as if nothing had happened.

`KILLS=1000 tests/run -k killed` is the long form of the first test.
"""

import hashlib
import os
import random
import signal
import subprocess
import time

import pytest

from conftest import ROOT

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
    deck = deck_of(tmp_path)
    began = time.monotonic()
    process = mpm("run", deck, "--out", tmp_path / "whole", *SMALL)
    assert process.returncode == 0, process.stderr
    return deck, results(tmp_path / "whole"), time.monotonic() - began


def test_killed_runs_end_like_others(program, whole, tmp_path):
    """At random moments, again and again, with one thread or two."""
    deck, expected, duration = whole
    directory = tmp_path / "killed"
    moments = random.Random(1)
    kills, finished, at = 0, 0, 0
    while kills < KILLS or finished == 0:
        command = [program, "run", deck, "--out", directory, *SMALL, "--threads", str(1 + kills % 2)]
        if last_checkpoint(directory) if directory.exists() else 0:
            command.append("--resume")
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        try:
            output = process.communicate(timeout=moments.uniform(0, 1.1 * duration))[0]
            assert process.returncode == 0, output.decode()
            assert results(directory) == expected
            leftovers = [path.name for path in directory.iterdir() if path.suffix == ".tmp"]
            assert not leftovers
            finished, at = finished + 1, 0
            for path in directory.iterdir():
                path.unlink()
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            kills += 1
            if directory.exists():
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
    assert process.returncode == 0 and "going on after step" in process.stderr, process.stderr
    assert results(directory) == expected


def test_a_run_without_the_key_is_secured_when_it_is_interrupted(mpm, stopped, whole, tmp_path):
    deck, expected, _ = whole
    deck.write_text(deck.read_text().replace("checkpoint: {every: 3}\n", ""))
    directory = stopped(deck, tmp_path / "stopped", *SMALL, after=5)
    process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
    assert process.returncode == 0, process.stderr
    assert results(directory) == expected


def test_steps_may_become_finer_after_a_failure(mpm, tmp_path):
    """The third of three steps is too large; each halved, they find equilibrium."""
    deck = deck_of(tmp_path, ("checkpoint: {every: 3}\n", ""))
    directory, coarse = tmp_path / "out", settings(h=1, n=3, method="mpm", steps=4)
    process = mpm("run", deck, "--out", directory, *coarse)
    assert process.returncode == 1, process.stderr
    step = last_checkpoint(directory)
    assert step >= 1
    process = mpm("run", deck, "--out", directory, *settings(h=1, n=3, method="mpm", steps=80), "--resume")
    assert process.returncode == 0, process.stderr
    assert f"going on after step {20 * step} " in process.stderr


def test_a_changed_deck_is_refused_with_what_changed(mpm, tmp_path, whole):
    deck, _, _ = whole
    directory = tmp_path / "whole"
    before = results(directory)
    for words, says in [
        (settings(h=1, n=3, steps=30, every=5, method="mpm"), '`bodies[0].method` was "gimp" and is "mpm"'),
        (settings(h=2, n=3, steps=30, every=5), "`grid.spacing` was 1.0 and is 2.0"),
        (settings(h=1, n=3, steps=7, every=5), "with 7 load steps up to time 1, no step ends there"),
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
                    good.replace(b"mpm checkpoint 1", b"mpm checkpoint 9", 1)]:
        newest.write_bytes(damaged)
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 0, process.stderr
        assert "checkpoint_0030.mpm` cannot be used" in process.stderr
        assert "going on after step 27" in process.stderr
        assert results(directory) == expected
        assert newest.read_bytes()[:16] == b"mpm checkpoint 1"


def test_nothing_to_go_on_from(mpm, tmp_path):
    deck = deck_of(tmp_path)
    (tmp_path / "empty").mkdir()
    for place in ["empty", "nowhere"]:
        process = mpm("run", deck, "--out", tmp_path / place, *SMALL, "--resume")
        assert process.returncode == 2 and "there is no checkpoint" in process.stderr, process.stderr
