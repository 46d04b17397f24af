"""Runs on several ranks give the results of one, survive the death of a rank, and say what they cannot do.

They need the program with `--features petsc` and `mpirun`; tests/run builds it where PETSc is installed.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista

from package import mpm
from results import Results

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("MPM_RANKS", ROOT / "target" / "release" / "mpm-ranks")).resolve()
# Where there are fewer cores than ranks, and where the tests run as root, Open MPI must be asked to go on.
ENVIRONMENT = {
    **os.environ,
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OPENBLAS_NUM_THREADS": "1",
}

pytestmark = pytest.mark.skipif(
    not PROGRAM.exists() or shutil.which("mpirun") is None,
    reason="runs on several ranks need mpirun and the program with PETSc, which tests/run builds where PETSc is installed",
)


def command(ranks, *arguments):
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks else []
    return [*launcher, str(PROGRAM), *map(str, arguments)]


def run(ranks, *arguments):
    """Runs the program on some ranks; 0 stands for the program without launcher."""
    return subprocess.run(
        command(ranks, *arguments), cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, timeout=900
    )


def results_of(ranks, directory, deck, *arguments):
    process = run(ranks, "run", deck, "--out", directory, *arguments)
    assert process.returncode == 0, process.stderr
    return Results(directory)


def settings(**parameters):
    return [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]


class Last:
    """The points at the end, as domains or without, in the order of their permanent numbers."""

    def __init__(self, results):
        name = next(name for name in ("domains", "points") if (results.directory / f"{name}.pvd").exists())
        mesh = results.mesh(name, -1)
        fields = mesh.cell_data if "point_id" in mesh.cell_data else mesh.point_data
        order = np.argsort(fields["point_id"])
        corners = np.concatenate([mesh.get_cell(cell).point_ids for cell in order])
        self.points = mesh.points[corners]
        self.fields = {name: np.asarray(values)[order] for name, values in fields.items()}


def numbers(document):
    """All numbers in a document, in its order; a body that is not there has no extent."""
    if document is None:
        return []
    if isinstance(document, dict):
        return [number for key in document for number in numbers(document[key])]
    if isinstance(document, list):
        return [number for entry in document for number in numbers(entry)]
    return [document]


def same(found, expected, tolerance=1e-9, apart=()):
    """Compares the histories apart from some columns, the points at the end and what the summaries say of them."""
    for key in ("points", "cells", "unknowns", "steps"):
        assert found.summary[key] == expected.summary[key], key
    overlaps = [of.summary["quality"]["domain_overlap"] for of in (found, expected)]
    assert overlaps[0] == overlaps[1] or abs(overlaps[0] - overlaps[1]) <= tolerance, overlaps
    if expected.summary["largest"] is None:
        assert found.summary["largest"] is None
    largest = [[value["value"] for value in (of.summary["largest"] or {}).values()] for of in (found, expected)]
    for x, y in ([of.summary["bodies"] for of in (found, expected)], largest):
        x, y = np.array(numbers(x)), np.array(numbers(y))
        assert np.abs(x - y).max(initial=0) <= max(tolerance, 1e-6) * np.abs(y).max(initial=0), (x, y)
    ours, theirs = found.history, expected.history
    assert list(ours) == list(theirs)
    a, b = Last(found), Last(expected)
    # Forces and energies that cancel are round-off of the stresses in the bodies.
    whole = np.linalg.norm(np.ptp(b.points, axis=0))
    stresses = [np.abs(values).max() for name, values in b.fields.items() if "stress" in name]
    force = max(stresses, default=0) * whole
    for name, column in theirs.items():
        # Measures of round-off, and times.
        if name in apart or any(word in name for word in ("residual", "error", "order", "seconds", "wall", "cpu")):
            continue
        is_force = name.endswith(("_rx", "_ry", "_rz", "_fx", "_fy", "_fz", "_mx", "_my", "_mz")) or "work" in name or "energy" in name
        size = max(np.nanmax(np.abs(column), initial=0), force if is_force else 0)
        error = np.abs(ours[name] - column)
        assert np.all((error <= tolerance * size) | np.isnan(column)), (name, error.max(), size)
    assert a.points.shape == b.points.shape
    assert np.abs(a.points - b.points).max() <= tolerance * np.abs(b.points).max()
    assert list(a.fields) == list(b.fields)
    for name in b.fields:
        x, y = np.asarray(a.fields[name], float), np.asarray(b.fields[name], float)
        size = max(np.abs(y).max(), max(stresses, default=0) if "pressure" in name else 0)
        if "strain" in name:  # one of several may be round-off
            size = max(np.abs(values).max() for other, values in b.fields.items() if "strain" in other)
        assert np.abs(x - y).max() <= tolerance * size, (name, np.abs(x - y).max(), size)


DECKS = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("inputs/**/*.yaml"))

# Later steps of these amplify round-off by more than 1e5, on one rank as on several: docs/scaling.md, "The results of ranks".
SHORT = {
    "inputs/beam.yaml": {"steps": 5},
    "inputs/collapse.yaml": {"steps": 10},
    "inputs/pipe.yaml": {"steps": 10, "depth": 0.125},
    "inputs/plough.yaml": {"steps": 2, "way": 0.125},
    # These take long.
    "inputs/block/block.yaml": {"h": 0.5, "steps": 2},
    "inputs/cone.yaml": {"steps": 5, "depth": 0.5},
    "inputs/footing_stages.yaml": {"h": 0.5},
}
# The last iterations of a step are at the limit of round-off there.
LIMITED = {"inputs/cone.yaml": ("iterations", "rounding_limited")}


@pytest.mark.parametrize("deck", DECKS)
def test_ranks_agree(deck, tmp_path):
    arguments = settings(**SHORT.get(deck, {}))
    alone = results_of(0, tmp_path / "alone", deck, *arguments, "--threads", "1")
    for ranks in (1, 2, 3, 4):
        same(results_of(ranks, tmp_path / str(ranks), deck, *arguments), alone, apart=LIMITED.get(deck, ()))


@pytest.mark.parametrize("cells", ["triangles", "quadrilaterals"])
def test_a_mesh_is_solved_iteratively_on_several_ranks(cells, tmp_path):
    """Without PETSc or on one rank the equations of a mesh are factorised, and a warning says so."""
    text = (ROOT / "inputs/cantilever.yaml").read_text()
    text = text.replace("cantilever/${cells}", f"{ROOT}/inputs/cantilever/${{cells}}")
    deck = tmp_path / "cantilever.yaml"
    deck.write_text(text.replace("max_iterations: 20", "max_iterations: 20, linear: iterative"))
    arguments = settings(cells=cells, h=0.125, steps=2)
    alone = results_of(0, tmp_path / "alone", deck, *arguments, "--threads", "1")
    assert alone.summary["iterative_solves"] == 0
    assert any("the grid is a mesh" in warning["message"] for warning in alone.summary["warnings"])
    iterations = []
    for ranks in (2, 3):
        found = results_of(ranks, tmp_path / str(ranks), deck, *arguments)
        same(found, alone, tolerance=1e-8, apart=("linear_iterations",))
        assert found.summary["iterative_solves"] == found.summary["linear_solves"] > 0
        assert not found.summary["warnings"]
        iterations.append(found.summary["linear_iterations"] / found.summary["linear_solves"])
    assert max(iterations) < 60


def test_the_same_ranks_give_the_same_bits(tmp_path):
    for name in "ab":
        results_of(3, tmp_path / name, "inputs/collapse.yaml", *settings(h=2, n=2, steps=6))
    a, b = (Last(Results(tmp_path / name)) for name in "ab")
    assert a.points.tobytes() == b.points.tobytes()
    assert all(a.fields[name].tobytes() == b.fields[name].tobytes() for name in b.fields)


def test_pieces_are_read_as_the_files_of_one_rank(tmp_path):
    """The package and the report put the points of all pieces in the order of their numbers."""
    arguments = settings(h=2, n=2, steps=4)
    alone, pieces = (results_of(ranks, tmp_path / str(ranks), "inputs/collapse.yaml", *arguments) for ranks in (0, 3))
    ours, theirs = mpm.read(pieces.directory), mpm.read(alone.directory)
    assert len(ours.frames) == len(theirs.frames) == 5
    for frame, expected in zip(ours.frames, theirs.frames):
        assert frame.fields.keys() == expected.fields.keys()
        for name, values in expected.fields.items():
            size = np.abs(expected.fields["cauchy_stress"]).max() if "pressure" in name else np.abs(values).max()
            assert np.abs(frame.fields[name] - values).max() <= 1e-9 * size, name
    report = tmp_path / "report.html"
    process = run(0, "report", pieces.directory, "--out", report)
    assert process.returncode == 0 and report.read_text().rstrip().endswith("</html>"), process.stderr


def test_a_later_run_removes_pieces(tmp_path):
    """A run on one rank in the directory of one on three leaves none of its files."""
    arguments = settings(h=2, n=2, steps=2)
    results_of(3, tmp_path, "inputs/collapse.yaml", *arguments)
    assert list(tmp_path.glob("*_r2.vtu")) and list(tmp_path.glob("*.pvtu"))
    results_of(0, tmp_path, "inputs/collapse.yaml", *arguments)
    assert not list(tmp_path.glob("*_r*.vtu")) and not list(tmp_path.glob("*.pvtu"))


def test_options_reach_petsc(tmp_path):
    arguments = ("run", "inputs/block/block.yaml", "--out", tmp_path, *settings(h=0.25, n=1, steps=1))
    process = run(2, *arguments, "--petsc", "-ksp_view -mpm_no_such_option 1")
    assert process.returncode == 0, process.stderr
    assert "KSP Object" in process.stdout


def test_the_version_names_what_is_built_in():
    assert "features: petsc (PETSc 3" in run(0, "--version").stdout


def test_errors_are_told_once(tmp_path):
    process = run(3, "run", "inputs/no_such_deck.yaml", "--out", tmp_path)
    assert process.returncode != 0 and process.stderr.count("error[D001]") == 1, process.stderr


DECK = """
version: 1
title: A block of clay sinks
analysis: {stabilisation: {mode: "off"}}
grid: {type: structured, origin: [0, 0], size: [8, 5], spacing: 0.25}
materials:
  clay: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 20e3, density: 1000}
bodies:
  - {name: block, material: clay, shape: {type: box, min: [0, 0], max: [4, 4]}, points_per_cell: 4}
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 40}
checkpoint: {every: 2}
output: {every: 10}
"""


@pytest.fixture(scope="module")
def sinking(tmp_path_factory):
    directory = tmp_path_factory.mktemp("sinking")
    deck = directory / "deck.yaml"
    deck.write_text(DECK)
    return deck, results_of(3, directory / "undisturbed", deck)


def resumed_from_the_last_but_one(ranks, directory, deck):
    """Resumes a run as if it had been killed between its last two checkpoints."""
    last = max(path.name.split("_")[1].removesuffix(".mpm") for path in directory.glob("checkpoint_*.mpm"))
    for path in [*directory.glob(f"checkpoint_{last}*"), directory / "summary.json"]:
        path.unlink()
    process = run(ranks, "run", deck, "--out", directory, "--resume")
    assert process.returncode == 0 and "resuming after step" in process.stderr, process.stderr
    return Results(directory)


STRETCHED = """
version: 1
title: A bar whose domains are split
grid: {type: structured, origin: [0, 0], size: [9, 2], spacing: 0.5}
materials:
  rubber: {model: neo-hookean, young: 1e6, poisson: 0.3, density: 1000}
bodies:
  - {name: bar, material: rubber, shape: {type: box, min: [0, 0], max: [4, 1]}, method: cpdi2, points_per_cell: 2,
     split_above: 0.6}
boundary_conditions:
  - {name: held, nodes: {x: 0}, fix: [x, y]}
loads:
  - {name: pull, type: body-force, force: [2e5, 0]}
steps: {count: 8}
checkpoint: {every: 3}
output: {probes: [{name: tip, body: bar, nearest: [4, 1]}]}
"""


def test_domains_are_split_as_on_one_rank(tmp_path):
    deck = tmp_path / "deck.yaml"
    deck.write_text(STRETCHED)
    alone = results_of(0, tmp_path / "alone", deck)
    points = Last(alone).fields["point_id"]
    assert len(points) > 64 and len(set(points)) == len(points)
    for ranks in (1, 2, 3, 4):
        same(results_of(ranks, tmp_path / str(ranks), deck), alone)
    same(resumed_from_the_last_but_one(2, tmp_path / "3", deck), alone)


def test_a_failed_step_is_shown_in_pieces(tmp_path):
    deck = tmp_path / "heavy.yaml"
    deck.write_text(DECK.replace("density: 1000", "density: 100000").replace("{count: 40}", "{count: 1, smallest: 1}"))
    process = run(3, "run", deck, "--out", tmp_path / "out")
    assert process.returncode != 0 and process.stderr.count("error[S002]") == 1, process.stderr
    points = pyvista.read(tmp_path / "out" / "failed_points.pvtu")
    assert points.n_points == 4096 and np.unique(points["point_id"]).size == 4096
    assert pyvista.read(tmp_path / "out" / "failed_grid.pvtu").n_cells >= 256


def ranks_of(process):
    """The processes of the program that a launcher has started."""
    found = subprocess.run(["pgrep", "-P", str(process.pid), "-f", PROGRAM.name], capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


def wait_for_checkpoint(process, directory):
    deadline = time.monotonic() + 120
    while not list(directory.glob("checkpoint_*.mpm")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("number", range(int(os.environ.get("KILLS", 2))))
def test_a_run_whose_rank_dies_is_resumed(sinking, tmp_path, number):
    """`KILLS=50` kills 50 runs."""
    deck, undisturbed = sinking
    chance = random.Random(number)
    process = subprocess.Popen(
        command(3, "run", deck, "--out", tmp_path), cwd=ROOT, env=ENVIRONMENT,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    wait_for_checkpoint(process, tmp_path)
    victim = chance.choice(ranks_of(process))
    time.sleep(chance.uniform(0, 1.0))
    # The run may have ended by itself meanwhile, where the machine was busy: what it wrote must do as well.
    with contextlib.suppress(ProcessLookupError):
        os.kill(victim, signal.SIGKILL)
    process.wait(timeout=120)
    resumed = run(chance.choice([1, 2, 3, 4]), "run", deck, "--out", tmp_path, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    same(Results(tmp_path), undisturbed)


def test_a_resumed_run_knows_the_whole_last_motion(tmp_path):
    """A prediction from the motion of one rank alone takes more iterations."""
    deck = tmp_path / "compaction.yaml"
    text = (ROOT / "inputs" / "compaction.yaml").read_text()
    deck.write_text(text + "\ncheckpoint: {every: 5}\nsolver: {predictor: last-step}\n")
    undisturbed = results_of(3, tmp_path / "undisturbed", deck)
    copy = shutil.copytree(undisturbed.directory, tmp_path / "resumed")
    same(resumed_from_the_last_but_one(2, copy, deck), undisturbed)


def test_a_signal_ends_the_run_with_a_checkpoint(sinking, tmp_path):
    deck, undisturbed = sinking
    process = subprocess.Popen(
        command(2, "run", deck, "--out", tmp_path), cwd=ROOT, env=ENVIRONMENT,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )
    wait_for_checkpoint(process, tmp_path)
    for rank in ranks_of(process)[:1]:
        os.kill(rank, signal.SIGTERM)
    _, text = process.communicate(timeout=120)
    assert process.returncode != 0 and "--resume" in text, text
    resumed = run(3, "run", deck, "--out", tmp_path, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    same(Results(tmp_path), undisturbed)
