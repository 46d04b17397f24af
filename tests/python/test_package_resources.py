"""What runs of the package leave behind: threads, checkpoints, exit codes, and the objects of users."""

import copy
import gc
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from package import load, mpm


def threads():
    tasks = Path("/proc/self/task")
    if not tasks.exists():
        pytest.skip("the threads of a process are in /proc")
    return len(list(tasks.iterdir()))


def settled(wanted):
    """Waits a little until the number of threads falls to that wanted; returns it."""
    for _ in range(100):
        gc.collect()
        if threads() <= wanted:
            break
        time.sleep(0.02)
    return threads()


def beam():
    return load("beam", n=2, steps=3)


def test_runs_that_their_callbacks_reach_are_released():
    before = threads()
    for _ in range(5):
        run = beam().start(threads=2, on_iteration=lambda *_: run.step)
        list(run)
    del run
    assert settled(before) <= before


def test_runs_that_their_laws_reach_are_released():
    class Holding(mpm.BuiltInLaw):
        """Knows the run that it serves."""

    before = threads()
    for _ in range(5):
        law = Holding("hencky", young=12e6, poisson=0.2)
        law.run = beam().start(threads=2, laws={"steel": law})
        next(law.run)
    del law
    assert settled(before) <= before


def test_results_keep_no_threads():
    before = threads()
    results = [beam().run(threads=2, progress=False) for _ in range(5)]
    assert settled(before) <= before
    assert {len(result.points.position) for result in results} == {len(results[0].points.mass)}


def test_a_run_with_a_law_in_python_is_not_resumed_without_it(tmp_path):
    law = mpm.BuiltInLaw("hencky", young=1e6, poisson=0.2)
    with beam().start(out=tmp_path, laws={"steel": law}) as run:
        next(run)
    assert not list(tmp_path.glob("checkpoint*")) and (tmp_path / "history.csv").exists()


def test_leaving_a_run_ends_it_whatever_its_callback_does():
    def failing(*_):
        raise LookupError("no")

    with pytest.raises(LookupError), beam().start(on_iteration=failing) as run:
        next(run)
    assert run.ended and run.result().summary["outcome"] == "interrupted"


@pytest.mark.parametrize(
    "name",
    ["position", "cauchy_stress", "J", "point_id", "material_id", "displacement_datum", "", "two words", 1],
)
def test_history_variables_have_names_of_their_own(name):
    class Named(mpm.BuiltInLaw):
        state = {name: 0.0}

        def __init__(self):
            self.measure, self.symmetric = "logarithmic", True

    law = Named()
    with pytest.raises(mpm.UsageError, match="history variable"):
        beam().start(laws={"steel": law})


def test_laws_of_the_library_are_copied_and_pickled():
    law = mpm.BuiltInLaw("von-mises", young=1e6, poisson=0.3, deviatoric_yield_stress=2e4)
    for again in (copy.deepcopy(law), pickle.loads(pickle.dumps(law))):
        assert repr(again) == repr(law) and again.state == law.state


def test_the_command_handles_an_interrupt_as_the_program_does(tmp_path):
    deck = Path(__file__).parents[2] / "inputs/beam.yaml"
    command = [sys.executable, "-m", "mpm", "run", str(deck), "--set", "h=0.03125", "--set", "n=4", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if (tmp_path / "history.csv").exists() and len((tmp_path / "history.csv").read_text().splitlines()) > 1:
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130 and "Traceback" not in errors, errors


def test_a_study_without_guard_says_so(tmp_path):
    script = tmp_path / "study.py"
    deck = Path(__file__).parents[2] / "inputs/beam.yaml"
    script.write_text(
        textwrap.dedent(
            f"""
            import mpm
            mpm.sweep(mpm.Deck.load({str(deck)!r}, n=2, steps=1), {{"h": [0.5, 0.25]}}, processes=2)
            """
        )
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "UsageError" in done.stderr and "__main__" in done.stderr
