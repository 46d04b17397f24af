"""The rigid tools and the contacts between bodies of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Contacts:
    """The n contact points that touch a tool or another body: corners and centres of domains.

    Attributes:
        position: Position, shape (n, axes), [length].
        normal: Unit normal out of the tool, shape (n, axes), [-].
        force: Force of the tool on the body, shape (n, axes), [force].
        pressure: Pressure, negative for tension, shape (n,), [stress].
        shear: Shear stress on the body, shape (n, axes), [stress].
        area: Area that the contact point represents, shape (n,), [area].
        state: ``"stick"``, ``"slip"`` or ``"parting"``, shape (n,).
        point: Permanent number of the material point, shape (n,).
        body: Number of the body in the deck, from 0, shape (n,).
        edge: Number of the side of the tool, as in the deck, shape (n,).
    """

    position: Array
    normal: Array
    force: Array
    pressure: Array
    shear: Array
    area: Array
    state: npt.NDArray[np.str_]
    point: npt.NDArray[np.int64]
    body: npt.NDArray[np.int64]
    edge: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pressure)

    def __repr__(self) -> str:
        return f"<Contacts: {len(self)}>"


@dataclass(frozen=True, eq=False)
class ToolPart:
    """A named part of a tool at the end of a step.

    Attributes:
        force: Force of the part on the bodies, shape (axes,), [force].
        moment: Moment of this force about the reference point of the tool, shape (3,), [force·length].
        n_contacts: Number of contact points that touch the part.
    """

    force: Array
    moment: Array
    n_contacts: int


@dataclass(frozen=True, eq=False)
class Tool:
    """A rigid tool at the end of a step.

    Attributes:
        position: Position of the reference point, shape (axes,), [length].
        displacement: Displacement of the reference point since the start, shape (axes,), [length].
        rotation: Rotation vector since the start, shape (3,), [rad]; in the plane, the last component is the angle.
        force: Force of the tool on the bodies, shape (axes,), [force].
        moment: Moment of this force about the reference point, shape (3,), [force·length].
        overlap: Largest overlap with a body that remains after the contact forces have acted, [length].
        allowed_overlap: Largest further overlap, allowed because the update of domain boxes caused it, [length].
        parts: The named parts of the tool.
        contacts: The contact points that touch the tool.

    Example:
        >>> pipe = {"name": "pipe", "shape": {"type": "circle", "center": [3, 3.5], "radius": 0.5}, "uy": -0.1}
        >>> pipe["parts"] = {"left": {"box": {"min": [2, 2], "max": [2.99, 4]}}}
        >>> deck = mpm.Deck({
        ...     "version": 1,
        ...     "grid": {"type": "structured", "origin": [0, 0], "size": [6, 5], "spacing": 0.25},
        ...     "materials": {"rubber": {"model": "hencky", "young": 1e6, "poisson": 0.3}},
        ...     "bodies": [{"name": "ground", "material": "rubber", "method": "gimp", "points_per_cell": 2,
        ...                 "shape": {"type": "box", "min": [0, 0], "max": [6, 3]}}],
        ...     "boundary_conditions": [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}],
        ...     "tools": [pipe],
        ...     "steps": {"count": 2},
        ... })
        >>> with deck.start(threads=1) as run:
        ...     for step in run:
        ...         tool = run.tools["pipe"]
        >>> tool.position, bool(tool.force[1] < tool.parts["left"].force[1] < 0)
        (array([3. , 3.4]), True)
        >>> tool.contacts.position.shape == (len(tool.contacts), 2)
        True
    """

    position: Array
    displacement: Array
    rotation: Array
    force: Array
    moment: Array
    overlap: float
    allowed_overlap: float
    parts: dict[str, ToolPart]
    contacts: Contacts


@dataclass(frozen=True, eq=False)
class BodyPair:
    """Two bodies in contact at the end of a step.

    Attributes:
        force: Force of the first body on the second, shape (axes,), [force].
        area: Area over which they touch, [area].
        overlap: Largest overlap that remains after the contact forces have acted, [length].
        slip: Largest slip in the step where the bodies stick, [length].
        contacts: The contact points of both bodies that touch; force and shear act on the body of the contact point,
            and the normal points out of the other body.
        gaps: Gap at each contact point, negative for an overlap, shape (n,), [length].
        slips: Motion of each contact point along the other body in the step, shape (n,), [length].
    """

    force: Array
    area: float
    overlap: float
    slip: float
    contacts: Contacts
    gaps: Array
    slips: Array


def pairs_of(document: dict[str, Any]) -> dict[str, BodyPair]:
    """The contacts between bodies in the document of a step."""
    return {name: _pair(of) for name, of in document.items()}


def _pair(of: dict[str, Any]) -> BodyPair:
    return BodyPair(
        force=np.array(of["force"], dtype=float),
        area=of["area"],
        overlap=of["overlap"],
        slip=of["slip"],
        contacts=_contacts(of["contacts"], len(of["force"])),
        gaps=np.array(of["gaps"], dtype=float),
        slips=np.array(of["slips"], dtype=float),
    )


def tools_of(document: dict[str, Any]) -> dict[str, Tool]:
    """The tools in the document of a step."""
    return {name: _tool(of) for name, of in document.items()}


def _tool(of: dict[str, Any]) -> Tool:
    arrays = {key: np.array(of[key], dtype=float) for key in ("position", "displacement", "rotation", "force", "moment")}
    parts = {
        name: ToolPart(np.array(part["force"]), np.array(part["moment"]), part["n_contacts"])
        for name, part in of["parts"].items()
    }
    axes = len(of["position"])
    contacts = _contacts(of["contacts"], axes)
    return Tool(**arrays, overlap=of["overlap"], allowed_overlap=of["allowed_overlap"], parts=parts, contacts=contacts)


def _contacts(lists: dict[str, Any], axes: int) -> Contacts:
    return Contacts(**{key: _column(key, values, axes) for key, values in lists.items()})


def _column(key: str, values: list[Any], axes: int) -> npt.NDArray[Any]:
    """An array of the right shape, even if nothing touches the tool."""
    if key in ("position", "normal", "force", "shear"):
        return np.array(values, dtype=float).reshape(len(values), axes)
    kinds: dict[str, npt.DTypeLike] = {"state": np.str_, "point": np.int64, "body": np.int64, "edge": np.int64}
    return np.array(values, dtype=kinds.get(key, np.float64))
