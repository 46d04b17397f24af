"""The native module. The package wraps it; structured data cross the border as JSON, arrays as NumPy arrays."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, final

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]
_StrPath = str | os.PathLike[str]

__all__ = [
    "MAX_THREADS",
    "VERSION",
    "BuiltIn",
    "Session",
    "check",
    "check_axis",
    "conformance",
    "dump",
    "headings",
    "is_field_of_points",
    "main",
    "mesh",
    "read",
    "schema",
    "series",
    "table",
    "text_of_code",
]

MAX_THREADS: int
VERSION: str

class _Adapter(Protocol):
    """A law in Python as the library calls it: contiguous arrays of the right shapes."""

    #: Name, unit and initial value of each history variable.
    fields: list[tuple[str, str, float]]
    is_logarithmic: bool
    is_symmetric: bool

    def respond(self, strain: _Array, history: _Array, /) -> tuple[_Array, _Array, _Array, _Array]:
        """Stress, elastic strain, tangent and history of points with these trial strains and histories."""

    def energies(self, strain: _Array, history: _Array, /) -> tuple[_Array, _Array]:
        """Stored energy and plastic work per initial volume."""

    def invert(self, stress: _Array, /) -> _Array | None:
        """Elastic strain of points with these stresses; none if the law does not say."""

def main(arguments: list[str]) -> int:
    """Runs the program `mpm` with these arguments, the first of which is its name; returns the exit code."""

def read(path: _StrPath) -> tuple[bytes, str]:
    """The bytes of a deck and its values as JSON."""

def dump(document: str) -> str:
    """A deck, given as JSON, as YAML."""

def check(
    name: str, text: bytes, overrides: list[tuple[str, str]], allow_libraries: bool
) -> tuple[str, str]:
    """Everything up to the first load step: the messages about a deck as JSON and as text."""

def schema() -> str:
    """The schema of decks as JSON."""

def text_of_code(code: str) -> str | None:
    """The page about a code of a message; none without such a code."""

def table(path: _StrPath) -> dict[str, _Array]:
    """A table as a dictionary of columns; missing entries are not a number."""

def series(path: _StrPath) -> list[tuple[float, Path]]:
    """The times and files of a series."""

def mesh(path: _StrPath) -> tuple[dict[str, _Array], dict[str, _Array]]:
    """The fields of the points of a mesh by their names, with the coordinates as `""`, and those of its cells."""

def conformance(law: _Adapter, largest: float) -> list[tuple[str, list[float], float, float]]:
    """The properties that a law lacks: name, strain, relative error, and what is tolerated."""

def is_field_of_points(name: str) -> bool:
    """Whether the points have a field of this name, which a history variable of a law can therefore not have."""

def check_axis(name: str, values: list[str]) -> None:
    """Checks the values of a parameter in a study; the values are written as in ``--set``."""

def headings(parameters: list[str], results: list[str]) -> list[str]:
    """Headings of parameters that differ from the columns of results and from each other."""

@final
class Grids:
    """The decks of a convergence study, and what their results have shown."""

    def __new__(
        cls,
        name: str,
        text: bytes,
        overrides: list[tuple[str, str]],
        quantity: str,
        over: tuple[str, list[str]] | None,
        allow_libraries: bool,
    ) -> Grids:
        """The grids of a deck: three with cells of halved size, or those that a parameter with listed values sets."""

    #: Why the grids are finer than that of the deck.
    @property
    def note(self) -> str | None: ...
    def decks(self) -> list[tuple[str, bytes, list[tuple[str, str]]]]:
        """Names of the results directories, texts and overrides of the decks from coarse to fine."""

    def halve(self) -> tuple[str, bytes, list[tuple[str, str]]]:
        """Adds a grid with cells half as long as those of the finest one, and returns its deck."""

    def move_lines(self) -> tuple[str, bytes, list[tuple[str, str]]] | None:
        """The deck of the middle grid with its inner lines moved, if it can be used so."""

    def read(self, directory: _StrPath, is_moved: bool) -> None:
        """Reads the quantity from the results of the next grid, or of the moved one."""

    def leave_moved(self, why: str | None) -> None:
        """Goes on without the run on the moved grid, which has not reached its end or has no such quantity."""

    def conclude(self, errors: list[float], out: _StrPath | None) -> tuple[str, str]:
        """The conclusions as JSON and as a sentence; they are also written to a directory, with a page."""

@final
class BuiltIn:
    """A law of the library."""

    def __new__(cls, material: str) -> BuiltIn:
        """The law of a material of a deck, given as JSON."""

    def fields(self) -> list[tuple[str, str, float]]:
        """Names, units and initial values of the history variables."""

    def is_logarithmic(self) -> bool:
        """Whether strains are logarithmic; otherwise they are ½ (b − I)."""

    def is_symmetric(self) -> bool:
        """Whether the tangent is symmetric."""

    def respond(self, strain: _Array, history: _Array) -> list[_Array]:
        """Stress, elastic strain, tangent and history of points."""

    def elastic_strain(self, stress: _Array) -> _Array:
        """Elastic strain of points with this stress; not a number where none gives it."""

    def energy(self, strain: _Array) -> _Array:
        """Stored energy per initial volume of points with this elastic strain."""

    def plastic_work(self, history: _Array, points: int) -> _Array:
        """Plastic work per initial volume of points with this history."""

@final
class Session:
    """A run between whose steps the interpreter decides."""

    #: Messages about the deck, as JSON.
    @property
    def notes(self) -> str: ...
    #: Names of the history variables of the laws.
    @property
    def history(self) -> list[str]: ...
    #: The directory of the results.
    @property
    def directory(self) -> Path | None: ...
    def __new__(
        cls,
        name: str,
        text: bytes,
        overrides: list[tuple[str, str]],
        *,
        threads: int | None,
        out: _StrPath | None,
        laws: dict[str, Any],
        allow_libraries: bool,
        on_iteration: Callable[[int, int, float], object] | None,
    ) -> Session:
        """Begins a run of a deck and pauses it before the first step."""

    def step(self) -> str | None:
        """Solves the next step and returns it as JSON; none at the end of the run."""

    def stop(self) -> str | None:
        """Ends the run before the next step; the step under way is awaited, and returned as JSON."""

    def close(self) -> None:
        """Ends the run and releases its thread and its memory; nothing can be asked afterwards."""

    def abandon(self) -> None:
        """Ends all calls of laws, since the interpreter is about to end."""

    def has_ended(self) -> bool:
        """Whether the run has ended."""

    def summary(self) -> str | None:
        """The document of `summary.json`, as JSON; none before the end of the run."""

    def array(self, name: str) -> _Array | None:
        """An array of the points in the order of their permanent numbers."""

    def table(self, name: str) -> dict[str, _Array]:
        """A table of the run: a dictionary of columns."""

    def change(self, name: str, text: bytes, overrides: list[tuple[str, str]]) -> None:
        """Goes on with the loads, conditions, materials and steps of another deck."""
