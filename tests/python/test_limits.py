"""What a run does at the limits of the machine: no room, no rights, no directory, no reader, company.

Whatever happens, the files in a directory of results are whole: see `results.assert_sound`.
"""

import json
import os
import resource
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import pytest

from conftest import ROOT
from results import assert_sound
from test_resume import SMALL, deck_of, last_checkpoint, results, settings

LONG = settings(h=1, n=3, steps=3000, every=1)


def assert_stopped(process, *words):
    """A run that could not write its results ended as it says, and did not panic."""
    assert process.returncode == 1, (process.returncode, process.stderr)
    assert "error[S011]: cannot write results: `" in process.stderr, process.stderr
    assert "panicked" not in process.stderr
    for word in words:
        assert word in process.stderr, process.stderr


@pytest.fixture
def run_at_limit(program):
    """Runs the program after `limit` in its process, and returns it when it has ended."""

    def run(*arguments, limit=None, **options):
        command = [str(program), *map(str, arguments)]
        return subprocess.run(command, preexec_fn=limit, cwd=ROOT, capture_output=True, text=True, timeout=600, **options)

    return run


@pytest.mark.parametrize("kilobytes", [1, 3, 8, 30, 100])
def test_files_that_may_not_grow(run_at_limit, mpm, tmp_path, kilobytes):
    """Every file up to a size, and not one byte more, as on a full disk: rows and meshes are cut off in the middle."""
    deck, directory = deck_of(tmp_path), tmp_path / "out"

    def limit():
        # Python ignores the signal; a shell does not.
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes << 10, kilobytes << 10))

    process = run_at_limit("run", deck, "--out", directory, *SMALL, limit=limit)
    if process.returncode == 2:
        assert "error[R001]" in process.stderr, process.stderr
        return
    if process.returncode != 0:
        assert_stopped(process, "File too large")
    assert_sound(directory)
    assert mpm("status", directory).returncode in (0, 1)
    if last_checkpoint(directory) > 0:
        process = mpm("run", deck, "--out", directory, *SMALL, "--resume")
        assert process.returncode == 0, process.stderr
        assert mpm("run", deck, "--out", tmp_path / "whole", *SMALL).returncode == 0
        assert results(directory) == results(tmp_path / "whole")


@pytest.fixture
def small_disk(tmp_path):
    """Makes a file system of some kilobytes, where that is allowed."""
    mounted = []

    def make(kilobytes):
        place = tmp_path / f"disk{kilobytes}"
        place.mkdir()
        options = f"size={kilobytes}k"
        mount = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", place], capture_output=True)
        if mount.returncode != 0:
            pytest.skip("file systems may not be mounted here; the limit of file sizes is tested above")
        mounted.append(place)
        return place

    yield make
    for place in mounted:
        subprocess.run(["umount", place], check=True)


@pytest.mark.parametrize("kilobytes", [16, 64, 100, 200, 400])
def test_a_full_disk(run_at_limit, mpm, tmp_path, small_disk, kilobytes):
    disk = small_disk(kilobytes)
    deck, directory = deck_of(tmp_path), disk / "out"
    process = run_at_limit("run", deck, "--out", directory, *SMALL)
    if process.returncode == 2:
        assert "error[R001]" in process.stderr, process.stderr
        return
    assert_stopped(process, "No space left on device")
    assert_sound(directory)
    reached = last_checkpoint(directory)
    # With more room the run goes on from its last checkpoint, to the same files.
    subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
    process = mpm("run", deck, "--out", directory, *SMALL, *(["--resume"] if reached else []))
    assert process.returncode == 0, process.stderr
    assert mpm("run", deck, "--out", tmp_path / "whole", *SMALL).returncode == 0
    assert results(directory) == results(tmp_path / "whole")


@pytest.fixture
def without_rights(program):
    """A directory that belongs to nobody in particular, and a way to run the program as nobody."""
    place = Path(tempfile.mkdtemp(prefix="mpm-"))
    place.chmod(0o755)
    copy = shutil.copy(program, place / "mpm")
    deck = deck_of(place)

    def become_nobody():
        if os.geteuid() == 0:
            os.setgroups([])
            os.setgid(65534)
            os.setuid(65534)

    def run(*arguments):
        command = [copy, *map(str, arguments)]
        return subprocess.run(command, cwd=place, preexec_fn=become_nobody, capture_output=True, text=True, timeout=600)

    def start(*arguments):
        pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return subprocess.Popen([copy, *map(str, arguments)], cwd=place, preexec_fn=become_nobody, text=True, **pipe)

    yield place, deck, run, start
    for path in place.rglob("*"):
        if path.is_dir():
            path.chmod(0o755)
    shutil.rmtree(place)


def test_a_directory_that_may_not_be_written(without_rights):
    place, deck, run, start = without_rights
    out = place / "out"
    process = run("run", deck, "--out", out, *SMALL)
    assert process.returncode == 2 and not out.exists(), process.stderr
    assert "error[R001]: the results directory" in process.stderr and "Permission denied" in process.stderr
    assert run("sweep", deck, "--over", "n=2,3", "--out", out).stderr.startswith("error[R001]")
    # The rights are taken away while it runs.
    out.mkdir()
    out.chmod(0o777)
    process = start("run", deck, "--out", out, *LONG)
    wait_for(out / "points_0003.vtu", process)
    out.chmod(0o555)
    messages = process.communicate(timeout=120)[1]
    assert process.returncode == 1 and "error[S011]" in messages and "Permission denied" in messages, messages
    assert "panicked" not in messages
    # What was begun cannot even be removed, but it has no final name.
    assert_sound(out, ended=False)
    assert "error[R001]" in run("run", deck, "--out", out, *SMALL).stderr
    assert "error[R00" in run("run", deck, "--out", out, *SMALL, "--resume").stderr
    assert run("status", out).returncode == 1
    out.chmod(0o777)


def test_a_file_where_the_directory_should_be(mpm, tmp_path):
    deck = deck_of(tmp_path)
    (tmp_path / "file").write_text("precious")
    for place in ("file", "file/below"):
        for words in ([], ["--resume"]):
            process = mpm("run", deck, "--out", tmp_path / place, *SMALL, *words)
            assert process.returncode == 2 and "error[R00" in process.stderr, process.stderr
    assert (tmp_path / "file").read_text() == "precious"
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "history.csv").write_text("precious")
    process = mpm("run", deck, "--out", tmp_path / "foreign", *SMALL)
    assert process.returncode == 2 and "error[R001]" in process.stderr and "history.csv" in process.stderr
    assert (tmp_path / "foreign" / "history.csv").read_text() == "precious"


def wait_for(path, process):
    deadline = time.monotonic() + 120
    while not path.exists():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.002)


def start(program, *arguments, **options):
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
    return subprocess.Popen([str(program), *map(str, arguments)], **options)


@pytest.mark.parametrize("every", [1, 0])
@pytest.mark.parametrize("what", ["removed", "moved"])
def test_a_directory_that_vanishes(program, tmp_path, every, what):
    deck, out = deck_of(tmp_path), tmp_path / "out"
    process = start(program, "run", deck, "--out", out, *settings(h=1, n=3, steps=300, every=every))
    wait_for(out / "checkpoint_0003.mpm", process)
    if what == "moved":
        out.rename(tmp_path / "elsewhere")
    else:
        while out.exists():
            shutil.rmtree(out, ignore_errors=True)
    messages = process.communicate(timeout=120)[1]
    assert process.returncode == 1 and "error[S011]" in messages and "No such file" in messages, messages
    assert "panicked" not in messages
    assert not out.exists(), "a run does not make its directory again"
    if what == "moved":
        # The file in hand may be left there under its temporary name: nobody can know where it has gone.
        assert_sound(tmp_path / "elsewhere", ended=False)


@pytest.mark.parametrize("closed", ["stdout", "stderr", "both"])
def test_nobody_reads(program, tmp_path, closed):
    """The other end of a pipe is closed before anything is written; the run does not care."""
    deck, out = deck_of(tmp_path), tmp_path / "out"
    reading, writing = os.pipe()
    os.close(reading)
    streams = {name: writing for name in ("stdout", "stderr") if closed in (name, "both")}
    process = start(program, "run", deck, "--out", out, *SMALL, **streams)
    os.close(writing)
    process.communicate(timeout=120)
    assert process.returncode == 0
    assert_sound(out)
    assert json.loads((out / "summary.json").read_text())["outcome"] == "completed"


@pytest.mark.parametrize("words", [["schema"], ["explain"], ["--help"], ["new"], ["check", "inputs/beam.yaml"]], ids=str)
def test_nobody_reads_what_is_printed(run_at_limit, program, words):
    reading, writing = os.pipe()
    os.close(reading)
    process = subprocess.run([program, *words], cwd=ROOT, stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert process.returncode == 0 and process.stderr == "", process.stderr


def test_standard_output_that_is_full(program, tmp_path):
    """The results are in the directory; that their table cannot be shown is told, and the exit code tells of it."""
    deck, out = deck_of(tmp_path), tmp_path / "out"
    with open("/dev/full", "w") as full:
        command = [program, "run", deck, "--out", out, *SMALL]
        process = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
        assert process.returncode == 1 and "cannot be written to standard output: No space left" in process.stderr
        assert json.loads((out / "summary.json").read_text())["outcome"] == "completed"
        assert_sound(out)
        schema = subprocess.run([program, "schema"], stdout=full, stderr=subprocess.PIPE, text=True)
        assert schema.returncode != 0 and "No space left" in schema.stderr
        assert subprocess.run(command, stdout=full, stderr=full).returncode == 1


def test_many_runs_into_one_directory_at_once(program, tmp_path):
    """One of them has it, the others are refused; they begin at the same moment and again while it runs."""
    deck, out = deck_of(tmp_path), tmp_path / "out"
    words = settings(h=1, n=6, steps=40, every=5)
    processes = [start(program, "run", deck, "--out", out, *words, *more) for more in [[]] * 3 + [["--resume"]] * 2]
    ended = [(process.communicate(timeout=300)[1], process.returncode) for process in processes]
    codes = sorted(code for _, code in ended)
    assert codes.count(0) >= 1 and set(codes) <= {0, 2}, ended
    for messages, code in ended:
        assert code == 0 or "error[R001]" in messages and "another run" in messages or "error[R002]" in messages, messages
    assert_sound(out)
    assert json.loads((out / "summary.json").read_text())["outcome"] == "completed"


def test_files_are_whole_at_every_moment(program, tmp_path):
    """A reader that looks all the time never meets a half-written file."""
    deck, out = deck_of(tmp_path), tmp_path / "out"
    process = start(program, "run", deck, "--out", out, *settings(h=1, n=3, steps=60, every=1))
    drained = threading.Thread(target=process.stderr.read)
    drained.start()
    looks = 0
    while process.poll() is None:
        if out.exists():
            # A file may be named by a series before, and gone after, only when the run begins.
            assert_sound(out, ended=False)
            looks += 1
    drained.join()
    assert process.returncode == 0 and looks > 3
    assert_sound(out)


def test_a_clock_that_was_set_back(mpm, tmp_path):
    """The status was written in what is now the future; nothing depends on the clock but what it shows."""
    deck, out = deck_of(tmp_path), tmp_path / "out"
    assert mpm("run", deck, "--out", out, *SMALL).returncode == 0
    path = out / "status.json"
    for moment in ("2999-12-31T23:59:59Z", "9999-12-30T00:00:00Z", "0001-01-01T00:00:00Z"):
        status = json.loads(path.read_text())
        status["updated"] = status["started"] = moment
        path.write_text(json.dumps(status))
        process = mpm("status", out)
        assert process.returncode == 0 and "ended" in process.stdout, process.stderr
        assert "-" not in process.stdout.partition("ended")[2].partition("ago")[0]
        os.utime(out / "checkpoint_0030.mpm", (0, 0))
        assert "nothing is left to do" in mpm("run", deck, "--out", out, *SMALL, "--resume").stderr
