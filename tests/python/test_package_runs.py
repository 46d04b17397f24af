"""Runs of the Python package under the control of Python: changes, callbacks, interruptions, studies and pickles."""

import copy
import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

from conftest import ROOT
from package import assert_same_points, column, load, mpm, worst


def after(run, steps):
    """Takes steps; the number of the last one."""
    for _ in range(steps):
        last = next(run)
    return last.index


SHORT = [("beam", {"steps": 8}), ("collapse", {"h": 1, "n": 3, "steps": 8})]


@pytest.mark.parametrize(("name", "parameters"), SHORT)
def test_a_change_to_the_same_deck_changes_nothing(tmp_path, name, parameters):
    deck = load(name, **parameters)
    expected = deck.run(out=tmp_path / "plain", threads=1)
    run = deck.start(out=tmp_path / "changed", threads=2)
    run.change()
    for _ in run:
        run.change()
    assert run.result().summary["outcome"] == "completed"
    assert run.history == expected.history
    assert_same_points(run.points, expected.points)
    with pytest.raises(mpm.UsageError, match="has ended"):
        run.change()
    for name_of in ("history.csv", "quality.csv"):
        assert (tmp_path / "changed" / name_of).read_bytes() == (tmp_path / "plain" / name_of).read_bytes()


def test_changes_of_stages_to_the_same_deck_change_nothing():
    deck = load("excavation", h=0.5)
    expected = deck.run()
    run = deck.start()
    for _ in run:
        run.change()
    assert run.history == expected.history
    assert_same_points(run.points, expected.points)


def test_a_load_halved_amid_the_run_is_that_of_a_curve():
    """Up to t = ½ the load follows its ramp; then it stands at half of it. All factors are exact: powers of two."""
    curve = [[0, 0], [0.5, 0.5], [0.5625, 0.25], [1, 0.25]]
    given = load("beam", steps=16)
    given["loads"][0]["curve"] = curve
    expected = given.run(threads=1)

    ramp = load("beam", steps=16)
    ramp["loads"][0]["curve"] = [[0, 0], [1, 1]]
    run = ramp.start(threads=1)
    assert after(run, 8) == 8
    half = [force / 2 for force in run.deck["loads"][0]["total"]]
    run.deck["loads"][0].update(total=half, curve=[[0, 0], [0.5, 1], [0.5625, 0.5], [1, 0.5]])
    run.change()
    for _ in run:
        pass
    for name in ("time", "tip_uy", "root_rx", "strain_energy"):
        np.testing.assert_array_equal(run.history[name], expected.history[name], err_msg=name)
    assert_same_points(run.points, expected.points)


def test_the_solver_may_change_at_every_step():
    """What has no effect on the answer may change in each step, also where nodes are moved."""
    deck = load("footing", steps=6, h=0.5)
    expected = deck.run()
    run = deck.start()
    for _ in run:
        run.deck["solver"] = {"max_iterations": 20 + run.step.index % 2}
        run.change()
    assert_same_points(run.points, expected.points)


def test_steps_that_reduce_the_strength_have_their_factor():
    with load("slope", h=2, n=2, to=1.2).start(threads=1) as run:
        factors = [(step.stage, step.strength_factor) for step in run]
        summary = run.result().summary
    assert factors[:5] == [("gravity", None)] * 5
    found = [factor for stage, factor in factors[5:] if stage == "safety"]
    assert found == pytest.approx(np.linspace(1, 1.2, 7)[1:]) and len(factors) == 5 + len(found)
    of_stage = summary["strength_reduction"]
    assert of_stage["stage"] == "safety" and of_stage["stands"] == pytest.approx(1.2) and of_stage["fails"] is None
    assert of_stage["slides"] is None and 0 < of_stage["moved"] < 0.09


def test_a_yield_stress_changed_between_steps_acts_from_the_next_step_on():
    deck = load("collapse", h=1, n=3, steps=8)
    softer = deck.copy()
    softer["materials"]["clay"]["deviatoric_yield_stress"] = 19e3
    results, histories = {}, {}
    for name, of in (("as it is", None), ("softer at once", 0), ("softer later", 6)):
        run = deck.start()
        if of == 0:
            run.deck.update(softer)
            run.change()
        for step in run:
            if step.index == of:
                before = run.points.position
                run.deck["materials"]["clay"]["deviatoric_yield_stress"] = 19e3
                run.change()
                np.testing.assert_array_equal(run.points.position, before)
        results[name], histories[name] = run.points, run.history["base_ry"]
    assert_same_points(results["softer at once"], softer.run().points)
    same = histories["as it is"][:6] == histories["softer later"][:6]
    assert same.all() and not (histories["as it is"][6:7] == histories["softer later"][6:7]).any()
    stress = np.array([[1, 1, 1, 2, 2, 2]]) * results["softer later"].kirchhoff_stress ** 2
    mean = results["softer later"].kirchhoff_stress[:, :3].mean(axis=1)
    radius = np.sqrt(stress.sum(axis=1) - 3 * mean**2)
    assert radius.max() == pytest.approx(19e3, rel=1e-9)


def test_a_changed_stiffness_keeps_the_stress():
    deck = column()
    deck["loads"][0]["curve"] = [[0, 0], [0.5, 1], [1, 1]]
    run = deck.start()
    after(run, 2)
    before, stored = dict(run.points), run.step.strain_energy
    run.deck["materials"]["clay"]["young"] = 2e6
    run.change()
    np.testing.assert_array_equal(run.points.cauchy_stress, before["cauchy_stress"])
    np.testing.assert_allclose(run.points.elastic_strain, before["elastic_strain"] / 2, rtol=1e-12, atol=1e-16)
    for _ in run:
        pass
    moved = np.abs(run.points.position - before["position"]).max()
    assert moved < 1e-2 * np.abs(before["displacement"]).max()
    assert run.result().summary["exchanged_energy"] == pytest.approx(-stored / 2, rel=1e-9)
    assert abs(run.quality["energy_error"][-1]) < 1e-2


@pytest.mark.parametrize(
    ("name", "parameters", "changes"),
    [
        ("triaxial", {}, {"swelling_index": 0.009, "shear_modulus": 6e6}),
        ("slope", {"h": 2, "n": 2}, {"young": 50e6, "poisson": 0.2}),
    ],
)
def test_a_soil_keeps_its_history_when_its_elasticity_changes(name, parameters, changes):
    def volumetric(points):
        return points["elastic_strain"][:, :3].sum(axis=1) + points["plastic_volumetric_strain"]

    run = load(name, **parameters).start()
    after(run, 4)
    before = dict(run.points)
    run.deck["materials"][next(iter(run.deck["materials"]))].update(changes)
    run.change()
    now = dict(run.points)
    assert worst(now, before, "elastic_strain") > 0.1
    np.testing.assert_allclose(volumetric(now), volumetric(before), rtol=0, atol=1e-14)
    adapted = {"elastic_strain", "plastic_volumetric_strain"}
    for array in before.keys() - adapted:
        np.testing.assert_array_equal(now[array], before[array], err_msg=array)
    assert np.isfinite(next(run).residual)


def pressed(**condition):
    """A block of 2 m by 2 m between frictionless walls, whose top moves down by 0.4 m in 8 steps."""
    box = {"type": "box", "min": [0, 0], "max": [2, 2]}
    return mpm.Deck(
        {
            "version": 1,
            "grid": {"type": "structured", "origin": [0, 0], "size": [2, 4], "spacing": 0.5},
            "materials": {"clay": {"model": "hencky", "young": 1e6, "poisson": 0.3}},
            "bodies": [{"name": "block", "material": "clay", "points_per_cell": 2, "shape": box}],
            "boundary_conditions": [
                {"name": "floor", "nodes": {"y": 0}, "fix": ["y"]},
                {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
                {"name": "right", "nodes": {"x": 2}, "fix": ["x"]},
                {"name": "push", **condition, "uy": -0.4},
            ],
            "steps": {"count": 8},
        }
    )


def pressed_by_lines():
    """The same block, whose top stays on a grid line."""
    deck = pressed(nodes={"y": 2})
    deck["grid"]["follow"] = [{"axis": "y", "from": 2, "condition": "push"}]
    return deck


def force_on_top(settlement):
    """The exact force on the block under a uniform compression by this settlement."""
    modulus, stretch = 1e6 * 0.7 / (1.3 * 0.4), 1 - np.asarray(settlement) / 2
    return 2 * modulus * np.log(stretch) / stretch


def slower(deck):
    """Half as fast from now on: without a curve, the factor grows up to the end time."""
    deck["steps"] = {"count": 16, "end_time": 2}


def faster(deck):
    deck["boundary_conditions"][3]["uy"] = -0.8


def back(deck):
    deck["boundary_conditions"][3]["curve"] = [[0, 0], [0.5, 0.5], [1, 0]]


#: Changes at time 0.5, when the top has moved by 0.2 m, and the settlement at the times that follow.
MOTIONS = {
    "faster": (faster, lambda time: 0.2 + 0.8 * (time - 0.5)),
    "slower": (slower, lambda time: 0.2 + 0.2 * (time - 0.5)),
    "back": (back, lambda time: 0.4 * (1 - time)),
}


def changed_at_half_time(run, change):
    """Takes all steps of a run, with a change of its deck after time 0.5."""
    for step in run:
        if step.time == 0.5:
            change(run.deck)
            run.change()
    return run.history


def assert_moved_without_jump(history, settlement):
    time = history["time"]
    exact = force_on_top(np.where(time <= 0.5, 0.4 * time, settlement(time)))
    np.testing.assert_allclose(history["push_ry"], exact, rtol=0, atol=1e-8 * np.abs(exact).max())


@pytest.mark.parametrize("what", MOTIONS)
def test_lines_of_the_grid_continue_from_where_they_stand(what):
    change, settlement = MOTIONS[what]
    assert_moved_without_jump(changed_at_half_time(pressed_by_lines().start(), change), settlement)


def pressed_by_a_surface():
    """The same block, whose top is a surface; it does not stay on a grid line."""
    deck = pressed(surface="top")
    deck["surfaces"] = [{"name": "top", "body": "block", "part": {"edge": 2}}]
    return deck


def test_a_surface_continues_from_where_it_is():
    for change, curve in [
        (faster, [[0, 0], [0.5, 0.5], [1, 1.5]]),
        (slower, [[0, 0], [0.5, 0.5], [2, 1.25]]),
        (back, [[0, 0], [0.5, 0.5], [1, 0]]),
    ]:
        given = pressed_by_a_surface()
        given["boundary_conditions"][3]["curve"] = curve
        if change is slower:
            slower(given)
        expected = given.run(progress=False).history
        history = changed_at_half_time(pressed_by_a_surface().start(), change)
        np.testing.assert_array_equal(history["time"], expected["time"])
        largest = np.abs(expected["push_ry"]).max()
        np.testing.assert_allclose(history["push_ry"], expected["push_ry"], rtol=0, atol=1e-6 * largest)


@pytest.mark.parametrize("components", [{"ux": 0.1}, {"ux": 0.1, "uy": -0.4}])
def test_a_surface_keeps_the_directions_of_its_condition(components):
    run = pressed_by_a_surface().start()
    next(run)
    push = run.deck["boundary_conditions"][3]
    del push["uy"]
    push.update(components)
    with pytest.raises(mpm.UsageError, match="the directions in which `push` prescribes"):
        run.change()
    assert len(list(run)) == 7


def test_a_run_whose_lines_have_an_offset_resumes(tmp_path):
    deck = pressed_by_lines()
    deck["checkpoint"] = {"every": 1}
    whole = deck.start(threads=1, out=tmp_path / "whole")
    changed_at_half_time(whole, faster)
    part = deck.start(threads=1, out=tmp_path / "part")
    for step in part:
        if step.index == 4:
            faster(part.deck)
            part.change()
        if step.index == 6:
            part.stop()
    part.deck.save(tmp_path / "deck.yaml")
    command = [sys.executable, "-m", "mpm", "run", tmp_path / "deck.yaml", "--resume", "--out", tmp_path / "part"]
    subprocess.run(command, check=True, capture_output=True)
    for name in ("history.csv", "quality.csv"):
        assert (tmp_path / "part" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def frames_after_a_change(directory, output, change):
    """The frames of six steps of the column, after whose second step the output changes."""
    deck = column(steps={"count": 6}, output=output)
    run = deck.start(out=directory, threads=1)
    after(run, 2)
    run.deck["output"].update(change)
    run.change()
    for _ in run:
        pass
    return run.result().frames


@pytest.mark.parametrize(
    ("every", "change", "written"),
    [(1, 0, [0, 1, 2]), (1, 2, [0, 1, 2, 4, 6]), (3, 1, [0, 3, 4, 5, 6]), (0, 3, [3, 6])],
)
def test_the_interval_of_the_files_may_change(tmp_path, every, change, written):
    frames = frames_after_a_change(tmp_path, {"every": every}, {"every": change})
    assert [frame.time for frame in frames] == pytest.approx(np.array(written) / 6)


def test_fields_and_precision_of_later_files_may_change(tmp_path):
    change = {"fields": ["displacement"], "precision": "single"}
    frames = frames_after_a_change(tmp_path, {"fields": ["displacement", "J"]}, change)
    assert [{"displacement", "J"} <= frame.fields.keys() for frame in frames] == [True] * 3 + [False] * 4
    assert all("displacement" in frame.fields for frame in frames)
    texts = [frame.path.read_bytes() for frame in frames]
    is_single = [b'type="Float32" Name="displacement"' in text for text in texts]
    assert is_single == [False] * 3 + [True] * 4, texts[-1][:1000]


def test_checkpoints_may_begin_during_a_run(tmp_path):
    run = column(steps={"count": 6}).start(out=tmp_path)
    found = []
    for step in run:
        found.append(len(list(tmp_path.glob("checkpoint*"))))
        if step.index == 2:
            run.deck["checkpoint"] = {"every": 1}
            run.change()
    assert found == [0, 0, 1, 2, 2, 2]


FORBIDDEN = {
    "grid": lambda deck: deck["grid"].update(spacing=0.5),
    "bodies": lambda deck: deck["bodies"][0].update(points_per_cell=3),
    "name of a load": lambda deck: deck["loads"][0].update(name="gravity"),
    "one condition less": lambda deck: deck["boundary_conditions"].pop(),
    "model": lambda deck: deck["materials"]["clay"].update(model="neo-hookean"),
    "density": lambda deck: deck["materials"]["clay"].update(density=2),
    "probes": lambda deck: deck.update(output={"probes": [{"name": "p", "body": "column", "nearest": [0, 0]}]}),
}


@pytest.mark.parametrize("what", FORBIDDEN)
def test_forbidden_changes_leave_the_run_as_it_was(what):
    expected = column().run()
    run = column().start()
    next(run)
    FORBIDDEN[what](run.deck)
    with pytest.raises(mpm.UsageError, match="cannot change during a run"):
        run.change()
    for _ in run:
        pass
    assert run.history == expected.history
    assert_same_points(run.points, expected.points)


def test_a_change_to_a_bad_deck_leaves_the_run_as_it_was():
    run = column().start()
    next(run)
    run.deck["materials"]["clay"]["young"] = -1
    with pytest.raises(mpm.DeckError, match="D009"):
        run.change()
    run.deck["materials"]["clay"]["young"] = {1}
    with pytest.raises(mpm.UsageError, match="/materials/clay/young holds a set"):
        run.change()
    assert len(list(run)) == 3 and run.history == column().run().history
    with pytest.raises(mpm.MpmError):
        run.change()


def test_every_evaluation_is_told():
    told = []
    run = load("collapse", h=1, n=3, steps=5).start(on_iteration=lambda *of: told.append(of))
    steps = list(run)
    expected = [(step.index, k, float(r)) for step in steps for k, r in enumerate(step.residuals)]
    assert told == expected
    assert run.history == load("collapse", h=1, n=3, steps=5).run().history


def test_an_exception_of_the_callback_interrupts_the_waiting_alone():
    expected = load("beam", steps=4).run()
    left = [3, 8, 9]

    def callback(step, iteration, residual):
        told.append(step)
        if len(told) in left:
            raise LookupError(f"call {len(told)}")

    told, steps = [], []
    run, interruptions = load("beam", steps=4).start(on_iteration=callback), 0
    while not run.ended:
        try:
            steps.extend([next(run)])
        except StopIteration:
            break
        except LookupError as error:
            interruptions += 1
            assert f"call {len(told)}" in str(error)
            if not run.ended:
                with pytest.raises(mpm.UsageError, match="under way"):
                    run.points.position  # noqa: B018
                with pytest.raises(mpm.UsageError, match="under way"):
                    run.change()
    assert interruptions == len(left) and [step.index for step in steps] == [1, 2, 3, 4]
    assert run.history == expected.history


def test_a_run_that_is_stopped_amid_a_step_ends_after_it():
    def callback(step, iteration, residual):
        if (step, iteration) == (2, 1):
            raise LookupError

    run = load("beam", steps=4).start(on_iteration=callback)
    with pytest.raises(LookupError):
        list(run)
    run.stop()
    assert run.ended and run.result().summary["steps"] == 2 and run.step.index == 2
    assert run.result().summary["outcome"] == "interrupted"
    run.stop()
    run.close()
    with run:
        pass


def test_the_callback_cannot_touch_the_run_amid_a_step():
    errors = []

    def callback(step, iteration, residual):
        for call in (lambda: run.points.position, lambda: next(run), run.stop, run.change, lambda: run.history):
            try:
                call()
            except mpm.UsageError as error:
                errors.append(str(error))

    run = column().start(on_iteration=callback)
    assert len(list(run)) == 4
    assert len(errors) % 5 == 0 and len(errors) >= 20 and all("solving a step" in text for text in errors)


INTERRUPTED = """
    import mpm
    deck = mpm.Deck.load({deck!r}, h=0.125, steps=500)
    run, steps, interruptions = deck.start(threads=1), [], 0
    while interruptions == 0:
        try:
            for step in run:
                steps.append(step.index)
                print("ready", flush=True)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
            interruptions += 1
    # The interrupt may have come between a step and the body of the loop, so that the list lacks it.
    first, second = next(run).index, next(run).index
    run.stop()
    again = deck.start(threads=2)
    [next(again) for _ in range(second)]
    again.stop()
    print(second == first + 1 >= len(steps) + 2, run.history == again.history, flush=True)
"""

INTERRUPTED_WITH_FILES = """
    import mpm
    try:
        mpm.Deck.load({deck!r}, h=0.125, steps=500).run(out={out!r}, threads=1)
    except KeyboardInterrupt:
        result = mpm.read({out!r})
        print("interrupted", result.summary["outcome"], result.summary["steps"] == len(result.history["step"]))
"""


def interpreter(source, tmp_path):
    text = textwrap.dedent(source).format(deck=str(ROOT / "inputs/footing.yaml"), out=str(tmp_path / "out"))
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_ctrl_c_leaves_a_run_that_can_go_on(tmp_path):
    with interpreter(INTERRUPTED, tmp_path) as process:
        assert process.stdout.readline() == "ready\n", process.stderr.read()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert [line for line in rest.splitlines() if line != "ready"] == ["interrupted", "True True"]


def test_ctrl_c_leaves_results_that_can_be_read(tmp_path):
    table = tmp_path / "out" / "history.csv"
    with interpreter(INTERRUPTED_WITH_FILES, tmp_path) as process:
        while process.poll() is None and not (table.exists() and table.read_bytes().count(b"\n") > 1):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=120)
    assert (process.returncode, rest) == (0, "interrupted interrupted True\n"), errors


LEAVING = [
    "del run",
    "pass",
    "run.close()",
    "table = run.deck; del run",
    "keep = [run]; keep.append(keep)",
    "threading.Thread(target=go_on, daemon=True).start(); time.sleep(0.03)",
    "child = os.fork(); assert child == 0 or os.waitpid(child, 0)[1] == 0",
]


@pytest.mark.parametrize("leave", LEAVING)
def test_an_interpreter_may_end_amid_a_step(leave):
    """No law is called by an interpreter that has ended, however the run was left."""
    source = """
        import os, sys, threading, time
        import mpm
        sys.path.insert(0, {tests!r})
        from laws_in_python import Hencky
        class Slow(Hencky):
            def update(self, strain, history):
                time.sleep(0.02)
                return super().update(strain, history)
        def callback(step, iteration, residual):
            if step == 2:
                raise LookupError
        deck = mpm.Deck.load({deck!r}, steps=20)
        run = deck.start(on_iteration=callback, laws={{"steel": Slow(young=12e6, poisson=0.2)}})
        try:
            list(run)
        except LookupError:
            print("left", flush=True)
        def go_on():
            while True:
                try:
                    next(run)
                except LookupError:
                    pass
                except (mpm.MpmError, StopIteration):
                    return
        {leave}
    """
    text = textwrap.dedent(source).format(
        tests=str(ROOT / "tests/python"), deck=str(ROOT / "inputs/beam.yaml"), leave=leave
    )
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60)
        assert (done.returncode, done.stdout, done.stderr) == (0, "left\n", "")


def test_sweeps_take_every_combination(tmp_path):
    study = mpm.sweep(load("beam", steps=3), {"n": np.array([2, 3]), "h": [0.5, 0.25]}, processes=2, out=tmp_path)
    assert [member.parameters for member in study] == [{"n": n, "h": h} for n in (2, 3) for h in (0.5, 0.25)]
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["n=2,h=0.25", "n=2,h=0.5", "n=3,h=0.25", "n=3,h=0.5"]
    for member in study:
        alone = load("beam", steps=3, **member.parameters).run()
        assert member.error is None and member.result.history == alone.history
        np.testing.assert_array_equal(member.result.points.cauchy_stress, alone.points.cauchy_stress)
    again = pickle.loads(pickle.dumps(study))
    assert [of.result.history for of in again] == [of.result.history for of in study]
    assert isinstance(study[1:], mpm.Study) and len(study[1:]) == 3 and study[-1].parameters["h"] == 0.25
    assert study.column("tip_uy")[0] == study[0].result.history["tip_uy"][-1]


@pytest.mark.parametrize("processes", [1, 2])
def test_members_that_fail_do_not_end_the_study(tmp_path, processes):
    (tmp_path / "h=0.25").write_text("in the way")
    study = mpm.sweep(load("beam", steps=2), {"h": [0.5, 0.3, 0.25, -1]}, processes=processes, out=tmp_path)
    assert (tmp_path / "h=0.5" / "summary.json").exists()
    assert [member.result is None for member in study] == [False, True, True, True]
    assert "D0" in study[1].error and "results directory" in study[2].error and "D009" in study[3].error
    assert study.column("tip_uy")[1:] == [None] * 3 and "3 failed" in repr(study)
    if pytest.importorskip("pandas"):
        frame = study.to_dataframe()
        assert list(frame["h"]) == [0.5, 0.3, 0.25, -1] and frame["error"].notna().sum() == 3


def slope():
    """The deck of a slope on a coarse grid, whose strength is reduced until it fails."""
    return load("slope", h=2, n=2, after_slide="continue")


def test_the_results_of_a_study_are_those_of_the_last_step_in_equilibrium():
    study = mpm.sweep(slope().with_parameters(to=2), {"c": [10e3, 12e3]}, processes=1)
    pytest.importorskip("pandas")
    frame = study.to_dataframe()
    for name in ("strength_factor", "crest_uy"):
        assert study.column(name) == list(frame[name])
    for member, factor in zip(study, study.column("strength_factor")):
        assert member.result.history["converged"][-1] == 0, "the slope fails at last"
        assert factor == member.result.summary["strength_reduction"]["stands"]
    with pytest.raises(KeyError, match="no column 'nowhere'"):
        study.column("nowhere")


def test_parameters_and_results_have_columns_of_their_own():
    pytest.importorskip("pandas")
    deck = column(parameters={"step": 1, "g": 10, "error": 0, "parameter_step": 0})
    study = mpm.sweep(deck, {"step": [2, 3], "g": [9], "error": [5], "parameter_step": [7]}, processes=1)
    frame = study.to_dataframe()
    assert list(frame["parameter_parameter_step"]) == [2, 3] and list(frame["step"]) == [4, 4]
    assert list(frame["parameter_step"]) == [7, 7] and list(frame["g"]) == [9, 9]
    assert list(frame["parameter_error"]) == [5, 5] and frame["error"].isna().all()


def test_wrong_arguments_of_a_study_are_refused_before_it_begins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    deck = load("beam", steps=1)
    for values, more, text in [
        ([0.5], {"threads": 0}, "threads"),
        ([0.5], {"threads": 1025}, "threads"),
        ([0.5], {"threads": "two"}, "threads"),
        ([0.5], {"threads": True}, "threads"),
        ([0.5], {"out": ""}, "directory"),
        ([0.5, 0.5], {}, "appears twice"),
        ([0.5, 0.25, "5e-1"], {"out": "study"}, "appears twice"),
        (np.array([1, 1.0]), {}, "appears twice"),
    ]:
        with pytest.raises(mpm.UsageError, match=text):
            mpm.sweep(deck, {"h": values}, processes=1, **more)
    assert not list(tmp_path.iterdir())


class Deadly(mpm.Deck):
    """A deck that kills the process of one member of a study, once another member has its results."""

    def run(self, out=None, **more):
        if self["parameters"]["h"] != 0.5:
            for _ in range(1200):
                if (out.parent / "h=0.5" / "summary.json").exists():
                    break
                time.sleep(0.05)
            time.sleep(1)
            os.kill(os.getpid(), signal.SIGKILL)
        return super().run(out, **more)


@pytest.mark.skipif(os.name == "nt", reason="there is no such signal")
def test_the_death_of_a_process_keeps_the_results_of_a_study(tmp_path):
    deck = Deadly.load(ROOT / "inputs/beam.yaml", steps=2)
    study = mpm.sweep(deck, {"h": [0.5, 0.25]}, processes=2, out=tmp_path)
    assert study[0].error is None and study[0].result.summary["outcome"] == "completed"
    assert study[1].result is None and "a process of the study ended" in study[1].error


def test_a_closed_run_says_so():
    run = column().start(threads=1)
    next(run)
    run.close()
    assert run.ended
    with pytest.raises(mpm.UsageError, match="closed"):
        run.result()
    run = column().start(threads=1)
    list(run)
    run.close()
    assert run.ended and list(run) == []
    with pytest.raises(mpm.UsageError, match="closed"):
        run.result()


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="reads the memory of a process from /proc")
@pytest.mark.parametrize("ends", [False, True])
def test_a_closed_run_releases_its_memory(ends):
    """Whether the run has ended before or not."""
    source = """
        import gc, os, sys, mpm

        def resident():
            gc.collect()
            return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGESIZE") / 2**20

        deck = mpm.Deck.load("inputs/block/block.yaml", h=0.25, steps=2, every=0)
        before = resident()
        run = deck.start(threads=1)
        next(run)
        if ENDS:
            list(run)
        held = resident() - before
        run.close()
        print(held, resident() - before)
    """
    source = textwrap.dedent(source).replace("ENDS", str(ends))
    environment = dict(os.environ, MALLOC_TRIM_THRESHOLD_="0", MALLOC_MMAP_THRESHOLD_="65536")
    process = subprocess.run(
        [sys.executable, "-c", source], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    held, kept = map(float, process.stdout.split())
    assert held > 20 and kept < 0.5 * held


def leaving():
    """A deck of a block so weak that it flows beyond the grid."""
    deck = load("collapse", h=1, n=3, steps=8)
    deck["materials"]["clay"]["deviatoric_yield_stress"] = 15e3
    return deck


def test_decks_results_and_errors_survive_pickling(tmp_path):
    deck = load("annulus", steps=2).with_parameters(n=1)
    result = deck.run(out=tmp_path / "out")
    for again in (pickle.loads(pickle.dumps(deck)), copy.deepcopy(deck), copy.copy(deck)):
        assert again == deck and again.text == deck.text and again.run().history == result.history
    restored = pickle.loads(pickle.dumps(result))
    assert restored.history == result.history and restored.summary == result.summary
    np.testing.assert_array_equal(restored.points.cauchy_stress, result.points.cauchy_stress)
    assert pickle.loads(pickle.dumps(deck.run())).points is None
    assert_same_points(pickle.loads(pickle.dumps(result.points)), result.points)
    step = pickle.loads(pickle.dumps(next(deck.start())))
    assert step.index == 1 and step.iterations > 0
    law = pickle.loads(pickle.dumps(mpm.BuiltInLaw("hencky", young=1e6, poisson=0.3)))
    assert repr(law) == "BuiltInLaw('hencky', young=1000000.0, poisson=0.3)"
    for make in (
        lambda: mpm.Deck({}).run(),
        lambda: mpm.read(tmp_path),
        lambda: deck.start(threads=0),
        leaving().run,
    ):
        with pytest.raises(mpm.MpmError) as raised:
            make()
        again = pickle.loads(pickle.dumps(raised.value))
        assert (type(again), str(again), again.code, again.help) == (
            type(raised.value), str(raised.value), raised.value.code, raised.value.help,
        )


def test_an_analysis_that_fails_says_why(tmp_path):
    deck = leaving()
    with pytest.raises(mpm.SolveError) as raised:
        deck.run(out=tmp_path / "out")
    assert raised.value.code and raised.value.help
    result = mpm.read(tmp_path / "out")
    assert result.summary["outcome"] == "failed" and result.summary["code"] == raised.value.code
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == result.summary
    assert os.environ.get("MPM") is None or result.summary["version"] == mpm.__version__
