"""The decks of soils, a slope, a footing and a triaxial test, against published values, closed forms and `mpm element`."""

import csv
import json
import math
import re

import numpy as np
import pytest

from conftest import ROOT
from results import Results

PAGE = ROOT / "docs/how-to"


@pytest.fixture(scope="module")
def slope(analyse):
    return analyse("inputs/slope.yaml")


def test_the_factor_of_the_slope_is_the_published_one(slope):
    bracket = slope.summary["strength_reduction"]
    # 1.40 by finite elements of eight nodes, 1.38 by charts (Griffiths and Lane 1999, example 1).
    assert 1.35 < bracket["stands"] < bracket["fails"] < 1.41
    assert bracket["fails"] - bracket["stands"] <= 0.005
    factors = slope.history["strength_factor"]
    stage = slope.history["stage"]
    assert (factors[stage == 1] == 1).all() and (np.diff(factors[stage == 2]) > 0).all()
    assert factors[-1] == bracket["stands"]


def test_the_crest_runs_away_at_the_factor_of_safety(slope):
    reduced = slope.history["stage"] == 2
    factors, sinks = slope.history["strength_factor"][reduced], -slope.history["crest_uy"][reduced]
    assert sinks[factors <= 1.3].max() < 0.002, "displacements count from the end of `gravity`"
    assert sinks[-1] > 10 * sinks[factors <= 1.35].max()


def test_numbers_of_the_page_of_the_slope(slope, analyse):
    row = r"^\| ([\d.]+) \| ([\d. and]+|–) \| ([\d.]+)(?:, the largest tried)? \| ([\d.]+) mm \| ([\d.]+) mm \|$"
    rows = re.findall(row, (PAGE / "slope.md").read_text(), re.M)
    assert [row[0] for row in rows] == ["1", "0.5", "0.25"]
    for results, (_, slides, stands, before, last) in zip((analyse("inputs/slope.yaml", h=1, after_slide="continue"), slope), rows):
        history, bracket = results.history, results.summary["strength_reduction"]
        assert f"{bracket['stands']:.3f}" == stands
        assert slides == ("{:.3f} and {:.3f}".format(*bracket["slides"]) if bracket["slides"] else "–")
        row = int(np.abs(history["strength_factor"] - 1.3).argmin())
        assert f"{-1e3 * history['crest_uy'][row]:.1f}" == before
        assert f"{-1e3 * history['crest_uy'][-1]:.0f}" == last


def test_the_screen_the_log_and_the_report_state_the_factor(mpm, tmp_path):
    out, log = tmp_path / "out", tmp_path / "log.txt"
    process = mpm("run", ROOT / "inputs/slope.yaml", "--out", out, "--log", log, "--set", "h=1")
    assert process.returncode == 0, process.stderr
    bracket = json.loads((out / "summary.json").read_text())["strength_reduction"]
    closing = " ".join(process.stdout.split())
    # On cells as coarse as these, the slope slides and stands again.
    before, after = bracket["slides"]
    assert 1.38 < before < after < 1.43
    words = f"between {before:.3f} (in equilibrium) and {after:.3f} (displacements exceed 1 % of the height)"
    assert "warning[W018]" in process.stderr and "use the smaller of these factors" in process.stderr
    assert f"factor of safety {words}" in closing
    assert "flow of `soil` is non-associated" in closing and "depends on the cell size" in closing
    assert "strength factor 1.1000" in process.stderr
    assert "note[D064]" in process.stderr and "note[D064]" in log.read_text()
    status = json.loads((out / "status.json").read_text())
    assert status["strength_factor"] > 1.4
    report = mpm("report", out)
    assert report.returncode == 0, report.stderr
    page = (out / "report.html").read_text()
    for part in ("Note D064.", "<h2", words, "against the factor by which the strength is divided", ">slides<", "W018"):
        assert part in page, part
    assert page.count("The mechanism. Deformed") == 2, "displacement and equivalent plastic strain"


@pytest.mark.parametrize(
    "start, end, words", [(1, 1.1, "at least 1.100, the largest that was tried"), (2, 3, "between 1.4")], ids=["low", "high"]
)
def test_the_words_for_a_search_that_begins_or_ends_at_the_wrong_factor(mpm, tmp_path, start, end, words):
    text = (ROOT / "inputs/slope.yaml").read_text()
    assert "from: 1," in text
    (tmp_path / "slope.yaml").write_text(text.replace("from: 1,", f"from: {start},"))
    process = mpm("run", tmp_path / "slope.yaml", "--out", tmp_path / "out", "--set", "h=1", "--set", f"to={end}")
    assert process.returncode == 0, process.stderr
    assert f"factor of safety {words}" in " ".join(process.stdout.split()), process.stdout
    report = mpm("report", tmp_path / "out")
    assert report.returncode == 0, report.stderr
    assert words.split(",")[0][:9] in (tmp_path / "out" / "report.html").read_text()


def test_a_study_over_other_halved_parameters_compares_no_factors(mpm, tmp_path):
    over = ["--over", "young=1e8,5e7", "--set", "h=2"]
    text = (ROOT / "inputs/slope.yaml").read_text().replace("young: 1e8", 'young: "${young}"')
    assert "${young}" in text
    (tmp_path / "slope.yaml").write_text(text.replace("parameters:", "parameters:\n  young: 1e8", 1))
    process = mpm("sweep", tmp_path / "slope.yaml", *over, "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    assert "2 completed" in process.stderr and "factor of safety changes" not in process.stderr


def test_a_study_compares_the_factors_of_two_grids(mpm, tmp_path):
    over = ["--over", "h=2,1", "--over", "c=10e3,12e3"]
    process = mpm("sweep", ROOT / "inputs/slope.yaml", *over, "--out", tmp_path / "out", "--set", "to=2.5")
    assert process.returncode == 0, process.stderr
    rows = list(csv.DictReader(open(tmp_path / "out/sweep.csv")))
    assert all(row["strength_factor_slides"] for row in rows)
    last = {(row["h"], row["c"]): row["strength_factor_slides"] for row in rows}
    stands = {key: float(factor) for key, factor in last.items()}
    assert all(float(row["strength_factor_stands"]) >= stands[row["h"], row["c"]] for row in rows)
    for c in ("10e3", "12e3"):
        coarse, fine = stands["2", c], stands["1", c]
        percent = 100 * (fine / coarse - 1)
        # The brackets have the width of the tolerance, rounded to halves of a step.
        low, high = 100 * (fine / (coarse + 0.005) - 1), 100 * ((fine + 0.005) / coarse - 1)
        sentence = re.search(
            rf"from h=2, c={c} to h=1 the factor of safety changes by {re.escape(f'{percent:+.1f}')} %, .* and by (\S+) to "
            r"(\S+) % within the brackets", process.stderr)
        assert sentence and low <= float(sentence[1]) + 0.05 < float(sentence[2]) <= high + 0.05, process.stderr
    assert process.stderr.count("the factor of safety changes") == 2


def test_a_comparison_states_the_factors_of_safety(mpm, analyse, slope, tmp_path):
    coarse, page = analyse("inputs/slope.yaml", h=1), tmp_path / "page.html"
    process = mpm("report", slope.directory, coarse.directory, "--out", page)
    assert process.returncode == 0, process.stderr
    text = page.read_text()
    assert "Factor of safety, stage <code>safety</code>" in text
    before, after = coarse.summary["strength_reduction"]["slides"]
    bracket = slope.summary["strength_reduction"]
    for low, high in ((before, after), (bracket["stands"], bracket["fails"])):
        assert f"{float(f'{low:.5g}'):g} to\xa0{float(f'{high:.5g}'):g}" in text, (low, high)


def test_the_footing_carries_what_limit_analysis_says(analyse):
    friction = math.tan(math.radians(20))
    ratio = math.tan(math.radians(45 + 10)) ** 2
    exact = 10e3 * (ratio * math.exp(math.pi * friction) - 1) / friction
    force = {}
    for h in (0.5, 0.25):
        history = analyse("inputs/bearing.yaml", h=h).history
        force[h] = -history["footing_ry"][-1]
        # It levels off: the last steps add less than a hundredth of what the first adds.
        assert np.diff(-history["footing_ry"])[-1] < 0.015 * -history["footing_ry"][0]
    text = (PAGE / "bearing.md").read_text()
    for h, shown, excess in re.findall(r"^\| ([\d.]+) \| ([\d.]+) kN \| \+(\d+) % \|$", text, re.M):
        if float(h) in force:
            assert f"{force[float(h)] / 1e3:.1f}" == shown
            assert f"{100 * (force[float(h)] / exact - 1):.0f}" == excess
    assert 1 < force[0.25] / exact < 1.2
    # The excess is proportional to the size of the cells.
    assert 2 * force[0.25] - force[0.5] == pytest.approx(exact, rel=0.04)


# Both take the same steps of strain, so that they differ by the remainder of the iterations only.
@pytest.mark.parametrize("ocr, steps", [(1.5, 40), (8, 160)])
def test_the_triaxial_sample_follows_the_curve_of_one_point(analyse, mpm, tmp_path, ocr, steps):
    table = tmp_path / "element.csv"
    path = ["--path", "triaxial-drained", "--confining", "100e3", "--to", "0.2", "--steps", steps]
    deck = ROOT / "inputs/triaxial.yaml"
    process = mpm("element", deck, "--material", "clay", *path, "--set", f"ocr={ocr}", "--output", table)
    assert process.returncode == 0, process.stderr
    element = {name: np.array(values, float) for name, *values in zip(*csv.reader(open(table)))}
    results = analyse("inputs/triaxial.yaml", ocr=ocr, steps=steps)
    strain = 0.2 * results.history["time"]
    assert np.abs(strain - element["axial_strain"][-len(strain):]).max() < 1e-12
    q, volume = (element[name][-len(strain):] for name in ("deviatoric_stress", "volumetric_strain"))
    area = math.pi * 0.019**2 * np.exp(volume + strain)
    sample = -results.history["plate_ry"] / area - 100e3
    assert np.abs(sample - q)[strain > 0].max() < 1e-8 * q.max()
    # It is homogeneous: the volume of each point is that of the element, too.
    points = results.mesh("points", -1)
    assert np.abs(points["J"] / math.exp(volume[-1]) - 1).max() < 1e-8
    if ocr == 1.5:
        text = (PAGE / "triaxial.md").read_text()
        rows = re.findall(r"^\| (0\.\d+) \| ([\d.]+) kPa \| ([\d.]+) kPa \|$", text, re.M)
        assert len(rows) == 3
        for shown, of_point, of_sample in rows:
            step = int(np.abs(strain - float(shown)).argmin())
            assert q[step] / 1e3 == pytest.approx(float(of_point), abs=6e-5)
            assert sample[step] / 1e3 == pytest.approx(float(of_sample), abs=6e-5)
