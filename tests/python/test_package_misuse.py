"""Wrong calls of the package: each raises an exception with a message, or works; none crashes, hangs or panics."""

import json
import os
import subprocess
import sys
import textwrap

import pytest

from conftest import ROOT
from package import column, mpm

#: Calls of each process.
CALLS = 48


def python(*arguments, cwd, timeout=300):
    """Runs a Python process that finds the tests and the package."""
    tests = str(ROOT / "tests/python")
    path = os.pathsep.join([tests, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = dict(os.environ, PYTHONPATH=path)
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout)


@pytest.mark.parametrize("seed", range(6))
def test_random_misuse_raises_exceptions(tmp_path, seed):
    process = python(ROOT / "tests/python/misuse.py", seed, CALLS, cwd=tmp_path)
    lines = [json.loads(line) for line in process.stdout.splitlines()]
    assert process.returncode == 0, (lines[-1:], process.stderr[-3000:])
    for text in ("panicked", "PanicException", "Fatal Python error", "Traceback"):
        assert text not in process.stderr, (text, process.stderr[-3000:])
    outcomes = [line for line in lines if "raised" in line]
    assert len(outcomes) == CALLS
    for outcome in outcomes:
        if outcome["raised"] is not None:
            assert outcome["is_sensible"], outcome
            assert outcome["message"] or outcome["raised"] == "StopIteration", outcome
            assert "PanicException" not in outcome["message"], outcome
    # Most wrong calls are refused, many of them by the package itself.
    refused = [outcome for outcome in outcomes if outcome["raised"]]
    assert len(refused) > CALLS / 3 and sum(outcome.get("is_own", False) for outcome in refused) > CALLS / 5


def run_code(tmp_path, code):
    process = python("-c", textwrap.dedent(code), cwd=tmp_path, timeout=120)
    assert process.returncode == 0, process.stderr
    assert "panicked" not in process.stderr and "Traceback" not in process.stderr, process.stderr
    return process.stdout.splitlines()


FORK = """
    import os, sys
    import mpm
    from package import column
    run = column().start(threads=2)
    next(run)
    child = os.fork()
    if child == 0:
        calls = [lambda: next(run), lambda: run.points.position, lambda: run.history, lambda: run.ended]
        for call in (*calls, run.stop, run.close, run.change, run.result):
            try:
                call()
            except mpm.UsageError as error:
                assert "another process" in str(error), error
            else:
                os._exit(3)
        run.deck, run.step, repr(run)
        fresh = column().start(threads=2)
        expected = [step.index for step in fresh] == [1, 2, 3, 4]
        {end}
    _, status = os.waitpid(child, 0)
    print(os.waitstatus_to_exitcode(status), [step.index for step in run])
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.parametrize("end", ["os._exit(0 if expected else 4)", "sys.exit(0 if expected else 4)"])
def test_a_run_stays_with_its_process(tmp_path, end):
    """The child may neither use nor disturb the run of its parent, but has runs of its own."""
    assert run_code(tmp_path, FORK.format(end=end)) == ["0 [2, 3, 4]"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_child_inherits_a_run_amid_a_step(tmp_path):
    code = """
        import os, sys, mpm
        from package import load
        def callback(*of):
            if of[0] == 2 and of[1] == 1:
                raise LookupError
        run = load("beam", steps=4).start(on_iteration=callback, laws=None)
        try:
            list(run)
        except LookupError:
            pass
        child = os.fork()
        if child == 0:
            del run
            print(len(list(load("beam", steps=4).start())), flush=True)
            sys.exit(0)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), [step.index for step in run][-1])
    """
    assert run_code(tmp_path, code) == ["4", "0 4"]


def test_two_runs_at_once_do_not_disturb_each_other(tmp_path):
    code = """
        import threading
        from package import assert_same_points, load
        decks = [load("beam", steps=6), load("collapse", h=1, n=3, steps=6)] * 2
        expected = [deck.run(threads=1) for deck in decks]
        runs = [deck.start(threads=2) for deck in decks]
        while not all(run.ended for run in runs):
            [next(run, None) for run in runs]
        [assert_same_points(run.points, result.points) for run, result in zip(runs, expected)]
        found = [None] * 4
        def solve(k):
            found[k] = decks[k].run(threads=2)
        threads = [threading.Thread(target=solve, args=(k,)) for k in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        [assert_same_points(of.points, result.points) for of, result in zip(found, expected)]
        print("same")
    """
    assert run_code(tmp_path, code) == ["same"]


def test_many_runs_leave_no_threads(tmp_path):
    code = """
        import gc, os, time
        from package import column
        column().run()
        def threads():
            return len(os.listdir("/proc/self/task"))
        before = threads()
        for _ in range(30):
            run = column().start(threads=4)
            next(run)
            del run
        kept = [column().start(threads=4) for _ in range(3)]
        [run.close() for run in kept]
        for _ in range(100):
            if threads() <= before:
                break
            time.sleep(0.05)
        print(threads() <= before)
    """
    if not os.path.isdir("/proc/self/task"):
        pytest.skip("there is no list of threads")
    assert run_code(tmp_path, code) == ["True"]


def test_one_directory_has_one_run(tmp_path):
    first = column().start(out=tmp_path / "out")
    with pytest.raises(mpm.ResultsError, match="out") as raised:
        column().start(out=tmp_path / "out")
    assert raised.value.code
    assert len(list(first)) == 4 and mpm.read(tmp_path / "out").summary["outcome"] == "completed"
    assert column().run(out=tmp_path / "out").summary["outcome"] == "completed"


@pytest.mark.skipif(os.name == "nt", reason="there is no /dev/null")
@pytest.mark.parametrize("below", ["/dev/null/out"])
def test_a_directory_that_cannot_be_written_is_named(below):
    with pytest.raises(mpm.ResultsError, match=below) as raised:
        column().run(out=below)
    assert raised.value.code == "R001"


def test_an_empty_name_is_no_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mpm.UsageError, match="directory"):
        column().run(out="")
    assert not list(tmp_path.iterdir())


def test_damaged_results_are_named(tmp_path):
    with pytest.raises(mpm.ResultsError, match="no run has ended"):
        mpm.read(tmp_path)
    column().run(out=tmp_path)
    summary = (tmp_path / "summary.json").read_text()
    for text in ("", "{", "[]", "{}", "3"):
        (tmp_path / "summary.json").write_text(text)
        with pytest.raises(mpm.ResultsError, match="summary.json"):
            mpm.read(tmp_path)
    (tmp_path / "summary.json").write_text(summary)
    frame = mpm.read(tmp_path).frames[-1]
    for damage in (frame.path, tmp_path / "points.pvd", tmp_path / "history.csv"):
        damage.write_bytes(damage.read_bytes()[: -200 if damage is frame.path else 20])
        with pytest.raises(mpm.ResultsError, match=damage.name):
            mpm.read(tmp_path)
    (tmp_path / "history.csv").unlink()
    with pytest.raises(mpm.ResultsError, match="history.csv"):
        mpm.read(tmp_path)
