"""Parameter studies in several processes."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._deck import Deck, StrPath, Value, _directory, _parameter, _setting
from mpm._errors import MpmError, UsageError
from mpm._run import Result, _package

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    import pandas


@dataclass(frozen=True)
class Member:
    """One combination of parameter values in a study, and its outcome.

    Attributes:
        parameters: Its parameter values.
        result: Its result, or ``None`` if it failed.
        error: The message of its failure, or ``None``; the steps before the failure are not kept.
    """

    parameters: dict[str, Value]
    result: Result | None
    error: str | None


class Study(Sequence[Member]):
    """The members of a study: a sequence of :class:`Member`, the last parameter varying fastest.

    :func:`sweep` returns it.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self._members = list(members)

    @overload
    def __getitem__(self, index: int) -> Member: ...

    @overload
    def __getitem__(self, index: slice) -> Study: ...

    def __getitem__(self, index: int | slice) -> Member | Study:
        return Study(self._members[index]) if isinstance(index, slice) else self._members[index]

    def __iter__(self) -> Iterator[Member]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def __repr__(self) -> str:
        failed = sum(member.result is None for member in self._members)
        return f"<Study of {len(self)} members, {failed} failed>"

    def column(self, name: str) -> list[float | None]:
        """The value of a column of the history at the last converged step of each member.

        It is ``None`` for members that failed or that have no converged step.

        Args:
            name: Name of the column, such as ``tip_uy``.
        """
        return [None if of.result is None else _at_end(of.result.history, name) for of in self]

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per member: parameters, history at the last converged step, and error. Needs pandas.

        A parameter with the name of another column is named ``parameter_NAME``, as in the table of ``mpm sweep``.
        """
        histories = [{} if of.result is None else of.result.history for of in self]
        results = list(dict.fromkeys([name for history in histories for name in history] + ["error"]))
        rows = []
        for member, history in zip(self, histories):
            headings = _mpm.headings(list(member.parameters), results)
            parameters = dict(zip(headings, member.parameters.values()))
            rows.append({**parameters, **{name: _at_end(history, name) for name in history}, "error": member.error})
        return _package("pandas").DataFrame(rows)


def _at_end(history: Mapping[str, npt.NDArray[np.float64]], name: str) -> float | None:
    """The value of a column at the last converged step; failed attempts may follow it."""
    column, converged = history[name], np.flatnonzero(history["converged"] == 1)
    return float(column[converged[-1]]) if len(converged) else None


Work = tuple[Deck, dict[str, Value], int, Path | None, bool]
Outcome = tuple[Result | None, str | None]


def _solve(work: Work) -> Outcome:
    deck, parameters, threads, out, allow_libraries = work
    try:
        member = deck.with_parameters(**parameters)
        return member.run(out, threads=threads, allow_libraries=allow_libraries, progress=False), None
    except MpmError as error:
        return None, str(error)


#: Outcome of a member that was running, or waiting, when a process of the study ended.
_LOST = (
    None,
    "a process of the study ended before this member was solved: it was killed, perhaps for lack of memory",
)


def _begin(has_begun: Event) -> None:
    has_begun.set()


def _solve_in_processes(work: Sequence[Work], count: int) -> list[Outcome]:
    import multiprocessing
    from concurrent.futures import Future, ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    # A fresh interpreter: the threads of this one do not survive a fork.
    context = multiprocessing.get_context("spawn")
    has_begun = context.Event()
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(has_begun,))
    outcomes: list[Outcome] = []
    try:
        futures: list[Future[Outcome]] = []
        with contextlib.suppress(BrokenProcessPool):
            for entry in work:
                futures.append(pool.submit(_solve, entry))
        for future in futures:
            try:
                outcomes.append(future.result())
            except BrokenProcessPool:
                outcomes.append(_LOST)
    except BaseException:  # Ctrl-C: members that are running or waiting are abandoned
        for process in (pool._processes or {}).values():
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    outcomes += [_LOST] * (len(work) - len(outcomes))
    if _LOST in outcomes and not has_begun.is_set():
        raise UsageError(
            "the processes of the study failed to start; a script that calls sweep needs the guard "
            "`if __name__ == '__main__':`, since each process imports the script"
        )
    return outcomes


def sweep(
    deck: Deck,
    over: Mapping[str, Sequence[Value] | npt.NDArray[Any]],
    *,
    processes: int | None = None,
    threads: int = 1,
    out: StrPath | None = None,
    allow_libraries: bool = False,
) -> Study:
    """Runs a deck for every combination of parameter values, several at a time in separate processes.

    A member that fails does not end the study; its ``error`` is the message. If a process is killed, the members that
    it leaves unsolved fail. With one process, the members run in the calling process.

    A script that uses several processes must have its code under ``if __name__ == "__main__":``, since each process
    imports the script; notebooks need no such guard.

    Args:
        deck: The deck; it defines the parameters.
        over: Lists of values, by the names of the parameters.
        processes: Number of processes; by default, one per core, and at most one per member.
        threads: Number of threads of each process, from 1 to 1024.
        out: Directory in which each member has its own result directory, named as in ``mpm sweep``; without ``out``,
            nothing is written, and results from several processes have no points.
        allow_libraries: Whether the libraries that the deck names may be loaded, as for :meth:`Deck.start`.

    Returns:
        The members, in the order of the combinations; the last parameter varies fastest.

    Raises:
        UsageError: The deck lacks a parameter that ``over`` names, the values of one are not a list or are repeated, or
            another argument is wrong.

    Example:
        >>> deck = mpm.Deck.load("inputs/beam.yaml", steps=10)
        >>> study = mpm.sweep(deck, {"h": [0.5, 0.25], "n": [3, 6]}, processes=1)
        >>> [of.parameters for of in study][:2]
        [{'h': 0.5, 'n': 3}, {'h': 0.5, 'n': 6}]
        >>> [round(value, 3) for value in study.column("tip_uy")]
        [-8.177, -8.167, -8.25, -8.25]
    """
    if not isinstance(deck, Deck):
        raise UsageError(f"a study needs a Deck, not {type(deck).__name__}")
    if not isinstance(over, Mapping) or not over:
        raise UsageError("over must be a mapping of parameter names to lists of values")
    for name, values in over.items():
        if not isinstance(name, str):
            raise UsageError(f"over has the key {name!r}, which is not a parameter name")
        is_list = isinstance(values, (Sequence, np.ndarray)) and not isinstance(values, (str, bytes))
        if not is_list or getattr(values, "ndim", 1) != 1 or len(values) == 0:
            raise UsageError(f"the values of {name!r} must be a list that is not empty")
    if processes is not None and (isinstance(processes, bool) or not isinstance(processes, int) or processes < 1):
        raise UsageError(f"processes must be a whole number above 0, not {processes!r}")
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= _mpm.MAX_THREADS:
        raise UsageError(f"threads must be a whole number from 1 to {_mpm.MAX_THREADS}, not {threads!r}")
    lists = [[_parameter(name, value) for value in values] for name, values in over.items()]
    for name, values in zip(over, lists):
        _mpm.check_axis(name, [_setting(value) for value in values])
    combinations = [dict(zip(over, values)) for values in itertools.product(*lists)]
    for parameters in combinations[:1]:
        deck.with_parameters(**parameters)  # unknown names are found here, not in every process
    directory = _directory(out)
    folder = None if directory is None else Path(directory)
    work = [
        (deck, chosen, threads, folder and folder / _name(chosen), allow_libraries) for chosen in combinations
    ]
    count = min(processes or os.cpu_count() or 1, len(work))
    outcomes = [_solve(entry) for entry in work] if count == 1 else _solve_in_processes(work, count)
    return Study([Member(chosen, *outcome) for chosen, outcome in zip(combinations, outcomes)])


def _name(parameters: Mapping[str, Value]) -> str:
    """Directory name of a member, as in ``mpm sweep``.

    Characters that a file system might not accept are written as ``%`` and the hexadecimal value of the byte.
    """
    return ",".join(f"{name}={_escaped(_setting(value))}" for name, value in parameters.items())


def _escaped(value: str) -> str:
    return "".join(
        chr(byte) if chr(byte).isalnum() and byte < 128 or byte in b"._+-" else f"%{byte:02X}" for byte in value.encode()
    )
