"""Convergence studies: a quantity on several grids, with an error bar."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm import _mpm
from mpm._deck import Deck, Overrides, StrPath, Value, _directory, _parameter, _setting
from mpm._errors import SolveError, UsageError
from mpm._run import Run

#: Errors whose cost is stated without ``to``, as by ``mpm converge``.
_USUAL_ERRORS = (0.02, 0.01)
#: Largest number of halvings with ``to``.
_MAX_HALVINGS = 4


@dataclass(frozen=True)
class GridRun:
    """The run of a convergence study on one grid.

    Attributes:
        label: What distinguishes the grid, such as ``h=0.5``.
        directory: Name of its results directory.
        size: Size of the cells, [length].
        points: Number of points, or ``None``.
        value: The quantity.
        within: Distance within which the run knows the quantity: half the width of a bracket.
        cpu_seconds: CPU time, [second].
    """

    label: str
    directory: str
    size: float
    points: float | None
    value: float
    within: float
    cpu_seconds: float


@dataclass(frozen=True)
class Convergence:
    """A quantity on several grids, and the value it tends to.

    Attributes:
        quantity: The quantity, as it was asked for.
        value: The extrapolated value, or that on the finest grid if ``trend`` is not ``"order"``.
        bar: Half the length of the error bar, or ``None`` if nothing can be concluded.
        order: Order of convergence, or ``None``.
        trend: ``"order"``, ``"settled"``, ``"no-order"`` or ``"refused"``.
        why: Why there is no order, or no conclusion; otherwise ``None``.
        grids: The runs from coarse to fine.
        moved: The run on a grid with its inner lines moved, or ``None``.
        not_moved: Why lines are not moved along all axes, or ``None``.
        predictions: For wanted errors, the ``size`` of the cells relative to the finest grid and the ``cpu_seconds``.
        conclusion: The conclusion in a sentence.
    """

    quantity: str
    value: float
    bar: float | None
    order: float | None
    trend: str
    why: str | None
    grids: list[GridRun]
    moved: GridRun | None
    not_moved: str | None
    predictions: list[dict[str, float]]
    conclusion: str

    @property
    def relative_bar(self) -> float | None:
        """The bar relative to the value, or ``None`` without a bar or for a value of zero."""
        return None if self.bar is None or self.value == 0 else self.bar / abs(self.value)

    def __str__(self) -> str:
        return self.conclusion


def converge(
    deck: Deck,
    quantity: str,
    *,
    to: float | None = None,
    over: tuple[str, Sequence[Value]] | None = None,
    threads: int | None = None,
    out: StrPath | None = None,
    allow_libraries: bool = False,
) -> Convergence:
    """Runs a deck on coarse and fine grids, and states a quantity with an error bar, as ``mpm converge``.

    The grids have four times, twice and once the cell size of the deck, or, if the deck cannot be used with so much
    larger cells, smaller ones. A further run on the middle grid has its inner grid lines moved.

    Args:
        deck: The deck.
        quantity: A column of the history, whose last value counts; ``largest:COLUMN`` for its value of largest
            magnitude; ``factor_of_safety``; ``limit_load``; or an extent of a body, as in the table of ``mpm sweep``.
        to: Wanted error relative to the value: the cells are halved, at most four times and as long as
            the bar shrinks, until the bar is as small.
        over: Name of the parameter that refines the grid, and at least three values from coarse to fine; by default, the
            parameter that sets the cell size, or the spacing of the grid.
        threads: Number of threads; by default, one per core.
        out: Directory for the results, with ``convergence_study.json``, ``convergence_study.csv`` and
            ``convergence.html``; without it, nothing is kept.
        allow_libraries: Whether the libraries that the deck names may be loaded, as for :meth:`Deck.start`.

    Raises:
        DeckError: The deck cannot be used.
        SolveError: A run ended early.
        UsageError: The results have no such quantity, no grids are found, or an argument is wrong.

    Example:
        >>> deck = mpm.Deck.load("inputs/beam.yaml", steps=10)
        >>> study = mpm.converge(deck, "tip_uy", threads=1)
        >>> [run.label for run in study.grids], study.trend
        (['h=0.5', 'h=0.25', 'h=0.125'], 'order')
        >>> print(study)
        `tip_uy` tends to -8.28692 ± 0.014 (0.17 %), with order 1.71
    """
    if not isinstance(deck, Deck):
        raise UsageError(f"a study needs a Deck, not {type(deck).__name__}")
    if not isinstance(quantity, str):
        raise UsageError(f"the quantity must be a name, not {quantity!r}")
    if to is not None and not (isinstance(to, float) and 1e-9 <= to < 1):
        raise UsageError(f"to must be an error relative to the value, such as 0.02, not {to!r}")
    axis = None
    if over is not None:
        if not isinstance(over, (tuple, list)) or len(over) != 2 or isinstance(over[1], (str, bytes)):
            raise UsageError("over must be the name of a parameter and a list of its values")
        axis = (over[0], [_setting(_parameter(over[0], value)) for value in over[1]])
    text, overrides = deck._source()
    grids = _mpm.Grids(deck._name, text, overrides, quantity, axis, allow_libraries)
    directory = _directory(out)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()) if directory is None else directory)

        def solve(parts: tuple[str, bytes, Overrides], is_moved: bool = False) -> None:
            name, text, overrides = parts
            target, member = folder / name, deck.copy()
            member._given = text, overrides
            with Run._begin(member, threads, target, None, allow_libraries, None) as run:
                for _ in run:
                    pass
            grids.read(target, is_moved)

        for parts in grids.decks():
            solve(parts)
        moved = grids.move_lines()
        if moved is not None:
            # The other grids have a conclusion without this run.
            try:
                solve(moved, is_moved=True)
            except SolveError:
                grids.leave_moved(None)
            except UsageError as error:
                grids.leave_moved(f"on the moved grid, {error}")
        errors = list(_USUAL_ERRORS) if to is None else [to]
        kept = None if directory is None else folder
        study = _read(grids.conclude(errors, kept))
        for _ in range(_MAX_HALVINGS if to is not None else 0):
            if study.relative_bar is None or to is None or study.relative_bar <= to:
                break
            before = study.bar
            solve(grids.halve())
            study = _read(grids.conclude(errors, kept))
            if before is None or study.bar is None or study.bar >= before:
                break
    return study


def _read(concluded: tuple[str, str]) -> Convergence:
    document, conclusion = concluded
    found: dict[str, Any] = json.loads(document)
    estimate = found["estimate"]
    return Convergence(
        quantity=found["quantity"],
        value=estimate["value"],
        bar=estimate["bar"],
        order=estimate["order"],
        trend=estimate["trend"]["kind"],
        why=estimate["trend"].get("why"),
        grids=[GridRun(**run) for run in found["grids"]],
        moved=None if found["moved"] is None else GridRun(**found["moved"]),
        not_moved=found["not_moved"],
        predictions=found["predictions"],
        conclusion=conclusion,
    )
