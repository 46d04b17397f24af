"""Meshes of a unit square or cube in a larger region of air, whose inner nodes are moved off their lattice."""

from itertools import permutations, product

import numpy as np

# Numbers of gmsh.
LINE, TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON = 1, 2, 3, 4, 5
SPACE = {"triangles": 2, "quadrilaterals": 2, "tetrahedra": 3, "hexahedra": 3}


def write(path, kind, cells=3, beyond=2, amount=0.15, air=True):
    """Writes a mesh with the groups `bar`, the unit square or cube of `cells` along each axis, `side`, its side x = 1, and
    `air`, which reaches `beyond` cells farther along each axis. Nodes are moved by up to `amount` cells, but those at the
    boundary of either region stay on it."""
    axes, far = SPACE[kind], cells + (beyond if air else 0)
    index = np.array(list(product(range(far + 1), repeat=axes)))
    move = np.random.default_rng(5).uniform(-amount, amount, index.shape)
    move[np.isin(index, [0, cells, far])] = 0
    nodes = (index + move) / cells
    number = {tuple(node): k + 1 for k, node in enumerate(index)}
    elements = []
    for cell in product(range(far), repeat=axes):
        inside = max(cell) < cells
        if inside or air:
            group = 1 if inside else 2
            elements += [(shape, group, [number[node] for node in part]) for shape, part in parts(kind, np.array(cell))]
    for cell in product(range(cells), repeat=axes - 1):
        corner = np.array([cells, *cell])
        elements += [(shape, 3, [number[node] for node in part]) for shape, part in side(kind, corner)]
    used = sorted({node for _, _, part in elements for node in part})
    names = {1: (axes, "bar"), 2: (axes, "air"), 3: (axes - 1, "side")}
    if not air:
        del names[2]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dimension} {group} "{name}"' for group, (dimension, name) in names.items()]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(used))]
    place = [[*map(float, nodes[node - 1]), 0.0][:3] for node in used]
    lines += [f"{node} {x!r} {y!r} {z!r}" for node, (x, y, z) in zip(used, place)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    lines += [f"{k + 1} {shape} 2 {group} 1 {' '.join(map(str, part))}" for k, (shape, group, part) in enumerate(elements)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def parts(kind, cell):
    """The elements of a cell of the lattice, as the shape and the indices of the nodes."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    if kind == "triangles":
        # The diagonals alternate.
        way = [[0, 1, 2], [0, 2, 3]] if sum(cell) % 2 else [[0, 1, 3], [1, 2, 3]]
        return [(TRIANGLE, [tuple(cell + square[k]) for k in corners]) for corners in way]
    if kind == "quadrilaterals":
        return [(QUADRILATERAL, [tuple(cell + corner) for corner in square])]
    if kind == "hexahedra":
        return [(HEXAHEDRON, [tuple(cell + [*corner, z]) for z in (0, 1) for corner in square])]
    # Six tetrahedra around a diagonal of the cube, one for each order of the axes.
    found = []
    for order in permutations(range(3)):
        corners = [np.zeros(3, int)]
        for axis in order:
            corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(corners[1:], float)) < 0:
            corners[2:] = [corners[3], corners[2]]
        found.append((TETRAHEDRON, [tuple(cell + corner) for corner in corners]))
    return found


def side(kind, corner):
    """The elements of a cell of the side x = 1."""
    if SPACE[kind] == 2:
        return [(LINE, [tuple(corner), tuple(corner + [0, 1])])]
    square = [tuple(corner + [0, y, z]) for y, z in [(0, 0), (1, 0), (1, 1), (0, 1)]]
    if kind == "hexahedra":
        return [(QUADRILATERAL, square)]
    return [(TRIANGLE, square[:3]), (TRIANGLE, [square[0], square[2], square[3]])]
