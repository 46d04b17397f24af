"""The Python package under test, and what its tests share."""

import os

import numpy as np
import pytest

try:
    import mpm
except ImportError as error:
    if "MPM" in os.environ:
        raise
    pytest.skip(f"the package mpm cannot be imported: {error}", allow_module_level=True)

from conftest import ROOT

__all__ = ["COUNTS", "assert_same_points", "column", "load", "mpm", "worst"]

#: Entries of a summary that are the same in every run of a deck.
COUNTS = ("outcome", "steps", "iterations", "failed_attempts", "points", "external_work", "strain_energy")


def load(name, **parameters):
    """A deck of inputs/, from whatever directory."""
    return mpm.Deck.load(ROOT / "inputs" / f"{name}.yaml", **parameters)


def column(**changes):
    """A small deck with four points per cell in two cells, which is solved in milliseconds."""
    deck = mpm.Deck(
        {
            "version": 1,
            "grid": {"type": "structured", "origin": [0, 0], "size": [1, 4], "spacing": 1},
            "materials": {"clay": {"model": "hencky", "young": 1e6, "poisson": 0.3, "density": 1000}},
            "bodies": [
                {
                    "name": "column",
                    "material": "clay",
                    "points_per_cell": 2,
                    "shape": {"type": "box", "min": [0, 0], "max": [1, 2]},
                }
            ],
            "boundary_conditions": [
                {"name": "floor", "nodes": {"y": 0}, "fix": ["y"]},
                {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
                {"name": "right", "nodes": {"x": 1}, "fix": ["x"]},
            ],
            "loads": [{"name": "weight", "type": "gravity", "acceleration": [0, -10]}],
            "steps": {"count": 4},
        }
    )
    deck.update(changes)
    return deck


def assert_same_points(some, others):
    """All arrays have the same bits."""
    assert list(some) == list(others)
    for name in some:
        np.testing.assert_array_equal(some[name], others[name], err_msg=name, strict=True)


def worst(some, others, name):
    """The largest difference of an array of points, relative to its largest entry."""
    a, b = some[name], others[name]
    return np.abs(a - b).max() / np.abs(b).max()
