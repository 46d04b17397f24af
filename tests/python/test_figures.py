"""The script that draws the figures of the verification pages."""

import sys

import numpy as np
import pytest
from PIL import Image

from conftest import ROOT

sys.path.insert(0, str(ROOT / "docs" / "verification"))
import figures  # noqa: E402


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
