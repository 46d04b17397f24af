"""Reports: that they are valid pages in themselves, say what the files say, and are honest about runs that failed."""

import base64
import io
import json
import re
import shutil
import subprocess
import time
from html.parser import HTMLParser

import html5lib
import numpy as np
import pytest
from PIL import Image

import browser
from conftest import BEAM, ROOT
from results import Results
from tools import PLOUGH

TERSE = {"h": 0.5, "n": 3, "steps": 10, "every": 5}


@pytest.fixture(scope="session")
def page_of(mpm, tmp_path_factory):
    """Writes the report on some directories and returns its path."""

    def write(*directories, **options):
        path = tmp_path_factory.mktemp("report") / "report.html"
        settings = [word for name, value in options.items() for word in (f"--{name}", value)]
        process = mpm("report", *directories, "--out", path, *settings)
        assert process.returncode == 0, process.stderr
        assert str(path) in process.stderr
        return path

    return write


@pytest.fixture(scope="session")
def page(page_of, beam):
    return page_of(beam.directory, units="m,N,s")


@pytest.fixture(scope="session")
def failed(mpm, tmp_path_factory):
    """A run whose second step cannot be brought into equilibrium."""
    folder = tmp_path_factory.mktemp("failed")
    deck = folder / "deck.yaml"
    deck.write_text((ROOT / "inputs" / "collapse.yaml").read_text())
    process = mpm("run", deck, "--out", folder / "out", *settings(h=1, n=3, method="mpm", steps=2, smallest=1))
    assert process.returncode == 1, process.stderr
    return folder / "out"


@pytest.fixture(scope="session")
def beam_of_cpdi2(analyse):
    return analyse("inputs/beam.yaml", **(BEAM | {"method": "cpdi2"}))


@pytest.fixture(scope="session")
def comparison(page_of, beam, beam_of_cpdi2, failed):
    return page_of(beam.directory, beam_of_cpdi2.directory, failed)


@pytest.fixture(scope="session")
def excavation(analyse):
    """A run in five stages."""
    return analyse("inputs/excavation.yaml", h=0.5)


@pytest.fixture(scope="session")
def staged(page_of, excavation):
    return page_of(excavation.directory)


@pytest.fixture(params=["page", "comparison", "staged"])
def any_page(request):
    return request.getfixturevalue(request.param)


def settings(**parameters):
    return [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]


def text_of(html):
    """What a page says, without markup and with plain signs."""
    words = []

    class Reader(HTMLParser):
        def handle_data(self, data):
            words.append(data)

    Reader().feed(re.sub(r"<(style|script).*?</\1>", "", html, flags=re.S))
    text = "".join(words).replace("\u2212", "-").replace("\u202f", "").replace("\u00a0", " ")
    return re.sub(r"\s+", " ", text)


def curves(html):
    """Name and values of every curve."""
    found = re.findall(r'<polyline [^>]*data-name="([^"]*)" data-x="([^"]*)" data-y="([^"]*)"', html)
    return [(name, *(np.array(values.split(), dtype=float) for values in points)) for name, *points in found]


def pictures(html):
    """The pictures in a page as arrays of pixels."""
    data = re.findall(r'href="data:image/png;base64,([^"]*)"', html)
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(text)))) for text in data]


def test_pages_are_valid_and_contain_all_they_need(any_page):
    html = any_page.read_text()
    # Raises an error at the first thing that is not as HTML has it.
    tree = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(html)
    identifiers = [element.get("id") for element in tree.iter() if element.get("id")]
    assert len(identifiers) == len(set(identifiers))
    for element in tree.iter():
        for name, value in element.items():
            if name.split("}")[-1] in ("src", "href", "srcset", "action", "data"):
                inside = value.startswith("#") and value[1:] in identifiers
                assert inside or value.startswith("data:image/png;base64,"), f"{name}={value[:80]}"
        if str(element.tag).endswith("svg"):
            assert element.get("role") == "img" and element.get("aria-label")
    assert "@import" not in html and not re.search(r"url\((?!#)", html)
    numbers = re.sub(r"base64,[^\"]*", "", html)
    assert "NaN" not in numbers and not re.search(r"\binf\b", numbers)
    assert any_page.stat().st_size < 1_500_000


def test_figures_and_tables_are_numbered(any_page):
    html = any_page.read_text()
    for kind in ("Figure", "Table"):
        numbers = [int(number) for number in re.findall(rf"<b>{kind} (\d+)\.</b>", html)]
        assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) >= 5


def test_a_page_says_what_the_files_say(page, beam):
    html = page.read_text()
    text, history, summary = text_of(html), beam.history, beam.summary
    assert "Completed. All 20 load steps are in equilibrium." in text
    assert summary["title"] in text and summary["deck_hash"] in text
    assert f"tip {history['tip_ux'][-1]:.5f} {history['tip_uy'][-1]:.5f}".replace(" ", "") in text.replace(" ", "")
    balance = text.split("Forces on the bodies")[1].split("Displacements of the probes")[0].replace(" ", "")
    assert re.search(r"Loads0(\.0+)?-100000(\.0+)?root", balance)
    pin = re.search(r"pin0(?:\.0+)?([1-9][\d.]*)Sum", balance)
    assert float(pin[1]) == pytest.approx(history["pin_ry"][-1], rel=1e-5)
    largest = summary["largest"]["displacement"]
    shown = re.search(r"Largest displacement([\d.]+) m", text)
    assert float(shown[1]) == pytest.approx(largest["value"], rel=1e-4) and f"point {largest['point']} at" in text
    for phase, seconds in summary["wall_seconds"].items():
        assert f"{phase}{seconds:.3f}" in text.replace(" ", ""), phase
    order = summary["quality"]["newton_order"]["median"]
    assert float(re.search(r"Their median is ([\d.]+)\.", text)[1]) == pytest.approx(order, rel=5e-3)
    for unit in ("displacement [m]", "reaction [10³ N/m]", "von Mises stress [10⁶ Pa]", "x [m]"):
        assert unit in text, unit


def test_curves_are_those_of_the_history(page, beam):
    history, found = beam.history, {name: (x, y) for name, x, y in curves(page.read_text())}
    for name, column in [("tip x", "tip_ux"), ("tip y", "tip_uy"), ("pin y", "pin_ry"), ("strain energy", "strain_energy")]:
        x, y = found[name]
        np.testing.assert_allclose(x, [0, *history["time"]], rtol=1e-5)
        np.testing.assert_allclose(y, [0, *history[column]], rtol=1e-5)
    # The reaction against the deflection has no name on the chart: it is the only curve there.
    assert any(
        name == "" and len(x) == 21 and np.allclose(x[1:], history["tip_uy"], rtol=1e-5)
        and np.allclose(y[1:], history["pin_ry"], rtol=1e-5)
        for name, x, y in curves(page.read_text())
    )


TWO_LOADS = """version: 1
title: A block under its weight, then a surcharge
grid: {type: structured, origin: [0, 0], size: [4, 5], spacing: 1}
materials: {m: {model: hencky, young: 1e6, poisson: 0.2, density: 2000}}
bodies: [{name: block, material: m, shape: {type: box, min: [0, 0], max: [4, 4]}, points_per_cell: 4}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: side, nodes: {x: 0}, fix: [x]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10], curve: [[0, 0], [1, 1], [2, 1]]}
  - {name: surcharge, type: body-force, force: [0, "if(Y > 3, -5e4, 0)"], curve: [[0, 0], [1, 0], [2, 1]]}
steps: {count: 8, end_time: 2}
output: {every: 0, probes: [{name: crest, body: block, nearest: [4, 4]}]}
"""


def test_several_loads_are_drawn_each_by_itself(page_of, mpm, tmp_path):
    """They follow different curves: there is no load factor, and the reaction of the base is no measure of either."""
    (tmp_path / "deck.yaml").write_text(TWO_LOADS)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    history, html = Results(tmp_path / "out").history, page_of(tmp_path / "out").read_text()
    text, found = text_of(html), curves(html)
    assert "against load factor" not in text
    assert "Resultants of the loads against time." in text
    assert "Load and displacement: resultant of each load against displacement of crest along y." in text
    for name in ("weight", "surcharge"):
        loads = [0, *history[f"{name}_fy"]]
        xs = [x for label, x, y in found if label == f"{name} y" and np.allclose(y, loads, rtol=1e-5)]
        assert len(xs) == 2, "against time, and against displacement"
        np.testing.assert_allclose(xs[0], [0, *history["time"]], rtol=1e-5)
        np.testing.assert_allclose(xs[1], [0, *history["crest_uy"]], rtol=1e-5)
    # The weight stays while the surcharge grows.
    assert history["weight_fy"][-1] == history["weight_fy"][3] == pytest.approx(-320e3)
    assert history["surcharge_fy"][3] == 0 > history["surcharge_fy"][-1]
    displacement = next(x for label, x, _ in found if label == "crest y")
    assert displacement[0] == 0
    balance = text.split("Forces on the bodies")[1].split("Displacements of the probes")[0]
    assert re.search(r"weight ?0.*surcharge ?0.*base", balance), balance


def test_tools_are_told_from_loads_and_probes(page_of, mpm, tmp_path):
    """Their forces are drawn against their motion, by parts, and are no loads."""
    (tmp_path / "deck.yaml").write_text(json.dumps(PLOUGH))
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    results = Results(tmp_path / "out")
    history, html = results.history, page_of(tmp_path / "out", units="m,N,s").read_text()
    text, found = text_of(html), curves(html)
    section = text.split("Forces and moments are those that the tools exert")[1]
    for caption in ("Forces", "Moments"):
        assert f"{caption} of the tool plough and its parts against displacement y." in section
    for label, column in (("y", "plough_fy"), ("left: x", "plough_left_fx"), ("right: z", "plough_right_mz")):
        forces = [0, *history[column]]
        xs = [x for name, x, y in found if name == label and np.allclose(y, forces, rtol=1e-5)]
        assert len(xs) == 1, label
        np.testing.assert_allclose(xs[0], [0, *history["plough_uy"]], rtol=1e-5)
    assert not any(name.startswith("far") for name, _, _ in found), "nothing acts on this part"
    lowest = history["plough_fy"].argmin() + 1
    assert re.search(rf"force y \[N/m\]-[\d.]+(e3|·10\S+)? ?-[\d.]+\S* ?{lowest}", section.replace(" ", " ")), section[:900]
    assert "dissipated" in section and results.summary["friction_work"] > 0
    balance = text.split("Forces on the bodies")[1].split("Displacements of the probes")[0]
    assert re.search(r"plough ?[-−]?\d", balance) and "Loads" in balance, balance
    assert "plough" not in text.split("Displacements of the probes")[1].split("Model")[0]
    assert not any(name.startswith("plough") for name, _, _ in found)


PRESSED = """version: 1
grid: {type: structured, origin: [0, 0], size: [4, 5], spacing: 1}
materials: {m: {model: hencky, young: 1e6, poisson: 0.2, density: 2000}}
bodies:
  - name: block
    material: m
    shape: {type: box, min: [0, 0], max: [4, 4]}
    points_per_cell: 4
    initial_stress: {type: geostatic, surface: 4, k0: 0.5}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
  - {name: top, nodes: {y: 4}, move: {along: [0, -1], by: 1e-4}}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
steps: {count: 4}
output: {every: 0, probes: [{name: crest, body: block, nearest: [4, 4]}]}
"""


def test_an_initial_stress_leaves_no_load_factor_and_a_condition_moves_along_a_direction(page_of, mpm, tmp_path):
    """The weight acts in full from the start. The force on the nodes that move is the ordinate, small as it is."""
    (tmp_path / "deck.yaml").write_text(PRESSED)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    text = text_of(page_of(tmp_path / "out").read_text())
    assert "against time" in text and "against load factor" not in text
    assert "Load and displacement: reaction of top along y against displacement of crest along y." in text


def test_a_path_under_control_is_drawn_against_time(page_of, mpm, tmp_path):
    """Its load factor follows from equilibrium and is no measure of progress."""
    deck = re.sub(r"  - \{name: surcharge.*\n", "", TWO_LOADS).replace(", curve: [[0, 0], [1, 1], [2, 1]]", "")
    deck = deck.replace("end_time: 2", "control: {type: arc-length}")
    (tmp_path / "deck.yaml").write_text(deck)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    text = text_of(page_of(tmp_path / "out").read_text())
    assert "against time" in text and "against load factor" not in text


def bands(html):
    """For every chart with bands: the axis, the names in their order, and the ends of the bands as shares of the chart."""
    found = []
    for chart in re.findall(r'<svg class="chart".*?</svg>', html, re.S):
        pattern = r'<rect class="band(?: shaded)?" x="([\d.]+)" y="\d+" width="([\d.]+)" [^>]*><title>([^<]*)</title>'
        if of_chart := re.findall(pattern, chart):
            start, end = map(float, re.search(r'class="base" d="M([\d.]+) [\d.]+H([\d.]+)"', chart).groups())
            ends = [((float(x) - start) / (end - start), (float(x) + float(width) - start) / (end - start)) for x, width, _ in of_chart]
            axis = re.search(r'<text class="name x"[^>]*>([^<]*)<', chart)[1]
            found.append((axis, [name for *_, name in of_chart], np.array(ends), chart))
    return found


def test_stages_are_shown(staged, excavation):
    html, history = staged.read_text(), excavation.history
    text, names = text_of(html), ["rest", "wall", "dig", "prop and dig", "release"]
    table = text.split("Stages of the analysis")[1].split("Forces on the bodies")[0]
    for number, (name, steps) in enumerate(zip(names, [1, 2, 4, 4, 4], strict=True)):
        of_stage = history["stage"] == number + 1
        iterations = int(history["iterations"][of_stage].sum())
        row = rf"{name}{steps} of {steps}{number} to {number + 1}\D*{iterations}\D*[\d.]"
        assert re.search(row, table), (row, table)
    assert "add wall; remove slot; displacements count from its end" in table
    assert "remove lower; set prop" in table and "release prop" in table
    assert "Load steps: 5 stages, rest, wall, dig, prop and dig, release;" in text
    drawn = bands(html)
    assert [axis for axis, *_ in drawn].count("load step") == 2
    assert sum(axis.startswith("time") for axis, *_ in drawn) >= 3
    for axis, shown, ends, chart in drawn:
        assert shown == names
        np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1], atol=2e-3)
        if axis.startswith("time"):
            np.testing.assert_allclose(ends, [(k / 5, (k + 1) / 5) for k in range(5)], atol=2e-3)
        else:
            width = np.diff(ends, axis=1)[:, 0]
            np.testing.assert_allclose(width[1:4] / width[4], [0.5, 1, 1], atol=0.02)
        assert chart.count('<text class="band') == 5
    assert "Step 15, release, time 5" in text and "Step 0, time 0" in text
    # Nothing is known of the reactions before the first step of bodies that begin stressed.
    floor = next(x for name, x, _ in curves(html) if name == "floor y")
    np.testing.assert_allclose(floor, history["time"])


def test_stages_that_were_not_reached_have_no_band(page_of, mpm, tmp_path):
    deck = (ROOT / "inputs/excavation.yaml").read_text().replace('spacing: "${h}"', "spacing: 0.5")
    deck = deck.replace("release: [prop]", "release: [prop], solver: {tolerance: 1e-9, max_iterations: 1}").replace("h: 0.25 ", "# ")
    deck = deck.replace("steps: {count: 4}, release", "steps: {count: 4, smallest: 1, damping: false}, release")
    (tmp_path / "deck.yaml").write_text(deck)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    html = page_of(tmp_path / "out").read_text()
    assert bands(html) and all(names[-1] == "prop and dig" for _, names, *_ in bands(html))
    assert "release0 of 4" in text_of(html)


def test_runs_without_stages_have_no_bands(page, comparison):
    for path in (page, comparison):
        assert not bands(path.read_text()) and "Stages of the analysis" not in text_of(path.read_text())


def test_residuals_of_every_step_are_drawn(page, beam):
    table, drawn = beam.table("convergence"), [y for _, _, y in curves(page.read_text())]
    for step in range(1, 21):
        residuals = table["residual"][table["step"] == step]
        assert any(len(y) == len(residuals) and np.allclose(y, residuals, rtol=1e-5) for y in drawn), step


def test_the_deck_is_listed_as_it_was_used(page, beam):
    html = page.read_text()
    lines = [text_of(line) for line in re.findall(r"<code>(.*?)</code>\n", html.split('<pre class="deck">')[1])]
    deck = [re.sub(r"\s+", " ", line) for line in (ROOT / "inputs" / "beam.yaml").read_text().splitlines()]
    assert lines[: len(deck)] == deck
    # The deck says 50 steps, the command line said 20.
    assert "steps (changed)2050" in text_of(html).replace(" ", "").replace("steps(changed)", "steps (changed)")


def test_pictures_show_the_area_of_the_bodies(page_of, beam_of_cpdi2):
    """Pixels that are not transparent, in units of the axes, cover what the domains cover, which are CPDI2's: without
    gaps and overlaps."""
    beam = beam_of_cpdi2
    html, meshes = page_of(beam.directory).read_text(), [beam.mesh("domains", index) for index in (0, 10, 20)]
    scales = re.findall(r'<rect class="ground" [^>]*width="([\d.]+)" height="([\d.]+)"', html)
    corners = np.concatenate([*(mesh.points for mesh in meshes), *(beam.mesh("grid", index).points for index in (0, 10, 20))])
    span = np.ptp(corners[:, :2], axis=0)
    span = span + 2 * 0.02 * span.max()
    found = pictures(html)
    assert len(found) == len(scales) == 3
    for mesh, picture, (width, height) in zip(meshes, found, scales, strict=True):
        rows, columns = picture.shape[:2]
        assert float(width) / float(height) == pytest.approx(columns / rows, rel=0.01)
        assert span[0] / span[1] == pytest.approx(columns / rows, rel=0.01), "the axes have equal scales"
        # Domains are opaque, grid lines are not.
        area = (picture[:, :, 3] > 200).sum() * span[0] / columns * span[1] / rows
        assert area == pytest.approx(mesh.cell_data["volume"].sum(), rel=0.02)


def test_colours_follow_the_field(page_of, beam):
    """Bending: the upper side, in tension, is red and the lower one, in compression, blue."""
    html = page_of(beam.directory, field="cauchy_stress:XX", steps="last").read_text()
    (picture,) = pictures(html)
    opaque = picture[:, :, 3] > 200
    column = int(np.flatnonzero(opaque.any(axis=0))[0]) + 4
    rows = np.flatnonzero(opaque[:, column])
    upper, lower = picture[rows[5], column].astype(int), picture[rows[-6], column].astype(int)
    assert upper[0] > upper[2] + 60 and lower[2] > lower[0] + 60, (upper, lower)
    assert "Step 20, load factor 1" in html and "Step 0" not in html


def test_standard_points_are_drawn_as_discs(page_of, collapse):
    html = page_of(collapse.directory, steps="last").read_text()
    (picture,) = pictures(html)
    assert "Deformed material points, coloured by von Mises stress" in text_of(html)
    assert (picture[:, :, 3] > 200).mean() > 0.2


def test_bodies_in_space_are_seen_from_above(page_of, analyse):
    """The outline of the domains of a box covers the shadow that the box casts along the line of sight: the sum of the
    areas of its three visible sides, each times the cosine of its inclination."""
    results = analyse("inputs/block/block.yaml", h=1, n=2, method="gimp", every=1)
    page = page_of(results.directory, steps="first", units="m,N,s")
    (picture,) = pictures(page.read_text())
    azimuth, elevation = np.radians([-52, 24])
    towards = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    up = np.cross(towards, right)
    corners = 4.0 * np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    span = np.array([np.ptp(corners @ right), np.ptp(corners @ up)])
    span = span + 2 * 0.02 * span.max()
    rows, columns = picture.shape[:2]
    assert span[0] / span[1] == pytest.approx(columns / rows, rel=0.01)
    area = (picture[:, :, 3] > 200).sum() * span[0] / columns * span[1] / rows
    assert area == pytest.approx(16 * np.abs(towards).sum(), rel=0.01)
    assert "the box from (0, 0, 0) to (4, 4, 4) m." in text_of(page.read_text())


def test_points_in_space_without_domain_are_cubes(page_of, analyse):
    results = analyse("inputs/block/block.yaml", h=1, n=2, method="mpm", every=3)
    text = text_of(page_of(results.directory, steps="last").read_text())
    assert "Deformed material points, as cubes of their volume, coloured by von Mises stress" in text


def test_a_failed_run_says_so(page_of, failed):
    text = text_of(page_of(failed).read_text())
    summary = json.loads((failed / "summary.json").read_text())
    said = f"The analysis failed with {summary['code']}: {summary['reason']}. Load steps in equilibrium: 1 of 2."
    assert re.sub(r"\s+", " ", said).replace("\u2212", "-") in text
    assert "This page shows only steps in equilibrium." in text
    assert "step 2, failed" in text


def test_a_run_that_goes_on_or_was_killed_says_so(page_of, program, beam, tmp_path):
    out = tmp_path / "out"
    command = [program, "run", ROOT / "inputs" / "collapse.yaml", "--out", out, *settings(n=9, steps=2000)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    while not (out / "points_0002.vtu").exists():
        assert process.poll() is None
        time.sleep(0.01)
    # Files of the next step may appear while the report is written; each is complete.
    assert "The analysis is still running." in text_of(page_of(out).read_text())
    process.kill()
    process.wait(timeout=60)
    text = text_of(page_of(out).read_text())
    assert re.search(r"was killed: its process ended unexpectedly. Load steps in equilibrium: \d+ of 2000", text)


def test_a_run_without_summary_and_status(page_of, beam, tmp_path):
    directory = tmp_path / "copy"
    shutil.copytree(beam.directory, directory)
    (directory / "summary.json").unlink()
    (directory / "status.json").unlink()
    text = text_of(page_of(directory).read_text())
    assert "The outcome of the analysis is unknown" in text and "Load steps in equilibrium: 20 of 20." in text
    # Before the first step is in equilibrium there is next to nothing to show.
    header = (directory / "history.csv").read_text().splitlines()[0]
    (directory / "history.csv").write_text(header + "\n")
    (directory / "convergence.csv").write_text("step,iteration,residual\n")
    for path in [*directory.glob("*.vtu"), *directory.glob("*.pvd")]:
        path.unlink()
    assert "Load steps in equilibrium: 0 of 20." in text_of(page_of(directory).read_text())


def test_results_of_an_earlier_version_have_no_deck(page_of, beam, tmp_path):
    shutil.copytree(beam.directory, tmp_path / "old")
    (tmp_path / "old" / "run.json").unlink()
    text = text_of(page_of(tmp_path / "old").read_text())
    assert "The results do not contain the text of the deck." in text and "displacement [length]" in text


def test_a_run_without_pictures(page_of, analyse):
    results = analyse("inputs/beam.yaml", **(TERSE | {"every": 0}))
    assert "The run wrote no VTU files" in text_of(page_of(results.directory).read_text())


def test_pictures_that_cannot_be_made_are_refused(mpm, beam, analyse, tmp_path):
    bare = analyse("inputs/beam.yaml", **(TERSE | {"every": 0})).directory
    for runs in ([bare], [bare, bare]):
        for words in (["--field", "pressure"], ["--steps", "3"]):
            process = mpm("report", *runs, *words, "--out", tmp_path / "page.html")
            assert process.returncode == 2 and f"`{bare}` contains no VTU files of the points" in process.stderr
    shutil.copytree(beam.directory, tmp_path / "other")
    process = mpm("report", beam.directory, tmp_path / "other", "--field", "nothing", "--out", tmp_path / "page.html")
    assert process.returncode == 2 and re.search(r"error: the run `[^`]+`: the points have no field", process.stderr)
    assert not (tmp_path / "page.html").exists()


def test_a_comparison_tells_the_runs_apart(comparison, beam):
    html = comparison.read_text()
    text = text_of(html)
    names = [re.escape(name) for name in re.findall(r'<polyline [^>]*data-name="([^"]+)"', html)]
    assert len(set(names)) >= 2
    assert re.search(r"The analysis failed with S00[12]: .* Load steps in equilibrium: 1 of 2\.", text)
    assert "Parameters that differ." in text and "gimp" in text and "cpdi2" in text
    assert "- title: Elastic cantilever" in text and "+ title: Elasto-plastic collapse" in text
    tips = [y for name, x, y in curves(html) if np.allclose(y[-1], beam.history["tip_uy"][-1], rtol=1e-5)]
    assert tips, "the curve of the first run"
    assert len(pictures(html)) == 3


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])


@pytest.mark.parametrize(
    "damage, complaint",
    [
        (lambda d: cut(d / "history.csv"), "history.csv"),
        (lambda d: cut(d / "convergence.csv"), "convergence.csv"),
        (lambda d: cut(d / "summary.json"), "summary.json"),
        (lambda d: cut(d / "run.json"), "run.json"),
        (lambda d: cut(d / "points.pvd"), "points.pvd"),
        (lambda d: cut(d / "points_0010.vtu"), "points_0010.vtu"),
        (lambda d: cut(d / "domains_0010.vtu"), "domains_0010.vtu"),
        (lambda d: (d / "points_0010.vtu").unlink(), "points_0010.vtu"),
        (lambda d: (d / "points_0010.vtu").write_text("not at all"), "points_0010.vtu"),
        (lambda d: (d / "history.csv").unlink(), "contains no results"),
        (lambda d: (d / "convergence.csv").unlink(), "convergence.csv"),
        (lambda d: (d / "summary.json").write_text("[]"), "summary.json"),
        (lambda d: (d / "summary.json").write_text("{}"), "outcome"),
        (lambda d: (d / "history.csv").write_bytes(b"\xff\xfe\n"), "history.csv"),
        (lambda d: (d / "history.csv").write_text("a,b\n1,2\n"), "`step`"),
    ],
)
def test_damaged_results_are_refused_by_name(mpm, beam, tmp_path, damage, complaint):
    directory = tmp_path / "damaged"
    shutil.copytree(beam.directory, directory)
    damage(directory)
    process = mpm("report", directory)
    assert process.returncode == 2, process.stderr
    assert complaint in process.stderr and "panicked" not in process.stderr, process.stderr
    assert not (directory / "report.html").exists()


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        (["--field", "von_mises"], "did you mean `von_mises_stress`?"),
        (["--field", "colour"], "the fields are `displacement`"),
        (["--field", "cauchy_stress"], "choose one of `cauchy_stress:XX`"),
        (["--field", "cauchy_stress:RR"], "no component `RR`"),
        (["--field", "pressure:XX"], "`pressure` has no components"),
        (["--steps", "first,7.5"], "expected step numbers"),
        (["--steps", "21"], "load step 21 was not written"),
        (["--units", "m"], "m,kN,s"),
        (["--out", "/nowhere/at/all/report.html"], "cannot be written"),
    ],
)
def test_wrong_options_are_explained(mpm, beam, arguments, complaint):
    process = mpm("report", beam.directory, *arguments)
    assert process.returncode == 2
    assert complaint in process.stderr and "panicked" not in process.stderr, process.stderr


def test_what_is_no_result_is_refused(mpm, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "sweep.csv").write_text("h\n")
    for path, complaint in [("missing", "cannot be read"), ("file", "is a file"), ("study", "give its members"), (".", "no results")]:
        process = mpm("report", tmp_path / path)
        assert process.returncode == 2 and complaint in process.stderr, process.stderr


def test_names_from_a_deck_do_not_become_markup(mpm, page_of, tmp_path):
    title = "<script>alert(1)</script> & <b>bold</b>"
    deck = (ROOT / "inputs" / "beam.yaml").read_text()
    deck = re.sub(r"^title: .*$", f"title: {json.dumps(title)}", deck, flags=re.M)
    (tmp_path / "deck.yaml").write_text(deck)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out", *settings(**TERSE))
    assert process.returncode == 0, process.stderr
    html = page_of(tmp_path / "out").read_text()
    assert html.count("<script") == 1 and "<b>bold" not in html
    assert title in text_of(html)


def luminance(colour):
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a, b):
    low, high = sorted([luminance(a), luminance(b)])
    return (high + 0.05) / (low + 0.05)


def test_contrasts_are_sufficient(page):
    """As the Web Content Accessibility Guidelines ask for: 4.5 for text, 3 for curves."""
    style = page.read_text().split("<style>")[1].split("</style>")[0]
    light, dark = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})\b", block)) for block in re.findall(r":root \{(.*?)\}", style, re.S))
    for theme in (light, light | dark):
        colours = {name: value if len(value) == 7 else "#" + "".join(2 * c for c in value[1:]) for name, value in theme.items()}
        for text in ("ink", "soft", "accent", *(f"c{number}" for number in range(8))):
            assert contrast(colours[text], colours["paper"]) >= 4.5, text
        for text, ground in [("bad", "bad-ground"), ("good", "good-ground"), ("care", "care-ground"), ("ink", "bad-ground"), ("soft", "faint")]:
            assert contrast(colours[text], colours[ground]) >= 4.5, text
        assert contrast(colours["late"], colours["paper"]) >= 4.5
        assert contrast(colours["early"], colours["paper"]) >= 1.5


@pytest.fixture(scope="module")
def window():
    program = browser.find()
    if program is None:
        pytest.skip("there is no Chromium; put one on the PATH or name it in CHROMIUM")
    with browser.Browser(program) as window:
        yield window


@pytest.fixture
def seen(program):
    """Where pictures of the pages are kept for those who want to see them."""
    folder = program.parents[1] / "tmp" / "report"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_browser_shows_a_page_without_asking_anyone(window, any_page, seen, scheme, request):
    for width in (820, 400):
        window.look(width, scheme)
        window.open(any_page.as_uri())
        assert window.requests() == [any_page.as_uri()]
        assert window.complaints() == []
        assert window.evaluate("document.documentElement.scrollWidth") <= width, "the page is wider than the window"
        assert window.evaluate("[...document.images, ...document.querySelectorAll('image')].length") >= 3
        paper = window.evaluate("getComputedStyle(document.documentElement).backgroundColor")
        assert (sum(map(int, re.findall(r"\d+", paper))) > 600) == (scheme == "light")
        shot = seen / f"{request.node.callspec.params['any_page']}-{scheme}-{width}.png"
        window.screenshot(shot)
        assert np.ptp(np.asarray(Image.open(shot).convert("L"))) > 150


def test_the_policy_of_a_page_forbids_requests(window, page):
    window.look()
    window.open(page.as_uri())
    answer = window.evaluate("fetch('https://example.org/').then(() => 'answered', () => 'refused')")
    assert answer == "refused"


def test_a_curve_is_read_with_the_pointer(window, page, beam):
    window.look()
    window.open(page.as_uri())
    window.evaluate("document.querySelector('svg.chart').scrollIntoView()")
    place = window.evaluate(
        "(() => { const svg = document.querySelector('svg.chart'), p = svg.querySelector('.curve').points[10];"
        " const at = new DOMPoint(p.x, p.y).matrixTransform(svg.getScreenCTM()); return [at.x + 2, at.y - 2]; })()"
    )
    window.call("Input.dispatchMouseEvent", type="mouseMoved", x=place[0], y=place[1])
    shown = window.evaluate("document.querySelector('svg.chart .readout text').textContent")
    value = float(f"{beam.history['tip_ux'][9]:.5e}")
    assert shown.replace("\u2212", "-") == f"tip x: 0.5, {value!r}"
    assert window.complaints() == []


def test_a_page_is_printed_in_light_colours(window, any_page, seen, request):
    window.look(scheme="dark")
    window.open(any_page.as_uri())
    path = seen / f"{request.node.callspec.params['any_page']}.pdf"
    window.pdf(path)
    printed = path.read_bytes()
    assert printed.startswith(b"%PDF")
    sheets = len(re.findall(rb"/Type\s*/Page\b", printed))
    assert 4 <= sheets <= 20, sheets
    window.call("Emulation.setEmulatedMedia", media="print", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    paper = window.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    assert paper == "rgb(255, 255, 255)"
    assert window.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"
