"""Laws compiled by Numba, point by point, that are those of the library."""

import numba
import numpy as np

from laws_in_python import VonMises


@numba.njit
def respond(strain, kappa, bulk, shear, radius, hardening):
    """Radial return for all points."""
    n = len(strain)
    stress, elastic, new = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 1))
    tangent = np.empty((n, 6, 6))
    ratio = np.sqrt(2 / 3)
    growth = ratio * hardening
    deviator = np.empty(6)
    for p in range(n):
        trace = strain[p, 0] + strain[p, 1] + strain[p, 2]
        square = 0.0
        for i in range(6):
            deviator[i] = strain[p, i] - (trace / 3 if i < 3 else 0.0)
            square += deviator[i] ** 2
        trial = 2 * shear * np.sqrt(square)
        reached = radius + hardening * kappa[p, 0]
        flow, kept, along, per = 0.0, 1.0, 0.0, 0.0
        if trial >= reached * (1 + 1e-10):
            per = 2 * shear / trial
            flow = (trial - reached) / (2 * shear + growth)
            kept = (reached + flow * growth) / trial
            along = 2 * shear * kept - 2 * shear * growth / (2 * shear + growth)
        new[p, 0] = kappa[p, 0] + ratio * flow
        for i in range(6):
            normal = per * deviator[i]
            stress[p, i] = 2 * shear * deviator[i] * kept + (bulk * trace if i < 3 else 0.0)
            elastic[p, i] = strain[p, i] - flow * normal
            for j in range(6):
                both = i < 3 and j < 3
                projected = (1.0 if i == j else 0.0) - (1 / 3 if both else 0.0)
                tangent[p, i, j] = (
                    (bulk if both else 0.0) + 2 * shear * kept * projected - along * normal * (per * deviator[j])
                )
    return stress, tangent, elastic, new


@numba.njit
def respond_elastically(strain, bulk, shear):
    n = len(strain)
    stress, tangent = np.empty((n, 6)), np.zeros((n, 6, 6))
    for p in range(n):
        pressure = (bulk - 2 / 3 * shear) * (strain[p, 0] + strain[p, 1] + strain[p, 2])
        for i in range(6):
            stress[p, i] = 2 * shear * strain[p, i] + (pressure if i < 3 else 0.0)
            tangent[p, i, i] = 2 * shear
        for i in range(3):
            for j in range(3):
                tangent[p, i, j] += bulk - 2 / 3 * shear
    return stress, tangent


class CompiledVonMises(VonMises):
    def update(self, strain, history):
        return respond(strain, history, self.bulk, self.shear, self.radius, self.hardening)


class CompiledHencky:
    def __init__(self, *, young, poisson):
        self.bulk, self.shear = young / (3 * (1 - 2 * poisson)), young / (2 * (1 + poisson))

    def update(self, strain, history):
        return respond_elastically(strain, self.bulk, self.shear)
