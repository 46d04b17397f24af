"""Writes spectral.csv: logarithm and exponential of symmetric tensors with two or three eigenvalues that are equal up
to a gap, and their derivatives, in 60 digits by mpmath. Run by hand: python3 tests/data/spectral.py"""

import itertools
from pathlib import Path

import mpmath as mp

mp.mp.dps = 60
MANDEL = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
GAPS = [1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-15, 1e-16]
PATTERNS = {
    "lower pair": lambda g: (0.6, 0.6 * (1 + g), 2.3),
    "upper pair": lambda g: (1.7, 1.7 * (1 + g), 0.4),
    "triple": lambda g: (1.3, 1.3 * (1 + g), 1.3 * (1 - g / 3)),
}
# Euler angles: the axes themselves, a rotation about one axis, one about all.
DIRECTIONS = [(0, 0, 0), (0, 0, 0.7), (0.4, -1.1, 2.3)]


def rotation(angles):
    total = mp.eye(3)
    for axis, angle in enumerate(angles):
        i, j = [k for k in range(3) if k != axis]
        r = mp.eye(3)
        r[i, i] = r[j, j] = mp.cos(angle)
        r[i, j], r[j, i] = -mp.sin(angle), mp.sin(angle)
        total = total * r
    return total


def rounded(values, angles):
    """The tensor in double precision; the reference is that of its rounded entries."""
    q = rotation(angles)
    full = q * mp.diag(values) * q.T
    return [float(full[i, j]) for i, j in MANDEL]


def divided(f, slope, third, a, b):
    """(f(a) - f(b))/(a - b), by its series where 60 digits do not bear the difference."""
    if abs(a - b) > mp.mpf(10) ** -25:
        return (f(a) - f(b)) / (a - b)
    m = (a + b) / 2
    return slope(m) + third(m) * (a - b) ** 2 / 24


def function(entries, f, slope, third):
    """f of a tensor in the Mandel layout, and the lower triangle of its derivative by columns."""
    t = mp.matrix(3, 3)
    for (i, j), x in zip(MANDEL, entries):
        t[i, j] = t[j, i] = mp.mpf(x)
    values, q = mp.eigsy(t)
    weight = [1 if i == j else mp.sqrt(2) for i, j in MANDEL]

    def mandel(m):
        return [w * (m[i, j] + m[j, i]) / 2 for (i, j), w in zip(MANDEL, weight)]

    value = mandel(q * mp.diag([f(x) for x in values]) * q.T)
    derivative = mp.matrix(6, 6)
    for a, b in itertools.product(range(3), repeat=2):
        e = mandel(q[:, a] * q[:, b].T)
        factor = divided(f, slope, third, values[a], values[b])
        for r, c in itertools.product(range(6), repeat=2):
            derivative[r, c] += factor * e[r] * e[c]
    return value + [derivative[r, c] for c in range(6) for r in range(c, 6)]


def main():
    lines = ["# xx,yy,zz,yz,xz,xy (tensor components); then in the Mandel layout ln (6), its derivative (lower "
             "triangle by columns, 21), exp (6), its derivative (21)"]
    for pattern, gap, angles in itertools.product(PATTERNS, GAPS, DIRECTIONS):
        entries = rounded(PATTERNS[pattern](gap), angles)
        log = function(entries, mp.log, lambda x: 1 / x, lambda x: 2 / x**3)
        exp = function(entries, mp.exp, mp.exp, mp.exp)
        lines.append(",".join([repr(x) for x in entries] + [mp.nstr(x, 13) for x in log + exp]))
    Path(__file__).with_name("spectral.csv").write_text("\n".join(lines) + "\n")


main()
