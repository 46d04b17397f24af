"""Compares the areas and volumes of mesh and surface files with those of independent readers.

    STRANGERS=FOLDER DAMAGED=1000 cargo test --release --test fuzz strangers -- --ignored --nocapture > sizes.txt
    python tests/python/strangers.py FOLDER sizes.txt

Meshes are read by meshio, surfaces by a few lines below. Surfaces whose corners were merged may differ by the merging.
"""

import contextlib
import io
import re
import sys
from pathlib import Path

import meshio
import numpy as np

CORNERS = {"triangle": (2, 3), "quad": (2, 4), "tetra": (3, 4), "hexahedron": (3, 8)}
HEXAHEDRON = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def size_of_cells(kind, x):
    if kind == "triangle":
        return 0.5 * np.abs(cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])).sum()
    if kind == "quad":
        return 0.5 * np.abs(cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])).sum()
    if kind == "tetra":
        return np.abs(np.linalg.det(x[:, 1:] - x[:, :1])).sum() / 6
    volume = np.zeros(len(x))
    for at in HEXAHEDRON / np.sqrt(3):
        ones = 1 + HEXAHEDRON * at
        gradients = HEXAHEDRON * np.stack([ones[:, 1] * ones[:, 2], ones[:, 0] * ones[:, 2], ones[:, 0] * ones[:, 1]], 1) / 8
        volume += np.linalg.det(np.einsum("nki,kj->nij", x, gradients))
    return np.abs(volume).sum()


def size_of_mesh(path):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        mesh = meshio.gmsh.read(path)
    blocks = [(block.type.rstrip("0123456789"), block.data) for block in mesh.cells]
    dimension = 3 if any(kind in ("tetra", "hexahedron") for kind, _ in blocks) else 2
    total, seen = 0.0, set()
    for kind, cells in blocks:
        if CORNERS.get(kind, (0, 0))[0] != dimension:
            continue
        # A cell of several groups is repeated in format 2.
        own = [cell for cell in map(tuple, cells[:, : CORNERS[kind][1]]) if not (cell in seen or seen.add(cell))]
        if own:
            total += size_of_cells(kind, mesh.points[np.array(own)])
    return total


def size_of_surface(path):
    content = path.read_bytes()
    count = int.from_bytes(content[80:84], "little") if len(content) > 84 else 0
    rest = len(content) - 84 - 50 * count
    if count and (rest == 0 or (rest > 0 and rest % 50)):
        x = np.frombuffer(content[84 : 84 + 50 * count], dtype=FACET)["corners"].astype(float)
    else:
        words = re.findall(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)", content.decode("utf8", "replace").lower())
        x = np.array(words, float).reshape(-1, 3, 3)
    return np.linalg.det(x - x.reshape(-1, 3).mean(axis=0)).sum() / 6


def main(folder, table):
    compared, unread, worst, wrong = 0, [], 0.0, []
    for line in Path(table).read_text().splitlines():
        words = line.split("\t")
        if len(words) < 4 or words[1] != "accepted" or "merged" in line:
            continue
        path = Path(folder) / words[0]
        try:
            size = size_of_surface(path) if words[2] == "surface" else size_of_mesh(path)
        except Exception as error:  # noqa: BLE001 - readers of others fail in many ways
            unread.append(f"{words[0]}: {error}"[:100])
            continue
        compared += 1
        difference = abs(float(words[3]) - size) / abs(size)
        worst = max(worst, difference)
        if difference > 1e-12:
            wrong.append(f"{words[0]}: {words[3]} here, {size} there")
    print(f"{compared} compared, largest relative difference {worst:.1e}; {len(unread)} not read by the others")
    print("\n".join([*wrong, *unread]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
