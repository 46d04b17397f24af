"""Runs of the program that several tests look at; each is made once per session."""

import os
import subprocess
from pathlib import Path

import pytest

from results import Results

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def program():
    """Path of the program under test."""
    path = Path(os.environ.get("MPM", ROOT / "target" / "debug" / "mpm")).resolve()
    assert path.exists(), f"{path} is missing: run the tests with tests/run"
    return path


@pytest.fixture(scope="session")
def mpm(program):
    """Runs the program from the root of the sources and returns the finished process."""

    def run(*arguments, threads=None):
        environment = dict(os.environ)
        if threads is not None:
            environment["RAYON_NUM_THREADS"] = str(threads)
        command = [str(program), *map(str, arguments)]
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600)

    return run


@pytest.fixture(scope="session")
def analyse(mpm, tmp_path_factory):
    """Runs a deck with parameters into a new directory and returns its results."""

    def run(deck, threads=None, **parameters):
        directory = tmp_path_factory.mktemp(Path(deck).stem) / "out"
        settings = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        process = mpm("run", deck, "--out", directory, *settings, threads=threads)
        assert process.returncode == 0, process.stderr
        return Results(directory)

    return run


BEAM = {"h": 0.5, "n": 6, "method": "gimp", "update": "corners", "steps": 20}


@pytest.fixture(scope="session")
def beam(analyse):
    return analyse("inputs/beam.yaml", **BEAM)


@pytest.fixture(scope="session")
def beam_of_standard_points(analyse):
    return analyse("inputs/beam.yaml", h=0.5, n=3, method="mpm", steps=50)


@pytest.fixture(scope="session")
def beam_in_small_steps(analyse):
    return analyse("inputs/beam.yaml", **(BEAM | {"steps": 50}))


@pytest.fixture(scope="session")
def collapse(analyse):
    return analyse("inputs/collapse.yaml", h=2, n=2, method="mpm", steps=40)
