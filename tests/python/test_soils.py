"""Soil laws in boundary-value problems beside closed forms and published numbers: studies of `benches/soils.py`, coarse."""

import sys

import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))
import soils  # noqa: E402
import soils_decks as decks  # noqa: E402


@pytest.mark.parametrize("h", [1, pytest.param(0.5, marks=pytest.mark.long)])
def test_the_slope_of_griffiths_and_lane_has_its_factor_of_safety(program, tmp_path, h):
    found = soils.run(program, tmp_path, decks.SLOPE, h=h, n=2, method="mpm", steps=30, after_slide="continue")
    bounds = found.summary["strength_reduction"]
    factor = soils.factor_at(found, 0.01)
    assert abs(factor / 1.40 - 1) < 0.03
    assert factor < bounds["fails"] and bounds["stands"] < bounds["fails"] <= bounds["stands"] + 0.002


@pytest.mark.parametrize("ratio, published, bound", [(1, 1.47, 0.02), (2, 2.10, 0.08)])
def test_an_undrained_slope_on_a_foundation_has_its_factor_of_safety(program, tmp_path, ratio, published, bound):
    deck = soils.filled(decks.CLAY_SLOPE, REGION=decks.FOUNDATION)
    found = soils.run(program, tmp_path, deck, h=2, ratio=ratio, steps=30)
    assert abs(soils.factor_at(found, 0.01) / published - 1) < bound


@pytest.mark.parametrize("ratio, published", [(0.8, 1.45), (0.6, 1.40)])
def test_a_slope_with_a_thin_weak_layer_has_its_factor_of_safety(program, tmp_path, ratio, published):
    deck = soils.filled(decks.CLAY_SLOPE, REGION=decks.WEAK_LAYER)
    found = soils.run(program, tmp_path, deck, h=1, ratio=ratio, to=1.6, steps=30)
    assert abs(soils.factor_at(found, 0.01) / published - 1) < 0.03


def bearing_error(program, folder, h, **settings):
    deck = soils.strip_deck(h, 8, 4, (4, 2))
    return soils.strip_loads(soils.run(program, folder, deck, **settings))[-1] / soils.n_c(20) - 1


def test_one_point_per_cell_finds_the_bearing_capacity_of_dilatant_ground(program, tmp_path):
    assert abs(bearing_error(program, tmp_path, 0.5, n=1, to=0.0005, steps=6)) < 0.01


def test_more_points_find_a_bearing_capacity_that_falls_with_the_cells(program, tmp_path):
    coarse, fine = (bearing_error(program, tmp_path, h, to=0.0004, steps=6) for h in (0.5, 0.25))
    assert 0 < fine < 0.6 * coarse < 0.17


@pytest.mark.parametrize("phi, psi, law", [
    (0, 0, "model: tresca"),
    (30, 0, "model: mohr-coulomb, friction_angle: 30"),
    (30, 30, "model: mohr-coulomb, friction_angle: 30, dilation_angle: 30"),
])
def test_a_thick_cylinder_carries_the_pressure_of_its_present_shape(program, tmp_path, phi, psi, law):
    h = 0.0625
    deck = soils.filled(decks.CYLINDER, MODEL=law)
    found = soils.run(program, tmp_path, deck, h=h, to=0.2, steps=10)
    rows = list(zip(found.column("inside_ux"), found.column("load_factor")))
    assert rows[-1][0] == pytest.approx(0.2)
    for moved, load in rows:
        if moved > 0.049:
            assert load == pytest.approx(soils.cylinder_pressure(phi, psi, 1 + h / 4, moved), rel=6e-3)


@pytest.mark.parametrize("path", soils.PATHS)
@pytest.mark.parametrize("method, treatment", [("mpm", "mean-dilatation"), ("cpdi2", "standard")])
def test_a_block_of_cam_clay_has_the_stresses_of_the_element_test(program, tmp_path, path, method, treatment):
    settings = {"method": method, "volumetric": treatment}
    of_stress, of_preconsolidation, stress, _ = soils.block_errors(program, tmp_path, path, **settings)
    assert of_stress < 1e-10 and of_preconsolidation < 1e-10
    assert (stress < 0).all()


# With one column, all points share a cell across; with several, the side leaves the grid line that it starts on.
@pytest.mark.parametrize("test", soils.PRESSED)
@pytest.mark.parametrize("method, columns", [("mpm", 2), ("gimp", 2), ("cpdi2", 2), ("cpdi2", 0.25)])
def test_cam_clay_under_a_constant_pressure_has_the_stresses_of_the_element_test(program, tmp_path, test, method, columns):
    settings = {"method": method, "columns": columns, "volumetric": "standard"}
    of_stress, of_preconsolidation, stress, _ = soils.pressed_errors(program, tmp_path, test, **settings)
    assert of_stress < 1e-10 and of_preconsolidation < 1e-10
    assert stress[0] == pytest.approx(-60e3) and stress[1] < 2 * stress[0]
