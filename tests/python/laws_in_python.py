"""Laws in NumPy that are those of the library."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: The unit tensor as a row xx, yy, zz, √2 xy, √2 yz, √2 xz.
UNIT: Array = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
#: The projection onto deviators.
DEVIATOR: Array = np.eye(6) - np.outer(UNIT, UNIT) / 3


class Elasticity:
    """Isotropic elasticity with the Kirchhoff stress linear in the elastic logarithmic strain."""

    def __init__(self, *, young: float, poisson: float) -> None:
        self.bulk = young / (3 * (1 - 2 * poisson))
        self.shear = young / (2 * (1 + poisson))

    def elastic_tangent(self) -> Array:
        tangent: Array = self.bulk * np.outer(UNIT, UNIT) + 2 * self.shear * DEVIATOR
        return tangent

    def energy(self, strain: Array) -> Array:
        trace = strain[:, :3].sum(axis=1)
        deviator = strain - trace[:, None] / 3 * UNIT
        energy: Array = self.bulk / 2 * trace**2 + self.shear * (deviator * deviator).sum(axis=1)
        return energy


class Hencky(Elasticity):
    """Hencky elasticity."""

    def update(self, strain: Array, history: Array) -> tuple[Array, Array]:
        trace = strain[:, :3].sum(axis=1)
        stress = 2 * self.shear * strain
        stress[:, :3] += ((self.bulk - 2 / 3 * self.shear) * trace)[:, None]
        return stress, np.broadcast_to(self.elastic_tangent(), (len(strain), 6, 6))


class VonMises(Elasticity):
    """Von Mises plasticity with linear isotropic hardening."""

    state = {"equivalent_plastic_strain": 0.0}

    def __init__(
        self, *, young: float, poisson: float, deviatoric_yield_stress: float, hardening_modulus: float = 0.0
    ) -> None:
        super().__init__(young=young, poisson=poisson)
        self.radius, self.hardening = deviatoric_yield_stress, hardening_modulus

    def update(self, strain: Array, history: Array) -> tuple[Array, Array, Array, Array]:
        shear, ratio = self.shear, np.sqrt(2 / 3)
        trace = strain[:, :3].sum(axis=1)
        deviator = strain - trace[:, None] / 3 * UNIT
        trial = 2 * shear * np.linalg.norm(deviator, axis=1)
        reached = self.radius + self.hardening * history[:, 0]
        growth = ratio * self.hardening
        # Round-off must not make points flow that are on the surface.
        flows = trial >= reached * (1 + 1e-10)
        safe = np.where(flows, trial, 1.0)
        flow = np.where(flows, (trial - reached) / (2 * shear + growth), 0.0)
        kept = np.where(flows, (reached + flow * growth) / safe, 1.0)
        normal = 2 * shear * deviator / safe[:, None]
        stress = 2 * shear * deviator * kept[:, None] + self.bulk * trace[:, None] * UNIT
        along = np.where(flows, 2 * shear * kept - 2 * shear * growth / (2 * shear + growth), 0.0)
        tangent = (
            self.bulk * np.outer(UNIT, UNIT)
            + (2 * shear * kept)[:, None, None] * DEVIATOR
            - along[:, None, None] * (normal[:, :, None] * normal[:, None, :])
        )
        return stress, tangent, strain - flow[:, None] * normal, history + (ratio * flow)[:, None]

    def plastic_work(self, history: Array) -> Array:
        kappa = history[:, 0]
        work: Array = (self.radius + self.hardening / 2 * kappa) * kappa / np.sqrt(2 / 3)
        return work
