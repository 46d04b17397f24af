"""Closed-form companion of the cantilever: the inextensible elastica under a dead end load."""

import numpy as np


def elastica(forces, length=10.0, stiffness=12e6 / (1 - 0.2**2) / 12):
    """Tip displacement (x, y) under each force, by shooting on the tip angle; `stiffness` is EI per unit thickness."""
    tips = []
    for force in forces:
        k = force / stiffness
        low, high = 0.0, np.pi / 2
        for _ in range(60):
            tip = 0.5 * (low + high)
            # θ' = √(2k (sin θ_tip − sin θ)); the substitution θ = θ_tip (1 − t²) removes the singular end.
            t = (np.arange(2000) + 0.5) / 2000
            theta = tip * (1 - t * t)
            ds = 2 * tip * t / np.sqrt(2 * k * (np.sin(tip) - np.sin(theta))) / 2000
            if ds.sum() < length:
                low = tip
            else:
                high = tip
        tips.append((np.sum(np.cos(theta) * ds) - length, -np.sum(np.sin(theta) * ds)))
    return np.array(tips).T
