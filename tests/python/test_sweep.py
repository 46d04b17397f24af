"""Parameter studies: the table against individual runs, going on where a study stopped, and members that fail."""

import csv
import json
import shutil
import signal
import subprocess
import time

import pytest

from conftest import ROOT
from results import Results

BEAM = "inputs/beam.yaml"
QUICK = ["--set", "steps=25", "--set", "every=0"]


def read_table(directory):
    """The rows of a table, as dictionaries of texts."""
    with open(directory / "sweep.csv", newline="") as file:
        return list(csv.DictReader(file))


def outcomes(directory):
    return [row["outcome"] for row in read_table(directory)]


def runs(process):
    """Numbers of the members that were run, not taken over."""
    lines = [line for line in process.stderr.splitlines() if line.startswith("member ")]
    return [int(line.split()[1].split("/")[0]) for line in lines if not line.endswith(": completed earlier")]


def stamps(directory):
    """When the summaries of the members were written."""
    return {path.parent.name: path.stat().st_mtime_ns for path in directory.glob("*/summary.json")}


def assert_row_is_of(row, results):
    """The entries of a row are those of the files of a run, to the last digit."""
    summary, history = results.summary, results.history
    assert row["outcome"] == summary["outcome"] and row["reason"] == (summary["reason"] or "")
    for name in ("steps", "evaluations", "linear_solves", "points", "unknowns"):
        assert int(row[name]) == summary[name]
    columns = set(row)
    for body, facts in summary["bodies"].items():
        for of, infix in (("points", ""), ("domain", "domain_")):
            for bound in ("min", "max"):
                for axis, value in zip("xy", facts["extent"][of][bound]):
                    assert float(row[f"{body}_extent_{infix}{axis}_{bound}"]) == value
    own = ("step", "time", "iterations", "residual", "linear_iterations", "converged")
    names = [name for name in history if name not in own]
    assert {"external_work", "strain_energy"} <= set(names) <= columns
    for name in names:
        assert float(row[name]) == history[name][-1]


@pytest.fixture(scope="module")
def study(mpm, tmp_path_factory):
    """A small study, and the process that ran it. Tests that change it copy it first."""
    directory = tmp_path_factory.mktemp("study") / "out"
    process = mpm("sweep", BEAM, "--over", "h=0.5,0.25", "--over", "n=5,6", *QUICK, "--out", directory)
    assert process.returncode == 0, process.stderr
    return directory, process


def again(mpm, directory, deck=BEAM, *more):
    return mpm("sweep", deck, "--over", "h=0.5,0.25", "--over", "n=5,6", *QUICK, *more, "--out", directory)


def test_table_agrees_with_individual_runs(study, analyse):
    directory, process = study
    rows = read_table(directory)
    assert [(row["h"], row["n"]) for row in rows] == [("0.5", "5"), ("0.5", "6"), ("0.25", "5"), ("0.25", "6")]
    assert runs(process) == [1, 2, 3, 4]
    for row in rows:
        member = Results(directory / f"h={row['h']},n={row['n']}")
        alone = analyse(BEAM, h=row["h"], n=row["n"], steps=25, every=0)
        assert_row_is_of(row, member)
        assert_row_is_of(row, alone)
        for name in ("history.csv", "convergence.csv"):
            assert (member.directory / name).read_bytes() == (alone.directory / name).read_bytes()
        assert member.summary["parameters"] == alone.summary["parameters"]
        assert member.summary["deck_hash"] == alone.summary["deck_hash"]
        assert float(row["cpu_seconds"]) == member.summary["cpu_seconds"]["total"]
        assert int(row["peak_memory_bytes"]) == member.summary["peak_memory_bytes"]
    assert len({Results(path.parent).summary["deck_hash"] for path in directory.glob("*/summary.json")}) == 4
    assert not list(directory.rglob("*.tmp")) and not list(directory.rglob("*.vtu"))


def test_time_is_that_of_the_member(mpm, tmp_path):
    began = time.monotonic()
    process = mpm("sweep", BEAM, "--over", "h=0.125,0.5", *QUICK, "--set", "n=5", "--out", tmp_path)
    total = time.monotonic() - began
    assert process.returncode == 0, process.stderr
    summaries = [Results(tmp_path / f"h={h}").summary for h in ("0.125", "0.5")]
    large, small = summaries
    for clock in ("cpu_seconds", "wall_seconds"):
        assert small[clock]["total"] < 0.5 * large[clock]["total"]
        for summary in summaries:
            phases = sum(value for name, value in summary[clock].items() if name != "total")
            assert phases <= summary[clock]["total"] * 1.01 + 0.01
    assert sum(summary["wall_seconds"]["total"] for summary in summaries) <= total


def test_a_complete_study_is_not_run_again(mpm, study):
    directory, _ = study
    before, table = stamps(directory), (directory / "sweep.csv").read_bytes()
    process = again(mpm, directory)
    assert process.returncode == 0, process.stderr
    assert runs(process) == []
    assert stamps(directory) == before
    assert (directory / "sweep.csv").read_bytes() == table


def test_a_line_break_in_the_name_of_a_body_does_not_hide_the_table(mpm, tmp_path):
    text = (ROOT / BEAM).read_text()
    for key in ("name", "body"):
        assert f"{key}: beam" in text
        text = text.replace(f"{key}: beam", f'{key}: "be\\nam"')
    deck = tmp_path / "deck.yaml"
    deck.write_text(text)
    for expected in ([1], []):
        process = mpm("sweep", deck, "--over", "n=5", *QUICK, "--out", tmp_path / "out")
        assert process.returncode == 0 and runs(process) == expected, process.stderr


def test_only_what_is_missing_is_run(mpm, study, tmp_path):
    directory = shutil.copytree(study[0], tmp_path / "out")
    shutil.rmtree(directory / "h=0.5,n=6")
    (directory / "h=0.25,n=5" / "history.csv").unlink()
    before = stamps(directory)
    process = again(mpm, directory)
    assert process.returncode == 0, process.stderr
    assert runs(process) == [2, 3]
    after = stamps(directory)
    assert set(after) == set(before) | {"h=0.5,n=6"}
    assert {name for name in before if after[name] != before[name]} == {"h=0.25,n=5"}
    assert outcomes(directory) == ["completed"] * 4
    for row in read_table(directory):
        assert_row_is_of(row, Results(directory / f"h={row['h']},n={row['n']}"))


def test_a_study_grows(mpm, study, tmp_path):
    directory = shutil.copytree(study[0], tmp_path / "out")
    process = mpm("sweep", BEAM, "--over", "h=0.5,1,0.25", "--over", "n=6,5", *QUICK, "--out", directory)
    assert runs(process) == [3, 4], process.stderr
    assert [(row["h"], row["n"]) for row in read_table(directory)][:2] == [("0.5", "6"), ("0.5", "5")]


def test_another_deck_value_or_version_is_run_afresh(mpm, study, tmp_path):
    directory = shutil.copytree(study[0], tmp_path / "out")
    deck = tmp_path / "beam.yaml"
    deck.write_text((ROOT / BEAM).read_text())
    assert runs(again(mpm, directory, deck)) == [], "the place of the deck does not matter"
    assert runs(again(mpm, directory, deck, "--set", "update=corners")) == [], "this is the value in the deck"
    assert runs(again(mpm, directory, deck, "--set", "update=diagonal")) == [1, 2, 3, 4]
    assert runs(again(mpm, directory, deck)) == [1, 2, 3, 4]
    deck.write_text(deck.read_text().replace("young: 12e6", "young: 13e6"))
    assert runs(again(mpm, directory, deck)) == [1, 2, 3, 4]

    summary = directory / "h=0.5,n=5" / "summary.json"
    values = json.loads(summary.read_text())
    summary.write_text(json.dumps(values | {"version": "0.0.0"}))
    assert runs(again(mpm, directory, deck)) == [1]
    (directory / "h=0.5,n=5" / "summary.json").write_text("{")
    assert runs(again(mpm, directory, deck)) == [1]


def test_a_failed_member_does_not_stop_the_others(mpm, tmp_path):
    arguments = ["sweep", BEAM, "--over", "steps=1,25", "--over", "h=0.5,0.3", "--set", "n=6", "--set", "smallest=1", "--out", tmp_path]
    process = mpm(*arguments, "--set", "every=0")
    assert process.returncode == 1, process.stderr
    assert "panicked" not in process.stderr
    rows = read_table(tmp_path)
    # The deck has a parameter with the name of a result.
    assert [(row["parameter_steps"], row["h"]) for row in rows] == [
        ("1", "0.5"), ("1", "0.3"), ("25", "0.5"), ("25", "0.3"),
    ]  # fmt: skip
    assert outcomes(tmp_path) == ["failed", "invalid", "completed", "invalid"]
    failed, invalid, completed, _ = rows
    assert "step 1" in failed["reason"] and failed["reason"] in process.stderr
    assert failed["steps"] == "0" and failed["points"] == completed["points"] and failed["external_work"] == ""
    assert "D027" in invalid["reason"] and "0.3" in invalid["reason"] and invalid["points"] == ""
    assert completed["reason"] == "" and completed["steps"] == "25"
    assert_row_is_of(completed, Results(tmp_path / "steps=25,h=0.5"))
    assert not (tmp_path / "steps=25,h=0.3").exists()
    # What failed is tried again, what was completed is not.
    process = mpm(*arguments, "--set", "every=0")
    assert process.returncode == 1 and runs(process) == [1, 2, 4]


def test_exit_codes(mpm, tmp_path):
    def code(*axes, deck=BEAM):
        return mpm("sweep", deck, *axes, *QUICK, "--out", tmp_path / "out").returncode

    assert code("--over", "h=0.3,0.7") == 2
    assert outcomes(tmp_path / "out") == ["invalid", "invalid"]
    assert code("--over", "h=0.3,0.5", "--set", "n=6") == 0
    assert outcomes(tmp_path / "out") == ["invalid", "completed"]
    assert code("--over", "h=0.5", deck=tmp_path / "missing.yaml") == 2
    (tmp_path / "broken.yaml").write_text("parameters: [\n")
    process = mpm("sweep", tmp_path / "broken.yaml", "--over", "h=0.5", "--out", tmp_path / "other")
    assert process.returncode == 2 and "error[D002]" in process.stderr, process.stderr
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ([], "--over"),
        (["--over", "h"], "NAME=VALUE"),
        (["--over", "h="], "NAME=VALUE"),
        (["--over", "h=1,,2"], "NAME=VALUE"),
        (["--over", "hh=1"], "hh"),
        (["--over", "stpes=1"], "error[D013]: the deck has no parameter `stpes`; did you mean `steps`"),
        (["--over", "h=1", "--set", "nn=1"], "nn"),
        (["--over", "h=1", "--over", "h=2"], "varied twice"),
        (["--over", "h=1,1.0"], "twice in the list"),
        (["--over", "h=1", "--set", "h=2"], "both varied and set"),
        (["--over", "h=1", "--threads", "0"], "--threads"),
    ],
)
def test_usage_errors(mpm, tmp_path, arguments, complaint):
    process = mpm("sweep", BEAM, *arguments, "--out", tmp_path / "out")
    assert process.returncode == 2, process.stderr
    assert complaint in process.stderr and "panicked" not in process.stderr
    assert not (tmp_path / "out").exists()


def test_members_with_warnings_are_denied_on_request(mpm, tmp_path):
    words = ("sweep", BEAM, "--over", "n=5", *QUICK, "--set", "tolerance=0.1", "--out", tmp_path / "out")
    process = mpm(*words, "--deny-warnings")
    assert process.returncode == 2 and "error[D045]" in process.stderr, process.stderr
    assert outcomes(tmp_path / "out") == ["invalid"] and read_table(tmp_path / "out")[0]["reason"].startswith("D045: ")
    assert mpm(*words).returncode == 0
    process = mpm(*words, "--format", "json")
    assert process.returncode == 2 and "unexpected argument '--format'" in process.stderr


def test_words_and_expressions_as_values(mpm, tmp_path, analyse):
    axes = ["--over", "method=mpm,gimp", "--over", "update=corners,diagonal-corrected", "--over", "n=${2*2}"]
    process = mpm("sweep", "inputs/compaction.yaml", *axes, "--set", "every=0", "--out", tmp_path)
    assert process.returncode == 0, process.stderr
    rows = read_table(tmp_path)
    assert [(row["method"], row["update"]) for row in rows] == [
        ("mpm", "corners"), ("mpm", "diagonal-corrected"), ("gimp", "corners"), ("gimp", "diagonal-corrected"),
    ]  # fmt: skip
    assert {row["n"] for row in rows} == {"${2*2}"}
    assert process.stderr.count("note[D014]: the domain update `corners` is ignored") == 1
    for row in rows:
        alone = analyse("inputs/compaction.yaml", method=row["method"], update=row["update"], n=4, every=0)
        assert_row_is_of(row, alone)
    assert (tmp_path / "method=gimp,update=corners,n=%24%7B2%2A2%7D" / "summary.json").exists()


def test_directory_and_files_by_default(program, tmp_path):
    command = [program, "sweep", ROOT / BEAM, "--over", "n=5,6", "--set", "steps=25", "--threads", "1"]
    process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert process.returncode == 0, process.stderr
    directory = tmp_path / "results" / "beam-sweep"
    assert sorted(path.name for path in directory.iterdir()) == ["n=5", "n=6", "sweep.csv"]
    assert len(Results(directory / "n=6").series("points")) == 26
    assert Results(directory / "n=6").summary["threads"] == 1
    # Lines for members only: those of their steps would bury them.
    assert "step 1/" not in process.stderr and "member 2/2: n=6" in process.stderr


def test_ctrl_c_leaves_a_valid_table_and_the_study_goes_on(program, mpm, tmp_path):
    deck = "inputs/collapse.yaml"
    axes = ["--over", "n=5,6", "--over", "h=2,1", "--set", "steps=100"]
    out = tmp_path / "out"
    earlier = mpm("sweep", deck, "--over", "n=6", "--over", "h=2", "--set", "steps=100", "--out", out)
    assert earlier.returncode == 0, earlier.stderr
    process = subprocess.Popen([program, "sweep", ROOT / deck, *axes, "--out", out], stderr=subprocess.PIPE, text=True)
    while not (out / "n=5,h=1" / "points_0003.vtu").exists():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=120)
    assert process.returncode == 130, messages
    assert "1 interrupted" in messages and "1 not started" in messages
    # The member that was completed earlier is in the table although the study did not get there.
    rows = read_table(out)
    assert [(row["n"], row["h"], row["outcome"]) for row in rows] == [
        ("5", "2", "completed"), ("5", "1", "interrupted"), ("6", "2", "completed"),
    ]  # fmt: skip
    stopped = Results(out / "n=5,h=1")
    assert_row_is_of(rows[1], stopped)
    assert len(stopped.series("points")) == int(rows[1]["steps"]) + 1
    assert not list(out.rglob("*.tmp"))

    resumed = subprocess.run([program, "sweep", ROOT / deck, *axes, "--out", out], capture_output=True, text=True)
    assert resumed.returncode == 0, resumed.stderr
    assert runs(resumed) == [2, 4]
    assert outcomes(out) == ["completed"] * 4


def test_a_directory_that_cannot_be_written(mpm, tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert mpm("sweep", BEAM, "--over", "n=5", *QUICK, "--out", tmp_path / "file").returncode == 2
    out = tmp_path / "out"
    out.mkdir()
    (out / "n=5").write_text("in the way")
    process = mpm("sweep", BEAM, "--over", "n=5,6", *QUICK, "--out", out)
    assert process.returncode == 1, process.stderr
    assert outcomes(out) == ["failed", "completed"]
    assert "n=5" in read_table(out)[0]["reason"]
