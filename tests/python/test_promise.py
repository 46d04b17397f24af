"""A written step is an equilibrated step, and a result that is not to be trusted says so: decks that once broke this promise."""

import csv
import json

import pytest

DECKS = "tests/promise"


@pytest.fixture
def run(mpm, tmp_path):
    """Runs a deck with parameters; its process and its summary."""

    def run(deck, **parameters):
        settings = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        out = tmp_path / f"{deck}{len(list(tmp_path.iterdir()))}"
        process = mpm("run", f"{DECKS}/{deck}.yaml", "--out", out, "--threads", 1, *settings)
        assert process.returncode in (0, 1), process.stderr
        summary = json.loads((out / "summary.json").read_text())
        summary["rows"] = list(csv.DictReader((out / "history.csv").open()))
        assert (process.returncode == 0) == (summary["outcome"] == "completed")
        return process, summary

    return run


def codes(summary):
    return {warning["code"] for warning in summary["warnings"]}


def last(summary, column):
    return float(summary["rows"][-1][column])


def is_badly_scaled(process, summary, *materials):
    assert process.returncode == 1
    assert summary["code"] in ("S014", "S001", "S006")
    assert summary["diagnosis"]["kind"] == "bad-scaling"
    if summary["code"] == "S014":
        assert all(f"`{name}`" in process.stderr for name in materials)
    return True


def test_a_very_stiff_plate_is_refused_with_the_materials(run):
    assert is_badly_scaled(*run("stiff_plate"), "plate", "clay")


def test_a_stiff_punch_is_right_or_refused(run):
    settlement = lambda E: last(run("punch", E=E)[1], "crest_uy")
    # The settlement is linear in the compliance of a punch that is nearly rigid.
    soft, stiff = settlement(1e9), settlement(1e10)
    rigid = stiff + (stiff - soft) / 9
    limited = []
    for exponent in range(11, 23):
        process, summary = run("punch", E=f"1e{exponent}")
        if process.returncode == 0:
            expected = rigid + (stiff - rigid) * 10.0 ** (10 - exponent)
            assert last(summary, "crest_uy") == pytest.approx(expected, rel=1e-6), exponent
            limited.append(summary["rounding_limited"])
            assert summary["forces"]["relative_difference"] < 1e-6
            assert all(float(row["residual"]) <= 1e-6 for row in summary["rows"])
        else:
            assert is_badly_scaled(process, summary, "rigid", "soil"), exponent
    # Round-off is told before it is refused.
    assert 0 < len(limited) < 12 and limited[-1] > 0


@pytest.mark.parametrize("exponent", range(0, 23, 2))
def test_steel_is_right_or_refused(run, exponent):
    """Beside the same strain in units in which nothing is large, or the displacement that two strains of 10⁻⁶ foretell."""
    of = lambda E, F: last(run("steel", E=E, F=F)[1], "crest_ux")
    process, summary = run("steel", E=f"1e{exponent}", F="-1e-3")
    strain = 1e-3 / 10.0**exponent
    if process.returncode == 0:
        if strain > 1e-5:
            expected = of(1.0, repr(-strain))
        else:
            once, twice = of(1e3, "-1e-3") / 1e-6, of(1e3, "-2e-3") / 2e-6
            expected = strain * (once + (twice - once) * (strain - 1e-6) / 1e-6)
        assert last(summary, "crest_ux") == pytest.approx(expected, rel=1e-6)
        assert summary["forces"]["relative_difference"] < 1e-6
    else:
        assert strain < 1e-9 and is_badly_scaled(process, summary, "steel")


@pytest.mark.parametrize("force", ["-1", "-1e-4"])
def test_a_light_load_on_steel_is_refused(run, force):
    assert is_badly_scaled(*run("steel", F=force), "steel")


def test_a_loaded_body_elsewhere_changes_nothing(run):
    alone, beside = (last(run("two_bodies", Ej=5, on=on)[1], "crest_uy") for on in (0, 1))
    assert beside == pytest.approx(alone, rel=1e-12)


def test_hourglass_modes_are_stabilised_or_named(run):
    process, summary = run("one_point_cantilever")
    assert process.returncode == 0
    # Euler's beam in plane strain under 0.001 at the end.
    assert summary["largest"]["displacement"]["value"] == pytest.approx(1.60e-6, rel=0.02)
    process, summary = run("one_point_cantilever", stabilisation="off")
    assert process.returncode == 1
    assert summary["diagnosis"]["kind"] == "hourglass"


@pytest.mark.parametrize("deck", ["margin", "floor_inside", "turned_gravity", "footing_margin", "heavy_cantilever"])
def test_supports_anywhere_in_the_grid_run_with_the_defaults(run, deck):
    process, _ = run(deck)
    assert process.returncode == 0, process.stderr


@pytest.mark.parametrize(
    ("deck", "parameters", "code"),
    [
        ("neck_gap", {}, "W005"),
        ("hang_mpm", {}, "W008"),
        ("gap", {}, "W007"),
        ("docplate", {}, "W006"),
        ("footing_small", {"push": 0.5, "E": 2e6, "n": 50, "method": "gimp"}, "W006"),
        ("footing_small", {"h": 0.125}, "W012"),
        ("turned_prestrain", {}, "W011"),
    ],
)
def test_answers_that_are_not_to_be_trusted_say_so(run, deck, parameters, code):
    process, summary = run(deck, **parameters)
    assert code in codes(summary), (codes(summary), process.stderr)
    warning = next(warning for warning in summary["warnings"] if warning["code"] == code)
    assert warning["help"] and warning["step"] > 0 and f"warning[{code}]" in process.stderr


def test_what_ends_a_slope_is_named(run):
    process, summary = run("slope_two_loads", q=600e3)
    # The surcharge is beyond (2 + π) c, which a strip of this clay carries.
    assert process.returncode == 1 and summary["diagnosis"]["kind"] == "plastic-collapse"
