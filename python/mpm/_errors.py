"""Messages about decks, and the exceptions of the package, with their codes and remedies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Diagnostic:
    """A message about a deck.

    Attributes:
        code: The code, such as ``"D014"``; ``mpm explain D014`` explains it.
        severity: ``"error"``, ``"warning"`` or ``"note"``.
        message: The fault.
        pointer: JSON pointer to the value concerned, such as ``"/bodies/0/shape/min"``, or ``None``.
        line: Line in the text of the deck, from 1, or ``None``.
        column: Column in that line, from 1, or ``None``.
        help: The remedy, or ``None``.
        notes: Further information.

    Example:
        >>> deck = mpm.Deck.load("inputs/footing.yaml")
        >>> deck["steps"]["cuont"] = deck["steps"].pop("count")
        >>> found = deck.check()[0]
        >>> found.code, found.severity, found.message
        ('D006', 'error', 'unknown key `cuont`')
    """

    code: str
    severity: str
    message: str
    pointer: str | None = None
    line: int | None = None
    column: int | None = None
    help: str | None = None
    notes: tuple[str, ...] = field(default=())

    def __str__(self) -> str:
        place = "" if self.line is None else f" (line {self.line})"
        remedy = "" if self.help is None else f"; {self.help}"
        return f"{self.severity}[{self.code}]{place}: {self.message}{remedy}"


def diagnostics_of(document: str) -> list[Diagnostic]:
    """The messages in a document like that printed by ``mpm check --format json``."""
    return [_diagnostic(entry) for entry in json.loads(document)["diagnostics"]]


def _diagnostic(entry: dict[str, Any]) -> Diagnostic:
    return Diagnostic(
        code=entry["code"],
        severity=entry["severity"],
        message=entry["message"],
        pointer=entry.get("path"),
        line=entry.get("line"),
        column=entry.get("column"),
        help=entry.get("help"),
        notes=tuple(entry.get("notes") or ()),
    )


class MpmError(Exception):
    """Base class of all exceptions of this package.

    Attributes:
        code: The code of the error, such as ``"S001"``, or ``None``.
        help: The remedy, or ``None``.
    """

    code: str | None = None
    help: str | None = None


class DeckError(MpmError):
    """A deck that cannot be used.

    Attributes:
        diagnostics: All messages about the deck; at least one is an error.

    Example:
        >>> try:
        ...     mpm.Deck({"version": 1}).run()
        ... except mpm.DeckError as error:
        ...     print(error.code, len(error.diagnostics), error.diagnostics[0].message)
        D007 3 missing key `bodies` at the top of the deck
    """

    def __init__(self, document: str, text: str) -> None:
        super().__init__(document, text)
        self.diagnostics = diagnostics_of(document)
        errors = [found for found in self.diagnostics if found.severity == "error"]
        if errors:
            self.code, self.help = errors[0].code, errors[0].help
        self._text = text

    def __str__(self) -> str:
        return self._text


class SolveError(MpmError):
    """An analysis that ended early. The points are in the state of the last converged step.

    If a law written in Python has raised an exception, this exception is the cause (``__cause__``).

    Attributes:
        residuals: Relative out-of-balance force at every evaluation of the step that failed, [-].

    Example:
        >>> deck = mpm.Deck.load("inputs/footing.yaml", h=0.5)
        >>> deck["steps"]["smallest"], deck["solver"] = 1, {"max_iterations": 2}
        >>> with deck.start() as run:
        ...     try:
        ...         for step in run:
        ...             pass
        ...     except mpm.SolveError as error:
        ...         print(error.code, len(error.residuals))
        S001 3
    """

    def __init__(
        self,
        message: str,
        code: str | None = None,
        help: str | None = None,  # noqa: A002
        residuals: Sequence[float] = (),
    ) -> None:
        super().__init__(message, code, help, residuals)
        self.code, self.help, self.residuals = code, help, list(residuals)

    def __str__(self) -> str:
        code = "" if self.code is None else f"[{self.code}] "
        remedy = "" if self.help is None else f"\n  help: {self.help}"
        return f"{code}{self.args[0]}{remedy}"


class ResultsError(MpmError):
    """Result files that cannot be read or written."""

    def __init__(self, message: str, code: str | None = None) -> None:
        super().__init__(message, code)
        self.code = code

    def __str__(self) -> str:
        return str(self.args[0])


class UsageError(MpmError, ValueError):
    """A call that is not possible with these arguments or in the current state."""
