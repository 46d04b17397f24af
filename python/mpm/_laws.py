"""Constitutive laws written in Python."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._errors import UsageError

Array = npt.NDArray[np.float64]

#: What :meth:`Law.update` returns: ``(stress, tangent)`` for an elastic law, or
#: ``(stress, tangent, elastic_strain, history)``.
Response = tuple[Any, Any] | tuple[Any, Any, Any, Any]


@runtime_checkable
class Law(Protocol):
    """A constitutive law: Kirchhoff stress as a function of elastic strain, for a batch of points.

    Any object with a method :meth:`update` is a law; pass it to :meth:`Deck.start` or :meth:`Deck.run` in ``laws``. The
    attributes are optional, and so are three more methods; the first two only serve to compute the energies in the
    results. Only laws of the library, such as :class:`BuiltInLaw`, can be used where a deck reduces the strength.

    - ``energy(strain)``: stored energy per initial volume, shape (n,), at elastic strains, shape (n, 6). The default,
      half the product of stress and strain, is exact for linear elasticity.
    - ``plastic_work(history)``: plastic work per initial volume, shape (n,), for these history variables. The default
      is zero.
    - ``elastic_strain(stress)``: elastic strain, shape (n, 6), at Kirchhoff stresses, shape (n, 6). This inverse of the
      elastic law is needed for bodies with an initial stress.

    Symmetric tensors are rows ``xx, yy, zz, √2 xy, √2 yz, √2 xz``. In this layout the scalar product of two rows equals
    that of the tensors, the norm of a row equals that of the tensor, and tangents are matrices. (Arrays of
    :class:`Points` have the same order without √2.) Plane strain and bodies of revolution use the same layout, with yz
    and xz zero.

    The law is called once per evaluation with all points of its material. The response of a point must depend neither
    on the other points nor on their order, and a law must keep nothing between calls, because iterations may be
    repeated. :func:`mpm.testing.check_material` checks this and more. An exception in a law ends the run with a
    :class:`SolveError`, whose cause is the exception.

    Attributes:
        state: Names of the history variables with their initial values, such as ``{"hardening": 0.0}``; none by
            default. :class:`Points` have arrays with these names.
        measure: Strain measure: ``"logarithmic"``, ½ ln b, which is the default, or ``"left-cauchy-green"``, ½ (b − I).
        symmetric: Whether tangents are symmetric, which is the default; unsymmetric equations are solved by LU or
            GMRES.

    Example:
        Linear elasticity in the logarithmic strain, the law ``hencky`` of decks:

        >>> class Hencky:
        ...     def __init__(self, bulk, shear):
        ...         one = np.array([1.0, 1, 1, 0, 0, 0])
        ...         volumetric = np.outer(one, one) / 3
        ...         self.stiffness = 3 * bulk * volumetric + 2 * shear * (np.eye(6) - volumetric)
        ...     def update(self, strain, history):
        ...         return strain @ self.stiffness, np.broadcast_to(self.stiffness, (len(strain), 6, 6))
        >>> law = Hencky(bulk=12e6 / 1.8, shear=12e6 / 2.4)
        >>> mpm.testing.check_material(law)
        []
        >>> deck = mpm.Deck.load("inputs/beam.yaml", steps=10)
        >>> own = deck.run(laws={"steel": law}, progress=False)
        >>> built_in = deck.run(progress=False)
        >>> bool(np.allclose(own.points.position, built_in.points.position, rtol=1e-12))
        True
    """

    def update(self, strain: Array, history: Array) -> Response:
        """The response to trial elastic strains.

        Args:
            strain: Trial elastic strain, shape (n, 6), [-]: the elastic strain if the whole step were elastic.
                Read-only.
            history: History variables at the start of the step, shape (n, number of variables). Read-only.

        Returns:
            The tuple (stress, tangent), or (stress, tangent, elastic strain, history) for laws with plastic flow: the
            Kirchhoff stress, shape (n, 6), [stress]; the algorithmic tangent, its derivative with respect to the trial
            strain, shape (n, 6, 6), [stress]; the elastic strain after the return mapping, shape (n, 6), [-]; and the
            history variables at the end of the step, shape (n, number of variables). A law refuses the strain of a
            point by returning a row that is not finite; the step is then cut.
        """
        ...


_WORD = re.compile(r"[A-Za-z_]\w*\Z")


class _Adapter:
    """A law as the library calls it: contiguous arrays of the right shapes."""

    def __init__(self, name: str, law: Law) -> None:
        if not callable(getattr(law, "update", None)):
            raise UsageError(f"the law of {name!r} has no method `update`")
        state = getattr(law, "state", None)
        state = {} if state is None else state
        if not isinstance(state, Mapping):
            raise UsageError(f"`state` of the law of {name!r} must be a mapping of names to initial values")
        self._name, self._law = name, law
        self._raised: BaseException | None = None
        for key in state:
            if not isinstance(key, str) or not _WORD.match(key) or _mpm.is_field_of_points(key):
                raise UsageError(f"a history variable of the law of {name!r} cannot be named {key!r}")
        self.fields = [(key, "-", self._initial(key, value)) for key, value in state.items()]
        measure = getattr(law, "measure", "logarithmic")
        if not isinstance(measure, str) or measure not in ("logarithmic", "left-cauchy-green"):
            words = "'logarithmic' or 'left-cauchy-green'"
            raise UsageError(f"`measure` of the law of {name!r} must be {words}, not {measure!r}")
        self.is_logarithmic = measure == "logarithmic"
        symmetric = getattr(law, "symmetric", True)
        if not isinstance(symmetric, (bool, np.bool_)):
            raise UsageError(f"`symmetric` of the law of {self._name!r} must be True or False, not {symmetric!r}")
        self.is_symmetric = bool(symmetric)

    def _initial(self, key: str, value: Any) -> float:
        try:
            initial = float(value)
        except (TypeError, ValueError, OverflowError):
            initial = math.nan
        if not math.isfinite(initial):
            raise UsageError(f"the initial value of {key!r} of the law of {self._name!r} is not a number: {value!r}")
        return initial

    def try_out(self) -> None:
        """Evaluates the law at one point without strain, so that mistakes are found before the run."""
        history = np.array([[initial for _, _, initial in self.fields]])
        self.respond(np.zeros((1, 6)), history)
        self.energies(np.zeros((1, 6)), history)

    def respond(self, strain: Array, history: Array) -> tuple[Array, Array, Array, Array]:
        strain.flags.writeable = False
        history.flags.writeable = False
        if self._raised is not None:
            raise self._raised
        try:
            return self._response(strain, history)
        except BaseException as error:
            # Some calls serve diagnostics only and ignore an exception; the next call therefore raises it again.
            self._raised = error
            raise

    def _response(self, strain: Array, history: Array) -> tuple[Array, Array, Array, Array]:
        found = self._law.update(strain, history)
        if not isinstance(found, tuple) or len(found) not in (2, 4):
            raise UsageError(
                f"`update` of the law of {self._name!r} must return (stress, tangent) or "
                f"(stress, tangent, elastic_strain, history)"
            )
        n = len(strain)
        stress, tangent = found[0], found[1]
        elastic, new = (found[2], found[3]) if len(found) == 4 else (strain, history)
        return (
            self._shaped("stress", stress, (n, 6)),
            self._shaped("elastic_strain", elastic, (n, 6)),
            self._shaped("tangent", tangent, (n, 6, 6)),
            self._shaped("history", new, (n, len(self.fields))),
        )

    def invert(self, stress: Array) -> Array | None:
        """The elastic strain that yields a stress; ``None`` if the law has no method for it."""
        inverse = getattr(self._law, "elastic_strain", None)
        return None if inverse is None else self._shaped("elastic_strain", inverse(stress), stress.shape)

    def _shaped(self, what: str, value: Any, shape: tuple[int, ...]) -> Array:
        if value is None or np.iscomplexobj(value):
            raise UsageError(f"{what} of the law of {self._name!r} is not an array of real numbers")
        array = np.ascontiguousarray(value, dtype=np.float64)
        if array.shape != shape:
            raise UsageError(f"{what} of the law of {self._name!r} has shape {array.shape}, not {shape}")
        return array

    def energies(self, strain: Array, history: Array) -> tuple[Array, Array]:
        """Stored energy and plastic work per initial volume."""
        n = len(strain)
        energy = getattr(self._law, "energy", None)
        if energy is None:
            # ½ τ : ε, exact for linear elasticity.
            stress = self.respond(strain, history)[0]
            stored = 0.5 * np.einsum("pi,pi->p", stress, strain)
        else:
            stored = self._shaped("energy", energy(strain), (n,))
        return np.ascontiguousarray(stored), self.plastic_work(history)

    def plastic_work(self, history: Array) -> Array:
        """Plastic work per initial volume; zero if the law does not state it."""
        work = getattr(self._law, "plastic_work", None)
        n = len(history)
        return np.zeros(n) if work is None else self._shaped("plastic_work", work(history), (n,))


def adapters(laws: Mapping[str, Law]) -> dict[str, _Adapter | _mpm.BuiltIn]:
    """The laws as the library takes them: adapters that it calls, and laws of its own."""
    if not isinstance(laws, Mapping):
        raise UsageError("laws must be a mapping of material names to laws")
    for name in laws:
        if not isinstance(name, str):
            raise UsageError(f"laws has the key {name!r}, which is not a material name")
    found: dict[str, _Adapter | _mpm.BuiltIn] = {}
    for name, law in laws.items():
        # A subclass may have methods of its own.
        found[name] = law._law if type(law) is BuiltInLaw else _Adapter(name, law)
    for adapter in found.values():
        if isinstance(adapter, _Adapter):
            adapter.try_out()
    return found


class BuiltInLaw:
    """A law of the library, to be evaluated from Python; itself a :class:`Law`.

    In ``laws`` of :meth:`Deck.start` or :meth:`Deck.run` it runs as a law of the deck does, without Python.

    Args:
        model: Name of the law in decks, such as ``"von-mises"``.
        parameters: Parameters of the law as in decks, such as ``young=1e6, poisson=0.3``: numbers, words such as
            ``match="compression"``, and the mapping ``softening``. Their unit of stress is also that of the results.

    Attributes:
        state: Names of the history variables with their initial values.
        measure: Strain measure, as for :class:`Law`.
        symmetric: Whether tangents are symmetric.

    Raises:
        UsageError: There is no such law, or its parameters have other names. The ranges of parameters are not checked.

    Example:
        >>> law = mpm.BuiltInLaw("hencky", young=1e6, poisson=0.25)
        >>> stress, tangent, _, _ = law.update(np.array([[1e-3, 0, 0, 0, 0, 0]]), np.zeros((1, 0)))
        >>> stress[0, :3].round()
        array([1200.,  400.,  400.])
    """

    def __init__(self, model: str, /, **parameters: float | str | Mapping[str, float]) -> None:
        if not isinstance(model, str):
            raise UsageError(f"model must be the name of a law, not {model!r}")
        plain = {name: _property(name, value) for name, value in parameters.items()}
        self._made_of: dict[str, Any] = {"model": model, **plain}
        self._law = _mpm.BuiltIn(json.dumps(self._made_of))
        self.state = {name: initial for name, _, initial in self._law.fields()}
        self.measure = "logarithmic" if self._law.is_logarithmic() else "left-cauchy-green"
        self.symmetric: bool = self._law.is_symmetric()

    def __reduce__(self) -> Any:
        return _made, (self._made_of,)

    def __repr__(self) -> str:
        model, *rest = self._made_of.items()
        return f"BuiltInLaw({model[1]!r}, {', '.join(f'{name}={value!r}' for name, value in rest)})"

    def update(self, strain: Array, history: Array) -> tuple[Array, Array, Array, Array]:
        """Stress, tangent, elastic strain and history; shapes and units as for :meth:`Law.update`.

        A row is not a number (NaN) if the law has no response to the strain.

        Raises:
            UsageError: An array has the wrong shape.
        """
        arrays = self._law.respond(_rows(strain, 6), _rows(history, len(self.state)))
        stress, elastic, tangent, new = cast("Sequence[Array]", arrays)
        return stress, tangent, elastic, new

    def elastic_strain(self, stress: Array) -> Array:
        """Elastic strain, shape (n, 6), at Kirchhoff stresses, shape (n, 6); NaN where no strain yields the stress."""
        return self._law.elastic_strain(_rows(stress, 6))

    def energy(self, strain: Array) -> Array:
        """Stored energy per initial volume, shape (n,), [stress], at elastic strains, shape (n, 6), [-]."""
        return self._law.energy(_rows(strain, 6))

    def plastic_work(self, history: Array) -> Array:
        """Plastic work per initial volume, shape (n,), [stress], at history variables, shape (n, variables)."""
        rows = _rows(history, len(self.state))
        return self._law.plastic_work(rows, len(rows))


def _made(made_of: dict[str, Any]) -> BuiltInLaw:
    parameters = dict(made_of)
    return BuiltInLaw(parameters.pop("model"), **parameters)


#: Properties of laws that are words.
_WORDS = ("match", "strength")


def _property(name: str, value: Any) -> float | str | dict[str, float]:
    if name in _WORDS:
        if not isinstance(value, str):
            raise UsageError(f"{name} must be a word, not {value!r}")
        return str.__str__(value)
    if name == "softening":
        if not isinstance(value, Mapping):
            raise UsageError(f"softening must be a mapping of names to numbers, not {value!r}")
        return {str(key): _number(f"{name}/{key}", entry) for key, entry in value.items()}
    return _number(name, value)


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, (str, bytes)) or not math.isfinite(number):
        raise UsageError(f"{name} must be a finite number, not {value!r}")
    return number


def _rows(values: Any, width: int) -> Array:
    if np.iscomplexobj(values):
        raise UsageError("the argument is not an array of real numbers")
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError(f"the argument is not an array of numbers: {error}") from None
    if array.ndim != 2 or array.shape[1] != width:
        raise UsageError(f"the argument has shape {array.shape}, not (n, {width})")
    return array
