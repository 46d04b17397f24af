"""Limit load of a rough footing on rigid-plastic von Mises material, independent of the program.

    python3 benches/limit_analysis.py [CELLS ...]

Minimises the plastic power c ∫ √(2 D:D) dV over the isochoric velocities that move a footing of half width (radius) 1
down with velocity 1: quadratic velocities on nine nodes and discontinuous linear pressures in rectangles, graded towards
the edge of the footing, CELLS of them under the footing. Reweighted least squares: each iteration solves the linear flow
of viscosity c/√(2 D:D). Prints the load of the strip, whose exact value is 2 + π, and of the circle, in units of c, and
their extrapolations with order 1 from the numbers of cells n and 2n. Needs numpy and scipy.
"""

import sys

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve

CELLS = [4, 6, 8, 12]
ITERATIONS = 80
SMALLEST_RATE = 1e-3  # of strain, below which material counts as rigid; the velocity is 1, the half width 1
COMPRESSIBILITY = 1e-9  # relative to 1/c; keeps the equations regular
RATE_NORM = np.diag([2.0, 2.0, 2.0, 1.0])  # 2 D:D of (D_xx, D_yy, D_zz, 2 D_xy)


def graded(end, cells, ratio):
    """Lines from 0 to `end`, whose last cell is `ratio` times as wide as the first."""
    widths = ratio ** np.linspace(0, 1, cells)
    return end * np.concatenate([[0], np.cumsum(widths)]) / widths.sum()


class Ground:
    """Half of the ground, 5 wide and 3 deep, with the edge of the footing at (1, 3)."""

    def __init__(self, cells, revolved):
        self.x = np.concatenate([1 - graded(1, cells, 200)[::-1], 1 + graded(4, 2 * cells, 600)[1:]])
        self.y = 3 - graded(3, 2 * cells, 400)[::-1]
        self.revolved = revolved
        self.columns, self.rows = len(self.x) - 1, len(self.y) - 1
        self.lines = [np.interp(np.arange(2 * len(c) - 1) / 2, np.arange(len(c)), c) for c in (self.x, self.y)]
        self.integrate()

    def node(self, i, j):
        return j * (2 * self.columns + 1) + i

    def integrate(self):
        """Strain rates, weights and pressures at nine points of each cell."""
        places, weights = np.polynomial.legendre.leggauss(3)
        value = lambda t: np.array([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2])
        slope = lambda t: np.array([t - 0.5, -2 * t, t + 0.5])
        rates, volumes, pressures, nodes = [], [], [], []
        for row in range(self.rows):
            for column in range(self.columns):
                nodes.append([self.node(2 * column + a, 2 * row + b) for b in range(3) for a in range(3)])
                width, height = np.diff(self.x)[column], np.diff(self.y)[row]
                for s, ws in zip(places, weights):
                    for t, wt in zip(places, weights):
                        of_x = np.outer(value(t), slope(s)).ravel() * 2 / width
                        of_y = np.outer(slope(t), value(s)).ravel() * 2 / height
                        radius = self.x[column] + width * (1 + s) / 2
                        rate = np.zeros((4, 18))
                        rate[0, 0::2], rate[1, 1::2], rate[3, 0::2], rate[3, 1::2] = of_x, of_y, of_y, of_x
                        if self.revolved:
                            rate[2, 0::2] = np.outer(value(t), value(s)).ravel() / radius
                        rates.append(rate)
                        volumes.append(ws * wt * width * height / 4 * (2 * np.pi * radius if self.revolved else 1))
                        pressures.append([1, s, t])
        cells, nodes = len(nodes), np.array(nodes)
        self.rates = np.reshape(rates, (cells, 9, 4, 18))
        self.volumes, self.pressures = np.reshape(volumes, (cells, 9)), np.reshape(pressures, (cells, 9, 3))
        self.unknowns = np.stack([2 * nodes, 2 * nodes + 1], -1).reshape(cells, 18)
        self.size = 2 * (2 * self.columns + 1) * (2 * self.rows + 1)

    def held(self):
        """Prescribed velocities: symmetry, a smooth side, a rough base, a rough footing."""
        (across, up), velocities = (len(lines) for lines in self.lines), {}
        for j in range(up):
            velocities |= {2 * self.node(0, j): 0.0, 2 * self.node(across - 1, j): 0.0}
        for i in range(across):
            velocities |= {2 * self.node(i, 0): 0.0, 2 * self.node(i, 0) + 1: 0.0}
            if self.lines[0][i] <= 1 + 1e-12:
                velocities |= {2 * self.node(i, up - 1): 0.0, 2 * self.node(i, up - 1) + 1: -1.0}
        return np.array(list(velocities)), np.array(list(velocities.values()))

    def load(self):
        """Mean pressure on the footing in units of c."""
        cells = len(self.volumes)
        dilatation = self.rates[:, :, :3].sum(axis=2)
        flow = np.einsum("eq,eqp,eqd->epd", self.volumes, self.pressures, dilatation)
        rows = np.repeat(np.arange(3 * cells).reshape(cells, 3, 1), 18, axis=2)
        columns = np.repeat(self.unknowns[:, None], 3, axis=1)
        shape = (3 * cells, self.size)
        flow = sparse.csr_matrix((flow.ravel(), (rows.ravel(), columns.ravel())), shape)
        soft = COMPRESSIBILITY * sparse.diags(np.repeat(self.volumes.sum(axis=1), 3))
        held, velocities = self.held()
        free = np.setdiff1d(np.arange(self.size), held)
        velocity, viscosity, power = np.zeros(self.size), np.ones_like(self.volumes), 0.0
        velocity[held] = velocities
        into = np.repeat(self.unknowns[:, :, None], 18, axis=2), np.repeat(self.unknowns[:, None], 18, axis=1)
        for _ in range(ITERATIONS):
            weights = self.volumes * viscosity
            stiffness = np.einsum("eq,eqad,ab,eqbf->edf", weights, self.rates, RATE_NORM, self.rates, optimize=True)
            stiffness = sparse.csr_matrix((stiffness.ravel(), (into[0].ravel(), into[1].ravel())), (self.size,) * 2)
            matrix = sparse.bmat([[stiffness[free][:, free], flow[:, free].T], [flow[:, free], -soft]], "csc")
            known = [-stiffness[free][:, held] @ velocities, -flow[:, held] @ velocities]
            velocity[free] = spsolve(matrix, np.concatenate(known))[: len(free)]
            rate = np.einsum("eqad,ed->eqa", self.rates, velocity[self.unknowns])
            rate = np.sqrt(np.einsum("eqa,ab,eqb->eq", rate, RATE_NORM, rate))
            before, power = power, (self.volumes * rate).sum()
            viscosity = 1 / np.hypot(rate, SMALLEST_RATE)
            if abs(power - before) < 1e-6 * power:
                break
        return power / (np.pi if self.revolved else 1)


def main():
    loads = {}
    print("| cells | strip | extrapolated | circle | extrapolated |\n|---|---|---|---|---|")
    for cells in map(int, sys.argv[1:] or CELLS):
        loads[cells] = [Ground(cells, revolved).load() for revolved in (False, True)]
        texts = []
        for shape, load in enumerate(loads[cells]):
            coarse = loads.get(cells / 2)
            texts += [f"{load:.4f}", f"{2 * load - coarse[shape]:.4f}" if coarse else "–"]
        print("| " + " | ".join([str(cells), *texts]) + " |", flush=True)


if __name__ == "__main__":
    main()
