"""Clay that flows around a buried pipe, beside the bounds of Randolph and Houlsby (1984): a study of `benches/tools.py`."""

import importlib.util
import sys

import pytest

from conftest import ROOT

sys.path.append(str(ROOT / "benches"))
# The tests have a module of their own with the name `tools`.
SPEC = importlib.util.spec_from_file_location("study_of_tools", ROOT / "benches" / "tools.py")
tools = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(tools)


@pytest.fixture(scope="module")
def load(program, tmp_path_factory):
    """Force over D s_u for an interface and a mesh with this number of cells along the half circle."""
    folder = tmp_path_factory.mktemp("pipe")

    def run(interface, cells):
        mesh = folder / f"ring_{cells}.msh"
        mesh.write_text(tools.decks.ring(cells, 10, False))
        deck = tools.filled(tools.decks.PIPE, MESH=mesh, POINTS="points_per_cell")
        found, outcome = tools.tried(program, folder, deck, **tools.INTERFACES[interface][1])
        assert outcome == "completed"
        return -found.column("pipe_fy")[-1] / 1000

    return run


def test_a_smooth_pipe(load):
    assert load("smooth", 48) == pytest.approx(9.142, rel=0.01)


def test_a_pipe_with_half_the_strength_of_the_clay(load):
    assert load("α = 0.5", 24) == pytest.approx(tools.full_flow(0.5), rel=0.01)


def test_a_rough_pipe(load):
    """The error is of first order."""
    coarse, fine = load("rough", 24), load("rough", 48)
    assert 2 * fine - coarse == pytest.approx(11.940, rel=0.01)
    assert 0 < fine - 11.940 < 0.55 * (coarse - 11.940)
