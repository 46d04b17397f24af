"""The rigid tools of runs of the package."""

import json

import numpy as np
import pytest

from package import mpm
from tools import PLOUGH


@pytest.fixture(scope="module")
def steps():
    """All steps of a run, with what its history says in the end."""
    with mpm.Deck(json.loads(json.dumps(PLOUGH))).start(threads=1) as run:
        assert run.tools == {}
        found = []
        for step in run:
            assert run.tools["plough"] is step.tools["plough"]
            found.append(step)
    return found, run.history


def test_tools_are_those_of_the_history(steps):
    steps, history = steps
    tools = [step.tools["plough"] for step in steps]
    assert history["plough_fy"][-1] < -1e3
    for axis, letter in enumerate("xy"):
        np.testing.assert_array_equal([tool.force[axis] for tool in tools], history[f"plough_f{letter}"])
        np.testing.assert_array_equal([tool.displacement[axis] for tool in tools], history[f"plough_u{letter}"])
        for part in ("left", "right", "far"):
            of_part = [tool.parts[part].force[axis] for tool in tools]
            np.testing.assert_array_equal(of_part, history[f"plough_{part}_f{letter}"])
    for part in ("left", "right"):
        moments = [tool.parts[part].moment for tool in tools]
        np.testing.assert_array_equal([moment[2] for moment in moments], history[f"plough_{part}_mz"])
        assert np.all(np.array(moments)[:, :2] == 0)
    np.testing.assert_array_equal([len(tool.contacts) for tool in tools], history["plough_contacts"])
    np.testing.assert_array_equal([tool.overlap for tool in tools], history["plough_overlap"])
    np.testing.assert_array_equal([tool.allowed_overlap for tool in tools], history["plough_allowed_overlap"])
    np.testing.assert_allclose(tools[-1].position, [3.05, 2.8])
    assert tools[-1].rotation.tolist() == [0, 0, 0]


def test_contacts_add_up_to_the_forces(steps):
    tool = steps[0][-1].tools["plough"]
    contacts = tool.contacts
    n = len(contacts)
    assert n >= 2 and contacts.position.shape == contacts.normal.shape == contacts.shear.shape == (n, 2)
    np.testing.assert_allclose(contacts.force.sum(axis=0), tool.force, rtol=1e-12)
    arms = contacts.position - tool.position
    moment = arms[:, 0] * contacts.force[:, 1] - arms[:, 1] * contacts.force[:, 0]
    np.testing.assert_allclose(moment.sum(), tool.moment[2], rtol=1e-9)
    stress = contacts.pressure[:, None] * contacts.normal + contacts.shear
    np.testing.assert_allclose(stress * contacts.area[:, None], contacts.force, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(contacts.normal, axis=1), 1)
    for name, edges in (("left", [3]), ("right", [0, 1])):
        is_on = np.isin(contacts.edge, edges)
        assert tool.parts[name].n_contacts == is_on.sum() > 0
        np.testing.assert_allclose(contacts.force[is_on].sum(axis=0), tool.parts[name].force, rtol=1e-12)
    assert tool.parts["far"].n_contacts == 0 and tool.parts["far"].force.tolist() == [0, 0]
    shear = np.linalg.norm(contacts.shear, axis=1)
    slides = contacts.state == "slip"
    assert set(contacts.state) <= {"stick", "slip"}
    np.testing.assert_allclose(shear[slides], 0.3 * contacts.pressure[slides], rtol=1e-3)
    assert np.all(shear <= 0.3 * contacts.pressure * (1 + 1e-3))
    assert contacts.point.dtype.kind == contacts.body.dtype.kind == "i" and np.all(contacts.body == 0)


def test_a_tool_that_touches_nothing_has_empty_arrays():
    deck = json.loads(json.dumps(PLOUGH))
    deck["tools"][0] |= {"ux": 0, "uy": 0.1}
    with mpm.Deck(deck).start(threads=1) as run:
        tool = next(run).tools["plough"]
    assert len(tool.contacts) == 0 and tool.contacts.position.shape == (0, 2) and tool.contacts.state.shape == (0,)
    assert tool.force.tolist() == [0, 0] and tool.overlap == 0
