"""Runs and their results."""

from __future__ import annotations

import atexit
import json
import os
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._errors import Diagnostic, MpmError, ResultsError, UsageError, diagnostics_of
from mpm._laws import Law
from mpm._tools import BodyPair, Tool, pairs_of, tools_of

if TYPE_CHECKING:
    import pandas
    import pyvista

    from mpm._deck import Deck, StrPath

Array = npt.NDArray[np.float64]

#: Longest wait for a thread that uses an abandoned run, in hundredths of a second.
_PATIENCE = 1000


@dataclass(frozen=True, eq=False)
class Step:
    """A converged load step.

    Attributes:
        index: Step number, from 1. Each part of a step that was cut has its own number.
        start: Time at the start of the step.
        time: Time at the end of the step.
        stage: Name of the stage, or ``None`` if the deck has no stages.
        iterations: Number of Newton iterations.
        residuals: Relative out-of-balance force at every evaluation, [-], shape (evaluations,); the first precedes all
            iterations.
        load_factor: Load factor at the end of the step, or ``None`` if loads and prescribed motions share none, [-].
        strength_factor: Factor by which the strength of the materials is divided, or ``None`` at full strength, [-].
        reactions: Reaction of each boundary condition, by name: the force on the bodies, shape (axes,), [force].
        loads: Resultant of each load, by name, shape (axes,), [force].
        tools: Each rigid tool, by name: position, force, moment, parts, contacts.
        contacts: Each pair of bodies in contact, by the name of its columns such as ``block_on_ground``.
        unknowns: Number of free degrees of freedom.
        external_work: Work of loads and reactions so far, [energy].
        strain_energy: Stored elastic energy, [energy].
        plastic_work: Plastic work so far, [energy].
        rounding_limited: Whether round-off kept the residual above the tolerance.
        damped: Whether only damped iterations found the equilibrium.
        end_time: Time at the end of the analysis.
        warnings: Warnings that this step has raised.

    Example:
        >>> with mpm.Deck.load("inputs/footing.yaml", h=0.5).start(threads=1) as run:
        ...     step = next(run)
        >>> step.index, step.iterations, step.residual < 1e-9
        (1, 5, True)
        >>> sorted(step.reactions), step.reactions["ram"].round(-3)
        (['axis', 'base', 'ram', 'side'], array([     0., -32000.]))
    """

    index: int
    start: float
    time: float
    stage: str | None
    iterations: int
    residuals: Array
    load_factor: float | None
    strength_factor: float | None
    reactions: dict[str, Array]
    loads: dict[str, Array]
    tools: dict[str, Tool]
    contacts: dict[str, BodyPair]
    unknowns: int
    external_work: float
    strain_energy: float
    plastic_work: float
    rounding_limited: bool
    damped: bool
    end_time: float
    warnings: tuple[Diagnostic, ...]

    @property
    def residual(self) -> float:
        """Relative out-of-balance force at the end of the step, [-]."""
        return float(self.residuals[-1])


def _step(document: str) -> Step:
    data: dict[str, Any] = json.loads(document)
    data["residuals"] = np.array(data["residuals"], dtype=float)
    for key in ("reactions", "loads"):
        data[key] = {name: np.array(force) for name, force in data[key].items()}
    data["tools"] = tools_of(data["tools"])
    data["contacts"] = pairs_of(data["contacts"])
    data["warnings"] = tuple(
        Diagnostic(of["code"], "warning", of["message"], help=of["help"]) for of in data["warnings"]
    )
    return Step(**data)


class Table(Mapping[str, Array]):
    """A table: a mapping of column names to arrays, shape (rows,). Missing entries are NaN.

    ``docs/output.md`` lists the columns of ``history``, ``quality`` and ``convergence``.

    Args:
        columns: The columns by name.

    Example:
        >>> history = mpm.Deck.load("inputs/beam.yaml", steps=4).run(progress=False).history
        >>> history["time"]
        array([0.25, 0.5 , 0.75, 1.  ])
        >>> [name for name in history if name.startswith("tip")]
        ['tip_fx', 'tip_fy', 'tip_ux', 'tip_uy']
    """

    def __init__(self, columns: Mapping[str, Array]) -> None:
        self._columns = dict(columns)

    def __getitem__(self, name: str) -> Array:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"there is no column {name!r}; the columns are {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __eq__(self, other: object) -> bool:
        """Whether all entries are equal; missing entries are equal to each other."""
        if not isinstance(other, Table):
            return NotImplemented
        return self._columns.keys() == other._columns.keys() and all(
            np.array_equal(column, other[name], equal_nan=True) for name, column in self.items()
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        rows = len(next(iter(self._columns.values()), ()))
        return f"<Table of {rows} rows: {', '.join(self._columns)}>"

    def to_dataframe(self) -> pandas.DataFrame:
        """The table as a data frame with the same rows and columns. Needs pandas."""
        return _package("pandas").DataFrame(self._columns)


class Points(Mapping[str, Array]):
    """Arrays of the n material points, in the order of their permanent numbers.

    ``points[name]`` is a copy with one row per point, which does not change when the run continues. Vectors have one
    component per axis. Matrices are stored by rows, xx, xy, xz, yx, yy, yz, zx, zy, zz; symmetric tensors as xx, yy,
    zz, xy, yz, xz, without factors. The properties below are the arrays of every run. History variables of laws are
    further arrays under their own names, such as ``equivalent_plastic_strain`` for von Mises plasticity; they are zero
    for points with other laws. Points read from files have only ``position``, the arrays that every file contains, such
    as ``volume``, and the fields that the deck writes (``output: {fields: ...}``).

    Example:
        >>> points = mpm.Deck.load("inputs/beam.yaml", steps=10).run(progress=False).points
        >>> points
        <Points: 1440>
        >>> points.position.shape, points.cauchy_stress.shape
        ((1440, 2), (1440, 6))
        >>> xx, yy, zz, xy, yz, xz = points.cauchy_stress.T
        >>> print(f"largest bending stress {xx.max() / 1e6:.1f} MPa, lowest point {points.position[:, 1].min():.2f} m")
        largest bending stress 2.0 MPa, lowest point 1.27 m
    """

    #: Names of the arrays that the points of every run have.
    NAMES: tuple[str, ...] = (
        "position",
        "displacement",
        "deformation_gradient",
        "kirchhoff_stress",
        "cauchy_stress",
        "elastic_strain",
        "volume",
        "mass",
        "body",
    )

    def __init__(self, array: Callable[[str], Array | None], names: Sequence[str]) -> None:
        self._array, self._names = array, tuple(names)

    def __getitem__(self, name: str) -> Array:
        found = self._array(name) if isinstance(name, str) else None
        if found is None:
            raise KeyError(f"the points have no array {name!r}; the arrays are {', '.join(self._names)}")
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    # Points are equal only to themselves: comparing arrays gives one answer per entry.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __reduce__(self) -> Any:
        return _points, (dict(self),)

    @property
    def position(self) -> Array:
        """Position, shape (n, axes), [length]."""
        return self["position"]

    @property
    def displacement(self) -> Array:
        """Displacement since the start or the last reset, shape (n, axes), [length]."""
        return self["displacement"]

    @property
    def deformation_gradient(self) -> Array:
        """Deformation gradient, shape (n, 9), [-]."""
        return self["deformation_gradient"]

    @property
    def kirchhoff_stress(self) -> Array:
        """Kirchhoff stress, tension positive, shape (n, 6), [stress]."""
        return self["kirchhoff_stress"]

    @property
    def cauchy_stress(self) -> Array:
        """Cauchy stress, tension positive, shape (n, 6), [stress]."""
        return self["cauchy_stress"]

    @property
    def elastic_strain(self) -> Array:
        """Elastic logarithmic strain, shape (n, 6), [-]."""
        return self["elastic_strain"]

    @property
    def volume(self) -> Array:
        """Volume, shape (n,), [volume]."""
        return self["volume"]

    @property
    def mass(self) -> Array:
        """Mass, shape (n,), [mass]."""
        return self["mass"]

    @property
    def body(self) -> Array:
        """Number of the body in the deck, from 0, shape (n,)."""
        return self["body"]

    def __repr__(self) -> str:
        return f"<Points: {len(self['position'])}>"

    def to_pyvista(self) -> pyvista.PolyData:
        """The points as a mesh of vertices with all arrays; coordinates of missing axes are zero. Needs PyVista.

        Example:
            >>> mesh = mpm.Deck.load("inputs/footing.yaml", h=0.5).start().points.to_pyvista()
            >>> mesh.n_points, mesh.point_data["cauchy_stress"].shape
            (664, (664, 6))
        """
        position = self.position
        places = np.zeros((len(position), 3))
        places[:, : position.shape[1]] = position
        mesh = _package("pyvista").PolyData(places)
        for name in self:
            mesh.point_data[name] = self[name]
        return cast("pyvista.PolyData", mesh)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per point and one column per component, such as ``cauchy_stress_xx``. Needs pandas.

        Example:
            >>> frame = mpm.Deck.load("inputs/footing.yaml", h=0.5).start().points.to_dataframe()
            >>> frame.groupby("body")["volume"].sum().to_list()
            [40.0, 1.0, 0.5]
        """
        columns: dict[str, Array] = {}
        for name in self:
            array = self[name]
            if array.ndim == 1:
                columns[name] = array
                continue
            width = array.shape[1]
            for number, component in enumerate(_COMPONENTS.get(width, tuple(map(str, range(width))))):
                columns[f"{name}_{component}"] = array[:, number]
        return _package("pandas").DataFrame(columns)


def _points(arrays: dict[str, Array]) -> Points:
    return Points(arrays.get, tuple(arrays))


_COMPONENTS = {
    2: ("x", "y"),
    3: ("x", "y", "z"),
    6: ("xx", "yy", "zz", "xy", "yz", "xz"),
    9: ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"),
}


class Run:
    """A run that Python controls from step to step: an iterator over :class:`Step`.

    :meth:`Deck.start` begins it. The analysis has its own thread, which waits between steps. Meanwhile, :attr:`points`
    and the tables hold the state of the last converged step, and :meth:`change` alters the steps that follow.

    - Each iteration solves the next step. The loop ends at the end of the analysis, or with :class:`SolveError` if a
      step has no equilibrium; in both cases, points, tables and :meth:`result` can be read afterwards.
    - At the end of a ``with`` block the run ends, as with :meth:`stop`; its points and tables can still be read.
      :meth:`close` releases its threads and its memory.
    - After Ctrl-C, or an exception in ``on_iteration``, the step under way continues; the next iteration returns it.
    - A run belongs to the process that began it, cannot be pickled, and serves one thread at a time.

    Example:
        >>> with mpm.Deck.load("inputs/footing.yaml", h=0.5).start(threads=1) as run:
        ...     for step in run:
        ...         if -step.reactions["ram"][1] > 65e3:
        ...             break
        >>> run.step.index, run.ended, run.result().summary["outcome"]
        (7, True, 'interrupted')
        >>> run.points.cauchy_stress.shape
        (664, 6)
    """

    _live: weakref.WeakSet[Run] = weakref.WeakSet()

    def __init__(self) -> None:
        raise UsageError("use Deck.start to begin a run")

    @classmethod
    def _begin(
        cls,
        deck: Deck,
        threads: int | None,
        out: StrPath | None,
        laws: Mapping[str, Law] | None,
        allow_libraries: bool,
        on_iteration: Callable[[int, int, float], None] | None,
    ) -> Run:
        if threads is not None and (not isinstance(threads, int) or isinstance(threads, bool)):
            raise UsageError(f"threads must be a whole number, not {threads!r}")
        if threads is not None and not 1 <= threads <= 1024:
            raise UsageError("threads must be a number from 1 to 1024")
        if on_iteration is not None and not callable(on_iteration):
            raise UsageError("on_iteration must be a function of step, iteration and residual")
        run = cls.__new__(cls)
        run._deck = deck
        run._session = deck._begin(threads, out, laws, allow_libraries, on_iteration)
        run._process = os.getpid()
        run._has_laws, run._is_under_way = bool(laws), False
        run._step = None
        # Absolute, since the process may change its directory.
        run._directory = None if run._session.directory is None else run._session.directory.absolute()
        run._closed = False
        run._names = tuple(dict.fromkeys((*Points.NAMES, *run._session.history)))
        cls._live.add(run)
        return run

    _deck: Deck
    _session: _mpm.Session
    _step: Step | None
    _directory: Path | None
    _names: tuple[str, ...]
    _closed: bool
    _process: int
    _has_laws: bool
    #: A step has begun, and its end has not been reported yet.
    _is_under_way: bool

    def __iter__(self) -> Iterator[Step]:
        return self

    def __next__(self) -> Step:
        self._is_under_way = True
        document = self._session.step()
        self._is_under_way = False
        if document is None:
            raise StopIteration
        self._step = _step(document)
        return self._step

    def __enter__(self) -> Run:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            self.stop()
        except MpmError:
            if kind is None:
                raise  # otherwise the first exception is more informative

    def __del__(self) -> None:
        if getattr(self, "_session", None) is not None:
            self._abandon()

    def __reduce__(self) -> Any:
        raise TypeError("a run cannot be pickled; save the deck, or read the results of the run with mpm.read")

    def __repr__(self) -> str:
        step = "before its first step" if self._step is None else f"after step {self._step.index}"
        return f"<Run of {self._deck!r} {step}>"

    @property
    def deck(self) -> Deck:
        """The deck of the run, a copy of the deck that began it. Change it, then call :meth:`change`."""
        return self._deck

    @property
    def notes(self) -> list[Diagnostic]:
        """Warnings and notes about the deck, found before the first step."""
        return diagnostics_of(self._session.notes)

    @property
    def step(self) -> Step | None:
        """The last converged step, or ``None`` before the first."""
        return self._step

    @property
    def points(self) -> Points:
        """The material points in the state of the last converged step, or at first in their initial state.

        Arrays are copied when they are read. The points themselves follow the run: to keep the states of several steps,
        keep arrays.
        """
        return Points(self._session.array, self._names)

    @property
    def tools(self) -> dict[str, Tool]:
        """The rigid tools at the end of the last converged step, by name; empty before the first step."""
        return {} if self._step is None else dict(self._step.tools)

    @property
    def history(self) -> Table:
        """The rows of ``history.csv`` so far: one per attempt at a step. Failed attempts have ``converged`` 0."""
        return Table(self._session.table("history"))

    @property
    def quality(self) -> Table:
        """The rows of ``quality.csv`` so far: measures of the quality of each step."""
        return Table(self._session.table("quality"))

    @property
    def convergence(self) -> Table:
        """The rows of ``convergence.csv`` so far: one per evaluation of the out-of-balance force."""
        return Table(self._session.table("convergence"))

    @property
    def ended(self) -> bool:
        """Whether the run has ended: at the end of the analysis, by an error, or by :meth:`stop` or :meth:`close`."""
        return self._session.has_ended() or self._closed

    def change(self) -> None:
        """Continues the run with the current content of :attr:`deck`.

        Loads, boundary conditions, parameters of materials, the number and size of steps, the solver, and the output
        and checkpoints of later steps may change. Grid, bodies, tools, probes, models and densities of materials, laws
        in Python, the names and types of loads, the names of boundary conditions, the directions of conditions on
        surfaces, and the control of the steps may not; nor may materials that vary in space.

        The next step begins from the current state of the points. At the end of that step, a load is its new value
        times its new curve: it jumps within the step if the new curve does not continue the old one. A prescribed
        displacement grows by its new value times the growth of its curve, and grid lines that follow it move as far.
        Points keep their stress if the elasticity of their material changes; a law that cannot compute the elastic
        strain of a stress, such as one of a library without this function, keeps its elasticity. The model is built
        again, which takes as long as the start of the run. After the last step, the call has no effect.

        Raises:
            DeckError: The changed deck cannot be used; the run can go on as it was.
            UsageError: Something that may not change has been changed, a step is under way, or the run has ended.

        Example:
            The footing is pressed in until its reaction reaches 60 kN, then lifted:

            >>> deck = mpm.Deck.load("inputs/footing.yaml", h=0.5, depth=0.1)
            >>> with deck.start(threads=1) as run:
            ...     for step in run:
            ...         if -step.reactions["ram"][1] > 60e3:
            ...             ram = run.deck["boundary_conditions"][3]
            ...             ram["curve"] = [[0, 0], [step.time, step.time], [1, 0]]
            ...             run.change()
            >>> print(f'{run.history["footing_uy"].min():.3f}')
            -0.037
        """
        text, overrides = self._deck._source()
        step = self._step
        if step is not None and step.time >= step.end_time * (1 - 1e-12) and not self.ended:
            return  # the analysis has taken its last step, and only has to end
        self._session.change(self._deck._name, text, overrides)

    def stop(self) -> None:
        """Ends the run in the state of the last step. Waits for a step under way; does nothing if the run has ended."""
        if self._closed:
            return
        self._is_under_way = True
        document = self._session.stop()
        self._is_under_way = False
        if document is not None:
            self._step = _step(document)

    def close(self) -> None:
        """Ends the run and releases its threads and its memory; its points and tables can then no longer be read."""
        self._session.close()
        self._closed = True

    def _abandon(self) -> None:
        """Ends all calls to laws: a call in a step that nobody waits for any more must not outlive the interpreter.

        Waits for the current call, after which the step under way fails. Without laws, the step continues on its own.
        """
        if self._process != os.getpid():
            return  # the thread of the analysis belongs to another process
        self._session.abandon()
        for _ in range(_PATIENCE):
            try:
                if self._has_laws and self._is_under_way and not self._session.has_ended():
                    self._session.close()
                return
            except UsageError:
                time.sleep(0.01)  # another Python thread waits for the step, which is about to fail

    def result(self) -> Result:
        """The result of a run that has ended, even by :meth:`stop` or an error; ``summary["outcome"]`` says how.

        Raises:
            UsageError: The run has not ended, or is closed.
        """
        summary = self._session.summary()
        if self._closed:
            raise UsageError("the run is closed")
        if summary is None:
            raise UsageError("the run has not ended; iterate over it, or stop it")
        tables = {name: Table(self._session.table(name)) for name in ("history", "quality", "convergence")}
        return Result(
            directory=self._directory, summary=json.loads(summary), points=self.points, **tables
        )


@atexit.register
def _abandon() -> None:
    """Prevents analyses from calling Python while the interpreter exits."""
    for run in list(Run._live):
        run._abandon()


@dataclass(frozen=True)
class Frame:
    """The results of a run at one time, from its files.

    Attributes:
        time: Time.
        path: The file of the points, ``points_*.vtu``, or ``points_*.pvtu`` if several ranks wrote them.
    """

    time: float
    path: Path

    @property
    def points(self) -> Points:
        """The points in the file, in the order of their permanent numbers; vectors have three components."""
        fields = _fields(self.path)
        if "body_id" in fields:
            fields.setdefault("body", fields["body_id"])
        return _points(fields)

    @property
    def fields(self) -> dict[str, Array]:
        """All fields of the points in the file by name, in the order of their permanent numbers.

        ``docs/output.md`` lists their shapes and units. In these files all vectors have three components.
        """
        return _fields(self.path)

    def to_pyvista(self) -> pyvista.DataSet:
        """The mesh of the file, with all fields in the order of the file. Needs PyVista."""
        return cast("pyvista.DataSet", _package("pyvista").read(self.path))


def _fields(path: Path) -> dict[str, Array]:
    points, _ = _mpm.mesh(str(path))
    fields = {name: array for name, array in points.items() if name}
    fields["position"] = points[""]
    order = fields.get("point_id")
    if order is not None and np.any(np.diff(order) < 0):
        places = np.argsort(order)
        fields = {name: array[places] for name, array in fields.items()}
    return fields


@dataclass(frozen=True, eq=False)
class Result:
    """The result of a run.

    :meth:`Deck.run`, :meth:`Run.result` and :func:`read` return it. A result can be pickled; the unpickled copy has
    points only if they were written to files.

    Attributes:
        history: The rows of ``history.csv``, one per attempt at a step: time, reactions, loads, probes, work and
            energy. A failed attempt has ``converged`` 0 and no forces.
        quality: The rows of ``quality.csv``: measures of the quality of every step.
        convergence: The rows of ``convergence.csv``: the residual of every evaluation.
        summary: The content of ``summary.json``: outcome, counts, processor time, memory, warnings.
        directory: The directory of the files, or ``None`` if nothing was written.
        points: The points at the end, from the run in memory or from the last file; ``None`` if no points were
            written.

    Example:
        >>> result = mpm.Deck.load("inputs/beam.yaml", steps=10).run(progress=False)
        >>> result
        <Result of 'Elastic cantilever, Coombs et al. (2020), section 7.3': completed, 10 steps>
        >>> result.summary["outcome"], result.summary["points"]
        ('completed', 1440)
        >>> result.history["time"][:3]
        array([0.1, 0.2, 0.3])
    """

    history: Table
    quality: Table
    convergence: Table
    summary: dict[str, Any]
    directory: Path | None
    points: Points | None
    """The points at the end, from the run in memory or from the last file; ``None`` if no points were written."""

    def __reduce__(self) -> Any:
        # The points belong to the run; a copy has them only if they were written to files.
        tables = (self.history, self.quality, self.convergence)
        return _restored, (tables, self.summary, self.directory)

    def __repr__(self) -> str:
        title = self.summary.get("title") or "untitled"
        return f"<Result of {title!r}: {self.summary['outcome']}, {self.summary['steps']} steps>"

    @property
    def frames(self) -> list[Frame]:
        """The files of the points, one for each time at which they were written; empty if there are none."""
        return [] if self.directory is None else _frames(self.directory)

    def plot(
        self,
        field: str | None = None,
        *,
        step: int | str = "last",
        warp: bool | float = False,
        out: StrPath | None = None,
    ) -> Path | None:
        """Draws the bodies, coloured by a field, with tools and surfaces, like ``mpm picture``. Needs PyVista.

        Without ``out``, the picture opens in a window or in the notebook; where there is neither, it is written to
        ``picture.png`` in the directory of the results.

        Args:
            field: Name of a field, or of a component, such as ``"cauchy_stress:YY"``; of a vector or tensor without a
                component, the norm. By default the von Mises stress.
            step: Number of a step whose points were written, ``"first"`` or ``"last"``.
            warp: Whether to exaggerate displacements so that they are visible, or the factor.
            out: File to write, ``.png``.

        Returns:
            The file, or ``None`` if a window or notebook shows the picture.

        Raises:
            ResultsError: The run has written no files.
            UsageError: PyVista is not installed, or there is no such field or step.

        Example:
            >>> deck = mpm.Deck.load("inputs/footing.yaml", h=0.5, every=10)
            >>> result = deck.run("results/footing", progress=False)
            >>> result.plot("displacement:Y", out="results/footing/settlement.png").name
            'settlement.png'
        """
        from mpm import _picture

        if out is None and not _picture.is_notebook() and not _picture.has_display():
            out = self._written() / "picture.png"
            print(f"there is no display; the picture is {out}")
        drawn = _picture.draw(self._written(), field=field, step=step, warp=warp, out=out)
        if isinstance(drawn, Path):
            return drawn
        drawn.show()
        return None

    def animate(
        self, field: str | None = None, *, warp: bool | float = False, out: StrPath | None = None
    ) -> Path:
        """Makes a film of all steps whose points were written, with one scale. Needs PyVista and imageio.

        Args:
            field: As for :meth:`plot`.
            warp: As for :meth:`plot`.
            out: File to write, ``.gif`` or ``.mp4``; by default ``picture.gif`` in the directory of the results.

        Returns:
            The file.

        Raises:
            ResultsError: The run has written no files.
            UsageError: A package is not installed, or there is no such field.
        """
        from mpm import _picture

        return cast(Path, _picture.draw(self._written(), field=field, step="all", warp=warp, out=out))

    def _written(self) -> Path:
        if self.directory is None:
            raise ResultsError("the run has written no files to draw; give `run` a directory")
        return self.directory


def _restored(
    tables: tuple[Table, Table, Table], summary: dict[str, Any], directory: Path | None
) -> Result:
    return Result(*tables, summary, directory, None if directory is None else _last_points(directory))


def _frames(directory: Path) -> list[Frame]:
    series = directory / "points.pvd"
    if not series.exists():
        return []
    return [Frame(time, Path(path)) for time, path in _mpm.series(str(series))]


def _last_points(directory: Path) -> Points | None:
    frames = _frames(directory)
    return frames[-1].points if frames else None


def read(directory: StrPath) -> Result:
    """Reads the results of a run from its directory, whether ``mpm run`` or this package wrote them.

    Args:
        directory: The directory, as given to ``--out`` or ``out``.

    Raises:
        ResultsError: There are no results, or the run has not ended.

    Example:
        >>> deck = mpm.Deck.load("inputs/footing.yaml", h=0.5, every=10)
        >>> written = deck.run("results/footing", progress=False)
        >>> result = mpm.read("results/footing")
        >>> bool((result.history["ram_ry"] == written.history["ram_ry"]).all())
        True
        >>> [frame.time for frame in result.frames][-1], result.points.cauchy_stress.shape
        (1.0, (664, 6))
    """
    folder = Path(os.fsdecode(directory))
    try:
        summary = json.loads((folder / "summary.json").read_text())
    except FileNotFoundError:
        raise ResultsError(f"`{folder}` has no `summary.json`: no run has ended there") from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"`{folder / 'summary.json'}` cannot be read: {error}") from None
    if not isinstance(summary, dict) or not {"outcome", "steps"} <= summary.keys():
        raise ResultsError(f"`{folder / 'summary.json'}` is not the summary of a run")
    history, quality, convergence = (_table(folder / f"{name}.csv") for name in ("history", "quality", "convergence"))
    return Result(history, quality, convergence, summary, folder, _last_points(folder))


def _table(path: Path) -> Table:
    if not path.is_file():
        raise ResultsError(f"`{path}` is missing")
    return Table(_mpm.table(str(path)))


def _package(name: str) -> Any:
    """An optional package."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        raise ImportError(f"this needs the package {name}: pip install {name}") from None
