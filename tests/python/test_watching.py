"""A run seen during it and at its end: lines, log, status, signals, and the table at the end."""

import contextlib
import json
import os
import pty
import re
import select
import shlex
import signal
import subprocess
import time

import numpy as np
import pytest

from conftest import ROOT
from results import Results

LONG = [ROOT / "inputs" / "collapse.yaml", "--set", "n=9", "--set", "steps=400"]


@pytest.fixture
def start(program, tmp_path):
    """Starts a long run and waits until it has made some steps; ends it whatever happens."""
    processes = []

    def run(*arguments, wait_for="points_0004.vtu", **options):
        out = tmp_path / "out"
        command = [program, "run", *LONG, "--out", out, *arguments]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
        processes.append(process)
        while not (out / wait_for).exists():
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.01)
        return process, out

    yield run
    for process in processes:
        if process.poll() is None:
            process.kill()
            process.communicate()


def status_of(mpm, out):
    process = mpm("status", out, "--format", "json")
    return process.returncode, json.loads(process.stdout)


def test_status_of_a_run_from_its_beginning_to_its_end(mpm, start):
    process, out = start()
    time.sleep(1.2)
    code, status = status_of(mpm, out)
    assert (code, status["state"]) == (3, "running")
    assert status["process"] == process.pid
    assert 3 <= status["steps"] <= status["step"] <= status["steps_requested"] == 400
    assert status["load_factor"] == pytest.approx(status["step"] / 400)
    assert status["points"] > 0 and status["points_per_second"] > 0
    assert status["seconds_left"] > 0 and status["elapsed_seconds"] > 1
    assert 0 < status["memory_bytes"] <= status["peak_memory_bytes"]
    text = mpm("status", out)
    assert text.returncode == 3
    assert text.stdout.startswith(f"{out}: running\n") and " left" in text.stdout
    assert not list(out.glob("*.tmp")) or process.poll() is None

    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    code, status = status_of(mpm, out)
    assert (code, status["state"], status["seconds_left"]) == (130, "interrupted", None)
    assert status["steps"] == len(Results(out).history["step"])


def test_a_second_run_into_the_same_directory_is_refused(mpm, start):
    process, out = start()
    second = mpm("run", "inputs/beam.yaml", "--out", out)
    assert second.returncode == 2
    assert "another run" in second.stderr
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    assert Results(out).summary["outcome"] == "interrupted"


def test_a_killed_run_has_died(mpm, start):
    process, out = start()
    process.kill()
    process.communicate()
    code, status = status_of(mpm, out)
    assert (code, status["state"]) == (1, "died")
    assert "died" in mpm("status", out).stdout
    # What it has written can be read, and the directory used again.
    assert Results(out).history["step"].size >= 3
    again = mpm("run", "inputs/beam.yaml", "--set", "steps=4", "--set", "n=2", "--out", out)
    assert again.returncode == 0 or "error[S" in again.stderr, again.stderr
    assert status_of(mpm, out)[1]["state"] in ("completed", "failed")


def test_status_of_what_has_ended(mpm, tmp_path):
    out = tmp_path / "out"
    assert mpm("run", "inputs/compaction.yaml", "--out", out).returncode == 0
    code, status = status_of(mpm, out)
    assert (code, status["state"], status["steps"]) == (0, "completed", 20)
    assert status["residual"] <= status["tolerance"]
    assert mpm("run", "inputs/collapse.yaml", "--set", "steps=2", "--set", "smallest=1", "--out", out).returncode == 1
    code, status = status_of(mpm, out)
    assert (code, status["state"]) == (1, "failed")
    assert status["reason"] == Results(out).summary["reason"]
    for nothing in (tmp_path, tmp_path / "missing"):
        process = mpm("status", nothing)
        assert process.returncode == 2 and "no run" in process.stderr
    (out / "status.json").write_text("{")
    assert mpm("status", out).returncode == 2


ASKING = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU, signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM]


@pytest.mark.parametrize("kind", ASKING, ids=lambda kind: kind.name)
def test_signals_end_a_run_with_complete_files(start, kind):
    # Under `nohup`, tests ignore a signal, and so would what they start.
    handler = signal.getsignal(kind)
    if handler is signal.SIG_IGN:
        signal.signal(kind, signal.SIG_DFL)
    process, out = start()
    signal.signal(kind, handler)
    # A second signal within two seconds belongs to the first: GNU `timeout` sends two within milliseconds.
    process.send_signal(kind)
    time.sleep(0.01)
    with contextlib.suppress(ProcessLookupError):
        process.send_signal(kind)
    output, messages = process.communicate(timeout=120)
    assert process.returncode == 130, messages
    assert messages.count("stopping after the current step") == 1
    assert list(out.glob("checkpoint_*.mpm"))
    results = Results(out)
    assert results.summary["outcome"] == "interrupted"
    assert len(results.series("points")) == len(results.history["step"]) + 1
    assert not list(out.glob("*.tmp"))
    assert "interrupted:" in output, "the table tells what there is"


def test_a_second_signal_ends_a_run_at_once(mpm, start):
    process, out = start()
    process.send_signal(signal.SIGTERM)
    while "stopping after" not in process.stderr.readline():
        assert process.poll() is None
    time.sleep(2.1)  # before, it would count as the same request
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=120)
    assert process.returncode == 130
    assert status_of(mpm, out)[1]["state"] in ("died", "interrupted"), "or it was just in time"


def test_nohup_keeps_a_run_going(start):
    process, out = start(preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    process.send_signal(signal.SIGHUP)
    reached = len(list(out.glob("points_*.vtu")))
    deadline = time.monotonic() + 60
    while len(list(out.glob("points_*.vtu"))) < reached + 3:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=120)
    assert messages.count("stopping after the current step") == 1


def test_the_log_has_every_iteration(mpm, tmp_path):
    out, log = tmp_path / "out", tmp_path / "run.log"
    process = mpm("run", "inputs/beam.yaml", "--set", "steps=20", "--out", out, "--log", log)
    assert process.returncode == 0, process.stderr
    text = log.read_text()
    assert re.match(r" +\d+\.\d{3}  mpm \d+\.\d+\.\d+, \d{4}-\d\d-\d\dT", text)
    logged = re.findall(r"step (\d+): iteration (\d+): residual (\S+)$", text, re.M)
    convergence = Results(out).table("convergence")
    assert [(int(s), int(i)) for s, i, _ in logged] == list(zip(convergence["step"], convergence["iteration"]))
    np.testing.assert_allclose([float(r) for _, _, r in logged], convergence["residual"], rtol=1e-3)
    times = [float(line.split()[0]) for line in text.splitlines() if line.strip()]
    assert times == sorted(times)
    assert "factorise" in text and "completed: 20 steps in equilibrium" in text
    assert process.stdout.strip().splitlines()[-1].strip() in text


def test_the_log_grows_line_by_line(start, tmp_path):
    log = tmp_path / "run.log"
    process, _ = start("--log", log)
    text = log.read_text()
    assert text.endswith("\n") and "step 3/400" in text
    process.kill()
    process.communicate()


def test_the_log_of_a_deck_that_is_refused_and_of_a_run_that_fails(mpm, tmp_path):
    log = tmp_path / "run.log"
    assert mpm("run", "tests/decks/unknown_key.yaml", "--out", tmp_path / "out", "--log", log).returncode == 2
    assert "D006" in log.read_text()
    failing = ["--set", "steps=2", "--set", "smallest=1"]
    process = mpm("run", "inputs/collapse.yaml", *failing, "--out", tmp_path / "out", "--log", log)
    assert process.returncode == 1
    assert re.search(r"error\[S00\d\]", log.read_text()) and "D006" not in log.read_text()
    process = mpm("run", "inputs/beam.yaml", "--out", tmp_path / "out", "--log", tmp_path / "no" / "run.log")
    assert process.returncode == 2 and "log" in process.stderr


def test_a_refused_run_leaves_the_log_of_another_alone(mpm, start, tmp_path):
    log = tmp_path / "run.log"
    process, out = start("--log", log)
    second = mpm("run", *LONG, "--out", out, "--log", log)
    assert second.returncode == 2 and "R001" in second.stderr, second.stderr
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    text = log.read_text()
    assert text.count(", threads: ") == 1 and "\0" not in text and "step 3/400" in text
    for words in ([], ["--resume"]):
        refused = mpm("run", "tests/decks/unknown_key.yaml", "--out", out, "--log", log, *words)
        assert refused.returncode == 2 and log.read_text() == text
    assert mpm("run", "inputs/beam.yaml", "--set", "steps=2", "--out", tmp_path / "new", "--log", log).returncode == 0
    assert "step 3/400" not in log.read_text() and "completed: " in log.read_text()


def test_without_a_terminal_there_are_few_lines(mpm, tmp_path):
    process = mpm("run", "inputs/compaction.yaml", "--set", "steps=300", "--set", "every=0", "--out", tmp_path)
    assert process.returncode == 0, process.stderr
    lines = re.findall(r"^step (\d+)/300: ", process.stderr, re.M)
    assert 20 <= len(lines) <= 25 and lines[0] == "1" and lines[-1] == "300"
    assert "\r" not in process.stderr and "\x1b" not in process.stderr


def test_a_terminal_shows_a_bar(program, tmp_path):
    ours, theirs = pty.openpty()
    command = [program, "run", *LONG, "--set", "every=0", "--out", tmp_path / "out"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env={**os.environ, "TERM": "xterm"})
    os.close(theirs)
    shown, deadline = "", time.monotonic() + 60
    wanted = ["step ", "iteration ", "residual ", "load factor ", "points/s", " left", " elapsed", "iB"]
    while not all(word in shown for word in wanted) and time.monotonic() < deadline:
        if select.select([ours], [], [], 1)[0]:
            shown += os.read(ours, 4096).decode(errors="replace")
    process.send_signal(signal.SIGINT)
    process.wait(timeout=120)
    os.close(ours)
    assert all(word in shown for word in wanted), shown[-2000:]


def table_of(process):
    """Rows of the table that a run ends with, by label."""
    rows = {}
    for line in process.stdout.splitlines():
        assert len(line) <= 80 or re.match(r"  (results  |report  |picture  |in ParaView  |in Python  |import pyvista;)", line), line
        if label := line[2:20].strip():
            rows[label] = line[20:].strip()
    return rows


def test_the_table_at_the_end_agrees_with_the_files(mpm, tmp_path):
    out = tmp_path / "out"
    process = mpm("run", "inputs/collapse.yaml", "--set", "method=gimp", "--set", "steps=40", "--out", out)
    assert process.returncode == 0, process.stderr
    rows = table_of(process)
    results = Results(out)
    summary, history, mesh = results.summary, results.history, results.mesh("points", -1)
    assert rows["outcome"].startswith("completed: 40 steps in equilibrium")
    assert f"{summary['evaluations']} evaluations" in rows["iterations"]
    low, high = int(history["iterations"].min()), int(history["iterations"].max())
    assert rows["iterations"].startswith(f"{low} to {high} in a step")
    assert float(re.search(r"at most (\S+)", rows["residual"])[1]) == pytest.approx(history["residual"].max(), rel=0.1)

    def largest(label):
        return float(re.search(r"(?:at most|from|to) (\S+)", rows[label])[1])

    assert largest("displacement") == pytest.approx(np.linalg.norm(mesh["displacement"], axis=1).max(), rel=1e-4)
    assert largest("von Mises stress") == pytest.approx(mesh["von_mises_stress"].max(), rel=1e-4)
    assert largest("pressure") == pytest.approx(mesh["pressure"].min(), rel=1e-4)
    found = summary["largest"]
    assert found["highest_pressure"]["value"] == pytest.approx(mesh["pressure"].max())
    point = found["displacement"]["point"]
    assert np.linalg.norm(mesh["displacement"][point]) == pytest.approx(found["displacement"]["value"])
    np.testing.assert_allclose(found["displacement"]["position"], mesh.points[point][:2])

    # The weight of the block, 8 m x 8 m x 1000 kg/m3 x 10 m/s2, stands on the base; the plane of symmetry holds nothing
    # in the end.
    loads, base = (np.array(rows[label].split()[:2], dtype=float) for label in ("loads", "base"))
    np.testing.assert_allclose(loads, [0, -640e3], rtol=1e-4)
    assert base[1] == pytest.approx(640e3, rel=1e-4)
    forces = summary["forces"]
    np.testing.assert_allclose(forces["applied"], [0, -640e3], rtol=1e-12)
    assert forces["reactions"]["base"][1] == history["base_ry"][-1]
    sums = np.sum(list(forces["reactions"].values()), axis=0) + forces["applied"]
    np.testing.assert_allclose(forces["difference"], sums, atol=1e-6)
    # Some domains of GIMP reach beyond the grid by a little; see docs/output.md.
    assert forces["relative_difference"] < 1e-4
    assert f"{forces['relative_difference']:.1e}".split("e")[0] in rows["difference"]

    # The files that the table names are there, and the line of Python names their folder.
    assert (out / "domains.pvd").exists() and rows["in ParaView"] == f"paraview {out}/domains.pvd"
    assert rows["in Python"] == f'import mpm; mpm.read("{out}").plot()'
    assert rows["report"] == f"mpm report {out}"


def test_the_command_of_the_table_can_be_copied(mpm, tmp_path):
    out = tmp_path / "what's new"
    process = mpm("run", "inputs/annulus.yaml", "--out", out)
    assert process.returncode == 0, process.stderr
    assert shlex.split(table_of(process)["in ParaView"]) == ["paraview", f"{out}/points.pvd"]


def test_the_table_of_points_without_domain_and_of_no_files(mpm, tmp_path):
    process = mpm("run", "inputs/annulus.yaml", "--out", tmp_path / "a")
    assert process.returncode == 0, process.stderr
    assert table_of(process)["in ParaView"].endswith("points.pvd")
    process = mpm("run", "inputs/annulus.yaml", "--set", "every=0", "--out", tmp_path / "b")
    assert "every: 0" in process.stdout and "paraview" not in process.stdout
