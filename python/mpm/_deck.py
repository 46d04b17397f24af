"""Decks: descriptions of analyses."""

from __future__ import annotations

import copy
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm import _mpm
from mpm._errors import Diagnostic, UsageError, diagnostics_of
from mpm._laws import Law, adapters

if TYPE_CHECKING:
    from mpm._run import Result, Run

StrPath = str | os.PathLike[str]
Value = str | int | float | bool
Overrides = list[tuple[str, str]]


class Deck(MutableMapping[str, Any]):
    """A deck: the description of an analysis, with the same keys as a deck file.

    A deck is a mapping of nested dictionaries and lists; ``docs/deck.md`` lists the keys. Change it in place, then
    :meth:`check`, :meth:`save`, :meth:`start` or :meth:`run` it. Numbers may be NumPy numbers; expressions and formulas
    are text, as in a file. Any consistent set of units can be used.

    Args:
        data: The keys and values. They are copied.
        directory: Directory to which the paths in the deck, such as the path of a mesh, are relative.

    Raises:
        UsageError: The data are not a mapping, or hold something other than numbers, words, lists and mappings.

    Example:
        >>> import mpm
        >>> deck = mpm.Deck({
        ...     "version": 1,
        ...     "grid": {"type": "structured", "origin": [0, 0], "size": [1, 2], "spacing": 0.5},
        ...     "materials": {"clay": {"model": "hencky", "young": 1e6, "poisson": 0.3, "density": 2000}},
        ...     "bodies": [{"name": "column", "material": "clay", "points_per_cell": 2,
        ...                 "shape": {"type": "box", "min": [0, 0], "max": [1, 1]}}],
        ...     "boundary_conditions": [{"name": "floor", "nodes": {"y": 0}, "fix": ["x", "y"]}],
        ...     "loads": [{"name": "weight", "type": "gravity", "acceleration": [0, -9.81]}],
        ...     "steps": {"count": 10},
        ... })
        >>> deck["loads"][0]["acceleration"] = [0, -5]
        >>> [found.code for found in deck.check() if found.severity == "error"]
        []
        >>> result = deck.run(threads=1, progress=False)
        >>> round(result.history["floor_ry"][-1])
        10000
    """

    def __init__(self, data: Mapping[str, Any], *, directory: StrPath = ".") -> None:
        if not isinstance(data, Mapping):
            raise UsageError(f"a deck must be a mapping, not {type(data).__name__}; Deck.load reads a file")
        self._data: dict[str, Any] = _plain(data, "")
        self._name = os.path.join(os.fsdecode(directory), "deck")
        self._text: bytes | None = None
        self._overrides: Overrides = []
        self._original: str | None = None
        #: Text and overrides in place of those that follow from the data.
        self._given: tuple[bytes, Overrides] | None = None

    @classmethod
    def load(cls, path: StrPath, /, **parameters: Value) -> Deck:
        """Reads a deck from a YAML file.

        Messages about the deck give the lines of the file as long as only parameters are changed.

        Args:
            path: The file. Paths in the deck are relative to its directory.
            parameters: Values of parameters that the deck defines; they replace those in the file, as with ``--set`` of
                ``mpm run``. Text is a word or an expression, such as ``"${2*h}"``.

        Raises:
            DeckError: The file cannot be read or is not YAML. :meth:`check` finds all other faults.
            UsageError: The deck has no parameter of this name, or the value is neither a number nor a word.

        Example:
            >>> deck = mpm.Deck.load("inputs/beam.yaml", h=0.25)
            >>> deck["parameters"]["h"], deck["grid"]["spacing"]
            (0.25, '${h}')
        """
        name = os.fsdecode(path)
        text, document = _mpm.read(name)
        data = json.loads(document)
        deck = cls(data if isinstance(data, dict) else {})
        deck._name, deck._text = name, text
        if not isinstance(data, dict):
            deck._original = _document(deck._data)  # the check reports that it is not a mapping
            return deck
        defined = deck._data.get("parameters")
        names = list(defined) if isinstance(defined, dict) else []
        for name, value in parameters.items():
            if name not in names:
                known = ", ".join(names) or "none"
                raise UsageError(f"the deck has no parameter {name!r}; it has {known}")
            plain = _parameter(name, value)
            deck._overrides.append((name, _setting(plain)))
            deck._data["parameters"][name] = plain
        deck._original = _document(deck._data)
        return deck

    @property
    def data(self) -> dict[str, Any]:
        """The keys and values, to be read and changed."""
        return self._data

    @property
    def text(self) -> str:
        """The deck as YAML: the text of its file, comments included, as long as nothing has been changed."""
        return self._whole_text().decode(errors="replace")

    def __getitem__(self, key: str) -> Any:
        return self._data[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self._data[key] = value

    def __delitem__(self, key: str) -> None:
        del self._data[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)

    def __repr__(self) -> str:
        return f"<Deck {self._data.get('title') or self._name!r}>"

    def copy(self) -> Deck:
        """A deck with the same content. Changing one does not change the other."""
        return copy.deepcopy(self)

    def __copy__(self) -> Deck:
        return self.copy()

    def with_parameters(self, **parameters: Value) -> Deck:
        """A copy with different parameter values.

        Args:
            parameters: Values of parameters, by name, as for :meth:`load`.

        Raises:
            UsageError: The deck has no parameter of this name, or the value is neither a number nor a word.

        Example:
            >>> deck = mpm.Deck.load("inputs/beam.yaml")
            >>> [deck.with_parameters(h=h)["parameters"]["h"] for h in (1, 0.5)]
            [1, 0.5]
        """
        changed = self.copy()
        defined = changed._data.get("parameters")
        chosen: dict[str, Value] = {}
        for name, value in parameters.items():
            if not isinstance(defined, dict) or name not in defined:
                known = ", ".join(defined) if isinstance(defined, dict) else "none"
                raise UsageError(f"the deck has no parameter {name!r}; it has {known}")
            defined[name] = chosen[name] = _parameter(name, value)
        if self._is_original():
            kept = [entry for entry in self._overrides if entry[0] not in parameters]
            new = [(name, _setting(value)) for name, value in chosen.items()]
            changed._overrides, changed._original = kept + new, _document(changed._data)
        return changed

    def save(self, path: StrPath) -> None:
        """Writes the deck to a YAML file that ``mpm run`` accepts.

        If nothing has been changed, the text of the loaded file is kept, comments included. Paths in the deck stay as
        they are: save the deck in the directory to which they are relative.

        Args:
            path: The file. An existing file is replaced.
        """
        Path(os.fsdecode(path)).write_bytes(self._whole_text())

    def check(self, *, allow_libraries: bool = False) -> list[Diagnostic]:
        """Does everything up to the first load step, like ``mpm check``, and returns all messages; raises none of them.

        Args:
            allow_libraries: Whether the libraries that the deck names (``model: library``) may be loaded: their code runs in
                this process. Setting the environment variable ``MPM_ALLOW_LIBRARIES`` to 1 has the same meaning.

        Returns:
            Errors, warnings and notes, in the order of the deck; empty if there are none.

        Example:
            >>> deck = mpm.Deck.load("inputs/footing.yaml")
            >>> deck["materials"]["clay"]["poisson"] = 0.6
            >>> found = deck.check()[0]
            >>> found.code, found.message
            ('D009', '0.6 is not below 0.5')
        """
        text, overrides = self._source()
        document, _ = _mpm.check(self._name, text, overrides, allow_libraries)
        return diagnostics_of(document)

    def start(
        self,
        *,
        threads: int | None = None,
        out: StrPath | None = None,
        laws: Mapping[str, Law] | None = None,
        allow_libraries: bool = False,
        on_iteration: Callable[[int, int, float], None] | None = None,
    ) -> Run:
        """Begins a run; iterate over it to solve its steps. Nothing is written unless ``out`` is given.

        Args:
            threads: Number of threads, from 1 to 1024; by default, one per core. Results are the same for any number.
            out: Directory for the files that ``mpm run`` writes. Earlier results in it are replaced.
            laws: Laws written in Python, by the names of the materials whose laws they replace; see :class:`mpm.Law`.
                The density and everything else stay as the deck states them. Runs with such laws write no checkpoints,
                because the program could not resume them.
            allow_libraries: Whether the libraries that the deck names (``model: library``) may be loaded: their code runs in
                this process. Setting the environment variable ``MPM_ALLOW_LIBRARIES`` to 1 has the same meaning.
            on_iteration: Called after every evaluation of the out-of-balance force with the step number, from 1, the
                iteration number, from 0, and the relative residual, [-]. It is called in the thread that waits for the
                step, while the analysis continues. An exception in it interrupts the wait, not the run: the next
                iteration over the run returns the same step.

        Returns:
            The run, before its first step. It holds a copy of the deck.

        Raises:
            DeckError: The deck cannot be used.
            ResultsError: The directory cannot be written to, or another run writes there.
            UsageError: The deck has no material with the name of a law, or an argument is of the wrong type.

        Example:
            >>> residuals = []
            >>> deck = mpm.Deck.load("inputs/beam.yaml", steps=10)
            >>> with deck.start(on_iteration=lambda step, iteration, r: residuals.append(r)) as run:
            ...     step = next(run)
            >>> step.iterations, len(residuals)
            (7, 8)
        """
        from mpm._run import Run

        return Run._begin(self.copy(), threads, out, laws, allow_libraries, on_iteration)

    def run(
        self,
        out: StrPath | None = None,
        *,
        threads: int | None = None,
        laws: Mapping[str, Law] | None = None,
        allow_libraries: bool = False,
        progress: bool | None = None,
    ) -> Result:
        """Runs the analysis to its end.

        Args:
            out: Directory for the files that ``mpm run`` writes. Earlier results in it are replaced; without it,
                nothing is written.
            threads: Number of threads; by default, one per core. Results are the same for any number.
            laws: Laws written in Python, as for :meth:`start`.
            allow_libraries: Whether the libraries that the deck names may be loaded, as for :meth:`start`.
            progress: Whether to show a progress bar; by default, only on terminals and in notebooks.

        Returns:
            The result. Its points stay in memory as long as the result is kept.

        Raises:
            DeckError: The deck cannot be used.
            SolveError: The analysis ended early. To keep the earlier steps, use :meth:`start` and catch the error
                around the loop.
            ResultsError: The directory cannot be written to, or another run writes there.
            UsageError: As for :meth:`start`.

        Example:
            >>> result = mpm.Deck.load("inputs/beam.yaml", steps=10).run("results/beam", progress=False)
            >>> f'{result.history["tip_uy"][-1]:.2f}'
            '-8.17'
            >>> [path.name for path in sorted(result.directory.glob("*.csv"))]
            ['convergence.csv', 'history.csv', 'quality.csv']
        """
        from mpm._progress import Bar

        begun = self.start(threads=threads, out=out, laws=laws, allow_libraries=allow_libraries)
        with begun as run, Bar(progress, run) as bar:
            for step in run:
                bar.show(step)
            return run.result()

    def _is_original(self) -> bool:
        return self._text is not None and self._original == _document(self._data)

    def _source(self) -> tuple[bytes, Overrides]:
        """Text and overrides: those of the file if at most parameters differ, so that messages give its lines."""
        if self._given is not None:
            return self._given
        if self._text is not None and self._is_original():
            return self._text, self._overrides
        return _mpm.dump(_document(self._data)).encode(), []

    def _whole_text(self) -> bytes:
        """Text that contains all changes, also those of parameters."""
        text, overrides = self._source()
        return _mpm.dump(_document(self._data)).encode() if overrides else text

    def _begin(
        self,
        threads: int | None,
        out: StrPath | None,
        laws: Mapping[str, Law] | None,
        allow_libraries: bool,
        on_iteration: Callable[[int, int, float], None] | None,
    ) -> _mpm.Session:
        text, overrides = self._source()
        return _mpm.Session(
            self._name,
            text,
            overrides,
            threads=threads,
            out=_directory(out),
            laws=adapters({} if laws is None else laws),
            allow_libraries=allow_libraries,
            on_iteration=on_iteration,
        )


def _directory(out: StrPath | None) -> str | None:
    """The name of a results directory."""
    directory = None if out is None else os.fsdecode(out)
    if directory == "":
        raise UsageError("out must be the name of a directory, not empty text")
    return directory


def _document(data: dict[str, Any]) -> str:
    """The deck as JSON.

    Raises:
        UsageError: A value is not a number, word, list or mapping.
    """
    try:
        return json.dumps(_plain(data, ""), allow_nan=False)
    except UsageError:
        raise
    except (TypeError, ValueError) as error:
        raise UsageError(f"the deck cannot be written: {error}") from None


#: Largest nesting depth of lists and mappings; decks have fewer than ten levels.
_DEEPEST = 100


def _plain(value: Any, place: str, depth: int = 0) -> Any:
    """A copy made of mappings with words as keys, lists, numbers and words; NumPy values become plain ones."""
    if value is None or isinstance(value, (str, bool, int, float)):
        plain = value if type(value) in (type(None), str, bool, int, float) else _simple(value)
        if isinstance(plain, float) and not math.isfinite(plain):
            raise UsageError(f"{place or 'the deck'} is {plain}; numbers in a deck must be finite")
        return plain
    if depth > _DEEPEST:
        raise UsageError(f"{place[:40]}… has more than {_DEEPEST} levels; does a list or a mapping contain itself?")
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise UsageError(f"the key {key!r} of {place or 'the deck'} is not a word")
        return {_simple(key): _plain(entry, f"{place}/{key}", depth + 1) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry, f"{place}/{index}", depth + 1) for index, entry in enumerate(value)]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist(), place, depth + 1)
    raise UsageError(
        f"{place or 'the deck'} holds a {type(value).__name__}; a deck may hold only numbers, words, lists and mappings"
    )


def _parameter(name: str, value: Any) -> Value:
    """The value of a parameter; NumPy numbers become plain ones."""
    found = value.item() if isinstance(value, np.generic) else value
    if not isinstance(found, (str, bool, int, float)):
        raise UsageError(f"the parameter {name!r} must be a number or a word, not {type(value).__name__}")
    plain: Value = _plain(found, f"the parameter {name!r}")
    return plain


def _setting(value: Value) -> str:
    """A parameter value as in ``--set name=value``."""
    return value if isinstance(value, str) else json.dumps(value)


def _simple(value: Any) -> Any:
    """The plain number or word that an instance of a subclass holds."""
    if isinstance(value, str):
        return str.__str__(value)  # the value of an enumeration member, not its name
    return int(value) if isinstance(value, int) else float(value)
