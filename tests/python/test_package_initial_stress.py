"""Laws in Python for bodies that are stressed from the beginning."""

import numpy as np
import pytest

from laws_in_python import Hencky
from package import load, mpm


class Inverse(Hencky):
    """Says which elastic strain gives a stress."""

    def elastic_strain(self, stress):
        return np.linalg.solve(self.elastic_tangent(), np.asarray(stress).T).T


def ground():
    deck = load("excavation", h=0.5)
    deck["materials"]["clay"] = {"model": "hencky", "young": 20e6, "poisson": 0.3, "density": 1800}
    return deck


def test_a_law_in_python_carries_an_initial_stress():
    built_in = ground().run(threads=1, progress=False)
    own = ground().run(threads=1, progress=False, laws={"clay": Inverse(young=20e6, poisson=0.3)})
    a, b = built_in.points, own.points
    for name in ("position", "cauchy_stress"):
        difference = np.abs(a[name] - b[name]).max() / np.abs(a[name]).max()
        assert difference < 1e-12, name
    assert built_in.summary["steps"] == own.summary["steps"]


def test_a_law_without_inverse_is_refused():
    with pytest.raises(mpm.DeckError) as raised:
        ground().start(laws={"clay": Hencky(young=20e6, poisson=0.3)})
    assert raised.value.code == "D051"
