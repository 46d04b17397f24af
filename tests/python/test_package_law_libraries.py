"""Decks with laws from shared libraries in Python."""

import numpy as np
import pytest

from package import mpm
from test_law_libraries import ELASTIC, FAULTY, LAWS, PLASTIC, block, compiled, consent, deck, library_law

__all__ = ["consent", "deck"]


def test_a_library_needs_consent(deck, tmp_path, monkeypatch):
    monkeypatch.delenv("MPM_ALLOW_LIBRARIES")
    monkeypatch.chdir(tmp_path)
    compiled(LAWS / "law.c", tmp_path / "law.so")
    one = mpm.Deck.load(deck(block(**library_law("law.so", **PLASTIC))))
    for refused in (lambda: one.run(progress=False), lambda: one.start()):
        with pytest.raises(mpm.DeckError, match="(?s)D061.*allow_libraries=True"):
            refused()
    assert [found.code for found in one.check() if found.severity == "error"] == ["D061"]
    assert not [found for found in one.check(allow_libraries=True) if found.severity == "error"]
    result = one.run(progress=False, allow_libraries=True)
    with one.start(allow_libraries=True) as run:
        next(run)
        run.change()
    again = mpm.sweep(mpm.Deck({**one, "parameters": {"n": 1}}), {"n": [1]}, processes=1, allow_libraries=True)
    assert len(again[0].result.history["step"]) == len(result.history["step"])


def test_a_deck_runs_with_a_library(deck, tmp_path):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    path = deck(block(**library_law("law.so", **PLASTIC)))
    some = mpm.Deck.load(path).run(progress=False)
    other = mpm.Deck(block(model="von-mises", **PLASTIC)).run(progress=False)
    np.testing.assert_allclose(some.points.position, other.points.position, rtol=0, atol=1e-11)
    strains = [run.points["equivalent_plastic_strain"] for run in (some, other)]
    np.testing.assert_allclose(*strains, rtol=0, atol=1e-11)
    assert [library["material"] for library in some.summary["law_libraries"]] == ["clay"]


def test_a_law_in_python_takes_the_place_of_that_of_a_library(deck, tmp_path):
    content = block(**library_law("nowhere.so", **ELASTIC))
    law = mpm.BuiltInLaw("hencky", **ELASTIC)
    path = deck(content)
    some = mpm.Deck.load(path).run(laws={"clay": law}, progress=False)
    other = mpm.Deck(block(model="hencky", **ELASTIC)).run(progress=False)
    np.testing.assert_allclose(some.points.position, other.points.position, rtol=0, atol=1e-11)
    assert "law_libraries" not in some.summary
    with pytest.raises(mpm.DeckError, match="D061"):
        mpm.Deck.load(path).run(progress=False)


def test_parameters_of_a_library_change_between_steps(deck, tmp_path):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    largest = {}
    strong = PLASTIC | {"deviatoric_yield_stress": 1e9}
    with mpm.Deck.load(deck(block(**library_law("law.so", **strong)))).start() as run:
        for step in run:
            largest[step.index] = np.abs(run.points["cauchy_stress"]).max()
            if step.index == 1:
                run.deck["materials"]["clay"]["parameters"]["young"] = 2e6
                run.change()
            if step.index == 2:
                break
    assert 2.5 < largest[2] / largest[1] < 3.5, "the same stress, and one more step at twice the stiffness"


def test_a_law_without_an_inverse_keeps_its_elasticity(deck, tmp_path):
    compiled(FAULTY, tmp_path / "law.so")
    with mpm.Deck.load(deck(block(**library_law("law.so", **ELASTIC)))).start() as run:
        next(run)
        run.change()
        run.deck["materials"]["clay"]["parameters"]["young"] = 2e6
        with pytest.raises(mpm.UsageError, match="material of `block` cannot carry its stress: the law cannot compute"):
            run.change()
        next(run)


def test_a_library_that_changes_in_a_session_is_refused(deck, tmp_path):
    compiled(FAULTY, tmp_path / "changing.so")
    path = deck(block(**library_law("changing.so", **ELASTIC)))
    mpm.Deck.load(path).run(progress=False)
    (tmp_path / "changing.so").unlink()
    compiled(FAULTY, tmp_path / "changing.so", "-DREFUSES=1")
    with pytest.raises(mpm.DeckError, match="it has changed since this program loaded it"):
        mpm.Deck.load(path).run(progress=False)


def test_built_in_laws_are_those_of_the_program():
    with pytest.raises(mpm.UsageError):
        mpm.BuiltInLaw("library", young=1e6)
