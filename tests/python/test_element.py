"""Element tests: tables against formulas written anew, bad arguments and files, tests that end early, and the page."""

import csv
import io
import math
import subprocess
from html.parser import HTMLParser

import html5lib
import numpy as np
import pytest

import browser

YOUNG, POISSON, RADIUS = 1e6, 0.3, 20e3
BULK, SHEAR = YOUNG / (3 * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
COLUMNS = """step strain_xx strain_yy strain_zz strain_xy volumetric_strain J stress_xx stress_yy stress_zz stress_xy pressure
deviatoric_stress axial_strain shear_strain deviatoric_strain""".split()
PATHS = ["oedometer", "isotropic", "triaxial-drained", "triaxial-undrained", "biaxial", "simple-shear"]
# Nothing of this deck can be run: the mesh is missing. Its materials can be tested.
DECK = """
version: 1
title: Materials & <their> laws
parameters: {young: 1e6}
grid: {type: gmsh, file: missing.msh}
materials:
  clay: {model: von-mises, young: "${young}", poisson: 0.3, deviatoric_yield_stress: 20e3}
  elastic: {model: hencky, young: 1e6, poisson: 0.3}
  "rubber/1": {model: neo-hookean, young: 1e6, poisson: 0.3}
bodies:
  - {name: block, material: clay, shape: {type: cells, group: block}, points_per_triangle: 4}
boundary_conditions:
  - {name: base, nodes: {group: base}, fix: [x, y]}
loads:
  - {name: weight, type: body-force, force: [0, -1e3], bodies: [block]}
steps: {count: 2}
"""


@pytest.fixture
def element(program, tmp_path):
    """Runs `mpm element` in a folder of its own, where the deck lies."""
    (tmp_path / "laws.yaml").write_text(DECK)

    def run(*arguments):
        command = [str(program), "element", "laws.yaml", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    run.folder = tmp_path
    return run


def read(text):
    rows = list(csv.reader(io.StringIO(text)))
    return {name: np.array([float(row[k]) for row in rows[1:]]) for k, name in enumerate(rows[0])}


def table(element, *arguments):
    process = element("--output", "-", *arguments)
    assert process.returncode == 0 and process.stderr == "", process.stderr
    return read(process.stdout)


def files(element):
    return sorted(path.name for path in element.folder.iterdir() if path.name != "laws.yaml")


@pytest.mark.parametrize("path", PATHS)
def test_every_path_has_all_columns_and_consistent_invariants(element, path):
    of = table(element, "--material", "clay", "--path", path, "--confining", 50e3, "--to", 0.1, "--then", -0.05, "--steps", 30)
    assert list(of) == [*COLUMNS, "equivalent_plastic_strain", "plastic_work", "energy"]
    assert list(of["step"]) == list(range(61))
    stress = np.array([of[f"stress_{c}"] for c in ("xx", "yy", "zz")])
    assert np.allclose(of["pressure"], -stress.mean(axis=0), rtol=1e-13)
    deviator = stress + of["pressure"]
    q = np.sqrt(1.5 * ((deviator**2).sum(axis=0) + 2 * of["stress_xy"] ** 2))
    assert np.allclose(of["deviatoric_stress"], q, rtol=1e-9, atol=1e-6)
    assert np.allclose(of["J"], np.exp(of["volumetric_strain"]), rtol=1e-14)
    normal = of["strain_xx"] + of["strain_yy"] + of["strain_zz"]
    assert np.allclose(normal, of["volumetric_strain"], rtol=0, atol=1e-14)
    assert np.allclose(of["stress_xx"][0], -50e3, rtol=1e-13) and of["J"][0] == 1
    driver = {"isotropic": -of["volumetric_strain"], "simple-shear": of["shear_strain"]}.get(path, of["axial_strain"])
    assert np.allclose(driver[[0, 30, 60]], [0, 0.1, -0.05], rtol=1e-14)


def test_the_oedometer_and_the_isotropic_path_of_hencky(element):
    of = table(element, "--material", "elastic", "--path", "oedometer", "--to", 0.3, "--steps", 10)
    assert np.allclose(of["stress_yy"] * of["J"], (BULK + 4 / 3 * SHEAR) * of["strain_yy"], rtol=1e-13)
    of = table(element, "--material", "elastic", "--path", "isotropic", "--to", -0.3, "--steps", 10)
    assert np.allclose(of["pressure"] * of["J"], -BULK * of["volumetric_strain"], rtol=1e-13)


def test_drained_triaxial_compression_yields_at_the_strength(element):
    of = table(element, "--material", "clay", "--path", "triaxial-drained", "--confining", 100e3, "--to", 0.2)
    assert len(of["step"]) == 201
    assert np.allclose(of["stress_xx"], -100e3, rtol=1e-12) and np.allclose(of["stress_zz"], -100e3, rtol=1e-12)
    flows = np.flatnonzero(np.diff(of["equivalent_plastic_strain"]) > 0) + 1
    assert len(flows) > 100
    assert np.allclose((of["deviatoric_stress"] * of["J"])[flows], math.sqrt(1.5) * RADIUS, rtol=1e-12)


def test_undrained_compression_keeps_the_volume(element):
    of = table(element, "--material", "clay", "--path", "triaxial-undrained", "--to", 0.2, "--then", -0.2)
    assert np.abs(of["J"] - 1).max() < 1e-14


def test_simple_shear_of_the_neo_hookean_law(element):
    of = table(element, "--material", "rubber/1", "--path", "simple-shear", "--to", 1.5, "--steps", 20)
    assert np.allclose(of["stress_xy"], SHEAR * of["shear_strain"], rtol=1e-13)
    assert np.allclose(of["stress_xx"], SHEAR * of["shear_strain"] ** 2, rtol=1e-12)
    held = ("--material", "elastic", "--path", "simple-shear", "--to", 0.5, "--confining", 80e3, "--constant-normal-stress")
    of = table(element, *held)
    assert np.allclose(of["stress_yy"], -80e3, rtol=1e-12) and of["J"][-1] > 1.01


def test_k0_is_the_ratio_of_the_lateral_to_the_axial_stress(element):
    arguments = ("--material", "elastic", "--path", "biaxial", "--confining", 40e3, "--k0", 0.5, "--to", 0.1)
    of = table(element, *arguments, "--steps", 5)
    assert np.allclose([of["stress_xx"][0], of["stress_yy"][0], of["stress_zz"][0]], [-40e3, -80e3, -40e3], rtol=1e-13)
    assert np.allclose(of["stress_xx"], -40e3, rtol=1e-12)


def test_an_initial_stress_outside_the_yield_surface_is_returned_with_a_note(element):
    arguments = ("--material", "clay", "--path", "oedometer", "--to", 0.1, "--confining", 50e3, "--k0", 0.2)
    process = element(*arguments, "--output", "-")
    assert process.returncode == 0
    assert "note: the initial stress is outside the yield surface; the test begins with σ_xx = σ_zz = -1.0850" in process.stderr
    assert abs(read(process.stdout)["deviatoric_stress"][0] - math.sqrt(1.5) * RADIUS) < 1e-6


def test_histories_of_strain_and_stress(element):
    rows = [(0.02, -0.05, 0.01), (-0.01, 0.03, 0.0)]
    (element.folder / "h.csv").write_text("xx, yy, xy\r\n" + "\r\n".join(",".join(map(str, row)) for row in rows))
    of = table(element, "--material", "elastic", "--path", "strain", "--file", "h.csv")
    for row, (xx, yy, xy) in enumerate(rows, 1):
        strain = np.array([[xx, xy, 0], [xy, yy, 0], [0, 0, 0]])
        tau = (BULK - 2 / 3 * SHEAR) * np.trace(strain) * np.eye(3) + 2 * SHEAR * strain
        found = [of[f"stress_{c}"][row] * of["J"][row] for c in ("xx", "yy", "zz", "xy")]
        assert np.allclose(found, [tau[0, 0], tau[1, 1], tau[2, 2], tau[0, 1]], rtol=1e-11)
    (element.folder / "h.csv").write_text("zz,yy,xx\n-1e3,-5e3,2e3\n0,0,0\n")
    of = table(element, "--material", "clay", "--path", "stress", "--file", "h.csv", "--steps", 4)
    assert np.allclose([of["stress_xx"][4], of["stress_yy"][4], of["stress_zz"][4]], [2e3, -5e3, -1e3], rtol=1e-9)
    assert np.abs([of["stress_xx"][8], of["strain_xx"][8], of["strain_zz"][8]]).max() < 1e-5
    (element.folder / "h.csv").write_text("yz\n0.01\n")
    of = table(element, "--material", "elastic", "--path", "strain", "--file", "h.csv")
    assert abs(of["stress_yz"][1] - 2 * SHEAR * 0.01) < 1e-7 and of["strain_yz"][1] == 0.01


def test_parameters_of_the_deck_can_be_set(element):
    soft = table(element, "--material", "clay", "--path", "oedometer", "--to", 0.001, "--set", "young=1e5", "--steps", 1)
    stiff = table(element, "--material", "clay", "--path", "oedometer", "--to", 0.001, "--steps", 1)
    assert np.isclose(stiff["stress_yy"][1] / soft["stress_yy"][1], 10)


def test_names_of_the_files_and_what_is_overwritten(element):
    first = element("--material", "rubber/1", "--path", "oedometer", "--to", 0.1, "--report")
    assert first.returncode == 0
    assert files(element) == ["laws-rubber_1-oedometer.csv", "laws-rubber_1-oedometer.html"]
    assert first.stderr == "the table is laws-rubber_1-oedometer.csv\nthe report is laws-rubber_1-oedometer.html\n"
    again = element("--material", "rubber/1", "--path", "oedometer", "--to", 0.2, "--report")
    assert again.returncode == 0, "its own files are overwritten"
    for option in ("--output", "--report"):
        (element.folder / "other").write_text("precious")
        process = element("--material", "elastic", "--path", "oedometer", "--to", 0.1, option, "other")
        assert process.returncode == 2 and "`other` exists, but is not " in process.stderr
        assert (element.folder / "other").read_text() == "precious"
    assert files(element) == ["laws-rubber_1-oedometer.csv", "laws-rubber_1-oedometer.html", "other"]


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ("--path oedometer --to 0.1", "choose a material with `--material`; the materials of the deck are `clay`, `elastic` and"),
        ("--path oedometer --to 0.1 --material elastc", "no material `elastc`; did you mean `elastic`? the materials are `clay`"),
        ("--material clay --path oedometr --to 0.1", "a similar value exists: 'oedometer'"),
        ("--material clay --path oedometer", "oedometer needs `--to`, the final strain, for example `--to 0.1`"),
        ("--material clay --path oedometer --to x", "expected a number, for example 0.2 or 100e3"),
        ("--material clay --path oedometer --to inf", "expected a number"),
        ("--material clay --path oedometer --to 0.1 --steps 0", "0 is not in 1..=1000000"),
        ("--material clay --path oedometer --to 0.1 --k0 0", "expected a number above 0"),
        ("--material clay --path oedometer --to 0.1 --units m,N,s", "--report"),
        ("--material clay --path oedometer --then 0.1", "--to <STRAIN>"),
        ("--material clay --path oedometer --to 0.1 --file h.csv", "`--file` needs `--path strain` or `--path stress`"),
        ("--material clay --path biaxial --to 0.1 --constant-normal-stress", "needs `--path simple-shear`"),
        ("--material clay --path strain", "the path strain needs `--file`"),
        ("--material clay --path strain --to 0.1 --file h.csv", "`--to` does not apply to the path strain"),
        ("--material clay --path strain --file none.csv", "the history `none.csv` cannot be read"),
        ("--material clay --path strain --file h.csv", "h.csv: line 3: \"x\" is not a number"),
        ("--material clay --path oedometer --to 0.1 --output no/t.csv", "the table cannot be written: `no/t.csv`"),
        ("--material clay --path oedometer --to 0.1 --output t --report t", "cannot be the same file"),
        ("--material clay --path oedometer --to 0.1 --output ./t --report t", "cannot be the same file"),
        ("--material rubber/1 --path oedometer --to 0.1 --confining 1e300", "the law cannot begin with the initial stress"),
        ("--material clay --path oedometer --to 0.1 --set young=-1", "laws.yaml:"),
    ],
)
def test_bad_arguments_are_named_and_write_nothing(element, arguments, complaint):
    (element.folder / "h.csv").write_text("xx\n1\nx\n")
    process = element(*arguments.split())
    assert process.returncode == 2, process.stderr
    assert complaint in process.stderr and process.stdout == ""
    assert files(element) == ["h.csv"]


def test_a_test_that_ends_early_writes_its_steps(element):
    (element.folder / "h.csv").write_text("yy\n-10e3\n-30e3\n")
    process = element("--material", "clay", "--path", "stress", "--file", "h.csv", "--steps", 10, "--report")
    assert process.returncode == 1
    for words in ("error: step 18 has no solution beyond 0.", "1/1024 of the step: no strain gives the prescribed stress",
                  "along y\n", "the table has the 17 steps before the failure", "help: "):
        assert words in process.stderr
    of = read((element.folder / "laws-clay-stress.csv").read_text())
    assert list(of["step"]) == list(range(18)) and np.isclose(of["stress_yy"][-1], -24e3)
    assert "The test ended early</strong> after 17 steps: step 18" in (element.folder / "laws-clay-stress.html").read_text()


def test_numbers_beyond_the_largest_end_the_test_with_the_steps_before(element):
    path = ("--material", "elastic", "--path", "oedometer", "--to", "-800", "--steps", 2, "--output", "t.csv")
    process = element(*path)
    assert process.returncode == 1 and "error: step 2: `J` is not finite" in process.stderr, process.stderr
    assert list(read((element.folder / "t.csv").read_text())["step"]) == [0, 1]


@pytest.mark.parametrize("number", ["-1e-3", "-.001", "-0.001"])
def test_negative_numbers_are_read_however_they_are_written(element, number):
    of = table(element, "--material", "elastic", "--path", "oedometer", "--to", number, "--then", number, "--steps", 1,
               "--confining", "-1e-3", "--at", "-5,0")
    assert np.allclose(of["strain_yy"], [0, 1e-3, 1e-3])


def test_properties_that_do_not_fit_together_are_told_as_by_check(element):
    soft = ("soft: {model: tresca, young: 1e6, poisson: 0.3, cohesion: 20e3, "
            "softening: {strain: 0.1, residual_cohesion: 1e3, band: 0.1}}")
    deck = DECK.replace('"rubber/1": {', soft + '\n  "rubber/1": {').replace("{group: base}", "{y: 0}")
    deck = deck.replace("type: gmsh, file: missing.msh", "type: structured, origin: [0, 0], size: [4, 4], spacing: 1")
    deck = deck.replace("type: cells, group: block", "type: box, min: [0, 0], max: [2, 2]").replace("_triangle", "_cell")
    (element.folder / "laws.yaml").write_text(deck)
    process = element("--material", "soft", "--path", "oedometer", "--to", "0.1")
    assert process.returncode == 2 and process.stderr.startswith("error[D057]: material `soft`: "), process.stderr
    assert "laws.yaml:9:" in process.stderr and "--at" not in process.stderr


def test_softening_is_adapted_to_the_cells_of_the_grid(element):
    """With a band of two cells, a point softens over twice the strain, as in a run; the cells of a mesh are not known."""
    even = "grid: {type: structured, origin: [0, 0], size: [2, 2], spacing: 0.25}"

    def softened(softening, grid, *more):
        deck = DECK.replace("grid: {type: gmsh, file: missing.msh}", grid).replace("{type: cells, group: block}, points_per_triangle: 4",
                                                                                 "{type: box, min: [0, 0], max: [1, 1]}, points_per_cell: 2")
        deck = deck.replace("nodes: {group: base}", "nodes: {y: 0}")
        law = "{model: tresca, young: 1e6, poisson: 0.3, cohesion: 20e3, softening: {%s, residual_cohesion: 5e3}}" % softening
        (element.folder / "laws.yaml").write_text(deck.replace("{model: hencky, young: 1e6, poisson: 0.3}", law))
        path = ("--material", "elastic", "--path", "triaxial-undrained", "--to", 0.3, "--steps", 30, "--output", "-")
        process = element(*path, *more)
        assert process.returncode == 0, process.stderr
        return read(process.stdout)["deviatoric_stress"], process.stderr

    alone, said = softened("strain: 0.8", even)
    assert said == ""
    adapted, said = softened("strain: 0.4, band: 0.5", even)
    assert "multiplied by 2.000, the ratio of the band width 0.5 to the cell size 0.250" in said
    assert np.array_equal(alone, adapted) and adapted[-1] < 0.75 * adapted.max()
    graded = "grid: {type: structured, origin: [0, 0], size: [2, 2], spacing: [[{to: 1, cells: 4}, {to: 2, cells: 2}], 0.25]}"
    assert np.array_equal(softened("strain: 0.4, band: 0.5", graded, "--at", "0.5,0.5")[0], alone)


def test_runs_have_the_same_bits(element):
    arguments = ("--material", "clay", "--path", "biaxial", "--to", 0.2, "--confining", 1e5, "--output", "-")
    assert element(*arguments).stdout == element(*arguments).stdout != ""


class Page(HTMLParser):
    """The headings, captions and charts of a page."""

    def __init__(self, text):
        super().__init__()
        self.charts, self.text = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "svg" and attributes.get("class") == "chart":
            self.charts.append((attributes["aria-label"], []))
        if tag == "polyline":
            self.charts[-1][1].append((attributes["data-x"], attributes["data-y"]))

    def handle_data(self, data):
        self.text.append(data)


def test_the_page_shows_what_the_table_says(element):
    arguments = ("--material", "clay", "--path", "triaxial-drained", "--confining", 100e3, "--to", 0.2, "--steps", 100)
    assert element(*arguments, "--report", "p.html", "--units", "m,N,s", "--output", "t.csv").returncode == 0
    text = (element.folder / "p.html").read_text()
    html5lib.HTMLParser(strict=True).parse(text)
    page, of = Page(text), read((element.folder / "t.csv").read_text())
    labels = [label for label, _ in page.charts]
    assert labels == [
        "deviatoric stress q against axial strain", "deviatoric stress q against pressure p",
        "volumetric strain ln J against axial strain", "pressure p against volumetric compression −ln J",
        "normal stresses against axial strain", "equivalent plastic strain against axial strain",
    ]
    columns = [("axial_strain", "deviatoric_stress"), ("pressure", "deviatoric_stress"), ("axial_strain", "volumetric_strain")]
    for (_, curves), (x, y) in zip(page.charts, columns):
        [(of_x, of_y)] = curves
        assert np.allclose(np.array(of_x.split(), float), of[x], rtol=1e-5)
        assert np.allclose(np.array(of_y.split(), float), of[y], rtol=1e-5, atol=1e-7)
    words = "".join(page.text)
    for part in ("clay: drained triaxial test", "Materials & <their> laws", "deviatoric yield stress", "deviatoric stress q [10³ Pa]",
                 "laws.yaml", "triaxial-drained", "All 100 steps have a solution"):
        assert part in words, part


@pytest.mark.parametrize("path", PATHS)
def test_a_browser_shows_the_page_without_asking_anyone(element, path):
    chromium = browser.find()
    if chromium is None:
        pytest.skip("there is no Chromium; put one on the PATH or name it in CHROMIUM")
    arguments = ("--material", "clay", "--path", path, "--confining", 100e3, "--to", 0.2, "--report", "p.html")
    assert element(*arguments).returncode == 0
    page = element.folder / "p.html"
    with browser.Browser(chromium) as window:
        for width in (820, 400):
            window.look(width)
            window.open(page.as_uri())
            assert window.requests() == [page.as_uri()] and window.complaints() == []
            assert window.evaluate("document.documentElement.scrollWidth") <= width
            assert window.evaluate("document.querySelectorAll('svg.chart .curve').length") >= 3
