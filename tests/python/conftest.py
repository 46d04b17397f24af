"""Which tests run where and when, and runs of the program that several tests look at; each is made once per process."""

import os
import subprocess
from pathlib import Path

import pytest

from results import Results

ROOT = Path(__file__).resolve().parents[2]

# Files whose tests take longest; they begin, so that no process is left alone with one of them at the end.
SLOW = ("test_book", "test_editor", "test_turning_tools", "test_soils", "test_locking", "test_notebooks", "test_resume")
SLOW += ("test_scaffolding", "test_report", "test_package_laws", "test_package_types", "test_promise", "test_package_runs")
# Files whose tests share nothing: several processes may run them. The tests of any other file stay together.
DIVIDED = ("test_book", "test_turning_tools", "test_soils", "test_locking", "test_scaffolding", "test_promise")


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="run the tests marked `long`, too")


def pytest_configure(config):
    config.addinivalue_line("markers", "long: runs with `tests/run --long` only; the reason is given")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    if not config.getoption("--long"):
        kept = [item for item in items if item.get_closest_marker("long") is None]
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("long")])
        items[:] = kept
    order = {name: place for place, name in enumerate(SLOW)}
    items.sort(key=lambda item: order.get(item.path.stem, len(SLOW)))
    for item in items:
        if item.path.stem not in DIVIDED:
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


@pytest.fixture(scope="session")
def program():
    """Path of the program under test."""
    path = Path(os.environ.get("MPM", ROOT / "target" / "release" / "mpm")).resolve()
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
