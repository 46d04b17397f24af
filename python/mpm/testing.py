"""Checks of laws written in Python, for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._laws import Law, _Adapter

__all__ = ["Finding", "check_material"]


@dataclass(frozen=True)
class Finding:
    """A property that a law lacks.

    Attributes:
        property: ``"Response"``, ``"Purity"``, ``"Tangent"``, ``"Symmetry"``, ``"Isotropy"``, ``"Admissibility"``,
            ``"Inverse"``, ``"Potential"``, ``"Batch"`` or ``"NotFinite"``.
        strain: Logarithmic trial strain where the error is largest, shape (6,).
        error: Relative error there.
        tolerance: The largest permissible error.
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
    """The properties that a law lacks, by the test that the laws of the library pass; empty if there are none.

    The tangent is compared with central differences, symmetry with what the law states; the law is a function of its
    arguments alone; the returned elastic strain gives the returned stress; the energy is the potential of the stress;
    a point has the same response in every batch; a rotated strain has the rotated stress.

    Args:
        law: The law.
        largest: Bound of the components of the strains, [-]; a tenth and a hundredth of it are tried, too.

    Example:
        >>> from mpm.testing import check_material
        >>> check_material(mpm.BuiltInLaw("von-mises", young=1e6, poisson=0.3, deviatoric_yield_stress=2e4))
        []
    """
    findings = _mpm.conformance(_Adapter("law", law), largest)
    return [Finding(name, np.array(strain), error, tolerance) for name, strain, error, tolerance in findings]
