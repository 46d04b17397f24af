"""Every part of the package in use, with types: mypy checks it, and test_package_types.py runs it."""

from __future__ import annotations

from pathlib import Path

import mpm
import numpy as np
import numpy.typing as npt
from mpm.testing import check_material

from laws_in_python import Hencky


def stepped(path: Path) -> tuple[list[int], npt.NDArray[np.float64]]:
    """Halves the load after the second step."""
    deck = mpm.Deck.load(path, h=0.5, method="gimp", steps=4)
    errors: list[mpm.Diagnostic] = [found for found in deck.check() if found.severity == "error"]
    if errors:
        line: int | None = errors[0].line
        raise ValueError(f"{errors[0].code} in line {line}")
    residuals: list[float] = []

    def tell(step: int, iteration: int, residual: float) -> None:
        residuals.append(residual)

    law: mpm.Law = Hencky(young=12e6, poisson=0.2)
    iterations: list[int] = []
    with deck.start(threads=2, laws={"steel": law}, on_iteration=tell) as run:
        for step in run:
            iterations.append(step.iterations)
            reaction: float = step.reactions["root"][0]
            assert np.isfinite(reaction) and step.residual == residuals[-1]
            if step.index == 2:
                run.deck["loads"][0]["total"] = [0, -50e3]
                run.change()
        return iterations, run.points.cauchy_stress


def written(path: Path, out: Path) -> float:
    """The deflection, from files."""
    result: mpm.Result = mpm.Deck.load(path, steps=2).run(out=out, progress=False)
    again = mpm.read(out)
    column: npt.NDArray[np.float64] = again.history["tip_uy"]
    times: list[float] = [frame.time for frame in again.frames]
    points: mpm.Points | None = result.points
    assert points is not None and len(points.position) and times[-1] == 1.0
    return float(column[-1])


def studied(path: Path) -> list[float | None]:
    study: mpm.Study = mpm.sweep(mpm.Deck.load(path, steps=2), {"n": [2, 3]}, processes=1)
    first: mpm.Member = study[0]
    rest: mpm.Study = study[1:]
    assert first.error is None and len(rest) == 1
    return study.column("tip_uy")


def checked() -> bool:
    laws: list[mpm.Law] = [Hencky(young=1e6, poisson=0.3), mpm.BuiltInLaw("hencky", young=1e6, poisson=0.3)]
    return not any(check_material(law) for law in laws)
