"""Checks of laws written in Python, for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._errors import UsageError
from mpm._laws import Law, _Adapter

__all__ = ["Finding", "check_material"]


@dataclass(frozen=True, eq=False)
class Finding:
    """A property that a law lacks.

    Attributes:
        property: ``"Response"``, ``"Purity"``, ``"Tangent"``, ``"Symmetry"``, ``"Isotropy"``, ``"Admissibility"``,
            ``"Inverse"``, ``"Potential"``, ``"Batch"`` or ``"NotFinite"``.
        strain: Logarithmic trial strain with the largest error, in the layout of :class:`mpm.Law`, shape (6,), [-].
        error: Relative error at this strain, [-]; infinite if nothing can be compared.
        tolerance: The largest permissible error, [-].
    """

    property: str
    strain: npt.NDArray[np.float64]
    error: float
    tolerance: float

    def __str__(self) -> str:
        return (
            f"{self.property} at the strain {self.strain.tolist()}: relative error {self.error:.1e}, "
            f"tolerated {self.tolerance:.1e}"
        )


def check_material(law: Law, *, largest: float = 0.05) -> list[Finding]:
    """The properties that a law lacks, according to the tests that the built-in laws pass; empty if it lacks none.

    - ``Response``: the law responds to the strains, including zero strain.
    - ``Purity``: equal arguments give equal results.
    - ``Tangent``: the tangent is the derivative of the stress, by central differences.
    - ``Symmetry``: the tangent is symmetric if the law states this.
    - ``Isotropy``: a rotated strain yields the rotated stress.
    - ``Admissibility``: an update from the returned elastic strain yields the returned stress.
    - ``Inverse``: ``elastic_strain``, if the law has this method, returns a strain that yields the stress.
    - ``Potential``: in the elastic range, the energy is the potential of the stress.
    - ``Batch``: a point has the same response in every batch.
    - ``NotFinite``: a strain that is not finite is refused.

    The 72 strains are always the same: in space and in the plane, with the initial history variables.

    Args:
        law: The law.
        largest: Bound on the strain components, above 0, [-]; a tenth and a hundredth of it are tried, too.

    Raises:
        UsageError: The law has no method ``update``, or its arrays have the wrong shapes.

    Example:
        >>> class Wrong:
        ...     def update(self, strain, history):
        ...         return 1e6 * strain, np.broadcast_to(2e6 * np.eye(6), (len(strain), 6, 6))
        >>> for found in mpm.testing.check_material(Wrong()):
        ...     print(f"{found.property}: relative error {found.error:.2f}")
        Tangent: relative error 0.50
    """
    if isinstance(largest, bool) or not isinstance(largest, (int, float)) or not 0 < largest < np.inf:
        raise UsageError(f"largest must be a finite number above 0, not {largest!r}")
    findings = _mpm.conformance(_Adapter("law", law), largest)
    return [Finding(name, np.array(strain), error, tolerance) for name, strain, error, tolerance in findings]
