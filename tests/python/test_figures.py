"""The script that draws the figures of the verification pages, and the gallery of these pages."""

import re
import sys

import numpy as np
import pytest
from PIL import Image

from conftest import ROOT

VERIFICATION = ROOT / "docs" / "verification"
sys.path.insert(0, str(VERIFICATION))
import figures  # noqa: E402
from pages import annulus as annulus_page  # noqa: E402
from pages import beam as beam_page  # noqa: E402
from pages import compaction as compaction_page  # noqa: E402
from pages import drawing, runs  # noqa: E402


@pytest.mark.parametrize("draw", [figures.draw_points, figures.draw_domains], ids=["points", "domains"])
def test_figures(beam, tmp_path, draw):
    path = tmp_path / "figure.png"
    draw(beam.directory, 2, "cauchy_stress", "XX", path)
    assert path.stat().st_size < 150_000
    pixels = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3).astype(int)
    coloured = np.ptp(pixels, axis=1) > 60
    grey = (pixels == pixels[:, :1]).all(axis=1) & (np.abs(pixels[:, 0] - 217) <= 2)
    assert coloured.sum() > 300 and grey.sum() > 300


def test_missing_steps_and_fields_are_named(beam, tmp_path):
    with pytest.raises(KeyError, match="no load step 99"):
        figures.draw_points(beam.directory, 99, "cauchy_stress", "XX", tmp_path / "no.png")
    with pytest.raises(KeyError, match="no field stress"):
        figures.draw_points(beam.directory, 1, "stress", "XX", tmp_path / "no.png")
    # A scalar has no component to choose.
    figures.draw_points(beam.directory, 1, "von_mises_stress", None, tmp_path / "scalar.png")


def test_texts_of_drawings_keep_their_digits(tmp_path):
    figure, ((axes,),) = drawing.panels(1, 1, 3, 2)
    axes.set_title("h = 0.12345 m")
    axes.plot([0, 1], [0, np.pi])
    drawing.save_svg(figure, tmp_path / "drawing.svg")
    text = (tmp_path / "drawing.svg").read_text()
    assert "h = 0.12345 m" in text
    assert not re.search(r"\d\.\d{3}", re.sub(r">[^<]*<", "><", text).split("</defs>", 1)[1])


def test_a_run_is_made_once_and_a_deck_that_cannot_run_is_an_error(program, tmp_path):
    made = runs.Runs(program, tmp_path)
    first = made("compaction", h=25, n=1, method="mpm", update="corners", every=0)
    time = (first / "summary.json").stat().st_mtime_ns
    assert made("compaction", h=25, n=1, method="mpm", every=0) == first
    assert (first / "summary.json").stat().st_mtime_ns == time
    changed = made("compaction", h=25, n=1, update="none", every=0, **runs.DOMAIN_VOLUME)
    assert changed != first and runs.summary(changed)["parameters"]["volume"] == "domain"
    with pytest.raises(RuntimeError, match="nonsense"):
        made("compaction", nonsense=1)


def test_active_cells_after_the_last_step_hold_the_points(beam):
    """The cells of step n + 1 hold the points of step n; `grid_NNNN.vtu` has them where that step was written."""
    for step in (0, 1, 19):
        expected = figures.quads(figures.mesh_of_step(beam.directory, "grid", step + 1))
        ours = drawing.occupied_cells(beam.directory, step, 0.5)
        middles = lambda cells: {tuple(np.round(cell.mean(axis=0), 6)) for cell in cells}
        assert middles(ours) == middles(expected)


def test_oscillations_of_stress_fall_with_more_points(analyse):
    """Figures 12 and 14: tension above, compression below, and fewer oscillations with more points."""
    rough = []
    for n in (2, 3, 6, 9):
        out = analyse("inputs/beam.yaml", h=0.25, n=n, method="mpm", every=50).directory
        share, largest = beam_page.roughness(out)
        rough.append(share)
        mesh = figures.mesh_of_step(out, "points", -1)
        original = np.asarray(mesh.points) - np.asarray(mesh.point_data["displacement"])
        stress = drawing.stress_values(out, -1, "XX")
        root = original[:, 0] < 1
        assert stress[root & (original[:, 1] > 9.75)].mean() > 1e6
        assert stress[root & (original[:, 1] < 9.25)].mean() < -1e6
    print("rough part of the horizontal stress:", rough)
    assert all(later < 0.8 * before for before, later in zip(rough, rough[1:]))
    assert len(beam_page.points_in_nearly_empty_cells(out, 0.25, 2)) == 2


def test_stress_concentrates_at_the_loaded_points(analyse):
    """Figure 16: the largest vertical stress of the end of the beam is at A, beside the two loaded points."""
    out = analyse("inputs/beam.yaml", h=0.25, n=6, method="gimp", update="corners", every=50).directory
    mesh = figures.mesh_of_step(out, "points", -1)
    original = np.asarray(mesh.points)[:, :2] - np.asarray(mesh.point_data["displacement"])[:, :2]
    stress = drawing.stress_values(out, -1, "YY")
    end = original[:, 0] > 9.5
    highest = np.where(end, stress, -np.inf).argmax()
    assert np.hypot(*(original[highest] - [10, 9.5])) < 0.1
    assert stress[highest] > 5 * np.median(stress[end]) > 0


def test_the_body_force_drawn_is_the_one_applied(analyse):
    """Figure 18: the formulas of the deck, evaluated by the script, balance the reactions in every step."""
    out = analyse("inputs/annulus.yaml", segments=36, n=16, every=1).directory
    balances = [annulus_page.unbalanced_moment(out, step) for step in range(1, 11)]
    assert np.abs(balances).max() < 1e-8
    assert abs(annulus_page.unbalanced_moment(out, 10, factor=0.99)) > 1e-3


def test_closed_form_of_the_soft_column():
    """Figure 8: the stretch of each part of the column is the slope of its height."""
    height, stress = compaction_page.exact_profile(10e3)
    original = 50 + stress / 800
    stretch = np.gradient(height, original)
    inside = slice(5, -5)
    assert np.allclose((10e3 * np.log(stretch) / stretch)[inside], stress[inside], atol=10)
    assert original[0] == pytest.approx(0, abs=1e-9) and stress[-1] == 0
    assert height[-1] == pytest.approx(24.060, abs=1e-3)


COVERAGE = (VERIFICATION / "README.md").read_text().split("## Every table and figure")[1]
ROWS = re.findall(r"^\| ((?:Table|Figure)s? [^|]*?) \|([^|]*)\|([^|]*)\|([^|]*)\|$", COVERAGE, re.M)


def numbers(text):
    """Tables and figures named in a text such as `Figures 4, 5`, `Figures 12 to 17`."""
    kind = "Table" if "Table" in text else "Figure"
    found = {int(n) for n in re.findall(r"\d+", text)}
    for low, high in re.findall(r"(\d+) to (\d+)", text):
        found |= set(range(int(low), int(high) + 1))
    return {(kind, n) for n in found}


def test_the_gallery_covers_every_table_and_figure():
    covered = set().union(*(numbers(row[0]) for row in ROWS))
    assert covered == {("Table", n) for n in range(2, 9)} | {("Figure", n) for n in range(4, 23)}


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_the_tests_that_the_gallery_names_exist(row):
    named = re.findall(r"`([\w/.]+)`: ((?:`\w+`(?:, )?)+)", row[3])
    assert named or "no test" in row[3], row[3]
    for file, names in named:
        source = (ROOT / file).read_text()
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"\b(fn|def|mod) {name}\b", source), f"{file}: {name}"


@pytest.mark.parametrize("picture", sorted([*VERIFICATION.glob("*.png"), *VERIFICATION.glob("*.svg")]), ids=lambda p: p.name)
def test_every_picture_is_small_and_shown(picture):
    assert picture.stat().st_size < 150_000
    assert any(f"]({picture.name})" in page.read_text() for page in VERIFICATION.glob("*.md"))
