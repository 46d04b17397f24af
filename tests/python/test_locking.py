"""Limit loads of bodies that flow at constant volume, beside exact values: the cases of `benches/locking.py`, coarse."""

import itertools
import re
import sys

import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))
import locking  # noqa: E402

SIXTEENTH = 0.125  # of the width of the footing, which is 2


@pytest.fixture(scope="module")
def found(program, tmp_path_factory):
    """Runs a case with some of its settings once."""
    runs = {}

    def run(name, h, method="mpm", volumetric="mean-dilatation", n=2, **settings):
        key = (name, h, method, volumetric, n, *settings.items())
        if key not in runs:
            settings = {"method": method, "volumetric": volumetric, "n": n} | settings
            runs[key] = locking.run(program, name, tmp_path_factory.mktemp(name), h, **settings)
            assert runs[key].summary["outcome"] == "completed"
        return runs[key]

    return run


def error(name, load):
    return load / locking.CASES[name].exact - 1


@pytest.mark.parametrize("name, method, volumetric, n", [
    ("strip-rough", "mpm", "mean-dilatation", 2),
    ("strip-rough", "mpm", "mean-dilatation", 3),
    ("strip-rough", "gimp", "mean-dilatation", 2),
    ("strip-rough", "mpm", "f-bar", 2),
    ("strip-smooth", "mpm", "mean-dilatation", 2),
])
def test_a_pressure_on_a_strip_has_its_limit_load(found, name, method, volumetric, n):
    run = found(name, SIXTEENTH, method, volumetric, n)
    assert 0 < error(name, run.load) < 0.02
    assert abs(run.rise) < 1e-3


@pytest.mark.parametrize("method, n", [("mpm", 2), ("mpm", 3), ("gimp", 2)])
def test_a_footing_of_nodes_has_its_limit_load_over_its_effective_width(found, method, n):
    run = found("nodes-rough", SIXTEENTH, method, n=n, to=0.0002, steps=4)
    assert abs(error("nodes-rough", run.effective)) < 0.02
    assert error("nodes-rough", run.load) > 0


@pytest.mark.parametrize("name", ["strip-rough", "nodes-rough"])
def test_the_load_does_not_grow_with_the_number_of_points(found, name):
    settings = {"to": 0.0002, "steps": 4} if name == "nodes-rough" else {}
    few, more = (found(name, SIXTEENTH, n=n, **settings).load for n in (2, 3))
    assert abs(more / few - 1) < 0.005


@pytest.mark.parametrize("name", ["strip-rough", "strip-smooth", "nodes-rough"])
@pytest.mark.parametrize("method", ["mpm", "gimp"])
def test_the_standard_treatment_locks(found, name, method):
    run = found(name, SIXTEENTH, method, "standard")
    assert error(name, run.effective) > 0.2
    assert run.rise > 0.02, "the load has no limit"


def test_the_error_of_the_limit_load_falls_with_order_one(found):
    spacings = [0.5, 0.25, SIXTEENTH]
    errors = [error("strip-smooth", found("strip-smooth", h).load) for h in spacings]
    for coarse, fine in itertools.pairwise(errors):
        assert 1.8 < coarse / fine < 2.2


def test_a_notched_plate_has_its_limit_load(found):
    loads = [found("notch", h) for h in (0.125, 0.0625)]
    errors = [error("notch", run.load) for run in loads]
    assert 0 < errors[0] < 0.075 and 1.8 < errors[0] / errors[1] < 2.2
    # The ligament acts wider than it is, but not by a whole half cell.
    assert all(error("notch", run.effective) < 0 for run in loads)
    locked = found("notch", 0.125, volumetric="standard")
    assert error("notch", locked.load) > 0.3 and locked.rise > 0.02


def test_the_weight_of_a_cut_has_a_limit_and_converges_to_the_exact_one(found):
    few, more = (found("cut", SIXTEENTH, n=n).load for n in (2, 3))
    coarse = found("cut", 2 * SIXTEENTH).load
    assert 3.778 < few < coarse and abs(more / few - 1) < 0.005
    # With order one the error of the extrapolated weight is of the second order.
    assert abs(error("cut", 2 * few - coarse)) < 0.015


def test_a_circular_footing_lies_between_the_exact_bounds(found):
    """The von Mises surface lies between two hexagons of Tresca, for which the exact load is 6.048 times their strength."""
    loads = [found("circle", h).effective for h in (0.25, SIXTEENTH)]
    extrapolated = 2 * loads[1] - loads[0]
    assert 6.048 * 3**0.5 / 2 < extrapolated < 6.048
    assert abs(error("circle", extrapolated)) < 0.01


def test_the_script_prints_a_table(program, capsys, monkeypatch, tmp_path):
    file = tmp_path / "rows.csv"
    arguments = ["locking.py", "cut", "--mpm", str(program), "--quick", "--finest", "0.25", "--csv", str(file)]
    monkeypatch.setattr(sys, "argv", arguments)
    locking.main()
    table = capsys.readouterr().out
    assert len(re.findall(r"^\| mpm \| (?:standard|mean-dilatation) \| 2 \| 0.25 \|", table, re.M)) == 2
    assert len(file.read_text().splitlines()) == 3
